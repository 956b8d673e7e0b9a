//! Comparison of two pictures: the number of pixels that differ, by how much, and the structural
//! similarity.
//!
//! Hashes say *whether* two pictures differ; this says *how*. A picture of ours is mostly white,
//! and what matters may be two dots: means over the whole picture would call a picture with both
//! dots in the wrong place nearly perfect. So every mean is accompanied by the worst place.
//!
//! ```
//! use twofold_paper::compare::compare;
//! use twofold_render::Pixels;
//! let white = Pixels { width: 16, height: 16, rgba: vec![255; 4 * 16 * 16] };
//! let mut dotted = white.clone();
//! dotted.rgba[..3].fill(0);
//! assert_eq!(compare(&white, &white)?.changed_pixels, 0);
//! assert_eq!(compare(&white, &dotted)?.changed_pixels, 1);
//! # Ok::<(), twofold_paper::compare::SizesDiffer>(())
//! ```

use serde::Serialize;

use twofold_num::elementary::{exp, sqrt};
use twofold_render::Pixels;

/// Difference between two pictures of the same size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Pixels of which any channel differs.
    pub changed_pixels: u64,
    /// Their share of all pixels, in [0, 1].
    pub changed_share: f64,
    /// The largest difference of a channel, in levels of 0 to 255.
    pub largest_difference: u8,
    /// Root mean square difference over all pixels and the three channels, in levels of 0 to 255.
    pub rms: f64,
    /// The root mean square difference of the worst block of [`BLOCK`] by [`BLOCK`] pixels.
    pub worst_block_rms: f64,
    /// Mean structural similarity of the luminance (Wang, Bovik, Sheikh & Simoncelli 2004), 1 for
    /// equal pictures.
    pub ssim: f64,
    /// The structural similarity of the worst window.
    pub worst_ssim: f64,
}

/// Two pictures that cannot be held against each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("one picture has {} by {} pixels, the other {} by \
    {}", .expected.0, .expected.1, .actual.0, .actual.1)]
pub struct SizesDiffer {
    /// Width and height of the first.
    pub expected: (u32, u32),
    /// Width and height of the second.
    pub actual: (u32, u32),
}

/// Side of the blocks of [`Comparison::worst_block_rms`]: about two dots of a section wide.
pub const BLOCK: usize = 16;

/// Side of the SSIM window and the standard deviation of its Gaussian weights (Wang et al. 2004,
/// sec. III.C).
const WINDOW: usize = 11;
const SIGMA: f64 = 1.5;
/// (K1 L)^2 and (K2 L)^2 with K1 = 0.01, K2 = 0.03, L = 255 (Wang et al. 2004, eq. (7) and (12)).
const C1: f64 = (0.01 * 255.0) * (0.01 * 255.0);
const C2: f64 = (0.03 * 255.0) * (0.03 * 255.0);

/// Compares pixel by pixel. Transparent pixels are laid on white first.
///
/// # Errors
///
/// If the two have different sizes.
pub fn compare(expected: &Pixels, actual: &Pixels) -> Result<Comparison, SizesDiffer> {
    same_size(expected, actual)?;
    let (width, height) = (expected.width as usize, expected.height as usize);
    let (a, b) = (on_white(expected), on_white(actual));
    let mut changed = 0_u64;
    let mut largest = 0;
    let mut total = 0_u64;
    let columns = width.div_ceil(BLOCK);
    let mut blocks = vec![(0_u64, 0_u64); columns * height.div_ceil(BLOCK)];
    for (i, (p, q)) in a.iter().zip(&b).enumerate() {
        let block = &mut blocks[(i / width) / BLOCK * columns + (i % width) / BLOCK];
        block.1 += 3;
        if p == q {
            continue;
        }
        changed += 1;
        for (u, v) in p.iter().zip(q) {
            let d = u.abs_diff(*v);
            largest = largest.max(d);
            let square = u64::from(d) * u64::from(d);
            total += square;
            block.0 += square;
        }
    }
    let pixels = (width * height).max(1) as f64;
    let rms = |(sum, count): (u64, u64)| sqrt(sum as f64 / (count as f64).max(1.0));
    let (ssim, worst_ssim) =
        if changed == 0 { (1.0, 1.0) } else { similarity(&a, &b, width, height) };
    Ok(Comparison {
        width: expected.width,
        height: expected.height,
        changed_pixels: changed,
        changed_share: changed as f64 / pixels,
        largest_difference: largest,
        rms: rms((total, 3 * (width * height) as u64)),
        worst_block_rms: blocks.into_iter().map(rms).fold(0.0, f64::max),
        ssim,
        worst_ssim,
    })
}

