//! Bare pixels as a PNG file: for pictures about pictures, which carry no provenance of their own.

use png::{BitDepth, ColorType, DeflateCompression, Encoder, Filter};

use super::{Pixels, RenderError};

/// Writes pixels as an RGB file without metadata; transparency is dropped. Same pixels, same bytes.
pub fn encode_png(pixels: &Pixels) -> Result<Vec<u8>, RenderError> {
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, pixels.width, pixels.height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_filter(Filter::Up);
    encoder.set_deflate_compression(DeflateCompression::Level(6));
    let rgb: Vec<u8> = pixels.rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&rgb)?;
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
