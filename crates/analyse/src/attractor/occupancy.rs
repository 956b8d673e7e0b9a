//! Contrast between islands and sea, which noise reduces.
//!
//! Long-lived chaos of a conservative kind, or one that is nearly so, fills a sea around islands
//! that it never enters. Noise lets the orbit leak into them, and in the end they are as dense as
//! the sea. How much emptier the islands still are is the structure that is left.

use serde::{Deserialize, Serialize};

use super::{SectionPoint, Thresholds};
use twofold_num::random::RandomStream;

/// Density contrast between the sea and the islands of noise-free runs in a noisy run.
///
/// The sea is every cell that a noise-free run visits; an island is a hole of several cells in it.
/// With the densities of points per cell, the contrast is 1 - (density in islands)/(density in
/// sea): 1 when no point is in an island, 0 when islands are as dense as the sea, negative when the
/// run stays in islands. It is calibrated on the noise-free runs themselves, each against the sea
/// of the others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contrast {
    /// The contrast.
    pub value: f64,
    /// Its 95 % interval, from resampling blocks of time (Kunsch 1989).
    pub interval: [f64; 2],
    /// Smallest and largest contrast of a noise-free run against the sea of the others.
    pub free: [f64; 2],
    /// Noise-free runs.
    pub free_runs: usize,
    /// Share of islands in the area of islands and sea.
    pub island_share: f64,
    /// Share of the section's points that lie in neither.
    pub outside: f64,
    /// Points of the section.
    pub points: usize,
}

/// Blocks of time that are resampled: each far longer than the return time, and enough of them for
/// an interval.
const BLOCKS: usize = 32;
/// Resamples.
const RESAMPLES: usize = 2000;
/// The share of resamples beyond each end of an interval.
const TAIL: f64 = 0.025;

/// Compares `section` with the runs of `free`; `None` with fewer than two of those, few points, or
/// no island among them. Directions are kept apart: a point that one section has going up and the
/// other going down is not common to both.
pub fn contrast(
    section: &[SectionPoint],
    free: &[Vec<SectionPoint>],
    thresholds: &Thresholds,
) -> Option<Contrast> {
    let all = || free.iter().flatten();
    if free.len() < 2 || section.len() < 100 || all().count() < 100 {
        return None;
    }
    // Upward points, and downward ones moved out of the way.
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for p in all().chain(section) {
        (least, most) = (least.min(p.u[0]), most.max(p.u[0]));
    }
    let shift = 1.25 * (most - least);
    let apart = |s: &[SectionPoint]| -> Vec<[f64; 2]> {
        s.iter().map(|p| if p.upward { p.u } else { [p.u[0] + shift, p.u[1]] }).collect()
    };
    let runs: Vec<Vec<[f64; 2]>> = free.iter().map(|run| apart(run)).collect();
    let pooled: Vec<[f64; 2]> = runs.concat();
    // The grid is twice as wide as one direction's picture.
    let grid = Grid::around(&pooled, thresholds.cells);
    let map = Map::of(&grid, &pooled, thresholds.island_cells)?;
    let section = apart(section);
    let value = map.contrast(&grid, &section)?;
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for i in 0..runs.len() {
        let others: Vec<[f64; 2]> =
            runs.iter().enumerate().filter(|(j, _)| *j != i).flat_map(|(_, r)| r.clone()).collect();
        if let Some(one) = Map::of(&grid, &others, thresholds.island_cells)
            .and_then(|m| m.contrast(&grid, &runs[i]))
        {
            range = [range[0].min(one), range[1].max(one)];
        }
    }
    if range[0] > range[1] {
        return None;
    }
    let length = section.len().div_ceil(BLOCKS);
    let blocks: Vec<[f64; 2]> =
        section.chunks(length).map(|block| map.counts(&grid, block)).collect();
    let mut random = RandomStream::new(0x0b1, 0);
    let mut resampled: Vec<f64> = (0..RESAMPLES)
        .filter_map(|_| {
            let mut sum = [0.0; 2];
            for _ in 0..blocks.len() {
                let block = blocks
                    [((random.uniform() * blocks.len() as f64) as usize).min(blocks.len() - 1)];
                sum = [sum[0] + block[0], sum[1] + block[1]];
            }
            map.of_counts(sum)
        })
        .collect();
    resampled.sort_by(f64::total_cmp);
    let at =
        |q: f64| resampled.get((resampled.len().saturating_sub(1) as f64 * q) as usize).copied();
    let counts = map.counts(&grid, &section);
    Some(Contrast {
        value,
        interval: [at(TAIL)?, at(1.0 - TAIL)?],
        free: range,
        free_runs: free.len(),
        island_share: map.area[0] / (map.area[0] + map.area[1]),
        outside: 1.0 - (counts[0] + counts[1]) / section.len() as f64,
        points: section.len(),
    })
}

