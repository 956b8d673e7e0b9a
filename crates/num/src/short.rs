//! Numbers in sentences.

use std::fmt;

/// A number in a sentence: all its digits, with an exponent where zeros would fill a line.
///
/// ```
/// use twofold_num::Short;
/// assert_eq!(Short(0.25).to_string(), "0.25");
/// assert_eq!(Short(3.5e-34).to_string(), "3.5e-34");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Short(pub f64);

/// A sign, "0.000" and seventeen digits.
const LONGEST: usize = 23;

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plain = self.0.to_string();
        if plain.len() <= LONGEST { f.write_str(&plain) } else { write!(f, "{:e}", self.0) }
    }
}
