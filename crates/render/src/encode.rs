//! Bare pixels as a PNG file: for pictures about pictures, which carry no provenance of their own.

use png::{BitDepth, ColorType, Encoder, Info, chunk};

use super::png_file::{image_stream, rgb};
use super::{Pixels, RenderError};

/// Writes pixels as an RGB file without metadata; transparency is dropped. Same pixels, same bytes.
///
/// # Errors
///
/// If the encoder refuses the picture, such as one without pixels.
pub fn encode_png(pixels: &Pixels) -> Result<Vec<u8>, RenderError> {
    let mut info = Info::with_size(pixels.width, pixels.height);
    info.bit_depth = BitDepth::Eight;
    info.color_type = ColorType::Rgb;
    let mut file = Vec::new();
    let mut writer = Encoder::with_info(&mut file, info)?.write_header()?;
    writer.write_chunk(chunk::IDAT, &image_stream(&rgb(pixels), 3 * pixels.width as usize))?;
    writer.finish()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comes_back_as_it_went() {
        let rgba = (0..6u8).flat_map(|i| [i * 40, 255 - i, i, 255]).collect();
        let pixels = Pixels { width: 3, height: 2, rgba };
        let file = encode_png(&pixels).unwrap();
        assert_eq!(super::super::decode_png(&file).unwrap(), pixels);
        assert_eq!(file, encode_png(&pixels).unwrap());
    }
}
