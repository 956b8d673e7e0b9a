//! Interval and ball arithmetic against exact numbers.
//!
//! The oracle is integer arithmetic: an `f64` is m 2^e, sums and products of such numbers are such
//! numbers, quotients and roots are checked by multiplying out, and the elementary functions are
//! summed as 512-bit fixed-point series. Nothing here shares a line with what it tests.
#![allow(clippy::disallowed_methods)] // powi makes test arguments, not results

use num_bigint::{BigInt, Sign};
use proptest::prelude::*;
use std::cmp::Ordering;
use twofold::num::interval_extended::Ball;
use twofold::num::{Arithmetic, DoubleDouble, Elementary, FromDecimal, Interval};

/// m 2^e.
#[derive(Clone, Debug)]
struct Dyadic {
    m: BigInt,
    e: i64,
}

impl Dyadic {
    fn of(x: f64) -> Self {
        assert!(x.is_finite(), "{x}");
        let bits = x.to_bits();
        let exponent = ((bits >> 52) & 0x7ff) as i64;
        let fraction = (bits & ((1 << 52) - 1)) as i64;
        let m = if exponent == 0 { fraction } else { fraction | 1 << 52 };
        Self { m: BigInt::from(if x < 0.0 { -m } else { m }), e: exponent.max(1) - 1075 }
    }
    fn of_dd(x: DoubleDouble) -> Self {
        Self::of(x.high()).plus(&Self::of(x.low()))
    }
    fn aligned(&self, other: &Self) -> (BigInt, BigInt, i64) {
        let e = self.e.min(other.e);
        (&self.m << (self.e - e) as usize, &other.m << (other.e - e) as usize, e)
    }
    fn plus(&self, other: &Self) -> Self {
        let (a, b, e) = self.aligned(other);
        Self { m: a + b, e }
    }
    fn times(&self, other: &Self) -> Self {
        Self { m: &self.m * &other.m, e: self.e + other.e }
    }
    fn negative(&self) -> Self {
        Self { m: -&self.m, e: self.e }
    }
    fn cmp(&self, other: &Self) -> Ordering {
        let (a, b, _) = self.aligned(other);
        a.cmp(&b)
    }
    fn sign(&self) -> Ordering {
        match self.m.sign() {
            Sign::Minus => Ordering::Less,
            Sign::NoSign => Ordering::Equal,
            Sign::Plus => Ordering::Greater,
        }
    }
    /// sign(self/b - x)
    fn quotient_against(&self, b: &Self, x: f64) -> Ordering {
        let rest = self.plus(&b.times(&Self::of(x)).negative()).sign();
        if b.sign() == Ordering::Less { rest.reverse() } else { rest }
    }
    /// floor(self 2^bits)
    fn fixed(&self, bits: i64) -> BigInt {
        let shift = self.e + bits;
        if shift >= 0 { &self.m << shift as usize } else { &self.m >> (-shift) as usize }
    }
}

/// A bound against an exact value: `sign(x)` says how the exact value compares with x.
fn lower_ok(lower: f64, exact: impl Fn(f64) -> Ordering, tight: bool) -> bool {
    if lower == f64::NEG_INFINITY {
        return !tight;
    }
    exact(lower) != Ordering::Less
        && (!tight || lower == f64::MAX || exact(lower.next_up()) == Ordering::Less)
}

fn upper_ok(upper: f64, exact: impl Fn(f64) -> Ordering, tight: bool) -> bool {
    if upper == f64::INFINITY {
        return !tight;
    }
    exact(upper) != Ordering::Greater
        && (!tight || upper == f64::MIN || exact(upper.next_down()) == Ordering::Greater)
}

#[track_caller]
fn holds(got: Interval, tight: bool, what: &str, exact: impl Fn(f64) -> Ordering) {
    assert!(
        lower_ok(got.lower(), &exact, tight) && upper_ok(got.upper(), &exact, tight),
        "{what}: {got:?} does not hold the exact result{}",
        if tight { " tightly" } else { "" }
    );
}

