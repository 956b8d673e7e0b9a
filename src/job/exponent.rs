//! The question of the largest Lyapunov exponent.

use nalgebra::SVector;
use serde::Serialize;
use serde_json::Value;

use super::answer::{Answer, Stop};
use super::desk::Desk;
use super::question::{JobError, Question};
use super::spec::SwitchSpec;
use crate::analyse::lyapunov::{self, Exponent};
use crate::analyse::tangent::Tangent;
use crate::integrate::Watch;
use crate::num::tape::Program;
use crate::system::{Compiled, Field, Hysteretic, Smoothed, System};

/// The largest Lyapunov exponent of the orbit from `start`. Fact: `exponent` ([`Exponent`]), or `failure` with the reason if the orbit
/// could not be followed (it leaves, or its motion is set-valued and has no tangent flow).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LargestExponent {
    /// The system.
    pub system: System,
    /// The switch; kicks are part of the settings.
    pub switch: SwitchSpec,
    /// Where the orbit starts.
    pub start: Vec<f64>,
    /// How the exponent is computed.
    pub settings: lyapunov::Settings,
}

impl LargestExponent {
    fn exponent(&self, watch: &dyn Watch) -> Result<Exponent, String> {
        let start = |i: usize| self.start.get(i).copied().unwrap_or(f64::NAN);
        let dimension = self.system.dimension();
        if self.start.len() != dimension {
            return Err(format!("the start has {} numbers, the system {dimension} states", self.start.len()));
        }
        let field = match (self.switch, self.system.compiled()) {
            (SwitchSpec::Smoothed { eps, transition }, Some(Compiled::Caricature(system))) => {
                let field = Smoothed { system, transition, eps };
                let x = SVector::from_fn(|i, _| start(i));
                let tangent = Tangent::<_, 1>(&field);
                return lyapunov::largest_watched::<3, 6, _>(&tangent, x, 3, &self.settings, watch)
                    .map_err(|e| e.to_string());
            }
            (SwitchSpec::Hysteretic { eps, eps_prime, relaxation, .. }, Some(Compiled::Caricature(system))) => {
                let field = Hysteretic { system, eps, eps_prime, relaxation };
                let x = SVector::from_fn(|i, _| if i < 3 { start(i) } else { self.phi() });
                let tangent = Tangent::<_, 1>(&field);
                return lyapunov::largest_watched::<4, 8, _>(&tangent, x, 3, &self.settings, watch)
                    .map_err(|e| e.to_string());
            }
            (SwitchSpec::Smoothed { eps, transition }, _) => Field::smoothed(&self.system, transition, eps),
            (SwitchSpec::Hysteretic { eps, eps_prime, relaxation, .. }, _) => {
                Field::hysteretic(&self.system, eps, eps_prime, relaxation)
            }
            (SwitchSpec::Filippov { .. }, _) => return Err("a set-valued motion has no tangent flow".into()),
        };
        let tangent = field.variational(1);
        match field.dimension() {
            1 => self.along::<1, 2>(&tangent, watch),
            2 => self.along::<2, 4>(&tangent, watch),
            3 => self.along::<3, 6>(&tangent, watch),
            4 => self.along::<4, 8>(&tangent, watch),
            5 => self.along::<5, 10>(&tangent, watch),
            6 => self.along::<6, 12>(&tangent, watch),
            7 => self.along::<7, 14>(&tangent, watch),
            8 => self.along::<8, 16>(&tangent, watch),
            9 => self.along::<9, 18>(&tangent, watch),
            n => Err(format!("exponents are computed for up to nine states, not for {n}")),
        }
    }

    /// By the recorded equation and its variational equation.
    fn along<const N: usize, const M: usize>(&self, tangent: &Field, watch: &dyn Watch) -> Result<Exponent, String> {
        let tangent = tangent.bind::<M>().map_err(|e| e.to_string())?;
        let x = SVector::<f64, N>::from_fn(|i, _| self.start.get(i).copied().unwrap_or_else(|| self.phi()));
        lyapunov::largest_watched::<N, M, _>(&tangent, x, self.start.len(), &self.settings, watch)
            .map_err(|e| e.to_string())
    }

    /// phi at the start: within its relaxation time of the side that h says.
    fn phi(&self) -> f64 {
        let mut h = [f64::NAN];
        Program::new(&self.system.tape().select([0])).evaluate(&self.start, &mut h);
        if h[0] > 0.0 { 1.0 } else { 0.0 }
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

    fn extent(&self) -> f64 {
        self.settings.transient + self.settings.duration
    }

    fn compute(&self, _: &Desk<'_>, watch: &dyn Watch) -> Result<Answer, JobError> {
        let found = self.exponent(watch);
        let mut answer = Answer::of_tables(Vec::new());
        if let Ok(exponent) = &found
            && exponent.duration < self.settings.duration
        {
            if !exponent.value.is_finite() {
                return Err(JobError::Interrupted);
            }
            answer.stop = Stop::Interrupted;
        }
        Ok(match found {
            Ok(exponent) => answer.with_fact("exponent", &exponent),
            Err(failure) => answer.with_fact("failure", &failure),
        })
    }
}
