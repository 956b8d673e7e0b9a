//! Steps for any number of states: Dormand & Prince's method of order 5 (1980) with the continuous
//! extension of order 4 (Hairer, Norsett & Wanner 1993, sec. II.6), for stiff motion Radau IIA of
//! order 5 with its collocation polynomial (Hairer & Wanner 1996, sec. IV.8), and Taylor series.
//! What the multistep method makes is made elsewhere ([`Multistep`]) and read as a series is.

use twofold_num::linear::{Blocks, solve_any};

use crate::history::Multistep;

/// Nodes, coefficients row by row, and the error estimate.
pub(crate) const C: [f64; 7] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
pub(crate) const A: [[f64; 6]; 7] = [
    [0.0; 6],
    [0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
pub(crate) const E: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339_200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];
const D: [f64; 7] = [
    -12_715_105_075.0 / 11_282_082_432.0,
    0.0,
    87_487_479_700.0 / 32_700_410_799.0,
    -10_690_763_975.0 / 1_880_347_072.0,
    701_980_252_875.0 / 199_316_789_632.0,
    -1_453_857_185.0 / 822_651_844.0,
    69_997_945.0 / 29_380_423.0,
];

/// The real eigenvalue of the inverse of Radau IIA's matrix.
const REAL_EIGENVALUE: f64 = 3.637_834_252_744_496;

/// A state moves no farther by its first speed than this many times what it has been moved.
const FARTHER: f64 = 1e6;
/// Farther movement than this counts there: at the root of zero smaller ones come to nothing.
const TINY: f64 = 1e-50;
/// Iterations for the stages of an implicit step have settled when they change a state by no more
/// than this part of itself.
pub(crate) const SETTLED: f64 = 1e-14;

/// Writes the derivatives at a time and state.
pub(crate) type RightHandSide<'a> = dyn FnMut(f64, &[f64], &mut [f64]) + 'a;

/// By so much of what a step's error is measured by the derivative of a series may miss the field,
/// times the step.
const LARGEST_DEFECT: f64 = 20.0;

/// Errors of states are measured by no less: on the way from zero smaller ones count for nothing.
pub(crate) const LEAST_STATE: f64 = 1e-150;
/// Those of states that fall, by no less: the errors of smaller ones lose their digits.
pub(crate) const LEAST_FALLING: f64 = 1e-290;
/// A state that falls below this is zero: its error is no small part of it any more.
pub(crate) const UNDERFLOW: f64 = 1e-280;

/// The series of the motion where a step begins.
#[derive(Clone, Debug, Default)]
pub(crate) struct Series {
    /// The coefficients of each state, and of what is followed beside them, by powers of the time;
    /// of the fraction of the whole step if the multistep method made it.
    pub terms: Vec<Vec<f64>>,
    /// The same by powers of the fraction of the step.
    pub scaled: Vec<Vec<f64>>,
    /// Rounding errors of speeds that cancel.
    pub noise: Vec<f64>,
    /// Rounding errors of the functions followed beside the states.
    pub rounding: Vec<f64>,
    /// Differences of the series' derivative from the field in the middle and at the end, times the
    /// step.
    defect: Vec<f64>,
}

impl Series {
    /// Sets the coefficients of a step of this length.
    fn scale(&mut self, h: f64) {
        self.scaled.resize(self.terms.len(), Vec::new());
        for (scaled, terms) in self.scaled.iter_mut().zip(&self.terms) {
            scaled.clear();
            let mut power = 1.0;
            for c in terms {
                scaled.push(c * power);
                power *= h;
            }
        }
    }
}

fn horner(c: &[f64], u: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * u + c)
}

/// The derivative by the fraction of the step.
fn horner_slope(c: &[f64], u: f64) -> f64 {
    (1..c.len()).rev().fold(0.0, |sum, k| sum * u + k as f64 * c[k])
}

