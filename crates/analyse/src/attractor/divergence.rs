//! Divergence of nearest neighbours: the largest exponent of a return map from its points alone
//! (Rosenstein, Collins & De Luca 1993, Physica D 65, 117-134; Kantz 1994, Phys. Lett. A 185,
//! 77-87), and their forecast skill (Farmer & Sidorowich 1987).
//!
//! A section of a three-dimensional flow is a map of the plane, so its points need no embedding.

use serde::{Deserialize, Serialize};

use twofold_num::elementary::{ln, sqrt};
use twofold_num::fit::{line, mean, median};

/// Returns followed.
const HORIZON: usize = 12;
/// Neighbours closer in time than this are on one strand of the orbit, not neighbours (Theiler
/// 1986).
const THEILER: usize = 12;
/// The fit ends when the mean distance has reached this share of the mean distance of unrelated
/// points: from there on distances saturate.
const SATURATION: f64 = 0.15;
/// Parts of the data whose slopes are compared to give a standard error.
const PARTS: usize = 8;
/// Most points searched.
const MOST_POINTS: usize = 20_000;

/// Statistics of nearest neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Divergence {
    /// Growth of ln(distance) per return.
    pub per_return: f64,
    /// Its standard error, from disjoint parts of the data.
    pub standard_error: f64,
    /// The same per unit time.
    pub per_time: f64,
    /// Returns that the fit covers, before distances saturate.
    pub returns_fitted: usize,
    /// 1 - (median distance of the images of neighbours)/(median distance of unrelated points): 1
    /// for a deterministic map seen finely, 0 for independent random points.
    pub skill: f64,
}

/// Nearest-neighbour statistics of the consecutive points `p` of a return map with mean return time
/// `return_time`; `None` below 200 points.
pub fn divergence(p: &[[f64; 2]], return_time: f64) -> Option<Divergence> {
    let p = &p[p.len().saturating_sub(MOST_POINTS)..];
    if p.len() < 200 {
        return None;
    }
    let pairs = nearest(p)?;
    // Unrelated points: a fixed stride apart, about a third of the data.
    let n = p.len();
    let mut unrelated: Vec<f64> = (0..n).map(|i| distance(&p[i], &p[(i + n / 3) % n])).collect();
    let typical = median(&mut unrelated);
    if typical <= 0.0 {
        return None;
    }
    let mut images: Vec<f64> = pairs.iter().map(|&(i, j)| distance(&p[i + 1], &p[j + 1])).collect();
    let skill = 1.0 - median(&mut images) / typical;

    let curve = |pairs: &[(usize, usize)]| -> Vec<f64> {
        (0..=HORIZON)
            .map(|m| {
                let (mut sum, mut count) = (0.0, 0.0);
                for &(i, j) in pairs {
                    let d = distance(&p[i + m], &p[j + m]);
                    if d > 0.0 {
                        sum += ln(d);
                        count += 1.0;
                    }
                }
                sum / count
            })
            .collect()
    };
    let whole = curve(&pairs);
    let limit = ln(SATURATION * typical);
    let last = (1..=HORIZON).take_while(|&m| whole[m] < limit).last().unwrap_or(1).max(2);
    // From the first return on: the search itself chose small distances at m = 0, a bias that the
    // first image loses.
    let slope = |c: &[f64]| {
        line(&(1..=last).map(|m| (m as f64, c[m])).collect::<Vec<_>>()).map(|l| l.slope)
    };
    let per_return = slope(&whole)?;
    let parts: Vec<f64> =
        pairs.chunks(pairs.len().div_ceil(PARTS)).filter_map(|c| slope(&curve(c))).collect();
    let (_, standard_error) = mean(&parts);
    Some(Divergence {
        per_return,
        standard_error,
        per_time: per_return / return_time,
        returns_fitted: last,
        skill,
    })
}

