//! Properties of any piecewise-smooth system: two sides that mirror each other, the local analysis
//! against differences of the field itself, and a two-fold that is not at the origin.

use nalgebra::{SVector, Vector2, Vector3};
use std::ops::ControlFlow;

use super::engine::is_simple;
use super::flow::{FreeFlow, Sided, desingularised};
use super::two_fold::{AlongCurve, SlidingAtTwoFold};
use super::*;
use crate::Monitor;
use crate::guard::Gates;
use crate::step::Interpolant;
use twofold_num::random::RandomStream;
use twofold_num::{Elementary, Tape};
use twofold_system::singular::Ends;
use twofold_system::{Bound, Definition, PiecewiseSmooth, System, VectorField};

/// h becomes -h, f+ and f- change places: the same motion by other names.
#[derive(Clone)]
struct Mirrored<P>(P);

impl<P: PiecewiseSmooth<N>, const N: usize> PiecewiseSmooth<N> for Mirrored<P> {
    fn switching<S: Elementary>(&self, x: &SVector<S, N>) -> S {
        -self.0.switching(x)
    }
    fn plus<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        self.0.minus(x)
    }
    fn minus<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        self.0.plus(x)
    }
}

#[test]
fn simple_systems_have_neither_gates_nor_ends_of_domains() {
    let power = |n: u32| {
        let text = format!(
            "states = ['x', 'y', 'z']\nh = 'x/3'\nplus = ['y', 'z', 'x^{n}']\n\
                minus = ['z', '1', 'y']"
        );
        System::new(Definition::from_toml(&text, "power.toml").expect("a system"))
    };
    let builtin = |name| System::builtin(name).expect("built in");
    let simple = ["caricature", "two-fold", "relay-third-order"].map(builtin);
    for system in simple.into_iter().chain([power(7)]) {
        let bound: Bound<3> = system.bind().expect("of three states");
        assert!(is_simple(&bound), "{}", system.name());
        let sided = || Sided { system: &bound, depth: None };
        let h = Tape::record(3, |x| vec![bound.switching(&Vector3::from_column_slice(x))]);
        for side in [Side::Plus, Side::Minus] {
            let tape = FreeFlow { system: sided(), side }.tape();
            assert!(Gates::of_side(tape.clone(), &h).is_none() && Ends::new(tape).is_none());
        }
        assert!(Gates::of_part(SlidingFlow { system: sided(), direction: 1.0 }.tape()).is_none());
    }
    for system in [power(8), power(16)] {
        assert!(!is_simple(&system.bind::<3>().expect("of three states")));
    }
}

/// Everything of a run but its sides: times, states, kinds of events and modes.
fn story(
    run: &(Result<FilippovSummary<3>, FilippovError>, Trajectory<3>),
    mirror: bool,
) -> Vec<(f64, SVector<f64, 3>, String)> {
    let side = |side: Side| if mirror { side.other() } else { side };
    let mode = |mode: Option<Mode>| {
        mode.map(|mode| match mode {
            Mode::Plus => side(Side::Plus).into(),
            Mode::Minus => side(Side::Minus).into(),
            sliding => sliding,
        })
    };
    let kind = |kind: EventKind| match kind {
        EventKind::Crossing { to } => format!("crossing to {:?}", side(to)),
        EventKind::Landing { from } => format!("landing from {:?}", side(from)),
        EventKind::Grazing { side: on } => format!("grazing on {:?}", side(on)),
        EventKind::LeftByTangency { to } => format!("tangency to {:?}", side(to)),
        EventKind::Exit { to, .. } => format!("exit to {:?}", side(to)),
        EventKind::ExitAtBoundary { to, .. } => format!("boundary to {:?}", side(to)),
        EventKind::TwoFoldReached { .. } => "two-fold".into(),
        other => format!("{other:?}"),
    };
    let (end, seen) = run;
    let mut all: Vec<_> = seen
        .events
        .iter()
        .map(|e| (e.t, e.state, format!("{} {:?} {:?}", kind(e.kind), mode(e.from), mode(e.to))))
        .collect();
    match end {
        Ok(end) => {
            all.push((end.t, end.x, format!("{:?} {:?} {}", end.stop, mode(end.mode), end.events)))
        }
        Err(error) => {
            let word = format!("{error:?}").split([' ', '(']).next().unwrap_or_default().to_owned();
            all.push((0.0, SVector::zeros(), word));
        }
    }
    all
}

fn fold(plus: f64, minus: f64, v: f64, w: f64) -> Bound<3> {
    let values = [("plus_fold", plus), ("minus_fold", minus), ("v", v), ("w", w)];
    System::builtin("two-fold")
        .unwrap()
        .with_all(values.map(|(name, value)| (name, value.into())))
        .unwrap()
        .bind()
        .unwrap()
}

#[test]
fn the_two_sides_mirror_each_other() {
    let settings = FilippovOptions {
        tolerance: Tolerance { rtol: 1e-9, atol: 1e-9 },
        max_events: 40,
        ..FilippovOptions::default()
    };
    let mut kinds = std::collections::BTreeSet::new();
    for (plus, minus) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
        for (v, w) in [(0.0, 0.0), (-1.2, -1.4), (0.5, -0.7)] {
            let system = fold(plus, minus, v, w);
            for start in [
                [0.0, 0.3, 0.8],
                [0.0, -1.0, -2.0],
                [0.0, -1.0, 1.0],
                [0.0, 1.0, -1.0],
                [0.0, -0.6, -0.25],
                [0.0, 0.0, -0.5],
                [0.0, -0.5, 0.0],
                [0.0, 0.0, 0.0],
                // Touches where the field turns round: from above, from below, and almost.
                [0.5, -1.0, -1.0],
                [-0.5, -1.0, -1.0],
                [-0.5, 1.0, -1.0],
                [0.5 - 1e-9, -1.0, -1.0],
                [-0.5 + 1e-9, -1.0, -1.0],
                [0.3, 0.4, -0.7],
            ] {
                for side in [Side::Plus, Side::Minus] {
                    for at_once in [false, true] {
                        let rule = |side| {
                            if at_once {
                                ExitRule::AtOnce { side }
                            } else {
                                ExitRule::AfterTime { time: 0.3, side }
                            }
                        };
                        let mut seen = [Trajectory::new(1), Trajectory::new(1)];
                        let [straight, turned] = &mut seen;
                        let x0 = SVector::from(start);
                        let ends = [
                            run(&system, x0, 3.0, &settings, rule(side), straight),
                            run(
                                &Mirrored(system.clone()),
                                x0,
                                3.0,
                                &settings,
                                rule(side.other()),
                                turned,
                            ),
                        ];
                        let [a, b] = ends;
                        let [straight, turned] = seen;
                        let (a, b) = (story(&(a, straight), false), story(&(b, turned), true));
                        assert_eq!(a.len(), b.len(), "{start:?}: {a:?} {b:?}");
                        for (a, b) in a.iter().zip(&b) {
                            assert_eq!(a.2, b.2, "{start:?}");
                            let gap = (a.0 - b.0).abs().max((a.1 - b.1).amax());
                            assert!(gap < 1e-9, "{start:?}: {a:?} {b:?}");
                            kinds.insert(a.2.split(' ').next().unwrap_or_default().to_owned());
                        }
                    }
                }
            }
        }
    }
    for kind in [
        "crossing",
        "landing",
        "grazing",
        "tangency",
        "exit",
        "boundary",
        "two-fold",
        "StartedOnSurface",
    ] {
        assert!(kinds.contains(kind), "no {kind} among {kinds:?}");
    }
}

