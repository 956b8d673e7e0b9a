//! A [`Scene`] as a one-page PDF, with no clock and no random identifier in it.
//!
//! Text is outlines, so that no font decides how it looks. Its words are there a second time,
//! unseen, in a font whose glyphs are all empty, so that a reader can search and copy them (ISO
//! 32000-1, 9.3.6: text rendering mode 3; 9.10.3: the map to Unicode).

use std::collections::BTreeMap;

use miniz_oxide::deflate::compress_to_vec_zlib;
use pdf_writer::types::{SystemInfo, UnicodeCmap};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr};

use super::scene::{Item, Paint, Position, Scene, Segment, UNITS_PER_POINT};
use super::seal::{SEAL_KEY, Sealed, to_ascii_json};

/// Key of the document information entry that holds the provenance as JSON.
pub const INFO_KEY: &str = "TwofoldProvenance";

/// Effort of compression; higher levels take several times as long for a quarter less.
const LEVEL: u8 = 1;

/// Name of the font of the unseen words.
const FONT: Name = Name(b"F");

/// Width of each of its empty glyphs, in thousandths of the font size.
const GLYPH_WIDTH: i64 = 500;

/// Writes a scene.
pub fn write(scene: &Scene, title: &str, description: &str, sealed: &Sealed) -> Vec<u8> {
    let [catalog, pages, page, contents, info, font, glyph, unicode] =
        [1, 2, 3, 4, 5, 6, 7, 8].map(Ref::new);
    let (w, h) = (
        scene.width() as f32 / UNITS_PER_POINT as f32,
        scene.height() as f32 / UNITS_PER_POINT as f32,
    );
    let mut pdf = Pdf::new();
    let mut root = pdf.catalog(catalog);
    root.pages(pages).lang(TextStr("en"));
    root.viewer_preferences().display_doc_title(true);
    root.finish();
    pdf.pages(pages).kids([page]).count(1);
    let opacities = opacities(scene);
    let mut leaf = pdf.page(page);
    leaf.parent(pages).media_box(Rect::new(0.0, 0.0, w, h)).contents(contents);
    let mut resources = leaf.resources();
    let mut states = resources.ext_g_states();
    for opacity in &opacities {
        let share = f32::from(*opacity) / 100.0;
        states
            .insert(Name(state(*opacity).as_bytes()))
            .start::<pdf_writer::writers::ExtGraphicsState>()
            .non_stroking_alpha(share)
            .stroking_alpha(share);
    }
    states.finish();
    let codes = codes(scene);
    if !codes.is_empty() {
        resources.fonts().pair(FONT, font);
    }
    resources.finish();
    leaf.finish();
    if !codes.is_empty() {
        invisible_font(&mut pdf, [font, glyph, unicode], &codes);
    }
    let mut operators = drawing(scene);
    words(&mut operators, scene, &codes);
    let stream = compress_to_vec_zlib(&operators, LEVEL);
    pdf.stream(contents, &stream).filter(Filter::FlateDecode);
    let mut details = pdf.document_info(info);
    details.title(TextStr(title)).subject(TextStr(description));
    details.creator(TextStr(concat!("twofold ", env!("CARGO_PKG_VERSION"))));
    let readable: Vec<String> = sealed.entries.iter().map(|(k, v)| format!("{k}={v}")).collect();
    let readable: Vec<String> = readable.into_iter().filter(|e| !e.starts_with(SEAL_KEY)).collect();
    details.keywords(TextStr(&readable.join("; ")));
    details
        .insert(Name(INFO_KEY.as_bytes()))
        .primitive(Str(to_ascii_json(&sealed.entries).as_bytes()));
    details.finish();
    pdf.finish()
}

/// A one-byte code for each character that is set, in the characters' order. The embedded fonts
/// have fewer characters than there are codes.
fn codes(scene: &Scene) -> BTreeMap<char, u8> {
    let mut characters: Vec<char> = scene.texts().flat_map(|w| w.text.chars()).collect();
    characters.sort_unstable();
    characters.dedup();
    characters.into_iter().zip(1..=u8::MAX).collect()
}

/// A font of type 3 in which every code is an empty glyph and stands for a character of Unicode.
fn invisible_font(pdf: &mut Pdf, [font, glyph, unicode]: [Ref; 3], codes: &BTreeMap<char, u8>) {
    let name = |code: u8| format!("g{code}");
    let last = codes.len() as u8;
    let mut description = pdf.type3_font(font);
    description
        .bbox(Rect::new(0.0, -200.0, GLYPH_WIDTH as f32, 800.0))
        .matrix([0.001, 0.0, 0.0, 0.001, 0.0, 0.0]);
    let mut procedures = description.char_procs();
    for code in 1..=last {
        procedures.pair(Name(name(code).as_bytes()), glyph);
    }
    procedures.finish();
    let names: Vec<String> = (1..=last).map(name).collect();
    description
        .encoding_custom()
        .differences()
        .consecutive(1, names.iter().map(|n| Name(n.as_bytes())));
    description.first_char(1).last_char(last).widths((1..=last).map(|_| GLYPH_WIDTH as f32));
    description.resources();
    description.to_unicode(unicode);
    description.finish();
    pdf.stream(glyph, format!("{GLYPH_WIDTH} 0 d0").as_bytes());
    let mut map = UnicodeCmap::<u8>::new(
        Name(b"Words"),
        SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"UCS"), supplement: 0 },
    );
    for (character, code) in codes {
        map.pair(*code, *character);
    }
    pdf.cmap(unicode, map.finish().as_slice());
}

