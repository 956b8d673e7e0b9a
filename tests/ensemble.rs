//! A run in a lane against the same run alone.

use nalgebra::{SVector, vector};
use twofold::integrate::ensemble::{End, Settings, ensemble, in_lanes};
use twofold::integrate::{Course, Dopri5, Failure, Ignore, StepCap, Tolerance, drive};
use twofold::system::{Caricature, Smoothed, Transition};

fn field() -> Smoothed<Caricature> {
    Smoothed { system: Caricature::with_reinjection(1e-1, 1e-4), transition: Transition::Tanh, eps: 1e-3 }
}

const SETTINGS: Settings = Settings {
    tolerance: Tolerance { rtol: 1.0536712e-8, atol: 1.0536712e-8 },
    t_end: 30.0,
    max_step: 10.0,
    max_steps: 20_000,
};

/// Some that stay near, one on its own far from the others, one that cannot begin.
fn starts() -> Vec<SVector<f64, 3>> {
    let mut starts: Vec<_> = (0..21).map(|k| vector![0.1 + 0.01 * f64::from(k), 0.0, -1.0]).collect();
    starts.push(vector![0.9, -0.6, 0.4]);
    starts.insert(5, vector![f64::NAN, 0.0, 0.0]);
    starts
}

fn alone(x0: SVector<f64, 3>, settings: &Settings) -> Result<End<3>, Failure> {
    let course = Course {
        step_cap: StepCap::Absolute(settings.max_step),
        max_steps: settings.max_steps,
        ..Course::to(settings.t_end)
    };
    let end = drive(&field(), x0, &course, &mut Dopri5::new(settings.tolerance), &mut Ignore, &())?.within_budget()?;
    Ok(End { x: end.x, statistics: end.statistics })
}

/// Bits, not values: NaN states in errors compare too.
fn words(ends: &[Result<End<3>, Failure>]) -> Vec<String> {
    let word = |e: &Result<End<3>, Failure>| match e {
        Ok(end) => format!("{:?} {:?}", end.x.map(f64::to_bits), end.statistics),
        Err(failure) => format!("{failure:?}"),
    };
    ends.iter().map(word).collect()
}

#[test]
fn a_lane_has_the_bits_of_a_run_alone() {
    let expected = words(&starts().iter().map(|x| alone(*x, &SETTINGS)).collect::<Vec<_>>());
    assert!(expected[5].starts_with("NotFinite") && expected[0].contains("rejected"), "{expected:?}");
    assert_eq!(words(&ensemble(&field(), &starts(), &SETTINGS)), expected, "with the machine's instructions");
    assert_eq!(words(&in_lanes::<_, 3, 1>(&field(), &starts(), &SETTINGS)), expected, "1 lane");
    assert_eq!(words(&in_lanes::<_, 3, 4>(&field(), &starts(), &SETTINGS)), expected, "4 lanes");
    assert_eq!(words(&in_lanes::<_, 3, 8>(&field(), &starts(), &SETTINGS)), expected, "8 lanes");
    // Whatever the neighbours.
    let mut backwards = starts();
    backwards.reverse();
    let mut found = words(&ensemble(&field(), &backwards, &SETTINGS));
    found.reverse();
    assert_eq!(found, expected);
}

#[test]
fn a_budget_ends_a_run_where_it_ends_it_alone() {
    let settings = Settings { max_steps: 100, ..SETTINGS };
    let expected = words(&starts().iter().map(|x| alone(*x, &settings)).collect::<Vec<_>>());
    assert!(expected[0].starts_with("TooManySteps"), "{expected:?}");
    assert_eq!(words(&ensemble(&field(), &starts(), &settings)), expected);
}

#[test]
fn no_starts_no_ends() {
    assert!(ensemble(&field(), &[], &SETTINGS).is_empty());
}
