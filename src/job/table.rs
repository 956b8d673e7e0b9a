//! Named tables of numbers and words.

/// A named table of numbers; the name becomes part of the CSV's file name.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// A short name for a file: "errors".
    pub name: String,
    /// Column names.
    pub columns: Vec<String>,
    /// Rows of cells.
    pub rows: Vec<Vec<Entry>>,
}

/// A cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A number.
    Number(f64),
    /// A word.
    Word(String),
}

impl From<f64> for Entry {
    fn from(value: f64) -> Self {
        Entry::Number(value)
    }
}

impl From<&str> for Entry {
    fn from(value: &str) -> Self {
        Entry::Word(value.to_owned())
    }
}

impl Table {
    /// An empty table.
    pub fn new(name: &str, columns: &[&str]) -> Self {
        Self { name: name.into(), columns: columns.iter().map(|c| (*c).to_owned()).collect(), rows: Vec::new() }
    }

    /// The bytes that are hashed: numbers as little-endian bits, words as text, both closed by a separator.
    pub fn bits(&self) -> Vec<u8> {
        let mut bytes = self.csv_header().into_bytes();
        for entry in self.rows.iter().flatten() {
            match entry {
                Entry::Number(v) => bytes.extend_from_slice(&v.to_bits().to_le_bytes()),
                Entry::Word(w) => bytes.extend_from_slice(w.as_bytes()),
            }
            bytes.push(0x1f);
        }
        bytes
    }

    /// CSV with a header line and shortest round-trip numbers.
    pub fn csv(&self) -> Vec<u8> {
        let mut text = self.csv_header();
        for row in &self.rows {
            let cells: Vec<String> = row
                .iter()
                .map(|entry| match entry {
                    Entry::Number(v) => format!("{v:?}"),
                    Entry::Word(w) => w.clone(),
                })
                .collect();
            text += &cells.join(",");
            text.push('\n');
        }
        text.into_bytes()
    }

    fn csv_header(&self) -> String {
        self.columns.join(",") + "\n"
    }
}
