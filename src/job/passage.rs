//! The questions of how an orbit passes a two-fold.

use nalgebra::{SVector, vector};
use serde::Serialize;
use serde_json::Value;

use super::answer::{Answer, Stop};
use super::desk::Desk;
use super::question::{JobError, Question};
use super::spec::{SpecError, SwitchSpec};
use super::table::{Column, Entry, Table};
use crate::analyse::passage::{self, Passage, PassageQuestion, passage};
use crate::integrate::{Course, Dopri5, Schedule, Statistics, StepCap, Tolerance, Watch, drive};
use crate::system::{Compiled, Field, Hysteretic, Smoothed, System, Transition, VectorField};

/// How the smoothed orbit passes the two-fold at the origin. Table `passage`: one row with the visit's time and the places of leaving (`left_`), of the first
/// passage through x = 0 (`surface_`), of the exit on y = 0 (`exit_`) and of the far exit (`far_`); blank what did not happen. Table `growth`: a row
/// per moment at which disturbances are made (`offset`, in units of sqrt(eps) after the visit), with the growth in each direction; -infinity stands for
/// t = 0.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TwoFoldPassage {
    /// The system; three states, the first one its switching function.
    pub system: System,
    /// The transition function.
    pub transition: Transition,
    /// The stiffness parameter.
    pub eps: f64,
    /// Which orbit, and what of it.
    pub followed: PassageQuestion,
}

impl Question for TwoFoldPassage {
    fn kind(&self) -> &'static str {
        "two-fold-passage"
    }

    fn json(&self) -> Value {
        serde_json::to_value(self).expect("questions are plain data")
    }

    fn label(&self) -> String {
        format!("passage of the two-fold at eps = {:e}", self.eps)
    }

    fn cost(&self) -> f64 {
        // Sliding in f64, then a fixed number of short orbits in extended precision.
        let sliding = 0.1 / self.eps.max(1e-12);
        (if self.followed.carried == 0.0 { sliding } else { 4.0 * sliding }) + 2e3 * self.followed.offsets.len() as f64
    }

    fn compute(&self, _: &Desk<'_>, _: &dyn Watch) -> Result<Answer, JobError> {
        let (transition, eps) = (self.transition, self.eps);
        let found = match self.system.compiled() {
            Some(Compiled::Caricature(system)) => passage(&Smoothed { system, transition, eps }, eps, &self.followed),
            _ => passage(&Field::smoothed(&self.system, transition, eps).bind::<3>()?, eps, &self.followed),
        }?;
        Ok(Answer {
            statistics: Some(found.statistics.clone()),
            stop: Stop::Finished,
            ..Answer::of_tables(self.tables(&found))
        })
    }
}

/// Columns of a place.
fn place(name: &str) -> [Column; 3] {
    ["x", "y", "z"].map(|c| Column::numbers(&format!("{name}_{c}")))
}

/// A place's cells; blank if there is none.
fn cells(place: Option<[f64; 3]>) -> [Entry; 3] {
    place.unwrap_or([f64::NAN; 3]).map(Entry::from)
}

impl TwoFoldPassage {
    fn tables(&self, found: &Passage) -> Vec<Table> {
        let places = ["left", "surface", "exit", "far"].into_iter().flat_map(place);
        let mut one = Table::new("passage", ["eps", "t_visit"].map(Column::numbers).into_iter().chain(places));
        let mut row: Vec<Entry> = vec![self.eps.into(), found.visit.unwrap_or(f64::NAN).into()];
        row.extend([found.leaving, found.surface, found.exit, found.far].into_iter().flat_map(cells));
        one.push(row);
        let columns = ["eps", "offset", "across", "along_y", "along_z"].map(Column::numbers);
        let mut growth = Table::new("growth", columns);
        let mut row = |offset: f64, factors: [f64; 3]| {
            let mut row: Vec<Entry> = vec![self.eps.into(), offset.into()];
            row.extend(factors.map(Entry::from));
            growth.push(row);
        };
        if let Some(factors) = found.carried {
            row(f64::NEG_INFINITY, factors);
        }
        found.growth.iter().for_each(|g| row(g.offset, g.factors));
        vec![one, growth]
    }
}

