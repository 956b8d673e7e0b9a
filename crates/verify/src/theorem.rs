//! Theorems as data: a statement, and what a certificate has to show for it to hold. Numbers are
//! decimal, as texts, so that they are exact.

use serde::Deserialize;

/// A theorem that certificates are checked against.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Theorem {
    /// Its name.
    pub name: String,
    /// Its statement: a certificate proves this one word for word, and no other.
    pub statement: String,
    pub(super) shows: Shows,
}

/// Kinds of theorems: the numbers that a certificate has to show.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Shows {
    Cycle(Cycle),
    Cycles(Cycles),
    Sensitivity(Sensitivity),
    Contraction(Contraction),
    Tables(Tables),
    Horseshoe(Horseshoe),
    InnerLaw(InnerLaw),
}

/// An equation with its parameters.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    pub system: String,
    pub transition: String,
    pub alpha: String,
    pub beta: String,
    pub eps: String,
    pub v_plus: String,
    pub v_minus: String,
}

/// Stability of a closed orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Stability {
    Attracts,
    Saddle,
}

/// A closed orbit, exactly one in the candidate box.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Cycle {
    pub equation: Parameters,
    /// Crossings of y = 0 a turn, in both directions.
    pub crossings: usize,
    pub stability: Stability,
    /// The box's sides are shorter.
    pub narrower: String,
}

/// Closed orbits that are all different.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Cycles {
    pub equation: Parameters,
    pub stability: Stability,
    /// Names, and crossings of y = 0 a turn in both directions.
    pub orbits: Vec<(String, usize)>,
}

/// Two orbits from states at the singularity that part.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sensitivity {
    pub equation: Parameters,
    /// The states' distance is less.
    pub apart: String,
    /// Their x are less.
    pub near: String,
    /// Crossings of y = 0 that are listed.
    pub crossings: usize,
    /// One of them, counted from 1, at which their distance is more than `farther`.
    pub at: usize,
    pub farther: String,
}

/// Orbits that come together.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Contraction {
    pub equation: Parameters,
    /// x and z of the starts on y = 0.
    pub starts: Vec<[String; 2]>,
    /// Crossings of y = 0 of each; at the last all are less than `nearer` from the first orbit's.
    pub crossings: usize,
    pub nearer: String,
    /// The crossing, counted from 1, at which the singularity is passed, with |x| and |z| below
    /// `near`.
    pub passes: usize,
    pub near: String,
}

/// First crossings of y = 0 by the orbit from one start, in tables by name.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Tables {
    /// x and z of the start on y = 0.
    pub start: [String; 2],
    pub tables: Vec<Table>,
}

/// One of these tables.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Table {
    pub name: String,
    pub equation: Parameters,
    pub rows: usize,
}

/// Two loops of covering relations, of 2 and of `long_loop` sets, with one set in common.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct Horseshoe {
    pub equation: Parameters,
    /// Crossings of y = 0 in a return.
    pub crossings: usize,
    pub long_loop: usize,
    /// The sets are smaller.
    pub smaller: String,
    /// Each return passes the singularity, with |x| and |z| below this.
    pub near: String,
    /// Chains of sets grow by more a return.
    pub growth: String,
}

/// The law of the passage in the inner problem.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InnerLaw {
    pub problem: Problem,
    /// The largest |p|.
    pub largest: String,
    /// The eps at which the least S is said as a distance.
    pub eps: String,
}

/// The inner problem.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Problem {
    pub v_plus: String,
    pub v_minus: String,
    pub transition: String,
}
