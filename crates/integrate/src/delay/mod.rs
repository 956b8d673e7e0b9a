//! Switches that depend on the past. Delayed: x' = f- + (f+ - f-) phi(h(x(t - delay))/eps), and its
//! limit eps -> 0, f+ while h(x(t - delay)) > 0 and f- otherwise. A relay with memory: f+ until h
//! falls to -band, f- until it rises to band.
//!
//! Jeffrey (2013), end of sec. 4.3, names the delay as a fourth way to resolve a discontinuity and
//! leaves it out. The relay is the sharp form of the hysteresis there (Tsypkin 1984).
//!
//! - The sharp rule: between switches the motion follows a smooth field. Zeros of h are located on
//!   dense output, and each causes a switch one delay later, so the only past that is kept is a
//!   queue of pending switches. Every switch ends a step.
//! - The relay: the same with passages of the band's far edge, each of which is a switch at once.
//! - The smooth rule: the method of steps (Bellman 1961; Hairer, Norsett & Wanner 1993, sec. II.17;
//!   Bellen & Zennaro 2003). No step is longer than the delay, so that its stages ask only for a
//!   past that is known: the continuous extensions of the steps in the last delay. Where a jump of
//!   a derivative arrives that the method's order can see, a step ends.
//!
//! All are followed by [`Stepper`](super::Stepper)s with the equation inside: the field that a
//! driver hands them is not looked at ([`Own`]).

mod past;
mod sharp;
mod smooth;
mod tangent;

use std::sync::Arc;

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::method::{Method, WithStepper};
use super::roots::{Crossing, CrossingFinder};
use super::step::{Failure, Step, Tolerance};
use super::{Dopri5, Guarded, Radau5, Taylor};
use past::Cut;
use twofold_num::tape::{Operation, Replay};
use twofold_num::{Elementary, Tape};
use twofold_system::singular::Ends;
use twofold_system::{Field, PiecewiseSmooth, System, Transition, VectorField};

use sharp::Sharp;
use smooth::Smooth;
pub use tangent::{Carry, Shift, TangentStepper, Varied, WithTangent};

/// The state before the start of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum History {
    /// At the start, all the time.
    #[default]
    Constant,
    /// On the orbit of the system without delay that leads to the start.
    Flow,
}

impl History {
    /// The name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            History::Constant => "constant",
            History::Flow => "flow",
        }
    }
}

/// The field with which a relay begins inside its band, where both f+ and f- can hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Inside {
    /// f+ where h > 0, f- otherwise.
    #[default]
    Sign,
    /// f+.
    Plus,
    /// f-.
    Minus,
}

impl Inside {
    /// The name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Inside::Sign => "sign",
            Inside::Plus => "plus",
            Inside::Minus => "minus",
        }
    }

    /// Whether a relay with this `band` begins with f+ where the switching function is `h`.
    pub fn begins_with_plus(self, h: f64, band: f64) -> bool {
        match self {
            _ if h.abs() > band => h > 0.0,
            Inside::Sign => h > 0.0,
            Inside::Plus => true,
            Inside::Minus => false,
        }
    }
}

/// Why a run with a delayed switch or a relay cannot begin.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DelayError {
    /// The method cannot follow this switch.
    #[error("{method} cannot follow a switch of this kind: take {instead}")]
    Method {
        /// Its name.
        method: &'static str,
        /// Those that can.
        instead: &'static str,
    },
    /// The orbit without delay cannot be followed backwards for one delay.
    #[error("no single orbit leads to the start: followed backwards it {what} at t = {t}")]
    NoHistory {
        /// When; not above zero.
        t: f64,
        /// The reason.
        what: String,
    },
}

/// Methods that follow the sharp rule and the relay.
pub const SHARP_METHODS: [Method; 3] = [Method::Dopri5, Method::Taylor, Method::TaylorExtended];
/// Methods that follow the smooth rule.
pub const SMOOTH_METHODS: [Method; 2] = [Method::Dopri5, Method::Radau5];

/// The field that is handed to a driver whose stepper has the equation inside. Never evaluated by
/// it.
#[derive(Clone, Copy, Debug)]
pub struct Own;

impl<const N: usize> VectorField<N> for Own {
    const INTERPRETED: bool = true;
    fn eval<S: Elementary>(&self, _: &SVector<S, N>) -> SVector<S, N> {
        SVector::from_element(S::zero())
    }
}

/// f+ or f- of a system, on both sides of the surface.
#[derive(Clone, Debug)]
struct OneSide<'a, P> {
    system: &'a P,
    plus: bool,
    tape: Arc<Tape>,
    ends: Option<Ends>,
}

impl<P: PiecewiseSmooth<N>, const N: usize> VectorField<N> for OneSide<'_, P> {
    const INTERPRETED: bool = P::INTERPRETED;
    #[inline(always)]
    fn eval<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        if self.plus { self.system.plus(x) } else { self.system.minus(x) }
    }
    fn tape(&self) -> Arc<Tape> {
        self.tape.clone()
    }
}

