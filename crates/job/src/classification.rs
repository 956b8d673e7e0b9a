//! Classification of a run's attractor.

use std::sync::Arc;

use serde_json::{Value, json};

use super::answer::{Answer, Stop};
use super::exponent::LargestExponent;
use super::question::{AnyQuestion, Ask, JobError, Question};
use super::run::Run;
use super::spec::{Observation, RunSpec, SwitchSpec, in_units_of};
use twofold_analyse::Direction;
use twofold_analyse::attractor::{
    self, Evidence, SectionPoint, Thresholds, Verdict, classify, has_no_future,
};
use twofold_analyse::lyapunov::{self, Exponent};
use twofold_integrate::filippov::ExitRule;
use twofold_integrate::{Monitor, Schedule};

/// The attractor of a run, classified from its section; with the largest exponent where no cycle
/// captures the motion, and compared with noise-free runs where there is noise. Fact: `evidence`
/// ([`Evidence`]).
///
/// ```
/// use twofold_job::{Classification, Executor, spec::*};
/// use twofold_system::System;
/// let run = RunSpec {
///     system: System::builtin("relay-third-order").expect("built in"),
///     switch: SwitchSpec::tanh(1e-3),
///     start: vec![1.0, 0.0, 0.0],
///     t_end: 300.0,
///     method: MethodSpec::ndsolve_defaults(Method::Lsoda),
///     schedule: Default::default(),
///     observe: Observation::Section { coordinate: 1, value: 0.0 },
/// };
/// let evidence = Classification::of(run).ask(&Executor::quiet())?;
/// assert_eq!(evidence.verdict.cycle().map(|cycle| cycle.period), Some(1));
/// # Ok::<(), twofold_job::JobError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Classification {
    /// The run; it records a section.
    pub run: RunSpec,
    /// The limits by which it is judged.
    pub thresholds: Thresholds,
}

impl Classification {
    /// The question with the usual limits.
    pub fn of(run: RunSpec) -> Self {
        Self { run, thresholds: Thresholds::default() }
    }

    /// Asks the question and returns the evidence in its answer.
    ///
    /// # Errors
    ///
    /// The failure of the computation.
    pub fn ask(&self, executor: &dyn Ask) -> Result<Evidence, JobError> {
        Ok(executor.ask(self)?.fact("evidence")?)
    }
}

impl Question for Classification {
    fn kind(&self) -> &'static str {
        "classification"
    }

    fn json(&self) -> Value {
        json!({ "run": self.run, "thresholds": self.thresholds, "lengths": LENGTHS })
    }

    fn label(&self) -> String {
        format!("outcome of {}", Run(self.run.clone()).label())
    }

    fn cost(&self) -> f64 {
        // Most runs are classified from their section; some need an exponent.
        0.02 * Run(self.run.clone()).cost()
    }

    fn rests_on(&self) -> Vec<AnyQuestion> {
        if plane(&self.run).is_err() {
            return Vec::new();
        }
        let twins =
            if self.run.schedule.kick.is_some() { self.noise_free_twins() } else { Vec::new() };
        std::iter::once(self.run.clone()).chain(twins).map(|run| Arc::new(Run(run)) as _).collect()
    }

    fn compute(&self, executor: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let evidence = self.evidence(executor)?;
        Ok(Answer::of_tables(Vec::new()).with_fact("evidence", &evidence))
    }
}

/// Numbers of the procedure that are not limits of the classifier. Times are in units of the
/// motion's own clock ([`clock`]).
#[derive(Clone, Copy, Debug, serde::Serialize)]
struct Lengths {
    /// Time after which the first transient is over and a chaotic run is on its structure.
    settling: f64,
    /// Fewest points of a noise-free run that make a structure to compare with.
    structure_points: usize,
    /// Number of noise-free runs that noise is compared with.
    free_runs: usize,
    /// Distance between their starts.
    free_shift: f64,
    /// Their length.
    free_length: f64,
    /// Time over which a hysteretic system's exponent is averaged: stiff for the explicit method of
    /// the variational equation.
    hysteretic_average: f64,
}

