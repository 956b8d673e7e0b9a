//! Pictures of scans: an orbit diagram over one parameter, a map of endings over two.

use twofold_job::Table;
use twofold_job::sweep::{Axis as Over, Values};
use twofold_num::elementary::{pow, sqrt};
use twofold_render::markup;
use twofold_render::sheet::{
    Anchor, Axis, Colour, ColumnWidth, DotStyle, LegendEntry, LegendKey, PlanePanel, Sheet,
    range_of,
};
use twofold_render::style;

use crate::tables::{column, words};

/// A setting that a scan varied.
#[derive(Clone, Debug)]
pub struct Scanned {
    /// Its column in a table.
    pub column: String,
    /// Its name in rich text.
    pub title: String,
    /// Its values, the least first.
    pub values: Vec<f64>,
    /// Whether they are evenly spaced in the logarithm, and so are shown so.
    pub logarithmic: bool,
}

impl From<&Over> for Scanned {
    /// Its name as mathematics sets it: of `params.alpha` only the parameter's, of `start.x` as
    /// x(0).
    fn from(axis: &Over) -> Self {
        let column = axis.coordinate.to_string();
        let mut values: Vec<f64> = (0..axis.count()).map(|i| axis.value(i, 0.5).value()).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        let logarithmic =
            matches!(axis.values, Values::Log { .. }) && values.iter().all(|v| *v > 0.0);
        let title = match column.strip_prefix("start.") {
            Some(state) => format!("{}(0)", markup::name(state)),
            None => markup::name(column.rsplit('.').next().unwrap_or(&column)),
        };
        Self { column, title, values, logarithmic }
    }
}

impl Scanned {
    fn axis(&self, (lower, upper): (f64, f64)) -> Axis {
        if self.logarithmic {
            Axis::log(&self.title, lower, upper)
        } else {
            Axis::linear(&self.title, lower, upper)
        }
    }

    /// All values, with a margin of four per cent. Where no run has a passage the diagram is empty;
    /// it does not end there.
    fn covered(&self) -> Axis {
        if !self.logarithmic {
            return Axis::covering(&self.title, self.values.iter().copied());
        }
        let (lower, upper) = range_of(self.values.iter().copied());
        let margin = pow(upper / lower, 0.04);
        self.axis((lower / margin, upper * margin))
    }

    /// The edges of cells around the values.
    fn edges(&self) -> Vec<f64> {
        let (c, n) = (&self.values, self.values.len());
        let between =
            |w: &[f64]| if self.logarithmic { sqrt(w[0] * w[1]) } else { 0.5 * (w[0] + w[1]) };
        // As far beyond the value on the other side.
        let beyond = |value: f64, edge: f64| {
            if self.logarithmic { value * (value / edge) } else { value + (value - edge) }
        };
        let inner: Vec<f64> = c.windows(2).map(between).collect();
        match (inner.first(), inner.last()) {
            (Some(first), Some(last)) => {
                let ends = (beyond(c[0], *first), beyond(c[n - 1], *last));
                std::iter::once(ends.0).chain(inner).chain([ends.1]).collect()
            }
            _ if self.logarithmic => vec![c[0] / 2.0, c[0] * 2.0],
            _ => vec![c[0] - 0.5, c[0] + 0.5],
        }
    }
}

/// An orbit diagram: the late passages of each run above its parameter's value. Of two series with
/// names the first lies behind the second.
pub fn diagram(
    title: &str,
    over: &Scanned,
    ordinate: &str,
    series: Vec<(&str, Vec<[f64; 2]>)>,
) -> Sheet {
    let x = over.covered();
    let y = Axis::covering(ordinate, series.iter().flat_map(|(_, points)| points).map(|p| p[1]));
    let middle = [&x, &y].map(|axis| 0.5 * (axis.lower + axis.upper));
    let mut panel = PlanePanel::new(x, y);
    if series.iter().all(|(_, points)| points.is_empty()) {
        panel = panel.note(middle, "no crossing", Anchor::Centre);
    }
    let mut sheet = Sheet::new(ColumnWidth::Wide, 1, "orbit diagram")
        .title(markup::literal(title))
        .panel_aspect(0.55);
    // If both lie on each other, the first is seen around the second.
    let looks = if series.len() == 1 {
        [(style::INK, None); 2]
    } else {
        [(style::SERIES[0], Some(2.2)), (style::INK, Some(1.0))]
    };
    for ((name, points), (colour, diameter)) in series.into_iter().zip(looks) {
        let dots = DotStyle { colour, diameter, density: false };
        panel = panel.dots(points, dots);
        if !name.is_empty() {
            sheet = sheet.legend(LegendEntry::new(LegendKey::Dots(dots), name));
        }
    }
    sheet.panel("", "", panel)
}

