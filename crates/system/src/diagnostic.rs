//! Errors that point into a text: line, column, caret, and what to do.

use std::fmt;
use std::ops::Range;

/// An error in a text: its message, its place, and advice.
///
/// ```text
/// unknown name `alhpa`
///   --> my.toml:9:14
///   |
/// 9 | plus = ["1 + alhpa*x", "y"]
///   |              ^^^^^
///   = help: did you mean `alpha`?
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// The message.
    pub message: String,
    /// A file's name, or words such as `component y of f+`.
    pub origin: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// Advice.
    pub help: Option<String>,
    /// The line in which the error is, shortened if it is long.
    excerpt: String,
    /// Characters before the mark in the excerpt, and the mark's width.
    mark: (usize, usize),
}

/// Longest excerpt, in characters.
const EXCERPT: usize = 100;

impl Diagnostic {
    /// An error at the bytes `span` of `text`.
    pub fn new(
        message: impl Into<String>,
        origin: &str,
        text: &str,
        span: Range<usize>,
        help: Option<String>,
    ) -> Self {
        let boundary = |mut i: usize| {
            i = i.min(text.len());
            while !text.is_char_boundary(i) {
                i -= 1;
            }
            i
        };
        let (start, end) = (boundary(span.start), boundary(span.end.max(span.start)));
        let line_start = text[..start].rfind('\n').map_or(0, |i| i + 1);
        let line_end = text[start..].find('\n').map_or(text.len(), |i| start + i);
        let before = text[line_start..start].chars().count();
        let width = text[start..end.clamp(start, line_end)].chars().count().max(1);
        // A window of a long line, with the mark in it.
        let skip = if before + width > EXCERPT { before.saturating_sub(EXCERPT / 3) } else { 0 };
        let printable = |c: char| if c.is_control() { ' ' } else { c };
        let excerpt = text[line_start..line_end]
            .chars()
            .skip(skip)
            .take(EXCERPT)
            .map(printable)
            .collect::<String>();
        Self {
            message: message.into(),
            origin: origin.into(),
            line: text[..line_start].matches('\n').count() + 1,
            column: before + 1,
            help,
            mark: (before - skip, width.min(EXCERPT.saturating_sub(before - skip).max(1))),
            excerpt: excerpt.trim_end().into(),
        }
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = self.line.to_string();
        let margin = " ".repeat(number.len());
        writeln!(f, "{}", self.message)?;
        writeln!(f, "{margin} --> {}:{}:{}", self.origin, self.line, self.column)?;
        writeln!(f, "{margin} |")?;
        writeln!(f, "{number} | {}", self.excerpt)?;
        write!(f, "{margin} | {}{}", " ".repeat(self.mark.0), "^".repeat(self.mark.1))?;
        match &self.help {
            Some(help) => write!(f, "\n{margin} = help: {help}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for Diagnostic {}

/// The known word that `word` most likely stands for, if there is one: equal but for case, or at
/// most a third of its letters changed, added, left out or swapped.
pub fn nearest<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    let same = known.iter().find(|k| k.eq_ignore_ascii_case(word));
    let close = known.iter().map(|k| (distance(word, k), *k)).min_by_key(|(d, _)| *d);
    same.copied().or(close
        .filter(|(d, k)| *d * 3 <= k.chars().count().max(word.chars().count()))
        .map(|(_, k)| k))
}

/// Optimal string alignment distance (Damerau-Levenshtein with adjacent swaps).
fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) =
        (a.chars().take(64).collect(), b.chars().take(64).collect());
    let mut rows = vec![vec![0; b.len() + 1]; a.len() + 1];
    for (i, row) in rows.iter_mut().enumerate() {
        row[0] = i;
    }
    rows[0] = (0..=b.len()).collect();
    for i in 1..=a.len() {
        for j in 1..=b.len() {
            let change = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut least = change.min(rows[i - 1][j] + 1).min(rows[i][j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(rows[i - 2][j - 2] + 1);
            }
            rows[i][j] = least;
        }
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    // An empty span is what is tested.
    #![allow(clippy::reversed_empty_ranges)]

    use super::*;

    #[test]
    fn points_into_the_line() {
        let text = "name = \"a\"\nplus = [\"1 + alhpa*x\", \"y\"]\n";
        let start = text.find("alhpa").unwrap();
        let help = Some("did you mean `alpha`?".into());
        let d = Diagnostic::new("unknown name `alhpa`", "my.toml", text, start..start + 5, help);
        let want = "unknown name `alhpa`\n  --> my.toml:2:14\n  |\n2 | plus = [\"1 + \
            alhpa*x\", \"y\"]\n  |              ^^^^^\n  = help: did you mean `alpha`?";
        assert_eq!(d.to_string(), want);
    }

    #[test]
    fn long_lines_and_odd_spans() {
        let text = format!("{}!{}", "a".repeat(500), "b".repeat(500));
        let shown = Diagnostic::new("m", "f", &text, 500..501, None).to_string();
        let lines: Vec<&str> = shown.lines().collect();
        assert!(lines[3].len() < 120 && lines[1].ends_with("f:1:501"));
        assert_eq!(lines[3].chars().nth(lines[4].find('^').unwrap()), Some('!'));
        for span in [0..0, 5..2, 2000..3000, 999..4000] {
            assert!(Diagnostic::new("m", "f", &text, span, None).to_string().contains('^'));
        }
        // In the middle of a character, and control characters that a terminal would obey.
        let shown = Diagnostic::new("m", "f", "é\u{1b}[31mx", 1..2, None).to_string();
        assert!(!shown.contains('\u{1b}'));
    }

    #[test]
    fn nearest_words() {
        let known = ["alpha", "beta", "v_plus", "v_minus"];
        assert_eq!(nearest("aplha", &known), Some("alpha"));
        assert_eq!(nearest("BETA", &known), Some("beta"));
        assert_eq!(nearest("v_pluss", &known), Some("v_plus"));
        assert_eq!(nearest("gamma", &known), None);
        assert_eq!(nearest("q", &["x", "y"]), None);
    }
}
