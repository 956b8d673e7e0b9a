//! Tangent vectors along a motion, and what they say: Lyapunov exponents and Floquet multipliers.
//!
//! Between switches a tangent vector is carried by the derivative of the method's own step. Where a
//! surface is met at the speed m' of its function, with fields f- before and f+ behind and a reset
//! R, it is multiplied by the *saltation matrix* (Aizerman & Gantmakher 1958; Leine & Nijmeijer
//! 2004, ch. 7)
//!
//! S = DR + (f+ - DR f- - dR/dt) (grad m)^T / m'.
//!
//! Behind it f+ may be a sliding field: S then takes away what is normal to the surface. Where
//! sliding ends the field is continuous, and S = 1.

use super::{Ending, Follower, HybridError, Options, Record, Sought};
use crate::Model;
use crate::equation::Compiled;
use crate::step::{A, C, E, Step};
use twofold_num::elementary::{ln, rough_pow, sqrt};
use twofold_num::fit::line;
use twofold_num::linear::{eigenvalues, solve_any};
use twofold_num::random::RandomStream;
use twofold_num::{Dual, Short};
use twofold_system::Expression;

/// Local error of a tangent vector, relative to itself.
const TANGENT_TOLERANCE: f64 = 1e-9;

/// Nodes and coefficients of Gauss' methods of orders 4 and 6 (Hairer, Norsett & Wanner 1993,
/// tables II.7.3 and II.7.4). The weights are twice the diagonal.
const GAUSS_2: ([f64; 2], [[f64; 2]; 2]) = {
    let d = 0.288_675_134_594_812_9; // sqrt(3)/6
    ([0.5 - d, 0.5 + d], [[0.25, 0.25 - d], [0.25 + d, 0.25]])
};
const GAUSS_3: ([f64; 3], [[f64; 3]; 3]) = {
    let r = 3.872_983_346_207_417; // sqrt(15)
    (
        [0.5 - r / 10.0, 0.5, 0.5 + r / 10.0],
        [
            [5.0 / 36.0, 2.0 / 9.0 - r / 15.0, 5.0 / 36.0 - r / 30.0],
            [5.0 / 36.0 + r / 24.0, 2.0 / 9.0, 5.0 / 36.0 - r / 24.0],
            [5.0 / 36.0 + r / 30.0, 2.0 / 9.0 + r / 15.0, 5.0 / 36.0],
        ],
    )
};

type D = Dual<f64, 1>;
/// Directions in which derivatives are taken at once; many systems have fewer states.
const WIDE: usize = 4;

/// Tangent vectors, and the reset that an event has just made.
#[derive(Clone, Debug, Default)]
pub(super) struct Tangents {
    /// The vectors.
    pub vectors: Vec<Vec<f64>>,
    /// Derivative of the last reset by the state, row by row, and by the time.
    pub reset: Option<(Vec<f64>, Vec<f64>)>,
    /// The least and the largest value of each state at the ends of steps.
    pub bounds: Vec<[f64; 2]>,
    /// The size of each state in the last step.
    pub sizes: Vec<f64>,
    /// Whether a matrix without an inverse has acted since the growth was noted last: of sliding
    /// that began, or of a reset.
    pub flattened: bool,
    /// The pieces of resets that have acted, hashed.
    pub pieces: u64,
    /// The sides that the motion was on, each once.
    pub sides: Vec<String>,
}

/// FNV-1a (Fowler, Noll & Vo 1991), a piece at a time.
fn hashed(hash: u64, piece: u64) -> u64 {
    (hash ^ piece).wrapping_mul(0x0100_0000_01b3)
}

/// Field, gradient and speed before a condition is met.
pub(super) struct Before {
    field: Vec<f64>,
    gradient: Vec<f64>,
    speed: f64,
}

