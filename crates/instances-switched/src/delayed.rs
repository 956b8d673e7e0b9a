//! Orbits of systems whose switch depends on the past, and how disturbances of them grow.

use nalgebra::SVector;
use twofold_analyse::late_lyapunov::late_estimate;
use twofold_analyse::lyapunov::{Estimate, LyapunovOptions};
use twofold_integrate::delay::{DelayError, Delayed, LateSwitch, Own, Sides};
use twofold_integrate::{Failure, Monitor, Observer, Summary};
use twofold_system::{BindError, Bound, Caricature, PiecewiseSmooth, System};

use twofold_instances::{How, Waiting};

/// A system of `N` states whose switch may act late or have a memory.
pub trait Late<const N: usize> {
    /// The orbit of `x0`; `data` describes this system.
    ///
    /// # Errors
    /// If there is no such run; inside, as [`drive`](twofold_integrate::drive).
    fn late_orbit(
        &self,
        data: &System,
        switch: LateSwitch,
        x0: SVector<f64, N>,
        how: &How,
        observer: &mut dyn Observer<N>,
        monitor: &dyn Monitor,
    ) -> Result<Result<Summary<N>, Failure>, DelayError>;

    /// As [`late_estimate`].
    ///
    /// # Errors
    /// As there.
    fn late_growth(
        &self,
        data: &System,
        switch: LateSwitch,
        x0: SVector<f64, N>,
        settings: &LyapunovOptions,
        monitor: &dyn Monitor,
    ) -> Result<Estimate, Failure>;
}

fn late_orbit<P: PiecewiseSmooth<N> + Clone, const N: usize>(
    system: &P,
    data: &System,
    switch: LateSwitch,
    x0: SVector<f64, N>,
    how: &How,
    observer: &mut dyn Observer<N>,
    monitor: &dyn Monitor,
) -> Result<Result<Summary<N>, Failure>, DelayError> {
    let How { method, tolerance, order, options, .. } = *how;
    let delayed = Delayed { sides: Sides::new(system, data), switch, x0 };
    delayed.with_stepper(
        method,
        order,
        tolerance,
        Waiting { field: &Own, x0, options, observer, monitor },
    )
}

macro_rules! late {
    ($($n:literal $system:ty;)*) => {
        $(impl Late<$n> for $system {
            fn late_orbit(
                &self,
                data: &System,
                switch: LateSwitch,
                x0: SVector<f64, $n>,
                how: &How,
                observer: &mut dyn Observer<$n>,
                monitor: &dyn Monitor,
            ) -> Result<Result<Summary<$n>, Failure>, DelayError> {
                late_orbit(self, data, switch, x0, how, observer, monitor)
            }
            fn late_growth(
                &self,
                data: &System,
                switch: LateSwitch,
                x0: SVector<f64, $n>,
                settings: &LyapunovOptions,
                monitor: &dyn Monitor,
            ) -> Result<Estimate, Failure> {
                late_estimate::<_, $n, { 2 * $n }>(self, data, switch, x0, settings, monitor)
            }
        })*
    };
}

late! {
    1 Bound<1>;
    2 Bound<2>;
    3 Bound<3>;
    4 Bound<4>;
    3 Caricature;
}

/// The system with three states.
///
/// # Errors
/// If it has not three.
pub fn late(system: &System) -> Result<Box<dyn Late<3>>, BindError> {
    Ok(match system.compiled() {
        Some(system) => Box::new(system),
        _ => Box::new(system.bind::<3>()?),
    })
}
