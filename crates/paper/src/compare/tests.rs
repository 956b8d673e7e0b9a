use super::*;

fn grey(width: u32, height: u32, value: impl Fn(usize) -> u8) -> Pixels {
    let rgba =
        (0..(width * height) as usize).flat_map(|i| [value(i), value(i), value(i), 255]).collect();
    Pixels { width, height, rgba }
}

/// Noise from a generator that the reference program shares.
fn noise(width: u32, height: u32, seed: u64) -> Pixels {
    let mut state = seed;
    let values: Vec<u8> = (0..width * height)
        .map(|_| {
            state = (state * 1_103_515_245 + 12_345) % (1 << 31);
            (state >> 16 & 255) as u8
        })
        .collect();
    grey(width, height, |i| values[i])
}

fn close(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-9, "{a} is not {b}");
}

#[test]
fn a_picture_is_like_itself() {
    let a = noise(40, 30, 1);
    let c = compare(&a, &a).unwrap();
    assert_eq!((c.changed_pixels, c.changed_share, c.largest_difference), (0, 0.0, 0));
    assert_eq!((c.rms, c.worst_block_rms, c.ssim, c.worst_ssim), (0.0, 0.0, 1.0, 1.0));
    // Not only by the short cut for equal pictures.
    let (mean, worst) = similarity(&on_white(&a), &on_white(&a), 40, 30);
    close(mean, 1.0);
    close(worst, 1.0);
}

#[test]
fn flat_pictures_have_the_similarity_of_their_means() {
    let c = compare(&grey(20, 20, |_| 100), &grey(20, 20, |_| 120)).unwrap();
    let expected = (2.0 * 100.0 * 120.0 + C1) / (100.0 * 100.0 + 120.0 * 120.0 + C1);
    close(c.ssim, expected);
    close(c.worst_ssim, expected);
    assert_eq!((c.changed_pixels, c.changed_share, c.largest_difference), (400, 1.0, 20));
    close(c.rms, 20.0);
    close(c.worst_block_rms, 20.0);
}

/// (mean, lowest) for each pair of the test below.
const SKIMAGE: [(f64, f64); 3] = [
    (0.014254053047902684, -0.40541424866284276),
    (0.9525019610369865, 0.9483863728798687),
    (-0.04043872541475178, -0.565134386108423),
];

#[test]
fn similarity_is_that_of_another_program() {
    // scikit-image 0.26: structural_similarity(gaussian_weights=True, sigma=1.5,
    // use_sample_covariance=False, data_range=255).
    let a = noise(40, 30, 1);
    let pixel = |i: usize| a.rgba[4 * i];
    let paler = grey(40, 30, |i| (f64::from(pixel(i)) * 0.75 + 16.0) as u8);
    let shifted = grey(40, 30, |i| pixel(i / 40 * 40 + (i % 40 + 39) % 40));
    for (other, mean, worst) in [
        (noise(40, 30, 2), SKIMAGE[0].0, SKIMAGE[0].1),
        (paler, SKIMAGE[1].0, SKIMAGE[1].1),
        (shifted, SKIMAGE[2].0, SKIMAGE[2].1),
    ] {
        let c = compare(&a, &other).unwrap();
        close(c.ssim, mean);
        close(c.worst_ssim, worst);
    }
}

#[test]
fn one_wrong_dot_is_found_where_the_means_are_blind() {
    let white = grey(400, 300, |_| 255);
    let dotted = grey(400, 300, |i| {
        if (100..105).contains(&(i % 400)) && (100..105).contains(&(i / 400)) { 20 } else { 255 }
    });
    let c = compare(&white, &dotted).unwrap();
    assert_eq!(c.changed_pixels, 25);
    let limits = Limits::default();
    assert!(c.rms > limits.rms && c.ssim > limits.ssim && c.changed_share < limits.changed_share);
    assert!(c.worst_ssim < 0.1 && c.worst_block_rms > 50.0);
    assert_eq!(limits.strictest(&c), None);
}

