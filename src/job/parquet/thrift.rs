//! Structures of Thrift's compact protocol, of which a Parquet file's footer and the headers of its pages are made, gone through before the crate reads them.
//!
//! The crate passes over what it does not know, as it should, but takes a list's word for how many elements it has; and truth values in a list it gives no bytes. So a few
//! bytes can claim two thousand million of them, and a small file keeps it busy for hours (found by `make fuzz-coverage`). Parquet has no list of truth values here, and
//! no maps: what has them is refused, and so is a list with more elements than there are bytes. Then the time is at most proportional to the bytes.

/// Structures in structures: a footer has eight.
const DEEPEST: u32 = 16;

/// What is not yet gone through.
struct Rest<'a>(&'a [u8]);

/// The structure at the beginning of `bytes`: its length, and its own whole number in the field `wanted`, or 0 if it has none. None if it is none, or one that is refused.
pub(super) fn structure(bytes: &[u8], wanted: i64) -> Option<(usize, i64)> {
    let mut rest = Rest(bytes);
    let number = rest.structure(wanted, DEEPEST)?;
    Some((bytes.len() - rest.0.len(), number))
}

impl Rest<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    fn pass(&mut self, count: u64) -> Option<()> {
        self.0 = self.0.get(usize::try_from(count).ok()?..)?;
        Some(())
    }

    /// Seven bits a byte, the lowest first.
    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    /// With the sign in the lowest bit.
    fn zigzag(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    fn structure(&mut self, wanted: i64, depth: u32) -> Option<i64> {
        let depth = depth.checked_sub(1)?;
        let (mut field, mut found) = (0, 0);
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(found);
            }
            // The field's number, relative to the one before or by itself.
            field = match head >> 4 {
                0 => self.zigzag()?,
                step => field + i64::from(step),
            };
            match head & 0x0f {
                // Truth values, in the head itself.
                1 | 2 => {}
                kind @ 4..=6 if field == wanted && kind != 4 => found = self.zigzag()?,
                kind => self.value(kind, depth)?,
            }
        }
    }

    fn value(&mut self, kind: u8, depth: u32) -> Option<()> {
        match kind {
            3 => self.pass(1),
            4..=6 => self.varint().map(drop),
            7 => self.pass(8),
            8 => {
                let length = self.varint()?;
                self.pass(length)
            }
            // Lists and sets; few elements are counted in the head.
            9 | 10 => {
                let depth = depth.checked_sub(1)?;
                let head = self.byte()?;
                let count = match head >> 4 {
                    15 => self.varint()?,
                    few => u64::from(few),
                };
                if count > self.0.len() as u64 {
                    return None;
                }
                (0..count).try_for_each(|_| self.value(head & 0x0f, depth))
            }
            12 => self.structure(0, depth).map(drop),
            // 1 and 2 truth values, 11 a map.
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_and_numbers() {
        // An i32 (5) in field 1: 150; a string (8) in field 2; a list (9) of two i64 (6) in field 3; truth (1) in field 4; a structure (12) in field 20, given by
        // itself, with a number in its field 1; a double (7) in field 21; a byte (3).
        let bytes = [
            &[0x15, 0xac, 0x02][..],
            &[0x18, 3, b'a', b'b', b'c'],
            &[0x19, 0x26, 1, 0x80, 1],
            &[0x11],
            &[0x0c, 40, 0x16, 8, 0],
            &[0x17, 1, 2, 3, 4, 5, 6, 7, 8],
            &[0x13, 7],
            &[0],
        ]
        .concat();
        let followed = [&bytes[..], &[0x15, 2, 0]].concat();
        assert_eq!(structure(&followed, 1), Some((bytes.len(), 150)));
        for not_there in [2, 3, 4, 5, 20, 21, 22, 23] {
            assert_eq!(structure(&bytes, not_there), Some((bytes.len(), 0)), "{not_there}");
        }
        for cut in 0..bytes.len() {
            assert_eq!(structure(&bytes[..cut], 1), None, "{cut}");
        }
        assert_eq!(structure(&[0x15, 0x01, 0], 1), Some((3, -1)));
        assert_eq!(structure(&[0], 1), Some((1, 0)));
    }

    #[test]
    fn what_takes_more_time_than_bytes_is_refused() {
        let zeros = [0; 100];
        let with = |bytes: &[u8]| structure(&[bytes, &zeros].concat(), 1);
        // Fifteen bytes and more say their number behind the head.
        assert!(with(&[0x19, 0xf3, 20]).is_some());
        assert!(with(&[0x19, 0xf3, 99]).is_some());
        assert_eq!(with(&[0x19, 0xf3, 101]), None);
        // As many as 32 bits count; truth values; a map.
        assert_eq!(with(&[0x19, 0xf3, 0xff, 0xff, 0xff, 0xff, 0x07]), None);
        assert_eq!(with(&[0x19, 0x21]), None);
        assert_eq!(with(&[0x19, 0x22]), None);
        assert_eq!(with(&[0x1b, 1, 0x55]), None);
        // A number that does not end, a string that ends after the bytes do.
        assert_eq!(structure(&[&[0x15][..], &[0x80; 30]].concat(), 1), None);
        assert_eq!(with(&[0x18, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x01]), None);
        // Structures in structures, and lists in lists.
        assert!(with(&[0x1c; 15]).is_some());
        assert_eq!(with(&[0x1c; 16]), None);
        assert_eq!(with(&[&[0x19][..], &[0x19; 60]].concat()), None);
    }
}