/// SplitMix64 (Steele, Lea & Flood 2014).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// Numbers that break arithmetic: any bit pattern, few bits, neighbours of powers of two, equal
    /// exponents, ends of the range.
    fn hard(&mut self) -> f64 {
        const SPECIAL: [f64; 14] = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            0.1,
            1.0 / 3.0,
            5e-324,
            -5e-324,
            f64::MIN_POSITIVE,
            f64::MAX,
            f64::MIN,
            1e300,
            1e-300,
            3.0,
        ];
        let b = self.bits();
        let sign = b & 1 << 63;
        let x = match b % 8 {
            0 => f64::from_bits(self.bits()),
            1 => SPECIAL[(self.bits() % SPECIAL.len() as u64) as usize],
            // A power of two, or next to one.
            2 => f64::from_bits(
                ((self.bits() % 2045 + 1) << 52).wrapping_add(self.bits() % 3).wrapping_sub(1),
            ),
            // Few significant bits: exact results are frequent.
            3 => f64::from_bits(
                (1023 - 8 + self.bits() % 16) << 52 | (self.bits() >> 12 & 0x000f_ffff_0000_0000),
            ),
            // Near the ends of what Dekker's product takes.
            4 => f64::from_bits((1023 - 470 + self.bits() % 40) << 52 | self.bits() >> 12),
            5 => f64::from_bits((1023 + 480 + self.bits() % 60) << 52 | self.bits() >> 12),
            _ => f64::from_bits((1023 - 3 + self.bits() % 6) << 52 | self.bits() >> 12),
        };
        let x = f64::from_bits(x.to_bits() ^ sign);
        if x.is_finite() { x } else { 1.5 }
    }
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
    /// A double-double with both parts in use.
    fn extended(&mut self) -> DoubleDouble {
        let x = self.hard().clamp(-1e100, 1e100);
        let x = if x.abs() < 1e-100 { 1.0 } else { x };
        DoubleDouble::new(x, x * self.uniform(-1.0, 1.0) * f64::EPSILON * 0.5)
    }
}

const SMALL: f64 = 1e-270;
const LARGE: f64 = 1e300;

fn usual(x: f64) -> bool {
    (SMALL..LARGE).contains(&x.abs())
}

fn point(x: f64) -> Interval {
    Interval::from_f64(x)
}

fn operations_against_exact_numbers(rounds: u64, seed: u64) {
    let mut random = Random(seed);
    let mut exact_results = 0;
    for _ in 0..rounds {
        let (a, b) = (random.hard(), random.hard());
        let (x, y) = (Dyadic::of(a), Dyadic::of(b));
        let sum = x.plus(&y);
        let got = point(a) + point(b);
        // Always the best bounds, but next to the end of the range.
        let tight = a.abs() < LARGE && b.abs() < LARGE;
        holds(got, tight, &format!("{a:e} + {b:e}"), |v| sum.cmp(&Dyadic::of(v)));
        exact_results += u64::from(got.lower() == got.upper());
        let difference = x.plus(&y.negative());
        let got = point(a) - point(b);
        holds(got, tight, &format!("{a:e} - {b:e}"), |v| difference.cmp(&Dyadic::of(v)));
        let product = x.times(&y);
        let got = point(a) * point(b);
        holds(got, usual(a * b) && usual(a) && usual(b), &format!("{a:e} * {b:e}"), |v| {
            product.cmp(&Dyadic::of(v))
        });
        exact_results += u64::from(got.lower() == got.upper());
        let got = point(a) / point(b);
        if b == 0.0 {
            assert!(got.is_entire());
        } else {
            let tight = usual(a / b) && usual(a) && usual(b);
            holds(got, tight, &format!("{a:e} / {b:e}"), |v| x.quotient_against(&y, v));
        }
        let a = a.abs();
        let x = Dyadic::of(a);
        holds(point(a).sqrt(), usual(a), &format!("sqrt {a:e}"), |v| {
            if v < 0.0 { Ordering::Greater } else { x.cmp(&Dyadic::of(v).times(&Dyadic::of(v))) }
        });
        let square = x.times(&x);
        holds(point(a).squared(), usual(a * a) && usual(a), &format!("{a:e} squared"), |v| {
            square.cmp(&Dyadic::of(v))
        });
    }
    // The hard numbers do reach exact results, where bounds must not move.
    assert!(exact_results > rounds / 20, "{exact_results} exact results in {rounds} rounds");
}

#[test]
fn operations_hold_the_exact_result_and_are_tight() {
    operations_against_exact_numbers(20_000, 1);
}

