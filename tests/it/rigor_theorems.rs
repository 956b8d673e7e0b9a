//! The theorems' machinery, on an equation whose answers are known and on the paper's. The theorems
//! themselves are in proofs/ (`make proofs`).
// std functions give expected values, compared with tolerances
#![allow(clippy::disallowed_methods)]

use nalgebra::SVector;
use twofold::num::tape::Recorded;
use twofold::num::{Arithmetic, Ball, Enclosure, Interval, Tape};
use twofold::rigor::cycle::{Search, krawczyk};
use twofold::rigor::{AxisPlane, Cycle, Error, Flow, FlowOptions, Set, prove_cycle};
use twofold::system::{Caricature, Smoothed, Transition, VectorField};

const SECTION: AxisPlane = AxisPlane { axis: 1, value: 0.0 };

fn equation(alpha: f64) -> Smoothed<Caricature> {
    Smoothed {
        system: Caricature::with_reinjection(alpha, 1e-5),
        transition: Transition::Tanh,
        eps: 1e-3,
    }
}

/// r' = r (1 - r^2)/10, angle' = 1, h' = -h/10: a closed orbit r = 1, h = 0 of period 2 pi with
/// multipliers exp(-4 pi/10) and exp(-2 pi/10). Coordinates x = r cos, y = r sin, h.
fn hopf() -> Tape {
    Tape::record(3, |v: &[Recorded]| {
        let (x, y, h) = (v[0], v[1], v[2]);
        let g = (Recorded::one() - x * x - y * y) / Recorded::from_f64(10.0);
        vec![g * x - y, g * y + x, -h / Recorded::from_f64(10.0)]
    })
}

fn search_hopf(near: [f64; 2], radius: f64, crossings: usize) -> Result<Cycle, Error> {
    prove_cycle(
        &hopf(),
        FlowOptions::PLAIN,
        &Search { plane: SECTION, near, radius, crossings, longest: 40.0 },
    )
}

#[test]
fn a_known_orbit_is_proved_with_its_multipliers() {
    use std::f64::consts::PI;
    let c = search_hopf([1.01, 0.02], 1e-6, 2).unwrap();
    assert!(c.attracts());
    assert!(c.point[0].contains(1.0) && c.point[1].contains(0.0), "{:?}", c.point);
    assert!(c.point.iter().all(|x| x.width() < 1e-13), "{:?}", c.point);
    assert!(c.period.contains(2.0 * PI) && c.period.width() < 1e-13, "{:?}", c.period);
    let (a, b) = ((-0.4 * PI).exp(), (-0.2 * PI).exp());
    for (got, want) in [(c.trace, a + b), (c.determinant, a * b)] {
        assert!(
            (got + Interval::symmetric(1e-15)).contains(want) && got.width() < 1e-12,
            "{got:?} {want}"
        );
    }
    assert_eq!(c.crossings.iter().map(|x| x.2).collect::<Vec<_>>(), [false, true]);
    assert!(c.crossings[0].0.contains(PI) && c.crossings[0].1[0].contains(-1.0));
}

#[test]
fn what_is_not_so_is_not_proved() {
    // No orbit closes after one crossing: the first is downward.
    assert!(matches!(search_hopf([1.0, 0.0], 1e-6, 1), Err(Error::WrongDirection(_))));
    // A box smaller than the enclosure's own width cannot hold its image.
    assert!(matches!(search_hopf([1.0, 0.0], 1e-17, 2), Err(Error::NotIncluded { .. })));
    // A box that holds more than the orbit's neighbourhood.
    assert!(search_hopf([1.0, 0.0], 0.9, 2).is_err());
    // Nothing crosses in so short a time.
    let mut flow = Flow::<Interval, 3>::new(&hopf(), FlowOptions::PLAIN);
    let start = Set::on_plane(
        SVector::from([1.0, 0.0, 0.0].map(Interval::from_f64)),
        SECTION.axis,
        SECTION.value,
        false,
    );
    assert!(matches!(flow.next_crossing(&start, SECTION, 3.0), Err(Error::NoCrossing(_))));
    assert!(flow.next_crossing(&start, SECTION, 3.2).is_ok());
}

