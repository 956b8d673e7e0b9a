//! Checkpoints of a figure's long runs: what lets somebody check a computation of hours in seconds, without trust.
//!
//! The long runs of a figure are cut into [`STRETCHES`] stretches altogether ([`stretch`]). A file beside the figure's reference holds the state at the end of
//! each and the digest of the passages in it. A [tree](twofold_job::record::merkle) over all of them has one root. Whoever doubts the figure recomputes stretches of
//! his choice from their checkpoints: each must come out with the same bits.
//!
//! What a forger can do: a wrong stretch is noticed when it is among those recomputed. If a fraction f of the stretches is wrong, n random ones miss all
//! of them with probability (1 - f)^n. Which ones are taken follows from the root, so that they cannot be chosen; since somebody with patience could make files until the root
//! chooses well, a doubter gives a seed of his own.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::Figure;
use twofold_integrate::{Part, Watch};
use twofold_job::question::question_hash;
use twofold_job::record::hash::canonical_json;
use twofold_job::record::merkle::{Tree, leaf};
use twofold_job::record::{Hash, Manifest};
use twofold_job::spec::RunSpec;
use twofold_job::{Answer, JobError, Run, encode, stretch};
use twofold_num::random::RandomStream;

/// Stretches of a figure, about, shared alike by its long runs.
pub const STRETCHES: u64 = 240;
/// A run of fewer segments is not cut: it is quickly computed again.
const LONG: u64 = 64;

/// The format's version.
const VERSION: u32 = 1;

/// Where a stretch ends, and what it held.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct End {
    /// Segments between restarts and kicks up to here.
    pub segments: u64,
    /// Time.
    pub t: f64,
    /// The equation's state, with phi if the switch is hysteretic.
    pub state: Vec<f64>,
    /// Digest of the passages recorded since the end before.
    pub rows: Hash,
}

/// The checkpoints of one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Checked {
    /// The picture.
    pub picture: String,
    /// The panel's label.
    pub panel: String,
    /// Digest of the run's question.
    pub spec: Hash,
    /// Digest of its answer, as in the figure's reference.
    pub data: Hash,
    /// The ends of its stretches, in order.
    pub ends: Vec<End>,
}

/// The checkpoints of a figure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Checkpoints {
    /// Format version.
    version: u32,
    /// The figure.
    pub figure: String,
    /// The root of the tree over everything below.
    pub root: Hash,
    /// Its long runs.
    pub runs: Vec<Checked>,
}

/// Why checkpoints do not show what they should.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Doubt {
    /// Not a file of checkpoints.
    #[error("not checkpoints of this version: {0}")]
    Malformed(String),
    /// The root is not that of what is there.
    #[error("the root is not that of the checkpoints: one of them, or the root, was changed")]
    Root,
    /// They are of other runs than the figure's.
    #[error("{0}")]
    OtherRuns(String),
    /// A stretch comes out otherwise.
    #[error("{picture} ({panel}), stretch {stretch}: {what}")]
    Stretch {
        /// The picture.
        picture: String,
        /// The panel.
        panel: String,
        /// Which stretch, from 1.
        stretch: usize,
        /// What differs.
        what: String,
    },
}

/// A stretch that can be recomputed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// The run, from 0.
    pub run: usize,
    /// The stretch, from 0.
    pub stretch: usize,
}

/// The runs of a figure that are long enough to be cut: picture, panel, run.
pub fn runs(figure: &Figure) -> Vec<(&str, &str, &RunSpec)> {
    let panels = figure.pictures.iter().flat_map(|p| p.panels.iter().map(move |panel| (p.name.as_str(), panel)));
    panels
        .map(|(picture, panel)| (picture, panel.label.as_str(), &panel.run))
        .filter(|(_, _, run)| stretch::can_be_cut(run) && stretch::segments(run) >= LONG)
        .collect()
}

