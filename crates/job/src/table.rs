//! Tables: named columns with units, the form of all numerical results.
//!
//! A [`Table`] is stored by column, because that is how it is hashed and drawn; it is built row by
//! row, because that is how computations yield.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

/// A named table; the name becomes part of file names.
///
/// ```
/// use twofold_job::table::{Column, Entry, Table};
/// let mut table = Table::new("path", vec![Column::numbers("t"), Column::words("mode")]);
/// table.push([Entry::Number(0.5), Entry::Word("plus".to_owned())]);
/// assert_eq!(table.numbers("t"), [0.5]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// A short name for a file: "section".
    pub name: String,
    /// The columns, all of one length.
    pub columns: Vec<Column>,
}

/// A named column.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Its name: "t".
    pub name: String,
    /// Its unit, "1" for a pure number.
    pub unit: String,
    /// Its cells.
    pub cells: Cells,
}

/// The cells of a column, all of one kind.
#[derive(Clone, Debug, PartialEq)]
pub enum Cells {
    /// Numbers; not-a-number is a blank.
    Numbers(Vec<f64>),
    /// Whole numbers.
    Integers(Vec<i64>),
    /// Words; the empty word is a blank.
    Words(Words),
}

/// Words, each kept once.
#[derive(Clone, Debug, Default)]
pub struct Words {
    /// The different words, in order of first appearance.
    pub vocabulary: Vec<String>,
    /// Index into the vocabulary, row by row.
    pub codes: Vec<u32>,
    /// Index of a word in the vocabulary; empty as long as a linear search is fast.
    places: HashMap<String, usize>,
}

impl PartialEq for Words {
    fn eq(&self, other: &Self) -> bool {
        (&self.vocabulary, &self.codes) == (&other.vocabulary, &other.codes)
    }
}

/// Vocabulary length above which words are found through a map: a foreign file may have a million.
const SHORT: usize = 32;

impl Words {
    /// The words with these codes in a vocabulary.
    pub fn new(vocabulary: Vec<String>, codes: Vec<u32>) -> Self {
        Self { vocabulary, codes, places: HashMap::new() }
    }

    /// Appends a word.
    pub fn push(&mut self, word: &str) {
        // The last word is by far the likeliest; vocabularies are short.
        let known = match self.codes.last() {
            Some(last) if self.vocabulary[*last as usize] == word => Some(*last as usize),
            _ if self.vocabulary.len() <= SHORT => self.vocabulary.iter().position(|w| w == word),
            _ => {
                if self.places.is_empty() {
                    self.places =
                        self.vocabulary.iter().enumerate().map(|(i, w)| (w.clone(), i)).collect();
                }
                self.places.get(word).copied()
            }
        };
        let code = known.unwrap_or_else(|| {
            let code = self.vocabulary.len();
            if !self.places.is_empty() {
                self.places.insert(word.to_owned(), code);
            }
            self.vocabulary.push(word.to_owned());
            code
        });
        self.codes.push(code as u32);
    }

    /// The word of a row.
    pub fn get(&self, row: usize) -> &str {
        &self.vocabulary[self.codes[row] as usize]
    }
}

/// The kind of a column's cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ColumnKind {
    /// [`Cells::Numbers`].
    Number,
    /// [`Cells::Integers`].
    Integer,
    /// [`Cells::Words`].
    Word,
}

/// A cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A number.
    Number(f64),
    /// A whole number.
    Integer(i64),
    /// A word.
    Word(String),
}

impl From<f64> for Entry {
    fn from(value: f64) -> Self {
        Entry::Number(value)
    }
}

impl From<i64> for Entry {
    fn from(value: i64) -> Self {
        Entry::Integer(value)
    }
}

impl From<&str> for Entry {
    fn from(value: &str) -> Self {
        Entry::Word(value.to_owned())
    }
}

impl Entry {
    /// The number, or not-a-number for a word.
    pub fn value(&self) -> f64 {
        match self {
            Entry::Number(v) => *v,
            Entry::Integer(v) => *v as f64,
            Entry::Word(_) => f64::NAN,
        }
    }

    /// The word, or nothing for a number.
    pub fn word(&self) -> &str {
        match self {
            Entry::Word(w) => w,
            _ => "",
        }
    }
}

impl Column {
    /// An empty column.
    pub fn new(name: &str, unit: &str, kind: ColumnKind) -> Self {
        let cells = match kind {
            ColumnKind::Number => Cells::Numbers(Vec::new()),
            ColumnKind::Integer => Cells::Integers(Vec::new()),
            ColumnKind::Word => Cells::Words(Words::default()),
        };
        Self { name: name.to_owned(), unit: unit.to_owned(), cells }
    }

    /// An empty column of pure numbers.
    pub fn numbers(name: &str) -> Self {
        Self::new(name, "1", ColumnKind::Number)
    }

    /// An empty column of whole numbers.
    pub fn integers(name: &str) -> Self {
        Self::new(name, "1", ColumnKind::Integer)
    }

    /// An empty column of words.
    pub fn words(name: &str) -> Self {
        Self::new(name, "", ColumnKind::Word)
    }

    /// The kind of its cells.
    pub fn kind(&self) -> ColumnKind {
        match self.cells {
            Cells::Numbers(_) => ColumnKind::Number,
            Cells::Integers(_) => ColumnKind::Integer,
            Cells::Words(_) => ColumnKind::Word,
        }
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        match &self.cells {
            Cells::Numbers(v) => v.len(),
            Cells::Integers(v) => v.len(),
            Cells::Words(w) => w.codes.len(),
        }
    }

