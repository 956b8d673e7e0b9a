//! Cost of a unit of time: the caricature, smoothed and hysteretic, both readings, by each method,
//! as the figures run it (tolerances 10^-7.97727, restart after each 100, step cap 10). Prints the
//! counts of work first, then times.
//!
//! `make bench`; `cargo bench --bench steppers -- --counts` in this folder prints the counts only.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput};
use nalgebra::{SVector, Vector3, Vector4};
use twofold::integrate::{
    Dopri5, DriveOptions, Failure, Flow, Lsoda, Observer, Radau5, Schedule, Statistics, Step,
    StepCap, Stepper, Summary, Tolerance, drive,
};
use twofold::num::elementary::exp10;
use twofold::system::{Caricature, Hysteretic, Relaxation, Smoothed, Transition, VectorField};

const READINGS: [(&str, f64); 2] = [("printed", 1e-3), ("reconstructed", 1e-1)];

fn tolerance() -> Tolerance {
    let t = exp10(-7.97727);
    Tolerance { rtol: t, atol: t }
}

fn smoothed(alpha: f64) -> Smoothed<Caricature> {
    Smoothed {
        system: Caricature::with_reinjection(alpha, 1e-5),
        transition: Transition::Tanh,
        eps: 1e-3,
    }
}

fn hysteretic(alpha: f64) -> Hysteretic<Caricature> {
    Hysteretic {
        system: Caricature::with_reinjection(alpha, 1e-5),
        eps: 1e-3,
        eps_prime: 1e-2,
        relaxation: Relaxation::Literal,
    }
}

/// Counts how often the last component passes 1/2: the swings of a hysteretic phi.
struct Swings(u64);

impl<const N: usize> Observer<N> for Swings {
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        self.0 += u64::from((step.x0[N - 1] > 0.5) != (step.x1[N - 1] > 0.5));
        Flow::Continue
    }
}

fn run<F: VectorField<N>, M: Stepper<N>, const N: usize>(
    field: &F,
    start: SVector<f64, N>,
    t_end: f64,
    mut stepper: M,
) -> Result<(Statistics, u64), Failure> {
    let mut swings = Swings(0);
    let schedule = Schedule { restart_every: Some(100.0), kick: None };
    let options = DriveOptions {
        t_end,
        schedule,
        step_cap: StepCap::FractionOfSegment(0.1),
        max_steps: 100_000_000,
        kicked_states: 3,
    };
    drive(field, start, &options, &mut stepper, &mut swings, &())
        .and_then(Summary::within_budget)
        .map(|s| (s.statistics, swings.0))
}

fn by_name<F: VectorField<N>, const N: usize>(
    method: &str,
    field: &F,
    start: SVector<f64, N>,
    t_end: f64,
) -> Result<(Statistics, u64), Failure> {
    match method {
        "dopri5" => run(field, start, t_end, Dopri5::new(tolerance())),
        "lsoda" => run(field, start, t_end, Lsoda::new(tolerance())),
        _ => run(field, start, t_end, Radau5::new(tolerance())),
    }
}

const METHODS: [&str; 3] = ["dopri5", "lsoda", "radau5"];

fn counts(t_end: f64) {
    println!("work for t = {t_end}");
    println!(
        "{:24} {:7} {:>9} {:>9} {:>11} {:>9} {:>9} {:>9} {:>9}",
        "system",
        "method",
        "steps",
        "rejected",
        "evaluations",
        "Jacobians",
        "BDF",
        "switches",
        "swings"
    );
    let print =
        |system: &str, method: &str, result: Result<(Statistics, u64), Failure>| match result {
            Ok((s, swings)) => println!(
                "{system:24} {method:7} {:9} {:9} {:11} {:9} {:9} {:9} {:>9}",
                s.steps,
                s.rejected + s.convergence_failures,
                s.evaluations,
                s.jacobians,
                s.stiff_steps,
                s.method_switches,
                if system.starts_with("hysteretic") { swings.to_string() } else { String::new() },
            ),
            Err(failure) => println!("{system:24} {method:7} {failure}"),
        };
    for (reading, alpha) in READINGS {
        for method in METHODS {
            let result = by_name(method, &smoothed(alpha), Vector3::new(0.2, 0.0, -1.0), t_end);
            print(&format!("smoothed {reading}"), method, result);
        }
        for method in METHODS {
            let result =
                by_name(method, &hysteretic(alpha), Vector4::new(0.2, 0.0, -1.0, 1.0), t_end);
            print(&format!("hysteretic {reading}"), method, result);
        }
    }
}

fn times(criterion: &mut Criterion) {
    const T_END: f64 = 100.0;
    for (reading, alpha) in READINGS {
        let mut group = criterion.benchmark_group(format!("smoothed {reading}"));
        group.throughput(Throughput::Elements(T_END as u64)).sample_size(20);
        for method in METHODS {
            group.bench_function(BenchmarkId::from_parameter(method), |b| {
                b.iter(|| {
                    by_name(
                        method,
                        &smoothed(black_box(alpha)),
                        Vector3::new(0.2, 0.0, -1.0),
                        T_END,
                    )
                });
            });
        }
        group.finish();
        let mut group = criterion.benchmark_group(format!("hysteretic {reading}"));
        group.throughput(Throughput::Elements(T_END as u64)).sample_size(10);
        for method in METHODS {
            group.bench_function(BenchmarkId::from_parameter(method), |b| {
                b.iter(|| {
                    by_name(
                        method,
                        &hysteretic(black_box(alpha)),
                        Vector4::new(0.2, 0.0, -1.0, 1.0),
                        T_END,
                    )
                });
            });
        }
        group.finish();
    }
}

fn main() {
    let only_counts = std::env::args().any(|a| a == "--counts");
    counts(2000.0);
    if !only_counts {
        let mut criterion = Criterion::default().configure_from_args();
        times(&mut criterion);
        criterion.final_summary();
    }
}