impl Follower<'_> {
    /// Carries the tangent vectors through a step, by the derivative of its stages; gives the
    /// largest error that the embedded formula estimates, relative to the vector.
    pub(super) fn carry(&mut self, step: &Step) -> f64 {
        const ULPS: f64 = 8.0 * f64::EPSILON;
        let Some(mut tangents) = self.tangents.take() else { return 0.0 };
        let n = self.n;
        let mut worst = 0.0_f64;
        tangents.bounds.resize(n, [f64::INFINITY, f64::NEG_INFINITY]);
        for (bounds, ends) in tangents.bounds.iter_mut().zip(step.x.iter().zip(&step.y)) {
            *bounds = [bounds[0].min(*ends.0).min(*ends.1), bounds[1].max(*ends.0).max(*ends.1)];
        }
        tangents.sizes = step.x.iter().zip(&step.y).map(|(a, b)| a.abs().max(b.abs())).collect();
        if !tangents.sides.contains(&self.signs) {
            tangents.sides.push(self.signs.clone());
        }
        for y in &mut tangents.vectors {
            let mut k: Vec<Vec<f64>> = Vec::with_capacity(7);
            let mut end = Vec::new();
            for s in 0..7 {
                let (mut x, mut v) = (step.x.clone(), y.clone());
                for (a, (kx, kv)) in A[s].iter().zip(step.k.iter().zip(&k)) {
                    for i in 0..n {
                        x[i] += step.h * a * kx[i];
                        v[i] += step.h * a * kv[i];
                    }
                }
                k.push(self.slope_beside(step.t + C[s] * step.h, &x, &v));
                end = v;
            }
            let mut error: Vec<f64> = (0..n)
                .map(|i| E.iter().zip(&k).map(|(e, k)| e * k[i]).sum::<f64>() * step.h)
                .collect();
            if !end.iter().chain(&error).all(|v| v.is_finite()) {
                let rough = self.carried_beside_roots(step, y, &GAUSS_2);
                end = self.carried_beside_roots(step, y, &GAUSS_3);
                error = end.iter().zip(&rough).map(|(a, b)| a - b).collect();
                // On the last numbers before the root nothing is resolved, and little changes.
                let moves = |(a, b): (&f64, &f64)| (a - b).abs() > ULPS * a.abs();
                if !end.iter().all(|v| v.is_finite()) && !step.x.iter().zip(&step.y).any(moves) {
                    (end, error) = (y.clone(), vec![0.0; n]);
                }
            }
            let size = y.iter().chain(&end).fold(0.0_f64, |most, v| most.max(v.abs()));
            for error in error {
                worst = worst.max(error.abs() / size.max(f64::MIN_POSITIVE));
            }
            *y = end;
        }
        self.tangents = Some(tangents);
        worst
    }

    /// A tangent vector through a step at whose beginning or end a root is zero and its rate grows
    /// like one over the root of the time: by collocation (Hairer, Norsett & Wanner 1993, sec.
    /// II.7) in s, where the time is h s^2 (3 - 2 s), of which it is a smooth function.
    fn carried_beside_roots<const K: usize>(
        &mut self,
        step: &Step,
        y: &[f64],
        (nodes, weights): &([f64; K], [[f64; K]; K]),
    ) -> Vec<f64> {
        /// Each iteration gains the digits of the change in the step.
        const ITERATIONS: usize = 12;
        let (mut rates, mut x) = (vec![vec![0.0; y.len()]; K], vec![0.0; y.len()]);
        let sum = |weight: &dyn Fn(usize) -> f64, rates: &[Vec<f64>]| -> Vec<f64> {
            let of = |i: usize| (0..K).map(|j| weight(j) * rates[j][i]).sum::<f64>();
            y.iter().enumerate().map(|(i, y)| y + of(i)).collect()
        };
        for _ in 0..ITERATIONS {
            for (stage, s) in nodes.iter().enumerate() {
                let (time, clock) = (s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) * step.h);
                step.at(time, &mut x);
                let v = sum(&|j| weights[stage][j], &rates);
                let slope = self.slope_along(step.t + time * step.h, &x, &v);
                rates[stage] = slope.iter().map(|v| clock * v).collect();
            }
        }
        sum(&|j| weights[j][j] * 2.0, &rates)
    }

    /// Whether a step is too long for the tangent vectors: by which factor it should be shorter.
    pub(super) fn too_long_for_tangents(&mut self, step: &Step) -> Option<f64> {
        let kept = self.tangents.clone()?;
        let error = self.carry(step) / (TANGENT_TOLERANCE.max(self.options.rtol));
        self.tangents = Some(kept);
        (error > 1.0).then(|| (0.9 * rough_pow(error, -0.2)).clamp(0.1, 0.9))
    }

    /// The derivative of the field by the state, row by row.
    pub(super) fn jacobian(&mut self, t: f64, x: &[f64]) -> Vec<f64> {
        let n = self.n;
        let mut matrix = vec![0.0; n * n];
        let mut low = vec![Dual::<f64, WIDE>::constant(0.0); n];
        for first in (0..n).step_by(WIDE) {
            let unit = |j: usize| std::array::from_fn(|k| if j == first + k { 1.0 } else { 0.0 });
            let slopes = self.slopes_in::<WIDE>(t, x, &unit);
            if !self.sliding.is_empty() {
                let constants = self.variables.iter().map(|v| Dual::constant(*v));
                let mut v: Vec<Dual<f64, WIDE>> = constants.collect();
                (0..n).for_each(|j| v[j].partials = unit(j));
                self.compiled.field.evaluate(&v, &mut low);
            }
            for (i, slopes) in slopes.iter().enumerate() {
                for (j, slope) in (first..n).zip(slopes) {
                    // A mixture that holds a state has no slope there but rounding's.
                    let of_side = low[i].partials[j - first];
                    let held = !self.sliding.is_empty() && slope.abs() <= 1e-13 * of_side.abs();
                    matrix[i * n + j] = if held { 0.0 } else { *slope };
                }
            }
        }
        matrix
    }

    /// The Jacobian for iterations, which settle in short steps without a slope that is infinite,
    /// as that of a root at zero. Where a root hides other slopes they are quotients.
    pub(super) fn finite_jacobian(&mut self, t: f64, x: &[f64]) -> Vec<f64> {
        let n = self.n;
        let mut jacobian = self.jacobian(t, x);
        let mut now = vec![0.0; n];
        for j in 0..n {
            let hidden: Vec<usize> = (0..n).filter(|i| !jacobian[i * n + j].is_finite()).collect();
            if hidden.is_empty() {
                continue;
            }
            self.rhs(t, x, &mut now);
            let largest = self.size.iter().fold(0.0_f64, |most, size| most.max(*size));
            let mut quotient = |part: f64| {
                let by = part * 1e-8 * x[j].abs().max(self.size[j]).max(1e-3 * largest);
                let (mut beside, mut there) = (x.to_vec(), vec![0.0; n]);
                beside[j] += by;
                self.rhs(t, &beside, &mut there);
                let by = beside[j] - x[j];
                there.iter().zip(&now).map(|(there, now)| (there - now) / by).collect::<Vec<f64>>()
            };
            let (near, far) = (quotient(1.0), quotient(8.0));
            for i in hidden {
                let same = (near[i] - far[i]).abs() <= 1e-2 * near[i].abs();
                jacobian[i * n + j] = if same { near[i] } else { 0.0 };
            }
        }
        jacobian
    }

    /// Whether the field has an infinite slope where a step begins, as a root has at zero: an
    /// implicit step may leave it.
    pub(super) fn begins_at_a_root(&mut self, step: &Step) -> bool {
        self.jacobian(step.t, &step.x).iter().any(|slope| !slope.is_finite())
    }

    /// The derivative of the field in the direction `v`; where a power is zero, as x^1.5 at x = 0,
    /// that of a state a little before or after, if it does not grow without bound.
    fn slope_beside(&mut self, t: f64, x: &[f64], v: &[f64]) -> Vec<f64> {
        /// In units of the time that a state takes to move by its size: the nearer one is taken.
        const BESIDE: [f64; 2] = [1e-14, 1e-12];
        let at = self.slope_along(t, x, v);
        let finite = |slope: &Vec<f64>| slope.iter().all(|s| s.is_finite());
        if finite(&at) {
            return at;
        }
        let mut field = vec![0.0; self.n];
        self.rhs(t, x, &mut field);
        let times = field.iter().zip(&self.size).map(|(f, size)| size / f.abs());
        let whole = times.filter(|time| *time > 0.0).fold(f64::INFINITY, f64::min);
        if whole == f64::INFINITY {
            return self.slope_at_rest(t, x, v, BESIDE).unwrap_or(at);
        }
        for way in [1.0, -1.0] {
            let [near, far] = BESIDE.map(|part| {
                let by = way * part * whole;
                let beside: Vec<f64> = x.iter().zip(&field).map(|(x, f)| x + by * f).collect();
                self.slope_along(t + by, &beside, v)
            });
            let bounded = near.iter().zip(&far).all(|(near, far)| near.abs() <= 2.0 * far.abs());
            if finite(&near) && finite(&far) && bounded {
                return near;
            }
        }
        at
    }

    /// The derivative of the field in the direction `v` where nothing moves, by those at two points
    /// beside it, at distances relative to the largest state; zero where it falls with the
    /// distance, as that of a power. None if it has no bound, or another one on the other side.
    fn slope_at_rest(&mut self, t: f64, x: &[f64], v: &[f64], parts: [f64; 2]) -> Option<Vec<f64>> {
        const SAME: f64 = 1e-6;
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        let reach = match largest(x).max(largest(&self.size)) {
            0.0 => 1.0,
            reach => reach,
        };
        let [above, below] = [1.0, -1.0].map(|way| {
            let [near, far] = parts.map(|part| {
                // Off differences of states, too.
                let off = |i: usize| way * part * reach * (1.0 + i as f64);
                let beside: Vec<f64> = x.iter().enumerate().map(|(i, x)| x + off(i)).collect();
                self.slope_along(t, &beside, v)
            });
            let limit = |(near, far): (&f64, &f64)| match near.abs() / far.abs() {
                _ if *near == 0.0 => Some(0.0),
                ratio if ratio <= 0.5 => Some(0.0),
                ratio if ratio <= 2.0 => Some(*near),
                _ => None,
            };
            near.iter().zip(&far).map(limit).collect::<Option<Vec<f64>>>()
        });
        match (above, below) {
            (Some(above), Some(below)) => {
                let differ = |(a, b): (&f64, &f64)| (a - b).abs() > SAME * a.abs().max(b.abs());
                (!above.iter().zip(&below).any(differ)).then_some(above)
            }
            (above, below) => above.or(below),
        }
    }

    /// The derivative of the field in the direction `v`, sliding included.
    fn slope_along(&mut self, t: f64, x: &[f64], v: &[f64]) -> Vec<f64> {
        self.slopes_in::<1>(t, x, &|i| [v[i]]).into_iter().flatten().collect()
    }

    /// The same in several directions, of which `along` has the components of a state.
    fn slopes_in<const P: usize>(
        &mut self,
        t: f64,
        x: &[f64],
        along: &dyn Fn(usize) -> [f64; P],
    ) -> Vec<[f64; P]> {
        type D<const P: usize> = Dual<f64, P>;
        let n = self.n;
        let load = |variables: &[f64]| -> Vec<D<P>> {
            let mut duals: Vec<D<P>> = variables.iter().map(|v| D::constant(*v)).collect();
            for i in 0..n {
                duals[i] = Dual { value: x[i], partials: along(i) };
            }
            duals[n] = D::constant(t);
            duals
        };
        let field = |compiled: &Compiled, variables: &[D<P>]| {
            let mut out = vec![D::constant(0.0); n];
            compiled.field.evaluate(variables, &mut out);
            out
        };
        let rates = |compiled: &Compiled, variables: &[D<P>], field: &[D<P>]| -> Vec<D<P>> {
            let zero = D::constant(0.0);
            let speed = |i: usize| match i {
                i if i < n => field[i],
                i if i == n => D::constant(1.0),
                _ => zero,
            };
            let nest = |(i, value): (usize, &D<P>)| Dual { value: *value, partials: [speed(i)] };
            let nested: Vec<Dual<D<P>, 1>> = variables.iter().enumerate().map(nest).collect();
            let mut out = vec![Dual::constant(zero); compiled.outputs];
            compiled.watched.evaluate(&nested, &mut out);
            out.iter().map(|d| d.partials[0]).collect()
        };
        let variables = load(&self.variables);
        let low = field(&self.compiled, &variables);
        let k = self.sliding.len();
        if k == 0 {
            return low.iter().map(|d| d.partials).collect();
        }
        let place = |compiled: &Compiled, guard: usize| {
            compiled.active.iter().position(|g| *g == guard).unwrap_or(0)
        };
        let speeds = rates(&self.compiled, &variables, &low);
        let a: Vec<D<P>> = self.sliding.iter().map(|g| speeds[place(&self.compiled, *g)]).collect();
        if let Some(owners) = &self.separate {
            let mut v = variables;
            for guard in &self.sliding {
                let up = if self.equation.guards[*guard].whole { 1.0 } else { 2.0 };
                v[n + 1 + guard].value += up;
            }
            let high = field(&self.compiled, &v);
            let all = rates(&self.compiled, &v, &high);
            let speeds = self.sliding.iter().map(|g| all[place(&self.compiled, *g)]);
            let weights: Vec<D<P>> = a.iter().zip(speeds).map(|(a, b)| -*a / (b - *a)).collect();
            let mixed = low.iter().zip(&high).zip(owners).map(|((low, high), owner)| match owner {
                Some(place) => *low + weights[*place] * (*high - *low),
                None => *low,
            });
            return mixed.map(|d| d.partials).collect();
        }
        let mut columns = Vec::with_capacity(k);
        for (column, guard) in self.sliding.iter().enumerate() {
            let (compiled, mut v) = match self.base.get(column) {
                Some((compiled, variables)) => (compiled.clone(), load(variables)),
                None => (self.compiled.clone(), variables.clone()),
            };
            if self.base.is_empty() {
                let up = if self.equation.guards[*guard].whole { 1.0 } else { 2.0 };
                v[n + 1 + guard].value += up;
            }
            let high = field(&compiled, &v);
            let all = rates(&compiled, &v, &high);
            let speeds: Vec<D<P>> =
                self.sliding.iter().map(|g| all[place(&compiled, *g)]).collect();
            columns.push((high, speeds));
        }
        let mut matrix = vec![D::constant(0.0); k * k];
        for (c, (_, speeds)) in columns.iter().enumerate() {
            for r in 0..k {
                matrix[r * k + c] = speeds[r] - a[r];
            }
        }
        let weights = solve_duals(matrix, a.iter().map(|a| -*a).collect());
        let mut out = low.clone();
        for (weight, (high, _)) in weights.iter().zip(&columns) {
            for i in 0..n {
                out[i] += *weight * (high[i] - low[i]);
            }
        }
        out.iter().map(|d| d.partials).collect()
    }

    /// Begins to carry these vectors. Of a motion that begins in sliding they lose what is normal
    /// to the surfaces at once: a neighbour off a surface comes back to it in a time that is
    /// proportional to its distance, whichever side it is on.
    pub(super) fn begin_tangents(&mut self, mut vectors: Vec<Vec<f64>>) -> Result<(), HybridError> {
        let (n, k) = (self.n, self.sliding.len());
        if self.dependent {
            return Err(self.no_tangents("motion begins on surfaces that depend on each other"));
        }
        if !self.config.higher.is_empty() {
            return Err(self.no_tangents_in_higher_order());
        }
        if self.part_rests {
            return Err(self.no_tangents(
                "a part of the states rests where switches meet, where neighbours have no common \
                    linear motion",
            ));
        }
        if k > 0 {
            let (t, x) = (self.t, self.x.clone());
            self.variables[..n].copy_from_slice(&x);
            self.variables[n] = t;
            let mut field0 = vec![0.0; n];
            self.compiled.field.evaluate(&self.variables, &mut field0);
            // Change of the field, and of the surfaces' functions' rates, by each surface's
            // positive side.
            let separate = self.separate.clone();
            let (added, matrix): (Vec<Vec<f64>>, Vec<f64>) = match &separate {
                Some(owners) => {
                    let (_, jumps, field1) = self.separate_weights(t, &x, &field0);
                    let of = |place: usize| {
                        let own = |i: usize| {
                            if owners[i] == Some(place) { field1[i] - field0[i] } else { 0.0 }
                        };
                        (0..n).map(own).collect()
                    };
                    let diagonal = |i: usize| if i / k == i % k { jumps[i / k] } else { 0.0 };
                    ((0..k).map(of).collect(), (0..k * k).map(diagonal).collect())
                }
                None => {
                    let matrix = self.sliding_equations(t, &x, &field0).1;
                    let difference =
                        |high: Vec<f64>| high.iter().zip(&field0).map(|(a, b)| a - b).collect();
                    (
                        (0..k).map(|place| difference(self.positive_field(place, t, &x))).collect(),
                        matrix,
                    )
                }
            };
            self.variables[..n].copy_from_slice(&x);
            self.variables[n] = t;
            let compiled = self.compiled.clone();
            let in_time = Self::along(&compiled, &self.variables, &vec![0.0; n]);
            for y in &mut vectors {
                let moved = Self::along(&compiled, &self.variables, y);
                let off = |guard: &usize| {
                    compiled.place(*guard).map_or(f64::NAN, |p| in_time[p] - moved[p])
                };
                let off: Vec<f64> = self.sliding.iter().map(off).collect();
                let Some(weights) = solve_any(&matrix, &off, 0.0) else {
                    return Err(self.no_tangents("motion begins where sliding is not defined"));
                };
                for (weight, added) in weights.iter().zip(&added) {
                    y.iter_mut().zip(added).for_each(|(y, a)| *y += weight * a);
                }
            }
        }
        self.tangents = Some(Tangents { vectors, flattened: k > 0, ..Tangents::default() });
        Ok(())
    }

    /// Data of the moment before a condition is met, for the saltation matrix; none without
    /// tangents.
    pub(super) fn before(&mut self, met: &[Sought]) -> Result<Option<Before>, HybridError> {
        if self.tangents.is_none() {
            return Ok(None);
        }
        if let Some(tangents) = &mut self.tangents {
            tangents.reset = None;
        }
        let n = self.n;
        let (t, x) = (self.t, self.x.clone());
        let mut field = vec![0.0; n];
        self.rhs(t, &x, &mut field);
        // Where the speeds of both sides vanish together there is no mixture, but the field along
        // which the motion has slid.
        if let ([guard], false) = (&self.sliding[..], field.iter().all(|f| f.is_finite())) {
            if self.along[*guard] > 0.0 {
                field = self.positive_field(0, t, &x);
            } else {
                self.compiled.field.evaluate(&self.variables, &mut field);
            }
        }
        if self.sliding.len() > 1 && !field.iter().all(|f| f.is_finite()) {
            // Of several surfaces the lower sides' field, if it runs along all of them.
            let mut low = vec![0.0; n];
            self.compiled.field.evaluate(&self.variables, &mut low);
            let rates = Self::along(&self.compiled, &self.variables, &low);
            let places = self.sliding.iter().filter_map(|guard| self.compiled.place(*guard));
            if places.into_iter().all(|p| rates[p].abs() <= 1e-9 * self.speeds(&low, p)) {
                field = low;
            }
        }
        let mut found: Option<(Vec<f64>, f64)> = None;
        for sought in met {
            let place = match *sought {
                Sought::Guard { guard, .. } => {
                    self.compiled.active.iter().position(|g| *g == guard)
                }
                Sought::Watched(i) => Some(self.compiled.active.len() + i),
                _ => None,
            };
            let Some(place) = place else { continue };
            let mut gradient = vec![0.0; n + 1];
            let mut out = vec![D::constant(0.0); self.compiled.outputs];
            for (j, slope) in gradient.iter_mut().enumerate() {
                let mut duals: Vec<D> = self.variables.iter().map(|v| D::constant(*v)).collect();
                duals[..n].iter_mut().zip(&x).for_each(|(d, x)| d.value = *x);
                duals[n].value = t;
                duals[j].partials = [1.0];
                self.compiled.watched.evaluate(&duals, &mut out);
                *slope = out[place].partials[0];
            }
            let in_time = gradient.pop().unwrap_or(0.0);
            let terms: f64 = gradient.iter().zip(&field).map(|(g, f)| (g * f).abs()).sum::<f64>()
                + in_time.abs();
            let speed: f64 = gradient.iter().zip(&field).map(|(g, f)| g * f).sum::<f64>() + in_time;
            if !(speed.abs() > 1e-9 * terms)
                || self.only_touches(place, &gradient, &x, &field, speed)
            {
                return Err(self.no_tangents(
                    "a surface is only touched (grazing), where neighbours have no common linear \
                        motion",
                ));
            }
            let scaled: Vec<f64> = gradient.iter().map(|g| g / speed).collect();
            if let Some((other, s)) = &found {
                let other: Vec<f64> = other.iter().map(|g| g / s).collect();
                if self.part_ways(&other, &scaled) {
                    return Err(self.no_tangents(
                        "two surfaces are met at one moment, where neighbours have no common \
                            linear motion",
                    ));
                }
                continue;
            }
            found = Some((gradient, speed));
        }
        if let Some((gradient, speed)) = &found
            && self.meets_another(met, &field, gradient, *speed)
        {
            return Err(self.no_tangents(
                "two surfaces are met at one moment, where neighbours have no common linear motion",
            ));
        }
        Ok(Some(match found {
            Some((gradient, speed)) => Before { field, gradient, speed },
            // The field is continuous, or the time is fixed: nothing is met earlier or later by a
            // neighbour.
            None => Before { field, gradient: vec![0.0; n], speed: 1.0 },
        }))
    }

    /// Whether a function that the equations ask only beyond a surface that is met is zero there,
    /// too, and neighbours may meet it first.
    fn meets_another(
        &mut self,
        met: &[Sought],
        field: &[f64],
        gradient: &[f64],
        speed: f64,
    ) -> bool {
        let guard = |sought: &Sought| match *sought {
            Sought::Guard { guard, .. } => Some(guard),
            _ => None,
        };
        let mut zero: Vec<usize> = met.iter().filter_map(guard).collect();
        let known = zero.len();
        self.add_what_is_zero(&mut zero);
        let (t, x) = (self.t, self.x.clone());
        let differs = |other: usize| {
            let e = &self.equation.guards[other].expression;
            let slope = |j: usize| {
                let mut at: Vec<D> = x.iter().chain([&t]).map(|v| D::constant(*v)).collect();
                at[j].partials = [1.0];
                self.equation.value(e, at[self.n], &at[..self.n]).partials[0]
            };
            let slopes: Vec<f64> = (0..=self.n).map(slope).collect();
            let own: f64 =
                slopes.iter().zip(field).map(|(g, f)| g * f).sum::<f64>() + slopes[self.n];
            let per = |gradient: &[f64], speed: f64| -> Vec<f64> {
                gradient.iter().map(|g| g / speed).collect()
            };
            self.part_ways(&per(&slopes[..self.n], own), &per(gradient, speed))
        };
        let new: Vec<usize> = zero[known..].iter().copied().filter(|g| differs(*g)).collect();
        new.into_iter().any(|other| {
            let field = |follower: &mut Self, side: f64, own: f64| {
                let mut config = follower.config.clone();
                zero[..known].iter().for_each(|guard| config.sides[*guard] *= side);
                config.sides[other] = own;
                let mut out = vec![0.0; follower.n];
                let variables = follower.load(&config);
                follower.equation.compiled(&config).field.evaluate(&variables, &mut out);
                out
            };
            let (low, high) = (self.low(other), self.high(other));
            [1.0, -1.0]
                .iter()
                .any(|side| !super::same(&field(self, *side, low), &field(self, *side, high)))
        })
    }

    /// Whether two gradients, each by the speed of its function, differ where states have their
    /// sizes: neighbours meet the one and the other at different times.
    fn part_ways(&self, one: &[f64], other: &[f64]) -> bool {
        let in_size = |(g, size): (&f64, &f64)| g * if *size > 0.0 { *size } else { 1.0 };
        let times = |gradient: &[f64]| -> Vec<f64> {
            gradient.iter().zip(&self.size).map(in_size).collect()
        };
        let (one, other) = (times(one), times(other));
        let largest = one.iter().chain(&other).fold(0.0_f64, |most, g| most.max(g.abs()));
        let apart = |(a, b): (&f64, &f64)| !((a - b).abs() <= 1e-6 * largest);
        one.iter().zip(&other).any(apart)
    }

    /// Whether motion that meets a surface at this speed turns back behind it by no more than
    /// rounding: the depth is speed^2/(2 acceleration).
    fn only_touches(
        &self,
        place: usize,
        gradient: &[f64],
        x: &[f64],
        field: &[f64],
        speed: f64,
    ) -> bool {
        // Sliding ends where its field meets a surface, which it may do as slowly as it likes.
        if !self.sliding.is_empty() {
            return false;
        }
        let n = self.n;
        // Nothing was followed yet: nothing is known of the state's size.
        let Some(sizes) = self.tangents.as_ref().map(|t| &t.sizes).filter(|s| s.len() == n) else {
            return false;
        };
        let size: f64 = gradient.iter().zip(sizes).map(|(g, s)| g.abs() * s).sum();
        let shares = field.iter().zip(sizes).map(|(f, s)| f.abs() / s);
        let ahead = 1e-6 / shares.filter(|s| s.is_finite()).fold(f64::MIN_POSITIVE, f64::max);
        let mut there = self.variables.clone();
        (0..n).for_each(|i| there[i] = x[i] + ahead * field[i]);
        there[n] = self.t + ahead;
        let mut next = vec![0.0; n];
        self.compiled.field.evaluate(&there, &mut next);
        let acceleration = (Self::along(&self.compiled, &there, &next)[place] - speed) / ahead;
        speed * speed <= 2.0 * acceleration.abs() * 1e-14 * size
    }

    pub(super) fn no_tangents(&self, why: &str) -> HybridError {
        HybridError::Stuck {
            t: self.t,
            x: self.x.clone(),
            why: format!("tangent vectors end: {why}"),
        }
    }

    /// Neighbours come to sliding of higher order in a time like the root of their distance, in
    /// which they move others by as much as that distance, by either side.
    pub(super) fn no_tangents_in_higher_order(&self) -> HybridError {
        self.no_tangents(
            "the motion slides in higher order, where neighbours have no common linear motion",
        )
    }

    /// Notes the derivative of a reset, for tangent vectors, after those of this moment that were
    /// noted before.
    pub(super) fn note_reset(&mut self, set: &[(usize, Expression)], old: &[f64]) {
        if self.tangents.is_none() {
            return;
        }
        let n = self.n;
        let mut by_state = vec![0.0; n * n];
        (0..n).for_each(|i| by_state[i * n + i] = 1.0);
        let mut by_time = vec![0.0; n];
        let mut at: Vec<D> = old.iter().chain([&self.t]).map(|v| D::constant(*v)).collect();
        for j in 0..=n {
            at[j].partials = [1.0];
            for (state, e) in set {
                let slope_at = |at: &[D]| self.equation.value(e, at[n], &at[..n]).partials[0];
                let mut slope = slope_at(&at);
                // A derivative that is only rounding is none, as on a superstable orbit: another
                // rounding of the state changes much of it.
                let [to, from] = [self.size[*state], *self.size.get(j).unwrap_or(&0.0)];
                if slope != 0.0 && slope.abs() * from <= 1e-12 * to {
                    let near: Vec<D> = at
                        .iter()
                        .map(|x| D { value: x.value * (1.0 + 2.0 * f64::EPSILON), ..*x })
                        .collect();
                    if (slope_at(&near) - slope).abs() >= 0.25 * slope.abs() {
                        slope = 0.0;
                    }
                }
                *if j < n { &mut by_state[state * n + j] } else { &mut by_time[*state] } = slope;
            }
            at[j].partials = [0.0];
        }
        let mut hash = self.tangents.as_ref().map_or(0, |tangents| tangents.pieces);
        for (_, e) in set {
            self.equation.pieces(e, self.t, old, &mut |piece| hash = hashed(hash, piece as u64));
        }
        let Some(tangents) = &mut self.tangents else { return };
        tangents.pieces = hash;
        if let Some((first, first_by_time)) = &tangents.reset {
            let times = |column: &dyn Fn(usize) -> f64, i: usize| {
                (0..n).map(|k| by_state[i * n + k] * column(k)).sum::<f64>()
            };
            let both = (0..n * n).map(|at| times(&|k| first[k * n + at % n], at / n)).collect();
            let late = (0..n).map(|i| times(&|k| first_by_time[k], i) + by_time[i]).collect();
            (by_state, by_time) = (both, late);
        }
        tangents.reset = Some((by_state, by_time));
    }

    /// Multiplies the tangent vectors by the saltation matrix of what has been met.
    pub(super) fn after(&mut self, before: Option<Before>) -> Result<(), HybridError> {
        let Some(before) = before else { return Ok(()) };
        if !self.contacts.is_empty() {
            return Err(self.no_tangents("impacts accumulate and the motion rests on a surface"));
        }
        let n = self.n;
        let (t, x) = (self.t, self.x.clone());
        let mut field = vec![0.0; n];
        self.rhs(t, &x, &mut field);
        let Some(mut tangents) = self.tangents.take() else { return Ok(()) };
        let (by_state, by_time) = tangents.reset.take().unwrap_or_else(|| {
            let mut one = vec![0.0; n * n];
            (0..n).for_each(|i| one[i * n + i] = 1.0);
            (one, vec![0.0; n])
        });
        let times = |v: &[f64]| -> Vec<f64> {
            (0..n).map(|i| (0..n).map(|j| by_state[i * n + j] * v[j]).sum()).collect()
        };
        let moved = times(&before.field);
        let sizes = (tangents.sizes.len() == n).then_some(&tangents.sizes[..]);
        let jump = |i: usize| (field[i] - moved[i] - by_time[i]) / before.speed;
        let saltation: Vec<f64> =
            (0..n * n).map(|at| by_state[at] + jump(at / n) * before.gradient[at % n]).collect();
        tangents.flattened |= !has_inverse(&saltation, sizes.unwrap_or(&vec![1.0; n]));
        for y in &mut tangents.vectors {
            let later = before.gradient.iter().zip(y.iter()).map(|(g, y)| g * y).sum::<f64>()
                / before.speed;
            let new = times(y);
            for i in 0..n {
                y[i] = new[i] + (field[i] - moved[i] - by_time[i]) * later;
            }
        }
        self.tangents = Some(tangents);
        Ok(())
    }
}

