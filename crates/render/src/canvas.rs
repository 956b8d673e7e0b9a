//! Drawing with plotters on the sheet's fine canvas: text, shapes and markers by place, series by
//! data.

use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::RenderError;
use super::backend::{HALO_FAMILY, SceneBackend};
use super::density;
use super::font::CAP_HEIGHT;
use super::polyline;
use super::rich_text::{self, RichTextError};
use super::scene::{Position, UNITS_PER_POINT, units};
use super::sheet::{
    Anchor, Colour, Dash, DotStyle, LegendEntry, LegendKey, LineStyle, MarkerShape, MarkerStyle,
    Note,
};
use super::style;
use super::{font::FontFace, sheet::Corner};
use twofold_num::elementary;

/// Tolerance of thinning in units: an eighth of a pixel.
pub const THINNING: f64 = 1.5;

type DrawError = DrawingAreaErrorKind<RichTextError>;

impl From<DrawError> for RenderError {
    fn from(error: DrawError) -> Self {
        match error {
            DrawingAreaErrorKind::BackendError(
                plotters_backend::DrawingErrorKind::DrawingError(e),
            ) => Self::Text(e),
            other => Self::Drawing(other.to_string()),
        }
    }
}

/// A rectangle on the sheet, in units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// Left edge.
    pub x: i32,
    /// Upper edge.
    pub y: i32,
    /// Width.
    pub w: i32,
    /// Height.
    pub h: i32,
}

impl Rect {
    /// Right edge.
    pub fn right(self) -> i32 {
        self.x + self.w
    }

    /// Lower edge.
    pub fn bottom(self) -> i32 {
        self.y + self.h
    }

    /// Whether two rectangles share area.
    pub fn overlaps(self, other: Self) -> bool {
        self.x < other.right()
            && other.x < self.right()
            && self.y < other.bottom()
            && other.y < self.bottom()
    }
}

/// A plotters axis that is linear in what it is given and rounds to the nearest unit.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// Value at the lower end.
    pub lower: f64,
    /// Value at the upper end.
    pub upper: f64,
}

impl Ranged for Span {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value - self.lower) / (self.upper - self.lower);
        // Nothing is drawn a hundred sheets away; the bound keeps integer arithmetic safe.
        (f64::from(limit.0) + share * f64::from(limit.1 - limit.0)).round().clamp(-1e7, 1e7) as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        // Ticks are placed by `ticks`; plotters' own placement calls the platform's logarithm.
        Vec::new()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.lower..self.upper
    }
}

/// Typesetting options of a text.
#[derive(Clone, Copy)]
pub struct TextFormat {
    /// Size in points.
    pub size: f64,
    /// Colour.
    pub colour: Colour,
    /// Whether it is bold.
    pub bold: bool,
    /// Whether it runs upwards.
    pub upwards: bool,
    /// Whether the letters have a white margin.
    pub halo: bool,
    /// Horizontal anchor.
    pub h: HPos,
    /// Vertical anchor; `Bottom` is the baseline.
    pub v: VPos,
}

impl TextFormat {
    /// Text of this size, anchored by the left end of its baseline.
    pub fn new(size: f64) -> Self {
        Self {
            size,
            colour: style::INK,
            bold: false,
            upwards: false,
            halo: false,
            h: HPos::Left,
            v: VPos::Bottom,
        }
    }

    /// With another colour.
    pub fn colour(mut self, colour: Colour) -> Self {
        self.colour = colour;
        self
    }

    /// With another anchor.
    pub fn anchor(mut self, h: HPos, v: VPos) -> Self {
        (self.h, self.v) = (h, v);
        self
    }

    /// Bold.
    pub fn bold(mut self) -> Self {
        self.bold = true;
        self
    }

    /// With a white margin around the letters.
    pub fn halo(mut self) -> Self {
        self.halo = true;
        self
    }

    /// Running upwards.
    pub fn upwards(mut self) -> Self {
        self.upwards = true;
        self
    }
}

/// Width of a text in units.
pub fn text_width(text: &str, size: f64) -> i32 {
    units(rich_text::width(text, FontFace::Regular, size))
}

fn rgba(colour: Colour, opacity: u8) -> RGBAColor {
    RGBAColor(colour.r, colour.g, colour.b, f64::from(opacity.min(100)) / 100.0)
}

/// The sheet as a plotters drawing area.
pub struct Canvas<'a> {
    area: DrawingArea<SceneBackend<'a>, Shift>,
}

