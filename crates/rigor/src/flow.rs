//! Validated Taylor steps.
//!
//! A step of length h from a set X needs a box W that all solutions stay in. W is guessed from the
//! series over X, and proved by the high-order enclosure: if
//!
//! ```text
//! sum_{k<=K} [0,h]^k x_k(X) + [0,h]^(K+1) x_(K+1)(W)  lies in the interior of  W,
//! ```
//!
//! x_k being the Taylor coefficients as functions of the state, then every solution from X exists
//! and stays in W up to h (Corliss & Rihm 1996; Nedialkov & Jackson 1999), and its Lagrange
//! remainder lies in h^(K+1) x_(K+1)(W). The test needs exactly the two series that the step needs
//! anyway. It also decides the step size: the remainder must stay below the tolerance. So a thin
//! layer cannot be jumped: the box W sees it.

use nalgebra::{SMatrix, SVector};

use super::Error;
use super::linear::{self, IMatrix, IVector};
use super::set::Set;
use twofold_num::series::{Constants, Solution};
use twofold_num::{Arithmetic, Dual, Elementary, Enclosure, Interval, Tape, elementary};

/// Options of a [`Flow`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowOptions {
    /// Degree of the series.
    pub order: usize,
    /// Largest remainder of a step, in each component.
    pub tolerance: f64,
    /// Maximum length of a step.
    pub longest_step: f64,
}

impl FlowOptions {
    /// For [`Interval`]s.
    pub const PLAIN: Self = Self { order: 22, tolerance: 1e-17, longest_step: 1.0 };
    /// For [`Ball`](twofold_num::Ball)s.
    pub const EXTENDED: Self = Self { order: 30, tolerance: 1e-31, longest_step: 1.0 };
}

/// The shortest step tried.
const SHORTEST_STEP: f64 = 1e-12;

/// The flow of an autonomous equation x' = f(x), on sets. `S` is the arithmetic of the sets'
/// centres.
#[derive(Clone, Debug)]
pub struct Flow<S, const N: usize> {
    settings: FlowOptions,
    centre: Solution<S>,
    states: Solution<Dual<Interval, N>>,
    stay: Solution<Interval>,
    stay_with_derivative: Solution<Dual<Interval, N>>,
    slope: Solution<Dual<Interval, N>>,
    next_step: f64,
    steps: u64,
}

/// A step that has been proved.
pub(super) struct Proved<S, const N: usize> {
    /// All solutions stay here until `longest`.
    pub stay: IVector<N>,
    /// Their speed there.
    pub speed: IVector<N>,
    /// Series at the centre, over the set, and the remainder's coefficients.
    centre: Vec<SVector<S, N>>,
    states: Vec<(IVector<N>, IMatrix<N>)>,
    remainder: IVector<N>,
    remainder_derivative: Option<IMatrix<N>>,
    /// The length up to which the step is proved.
    pub longest: f64,
}

impl<S: Enclosure, const N: usize> Flow<S, N> {
    /// The flow of the equation on `tape`, its constants being the decimal numbers that were given.
    pub fn new(tape: &Tape, settings: FlowOptions) -> Self {
        let k = settings.order;
        Self {
            settings,
            centre: Solution::new(k, tape, Constants::Decimal),
            states: Solution::new(k, tape, Constants::Decimal),
            stay: Solution::new(k + 1, tape, Constants::Decimal),
            stay_with_derivative: Solution::new(k + 1, tape, Constants::Decimal),
            slope: Solution::new(1, tape, Constants::Decimal),
            next_step: settings.longest_step,
            steps: 0,
        }
    }

    /// Steps made so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// The right-hand side and its Jacobian matrix over a box.
    pub fn right_side(&mut self, states: &IVector<N>) -> (IVector<N>, IMatrix<N>) {
        let x: Vec<Dual<Interval, N>> = (0..N).map(|i| Dual::variable(states[i], i)).collect();
        self.slope.expand(&x);
        let f = |i: usize| self.slope.component(i)[1];
        (IVector::from_fn(|i, _| f(i).value), IMatrix::from_fn(|i, j| f(i).partials[j]))
    }

