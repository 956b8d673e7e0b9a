//! The device-independent drawing: a list of filled paths, strokes, dots and set text in whole
//! units of 1/50 point.
//!
//! Everything that decides where ink lies happens before or in this list; the writers for PNG, SVG
//! and PDF only translate it. That is what makes the three files the same picture. Coordinates are
//! integers, six to a pixel at 600 dpi, so that the formats round alike and the vector files stay
//! small.

use super::sheet::Colour;

/// Units in a point.
pub const UNITS_PER_POINT: i32 = 50;
/// Units in a pixel at [`DPI`].
pub const UNITS_PER_PIXEL: i32 = 6;
/// Resolution of the bitmap.
pub const DPI: u32 = 600;

/// A position in units, y downwards from the upper left corner of the sheet.
pub type Position = (i32, i32);

/// Nearest whole number of units to a length in points.
pub fn units(points: f64) -> i32 {
    (points * f64::from(UNITS_PER_POINT)).round() as i32
}

/// A piece of an outline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Segment {
    /// Begins a contour.
    Move(Position),
    /// Straight line.
    Line(Position),
    /// Cubic Bezier curve with two control points.
    Cubic(Position, Position, Position),
    /// Ends the contour at its beginning.
    Close,
}

/// Colour and opacity (per cent).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Paint {
    /// Colour.
    pub colour: Colour,
    /// Opacity in per cent.
    pub opacity: u8,
}

/// The content and place of a text, for programs that search or read pictures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Words {
    /// The text without markup.
    pub text: String,
    /// Start of the baseline.
    pub from: Position,
    /// End of the baseline: to the right of its start, or above it.
    pub to: Position,
    /// Font size in units.
    pub size: i32,
}

impl Words {
    /// Length of the baseline.
    pub fn length(&self) -> i32 {
        (self.to.0 - self.from.0).abs().max((self.to.1 - self.from.1).abs())
    }

    /// Whether the text runs from bottom to top.
    pub fn upwards(&self) -> bool {
        self.to.1 < self.from.1
    }
}

/// Something drawn. An item is painted as a whole: where its parts overlap, opacity does not add
/// up.
#[derive(Clone, Debug)]
pub enum Item {
    /// Outlines filled by the non-zero rule: polygons and glyphs.
    Fill {
        /// Paint.
        paint: Paint,
        /// Outlines.
        path: Vec<Segment>,
        /// The text that the outlines are, if they are text.
        text: Option<Words>,
    },
    /// Polylines with round caps and joins.
    Stroke {
        /// Paint.
        paint: Paint,
        /// Width in units.
        width: i32,
        /// The polylines; first point repeated at the end means closed.
        lines: Vec<Vec<Position>>,
    },
    /// Filled discs of one size.
    Dots {
        /// Paint.
        paint: Paint,
        /// Diameter in units.
        diameter: i32,
        /// Centres.
        centres: Vec<Position>,
    },
}

/// A drawing of a certain size.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Width in pixels.
    pub width_px: u32,
    /// Height in pixels.
    pub height_px: u32,
    /// Items to draw, bottom to top.
    pub items: Vec<Item>,
}

impl Scene {
    /// An empty drawing.
    pub fn new(width_px: u32, height_px: u32) -> Self {
        Self { width_px, height_px, items: Vec::new() }
    }

    /// Width in units.
    pub fn width(&self) -> i32 {
        self.width_px as i32 * UNITS_PER_PIXEL
    }

    /// Height in units.
    pub fn height(&self) -> i32 {
        self.height_px as i32 * UNITS_PER_PIXEL
    }

