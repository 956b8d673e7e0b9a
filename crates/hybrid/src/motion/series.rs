//! Taylor series of the motion between switches (Jorba & Zou 2005): the field that moves the state,
//! sliding and contacts included, as one function on a tape.

use std::collections::HashMap;
use std::rc::Rc;

use twofold_num::elementary::{ln, rough_pow};
use twofold_num::series::{Constants, Solution};
use twofold_num::tape::{Program, Recorded, Replay, Tape};
use twofold_num::{Arithmetic, Elementary};

use super::*;

/// Most equations whose series are kept ready.
const MOST_KNOWN: usize = 256;
/// More tanh in one equation are not told apart by [`Solution`].
const MOST_TANH: usize = 64;
/// Jorba & Zou (2005), sec. 3: the step is shortened by exp(-0.7/(p - 1)) for safety.
const SAFETY_EXPONENT: f64 = -0.7;
/// A step of the motion is searched in parts about as long as a step of order 5 would be at this
/// tolerance, at the least.
const LEAST_SEARCHED: f64 = 1e-8;
const MOST_SEARCHED: f64 = 64.0;
/// By so much of its size a function that is followed beside the states may be off its series.
const LARGEST_MISS: f64 = 1e-6;
/// Shortest step that the functions followed beside the states may ask for, as a share of the
/// states' own; near a pole it would be shorter, which is an error.
const LEAST_FOLLOWED: f64 = 1e-7;

/// Whether the terms of a series end since they grow too large, and not at a root of zero.
fn overflows(terms: &[f64]) -> bool {
    const LARGE: f64 = 1e100;
    let last = terms.iter().take_while(|c| c.is_finite()).last();
    terms[2].is_finite() && last.is_some_and(|last| last.abs() > LARGE)
}

/// Key of the equation that moves the state.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Key {
    compiled: usize,
    /// The answers of signs; whole parts are variables.
    signs: Vec<bool>,
    sliding: Vec<usize>,
    /// Of each contact its watched expression and the bits of the direction that it keeps.
    contacts: Vec<(usize, Vec<u64>)>,
    /// Whether each watched expression is sought.
    sought: Vec<bool>,
    pivots: Vec<usize>,
}

/// A function that a step is searched for and that is no sum of states: its series is made along
/// with those of the states.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Followed {
    /// A guard or watched value, by its place.
    Value(usize),
    /// The weight of a positive side in sliding.
    Weight(usize),
    /// The function that is positive while sliding attracts.
    Attraction,
    /// The force of a contact.
    Push(usize),
}

/// An equation ready for expansion.
#[derive(Debug)]
struct Known {
    /// Kept, so that its address names it.
    _compiled: Rc<Compiled>,
    /// The variable of the system for each variable of this equation; the states come first.
    inputs: Vec<usize>,
    /// Functions followed beside the states, and the program of their values; their variables come
    /// last.
    followed: Vec<Followed>,
    values: Program,
    solution: Solution<f64>,
}

/// The equations whose series were needed.
#[derive(Debug, Default)]
pub(super) struct Expansions {
    known: HashMap<Key, Known>,
    /// The one that the present step is of.
    present: Option<Key>,
}

/// The order at which the work for a unit of time is least (Jorba & Zou 2005, sec. 3).
pub(super) fn order(options: &Options) -> usize {
    let least =
        options.rtol.min(options.atol.unwrap_or(options.rtol)).clamp(f64::EPSILON / 16.0, 1e-2);
    (1.0 - 0.5 * ln(least)).ceil() as usize
}

