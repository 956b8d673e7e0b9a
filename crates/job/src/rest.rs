//! Rests: equilibria and pseudo-equilibria at which a motion ends.
//!
//! A rest is a zero of the equation that holds there: of a smooth field, of f+ where h > 0, of f-
//! where h < 0, or of a mixture of both on h = 0 (a pseudo-equilibrium; Filippov 1988, sec. 19; di
//! Bernardo, Budd, Champneys & Kowalczyk 2008, sec. 5.1). It is found by Newton's method from where
//! a run ended; where two surfaces meet, it is the point at which the motion stays. That the run
//! ends at a rest is another statement: it is made if the distance from the rest goes on falling as
//! the rest's eigenvalues say. Nothing here has a unit: distances are compared with distances.

use serde::{Deserialize, Serialize};

use super::answer::{Answer, Stop};
use super::question::{Ask, JobError};
use super::run::Run;
use super::spec::{Method, MethodSpec, Observation, RunSpec, SwitchSpec, switching};
use twofold_integrate::delay::Inside;
use twofold_integrate::{Schedule, StepCap, Tolerance};
use twofold_num::Dual;
use twofold_num::elementary::{exp, ln, sqrt};
use twofold_num::linear::{eigenvalues, solve_any};
use twofold_system::{Field, System};

/// The field of which a rest is a zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RestKind {
    /// The field.
    Equilibrium,
    /// A mixture of both fields on the switching surface.
    PseudoEquilibrium,
}

/// Stability of a rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stability {
    /// Its neighbours come to it.
    Attracts,
    /// Some of them leave.
    Repels,
    /// The largest real part of an eigenvalue is zero within its rounding: linear terms do not
    /// decide.
    Neutral,
    /// Its neighbours come to rest too, each at a place of its own: rests fill a curve, or more.
    ToASet,
}

/// A rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rest {
    /// The field of which it is a zero.
    pub kind: RestKind,
    /// The state, with phi as last component if the switch is hysteretic.
    pub state: Vec<f64>,
    /// Eigenvalues (real, imaginary) of the equation there, by falling real part; along the
    /// surface, of a pseudo-equilibrium. None where the equation has no derivative.
    pub eigenvalues: Vec<[f64; 2]>,
    /// The stability implied by the eigenvalues and by the fields on both sides.
    pub stability: Stability,
}

impl Rest {
    /// The rate per unit time at which neighbours approach in the end, negative if they leave.
    pub fn rate(&self) -> Option<f64> {
        self.eigenvalues.first().map(|l| 0.0 - l[0])
    }

    /// In a word or two.
    pub fn word(&self) -> &'static str {
        match self.kind {
            RestKind::Equilibrium => "equilibrium",
            RestKind::PseudoEquilibrium => "pseudo-equilibrium",
        }
    }
}

/// Real parts of eigenvalues below this share of the largest modulus are rounding.
const ROUNDING: f64 = 1e-9;
/// Multiples of eps beyond which a state is outside the layer.
const SATURATED: f64 = 20.0;
/// Newton iterations: enough for the linear convergence at a multiple zero.
const ITERATIONS: usize = 100;

/// A map over dual numbers: arguments, then the places of its values.
type DualMap<'a> = dyn Fn(&[Dual<f64, 1>], &mut [Dual<f64, 1>]) + 'a;

/// f and its Jacobian matrix, row by row.
fn linearised(n: usize, f: &DualMap<'_>, outputs: usize, x: &[f64]) -> Jet {
    let mut jet = Jet { value: vec![0.0; outputs], rows: vec![0.0; outputs * n] };
    let mut out = vec![Dual::constant(0.0); outputs];
    for j in 0..n {
        let at: Vec<Dual<f64, 1>> = (0..n)
            .map(|i| if i == j { Dual::variable(x[i], 0) } else { Dual::constant(x[i]) })
            .collect();
        f(&at, &mut out);
        for (i, o) in out.iter().enumerate() {
            jet.value[i] = o.value;
            jet.rows[i * n + j] = o.partials[0];
        }
    }
    jet
}

