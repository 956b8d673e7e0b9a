//! Orbits and return maps, enclosed: the checker's own validated integrator.
//!
//! A set is { c + B r : |r_i| <= R_i }: a centre in fixed point with 192 binary places, an
//! orthogonal frame B turned after every step so that its first axis lies along the longest side of
//! the image (Lohner 1987), and radii. A step of length h is a Taylor polynomial of degree K of the
//! centre, with its derivative over the set (mean value form). Its remainder is that of a box W
//! proved to hold every solution by the high-order enclosure (Nedialkov & Jackson 1999): if T(X,
//! [0, h]) + [0, h]^(K+1) x_(K+1)(W) lies in W, every solution from X stays in W until h. The
//! derivative V with V(0) = 1 is enclosed in the same way, as part of the equation.

use super::ball::{Ball, Dual, Fixed, Number};
use super::rational::{Range, Rational};

/// An equation x' = f(x) in three variables with its constants in one arithmetic.
pub(super) trait Field {
    /// Taylor coefficients 0 to `order` of the solution from `start`, that of degree k multiplied
    /// by h^k.
    fn series<T: Number>(&self, start: &[T; 3], h: f64, order: usize) -> [Vec<T>; 3];

    /// Powers of two by which the states near a point are multiplied where directions are compared.
    fn scale(&self, _near: &[Fixed; 3]) -> [f64; 3] {
        [1.0; 3]
    }
}

fn number<T: Number>(x: f64) -> T {
    // Only numbers that every arithmetic holds exactly.
    T::of(&Range::point(&Rational::exactly(x).unwrap_or(Rational::whole(0))))
}

/// The smoothed caricature (Jeffrey 2013, eqs. 5 and 8) with phi = (1 + tanh(x/eps))/2.
#[derive(Clone, Debug)]
pub(super) struct Caricature {
    pub alpha: Rational,
    pub beta: Rational,
    pub eps: Rational,
    pub v_plus: Rational,
    pub v_minus: Rational,
}

impl Field for Caricature {
    /// x in units of its distance from the layer's middle, or of about eps within: there a change
    /// of x by eps changes the others by their own size.
    fn scale(&self, near: &[Fixed; 3]) -> [f64; 3] {
        let mut scale = 1024.0;
        while scale > 1.0 && scale * near[0].midpoint().abs() > 2.0 {
            scale *= 0.5;
        }
        [scale, 1.0, 1.0]
    }

    fn series<T: Number>(&self, start: &[T; 3], h: f64, order: usize) -> [Vec<T>; 3] {
        let of = |x: &Rational| T::of(&Range::point(x));
        let one = Rational::whole(1);
        let (alpha, beta) = (of(&self.alpha), of(&self.beta));
        let (v_minus, first, jump_y) = (of(&self.v_minus), of(&one), of(&(&one - &self.v_minus)));
        let jump_z = of(&(&self.v_plus - &one));
        // dphi/dx = (2/eps) phi (1 - phi).
        let steep = {
            let inverse = self.eps.inverse().unwrap_or(Rational::whole(0));
            of(&(&inverse + &inverse))
        };
        let h: T = number(h);
        let [mut x, mut y, mut z] = start.clone().map(|s| vec![s]);
        let (phi, psi) = steep.times(&x[0]).logistic();
        let (mut phi, mut psi) = (vec![phi], vec![psi]);
        // 1 - 2 phi; y + z; |x|^2; x'; psi x'.
        let (mut odd, mut sum, mut square, mut speed, mut rate) =
            (vec![], vec![], vec![], vec![], vec![]);
        for k in 0..order {
            let twice = phi[k].plus(&phi[k]);
            odd.push(if k == 0 { first.minus(&twice) } else { twice.minus(&twice).minus(&twice) });
            sum.push(y[k].plus(&z[k]));
            square.push(T::convolve(&x, &x).plus(&T::convolve(&y, &y)).plus(&T::convolve(&z, &z)));
            let pull = alpha.times(&square[k]);
            speed.push(z[k].minus(&T::convolve(&sum, &phi)));
            let mut dy =
                jump_y.times(&phi[k]).plus(&pull).minus(&beta.times(&T::convolve(&y, &square)));
            let mut dz =
                jump_z.times(&phi[k]).plus(&pull).minus(&beta.times(&T::convolve(&z, &square)));
            if k == 0 {
                (dy, dz) = (dy.plus(&v_minus), dz.plus(&first));
            }
            rate.push(T::convolve(&psi, &speed));
            let bend = T::convolve(&rate, &odd);
            let next = |d: &T| h.times(d).over(k + 1);
            x.push(next(&speed[k]));
            y.push(next(&dy));
            z.push(next(&dz));
            phi.push(next(&steep.times(&rate[k])));
            psi.push(next(&steep.times(&bend)));
        }
        [x, y, z]
    }
}