/// Whether a matrix has an inverse, to rounding, in units of the states' sizes.
fn has_inverse(matrix: &[f64], sizes: &[f64]) -> bool {
    let n = sizes.len();
    let unit = |i: usize| if sizes[i] > 0.0 { sizes[i] } else { 1.0 };
    let mut rows: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| matrix[i * n + j] * (unit(j) / unit(i))).collect()).collect();
    for row in &mut rows {
        let largest = row.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        row.iter_mut().for_each(|v| *v /= largest);
    }
    for k in 0..n {
        let places = (k..n).flat_map(|i| (k..n).map(move |j| (i, j)));
        let size = |(i, j): &(usize, usize)| rows[*i][*j].abs();
        let Some((i, j)) = places.max_by(|a, b| size(a).total_cmp(&size(b))) else { break };
        if !(rows[i][j].abs() > FLAT) {
            return false;
        }
        rows.swap(k, i);
        rows.iter_mut().for_each(|row| row.swap(k, j));
        for i in k + 1..n {
            let factor = rows[i][k] / rows[k][k];
            for j in k..n {
                rows[i][j] -= factor * rows[k][j];
            }
        }
    }
    true
}

/// Pivots below this, in rows of size one, are rounding.
const FLAT: f64 = 1e-12;

/// Elimination with pivots on numbers that carry a derivative.
fn solve_duals<const P: usize>(
    mut a: Vec<Dual<f64, P>>,
    mut b: Vec<Dual<f64, P>>,
) -> Vec<Dual<f64, P>> {
    let k = b.len();
    for c in 0..k {
        let size = |i: &usize| a[*i * k + c].value.abs();
        let pivot = (c..k).max_by(|i, j| size(i).total_cmp(&size(j))).unwrap_or(c);
        (0..k).for_each(|j| a.swap(c * k + j, pivot * k + j));
        b.swap(c, pivot);
        for r in c + 1..k {
            let factor = a[r * k + c] / a[c * k + c];
            for j in c..k {
                let less = factor * a[c * k + j];
                a[r * k + j] -= less;
            }
            let less = factor * b[c];
            b[r] -= less;
        }
    }
    for r in (0..k).rev() {
        let mut sum = b[r];
        for j in r + 1..k {
            sum -= a[r * k + j] * b[j];
        }
        b[r] = sum / a[r * k + r];
    }
    b
}