    /// Proves a step from `set`, as long as the tolerance allows but at most `longest`.
    pub(super) fn prove(&mut self, set: &Set<S, N>, longest: f64) -> Result<Proved<S, N>, Error> {
        let k = self.settings.order;
        let hull = set.hull();
        let failed = |step: f64| Error::NoEnclosure {
            time: set.time().interval().midpoint(),
            step,
            near: hull.iter().copied().collect(),
        };
        let x: Vec<Dual<Interval, N>> = (0..N).map(|i| Dual::variable(hull[i], i)).collect();
        self.states.expand(&x);
        let states: Vec<(IVector<N>, IMatrix<N>)> = (0..=k)
            .map(|n| {
                let c = |i: usize| self.states.component(i)[n];
                (IVector::from_fn(|i, _| c(i).value), IMatrix::from_fn(|i, j| c(i).partials[j]))
            })
            .collect();
        let mut h = self.next_step.min(longest).min(self.settings.longest_step);
        let tolerance = self.settings.tolerance;
        let power = 1.0 / (k + 1) as f64;
        loop {
            if h < SHORTEST_STEP || h.is_nan() {
                return Err(failed(h));
            }
            // The polynomial over all of the step, then room for the remainder, and for rounding
            // the test itself.
            let span = Interval::between(0.0, h);
            let reach: IVector<N> =
                states.iter().rev().fold(IVector::from_element(Interval::zero()), |s, c| {
                    IVector::from_fn(|i, _| s[i] * span + c.0[i])
                });
            let stay: IVector<N> = reach.map(|x: Interval| {
                x + Interval::symmetric(tolerance + 4.0 * f64::EPSILON * x.magnitude())
            });
            let ratio: f64 = if stay.iter().all(|x| x.is_bounded()) {
                let (coefficient, derivative) =
                    self.last_coefficient(&stay, h, set.has_derivative());
                let span_power = (0..k).fold(span, |p, _| p * span);
                let largest = coefficient.iter().fold(0.0, |m: f64, c| {
                    m.max((*c * Interval::from_f64(span_power.upper())).magnitude())
                });
                // The inclusion itself: polynomial plus remainder, in the interior of the box.
                let inside =
                    (0..N).all(|i| (reach[i] + span_power * coefficient[i]).interior(stay[i]));
                let ratio = elementary::pow(tolerance / largest, power);
                if inside && largest <= tolerance {
                    let (speed, _) = self.right_side(&stay);
                    self.next_step = h * (0.9 * ratio).clamp(0.5, 2.0);
                    let centre = set.centre();
                    self.centre.expand(centre.as_slice());
                    let centre = (0..=k)
                        .map(|n| SVector::from_fn(|i, _| self.centre.component(i)[n]))
                        .collect();
                    return Ok(Proved {
                        stay,
                        speed,
                        centre,
                        states,
                        remainder: coefficient,
                        remainder_derivative: derivative,
                        longest: h,
                    });
                }
                ratio
            } else {
                0.0
            };
            h *= if ratio.is_nan() { 0.3 } else { (0.85 * ratio).clamp(0.3, 0.9) };
        }
    }

    /// Coefficient K + 1 over a box, and of the derivative with respect to the state at the step's
    /// start.
    fn last_coefficient(
        &mut self,
        stay: &IVector<N>,
        h: f64,
        derivative: bool,
    ) -> (IVector<N>, Option<IMatrix<N>>) {
        let n = self.settings.order + 1;
        if !derivative {
            self.stay.expand(stay.as_slice());
            return (IVector::from_fn(|i, _| self.stay.component(i)[n]), None);
        }
        // V' = Df V from 1 stays within exp(L h) - 1 of 1, with L the norm of Df over the box
        // (Gronwall).
        let (_, jacobian) = self.right_side(stay);
        let growth = (Interval::from_f64(linear::norm(&jacobian)) * Interval::from_f64(h)).exp()
            - Interval::one();
        let off = Interval::symmetric(growth.upper());
        let x: Vec<Dual<Interval, N>> = (0..N)
            .map(|i| Dual {
                value: stay[i],
                partials: std::array::from_fn(|j| if i == j { off + Interval::one() } else { off }),
            })
            .collect();
        self.stay_with_derivative.expand(&x);
        let c = |i: usize| self.stay_with_derivative.component(i)[n];
        (IVector::from_fn(|i, _| c(i).value), Some(IMatrix::from_fn(|i, j| c(i).partials[j])))
    }

    /// The set after `h`, at most the length proved.
    pub(super) fn advance(
        &mut self,
        set: &Set<S, N>,
        proved: &Proved<S, N>,
        h: f64,
    ) -> Result<Set<S, N>, Error> {
        debug_assert!(h <= proved.longest);
        self.steps += 1;
        let (t, step) = (S::from_f64(h), Interval::from_f64(h));
        let last = (0..self.settings.order).fold(step, |p, _| p * step);
        let value: SVector<S, N> =
            proved.centre.iter().rev().fold(SVector::from_element(S::zero()), |s, c| {
                SVector::from_fn(|i, _| s[i] * t + c[i])
            });
        // The series of the centre is exact but for its remainder, which is that of every solution
        // in the set.
        let value =
            SVector::from_fn(|i, _| value[i] + S::from_interval(proved.remainder[i] * last));
        let jacobian: IMatrix<N> = proved
            .states
            .iter()
            .rev()
            .fold(SMatrix::from_element(Interval::zero()), |s: IMatrix<N>, c| {
                IMatrix::from_fn(|i, j| s[(i, j)] * step + c.1[(i, j)])
            });
        let full = match &proved.remainder_derivative {
            Some(r) => linear::sum(&jacobian, &r.map(|x| x * last)),
            None => jacobian,
        };
        set.image(value, &jacobian, &full, t, None)
    }

