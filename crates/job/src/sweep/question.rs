//! A sweep as one question.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use serde_json::{Value, json};
use twofold_integrate::Monitor;

use super::{Rows, Sweep};
use crate::answer::Answer;
use crate::question::{AnyQuestion, Ask, JobError, Question};
use crate::scan::{Asked, MOST_PARTS};

/// Fewest rows of a part: as many as some lanes of vector registers.
const LEAST: u64 = 8;

/// The rows of a sweep, as one table. It rests on parts of its rows, so that one that was stopped
/// goes on where it was.
#[derive(Clone, Debug)]
pub struct SweepQuestion(Arc<Sweep>);

/// Rows of a sweep that follow each other.
#[derive(Clone, Debug)]
struct SweepPart {
    sweep: Arc<Sweep>,
    from: u64,
    to: u64,
}

impl From<Sweep> for SweepQuestion {
    fn from(sweep: Sweep) -> Self {
        Self(Arc::new(sweep))
    }
}

impl SweepQuestion {
    fn parts(&self) -> impl Iterator<Item = SweepPart> {
        let (sweep, rows) = (self.0.clone(), self.0.rows());
        let size = rows.div_ceil(MOST_PARTS).max(LEAST);
        (0..rows.div_ceil(size)).map(move |part| SweepPart {
            sweep: sweep.clone(),
            from: part * size,
            to: (part * size + size).min(rows),
        })
    }
}

fn varied(sweep: &Sweep) -> String {
    sweep.axes().iter().map(|axis| axis.coordinate.to_string()).collect::<Vec<_>>().join(", ")
}

impl Question for SweepQuestion {
    fn kind(&self) -> &'static str {
        "sweep"
    }

    fn json(&self) -> Value {
        json!({ "sweep": &*self.0 })
    }

    fn label(&self) -> String {
        format!("sweep over {}", varied(&self.0))
    }

    fn rests_on(&self) -> Vec<AnyQuestion> {
        self.parts().map(|part| Arc::new(part) as _).collect()
    }

    fn compute(&self, executor: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let mut whole = Rows::of((*self.0).clone()).table();
        for part in self.parts() {
            let answer = executor.ask_in_passing(&part)?;
            whole.extend(answer.tables.iter().flat_map(|table| table.rows()));
        }
        Ok(Answer::of_tables(vec![whole]))
    }
}

impl Question for SweepPart {
    fn kind(&self) -> &'static str {
        "sweep-part"
    }

    fn json(&self) -> Value {
        json!({ "sweep": &*self.sweep, "from": self.from, "to": self.to })
    }

    fn label(&self) -> String {
        format!("sweep over {}, rows {} to {}", varied(&self.sweep), self.from, self.to - 1)
    }

    fn extent(&self) -> f64 {
        (self.to - self.from) as f64
    }

    fn cost(&self) -> f64 {
        self.sweep.t_end() * self.extent()
    }

    fn compute(&self, _: &dyn Ask, monitor: &dyn Monitor) -> Result<Answer, JobError> {
        let finished = AtomicU64::new(0);
        let asked = Asked { monitor, finished: &finished };
        let numbers: Vec<u64> = (self.from..self.to).collect();
        let mut rows = Rows::of((*self.sweep).clone());
        let mut trouble = None;
        self.sweep.rows_together(&numbers, &asked, &mut |row| {
            finished.fetch_add(1, Ordering::Relaxed);
            trouble = rows.insert(row).err();
            trouble.is_none() && asked.reached(0.0).is_continue()
        })?;
        match trouble {
            Some(error) => Err(JobError::Other(error.to_string())),
            None if (rows.len() as u64) < self.to - self.from => Err(JobError::Interrupted),
            None => Ok(Answer::of_tables(vec![rows.table()])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::*;
    use crate::{Executor, Store};
    use twofold_integrate::Schedule;
    use twofold_system::Caricature;

    /// The rows of the command, whatever the parts; a second executor computes none of them again.
    #[test]
    fn a_sweep_as_a_question_has_its_rows() {
        let run = RunSpec {
            system: Caricature::with_reinjection(1e-1, 1e-5).into(),
            switch: SwitchSpec::tanh(1e-3),
            start: vec![0.2, 0.0, -1.0],
            t_end: 3.0,
            method: MethodSpec::ndsolve_defaults(Method::Dopri5),
            schedule: Schedule::default(),
            observe: Observation::Section { coordinate: 1, value: 0.0 },
        };
        let over = "params.alpha=0.1,0.2,-1,0.3,0.4,0.5,0.6,0.7,0.8,0.9".parse().unwrap();
        let sweep = Sweep::new(run, vec![over, "eps=1e-3,-1".parse().unwrap()], None).unwrap();
        let mut rows = Rows::of(sweep.clone());
        for row in 0..sweep.rows() {
            rows.insert(sweep.row(row, &()).unwrap()).unwrap();
        }
        let question = SweepQuestion::from(sweep);
        assert_eq!(question.parts().count(), 3);
        let folder = tempfile::tempdir().unwrap();
        let store = Store::new(folder.path());
        let answer = Executor::new(Some(store.clone()), &()).ask(&question).unwrap();
        let bits = |table| crate::encode::bits(&[table]);
        assert_eq!(bits(answer.tables[0].clone()), bits(rows.table()));
        assert_eq!(store.entries().unwrap().len(), 4);
    }
}