/// Values with derivatives.
struct Jet {
    value: Vec<f64>,
    rows: Vec<f64>,
}

fn size(x: &[f64]) -> f64 {
    sqrt(x.iter().map(|v| v * v).sum())
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    sqrt(a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum())
}

/// A zero near `from` of as many equations as unknowns: the point, if Newton's method comes to one.
/// Only the first `states` unknowns are looked at to see that it did.
fn zero(from: &[f64], states: usize, equations: &dyn Fn(&[f64]) -> Jet) -> Option<Vec<f64>> {
    let mut x = from.to_vec();
    let mut before = f64::INFINITY;
    for _ in 0..ITERATIONS {
        let jet = equations(&x);
        if jet.value.iter().all(|v| *v == 0.0) {
            return Some(x);
        }
        let right: Vec<f64> = jet.value.iter().map(|v| -v).collect();
        let step = solve_any(&jet.rows, &right, 0.0)?;
        x.iter_mut().zip(&step).for_each(|(x, s)| *x += s);
        let step = size(&step[..states]);
        let small = step <= 1e-13 * size(&x[..states])
            || step <= 1e-10 * distance(&x[..states], &from[..states]);
        if small && step >= 0.5 * before || step <= 1e-15 * size(&x[..states]) || step == 0.0 {
            return x.iter().all(|v| v.is_finite()).then_some(x);
        }
        before = if small { step } else { f64::INFINITY };
    }
    None
}

/// Eigenvalues by falling real part, and what they say.
fn stability_of(matrix: &[f64], n: usize) -> Option<(Vec<[f64; 2]>, Stability)> {
    let mut found = eigenvalues(matrix, n)?;
    found.sort_by(|a, b| b[0].total_cmp(&a[0]).then(b[1].total_cmp(&a[1])));
    let largest = found.iter().map(|l| size(l)).fold(0.0, f64::max);
    let stability = match found.first() {
        Some(l) if l[0] > ROUNDING * largest => Stability::Repels,
        Some(l) if l[0] < -ROUNDING * largest => Stability::Attracts,
        None => Stability::Attracts,
        _ => Stability::Neutral,
    };
    Some((found, stability))
}

/// The equation of a smoothed or hysteretic switch.
pub(super) fn field(system: &System, switch: SwitchSpec) -> Option<Field> {
    match switch {
        SwitchSpec::Smoothed { eps, transition } => Some(Field::smoothed(system, transition, eps)),
        SwitchSpec::Hysteretic { eps, eps_prime, relaxation, .. }
            if system.definition().second().is_none() =>
        {
            Some(Field::hysteretic(system, eps, eps_prime, relaxation))
        }
        _ => None,
    }
}

/// The rest that Newton's method finds from `from`, the equation's state, whether or not anything
/// ends there.
pub fn near(system: &System, switch: SwitchSpec, from: &[f64]) -> Option<Rest> {
    let regular = |field: &Field| {
        let n = field.dimension();
        let jet = |x: &[f64]| linearised(n, &|x, out| field.evaluate(x, out), n, x);
        let state = zero(from, n, &jet)?;
        let (eigenvalues, stability) = stability_of(&jet(&state).rows, n)?;
        Some(Rest { kind: RestKind::Equilibrium, state, eigenvalues, stability })
    };
    if let Some(field) = field(system, switch) {
        return regular(&field);
    }
    if let Some(faces) = system.faces() {
        return of_faces(&faces, switch, from);
    }
    // A smooth switch that acts late rests where one that does not rests. Outside the layer it does
    // not matter when it acts.
    if let SwitchSpec::Delayed { eps: Some(eps), transition: Some(transition), .. } = switch {
        return regular(&Field::smoothed(system, transition, eps))
            .filter(|r| switching(system, &r.state).abs() > SATURATED * eps);
    }
    let fields = [Field::plus(system), Field::minus(system)];
    let [plus, minus] = &fields;
    // A side's rest counts where that side is; a relay's field holds to the band's other edge.
    let (beyond, held) = match switch {
        SwitchSpec::Filippov { .. } | SwitchSpec::Delayed { .. } => (0.0, [true; 2]),
        SwitchSpec::Relay { band, inside } => {
            let plus = inside.begins_with_plus(switching(system, from), band);
            (-band, [plus, !plus])
        }
        SwitchSpec::Smoothed { .. } | SwitchSpec::Hysteretic { .. } => return None,
    };
    let on = |field: &Field, sign: f64, held: bool| {
        let rest = held.then(|| regular(field)).flatten();
        rest.filter(|r| sign * switching(system, &r.state) > beyond)
    };
    let slides = matches!(switch, SwitchSpec::Filippov { .. });
    let between = slides.then(|| pseudo(system, plus, minus, from)).flatten();
    let boundary = || of_both(system, &fields, [regular(plus)?, regular(minus)?], from);
    let both = slides.then(boundary).flatten();
    let candidates = [both, between, on(plus, 1.0, held[0]), on(minus, -1.0, held[1])];
    let there = |r: &Rest| distance(&r.state, from);
    candidates.into_iter().flatten().min_by(|a, b| there(a).total_cmp(&there(b)))
}

