//! From recordings to a drawing: which points, lines and surfaces, in which colours and ranges.

use super::simulate::{Data, Recording};
use super::spec::SystemSpec;
use super::{Camera, Panel, Picture, View, surface, wording};
use crate::observe::{Crossing, Sample};
use crate::record::Hash;
use crate::render::sheet::{
    Axis, ColumnWidth, DotStyle, LegendEntry, LegendKey, LineStyle, MarkerShape, MarkerStyle, PlanePanel, Sheet,
    SpacePanel, range_of,
};
use crate::render::style;

/// The drawing of a picture.
pub fn sheet(picture: &Picture, recordings: &[Recording], spec: &Hash, data: &Hash) -> Sheet {
    let runs: Vec<_> = picture.panels.iter().map(|p| &p.run).collect();
    let mut sheet = Sheet::new(ColumnWidth::Double, columns(picture), wording::plain(&picture.caption))
        .title(picture.title)
        .provenance("Software", concat!("twofold ", env!("CARGO_PKG_VERSION")))
        .provenance("Picture", &picture.name)
        .provenance("Reading", picture.reading.map_or("none", |r| r.word()))
        .provenance("Method", methods(picture))
        .provenance("Spec-SHA256", spec.as_str())
        .provenance("Data-SHA256", data.as_str());
    if let Some(reading) = picture.reading {
        sheet = sheet.subtitle(wording::reading(reading));
    }
    if picture.panels.iter().any(|p| matches!(p.run.system, SystemSpec::Wheel(_))) {
        sheet = sheet.subtitle("reconstruction: the paper gives the form of the equations, not their coefficients");
    }
    for line in wording::small_print(picture.reading, &runs) {
        sheet = sheet.footer(line);
    }
    if !picture.alterations.is_empty() {
        sheet = sheet.banner(format!("NOT THE PUBLISHED PICTURE: {}", picture.alterations.join("; ")));
    }
    match picture.view {
        View::Section { horizontal, vertical } => section_panels(sheet, picture, recordings, [horizontal, vertical]),
        View::Space { camera } => space_panels(sheet, picture, recordings, &camera),
    }
}

/// Up to three panels stand side by side, four in a square.
fn columns(picture: &Picture) -> usize {
    match picture.panels.len() {
        n @ 0..=3 => n.max(1),
        4 => 2,
        _ => 3,
    }
}

fn methods(picture: &Picture) -> String {
    let mut names: Vec<&str> = picture.panels.iter().map(|p| p.run.method.name.name()).collect();
    names.dedup();
    names.join(", ")
}

/// "(ii)"; nothing where there is only one panel.
fn label(picture: &Picture, panel: &Panel) -> String {
    if picture.panels.len() > 1 { format!("({})", panel.label) } else { String::new() }
}

/// Sections: the same axes in every panel, so that sizes can be compared.
fn section_panels(mut sheet: Sheet, picture: &Picture, recordings: &[Recording], axes: [usize; 2]) -> Sheet {
    let all = || recordings.iter().flat_map(|r| crossings(&r.data));
    let names = picture.panels[0].run.system.coordinates();
    let axis = |i: usize| Axis::covering(format!("*{}*", greek(names[axes[i]])), all().map(|c| c.x[axes[i]]));
    for (panel, recording) in picture.panels.iter().zip(recordings) {
        let half = 0.5 * panel.run.t_end;
        let points = |late: bool| {
            crossings(&recording.data).iter().filter(|c| (c.t > half) == late).map(|c| axes.map(|i| c.x[i])).collect()
        };
        let chart = PlanePanel::new(axis(0), axis(1))
            .dots(points(false), DotStyle::early())
            .dots(points(true), DotStyle::late());
        sheet = sheet.panel(label(picture, panel), panel.title.as_str(), chart);
    }
    let half = wording::number(0.5 * picture.panels[0].run.t_end);
    sheet
        .legend(LegendEntry::new(LegendKey::Dots(DotStyle::early()), format!("*t* ≤ {half}")))
        .legend(LegendEntry::new(LegendKey::Dots(DotStyle::late()), format!("*t* > {half}")))
}

/// Paths in space: the same box in every panel.
fn space_panels(mut sheet: Sheet, picture: &Picture, recordings: &[Recording], camera: &Camera) -> Sheet {
    let samples = || recordings.iter().flat_map(|r| samples(&r.data));
    let ranges: [(f64, f64); 3] = std::array::from_fn(|i| {
        let (low, high) = range_of(samples().map(|s| s.x[i]));
        let margin = 0.04 * (high - low);
        (low - margin, high + margin)
    });
    let names = picture.panels[0].run.system.coordinates();
    let order = camera.axes;
    let axis = |k: usize| {
        let (low, high) = ranges[order[k]];
        Axis::linear(format!("*{}*", greek(names[order[k]])), low, high)
    };
    let turn = |x: [f64; 3]| order.map(|i| x[i]);
    for (panel, recording) in picture.panels.iter().zip(recordings) {
        let mut patches = surface::patches(&panel.run.system, &ranges, SURFACE_CELLS);
        for corner in patches.iter_mut().flat_map(|p| p.corners.iter_mut()) {
            *corner = turn(*corner);
        }
        let path = self::samples(&recording.data).iter().map(|s| turn(s.x)).collect();
        let mut chart = SpacePanel::new(axis(0), axis(1), axis(2))
            .camera(camera.azimuth, camera.elevation)
            .surface(patches)
            .line(path, LineStyle::new(style::INK, PATH_PT));
        if let Some(point) = surface::singularity(&panel.run.system) {
            chart = chart.markers(vec![turn(point)], SINGULARITY);
        }
        sheet = sheet.panel(label(picture, panel), panel.title.as_str(), chart);
    }
    region_legend(sheet)
}

/// What the colours of the surface mean.
fn region_legend(sheet: Sheet) -> Sheet {
    let area = |colour, text: &str| LegendEntry::new(LegendKey::Area(colour, style::SURFACE_OPACITY), text);
    sheet
        .legend(area(style::ATTRACTING, "attracting"))
        .legend(area(style::REPELLING, "repelling"))
        .legend(area(style::CROSSING, "crossing"))
        .legend(LegendEntry::new(LegendKey::Marker(SINGULARITY), "two-fold singularity"))
}

/// Cells of the switching surface along each side.
const SURFACE_CELLS: usize = 60;
/// Width of a long path, in points: thinner than a curve, so that windings stay apart.
const PATH_PT: f64 = 0.5;
/// The two-fold.
const SINGULARITY: MarkerStyle = MarkerStyle::new(MarkerShape::Dot, style::MAGENTA);

fn crossings(data: &Data) -> &[Crossing] {
    match data {
        Data::Section(crossings) => crossings,
        Data::Path(_) => &[],
    }
}

fn samples(data: &Data) -> &[Sample] {
    match data {
        Data::Path(samples) => samples,
        Data::Section(_) => &[],
    }
}

/// A coordinate's name as it is printed.
fn greek(name: &str) -> &str {
    match name {
        "omega" => "ω",
        other => other,
    }
}
