//! A [`Scene`] as pixels, anti-aliased.
//!
//! Only straight lines reach the rasteriser: curves are divided here, because its own treatment of
//! cubics may call the platform's trigonometry. Dots are stamped from masks computed in integers,
//! which is also what makes many of them cheap.

use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint as SkPaint, Path, PathBuilder, Pixmap, Stroke,
    Transform,
};

use super::scene::{Item, Paint, Position, Scene, Segment, UNITS_PER_PIXEL};
use super::sheet::Colour;

/// Decoded pixels: opaque RGBA, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pixels {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Four bytes per pixel.
    pub rgba: Vec<u8>,
}

/// Draws a scene on white. `None` if it has no area.
pub fn rasterise(scene: &Scene) -> Option<Pixels> {
    let mut pixmap = Pixmap::new(scene.width_px, scene.height_px)?;
    pixmap.fill(Color::WHITE);
    let mut stamps: Vec<Stamp> = Vec::new();
    for item in &scene.items {
        match item {
            Item::Fill { paint, path, .. } => {
                if let Some(path) = outline(path) {
                    pixmap.fill_path(
                        &path,
                        &ink(*paint),
                        FillRule::Winding,
                        Transform::identity(),
                        None,
                    );
                }
            }
            Item::Stroke { paint, width, lines } => {
                let stroke = Stroke {
                    width: *width as f32 / UNITS_PER_PIXEL as f32,
                    line_cap: LineCap::Round,
                    line_join: LineJoin::Round,
                    ..Stroke::default()
                };
                if let Some(path) = polylines(lines) {
                    pixmap.stroke_path(&path, &ink(*paint), &stroke, Transform::identity(), None);
                }
            }
            Item::Dots { paint, diameter, centres } => {
                let known = stamps
                    .iter()
                    .position(|s| (s.diameter, s.opacity) == (*diameter, paint.opacity));
                let known = known.unwrap_or_else(|| {
                    stamps.push(Stamp::new(*diameter, paint.opacity));
                    stamps.len() - 1
                });
                stamps[known].draw(&mut pixmap, paint.colour, centres);
            }
        }
    }
    Some(Pixels { width: scene.width_px, height: scene.height_px, rgba: pixmap.take() })
}

fn ink(paint: Paint) -> SkPaint<'static> {
    let mut ink = SkPaint::default();
    let c = paint.colour;
    ink.set_color_rgba8(c.r, c.g, c.b, ((u32::from(paint.opacity) * 255 + 50) / 100) as u8);
    ink.anti_alias = true;
    ink
}

fn pixel(p: Position) -> (f32, f32) {
    (p.0 as f32 / UNITS_PER_PIXEL as f32, p.1 as f32 / UNITS_PER_PIXEL as f32)
}

fn polylines(lines: &[Vec<Position>]) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for line in lines {
        let closed = line.len() > 3 && line.first() == line.last();
        let drawn = if closed { &line[..line.len() - 1] } else { &line[..] };
        for (i, p) in drawn.iter().enumerate() {
            let (x, y) = pixel(*p);
            if i == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
        }
        if closed {
            builder.close();
        }
    }
    builder.finish()
}

fn outline(path: &[Segment]) -> Option<Path> {
    let mut builder = PathBuilder::new();
    let mut last = (0, 0);
    for segment in path {
        match *segment {
            Segment::Move(p) => {
                let (x, y) = pixel(p);
                builder.move_to(x, y);
                last = p;
            }
            Segment::Line(p) => {
                let (x, y) = pixel(p);
                builder.line_to(x, y);
                last = p;
            }
            Segment::Cubic(a, b, p) => {
                for (x, y) in divide(last, a, b, p) {
                    builder.line_to(x, y);
                }
                last = p;
            }
            Segment::Close => builder.close(),
        }
    }
    builder.finish()
}

