//! A [`Scene`] as SVG: whole-number relative paths in units, no font needed. Text is outlines; on
//! request its words are there a second time, unseen, for programs that search.

use std::fmt::Write as _;

use super::scene::{Item, Paint, Position, Scene, Segment, UNITS_PER_POINT};
use super::seal::Sealed;
use super::sheet::Colour;

/// Namespace of the provenance elements.
pub const NAMESPACE: &str = "urn:twofold:provenance";

/// Text with the characters that XML reserves replaced, and control characters (which XML forbids)
/// left out.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\n' => out.push_str("&#10;"),
            '\t' => out.push_str("&#9;"),
            '\r' => out.push_str("&#13;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => {}
            c => out.push(c),
        }
    }
    out
}

/// Writes a scene, with its words as invisible text if it is to be searchable.
pub fn write(
    scene: &Scene,
    title: &str,
    description: &str,
    provenance: &Sealed,
    searchable: bool,
) -> Vec<u8> {
    let mut out = String::with_capacity(1 << 16);
    let (w, h) = (scene.width(), scene.height());
    let points = |units: i32| decimal(i64::from(units) * 100 / i64::from(UNITS_PER_POINT));
    let _ = write!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}pt\" height=\"{}pt\" viewBox=\"0 0 \
            {w} {h}\" role=\"img\">\n\
         <title>{}</title>\n<desc>{}</desc>\n",
        points(w),
        points(h),
        escape(title),
        escape(description)
    );
    let _ = writeln!(out, "<metadata><provenance xmlns=\"{NAMESPACE}\">");
    for (key, value) in &provenance.entries {
        let _ = writeln!(out, "<entry key=\"{}\">{}</entry>", escape(key), escape(value));
    }
    let _ =
        writeln!(out, "</provenance></metadata>\n<path fill=\"#fff\" d=\"M0 0h{w}v{h}h-{w}z\"/>");
    out.push_str("<g fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n");
    for item in &scene.items {
        let mut pen = Pen { out: &mut out, at: (0, 0), last: b' ' };
        match item {
            Item::Fill { paint, path, .. } => {
                pen.raw(&format!(
                    "<path fill=\"{}\"{} d=\"",
                    hex(paint.colour),
                    opacity(paint, "fill")
                ));
                pen.segments(path);
            }
            Item::Stroke { paint, width, lines } => {
                let (colour, opacity) = (hex(paint.colour), opacity(paint, "stroke"));
                pen.raw(&format!(
                    "<path stroke=\"{colour}\"{opacity} stroke-width=\"{width}\" d=\""
                ));
                for line in lines {
                    pen.polyline(line);
                }
            }
            Item::Dots { paint, diameter, centres } => {
                // A point with a round cap is a disc: the shortest way to write many of them in one
                // path.
                let (colour, opacity) = (hex(paint.colour), opacity(paint, "stroke"));
                pen.raw(&format!(
                    "<path stroke=\"{colour}\"{opacity} stroke-width=\"{diameter}\" d=\""
                ));
                for c in centres {
                    pen.command(b'm', &[*c]);
                    pen.raw("h0");
                }
            }
        }
        out.push_str("\"/>\n");
    }
    out.push_str("</g>\n");
    if searchable {
        words(&mut out, scene);
    }
    out.push_str("</svg>\n");
    out.into_bytes()
}

/// The words, each stretched to the length of the outlines that it stands for, whatever font the
/// reader's program takes.
fn words(out: &mut String, scene: &Scene) {
    out.push_str("<g fill-opacity=\"0\" font-family=\"sans-serif\">\n");
    for words in scene.texts() {
        let ((x, y), size, length) = (words.from, words.size, words.length());
        let turned = if words.upwards() {
            format!(" transform=\"rotate(-90 {x} {y})\"")
        } else {
            String::new()
        };
        let _ = writeln!(
            out,
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" textLength=\"{length}\" \
                lengthAdjust=\"spacingAndGlyphs\"{turned}>{}</text>",
            escape(&words.text)
        );
    }
    out.push_str("</g>\n");
}

/// Hundredths as a decimal number without trailing zeros.
fn decimal(hundredths: i64) -> String {
    let text = format!("{}.{:02}", hundredths / 100, hundredths % 100);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn hex(c: Colour) -> String {
    format!("#{:02x}{:02x}{:02x}", c.r, c.g, c.b)
}

fn opacity(paint: &Paint, what: &str) -> String {
    if paint.opacity >= 100 {
        String::new()
    } else {
        format!(" {what}-opacity=\".{:02}\"", paint.opacity)
    }
}

struct Pen<'a> {
    out: &'a mut String,
    at: Position,
    last: u8,
}

impl Pen<'_> {
    fn raw(&mut self, text: &str) {
        self.out.push_str(text);
        self.last = b' ';
    }

    /// Writes a relative command; the letter is left out where it repeats, the blank where a minus
    /// sign separates.
    fn command(&mut self, letter: u8, points: &[Position]) {
        let mut separate = true;
        if letter != self.last {
            self.out.push(char::from(letter));
            separate = false;
        }
        for p in points {
            for d in [p.0 - self.at.0, p.1 - self.at.1] {
                if separate && d >= 0 {
                    self.out.push(' ');
                }
                push_int(self.out, d);
                separate = true;
            }
        }
        if let Some(end) = points.last() {
            self.at = *end;
        }
        self.last = letter;
    }

    fn polyline(&mut self, line: &[Position]) {
        let Some(first) = line.first() else { return };
        self.command(b'm', &[*first]);
        // After a move, further pairs are lines.
        let closed = line.len() > 3 && line.first() == line.last();
        let rest = if closed { &line[1..line.len() - 1] } else { &line[1..] };
        for p in rest {
            self.command(b'm', &[*p]);
        }
        if closed {
            self.raw("z");
            self.at = *first;
        } else {
            self.last = b' ';
        }
    }

    fn segments(&mut self, path: &[Segment]) {
        let mut start = (0, 0);
        for segment in path {
            match *segment {
                Segment::Move(p) => {
                    self.last = b' ';
                    self.command(b'm', &[p]);
                    self.last = b'l';
                    start = p;
                }
                Segment::Line(p) => self.command(b'l', &[p]),
                Segment::Cubic(a, b, p) => {
                    // All pairs of a curve are relative to its beginning.
                    let from = self.at;
                    if self.last == b'c' {
                        if a.0 - from.0 >= 0 {
                            self.out.push(' ');
                        }
                    } else {
                        self.out.push('c');
                    }
                    for (i, q) in [a, b, p].into_iter().enumerate() {
                        for (j, d) in [q.0 - from.0, q.1 - from.1].into_iter().enumerate() {
                            if (i, j) != (0, 0) && d >= 0 {
                                self.out.push(' ');
                            }
                            push_int(self.out, d);
                        }
                    }
                    (self.at, self.last) = (p, b'c');
                }
                Segment::Close => {
                    self.raw("z");
                    self.at = start;
                }
            }
        }
    }
}

fn push_int(out: &mut String, value: i32) {
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
        out.push('-');
    }
    for d in &digits[i..] {
        out.push(char::from(*d));
    }
}
