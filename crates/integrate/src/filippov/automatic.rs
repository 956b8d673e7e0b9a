//! The method of one piece of the motion: Dormand-Prince, and Radau IIA from where the piece is
//! found to be stiff.

use nalgebra::SVector;

use crate::dopri5::Dopri5;
use crate::radau5::Radau5;
use crate::step::{Failure, Statistics, Step, Stepper, Tolerance};
use twofold_system::VectorField;

/// Dormand-Prince until its steps are bounded by stability ([`Dopri5::is_stiff`]), Radau IIA from
/// there on.
#[derive(Clone, Debug)]
pub(super) struct Automatic<const N: usize> {
    tolerance: Tolerance,
    explicit: Dopri5<N>,
    implicit: Option<Box<Radau5<N>>>,
}

impl<const N: usize> Automatic<N> {
    pub fn new(tolerance: Tolerance) -> Self {
        Self { tolerance, explicit: Dopri5::new(tolerance), implicit: None }
    }

    /// See [`Stepper::restart`]. A piece that is stiff remains so.
    pub fn restart<F: VectorField<N>>(
        &mut self,
        field: &F,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        match &mut self.implicit {
            None => self.explicit.restart(field, t, x, t_end, max_step),
            Some(radau) => radau.restart(field, t, x, t_end, max_step),
        }
    }

    /// See [`Stepper::step`].
    pub fn step<F: VectorField<N>>(&mut self, field: &F) -> Result<Step<'_, N>, Failure> {
        if self.implicit.is_none() && self.explicit.is_stiff() {
            let Dopri5 { t, x, t_end, max_step, .. } = self.explicit;
            let mut radau = Radau5::new(self.tolerance);
            radau.restart(field, t, x, t_end, max_step)?;
            self.implicit = Some(Box::new(radau));
        }
        match &mut self.implicit {
            None => self.explicit.step(field),
            Some(radau) => radau.step(field),
        }
    }

    /// The work of both methods.
    pub fn statistics(&self) -> Statistics {
        let mut all = self.explicit.statistics().clone();
        if let Some(radau) = &self.implicit {
            all += radau.statistics();
            all.method_switches += 1;
        }
        all
    }
}
