//! The embedded fonts: glyph outlines, advance widths and kerning.

use std::sync::OnceLock;

/// Made of the fonts' files by tools/fonts. All numbers are little-endian.
///
/// For each face its length in bytes (u32), then: units per em, number of characters, of rows and
/// of columns of the table of kerning (u16 each); for each character, in increasing order, its code
/// (u32), the offset of its outline among the outlines (u32), its advance (i16), its row as the
/// left one of a pair and its column as the right one (u16 each); the table of kerning, row after
/// row (i16 each); the outlines. An outline is a list of strokes that ends with a dot: a letter as
/// in SVG (M, L, C, Z), then the coordinates of its points, each as the difference to the
/// coordinate before: an i8, or, if that is -128, the i16 behind it.
static GLYPHS: &[u8] = include_bytes!("../fonts/glyphs.bin");
/// Bytes of a character's record.
const RECORD: usize = 14;

/// A face of the font family: upright or italic, regular or bold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FontFace {
    /// Upright.
    Regular,
    /// Italic: variables.
    Italic,
    /// Bold: headings, panel labels, warnings.
    Bold,
    /// Variables among bold text.
    BoldItalic,
}

/// Height of capitals as a share of the font size: what the regular face's table OS/2 says
/// (tools/fonts).
pub const CAP_HEIGHT: f64 = 0.658;

/// The parts of [`GLYPHS`] that are a face's.
struct Loaded {
    units_per_em: f64,
    columns: usize,
    characters: &'static [u8],
    kerning: &'static [u8],
    outlines: &'static [u8],
}

fn loaded(face: FontFace) -> &'static Loaded {
    static FONTS: OnceLock<[Loaded; 4]> = OnceLock::new();
    let fonts = FONTS.get_or_init(|| {
        let mut rest = GLYPHS;
        [(); 4].map(|()| {
            // The bytes are part of the program and a test reads all of them, so this cannot fail
            // at run time.
            let (face, next) = rest[4..].split_at(number(rest, 0) as usize);
            rest = next;
            let [characters, rows, columns] = [2, 4, 6].map(|at| usize::from(small(face, at)));
            let (characters, tables) = face[8..].split_at(RECORD * characters);
            let (kerning, outlines) = tables.split_at(2 * rows * columns);
            Loaded { units_per_em: small(face, 0).into(), columns, characters, kerning, outlines }
        })
    });
    &fonts[face as usize]
}

fn small(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

fn number(bytes: &[u8], at: usize) -> u32 {
    u32::from(small(bytes, at)) | u32::from(small(bytes, at + 2)) << 16
}

/// A glyph of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Glyph {
    /// The face it comes from.
    pub face: FontFace,
    record: &'static [u8; RECORD],
}

/// The glyph of a character; signs that a face lacks come from the regular one. `None` if the
/// family has no such sign.
pub fn glyph(face: FontFace, character: char) -> Option<Glyph> {
    [face, FontFace::Regular].into_iter().find_map(|face| {
        let (records, _) = loaded(face).characters.as_chunks();
        let at =
            records.binary_search_by_key(&u32::from(character), |record| number(record, 0)).ok()?;
        Some(Glyph { face, record: &records[at] })
    })
}

/// Advance width of a glyph as a share of the font size.
pub fn advance(glyph: Glyph) -> f64 {
    f64::from(small(glyph.record, 8) as i16) / loaded(glyph.face).units_per_em
}

/// Correction of the distance between two neighbouring glyphs as a share of the font size.
pub fn kern(left: Glyph, right: Glyph) -> f64 {
    if left.face != right.face {
        return 0.0;
    }
    let font = loaded(left.face);
    let place =
        usize::from(small(left.record, 10)) * font.columns + usize::from(small(right.record, 12));
    f64::from(small(font.kerning, 2 * place) as i16) / font.units_per_em
}

/// A piece of a glyph's outline as shares of the font size, y upwards from the baseline.
#[derive(Clone, Copy, Debug)]
pub enum Stroke {
    /// Begins a contour.
    Move([f64; 2]),
    /// Straight line.
    Line([f64; 2]),
    /// Cubic Bezier curve.
    Cubic([f64; 2], [f64; 2], [f64; 2]),
    /// Ends a contour.
    Close,
}