impl<'a> Canvas<'a> {
    /// Draws through the given backend.
    pub fn new(backend: SceneBackend<'a>) -> Self {
        Self { area: backend.into_drawing_area() }
    }

    /// Sets a text.
    pub fn text(&self, text: &str, at: Position, how: TextFormat) -> Result<(), RenderError> {
        if text.is_empty() {
            return Ok(());
        }
        let face = if how.bold { FontStyle::Bold } else { FontStyle::Normal };
        let family = if how.halo { HALO_FAMILY } else { "serif" };
        let mut font = (family, how.size * f64::from(UNITS_PER_POINT), face).into_font();
        if how.upwards {
            font = font.transform(FontTransform::Rotate270);
        }
        let colour = rgba(how.colour, 100);
        let style = TextStyle::from(font).color(&colour).pos(Pos::new(how.h, how.v));
        Ok(self.area.draw(&Text::new(text.to_owned(), at, style))?)
    }

    /// Draws a solid polyline.
    pub fn line(&self, points: &[Position], colour: Colour, width: f64) -> Result<(), RenderError> {
        Ok(self.area.draw(&PathElement::new(
            points.to_vec(),
            rgba(colour, 100).stroke_width(stroke(width)),
        ))?)
    }

    /// Draws a polyline in a style.
    pub fn styled_line(&self, points: &[Position], look: &LineStyle) -> Result<(), RenderError> {
        let places: Vec<[f64; 2]> =
            points.iter().map(|p| [f64::from(p.0), f64::from(p.1)]).collect();
        for part in dashed(&places, look) {
            let part: Vec<Position> =
                part.iter().map(|p| (p[0].round() as i32, p[1].round() as i32)).collect();
            self.area.draw(&PathElement::new(
                part,
                rgba(look.colour, look.opacity).stroke_width(stroke(look.width)),
            ))?;
        }
        Ok(())
    }

    /// Fills a polygon.
    pub fn polygon(
        &self,
        corners: Vec<Position>,
        colour: Colour,
        opacity: u8,
    ) -> Result<(), RenderError> {
        Ok(self.area.draw(&Polygon::new(corners, rgba(colour, opacity)))?)
    }

    /// Fills a rectangle.
    pub fn fill(&self, rect: Rect, colour: Colour, opacity: u8) -> Result<(), RenderError> {
        self.polygon(
            vec![
                (rect.x, rect.y),
                (rect.right(), rect.y),
                (rect.right(), rect.bottom()),
                (rect.x, rect.bottom()),
            ],
            colour,
            opacity,
        )
    }

    fn disc(&self, at: Position, diameter: i32, colour: Colour) -> Result<(), RenderError> {
        Ok(self.area.draw(&Circle::new(at, diameter / 2, rgba(colour, 100).filled()))?)
    }

    /// Draws a marker. Filled shapes have a thin white rim, so that they stand off curves under
    /// them.
    pub fn marker(&self, at: Position, look: &MarkerStyle) -> Result<(), RenderError> {
        let size = units(look.size);
        let rim = units(0.5);
        let corner = |angle: f64, radius: f64| {
            let turn = angle * std::f64::consts::PI / 180.0;
            (
                at.0 + (radius * elementary::cos(turn)).round() as i32,
                at.1 - (radius * elementary::sin(turn)).round() as i32,
            )
        };
        let radius = f64::from(size) / 2.0;
        let rimmed = |shape: &dyn Fn(f64) -> Vec<Position>| -> Result<(), RenderError> {
            self.polygon(shape(radius + 1.6 * f64::from(rim)), style::WHITE, 100)?;
            self.polygon(shape(radius), look.colour, 100)
        };
        match look.shape {
            MarkerShape::Dot => {
                self.disc(at, size + 2 * rim, style::WHITE)?;
                self.disc(at, size, look.colour)
            }
            MarkerShape::OpenDot => {
                self.disc(at, size, look.colour)?;
                self.disc(at, size - 2 * units(0.9), style::WHITE)
            }
            MarkerShape::Cross => {
                let d = (radius * 0.75).round() as i32;
                for (colour, width) in [(style::WHITE, 2.4), (look.colour, 1.2)] {
                    self.line(&[(at.0 - d, at.1 - d), (at.0 + d, at.1 + d)], colour, width)?;
                    self.line(&[(at.0 - d, at.1 + d), (at.0 + d, at.1 - d)], colour, width)?;
                }
                Ok(())
            }
            MarkerShape::Star => rimmed(&|r| {
                (0..10)
                    .map(|k| {
                        corner(
                            90.0 + 36.0 * f64::from(k),
                            if k % 2 == 0 { 1.25 * r } else { 0.52 * r },
                        )
                    })
                    .collect()
            }),
            MarkerShape::Square => {
                rimmed(&|r| (0..4).map(|k| corner(45.0 + 90.0 * f64::from(k), 1.2 * r)).collect())
            }
            MarkerShape::Triangle => {
                rimmed(&|r| (0..3).map(|k| corner(90.0 + 120.0 * f64::from(k), 1.25 * r)).collect())
            }
        }
    }