fn distance(a: &[f64; 2], b: &[f64; 2]) -> f64 {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    sqrt(dx * dx + dy * dy)
}

/// For each point that has `HORIZON` images, its nearest neighbour that is not on the same strand;
/// with points sorted into a grid of about one point a cell.
fn nearest(p: &[[f64; 2]]) -> Option<Vec<(usize, usize)>> {
    let n = p.len() - HORIZON;
    let p = &p[..n];
    let (mut low, mut high) = (p[0], p[0]);
    for q in p {
        for a in 0..2 {
            low[a] = low[a].min(q[a]);
            high[a] = high[a].max(q[a]);
        }
    }
    let extent = (high[0] - low[0]).max(high[1] - low[1]);
    if extent <= 0.0 || !extent.is_finite() {
        return None;
    }
    let side = (sqrt(n as f64) as usize).max(1);
    let width = extent / side as f64 * (1.0 + 1e-12);
    let cell = |q: &[f64; 2]| -> [usize; 2] {
        std::array::from_fn(|a| (((q[a] - low[a]) / width) as usize).min(side - 1))
    };
    let mut cells = vec![Vec::new(); side * side];
    for (i, q) in p.iter().enumerate() {
        let [a, b] = cell(q);
        cells[a * side + b].push(i);
    }
    let mut pairs = Vec::with_capacity(n);
    for (i, q) in p.iter().enumerate() {
        let [a, b] = cell(q);
        let mut best: Option<(f64, usize)> = None;
        for ring in 0..side {
            // Anything in a further ring is at least this far away.
            if best.is_some_and(|(d, _)| d <= (ring as f64 - 1.0) * width) {
                break;
            }
            let range = |c: usize| c.saturating_sub(ring)..=(c + ring).min(side - 1);
            for x in range(a) {
                for y in range(b) {
                    if x.abs_diff(a).max(y.abs_diff(b)) != ring {
                        continue;
                    }
                    for &j in &cells[x * side + y] {
                        let d = distance(q, &p[j]);
                        if i.abs_diff(j) > THEILER && best.is_none_or(|(least, _)| d < least) {
                            best = Some((d, j));
                        }
                    }
                }
            }
        }
        pairs.extend(best.map(|(_, j)| (i, j)));
    }
    Some(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_num::random::RandomStream;

    #[test]
    fn henon_map() {
        let (mut x, mut y) = (0.1, 0.1);
        let orbit: Vec<[f64; 2]> = (0..6000)
            .map(|_| {
                (x, y) = (1.0 - 1.4 * x * x + y, 0.3 * x);
                [x, y]
            })
            .skip(100)
            .collect();
        let d = divergence(&orbit, 1.0).unwrap();
        // Largest exponent 0.4192 per iteration (e.g. Sprott 2003); the points alone give it to a
        // tenth.
        assert!((d.per_return - 0.4192).abs() < 0.045, "{d:?}");
        assert!(d.skill > 0.95, "{d:?}");
    }

    #[test]
    fn independent_points_have_no_skill() {
        let mut r = RandomStream::new(3, 0);
        let points: Vec<[f64; 2]> = (0..3000).map(|_| [r.uniform(), r.uniform()]).collect();
        assert!(divergence(&points, 1.0).unwrap().skill < 0.1);
    }

    #[test]
    fn nearest_is_nearest() {
        let mut r = RandomStream::new(4, 0);
        let points: Vec<[f64; 2]> = (0..400).map(|_| [r.uniform(), 0.1 * r.uniform()]).collect();
        let n = points.len() - HORIZON;
        for (i, j) in nearest(&points).unwrap() {
            let least = (0..n)
                .filter(|k| k.abs_diff(i) > THEILER)
                .map(|k| distance(&points[i], &points[k]))
                .fold(f64::INFINITY, f64::min);
            assert_eq!(distance(&points[i], &points[j]), least);
        }
    }

    #[test]
    fn rates_are_per_return_and_per_time() {
        // Doubling of the circle, exactly ln 2 a return, as a curve in the plane; the digits of
        // chance keep it from ending at 0.
        let mut r = RandomStream::new(9, 0);
        let mut x: f64 = 0.3;
        let orbit: Vec<[f64; 2]> = (0..4000)
            .map(|_| {
                x = (2.0 * x + 1e-9 * r.uniform()).fract();
                let a = std::f64::consts::TAU * x;
                [twofold_num::elementary::cos(a) - 7.0, 3.0 + twofold_num::elementary::sin(a)]
            })
            .collect();
        let d = divergence(&orbit, 2.5).unwrap();
        assert!((d.per_return - std::f64::consts::LN_2).abs() < 0.03, "{d:?}");
        assert_eq!(d.per_time, d.per_return / 2.5);
        // Neighbours are some 5e-4 apart, and distances saturate at 0.19: 2^8.6 times that.
        assert!((7..=10).contains(&d.returns_fitted), "{d:?}");
        assert!(d.standard_error > 0.0 && d.standard_error < 0.05, "{d:?}");
        // In any unit the same.
        for unit in [1.0 / 1024.0, 1024.0] {
            let other: Vec<[f64; 2]> = orbit.iter().map(|p| p.map(|c| unit * c)).collect();
            let o = divergence(&other, 2.5).unwrap();
            assert!(
                (o.per_return - d.per_return).abs() < 1e-12 && o.skill == d.skill,
                "{d:?} {o:?}"
            );
            assert_eq!(o.returns_fitted, d.returns_fitted);
        }
    }

    #[test]
    fn points_that_return_exactly_are_passed_over() {
        let (mut x, mut y) = (0.1, 0.1);
        let mut orbit: Vec<[f64; 2]> = (0..3000)
            .map(|_| {
                (x, y) = (1.0 - 1.4 * x * x + y, 0.3 * x);
                [x, y]
            })
            .collect();
        let before = divergence(&orbit, 1.0).unwrap();
        orbit.extend_from_within(100..140);
        let after = divergence(&orbit, 1.0).unwrap();
        assert!((after.per_return - before.per_return).abs() < 0.02, "{before:?} {after:?}");
    }

    #[test]
    fn two_far_points_change_nothing() {
        let mut r = RandomStream::new(3, 0);
        let mut points: Vec<[f64; 2]> = (0..3000).map(|_| [r.uniform(), r.uniform()]).collect();
        (points[0], points[1]) = ([20.0, 20.0], [20.0, 20.0]);
        assert!(divergence(&points, 1.0).unwrap().skill.abs() < 0.1);
    }

    #[test]
    fn nearest_is_nearest_in_any_box() {
        let mut r = RandomStream::new(5, 0);
        for (low, size) in [
            ([0.1, -0.2], [1.0, 2.0]),
            ([-7.0, 4.0], [0.1, 1.0]),
            ([3.0, -9.0], [1.0, 0.3]),
            ([0.0, 0.0], [300.0, 2000.0]),
        ] {
            let points: Vec<[f64; 2]> =
                (0..300).map(|_| std::array::from_fn(|k| low[k] + size[k] * r.uniform())).collect();
            let n = points.len() - HORIZON;
            let pairs = nearest(&points).unwrap();
            assert_eq!(pairs.len(), n);
            for (i, j) in pairs {
                let others = (0..n).filter(|k| k.abs_diff(i) > THEILER);
                let least =
                    others.map(|k| distance(&points[i], &points[k])).fold(f64::INFINITY, f64::min);
                assert_eq!(distance(&points[i], &points[j]), least);
            }
        }
        // All in one place, or one nowhere: no box.
        assert_eq!(nearest(&[[1.0, 1.0]; 50]), None);
        let mut broken = [[1.0, 1.0]; 50];
        broken[3] = [f64::INFINITY, 0.0];
        assert_eq!(nearest(&broken), None);
    }
}
