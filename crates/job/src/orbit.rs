//! A closed orbit, and its branch along a parameter, as a question.

use std::cell::RefCell;

use nalgebra::SVector;
use serde::Serialize;
use serde_json::Value;

use super::answer::{Answer, Stop};
use super::question::{Ask, JobError, Question};
use super::rest::{self, Rest};
use super::run::Run;
use super::spec::{Observation, RunSpec, SpecError, SwitchSpec};
use super::table::{Column, Entry, Table};
use super::translation::MOST_STATES;
use twofold_analyse::branch::{
    self, Branch, BranchOptions, End, Newton, Obstacle, Orbit, ReturnMap, Trouble,
};
use twofold_analyse::filippov_return;
use twofold_analyse::floquet::{self, ReturnPlane, Returned};
use twofold_instances_switched::Motions;
use twofold_instances_tangent::Returns;
use twofold_integrate::{Failure, Monitor, Schedule, Tolerance};
use twofold_num::elementary::sqrt;
use twofold_num::tape::Program;
use twofold_system::{Bound, BoundField, Field, System};

/// The closed orbit through a plane near a start, by Newton's method, and its branch along a
/// parameter if one is named.
///
/// Smoothed and hysteretic systems: the return map's derivative is exact (variational equation).
/// Discontinuous ones: by differences, through crossings and sliding; grazing and set-valued orbits
/// are refused (see [`filippov_return`]).
///
/// Tables: `orbit` (its crossings of the plane), `branch` (a row per orbit) and `bifurcations` if a
/// parameter is followed. Facts: `period`, `multipliers` (real, imaginary), `multiplier_error`,
/// `stability`, `largest_modulus`, `rate`, `residual`, `iterations`, `returns`, `point`; `end` of
/// the branch. Where the motion comes to a rest: the table `rest` and the fact `rest` alone.
///
/// ```
/// use twofold_analyse::floquet::ReturnPlane;
/// use twofold_integrate::{Tolerance, filippov::ExitRule};
/// use twofold_job::{ClosedOrbit, Executor, spec::SwitchSpec};
/// use twofold_system::System;
/// let question = ClosedOrbit {
///     system: System::builtin("stick-slip").expect("built in"),
///     switch: SwitchSpec::Filippov { exit: ExitRule::Undecided, funnel: None },
///     start: vec![0.0, 0.0],
///     settle: 50.0,
///     plane: ReturnPlane { axis: 1, value: 0.0, upward: true },
///     returns: None,
///     tolerance: Tolerance { rtol: 1e-11, atol: 1e-11 },
///     longest_return: 100.0,
///     along: None,
/// };
/// let period: f64 = Executor::quiet().ask(&question)?.fact("period")?;
/// assert!((period - 6.736_837).abs() < 1e-5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClosedOrbit {
    /// The system.
    pub system: System,
    /// The switch.
    pub switch: SwitchSpec,
    /// State at which the search begins.
    pub start: Vec<f64>,
    /// Longest time for which the motion settles before Newton's method begins; 0: not at all.
    pub settle: f64,
    /// The plane.
    pub plane: ReturnPlane,
    /// Crossings per turn in the plane's direction; none: as many as the settled motion shows.
    pub returns: Option<usize>,
    /// Local error of the orbit and its tangent vectors.
    pub tolerance: Tolerance,
    /// Give up on a return after this time.
    pub longest_return: f64,
    /// The parameter to follow it along.
    pub along: Option<Along>,
}

/// Why closed orbits of a switch that depends on the past are not looked for; none of another.
fn has_past(switch: SwitchSpec) -> Option<SpecError> {
    let (value, rule) = match switch {
        SwitchSpec::Delayed { .. } => (
            "delayed",
            "a closed orbit of a delayed switch is a closed path of pasts, which this method does \
                not look for; see what a long run settles on",
        ),
        SwitchSpec::Relay { .. } => (
            "relay",
            "a closed orbit of a relay with memory has its mode as a state, which this method does \
                not carry; see what a long run settles on",
        ),
        _ => return None,
    };
    Some(SpecError { field: "switch", value: value.into(), rule })
}