/// A step and the room for it.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    /// Start time.
    pub t: f64,
    /// Its length.
    pub h: f64,
    /// The state where it begins.
    pub x: Vec<f64>,
    /// The derivatives of its stages; the first is to be set.
    pub k: Vec<Vec<f64>>,
    /// The state where it ends.
    pub y: Vec<f64>,
    extension: [Vec<f64>; 4],
    stage: Vec<f64>,
    /// The Jacobian where it begins, row by row: the step is then one of Radau IIA.
    pub jacobian: Option<Vec<f64>>,
    /// The error estimate of an implicit step.
    estimate: Vec<f64>,
    /// The series where it begins: the step is then one of them, or of the multistep method.
    pub series: Option<Series>,
    /// The multistep method: the step is then one that it made, or the beginning of one.
    pub multistep: Option<Multistep>,
}

impl Step {
    pub fn new(n: usize) -> Self {
        let zeros = || vec![0.0; n];
        Self {
            t: 0.0,
            h: 0.0,
            x: zeros(),
            k: vec![zeros(); 7],
            y: zeros(),
            extension: [zeros(), zeros(), zeros(), zeros()],
            stage: zeros(),
            jacobian: None,
            estimate: zeros(),
            series: None,
            multistep: None,
        }
    }

    /// Makes a step of length `h` from where it begins; `rhs` writes the derivatives.
    pub fn take(&mut self, h: f64, rhs: &mut RightHandSide<'_>) {
        self.h = h;
        let n = self.x.len();
        if self.multistep.is_some() {
            self.take_beginning(h);
            return;
        }
        if let Some(mut series) = self.series.take() {
            self.take_series(h, &mut series, rhs);
            self.series = Some(series);
            return;
        }
        if let Some(jacobian) = self.jacobian.take() {
            let settles = self.take_implicit(h, &jacobian, rhs, false);
            if !settles && !self.take_implicit(h, &jacobian, rhs, true) {
                self.y.fill(f64::NAN);
            }
            self.jacobian = Some(jacobian);
            return;
        }
        self.stage::<1>(h, rhs);
        self.stage::<2>(h, rhs);
        self.stage::<3>(h, rhs);
        self.stage::<4>(h, rhs);
        self.stage::<5>(h, rhs);
        self.stage::<6>(h, rhs);
        // The last stage is at the end.
        std::mem::swap(&mut self.y, &mut self.stage);
        let k: [&[f64]; 7] = std::array::from_fn(|s| &self.k[s][..n]);
        let [a, b, c, d] = self.extension.each_mut().map(|e| &mut e[..n]);
        let (x, y) = (&self.x[..n], &self.y[..n]);
        for i in 0..n {
            let difference = y[i] - x[i];
            let bend = h * k[0][i] - difference;
            a[i] = difference;
            b[i] = bend;
            c[i] = difference - h * k[6][i] - bend;
            d[i] = h * D.iter().zip(k).fold(0.0, |sum, (d, k)| sum + d * k[i]);
        }
    }

    /// Stage `S`, counted from 0, of an explicit step. With the number of terms known, their sum is
    /// no loop.
    fn stage<const S: usize>(&mut self, h: f64, rhs: &mut RightHandSide<'_>) {
        let n = self.x.len();
        let (done, open) = self.k.split_at_mut(S);
        let done: [&[f64]; S] = std::array::from_fn(|s| &done[s][..n]);
        let (x, stage) = (&self.x[..n], &mut self.stage[..n]);
        for i in 0..n {
            let sum = (0..S).fold(0.0, |sum, s| sum + A[S][s] * done[s][i]);
            stage[i] = x[i] + h * sum;
        }
        rhs(self.t + C[S] * h, &self.stage, &mut open[0]);
    }

    /// A step of the series, with a look at the field in its middle and at its end (the defect:
    /// Enright 1989).
    fn take_series(&mut self, h: f64, series: &mut Series, rhs: &mut RightHandSide<'_>) {
        let n = self.x.len();
        series.defect.resize(n, 0.0);
        series.scale(h);
        for i in 0..n {
            self.y[i] = self.x[i] + horner(&series.scaled[i][1..], 1.0);
            self.stage[i] = self.x[i] + 0.5 * horner(&series.scaled[i][1..], 0.5);
        }
        rhs(self.t + 0.5 * h, &self.stage, &mut self.k[1]);
        rhs(self.t + h, &self.y, &mut self.k[6]);
        for i in 0..n {
            let middle = h * self.k[1][i] - horner_slope(&series.scaled[i], 0.5);
            let end = h * self.k[6][i] - horner_slope(&series.scaled[i], 1.0);
            // The larger one; not-a-number if one is none.
            series.defect[i] =
                if middle.abs() > end.abs() { middle.abs() } else { end.abs() + 0.0 * middle };
        }
        for s in 2..6 {
            let (done, open) = self.k.split_at_mut(s);
            open[0].copy_from_slice(&done[1]);
        }
    }

