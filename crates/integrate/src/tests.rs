//! Short runs by every method, bit for bit as they were when the tables of the paper's figures were
//! computed: each step's ends, its interpolant, and what was counted. A change of any of these
//! numbers is a change of the figures' hashes, found in a second instead of an hour.
//!
//! Beside the frozen numbers each step is held against what an [`Interpolant`] promises, so that
//! what is frozen makes sense.

use std::fmt::Write;
use std::ops::ControlFlow;

use nalgebra::{SVector, Vector2, Vector3, Vector4};

use super::ensemble::{
    Common, EnsembleRun, InstructionSet, SectionPlane, Tolerances, ensemble_watched,
};
use super::filippov::{
    AllModes, ExitRule, FilippovObserver, FilippovOptions, FunnelGrid, Mode, ModeEvent, Side,
    SlidingFlow, SlidingLaw, connect, funnel, history, run, run_two_surfaces,
};
use super::roots::CrossingFinder;
use super::*;
use twofold_num::{Elementary, MultiFloat};
use twofold_system::{
    Bound, Caricature, Hysteretic, Relaxation, Smoothed, System, Transition, VectorField,
};

/// A digest of numbers and words: 64-bit FNV-1a (Fowler, Noll & Vo).
#[derive(Clone, Debug)]
struct Digest(u64);

impl Digest {
    fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
    fn bytes(&mut self, bytes: &[u8]) {
        for b in bytes {
            self.0 = (self.0 ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    fn numbers<'a>(&mut self, numbers: impl IntoIterator<Item = &'a f64>) {
        numbers.into_iter().for_each(|v| self.bytes(&v.to_bits().to_le_bytes()));
    }
}

impl Write for Digest {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.bytes(text.as_bytes());
        Ok(())
    }
}

/// Sees all of every step.
#[derive(Clone, Debug)]
struct Seen<const N: usize> {
    digest: Digest,
    steps: u64,
    passages: Vec<CrossingFinder>,
    passed: usize,
}

impl<const N: usize> Seen<N> {
    fn new() -> Self {
        Self {
            digest: Digest::new(),
            steps: 0,
            passages: vec![CrossingFinder::default(); 2],
            passed: 0,
        }
    }

    /// Summary of a run in one line: its end, its steps, the crossings of a plane, the digest of
    /// everything.
    fn line<E: std::fmt::Debug>(mut self, name: &str, end: &E) -> String {
        write!(self.digest, "{end:?}").unwrap();
        format!("{name}: {} steps, {} passages, {:016x}", self.steps, self.passed, self.digest.0)
    }
}

impl<const N: usize> Observer<N> for Seen<N> {
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        self.steps += 1;
        self.digest.numbers([&step.t0, &step.t1]);
        self.digest.numbers(&step.x0);
        self.digest.numbers(&step.x1);
        write!(self.digest, "{}", step.interpolant.degree()).unwrap();
        for i in 0..N {
            let reach = step.interpolant.reach(i);
            let (low, high) = (step.x0[i].min(step.x1[i]), step.x0[i].max(step.x1[i]));
            let mut last = step.x0[i];
            let (grows, monotone) = (step.x1[i] > step.x0[i], step.interpolant.is_monotone(i));
            for theta in [0.0, 0.21875, 0.5, 0.8125, 1.0] {
                let x = step.interpolant.at(theta)[i];
                assert_eq!(
                    x.to_bits(),
                    step.interpolant.coordinate(theta, i).to_bits(),
                    "{i} at {theta}"
                );
                let slack = 1e-6 * (1.0 + x.abs());
                assert!(
                    x >= low - reach - slack && x <= high + reach + slack,
                    "{x} {low} {high} {reach}"
                );
                let slack = 1e-12 * (1.0 + x.abs());
                assert!(
                    !monotone || if grows { x >= last - slack } else { x <= last + slack },
                    "{x} after {last}"
                );
                last = x;
                self.digest.numbers([&x]);
            }
            self.digest.numbers([&reach]);
            write!(self.digest, "{monotone}").unwrap();
        }
        // A plane through the middle of the layer, and one far from it; and as any surface, to the
        // same bits.
        for (passages, (coordinate, value)) in self.passages.iter_mut().zip([(0, 1e-3), (1, 0.125)])
        {
            let mut as_surface = *passages;
            let found = passages.through_plane(step, coordinate, value);
            if !step.interpolant.is_monotone(coordinate) {
                let other = as_surface.in_step(step, |x| x[coordinate] - value);
                assert_eq!(format!("{found:?} {passages:?}"), format!("{other:?} {as_surface:?}"));
            }
            for passage in found {
                self.passed += 1;
                self.digest.numbers([
                    &passage.theta,
                    &step.time(passage.theta),
                    &f64::from(u8::from(passage.upward)),
                ]);
                self.digest.numbers(&step.at(passage.theta));
            }
        }
        Flow::Continue
    }
    fn kick(&mut self, t: f64, before: &SVector<f64, N>, after: &SVector<f64, N>) {
        self.digest.numbers([&t]);
        self.digest.numbers(before);
        self.digest.numbers(after);
    }
}

impl<const N: usize> FilippovObserver<N> for Seen<N> {
    fn step(&mut self, mode: Mode, step: &Step<'_, N>) -> Flow {
        self.digest.bytes(&[mode as u8]);
        // Events are what a Filippov run passes, and its interpolants are dear.
        self.passages.clear();
        AllModes(self).step(mode, step)
    }
    fn event(&mut self, event: &ModeEvent<N>) -> Flow {
        write!(self.digest, "{event:?}").unwrap();
        Flow::Continue
    }
}

/// Lines against what they were.
fn hold(found: &[String], frozen: &str) {
    let frozen: Vec<&str> = frozen.lines().map(str::trim).filter(|l| !l.is_empty()).collect();
    assert_eq!(found, frozen, "now:\n{}", found.join("\n"));
}

fn tolerance(size: f64) -> Tolerance {
    Tolerance { rtol: size, atol: size }
}

fn follow<F: VectorField<N>, const N: usize>(
    name: &str,
    field: &F,
    x0: SVector<f64, N>,
    options: &DriveOptions,
    mut method: impl Stepper<N>,
) -> String {
    let mut seen = Seen::new();
    let end = drive(field, x0, options, &mut method, &mut seen, &());
    assert!(end.as_ref().is_ok_and(|e| e.statistics.steps == seen.steps) || end.is_err());
    let statistics = method.statistics().clone();
    seen.line(name, &(end, statistics))
}

/// Fields in the plane.
enum Planar {
    /// Van der Pol's oscillator with this stiffness.
    VanDerPol(f64),
    /// x' = x^2, y' = 1: leaves the numbers.
    Explosion,
    /// Prothero & Robinson (1974) with this stiffness, time as a state.
    Decay(f64),
    /// x' = sqrt(1 - x^2) y, y' = 1: outside the unit interval it is no number.
    Root,
}

impl VectorField<2> for Planar {
    fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        match self {
            Planar::VanDerPol(mu) => {
                Vector2::new(x[1], ((S::one() - x[0] * x[0]) * x[1]).scale(*mu) - x[0])
            }
            Planar::Explosion => Vector2::new(x[0] * x[0], S::one()),
            Planar::Decay(lambda) => {
                Vector2::new((x[1].cos() - x[0]).scale(*lambda) - x[1].sin(), S::one())
            }
            Planar::Root => Vector2::new((S::one() - x[0] * x[0]).sqrt() * x[1], S::one()),
        }
    }
}

