//! The rows of a sweep, and the files that hold them.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use super::{Outcome, Shard, Sweep};
use crate::encode::{self, Heading, Malformed};
use crate::question::NUMERICS;
use crate::record::Hash;
use crate::record::hash::canonical_json;
use crate::table::{Column, ColumnKind, Entry, Table};

/// Name of the format in its files.
const FORMAT: &str = "twofold-sweep";
/// The version of that format. From version 2 on `data` is the digest of the heading, too; from
/// version 3 on there are no errors of rates.
pub const VERSION: u64 = 3;
/// Hexadecimal digits of a question's digest that a row carries: as many as fit a whole number of a
/// table.
const KEY: usize = 15;

/// The outcome of a row that failed.
const FAILED: &str = "failed";

/// A finished cell of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    number: u64,
    cells: Vec<Entry>,
}

/// Why rows cannot be merged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RowsError {
    /// The file is not one of ours.
    #[error(transparent)]
    Malformed(#[from] Malformed),
    /// Two sweeps.
    #[error("they are of different sweeps ({0} and {1}): only parts of one sweep are merged")]
    OtherSweep(String, String),
    /// Two versions of the numerics.
    #[error(
        "its rows were computed by another version of the numerics ({0}) than those before it \
            ({1}): compute one of the parts \
         anew, or go on with it by `twofold sweep --resume --recheck N`"
    )]
    OtherNumerics(String, String),
    /// Two values.
    #[error(
        "row {0} has two different contents: they were computed by different versions, or one is \
            damaged"
    )]
    Conflict(u64),
}

/// The columns that every sweep has after its axes.
fn found_columns() -> [Column; 15] {
    let time = |name| Column::new(name, "1", ColumnKind::Number);
    [
        Column::integers("key"),
        Column::words("outcome"),
        Column::integers("period"),
        time("captured_at"),
        time("settled_at"),
        time("radius"),
        time("rate"),
        time("turn"),
        time("exponent"),
        time("exponent_error"),
        Column::integers("crossings"),
        time("end"),
        Column::integers("steps"),
        Column::words("reason"),
        Column::integers("row"),
    ]
}

impl Row {
    pub(super) fn found(number: u64, settings: Vec<Entry>, key: &Hash, outcome: Outcome) -> Self {
        let blank = |v: Option<f64>| Entry::Number(v.unwrap_or(f64::NAN));
        let whole = |v: u64| Entry::Integer(i64::try_from(v).unwrap_or(i64::MAX));
        let mut cells = settings;
        cells.extend([
            key_entry(Some(key)),
            Entry::Word(outcome.word),
            whole(outcome.period),
            blank(outcome.captured_at),
            blank(outcome.settled_at),
            blank(outcome.radius),
            blank(outcome.rate),
            blank(outcome.turn),
            blank(outcome.exponent),
            blank(outcome.exponent_error),
            whole(outcome.crossings),
            Entry::Number(outcome.end),
            whole(outcome.steps),
            Entry::Word(String::new()),
            whole(number),
        ]);
        Self { number, cells }
    }

    pub(super) fn failed(
        number: u64,
        settings: Vec<Entry>,
        key: Option<&Hash>,
        reason: String,
    ) -> Self {
        let blank = || Entry::Number(f64::NAN);
        let mut cells = settings;
        cells.extend([key_entry(key), Entry::Word(FAILED.into()), Entry::Integer(0)]);
        cells.extend((0..7).map(|_| blank()));
        cells.extend([
            Entry::Integer(0),
            blank(),
            Entry::Integer(0),
            // One line that steers no terminal, whatever the reason says.
            Entry::Word(reason.replace(char::is_control, " ")),
            Entry::Integer(i64::try_from(number).unwrap_or(i64::MAX)),
        ]);
        Self { number, cells }
    }

    /// Its number.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Its outcome, in a word.
    pub fn outcome(&self) -> &str {
        self.cell_from_last(14).word()
    }

    /// Why it failed, if it did.
    pub fn reason(&self) -> Option<&str> {
        let reason = self.cell_from_last(2).word();
        (!reason.is_empty()).then_some(reason)
    }

    /// The leading digits of its question's digest.
    pub fn key(&self) -> i64 {
        match self.cell_from_last(15) {
            Entry::Integer(key) => *key,
            _ => 0,
        }
    }

