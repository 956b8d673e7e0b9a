//! Writes crates/render/fonts/glyphs.bin: advances, kerning and outlines of the fonts in
//! assets/fonts, as skrifa reads them. crates/render/src/font.rs says how the file is laid out.

use std::collections::BTreeMap;
use std::fs;

use skrifa::instance::{LocationRef, Size};
use skrifa::outline::{DrawSettings, OutlinePen};
use skrifa::raw::TableProvider;
use skrifa::raw::tables::gpos::{PairPos, PositionSubtables};
use skrifa::raw::types::GlyphId16;
use skrifa::{FontRef, GlyphId, MetadataProvider, Tag};

const FACES: [&str; 4] = ["Regular", "Italic", "Bold", "BoldItalic"];
const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../crates/render/fonts");

fn main() {
    let mut bytes = Vec::new();
    for face in FACES {
        let file = format!("{FOLDER}/LibertinusSerif-{face}.otf");
        let data = fs::read(&file).unwrap_or_else(|e| panic!("{file}: {e}"));
        let font = FontRef::new(&data).unwrap_or_else(|e| panic!("{file}: {e}"));
        let height = font.os2().unwrap().s_cap_height().unwrap();
        assert!(
            face != "Regular" || height == 658,
            "{file}: capitals of height {height}: change CAP_HEIGHT in crates/render/src/font.rs"
        );
        let table = face_table(&font);
        println!("{face}: {} bytes", table.len());
        bytes.extend(u32::try_from(table.len()).unwrap().to_le_bytes());
        bytes.extend(table);
    }
    fs::write(format!("{FOLDER}/glyphs.bin"), bytes).expect("the folder is writable");
}

fn face_table(font: &FontRef) -> Vec<u8> {
    let metrics = font.metrics(Size::unscaled(), LocationRef::default());
    let widths = font.glyph_metrics(Size::unscaled(), LocationRef::default());
    let characters: BTreeMap<u32, GlyphId> = font.charmap().mappings().collect();
    let glyphs: Vec<GlyphId> = characters.values().copied().collect();
    let pairs = kerning(font);
    let kern = |left, right| i16_of(kern(&pairs, left, right).into());
    // Characters that are kerned alike share a row, and a column, of the table of pairs.
    let (rows, row_of) =
        classes(glyphs.iter().map(|l| glyphs.iter().map(|r| kern(*l, *r)).collect()));
    let (columns, column_of) =
        classes((0..glyphs.len()).map(|r| rows.iter().map(|row| row[r]).collect()));
    let mut drawn: BTreeMap<GlyphId, usize> = BTreeMap::new();
    let mut outlines = Vec::new();
    let mut table = Vec::new();
    for count in [metrics.units_per_em.into(), characters.len(), rows.len(), columns.len()] {
        table.extend(u16::try_from(count).unwrap().to_le_bytes());
    }
    for (i, (character, glyph)) in characters.iter().enumerate() {
        let offset = *drawn.entry(*glyph).or_insert_with(|| {
            let start = outlines.len();
            outlines.extend(outline(font, *glyph));
            start
        });
        table.extend(character.to_le_bytes());
        table.extend(u32::try_from(offset).unwrap().to_le_bytes());
        table.extend(i16_of(widths.advance_width(*glyph).unwrap_or(0.0)).to_le_bytes());
        table.extend(
            [row_of[i], column_of[i]]
                .iter()
                .flat_map(|class| u16::try_from(*class).unwrap().to_le_bytes()),
        );
    }
    // Row after row.
    for row in 0..rows.len() {
        table.extend(columns.iter().flat_map(|column| column[row].to_le_bytes()));
    }
    table.extend(outlines);
    table
}

/// The different ones of these lists, in the order in which they come, and which of them each is.
fn classes(lists: impl Iterator<Item = Vec<i16>>) -> (Vec<Vec<i16>>, Vec<usize>) {
    let mut numbers: BTreeMap<Vec<i16>, usize> = BTreeMap::new();
    let mut different = Vec::new();
    let class_of = lists
        .map(|list| {
            *numbers.entry(list).or_insert_with_key(|list| {
                different.push(list.clone());
                different.len() - 1
            })
        })
        .collect();
    (different, class_of)
}