/// The operators of the unseen words, each stretched to the length of the outlines that it stands
/// for.
fn words(out: &mut Vec<u8>, scene: &Scene, codes: &BTreeMap<char, u8>) {
    if codes.is_empty() {
        return;
    }
    out.extend_from_slice(b"BT\n3 Tr\n");
    for words in scene.texts() {
        let text: String = words
            .text
            .chars()
            .filter_map(|c| codes.get(&c))
            .map(|code| format!("{code:02x}"))
            .collect();
        let (x, y) = words.from;
        // The page's matrix has y downwards; the text's turns it up again.
        let matrix = if words.upwards() { "0 -1 -1 0" } else { "1 0 0 -1" };
        let natural = (text.len() as i64 / 2 * GLYPH_WIDTH * i64::from(words.size)).max(1);
        // Per cent, with two decimals.
        let stretch = (i64::from(words.length()) * 10_000_000 + natural / 2) / natural;
        let line = format!(
            "/F {} Tf {}.{:02} Tz {matrix} {x} {y} Tm <{text}> Tj\n",
            words.size,
            stretch / 100,
            stretch % 100
        );
        out.extend_from_slice(line.as_bytes());
    }
    out.extend_from_slice(b"ET\n");
}

fn paint_of(item: &Item) -> Paint {
    match item {
        Item::Fill { paint, .. } | Item::Stroke { paint, .. } | Item::Dots { paint, .. } => *paint,
    }
}

fn opacities(scene: &Scene) -> Vec<u8> {
    let mut all: Vec<u8> = scene.items.iter().map(|i| paint_of(i).opacity).chain([100]).collect();
    all.sort_unstable();
    all.dedup();
    all
}

fn state(opacity: u8) -> String {
    format!("A{opacity}")
}

/// The page's drawing operators. Coordinates are whole units; one matrix turns them into points
/// with y upwards.
fn drawing(scene: &Scene) -> Vec<u8> {
    let mut head = Content::new();
    let unit = 1.0 / UNITS_PER_POINT as f32;
    head.transform([unit, 0.0, 0.0, -unit, 0.0, scene.height() as f32 * unit]);
    let mut out = head.finish().into_vec();
    out.extend_from_slice(
        format!("\n1 J 1 j\n1 g 0 0 {} {} re f\n", scene.width(), scene.height()).as_bytes(),
    );
    let mut opacity = 100;
    for item in &scene.items {
        let paint = paint_of(item);
        if paint.opacity != opacity {
            opacity = paint.opacity;
            out.extend_from_slice(format!("/{} gs\n", state(opacity)).as_bytes());
        }
        let c = paint.colour;
        let colour = [c.r, c.g, c.b].map(component).join(" ");
        match item {
            Item::Fill { path, .. } => {
                out.extend_from_slice(format!("{colour} rg\n").as_bytes());
                for segment in path {
                    match *segment {
                        Segment::Move(p) => operator(&mut out, &[p], b"m\n"),
                        Segment::Line(p) => operator(&mut out, &[p], b"l\n"),
                        Segment::Cubic(a, b, p) => operator(&mut out, &[a, b, p], b"c\n"),
                        Segment::Close => out.extend_from_slice(b"h\n"),
                    }
                }
                out.extend_from_slice(b"f\n");
            }
            Item::Stroke { width, lines, .. } => {
                out.extend_from_slice(format!("{colour} RG {width} w\n").as_bytes());
                for line in lines {
                    let closed = line.len() > 3 && line.first() == line.last();
                    let drawn = if closed { &line[..line.len() - 1] } else { &line[..] };
                    for (i, p) in drawn.iter().enumerate() {
                        operator(&mut out, &[*p], if i == 0 { b"m\n" } else { b"l\n" });
                    }
                    if closed {
                        out.extend_from_slice(b"h\n");
                    }
                }
                out.extend_from_slice(b"S\n");
            }
            Item::Dots { diameter, centres, .. } => {
                out.extend_from_slice(format!("{colour} RG {diameter} w\n").as_bytes());
                for c in centres {
                    // ISO 32000-1, 8.5.3.2: a single-point closed path with round caps paints a
                    // disc.
                    operator(&mut out, &[*c], b"m h\n");
                }
                out.extend_from_slice(b"S\n");
            }
        }
    }
    out
}

/// A colour component as a share with three decimals, rounded in whole numbers.
fn component(value: u8) -> String {
    let thousandths = (u32::from(value) * 1000 + 127) / 255;
    if thousandths == 1000 { "1".to_owned() } else { format!(".{thousandths:03}") }
}

fn operator(out: &mut Vec<u8>, points: &[Position], name: &[u8]) {
    for p in points {
        for v in [p.0, p.1] {
            push_int(out, v);
            out.push(b' ');
        }
    }
    out.extend_from_slice(name);
}

fn push_int(out: &mut Vec<u8>, value: i32) {
    let mut digits = [0u8; 11];
    let mut n = value.unsigned_abs();
    let mut i = digits.len();
    loop {
        i -= 1;
        digits[i] = b'0' + (n % 10) as u8;
        n /= 10;
        if n == 0 {
            break;
        }
    }
    if value < 0 {
        out.push(b'-');
    }
    out.extend_from_slice(&digits[i..]);
}