    /// The beginning, of length `h`, of the step that the multistep method made.
    fn take_beginning(&mut self, h: f64) {
        let (Some(series), Some(own)) = (&mut self.series, &self.multistep) else { return };
        let (share, end) = own.share(h);
        series.scale(share);
        match end {
            Some(end) => self.y.copy_from_slice(end),
            None => (0..self.y.len()).for_each(|i| {
                self.y[i] = self.x[i] + horner(&series.scaled[i][1..], 1.0);
            }),
        }
        let (scaled, h) = (&series.scaled, self.h);
        self.k[1].iter_mut().zip(scaled).for_each(|(k, c)| *k = horner_slope(c, 1.0) / h);
        for s in 2..7 {
            let (done, open) = self.k.split_at_mut(s);
            open[0].copy_from_slice(&done[1]);
        }
    }

    /// Whether it is one of the explicit Runge-Kutta method.
    pub fn explicit(&self) -> bool {
        self.jacobian.is_none() && self.series.is_none()
    }

    /// Power of the step's length with which the error falls.
    pub fn power(&self) -> f64 {
        self.series
            .as_ref()
            .and_then(|series| series.terms.first())
            .map_or(5.0, |c| (c.len() - 1) as f64)
    }

    /// A step of Radau IIA: simplified Newton iterations for the three stages at once, or with each
    /// stage's own derivatives if they are `fresh`; false if they do not settle.
    fn take_implicit(
        &mut self,
        h: f64,
        jacobian: &[f64],
        rhs: &mut RightHandSide<'_>,
        fresh: bool,
    ) -> bool {
        /// Most iterations.
        const MOST_SIMPLE: usize = 12;
        const MOST_FRESH: usize = 40;
        /// Part of a change that is tried instead of it.
        const LESS: f64 = 0.25;
        /// Part of the terms of a speed below which it is their rounding, in units of [`SETTLED`].
        const CANCELS: f64 = 4.0 * f64::EPSILON / SETTLED;
        /// Part of a state that is tried instead of one beyond zero.
        const NEARER: f64 = 0.1;
        let n = self.x.len();
        let root = 6.0_f64.sqrt();
        let c = [0.1 * (4.0 - root), 0.1 * (4.0 + root), 1.0];
        let a = [
            [
                (88.0 - 7.0 * root) / 360.0,
                (296.0 - 169.0 * root) / 1800.0,
                (-2.0 + 3.0 * root) / 225.0,
            ],
            [
                (296.0 + 169.0 * root) / 1800.0,
                (88.0 + 7.0 * root) / 360.0,
                (-2.0 - 3.0 * root) / 225.0,
            ],
            [(16.0 - root) / 36.0, (16.0 + root) / 36.0, 1.0 / 9.0],
        ];
        let m = 3 * n;
        let matrix_of = |jacobians: [&[f64]; 3]| {
            let mut matrix = vec![0.0; m * m];
            for (p, row) in a.iter().enumerate() {
                for (q, a) in row.iter().enumerate() {
                    for i in 0..n {
                        for j in 0..n {
                            let one = if p == q && i == j { 1.0 } else { 0.0 };
                            let slope = jacobians[q][i * n + j];
                            matrix[(p * n + i) * m + q * n + j] = one - h * a * slope;
                        }
                    }
                }
            }
            matrix
        };
        let mut matrix = Blocks::new(matrix_of([jacobian; 3]), m);
        let mut z = vec![0.0; m];
        let known: Vec<f64> = (0..n)
            .map(|i| self.x[i].abs().max((h * self.k[0][i]).abs()).max(LEAST_STATE))
            .collect();
        // Where what moves a state cancels, as the error of an observer that begins without one
        // does, iterations leave the rounding of what cancels.
        let terms = |i: usize| (0..n).map(|j| (jacobian[i * n + j] * self.x[j]).abs()).sum::<f64>();
        let known: Vec<f64> =
            known.iter().enumerate().map(|(i, known)| known.max(CANCELS * h * terms(i))).collect();
        let mut reach = known.clone();
        let (mut f, mut last, mut settled) = (vec![vec![0.0; n]; 3], f64::INFINITY, false);
        let mut change = vec![0.0; m];
        let mut at_end: Option<Vec<f64>> = None;
        for iteration in 0..if fresh { MOST_FRESH } else { MOST_SIMPLE } {
            for s in 0..3 {
                for i in 0..n {
                    self.stage[i] = self.x[i] + z[s * n + i];
                }
                rhs(self.t + c[s] * h, &self.stage, &mut f[s]);
            }
            if fresh && iteration > 0 && !f.iter().flatten().all(|f| f.is_finite()) {
                // Newton's method leaves the domain of a root from its far side: less far, and
                // states that passed zero, of a root that is far smaller, nearer to it.
                let passes = |(k, (z, d)): (usize, (&f64, &f64))| {
                    let x = self.x[k % n];
                    (x + z) * (x + z - d) < 0.0
                };
                let passed: Vec<bool> = z.iter().zip(&change).enumerate().map(passes).collect();
                let some = passed.contains(&true);
                z.iter_mut().zip(&mut change).zip(passed).enumerate().for_each(
                    |(k, ((z, d), passed))| {
                        let x = self.x[k % n];
                        let kept = match (some, passed) {
                            (true, true) => NEARER * (x + *z - *d) - x - (*z - *d),
                            (true, false) => *d,
                            (false, _) => LESS * *d,
                        };
                        *z += kept - *d;
                        *d = kept;
                    },
                );
                // Where they were is no size of theirs.
                (reach, last) = (known.clone(), f64::INFINITY);
                continue;
            }
            if iteration == 0 && !f.iter().flatten().all(|f| f.is_finite()) {
                // A state that waits while the time goes on may leave a root's domain: begin with
                // where its speed leads.
                for (s, c) in c.iter().enumerate() {
                    (0..n).for_each(|i| z[s * n + i] = c * h * self.k[0][i]);
                }
                continue;
            }
            if fresh && iteration > 0 {
                let slopes: Vec<Vec<f64>> = (0..3)
                    .map(|s| {
                        let at: Vec<f64> = (0..n).map(|i| self.x[i] + z[s * n + i]).collect();
                        slopes_beside(self.t + c[s] * h, &at, &f[s], jacobian, rhs)
                    })
                    .collect();
                matrix = Blocks::new(matrix_of([&slopes[0], &slopes[1], &slopes[2]]), m);
                at_end = slopes.into_iter().next_back();
            }
            let mut right = vec![0.0; m];
            for p in 0..3 {
                for i in 0..n {
                    let sum: f64 = (0..3).map(|q| a[p][q] * f[q][i]).sum();
                    right[p * n + i] = h * sum - z[p * n + i];
                }
            }
            let found = matrix.as_ref().and_then(|matrix| matrix.solve(&right));
            let Some(found) = found else { return false };
            change = found;
            let moved: Vec<bool> = z.iter().map(|z| *z != 0.0).collect();
            z.iter_mut().zip(&change).for_each(|(z, d)| *z += d);
            // A state that comes back to zero is as large as on its way, in the iterations, too.
            z.iter().enumerate().for_each(|(k, z)| reach[k % n] = reach[k % n].max(z.abs()));
            // Of all states, and of those that had moved before: others come one after another.
            let [mut size, mut again] = [0.0_f64; 2];
            for (k, d) in change.iter().enumerate() {
                let relative = d.abs() / reach[k % n];
                size =
                    if size.is_nan() || relative.is_nan() { f64::NAN } else { size.max(relative) };
                if moved[k] {
                    again = again.max(relative);
                }
            }
            // A speed that is large at the start alone says nothing about how far states go.
            let by_speed_alone = |i: usize| {
                let speed = (h * self.k[0][i]).abs();
                let moved = (0..3).map(|s| z[s * n + i].abs()).fold(0.0, f64::max);
                speed > self.x[i].abs().max(TINY) && speed > FARTHER * moved && moved > 0.0
            };
            let small = size <= SETTLED || (size <= 1e-11 && size >= 0.5 * last);
            if small && !(0..n).any(by_speed_alone) {
                settled = true;
                break;
            }
            if size.is_nan() || again > 2.0 * last {
                return false;
            }
            last = size;
        }
        if !settled {
            return false;
        }
        for i in 0..n {
            self.y[i] = self.x[i] + z[2 * n + i];
        }
        // The cubic through the three stages and the beginning: theta (p + theta (q + theta r)).
        let nodes: Vec<f64> = c.iter().flat_map(|c| [*c, c * c, c * c * c]).collect();
        for i in 0..n {
            let values = [z[i], z[n + i], z[2 * n + i]];
            let Some(p) = solve_any(&nodes, &values, 0.0) else { return false };
            for (extension, p) in self.extension.iter_mut().zip(p) {
                extension[i] = p;
            }
        }
        let gamma = 1.0 / REAL_EIGENVALUE;
        let e =
            [gamma / 3.0 * (-13.0 - 7.0 * root), gamma / 3.0 * (-13.0 + 7.0 * root), -gamma / 3.0];
        // The slope at a root of zero is none.
        let jacobian = at_end.as_deref().unwrap_or(jacobian);
        let (mut system, mut right) = (vec![0.0; n * n], vec![0.0; n]);
        for i in 0..n {
            right[i] = gamma * h * self.k[0][i] + (0..3).map(|s| e[s] * z[s * n + i]).sum::<f64>();
            for j in 0..n {
                system[i * n + j] =
                    if i == j { 1.0 } else { 0.0 } - gamma * h * jacobian[i * n + j];
            }
        }
        let estimate = Blocks::new(system, n).and_then(|system| system.solve(&right));
        let Some(estimate) = estimate else { return false };
        self.estimate = estimate;
        for s in 1..7 {
            self.k[s].copy_from_slice(&f[2]);
        }
        true
    }

