//! The embedded fonts: glyph outlines, advance widths and kerning.

use std::sync::OnceLock;

use ttf_parser::gpos::{PairAdjustment, PositioningSubtable};
use ttf_parser::{Face, GlyphId, OutlineBuilder, Tag};

static REGULAR: &[u8] = include_bytes!("../../assets/fonts/LibertinusSerif-Regular.otf");
static ITALIC: &[u8] = include_bytes!("../../assets/fonts/LibertinusSerif-Italic.otf");
static BOLD: &[u8] = include_bytes!("../../assets/fonts/LibertinusSerif-Bold.otf");
static BOLD_ITALIC: &[u8] = include_bytes!("../../assets/fonts/LibertinusSerif-BoldItalic.otf");

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

/// Height of capitals as a share of the font size.
pub const CAP_HEIGHT: f64 = 0.658;

struct Loaded {
    face: Face<'static>,
    kerning: Vec<PairAdjustment<'static>>,
}

fn loaded(face: FontFace) -> &'static Loaded {
    static FONTS: OnceLock<[Loaded; 4]> = OnceLock::new();
    let fonts = FONTS.get_or_init(|| [REGULAR, ITALIC, BOLD, BOLD_ITALIC].map(load));
    match face {
        FontFace::Regular => &fonts[0],
        FontFace::Italic => &fonts[1],
        FontFace::Bold => &fonts[2],
        FontFace::BoldItalic => &fonts[3],
    }
}

fn load(bytes: &'static [u8]) -> Loaded {
    // The bytes are part of the program and a test loads each of them, so this cannot fail at run time.
    let face = Face::parse(bytes, 0).expect("an embedded font is readable");
    let mut kerning = Vec::new();
    if let Some(gpos) = face.tables().gpos {
        let feature =
            (0..gpos.features.len()).filter_map(|i| gpos.features.get(i)).find(|f| f.tag == Tag::from_bytes(b"kern"));
        for lookup in feature.into_iter().flat_map(|f| f.lookup_indices.into_iter()).filter_map(|i| gpos.lookups.get(i))
        {
            for subtable in lookup.subtables.into_iter::<PositioningSubtable>() {
                if let PositioningSubtable::Pair(pair) = subtable {
                    kerning.push(pair);
                }
            }
        }
    }
    Loaded { face, kerning }
}

/// A glyph of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Glyph {
    /// The face it comes from.
    pub face: FontFace,
    id: GlyphId,
}

/// The glyph of a character; signs that a face lacks come from the regular one. `None` if the family has no such sign.
pub fn glyph(face: FontFace, character: char) -> Option<Glyph> {
    [face, FontFace::Regular].into_iter().find_map(|face| {
        let id = loaded(face).face.glyph_index(character)?;
        Some(Glyph { face, id })
    })
}

/// Advance width of a glyph as a share of the font size.
pub fn advance(glyph: Glyph) -> f64 {
    let face = &loaded(glyph.face).face;
    f64::from(face.glyph_hor_advance(glyph.id).unwrap_or(0)) / f64::from(face.units_per_em())
}

/// Correction of the distance between two neighbouring glyphs as a share of the font size.
pub fn kern(left: Glyph, right: Glyph) -> f64 {
    if left.face != right.face {
        return 0.0;
    }
    let font = loaded(left.face);
    for pair in &font.kerning {
        let Some(index) = pair.coverage().get(left.id) else { continue };
        let value = match pair {
            PairAdjustment::Format1 { sets, .. } => sets.get(index).and_then(|set| set.get(right.id)),
            PairAdjustment::Format2 { classes, matrix, .. } => {
                matrix.get((classes.0.get(left.id), classes.1.get(right.id)))
            }
        };
        if let Some((first, _)) = value
            && first.x_advance != 0
        {
            return f64::from(first.x_advance) / f64::from(font.face.units_per_em());
        }
    }
    0.0
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
    let face = &loaded(glyph.face).face;
    let mut collector = Collector { scale: f64::from(face.units_per_em()), last: [0.0; 2], strokes: Vec::new() };
    // A glyph without ink, such as a space, has no outline.
    let _ = face.outline_glyph(glyph.id, &mut collector);
    collector.strokes
}

struct Collector {
    scale: f64,
    last: [f64; 2],
    strokes: Vec<Stroke>,
}

impl Collector {
    fn at(&self, x: f32, y: f32) -> [f64; 2] {
        [f64::from(x) / self.scale, f64::from(y) / self.scale]
    }
}

impl OutlineBuilder for Collector {
    fn move_to(&mut self, x: f32, y: f32) {
        self.last = self.at(x, y);
        self.strokes.push(Stroke::Move(self.last));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.last = self.at(x, y);
        self.strokes.push(Stroke::Line(self.last));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        // Raised to a cubic: only TrueType outlines have these, and one kind of curve is enough for three writers.
        let (control, end) = (self.at(x1, y1), self.at(x, y));
        let third = |from: [f64; 2]| [0, 1].map(|i| from[i] + 2.0 / 3.0 * (control[i] - from[i]));
        self.strokes.push(Stroke::Cubic(third(self.last), third(end), end));
        self.last = end;
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.last = self.at(x, y);
        self.strokes.push(Stroke::Cubic(self.at(x1, y1), self.at(x2, y2), self.last));
    }

    fn close(&mut self) {
        self.strokes.push(Stroke::Close);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_face_has_the_letters_and_the_regular_one_the_signs() {
        for face in [FontFace::Regular, FontFace::Italic, FontFace::Bold, FontFace::BoldItalic] {
            for c in "AZaz09()[]+,.;:=/αβγδεθλμνπρσφψωΓΔΛΣΦΨΩ−×≤".chars() {
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

    #[test]
    fn the_stated_heights_are_those_of_the_font() {
        let face = &loaded(FontFace::Regular).face;
        assert_eq!(f64::from(face.capital_height().unwrap()) / 1000.0, CAP_HEIGHT);
    }
}
