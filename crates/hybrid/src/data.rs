//! Data as functions of time: piecewise cubics.

use serde::{Deserialize, Serialize};
use twofold_num::Arithmetic;

pub use crate::definition::BadTable;
use crate::definition::{Interpolation, TableEntry};

/// A table's values between its rows: on each piece a cubic in the time since the piece's
/// beginning, or, where it comes to rest at its end, in that to its end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// The times of the rows, increasing.
    pub knots: Vec<f64>,
    /// Coefficients of the cubic that begins at each knot but the last, lowest first.
    pub pieces: Vec<[f64; 4]>,
    /// Pieces whose cubic is one in the time to their end, which is negative: where a value is
    /// reached without a speed, as a zero that is only touched, rounding must not go beyond it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub from_end: Vec<usize>,
}

impl Table {
    /// Reads the columns that `entry` names from a CSV text with a line of names; lines that begin
    /// with # are left out.
    ///
    /// # Errors
    /// If a column is not there, a cell is no finite number, times do not increase, or there are
    /// too few rows.
    pub fn read(entry: &TableEntry, csv: &str) -> Result<Self, BadTable> {
        let file = &entry.file;
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(csv.as_bytes());
        let header = reader.headers().map_err(|e| BadTable::data(format!("{file}: {e}")))?.clone();
        if header.is_empty() {
            return Err(BadTable::data(format!("{file} is empty")));
        }
        let again = |i: &usize| header.iter().take(*i).position(|h| h == &header[*i]);
        if let Some((first, second)) = (0..header.len()).find_map(|i| Some((again(&i)?, i))) {
            let why = format!(
                "{file}: columns {} and {} are both called `{}`",
                first + 1,
                second + 1,
                &header[second]
            );
            return Err(BadTable { why, key: "file", help: "give each column a name of its own" });
        }
        let column = |name: &str, key| {
            header.iter().position(|h| h == name).ok_or_else(|| {
                let known: Vec<&str> = header.iter().collect();
                let why = format!("{file} has no column `{name}`; it has {}", known.join(", "));
                BadTable { why, key, help: "name a column as the file's first line has it" }
            })
        };
        let (at, value) = (column(&entry.time, "time")?, column(&entry.column, "column")?);
        let (mut knots, mut values) = (Vec::new(), Vec::new());
        for (row, record) in reader.records().enumerate() {
            let record = record.map_err(|e| BadTable::data(format!("{file}: {e}")))?;
            if record.len() != header.len() {
                return Err(BadTable::data(format!(
                    "{file}, row {}: {} cells for {} columns",
                    row + 1,
                    record.len(),
                    header.len()
                )));
            }
            let cell = |i: usize| {
                let text = record.get(i).unwrap_or_default();
                text.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
                    BadTable::data(format!(
                        "{file}, row {}: `{text}` is not a finite number",
                        row + 1
                    ))
                })
            };
            let (t, v) = (cell(at)?, cell(value)?);
            if knots.last().is_some_and(|last| t <= *last) {
                return Err(BadTable::data(format!(
                    "{file}, row {}: the time {t} does not come after the row before it",
                    row + 1
                )));
            }
            knots.push(t);
            values.push(v);
        }
        Self::new(knots, &values, entry.interpolation)
            .map_err(|bad| BadTable { why: format!("{file}: {bad}"), ..bad })
    }

    /// The function through these points.
    ///
    /// # Errors
    /// If there are fewer than two.
    pub fn new(
        knots: Vec<f64>,
        values: &[f64],
        interpolation: Interpolation,
    ) -> Result<Self, BadTable> {
        if knots.len() < 2 {
            return Err(BadTable::data("a table needs at least two rows".into()));
        }
        let h: Vec<f64> = knots.windows(2).map(|w| w[1] - w[0]).collect();
        let slope: Vec<f64> =
            h.iter().zip(values.windows(2)).map(|(h, v)| (v[1] - v[0]) / h).collect();
        let mut from_end = Vec::new();
        let mut hermite = |d: &[f64]| -> Vec<[f64; 4]> {
            let piece = |i: usize| {
                let (a, b, m) = (d[i], d[i + 1], slope[i]);
                let third = (a + b - 2.0 * m) / (h[i] * h[i]);
                if b == 0.0 && (a != 0.0 || values[i + 1] == 0.0) {
                    from_end.push(i);
                    return [values[i + 1], 0.0, (a - 3.0 * m) / h[i], third];
                }
                [values[i], a, (3.0 * m - 2.0 * a - b) / h[i], third]
            };
            (0..h.len()).map(piece).collect()
        };
        let pieces = match interpolation {
            // The last row's value holds at its time alone.
            Interpolation::Previous => values.iter().map(|value| [*value, 0.0, 0.0, 0.0]).collect(),
            Interpolation::Linear => {
                (0..h.len()).map(|i| [values[i], slope[i], 0.0, 0.0]).collect()
            }
            Interpolation::Pchip => hermite(&monotone_slopes(&h, &slope)),
            Interpolation::Cubic => hermite(&spline_slopes(&h, &slope)),
        };
        Ok(Self { knots, pieces, from_end })
    }

    /// The first and the last time.
    pub fn range(&self) -> (f64, f64) {
        (self.knots[0], self.knots[self.knots.len() - 1])
    }

    /// The piece that holds just after `t`; the last one at the end.
    pub fn piece(&self, t: f64) -> usize {
        self.knots.partition_point(|k| *k <= t).saturating_sub(1).min(self.pieces.len() - 1)
    }

    /// The time from which a piece's cubic counts.
    pub fn origin(&self, piece: usize) -> f64 {
        self.knots[piece + usize::from(self.from_end.binary_search(&piece).is_ok())]
    }

    /// The value at `t` on a piece.
    pub fn value<S: Arithmetic>(&self, piece: usize, t: S) -> S {
        let s = t - S::from_f64(self.origin(piece));
        let [a, b, c, d] = self.pieces[piece].map(S::from_f64);
        a + s * (b + s * (c + s * d))
    }
}

