//! Answers as bytes, and back.
//!
//! [`bits`] is what is hashed and what the store keeps; [`csv()`] and [`json()`] are for people and
//! other programs. All three are views of the same [`Table`]s, and all three are read back by this
//! file, with units and metadata: a table that comes back is equal to the one that went out, to the
//! last bit.

use std::io::Write as _;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

pub use super::answer::bits;
use super::answer::{Answer, Stop};
use super::question::Question;
use super::shortest::shortest;
use super::table::{Cells, Column, ColumnKind, Table, Words};
use crate::record::Hash;
use crate::record::hash::{RunningHash, canonical_json};

/// Bytes that cannot be decoded as an answer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("this is not a table that twofold wrote: {0}")]
pub struct Malformed(pub String);

fn malformed<T>(what: impl Into<String>) -> Result<T, Malformed> {
    Err(Malformed(what.into()))
}

/// Reads bytes from the front.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], Malformed> {
        let Some((head, rest)) = self.0.split_at_checked(n) else {
            return malformed("it ends too early");
        };
        self.0 = rest;
        Ok(head)
    }

    /// `n` numbers of `SIZE` bytes each.
    fn numbers<T, const SIZE: usize>(
        &mut self,
        n: usize,
        read: fn([u8; SIZE]) -> T,
    ) -> Result<Vec<T>, Malformed> {
        let (cells, _) = self.take(SIZE * n)?.as_chunks();
        Ok(cells.iter().copied().map(read).collect())
    }

    /// A count of things that take at least `size` bytes each: one that the rest cannot hold is
    /// refused before memory is taken for it.
    fn count(&mut self, size: usize) -> Result<usize, Malformed> {
        let n = self.numbers(1, u64::from_le_bytes)?[0];
        match usize::try_from(n).ok().and_then(|n| n.checked_mul(size)) {
            Some(needed) if needed <= self.0.len() => Ok(needed / size),
            _ => malformed(format!("it speaks of {n} items but holds {} bytes", self.0.len())),
        }
    }

    fn text(&mut self) -> Result<String, Malformed> {
        let n = self.count(1)?;
        String::from_utf8(self.take(n)?.to_vec()).or_else(|_| malformed("a name is not text"))
    }
}

/// The tables of which [`bits`] made these bytes.
///
/// # Errors
///
/// If the bytes have any other form.
pub fn from_bits(bytes: &[u8]) -> Result<Vec<Table>, Malformed> {
    let mut r = Reader(bytes);
    let mut tables = Vec::new();
    for _ in 0..r.count(16)? {
        let mut table = Table { name: r.text()?, columns: Vec::new() };
        for _ in 0..r.count(25)? {
            let (name, unit) = (r.text()?, r.text()?);
            let cells = match r.take(1)? {
                b"n" => {
                    let n = r.count(8)?;
                    Cells::Numbers(r.numbers(n, f64::from_le_bytes)?)
                }
                b"i" => {
                    let n = r.count(8)?;
                    Cells::Integers(r.numbers(n, i64::from_le_bytes)?)
                }
                b"w" => {
                    let n = r.count(4)?;
                    let vocabulary =
                        (0..r.count(8)?).map(|_| r.text()).collect::<Result<Vec<_>, _>>()?;
                    let codes = r.numbers(n, u32::from_le_bytes)?;
                    if codes.iter().any(|c| *c as usize >= vocabulary.len()) {
                        return malformed("a word is not in its vocabulary");
                    }
                    Cells::Words(Words::new(vocabulary, codes))
                }
                _ => return malformed("a column is of no known kind"),
            };
            table.columns.push(Column { name, unit, cells });
        }
        if table.columns.iter().any(|c| c.len() != table.len()) {
            return malformed("columns of different lengths");
        }
        tables.push(table);
    }
    if !r.0.is_empty() {
        return malformed("there is more than it speaks of");
    }
    Ok(tables)
}

/// A file's description of itself: the last line of a CSV file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Heading {
    /// The program and its version.
    pub made_by: String,
    /// The table's name.
    pub table: String,
    /// Further data of the writer: the question, its hash.
    pub about: Value,
    /// The columns.
    pub columns: Vec<ColumnHeading>,
}