const LENGTHS: Lengths = Lengths {
    settling: 1000.0,
    structure_points: 2000,
    free_runs: 8,
    free_shift: 1e-9,
    free_length: 5e4,
    hysteretic_average: 2_000.0,
};

/// The unit of time in which a motion returns to its section every 2 to 32 units: a power of 16, so
/// that the same motion by another clock has the same averages. It is 1 for systems of order one.
fn clock(return_time: f64) -> f64 {
    let mut unit = 1.0;
    if return_time > 0.0 && return_time.is_finite() {
        while return_time >= 32.0 * unit {
            unit *= 16.0;
        }
        while return_time < 2.0 * unit {
            unit /= 16.0;
        }
    }
    unit
}

/// A classification, or the exponent that it needs.
pub(super) enum SoFar<T> {
    Judged(T),
    /// Neighbours part, or not: the points do not say.
    Awaits(Box<LargestExponent>),
}

impl Classification {
    fn evidence(&self, executor: &dyn Ask) -> Result<Evidence, JobError> {
        // A run that cannot be judged is not computed.
        plane(&self.run)?;
        self.evidence_of(executor, &*executor.ask(&Run(self.run.clone()))?)
    }

    /// The evidence that an answer to the run's question gives.
    fn evidence_of(&self, executor: &dyn Ask, answer: &Answer) -> Result<Evidence, JobError> {
        match self.so_far(executor, answer)? {
            SoFar::Judged(evidence) => Ok(evidence),
            SoFar::Awaits(exponent) => {
                self.with_exponent(answer, exponent.found(&*executor.ask(&*exponent)?))
            }
        }
    }

    /// Verdict on the run's answer, as far as it is known without the orbit's exponent.
    pub(super) fn so_far(
        &self,
        executor: &dyn Ask,
        answer: &Answer,
    ) -> Result<SoFar<Evidence>, JobError> {
        let run = &self.run;
        let (end, section) = section(run, answer)?;
        let random_exits =
            matches!(run.switch, SwitchSpec::Filippov { exit: ExitRule::Random { .. }, .. });
        let mut question = self.asked();
        if question.kicked {
            // Without its chance a random exit rule is no rule: there is nothing to compare with.
            let reference =
                if random_exits { None } else { Some(self.noise_free_structure(executor)?) };
            question.reference = reference.as_deref();
            return Ok(SoFar::Judged(classify(&section, &question, &self.thresholds)));
        }
        let evidence = self.judged(&section, &question);
        Ok(match evidence.verdict {
            Verdict::Chaotic { .. } | Verdict::Undecided { .. } => {
                SoFar::Awaits(Box::new(self.exponent(end, &evidence)))
            }
            _ => SoFar::Judged(evidence),
        })
    }

    /// The evidence with the exponent that was awaited; `None` if that orbit could not be followed.
    pub(super) fn with_exponent(
        &self,
        answer: &Answer,
        exponent: Option<Exponent>,
    ) -> Result<Evidence, JobError> {
        let (_, section) = section(&self.run, answer)?;
        Ok(self.judged(&section, &attractor::Question { lyapunov: exponent, ..self.asked() }))
    }

    /// The verdict without noise. Points of two states lie on a line and are no torus.
    fn judged(&self, section: &[SectionPoint], question: &attractor::Question<'_>) -> Evidence {
        let mut evidence = classify(section, question, &self.thresholds);
        let on_a_line = matches!(plane(&self.run), Ok((_, None)));
        if on_a_line && matches!(evidence.verdict, Verdict::QuasiPeriodic(_)) {
            evidence.verdict = Verdict::Undecided { lyapunov: question.lyapunov };
            evidence.name = evidence.verdict.name().to_owned();
            evidence.summary = evidence.verdict.to_string();
        }
        evidence
    }