/// A curved surface and fields with squares; the two-fold is at `centre`.
#[derive(Clone, Debug)]
struct Curved {
    centre: [f64; 3],
    bend: f64,
    /// Of each field: the first component's slopes and squares, the other components' values and
    /// slopes.
    fields: [[f64; 8]; 2],
}

impl Curved {
    fn by_chance(stream: &mut RandomStream) -> Self {
        let mut number = || stream.uniform_in(-1.5, 1.5);
        Self {
            centre: [(); 3].map(|()| number()),
            bend: 0.3 * number(),
            fields: [(); 2].map(|()| {
                let mut field = [(); 8].map(|()| number());
                [2, 3, 6, 7].into_iter().for_each(|i| field[i] *= 0.2);
                field
            }),
        }
    }
    fn field<S: Elementary>(&self, x: &SVector<S, 3>, which: usize) -> SVector<S, 3> {
        let [_, y, z] = [0, 1, 2].map(|i| x[i] - S::from_f64(self.centre[i]));
        let c = self.fields[which].map(S::from_f64);
        Vector3::new(
            c[0] * y + c[1] * z + c[2] * y * y + c[3] * z * z,
            c[4] + c[6] * z,
            c[5] + c[7] * y,
        )
    }
}

impl PiecewiseSmooth<3> for Curved {
    fn switching<S: Elementary>(&self, x: &SVector<S, 3>) -> S {
        let [x, y, z] = [0, 1, 2].map(|i| x[i] - S::from_f64(self.centre[i]));
        x + (y * z).scale(self.bend)
    }
    fn plus<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        self.field(x, 0)
    }
    fn minus<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        self.field(x, 1)
    }
}

fn near(a: f64, b: f64, tolerance: f64, what: &str) {
    assert!((a - b).abs() <= tolerance * (1.0 + b.abs()), "{what}: {a} is not {b}");
}

#[test]
fn the_local_analysis_is_that_of_the_field_itself() {
    let mut stream = RandomStream::new(8, 0);
    let (mut sliding, mut spirals, mut backwards) = (0, 0, 0);
    for _ in 0..60 {
        let s = Curved::by_chance(&mut stream);
        let centre = SVector::from(s.centre);
        let Some(local) = SlidingAtTwoFold::near(&s, &(centre + Vector3::new(0.01, -0.02, 0.015)))
        else {
            continue;
        };
        assert!((local.point - centre).amax() < 1e-12, "{s:?}: {:?}", local.point);
        let field = |x: &SVector<f64, 3>| desingularised(&s, x).0;
        // L+h and L-h near the centre, and their slopes along both fields there.
        let slopes = [0, 1].map(|i| {
            let f = s.fields[i];
            [f[0] + s.bend * f[5], f[1] + s.bend * f[4]]
        });
        let along = |slope: [f64; 2], field: usize| {
            slope[0] * s.fields[field][4] + slope[1] * s.fields[field][5]
        };
        let [pp, pm, mp, mm] =
            [along(slopes[0], 0), along(slopes[0], 1), along(slopes[1], 0), along(slopes[1], 1)];
        for (found, want) in local.second.iter().zip([pp, pm, mp, mm]) {
            near(*found, want, 1e-11, "second Lie derivative");
        }
        let (trace, determinant) = (mp - pm, mm * pp - pm * mp);
        assert_eq!(local.directions.is_some(), 0.25 * trace * trace > determinant);
        let Some([weak, strong]) = &local.directions else {
            spirals += 1;
            assert!(local.through.is_none() && local.back.is_none() && local.radius == 1e-3);
            continue;
        };
        assert!(weak.rate.abs() <= strong.rate.abs());
        near(weak.rate * strong.rate, determinant, 1e-10, "product of the rates");
        near(weak.rate + strong.rate, trace, 1e-10, "sum of the rates");
        for d in [weak, strong] {
            near(d.vector.norm(), 1.0, 1e-12, "length");
            near(d.vector[0], 0.0, 1e-12, "tangent to the surface");
            assert!(d.lie[0] < 0.0 || (d.lie[0] == 0.0 && d.lie[1] >= 0.0), "{d:?}");
            for (lie, slope) in d.lie.iter().zip(slopes) {
                near(
                    *lie,
                    slope[0] * d.vector[1] + slope[1] * d.vector[2],
                    1e-9,
                    "Lie derivative along it",
                );
            }
            let e = 1e-5;
            let slope =
                (field(&(centre + d.vector * e)) - field(&(centre - d.vector * e))) / (2.0 * e);
            assert!(
                (slope - d.vector * d.rate).amax() < 1e-8 * (1.0 + d.rate.abs()),
                "{slope} {d:?}"
            );
            assert_eq!(d.slides(), d.lie[0] < 0.0 && d.lie[1] > 0.0);
        }
        let [a, b] = local
            .coordinates(&s, &(centre + (weak.vector * 3.0 - strong.vector * 2.0) * 1e-6))
            .unwrap();
        if (weak.rate - strong.rate).abs() > 0.1 {
            near(a * 1e6, 3.0, 1e-3, "along the weak direction");
            near(b * 1e6, -2.0, 1e-3, "along the strong direction");
        }
        let of_sign =
            |sign: f64| [weak, strong].iter().position(|d| d.slides() && d.rate * sign > 0.0);
        assert_eq!(local.through.as_ref().map(|c| c.index), of_sign(-1.0));
        assert_eq!(local.back.as_ref().map(|c| c.index), of_sign(1.0));
        let curves = [&local.through, &local.back].map(|c| c.as_ref());
        let smallest = curves.iter().flatten().map(|c| c.radius).fold(f64::INFINITY, f64::min);
        assert_eq!(local.radius, if smallest.is_finite() { smallest.min(1.0) } else { 1e-3 });
        for curve in curves.into_iter().flatten() {
            sliding += 1;
            backwards += usize::from(curve.rate > 0.0);
            let direction = [weak, strong][curve.index];
            assert_eq!(curve.rate, direction.rate);
            assert_eq!(curve.at(0.0), local.point);
            assert!(curve.radius > 1e-3 && curve.radius < 1e3, "{}", curve.radius);
            for part in [-1.0, -0.6, 0.3, 1.0] {
                let (sigma, e) = (part * curve.radius, 1e-4 * curve.radius);
                let slope = (curve.at(sigma + e) - curve.at(sigma - e)) / (2.0 * e);
                let (f, clock) = desingularised(&s, &curve.at(sigma));
                assert!(
                    (f - slope * (sigma * curve.rate)).amax() < 1e-5 * f.amax(),
                    "{part}: {f} {slope}"
                );
                let speed = (curve.time(sigma + e) - curve.time(sigma - e)) / (2.0 * e);
                near(speed, clock / (curve.rate * sigma), 1e-5, "time along the curve");
                near(s.switching(&curve.at(sigma)), 0.0, 1e-9, "on the surface");
                let back = curve.sigma(curve.time(sigma), curve.radius);
                near(back / curve.radius, part, 1e-6, "there and back");
            }
            let e = 1e-3 * curve.radius;
            let slope = (curve.at(e) - curve.at(-e)) / (2.0 * e);
            assert!((slope - direction.vector).amax() < 1e-3, "{slope} {direction:?}");
            assert_eq!(curve.sigma(0.0, curve.radius), 0.0);
            for sign in [-1.0, 1.0] {
                let limit = 0.25 * curve.radius;
                assert_eq!(
                    curve.sigma(3.0 * curve.time(sign * limit), limit),
                    sign * limit,
                    "no farther than the limit"
                );
            }
            // As a step its ends are those of its times, whichever side of the two-fold they are
            // on.
            let [from, to] = [curve.time(-0.5 * curve.radius), curve.time(0.25 * curve.radius)];
            let step = AlongCurve { curve, from, to, limit: curve.radius };
            for (theta, part) in [(0.0, -0.5), (-from / (to - from), 0.0), (1.0, 0.25)] {
                assert!((step.at(theta) - curve.at(part * curve.radius)).amax() < 1e-9, "{theta}");
            }
            // Within the departure limit the curve lies in the sliding regions.
            let limit = local.departure_limit(&s, curve).unwrap();
            assert!(limit <= curve.radius);
            // Arrival along it takes the series' time; an orbit beside it, the linear flow's
            // besides, if that contracts.
            let (on, across) = (1e-5, 3e-9);
            let repelling = curve.rate > 0.0;
            let (time, error) = local.time_to_arrive(&s, &curve.at(on), repelling).unwrap();
            near(time / curve.time(on), -1.0, 1e-3, "time to arrive");
            near(error / (time.abs() * on / local.radius), 1.0, 1e-2, "its error");
            let other = [weak, strong][1 - curve.index];
            let beside = curve.at(on) + other.vector * across;
            if other.rate * curve.rate > 0.0 {
                let (later, _) = local.time_to_arrive(&s, &beside, repelling).unwrap();
                let linear = across * (other.lie[1] - other.lie[0]) / -other.rate;
                assert!(
                    (later - time - linear).abs() < 0.02 * linear.abs() + 1e-12,
                    "{later} {time} {linear}"
                );
            } else {
                assert!(
                    local.time_to_arrive(&s, &beside, repelling).is_some(),
                    "almost on the curve"
                );
                let far = curve.at(on) + other.vector * (0.1 * on);
                assert_eq!(local.time_to_arrive(&s, &far, repelling), None);
            }
        }
    }
    assert!(sliding > 10 && spirals > 3 && backwards > 2, "{sliding} {spirals} {backwards}");
}

