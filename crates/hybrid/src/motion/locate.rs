//! Search for the first condition that is met in a step.

use super::*;

/// A flight may be hidden by rounding if the square of its speed is less than so many roundings of
/// its expression's terms times its bend.
const MAY_HIDE: f64 = 1e3;

/// The speed of a surface that sliding has just left is zero there: what a step's interpolant makes
/// of it is less than this share of the speeds on its two sides.
pub(super) const TANGENT: f64 = 1e-3;

impl Follower<'_> {
    /// Finds the first condition met in a step, with its place and all others in the same part of
    /// the step; `last` takes the values at the end of the search.
    pub(super) fn find(
        &mut self,
        step: &Step,
        list: &[(Sought, f64)],
        parts: &[(f64, f64)],
        last: &mut Vec<f64>,
        found: &mut Vec<(f64, Sought)>,
    ) {
        found.clear();
        self.leaves = None;
        if list.is_empty() {
            return;
        }
        let open = match step.series {
            Some(_) => self.find_in_series(step, list, parts.len() <= 1, last, found),
            None if self.find_in_polynomials(step, list, last, found) => Vec::new(),
            None => vec![true; list.len()],
        };
        let parts = if parts.is_empty() { &[(0.0, 1.0)] } else { parts };
        if open.contains(&true) {
            self.find_by_values(step, list, &open, parts, found);
            std::mem::swap(last, &mut self.samples[4]);
        }
        self.tell_rounding(step, list, parts, found);
    }

    /// Passes over zeros, right at the beginning of a step, of functions that the conditions of
    /// events alone ask and that have no sign beyond rounding for a while, as those that leave zero
    /// to third order.
    fn tell_rounding(
        &mut self,
        step: &Step,
        list: &[(Sought, f64)],
        parts: &[(f64, f64)],
        found: &mut Vec<(f64, Sought)>,
    ) {
        const EARLY: f64 = 1e-6;
        /// A zero that counts has one side beyond rounding at so many times its place, or before.
        const LATER: [f64; 4] = [0.5, 1.0, 2.0, 8.0];
        let mut value = Vec::new();
        for (theta, sought) in found.iter_mut().filter(|(theta, _)| *theta < EARLY) {
            let Sought::Guard { guard, .. } = *sought else { continue };
            let Some((_, side)) = list.iter().find(|(one, _)| one == sought) else { continue };
            if self.equation.guards[guard].whole || !self.equation.is_of_conditions(guard) {
                continue;
            }
            let expression = &self.equation.guards[guard].expression;
            let rounding = 64.0 * f64::EPSILON * self.magnitude(expression);
            let (one, mut at) = ([(*sought, *side)], vec![0.0; self.n]);
            let mut f = |theta: f64| {
                step.at(theta, &mut at);
                self.measure(&one, step.t + theta * step.h, &at, &mut value);
                value[0]
            };
            if !LATER.iter().all(|later| f(later * *theta).abs() <= rounding) {
                continue;
            }
            let begin = LATER[3] * *theta;
            *theta = f64::INFINITY;
            // As far beyond zero as rounding may be.
            let mut f = |theta: f64| f(theta) + side * rounding;
            for (from, to) in parts.iter().map(|(from, to)| (from.max(begin), *to)) {
                let v = PLACES.map(|place| f(from + place * (to - from)));
                if let Some(next) = first(v, *side, from, to, &mut f, 0) {
                    *theta = next;
                    break;
                }
            }
        }
        found.retain(|(theta, _)| theta.is_finite());
    }

    /// Adds the first zeros if all conditions are sums of states, which are polynomials in a step
    /// and need no evaluation, and sets their values at the step's end; else false.
    fn find_in_polynomials(
        &mut self,
        step: &Step,
        list: &[(Sought, f64)],
        last: &mut Vec<f64>,
        found: &mut Vec<(f64, Sought)>,
    ) -> bool {
        let polynomial = |sought: Sought| {
            self.polynomial_of(step, sought).filter(|(b, _)| b.iter().all(|b| b.is_finite()))
        };
        let Some(all) =
            list.iter().map(|(sought, _)| polynomial(*sought)).collect::<Option<Vec<_>>>()
        else {
            return false;
        };
        last.clear();
        for ((sought, side), (b, size)) in list.iter().zip(all) {
            let mut v = PLACES.map(|theta| at_fraction(&b, theta));
            last.push(v[4]);
            let allowance = self.allowance(step, *sought, *side);
            if allowance != 0.0 {
                v.iter_mut().for_each(|v| *v += allowance);
                found.extend(first_of_polynomial(v, *side).map(|theta| (theta, *sought)));
                continue;
            }
            let change = self.begin_at_zero(*sought, *side, step.h, &mut v);
            let (slope, bend) = (4.0 * (b[1] - b[0]), 12.0 * (b[2] - 2.0 * b[1] + b[0]));
            if v[0] == 0.0
                && slope * slope <= MAY_HIDE * f64::EPSILON * size * bend.abs()
                && let Some(leaving) = self.leaving(*sought, *side)
                && let Some(theta) = self.hidden(leaving, step.h)
            {
                found.extend((theta <= 1.0).then_some((theta, *sought)));
                continue;
            }
            let first = match change {
                None => first_of_polynomial(v, *side),
                Some(change) => {
                    let (begin, f) = (b[0], |theta| at_fraction(&b, theta) - theta * change);
                    first_behind_tangent(*side, 0.0, 1.0, &mut |theta| f(theta) - begin)
                }
            };
            found.extend(first.map(|theta| (theta, *sought)));
        }
        true
    }

    /// Puts the values, at [`PLACES`] of a time `h`, of a function that has just left zero, or that
    /// rounding has beyond it, to zero at the beginning. If it leaves zero to second order, returns
    /// the change in that time by the slope there that rounding or the step's error makes, as far
    /// as it leads away from its side.
    fn begin_at_zero(
        &mut self,
        sought: Sought,
        side: f64,
        h: f64,
        v: &mut [f64; 5],
    ) -> Option<f64> {
        let fresh = self.is_fresh(sought);
        // Of the two ends of a whole part one is left.
        let far = matches!(sought, Sought::Guard { guard, .. } if self.equation.guards[guard].whole)
            && v[0] > 0.5;
        if far || !(fresh || v[0] * side < 0.0) {
            return None;
        }
        v[0] = 0.0;
        let change = slope_at_beginning(v);
        let left = if fresh { self.left(sought) } else { 0.0 };
        let tangent = self.is_tangent(sought) || change.abs() < TANGENT * h * left;
        if !(tangent || change * side < 0.0) {
            return None;
        }
        let place = self.place_of(sought)?;
        let rates = self.rates(&self.config.clone()).1;
        let slope = SMALLEST_SLOPE * rates.terms[place].max(self.left(sought));
        // A collocation polynomial's slope at its beginning is not the field's.
        let of_field = fresh
            && self.options.method == Method::Radau5
            && self.sliding.is_empty()
            && self.contacts.is_empty();
        let leads_away = of_field && rates.first[place] * side > 0.0;
        let is_error = tangent || leads_away || change.abs() <= h * slope;
        is_error.then_some(side * (side * change).min(0.0))
    }

    /// The place in a step of this length where a flight that rounding hides ends, as its parabola
    /// does.
    fn hidden(&mut self, (until, slope, bend): (f64, f64, f64), h: f64) -> Option<f64> {
        let end = -2.0 * slope / bend;
        let (i, _) = self.leaves?;
        // Bodies that touch without a law of rest may part by rounding alone.
        let sticks = self.event_of[i].is_some_and(|e| self.model.definition().events()[e].sticks);
        if !(sticks && end > 0.0 && end <= until) {
            return None;
        }
        self.leaves = Some((i, f64::INFINITY));
        Some(end / h)
    }

    /// A watched expression that leaves zero at the step's beginning to its side has no sign beyond
    /// rounding for a while, in which a parabola says more: its time, slope, and second derivative.
    fn leaving(&mut self, sought: Sought, side: f64) -> Option<(f64, f64, f64)> {
        let Sought::Watched(i) = sought else { return None };
        let (compiled, rates) = self.rates_of_second_order(&self.config.clone());
        let place = compiled.active.len() + i;
        let (slope, bend) = (rates.first_or_zero(place), rates.second[place]);
        if !(slope * side > 0.0) {
            return None;
        }
        let rounding = self.grain_of(i, rates.terms[place]);
        self.leaves = Some((i, 0.25 * rounding));
        let rounding = 4.0 * rounding;
        let until = (rounding / slope.abs()).min((2.0 * rounding / bend.abs()).sqrt());
        until.is_finite().then_some((until, slope, bend))
    }

    /// The speed by which rounding of a slope is measured where sliding has just left a surface:
    /// the motion is tangent to it.
    fn left(&self, sought: Sought) -> f64 {
        match sought {
            Sought::Guard { guard, .. } => self.left[guard],
            Sought::Watched(i) => self.left_watch[i].abs(),
            _ => 0.0,
        }
    }

    /// Whether what is sought left zero without a speed.
    fn is_tangent(&self, sought: Sought) -> bool {
        let tangent = match sought {
            Sought::Watched(i) => self.tangent[i],
            Sought::Guard { guard, .. } => self.tangent_guard[guard],
            _ => false,
        };
        tangent && self.is_fresh(sought)
    }

    /// Whether these values of a function that left zero without a speed are no more than what the
    /// errors of the states make of it: its side is the one to which it leaves.
    pub(super) fn is_within_error(&mut self, sought: Sought, values: &[f64]) -> bool {
        /// Errors of a step, in units of the tolerance.
        const MOST: f64 = 10.0;
        if !self.is_tangent(sought) {
            return false;
        }
        let Some(place) = self.place_of(sought) else { return false };
        let gradient = self.gradient(self.t, place);
        let of = |(i, slope): (usize, &f64)| {
            slope.abs() * (self.options.rtol * self.width(i) + self.options.atol.unwrap_or(0.0))
        };
        let error: f64 = gradient.iter().enumerate().map(of).sum();
        values.iter().all(|v| v.abs() <= MOST * error)
    }

    /// Adds the first zero of each function's Taylor series and sets the values at the step's end;
    /// returns which functions have no series.
    fn find_in_series(
        &mut self,
        step: &Step,
        list: &[(Sought, f64)],
        is_whole: bool,
        last: &mut Vec<f64>,
        found: &mut Vec<(f64, Sought)>,
    ) -> Vec<bool> {
        let fresh = list.iter().any(|(sought, _)| self.is_fresh(*sought));
        let terms = if fresh { self.rates(&self.config.clone()).1.terms } else { Vec::new() };
        let (mut open, mut at, mut value) = (Vec::new(), vec![0.0; self.n], Vec::new());
        last.clear();
        for (sought, side) in list {
            let series = self.series_of(step, *sought, is_whole);
            open.push(series.is_none());
            last.push(series.as_ref().map_or(f64::NAN, |c| c.iter().rev().sum()));
            let Some(mut c) = series else { continue };
            let allowance = self.allowance(step, *sought, *side);
            c[0] += allowance;
            // Of the two ends of a whole part one is left.
            let far = matches!(sought, Sought::Guard { guard,
                .. } if self.equation.guards[*guard].whole && c[0] > 0.5);
            let begins = (self.is_fresh(*sought) && !far && allowance == 0.0).then(|| {
                let terms =
                    self.place_of(*sought).and_then(|place| terms.get(place)).unwrap_or(&0.0);
                if self.is_tangent(*sought) {
                    return f64::INFINITY;
                }
                SMALLEST_SLOPE * step.h * terms.max(self.left(*sought))
            });
            let one = [(*sought, *side)];
            let mut f = |theta: f64| {
                step.at(theta, &mut at);
                self.measure(&one, step.t + theta * step.h, &at, &mut value);
                value[0] + allowance
            };
            let first = first_of_series(&c, *side, begins, &mut f);
            found.extend(first.map(|theta| (theta, *sought)));
        }
        open
    }

    /// Adds the first zeros of the conditions that are `open`, from values at five places of each
    /// part, and more if these do not decide; the values at the end of the last part are left in
    /// the last sample, not-a-number if a function has no value on the way.
    fn find_by_values(
        &mut self,
        step: &Step,
        list: &[(Sought, f64)],
        open: &[bool],
        parts: &[(f64, f64)],
        found: &mut Vec<(f64, Sought)>,
    ) {
        /// Part of a step in which nothing is told from its beginning.
        const AT_ONCE: f64 = 1e-6;
        let known = found.iter().map(|(theta, _)| *theta).fold(f64::INFINITY, f64::min);
        let mut at = std::mem::take(&mut self.room);
        at.resize(self.n, 0.0);
        let mut values = std::mem::take(&mut self.samples);
        for &(from, to) in parts {
            for (place, values) in PLACES.iter().zip(&mut values) {
                let theta = from + place * (to - from);
                if theta == 1.0 {
                    at.copy_from_slice(&step.y);
                } else {
                    step.at(theta, &mut at);
                }
                self.measure(list, step.t + theta * step.h, &at, values);
            }
            for (j, (sought, side)) in list.iter().enumerate().filter(|(j, _)| open[*j]) {
                let mut v: [f64; 5] = std::array::from_fn(|i| values[i][j]);
                let allowance = self.allowance(step, *sought, *side);
                v.iter_mut().for_each(|v| *v += allowance);
                let begins = from == 0.0 && allowance == 0.0;
                let change = begins
                    .then(|| self.begin_at_zero(*sought, *side, to * step.h, &mut v))
                    .flatten()
                    .map(|change| change / to);
                if v.iter().any(|v| v.is_nan()) {
                    // Weights of sliding where there are none: shorter steps find the place.
                    if matches!(sought, Sought::Leave { .. } | Sought::Repelling) {
                        found.push((from + 0.5 * (to - from), *sought));
                    }
                    values[4][j] = f64::NAN;
                    continue;
                }
                if stays(&v, *side) || begins && self.is_within_error(*sought, &v) {
                    continue;
                }
                let leaving =
                    if begins && v[0] == 0.0 { self.leaving(*sought, *side) } else { None };
                if let Some(theta) = leaving.and_then(|leaving| self.hidden(leaving, step.h)) {
                    found.extend((theta <= to).then_some((theta, *sought)));
                    continue;
                }
                let (one, mut value) = ([(*sought, *side)], Vec::new());
                let mut f = |theta: f64| {
                    let time = theta * step.h;
                    if let Some((until, slope, bend)) = leaving
                        && time <= until
                    {
                        return time * (slope + 0.5 * time * bend);
                    }
                    step.at(theta, &mut at);
                    self.measure(&one, step.t + theta * step.h, &at, &mut value);
                    value[0] + allowance - theta * change.unwrap_or(0.0)
                };
                let first = match change {
                    None => first(v, *side, from, to, &mut f, 0),
                    Some(_) => {
                        let begin = f(from);
                        first_behind_tangent(*side, from, to, &mut |theta| f(theta) - begin)
                    }
                };
                // A function that leaves zero to its side has not come back at once.
                let leaves = |theta: &f64| {
                    begins
                        && *theta < AT_ONCE
                        && v[1..].iter().all(|v| v * side > 0.0)
                        && self.is_fresh(*sought)
                };
                found.extend(first.filter(|theta| !leaves(theta)).map(|theta| (theta, *sought)));
            }
            if found.iter().any(|(theta, _)| *theta <= to) || known <= to {
                break;
            }
        }
        (self.room, self.samples) = (at, values);
    }
}
