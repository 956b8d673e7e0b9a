//! The paper's sketches, computed: the wheel assembly drawn to scale from its model, and the
//! regions and orbits about a two-fold.

pub mod assembly;
pub mod portrait;

use twofold_job::table::{Column, Entry, Table};

/// Lines of a sketch as a table: a name per line, a row per point.
fn lines_table<const N: usize>(columns: [&str; N], lines: &[(String, Vec<[f64; N]>)]) -> Table {
    let mut table = Table::new(
        "lines",
        std::iter::once(Column::words("line")).chain(columns.map(Column::numbers)),
    );
    for (name, points) in lines {
        for point in points {
            let mut row = vec![Entry::Word(name.clone())];
            row.extend(point.map(Entry::Number));
            table.push(row);
        }
    }
    table
}

/// The lines of such a table, in order.
fn lines_of<const N: usize>(table: &Table) -> Vec<(String, Vec<[f64; N]>)> {
    let mut lines: Vec<(String, Vec<[f64; N]>)> = Vec::new();
    for row in table.rows() {
        let (Some(Entry::Word(name)), numbers) = (row.first(), &row[1..]) else { continue };
        let point: [f64; N] = std::array::from_fn(|i| match numbers.get(i) {
            Some(Entry::Number(v)) => *v,
            _ => f64::NAN,
        });
        match lines.last_mut() {
            Some((last, points)) if last == name => points.push(point),
            _ => lines.push((name.clone(), vec![point])),
        }
    }
    lines
}
