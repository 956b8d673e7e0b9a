use super::*;
use crate::DoubleDouble;
use proptest::prelude::*;

type M = MultiFloat<4>;
type Long = MultiFloat<8>;

/// Values from mpmath 1.3 at 1200 bits, rounded to 160 digits.
const KNOWN: [(&str, &str); 12] = [
    (
        "exp 1.5",
        "4.481689070338064822602055460119275819005749868369667056772650082785936674466713772981053831382453391388616350651830195768962746477220408606961759644973693538179",
    ),
    (
        "exp -30.5",
        "5.675685232632722461872788723806651277147710851207511617132619384017875667494794052955798115036489464522360518016802722117420915113952656379420684445909397502067e-14",
    ),
    (
        "ln 3",
        "1.098612288668109691395245236922525704647490557822749451734694333637494293218608966873615754813732088787970029065957865742368004225930519821052801870767277410603",
    ),
    (
        "ln 1.0625",
        "0.06062462181643484258060613204042026328620247514472377081451769990871808792215241848864156005182819735034233796490431435665551189891421613616907155920171742353700",
    ),
    (
        "sin 1.25",
        "0.9489846193555862143484908470360492503780160345238922201355570321801262421757229067546662274022547384630474560746996111368907619247915011486409344866565293827789",
    ),
    (
        "cos 100",
        "0.8623188722876839341019385139508425355100840085355108292801621126927210880509266241030951056842772850671356075551623304811055280680193385410934462069488849310159",
    ),
    (
        "atan 2.5",
        "1.190289949682531732927733774829318337601178986029452072911166673829707745314101396955153966575185598813039185930215474374731346631935461523427472855902050360507",
    ),
    (
        "erf 0.75",
        "0.7111556336535151315989378345914107773742059540965372322781333971250363687640495611107932538900989000435303453704186427479134901953460048921078498500845940929269",
    ),
    (
        "erf 3",
        "0.9999779095030014145586272238704176796201522929126007503427610451570575433163798677321837453491846837128565538002718387647429960972462032505343392848941651621873",
    ),
    (
        "tanh 0.125",
        "0.1243530017715962080546472758058927076759187925153387504146699908722562482843299775709592649759634387354030275100726304224517856926000871010422461354651858073931",
    ),
    (
        "tanh 5.5",
        "0.9999665971563038096384895294175687063977326393444471898909827255388879544792153853305390092086233975375979700679731179905905545276803134563734221324219819011756",
    ),
    (
        "sqrt 7",
        "2.645751311064590590501615753639260425710259183082450180368334459201068823230283627760392886474543610615064578338497463095743529888627214784427390555880107722717",
    ),
];

fn agrees<const L: usize>(units: f64) {
    for (what, digits) in KNOWN {
        let (name, x) = what.split_once(' ').unwrap();
        let x = MultiFloat::<L>::from_digits(x).unwrap();
        let x = if what.contains(" -") { -x.magnitude() } else { x };
        let got = match name {
            "exp" => x.exp(),
            "ln" => x.ln(),
            "sin" => x.sin(),
            "cos" => x.cos(),
            "atan" => x.atan(),
            "erf" => x.erf(),
            "tanh" => x.tanh(),
            _ => x.sqrt(),
        };
        let want = MultiFloat::<L>::from_digits(digits).unwrap();
        let off = ((got - want) / want).to_f64().abs();
        // 160 digits are given.
        assert!(
            off < units * MultiFloat::<L>::EPSILON + 1e-158,
            "{what} at {} bits: {off:e}",
            64 * L
        );
    }
}

#[test]
fn functions_agree_with_known_digits() {
    agrees::<3>(64.0);
    agrees::<4>(64.0);
    agrees::<6>(64.0);
    agrees::<8>(64.0);
}