/// The inner problem about its canard (docs/law.md) in (p, q, s - `offset`): p' = F(p) (q - s p),
/// q' = -L p, s' = -w + g p, F(p) = 2 (phi* + p)(1 - phi* - p).
#[derive(Clone)]
pub(super) struct Inner {
    pub weak: Range,
    pub strong: Range,
    pub phi: Range,
    pub g: Range,
    pub offset: Rational,
}

impl Field for Inner {
    fn series<T: Number>(&self, start: &[T; 3], h: f64, order: usize) -> [Vec<T>; 3] {
        let (weak, strong, phi, g) =
            (T::of(&self.weak), T::of(&self.strong), T::of(&self.phi), T::of(&self.g));
        let (offset, one, h) =
            (T::of(&Range::point(&self.offset)), number::<T>(1.0), number::<T>(h));
        let [mut p, mut q, mut s] = start.clone().map(|s| vec![s]);
        let (mut on, mut off, mut slope, mut full, mut lag) =
            (vec![], vec![], vec![], vec![], vec![]);
        for k in 0..order {
            let constant = k == 0;
            on.push(if constant { phi.plus(&p[0]) } else { p[k].clone() });
            off.push(if constant { one.minus(&on[0]) } else { p[k].minus(&p[k]).minus(&p[k]) });
            full.push(if constant { s[0].plus(&offset) } else { s[k].clone() });
            let half = T::convolve(&on, &off);
            slope.push(half.plus(&half));
            lag.push(q[k].minus(&T::convolve(&full, &p)));
            let dp = T::convolve(&slope, &lag);
            let zero = p[k].minus(&p[k]);
            let dq = zero.minus(&strong.times(&p[k]));
            let ds = g.times(&p[k]);
            let ds = if constant { ds.minus(&weak) } else { ds };
            let next = |d: &T| h.times(d).over(k + 1);
            p.push(next(&dp));
            q.push(next(&dq));
            s.push(next(&ds));
        }
        [p, q, s]
    }
}

/// Degree of the series and the largest remainders of a step: of the states, and of their
/// derivative.
#[derive(Clone, Copy, Debug)]
pub(super) struct FlowSettings {
    pub order: usize,
    pub remainder: f64,
    pub derivative: f64,
}

impl FlowSettings {
    pub const NARROW: Self = Self { order: 40, remainder: 1e-35, derivative: 1e-20 };
    pub const WIDE: Self = Self { order: 24, remainder: 1e-20, derivative: 1e-20 };
}

const LONGEST_STEP: f64 = 0.5;
const SHORTEST_STEP: f64 = 1e-9;
/// Steps between two crossings; the slowest passage takes some thousands.
const MOST_STEPS: usize = 20_000;

pub(super) type Matrix = [[Ball; 3]; 3];

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let column = |j: usize| [b[2][j], b[1][j], b[0][j]];
    std::array::from_fn(|i| std::array::from_fn(|j| Ball::convolve(&a[i], &column(j))))
}

fn unit() -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))))
}

/// A set of states, and the derivative with respect to where they began.
#[derive(Clone)]
pub(super) struct Set {
    centre: [Fixed; 3],
    frame: [[f64; 3]; 3],
    radii: [f64; 3],
    /// The derivative is `frame` times this.
    derivative: Matrix,
    time: Fixed,
    /// All of it lies on the plane of section.
    on_plane: bool,
}

struct Step {
    h: f64,
    stay: [Ball; 3],
    centre: [Vec<Fixed>; 3],
    set: [Vec<Dual>; 3],
    last: [Dual; 3],
}

/// Crossing of the plane by a set.
pub(super) struct Crossing {
    pub upward: bool,
    pub time: Range,
    pub states: [Range; 3],
    pub set: Set,
}

impl Set {
    /// { centre + frame r : |r_i| <= radii_i } for an exact centre, and the derivative 1 if the
    /// frame is.
    pub fn new(centre: [Fixed; 3], frame: [[f64; 3]; 3], radii: [f64; 3]) -> Self {
        let derivative = unit().map(|row| row.map(Ball::exactly));
        Self { centre, frame, radii, derivative, time: Fixed::zero(), on_plane: false }
    }

