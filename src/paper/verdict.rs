//! The paper's claims, panel by panel, and whether they hold.
//!
//! A claim is what the paper says of a panel (its words are quoted). A verdict is what our run shows, with its evidence.
//! Whether they agree is decided by one rule per kind of claim, stated in [`SectionClaim::score`] and [`judge`]; no panel is judged by hand.

use nalgebra::{SVector, vector};
use serde::{Deserialize, Serialize};

use super::{Picture, Reading};
pub use crate::analyse::attractor::Claim as SectionClaim;
use crate::analyse::attractor::{Evidence, Question, SectionPoint, Thresholds, Verdict, classify};
use crate::analyse::lyapunov::{self, Exponent};
use crate::analyse::tangle::{Shared, Tangle, common_box};
use crate::analyse::{Crossing, Direction};
use crate::integrate::Schedule;
use crate::job::simulate::{Data, Recording, RunError, simulate};
use crate::job::spec::{Observation, RunSpec, SwitchSpec, SystemSpec};
use crate::system::{Hysteretic, PiecewiseSmooth, Smoothed};

/// What the paper says of a panel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Claim {
    /// About a section (figs 7-9).
    Section(SectionClaim),
    /// "Less organisation" than in the next panel (6(i) against 6(ii)).
    LessOrganisedThanNext,
    /// "Changes in structure sensitive to random noise": this panel and the next differ (6(iii), 6(iv)).
    DiffersFromNext,
}

/// Two paths "differ markedly" when a quarter or more of their strides end where the other never comes.
pub const MARKED_DIFFERENCE: f64 = 0.25;

/// A panel's verdict: claim, evidence, agreement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PanelVerdict {
    /// The picture's name.
    pub picture: String,
    /// The figure's reading.
    pub reading: Option<Reading>,
    /// The panel's label.
    pub panel: String,
    /// The method.
    pub method: String,
    /// What the paper says.
    pub claim: Claim,
    /// In its words, or nearly.
    pub claim_text: String,
    /// What was found, in one line.
    pub found: String,
    /// Whether they agree.
    pub agrees: bool,
    /// Why, or with what reservation.
    pub because: String,
    /// What the finding rests on.
    pub evidence: Grounds,
}

/// The evidence behind a verdict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Grounds {
    /// A section was classified.
    Section(Box<Evidence>),
    /// Two paths were compared.
    Paths {
        /// Share of strides into new places, of this panel's path and of the next one's.
        freshness: [f64; 2],
        /// What they share.
        shared: Shared,
    },
}

impl Claim {
    /// The claim in words.
    pub fn text(self) -> String {
        match self {
            Claim::Section(claim) => claim.to_string(),
            Claim::LessOrganisedThanNext => "less organised than (ii)".into(),
            Claim::DiffersFromNext => "(iii) and (iv) differ".into(),
        }
    }
}

/// Judges every panel of a picture that a claim is made of.
pub fn judge(picture: &Picture, recordings: &[Recording]) -> Result<Vec<PanelVerdict>, RunError> {
    let mut verdicts = Vec::new();
    for (i, (panel, recording)) in picture.panels.iter().zip(recordings).enumerate() {
        let Some(claim) = panel.claim else { continue };
        let next = recordings.get(i + 1);
        let (grounds, found, agrees, because) = match (claim, &recording.data, next.map(|r| &r.data)) {
            (Claim::Section(claim), Data::Section(crossings), _) => {
                let evidence = section_evidence(&panel.run, recording, crossings)?;
                let score = claim.score(&evidence);
                (Grounds::Section(Box::new(evidence.clone())), evidence.summary, score.agrees, score.because)
            }
            (_, Data::Path(path), Some(Data::Path(other))) => {
                let range = common_box([&path[..], &other[..]]);
                let (a, b) = (Tangle::new(path, &range), Tangle::new(other, &range));
                let (freshness, shared) = ([a.freshness(), b.freshness()], a.compare(&b));
                let (found, agrees) = if claim == Claim::LessOrganisedThanNext {
                    let [here, next] = freshness.map(|f| 100.0 * f);
                    let found = format!("{here:.0} % of its way leads to new places, {next:.0} % in the next panel");
                    (found, freshness[0] > freshness[1])
                } else {
                    let found = format!("the two share {:.0} % of their places", 100.0 * shared.overlap);
                    (found, shared.overlap <= 1.0 - MARKED_DIFFERENCE)
                };
                (Grounds::Paths { freshness, shared }, found.clone(), agrees, found)
            }
            // A single panel of fig. 6 was asked for: there is nothing to compare it with.
            _ => continue,
        };
        verdicts.push(PanelVerdict {
            picture: picture.name.clone(),
            reading: picture.reading,
            panel: panel.label.clone(),
            method: panel.run.method.name.name().to_owned(),
            claim,
            claim_text: claim.text(),
            found,
            agrees,
            because,
            evidence: grounds,
        });
    }
    Ok(verdicts)
}

