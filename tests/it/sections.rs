//! Crossings of planes, found the quick way, against the whole search on every step of real runs.

use nalgebra::Vector3;
use twofold::integrate::roots::{Crossing, CrossingFinder, brent};
use twofold::integrate::{
    Dopri5, DriveOptions, Flow, Lsoda, Observer, Radau5, Schedule, Step, StepCap, Stepper, Taylor,
    Tolerance, drive,
};
use twofold::system::{Caricature, Smoothed, Transition};

/// Samples, minima and roots on every step, with nothing left out: version 0.1.0's search, and
/// beside the step's ends, too.
fn whole_search(step: &Step<'_, 3>, g: impl Fn(&nalgebra::SVector<f64, 3>) -> f64) -> Vec<f64> {
    let n = step.interpolant.degree() + 2;
    let value = |theta: f64| g(&step.at(theta));
    let mut found = Vec::new();
    let samples: Vec<(f64, f64)> =
        (0..=n).map(|i| i as f64 / n as f64).map(|s| (s, value(s))).collect();
    let mut refined: Vec<(f64, f64)> = Vec::with_capacity(samples.len() + 2);
    // A function that falls from an end towards its neighbour, and is larger there, has its least
    // value between.
    let beside = |(s0, g0): (f64, f64), (s1, g1): (f64, f64)| {
        let falls = (g0 > 0.0) == (g1 > 0.0)
            && g0.abs() <= g1.abs()
            && value(s0 + 1e-6 * (s1 - s0)).abs() < g0.abs();
        let (s, v) =
            if falls { smallest(&value, s0.min(s1), s0.max(s1), g0.signum()) } else { (s0, g0) };
        ((v > 0.0) != (g0 > 0.0)).then_some((s, v))
    };
    refined.push(samples[0]);
    refined.extend(beside(samples[0], samples[1]));
    for w in 1..samples.len() {
        let (s1, g1) = samples[w];
        if w == n {
            refined.extend(beside(samples[n], samples[n - 1]));
        }
        if w + 1 < samples.len() {
            let ((s0, g0), (s2, g2)) = (samples[w - 1], samples[w + 1]);
            let same = (g0 > 0.0) == (g1 > 0.0) && (g1 > 0.0) == (g2 > 0.0);
            if same && g1.abs() <= g0.abs() && g1.abs() <= g2.abs() {
                let (s, v) = smallest(&value, s0, s2, g1.signum());
                if (v > 0.0) != (g1 > 0.0) {
                    if s < s1 {
                        refined.extend([(s, v), (s1, g1)]);
                    } else {
                        refined.extend([(s1, g1), (s, v)]);
                    }
                    continue;
                }
            }
        }
        refined.push((s1, g1));
    }
    for pair in refined.windows(2) {
        let ((a, fa), (b, fb)) = (pair[0], pair[1]);
        if fb == 0.0 && fa != 0.0 {
            found.push(b);
        } else if fa != 0.0 && (fa > 0.0) != (fb > 0.0) {
            found.push(brent(value, a, b, fa, fb));
        }
    }
    found
}

fn smallest(f: &impl Fn(f64) -> f64, mut a: f64, mut b: f64, sign: f64) -> (f64, f64) {
    const INVERSE_GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (mut c, mut d) = (b - INVERSE_GOLDEN * (b - a), a + INVERSE_GOLDEN * (b - a));
    let (mut fc, mut fd) = (sign * f(c), sign * f(d));
    for _ in 0..60 {
        if fc < 0.0 || fd < 0.0 {
            break;
        }
        if fc < fd {
            (b, d, fd) = (d, c, fc);
            c = b - INVERSE_GOLDEN * (b - a);
            fc = sign * f(c);
        } else {
            (a, c, fc) = (c, d, fd);
            d = a + INVERSE_GOLDEN * (b - a);
            fd = sign * f(d);
        }
    }
    if fc < fd { (c, sign * fc) } else { (d, sign * fd) }
}

/// Compares on every step, for several planes, and counts.
struct Compared {
    planes: Vec<(usize, f64, CrossingFinder)>,
    steps: u64,
    passages: u64,
    /// Steps with more than one crossing of a plane.
    several: u64,
    /// Steps, by planes, that the bound alone decided.
    decided: u64,
}

