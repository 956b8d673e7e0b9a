//! Equations with their variational equations.

use nalgebra::SVector;
use twofold_analyse::floquet::{self, ReturnPlane, Returned};
use twofold_analyse::lyapunov::{self, Estimate};
use twofold_analyse::tangent::Tangent;
use twofold_integrate::{Failure, Monitor};
use twofold_system::{BoundField, Caricature, Hysteretic, Smoothed};

/// An equation of `N` states with one tangent vector.
pub trait Growth<const N: usize> {
    /// As [`lyapunov::estimate_along`].
    ///
    /// # Errors
    /// As there.
    fn growth(
        &self,
        x0: SVector<f64, N>,
        kicked_states: usize,
        settings: &lyapunov::LyapunovOptions,
        monitor: &dyn Monitor,
    ) -> Result<Estimate, Failure>;
}

macro_rules! growth {
    ($($n:literal $m:literal $tangent:ty;)*) => {
        $(impl Growth<$n> for $tangent {
            fn growth(
                &self,
                x0: SVector<f64, $n>,
                kicked_states: usize,
                settings: &lyapunov::LyapunovOptions,
                monitor: &dyn Monitor,
            ) -> Result<Estimate, Failure> {
                lyapunov::estimate_along::<$n, $m, _>(self, x0, kicked_states, settings, monitor)
            }
        })*
    };
}

growth! {
    1 2 BoundField<2>;
    2 4 BoundField<4>;
    3 6 BoundField<6>;
    4 8 BoundField<8>;
    5 10 BoundField<10>;
    3 6 Tangent<'_, Smoothed<Caricature>, 1>;
    4 8 Tangent<'_, Hysteretic<Caricature>, 1>;
}

/// An equation of `N` states with `N` tangent vectors.
pub trait Returns<const N: usize> {
    /// As [`floquet::return_map`].
    ///
    /// # Errors
    /// As there.
    fn return_map(
        &self,
        plane: ReturnPlane,
        returns: usize,
        u: &SVector<f64, N>,
        settings: &floquet::FloquetOptions,
    ) -> Result<Returned, floquet::Error>;
}

macro_rules! returns {
    ($($n:literal $m:literal),*) => {
        $(impl Returns<$n> for BoundField<$m> {
            fn return_map(
                &self,
                plane: ReturnPlane,
                returns: usize,
                u: &SVector<f64, $n>,
                settings: &floquet::FloquetOptions,
            ) -> Result<Returned, floquet::Error> {
                floquet::return_map::<$n, $m, _>(self, plane, returns, u, settings)
            }
        })*
    };
}

returns!(2 6, 3 12, 4 20, 5 30);