/// A parameter and its range.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Along {
    /// Its name: one of the system's, or `eps`.
    pub parameter: String,
    /// Parameter value at which the first orbit is sought.
    pub from: f64,
    /// The other end.
    pub to: f64,
    /// Steps that the range is divided into, at least.
    pub steps: usize,
    /// Maximum number of orbits.
    pub most: usize,
}

/// Largest |P(u) - u| that counts as closed, in relative tolerances of the orbit's extent; and
/// never less than [`LEAST_CLOSED`].
pub(super) const CLOSED: f64 = 100.0;
pub(super) const LEAST_CLOSED: f64 = 1e-10;
/// Returns from which the loop's size is taken: the first may have been computed with too large an
/// error.
const SIZINGS: usize = 2;
/// A search that has come to a rest to this share of its way has found the rest.
const AT_REST: f64 = 1e-3;
/// The map that is computed less accurately has so many times the error.
pub(super) const ROUGHLY: f64 = 10.0;
/// Newton iterations.
pub(super) const ITERATIONS: usize = 30;
/// Most returns that are looked for in a settled motion.
const MOST_RETURNS: usize = 32;
/// Two crossings this near, in shares of their size, are taken for one when returns are counted:
/// Newton's method then decides.
const SAME_PASSAGE: f64 = 1e-3;
/// States are of order one down to this size.
const SMALL: f64 = 1e-3;

impl Question for ClosedOrbit {
    fn kind(&self) -> &'static str {
        "closed-orbit"
    }

    fn json(&self) -> Value {
        serde_json::to_value(self).expect("questions are plain data")
    }

    fn label(&self) -> String {
        match &self.along {
            Some(along) => format!("closed orbits along {}", along.parameter),
            None => "closed orbit".into(),
        }
    }

    fn cost(&self) -> f64 {
        let members = self.along.as_ref().map_or(1.0, |a| 3.0 * a.steps as f64);
        10.0 * (self.settle + members * 50.0)
    }

    fn compute(&self, executor: &dyn Ask, monitor: &dyn Monitor) -> Result<Answer, JobError> {
        self.validate()?;
        let (guess, returns) = match self.guess(executor)? {
            Guess::Loop { point, returns } => (point, returns),
            Guess::Rest(rest) => return Ok(at_rest(&self.names(), &rest)),
        };
        let value = self.along.as_ref().map_or(0.0, |a| a.from);
        let mut map =
            Map { question: self, returns, tolerance: self.tolerance, failure: RefCell::new(None) };
        // The absolute error is one of the loop's size, whatever its unit.
        for _ in 0..SIZINGS {
            let Ok(r) = map.returned(&guess, value, false) else { break };
            map.tolerance.atol =
                self.tolerance.atol.min(self.tolerance.rtol * r.extent).max(f64::MIN_POSITIVE);
        }
        let Tolerance { rtol, atol } = map.tolerance;
        let newton = Newton {
            closed: (CLOSED * rtol).max(LEAST_CLOSED),
            atol,
            rtol,
            iterations: ITERATIONS,
        };
        let first = match branch::closed_orbit(&map, &guess, value, newton) {
            Ok(first) => first,
            Err(trouble) => {
                return match self.rest_instead(executor, &trouble, &guess, value)? {
                    Some(rest) => Ok(at_rest(&self.names(), &rest)),
                    None => Err(map.error(trouble.said)),
                };
            }
        };
        // A motion that alternates as it settles shows multiples of the returns.
        let fewer = || (1..map.returns).filter(|fewer| map.returns.is_multiple_of(*fewer));
        let least = self.returns.is_none().then(fewer).into_iter().flatten().find_map(|fewer| {
            let map = Map { returns: fewer, failure: RefCell::new(None), ..map };
            let orbit = branch::closed_orbit(&map, &first.point, value, newton).ok()?;
            let apart = apart(&orbit.point, &first.point);
            let off = first.off(newton).min(SAME_PASSAGE);
            (apart <= off * first.extent).then_some((map, orbit))
        });
        let (map, first) = least.unwrap_or((map, first));
        let mut answer = self.facts(&first, map.returns);
        let Some(along) = &self.along else { return Ok(answer) };
        let options = BranchOptions {
            from: along.from,
            to: along.to,
            longest: 1.0 / along.steps as f64,
            most: along.most,
            size: 0.0,
            newton,
        };
        let width = (along.to - along.from).abs();
        let mut go_on = |orbit: &Orbit| {
            monitor.reached(((orbit.parameter - along.from) / width).abs().min(1.0)).is_continue()
        };
        let found = branch::follow(&map, first, &options, &mut go_on);
        if found.end == End::Interrupted {
            answer.stop = Stop::Interrupted;
        }
        answer.tables.extend(branch_tables(&along.parameter, &self.names(), &found));
        Ok(answer.with_fact("end", &found.end))
    }
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    sqrt(a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum())
}

