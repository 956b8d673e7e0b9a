//! Parts of a check: conditions, and numbers of a certificate as exact fractions.

use super::rational::{Range, Rational};

/// A failed check: what should hold.
pub(super) type Check<T = ()> = Result<T, String>;

pub(super) fn need(holds: bool, what: impl Into<String>) -> Check {
    if holds { Ok(()) } else { Err(what.into()) }
}

pub(super) type Bounds = [f64; 2];

pub(super) fn exactly(x: f64) -> Check<Rational> {
    Rational::exactly(x).ok_or_else(|| format!("{x} is a number"))
}

pub(super) fn decimal(text: &str) -> Check<Rational> {
    Rational::decimal(text).ok_or_else(|| format!("{text:?} is a decimal number"))
}

pub(super) fn range([low, high]: Bounds) -> Check<Range> {
    let range = Range { low: exactly(low)?, high: exactly(high)? };
    need(range.low <= range.high, format!("the bounds {low:e}, {high:e} are in order"))?;
    Ok(range)
}

/// Whether a claimed enclosure holds what was computed here.
pub(super) fn holds(claimed: &Range, ours: &Range, what: &str) -> Check {
    need(
        ours.within(claimed),
        format!("{what}: the enclosure {claimed} holds what the checker computes, {ours}"),
    )
}

/// Whether `claimed` holds `exact`, and is wider by rounding alone: some units in the last place of
/// the numbers that it was made of.
pub(super) fn tight(claimed: &Range, exact: &Range, scale: &Rational, what: &str) -> Check {
    need(exact.within(claimed), format!("{what} holds what its parts give"))?;
    let room = &(scale + &exact.magnitude()) * &Rational::tenth_to(14);
    need(claimed.within(&exact.widened(&room)), format!("{what} is no wider than its parts give"))
}