    /// Adds a polygon, to the last item if that has the same paint. All polygons are turned the
    /// same way round, so that neighbours merge without a seam.
    pub fn polygon(&mut self, paint: Paint, mut corners: Vec<Position>) {
        corners.dedup();
        if corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        let area = signed_area(&corners);
        if corners.len() < 3 || area == 0 {
            return;
        }
        if area < 0 {
            corners.reverse();
        }
        let path = match self.items.last_mut() {
            Some(Item::Fill { paint: last, path, text: None }) if *last == paint => path,
            _ => {
                self.items.push(Item::Fill { paint, path: Vec::new(), text: None });
                let Some(Item::Fill { path, .. }) = self.items.last_mut() else { return };
                path
            }
        };
        path.push(Segment::Move(corners[0]));
        path.extend(corners[1..].iter().map(|c| Segment::Line(*c)));
        path.push(Segment::Close);
    }

    /// Adds a polyline, to the last item if that has the same paint and width.
    pub fn polyline(&mut self, paint: Paint, width: i32, mut line: Vec<Position>) {
        line.dedup();
        if line.len() == 1 {
            // A polyline that has shrunk to a point would be drawn by some renderers and not by
            // others.
            return self.dot(paint, width, line[0]);
        }
        if line.is_empty() {
            return;
        }
        if let Some(Item::Stroke { paint: p, width: w, lines }) = self.items.last_mut()
            && (*p, *w) == (paint, width)
        {
            lines.push(line);
            return;
        }
        self.items.push(Item::Stroke { paint, width, lines: vec![line] });
    }

    /// Adds a disc, to the last item if that has the same paint and size.
    pub fn dot(&mut self, paint: Paint, diameter: i32, centre: Position) {
        if let Some(Item::Dots { paint: p, diameter: d, centres }) = self.items.last_mut()
            && (*p, *d) == (paint, diameter)
        {
            centres.push(centre);
            return;
        }
        self.items.push(Item::Dots { paint, diameter, centres: vec![centre] });
    }

    /// Draws the contours of a path in white, as a margin for what is then filled. Curves are
    /// followed by four chords, so that no renderer has to stroke a curve.
    pub fn halo(&mut self, path: &[Segment], width: i32) {
        let paint = Paint { colour: super::style::WHITE, opacity: 85 };
        let mut contour: Vec<Position> = Vec::new();
        for segment in path {
            match *segment {
                Segment::Move(p) => contour = vec![p],
                Segment::Line(p) => contour.push(p),
                Segment::Cubic(a, b, p) => {
                    let from = contour.last().copied().unwrap_or(p);
                    for k in 1..=4i64 {
                        let (t, s) = (k, 4 - k);
                        let at = |f: fn(Position) -> i32| {
                            let [p0, p1, p2, p3] = [from, a, b, p].map(|q| i64::from(f(q)));
                            let sum = s * s * s * p0
                                + 3 * s * s * t * p1
                                + 3 * s * t * t * p2
                                + t * t * t * p3;
                            ((sum + 32).div_euclid(64)) as i32
                        };
                        contour.push((at(|q| q.0), at(|q| q.1)));
                    }
                }
                Segment::Close => {
                    if let Some(first) = contour.first().copied() {
                        contour.push(first);
                    }
                    self.polyline(paint, width, std::mem::take(&mut contour));
                }
            }
        }
    }

    /// The texts, in the order in which they are drawn.
    pub fn texts(&self) -> impl Iterator<Item = &Words> {
        self.items.iter().filter_map(|item| match item {
            Item::Fill { text, .. } => text.as_ref(),
            Item::Stroke { .. } | Item::Dots { .. } => None,
        })
    }

    /// Adds text that has been turned into outlines.
    pub fn text(&mut self, paint: Paint, path: Vec<Segment>, text: Words) {
        if !path.is_empty() {
            self.items.push(Item::Fill { paint, path, text: Some(text) });
        }
    }
}

fn signed_area(corners: &[Position]) -> i64 {
    let mut sum = 0i64;
    for (i, a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        sum += i64::from(a.0) * i64::from(b.1) - i64::from(b.0) * i64::from(a.1);
    }
    sum
}