impl Follower<'_> {
    /// Gives a step the series of the motion from where it begins, or says which state has none
    /// there, as at a root of zero.
    ///
    /// # Errors
    /// If the motion has none there, or is a mixture that is chosen anew at every point.
    pub(super) fn expand(&mut self, step: &mut Step) -> Result<Option<usize>, HybridError> {
        let n = self.n;
        let stuck = |why: String| HybridError::Stuck { t: step.t, x: step.x.clone(), why };
        if !self.corners.is_empty() || self.dependent {
            return Err(stuck(
                "the motion follows a mixture of more fields than their surfaces \
                decide, which is chosen at every point anew and has no Taylor series: follow it by \
                --method dopri5"
                    .into(),
            ));
        }
        let low = {
            self.variables[..n].copy_from_slice(&step.x);
            self.variables[n] = step.t;
            let mut low = vec![0.0; n];
            self.compiled.field.evaluate(&self.variables, &mut low);
            low
        };
        if self.contacts_act_on_sliding(&low) {
            return Err(stuck(
                "the motion slides on a surface whose speed a contact changes, too, and both are \
                solved for together, which is not written as a Taylor series: follow it by \
                --method dopri5 or radau5"
                    .into(),
            ));
        }
        let is_rough = |c: &Contact| {
            self.model.definition().events()[c.event].set.len() > 1
                && self.equation.resets[c.event].is_none()
        };
        if self.contacts.iter().any(is_rough) {
            return Err(stuck(
                "`set` of the event of a contact has switching functions or tables, and its \
                derivative, by which the contact acts on several states, is not written as a \
                Taylor series: follow it by --method dopri5 or radau5"
                    .into(),
            ));
        }
        let mut orders = Vec::new();
        if self.separate.is_none() && !self.sliding.is_empty() {
            let (_, matrix) = self.sliding_equations(step.t, &step.x, &low);
            orders.extend(pivots(matrix, self.sliding.len()));
        }
        if !self.contacts.is_empty() {
            let mut out = low.clone();
            self.rhs(step.t, &step.x, &mut out);
            orders.extend(pivots(self.grips(&out), self.contacts.len()));
        }
        let mut noise = self.noise_of_mixture(step.t, &step.x, &low);
        self.note_noise(step);
        let also = self.noise.iter().map(|also| if also.is_finite() { *also } else { 0.0 });
        noise.iter_mut().zip(also).for_each(|(noise, also)| *noise = noise.max(also));
        let guards = &self.equation.guards;
        let beyond = self.base.iter().map(|(_, variables)| &variables[n + 1..][..guards.len()]);
        let signs = std::iter::once(&self.config.sides[..]).chain(beyond);
        let signs = signs.flat_map(|sides| sides.iter().zip(guards));
        let key = Key {
            compiled: Rc::as_ptr(&self.compiled) as usize,
            signs: signs.map(|(side, guard)| guard.whole || *side > 0.0).collect(),
            sliding: self.sliding.clone(),
            contacts: self.contacts.iter().map(direction_kept).collect(),
            sought: (0..self.watch_side.len()).map(|i| self.is_sought(i)).collect(),
            pivots: orders,
        };
        if !self.expansions.known.contains_key(&key) {
            let known = self.equation_of_motion(&key.pivots).map_err(stuck)?;
            if self.expansions.known.len() >= MOST_KNOWN {
                self.expansions.known.clear();
            }
            self.expansions.known.insert(key.clone(), known);
        }
        self.variables[..n].copy_from_slice(&step.x);
        self.variables[n] = step.t;
        let Some(known) = self.expansions.known.get_mut(&key) else { return Ok(None) };
        let mut start: Vec<f64> = known.inputs.iter().map(|i| self.variables[*i]).collect();
        let mut values = vec![0.0; known.followed.len()];
        known.values.evaluate(&self.variables, &mut values);
        start.extend(values);
        known.solution.expand(&start);
        let series = step.series.get_or_insert_default();
        series.noise = noise;
        let components = (0..n).chain(known.inputs.len()..start.len());
        series.terms.resize(n + known.followed.len(), Vec::new());
        for (terms, i) in series.terms.iter_mut().zip(components) {
            terms.clear();
            terms.extend_from_slice(known.solution.component(i));
        }
        let followed = known.followed.clone();
        self.expansions.present = Some(key);
        series.rounding = followed.into_iter().map(|what| self.rounding_of(what)).collect();
        let broken = |terms: &Vec<f64>| !terms.iter().all(|c| c.is_finite());
        let found = series.terms[..n].iter().position(broken);
        if found.is_some() && self.overflows() {
            return Ok(found);
        }
        let series = step.series.get_or_insert_default();
        match found {
            None => Ok(None),
            // Fast growth of large numbers, far from a pole; of small ones beside a root of zero.
            Some(i)
                if overflows(&series.terms[i])
                    && series.terms[i][0].abs() >= 1.0
                    && (series.terms[i][0] / series.terms[i][1]).abs()
                        > 1e3 * f64::EPSILON * step.t.abs() =>
            {
                let name = &self.model.definition().states[i].name;
                Err(stuck(format!(
                    "the Taylor series of {name} has numbers beyond the range of double \
                        precision: follow it by --method dopri5 or radau5, or measure time in \
                        other units"
                )))
            }
            // Numbers too large, as before a pole.
            Some(i) if overflows(&series.terms[i]) && series.terms[i][0].abs() >= 1.0 => {
                Err(self.left_domain(step.t, &step.x))
            }
            root => Ok(root),
        }
    }

    /// The error for a state that has no series where a step begins.
    pub(super) fn has_no_series(&self, step: &Step, state: usize) -> HybridError {
        let definition = self.model.definition();
        let name = &definition.states[state].name;
        let field = &definition.modes[self.config.mode].field[state];
        let why = format!(
            "the motion has no Taylor series in {name}, `{field}`, as at a root of zero: follow it \
                by --method dopri5 or radau5"
        );
        HybridError::Stuck { t: step.t, x: step.x.clone(), why }
    }

    /// Rounding error of a followed function at zero, where its terms cancel.
    fn rounding_of(&self, what: Followed) -> f64 {
        let active = self.compiled.active.len();
        let size = match what {
            Followed::Value(place) if place < active => {
                self.magnitude(&self.equation.guards[self.compiled.active[place]].expression)
            }
            Followed::Value(place) => self.magnitude(&self.equation.watched[place - active]),
            Followed::Weight(_) => 10.0,
            Followed::Attraction | Followed::Push(_) => 0.0,
        };
        64.0 * f64::EPSILON * size
    }

    /// The longest step from here that the series allows; infinite where they end.
    ///
    /// # Errors
    /// If what is sought has a pole ahead, or no series.
    pub(super) fn step_of_series(&self, step: &Step) -> Result<f64, HybridError> {
        let Some(series) = &step.series else { return Ok(f64::INFINITY) };
        let span = self.options.t_end - self.options.t_start;
        let (mut longest, mut others, mut first) = (f64::INFINITY, f64::INFINITY, 0);
        let rtol = self.options.rtol;
        for (i, c) in series.terms.iter().enumerate() {
            let is_state = i < self.n;
            if !is_state && !c.iter().all(|c| c.is_finite()) {
                return Err(self.not_followed(step, i - self.n));
            }
            let p = c.len() - 1;
            let last = [p - 1, p];
            let before = [p.saturating_sub(3).max(1), p.saturating_sub(2).max(1)];
            let places = if last.iter().any(|k| c[*k] != 0.0) { last } else { before };
            for k in places {
                // Of its first term alone nothing is known: [`Follower::is_followed`] looks.
                if c[k] == 0.0 || !is_state && c[..k].iter().all(|c| *c == 0.0) {
                    continue;
                }
                // States below the least one count for nothing, as in the scale of a step.
                let by = |size: f64, power: usize| {
                    let least = if is_state { self.least_of(i) } else { self.least };
                    rough_pow((size + least) / c[k].abs(), 1.0 / power as f64)
                };
                let mut h = if is_state {
                    let size = c[0].abs().max(0.01 * self.scale_of(i));
                    let size = size.max(1e-6 * span * c[1].abs());
                    by(self.options.atol.unwrap_or(0.0) + rtol * size, k)
                } else {
                    by((rtol * c[0].abs()).max(series.rounding[i - self.n]), k)
                };
                if is_state && k > 1 {
                    h = h.max(by(series.noise[i], k - 1));
                }
                if !is_state || self.options.atol.is_none() {
                    // By what it moves, as in the scale of a step.
                    let most = if is_state { k.min(4) } else { k };
                    for j in 1..most {
                        h = h
                            .max(rough_pow(0.1 * rtol * (c[j] / c[k]).abs(), 1.0 / (k - j) as f64));
                    }
                }
                if is_state {
                    longest = longest.min(h);
                } else if h < others {
                    (others, first) = (h, i - self.n);
                }
            }
        }
        if others < LEAST_FOLLOWED * longest.min(span) {
            return Err(self.not_followed(step, first));
        }
        let longest = longest.min(others);
        Ok(longest
            * twofold_num::elementary::exp(SAFETY_EXPONENT / (order(self.options) - 1) as f64))
    }

    /// The error for a function whose Taylor series does not reach far enough.
    fn not_followed(&self, step: &Step, place: usize) -> HybridError {
        let active = self.compiled.active.len();
        let what = match self.followed().get(place) {
            Some(Followed::Value(place)) if *place < active => {
                format!("`{}`", self.equation.guards[self.compiled.active[*place]].expression)
            }
            Some(Followed::Value(place)) => format!("`{}`", self.equation.watched[place - active]),
            Some(Followed::Push(_)) => "the force of a contact".into(),
            _ => format!("the sliding motion on {}", self.names(&self.sliding)),
        };
        let why = format!(
            "{what} has no Taylor series that reaches far enough, as near a pole or at a root of \
                zero: follow it by --method dopri5 or radau5"
        );
        HybridError::Stuck { t: step.t, x: step.x.clone(), why }
    }

    /// Number of subintervals of a step that are searched separately.
    pub(super) fn searched(&self, step: &Step) -> usize {
        let Some(series) = &step.series else { return 1 };
        let tolerance = self.options.rtol.max(LEAST_SEARCHED);
        let mut most = 1.0_f64;
        for c in series.scaled.iter().filter(|c| c.iter().all(|c| c.is_finite())) {
            let size = c.iter().fold(0.0_f64, |most, c| most.max(c.abs()));
            for k in 6..c.len() {
                // Of k = 6 alone little is seen where it vanishes.
                most = most
                    .max(rough_pow(c[k].abs() / (tolerance * size + self.least), 1.0 / k as f64));
            }
        }
        most.min(MOST_SEARCHED).ceil() as usize
    }

    /// Functions followed beside the states in the present step.
    fn followed(&self) -> &[Followed] {
        let known = self.expansions.present.as_ref().and_then(|key| self.expansions.known.get(key));
        known.map_or(&[], |known| &known.followed)
    }

    /// Whether the series of what is followed beside the states are what it is in the middle of a
    /// step and at its end.
    pub(super) fn is_followed(&mut self, step: &Step) -> bool {
        let Some(series) = &step.series else { return true };
        let known = self.expansions.present.as_ref().and_then(|key| self.expansions.known.get(key));
        let Some(known) = known.filter(|known| !known.followed.is_empty()) else { return true };
        let mut values = vec![0.0; known.followed.len()];
        for theta in [0.5, 1.0] {
            step.at(theta, &mut self.variables[..self.n]);
            self.variables[self.n] = step.t + theta * step.h;
            known.values.evaluate(&self.variables, &mut values);
            for ((value, c), rounding) in
                values.iter().zip(&series.scaled[self.n..]).zip(&series.rounding)
            {
                let size = c.iter().fold(0.0_f64, |most, c| most.max(c.abs()));
                let series = c.iter().rev().fold(0.0, |sum, c| sum * theta + c);
                if (value - series).abs() > LARGEST_MISS * size + rounding {
                    return false;
                }
            }
        }
        true
    }

    /// The coefficients, by powers of the fraction of a step, of what is sought. `followed`: also
    /// if it is no sum of states.
    pub(super) fn series_of(
        &self,
        step: &Step,
        sought: Sought,
        followed: bool,
    ) -> Option<Vec<f64>> {
        let series = step.series.as_ref()?;
        let own = |wanted: Followed| {
            let place = self.followed().iter().position(|f| followed && *f == wanted)?;
            let c = series.scaled[self.n + place].clone();
            c.iter().all(|c| c.is_finite()).then_some(c)
        };
        let (place, boundary, way) = match sought {
            Sought::Guard { guard, upper } => {
                let place = self.compiled.place(guard)?;
                match (self.equation.guards[guard].whole, upper) {
                    (false, _) => (place, 0.0, 1.0),
                    (true, false) => (place, self.config.sides[guard], 1.0),
                    (true, true) => (place, self.config.sides[guard] + 1.0, -1.0),
                }
            }
            Sought::Watched(i) => (self.compiled.active.len() + i, 0.0, 1.0),
            Sought::Leave { place, plus } => {
                let mut c = own(Followed::Weight(place))?;
                if plus {
                    c.iter_mut().for_each(|c| *c = -*c);
                    c[0] += 1.0;
                }
                c[0] += self.rounding_along(place, plus);
                return Some(c);
            }
            Sought::Pole(_) | Sought::Beyond(_) => return None,
            // Whether fields turn away is no function with a series.
            Sought::Repelling if self.may_turn_away() => return None,
            Sought::Repelling => return own(Followed::Attraction),
            // Those of two equations are no function with a series.
            Sought::Release(_) if !self.off.is_empty() => return None,
            Sought::Release(place) => return own(Followed::Push(place)),
        };
        let Some(sum) = self.compiled.affine[place].as_ref() else {
            let mut c = own(Followed::Value(place))?;
            c[0] -= boundary;
            c.iter_mut().for_each(|c| *c *= way);
            return Some(c);
        };
        let mut out = vec![0.0; series.scaled.first().map_or(2, |c| c.len().max(2))];
        out[0] = sum.constant - boundary;
        for (variable, factor) in &sum.factors {
            match *variable {
                i if i < self.n => {
                    out.iter_mut().zip(&series.scaled[i]).for_each(|(out, c)| *out += factor * c)
                }
                i if i == self.n => {
                    out[0] += factor * step.t;
                    out[1] += factor * step.h;
                }
                i => out[0] += factor * self.variables[i],
            }
        }
        out.iter_mut().for_each(|c| *c *= way);
        out.iter().all(|c| c.is_finite()).then_some(out)
    }

    /// The equation that moves the state as the answers are, written for expansion.
    fn equation_of_motion(&self, pivots: &[usize]) -> Result<Known, String> {
        let n = self.n;
        let mut followed = Vec::new();
        let whole = Tape::record(self.equation.variables(), |v| {
            self.written_field(v, pivots, &mut followed)
        });
        if whole.tanh_count() > MOST_TANH {
            return Err(format!(
                "the equations have more than {MOST_TANH} different tanh, which --method taylor \
                    does not follow: use dopri5 or radau5"
            ));
        }
        let depends = crate::equation::dependencies(&whole);
        let asked = |v: &usize| depends.iter().any(|bits| bits[v / 64] & (1 << (v % 64)) != 0);
        let inputs: Vec<usize> = (0..n).chain((n..whole.variables()).filter(asked)).collect();
        let zero = Recorded::zero;
        let others = whole.select(n..n + followed.len());
        let tape = Tape::record(inputs.len() + followed.len(), |u| {
            let mut v = vec![zero(); whole.variables()];
            inputs.iter().zip(u).for_each(|(i, u)| v[*i] = *u);
            let mut replay = Replay::new(&whole, &v);
            let mut out: Vec<Recorded> = (0..n).map(|i| replay.output(i)).collect();
            let mut direction: Vec<Option<Recorded>> = vec![None; whole.variables()];
            direction.iter_mut().zip(&out).for_each(|(d, f)| *d = Some(*f));
            direction[n] = Some(Recorded::one());
            out.extend(inputs[n..].iter().map(|i| if *i == n { Recorded::one() } else { zero() }));
            // A followed function is an extra state, whose derivative is that along the motion.
            let slopes = Replay::new(&others, &v).derivatives(&direction);
            out.extend(slopes.into_iter().map(|slope| slope.unwrap_or(zero())));
            out
        });
        let solution = Solution::new(order(self.options), &tape, Constants::Binary);
        Ok(Known {
            _compiled: self.compiled.clone(),
            inputs,
            followed,
            values: Program::new(&others),
            solution,
        })
    }

    /// The derivatives of the states on the tape that is being recorded, as [`Follower::rhs`], and
    /// behind them what is `followed`.
    fn written_field(
        &self,
        v: &[Recorded],
        pivots: &[usize],
        followed: &mut Vec<Followed>,
    ) -> Vec<Recorded> {
        let n = self.n;
        // Signs are numbers, and a mixture has those of both sides.
        let answers = |high: &[usize]| -> Vec<Recorded> {
            let mut v = v.to_vec();
            for (i, guard) in self.equation.guards.iter().enumerate() {
                let place = n + 1 + i;
                match (guard.whole, high.contains(&i)) {
                    (false, true) => v[place] = Recorded::one(),
                    (false, false) => v[place] = Recorded::from_f64(self.config.sides[i]),
                    (true, true) => v[place] += Recorded::one(),
                    (true, false) => {}
                }
            }
            v
        };
        let field = |compiled: &Compiled, v: &[Recorded]| -> Vec<Recorded> {
            let mut replay = Replay::new(&compiled.tape, v);
            (0..n).map(|i| replay.output(i)).collect()
        };
        let direction = |field: &[Recorded]| -> Vec<Option<Recorded>> {
            let mut direction = vec![None; v.len()];
            direction.iter_mut().zip(field).for_each(|(d, f)| *d = Some(*f));
            direction[n] = Some(Recorded::one());
            direction
        };
        let rate = |compiled: &Compiled,
                    v: &[Recorded],
                    field: &[Recorded],
                    guard: usize|
         -> Recorded {
            let Some(place) = compiled.place(guard) else { return Recorded::from_f64(f64::NAN) };
            let function = compiled.tape.select([n + place]);
            Replay::new(&function, v).derivatives(&direction(field))[0].unwrap_or(Recorded::zero())
        };
        let below = answers(&[]);
        let low = field(&self.compiled, &below);
        let mut out = low.clone();
        let mut others = Vec::new();
        let places = (0..self.compiled.outputs).filter(|place| {
            let slides = self.compiled.active.get(*place).is_some_and(|guard| self.slides[*guard]);
            let watched = place.checked_sub(self.compiled.active.len());
            let sought = watched.is_none_or(|i| self.is_sought(i));
            !slides && sought && self.compiled.affine[*place].is_none()
        });
        for place in places {
            followed.push(Followed::Value(place));
            others.push(Replay::new(&self.compiled.tape, &below).output(n + place));
        }
        if let Some(owners) = &self.separate {
            let above = answers(&self.sliding);
            let high = field(&self.compiled, &above);
            let weight = |guard: &usize| {
                let a = rate(&self.compiled, &below, &low, *guard);
                -a / (rate(&self.compiled, &above, &high, *guard) - a)
            };
            let weights: Vec<Recorded> = self.sliding.iter().map(weight).collect();
            followed.extend((0..weights.len()).map(Followed::Weight));
            others.extend(&weights);
            for (i, owner) in owners.iter().enumerate() {
                if let Some(place) = owner.filter(|_| high[i] != low[i]) {
                    out[i] = low[i] + weights[place] * (high[i] - low[i]);
                }
            }
        } else if !self.sliding.is_empty() {
            let k = self.sliding.len();
            let a: Vec<Recorded> =
                self.sliding.iter().map(|g| rate(&self.compiled, &below, &low, *g)).collect();
            let mut matrix = vec![Recorded::zero(); k * k];
            let mut fields = Vec::new();
            for column in 0..k {
                let compiled = &self.base[column].0;
                // Other functions change with the side that is slid upon.
                let (mut above, there) = (below.clone(), &self.base[column].1);
                for (i, guard) in self.equation.guards.iter().enumerate() {
                    let (place, present) = (n + 1 + i, self.config.sides[i]);
                    if guard.whole && there[place] != present {
                        above[place] += Recorded::from_f64(there[place] - present);
                    } else if !guard.whole {
                        above[place] = Recorded::from_f64(there[place]);
                    }
                }
                let high = field(compiled, &above);
                for row in 0..k {
                    matrix[row * k + column] =
                        rate(compiled, &above, &high, self.sliding[row]) - a[row];
                }
                fields.push(high);
            }
            let (weights, determinant) =
                solved(matrix, a.iter().map(|a| -*a).collect(), &pivots[..k]);
            followed.extend((0..k).map(Followed::Weight));
            others.extend(&weights);
            followed.push(Followed::Attraction);
            others.push(determinant);
            for i in 0..n {
                for (weight, high) in weights.iter().zip(&fields) {
                    if high[i] != low[i] {
                        out[i] += *weight * (high[i] - low[i]);
                    }
                }
            }
        }
        if !self.contacts.is_empty() {
            let forces = self.write_forces(&below, &mut out, &direction, pivots);
            followed.extend((0..forces.len()).map(Followed::Push));
            others.extend(forces);
        }
        out.extend(others);
        out
    }

    /// Adds the contacts' forces, as [`Follower::contact_forces`], and gives what each pushes with.
    fn write_forces(
        &self,
        v: &[Recorded],
        out: &mut [Recorded],
        direction: &dyn Fn(&[Recorded]) -> Vec<Option<Recorded>>,
        pivots: &[usize],
    ) -> Vec<Recorded> {
        let (n, k) = (self.n, self.contacts.len());
        let fields = self.compiled.tape.select(0..n);
        let watched = self.contacts.iter().map(|c| n + self.compiled.active.len() + c.watched);
        let functions = self.compiled.tape.select(watched);
        // Their first derivatives along any field.
        let first = Tape::record(v.len() + n, |all| {
            let (v, field) = all.split_at(v.len());
            let slopes = Replay::new(&functions, v).derivatives(&direction(field));
            slopes.into_iter().map(|s| s.unwrap_or(Recorded::zero())).collect()
        });
        let at: Vec<Recorded> = v.iter().chain(out.iter()).copied().collect();
        let second = |direction: Vec<Option<Recorded>>| -> Vec<Recorded> {
            let slopes = Replay::new(&fields, v).derivatives(&direction);
            let all: Vec<Option<Recorded>> = direction.into_iter().chain(slopes).collect();
            let found = Replay::new(&first, &at).derivatives(&all);
            found.into_iter().map(|s| s.unwrap_or(Recorded::zero())).collect()
        };
        let pulls = second(direction(out)).into_iter().map(|r| -r).collect();
        let (mut grips, mut directions) = (vec![Recorded::zero(); k * k], Vec::new());
        for (column, contact) in self.contacts.iter().enumerate() {
            let mut direction = self.written_direction(contact, v);
            directions.push(direction.clone());
            direction.resize(v.len(), None);
            for (row, grip) in second(direction).into_iter().enumerate() {
                grips[row * k + column] = grip;
            }
        }
        let own: Vec<Recorded> = (0..k).map(|place| grips[place * k + place]).collect();
        let (forces, _) = solved(grips, pulls, &pivots[pivots.len() - k..]);
        for (direction, force) in directions.iter().zip(&forces) {
            let acts = out.iter_mut().zip(direction);
            acts.filter_map(|(out, by)| by.map(|by| (out, by))).for_each(|(out, by)| {
                *out += if by == Recorded::one() { *force } else { by * *force };
            });
        }
        // The grip counts by its sign, and that does not change while there is a contact.
        let push = |((contact, force), own): ((&Contact, Recorded), Recorded)| {
            Recorded::from_f64(contact.above) * (own / (own * own).sqrt()) * force
        };
        self.contacts.iter().zip(forces).zip(own).map(push).collect()
    }

    /// The direction in which a contact acts, as [`Follower::direction_of`].
    fn written_direction(&self, contact: &Contact, v: &[Recorded]) -> Vec<Option<Recorded>> {
        let set = &self.model.definition().events()[contact.event].set;
        let one = |v: &f64| if *v == 1.0 { Recorded::one() } else { Recorded::from_f64(*v) };
        let mut along: Vec<Option<Recorded>> =
            contact.along.iter().map(|v| (*v != 0.0).then(|| one(v))).collect();
        if set.len() == 1 {
            return along;
        }
        let Some(tape) = self.equation.reset_tape(set) else { return along };
        let mut direction = vec![None; self.n];
        along.resize(v.len(), None);
        let slopes = Replay::new(&tape, v).derivatives(&along);
        for ((state, _), slope) in set.iter().zip(slopes) {
            direction[*state] = match (slope, along[*state]) {
                (Some(slope), Some(along)) => Some(slope - along),
                (None, Some(along)) => Some(-along),
                (slope, None) => slope,
            };
        }
        direction
    }
}

