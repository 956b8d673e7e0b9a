//! Premise of every hash that no source can state: the compiler carries out the arithmetic that is
//! written. Nothing fused, nothing reordered, no reciprocals for divisions, no subnormals flushed,
//! no intermediate results of more digits than f64 has (the x87 unit's habit). The idea of such a
//! test: REBOUND (Rein & Tamayo 2017).
#![allow(clippy::disallowed_methods)]
// the fused product is called to show that it differs
// a loop by index is one of the shapes that compilers like to turn into lanes
#![allow(clippy::needless_range_loop)]

use std::hint::black_box;

use nalgebra::{SVector, Vector3};
use twofold::num::{Arithmetic, DoubleDouble};

/// The next number above one.
const ABOVE: f64 = 1.0 + f64::EPSILON;
/// The one below.
const BELOW: f64 = 1.0 - f64::EPSILON / 2.0;

#[test]
fn products_and_sums_are_not_fused() {
    // (1 + u)(1 - u/2) = 1 + u/2 - u^2/2 rounds to 1 (a tie broken to even, less a little); a fused
    // operation would keep the rest.
    let (a, b) = (black_box(ABOVE), black_box(BELOW));
    assert_eq!((a * b - 1.0).to_bits(), 0.0_f64.to_bits());
    assert!(a.mul_add(b, -1.0) != 0.0, "the example tells fused from unfused");
    let c = black_box(-1.0);
    let separate = |a: f64, b: f64, c: f64| a * b + c;
    assert_eq!(separate(a, b, c), 0.0);
    // The same in the shapes in which the integrators compute: a vector plus a product, sums of
    // products.
    let (x, k) =
        (black_box(Vector3::new(-1.0, -1.0, -1.0)), black_box(Vector3::new(ABOVE, ABOVE, ABOVE)));
    assert_eq!(x + k * b, SVector::<f64, 3>::zeros());
    let mut sum = -1.0;
    for (a, b) in black_box([ABOVE, 0.0]).iter().zip(black_box([BELOW, 0.0])) {
        sum += a * b;
    }
    assert_eq!(sum, 0.0);
    let determinant = |a: f64, b: f64, c: f64, d: f64| a * b - c * d;
    assert_eq!(determinant(a, b, black_box(1.0), black_box(1.0)), 0.0);
}

#[test]
fn sums_and_products_keep_their_order() {
    let (big, one) = (black_box(1e16), black_box(1.0));
    assert_eq!((one + big) - big, 0.0);
    assert_eq!(one + (big - big), 1.0);
    let terms = black_box([1e16, 1.0, 1.0, 1.0, 1.0, -1e16, 1.0, 1.0]);
    assert_eq!(terms.iter().sum::<f64>(), 2.0, "in pairs or in lanes it would be another number");
    assert_eq!(terms.iter().fold(0.0, |s, t| s + t), 2.0);
    let mut by_index = 0.0;
    for i in 0..black_box(8) {
        by_index += terms[i];
    }
    assert_eq!(by_index, 2.0);
    let (x, y) = (black_box(1e200), black_box(1e-200));
    assert_eq!((x * x) * y, f64::INFINITY);
    assert_eq!(x * (x * y), 1e200);
    // Compensated arithmetic lives on what a careless compiler would simplify away.
    let (s, t) = (black_box(1.0), black_box(1e-17));
    let sum = s + t;
    assert_eq!((s - (sum - (sum - s))) + (t - (sum - s)), 1e-17);
    let third = DoubleDouble::from_f64(black_box(1.0)) / DoubleDouble::from_f64(black_box(3.0));
    assert!(third.low() != 0.0, "a double-double keeps its second half");
}

#[test]
fn divisions_are_divisions() {
    // x / 49 is not x * (1/49): 49 * (1/49) is below one.
    let d = black_box(49.0);
    assert_eq!(d / d, 1.0);
    assert_ne!(d * (1.0 / d), 1.0);
    let mut differ = 0;
    for i in 1..1000_u32 {
        let x = f64::from(black_box(i));
        differ += u32::from(x / d != x * (1.0 / d));
        assert_eq!((x / d).to_bits(), black_box(x / black_box(49.0)).to_bits());
    }
    assert!(differ > 10, "{differ}");
}

#[test]
fn no_number_is_flushed_or_widened() {
    let least = black_box(f64::MIN_POSITIVE);
    assert_eq!((least / 2.0).to_bits(), 1 << 51);
    assert_eq!(black_box(f64::from_bits(1)) * black_box(0.75), f64::from_bits(1));
    assert_eq!(
        black_box(f64::from_bits(3)) * black_box(0.5),
        f64::from_bits(2),
        "a tie goes to the even one"
    );
    // In 64 bits of mantissa and rounded again these come out otherwise (double rounding); in an
    // exponent of 15 bits nothing overflows.
    assert_eq!(black_box(1e16) + black_box(2.9999), 10_000_000_000_000_002.0);
    assert_eq!(black_box(f64::MAX) * black_box(2.0) / black_box(2.0), f64::INFINITY);
    assert_eq!(
        black_box(f64::MIN_POSITIVE)
            * black_box(f64::EPSILON / 2.0)
            * black_box(2.0 / f64::EPSILON),
        0.0
    );
}

#[test]
fn square_roots_are_correctly_rounded() {
    use twofold::num::elementary::sqrt;
    for i in 0..2000_u32 {
        let x = black_box(1.0 + f64::from(i) * 0.731_058_578);
        let root = sqrt(x);
        assert_eq!(root.to_bits(), x.sqrt().to_bits());
        // |root - exact| <= half a unit: the neighbours' squares enclose x.
        let (below, above) =
            (f64::from_bits(root.to_bits() - 1), f64::from_bits(root.to_bits() + 1));
        assert!((below + root) / 2.0 * ((below + root) / 2.0) <= x * (1.0 + 1e-15));
        assert!((above + root) / 2.0 * ((above + root) / 2.0) >= x * (1.0 - 1e-15));
    }
}
