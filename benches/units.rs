//! The units of work W0 to W3 (benches/README.md), by our methods: `twofold-units W1 A dopri5 5`.
//!
//! Prints one line, as the programs in benches/peers do: program, unit, set, the least seconds of
//! the given number of runs, steps, crossings, final state of the last run.

use std::process::exit;
use std::time::Instant;

use nalgebra::{SVector, Vector3};
use twofold::analyse::SectionRecorder;
use twofold::integrate::ensemble::{EnsembleRun, InstructionSet, ensemble_with};
use twofold::integrate::{
    Dopri5, DriveOptions, Failure, Ignore, Layered, Lsoda, Radau5, Schedule, StepCap, Stepper,
    Taylor, Tolerance, drive,
};
use twofold::system::{
    BatchedField, BoundField, Caricature, Field as Recorded, ParameterBatch, Smoothed, System,
    Transition, VectorField,
};

const TOLERANCE: Tolerance = Tolerance { rtol: 1.0536712e-8, atol: 1.0536712e-8 };

/// The tolerance into which Hairer & Wanner's program, and others after it, convert [`TOLERANCE`]:
/// 0.1 rtol^(2/3).
const REPLACED: Tolerance = Tolerance { rtol: 4.806217345097476e-07, atol: 4.806217345097476e-07 };

/// With which Radau IIA's error at the end of W0 is below that of the crate
/// `differential-equations` in both sets.
const MATCHED: Tolerance = Tolerance { rtol: 1e-5, atol: 1e-5 };

/// For double-double arithmetic.
const EXACT: Tolerance = Tolerance { rtol: 1e-30, atol: 1e-30 };

type Field = Smoothed<Caricature>;

/// Steps, crossings, final state.
type Done = Result<(u64, usize, SVector<f64, 3>), Failure>;

fn field(set: &str) -> Field {
    let (alpha, beta) = if set == "A" { (1e-3, 1e-5) } else { (1e-1, 1e-4) };
    let system = Caricature { beta, ..Caricature::with_reinjection(alpha, beta) };
    Smoothed { system, transition: Transition::Tanh, eps: 1e-3 }
}

/// The same from its file, as a user's system is.
fn from_file(set: &str) -> Option<BoundField<3>> {
    let (alpha, beta) = if set == "A" { (1e-3, 1e-5) } else { (1e-1, 1e-4) };
    let system =
        System::builtin("caricature")?.with("alpha", alpha).ok()?.with("beta", beta).ok()?;
    Recorded::smoothed(&system, Transition::Tanh, 1e-3).bind().ok()
}

fn w1<F: VectorField<3>, M: Stepper<3>>(field: &F, mut stepper: M) -> Done {
    let mut section = SectionRecorder::<3>::new(1, 0.0);
    let options = DriveOptions {
        t_end: 2e5,
        schedule: Schedule { restart_every: Some(100.0), kick: None },
        step_cap: StepCap::FractionOfSegment(0.1),
        max_steps: u64::MAX,
        kicked_states: 3,
    };
    let end =
        drive(field, Vector3::new(0.2, 0.0, -1.0), &options, &mut stepper, &mut section, &())?;
    Ok((end.statistics.steps, section.crossings().len(), end.x))
}

fn w2<F: VectorField<3>, M: Stepper<3>>(field: &F, make: impl Fn() -> M) -> Done {
    let mut done = (0, 0, Vector3::new(0.0, 0.0, 0.0));
    let options = DriveOptions {
        t_end: 2000.0,
        schedule: Schedule::default(),
        step_cap: StepCap::Absolute(10.0),
        max_steps: u64::MAX,
        kicked_states: 3,
    };
    for k in 0..1000 {
        let x = 0.1 + 0.2 * (f64::from(k) + 0.5) / 1000.0;
        let end =
            drive(field, Vector3::new(x, 0.0, -1.0), &options, &mut make(), &mut Ignore, &())?;
        done = (done.0 + end.statistics.steps, 0, end.x);
    }
    Ok(done)
}

/// W2 in lanes.
fn w2_in_lanes<E: BatchedField<3>>(equations: &E, set: InstructionSet) -> Done {
    let options = DriveOptions { step_cap: StepCap::Absolute(10.0), ..DriveOptions::to(2000.0) };
    let run = |k: u32| EnsembleRun {
        start: Vector3::new(0.1 + 0.2 * (f64::from(k) + 0.5) / 1000.0, 0.0, -1.0),
        options,
    };
    let runs: Vec<_> = (0..1000).map(run).collect();
    let ends = ensemble_with(set, equations, &runs, TOLERANCE, None, |_| Ignore);
    ends.into_iter().try_fold((0, 0, Vector3::new(0.0, 0.0, 0.0)), |done, end| {
        let end = end.summary?;
        Ok((done.0 + end.statistics.steps, 0, end.x))
    })
}

