//! Drawing of point clouds: coincident points are merged, few points are drawn large, and many
//! points are shaded by density.

use super::scene::{Position, UNITS_PER_POINT, units};
use super::sheet::{Colour, DotStyle};
use super::style;
use twofold_num::elementary;

/// Points of one colour, in drawing order.
pub struct Group {
    /// Colour.
    pub colour: Colour,
    /// Indices of its points among those given.
    pub members: Vec<usize>,
}

/// A cloud ready to be drawn.
pub struct Cloud {
    /// Diameter in units.
    pub diameter: i32,
    /// Groups, to be drawn one after another.
    pub groups: Vec<Group>,
}

/// Side of a cell in which points count as one place.
const PLACE: i32 = UNITS_PER_POINT / 2;
/// Side of a cell in which points are drawn only once: a quarter of a pixel.
const SAME: i32 = 3;

/// Arranges points at the given places on the sheet.
pub fn arrange(places: &[Position], look: &DotStyle) -> Cloud {
    let order = distinct(places);
    let counts = Counts::new(places);
    let diameter = look.diameter.unwrap_or_else(|| {
        let fitting = style::DOT_DIAMETER_PT.iter().find(|(most, _)| counts.occupied <= *most);
        fitting.map_or(style::DOT_DIAMETER_PT[0].1, |f| f.1)
    });
    // An even number of units, because a circle is drawn by its radius.
    let diameter = (units(diameter) / 2 * 2).max(2);
    if !look.density || counts.occupied <= style::DENSITY_FROM {
        return Cloud { diameter, groups: vec![Group { colour: look.colour, members: order }] };
    }
    let density: Vec<u32> = order.iter().map(|i| counts.around(places[*i])).collect();
    let mut sorted = density.clone();
    sorted.sort_unstable();
    // From the fifth to the 95th percentile of density on a logarithmic scale: single outliers do
    // not set the scale.
    let logarithm = |count: u32| elementary::ln(f64::from(count.max(1)));
    let quantile = |q: usize| logarithm(sorted[(sorted.len() - 1) * q / 100]);
    let (thin, dense) = (quantile(5), quantile(95));
    let top = style::DENSITY_LEVELS - 1;
    let level = |count: u32| {
        let share = if dense > thin {
            ((logarithm(count) - thin) / (dense - thin)).clamp(0.0, 1.0)
        } else {
            1.0
        };
        (share * top as f64).round() as usize
    };
    let most = sorted.last().map_or(0, |m| *m as usize);
    let levels: Vec<usize> = (0..=most.min(4096)).map(|count| level(count as u32)).collect();
    let mut groups: Vec<Group> = (0..style::DENSITY_LEVELS)
        .map(|level| {
            let white = style::DENSITY_LIGHTEST * (1.0 - level as f64 / top as f64);
            Group { colour: look.colour.lighten(white), members: Vec::new() }
        })
        .collect();
    for (i, count) in order.into_iter().zip(density) {
        let level = levels.get(count as usize).copied().unwrap_or_else(|| level(count));
        groups[level].members.push(i);
    }
    Cloud { diameter, groups }
}

/// One point for each cell of side [`SAME`], the first given, in rows from the top: neighbours
/// follow each other, which keeps the vector files small.
fn distinct(places: &[Position]) -> Vec<usize> {
    let Some(bounds) = Bounds::of(places, SAME) else { return Vec::new() };
    if bounds.rows > 1 << 20 || bounds.columns > 1 << 20 || places.len() > 1 << 24 {
        // Far beyond any sheet; the packed keys below would not hold it.
        return (0..places.len()).collect();
    }
    let mut keys: Vec<u64> = places
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let (row, column) = bounds.cell(*p);
            (row as u64) << 44 | (column as u64) << 24 | i as u64
        })
        .collect();
    keys.sort_unstable();
    keys.dedup_by_key(|k| *k >> 24);
    keys.into_iter().map(|k| (k & 0xff_ffff) as usize).collect()
}

/// A grid of square cells over the places of points.
struct Bounds {
    first: (i32, i32),
    side: i32,
    rows: usize,
    columns: usize,
}