    /// The error estimate in units of `scale`, the root of the mean square; not-a-number if the
    /// step is none.
    pub fn error(&self, scale: &dyn Fn(usize) -> f64) -> f64 {
        let n = self.x.len();
        let mut sum = 0.0;
        if let Some(series) = &self.series {
            let mut worst = 0.0_f64;
            for (i, c) in series.scaled[..n].iter().enumerate() {
                let noise = 4.0 * self.h * series.noise[i];
                let last = c[c.len() - 1].abs().max(c[c.len() - 2].abs()) / (scale(i) + noise);
                // Rounding of the field is no error of the series.
                let rounding =
                    64.0 * f64::EPSILON * self.h * (self.k[1][i].abs() + self.k[6][i].abs());
                let defect = series.defect[i] / (LARGEST_DEFECT * scale(i) + noise + rounding);
                if !(last <= f64::MAX && defect <= f64::MAX && self.y[i].is_finite()) {
                    return f64::NAN;
                }
                worst = worst.max(last).max(defect);
            }
            return worst;
        }
        for i in 0..n {
            let mut e = 0.0;
            for (c, k) in E.iter().zip(&self.k) {
                e += c * k[i];
            }
            let e = if self.jacobian.is_some() { self.estimate[i] } else { self.h * e } / scale(i);
            sum += e * e;
        }
        if self.y.iter().all(|y| y.is_finite()) { (sum / n as f64).sqrt() } else { f64::NAN }
    }

