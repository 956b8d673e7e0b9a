//! Growth of disturbances while an orbit passes a two-fold, for a delayed switch or a relay.
//!
//! A delay of d makes the scales x ~ d^2 across the surface and (y, z, t) ~ d along it: with them
//! the equation near the two-fold has no d to leading order. A band of half-width b (f+ until h
//! falls to -b, f- until it rises to b) makes them b and sqrt(b). Growth is then a number of order
//! 1 in these units, which depends on the chatter's phase, times what the phase makes of the past.

use nalgebra::SVector;

use twofold_integrate::delay::{DelayError, Delayed, History, Inside, LateSwitch, Own, Sides};
use twofold_integrate::roots::CrossingFinder;
use twofold_integrate::{Failure, Method, Stepper, Tolerance, WithStepper};
use twofold_num::elementary::sqrt;
use twofold_system::filippov::{gradient, lie_derivatives};
use twofold_system::{PiecewiseSmooth, System, Transition};

/// When the fields change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LateRule {
    /// f+ while h(x(t - delay)) > 0.
    Sharp {
        /// The delay.
        delay: f64,
    },
    /// The weight tanh gives to f+ at h(x(t - delay))/eps.
    Smooth {
        /// The delay.
        delay: f64,
        /// Width of the layer.
        eps: f64,
    },
    /// f+ until h falls to -band, f- until it rises to band.
    Relay {
        /// Half the width of the loop.
        band: f64,
    },
}

impl LateRule {
    /// Inner scales near a two-fold, across the surface and along it.
    pub fn scales(self) -> [f64; 2] {
        match self {
            Self::Sharp { delay } => [delay * delay, delay],
            Self::Smooth { delay, eps } => [eps.max(delay * delay), sqrt(eps).max(delay)],
            Self::Relay { band } => [band, sqrt(band)],
        }
    }
}

/// One passage: from attracting sliding through a two-fold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatePassageQuestion {
    /// The rule.
    pub rule: LateRule,
    /// A point of attracting sliding.
    pub start: [f64; 3],
    /// The two-fold.
    pub two_fold: [f64; 3],
    /// The exit is the first passage at so many inner scales from the two-fold: through the
    /// surface, or under a smooth rule, whose orbits leave along one side of it, through the plane
    /// in which the second component is the two-fold's.
    pub beyond: f64,
    /// Everything must have happened before this time.
    pub by: f64,
}

/// Growth of disturbances in a passage: displacement at the exit over size of the disturbance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LateGrowth {
    /// Of one across the surface, made where sliding stops to attract.
    pub across: f64,
    /// Of the worse of two along the surface, made there.
    pub along: f64,
    /// Of the worse of two along the surface, made at the start.
    pub carried_in: f64,
    /// The exit without a disturbance, seen from the two-fold, in inner scales along the surface.
    pub exit: [f64; 3],
}

/// Disturbances in the units of their direction: small enough to be linear to a per mille or so, if
/// they do not grow in these units.
const SIZE: f64 = 1e-4;
/// A response is linear up to here, in inner scales.
const LINEAR: f64 = 1e-2;
/// A disturbance that grows beyond that is made so many times smaller than would do.
const SMALLER: f64 = 10.0;
/// No disturbance is smaller than this: it must stay above the rounding of numbers of the size of
/// the two-fold's neighbourhood.
const LEAST: f64 = 1e-15;
/// Of a step's local error, for f64 series.
const TOLERANCE: Tolerance = Tolerance { rtol: 1e-16, atol: 1e-18 };
/// The same for the method of steps.
const SMOOTH_TOLERANCE: Tolerance = Tolerance { rtol: 1e-13, atol: 1e-15 };

/// Measures a passage. A growth that f64 cannot resolve is NaN.
///
/// # Errors
/// If the orbit cannot be followed, or does not pass the two-fold in time (then
/// [`Failure::NotApplicable`]).
pub fn late_growth<P: PiecewiseSmooth<3> + Clone>(
    system: &P,
    data: &System,
    question: &LatePassageQuestion,
) -> Result<LateGrowth, Failure> {
    let LatePassageQuestion { rule, two_fold, .. } = *question;
    let point = SVector::from(two_fold);
    let across = gradient(system, &point).normalize();
    // Any two directions along the surface.
    let other = SVector::<f64, 3>::ith(across.abs().imin(), 1.0);
    let first = across.cross(&other).normalize();
    let along = [first, across.cross(&first)];
    let exit = |at_start, at_kick| late_exit(system, data, question, at_start, at_kick);
    let none = SVector::zeros();
    let plain = exit(none, none)?;
    let [thin, wide] = rule.scales();
    // Of a disturbance of the size 1 in `unit`s, made at the two-fold or at the start.
    let grown = |direction: SVector<f64, 3>, unit: f64, late: bool| -> Result<f64, Failure> {
        let mut size = SIZE * unit;
        loop {
            let kick = direction * size;
            let response =
                (if late { exit(none, kick)? } else { exit(kick, none)? } - plain).norm();
            if response <= LINEAR * wide {
                return Ok(response / size);
            }
            size *= LINEAR * wide / response / SMALLER;
            if size < LEAST {
                return Ok(f64::NAN);
            }
        }
    };
    let mut growth = LateGrowth {
        across: grown(across, thin, true)?,
        along: 0.0,
        carried_in: 0.0,
        exit: ((plain - point) / wide).into(),
    };
    let worse = |a: f64, b: f64| if b.is_nan() { b } else { a.max(b) };
    for direction in along {
        growth.along = worse(growth.along, grown(direction, wide, true)?);
        growth.carried_in = worse(growth.carried_in, grown(direction, wide, false)?);
    }
    if growth.along.is_nan() {
        // Rounding before the two-fold grows as much, and hides what is left of the start.
        growth.carried_in = f64::NAN;
    }
    Ok(growth)
}

