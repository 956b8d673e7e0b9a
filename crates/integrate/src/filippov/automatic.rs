//! The method of one piece of the motion: Dormand-Prince, and Radau IIA from where the piece is
//! found to be stiff. Steps that jump over structure are taken back.

use nalgebra::SVector;

use crate::dopri5::Dopri5;
use crate::guard::{Gates, Guarded, Stage};
use crate::radau5::Radau5;
use crate::step::{Failure, Statistics, Step, Stepper, Tolerance};
use twofold_system::VectorField;

/// Dormand-Prince until its steps are bounded by stability ([`Dopri5::is_stiff`]), Radau IIA from
/// there on.
#[derive(Clone, Debug)]
pub(super) struct Automatic<const N: usize> {
    tolerance: Tolerance,
    explicit: Guarded<Dopri5<N>, N>,
    implicit: Option<Box<Guarded<Radau5<N>, N>>>,
}

impl<const N: usize> Automatic<N> {
    /// `gates`: the field's.
    pub fn new(tolerance: Tolerance, gates: Option<Gates>) -> Self {
        let mut explicit = Guarded::new(Dopri5::new(tolerance), tolerance);
        explicit.look_through(gates);
        Self { tolerance, explicit, implicit: None }
    }

    /// See [`Stepper::restart`]. A piece that is stiff remains so.
    pub fn restart<F: VectorField<N>>(
        &mut self,
        field: &F,
        t: f64,
        x: SVector<f64, N>,
        end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        let stage = Stage { end, max_step };
        match &mut self.implicit {
            None => self.explicit.restart_with(field, t, x, stage),
            Some(radau) => radau.restart_with(field, t, x, stage),
        }
    }

    /// See [`Stepper::step`].
    pub fn step<F: VectorField<N>>(&mut self, field: &F) -> Result<Step<'_, N>, Failure> {
        if self.implicit.is_none() && self.explicit.method().is_stiff() {
            let (t, x, stage) = self.explicit.rest();
            let mut radau = Guarded::new(Radau5::new(self.tolerance), self.tolerance);
            radau.look_through(self.explicit.take_gates());
            radau.restart_with(field, t, x, stage)?;
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

    /// Gives the field's gates back.
    pub fn into_gates(mut self) -> Option<Gates> {
        match &mut self.implicit {
            None => self.explicit.take_gates(),
            Some(radau) => radau.take_gates(),
        }
    }
}