    /// Whether there is no cell.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The cell of a row.
    pub fn get(&self, row: usize) -> Entry {
        match &self.cells {
            Cells::Numbers(v) => Entry::Number(v[row]),
            Cells::Integers(v) => Entry::Integer(v[row]),
            Cells::Words(w) => Entry::Word(w.get(row).to_owned()),
        }
    }
}

impl Table {
    /// An empty table.
    pub fn new(name: &str, columns: impl IntoIterator<Item = Column>) -> Self {
        Self { name: name.to_owned(), columns: columns.into_iter().collect() }
    }

    /// Appends a row.
    ///
    /// # Panics
    ///
    /// If the row is not of the columns' number and kinds: the program that fills the table is
    /// wrong.
    pub fn push(&mut self, row: impl IntoIterator<Item = Entry>) {
        let mut cells = row.into_iter();
        for column in &mut self.columns {
            match (&mut column.cells, cells.next()) {
                (Cells::Numbers(v), Some(Entry::Number(x))) => v.push(x),
                (Cells::Integers(v), Some(Entry::Integer(x))) => v.push(x),
                (Cells::Words(w), Some(Entry::Word(x))) => w.push(&x),
                (_, other) => {
                    panic!("table {}, column {}: {other:?} does not fit", self.name, column.name)
                }
            }
        }
        assert!(cells.next().is_none(), "table {}: a row with too many cells", self.name);
    }

    /// Appends rows: see [`Table::push`].
    pub fn extend(&mut self, rows: impl IntoIterator<Item = Vec<Entry>>) {
        rows.into_iter().for_each(|row| self.push(row));
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.columns.first().map_or(0, Column::len)
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The column of that name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|c| c.name == name)
    }

    /// The numbers of a column; none if there is no such column of numbers.
    pub fn numbers(&self, name: &str) -> &[f64] {
        match self.column(name).map(|c| &c.cells) {
            Some(Cells::Numbers(v)) => v,
            _ => &[],
        }
    }

    /// The whole numbers of a column; none if there is no such column.
    pub fn integers(&self, name: &str) -> &[i64] {
        match self.column(name).map(|c| &c.cells) {
            Some(Cells::Integers(v)) => v,
            _ => &[],
        }
    }

    /// The words of a column, row by row; none if there is no such column.
    pub fn words(&self, name: &str) -> impl Iterator<Item = &str> {
        let words = match self.column(name).map(|c| &c.cells) {
            Some(Cells::Words(w)) => Some(w),
            _ => None,
        };
        words.into_iter().flat_map(|w| (0..w.codes.len()).map(|row| w.get(row)))
    }

    /// The rows, as cells.
    pub fn rows(&self) -> Vec<Vec<Entry>> {
        (0..self.len()).map(|row| self.columns.iter().map(|c| c.get(row)).collect()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_columns() {
        let mut table =
            Table::new("t", [Column::numbers("x"), Column::words("mode"), Column::integers("n")]);
        for (x, mode, n) in [(0.5, "up", 1), (1.5, "down", 2), (2.5, "up", 3)] {
            table.push([x.into(), mode.into(), Entry::Integer(n)]);
        }
        assert_eq!(table.len(), 3);
        assert!(!table.is_empty() && table.columns.iter().all(|c| !c.is_empty() && c.len() == 3));
        let none = Table::new("t", [Column::numbers("x")]);
        assert!(none.is_empty() && none.columns[0].is_empty() && Table::new("t", []).is_empty());
        assert_eq!(table.numbers("x"), [0.5, 1.5, 2.5]);
        assert_eq!(table.integers("n"), [1, 2, 3]);
        assert_eq!(table.words("mode").collect::<Vec<_>>(), ["up", "down", "up"]);
        assert_eq!(table.rows()[1], [1.5.into(), "down".into(), Entry::Integer(2)]);
        assert!(table.numbers("mode").is_empty() && table.column("y").is_none());
        let Cells::Words(words) = &table.columns[1].cells else { panic!() };
        assert_eq!(words.vocabulary, ["up", "down"]);
        // Words are the same if they are in the same rows, and first appear in the same order.
        let same = |codes: [u32; 3], a: &str| {
            Words::new(vec![a.into(), "down".into()], codes.to_vec()) == *words
        };
        assert!(same([0, 1, 0], "up") && !same([0, 1, 1], "up") && !same([0, 1, 0], "left"));
    }

    #[test]
    fn a_long_vocabulary_keeps_each_word_once() {
        let mut words = Words::default();
        let word = |row: usize| format!("word {}", row * row % 1009);
        for row in 0..5000 {
            words.push(&word(row));
        }
        assert!((0..5000).all(|row| words.get(row) == word(row)));
        // As many as there are squares modulo the prime 1009.
        assert_eq!(words.vocabulary.len(), 505);
        // Words that came with the vocabulary are found too.
        let mut again = Words::new(words.vocabulary.clone(), words.codes.clone());
        again.push("word 4");
        words.push("word 4");
        assert_eq!(again, words);
    }

    #[test]
    #[should_panic(expected = "does not fit")]
    fn a_row_of_another_shape_is_refused() {
        Table::new("t", [Column::numbers("x")]).push(["word".into()]);
    }
}
