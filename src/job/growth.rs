//! The question of what a visit to a two-fold makes of a small disturbance.

use serde::Serialize;
use serde_json::Value;

use super::answer::{Answer, Stop};
use super::desk::Desk;
use super::question::{JobError, Question};
use super::table::{Column, Entry, Table};
use crate::analyse::growth::{Growth, GrowthQuestion, growth};
use crate::integrate::Watch;
use crate::system::{Compiled, Field, Smoothed, System, Transition};

/// How much larger a small disturbance is after the first visit to the two-fold at the origin, with tanh smoothing. Table `growth`: a row per moment
/// at which disturbances are made (`made`: `near` the visit, or at the `start`), with the growth in each direction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DisturbanceGrowth {
    /// The system.
    pub system: System,
    /// The stiffness parameter of the smoothing.
    pub eps: f64,
    /// Which disturbances of which orbit.
    pub disturbances: GrowthQuestion,
}

impl Question for DisturbanceGrowth {
    fn kind(&self) -> &'static str {
        "disturbance-growth"
    }

    fn json(&self) -> Value {
        serde_json::to_value(self).expect("questions are plain data")
    }

    fn label(&self) -> String {
        format!("growth of disturbances at eps = {}", self.eps)
    }

    fn cost(&self) -> f64 {
        // Extended precision; steps inside the layer are as long as eps.
        3e3 / self.eps.max(1e-9)
    }

    fn compute(&self, _: &Desk<'_>, _: &dyn Watch) -> Result<Answer, JobError> {
        let (transition, eps, asked) = (Transition::Tanh, self.eps, &self.disturbances);
        let found = match self.system.compiled() {
            Some(Compiled::Caricature(system)) => growth(&Smoothed { system, transition, eps }, asked),
            _ => growth(&Field::smoothed(&self.system, transition, eps).bind::<3>()?, asked),
        }?;
        Ok(Answer {
            statistics: Some(found.statistics.clone()),
            stop: Stop::Finished,
            ..Answer::of_tables(vec![self.table(&found)])
        })
    }
}

impl DisturbanceGrowth {
    fn table(&self, found: &Growth) -> Table {
        let columns = ["eps", "made", "t", "t_visit", "t_exit", "x", "y", "z"]
            .map(|name| if name == "made" { Column::words(name) } else { Column::numbers(name) });
        let mut table = Table::new("growth", columns);
        let Some(visit) = &found.visit else { return table };
        let mut row = |made: &str, t: f64, factors: [f64; 3]| {
            let mut row = vec![self.eps.into(), made.into(), t.into(), visit.t.into(), visit.exit_t.into()];
            row.extend(factors.map(Entry::from));
            table.push(row);
        };
        visit.rows.iter().for_each(|r| row("near", r.t, r.factors));
        if let Some(factors) = found.from_start {
            row("start", 0.0, factors.map(|f| f.unwrap_or(f64::NAN)));
        }
        table
    }
}