#[test]
fn constants_are_what_they_are_called() {
    // Machin (1706): pi = 16 atan(1/5) - 4 atan(1/239); ln 2 = 2 atanh(1/3).
    let inverse = |n: u64, sign: f64| {
        let square = Long::whole(1) / Long::whole(n * n);
        let (mut power, mut sum) = (Long::whole(1) / Long::whole(n), Long::ZERO);
        for k in 0..400 {
            let term = power / Long::whole(2 * k + 1);
            sum += if k % 2 == 1 { term * Long::from_f64(sign) } else { term };
            power = power * square;
        }
        sum
    };
    let pi = inverse(5, -1.0) * Long::whole(16) - inverse(239, -1.0) * Long::whole(4);
    let ln_2 = inverse(3, 1.0).times_power_of_two(1);
    for (found, constant) in [(pi, PI), (ln_2, LN_2)] {
        let off = (found - Long::constant(constant)).to_f64().abs();
        assert!(off < 64.0 * Long::EPSILON, "{off:e}");
    }
}

#[test]
fn ends_of_the_range() {
    let tiny = M::from_f64(5e-324);
    assert_eq!(tiny.times_power_of_two(1074), M::whole(1));
    assert_eq!(M::from_f64(f64::MAX).to_f64(), f64::MAX);
    assert_eq!((M::from_f64(f64::MAX) * M::whole(4)).to_f64(), f64::INFINITY);
    assert_eq!(M::whole(1).times_power_of_two(-RANGE - 5), M::ZERO);
    for nan in [
        M::from_f64(f64::NAN),
        M::from_f64(f64::INFINITY),
        M::whole(1) / M::ZERO,
        M::whole(1).times_power_of_two(RANGE + 1),
        (-M::whole(1)).ln(),
        (-M::whole(1)).sqrt(),
        M::ZERO.ln(),
        M::from_f64(1e30).sin(),
        M::from_f64(1e13).exp(),
    ] {
        assert!(nan.to_f64().is_nan() && nan.partial_cmp(&nan).is_none(), "{nan:?}");
    }
    assert_eq!(M::from_f64(-1e13).exp(), M::ZERO);
    assert_eq!((M::from_f64(1e3).tanh(), M::from_f64(-1e3).erf()), (M::whole(1), -M::whole(1)));
    let (half_pi, far) = (M::pi().times_power_of_two(-1), M::whole(1).times_power_of_two(400));
    assert_eq!((far.atan(), (-far).atan()), (half_pi, -half_pi));
    assert!(
        M::from_digits("1.5.2").is_none()
            && M::from_digits("-").is_none()
            && M::from_digits("").is_none()
    );
}

#[test]
fn rounding_to_f64_is_to_nearest() {
    // Half a unit beyond 1 goes to the even neighbour, a bit more goes up.
    let unit = f64::EPSILON;
    let half = M::whole(1) + M::from_f64(unit / 2.0);
    assert_eq!(half.to_f64(), 1.0);
    assert_eq!((half + M::from_f64(1e-60)).to_f64(), 1.0 + unit);
    assert_eq!((M::from_f64(1.0 + unit) + M::from_f64(unit / 2.0)).to_f64(), 1.0 + 2.0 * unit);
}

fn number() -> impl Strategy<Value = M> {
    // Sums of parts of very different size fill all limbs.
    (-1e3..1e3_f64, -1.0..1.0_f64, -1.0..1.0_f64, -40..40_i64).prop_map(|(a, b, c, k)| {
        let x = M::from_f64(a)
            + M::from_f64(b).times_power_of_two(-60)
            + M::from_f64(c).times_power_of_two(-140);
        x.times_power_of_two(k)
    })
}

/// The distance in units of the last place of `scale`.
fn units(a: M, b: M, scale: M) -> f64 {
    ((a - b) / scale).to_f64().abs() / M::EPSILON
}