/// The same of a system with two switching surfaces off their intersection: there it is one of its
/// faces, each as far as the other surface.
fn of_faces(faces: &[[System; 2]; 2], switch: SwitchSpec, from: &[f64]) -> Option<Rest> {
    let candidates = [(0, 0), (0, 1), (1, 0), (1, 1)].into_iter().filter_map(|(surface, below)| {
        let rest = near(&faces[surface][below], switch, from)?;
        let h = surface_at(&faces[1 - surface][0], &rest.state);
        let sign = [1.0, -1.0][below];
        (sign * h.value[0] > size(&h.rows) * blur(&rest.state, from)).then_some(rest)
    });
    let there = |r: &Rest| distance(&r.state, from);
    candidates.min_by(|a, b| there(a).total_cmp(&there(b)))
}

/// The end of `run` as a rest, if it is where two switching surfaces meet and stays there.
///
/// # Errors
///
/// If it was interrupted.
fn at_intersection(
    executor: &dyn Ask,
    run: &RunSpec,
    end: &[f64],
) -> Result<Option<Rest>, JobError> {
    let (true, Some([[first, _], [second, _]])) =
        (matches!(run.switch, SwitchSpec::Filippov { .. }), run.system.faces())
    else {
        return Ok(None);
    };
    let rounding = 1e-9 * size(end).max(size(&run.start));
    let on = |face: &System| {
        let h = surface_at(face, end);
        h.value[0].abs() <= size(&h.rows) * rounding
    };
    if !(on(&first) && on(&second)) || moves_on(executor, run, end, run.method.tolerance.rtol)? {
        return Ok(None);
    }
    Ok(Some(Rest {
        kind: RestKind::PseudoEquilibrium,
        state: end.to_vec(),
        eigenvalues: Vec::new(),
        stability: Stability::Attracts,
    }))
}

/// The switching function and its gradient.
fn surface_at(system: &System, x: &[f64]) -> Jet {
    linearised(x.len(), &|x, out| out[0] = switching(system, x), 1, x)
}

/// Distance by which a rest at `x`, found from `from`, may miss a surface that it lies on.
fn blur(x: &[f64], from: &[f64]) -> f64 {
    1e-9 * size(x) + 1e-6 * distance(x, from)
}

/// The rest near `from` of both fields on the switching surface, if it is one. Where their Jacobian
/// matrices differ the linear terms of neither decide.
fn of_both(system: &System, fields: &[Field; 2], rests: [Rest; 2], from: &[f64]) -> Option<Rest> {
    let [here, there] = rests;
    let (n, x) = (from.len(), &here.state);
    let (h, rounding) = (surface_at(system, x), blur(x, from));
    let one = distance(x, &there.state) <= rounding;
    if !(one && h.value[0].abs() <= size(&h.rows) * rounding) {
        return None;
    }
    let rows = |f: &Field| linearised(n, &|x, out| f.evaluate(x, out), n, x).rows;
    let [a, b] = fields.each_ref().map(rows);
    let linear = distance(&a, &b) <= ROUNDING * size(&a).max(size(&b));
    Some(match linear {
        true => here,
        false => Rest { eigenvalues: Vec::new(), stability: Stability::Neutral, ..here },
    })
}

