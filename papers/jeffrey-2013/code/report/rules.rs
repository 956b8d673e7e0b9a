//! By what rules and thresholds the page's verdicts were reached, in words for readers.

use serde_json::{Value, json};

use super::model::Report;
use twofold_analyse::attractor::Thresholds;

/// Rules by which a claim is held against a finding:
/// [`Claim::score`](twofold_paper::claim::Claim::score), and the two kinds of claim about paths in
/// space.
pub const CLAIMS: [(&str, &str); 6] = [
    (
        "periodic, period k",
        "The section ends on a closed orbit (of that period, where the paper names one), reached \
            or still being approached, and the whole of the \
         shown part follows it: the orbit has captured the run before the shown part begins. A run \
         that turns around the orbit and moves away \
         from it does not count.",
    ),
    (
        "chaos",
        "The run neither ends on a closed orbit nor on a ring, and what is left of it is irregular \
            by the majority of the 0-1 test, the \
         divergence of neighbours and, where it is known, the largest exponent. Chaos that ends in \
         the shown part does not count.",
    ),
    (
        "partly washed out by noise",
        "Islands that noise-free runs leave empty are emptier than the sea, but not as empty as in \
            any noise-free run, by intervals; and \
         the run is not merely held around one closed orbit.",
    ),
    (
        "less organised than (ii)",
        "The share of a path’s way that leads to places where it has not been, over twelve \
            neighbouring starts, is larger by more than two \
         standard errors of the difference.",
    ),
    (
        "(iii) and (iv) differ",
        "A quarter or more of the strides of one path end where the other never comes.",
    ),
    (
        "captured, settled",
        "Captured: from then on the run only turns around the closed orbit. Settled: from then on \
            it is at the orbit, by the size of a dot.",
    ),
];

/// Meaning of each threshold of a section's verdict, in the order of [`Thresholds`]. Lengths are
/// shares of the section's extent.
const THRESHOLDS: [(&str, &str); 27] = [
    ("fewest_points", "fewest points of one direction that are judged at all"),
    (
        "silence",
        "mean return times without a crossing, at the end, after which a run no longer crosses the \
            section",
    ),
    ("longest_period", "longest period looked for"),
    ("points_per_phase", "points of each phase used to look for a period"),
    (
        "fewest_turns",
        "turns that are enough in a section too short for that, if every phase is a dot",
    ),
    ("separation", "phases are distinct if their centres are so many radii apart"),
    (
        "drift",
        "distance between a phase’s earlier and later mean, in spreads, above which it drifts",
    ),
    ("dot", "spread below which a phase is one dot"),
    ("linear_range", "distance from the orbit within which a fast approach is fitted"),
    ("block", "turns of the orbit that are judged together when a run is followed backwards"),
    ("thickness", "largest thickness of an invariant curve"),
    ("continuity", "largest jump of ln(distance) where one block follows another"),
    (
        "fewest_blocks",
        "fewest blocks that must join the last one before a spread-out end is called regular",
    ),
    ("ring_gap", "largest gap in angle, in circles, of a ring that counts as one"),
    ("significance", "standard errors by which a rate of approach differs from none"),
    ("visible_change", "least change of ln(distance) of an approach that is called one"),
    ("zero_one", "result of the 0-1 test above which a section is irregular"),
    ("zero_one_points", "points given to the 0-1 test"),
    ("divergence", "divergence of neighbours per return above which motion is irregular"),
    ("exponent_significance", "standard errors by which a largest exponent counts as positive"),
    ("skill", "forecast skill of neighbours below which a section is noise"),
    ("cells", "cells across the extent when structure is compared"),
    ("blur", "fewest cells of an island"),
    ("washed_out", "contrast of islands and sea below which structure counts as gone"),
    ("untouched", "contrast above which it counts as untouched"),
    ("shown_from", "time from which a section is shown"),
    ("end", "time at which a section ends"),
];

/// Name, value and meaning of every threshold, and whether all verdicts of the report were reached
/// with the same: the values are those of the first verdict on a section, or the program's own if
/// there is none.
pub fn thresholds(report: &Report) -> (Vec<(String, String, &'static str)>, bool) {
    let used: Vec<&Value> = report
        .figures
        .iter()
        .flat_map(|f| &f.pictures)
        .flat_map(|p| &p.verdicts)
        .filter_map(|v| v.recorded.pointer("/evidence/section/thresholds"))
        .collect();
    let own = json!(Thresholds::default());
    let values = used.first().copied().unwrap_or(&own);
    let rules = &crate::study::claims::claims().rules;
    let fixed = json!({ "shown_from": rules.shown_from, "end": rules.end });
    let rows = THRESHOLDS.iter().filter_map(|(name, meaning)| {
        let value = values.get(name).or_else(|| fixed.get(name))?;
        Some(((*name).to_owned(), value.to_string(), *meaning))
    });
    (rows.collect(), used.iter().all(|v| *v == values))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_threshold_has_a_meaning() {
        let own = json!(Thresholds::default());
        let fields: BTreeSet<&str> = own.as_object().unwrap().keys().map(String::as_str).collect();
        let described: BTreeSet<&str> = THRESHOLDS.iter().map(|(name, _)| *name).collect();
        let rules = ["shown_from", "end"].into_iter().collect();
        assert_eq!(described.difference(&fields).copied().collect::<BTreeSet<_>>(), rules);
        assert_eq!(fields.difference(&described).count(), 0);
    }
}