/// Its invariant curve is the line y = z in the surface, along which F = -y (0, 1, 1); L+h = -y (1
/// + 2 y) is zero there at the two-fold and, after it, at y = -1/2.
#[derive(Clone)]
struct Straight;

impl PiecewiseSmooth<3> for Straight {
    fn switching<S: Elementary>(&self, x: &SVector<S, 3>) -> S {
        x[0]
    }
    fn plus<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        // f+ = -(1, 1) - (1 + 2 y) f-, so that q f+ - p f- = -y (1, 1) on the line, where p = -y (1
        // + 2 y) and q = y.
        let rest = S::one() + x[1].scale(2.0);
        let along = S::from_f64(-1.0);
        Vector3::new(-(x[1] * rest), along - rest.scale(0.5), along - rest.scale(-0.25))
    }
    fn minus<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        Vector3::new(x[2], S::from_f64(0.5), S::from_f64(-0.25))
    }
}

#[test]
fn a_curve_is_used_only_where_it_slides() {
    let local = SlidingAtTwoFold::near(&Straight, &Vector3::new(0.0, 0.01, 0.02)).unwrap();
    let curve = local.through.as_ref().unwrap();
    let zero = std::f64::consts::FRAC_1_SQRT_2;
    assert!(curve.radius > zero, "the series itself knows of no fold: {}", curve.radius);
    let limit = local.departure_limit(&Straight, curve).unwrap();
    assert!(limit < zero && limit > 0.4 * zero, "{limit}");
}

/// A two-fold with rates -0.3, along the sliding direction, and -0.6: from order 2 on the curve has
/// no series.
#[test]
fn a_resonance_ends_the_series() {
    let square = [0.0, 0.0, 0.1, 0.0];
    let field = |slopes: [f64; 2], values: [f64; 2]| {
        [slopes[0], slopes[1], square[2], square[3], values[0], values[1], 0.0, 0.0]
    };
    let system = Curved {
        centre: [0.0; 3],
        bend: 0.0,
        fields: [field([1.0, 0.0], [-0.15, -0.45]), field([0.0, 1.0], [0.45, 0.15])],
    };
    let local = SlidingAtTwoFold::near(&system, &Vector3::new(0.0, 0.01, 0.02)).unwrap();
    let [weak, strong] = local.directions.unwrap();
    near(weak.rate, -0.3, 1e-14, "weak");
    near(strong.rate, -0.6, 1e-14, "strong");
    let curve = local.through.unwrap();
    assert_eq!(curve.index, 0);
    // The invariance equation is kept to 1e-12 as far as the square of the distance allows, and no
    // term of a small divisor spoils that.
    assert!(curve.radius > 1e-9 && curve.radius < 1e-4, "{}", curve.radius);
}

/// A two-fold moved to `centre`.
#[derive(Clone)]
struct Moved {
    fold: Bound<3>,
    centre: [f64; 3],
}

impl Moved {
    fn back<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        SVector::from_fn(|i, _| x[i] - S::from_f64(self.centre[i]))
    }
}

impl PiecewiseSmooth<3> for Moved {
    fn switching<S: Elementary>(&self, x: &SVector<S, 3>) -> S {
        self.fold.switching(&self.back(x))
    }
    fn plus<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        self.fold.plus(&self.back(x))
    }
    fn minus<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        self.fold.minus(&self.back(x))
    }
}