/// The section's points as the classifier takes them.
pub fn points(run: &RunSpec, crossings: &[Crossing]) -> Vec<SectionPoint> {
    let coordinate = match run.observe {
        Observation::Section { coordinate, .. } => coordinate,
        Observation::Path { .. } => 1,
    };
    let kept: Vec<usize> = (0..3).filter(|i| *i != coordinate).collect();
    crossings
        .iter()
        .map(|c| SectionPoint { t: c.t, u: [c.x[kept[0]], c.x[kept[1]]], upward: c.direction == Direction::Up })
        .collect()
}

/// Classifies a section, with the largest exponent where motion is not captured by a cycle, and with the noise-free twin where
/// there is noise.
pub fn section_evidence(run: &RunSpec, recording: &Recording, crossings: &[Crossing]) -> Result<Evidence, RunError> {
    let thresholds = Thresholds::default();
    let section = points(run, crossings);
    let mut question = Question {
        t_end: Some(run.t_end),
        shown_from: 0.5 * run.t_end,
        kicked: run.schedule.kick.is_some(),
        lyapunov: None,
        reference: None,
    };
    if question.kicked {
        let reference = noise_free_structure(run, &thresholds)?;
        question.reference = Some(&reference);
        return Ok(classify(&section, &question, &thresholds));
    }
    let evidence = classify(&section, &question, &thresholds);
    if let Verdict::Chaotic { .. } = evidence.verdict {
        question.lyapunov = exponent(run, recording.x);
        return Ok(classify(&section, &question, &thresholds));
    }
    Ok(evidence)
}

/// Time after which the first transient is over and a chaotic run is on its structure.
const SETTLING: f64 = 1000.0;
/// Fewest points that make a structure to compare with.
const STRUCTURE_POINTS: usize = 2000;

/// The structure that noise can wash out: the section of the same run without kicks, as long as it was not captured by a
/// closed orbit. If it was captured at once, what is left is the closed orbit's dots.
fn noise_free_structure(run: &RunSpec, thresholds: &Thresholds) -> Result<Vec<SectionPoint>, RunError> {
    let twin = RunSpec { schedule: Schedule { kick: None, ..run.schedule }, ..*run };
    let recording = simulate(&twin, &())?;
    let Data::Section(crossings) = &recording.data else { return Ok(Vec::new()) };
    let section = points(&twin, crossings);
    let question = Question { t_end: Some(run.t_end), shown_from: 0.5 * run.t_end, ..Question::default() };
    let captured = classify(&section, &question, thresholds).verdict.cycle().map_or(f64::INFINITY, |c| c.captured_at);
    let (mut loose, late): (Vec<SectionPoint>, Vec<SectionPoint>) = (
        section.iter().filter(|p| p.t > SETTLING && p.t < captured).copied().collect(),
        section.iter().filter(|p| p.t > 0.5 * run.t_end).copied().collect(),
    );
    if loose.len() < STRUCTURE_POINTS {
        loose = late;
    }
    // The classifier compares what is shown; the whole structure is to be compared.
    loose.iter_mut().for_each(|p| p.t = run.t_end);
    Ok(loose)
}

/// The largest exponent of the run's system, from its final state; `None` if that integration fails (an orbit that leaves).
fn exponent(run: &RunSpec, x: [f64; 3]) -> Option<Exponent> {
    match run.system {
        SystemSpec::Caricature(system) => exponent_of(run, system, x),
        SystemSpec::Wheel(system) => exponent_of(run, system, x),
    }
}

fn exponent_of<P: PiecewiseSmooth<3> + Copy>(run: &RunSpec, system: P, x: [f64; 3]) -> Option<Exponent> {
    match run.switch {
        SwitchSpec::Smoothed { eps, transition } => {
            let field = Smoothed { system, transition, eps };
            lyapunov::largest::<3, 6, _>(&field, SVector::from(x), &lyapunov::Settings::default()).ok()
        }
        SwitchSpec::Hysteretic { eps, eps_prime, relaxation, .. } => {
            let field = Hysteretic { system, eps, eps_prime, relaxation };
            // phi is within its relaxation time of the side that h says.
            let phi = if system.switching(&SVector::from(x)) > 0.0 { 1.0 } else { 0.0 };
            // Stiff for the explicit method of the variational equation: a shorter average.
            let settings = lyapunov::Settings { duration: 2_000.0, ..lyapunov::Settings::default() };
            lyapunov::largest::<4, 8, _>(&field, vector![x[0], x[1], x[2], phi], &settings).ok()
        }
        // A set-valued motion has no tangent flow.
        SwitchSpec::Filippov { .. } => None,
    }
}
