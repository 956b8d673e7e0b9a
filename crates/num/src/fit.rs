//! Straight lines, means and medians.

use super::elementary::sqrt;

/// A least-squares line y = intercept + slope x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// The slope.
    pub slope: f64,
    /// Its standard error.
    pub slope_error: f64,
    /// The value at x = 0.
    pub intercept: f64,
}

/// The line through the points (x, y); `None` with fewer than two different x. The error of the
/// slope comes from the scatter about the line (zero for two points).
///
/// ```
/// use twofold_num::fit::line;
/// let fit = line(&[(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)]).unwrap();
/// assert_eq!((fit.slope, fit.intercept, fit.slope_error), (2.0, 1.0, 0.0));
/// ```
pub fn line(points: &[(f64, f64)]) -> Option<Line> {
    let n = points.len() as f64;
    let (mut mx, mut my) = (0.0, 0.0);
    for (x, y) in points {
        mx += x / n;
        my += y / n;
    }
    let (mut sxx, mut sxy) = (0.0, 0.0);
    for (x, y) in points {
        sxx += (x - mx) * (x - mx);
        sxy += (x - mx) * (y - my);
    }
    if sxx <= 0.0 || !sxx.is_finite() || !sxy.is_finite() {
        return None;
    }
    let slope = sxy / sxx;
    let intercept = my - slope * mx;
    let residual: f64 =
        points.iter().map(|(x, y)| (y - intercept - slope * x) * (y - intercept - slope * x)).sum();
    let slope_error = if points.len() > 2 { sqrt(residual / (n - 2.0) / sxx) } else { 0.0 };
    Some(Line { slope, slope_error, intercept })
}

/// Mean and standard error of the mean of independent values.
pub fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    if values.len() < 2 {
        return (mean, f64::INFINITY);
    }
    let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0);
    (mean, sqrt(variance / n))
}

/// The middle value (upper of two); sorts its argument.
pub fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_line() {
        let l = line(&[(0.0, 1.0), (1.0, 3.0), (4.0, 9.0)]).unwrap();
        assert!(
            (l.slope - 2.0).abs() < 1e-15
                && (l.intercept - 1.0).abs() < 1e-15
                && l.slope_error < 1e-15
        );
        assert!(line(&[(1.0, 1.0), (1.0, 2.0)]).is_none());
    }

    #[test]
    fn mean_of_four() {
        let (m, e) = mean(&[1.0, 2.0, 3.0, 4.0]);
        assert!((m - 2.5).abs() < 1e-15 && (e - (5.0_f64 / 12.0).sqrt()).abs() < 1e-15);
    }

    #[test]
    fn a_line_through_scatter() {
        let l = line(&[(0.0, 0.0), (1.0, 2.0), (2.0, 1.0)]).unwrap();
        // Residuals -1/2, 1, -1/2 about y = 1/2 + x/2; one degree of freedom, sum of squares of x
        // about its mean 2.
        assert!((l.slope - 0.5).abs() < 1e-15 && (l.intercept - 0.5).abs() < 1e-15, "{l:?}");
        assert!((l.slope_error - 0.75_f64.sqrt()).abs() < 1e-15, "{l:?}");
        assert_eq!(
            line(&[(1.0, 5.0), (3.0, 9.0)]).unwrap(),
            Line { slope: 2.0, slope_error: 0.0, intercept: 3.0 }
        );
        assert!(line(&[(0.0, f64::INFINITY), (1.0, 0.0)]).is_none() && line(&[]).is_none());
        assert!(line(&[(f64::INFINITY, 0.0), (1.0, 0.0)]).is_none());
    }

    #[test]
    fn middles() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), 3.0);
        assert_eq!(mean(&[7.0]), (7.0, f64::INFINITY));
        assert_eq!(mean(&[1.0, 3.0]), (2.0, 1.0));
    }

    #[test]
    fn two_degrees_of_freedom() {
        // y = 0.3 + 0.8 x leaves -0.3, 0.9, -0.9, 0.3; sum of squares of x about its mean 5.
        let l = line(&[(0.0, 0.0), (1.0, 2.0), (2.0, 1.0), (3.0, 3.0)]).unwrap();
        assert!((l.slope - 0.8).abs() < 1e-15 && (l.intercept - 0.3).abs() < 1e-15, "{l:?}");
        assert!((l.slope_error - 0.18_f64.sqrt()).abs() < 1e-15, "{l:?}");
    }
}