fn same_size(expected: &Pixels, actual: &Pixels) -> Result<(), SizesDiffer> {
    let sizes = SizesDiffer {
        expected: (expected.width, expected.height),
        actual: (actual.width, actual.height),
    };
    if sizes.expected == sizes.actual { Ok(()) } else { Err(sizes) }
}

fn on_white(pixels: &Pixels) -> Vec<[u8; 3]> {
    pixels
        .rgba
        .chunks_exact(4)
        .map(|p| {
            let over = |c: u8| {
                ((u32::from(c) * u32::from(p[3]) + 255 * (255 - u32::from(p[3])) + 127) / 255) as u8
            };
            [over(p[0]), over(p[1]), over(p[2])]
        })
        .collect()
}

/// Luminance of ITU-R BT.601.
fn luminance(p: &[u8; 3]) -> f64 {
    0.299 * f64::from(p[0]) + 0.587 * f64::from(p[1]) + 0.114 * f64::from(p[2])
}

/// Mean and lowest SSIM over all windows inside the picture, at full resolution. A picture smaller
/// than a window is one window with equal weights.
fn similarity(a: &[[u8; 3]], b: &[[u8; 3]], width: usize, height: usize) -> (f64, f64) {
    let a: Vec<f64> = a.iter().map(luminance).collect();
    let b: Vec<f64> = b.iter().map(luminance).collect();
    if width < WINDOW || height < WINDOW {
        let mean =
            |f: &dyn Fn(usize) -> f64| (0..a.len()).map(f).sum::<f64>() / a.len().max(1) as f64;
        let s = ssim([
            mean(&|i| a[i]),
            mean(&|i| b[i]),
            mean(&|i| a[i] * a[i]),
            mean(&|i| b[i] * b[i]),
            mean(&|i| a[i] * b[i]),
        ]);
        return (s, s);
    }
    let weights = gaussian();
    let (wide, high) = (width - WINDOW + 1, height - WINDOW + 1);
    // A ring of WINDOW rows already averaged along x, then averaged along y: five moments at once.
    let mut ring = vec![[0.0; 5]; WINDOW * wide];
    let (mut sum, mut lowest) = (0.0, f64::INFINITY);
    for y in 0..height {
        let row = y * width;
        for x in 0..wide {
            let mut m = [0.0; 5];
            for (k, w) in weights.iter().enumerate() {
                let (p, q) = (a[row + x + k], b[row + x + k]);
                m[0] += w * p;
                m[1] += w * q;
                m[2] += w * p * p;
                m[3] += w * q * q;
                m[4] += w * p * q;
            }
            ring[(y % WINDOW) * wide + x] = m;
        }
        if y + 1 < WINDOW {
            continue;
        }
        for x in 0..wide {
            let mut m = [0.0; 5];
            for (k, w) in weights.iter().enumerate() {
                let line = &ring[((y + 1 - WINDOW + k) % WINDOW) * wide + x];
                m.iter_mut().zip(line).for_each(|(m, v)| *m += w * v);
            }
            let s = ssim(m);
            sum += s;
            lowest = f64::min(lowest, s);
        }
    }
    (sum / (wide * high) as f64, lowest)
}

/// Eq. (13) of Wang et al. (2004) from the means of a, b, a^2, b^2 and ab.
fn ssim([mean_a, mean_b, aa, bb, ab]: [f64; 5]) -> f64 {
    let (variance_a, variance_b) =
        ((aa - mean_a * mean_a).max(0.0), (bb - mean_b * mean_b).max(0.0));
    let covariance = ab - mean_a * mean_b;
    (2.0 * mean_a * mean_b + C1) * (2.0 * covariance + C2)
        / ((mean_a * mean_a + mean_b * mean_b + C1) * (variance_a + variance_b + C2))
}

fn gaussian() -> [f64; WINDOW] {
    let weights: [f64; WINDOW] = std::array::from_fn(|i| {
        let d = i as f64 - (WINDOW / 2) as f64;
        exp(-d * d / (2.0 * SIGMA * SIGMA))
    });
    let total: f64 = weights.iter().sum();
    weights.map(|w| w / total)
}

/// Colour of what only the expected picture shows, and of what only the actual one shows: told
/// apart with any colour vision.
const ONLY_EXPECTED: [u8; 3] = [213, 94, 0];
const ONLY_ACTUAL: [u8; 3] = [0, 114, 178];
/// Changed pixels are few when they are fewer than one in so many.
const FEW: usize = 1000;
/// Width at which a picture is shown small.
const SMALL: usize = 350;

