//! Provenance as it is written into a file, whatever the file's format. How it is found and checked
//! again is [`provenance`](super::provenance)'s.

/// Key under which the seal is kept.
pub const SEAL_KEY: &str = "seal-sha256";
/// Its characters.
pub const SEAL_LENGTH: usize = 64;
/// Placeholder of the seal while it is computed.
pub const BLANK: &str = "0000000000000000000000000000000000000000000000000000000000000000";

/// Provenance with the blank seal, ready to be written.
#[derive(Clone, Debug)]
pub struct Sealed {
    /// The pairs, the seal last.
    pub entries: Vec<(String, String)>,
}

impl Sealed {
    /// Adds a blank seal.
    pub fn new(entries: &[(String, String)]) -> Self {
        let mut entries: Vec<_> = entries.iter().filter(|(k, _)| k != SEAL_KEY).cloned().collect();
        entries.push((SEAL_KEY.to_owned(), BLANK.to_owned()));
        Self { entries }
    }
}

/// Pairs as JSON in ASCII.
pub fn to_ascii_json(entries: &[(String, String)]) -> String {
    let text = serde_json::to_string(entries).unwrap_or_default();
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_ascii() && c != '\u{7f}' {
            out.push(c);
        } else {
            let mut pair = [0; 2];
            for unit in c.encode_utf16(&mut pair) {
                out.push_str(&format!("\\u{unit:04x}"));
            }
        }
    }
    out
}
