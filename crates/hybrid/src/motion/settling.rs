//! Sides of switching functions, and what is known where these are zero.

use std::collections::HashMap;
use std::rc::Rc;

use twofold_num::random::RandomStream;
use twofold_num::{Arithmetic as _, Elementary as _};
use twofold_system::expression::{Function, General};

use super::locate::TANGENT;
use super::meeting::DRIFT;
use super::*;
use crate::cells;
use crate::equation::{Gate, same_sign};

/// Most surfaces on which a rule chooses a mixture.
pub(super) const MOST_CORNERS: usize = 3;

/// A reason why motion on several surfaces is not decided.
pub(super) const SEVERAL_VELOCITIES: &str =
    "sliding on all of them, where mixtures of the fields have different velocities";

/// The guards that are not asked.
pub(super) fn others(guards: &[usize], asked: &[bool]) -> Vec<usize> {
    guards.iter().zip(asked).filter(|(_, asked)| !**asked).map(|(guard, _)| *guard).collect()
}

impl Follower<'_> {
    /// The size of the terms that an expression is a sum of, with states as large as they have been
    /// in this run: what rounding is measured by.
    pub(super) fn magnitude(&self, e: &Expression) -> f64 {
        self.magnitude_with(e, &mut HashMap::new())
    }

    /// The same, with the sizes of the definitions of \[let\] that are known.
    fn magnitude_with<'a>(&'a self, e: &'a Expression, known: &mut HashMap<&'a str, f64>) -> f64 {
        let mut of = |e: &'a Expression| self.magnitude_with(e, known);
        match e {
            Expression::Add(a, b) | Expression::Sub(a, b) => of(a) + of(b),
            Expression::Neg(a) => of(a),
            Expression::Mul(a, b) => of(a) * of(b),
            Expression::Name(name) => {
                let states = self.model.definition().states();
                if let Some(i) = states.iter().position(|s| s.name == *name) {
                    return self.size[i].max(self.x[i].abs());
                }
                let Some(term) = self.equation.term(name) else {
                    return self.equation.value(e, self.t, &self.x).abs();
                };
                if let Some(size) = known.get(name.as_str()) {
                    return *size;
                }
                let size = self.magnitude_with(term, known);
                known.insert(name, size);
                size
            }
            Expression::Div(a, b) => {
                let by = self.equation.value(b, self.t, &self.x).abs();
                self.magnitude_by(e, of(a) / by)
            }
            Expression::Power(a, n) => {
                let power = self.slope_at(a).power(*n);
                self.magnitude_by(e, power.partials[0].abs() * of(a))
            }
            // One of several numbers, at a place where it may change to another.
            Expression::Call(Function::Abs, a) => of(a),
            Expression::Call(function, a) if !matches!(function, Function::Sqrt) => {
                let slope = function.apply(self.slope_at(a)).partials[0].abs();
                self.magnitude_by(e, slope * of(a))
            }
            // Of the one that is chosen, and of those that rounding does not tell from it.
            Expression::Apply(
                chosen @ (General::Min | General::Max | General::Clip | General::If),
                list,
            ) => {
                let own = self.equation.value(e, self.t, &self.x);
                let first = usize::from(matches!(chosen, General::If));
                let off = |e| (self.equation.value(e, self.t, &self.x) - own).abs();
                let sizes = list[first..].iter().map(|e| (of(e), off(e)));
                sizes.filter(|(size, off)| *off <= 1e-14 * size).map(|s| s.0).fold(0.0, f64::max)
            }
            other => self.equation.value(other, self.t, &self.x).abs(),
        }
    }

    /// The larger one of an expression's size and of what its arguments' rounding is measured by,
    /// if that is a number.
    fn magnitude_by(&self, e: &Expression, arguments: f64) -> f64 {
        let own = self.equation.value(e, self.t, &self.x).abs();
        if arguments.is_finite() { own.max(arguments) } else { own }
    }

    /// An expression's value, as the variable that a function is differentiated by.
    fn slope_at(&self, e: &Expression) -> Dual<f64, 1> {
        Dual { value: self.equation.value(e, self.t, &self.x), partials: [1.0] }
    }

    /// The size of the terms that an expression is a sum of, as they are now.
    pub(super) fn terms_now(&self, e: &Expression) -> f64 {
        self.terms_at(e, self.t, &self.x)
    }

    /// The size of the terms that an expression is a sum of, as they are at a point.
    pub(super) fn terms_at(&self, e: &Expression, t: f64, x: &[f64]) -> f64 {
        self.terms_with(e, (t, x), &mut HashMap::new())
    }

    fn terms_with<'a>(
        &'a self,
        e: &'a Expression,
        at: (f64, &[f64]),
        known: &mut HashMap<&'a str, f64>,
    ) -> f64 {
        let mut of = |e: &'a Expression| self.terms_with(e, at, known);
        match e {
            Expression::Add(a, b) | Expression::Sub(a, b) => of(a) + of(b),
            Expression::Neg(a) => of(a),
            Expression::Mul(a, b) => of(a) * of(b),
            Expression::Name(name) => {
                let Some(term) = self.equation.term(name) else {
                    return self.equation.value(e, at.0, at.1).abs();
                };
                if let Some(size) = known.get(name.as_str()) {
                    return *size;
                }
                let size = self.terms_with(term, at, known);
                known.insert(name, size);
                size
            }
            other => self.equation.value(other, at.0, at.1).abs(),
        }
    }

    /// A guard's value. Its whole parts that are at their jumps are on the sides that they have:
    /// rounding may put the moment before the jump.
    fn value_on_sides(&self, guard: usize) -> f64 {
        let plain = |guard: usize| {
            self.equation.value(&self.equation.guards[guard].expression, self.t, &self.x)
        };
        let jumps = |place: usize, other: usize| {
            let side = self.config.sides[other];
            let near = |value: f64| side == value.round() || side == value.round() - 1.0;
            self.equation.guards[other].whole
                && self.compiled.depends(self.n + place, self.n + 1 + other)
                && self.side_of(other).is_none()
                && near(plain(other))
        };
        let place = self.compiled.place(guard);
        let Some(place) = place.filter(|p| self.compiled.active.iter().any(|o| jumps(*p, *o)))
        else {
            return plain(guard);
        };
        let mut values = vec![0.0; self.compiled.outputs];
        self.compiled.watched.evaluate(&self.load(&self.config), &mut values);
        values[place]
    }

    /// Side that a guard's value is on; none if it is zero to rounding.
    pub(super) fn side_of(&self, guard: usize) -> Option<f64> {
        let g = &self.equation.guards[guard];
        let value = self.value_on_sides(guard);
        if value.is_nan() {
            return Some(if g.whole { 0.0 } else { 1.0 });
        }
        let small = 1e-14 * self.magnitude(&g.expression);
        if g.whole {
            let near = value.round();
            let at_boundary = (value - near).abs() <= small.max(1e-14 * near.abs());
            return if at_boundary { None } else { Some(value.floor()) };
        }
        if value.abs() <= small { None } else { Some(value.signum()) }
    }

    /// Finds all sides anew; those in `zero` are zero.
    pub(super) fn settle_afresh(&mut self, zero: &[usize]) -> Result<(), HybridError> {
        if !self.config.still.is_empty() {
            let mut config = self.config.clone();
            config.still.clear();
            self.adopt(config, self.sliding.clone());
        }
        let mut at_zero = zero.to_vec();
        for guard in 0..self.equation.guards.len() {
            if zero.contains(&guard) {
                continue;
            }
            match self.side_of(guard) {
                None if self.guard_held[guard] => self.config.sides[guard] = 0.0,
                Some(side) => {
                    self.guard_held[guard] = false;
                    self.config.sides[guard] = side;
                    // A reset took it away from zero.
                    self.fresh_guard[guard] = false;
                }
                None => {
                    // A guard at equality counts as not greater.
                    self.config.sides[guard] =
                        self.low(guard) + if self.equation.guards[guard].whole { 1.0 } else { 0.0 };
                    at_zero.push(guard);
                    self.touching[guard] = true;
                }
            }
        }
        self.adopt(self.config.clone(), Vec::new());
        let settled = self.settle(&at_zero);
        self.touching.fill(false);
        settled?;
        let values = self.watched_values();
        let has_none =
            |guard: &usize| self.compiled.place(*guard).is_some_and(|place| values[place].is_nan());
        if self.compiled.deciding.iter().any(has_none) {
            return Err(self.left_domain(self.t, &self.x.clone()));
        }
        Ok(())
    }

    /// Sides of guards that a configuration asks and the present one does not.
    pub(super) fn ask_new(&mut self, config: &mut Configuration) {
        self.ask_but(config, &[]);
    }

    /// The same, but for guards that are known.
    fn ask_but(&mut self, config: &mut Configuration, known: &[usize]) {
        for _ in 0..8 {
            let compiled = self.equation.compiled(config);
            let mut changed = false;
            for guard in &compiled.active {
                if !self.compiled.active.contains(guard)
                    && !known.contains(guard)
                    && let Some(side) = self.side_of(*guard)
                    && config.sides[*guard] != side
                {
                    config.sides[*guard] = side;
                    changed = true;
                }
            }
            if !changed {
                return;
            }
        }
    }

    /// Gives functions that change with the sides of those in `zero`, such as the argument of
    /// abs(sign(x)) on x = 0, the sides of their own values.
    pub(super) fn follow_sides(&mut self, config: &mut Configuration, zero: &[usize]) {
        let n = self.n;
        let mut moved = zero.to_vec();
        for _ in 0..8 {
            let compiled = self.equation.compiled(config);
            let variables = self.load(config);
            let mut values = Vec::new();
            let mut changed = false;
            for (place, guard) in compiled.active.iter().enumerate() {
                let acts = |other: &usize| {
                    self.equation.chooses(*other) || compiled.depends(n + place, n + 1 + *other)
                };
                if zero.contains(guard) || self.slides[*guard] || !moved.iter().any(acts) {
                    continue;
                }
                if values.is_empty() {
                    values = vec![0.0; compiled.outputs];
                    compiled.watched.evaluate(&variables, &mut values);
                }
                let (value, present) = (values[place], config.sides[*guard]);
                let size = self.magnitude(&self.equation.guards[*guard].expression);
                // Where only jumps move it, it has jumped to where it is now.
                let only_jumps = || !(0..=n).any(|variable| compiled.depends(n + place, variable));
                let near = value.round();
                let side = if self.equation.guards[*guard].whole {
                    let at_boundary = (value - near).abs() <= 1e-9 * size.max(near.abs());
                    if at_boundary && only_jumps() {
                        near
                    } else if at_boundary && (present == near || present == near - 1.0) {
                        present
                    } else {
                        value.floor()
                    }
                } else if value.abs() > 1e-9 * size {
                    value.signum()
                } else if value.abs() <= 1e-14 * size && only_jumps() {
                    0.0
                } else {
                    present
                };
                if side != present && side.is_finite() {
                    config.sides[*guard] = side;
                    moved.push(*guard);
                    changed = true;
                }
            }
            if !changed {
                return;
            }
            // Those that were asked here have got the sides of their values.
            self.ask_but(config, &compiled.active);
        }
    }

    pub(super) fn names(&self, guards: &[usize]) -> String {
        let names: Vec<String> = guards
            .iter()
            .map(|g| {
                format!(
                    "{} = {}",
                    self.equation.guards[*g].expression,
                    if self.equation.guards[*g].whole { "a whole number" } else { "0" }
                )
            })
            .collect();
        names.join(" and ")
    }

    pub(super) fn undecided(&self, zero: &[usize], ways: &str) -> HybridError {
        HybridError::Undecided {
            t: self.t,
            x: self.x.clone(),
            surfaces: self.names(zero),
            ways: ways.into(),
        }
    }

    /// Decides where motion goes from a point at which the functions in `zero` are zero. Those that
    /// are slid upon and depend on none that is met anew go on as they did.
    pub(super) fn settle(&mut self, zero: &[usize]) -> Result<(), HybridError> {
        let kept = self.slides.clone();
        self.decide(zero, &kept)
    }

    /// Adds to the functions that are met at zero those that rest there, and those that the
    /// equations ask only beyond one of them and that are zero, too.
    pub(super) fn add_what_is_zero(&mut self, zero: &mut Vec<usize>) {
        if zero.is_empty() {
            return;
        }
        let active = self.compiled.active.iter().copied();
        let rest = active.filter(|g| self.equation.rests(*g, &self.config) && !zero.contains(g));
        let rest: Vec<usize> =
            rest.filter(|g| zero.iter().any(|met| self.may_move(*met, *g))).collect();
        zero.extend(rest);
        let mut known = 0;
        while known < zero.len() {
            let guard = zero[known];
            known += 1;
            if !self.equation.chooses(guard) {
                continue;
            }
            for side in [self.low(guard), self.high(guard)] {
                let mut config = self.config.clone();
                config.sides[guard] = side;
                self.ask_new(&mut config);
                for other in &self.equation.compiled(&config).active {
                    let is_new = self.compiled.place(*other).is_none() && !zero.contains(other);
                    if is_new && self.side_of(*other).is_none() {
                        zero.push(*other);
                    }
                }
            }
        }
    }

    /// Whether a switch of the function `met` may change how `guard` moves.
    fn may_move(&self, met: usize, guard: usize) -> bool {
        let mode = self.config.mode;
        let Some(core) = self.equation.core(&[guard], mode) else { return true };
        let seen = self.equation.states_seen(&self.equation.guards[met].expression);
        seen.iter().zip(&core).any(|(seen, core)| *seen && *core)
    }

    /// Adds the functions that are zero because others are: x - z where x - y and y - z are.
    pub(super) fn add_what_follows(&self, zero: &mut Vec<usize>) {
        if zero.len() < 2 {
            return;
        }
        let new = |g: &usize| !zero.contains(g) && !self.guard_held[*g];
        let at_zero = |g: &usize| self.side_of(*g).is_none();
        let active = self.compiled.active.iter().copied();
        for guard in active.filter(new).filter(at_zero).collect::<Vec<_>>() {
            zero.push(guard);
            if !self.values_around(zero).is_some_and(|values| cells::last_follows(&values)) {
                zero.pop();
            }
        }
    }

    /// The values of functions at points drawn around the present one; none of more than are tried
    /// together, of whole parts, and of functions that bend there.
    fn values_around(&self, guards: &[usize]) -> Option<Vec<Vec<f64>>> {
        /// Distances of the points, relative to the states' sizes, and what a bend makes of them.
        /// Where another switch is near, as the jump of a clock, nearer points do.
        const AROUND: [f64; 2] = [1e-3, 1e-6];
        const BEND: f64 = 0.1;
        let whole = |guard: &usize| self.equation.guards[*guard].whole;
        if !(2..=MOST_TOGETHER).contains(&guards.len()) || guards.iter().any(whole) {
            return None;
        }
        let mut chance = RandomStream::new(0, guards.len() as u64);
        let largest = self.size.iter().fold(0.0_f64, |most, s| most.max(*s));
        let sizes = self.size.iter().map(|size| size.max(1e-3 * largest));
        let mut field = vec![0.0; self.n];
        self.compiled.field.evaluate(&self.variables, &mut field);
        let sizes: Vec<f64> = sizes.chain([self.whole_time(&field)]).collect();
        let change = |off: &[f64], sign: f64| -> Vec<f64> {
            let x: Vec<f64> = self.x.iter().zip(off).map(|(x, off)| x + sign * off).collect();
            let t = self.t + sign * off[self.n];
            let of = |g: &usize| {
                let e = &self.equation.guards[*g].expression;
                self.equation.value(e, t, &x) - self.equation.value(e, self.t, &self.x)
            };
            guards.iter().map(of).collect()
        };
        let is_line = |(a, b): (&f64, &f64)| (a + b).abs() <= BEND * a.abs().max(b.abs());
        let mut at_distance = |around: f64| {
            let mut values = Vec::new();
            for _ in 0..2 * guards.len() {
                let off: Vec<f64> =
                    sizes.iter().map(|s| around * (2.0 * chance.uniform() - 1.0) * s).collect();
                let (ahead, back) = (change(&off, 1.0), change(&off, -1.0));
                if !ahead.iter().zip(&back).all(is_line) {
                    return None;
                }
                values.push(ahead);
            }
            Some(values)
        };
        AROUND.into_iter().find_map(&mut at_distance)
    }

    /// The cells around a meeting of surfaces, where some of these functions follow from others.
    pub(super) fn cells_of(&self, guards: &[usize]) -> Option<Cells> {
        Cells::of(&self.values_around(guards)?)
    }

    /// Whether nothing moves a guard, at this place among the rates: no term, or of one that the
    /// conditions of events alone ask terms that cancel.
    pub(super) fn keeps_still(&self, guard: usize, rates: &Rates, place: usize) -> bool {
        let cancels = || rates.first[place].abs() <= 1e-12 * rates.terms[place];
        rates.stands_still(place) || self.equation.is_of_conditions(guard) && cancels()
    }

    /// Gives the functions in `zero` that are zero all along on the lower sides that they are on,
    /// and that nothing leads or presses there, the side of what rests at zero: max(x, 0) where x
    /// is negative, a counter that nothing counts.
    /// Whether there are any.
    pub(super) fn let_rest(
        &mut self,
        config: &mut Configuration,
        zero: &[usize],
        sliding: &[usize],
    ) -> bool {
        let mut some = false;
        let stays = |follower: &mut Self, config: &Configuration, guard: usize| {
            let (compiled, rates) = follower.rates_with(config, &[guard]);
            compiled.place(guard).is_some_and(|p| {
                follower.keeps_still(guard, &rates, p) && follower.stays_a_little(config, guard)
            })
        };
        // Nothing presses functions that only sides move: all of them at once.
        let mut fixed: Vec<usize> = zero.to_vec();
        fixed.retain(|guard| self.equation.guards[*guard].fixed && !sliding.contains(guard));
        fixed.retain(|guard| config.sides[*guard] == self.low(*guard));
        if fixed.len() > 1 {
            let mut at_zero = config.clone();
            fixed.iter().for_each(|guard| at_zero.sides[*guard] = 0.0);
            self.ask_new(&mut at_zero);
            some = [&*config, &at_zero].iter().all(|c| fixed.iter().all(|g| stays(self, c, *g)));
            if some {
                *config = at_zero;
            }
        }
        for _ in 0..zero.len() {
            let mut changed = false;
            for guard in zero.iter().copied().filter(|g| !sliding.contains(g)) {
                if self.equation.guards[guard].whole
                    || config.sides[guard] != self.low(guard)
                    || !stays(self, config, guard)
                {
                    continue;
                }
                let [mut at_zero, mut beyond] = [config.clone(), config.clone()];
                (at_zero.sides[guard], beyond.sides[guard]) = (0.0, self.high(guard));
                self.ask_new(&mut at_zero);
                self.ask_new(&mut beyond);
                let (compiled, rates) = self.rates_with(&beyond, &[guard]);
                let pressed = compiled.place(guard).is_some_and(|p| rates.direction(p) < 0.0);
                if !pressed && stays(self, &at_zero, guard) {
                    *config = at_zero;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
            some = true;
        }
        some
    }

    /// Whether a function is zero, or of a whole part a whole number, and a short time of motion in
    /// this configuration later still.
    pub(super) fn stays_a_little(&mut self, config: &Configuration, guard: usize) -> bool {
        let zero = if self.equation.guards[guard].whole { self.boundary(guard) } else { 0.0 };
        let size = self.magnitude(&self.equation.guards[guard].expression);
        let small = 1e-14 * size.max(zero.abs());
        self.values_ahead(config, &[], guard, [0.0, 0.01])
            .is_some_and(|values| values.iter().all(|value| (value - zero).abs() <= small))
    }

    /// The side to which a function of third order or more leaves zero in a configuration: it grows
    /// by more than a square. 0 if it stays.
    pub(super) fn side_ahead_in(&self, config: &Configuration, guard: usize) -> f64 {
        match self.values_ahead(config, &[], guard, [0.005, 0.01]) {
            Some([near, far]) if same_sign(near, far) && far.abs() > 5.0 * near.abs() => {
                far.signum()
            }
            _ => 0.0,
        }
    }

    /// The side to which a function of second order or more leaves zero where the motion slides on
    /// others: on the lower sides of those in `config`, on one other side in each of `flips`. 0 if
    /// it stays.
    pub(super) fn side_ahead_sliding(
        &mut self,
        config: &Configuration,
        flips: &[(usize, Configuration)],
        guard: usize,
    ) -> f64 {
        match self.values_ahead(config, flips, guard, [0.005, 0.01]) {
            Some([near, far]) if same_sign(near, far) && far.abs() > 3.0 * near.abs() => {
                far.signum()
            }
            _ => 0.0,
        }
    }

    /// The values of a function after these parts of the time that a state takes to move by its
    /// size in this configuration, sliding on the functions that `flips` have on their other sides.
    pub(super) fn values_ahead(
        &self,
        config: &Configuration,
        flips: &[(usize, Configuration)],
        guard: usize,
        parts: [f64; 2],
    ) -> Option<[f64; 2]> {
        let slid: Vec<usize> = flips.iter().map(|(slid, _)| *slid).collect();
        let asked: Vec<usize> = slid.iter().copied().chain([guard]).collect();
        let compiled = self.equation.compiled_with(config, &asked);
        let place = compiled.place(guard)?;
        let places = slid.iter().map(|g| compiled.place(*g)).collect::<Option<Vec<_>>>()?;
        let mut variables = self.load(config);
        let others: Vec<_> = flips
            .iter()
            .map(|(_, flip)| (self.equation.compiled_with(flip, &asked), self.load(flip)))
            .collect();
        let mut field = |t: f64, x: &[f64]| {
            let n = x.len();
            let at = |compiled: &Compiled, variables: &mut [f64]| {
                variables[..n].copy_from_slice(x);
                variables[n] = t;
                let mut out = vec![0.0; n];
                compiled.field.evaluate(variables, &mut out);
                out
            };
            let low = at(&compiled, &mut variables);
            if others.is_empty() {
                return low;
            }
            let rates = Self::along(&compiled, &variables, &low);
            let (k, mut matrix, mut highs) = (places.len(), Vec::new(), Vec::new());
            for (other, variables) in &others {
                let mut variables = variables.clone();
                let high = at(other, &mut variables);
                let there = Self::along(other, &variables, &high);
                let rate = |g: &usize| other.place(*g).map_or(f64::NAN, |p| there[p]);
                matrix.push(slid.iter().map(rate).collect::<Vec<_>>());
                highs.push(high);
            }
            let b: Vec<f64> = places.iter().map(|p| -rates[*p]).collect();
            let entry = |i: usize| matrix[i % k][i / k] + b[i / k];
            let a: Vec<f64> = (0..k * k).map(entry).collect();
            let weights = solve_any(&a, &b, 0.0).unwrap_or_else(|| vec![f64::NAN; k]);
            let added = |i: usize| {
                weights.iter().zip(&highs).map(|(w, high)| w * (high[i] - low[i])).sum::<f64>()
            };
            (0..n).map(|i| low[i] + added(i)).collect()
        };
        let now = field(self.t, &self.x);
        let whole = self.whole_time(&now);
        let states = parts.map(|part| {
            let brief = part * whole;
            (self.t + brief, a_little_later(&mut field, self.t, &self.x, brief))
        });
        Some(states.map(|(t, x)| {
            variables[..x.len()].copy_from_slice(&x);
            variables[x.len()] = t;
            let mut values = vec![0.0; compiled.outputs];
            compiled.watched.evaluate(&variables, &mut values);
            values[place]
        }))
    }

    /// Whether a function that is zero, or of a whole part a whole number, came there by the step
    /// of a table, and only another step moves it.
    fn rests_by_a_table(&mut self, config: &Configuration, guard: usize) -> bool {
        let (compiled, rates) = self.rates_with(config, &[guard]);
        let tables = self.n + 1 + config.sides.len()..self.equation.variables();
        compiled.place(guard).is_some_and(|place| {
            let reads = |variable: usize| compiled.depends(self.n + place, variable);
            rates.stands_still(place) && tables.clone().any(reads)
        }) && self.stays_a_little(config, guard)
    }

    /// Puts the state, which is on these surfaces to rounding, where the fields of both sides have
    /// values: sqrt(x - 1) has none at x - 1 = -1e-16; and where a root is zero that is of what is
    /// zero there.
    pub(super) fn put_into_domain(&mut self, zero: &[usize]) {
        /// Numbers that are tried on either side.
        const TRIED: usize = 16;
        /// A state is no farther off by rounding, in units of its size.
        const NEAR: f64 = 1e-12;
        /// Fields that differ by this part of themselves between two such numbers have a root.
        const ROUGH: f64 = 1e-11;
        let n = self.n;
        for guard in zero.iter().copied() {
            let Some(place) = self.compiled.place(guard).filter(|_| !self.slides[guard]) else {
                continue;
            };
            let sides = [self.low(guard), self.high(guard)].map(|side| {
                let mut config = self.config.clone();
                config.sides[guard] = side;
                self.ask_new(&mut config);
                (self.equation.compiled(&config), self.load(&config))
            });
            // Both fields, where they have values.
            let fields = |x: &[f64]| -> Option<Vec<f64>> {
                let mut all = Vec::with_capacity(2 * n);
                for (compiled, variables) in &sides {
                    let (mut variables, mut field) = (variables.clone(), vec![0.0; n]);
                    variables[..n].copy_from_slice(x);
                    compiled.field.evaluate(&variables, &mut field);
                    all.extend(field);
                }
                all.iter().all(|f| f.is_finite()).then_some(all)
            };
            let gradient = &self.compiled.gradients(&self.load(&self.config))[place];
            let states = self.compiled.touches[place].iter().copied().zip(gradient);
            let moves =
                states.filter(|(state, slope)| *state < n && **slope != 0.0).max_by(|a, b| {
                    (a.1 * self.size[a.0]).abs().total_cmp(&(b.1 * self.size[b.0]).abs())
                });
            let Some((state, slope)) = moves else { continue };
            let whole = self.equation.guards[guard].whole;
            let value = if whole { 0.0 } else { self.watched_values()[place] };
            let off = value / slope;
            // A function that jumps over zero is not there.
            if off.abs() > NEAR * self.size[state] {
                continue;
            }
            let mut up = self.x.clone();
            up[state] -= off;
            // A root of what is zero to rounding is far from zero.
            let rough = |here: &[f64], there: &[f64]| {
                let size = here.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
                here.iter().zip(there).any(|(a, b)| (a - b).abs() > ROUGH * size)
            };
            // Beside it the root has a slope that says nothing of where motion goes from zero.
            let is_root = |x: &[f64]| {
                sides.iter().any(|(compiled, variables)| {
                    let mut variables = variables.clone();
                    variables[..n].copy_from_slice(x);
                    let mut arguments = vec![0.0; compiled.gates.len()];
                    compiled.gate_arguments.evaluate(&variables, &mut arguments);
                    let mut roots = compiled.gates.iter().zip(&arguments);
                    roots.any(|(gate, argument)| *gate == Gate::Scale && *argument == 0.0)
                })
            };
            let here = fields(&self.x);
            let exact = match (&here, fields(&up)) {
                (Some(here), Some(there)) if !rough(here, &there) && !is_root(&up) => continue,
                (Some(_), None) => continue,
                (here, _) => here.is_some(),
            };
            let mut down = up.clone();
            'tried: for _ in 0..TRIED {
                for x in [&up, &down] {
                    self.variables[..n].copy_from_slice(x);
                    let fits = !exact || self.values_there()[place] == 0.0;
                    if fits && fields(x).is_some() {
                        self.x.clone_from(x);
                        break 'tried;
                    }
                }
                (up[state], down[state]) = (up[state].next_up(), down[state].next_down());
            }
        }
    }

    /// Decides without those kinks among functions that are zero that follow from the others, as
    /// that of abs(x - y) where x and y are zero: as long as these are slid upon it stays at zero,
    /// and the fields of both its sides are one there. False, and nothing is changed, if there are
    /// none or the others do not stay.
    pub(super) fn decide_without_kinks(&mut self, zero: &[usize], kept: &[bool]) -> bool {
        if zero.len() < 3 || !self.left_out.is_empty() {
            return false;
        }
        // One that sees a state that no other sees does not follow from them.
        let touches = |guard: usize| self.compiled.place(guard).map(|p| &self.compiled.touches[p]);
        let mut seen = vec![0; self.n + 1];
        zero.iter().flat_map(|g| touches(*g)).flatten().for_each(|v| seen[*v] += 1);
        let shared = |guard: &usize| {
            !self.equation.guards[*guard].whole
                && !self.slides[*guard]
                && touches(*guard).is_none_or(|touched| touched.iter().all(|v| seen[*v] > 1))
        };
        let mut kinks: Vec<usize> = zero.iter().copied().filter(shared).collect();
        kinks.retain(|guard| self.is_kink(*guard));
        let others: Vec<usize> = zero.iter().copied().filter(|g| !kinks.contains(g)).collect();
        let follows = |follower: &Self, kink: usize, from: &[usize]| {
            let all = [from, &[kink]].concat();
            follower.values_around(&all).is_some_and(|values| cells::last_follows(&values))
        };
        kinks.retain(|kink| others.len() > 1 && follows(self, *kink, &others));
        if kinks.is_empty() {
            return false;
        }
        let rest: Vec<usize> = zero.iter().copied().filter(|g| !kinks.contains(g)).collect();
        let before = (self.config.clone(), self.sliding.clone(), self.x.clone(), self.t);
        let marks = (self.along.clone(), self.fresh_guard.clone(), self.tangent_guard.clone());
        let mut config = self.config.clone();
        kinks.iter().for_each(|kink| config.sides[*kink] = 0.0);
        self.adopt(config, self.sliding.clone());
        self.left_out = kinks.clone();
        let decided = self.decide(&rest, kept);
        self.left_out.clear();
        let stay: Vec<usize> = rest.into_iter().filter(|guard| self.slides[*guard]).collect();
        if decided.is_ok() && stay.len() > 1 && kinks.iter().all(|k| follows(self, *k, &stay)) {
            return true;
        }
        (self.x, self.t) = (before.2, before.3);
        self.adopt(before.0, before.1);
        (self.along, self.fresh_guard, self.tangent_guard) = marks;
        false
    }

    /// Whether more functions are zero here, to the error of the integration, than those from which
    /// no way is known, as a position's speed where turns about it have come to their end, and the
    /// motion goes on from where all of them are.
    pub(super) fn meets_more(&mut self, zero: &[usize]) -> Result<bool, HybridError> {
        let values = self.watched_values();
        let largest = self.size.iter().fold(0.0_f64, |most, s| most.max(*s));
        let error = 10.0 * self.options.rtol * largest;
        let mut near = self.nearly_zero(&values);
        near.retain(|(place, _)| values[*place].abs() <= error);
        let guards: Vec<usize> = near.iter().map(|(_, guard)| *guard).collect();
        let known = zero.len().max(self.meeting);
        if guards.len() <= known || !zero.iter().all(|guard| guards.contains(guard)) {
            return Ok(false);
        }
        let x = self.nearest_meeting(&near, &values);
        if x.iter().zip(&self.x).any(|(a, b)| !((a - b).abs() <= error)) {
            return Ok(false);
        }
        self.x = x;
        let before = std::mem::replace(&mut self.meeting, guards.len());
        let settled = self.settle(&guards);
        self.meeting = before;
        settled.map(|()| true)
    }

    /// The kinks among functions that are zero whose sides change nothing until the run ends: both
    /// have one field here, as those of abs(v) where v has decayed to rounding.
    pub(super) fn idle_kinks(&mut self, zero: &[usize]) -> Vec<usize> {
        /// Of a state's size.
        const NOTHING: f64 = 1e-8;
        let left = self.options.t_end - self.t;
        let largest = self.size.iter().fold(0.0_f64, |most, size| most.max(*size));
        let others = |guard: usize| -> Vec<usize> {
            zero.iter().copied().filter(|other| *other != guard).collect()
        };
        let mut idle = Vec::new();
        for guard in zero.iter().copied() {
            let is_kink = self.equation.guards[guard].kink && !self.equation.guards[guard].whole;
            if !is_kink || self.slides[guard] || zero.len() < 2 {
                continue;
            }
            let mut field = |positive: Option<usize>, side: f64| {
                let mut config = self.config.clone();
                for other in others(guard) {
                    let high = positive == Some(other);
                    config.sides[other] = if high { self.high(other) } else { self.low(other) };
                }
                config.sides[guard] = side;
                self.follow_sides(&mut config, zero);
                let (compiled, mut out) = (self.equation.compiled(&config), vec![0.0; self.n]);
                let mut variables = self.load(&config);
                variables[..self.n].copy_from_slice(&self.x);
                variables[self.n] = self.t;
                compiled.field.evaluate(&variables, &mut out);
                out
            };
            let places = others(guard).into_iter().map(Some).chain([None]);
            let pairs: Vec<[Vec<f64>; 2]> =
                places.map(|positive| [field(positive, -1.0), field(positive, 1.0)]).collect();
            let nothing =
                |i: usize, by: f64| by.abs() * left <= NOTHING * self.size[i].max(1e-3 * largest);
            let same = |[a, b]: &[Vec<f64>; 2]| (0..self.n).all(|i| nothing(i, a[i] - b[i]));
            if pairs.iter().all(same) {
                idle.push(guard);
            }
        }
        idle
    }

    /// Whether the motion slides on several surfaces that may act on each other, and no rule says
    /// that it stays there.
    pub(super) fn may_turn_away(&self) -> bool {
        self.sliding.len() > 1
            && self.separate.is_none()
            && self.options.intersection == Intersection::Undecided
    }

    /// Sliding on several surfaces goes on where the motion is not decided any more.
    pub(super) fn ceases_to_be_the_only_motion(&self) -> HybridError {
        self.undecided(
            &self.sliding,
            "sliding on all of them ceases to be the only motion: it may go on with another \
                velocity, or turn away at any time",
        )
    }

    /// Of the functions in `zero`, those that with these sides of all of them are not zero, and
    /// whether they are above: so is if(x > 0, x, 2) on the lower side of x = 0.
    pub(super) fn jumped(
        &mut self,
        zero: &[usize],
        side: &dyn Fn(usize) -> f64,
    ) -> Vec<Option<bool>> {
        if zero.len() == 1 {
            return vec![None];
        }
        let mut config = self.config.clone();
        zero.iter().enumerate().for_each(|(i, guard)| config.sides[*guard] = side(i));
        self.ask_new(&mut config);
        let compiled = self.equation.compiled(&config);
        let acts = |guard: &usize| {
            compiled.place(*guard).filter(|place| {
                let mut others = zero.iter().filter(|other| *other != guard);
                !self.equation.guards[*guard].whole
                    && others.any(|other| {
                        self.equation.chooses(*other)
                            || compiled.depends(self.n + place, self.n + 1 + other)
                    })
            })
        };
        let places: Vec<Option<usize>> = zero.iter().map(acts).collect();
        if places.iter().all(Option::is_none) {
            return vec![None; zero.len()];
        }
        let mut values = vec![0.0; compiled.outputs];
        compiled.watched.evaluate(&self.load(&config), &mut values);
        let value = |(guard, place): (&usize, &Option<usize>)| {
            let value = values[(*place)?];
            let size = self.magnitude(&self.equation.guards[*guard].expression);
            (value.abs() > 1e-6 * size).then_some(value > 0.0)
        };
        zero.iter().zip(&places).map(value).collect()
    }

    /// The rule that chooses among mixtures. If all have one velocity it does not matter which.
    pub(super) fn rule(&self) -> Intersection {
        match &self.options.intersection {
            Intersection::Undecided => Intersection::HullLeastNorm,
            rule => rule.clone(),
        }
    }

    /// Whether motion may turn away from a point where two functions are zero: fields turn around
    /// it, to first order or as a position and its speed do, and each turn is longer than the one
    /// before.
    pub(super) fn turns_away(&mut self, x: &[f64], guards: [usize; 2]) -> bool {
        let base = self.config.clone();
        let [first, second] = self.rates_around(&base, (self.t, x), guards);
        let turn_at = |i: usize| {
            let still = first.iter().all(|rates| rates[i] == 0.0);
            still
                .then(|| position_first(i, &first, &second))
                .and_then(|(a, b)| turn_of_position(&a, &b))
        };
        let growth = turn(&first).or_else(|| turn_at(0)).or_else(|| turn_at(1));
        growth.is_some_and(leads_away)
    }

    /// Positive where motion stays at a point where two functions are zero of which the one at
    /// `position` is known to have no speed there.
    pub(super) fn position_hold(
        &mut self,
        base: &Configuration,
        at: (f64, &[f64]),
        guards: [usize; 2],
        position: usize,
    ) -> f64 {
        let [first, second] = self.rates_around(base, at, guards);
        let (accelerations, rates) = position_first(position, &first, &second);
        position_hold(&accelerations, &rates)
    }

    /// First and second derivatives of two functions along the four fields around a point.
    fn rates_around(
        &mut self,
        base: &Configuration,
        (t, x): (f64, &[f64]),
        guards: [usize; 2],
    ) -> [[[f64; 2]; 4]; 2] {
        let before =
            (std::mem::replace(&mut self.x, x.to_vec()), std::mem::replace(&mut self.t, t));
        let (mut first, mut second) = ([[f64::NAN; 2]; 4], [[f64::NAN; 2]; 4]);
        for field in 0..4 {
            let mut config = base.clone();
            for (i, guard) in guards.iter().enumerate() {
                config.sides[*guard] =
                    if field >> i & 1 == 1 { self.high(*guard) } else { self.low(*guard) };
            }
            let (compiled, rates) = self.rates_of_second_order(&config);
            for (i, guard) in guards.iter().enumerate() {
                if let Some(place) = compiled.place(*guard) {
                    first[field][i] = rates.first_or_zero(place);
                    second[field][i] = rates.second[place];
                }
            }
        }
        (self.x, self.t) = before;
        [first, second]
    }

    /// A function that stays zero while the motion slides on another's zero has no side that the
    /// equations decide: so has x*z on x = 0. What its side changes nothing of may stay open.
    pub(super) fn no_side_is_left_open(&mut self, zero: &[usize]) -> Result<(), HybridError> {
        if self.sliding.is_empty() {
            return Ok(());
        }
        // A function that rests at zero is equal there.
        let open = |g: &usize| !self.sliding.contains(g) && !self.equation.rests(*g, &self.config);
        let open: Vec<usize> = zero.iter().copied().filter(open).collect();
        let field = self.velocity();
        let (t, x) = (self.t, self.x.clone());
        for guard in open {
            // On a kink both sides have one field, whatever rounding makes of it.
            if self.equation.guards[guard].kink {
                continue;
            }
            let Some(place) = self.compiled.place(guard) else { continue };
            self.variables[..self.n].copy_from_slice(&x);
            self.variables[self.n] = t;
            let side = self.config.sides[guard];
            let mut other = self.config.clone();
            other.sides[guard] = if side == 0.0 { 1.0 } else { -side };
            self.ask_new(&mut other);
            let (here, there) =
                (self.rates(&self.config.clone()).1.field, self.rates(&other).1.field);
            let gradient = self.gradient(t, place);
            let rate = Self::along(&self.compiled, &self.variables, &field)[place];
            let terms: f64 = gradient.iter().zip(&here).map(|(g, f)| (g * f).abs()).sum();
            // Away from zero on its side, or moved by the time alone.
            if self.equation.guards[guard].whole
                || rate * side > 1e-11 * terms
                || terms == 0.0 && rate != 0.0
            {
                continue;
            }
            if same(&here, &there) {
                continue;
            }
            let why = format!(
                "{} stays zero there while the motion slides on {}: write both switches by one \
                    function",
                self.equation.guards[guard].expression,
                self.names(&self.sliding)
            );
            return Err(self.undecided(&[guard], &why));
        }
        Ok(())
    }

    /// Puts speeds of the functions in `zero` that are only rounding to zero: the state and the
    /// time are known to rounding alone. Whether there are any.
    pub(super) fn drop_noise(
        &self,
        config: &Configuration,
        compiled: &Compiled,
        zero: &[usize],
        rates: &mut Rates,
    ) -> bool {
        let mut some = false;
        let variables = self.load(config);
        let rounding = |i: usize| self.lately.get(i).map_or(0.0, |size| 16.0 * f64::EPSILON * size);
        let near = variables.iter().enumerate().map(|(i, v)| Range::new(*v, rounding(i)));
        let near: Vec<Range> = near.collect();
        let mut field = vec![Range::default(); self.n];
        compiled.field.evaluate(&near, &mut field);
        let gradients = compiled.gradients(&variables);
        let mut bends = None;
        for guard in zero {
            let Some(place) = compiled.place(*guard) else { continue };
            let along = compiled.touches[place].iter().zip(&gradients[place]);
            let of_field: f64 = along
                .filter(|(variable, slope)| **variable < self.n && **slope != 0.0)
                .map(|(variable, slope)| slope.abs() * field[*variable].radius())
                .sum();
            let of_time = if self.touching[*guard] {
                let e = &self.equation.guards[*guard].expression;
                self.rounding_of_slope(e, rates.second[place])
            } else {
                0.0
            };
            let noise = if of_field.is_finite() { of_field.max(of_time) } else { of_time };
            if rates.first[place] != 0.0 && rates.first[place].abs() <= noise {
                rates.first[place] = 0.0;
                some = true;
                // So may be its change, as of a product whose factors are both zero. (A brief step
                // says nothing beside a root of zero.)
                if self.equation.has_domain_ends {
                    continue;
                }
                let bend = bends.get_or_insert_with(|| {
                    Self::second_along_in(compiled, &near, &field, By::Field)
                })[place];
                if rates.second[place].abs() <= bend.radius() {
                    let ahead = self.side_ahead_in(config, *guard);
                    if ahead != 0.0 {
                        rates.second[place] = ahead * rates.second[place].abs();
                    }
                }
            }
        }
        some
    }

    /// Surfaces by their places among `guards` in the order of the rule; those that it does not
    /// name are missing.
    pub(super) fn order_of(&self, guards: &[usize]) -> Vec<usize> {
        self.order.iter().filter_map(|named| guards.iter().position(|g| g == named)).collect()
    }

    /// The rule has no mixture on these surfaces.
    pub(super) fn no_mixture(&self, guards: &[usize]) -> HybridError {
        let unnamed: Vec<usize> =
            guards.iter().copied().filter(|g| !self.order.contains(g)).collect();
        let why = match self.options.intersection {
            Intersection::Order(_) if !unnamed.is_empty() => {
                format!("--intersection order does not name {}", self.names(&unnamed))
            }
            Intersection::Order(_) => {
                "in the order of --intersection a surface does not attract for each side of the \
                    slower ones"
                    .into()
            }
            _ => "the rule of --intersection has no mixture there".into(),
        };
        self.undecided(guards, &why)
    }

    /// The error of surfaces slid upon whose fields are no sums of what each side adds, as of
    /// max(sign(x), sign(y)).
    pub(super) fn no_sum(&self) -> HybridError {
        let why = match self.options.intersection {
            Intersection::Undecided => SEVERAL_VELOCITIES,
            _ => "functions of several signs, which no rule of --intersection mixes",
        };
        self.undecided(&self.sliding, why)
    }

    /// Functions that were zero with these values, and that a switch or a table has made jump away
    /// from it, are on the side where they arrive, and nothing slides on them any more: which they
    /// are.
    pub(super) fn leave_by_jump(&mut self, zero: &[usize], before: &[f64]) -> Vec<usize> {
        /// Smaller jumps, relative to a function's size, are drift.
        const DRIFT: f64 = 1e-9;
        let values = self.watched_values();
        let mut config = self.config.clone();
        let mut left = Vec::new();
        for (guard, before) in zero.iter().zip(before) {
            let Some(place) = self.compiled.place(*guard) else { continue };
            let (g, value) = (&self.equation.guards[*guard], values[place]);
            if value == *before || !value.is_finite() {
                continue;
            }
            // By how much the function changes where states change by their sizes.
            let gradient = self.gradient(self.t, place);
            let reach: f64 =
                gradient.iter().zip(&self.size).map(|(g, size)| (g * size).abs()).sum();
            let small = DRIFT * self.magnitude(&g.expression).max(reach);
            let off = if g.whole { value - value.round() } else { value };
            if (value - before).abs() > small && off.abs() > small {
                config.sides[*guard] = if g.whole { value.floor() } else { value.signum() };
                self.fresh_guard[*guard] = false;
                left.push(*guard);
            }
        }
        if !left.is_empty() {
            self.ask_new(&mut config);
            let rest = self.sliding.iter().copied().filter(|g| !left.contains(g)).collect();
            self.adopt(config, rest);
        }
        left
    }

    /// A switch may make other switching functions jump: they are on the side where they arrive.
    pub(super) fn follow_jumps(&mut self, zero: &[usize]) -> Result<(), HybridError> {
        for _ in 0..MOST_JUMPS {
            let mut config = self.config.clone();
            let mut values = vec![0.0; self.compiled.outputs];
            self.compiled.watched.evaluate(&self.variables, &mut values);
            let mut jumped = false;
            for (i, guard) in self.compiled.active.clone().into_iter().enumerate() {
                let rests = self.equation.rests(guard, &config);
                if zero.contains(&guard) || self.fresh_guard[guard] && !rests {
                    continue;
                }
                let g = &self.equation.guards[guard];
                let side = if g.whole { values[i].floor() } else { values[i].signum() };
                let small = 1e-12 * self.magnitude(&g.expression);
                let off =
                    if g.whole { (values[i] - values[i].round()).abs() } else { values[i].abs() };
                let side = if off > small {
                    side
                } else if self.rests_by_a_table(&config, guard) {
                    if self.equation.guards[guard].whole { values[i].round() } else { 0.0 }
                } else {
                    continue;
                };
                if side != config.sides[guard] && side.is_finite() {
                    config.sides[guard] = side;
                    jumped = true;
                }
            }
            if !jumped {
                return Ok(());
            }
            self.ask_new(&mut config);
            let sliding = self.sliding.clone();
            self.adopt(config, sliding);
        }
        let why =
            "switches make each other jump without end: no side of theirs is consistent".into();
        Err(HybridError::Stuck { t: self.t, x: self.x.clone(), why })
    }

    /// Finds the watched expressions that stay at zero: their gradients are sums of those of the
    /// surfaces slid upon, of contacts and of these' speeds, or they depend on the sides of
    /// switches alone. Contacts' own are not among them.
    pub(super) fn hold_watched(&mut self) {
        self.held.fill(false);
        if self.held.is_empty() {
            return;
        }
        let active = self.compiled.active.len();
        let moves_freely = self.sliding.is_empty() && self.contacts.is_empty();
        if moves_freely && self.compiled.touches[active..].iter().all(|list| !list.is_empty()) {
            return;
        }
        let values = self.watched_values();
        let is_zero = |i: &usize| {
            values[active + i].abs() <= 1e-12 * self.magnitude(&self.equation.watched[*i])
                && !self.contacts.iter().any(|contact| contact.watched == *i)
        };
        let zero: Vec<usize> = (0..self.held.len()).filter(is_zero).collect();
        if moves_freely {
            zero.iter().for_each(|i| self.held[*i] = self.compiled.touches[active + i].is_empty());
            return;
        }
        let gradients = self.compiled.gradients(&self.variables);
        let row = |place: usize| self.scaled(self.dense(place, &gradients));
        let surfaces = self.sliding.iter().filter_map(|g| self.compiled.place(*g)).map(row);
        let mut surfaces: Vec<Vec<f64>> = surfaces.collect();
        let rows: Vec<(usize, Vec<f64>)> = zero.into_iter().map(|i| (i, row(active + i))).collect();
        surfaces.extend(self.contact_rows(&gradients));
        for (i, row) in rows {
            self.held[i] = self.compiled.touches[active + i].is_empty()
                || !surfaces.is_empty() && is_sum_of(&surfaces, row);
        }
    }

    /// A gradient by the states and the time, from those by what a value depends on.
    fn dense(&self, place: usize, gradients: &[Vec<f64>]) -> Vec<f64> {
        let mut row = vec![0.0; self.n + 1];
        let along = self.compiled.touches[place].iter().zip(&gradients[place]);
        along.for_each(|(variable, slope)| row[*variable] = *slope);
        row
    }

    /// The same in units of the states' sizes and of the run.
    fn scaled(&self, mut row: Vec<f64>) -> Vec<f64> {
        let span = self.options.t_end - self.options.t_start;
        for (slope, size) in row.iter_mut().zip(self.size.iter().chain([&span])) {
            *slope *= if *size > 0.0 { *size } else { 1.0 };
        }
        row
    }

    /// The gradients of contacts' expressions and of these' speeds.
    fn contact_rows(&mut self, gradients: &[Vec<f64>]) -> Vec<Vec<f64>> {
        if self.contacts.is_empty() {
            return Vec::new();
        }
        let field = self.velocity();
        self.watched_values();
        let by: Vec<Vec<f64>> = (0..=self.n).map(|i| self.second_along(&field, Some(i))).collect();
        let rows = |contact: &Contact| {
            let place = self.compiled.active.len() + contact.watched;
            let speed = by.iter().map(|by| by[place]).collect();
            [self.scaled(self.dense(place, gradients)), self.scaled(speed)]
        };
        self.contacts.iter().flat_map(rows).collect()
    }

    /// Finds the switching functions that contacts hold at zero: their gradients are sums of those
    /// of the contacts' expressions and of these' speeds. They rest there, neither above nor below,
    /// until the contact opens.
    pub(super) fn hold_guards(&mut self) -> Result<(), HybridError> {
        self.hold_guards_but(&[])
    }

    /// The same; those that nothing holds any more and whose sides are known get these.
    pub(super) fn hold_guards_but(&mut self, known: &[(usize, f64)]) -> Result<(), HybridError> {
        let before = self.guard_held.clone();
        self.guard_held.fill(false);
        self.hold_watched();
        if !self.contacts.is_empty() {
            let (t, x) = (self.t, self.x.clone());
            self.watched_values();
            let gradients = self.compiled.gradients(&self.variables);
            let surfaces = self.contact_rows(&gradients);
            for (place, guard) in self.compiled.active.iter().enumerate() {
                let g = &self.equation.guards[*guard];
                let small = 1e-12 * self.magnitude(&g.expression);
                let value = self.equation.value(&g.expression, t, &x);
                self.guard_held[*guard] = !g.whole
                    && !self.slides[*guard]
                    && value.abs() <= small
                    && is_sum_of(&surfaces, self.scaled(self.dense(place, &gradients)));
            }
        }
        if self.guard_held == before {
            self.find_off();
            return Ok(());
        }
        let mut config = self.config.clone();
        let held = (0..before.len()).filter(|guard| self.guard_held[*guard]);
        held.for_each(|guard| config.sides[guard] = 0.0);
        let mut free: Vec<usize> =
            (0..before.len()).filter(|g| before[*g] && !self.guard_held[*g]).collect();
        for (guard, side) in known.iter().filter(|(_, side)| *side != 0.0) {
            if let Some(place) = free.iter().position(|free| free == guard) {
                free.swap_remove(place);
                config.sides[*guard] = *side;
                (self.fresh_guard[*guard], self.tangent_guard[*guard]) = (true, true);
            }
        }
        free.sort_unstable();
        self.ask_new(&mut config);
        self.adopt(config, self.sliding.clone());
        if free.is_empty() { Ok(()) } else { self.settle(&[&self.sliding[..], &free].concat()) }
    }

    /// A watched expression passes zero, or comes to it and stays: a row of the section, or an
    /// event of this direction. Says whether more is wanted.
    pub(super) fn pass(
        &self,
        i: usize,
        definition: &crate::Definition,
        fired: &mut Vec<usize>,
        observe: &mut dyn FnMut(&Point) -> bool,
    ) -> bool {
        let side = self.watch_side[i];
        let Some(event) = self.event_of[i] else {
            let (mode, signs, direction) = (self.config.mode, &self.signs, Some(-side));
            return observe(&Point { t: self.t, x: &self.x, mode, signs, event: None, direction });
        };
        if let When::Zero(_, direction) = definition.events()[event].when
            && (direction == Direction::Both || (direction == Direction::Up) == (side < 0.0))
        {
            fired.push(event);
        }
        true
    }

    /// The watched expressions that a switch made jump over zero or onto it, and those held at zero
    /// until now that leave it to the side that they came from. Until then they had the values
    /// `before`.
    pub(super) fn watch_jumps(
        &mut self,
        held: &[bool],
        before: &[f64],
        passed: &[usize],
    ) -> Vec<(usize, Jump)> {
        let mut values = vec![0.0; self.compiled.outputs];
        self.compiled.watched.evaluate(&self.variables, &mut values);
        let active = self.compiled.active.len();
        let mut found = Vec::new();
        for i in 0..self.watch_side.len() {
            let (value, side) = (values[active + i], self.watch_side[i]);
            let rests = self.contacts.iter().any(|c| c.watched == i) || passed.contains(&i);
            if rests || held[i] && self.held[i] {
                continue;
            }
            // A jump is as exact as the value before it.
            let size = self.magnitude(&self.equation.watched[i]).max(before[i].abs());
            let small = 1e-12 * size;
            let away = value.abs() > small;
            if side == 0.0 {
                // An expression that rested at zero is on the side where it arrives.
                if away && before[i].abs() <= small {
                    (self.watch_side[i], self.fresh_watch[i]) = (value.signum(), false);
                }
                continue;
            }
            let leaves = held[i] && !away && {
                self.begin_watching(i, true, false);
                let ahead = std::mem::replace(&mut self.watch_side[i], side);
                let left = self.left_watch[i];
                if left != 0.0 { left * side < 0.0 } else { ahead == -side }
            };
            let stays = self.held[i] && self.compiled.touches[active + i].is_empty();
            if away && value * side < 0.0 {
                found.push((i, Jump::Over));
            } else if leaves || stays {
                found.push((i, Jump::Leaves));
            } else if !away && before[i] * side > small {
                found.push((i, Jump::Onto));
            }
        }
        found
    }

    /// Finds the side of a watched expression; `zero`: it is zero here, whatever rounding says;
    /// `met`: its own event has just acted, so that its speed is that event's, however small.
    pub(super) fn begin_watching(&mut self, i: usize, zero: bool, met: bool) {
        let place = self.compiled.active.len() + i;
        (self.released[i], self.tangent[i]) = (0.0, false);
        if !zero {
            let value = self.watched_values()[place];
            if value.abs() > 1e-14 * self.magnitude(&self.equation.watched[i]) {
                self.watch_side[i] = value.signum();
                self.fresh_watch[i] = false;
                return;
            }
        }
        self.fresh_watch[i] = true;
        self.touches[i] = self.touches_on(i);
        if self.touches[i] {
            self.watch_side[i] = 0.0;
            return;
        }
        // Where the motion slides or rests its speed is not that of one field.
        if !self.sliding.is_empty() || !self.contacts.is_empty() {
            let field = self.velocity();
            let (t, x) = (self.t, self.x.clone());
            self.variables[..self.n].copy_from_slice(&x);
            self.variables[self.n] = t;
            let slope = Self::along(&self.compiled, &self.variables, &field)[place];
            if slope.abs() > 1e-11 * self.speeds(&field, place) {
                self.watch_side[i] = slope.signum();
                return;
            }
        }
        // A sum of states has a known slope.
        if let Some(sum) = &self.compiled.affine[place] {
            let n = self.n;
            self.variables[..n].copy_from_slice(&self.x);
            self.variables[n] = self.t;
            self.scratch.resize(n, 0.0);
            self.compiled.field.evaluate(&self.variables, &mut self.scratch);
            let (slope, terms) = sum.speed(&self.scratch);
            // Sliding is left without a speed, and to the side that it is left to.
            let left = self.left_watch[i];
            if met && left != 0.0 && slope.abs() <= TANGENT * left.abs() {
                self.watch_side[i] = left.signum();
                return;
            }
            if met && slope.abs() > 1e-11 * terms {
                self.watch_side[i] = slope.signum();
                return;
            }
        }
        let (_, mut rates) = self.rates_of_second_order(&self.config.clone());
        let (slope, bend) = (rates.first_or_zero(place), rates.second[place]);
        if !met && slope.abs() <= self.rounding_of_slope(&self.equation.watched[i], bend) {
            rates.first[place] = 0.0;
        }
        self.tangent[i] = !met && rates.first_or_zero(place) == 0.0;
        self.watch_side[i] = if rates.first_or_zero(place) == 0.0 {
            let field = self.velocity();
            side_of(bend, 2.0 * self.brief(&field), self.watched_ahead(place))
        } else {
            rates.direction(place)
        };
    }

    /// The speed of a watched value along a field, at the state that the variables hold.
    pub(super) fn speed_along(&self, place: usize, field: &[f64]) -> f64 {
        match &self.compiled.affine[place] {
            Some(sum) => sum.speed(field).0,
            None => Self::along(&self.compiled, &self.variables, field)[place],
        }
    }

    /// By how much the speed of an expression that bends so may be off where its time is: as much
    /// as it changes in some roundings of the time, and in those of the time in which the
    /// expression would move by its size.
    pub(super) fn rounding_of_slope(&self, e: &Expression, bend: f64) -> f64 {
        if !bend.is_finite() {
            return 0.0;
        }
        let size = self.magnitude(e);
        64.0 * f64::EPSILON * self.t.abs() * bend.abs() + 1e-13 * (2.0 * size * bend.abs()).sqrt()
    }

    /// The side to which a watched value of third order or more leaves zero: it grows by more than
    /// a square. 0 if it stays.
    pub(super) fn side_ahead(&mut self, place: usize) -> f64 {
        side_of(0.0, 0.0, self.watched_ahead(place))
    }

    /// Whether a watched expression that is zero and whose event changes its speed stays there, as
    /// this and its change a brief time ahead are rounding: bodies that touch move on together.
    pub(super) fn touches_on(&mut self, i: usize) -> bool {
        if self.event_of[i].is_none() || self.held[i] {
            return false;
        }
        let place = self.compiled.active.len() + i;
        let field = self.velocity();
        let speed = self.speed_along(place, &field);
        let small = 1e-13 * self.magnitude(&self.equation.watched[i]);
        if (speed * self.brief(&field)).abs() > small {
            return false;
        }
        let value = self.watched_values()[place];
        speed.abs() <= SMALLEST_SLOPE * self.speeds(&field, place)
            && self.turns(i)
            && self.watched_ahead(place).iter().all(|ahead| (ahead - value).abs() <= small)
    }

    /// Whether the event of a watched expression changes its speed.
    pub(super) fn turns(&mut self, i: usize) -> bool {
        let Some(event) = self.event_of[i] else { return false };
        let place = self.compiled.active.len() + i;
        let field = self.velocity();
        self.watched_values();
        let changes_speed = |(state, _): &(usize, Expression)| {
            self.second_along(&field, Some(*state))[place] != 0.0
        };
        self.model.definition().events()[event].set.iter().any(changes_speed)
    }

    /// A time in which states that move so do not change by a hundredth of their sizes.
    pub(super) fn brief(&self, field: &[f64]) -> f64 {
        const BRIEF: f64 = 0.005;
        BRIEF * self.whole_time(field)
    }

    /// A time in which states that move so change by their sizes; the time left, if less.
    pub(super) fn whole_time(&self, field: &[f64]) -> f64 {
        let moves = field.iter().zip(&self.size).filter(|(f, size)| **f != 0.0 && **size != 0.0);
        let left = self.options.t_end - self.t;
        moves.map(|(f, size)| size / f.abs()).fold(left, f64::min)
    }

    /// A watched value a brief time ahead, and twice that time.
    fn watched_ahead(&mut self, place: usize) -> [f64; 2] {
        let field = self.velocity();
        let (t, x) = (self.t, self.x.clone());
        let brief = self.brief(&field);
        [brief, 2.0 * brief].map(|h| {
            let mut rhs = |t: f64, x: &[f64]| {
                let mut out = vec![0.0; x.len()];
                self.rhs(t, x, &mut out);
                out
            };
            let there = a_little_later(&mut rhs, t, &x, h);
            self.variables[..self.n].copy_from_slice(&there);
            self.variables[self.n] = t + h;
            let mut values = vec![0.0; self.compiled.outputs];
            self.compiled.watched.evaluate(&self.variables, &mut values);
            values[place]
        })
    }

    /// Whether the event of a watched expression can fire in the present mode. A section's rows
    /// are of all modes.
    pub(super) fn is_asked(&self, i: usize) -> bool {
        let events = self.model.definition().events();
        let from = self.event_of[i].and_then(|event| events[event].from);
        from.is_none_or(|mode| mode == self.config.mode)
    }

    /// The watched expressions that are not asked in the present mode, and that it keeps at zero.
    pub(super) fn kept_at_zero(&mut self) -> Vec<bool> {
        if (0..self.watch_side.len()).all(|i| self.is_asked(i)) {
            return vec![false; self.watch_side.len()];
        }
        let (t, x, mut field) = (self.t, self.x.clone(), vec![0.0; self.n]);
        let (compiled, rates) = self.rates(&self.config.clone());
        self.rhs(t, &x, &mut field);
        let values = self.watched_values();
        let speeds = Self::along(&self.compiled, &self.variables, &field);
        let active = self.compiled.active.len();
        let kept = |i: usize| {
            let (place, e) = (active + i, &self.equation.watched[i]);
            let terms = rates.terms[compiled.active.len() + i];
            !self.is_asked(i)
                && values[place].abs() <= DRIFT * self.magnitude(e)
                && speeds[place].abs() <= DRIFT * terms.max(self.speeds(&field, place))
        };
        let mut all: Vec<bool> = (0..self.watch_side.len()).map(kept).collect();
        // An expression at zero without a speed, as near an accumulation, need not stay there.
        for i in 0..all.len() {
            let small = DRIFT * self.magnitude(&self.equation.watched[i]);
            all[i] &= self.watched_ahead(active + i).iter().all(|ahead| ahead.abs() <= small);
        }
        all
    }

    /// The event of bodies that touch and are pressed into each other, which no rest holds apart:
    /// infinitely many in no time. With a bound on the time in which they begin.
    pub(super) fn pressed_without_rest(&mut self) -> Option<(usize, f64)> {
        /// Of the accelerations, what is none; of the time in which a state changes, what is short.
        const SMALL: f64 = 1e-6;
        const SHORT: f64 = 1e-3;
        for i in (0..self.touches.len()).filter(|i| self.touches[*i]).collect::<Vec<_>>() {
            let Some(event) = self.event_of[i] else { continue };
            let event_now = &self.model.definition().events()[event];
            let moved: Vec<usize> = event_now.set.iter().map(|(state, _)| *state).collect();
            if event_now.sticks || !self.is_asked(i) {
                continue;
            }
            let field = self.velocity();
            let place = self.compiled.active.len() + i;
            self.watched_values();
            let bend = self.second_along(&field, None)[place];
            let largest = moved.iter().fold(0.0_f64, |most, state| most.max(field[*state].abs()));
            let small = 1e-13 * self.magnitude(&self.equation.watched[i]);
            let time = (8.0 * small / bend.abs()).sqrt();
            let times = field.iter().zip(&self.size).map(|(f, size)| size / f.abs());
            let soon = time <= SHORT * times.fold(f64::INFINITY, f64::min);
            if self.is_beyond(i, bend) && bend.abs() > SMALL * largest && soon {
                return Some((event, time));
            }
        }
        None
    }

    /// Finds the side of a watched expression that a mode which has ended kept at zero: its value,
    /// and a small speed, are drift.
    pub(super) fn begin_watching_kept(&mut self, i: usize) {
        self.begin_watching(i, true, false);
        let place = self.compiled.active.len() + i;
        let (compiled, rates) = self.rates(&self.config.clone());
        let own = compiled.active.len() + i;
        let speeds = rates.terms[own].max(self.speeds(&rates.field, place));
        if rates.first[own].abs() > DRIFT * speeds {
            return;
        }
        let value = self.watched_values()[place];
        let [near, far] = self.watched_ahead(place).map(|ahead| ahead - value);
        if same_sign(near, far) && far.abs() > near.abs() {
            self.watch_side[i] = far.signum();
        }
        self.tangent[i] = false;
        self.release(i, rates.terms[own]);
    }

    /// Lets a watched expression that leaves zero be beyond it by what it is now, and by rounding.
    pub(super) fn release(&mut self, i: usize, speeds: f64) {
        /// In units of the tolerance, the error of the multistep method's first steps, which are of
        /// first order, and of the implicit one's polynomial within a step.
        const ERRORS: f64 = 10.0;
        let dip = self.dip_of_rounding(i);
        let e = &self.equation.watched[i];
        let beyond = -self.equation.value(e, self.t, &self.x) * self.watch_side[i];
        let error = match self.options.method {
            Method::Lsoda | Method::Radau5 => ERRORS * self.options.rtol,
            _ => 64.0 * f64::EPSILON,
        };
        self.released[i] =
            beyond.max(0.0) + 4.0 * self.grain_of(i, speeds) + error * self.magnitude(e) + dip;
    }

    /// The distance to which a watched expression that leaves zero as a cube may go beyond it,
    /// where rounding of the time and of forces makes its acceleration begin on the other side.
    /// What has never moved has no size that says it.
    fn dip_of_rounding(&mut self, i: usize) -> f64 {
        /// Roundings that may come together.
        const ROUNDINGS: f64 = 64.0;
        let n = self.n;
        let field = self.velocity();
        let (t, x) = (self.t, self.x.clone());
        let place = self.compiled.active.len() + i;
        let time = Range::new(t, f64::EPSILON * t.abs());
        let rest = self.variables[n + 1..].iter().map(|v| Range::from_f64(*v));
        let states = x.iter().map(|x| Range::from_f64(*x));
        let given: Vec<Range> = states.chain([time]).chain(rest).collect();
        let mut forces = vec![Range::default(); n];
        self.compiled.field.evaluate(&given, &mut forces);
        let mut error = 0.0;
        for (j, force) in forces.iter().enumerate() {
            let mut unit = vec![0.0; n];
            unit[j] = 1.0;
            error += (self.second_in(&field, &unit)[place] * force.radius()).abs();
        }
        let (value, brief) = (self.watched_values()[place], self.brief(&field));
        let jerk = 6.0 * (self.watched_ahead(place)[0] - value).abs() / (brief * brief * brief);
        let error = ROUNDINGS * error;
        let dip = error * error * error / (jerk * jerk);
        if dip.is_finite() { dip } else { 0.0 }
    }

    /// Whether a watched expression has no speed at the present point.
    pub(super) fn rests_on_watched(&mut self, i: usize) -> bool {
        let config = self.config.clone();
        let (compiled, rates) = self.rates(&config);
        let place = compiled.active.len() + i;
        rates.first[place].abs() <= 1e-11 * rates.terms[place]
    }

    /// The values of guards and watched expressions at the present point.
    pub(super) fn watched_values(&mut self) -> Vec<f64> {
        self.variables[..self.n].copy_from_slice(&self.x);
        self.variables[self.n] = self.t;
        self.values_there()
    }

    /// The same at the state that the variables hold.
    fn values_there(&self) -> Vec<f64> {
        let mut values = vec![0.0; self.compiled.outputs];
        self.compiled.watched.evaluate(&self.variables, &mut values);
        values
    }

    /// The events whose conditions hold on the sides to which the motion goes and not where it is:
    /// x < 0 from x = 0 downwards.
    pub(super) fn true_right_after(&self) -> Vec<usize> {
        let mut here = self.config.clone();
        for (guard, side) in here.sides.iter_mut().enumerate() {
            if !self.equation.guards[guard].whole {
                *side = self.side_of(guard).unwrap_or(0.0);
            }
        }
        let becomes = |(i, condition): (usize, &Option<Rc<Expression>>)| {
            let e = condition.as_ref()?;
            (self.holds[i] && !self.equation.holds(e, &here)).then_some(i)
        };
        self.equation.conditions.iter().enumerate().filter_map(becomes).collect()
    }

    /// The events whose conditions hold now and did not before.
    pub(super) fn new_conditions(&mut self) -> Vec<usize> {
        let mut new = Vec::new();
        let mut at = self.config.clone();
        // Functions slid upon are equal to zero.
        for guard in self.sliding.iter().filter(|guard| !self.equation.guards[**guard].whole) {
            at.sides[*guard] = 0.0;
        }
        for (i, condition) in self.equation.conditions.iter().enumerate() {
            if let Some(e) = condition {
                let now = self.equation.holds(e, &at);
                if now && !self.holds[i] {
                    new.push(i);
                }
                self.holds[i] = now;
            }
        }
        new
    }
}

