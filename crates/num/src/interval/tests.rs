use super::*;
use crate::DoubleDouble;

fn i(lower: f64, upper: f64) -> Interval {
    Interval::new(lower, upper).unwrap()
}

#[test]
fn bounds_move_only_when_inexact() {
    assert_eq!(i(1.0, 2.0) + i(0.5, 0.25 + 0.5), i(1.5, 2.75));
    assert_eq!(i(-3.0, 2.0) * i(5.0, 7.0), i(-21.0, 14.0));
    assert_eq!(i(1.0, 3.0) / i(2.0, 4.0), i(0.25, 1.5));
    assert_eq!(i(4.0, 9.0).sqrt(), i(2.0, 3.0));
    let third = Interval::one() / Interval::from_f64(3.0);
    assert_eq!(third.lower().next_up(), third.upper());
    assert!(third.lower() == 1.0 / 3.0 || third.upper() == 1.0 / 3.0);
    assert_eq!(i(-3.0, 2.0).squared(), i(0.0, 9.0));
}

#[test]
fn undefined_is_entire_and_stays_so() {
    let entire = [
        Interval::one() / i(-1.0, 1.0),
        Interval::one() / i(0.0, 1.0),
        Interval::zero() / Interval::zero(),
        i(-1.0, 4.0).sqrt(),
        i(-1.0, 1.0).sign(),
        Interval::from_f64(f64::NAN),
        Interval::from_f64(f64::INFINITY),
        Interval::ENTIRE * Interval::zero(),
        Interval::ENTIRE.tanh(),
        Interval::ENTIRE.exp(),
        Interval::ENTIRE.sin(),
        Interval::ENTIRE.sqrt(),
        Interval::ENTIRE.squared(),
        Interval::ENTIRE.sech_squared().unwrap(),
    ];
    for (k, e) in entire.into_iter().enumerate() {
        assert!(e.is_entire(), "{k}: {e:?}");
        assert!(!e.interior(Interval::ENTIRE));
    }
    assert!(matches!(i(0.0, 1.0).intersection(i(2.0, 3.0)), Err(Error::Disjoint(..))));
    assert!(Interval::new(1.0, 0.0).is_err() && Interval::new(f64::NAN, 1.0).is_err());
    assert!(Interval::new(f64::INFINITY, f64::INFINITY).is_err());
}

#[test]
fn overflow_keeps_a_finite_lower_bound() {
    let big = Interval::from_f64(f64::MAX);
    for sum in [big + big, big * big, big / Interval::from_f64(0.5)] {
        assert_eq!((sum.lower(), sum.upper()), (f64::MAX, f64::INFINITY));
    }
    let tiny = Interval::from_f64(5e-324);
    assert_eq!(tiny * tiny, i(0.0, 5e-324));
    assert_eq!(-tiny * tiny, i(-5e-324, 0.0));
    assert_eq!(Interval::from_f64(1000.0).exp().upper(), f64::INFINITY);
    assert!(Interval::from_f64(1000.0).exp().lower() >= 1e300);
    assert_eq!(Interval::from_f64(-1e9).exp().lower(), 0.0);
}

#[test]
fn decimals_are_enclosed_on_the_right_side() {
    let from = |x: f64| Interval::from_decimal(&x.into());
    // 0.1 lies below the f64 written so, 0.3 above; 1e-3 and 1e-5 as in the paper.
    assert_eq!(from(0.1), i(0.1_f64.next_down(), 0.1));
    assert_eq!(from(0.3), i(0.3, 0.3_f64.next_up()));
    assert_eq!(from(-0.3), i((-0.3_f64).next_down(), -0.3));
    for exact in [0.0, 0.5, -3.0, 1e15, 0.375, -1024.0] {
        assert_eq!(from(exact), i(exact, exact));
    }
    for near in [1e300, 1e-300, 5e-324, 1e22, 1e23] {
        assert!(from(near).contains(near));
    }
}

#[test]
fn sine_finds_its_extrema() {
    use std::f64::consts::PI;
    assert_eq!(i(1.0, 2.0).sin().upper(), 1.0);
    assert_eq!(i(4.0, 5.0).sin().lower(), -1.0);
    assert_eq!(i(-0.1, 0.1).cos().upper(), 1.0);
    assert_eq!(i(3.0, 3.2).cos().lower(), -1.0);
    assert!(i(0.1, 1.5).sin().upper() < 1.0 && i(2.0, 4.0).sin().lower() > -1.0);
    assert_eq!(i(0.0, 7.0).sin(), Interval::UNIT);
    // Far out nothing is said, however thin the argument; nearer it is.
    assert_eq!(
        (Interval::from_f64(2e9).sin(), Interval::from_f64(-2e9).cos()),
        (Interval::UNIT, Interval::UNIT)
    );
    assert!(Interval::from_f64(9e8).sin().width() < 1e-6);
    assert!(Interval::from_f64(PI).sin().contains(1.2246467991473532e-16));
    assert!(Interval::from_f64(PI).sin().width() < 1e-30);
}