/// An ending and where it occurs.
struct Basin {
    /// Its word, and its number in a table that tells attractors of one word apart.
    ending: (String, i64),
    /// Its cells, as (column, row).
    cells: Vec<(usize, usize)>,
}

/// More endings than this are told by their words only: where a parameter moves an attractor it
/// has another number in each column, and colours are not told apart.
const MOST_COLOURS: usize = 16;

/// The endings of runs over a grid of two settings, in order of their first occurrence; runs that
/// failed come last.
fn basins(table: &Table, over: [&Scanned; 2]) -> Result<Vec<Basin>, String> {
    let endings = words(table, "outcome").or_else(|_| words(table, "ending"))?;
    let [x, y] = [column(table, &over[0].column)?, column(table, &over[1].column)?];
    let numbers = table.integers("number");
    let place = |of: &Scanned, value: f64| {
        let found = of.values.iter().position(|v| *v == value);
        found.ok_or_else(|| format!("{} = {value} is no value of the grid", of.column))
    };
    let mut found: Vec<Basin> = Vec::new();
    for (row, word) in endings.iter().enumerate() {
        let at = (place(over[0], x[row])?, place(over[1], y[row])?);
        let ending = ((*word).to_owned(), numbers.get(row).copied().unwrap_or(0));
        match found.iter_mut().find(|b| b.ending == ending) {
            Some(basin) => basin.cells.push(at),
            None => found.push(Basin { ending, cells: vec![at] }),
        }
    }
    if found.len() > MOST_COLOURS {
        let mut by_word: Vec<Basin> = Vec::new();
        for basin in found {
            match by_word.iter_mut().find(|b| b.ending.0 == basin.ending.0) {
                Some(all) => all.cells.extend(basin.cells),
                None => by_word.push(basin),
            }
        }
        found = by_word;
    }
    found.sort_by_key(|basin| basin.ending.0 == "failed");
    Ok(found)
}

