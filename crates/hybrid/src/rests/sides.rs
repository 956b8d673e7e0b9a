//! Patterns of sides that have points in a box.
//!
//! m planes part a space of n dimensions into cells of which most of the 2^m patterns of signs have
//! none. Branching over one function after the other leaves a branch as soon as a linear programme
//! shows that its pattern has no point (Avis & Fukuda 1996; Rada & Cerny 2018). A curved function
//! is replaced by a linear one within an error that bounds it in the whole box.

use twofold_num::tape::Program;
use twofold_num::{Arithmetic, Dual};
use twofold_system::Expression;

use crate::equation::Equation;
use crate::range::Range;

/// A bound of a function in the box by a linear one.
#[derive(Clone, Debug)]
pub(super) struct Linear {
    /// Slopes by each state in half-widths of the box, then the value in its middle.
    row: Vec<f64>,
    /// Distance of the function from that.
    error: f64,
}

/// Depth, in half-widths of the box, down to which a cell may seem to have no point by rounding.
const ROUNDING: f64 = 1e-9;
/// An error of this share of the slopes is the rounding of a linear function.
const EXACT: f64 = 1e-12;

impl Linear {
    /// The bound of an expression in which no function switches; none if it has no bound.
    pub fn of(equation: &Equation, e: &Expression, within: &[(f64, f64)]) -> Option<Self> {
        let program = Program::new(&equation.plain_tape(e)?);
        let n = within.len();
        let mut at = vec![Dual::<Range, 1>::constant(Range::from_f64(0.0)); equation.variables()];
        let mut out = [at[0]];
        for (v, (a, b)) in at.iter_mut().zip(within) {
            v.value = Range::new(0.5 * (a + b), 0.0);
        }
        program.evaluate(&at, &mut out);
        let middle = out[0].value;
        for (v, (a, b)) in at.iter_mut().zip(within) {
            v.value = Range::new(0.5 * (a + b), 0.5 * (b - a));
        }
        let (mut row, mut error) = (Vec::with_capacity(n + 1), middle.radius());
        for j in 0..n {
            at[j].partials = [Range::from_f64(1.0)];
            program.evaluate(&at, &mut out);
            at[j].partials = [Range::from_f64(0.0)];
            let half = 0.5 * (within[j].1 - within[j].0);
            row.push(out[0].partials[0].middle() * half);
            error += out[0].partials[0].radius() * half;
        }
        row.push(middle.middle());
        (error.is_finite() && row.iter().all(|v| v.is_finite())).then_some(Self { row, error })
    }
}

/// A requirement of a point: a linear function of it, and a constant, that is not negative.
struct Required(Vec<f64>);

/// Patterns of sides, as far as they were counted.
pub(super) struct Patterns {
    /// The side of each function, and a point of the box that has them, if one is known.
    pub found: Vec<(Vec<f64>, Vec<f64>)>,
    /// Whether there may be more.
    pub more: bool,
}

/// The patterns of sides of `functions`, at most so many, that have points in the box where all of
/// `on` are zero. One without a bound may have any side.
pub(super) fn patterns(
    functions: &[Option<Linear>],
    on: &[Option<Linear>],
    within: &[(f64, f64)],
    most: usize,
) -> Patterns {
    let n = within.len();
    let mut patterns = Patterns { found: Vec::new(), more: false };
    let Some(space) = Space::of(on.iter().flatten(), n) else { return patterns };
    let rows: Vec<Option<Linear>> = functions
        .iter()
        .map(|f| f.as_ref().map(|f| Linear { row: space.reduced(&f.row), error: f.error }))
        .collect();
    let mut branch = Branch { rows: &rows, space: &space, most, patterns: &mut patterns };
    let mut required = Vec::new();
    let first = branch.space.deepest(&required);
    branch.descend(&mut Vec::new(), &mut required, first);
    for (_, place) in &mut patterns.found {
        let shares = space.whole(place);
        *place =
            within.iter().zip(shares).map(|((a, b), y)| 0.5 * ((a + b) + y * (b - a))).collect();
        place.iter_mut().zip(within).for_each(|(x, (a, b))| *x = x.clamp(*a, *b));
    }
    patterns
}

/// Whether functions may be zero together in the box.
pub(super) fn meet(on: &[Option<Linear>], within: &[(f64, f64)]) -> bool {
    Space::of(on.iter().flatten(), within.len()).is_some()
}

struct Branch<'a> {
    rows: &'a [Option<Linear>],
    space: &'a Space,
    most: usize,
    patterns: &'a mut Patterns,
}

impl Branch<'_> {
    fn descend(
        &mut self,
        sides: &mut Vec<f64>,
        required: &mut Vec<Required>,
        point: Option<Vec<f64>>,
    ) {
        let Some(point) = point else { return };
        let Some(row) = self.rows.get(sides.len()) else {
            if self.patterns.found.len() == self.most {
                self.patterns.more = true;
            } else {
                self.patterns.found.push((sides.clone(), point));
            }
            return;
        };
        for side in [-1.0, 1.0] {
            if self.patterns.more {
                return;
            }
            sides.push(side);
            match row {
                None => self.descend(sides, required, Some(point.clone())),
                Some(linear) => {
                    let mut wanted: Vec<f64> = linear.row.iter().map(|v| side * v).collect();
                    wanted[self.space.n] += linear.error;
                    required.push(Required(wanted));
                    let point = self.space.deepest(required);
                    self.descend(sides, required, point);
                    required.pop();
                }
            }
            sides.pop();
        }
    }
}