/// Fields in space.
enum Spatial {
    Smooth(Smoothed<Caricature>),
    /// Turns in x, y and drifts in z by a smoothed switch on the circle of radius 1: the layer's
    /// variable is no sum of states.
    Circle,
    /// Two layers, both sums of states.
    Crossed,
    /// A quotient.
    Quotient,
}

impl VectorField<3> for Spatial {
    fn eval<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        let c = S::from_f64;
        let phi = || ((x[0].squared() + x[1].squared() - c(1.0)) / c(1e-2)).tanh();
        match self {
            Spatial::Smooth(field) => field.eval(x),
            Spatial::Circle => {
                Vector3::new(x[1].scale(2.0) + c(0.1), -x[0], phi() - x[2].scale(0.5))
            }
            Spatial::Crossed => {
                let (a, b) =
                    ((x[0] / c(1e-2)).tanh(), ((x[1] + x[0].scale(0.25)) / c(1e-2)).tanh());
                Vector3::new(-b + x[2].scale(0.1), a - x[2].scale(0.2), a * b - x[2].scale(0.5))
            }
            Spatial::Quotient => Vector3::new(x[1], -x[0], phi() / (c(2.0) + x[2])),
        }
    }
}

fn caricature(transition: Transition, eps: f64) -> Spatial {
    Spatial::Smooth(Smoothed { system: Caricature::with_reinjection(1e-1, 1e-4), transition, eps })
}

fn kicked(law: KickLaw, every: f64) -> Schedule {
    Schedule {
        restart_every: Some(0.7),
        kick: Some(Kick { every, size: 1e-3, law, seed: 11, stream: 2 }),
    }
}

const START: [f64; 3] = [0.2, 0.0, -1.0];

/// Every options for a method in space: `t_end` is the length of a plain run, `part` of those with
/// a schedule.
fn in_space<M: Stepper<3>>(method: impl Fn(f64) -> M, t_end: f64, part: f64) -> Vec<String> {
    let smooth = caricature(Transition::Tanh, 1e-3);
    let options = |schedule, step_cap, kicked_states| DriveOptions {
        schedule,
        step_cap,
        kicked_states,
        ..DriveOptions::to(part)
    };
    let never = Schedule::default();
    let go = |name: &str, field: &Spatial, options: &DriveOptions, size: f64| {
        follow(name, field, START.into(), options, method(size))
    };
    vec![
        go("plain", &smooth, &DriveOptions::to(t_end), 1e-8),
        go("coarse", &smooth, &DriveOptions::to(t_end), 1e-5),
        go("fine", &smooth, &DriveOptions::to(part), 1e-11),
        go("sphere", &smooth, &options(kicked(KickLaw::Sphere, 0.3), StepCap::None, 3), 1e-7),
        go(
            "cube",
            &smooth,
            &options(kicked(KickLaw::Cube, 0.35), StepCap::FractionOfSegment(0.1), 2),
            1e-7,
        ),
        go(
            "normal",
            &smooth,
            &options(kicked(KickLaw::Normal, 0.9), StepCap::Absolute(0.05), 1),
            1e-7,
        ),
        go(
            "circle of two",
            &smooth,
            &options(kicked(KickLaw::Sphere, 0.3), StepCap::None, 2),
            1e-6,
        ),
        go("cap", &smooth, &options(never, StepCap::Absolute(0.02), 3), 1e-6),
        go("few", &smooth, &DriveOptions { max_steps: 20, ..DriveOptions::to(t_end) }, 1e-8),
        go("wide layer", &caricature(Transition::Tanh, 0.1), &DriveOptions::to(part), 1e-8),
        go("circle", &Spatial::Circle, &DriveOptions::to(part), 1e-9),
        go("crossed", &Spatial::Crossed, &DriveOptions::to(part), 1e-9),
        go("crossed, coarse", &Spatial::Crossed, &DriveOptions::to(t_end), 1e-5),
    ]
}

/// Every options for a method in the plane.
fn in_the_plane<M: Stepper<2>>(method: impl Fn(f64) -> M, stiff: f64) -> Vec<String> {
    let go = |name: &str, field: Planar, x0: [f64; 2], t_end: f64, size: f64| {
        // At the root's edge a method creeps.
        let options = DriveOptions {
            max_steps: if matches!(field, Planar::Root) { 200 } else { 5000 },
            ..DriveOptions::to(t_end)
        };
        follow(name, &field, x0.into(), &options, method(size))
    };
    vec![
        go("van der Pol", Planar::VanDerPol(1.0), [2.0, 0.0], 8.0, 1e-9),
        go("van der Pol, coarse", Planar::VanDerPol(5.0), [2.0, 0.0], 12.0, 1e-3),
        go("van der Pol, stiff", Planar::VanDerPol(stiff), [2.0, 0.0], 2.0 * stiff, 1e-6),
        go("decay", Planar::Decay(stiff * stiff), [2.0, 0.0], 3.0, 1e-6),
        go("at rest", Planar::VanDerPol(1.0), [0.0, 0.0], 1.0, 1e-6),
        go("nearly at rest", Planar::VanDerPol(1.0), [1e-9, 0.0], 30.0, 1e-6),
        go("explosion", Planar::Explosion, [1.0, 0.0], 2.0, 1e-7),
        go("root", Planar::Root, [0.9, 0.1], 3.0, 1e-7),
        go("no number", Planar::Root, [2.0, 0.1], 3.0, 1e-7),
    ]
}

#[test]
fn dopri5() {
    let mut found = in_space(|size| Dopri5::new(tolerance(size)), 5.0, 1.5);
    found.extend(in_the_plane(|size| Dopri5::new(tolerance(size)), 20.0));
    hold(&found, DOPRI5);
}

#[test]
fn lsoda() {
    let mut found = in_space(|size| Lsoda::new(tolerance(size)), 14.0, 4.0);
    found.extend(in_the_plane(|size| Lsoda::new(tolerance(size)), 50.0));
    let relative = Tolerance { rtol: 0.0, atol: 1e-7 };
    let start = Vector2::new(2.0, 0.0);
    found.push(follow(
        "absolute",
        &Planar::VanDerPol(1.0),
        start,
        &DriveOptions::to(8.0),
        Lsoda::new(relative),
    ));
    hold(&found, LSODA);
}

#[test]
fn radau5() {
    let mut found = in_space(|size| Radau5::new(tolerance(size)), 14.0, 3.0);
    found.extend(in_the_plane(|size| Radau5::new(tolerance(size)), 50.0));
    hold(&found, RADAU5);
}

#[test]
fn taylor() {
    let mut found = in_space(|size| Taylor::<3>::new(tolerance(size)), 4.0, 1.0);
    found.extend(in_the_plane(|size| Taylor::<2>::new(tolerance(size)), 20.0));
    hold(&found, TAYLOR);
}

