//! The theorems' machinery on the paper's equation. The theorems themselves are in proofs/ (`make proofs`).

use nalgebra::SVector;
use twofold::num::{Arithmetic, Ball, Enclosure, FromDecimal, Interval};
use twofold::rigor::cycle::{Search, krawczyk};
use twofold::rigor::{Cycle, Error, Flow, Plane, Set, Settings, prove_cycle};
use twofold::system::{Caricature, Smoothed, Transition, VectorField};

const SECTION: Plane = Plane { axis: 1, value: 0.0 };

fn equation(alpha: f64) -> Smoothed<Caricature> {
    Smoothed { system: Caricature::with_reinjection(alpha, 1e-5), transition: Transition::Tanh, eps: 1e-3 }
}

fn prove(near: [f64; 2], radius: f64, crossings: usize) -> Result<Cycle, Error> {
    let search = Search { plane: SECTION, near, radius, crossings, longest: 40.0 };
    prove_cycle(&equation(0.1).tape(), Settings::PLAIN, &search)
}

#[test]
fn the_period_one_orbit_is_proved_and_attracts() {
    let c = prove([0.8063, 0.0], 1e-10, 2).unwrap();
    assert!(c.attracts());
    // 2.5766e-5 per unit of time (an independent program): det = exp(-2 rate period).
    let rate = -c.determinant.midpoint().ln() / (2.0 * c.period.midpoint());
    assert!((rate - 2.5766e-5).abs() < 1e-9, "{rate:e}");
    assert!(c.point.iter().all(|x| x.width() < 1e-12), "{:?}", c.point);
    assert!(c.determinant.width() < 1e-6 && c.trace.width() < 1e-6);
    // The other crossing of the turn, where SCIENCE has it.
    assert!(!c.crossings[0].2 && (c.crossings[0].1[0].midpoint() + 0.67).abs() < 0.01, "{:?}", c.crossings);
}

#[test]
fn what_is_not_so_is_not_proved() {
    // No orbit closes after one crossing: the first is downward.
    assert!(matches!(prove([0.8063, 0.0], 1e-10, 1), Err(Error::WrongDirection(_))));
    // A box smaller than the enclosure's own width cannot hold its image.
    assert!(matches!(prove([0.8063, 0.0], 1e-15, 2), Err(Error::NotIncluded { .. })));
    // A box over which the derivative is not known well enough.
    assert!(prove([0.8063, 0.0], 1e-2, 2).is_err());
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
    let (image, inside) = at(0.3);
    assert!(inside && image[0].contains(0.25) && image[0].width() < 1e-15, "{image:?}");
    assert!(!at(0.4).1 && !at(0.1).1);
}

/// The first rows of a reference table, in one arithmetic: (the widest enclosure, whether every row is in its own).
fn follow<S: Enclosure>(alpha: f64, text: &str, rows: usize, settings: Settings) -> f64 {
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
        for (got, want) in [(crossing.time, fields[0]), (states[0], fields[1]), (states[2], fields[2])] {
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
    let printed = include_str!("data/crossings-printed.csv");
    let reconstructed = include_str!("data/crossings-reconstructed.csv");
    for (alpha, text) in [(1e-3, printed), (0.1, reconstructed)] {
        let plain = follow::<Interval>(alpha, text, 2, Settings::PLAIN);
        let extended = follow::<Ball>(alpha, text, 2, Settings::EXTENDED);
        assert!(plain < 1e-10 && extended < 1e-25, "{plain:e} {extended:e}");
    }
}

#[test]
#[ignore = "a minute; `make proofs` goes through all rows"]
fn the_orbit_is_enclosed_through_the_singularity() {
    let reconstructed = include_str!("data/crossings-reconstructed.csv");
    assert!(follow::<Ball>(0.1, reconstructed, 6, Settings::EXTENDED) < 1e-13);
}

#[test]
fn a_set_too_wide_is_refused() {
    let tape = equation(0.1).tape();
    let mut flow = Flow::<Interval, 3>::new(&tape, Settings::PLAIN);
    let wide = Interval::between(-0.5, 0.5);
    let set = Set::on_plane(SVector::from([wide, Interval::zero(), wide]), SECTION.axis, SECTION.value, false);
    let error = flow.next_crossing(&set, SECTION, 10.0).unwrap_err();
    assert!(matches!(error, Error::NoEnclosure { .. } | Error::NotTransversal { .. }), "{error}");
}