#[test]
#[ignore = "minutes: run by `make rigor-test`"]
fn millions_of_operations_hold_the_exact_result() {
    operations_against_exact_numbers(4_000_000, 2);
}

/// Whether |exact - midpoint| <= radius, `exact` given by its distance from the midpoint times
/// `by`: |distance| <= radius |by|.
fn within(distance: &Dyadic, radius: f64, by: &Dyadic) -> bool {
    if radius.is_infinite() {
        return true;
    }
    let bound = Dyadic::of(radius).times(by);
    let absolute = |d: &Dyadic| if d.sign() == Ordering::Less { d.negative() } else { d.clone() };
    absolute(distance).cmp(&absolute(&bound)) != Ordering::Greater
}

fn balls_against_exact_numbers(rounds: u64, seed: u64) {
    let mut random = Random(seed);
    let one = Dyadic::of(1.0);
    for _ in 0..rounds {
        let (a, b) = (random.extended(), random.extended());
        let (x, y) = (Dyadic::of_dd(a), Dyadic::of_dd(b));
        let (p, q) = (Ball::new(a, 0.0), Ball::new(b, 0.0));
        let check = |got: Ball, exact: Dyadic, by: &Dyadic, what: &str| {
            // (exact - midpoint by), by being what the quotient was multiplied with.
            let distance = exact.plus(&Dyadic::of_dd(got.midpoint()).times(by).negative());
            assert!(within(&distance, got.radius(), by), "{what} of {a:?} and {b:?}: {got:?}");
            assert!(
                got.is_entire() || got.radius() <= 2e-31 * got.midpoint().high().abs() + 1e-300,
                "{what} of {a:?} and {b:?} is too wide: {got:?}"
            );
        };
        check(p + q, x.plus(&y), &one, "sum");
        check(p - q, x.plus(&y.negative()), &one, "difference");
        check(p * q, x.times(&y), &one, "product");
        check(p / q, x.clone(), &y, "quotient");
        // A root lies within r of s if (s - r)^2 <= a <= (s + r)^2.
        let positive = if a.high() < 0.0 { -a } else { a };
        let root = Ball::new(positive, 0.0).sqrt();
        let (s, r, v) =
            (Dyadic::of_dd(root.midpoint()), Dyadic::of(root.radius()), Dyadic::of_dd(positive));
        let (low, high) = (s.plus(&r.negative()), s.plus(&r));
        assert!(
            low.times(&low).cmp(&v) != Ordering::Greater
                && v.cmp(&high.times(&high)) != Ordering::Greater,
            "{root:?}"
        );
        assert!(root.radius() <= 1e-30 * root.midpoint().high());
        // With radii: the extreme members' results are held too.
        let (ra, rb) = (a.high().abs() * 1e-20, b.high().abs() * 3e-22);
        let product = Ball::new(a, ra) * Ball::new(b, rb);
        let (xa, yb) = (x.plus(&Dyadic::of(ra)), y.plus(&Dyadic::of(-rb)));
        let distance = xa.times(&yb).plus(&Dyadic::of_dd(product.midpoint()).negative());
        assert!(within(&distance, product.radius(), &one));
        let quotient = Ball::new(a, ra) / Ball::new(b, rb);
        let distance = xa.plus(&Dyadic::of_dd(quotient.midpoint()).times(&yb).negative());
        assert!(within(&distance, quotient.radius(), &yb));
    }
}

#[test]
fn balls_hold_the_exact_result() {
    balls_against_exact_numbers(10_000, 3);
}

#[test]
#[ignore = "minutes: run by `make rigor-test`"]
fn millions_of_balls_hold_the_exact_result() {
    balls_against_exact_numbers(1_500_000, 4);
}

/// Bits of the fixed-point oracle; its results err by less than 2^-(BITS - 24).
const BITS: i64 = 512;

fn one() -> BigInt {
    BigInt::from(1) << BITS as usize
}

fn product(a: &BigInt, b: &BigInt) -> BigInt {
    (a * b) >> BITS as usize
}

/// artanh(1/n) or arctan(1/n) as a series.
fn inverse_series(n: u32, alternating: bool) -> BigInt {
    let (mut term, mut sum, mut k) = (one() / n, BigInt::from(0), 0u32);
    while term.sign() != Sign::NoSign {
        let t = &term / (2 * k + 1);
        if alternating && k % 2 == 1 {
            sum -= t
        } else {
            sum += t
        }
        term /= n * n;
        k += 1;
    }
    sum
}

