//! Rendering of plain data to PNG, SVG and PDF. The only crate that uses plotters.
//!
//! A [`Sheet`] says what is drawn. It is laid out and drawn once, with plotters' charts and series,
//! through a backend of our own (`backend`) into a device-independent list of paths (`scene`);
//! three writers turn that one list into pixels, SVG and PDF, so the three are the same picture.
//! All text is set from fonts embedded in the library (`font`, `rich_text`). How things look is
//! said in [`style`] alone.
//!
//! ```
//! use twofold_render::sheet::{Axis, ColumnWidth, DotStyle, PlanePanel};
//! use twofold_render::{Sheet, render};
//! let chart = PlanePanel::new(Axis::linear("*x*", 0.0, 1.0), Axis::linear("*y*", 0.0, 1.0))
//!     .dots(vec![[0.2, 0.3], [0.7, 0.8]], DotStyle::late());
//! let rendered = render(&Sheet::new(ColumnWidth::Wide, 1, "Two points").panel("(a)", "", chart))?;
//! assert!(rendered.png.starts_with(b"\x89PNG") && rendered.pdf.starts_with(b"%PDF"));
//! # Ok::<(), twofold_render::RenderError>(())
//! ```
//!
//! Everything here is a pure function of the sheet: no file, clock, locale or machine property
//! enters, and no platform logarithm or trigonometric function decides where ink lies.
#![forbid(unsafe_code)]
// tests compare with tolerances, not with hashes
#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod colour;
pub mod markup;
pub mod number;
pub mod sheet;
pub mod style;
pub mod ticks;

mod backend;
mod canvas;
mod density;
mod encode;
mod font;
mod layout;
mod pdf;
mod plane;
mod png_file;
mod polyline;
mod preview;
mod provenance;
mod raster;
mod rich_text;
mod scene;
mod seal;
mod space;
mod svg;

pub use encode::encode_png;
pub use png_file::{decode_png, png_size};
pub use polyline::clip_polygon;
pub use preview::{Shrink, encode_preview, shrunk};
pub use provenance::{Format, Provenance, ProvenanceError, read_provenance};
pub use raster::Pixels;
pub use rich_text::RichTextError;
pub use sheet::Sheet;

use seal::Sealed;