/// The difference as a picture: what both share faintly in grey, ink that only `expected` has in
/// orange, ink that only `actual` has in blue. Changed pixels are drawn wider on each side, by one
/// pixel or, where they are few, by so many that a single one is seen when the picture is shown
/// small.
///
/// # Errors
///
/// If the two have different sizes.
pub fn difference_image(expected: &Pixels, actual: &Pixels) -> Result<Pixels, SizesDiffer> {
    same_size(expected, actual)?;
    let (width, height) = (expected.width as usize, expected.height as usize);
    let (a, b) = (on_white(expected), on_white(actual));
    let mut rgba: Vec<u8> = a
        .iter()
        .flat_map(|p| {
            let faint = 255 - ((255.0 - luminance(p)) * 0.22) as u8;
            [faint, faint, faint, 255]
        })
        .collect();
    let changed = a.iter().zip(&b).filter(|(p, q)| p != q).count();
    let wider = if changed * FEW < width * height { (width / SMALL).max(1) } else { 1 };
    for (i, (p, q)) in a.iter().zip(&b).enumerate().filter(|(_, (p, q))| p != q) {
        let colour = if luminance(p) < luminance(q) { ONLY_EXPECTED } else { ONLY_ACTUAL };
        let (x, y) = (i % width, i / width);
        for v in y.saturating_sub(wider)..(y + wider + 1).min(height) {
            for u in x.saturating_sub(wider)..(x + wider + 1).min(width) {
                rgba[4 * (v * width + u)..][..3].copy_from_slice(&colour);
            }
        }
    }
    Ok(Pixels { width: expected.width, height: expected.height, rgba })
}

/// A criterion by which two pictures agree, the strictest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Criterion {
    /// The file is byte for byte the same.
    #[serde(rename = "file")]
    SameFile,
    /// Every pixel is the same; only the file's encoding or its metadata differ.
    Pixels,
    /// Few pixels differ and none by much: another rasteriser's rounding.
    ChangedPixels,
    /// Many pixels differ, none by much: another colour depth, a careful lossy copy.
    Rms,
    /// The structure is the same everywhere: a lossy copy.
    Ssim,
}

/// The limits of the inexact criteria. Each bounds the whole picture and its worst place.
///
/// Measured on two pictures of dense sections: a palette of 64 colours, jitter of up to 6 levels on
/// all edges and JPEG of quality 95 hold by changed pixels or RMS; JPEG of quality 85 and scaling
/// to nine tenths and back by SSIM at the least; JPEG of quality 75, half size and back, a shift by
/// one pixel, and a black dot of three by three pixels on white (RMS 0.5, SSIM 0.99995 over the
/// whole picture) hold nowhere. What they cannot see is a dot of that size in the middle of a grey
/// cloud of dots: only the hashes do.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Limits {
    /// Largest share of changed pixels.
    pub changed_share: f64,
    /// Largest difference of a channel that goes with it, in levels.
    pub largest_difference: u8,
    /// Largest root mean square difference, in levels.
    pub rms: f64,
    /// Largest such difference in any block.
    pub worst_block_rms: f64,
    /// Smallest mean structural similarity.
    pub ssim: f64,
    /// Smallest structural similarity of any window.
    pub worst_ssim: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            changed_share: 0.01,
            largest_difference: 32,
            rms: 2.0,
            worst_block_rms: 8.0,
            ssim: 0.98,
            worst_ssim: 0.5,
        }
    }
}

impl Limits {
    /// The limits in words.
    pub fn describe(&self, criterion: Criterion) -> String {
        match criterion {
            Criterion::SameFile => "file: SHA-256 equal".into(),
            Criterion::Pixels => "pixels: SHA-256 of the decoded pixels equal".into(),
            Criterion::ChangedPixels => format!(
                "changed pixels: at most {} % changed, none by more than {} levels of 255",
                100.0 * self.changed_share,
                self.largest_difference
            ),
            Criterion::Rms => format!(
                "RMS: at most {} levels of 255, at most {} in any block of {BLOCK} by {BLOCK} \
                    pixels",
                self.rms, self.worst_block_rms
            ),
            Criterion::Ssim => {
                format!("SSIM: at least {}, at least {} in any window", self.ssim, self.worst_ssim)
            }
        }
    }

    /// The strictest inexact criterion that is met, if any is. Exact ones are decided by hashes.
    pub fn strictest(&self, c: &Comparison) -> Option<Criterion> {
        if c.changed_share <= self.changed_share && c.largest_difference <= self.largest_difference
        {
            Some(Criterion::ChangedPixels)
        } else if c.rms <= self.rms && c.worst_block_rms <= self.worst_block_rms {
            Some(Criterion::Rms)
        } else if c.ssim >= self.ssim && c.worst_ssim >= self.worst_ssim {
            Some(Criterion::Ssim)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests;