/// A map of endings over a grid of two settings: the table of a scan or a sweep.
///
/// # Errors
/// If the table has no endings, or not these settings.
pub fn map(title: &str, over: [&Scanned; 2], table: &Table) -> Result<Sheet, String> {
    let [x_edges, y_edges] = over.map(Scanned::edges);
    let ends = |e: &[f64]| (e[0], e[e.len() - 1]);
    let mut panel = PlanePanel::new(over[0].axis(ends(&x_edges)), over[1].axis(ends(&y_edges)));
    let mut sheet = Sheet::new(ColumnWidth::Single, 1, "map of endings")
        .title(markup::literal(title))
        .panel_aspect(0.9);
    let (mut attractors, mut others) = (0.., 0..);
    let basins = basins(table, over)?;
    for Basin { ending: (word, number), cells } in &basins {
        // Closed orbits and rests.
        let attracts = word == "rest" || word.contains("period-");
        let colour = if attracts {
            attractors.next().map_or(style::INK, palette)
        } else {
            others.next().map_or(style::CROSSING, grey)
        };
        for (i, j, length) in rows_of(cells) {
            let (a, b) = (x_edges[i], x_edges[i + length]);
            let (c, d) = (y_edges[j], y_edges[j + 1]);
            panel = panel.solid(vec![[a, c], [b, c], [b, d], [a, d]], colour);
        }
        let mut name = markup::literal(word);
        if basins.iter().filter(|basin| basin.ending.0 == *word).count() > 1 {
            name += &format!(", no. {number}");
        }
        let text = format!("{name} ({})", cells.len());
        sheet = sheet.legend(LegendEntry::new(LegendKey::Area(colour, 100), text));
    }
    Ok(sheet.panel("", "", panel))
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

/// Greys of the other endings, ever darker.
fn grey(k: usize) -> Colour {
    const GREYS: [Colour; 4] = [
        style::CROSSING,
        Colour::rgb(0xa6, 0xa6, 0xa6),
        Colour::rgb(0x70, 0x70, 0x70),
        Colour::rgb(0x40, 0x40, 0x40),
    ];
    GREYS[k.min(GREYS.len() - 1)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_job::{Column, Entry};
    use twofold_render::sheet::Content;

    /// Two attractors of one word have a number each; what failed comes last.
    #[test]
    fn endings_have_a_colour_each() {
        let columns = [Column::numbers("x"), Column::numbers("y"), Column::words("ending")];
        let columns = columns.into_iter().chain([Column::integers("number")]);
        let mut table = Table::new("endings", columns);
        let endings = [
            ("failed", 0),
            ("period-1", 1),
            ("far", 2),
            ("period-1", 3),
            ("rest", 4),
            ("irregular", 5),
        ];
        for (i, (word, number)) in endings.into_iter().enumerate() {
            table.push([
                Entry::Number(i as f64),
                Entry::Number(0.0),
                Entry::Word(word.into()),
                Entry::Integer(number),
            ]);
        }
        let values: Vec<f64> = (0..6).map(f64::from).collect();
        let [x, y] = [("x", &values[..]), ("y", &[0.0])]
            .map(|(column, values)| Scanned { column: column.into(), ..scanned(values, false) });
        let sheet = map("", [&x, &y], &table).unwrap();
        let texts: Vec<&str> = sheet.legend.iter().map(|e| e.text.as_str()).collect();
        assert_eq!(
            texts,
            [
                "period-1, no. 1 (1)",
                "far (1)",
                "period-1, no. 3 (1)",
                "rest (1)",
                "irregular (1)",
                "failed (1)"
            ]
        );
        let mut seen: Vec<String> = sheet.legend.iter().map(|e| format!("{:?}", e.key)).collect();
        seen.sort();
        seen.dedup();
        assert_eq!(seen.len(), 6, "{seen:?}");
        let other = Scanned { values: vec![7.0], ..y };
        assert!(map("", [&x, &other], &table).unwrap_err().contains("no value of the grid"));
    }

    /// Colours of more endings than are told apart are those of their words.
    #[test]
    fn many_attractors_have_the_colour_of_their_word() {
        let columns = [Column::numbers("x"), Column::numbers("y"), Column::words("ending")];
        let columns = columns.into_iter().chain([Column::integers("number")]);
        let mut table = Table::new("endings", columns);
        for i in 0..21 {
            let word = if i == 20 { "rest" } else { "period-1" };
            table.push([
                Entry::Number(i.into()),
                Entry::Number(0.0),
                Entry::Word(word.into()),
                Entry::Integer(i64::from(i) + 1),
            ]);
        }
        let values: Vec<f64> = (0..21).map(f64::from).collect();
        let [x, y] = [("x", &values[..]), ("y", &[0.0])]
            .map(|(column, values)| Scanned { column: column.into(), ..scanned(values, false) });
        let sheet = map("", [&x, &y], &table).unwrap();
        let texts: Vec<&str> = sheet.legend.iter().map(|e| e.text.as_str()).collect();
        assert_eq!(texts, ["period-1 (20)", "rest (1)"]);
    }

    #[test]
    fn cells_become_rectangles() {
        assert_eq!(
            rows_of(&[(0, 0), (2, 0), (1, 0), (4, 0), (0, 1)]),
            [(0, 0, 3), (4, 0, 1), (0, 1, 1)]
        );
    }

    fn scanned(values: &[f64], logarithmic: bool) -> Scanned {
        Scanned {
            column: String::new(),
            title: String::new(),
            values: values.to_vec(),
            logarithmic,
        }
    }

    #[test]
    fn cells_meet_between_their_values() {
        assert_eq!(scanned(&[1.0, 2.0, 4.0], false).edges(), [0.5, 1.5, 3.0, 5.0]);
        assert_eq!(scanned(&[4.0, 16.0, 64.0], true).edges(), [2.0, 8.0, 32.0, 128.0]);
        assert_eq!(scanned(&[3.0], false).edges(), [2.5, 3.5]);
        assert_eq!(scanned(&[3.0], true).edges(), [1.5, 6.0]);
    }

    #[test]
    fn a_diagram_shows_all_that_was_scanned() {
        let x = |over: &Scanned| {
            let sheet = diagram("", over, "", vec![("", vec![[10.0, 1.0], [10.0, 2.0]])]);
            let Content::Plane(panel) = &sheet.panels[0].content else { panic!("no plane") };
            panel.x.clone()
        };
        let linear = x(&scanned(&[0.0, 10.0, 100.0], false));
        assert_eq!((linear.lower, linear.upper, linear.logarithmic), (-4.0, 104.0, false));
        let log = x(&scanned(&[1.0, 10.0, 1e25], true));
        assert!(
            (log.lower - 0.1).abs() < 1e-12
                && (log.upper / 1e26 - 1.0).abs() < 1e-12
                && log.logarithmic
        );
    }
}
