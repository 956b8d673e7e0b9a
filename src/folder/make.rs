//! Making, checking and blessing a paper.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::check::Verdict;
pub use super::made::{Made, Scored, outcome};
use super::{Folder, FolderError, page};
use crate::cli::{CliError, make};
use crate::job::{AnyQuestion, Executor, JobError};
use crate::paper::pipeline::{PictureRecord, questions};
use crate::paper::verdict;
use crate::record::files::{digest as digest_of, read_text, try_folder};
use crate::record::manifest::{VERSION, is_plain_name};
use crate::record::{self, Hash, Manifest};

/// The outcomes of claims, as they are kept in `expected/claims.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcomes {
    /// Version of this file: 1.
    pub version: u32,
    /// A verdict for each claim.
    pub verdicts: Vec<Verdict>,
}

/// Comparison with the expectation.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "state", rename_all = "kebab-case")]
pub enum State {
    /// The same.
    Same,
    /// Another outcome, data or rule.
    Differs {
        /// The difference.
        what: String,
    },
    /// Nothing is expected yet.
    New,
    /// It could not be computed.
    Failed {
        /// Why.
        why: String,
    },
    /// Expected, and no longer there.
    Gone,
}

/// A picture or claim against what is expected.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// The picture's or claim's name.
    pub name: String,
    /// Its comparison with the expectation.
    #[serde(flatten)]
    pub state: State,
    /// Whether it is a claim whose rule was written or changed when its data were already known.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub rule_after_data: bool,
    /// The same of a claim's words.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub words_after_data: bool,
}

impl Finding {
    /// For people.
    pub fn line(&self) -> String {
        let name = &self.name;
        let known = match (self.rule_after_data, self.words_after_data) {
            (true, _) => "; its rule was written or changed when the data were known",
            (_, true) => "; its words were changed when the data were known",
            _ => "",
        };
        match &self.state {
            State::Same => format!("{name}: same{known}"),
            State::Differs { what } => format!("{name}: DIFFERS in its {what}"),
            State::New => format!("{name}: NEW: expected/ has nothing of it yet{known}"),
            State::Failed { why } => format!("{name}: FAILED: {why}"),
            State::Gone => {
                format!("{name}: GONE: it is expected, and the folder has no such picture or claim")
            }
        }
    }

    fn of(name: &str, state: State) -> Self {
        Self { name: name.to_owned(), state, rule_after_data: false, words_after_data: false }
    }
}

impl Folder {
    /// Folder of outputs.
    pub fn out(&self) -> PathBuf {
        self.root.join("out")
    }

    fn expected(&self) -> PathBuf {
        self.root.join("expected")
    }

