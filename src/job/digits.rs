//! The question of how many digits of an orbit methods get right.

use serde::Serialize;
use serde_json::Value;

use super::answer::{Answer, Stop};
use super::desk::Desk;
use super::question::{JobError, Question};
use super::table::{Column, Entry, Table};
use crate::analyse::digits::{DigitsQuestion, digits};
use crate::integrate::Watch;
use crate::system::{Compiled, Field, Smoothed, System, Transition};

/// How many digits of each passage through a plane methods get right, beside an orbit in double-double arithmetic, with tanh smoothing. Tables:
/// `agreement`, a row per method and passage, and `visits`, the reference orbit's passages near the origin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MethodDigits {
    /// The system.
    pub system: System,
    /// The stiffness parameter of the smoothing.
    pub eps: f64,
    /// Which digits of which orbit.
    pub compared: DigitsQuestion,
}

impl Question for MethodDigits {
    fn kind(&self) -> &'static str {
        "method-digits"
    }

    fn json(&self) -> Value {
        serde_json::to_value(self).expect("questions are plain data")
    }

    fn label(&self) -> String {
        format!("digits of {} methods", self.compared.methods.len())
    }

    fn cost(&self) -> f64 {
        500.0 * self.compared.t_end * (1e-3 / self.eps).max(1.0)
    }

    fn compute(&self, _: &Desk<'_>, _: &dyn Watch) -> Result<Answer, JobError> {
        let (transition, eps) = (Transition::Tanh, self.eps);
        let found = match self.system.compiled() {
            Some(Compiled::Caricature(system)) => digits(&Smoothed { system, transition, eps }, &self.compared),
            _ => digits(&Field::smoothed(&self.system, transition, eps).bind::<3>()?, &self.compared),
        }?;
        let columns = [Column::words("method"), Column::numbers("tolerance"), Column::integers("crossing")];
        let mut rows =
            Table::new("agreement", columns.into_iter().chain(["t", "error", "digits"].map(Column::numbers)));
        for row in &found.rows {
            let a = &row.agreement;
            rows.push([
                row.contender.name.name().into(),
                row.contender.tolerance.into(),
                Entry::Integer(a.crossing as i64),
                a.t.into(),
                a.error.into(),
                (-a.log10_error).into(),
            ]);
        }
        let mut visits = Table::new("visits", ["t", "distance"].map(Column::numbers));
        visits.extend(found.visits.iter().map(|v| vec![v.t.into(), v.distance.into()]));
        let answer = Answer::of_tables(vec![rows, visits]);
        Ok(Answer { statistics: Some(found.statistics), stop: Stop::Finished, ..answer })
    }
}