/// A field with time running backwards.
struct Backwards<'a, F>(&'a F);

impl<F: VectorField<N>, const N: usize> VectorField<N> for Backwards<'_, F> {
    const INTERPRETED: bool = F::INTERPRETED;
    fn eval<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        self.0.eval(x).map(|c| -c)
    }
    fn tape(&self) -> Arc<Tape> {
        let tape = self.0.tape();
        Arc::new(Tape::record(N, |x| {
            let mut field = Replay::new(&tape, x);
            (0..N).map(|i| -field.output(i)).collect()
        }))
    }
}

/// A system with one switching surface, ready to be followed on either side of it.
#[derive(Clone, Debug)]
pub struct Sides<'a, P> {
    system: &'a P,
    /// f- and f+.
    fields: [OneSide<'a, P>; 2],
    h: Tape,
    /// The coordinate that h is, if it is one.
    plane: Option<usize>,
}

impl<'a, P> Sides<'a, P> {
    /// Of `system`, which `data` describes.
    pub fn new(system: &'a P, data: &System) -> Self {
        Self::made(system, data, |field| field)
    }

    /// Of a system [with a tangent vector](Varied); `data` describes the system without it.
    pub fn varied(system: &'a P, data: &System) -> Self {
        Self::made(system, data, |field| field.variational(1))
    }

    fn made(system: &'a P, data: &System, with: impl Fn(Field) -> Field) -> Self {
        let side = |plus: bool| {
            let field = with(if plus { Field::plus(data) } else { Field::minus(data) });
            let (tape, ends) = (field.tape().clone(), Ends::new(field.tape().clone()));
            OneSide { system, plus, tape, ends }
        };
        let h = data.tape().select([0]);
        let plane = match h.operations()[h.outputs()[0]] {
            Operation::Variable(i) => Some(i),
            _ => None,
        };
        Self { system, fields: [side(false), side(true)], h, plane }
    }

    /// f+ or f-.
    fn field(&self, plus: bool) -> &OneSide<'a, P> {
        &self.fields[usize::from(plus)]
    }

    /// A failure with what the equations at work, f- or f+, show of its cause.
    fn diagnosed(&self, failure: Failure, at_work: [bool; 2]) -> Failure {
        let sides = self.fields.iter().zip(at_work).filter(|(_, at_work)| *at_work);
        sides.fold(failure, |failure, (side, _)| failure.diagnosed(&side.tape))
    }

    fn h<const N: usize>(&self, x: &SVector<f64, N>) -> f64
    where
        P: PiecewiseSmooth<N>,
    {
        self.system.switching(x)
    }

    /// Crossings of h = `level` by the orbit in `step`.
    fn passages<const N: usize>(
        &self,
        passages: &mut CrossingFinder,
        step: &Step<'_, N>,
        level: f64,
    ) -> Vec<Crossing>
    where
        P: PiecewiseSmooth<N>,
    {
        match self.plane {
            Some(coordinate) => passages.through_plane(step, coordinate, level),
            None => passages.in_curved_step(step, |x| self.h(x) - level),
        }
    }
}

/// Times nearer to each other than this part of them are one.
const ONE_TIME: f64 = 4.0 * f64::EPSILON;

/// The least delay, as a part of the time at which a run ends: f64 tells the times of one delay
/// apart to a part in a thousand.
pub const LEAST_DELAY: f64 = 1024.0 * f64::EPSILON;

/// Whether times until `t_end` can be told apart within a delay.
///
/// # Errors
///
/// If they cannot.
fn resolves<const N: usize>(
    delay: f64,
    t: f64,
    x: &SVector<f64, N>,
    t_end: f64,
) -> Result<(), Failure> {
    if delay > 0.0 && delay < LEAST_DELAY * t_end {
        return Err(Failure::StepUnderflow { t, h: delay, state: x.as_slice().to_vec() });
    }
    Ok(())
}

/// Whether `t` has come to `due`, as far as a step could tell.
fn is_due(due: f64, t: f64) -> bool {
    due - t <= ONE_TIME * due.abs()
}

/// A switch that depends on the past.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LateSwitch {
    /// It acts late.
    Delayed {
        /// The delay.
        delay: f64,
        /// The transition function and its eps; none: the sharp rule.
        smooth: Option<(Transition, f64)>,
        /// The state before the start of a run.
        history: History,
    },
    /// A relay with memory: f+ until h falls to -band, f- until it rises to band.
    Relay {
        /// Half the width of the band, above zero.
        band: f64,
        /// The field with which it begins inside the band.
        inside: Inside,
    },
}