/// The answer where there is a rest and no closed orbit.
pub(super) fn at_rest<S: AsRef<str>>(names: &[S], rest: &Rest) -> Answer {
    let columns = names.iter().map(|name| Column::numbers(name.as_ref())).collect::<Vec<_>>();
    let mut table = Table::new("rest", columns);
    table.push(rest.state.iter().map(|x| Entry::Number(*x)));
    Answer::of_tables(vec![table]).with_fact("rest", rest)
}

/// Set on which the motion from the start settles: a first guess.
#[derive(Clone, Debug, PartialEq)]
enum Guess {
    /// Start of Newton's method, in the equation's states, and the number of returns.
    Loop {
        point: Vec<f64>,
        returns: usize,
    },
    Rest(Rest),
}

impl ClosedOrbit {
    /// The motion from a start, which is looked at on the plane.
    fn motion(&self, system: &System, switch: SwitchSpec, start: &[f64], t_end: f64) -> RunSpec {
        RunSpec {
            system: system.clone(),
            switch,
            start: start[..system.dimension()].to_vec(),
            t_end,
            method: super::spec::MethodSpec {
                name: super::spec::Method::Dopri5,
                tolerance: Tolerance { rtol: 1e-9, atol: (100.0 * self.tolerance.atol).min(1e-9) },
                step_cap: twofold_integrate::StepCap::None,
                max_steps: super::spec::DEFAULT_MAX_STEPS,
                precision: None,
                order: None,
            },
            schedule: Schedule::default(),
            observe: Observation::Section { coordinate: self.plane.axis, value: self.plane.value },
        }
    }

    /// The rest that the search came to, or the motion from a point that it does not return to.
    fn rest_instead(
        &self,
        executor: &dyn Ask,
        trouble: &Trouble,
        guess: &[f64],
        value: f64,
    ) -> Result<Option<Rest>, JobError> {
        let Obstacle::Point(point) = &trouble.obstacle else { return Ok(None) };
        let (system, switch) = self.at(value)?;
        let there = |r: &Rest| {
            apart(&r.state, point) <= AT_REST * apart(&r.state, guess).max(apart(point, guess))
        };
        if let Some(rest) = rest::near(&system, switch, point).filter(there) {
            return Ok(Some(rest));
        }
        let motion = self.motion(&system, switch, point, self.longest_return);
        match executor.ask(&Run(motion.clone())) {
            Ok(answer) => rest::at_end(executor, &motion, &answer),
            Err(JobError::Interrupted) => Err(JobError::Interrupted),
            Err(_) => Ok(None),
        }
    }

    fn validate(&self) -> Result<(), JobError> {
        let wrong = |field, value: String, rule| Err(SpecError { field, value, rule }.into());
        let n = self.system.dimension();
        if !(2..=MOST_STATES).contains(&n) {
            return wrong(
                "system",
                format!("one of {n} states"),
                "such orbits are looked for in systems of 2 to 4 states; those of more as orbits \
                    of general systems",
            );
        }
        if let Some(refused) = has_past(self.switch) {
            return Err(refused.into());
        }
        if self.plane.axis >= n {
            return wrong(
                "section",
                self.plane.axis.to_string(),
                "there is no state of that number (they count from 0, and 1 is the default); \
                 name another, as in --section x=0",
            );
        }
        if let Some(along) = &self.along {
            for end in [along.from, along.to] {
                if let Err(error) = self.at(end) {
                    let value = format!("\"{}\" ({error})", along.parameter);
                    return wrong(
                        "along",
                        value,
                        "name a parameter of the system and values that it may have, or eps",
                    );
                }
            }
            if along.from == along.to || along.steps == 0 {
                return wrong(
                    "along",
                    format!("{} to {}", along.from, along.to),
                    "give two ends and at least one step",
                );
            }
        }
        if self.returns == Some(0) {
            return wrong(
                "returns",
                "0".into(),
                "a closed orbit crosses its plane at least once per turn: ask for one return or \
                    more",
            );
        }
        Ok(())
    }