#[test]
fn futures_and_pasts_meet_at_a_two_fold_anywhere() {
    // Time to and from the two-fold: -(1, 1) A^-1 (y, z) with A = [[w, 1], [1, v]].
    let (v, w) = (-1.2, -1.4);
    let time = |y: f64, z: f64| ((v * y - z) + (w * z - y)) / (1.0 - v * w);
    let system = Moved { fold: fold(1.0, 1.0, v, w), centre: [2.0, -3.0, 5.0] };
    let place = |y: f64, z: f64| SVector::from(system.centre) + Vector3::new(0.0, y, z);
    let settings = FilippovOptions::default();
    let path = connect(&system, place(0.3, 0.8), place(-0.4, -0.5), 100.0, &settings, 2).unwrap();
    let points: Vec<_> = path.points().collect();
    let (first, last) = (points[0], points[points.len() - 1]);
    assert!(
        (first.1 - place(0.3, 0.8)).amax() < 1e-12 && (last.1 - place(-0.4, -0.5)).amax() < 1e-9
    );
    near(last.0 - first.0, time(0.3, 0.8) + time(0.4, 0.5), 1e-9, "there and on");
    assert!(points.windows(2).all(|p| p[1].0 >= p[0].0 - 1e-12), "time runs forward");
    let past = history(&system, place(-0.4, -0.5), 100.0, &settings, 2).unwrap();
    near(past.points().last().unwrap().0, time(0.4, 0.5), 1e-9, "its past");
    let grid = FunnelGrid {
        shortest: 0.1,
        longest: 0.4,
        times: 3,
        horizon: 2.0,
        until_two_fold: true,
        per_step: 1,
    };
    let family = funnel(&system, place(0.3, 0.8), 100.0, &settings, &grid).unwrap();
    assert!(family.at_two_fold && (family.point - place(0.0, 0.0)).amax() < 1e-12);
    let times: Vec<_> = family.members.iter().map(|m| m.exit_time).collect();
    for (found, want) in times.iter().zip([0.1, 0.1, 0.2, 0.2, 0.4, 0.4]) {
        near(*found, want, 1e-12, "equal ratios");
    }
    for member in &family.members {
        let exit = member
            .trajectory
            .events
            .iter()
            .find(|e| matches!(e.kind, EventKind::Exit { .. }))
            .unwrap();
        near(exit.t - family.t, member.exit_time, 1e-12, "exit");
        assert_eq!(exit.to, Some(member.side.into()));
    }
    let only = family
        .members_on(&system, &settings, &FunnelGrid { times: 1, ..grid }, Some(Side::Plus))
        .unwrap();
    assert!(only.len() == 1 && only[0].exit_time == 0.4 && only[0].side == Side::Plus);
}

#[test]
fn a_start_on_a_visible_fold_flies_off_along_it() {
    // f+ = (y, 1, 0) and f- = (-z, 0, 1): from a fold of one side, where the other points to the
    // same side.
    let system = fold(-1.0, -1.0, 0.0, 0.0);
    for (start, side, end) in [
        ([0.0, 0.0, -0.5], Side::Plus, [0.5, 1.0, -0.5]),
        ([0.0, -0.5, 0.0], Side::Minus, [-0.5, -0.5, 1.0]),
    ] {
        let mut seen = Trajectory::new(1);
        let rule = ExitRule::AtOnce { side: Side::Plus };
        let summary =
            run(&system, start.into(), 1.0, &FilippovOptions::default(), rule, &mut seen).unwrap();
        assert_eq!(seen.events.len(), 1, "{:?}", seen.events);
        assert_eq!(
            (seen.events[0].kind, seen.events[0].to),
            (EventKind::StartedOnSurface, Some(side.into()))
        );
        assert!((summary.x - SVector::from(end)).amax() < 1e-11, "{}", summary.x);
    }
}

#[test]
fn a_budget_is_an_error_where_it_is_asked_to_be() {
    let summary = |stop| FilippovSummary {
        t: 1.5,
        x: Vector2::new(1.0, 2.0),
        mode: None,
        stop,
        events: 0,
        statistics: Statistics { steps: 7, ..Statistics::default() },
    };
    let failure = Failure::TooManySteps { t: 1.5, limit: 7, state: vec![1.0, 2.0] };
    assert_eq!(
        summary(StopReason::StepBudget).within_budget(),
        Err(FilippovError::Stepping(failure))
    );
    for stop in
        [StopReason::EndTime, StopReason::Observer, StopReason::Cancelled, StopReason::SetValued]
    {
        assert_eq!(summary(stop).within_budget(), Ok(summary(stop)));
    }
}

/// A monitor is asked at every event and now and then between steps; when it refuses, the run ends
/// there.
#[test]
fn a_watch_ends_a_run() {
    struct Until(f64);
    impl Monitor for Until {
        fn reached(&self, t: f64) -> ControlFlow<()> {
            if t < self.0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        }
    }
    let system = fold(1.0, -1.0, 0.5, -0.7);
    let settings = FilippovOptions { max_step: 1e-4, ..FilippovOptions::default() };
    let rule = ExitRule::AtOnce { side: Side::Plus };
    let ends = |until: f64| {
        let mut seen = Trajectory::new(1);
        let end = run_watched(
            &system,
            Vector3::new(0.0, 0.3, 0.8),
            3.0,
            &settings,
            rule,
            &mut seen,
            &Until(until),
        )
        .unwrap();
        (end.stop, end.t, seen.events)
    };
    let (stop, t, events) = ends(f64::INFINITY);
    assert!(stop == StopReason::EndTime && t == 3.0 && !events.is_empty(), "{stop:?} {t}");
    // At an event, and in the thousands of steps between two.
    let (stop, t, _) = ends(events[0].t);
    assert!(stop == StopReason::Cancelled && t == events[0].t, "{stop:?} {t}");
    let last = events[events.len() - 1].t;
    assert!(last < 1.0, "{last}");
    let (stop, t, _) = ends(last + 0.5);
    assert!(stop == StopReason::Cancelled && t > last + 0.5 && t < 3.0, "{stop:?} {t}");
}

