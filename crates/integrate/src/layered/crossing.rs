//! A layer that is crossed: the states as functions of its variable, by collocation in all its
//! parts at once.

use nalgebra::SVector;
use pulp::bytemuck::cast_slice;
use pulp::{Simd, WithSimd};

use super::gauss::{self, Gauss, STAGES, Stages};
use crate::{Interpolant, Tolerance};
use twofold_num::elementary::tanh;
use twofold_num::{Given, Registers};
use twofold_system::VectorField;

/// Number of parts of a layer that are computed side by side.
pub(super) const PARTS: usize = 8;

/// A number for each part.
type Parts = [f64; PARTS];

/// Most fixed-point iterations.
const SWEEPS: usize = 14;

/// The stage whose states are looked at to see whether they still move.
const MIDDLE: usize = STAGES / 2;

/// Never a part so short, in u, unless it is the last.
const LEAST: f64 = 1e-2;

/// A layer whose variable is a sum of states.
#[derive(Clone)]
pub(super) struct Layer<const N: usize> {
    pub gradient: SVector<f64, N>,
    /// u at x = 0.
    pub constant: f64,
    /// Boundaries of the parts, from one edge to the other.
    points: Vec<f64>,
    /// The way from edge to edge.
    known: Vec<Section>,
}

/// Neighbouring parts on the way of v from -edge to edge, where v is u or, downwards, -u: the same
/// numbers both ways, since tanh is odd.
#[derive(Clone, Default)]
pub(super) struct Section {
    /// Start of the section; its end follows.
    pub from: f64,
    pub to: f64,
    count: usize,
    starts: Parts,
    /// Half of each part's length; of lanes that have no part, zero.
    halves: Parts,
    /// tanh v at the nodes of each.
    tanh: [Parts; STAGES],
}

impl Section {
    /// The parts between neighbouring `points`: at most [`PARTS`], at least one.
    fn new(points: &[f64]) -> Self {
        let count = (points.len() - 1).min(PARTS);
        let mut section = Self { from: points[0], to: points[count], count, ..Self::default() };
        for part in 0..PARTS {
            let (from, to) = if part < count {
                (points[part], points[part + 1])
            } else {
                (section.to, section.to)
            };
            section.starts[part] = from;
            section.halves[part] = 0.5 * (to - from);
            for (j, there) in stages(from, to).iter().enumerate() {
                section.tanh[j][part] = tanh(*there);
            }
        }
        section
    }
}

/// The nodes of the part from `from` to `to`.
fn stages(from: f64, to: f64) -> Stages {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    Gauss::get().nodes.map(|node| middle + half * node)
}

impl<const N: usize> Layer<N> {
    /// The layer between -`edge` and `edge`, in parts on which tanh alone lets the collocation be
    /// as exact as is wanted.
    pub fn new(gradient: SVector<f64, N>, constant: f64, edge: f64, atol: f64) -> Self {
        let gauss = Gauss::get();
        // A unit of u in units of the state.
        let width = 1.0 / gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        let good = |from: f64, to: f64| {
            let rough = 0.5 * gauss.roughness(&stages(from, to).map(tanh));
            width * 0.5 * (to - from) * (rough * rough).max(rough * gauss::BETWEEN) <= 0.2 * atol
        };
        let mut half = vec![0.0];
        let mut from = 0.0;
        while from < edge {
            let mut to = edge;
            while !good(from, to) && to - from > 0.1 {
                to = from + 0.85 * (to - from);
            }
            half.push(to);
            from = to;
        }
        let points: Vec<f64> =
            half[1..].iter().rev().map(|p| -p).chain(half.iter().copied()).collect();
        let known = (0..points.len() - 1)
            .step_by(PARTS)
            .map(|first| Section::new(&points[first..]))
            .collect();
        Self { gradient, constant, points, known }
    }

    /// The next parts of the way from `v`, each halved so many times, and made in `place` unless
    /// they are known.
    pub fn section<'a>(&'a self, v: f64, halvings: u32, place: &'a mut Section) -> &'a Section {
        if halvings == 0
            && let Some(known) = self.known.iter().find(|known| known.from == v)
        {
            return known;
        }
        let pieces = 1 << halvings;
        let mut points = vec![v];
        for next in self
            .points
            .iter()
            .copied()
            .filter(|p| *p > v + LEAST)
            .chain(self.points.last().copied())
        {
            let last = points[points.len() - 1];
            if next <= last || points.len() > PARTS {
                break;
            }
            points.extend(
                (1..pieces).map(|i| last + (next - last) * f64::from(i) / f64::from(pieces)),
            );
            points.push(next);
        }
        *place = Section::new(&points);
        place
    }