    /// The question about the section's points.
    fn asked(&self) -> attractor::Question<'static> {
        let run = &self.run;
        let random_exits =
            matches!(run.switch, SwitchSpec::Filippov { exit: ExitRule::Random { .. }, .. });
        attractor::Question {
            t_end: Some(run.t_end),
            shown_from: 0.5 * run.t_end,
            kicked: run.schedule.kick.is_some() || random_exits,
            lyapunov: None,
            reference: None,
        }
    }

    /// The largest exponent of the run's system, from its final state; over times and with an
    /// absolute tolerance in the units of its section.
    fn exponent(&self, start: Vec<f64>, section: &Evidence) -> LargestExponent {
        let usual = lyapunov::LyapunovOptions::default();
        let duration = match self.run.switch {
            SwitchSpec::Hysteretic { .. }
            | SwitchSpec::Delayed { .. }
            | SwitchSpec::Relay { .. } => LENGTHS.hysteretic_average,
            _ => usual.duration,
        };
        let unit = clock(section.return_time);
        let settings = lyapunov::LyapunovOptions {
            tolerance: in_units_of(usual.tolerance, &[section.extent]),
            transient: usual.transient * unit,
            duration: duration * unit,
            ..usual
        };
        LargestExponent {
            system: self.run.system.clone(),
            switch: self.run.switch,
            start,
            settings,
        }
    }

    /// The same run without kicks, from starts a little apart.
    fn noise_free_twins(&self) -> Vec<RunSpec> {
        let run = &self.run;
        let twin = |k: usize| {
            let mut start = run.start.clone();
            if let Some(x) = start.first_mut() {
                *x += k as f64 * LENGTHS.free_shift;
            }
            let schedule = Schedule { kick: None, ..run.schedule };
            RunSpec { start, schedule, t_end: run.t_end.min(LENGTHS.free_length), ..run.clone() }
        };
        (0..LENGTHS.free_runs).map(twin).collect()
    }

    /// The structure that noise can wash out: sections of its twins without kicks, each as long as
    /// it was not captured by a closed orbit.
    fn noise_free_structure(&self, executor: &dyn Ask) -> Result<Vec<Vec<SectionPoint>>, JobError> {
        let mut free = Vec::new();
        for twin in self.noise_free_twins() {
            let (_, section) = section(&twin, &*executor.ask(&Run(twin.clone()))?)?;
            let question = attractor::Question {
                t_end: Some(twin.t_end),
                shown_from: 0.5 * twin.t_end,
                ..attractor::Question::default()
            };
            let found = classify(&section, &question, &self.thresholds);
            // Points that lie on top of one another surround no closed orbit there.
            let cycle = found.verdict.cycle().filter(|_| !has_no_future(&found, &self.thresholds));
            let captured = cycle.map_or(f64::INFINITY, |c| c.captured_at);
            let settled = LENGTHS.settling * clock(found.return_time);
            let loose: Vec<SectionPoint> =
                section.into_iter().filter(|p| p.t > settled && p.t < captured).collect();
            if loose.len() >= LENGTHS.structure_points {
                free.push(loose);
            }
        }
        Ok(free)
    }
}

/// The states that span the plane in which a run is judged: the first two that its section leaves
/// free, or the only one.
fn plane(run: &RunSpec) -> Result<(&str, Option<&str>), JobError> {
    let Observation::Section { coordinate, .. } = run.observe else {
        return Err(refused("a run is classified from its section; record one with --section"));
    };
    let names = run.system.coordinates();
    let states = names.len();
    let mut free =
        names.into_iter().enumerate().filter(|(i, _)| *i != coordinate).map(|(_, name)| name);
    match free.next() {
        Some(first) if states > 1 => Ok((first, free.next())),
        _ => Err(refused(
            "a run is classified from where it meets a section, so its system must have at least \
                two states",
        )),
    }
}

fn refused(why: &str) -> JobError {
    JobError::Other(why.into())
}