impl Observer<3> for Compared {
    fn step(&mut self, step: &Step<'_, 3>) -> Flow {
        self.steps += 1;
        for (coordinate, value, passages) in &mut self.planes {
            let (c, v) = (*coordinate, *value);
            let (h0, h1) = (step.x0[c] - v, step.x1[c] - v);
            let found = passages.through_plane(step, c, v);
            if h0 == 0.0 || h1 == 0.0 {
                continue; // the rule for a step that begins or ends on the plane is another one now
            }
            let thetas: Vec<u64> = found.iter().map(|p: &Crossing| p.theta.to_bits()).collect();
            let all: Vec<u64> =
                whole_search(step, |x| x[c] - v).iter().map(|t| t.to_bits()).collect();
            assert_eq!(
                thetas, all,
                "t {} to {}, plane {c} = {v}: {} to {}",
                step.t0, step.t1, step.x0, step.x1
            );
            // Senses alternate, beginning from the side of the step's start and ending on that of
            // its end.
            assert!(
                found.iter().enumerate().all(|(i, p)| p.upward == ((h0 < 0.0) == (i % 2 == 0))),
                "{found:?}"
            );
            assert_eq!((h0 < 0.0) != (h1 < 0.0), found.len() % 2 == 1);
            // The bound holds where it was asked for.
            let reach = step.interpolant.reach(c);
            let (low, high) = (step.x0[c].min(step.x1[c]), step.x0[c].max(step.x1[c]));
            for i in 1..20 {
                let x = step.at(f64::from(i) / 20.0)[c];
                assert!(
                    x >= low - reach * 1.000_001 - 1e-13 && x <= high + reach * 1.000_001 + 1e-13,
                    "{x} {low} {high} {reach}"
                );
            }
            self.decided += u64::from(found.is_empty() && h0.abs().min(h1.abs()) > reach);
            self.passages += found.len() as u64;
            self.several += u64::from(found.len() > 1);
        }
        Flow::Continue
    }
}

fn compare<M: Stepper<3>>(name: &str, mut stepper: M, t_end: f64) {
    for alpha in [1e-3, 1e-1] {
        let field = Smoothed {
            system: Caricature::with_reinjection(alpha, 1e-5),
            transition: Transition::Tanh,
            eps: 1e-3,
        };
        let planes =
            [(1, 0.0), (0, 0.0), (2, 0.0), (0, 0.3), (1, -0.7), (2, 0.05), (0, 1e-3), (1, 1.0)]
                .map(|(c, v)| (c, v, CrossingFinder::default()));
        let mut compared =
            Compared { planes: planes.into(), steps: 0, passages: 0, several: 0, decided: 0 };
        let options = DriveOptions {
            t_end,
            schedule: Schedule { restart_every: Some(20.0), kick: None },
            step_cap: StepCap::FractionOfSegment(0.1),
            max_steps: u64::MAX,
            kicked_states: 3,
        };
        let _ =
            drive(&field, Vector3::new(0.2, 0.0, -1.0), &options, &mut stepper, &mut compared, &())
                .unwrap();
        let Compared { steps, passages, several, decided, .. } = compared;
        println!(
            "{name} alpha {alpha}: {steps} steps, {passages} passages, {several} steps with \
                several, {decided} of {} decided by the bound",
            8 * steps
        );
        assert!(passages > 50);
        // The point of the bound: it decides most.
        assert!(decided * 10 > 8 * steps * 5, "{decided} of {}", 8 * steps);
    }
}

const TOLERANCE: Tolerance = Tolerance { rtol: 1.0536712e-8, atol: 1.0536712e-8 };

#[test]
fn dopri5() {
    compare("dopri5", Dopri5::new(TOLERANCE), 600.0);
    // Long steps: several crossings in one are not rare.
    compare("dopri5, loose", Dopri5::new(Tolerance { rtol: 1e-3, atol: 1e-3 }), 600.0);
}

#[test]
fn lsoda() {
    compare("lsoda", Lsoda::new(TOLERANCE), 600.0);
}

#[test]
fn radau5() {
    compare("radau5", Radau5::new(TOLERANCE), 200.0);
}

#[test]
fn taylor() {
    compare("taylor", Taylor::new(Tolerance { rtol: 1e-13, atol: 1e-13 }), 60.0);
}