/// W0: the short stretch on which the error is known.
fn w0<F: VectorField<3>, M: Stepper<3>>(field: &F, mut stepper: M) -> Done {
    let options = DriveOptions { step_cap: StepCap::Absolute(10.0), ..DriveOptions::to(10.0) };
    let end = drive(field, Vector3::new(0.2, 0.0, -1.0), &options, &mut stepper, &mut Ignore, &())?;
    Ok((end.statistics.steps, 0, end.x))
}

/// W3: ordinary stretches of the orbit in double-double arithmetic.
fn w3<F: VectorField<3>>(field: &F) -> Done {
    let options = DriveOptions { step_cap: StepCap::Absolute(10.0), ..DriveOptions::to(300.0) };
    let end = drive(
        field,
        Vector3::new(0.2, 0.0, -1.0),
        &options,
        &mut Taylor::extended(EXACT),
        &mut Ignore,
        &(),
    )?;
    Ok((end.statistics.steps, 0, end.x))
}

fn once(unit: &str, set: &str, method: &str) -> Option<Done> {
    let field = field(set);
    Some(match (unit, method) {
        ("W0", "dopri5") => w0(&field, Dopri5::new(TOLERANCE)),
        ("W0", "lsoda") => w0(&field, Lsoda::new(TOLERANCE)),
        ("W0", "radau5") => w0(&field, Radau5::new(TOLERANCE)),
        ("W0", "radau5-replaced") => w0(&field, Radau5::new(REPLACED)),
        ("W0", "radau5-matched") => w0(&field, Radau5::new(MATCHED)),
        ("W0", "taylor") => w0(&field, Taylor::new(TOLERANCE)),
        ("W0", "layered") => w0(&field, Layered::new(TOLERANCE)),
        ("W0", "taylor-extended") => w0(&field, Taylor::extended(EXACT)),
        ("W1", "dopri5") => w1(&field, Dopri5::new(TOLERANCE)),
        ("W1", "lsoda") => w1(&field, Lsoda::new(TOLERANCE)),
        ("W1", "radau5") => w1(&field, Radau5::new(TOLERANCE)),
        ("W1", "radau5-replaced") => w1(&field, Radau5::new(REPLACED)),
        ("W1", "radau5-matched") => w1(&field, Radau5::new(MATCHED)),
        ("W1", "taylor") => w1(&field, Taylor::new(TOLERANCE)),
        ("W3", "taylor-extended") => w3(&field),
        ("W1", "layered") => w1(&field, Layered::new(TOLERANCE)),
        ("W2", "layered") => w2(&field, || Layered::new(TOLERANCE)),
        ("W2", "dopri5") => w2(&field, || Dopri5::new(TOLERANCE)),
        ("W2", "dopri5-lanes-avx2") if InstructionSet::Avx2.is_here() => {
            w2_in_lanes(&field, InstructionSet::Avx2)
        }
        ("W2", "dopri5-lanes-avx512") if InstructionSet::Avx512.is_here() => {
            w2_in_lanes(&field, InstructionSet::Avx512)
        }
        ("W2", "dopri5-lanes-portable") => w2_in_lanes(&field, InstructionSet::Portable),
        ("W1", "dopri5-file") => w1(&from_file(set)?, Dopri5::new(TOLERANCE)),
        ("W1", "taylor-file") => w1(&from_file(set)?, Taylor::new(TOLERANCE)),
        ("W2", "dopri5-lanes-file") => w2_in_lanes(&from_file(set)?, InstructionSet::best()),
        // As if each run had parameters of its own.
        ("W2", "dopri5-lanes-parameters") => {
            let field = from_file(set)?;
            w2_in_lanes(&ParameterBatch::new(vec![field; 1000])?, InstructionSet::best())
        }
        ("W2", "lsoda") => w2(&field, || Lsoda::new(TOLERANCE)),
        _ => return None,
    })
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [unit, set, method, repeats] = words.iter().map(String::as_str).collect::<Vec<_>>()[..]
    else {
        println!("usage: twofold-units W0|W1|W2|W3 A|B METHOD REPEATS");
        return;
    };
    let mut best = f64::INFINITY;
    let mut last = None;
    for _ in 0..repeats.parse().unwrap_or(1) {
        let start = Instant::now();
        last = once(unit, set, method);
        best = best.min(start.elapsed().as_secs_f64());
    }
    match last {
        Some(Ok((steps, crossings, x))) => {
            println!(
                "twofold-{method} {unit} {set} {best:.6} {steps} {crossings} {} {} {}",
                x[0], x[1], x[2]
            );
        }
        Some(Err(failure)) => {
            eprintln!("{failure}");
            exit(1);
        }
        None => {
            eprintln!("no such unit or method: {unit} {method}");
            exit(2);
        }
    }
}
