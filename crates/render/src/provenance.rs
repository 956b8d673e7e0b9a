//! Provenance of a picture, written into its file, with a seal that reveals later changes of the
//! file.
//!
//! The seal is the SHA-256 of the file with 64 zeros in place of the seal. It reveals damage and
//! editing. It is not a signature: anyone can compute it anew.

use sha2::{Digest, Sha256};

use super::seal::{BLANK, SEAL_KEY, SEAL_LENGTH};
use super::{pdf, png_file, svg};

/// Kind of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Portable Network Graphics.
    Png,
    /// Scalable Vector Graphics.
    Svg,
    /// Portable Document Format.
    Pdf,
}

/// The provenance written in a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Provenance {
    /// Kind of file.
    pub format: Format,
    /// The (key, value) pairs, in the order in which they were given.
    pub entries: Vec<(String, String)>,
    /// Whether the file is byte for byte what was written.
    pub intact: bool,
}

impl Provenance {
    /// The value of a key.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.entries.iter().find(|(k, _)| k == key).map(|(_, v)| v.as_str())
    }
}

/// Why a file's provenance cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProvenanceError {
    /// Neither PNG nor SVG nor PDF.
    #[error("the file is neither PNG nor SVG nor PDF")]
    UnknownFormat,
    /// Nothing in it was written by this program.
    #[error(
        "the file carries no provenance of twofold: it was made by another program, or that part \
            was removed"
    )]
    Foreign,
    /// It has been cut off or damaged.
    #[error("the file's provenance is damaged")]
    Damaged,
}

/// Computes the seal of a file that was written with a blank one, and puts it in.
pub fn seal(mut file: Vec<u8>) -> Result<Vec<u8>, ProvenanceError> {
    let format = format_of(&file)?;
    let at = seal_position(&file, format).ok_or(ProvenanceError::Damaged)?;
    let digest: String = Sha256::digest(&file).iter().map(|b| format!("{b:02x}")).collect();
    put_seal(&mut file, format, at, digest.as_bytes());
    Ok(file)
}

fn put_seal(file: &mut [u8], format: Format, at: usize, seal: &[u8]) {
    file[at..at + SEAL_LENGTH].copy_from_slice(seal);
    if format == Format::Png {
        // The chunk that holds the seal ends with it; its checksum follows.
        let holder = chunks(file).find(|c| c.start <= at && at < c.start + c.length);
        if let Some(chunk) = holder {
            let sum = crc32(&file[chunk.start - 4..chunk.start + chunk.length]);
            file[chunk.start + chunk.length..chunk.start + chunk.length + 4]
                .copy_from_slice(&sum.to_be_bytes());
        }
    }
}

fn format_of(bytes: &[u8]) -> Result<Format, ProvenanceError> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Ok(Format::Png)
    } else if bytes.starts_with(b"%PDF-") {
        Ok(Format::Pdf)
    } else if find(&bytes[..bytes.len().min(1024)], b"<svg", 0).is_some() {
        Ok(Format::Svg)
    } else {
        Err(ProvenanceError::UnknownFormat)
    }
}

fn find(bytes: &[u8], what: &[u8], from: usize) -> Option<usize> {
    bytes.get(from..)?.windows(what.len()).position(|w| w == what).map(|i| i + from)
}

/// Position of the first of the seal's 64 characters.
fn seal_position(file: &[u8], format: Format) -> Option<usize> {
    let (open, from) = match format {
        Format::Png => {
            let keyword = format!("{}{SEAL_KEY}\0\0\0\0\0", png_file::KEYWORD_PREFIX);
            let chunk = chunks(file)
                .find(|c| &c.kind == b"iTXt" && c.data(file).starts_with(keyword.as_bytes()))?;
            return (chunk.length == keyword.len() + SEAL_LENGTH)
                .then_some(chunk.start + keyword.len());
        }
        Format::Svg => (format!("<entry key=\"{SEAL_KEY}\">"), 0),
        Format::Pdf => (
            format!("[\"{SEAL_KEY}\",\""),
            find(file, format!("/{}", pdf::INFO_KEY).as_bytes(), 0)?,
        ),
    };
    let at = find(file, open.as_bytes(), from)? + open.len();
    (at + SEAL_LENGTH <= file.len()).then_some(at)
}