    /// Fills an arrow head at the end of a polyline.
    pub fn arrow_head(&self, points: &[Position], look: &LineStyle) -> Result<(), RenderError> {
        let Some(&tip) = points.last() else { return Ok(()) };
        let length =
            f64::from(units(style::ARROW_PT)) * (look.width / style::CURVE_PT).clamp(0.8, 2.0);
        // The direction is taken over the length of the head, so that a last short segment does not
        // turn it.
        let tail = points.iter().rev().find(|p| {
            let (dx, dy) = (f64::from(p.0 - tip.0), f64::from(p.1 - tip.1));
            dx * dx + dy * dy >= 0.5 * length * length
        });
        let Some(tail) = tail.or(points.first()) else { return Ok(()) };
        let (dx, dy) = (f64::from(tip.0 - tail.0), f64::from(tip.1 - tail.1));
        let norm = (dx * dx + dy * dy).sqrt();
        if norm == 0.0 {
            return Ok(());
        }
        let (dx, dy) = (dx / norm, dy / norm);
        let at = |along: f64, aside: f64| {
            (
                tip.0 + (length * (aside * dy - along * dx)).round() as i32,
                tip.1 - (length * (aside * dx + along * dy)).round() as i32,
            )
        };
        self.polygon(
            vec![at(-0.25, 0.0), at(0.75, 0.36), at(0.55, 0.0), at(0.75, -0.36)],
            look.colour,
            look.opacity,
        )
    }

    /// The rectangle of a note's capitals at a place on the sheet.
    pub fn note_rect<P>(note: &Note<P>, at: Position) -> Rect {
        let width = text_width(&note.text, note.size);
        let (cap, gap) = (units(CAP_HEIGHT * note.size), units(0.45 * note.size));
        let (x, baseline) = match note.anchor {
            Anchor::Left => (at.0 + gap, at.1 + cap / 2),
            Anchor::Right => (at.0 - gap - width, at.1 + cap / 2),
            Anchor::Centre => (at.0 - width / 2, at.1 + cap / 2),
            Anchor::Above => (at.0 - width / 2, at.1 - gap),
            Anchor::Below => (at.0 - width / 2, at.1 + gap + cap),
        };
        Rect { x, y: baseline - cap, w: width, h: cap }
    }

    /// Sets a note at a place on the sheet.
    pub fn note<P>(&self, note: &Note<P>, at: Position) -> Result<(), RenderError> {
        let rect = Self::note_rect(note, at);
        let how = TextFormat::new(note.size).colour(note.colour).halo();
        self.text(&note.text, (rect.x, rect.bottom()), how)
    }

    /// Width of a legend entry.
    fn entry_width(entry: &LegendEntry) -> i32 {
        units(KEY_PT + KEY_GAP_PT) + text_width(&entry.text, style::TICK_PT)
    }

    fn entry(&self, entry: &LegendEntry, x: i32, middle: i32) -> Result<(), RenderError> {
        let key = units(KEY_PT);
        let centre = (x + key / 2, middle);
        let ends = [(x, middle), (x + key, middle)];
        match entry.key {
            LegendKey::Line(look) => self.styled_line(&ends, &look)?,
            LegendKey::LineMarker(look, marker) => {
                self.styled_line(&ends, &look)?;
                self.marker(centre, &marker)?;
            }
            LegendKey::Dots(look) => {
                let d = units(look.diameter.unwrap_or(2.0).max(2.0));
                for dx in [-key / 3, 0, key / 3] {
                    self.disc((centre.0 + dx, middle), d, look.colour)?;
                }
            }
            LegendKey::Marker(marker) => self.marker(centre, &marker)?,
            LegendKey::Area(colour, opacity) => {
                let h = units(6.0);
                self.fill(
                    Rect { x: x + key / 6, y: middle - h / 2, w: key * 2 / 3, h },
                    colour,
                    opacity,
                )?;
            }
        }
        let how = TextFormat::new(style::TICK_PT).anchor(HPos::Left, VPos::Center);
        self.text(&entry.text, (x + key + units(KEY_GAP_PT), middle), how)
    }