impl Bounds {
    fn of(places: &[Position], side: i32) -> Option<Self> {
        let low = |f: fn(&Position) -> i32| places.iter().map(f).min();
        let high = |f: fn(&Position) -> i32| places.iter().map(f).max();
        let (x0, y0) = (low(|p| p.0)?.div_euclid(side), low(|p| p.1)?.div_euclid(side));
        let (x1, y1) = (high(|p| p.0)?.div_euclid(side), high(|p| p.1)?.div_euclid(side));
        Some(Self {
            first: (x0, y0),
            side,
            rows: (y1 - y0 + 1) as usize,
            columns: (x1 - x0 + 1) as usize,
        })
    }

    /// Row and column of the cell that holds a place.
    fn cell(&self, p: Position) -> (usize, usize) {
        (
            (p.1.div_euclid(self.side) - self.first.1) as usize,
            (p.0.div_euclid(self.side) - self.first.0) as usize,
        )
    }
}

/// Number of points in each cell of side [`PLACE`].
struct Counts {
    bounds: Option<Bounds>,
    cells: Vec<u32>,
    occupied: usize,
}

impl Counts {
    fn new(places: &[Position]) -> Self {
        let bounds = Bounds::of(places, PLACE);
        let mut cells = vec![0u32; bounds.as_ref().map_or(0, |b| b.rows * b.columns)];
        let mut occupied = 0;
        if let Some(b) = &bounds {
            for p in places {
                let (row, column) = b.cell(*p);
                let cell = &mut cells[row * b.columns + column];
                occupied += usize::from(*cell == 0);
                *cell += 1;
            }
        }
        Self { bounds, cells, occupied }
    }

    /// Number of points in the cell of a place and the eight around it.
    fn around(&self, p: Position) -> u32 {
        let Some(b) = &self.bounds else { return 0 };
        let (row, column) = b.cell(p);
        let columns = column.saturating_sub(1)..(column + 2).min(b.columns);
        let rows = row.saturating_sub(1)..(row + 2).min(b.rows);
        rows.map(|r| self.cells[r * b.columns..][columns.clone()].iter().sum::<u32>()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_places_visited_often_become_two_large_dots() {
        let places: Vec<Position> =
            (0..20_000).map(|i| if i % 2 == 0 { (1000, 1000) } else { (9000, 1000) }).collect();
        let cloud = arrange(&places, &DotStyle::late());
        assert_eq!(cloud.groups.len(), 1);
        assert_eq!(cloud.groups[0].members, [0, 1]);
        assert!(cloud.diameter >= units(4.0));
    }

    #[test]
    fn dense_places_are_darker_than_sparse_ones() {
        let mut places: Vec<Position> =
            (0..30_000).map(|i| (i % 173 * 100, i / 173 * 100)).collect();
        places.extend((0..30_000).map(|i| (5_000 + i % 100 * 3, 5_000 + i / 100 * 3)));
        let cloud = arrange(&places, &DotStyle::late());
        assert_eq!(cloud.groups.len(), style::DENSITY_LEVELS);
        let level = |i: usize| cloud.groups.iter().position(|g| g.members.contains(&i));
        assert_eq!(level(60), Some(0));
        assert_eq!(level(30_000 + 150 * 100 + 50), Some(style::DENSITY_LEVELS - 1));
        let drawn: usize = cloud.groups.iter().map(|g| g.members.len()).sum();
        assert!(drawn <= 60_000 && drawn > 59_000, "{drawn}");
    }

    #[test]
    fn neighbourhoods_count_all_nine_cells() {
        let cells = [(0, 0), (0, 1), (0, 1), (1, 2), (-1, 0), (5, 5), (0, 3), (-1, -1)];
        let places: Vec<Position> =
            cells.iter().map(|c| (c.0 * PLACE + 3, c.1 * PLACE + PLACE - 1)).collect();
        let counts = Counts::new(&places);
        assert_eq!(counts.occupied, 7);
        for (p, c) in places.iter().zip(&cells) {
            let near =
                cells.iter().filter(|d| (d.0 - c.0).abs() <= 1 && (d.1 - c.1).abs() <= 1).count();
            assert_eq!(counts.around(*p) as usize, near, "{c:?}");
        }
    }

    #[test]
    fn no_points_make_an_empty_cloud() {
        assert!(arrange(&[], &DotStyle::late()).groups.iter().all(|g| g.members.is_empty()));
    }
}
