//! How much of one section's structure is left in another.

use serde::{Deserialize, Serialize};

use super::{SectionPoint, Thresholds};
use crate::num::random::RandomStream;

/// Comparison of a section with a reference, on a grid of cells.
///
/// The measure is the overlap of two histograms, sum_i min(p_i, q_i) = 1 - (total variation distance), the form of the
/// Sorensen (1948) coefficient for abundances (Bray & Curtis 1957). Finite samples of one density overlap by less
/// than 1, and samples of different ones by more than 0, so it is placed between two measured ends with the same number of
/// points:
/// - `same`: of one half of the reference (alternate points) with the other;
/// - `blurred`: of the reference with itself after its points were moved at random within cells `blur` times wider: the outline
///   kept, the fine structure gone.
///
/// `share` = (overlap - blurred)/(same - blurred): 1 when the section is as good a sample of the reference as the reference's
/// own half, 0 when it has no more of its structure than its outline. It falls
/// below 0 when the outline differs as well, and is reported as computed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Overlap {
    /// Share of the structure left.
    pub share: f64,
    /// Overlap of the section with the reference.
    pub overlap: f64,
    /// Overlap of the reference with itself.
    pub same: f64,
    /// Overlap of the reference with its blurred self.
    pub blurred: f64,
    /// Share of the reference's cells that the section also visits (without regard to how often).
    pub cells_kept: f64,
    /// Share of the section's cells that the reference never visits.
    pub cells_new: f64,
    /// Points compared, of each.
    pub points: usize,
}

/// Compares `section` with `reference`; `None` when either has fewer than about 200 points. Directions are kept apart: a point
/// that one section has going up and the other going down is not common to both.
pub fn overlap(section: &[SectionPoint], reference: &[SectionPoint], thresholds: &Thresholds) -> Option<Overlap> {
    // All upward points, then all downward ones moved out of the way; alternating directions would otherwise fall in step with
    // the strides below.
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for p in section.iter().chain(reference) {
        (least, most) = (least.min(p.u[0]), most.max(p.u[0]));
    }
    let shift = 1.25 * (most - least);
    let apart = |s: &[SectionPoint]| -> Vec<[f64; 2]> {
        let up = s.iter().filter(|p| p.upward).map(|p| p.u);
        let down = s.iter().filter(|p| !p.upward).map(|p| [p.u[0] + shift, p.u[1]]);
        up.chain(down).collect()
    };
    overlap_of_points(&apart(section), &apart(reference), thresholds)
}

/// [`overlap`] of plain points.
fn overlap_of_points(section: &[[f64; 2]], reference: &[[f64; 2]], thresholds: &Thresholds) -> Option<Overlap> {
    let halves: [Vec<[f64; 2]>; 2] = std::array::from_fn(|h| reference.iter().skip(h).step_by(2).copied().collect());
    // Equal numbers everywhere, spread over each whole run, or the finite-sample ends would not be comparable.
    let n = section.len().min(halves[1].len());
    if n < 100 {
        return None;
    }
    let thin = |p: &[[f64; 2]]| -> Vec<[f64; 2]> { (0..n).map(|i| p[i * p.len() / n]).collect() };
    let (a, b, s) = (thin(&halves[0]), thin(&halves[1]), thin(section));

    let grid = Grid::around(reference, thresholds.cells);
    let coarse = grid.width.map(|w| w * thresholds.blur as f64);
    let mut random = RandomStream::new(0x0b1, 0);
    let smeared: Vec<[f64; 2]> = b
        .iter()
        .map(|q| {
            std::array::from_fn(|k| {
                let corner = (((q[k] - grid.low[k]) / coarse[k]).floor()) * coarse[k] + grid.low[k];
                random.uniform_in(corner, corner + coarse[k])
            })
        })
        .collect();

    let (ha, hb, hs, hm) = (grid.count(&a), grid.count(&b), grid.count(&s), grid.count(&smeared));
    let common =
        |x: &[u32], y: &[u32]| x.iter().zip(y).map(|(p, q)| u64::from(*p.min(q))).sum::<u64>() as f64 / n as f64;
    let (overlap, same, blurred) = (common(&ha, &hs), common(&ha, &hb), common(&ha, &hm));
    let share = if same > blurred { (overlap - blurred) / (same - blurred) } else { f64::NAN };
    let visited = |x: &[u32]| x.iter().filter(|c| **c > 0).count() as f64;
    let both = ha.iter().zip(&hs).filter(|(p, q)| **p > 0 && **q > 0).count() as f64;
    Some(Overlap {
        share: if share.is_nan() { 0.0 } else { share },
        overlap,
        same,
        blurred,
        cells_kept: both / visited(&ha),
        cells_new: 1.0 - both / visited(&hs),
        points: n,
    })
}

