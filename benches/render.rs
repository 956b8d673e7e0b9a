//! Drawing a figure of three sections with 50 000 points each, in both halves: PNG, SVG and PDF
//! together.

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use twofold::num::elementary::{cos, sin};
use twofold::render::render;
use twofold::render::sheet::{
    Axis, ColumnWidth, DotStyle, LineStyle, PlanePanel, Sheet, SpacePanel,
};
use twofold::render::style;

/// The standard map: islands in a chaotic sea, as in the paper's sections.
fn cloud(k: f64, n: usize) -> Vec<[f64; 2]> {
    let tau = 2.0 * std::f64::consts::PI;
    let mut points = Vec::with_capacity(n);
    for i in 0..25 {
        let (mut q, mut p) = (0.25 * f64::from(i), 0.1 + 0.05 * f64::from(i));
        for _ in 0..n / 25 {
            p = (p + k * sin(q)).rem_euclid(tau);
            q = (q + p).rem_euclid(tau);
            points.push([q, p]);
        }
    }
    points
}

fn sections() -> Sheet {
    let mut sheet = Sheet::new(ColumnWidth::Wide, 3, "Three sections.")
        .title("Sections")
        .footer("*α* = 10^{-3}");
    for (label, k) in [("(i)", 0.9), ("(ii)", 0.97), ("(iii)", 1.1)] {
        let panel = PlanePanel::new(Axis::linear("*x*", 0.0, 6.3), Axis::linear("*z*", 0.0, 6.3))
            .dots(cloud(k + 0.5, 25_000), DotStyle::early())
            .dots(cloud(k, 25_000), DotStyle::late());
        sheet = sheet.panel(label, "section", panel);
    }
    sheet
}

fn curve() -> Sheet {
    let path = (0..300_000)
        .map(|i| f64::from(i) * 2e-3)
        .map(|t| {
            [sin(t) * (1.0 + 0.3 * cos(0.117 * t)), cos(1.0071 * t), sin(0.0311 * t + 0.4 * sin(t))]
        })
        .collect();
    let panel = SpacePanel::new(
        Axis::linear("*x*", -1.4, 1.4),
        Axis::linear("*y*", -1.2, 1.2),
        Axis::linear("*z*", -1.2, 1.2),
    )
    .line(path, LineStyle::new(style::INK, 0.5));
    Sheet::new(ColumnWidth::Single, 1, "A curve of 300 000 vertices.").panel("(i)", "curve", panel)
}

fn benchmark(c: &mut Criterion) {
    let (sections, curve) = (sections(), curve());
    let mut group = c.benchmark_group("render");
    group.sample_size(20);
    group
        .bench_function("sections, 3 x 50 000 points", |b| b.iter(|| render(black_box(&sections))));
    group.bench_function("curve in space, 300 000 vertices", |b| {
        b.iter(|| render(black_box(&curve)))
    });
    group.finish();
}

criterion_group!(benches, benchmark);
criterion_main!(benches);