/// Tangent vectors are carried by the stages of explicit steps.
pub(super) fn explicit(options: &Options) -> Result<(), HybridError> {
    if options.intersection != crate::selection::Intersection::Undecided {
        let why = "tangent vectors are not carried through mixtures that a rule chooses; leave \
            --intersection out";
        return Err(HybridError::Bad(why.into()));
    }
    match options.method {
        super::Method::Dopri5 => Ok(()),
        other => Err(HybridError::Bad(format!(
            "tangent vectors are carried by dopri5; leave --method {} out",
            other.name()
        ))),
    }
}

/// Lyapunov exponents.
#[derive(Clone, Debug, PartialEq)]
pub struct Exponents {
    /// The exponents, largest first, per unit time; minus infinity for directions that sliding
    /// takes away. Fewer than were asked for where a vector was not told from those before it.
    pub values: Vec<f64>,
    /// Half the width of a 95 % interval of each: the scatter of twenty parts of the run, or how
    /// far the growth swings about its line if that is more (in regular motion parts are alike, and
    /// the mean over no whole number of periods is off); what growth like a power of time adds; and
    /// the method's errors.
    pub errors: Vec<f64>,
    /// From when to when the mean was taken.
    pub times: (f64, f64),
}

/// Parts of a run from whose scatter errors follow.
const PARTS: usize = 20;
/// Student's t for 19 degrees of freedom, 95 %.
const STUDENT: f64 = 2.093;