/// A file's description of a column.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColumnHeading {
    /// Its name.
    pub name: String,
    /// Its unit, "1" for a pure number.
    pub unit: String,
    /// The kind of its cells.
    pub kind: ColumnKind,
}

/// The description of this table in its file.
pub(super) fn heading(table: &Table, about: &Value) -> Heading {
    Heading {
        made_by: concat!("twofold ", env!("CARGO_PKG_VERSION")).to_owned(),
        table: table.name.clone(),
        about: about.clone(),
        columns: headings(table),
    }
}

fn headings(table: &Table) -> Vec<ColumnHeading> {
    let heading =
        |c: &Column| ColumnHeading { name: c.name.clone(), unit: c.unit.clone(), kind: c.kind() };
    table.columns.iter().map(heading).collect()
}

/// Prefix of the line of metadata: a comment to gnuplot, NumPy, R and pandas (`comment="#"`).
const COMMENT: &str = "# ";

/// CSV: a line of column names, a row per line with shortest round-trip numbers (blanks are empty),
/// and a comment line of metadata as JSON (`about` is whatever its maker wants to say). The names
/// come first because common readers take the first line for them, even a comment
/// (`numpy.genfromtxt(names=True)`). A file that was cut short can say so in one more comment line
/// ([`cut_short`]).
///
/// ```
/// use twofold_job::encode::{csv, from_csv};
/// use twofold_job::table::{Column, Entry, Table};
/// let mut table = Table::new("path", vec![Column::numbers("t")]);
/// table.push([Entry::Number(0.1)]);
/// let bytes = csv(&table, &serde_json::json!({}));
/// let (_, again) = from_csv(&bytes)?;
/// assert_eq!(again, table);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn csv(table: &Table, about: &Value) -> Vec<u8> {
    csv_of_parts(&[table], about)
}

/// [`csv()`] of tables with the same columns, as if they were one: the rows of the first, then
/// those of the second, and so on. Nothing for no table.
pub fn csv_of_parts(tables: &[&Table], about: &Value) -> Vec<u8> {
    let Some(first) = tables.first() else { return Vec::new() };
    let mut bytes = csv_head(first);
    for table in tables {
        bytes = csv_rows_after(bytes, table);
    }
    bytes.extend(csv_tail(first, about));
    bytes
}

/// The first line of [`csv()`]: column names.
fn csv_head(table: &Table) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer
        .write_record(table.columns.iter().map(|c| &c.name))
        .expect("memory takes what is written to it");
    writer.into_inner().expect("memory takes what is written to it")
}

/// The last line of [`csv()`]: metadata.
fn csv_tail(table: &Table, about: &Value) -> Vec<u8> {
    comment(&heading(table, about))
}

fn comment(heading: &Heading) -> Vec<u8> {
    let mut bytes = COMMENT.as_bytes().to_vec();
    bytes.extend(canonical_json(heading));
    bytes.push(b'\n');
    bytes
}

fn csv_rows_after(mut bytes: Vec<u8>, table: &Table) -> Vec<u8> {
    // A number takes some nineteen bytes.
    bytes.reserve(20 * table.len() * table.columns.len());
    let vocabularies: Vec<Vec<Vec<u8>>> = table.columns.iter().map(|c| quoted(&c.cells)).collect();
    for row in 0..table.len() {
        let start = bytes.len();
        for (i, column) in table.columns.iter().enumerate() {
            if i > 0 {
                bytes.push(b',');
            }
            match &column.cells {
                Cells::Words(words) => {
                    bytes.extend_from_slice(&vocabularies[i][words.codes[row] as usize])
                }
                Cells::Numbers(values) => shortest(&mut bytes, values[row]),
                Cells::Integers(values) => {
                    write!(bytes, "{}", values[row]).expect("memory takes what is written to it")
                }
            }
        }
        if bytes.len() == start {
            // An empty line would be no row.
            bytes.extend_from_slice(b"\"\"");
        }
        bytes.push(b'\n');
    }
    bytes
}

/// The words that occur, quoted where CSV asks for it.
fn quoted(cells: &Cells) -> Vec<Vec<u8>> {
    let Cells::Words(words) = cells else { return Vec::new() };
    let quote = |word: &String| {
        let mut writer = csv::Writer::from_writer(Vec::new());
        // The second field keeps an empty first one from being quoted for its loneliness.
        writer.write_record([word, "."]).expect("memory takes what is written to it");
        let mut line = writer.into_inner().expect("memory takes what is written to it");
        line.truncate(line.len() - b",.\n".len());
        line
    };
    words.vocabulary.iter().map(quote).collect()
}