/// The pseudo-equilibrium near `from`: f- + w (f+ - f-) = 0 and h = 0 with a weight w in (0, 1).
fn pseudo(system: &System, plus: &Field, minus: &Field, from: &[f64]) -> Option<Rest> {
    let n = from.len();
    let equations = |x: &[f64]| {
        let both = |x: &[Dual<f64, 1>], out: &mut [Dual<f64, 1>]| {
            let (mut p, mut m) = (vec![Dual::constant(0.0); n], vec![Dual::constant(0.0); n]);
            plus.evaluate(&x[..n], &mut p);
            minus.evaluate(&x[..n], &mut m);
            for i in 0..n {
                out[i] = m[i] + (p[i] - m[i]) * x[n];
            }
            out[n] = switching(system, &x[..n]);
        };
        linearised(n + 1, &both, n + 1, x)
    };
    let of = |field: &Field, x: &[f64]| {
        let mut out = vec![0.0; n];
        field.evaluate(x, &mut out);
        out
    };
    // The mixture that is nearest to rest: exactly one if the fields are opposite.
    let (p, m) = (of(plus, from), of(minus, from));
    let along: Vec<f64> = p.iter().zip(&m).map(|(p, m)| p - m).collect();
    let weight = -m.iter().zip(&along).map(|(m, a)| m * a).sum::<f64>()
        / along.iter().map(|a| a * a).sum::<f64>();
    let mut start = from.to_vec();
    start.push(if weight.is_finite() { weight } else { 0.5 });
    let Some(found) = zero(&start, n, &equations) else {
        // If the fields have no derivative, the run may have come to the very point (in finite
        // time).
        let left: Vec<f64> = m.iter().zip(&along).map(|(m, a)| m + weight * a).collect();
        let at_rest = size(&left) <= 1e-6 * size(&p).max(size(&m)) && (0.0..=1.0).contains(&weight);
        let h = surface_at(system, from);
        let on_surface = h.value[0].abs() <= 1e-9 * size(&h.rows) * size(from);
        let kind = RestKind::PseudoEquilibrium;
        return (at_rest && on_surface && size(&p) > 0.0).then(|| Rest {
            kind,
            state: from.to_vec(),
            eigenvalues: Vec::new(),
            stability: Stability::Attracts,
        });
    };
    let (state, weight) = (found[..n].to_vec(), found[n]);
    if !(weight > 0.0 && weight < 1.0) {
        return None;
    }
    let h = surface_at(system, &state).rows;
    let lie = |f: &[f64]| f.iter().zip(&h).map(|(f, h)| f * h).sum::<f64>();
    let (p, m) = (of(plus, &state), of(minus, &state));
    let towards = lie(&m) - lie(&p);
    let sliding = Field::sliding(system);
    let full = linearised(
        n,
        &|x, out| {
            let mut all = vec![Dual::constant(0.0); n + 1];
            let at: Vec<_> = x.iter().copied().chain([Dual::constant(0.0)]).collect();
            sliding.evaluate(&at, &mut all);
            out.copy_from_slice(&all[..n]);
        },
        n,
        &state,
    );
    // Along the surface: the coordinate that h depends on most is a function of the others.
    let k = (0..n).max_by(|i, j| h[*i].abs().total_cmp(&h[*j].abs()))?;
    let kept: Vec<usize> = (0..n).filter(|i| *i != k).collect();
    let entry =
        |i: usize, j: usize| (full.rows[i * n + j] - full.rows[i * n + k] * h[j] / h[k]) / towards;
    let matrix: Vec<f64> =
        kept.iter().flat_map(|i| kept.iter().map(|j| entry(*i, *j)).collect::<Vec<_>>()).collect();
    let (eigenvalues, along) = stability_of(&matrix, n - 1)?;
    let stability = if towards > 0.0 { along } else { Stability::Repels };
    Some(Rest { kind: RestKind::PseudoEquilibrium, state, eigenvalues, stability })
}