#[test]
fn criteria_go_from_strict_to_loose() {
    let limits = Limits::default();
    let same = compare(&noise(40, 30, 1), &noise(40, 30, 1)).unwrap();
    assert_eq!(limits.strictest(&same), Some(Criterion::ChangedPixels));
    let many = Comparison {
        changed_share: 0.5,
        rms: 1.0,
        worst_block_rms: 3.0,
        largest_difference: 9,
        ..same
    };
    assert_eq!(limits.strictest(&many), Some(Criterion::Rms));
    let lossy = Comparison { rms: 3.0, ssim: 0.99, worst_ssim: 0.8, ..many };
    assert_eq!(limits.strictest(&lossy), Some(Criterion::Ssim));
    assert_eq!(limits.strictest(&Comparison { worst_ssim: 0.1, ..lossy }), None);
    // A number that is not one holds nowhere.
    let nan = Comparison { changed_share: f64::NAN, rms: f64::NAN, ssim: f64::NAN, ..same };
    assert_eq!(limits.strictest(&nan), None);
    assert!(
        Criterion::SameFile < Criterion::Pixels
            && Criterion::Pixels < Criterion::ChangedPixels
            && Criterion::Rms < Criterion::Ssim
    );
}

#[test]
fn other_sizes_are_refused_and_small_ones_compared() {
    let error = compare(&grey(3, 2, |_| 0), &grey(2, 3, |_| 0)).unwrap_err();
    assert_eq!(error.to_string(), "one picture has 3 by 2 pixels, the other 2 by 3");
    let c = compare(&grey(2, 2, |_| 0), &grey(2, 2, |i| 255 * u8::from(i == 0))).unwrap();
    assert_eq!(c.changed_pixels, 1);
    assert!(c.ssim < 0.5);
    assert_eq!(compare(&grey(0, 0, |_| 0), &grey(0, 0, |_| 0)).unwrap().changed_pixels, 0);
}

#[test]
fn transparency_is_laid_on_white() {
    let clear = Pixels { width: 1, height: 1, rgba: vec![0, 0, 0, 0] };
    assert_eq!(compare(&clear, &grey(1, 1, |_| 255)).unwrap().changed_pixels, 0);
}

#[test]
fn the_difference_shows_who_has_the_ink() {
    let dot = |at: usize| grey(20, 5, move |i| if i == at { 0 } else { 255 });
    let d = difference_image(&dot(42), &dot(52)).unwrap();
    let pixel = |i: usize| [d.rgba[4 * i], d.rgba[4 * i + 1], d.rgba[4 * i + 2]];
    assert_eq!((pixel(42), pixel(52), pixel(47)), (ONLY_EXPECTED, ONLY_ACTUAL, [255; 3]));
    assert_eq!(pixel(21), ONLY_EXPECTED);
    let shared = difference_image(&dot(42), &dot(42)).unwrap();
    assert!(shared.rgba[4 * 42] < 255 && shared.rgba[4 * 42] > 150);
    // One pixel among very many is drawn large enough to be seen.
    let (white, speck) =
        (grey(1050, 100, |_| 255), grey(1050, 100, |i| if i == 50_500 { 0 } else { 255 }));
    let d = difference_image(&white, &speck).unwrap();
    let blue = d.rgba.chunks_exact(4).filter(|p| p[..3] == ONLY_ACTUAL).count();
    assert_eq!(blue, 49);
}

/// One pixel of colour among many: every mean counts three channels, and the worst block is the
/// small one in the corner.
#[test]
fn means_are_over_channels_and_blocks() {
    let white = grey(20, 20, |_| 255);
    let mut pinker = white.clone();
    pinker.rgba[4 * (20 * 3 + 17) + 1] -= 30;
    let c = compare(&white, &pinker).unwrap();
    assert_eq!((c.changed_pixels, c.largest_difference), (1, 30));
    close(c.changed_share, 1.0 / 400.0);
    close(c.rms, (900.0_f64 / 1200.0).sqrt());
    // Columns 16 to 19, rows 0 to 15.
    close(c.worst_block_rms, (900.0_f64 / 192.0).sqrt());
}

#[test]
fn a_small_picture_is_one_window() {
    let (a, b) = ([10, 20, 30, 40], [12, 18, 33, 47]);
    let c = compare(&grey(2, 2, |i| a[i]), &grey(2, 2, |i| b[i])).unwrap();
    // Means 25 and 27.5, variances 125 and 185.25, covariance 150.
    let (c1, c2) = (6.5025, 58.5225);
    close(c.ssim, (1375.0 + c1) * (300.0 + c2) / ((625.0 + 756.25 + c1) * (310.25 + c2)));
    assert_eq!(c.ssim, c.worst_ssim);
    // Too low for a window, though wide enough; and the other way round.
    for (w, h) in [(40, 10), (10, 40)] {
        let c = compare(&noise(w, h, 1), &noise(w, h, 2)).unwrap();
        assert_eq!(c.ssim, c.worst_ssim);
    }
    for (w, h) in [(11, 12), (12, 11)] {
        let c = compare(&noise(w, h, 1), &noise(w, h, 2)).unwrap();
        assert!(c.worst_ssim < c.ssim, "two windows of their own");
    }
}

