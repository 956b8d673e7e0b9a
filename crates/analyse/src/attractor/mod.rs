//! Classification of a run's attractor from its Poincare section.
//!
//! [`classify`] takes the points of a Poincare section and returns a [`Verdict`] with its
//! [`Evidence`]. In order:
//!
//! 1. Has the orbit stopped crossing (escaped), are there too few points, is it kicked (noisy by
//!    construction)?
//! 2. Is the end of the run a closed orbit? Points of one direction are sorted modulo k for the
//!    longest k whose phases stay apart; the run is then followed backwards from its end, block by
//!    block, as long as it stays in dots or on smooth closed curves around them that join each
//!    other. That gives the time of capture (before it lies the transient) and, from ln(distance),
//!    the rate of approach. A spread-out end must also pass the 0-1 test (Gottwald & Melbourne
//!    2009).
//! 3. Otherwise it is irregular or a ring that does not surround its mean: the 0-1 test, the
//!    divergence of nearest neighbours (Rosenstein et al. 1993) and, when given, the largest
//!    exponent from the variational equation ([`lyapunov`](super::lyapunov)) decide by majority; a
//!    tie, or an exponent consistent with zero where the points look irregular, is
//!    [`Verdict::Undecided`].
//!
//! Every limit is in [`Thresholds`], but for that of motion which grows without end.
//!
//! Why not the exponent alone? Because systems near a two-fold spiral at rates of 1e-5 to 1e-4 per
//! unit time: over 10^5 the exponent of such a run cannot be told from zero, while its points say
//! plainly what it does.

mod cycle;
mod divergence;
mod occupancy;
mod thresholds;
mod verdict;
mod zero_one;

pub use divergence::{Divergence, divergence};
pub use occupancy::{Contrast, contrast};
pub use thresholds::Thresholds;
pub use verdict::{Cycle, CyclePoint, Evidence, Rate, Verdict};
pub use zero_one::zero_one;

use super::lyapunov::Exponent;
use cycle::{Captured, Turns};

/// A crossing of the section, in coordinates of its plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SectionPoint {
    /// Time of the crossing.
    pub t: f64,
    /// Place in the plane.
    pub u: [f64; 2],
    /// Whether the section's function increases along the orbit here.
    pub upward: bool,
}

/// Data about a run besides its section.
#[derive(Clone, Copy, Debug, Default)]
pub struct Question<'a> {
    /// End of the run; with it, an orbit that has stopped crossing is noticed.
    pub t_end: Option<f64>,
    /// Time from which on the picture shows points (usually half of the run).
    pub shown_from: f64,
    /// Whether random kicks act.
    pub kicked: bool,
    /// Largest exponent from the equations, if computed.
    pub lyapunov: Option<Exponent>,
    /// Sections of runs without noise to compare with, as far as they are irregular.
    pub reference: Option<&'a [Vec<SectionPoint>]>,
}

/// Decides what the run with this section (in time order, both directions) settles on.
pub fn classify(
    section: &[SectionPoint],
    question: &Question<'_>,
    thresholds: &Thresholds,
) -> Evidence {
    let th = thresholds;
    // The direction with more points is counted; upward if equal or one apart.
    let ups = section.iter().filter(|p| p.upward).count();
    let upward = ups + 1 >= section.len() - ups;
    let one = |upward: bool| -> (Vec<[f64; 2]>, Vec<f64>) {
        section.iter().filter(|p| p.upward == upward).map(|p| (p.u, p.t)).unzip()
    };
    let (points, times) = one(upward);
    let (other, _) = one(!upward);
    let split = Split { points, times, other, upward };
    let (points, times) = (&split.points, &split.times);
    let extent = extent(section);
    let return_time = cycle::return_time(times);

    let mut evidence = Evidence {
        verdict: Verdict::TooFew { points: points.len() },
        name: String::new(),
        summary: String::new(),
        crossings: section.len(),
        extent,
        return_time,
        shown_from: question.shown_from,
        mixed: false,
        dots_only: false,
        zero_one: None,
        divergence: None,
        lyapunov: question.lyapunov,
        thresholds: *th,
    };
    let last = section.last().map_or(0.0, |p| p.t);
    evidence.verdict = if section.iter().any(|p| !p.u[0].is_finite() || !p.u[1].is_finite())
        || question.t_end.is_some_and(|end| end - last > th.silence * return_time)
    {
        Verdict::Escaped { last_crossing: last }
    } else if points.len() < th.fewest_points
        || !extent.is_finite()
        || extent <= 0.0
        || return_time.is_nan()
    {
        Verdict::TooFew { points: points.len() }
    } else if question.kicked {
        noisy(section, question, th, &split, &mut evidence)
    } else {
        deterministic(&split, question, th, &mut evidence)
    };
    if let Some(cycle) = evidence.verdict.cycle() {
        evidence.mixed = cycle.captured_at > question.shown_from;
        evidence.dots_only = cycle.settled_at.is_some_and(|t| t <= question.shown_from);
    }
    evidence.name = evidence.verdict.name().to_owned();
    evidence.summary = evidence.verdict.to_string();
    evidence
}

/// One direction's points and times, the other direction's points, and which direction the first
/// is.
struct Split {
    points: Vec<[f64; 2]>,
    times: Vec<f64>,
    other: Vec<[f64; 2]>,
    upward: bool,
}