/// Windows of time over which the distance from a rest is compared.
const WINDOWS: usize = 3;
/// Points looked at in each.
const POINTS: usize = 32;
/// Share of the linear rate at which the distance has to fall at least.
const AS_FAST: f64 = 0.75;

/// Share of its length for which a run is followed further from a point at which its fields almost
/// cancel, and the least change of a state, as a share of its size, by which it moves on.
const FURTHER: f64 = 0.01;
const MOVES: f64 = 1e-3;

/// Whether a run goes on moving from its end, in any state by more than this share of that one's
/// size: fields that almost cancel in one unit may not in another.
fn moves_on(executor: &dyn Ask, run: &RunSpec, end: &[f64], share: f64) -> Result<bool, JobError> {
    let further = RunSpec {
        start: end.to_vec(),
        t_end: FURTHER * run.t_end,
        observe: Observation::Times { every: FURTHER * run.t_end },
        ..run.clone()
    };
    let there: Vec<f64> = match executor.ask(&Run(further)) {
        Ok(answer) if answer.stop != Stop::Interrupted => answer.fact("state")?,
        Ok(_) | Err(JobError::Interrupted) => return Err(JobError::Interrupted),
        // From a point at which nothing holds a motion may not go on.
        Err(_) => return Ok(false),
    };
    let states = there.iter().zip(end).zip(&run.start);
    Ok(states.into_iter().any(|((there, end), start)| {
        (there - end).abs() > share * end.abs().max(start.abs()) + run.method.tolerance.atol
    }))
}

/// Distance to which the fields of a relay take a state from each other in the time in which it is
/// looked which of them holds, as a share of the state's size.
const APART: f64 = 1e-6;

/// The field that the relay of `run` holds at its `end`: the one that its last stretch follows.
///
/// # Errors
///
/// If it was interrupted.
fn held(executor: &dyn Ask, run: &RunSpec, end: &[f64]) -> Result<Inside, JobError> {
    let [plus, minus] = [Field::plus(&run.system), Field::minus(&run.system)].map(|field| {
        let mut out = vec![0.0; end.len()];
        field.evaluate(end, &mut out);
        out
    });
    let time = (APART * (size(end) + size(&run.start)) / distance(&plus, &minus)).min(run.t_end);
    let shorter = RunSpec { t_end: run.t_end - time, ..run.clone() };
    let before: Vec<f64> = match executor.ask(&Run(shorter)) {
        Ok(answer) if answer.stop != Stop::Interrupted => answer.fact("state")?,
        Ok(_) | Err(JobError::Interrupted) => return Err(JobError::Interrupted),
        Err(_) => return Ok(Inside::Sign),
    };
    let off = |field: &[f64]| {
        let back: Vec<f64> = end.iter().zip(field).map(|(x, f)| x - time * f).collect();
        distance(&back, &before)
    };
    Ok(if off(&plus) < off(&minus) { Inside::Plus } else { Inside::Minus })
}

