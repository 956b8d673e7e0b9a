//! The 0-1 test for chaos: Gottwald & Melbourne (2009), "On the implementation of the 0-1 test for
//! chaos", SIAM J. Appl. Dyn. Syst. 8, 129-145.

use twofold_num::elementary::{cos, sin, sqrt};
use twofold_num::fit::median;
use twofold_num::random::RandomStream;

/// Frequencies tried. The median over them is not disturbed by the few that resonate with the
/// signal.
const FREQUENCIES: usize = 60;

/// K of the 0-1 test for the sequence `phi`, by the correlation method on the mean-square
/// displacement with its oscillating term removed (their eqs 2.3 and 3.1). About 0 for regular,
/// about 1 for chaotic sequences; `None` below 100 terms.
///
/// ```
/// use twofold_analyse::attractor::zero_one;
/// // Iterates of the logistic map: period two at 3.2, chaos at 4.
/// let orbit = |r: f64| {
///     let step = move |x: &f64| Some(r * x * (1.0 - x));
///     std::iter::successors(Some(0.3), step).skip(100).take(1000).collect::<Vec<f64>>()
/// };
/// assert!(zero_one(&orbit(3.2)).is_some_and(|k| k < 0.1));
/// assert!(zero_one(&orbit(4.0)).is_some_and(|k| k > 0.9));
/// ```
pub fn zero_one(phi: &[f64]) -> Option<f64> {
    let n = phi.len();
    if n < 100 {
        return None;
    }
    // Displacements up to n/10, as they recommend.
    let lags = n / 10;
    let average = phi.iter().sum::<f64>() / n as f64;
    let variance = phi.iter().map(|p| (p - average) * (p - average)).sum::<f64>() / n as f64;
    if variance <= 0.0 {
        return Some(0.0);
    }
    let scale = 1.0 / sqrt(variance);
    // Frequencies in (pi/5, 4 pi/5), as they recommend; from a fixed stream so that K is a function
    // of the data.
    let mut random = RandomStream::new(0x0001, 0x0001);
    let mut ks: Vec<f64> = (0..FREQUENCIES)
        .map(|_| {
            let c = random.uniform_in(0.2, 0.8) * std::f64::consts::PI;
            let (mut p, mut q) = (Vec::with_capacity(n + 1), Vec::with_capacity(n + 1));
            let (mut a, mut b) = (0.0, 0.0);
            p.push(a);
            q.push(b);
            for (j, v) in phi.iter().enumerate() {
                let angle = (j + 1) as f64 * c;
                let v = (v - average) * scale;
                a += v * cos(angle);
                b += v * sin(angle);
                p.push(a);
                q.push(b);
            }
            let count = n - lags;
            let displacement: Vec<f64> = (1..=lags)
                .map(|m| {
                    let mut sum = 0.0;
                    for j in 0..count {
                        let (dp, dq) = (p[j + m] - p[j], q[j + m] - q[j]);
                        sum += dp * dp + dq * dq;
                    }
                    // The oscillating term vanishes here because the mean was subtracted.
                    sum / count as f64
                })
                .collect();
            correlation_with_index(&displacement)
        })
        .collect();
    Some(median(&mut ks))
}