    /// Edge of the layer, in units of u.
    pub fn edge(&self) -> f64 {
        self.points[self.points.len() - 1]
    }
}

/// Parts of a layer that were gone through: x and t as functions of v.
#[derive(Clone)]
pub(super) struct Crossing<const N: usize> {
    count: usize,
    /// v where each part begins, and half its length.
    from: Parts,
    halves: Parts,
    /// The state there.
    states: [Parts; N],
    /// The time there since the start, and at the end.
    times: [f64; PARTS + 1],
    /// dx/dv and dt/dv at the nodes.
    slopes: [[Parts; STAGES]; N],
    rates: [Parts; STAGES],
    /// The state at the end.
    pub end: SVector<f64, N>,
    /// The step's length in time.
    pub duration: f64,
}

impl<const N: usize> Crossing<N> {
    pub fn none() -> Self {
        Self {
            count: 0,
            from: [0.0; PARTS],
            halves: [0.0; PARTS],
            states: [[0.0; PARTS]; N],
            times: [0.0; PARTS + 1],
            slopes: [[[0.0; PARTS]; STAGES]; N],
            rates: [[0.0; PARTS]; STAGES],
            end: SVector::zeros(),
            duration: 0.0,
        }
    }

    /// The time that all parts take.
    pub fn whole(&self) -> f64 {
        self.times[self.count]
    }

    /// In which part, and where in it, from -1 to 1, the time `elapsed` has passed.
    fn position(&self, elapsed: f64) -> (usize, f64) {
        let part = (1..self.count).rev().find(|part| self.times[*part] <= elapsed).unwrap_or(0);
        let rate = Gauss::get().coefficients(&self.rates.map(|rate| rate[part]));
        let (half, elapsed) = (self.halves[part], elapsed - self.times[part]);
        let (mut low, mut high) = (-1.0, 1.0);
        let whole = half * gauss::integral(&rate, 1.0);
        let mut s = (2.0 * (elapsed / whole) - 1.0).clamp(low, high);
        for _ in 0..60 {
            let excess = half * gauss::integral(&rate, s) - elapsed;
            if excess > 0.0 {
                high = s;
            } else {
                low = s;
            }
            let step = excess / (half * gauss::sum(&rate, s));
            let next =
                if (low..=high).contains(&(s - step)) { s - step } else { 0.5 * (low + high) };
            if (next - s).abs() <= 4.0 * f64::EPSILON {
                s = next;
                break;
            }
            s = next;
        }
        (part, s)
    }

    fn component(&self, i: usize, (part, s): (usize, f64)) -> f64 {
        let slopes = Gauss::get().coefficients(&self.slopes[i].map(|slope| slope[part]));
        self.states[i][part] + self.halves[part] * gauss::integral(&slopes, s)
    }

    /// v and the state where the time `elapsed` has passed.
    pub fn after(&self, elapsed: f64) -> (f64, SVector<f64, N>) {
        let place = self.position(elapsed);
        let v = self.from[place.0] + self.halves[place.0] * (place.1 + 1.0);
        (v, SVector::from_fn(|i, _| self.component(i, place)))
    }
}

impl<const N: usize> Interpolant<N> for Crossing<N> {
    fn at(&self, theta: f64) -> SVector<f64, N> {
        self.after(theta * self.duration).1
    }
    fn coordinate(&self, theta: f64, i: usize) -> f64 {
        self.component(i, self.position(theta * self.duration))
    }
    /// As many places are worth looking at.
    fn degree(&self) -> usize {
        STAGES * self.count
    }
    /// The length of the way at most.
    fn reach(&self, coordinate: usize) -> f64 {
        let mut fastest = [0.0_f64; PARTS];
        for slopes in &self.slopes[coordinate] {
            for (most, slope) in fastest.iter_mut().zip(slopes) {
                *most = most.max(slope.abs());
            }
        }
        let way: f64 = fastest.iter().zip(&self.halves).map(|(fastest, half)| fastest * half).sum();
        2.0 * way * Gauss::get().lebesgue
    }
}

