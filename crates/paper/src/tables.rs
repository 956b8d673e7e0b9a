//! Tables of answers and their columns, by name.

use twofold_job::table::Cells;
use twofold_job::{Answer, Table};

/// The table of this name, or the first one.
///
/// # Errors
/// If the answer has none: its name, and those that there are.
pub fn table<'a>(answer: &'a Answer, name: Option<&str>) -> Result<&'a Table, String> {
    let Some(name) = name else {
        return answer.tables.first().ok_or_else(|| "the answer has no table".into());
    };
    answer.table(name).ok_or_else(|| {
        let known: Vec<&str> = answer.tables.iter().map(|t| t.name.as_str()).collect();
        format!("the answer has no table \"{name}\"; it has {}", listed(&known))
    })
}

/// A column of numbers.
///
/// # Errors
/// If the table has no such column: its name, and those that there are.
pub fn column<'a>(table: &'a Table, name: &str) -> Result<std::borrow::Cow<'a, [f64]>, String> {
    let numbers = table.numbers(name);
    if !numbers.is_empty() || table.is_empty() && table.columns.iter().any(|c| c.name == name) {
        return Ok(numbers.into());
    }
    let integers = table.integers(name);
    if !integers.is_empty() {
        // Counts: far below 2^53.
        return Ok(integers.iter().map(|i| *i as f64).collect::<Vec<_>>().into());
    }
    let is_number = |c: &&twofold_job::Column| !matches!(c.cells, Cells::Words(_));
    let known: Vec<&str> =
        table.columns.iter().filter(is_number).map(|c| c.name.as_str()).collect();
    Err(format!(
        "table \"{}\" has no column of numbers \"{name}\"; it has {}",
        table.name,
        listed(&known)
    ))
}

/// A column of words.
///
/// # Errors
/// If the table has no such column: its name, and those that there are.
pub fn words<'a>(table: &'a Table, name: &str) -> Result<Vec<&'a str>, String> {
    let are_words = |c: &&twofold_job::Column| matches!(c.cells, Cells::Words(_));
    let known = table.columns.iter().filter(are_words).map(|c| c.name.as_str());
    if known.clone().any(|column| column == name) {
        return Ok(table.words(name).collect());
    }
    let known: Vec<&str> = known.collect();
    Err(format!(
        "table \"{}\" has no column of words \"{name}\"; it has {}",
        table.name,
        listed(&known)
    ))
}

fn listed(names: &[&str]) -> String {
    if names.is_empty() { "none".into() } else { names.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_job::{Column, Entry};

    #[test]
    fn a_column_that_is_not_there_is_named_with_those_that_are() {
        let mut table = Table::new("branch", vec![Column::numbers("period")]);
        table.push(vec![Entry::Number(1.0)]);
        assert_eq!(&*column(&table, "period").unwrap(), [1.0]);
        let said = column(&table, "perod").unwrap_err();
        assert!(
            said.contains("branch") && said.contains("\"perod\"") && said.contains("it has period"),
            "{said}"
        );
    }
}