/// The part of the box where some linear functions are zero: coordinates that follow from others.
struct Space {
    n: usize,
    /// A coordinate and the row, without it, from which it follows.
    follow: Vec<(usize, Vec<f64>)>,
    /// Requirements of the faces of coordinates that follow, and of curved functions.
    fixed: Vec<Required>,
}

impl Space {
    /// None if they are not zero together in the box.
    fn of<'a>(on: impl Iterator<Item = &'a Linear>, n: usize) -> Option<Self> {
        let mut space = Self { n, follow: Vec::new(), fixed: Vec::new() };
        let mut curved = Vec::new();
        for linear in on {
            let size = linear.row[..n].iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            if linear.error > EXACT * size {
                curved.push(linear);
                continue;
            }
            let row = space.reduced(&linear.row);
            let largest = |i: &usize, j: &usize| row[*i].abs().total_cmp(&row[*j].abs());
            let pivot = (0..n).max_by(largest)?;
            if row[pivot].abs() <= ROUNDING * size {
                if row[n].abs() > ROUNDING * size {
                    return None;
                }
                continue;
            }
            let mut value: Vec<f64> = row.iter().map(|v| -v / row[pivot]).collect();
            value[pivot] = 0.0;
            for (_, other) in &mut space.follow {
                substitute(other, pivot, &value);
            }
            space.follow.push((pivot, value));
        }
        for (_, value) in &space.follow {
            for sign in [1.0, -1.0] {
                let mut row: Vec<f64> = value.iter().map(|v| sign * v).collect();
                row[n] += 1.0;
                space.fixed.push(Required(row));
            }
        }
        for linear in curved {
            for sign in [1.0, -1.0] {
                let row: Vec<f64> = linear.row.iter().map(|v| sign * v).collect();
                let mut row = space.reduced(&row);
                row[n] += linear.error;
                space.fixed.push(Required(row));
            }
        }
        space.deepest(&[]).is_some().then_some(space)
    }

    fn reduced(&self, row: &[f64]) -> Vec<f64> {
        let mut row = row.to_vec();
        for (pivot, value) in &self.follow {
            substitute(&mut row, *pivot, value);
        }
        row
    }

    /// All coordinates, in half-widths from the middle.
    fn whole(&self, point: &[f64]) -> Vec<f64> {
        let mut all = point.to_vec();
        for (pivot, value) in &self.follow {
            all[*pivot] = (0..self.n).map(|j| value[j] * point[j]).sum::<f64>() + value[self.n];
        }
        all
    }

    /// The point of the box that is farthest from the edges of what is required, in units of each
    /// function's change over the box; none if no point fulfils it.
    ///
    /// The simplex method of Dantzig for the depth t: t - c z <= d for each requirement c y + d,
    /// with z = y + 1 between 0 and 2. Depths are counted from one that the corner z = 0 has.
    fn deepest(&self, required: &[Required]) -> Option<Vec<f64>> {
        const MOST_PIVOTS: usize = 1000;
        let n = self.n;
        let mut rows: Vec<(Vec<f64>, f64)> = Vec::new();
        for Required(row) in self.fixed.iter().chain(required) {
            let size: f64 = row[..n].iter().map(|v| v.abs()).sum();
            if size <= 1e-14 * row[n].abs() || size == 0.0 {
                if row[n] < 0.0 {
                    return None;
                }
                continue;
            }
            let mut entries: Vec<f64> = row[..n].iter().map(|v| -v / size).collect();
            entries.push(1.0);
            rows.push((entries, row[n] / size - row[..n].iter().map(|v| v / size).sum::<f64>()));
        }
        if rows.is_empty() {
            return Some(vec![0.0; n]);
        }
        let depth = rows.iter().fold(0.0_f64, |most, (_, right)| most.max(-right));
        rows.iter_mut().for_each(|(_, right)| *right += depth);
        // The deepest point of a few requirements may be infinitely deep; no cell of the
        // box is deeper than 2.
        for i in 0..=n {
            let unit = (0..=n).map(|j| if i == j { 1.0 } else { 0.0 }).collect();
            rows.push((unit, if i == n { depth + 2.0 } else { 2.0 }));
        }
        let (m, columns) = (rows.len(), n + 1);
        let mut gain: Vec<f64> = (0..columns).map(|j| if j == n { 1.0 } else { 0.0 }).collect();
        let mut basis: Vec<usize> = (columns..columns + m).collect();
        let mut free: Vec<usize> = (0..columns).collect();
        for pivots in 0..MOST_PIVOTS {
            // The steepest column; Bland's rule, which cannot cycle, if that takes long.
            let mut entering = (0..columns).filter(|j| gain[*j] > 1e-12);
            let column = if pivots < MOST_PIVOTS / 2 {
                entering.max_by(|i, j| gain[*i].total_cmp(&gain[*j]))
            } else {
                entering.by_ref().min_by_key(|j| free[*j])
            };
            let Some(c) = column else { break };
            let ratio = |i: usize| rows[i].1 / rows[i].0[c];
            let leaving = (0..m).filter(|i| rows[*i].0[c] > 1e-12);
            let order = |i: &usize, j: &usize| {
                ratio(*i).total_cmp(&ratio(*j)).then(basis[*i].cmp(&basis[*j]))
            };
            let Some(r) = leaving.min_by(order) else { break };
            let pivot = rows[r].0[c];
            rows[r].0.iter_mut().for_each(|v| *v /= pivot);
            rows[r].0[c] = 1.0 / pivot;
            rows[r].1 /= pivot;
            let (row, right) = rows[r].clone();
            for (_, (entries, value)) in rows.iter_mut().enumerate().filter(|(i, _)| *i != r) {
                let factor = entries[c];
                if factor != 0.0 {
                    entries[c] = 0.0;
                    entries.iter_mut().zip(&row).for_each(|(v, p)| *v -= factor * p);
                    *value = (*value - factor * right).max(0.0);
                }
            }
            let factor = gain[c];
            gain[c] = 0.0;
            gain.iter_mut().zip(&row).for_each(|(v, p)| *v -= factor * p);
            std::mem::swap(&mut basis[r], &mut free[c]);
        }
        let mut point = vec![0.0; columns];
        for (variable, (_, value)) in basis.iter().zip(&rows) {
            if *variable < columns {
                point[*variable] = *value;
            }
        }
        let deep = point.pop()? - depth;
        (deep >= -ROUNDING).then(|| point.into_iter().map(|z| z - 1.0).collect())
    }
}