/// The number of separate pieces that consecutive `points` visit in turn: the largest k for which no cell of the grid holds points
/// of two different phases modulo k.
pub(super) fn bands(points: &[[f64; 2]], thresholds: &Thresholds) -> usize {
    if points.is_empty() {
        return 1;
    }
    let grid = Grid::around(points, thresholds.cells);
    let cells: Vec<usize> = points.iter().map(|p| grid.cell(p)).collect();
    let apart = |k: usize| {
        let mut owner = vec![usize::MAX; (grid.cells + 2) * (grid.cells + 2)];
        cells.iter().enumerate().all(|(i, c)| {
            let first = owner[*c] == usize::MAX;
            if first {
                owner[*c] = i % k;
            }
            owner[*c] == i % k
        })
    };
    (2..=thresholds.longest_period)
        .rev()
        .find(|&k| points.len() >= k * thresholds.points_per_phase && apart(k))
        .unwrap_or(1)
}

/// A grid of square-ish cells around a set, with one more ring of cells that collects everything outside.
struct Grid {
    low: [f64; 2],
    width: [f64; 2],
    cells: usize,
}

impl Grid {
    fn around(points: &[[f64; 2]], cells: usize) -> Self {
        let (mut low, mut high) = (points[0], points[0]);
        for q in points {
            for k in 0..2 {
                low[k] = low[k].min(q[k]);
                high[k] = high[k].max(q[k]);
            }
        }
        let width = std::array::from_fn(|k| ((high[k] - low[k]) / cells as f64).max(f64::MIN_POSITIVE));
        Self { low, width, cells }
    }

    fn count(&self, points: &[[f64; 2]]) -> Vec<u32> {
        let mut counts = vec![0; (self.cells + 2) * (self.cells + 2)];
        for q in points {
            counts[self.cell(q)] += 1;
        }
        counts
    }

    fn cell(&self, q: &[f64; 2]) -> usize {
        let side = self.cells + 2;
        let [a, b]: [usize; 2] = std::array::from_fn(|k| {
            // The upper edge of the box belongs to its last cell.
            let c = ((q[k] - self.low[k]) / self.width[k]).floor();
            if c < 0.0 {
                0
            } else if c > self.cells as f64 {
                side - 1
            } else {
                (c as usize).min(self.cells - 1) + 1
            }
        });
        a * side + b
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::elementary::{cos, sin};

    /// Points on a spiral curve in the unit disc, displaced by `noise` in both coordinates.
    fn curve(n: usize, noise: f64, stream: u64) -> Vec<[f64; 2]> {
        let mut r = RandomStream::new(11, stream);
        (0..n)
            .map(|_| {
                let s = r.uniform();
                let angle = 30.0 * s;
                [s * cos(angle) + noise * r.normal(), s * sin(angle) + noise * r.normal()]
            })
            .collect()
    }

    #[test]
    fn share_falls_with_noise() {
        let reference = curve(20_000, 0.0, 0);
        let shares: Vec<f64> = [0.0, 0.01, 0.03, 0.3]
            .iter()
            .map(|&noise| {
                overlap_of_points(&curve(10_000, noise, 1), &reference, &Thresholds::default()).unwrap().share
            })
            .collect();
        assert!((shares[0] - 1.0).abs() < 0.03, "{shares:?}");
        assert!(shares.windows(2).all(|w| w[1] < w[0] - 0.1), "{shares:?}");
        assert!(shares[3] < 0.05, "{shares:?}");
    }

    #[test]
    fn another_place_shares_no_cell() {
        let reference = curve(4000, 0.0, 0);
        let away: Vec<[f64; 2]> = reference.iter().map(|q| [q[0] + 5.0, q[1]]).collect();
        let o = overlap_of_points(&away, &reference, &Thresholds::default()).unwrap();
        assert!(o.overlap == 0.0 && o.cells_kept == 0.0 && o.cells_new == 1.0, "{o:?}");
    }
}
