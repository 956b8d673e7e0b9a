//! Rigorous crossings of a coordinate plane.
//!
//! While the box W of a step meets the plane, the flow must cross the plane in one direction on all
//! of W: then no solution crosses twice in the step, and none is missed. The step that crosses is
//! repeated with the length after which the centre lies on the plane; from there, all states are
//! projected along the flow by the map
//!
//! ```text
//! pi(x) = phi(tau(x), x),   D pi = (1 - f(pi) n^T / (n^T f(pi))) D phi(tau, x),
//! ```
//!
//! n being the plane's normal, in mean value form, so that the set keeps its shape and the crossing
//! costs no width to first order.

use nalgebra::SVector;

use super::Error;
use super::flow::Flow;
use super::linear::{self, IMatrix, IVector};
use super::set::Set;
use twofold_num::{Arithmetic, Elementary, Enclosure, Interval};

/// The plane on which a coordinate has a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisPlane {
    /// Index of the coordinate.
    pub axis: usize,
    /// Its value.
    pub value: f64,
}

/// With less time left than this, the time is up.
const LEAST_LEFT: f64 = 1e-9;

/// A crossing: all states of the set lie on the plane.
#[derive(Clone, Debug)]
pub struct Crossing<S, const N: usize> {
    /// The set of crossing points.
    pub set: Set<S, N>,
    /// Whether the coordinate grows there.
    pub upward: bool,
    /// When the crossings happen.
    pub time: S,
}

impl<S: Enclosure, const N: usize> Flow<S, N> {
    /// The next crossing of `plane` by all solutions from `set`, before t = `latest`.
    ///
    /// `set` lies on one side of the plane, or on it (as after a crossing; that one does not
    /// count).
    ///
    /// # Errors
    /// See [`Error`]; nothing is returned that is not proved.
    pub fn next_crossing(
        &mut self,
        set: &Set<S, N>,
        plane: AxisPlane,
        latest: f64,
    ) -> Result<Crossing<S, N>, Error> {
        let mut set = set.clone();
        let value = Interval::from_f64(plane.value);
        let wide = |set: &Set<S, N>| Error::NotTransversal {
            time: set.time().interval().midpoint(),
            near: set.hull().iter().copied().collect(),
        };
        let mut longest = f64::INFINITY;
        loop {
            let now = set.time().interval().lower();
            if latest - now < LEAST_LEFT {
                return Err(Error::NoCrossing(latest));
            }
            let proved = self.prove(&set, longest.min(latest - now))?;
            longest = f64::INFINITY;
            let height = proved.stay[plane.axis] - value;
            if !height.contains(0.0) {
                set = self.advance(&set, &proved, proved.longest)?;
                continue;
            }
            let speed = proved.speed[plane.axis];
            if speed.contains(0.0) {
                // A shorter step stays in a smaller box.
                longest = 0.5 * proved.longest;
                if longest < 1e-9 {
                    return Err(wide(&set));
                }
                continue;
            }
            let upward = speed.is_positive();
            let start = set.hull()[plane.axis] - value;
            let departing = set.on() == Some((plane.axis, plane.value));
            if !departing && start.contains(0.0) {
                return Err(wide(&set));
            }
            // Away from the plane, or towards it?
            if departing || start.is_positive() == upward {
                let after = self.advance(&set, &proved, proved.longest)?;
                let height = after.hull()[plane.axis] - value;
                if if upward { !height.is_positive() } else { !height.is_negative() } {
                    return Err(wide(&set));
                }
                set = after;
                continue;
            }
            match self.guess_crossing(&proved, plane.axis, plane.value) {
                Some(h) => {
                    let near = self.advance(&set, &proved, h)?;
                    return self.project(&near, plane, upward);
                }
                None => {
                    // The centre does not get there in this step; others might.
                    let after = self.advance(&set, &proved, proved.longest)?;
                    let height = after.hull()[plane.axis] - value;
                    // All on the side they came from: the guess is no proof that they are.
                    if height.contains(0.0) || height.is_positive() != start.is_positive() {
                        longest = 0.5 * proved.longest;
                        if longest < 1e-9 {
                            return Err(wide(&set));
                        }
                        continue;
                    }
                    set = after;
                }
            }
        }
    }

    /// Projects a set around the plane onto it, along the flow.
    fn project(
        &mut self,
        set: &Set<S, N>,
        plane: AxisPlane,
        upward: bool,
    ) -> Result<Crossing<S, N>, Error> {
        let axis = plane.axis;
        let hull = set.hull();
        let wide = || Error::NotTransversal {
            time: set.time().interval().midpoint(),
            near: hull.iter().copied().collect(),
        };
        let height = hull[axis] - Interval::from_f64(plane.value);
        // A box that all solutions from the hull stay in until they have met the plane, forward or
        // backward in time: by the first-order inclusion hull + [-d, d] f(W) in W, with d long
        // enough to reach the plane at the least speed on W.
        let (mut speed, _) = self.right_side(&hull);
        let mut stay = hull;
        let mut found = false;
        for _ in 0..20 {
            let slowest = speed[axis].mignitude();
            if slowest == 0.0 || speed[axis].is_positive() != upward {
                return Err(wide());
            }
            let within = (Interval::from_f64(height.magnitude()) / Interval::from_f64(slowest))
                .upper()
                * 1.01;
            let span = Interval::symmetric(within);
            let reach: IVector<N> = IVector::from_fn(|i, _| hull[i] + span * speed[i]);
            if (0..N).all(|i| reach[i].interior(stay[i]))
                && height.magnitude() < (speed[axis] * Interval::from_f64(within)).mignitude()
            {
                found = true;
                break;
            }
            stay = reach.map(|x: Interval| {
                x + Interval::symmetric(
                    0.01 * x.width() + 1e-16 * x.magnitude() + f64::MIN_POSITIVE,
                )
            });
            speed = self.right_side(&stay).0;
        }
        if !found {
            return Err(wide());
        }
        let (speed, jacobian) = self.right_side(&stay);
        let delay = -height / speed[axis];
        // The centre's own crossing.
        let centre = *set.centre();
        let gap = centre[axis] - S::from_f64(plane.value);
        let own = -gap / S::from_interval(speed[axis]);
        let value = SVector::from_fn(|i, _| {
            if i == axis {
                S::from_f64(plane.value)
            } else {
                centre[i] + own * S::from_interval(speed[i])
            }
        });
        // D phi(tau, .) is within exp(L |tau|) - 1 of 1.
        let growth = (Interval::from_f64(linear::norm(&jacobian))
            * Interval::from_f64(delay.magnitude()))
        .exp()
            - Interval::one();
        let off = Interval::symmetric(growth.upper());
        let moved = linear::identity::<N>().map(|x| x + off);
        let slope: IVector<N> = IVector::from_fn(|i, _| speed[i] / speed[axis]);
        let projection: IMatrix<N> = IMatrix::from_fn(|i, j| {
            if i == axis { Interval::zero() } else { moved[(i, j)] - slope[i] * moved[(axis, j)] }
        });
        let time = set.time() + S::from_interval(delay);
        let on = Some((axis, plane.value));
        let set = set.image(value, &projection, &projection, S::from_interval(delay), on)?;
        Ok(Crossing { set, upward, time })
    }
}
