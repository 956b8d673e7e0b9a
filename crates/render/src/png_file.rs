//! Pixels as a PNG file with its printed size and its provenance, and back.

use std::borrow::Cow;
use std::io::Cursor;

use miniz_oxide::deflate::compress_to_vec_zlib;
use png::{BitDepth, ColorType, Encoder, Info, PixelDimensions, Unit};

use super::RenderError;
use super::raster::Pixels;
use super::scene::DPI;
use super::seal::Sealed;

/// Prefix of the keywords under which provenance is kept.
pub const KEYWORD_PREFIX: &str = "twofold:";

/// Writes pixels. Pictures of at most 256 colours are stored with a palette, others as RGB.
pub fn write(
    pixels: &Pixels,
    title: &str,
    description: &str,
    sealed: &Sealed,
) -> Result<Vec<u8>, RenderError> {
    let mut info = Info::with_size(pixels.width, pixels.height);
    // 600 dpi is 23622 pixels per metre.
    let per_metre = (f64::from(DPI) / 0.0254).round() as u32;
    info.pixel_dims = Some(PixelDimensions { xppu: per_metre, yppu: per_metre, unit: Unit::Meter });
    info.bit_depth = BitDepth::Eight;
    let stream = match indexed(pixels) {
        Some((palette, indices)) => {
            info.color_type = ColorType::Indexed;
            info.palette = Some(Cow::Owned(palette));
            image_stream(&indices, pixels.width as usize)
        }
        None => {
            info.color_type = ColorType::Rgb;
            image_stream(&rgb(pixels), 3 * pixels.width as usize)
        }
    };
    let mut file = Vec::new();
    let mut encoder = Encoder::with_info(&mut file, info)?;
    encoder.add_itxt_chunk("Title".to_owned(), title.to_owned())?;
    encoder.add_itxt_chunk("Description".to_owned(), description.to_owned())?;
    for (key, value) in &sealed.entries {
        encoder.add_itxt_chunk(format!("{KEYWORD_PREFIX}{key}"), value.clone())?;
    }
    let mut writer = encoder.write_header()?;
    writer.write_chunk(png::chunk::IDAT, &stream)?;
    writer.finish()?;
    Ok(file)
}

/// The pixels without transparency, three bytes each.
pub(super) fn rgb(pixels: &Pixels) -> Vec<u8> {
    let mut rgb = vec![0; pixels.rgba.len() / 4 * 3];
    for (to, from) in rgb.chunks_exact_mut(3).zip(pixels.rgba.chunks_exact(4)) {
        to.copy_from_slice(&from[..3]);
    }
    rgb
}

/// The compressed image data of rows of so many bytes.
///
/// Rows are not filtered: drawings repeat whole stretches of pixels, and filters made for
/// photographs hide that. Compressed here rather than by the PNG crate, whose compressor is chosen
/// by cargo features that any dependency can turn on.
pub(super) fn image_stream(data: &[u8], row: usize) -> Vec<u8> {
    image_stream_at(data, row, LEVEL)
}

/// The same at another effort of compression.
pub(super) fn image_stream_at(data: &[u8], row: usize, level: u8) -> Vec<u8> {
    let mut rows = Vec::with_capacity(data.len() + data.len() / row + 1);
    for line in data.chunks_exact(row) {
        rows.push(0);
        rows.extend_from_slice(line);
    }
    compress_to_vec_zlib(&rows, level)
}

/// Effort of compression: higher levels cost more time than all the drawing.
const LEVEL: u8 = 3;