/// The rest at which `run` ends, if it ends at one; `answer` is what it came to, with its section.
/// A run that is kicked ends nowhere.
///
/// # Errors
///
/// If it was interrupted.
pub fn at_end(
    executor: &dyn Ask,
    run: &RunSpec,
    answer: &Answer,
) -> Result<Option<Rest>, JobError> {
    if run.schedule.kick.is_some() || answer.stop == Stop::Interrupted {
        return Ok(None);
    }
    let end: Vec<f64> = answer.fact("state")?;
    let n = end.len();
    let phi = |x: &[f64]| if switching(&run.system, x) > 0.0 { 1.0 } else { 0.0 };
    let full = |x: &[f64]| -> Vec<f64> {
        let more = matches!(run.switch, SwitchSpec::Hysteretic { .. }).then(|| phi(x));
        x.iter().copied().chain(more).collect()
    };
    let mut switch = run.switch;
    match &mut switch {
        SwitchSpec::Hysteretic { phi0, .. } => *phi0 = phi(&end),
        SwitchSpec::Relay { band, inside } if switching(&run.system, &end).abs() <= *band => {
            *inside = held(executor, run, &end)?;
        }
        _ => {}
    }
    if let Some(rest) = at_intersection(executor, run, &end)? {
        return Ok(Some(rest));
    }
    let Some(rest) = near(&run.system, switch, &full(&end)) else { return Ok(None) };
    if rest.eigenvalues.is_empty() && moves_on(executor, run, &end, MOVES)? {
        return Ok(None);
    }
    let from = |x: &[f64]| distance(x, &rest.state[..n]);
    let (before, after) = (from(&run.start), from(&end));
    // Started there, or as near as rounding tells.
    let noise = |x: &[f64]| f64::EPSILON * 4.0 * size(x);
    if before <= noise(&run.start) && after <= noise(&end) {
        return Ok(Some(rest));
    }
    if rest.stability == Stability::Repels || after > 0.5 * before {
        return Ok(None);
    }
    // One of many beside each other, such as a block that sticks: where sliding has come to one, to
    // rounding, it has no speed.
    let slides = rest.kind == RestKind::PseudoEquilibrium;
    if slides && rest.stability == Stability::Neutral && after <= noise(&end) {
        return Ok(Some(rest));
    }
    let Tolerance { rtol, atol } = run.method.tolerance;
    if rest.stability == Stability::Attracts && after <= 100.0 * (rtol * size(&end) + atol) {
        return Ok(Some(rest));
    }
    let leading = rest.eigenvalues.first().copied().unwrap_or([f64::NAN; 2]);
    // Long enough for a turn, and for the longest time between late passages: a closed orbit does
    // not come nearer in it.
    let turn = if leading[1] == 0.0 {
        0.5 / leading[0].abs()
    } else {
        std::f64::consts::TAU / leading[1].abs()
    };
    let late = answer.table("section").map_or(&[][..], |s| s.numbers("t"));
    let late = late.iter().skip_while(|t| **t < 0.5 * run.t_end).copied().collect::<Vec<_>>();
    let window = 1.25 * late.windows(2).map(|w| w[1] - w[0]).fold(turn, f64::max);
    if !(window.is_finite() && window <= 10.0 * run.t_end) {
        return Ok(None);
    }
    let implicit = [Method::Lsoda, Method::Radau5].contains(&run.method.name);
    let name = if implicit { run.method.name } else { Method::Dopri5 };
    let further = RunSpec {
        switch,
        start: end.clone(),
        t_end: window * WINDOWS as f64,
        method: MethodSpec {
            name,
            tolerance: Tolerance { rtol: 1e-10, atol: 1e-6 * after },
            step_cap: StepCap::None,
            precision: None,
            order: None,
            ..run.method
        },
        schedule: Schedule::default(),
        observe: Observation::Times { every: window / POINTS as f64 },
        ..run.clone()
    };
    let answer = match executor.ask(&Run(further)) {
        Ok(answer) if answer.stop != Stop::Interrupted => answer,
        Ok(_) | Err(JobError::Interrupted) => return Err(JobError::Interrupted),
        Err(_) => return Ok(None),
    };
    let table = &answer.tables[0];
    let columns: Vec<&[f64]> =
        run.system.coordinates().iter().map(|name| table.numbers(name)).collect();
    let farthest = |k: usize| {
        (k * POINTS..((k + 1) * POINTS + 1).min(table.len()))
            .map(|row| from(&columns.iter().map(|c| c[row]).collect::<Vec<_>>()))
            .fold(0.0, f64::max)
    };
    let (first, last) = (farthest(0), farthest(WINDOWS - 1));
    let time = window * (WINDOWS - 1) as f64;
    let falls = match rest.stability {
        // The linear rate, down to what rounding leaves of the distance.
        Stability::Attracts => {
            let rate = leading[0].abs();
            last <= first * exp(-AS_FAST * rate * time) || last <= 1e-8 * size(&end)
        }
        // Slower than any exponential: at least as its last power would be, and not by the method's
        // own errors.
        _ => {
            ln(first / last) > 1e-7 * time.max(1.0)
                && last < first * (1.0 - 0.05 * time / (run.t_end + time))
        }
    };
    Ok(falls.then_some(rest))
}