/// Correlation coefficient of a sequence with 1, 2, 3, ...
fn correlation_with_index(d: &[f64]) -> f64 {
    let n = d.len() as f64;
    let mx = (n + 1.0) / 2.0;
    let my = d.iter().sum::<f64>() / n;
    let (mut sxx, mut sxy, mut syy) = (0.0, 0.0, 0.0);
    for (i, v) in d.iter().enumerate() {
        let (x, y) = ((i + 1) as f64 - mx, v - my);
        sxx += x * x;
        sxy += x * y;
        syy += y * y;
    }
    if syy <= 0.0 { 0.0 } else { sxy / sqrt(sxx * syy) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logistic_map() {
        // Gottwald & Melbourne's example: x -> mu x (1 - x), periodic at 3.55 and chaotic at 3.97.
        let orbit = |mu: f64| {
            let mut x = 0.1;
            (0..1200)
                .map(|_| {
                    x = mu * x * (1.0 - x);
                    x
                })
                .skip(200)
                .collect::<Vec<_>>()
        };
        let (periodic, chaotic) =
            (zero_one(&orbit(3.55)).unwrap(), zero_one(&orbit(3.97)).unwrap());
        assert!(periodic.abs() < 0.1, "{periodic}");
        assert!(chaotic > 0.9, "{chaotic}");
    }

    #[test]
    fn rotation_is_regular() {
        let phi: Vec<f64> =
            (0..1000).map(|i| sin(2.0 * i as f64) + 0.3 * cos(0.7 + 4.0 * i as f64)).collect();
        assert!(zero_one(&phi).unwrap().abs() < 0.1);
    }

    #[test]
    fn too_short_is_no_answer() {
        assert_eq!(zero_one(&[1.0; 99]), None);
    }

    #[test]
    fn a_slow_oscillation_and_a_shifted_one_are_regular() {
        // A seventh of the slowest frequency tried; with a mean a hundred times its size.
        for shift in [0.0, 100.0] {
            let phi: Vec<f64> =
                (0..1000).map(|i| shift + 0.01 * sin(0.15 * f64::from(i))).collect();
            assert!(zero_one(&phi).unwrap().abs() < 0.1, "{shift}: {:?}", zero_one(&phi));
        }
    }

    #[test]
    fn correlations_of_short_sequences_by_hand() {
        assert!((correlation_with_index(&[5.0, 7.0, 9.0, 11.0]) - 1.0).abs() < 1e-15);
        assert!((correlation_with_index(&[3.0, 2.0, 1.0]) + 1.0).abs() < 1e-15);
        assert_eq!(correlation_with_index(&[1.0, -1.0, -1.0, 1.0]), 0.0);
        // Deviations -1.5, -0.5, 0.5, 1.5 and -0.75, 0.25, 1.25, -0.75 have the products' sum 0.5.
        let want = 0.5 / sqrt(5.0 * 2.75);
        assert!((correlation_with_index(&[0.0, 1.0, 2.0, 0.0]) - want).abs() < 1e-15);
        assert_eq!(correlation_with_index(&[4.0; 5]), 0.0);
    }

    #[test]
    fn it_is_what_its_definition_says() {
        // Displacements as sums over the stretch itself, squared and averaged; the median over the
        // same frequencies.
        let mut x = 0.1;
        let mut chaotic = || {
            x = 3.8 * x * (1.0 - x);
            x
        };
        let phi: Vec<f64> =
            (0..120).map(|i| 3.0 + sin(1.3 * f64::from(i)) + 0.4 * chaotic()).collect();
        let average = phi.iter().sum::<f64>() / 120.0;
        let mut random = RandomStream::new(0x0001, 0x0001);
        let mut ks: Vec<f64> = (0..FREQUENCIES)
            .map(|_| {
                let c = random.uniform_in(0.2 * std::f64::consts::PI, 0.8 * std::f64::consts::PI);
                let displacement = |m: usize| -> f64 {
                    let square = |j: usize| {
                        let part = |wave: fn(f64) -> f64| -> f64 {
                            (j..j + m).map(|k| (phi[k] - average) * wave((k + 1) as f64 * c)).sum()
                        };
                        let (p, q) = (part(cos), part(sin));
                        p * p + q * q
                    };
                    (0..108).map(square).sum::<f64>() / 108.0
                };
                correlation_with_index(&(1..=12).map(displacement).collect::<Vec<_>>())
            })
            .collect();
        let want = median(&mut ks);
        let got = zero_one(&phi).unwrap();
        assert!((got - want).abs() < 1e-9 && want > 0.02 && want < 0.98, "{got} {want}");
        assert_eq!((zero_one(&phi[..100]).is_some(), zero_one(&[2.0; 100])), (true, Some(0.0)));
    }
}
