//! Motions of discontinuous systems.

use nalgebra::SVector;
use twofold_analyse::filippov_return;
use twofold_analyse::floquet::{self, ReturnPlane, Returned};
use twofold_analyse::limit::{
    AfterVisit, AfterVisitQuestion, Convergence, ConvergenceQuestion, after_visit, convergence,
};
use twofold_integrate::Monitor;
use twofold_integrate::filippov::{
    ExitRule, Faces, FilippovError, FilippovObserver, FilippovOptions, FilippovSummary, Funnel,
    FunnelGrid, funnel, run_two_surfaces, run_watched,
};
use twofold_system::{BindError, Bound, Caricature, System};

/// Crossing of the plane behind a visit by the smoothed orbit of a width, if it does, or its
/// failure.
pub type Crossing<'a> = &'a mut dyn FnMut(f64) -> Result<Option<Vec<f64>>, FilippovError>;

/// A discontinuous system of `N` states.
pub trait Motions<const N: usize> {
    /// As [`run_watched`].
    ///
    /// # Errors
    /// As there.
    fn motion(
        &self,
        x0: SVector<f64, N>,
        t_end: f64,
        settings: &FilippovOptions,
        exit: ExitRule,
        observer: &mut dyn FilippovObserver<N>,
        monitor: &dyn Monitor,
    ) -> Result<FilippovSummary<N>, FilippovError>;
    /// As [`funnel()`].
    ///
    /// # Errors
    /// As there.
    fn funnel(
        &self,
        x0: SVector<f64, N>,
        t_end: f64,
        settings: &FilippovOptions,
        grid: &FunnelGrid,
    ) -> Result<Funnel<N>, FilippovError>;
    /// As [`filippov_return::return_map`].
    ///
    /// # Errors
    /// As there.
    fn return_map(
        &self,
        plane: ReturnPlane,
        returns: usize,
        u: &SVector<f64, N>,
        settings: &floquet::FloquetOptions,
        derivative: bool,
    ) -> Result<Returned, filippov_return::Error>;
}

macro_rules! motions {
    ($($n:literal $system:ty;)*) => {
        $(impl Motions<$n> for $system {
            fn motion(
                &self,
                x0: SVector<f64, $n>,
                t_end: f64,
                settings: &FilippovOptions,
                exit: ExitRule,
                observer: &mut dyn FilippovObserver<$n>,
                monitor: &dyn Monitor,
            ) -> Result<FilippovSummary<$n>, FilippovError> {
                run_watched(self, x0, t_end, settings, exit, observer, monitor)
            }
            fn funnel(
                &self,
                x0: SVector<f64, $n>,
                t_end: f64,
                settings: &FilippovOptions,
                grid: &FunnelGrid,
            ) -> Result<Funnel<$n>, FilippovError> {
                funnel(self, x0, t_end, settings, grid)
            }
            fn return_map(
                &self,
                plane: ReturnPlane,
                returns: usize,
                u: &SVector<f64, $n>,
                settings: &floquet::FloquetOptions,
                derivative: bool,
            ) -> Result<Returned, filippov_return::Error> {
                filippov_return::return_map(self, plane, returns, u, settings, derivative)
            }
        })*
    };
}

motions! {
    1 Bound<1>;
    2 Bound<2>;
    3 Bound<3>;
    4 Bound<4>;
    3 Caricature;
}

/// Computations on motions that visit a two-fold.
pub trait Visited: Motions<3> {
    /// As [`convergence()`].
    ///
    /// # Errors
    /// As there.
    fn convergence(&self, question: &ConvergenceQuestion) -> Result<Convergence, FilippovError>;
    /// As [`after_visit()`].
    ///
    /// # Errors
    /// As there.
    fn after_visit(
        &self,
        question: &AfterVisitQuestion,
        crossing: Crossing<'_>,
    ) -> Result<AfterVisit, FilippovError>;
}

macro_rules! visited {
    ($($system:ty),*) => {
        $(impl Visited for $system {
            fn convergence(&self, question: &ConvergenceQuestion) -> Result<Convergence,
                FilippovError> {
                convergence(self, question)
            }
            fn after_visit(
                &self,
                question: &AfterVisitQuestion,
                crossing: Crossing<'_>,
            ) -> Result<AfterVisit, FilippovError> {
                after_visit(self, question, crossing)
            }
        })*
    };
}

visited!(Bound<3>, Caricature);

/// Two switching surfaces of a system of `N` states.
pub trait TwoSurfaces<const N: usize> {
    /// As [`run_two_surfaces`].
    ///
    /// # Errors
    /// As there.
    fn motion_on(
        &self,
        x0: SVector<f64, N>,
        t_end: f64,
        settings: &FilippovOptions,
        exit: ExitRule,
        observer: &mut dyn FilippovObserver<N>,
        monitor: &dyn Monitor,
    ) -> Result<FilippovSummary<N>, FilippovError>;
}

macro_rules! two_surfaces {
    ($($n:literal),*) => {
        $(impl TwoSurfaces<$n> for Faces<Bound<$n>> {
            fn motion_on(
                &self,
                x0: SVector<f64, $n>,
                t_end: f64,
                settings: &FilippovOptions,
                exit: ExitRule,
                observer: &mut dyn FilippovObserver<$n>,
                monitor: &dyn Monitor,
            ) -> Result<FilippovSummary<$n>, FilippovError> {
                run_two_surfaces(self, x0, t_end, settings, exit, observer, monitor)
            }
        })*
    };
}

two_surfaces!(1, 2, 3, 4);

/// The discontinuous system with three states.
///
/// # Errors
/// If it has not three.
pub fn sliding(system: &System) -> Result<Box<dyn Visited>, BindError> {
    Ok(match system.compiled() {
        Some(system) => Box::new(system),
        _ => Box::new(system.bind::<3>()?),
    })
}
