//! Pictures of scans: an orbit diagram over one parameter, a map of endings over two.

use crate::render::markup;
use crate::render::sheet::{Axis, Colour, ColumnWidth, DotStyle, LegendEntry, LegendKey, PlanePanel, Sheet};
use crate::render::style;

/// An orbit diagram: the late passages of each run above its parameter's value.
pub fn diagram(title: &str, axis: &str, ordinate: &str, points: Vec<[f64; 2]>) -> Sheet {
    let x = Axis::covering(axis, points.iter().map(|p| p[0]));
    let y = Axis::covering(ordinate, points.iter().map(|p| p[1]));
    let panel = PlanePanel::new(x, y).dots(points, DotStyle { density: false, ..DotStyle::late() });
    Sheet::new(ColumnWidth::Double, 1, "orbit diagram")
        .title(markup::literal(title))
        .panel_aspect(0.55)
        .panel("", "", panel)
}

/// An ending's place in the legend, and where it occurs (row, column).
pub struct Basin {
    /// Its name as plain text.
    pub name: String,
    /// Whether it is an attractor; else it is drawn in grey.
    pub attracts: bool,
    /// Its cells, as (column, row).
    pub cells: Vec<(usize, usize)>,
}

/// A map of endings over a grid of two settings; `xs` and `ys` are the cells' centres.
pub fn map(title: &str, axes: [&str; 2], xs: &[f64], ys: &[f64], basins: &[Basin]) -> Sheet {
    let (x_edges, y_edges) = (edges(xs), edges(ys));
    let ends = |e: &[f64]| (e[0], e[e.len() - 1]);
    let ((x0, x1), (y0, y1)) = (ends(&x_edges), ends(&y_edges));
    let mut panel = PlanePanel::new(Axis::linear(axes[0], x0, x1), Axis::linear(axes[1], y0, y1));
    let mut sheet =
        Sheet::new(ColumnWidth::Single, 1, "map of endings").title(markup::literal(title)).panel_aspect(0.9);
    let mut next = 0;
    for basin in basins {
        let colour = if basin.attracts {
            next += 1;
            palette(next - 1)
        } else {
            style::CROSSING
        };
        for (i, j, length) in rows_of(&basin.cells) {
            let (a, b) = (x_edges[i], x_edges[i + length]);
            let (c, d) = (y_edges[j], y_edges[j + 1]);
            panel = panel.solid(vec![[a, c], [b, c], [b, d], [a, d]], colour);
        }
        let text = format!("{} ({})", markup::literal(&basin.name), basin.cells.len());
        sheet = sheet.legend(LegendEntry::new(LegendKey::Area(colour, 100), text));
    }
    sheet.panel("", "", panel)
}

/// Neighbouring cells of one row as one rectangle: (column, row, how many).
fn rows_of(cells: &[(usize, usize)]) -> Vec<(usize, usize, usize)> {
    let mut sorted: Vec<(usize, usize)> = cells.iter().map(|(i, j)| (*j, *i)).collect();
    sorted.sort_unstable();
    let mut found: Vec<(usize, usize, usize)> = Vec::new();
    for (j, i) in sorted {
        match found.last_mut() {
            Some((first, row, length)) if *row == j && *first + *length == i => *length += 1,
            _ => found.push((i, j, 1)),
        }
    }
    found
}

/// Colours of attractors: the series', then paler ones.
fn palette(k: usize) -> Colour {
    let base = style::SERIES[k % style::SERIES.len()];
    (0..k / style::SERIES.len()).fold(base, |c, _| c.lighten(0.35))
}

/// Edges of cells around their centres.
fn edges(centres: &[f64]) -> Vec<f64> {
    let n = centres.len();
    if n == 1 {
        return vec![centres[0] - 0.5, centres[0] + 0.5];
    }
    let inner = centres.windows(2).map(|w| 0.5 * (w[0] + w[1]));
    let first = centres[0] - 0.5 * (centres[1] - centres[0]);
    let last = centres[n - 1] + 0.5 * (centres[n - 1] - centres[n - 2]);
    std::iter::once(first).chain(inner).chain([last]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_become_rectangles() {
        assert_eq!(rows_of(&[(0, 0), (2, 0), (1, 0), (4, 0), (0, 1)]), [(0, 0, 3), (4, 0, 1), (0, 1, 1)]);
        assert_eq!(edges(&[1.0, 2.0, 4.0]), [0.5, 1.5, 3.0, 5.0]);
    }
}
