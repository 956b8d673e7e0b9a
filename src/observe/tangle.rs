//! How organised a path is: whether it goes again where it has been, and how much of it two paths share.
//!
//! Figure 6 compares trajectories by eye ("less organisation", "changes in structure"). The measures here put numbers to that: the common
//! box of the paths is cut into cells; a path that is organised re-enters cells that it has visited before.

use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

use super::Sample;

/// Cells along each side of the box. A cell is then about as wide as the gap between two windings that the eye still separates
/// in a panel of the figure.
pub const CELLS: usize = 40;

/// The cells that a path visits.
#[derive(Clone, Debug, PartialEq)]
pub struct Tangle {
    visited: BTreeSet<[u16; 3]>,
    entries: usize,
}

/// The box around several paths: (low, high) for each coordinate.
pub fn common_box<'a>(paths: impl IntoIterator<Item = &'a [Sample]>) -> [(f64, f64); 3] {
    let mut range = [(f64::INFINITY, f64::NEG_INFINITY); 3];
    for sample in paths.into_iter().flatten() {
        for (r, x) in range.iter_mut().zip(sample.x) {
            *r = (r.0.min(x), r.1.max(x));
        }
    }
    range
}

impl Tangle {
    /// The cells of `range`, [`CELLS`] along each side, that the polyline through `path` visits.
    pub fn new(path: &[Sample], range: &[(f64, f64); 3]) -> Self {
        let width: [f64; 3] =
            std::array::from_fn(|i| ((range[i].1 - range[i].0) / CELLS as f64).max(f64::MIN_POSITIVE));
        let cell = |x: [f64; 3]| -> [u16; 3] {
            std::array::from_fn(|i| (((x[i] - range[i].0) / width[i]) as usize).min(CELLS - 1) as u16)
        };
        let mut visited = BTreeSet::new();
        let mut entries = 0;
        let mut here = None;
        for pair in path.windows(2) {
            // Points along the chord, a quarter of a cell apart: no cell on the way is jumped over but for its corners.
            let longest = (0..3).map(|i| ((pair[1].x[i] - pair[0].x[i]) / width[i]).abs()).fold(0.0, f64::max);
            let parts = (4.0 * longest).ceil().clamp(1.0, 1e6) as usize;
            for k in 0..parts {
                let s = k as f64 / parts as f64;
                let c = cell(std::array::from_fn(|i| pair[0].x[i] + s * (pair[1].x[i] - pair[0].x[i])));
                if here != Some(c) {
                    here = Some(c);
                    entries += 1;
                    visited.insert(c);
                }
            }
        }
        Self { visited, entries }
    }

    /// Share of the path's entries into cells that lead to a cell never visited before: 1 for a path that never comes
    /// back to a place, 1/n for one that runs n times around a loop. The larger, the less organised.
    pub fn freshness(&self) -> f64 {
        self.visited.len() as f64 / self.entries.max(1) as f64
    }

    /// Comparison with another path in the same box.
    pub fn compare(&self, other: &Tangle) -> Shared {
        let both = self.visited.intersection(&other.visited).count();
        let all = (self.visited.len() + other.visited.len()).max(1);
        Shared { cells: [self.visited.len(), other.visited.len()], both, overlap: 2.0 * both as f64 / all as f64 }
    }
}

/// What two paths have in common.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shared {
    /// Cells visited by each.
    pub cells: [usize; 2],
    /// Cells visited by both.
    pub both: usize,
    /// Overlap 2 both/(first + second), Sorensen (1948): 1 for the same shape, 0 for shapes without a common cell.
    pub overlap: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::elementary::{cos, sin};

    fn loops(n: f64, pitch: f64) -> Vec<Sample> {
        (0..(n * 400.0) as usize)
            .map(|k| {
                let a = std::f64::consts::TAU * k as f64 / 400.0;
                Sample { t: a, x: [cos(a), sin(a), pitch * a] }
            })
            .collect()
    }

    #[test]
    fn a_loop_is_organised_and_a_helix_is_not() {
        let (circle, helix) = (loops(10.0, 0.0), loops(10.0, 0.1));
        let range = common_box([&circle[..], &helix[..]]);
        let (c, h) = (Tangle::new(&circle, &range), Tangle::new(&helix, &range));
        assert!((c.freshness() - 0.1).abs() < 0.02, "{}", c.freshness());
        assert!(h.freshness() > 0.8, "{}", h.freshness());
        assert_eq!(c.compare(&c).overlap, 1.0);
        assert!(c.compare(&h).overlap < 0.3);
    }
}