/// The `count` largest Lyapunov exponents of the orbit from the start, after `transient`: Benettin,
/// Galgani, Giorgilli & Strelcyn (1980), with saltation matrices at every switch and reset.
///
/// # Errors
/// As [`follow`](super::follow); also where tangent vectors end: at a grazing, at two surfaces at
/// once, at rest after accumulated impacts.
pub fn exponents(
    model: &Model,
    options: &Options,
    transient: f64,
    count: usize,
) -> Result<Exponents, HybridError> {
    exponents_watched(model, options, transient, count, &|_| true)
}

/// [`exponents`], of a run that goes on as long as `reached` says so of the time.
///
/// # Errors
/// As [`exponents`]; also where it was ended.
pub fn exponents_watched(
    model: &Model,
    options: &Options,
    transient: f64,
    count: usize,
    reached: &dyn Fn(f64) -> bool,
) -> Result<Exponents, HybridError> {
    explicit(options)?;
    let begin = options.t_start + transient;
    if !(transient >= 0.0 && begin < options.t_end) {
        return Err(HybridError::Bad(format!(
            "the transient is {transient}: give a time from 0 to below the run's length"
        )));
    }
    let n = model.coordinates().len();
    let settings = Options { record: Record::Times { every: f64::INFINITY }, ..options.clone() };
    let mut follower = Follower::new(model, &settings)?;
    follower.reached = Some(reached);
    let unit = |i: usize| {
        let mut v = vec![0.0; n];
        v[i] = 1.0;
        v
    };
    // The first step carries all states' vectors, and has the units in which they are mixed.
    follower.begin_tangents((0..n).map(unit).collect())?;
    follower.growth = Some(Growth {
        begin,
        end: options.t_end,
        from: (transient == 0.0).then_some(begin),
        sums: vec![vec![0.0; PARTS]; count.min(n)],
        samples: vec![],
        every: 1,
        steps: 0,
        units: Vec::new(),
        told: count.min(n),
    });
    let (outcome, follower) = follower.run_whole(&mut |_| true)?;
    if outcome.ending != Ending::Finished {
        return Err(HybridError::Bad(format!(
            "the run ends at t = {}, before its end time, and there is no mean: end it before that \
                (--t-end)",
            outcome.t
        )));
    }
    let growth = follower.growth.ok_or_else(|| HybridError::Bad("there is no mean".into()))?;
    let part = (options.t_end - begin) / PARTS as f64;
    let mut found = Vec::new();
    if growth.told == 0 {
        return Err(HybridError::Bad("the tangent vector leaves the finite numbers".into()));
    }
    for (k, sums) in growth.sums.iter().enumerate().take(growth.told) {
        let rates: Vec<f64> = sums.iter().map(|s| s / part).collect();
        let from = growth.from.unwrap_or(begin);
        let mean = sums.iter().sum::<f64>() / (options.t_end - from);
        let half_width =
            if mean.is_finite() { growth.half_width(k, mean, &rates, part, options) } else { 0.0 };
        found.push((mean, half_width));
    }
    // Sliding takes away the direction that it takes away, whichever vector that is.
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (values, errors) = found.into_iter().unzip();
    Ok(Exponents { values, errors, times: (begin, options.t_end) })
}