/// The description of a question in the file of its answer, such as a run that has not ended.
pub fn about_run(question: &dyn Question) -> Value {
    json!({ "kind": question.kind(), "question": question.json() })
}

/// The CSV file of a run, part by part. Its last line holds a digest of the rows and of what it
/// says of the run.
pub struct CsvOfRun {
    about: Value,
    digest: RunningHash,
    /// Of the table that has begun.
    heading: Option<Heading>,
}

impl CsvOfRun {
    /// Nothing of the file that is to say this about itself.
    pub fn new(about: Value) -> Self {
        let mut digest = RunningHash::default();
        digest.update(&canonical_json(&about));
        Self { about, digest, heading: None }
    }

    /// The next lines: column names before the first rows, and one for each row.
    pub fn rows(&mut self, table: &Table) -> Vec<u8> {
        let mut bytes = Vec::new();
        if self.heading.is_none() {
            bytes = csv_head(table);
            self.heading = Some(heading(table, &Value::Null));
        }
        let bytes = csv_rows_after(bytes, table);
        self.digest.update(&bytes);
        bytes
    }

    /// The last line: metadata. Nothing if there were no rows and no column names.
    pub fn tail(mut self) -> Vec<u8> {
        let Some(heading) = self.heading else { return Vec::new() };
        self.about[DIGEST] = json!(self.digest.finish());
        comment(&Heading { about: self.about, ..heading })
    }
}

const DIGEST: &str = "digest";

/// The table and the description in the CSV file of a run, which nothing has changed.
///
/// # Errors
/// If the file is anything else, or was changed.
pub fn run_from_csv(bytes: &[u8]) -> Result<(Value, Table), Malformed> {
    let (Heading { mut about, .. }, table) = from_csv(bytes)?;
    let said = about.as_object_mut().and_then(|about| about.remove(DIGEST));
    // The metadata's line, and one that says that the file was cut short, begin with a sign that no
    // row begins with.
    let rows: Vec<&[u8]> = bytes
        .split_inclusive(|b| *b == b'\n')
        .take_while(|line| !line.starts_with(COMMENT.as_bytes()))
        .collect();
    let question = canonical_json(&about);
    unchanged(said, &Hash::of_parts([&question[..]].into_iter().chain(rows)))?;
    Ok((about, table))
}

fn unchanged(said: Option<Value>, digest: &Hash) -> Result<(), Malformed> {
    match said {
        None => malformed("it has no digest of its rows, as files of version 0.2.0 have none"),
        Some(said) if said == json!(digest) => Ok(()),
        Some(_) => malformed("its digest is not that of its rows, which were changed"),
    }
}

/// The CSV file of a run: its first table.
pub fn csv_of_run(run: &dyn Question, answer: &Answer) -> Vec<u8> {
    let mut file = CsvOfRun::new(about_run(run));
    let table = &answer.tables[0];
    let mut bytes = file.rows(table);
    bytes.extend(file.tail());
    if answer.stop == Stop::Interrupted {
        bytes.extend(cut_short(answer.stop));
    }
    bytes
}

/// The last line of a CSV file whose computation did not come to its end.
pub fn cut_short(stop: Stop) -> Vec<u8> {
    format!("{COMMENT}{STOP}{}\n", stop.word()).into_bytes()
}

const STOP: &str = "stop: ";

/// Why the computation of which this is the CSV file ended before its time; none if it did not.
pub fn stop_of_csv(bytes: &[u8]) -> Option<Stop> {
    let text = bytes.strip_suffix(b"\n").unwrap_or(bytes);
    let last = text.rsplit(|b| *b == b'\n').next()?;
    let word = last.strip_prefix(COMMENT.as_bytes())?.strip_prefix(STOP.as_bytes())?;
    serde_json::from_value(Value::String(String::from_utf8_lossy(word).into_owned())).ok()
}

