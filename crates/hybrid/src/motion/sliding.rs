//! The field that moves a state: one side's, a mixture on surfaces that are slid upon, or that of a
//! contact; and its derivatives.

use std::borrow::Cow;
use std::rc::Rc;

use super::settling::MOST_CORNERS;
use super::*;
use crate::cells;
use crate::range::Range;
use crate::selection::shortest;
use crate::step::SETTLED;
use twofold_num::{Arithmetic, Elementary};

/// A state this much smaller than it was has digits that rounding may take.
const SMALL: f64 = 1e-3;
/// Rounding may be what keeps steps below this part of the run so short.
const TINY_STEP: f64 = 1e-9;
/// Rounding errors reach a speed through so many other states in a step, as in a chain of
/// integrators.
const PASSES: usize = 3;
/// Motion leaves surfaces that depend on each other so little later than it could stay: then it is
/// no rounding which field leads away, and the state changes by the square of it.
pub(super) const LITTLE: f64 = 1e-9;

/// So far back in a step that speeds which vanish at its end are no rounding, and two places give
/// the limit of weights by a line.
const BACK: f64 = 1e-5;

impl Follower<'_> {
    pub(super) fn load(&self, config: &Configuration) -> Vec<f64> {
        let n = self.n;
        let mut v = vec![0.0; self.equation.variables()];
        v[..n].copy_from_slice(&self.x);
        v[n] = self.t;
        v[n + 1..n + 1 + config.sides.len()].copy_from_slice(&config.sides);
        for (i, (table, piece)) in self.equation.tables.iter().zip(&config.pieces).enumerate() {
            let first = n + 1 + config.sides.len() + 5 * i;
            v[first] = table.origin(*piece);
            v[first + 1..first + 5].copy_from_slice(&table.pieces[*piece]);
        }
        v
    }

    /// Takes over the configuration: programs, variables, and what sliding needs.
    pub(super) fn adopt(&mut self, config: Configuration, sliding: Vec<usize>) {
        let mut config = config;
        for guard in &sliding {
            config.sides[*guard] = self.low(*guard);
        }
        config.slid = if self.equation.has_domain_ends { sliding.clone() } else { Vec::new() };
        config.higher.retain(|guard| sliding.contains(guard));
        self.follow_sides(&mut config, &sliding);
        let also = self.asked_beyond(&mut config, &sliding);
        self.slides.fill(false);
        sliding.iter().for_each(|guard| self.slides[*guard] = true);
        self.sliding = sliding;
        self.compiled = self.equation.compiled_with(&config, &also);
        self.variables = self.load(&config);
        self.config = config;
        self.separate = self.separate();
        (self.dependent, self.is_no_sum) = (false, false);
        self.base = Vec::new();
        self.beyond.clear();
        // Surfaces that are left leave the others with the mixture of their corners.
        let mixed = !self.corners.is_empty() && self.separate.is_none() && self.sliding.len() > 1;
        self.corners = Vec::new();
        self.cells = self.separate.is_none().then(|| self.cells_of(&self.sliding)).flatten();
        if mixed || self.cells.is_some() {
            self.take_corners();
        }
        if self.cells.is_some() {
            self.dependent = true;
        } else if self.separate.is_none() {
            for guard in self.sliding.clone() {
                let mut flipped = self.config.clone();
                flipped.sides[guard] = self.high(guard);
                let sliding = self.sliding.clone();
                self.follow_sides(&mut flipped, &sliding);
                let variables = self.load(&flipped);
                self.base.push((self.equation.compiled(&flipped), variables));
            }
            if self.sliding.len() > 1 {
                let (t, x, mut low) = (self.t, self.x.clone(), vec![0.0; self.n]);
                self.compiled.field.evaluate(&self.variables, &mut low);
                self.is_no_sum = self.has_functions_of_sides() && !self.is_sum_of_sides(&low);
                let (a, matrix) = self.sliding_equations(t, &x, &low);
                let b: Vec<f64> = a.iter().map(|v| -v).collect();
                self.dependent =
                    near_solution(&matrix, &b, 0.5).is_some_and(|(_, rank)| rank < b.len());
            }
        }
        self.find_beyond();
        self.find_off();
        self.hold_watched();
        self.signs = self
            .equation
            .guards
            .iter()
            .enumerate()
            .map(|(i, guard)| match () {
                () if self.compiled.place(i).is_none() => '.',
                () if self.slides[i] || self.equation.rests(i, &self.config) => '0',
                () if guard.whole => '#',
                () if self.config.sides[i] > 0.0 => '+',
                () => '-',
            })
            .collect();
    }

    /// Collects the kinks on the other sides of surfaces slid upon that are elsewhere there.
    fn find_beyond(&mut self) {
        for (place, (compiled, variables)) in self.base.iter().enumerate() {
            let slid = self.sliding[place];
            for (at, guard) in compiled.active.iter().enumerate() {
                let is_kink = self.equation.guards[*guard].kink && !self.slides[*guard];
                let jumps =
                    self.equation.chooses(slid) || compiled.depends(self.n + at, self.n + 1 + slid);
                let side = variables[self.n + 1 + guard];
                if is_kink && jumps && side != 0.0 {
                    self.beyond.push(Beyond { place, guard: *guard, side, fresh: false });
                }
            }
        }
    }

    /// The value of a function on the other side of a surface slid upon.
    pub(super) fn value_beyond(&mut self, beyond: Beyond, t: f64, x: &[f64]) -> f64 {
        let (compiled, variables) = &mut self.base[beyond.place];
        variables[..self.n].copy_from_slice(x);
        variables[self.n] = t;
        let mut values = vec![0.0; compiled.outputs];
        compiled.watched.evaluate(variables, &mut values);
        active_value(compiled, &values, beyond.guard)
    }

    /// Passes a kink on the other side of a surface slid upon.
    pub(super) fn pass_beyond(&mut self, at: usize) {
        let Beyond { place, guard, side, .. } = self.beyond[at];
        let mut config = self.config.clone();
        config.sides[self.sliding[place]] = self.high(self.sliding[place]);
        let sliding = self.sliding.clone();
        self.follow_sides(&mut config, &sliding);
        config.sides[guard] = -side;
        self.base[place] = (self.equation.compiled(&config), self.load(&config));
        (self.beyond[at].side, self.beyond[at].fresh) = (-side, true);
    }

    /// Whether a kink of the field on the lower sides of what is slid upon is elsewhere on the
    /// others: only this field changes there.
    pub(super) fn is_kink_of_one_side(&mut self, guard: usize) -> bool {
        let (t, x) = (self.t, self.x.clone());
        let small = 1e-6 * self.magnitude(&self.equation.guards[guard].expression);
        self.equation.guards[guard].kink
            && !self.base.is_empty()
            && (0..self.base.len()).all(|place| {
                let other = Beyond { place, guard, side: 0.0, fresh: false };
                let asked = self.base[place].0.place(guard).is_some();
                asked && self.value_beyond(other, t, &x).abs() > small
            })
    }

    /// The guards that the equations ask on other sides of what is slid upon, where `config` is the
    /// lower one, and not there: the field on those sides is a part of the motion, too. Those that
    /// were not asked before get the sides that they are on.
    fn asked_beyond(&mut self, config: &mut Configuration, sliding: &[usize]) -> Vec<usize> {
        let chooses: Vec<usize> =
            sliding.iter().copied().filter(|g| self.equation.chooses(*g)).collect();
        if chooses.is_empty() {
            return Vec::new();
        }
        let here = self.equation.compiled(config);
        let mut also = Vec::new();
        // All corners of a few surfaces; of many each by itself.
        let k = chooses.len();
        let corners: Vec<usize> =
            if k <= MOST_TOGETHER { (1..1 << k).collect() } else { Vec::new() };
        let flips = corners
            .into_iter()
            .map(|corner| (0..k).filter(|i| corner >> i & 1 == 1).collect::<Vec<_>>())
            .chain((0..if k > MOST_TOGETHER { k } else { 0 }).map(|i| vec![i]));
        for flip in flips {
            let mut flipped = config.clone();
            flip.iter().for_each(|i| flipped.sides[chooses[*i]] = self.high(chooses[*i]));
            self.ask_new(&mut flipped);
            for guard in &self.equation.compiled(&flipped).active {
                if !here.active.contains(guard) && !also.contains(guard) {
                    config.sides[*guard] = flipped.sides[*guard];
                    also.push(*guard);
                }
            }
        }
        also.sort_unstable();
        also
    }

    /// Whether functions of the sides of what is slid upon, as abs(sign(x)), decide anything: they
    /// have sides of their own on each.
    fn has_functions_of_sides(&self) -> bool {
        let n = self.n;
        let of_sides = |(place, guard): (usize, &usize)| {
            let slid = |slid: &usize| self.compiled.depends(n + place, n + 1 + slid);
            !self.slides[*guard] && self.sliding.iter().any(slid)
        };
        self.compiled.active.iter().enumerate().any(of_sides)
    }

    /// Whether the field on two positive sides is the sum of what each adds to that on none, for
    /// each two of the surfaces slid upon.
    fn is_sum_of_sides(&mut self, low: &[f64]) -> bool {
        const SAME: f64 = 1e-9;
        let (n, sliding) = (self.n, self.sliding.clone());
        let mut field = |positive: &[usize]| {
            let mut config = self.config.clone();
            for guard in positive {
                config.sides[*guard] = self.high(*guard);
            }
            self.follow_sides(&mut config, &sliding);
            let (compiled, mut out) = (self.equation.compiled(&config), vec![0.0; n]);
            compiled.field.evaluate(&self.load(&config), &mut out);
            out
        };
        let alone: Vec<Vec<f64>> = sliding.iter().map(|guard| field(&[*guard])).collect();
        (0..sliding.len()).all(|b| {
            (0..b).all(|a| {
                let both = field(&[sliding[a], sliding[b]]);
                (0..n).all(|i| {
                    let [a, b, both, none] = [alone[a][i], alone[b][i], both[i], low[i]];
                    let size = a.abs() + b.abs() + both.abs() + none.abs();
                    (both + none - a - b).abs() <= SAME * size
                })
            })
        })
    }

    /// For several surfaces slid upon of which none changes another's speed: which of them each
    /// derivative depends on.
    pub(super) fn separate(&self) -> Option<Vec<Option<usize>>> {
        let k = self.sliding.len();
        if k < 2 || self.sliding.iter().any(|g| self.equation.chooses(*g)) {
            return None;
        }
        let n = self.n;
        let variable = |place: usize| n + 1 + self.sliding[place];
        if self.has_functions_of_sides() {
            return None;
        }
        let mut owner = vec![None; n];
        for (i, owner) in owner.iter_mut().enumerate() {
            let mut owners = (0..k).filter(|place| self.compiled.depends(i, variable(*place)));
            *owner = owners.next();
            if owners.next().is_some() {
                return None;
            }
        }
        for place in 0..k {
            let active = self.compiled.place(self.sliding[place])?;
            let strange = (0..n).any(|i| {
                self.compiled.depends(n + active, i) && owner[i].is_some_and(|o| o != place)
            });
            let asks = (0..k).any(|other| self.compiled.depends(n + active, variable(other)));
            if strange || asks {
                return None;
            }
        }
        Some(owner)
    }

    /// Weights of surfaces that know nothing of each other, what each adds to its own speed, and
    /// the field on all positive sides.
    pub(super) fn separate_weights(
        &mut self,
        t: f64,
        x: &[f64],
        field0: &[f64],
    ) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let n = self.n;
        self.variables[..n].copy_from_slice(x);
        self.variables[n] = t;
        let low = self.along_held(&self.compiled, &self.variables, field0);
        let sides = |follower: &mut Self, add: f64| {
            for guard in &follower.sliding {
                // On the positive side of a sign 1, of a whole part one more.
                follower.variables[n + 1 + guard] +=
                    if follower.equation.guards[*guard].whole { 0.5 * add } else { add };
            }
        };
        sides(self, 2.0);
        let mut field1 = vec![0.0; n];
        self.compiled.field.evaluate(&self.variables, &mut field1);
        let high = self.along_held(&self.compiled, &self.variables, &field1);
        sides(self, -2.0);
        let mut jumps = Vec::with_capacity(self.sliding.len());
        let weight = |guard: &usize| {
            let (a, b) =
                self.compiled.place(*guard).map_or((f64::NAN, f64::NAN), |p| (low[p], high[p]));
            jumps.push(b - a);
            -a / (b - a)
        };
        let weights = self.sliding.iter().map(weight).collect();
        (weights, jumps, field1)
    }

    /// The answers on both sides of a guard's zero.
    pub(super) fn low(&self, guard: usize) -> f64 {
        if self.equation.guards[guard].whole { self.boundary(guard) - 1.0 } else { -1.0 }
    }

    pub(super) fn high(&self, guard: usize) -> f64 {
        if self.equation.guards[guard].whole { self.boundary(guard) } else { 1.0 }
    }

    /// The whole number that a guard's value is at.
    pub(super) fn boundary(&self, guard: usize) -> f64 {
        let value = self.equation.value(&self.equation.guards[guard].expression, self.t, &self.x);
        value.round()
    }

    pub(super) fn rhs(&mut self, t: f64, x: &[f64], out: &mut [f64]) {
        self.mixed(t, x, out);
        if !self.contacts.is_empty() {
            let forces = self.contact_forces(out);
            self.add_forces(&self.contacts, &self.variables, &forces, out);
        }
    }

    /// The velocity at the present time and state.
    pub(super) fn velocity(&mut self) -> Vec<f64> {
        let (x, mut velocity) = (self.x.clone(), vec![0.0; self.n]);
        self.rhs(self.t, &x, &mut velocity);
        velocity
    }

    /// The velocity without what contacts add to it.
    fn mixed(&mut self, t: f64, x: &[f64], out: &mut [f64]) {
        let n = self.n;
        self.variables[..n].copy_from_slice(x);
        self.variables[n] = t;
        self.compiled.field.evaluate(&self.variables, out);
        if self.separate.is_some() {
            let (mut weights, _, field1) = self.separate_weights(t, x, out);
            self.complete(t, x, &mut weights);
            for (i, owner) in self.separate.iter().flatten().enumerate() {
                if let Some(place) = owner {
                    out[i] = sum([out[i], weights[*place] * (field1[i] - out[i])].into_iter());
                }
            }
        } else if !self.corners.is_empty() {
            let (found, fields, _) = self.corner_mixture(t, x);
            for i in 0..n {
                out[i] = sum(found.weights.iter().zip(&fields).map(|(w, f)| w * f[i]));
            }
        } else if !self.sliding.is_empty() {
            let mut weights = self.weights(t, x, out);
            self.complete(t, x, &mut weights);
            let others: Vec<Vec<f64>> =
                (0..weights.len()).map(|place| self.positive_field(place, t, x)).collect();
            for i in 0..n {
                let low = out[i];
                let added =
                    weights.iter().zip(&others).map(|(weight, other)| weight * (other[i] - low));
                out[i] = sum(std::iter::once(low).chain(added));
            }
        }
    }

    /// By the hundredth part of this, or by its own size, a state's error in a step is measured
    /// where no `atol` is given: its largest size of late, or in the run if its speed has no known
    /// rounding error.
    pub(super) fn scale_of(&self, i: usize) -> f64 {
        if self.noise[i].is_finite() { self.lately[i] } else { self.size[i] }
    }

    /// Bounds the rounding errors of speeds where a state has become small, or a step, beside which
    /// they may count: those of the field's own terms, and those that reach it by the other states
    /// in a step as long as the present one. False if neither is small, nor a speed a mixture.
    pub(super) fn note_noise(&mut self, step: &Step) -> bool {
        let small = |(lately, size): (&f64, &f64)| *lately < SMALL * size;
        let mixed = !self.sliding.is_empty() || !self.contacts.is_empty();
        let tiny = step.h < TINY_STEP * (self.options.t_end - self.options.t_start);
        let count = mixed || tiny || self.lately.iter().zip(&self.size).any(small);
        if self.options.atol.is_some() || !count {
            self.noise.fill(0.0);
            return false;
        }
        let n = self.n;
        let mixture = if !mixed {
            vec![0.0; n]
        } else {
            let mut low = vec![0.0; n];
            self.variables[..n].copy_from_slice(&step.x);
            self.variables[n] = step.t;
            self.compiled.field.evaluate(&self.variables, &mut low);
            self.noise_of_mixture(step.t, &step.x, &low)
        };
        let mut noise = vec![0.0; n];
        // Iterations of an implicit step leave so much of each state.
        let left = if step.jacobian.is_some() { SETTLED } else { 0.0 };
        for _ in 0..PASSES {
            let radius = |i: usize| left * step.x[i].abs() + step.h * noise[i];
            let radii = self.radii_of_speeds(step, radius);
            noise.copy_from_slice(&mixture);
            noise.iter_mut().zip(radii).for_each(|(noise, radius)| *noise += radius);
        }
        self.noise = noise;
        true
    }

    /// By how much speeds, those on all sides of what is slid upon added up, may differ where
    /// states do by these radii.
    fn radii_of_speeds(&self, step: &Step, radius: impl Fn(usize) -> f64) -> Vec<f64> {
        let n = self.n;
        let states: Vec<Range> = (0..n).map(|i| Range::new(step.x[i], radius(i))).collect();
        let (mut out, mut radii) = (vec![Range::default(); n], vec![0.0; n]);
        let one = (&self.compiled, &self.variables);
        let others = self.base.iter().map(|(compiled, variables)| (compiled, variables));
        let corners = self.corners.iter().map(|(compiled, variables)| (compiled, variables));
        for (compiled, variables) in std::iter::once(one).chain(others).chain(corners) {
            let time = Range::new(step.t, 0.0);
            let rest = variables[n + 1..].iter().map(|v| Range::from_f64(*v));
            let given: Vec<Range> = states.iter().copied().chain([time]).chain(rest).collect();
            compiled.field.evaluate(&given, &mut out);
            radii.iter_mut().zip(&out).for_each(|(radius, out)| *radius += out.radius());
        }
        radii
    }

    /// Notes the errors that the tolerance leaves of the speeds of states that are no more than
    /// errors of others, as the integral of an observer's error is that begins without one. False
    /// if there are none.
    pub(super) fn note_inherited(&mut self, step: &Step) -> bool {
        /// Only states that are so far below the largest one are looked at.
        const FAR: f64 = 1e-6;
        /// The errors of a run, in units of the tolerance.
        const ERRORS: f64 = 100.0;
        self.inherited.fill(0.0);
        let largest = self.lately.iter().fold(0.0_f64, |most, s| most.max(*s));
        let small: Vec<usize> = (0..self.n).filter(|i| self.lately[*i] < FAR * largest).collect();
        if self.options.atol.is_some() || small.is_empty() {
            return false;
        }
        let span = self.options.t_end - self.options.t_start;
        let moved = |i: usize| step.x[i].abs() + (step.h * step.k[0][i]).abs();
        for i in small {
            let by_others = |j: usize| if i == j { 0.0 } else { self.options.rtol * moved(j) };
            let inherited = self.radii_of_speeds(step, by_others)[i];
            let most = ERRORS * span * inherited;
            if !(most.is_finite() && self.lately[i] < most) {
                continue;
            }
            // Errors of a state that decays do not grow for so long.
            let own = self.radii_of_speeds(step, |j| if i == j { moved(i) } else { 0.0 })[i];
            if self.lately[i] * (1.0 + span * own / moved(i)) < most {
                self.inherited[i] = inherited;
            }
        }
        self.inherited.iter().any(|by| *by > 0.0)
    }

    /// Rounding errors of speeds that are mixtures of fields which cancel, or of a contact.
    pub(super) fn noise_of_mixture(&mut self, t: f64, x: &[f64], low: &[f64]) -> Vec<f64> {
        let n = self.n;
        let rounding = 8.0 * f64::EPSILON;
        let mut noise = vec![0.0; n];
        let mut others = Vec::new();
        if self.separate.is_some() {
            others.push(self.separate_weights(t, x, low).2);
        } else if !self.corners.is_empty() {
            others = self.corner_mixture(t, x).1;
        } else {
            others.extend((0..self.sliding.len()).map(|place| self.positive_field(place, t, x)));
        }
        for high in others {
            for i in (0..n).filter(|i| high[*i] != low[*i]) {
                noise[i] += rounding * (low[i].abs() + (high[i] - low[i]).abs());
            }
        }
        if !self.contacts.is_empty() {
            let mut out = low.to_vec();
            self.rhs(t, x, &mut out);
            let forces = self.contact_forces(&out);
            for (contact, force) in self.contacts.iter().zip(forces) {
                let direction = self.direction_of(contact, &self.variables);
                for (i, by) in direction.iter().enumerate().filter(|(_, by)| **by != 0.0) {
                    noise[i] += rounding * (out[i].abs() + (by * force).abs());
                }
            }
        }
        noise
    }

    /// Prepares the fields on all sides of the surfaces slid upon, where these have points.
    pub(super) fn take_corners(&mut self) {
        let k = self.sliding.len();
        let mut corners = Vec::new();
        let has = |vertex: &usize| self.cells.as_ref().is_none_or(|c| c.patterns.contains(vertex));
        let vertices: Vec<usize> = (0..1_usize << k).filter(has).collect();
        for vertex in vertices {
            let mut config = self.config.clone();
            for (i, guard) in self.sliding.iter().enumerate() {
                config.sides[*guard] =
                    if vertex >> i & 1 == 1 { self.high(*guard) } else { self.low(*guard) };
            }
            let sliding = self.sliding.clone();
            self.follow_sides(&mut config, &sliding);
            let own = self.equation.compiled(&config);
            let unasked: Vec<usize> =
                sliding.into_iter().filter(|guard| own.place(*guard).is_none()).collect();
            let compiled = self.equation.compiled_with(&config, &unasked);
            corners.push((compiled, self.load(&config)));
        }
        self.corners = corners;
    }

    /// The mixture that the rule makes of the fields on all sides, not-a-number where there is
    /// none, those fields, and the rates of the functions slid upon. Where the speeds on both sides
    /// of a surface vanish together, the mixture is its limit on the way from the step's beginning.
    pub(super) fn corner_mixture(
        &mut self,
        t: f64,
        x: &[f64],
    ) -> (Mixture, Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let (mut found, fields, rates) = self.mixture_at(t, x);
        if t != self.t && !found.weights.iter().all(|w| w.is_finite()) {
            let [near, far] = [BACK, 2.0 * BACK].map(|share| {
                let there: Vec<f64> =
                    x.iter().zip(&self.x).map(|(x, x0)| x + share * (x0 - x)).collect();
                self.mixture_at(t + share * (self.t - t), &there).0
            });
            let weights = near.weights.iter().zip(&far.weights);
            found.weights = weights.map(|(near, far)| 2.0 * near - far).collect();
            let margins = near.margins.iter().zip(&far.margins);
            found.margins = margins
                .map(|(near, far)| std::array::from_fn(|i| 2.0 * near[i] - far[i]))
                .collect();
        }
        (found, fields, rates)
    }

    fn mixture_at(&mut self, t: f64, x: &[f64]) -> (Mixture, Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let n = self.n;
        let (mut fields, mut rates) = (Vec::new(), Vec::new());
        for (_, variables) in &mut self.corners {
            variables[..n].copy_from_slice(x);
            variables[n] = t;
        }
        for (compiled, variables) in &self.corners {
            let mut field = vec![0.0; n];
            compiled.field.evaluate(variables, &mut field);
            let all = self.along_held(compiled, variables, &field);
            let of = |guard: &usize| compiled.place(*guard).map_or(f64::NAN, |i| all[i]);
            rates.push(self.sliding.iter().map(of).collect::<Vec<f64>>());
            fields.push(field);
        }
        let order = self.order_of(&self.sliding);
        let none = || Mixture {
            weights: vec![f64::NAN; fields.len()],
            margins: vec![[f64::NAN; 2]; self.sliding.len()],
        };
        let found = if self.cells.is_some() {
            let weights = self.weights_in_cells(&fields, &rates);
            weights.map(|weights| Mixture { weights, margins: Vec::new() })
        } else {
            mixture(&self.rule(), &order, &fields, &rates)
        };
        (found.unwrap_or_else(none), fields, rates)
    }

    /// Weights of the fields around surfaces of which some are zero wherever others are.
    pub(super) fn weights_in_cells(
        &self,
        fields: &[Vec<f64>],
        rates: &[Vec<f64>],
    ) -> Option<Vec<f64>> {
        if self.options.intersection == Intersection::Undecided || !velocities_differ(fields, rates)
        {
            return Some(cells::weights(rates));
        }
        let few = self.options.intersection == Intersection::HullLeastNorm
            && fields.len() <= 1 << MOST_CORNERS;
        few.then(|| shortest(fields, rates, rates[0].len())).flatten()
    }

    /// Positive where the motion on the surfaces slid upon, with these fields around them, is the
    /// only one and has one velocity, or where a rule says so. What leads away to first order ends
    /// the sliding by its weights.
    pub(super) fn corners_hold(&self, fields: &[Vec<f64>], rates: &[Vec<f64>]) -> f64 {
        if let Some(cells) = &self.cells {
            /// Up to here a field that ceases to attract is told from one that leads away.
            const CLEAR: f64 = 1e-4;
            let depth = cells.depth(rates);
            let attract = || depth < CLEAR || cells.attract(rates);
            let decided = self.options.intersection != Intersection::Undecided
                || !velocities_differ(fields, rates) && attract();
            return if decided { depth + LITTLE } else { -1.0 };
        }
        match rates {
            _ if self.options.intersection != Intersection::Undecided => 1.0,
            [a, b, c, d] if !velocities_differ(fields, rates) => {
                hold(&[a, b, c, d].map(|rates| [rates[0], rates[1]]))
            }
            _ => -1.0,
        }
    }

    /// The field on the positive side of a surface slid upon.
    pub(super) fn positive_field(&mut self, place: usize, t: f64, x: &[f64]) -> Vec<f64> {
        let n = self.n;
        let (compiled, variables) = &mut self.base[place];
        variables[..n].copy_from_slice(x);
        variables[n] = t;
        let mut out = vec![0.0; n];
        compiled.field.evaluate(variables, &mut out);
        out
    }

    /// Derivatives along `field` of the watched values of a configuration.
    pub(super) fn along(compiled: &Compiled, variables: &[f64], field: &[f64]) -> Vec<f64> {
        let n = field.len();
        let mut duals: Vec<Dual<f64, 1>> = variables.iter().map(|v| Dual::constant(*v)).collect();
        for (dual, slope) in duals.iter_mut().zip(field) {
            dual.partials = [*slope];
        }
        duals[n].partials = [1.0];
        let mut out = vec![Dual::constant(0.0); compiled.outputs];
        compiled.watched.evaluate(&duals, &mut out);
        out.iter().map(|d| d.partials[0]).collect()
    }

    /// The same along a field to which contacts add what holds them.
    fn along_held(&self, compiled: &Compiled, variables: &[f64], field: &[f64]) -> Vec<f64> {
        if self.contacts.is_empty() {
            return Self::along(compiled, variables, field);
        }
        let mut held = field.to_vec();
        let forces = self.contact_forces_in(&self.contacts, compiled, variables, field);
        self.add_forces(&self.contacts, variables, &forces, &mut held);
        Self::along(compiled, variables, &held)
    }

    /// Whether what contacts add to a field changes the speed of a surface slid upon.
    pub(super) fn contacts_act_on_sliding(&self, field: &[f64]) -> bool {
        if self.contacts.is_empty() || self.sliding.is_empty() {
            return false;
        }
        let free = Self::along(&self.compiled, &self.variables, field);
        let held = self.along_held(&self.compiled, &self.variables, field);
        let places = self.sliding.iter().filter_map(|guard| self.compiled.place(*guard));
        places.into_iter().any(|p| free[p] != held[p])
    }

    /// Adds to a field of these equations what contacts add to it that push there. The others let
    /// go.
    fn hold(&self, compiled: &Compiled, variables: &[f64], field: &mut [f64]) {
        let mut contacts = self.contacts.clone();
        while !contacts.is_empty() {
            let forces = self.contact_forces_in(&contacts, compiled, variables, field);
            let grips = self.grips_in(&contacts, compiled, variables, field);
            let k = contacts.len();
            let pushes =
                |i: &usize| contacts[*i].above * grips[i * k + i].signum() * forces[*i] >= 0.0;
            let pushing: Vec<Contact> =
                (0..k).filter(pushes).map(|i| contacts[i].clone()).collect();
            if pushing.len() == k {
                self.add_forces(&contacts, variables, &forces, field);
                return;
            }
            contacts = pushing;
        }
    }

    /// The derivatives of the field along itself.
    fn slopes_along(compiled: &Compiled, variables: &[f64], field: &[f64]) -> Vec<f64> {
        let n = field.len();
        let mut duals: Vec<Dual<f64, 1>> = variables.iter().map(|v| Dual::constant(*v)).collect();
        duals.iter_mut().zip(field).for_each(|(dual, slope)| dual.partials = [*slope]);
        duals[n].partials = [1.0];
        let mut slopes = vec![Dual::constant(0.0); n];
        compiled.field.evaluate(&duals, &mut slopes);
        slopes.iter().map(|d| d.partials[0]).collect()
    }

    /// Gives weights that are none, where the speeds on both sides of a surface vanish together,
    /// their limit on the way from the step's beginning.
    pub(super) fn complete(&mut self, t: f64, x: &[f64], weights: &mut [f64]) {
        if weights.iter().all(|w| w.is_finite()) || t == self.t {
            return;
        }
        let mut before = |share: f64| {
            let there: Vec<f64> =
                x.iter().zip(&self.x).map(|(x, x0)| x + share * (x0 - x)).collect();
            let t = t + share * (self.t - t);
            let mut low = vec![0.0; self.n];
            self.variables[..self.n].copy_from_slice(&there);
            self.variables[self.n] = t;
            self.compiled.field.evaluate(&self.variables, &mut low);
            if self.separate.is_some() {
                self.separate_weights(t, &there, &low).0
            } else {
                self.weights(t, &there, &low)
            }
        };
        let (near, far) = (before(BACK), before(2.0 * BACK));
        for (weight, (near, far)) in weights.iter_mut().zip(near.iter().zip(far)) {
            if !weight.is_finite() {
                *weight = 2.0 * near - far;
            }
        }
        self.variables[..self.n].copy_from_slice(x);
        self.variables[self.n] = t;
    }

    /// Weights of the positive sides in sliding; not-a-number where there are none.
    pub(super) fn weights(&mut self, t: f64, x: &[f64], field0: &[f64]) -> Vec<f64> {
        let (a, matrix) = self.sliding_equations(t, x, field0);
        self.solved(&a, &matrix)
    }

    /// The weights w for which a + M w vanishes; not-a-number where there are none.
    pub(super) fn solved(&self, a: &[f64], matrix: &[f64]) -> Vec<f64> {
        let b: Vec<f64> = a.iter().map(|v| -v).collect();
        let found = if self.dependent {
            near_solution(matrix, &b, 0.5).map(|(weights, _)| weights)
        } else {
            solve_any(matrix, &b, 0.0)
        };
        found.unwrap_or_else(|| vec![f64::NAN; b.len()])
    }

    /// Positive where the motion stays on the surfaces slid upon, of which some stay at zero where
    /// the others do: a position beside its speed as its turns decide, others where weights are
    /// between 0 and 1 and as in [`attraction`].
    pub(super) fn dependent_hold(
        &mut self,
        t: f64,
        x: &[f64],
        a: &[f64],
        matrix: &[f64],
        weights: &[f64],
    ) -> f64 {
        let (k, by_rule) = (a.len(), !self.may_turn_away());
        let mut hold = f64::INFINITY;
        for group in groups(k, |i, j| matrix[i * k + j] != 0.0) {
            let still = |i: &usize| group.iter().all(|j| matrix[group[*i] * k + j] == 0.0);
            let of_group = match group.as_slice() {
                [i, j] if let Some(position) = (0..2).find(still).filter(|_| !by_rule) => {
                    let (base, guards) =
                        (self.config.clone(), [self.sliding[*i], self.sliding[*j]]);
                    self.position_hold(&base, (t, x), guards, position)
                }
                some => {
                    let row =
                        |i: &usize| some.iter().map(|j| matrix[i * k + j]).collect::<Vec<_>>();
                    let own: Vec<f64> = some.iter().map(|i| a[*i]).collect();
                    let part: Vec<f64> = some.iter().flat_map(row).collect();
                    let margin = |i: &usize| weights[*i].min(1.0 - weights[*i]);
                    let attracts = if by_rule { 1.0 } else { attraction(&own, &part) };
                    some.iter().map(margin).fold(attracts, f64::min)
                }
            };
            hold = hold.min(of_group);
        }
        hold + LITTLE
    }

    /// The derivatives of the functions slid upon on all negative sides, and what each positive
    /// side adds, row by row.
    pub(super) fn sliding_equations(
        &mut self,
        t: f64,
        x: &[f64],
        field0: &[f64],
    ) -> (Vec<f64>, Vec<f64>) {
        let k = self.sliding.len();
        let n = self.n;
        self.variables[..n].copy_from_slice(x);
        self.variables[n] = t;
        let rates = self.along_held(&self.compiled, &self.variables, field0);
        let of = |rates: &[f64], compiled: &Compiled, guard: usize| {
            compiled.place(guard).map_or(f64::NAN, |i| rates[i])
        };
        let a: Vec<f64> = self.sliding.iter().map(|g| of(&rates, &self.compiled, *g)).collect();
        let mut matrix = vec![0.0; k * k];
        for column in 0..k {
            let field = self.positive_field(column, t, x);
            let (compiled, variables) = &self.base[column];
            let rates = self.along_held(compiled, variables, &field);
            for row in 0..k {
                matrix[row * k + column] = of(&rates, compiled, self.sliding[row]) - a[row];
            }
        }
        (a, matrix)
    }

    /// The direction in which a contact acts: that in which its event's reset changes the state by
    /// what the speed of approach is, as where two bodies exchange momentum.
    pub(super) fn direction_of<'c>(
        &self,
        contact: &'c Contact,
        variables: &[f64],
    ) -> Cow<'c, [f64]> {
        let set = &self.model.definition().events()[contact.event].set;
        if set.len() == 1 {
            return Cow::Borrowed(&contact.along);
        }
        Cow::Owned(self.change_by_reset(contact.event, variables, &contact.along))
    }

    /// The derivative, along a direction, of what an event's reset adds to the state.
    pub(super) fn change_by_reset(
        &self,
        event: usize,
        variables: &[f64],
        along: &[f64],
    ) -> Vec<f64> {
        let (n, set) = (self.n, &self.model.definition().events()[event].set);
        let mut at: Vec<Dual<f64, 1>> = variables.iter().map(|v| Dual::constant(*v)).collect();
        at.iter_mut().zip(along).for_each(|(at, along)| at.partials = [*along]);
        let mut values = vec![Dual::constant(0.0); set.len()];
        match &self.equation.resets[event] {
            Some(program) => program.evaluate(&at, &mut values),
            None => values.iter_mut().zip(set).for_each(|(value, (_, e))| {
                *value = self.equation.value(e, at[n], &at[..n]);
            }),
        }
        let mut change = vec![0.0; n];
        for ((state, _), value) in set.iter().zip(&values) {
            change[*state] = value.partials[0] - along[*state];
        }
        change
    }

    /// Adds what contacts do to a field, with the variables at which the forces were found.
    fn add_forces(
        &self,
        contacts: &[Contact],
        variables: &[f64],
        forces: &[f64],
        field: &mut [f64],
    ) {
        for (contact, force) in contacts.iter().zip(forces) {
            let direction = self.direction_of(contact, variables);
            let acts = field.iter_mut().zip(direction.iter()).filter(|(_, by)| **by != 0.0);
            acts.for_each(|(field, by)| *field += by * force);
        }
    }

    /// Matrix of the contacts, row by row: effect of a change in the direction of each contact on
    /// the derivative of each contact's expression.
    pub(super) fn grips(&self, field: &[f64]) -> Vec<f64> {
        self.grips_in(&self.contacts, &self.compiled, &self.variables, field)
    }

    fn grips_in(
        &self,
        contacts: &[Contact],
        compiled: &Compiled,
        variables: &[f64],
        field: &[f64],
    ) -> Vec<f64> {
        let columns: Vec<Vec<f64>> = contacts
            .iter()
            .map(|c| {
                let direction = self.direction_of(c, variables);
                Self::second_along_in(compiled, variables, field, By::Direction(&direction))
            })
            .collect();
        let place = |c: &Contact| compiled.active.len() + c.watched;
        contacts
            .iter()
            .flat_map(|c| columns.iter().map(|column| column[place(c)]).collect::<Vec<_>>())
            .collect()
    }

    /// The part that is added to `field` in each contact's direction so that its expression stays
    /// at zero; not-a-number if there is nothing.
    pub(super) fn contact_forces(&self, field: &[f64]) -> Vec<f64> {
        self.contact_forces_in(&self.contacts, &self.compiled, &self.variables, field)
    }

    fn contact_forces_in(
        &self,
        contacts: &[Contact],
        compiled: &Compiled,
        variables: &[f64],
        field: &[f64],
    ) -> Vec<f64> {
        let rates = Self::second_along_in(compiled, variables, field, By::Field);
        let pulls: Vec<f64> =
            contacts.iter().map(|c| -rates[compiled.active.len() + c.watched]).collect();
        let grips = self.grips_in(contacts, compiled, variables, field);
        solve_any(&grips, &pulls, 0.0).unwrap_or_else(|| vec![f64::NAN; pulls.len()])
    }

    /// Finds the equations on the sides of the contacts that hold other functions at zero.
    pub(super) fn find_off(&mut self) {
        self.off.clear();
        // Where the motion slides, too, they are not one equation.
        let slides = !self.sliding.is_empty() && self.separate.is_none();
        if self.contacts.is_empty() || slides || !self.guard_held.contains(&true) {
            return;
        }
        for place in 0..self.contacts.len() {
            let above = self.contacts[place].above;
            for way in [above, -above] {
                if way != above && !self.lets_through(place) {
                    continue;
                }
                let held: Vec<usize> =
                    (0..self.guard_held.len()).filter(|guard| self.guard_held[*guard]).collect();
                let contact = &self.contacts[place];
                let direction = self.direction_of(contact, &self.variables);
                let config = self.sides_off(contact.watched, &direction, way, &held);
                let (compiled, variables) = (self.equation.compiled(&config), self.load(&config));
                self.off.push(Off { place, way, config, compiled, variables });
            }
        }
    }

    /// Whether the event of a contact lets what moves pass to the other side, slower.
    fn lets_through(&self, place: usize) -> bool {
        let contact = &self.contacts[place];
        let event = &self.model.definition().events()[contact.event];
        let direction = self.direction_of(contact, &self.variables);
        let change = self.size_along(&direction);
        let x: Vec<f64> =
            self.x.iter().zip(direction.iter()).map(|(x, d)| x + change * d).collect();
        let after = |(state, e): &(usize, Expression)| {
            direction[*state] * (self.equation.value(e, self.t, &x) - self.x[*state])
        };
        matches!(event.when, When::Zero(_, Direction::Both))
            && event.set.iter().map(after).sum::<f64>() > 0.0
    }

    /// So many times a direction is the size of a state that it changes.
    fn size_along(&self, direction: &[f64]) -> f64 {
        let size = |i: usize| if self.size[i] > 0.0 { self.size[i] } else { 1.0 };
        let all = direction.iter().enumerate().filter(|(_, by)| **by != 0.0);
        all.map(|(i, by)| size(i) / by.abs()).fold(f64::INFINITY, f64::min)
    }

    /// The configuration in which these functions have the sides that they get as soon as the
    /// motion, moved in a direction, leaves the zero of a watched expression to a side: first by
    /// its speed, then by its place. The others keep theirs.
    pub(super) fn sides_off(
        &self,
        watched: usize,
        direction: &[f64],
        way: f64,
        guards: &[usize],
    ) -> Configuration {
        /// Changes of the speed and the place, relative to the states' sizes, and what is none.
        const SPEED: f64 = 1e-6;
        const PLACE: f64 = 1e-3;
        const NONE: f64 = 1e-12;
        let mut variables = self.variables.clone();
        variables[..self.n].copy_from_slice(&self.x);
        variables[self.n] = self.t;
        let mut velocity = |x: &[f64]| {
            variables[..self.n].copy_from_slice(x);
            let mut field = vec![0.0; self.n];
            self.compiled.field.evaluate(&variables, &mut field);
            field
        };
        let rest = velocity(&self.x);
        let own = self.compiled.active.len() + watched;
        let by = self.second_in(&rest, direction)[own];
        let size = |i: usize| if self.size[i] > 0.0 { self.size[i] } else { 1.0 };
        let step = way * by.signum() * SPEED * self.size_along(direction);
        let faster: Vec<f64> = self.x.iter().zip(direction).map(|(x, by)| x + step * by).collect();
        let change: Vec<f64> =
            velocity(&faster).iter().zip(&rest).map(|(fast, rest)| fast - rest).collect();
        let time = (0..self.n)
            .filter(|i| direction[*i] == 0.0 && change[*i] != 0.0)
            .map(|i| PLACE * size(i) / change[i].abs())
            .fold(f64::INFINITY, f64::min);
        let mut moved = self.x.clone();
        if time.is_finite() {
            moved.iter_mut().zip(&change).for_each(|(x, change)| *x += time * change);
            let set = (0..self.n).filter(|i| direction[*i] != 0.0);
            set.for_each(|i| moved[i] = self.x[i]);
        }
        let mut config = self.config.clone();
        for guard in guards {
            let e = &self.equation.guards[*guard].expression;
            let small = NONE * self.magnitude(e);
            let value = |x: &[f64]| self.equation.value(e, self.t, x);
            let values = [value(&faster), value(&moved)];
            let found = values.into_iter().find(|value| value.abs() > small);
            if let Some(value) = found {
                config.sides[*guard] = value.signum();
            }
        }
        config
    }

    /// The push of a contact to the side to which it lets go most easily, and that side: the
    /// greater one of its pushes with the functions that it holds, and with these as they are when
    /// it opens.
    pub(super) fn push(&mut self, place: usize, t: f64, x: &[f64]) -> (f64, f64) {
        let of = |follower: &mut Self| {
            let mut field = vec![0.0; follower.n];
            follower.mixed(t, x, &mut field);
            let k = follower.contacts.len();
            let own = follower.grips(&field)[place * k + place];
            own.signum() * follower.contact_forces(&field)[place]
        };
        let above = self.contacts[place].above;
        let held = of(self);
        let mut all = std::mem::take(&mut self.off);
        let mut least: Option<(f64, f64)> = None;
        for off in all.iter_mut().filter(|off| off.place == place) {
            off.variables[..self.n].copy_from_slice(x);
            off.variables[self.n] = t;
            std::mem::swap(&mut self.compiled, &mut off.compiled);
            std::mem::swap(&mut self.variables, &mut off.variables);
            let push = f64::max(off.way * held, off.way * of(self));
            std::mem::swap(&mut self.compiled, &mut off.compiled);
            std::mem::swap(&mut self.variables, &mut off.variables);
            if least.is_none_or(|(least, _)| push < least) {
                least = Some((push, off.way));
            }
        }
        self.off = all;
        least.unwrap_or((above * held, above))
    }

    /// The pushes of contacts against sliding without them: where all fields that they hold have
    /// one speed on a surface slid upon, at least one of them lets go.
    pub(super) fn pushes_on_free_sliding(&mut self, t: f64, x: &[f64]) -> Vec<f64> {
        let contacts = std::mem::take(&mut self.contacts);
        let mut free = vec![0.0; self.n];
        self.mixed(t, x, &mut free);
        self.contacts = contacts;
        let (forces, grips) = (self.contact_forces(&free), self.grips(&free));
        let k = forces.len();
        let push = |i: usize| self.contacts[i].above * grips[i * k + i].signum() * forces[i];
        (0..k).map(push).collect()
    }

    /// Second derivatives of the watched values along the field; or the derivatives of their first
    /// ones by a state.
    pub(super) fn second_along(&self, field: &[f64], by: Option<usize>) -> Vec<f64> {
        let by = by.map_or(By::Field, By::Variable);
        Self::second_along_in(&self.compiled, &self.variables, field, by)
    }

    /// The derivatives of the watched values' first ones in a direction of the states.
    pub(super) fn second_in(&self, field: &[f64], direction: &[f64]) -> Vec<f64> {
        let by = By::Direction(direction);
        Self::second_along_in(&self.compiled, &self.variables, field, by)
    }

    /// The same of any numbers, as those that are known to rounding.
    pub(super) fn second_along_in<S: Arithmetic + Elementary>(
        compiled: &Compiled,
        variables: &[S],
        field: &[S],
        by: By,
    ) -> Vec<S> {
        let n = field.len();
        let mut direction = vec![S::zero(); variables.len()];
        match by {
            By::Variable(i) => direction[i] = S::one(),
            By::Direction(states) => {
                let given = states.iter().map(|d| S::from_f64(*d));
                direction.iter_mut().zip(given).for_each(|(direction, given)| *direction = given);
            }
            By::Field => {
                direction[..n].copy_from_slice(field);
                direction[n] = S::one();
            }
        }
        let duals: Vec<Dual<S, 1>> = variables
            .iter()
            .zip(&direction)
            .map(|(v, d)| Dual { value: *v, partials: [*d] })
            .collect();
        let mut slopes = vec![Dual::constant(S::zero()); n];
        compiled.field.evaluate(&duals, &mut slopes);
        let nested: Vec<Dual<Dual<S, 1>, 1>> = (0..variables.len())
            .map(|i| {
                let inner = Dual { value: variables[i], partials: [direction[i]] };
                let outer = match i {
                    i if i < n => Dual { value: field[i], partials: slopes[i].partials },
                    i if i == n => Dual::constant(S::one()),
                    _ => Dual::constant(S::zero()),
                };
                Dual { value: inner, partials: [outer] }
            })
            .collect();
        let mut out = vec![Dual::constant(Dual::constant(S::zero())); compiled.outputs];
        compiled.watched.evaluate(&nested, &mut out);
        out.iter().map(|d| d.partials[0].partials[0]).collect()
    }

    /// The compiled equation of a configuration, and the rates of its watched values at the present
    /// point.
    pub(super) fn rates(&mut self, config: &Configuration) -> (Rc<Compiled>, Rates) {
        self.rates_with(config, &[])
    }

    /// The same, with the rates of these guards even where the equations do not ask them.
    pub(super) fn rates_with(
        &mut self,
        config: &Configuration,
        also: &[usize],
    ) -> (Rc<Compiled>, Rates) {
        self.rates_to_order(config, also, false)
    }

    /// The same, with second derivatives even where first ones are not zero.
    pub(super) fn rates_of_second_order(
        &mut self,
        config: &Configuration,
    ) -> (Rc<Compiled>, Rates) {
        self.rates_to_order(config, &[], true)
    }

    /// Rates as [`Follower::rates_with`] has them, with all second derivatives if `second_order`.
    pub(super) fn rates_to_order(
        &mut self,
        config: &Configuration,
        also: &[usize],
        second_order: bool,
    ) -> (Rc<Compiled>, Rates) {
        let compiled = self.equation.compiled_with(config, also);
        let variables = self.load(config);
        let n = self.n;
        let mut field = vec![0.0; n];
        compiled.field.evaluate(&variables, &mut field);
        if !self.contacts.is_empty() {
            self.hold(&compiled, &variables, &mut field);
        }
        let outputs = compiled.outputs;
        let (mut slopes, mut terms) = (vec![0.0; outputs], vec![0.0; outputs]);
        for (o, gradient) in compiled.gradients(&variables).iter().enumerate() {
            for (variable, slope) in compiled.touches[o].iter().zip(gradient) {
                let change = slope * if *variable == n { 1.0 } else { field[*variable] };
                slopes[o] += change;
                terms[o] += change.abs();
            }
        }
        // Second derivatives matter where first ones are zero; the present programs give them.
        let mut second = vec![0.0; outputs];
        if second_order || (0..outputs).any(|i| !(slopes[i].abs() > 1e-11 * terms[i])) {
            let bends = Self::slopes_along(&compiled, &variables, &field);
            let kept = (
                std::mem::replace(&mut self.variables, variables),
                std::mem::replace(&mut self.compiled, compiled.clone()),
            );
            second = self.second_along(&field, None);
            // The contribution of the field's derivatives may cancel the rest to rounding.
            for (o, gradient) in compiled.gradients(&self.variables).iter().enumerate() {
                let (mut by_bends, mut size) = (0.0, 0.0);
                for (variable, slope) in
                    compiled.touches[o].iter().zip(gradient).filter(|(v, _)| **v < n)
                {
                    by_bends += slope * bends[*variable];
                    size += (slope * bends[*variable]).abs();
                }
                size += (second[o] - by_bends).abs();
                if second[o].abs() <= 1e-13 * size {
                    second[o] = 0.0;
                }
            }
            (self.variables, self.compiled) = kept;
            if second.iter().any(|v| v.is_nan()) {
                self.bend_by_difference(&compiled, config, &field, &slopes, &mut second);
            }
        }
        (compiled, Rates { field, first: slopes, second, terms })
    }
}