/// The growth of tangent vectors, by parts of a run.
#[derive(Clone, Debug)]
pub(super) struct Growth {
    begin: f64,
    end: f64,
    from: Option<f64>,
    sums: Vec<Vec<f64>>,
    /// Times with the logarithms of the growth until then, after so many steps each.
    samples: Vec<(f64, Vec<f64>)>,
    every: u64,
    steps: u64,
    /// The units in which vectors are orthogonal, one over a state's; none until the first step.
    units: Vec<f64>,
    /// So many vectors have been told from those before them and from rounding.
    told: usize,
}

/// Sizes of states that differ by less than this factor have one unit.
const ONE_UNIT: f64 = 1e6;

/// One over the unit of each state, a power of two: its size in a motion with these bounds. Where
/// units differ very much, vectors that are orthogonal in the plain product are parallel to
/// rounding.
fn units(bounds: &[[f64; 2]]) -> Vec<f64> {
    let sizes: Vec<f64> = bounds.iter().map(|[a, b]| a.abs().max(b.abs())).collect();
    let moving = || sizes.iter().copied().filter(|s| *s > 0.0 && s.is_finite());
    let (low, high) = (moving().fold(f64::INFINITY, f64::min), moving().fold(0.0, f64::max));
    let unit = |size: &f64| {
        let mut unit = 1.0;
        if high > ONE_UNIT * low && *size > 0.0 && size.is_finite() {
            while unit * size >= 2.0 {
                unit *= 0.5;
            }
            while unit * size < 1.0 {
                unit *= 2.0;
            }
        }
        unit
    };
    sizes.iter().map(unit).collect()
}

/// Length of a vector, and of what is left of it beside those before.
struct Left {
    before: f64,
    after: f64,
}

/// The product of two vectors in these units.
fn product_in(units: &[f64], a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).zip(units).map(|((a, b), unit)| (a * unit) * (b * unit)).sum()
}

/// Makes vectors orthonormal in these units, one after the other. Those of which nothing is left
/// but rounding are made zero.
fn orthonormal(vectors: &mut [Vec<f64>], units: &[f64]) -> Vec<Left> {
    let product = |a: &[f64], b: &[f64]| product_in(units, a, b);
    let mut left = Vec::with_capacity(vectors.len());
    for i in 0..vectors.len() {
        let (done, open) = vectors.split_at_mut(i);
        let y = &mut open[0];
        let before = product(y, y).sqrt();
        for other in done.iter() {
            let dot = product(other, y);
            y.iter_mut().zip(other).for_each(|(y, o)| *y -= dot * o);
        }
        let after = product(y, y).sqrt();
        if after > 1e-13 * before {
            y.iter_mut().for_each(|v| *v /= after);
        } else {
            y.fill(0.0);
        }
        left.push(Left { before, after });
    }
    left
}

/// Images of `count` vectors that are orthonormal in these units and have a part of every state,
/// given those of the states' unit vectors. A fixed random set: directions that a symmetry or a
/// zero of the equations keeps apart are in none.
fn mixed(images: &[Vec<f64>], units: &[f64], count: usize) -> Vec<Vec<f64>> {
    let n = units.len();
    let mut random = RandomStream::new(0x1980, 0);
    let mut set: Vec<Vec<f64>> =
        (0..count).map(|_| (0..n).map(|_| random.normal()).collect()).collect();
    orthonormal(&mut set, &vec![1.0; n]);
    let sum = |parts: &Vec<f64>| {
        let part = |i: usize| -> f64 {
            parts.iter().zip(images).zip(units).map(|((q, y), unit)| q / unit * y[i]).sum()
        };
        (0..n).map(part).collect()
    };
    set.iter().map(sum).collect()
}

/// Most samples of the growth that are kept.
const MOST_SAMPLES: usize = 4096;

impl Growth {
    /// Half of the interval about the mean of the vector `k`.
    fn half_width(&self, k: usize, mean: f64, rates: &[f64], part: f64, options: &Options) -> f64 {
        let (length, parts) = (self.end - self.begin, PARTS as f64);
        let variance = rates.iter().map(|r| (r - mean) * (r - mean)).sum::<f64>() / (parts - 1.0);
        let scatter = STUDENT * (variance / parts).sqrt();
        let residuals = self.samples.iter().map(|(t, sums)| sums[k] - mean * (t - self.begin));
        let [low, high] = residuals.fold([0.0_f64; 2], |[low, high], r| [low.min(r), high.max(r)]);
        // ln |v| = mean t + power ln t: the parts' rates against the means of 1/t.
        let points = rates.iter().enumerate().filter_map(|(i, rate)| {
            let from = self.begin - options.t_start + part * i as f64;
            (from > 0.0).then(|| (ln((from + part) / from) / part, *rate))
        });
        let fitted = line(&points.collect::<Vec<_>>()).filter(|l| l.slope.abs() > l.slope_error);
        let slow = fitted.map_or(0.0, |l| (mean - l.intercept).abs());
        let method = TANGENT_TOLERANCE.max(options.rtol) * self.steps as f64 / length;
        let width = scatter.max((high - low) / length) + slow + method;
        // Growth by less than ten for each step that is little in all, or slows down, may be that
        // of a power of the time, as between neighbours that turn at different speeds.
        const LITTLE: f64 = 3.0;
        const SLOWS: f64 = 0.75;
        let (first, second) = rates.split_at(rates.len() / 2);
        let slows = second.iter().sum::<f64>() < SLOWS * first.iter().sum::<f64>();
        let total = mean * length;
        let may_be_slow =
            total > 0.0 && total <= ln(10.0 * self.steps as f64) && (total <= LITTLE || slows);
        if may_be_slow { width.max(mean) } else { width }
    }

    /// Keeps a sample, and of too many every other one.
    fn sample(&mut self, t: f64) {
        self.steps += 1;
        if self.steps.is_multiple_of(self.every) {
            self.samples.push((t, self.sums.iter().map(|sums| sums.iter().sum()).collect()));
        }
        if self.samples.len() > MOST_SAMPLES {
            let mut even = false;
            self.samples.retain(|_| {
                even = !even;
                even
            });
            self.every *= 2;
        }
    }
}

impl Follower<'_> {
    /// Makes the tangent vectors orthonormal again and notes by how much they grew until `t`.
    pub(super) fn note_growth(&mut self, t: f64) {
        let (Some(growth), Some(tangents)) = (&mut self.growth, &mut self.tangents) else { return };
        let part = ((t - growth.begin) / (growth.end - growth.begin) * PARTS as f64)
            .clamp(0.0, PARTS as f64 - 1.0) as usize;
        // A motion that begins at zero has its sizes later: units follow it up to the mean.
        let settles = growth.from.is_none();
        let begins = growth.units.is_empty();
        if begins || settles {
            growth.units = units(&tangents.bounds);
        }
        if begins {
            tangents.vectors = mixed(&tangents.vectors, &growth.units, growth.sums.len());
        }
        let is_free = self.sliding.is_empty() && self.contacts.is_empty();
        let flattened = std::mem::take(&mut tangents.flattened);
        let left = orthonormal(&mut tangents.vectors, &growth.units);
        for (i, Left { before, after }) in left.iter().enumerate() {
            let gone = !(*after > 1e-13 * before);
            if growth.from.is_some() {
                growth.sums[i][part] += if gone { f64::NEG_INFINITY } else { ln(*after) };
            }
            // Sliding has taken this direction away, or has done so before.
            if gone && !flattened && *before != 0.0 && !(settles && is_free) {
                growth.told = growth.told.min(i);
            }
        }
        if growth.from.is_some() {
            growth.sample(t);
        }
        // The mean begins with the first step that ends after the transient.
        if t >= growth.begin && growth.from.is_none() {
            growth.from = Some(t);
            // A direction that sliding or rounding took away in the transient may be there again.
            if is_free {
                fill_up(&mut tangents.vectors, &growth.units);
            }
        }
    }
}