/// The tables of pairs that the font's first feature "kern" names, in their order.
fn kerning<'a>(font: &FontRef<'a>) -> Vec<PairPos<'a>> {
    let gpos = font.gpos().expect("a table of positions");
    let (features, lookups) = (gpos.feature_list().unwrap(), gpos.lookup_list().unwrap().lookups());
    let record = features.feature_records().iter().find(|f| f.feature_tag() == Tag::new(b"kern"));
    let feature = record.expect("a feature for kerning").feature(features.offset_data()).unwrap();
    let mut tables = Vec::new();
    for index in feature.lookup_list_indices() {
        if let PositionSubtables::Pair(pairs) =
            lookups.get(index.get().into()).unwrap().subtables().unwrap()
        {
            tables.extend(pairs.iter().map(Result::unwrap));
        }
    }
    tables
}

/// The first correction of an advance that is not zero.
fn kern(pairs: &[PairPos], left: GlyphId, right: GlyphId) -> i16 {
    let id = |glyph: GlyphId| GlyphId16::try_from(glyph).unwrap();
    let (left, right) = (id(left), id(right));
    let advance = |pairs: &PairPos| match pairs {
        PairPos::Format1(single) => {
            let set = single.coverage().unwrap().get(left)?;
            let set = single.pair_sets().get(set as usize).unwrap();
            set.find_pair_value_record(right)?.value_record1().x_advance()
        }
        PairPos::Format2(classes) => {
            classes.coverage().unwrap().get(left)?;
            let row = u16::try_from(classes.class_def1().unwrap().get(left)).unwrap();
            let column = u16::try_from(classes.class_def2().unwrap().get(right)).unwrap();
            let [first, _] = classes.value_record_refs(row, column)?;
            first.x_advance()
        }
        _ => panic!("a table of pairs for fonts of more than 65535 glyphs"),
    };
    pairs.iter().filter_map(advance).find(|advance| *advance != 0).unwrap_or(0)
}

fn outline(font: &FontRef, glyph: GlyphId) -> Vec<u8> {
    let mut pen = Pen { bytes: Vec::new(), last: [0; 2] };
    // A glyph without ink, such as a space, has no outline.
    if let Some(outline) = font.outline_glyphs().get(glyph) {
        outline
            .draw(DrawSettings::unhinted(Size::unscaled(), LocationRef::default()), &mut pen)
            .unwrap();
    }
    pen.bytes.push(b'.');
    pen.bytes
}

/// Strokes as letters, each with its points relative to the point before.
struct Pen {
    bytes: Vec<u8>,
    last: [i16; 2],
}

impl Pen {
    fn stroke(&mut self, letter: u8, points: &[(f32, f32)]) {
        self.bytes.push(letter);
        for (x, y) in points {
            let point = [i16_of(*x), i16_of(*y)];
            for (to, from) in point.into_iter().zip(self.last) {
                // One byte, or three that begin with the smallest.
                match i8::try_from(to - from) {
                    Ok(step) if step != i8::MIN => self.bytes.extend(step.to_le_bytes()),
                    _ => {
                        self.bytes.extend(i8::MIN.to_le_bytes());
                        self.bytes.extend((to - from).to_le_bytes());
                    }
                }
            }
            self.last = point;
        }
    }
}

impl OutlinePen for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.stroke(b'M', &[(x, y)]);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.stroke(b'L', &[(x, y)]);
    }

    fn quad_to(&mut self, _: f32, _: f32, _: f32, _: f32) {
        panic!("a quadratic curve: these are OpenType fonts with cubic ones");
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.stroke(b'C', &[(x1, y1), (x2, y2), (x, y)]);
    }

    fn close(&mut self) {
        self.stroke(b'Z', &[]);
    }
}

/// A number of font units, which is whole.
fn i16_of(x: f32) -> i16 {
    assert!(x.fract() == 0.0 && x.abs() < 16384.0, "{x} font units");
    x as i16
}
