//! The problems of `make bench-work-precision` (README.md) by the crate `differential-equations`:
//! work-precision w1-a 1e-4 1e-6 1e-8
//!
//! Prints CSV: problem, program, tolerance, seconds, steps, final state. A run is repeated until
//! 0.05 s have gone, three times; the least mean is printed. Events are written as a user writes
//! them: one terminal event at a time, located on the interpolant, the mode by hand.

mod clock;

use clock::measure;
use differential_equations::prelude::*;

const EPS: f64 = 1e-3;
/// An event that is located badly may be met again and again.
const MOST_PIECES: u64 = 10_000;

#[derive(Clone, Copy, PartialEq)]
enum Mode {
    Smooth,
    Plus,
    Minus,
    Slide,
    RelayPlus,
    RelayMinus,
}

struct Field {
    alpha: f64,
    beta: f64,
    mode: Mode,
}

impl ODE<f64, [f64; 3]> for Field {
    fn diff(&self, _: f64, s: &[f64; 3], d: &mut [f64; 3]) {
        let [x, y, z] = *s;
        let phi = match self.mode {
            Mode::RelayPlus => return *d = [y - x, z - y, -1.0 - z],
            Mode::RelayMinus => return *d = [y - x, z - y, 1.0 - z],
            Mode::Smooth => 0.5 * (1.0 + (x / EPS).tanh()),
            Mode::Plus => 1.0,
            Mode::Minus => 0.0,
            Mode::Slide => z / (y + z),
        };
        let r2 = x * x + y * y + z * z;
        d[0] = if self.mode == Mode::Slide { 0.0 } else { z + (-y - z) * phi };
        d[1] = -1.4 + 2.4 * phi + (self.alpha - self.beta * y) * r2;
        d[2] = 1.0 - 2.2 * phi + (self.alpha - self.beta * z) * r2;
    }
}

/// side (x - offset), or y z where a run slides; an event where it falls below zero.
#[derive(Clone, Copy)]
enum Event {
    Side(f64, f64),
    Sliding,
}

impl Event {
    fn value(self, s: &[f64; 3]) -> f64 {
        match self {
            Event::Side(side, offset) => side * (s[0] - offset),
            Event::Sliding => s[1] * s[2],
        }
    }
}

/// Counts steps and ends a run at an event.
struct EventSolout {
    event: Option<Event>,
    hit: bool,
    t: f64,
    end: [f64; 3],
    steps: u64,
}

impl Solout<f64, [f64; 3]> for &mut EventSolout {
    fn solout<I>(
        &mut self,
        t1: f64,
        t0: f64,
        x1: &[f64; 3],
        _: &[f64; 3],
        interpolant: &mut I,
        _: &mut Solution<f64, [f64; 3]>,
    ) -> ControlFlag<f64, [f64; 3]>
    where
        I: Interpolation<f64, [f64; 3]> + ?Sized,
    {
        if t1 == t0 {
            return ControlFlag::Continue;
        }
        self.steps += 1;
        let before = std::mem::replace(&mut self.end, *x1);
        self.t = t1;
        let Some(event) = self.event else { return ControlFlag::Continue };
        let (mut ga, mut gb) = (event.value(&before), event.value(x1));
        if gb >= 0.0 {
            return ControlFlag::Continue;
        }
        // Regula falsi, Illinois variant, to the last bits.
        let (mut a, mut b) = (t0, t1);
        for _ in 0..60 {
            let m = b - gb * (b - a) / (gb - ga);
            let Ok(at) = interpolant.interpolate(m) else { break };
            let g = event.value(&at);
            let moved = (m - b).abs();
            if (g < 0.0) == (gb < 0.0) {
                ga *= 0.5;
            } else {
                (a, ga) = (b, gb);
            }
            (b, gb) = (m, g);
            (self.t, self.end) = (m, at);
            if g == 0.0 || moved <= 1e-15 * m.abs() {
                break;
            }
        }
        self.hit = true;
        ControlFlag::Terminate
    }
}

struct Method<'a> {
    name: &'a str,
    tolerance: f64,
    steps: u64,
    pieces: u64,
}