/// Puts unit vectors of the states, made orthonormal in these units to all others, in the place of
/// vectors that are zero.
fn fill_up(vectors: &mut [Vec<f64>], units: &[f64]) {
    let product = |a: &[f64], b: &[f64]| product_in(units, a, b);
    for i in 0..vectors.len() {
        if vectors[i].iter().any(|v| *v != 0.0) {
            continue;
        }
        let candidates = (0..units.len()).map(|state| {
            let mut new = vec![0.0; units.len()];
            new[state] = 1.0 / units[state];
            for other in vectors.iter().chain(vectors.iter()) {
                let dot = product(other, &new);
                new.iter_mut().zip(other).for_each(|(v, o)| *v -= dot * o);
            }
            let length = product(&new, &new).sqrt();
            new.iter_mut().for_each(|v| *v /= length);
            (length, new)
        });
        if let Some((_, new)) = candidates.max_by(|a, b| a.0.total_cmp(&b.0)) {
            vectors[i] = new;
        }
    }
}

/// When an orbit has closed.
#[derive(Clone, Debug, PartialEq)]
pub enum Return {
    /// After this time: a system with this period.
    Period(f64),
    /// At the n-th rising crossing of the section in [`Options::record`].
    Crossings(usize),
}

/// A closed orbit.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedOrbit {
    /// A state on it.
    pub x: Vec<f64>,
    /// The mode there.
    pub mode: usize,
    /// Its period.
    pub period: f64,
    /// Its Floquet multipliers, largest first (real and imaginary parts); of an autonomous system
    /// without the one that is 1.
    pub multipliers: Vec<[f64; 2]>,
    /// Where one is close to 1: ten times as much as those of ten times the tolerance differ; else
    /// 0.
    pub multiplier_error: f64,
    /// Closure error after one period, in units of its states' largest size.
    pub gap: f64,
    /// The largest distance of a state from where the search began, in units of its size.
    pub moved: f64,
    /// Whether it is a point to rounding of the way that the search went, and not an orbit.
    pub is_point: bool,
}

/// A way around that is shorter than this part of a search's way is none.
const POINT: f64 = 1e-3;

/// A gap, in units of the states' largest size, that may be the integration's error, and one at
/// which Newton's method ends.
const CLOSED: f64 = 1e-8;
const WELL_CLOSED: f64 = 1e-11;
/// Largest gaps of an orbit that is well closed, of each state's way and of the states' largest
/// size; a size counts up to `OFF` times that on the search's first turn.
const OF_WAY: f64 = 1e-6;
const OF_SIZE: f64 = 1e-12;
const OFF: f64 = 100.0;
/// States smaller than this part of what they were before are not told from rounding.
const OF_FORMER: f64 = 1e-3;
/// A search that comes to states so many times as large is given up.
const FAR_OFF: f64 = 1e8;
/// A multiplier's distance from 1 that may be.
const NOT_ISOLATED: f64 = 1e-6;
/// A multiplier's distance from 1 within which its error is looked at.
const NEAR_ONE: f64 = 1e-2;

/// The distance of two complex numbers.
pub(crate) fn apart(a: &[f64; 2], b: &[f64; 2]) -> f64 {
    let [re, im] = [a[0] - b[0], a[1] - b[1]];
    sqrt(re * re + im * im)
}

/// The largest difference of two states, in units of the sizes within these bounds. What is zero to
/// rounding beside the others has no size.
fn moved(from: &[f64], to: &[f64], bounds: &[[f64; 2]], least: f64) -> f64 {
    const ROUNDED: f64 = 1e-6;
    let sizes: Vec<f64> = bounds.iter().map(|[low, high]| low.abs().max(high.abs())).collect();
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let far =
        (0..to.len()).map(|i| (from[i] - to[i]).abs() / sizes[i].max(ROUNDED * largest).max(least));
    far.filter(|share| share.is_finite()).fold(0.0, f64::max)
}

/// The Floquet multipliers of a return map's derivative, by falling modulus.
fn multipliers_of(matrix: &[f64], n: usize, after: &Return) -> Vec<[f64; 2]> {
    let mut multipliers = eigenvalues(matrix, n).unwrap_or_default();
    let square = |m: &[f64; 2]| m[0] * m[0] + m[1] * m[1];
    multipliers.sort_by(|a, b| square(b).total_cmp(&square(a)));
    if let Return::Crossings(_) = after {
        // The return map has an eigenvalue 0 along the field, which is none of the orbit's.
        multipliers.pop();
    }
    multipliers
}

/// Finds a closed orbit near the start of `options` by Newton's method on the return map, whose
/// derivative is carried along with saltation matrices. `former` is the largest size of a state
/// before the motion settled, or zero: what is small beside it is known to the error of its run.
///
/// # Errors
/// As [`follow`](super::follow); also if there is no return, or the iteration does not settle.
pub fn closed_orbit(
    model: &Model,
    options: &Options,
    after: &Return,
    former: f64,
) -> Result<ClosedOrbit, HybridError> {
    explicit(options)?;
    let mut options = options.clone();
    let n = model.coordinates().len();
    let mut x = match &options.start {
        Some(x) => x.clone(),
        None => model.start().map_err(crate::equation::EquationError::from)?.unwrap_or_default(),
    };
    if let Return::Crossings(_) = after {
        // The search begins on the section.
        let first = turn(model, &options, &Return::Crossings(1), &x, false)?;
        (x, options.mode) = (first.end, first.mode);
    }
    let began = x.clone();
    let mut best: Option<(f64, ClosedOrbit)> = None;
    // The largest size of a state on the first turn.
    let mut usual = f64::NAN;
    let gap_of = |best: &Option<(f64, _)>| best.as_ref().map_or(f64::INFINITY, |best| best.0);
    for iteration in 0..30 {
        let around = turn(model, &options, after, &x, true).map_err(|error| match error {
            // The state that it has come to is none of the motion asked for.
            HybridError::NoOrbit(_) | HybridError::Domain { .. } if iteration > 0 => {
                let off = gap_of(&best);
                HybridError::NoOrbit(format!(
                    "Newton's method found no closed orbit (the best return was {off:e} off): it \
                        went on to states from which the motion does not come back. Start nearer \
                        (--start), let the motion settle longer (--settle), or give states that \
                        come back: an angle that turns on and on does not"
                ))
            }
            other => other,
        })?;
        let Turn { time, end, mode, matrix, size, bounds, .. } = around;
        // The same state in another mode is another point.
        if mode != options.mode {
            (x, options.mode) = (end, mode);
            continue;
        }
        let gap: Vec<f64> = end.iter().zip(&x).map(|(e, x)| e - x).collect();
        let largest = gap.iter().fold(0.0_f64, |most, gap| most.max(gap.abs()));
        let size = size.max(OF_FORMER * former);
        let of_size = largest / size.max(f64::MIN_POSITIVE);
        // Motion that drifts is not closed because it has come far: each state comes back to a
        // share of its way, or to rounding of what states were at first.
        if usual.is_nan() {
            usual = size;
        }
        let rounding = OF_SIZE * size.min(OFF * usual);
        let misses = gap.iter().zip(&bounds).map(|(gap, [low, high])| {
            gap.abs() / (OF_WAY * (high - low)).max(rounding).max(f64::MIN_POSITIVE)
        });
        let off = of_size.max(WELL_CLOSED * misses.fold(0.0, f64::max));
        if off >= gap_of(&best)
            && gap_of(&best) <= CLOSED
            && let Some((_, best)) = best
        {
            // As near as rounding lets it come. Where orbits are not isolated the next step may
            // lead anywhere.
            return Ok(best);
        }
        if off < gap_of(&best) {
            let multipliers = multipliers_of(&matrix, n, after);
            let lengths = bounds.iter().map(|[low, high]| high - low);
            let way = began.iter().zip(&x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let mut found = ClosedOrbit {
                is_point: lengths.fold(0.0, f64::max) <= POINT * way,
                x: x.clone(),
                mode,
                period: time,
                multipliers,
                multiplier_error: 0.0,
                gap: of_size,
                moved: moved(&began, &x, &bounds, OF_FORMER * former),
            };
            // Where a multiplier is 1 within its error, orbits beside are closed, too: a step of
            // Newton's method would be one error over another one.
            let from_one = found.multipliers.iter().map(|m| apart(m, &[1.0, 0.0]));
            let from_one = from_one.fold(f64::INFINITY, f64::min);
            if off <= CLOSED && from_one <= NEAR_ONE {
                let looser = Options {
                    rtol: 10.0 * options.rtol,
                    atol: options.atol.map(|atol| 10.0 * atol),
                    ..options.clone()
                };
                if let Ok(rough) = turn(model, &looser, after, &x, true) {
                    let rough = multipliers_of(&rough.matrix, n, after);
                    let pairs = found.multipliers.iter().zip(&rough);
                    // One sample of the error.
                    found.multiplier_error =
                        10.0 * pairs.map(|(a, b)| apart(a, b)).fold(0.0, f64::max);
                }
            }
            let fills = from_one <= found.multiplier_error.max(NOT_ISOLATED);
            if off <= WELL_CLOSED || fills && off <= CLOSED {
                return Ok(found);
            }
            best = Some((off, found));
        }
        let mut system = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                system[i * n + j] = f64::from(u8::from(i == j)) - matrix[i * n + j];
            }
        }
        let Some(change) = solve_any(&system, &gap, 0.0) else { break };
        x.iter_mut().zip(&change).for_each(|(x, c)| *x += c);
        let largest = x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        if largest > FAR_OFF * usual {
            break;
        }
    }
    Err(HybridError::NoOrbit(format!(
        "Newton's method found no closed orbit (the best return was {:e} off): start nearer \
            (--start), let the motion settle longer (--settle), or give the number of turns after \
            which it closes (--returns)",
        gap_of(&best)
    )))
}