/// Cuts a run into `stretches`, computes them one by one, and looks that they are the whole run's answer.
///
/// # Errors
///
/// If the run cannot be computed, or its stretches are not its answer: then the state at a restart would not be the whole state.
pub fn cut(
    (picture, panel, run): (&str, &str, &RunSpec),
    stretches: u64,
    answer: &Answer,
    watch: &dyn Watch,
) -> Result<Checked, JobError> {
    let count = stretch::segments(run);
    let mut ends: Vec<End> = Vec::new();
    let (mut from, mut state, mut rows) = (0, stretch::start(run), Vec::new());
    for i in 1..=stretches {
        let mut to = (u128::from(count) * u128::from(i) / u128::from(stretches)) as u64;
        if to <= from {
            continue;
        }
        let found = loop {
            let found = stretch::compute(run, Part { from, to }, &state, watch)?;
            if to == count || stretch::may_be_cut_at(run, &found.state) {
                break found;
            }
            to += 1;
        };
        ends.push(End { segments: to, t: found.t, state: found.state.clone(), rows: digest(&found) });
        rows.extend(found.rows.rows());
        (from, state) = (to, found.state);
    }
    let whole = answer.table("section").map(twofold_job::Table::rows).unwrap_or_default();
    let end: Vec<f64> = answer.fact("state")?;
    if rows != whole || end != state[..end.len().min(state.len())] {
        return Err(JobError::Other(format!("{picture} ({panel}): its stretches are not the run")));
    }
    let spec = question_hash(&Run(run.clone()));
    Ok(Checked { picture: picture.to_owned(), panel: panel.to_owned(), spec, data: answer.hash(), ends })
}

fn digest(found: &stretch::Stretch) -> Hash {
    Hash::of(&encode::bits(std::slice::from_ref(&found.rows)))
}

impl Checkpoints {
    /// The checkpoints of these runs.
    pub fn of(figure: &str, runs: Vec<Checked>) -> Self {
        let root = tree(figure, &runs).root().clone();
        Self { version: VERSION, figure: figure.to_owned(), root, runs }
    }

    /// Reads checkpoints; whether they are true is another matter ([`Checkpoints::confirm`]).
    ///
    /// # Errors
    ///
    /// [`Doubt::Malformed`].
    pub fn parse(text: &str) -> Result<Self, Doubt> {
        let found: Self = serde_json::from_str(text).map_err(|e| Doubt::Malformed(e.to_string()))?;
        if found.version != VERSION {
            return Err(Doubt::Malformed(format!("it is of version {}, this program reads {VERSION}", found.version)));
        }
        Ok(found)
    }

    /// As JSON: a line for each stretch.
    pub fn to_json(&self) -> Vec<u8> {
        let json = |value: &dyn Fn() -> Vec<u8>| String::from_utf8_lossy(&value()).into_owned();
        let runs: Vec<String> = self
            .runs
            .iter()
            .map(|run| {
                let ends: Vec<String> = run.ends.iter().map(|end| json(&|| canonical_json(end))).collect();
                format!(
                    "{{\"picture\":{},\"panel\":{},\"spec\":{},\"data\":{},\"ends\":[\n{}]}}",
                    json(&|| canonical_json(&run.picture)),
                    json(&|| canonical_json(&run.panel)),
                    json(&|| canonical_json(&run.spec)),
                    json(&|| canonical_json(&run.data)),
                    ends.join(",\n")
                )
            })
            .collect();
        let (figure, root) = (json(&|| canonical_json(&self.figure)), json(&|| canonical_json(&self.root)));
        format!("{{\"version\":{VERSION},\"figure\":{figure},\"root\":{root},\"runs\":[\n{}]}}\n", runs.join(",\n"))
            .into_bytes()
    }

    /// The tree over the runs and their stretches.
    pub fn tree(&self) -> Tree {
        tree(&self.figure, &self.runs)
    }

