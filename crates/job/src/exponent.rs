//! The largest Lyapunov exponent as a question.

use nalgebra::SVector;
use serde::Serialize;
use serde_json::Value;

use super::answer::{Answer, Stop};
use super::question::{Ask, JobError, Question};
use super::spec::SwitchSpec;
use twofold_analyse::lyapunov::{self, Estimate, Exponent};
use twofold_analyse::tangent::Tangent;
use twofold_instances_switched::{self as switched, Late};
use twofold_instances_tangent::{Exponents, Growth};
use twofold_integrate::Monitor;
use twofold_integrate::ensemble::InstructionSet;
use twofold_system::{Bound, BoundField, Field, Hysteretic, ParameterBatch, Smoothed, System};

/// The largest Lyapunov exponent of the orbit from `start`. Facts: `exponent` ([`Exponent`]),
/// `half_width` of its 95 % interval and `sign` ([`Sign`](lyapunov::Sign)) by that interval; or
/// `failure` with the reason if the orbit could not be followed (it leaves, or its future is a
/// set).
///
/// ```
/// use twofold_analyse::lyapunov::{Exponent, LyapunovOptions};
/// use twofold_job::{Executor, LargestExponent, spec::SwitchSpec};
/// use twofold_system::System;
/// let question = LargestExponent {
///     system: System::builtin("fused-focus").expect("built in").with("mu", -0.02)?,
///     switch: SwitchSpec::tanh(1e-2),
///     start: vec![0.0, 0.3],
///     settings: LyapunovOptions { transient: 10.0, duration: 50.0, ..Default::default() },
/// };
/// let exponent: Exponent = Executor::quiet().ask(&question)?.fact("exponent")?;
/// assert!(exponent.value < 1.0 && exponent.duration == 50.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LargestExponent {
    /// The system.
    pub system: System,
    /// The switch; kicks are part of the settings.
    pub switch: SwitchSpec,
    /// Start of the orbit.
    pub start: Vec<f64>,
    /// Options of the computation.
    pub settings: lyapunov::LyapunovOptions,
}

impl LargestExponent {
    /// The exponent that an answer has, if the orbit could be followed.
    pub(super) fn found(&self, answer: &Answer) -> Option<Exponent> {
        answer.fact("exponent").ok()
    }

    /// The exponents of several questions that differ in start and in the equation's numbers alone,
    /// side by side in the lanes of vector registers: of each what its answer has
    /// ([`LargestExponent::found`]), bit for bit. Nothing if they differ in more, or lanes have no
    /// room for their equation.
    ///
    /// # Errors
    /// [`JobError::Interrupted`] if `monitor` asks to stop.
    pub(super) fn side_by_side(
        questions: &[&Self],
        set: InstructionSet,
        monitor: &dyn Monitor,
    ) -> Result<Option<Vec<Option<Exponent>>>, JobError> {
        let Some(first) = questions.first() else { return Ok(Some(Vec::new())) };
        let alike = |q: &&Self| q.settings == first.settings && q.start.len() == first.start.len();
        let smoothed = |q: &&Self| matches!(q.switch, SwitchSpec::Smoothed { .. });
        if first.settings.kick.is_some() || !questions.iter().all(|q| alike(q) && smoothed(q)) {
            return Ok(None);
        }
        match first.start.len() {
            2 => Self::in_lanes::<2, 4>(questions, set, monitor),
            3 => Self::in_lanes::<3, 6>(questions, set, monitor),
            4 => Self::in_lanes::<4, 8>(questions, set, monitor),
            _ => Ok(None),
        }
    }

    fn in_lanes<const N: usize, const M: usize>(
        questions: &[&Self],
        set: InstructionSet,
        monitor: &dyn Monitor,
    ) -> Result<Option<Vec<Option<Exponent>>>, JobError>
    where
        ParameterBatch<M>: Exponents<N>,
    {
        let fields: Option<Vec<BoundField<M>>> =
            questions.iter().map(|q| q.tangent()?.bind().ok()).collect();
        let Some(tangents) = fields.and_then(ParameterBatch::new) else { return Ok(None) };
        let starts: Vec<_> =
            questions.iter().map(|q| SVector::<f64, N>::from_column_slice(&q.start)).collect();
        let settings = &questions[0].settings;
        match tangents.exponents(set, &starts, settings, monitor) {
            Some(found) => Ok(Some(found.into_iter().map(Result::ok).collect())),
            None => Err(JobError::Interrupted),
        }
    }

    /// The smoothed equation with its variational equation, as data: the operations that
    /// [`LargestExponent::exponent`] goes through.
    fn tangent(&self) -> Option<Field> {
        let SwitchSpec::Smoothed { eps, transition } = self.switch else { return None };
        Some(match self.system.compiled() {
            Some(system) => {
                let field = Smoothed { system, transition, eps };
                // Symbolically, so that nothing is computed with derivatives that are zero
                // everywhere: a third of all instructions.
                Field::record(["x", "y", "z"], &field).variational(1)
            }
            _ => Field::smoothed(&self.system, transition, eps).variational(1),
        })
    }