    /// Draws a legend into a corner of a rectangle.
    pub fn legend(
        &self,
        entries: &[LegendEntry],
        rect: Rect,
        corner: Corner,
    ) -> Result<(), RenderError> {
        let Some(widest) = entries.iter().map(Self::entry_width).max() else { return Ok(()) };
        let (leading, pad, inset) = (units(style::TICK_PT * 1.35), units(3.0), units(4.0));
        let (w, h) = (widest + 2 * pad, leading * entries.len() as i32 + 2 * pad - leading / 5);
        let x = match corner {
            Corner::UpperLeft | Corner::LowerLeft => rect.x + inset,
            Corner::UpperRight | Corner::LowerRight => rect.right() - inset - w,
        };
        let y = match corner {
            Corner::UpperLeft | Corner::UpperRight => rect.y + inset,
            Corner::LowerLeft | Corner::LowerRight => rect.bottom() - inset - h,
        };
        self.fill(Rect { x, y, w, h }, style::WHITE, 85)?;
        for (i, entry) in entries.iter().enumerate() {
            self.entry(entry, x + pad, y + pad + leading * i as i32 + leading * 2 / 5)?;
        }
        Ok(())
    }

    /// Rows into which a shared legend falls at a width.
    pub fn legend_rows(entries: &[LegendEntry], width: i32) -> Vec<Vec<LegendEntry>> {
        let mut rows: Vec<Vec<LegendEntry>> = Vec::new();
        let mut used = 0;
        for entry in entries {
            let w = Self::entry_width(entry) + units(ENTRY_GAP_PT);
            if rows.is_empty() || used + w - units(ENTRY_GAP_PT) > width {
                rows.push(Vec::new());
                used = 0;
            }
            used += w;
            if let Some(row) = rows.last_mut() {
                row.push(entry.clone());
            }
        }
        rows
    }

    /// Draws one row of a shared legend, centred.
    pub fn legend_row(
        &self,
        row: &[LegendEntry],
        left: i32,
        width: i32,
        middle: i32,
    ) -> Result<(), RenderError> {
        let gap = units(ENTRY_GAP_PT);
        let total: i32 = row.iter().map(|e| Self::entry_width(e) + gap).sum::<i32>() - gap;
        let mut x = left + (width - total) / 2;
        for entry in row {
            self.entry(entry, x, middle)?;
            x += Self::entry_width(entry) + gap;
        }
        Ok(())
    }

    /// A chart over a rectangle.
    pub fn chart(&self, rect: Rect, x: Span, y: Span) -> Result<Chart<'a>, RenderError> {
        // Plotters takes the last pixel of an area as the end of its range; one more makes the
        // range the rectangle itself.
        let area = self.area.clone().shrink((rect.x, rect.y), (rect.w + 1, rect.h + 1));
        let context = ChartBuilder::on(&area).build_cartesian_2d(x, y)?;
        Ok(Chart { context, rect, x, y })
    }
}

const KEY_PT: f64 = 15.0;
const KEY_GAP_PT: f64 = 4.0;
const ENTRY_GAP_PT: f64 = 14.0;

fn stroke(width: f64) -> u32 {
    units(width).max(1) as u32
}

fn dashed(places: &[[f64; 2]], look: &LineStyle) -> Vec<Vec<[f64; 2]>> {
    let unit = f64::from(UNITS_PER_POINT);
    let scale = unit * (look.width / style::CURVE_PT).clamp(0.8, 2.0);
    match look.dash {
        Dash::Solid => vec![places.to_vec()],
        Dash::Dashed => {
            polyline::dashes(places, style::DASH_PT.0 * scale, style::DASH_PT.1 * scale)
        }
        Dash::Dotted => {
            polyline::dashes(places, style::DOTTED_PT.0 * scale, style::DOTTED_PT.1 * scale)
        }
    }
}

/// A plotters chart over a rectangle of the sheet.
pub struct Chart<'a> {
    context: ChartContext<'a, SceneBackend<'a>, Cartesian2d<Span, Span>>,
    /// The rectangle.
    pub rect: Rect,
    x: Span,
    y: Span,
}

