//! SHA-256, as lower-case hexadecimal text.

use std::fmt::Write as _;
use std::io::{self, Read};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

/// A SHA-256 digest.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Hash(String);

/// A text that is no digest.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is not a SHA-256: 64 digits of 0-9 and a-f")]
pub struct NotAHash(String);

impl TryFrom<String> for Hash {
    type Error = NotAHash;

    fn try_from(text: String) -> Result<Self, NotAHash> {
        let digit = |b: u8| b.is_ascii_digit() || (b'a'..=b'f').contains(&b);
        if text.len() == 64 && text.bytes().all(digit) {
            Ok(Hash(text))
        } else {
            // The text may be long; its beginning suffices.
            Err(NotAHash(text.chars().take(80).collect()))
        }
    }
}

impl From<Hash> for String {
    fn from(hash: Hash) -> String {
        hash.0
    }
}

/// The digest of bytes that come in parts.
#[derive(Clone, Debug, Default)]
pub struct RunningHash(Sha256);

impl RunningHash {
    /// The next bytes.
    pub fn update(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// The digest of all of them.
    pub fn finish(self) -> Hash {
        Hash::finish(self.0)
    }
}

impl Hash {
    /// The digest of some bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self::of_parts([bytes])
    }

    /// The digest of the concatenation of `parts`.
    pub fn of_parts<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> Self {
        let mut digest = Sha256::new();
        for part in parts {
            digest.update(part);
        }
        Self::finish(digest)
    }

    /// The digest of everything in a stream, and its length in bytes; read piece by piece.
    ///
    /// # Errors
    /// If the stream cannot be read.
    pub fn of_stream(mut stream: impl Read) -> io::Result<(Self, u64)> {
        let (mut digest, mut length) = (Sha256::new(), 0);
        let mut piece = vec![0; 1 << 16];
        loop {
            match stream.read(&mut piece) {
                Ok(0) => return Ok((Self::finish(digest), length)),
                Ok(n) => {
                    digest.update(&piece[..n]);
                    length += n as u64;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }

    fn finish(digest: Sha256) -> Self {
        let mut text = String::with_capacity(64);
        for byte in digest.finalize() {
            // Writing to a String cannot fail.
            let _ = write!(text, "{byte:02x}");
        }
        Hash(text)
    }

    /// The digest of a value's [`canonical_json`].
    pub fn of_json<T: Serialize>(value: &T) -> Self {
        Self::of(&canonical_json(value))
    }

    /// The first twelve digits, for small print.
    pub fn short(&self) -> &str {
        self.0.get(..12).unwrap_or(&self.0)
    }

    /// All sixty-four digits.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// The JSON bytes that are hashed: keys of every object in the order of their bytes, no spaces,
/// shortest round-trip numbers. The order is made here, because the JSON library's own depends on a
/// cargo feature that any dependency can turn on.
pub fn canonical_json<T: Serialize>(value: &T) -> Vec<u8> {
    let value = serde_json::to_value(value)
        .expect("specs are plain data: string keys, no failing serialisers");
    let mut bytes = Vec::new();
    write_canonical(&value, &mut bytes);
    bytes
}

fn write_canonical(value: &Value, into: &mut Vec<u8>) {
    match value {
        Value::Object(map) => {
            let mut entries: Vec<_> = map.iter().collect();
            entries.sort_by(|a, b| a.0.cmp(b.0));
            into.push(b'{');
            for (i, (key, value)) in entries.into_iter().enumerate() {
                if i > 0 {
                    into.push(b',');
                }
                write_scalar(key, into);
                into.push(b':');
                write_canonical(value, into);
            }
            into.push(b'}');
        }
        Value::Array(values) => {
            into.push(b'[');
            for (i, value) in values.iter().enumerate() {
                if i > 0 {
                    into.push(b',');
                }
                write_canonical(value, into);
            }
            into.push(b']');
        }
        scalar => write_scalar(scalar, into),
    }
}

fn write_scalar<T: Serialize + ?Sized>(value: &T, into: &mut Vec<u8>) {
    serde_json::to_writer(into, value).expect("writing to memory does not fail");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_has_the_digest_of_its_bytes() {
        /// Gives seven bytes at a time, and is interrupted before each.
        struct Slow<'a>(&'a [u8], bool);
        impl Read for Slow<'_> {
            fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
                self.1 = !self.1;
                if self.1 {
                    return Err(io::ErrorKind::Interrupted.into());
                }
                let n = self.0.len().min(7).min(into.len());
                into[..n].copy_from_slice(&self.0[..n]);
                self.0 = &self.0[n..];
                Ok(n)
            }
        }
        /// Breaks.
        struct Broken;
        impl Read for Broken {
            fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
                Err(io::Error::other("broken"))
            }
        }
        let bytes: Vec<u8> = (0..200_000u32).map(|i| (i % 251) as u8).collect();
        for n in [0, 1, 6, 7, 8, 65_535, 65_536, 65_537, 200_000] {
            let whole = (Hash::of(&bytes[..n]), n as u64);
            assert_eq!(Hash::of_stream(&bytes[..n]).unwrap(), whole);
            assert_eq!(Hash::of_stream(Slow(&bytes[..n], false)).unwrap(), whole);
        }
        assert!(Hash::of_stream(Broken).is_err());
    }

    #[test]
    fn known_digest() {
        assert_eq!(
            Hash::of(b"abc").as_str(),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
    }

    #[test]
    fn json_is_canonical_whatever_order_it_is_made_in() {
        #[derive(Serialize)]
        struct Declared {
            zeta: f64,
            alpha: Vec<Option<u64>>,
            words: Inner,
        }
        #[derive(Serialize)]
        struct Inner {
            b: &'static str,
            a: bool,
        }
        let value = Declared {
            zeta: 1e-5,
            alpha: vec![Some(1), None],
            words: Inner { b: "\"\n", a: true },
        };
        let want = r#"{"alpha":[1,null],"words":{"a":true,"b":"\"\n"},"zeta":0.00001}"#;
        assert_eq!(String::from_utf8(canonical_json(&value)).unwrap(), want);
        // The same object from text in two orders.
        for text in [want, r#"{"zeta":1e-5,"words":{"b":"\"\n","a":true},"alpha":[1,null]}"#] {
            let read: Value = serde_json::from_str(text).unwrap();
            assert_eq!(Hash::of_json(&read), Hash::of_json(&value), "{text}");
        }
    }

    #[test]
    fn only_digests_are_read() {
        let good = Hash::of(b"abc");
        let text = serde_json::to_string(&good).unwrap();
        assert_eq!(text, format!("\"{}\"", good.as_str()));
        assert_eq!(serde_json::from_str::<Hash>(&text).unwrap(), good);
        let upper = text.to_uppercase();
        for bad in [
            "\"\"",
            "\"abc\"",
            &text.replace('b', "g"),
            &upper,
            &text.replace("ba", "b"),
            "\"\\u001b[2J\"",
            "1",
        ] {
            assert!(serde_json::from_str::<Hash>(bad).is_err(), "{bad}");
        }
        let error = Hash::try_from("\u{1b}".repeat(1000)).unwrap_err().to_string();
        assert!(!error.contains('\u{1b}') && error.len() < 1000, "{error}");
    }

    #[test]
    fn small_print_shows_the_beginning() {
        assert_eq!(Hash::of(b"abc").short(), "ba7816bf8f01");
    }
}