/// Reads the provenance of a PNG, SVG or PDF file that [`render`](super::render) made.
///
/// # Errors
///
/// If the file is none of the three formats, is damaged, or carries no provenance.
pub fn read_provenance(bytes: &[u8]) -> Result<Provenance, ProvenanceError> {
    let format = format_of(bytes)?;
    let entries = match format {
        Format::Png => png_entries(bytes)?,
        Format::Svg => svg_entries(bytes)?,
        Format::Pdf => pdf_entries(bytes)?,
    };
    let intact = is_intact(bytes, format);
    let entries = entries.into_iter().filter(|(k, _)| k != SEAL_KEY).collect();
    Ok(Provenance { format, entries, intact })
}

fn is_intact(bytes: &[u8], format: Format) -> bool {
    let Some(at) = seal_position(bytes, format) else { return false };
    let found = bytes[at..at + SEAL_LENGTH].to_vec();
    let mut blank = bytes.to_vec();
    put_seal(&mut blank, format, at, BLANK.as_bytes());
    let Ok(fresh) = seal(blank) else { return false };
    // Comparing the whole file, not only the seal, also checks the checksum of the seal's own
    // chunk.
    fresh == bytes && fresh[at..at + SEAL_LENGTH] == found[..]
}

struct Chunk {
    kind: [u8; 4],
    start: usize,
    length: usize,
}

impl Chunk {
    fn data<'a>(&self, file: &'a [u8]) -> &'a [u8] {
        &file[self.start..self.start + self.length]
    }
}

/// The complete chunks of a PNG file.
fn chunks(file: &[u8]) -> impl Iterator<Item = Chunk> + '_ {
    let mut at = 8usize;
    std::iter::from_fn(move || {
        let head: [u8; 8] = file.get(at..at.checked_add(8)?)?.try_into().ok()?;
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let start = at + 8;
        let end = start.checked_add(length)?.checked_add(4)?;
        if end > file.len() {
            return None;
        }
        at = end;
        Some(Chunk { kind: [head[4], head[5], head[6], head[7]], start, length })
    })
}

fn png_entries(bytes: &[u8]) -> Result<Vec<(String, String)>, ProvenanceError> {
    let mut entries = Vec::new();
    for chunk in chunks(bytes).filter(|c| &c.kind == b"iTXt") {
        let data = chunk.data(bytes);
        let Some(rest) = data.strip_prefix(png_file::KEYWORD_PREFIX.as_bytes()) else { continue };
        // Keyword, then compression flag and method, language and translated keyword (both empty),
        // each ended by a zero byte.
        let end = rest.iter().position(|b| *b == 0).ok_or(ProvenanceError::Damaged)?;
        let text = rest[end..].strip_prefix(b"\0\0\0\0\0").ok_or(ProvenanceError::Damaged)?;
        let string = |b: &[u8]| String::from_utf8(b.to_vec()).map_err(|_| ProvenanceError::Damaged);
        entries.push((string(&rest[..end])?, string(text)?));
    }
    if entries.is_empty() { Err(ProvenanceError::Foreign) } else { Ok(entries) }
}

fn svg_entries(bytes: &[u8]) -> Result<Vec<(String, String)>, ProvenanceError> {
    let open = format!("<provenance xmlns=\"{}\">", svg::NAMESPACE);
    let start = find(bytes, open.as_bytes(), 0).ok_or(ProvenanceError::Foreign)? + open.len();
    let end = find(bytes, b"</provenance>", start).ok_or(ProvenanceError::Damaged)?;
    let text = std::str::from_utf8(&bytes[start..end]).map_err(|_| ProvenanceError::Damaged)?;
    text.lines()
        .filter(|l| !l.is_empty())
        .map(|line| {
            let (key, value) =
                line.strip_prefix("<entry key=\"")?.strip_suffix("</entry>")?.split_once("\">")?;
            Some((unescape(key), unescape(value)))
        })
        .collect::<Option<_>>()
        .ok_or(ProvenanceError::Damaged)
}

fn unescape(text: &str) -> String {
    text.replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&quot;", "\"")
        .replace("&#10;", "\n")
        .replace("&#9;", "\t")
        .replace("&#13;", "\r")
        .replace("&amp;", "&")
}