    /// Makes every figure and scores every claim: all questions side by side, each once. Answers
    /// that the executor's store keeps are not computed again.
    ///
    /// # Errors
    /// If a figure could not be computed, drawn or written, or a repeated run cannot be asked for.
    /// A claim that cannot be scored says so in the result.
    pub fn make(&self, executor: &Executor<'_>) -> Result<Made<'_>, CliError> {
        try_folder(&self.out())?;
        let known = self.known()?;
        for (name, source) in &self.sources {
            executor.asked_for(&*source.question, name.as_str());
            for part in source.question.rests_on() {
                executor.asked_for(&*part, name.as_str());
            }
        }
        let mut asked: Vec<AnyQuestion> = questions(self.figures.iter().flat_map(|f| &f.pictures));
        asked.extend(self.claims_ask(executor)?);
        for picture in self.figures.iter().flat_map(|f| &f.pictures) {
            for (i, panel) in picture.panels.iter().enumerate() {
                for question in verdict::questions(picture, i) {
                    let purpose = format!("verdict of {} ({})", picture.name, panel.label);
                    executor.asked_for(&*question, purpose);
                }
            }
        }
        executor.gather(&asked);
        for read in &self.columns {
            // Why one failed is said with its picture or claim.
            if let Ok(answer) = executor.ask(&*read.question) {
                read.check(&answer)?;
            }
        }
        let before = self.written()?;
        let pictures = make(&self.figures, &self.out(), executor)?;
        self.tidy(&before, &pictures, executor)?;
        let claims = self.score(&known, executor);
        let made = Made { pictures, claims };
        let mut json =
            serde_json::to_vec_pretty(&made.outcomes()).expect("verdicts are plain data");
        json.push(b'\n');
        record::write(&self.out().join("claims.json"), &json)?;
        Ok(made)
    }

    /// The questions of the claims; progress shows which claim asks one.
    ///
    /// # Errors
    /// If a repeated run cannot be asked for.
    pub fn claims_ask(&self, executor: &Executor<'_>) -> Result<Vec<AnyQuestion>, CliError> {
        let mut asked = Vec::new();
        for claim in &self.claims {
            for (purpose, question) in claim.questions(self)? {
                executor.asked_for(&*question, purpose);
                asked.push(question);
            }
        }
        Ok(asked)
    }

    /// The claims with their verdicts, compared with the outcomes that were known before. A claim
    /// that cannot be scored says so in the result.
    pub fn score(&self, known: &Outcomes, executor: &Executor<'_>) -> Vec<Scored<'_>> {
        let scored = self.claims.iter().map(|claim| {
            let verdict = claim.judge(self, executor).map(|mut found| {
                // Was it by this rule that the claim was first judged? A claim that is new is
                // judged by what was known of its data under other names.
                let of_claim = |v: &&Verdict| v.claim == claim.id;
                let mut judged: Vec<&Verdict> = known.verdicts.iter().filter(of_claim).collect();
                if judged.is_empty() {
                    let of_data = |v: &&Verdict| v.has_data_of(&found);
                    judged = known.verdicts.iter().filter(of_data).collect();
                }
                let same = judged.iter().find(|v| v.rule == found.rule);
                found.rule_after_data = same.map_or(!judged.is_empty(), |v| v.rule_after_data);
                found.words_after_data = same.or(judged.first()).is_some_and(|v| {
                    v.words_after_data || v.words.is_some() && v.words != found.words
                });
                executor.progress().line(&format!("scored {}", claim.id));
                found
            });
            if let Err(why) = &verdict {
                executor.progress().line(&format!("{}: cannot be scored: {why}", claim.id));
            }
            Scored { claim, verdict }
        });
        scored.collect()
    }

    /// The records of pictures in `out`, with the folders in which they stand.
    fn written(&self) -> Result<Vec<(String, PictureRecord)>, CliError> {
        let mut found = Vec::new();
        for folder in record::names(&self.out())?.into_iter().filter(|name| is_plain_name(name)) {
            let place = self.out().join(&folder);
            let files = if place.is_dir() { record::names(&place)? } else { Vec::new() };
            for name in files.iter().filter_map(|file| file.strip_suffix(".json")) {
                // Another file was not written by this program.
                let record = read_text(&place.join(format!("{name}.json")))
                    .ok()
                    .and_then(|text| serde_json::from_str::<PictureRecord>(&text).ok())
                    .filter(|record| record.hashes.name == name);
                found.extend(record.map(|record| (folder.clone(), record)));
            }
        }
        Ok(found)
    }

    /// Removes the files for which records of an earlier time vouch, and which are no longer made:
    /// those of a figure, reading or panel that is gone. Any other file stays.
    fn tidy(
        &self,
        before: &[(String, PictureRecord)],
        made: &[PictureRecord],
        executor: &Executor<'_>,
    ) -> Result<(), CliError> {
        let record_of = |record: &PictureRecord| format!("{}.json", record.hashes.name);
        // Where names that differ in case alone are one file, it is kept.
        let place = |folder: &str, file: &str| format!("{folder}/{file}").to_ascii_lowercase();
        let mut made = made.iter();
        let mut kept = BTreeSet::new();
        for figure in &self.figures {
            for record in made.by_ref().take(figure.pictures.len()) {
                let files = record.files().into_iter().map(|(file, _)| file);
                kept.extend(files.chain([record_of(record)]).map(|f| place(&figure.id, &f)));
            }
        }
        let of_code = self.code.map_or(Vec::new(), |code| (code.figures)());
        let theirs = |folder: &String| of_code.iter().any(|figure| figure.id == *folder);
        for (folder, record) in before.iter().filter(|(folder, _)| !theirs(folder)) {
            let own = record_of(record);
            let digest = Hash::of(&record.to_json());
            let files = record.files().into_iter().chain([(own, &digest)]);
            for (file, hash) in files.filter(|(file, _)| !kept.contains(&place(folder, file))) {
                let path = self.out().join(folder).join(&file);
                let is_ours = is_plain_name(&file)
                    && path.symlink_metadata().is_ok_and(|m| m.is_file())
                    && digest_of(&path).is_ok_and(|(found, _)| found == *hash);
                if is_ours {
                    record::files::remove(&path)?;
                    executor.progress().line(&format!("no longer made: {}", path.display()));
                }
            }
            record::files::remove_if_empty(&self.out().join(folder))?;
        }
        Ok(())
    }

    /// Writes the page about what was made, and what archives and CODECHECK take.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn report(&self, made: &Made<'_>) -> Result<PathBuf, CliError> {
        let path = self.out().join("report.html");
        record::write(&path, page::page(self, made).as_bytes())?;
        record::write(&self.out().join("codecheck.yml"), page::codecheck(self, made).as_bytes())?;
        record::write(
            &self.out().join("ro-crate-metadata.json"),
            &page::crate_metadata(self, made),
        )?;
        Ok(path)
    }

    /// Advice about the metadata for archives, if something that they need is missing.
    pub fn metadata_lack(&self) -> Option<String> {
        page::crate_lacks(self)
    }

    /// Compares the results with the expectation, pictures first.
    ///
    /// # Errors
    /// If a file of `expected/` cannot be read.
    pub fn compare(&self, made: &Made<'_>) -> Result<Vec<Finding>, CliError> {
        let mut findings = Vec::new();
        let mut pictures = made.pictures.iter();
        for figure in &self.figures {
            let manifest = self.manifest(&figure.id)?;
            for picture in pictures.by_ref().take(figure.pictures.len()) {
                let name = picture.hashes.name.clone();
                let state = match manifest.as_ref().and_then(|m| m.picture(&name)) {
                    None => State::New,
                    Some(old) => match old.first_difference(&picture.hashes) {
                        None => State::Same,
                        Some(d) if d.panels.is_empty() => {
                            State::Differs { what: d.layer.name().to_owned() }
                        }
                        Some(d) => State::Differs {
                            what: format!(
                                "{} (panel {})",
                                d.layer.name(),
                                record::listed(&d.panels)
                            ),
                        },
                    },
                };
                findings.push(Finding::of(&name, state));
            }
            for old in manifest.iter().flat_map(|m| &m.pictures) {
                if !figure.pictures.iter().any(|p| p.name == old.name) {
                    findings.push(Finding::of(&old.name, State::Gone));
                }
            }
        }
        findings.extend(self.figures_gone()?.iter().map(|name| Finding::of(name, State::Gone)));
        let before = self.outcomes()?;
        for Scored { claim, verdict } in &made.claims {
            let old = before.verdicts.iter().find(|v| v.claim == claim.id);
            let state = match (verdict, old) {
                (Err(why), _) => State::Failed { why: why.to_string() },
                (Ok(_), None) => State::New,
                (Ok(now), Some(old)) if now.rule != old.rule => {
                    let known =
                        if now.rule_after_data { ", changed when the data were known" } else { "" };
                    State::Differs { what: format!("rule{known}") }
                }
                (Ok(now), Some(old)) if old.words.is_some() && now.words != old.words => {
                    let known = if now.words_after_data {
                        ", changed when the data were known"
                    } else {
                        ""
                    };
                    State::Differs { what: format!("words{known}") }
                }
                (Ok(now), Some(old)) if now.decided != old.decided => {
                    State::Differs { what: "rule's date".into() }
                }
                (Ok(now), Some(old)) if now.agrees != old.agrees => {
                    State::Differs { what: format!("outcome: {}", now.found) }
                }
                (Ok(now), Some(old)) if now.data != old.data => {
                    State::Differs { what: "data".into() }
                }
                (Ok(now), Some(old)) if (&now.found, now.odds) != (&old.found, old.odds) => {
                    State::Differs { what: format!("finding: {}", now.found) }
                }
                _ => State::Same,
            };
            let known = |what: fn(&Verdict) -> bool| verdict.as_ref().is_ok_and(what);
            findings.push(Finding {
                rule_after_data: known(|now| now.rule_after_data),
                words_after_data: known(|now| now.words_after_data),
                ..Finding::of(&claim.id, state)
            });
        }
        for old in &before.verdicts {
            if !self.claims.iter().any(|c| c.id == old.claim) {
                findings.push(Finding::of(&old.claim, State::Gone));
            }
        }
        Ok(findings)
    }

    /// Figures of which a manifest is expected, and which neither the folder nor its code has.
    fn figures_gone(&self) -> Result<Vec<String>, CliError> {
        let expected = self.expected();
        if !expected.exists() {
            return Ok(Vec::new());
        }
        let wanted = |path: &str| path.ends_with(".json") && path != "claims.json";
        let of_code = self.code.map_or(Vec::new(), |code| (code.figures)());
        let mut gone = Vec::new();
        for file in record::read_tree(&expected, &wanted)?.files {
            let name = file.path.trim_end_matches(".json").to_owned();
            // Another file was not written by this program.
            let text = String::from_utf8_lossy(&file.bytes);
            let own = Manifest::parse(&text, &name).is_ok_and(|m| m.figure == name);
            if own && !self.figures.iter().chain(&of_code).any(|f| f.id == name) {
                gone.push(name);
            }
        }
        Ok(gone)
    }

    /// Makes the current results the expectation, and records the reason. Returns the changes;
    /// writes nothing if there are none.
    ///
    /// # Errors
    /// If a claim could not be scored, or a file cannot be written.
    pub fn bless(&self, made: &Made<'_>, reason: &str) -> Result<Vec<String>, CliError> {
        let findings = self.compare(made)?;
        if let Some(Finding { name, state: State::Failed { why }, .. }) =
            findings.iter().find(|f| matches!(f.state, State::Failed { .. }))
        {
            return Err(CliError::Job(JobError::Other(format!(
                "{name}: {why}; what fails is not blessed"
            ))));
        }
        let mut changed: Vec<String> = findings
            .iter()
            .filter_map(|f| match &f.state {
                State::Same | State::Failed { .. } => None,
                State::Differs { what } => Some(format!("{} ({what})", f.name)),
                State::New => Some(format!("{} (new)", f.name)),
                State::Gone => Some(format!("{} (gone)", f.name)),
            })
            .collect();
        if self.outcomes()?.verdicts.iter().any(|v| v.words.is_none()) {
            changed.push("claims (their words, which older versions did not keep)".into());
        }
        if changed.is_empty() {
            return Ok(changed);
        }
        // Read first: if it cannot be, nothing is written.
        let log = self.expected().join("CHANGES.md");
        let mut text = if log.exists() {
            read_text(&log)?
        } else {
            "# Why expectations changed\n\n".to_owned()
        };
        let mut pictures = made.pictures.iter();
        for figure in &self.figures {
            let manifest = Manifest {
                version: VERSION,
                figure: figure.id.to_string(),
                made_by: env!("CARGO_PKG_VERSION").to_owned(),
                pictures: pictures
                    .by_ref()
                    .take(figure.pictures.len())
                    .map(|p| p.hashes.clone())
                    .collect(),
            };
            record::write(
                &self.expected().join(format!("{}.json", figure.id)),
                &manifest.to_json(),
            )?;
        }
        for name in self.figures_gone()? {
            record::files::remove(&self.expected().join(format!("{name}.json")))?;
        }
        let mut json =
            serde_json::to_vec_pretty(&made.outcomes()).expect("verdicts are plain data");
        json.push(b'\n');
        record::write(&self.expected().join("claims.json"), &json)?;
        text += &format!("- {reason}: {}\n", changed.join(", "));
        record::write(&log, text.as_bytes())?;
        Ok(changed)
    }

    fn manifest(&self, figure: &str) -> Result<Option<Manifest>, CliError> {
        let path = self.expected().join(format!("{figure}.json"));
        if !path.exists() {
            return Ok(None);
        }
        let text = read_text(&path)?;
        Ok(Some(Manifest::parse(&text, &path.display().to_string()).map_err(|e| self.anew(e))?))
    }

    /// A file of `expected/` that cannot be used, and what to do.
    fn anew(&self, why: impl std::fmt::Display) -> CliError {
        CliError::Usage(format!(
            "{why}; restore it, or remove it and keep what is made: twofold paper bless {} \
                --reason \"...\"",
            self.root.display()
        ))
    }

    /// The outcomes that are expected, and those that were made last.
    ///
    /// # Errors
    /// If a file of them cannot be read.
    pub fn known(&self) -> Result<Outcomes, CliError> {
        let mut known = self.outcomes()?;
        let path = self.out().join("claims.json");
        // Another version's cannot be read.
        let made = if path.exists() { serde_json::from_str(&read_text(&path)?).ok() } else { None };
        let made: Outcomes = made.unwrap_or_default();
        known.verdicts.extend(made.verdicts);
        Ok(known)
    }

    /// The outcomes that are expected.
    fn outcomes(&self) -> Result<Outcomes, CliError> {
        let path = self.expected().join("claims.json");
        if !path.exists() {
            return Ok(Outcomes::default());
        }
        let wrong = |why: String| self.anew(format!("{}: {why}", path.display()));
        let outcomes: Outcomes =
            serde_json::from_str(&read_text(&path)?).map_err(|e| wrong(e.to_string()))?;
        let mut claims = BTreeSet::new();
        let twice = outcomes.verdicts.iter().find(|v| !claims.insert(&v.claim));
        match twice {
            _ if outcomes.version != 1 => {
                Err(wrong(format!("version {} is not known", outcomes.version)))
            }
            Some(twice) => Err(wrong(format!("two outcomes of claim {}", twice.claim))),
            None => Ok(outcomes),
        }
    }
}

impl Made<'_> {
    fn outcomes(&self) -> Outcomes {
        Outcomes {
            version: 1,
            verdicts: self.claims.iter().filter_map(|s| s.verdict.as_ref().ok().cloned()).collect(),
        }
    }
}

impl From<FolderError> for CliError {
    fn from(error: FolderError) -> Self {
        match error {
            FolderError::File(file) => file.into(),
            other => CliError::Usage(other.to_string()),
        }
    }
}

/// The files of a small paper that runs.
const TEMPLATE: [(&str, &str); 6] = [
    ("paper.toml", include_str!("template/paper.toml")),
    ("systems/relay.toml", include_str!("template/systems/relay.toml")),
    ("figures/fig1.toml", include_str!("template/figures/fig1.toml")),
    ("measures.toml", include_str!("template/measures.toml")),
    ("claims.toml", include_str!("template/claims.toml")),
    ("README.md", include_str!("template/README.md")),
];

/// Writes a small paper that runs into a folder that does not exist or is empty.
///
/// # Errors
/// If there is something in the folder, or a file cannot be written.
pub fn begin(root: &Path) -> Result<(), CliError> {
    let empty = !root.exists() || root.read_dir().is_ok_and(|mut entries| entries.next().is_none());
    if !empty {
        let why = format!("{} is not empty; name a folder that does not exist yet", root.display());
        return Err(CliError::Usage(why));
    }
    for (file, text) in TEMPLATE {
        record::write(&root.join(file), text.as_bytes())?;
    }
    Ok(())
}
