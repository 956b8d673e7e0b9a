//! Orbits of smooth equations.

use nalgebra::SVector;
use twofold_analyse::digits::{Digits, DigitsQuestion, digits};
use twofold_analyse::passage::{PassageAnswer, PassageQuestion, passage};
use twofold_integrate::{
    DriveOptions, Failure, Method, Monitor, Observer, PRECISIONS, Stepper, Summary, Tolerance,
    WithStepper, drive, with_extended,
};
use twofold_system::{
    BindError, BoundField, Caricature, Field, Hysteretic, Relaxation, Smoothed, System, Transition,
    VectorField,
};

/// The method of an orbit, and its options.
#[derive(Clone, Copy, Debug)]
pub struct How {
    /// The method.
    pub method: Method,
    /// Of a step's local error.
    pub tolerance: Tolerance,
    /// Bits of the numbers of [`Method::TaylorExtended`], one of [`PRECISIONS`]; the first if
    /// absent.
    pub precision: Option<u16>,
    /// Degree of its series; the one that the tolerance asks for if absent.
    pub order: Option<u16>,
    /// Duration, restarts and kicks.
    pub options: DriveOptions,
}

/// A smooth equation of `N` states.
pub trait Orbits<const N: usize>: Sync {
    /// The orbit of `x0`.
    ///
    /// # Errors
    /// As [`drive`].
    fn orbit(
        &self,
        x0: SVector<f64, N>,
        how: &How,
        observer: &mut dyn Observer<N>,
        monitor: &dyn Monitor,
    ) -> Result<Summary<N>, Failure>;
}

/// A run without its method.
#[doc(hidden)]
pub struct Waiting<'a, F, const N: usize> {
    /// The equation.
    pub field: &'a F,
    /// The start.
    pub x0: SVector<f64, N>,
    /// Duration, restarts and kicks.
    pub options: DriveOptions,
    /// Receives the steps.
    pub observer: &'a mut dyn Observer<N>,
    /// Receives how far the run has come.
    pub monitor: &'a dyn Monitor,
}

impl<F: VectorField<N>, const N: usize> WithStepper<N> for Waiting<'_, F, N> {
    type Answer = Result<Summary<N>, Failure>;
    fn with<M: Stepper<N>>(self, mut stepper: M) -> Self::Answer {
        let Self { field, x0, options, observer, monitor } = self;
        drive(field, x0, &options, &mut stepper, observer, monitor)
    }
}

fn orbit<F: VectorField<N>, const N: usize>(
    field: &F,
    x0: SVector<f64, N>,
    how: &How,
    observer: &mut dyn Observer<N>,
    monitor: &dyn Monitor,
) -> Result<Summary<N>, Failure> {
    let How { method, tolerance, precision, order, options } = *how;
    let waiting = Waiting { field, x0, options, observer, monitor };
    match (precision, order) {
        (None, None) => method.with_stepper(tolerance, waiting),
        _ => with_extended(precision.unwrap_or(PRECISIONS[0]), order, tolerance, waiting),
    }
}

macro_rules! orbits {
    ($($n:literal $field:ty;)*) => {
        $(impl Orbits<$n> for $field {
            fn orbit(
                &self,
                x0: SVector<f64, $n>,
                how: &How,
                observer: &mut dyn Observer<$n>,
                monitor: &dyn Monitor,
            ) -> Result<Summary<$n>, Failure> {
                orbit(self, x0, how, observer, monitor)
            }
        })*
    };
}

orbits! {
    1 BoundField<1>;
    2 BoundField<2>;
    3 BoundField<3>;
    4 BoundField<4>;
    5 BoundField<5>;
    3 Smoothed<Caricature>;
    4 Hysteretic<Caricature>;
}

/// Computations on orbits that visit a two-fold.
pub trait Visits: Orbits<3> {
    /// As [`passage()`].
    ///
    /// # Errors
    /// As there.
    fn passage(&self, eps: f64, question: &PassageQuestion) -> Result<PassageAnswer, Failure>;
    /// As [`digits()`].
    ///
    /// # Errors
    /// As there.
    fn digits(&self, question: &DigitsQuestion) -> Result<Digits, Failure>;
}

macro_rules! visits {
    ($($field:ty),*) => {
        $(impl Visits for $field {
            fn passage(&self, eps: f64, question: &PassageQuestion) -> Result<PassageAnswer,
                Failure> {
                passage(self, eps, question)
            }
            fn digits(&self, question: &DigitsQuestion) -> Result<Digits, Failure> {
                digits(self, question)
            }
        })*
    };
}

visits!(BoundField<3>, Smoothed<Caricature>);

/// The smoothed equation of a system with three states.
///
/// # Errors
/// If it has not three.
pub fn smoothed(
    system: &System,
    transition: Transition,
    eps: f64,
) -> Result<Box<dyn Visits>, BindError> {
    Ok(match system.compiled() {
        Some(system) => Box::new(Smoothed { system, transition, eps }),
        _ => Box::new(Field::smoothed(system, transition, eps).bind::<3>()?),
    })
}

/// The hysteretic equation of a system with three states; the fourth is phi.
///
/// # Errors
/// If it has not three.
pub fn hysteretic(
    system: &System,
    eps: f64,
    eps_prime: f64,
    relaxation: Relaxation,
) -> Result<Box<dyn Orbits<4>>, BindError> {
    Ok(match system.compiled() {
        Some(system) => Box::new(Hysteretic { system, eps, eps_prime, relaxation }),
        _ => Box::new(Field::hysteretic(system, eps, eps_prime, relaxation).bind::<4>()?),
    })
}