/// The table of which [`csv()`] made this file, and what it says about itself. Files of version
/// 0.2, which began with their metadata, are read, too.
///
/// # Errors
///
/// If the file is anything else.
pub fn from_csv(bytes: &[u8]) -> Result<(Heading, Table), Malformed> {
    let mut body = bytes;
    if let Some(stop) = stop_of_csv(bytes) {
        body = &body[..body.len().saturating_sub(cut_short(stop).len())];
    }
    let lines = body.strip_suffix(b"\n").unwrap_or(body);
    let comment = |line: &'_ [u8]| line.starts_with(COMMENT.as_bytes());
    let first = lines.iter().position(|b| *b == b'\n').unwrap_or(lines.len());
    let last = lines.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
    let text;
    (text, body) = if comment(&lines[..first]) {
        (&lines[COMMENT.len()..first], &body[(first + 1).min(body.len())..])
    } else if comment(&lines[last..]) {
        (&lines[last + COMMENT.len()..], &body[..last])
    } else {
        return malformed("its last line is not a comment with metadata");
    };
    let heading: Heading =
        serde_json::from_slice(text).map_err(|e| Malformed(format!("its metadata: {e}")))?;
    let mut table = Table::new(
        &heading.table,
        heading.columns.iter().map(|c| Column::new(&c.name, &c.unit, c.kind)),
    );
    let mut reader = csv::Reader::from_reader(body);
    let names = reader.headers().map_err(|e| Malformed(e.to_string()))?;
    if !names.iter().eq(table.columns.iter().map(|c| c.name.as_str())) {
        return malformed("its column names are not those of its metadata");
    }
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(|e| Malformed(e.to_string()))?;
        for (column, field) in table.columns.iter_mut().zip(&record) {
            let fits = match &mut column.cells {
                Cells::Words(words) => {
                    words.push(field);
                    true
                }
                Cells::Numbers(values) => {
                    let value = if field.is_empty() { Some(f64::NAN) } else { field.parse().ok() };
                    value.map(|v| values.push(v)).is_some()
                }
                Cells::Integers(values) => field.parse().ok().map(|v| values.push(v)).is_some(),
            };
            if !fits {
                return malformed(format!(
                    "row {}, column {}: \"{field}\" is not a number",
                    row + 1,
                    column.name
                ));
            }
        }
    }
    Ok((heading, table))
}

/// JSON: what `about` says, the facts, statistics and stop reason, and every table with its columns
/// and rows.
pub fn json(answer: &Answer, about: &Value) -> Vec<u8> {
    let cell = |cells: &Cells, row: usize| match cells {
        Cells::Numbers(v) if v[row].is_nan() => Value::Null,
        Cells::Numbers(v) if v[row].is_infinite() => {
            json!(if v[row] > 0.0 { "inf" } else { "-inf" })
        }
        Cells::Numbers(v) => json!(v[row]),
        Cells::Integers(v) => json!(v[row]),
        Cells::Words(w) => json!(w.get(row)),
    };
    let table = |t: &Table| {
        let row = |row| Value::Array(t.columns.iter().map(|c| cell(&c.cells, row)).collect());
        json!({ "name": t.name, "columns": headings(t),
            "rows": (0..t.len()).map(row).collect::<Vec<_>>() })
    };
    let mut value = json!({
        "made_by": concat!("twofold ", env!("CARGO_PKG_VERSION")),
        "about": about,
        "stop": answer.stop,
        "facts": answer.facts,
        "statistics": answer.statistics,
        "tables": answer.tables.iter().map(table).collect::<Vec<_>>(),
    });
    value[DIGEST] = json!(Hash::of_json(&value));
    let mut bytes = canonical_json(&value);
    bytes.push(b'\n');
    bytes
}

