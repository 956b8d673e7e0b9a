//! Steps of Dormand & Prince's method of order 5 (1980) for any number of states, with the continuous extension of order 4 (Hairer, Norsett &
//! Wanner 1993, sec. II.6).

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
pub(crate) const E: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339_200.0, 22.0 / 525.0, -1.0 / 40.0];
const D: [f64; 7] = [
    -12_715_105_075.0 / 11_282_082_432.0,
    0.0,
    87_487_479_700.0 / 32_700_410_799.0,
    -10_690_763_975.0 / 1_880_347_072.0,
    701_980_252_875.0 / 199_316_789_632.0,
    -1_453_857_185.0 / 822_651_844.0,
    69_997_945.0 / 29_380_423.0,
];

/// Writes the derivatives at a time and state.
pub(crate) type RightHandSide<'a> = dyn FnMut(f64, &[f64], &mut [f64]) + 'a;

/// A step and the room for it.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    /// Where it begins.
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
        }
    }

    /// Makes a step of length `h` from where it begins; `rhs` writes the derivatives.
    pub fn take(&mut self, h: f64, rhs: &mut RightHandSide<'_>) {
        self.h = h;
        let n = self.x.len();
        for s in 1..7 {
            let (done, open) = self.k.split_at_mut(s);
            for i in 0..n {
                let mut sum = 0.0;
                for (a, k) in A[s].iter().zip(done.iter()) {
                    sum += a * k[i];
                }
                self.stage[i] = self.x[i] + h * sum;
            }
            rhs(self.t + C[s] * h, &self.stage, &mut open[0]);
        }
        // The last stage is at the end.
        std::mem::swap(&mut self.y, &mut self.stage);
        for i in 0..n {
            let difference = self.y[i] - self.x[i];
            let bend = h * self.k[0][i] - difference;
            self.extension[0][i] = difference;
            self.extension[1][i] = bend;
            self.extension[2][i] = difference - h * self.k[6][i] - bend;
            let mut sum = 0.0;
            for (d, k) in D.iter().zip(&self.k) {
                sum += d * k[i];
            }
            self.extension[3][i] = h * sum;
        }
    }

    /// The error estimate in units of `scale`, the root of the mean square; not-a-number if the step is none.
    pub fn error(&self, scale: &dyn Fn(usize) -> f64) -> f64 {
        let n = self.x.len();
        let mut sum = 0.0;
        for i in 0..n {
            let mut e = 0.0;
            for (c, k) in E.iter().zip(&self.k) {
                e += c * k[i];
            }
            let e = self.h * e / scale(i);
            sum += e * e;
        }
        if self.y.iter().all(|y| y.is_finite()) { (sum / n as f64).sqrt() } else { f64::NAN }
    }

    /// The derivative of the continuous extension at the fraction `theta` of the step.
    pub fn slope_at(&self, theta: f64, out: &mut [f64]) {
        let rest = 1.0 - theta;
        let [a, b, c, d] = &self.extension;
        for i in 0..out.len() {
            let inner = c[i] + rest * d[i];
            let middle = b[i] + theta * inner;
            // d/dtheta of theta (a + rest (b + theta (c + rest d))).
            let slope = a[i] + rest * middle + theta * (-middle + rest * (inner - theta * d[i]));
            out[i] = slope / self.h;
        }
    }

    /// The state at the fraction `theta` of the step.
    pub fn at(&self, theta: f64, out: &mut [f64]) {
        let rest = 1.0 - theta;
        let [a, b, c, d] = &self.extension;
        for i in 0..out.len() {
            out[i] = self.x[i] + theta * (a[i] + rest * (b[i] + theta * (c[i] + rest * d[i])));
        }
    }
}