/// A crossing to compute, all parts side by side in the machine's own instructions: each lane
/// rounds by itself, so that they change no bit.
pub(super) struct Collocation<'a, F, const N: usize> {
    pub field: &'a F,
    pub layer: &'a Layer<N>,
    pub section: &'a Section,
    /// Whether u grows.
    pub direction: f64,
    pub tolerance: Tolerance,
    pub x0: SVector<f64, N>,
    /// The field for tanh = -1 and +1 somewhere near: for a first guess.
    pub ends: &'a [SVector<f64, N>; 2],
    pub crossing: &'a mut Crossing<N>,
}

/// A task for `K` registers.
struct In<T, const K: usize>(T);

impl<F: VectorField<N>, const N: usize> Collocation<'_, F, N> {
    /// Solves for the crossing; returns whether it succeeded and the number of evaluations. It
    /// fails if the orbit turns back, the iteration does not converge, or the error is too large.
    pub fn solve(self) -> (bool, u64) {
        // All parts are in one register, two, or one each.
        #[cfg(target_arch = "x86_64")]
        if let Some(set) = pulp::x86::V4::try_new() {
            return Simd::vectorize(set, In::<_, 1>(self));
        } else if let Some(set) = pulp::x86::V3::try_new() {
            return Simd::vectorize(set, In::<_, 2>(self));
        }
        In::<_, PARTS>(self).with_simd(pulp::Scalar)
    }
}

impl Gauss {
    /// The integral of component `i`'s slopes from each part's start to stage `j`, for parts that
    /// are as long as they are for [`Gauss`].
    #[allow(clippy::needless_range_loop)]
    #[inline(always)]
    fn along<S: Simd, const N: usize, const K: usize>(
        &self,
        set: S,
        slopes: &[[[S::f64s; K]; N]; STAGES],
        i: usize,
        j: usize,
    ) -> Registers<S, K> {
        let mut sum =
            Registers::splat(set, self.integrals[0][j]) * Registers::new(set, slopes[0][i]);
        for m in 1..STAGES {
            sum += Registers::splat(set, self.integrals[m][j]) * Registers::new(set, slopes[m][i]);
        }
        sum
    }
}