#[test]
fn taylor_extended() {
    let smooth = caricature(Transition::Tanh, 1e-2);
    let options = DriveOptions { schedule: kicked(KickLaw::Cube, 0.25), ..DriveOptions::to(0.6) };
    let mut found = Vec::new();
    for (name, field, options) in [
        ("plain", &smooth, &DriveOptions::to(1.0)),
        ("cube", &smooth, &options),
        ("circle", &Spatial::Circle, &DriveOptions::to(0.4)),
    ] {
        found.push(follow(
            name,
            field,
            START.into(),
            options,
            Taylor::<3, _>::extended(tolerance(1e-24)),
        ));
        found.push(follow(
            name,
            field,
            START.into(),
            options,
            Taylor::<3, _>::extended(tolerance(1e-20)).with_decimal_constants(),
        ));
        found.push(follow(
            name,
            field,
            START.into(),
            options,
            Taylor::<3, _>::extended(tolerance(1e-16)).with_order(12),
        ));
        found.push(follow(
            name,
            field,
            START.into(),
            options,
            Taylor::<3, MultiFloat<3>>::multi(tolerance(1e-30)),
        ));
    }
    hold(&found, TAYLOR_EXTENDED);
}

#[test]
fn layered() {
    let mut found = in_space(|size| Layered::new(tolerance(size)), 14.0, 4.0);
    for (name, start) in [
        ("in the layer", [0.0, 0.9, -0.8]),
        ("above", [4e-3, -0.9, 0.8]),
        ("below", [-11e-3, -0.9, 0.8]),
        ("turning", [1e-3, 0.5, -0.3]),
        ("sliding", [0.0, 0.4, 0.7]),
        ("landing", [-30e-3, 0.4, 0.7]),
        ("leaving", [0.0, -0.4, -0.7]),
        ("grazing", [0.02, 0.2, 0.9]),
    ] {
        let field = caricature(Transition::Tanh, 1e-3);
        found.push(follow(
            name,
            &field,
            start.into(),
            &DriveOptions::to(1.0),
            Layered::new(tolerance(1e-10)),
        ));
        let field = Spatial::Smooth(Smoothed {
            system: Caricature::with_reinjection(1e-3, 1e-5),
            transition: Transition::Tanh,
            eps: 2e-2,
        });
        found.push(follow(
            name,
            &field,
            start.into(),
            &DriveOptions::to(1.5),
            Layered::new(tolerance(1e-7)),
        ));
    }
    for field in [
        Spatial::Quotient,
        caricature(Transition::Arctan, 1e-3),
        caricature(Transition::PerturbedTanh { sigma: 0.1 }, 1e-3),
    ] {
        found.push(follow(
            "refused",
            &field,
            START.into(),
            &DriveOptions::to(1.0),
            Layered::new(tolerance(1e-8)),
        ));
    }
    hold(&found, LAYERED);
}

#[test]
fn hysteretic() {
    let mut found = Vec::new();
    for relaxation in [Relaxation::Literal, Relaxation::Single] {
        let field = Hysteretic {
            system: Caricature::with_reinjection(1e-1, 1e-4),
            eps: 5e-2,
            eps_prime: 5e-2,
            relaxation,
        };
        let options =
            DriveOptions { schedule: kicked(KickLaw::Sphere, 0.3), ..DriveOptions::to(3.0) };
        let start = Vector4::new(0.2, 0.0, -1.0, 1.0);
        for (name, options) in [("plain", &DriveOptions::to(3.0)), ("kicked", &options)] {
            found.push(follow(name, &field, start, options, Lsoda::new(tolerance(1e-8))));
            found.push(follow(name, &field, start, options, Dopri5::new(tolerance(1e-6))));
            found.push(follow(name, &field, start, options, Radau5::new(tolerance(1e-6))));
            found.push(follow(name, &field, start, options, Layered::new(tolerance(1e-7))));
        }
    }
    hold(&found, HYSTERETIC);
}

/// A built-in system with these parameters.
fn builtin<const N: usize>(name: &str, parameters: &[(&str, f64)]) -> Bound<N> {
    let values = parameters.iter().map(|(name, value)| (*name, (*value).into()));
    System::builtin(name).unwrap().with_all(values).unwrap().bind().unwrap()
}

#[test]
fn filippov_in_space() {
    let mut found = Vec::new();
    let side = Side::Minus;
    let random = |seed| ExitRule::Random {
        law: if seed == 1 {
            SlidingLaw::Exponential { mean: 0.5 }
        } else {
            SlidingLaw::Uniform { longest: 1.2 }
        },
        plus_probability: 0.4,
        seed,
        stream: 3,
    };
    let usual = FilippovOptions { max_events: 60, max_steps: 2000, ..FilippovOptions::default() };
    let mut go = |name: &str,
                  system: &Bound<3>,
                  x0: [f64; 3],
                  t_end: f64,
                  rule: ExitRule,
                  settings: &FilippovOptions| {
        let mut seen = Seen::new();
        let end = run(system, x0.into(), t_end, settings, rule, &mut seen);
        found.push(seen.line(name, &end));
    };
    let caricature = builtin("caricature", &[("alpha", 0.1), ("beta", 1e-5)]);
    go("all", &caricature, START, 50.0, ExitRule::All, &usual);
    go("random", &caricature, START, 60.0, random(1), &usual);
    go("uniform", &caricature, START, 40.0, random(2), &FilippovOptions { max_step: 0.2, ..usual });
    let coarse =
        FilippovOptions { tolerance: tolerance(1e-7), leg: 1e-3, departure: 1e-2, ..usual };
    go("coarse", &caricature, START, 60.0, ExitRule::AfterArc { arc: 0.4, side }, &coarse);
    go("at once", &caricature, START, 60.0, ExitRule::AtOnce { side }, &coarse);
    go(
        "few events",
        &caricature,
        START,
        60.0,
        random(1),
        &FilippovOptions { max_events: 4, ..usual },
    );
    go(
        "few steps",
        &caricature,
        START,
        60.0,
        random(1),
        &FilippovOptions { max_steps: 40, ..usual },
    );
    go("on the surface", &caricature, [0.0, 0.3, 0.5], 3.0, random(1), &usual);
    go("in the repelling region", &caricature, [0.0, -0.3, -0.5], 3.0, random(1), &usual);
    go("no number", &caricature, [f64::NAN, 0.3, 0.5], 3.0, random(1), &usual);
    go("backwards", &caricature, START, 0.0, random(1), &usual);
    let wheel = builtin("wheel", &[]);
    go("wheel", &wheel, [0.69267, 0.0, 0.0], 12.0, random(1), &usual);
    for (plus, minus) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
        for (v, w) in [(0.0, 0.0), (-1.2, -1.4), (0.5, -0.7), (-0.3, 0.4)] {
            let fold = builtin(
                "two-fold",
                &[("plus_fold", plus), ("minus_fold", minus), ("v", v), ("w", w)],
            );
            for start in [
                [0.0, 0.3, 0.8],
                [0.0, -0.7, 0.2],
                [0.0, -0.6, -0.25],
                [0.25, -0.5, -0.5],
                [-0.4, 0.5, -0.5],
            ] {
                for rule in [
                    ExitRule::AfterTime { time: 0.3, side },
                    ExitRule::AtOnce { side: Side::Plus },
                    ExitRule::AfterArc { arc: 0.2, side },
                ] {
                    go("fold", &fold, start, 1.5, rule, &coarse);
                }
            }
            go(
                "at the two-fold",
                &fold,
                [0.0; 3],
                2.0,
                ExitRule::AfterTime { time: 0.4, side },
                &coarse,
            );
            go("at the two-fold", &fold, [0.0; 3], 2.0, ExitRule::AtOnce { side }, &coarse);
            go(
                "at the two-fold",
                &fold,
                [0.0; 3],
                0.1,
                ExitRule::AfterArc { arc: 0.5, side },
                &coarse,
            );
        }
    }
    // Their lines are many: one digest for all, the names and numbers of steps for the first.
    let mut all = Digest::new();
    all.bytes(found.join("\n").as_bytes());
    found.truncate(12);
    found.push(format!("all: {:016x}", all.0));
    hold(&found, FILIPPOV_IN_SPACE);
}

