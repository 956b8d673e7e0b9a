//! A [`Scene`] as a one-page PDF, with no clock and no random identifier in it.

use miniz_oxide::deflate::compress_to_vec_zlib;
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr};

use super::scene::{Item, Paint, Position, Scene, Segment, UNITS_PER_POINT};
use super::seal::{SEAL_KEY, Sealed, to_ascii_json};

/// Key of the document information entry that holds the provenance as JSON.
pub const INFO_KEY: &str = "TwofoldProvenance";

/// Effort of compression; higher levels take several times as long for a quarter less.
const LEVEL: u8 = 1;

/// Writes a scene.
pub fn write(scene: &Scene, title: &str, description: &str, sealed: &Sealed) -> Vec<u8> {
    let [catalog, pages, page, contents, info] = [1, 2, 3, 4, 5].map(Ref::new);
    let (w, h) = (scene.width() as f32 / UNITS_PER_POINT as f32, scene.height() as f32 / UNITS_PER_POINT as f32);
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
    resources.finish();
    leaf.finish();
    let stream = compress_to_vec_zlib(&drawing(scene), LEVEL);
    pdf.stream(contents, &stream).filter(Filter::FlateDecode);
    let mut details = pdf.document_info(info);
    details.title(TextStr(title)).subject(TextStr(description));
    details.creator(TextStr(concat!("twofold ", env!("CARGO_PKG_VERSION"))));
    let readable: Vec<String> = sealed.entries.iter().map(|(k, v)| format!("{k}={v}")).collect();
    let readable: Vec<String> = readable.into_iter().filter(|e| !e.starts_with(SEAL_KEY)).collect();
    details.keywords(TextStr(&readable.join("; ")));
    details.insert(Name(INFO_KEY.as_bytes())).primitive(Str(to_ascii_json(&sealed.entries).as_bytes()));
    details.finish();
    pdf.finish()
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

/// The page's drawing operators. Coordinates are whole units; one matrix turns them into points with y upwards.
fn drawing(scene: &Scene) -> Vec<u8> {
    let mut head = Content::new();
    let unit = 1.0 / UNITS_PER_POINT as f32;
    head.transform([unit, 0.0, 0.0, -unit, 0.0, scene.height() as f32 * unit]);
    let mut out = head.finish().into_vec();
    out.extend_from_slice(format!("\n1 J 1 j\n1 g 0 0 {} {} re f\n", scene.width(), scene.height()).as_bytes());
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
                    // ISO 32000-1, 8.5.3.2: a single-point closed path with round caps paints a disc.
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
