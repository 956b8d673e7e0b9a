//! Organisation of a path: the share of it that revisits earlier places, and the share that two
//! paths have in common.
//!
//! Trajectories are often compared by eye ("less organised", "another structure"). This module
//! measures both. A path is walked with dividers (Richardson 1961): a stride ends where the path
//! first is one stride's width from where the stride began, so that chatter finer than a stride (a
//! hysteretic switch makes much of it) counts for nothing. A stride is fresh if it ends farther
//! than a width from every place visited before.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::Sample;

/// Strides across the diagonal of the common box: the eye separates windings about a fortieth of a
/// panel apart.
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
    /// Walks `path`; lengths are measured in the box `range`, each coordinate relative to its
    /// extent, as a picture shows it.
    pub fn new(path: &[Sample], range: &[(f64, f64); 3]) -> Self {
        let scale = range.map(|(low, high)| STRIDES / (high - low).max(f64::MIN_POSITIVE));
        let place =
            |s: &Sample| -> [f64; 3] { std::array::from_fn(|i| (s.x[i] - range[i].0) * scale[i]) };
        let mut ends: Vec<[f64; 3]> = path.first().map(place).into_iter().collect();
        for pair in path.windows(2) {
            let (a, b) = (place(&pair[0]), place(&pair[1]));
            // Long chords are walked in quarters of a stride; the end of a stride is then exact to
            // that.
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
        (-1..=1)
            .flat_map(|a| (-1..=1).flat_map(move |b| (-1..=1).map(move |c| [i + a, j + b, k + c])))
            .any(|cell| {
                self.cells.get(&cell).is_some_and(|ends| {
                    ends.iter().any(|e| *e < before && squared(self.ends[*e], place) < 1.0)
                })
            })
    }

    /// Share of strides that end where the path has not been before: 1 for a path that never comes
    /// back to a place, 1/n for one that runs n times around a loop. The larger, the less
    /// organised.
    pub fn freshness(&self) -> f64 {
        let fresh = (0..self.ends.len())
            .filter(|k| !self.visited(self.ends[*k], k.saturating_sub(STILL_LEAVING)))
            .count();
        fresh as f64 / self.ends.len().max(1) as f64
    }

    /// Comparison with another path in the same box.
    pub fn compare(&self, other: &DividerWalk) -> Shared {
        let common = |a: &DividerWalk, b: &DividerWalk| {
            a.ends.iter().filter(|e| b.visited(**e, usize::MAX)).count()
        };
        let strides = [self.ends.len(), other.ends.len()];
        let both = [common(self, other), common(other, self)];
        Shared {
            strides,
            both,
            overlap: (both[0] + both[1]) as f64 / (strides[0] + strides[1]).max(1) as f64,
        }
    }
}

fn squared(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum()
}

/// The overlap of two paths.
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
    use twofold_num::elementary::{cos, sin};

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
        assert!(
            (q.freshness() - c.freshness()).abs() < 0.05,
            "{} {}",
            q.freshness(),
            c.freshness()
        );
    }

    fn straight(from: [f64; 3], to: [f64; 3]) -> [Sample; 2] {
        [Sample { t: 0.0, x: from }, Sample { t: 1.0, x: to }]
    }

    #[test]
    fn a_box_is_around_all_paths() {
        let (a, b) = (
            straight([1.0, -2.0, 0.5], [3.0, -5.0, 0.5]),
            straight([2.0, 7.0, 0.5], [-4.0, 0.0, 0.5]),
        );
        assert_eq!(common_box([&a[..], &b[..]]), [(-4.0, 3.0), (-5.0, 7.0), (0.5, 0.5)]);
    }

    #[test]
    fn strides_are_one_wide_to_a_quarter() {
        // 40 strides along each side, whatever the side's length: 120 around three of them.
        let range = [(-1.0, 1.0), (5.0, 5.5), (0.0, 80.0)];
        let corners = [[-1.0, 5.0, 0.0], [1.0, 5.0, 0.0], [1.0, 5.5, 0.0], [1.0, 5.5, 80.0]];
        let path: Vec<Sample> = corners.iter().map(|x| Sample { t: 0.0, x: *x }).collect();
        let walk = DividerWalk::new(&path, &range);
        assert!((96..=121).contains(&walk.ends.len()), "{}", walk.ends.len());
        for pair in walk.ends.windows(2) {
            assert!((1.0..1.5626).contains(&squared(pair[0], pair[1])), "{pair:?}");
        }
        assert_eq!(walk.freshness(), 1.0);
        let there_and_back =
            DividerWalk::new(&[path.clone(), path.into_iter().rev().collect()].concat(), &range);
        assert!((there_and_back.freshness() - 0.5).abs() < 0.04, "{}", there_and_back.freshness());
    }

    #[test]
    fn a_place_is_visited_if_an_earlier_stride_ended_near() {
        // Against all ends one by one; a hundred in a box of six strides, on both sides of zero.
        let mut random = twofold_num::random::RandomStream::new(7, 0);
        let ends: Vec<[f64; 3]> =
            (0..100).map(|_| [(); 3].map(|()| random.uniform_in(-3.0, 3.0))).collect();
        let mut cells: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
        for (k, end) in ends.iter().enumerate() {
            cells.entry(end.map(|x| x.floor() as i64)).or_default().push(k);
        }
        let walk = DividerWalk { ends, cells };
        let mut seen = [0; 2];
        for (k, place) in walk.ends.iter().enumerate() {
            for before in [0, k.saturating_sub(STILL_LEAVING), k, k + 1, 100] {
                let want = walk.ends[..before].iter().any(|e| squared(*e, *place) < 1.0);
                assert_eq!(walk.visited(*place, before), want, "{k} {before}");
                seen[usize::from(want)] += 1;
            }
        }
        assert!(seen[0] > 100 && seen[1] > 100, "{seen:?}");
    }

    #[test]
    fn paths_share_what_is_within_a_stride() {
        let range = [(0.0, 1.0); 3];
        let line = |y: f64| DividerWalk::new(&straight([0.01, y, 0.5], [0.99, y, 0.5]), &range);
        let (a, beside, apart) = (line(0.5), line(0.5 + 0.5 / STRIDES), line(0.5 + 2.0 / STRIDES));
        let n = a.ends.len();
        assert_eq!(a.compare(&beside), Shared { strides: [n; 2], both: [n; 2], overlap: 1.0 });
        assert_eq!(a.compare(&apart), Shared { strides: [n; 2], both: [0; 2], overlap: 0.0 });
        // Half as long: all of it, and half of the other.
        let half = DividerWalk::new(&straight([0.01, 0.5, 0.5], [0.5, 0.5, 0.5]), &range);
        let shared = a.compare(&half);
        assert!(
            shared.both[1] == shared.strides[1] && shared.both[0].abs_diff(shared.strides[1]) <= 1,
            "{shared:?}"
        );
        let want = (shared.both[0] + shared.both[1]) as f64
            / (shared.strides[0] + shared.strides[1]) as f64;
        assert_eq!(shared.overlap, want);
    }
}