/// The kind of a cell.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    Island,
    Sea,
    Outside,
}

/// Islands and sea of a set of points.
struct Map {
    places: Vec<Place>,
    /// Cells of islands and of sea.
    area: [f64; 2],
}

impl Map {
    /// `None` without islands.
    fn of(grid: &Grid, points: &[[f64; 2]], island_cells: usize) -> Option<Self> {
        let side = grid.cells + 2;
        let visited = grid.count(points);
        // Unvisited cells connected to the border are outside; other holes are islands if they are
        // large enough.
        let mut places: Vec<Option<Place>> =
            visited.iter().map(|n| (*n > 0).then_some(Place::Sea)).collect();
        let hole = |from: usize, places: &mut Vec<Option<Place>>| -> Vec<usize> {
            let mut found = vec![from];
            places[from] = Some(Place::Outside);
            let mut next = 0;
            while let Some(&cell) = found.get(next) {
                next += 1;
                let (a, b) = (cell / side, cell % side);
                let neighbours = [
                    (a > 0).then(|| cell - side),
                    (a + 1 < side).then(|| cell + side),
                    (b > 0).then(|| cell - 1),
                    (b + 1 < side).then(|| cell + 1),
                ];
                for neighbour in neighbours.into_iter().flatten() {
                    if places[neighbour].is_none() {
                        places[neighbour] = Some(Place::Outside);
                        found.push(neighbour);
                    }
                }
            }
            found
        };
        for cell in 0..side * side {
            let border = cell / side == 0
                || cell / side + 1 == side
                || cell % side == 0
                || cell % side + 1 == side;
            if border && places[cell].is_none() {
                hole(cell, &mut places);
            }
        }
        for cell in 0..side * side {
            if places[cell].is_none() {
                let found = hole(cell, &mut places);
                if found.len() >= island_cells {
                    found.into_iter().for_each(|c| places[c] = Some(Place::Island));
                }
            }
        }
        let places: Vec<Place> = places.into_iter().map(|p| p.unwrap_or(Place::Outside)).collect();
        let area = [Place::Island, Place::Sea]
            .map(|kind| places.iter().filter(|p| **p == kind).count() as f64);
        (area[0] > 0.0).then_some(Self { places, area })
    }

    /// Points in islands and in the sea.
    fn counts(&self, grid: &Grid, points: &[[f64; 2]]) -> [f64; 2] {
        let mut counts = [0.0; 2];
        for q in points {
            match self.places[grid.cell(q)] {
                Place::Island => counts[0] += 1.0,
                Place::Sea => counts[1] += 1.0,
                Place::Outside => {}
            }
        }
        counts
    }

    fn of_counts(&self, [islands, sea]: [f64; 2]) -> Option<f64> {
        // Without a point in the sea all are in islands: as far from structure as can be counted.
        (islands + sea > 0.0)
            .then(|| 1.0 - (islands / self.area[0]) / (sea.max(1.0) / self.area[1]))
    }

    fn contrast(&self, grid: &Grid, points: &[[f64; 2]]) -> Option<f64> {
        self.of_counts(self.counts(grid, points))
    }
}

/// The number of separate pieces that consecutive `points` visit in turn: the largest k for which
/// no cell of the grid holds points of two different phases modulo k.
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

