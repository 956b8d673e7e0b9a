//! Event location: zeros of a function of the state along one step, on its dense output.

use nalgebra::SVector;

use super::step::Step;

/// The zero of `f` in [a, b], f(a) and f(b) of opposite sign or one of them zero, to the last bits of the bracket.
///
/// Brent (1973), ch. 4: inverse quadratic interpolation and secant steps, kept inside the bracket by bisection.
pub fn brent(mut f: impl FnMut(f64) -> f64, a: f64, b: f64, fa: f64, fb: f64) -> f64 {
    let (mut a, mut b, mut fa, mut fb) = (a, b, fa, fb);
    let (mut c, mut fc) = (a, fa);
    let mut d = b - a;
    let mut e = d;
    for _ in 0..200 {
        if (fb > 0.0) == (fc > 0.0) {
            (c, fc) = (a, fa);
            d = b - a;
            e = d;
        }
        if fc.abs() < fb.abs() {
            (a, b, c) = (b, c, b);
            (fa, fb, fc) = (fb, fc, fb);
        }
        let tol = 2.0 * f64::EPSILON * b.abs() + 0.5 * f64::EPSILON;
        let m = 0.5 * (c - b);
        if m.abs() <= tol || fb == 0.0 {
            return b;
        }
        if e.abs() < tol || fa.abs() <= fb.abs() {
            d = m;
            e = m;
        } else {
            let s = fb / fa;
            let (mut p, mut q) = if a == c {
                (2.0 * m * s, 1.0 - s)
            } else {
                let (q, r) = (fa / fc, fb / fc);
                (s * (2.0 * m * q * (q - r) - (b - a) * (r - 1.0)), (q - 1.0) * (r - 1.0) * (s - 1.0))
            };
            if p > 0.0 {
                q = -q;
            } else {
                p = -p;
            }
            if 2.0 * p < (3.0 * m * q - (tol * q).abs()).min((e * q).abs()) {
                e = d;
                d = p / q;
            } else {
                d = m;
                e = m;
            }
        }
        (a, fa) = (b, fb);
        b += if d.abs() > tol { d } else { tol.copysign(m) };
        fb = f(b);
    }
    b
}

/// The fractions of `step`, increasing, at which `g` changes sign. A zero exactly at the start is not reported (it
/// belongs to the step before); one exactly at the end is.
///
/// `g` is sampled at two points more than the interpolant's degree; between samples that keep their sign, a smallest |g| in the middle
/// is followed to its minimum, so that two zeros between neighbouring samples are found as well.
pub fn sign_changes<const N: usize>(step: &Step<'_, N>, g: impl Fn(&SVector<f64, N>) -> f64) -> Vec<f64> {
    let n = step.interpolant.degree() + 2;
    let value = |theta: f64| g(&step.at(theta));
    let mut found = Vec::new();
    let samples: Vec<(f64, f64)> = (0..=n).map(|i| i as f64 / n as f64).map(|s| (s, value(s))).collect();
    let mut refined: Vec<(f64, f64)> = Vec::with_capacity(samples.len() + 2);
    refined.push(samples[0]);
    for w in 1..samples.len() {
        let (s1, g1) = samples[w];
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

/// Golden-section search for the smallest `sign * f` on [a, b]; stops early once it is negative.
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

#[cfg(test)]
mod tests {
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

    fn zeros(c: [f64; 4]) -> Vec<f64> {
        let p = Cubic(c);
        let step = Step { t0: 0.0, t1: 1.0, x0: p.at(0.0), x1: p.at(1.0), interpolant: &p };
        sign_changes(&step, |x| x[0])
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
        // (s - 0.3)(s - 0.302) = s^2 - 0.602 s + 0.0906: both zeros lie between neighbouring samples.
        let found = zeros([0.0906, -0.602, 1.0, 0.0]);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0] - 0.3).abs() < 1e-12 && (found[1] - 0.302).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn an_end_is_reported_once() {
        assert_eq!(zeros([-1.0, 1.0, 0.0, 0.0]), [1.0]);
        assert!(zeros([0.0, 1.0, 0.0, 0.0]).is_empty());
    }

    #[test]
    fn brent_reaches_the_last_bits() {
        let r = brent(|x| x * x - 2.0, 1.0, 2.0, -1.0, 2.0);
        assert!((r - std::f64::consts::SQRT_2).abs() <= 4.5e-16);
    }
}