#[test]
fn filippov_families() {
    let caricature: Bound<3> = builtin("caricature", &[("alpha", 0.1), ("beta", 1e-5)]);
    let settings = FilippovOptions { tolerance: tolerance(1e-9), ..FilippovOptions::default() };
    let line = |name: &str, what: &dyn std::fmt::Debug| {
        let mut digest = Digest::new();
        write!(digest, "{what:?}").unwrap();
        format!("{name}: {:016x}", digest.0)
    };
    let mut found = Vec::new();
    for (times, until_two_fold, start) in
        [(3, true, START), (1, false, START), (2, false, [0.0, -0.3, -0.5])]
    {
        let grid = FunnelGrid {
            shortest: 0.05,
            longest: 1.5,
            times,
            horizon: 12.0,
            until_two_fold,
            per_step: 2,
        };
        let family = funnel(&caricature, start.into(), 50.0, &settings, &grid).unwrap();
        found.push(line("funnel", &family));
        let other = FunnelGrid { shortest: 0.1, times: 2, horizon: 3.0, ..grid };
        let members = family.members_on(&caricature, &settings, &other, Some(Side::Minus)).unwrap();
        assert_eq!(members.len(), 2);
        found.push(line("members", &members));
    }
    let grid = FunnelGrid {
        shortest: 0.05,
        longest: 1.5,
        times: 2,
        horizon: 2.0,
        until_two_fold: true,
        per_step: 1,
    };
    found.push(line(
        "no funnel",
        &funnel(&caricature, START.into(), 3.0, &settings, &grid).unwrap_err(),
    ));
    for x in [[0.0, -0.3, -0.8], [1e-3, -0.9, -0.05], [0.0, 0.5, 0.5]] {
        found.push(line("history", &history(&caricature, x.into(), 40.0, &settings, 3)));
    }
    found.push(line(
        "short history",
        &history(&caricature, Vector3::new(0.0, -0.9, -0.9), 0.1, &settings, 3),
    ));
    for b in [[0.3, 0.4, -0.6], [-0.2, 0.5, 0.1], [0.0, 0.3, 0.3]] {
        found.push(line(
            "connect",
            &connect(&caricature, START.into(), b.into(), 100.0, &settings, 2),
        ));
        found.push(line(
            "too short",
            &connect(&caricature, START.into(), b.into(), 5.0, &settings, 2),
        ));
    }
    hold(&found, FILIPPOV_FAMILIES);
}

#[test]
fn filippov_in_the_plane() {
    let mut found = Vec::new();
    let stay = ExitRule::AfterTime { time: 1e9, side: Side::Plus };
    for (name, parameters, x0, t_end) in [
        (
            "stick-slip",
            &[("belt", 0.3), ("friction", 1.0), ("weakening", 0.2)][..],
            [0.0, 0.0],
            20.0,
        ),
        ("relay-linear", &[("gain", 1.0)], [0.5, 0.0], 4.0),
        ("relay-parabolic", &[("gain", 2.0)], [2.0, 0.0], 10.0),
        ("relay-parabolic", &[("gain", 0.5)], [2.0, 0.0], 100.0),
        ("relay-parabolic", &[("gain", 1.0)], [2.0, 0.0], 9.0),
        ("fused-focus", &[], [0.3, 0.2], 6.0),
    ] {
        for size in [1e-12, 1e-6] {
            let settings = FilippovOptions {
                tolerance: tolerance(size),
                max_events: 60,
                max_steps: 2000,
                ..FilippovOptions::default()
            };
            let system: Bound<2> = builtin(name, parameters);
            let mut seen = Seen::new();
            let end = run(&system, x0.into(), t_end, &settings, stay, &mut seen);
            found.push(seen.line(name, &end));
        }
    }
    two_surfaces::<2, 3>(
        "relay-square",
        [[2.0, 0.7], [-1.0, 3.0], [0.0, 2.0], [1.0, 0.0]],
        &mut found,
    );
    two_surfaces::<4, 5>(
        "two-blocks",
        [[0.0, 0.1, 1.0, 0.5], [0.0; 4], [0.5, -0.3, 0.0, 0.2]],
        &mut found,
    );
    hold(&found, FILIPPOV_IN_THE_PLANE);
}

fn two_surfaces<const N: usize, const M: usize>(
    name: &str,
    starts: impl IntoIterator<Item = [f64; N]>,
    found: &mut Vec<String>,
) where
    for<'a> SlidingFlow<'a, Bound<N>, N>: VectorField<M>,
{
    let faces = System::builtin(name).unwrap().faces().unwrap();
    let faces = faces.map(|pair| pair.map(|face| face.bind::<N>().unwrap()));
    let settings =
        FilippovOptions { max_events: 60, max_steps: 2000, ..FilippovOptions::default() };
    for x0 in starts {
        for side in [Side::Plus, Side::Minus] {
            let mut seen = Seen::new();
            let rule = ExitRule::AfterTime { time: 0.2, side };
            let end = run_two_surfaces(&faces, x0.into(), 8.0, &settings, rule, &mut seen, &());
            found.push(seen.line(name, &end));
        }
    }
}

#[test]
fn a_layered_series_has_the_degree_that_the_tolerance_asks_for() {
    let degree = |rtol: f64, atol: f64| {
        Layered::<1>::new(Tolerance { rtol, atol }).statistics().highest_order
    };
    // -0.85 ln of the smaller tolerance, which is taken between a sixteenth of the spacing of
    // numbers and 1e-2; at least 8, at most what a series holds.
    assert_eq!([degree(1e-8, 1.0), degree(1.0, 1e-8), degree(1e-12, 1e-3)], [16, 16, 24]);
    assert_eq!(
        [degree(1.0, 1.0), degree(1e-2, 1e-2), degree(1e-17, 1.0), degree(0.0, 0.0)],
        [8, 8, 31, 31]
    );
}

#[test]
fn a_crossing_that_a_cap_interrupts_is_the_same_crossing() {
    let field = caricature(Transition::Tanh, 1e-3);
    let end = |cap| {
        let options = DriveOptions { step_cap: cap, ..DriveOptions::to(3.0) };
        drive(&field, START.into(), &options, &mut Layered::new(tolerance(1e-10)), &mut Ignore, &())
            .unwrap()
    };
    let (whole, pieces) = (end(StepCap::None), end(StepCap::Absolute(3e-4)));
    assert!(pieces.statistics.steps > 20 * whole.statistics.steps);
    assert!((pieces.x - whole.x).amax() < 1e-8, "{} {}", pieces.x, whole.x);
}

/// x'' = -x with time as a state; notes the latest time that it is asked about.
struct Clocked(std::sync::atomic::AtomicU64);

impl VectorField<3> for Clocked {
    fn eval<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        // Times are not negative, so that their bits have their order. Of a number with more to it
        // (a derivative) the value is unknown here.
        if let Some(t) = (&x[2] as &dyn std::any::Any).downcast_ref::<f64>() {
            self.0.fetch_max(t.to_bits(), std::sync::atomic::Ordering::Relaxed);
        }
        Vector3::new(x[1], -x[0], S::one())
    }
}