proptest! {
    #[test]
    fn f64_comes_back(x in any::<f64>().prop_filter("normal", |x| x.is_normal())) {
        prop_assert_eq!(M::from_f64(x).to_f64().to_bits(), x.to_bits());
        let text = format!("{:e}", x);
        prop_assert_eq!(M::from_digits(&text).unwrap().to_f64(), x);
    }

    #[test]
    fn field_identities(a in number(), b in number(), c in number()) {
        let largest = |x: M, y: M| if x.magnitude() > y.magnitude() { x.magnitude() } else {
            y.magnitude() };
        prop_assume!(b != M::ZERO && a != M::ZERO);
        prop_assert_eq!(a + b, b + a);
        prop_assert_eq!(a * b, b * a);
        prop_assert_eq!(a - a, M::ZERO);
        prop_assert!(units((a + b) - b, a, largest(a, b)) <= 2.0);
        prop_assert!(units((a + b) + c, a + (b + c), largest(largest(a, b), c)) <= 4.0);
        prop_assert!(units(a * (b + c), a * b + a * c, a * largest(b, c)) <= 6.0);
        prop_assert!(units(a / b * b, a, a) <= 4.0);
        let root = a.magnitude().sqrt();
        prop_assert!(units(root * root, a.magnitude(), a.magnitude()) <= 4.0);
    }

    /// The first 30 digits are those of the other extended arithmetic.
    #[test]
    fn agrees_with_double_double(x in -8.0..8.0_f64, y in 0.01..8.0_f64) {
        let (m, d) = (M::from_f64, DoubleDouble::from_f64);
        for (a, b) in [
            (m(x).exp(), d(x).exp()), (m(x).sin(), d(x).sin()), (m(x).cos(), d(x).cos()),
                (m(x).tanh(), d(x).tanh()),
            (m(x).atan(), d(x).atan()), (m(x).erf(), d(x).erf()), (m(y).ln(), d(y).ln()),
                (m(y).sqrt(), d(y).sqrt()),
            (m(x) / m(y), d(x) / d(y)), (m(x) * m(y) + m(x), d(x) * d(y) + d(x)), (m(x) - m(y),
                d(x) - d(y)),
        ] {
            let b = M::from_f64(b.high()) + M::from_f64(b.low());
            prop_assert!((a - b).to_f64().abs() <= 2e-30 * (1.0 + a.to_f64().abs()),
                "{:?} {:?}", a, b);
        }
    }

    /// Four limbs are eight limbs, rounded.
    #[test]
    fn a_short_number_is_a_long_one_rounded(x in 0.02..20.0_f64, y in -3.0..3.0_f64) {
        let text = |f: fn(Long) -> Long, g: fn(M) -> M, x: f64| {
            let (long, short) = (f(Long::from_f64(x)), g(M::from_f64(x)));
            let mut limbs = [0; 4];
            limbs.copy_from_slice(&long.limbs[4..]);
            units(M { kind: long.kind, negative: long.negative, exponent: long.exponent,
                limbs }, short, short)
        };
        prop_assert!(text(Long::ln, M::ln, x) < 64.0);
        prop_assert!(text(Long::exp, M::exp, y) < 64.0);
        prop_assert!(text(Long::tanh, M::tanh, y) < 64.0);
        prop_assert!(text(Long::erf, M::erf, y) < 64.0);
        prop_assert!(text(Long::atan, M::atan, y) < 64.0);
    }
}

/// In one limb, whole numbers of 64 bits: sums are rounded as integers are, half away from
/// zero, differences are exact.
#[test]
fn one_limb_is_rounded_like_an_integer() {
    let integer = |x: MultiFloat<1>| {
        assert!(x.kind != NumberClass::NotANumber);
        let shift = x.exponent - 64;
        let size = u128::from(x.limbs[0]);
        let size = if shift >= 0 { size << shift } else { size >> -shift } as i128;
        if x.kind == NumberClass::Zero {
            0
        } else if x.negative {
            -size
        } else {
            size
        }
    };
    let numbers = [
        1,
        2,
        3,
        5,
        1 << 40,
        1 << 63,
        (1 << 63) + 1,
        u64::MAX,
        u64::MAX - 1,
        u64::MAX / 3,
        0x0123_4567_89ab_cdef,
    ];
    for a in numbers {
        for b in numbers {
            let [x, y] = [a, b].map(MultiFloat::<1>::whole);
            let sum = i128::from(a) + i128::from(b);
            let rounded = if sum >= 1 << 64 { (sum + 1) / 2 * 2 } else { sum };
            assert_eq!(integer(x + y), rounded, "{a} + {b}");
            assert_eq!(integer(-x - y), -rounded, "-{a} - {b}");
            assert_eq!(integer(x - y), i128::from(a) - i128::from(b), "{a} - {b}");
            assert_eq!(x.partial_cmp(&y), Some(a.cmp(&b)));
            assert_eq!((-x).partial_cmp(&-y), Some(b.cmp(&a)));
            assert_eq!((-x).partial_cmp(&y), Some(Ordering::Less));
            // Two limbs hold the sum whole.
            let [x, y] = [a, b].map(MultiFloat::<2>::whole);
            assert_eq!((x + y - x).partial_cmp(&y), Some(Ordering::Equal), "{a} + {b} - {a}");
        }
    }
    let zero = MultiFloat::<1>::ZERO;
    assert_eq!(zero.partial_cmp(&-zero), Some(Ordering::Equal));
    assert!(zero < MultiFloat::whole(1) && -MultiFloat::<1>::whole(1) < zero);
    assert_eq!(zero.partial_cmp(&MultiFloat::NAN), None);
}

