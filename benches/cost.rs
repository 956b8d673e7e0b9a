//! Cost of a run against its length, the thickness of its layer and its tolerance:
//! `make bench-cost`.
//!
//! Prints a CSV: what is varied, its value, method, threads, processor seconds of one run
//! (wall-clock seconds with two threads), steps, evaluations, crossings. A short run is repeated
//! until a quarter of a second has gone, and the mean is told: what a system counts as a thread's
//! time may come in steps of four milliseconds. A run of more than `MOST` steps is given up and
//! says so.

use std::time::Instant;

use nalgebra::Vector3;
use twofold::analyse::SectionRecorder;
use twofold::integrate::ensemble::{EnsembleRun, SectionPlane, ensemble};
use twofold::integrate::{
    Dopri5, DriveOptions, Layered, Lsoda, Radau5, Schedule, StepCap, Stepper, StopReason, Taylor,
    Tolerance, drive,
};
use twofold::system::{Caricature, Smoothed, Transition};

const MOST: u64 = 200_000_000;
const LONG_ENOUGH: f64 = 0.25;
const TOLERANCE: f64 = 1.0536712e-8;

type Field = Smoothed<Caricature>;

fn field(eps: f64) -> Field {
    Smoothed { system: Caricature::with_reinjection(1e-1, 1e-4), transition: Transition::Tanh, eps }
}

fn options(t_end: f64) -> DriveOptions {
    DriveOptions {
        t_end,
        schedule: Schedule { restart_every: Some(100.0), kick: None },
        step_cap: StepCap::FractionOfSegment(0.1),
        max_steps: MOST,
        kicked_states: 3,
    }
}

/// Seconds that this thread has computed; where the system does not tell, seconds of the clock
/// since `since`.
fn seconds(since: Instant) -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| since.elapsed().as_secs_f64(), |n| n * 1e-9)
}

fn one<M: Stepper<3>>(
    varied: &str,
    value: f64,
    method: &str,
    eps: f64,
    t_end: f64,
    stepper: impl Fn() -> M,
) {
    let start = Instant::now();
    let before = seconds(start);
    let mut runs = 0.0;
    loop {
        let mut section = SectionRecorder::<3>::new(1, 0.0);
        let end = drive(
            &field(eps),
            Vector3::new(0.2, 0.0, -1.0),
            &options(t_end),
            &mut stepper(),
            &mut section,
            &(),
        );
        let took = seconds(start) - before;
        runs += 1.0;
        match end {
            Ok(end) if end.stop == StopReason::EndTime && took < LONG_ENOUGH => (),
            Ok(end) if end.stop == StopReason::EndTime => {
                return println!(
                    "{varied},{value:e},{method},1,{:.3e},{},{},{}",
                    took / runs,
                    end.statistics.steps,
                    end.statistics.evaluations,
                    section.crossings().len()
                );
            }
            Ok(_) => return println!("{varied},{value:e},{method},1,given up,,,"),
            Err(failure) => return println!("{varied},{value:e},{method},1,\"{failure}\",,,"),
        }
    }
}

fn each(varied: &str, value: f64, eps: f64, t_end: f64, tolerance: f64) {
    let tolerance = Tolerance { rtol: tolerance, atol: tolerance };
    one(varied, value, "dopri5", eps, t_end, || Dopri5::new(tolerance));
    one(varied, value, "lsoda", eps, t_end, || Lsoda::new(tolerance));
    one(varied, value, "radau5", eps, t_end, || Radau5::new(tolerance));
    one(varied, value, "taylor", eps, t_end, || Taylor::new(tolerance));
    one(varied, value, "layered", eps, t_end, || Layered::new(tolerance));
}

fn main() {
    println!("varied,value,method,threads,seconds,steps,evaluations,crossings");
    for t_end in [2e3, 2e4, 2e5, 2e6] {
        each("t_end", t_end, 1e-3, t_end, TOLERANCE);
    }
    for eps in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6] {
        each("eps", eps, eps, 2e3, TOLERANCE);
    }
    for tolerance in [1e-4, 1e-6, 1e-8, 1e-10, 1e-12] {
        each("tolerance", tolerance, 1e-3, 2e3, tolerance);
    }
    // 512 runs in lanes, sections recorded, on one thread and on two: of the clock, so an idle
    // machine is needed.
    let runs: Vec<_> = (0..512)
        .map(|k| EnsembleRun {
            start: Vector3::new(0.1 + 0.2 * f64::from(k) / 512.0, 0.0, -1.0),
            options: options(2e3),
        })
        .collect();
    let plane = Some(SectionPlane { coordinate: 1, value: 0.0 });
    let tolerance = Tolerance { rtol: TOLERANCE, atol: TOLERANCE };
    for threads in [1, 2] {
        let start = Instant::now();
        let done = std::thread::scope(|scope| {
            let part = |runs| {
                scope.spawn(move || {
                    let ends = ensemble(&field(1e-3), runs, tolerance, plane, |_| {
                        SectionRecorder::<3>::new(1, 0.0)
                    });
                    ends.iter()
                        .filter_map(|end| end.summary.as_ref().ok().map(|s| s.statistics.steps))
                        .sum::<u64>()
                })
            };
            let parts: Vec<_> = runs.chunks(runs.len() / threads).map(part).collect();
            parts.into_iter().filter_map(|p| p.join().ok()).sum::<u64>()
        });
        let took = start.elapsed().as_secs_f64();
        println!("512 runs in lanes,2e3,dopri5,{threads},{took:.3e},{done},,");
    }
}