    /// Whether it is the row of its number in this sweep, as far as that is known without computing
    /// it.
    fn check(&self, sweep: &Sweep) -> Result<(), Malformed> {
        let wrong = |what: &str| Err(Malformed(format!("row {} {what}", self.number)));
        if self.number >= sweep.rows() {
            return wrong(&format!("is not one of the {} rows of its sweep", sweep.rows()));
        }
        let same = |(a, b): (&Entry, &Entry)| match (a, b) {
            (Entry::Number(a), Entry::Number(b)) => a.to_bits() == b.to_bits(),
            (a, b) => a == b,
        };
        if !sweep.settings(self.number).iter().zip(&self.cells).all(same) {
            return wrong("has other values of what is varied than its number says");
        }
        // A cell whose settings make no question has no key.
        let key = sweep.key(self.number);
        if *self.cell_from_last(15) != key_entry(key.as_ref()) {
            return wrong("has the key of another question");
        }
        let plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
        if !self.outcome().starts_with(|c: char| c.is_ascii_lowercase())
            || !self.outcome().bytes().all(plain)
        {
            return wrong("has an outcome that is no word of ours");
        }
        if self.reason().is_some_and(|reason| reason.contains(char::is_control)) {
            return wrong("gives a reason with control characters in it");
        }
        if self.reason().is_some() != (self.outcome() == FAILED) {
            return wrong("gives a reason and has not failed, or the other way round");
        }
        Ok(())
    }

    fn cell_from_last(&self, i: usize) -> &Entry {
        &self.cells[self.cells.len() - i]
    }

    /// The row as a line of JSON: its cells in order, blanks as null.
    pub fn line(&self) -> String {
        let cells: Vec<Value> = self
            .cells
            .iter()
            .map(|cell| match cell {
                // Not-a-number becomes null.
                Entry::Number(v) => json!(v),
                Entry::Integer(v) => json!(v),
                Entry::Word(w) => json!(w),
            })
            .collect();
        Value::Array(cells).to_string()
    }

    fn of_line(line: &str, columns: &[Column]) -> Result<Self, Malformed> {
        let wrong = |what: &str| Malformed(format!("a row is {what}: {line}"));
        let Ok(Value::Array(values)) = serde_json::from_str(line) else {
            return Err(wrong("not a list"));
        };
        if values.len() != columns.len() {
            return Err(wrong("of another length than its heading says"));
        }
        let cells: Option<Vec<Entry>> = values
            .iter()
            .zip(columns)
            .map(|(value, column)| match column.kind() {
                ColumnKind::Number if value.is_null() => Some(Entry::Number(f64::NAN)),
                ColumnKind::Number => value.as_f64().map(Entry::Number),
                ColumnKind::Integer => value.as_i64().map(Entry::Integer),
                ColumnKind::Word => value.as_str().map(Entry::from),
            })
            .collect();
        Self::of_cells(cells.ok_or_else(|| wrong("not of its heading's kinds"))?)
    }

    fn of_cells(cells: Vec<Entry>) -> Result<Self, Malformed> {
        match cells.last() {
            Some(Entry::Integer(number)) if *number >= 0 => {
                Ok(Self { number: *number as u64, cells })
            }
            _ => Err(Malformed("a row has no number".into())),
        }
    }
}

fn key_entry(key: Option<&Hash>) -> Entry {
    Entry::Integer(key.and_then(|k| i64::from_str_radix(&k.as_str()[..KEY], 16).ok()).unwrap_or(0))
}

/// Rows of one sweep, each once, in order.
#[derive(Clone, Debug)]
pub struct Rows {
    sweep: Sweep,
    /// The versions of the numerics that computed them.
    numerics: BTreeSet<String>,
    /// As lines, by number: two rows are the same if their lines are.
    lines: BTreeMap<u64, String>,
}

impl Rows {
    /// No rows yet.
    pub fn of(sweep: Sweep) -> Self {
        Self { sweep, numerics: BTreeSet::from([NUMERICS.to_owned()]), lines: BTreeMap::new() }
    }

    /// The sweep.
    pub fn sweep(&self) -> &Sweep {
        &self.sweep
    }