/// Colours have the luminance of ITU-R BT.601.
#[test]
fn colours_are_as_light_as_they_look() {
    let flat =
        |c: [u8; 3]| Pixels { width: 12, height: 12, rgba: [c[0], c[1], c[2], 255].repeat(144) };
    for (colour, luminance) in [([200, 0, 0], 59.8), ([0, 200, 0], 117.4), ([0, 0, 200], 22.8)] {
        let c = compare(&flat(colour), &flat([90; 3])).unwrap();
        close(c.ssim, (2.0 * 90.0 * luminance + C1) / (8100.0 + luminance * luminance + C1));
    }
}

#[test]
fn half_transparent_colours_are_mixed_with_white() {
    let half = Pixels { width: 1, height: 1, rgba: vec![100, 200, 0, 128] };
    // 255 + (c - 255) 128/255, rounded.
    assert_eq!(on_white(&half), [[177, 227, 127]]);
    let opaque = Pixels { width: 1, height: 1, rgba: vec![100, 200, 0, 255] };
    assert_eq!(on_white(&opaque), [[100, 200, 0]]);
}

#[test]
fn the_difference_is_drawn_inside_the_picture_and_the_rest_faintly() {
    let (black, lighter) =
        (grey(6, 4, |_| 0), grey(6, 4, |i| if i == 0 || i == 23 { 9 } else { 0 }));
    let d = difference_image(&black, &lighter).unwrap();
    let orange: Vec<usize> = (0..24).filter(|i| d.rgba[4 * i..][..3] == ONLY_EXPECTED).collect();
    // Two corners and what touches them.
    assert_eq!(orange, [0, 1, 6, 7, 16, 17, 22, 23]);
    // Shared black: a tenth and a fifth of ink are seen and do not shout.
    assert_eq!(d.rgba[4 * 3], 255 - 56);
    let d = difference_image(&grey(1, 1, |_| 155), &grey(1, 1, |_| 155)).unwrap();
    assert_eq!(d.rgba, [233, 233, 233, 255]);
}

#[test]
fn limits_are_said_in_words() {
    let limits = Limits::default();
    assert_eq!(
        limits.describe(Criterion::ChangedPixels),
        "changed pixels: at most 1 % changed, none by more than 32 levels of 255"
    );
    assert_eq!(limits.describe(Criterion::Ssim), "SSIM: at least 0.98, at least 0.5 in any window");
    // At the limit is inside it.
    let c = compare(&grey(2, 2, |_| 0), &grey(2, 2, |_| 0)).unwrap();
    let just = Comparison { changed_share: 0.01, largest_difference: 32, ..c };
    assert_eq!(limits.strictest(&just), Some(Criterion::ChangedPixels));
    assert_eq!(
        limits.strictest(&Comparison {
            largest_difference: 33,
            rms: 2.0,
            worst_block_rms: 8.0,
            ..just
        }),
        Some(Criterion::Rms)
    );
    let blurred =
        Comparison { largest_difference: 33, rms: 2.1, ssim: 0.98, worst_ssim: 0.5, ..just };
    assert_eq!(limits.strictest(&blurred), Some(Criterion::Ssim));
    assert_eq!(limits.strictest(&Comparison { ssim: 0.97, ..blurred }), None);
}

/// Few changed pixels are drawn wide, many are not: one in a thousand is the border.
#[test]
fn as_wide_as_they_are_few() {
    let white = grey(1050, 100, |_| 255);
    let blue = |changed: usize| {
        let specked =
            grey(1050, 100, |i| if i % 1000 == 500 && i / 1000 < changed { 0 } else { 255 });
        let d = difference_image(&white, &specked).unwrap();
        d.rgba.chunks_exact(4).filter(|p| p[..3] == ONLY_ACTUAL).count() as f64 / changed as f64
    };
    assert!(blue(104) > 40.0, "seven by seven, some of them cut at an edge");
    assert!(blue(105) < 10.0, "three by three");
    let dense = grey(1050, 100, |i| if i % 100 == 50 { 0 } else { 255 });
    let d = difference_image(&white, &dense).unwrap();
    assert!(d.rgba.chunks_exact(4).filter(|p| p[..3] == ONLY_ACTUAL).count() < 9 * 1051);
}