    /// Looks at everything that can be seen without computing: the tree, and that these are the runs of `figure` with the answers of its
    /// reference, cut where they may be.
    ///
    /// # Errors
    ///
    /// What is wrong.
    pub fn confirm(&self, figure: &Figure, reference: &Manifest) -> Result<(), Doubt> {
        if *self.tree().root() != self.root {
            return Err(Doubt::Root);
        }
        let other = |what: String| Err(Doubt::OtherRuns(what));
        let wanted = runs(figure);
        if self.figure != figure.id || wanted.len() != self.runs.len() {
            return other(format!(
                "these are {} runs of {}, and {} has {}",
                self.runs.len(),
                self.figure,
                figure.id,
                wanted.len()
            ));
        }
        for ((picture, panel, run), found) in wanted.into_iter().zip(&self.runs) {
            let name = format!("{picture} ({panel})");
            if (picture, panel) != (&found.picture, &found.panel) {
                return other(format!("{name} stands where {} ({}) does", found.picture, found.panel));
            }
            if found.spec != question_hash(&Run(run.clone())) {
                return other(format!("{name} is another run: another question was asked"));
            }
            let published =
                reference.picture(picture).and_then(|p| p.panels.iter().find(|q| q.label == panel)).map(|q| &q.data);
            if published != Some(&found.data) {
                return other(format!("{name}: the answer is not that of the figure's reference"));
            }
            let (count, states) = (stretch::segments(run), stretch::start(run).len());
            let mut before = 0;
            let sound = found.ends.iter().all(|end| {
                let later = end.segments > before;
                before = end.segments;
                later && end.state.len() == states && (before == count || stretch::may_be_cut_at(run, &end.state))
            });
            if !sound || before != count {
                return other(format!("{name} is not cut from its start to its end where it may be"));
            }
        }
        Ok(())
    }

    /// All stretches.
    pub fn places(&self) -> Vec<Place> {
        let each =
            |(run, checked): (usize, &Checked)| (0..checked.ends.len()).map(move |stretch| Place { run, stretch });
        self.runs.iter().enumerate().flat_map(each).collect()
    }

    /// The number of a stretch's leaf in the tree: each run's own leaf stands before those of its stretches.
    pub fn leaf_number(&self, place: Place) -> usize {
        self.runs.iter().take(place.run).map(|run| 1 + run.ends.len()).sum::<usize>() + 1 + place.stretch
    }

    /// Recomputes a stretch.
    ///
    /// # Errors
    ///
    /// If the computation fails. That it comes out otherwise is the [`Doubt`].
    pub fn recompute(&self, figure: &Figure, place: Place, watch: &dyn Watch) -> Result<Result<(), Doubt>, JobError> {
        let run = runs(figure).get(place.run).map(|(_, _, run)| (*run).clone());
        let (Some(run), Some(checked)) = (run, self.runs.get(place.run)) else {
            return Err(JobError::Other("there is no such run".into()));
        };
        let Some(end) = checked.ends.get(place.stretch) else {
            return Err(JobError::Other("there is no such stretch".into()));
        };
        let (from, state) = match place.stretch.checked_sub(1).and_then(|before| checked.ends.get(before)) {
            Some(before) => (before.segments, before.state.clone()),
            None => (0, stretch::start(&run)),
        };
        let doubt = |what: String| Doubt::Stretch {
            picture: checked.picture.clone(),
            panel: checked.panel.clone(),
            stretch: place.stretch + 1,
            what,
        };
        let found = match stretch::compute(&run, Part { from, to: end.segments }, &state, watch) {
            Ok(found) => found,
            Err(JobError::Interrupted) => return Err(JobError::Interrupted),
            // From the true state it could be computed.
            Err(error) => return Ok(Err(doubt(error.to_string()))),
        };
        let bits = |x: &[f64]| x.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
        Ok(if bits(&found.state) != bits(&end.state) {
            Err(doubt(format!("it ends in {:?}, and not in {:?}", found.state, end.state)))
        } else if found.t.to_bits() != end.t.to_bits() {
            Err(doubt(format!("it ends at t = {}, and not at {}", found.t, end.t)))
        } else if digest(&found) != end.rows {
            Err(doubt("the passages in it are others".into()))
        } else {
            Ok(())
        })
    }
}

