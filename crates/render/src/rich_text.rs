//! Rich text: variables, superscripts and subscripts, set in the embedded font.
//!
//! The markup is [`markup`](super::markup)'s.

use super::font::{self, FontFace, Glyph, Stroke};
use super::markup::{self, MarkupError, Token};
use super::scene::{Position, Segment, units};

/// Why a text cannot be set.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RichTextError {
    /// Braces do not match.
    #[error("in the text {text:?}: unbalanced braces; write \\{{ for a brace")]
    Braces {
        /// The text.
        text: String,
    },
    /// The embedded font lacks a character.
    #[error("in the text {text:?}: the embedded font has no glyph for {character:?}")]
    Glyph {
        /// The text.
        text: String,
        /// The character.
        character: char,
    },
    /// An italic passage is not closed.
    #[error("in the text {text:?}: an asterisk without its partner; write \\* for an asterisk")]
    Italic {
        /// The text.
        text: String,
    },
}

impl RichTextError {
    /// The text.
    pub fn text(&self) -> &str {
        match self {
            Self::Braces { text } | Self::Glyph { text, .. } | Self::Italic { text } => text,
        }
    }
}

/// Size of superscripts and subscripts relative to the text around them.
const SCRIPT_SIZE: f64 = 0.70;
/// Height by which a superscript is raised, relative to the size of the text around it.
const RAISE: f64 = 0.36;
/// Depth by which a subscript is lowered, relative to the same size.
const LOWER: f64 = 0.17;

#[derive(Clone, Copy, Debug)]
struct Placed {
    glyph: Glyph,
    x: f64,
    y: f64,
    scale: f64,
}

/// A line of text, set: glyphs placed relative to the start of the baseline at font size one.
#[derive(Clone, Debug)]
pub struct Line {
    glyphs: Vec<Placed>,
    /// Width as a share of the font size.
    pub width: f64,
    /// The text without markup.
    pub plain: String,
}

struct Setter<'a> {
    source: &'a str,
    italic: bool,
    base: FontFace,
    pen: f64,
    previous: Option<Glyph>,
    line: Line,
}

/// Sets a line of rich text in the given face.
pub fn set(source: &str, base: FontFace) -> Result<Line, RichTextError> {
    let tokens = markup::parse(source).map_err(|fault| match fault {
        MarkupError::Braces => RichTextError::Braces { text: source.to_owned() },
        MarkupError::Italic => RichTextError::Italic { text: source.to_owned() },
    })?;
    let mut setter = Setter {
        source,
        italic: false,
        base,
        pen: 0.0,
        previous: None,
        line: Line { glyphs: Vec::new(), width: 0.0, plain: String::new() },
    };
    setter.set(&tokens)?;
    setter.line.width = setter.pen;
    Ok(setter.line)
}

/// A script or group that is open: the size and rise of what surrounds it, and whether it is a
/// script.
struct Around {
    scale: f64,
    rise: f64,
    script: bool,
}

impl Setter<'_> {
    fn set(&mut self, tokens: &[Token]) -> Result<(), RichTextError> {
        let (mut scale, mut rise) = (1.0, 0.0);
        let mut open: Vec<Around> = Vec::new();
        for token in tokens {
            match token {
                Token::Sign(c) => self.place(*c, scale, rise)?,
                Token::Minus => self.place('\u{2212}', scale, rise)?,
                Token::Italic => self.italic = !self.italic,
                Token::Raise | Token::Lower => {
                    open.push(Around { scale, rise, script: true });
                    (scale, rise) = match token {
                        Token::Raise => (scale * SCRIPT_SIZE, rise + RAISE * scale),
                        _ => (scale * SCRIPT_SIZE, rise - LOWER * scale),
                    };
                    self.previous = None;
                    self.pen += 0.02 * scale;
                    self.line.plain.push(if *token == Token::Raise { '^' } else { '_' });
                }
                Token::Group => open.push(Around { scale, rise, script: false }),
                Token::End => {
                    let Some(around) = open.pop() else { continue };
                    if around.script {
                        self.pen += 0.04 * scale;
                        self.previous = None;
                    }
                    (scale, rise) = (around.scale, around.rise);
                }
            }
        }
        Ok(())
    }

    fn place(&mut self, c: char, scale: f64, rise: f64) -> Result<(), RichTextError> {
        let face = match (self.italic, self.base) {
            (true, FontFace::Bold) => FontFace::BoldItalic,
            (true, _) => FontFace::Italic,
            (false, base) => base,
        };
        let glyph = font::glyph(face, c)
            .ok_or_else(|| RichTextError::Glyph { text: self.source.to_owned(), character: c })?;
        if let Some(previous) = self.previous {
            self.pen += font::kern(previous, glyph) * scale;
            let leans = |g: Glyph| matches!(g.face, FontFace::Italic | FontFace::BoldItalic);
            if leans(previous) && !leans(glyph) && !c.is_whitespace() {
                // Italic correction: a leaning letter must not touch an upright neighbour.
                self.pen += 0.035 * scale;
            }
        }
        self.line.glyphs.push(Placed { glyph, x: self.pen, y: rise, scale });
        self.pen += font::advance(glyph) * scale;
        self.previous = Some(glyph);
        self.line.plain.push(c);
        Ok(())
    }
}

/// Direction in which a line runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// Left to right.
    Level,
    /// Bottom to top.
    Upwards,
}