/// End of the run, and its section as the classifier takes it: in the plane of the first two
/// coordinates that the section leaves free. With two states there is one, and the other is 0; with
/// more than three this is a projection, in which different points may fall together but one
/// orbit's period, its approach and its irregularity are seen as they are.
fn section(run: &RunSpec, answer: &Answer) -> Result<(Vec<f64>, Vec<SectionPoint>), JobError> {
    let (first, second) = plane(run)?;
    if answer.stop == Stop::Interrupted {
        return Err(JobError::Interrupted);
    }
    let table =
        answer.table("section").ok_or_else(|| refused("the run has no table of its section"))?;
    let (u, v) = (table.numbers(first), second.map(|name| table.numbers(name)));
    let directions = table.words("direction").map(|word| word == Direction::Up.word());
    let points = table.numbers("t").iter().zip(u).zip(directions).enumerate();
    let points = points.map(|(row, ((t, u), upward))| SectionPoint {
        t: *t,
        u: [*u, v.map_or(0.0, |v| v[row])],
        upward,
    });
    Ok((answer.fact("state")?, points.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Executor;
    use crate::spec::{DEFAULT_MAX_STEPS, Method, MethodSpec};
    use twofold_integrate::{StepCap, Tolerance};
    use twofold_system::{Definition, System};

    /// Van der Pol's oscillator at mu = 1, alone and with states that follow it or die out: period
    /// 6.663286859, amplitude 2.00861986 (Urabe 1958).
    fn evidence(states: &str, field: &str, start: Vec<f64>) -> Result<Evidence, JobError> {
        let text = format!("states = {states}\nh = \"y\"\nplus = {field}\nminus = {field}\n");
        let run = RunSpec {
            system: System::new(Definition::from_toml(&text, "oscillator.toml").unwrap()),
            switch: SwitchSpec::tanh(1e-2),
            start,
            t_end: 2000.0,
            method: MethodSpec {
                name: Method::Dopri5,
                tolerance: Tolerance { rtol: 1e-9, atol: 1e-9 },
                step_cap: StepCap::None,
                max_steps: DEFAULT_MAX_STEPS,
                precision: None,
                order: None,
            },
            schedule: Schedule::default(),
            observe: Observation::Section { coordinate: 1, value: 0.0 },
        };
        Classification::of(run).ask(&Executor::quiet())
    }

    #[test]
    fn a_limit_cycle_is_recognised_in_two_states_and_in_four() {
        let two =
            evidence("[\"x\", \"y\"]", "[\"y\", \"(1 - x*x)*y - x\"]", vec![0.1, 0.0]).unwrap();
        let four = evidence(
            "[\"a\", \"y\", \"x\", \"b\"]",
            "[\"-a\", \"(1 - x*x)*y - x\", \"y\", \"x - b\"]",
            vec![1.0, 0.0, 0.1, 0.0],
        )
        .unwrap();
        for (evidence, amplitude) in [(two, 0), (four, 1)] {
            let cycle = evidence.verdict.cycle().unwrap_or_else(|| panic!("{}", evidence.summary));
            assert!(matches!(evidence.verdict, Verdict::Periodic(_)), "{}", evidence.summary);
            assert_eq!(cycle.period, 1);
            assert!((cycle.duration - 6.663_286_859).abs() < 1e-5, "{}", cycle.duration);
            // A picture shows the second half; y goes up through 0 where x is below 0.
            assert_eq!(evidence.shown_from, 1000.0);
            assert!(
                cycle.points.len() == 2
                    && cycle.points.iter().all(|p| p.upward == (p.u[amplitude] < 0.0))
            );
            let sizes = cycle.points.iter().map(|p| p.u[amplitude].abs());
            // In four states the plane is (a, x).
            sizes.for_each(|size| assert!((size - 2.008_619_86).abs() < 1e-6, "{size}"));
        }
    }

    /// Two limit cycles side by side: in the plane of one state of each their torus lies on top of
    /// itself, by whatever ratio of frequencies; and what comes to a rest or drifts so slowly that
    /// the run does not show where to.
    #[test]
    fn tori_are_no_noise_and_what_moves_on_is_no_torus() {
        let torus = |ratio: f64, second: bool| {
            let a = ["x*(1 - x*x - y*y) - y", "y*(1 - x*x - y*y) + x"].map(String::from);
            let b = [
                format!("u*(1 - u*u - w*w) - {ratio}*w"),
                format!("w*(1 - u*u - w*w) + {ratio}*u"),
            ];
            let field = if second { [b, a].concat() } else { [a, b].concat() };
            let states = if second { ["u", "w", "x", "y"] } else { ["x", "y", "u", "w"] };
            evidence(&format!("{states:?}"), &format!("{field:?}"), vec![1.0, 0.0, 1.0, 0.0])
                .unwrap()
        };
        for ratio in [1.618_033_988_749_895, std::f64::consts::SQRT_2, std::f64::consts::E] {
            for second in [false, true] {
                let found = torus(ratio, second);
                assert_eq!(found.name, "quasi-periodic", "{ratio} {second}: {}", found.summary);
            }
        }
        let spiral = "['-5e-5*x - y', 'x - 5e-5*y']";
        let found = evidence("['x', 'y']", spiral, vec![1.0, 0.0]).unwrap();
        assert_eq!(found.name, "undecided", "{}", found.summary);
        for growth in [0.01, 0.02] {
            let focus = format!("['{growth}*x - 2*y', '2*x + {growth}*y']");
            let found = evidence("['x', 'y']", &focus, vec![1e-9, 0.0]).unwrap();
            assert_eq!(found.name, "undecided", "{growth}: {}", found.summary);
        }
        let drift = "['x*(1 - x*x - y*y) - y', 'y*(1 - x*x - y*y) + x', '1e-3']";
        let found = evidence("['x', 'y', 'z']", drift, vec![1.0, 0.0, 0.0]).unwrap();
        assert_eq!(found.name, "undecided", "{}", found.summary);
    }

    fn run(system: System, switch: SwitchSpec, t_end: f64) -> Classification {
        Classification::of(crate::cases::run(
            system,
            switch,
            t_end,
            Observation::Section { coordinate: 0, value: 0.0 },
        ))
    }

    /// A classification depends on its run; of a kicked run also on eight noise-free runs; of a run
    /// without a section on nothing, and it is refused.
    #[test]
    fn what_a_verdict_rests_on() {
        use twofold_integrate::{Kick, KickLaw};
        let mut question = run(crate::cases::decays(2), SwitchSpec::tanh(1e-2), 9.0);
        let runs = |question: &Classification| -> Vec<Value> {
            question.rests_on().iter().map(|q| q.json()).collect()
        };
        assert_eq!(runs(&question), [Run(question.run.clone()).json()]);
        let free = question.clone();
        question.run.schedule.kick =
            Some(Kick { every: 0.3, size: 1e-3, law: KickLaw::Sphere, seed: 9, stream: 5 });
        let kicked = runs(&question);
        assert_eq!((kicked.len(), &kicked[1]), (9, &Run(free.run).json()));
        question.run.observe = Observation::Path { chord: 1.0 };
        assert!(runs(&question).is_empty());
        assert!(question.ask(&Executor::quiet()).unwrap_err().to_string().contains("--section"));
    }

    /// Decays at the rates 1 and 2; a hysteretic one is followed for less long; x' = x^2 leaves and
    /// has none.
    #[test]
    fn exponents_are_those_of_the_runs_system() {
        use crate::cases;
        let executor = Executor::quiet();
        let hysteretic = SwitchSpec::hysteretic(1e-2, twofold_system::Relaxation::Single);
        for (switch, duration) in [(SwitchSpec::tanh(1e-2), 10_000.0), (hysteretic, 2000.0)] {
            let question = run(cases::decays(2), switch, 9.0);
            let of = |q: &Classification| {
                let exponent = q.exponent(vec![1.0, 1.0], &section_of(7.0));
                exponent.found(&executor.ask(&exponent).unwrap())
            };
            let exponent = of(&question).unwrap();
            assert!(
                (exponent.value + 1.0).abs() < 1e-5 && exponent.duration == duration,
                "{exponent:?}"
            );
        }
        let leaving =
            run(cases::smooth(&["x", "y"], "x + 1", &["x*x", "-y"]), SwitchSpec::tanh(1e-2), 0.5);
        let exponent = leaving.exponent(vec![1.0, 1.0], &section_of(7.0));
        assert_eq!(exponent.found(&executor.ask(&exponent).unwrap()), None);
    }

    /// Evidence about a section that is returned to so often.
    fn section_of(return_time: f64) -> Evidence {
        let none = classify(&[], &attractor::Question::default(), &Thresholds::default());
        Evidence { return_time, extent: 1.0, ..none }
    }

    /// Averages last some hundred to some thousand returns: 10,000 where those of systems of order
    /// one take 2 to 32.
    #[test]
    fn averages_are_in_units_of_the_motions_clock() {
        let question = run(crate::cases::decays(2), SwitchSpec::tanh(1e-2), 9.0);
        let average = |return_time: f64| {
            let asked = question.exponent(vec![1.0, 1.0], &section_of(return_time)).settings;
            assert_eq!(asked.transient, 0.01 * asked.duration);
            asked.duration
        };
        for return_time in [2.0, 2.7, 20.3, 31.9, f64::NAN, 0.0, f64::INFINITY] {
            assert_eq!(average(return_time), 1e4, "{return_time}");
        }
        for k in [-20, -3, 0, 1, 20] {
            let power = 2.0_f64.powi(k);
            for return_time in [2.0, 3.0, 31.0] {
                let scaled = average(return_time * power);
                assert!((312.0..5001.0).contains(&(scaled / (return_time * power))), "{scaled}");
            }
        }
        // The same for a state's unit.
        let small = Evidence { extent: 3e-9, ..section_of(7.0) };
        let asked = question.exponent(vec![1.0, 1.0], &small).settings;
        assert!((asked.tolerance.atol / 1e-18 - 1.0).abs() < 1e-6, "{asked:?}");
    }

    /// Lorenz's system by clocks of other units: irregular, of the exponent 0.9056 (Viswanath 1998)
    /// in each. Not by the same bits: the first step of a method has a unit.
    #[test]
    fn a_motion_is_the_same_by_any_clock() {
        let judged = |unit: f64| {
            let field = ["10*(y - x)", "x*(28 - z) - y", "x*y - 8/3*z"];
            let field = field.map(|f| format!("({f})/{unit:?}"));
            let field = field.each_ref().map(String::as_str);
            let lorenz = crate::cases::smooth(&["x", "y", "z"], "z + 100", &field);
            let mut question = run(lorenz, SwitchSpec::tanh(1e-2), 300.0 * unit);
            question.run.observe = Observation::Section { coordinate: 2, value: 27.0 };
            question.run.method.tolerance = Tolerance { rtol: 1e-9, atol: 1e-9 };
            let evidence = question.ask(&Executor::quiet()).unwrap();
            assert!(matches!(evidence.verdict, Verdict::Chaotic { .. }), "{}", evidence.summary);
            let exponent = evidence.lyapunov.unwrap();
            let [value, error] = [exponent.value, exponent.standard_error].map(|rate| rate * unit);
            assert!(
                (value - 0.9056).abs() < 4.0 * error && error < 0.03,
                "{unit}: {value} {error}"
            );
        };
        for unit in [1.0, 1e-6, 1e-3, 1e3, 1e6, 1_048_576.0, 1.0 / 4096.0] {
            judged(unit);
        }
    }

    /// Three frequencies that have no common measure, of an oscillator and of a state that follows
    /// a clock: nothing captures that.
    #[test]
    fn structures_are_what_was_not_captured_after_the_transient() {
        let system = crate::cases::smooth(
            &["x", "u", "y", "clock"],
            "x + 9",
            &["y", "1.207*cos(1.207*clock) + 1.618*cos(1.618*clock)", "-x", "1"],
        );
        let mut question = run(system, SwitchSpec::tanh(1e-2), 7500.0);
        question.run.method.tolerance = Tolerance { rtol: 1e-6, atol: 1e-6 };
        let twins = question.noise_free_twins();
        let shifts: Vec<f64> = twins.iter().map(|twin| twin.start[0] - 1.0).collect();
        assert!(
            shifts.iter().enumerate().all(|(k, s)| (s - 1e-9 * k as f64).abs() < 1e-15),
            "{shifts:?}"
        );
        let free = question.noise_free_structure(&Executor::quiet()).unwrap();
        assert_eq!(free.len(), 8);
        // Two passages a turn.
        let wanted = 6500.0 / std::f64::consts::PI;
        for loose in free {
            assert!(
                loose.iter().all(|p| p.t > 1000.0)
                    && (loose.len() as f64 / wanted - 1.0).abs() < 0.01,
                "{}",
                loose.len()
            );
        }
    }

    #[test]
    fn one_state_has_no_section_to_judge() {
        let error = evidence("[\"y\"]", "[\"-y\"]", vec![1.0]).unwrap_err();
        assert!(error.to_string().contains("at least two states"), "{error}");
    }
}
