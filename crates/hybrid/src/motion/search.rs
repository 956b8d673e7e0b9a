//! Conditions that a step is searched for, and those that it may have jumped over.

use std::rc::Rc;

use twofold_num::random::RandomStream;
use twofold_num::tape::Program;

use super::sliding::{LITTLE, determinants};
use super::*;
use crate::equation::{Gate, OVERFLOW, same_sign};
use crate::range::Range;
use twofold_num::Arithmetic as _;

/// Most parts of a step that are searched; one with more is made shorter, to this part.
const MOST_PARTS: usize = 4096;
pub(super) const SHORTER: f64 = 0.25;
/// Largest number of halvings of a step in search of a part where it is smooth.
const DEEPEST: usize = 16;
/// By so much of what its error is measured by the derivative of the continuous extension, which is
/// of lower order than the step, may miss the field.
const LARGEST_DEFECT: f64 = 1e3;
/// Steps of this part of a run may be rounding beside a pole.
const BLIND: f64 = 1e-9;

/// A switch that the motion is about to come to.
struct Edge {
    /// The time until then.
    left: f64,
    /// The place of its function among the active ones.
    place: usize,
    guard: usize,
    /// The function's value.
    value: f64,
}

impl Follower<'_> {
    /// Collects the conditions that may be met in a step, each with the side that it is on.
    pub(super) fn sought(&mut self, step: &Step, list: &mut Vec<(Sought, f64)>) {
        list.clear();
        let compiled = self.compiled.clone();
        let mut ranges = std::mem::take(&mut self.ranges);
        self.bound(step, &mut ranges);
        for (place, guard) in compiled.active.iter().enumerate() {
            let side = self.config.sides[*guard];
            if self.slides[*guard] || self.equation.rests(*guard, &self.config) {
                continue;
            }
            if self.equation.guards[*guard].whole {
                for (upper, boundary, way) in [(false, side, 1.0), (true, side + 1.0, -1.0)] {
                    if (self.fresh_guard[*guard]
                        || !self.stays_away(step, &ranges, place, boundary, way))
                        && !self.stands_still(step, place)
                    {
                        list.push((Sought::Guard { guard: *guard, upper }, 1.0));
                    }
                }
            } else if (self.fresh_guard[*guard]
                || !self.stays_away(step, &ranges, place, 0.0, side))
                && !self.stands_still(step, place)
                && !self.hides_a_kink(step, *guard)
            {
                list.push((Sought::Guard { guard: *guard, upper: false }, side));
            }
        }
        for (i, side) in self.watch_side.iter().enumerate() {
            let place = compiled.active.len() + i;
            let away = || !self.fresh_watch[i] && self.stays_away(step, &ranges, place, 0.0, *side);
            if self.is_sought(i) && !away() && !self.stands_still(step, place) {
                list.push((Sought::Watched(i), *side));
            }
        }
        self.ranges = ranges;
        for place in 0..if self.dependent { 0 } else { self.sliding.len() } {
            list.push((Sought::Leave { place, plus: false }, 1.0));
            list.push((Sought::Leave { place, plus: true }, 1.0));
        }
        if !self.sliding.is_empty() {
            list.push((Sought::Repelling, 1.0));
        }
        list.extend((0..self.contacts.len()).map(|place| (Sought::Release(place), 1.0)));
        for (at, beyond) in self.beyond.iter_mut().enumerate() {
            // From where it has been passed it leads away.
            if !std::mem::take(&mut beyond.fresh) {
                list.push((Sought::Beyond(at), beyond.side));
            }
        }
    }

    /// Whether a watched expression is one that steps are searched for.
    pub(super) fn is_sought(&self, i: usize) -> bool {
        self.watch_side[i] != 0.0
            && !self.held[i]
            && self.is_asked(i)
            && !self.contacts.iter().any(|c| c.watched == i)
    }

    /// Whether the equations are continuous where this function is zero, and in the whole step it
    /// is so near to zero that the other side's field leads to the same state, to the step's own
    /// error: which side is followed does not matter.
    fn hides_a_kink(&mut self, step: &Step, guard: usize) -> bool {
        /// In units of a step's error: the zeros that the error makes are farther apart.
        const ERRORS: f64 = 10.0;
        // For what decides an event the order of its zeros and of others matters.
        let of_event = self.equation.of_events.iter().any(|asked| asked.contains(&guard));
        if self.equation.guards[guard].whole || of_event {
            return false;
        }
        let (n, rtol) = (self.n, self.options.rtol);
        let small = ERRORS * rtol * self.magnitude(&self.equation.guards[guard].expression);
        let places = [0.0, 0.5, 1.0].map(|theta| {
            let mut x = vec![0.0; n];
            step.at(theta, &mut x);
            (step.t + theta * step.h, x)
        });
        // With the other functions' sides and the tables' pieces as they are in the step.
        let Some(place) = self.compiled.place(guard) else { return false };
        let mut values = vec![0.0; self.compiled.outputs];
        let mut near = |(t, x): &(f64, Vec<f64>)| {
            self.variables[..n].copy_from_slice(x);
            self.variables[n] = *t;
            self.compiled.watched.evaluate(&self.variables, &mut values);
            values[place].abs() <= small
        };
        if !places.iter().all(&mut near) {
            return false;
        }
        let mut other = self.config.clone();
        other.sides[guard] = -other.sides[guard];
        self.ask_new(&mut other);
        let (compiled, mut variables) = (self.equation.compiled(&other), self.load(&other));
        let (mut here, mut there) = (vec![0.0; n], vec![0.0; n]);
        let agree = places.iter().all(|(t, x)| {
            variables[..n].copy_from_slice(x);
            variables[n] = *t;
            compiled.field.evaluate(&variables, &mut there);
            self.variables[..n].copy_from_slice(x);
            self.variables[n] = *t;
            self.compiled.field.evaluate(&self.variables, &mut here);
            let atol = self.options.atol.unwrap_or(0.0);
            (0..n).all(|i| {
                let error = ERRORS * (atol + rtol * self.scale_of(i).max(x[i].abs()));
                ((here[i] - there[i]) * step.h).abs() <= error
            })
        });
        agree && self.is_kink(guard)
    }

    /// Whether the equations are continuous where this function is zero: by the way in which it is
    /// written, or around the state, where the fields of both sides agree at points of the surface
    /// that are drawn there, and part beside it in proportion to the distance.
    pub(super) fn is_kink(&mut self, guard: usize) -> bool {
        const DRAWN: usize = 6;
        /// So far away are points drawn, in units of a state's size and of the run.
        const SPREAD: f64 = 0.1;
        /// Distances from the surface at which fields are compared, in the same units. Differences
        /// like the square root of the distance are 30 times as large as this allows.
        const BESIDE: [f64; 2] = [1e-3, 1e-6];
        const ROUNDING: f64 = 1e-10;
        if self.equation.guards[guard].kink {
            return true;
        }
        if self.equation.guards[guard].whole || self.config.sides[guard] == 0.0 {
            return false;
        }
        let n = self.n;
        let own = self.config.clone();
        let mut other = own.clone();
        other.sides[guard] = -other.sides[guard];
        self.ask_new(&mut other);
        self.follow_sides(&mut other, &[guard]);
        let tells =
            |e: &Rc<Expression>| self.equation.holds(e, &own) != self.equation.holds(e, &other);
        if self.equation.conditions.iter().flatten().any(tells) {
            return false;
        }
        let sides = [own, other].map(|config| {
            let variables = self.load(&config);
            (self.equation.compiled_with(&config, &[guard]), variables)
        });
        let (asked, variables) = &sides[0];
        let Some(place) = asked.place(guard) else { return false };
        // Of events, too.
        let values = |side: usize, at: &[f64]| {
            let (compiled, variables) = &sides[side];
            let mut variables = variables.clone();
            variables[..=n].copy_from_slice(at);
            let (mut field, mut watched) = (vec![0.0; n], vec![0.0; compiled.outputs]);
            compiled.field.evaluate(&variables, &mut field);
            compiled.watched.evaluate(&variables, &mut watched);
            field.extend_from_slice(&watched[compiled.active.len()..]);
            field
        };
        let span = self.options.t_end - self.options.t_start;
        let mut sizes: Vec<f64> = (0..n).map(|i| self.size[i].max(self.x[i].abs())).collect();
        sizes.push(span);
        // The function's value, and the way towards its zero in units of sizes.
        let towards = |at: &[f64]| {
            let mut variables = variables.clone();
            variables[..=n].copy_from_slice(at);
            let mut watched = vec![0.0; asked.outputs];
            asked.watched.evaluate(&variables, &mut watched);
            let gradient = &asked.gradients(&variables)[place];
            let mut way = vec![0.0; n];
            for (variable, slope) in asked.touches[place].iter().zip(gradient) {
                if *variable < n {
                    way[*variable] = slope * sizes[*variable];
                }
            }
            (watched[place], way)
        };
        let mut chance = RandomStream::new(0, guard as u64);
        let here: Vec<f64> = self.x.iter().copied().chain([self.t]).collect();
        let (mut largest, mut pairs) = (vec![0.0_f64; n + self.equation.watched.len()], Vec::new());
        for _ in 0..DRAWN {
            let mut at: Vec<f64> = here
                .iter()
                .zip(&sizes)
                .map(|(x, size)| x + SPREAD * size * chance.uniform_in(-1.0, 1.0))
                .collect();
            let mut direction = Vec::new();
            for step in 0..8 {
                let (value, way) = towards(&at);
                let length = way.iter().map(|w| w * w).sum::<f64>();
                if !(length > 0.0 && value.is_finite()) {
                    return false;
                }
                if step < 7 {
                    let by = value / length;
                    (0..n).for_each(|i| at[i] -= by * way[i] * sizes[i]);
                } else if value.abs() > 1e-9 * length.sqrt() {
                    return false;
                }
                direction = way.iter().map(|w| w / length.sqrt()).collect();
            }
            let three = [0.0, BESIDE[0], BESIDE[1]].map(|distance| {
                let mut beside = at.clone();
                (0..n).for_each(|i| beside[i] += distance * sizes[i] * direction[i]);
                [0, 1].map(|side| values(side, &beside))
            });
            for value in three.iter().flatten() {
                largest.iter_mut().zip(value).for_each(|(most, v)| *most = most.max(v.abs()));
            }
            pairs.push(three);
            // A jump is seen at the first point.
            let apart = |[a, b]: &[Vec<f64>; 2], i: usize| (a[i] - b[i]).abs();
            let agree = pairs.iter().all(|[on, far, near]| {
                (0..largest.len()).all(|i| {
                    let rounding = ROUNDING * largest[i];
                    let allowed = 5.0 * BESIDE[1] / BESIDE[0] * apart(far, i) + rounding;
                    apart(on, i) <= rounding && apart(near, i) <= allowed
                })
            });
            if !agree {
                return false;
            }
        }
        true
    }

    /// Bounds guards and watched expressions in a step by the states' [`Range`]s, if one of them is
    /// no sum of states.
    fn bound(&mut self, step: &Step, ranges: &mut [Vec<Range>; 2]) {
        let [variables, values] = ranges;
        values.clear();
        if step.series.is_some() || !self.compiled.is_curved {
            return;
        }
        let n = self.n;
        variables.clear();
        variables.extend((0..n).map(|i| Range::between(&step.bernstein(i))));
        variables.push(Range::between(&[step.t, step.t, step.t, step.t, step.t + step.h]));
        variables.extend(self.variables[n + 1..].iter().map(|v| Range::from_f64(*v)));
        values.resize(self.compiled.outputs, Range::default());
        self.compiled.watched.evaluate(variables, values);
    }

    /// Whether a watched value stays on its side of `boundary` in a step, as can be told without
    /// evaluating it at places of the step: a sum of states is a polynomial along the step's
    /// continuous extension, and lies between its Bernstein coefficients; others lie in their
    /// ranges.
    fn stays_away(
        &self,
        step: &Step,
        ranges: &[Vec<Range>; 2],
        place: usize,
        boundary: f64,
        side: f64,
    ) -> bool {
        if step.series.is_some() {
            return false;
        }
        let Some((b, size)) = self.polynomial(step, place, boundary) else {
            return ranges[1][place].is_beyond(boundary, side);
        };
        let least = b.iter().fold(f64::INFINITY, |least, b| least.min(b * side));
        least > 1e-12 * size && crate::roots::keeps_away(&b, side)
    }

    /// Whether nothing that a watched value sees moves in a step: then it meets nothing, whatever
    /// rounding makes of it.
    fn stands_still(&self, step: &Step, place: usize) -> bool {
        step.series.is_none()
            && self.compiled.touches[place].iter().all(|variable| match *variable {
                i if i < self.n => step.bernstein(i).iter().all(|b| *b == step.x[i]),
                i => i > self.n && i <= self.n + self.equation.guards.len(),
            })
    }

    /// The Bernstein coefficients of a sum of states along a step, and the size of its terms.
    fn polynomial(&self, step: &Step, place: usize, boundary: f64) -> Option<([f64; 5], f64)> {
        let sum = self.compiled.affine[place].as_ref()?;
        let mut b = [sum.constant - boundary; 5];
        let mut size = b[0].abs();
        for (variable, factor) in &sum.factors {
            let part = match *variable {
                i if i < self.n => step.bernstein(i),
                i if i == self.n => {
                    [0.0, 0.25, 0.5, 0.75, 1.0].map(|theta| step.t + theta * step.h)
                }
                i => [self.variables[i]; 5],
            };
            size += (factor * part[0]).abs();
            b.iter_mut().zip(part).for_each(|(b, p)| *b += factor * p);
        }
        Some((b, size))
    }

    /// The same for what is sought, of which whole parts are measured as they are.
    pub(super) fn polynomial_of(&self, step: &Step, sought: Sought) -> Option<([f64; 5], f64)> {
        let place = self.plain_place(sought)?;
        self.polynomial(step, place, 0.0)
    }

    /// The place of a guard or watched value.
    pub(super) fn place_of(&self, sought: Sought) -> Option<usize> {
        match sought {
            Sought::Guard { guard, .. } => self.compiled.place(guard),
            other => self.plain_place(other),
        }
    }

    /// The place of a sign or a watched value.
    fn plain_place(&self, sought: Sought) -> Option<usize> {
        match sought {
            Sought::Guard { guard, .. } if !self.equation.guards[guard].whole => {
                self.compiled.place(guard)
            }
            Sought::Watched(i) => Some(self.compiled.active.len() + i),
            _ => None,
        }
    }

    /// The value of what is sought at a point.
    fn value_of(&mut self, sought: Sought, t: f64, x: &[f64]) -> f64 {
        let Some(sum) =
            self.plain_place(sought).and_then(|place| self.compiled.affine[place].as_ref())
        else {
            let mut value = Vec::new();
            self.measure(&[(sought, 1.0)], t, x, &mut value);
            return value[0];
        };
        let n = self.n;
        let variable = |i: usize| {
            if i < n {
                x[i]
            } else if i == n {
                t
            } else {
                self.variables[i]
            }
        };
        sum.factors.iter().fold(sum.constant, |value, (i, factor)| value + factor * variable(*i))
    }

    /// The values of all that is sought at a point.
    pub(super) fn measure(
        &mut self,
        list: &[(Sought, f64)],
        t: f64,
        x: &[f64],
        out: &mut Vec<f64>,
    ) {
        let n = self.n;
        self.variables[..n].copy_from_slice(x);
        self.variables[n] = t;
        let compiled = self.compiled.clone();
        let active = compiled.active.len();
        let mut values = std::mem::take(&mut self.scratch);
        values.resize(active + self.equation.watched.len(), 0.0);
        compiled.watched.evaluate(&self.variables, &mut values);
        // Weights of the positive sides, and of the negative ones where those are not what is left.
        let (mut weights, mut others) = (Vec::new(), Vec::new());
        let mut determinant = f64::NAN;
        // The divisor of the weight of each surface that is slid upon.
        let mut divisors = Vec::new();
        if !self.sliding.is_empty() {
            let mut field0 = vec![0.0; n];
            compiled.field.evaluate(&self.variables, &mut field0);
            if self.separate.is_some() {
                let jumps;
                (weights, jumps, _) = self.separate_weights(t, x, &field0);
                self.complete(t, x, &mut weights);
                // Each attracts by itself: the one that is nearest to doing so no more counts.
                divisors = jumps.iter().map(|j| -j).collect();
                determinant = divisors.iter().copied().fold(f64::INFINITY, f64::min);
            } else if !self.corners.is_empty() {
                let (found, fields, rates) = self.corner_mixture(t, x);
                (weights, others) =
                    found.margins.iter().map(|[plus, minus]| (*plus, *minus)).unzip();
                determinant = self.corners_hold(&fields, &rates);
            } else {
                let (a, matrix) = self.sliding_equations(t, x, &field0);
                let k = a.len();
                weights = self.solved(&a, &matrix);
                self.complete(t, x, &mut weights);
                // Attracting where minus the matrix has a positive determinant, which a single
                // surface's jump of speed is, and where fields do not turn away.
                let holds = match self.may_turn_away() {
                    _ if self.dependent => self.dependent_hold(t, x, &a, &matrix, &weights),
                    false => f64::INFINITY,
                    true => attraction(&a, &matrix),
                };
                if !self.dependent {
                    divisors = determinants(&matrix, k);
                }
                determinant = divisors.iter().copied().fold(holds, f64::min);
            }
        }
        out.clear();
        for (sought, _) in list {
            out.push(match *sought {
                Sought::Guard { guard, upper } => {
                    let value = active_value(&compiled, &values, guard);
                    match (self.equation.guards[guard].whole, upper) {
                        (false, _) => value,
                        (true, false) => value - self.config.sides[guard],
                        (true, true) => self.config.sides[guard] + 1.0 - value,
                    }
                }
                Sought::Watched(i) | Sought::Pole(i) => values[active + i],
                Sought::Leave { place, plus } => {
                    let weight = if plus {
                        others.get(place).map_or(1.0 - weights[place], |w| *w)
                    } else {
                        weights[place]
                    };
                    let weight = weight + self.rounding_along(place, plus);
                    // Beyond its pole a weight that has passed 1 would come back from below 0.
                    let passed = divisors.get(place).is_some_and(|d| *d < 0.0)
                        && !(-LITTLE..=1.0 + LITTLE).contains(&weights[place]);
                    if passed { -weight } else { weight }
                }
                Sought::Repelling => determinant,
                Sought::Beyond(at) => self.value_beyond(self.beyond[at], t, x),
                // A surface pushes and does not pull.
                Sought::Release(place) => self.push(place, t, x).0,
            });
        }
        self.scratch = values;
    }

    /// The arguments of gates at the fraction `theta` of a step.
    fn arguments(&mut self, program: &Program, gates: usize, step: &Step, theta: f64) -> Vec<f64> {
        let mut out = vec![0.0; gates];
        step.at(theta, &mut self.variables[..self.n]);
        self.variables[self.n] = step.t + theta * step.h;
        program.evaluate(&self.variables, &mut out);
        out
    }

    /// Parts of a step in each of which what is sought is smooth: no operation in it is flat at
    /// five places and steep between them. None if they are too many to be searched.
    pub(super) fn parts(&mut self, step: &Step, list: &[(Sought, f64)]) -> Option<Vec<(f64, f64)>> {
        if step.series.is_none() {
            return if list.is_empty() {
                Some(Vec::new())
            } else {
                self.smooth_parts(step, 1, false)
            };
        }
        if !self.is_followed(step) {
            return None;
        }
        // Weights of sliding and forces of contacts are made of the fields.
        let fields = !(self.sliding.is_empty() && self.contacts.is_empty());
        let mut whole = step.multistep.is_none() || list.is_empty();
        for of_field in [false, true] {
            whole &= (of_field && !fields) || self.smooth_parts(step, 1, of_field)?.len() <= 1;
        }
        if whole {
            return Some(Vec::new());
        }
        let equal = self.searched(step);
        let mut cuts: Vec<f64> = Vec::new();
        for of_field in [false, true] {
            if !of_field || fields {
                let parts = self.smooth_parts(step, equal, of_field)?;
                cuts.extend(parts.iter().flat_map(|(a, b)| [*a, *b]));
            }
        }
        cuts.sort_by(f64::total_cmp);
        cuts.dedup();
        Some(cuts.windows(2).map(|w| (w[0], w[1])).collect())
    }

    /// Parts of `equal` parts of a step in which no gate of the watched values, or of the field,
    /// hides anything.
    fn smooth_parts(
        &mut self,
        step: &Step,
        equal: usize,
        of_field: bool,
    ) -> Option<Vec<(f64, f64)>> {
        let compiled = self.compiled.clone();
        let (gates, program) = match of_field {
            true => (&compiled.gates, &compiled.gate_arguments),
            false => (&compiled.watched_gates, &compiled.watched_gate_arguments),
        };
        if gates.is_empty() && equal == 1 {
            return Some(Vec::new());
        }
        let arguments =
            |follower: &mut Self, theta: f64| follower.arguments(program, gates.len(), step, theta);
        let mut open = Vec::new();
        for i in (0..equal).rev() {
            let [a, b] = [i, i + 1].map(|i| i as f64 / equal as f64);
            open.push((a, b, 0, arguments(self, a), arguments(self, b)));
        }
        let mut parts = Vec::new();
        while let Some((a, b, depth, first, last)) = open.pop() {
            let middle = 0.5 * (a + b);
            let between = arguments(self, middle);
            let quiet = are_quiet(gates, &first, &between, &last);
            if parts.len() + open.len() >= MOST_PARTS {
                return None;
            }
            // A pole is quiet nowhere near it.
            if quiet || depth >= DEEPEST {
                parts.push((a, b));
            } else {
                open.push((middle, b, depth + 1, between.clone(), last));
                open.push((a, middle, depth + 1, first, between));
            }
        }
        Some(parts)
    }

    /// Whether an exponential is so large at the present place that its derivatives overflow: the
    /// field may be smooth there, as 1/(1 + exp(x)) is.
    pub(super) fn overflows(&mut self) -> bool {
        const LARGE: f64 = 100.0;
        let compiled = self.compiled.clone();
        self.variables[..self.n].copy_from_slice(&self.x);
        self.variables[self.n] = self.t;
        let mut exponents = vec![0.0; compiled.gates.len()];
        compiled.gate_arguments.evaluate(&self.variables, &mut exponents);
        compiled.gates.iter().zip(exponents).any(|(gate, x)| *gate == Gate::Exp && x > LARGE)
    }

    /// The place in a step before which all is as the step saw it, if there is something that it
    /// did not see: an operation that is flat at the step's stages and steep between them. Where
    /// arguments move far, the field along the continuous extension is compared with the
    /// extension's own derivative (the defect: Enright 1989).
    pub(super) fn unseen(&mut self, step: &Step, scale: &[f64]) -> Option<f64> {
        let compiled = self.compiled.clone();
        if compiled.gates.is_empty() || step.h == 0.0 {
            return None;
        }
        let n = self.n;
        let arguments = |follower: &mut Self, theta: f64| {
            follower.arguments(&compiled.gate_arguments, compiled.gates.len(), step, theta)
        };
        let ends = [arguments(self, 0.0), arguments(self, 1.0)];
        let divides = |(i, gate): (usize, &Gate)| {
            *gate == Gate::Divisor && ends[0][i] != 0.0 && !same_sign(ends[0][i], ends[1][i])
        };
        if compiled.gates.iter().enumerate().any(divides) && self.is_blind_to_poles(step) {
            return Some(0.0);
        }
        let [first, last] = ends;
        if let Some(theta) = self.thin_pole(step, scale, &first, &last) {
            return Some(theta);
        }
        let mut open = vec![(0.0, 1.0, 0, first, last)];
        let mut looked = 0;
        let (mut at, mut slope, mut field) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        while let Some((a, b, depth, first, last)) = open.pop() {
            let middle = 0.5 * (a + b);
            let between = arguments(self, middle);
            let quiet = are_quiet(&compiled.gates, &first, &between, &last);
            if quiet && depth == 0 {
                return None;
            }
            step.at(middle, &mut at);
            step.slope_at(middle, &mut slope);
            self.rhs(step.t + middle * step.h, &at, &mut field);
            looked += 1;
            let defects: Vec<f64> = (0..n)
                .map(|i| ((field[i] - slope[i]) * step.h * (b - a) / scale[i]).abs())
                .collect();
            let small = |defect: f64| defect <= LARGEST_DEFECT;
            if !defects.iter().all(|defect| small(*defect)) {
                // Errors of the polynomial are forgotten by a stiff equation; and from a
                // root of zero, where no polynomial is near, the step's end alone is known.
                let forgets = step.jacobian.is_some() && {
                    let jacobian = self.jacobian(step.t + middle * step.h, &at);
                    let stiff = |i: usize| 1.0 + step.h * jacobian[i * n + i].abs();
                    (0..n).all(|i| small(defects[i] / stiff(i))) || self.begins_at_a_root(step)
                };
                if !forgets {
                    return Some(a);
                }
            }
            if looked >= MOST_PARTS {
                // Too much to be searched at once.
                return Some(SHORTER);
            }
            if !quiet && depth < DEEPEST {
                open.push((middle, b, depth + 1, between.clone(), last));
                open.push((a, middle, depth + 1, first, between));
            } else if !quiet && self.has_pole(step, middle, &field, scale) {
                return Some(a);
            }
        }
        None
    }

    /// Whether the field, which has this value at a place of a step where a divisor is as good as
    /// zero, has a pole there, integrable or not: it grows towards it. What is continued through
    /// such a place, as sin(x)/x is, has none.
    /// Nor has what is too small to matter, as 1/cosh(x) is where its divisor overflows.
    fn has_pole(&mut self, step: &Step, theta: f64, there: &[f64], scale: &[f64]) -> bool {
        const DISTANCE: f64 = 1.0 / 256.0;
        const GROWTH: f64 = 3.0;
        const MATTERS: f64 = 1e-6;
        if !self.compiled.gates.contains(&Gate::Divisor) {
            return false;
        }
        let (mut at, mut field) = (vec![0.0; self.n], vec![0.0; self.n]);
        let mut least = vec![f64::INFINITY; self.n];
        for away in [theta - DISTANCE, theta + DISTANCE] {
            if (0.0..=1.0).contains(&away) {
                step.at(away, &mut at);
                self.rhs(step.t + away * step.h, &at, &mut field);
                least.iter_mut().zip(&field).for_each(|(l, f)| *l = l.min(f.abs()));
            }
        }
        let least_part = step.h / f64::from(1 << DEEPEST);
        let matters = |i: usize| there[i].abs() * least_part > MATTERS * scale[i];
        (0..self.n).any(|i| matters(i) && there[i].abs() > GROWTH * least[i])
    }

    /// The place of a pole in a step, if a divisor changes its sign on it: however thin it is, as
    /// that of x/(x + 1e-9).
    fn thin_pole(
        &mut self,
        step: &Step,
        scale: &[f64],
        first: &[f64],
        last: &[f64],
    ) -> Option<f64> {
        const HALVINGS: usize = 52;
        let changes = |i: &usize| first[*i] * last[*i] < 0.0;
        let divisors = |gate: &Gate| *gate == Gate::Divisor;
        if !self.compiled.gates.iter().any(divisors) || !(0..first.len()).any(|i| changes(&i)) {
            return None;
        }
        let compiled = self.compiled.clone();
        let (mut at, mut field) = (vec![0.0; self.n], vec![0.0; self.n]);
        let mut nearest: Option<f64> = None;
        for i in (0..first.len()).filter(|i| divisors(&compiled.gates[*i])).filter(changes) {
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                let d = self.arguments(&compiled.gate_arguments, first.len(), step, middle)[i];
                if same_sign(d, first[i]) { low = middle } else { high = middle }
            }
            step.at(low, &mut at);
            self.rhs(step.t + low * step.h, &at, &mut field);
            if self.has_pole(step, low, &field, scale) {
                nearest = Some(nearest.map_or(low, |theta| theta.min(low)));
            }
        }
        nearest
    }

    /// Whether a step in which a divisor changes its sign is so short that rounding hides a pole
    /// there: the field is large, and changes in the step.
    fn is_blind_to_poles(&mut self, step: &Step) -> bool {
        const CHANGE: f64 = 0.1;
        if !self.is_blind(step.h) {
            return false;
        }
        let (mut at, mut field) = (vec![0.0; self.n], vec![0.0; self.n]);
        let mut bounds: Vec<[f64; 2]> = step.k[0].iter().map(|f| [*f, *f]).collect();
        for theta in [0.25, 0.5, 0.75, 1.0] {
            step.at(theta, &mut at);
            self.rhs(step.t + theta * step.h, &at, &mut field);
            for ([low, high], f) in bounds.iter_mut().zip(&field) {
                (*low, *high) =
                    (low.min(*f), if f.is_nan() { f64::INFINITY } else { high.max(*f) });
            }
        }
        (0..self.n).any(|i| {
            let [low, high] = bounds[i];
            let most = low.abs().max(high.abs());
            self.is_large(i, most) && high - low > CHANGE * most
        })
    }

    /// Whether a step is so short that a pole may hide in it.
    pub(super) fn is_blind(&self, h: f64) -> bool {
        h <= BLIND * (self.options.t_end - self.options.t_start)
    }

    /// Whether a speed would move a state by more than its size in a small part of the run.
    fn is_large(&self, i: usize, speed: f64) -> bool {
        BLIND * (self.options.t_end - self.options.t_start) * speed.abs() > self.size[i]
    }

    /// Whether a divisor is zero to rounding at the present place, and the field there is large.
    pub(super) fn is_at_a_pole(&self, field: &[f64]) -> bool {
        let compiled = &self.compiled;
        let large = |(i, f): (usize, &f64)| self.is_large(i, *f);
        if !compiled.gates.contains(&Gate::Divisor) || !field.iter().enumerate().any(large) {
            return false;
        }
        let rounded = |v: &f64| Range::new(*v, 2.0 * f64::EPSILON * v.abs());
        let place: Vec<Range> = self.x.iter().chain([&self.t]).map(rounded).collect();
        let rest = self.variables[self.n + 1..].iter().map(|v| Range::from_f64(*v));
        let place: Vec<Range> = place.into_iter().chain(rest).collect();
        let mut arguments = vec![Range::default(); compiled.gates.len()];
        compiled.gate_arguments.evaluate(&place, &mut arguments);
        // Of a root of zero among its terms rounding has no bound, and its value says it.
        let may_vanish = |d: &Range| match d.radius().is_finite() {
            true => !d.is_beyond(0.0, 1.0) && !d.is_beyond(0.0, -1.0),
            false => !(d.middle().abs() > 0.0),
        };
        let is_zero = |(gate, d): (&Gate, &Range)| *gate == Gate::Divisor && may_vanish(d);
        compiled.gates.iter().zip(&arguments).any(is_zero)
    }

    /// The division by a number that comes to zero at once, if the motion from this point meets
    /// one: the equation that it is in.
    fn division_ahead(&mut self, t: f64, x: &[f64]) -> Option<String> {
        let compiled = self.compiled.clone();
        let mut field = vec![0.0; self.n];
        self.rhs(t, x, &mut field);
        let longest = 1e-6 * (self.options.t_end - self.options.t_start);
        let at = |follower: &mut Self, ahead: f64| {
            for i in 0..follower.n {
                follower.variables[i] = x[i] + ahead * field[i];
            }
            follower.variables[follower.n] = t + ahead;
            let mut out = vec![0.0; compiled.gates.len()];
            compiled.gate_arguments.evaluate(&follower.variables, &mut out);
            out
        };
        let now = at(self, 0.0);
        let comes = |follower: &mut Self, i: usize| {
            // So far ahead that the divisor changes and is not yet zero.
            let moved = x.iter().zip(&field).map(|(x, f)| (x / f).abs()).fold(longest, f64::min);
            let d = at(follower, 1e-3 * moved)[i];
            let left = 1e-3 * moved * now[i] / (now[i] - d);
            left > 0.0 && left <= longest
        };
        let divisors: Vec<usize> =
            (0..now.len()).filter(|i| compiled.gates[*i] == Gate::Divisor).collect();
        divisors.into_iter().find(|i| comes(self, *i))?;
        let worst = (0..self.n).max_by(|i, j| {
            let share = |i: usize| field[i].abs() / self.size[i].max(f64::MIN_POSITIVE);
            share(*i).total_cmp(&share(*j))
        })?;
        let definition = self.model.definition();
        let (name, mode) =
            (&definition.states()[worst].name, &definition.modes()[self.config.mode]);
        Some(format!(
            "a division by a number that comes to zero, in the equation of {name}, `{}`",
            mode.field[worst]
        ))
    }

    /// Makes the step end where `sought` is zero, near `h`: Newton's method on steps of their own
    /// length.
    pub(super) fn land(&mut self, step: &mut Step, h: f64, longest: f64, sought: Sought) {
        let mut room = std::mem::take(&mut self.room);
        room.resize(self.n, 0.0);
        let delta = 1e-6;
        let (a, b) = ((h / longest - delta).max(0.0), (h / longest + delta).min(1.0));
        step.at(a, &mut room);
        let low = self.value_of(sought, self.t + a * longest, &room);
        step.at(b, &mut room);
        let high = self.value_of(sought, self.t + b * longest, &room);
        self.room = room;
        let mut slope = (high - low) / ((b - a) * longest);
        let mut before = low;
        if !same_sign(low, -high)
            && let Some(place) = self.place_of(sought)
        {
            // Rounding hides a difference over so short a time.
            let (mut x, mut field) = (vec![0.0; self.n], vec![0.0; self.n]);
            step.at(h / longest, &mut x);
            self.rhs(self.t + h, &x, &mut field);
            slope = Self::along(&self.compiled, &self.variables, &field)[place];
            before = -slope;
        }
        let mut length = h;
        for correction in 0.. {
            let follower = &mut *self;
            step.take(length, &mut |t, x, out| follower.rhs(t, x, out));
            if correction == 3 || matches!(sought, Sought::Pole(_)) {
                break;
            }
            let value = self.value_of(sought, self.t + length, &step.y);
            let correction = value / slope;
            if value != 0.0 && self.is_rounding(sought, value) {
                break;
            }
            // If the function only touches zero, or has no value, the first place stays.
            let rounding = 2.0 * f64::EPSILON * (self.t + length).abs();
            let wanted = (length - correction).clamp(0.0, longest);
            if !correction.is_finite()
                || correction.abs() > 1e-3 * longest
                || correction.abs() <= rounding
                || wanted == length
            {
                break;
            }
            length = wanted;
        }
        self.land_before_an_edge(step, length);
        if !matches!(sought, Sought::Pole(_)) {
            self.land_beyond(step, longest, sought, before, slope);
        }
    }

    /// The length of a step to make instead of one that has been made to end where something is
    /// met, if its error is larger than the tolerance allows.
    pub(super) fn landed_too_far(&mut self, step: &Step) -> Option<f64> {
        // Of polynomials and waves shorter steps have smaller errors.
        let is_plain = self.compiled.gates.iter().all(|gate| *gate == Gate::Wave);
        if is_plain || step.series.is_some() || step.multistep.is_some() {
            return None;
        }
        let mut scale = std::mem::take(&mut self.scale);
        scale_now(self, step, &mut scale);
        let error = step.error(&|i| scale[i]);
        self.scale = scale;
        let shorter = 0.5 * step.h;
        (error > 1.0 && error.is_finite() && self.t + shorter > self.t).then_some(shorter)
    }

    /// Stages at the end of a root's domain may be no numbers: a step that is shorter by little
    /// more than the rounding of the time, and goes on by its speed there.
    fn land_before_an_edge(&mut self, step: &mut Step, length: f64) {
        let mut by = 4.0 * f64::EPSILON * (self.t + length).abs();
        let mut tried = 0.0;
        while !step.y.iter().all(|y| y.is_finite()) && tried < length {
            tried = by.min(length);
            step.take(length - tried, &mut |t, x, out| self.rhs(t, x, out));
            let mut field = vec![0.0; self.n];
            self.rhs(step.t + step.h, &step.y.clone(), &mut field);
            if field.iter().all(|f| f.is_finite()) {
                step.y.iter_mut().zip(&field).for_each(|(y, f)| *y += tried * f);
                step.h = length;
            }
            by *= 8.0;
        }
    }

    /// Whether a value of a watched expression that left zero at the step's beginning is as small
    /// as its rounding: it says nothing of the place of a zero.
    fn is_rounding(&self, sought: Sought, value: f64) -> bool {
        self.leaves.is_some_and(|(i, size)| sought == Sought::Watched(i) && value.abs() <= size)
    }

    /// Whether a value is as small as the rounding of its expression's terms.
    fn is_rounding_of(&self, sought: Sought, value: f64) -> bool {
        let e = match sought {
            Sought::Guard { guard, .. } => &self.equation.guards[guard].expression,
            Sought::Watched(i) => &self.equation.watched[i],
            _ => return false,
        };
        value.abs() <= 64.0 * f64::EPSILON * self.magnitude(e)
    }

    /// A bound on the rounding of a watched expression's value: that of its terms, and of the time,
    /// by which they move at these speeds.
    pub(super) fn grain_of(&self, watched: usize, speeds: f64) -> f64 {
        self.grain_of_expression(&self.equation.watched[watched], speeds)
    }

    /// The same of any expression.
    pub(super) fn grain_of_expression(&self, e: &Expression, speeds: f64) -> f64 {
        let terms = self.terms_now(e);
        4.0 * f64::EPSILON * (terms + self.t.abs() * speeds)
    }

    /// A zero of higher order is flat, and Newton's method ends before it: where the function's
    /// slope has gone from what it is nearby, and its value is still on the side of `before`, the
    /// step is made longer until it is not.
    fn land_beyond(
        &mut self,
        step: &mut Step,
        longest: f64,
        sought: Sought,
        before: f64,
        nearby: f64,
    ) {
        const FLAT: f64 = 0.1;
        const MOST_DOUBLINGS: usize = 48;
        let Some(place) = self.place_of(sought) else { return };
        let t = step.t + step.h;
        if !same_sign(self.value_of(sought, t, &step.y), before) {
            return;
        }
        let (n, mut field) = (self.n, std::mem::take(&mut self.room));
        field.resize(n, 0.0);
        self.rhs(t, &step.y, &mut field);
        let slope = self.speed_along(place, &field);
        if slope.abs() > FLAT * nearby.abs() {
            self.room = field;
            return;
        }
        let x = step.y.clone();
        let mut later = f64::EPSILON * t.abs().max(longest);
        for _ in 0..MOST_DOUBLINGS {
            if step.h + later > longest {
                return;
            }
            let there: Vec<f64> = x.iter().zip(&field).map(|(x, f)| x + later * f).collect();
            if !same_sign(self.value_of(sought, t + later, &there), before) {
                let length = step.h + later;
                step.take(length, &mut |t, x, out| self.rhs(t, x, out));
                return;
            }
            later *= 2.0;
        }
    }

    /// Tells zeros of watched expressions at a place of a step from poles, which they change their
    /// sign at, too: towards a pole they grow.
    pub(super) fn tell_poles(&mut self, step: &Step, theta: f64, met: &mut [Sought]) {
        const NEAR: f64 = 1e-9;
        const GROWTH: f64 = 100.0;
        let (t, mut x) = (step.t + theta * step.h, Vec::new());
        for sought in met {
            let Sought::Watched(i) = *sought else { continue };
            // A sum of variables has no poles.
            let plain = self.plain_place(*sought);
            if plain.is_some_and(|place| self.compiled.affine[place].is_some()) {
                continue;
            }
            if x.is_empty() {
                x = vec![0.0; self.n];
                step.at(theta, &mut x);
            }
            let there = self.value_of(*sought, t, &x).abs();
            let e = &self.equation.watched[i];
            // The rounding of a sum that is zero has no size.
            if there < 1e-6 * self.magnitude(e) {
                continue;
            }
            let mut field = vec![0.0; self.n];
            self.rhs(t, &x, &mut field);
            let moves = field.iter().zip(&self.size).filter(|(f, _)| **f != 0.0);
            let away = moves.map(|(f, size)| NEAR * size / f.abs()).fold(NEAR * t.abs(), f64::max);
            let beside = [-away, away].map(|away| {
                let point: Vec<f64> = x.iter().zip(&field).map(|(x, f)| x + away * f).collect();
                self.value_of(*sought, t + away, &point).abs()
            });
            if beside.iter().all(|v| there > GROWTH * v) {
                *sought = Sought::Pole(i);
            }
        }
    }

    /// Hairer, Norsett & Wanner (1993), sec. II.4, with the file's own scales.
    pub(super) fn first_step(&mut self, field: &[f64]) -> f64 {
        let (rtol, atol) = (self.options.rtol, self.options.atol.unwrap_or(0.0));
        let span = self.options.t_end - self.t;
        let sizes: Vec<f64> =
            self.x.iter().zip(&self.lately).map(|(x, s)| x.abs().max(0.01 * s)).collect();
        let least: Vec<f64> = (0..self.n).map(|i| self.least_of(i)).collect();
        let scale = |i: usize, speed: f64| {
            atol + rtol * sizes[i].max(1e-3 * speed * span.min(1.0)) + least[i]
        };
        let norm = |v: &[f64], scale: &[f64]| {
            (v.iter().zip(scale).map(|(v, s)| (v / s) * (v / s)).sum::<f64>() / v.len() as f64)
                .sqrt()
        };
        let now: Vec<f64> = (0..self.n).map(|i| scale(i, field[i].abs())).collect();
        let (d0, d1) = (norm(&self.x, &now), norm(field, &now));
        let h0 = if d0 < 1e-5 || d1 < 1e-5 { 1e-6 * span } else { 0.01 * d0 / d1 }.min(0.01 * span);
        let ahead: Vec<f64> = self.x.iter().zip(field).map(|(x, f)| x + h0 * f).collect();
        let mut there = vec![0.0; self.n];
        let t = self.t + h0;
        self.rhs(t, &ahead, &mut there);
        let difference: Vec<f64> = there.iter().zip(field).map(|(a, b)| a - b).collect();
        // A state at zero without a speed has one there.
        let then: Vec<f64> =
            (0..self.n).map(|i| scale(i, field[i].abs().max(there[i].abs()))).collect();
        let d = d1.max(norm(&difference, &then) / h0);
        let h1 = if d <= 1e-15 { h0 * 1e3 } else { rough_pow(0.01 / d, 0.2) };
        let h = if h1.is_finite() { (100.0 * h0).min(h1) } else { h0 };
        // The time moves.
        h.max(1e3 * f64::EPSILON * self.t.abs()).min(span)
    }

    /// Whether the field has no value where a straight motion is after this time.
    pub(super) fn breaks_ahead(&mut self, ahead: f64) -> bool {
        let (t, x) = (self.t, self.x.clone());
        let (mut field, mut there) = (vec![0.0; self.n], vec![0.0; self.n]);
        self.rhs(t, &x, &mut field);
        let beyond: Vec<f64> = x.iter().zip(&field).map(|(x, f)| x + ahead * f).collect();
        self.rhs(t + ahead, &beyond, &mut there);
        there.iter().any(|f| !f.is_finite())
    }

    /// No step goes across a switch at which an expression's domain ends, as that of |x|^0.5 does
    /// on either side. Very near to it the state is put onto the switch, and what holds there is
    /// decided; false if no switch is so near.
    pub(super) fn land_at_an_edge(&mut self) -> Result<bool, HybridError> {
        /// The sine of the number nearest to pi has the sign that it had before pi.
        const MOST_NUDGES: usize = 8;
        let n = self.n;
        let (t, x) = (self.t, self.x.clone());
        let mut field = vec![0.0; n];
        self.rhs(t, &x, &mut field);
        let Some(Edge { left, place, guard, value }) = self.edge_ahead(&field) else {
            return Ok(false);
        };
        let tangents = self.before(&[Sought::Guard { guard, upper: false }])?;
        let gradient = self.gradient(t, place);
        for i in 0..n {
            self.x[i] += left * field[i];
        }
        self.t += left;
        let off = self.watched_values()[place];
        let size: f64 = gradient.iter().map(|g| g * g).sum();
        if off != 0.0 && size > 0.0 {
            self.x.iter_mut().zip(&gradient).for_each(|(x, g)| *x -= off * g / size);
        }
        self.outcome.switches += 1;
        if size == 0.0 {
            // A function of the time alone is passed whatever the fields are. It is zero between
            // two numbers, of which the later one counts.
            let mut off = off;
            for _ in 0..MOST_NUDGES {
                if off * value < 0.0 {
                    break;
                }
                self.t = self.t.next_up();
                off = self.watched_values()[place];
            }
            if off * value < 0.0 {
                let mut config = self.config.clone();
                config.sides[guard] = off.signum();
                self.ask_new(&mut config);
                self.adopt(config, self.sliding.clone());
                return Ok(true);
            }
        }
        let (before, slid) = (self.config.clone(), self.sliding.clone());
        let mut zero = slid.clone();
        zero.push(guard);
        self.settle(&zero)?;
        self.switch_trains[guard].note(self.t, 0.0);
        self.slides_in_higher_order(guard)?;
        let x = self.x.clone();
        self.rhs(self.t, &x, &mut field);
        if !self.sliding.is_empty() && field.iter().any(|v| !v.is_finite()) {
            // The speeds on both sides of what was slid upon vanish there, too.
            self.decide(&zero, &vec![false; self.slides.len()])?;
        }
        self.after(tangents)?;
        Ok(self.t > t || self.config != before || self.sliding != slid)
    }

    /// Whether motion for which there is no step goes on otherwise: at a switch very near to it, at
    /// rest, or sliding in higher order.
    pub(super) fn goes_on_at_an_edge(&mut self) -> Result<bool, HybridError> {
        if self.land_at_an_edge()? || self.comes_to_rest(self.t, true) {
            return Ok(true);
        }
        let values = self.watched_values();
        let active = self.compiled.active.clone().into_iter().enumerate();
        let zero = |(place, guard): &(usize, usize)| {
            let size = self.magnitude(&self.equation.guards[*guard].expression);
            !self.slides[*guard] && values[*place].abs() <= 1e-12 * size
        };
        for (_, guard) in active.filter(zero).collect::<Vec<_>>() {
            if self.slides_in_higher_order(guard)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The switch that a straight motion comes to next, if that is very soon; `field` is that of
    /// the state.
    fn edge_ahead(&mut self, field: &[f64]) -> Option<Edge> {
        let values = self.watched_values();
        let rates = Self::along(&self.compiled, &self.variables, field);
        /// So many times as late where rounding hides the switch.
        const LESS_SOON: f64 = 16.0;
        let in_time = Self::along(&self.compiled, &self.variables, &vec![0.0; self.n]);
        let soon = 1e-9 * (self.options.t_end - self.options.t_start);
        let mut nearest: Option<Edge> = None;
        for (place, guard) in self.compiled.active.iter().enumerate() {
            let left = -values[place] / rates[place];
            let g = &self.equation.guards[*guard];
            let open = !self.sliding.contains(guard) && !g.whole;
            // Rounding of the state and of the time hides how far it is.
            let hidden = || {
                values[place].abs() <= self.grain_of_expression(&g.expression, in_time[place].abs())
            };
            if open
                && (0.0..=LESS_SOON * soon).contains(&left)
                && (left <= soon || hidden())
                && rates[place] * self.config.sides[*guard] < 0.0
                && nearest.as_ref().is_none_or(|best| left < best.left)
            {
                nearest = Some(Edge { left, place, guard: *guard, value: values[place] });
            }
        }
        nearest
    }

    /// Whether steps end before a switch, at which an expression's domain ends, so near that a
    /// straight motion comes to it with a small part of a step's error.
    pub(super) fn is_just_before_an_edge(&mut self) -> bool {
        /// Part of a step's least error.
        const OF_AN_ERROR: f64 = 0.01;
        let (t, x) = (self.t, self.x.clone());
        let mut field = vec![0.0; self.n];
        self.rhs(t, &x, &mut field);
        let Some(Edge { left, .. }) = self.edge_ahead(&field) else { return false };
        if !self.breaks_ahead(2.0 * left) {
            return false;
        }
        let half: Vec<f64> = x.iter().zip(&field).map(|(x, f)| x + 0.5 * left * f).collect();
        let mut there = vec![0.0; self.n];
        self.rhs(t + 0.5 * left, &half, &mut there);
        (0..self.n).all(|i| {
            let allowed = self.options.atol.unwrap_or(0.01 * self.options.rtol * self.size[i]);
            left * (there[i] - field[i]).abs() <= OF_AN_ERROR * allowed
        })
    }

    /// Mirrors the state at surfaces that it lies before by rounding, although motion goes on
    /// behind them: there alone a root of what has just become positive is a number. False if there
    /// are none.
    pub(super) fn put_beyond(&mut self) -> bool {
        let values = self.watched_values();
        let compiled = self.compiled.clone();
        let mut moved = false;
        for (place, guard) in compiled.active.iter().enumerate() {
            let (value, expression) = (values[place], &self.equation.guards[*guard].expression);
            let before = value * self.config.sides[*guard] < 0.0;
            let near = value.abs() <= 1e-13 * self.magnitude(expression).max(self.widest(place));
            if self.equation.guards[*guard].whole || self.slides[*guard] || !before || !near {
                continue;
            }
            let gradient = self.gradient(self.t, place);
            let size: f64 = gradient.iter().map(|g| g * g).sum();
            if size > 0.0 {
                self.x.iter_mut().zip(&gradient).for_each(|(x, g)| *x -= 2.0 * value * g / size);
                moved = true;
            }
        }
        moved
    }

    /// The size of a function's terms for states of their largest sizes of late.
    fn widest(&mut self, place: usize) -> f64 {
        let gradient = self.gradient(self.t, place);
        gradient.iter().zip(&self.lately).map(|(g, size)| (g * size).abs()).sum()
    }

    /// A motion that comes to where a root's argument is zero in finite time, and makes it stay so
    /// (Torricelli's x' = -sqrt(x)), is put there where it comes to it before `limit` and what that
    /// changes is about a step's error: the watched expressions that are zero there. Steps
    /// would grow short without end.
    pub(super) fn lands_at_a_root(&mut self, limit: f64) -> Option<Vec<Sought>> {
        /// A flow a' = -c a^p comes to a = 0 in the time a/(c a^p (1 - p)) if p < 1.
        const LARGEST_POWER: f64 = 0.9;
        /// So many of a step's least errors count as nothing; steps of series go over the zero at
        /// about ten.
        const ERRORS: f64 = 20.0;
        let compiled = self.compiled.clone();
        if self.tangents.is_some() || !compiled.gates.contains(&Gate::Scale) {
            return None;
        }
        let (n, t, x) = (self.n, self.t, self.x.clone());
        let options = self.options;
        let allowed = |follower: &Self, i: usize| {
            ERRORS * options.atol.unwrap_or(0.01 * options.rtol * follower.size[i])
        };
        // Arguments, and their rates along a direction.
        let arguments = |follower: &Self, t: f64, x: &[f64], along: &[f64], clock: f64| {
            let mut duals: Vec<Dual<f64, 1>> =
                follower.variables.iter().map(|v| Dual::constant(*v)).collect();
            for i in 0..n {
                duals[i] = Dual { value: x[i], partials: [along[i]] };
            }
            duals[n] = Dual { value: t, partials: [clock] };
            let mut out = vec![Dual::constant(0.0); compiled.gates.len()];
            compiled.gate_arguments.evaluate(&duals, &mut out);
            out
        };
        let mut now = vec![0.0; n];
        self.rhs(t, &x, &mut now);
        let here = arguments(self, t, &x, &now, 1.0);
        for gate in 0..here.len() {
            let (a, rate) = (here[gate].value, here[gate].partials[0]);
            if compiled.gates[gate] != Gate::Scale || !(a > 0.0 && rate < 0.0) {
                continue;
            }
            let mut unit = vec![0.0; n];
            let gradient: Vec<f64> = (0..n)
                .map(|i| {
                    unit[i] = 1.0;
                    let slope = arguments(self, t, &x, &unit, 0.0)[gate].partials[0];
                    unit[i] = 0.0;
                    slope
                })
                .collect();
            if !(a <= (0..n).map(|i| gradient[i].abs() * allowed(self, i)).sum::<f64>()) {
                continue;
            }
            let brief = -1e-3 * a / rate;
            let ahead: Vec<f64> = x.iter().zip(&now).map(|(x, f)| x + brief * f).collect();
            let mut then = vec![0.0; n];
            self.rhs(t + brief, &ahead, &mut then);
            let later = arguments(self, t + brief, &ahead, &then, 1.0)[gate].partials[0];
            let power = a * (later - rate) / (brief * rate * rate);
            let left = -a / (rate * (1.0 - power));
            let end = t + left;
            if !(power < LARGEST_POWER && end < limit.min(self.options.t_end)) {
                continue;
            }
            let square: f64 = gradient.iter().map(|g| g * g).sum();
            let (mut there, mut stays) = (x.clone(), now.clone());
            for _ in 0..3 {
                // The mean of a function that falls as a^p.
                for i in 0..n {
                    there[i] = x[i] + left * (stays[i] + (now[i] - stays[i]) * (1.0 - power));
                }
                for _ in 0..3 {
                    let off = arguments(self, end, &there, &unit, 0.0)[gate].value;
                    there.iter_mut().zip(&gradient).for_each(|(x, g)| *x -= off * g / square);
                }
                self.rhs(end, &there, &mut stays);
            }
            let last = &arguments(self, end, &there, &stays, 1.0)[gate];
            let small = |i: usize| (stays[i] - now[i]).abs() * left <= allowed(self, i);
            if last.value != 0.0 || last.partials[0] != 0.0 || !(0..n).all(small) {
                continue;
            }
            self.variables[..n].copy_from_slice(&there);
            self.variables[n] = end;
            let mut values = vec![0.0; compiled.outputs];
            compiled.watched.evaluate(&self.variables, &mut values);
            let (guards, watched) = values.split_at(compiled.active.len());
            // Functions with that argument's zero are come to from their sides.
            let active = || compiled.active.iter().zip(guards);
            let comes_to = |(guard, value): &(&usize, &f64)| {
                let whole = self.equation.guards[**guard].whole;
                **value == 0.0 && !whole && !self.slides[**guard]
            };
            let come_to: Vec<usize> = active().filter(comes_to).map(|(guard, _)| *guard).collect();
            let keeps = |(guard, value): (&usize, &f64)| {
                let side = self.config.sides[*guard];
                let whole = self.equation.guards[*guard].whole;
                if self.slides[*guard] || come_to.contains(guard) {
                    true
                } else if whole {
                    value.floor() == side
                } else {
                    value * side > 0.0 || side == 0.0
                }
            };
            if !active().all(keeps) {
                return None;
            }
            let before = self.watched_values().split_off(guards.len());
            let met = before.iter().zip(watched).zip(&self.watch_side).enumerate();
            let free = |i: &usize| !self.held[*i] && !self.contacts.iter().any(|c| c.watched == *i);
            let mut met: Vec<Sought> = met
                .filter(|(i, _)| free(i))
                .filter(|(_, ((from, to), side))| **from * **side > 0.0 && !(**to * **side > 0.0))
                .map(|(i, _)| Sought::Watched(i))
                .collect();
            let passes = self.changes_nothing(&come_to, end, &there);
            // Of a switch all but series come nearer to the moment.
            if !passes && options.method != Method::Taylor {
                return None;
            }
            (self.t, self.x) = (end, there);
            self.project();
            if arguments(self, end, &self.x, &unit, 0.0)[gate].value != 0.0 {
                (self.t, self.x) = (t, x);
                return None;
            }
            if passes {
                come_to.iter().for_each(|guard| self.fresh_guard[*guard] = true);
            } else {
                met.extend(come_to.iter().map(|g| Sought::Guard { guard: *g, upper: false }));
            }
            let sees_time = self.equation.depends_on_time() || self.equation.events_see_time();
            self.rests = !sees_time && stays.iter().all(|f| *f == 0.0);
            return Some(met);
        }
        None
    }

    /// Whether the fields at a point, on each side of the surfaces slid upon, are the same on both
    /// sides of each of these functions.
    fn changes_nothing(&self, guards: &[usize], t: f64, x: &[f64]) -> bool {
        let field = |other: Option<usize>, high: Option<usize>| {
            let mut config = self.config.clone();
            other.iter().for_each(|guard| config.sides[*guard] = -config.sides[*guard]);
            high.iter().for_each(|guard| config.sides[*guard] = self.high(*guard));
            let mut variables = self.load(&config);
            variables[..self.n].copy_from_slice(x);
            variables[self.n] = t;
            let mut out = vec![0.0; self.n];
            self.equation.compiled(&config).field.evaluate(&variables, &mut out);
            out
        };
        let places = || self.sliding.iter().copied().map(Some).chain([None]);
        let same =
            |guard: &usize| places().all(|high| field(Some(*guard), high) == field(None, high));
        guards.iter().all(same)
    }

    /// The gradient of a watched expression in the states, at those that the variables hold.
    pub(super) fn gradient(&self, t: f64, place: usize) -> Vec<f64> {
        let n = self.n;
        let mut still = self.variables.clone();
        still[n] = t;
        let along = |direction: &[f64]| Self::along(&self.compiled, &still, direction)[place];
        let in_time = along(&vec![0.0; n]);
        let mut unit = vec![0.0; n];
        (0..n)
            .map(|i| {
                unit[i] = 1.0;
                let rate = along(&unit) - in_time;
                unit[i] = 0.0;
                rate
            })
            .collect()
    }

    /// The surface slid upon, if both fields are tangent to it there: a two-fold, where the sliding
    /// motion ends.
    fn two_fold(&mut self, t: f64, x: &[f64]) -> Option<String> {
        let [guard] = self.sliding[..] else { return None };
        let place = self.compiled.place(guard)?;
        let mut negative = vec![0.0; self.n];
        self.compiled.field.evaluate(&self.variables, &mut negative);
        let (below, added) = self.sliding_equations(t, x, &negative);
        let norm = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        let tangent = 1e-9 * norm(&self.gradient(t, place)) * norm(&negative);
        (below[0].abs() <= tangent && (below[0] + added[0]).abs() <= tangent).then(|| {
            format!(
                "the motion slides on {} into a two-fold, where both fields are tangent to the \
                    surface and sliding is not defined: what follows is not unique. End the run \
                    before that time (--t-end), start elsewhere (--start), or smooth the switch",
                self.names(&[guard])
            )
        })
    }

    pub(super) fn left_domain(&mut self, t: f64, x: &[f64]) -> HybridError {
        self.variables[..self.n].copy_from_slice(x);
        self.variables[self.n] = t;
        // Looked for a little ahead, where the field's own numbers are broken.
        let mut what = self.equation.broken(&self.compiled, &self.variables);
        if what.is_none() {
            let mut field = vec![0.0; self.n];
            self.compiled.field.evaluate(&self.variables, &mut field);
            let longest = x
                .iter()
                .zip(&field)
                .map(|(x, f)| x.abs() / f.abs().max(f64::MIN_POSITIVE))
                .fold(1.0, f64::max);
            let mut ahead = 1e-12 * longest;
            while what.is_none() && ahead < 10.0 * longest {
                for i in 0..self.n {
                    self.variables[i] = x[i] + ahead * field[i];
                }
                self.variables[self.n] = t + ahead;
                what = self.equation.broken(&self.compiled, &self.variables);
                // Of a solution that grows without bound everything overflows at last.
                let near = |i: usize| (ahead * field[i]).abs() <= self.size[i].max(x[i].abs());
                what = what.filter(|what| !what.starts_with(OVERFLOW) || (0..self.n).all(near));
                ahead *= 4.0;
            }
        }
        self.variables[..self.n].copy_from_slice(x);
        if what.is_none()
            && let Some(why) = self.two_fold(t, x)
        {
            return HybridError::Stuck { t, x: x.to_vec(), why };
        }
        let what = what.or_else(|| self.division_ahead(t, x));
        let what = what.unwrap_or_else(|| {
            let largest = x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            let tiny = self.options.atol.is_none()
                && x.iter().any(|x| *x != 0.0 && x.abs() < 1e-12 * largest);
            let or = if tiny {
                ", or a state that begins at zero and is measured by its own size (--atol gives \
                    it another)"
            } else {
                ""
            };
            format!(
                "steps become too short to move: a singularity, or a solution that grows without \
                    bound{or}"
            )
        });
        HybridError::Domain { t, x: x.to_vec(), what }
    }

    pub(super) fn is_fresh(&self, sought: Sought) -> bool {
        match sought {
            Sought::Guard { guard, .. } => self.fresh_guard[guard],
            Sought::Watched(i) => self.fresh_watch[i],
            _ => false,
        }
    }

    /// Rounding error allowed in the weight of a field that runs along a surface; 0 for other
    /// fields.
    pub(super) fn rounding_along(&self, place: usize, plus: bool) -> f64 {
        if self.along[self.sliding[place]] == if plus { 1.0 } else { -1.0 } { ALONG } else { 0.0 }
    }

    /// A field that ran along the surface and does so no more is one as others.
    pub(super) fn tell_along(&mut self, list: &[(Sought, f64)], end: &[f64]) {
        for ((sought, _), value) in list.iter().zip(end) {
            let Sought::Leave { place, plus } = *sought else { continue };
            let guard = self.sliding[place];
            if self.along[guard] == if plus { 1.0 } else { -1.0 } && *value > ALONG.sqrt() {
                self.along[guard] = 0.0;
            }
        }
    }

    /// By how much a watched expression may be beyond zero in a step without being met: where a
    /// contact has opened, it leaves zero as a cube does, and what its rounding and the step's
    /// error do there is nothing.
    pub(super) fn allowance(&self, step: &Step, sought: Sought, side: f64) -> f64 {
        /// Errors of a step, in units of the tolerance.
        const MOST: f64 = 10.0;
        let Sought::Watched(i) = sought else { return 0.0 };
        if self.released[i] == 0.0 {
            return 0.0;
        }
        let gradient = self.gradient(step.t, self.compiled.active.len() + i);
        let error = |(j, slope): (usize, &f64)| {
            let speed = step.k.iter().map(|k| k[j].abs()).fold(0.0, f64::max);
            let moved = (step.y[j] - step.x[j]).abs().max(step.h * speed);
            slope.abs() * (self.options.rtol * moved + self.options.atol.unwrap_or(0.0))
        };
        side * (self.released[i] + MOST * gradient.iter().enumerate().map(error).sum::<f64>())
    }

    /// Watches an expression that has left zero after its contact opened as others are watched.
    pub(super) fn clear_released(&mut self) {
        for i in 0..self.released.len() {
            if self.released[i] > 0.0 {
                let (e, side) = (&self.equation.watched[i], self.watch_side[i]);
                if self.equation.value(e, self.t, &self.x) * side > self.released[i] {
                    self.released[i] = 0.0;
                }
            }
        }
    }

    pub(super) fn clear_fresh(&mut self, list: &[(Sought, f64)], end: &[f64], cut: bool) {
        if cut {
            // Time has passed: what left zero at the step's beginning is away from it, but for what
            // is met here, which is marked anew.
            self.fresh_guard.fill(false);
            self.fresh_watch.fill(false);
            return;
        }
        for ((sought, side), value) in list.iter().zip(end) {
            // Nor has what is on its side by no more than rounding left zero yet.
            if (value * side < 0.0 || self.is_rounding_of(*sought, *value))
                && self.is_within_error(*sought, &[*value])
            {
                continue;
            }
            match *sought {
                Sought::Guard { guard, .. } if *value != 0.0 => self.fresh_guard[guard] = false,
                Sought::Watched(i) if *value != 0.0 => self.fresh_watch[i] = false,
                _ => {}
            }
        }
        // A watched expression that stayed at zero may have left it.
        let n = self.compiled.active.len();
        if self.watch_side.contains(&0.0) {
            let mut values = vec![0.0; n + self.equation.watched.len()];
            self.variables[..self.n].copy_from_slice(&self.x);
            self.variables[self.n] = self.t;
            self.compiled.watched.evaluate(&self.variables, &mut values);
            for i in 0..self.watch_side.len() {
                let value = values[n + i];
                if self.watch_side[i] == 0.0
                    && value.abs() > 1e-13 * self.magnitude(&self.equation.watched[i])
                {
                    self.watch_side[i] = value.signum();
                    // Bodies that touch and are pressed into each other strike.
                    if std::mem::take(&mut self.touches[i]) && self.is_beyond(i, value) {
                        self.watch_side[i] = -value.signum();
                    }
                }
            }
        }
    }
}

/// Whether gates do nothing that could be missed between three equidistant places, by their
/// arguments there.
fn are_quiet(gates: &[Gate], first: &[f64], between: &[f64], last: &[f64]) -> bool {
    gates.iter().enumerate().all(|(i, gate)| {
        let (p, q, r) = (first[i], between[i], last[i]);
        // An argument that does not move misses nothing, also at the logarithm of zero.
        if p == q && q == r {
            return true;
        }
        // A parabola's reach beyond its three points.
        let bend = (0.5 * p + 0.5 * r - q).abs() * 0.5;
        gate.is_quiet(p.min(q).min(r) - bend, p.max(q).max(r) + bend)
    })
}

/// The value of a guard among those of a compiled structure.
pub(super) fn active_value(compiled: &Compiled, values: &[f64], guard: usize) -> f64 {
    compiled.place(guard).map_or(f64::NAN, |i| values[i])
}