/// Points on a cubic, close enough together that the chords look smooth.
fn divide(
    from: Position,
    a: Position,
    b: Position,
    to: Position,
) -> impl Iterator<Item = (f32, f32)> {
    let [p0, p1, p2, p3] = [from, a, b, to].map(|p| {
        let (x, y) = pixel(p);
        [x, y]
    });
    // The distance between curve and chord shrinks with the square of the number of parts.
    let bend: f32 = (0..2)
        .map(|i| (p0[i] - 2.0 * p1[i] + p2[i]).abs() + (p1[i] - 2.0 * p2[i] + p3[i]).abs())
        .sum();
    let parts = ((bend * 4.0).sqrt().ceil() as usize).clamp(2, 64);
    (1..=parts).map(move |k| {
        let t = k as f32 / parts as f32;
        let s = 1.0 - t;
        let at = |i: usize| {
            s * s * s * p0[i]
                + 3.0 * s * s * t * p1[i]
                + 3.0 * s * t * t * p2[i]
                + t * t * t * p3[i]
        };
        (at(0), at(1))
    })
}

/// Masks of discs of one size and opacity, one for each position of the centre within a pixel, made
/// when first needed.
struct Stamp {
    diameter: i32,
    opacity: u8,
    masks: Vec<Option<Mask>>,
}

impl Stamp {
    fn new(diameter: i32, opacity: u8) -> Self {
        let phases = UNITS_PER_PIXEL * UNITS_PER_PIXEL;
        Self { diameter, opacity, masks: (0..phases).map(|_| None).collect() }
    }

    /// Draws discs.
    fn draw(&mut self, pixmap: &mut Pixmap, colour: Colour, centres: &[Position]) {
        let (width, height) = (pixmap.width() as i32, pixmap.height() as i32);
        let data = pixmap.data_mut();
        let ink = [colour.r, colour.g, colour.b].map(u32::from);
        for centre in centres {
            let (px, py) =
                (centre.0.div_euclid(UNITS_PER_PIXEL), centre.1.div_euclid(UNITS_PER_PIXEL));
            let (fx, fy) =
                (centre.0.rem_euclid(UNITS_PER_PIXEL), centre.1.rem_euclid(UNITS_PER_PIXEL));
            let mask = self.masks[(fy * UNITS_PER_PIXEL + fx) as usize]
                .get_or_insert_with(|| Mask::new(fx, fy, self.diameter, self.opacity));
            let left = px + mask.first;
            // Columns of the mask that lie on the sheet.
            let (from, to) = ((-left).clamp(0, mask.side), (width - left).clamp(0, mask.side));
            if from >= to {
                continue;
            }
            for (row, cover) in mask.cover.chunks_exact(mask.side as usize).enumerate() {
                let y = py + mask.first + row as i32;
                if y < 0 || y >= height {
                    continue;
                }
                let start = 4 * (y * width + left + from) as usize;
                let line = &mut data[start..start + 4 * (to - from) as usize];
                for (pixel, cover) in
                    line.chunks_exact_mut(4).zip(&cover[from as usize..to as usize])
                {
                    if *cover == 0 {
                        continue;
                    }
                    for (under, ink) in pixel.iter_mut().zip(ink) {
                        *under =
                            ((u32::from(*under) * (255 - cover) + ink * cover + 127) / 255) as u8;
                    }
                }
            }
        }
    }
}

/// Coverage (0 to 255) of the pixels around a disc's centre.
struct Mask {
    /// Offset of the first pixel from that of the centre.
    first: i32,
    side: i32,
    cover: Vec<u32>,
}

impl Mask {
    fn new(fx: i32, fy: i32, diameter: i32, opacity: u8) -> Self {
        let reach = (diameter / 2 + UNITS_PER_PIXEL) / UNITS_PER_PIXEL;
        let (first, side) = (-reach, 2 * reach + 1);
        let mut cover = Vec::with_capacity((side * side) as usize);
        let samples = (UNITS_PER_PIXEL * UNITS_PER_PIXEL) as u32;
        for row in 0..side {
            for column in 0..side {
                // Twice the distances from the centre of the disc to the centre of each unit, so
                // that all is whole.
                let origin = |first: i32, f: i32| 2 * ((first) * UNITS_PER_PIXEL - f) + 1;
                let (x0, y0) = (origin(first + column, fx), origin(first + row, fy));
                let mut inside = 0u32;
                for j in 0..UNITS_PER_PIXEL {
                    for i in 0..UNITS_PER_PIXEL {
                        let (dx, dy) = (x0 + 2 * i, y0 + 2 * j);
                        inside += u32::from(dx * dx + dy * dy <= diameter * diameter);
                    }
                }
                let full = (255 * u32::from(opacity) + 50) / 100;
                cover.push((inside * full + samples / 2) / samples);
            }
        }
        Self { first, side, cover }
    }
}