fn pdf_entries(bytes: &[u8]) -> Result<Vec<(String, String)>, ProvenanceError> {
    let open = format!("/{}", pdf::INFO_KEY);
    let start = find(bytes, open.as_bytes(), 0).ok_or(ProvenanceError::Foreign)? + open.len();
    let start = find(bytes, b"(", start).ok_or(ProvenanceError::Damaged)? + 1;
    let mut json = Vec::new();
    let mut depth = 0;
    let mut at = start;
    loop {
        match bytes.get(at).ok_or(ProvenanceError::Damaged)? {
            b'\\' => {
                at += 1;
                // Only backslash and parentheses are ever escaped: JSON in ASCII holds no control
                // characters.
                json.push(*bytes.get(at).ok_or(ProvenanceError::Damaged)?);
            }
            b')' if depth == 0 => break,
            b => {
                depth += i32::from(*b == b'(') - i32::from(*b == b')');
                json.push(*b);
            }
        }
        at += 1;
    }
    serde_json::from_slice(&json).map_err(|_| ProvenanceError::Damaged)
}

/// The checksum of PNG chunks (ISO 3309).
fn crc32(bytes: &[u8]) -> u32 {
    let mut sum = u32::MAX;
    for b in bytes {
        sum ^= u32::from(*b);
        for _ in 0..8 {
            sum = if sum & 1 == 1 { 0xedb8_8320 ^ (sum >> 1) } else { sum >> 1 };
        }
    }
    !sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_the_standard() {
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
    }

    #[test]
    fn what_is_looked_for_is_found_from_where_one_looks() {
        assert_eq!(find(b"abcabcab", b"abc", 0), Some(0));
        assert_eq!(find(b"abcabcab", b"abc", 1), Some(3));
        assert_eq!(find(b"abcabcab", b"abc", 3), Some(3));
        assert_eq!(find(b"abcabcab", b"abc", 4), None);
        assert_eq!(find(b"abc", b"abc", 9), None);
        // A picture's beginning tells that it is an SVG: its first 1024 bytes.
        let later = |n: usize| format_of(&[&vec![b' '; n][..], b"<svg"].concat());
        assert_eq!(
            (later(1020), later(1021)),
            (Ok(Format::Svg), Err(ProvenanceError::UnknownFormat))
        );
    }

    #[test]
    fn a_seal_is_whole_or_none() {
        let open = format!("<svg><entry key=\"{SEAL_KEY}\">");
        let whole = format!("{open}{}", "0".repeat(SEAL_LENGTH));
        assert_eq!(seal_position(whole.as_bytes(), Format::Svg), Some(open.len()));
        assert_eq!(seal_position(&whole.as_bytes()[..whole.len() - 1], Format::Svg), None);
        // In a PDF it stands behind our own entry, not before.
        let (key, entry) = (format!("[\"{SEAL_KEY}\",\""), format!("/{}", pdf::INFO_KEY));
        let seal = "0".repeat(SEAL_LENGTH);
        let behind = format!("%PDF{entry}({key}{seal}");
        assert_eq!(seal_position(behind.as_bytes(), Format::Pdf), Some(behind.len() - SEAL_LENGTH));
        let before = format!("%PDF{key}{seal}{entry}");
        assert_eq!(seal_position(before.as_bytes(), Format::Pdf), None);
    }

    #[test]
    fn chunks_end_where_they_say() {
        let chunk =
            |length: u32, data: &[u8]| [&length.to_be_bytes()[..], b"iTXt", data, b"crc!"].concat();
        let file = |parts: &[Vec<u8>]| [b"\x89PNG\r\n\x1a\n".to_vec(), parts.concat()].concat();
        let lengths = |file: &[u8]| chunks(file).map(|c| (c.start, c.length)).collect::<Vec<_>>();
        assert_eq!(lengths(&file(&[chunk(3, b"abc"), chunk(0, b"")])), [(16, 3), (31, 0)]);
        assert_eq!(lengths(&file(&[chunk(4, b"abc")])), [], "it claims a byte more than there is");
        assert_eq!(lengths(&file(&[chunk(u32::MAX, b"abc")])), []);
        assert_eq!(
            lengths(&file(&[chunk(2, b"ab"), vec![0; 7]])),
            [(16, 2)],
            "half a head is no chunk"
        );
    }

    #[test]
    fn other_files_are_refused() {
        assert_eq!(read_provenance(b""), Err(ProvenanceError::UnknownFormat));
        assert_eq!(read_provenance(b"\x89PNG\r\n\x1a\n\0\0\0"), Err(ProvenanceError::Foreign));
        assert_eq!(read_provenance(b"<svg></svg>"), Err(ProvenanceError::Foreign));
        assert_eq!(
            read_provenance(b"%PDF-1.7\n/TwofoldProvenance (["),
            Err(ProvenanceError::Damaged)
        );
        assert_eq!(read_provenance(b"%PDF-1.7\n/TwofoldProvenance"), Err(ProvenanceError::Damaged));
    }
}