    /// System and switch at a value of the parameter.
    fn at(&self, value: f64) -> Result<(System, SwitchSpec), JobError> {
        let Some(along) = &self.along else { return Ok((self.system.clone(), self.switch)) };
        if along.parameter == "eps" && self.system.parameter("eps").is_none() {
            let switch = match self.switch {
                SwitchSpec::Smoothed { transition, .. } if value > 0.0 => {
                    SwitchSpec::Smoothed { eps: value, transition }
                }
                SwitchSpec::Hysteretic { eps_prime, relaxation, phi0, .. } if value > 0.0 => {
                    SwitchSpec::Hysteretic { eps: value, eps_prime, relaxation, phi0 }
                }
                SwitchSpec::Filippov { .. } => {
                    return Err(JobError::Other(
                        "the discontinuous system has no eps to follow".into(),
                    ));
                }
                _ => return Err(JobError::Other(format!("eps = {value}: it is above 0"))),
            };
            return Ok((self.system.clone(), switch));
        }
        let system = self
            .system
            .clone()
            .with(&along.parameter, value)
            .map_err(|e| JobError::Other(e.to_string()))?;
        Ok((system, self.switch))
    }

    fn guess(&self, executor: &dyn Ask) -> Result<Guess, JobError> {
        let (system, switch) = self.at(self.along.as_ref().map_or(0.0, |a| a.from))?;
        let mut point = self.start.clone();
        let mut returns = self.returns;
        if self.settle > 0.0 {
            let spec = self.motion(&system, switch, &self.start, self.settle);
            let settled = executor.ask(&Run(spec.clone()))?;
            if settled.stop == Stop::Interrupted {
                return Err(JobError::Interrupted);
            }
            if let Some(rest) = rest::at_end(executor, &spec, &settled)? {
                return Ok(Guess::Rest(rest));
            }
            let section = settled
                .table("section")
                .ok_or_else(|| JobError::Other("a section was asked for".into()))?;
            let columns: Vec<&[f64]> =
                system.coordinates().iter().map(|name| section.numbers(name)).collect();
            let wanted = if self.plane.upward { "up" } else { "down" };
            let rows: Vec<usize> = section
                .words("direction")
                .enumerate()
                .filter(|(_, w)| *w == wanted)
                .map(|(row, _)| row)
                .collect();
            let state = |row: usize| columns.iter().map(|c| c[row]).collect::<Vec<f64>>();
            let Some(last) = rows.last() else {
                return Err(JobError::Other(format!(
                    "the motion from the start does not pass the plane {}wards within t = {}: \
                        choose another plane or start, or \
                     let it settle for longer",
                    wanted, self.settle
                )));
            };
            point = state(*last);
            let largest = point.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
            let size = if largest < SMALL { largest } else { 1.0 } + largest;
            let near = |row: usize| {
                let d = state(row).iter().zip(&point).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
                sqrt(d) < SAME_PASSAGE * size
            };
            returns = returns.or_else(|| {
                (1..=MOST_RETURNS.min(rows.len() - 1)).find(|k| near(rows[rows.len() - 1 - k]))
            });
        }
        point[self.plane.axis] = self.plane.value;
        if let SwitchSpec::Hysteretic { .. } = switch {
            let mut h = [f64::NAN];
            Program::new(&system.tape().select([0])).evaluate(&point, &mut h);
            point.push(if h[0] < 0.0 { 0.0 } else { 1.0 });
        }
        Ok(Guess::Loop { point, returns: returns.unwrap_or(1) })
    }

    /// States of the equation: a hysteretic switch has one more.
    fn states(&self) -> usize {
        self.system.dimension() + usize::from(matches!(self.switch, SwitchSpec::Hysteretic { .. }))
    }

    fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            self.system.coordinates().into_iter().map(Into::into).collect();
        if self.states() > names.len() {
            names.push(if names.iter().any(|n| n == "phi") { "phi_".into() } else { "phi".into() });
        }
        names
    }

    fn facts(&self, orbit: &Orbit, returns: usize) -> Answer {
        let names = self.names();
        let columns = names.iter().map(|n| Column::numbers(n)).chain([Column::words("direction")]);
        let mut table = Table::new("orbit", columns);
        let (here, there) = if self.plane.upward { ("up", "down") } else { ("down", "up") };
        for (points, word) in [(&orbit.same, here), (&orbit.opposite, there)] {
            for point in points {
                table.push(point.iter().map(|x| Entry::Number(*x)).chain([word.into()]));
            }
        }
        Answer::of_tables(vec![table])
            .with_fact("period", &orbit.period)
            .with_fact("point", &orbit.point)
            .with_fact("multipliers", &orbit.multipliers)
            .with_fact("largest_modulus", &orbit.largest_modulus())
            .with_fact("multiplier_error", &orbit.multiplier_error)
            .with_fact("stability", &orbit.stability())
            .with_fact("rate", &orbit.rate())
            .with_fact("residual", &orbit.residual)
            .with_fact("iterations", &orbit.iterations)
            .with_fact("returns", &returns)
    }
}

/// The tables `branch` and `bifurcations`.
pub(super) fn branch_tables(
    parameter: &str,
    states: &[impl AsRef<str>],
    found: &Branch,
) -> [Table; 2] {
    let orbits = &found.orbits;
    let multipliers = orbits.iter().map(|o| o.multipliers.len()).max().unwrap_or(0);
    let numbered =
        (1..=multipliers).flat_map(|k| [format!("multiplier{k}_re"), format!("multiplier{k}_im")]);
    let columns =
        [Column::numbers(parameter), Column::numbers("period"), Column::words("stability")]
            .into_iter()
            .chain(states.iter().map(|n| Column::numbers(n.as_ref())))
            .chain(numbered.map(|n| Column::numbers(&n)));
    let mut branch = Table::new("branch", columns);
    for o in orbits {
        let mut row: Vec<Entry> =
            vec![o.parameter.into(), o.period.into(), o.stability().word().into()];
        row.extend(o.point.iter().map(|x| Entry::Number(*x)));
        row.extend(
            (0..multipliers).flat_map(|k| {
                o.multipliers.get(k).map_or([f64::NAN; 2], |m| *m).map(Entry::Number)
            }),
        );
        branch.push(row);
    }
    let columns =
        [Column::words("change"), Column::numbers(parameter), Column::numbers("uncertainty")];
    let mut bifurcations = Table::new("bifurcations", columns);
    for b in &found.bifurcations {
        bifurcations.push([b.change.word().into(), b.parameter.into(), b.uncertainty.into()]);
    }
    [branch, bifurcations]
}

/// The return map of a question's system.
struct Map<'a> {
    question: &'a ClosedOrbit,
    returns: usize,
    tolerance: Tolerance,
    /// An error of the question that a return met: the words of the search do not hide it.
    failure: RefCell<Option<JobError>>,
}

/// Why a return was not computed.
enum Failed {
    Job(JobError),
    Trouble(Trouble),
}

impl From<JobError> for Failed {
    fn from(error: JobError) -> Self {
        Self::Job(error)
    }
}