/// The end of a run is a wall: the equation may not hold beyond it.
#[test]
fn nothing_is_asked_beyond_the_end() {
    fn latest(mut method: impl Stepper<3>, t0: f64, t_end: f64, cap: f64) -> f64 {
        let field = Clocked(Default::default());
        method.restart(&field, t0, Vector3::new(1.0, 0.5, t0), t_end, cap).unwrap();
        loop {
            let step = method.step(&field).unwrap();
            assert!(step.t1 <= t_end && step.length() <= cap * (1.0 + 1e-12));
            if step.t1 == t_end {
                break;
            }
        }
        f64::from_bits(field.0.into_inner())
    }
    for t0 in [0.0, 50.0] {
        for length in [1e-9, 1e-4, 0.3, 4.0] {
            for cap in [f64::INFINITY, 0.07] {
                let t_end = t0 + length;
                for latest in [
                    latest(Dopri5::new(tolerance(1e-4)), t0, t_end, cap),
                    latest(Lsoda::new(tolerance(1e-4)), t0, t_end, cap),
                    latest(Radau5::new(tolerance(1e-4)), t0, t_end, cap),
                ] {
                    let beyond = (latest - t_end) / (length + 1e-5 * t0);
                    assert!((-1e-6..1e-6).contains(&beyond), "{latest} from {t0} to {t_end}");
                }
            }
        }
    }
}

/// Equal steps to an end late in time leave a remainder of a last digit: the last step takes it.
#[test]
fn a_remainder_that_no_step_can_be_made_of_belongs_to_the_last_step() {
    fn ends(mut method: impl Stepper<3>, t0: f64, t_end: f64, cap: f64) {
        let field = caricature(Transition::Tanh, 1.0);
        method.restart(&field, t0, START.into(), t_end, cap).unwrap();
        while method.step(&field).unwrap().t1 < t_end {}
    }
    for i in 0..200 {
        let t0 = 194_106.0 + 0.618 * f64::from(i);
        let t_end = t0 + 2e-7 * (1.0 + f64::from(i % 17));
        let cap = (t_end - t0) / 16.0;
        ends(Dopri5::new(tolerance(1e-6)), t0, t_end, cap);
        ends(Radau5::new(tolerance(1e-6)), t0, t_end, cap);
        ends(Lsoda::new(tolerance(1e-6)), t0, t_end, cap);
        ends(Taylor::<3>::new(tolerance(1e-6)), t0, t_end, cap);
        ends(Layered::new(tolerance(1e-6)), t0, t_end, cap);
    }
}

/// A lane tells of those steps, and of no others, of which a run alone cannot say by the
/// interpolant's reach that they miss the plane.
#[test]
fn lanes_tell_of_the_steps_that_may_meet_the_plane() {
    struct Heard(Vec<u64>);
    impl Observer<3> for Heard {
        fn step(&mut self, step: &Step<'_, 3>) -> Flow {
            self.0.push(step.t0.to_bits());
            Flow::Continue
        }
    }
    struct May(SectionPlane, Vec<u64>, u64);
    impl Observer<3> for May {
        fn step(&mut self, step: &Step<'_, 3>) -> Flow {
            let SectionPlane { coordinate, value } = self.0;
            let (h0, h1) = (step.x0[coordinate] - value, step.x1[coordinate] - value);
            let reach = step.interpolant.reach(coordinate);
            let margin = 1e-12 * (h0.abs() + h1.abs() + value.abs() + reach);
            let clear = h0 * h1 > 0.0 && h0.abs().min(h1.abs()) > reach + margin;
            self.2 += 1;
            if !clear {
                self.1.push(step.t0.to_bits());
            }
            Flow::Continue
        }
    }
    let field = Smoothed {
        system: Caricature::with_reinjection(1e-1, 1e-4),
        transition: Transition::Tanh,
        eps: 1e-1,
    };
    let runs: Vec<EnsembleRun<3>> = (0..8_u32)
        .map(|k| EnsembleRun {
            start: Vector3::new(0.1 + 0.05 * f64::from(k), 0.02, -1.0),
            options: DriveOptions::to(12.0),
        })
        .collect();
    let size = tolerance(1e-4);
    let (mut told, mut all) = (0, 0);
    for coordinate in 0..3 {
        for value in [-1.3, -0.6, -0.05, 0.0, 0.02, 0.3, 0.9, 1e13] {
            let plane = SectionPlane { coordinate, value };
            let wanted: Vec<_> = runs
                .iter()
                .map(|run| {
                    let mut may = May(plane, Vec::new(), 0);
                    let _ = drive(
                        &field,
                        run.start,
                        &run.options,
                        &mut Dopri5::new(size),
                        &mut may,
                        &(),
                    )
                    .unwrap();
                    all += may.2;
                    may.1
                })
                .collect();
            told += wanted.iter().map(Vec::len).sum::<usize>() as u64;
            for set in InstructionSet::ALL.into_iter().filter(|set| set.is_here()) {
                let found =
                    super::ensemble::ensemble_with(set, &field, &runs, size, Some(plane), |_| {
                        Heard(Vec::new())
                    });
                let found: Vec<_> = found.into_iter().map(|end| end.observer.0).collect();
                assert_eq!(found, wanted, "{plane:?}, {set:?}");
            }
        }
    }
    assert!(told > all / 50 && told < all / 2, "{told} of {all}");
}

/// Asks to stop at the first question.
struct Refuses;
impl Monitor for Refuses {
    fn reached(&self, _: f64) -> ControlFlow<()> {
        ControlFlow::Break(())
    }
}