/// The exit of the orbit that is displaced by `at_start` at the start, and by `at_kick` where
/// sliding stops to attract.
///
/// # Errors
///
/// As of [`late_growth`].
pub fn late_exit<P: PiecewiseSmooth<3> + Clone>(
    system: &P,
    data: &System,
    question: &LatePassageQuestion,
    at_start: SVector<f64, 3>,
    at_kick: SVector<f64, 3>,
) -> Result<SVector<f64, 3>, Failure> {
    let x0 = SVector::from(question.start) + at_start;
    let follow = Follow { system, question, x0, kick: at_kick };
    let delayed = |delay, smooth| LateSwitch::Delayed { delay, smooth, history: History::Constant };
    let (switch, method, tolerance) = match question.rule {
        LateRule::Sharp { delay } => (delayed(delay, None), Method::Taylor, TOLERANCE),
        LateRule::Smooth { delay, eps } => {
            (delayed(delay, Some((Transition::Tanh, eps))), Method::Dopri5, SMOOTH_TOLERANCE)
        }
        LateRule::Relay { band } => {
            (LateSwitch::Relay { band, inside: Inside::Sign }, Method::Taylor, TOLERANCE)
        }
    };
    let delayed = Delayed { sides: Sides::new(system, data), switch, x0 };
    delayed
        .with_stepper(method, None, tolerance, follow)
        .unwrap_or_else(|error| Err(refused(&error)))
}

fn refused(error: &DelayError) -> Failure {
    Failure::NotApplicable { method: Method::Taylor.name(), why: error.to_string() }
}

/// An orbit up to its exit.
struct Follow<'a, P> {
    system: &'a P,
    question: &'a LatePassageQuestion,
    x0: SVector<f64, 3>,
    kick: SVector<f64, 3>,
}

impl<P: PiecewiseSmooth<3>> Follow<'_, P> {
    /// Whether a passage of the exit's section lies beyond the two-fold's neighbourhood.
    fn is_out(&self, place: &SVector<f64, 3>) -> bool {
        let LatePassageQuestion { rule, two_fold, beyond, .. } = self.question;
        (place - SVector::from(*two_fold)).norm() > beyond * rule.scales()[1]
    }

    /// Whether sliding repels at `x`.
    fn repels(&self, x: &SVector<f64, 3>) -> bool {
        let (plus, minus) = lie_derivatives(self.system, x);
        minus - plus < 0.0
    }

    fn late(&self) -> Failure {
        let why = format!("the orbit does not leave the two-fold until t = {}", self.question.by);
        Failure::NotApplicable { method: Method::Taylor.name(), why }
    }
}

impl<P: PiecewiseSmooth<3>> WithStepper<3> for Follow<'_, P> {
    type Answer = Result<SVector<f64, 3>, Failure>;
    fn with<M: Stepper<3>>(self, mut stepper: M) -> Self::Answer {
        let Self { system, question: LatePassageQuestion { rule, two_fold, by, .. }, x0, kick } =
            self;
        let (mut passages, mut passed) = (CrossingFinder::default(), false);
        stepper.restart(&Own, 0.0, x0, *by, f64::INFINITY)?;
        loop {
            let step = stepper.step(&Own)?;
            let (t, x) = (step.t1, step.x1);
            let found = match rule {
                LateRule::Smooth { .. } => passages.through_plane(&step, 1, two_fold[1]),
                _ => passages.in_step(&step, |x| system.switching(x)),
            };
            for passage in found {
                let place = step.at(passage.theta);
                if passed && self.is_out(&place) {
                    return Ok(place);
                }
            }
            if !passed && self.repels(&x) {
                passed = true;
                stepper.restart_again(&Own, t, x + kick, *by, f64::INFINITY)?;
            } else if t >= *by {
                return Err(self.late());
            }
        }
    }
}