    /// A box, its middle being known with an error.
    pub fn boxed(centre: [Fixed; 3], radii: [f64; 3]) -> Self {
        let radii = std::array::from_fn(|i| (radii[i] + centre[i].r) * (1.0 + 1e-14));
        Self::new(centre.map(|c| c.centre()), unit(), radii)
    }

    /// The same, of which all lies on the plane of section: orbits begin there and leave.
    pub fn on_plane(self) -> Self {
        Self { on_plane: true, ..self }
    }

    fn frame(&self) -> Matrix {
        self.frame.map(|row| row.map(Ball::exactly))
    }

    /// Largest distance of its points from its centre, by coordinate.
    fn reach(&self) -> [f64; 3] {
        self.frame().map(|row| {
            (0..3).map(|j| row[j].magnitude() * self.radii[j]).sum::<f64>() * (1.0 + 1e-14)
        })
    }

    pub fn hull(&self) -> [Ball; 3] {
        let reach = self.reach();
        std::array::from_fn(|i| self.centre[i].ball().widened(reach[i]))
    }

    /// The derivative of the states by those at the start.
    pub fn derivative(&self) -> Matrix {
        product(&self.frame(), &self.derivative)
    }

    pub fn centre(&self) -> &[Fixed; 3] {
        &self.centre
    }

    /// The set, or its centre, seen in other coordinates: m (x - origin).
    pub fn seen(
        &self,
        m: &[[Range; 2]; 2],
        origin: [&Rational; 2],
        axes: [usize; 2],
        whole: bool,
    ) -> Option<[Range; 2]> {
        let off: Vec<Range> = [0, 1]
            .iter()
            .map(|k| Some(&self.centre[axes[*k]].range(0.0)? - &Range::point(origin[*k])))
            .collect::<Option<_>>()?;
        let mut seen = Vec::new();
        for row in m {
            let mut sum = &(&row[0] * &off[0]) + &(&row[1] * &off[1]);
            for j in 0..if whole { 3 } else { 0 } {
                let [a, b] = axes.map(|i| Rational::exactly(self.frame[i][j]));
                let along = &(&row[0] * &Range::point(&a?)) + &(&row[1] * &Range::point(&b?));
                let reach = &along.magnitude() * &Rational::exactly(self.radii[j])?;
                sum = sum.widened(&reach).rounded();
            }
            seen.push(sum);
        }
        seen.try_into().ok()
    }

    /// Its image by a map that takes the centre to within `error` of `centre` and has a derivative
    /// in `jacobian`.
    fn image(
        &self,
        scale: [f64; 3],
        centre: [Fixed; 3],
        error: [f64; 3],
        jacobian: &Matrix,
    ) -> Option<Self> {
        let moved = product(jacobian, &self.frame());
        let longest = self.radii.iter().fold(1e-290_f64, |a, b| a.max(*b));
        let mut columns: Vec<[f64; 3]> = (0..3)
            .map(|j| {
                std::array::from_fn(|i| {
                    scale[i] * moved[i][j].m * (self.radii[j] / longest).max(1e-30)
                })
            })
            .collect();
        let size = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>();
        columns.sort_by(|a, b| size(b).total_cmp(&size(a)));
        let orthogonal = orthogonal(&columns);
        let frame = std::array::from_fn(|i| orthogonal[i].map(|b| b / scale[i]));
        let exact = |i: usize| Ball::exactly(scale[i]);
        let inverse =
            inverse(&orthogonal)?.map(|row| std::array::from_fn(|i| row[i].times(&exact(i))));
        let turned = product(&inverse, &moved);
        let radii = std::array::from_fn(|i| {
            let of_set: f64 = (0..3).map(|j| turned[i][j].magnitude() * self.radii[j]).sum();
            let of_error: f64 = (0..3).map(|j| inverse[i][j].magnitude() * error[j]).sum();
            (of_set + of_error) * (1.0 + 1e-14) + 1e-290
        });
        if radii.iter().any(|r| !r.is_finite()) {
            return None;
        }
        let derivative = product(&turned, &self.derivative);
        Some(Self { centre, frame, radii, derivative, time: self.time.clone(), on_plane: false })
    }
}