#[test]
fn the_slope_of_tanh_keeps_its_digits() {
    // 1 - tanh(30)^2 is 3.5e-26: out of reach of 1 - t^2 in f64.
    let s = Interval::from_f64(30.0).sech_squared().unwrap();
    assert!(s.lower() > 0.0 && s.width() < 1e-15 * s.upper(), "{s:?}");
    assert!(
        s.contains(3.5026074410400614e-26) || (s.midpoint() / 3.5026e-26 - 1.0).abs() < 1e-4,
        "{s:?}"
    );
    assert_eq!(i(-1.0, 2.0).sech_squared().unwrap().upper(), 1.0);
    assert!(i(-1e300, 1e300).sech_squared().unwrap().lower() >= 0.0);
}

#[test]
fn places_sizes_and_sides() {
    let (up, down) = (i(1.0, f64::INFINITY), i(f64::NEG_INFINITY, 2.0));
    assert_eq!(
        (i(1.0, 3.0).midpoint(), i(-1.0, 4.0).midpoint(), i(-3.0, -1.0).midpoint()),
        (2.0, 1.5, -2.0)
    );
    assert_eq!((up.midpoint(), down.midpoint(), Interval::ENTIRE.midpoint()), (1.0, 2.0, 0.0));
    assert_eq!((i(1.0, 3.0).width(), i(-3.0, -1.5).width(), up.width()), (2.0, 1.5, f64::INFINITY));
    assert_eq!((i(-3.0, -1.0).magnitude(), i(-3.0, -1.0).mignitude()), (3.0, 1.0));
    assert_eq!((i(-1.0, 2.0).magnitude(), i(-1.0, 2.0).mignitude()), (2.0, 0.0));
    assert!(i(1.0, 3.0).is_bounded() && !up.is_bounded() && !down.is_bounded());
    for (a, positive, negative) in [
        (i(1.0, 2.0), true, false),
        (i(0.0, 1.0), false, false),
        (i(-1.0, 0.0), false, false),
        (i(-1.0, 1.0), false, false),
        (i(-2.0, -1.0), false, true),
    ] {
        assert_eq!((a.is_positive(), a.is_negative()), (positive, negative), "{a:?}");
    }
    for (other, subset, interior) in [
        (i(0.0, 4.0), true, true),
        (i(1.0, 4.0), true, false),
        (i(0.0, 3.0), true, false),
        (i(1.0, 3.0), true, false),
        (i(2.0, 4.0), false, false),
        (i(0.0, 2.0), false, false),
    ] {
        assert_eq!(
            (i(1.0, 3.0).subset(other), i(1.0, 3.0).interior(other)),
            (subset, interior),
            "{other:?}"
        );
    }
    assert_eq!(format!("{:?}", i(-0.5, 1.0)), "[-0.5, 1.0]");
    let (c, rest) = i(1.0, 4.0).split();
    assert_eq!((c, rest), (i(2.5, 2.5), i(-1.5, 1.5)));
}

/// Sums, products and quotients of whole numbers: exactly the extremes over the ends.
#[test]
fn every_case_of_signs() {
    let ends: Vec<Interval> =
        (-3..=3).flat_map(|a| (a..=3).map(move |b| i(f64::from(a), f64::from(b)))).collect();
    for a in &ends {
        for b in &ends {
            let all = |f: fn(f64, f64) -> f64| {
                let v = [
                    f(a.lower, b.lower),
                    f(a.lower, b.upper),
                    f(a.upper, b.lower),
                    f(a.upper, b.upper),
                ];
                i(
                    v.into_iter().fold(f64::INFINITY, f64::min),
                    v.into_iter().fold(f64::NEG_INFINITY, f64::max),
                )
            };
            assert_eq!(*a * *b, all(|x, y| x * y), "{a:?} times {b:?}");
            assert_eq!(*a - *b, all(|x, y| x - y), "{a:?} minus {b:?}");
            let (mut sum, mut difference) = (*a, *a);
            sum += *b;
            difference -= *b;
            assert_eq!((sum, difference), (*a + *b, *a - *b));
            // Halves are exact, thirds are between neighbours.
            let quotient = *a / *b;
            if b.contains(0.0) {
                assert!(quotient.is_entire());
            } else {
                let near = all(|x, y| x / y);
                let tight = |bound: f64, rounded: f64, out: f64| bound == rounded || bound == out;
                assert!(
                    tight(quotient.lower, near.lower, near.lower.next_down()),
                    "{a:?} by {b:?}: {quotient:?}"
                );
                assert!(
                    tight(quotient.upper, near.upper, near.upper.next_up()),
                    "{a:?} by {b:?}: {quotient:?}"
                );
                let back = quotient * *b;
                assert!(a.subset(back), "{a:?} by {b:?}, and back: {back:?}");
            }
        }
    }
    let (one, three) = (Interval::one(), Interval::from_f64(3.0));
    assert_eq!(one / three, i(1.0 / 3.0, (1.0_f64 / 3.0).next_up()));
    assert_eq!((one + one) / three, i(2.0 / 3.0, (2.0_f64 / 3.0).next_up()));
    assert_eq!(-one / three, i((-1.0_f64 / 3.0).next_down(), -1.0 / 3.0));
    assert_eq!(i(-2.0, -1.0).sign(), -one);
    assert_eq!((i(0.0, 1.0).sign(), i(1.0, 2.0).sign()), (one, one));
    assert!(i(-1.0, 0.0).sign().is_entire());
    assert!(i(0.0, 1.0).ln().is_entire() && i(0.0, 4.0).sqrt() == i(0.0, 2.0));
}

