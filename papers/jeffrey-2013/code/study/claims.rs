//! Every testable sentence of the paper, and the rules by which sections are judged:
//! `papers/jeffrey-2013/sentences.toml`, embedded.
//!
//! ```
//! let claims = twofold_jeffrey_2013::study::claims::claims();
//! assert!(claims.sentence.iter().any(|s| s.id == "7.2" && s.quote.contains("period three")));
//! ```

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

/// The file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claims {
    /// The rules, fixed before the census.
    pub rules: Rules,
    /// The rules of sentence 4.8, fixed before its runs.
    pub similarity: Similarity,
    /// The sentences, in the paper's order.
    pub sentence: Vec<Sentence>,
}

/// Limits by which a section is judged. Times are dimensionless, as the paper's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rules {
    /// A run is periodic in what is shown if a closed orbit has captured it by this time.
    pub shown_from: f64,
    /// The end of every section.
    pub end: f64,
    /// Largest shift of a component of a start that a reader could not tell apart from the paper's.
    pub shift: f64,
    /// Confidence of intervals.
    pub confidence: f64,
    /// Permutations of a test for homogeneity.
    pub permutations: u64,
    /// Seed of their generator.
    pub permutation_seed: u64,
    /// Level of tests.
    pub significance: f64,
    /// Confidence at which a noisy section must differ from noise-free ones, and still tell islands
    /// from sea.
    pub washed_out_confidence: f64,
}

/// The comparison of runs of a delayed switch with those of other rules; the file explains each
/// number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Similarity {
    /// Runs of each rule in each reading.
    pub runs: u64,
    /// A closed orbit must have captured a run by this time; its section counts from here on.
    pub shown_from: f64,
    /// The end of its section.
    pub end: f64,
    /// Cells along each side of the window in which a section's points are counted.
    pub cells: usize,
    /// Half the side of that window.
    pub window: Window,
    /// Starts in attracting sliding have y and z between these.
    pub inside: [f64; 2],
    /// Orbits from such starts in one run.
    pub passages: usize,
    /// A run with fewer lengths of chatter has none.
    pub fewest: usize,
    /// An exit lies farther from the two-fold than so many inner scales.
    pub beyond: f64,
    /// Quantile of distances between runs of one rule.
    pub yardstick: f64,
    /// Seed of the random shifts of starts.
    pub seed: u64,
}

/// Half the side of the window, in each reading.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Window {
    /// In the printed reading.
    pub printed: f64,
    /// In the reconstructed reading.
    pub reconstructed: f64,
}

/// A sentence of the paper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sentence {
    /// Section or figure, and a number.
    pub id: String,
    /// The paper's words.
    pub quote: String,
    /// Condition under which the sentence counts as true.
    pub true_if: String,
    /// Method of measurement.
    pub measure: String,
    /// Quantities that decide it.
    #[serde(default)]
    pub reads: Vec<Quantity>,
    /// Why it is not measured.
    #[serde(default)]
    pub untested: Option<String>,
    /// The outcome in place of "false", of a statement that no number makes false.
    #[serde(default)]
    pub otherwise: Option<String>,
}

/// A quantity that decides a sentence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quantity {
    /// Its name.
    pub quantity: String,
    /// The sentence is true if it lies between these, both included.
    pub true_within: [f64; 2],
    /// Whether it does.
    pub holds: bool,
    /// The function of the integration tests that measures it, "module::function".
    pub test: String,
}

/// The file's content.
pub fn claims() -> &'static Claims {
    static CLAIMS: OnceLock<Claims> = OnceLock::new();
    CLAIMS.get_or_init(|| {
        toml::from_str(twofold_papers::jeffrey_2013("sentences.toml"))
            .expect("the embedded file is well formed: a test reads it")
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use twofold_system::Transition;

    #[test]
    fn every_sentence_is_measured_or_says_why_not() {
        let claims = claims();
        let ids: BTreeSet<&str> = claims.sentence.iter().map(|s| s.id.as_str()).collect();
        assert_eq!(ids.len(), claims.sentence.len(), "an id occurs twice");
        for s in &claims.sentence {
            assert!(
                s.reads.is_empty() == s.untested.is_some(),
                "{}: measured or untested, one of the two",
                s.id
            );
            assert!(s.otherwise.is_none() || s.reads.iter().all(|r| !r.holds), "{}", s.id);
            assert!(
                !s.quote.is_empty() && !s.true_if.is_empty() && !s.measure.is_empty(),
                "{}",
                s.id
            );
            let names: BTreeSet<&str> = s.reads.iter().map(|r| r.quantity.as_str()).collect();
            assert_eq!(names.len(), s.reads.len(), "{}: a quantity occurs twice", s.id);
            for Quantity { quantity, true_within: [low, high], .. } in &s.reads {
                assert!(!quantity.is_empty() && low <= high, "{}: {quantity}", s.id);
            }
        }
        for panel in [
            "7.1", "7.2", "7.3", "7.4", "8.1", "8.2", "8.3", "8.4", "9.1", "9.2", "6.1", "6.2",
            "6.3",
        ] {
            assert!(ids.contains(panel), "{panel} is missing");
        }
        let rules = &claims.rules;
        assert!(rules.shown_from < rules.end && 3.0 * rules.shift * rules.shift < 1e-18);
        assert!(claims.similarity.runs >= 100 && claims.similarity.yardstick < 1.0);
    }

    /// Sentences 4.5 and 8.5: fig. 8's transition function tends to the unit step (not to sign(x)),
    /// but it is further from it than eq. (9) allows: by a multiple of the square root of eps.
    #[test]
    fn the_perturbed_transition_function_is_outside_eq_9() {
        let sigma = 0.13;
        let phi = Transition::PerturbedTanh { sigma };
        let mut before: Option<f64> = None;
        for eps in [1e-2, 1e-4, 1e-6] {
            // Just outside the layer, where tanh is 1 to rounding.
            let x: f64 = 30.0 * eps;
            let excess = phi.eval(x, eps) - 1.0;
            assert!((excess / eps.sqrt() - sigma * (-x * x).exp()).abs() < 1e-9, "{excess}");
            // Eq. (9): the excess over eps is bounded. It grows tenfold for every factor of a
            // hundred.
            let ratio = excess / eps;
            assert!(before.is_none_or(|b| ratio > 9.0 * b), "{ratio}");
            before = Some(ratio);
            assert!(phi.eval(-x, eps).abs() < 0.02, "the limit on the left is 0, not -1");
        }
    }
}