#[test]
fn lanes_are_runs_alone() {
    let field = Smoothed {
        system: Caricature::with_reinjection(1e-1, 1e-4),
        transition: Transition::Tanh,
        eps: 1e-2,
    };
    let size = tolerance(1e-7);
    let mut runs: Vec<EnsembleRun<3>> = (0..13_u32)
        .map(|k| {
            let kick =
                Kick { every: 0.4, size: 1e-3, law: KickLaw::Sphere, seed: 7, stream: k.into() };
            let schedule = Schedule {
                restart_every: (k % 3 > 0).then_some(0.7),
                kick: (k % 5 == 4).then_some(kick),
            };
            let step_cap = [StepCap::None, StepCap::Absolute(0.1), StepCap::FractionOfSegment(0.1)]
                [k as usize % 3];
            let options = DriveOptions {
                schedule,
                step_cap,
                ..DriveOptions::to(0.5 + f64::from(k * 7 % 11) / 5.0)
            };
            EnsembleRun { start: Vector3::new(0.1 + 0.01 * f64::from(k), 0.0, -1.0), options }
        })
        .collect();
    let sizes: Vec<Tolerance> =
        (0..runs.len()).map(|i| tolerance([1e-7, 1e-4, 1e-9][i % 3])).collect();
    runs[5].start[0] = f64::NAN;
    runs[6].start[1] = 1e200;
    runs[7].options.t_end = 0.0;
    runs[8].options.max_steps = 20;
    // Beyond this corner from the start, after a while, or never.
    let corner = SVector::from([-10.0, 0.7, -10.0]);
    struct Stops(Option<SVector<f64, 3>>);
    impl Observer<3> for Stops {
        fn step(&mut self, step: &Step<'_, 3>) -> Flow {
            let beyond = self.0.is_some_and(|corner| (0..3).all(|i| step.x1[i] > corner[i]));
            if beyond { Flow::Stop } else { Flow::Continue }
        }
    }
    let word = |end: &Result<Summary<3>, Failure>| match end {
        Ok(s) => format!("{:?} {:?} {:?}", s, s.t.to_bits(), s.x.map(f64::to_bits)),
        Err(failure) => format!("{failure:?}"),
    };
    for (corner, plane) in [
        (None, None),
        (Some(corner), None),
        (None, Some(SectionPlane { coordinate: 1, value: 0.125 })),
    ] {
        // Every third run has none of its own.
        let corners = corner.map(|corner| {
            (0..runs.len())
                .map(|i| if i % 3 == 1 { SVector::repeat(f64::INFINITY) } else { corner })
                .collect::<Vec<_>>()
        });
        let alone: Vec<_> = runs
            .iter()
            .enumerate()
            .map(|(i, run)| {
                let mut stops = Stops(corners.as_ref().map(|corners| corners[i]));
                word(&drive(
                    &field,
                    run.start,
                    &run.options,
                    &mut Dopri5::new(sizes[i]),
                    &mut stops,
                    &(),
                ))
            })
            .collect();
        if corner.is_some() {
            assert!(
                alone.iter().any(|w| w.contains("Observer"))
                    && alone.iter().any(|w| w.contains("EndTime")),
                "{alone:?}"
            );
        }
        // Crossings of the plane are those of a run alone.
        struct Met(CrossingFinder, Vec<u64>);
        impl Observer<3> for Met {
            fn step(&mut self, step: &Step<'_, 3>) -> Flow {
                for passage in self.0.through_plane(step, 1, 0.125) {
                    self.1.extend([
                        step.time(passage.theta).to_bits(),
                        step.at(passage.theta)[0].to_bits(),
                    ]);
                }
                Flow::Continue
            }
            fn kick(&mut self, t: f64, before: &SVector<f64, 3>, after: &SVector<f64, 3>) {
                self.1.extend([t.to_bits(), before[0].to_bits(), after[0].to_bits()]);
            }
        }
        let met_alone: Vec<_> = runs
            .iter()
            .zip(&sizes)
            .map(|(run, size)| {
                let mut met = Met(CrossingFinder::default(), Vec::new());
                let _ =
                    drive(&field, run.start, &run.options, &mut Dopri5::new(*size), &mut met, &());
                met.1
            })
            .collect();
        for (set, times) in InstructionSet::ALL.iter().flat_map(|set| [(*set, 1), (*set, 6)]) {
            if !set.is_here() {
                continue;
            }
            // Once, and often enough for more registers at a time.
            let often = |i: usize| i % runs.len();
            let count = times * runs.len();
            let cycled: Vec<_> = (0..count).map(|i| runs[often(i)]).collect();
            let sizes: Vec<_> = (0..count).map(|i| sizes[often(i)]).collect();
            let corners: Option<Vec<_>> =
                corners.as_ref().map(|all| (0..count).map(|i| all[often(i)]).collect());
            let common = Common {
                tolerances: Tolerances::Each(&sizes),
                plane,
                corners: corners.as_deref(),
                carried: None,
                monitor: &(),
            };
            let mut ends = vec![None; count];
            ensemble_watched(
                set,
                &field,
                &cycled,
                common,
                |_| Met(CrossingFinder::default(), Vec::new()),
                &mut |i, end: ensemble::End<Met, 3>| {
                    assert!(
                        ends[i].replace((word(&end.summary), end.observer.1)).is_none(),
                        "run {i} ended twice"
                    );
                },
            );
            for (i, end) in ends.into_iter().enumerate() {
                let (found, met) = end.expect("every run ends");
                assert_eq!(found, alone[often(i)], "run {i} of {count}, {set:?}");
                if plane.is_some() {
                    assert_eq!(met, met_alone[often(i)], "run {i} of {count}, {set:?}");
                }
            }
            // A monitor that refuses ends the unfinished runs; it is first asked after a number of
            // steps.
            let mut finished = 0;
            let long = [EnsembleRun {
                start: START.into(),
                options: DriveOptions {
                    step_cap: StepCap::Absolute(1e-3),
                    ..DriveOptions::to(50.0)
                },
            }];
            let tolerances = Tolerances::All(size);
            let common =
                Common { tolerances, plane: None, corners: None, carried: None, monitor: &Refuses };
            ensemble_watched(set, &field, &long, common, |_| Ignore, &mut |_, _| finished += 1);
            assert_eq!(finished, 0, "{set:?}");
            ensemble_watched(set, &field, &runs[..3], common, |_| Ignore, &mut |_, _| {
                finished += 1
            });
            assert_eq!(finished, 3, "{set:?}");
        }
        assert!(met_alone.iter().filter(|m| !m.is_empty()).count() > 3, "{met_alone:?}");
    }
}

const DOPRI5: &str = "
    plain: 67 steps, 5 passages, 5a30826be0886206
    coarse: 23 steps, 5 passages, 78d77ec00405e855
    fine: 77 steps, 3 passages, 929c005511d2affd
    sphere: 34 steps, 3 passages, 3473e2b3c5389139
    cube: 63 steps, 3 passages, 68957f1b6e77747a
    normal: 43 steps, 3 passages, a956895c7052f9af
    circle of two: 25 steps, 3 passages, a3bf12c20cb3a115
    cap: 80 steps, 3 passages, e84407fa6ee3d27a
    few: 20 steps, 2 passages, 1f138de976d946e9
    wide layer: 27 steps, 3 passages, 3d3d684813e36878
    circle: 26 steps, 1 passages, 23b26d8f94fa0c81
    crossed: 355 steps, 13 passages, 25774b2dc3547ba3
    crossed, coarse: 192 steps, 13 passages, 760280bea97b6332
    van der Pol: 219 steps, 4 passages, ae6b3535213a8f53
    van der Pol, coarse: 49 steps, 4 passages, bda5ac48f63c9674
    van der Pol, stiff: 604 steps, 4 passages, 07777e8b5b37946e
    decay: 479 steps, 2 passages, d95616e62545bcc8
    at rest: 7 steps, 0 passages, b46cae5b98fa2ed8
    nearly at rest: 18 steps, 1 passages, 7edcc3b9ffd5c404
    explosion: 314 steps, 1 passages, 1ca39ea5f46eb793
    root: 200 steps, 1 passages, bb05c3b9fb94d31d
    no number: 0 steps, 0 passages, a37eb2303d3878b8
";
const LSODA: &str = "
    plain: 674 steps, 8 passages, 859ecd95944cee6d
    coarse: 175 steps, 7 passages, a271b8c4d7392ba8
    fine: 368 steps, 4 passages, 6162b86d694f24c8
    sphere: 277 steps, 4 passages, 9995a9fb0aa22306
    cube: 267 steps, 4 passages, edd7d6fab46cd9c7
    normal: 240 steps, 4 passages, 2e88385631fefe29
    circle of two: 209 steps, 4 passages, 3bc19be70cb9507a
    cap: 254 steps, 4 passages, 5e272a3b61920999
    few: 20 steps, 1 passages, 3372d8ccc92c235e
    wide layer: 200 steps, 4 passages, 04c842f66d36d38e
    circle: 63 steps, 2 passages, 442bf429e741f033
    crossed: 1387 steps, 13 passages, defb5ad8eeed7ae1
    crossed, coarse: 441 steps, 13 passages, 58a74a93484eb853
    van der Pol: 290 steps, 4 passages, 975f2143c99d140c
    van der Pol, coarse: 143 steps, 4 passages, 31ff76df5a81f5b9
    van der Pol, stiff: 632 steps, 4 passages, eb6a6d57aa69bf0f
    decay: 124 steps, 2 passages, 552d33bdfbafa9dd
    at rest: 3 steps, 0 passages, 96fdce7166643c56
    nearly at rest: 32 steps, 0 passages, 8ce29d39fdcd2147
    explosion: 819 steps, 1 passages, 4de21978d643c534
    root: 40 steps, 1 passages, 2d665179e8dfb285
    no number: 0 steps, 0 passages, 9ac0f41601ec5091
    absolute: 218 steps, 4 passages, 0c59fab09c943e99
