use super::super::step::Interpolant;
use super::*;

struct Cubic([f64; 4]);
impl Interpolant<1> for Cubic {
    fn at(&self, s: f64) -> SVector<f64, 1> {
        let [a, b, c, d] = self.0;
        SVector::from([a + s * (b + s * (c + s * d))])
    }
    fn degree(&self) -> usize {
        3
    }
}

/// The same with all that can be proved of it.
struct Proving(Cubic);
impl Interpolant<1> for Proving {
    fn at(&self, s: f64) -> SVector<f64, 1> {
        self.0.at(s)
    }
    fn degree(&self) -> usize {
        3
    }
    fn reach(&self, _: usize) -> f64 {
        let [_, _, c, d] = self.0.0;
        0.25 * c.abs() + 0.4 * d.abs()
    }
    fn is_monotone(&self, _: usize) -> bool {
        let [_, b, c, d] = self.0.0;
        b.abs() > 2.0 * c.abs() + 3.0 * d.abs()
    }
}

fn passages(c: [f64; 4]) -> Vec<Crossing> {
    let p = Cubic(c);
    let step = Step { t0: 0.0, t1: 1.0, x0: p.at(0.0), x1: p.at(1.0), interpolant: &p };
    CrossingFinder::default().in_step(&step, |x| x[0])
}

fn zeros(c: [f64; 4]) -> Vec<f64> {
    passages(c).iter().map(|p| p.theta).collect()
}

/// Two crossings between the first two samples, or the last two, are found as those in the
/// middle are.
#[test]
fn a_dip_beside_an_end_is_found() {
    for c in [1e-3, 0.02, 0.1, 0.5, 0.97, 0.999] {
        for w in [1e-4, 1e-6] {
            let found = zeros([c * c - w * w, -2.0 * c, 1.0, 0.0]);
            assert!(found.len() == 2 && (found[0] - (c - w)).abs() < 1e-9, "{c} {w}: {found:?}");
        }
    }
    assert!(zeros([0.02 * 0.02 + 1e-9, -0.04, 1.0, 0.0]).is_empty());
}

/// The senses of the crossings of the plane x = `value` in steps given by their cubics, one
/// after the other.
fn senses(value: f64, steps: &[[f64; 4]]) -> Vec<(usize, f64, bool)> {
    let [mut by_plane, mut by_surface, mut by_proof] = [CrossingFinder::default(); 3];
    let mut found = Vec::new();
    for (i, c) in steps.iter().enumerate() {
        let p = Cubic(*c);
        let step = Step { t0: 0.0, t1: 1.0, x0: p.at(0.0), x1: p.at(1.0), interpolant: &p };
        let passages = by_plane.through_plane(&step, 0, value);
        assert_eq!(passages, by_surface.in_step(&step, |x| x[0] - value));
        // Proofs spare work and change nothing.
        let proved =
            by_proof.through_plane(&Step { interpolant: &Proving(Cubic(*c)), ..step }, 0, value);
        assert!(proved.len() == passages.len(), "{proved:?} {passages:?}");
        assert_eq!(by_proof.side, by_surface.side);
        for (a, b) in proved.iter().zip(&passages) {
            assert!(a.upward == b.upward && (a.theta - b.theta).abs() < 1e-14, "{a:?} {b:?}");
        }
        found.extend(passages.iter().map(|p| (i, p.theta, p.upward)));
    }
    found
}

#[test]
fn the_sense_is_that_of_the_signs() {
    // Two crossings in one step, down and up, through a plane that is not 0: (s - 1/4)(s - 3/4)
    // + 7.
    let found = senses(7.0, &[[7.1875, -1.0, 1.0, 0.0]]);
    assert_eq!(found.iter().map(|f| f.2).collect::<Vec<_>>(), [false, true], "{found:?}");
    assert!((found[0].1 - 0.25).abs() < 1e-14 && (found[1].1 - 0.75).abs() < 1e-14, "{found:?}");
    // The plane 0 is not met.
    assert_eq!(senses(0.0, &[[7.1875, -1.0, 1.0, 0.0]]), []);
    // Upwards and downwards through a plane below zero.
    assert_eq!(
        senses(-2.0, &[[-2.5, 1.0, 0.0, 0.0], [-1.5, -1.0, 0.0, 0.0]]),
        [(0, 0.5, true), (1, 0.5, false)]
    );
}

#[test]
fn a_start_on_the_surface_is_no_passage_and_the_return_has_its_sense() {
    // From 0 down and up again through the plane: s (s - 1/2). The return is upwards.
    let found = senses(0.0, &[[0.0, -0.5, 1.0, 0.0]]);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].2 && (found[0].1 - 0.5).abs() < 1e-14, "{found:?}");
    let found = senses(3.0, &[[3.0, 0.5, -1.0, 0.0]]);
    assert!(found.len() == 1 && !found[0].2, "{found:?}");
    assert_eq!(senses(0.0, &[[0.0, 1.0, 0.0, 0.0]]), []);
}