/// 0.1 + 0.2 and its like: the bounds are the neighbours of the exact sum, product and root.
#[test]
fn rounded_bounds_enclose_and_are_neighbours() {
    let point = Interval::from_f64;
    for (a, b) in [
        (0.1, 0.2),
        (0.1, 0.7),
        (1.0, 1e-20),
        (1.0, -1e-20),
        (-0.1, -0.2),
        (-0.1, 0.7),
        (3.3, -1e10),
        (1e10, 0.3),
    ] {
        let sum = point(a) + point(b);
        let exact = DoubleDouble::from_f64(a) + DoubleDouble::from_f64(b);
        assert!(
            DoubleDouble::from_f64(sum.lower) <= exact
                && exact <= DoubleDouble::from_f64(sum.upper),
            "{a} {b}"
        );
        assert_eq!(sum.lower.next_up(), sum.upper, "{a} + {b}");
        let product = point(a) * point(b);
        let exact = DoubleDouble::from_f64(a) * DoubleDouble::from_f64(b);
        assert!(
            DoubleDouble::from_f64(product.lower) <= exact
                && exact <= DoubleDouble::from_f64(product.upper)
        );
        assert!(
            product.lower == product.upper || product.lower.next_up() == product.upper,
            "{a} * {b}"
        );
    }
    for x in [2.0, 3.0, 0.1, 7.7, 1e10, 0.7] {
        let root = point(x).sqrt();
        let square = |r: f64| DoubleDouble::from_f64(r) * DoubleDouble::from_f64(r);
        assert!(
            square(root.lower) <= DoubleDouble::from_f64(x)
                && DoubleDouble::from_f64(x) <= square(root.upper),
            "{x}"
        );
        assert!(
            root.lower == root.upper || root.lower.next_up() == root.upper,
            "root of {x}: {root:?}"
        );
    }
}

/// At points: the double-double value is inside, and the bounds are not far.
#[test]
fn functions_enclose_tightly() {
    type Function = (fn(Interval) -> Interval, fn(DoubleDouble) -> DoubleDouble);
    let functions: [Function; 8] = [
        (Elementary::tanh, Elementary::tanh),
        (Elementary::exp, Elementary::exp),
        (Elementary::sin, Elementary::sin),
        (Elementary::cos, Elementary::cos),
        (Elementary::atan, Elementary::atan),
        (Elementary::erf, Elementary::erf),
        (|v| v.squared().sqrt(), Elementary::abs),
        (|v| v.squared().ln(), |v| (v * v).ln()),
    ];
    for x in [1e-70, 1e-20, 1e-3, 0.1, 0.3, 0.9, 2.5, 10.0, 36.0, 310.0] {
        for x in [x, -x] {
            for (n, (f, extended)) in functions.iter().enumerate() {
                let (got, exact) = (f(Interval::from_f64(x)), extended(DoubleDouble::from_f64(x)));
                let wide = |v: f64, by: f64| v + by * 1e-29 * v.abs();
                let inside = got.lower <= wide(exact.high(), 1.0).next_up()
                    && got.upper >= wide(exact.high(), -1.0).next_down();
                assert!(inside, "function {n} at {x}: {got:?} without {exact:?}");
                assert!(
                    got.width() <= 4.0 * f64::EPSILON * got.magnitude() + 1e-250,
                    "function {n} at {x}: {got:?}"
                );
            }
        }
    }
    let (most, least) = (i(-f64::MAX, f64::INFINITY), i(f64::NEG_INFINITY, 0.0));
    assert_eq!((most.tanh(), most.erf(), least.exp().lower), (Interval::UNIT, Interval::UNIT, 0.0));
    assert_eq!(most.atan().upper, std::f64::consts::FRAC_PI_2.next_up());
    let log = i(1.0, f64::INFINITY).ln();
    assert!(log.lower <= 0.0 && log.lower > -1e-29 && log.upper == f64::INFINITY, "{log:?}");
    assert_eq!(i(1.0, f64::INFINITY).sqrt(), i(1.0, f64::INFINITY));
    let slope = Dual::<Interval, 1>::variable(Interval::from_f64(0.5), 0).sech_squared().unwrap();
    let (t, want) = (0.46211715726000973, -0.726_862);
    assert!(
        slope.value.contains(1.0 - t * t) || (slope.value.midpoint() - (1.0 - t * t)).abs() < 1e-15
    );
    assert!(
        (slope.partials[0].midpoint() - want).abs() < 1e-5,
        "-2 t (1 - t^2): {:?}",
        slope.partials[0]
    );
}