#[test]
#[ignore = "a minute in the debug profile; `make proofs` proves it too"]
fn the_period_one_orbit_is_proved_and_attracts() {
    let search =
        Search { plane: SECTION, near: [0.8063, 0.0], radius: 1e-10, crossings: 2, longest: 40.0 };
    let c = prove_cycle(&equation(0.1).tape(), FlowOptions::PLAIN, &search).unwrap();
    assert!(c.attracts());
    // 2.5766e-5 per unit of time (an independent program): det = exp(-2 rate period).
    let rate = -c.determinant.midpoint().ln() / (2.0 * c.period.midpoint());
    assert!((rate - 2.5766e-5).abs() < 1e-9, "{rate:e}");
    assert!(c.point.iter().all(|x| x.width() < 1e-12), "{:?}", c.point);
    assert!(c.determinant.width() < 1e-6 && c.trace.width() < 1e-6);
}

#[test]
fn krawczyk_tells_a_zero_from_none() {
    // P(x) = x/2 + 1/8, twice: fixed point 1/4. (DP - 1)^-1 = -2.
    let p = Interval::from_f64;
    let half = [[p(0.5), p(0.0)], [p(0.0), p(0.5)]];
    let y = [[-2.0, 0.0], [0.0, -2.0]];
    let at = |centre: f64| {
        let candidate = [Interval::between(centre - 0.1, centre + 0.1); 2];
        let image = krawczyk(candidate, [centre; 2], [p(0.5 * centre + 0.125); 2], half, y);
        (image, image[0].interior(candidate[0]) && image[1].interior(candidate[1]))
    };
    let (image, inside) = at(0.3125);
    assert!(inside && image[0].contains(0.25) && image[0].width() < 1e-15, "{image:?}");
    assert!(!at(0.375).1 && !at(0.125).1);
}

/// The first rows of a reference table, in one arithmetic: (the widest enclosure, whether every row
/// is in its own).
fn follow<S: Enclosure>(alpha: f64, text: &str, rows: usize, settings: FlowOptions) -> f64 {
    let tape = equation(alpha).tape();
    let mut flow = Flow::<S, 3>::new(&tape, settings);
    let start = SVector::from([S::from_decimal(&0.2.into()), S::zero(), -S::one()]);
    let mut set = Set::on_plane(start, SECTION.axis, SECTION.value, false);
    let mut widest: f64 = 0.0;
    for line in text.lines().filter(|l| !l.starts_with('#') && !l.starts_with("t,")).take(rows) {
        let fields: Vec<&str> = line.split(',').collect();
        let crossing = flow.next_crossing(&set, SECTION, 1000.0).unwrap();
        set = crossing.set;
        let states = set.states();
        for (got, want) in
            [(crossing.time, fields[0]), (states[0], fields[1]), (states[2], fields[2])]
        {
            let want: f64 = want.parse().unwrap();
            let slack = Interval::symmetric(1e-15 + 2.0 * f64::EPSILON * want.abs());
            assert!((got.interval() + slack).contains(want), "{got:?} does not hold {want}");
        }
        assert_eq!(crossing.upward, fields[3] == "up");
        widest = widest.max(set.spread().iter().fold(0.0, |m: f64, x| m.max(x.width())));
    }
    widest
}

#[test]
fn both_arithmetics_enclose_the_orbit_before_the_singularity() {
    let printed = crate::common::CROSSINGS_PRINTED;
    let reconstructed = crate::common::CROSSINGS_RECONSTRUCTED;
    for (alpha, text) in [(1e-3, printed), (0.1, reconstructed)] {
        let plain = follow::<Interval>(alpha, text, 2, FlowOptions::PLAIN);
        let extended = follow::<Ball>(alpha, text, 2, FlowOptions::EXTENDED);
        assert!(plain < 1e-10 && extended < 1e-25, "{plain:e} {extended:e}");
    }
}

#[test]
#[ignore = "a minute; `make proofs` goes through all rows"]
fn the_orbit_is_enclosed_through_the_singularity() {
    let reconstructed = crate::common::CROSSINGS_RECONSTRUCTED;
    assert!(follow::<Ball>(0.1, reconstructed, 6, FlowOptions::EXTENDED) < 1e-13);
}

#[test]
fn a_set_too_wide_is_refused() {
    let tape = equation(0.1).tape();
    let mut flow = Flow::<Interval, 3>::new(&tape, FlowOptions::PLAIN);
    let wide = Interval::between(-0.5, 0.5);
    let set = Set::on_plane(
        SVector::from([wide, Interval::zero(), wide]),
        SECTION.axis,
        SECTION.value,
        false,
    );
    let error = flow.next_crossing(&set, SECTION, 10.0).unwrap_err();
    assert!(matches!(error, Error::NoEnclosure { .. } | Error::NotTransversal { .. }), "{error}");
}