#[test]
fn an_end_on_the_surface_is_decided_by_what_follows() {
    // Through: reported once, at the start of the step that leaves to the other side.
    assert_eq!(senses(0.0, &[[-1.0, 1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]), [(1, 0.0, true)]);
    assert_eq!(senses(0.5, &[[1.5, -1.0, 0.0, 0.0], [0.5, -1.0, 0.0, 0.0]]), [(1, 0.0, false)]);
    // Back to where it came from: a touch; the next crossing still alternates.
    let touch = [[1.0, -1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [1.0, -2.0, 0.0, 0.0]];
    assert_eq!(senses(0.0, &touch), [(2, 0.5, false)]);
    // A touch at a sample inside a step: |s - 2/5|, sampled at fifths.
    let p = Cubic([-0.4, 1.0, 0.0, 0.0]);
    let step = Step { t0: 0.0, t1: 1.0, x0: p.at(0.0), x1: p.at(1.0), interpolant: &p };
    assert_eq!(step.at(0.4)[0], 0.0);
    assert_eq!(CrossingFinder::default().in_step(&step, |x| x[0].abs()), []);
    assert_eq!(
        CrossingFinder::default().in_step(&step, |x| x[0]),
        [Crossing { theta: 0.4, upward: true }]
    );
}

#[test]
fn a_jump_to_the_other_side_is_no_passage() {
    assert_eq!(
        senses(0.0, &[[1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [-1.0, 2.0, 0.0, 0.0]]),
        [(2, 0.5, true)]
    );
}

#[test]
fn finds_each_of_three() {
    // (s - 0.1)(s - 0.5)(s - 0.85)
    let found = zeros([-0.0425, 0.56, -1.45, 1.0]);
    let expected: [f64; 3] = [0.1, 0.5, 0.85];
    assert_eq!(found.len(), 3, "{found:?}");
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() < 1e-14, "{found:?}");
    }
}

#[test]
fn finds_two_between_samples() {
    // (s - 0.3)(s - 0.302) = s^2 - 0.602 s + 0.0906: both zeros lie between neighbouring
    // samples.
    let found = zeros([0.0906, -0.602, 1.0, 0.0]);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!((found[0] - 0.3).abs() < 1e-12 && (found[1] - 0.302).abs() < 1e-12, "{found:?}");
}

/// Many zeros of no polynomial, and pairs however close: each is found, in order.
#[test]
fn every_zero_of_a_curved_surface_is_found() {
    use twofold_num::elementary::sin;
    let p = Cubic([0.3, 1.0, 0.0, 0.0]);
    let step = Step { t0: 0.0, t1: 1.0, x0: p.at(0.0), x1: p.at(1.0), interpolant: &p };
    for many in [1.0, 6.0, 40.0, 177.0] {
        let turn = std::f64::consts::PI / many;
        let found = CrossingFinder::default().in_curved_step(&step, |x| sin(many * x[0]));
        let expected: Vec<f64> =
            (1..100).map(|k| f64::from(k) * turn - 0.3).filter(|s| *s > 0.0 && *s <= 1.0).collect();
        assert_eq!(found.len(), expected.len(), "{many}: {found:?}");
        for (f, e) in found.iter().zip(&expected) {
            let upward = sin(many * (e + 0.3) + 0.5) > 0.0;
            assert!((f.theta - e).abs() < 1e-14 && f.upward == upward, "{many}: {f:?} {e}");
        }
    }
    for gap in [1e-2, 1e-5, 1e-7] {
        let pair =
            |x: &SVector<f64, 1>| (x[0] - 0.737) * (x[0] - 0.737 - gap) * (x[0] * x[0] + 1.0);
        let found = CrossingFinder::starting(true).in_curved_step(&step, pair);
        assert_eq!(
            found.iter().map(|f| f.upward).collect::<Vec<_>>(),
            [false, true],
            "{gap}: {found:?}"
        );
        assert!((found[0].theta - 0.437).abs() < 1e-9, "{gap}: {found:?}");
    }
    // Narrow windows of a function of any size beside them: cos(u) > 1 - depth.
    for depth in [1e-4_f64, 1e-7, 1e-10] {
        for turns in [0.6, 1.0, 3.3, 14.3] {
            let all = turns * 2.0 * std::f64::consts::PI;
            let gate = |x: &SVector<f64, 1>| cos(all * (x[0] - 0.3) - 2.0) - (1.0 - depth);
            let found = CrossingFinder::starting(false).in_curved_step(&step, gate);
            let half = 2.0 * (0.5 * depth).sqrt().asin();
            let expected: Vec<f64> = (0..20)
                .map(|k| (2.0 + f64::from(k) * 2.0 * std::f64::consts::PI) / all)
                .filter(|s| *s < 1.0)
                .flat_map(|s| [s - half / all, s + half / all])
                .collect();
            assert_eq!(found.len(), expected.len(), "{depth} {turns}: {found:?}");
            for (f, e) in found.iter().zip(&expected) {
                assert!((f.theta - e).abs() < 1e-10, "{depth} {turns}: {f:?} {e}");
            }
        }
    }
}

#[test]
fn brent_reaches_the_last_bits() {
    let r = brent(|x| x * x - 2.0, 1.0, 2.0, -1.0, 2.0);
    assert!((r - std::f64::consts::SQRT_2).abs() <= 4.5e-16);
}

/// Number of evaluations of the function, against recorded ones: the zeros do not show it. No
/// bracket begins at 0, and some go backwards.
#[test]
fn brent_asks_no_more_than_it_did() {
    type Case = (fn(f64) -> f64, f64, f64, f64, u32);
    let cases: [Case; 8] = [
        (|x| x * x * x - 2.0 * x - 5.0, 2.0, 3.0, 2.094_551_481_542_327, 6),
        (|x| (x - 1.0) * (x - 1.0) * (x - 1.0), 0.3, 1.9, 1.0, 148),
        (|x| (x * x * x) * (x * x * x) * (x * x * x), -1.0, 1.1, 0.0, 145),
        (|x| 2.0 - x * x, 3.0, 0.5, std::f64::consts::SQRT_2, 8),
        (|x| 1.0 / x - 3.0, 0.01, 10.0, 1.0 / 3.0, 13),
        (|x| x * x * x * x * x - 1e-3, -0.5, 4.0, 0.251_188_643_150_958, 17),
        (|x| if x < 0.7 { -1.0 } else { 2.0 }, 0.1, 1.0, 0.7, 51),
        (|x| (x - 1e-9) * (x + 3.0), -1.0, 0.75, 1e-9, 8),
    ];
    for (f, a, b, zero, asked) in cases {
        let mut count = 0;
        let mut counted = |x: f64| {
            count += 1;
            f(x)
        };
        let found = brent(&mut counted, a, b, f(a), f(b));
        assert!((found - zero).abs() <= 1e-15, "{zero}: {found}");
        assert_eq!(count, asked, "{zero}");
    }
}

#[test]
fn smallest_is_the_smallest_and_below_zero_is_enough() {
    for (at, sign) in [(0.3, 1.0), (0.3, -1.0), (0.62, 1.0), (0.62, -1.0), (0.9, 1.0)] {
        let parabola = |least: f64| move |s: f64| sign * ((s - at) * (s - at) + least);
        // Of a parabola nothing is known of where it is smallest beyond the square root of a
        // rounding.
        let (s, v) = smallest(&parabola(0.25), 0.1, 1.0, sign);
        assert!((s - at).abs() < 1e-6 && (v - sign * 0.25).abs() < 1e-12, "{at} {sign}: {s} {v}");
        // Below zero near the place only: that is found, and nothing smaller looked for.
        let (s, v) = smallest(&parabola(-1e-4), 0.1, 1.0, sign);
        assert!(v * sign < 0.0 && v == parabola(-1e-4)(s), "{at} {sign}: {s} {v}");
    }
}

/// The ends are asked themselves, and not what rounding makes of them.
#[test]
fn first_zero_asks_at_both_ends() {
    let asked = std::cell::RefCell::new(Vec::new());
    let none = first_zero(
        |s| {
            asked.borrow_mut().push(s);
            1.0 + s
        },
        Start::Away,
    );
    assert_eq!(none, None);
    let asked = asked.into_inner();
    assert!(asked.contains(&0.0) && asked.contains(&1.0), "{asked:?}");
}

#[test]
fn first_zero_of_a_pair_however_close() {
    for gap in [1e-2, 1e-4, 1e-6] {
        let f = |s: f64| (s - 0.437) * (s - 0.437 - gap) * (s * s + 1.0);
        let z = first_zero(f, Start::Away).expect("two zeros");
        assert!(matches!(z, Zero::Crossing(t) if (t - 0.437).abs() < 1e-9), "{gap} {z:?}");
        assert_eq!(first_zero(|s| f(s) + gap * gap, Start::Away), None);
    }
}

#[test]
fn first_zero_skips_the_one_at_the_start() {
    // s (s - 1e-9): a return after a billionth of the step.
    let z = first_zero(|s| s * (s - 1e-9), Start::Simple(-1e-9)).unwrap();
    assert!((z.theta() - 1e-9).abs() < 1e-15, "{z:?}");
    assert_eq!(first_zero(|s| s * (s + 0.1), Start::Simple(0.1)), None);
    let z = first_zero(|s| s * s * (0.25 - s), Start::Double(0.25)).unwrap();
    assert!((z.theta() - 0.25).abs() < 1e-14, "{z:?}");
    // A double zero inside is a touch, not a crossing.
    let z = first_zero(|s| (s - 0.25) * (s - 0.25), Start::Away).unwrap();
    assert!((z.theta() - 0.25).abs() < 1e-6, "{z:?}");
    // Not a polynomial.
    let z = first_zero(|s| twofold_num::elementary::sin(20.0 * s + 1.0), Start::Away).unwrap();
    assert!((z.theta() - (std::f64::consts::PI - 1.0) / 20.0).abs() < 1e-13, "{z:?}");
}