    /// A guess, not rigorous, at when within the step a coordinate of the centre takes a value.
    pub(super) fn guess_crossing(
        &self,
        proved: &Proved<S, N>,
        axis: usize,
        value: f64,
    ) -> Option<f64> {
        let c: Vec<f64> = proved.centre.iter().map(|c| c[axis].interval().midpoint()).collect();
        let at = |t: f64| c.iter().rev().fold((0.0, 0.0), |(p, d), c| (p * t + c, d * t + p));
        let (mut low, mut high) = (0.0, proved.longest);
        let below = at(low).0 < value;
        if (at(high).0 < value) == below {
            return None;
        }
        let mut t = 0.5 * (low + high);
        for _ in 0..200 {
            let (p, d) = at(t);
            if (p < value) == below {
                low = t
            } else {
                high = t
            }
            let newton = t - (p - value) / d;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if next == t {
                break;
            }
            t = next;
        }
        Some(t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_num::Ball;
    use twofold_num::tape::Recorded;

    /// Integrates to `t` and returns the set there.
    fn to<S: Enclosure>(flow: &mut Flow<S, 2>, mut set: Set<S, 2>, t: f64) -> Set<S, 2> {
        loop {
            let left = t - set.time().interval().midpoint();
            if left <= 0.0 {
                return set;
            }
            let proved = flow.prove(&set, left).unwrap();
            set = flow.advance(&set, &proved, proved.longest).unwrap();
        }
    }

    fn pendulum() -> Tape {
        Tape::record(2, |x: &[Recorded]| vec![x[1], -x[0].sin()])
    }

    #[test]
    fn a_rotation_does_not_wrap() {
        // x'' = -x: the set only turns. After 100 units of time (16 turns) the box has its size, up
        // to rounding.
        let tape = Tape::record(2, |x: &[Recorded]| vec![x[1], -x[0]]);
        let mut flow = Flow::<Interval, 2>::new(&tape, FlowOptions::PLAIN);
        let start =
            SVector::from([Interval::between(1.0 - 1e-3, 1.0 + 1e-3), Interval::symmetric(1e-3)]);
        let set = to(&mut flow, Set::new(start, true), 100.0);
        let hull = set.hull();
        let (c, s) = (0.8623188722876839, -0.5063656411097588); // cos 100, sin 100
        assert!(hull[0].contains(c) && hull[1].contains(-s), "{hull:?}");
        // The widest direction of a turned square is its diagonal.
        assert!(hull.iter().all(|x| x.width() < 2.0e-3 * 1.415), "{hull:?}");
        let v = set.derivative().unwrap();
        for (i, j, want) in [(0, 0, c), (0, 1, s), (1, 0, -s), (1, 1, c)] {
            assert!(v[(i, j)].contains(want) && v[(i, j)].width() < 1e-12, "{v:?}");
        }
    }

    #[test]
    fn both_precisions_agree_and_the_derivative_contains_differences() {
        let start = [1.0, 0.5];
        let mut plain = Flow::<Interval, 2>::new(&pendulum(), FlowOptions::PLAIN);
        let mut extended = Flow::<Ball, 2>::new(&pendulum(), FlowOptions::EXTENDED);
        let a = to(&mut plain, Set::new(SVector::from(start.map(Interval::from_f64)), true), 10.0);
        let b = to(&mut extended, Set::new(SVector::from(start.map(Ball::from_f64)), false), 10.0);
        let (wide, narrow) = (a.hull(), b.states());
        for i in 0..2 {
            assert!(wide[i].width() < 1e-12, "{wide:?}");
            assert!(narrow[i].interval().subset(wide[i]), "{:?} in {:?}", narrow[i], wide[i]);
            assert!(b.spread()[i].width() < 1e-26, "{:?}", b.spread());
        }
        // The set of a shifted start, by the mean value theorem.
        let shifted = [start[0] + 1e-6, start[1]];
        let c =
            to(&mut plain, Set::new(SVector::from(shifted.map(Interval::from_f64)), true), 10.0);
        let hull = Interval::between(start[0], shifted[0]);
        let over = to(
            &mut plain,
            Set::new(SVector::from([hull, Interval::from_f64(start[1])]), true),
            10.0,
        );
        let v = over.derivative().unwrap();
        for i in 0..2 {
            let slope = (c.hull()[i] - wide[i])
                / (Interval::from_f64(shifted[0]) - Interval::from_f64(start[0]));
            assert!(slope.intersection(v[(i, 0)]).is_ok(), "{slope:?} and {:?}", v[(i, 0)]);
            assert!(c.hull()[i].subset(over.hull()[i]) && wide[i].subset(over.hull()[i]));
        }
    }

    #[test]
    fn a_solution_that_ends_is_not_enclosed_beyond_its_end() {
        // x' = x^2 from 1 is infinite at t = 1.
        let tape = Tape::record(2, |x: &[Recorded]| vec![x[0] * x[0], x[1]]);
        let mut flow = Flow::<Interval, 2>::new(&tape, FlowOptions::PLAIN);
        let mut set = Set::new(SVector::from([Interval::one(), Interval::one()]), false);
        let error = loop {
            match flow.prove(&set, 2.0) {
                Ok(p) => set = flow.advance(&set, &p, p.longest).unwrap(),
                Err(e) => break e,
            }
            assert!(set.time().upper() < 1.0);
        };
        assert!(matches!(error, Error::NoEnclosure { .. }));
    }
}
