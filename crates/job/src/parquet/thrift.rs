//! Structures of Thrift's compact protocol, of which a Parquet file's footer and the headers of its pages are made, gone through before the crate reads them.
//!
//! The crate reads a field that it knows as what it should be, whatever it says that it is, and passes over one that it does not know: a list of so many elements as it says,
//! though truth values have no bytes there, nor has anything behind the end of a file. So a few bytes can claim two thousand million elements, and a small file
//! keeps it busy for hours (found by `make fuzz-coverage`). Here a structure has the fields that Parquet gives it and no others, each of its kind, and a list has no more elements than there are
//! bytes: then the crate has nothing to pass over, and the time is at most proportional to the bytes.

/// What a value is.
pub(super) enum Shape {
    /// A truth value of a structure: it is in the head of its field.
    Truth,
    /// A whole number of 16, 32 or 64 bits.
    I16,
    I32,
    I64,
    /// Bytes or letters.
    Binary,
    List(&'static Shape),
    Structure(&'static [(i64, Shape)]),
}

use Shape::{Binary, I16, I32, I64, List, Structure, Truth};

/// A page's header (`PageHeader` in parquet.thrift), as far as it is written here.
pub(super) const PAGE: &[(i64, Shape)] = &[
    (1, I32),
    (2, I32),
    (3, I32),
    (4, I32),
    (5, Structure(&[(1, I32), (2, I32), (3, I32), (4, I32)])),
    (7, Structure(&[(1, I32), (2, I32), (3, Truth)])),
];

/// The field of a page's header that is the number of bytes behind it.
pub(super) const PAGE_LENGTH: i64 = 3;

/// A file's footer (`FileMetaData`), as far as it is written here.
pub(super) const FOOTER: &[(i64, Shape)] = &[
    (1, I32),
    (2, List(&Structure(SCHEMA_ELEMENT))),
    (3, I64),
    (4, List(&Structure(ROW_GROUP))),
    (5, List(&Structure(&[(1, Binary), (2, Binary)]))),
    (6, Binary),
    // By which order columns would be sorted: one of two.
    (7, List(&Structure(&[(1, Structure(&[])), (2, Structure(&[]))]))),
];

const SCHEMA_ELEMENT: &[(i64, Shape)] = &[
    (1, I32),
    (2, I32),
    (3, I32),
    (4, Binary),
    (5, I32),
    (6, I32),
    (7, I32),
    (8, I32),
    (9, I32),
    // The logical type: of those, letters.
    (10, Structure(&[(1, Structure(&[]))])),
];

const ROW_GROUP: &[(i64, Shape)] = &[(1, List(&Structure(COLUMN))), (2, I64), (3, I64), (5, I64), (6, I64), (7, I16)];

const COLUMN: &[(i64, Shape)] = &[(2, I64), (3, Structure(COLUMN_METADATA)), (4, I64), (5, I32), (6, I64), (7, I32)];

const COLUMN_METADATA: &[(i64, Shape)] = &[
    (1, I32),
    (2, List(&I32)),
    (3, List(&Binary)),
    (4, I32),
    (5, I64),
    (6, I64),
    (7, I64),
    (9, I64),
    (11, I64),
    // How many pages of which encoding.
    (13, List(&Structure(&[(1, I32), (2, I32), (3, I32)]))),
    // Sizes.
    (16, Structure(&[(1, I64), (2, List(&I64)), (3, List(&I64))])),
];

/// What is not yet gone through.
struct Rest<'a>(&'a [u8]);

/// The structure of these `fields` at the beginning of `bytes`: its length, and its own whole number in the field `wanted`, or 0 if it has none. None if it is none.
pub(super) fn structure(bytes: &[u8], fields: &[(i64, Shape)], wanted: i64) -> Option<(usize, i64)> {
    let mut rest = Rest(bytes);
    let number = rest.structure(fields, wanted)?;
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

    fn structure(&mut self, fields: &[(i64, Shape)], wanted: i64) -> Option<i64> {
        let (mut field, mut found) = (0_i64, 0);
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(found);
            }
            // The field's number, relative to the one before or by itself.
            field = match head >> 4 {
                0 => self.zigzag()?,
                step => field.checked_add(i64::from(step))?,
            };
            let (_, shape) = fields.iter().find(|(number, _)| *number == field)?;
            let number = self.value(shape, head & 0x0f)?;
            if field == wanted {
                found = number;
            }
        }
    }

    /// Goes through a value that says that it is of this kind; gives it if it is a whole number, else 0.
    fn value(&mut self, shape: &Shape, kind: u8) -> Option<i64> {
        match (shape, kind) {
            // True or false.
            (Truth, 1 | 2) => Some(0),
            (I16, 4) | (I32, 5) | (I64, 6) => self.zigzag(),
            (Binary, 8) => {
                let length = self.varint()?;
                self.pass(length).map(|()| 0)
            }
            (List(element), 9) => {
                let head = self.byte()?;
                // Few elements are counted in the head; an empty list may be of any kind.
                let count = match head >> 4 {
                    15 => self.varint()?,
                    few => u64::from(few),
                };
                if count > self.0.len() as u64 {
                    return None;
                }
                for _ in 0..count {
                    self.value(element, head & 0x0f)?;
                }
                Some(0)
            }
            (Structure(fields), 12) => self.structure(fields, 0).map(|_| 0),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: &[(i64, Shape)] = &[
        (1, I32),
        (2, Binary),
        (3, List(&I64)),
        (4, Truth),
        (20, Structure(&[(1, I64)])),
        (21, I16),
        (22, List(&Structure(&[(1, I32)]))),
    ];

    #[test]
    fn lengths_and_numbers() {
        // An i32 (5) in field 1: 150; a string (8) in field 2; a list (9) of two i64 (6) in field 3; truth (1) in field 4; a structure (12) in field 20, given by
        // itself, with a number in its field 1; an i16 (4); a list of two structures.
        let bytes = [
            &[0x15, 0xac, 0x02][..],
            &[0x18, 3, b'a', b'b', b'c'],
            &[0x19, 0x26, 1, 0x80, 1],
            &[0x11],
            &[0x0c, 40, 0x16, 8, 0],
            &[0x14, 7],
            &[0x19, 0x2c, 0x15, 2, 0, 0],
            &[0],
        ]
        .concat();
        let followed = [&bytes[..], &[0x15, 2, 0]].concat();
        assert_eq!(structure(&followed, ALL, 1), Some((bytes.len(), 150)));
        assert_eq!(structure(&bytes, ALL, 21), Some((bytes.len(), -4)));
        for not_there in [2, 3, 4, 5, 20, 22, 23] {
            assert_eq!(structure(&bytes, ALL, not_there), Some((bytes.len(), 0)), "{not_there}");
        }
        for cut in 0..bytes.len() {
            assert_eq!(structure(&bytes[..cut], ALL, 1), None, "{cut}");
        }
        assert_eq!(structure(&[0x15, 0x01, 0], ALL, 1), Some((3, -1)));
        assert_eq!(structure(&[0], ALL, 1), Some((1, 0)));
    }

    #[test]
    fn what_is_of_another_kind_is_refused() {
        let zeros = [0; 100];
        let with = |bytes: &[u8]| structure(&[bytes, &zeros].concat(), ALL, 1);
        // A list of numbers in field 3; fifteen elements and more are counted behind the head.
        assert!(with(&[0x39, 0xf6, 20]).is_some());
        assert!(with(&[0x39, 0xf6, 100]).is_none(), "no byte is left for the structure's end");
        assert!(with(&[0x39, 0xf6, 99]).is_some());
        assert!(with(&[0x39, 0xf6, 101]).is_none());
        // As many as 32 bits count; truth values; doubles; a set; an empty list of whatever.
        assert!(with(&[0x39, 0xf6, 0xff, 0xff, 0xff, 0xff, 0x07]).is_none());
        assert!(with(&[0x39, 0x21]).is_none() && with(&[0x39, 0x27]).is_none() && with(&[0x3a, 0x26]).is_none());
        assert!(with(&[0x39, 0x01]).is_some());
        // Fields of other kinds, and one that nobody knows.
        for kind in [0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13] {
            assert!(with(&[0x10 | kind]).is_none(), "{kind}");
        }
        assert!(with(&[0x55, 2]).is_none() && with(&[0x05, 2, 2]).is_some() && with(&[0x05, 1, 2]).is_none());
        // A number that does not end, a string that ends after the bytes do.
        assert!(structure(&[&[0x15][..], &[0x80; 30]].concat(), ALL, 1).is_none());
        assert!(with(&[0x28, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x01]).is_none());
        assert!(with(&[0x28, 99]).is_some() && with(&[0x28, 101]).is_none());
    }
}
