//! The question of the largest Lyapunov exponent.

use nalgebra::{SVector, vector};
use serde::Serialize;
use serde_json::Value;

use super::answer::Answer;
use super::desk::Desk;
use super::question::{JobError, Question};
use super::spec::{SwitchSpec, SystemSpec};
use crate::analyse::lyapunov::{self, Exponent};
use crate::integrate::Watch;
use crate::system::{Hysteretic, PiecewiseSmooth, Smoothed};

/// The largest Lyapunov exponent of the orbit from `start`. Fact: `exponent` ([`Exponent`]), or `failure` with the reason if the orbit
/// could not be followed (it leaves, or its motion is set-valued and has no tangent flow).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LargestExponent {
    /// The system.
    pub system: SystemSpec,
    /// The switch; kicks are part of the settings.
    pub switch: SwitchSpec,
    /// Where the orbit starts.
    pub start: [f64; 3],
    /// How the exponent is computed.
    pub settings: lyapunov::Settings,
}

impl LargestExponent {
    fn exponent_of<P: PiecewiseSmooth<3> + Copy>(&self, system: P) -> Result<Exponent, String> {
        let x = self.start;
        match self.switch {
            SwitchSpec::Smoothed { eps, transition } => {
                let field = Smoothed { system, transition, eps };
                lyapunov::largest::<3, 6, _>(&field, SVector::from(x), &self.settings).map_err(|e| e.to_string())
            }
            SwitchSpec::Hysteretic { eps, eps_prime, relaxation, .. } => {
                let field = Hysteretic { system, eps, eps_prime, relaxation };
                // phi is within its relaxation time of the side that h says.
                let phi = if system.switching(&SVector::from(x)) > 0.0 { 1.0 } else { 0.0 };
                lyapunov::largest::<4, 8, _>(&field, vector![x[0], x[1], x[2], phi], &self.settings)
                    .map_err(|e| e.to_string())
            }
            SwitchSpec::Filippov { .. } => Err("a set-valued motion has no tangent flow".into()),
        }
    }
}

impl Question for LargestExponent {
    fn kind(&self) -> &'static str {
        "largest-exponent"
    }

    fn json(&self) -> Value {
        serde_json::to_value(self).expect("settings are plain data")
    }

    fn label(&self) -> String {
        format!("largest exponent over {}", self.settings.duration)
    }

    fn cost(&self) -> f64 {
        let stiff = if matches!(self.switch, SwitchSpec::Hysteretic { .. }) { 20.0 } else { 1.0 };
        3.0 * stiff * (self.settings.transient + self.settings.duration)
    }

    fn compute(&self, _: &Desk<'_>, _: &dyn Watch) -> Result<Answer, JobError> {
        let found = match self.system {
            SystemSpec::Caricature(system) => self.exponent_of(system),
            SystemSpec::Wheel(system) => self.exponent_of(system),
        };
        let answer = Answer::of_tables(Vec::new());
        Ok(match found {
            Ok(exponent) => answer.with_fact("exponent", &exponent),
            Err(failure) => answer.with_fact("failure", &failure),
        })
    }
}