    /// The versions of the numerics that computed these rows.
    pub fn numerics(&self) -> impl Iterator<Item = &str> {
        self.numerics.iter().map(String::as_str)
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Whether the row of this number is there.
    pub fn has(&self, number: u64) -> bool {
        self.lines.contains_key(&number)
    }

    /// The row of this number.
    pub fn get(&self, number: u64) -> Option<Row> {
        Row::of_line(self.lines.get(&number)?, &self.columns()).ok()
    }

    /// The rows, in order.
    pub fn iter(&self) -> impl Iterator<Item = Row> {
        let columns = self.columns();
        self.lines.values().filter_map(move |line| Row::of_line(line, &columns).ok())
    }

    /// The numbers of a shard that are not there, one after the other: a sweep may have more of
    /// them than fit in memory.
    pub fn missing(&self, shard: Shard) -> impl Iterator<Item = u64> + use<> {
        let there: BTreeSet<u64> = self.lines.keys().copied().collect();
        shard.rows(&self.sweep).filter(move |row| !there.contains(row))
    }

    /// Number of [`Rows::missing`].
    pub fn missing_count(&self, shard: Shard) -> u64 {
        shard.count(&self.sweep) - self.lines.keys().filter(|row| shard.has(**row)).count() as u64
    }

    /// Adds a row.
    ///
    /// # Errors
    ///
    /// If another one of its number is there already.
    pub fn insert(&mut self, row: Row) -> Result<(), RowsError> {
        let line = row.line();
        match self.lines.get(&row.number) {
            Some(old) if *old != line => Err(RowsError::Conflict(row.number)),
            Some(_) => Ok(()),
            None => {
                self.lines.insert(row.number, line);
                Ok(())
            }
        }
    }

    /// Takes in the rows of another part.
    ///
    /// # Errors
    ///
    /// If it is of another sweep, no version of the numerics stands for both, or a row has two
    /// contents.
    pub fn merge(&mut self, other: Rows) -> Result<(), RowsError> {
        // A part that names two versions was rechecked by one of them.
        if self.numerics.is_disjoint(&other.numerics) {
            let names = |rows: &Rows| rows.numerics().collect::<Vec<_>>().join(", ");
            return Err(RowsError::OtherNumerics(names(&other), names(self)));
        }
        self.merge_rechecked(other)
    }

    /// [`Rows::merge`], whatever version of the numerics computed the rows: for those of which some
    /// came out the same again.
    ///
    /// # Errors
    ///
    /// If it is of another sweep, or a row has two contents.
    pub fn merge_rechecked(&mut self, other: Rows) -> Result<(), RowsError> {
        let hashes = [self.sweep.hash(), other.sweep.hash()];
        if hashes[0] != hashes[1] {
            return Err(RowsError::OtherSweep(
                hashes[0].short().to_owned(),
                hashes[1].short().to_owned(),
            ));
        }
        for (number, line) in other.lines {
            match self.lines.get(&number) {
                Some(old) if *old != line => return Err(RowsError::Conflict(number)),
                Some(_) => {}
                None => {
                    self.lines.insert(number, line);
                }
            }
        }
        self.numerics.extend(other.numerics);
        Ok(())
    }

    /// The rows that belong to the same sweep with another number of draws ([`Sweep::with_draws`]);
    /// `None` without random axes.
    pub fn with_draws(&self, count: u64) -> Option<Self> {
        let sweep = self.sweep.with_draws(count)?;
        let lines = self
            .lines
            .range(..sweep.rows())
            .map(|(number, line)| (*number, line.clone()))
            .collect();
        Some(Self { sweep, numerics: self.numerics.clone(), lines })
    }

    /// The number of rows with each outcome.
    pub fn counts(&self) -> BTreeMap<String, u64> {
        let mut counts = BTreeMap::new();
        for row in self.iter() {
            *counts.entry(row.outcome().to_owned()).or_default() += 1;
        }
        counts
    }

    fn columns(&self) -> Vec<Column> {
        let settings = self.sweep.over.iter().map(super::Axis::column);
        settings.chain(self.sweep.own_columns()).chain(found_columns()).collect()
    }

    /// The rows as a table, in order: a column for each axis, of a general system the state at the
    /// end and what happened, then what was found. Blank where there is nothing to say; `key` holds
    /// the leading 60 bits of the question's digest.
    pub fn table(&self) -> Table {
        let mut table = Table::new("sweep", self.columns());
        for row in self.iter() {
            table.push(row.cells);
        }
        table
    }

    /// The description of the rows in their files.
    pub fn about(&self) -> Value {
        self.about_table(&self.table())
    }

    fn about_table(&self, table: &Table) -> Value {
        let mut about = self.heading();
        about["rows"] = json!(self.sweep.rows());
        // The version of the numerics that computed the rows is as much a statement as the rows
        // are.
        let mut said = canonical_json(&about);
        said.extend(encode::bits(std::slice::from_ref(table)));
        about["data"] = json!(Hash::of(&said));
        about
    }

    fn heading(&self) -> Value {
        json!({
            "format": FORMAT,
            "version": VERSION,
            "sweep": self.sweep.hash(),
            "spec": self.sweep,
            "numerics": self.numerics,
        })
    }

    /// The rows as CSV.
    pub fn csv(&self) -> Vec<u8> {
        let table = self.table();
        encode::csv(&table, &self.about_table(&table))
    }

    /// The rows as lines of a journal, a heading first.
    pub fn journal(&self) -> Vec<String> {
        std::iter::once(self.journal_heading()).chain(self.lines.values().cloned()).collect()
    }

    /// The first line of a journal of these rows.
    pub fn journal_heading(&self) -> String {
        String::from_utf8_lossy(&canonical_json(&self.heading())).into_owned()
    }

    /// The rows of a CSV file.
    ///
    /// # Errors
    ///
    /// If it has another form, or was changed.
    pub fn from_csv(bytes: &[u8]) -> Result<Self, RowsError> {
        Self::of_table(encode::from_csv(bytes)?)
    }

    fn of_table((heading, table): (Heading, Table)) -> Result<Self, RowsError> {
        let mut rows = Self::of_heading(&heading.about)?;
        let columns = rows.columns();
        let fits = columns.len() == table.columns.len()
            && columns
                .iter()
                .zip(&table.columns)
                .all(|(a, b)| a.name == b.name && a.unit == b.unit && a.kind() == b.kind());
        if !fits {
            return Err(
                Malformed("its columns are not those of a sweep of this version".into()).into()
            );
        }
        for cells in table.rows() {
            rows.insert(Row::of_cells(cells)?)?;
        }
        if heading.about != rows.about() {
            return Err(Malformed(
                "its rows or its heading are not those that it was written with".into(),
            )
            .into());
        }
        rows.checked()
    }

    /// The rows of a journal's lines.
    ///
    /// # Errors
    ///
    /// If they are anything else.
    pub fn from_journal(lines: &[String]) -> Result<Self, RowsError> {
        let Some((heading, rest)) = lines.split_first() else {
            return Err(Malformed("the journal has no heading".into()).into());
        };
        let heading =
            serde_json::from_str(heading).map_err(|e| Malformed(format!("its heading: {e}")))?;
        let mut rows = Self::of_heading(&heading)?;
        let columns = rows.columns();
        for line in rest {
            // A journal that another version of the program continues names that version.
            if line.starts_with('{') {
                let heading = serde_json::from_str(line)
                    .map_err(|e| Malformed(format!("its heading: {e}")))?;
                rows.merge_rechecked(Self::of_heading(&heading)?)?;
            } else {
                rows.insert(Row::of_line(line, &columns)?)?;
            }
        }
        rows.checked()
    }

    /// The rows, if each is that of its number. A digest reveals damage, not forgery.
    fn checked(self) -> Result<Self, RowsError> {
        self.iter().try_for_each(|row| row.check(&self.sweep))?;
        Ok(self)
    }

    fn of_heading(about: &Value) -> Result<Self, RowsError> {
        let wrong = |what: String| RowsError::from(Malformed(what));
        if about["format"] != FORMAT || about["version"] != VERSION {
            return Err(wrong(format!(
                "it does not say that it is a {FORMAT} of version {VERSION}"
            )));
        }
        let sweep: Sweep = serde_json::from_value(about["spec"].clone())
            .map_err(|e| wrong(format!("its spec: {e}")))?;
        let numerics: BTreeSet<String> = serde_json::from_value(about["numerics"].clone())
            .map_err(|e| wrong(format!("its numerics: {e}")))?;
        if about["sweep"] != json!(sweep.hash()) {
            return Err(wrong("its spec is not the one that it was made with".into()));
        }
        Ok(Self { sweep, numerics, lines: BTreeMap::new() })
    }
}

#[cfg(test)]
mod tests;
