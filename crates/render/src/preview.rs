//! Smaller versions of pictures, for pages that show many of them. Whole numbers all the way: the
//! same bytes on every machine.

use png::{BitDepth, ColorType, Encoder, Info, chunk};

use super::png_file::{image_stream_at, indexed, rgb};
use super::{Pixels, RenderError};

/// Value of a pixel of a smaller picture, from those that it stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shrink {
    /// Their mean, by area.
    Mean,
    /// The one furthest from white: what is marked in one pixel only is not lost.
    Strongest,
}

/// The picture at most `width` pixels wide, in its proportions; one that is not wider comes back as
/// it is.
pub fn shrunk(pixels: &Pixels, width: u32, how: Shrink) -> Pixels {
    if pixels.width <= width || width == 0 || pixels.height == 0 {
        return pixels.clone();
    }
    let height = (u64::from(pixels.height) * u64::from(width))
        .div_ceil(u64::from(pixels.width))
        .max(1) as u32;
    let (columns, rows) = (shares(pixels.width, width), shares(pixels.height, height));
    let area = u64::from(pixels.width) * u64::from(pixels.height);
    let mut rgba = Vec::with_capacity(4 * width as usize * height as usize);
    let stride = 4 * pixels.width as usize;
    // Sums over the rows that a row stands for, of every column's channels.
    let mut sums = vec![0_u64; stride];
    for row in &rows {
        if how == Shrink::Mean {
            sums.fill(0);
            for (y, v) in row {
                for (sum, c) in sums.iter_mut().zip(&pixels.rgba[y * stride..][..stride]) {
                    *sum += v * u64::from(*c);
                }
            }
        }
        for column in &columns {
            let colour = match how {
                Shrink::Mean => {
                    let mut totals = [area / 2; 3];
                    for (x, u) in column {
                        for (total, sum) in totals.iter_mut().zip(&sums[4 * x..]) {
                            *total += u * sum;
                        }
                    }
                    totals.map(|total| (total / area) as u8)
                }
                Shrink::Strongest => row
                    .iter()
                    .flat_map(|(y, _)| column.iter().map(move |(x, _)| y * stride + 4 * x))
                    .map(|start| {
                        [pixels.rgba[start], pixels.rgba[start + 1], pixels.rgba[start + 2]]
                    })
                    .max_by_key(|c| c.iter().map(|v| u32::from(255 - v)).sum::<u32>())
                    .unwrap_or([255; 3]),
            };
            rgba.extend([colour[0], colour[1], colour[2], 255]);
        }
    }
    Pixels { width, height, rgba }
}

/// For each of `to` cells, the pixels out of `from` that it covers and how much of each, in units
/// of 1/`to` of a pixel.
fn shares(from: u32, to: u32) -> Vec<Vec<(usize, u64)>> {
    let (from, to) = (u64::from(from), u64::from(to));
    (0..to)
        .map(|cell| {
            let (start, end) = (cell * from, (cell + 1) * from);
            let pixels = start / to..end.div_ceil(to);
            pixels.map(|i| (i as usize, end.min((i + 1) * to) - start.max(i * to))).collect()
        })
        .collect()
}

/// The pixels as a PNG file for looking at: sixteen levels a channel, and a palette where 256
/// colours are enough. No metadata.
///
/// # Errors
///
/// If the encoder refuses the picture, such as one without pixels.
pub fn encode_preview(pixels: &Pixels) -> Result<Vec<u8>, RenderError> {
    // The nearest of 0, 17, ..., 255.
    let coarse = |v: u8| ((u16::from(v) + 8) / 17 * 17) as u8;
    let pixels = Pixels { rgba: pixels.rgba.iter().map(|v| coarse(*v)).collect(), ..*pixels };
    let mut info = Info::with_size(pixels.width, pixels.height);
    info.bit_depth = BitDepth::Eight;
    let palette = indexed(&pixels);
    info.color_type = if palette.is_some() { ColorType::Indexed } else { ColorType::Rgb };
    let mut file = Vec::new();
    let data = match &palette {
        Some((colours, indices)) => {
            info.palette = Some(colours.into());
            image_stream_at(indices, pixels.width as usize, EFFORT)
        }
        None => image_stream_at(&rgb(&pixels), 3 * pixels.width as usize, EFFORT),
    };
    let mut writer = Encoder::with_info(&mut file, info)?.write_header()?;
    writer.write_chunk(chunk::IDAT, &data)?;
    writer.finish()?;
    Ok(file)
}

/// Effort of compression: the highest levels take a sixth of the report's time to make its page a
/// hundredth smaller.
const EFFORT: u8 = 6;

#[cfg(test)]
mod tests {
    use super::super::decode_png;
    use super::*;

    fn checkered(width: u32, height: u32) -> Pixels {
        let value = |i: u32| if (i % width + i / width).is_multiple_of(2) { 255 } else { 0 };
        Pixels {
            width,
            height,
            rgba: (0..width * height).flat_map(|i| [value(i), value(i), value(i), 255]).collect(),
        }
    }

    #[test]
    fn means_are_by_area() {
        let half = shrunk(&checkered(8, 4), 4, Shrink::Mean);
        assert_eq!((half.width, half.height), (4, 2));
        assert!(half.rgba.chunks(4).all(|p| p == [128, 128, 128, 255]), "{half:?}");
        // Three pixels become two: each keeps one whole and half of the middle one.
        let three = Pixels {
            width: 3,
            height: 1,
            rgba: vec![0, 0, 0, 255, 90, 90, 90, 255, 240, 240, 240, 255],
        };
        let two = shrunk(&three, 2, Shrink::Mean);
        assert_eq!((two.rgba[0], two.rgba[4]), (30, 190));
        assert_eq!(shrunk(&three, 3, Shrink::Mean), three);
    }

    #[test]
    fn one_marked_pixel_is_not_lost() {
        let mut white = Pixels { width: 100, height: 100, rgba: vec![255; 40_000] };
        white.rgba[4 * 5050..4 * 5050 + 3].copy_from_slice(&[213, 94, 0]);
        let marked = |p: &Pixels| p.rgba.chunks(4).filter(|c| c[2] == 0).count();
        assert_eq!(marked(&shrunk(&white, 10, Shrink::Strongest)), 1);
        assert_eq!(marked(&shrunk(&white, 10, Shrink::Mean)), 0);
    }

    #[test]
    fn previews_are_read_back_within_half_a_level() {
        let grey = Pixels {
            width: 256,
            height: 1,
            rgba: (0..=255u8).flat_map(|v| [v, v, v, 255]).collect(),
        };
        let colourful = Pixels {
            width: 64,
            height: 64,
            rgba: (0..4096u32)
                .flat_map(|i| [(i * 5) as u8, (i * 11) as u8, (i / 16) as u8, 255])
                .collect(),
        };
        for pixels in [grey, colourful] {
            let back = decode_png(&encode_preview(&pixels).unwrap()).unwrap();
            assert_eq!((back.width, back.height), (pixels.width, pixels.height));
            assert!(pixels.rgba.iter().zip(&back.rgba).all(|(a, b)| a.abs_diff(*b) <= 8));
        }
    }
}
