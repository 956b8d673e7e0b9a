//! The clock of `ours.rs` and `crates.rs`.

use cpu_time::ProcessTime;

/// A run is repeated until so many seconds have gone, and the mean taken.
const LONG_ENOUGH: f64 = 0.05;
/// So many times; the least mean counts.
const ROUNDS: usize = 3;

/// Prints a row: problem, program, tolerance, seconds, steps, final state.
pub fn measure(
    problem: &str,
    program: &str,
    tolerance: f64,
    run: &mut dyn FnMut() -> Result<([f64; 3], u64), String>,
) {
    let ([x, y, z], steps) = match run() {
        Ok(done) => done,
        Err(why) => return eprintln!("{problem},{program},{tolerance:e}: {why}"),
    };
    let (mut best, mut count, mut done) = (f64::INFINITY, 1_u32, 0);
    while done < ROUNDS {
        let before = ProcessTime::now();
        for _ in 0..count {
            let _ = std::hint::black_box(run());
        }
        let took = before.elapsed().as_secs_f64();
        if took >= LONG_ENOUGH {
            best = best.min(took / f64::from(count));
            done += 1;
        } else {
            let wanted = 1.3 * LONG_ENOUGH / (took / f64::from(count)).max(1e-9);
            count = (wanted as u32).clamp(count + 1, 10 * count);
        }
    }
    println!("{problem},\"{program}\",{tolerance:e},{best:.4e},{steps},{x},{y},{z}");
}