fn ln_2() -> BigInt {
    inverse_series(3, false) * 2
}

/// Machin's formula.
fn pi() -> BigInt {
    (inverse_series(5, true) * 4 - inverse_series(239, true)) * 4
}

/// exp(x) = v 2^k for a fixed-point x.
fn exp_oracle(x: &BigInt) -> (BigInt, i64) {
    let k = x / ln_2();
    let r = x - &k * ln_2();
    let (mut term, mut sum) = (one(), BigInt::from(0));
    let mut n = 0;
    while term.sign() != Sign::NoSign && n < 400 {
        sum += &term;
        n += 1;
        term = product(&term, &r) / n;
    }
    (sum, i64::try_from(k).unwrap())
}

fn sin_cos_oracle(x: &BigInt) -> (BigInt, BigInt) {
    let turn = pi() * 2;
    let r = x - (x / &turn) * &turn;
    let (mut term, mut sin, mut cos) = (one(), BigInt::from(0), BigInt::from(0));
    for n in 0..400 {
        match n % 4 {
            0 => cos += &term,
            1 => sin += &term,
            2 => cos -= &term,
            _ => sin -= &term,
        }
        term = product(&term, &r) / (n + 1);
    }
    (sin, cos)
}

/// Whether `got` holds v 2^-bits, known to 2^-slack relative to 1.
#[track_caller]
fn holds_fixed(got: Interval, v: &BigInt, bits: i64, what: &str) {
    let slack = Dyadic { m: BigInt::from(1), e: -bits + 32 };
    let v = Dyadic { m: v.clone(), e: -bits };
    assert!(
        Dyadic::of(got.lower()).cmp(&v.plus(&slack)) != Ordering::Greater
            && Dyadic::of(got.upper()).cmp(&v.plus(&slack.negative())) != Ordering::Less,
        "{what}: {got:?}"
    );
}

fn ulps(got: Interval) -> f64 {
    let spacing = got.magnitude().next_up() - got.magnitude();
    got.width() / spacing
}

fn functions_against_series(rounds: u64, seed: u64) {
    let mut random = Random(seed);
    for k in 0..rounds {
        let x = match k % 5 {
            0 => random.uniform(-1.0, 1.0),
            1 => random.uniform(-25.0, 25.0),
            2 => random.uniform(-300.0, 300.0),
            3 => random.uniform(-1.0, 1.0) * 2.0_f64.powi(-((random.bits() % 60) as i32)),
            _ => (random.uniform(-40.0, 40.0) * 4.0).round() * 0.25,
        };
        let fixed = Dyadic::of(x).fixed(BITS);
        // f64 intervals: bounds within an ulp or two of the value.
        let (e, scale) = exp_oracle(&fixed);
        let got = point(x).exp();
        holds_fixed(got, &e, BITS - scale, &format!("exp {x:e}"));
        assert!(ulps(got) <= 2.0, "exp {x:e}: {got:?}");
        let (sin, cos) = sin_cos_oracle(&fixed);
        for (got, want, name) in [(point(x).sin(), &sin, "sin"), (point(x).cos(), &cos, "cos")] {
            holds_fixed(got, want, BITS, &format!("{name} {x:e}"));
            assert!(ulps(got) <= 2.0 || got.width() < 1e-28, "{name} {x:e}: {got:?}");
        }
        let (e2, scale) = exp_oracle(&(&fixed * 2));
        // exp(2x) in fixed point only where it does not lose its digits.
        if (-100..700).contains(&scale) {
            let e2 = if scale >= 0 { e2 << scale as usize } else { e2 >> (-scale) as usize };
            let tanh = ((&e2 - one()) << BITS as usize) / (&e2 + one());
            let got = point(x).tanh();
            holds_fixed(got, &tanh, BITS, &format!("tanh {x:e}"));
            assert!(ulps(got) <= 2.0, "tanh {x:e}: {got:?}");
            let slope = one() - product(&tanh, &tanh);
            let got = point(x).sech_squared().unwrap();
            holds_fixed(got, &slope, BITS, &format!("sech^2 {x:e}"));
            assert!(ulps(got) <= 2.0 || x.abs() > 100.0, "sech^2 {x:e}: {got:?}");
            // Balls: about 30 digits.
            let ball = Ball::from_f64(x).tanh();
            let distance =
                Dyadic { m: tanh, e: -BITS }.plus(&Dyadic::of_dd(ball.midpoint()).negative());
            let slack = Dyadic { m: BigInt::from(1), e: -BITS + 32 };
            assert!(
                distance.cmp(&Dyadic::of(ball.radius()).plus(&slack)) != Ordering::Greater,
                "tanh {x:e}: {ball:?}"
            );
            let lowest = Dyadic::of(-ball.radius()).plus(&slack.negative());
            assert!(distance.cmp(&lowest) != Ordering::Less, "tanh {x:e}: {ball:?}");
            assert!(
                ball.radius() <= 1e-29 * ball.midpoint().high().abs() + 1e-300,
                "tanh {x:e}: {ball:?}"
            );
        }
        inverse_functions(x);
        for (ball, want, name) in
            [(Ball::from_f64(x).sin(), sin, "sin"), (Ball::from_f64(x).cos(), cos, "cos")]
        {
            let distance =
                Dyadic { m: want, e: -BITS }.plus(&Dyadic::of_dd(ball.midpoint()).negative());
            assert!(
                within(&distance, ball.radius().next_up(), &Dyadic::of(1.0)),
                "{name} {x:e}: {ball:?}"
            );
            assert!(ball.radius() <= 1e-28, "{name} {x:e}: {ball:?}");
        }
    }
}