/// Where orbits leave the switching surface behind the two-fold at the origin, whatever decides their switching: smoothing or hysteresis, with or
/// without kicks. Table `leaving`: a row per run; blank if the orbit was not there in time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Leaving {
    /// The system; three states, the first one its switching function.
    pub system: System,
    /// How it switches; not Filippov's motion, of which leaving is not a property.
    pub switch: SwitchSpec,
    /// The runs: their starts and what happens around them.
    pub runs: Vec<([f64; 3], Schedule)>,
    /// Tolerance of the method, Dormand-Prince 5(4), relative and absolute.
    pub tolerance: f64,
    /// Longest step, in units of eps.
    pub longest_step: f64,
    /// Everything must have happened before this time.
    pub by: f64,
}

impl Leaving {
    fn eps(&self) -> Result<f64, JobError> {
        match self.switch {
            SwitchSpec::Smoothed { eps, .. } | SwitchSpec::Hysteretic { eps, .. } => Ok(eps),
            SwitchSpec::Filippov { .. } => Err(SpecError {
                field: "switch",
                value: "filippov".into(),
                rule: "where a Filippov motion leaves is its exit rule's choice, not a computation",
            }
            .into()),
        }
    }

    fn each<const N: usize, F: VectorField<N>>(
        &self,
        field: &F,
        eps: f64,
        start: impl Fn([f64; 3]) -> SVector<f64, N>,
    ) -> Result<Answer, JobError> {
        let columns = std::iter::once(Column::numbers("eps")).chain(place("left"));
        let mut table = Table::new("leaving", columns);
        let mut work = Statistics::default();
        for (at, schedule) in &self.runs {
            let mut leaving = passage::Leaving::new(eps);
            let mut method = Dopri5::<N>::new(Tolerance { rtol: self.tolerance, atol: self.tolerance });
            let course = Course {
                schedule: *schedule,
                step_cap: StepCap::Absolute(self.longest_step * eps),
                max_steps: 100_000_000,
                ..Course::to(self.by)
            };
            let end = drive(field, start(*at), &course, &mut method, &mut leaving, &())?.within_budget()?;
            work += &end.statistics;
            let mut row: Vec<Entry> = vec![eps.into()];
            row.extend(cells(leaving.place()));
            table.push(row);
        }
        Ok(Answer { statistics: Some(work), stop: Stop::Finished, ..Answer::of_tables(vec![table]) })
    }
}

impl Question for Leaving {
    fn kind(&self) -> &'static str {
        "leaving"
    }

    fn json(&self) -> Value {
        serde_json::to_value(self).expect("questions are plain data")
    }

    fn label(&self) -> String {
        format!("where {} orbits leave the surface", self.runs.len())
    }

    fn cost(&self) -> f64 {
        self.runs.len() as f64 * 10.0 / self.eps().unwrap_or(1.0).max(1e-9)
    }

    fn compute(&self, _: &Desk<'_>, _: &dyn Watch) -> Result<Answer, JobError> {
        let eps = self.eps()?;
        let compiled = match self.system.compiled() {
            Some(Compiled::Caricature(system)) => Some(system),
            _ => None,
        };
        match (self.switch, compiled) {
            (SwitchSpec::Smoothed { transition, .. }, Some(system)) => {
                self.each(&Smoothed { system, transition, eps }, eps, SVector::from)
            }
            (SwitchSpec::Hysteretic { eps_prime, relaxation, phi0, .. }, Some(system)) => {
                let field = Hysteretic { system, eps, eps_prime, relaxation };
                self.each(&field, eps, |[x, y, z]| vector![x, y, z, phi0])
            }
            (SwitchSpec::Smoothed { transition, .. }, None) => {
                self.each(&Field::smoothed(&self.system, transition, eps).bind::<3>()?, eps, SVector::from)
            }
            (SwitchSpec::Hysteretic { eps_prime, relaxation, phi0, .. }, None) => {
                let field = Field::hysteretic(&self.system, eps, eps_prime, relaxation).bind::<4>()?;
                self.each(&field, eps, |[x, y, z]| vector![x, y, z, phi0])
            }
            (SwitchSpec::Filippov { .. }, _) => unreachable!("refused above"),
        }
    }
}