/// Of a contact its watched expression and the bits of the direction that it keeps.
fn direction_kept(contact: &Contact) -> (usize, Vec<u64>) {
    (contact.watched, contact.along.iter().map(|v| v.to_bits()).collect())
}

/// The rows that elimination with pivots takes.
fn pivots(mut a: Vec<f64>, k: usize) -> Vec<usize> {
    let mut taken = Vec::with_capacity(k);
    for c in 0..k {
        let size = |i: &usize| a[*i * k + c].abs();
        let pivot = (c..k).max_by(|i, j| size(i).total_cmp(&size(j))).unwrap_or(c);
        (0..k).for_each(|j| a.swap(c * k + j, pivot * k + j));
        for row in c + 1..k {
            let factor = a[row * k + c] / a[c * k + c];
            (c..k).for_each(|j| a[row * k + j] -= factor * a[c * k + j]);
        }
        taken.push(pivot);
    }
    taken
}

/// The solution of a x = b by elimination that takes these rows, and the determinant of -a.
fn solved(
    mut a: Vec<Recorded>,
    mut b: Vec<Recorded>,
    pivots: &[usize],
) -> (Vec<Recorded>, Recorded) {
    let k = b.len();
    let mut determinant = Recorded::one();
    for c in 0..k {
        if pivots[c] != c {
            determinant = -determinant;
        }
        determinant = determinant * -a[pivots[c] * k + c];
        (0..k).for_each(|j| a.swap(c * k + j, pivots[c] * k + j));
        b.swap(c, pivots[c]);
        for row in c + 1..k {
            let factor = a[row * k + c] / a[c * k + c];
            for j in c + 1..k {
                a[row * k + j] = a[row * k + j] - factor * a[c * k + j];
            }
            b[row] = b[row] - factor * b[c];
        }
    }
    for r in (0..k).rev() {
        for j in r + 1..k {
            b[r] = b[r] - a[r * k + j] * b[j];
        }
        b[r] = b[r] / a[r * k + r];
    }
    (b, determinant)
}