    /// The derivative of the continuous extension at the fraction `theta` of the step.
    pub fn slope_at(&self, theta: f64, out: &mut [f64]) {
        let rest = 1.0 - theta;
        let [a, b, c, d] = &self.extension;
        if let Some(series) = &self.series {
            out.iter_mut()
                .zip(&series.scaled)
                .for_each(|(out, c)| *out = horner_slope(c, theta) / self.h);
            return;
        }
        if self.jacobian.is_some() {
            for i in 0..out.len() {
                out[i] = (a[i] + theta * (2.0 * b[i] + theta * 3.0 * c[i])) / self.h;
            }
            return;
        }
        for i in 0..out.len() {
            let inner = c[i] + rest * d[i];
            let middle = b[i] + theta * inner;
            // d/dtheta of theta (a + rest (b + theta (c + rest d))).
            let slope = a[i] + rest * middle + theta * (-middle + rest * (inner - theta * d[i]));
            out[i] = slope / self.h;
        }
    }

    /// The Bernstein coefficients of degree 4 of a state's continuous extension.
    pub fn bernstein(&self, i: usize) -> [f64; 5] {
        let [a, b, c, d] = self.extension.each_ref().map(|e| e[i]);
        let x = self.x[i];
        if self.jacobian.is_some() {
            return [
                x,
                x + 0.25 * a,
                x + 0.5 * a + b / 6.0,
                x + 0.75 * a + 0.5 * b + 0.25 * c,
                x + a + b + c,
            ];
        }
        let first = x + 0.25 * (a + b);
        let third = x + 0.75 * a + 0.25 * (b + c);
        [x, first, x + 0.5 * a + b / 3.0 + (c + d) / 6.0, third, x + a]
    }

