//! Storage for the coefficients of all series while they are computed.

use super::Series;
use crate::Elementary;

/// The coefficients below degree k of all series, and those of degree k of the series that have
/// been computed.
pub(super) trait Table<S> {
    /// k.
    fn degree(&self) -> usize;
    /// A coefficient of degree k at most.
    fn get(&self, series: Series, degree: usize) -> S;
    /// Coefficient k.
    fn set(&mut self, series: Series, value: S);
    /// Coefficient k + 1.
    fn set_next(&mut self, series: Series, value: S);
    /// The sum over `j` in `from..to` of a_j b_(k-j).
    fn products(&self, a: Series, b: Series, from: usize, to: usize) -> S;

    /// Coefficient k.
    #[inline(always)]
    fn at(&self, series: Series) -> S {
        self.get(series, self.degree())
    }
}

/// One series after the other, `width` coefficients each.
pub(super) struct Columns<'a, S> {
    pub coefficients: &'a mut [S],
    pub width: usize,
    pub k: usize,
}

impl<S: Elementary> Table<S> for Columns<'_, S> {
    #[inline(always)]
    fn degree(&self) -> usize {
        self.k
    }
    #[inline(always)]
    fn get(&self, series: Series, degree: usize) -> S {
        self.coefficients[series * self.width + degree]
    }
    #[inline(always)]
    fn set(&mut self, series: Series, value: S) {
        self.coefficients[series * self.width + self.k] = value;
    }
    #[inline(always)]
    fn set_next(&mut self, series: Series, value: S) {
        self.coefficients[series * self.width + self.k + 1] = value;
    }
    #[inline(always)]
    fn products(&self, a: Series, b: Series, from: usize, to: usize) -> S {
        let (a, b) = (&self.coefficients[a * self.width..], &self.coefficients[b * self.width..]);
        S::sum_of_products(&a[from..to], &b[self.k + 1 - to..self.k + 1 - from])
    }
}

/// Number of series that fit in rows.
pub(super) const ROW: usize = 64;

/// The highest degree for which there are rows.
pub(super) const LONGEST: usize = 21;

/// One degree after the other: row j has coefficient j of every series. `T` rows are known, k + 1.
///
/// With its length known, a sum is computed without a loop: how often a loop goes round is what a
/// processor guesses wrong. And as neighbours in a row belong to different series, no compiler
/// reads two coefficients at once: that would have to wait until the younger one has arrived in
/// memory.
pub(super) struct Rows<'a, const T: usize> {
    pub known: &'a mut [[f64; ROW]; T],
    pub next: &'a mut [f64; ROW],
}

/// A series' place in a row, always within it, so that no bounds check is needed.
#[inline(always)]
fn place(series: Series) -> usize {
    series % ROW
}

impl<const T: usize> Table<f64> for Rows<'_, T> {
    #[inline(always)]
    fn degree(&self) -> usize {
        T - 1
    }
    #[inline(always)]
    fn get(&self, series: Series, degree: usize) -> f64 {
        self.known[degree][place(series)]
    }
    #[inline(always)]
    fn set(&mut self, series: Series, value: f64) {
        self.known[T - 1][place(series)] = value;
    }
    #[inline(always)]
    fn set_next(&mut self, series: Series, value: f64) {
        self.next[place(series)] = value;
    }
    #[inline(always)]
    fn products(&self, a: Series, b: Series, from: usize, to: usize) -> f64 {
        let mut sum = 0.0;
        for j in from..to {
            sum += self.known[j][place(a)] * self.known[T - 1 - j][place(b)];
        }
        sum
    }
}

/// Does what `start` of a plan does, on more than one row.
#[inline(always)]
pub(super) fn start_rows(rows: &mut [[f64; ROW]], start: impl FnOnce(&mut Rows<1>) -> u64) -> u64 {
    match rows.split_first_chunk_mut::<1>() {
        Some((known, [next, ..])) => start(&mut Rows { known, next }),
        _ => 0,
    }
}