/// Once around.
#[derive(Clone, Debug)]
pub struct Turn {
    /// The time it took.
    pub time: f64,
    /// The state then.
    pub end: Vec<f64>,
    /// The mode then.
    pub mode: usize,
    /// The derivative of the return map, row by row. Of a section it has an eigenvalue 0 along the
    /// field.
    pub matrix: Vec<f64>,
    /// The largest size of a state on the way.
    pub size: f64,
    /// Bounds of each state on the way.
    pub bounds: Vec<[f64; 2]>,
    /// A number that tells it from a way with other events: of switches and events, and of the
    /// sides that the motion is on and the pieces of resets that act, hashed.
    pub itinerary: usize,
    /// Steps on the way.
    pub steps: u64,
}

/// Follows motion from `x` until it is back; of a section from the point on it that is next to `x`
/// along its gradient.
///
/// # Errors
/// As [`follow`](super::follow); also if there is no return.
pub fn once_around(
    model: &Model,
    options: &Options,
    after: &Return,
    x: &[f64],
) -> Result<Turn, HybridError> {
    explicit(options)?;
    let (n, mut x) = (x.len(), x.to_vec());
    let Return::Crossings(_) = after else { return turn(model, options, after, &x, true) };
    let settings = Options { start: Some(x.clone()), ..options.clone() };
    let mut follower = Follower::new(model, &settings)?;
    let off = follower.watched_values();
    let place = off.len() - 1;
    let gradient = follower.gradient(options.t_start, place);
    let square: f64 = gradient.iter().map(|g| g * g).sum();
    x.iter_mut().zip(&gradient).for_each(|(x, g)| *x -= off[place] * g / square);
    let mut turn = turn(model, options, after, &x, true)?;
    for row in turn.matrix.chunks_mut(n) {
        let along: f64 = row.iter().zip(&gradient).map(|(m, g)| m * g).sum::<f64>() / square;
        row.iter_mut().zip(&gradient).for_each(|(m, g)| *m -= along * g);
    }
    Ok(turn)
}

/// `on_section`: the start is on the section, whatever rounding says.
fn turn(
    model: &Model,
    options: &Options,
    after: &Return,
    x: &[f64],
    on_section: bool,
) -> Result<Turn, HybridError> {
    let n = x.len();
    let mut settings = Options { start: Some(x.to_vec()), ..options.clone() };
    let mut wanted = usize::MAX;
    match after {
        Return::Period(period) => {
            settings.t_end = settings.t_start + period;
            settings.record = Record::Times { every: f64::INFINITY };
        }
        Return::Crossings(count) => wanted = *count,
    }
    let mut follower = Follower::new(model, &settings)?;
    if on_section && matches!(after, Return::Crossings(_)) {
        follower.begin_watching(follower.equation.watched.len() - 1, true, false);
    }
    let unit = |j: usize| {
        let mut v = vec![0.0; n];
        v[j] = 1.0;
        v
    };
    follower.begin_tangents((0..n).map(unit).collect())?;
    let mut crossings = 0;
    let (outcome, mut follower) = follower.run_whole(&mut |point| {
        crossings += usize::from(point.direction.is_some_and(|d| d > 0.0));
        crossings < wanted
    })?;
    let back = match after {
        Return::Period(_) => outcome.ending == Ending::Finished,
        Return::Crossings(_) => crossings >= wanted,
    };
    if !back {
        let another = "give another section (--section) or start (--start)";
        let (ending, advice) = match &outcome.ending {
            Ending::Stopped(event) => (format!("where {event} ends the run"), another.to_owned()),
            Ending::Zeno { event, .. } => {
                (format!("where {event} accumulates"), another.to_owned())
            }
            Ending::Finished | Ending::Interrupted => (
                "and is not followed further".to_owned(),
                format!("follow it longer (--longest-return), or {another}"),
            ),
        };
        let why = format!(
            "the orbit does not come back to the section by t = {}, state {:?}, {ending}: {advice}",
            Short(outcome.t),
            outcome.x
        );
        return Err(HybridError::NoOrbit(why));
    }
    let Tangents { vectors, bounds, pieces, sides, .. } =
        follower.tangents.take().unwrap_or_default();
    if !vectors.iter().flatten().all(|v| v.is_finite()) {
        return Err(follower.no_tangents("their motion has no finite derivative"));
    }
    // In whatever order: where a period begins they are as many.
    let of_sides = |signs: &String| signs.bytes().fold(0, |hash, b| hashed(hash, u64::from(b)));
    let on = sides.iter().map(of_sides).fold(0, u64::wrapping_add);
    let mut matrix = vec![0.0; n * n];
    for (j, column) in vectors.iter().enumerate() {
        for i in 0..n {
            matrix[i * n + j] = column[i];
        }
    }
    if let Return::Crossings(_) = after {
        let section = follower.equation.watched.len() - 1;
        follower.tangents = Some(Tangents::default());
        // Neighbours come back at other times: what is along the field goes.
        if let Some(Before { gradient, field, .. }) =
            follower.before(&[Sought::Watched(section)])?
        {
            let speed: f64 = gradient.iter().zip(&field).map(|(g, f)| g * f).sum();
            for j in 0..n {
                let late: f64 =
                    (0..n).map(|i| gradient[i] * matrix[i * n + j]).sum::<f64>() / speed;
                (0..n).for_each(|i| matrix[i * n + j] -= field[i] * late);
            }
        }
    }
    Ok(Turn {
        time: outcome.t - settings.t_start,
        end: outcome.x,
        mode: outcome.mode,
        matrix,
        size: follower.size.iter().fold(0.0_f64, |most, s| most.max(*s)),
        bounds,
        steps: outcome.steps,
        itinerary: (outcome.switches + outcome.events).wrapping_add(pieces).wrapping_add(on)
            as usize,
    })
}