/// Puts the value of a coordinate into a row.
fn substitute(row: &mut [f64], pivot: usize, value: &[f64]) {
    let factor = std::mem::take(&mut row[pivot]);
    row.iter_mut().zip(value).for_each(|(v, part)| *v += factor * part);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn linear(row: &[f64]) -> Option<Linear> {
        Some(Linear { row: row.to_vec(), error: 0.0 })
    }

    fn count(functions: &[Option<Linear>], on: &[Option<Linear>], n: usize) -> usize {
        let found = patterns(functions, on, &vec![(-1.0, 1.0); n], 10_000);
        assert!(!found.more);
        for (sides, place) in &found.found {
            for (f, side) in functions.iter().zip(sides) {
                let Some(f) = f else { continue };
                let value = (0..n).map(|j| f.row[j] * place[j]).sum::<f64>() + f.row[n];
                assert!(value * side > -1e-12, "{sides:?} {place:?}");
            }
        }
        found.found.len()
    }

    /// Planes in general position part the space into the sum of the binomials C(m, i), i up to n,
    /// and a plane of theirs into that of m - 1 and n - 1 (Schlafli 1852).
    #[test]
    fn planes_have_as_many_cells_as_they_should() {
        let mut draws = twofold_num::random::RandomStream::new(5, 0);
        let mut draw = || 2.0 * draws.uniform() - 1.0;
        for n in 1..=4 {
            for m in [3, 6, 9] {
                // All meet near to the middle, so that the box cuts no cell off.
                let functions: Vec<Option<Linear>> = (0..m)
                    .map(|_| {
                        let mut row: Vec<f64> = (0..n).map(|_| draw()).collect();
                        row.push(1e-4 * draw());
                        linear(&row)
                    })
                    .collect();
                let cells = |m: usize, n: usize| -> usize {
                    let choose = |i: usize| (0..i).fold(1, |c, k| c * (m - k) / (k + 1));
                    (0..=n.min(m)).map(choose).sum()
                };
                assert_eq!(count(&functions, &[], n), cells(m, n), "{m} planes, {n} dimensions");
                let (on, others) = functions.split_at(1);
                assert_eq!(count(others, on, n), cells(m - 1, n - 1), "on one of {m}, {n}");
            }
        }
    }

    #[test]
    fn thin_cells_are_cells_and_far_ones_are_none() {
        // x > 0.1 and x < 0.1 + w; x > 2 has no point.
        for w in [1e-2, 1e-6, 1e-12] {
            let functions = [linear(&[1.0, -0.1]), linear(&[1.0, -0.1 - w])];
            let found = patterns(&functions, &[], &[(-1.0, 1.0)], 10);
            let strip = found.found.iter().find(|(sides, _)| sides == &[1.0, -1.0]);
            let (_, place) = strip.unwrap_or_else(|| panic!("{w}"));
            assert!(place[0] > 0.1 && place[0] < 0.1 + w, "{w} {place:?}");
            // Rounding may give the impossible pattern of the thinnest a point.
            assert!(found.found.len() == 3 || w < ROUNDING, "{w}");
        }
        assert_eq!(count(&[linear(&[1.0, -2.0])], &[], 1), 1);
        assert_eq!(count(&[None, linear(&[1.0, 0.0])], &[], 1), 4);
        assert_eq!(count(&[], &[linear(&[1.0, -2.0])], 1), 0);
    }
}