";
const RADAU5: &str = "
    plain: 503 steps, 9 passages, 187e7556f9e6eedf
    coarse: 122 steps, 8 passages, 69c5eedcc16dcb36
    fine: 583 steps, 3 passages, e185a78223a590f3
    sphere: 86 steps, 3 passages, fa99527da06eac2f
    cube: 122 steps, 3 passages, f5392051fb93436a
    normal: 91 steps, 3 passages, e48c78b3944e709f
    circle of two: 61 steps, 3 passages, 4492225899c23fd9
    cap: 165 steps, 3 passages, bbc81ee2cd679aca
    few: 20 steps, 1 passages, 9f073df6d7c92977
    wide layer: 165 steps, 3 passages, 119964173f93acee
    circle: 134 steps, 1 passages, 6078cfdb4d0ae464
    crossed: 1516 steps, 13 passages, 5aa5c3f8883cac68
    crossed, coarse: 184 steps, 13 passages, b973fce97fced250
    van der Pol: 829 steps, 4 passages, ca2b7419eedd9861
    van der Pol, coarse: 56 steps, 4 passages, fe0a2c50f1694186
    van der Pol, stiff: 429 steps, 4 passages, 4a72e11b2e5d0c5f
    decay: 40 steps, 2 passages, 3387c313053e6f2b
    at rest: 8 steps, 0 passages, 6b22c6a2f8b060a5
    nearly at rest: 3 steps, 0 passages, 5234d246bf99091d
    explosion: 1145 steps, 1 passages, 422e9dc179caab69
    root: 22 steps, 1 passages, dc4151ab16ba0a3e
    no number: 0 steps, 0 passages, a37eb2303d3878b8
";
const TAYLOR: &str = "
    plain: 66 steps, 4 passages, 3ae94478e15cc9b6
    coarse: 58 steps, 4 passages, 2c4d6318807db012
    fine: 37 steps, 2 passages, ea8a6964de54ac4f
    sphere: 31 steps, 2 passages, 263a293a31e4574c
    cube: 56 steps, 2 passages, 6981a121ad8627b6
    normal: 46 steps, 2 passages, 35957a9481624797
    circle of two: 31 steps, 2 passages, 84dfa3e13e026112
    cap: 75 steps, 2 passages, 7d1bea655b2c22fd
    few: 20 steps, 2 passages, f8f290fa44a579cf
    wide layer: 19 steps, 3 passages, a9378df8dba1063f
    circle: 2 steps, 0 passages, b68c6429402f0b10
    crossed: 148 steps, 6 passages, 16b7d9f3dc51f778
    crossed, coarse: 281 steps, 13 passages, 0f88487c1faa3b12
    van der Pol: 54 steps, 4 passages, a0d24becb34f8e46
    van der Pol, coarse: 98 steps, 4 passages, 875e17ffab9cb3fc
    van der Pol, stiff: 461 steps, 4 passages, 2cb92e9ac663dc3f
    decay: 289 steps, 2 passages, ffaa28a696201d5f
    at rest: 1 steps, 0 passages, e608df1a4ab157ce
    nearly at rest: 16 steps, 1 passages, b1cb38d502e9c639
    explosion: 204 steps, 1 passages, c6431c1c196a58e5
    root: 37 steps, 1 passages, 5a732696b65a61fe
    no number: 0 steps, 0 passages, 226594b2ba69b968
";
const TAYLOR_EXTENDED: &str = "
    plain: 54 steps, 2 passages, 9d32d197d129b6b8
    plain: 49 steps, 2 passages, 58d4ff0b6e4ee2fb
    plain: 112 steps, 2 passages, c3e4eeba8342442f
    plain: 57 steps, 2 passages, ebef3bf5d90d38b6
    cube: 34 steps, 2 passages, 94004a5e2d747856
    cube: 31 steps, 2 passages, 926a4253a69763a4
    cube: 78 steps, 2 passages, ad31ea8704997ea1
    cube: 36 steps, 2 passages, 6ed2710841ecce40
    circle: 1 steps, 0 passages, bc5962590b1840c0
    circle: 1 steps, 0 passages, cdf67ab3791acc9f
    circle: 3 steps, 0 passages, 49c72e1b5ffae2c7
    circle: 1 steps, 0 passages, a9f72a752dc73906
";
const LAYERED: &str = "
    plain: 722 steps, 8 passages, 074a86aae90dc67b
    coarse: 664 steps, 8 passages, e6d90520f738cdfe
    fine: 12 steps, 4 passages, e192f821a28eb49e
    sphere: 22 steps, 4 passages, b8b795aec9690f3d
    cube: 124 steps, 4 passages, 191ed510dee34386
    normal: 84 steps, 4 passages, 12dee75ab60af41c
    circle of two: 22 steps, 4 passages, d0e8a8778279389a
    cap: 202 steps, 4 passages, ed0ce0daa616b78b
    few: 20 steps, 6 passages, 47ec5d18ae480d38
    wide layer: 74 steps, 4 passages, 2caca41c7f9d162a
    circle: 3 steps, 2 passages, 4d87cfb48a50c53e
    crossed: 0 steps, 0 passages, 297971188355b02c
    crossed, coarse: 0 steps, 0 passages, feb98159fad565d4
    in the layer: 3 steps, 1 passages, b61a37eb07282969
    in the layer: 3 steps, 1 passages, 3bc16263caf23919
    above: 3 steps, 1 passages, fee5a9534ea5fc5e
    above: 2 steps, 1 passages, 9dbc1cd4b56cb842
    below: 4 steps, 1 passages, 0e16de79f323fe3c
    below: 2 steps, 2 passages, 672515d160e018f6
    turning: 7 steps, 2 passages, 3dc9536c3c0aef3d
    turning: 29 steps, 3 passages, 57e882b9095efd8e
    sliding: 273 steps, 0 passages, a917db2e4f8fc64b
    sliding: 37 steps, 1 passages, df3154a468d641da
    landing: 297 steps, 0 passages, a96c1a54804e6bb6
    landing: 42 steps, 1 passages, 0c65e5c96b8945a0
    leaving: 30 steps, 0 passages, 159c50518a58c6e0
    leaving: 17 steps, 1 passages, 7dee35836bf88bf8
    grazing: 289 steps, 1 passages, b5b33fcd96b142af
    grazing: 32 steps, 0 passages, b8d019ecb0832f44
    refused: 0 steps, 0 passages, cb46b50074f7eeab
    refused: 0 steps, 0 passages, 85c1a8489a82dcda
    refused: 0 steps, 0 passages, fdf97625a935fed9