#[test]
fn exit_rules_have_numbers_that_make_sense_and_words() {
    let random =
        |law, plus_probability| ExitRule::Random { law, plus_probability, seed: 1, stream: 2 };
    let uniform = |longest| SlidingLaw::Uniform { longest };
    let exponential = |mean| SlidingLaw::Exponential { mean };
    let side = Side::Minus;
    for good in [
        ExitRule::All,
        ExitRule::AtOnce { side },
        ExitRule::AfterTime { time: 0.0, side },
        ExitRule::AfterArc { arc: 1.5, side },
        random(uniform(0.0), 0.0),
        random(exponential(2.0), 1.0),
    ] {
        assert_eq!(good.validate(), Ok(()), "{good}");
    }
    for (bad, what) in [
        (ExitRule::AfterTime { time: -0.1, side }, "time"),
        (ExitRule::AfterTime { time: f64::INFINITY, side }, "time"),
        (ExitRule::AfterArc { arc: f64::NAN, side }, "arc"),
        (random(uniform(-1.0), 0.5), "longest time"),
        (random(exponential(f64::INFINITY), 0.5), "mean time"),
        (random(uniform(1.0), 1.1), "probability"),
        (random(exponential(1.0), -0.1), "probability"),
        (random(exponential(1.0), f64::NAN), "probability"),
    ] {
        let said = bad.validate().unwrap_err();
        assert!(said.contains(what), "{bad}: {said}");
    }
    assert_eq!(ExitRule::AtOnce { side }.to_string(), "at-once:minus");
    assert_eq!(
        ExitRule::AfterTime { time: 0.3, side: Side::Plus }.to_string(),
        "after-time:0.3:plus"
    );
}

/// A pulse of width 1e-4 in the fields is not jumped over, in flight and in sliding.
#[test]
fn thin_pulses_are_seen() {
    let bell = "1e4*exp(-((s - 7.123)/1e-4)^2)";
    let twice = format!("2*{bell}");
    let area = std::f64::consts::PI.sqrt();
    for (h, plus, minus) in [("q + 100", bell, bell), ("y", bell, bell), ("y", &twice, "0")] {
        let text = format!(
            "states = ['q', 'y', 's']\nstart = [0, 0, 0]\nh = '{h}'\nplus = ['{plus}', '-1', '1']\n\
             minus = ['{minus}', '1', '1']"
        );
        let text = twofold_system::Definition::from_toml(&text, "").unwrap();
        let bound: Bound<3> = System::new(text).bind().unwrap();
        let settings = FilippovOptions::default();
        let end = run(
            &bound,
            SVector::zeros(),
            20.0,
            &settings,
            ExitRule::Undecided,
            &mut Trajectory::new(1),
        );
        let q = end.unwrap().x[0];
        assert!((q - area).abs() < 1e-6, "{h}: {q}");
    }
}

/// A run of a plane system with these formulas.
fn plane(
    formulas: [&str; 3],
    start: [f64; 2],
    t_end: f64,
) -> Result<FilippovSummary<2>, FilippovError> {
    plane_within(1e-12, formulas, start, t_end)
}

/// The same with this tolerance.
fn plane_within(
    tolerance: f64,
    [h, plus, minus]: [&str; 3],
    start: [f64; 2],
    t_end: f64,
) -> Result<FilippovSummary<2>, FilippovError> {
    let text = format!(
        "states = ['x', 'y']\nstart = [0, 0]\nh = '{h}'\nplus = [{plus}]\nminus = [{minus}]"
    );
    let text = twofold_system::Definition::from_toml(&text, "").unwrap_or_else(|e| panic!("{e}"));
    let bound: Bound<2> = System::new(text).bind().unwrap();
    let tolerance = Tolerance { rtol: tolerance, atol: tolerance };
    let settings = FilippovOptions { tolerance, ..FilippovOptions::default() };
    let rule = ExitRule::Undecided;
    run(&bound, start.into(), t_end, &settings, rule, &mut Trajectory::new(1))
}

/// A closed valve, a saturation: one field runs along the surface, and the other one leads to it.
#[test]
fn a_field_that_runs_along_the_surface_is_slid_along() {
    for (plus, minus, start, t_end, want) in [
        ("'1', '0'", "'1', '1'", [0.0, -1.0], 3.0, [3.0, 0.0]),
        ("'1', '-y'", "'1', '1'", [0.0, -1.0], 3.0, [3.0, 0.0]),
        ("'1', '-y^2'", "'1', '1'", [0.0, -1.0], 3.0, [3.0, 0.0]),
        ("'1', '0'", "'2', '1'", [0.0, -1.0], 3.0, [4.0, 0.0]),
        ("'1', '-1'", "'3', 'y*x'", [0.0, 1.0], 3.0, [7.0, 0.0]),
        ("'1', '-y'", "'1', '1'", [0.0, 1.0], 30.0, [30.0, 0.0]),
        ("'cos(x)', '-1'", "'1', '0'", [0.0, 0.5], 2.0, [0.5403023058681398 + 1.5, 0.0]),
        ("'1', '0'", "'1', '1'", [0.0, 0.0], 3.0, [3.0, 0.0]),
    ] {
        for mirrored in [false, true] {
            let formulas = if mirrored { ["-y", minus, plus] } else { ["y", plus, minus] };
            let end = plane(formulas, start, t_end).unwrap_or_else(|e| panic!("{formulas:?} {e}"));
            let mut off = end.x - SVector::from(want);
            if plus.starts_with("'cos") {
                // sin(x) grows with x' = cos(x) until y = 0 at t = 0.5.
                off[0] = end.x[0] - (0.5_f64.tanh().asin() + 1.5);
            }
            assert!(off.amax() < 1e-9, "{formulas:?} {}", end.x);
        }
    }
    // The valve opens at x = 1: both fields are then tangent to the surface.
    let end = plane(["y", "'1', 'x - 1'", "'1', '0'"], [0.0, 0.1], 3.0);
    assert!(end.is_err(), "{end:?}");
}

/// Tangencies of higher order, with h = x and y' = 1: where the field ahead leads to the surface
/// sliding goes on, where it leads away the motion leaves, or passes.
#[test]
fn tangencies_of_higher_order_are_told_by_what_comes_ahead() {
    let power = |y: f64, n: i32| (0..n).fold(1.0, |product, _| product * y);
    for n in [4, 6, 8] {
        // Along the surface past the touch, landing in it, beginning in it.
        let landing = 1.0 / f64::from(n + 1);
        for start in [[0.0, -1.0], [0.0, -1.01], [0.0, -0.3], [landing, -1.0], [0.0, 0.0]] {
            for shift in [0.0, 0.1, -0.3] {
                let plus = format!("'-(y - {shift})^{n}', '1'");
                let at = [start[0], start[1] + shift];
                let end = plane(["x", &plus, "'1', '1'"], at, 3.0);
                let x = end.unwrap_or_else(|e| panic!("{plus} {at:?}: {e}")).x;
                assert!(
                    x[0].abs() < 1e-9 && (x[1] - at[1] - 3.0).abs() < 1e-9,
                    "{plus} {at:?} {x}"
                );
                let minus = format!("'(y - {shift})^{n}', '1'");
                let x = plane(["x", "'-1', '1'", &minus], [-at[0], at[1]], 3.0).unwrap().x;
                assert!(
                    x[0].abs() < 1e-9 && (x[1] - at[1] - 3.0).abs() < 1e-9,
                    "{minus} {at:?} {x}"
                );
            }
        }
    }
    for n in 2..9 {
        // Crossing to where the field behind is tangent and leads on.
        let plus = format!("'y^{n}', '1'");
        let x = plane(["x", &plus, "'1', '1'"], [-1.0, -1.0], 3.0).unwrap().x;
        let want = power(2.0, n + 1) / f64::from(n + 1);
        assert!((x[0] - want).abs() < 1e-6 * want, "{plus} {x}");
    }
    for n in [3, 5] {
        // A visible fold of higher order: sliding ends in it.
        let plus = format!("'y^{n}', '1'");
        let x = plane(["x", &plus, "'1', '1'"], [0.0, -1.0], 3.0).unwrap().x;
        let want = power(2.0, n + 1) / f64::from(n + 1);
        assert!((x[0] - want).abs() < 1e-6 * want, "{plus} {x}");
    }
}

