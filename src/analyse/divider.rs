//! How organised a path is: whether it goes again where it has been, and how much of it two paths share.
//!
//! Trajectories are often compared by eye ("less organised", "another structure"). Here numbers are put to that. A path is walked with
//! dividers (Richardson 1961): a stride ends where the path first is one stride's width from where the stride began, so
//! that chatter finer than a stride (a hysteretic switch makes much of it) counts for nothing. A stride is fresh if it ends farther than a
//! width from every place visited before.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::Sample;

/// Strides across the diagonal of the common box: the eye separates windings about a fortieth of a panel apart.
pub const STRIDES: f64 = 40.0;
/// The last strides are no sign of coming back: the path is still leaving them.
const STILL_LEAVING: usize = 4;

/// A path walked with dividers.
#[derive(Clone, Debug)]
pub struct DividerWalk {
    /// Ends of strides, in units of a stride.
    ends: Vec<[f64; 3]>,
    cells: BTreeMap<[i64; 3], Vec<usize>>,
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

impl DividerWalk {
    /// Walks `path`; lengths are measured in the box `range`, each coordinate relative to its extent, as a picture shows it.
    pub fn new(path: &[Sample], range: &[(f64, f64); 3]) -> Self {
        let scale = range.map(|(low, high)| STRIDES / (high - low).max(f64::MIN_POSITIVE));
        let place = |s: &Sample| -> [f64; 3] { std::array::from_fn(|i| (s.x[i] - range[i].0) * scale[i]) };
        let mut ends: Vec<[f64; 3]> = path.first().map(place).into_iter().collect();
        for pair in path.windows(2) {
            let (a, b) = (place(&pair[0]), place(&pair[1]));
            // Long chords are walked in quarters of a stride; the end of a stride is then exact to that.
            let parts = (4.0 * squared(a, b).sqrt()).ceil().clamp(1.0, 1e6) as usize;
            for k in 1..=parts {
                let s = k as f64 / parts as f64;
                let here: [f64; 3] = std::array::from_fn(|i| a[i] + s * (b[i] - a[i]));
                if squared(here, ends[ends.len() - 1]) >= 1.0 {
                    ends.push(here);
                }
            }
        }
        let mut cells: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
        for (k, end) in ends.iter().enumerate() {
            cells.entry(end.map(|x| x.floor() as i64)).or_default().push(k);
        }
        Self { ends, cells }
    }

    /// Whether an end of a stride numbered below `before` lies within one width of `place`.
    fn visited(&self, place: [f64; 3], before: usize) -> bool {
        let [i, j, k] = place.map(|x| x.floor() as i64);
        (-1..=1).flat_map(|a| (-1..=1).flat_map(move |b| (-1..=1).map(move |c| [i + a, j + b, k + c]))).any(|cell| {
            self.cells
                .get(&cell)
                .is_some_and(|ends| ends.iter().any(|e| *e < before && squared(self.ends[*e], place) < 1.0))
        })
    }

    /// Share of strides that end where the path has not been before: 1 for a path that never comes back to a place, 1/n for
    /// one that runs n times around a loop. The larger, the less organised.
    pub fn freshness(&self) -> f64 {
        let fresh =
            (0..self.ends.len()).filter(|k| !self.visited(self.ends[*k], k.saturating_sub(STILL_LEAVING))).count();
        fresh as f64 / self.ends.len().max(1) as f64
    }

    /// Comparison with another path in the same box.
    pub fn compare(&self, other: &DividerWalk) -> Shared {
        let common = |a: &DividerWalk, b: &DividerWalk| a.ends.iter().filter(|e| b.visited(**e, usize::MAX)).count();
        let strides = [self.ends.len(), other.ends.len()];
        let both = [common(self, other), common(other, self)];
        Shared { strides, both, overlap: (both[0] + both[1]) as f64 / (strides[0] + strides[1]).max(1) as f64 }
    }
}

fn squared(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum()
}

/// What two paths have in common.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shared {
    /// Strides of each.
    pub strides: [usize; 2],
    /// Strides of each that end within one width of the other.
    pub both: [usize; 2],
    /// Share of all strides that do: 1 for the same shape, 0 for shapes without a common place.
    pub overlap: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::elementary::{cos, sin};

    fn loops(n: f64, pitch: f64, chatter: f64) -> Vec<Sample> {
        (0..(n * 4000.0) as usize)
            .map(|k| {
                let a = std::f64::consts::TAU * k as f64 / 4000.0;
                let wobble = if k % 2 == 0 { chatter } else { -chatter };
                Sample { t: a, x: [cos(a), sin(a), pitch * a + wobble] }
            })
            .collect()
    }

    #[test]
    fn a_loop_is_organised_and_a_helix_is_not() {
        let (circle, helix) = (loops(10.0, 0.0, 0.0), loops(10.0, 0.1, 0.0));
        let range = common_box([&circle[..], &helix[..]]);
        let (c, h) = (DividerWalk::new(&circle, &range), DividerWalk::new(&helix, &range));
        assert!((c.freshness() - 0.1).abs() < 0.02, "{}", c.freshness());
        assert!(h.freshness() > 0.95, "{}", h.freshness());
        assert_eq!(c.compare(&c).overlap, 1.0);
        assert!(c.compare(&h).overlap < 0.3);
    }

    #[test]
    fn chatter_does_not_count() {
        let (quiet, chatter) = (loops(5.0, 0.1, 0.0), loops(5.0, 0.1, 0.02));
        let range = common_box([&quiet[..], &chatter[..]]);
        let (q, c) = (DividerWalk::new(&quiet, &range), DividerWalk::new(&chatter, &range));
        assert!((q.freshness() - c.freshness()).abs() < 0.05, "{} {}", q.freshness(), c.freshness());
    }
}