/// A grid of square-ish cells around a set, with one more ring of cells that collects everything
/// outside.
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
        let width =
            std::array::from_fn(|k| ((high[k] - low[k]) / cells as f64).max(f64::MIN_POSITIVE));
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
            // The upper edge of the box belongs to its last cell, and what is less than a cell
            // beyond it.
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
    use twofold_num::elementary::sqrt;

    /// Points of a disc with a round hole, into which a share `leak` of the points that would fall
    /// there may go.
    fn sea(n: usize, leak: f64, stream: u64) -> Vec<SectionPoint> {
        let mut r = RandomStream::new(11, stream);
        let mut points = Vec::new();
        while points.len() < n {
            let u = [r.uniform_in(-1.0, 1.0), r.uniform_in(-1.0, 1.0)];
            let from_hole = sqrt((u[0] - 0.3) * (u[0] - 0.3) + u[1] * u[1]);
            let inside = from_hole < 0.3;
            if u[0] * u[0] + u[1] * u[1] < 1.0 && (!inside || r.uniform() < leak) {
                points.push(SectionPoint {
                    t: points.len() as f64,
                    u,
                    upward: points.len() % 2 == 0,
                });
            }
        }
        points
    }

    #[test]
    fn contrast_is_what_has_not_leaked() {
        let free: Vec<_> = (0..4).map(|k| sea(20_000, 0.0, k)).collect();
        let of = |leak: f64| contrast(&sea(6_000, leak, 9), &free, &Thresholds::default()).unwrap();
        for leak in [0.0, 0.2, 0.6, 1.0] {
            let c = of(leak);
            assert!((c.value - (1.0 - leak)).abs() < 0.08, "{leak}: {c:?}");
            assert!(
                c.interval[0] <= c.value
                    && c.value <= c.interval[1]
                    && c.interval[1] - c.interval[0] < 0.25,
                "{c:?}"
            );
            // Noise-free runs score what they should, unlike halves of one run.
            assert!(c.free[0] > 0.9 && c.free[1] <= 1.0, "{c:?}");
        }
        // The hole's area: 0.09 of the disc's.
        assert!((of(0.0).island_share - 0.09).abs() < 0.03, "{:?}", of(0.0));
    }

    #[test]
    fn the_cells_hardly_matter() {
        let free: Vec<_> = (0..4).map(|k| sea(40_000, 0.0, k)).collect();
        let values = [32, 64, 96].map(|cells| {
            let thresholds = Thresholds { cells, ..Thresholds::default() };
            contrast(&sea(8_000, 0.4, 9), &free, &thresholds).unwrap().value
        });
        assert!(values.iter().all(|v| (v - 0.6).abs() < 0.08), "{values:?}");
    }

    #[test]
    fn without_islands_there_is_nothing_to_compare() {
        let full: Vec<_> = (0..3).map(|k| sea(40_000, 1.0, k)).collect();
        assert_eq!(contrast(&sea(4000, 1.0, 8), &full, &Thresholds::default()), None);
        assert_eq!(contrast(&sea(4000, 1.0, 8), &full[..1], &Thresholds::default()), None);
    }

    #[test]
    fn each_run_without_noise_is_held_against_the_others() {
        // The last one is short and fills the hole like the rest: of its own few points it would be
        // a structure, of the others' it has none.
        let free: Vec<_> =
            (0..4).map(|k| if k < 3 { sea(20_000, 0.0, k) } else { sea(600, 1.0, k) }).collect();
        let found = contrast(&sea(4000, 0.0, 9), &free, &Thresholds::default()).unwrap();
        assert!(found.free[0].abs() < 0.4 && found.free[1] > 0.95, "{found:?}");
    }

    #[test]
    fn directions_are_kept_apart() {
        // Upwards the hole is empty, downwards it is as full as the rest: on each other they would
        // have no island.
        let half = |n: usize, stream: u64| -> Vec<SectionPoint> {
            let open = sea(n, 1.0, stream).into_iter().filter(|p| !p.upward);
            sea(n, 0.0, stream + 100).into_iter().filter(|p| p.upward).chain(open).collect()
        };
        let free: Vec<_> = (0..4).map(|k| half(20_000, k)).collect();
        let found = contrast(&half(6000, 9), &free, &Thresholds::default()).unwrap();
        assert!(found.value > 0.9 && (found.island_share - 0.045).abs() < 0.015, "{found:?}");
        assert!((found.points, found.free_runs) == (6000, 4) && found.outside < 0.02, "{found:?}");
    }

    #[test]
    fn what_lies_outside_is_told() {
        let free: Vec<_> = (0..4).map(|k| sea(20_000, 0.0, k)).collect();
        let mut section = sea(4000, 0.0, 9);
        // A quarter of the points far away, in every direction.
        for (k, p) in section.iter_mut().step_by(4).enumerate() {
            p.u = [[9.0, 0.0], [-9.0, 0.0], [0.3, 9.0], [0.3, -9.0]][k % 4];
        }
        let found = contrast(&section, &free, &Thresholds::default()).unwrap();
        assert!((found.outside - 0.25).abs() < 0.02 && found.value > 0.95, "{found:?}");
    }

    #[test]
    fn a_grid_has_a_ring_of_cells_for_all_that_is_outside() {
        // 4 by 4 cells of 1 by 10 from (-2, 20), in a ring: rows of six.
        let grid = Grid::around(&[[-2.0, 60.0], [2.0, 20.0], [0.0, 30.0]], 4);
        for (q, row, column) in [
            ([-2.0, 20.0], 1, 1),
            ([-1.5, 35.0], 1, 2),
            ([0.5, 59.0], 3, 4),
            // The upper edges belong to the last cells.
            ([2.0, 60.0], 4, 4),
            ([-9.0, 25.0], 0, 1),
            ([9.0, 25.0], 5, 1),
            ([-1.5, 0.0], 1, 0),
            ([-1.5, 99.0], 1, 5),
        ] {
            assert_eq!(grid.cell(&q), row * 6 + column, "{q:?}");
        }
        assert_eq!(grid.count(&[[0.5, 59.0], [0.5, 51.0], [2.0, 60.0]]).iter().sum::<u32>(), 3);
        assert_eq!(grid.count(&[[0.5, 59.0], [0.5, 51.0]])[3 * 6 + 4], 2);
    }

    #[test]
    fn islands_are_the_holes_that_are_large_enough() {
        // Visited cells of a picture, on a grid of 8 by 8: a hole of four cells, one of two, and a
        // bay that is open.
        let picture = [
            "########", "#..##..#", "#..#####", "########", "##.....#", "####...#", "########",
            "###.####",
        ];
        let cells = |wanted: u8| -> Vec<[f64; 2]> {
            let all = (0..64)
                .map(|k| (k / 8, k % 8))
                .filter(|(a, b)| picture[*a].as_bytes()[*b] == wanted);
            all.map(|(a, b)| [a as f64 + 0.5, b as f64 + 0.5]).collect()
        };
        let grid = Grid { low: [0.0; 2], width: [1.0; 2], cells: 8 };
        let visited = cells(b'#');
        assert_eq!(visited.len(), 64 - 4 - 2 - 8 - 1);
        for (fewest, islands) in [(1, 14.0), (2, 14.0), (3, 12.0), (4, 12.0), (5, 8.0), (8, 8.0)] {
            let map = Map::of(&grid, &visited, fewest).unwrap();
            assert_eq!(map.area, [islands, 49.0], "{fewest}");
            // The open bay is outside, the others are islands or nothing.
            assert_eq!(map.counts(&grid, &cells(b'.')), [islands, 0.0]);
            assert_eq!(map.counts(&grid, &visited), [0.0, 49.0]);
            // Two points in islands and one in the sea, by area.
            let want = 1.0 - (2.0 / islands) / (1.0 / 49.0);
            assert!((map.of_counts([2.0, 1.0]).unwrap() - want).abs() < 1e-12);
        }
        assert!(Map::of(&grid, &visited, 9).is_none());
        // A hole that winds down, to the left and up again, and begins at its upper end, is one.
        let hook = [[1, 5], [2, 5], [3, 5], [3, 4], [3, 3], [2, 3]];
        let around = (0..64).map(|k| [k / 8, k % 8]).filter(|cell| !hook.contains(cell));
        let around: Vec<[f64; 2]> = around.map(|cell| cell.map(|c| f64::from(c) + 0.5)).collect();
        assert_eq!(Map::of(&grid, &around, 6).unwrap().area, [6.0, 58.0]);
    }

    #[test]
    fn bands_are_visited_in_turn() {
        let mut r = RandomStream::new(4, 0);
        let places = [[0.0, 0.0], [1.0, 0.2], [0.4, 1.0]];
        let mut near = |i: usize| places[i].map(|c| c + 0.05 * r.uniform());
        let th = Thresholds::default();
        let in_turn: Vec<[f64; 2]> = (0..300).map(|i| near(i % 3)).collect();
        assert_eq!(bands(&in_turn, &th), 3);
        assert_eq!(bands(&(0..300).map(|i| near(i % 2)).collect::<Vec<_>>(), &th), 2);
        // Two here, one there, and back: no order by threes; by fours there is.
        assert_eq!(bands(&(0..300).map(|i| near([0, 0, 1, 2][i % 4])).collect::<Vec<_>>(), &th), 1);
        assert_eq!(bands(&(0..300).map(|i| near((i / 2) % 3)).collect::<Vec<_>>(), &th), 1);
        // Thirty of each are asked for.
        assert_eq!(
            (bands(&in_turn[..89], &th), bands(&in_turn[..90], &th), bands(&[], &th)),
            (1, 3, 1)
        );
    }
}