/// Both fields touch the surface in one point: sliding goes on with the weights that it has around
/// it, from before, from a landing there, from a start there.
#[test]
fn sliding_passes_a_touch_of_both_fields() {
    for (speed, weight) in [(1.0, 1.0), (2.0, 2.0)] {
        for shift in [0.0, 0.1] {
            let plus = format!("'-(y - {shift})^2', '1'");
            let minus = format!("'{weight}*(y - {shift})^2', '{speed}'");
            // y' = (q f+ - p f-)/(q - p).
            let rate = (weight + speed) / (1.0 + weight);
            for start in [[0.0, -1.0], [0.0, 0.0]] {
                let at = [start[0], start[1] + shift];
                let end = plane(["x", &plus, &minus], at, 3.0);
                let x = end.unwrap_or_else(|e| panic!("{plus} {minus} {at:?}: {e}")).x;
                assert!((x[1] - at[1] - 3.0 * rate).abs() < 1e-8 && x[0].abs() < 1e-9, "{x}");
            }
        }
    }
    let x = plane(["x", "'-y^2', '1'", "'y^2', '1'"], [1.0 / 3.0, -1.0], 3.0).unwrap().x;
    assert!((x[1] - 2.0).abs() < 1e-8 && x[0].abs() < 1e-9, "{x}");
}

/// Sliding comes to a corner of h and does not go on behind it: the motion leaves with the only
/// field that leads away.
#[test]
fn sliding_ends_at_a_corner() {
    let landed = 0.4 / 2.2;
    let left = landed + (0.5 - 0.2 * landed) * 3.0 / 2.8 + 1.0 / 0.56;
    for place in [0.0, 100.0] {
        let shifted = format!("x - {place}");
        for (h, plus, minus, start, t_end, want) in [
            ("y - abs(X)", "'1', '-2.5'", "'1', '0.5'", [-1.0, 1.0], 2.0, [1.0, 0.5]),
            ("y - abs(X)", "'1', '-2.5'", "'1', '0.5'", [-2.0, 2.75], 3.0, [1.0, 0.5]),
            // Lands at t = 0.4/2.2, passes the corner (1, 0) and comes to (0, 1), which it leaves.
            (
                "abs(X) + abs(y) - 1",
                "'-2', '0.2'",
                "'2', '1.2'",
                [0.9, -0.5],
                left + 1.0,
                [-2.0, 1.2],
            ),
        ] {
            let h = h.replace('X', &shifted);
            let end = plane([&h, plus, minus], [start[0] + place, start[1]], t_end);
            let x = end.unwrap_or_else(|e| panic!("{h}: {e}")).x;
            let off = x - SVector::from([want[0] + place, want[1]]);
            assert!(off.amax() < 1e-8, "{h} {start:?}: {x}");
        }
    }
}

/// Around |x - 100| + |y| = 1 to the corner where sliding ends, and on: the end is that of the
/// engine for equations in the general form.
#[test]
fn a_corner_far_from_zero_is_passed() {
    let h = "abs(x - 100) + abs(y) - 1";
    let plus = "'-1.83 + 0.25*sin(x - 100)', '0.06 - 0.41*y + 0.16*sin(3*y)'";
    let minus = "'1.92 - 1.22*y - 0.21*sin(3*y) - 0.5*(x - 100)', '1.15 - 0.42*y + 0.24*sin(y)'";
    let x = plane_within(1e-8, [h, plus, minus], [100.85, -0.8], 10.0).unwrap().x;
    assert!((x[0] - 87.83763).abs() < 1e-5 && (x[1] - 0.551752).abs() < 1e-6, "{x}");
}

/// A hop beside an invisible fold that is lower than the rounding of h, and one that is not.
#[test]
fn hops_that_rounding_hides_are_landings() {
    for place in [0, 1, 100] {
        let h = format!("x - {place}");
        for power in 3..11 {
            let beside = (0..power).fold(1.0, |ten, _| 0.1 * ten);
            let start = [f64::from(place) - 1.0, beside];
            let end = plane([&h, "'y', '-1'", "'1', '0'"], start, 2.0);
            let end = end.unwrap_or_else(|e| panic!("{h} {beside:e}: {e}"));
            // Filippov's y' = q/(q - p) with p = y, q = 1: y - y^2/2 falls by one a unit of time.
            let left = 1.0 - 2.0 * beside;
            let want = 1.0 - (1.0 + 2.0 * (beside + 0.5 * beside * beside + left)).sqrt();
            assert!((end.x[1] - want).abs() < 1e-6, "{h} {beside:e}: {} for {want}", end.x);
        }
    }
}

/// Starts on the surface: at rest where one field is zero and the other one leads there; not
/// decided where it leads away.
#[test]
fn rests_on_the_surface_are_seen_at_the_start() {
    for (plus, minus) in [("'-1', '0'", "'-x', '0'"), ("'4*x', '0'", "'2', '0'")] {
        let end =
            plane(["x", plus, minus], [0.0, 0.0], 3.0).unwrap_or_else(|e| panic!("{plus} {e}"));
        assert_eq!(end.x, SVector::from([0.0, 0.0]));
    }
    for (plus, minus) in [("'1', '0'", "'x', '0'"), ("'1', '0'", "'0*x', '-1'")] {
        let end = plane(["x", plus, minus], [0.0, 0.0], 3.0);
        assert!(matches!(end, Err(FilippovError::Undecided { .. })), "{plus} {minus} {end:?}");
    }
}

