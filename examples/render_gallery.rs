//! Draws a gallery of made-up data with every kind of panel, to look at. `cargo run --release
//! --example render_gallery -- OUTDIR [NAME]`

use twofold::num::elementary::{cos, exp, sin};
use twofold::render::render;
use twofold::render::sheet::*;
use twofold::render::style;

/// Points of the Henon-like area-preserving map, which has islands in a chaotic sea.
fn standard_map(k: f64, start: (f64, f64), n: usize) -> Vec<[f64; 2]> {
    let tau = 2.0 * std::f64::consts::PI;
    let (mut q, mut p) = start;
    (0..n)
        .map(|_| {
            p = (p + k * sin(q)).rem_euclid(tau);
            q = (q + p).rem_euclid(tau);
            [q - tau / 2.0, 0.4 * (p - tau / 2.0)]
        })
        .collect()
}

fn sections() -> Sheet {
    let early = || DotStyle::early();
    let axes = || (Axis::linear("*x*", -3.3, 3.3), Axis::linear("*z*", -1.4, 1.4));
    let mut cloud = Vec::new();
    for i in 0..25 {
        cloud.extend(standard_map(0.97, (0.25 * f64::from(i), 0.1 + 0.05 * f64::from(i)), 2000));
    }
    let chaos = standard_map(1.3, (3.0, 0.1), 50_000);
    let transient = standard_map(1.6, (1.0, 0.3), 700);
    let two: Vec<[f64; 2]> =
        (0..9000).map(|i| if i % 2 == 0 { [1.7, -0.02] } else { [-1.34, -0.02] }).collect();
    let panel = |first: Vec<[f64; 2]>, late: Vec<[f64; 2]>| {
        let (x, y) = axes();
        PlanePanel::new(x, y).dots(first, early()).dots(late, DotStyle::late())
    };
    Sheet::new(ColumnWidth::Wide, 3, "Three sections of made-up maps.")
        .title("Sections at *y* = 0, reading *reconstructed*")
        .panel("(i)", "interval 20", panel(transient.clone(), chaos))
        .panel("(ii)", "interval 40", panel(transient.clone(), two))
        .panel("(iii)", "interval 100", panel(transient, cloud))
        .legend(LegendEntry::new(LegendKey::Dots(early()), "0 < *t* ≤ 10^{5}"))
        .legend(LegendEntry::new(LegendKey::Dots(DotStyle::late()), "10^{5} < *t* ≤ 2×10^{5}"))
        .banner("SHORTENED: *t* = 500 instead of 200 000")
        .footer(
            "Caricature (5), smoothed (8); *α* = 10^{-1}, *β* = 10^{-5}, *ε* = 10^{-3}, \
            *v*_{+} = -1.2, *v*_{-} = -1.4; start (0.2, 0, -1); LSODA, rtol = atol = \
            10^{-7.97727}, step cap a tenth of the interval; state (*x*, *y*, *z*) restarted after \
            every interval.",
        )
        .provenance("spec", "0123abcd")
        .provenance("reading", "reconstructed & <odd> \"α\" (x) \\ y")
}

