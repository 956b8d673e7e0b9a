//! Work a second of general systems: `cargo bench --bench general` in this folder.
//!
//! Each line is the fastest of five runs: a ball whose impacts do not accumulate; an oscillator
//! with and without what a step is searched for; rows of blocks on a belt, where each step must
//! cost in proportion to the number of blocks.

use std::time::Instant;

use twofold_hybrid::motion::Record;
use twofold_hybrid::{Definition, Model, Options, follow};

struct Work {
    seconds: f64,
    steps: u64,
    events: u64,
}

fn measure(text: &str, t_end: f64) -> Result<Work, Box<dyn std::error::Error>> {
    let model = Model::new(Definition::from_toml(text, "speed.toml")?);
    let options = Options { t_end, record: Record::Times { every: t_end }, ..Options::default() };
    let mut best = Work { seconds: f64::INFINITY, steps: 0, events: 0 };
    for _ in 0..5 {
        let begin = Instant::now();
        let outcome = follow(&model, &options, &mut |_| true)?;
        let seconds = begin.elapsed().as_secs_f64();
        if seconds < best.seconds {
            best = Work { seconds, steps: outcome.steps, events: outcome.events };
        }
    }
    Ok(best)
}

/// A row of blocks between springs, each on the belt.
fn blocks(n: usize) -> String {
    let names = |letter: &str| (0..n).map(|i| format!("'{letter}{i}'")).collect::<Vec<_>>();
    let start = (0..n)
        .map(|i| format!("{}", 0.01 * i as f64))
        .chain((0..n).map(|_| "0".into()))
        .collect::<Vec<_>>();
    let mut f: Vec<String> = (0..n).map(|i| format!("'v{i}'")).collect();
    for i in 0..n {
        let left = if i > 0 { format!("x{} - x{i}", i - 1) } else { format!("-x{i}") };
        let right = if i + 1 < n { format!(" + x{} - x{i}", i + 1) } else { String::new() };
        f.push(format!("'{left}{right} - 0.5*sign(v{i} - 0.1) - 0.05*v{i}'"));
    }
    let states = [names("x"), names("v")].concat();
    format!(
        "states = [{}]\nstart = [{}]\nf = [{}]",
        states.join(", "),
        start.join(", "),
        f.join(", ")
    )
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let ball = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-9.81']\n\
        [[event]]\nwhen = 'x'\ndirection = 'down'\nset = { v = '-v' }";
    let work = measure(ball, 20_000.0)?;
    println!(
        "ball: {:.0} impacts a second ({} in {:.3} s)",
        work.events as f64 / work.seconds,
        work.events,
        work.seconds
    );
    // An orbit that never comes near the surface, and the same without one.
    let oscillator =
        "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-x - 0.2*x^3 + 0.1*cos(1.3*x)']";
    let plain = measure(oscillator, 5_000.0)?;
    let event = measure(
        &format!("{oscillator}\n[[event]]\nwhen = 'x - 3'\nset = {{ v = '-v' }}"),
        5_000.0,
    )?;
    let curved = measure(
        &format!("{oscillator}\n[[event]]\nwhen = 'x^2 + x*v - 25'\nset = {{ v = '-v' }}"),
        5_000.0,
    )?;
    let waves = measure(
        &format!("{oscillator}\n[[event]]\nwhen = 'sin(x) + v - 25'\nset = {{ v = '-v' }}"),
        5_000.0,
    )?;
    let each = |work: &Work| 1e9 * work.seconds / work.steps as f64;
    println!(
        "oscillator: {:.0} ns a step; with the event x = 3 {:+.0} %; with the event x^2 + x v = 25 \
            {:+.0} %; sin(x) + v = 25 {:+.0} %",
        each(&plain),
        100.0 * (each(&event) / each(&plain) - 1.0),
        100.0 * (each(&curved) / each(&plain) - 1.0),
        100.0 * (each(&waves) / each(&plain) - 1.0),
    );
    for n in [12, 25, 50] {
        let work = measure(&blocks(n), 2.0)?;
        println!(
            "{n} blocks: {:.0} us a step, {:.2} us a step and block ({} steps)",
            1e-3 * each(&work),
            1e-3 * each(&work) / n as f64,
            work.steps
        );
    }
    Ok(())
}