/// A tank that empties by the root of its level stays empty, whatever moves beside it: the level
/// x - c is (1 - t/2)^2 until t = 2.
#[test]
fn an_empty_tank_stays_empty_beside_what_moves() {
    for c in [0.0, 0.3, 1.0, 20.0] {
        let root = format!("sqrt(abs(x - {c}))");
        let outer = format!("sqrt({c} - x)");
        for (moves, want) in [
            ("1", 0.5 + 5.0),
            ("-1", 0.5 - 5.0),
            ("y", 0.5 * 5.0_f64.exp()),
            ("1 - y", 1.0 - 0.5 * (-5.0_f64).exp()),
            ("-0.1*y", 0.5 * (-0.5_f64).exp()),
        ] {
            for minus in [&root, &outer, "0"] {
                let [down, up] = [format!("'-{root}', '{moves}'"), format!("'{minus}', '{moves}'")];
                let h = format!("x - {c}");
                let end = plane_within(1e-9, [&h, &down, &up], [c + 1.0, 0.5], 5.0)
                    .unwrap_or_else(|e| panic!("{h} {down} {up}: {e}"));
                let off = [(end.x[0] - c).abs(), (end.x[1] - want).abs() / want.abs()];
                assert!(off[0] < 1e-12 && off[1] < 1e-6, "{h} {down} {up}: {}", end.x);
            }
        }
    }
    // On the surface from the start; and where the fields differ along it nothing says how fast.
    let at = |faces: [&str; 2]| plane(["x", faces[0], faces[1]], [0.0, 0.5], 3.0);
    let end = at(["'-sqrt(abs(x))', '1'", "'sqrt(abs(x))', '1'"]).unwrap();
    assert!(end.x[0] == 0.0 && (end.x[1] - 3.5).abs() < 1e-9, "{}", end.x);
    assert!(at(["'sqrt(abs(x))', '1'", "'-sqrt(abs(x))', '1'"]).is_err());
    assert!(at(["'-sqrt(abs(x))', '1'", "'sqrt(abs(x))', '2'"]).is_err());
}

/// Two tanks, the upper one into the lower one: x empties at t = 8, and y, from the level y(8) that
/// a run until then has, 10 sqrt(y(8)) later. There the domain of sqrt(y) ends.
#[test]
fn sliding_rests_where_the_root_of_another_state_ends() {
    let faces = ["x", "'-0.5*sqrt(x)', '0.5*sqrt(x) - 0.2*sqrt(y)'", "'0', '-0.2*sqrt(y)'"];
    for tolerance in [1e-6, 1e-8, 1e-10] {
        let level = plane_within(tolerance, faces, [4.0, 2.0], 10.0).unwrap().x[1];
        let before = 10.0 + 10.0 * level.sqrt() - 1.0;
        let end = plane_within(tolerance, faces, [4.0, 2.0], before).unwrap();
        assert!((end.x[1] - 0.01).abs() < 1e3 * tolerance, "{}", end.x);
        let end = plane_within(tolerance, faces, [4.0, 2.0], 60.0).unwrap();
        assert!(end.t == 60.0 && end.x[0] == 0.0 && end.x[1].abs() < 1e-20, "{}", end.x);
    }
    // A state that still moves at the end of a domain does not rest.
    let faces = ["x", "'-1', '-0.2*sqrt(y) - 0.01'", "'1', '-0.2*sqrt(y) - 0.01'"];
    assert!(plane(faces, [1.0, 2.0], 60.0).is_err());
}

/// Super-twisting, x' = y - a sqrt(|x - c|) sign(x - c), y' = -b sign(x - c): it comes to (c, 0) in
/// finite time and stays there.
#[test]
fn super_twisting_comes_to_rest_at_any_target() {
    for (a, b) in [(1.5, 1.1), (3.0, 1.1), (2.0, 1.5)] {
        for c in [0.0, 0.1, 1.0, 2.0, 20.0, 1000.0] {
            // The root of the rounding of x - c, and the share of the speed that is none.
            let known = a * (64.0 * f64::EPSILON * c).sqrt() + 1e-7 * a;
            for from in [1.0, 1e-2, 3e-3, 1e-3, -0.7] {
                let root = format!("{a}*sqrt(abs(x - {c}))");
                let [down, up] = [format!("'y - {root}', '-{b}'"), format!("'y + {root}', '{b}'")];
                for tolerance in [1e-8, 1e-10] {
                    let (h, start) = (format!("x - {c}"), [c + from, 0.0]);
                    let end = plane_within(tolerance, [&h, &down, &up], start, 30.0)
                        .unwrap_or_else(|e| panic!("{tolerance} {h} {down} {from}: {e}"));
                    let off = (end.x[0] - c).abs().max(end.x[1].abs());
                    assert!(off < known, "{tolerance} {h} {down} {from}: {}", end.x);
                }
            }
        }
    }
}

/// Super-twisting beside a state that moves: from the accumulation of the crossings on, x and y
/// stay at zero, and z goes on with the common velocity, or with the mean of both.
#[test]
fn what_stands_beside_super_twisting_goes_on() {
    for (plus, minus, want) in [
        ("1", "1", 0.5 + 4.0),
        ("1 - z", "1 - z", 1.0 - 0.5 * (-4.0_f64).exp()),
        ("2*z", "2*z", 0.5 * 8.0_f64.exp()),
        ("-z", "-z", 0.5 * (-4.0_f64).exp()),
        // z' = 2 + y'/1.1.
        ("1", "3", 0.5 + 8.0),
    ] {
        let [down, up] = [("-", plus), ("+", minus)].map(|(sign, moves)| {
            let y = if sign == "-" { "-1.1" } else { "1.1" };
            format!("['y {sign} 1.5*sqrt(abs(x))', '{y}', '{moves}']")
        });
        let text = format!(
            "states = ['x', 'y', 'z']\nstart = [1, 0, 0]\nh = 'x'\nplus = {down}\nminus = {up}"
        );
        let text = twofold_system::Definition::from_toml(&text, "").unwrap();
        let bound: Bound<3> = System::new(text).bind().unwrap();
        let settings = FilippovOptions::default();
        let mut seen = Trajectory::new(1);
        let start = Vector3::new(1.0, 0.0, 0.5);
        let end = run(&bound, start, 4.0, &settings, ExitRule::Undecided, &mut seen);
        let end = end.unwrap_or_else(|e| panic!("{plus}: {e}"));
        let off = (end.x[2] - want).abs() / want;
        assert!(end.x[0] == 0.0 && end.x[1].abs() < 1e-7 && off < 1e-6, "{plus}: {}", end.x);
    }
}

/// Where a piece of the motion becomes stiff another method goes on from there, and not from the
/// piece's beginning: in flight and in sliding.
#[test]
fn a_piece_that_becomes_stiff_goes_on() {
    for [h, plus, minus] in [
        ["y^2 - 1.1", "'-x', '-50*(y - 1.2)'", "'-x', '1'"],
        ["x + y - 2", "'-1 - x', '-50*(y - 1.2)'", "'3 - x', '-50*(y - 1.2)'"],
    ] {
        let text = format!(
            "states = ['x', 'y']\nstart = [0, 0]\nh = '{h}'\nplus = [{plus}]\nminus = [{minus}]"
        );
        let text = twofold_system::Definition::from_toml(&text, "").unwrap();
        let bound: Bound<2> = System::new(text).bind().unwrap();
        let mut seen = Trajectory::new(1);
        let settings = FilippovOptions::default();
        let start = SVector::from([1.0, 1.3]);
        let end = run(&bound, start, 60.0, &settings, ExitRule::Undecided, &mut seen).unwrap();
        assert!((end.x[1] - 1.2).abs() < 1e-6, "{}", end.x);
        let points = seen.pieces.iter().flat_map(|piece| &piece.points);
        let times: Vec<f64> = points.map(|point| point.0).collect();
        assert!(times.windows(2).all(|t| t[0] <= t[1]), "{h}: {times:?}");
    }
}

