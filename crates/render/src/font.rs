//! The embedded fonts: glyph outlines, advance widths and kerning.

use std::sync::OnceLock;

use skrifa::charmap::Charmap;
use skrifa::instance::{LocationRef, Size};
use skrifa::metrics::GlyphMetrics;
use skrifa::outline::{DrawSettings, OutlinePen};
use skrifa::raw::tables::gpos::{PairPos, PositionSubtables, ValueRecord};
use skrifa::raw::types::GlyphId16;
use skrifa::raw::{ReadError, TableProvider};
use skrifa::{FontRef, MetadataProvider, OutlineGlyphCollection, Tag};

static REGULAR: &[u8] = include_bytes!("../../../assets/fonts/LibertinusSerif-Regular.otf");
static ITALIC: &[u8] = include_bytes!("../../../assets/fonts/LibertinusSerif-Italic.otf");
static BOLD: &[u8] = include_bytes!("../../../assets/fonts/LibertinusSerif-Bold.otf");
static BOLD_ITALIC: &[u8] = include_bytes!("../../../assets/fonts/LibertinusSerif-BoldItalic.otf");

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
    characters: Charmap<'static>,
    outlines: OutlineGlyphCollection<'static>,
    metrics: GlyphMetrics<'static>,
    units_per_em: f64,
    kerning: Vec<PairPos<'static>>,
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
    let font = FontRef::new(bytes).expect("an embedded font is readable");
    // In the font's own units: nothing is scaled, hinted or varied here.
    let (size, place) = (Size::unscaled(), LocationRef::default());
    Loaded {
        characters: font.charmap(),
        outlines: font.outline_glyphs(),
        metrics: font.glyph_metrics(size, place),
        units_per_em: f64::from(font.metrics(size, place).units_per_em),
        kerning: kerning(&font).expect("an embedded font's kerning is readable"),
    }
}

/// The tables of pairs that the font's first feature "kern" names, in their order.
fn kerning(font: &FontRef<'static>) -> Result<Vec<PairPos<'static>>, ReadError> {
    let gpos = font.gpos()?;
    let (features, lookups) = (gpos.feature_list()?, gpos.lookup_list()?.lookups());
    let Some(record) = features.feature_records().iter().find(|f| f.feature_tag() == Tag::new(b"kern")) else {
        return Ok(Vec::new());
    };
    let mut tables = Vec::new();
    for index in record.feature(features.offset_data())?.lookup_list_indices() {
        if let PositionSubtables::Pair(pairs) = lookups.get(usize::from(index.get()))?.subtables()? {
            for pair in pairs.iter() {
                tables.push(pair?);
            }
        }
    }
    Ok(tables)
}

/// A glyph of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Glyph {
    /// The face it comes from.
    pub face: FontFace,
    id: GlyphId16,
}

/// The glyph of a character; signs that a face lacks come from the regular one. `None` if the family has no such sign.
pub fn glyph(face: FontFace, character: char) -> Option<Glyph> {
    [face, FontFace::Regular].into_iter().find_map(|face| {
        let id = loaded(face).characters.map(character)?;
        Some(Glyph { face, id: GlyphId16::try_from(id).ok()? })
    })
}

/// Advance width of a glyph as a share of the font size.
pub fn advance(glyph: Glyph) -> f64 {
    let font = loaded(glyph.face);
    f64::from(font.metrics.advance_width(glyph.id.into()).unwrap_or(0.0)) / font.units_per_em
}

/// Correction of the distance between two neighbouring glyphs as a share of the font size.
pub fn kern(left: Glyph, right: Glyph) -> f64 {
    if left.face != right.face {
        return 0.0;
    }
    let font = loaded(left.face);
    let adjustments = font.kerning.iter().filter_map(|pairs| adjustment(pairs, left.id, right.id)?.x_advance());
    let first = adjustments.into_iter().find(|advance| *advance != 0);
    f64::from(first.unwrap_or(0)) / font.units_per_em
}

/// What a table of pairs says about the left one of two glyphs.
fn adjustment(pairs: &PairPos<'static>, left: GlyphId16, right: GlyphId16) -> Option<ValueRecord<'static>> {
    match pairs {
        PairPos::Format1(single) => {
            let set = single.coverage().ok()?.get(left)?;
            let set = single.pair_sets().get(set as usize).ok()?;
            Some(*set.find_pair_value_record(right)?.value_record1())
        }
        PairPos::Format2(classes) => {
            classes.coverage().ok()?.get(left)?;
            let row = u16::try_from(classes.class_def1().ok()?.get(left)).ok()?;
            let column = u16::try_from(classes.class_def2().ok()?.get(right)).ok()?;
            let [first, _] = classes.value_record_refs(row, column)?;
            Some(first)
        }
        // For fonts of more than 65535 glyphs.
        PairPos::Format3(_) | PairPos::Format4(_) => None,
    }
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
    let mut collector = Collector { scale: font.units_per_em, last: [0.0; 2], strokes: Vec::new() };
    // A glyph without ink, such as a space, has no outline.
    if let Some(outline) = font.outlines.get(glyph.id.into()) {
        let settings = DrawSettings::unhinted(Size::unscaled(), LocationRef::default());
        // A test draws every glyph of every embedded font.
        let _ = outline.draw(settings, &mut collector);
    }
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

impl OutlinePen for Collector {
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
        let height = FontRef::new(REGULAR).unwrap().os2().unwrap().s_cap_height().unwrap();
        assert_eq!(f64::from(height) / loaded(FontFace::Regular).units_per_em, CAP_HEIGHT);
    }

    #[test]
    fn every_glyph_can_be_drawn() {
        for (face, least) in
            [(FontFace::Regular, 2000), (FontFace::Italic, 2000), (FontFace::Bold, 2000), (FontFace::BoldItalic, 1500)]
        {
            let mut drawn = 0;
            for (id, outline) in loaded(face).outlines.iter() {
                let mut collector = Collector { scale: 1.0, last: [0.0; 2], strokes: Vec::new() };
                let settings = DrawSettings::unhinted(Size::unscaled(), LocationRef::default());
                outline.draw(settings, &mut collector).unwrap_or_else(|e| panic!("{face:?} {id}: {e}"));
                drawn += 1;
            }
            assert!(drawn > least, "{face:?}: {drawn}");
        }
    }
}