/// Orthonormal columns, as nearly as rounding allows, the first along the first column (Gram and
/// Schmidt, twice).
fn orthogonal(columns: &[[f64; 3]]) -> [[f64; 3]; 3] {
    let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let mut found: Vec<[f64; 3]> = Vec::new();
    let rest = |v: &[f64; 3], found: &[[f64; 3]]| {
        let mut v = *v;
        for _ in 0..2 {
            for f in found {
                let along = dot(&v, f);
                v = std::array::from_fn(|i| v[i] - along * f[i]);
            }
        }
        v
    };
    for column in columns {
        let before = dot(column, column).sqrt();
        let mut v = rest(&column.map(|x| x / before), &found);
        let left = dot(&v, &v);
        if left.is_nan() || left <= 1e-24 {
            // Nearly dependent: any direction across the others.
            let unit = |k: usize| std::array::from_fn(|i| f64::from(u8::from(i == k)));
            let all = [0, 1, 2].map(|k| rest(&unit(k), &found));
            v = all
                .into_iter()
                .fold([0.0; 3], |a, b| if dot(&b, &b) > dot(&a, &a) { b } else { a });
        }
        // Once more, at full length: what is left of a short one is mostly rounding.
        let length = dot(&v, &v).sqrt();
        let v = rest(&v.map(|x| x / length), &found);
        let length = dot(&v, &v).sqrt();
        found.push(v.map(|x| x / length));
    }
    std::array::from_fn(|i| std::array::from_fn(|j| found[j][i]))
}

/// The inverse of a nearly orthogonal matrix: (B^T B)^-1 B^T, and (1 - E)^-1 is within |E|/(1 -
/// |E|) of 1.
fn inverse(frame: &[[f64; 3]; 3]) -> Option<Matrix> {
    let b: Matrix = frame.map(|row| row.map(Ball::exactly));
    let transposed: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| b[j][i]));
    let square = product(&transposed, &b);
    let off = (0..3)
        .map(|i| {
            (0..3)
                .map(|j| {
                    if i == j { Ball::ONE.minus(&square[i][j]) } else { square[i][j] }.magnitude()
                })
                .sum()
        })
        .fold(0.0, |a: f64, b: f64| if b > a || b.is_nan() { b } else { a });
    if off.is_nan() || off >= 1e-6 {
        return None;
    }
    // Entries of B are below 1.1.
    Some(transposed.map(|row| row.map(|x| x.widened(off * 1.2))))
}

/// The flow of a field, with steps that fit.
pub(super) struct Flow<'a, F> {
    field: &'a F,
    settings: FlowSettings,
    axis: usize,
    h: f64,
    pub steps: usize,
}

fn variables(states: &[Ball; 3]) -> [Dual; 3] {
    std::array::from_fn(|i| Dual {
        value: states[i],
        by: std::array::from_fn(|j| if i == j { Ball::ONE } else { Ball::ZERO }),
    })
}

/// The sum of a series over all of [0, 1].
fn over_step(coefficients: impl Iterator<Item = Ball>) -> Ball {
    let (mut m, mut r, mut size, mut n) = (0.0, 0.0, 0.0_f64, 0.0);
    for (k, c) in coefficients.enumerate() {
        let half = if k == 0 { 0.0 } else { 0.5 * c.m };
        m += c.m - half;
        size += c.m.abs();
        r += half.abs() + c.r;
        n += 1.0;
    }
    Ball { m, r: (r + (n + 4.0) * f64::EPSILON * size) * (1.0 + n * f64::EPSILON) }
}

impl<'a, F: Field> Flow<'a, F> {
    pub fn new(field: &'a F, settings: FlowSettings, axis: usize) -> Self {
        Self { field, settings, axis, h: 1e-3, steps: 0 }
    }

    /// The right-hand side and its derivative over a box.
    fn slope(&self, states: &[Ball; 3]) -> [Dual; 3] {
        self.field.series(&variables(states), 1.0, 1).map(|c| c[1])
    }

