//! How a cloud of points is drawn: merged where points coincide, large where places are few, and shaded by density where they are many.

use super::scene::{Position, UNITS_PER_POINT, units};
use super::sheet::{Colour, DotStyle};
use super::style;
use crate::num::elementary;

/// Points of one colour, in drawing order.
pub struct Group {
    /// Colour.
    pub colour: Colour,
    /// Which of the given points.
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
    let mut order: Vec<(i32, i32, usize)> =
        places.iter().enumerate().map(|(i, p)| (p.1.div_euclid(SAME), p.0.div_euclid(SAME), i)).collect();
    order.sort_unstable();
    // The first point of each cell stands for it.
    order.dedup_by_key(|c| (c.0, c.1));
    let mut cells: Vec<(i32, i32)> = places.iter().map(|p| (p.1.div_euclid(PLACE), p.0.div_euclid(PLACE))).collect();
    cells.sort_unstable();
    let occupied = cells.chunk_by(|a, b| a == b).count();
    let diameter = look.diameter.unwrap_or_else(|| {
        let fitting = style::DOT_DIAMETER_PT.iter().find(|(most, _)| occupied <= *most);
        fitting.map_or(style::DOT_DIAMETER_PT[0].1, |f| f.1)
    });
    // An even number of units, because a circle is drawn by its radius.
    let diameter = (units(diameter) / 2 * 2).max(2);
    let few = style::DOT_DIAMETER_PT[2].0;
    if !look.density || occupied <= few {
        let members = order.into_iter().map(|c| c.2).collect();
        return Cloud { diameter, groups: vec![Group { colour: look.colour, members }] };
    }
    let counts = neighbourhood_counts(&cells);
    let count_at = |p: Position| {
        let cell = (p.1.div_euclid(PLACE), p.0.div_euclid(PLACE));
        counts.binary_search_by_key(&cell, |c| c.0).map_or(1, |i| counts[i].1)
    };
    let mut sorted: Vec<u32> = order.iter().map(|c| count_at(places[c.2])).collect();
    sorted.sort_unstable();
    // From the fifth to the 95th percentile of density on a logarithmic scale: single outliers do not set the scale.
    let quantile = |q: usize| elementary::ln(f64::from(sorted[(sorted.len() - 1) * q / 100].max(1)));
    let (thin, dense) = (quantile(5), quantile(95));
    let top = style::DENSITY_LEVELS - 1;
    let mut groups: Vec<Group> = (0..style::DENSITY_LEVELS)
        .map(|level| {
            let white = style::DENSITY_LIGHTEST * (1.0 - level as f64 / top as f64);
            Group { colour: look.colour.lighten(white), members: Vec::new() }
        })
        .collect();
    for (_, _, i) in order {
        let density = elementary::ln(f64::from(count_at(places[i]).max(1)));
        let share = if dense > thin { ((density - thin) / (dense - thin)).clamp(0.0, 1.0) } else { 1.0 };
        groups[(share * top as f64).round() as usize].members.push(i);
    }
    Cloud { diameter, groups }
}

/// For every occupied cell, the number of points in it and the eight cells around it; sorted by cell.
fn neighbourhood_counts(sorted_cells: &[(i32, i32)]) -> Vec<((i32, i32), u32)> {
    let own: Vec<((i32, i32), u32)> =
        sorted_cells.chunk_by(|a, b| a == b).map(|run| (run[0], run.len() as u32)).collect();
    let mut sums: Vec<u32> = own.iter().map(|c| c.1).collect();
    // A row above and a row below are walked along with the row itself.
    for shift in [-1, 1] {
        let mut k = 0;
        for i in 0..own.len() {
            let (row, column) = own[i].0;
            if i > 0 && own[i - 1].0 == (row, column + shift) {
                sums[i] += own[i - 1].1;
            }
            if i + 1 < own.len() && own[i + 1].0 == (row, column + shift) {
                sums[i] += own[i + 1].1;
            }
            let first = (row + shift, column - 1);
            while k < own.len() && own[k].0 < first {
                k += 1;
            }
            sums[i] += own[k..].iter().take_while(|c| c.0 <= (row + shift, column + 1)).map(|c| c.1).sum::<u32>();
        }
    }
    own.iter().zip(sums).map(|(c, s)| (c.0, s)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_places_visited_often_become_two_large_dots() {
        let places: Vec<Position> = (0..20_000).map(|i| if i % 2 == 0 { (1000, 1000) } else { (9000, 1000) }).collect();
        let cloud = arrange(&places, &DotStyle::late());
        assert_eq!(cloud.groups.len(), 1);
        assert_eq!(cloud.groups[0].members, [0, 1]);
        assert!(cloud.diameter >= units(4.0));
    }

    #[test]
    fn dense_places_are_darker_than_sparse_ones() {
        let mut places: Vec<Position> = (0..30_000).map(|i| (i % 173 * 100, i / 173 * 100)).collect();
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
        let mut cells = vec![(0, 0), (0, 1), (0, 1), (1, 2), (-1, 0), (5, 5), (0, 3)];
        cells.sort_unstable();
        let counts = neighbourhood_counts(&cells);
        let brute =
            |c: (i32, i32)| cells.iter().filter(|d| (d.0 - c.0).abs() <= 1 && (d.1 - c.1).abs() <= 1).count() as u32;
        assert!(counts.iter().all(|(c, n)| *n == brute(*c)), "{counts:?}");
    }
}