/// erf by its alternating series, ln and atan by what they invert.
#[track_caller]
fn inverse_functions(x: f64) {
    let fixed = Dyadic::of(x).fixed(BITS);
    if x.abs() < 6.0 {
        let square = product(&fixed, &fixed);
        let (mut term, mut sum) = (fixed.clone(), BigInt::from(0));
        for n in 0..500 {
            sum += &term / (2 * n + 1);
            term = -product(&term, &square) / (n + 1);
        }
        // 2/sqrt(pi)
        let factor = (BigInt::from(2) << (2 * BITS) as usize) / (pi() << BITS as usize).sqrt();
        let erf = product(&sum, &factor);
        let got = point(x).erf();
        // The series loses exp(x^2) to cancellation.
        holds_fixed(got, &(erf >> 64usize), BITS - 64, &format!("erf {x:e}"));
        assert!(ulps(got) <= 2.0, "erf {x:e}: {got:?}");
    }
    if x > 1e-30 {
        // exp(lower of ln x) <= x <= exp(upper of ln x)
        let got = point(x).ln();
        for (bound, above) in [(got.lower(), false), (got.upper(), true)] {
            let (e, scale) = exp_oracle(&Dyadic::of(bound).fixed(BITS));
            let slack = BigInt::from(1) << 40usize;
            let e = Dyadic { m: if above { e + slack } else { e - slack }, e: scale - BITS };
            let side = e.cmp(&Dyadic::of(x));
            assert!(
                side != if above { Ordering::Less } else { Ordering::Greater },
                "ln {x:e}: {got:?}"
            );
        }
        assert!(got.width() <= 4.0 * f64::EPSILON * (got.magnitude() + 1e-10), "ln {x:e}: {got:?}");
    }
    let got = point(x).atan();
    for (bound, above) in [(got.lower(), false), (got.upper(), true)] {
        let (sin, cos) = sin_cos_oracle(&Dyadic::of(bound).fixed(BITS));
        // tan(bound) against x, cos being positive.
        let slack = BigInt::from(1) << 40usize;
        let tan = ((sin << BITS as usize) / cos) + if above { slack } else { -slack };
        let side = tan.cmp(&fixed);
        assert!(
            side != if above { Ordering::Less } else { Ordering::Greater },
            "atan {x:e}: {got:?}"
        );
    }
    assert!(ulps(got) <= 2.0, "atan {x:e}: {got:?}");
}

#[test]
fn functions_hold_their_values() {
    functions_against_series(300, 5);
}

#[test]
#[ignore = "minutes: run by `make rigor-test`"]
fn functions_hold_their_values_at_many_points() {
    functions_against_series(60_000, 6);
}