/// Palette and indices of a picture of at most 256 colours. The palette is sorted.
pub(super) fn indexed(pixels: &Pixels) -> Option<(Vec<u8>, Vec<u8>)> {
    let mut table = ColourTable::new();
    let mut indices = Vec::with_capacity(pixels.rgba.len() / 4);
    let mut last = (u32::MAX, 0);
    for p in pixels.rgba.chunks_exact(4) {
        let c = u32::from_be_bytes([0, p[0], p[1], p[2]]);
        if last.0 != c {
            last = (c, table.index(c)?);
        }
        indices.push(last.1);
    }
    let mut order: Vec<usize> = (0..table.colours.len()).collect();
    order.sort_unstable_by_key(|i| table.colours[*i]);
    let mut rank = [0u8; 256];
    for (position, i) in order.iter().enumerate() {
        rank[*i] = position as u8;
    }
    indices.iter_mut().for_each(|i| *i = rank[usize::from(*i)]);
    let palette =
        order.iter().flat_map(|i| table.colours[*i].to_be_bytes()[1..].to_vec()).collect();
    Some((palette, indices))
}

/// Colours numbered in the order in which they are met, found by open addressing.
struct ColourTable {
    colours: Vec<u32>,
    slots: Vec<Option<u8>>,
}

impl ColourTable {
    const SLOTS: usize = 1024;

    fn new() -> Self {
        Self { colours: Vec::new(), slots: vec![None; Self::SLOTS] }
    }

    /// The number of a colour; `None` if it would be the 257th.
    fn index(&mut self, colour: u32) -> Option<u8> {
        let mut at = (colour.wrapping_mul(0x9e37_79b1) >> 22) as usize;
        loop {
            match self.slots[at] {
                Some(i) if self.colours[usize::from(i)] == colour => return Some(i),
                Some(_) => at = (at + 1) % Self::SLOTS,
                None => {
                    let i = u8::try_from(self.colours.len()).ok()?;
                    self.slots[at] = Some(i);
                    self.colours.push(colour);
                    return Some(i);
                }
            }
        }
    }
}

/// The most pixels that are decoded: five times the largest picture that [`render`](super::render)
/// makes.
const MOST_PIXELS: u64 = 1 << 26;

/// Width and height as a PNG file's first bytes claim them; nothing else of the file is looked at.
pub fn png_size(bytes: &[u8]) -> Option<(u32, u32)> {
    let header = bytes.strip_prefix(b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR")?;
    let number = |at: usize| Some(u32::from_be_bytes(header.get(at..at + 4)?.try_into().ok()?));
    Some((number(0)?, number(4)?))
}

/// Pixels of any PNG file, at eight bits per channel, as opaque RGBA where the file has no
/// transparency.
///
/// # Errors
/// If it is no PNG file, is damaged, has a palette that is none, or claims more than 67 million
/// pixels: what it claims is checked before memory is asked for.
pub fn decode_png(bytes: &[u8]) -> Result<Pixels, RenderError> {
    if let Some((width, height)) = png_size(bytes)
        && u64::from(width) * u64::from(height) > MOST_PIXELS
    {
        return Err(RenderError::Claims { width, height });
    }
    let limits = png::Limits { bytes: 4 * MOST_PIXELS as usize };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info()?;
    // The crate takes it for granted that colours are whole.
    if let Some(palette) = &reader.info().palette
        && palette.len() % 3 != 0
    {
        return Err(RenderError::Palette { bytes: palette.len() });
    }
    let size = reader.output_buffer_size().ok_or(RenderError::TooLarge)?;
    let mut buffer = vec![0; size];
    let frame = reader.next_frame(&mut buffer)?;
    let data = &buffer[..frame.buffer_size()];
    let rgba = match frame.color_type {
        ColorType::Rgba => data.to_vec(),
        ColorType::Rgb => data.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]).collect(),
        ColorType::Grayscale => data.iter().flat_map(|g| [*g, *g, *g, 255]).collect(),
        ColorType::GrayscaleAlpha => {
            data.chunks_exact(2).flat_map(|p| [p[0], p[0], p[0], p[1]]).collect()
        }
        // `normalize_to_color8` expands palettes.
        ColorType::Indexed => {
            return Err(RenderError::Drawing("a palette was not expanded".to_owned()));
        }
    };
    Ok(Pixels { width: frame.width, height: frame.height, rgba })
}