fn tree(figure: &str, runs: &[Checked]) -> Tree {
    let mut leaves = Vec::new();
    for run in runs {
        // What is known of the whole run, then each stretch with the state that it begins from.
        leaves.push(leaf(&canonical_json(&(figure, &run.picture, &run.panel, &run.spec, &run.data, run.ends.len()))));
        let mut before: Option<&End> = None;
        for end in &run.ends {
            leaves.push(leaf(&canonical_json(&(&run.spec, before, end))));
            before = Some(end);
        }
    }
    Tree::of(leaves)
}

/// So many of `all`, each once, in order, as `root` and `seed` choose them.
pub fn choose<T: Copy + Ord>(all: &[T], count: usize, root: &Hash, seed: u64) -> Vec<T> {
    let from_root = u64::from_str_radix(&root.as_str()[..16], 16).unwrap_or(0);
    let mut random = RandomStream::new(from_root, seed);
    let mut rest: Vec<T> = all.to_vec();
    let mut chosen = BTreeSet::new();
    while chosen.len() < count && !rest.is_empty() {
        let at = ((random.uniform() * rest.len() as f64) as usize).min(rest.len() - 1);
        chosen.insert(rest.swap_remove(at));
    }
    chosen.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Alterations, figures};
    use twofold_job::Desk;
    use twofold_job::record::PanelEntry;

    /// Figures 7 and 9 made short, their checkpoints, and a reference that goes with them.
    fn short(id: &str) -> (Figure, Checkpoints, Manifest) {
        let mut figure = figures::all().into_iter().find(|f| f.id == id).unwrap();
        let mut reference = Manifest::parse(figures::reference(id).unwrap(), id).unwrap();
        for picture in &mut figure.pictures {
            let t_end = if id == "fig9" { 25.0 } else { 1300.0 };
            let name = picture.name.clone();
            picture.alter(&Alterations { t_end: Some(t_end), ..Alterations::default() });
            picture.name = name;
            if id == "fig9" {
                picture.panels.retain(|p| p.label == "ii");
            }
            picture.panels.truncate(1);
        }
        let runs: Vec<Checked> = super::runs(&figure)
            .into_iter()
            .map(|(picture, panel, run)| {
                let answer = Desk::quiet().ask(&Run(run.clone())).unwrap();
                cut((picture, panel, run), 64, &answer, &()).unwrap()
            })
            .collect();
        assert_eq!(runs.len(), 2);
        for picture in &mut reference.pictures {
            picture.panels = runs
                .iter()
                .filter(|r| r.picture == picture.name)
                .map(|r| PanelEntry {
                    label: r.panel.clone(),
                    spec: r.spec.clone(),
                    data: r.data.clone(),
                    verdict: None,
                })
                .collect();
        }
        (figure, Checkpoints::of(id, runs), reference)
    }

    #[test]
    fn true_checkpoints_are_confirmed_and_every_changed_bit_is_found() {
        for id in ["fig7", "fig9"] {
            let (figure, good, reference) = short(id);
            good.confirm(&figure, &reference).unwrap();
            assert_eq!(Checkpoints::parse(std::str::from_utf8(&good.to_json()).unwrap()).unwrap(), good);
            let places = good.places();
            assert_eq!(places.len(), 2 * 64);
            for place in choose(&places, 20, &good.root, 0) {
                assert_eq!(good.recompute(&figure, place, &()).unwrap(), Ok(()), "{place:?}");
                let path = good.tree().path(good.leaf_number(place)).unwrap();
                let run = &good.runs[place.run];
                let before = place.stretch.checked_sub(1).map(|i| &run.ends[i]);
                let leaf = leaf(&canonical_json(&(&run.spec, before, &run.ends[place.stretch])));
                assert_eq!(path.root(&leaf), good.root);
            }

            // A bit of a state, of a digest, of a time, of a place: the tree says so, and if the tree is made to fit, the computation.
            let place = Place { run: 1, stretch: 40 };
            type Change = fn(&mut End);
            let changes: [(&str, Change); 4] = [
                ("state", |end| end.state[1] = f64::from_bits(end.state[1].to_bits() ^ 1)),
                ("rows", |end| end.rows = Hash::of(end.rows.as_str().as_bytes())),
                ("time", |end| end.t = f64::from_bits(end.t.to_bits() ^ 1)),
                ("segments", |end| end.segments += 1),
            ];
            for (what, change) in changes {
                let mut bad = good.clone();
                change(&mut bad.runs[place.run].ends[place.stretch]);
                assert_eq!(bad.confirm(&figure, &reference), Err(Doubt::Root), "{what}");
                let fitted = Checkpoints::of(id, bad.runs.clone());
                assert_ne!(fitted.root, good.root, "{what}");
                if fitted.confirm(&figure, &reference).is_ok() {
                    let found = fitted.recompute(&figure, place, &()).unwrap();
                    assert!(matches!(found, Err(Doubt::Stretch { stretch: 41, .. })), "{what}: {found:?}");
                }
            }
            let mut bad = good.clone();
            bad.root = Hash::of(b"other");
            assert_eq!(bad.confirm(&figure, &reference), Err(Doubt::Root));
        }
    }

    #[test]
    fn other_runs_are_not_taken_for_these() {
        let (figure, good, reference) = short("fig7");
        let refit = |runs: Vec<Checked>| Checkpoints::of("fig7", runs);
        let doubt = |c: &Checkpoints| c.confirm(&figure, &reference).unwrap_err().to_string();
        let change = |change: &dyn Fn(&mut Vec<Checked>)| {
            let mut runs = good.runs.clone();
            change(&mut runs);
            doubt(&refit(runs))
        };
        assert!(change(&|r| r.truncate(1)).contains("1 runs"));
        assert!(change(&|r| r.swap(0, 1)).contains("stands where"));
        assert!(change(&|r| r[0].spec = Hash::of(b"")).contains("another question"));
        assert!(change(&|r| r[0].data = Hash::of(b"")).contains("reference"));
        assert!(change(&|r| r[0].ends.truncate(9)).contains("not cut"));
        assert!(change(&|r| r[0].ends.swap(3, 4)).contains("not cut"));
        assert!(change(&|r| r[0].ends[5].state[1] = 0.0).contains("not cut"), "on the plane");
        assert!(change(&|r| r[0].ends[5].state.push(0.0)).contains("not cut"));
        assert!(change(&|r| r[1].ends.clear()).contains("not cut"));
        assert!(matches!(Checkpoints::parse("{}"), Err(Doubt::Malformed(_))));
        let text = String::from_utf8(good.to_json()).unwrap();
        assert!(matches!(
            Checkpoints::parse(&text.replacen("\"version\":1", "\"version\":9", 1)),
            Err(Doubt::Malformed(_))
        ));
    }

    #[test]
    fn the_choice_follows_from_root_and_seed() {
        let all: Vec<u32> = (0..100).collect();
        let (a, b) = (Hash::of(b"a"), Hash::of(b"b"));
        let chosen = choose(&all, 8, &a, 0);
        assert_eq!(chosen.len(), 8);
        assert_eq!(chosen, choose(&all, 8, &a, 0));
        assert_ne!(chosen, choose(&all, 8, &b, 0));
        assert_ne!(chosen, choose(&all, 8, &a, 1));
        assert_eq!(choose(&all, 1000, &a, 0), all);
        assert!(choose(&[0_u32; 0], 3, &a, 0).is_empty());
    }
}