/// The outline of a glyph.
pub fn outline(glyph: Glyph) -> Vec<Stroke> {
    let font = loaded(glyph.face);
    let mut bytes =
        font.outlines[number(glyph.record, 4) as usize..].iter().map(|byte| *byte as i8);
    let mut next = move || bytes.next().unwrap_or(0);
    let mut strokes = Vec::new();
    let mut last = [0_i16; 2];
    loop {
        let letter = next() as u8;
        let mut point = || {
            for coordinate in &mut last {
                *coordinate += match next() {
                    i8::MIN => i16::from_le_bytes([next() as u8, next() as u8]),
                    step => i16::from(step),
                };
            }
            last.map(|coordinate| f64::from(coordinate) / font.units_per_em)
        };
        strokes.push(match letter {
            b'M' => Stroke::Move(point()),
            b'L' => Stroke::Line(point()),
            b'C' => Stroke::Cubic(point(), point(), point()),
            b'Z' => Stroke::Close,
            _ => return strokes,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_face_has_the_letters_and_the_regular_one_the_signs() {
        for face in [FontFace::Regular, FontFace::Italic, FontFace::Bold, FontFace::BoldItalic] {
            for c in "AZaz09()[]+,.;:=/αβγδεθλμνπρσφψωΓΔΛΣΦΨΩ−×≤".chars()
            {
                let g = glyph(face, c).unwrap();
                assert_eq!(g.face, face, "{c}");
                assert!(!outline(g).is_empty(), "{c}");
            }
        }
        for c in "±×·−≤≥≈≠∞∂∇√∫∈→←↑↓⇒′″°…–—⟨⟩∥∝∼≪≫⊥".chars()
        {
            assert!(glyph(FontFace::Regular, c).is_some(), "{c}");
            assert!(glyph(FontFace::Italic, c).is_some(), "{c}");
        }
        assert!(glyph(FontFace::Regular, '\u{4e2d}').is_none());
    }

    #[test]
    fn kerning_pulls_a_capital_t_over_an_o() {
        let [t, o, n] = ['T', 'o', 'n'].map(|c| glyph(FontFace::Regular, c).unwrap());
        assert!(kern(t, o) < -0.02, "{}", kern(t, o));
        assert_eq!(kern(n, n), 0.0);
    }

    /// Advances, outlines and kerning, as skrifa 0.49 read them from the font files.
    #[test]
    fn every_glyph_is_the_font_files() {
        use sha2::{Digest, Sha256};
        let faces = [FontFace::Regular, FontFace::Italic, FontFace::Bold, FontFace::BoldItalic];
        let mut hash = Sha256::new();
        let mut number = |x: f64| hash.update(x.to_bits().to_le_bytes());
        let mut drawn = 0;
        for face in faces {
            for c in (0..=0x1ffff).filter_map(char::from_u32) {
                let Some(g) = glyph(face, c) else { continue };
                drawn += usize::from(g.face == face);
                number(f64::from(u32::from(c)));
                number(advance(g));
                for stroke in outline(g) {
                    let (name, points) = match stroke {
                        Stroke::Move(p) => (0.0, vec![p]),
                        Stroke::Line(p) => (1.0, vec![p]),
                        Stroke::Cubic(a, b, p) => (2.0, vec![a, b, p]),
                        Stroke::Close => (3.0, vec![]),
                    };
                    number(name);
                    points.into_iter().flatten().for_each(&mut number);
                }
            }
            // Latin, its supplement and Greek, with the signs of captions.
            let signs = (0x20..0x7f)
                .chain(0xa0..0x100)
                .chain(0x391..0x3ca)
                .chain(0x2010..0x2030)
                .chain(0x2200..0x2270);
            let glyphs: Vec<Glyph> =
                signs.filter_map(char::from_u32).filter_map(|c| glyph(face, c)).collect();
            for left in &glyphs {
                glyphs.iter().for_each(|right| number(kern(*left, *right)));
            }
        }
        assert!(drawn > 8000, "{drawn}");
        let digest: String = hash.finalize().iter().map(|b| format!("{b:02x}")).collect();
        assert_eq!(digest, "19bd82af7e039c91101ca5956651130e6a2b44c6ee3a44dd82b90c5ef740f3e1");
    }
}