";
const HYSTERETIC: &str = "
    plain: 235 steps, 3 passages, 6a294747237eff1c
    plain: 49 steps, 3 passages, 41d5ed25040f52fa
    plain: 73 steps, 3 passages, 007c5828a08fc269
    plain: 15 steps, 3 passages, dc7f910dbc5cbfd6
    kicked: 334 steps, 3 passages, 97c8f76c4debea79
    kicked: 59 steps, 3 passages, af3a4b9a5863221d
    kicked: 93 steps, 3 passages, 7fb86b40e571696b
    kicked: 22 steps, 3 passages, 8941517b9577b2bc
    plain: 215 steps, 3 passages, d75509c823bb6bc1
    plain: 44 steps, 3 passages, 38863e7c1c4c588e
    plain: 71 steps, 3 passages, 0903aaae328908ca
    plain: 56 steps, 3 passages, 8a2e6e4c053a0d24
    kicked: 335 steps, 3 passages, a09cbe745de3a817
    kicked: 60 steps, 3 passages, 3d3c3023211a060f
    kicked: 89 steps, 3 passages, e0e3ca15c72f87b3
    kicked: 56 steps, 3 passages, 9c5cb9bccaa2a509
";
const FILIPPOV_IN_SPACE: &str = "
    all: 689 steps, 0 passages, aaf7f23628b21bcb
    random: 2087 steps, 0 passages, 7abe6d12f3e6ec67
    uniform: 2087 steps, 0 passages, 6f6cadbcd9845f3e
    coarse: 382 steps, 0 passages, def9762494bf76fa
    at once: 460 steps, 0 passages, 462672c74899f0e6
    few events: 689 steps, 0 passages, 4467b36f9bfde350
    few steps: 63 steps, 0 passages, 935c6ae0e991e9ed
    on the surface: 410 steps, 0 passages, 3c358c6dd5f53948
    in the repelling region: 160 steps, 0 passages, 5999fc1016b96348
    no number: 0 steps, 0 passages, 0252a9679cef34b2
    backwards: 0 steps, 0 passages, ea65d9cc573a36e0
    wheel: 2067 steps, 0 passages, dc245e7c0b8f4c17
    all: 7c5b4bfcb8e59a44
";
const FILIPPOV_FAMILIES: &str = "
    funnel: dc7169ef040209e9
    members: b57fca66e10bf5d3
    funnel: 16081ec7009bfbf1
    members: fb4f6c24a3958b6f
    funnel: dd15d6b194edb8e1
    members: a8e9c51a21f68582
    no funnel: 932cf23cf769a727
    history: 890c1194b749a3ad
    history: 0399761c84b331dd
    history: 1b7f4102612fc06a
    short history: 8bff4bf3c5a01c95
    connect: 6fec763e49b48c30
    too short: 694587a548d6df21
    connect: acf8ee591c0a4eb5
    too short: 694587a548d6df21
    connect: 1a450a239795a859
    too short: 694587a548d6df21
";
const FILIPPOV_IN_THE_PLANE: &str = "
    stick-slip: 732 steps, 0 passages, d6d274b04933cfb9
    stick-slip: 65 steps, 0 passages, 7077b8b1f6f79b2b
    relay-linear: 151 steps, 0 passages, 8247df057320869f
    relay-linear: 16 steps, 0 passages, 1897892b30f5c24f
    relay-parabolic: 362 steps, 0 passages, cc367f3703130770
    relay-parabolic: 61 steps, 0 passages, d3ffe9d71cd37cca
    relay-parabolic: 117 steps, 0 passages, 0c02ee901678169c
    relay-parabolic: 93 steps, 0 passages, 18c5fd9d2f82f14a
    relay-parabolic: 361 steps, 0 passages, d38a7ed95d48afe2
    relay-parabolic: 33 steps, 0 passages, 1dc01941517acc2e
    fused-focus: 24 steps, 0 passages, f6bee66e3d9ccf84
    fused-focus: 18 steps, 0 passages, a24441c2af2f84b6
    relay-square: 19 steps, 0 passages, 73277e61a3b18b49
    relay-square: 19 steps, 0 passages, 73277e61a3b18b49
    relay-square: 14 steps, 0 passages, 5657d0cb76404774
    relay-square: 14 steps, 0 passages, 5657d0cb76404774
    relay-square: 20 steps, 0 passages, dc1ebda309d0380c
    relay-square: 20 steps, 0 passages, dc1ebda309d0380c
    relay-square: 32 steps, 0 passages, 5358e5e0964b10db
    relay-square: 32 steps, 0 passages, 5358e5e0964b10db
    two-blocks: 472 steps, 0 passages, 1329b16e8dc5d64e
    two-blocks: 472 steps, 0 passages, 1329b16e8dc5d64e
    two-blocks: 238 steps, 0 passages, ea248c305c341968
    two-blocks: 238 steps, 0 passages, ea248c305c341968
    two-blocks: 363 steps, 0 passages, cb98bb4d8ad9f9e4
    two-blocks: 363 steps, 0 passages, cb98bb4d8ad9f9e4
";

/// Kinks and jumps of a field, beside a clock.
enum Signs {
    /// u' = 1 + |u|.
    Kink,
    /// q' = ||u| - 1/2|, u' = 1.
    Kinks,
    /// u' = 2 + sign(u).
    Jump,
    /// u' = -sign(u).
    Attracting,
}

impl VectorField<2> for Signs {
    fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        let [q, u] = [x[0], x[1]];
        let one = S::one();
        SVector::from(match self {
            Self::Kink => [one, one + u.abs()],
            Self::Kinks => [(u.abs() - one.scale(0.5)).abs(), one],
            Self::Jump => [q, one.scale(2.0) + u.sign()],
            Self::Attracting => [-q, -u.sign()],
        })
    }
}

/// By every method that looks at its steps.
fn through_signs(field: &Signs, x0: [f64; 2], t_end: f64) -> [Result<[f64; 2], Failure>; 3] {
    fn end(
        field: &Signs,
        x0: [f64; 2],
        t_end: f64,
        mut method: impl Stepper<2>,
    ) -> Result<[f64; 2], Failure> {
        let options = DriveOptions::to(t_end);
        drive(field, x0.into(), &options, &mut method, &mut Ignore, &()).map(|end| end.x.into())
    }
    let size = tolerance(1e-8);
    [
        end(field, x0, t_end, Guarded::new(Dopri5::new(size), size)),
        end(field, x0, t_end, Guarded::new(Radau5::new(size), size)),
        end(field, x0, t_end, Guarded::new(Lsoda::new(size), size)),
    ]
}

#[test]
fn steps_end_where_a_sign_changes() {
    let grown = 0.5 * 1.5_f64.exp() - 1.0;
    for (field, x0, t_end, right) in [
        (Signs::Kink, [0.0, -1.0], 1.5, [1.5, grown]),
        (Signs::Kinks, [0.0, -1.0], 2.0, [0.5, 1.0]),
        (Signs::Jump, [0.0, -1.0], 2.0, [0.0, 3.0]),
    ] {
        for end in through_signs(&field, x0, t_end) {
            let end = end.unwrap();
            let near = |i: usize| (end[i] - right[i]).abs() < 1e-7;
            assert!(near(0) && near(1), "{end:?}, right: {right:?}");
        }
    }
}

#[test]
fn a_jump_that_attracts_is_refused() {
    for end in through_signs(&Signs::Attracting, [1.0, 0.3], 3.0) {
        match end.unwrap_err() {
            Failure::StaysOnJump { t, state, .. } => {
                assert!((t - 0.3).abs() < 1e-4 && state[1].abs() < 1e-6, "t = {t}, {state:?}");
            }
            other => panic!("{other}"),
        }
    }
}