/// The answer of which [`json()`] made this file, and what it says about itself.
///
/// # Errors
///
/// If the file is anything else, or was changed.
pub fn from_json(bytes: &[u8]) -> Result<(Value, Answer), Malformed> {
    #[derive(Deserialize)]
    struct Written {
        about: Value,
        stop: Stop,
        facts: serde_json::Map<String, Value>,
        statistics: Option<twofold_integrate::Statistics>,
        tables: Vec<FileTable>,
    }
    #[derive(Deserialize)]
    struct FileTable {
        name: String,
        columns: Vec<ColumnHeading>,
        rows: Vec<Vec<Value>>,
    }
    let float = |value: &Value| match value {
        Value::Null => Some(f64::NAN),
        Value::String(s) if s == "inf" => Some(f64::INFINITY),
        Value::String(s) if s == "-inf" => Some(f64::NEG_INFINITY),
        value => value.as_f64(),
    };
    let read = |e: serde_json::Error| Malformed(e.to_string());
    let mut value: Value = serde_json::from_slice(bytes).map_err(read)?;
    let said = value.as_object_mut().and_then(|file| file.remove(DIGEST));
    unchanged(said, &Hash::of_json(&value))?;
    let file: Written = serde_json::from_value(value).map_err(read)?;
    let mut tables = Vec::new();
    for t in file.tables {
        let mut table =
            Table::new(&t.name, t.columns.iter().map(|c| Column::new(&c.name, &c.unit, c.kind)));
        for (number, row) in t.rows.iter().enumerate() {
            if row.len() != table.columns.len() {
                return malformed(format!(
                    "table {}, row {}: {} cells",
                    t.name,
                    number + 1,
                    row.len()
                ));
            }
            for (column, value) in table.columns.iter_mut().zip(row) {
                let fits = match (&mut column.cells, value) {
                    (Cells::Numbers(v), value) => float(value).map(|x| v.push(x)),
                    (Cells::Integers(v), value) => value.as_i64().map(|n| v.push(n)),
                    (Cells::Words(w), value) => value.as_str().map(|word| w.push(word)),
                };
                if fits.is_none() {
                    let what = format!(
                        "table {}, row {}, column {}: {value}",
                        t.name,
                        number + 1,
                        column.name
                    );
                    return malformed(what);
                }
            }
        }
        tables.push(table);
    }
    Ok((
        file.about,
        Answer { tables, facts: file.facts, statistics: file.statistics, stop: file.stop },
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn table(numbers: Vec<f64>, words: Vec<String>) -> Table {
        let mut table = Table::new(
            "a table",
            [
                Column::new("x", "m", ColumnKind::Number),
                Column::words("word"),
                Column::integers("n"),
            ],
        );
        for (i, (x, word)) in numbers.into_iter().zip(&words).enumerate() {
            table.push([x.into(), word.as_str().into(), (i as i64 - 3).into()]);
        }
        table
    }

    fn any_table() -> impl Strategy<Value = Table> {
        (0_usize..20).prop_flat_map(|n| {
            let sign = prop::sample::select("abc,\"\n#é ".chars().collect::<Vec<_>>());
            let word = prop::collection::vec(sign, 0..=3).prop_map(String::from_iter);
            (prop::collection::vec(any::<f64>(), n), prop::collection::vec(word, n))
                .prop_map(|(numbers, words)| table(numbers, words))
        })
    }

    proptest! {
        #[test]
        fn bits_come_back(a in any_table(), b in any_table()) {
            let bytes = bits(&[a, b]);
            let back = from_bits(&bytes).unwrap();
            prop_assert_eq!(bits(&back), bytes);
        }

        #[test]
        fn csv_comes_back(t in any_table()) {
            let about = json!({"question": "?"});
            let (heading, back) = from_csv(&csv(&t, &about)).unwrap();
            prop_assert_eq!(heading.about, about);
            prop_assert_eq!(bits(&[back]), bits(&[t]));
        }

        /// The crate `csv`, a field at a time.
        #[test]
        fn csv_is_csv(t in any_table(), column in 0_usize..4) {
            let mut t = t;
            // A row of one empty field is a case of its own.
            if column < 3 {
                t.columns = vec![t.columns.swap_remove(column)];
            }
            let mut writer = csv::Writer::from_writer(Vec::new());
            for row in 0..t.len() {
                for column in &t.columns {
                    let field = match &column.cells {
                        Cells::Words(words) => words.get(row).to_owned(),
                        Cells::Numbers(values) if values[row].is_nan() => String::new(),
                        Cells::Numbers(values) => format!("{:?}", values[row]),
                        Cells::Integers(values) => values[row].to_string(),
                    };
                    writer.write_field(field).unwrap();
                }
                writer.write_record(None::<&[u8]>).unwrap();
            }
            prop_assert_eq!(csv_rows_after(Vec::new(), &t), writer.into_inner().unwrap());
        }

        #[test]
        fn json_comes_back(a in any_table(), b in any_table()) {
            let answer = Answer::of_tables(vec![a, b]).with_fact("t", &0.1);
            let about = json!({"question": "?"});
            let (said, back) = from_json(&json(&answer, &about)).unwrap();
            prop_assert_eq!(said, about);
            prop_assert_eq!(back.hash(), answer.hash());
        }

        #[test]
        fn damaged_bits_are_refused_or_are_other_tables(t in any_table(),
            at in any::<prop::sample::Index>(), flip in 1_u8..) {
            let mut bytes = bits(std::slice::from_ref(&t));
            let at = at.index(bytes.len());
            bytes[at] ^= flip;
            // Whatever comes back must be a table that its own bits describe: nothing is read past,
            // nothing panics.
            if let Ok(tables) = from_bits(&bytes) {
                prop_assert!(from_bits(&bits(&tables)).is_ok());
            }
            prop_assert!(from_bits(&bytes[..at]).is_err());
        }
    }

    #[test]
    fn every_bit_of_a_table_counts() {
        let t = table(vec![0.0, f64::NAN, 1.0], vec!["up".into(), String::new(), "up".into()]);
        let base = bits(std::slice::from_ref(&t));
        let changes: [fn(&mut Table); 5] = [
            |t| t.name.push('x'),
            |t| t.columns[0].name.push('x'),
            |t| t.columns[0].unit.push('x'),
            |t| t.columns[0].cells = Cells::Numbers(vec![-0.0, f64::NAN, 1.0]),
            |t| t.columns[2].cells = Cells::Integers(vec![0, 1, 2]),
        ];
        for change in changes {
            let mut other = t.clone();
            change(&mut other);
            assert_ne!(bits(&[other]), base);
        }
        // All not-a-numbers are one blank.
        let mut other = t.clone();
        other.columns[0].cells =
            Cells::Numbers(vec![0.0, f64::from_bits(f64::NAN.to_bits() | 1), 1.0]);
        assert_eq!(bits(&[other]), base);
    }

    /// Beyond all numbers and below them, and the blank, in every form.
    #[test]
    fn infinities_come_back() {
        let t =
            table(vec![f64::INFINITY, f64::NEG_INFINITY, f64::NAN, -0.0], vec!["inf".into(); 4]);
        let answer = Answer { stop: Stop::StepBudget, ..Answer::of_tables(vec![t.clone()]) };
        let file = json(&answer, &Value::Null);
        let (_, back) = from_json(&file).unwrap();
        assert_eq!((back.hash(), back.stop), (answer.hash(), Stop::StepBudget));
        assert_eq!(
            back.table("a table").unwrap().numbers("x")[..2],
            [f64::INFINITY, f64::NEG_INFINITY]
        );
        assert_eq!(
            bits(&[from_csv(&csv(&t, &Value::Null)).unwrap().1]),
            bits(std::slice::from_ref(&t))
        );
        // A number is a number, inf or -inf; nothing else is one, and inf is no whole number.
        let text = String::from_utf8(file).unwrap();
        for (from, to) in [
            ("[\"-inf\",", "[\"-infinity\","),
            ("[\"-inf\",", "["),
            ("[null,", "[[],"),
            (",-1]", ",null]"),
            (",-1]", ",\"inf\"]"),
            (",-1]", ",-1,0]"),
            ("\"inf\",-1]", "0,-1]"),
        ] {
            assert!(text.contains(from), "{from}: {text}");
            let changed = text.replace(from, to);
            let said = from_json(changed.as_bytes()).unwrap_err().to_string();
            assert!(said.contains("its digest is not that of its rows"), "{from} {to}: {said}");
            let mut value: Value = serde_json::from_str(&changed).unwrap();
            value.as_object_mut().unwrap().remove(DIGEST);
            value[DIGEST] = json!(Hash::of_json(&value));
            let said = from_json(&canonical_json(&value)).unwrap_err().to_string();
            assert!(said.contains("table a table, row"), "{from} {to}: {said}");
        }
    }

    /// Columns of different lengths, a missing word, an unknown kind, bytes after the end.
    #[test]
    fn bits_that_are_no_table_are_refused() {
        let t = table(vec![1.0, 2.0], vec!["up".into(), "down".into()]);
        let whole = bits(std::slice::from_ref(&t));
        let at = |what: &[u8]| whole.windows(what.len()).rposition(|w| w == what).unwrap();
        let changed = |at: usize, to: u8| {
            let mut bytes = whole.clone();
            bytes[at] = to;
            bytes
        };
        let mut short = t.clone();
        short.columns[2].cells = Cells::Integers(vec![7]);
        let codes = at(b"down") + 4;
        assert_eq!(whole[codes..codes + 8], [0, 0, 0, 0, 1, 0, 0, 0]);
        for (bytes, word) in [
            (bits(&[short]), "different lengths"),
            (changed(codes + 4, 2), "not in its vocabulary"),
            (changed(at(b"1i") + 1, b'j'), "no known kind"),
            ([&whole[..], &[0]].concat(), "more than it speaks of"),
            (whole[..whole.len() - 1].to_vec(), "holds"),
        ] {
            let said = from_bits(&bytes).unwrap_err().to_string();
            assert!(said.contains(word), "{word}: {said}");
        }
    }

    #[test]
    fn csv_as_it_looks() {
        let t = table(vec![0.1, f64::NAN, 1e300], vec!["up".into(), String::new(), "a,b".into()]);
        let text = String::from_utf8(csv(&t, &Value::Null)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        let last = lines[lines.len() - 1];
        assert!(last.starts_with("# {") && last.contains("\"made_by\":\"twofold "), "{last}");
        assert_eq!(lines[..lines.len() - 1], ["x,word,n", "0.1,up,-3", ",,-2", "1e300,\"a,b\",-1"]);
    }

    #[test]
    fn a_file_that_was_cut_short_says_so() {
        let t = table(vec![0.1, 0.2], vec!["up".into(), "up".into()]);
        let mut bytes = csv(&t, &Value::Null);
        assert_eq!(stop_of_csv(&bytes), None);
        bytes.extend(cut_short(crate::Stop::Interrupted));
        assert_eq!(stop_of_csv(&bytes), Some(crate::Stop::Interrupted));
        assert_eq!(from_csv(&bytes).unwrap().1, t);
    }

    /// Its first table, its question, and why it ended if that was too soon.
    #[test]
    fn the_file_of_a_run_says_which_run_it_is() {
        use crate::spec::{Observation, SwitchSpec};
        use crate::{Run, cases};
        let observe = Observation::Times { every: 0.5 };
        let run = Run(cases::run(cases::decays(2), SwitchSpec::tanh(1e-2), 1.0, observe));
        let tables = [vec![0.1, 0.2], vec![7.0, 8.0]]
            .map(|numbers| table(numbers, vec!["up".into(), "down".into()]));
        for (stop, said) in [(Stop::Finished, None), (Stop::Interrupted, Some(Stop::Interrupted))] {
            let bytes = csv_of_run(&run, &Answer { stop, ..Answer::of_tables(tables.to_vec()) });
            let (about, back) = run_from_csv(&bytes).unwrap();
            assert_eq!((&back, stop_of_csv(&bytes)), (&tables[0], said));
            assert_eq!(about, json!({ "kind": "run", "question": run.json() }));
            let text = String::from_utf8(bytes).unwrap();
            for (from, to) in [("0.1,", "0.15,"), ("up", "on"), ("\"t_end\":1.0", "\"t_end\":2.0")]
            {
                let changed = text.replacen(from, to, 1);
                assert_ne!(changed, text);
                assert!(from_csv(changed.as_bytes()).is_ok());
                let error = run_from_csv(changed.as_bytes()).unwrap_err();
                assert!(error.to_string().contains("which were changed"), "{error}");
            }
        }
    }

    #[test]
    fn other_files_are_refused() {
        assert!(from_csv(b"a,b\n1,2\n").is_err());
        assert!(from_csv(b"").is_err() && from_csv(b"# ").is_err() && from_csv(b"# \n").is_err());
        assert!(from_bits(b"").is_err());
        assert!(from_bits(&[255; 64]).is_err());
        let t = table(vec![0.1], vec!["up".into()]);
        let text = String::from_utf8(csv(&t, &Value::Null)).unwrap().replace("0.1", "zero");
        assert!(
            from_csv(text.as_bytes()).unwrap_err().to_string().contains("row 1, column x"),
            "{text}"
        );
    }
}