fn noisy(
    section: &[SectionPoint],
    question: &Question<'_>,
    th: &Thresholds,
    split: &Split,
    evidence: &mut Evidence,
) -> Verdict {
    let Split { points, times, .. } = split;
    evidence.divergence = divergence(points, evidence.return_time);
    let shown = |s: &[SectionPoint]| -> Vec<SectionPoint> {
        s.iter().filter(|p| p.t >= question.shown_from).copied().collect()
    };
    let contrast = question.reference.and_then(|free| contrast(&shown(section), free, th));
    let turns = Turns::find(points, times, evidence.extent, th);
    let around = turns.cloud(evidence.extent, th).map(|c| {
        // Noise sets the distance, not an approach.
        Cycle { approach: None, ..describe(&turns, &c, split, th) }
    });
    Verdict::Noisy { contrast, around }
}

/// Whether the images of neighbours in a section are as far apart as any two points: the plane does
/// not show a return map.
pub fn has_no_future(evidence: &Evidence, thresholds: &Thresholds) -> bool {
    evidence.divergence.is_some_and(|d| d.skill < thresholds.skill)
}

fn deterministic(
    split: &Split,
    question: &Question<'_>,
    th: &Thresholds,
    evidence: &mut Evidence,
) -> Verdict {
    let Split { points, times, .. } = split;
    let extent = evidence.extent;
    let turns = Turns::find(points, times, extent, th);
    let captured = turns.captured(extent, th);
    // Of a spread-out end, as much as the 0-1 test needs; of one phase only, because hopping
    // between phases is not what is asked.
    let tail = |from: usize, stride: usize| -> Option<f64> {
        let used: Vec<f64> = points[from..]
            .iter()
            .rev()
            .step_by(stride)
            .take(th.zero_one_points)
            .map(|u| u[0] + 0.5 * u[1])
            .collect();
        zero_one(&used)
    };
    if let Some(c) = captured {
        if c.settled.is_some() {
            return Verdict::Periodic(describe(&turns, &c, split, th));
        }
        let k = tail(c.from, turns.period);
        if c.blocks >= th.fewest_blocks && k.is_none_or(|k| k < th.zero_one) {
            evidence.zero_one = k;
            let cycle = describe(&turns, &c, split, th);
            let approaches = cycle.approach.is_some_and(|r| {
                r.per_time.abs() > th.significance * r.standard_error
                    && r.per_time.abs() * (r.to - r.from) > th.visible_change
            });
            if approaches {
                return Verdict::Spiralling(cycle);
            }
            // A ring surrounds its centre; points on a line through it, or a few clusters around
            // it, are something else.
            if turns.largest_gap(c.blocks).is_some_and(|gap| gap < th.ring_gap) {
                return Verdict::QuasiPeriodic(cycle);
            }
        }
    }
    evidence.zero_one = tail(0, 1);
    evidence.divergence = divergence(points, evidence.return_time);
    // Neighbours without a common future, though nothing is random: the plane of two coordinates
    // shows an attractor of more dimensions on top of itself. They say nothing then.
    let blind = has_no_future(evidence, th);
    let exponent = question.lyapunov.map(|l| l.value > th.exponent_significance * l.standard_error);
    let votes = [
        evidence.zero_one.map(|k| k > th.zero_one),
        evidence.divergence.filter(|_| !blind).map(|d| d.per_return > th.divergence),
        exponent,
    ];
    let yes = votes.iter().filter(|v| **v == Some(true)).count();
    let no = votes.iter().filter(|v| **v == Some(false)).count();
    if yes + no == 0 {
        Verdict::TooFew { points: points.len() }
    } else if yes > no && exponent != Some(false) && (!blind || exponent == Some(true)) {
        Verdict::Chaotic {
            lyapunov: question.lyapunov,
            bands: occupancy::bands(&points[points.len() / 2..], th),
        }
    } else if no > yes && !turns.grows() && !turns.moves_on(th) {
        let whole = Captured { from: 0, blocks: 0, settled: None };
        Verdict::QuasiPeriodic(describe(&turns, &whole, split, th))
    } else {
        // A tie, points that look irregular beside an exponent that is not above zero, or regular
        // motion that reaches further and further out or moves on: nothing is claimed.
        Verdict::Undecided { lyapunov: question.lyapunov }
    }
}

fn describe(turns: &Turns<'_>, captured: &Captured, split: &Split, th: &Thresholds) -> Cycle {
    let Split { times, other, upward, .. } = split;
    let dots = |centres: &[[f64; 2]], spreads: &[f64], upward: bool| -> Vec<CyclePoint> {
        // Phases count backwards; the list goes with the motion.
        centres
            .iter()
            .zip(spreads)
            .rev()
            .map(|(u, s)| CyclePoint { u: *u, upward, spread: *s })
            .collect()
    };
    let mut list = dots(&turns.centres, &turns.spreads, *upward);
    let (centres, spreads) = cycle::other_dots(other, turns.period, th.points_per_phase);
    list.extend(dots(&centres, &spreads, !*upward));
    Cycle {
        period: turns.period,
        points: list,
        duration: turns.duration(),
        radius: turns.radius(captured),
        captured_at: times[captured.from],
        settled_at: captured.settled.map(|i| times[i]),
        approach: turns.approach(captured),
        rotation: turns.rotation(),
    }
}

/// Diagonal of the box around all points and the origin of the plane, so that a run that is one dot
/// from its first crossing on still has a scale.
fn extent(section: &[SectionPoint]) -> f64 {
    let (mut low, mut high) = ([0.0_f64; 2], [0.0_f64; 2]);
    for p in section {
        for k in 0..2 {
            low[k] = low[k].min(p.u[k]);
            high[k] = high[k].max(p.u[k]);
        }
    }
    cycle::distance(&low, &high)
}

#[cfg(test)]
mod tests;
