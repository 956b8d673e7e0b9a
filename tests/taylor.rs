//! The project's own ground truth: Taylor series in double-double arithmetic against crossings computed in 113-bit
//! arithmetic outside this project (tests/data/crossings-*.csv).

use nalgebra::{SVector, vector};
use twofold::integrate::*;
use twofold::model::{Caricature, Smoothed, Transition};
use twofold::observe::{Crossing, SectionRecorder};

struct Row {
    t: f64,
    x: f64,
    z: f64,
    direction: String,
    uncertainty: f64,
}

fn rows(text: &str) -> Vec<Row> {
    text.lines()
        .filter(|l| !l.starts_with('#') && !l.starts_with("t,"))
        .map(|l| {
            let f: Vec<&str> = l.split(',').collect();
            let n = |i: usize| f[i].parse().unwrap();
            Row { t: n(0), x: n(1), z: n(2), direction: f[3].to_string(), uncertainty: n(4) }
        })
        .collect()
}

fn smoothed(alpha: f64, eps: f64) -> Smoothed<Caricature> {
    Smoothed { system: Caricature::with_reinjection(alpha, 1e-5), transition: Transition::Tanh, eps }
}

/// The crossings of y = 0 up to `t_end`, and the work done.
fn crossings<M: Stepper<3>>(alpha: f64, mut stepper: M, t_end: f64) -> (Vec<Crossing>, Statistics) {
    let x0: SVector<f64, 3> = vector![0.2, 0.0, -1.0];
    let mut recorder = SectionRecorder::new(1, 0.0);
    let end = drive(
        &smoothed(alpha, 1e-3),
        x0,
        t_end,
        &mut stepper,
        &Schedule::default(),
        StepCap::None,
        10_000_000,
        &mut recorder,
        &(),
    )
    .unwrap();
    (recorder.into_crossings(), end.statistics)
}

const PRINTED: &str = include_str!("data/crossings-printed.csv");
const RECONSTRUCTED: &str = include_str!("data/crossings-reconstructed.csv");

fn table<M: Stepper<3>>(alpha: f64, text: &str, stepper: M, count: usize) -> Vec<f64> {
    let want = rows(text);
    let want = &want[..count.min(want.len())];
    let (got, statistics) = crossings(alpha, stepper, want.last().unwrap().t + 0.01);
    println!("{statistics:?}");
    want.iter()
        .zip(&got)
        .map(|(w, g)| {
            let error = (g.x[0] - w.x).abs().max((g.x[2] - w.z).abs());
            println!(
                "{:20} error {error:9.2e} in t {:9.2e} y {:9.2e} uncertainty {:8.1e} {} {}",
                w.t,
                (g.t - w.t).abs(),
                g.x[1],
                w.uncertainty,
                w.direction,
                g.direction.word()
            );
            error
        })
        .collect()
}

#[test]
fn measure() {
    for (alpha, text) in [(1e-3, PRINTED), (1e-1, RECONSTRUCTED)] {
        let start = std::time::Instant::now();
        println!("dd {alpha}");
        table(alpha, text, Taylor::extended(Tolerance { rtol: 1e-31, atol: 1e-31 }), 1000);
        println!("{:?}", start.elapsed());
        println!("f64 {alpha}");
        table(alpha, text, Taylor::new(Tolerance { rtol: 1e-16, atol: 1e-16 }), 1000);
        println!("{:?}", start.elapsed());
    }
}