impl Method<'_> {
    /// To the event (true) or to `end`.
    fn until(
        &mut self,
        field: &Field,
        event: Option<Event>,
        t: &mut f64,
        x: &mut [f64; 3],
        end: f64,
    ) -> Result<bool, String> {
        self.pieces += 1;
        if self.pieces > MOST_PIECES {
            return Err("events accumulate".into());
        }
        let mut seen = EventSolout { event, hit: false, t: *t, end: *x, steps: 0 };
        let tolerance = self.tolerance;
        macro_rules! solve {
            ($method:expr) => {{
                let method =
                    $method.rtol(tolerance).atol(tolerance).h_max(10.0).max_steps(1_000_000);
                let run = IVP::ode(field, *t, end, *x).solout(&mut seen).method(method);
                run.solve().map(|_| ()).map_err(|error| format!("{error:?}"))
            }};
        }
        let done = match self.name {
            "dopri5" => solve!(ExplicitRungeKutta::dopri5()),
            "dop853" => solve!(ExplicitRungeKutta::dop853()),
            _ => solve!(ImplicitRungeKutta::radau5()),
        };
        done?;
        (*t, *x) = (if seen.hit { seen.t } else { end }, seen.end);
        self.steps += seen.steps;
        Ok(seen.hit)
    }
}

const START: [f64; 3] = [0.2, 0.0, -1.0];
const PERIODIC: [f64; 3] = [17.057344142481766, 0.0, -0.015417177803876677];

fn smooth(m: &mut Method, alpha: f64, start: [f64; 3], end: f64) -> Result<[f64; 3], String> {
    let beta = if alpha == 1e-3 { 1e-5 } else { 1e-4 };
    let (mut t, mut x) = (0.0, start);
    m.until(&Field { alpha, beta, mode: Mode::Smooth }, None, &mut t, &mut x, end)?;
    Ok(x)
}

fn caricature(mode: Mode) -> Field {
    Field { alpha: 1e-1, beta: 1e-4, mode }
}

fn sliding(m: &mut Method, end: f64) -> Result<[f64; 3], String> {
    let (mut t, mut x, mut mode) = (0.0, START, Mode::Plus);
    loop {
        let event = match mode {
            Mode::Plus => Event::Side(1.0, 0.0),
            Mode::Minus => Event::Side(-1.0, 0.0),
            _ => Event::Sliding,
        };
        if !m.until(&caricature(mode), Some(event), &mut t, &mut x, end)? {
            return Ok(x);
        }
        x[0] = 0.0;
        mode = match (x[1] > 0.0, x[2] > 0.0) {
            (true, true) => Mode::Slide,
            (true, false) => Mode::Minus,
            _ => Mode::Plus,
        };
    }
}

fn hysteresis(m: &mut Method, end: f64) -> Result<[f64; 3], String> {
    let (mut t, mut x, mut plus) = (0.0, [0.3, 0.0, 0.0], true);
    loop {
        let (side, mode) = if plus { (1.0, Mode::RelayPlus) } else { (-1.0, Mode::RelayMinus) };
        let event = Some(Event::Side(side, -0.1 * side));
        if !m.until(&caricature(mode), event, &mut t, &mut x, end)? {
            return Ok(x);
        }
        x[0] = -0.1 * side;
        plus = !plus;
    }
}

fn delay(m: &mut Method, end: f64) -> Result<[f64; 3], String> {
    let (mut t, mut x, mut side, mut plus) = (0.0, START, 1.0, true);
    let mut coming = std::collections::VecDeque::new();
    while t < end {
        let next = coming.front().map_or(end, |due| end.min(*due));
        let mode = if plus { Mode::Plus } else { Mode::Minus };
        let event = Some(Event::Side(side, 0.0));
        if m.until(&caricature(mode), event, &mut t, &mut x, next)? {
            x[0] = 0.0;
            side = -side;
            coming.push_back(t + 1e-2);
        } else if coming.front() == Some(&next) {
            coming.pop_front();
            plus = !plus;
        }
    }
    Ok(x)
}

fn run(problem: &str, m: &mut Method) -> Result<[f64; 3], String> {
    (m.steps, m.pieces) = (0, 0);
    match problem {
        "w1-a" => smooth(m, 1e-3, START, 54.0),
        "w1-b" => smooth(m, 1e-1, START, 13.0),
        "periodic" => smooth(m, 1e-3, PERIODIC, 101.23977502156168),
        "sliding" => sliding(m, 13.0),
        "hysteresis" => hysteresis(m, 60.0),
        "delay" => delay(m, 13.0),
        _ => Err("no such problem".into()),
    }
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let (problem, ladder) = words.split_first().expect("a problem and tolerances");
    for tolerance in ladder.iter().filter_map(|word| word.parse::<f64>().ok()) {
        for name in ["dopri5", "dop853", "radau5"] {
            let mut method = Method { name, tolerance, steps: 0, pieces: 0 };
            let program = format!("differential-equations {name}");
            measure(problem, &program, tolerance, &mut || {
                let end = run(problem, &mut method)?;
                Ok((end, method.steps))
            });
        }
    }
}