fn lorenz(n: usize, dt: f64) -> Vec<[f64; 3]> {
    let mut s = [1.0, 1.0, 20.0];
    let f = |s: [f64; 3]| {
        [10.0 * (s[1] - s[0]), s[0] * (28.0 - s[2]) - s[1], s[0] * s[1] - 8.0 / 3.0 * s[2]]
    };
    let add =
        |a: [f64; 3], b: [f64; 3], h: f64| [a[0] + h * b[0], a[1] + h * b[1], a[2] + h * b[2]];
    (0..n)
        .map(|_| {
            let k1 = f(s);
            let k2 = f(add(s, k1, 0.5 * dt));
            let k3 = f(add(s, k2, 0.5 * dt));
            let k4 = f(add(s, k3, dt));
            for (i, v) in s.iter_mut().enumerate() {
                *v += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
            s
        })
        .collect()
}

fn space() -> Sheet {
    let path = lorenz(60_000, 0.0015);
    let region = |u: f64, v: f64| match (u > 0.0, v > 27.0) {
        (true, true) => style::ATTRACTING,
        (false, false) => style::REPELLING,
        _ => style::CROSSING,
    };
    let surface = grid_surface((-18.0, 18.0, 36), (3.0, 47.0, 44), |u, v| [u, 0.5 * u, v], region);
    let panel = SpacePanel::new(
        Axis::linear("*x*", -20.0, 20.0),
        Axis::linear("*y*", -28.0, 28.0),
        Axis::linear("*z*", 0.0, 50.0),
    )
    .camera(-115.0, 18.0)
    .surface(surface)
    .line(path, LineStyle::default())
    .markers(vec![[0.0, 0.0, 27.0]], MarkerStyle::new(MarkerShape::Dot, style::MAGENTA))
    .note([0.0, 0.0, 27.0], "two-fold", Anchor::Right);
    let mut sheet =
        Sheet::new(ColumnWidth::Single, 1, "A trajectory of the Lorenz system and a plane.")
            .title("Wheel trajectory (reconstruction)")
            .panel("", "", panel)
            .footer(
                "*m* = 1, *J* = 0.02, *d* = 1, *γ* = *π*/4, *k*_{w} = 2, *ε* = 10^{-3}, *t* = 0…60",
            );
    sheet.panel_aspect = 0.9;
    for (c, t) in [
        (style::ATTRACTING, "attracting"),
        (style::REPELLING, "repelling"),
        (style::CROSSING, "crossing"),
    ] {
        sheet = sheet.legend(LegendEntry::new(LegendKey::Area(c, style::SURFACE_OPACITY), t));
    }
    sheet.legend(LegendEntry::new(LegendKey::Line(LineStyle::default()), "trajectory"))
}

fn four_spaces() -> Sheet {
    let mut sheet = Sheet::new(ColumnWidth::Wide, 4, "Four trajectories.").footer("*α* = 10^{-1}");
    for (i, label) in ["(i)", "(ii)", "(iii)", "(iv)"].into_iter().enumerate() {
        let path = lorenz(20_000 + 5_000 * i, 0.0015);
        let panel = SpacePanel::new(
            Axis::linear("*y*", -28.0, 28.0),
            Axis::linear("*z*", 0.0, 50.0),
            Axis::linear("*x*", -20.0, 20.0),
        )
        .line(path.iter().map(|p| [p[1], p[2], p[0]]).collect(), LineStyle::new(style::INK, 0.5));
        sheet = sheet.panel(
            label,
            ["smoothed", "hysteretic", "noise, run 1", "noise, run 2"][i],
            panel,
        );
    }
    sheet.panel_aspect = 1.0;
    sheet
}

fn charts() -> Sheet {
    let cost = |c: f64, order: f64| -> Vec<[f64; 2]> {
        (2..12)
            .map(|k| {
                [
                    c * exp(f64::from(k) * std::f64::consts::LN_10 / order),
                    exp(-f64::from(k) * std::f64::consts::LN_10),
                ]
            })
            .collect()
    };
    let mut work = PlanePanel::new(
        Axis::log("function evaluations", 50.0, 2e5),
        Axis::log("error at the end", 1e-12, 1e-1),
    )
    .grid();
    for (i, (name, c, order)) in
        [("LSODA", 60.0, 6.0), ("DOPRI5", 40.0, 5.0), ("Radau IIA", 90.0, 5.5)]
            .into_iter()
            .enumerate()
    {
        let shape = [MarkerShape::Dot, MarkerShape::Square, MarkerShape::Triangle][i];
        let (line, marker) =
            (LineStyle::new(style::SERIES[i], 1.0), MarkerStyle::new(shape, style::SERIES[i]));
        let points = cost(c, order);
        work = work
            .line(points.clone(), line)
            .markers(points, marker)
            .legend(LegendKey::LineMarker(line, marker), name);
    }
    let regions = PlanePanel::new(Axis::linear("*y*", -2.0, 2.0), Axis::linear("*z*", -2.0, 2.0))
        .equal()
        .area(vec![[0.0, 0.0], [5.0, 0.0], [5.0, 5.0], [0.0, 5.0]], style::ATTRACTING)
        .area(vec![[0.0, 0.0], [-5.0, 0.0], [-5.0, -5.0], [0.0, -5.0]], style::REPELLING)
        .area(vec![[0.0, 0.0], [5.0, 0.0], [5.0, -5.0], [0.0, -5.0]], style::CROSSING)
        .area(vec![[0.0, 0.0], [-5.0, 0.0], [-5.0, 5.0], [0.0, 5.0]], style::CROSSING)
        .arrow(
            (0..60)
                .map(|i| f64::from(i) * 0.025)
                .map(|t| [1.8 - t, 1.9 - 1.2 * t - 0.1 * sin(4.0 * t)])
                .collect(),
            LineStyle::default(),
        )
        .arrow(vec![[-0.2, -0.2], [-1.5, -0.8]], LineStyle::default().dashed())
        .line(
            (0..200).map(|i| f64::from(i) * 0.02).map(|t| [-2.0 + t, 1.5 * cos(3.0 * t)]).collect(),
            LineStyle::new(style::PURPLE, 0.8).dotted(),
        )
        .markers(vec![[0.0, 0.0]], MarkerStyle::new(MarkerShape::Star, style::MAGENTA))
        .markers(vec![[1.0, -1.0]], MarkerStyle::new(MarkerShape::OpenDot, style::INK))
        .markers(vec![[-1.0, 1.0]], MarkerStyle::new(MarkerShape::Cross, style::INK))
        .note([0.0, 0.0], "two-fold", Anchor::Right)
        .note([1.2, 1.7], "attracting", Anchor::Centre)
        .note([-1.2, -1.7], "repelling", Anchor::Centre);
    let mut sketch = PlanePanel::sketch((-1.2, 1.2), (-1.2, 1.2));
    let circle = |r: f64| -> Vec<[f64; 2]> {
        (0..=72).map(|i| f64::from(i) * 0.0872664626).map(|a| [r * cos(a), r * sin(a)]).collect()
    };
    sketch = sketch
        .solid(circle(1.0), style::CROSSING)
        .line(circle(1.0), LineStyle::default())
        .arrow(vec![[0.0, 0.0], [0.6, 0.35]], LineStyle::new(style::VERMILLION, 1.2))
        .note([0.6, 0.35], "*r*", Anchor::Left)
        .note([0.0, -0.5], "*ω*_{0}", Anchor::Centre)
        .markers(vec![[0.0, 0.0]], MarkerStyle::new(MarkerShape::Dot, style::INK));
    Sheet::new(ColumnWidth::Wide, 3, "Work against precision, regions, a sketch.")
        .panel("(a)", "work and precision", work)
        .panel("(b)", "regions", regions)
        .panel("(c)", "sketch", sketch)
}

fn helix() -> SpacePanel {
    let unit = |t: &str| Axis::linear(t, -1.0, 1.0);
    let turn = |from: u32, to: u32| {
        (from..to)
            .map(|i| f64::from(i) * 0.02)
            .map(|t| [0.8 * cos(t), 0.8 * sin(t), t / 8.0 - 1.0])
            .collect()
    };
    let plane = grid_surface(
        (-1.0, 1.0, 20),
        (-1.0, 1.0, 20),
        |u, v| [u, v, 0.0],
        |u, v| {
            if u > 0.0 && v > 0.0 {
                style::ATTRACTING
            } else if u < 0.0 && v < 0.0 {
                style::REPELLING
            } else {
                style::CROSSING
            }
        },
    );
    SpacePanel::new(unit("*x*"), unit("*y*"), unit("*z*"))
        .surface(plane)
        .line(turn(0, 300), LineStyle::default())
        .arrow(turn(299, 500), LineStyle::new(style::BLUE, 1.2))
        .line(turn(499, 780), LineStyle::new(style::VERMILLION, 1.0).dashed())
        .arrow(vec![[0.0, 0.0, 0.0], [0.0, 0.0, 0.8]], LineStyle::default())
        .note([0.0, 0.0, 0.8], "*h* > 0", Anchor::Above)
}

fn edge_cases() -> Sheet {
    Sheet::new(ColumnWidth::Wide, 4, "Edge cases.")
        .title("Edge cases")
        .panel(
            "(a)",
            "empty",
            PlanePanel::new(Axis::linear("*x*", 0.0, 1.0), Axis::linear("*y*", 0.0, 1.0)),
        )
        .panel(
            "(b)",
            "one point",
            PlanePanel::new(Axis::linear("*x*", 0.0, 2e5), Axis::linear("*y*", -1e-4, 1e-4))
                .dots(vec![[1e5, 0.0]], DotStyle::late()),
        )
        .panel(
            "(c)",
            "no range",
            PlanePanel::new(Axis::linear("*x*", 3.0, 3.0), Axis::linear("*y*", 0.0, 0.0))
                .dots(vec![[3.0, 0.0], [f64::NAN, 1.0]], DotStyle::late()),
        )
        .panel(
            "(d)",
            "bare",
            SpacePanel::new(
                Axis::linear("*x*", 0.0, 1.0),
                Axis::linear("*y*", 0.0, 1.0),
                Axis::linear("*z*", 1e-5, 2e-5),
            ),
        )
        .panel(
            "(e)",
            "from below",
            SpacePanel::new(
                Axis::linear("*x*", 0.0, 1.0),
                Axis::linear("*y*", 0.0, 1.0),
                Axis::linear("*z*", 0.0, 1.0),
            )
            .camera(40.0, -20.0),
        )
        .panel("(f)", "unboxed", helix().unboxed())
        .panel("(g)", "dashed", helix())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let out = std::path::PathBuf::from(std::env::args().nth(1).ok_or("give a directory")?);
    std::fs::create_dir_all(&out)?;
    let all = [
        ("sections", sections()),
        ("space", space()),
        ("four", four_spaces()),
        ("charts", charts()),
        ("edge", edge_cases()),
    ];
    let only = std::env::args().nth(2);
    for (name, sheet) in
        all.into_iter().filter(|(name, _)| only.as_deref().is_none_or(|o| o == *name))
    {
        let started = std::time::Instant::now();
        let picture = render(&sheet)?;
        println!(
            "{name}: {:?}, png {} svg {} pdf {}",
            started.elapsed(),
            picture.png.len(),
            picture.svg.len(),
            picture.pdf.len()
        );
        std::fs::write(out.join(format!("{name}.png")), &picture.png)?;
        std::fs::write(out.join(format!("{name}.svg")), &picture.svg)?;
        std::fs::write(out.join(format!("{name}.pdf")), &picture.pdf)?;
    }
    Ok(())
}
