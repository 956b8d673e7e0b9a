//! A plotters backend whose canvas counts twelve units to a pixel and which keeps what is drawn as
//! a [`Scene`].
//!
//! Plotters works in whole pixels and leaves text to its backend. Drawing on a canvas twelve times
//! finer and scaling when the files are written gives sub-pixel placement; text is turned into
//! glyph outlines here.

use plotters::style::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind,
    FontStyle, FontTransform,
};

use super::font::{CAP_HEIGHT, FontFace};
use super::rich_text::{self, RichTextError, Turn};
use super::scene::{Paint, Scene, UNITS_PER_POINT, Words, units};
use super::sheet::Colour;
use super::style::{HALO_PT, WHITE};

/// A font family name that asks for a white margin around the letters: a text style of plotters has
/// no other place to say so.
pub const HALO_FAMILY: &str = "serif with halo";

/// The backend.
pub struct SceneBackend<'a> {
    scene: &'a mut Scene,
}

impl<'a> SceneBackend<'a> {
    /// Draws into `scene`.
    pub fn new(scene: &'a mut Scene) -> Self {
        Self { scene }
    }
}

type Outcome = Result<(), DrawingErrorKind<RichTextError>>;

fn paint(colour: BackendColor) -> Paint {
    let (r, g, b) = colour.rgb;
    Paint {
        colour: Colour::rgb(r, g, b),
        opacity: (colour.alpha.clamp(0.0, 1.0) * 100.0).round() as u8,
    }
}

fn face(style: FontStyle) -> FontFace {
    match style {
        FontStyle::Normal => FontFace::Regular,
        FontStyle::Italic | FontStyle::Oblique => FontFace::Italic,
        FontStyle::Bold => FontFace::Bold,
    }
}

impl DrawingBackend for SceneBackend<'_> {
    type ErrorType = RichTextError;

    fn get_size(&self) -> (u32, u32) {
        (self.scene.width() as u32, self.scene.height() as u32)
    }

    fn ensure_prepared(&mut self) -> Outcome {
        Ok(())
    }

    fn present(&mut self) -> Outcome {
        Ok(())
    }

    fn draw_pixel(&mut self, point: BackendCoord, color: BackendColor) -> Outcome {
        self.scene.dot(paint(color), 1, point);
        Ok(())
    }

    fn draw_line<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
    ) -> Outcome {
        self.draw_path([from, to], style)
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        upper_left: BackendCoord,
        bottom_right: BackendCoord,
        style: &S,
        fill: bool,
    ) -> Outcome {
        let ((x0, y0), (x1, y1)) = (upper_left, bottom_right);
        let corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)];
        if fill {
            self.fill_polygon(corners, style)
        } else {
            self.draw_path(corners.into_iter().chain([(x0, y0)]), style)
        }
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Outcome {
        self.scene.polyline(
            paint(style.color()),
            style.stroke_width() as i32,
            path.into_iter().collect(),
        );
        Ok(())
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        center: BackendCoord,
        radius: u32,
        style: &S,
        fill: bool,
    ) -> Outcome {
        if fill {
            self.scene.dot(paint(style.color()), 2 * radius as i32, center);
        } else {
            // A ring is a disc with a smaller one of paper on top: no curve has to be stroked.
            let width = style.stroke_width() as i32;
            self.scene.dot(paint(style.color()), 2 * radius as i32 + width, center);
            self.scene.dot(
                Paint { colour: WHITE, opacity: 100 },
                2 * radius as i32 - width,
                center,
            );
        }
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        vert: I,
        style: &S,
    ) -> Outcome {
        self.scene.polygon(paint(style.color()), vert.into_iter().collect());
        Ok(())
    }

    fn draw_text<T: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &T,
        pos: BackendCoord,
    ) -> Outcome {
        let line =
            rich_text::set(text, face(style.style())).map_err(DrawingErrorKind::DrawingError)?;
        let size = style.size() / f64::from(UNITS_PER_POINT);
        let width = units(line.width * size);
        let along = match style.anchor().h_pos {
            HPos::Left => 0,
            HPos::Center => -width / 2,
            HPos::Right => -width,
        };
        // Vertically a text is as high as its capitals; `Bottom` puts the baseline on the position.
        let cap = units(CAP_HEIGHT * size);
        let below = match style.anchor().v_pos {
            VPos::Top => cap,
            VPos::Center => cap / 2,
            VPos::Bottom => 0,
        };
        let (origin, turn) = match style.transform() {
            FontTransform::Rotate270 => ((pos.0 + below, pos.1 - along), Turn::Upwards),
            _ => ((pos.0 + along, pos.1 + below), Turn::Level),
        };
        let to = match turn {
            Turn::Level => (origin.0 + width, origin.1),
            Turn::Upwards => (origin.0, origin.1 - width),
        };
        let path = line.outlines(size, origin, turn);
        if style.family().as_str() == HALO_FAMILY {
            self.scene.halo(&path, units(2.0 * HALO_PT));
        }
        self.scene.text(
            paint(style.color()),
            path,
            Words { text: line.plain, from: origin, to, size: units(size) },
        );
        Ok(())
    }

    fn estimate_text_size<T: BackendTextStyle>(
        &self,
        text: &str,
        style: &T,
    ) -> Result<(u32, u32), DrawingErrorKind<RichTextError>> {
        let line =
            rich_text::set(text, face(style.style())).map_err(DrawingErrorKind::DrawingError)?;
        Ok(((line.width * style.size()).round() as u32, style.size().round() as u32))
    }
}