    /// A step from the set, no longer than `longest`.
    fn prove(&mut self, set: &Set, longest: f64) -> Option<Step> {
        let k = self.settings.order;
        let mut h = self.h.min(longest).min(LONGEST_STEP);
        let hull = variables(&set.hull());
        loop {
            if h.is_nan() || h < SHORTEST_STEP {
                return None;
            }
            // Few bits, so that it is a number of every arithmetic.
            h = f64::from(h as f32);
            let series = self.field.series(&hull, h, k);
            let reach: [Dual; 3] = std::array::from_fn(|i| Dual {
                value: over_step(series[i].iter().map(|c| c.value)),
                by: std::array::from_fn(|j| over_step(series[i].iter().map(|c| c.by[j]))),
            });
            let room = |b: Ball, by: f64| b.widened(1e-9 * b.r + 2.0 * by);
            let (by, derivative_by) = (self.settings.remainder, self.settings.derivative);
            let stay: [Dual; 3] = std::array::from_fn(|i| Dual {
                value: room(reach[i].value, by),
                by: reach[i].by.map(|d| room(d, derivative_by)),
            });
            let last = self.field.series(&stay, h, k + 1).map(|c| c[k + 1]);
            let (mut worst, mut inside) = (0.0_f64, true);
            for i in 0..3 {
                let mut check = |rest: Ball, reach: Ball, stay: Ball, by: f64| {
                    let rest = rest.magnitude();
                    inside &= rest <= by && reach.widened(rest).r <= stay.r;
                    worst = if rest.is_nan() { f64::INFINITY } else { worst.max(rest / by) };
                };
                check(last[i].value, reach[i].value, stay[i].value, by);
                for j in 0..3 {
                    check(last[i].by[j], reach[i].by[j], stay[i].by[j], derivative_by);
                }
            }
            let fit = root(worst, k + 1);
            if inside {
                self.h = h * (0.9 / fit).clamp(0.4, 2.0);
                let centre = self.field.series(&set.centre, h, k);
                return Some(Step { h, stay: stay.map(|s| s.value), centre, set: series, last });
            }
            h *= if fit.is_finite() { (0.9 / fit).clamp(0.2, 0.8) } else { 0.4 };
        }
    }