impl<F: VectorField<N>, const N: usize, const K: usize> WithSimd for In<Collocation<'_, F, N>, K> {
    type Output = (bool, u64);

    // Loops by number: iterators and closures may stay calls, compiled for the wrong instruction
    // set.
    #[allow(clippy::needless_range_loop)]
    #[inline(always)]
    fn with_simd<S: Simd>(self, set: S) -> Self::Output {
        let Collocation { field, layer, section, direction, tolerance, x0, ends, crossing } =
            self.0;
        let gauss = Gauss::get();
        let number = |value: f64| Registers::<S, K>::splat(set, value);
        let lanes = |values: &Parts| Registers::<S, K>::load(set, values);
        let bare = |number: Registers<S, K>| {
            let mut values = [0.0; PARTS];
            values.copy_from_slice(cast_slice::<_, f64>(&number.parts()));
            values
        };
        let zero = number(0.0);
        let half = lanes(&section.halves);
        let scale = x0.map(|x| 1.0 / (tolerance.atol + tolerance.rtol * x.abs()));
        // Kept values are bare arrays: numbers that know their instruction set are larger.
        let full = |parts| Registers::<S, K>::new(set, parts);
        let mut tanh = [zero.parts(); STAGES];
        for j in 0..STAGES {
            tanh[j] = (lanes(&section.tanh[j]) * number(direction)).parts();
        }
        let mut states = [[zero.parts(); N]; STAGES];
        let mut slopes = [[zero.parts(); N]; STAGES];
        let mut rates = [zero.parts(); STAGES];
        // Beginning and end of each part.
        let (mut first, mut last) = ([zero.parts(); N], [zero.parts(); N]);
        let (mut evaluations, mut before) = (2, f64::NAN);
        for sweep in 0..SWEEPS {
            let mut forward = number(1.0);
            for j in 0..STAGES {
                let mut f = [zero; N];
                if sweep == 0 {
                    // As if the state did not change, and only tanh did.
                    for i in 0..N {
                        let (low, high) = (ends[0][i], ends[1][i]);
                        f[i] =
                            number(0.5 * (low + high)) + number(0.5 * (high - low)) * full(tanh[j]);
                    }
                } else {
                    let mut x = SVector::<_, N>::from_element(Given::new(zero, full(tanh[j])));
                    for i in 0..N {
                        x[i] = Given::new(full(states[j][i]), full(tanh[j]));
                    }
                    let given = field.eval(&x);
                    for i in 0..N {
                        f[i] = given[i].value();
                    }
                }
                let mut speed = number(layer.gradient[0] * direction) * f[0];
                for i in 1..N {
                    speed += number(layer.gradient[i] * direction) * f[i];
                }
                let rate = number(1.0) / speed;
                forward = zero.less(rate, set).select(forward, zero);
                rates[j] = rate.parts();
                for i in 0..N {
                    slopes[j][i] = (f[i] * rate).parts();
                }
            }
            evaluations += if sweep == 0 { 0 } else { (STAGES * section.count) as u64 };
            // Time goes on everywhere.
            if forward.less(number(0.5), set).any() {
                return (false, evaluations);
            }
            // Displacement of the parts' ends, and a state in the middle of each.
            let (mut moved, mut no_number) = (zero, zero);
            for i in 0..N {
                let mut increment = number(gauss.weights[0]) * full(slopes[0][i]);
                for j in 1..STAGES {
                    increment += number(gauss.weights[j]) * full(slopes[j][i]);
                }
                let increments = bare(increment * half);
                let (mut sum, mut from, mut to) = (x0[i], [0.0; PARTS], [0.0; PARTS]);
                for part in 0..PARTS {
                    from[part] = sum;
                    sum += increments[part];
                    to[part] = sum;
                }
                let (start, end) = (lanes(&from), lanes(&to));
                let middle = start + gauss.along(set, &slopes, i, MIDDLE) * half;
                let steps = [end - full(last[i]), middle - full(states[MIDDLE][i])];
                for k in 0..steps.len() {
                    let far = steps[k].size() * number(scale[i]);
                    moved = moved.less(far, set).select(far, moved);
                    // NaN must not be lost, as it is in a comparison.
                    no_number = far.at_most(number(f64::INFINITY), set).select(no_number, far);
                }
                (first[i], last[i], states[MIDDLE][i]) =
                    (start.parts(), end.parts(), middle.parts());
            }
            let mut change = 0.0_f64;
            for far in bare(moved + no_number) {
                change = if far > change || far.is_nan() { far } else { change };
            }
            let contraction = change / before;
            if sweep > 0 {
                before = change;
            }
            // The remaining error is about change * contraction / (1 - contraction); it is unknown
            // after the first iteration.
            if sweep > 0 && (contraction < 0.5 && change * contraction <= 0.02 || change <= 0.02) {
                let mut error = 0.0_f64;
                for i in 0..N {
                    let (mut rough, mut size) = (zero, zero);
                    for k in [STAGES - 2, STAGES - 1] {
                        let mut coefficient = number(gauss.legendre[k][0]) * full(slopes[0][i]);
                        for j in 1..STAGES {
                            coefficient += number(gauss.legendre[k][j]) * full(slopes[j][i]);
                        }
                        let coefficient = coefficient.size();
                        rough = rough.less(coefficient, set).select(coefficient, rough);
                    }
                    for slope in
                        [rough, full(slopes[0][i]).size(), full(slopes[STAGES - 1][i]).size()]
                    {
                        size = size.less(slope, set).select(slope, size);
                    }
                    // At the end the method is of twice the order.
                    let at_end = rough * rough / (size + number(f64::MIN_POSITIVE));
                    let between = rough * number(gauss::BETWEEN);
                    let worst = at_end.less(between, set).select(between, at_end) * half;
                    for part in bare(worst * number(scale[i])) {
                        error = error.max(part);
                    }
                    crossing.states[i] = bare(full(first[i]));
                    crossing.end[i] = bare(full(last[i]))[PARTS - 1];
                    for j in 0..STAGES {
                        crossing.slopes[i][j] = bare(full(slopes[j][i]));
                    }
                }
                let mut duration = zero;
                for j in 0..STAGES {
                    duration += number(gauss.weights[j]) * full(rates[j]);
                    crossing.rates[j] = bare(full(rates[j]));
                }
                let durations = bare(duration * half);
                for part in 0..PARTS {
                    crossing.times[part + 1] = crossing.times[part] + durations[part];
                }
                (crossing.count, crossing.from, crossing.halves) =
                    (section.count, section.starts, section.halves);
                crossing.duration = crossing.times[section.count];
                return (error <= 1.0, evaluations);
            }
            if sweep > 0 && contraction >= 0.5 {
                return (false, evaluations);
            }
            // Computed here, since they are not needed after the last iteration.
            for i in 0..N {
                let start = full(first[i]);
                for j in 0..STAGES {
                    if j != MIDDLE {
                        states[j][i] = (start + gauss.along(set, &slopes, i, j) * half).parts();
                    }
                }
            }
        }
        (false, evaluations)
    }
}