impl Map<'_> {
    fn error(&self, why: String) -> JobError {
        self.failure.borrow_mut().take().unwrap_or(JobError::Other(why))
    }

    /// By the variational equation.
    fn smooth<const N: usize, const M: usize>(
        &self,
        field: &Field,
        u: &[f64],
        settings: &floquet::FloquetOptions,
    ) -> Result<Returned, Failed>
    where
        BoundField<M>: Returns<N>,
    {
        let tangent = field.variational(N).bind::<M>().map_err(JobError::from)?;
        let start = SVector::<f64, N>::from_column_slice(u);
        let found = tangent.return_map(self.question.plane, self.returns, &start, settings);
        found.map_err(|error| {
            let (obstacle, said) = match error {
                floquet::Error::Integration(failure) => {
                    (Obstacle::Other, failure.of_states(N).to_string())
                }
                // From a rest, or beside one: whether it is, is looked at elsewhere.
                floquet::Error::NoReturn { .. } => (Obstacle::Point(u.to_vec()), error.to_string()),
                _ => (Obstacle::Other, error.to_string()),
            };
            Failed::Trouble(Trouble { obstacle, said })
        })
    }

    /// Of the discontinuous system.
    fn discontinuous<const N: usize>(
        &self,
        system: &System,
        u: &[f64],
        settings: &floquet::FloquetOptions,
        derivative: bool,
    ) -> Result<Returned, Failed>
    where
        Bound<N>: Motions<N>,
    {
        let start = SVector::<f64, N>::from_column_slice(u);
        let system = system.bind::<N>().map_err(JobError::from)?;
        let found =
            system.return_map(self.question.plane, self.returns, &start, settings, derivative);
        found.map_err(|error| {
            let obstacle = match error {
                filippov_return::Error::Grazing { .. } => Obstacle::Grazing,
                filippov_return::Error::SetValued { .. } => Obstacle::SetValued,
                filippov_return::Error::NoReturn { .. } => Obstacle::Point(u.to_vec()),
                _ => Obstacle::Other,
            };
            Failed::Trouble(Trouble { obstacle, said: error.to_string() })
        })
    }

    fn settings(&self, tolerance: Tolerance) -> floquet::FloquetOptions {
        floquet::FloquetOptions {
            tolerance,
            longest_return: self.question.longest_return,
            ..floquet::FloquetOptions::default()
        }
    }

    fn find(
        &self,
        u: &[f64],
        p: f64,
        tolerance: Tolerance,
        derivative: bool,
    ) -> Result<Returned, Failed> {
        let settings = &self.settings(tolerance);
        let (system, switch) = self.question.at(p)?;
        let field = match switch {
            SwitchSpec::Filippov { .. } => {
                return match u.len() {
                    2 => self.discontinuous::<2>(&system, u, settings, derivative),
                    3 => self.discontinuous::<3>(&system, u, settings, derivative),
                    4 => self.discontinuous::<4>(&system, u, settings, derivative),
                    n => Err(JobError::Other(format!("no closed orbits with {n} states")).into()),
                };
            }
            SwitchSpec::Delayed { .. } | SwitchSpec::Relay { .. } => {
                unreachable!("refused by `validate`")
            }
            SwitchSpec::Smoothed { eps, transition } => Field::smoothed(&system, transition, eps),
            SwitchSpec::Hysteretic { eps, eps_prime, relaxation, .. } => {
                Field::hysteretic(&system, eps, eps_prime, relaxation)
            }
        };
        match u.len() {
            2 => self.smooth::<2, 6>(&field, u, settings),
            3 => self.smooth::<3, 12>(&field, u, settings),
            4 => self.smooth::<4, 20>(&field, u, settings),
            5 => self.smooth::<5, 30>(&field, u, settings),
            n => Err(JobError::Other(format!("no closed orbits with {n} states")).into()),
        }
    }
}

impl Map<'_> {
    fn tried(
        &self,
        u: &[f64],
        p: f64,
        tolerance: Tolerance,
        derivative: bool,
    ) -> Result<Returned, Trouble> {
        if !u.iter().all(|x| x.is_finite()) {
            return Err(format!(
                "the search left the finite numbers; start nearer ({})",
                Failure::NotFinite { t: 0.0, state: u.to_vec() }
            )
            .into());
        }
        self.find(u, p, tolerance, derivative).map_err(|failed| match failed {
            Failed::Trouble(trouble) => trouble,
            Failed::Job(error) => {
                let said = error.to_string();
                if !matches!(error, JobError::Other(_)) {
                    *self.failure.borrow_mut() = Some(error);
                }
                said.into()
            }
        })
    }
}

impl ReturnMap for Map<'_> {
    fn states(&self) -> usize {
        self.question.states()
    }

    fn axis(&self) -> usize {
        self.question.plane.axis
    }

    fn returned(&self, u: &[f64], p: f64, derivative: bool) -> Result<Returned, Trouble> {
        self.tried(u, p, self.tolerance, derivative)
    }

    fn roughly(&self, u: &[f64], p: f64) -> Result<Returned, Trouble> {
        let Tolerance { rtol, atol } = self.tolerance;
        self.tried(u, p, Tolerance { rtol: ROUGHLY * rtol, atol: ROUGHLY * atol }, true)
    }

    fn rest(&self, u: &[f64], p: f64) -> Option<(Vec<f64>, Vec<[f64; 2]>)> {
        let (system, switch) = self.question.at(p).ok()?;
        rest::near(&system, switch, u).map(|r| (r.state, r.eigenvalues))
    }
}

#[cfg(test)]
mod tests;