    fn exponent(&self, monitor: &dyn Monitor) -> Result<Estimate, String> {
        let start = |i: usize| self.start.get(i).copied().unwrap_or(f64::NAN);
        let dimension = self.system.dimension();
        if self.start.len() != dimension {
            return Err(format!(
                "the start has {} numbers, the system {dimension} states",
                self.start.len()
            ));
        }
        let field = match (self.switch, self.system.compiled()) {
            (SwitchSpec::Smoothed { eps, transition }, Some(system)) => {
                let field = Smoothed { system, transition, eps };
                let x = SVector::from_fn(|i, _| start(i));
                let tangent = Tangent::<_, 1>(&field);
                return tangent.growth(x, 3, &self.settings, monitor).map_err(|e| e.to_string());
            }
            (SwitchSpec::Hysteretic { eps, eps_prime, relaxation, .. }, Some(system)) => {
                let field = Hysteretic { system, eps, eps_prime, relaxation };
                let x = SVector::from_fn(|i, _| if i < 3 { start(i) } else { self.phi() });
                let tangent = Tangent::<_, 1>(&field);
                return tangent.growth(x, 3, &self.settings, monitor).map_err(|e| e.to_string());
            }
            (SwitchSpec::Smoothed { eps, transition }, _) => {
                Field::smoothed(&self.system, transition, eps)
            }
            (SwitchSpec::Hysteretic { eps, eps_prime, relaxation, .. }, _) => {
                Field::hysteretic(&self.system, eps, eps_prime, relaxation)
            }
            (SwitchSpec::Delayed { .. } | SwitchSpec::Relay { .. }, _) => {
                return self.of_late_switch(monitor);
            }
            (SwitchSpec::Filippov { .. }, _) => {
                return Err(
                    "the largest exponent alone has no tangent flow across a jump; ask for all \
                        (twofold lyapunov)"
                        .into(),
                );
            }
        };
        let tangent = field.variational(1);
        match field.dimension() {
            1 => self.along::<1, 2>(&tangent, monitor),
            2 => self.along::<2, 4>(&tangent, monitor),
            3 => self.along::<3, 6>(&tangent, monitor),
            4 => self.along::<4, 8>(&tangent, monitor),
            5 => self.along::<5, 10>(&tangent, monitor),
            n => Err(format!(
                "the largest exponent alone is computed for up to five states, not for {n}; ask \
                    for all (twofold lyapunov)"
            )),
        }
    }

    /// Of a switch that depends on the past.
    fn of_late_switch(&self, monitor: &dyn Monitor) -> Result<Estimate, String> {
        match self.start.len() {
            1 => self.late::<1>(&self.bound()?, monitor),
            2 => self.late::<2>(&self.bound()?, monitor),
            3 => {
                self.late::<3>(&*switched::late(&self.system).map_err(|e| e.to_string())?, monitor)
            }
            4 => self.late::<4>(&self.bound()?, monitor),
            n => Err(format!(
                "exponents of switches with a past are computed for up to four states, not for {n}"
            )),
        }
    }

    fn bound<const N: usize>(&self) -> Result<Bound<N>, String> {
        self.system.bind().map_err(|e| e.to_string())
    }

    fn late<const N: usize>(
        &self,
        system: &dyn Late<N>,
        monitor: &dyn Monitor,
    ) -> Result<Estimate, String> {
        let Some(switch) = self.switch.late() else { return Err("this switch has no past".into()) };
        let x0 = SVector::from_column_slice(&self.start);
        system
            .late_growth(&self.system, switch, x0, &self.settings, monitor)
            .map_err(|e| e.to_string())
    }

    /// By the recorded equation and its variational equation.
    fn along<const N: usize, const M: usize>(
        &self,
        tangent: &Field,
        monitor: &dyn Monitor,
    ) -> Result<Estimate, String>
    where
        BoundField<M>: Growth<N>,
    {
        let tangent = tangent.bind::<M>().map_err(|e| e.to_string())?;
        let x = SVector::<f64, N>::from_fn(|i, _| {
            self.start.get(i).copied().unwrap_or_else(|| self.phi())
        });
        tangent.growth(x, self.start.len(), &self.settings, monitor).map_err(|e| e.to_string())
    }

    /// phi at the start, as runs have it.
    fn phi(&self) -> f64 {
        SwitchSpec::phi_at(&self.system, &self.start)
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

    fn compute(&self, _: &dyn Ask, monitor: &dyn Monitor) -> Result<Answer, JobError> {
        let found = self.exponent(monitor);
        let mut answer = Answer::of_tables(Vec::new());
        if let Ok(Estimate { exponent, .. }) = &found
            && exponent.duration < self.settings.duration
        {
            if !exponent.value.is_finite() {
                return Err(JobError::Interrupted);
            }
            answer.stop = Stop::Interrupted;
        }
        Ok(match found {
            Ok(estimate) => answer
                .with_fact("exponent", &estimate.exponent)
                .with_fact("half_width", &estimate.half_width)
                .with_fact("sign", &estimate.sign()),
            Err(failure) => answer.with_fact("failure", &failure),
        })
    }
}

#[cfg(test)]
mod tests;