/// Slopes at the knots of a monotone interpolant: Fritsch & Butland (1984), with the three-point
/// ends of Moler (2004, sec. 3.6), as SciPy's.
fn monotone_slopes(h: &[f64], m: &[f64]) -> Vec<f64> {
    let n = h.len();
    if n == 1 {
        return vec![m[0]; 2];
    }
    let end = |h0: f64, h1: f64, m0: f64, m1: f64| {
        let d = ((2.0 * h0 + h1) * m0 - h0 * m1) / (h0 + h1);
        if d * m0 <= 0.0 {
            0.0
        } else if m0 * m1 <= 0.0 && d.abs() > 3.0 * m0.abs() {
            3.0 * m0
        } else {
            d
        }
    };
    let mut d = vec![end(h[0], h[1], m[0], m[1])];
    for i in 1..n {
        let slope = if m[i - 1] * m[i] <= 0.0 {
            0.0
        } else {
            let (w1, w2) = (2.0 * h[i] + h[i - 1], h[i] + 2.0 * h[i - 1]);
            (w1 + w2) / (w1 / m[i - 1] + w2 / m[i])
        };
        d.push(slope);
    }
    d.push(end(h[n - 1], h[n - 2], m[n - 1], m[n - 2]));
    d
}

/// Slopes at the knots of the cubic spline with not-a-knot ends (de Boor 1978, ch. IV); a parabola
/// through three points, a line through two.
fn spline_slopes(h: &[f64], m: &[f64]) -> Vec<f64> {
    let n = h.len();
    if n == 1 {
        return vec![m[0]; 2];
    }
    if n == 2 {
        let second = (m[1] - m[0]) / (h[0] + h[1]);
        return vec![m[0] - second * h[0], m[0] + second * h[0], m[1] + second * h[1]];
    }
    // Rows: lower, diagonal, upper, right-hand side.
    let mut rows = vec![[0.0; 4]; n + 1];
    let w = h[0] + h[1];
    rows[0] = [0.0, h[1], w, ((h[0] + 2.0 * w) * h[1] * m[0] + h[0] * h[0] * m[1]) / w];
    for i in 1..n {
        rows[i] =
            [h[i], 2.0 * (h[i - 1] + h[i]), h[i - 1], 3.0 * (h[i] * m[i - 1] + h[i - 1] * m[i])];
    }
    let (p, q) = (h[n - 1], h[n - 2]);
    let w = p + q;
    rows[n] = [w, q, 0.0, (p * p * m[n - 2] + (2.0 * w + p) * q * m[n - 1]) / w];
    for i in 1..=n {
        let factor = rows[i][0] / rows[i - 1][1];
        rows[i][1] -= factor * rows[i - 1][2];
        rows[i][3] -= factor * rows[i - 1][3];
    }
    let mut d = vec![0.0; n + 1];
    d[n] = rows[n][3] / rows[n][1];
    for i in (0..n).rev() {
        d[i] = (rows[i][3] - rows[i][2] * d[i + 1]) / rows[i][1];
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(interpolation: Interpolation, t: f64) -> f64 {
        let table =
            Table::new(vec![0.0, 1.0, 2.5, 3.0, 5.0], &[1.0, 2.0, 0.5, 0.5, 4.0], interpolation)
                .unwrap();
        table.value(table.piece(t), t)
    }

    /// SciPy 1.17.1: `CubicSpline(x, y)`, `PchipInterpolator(x, y)`.
    #[test]
    fn values_are_scipys() {
        assert_eq!(at(Interpolation::Previous, 2.4), 2.0);
        assert_eq!(at(Interpolation::Linear, 1.75), 1.25);
        for (t, spline, pchip) in TABLE {
            assert!(
                (at(Interpolation::Cubic, t) - spline).abs() < 1e-13,
                "{t}: {}",
                at(Interpolation::Cubic, t)
            );
            assert!(
                (at(Interpolation::Pchip, t) - pchip).abs() < 1e-13,
                "{t}: {}",
                at(Interpolation::Pchip, t)
            );
        }
    }

    const TABLE: [(f64, f64, f64); 4] = [
        (0.3, 1.6790984615384614, 1.4806),
        (1.75, 1.250216346153846, 1.25),
        (2.8, 0.44358153846153847, 0.5),
        (4.1, 1.9050215384615379, 1.6540374999999994),
    ];

    /// A zero that is touched, and a value that is reached without a speed, are not passed by
    /// rounding.
    #[test]
    fn rounding_goes_beyond_no_extremum() {
        for (values, low) in [([1.3, 0.7, 0.0, 0.9, 2.1], 0.0), ([1.3, 0.7, 0.4, 0.9, 2.1], 0.4)] {
            let knots = vec![0.0, 0.913, 1.571, 2.03, 3.3];
            let table = Table::new(knots.clone(), &values, Interpolation::Pchip).unwrap();
            for k in 0..2000 {
                let t = knots[2] + (k - 1000) as f64 * 1e-11;
                assert!(table.value(table.piece(t), t) >= low, "{t}");
            }
        }
    }

    /// A cubic is its own spline.
    #[test]
    fn a_cubic_is_reproduced() {
        let f = |t: f64| t * t * t - 2.0 * t * t + 1.0;
        let knots = vec![-1.0, 0.0, 0.5, 2.0, 3.0];
        let values: Vec<f64> = knots.iter().map(|t| f(*t)).collect();
        let table = Table::new(knots, &values, Interpolation::Cubic).unwrap();
        for t in [-0.9, 0.3, 1.2, 2.9] {
            assert!((table.value(table.piece(t), t) - f(t)).abs() < 1e-13);
        }
    }
}
