//! The question of what a run settles on.

use serde_json::{Value, json};

use super::answer::Answer;
use super::desk::Desk;
use super::exponent::LargestExponent;
use super::question::{JobError, Question};
use super::recording::{Data, Recording};
use super::run::Run;
use super::spec::{Observation, RunSpec, SwitchSpec};
use crate::analyse::attractor::{self, Evidence, SectionPoint, Thresholds, Verdict, classify};
use crate::analyse::lyapunov::{self, Exponent};
use crate::analyse::{Crossing, Direction};
use crate::integrate::{Schedule, Watch};

/// What a run settles on, judged from its section: with the largest exponent where motion is not captured by a cycle, and beside its noise-free
/// twin where there is noise. Fact: `evidence` ([`Evidence`]).
#[derive(Clone, Debug, PartialEq)]
pub struct Classification {
    /// The run; it records a section.
    pub run: RunSpec,
    /// The limits by which it is judged.
    pub thresholds: Thresholds,
}

impl Classification {
    /// The question with the usual limits.
    pub fn of(run: RunSpec) -> Self {
        Self { run, thresholds: Thresholds::default() }
    }

    /// The evidence that an answer to this question holds.
    ///
    /// # Errors
    ///
    /// Whatever the computation met.
    pub fn ask(&self, desk: &Desk<'_>) -> Result<Evidence, JobError> {
        Ok(desk.ask(self)?.fact("evidence")?)
    }
}

impl Question for Classification {
    fn kind(&self) -> &'static str {
        "classification"
    }

    fn json(&self) -> Value {
        json!({ "run": self.run, "thresholds": self.thresholds, "lengths": LENGTHS })
    }

    fn label(&self) -> String {
        format!("what becomes of {}", Run(self.run.clone()).label())
    }

    fn cost(&self) -> f64 {
        Run(self.run.clone()).cost()
    }

    fn compute(&self, desk: &Desk<'_>, _: &dyn Watch) -> Result<Answer, JobError> {
        let evidence = self.evidence(desk)?;
        Ok(Answer::of_tables(Vec::new()).with_fact("evidence", &evidence))
    }
}

/// Numbers of the procedure that are not limits of the classifier.
#[derive(Clone, Copy, Debug, serde::Serialize)]
struct Lengths {
    /// Time after which the first transient is over and a chaotic run is on its structure.
    settling: f64,
    /// Fewest points that make a structure to compare with.
    structure_points: usize,
    /// Time over which a hysteretic system's exponent is averaged: stiff for the explicit method of the variational equation.
    hysteretic_average: f64,
}

const LENGTHS: Lengths = Lengths { settling: 1000.0, structure_points: 2000, hysteretic_average: 2_000.0 };

impl Classification {
    fn evidence(&self, desk: &Desk<'_>) -> Result<Evidence, JobError> {
        let run = &self.run;
        let (recording, section) = section(desk, run)?;
        let mut question = attractor::Question {
            t_end: Some(run.t_end),
            shown_from: 0.5 * run.t_end,
            kicked: run.schedule.kick.is_some(),
            lyapunov: None,
            reference: None,
        };
        if question.kicked {
            let reference = self.noise_free_structure(desk)?;
            question.reference = Some(&reference);
            return Ok(classify(&section, &question, &self.thresholds));
        }
        let evidence = classify(&section, &question, &self.thresholds);
        if let Verdict::Chaotic { .. } = evidence.verdict {
            question.lyapunov = self.exponent(desk, recording.x)?;
            return Ok(classify(&section, &question, &self.thresholds));
        }
        Ok(evidence)
    }

    /// The largest exponent of the run's system, from its final state; `None` if that orbit could not be followed.
    fn exponent(&self, desk: &Desk<'_>, start: [f64; 3]) -> Result<Option<Exponent>, JobError> {
        let settings = match self.run.switch {
            SwitchSpec::Hysteretic { .. } => {
                lyapunov::Settings { duration: LENGTHS.hysteretic_average, ..lyapunov::Settings::default() }
            }
            _ => lyapunov::Settings::default(),
        };
        let question = LargestExponent {
            system: self.run.system.clone(),
            switch: self.run.switch,
            start: start.to_vec(),
            settings,
        };
        Ok(desk.ask(&question)?.fact("exponent").ok())
    }

    /// The structure that noise can wash out: the section of the same run without kicks, as long as it was not captured by a closed orbit.
    /// If it was captured at once, what is left is the closed orbit's dots.
    fn noise_free_structure(&self, desk: &Desk<'_>) -> Result<Vec<SectionPoint>, JobError> {
        let run = &self.run;
        let twin = RunSpec { schedule: Schedule { kick: None, ..run.schedule }, ..run.clone() };
        let (_, section) = section(desk, &twin)?;
        let question = attractor::Question {
            t_end: Some(run.t_end),
            shown_from: 0.5 * run.t_end,
            ..attractor::Question::default()
        };
        let verdict = classify(&section, &question, &self.thresholds).verdict;
        let captured = verdict.cycle().map_or(f64::INFINITY, |c| c.captured_at);
        let (mut loose, late): (Vec<SectionPoint>, Vec<SectionPoint>) = (
            section.iter().filter(|p| p.t > LENGTHS.settling && p.t < captured).copied().collect(),
            section.iter().filter(|p| p.t > 0.5 * run.t_end).copied().collect(),
        );
        if loose.len() < LENGTHS.structure_points {
            loose = late;
        }
        // The classifier compares what is shown; the whole structure is to be compared.
        loose.iter_mut().for_each(|p| p.t = run.t_end);
        Ok(loose)
    }
}

/// The run's recording and its section as the classifier takes it.
fn section(desk: &Desk<'_>, run: &RunSpec) -> Result<(Recording, Vec<SectionPoint>), JobError> {
    if run.system.dimension() != 3 {
        return Err(JobError::Other(
            "a run is classified from the plane of a section, so its system must have three states".into(),
        ));
    }
    let recording = Recording::of_answer(run, &*desk.ask(&Run(run.clone()))?)?.whole()?;
    let Data::Section(crossings) = &recording.data else {
        return Err(JobError::Other("a run is classified from its section; record one with --section".into()));
    };
    let points = points(run, crossings);
    Ok((recording, points))
}

/// The section's points in the plane of the two coordinates that are not fixed by it.
pub fn points(run: &RunSpec, crossings: &[Crossing]) -> Vec<SectionPoint> {
    let coordinate = match run.observe {
        Observation::Section { coordinate, .. } => coordinate,
        Observation::Path { .. } | Observation::Times { .. } => 1,
    };
    let kept: Vec<usize> = (0..3).filter(|i| *i != coordinate).collect();
    crossings
        .iter()
        .map(|c| SectionPoint { t: c.t, u: [c.x[kept[0]], c.x[kept[1]]], upward: c.direction == Direction::Up })
        .collect()
}
