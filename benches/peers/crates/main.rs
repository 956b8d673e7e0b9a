//! Units of work W0 and W1 (benches/README.md) with the `differential-equations` crate:
//! crates-units W0|W1 A radau5|dopri5 5
//!
//! Prints: peer, unit, set, the least seconds of processor time of the given number of runs, steps,
//! crossings, final state.
//!
//! Its Radau IIA does what Hairer & Wanner's program does: a tolerance r that is asked for is
//! replaced by 0.1 r^(2/3), here 4.8e-7.

use differential_equations::prelude::*;

const TOLERANCE: f64 = 1.0536712e-8;

struct Caricature {
    alpha: f64,
    beta: f64,
}

const EPS: f64 = 1e-3;
const V_PLUS: f64 = -1.2;
const V_MINUS: f64 = -1.4;

impl ODE<f64, [f64; 3]> for Caricature {
    fn diff(&self, _: f64, s: &[f64; 3], d: &mut [f64; 3]) {
        let [x, y, z] = *s;
        let phi = 0.5 * (1.0 + (x / EPS).tanh());
        let r2 = x * x + y * y + z * z;
        d[0] = z + (-y - z) * phi;
        d[1] = V_MINUS + (1.0 - V_MINUS) * phi + (self.alpha - self.beta * y) * r2;
        d[2] = 1.0 + (V_PLUS - 1.0) * phi + (self.alpha - self.beta * z) * r2;
    }

    fn jacobian(&self, _: f64, s: &[f64; 3], j: &mut Matrix<f64>) {
        let [x, y, z] = *s;
        let tanh = (x / EPS).tanh();
        let (phi, slope) = (0.5 * (1.0 + tanh), 0.5 * (1.0 - tanh * tanh) / EPS);
        let r2 = x * x + y * y + z * z;
        let (by_y, by_z) = (self.alpha - self.beta * y, self.alpha - self.beta * z);
        let rows = [
            [(-y - z) * slope, -phi, 1.0 - phi],
            [
                (1.0 - V_MINUS) * slope + by_y * 2.0 * x,
                by_y * 2.0 * y - self.beta * r2,
                by_y * 2.0 * z,
            ],
            [
                (V_PLUS - 1.0) * slope + by_z * 2.0 * x,
                by_z * 2.0 * y,
                by_z * 2.0 * z - self.beta * r2,
            ],
        ];
        for (i, row) in rows.iter().enumerate() {
            for (k, entry) in row.iter().enumerate() {
                j[(i, k)] = *entry;
            }
        }
    }
}

/// Counts steps and locates the crossings of y = 0 on the interpolant.
#[derive(Default)]
struct Section {
    steps: u64,
    crossings: u64,
    sum: f64,
    t: f64,
    end: [f64; 3],
    /// Times that the solver gave up and was started again from where it stood.
    given_up: u64,
}

impl Solout<f64, [f64; 3]> for &mut Section {
    fn solout<I>(
        &mut self,
        t1: f64,
        t0: f64,
        x1: &[f64; 3],
        x0: &[f64; 3],
        interpolant: &mut I,
        _: &mut Solution<f64, [f64; 3]>,
    ) -> ControlFlag<f64, [f64; 3]>
    where
        I: Interpolation<f64, [f64; 3]> + ?Sized,
    {
        (self.t, self.end) = (t1, *x1);
        if t1 == t0 {
            return ControlFlag::Continue;
        }
        self.steps += 1;
        let (mut ya, mut yb) = (x0[1], x1[1]);
        if (ya < 0.0) != (yb < 0.0) {
            // Regula falsi, Illinois variant, to the last bits.
            let (mut a, mut b, mut at) = (t0, t1, *x1);
            for _ in 0..60 {
                let m = b - yb * (b - a) / (yb - ya);
                let Ok(found) = interpolant.interpolate(m) else { break };
                at = found;
                if at[1] == 0.0 || (m - b).abs() <= 1e-15 * b.abs() {
                    break;
                }
                if (at[1] < 0.0) != (yb < 0.0) {
                    (a, ya) = (b, yb);
                } else {
                    ya *= 0.5;
                }
                (b, yb) = (m, at[1]);
            }
            self.crossings += 1;
            self.sum += at[0] + at[2];
        }
        ControlFlag::Continue
    }
}

/// So many segments of such a length.
fn run(system: &Caricature, method: &str, segments: u32, length: f64) -> Option<Section> {
    let mut section = Section { end: [0.2, 0.0, -1.0], ..Section::default() };
    for k in 1..=segments {
        let end = length * f64::from(k);
        while section.t < end {
            let (t, x) = (section.t, section.end);
            let done = match method {
                "radau5" => {
                    let method = ImplicitRungeKutta::radau5()
                        .rtol(TOLERANCE)
                        .atol(TOLERANCE)
                        .h_max(10.0)
                        .max_steps(1_000_000);
                    IVP::ode(system, t, end, x).solout(&mut section).method(method).solve().is_ok()
                }
                "dopri5" => {
                    let method = ExplicitRungeKutta::dopri5()
                        .rtol(TOLERANCE)
                        .atol(TOLERANCE)
                        .h_max(10.0)
                        .max_steps(1_000_000);
                    IVP::ode(system, t, end, x).solout(&mut section).method(method).solve().is_ok()
                }
                _ => return None,
            };
            if done {
                section.t = end;
            } else if section.t == t {
                return None;
            } else {
                section.given_up += 1;
            }
        }
    }
    Some(section)
}

/// Processor seconds of this process, in the kernel's ticks of a hundredth.
fn seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit(") ").next().unwrap_or_default().split(' ').skip(11).take(2);
    fields.filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [unit, set, method, repeats] = words.iter().map(String::as_str).collect::<Vec<_>>()[..]
    else {
        eprintln!("usage: crates-units W0|W1 A|B radau5|dopri5 REPEATS");
        std::process::exit(2);
    };
    let system = if set == "A" {
        Caricature { alpha: 1e-3, beta: 1e-5 }
    } else {
        Caricature { alpha: 1e-1, beta: 1e-4 }
    };
    let mut best = f64::INFINITY;
    let mut last = None;
    for _ in 0..repeats.parse().unwrap_or(1) {
        let start = seconds();
        last = if unit == "W0" {
            run(&system, method, 1, 10.0)
        } else {
            run(&system, method, 2000, 100.0)
        };
        best = best.min(seconds() - start);
    }
    let Some(Section { steps, crossings, end: [x, y, z], given_up, .. }) = last else {
        eprintln!("not solved");
        std::process::exit(1);
    };
    if given_up > 0 {
        eprintln!(
            "gave up {given_up} times (\"step size became too small\") and was started again"
        );
    }
    println!(
        "differential-equations-{method} {unit} {set} {best:.6} {steps} {crossings} {x} {y} {z}"
    );
}