    /// The state at the fraction `theta` of the step.
    pub fn at(&self, theta: f64, out: &mut [f64]) {
        let rest = 1.0 - theta;
        let [a, b, c, d] = &self.extension;
        if let Some(series) = &self.series {
            for (i, c) in series.scaled[..out.len()].iter().enumerate() {
                out[i] = self.x[i] + theta * horner(&c[1..], theta);
            }
            return;
        }
        if self.jacobian.is_some() {
            for i in 0..out.len() {
                out[i] = self.x[i] + theta * (a[i] + theta * (b[i] + theta * c[i]));
            }
            return;
        }
        for i in 0..out.len() {
            out[i] = self.x[i] + theta * (a[i] + rest * (b[i] + theta * (c[i] + rest * d[i])));
        }
    }
}

/// The derivatives of a field with the value `f` by differences, or those given where a state is
/// zero.
fn slopes_beside(
    t: f64,
    at: &[f64],
    f: &[f64],
    given: &[f64],
    rhs: &mut RightHandSide<'_>,
) -> Vec<f64> {
    /// Of a state.
    const BESIDE: f64 = 1e-7;
    let n = at.len();
    let (mut beside, mut there) = (at.to_vec(), vec![0.0; n]);
    let mut slopes = given.to_vec();
    for j in (0..n).filter(|j| at[*j] != 0.0) {
        beside[j] = at[j] + BESIDE * at[j];
        rhs(t, &beside, &mut there);
        for i in 0..n {
            slopes[i * n + j] = (there[i] - f[i]) / (beside[j] - at[j]);
        }
        beside[j] = at[j];
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bernstein_coefficients_are_those_of_the_continuous_extension() {
        for jacobian in [None, Some(vec![-0.3])] {
            let mut step = Step::new(1);
            let mut rhs =
                |t: f64, x: &[f64], out: &mut [f64]| out[0] = -0.3 * x[0] + (3.0 * t).cos() + t * t;
            (step.t, step.x[0], step.jacobian) = (0.2, 1.5, jacobian);
            let mut first = [0.0];
            rhs(0.2, &[1.5], &mut first);
            step.k[0][0] = first[0];
            step.take(0.7, &mut rhs);
            let b = step.bernstein(0);
            for theta in [0.0, 0.1, 0.5, 0.8, 1.0_f64] {
                let w = 1.0 - theta;
                let basis = [
                    w.powi(4),
                    4.0 * theta * w.powi(3),
                    6.0 * (theta * w).powi(2),
                    4.0 * w * theta.powi(3),
                    theta.powi(4),
                ];
                let mut want = [0.0];
                step.at(theta, &mut want);
                let found: f64 = b.iter().zip(basis).map(|(b, p)| b * p).sum();
                assert!((found - want[0]).abs() < 1e-14, "{found} {want:?}");
            }
        }
    }
}