#[test]
fn functions_are_those_of_f64_in_every_quadrant() {
    for i in -40..=40 {
        let x = f64::from(i) * 0.3;
        let long = MultiFloat::<3>::from_f64(x);
        assert!((long.sin().to_f64() - Elementary::sin(x)).abs() < 4e-16, "sin {x}");
        assert!((long.cos().to_f64() - Elementary::cos(x)).abs() < 4e-16, "cos {x}");
        if x != 0.0 {
            assert!(
                (long.log2() - Elementary::ln(x.abs()) * std::f64::consts::LOG2_E).abs() < 4e-15,
                "log2 {x}"
            );
        }
    }
    let large = MultiFloat::<2>::whole(1).times_power_of_two(5000);
    assert_eq!((large.log2(), MultiFloat::<2>::ZERO.log2()), (5000.0, f64::NEG_INFINITY));
    assert!(
        MultiFloat::<2>::NAN.log2().is_nan()
            && MultiFloat::<2>::from_f64(1e16).sin().to_f64().is_nan()
    );
}

#[test]
fn edges() {
    type X = MultiFloat<2>;
    let (one, zero, nan) = (X::whole(1), X::ZERO, X::NAN);
    let not = |x: X| x.to_f64().is_nan();
    for x in [one, zero, nan, -one] {
        assert!(
            not(x + nan)
                && not(nan - x)
                && not(x * nan)
                && not(nan * x)
                && not(x / nan)
                && not(nan / x)
        );
        assert!(not(x / zero));
        assert!(not(x) || (x + zero == x && zero + x == x && (x * zero).kind == NumberClass::Zero));
    }
    assert_eq!((zero / one).to_f64(), 0.0);
    let mut difference = one;
    difference -= X::whole(3);
    assert_eq!(difference.to_f64(), -2.0);
    // The ends of f64.
    let power = |k: i64| one.times_power_of_two(k);
    assert_eq!((power(1024).to_f64(), (-power(1024)).to_f64()), (f64::INFINITY, f64::NEG_INFINITY));
    assert_eq!(
        (power(1023).to_f64(), (-power(-1022)).to_f64()),
        (2.0_f64.powi(1023), -f64::MIN_POSITIVE)
    );
    assert_eq!(power(-1023).to_f64(), 0.0);
    assert_eq!(X::from_f64(-5e-324).times_power_of_two(1074), -one);
    // Signs, and where functions end.
    let signs = [X::whole(2), -X::whole(2), zero, -zero].map(|x| x.sign().to_f64());
    assert_eq!(signs, [1.0, -1.0, 1.0, 1.0]);
    assert!(not(nan.sign()) && not((-one).sqrt()) && not((-one).ln()) && not(zero.ln()));
    assert_eq!((zero.sqrt().to_f64(), zero.tanh().to_f64()), (0.0, 0.0));
    for (x, tanh, erf) in [(1e5, 1.0, 1.0), (-1e5, -1.0, -1.0)] {
        let x = X::from_f64(x);
        assert_eq!((x.tanh().to_f64(), x.erf().to_f64()), (tanh, erf));
    }
    for x in [-3.0, -0.1, 0.1, 3.0] {
        assert!((X::from_f64(x).tanh().to_f64() - Elementary::tanh(x)).abs() < 2e-16, "{x}");
    }
    assert_eq!(power(5000).atan(), X::pi().times_power_of_two(-1));
    assert_eq!((-power(5000)).atan(), -X::pi().times_power_of_two(-1));
    assert_eq!(power(-5000).atan(), power(-5000));
    assert_eq!(X::from_f64(-1e30).exp().to_f64(), 0.0);
    assert!(not(X::from_f64(1e30).exp()) && X::from_digits("1.2.3").is_none());
}