impl Follower<'_> {
    /// Second derivatives that are no numbers, as that of x |x|^0.6 at zero, by how much the first
    /// ones change a little later; but for those that grow without bound, as at a root's zero.
    fn bend_by_difference(
        &self,
        compiled: &Compiled,
        config: &Configuration,
        field: &[f64],
        first: &[f64],
        second: &mut [f64],
    ) {
        /// Of the run, or of the time in which a state moves by its size.
        const LATER: [f64; 2] = [1e-12, 1e-9];
        let n = self.n;
        let times = field.iter().zip(&self.size).map(|(f, size)| size / f.abs());
        let span = self.options.t_end - self.options.t_start;
        let whole = times.filter(|time| *time > 0.0).fold(span, f64::min);
        let [near, far] = LATER.map(|part| {
            let later = part * whole;
            let mut variables = self.load(config);
            (0..n).for_each(|i| variables[i] += later * field[i]);
            variables[n] += later;
            let mut then = vec![0.0; n];
            compiled.field.evaluate(&variables, &mut then);
            let rates = Self::along(compiled, &variables, &then);
            rates.iter().zip(first).map(|(rate, first)| (rate - first) / later).collect::<Vec<_>>()
        });
        for ((second, near), far) in second.iter_mut().zip(near).zip(far) {
            if second.is_nan() && near.abs() <= 2.0 * far.abs() {
                *second = far;
            }
        }
    }
}