#[test]
fn decimals_are_decimals() {
    let mut random = Random(7);
    for k in 0..20_000 {
        let x = match k % 4 {
            0 => random.uniform(-10.0, 10.0),
            1 => (random.uniform(-1e6, 1e6)).round() / 1000.0,
            2 => random.uniform(-1.0, 1.0) * 1e-9,
            _ => random.hard(),
        };
        let text = format!("{x:e}");
        let (mantissa, exponent) = text.split_once('e').unwrap();
        let point_at = mantissa.find('.').map_or(0, |p| mantissa.len() - p - 1) as i64;
        let digits: BigInt = mantissa.replace('.', "").parse().unwrap();
        let exponent = exponent.parse::<i64>().unwrap() - point_at;
        // The decimal is digits 10^exponent = digits / ten.
        let power = BigInt::from(10).pow(exponent.unsigned_abs() as u32);
        let (numerator, denominator) =
            if exponent < 0 { (digits, power) } else { (digits * power, BigInt::from(1)) };
        let (n, d) = (Dyadic { m: numerator, e: 0 }, Dyadic { m: denominator, e: 0 });
        let got = Interval::from_decimal(&x.into());
        let tight = x == 0.0 || (1e-5..1e15).contains(&x.abs());
        if got.is_bounded() {
            holds(got, tight, &format!("{x:e} as a decimal"), |v| n.quotient_against(&d, v));
        }
        if (1e-200..1e200).contains(&x.abs()) {
            let ball = Ball::from_decimal(&x.into());
            let distance = n.plus(&Dyadic::of_dd(ball.midpoint()).times(&d).negative());
            assert!(within(&distance, ball.radius(), &d), "{x:e}: {ball:?}");
            assert!(ball.radius() <= 1e-28 * x.abs(), "{x:e}: {ball:?}");
        }
    }
}

fn any_interval() -> impl Strategy<Value = Interval> {
    (-50.0..50.0_f64, 0.0..1.0_f64, -8..3_i32)
        .prop_map(|(a, w, k)| Interval::between(a, a + w * 10.0_f64.powi(k)))
}

/// A part of an interval, and a member of the part.
fn part(of: Interval, from: f64, to: f64, at: f64) -> (Interval, f64) {
    let place = |s: f64| (of.lower() + s * (of.upper() - of.lower())).clamp(of.lower(), of.upper());
    let inner = Interval::between(place(from), place(to));
    (inner, place(from + at * (to - from)).clamp(inner.lower(), inner.upper()))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Inclusion isotonicity, and every member's value is a member.
    #[test]
    fn results_of_parts_are_parts_of_results(
        a in any_interval(), b in any_interval(),
        (f, t, at) in (0.0..1.0_f64, 0.0..1.0_f64, 0.0..1.0_f64), (g, u, bt) in (0.0..1.0_f64,
            0.0..1.0_f64, 0.0..1.0_f64),
    ) {
        let ((p, x), (q, y)) = (part(a, f, t, at), part(b, g, u, bt));
        type Unary = (&'static str, fn(Interval) -> Interval);
        type Binary = (&'static str, fn(Interval, Interval) -> Interval);
        let binary: [Binary; 4] =
            [("+", |a, b| a + b), ("-", |a, b| a - b), ("*", |a, b| a * b), ("/", |a, b| a / b)];
        for (name, f) in binary {
            let (whole, inner, value) = (f(a, b), f(p, q), f(point(x), point(y)));
            prop_assert!(inner.subset(whole), "{:?} {} {:?}", a, name, b);
            prop_assert!(value.subset(inner), "{} {} {}", x, name, y);
        }
        let unary: [Unary; 12] = [
            ("exp", Interval::exp), ("tanh", Interval::tanh), ("sin", Interval::sin), ("cos",
                Interval::cos),
            ("sqrt", Interval::sqrt), ("squared", Interval::squared), ("neg", |a| -a), ("abs",
                Interval::abs),
            ("ln", Interval::ln),
            ("atan", Interval::atan),
            ("erf", Interval::erf),
            ("sech^2", |a| a.sech_squared().unwrap()),
        ];
        for (name, f) in unary {
            let (whole, inner, value) = (f(a), f(p), f(point(x)));
            prop_assert!(inner.subset(whole), "{} {:?}: {:?} in {:?}", name, a, inner, whole);
            prop_assert!(value.subset(inner), "{} {}: {:?} in {:?}", name, x, value, inner);
        }
    }
}