/// A system whose switch depends on the past, and where it starts.
///
/// ```
/// use nalgebra::{SVector, Vector1};
/// use twofold_integrate::delay::{Delayed, History, LateSwitch, Own, Sides};
/// use twofold_integrate::{DriveOptions, Ignore, Method, Stepper, Tolerance, WithStepper, drive};
/// use twofold_system::{Definition, System};
///
/// /// Runs to t = 4 with whatever stepper it is given.
/// struct ToFour;
/// impl WithStepper<1> for ToFour {
///     type Answer = SVector<f64, 1>;
///     fn with<M: Stepper<1>>(self, mut stepper: M) -> Self::Answer {
///         let to = DriveOptions::to(4.0);
///         drive(&Own, Vector1::new(0.3), &to, &mut stepper, &mut Ignore, &()).expect("it runs").x
///     }
/// }
///
/// // x' = -1 while x(t - 1) > 0 and +1 otherwise: a period of four delays.
/// let text = "states = ['x']\nh = 'x'\nplus = ['-1']\nminus = ['1']";
/// let relay = System::new(Definition::from_toml(text, "relay.toml")?);
/// let bound = relay.bind::<1>()?;
/// let switch = LateSwitch::Delayed { delay: 1.0, smooth: None, history: History::Constant };
/// let delayed = Delayed { sides: Sides::new(&bound, &relay), switch, x0: Vector1::new(0.3) };
/// let tolerance = Tolerance { rtol: 1e-9, atol: 1e-9 };
/// let end = delayed.with_stepper(Method::Dopri5, None, tolerance, ToFour)?;
/// assert!((end[0] - 0.3).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Delayed<'a, P, const N: usize> {
    /// The system.
    pub sides: Sides<'a, P>,
    /// Its switch.
    pub switch: LateSwitch,
    /// The start.
    pub x0: SVector<f64, N>,
}

impl<'a, P: PiecewiseSmooth<N> + Clone, const N: usize> Delayed<'a, P, N> {
    /// Makes a stepper of this switch by `method` and passes it to `user`. `order` is the degree of
    /// extended series; `None` takes the degree that the tolerance implies.
    ///
    /// # Errors
    ///
    /// If the method cannot follow this switch, or there is no such history.
    pub fn with_stepper<U: WithStepper<N>>(
        &self,
        method: Method,
        order: Option<u16>,
        tolerance: Tolerance,
        user: U,
    ) -> Result<U::Answer, DelayError> {
        let refused = |instead| Err(DelayError::Method { method: method.name(), instead });
        match (self.smooth(), method) {
            (None, Method::Dopri5) => Ok(user.with(self.sharp_dopri5(tolerance)?)),
            (None, Method::Taylor) => {
                let taylor = || Taylor::<N>::new(tolerance);
                Ok(user.with(Sharp::new(self, [taylor(), taylor()])?))
            }
            (None, Method::TaylorExtended) => {
                let taylor = || {
                    let taylor = Taylor::<N, _>::extended(tolerance).with_decimal_constants();
                    match order {
                        Some(order) => taylor.with_order(usize::from(order)),
                        None => taylor,
                    }
                };
                Ok(user.with(Sharp::new(self, [taylor(), taylor()])?))
            }
            (None, _) => refused("dopri5, taylor or taylor-extended"),
            (Some(smooth), Method::Dopri5) => {
                Ok(user.with(Smooth::new(self, smooth, Dopri5::new(tolerance), tolerance)?))
            }
            (Some(smooth), Method::Radau5) => {
                Ok(user.with(Smooth::new(self, smooth, Radau5::new(tolerance), tolerance)?))
            }
            (Some(_), _) => refused("dopri5 or radau5"),
        }
    }

    /// Layer, delay and history of a smooth rule, if this is one.
    fn smooth(&self) -> Option<((Transition, f64), f64, History)> {
        match self.switch {
            LateSwitch::Delayed { delay, smooth, history } => {
                smooth.map(|layer| (layer, delay, history))
            }
            LateSwitch::Relay { .. } => None,
        }
    }

    fn sharp_dopri5(&self, tolerance: Tolerance) -> Result<SharpDopri5<'a, P, N>, DelayError> {
        let dopri5 = || Cut::new(Guarded::new(Dopri5::new(tolerance), tolerance));
        Sharp::new(self, [dopri5(), dopri5()])
    }

    /// Gives a stepper by Dormand and Prince's method that carries a disturbance along to `user`,
    /// for a system [with a tangent vector](Varied).
    ///
    /// # Errors
    ///
    /// If there is no such history.
    pub fn with_tangent<U: WithTangent<N>>(
        &self,
        tolerance: Tolerance,
        user: U,
    ) -> Result<U::Answer, DelayError>
    where
        P: Carry<N>,
    {
        Ok(match self.smooth() {
            None => user.with(self.sharp_dopri5(tolerance)?.carrying(self.sides.system)),
            Some(smooth) => user.with(
                Smooth::new(self, smooth, Dopri5::new(tolerance), tolerance)?
                    .carrying(self.sides.system),
            ),
        })
    }
}

/// The sharp rule by Dormand and Prince's method.
type SharpDopri5<'a, P, const N: usize> = Sharp<'a, P, Cut<Guarded<Dopri5<N>, N>, N>, N>;

#[cfg(test)]
mod tests;