/// A sum, zero where only rounding is left: a speed of a state that stays at zero would be resolved
/// as a motion. The weights of several terms are solutions of as many equations.
fn sum(terms: impl Iterator<Item = f64>) -> f64 {
    let add = |(sum, size, count), v: f64| (sum + v, size + v.abs(), count + 1.0);
    let (sum, size, count) = terms.fold((0.0, 0.0, -1.0), add);
    if sum.abs() <= 4.0 * count * count * f64::EPSILON * size { 0.0 } else { sum }
}

/// For each function the determinant of -a among the group of functions that depend on each other:
/// of several that vanish at one moment the product would vanish before.
pub(super) fn determinants(a: &[f64], k: usize) -> Vec<f64> {
    let mut all = vec![0.0; k];
    for group in groups(k, |i, j| a[i * k + j] != 0.0) {
        let row = |i: &usize| group.iter().map(|j| a[i * k + j]).collect::<Vec<_>>();
        let own = determinant_of_negative(group.iter().flat_map(row).collect(), group.len());
        group.iter().for_each(|i| all[*i] = own);
    }
    all
}

/// The determinant of -a, of k rows, by elimination with pivots.
pub(crate) fn determinant_of_negative(mut a: Vec<f64>, k: usize) -> f64 {
    let mut product = 1.0;
    for column in 0..k {
        let size = |i: &usize| a[*i * k + column].abs();
        let pivot = (column..k).max_by(|i, j| size(i).total_cmp(&size(j))).unwrap_or(column);
        if pivot != column {
            (0..k).for_each(|j| a.swap(column * k + j, pivot * k + j));
            product = -product;
        }
        let diagonal = a[column * k + column];
        product *= -diagonal;
        for row in column + 1..k {
            let factor = a[row * k + column] / diagonal;
            for j in column..k {
                a[row * k + j] -= factor * a[column * k + j];
            }
        }
    }
    product
}