/// Why a sheet cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A text cannot be set.
    #[error(transparent)]
    Text(#[from] RichTextError),
    /// An axis has an end that is not a finite number, or a logarithmic axis one that is not
    /// positive.
    #[error(
        "panel {panel}: the axis {title:?} runs from {lower} to {upper}; give finite ends \
            (positive on a logarithmic axis)"
    )]
    Axis {
        /// Number of the panel, from one.
        panel: usize,
        /// Title of the axis.
        title: String,
        /// Its lower end.
        lower: f64,
        /// Its upper end.
        upper: f64,
    },
    /// A size or angle is not usable.
    #[error("panel {panel}: {what} is {value}")]
    Number {
        /// Number of the panel, from one; zero for the sheet.
        panel: usize,
        /// Name of the quantity.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// The picture is higher than 8000 pixels.
    #[error("the picture is too large: give it fewer rows of panels, or a smaller aspect")]
    TooLarge,
    /// A PNG file that claims more pixels than are decoded.
    #[error("it claims {width} by {height} pixels, more than are read here")]
    Claims {
        /// Width.
        width: u32,
        /// Height.
        height: u32,
    },
    /// A PNG file whose palette is none.
    #[error("PNG: a palette of {bytes} bytes, where each colour has three")]
    Palette {
        /// Its length.
        bytes: usize,
    },
    /// Drawing failed inside plotters.
    #[error("drawing failed: {0}")]
    Drawing(String),
    /// A PNG file cannot be written.
    #[error("PNG: {0}")]
    PngEncoding(#[from] png::EncodingError),
    /// A PNG file cannot be read.
    #[error("PNG: {0}")]
    PngDecoding(#[from] png::DecodingError),
    /// The provenance could not be sealed.
    #[error(transparent)]
    Provenance(#[from] ProvenanceError),
}

/// A picture in all formats.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// PNG file, 600 dpi.
    pub png: Vec<u8>,
    /// SVG file.
    pub svg: Vec<u8>,
    /// PDF file.
    pub pdf: Vec<u8>,
    /// The pixels of the PNG file.
    pub pixels: Pixels,
    /// Number of given positions that were not finite numbers (or not positive on a logarithmic
    /// axis) and were left out.
    pub left_out: usize,
}

/// Draws a sheet.
///
/// # Errors
///
/// If the sheet asks for something that cannot be drawn: no axes, an empty range, a picture that is
/// too large.
pub fn render(sheet: &Sheet) -> Result<Rendered, RenderError> {
    check(sheet)?;
    let scene = layout::draw(sheet)?;
    let pixels = raster::rasterise(&scene).ok_or(RenderError::TooLarge)?;
    let title = match &sheet.title {
        Some(title) => rich_text::set(title, font::FontFace::Regular)?.plain,
        None => "Figure".to_owned(),
    };
    let sealed = Sealed::new(&sheet.provenance);
    Ok(Rendered {
        png: provenance::seal(png_file::write(&pixels, &title, &sheet.description, &sealed)?)?,
        svg: provenance::seal(svg::write(
            &scene,
            &title,
            &sheet.description,
            &sealed,
            sheet.searchable_svg,
        ))?,
        pdf: provenance::seal(pdf::write(&scene, &title, &sheet.description, &sealed))?,
        pixels,
        left_out: left_out(sheet),
    })
}

fn left_out(sheet: &Sheet) -> usize {
    let count = |panel: &sheet::SheetPanel| match &panel.content {
        sheet::Content::Plane(p) => {
            let bad = |axis: &sheet::Axis, v: f64| !v.is_finite() || (axis.logarithmic && v <= 0.0);
            let bad = |q: &&[f64; 2]| bad(&p.x, q[0]) || bad(&p.y, q[1]);
            p.layers.iter().map(|l| l.positions().iter().filter(bad).count()).sum::<usize>()
        }
        sheet::Content::Space(p) => {
            let bad = |q: &&[f64; 3]| !q.iter().all(|v| v.is_finite());
            p.layers.iter().map(|l| l.positions().iter().filter(bad).count()).sum()
        }
        sheet::Content::Blank => 0,
    };
    sheet.panels.iter().map(count).sum()
}

/// Whether a sheet can be drawn, without drawing it.
///
/// # Errors
///
/// As [`render`].
pub fn check(sheet: &Sheet) -> Result<(), RenderError> {
    layout::check_texts(sheet)?;
    let number = |panel: usize, what: &'static str, value: f64, good: bool| {
        if good && value.is_finite() {
            Ok(())
        } else {
            Err(RenderError::Number { panel, what, value })
        }
    };
    let aspect = |panel: usize, value: f64| {
        number(panel, "the aspect (0.05 to 20)", value, (0.05..=20.0).contains(&value))
    };
    aspect(0, sheet.panel_aspect)?;
    for (i, p) in sheet.panels.iter().enumerate() {
        let panel = i + 1;
        let axis = |a: &sheet::Axis, log: bool| {
            let good = a.lower.is_finite()
                && a.upper.is_finite()
                && (a.upper - a.lower).is_finite()
                && (!a.logarithmic || (log && a.lower > 0.0 && a.upper > 0.0));
            if good {
                return Ok(());
            }
            Err(RenderError::Axis { panel, title: a.title.clone(), lower: a.lower, upper: a.upper })
        };
        match &p.content {
            sheet::Content::Plane(c) => {
                axis(&c.x, !c.equal)?;
                axis(&c.y, !c.equal)?;
                c.aspect.map_or(Ok(()), |a| aspect(panel, a))?;
            }
            sheet::Content::Space(c) => {
                // A box has linear axes only.
                c.axes.iter().try_for_each(|a| axis(a, false))?;
                c.aspect.map_or(Ok(()), |a| aspect(panel, a))?;
                number(panel, "the camera's azimuth", c.azimuth, true)?;
                number(
                    panel,
                    "the camera's elevation (-90 to 90)",
                    c.elevation,
                    c.elevation.abs() <= 90.0,
                )?;
                for p in c.proportions {
                    number(
                        panel,
                        "a proportion of the box (0.05 to 20)",
                        p,
                        (0.05..=20.0).contains(&p),
                    )?;
                }
            }
            sheet::Content::Blank => {}
        }
    }
    // Beyond this the rasteriser would leave out anti-aliasing.
    if layout::height_px(sheet) > 8_000 {
        return Err(RenderError::TooLarge);
    }
    Ok(())
}

#[cfg(test)]
mod tests;