/// h that jumps, has a pole, or has no slope where it comes to zero.
#[test]
fn a_switching_function_without_a_simple_zero_is_named() {
    let crossing = |h: &str| plane([h, "'1', 'x'", "'0.5', '1'"], [-2.0, 1.0], 6.0);
    let same = crossing("y").unwrap().x;
    for h in ["1e12*y", "1e-12*y", "tanh(y)", "y*exp(5*x)"] {
        assert!((crossing(h).unwrap().x - same).amax() < 1e-8, "{h}");
    }
    for h in ["y^3", "abs(y)*y", "sqrt(abs(y))*sign(y)"] {
        let end = crossing(h);
        assert!(matches!(end, Err(FilippovError::Slope { .. })), "{h}: {end:?}");
    }
    for end in [crossing("sign(y)"), plane(["tan(x)", "'1', '1'", "'1', '0'"], [0.0, 0.0], 3.0)] {
        assert!(matches!(end, Err(FilippovError::Jump { .. })), "{end:?}");
    }
}

/// States of sizes far apart in one h: each counts in its own unit. With X = x/P and Y = y P the
/// motion is the same for all P.
#[test]
fn states_of_any_sizes_share_a_switching_function() {
    let end = |power: i32| {
        let h = format!("1e-{power}*x - 0.27*sin(3e{power}*y)");
        let plus = format!("'-0.4e{power}', '0.1e-{power}'");
        let minus = format!("'0.8e{power}', '0.2e-{power}'");
        let [large, small] = [power, -power].map(|p| format!("1e{p}").parse::<f64>().unwrap());
        let end = plane([&h, &plus, &minus], [0.1 * large, small], 6.0);
        let x = end.unwrap_or_else(|e| panic!("{power}: {e}")).x;
        [x[0] / large, x[1] / small]
    };
    let want = end(0);
    for power in [3, 6, 9, 12] {
        let found = end(power);
        let off = (0..2).map(|i| (found[i] - want[i]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-8, "{power}: {found:?} {want:?}");
    }
}

/// A sign that attracts stops sliding at the motion's own time and state. From (0.5, 0) on the
/// surface x = 0 is reached at t = 0.5, and y = t.
#[test]
fn a_jump_that_holds_sliding_is_named_by_the_motion() {
    let end = plane(["x", "'-1', '-sign(y - 1)'", "'1', '-sign(y - 1)'"], [0.5, 0.0], 3.0);
    let Err(FilippovError::Stepping(Failure::StaysOnJump { t, state, what })) = end else {
        panic!("{end:?}")
    };
    assert!((t - 1.0).abs() < 1e-6 && (state[1] - 1.0).abs() < 1e-6, "{t} {state:?}");
    assert_eq!((state.len(), what.as_str()), (2, "sign(y - 1)"));
}

/// Fields that grow without bound towards the surface make no sliding motion; those that end there
/// do.
#[test]
fn sliding_needs_fields_with_values_on_the_surface() {
    for (field, named) in [("ln(x)", "ln(x)"), ("1/x", "1/x"), ("ln(x)*y", "ln(x)")] {
        let plus = format!("'-1', '{field}'");
        let end = plane(["x", &plus, "'1', '0'"], [0.5, 0.1], 3.0);
        let error = end.unwrap_err().to_string();
        let at = error.contains("t = 0.5") || error.contains("t = 0.49999999");
        assert!(error.contains(named) && at, "{error}");
    }
    // The area of the root, then half of nothing; a root's end costs half of a step's digits.
    let end = plane(["x", "'-1', 'sqrt(x)'", "'1', '0'"], [0.5, 0.0], 3.0).unwrap();
    assert!((end.x[1] - 2.0 / 3.0 * 0.5_f64.powf(1.5)).abs() < 1e-7, "{}", end.x);
    let end = plane(["x - 1", "'-1', 'ln(x)'", "'1', '1/x'"], [1.5, 0.0], 3.0).unwrap();
    assert!((end.x[1] - (1.5 * 1.5_f64.ln() - 0.5 + 1.25)).abs() < 1e-9, "{}", end.x);
}

/// Twisting control, x'' = -2 sgn(x) - sgn(x'): turns come together at x = 0, whatever the unit of
/// the states is against the tolerance. From (1, 0) it comes to x = 0 in the time sqrt(2) with that
/// speed; each half turn takes (1/3 + sqrt(1/3)) of the speed and leaves sqrt(1/3) of it.
#[test]
fn a_spiral_ends_at_any_tolerance() {
    let left = (1.0_f64 / 3.0).sqrt();
    let want = 2.0_f64.sqrt() * (1.0 + (1.0 / 3.0 + left) / (1.0 - left));
    for (unit, atol) in [(1.0, 1e-12), (1.0, 1e-14), (1e9, 1e-8), (1e-9, 1e-23), (1.0, 1e-20)] {
        let [one, three] = [1.0, 3.0].map(|v: f64| v * unit);
        let text = format!(
            "states = ['x', 'v']\nstart = [{unit:e}, 0]\nh = 'x'\nplus = ['v', '-{three:e}']\n\
             minus = ['v', '-{three:e} + 4*{one:e}']\n[second]\nh = 'v'\n\
             plus = ['v', '-{one:e}']\nminus = ['v', '{three:e}']"
        );
        let text = twofold_system::Definition::from_toml(&text, "").unwrap();
        let faces = System::new(text).faces().unwrap();
        let faces = faces.map(|pair| pair.map(|face| face.bind::<2>().unwrap()));
        let mut settings = FilippovOptions::default();
        settings.tolerance.atol = atol;
        let mut seen = Trajectory::new(1);
        let start = SVector::from([unit, 0.0]);
        let rule = ExitRule::Undecided;
        let end = run_two_surfaces(&faces, start, 20.0, &settings, rule, &mut seen, &())
            .unwrap_or_else(|e| panic!("{unit:e} {atol:e}: {e}"));
        assert!(end.x.amax() <= 1e-9 * unit, "{unit:e} {atol:e} {}", end.x);
        let last = seen.events.last().unwrap().t;
        assert!((last - want).abs() < 1e-6, "{unit:e} {atol:e} {last}");
    }
}
