//! How a disturbance grows while an orbit passes a two-fold under a sharp delayed switch.
//!
//! A delay of d makes the scales x ~ d^2 across the surface and (y, z, t) ~ d along it: with them the equation near the two-fold has no d to
//! leading order. Growth is then a number of order 1 in these units, which depends on the chatter's phase.

use nalgebra::SVector;

use twofold_integrate::delay::{DelayError, Delayed, DelayedSwitch, History, Own, Sides};
use twofold_integrate::roots::CrossingFinder;
use twofold_integrate::{Failure, Method, Stepper, Tolerance, WithStepper};
use twofold_system::filippov::{gradient, lie_derivatives};
use twofold_system::{PiecewiseSmooth, System};

/// One passage: from attracting sliding through a two-fold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatePassageQuestion {
    /// The delay.
    pub delay: f64,
    /// A point of attracting sliding.
    pub start: [f64; 3],
    /// The two-fold.
    pub two_fold: [f64; 3],
    /// The exit is the first passage through the surface at so many delays from the two-fold.
    pub beyond: f64,
    /// Everything must have happened before this time.
    pub by: f64,
}

/// What a passage makes of disturbances: size of the exit's displacement over that of the disturbance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LateGrowth {
    /// Of one across the surface, made where sliding stops to attract.
    pub across: f64,
    /// Of the worse of two along the surface, made there.
    pub along: f64,
    /// Of the worse of two along the surface, made at the start.
    pub carried_in: f64,
    /// The exit without a disturbance, seen from the two-fold, in delays.
    pub exit: [f64; 3],
}

/// Disturbances in the units of their direction: small enough to be linear to a per mille or so.
const SIZE: f64 = 1e-4;
/// Of a step's local error, for f64 series.
const TOLERANCE: Tolerance = Tolerance { rtol: 1e-16, atol: 1e-18 };

/// Measures a passage.
///
/// # Errors
/// If the orbit cannot be followed, or does not pass the two-fold in time (then [`Failure::NotApplicable`]).
pub fn late_growth<P: PiecewiseSmooth<3> + Clone>(
    system: &P,
    data: &System,
    question: &LatePassageQuestion,
) -> Result<LateGrowth, Failure> {
    let LatePassageQuestion { delay, start, two_fold, .. } = *question;
    let point = SVector::from(two_fold);
    let across = gradient(system, &point).normalize();
    // Any two directions along the surface.
    let other = SVector::<f64, 3>::ith(across.abs().imin(), 1.0);
    let first = across.cross(&other).normalize();
    let along = [first, across.cross(&first)];
    let exit = |at_start: SVector<f64, 3>, at_kick: SVector<f64, 3>| {
        let x0 = SVector::from(start) + at_start;
        let switch = DelayedSwitch { delay, smooth: None, history: History::Constant };
        let delayed = Delayed { sides: Sides::new(system, data), switch, x0 };
        let follow = Follow { system, question, x0, kick: at_kick };
        delayed.with_stepper(Method::Taylor, None, TOLERANCE, follow).unwrap_or_else(|error| Err(refused(&error)))
    };
    let none = SVector::zeros();
    let plain = exit(none, none)?;
    let grown = |found: SVector<f64, 3>, size: f64| (found - plain).norm() / size;
    let (thin, wide) = (SIZE * delay * delay, SIZE * delay);
    let mut growth = LateGrowth {
        across: grown(exit(none, across * thin)?, thin),
        along: 0.0,
        carried_in: 0.0,
        exit: ((plain - point) / delay).into(),
    };
    for direction in along {
        growth.along = growth.along.max(grown(exit(none, direction * wide)?, wide));
        growth.carried_in = growth.carried_in.max(grown(exit(direction * wide, none)?, wide));
    }
    Ok(growth)
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

impl<P: PiecewiseSmooth<3>> WithStepper<3> for Follow<'_, P> {
    type Answer = Result<SVector<f64, 3>, Failure>;
    fn with<M: Stepper<3>>(self, mut stepper: M) -> Self::Answer {
        let Self { system, question, x0, kick } = self;
        let LatePassageQuestion { delay, two_fold, beyond, by, .. } = *question;
        let point = SVector::from(two_fold);
        let (mut passages, mut passed) = (CrossingFinder::default(), false);
        stepper.restart(&Own, 0.0, x0, by, f64::INFINITY)?;
        loop {
            let step = stepper.step(&Own)?;
            let (t, x) = (step.t1, step.x1);
            for passage in passages.in_step(&step, |x| system.switching(x)) {
                let place = step.at(passage.theta);
                if passed && (place - point).norm() > beyond * delay {
                    return Ok(place);
                }
            }
            let (plus, minus) = lie_derivatives(system, &x);
            if !passed && minus - plus < 0.0 {
                passed = true;
                stepper.restart_again(&Own, t, x + kick, by, f64::INFINITY)?;
            } else if t >= by {
                let why = format!("the orbit does not leave the two-fold until t = {by}");
                return Err(Failure::NotApplicable { method: Method::Taylor.name(), why });
            }
        }
    }
}