impl Line {
    /// Outlines of the line at a font size in points, its baseline starting at `origin`.
    pub fn outlines(&self, size: f64, origin: Position, turn: Turn) -> Vec<Segment> {
        let mut path = Vec::new();
        for placed in &self.glyphs {
            let at = |p: [f64; 2]| {
                let x = units(size * (placed.x + placed.scale * p[0]));
                let y = units(size * (placed.y + placed.scale * p[1]));
                match turn {
                    Turn::Level => (origin.0 + x, origin.1 - y),
                    Turn::Upwards => (origin.0 - y, origin.1 - x),
                }
            };
            path.extend(font::outline(placed.glyph).into_iter().map(|stroke| match stroke {
                Stroke::Move(p) => Segment::Move(at(p)),
                Stroke::Line(p) => Segment::Line(at(p)),
                Stroke::Cubic(a, b, p) => Segment::Cubic(at(a), at(b), at(p)),
                Stroke::Close => Segment::Close,
            }));
        }
        path
    }
}

/// Width in points of a text at a font size, or zero for a text that cannot be set (which drawing
/// it then reports).
pub fn width(source: &str, face: FontFace, size: f64) -> f64 {
    set(source, face).map_or(0.0, |line| line.width * size)
}

/// Breaks a text at spaces outside braces, but for those beside an equals sign, into lines no wider
/// than `limit` points. A single long word stays whole. An italic passage must not contain a break;
/// each line has to be complete markup, so a break inside one is not taken.
pub fn wrap(source: &str, face: FontFace, size: f64, limit: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut current = String::new();
    let joined = source.replace(" = ", "\u{a0}=\u{a0}");
    for word in joined.split(' ') {
        let longer = if current.is_empty() { word.to_owned() } else { format!("{current} {word}") };
        let complete = current.is_empty() || set(&current, face).is_ok();
        let fits = set(&longer, face).map_or(true, |line| line.width * size <= limit);
        if fits || !complete || current.is_empty() {
            current = longer;
        } else {
            lines.push(std::mem::replace(&mut current, word.to_owned()));
        }
    }
    lines.push(current);
    lines.into_iter().map(|line| line.replace('\u{a0}', " ")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(source: &str) -> String {
        set(source, FontFace::Regular).unwrap().plain
    }

    #[test]
    fn hyphens_become_minus_signs_only_where_a_number_is_meant() {
        assert_eq!(plain("-3.5"), "\u{2212}3.5");
        assert_eq!(plain("10^{-3}"), "10^\u{2212}3");
        assert_eq!(plain("*v*_-"), "v_\u{2212}");
        assert_eq!(plain("a - b"), "a \u{2212} b");
        assert_eq!(plain("two-fold, 2-10"), "two-fold, 2-10");
        assert_eq!(plain("(-1, 2)"), "(\u{2212}1, 2)");
    }

    #[test]
    fn scripts_are_smaller_raised_and_lowered() {
        let line = set("x^{2}y_{3}", FontFace::Regular).unwrap();
        let [x, two, y, three] = line.glyphs[..] else { panic!("{line:?}") };
        assert_eq!((x.scale, x.y, y.y), (1.0, 0.0, 0.0));
        assert!(two.scale < 0.8 && two.y > 0.2 && three.y < -0.1);
        assert!(x.x < two.x && two.x < y.x && y.x < three.x);
    }

    #[test]
    fn italics_change_the_face_and_end_again() {
        let line = set("*x* = 1", FontFace::Regular).unwrap();
        assert_eq!(line.glyphs[0].glyph.face, FontFace::Italic);
        assert!(line.glyphs[1..].iter().all(|g| g.glyph.face == FontFace::Regular));
    }

    #[test]
    fn faulty_markup_is_named() {
        assert!(matches!(set("a_{b", FontFace::Regular), Err(RichTextError::Braces { .. })));
        assert!(matches!(set("a}", FontFace::Regular), Err(RichTextError::Braces { .. })));
        assert!(matches!(set("a^", FontFace::Regular), Err(RichTextError::Braces { .. })));
        assert!(matches!(set("*a", FontFace::Regular), Err(RichTextError::Italic { .. })));
        assert!(matches!(
            set("\u{4e2d}", FontFace::Regular),
            Err(RichTextError::Glyph { character: '\u{4e2d}', .. })
        ));
        assert_eq!(plain("\\*\\{\\_"), "*{_");
    }

    #[test]
    fn wrapping_keeps_every_word_and_the_limit() {
        let text = "reading printed, *α* = 10^{-3}, *β* = 10^{-5}, *ε* = 10^{-3}, *t* = 2×10^{5}, \
            restart every 20";
        let lines = wrap(text, FontFace::Regular, 7.0, 120.0);
        assert!(lines.len() > 1);
        assert_eq!(lines.join(" "), text);
        assert!(lines.iter().all(|l| width(l, FontFace::Regular, 7.0) <= 120.0));
    }

    #[test]
    fn lines_do_not_break_beside_an_equals_sign() {
        let text = "*F* = 25, *q* = 1, *V* = 2";
        for limit in 10..90 {
            let lines = wrap(text, FontFace::Regular, 8.0, f64::from(limit));
            assert_eq!(lines.join(" "), text);
            let whole = |line: &String| {
                line.trim_end_matches(',').split(", ").all(|part| part.contains(" = "))
            };
            assert!(lines.iter().all(whole), "{lines:?}");
        }
        assert_eq!(wrap(text, FontFace::Regular, 8.0, 10.0).len(), 3);
    }
}