/// Accelerations of function `i` of two and rates of the other one in the four fields, numbered by
/// the side of function `i` first.
fn position_first(i: usize, first: &[[f64; 2]; 4], second: &[[f64; 2]; 4]) -> ([f64; 4], [f64; 4]) {
    let order = if i == 0 { [0, 1, 2, 3] } else { [0, 2, 1, 3] };
    (order.map(|f| second[f][i]), order.map(|f| first[f][1 - i]))
}

/// Whether none of these vectors is a sum of multiples of those before.
pub(super) fn independent(rows: &[Vec<f64>]) -> bool {
    (1..rows.len()).all(|i| !is_sum_of(&rows[..i], rows[i].clone()))
}

/// Whether a vector that is not zero is a sum of multiples of others, to rounding.
fn is_sum_of(others: &[Vec<f64>], mut row: Vec<f64>) -> bool {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let rest = |basis: &[Vec<f64>], row: &mut Vec<f64>| {
        for b in basis.iter().chain(basis) {
            let share = dot(row, b);
            row.iter_mut().zip(b).for_each(|(v, b)| *v -= share * b);
        }
    };
    for other in others {
        let (size, mut new) = (dot(other, other).sqrt(), other.clone());
        rest(&basis, &mut new);
        let length = dot(&new, &new).sqrt();
        if length > 1e-12 * size {
            basis.push(new.iter().map(|v| v / length).collect());
        }
    }
    let size = dot(&row, &row).sqrt();
    rest(&basis, &mut row);
    size > 0.0 && dot(&row, &row).sqrt() <= 1e-9 * size
}

/// The side to which a function without a speed leaves zero: that of its second derivative, or, if
/// this is zero or no more than an error beside the values after a time and half of it, the one to
/// which it grows by more than a square; 0 if it stays.
pub(super) fn side_of(bend: f64, time: f64, [half, whole]: [f64; 2]) -> f64 {
    /// Of the larger value.
    const ERROR: f64 = 1e-6;
    let bend = if bend.is_finite() { bend } else { 0.0 };
    let grows = same_sign(half, whole) && whole.abs() > 5.0 * half.abs();
    let square = 0.5 * bend.abs() * time * time;
    if grows && square <= ERROR * whole.abs() {
        whole.signum()
    } else if bend != 0.0 {
        bend.signum()
    } else {
        0.0
    }
}