impl Chart<'_> {
    /// Place of a point on the sheet, in units, not rounded.
    pub fn place(&self, p: &[f64; 2]) -> [f64; 2] {
        [
            f64::from(self.rect.x)
                + f64::from(self.rect.w) * (p[0] - self.x.lower) / (self.x.upper - self.x.lower),
            f64::from(self.rect.bottom())
                - f64::from(self.rect.h) * (p[1] - self.y.lower) / (self.y.upper - self.y.lower),
        ]
    }

    /// Place of a point on the sheet, to the nearest unit.
    pub fn position(&self, p: &[f64; 2]) -> Position {
        let (x, y) = (&self.x, &self.y);
        (
            x.map(&p[0], (self.rect.x, self.rect.right())),
            y.map(&p[1], (self.rect.bottom(), self.rect.y)),
        )
    }

    /// Whether a point lies in the chart.
    pub fn contains(&self, p: &[f64; 2]) -> bool {
        p[0] >= self.x.lower && p[0] <= self.x.upper && p[1] >= self.y.lower && p[1] <= self.y.upper
    }

    /// Draws a cloud of points; those outside the chart are left out.
    pub fn dots(&mut self, points: &[[f64; 2]], look: &DotStyle) -> Result<(), RenderError> {
        let inside: Vec<[f64; 2]> = points.iter().filter(|p| self.contains(p)).copied().collect();
        let places: Vec<Position> = inside.iter().map(|p| self.position(p)).collect();
        let cloud = density::arrange(&places, look);
        for group in &cloud.groups {
            let points = group.members.iter().map(|i| (inside[*i][0], inside[*i][1]));
            let look = rgba(group.colour, 100).filled();
            self.context.draw_series(PointSeries::of_element(
                points,
                cloud.diameter / 2,
                look,
                &Circle::new,
            ))?;
        }
        Ok(())
    }

    /// Draws a polyline: clipped, thinned, dashed. Returns its parts as places on the sheet.
    pub fn line(
        &mut self,
        points: &[[f64; 2]],
        look: &LineStyle,
    ) -> Result<Vec<Vec<Position>>, RenderError> {
        let parts =
            polyline::clip(points, [self.x.lower, self.y.lower], [self.x.upper, self.y.upper]);
        let mut drawn = Vec::new();
        for part in parts {
            let thinned = polyline::thin(&part, THINNING, |p| self.place(p));
            drawn.push(thinned.iter().map(|p| self.position(p)).collect());
            self.thinned_line(&thinned, look)?;
        }
        Ok(drawn)
    }

    /// Draws a polyline that has been clipped and thinned.
    pub fn thinned_line(
        &mut self,
        points: &[[f64; 2]],
        look: &LineStyle,
    ) -> Result<(), RenderError> {
        let pen = rgba(look.colour, look.opacity).stroke_width(stroke(look.width));
        if look.dash == Dash::Solid {
            self.context.draw_series(LineSeries::new(points.iter().map(|p| (p[0], p[1])), pen))?;
            return Ok(());
        }
        let places: Vec<[f64; 2]> = points.iter().map(|p| self.place(p)).collect();
        let back = |p: &[f64; 2]| {
            (
                self.x.lower
                    + (p[0] - f64::from(self.rect.x)) / f64::from(self.rect.w)
                        * (self.x.upper - self.x.lower),
                self.y.lower
                    + (f64::from(self.rect.bottom()) - p[1]) / f64::from(self.rect.h)
                        * (self.y.upper - self.y.lower),
            )
        };
        for part in dashed(&places, look) {
            let part: Vec<(f64, f64)> = part.iter().map(back).collect();
            self.context.draw_series(LineSeries::new(part, pen))?;
        }
        Ok(())
    }

    /// Fills a polygon, clipped to the chart.
    pub fn area(
        &mut self,
        outline: &[[f64; 2]],
        colour: Colour,
        opacity: u8,
    ) -> Result<(), RenderError> {
        let cut = polyline::clip_polygon(
            outline,
            [self.x.lower, self.y.lower],
            [self.x.upper, self.y.upper],
        );
        let corners: Vec<(f64, f64)> = cut.iter().map(|p| (p[0], p[1])).collect();
        if corners.len() >= 3 {
            self.context
                .draw_series(std::iter::once(Polygon::new(corners, rgba(colour, opacity))))?;
        }
        Ok(())
    }
}
