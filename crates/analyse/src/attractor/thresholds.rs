//! Every number that a verdict depends on, stated once, with its reason.

use serde::{Deserialize, Serialize};

/// The limits between one verdict and the next, one set for every panel. They were chosen on
/// systems with known answers (`tests/it/attractor.rs`, which also checks that none of those
/// answers changes when a limit moves by a third), and two of them, `dot` and `thickness`, with the
/// sizes seen in Dormand-Prince trial runs of the first system studied in view. Every
/// [`Evidence`](super::Evidence) carries the ones it was made with.
///
/// Lengths are fractions of the section's extent (the diagonal of the box around all of its
/// points), because what a section shows is judged by what is seen in a picture whose axes hold
/// that box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thresholds {
    /// Fewest points of one direction that are judged at all. Below it neither a return map nor a
    /// distribution is visible.
    pub fewest_points: usize,
    /// A run whose last crossing lies more than this many mean return times before its end no
    /// longer crosses the section.
    pub silence: f64,
    /// Longest period looked for. Twice the longest that was seen in this system (18, the 36-point
    /// orbit at alpha = 0.1, beta = 1e-4).
    pub longest_period: usize,
    /// Points of each phase used to look for a period: enough that a phase which only drifts (a
    /// ring that is slowly walked around) is not taken for a phase that stays.
    pub points_per_phase: usize,
    /// Turns that are enough in a section too short for that, if every phase is a dot: chaos does
    /// not stay near an unstable orbit for so long within a dot's size.
    pub fewest_turns: usize,
    /// Phases count as distinct when their centres are further apart than this many radii of the
    /// widest of them: 2 would let circles touch; a third radius is the gap that makes them
    /// separate dots to the eye.
    pub separation: f64,
    /// Distance between the means of a phase's earlier and later half, in spreads, above which it
    /// drifts: uniform drift gives 1, a ring or spiral that is walked around nearly 0.
    pub drift: f64,
    /// Spread, as a fraction of the extent, below which a phase is one dot: 1/500, less than a
    /// marker's radius in a panel 1000 pixels wide, and far above what a solver at 1e-8 leaves on
    /// an attracting orbit (1e-6 to 3e-4 measured).
    pub dot: f64,
    /// Distance from the cycle, as a fraction of the extent, within which a fast approach is
    /// fitted: near enough that the return map is linear there.
    pub linear_range: f64,
    /// Turns of the cycle that are judged together when a run is followed backwards from its end,
    /// and most turns for which a fast approach is followed further back.
    pub block: usize,
    /// Largest thickness of an invariant curve: the root mean square difference of ln(distance from
    /// the centre) between neighbours in angle, over sqrt 2, after a linear trend in time. Smooth
    /// rings and spirals of 200 points give less than 0.015, the chaotic sea of the first system
    /// studied never less than 0.020 with 100 points and a median of 0.07.
    pub thickness: f64,
    /// Largest jump of ln(distance from the centre) where one block follows another: ln 1.5. A
    /// spiral is continuous.
    pub continuity: f64,
    /// Fewest blocks that must join the last one before a spread-out end is called regular: two
    /// consecutive blocks of chaos next to an island can look like a ring.
    pub fewest_blocks: usize,
    /// Largest gap in angle, in circles, of a ring that counts as one: a few clusters around a
    /// common centre are not a ring.
    pub ring_gap: f64,
    /// An approach has a rate this many standard errors from zero.
    pub significance: f64,
    /// An approach has changed ln(distance) by at least this much: a tenth is what an eye can see
    /// in a spiral.
    pub visible_change: f64,
    /// The 0-1 test's K above which motion is irregular. K tends to 0 or 1 (Gottwald & Melbourne
    /// 2009); the middle is the unbiased place to cut.
    pub zero_one: f64,
    /// Points given to the 0-1 test: its cost grows as the square.
    pub zero_one_points: usize,
    /// Nearest-neighbour divergence per return above which motion is irregular. Shear alone makes
    /// neighbours part linearly, which over the ten returns that are fitted looks like at most a
    /// few hundredths.
    pub divergence: f64,
    /// A supplied largest exponent above this many of its standard errors counts as positive.
    pub exponent_significance: f64,
    /// Forecast skill of nearest neighbours (1: images of close points are close; 0: as far apart
    /// as any two) below which neighbours say nothing: the plane shows no return map.
    pub skill: f64,
    /// Cells across the extent when structure is compared: 64 keeps several points per occupied
    /// cell of a section with 10^4 of them.
    pub cells: usize,
    /// Fewest cells of an island: smaller holes in the sea are chance. (Files call it by the name
    /// of its predecessor.)
    #[serde(rename = "blur")]
    pub island_cells: usize,
    /// Contrast between islands and sea below which structure counts as gone.
    pub washed_out: f64,
    /// Contrast above which structure counts as untouched.
    pub untouched: f64,
}

impl Default for Thresholds {
    fn default() -> Self {
        Self {
            fewest_points: 20,
            silence: 30.0,
            longest_period: 36,
            points_per_phase: 30,
            fewest_turns: 5,
            separation: 3.0,
            drift: 0.5,
            dot: 2e-3,
            linear_range: 0.1,
            block: 200,
            thickness: 0.018,
            continuity: 0.405_465_108_108_164_4,
            fewest_blocks: 3,
            ring_gap: 0.2,
            significance: 4.0,
            visible_change: 0.1,
            zero_one: 0.5,
            zero_one_points: 2000,
            divergence: 0.1,
            exponent_significance: 3.0,
            skill: 0.5,
            cells: 64,
            island_cells: 8,
            washed_out: 0.05,
            untouched: 0.95,
        }
    }
}