    /// The set at the part `tau` of a step, between 0 and 1.
    fn advance(&mut self, set: &Set, step: &Step, tau: &Fixed) -> Option<Set> {
        self.steps += 1;
        let part = tau.ball();
        let end = tau.midpoint() == 1.0;
        let centre: [Fixed; 3] = std::array::from_fn(|i| {
            step.centre[i]
                .iter()
                .rev()
                .fold(Fixed::zero(), |s, c| if end { s.plus(c) } else { s.times(tau).plus(c) })
        });
        let jacobian: Matrix = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let sum = step.set[i].iter().rev().fold(Ball::ZERO, |s, c| {
                    if end { s.plus(&c.by[j]) } else { s.times(&part).plus(&c.by[j]) }
                });
                sum.widened(step.last[i].by[j].magnitude())
            })
        });
        let error = std::array::from_fn(|i| centre[i].r + step.last[i].value.magnitude());
        let mut image =
            set.image(self.field.scale(&centre), centre.map(|c| c.centre()), error, &jacobian)?;
        image.time = set.time.plus(&tau.times(&number(step.h)));
        Some(image)
    }

    /// The part of a step at which the centre meets the plane; not rigorous, what follows is.
    fn meeting(&self, step: &Step) -> Option<Fixed> {
        let c = &step.centre[self.axis];
        let at = |t: &Fixed| c.iter().rev().fold(Fixed::zero(), |s, c| s.times(t).plus(c));
        let (mut low, mut high) = (0.0_f64, 1.0_f64);
        let side = |t: f64| at(&Fixed::exactly(t)).midpoint();
        let (first, last) = (side(low), side(high));
        if (first < 0.0) == (last < 0.0) {
            return None;
        }
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            if (side(middle) < 0.0) == (first < 0.0) { low = middle } else { high = middle }
        }
        let mut t = Fixed::exactly(low);
        let speed = (side(high) - side(low)) / (high - low);
        for _ in 0..12 {
            let off = at(&t).midpoint() / speed;
            t = t.minus(&Fixed::exactly(off)).centre();
        }
        let value = t.midpoint();
        (value > 0.0 && value < 1.0).then_some(t)
    }

    /// The set's next crossing of the plane where its coordinate `axis` is zero, before `longest`
    /// more time: every orbit's first.
    pub fn next_crossing(&mut self, start: &Set, longest: f64) -> Option<Crossing> {
        let mut set = start.clone();
        let begin = set.time.midpoint();
        let mut at_most = LONGEST_STEP;
        for _ in 0..MOST_STEPS {
            if set.time.midpoint() - begin > longest {
                return None;
            }
            let step = self.prove(&set, at_most)?;
            let one = number::<Fixed>(1.0);
            if step.stay[self.axis].excludes_zero() {
                set = self.advance(&set, &step, &one)?;
                at_most = LONGEST_STEP;
                continue;
            }
            // The plane is crossed in one direction only during this step, at most once.
            let speed = self.slope(&step.stay)[self.axis].value;
            if !speed.excludes_zero() {
                at_most = 0.5 * step.h;
                continue;
            }
            let upward = speed.m > 0.0;
            let below = set.hull()[self.axis];
            if !set.on_plane && !below.excludes_zero() {
                return None;
            }
            let leaves = set.on_plane || (below.m > 0.0) == upward;
            if !leaves && let Some(tau) = self.meeting(&step) {
                let near = self.advance(&set, &step, &tau)?;
                return self.project(&near, upward);
            }
            let after = self.advance(&set, &step, &one)?;
            let height = after.hull()[self.axis];
            if !height.excludes_zero()
                || (height.m > 0.0) != (if leaves { upward } else { below.m > 0.0 })
            {
                at_most = 0.5 * step.h;
                continue;
            }
            set = after;
            at_most = LONGEST_STEP;
        }
        None
    }

    /// Moves a set near the plane onto it, along the flow.
    fn project(&self, set: &Set, upward: bool) -> Option<Crossing> {
        let axis = self.axis;
        let hull = set.hull();
        let mut stay = hull.map(|b| b.widened(1e-290));
        for _ in 0..30 {
            let slope = self.slope(&stay);
            let speed = slope[axis].value;
            if !speed.excludes_zero() || (speed.m > 0.0) != upward {
                return None;
            }
            // All orbits meet the plane within this time, forward or backward, if they stay where
            // their speed is known.
            let within = hull[axis].magnitude() / speed.least() * (1.0 + 1e-12) + 1e-290;
            let reach: [Ball; 3] =
                std::array::from_fn(|i| hull[i].widened(within * slope[i].value.magnitude()));
            if !(0..3).all(|i| reach[i].within(&stay[i])) {
                stay = reach.map(|b| b.widened(1e-3 * b.r + 1e-15 * b.m.abs()));
                continue;
            }
            // D phi(t, .) = 1 + the integral of Df D phi, and D phi is within exp(L |t|) - 1 <= 2 L
            // |t| of 1 in every element, L the norm of Df (Gronwall).
            let size = |i: usize, j: usize| slope[i].by[j].magnitude();
            let row = |i: usize| (size(i, 0) + size(i, 1) + size(i, 2)) * (1.0 + 1e-14);
            let off = 2.0 * within * row(0).max(row(1)).max(row(2));
            if off.is_nan() || off >= 1.0 {
                return None;
            }
            let moved = |i: usize, j: usize| {
                let change = within * (size(i, j) + off * row(i)) * (1.0 + 1e-14);
                if i == j { Ball::ONE } else { Ball::ZERO }.widened(change)
            };
            let own = set.centre[axis].ball().magnitude();
            let (mut jacobian, mut error) = ([[Ball::ZERO; 3]; 3], [0.0; 3]);
            for i in (0..3).filter(|i| *i != axis) {
                let ratio = slope[i].value.divided(&speed)?;
                jacobian[i] =
                    std::array::from_fn(|j| moved(i, j).minus(&ratio.times(&moved(axis, j))));
                error[i] = own * ratio.magnitude() * (1.0 + 1e-14);
            }
            let mut centre = set.centre.clone();
            centre[axis] = Fixed::zero();
            let mut image = set.image(self.field.scale(&centre), centre, error, &jacobian)?;
            image.on_plane = true;
            image.time.r = (image.time.r + within) * (1.0 + 1e-14);
            let reach = image.reach();
            let range = |i: usize| image.centre[i].range(if i == axis { 0.0 } else { reach[i] });
            let states = [range(0)?, range(1)?, range(2)?];
            return Some(Crossing { upward, time: image.time.range(0.0)?, states, set: image });
        }
        None
    }
}

/// x^(1/n), to a few digits: it only chooses steps.
fn root(x: f64, n: usize) -> f64 {
    if !(x > 0.0 && x < f64::INFINITY) {
        return if x > 0.0 { f64::INFINITY } else { 1e-3 };
    }
    // From the exponent, a line between powers of two.
    let bits = x.to_bits();
    let log =
        ((bits >> 52) as f64 - 1023.0) + (bits & ((1 << 52) - 1)) as f64 / (1_u64 << 52) as f64;
    let part = log / n as f64;
    let whole = part.floor();
    let mut power = 1.0;
    for _ in 0..whole.abs().min(300.0) as u32 {
        power *= if whole > 0.0 { 2.0 } else { 0.5 };
    }
    power * (1.0 + (part - whole))
}
