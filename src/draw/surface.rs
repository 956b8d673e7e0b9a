//! The switching surface as a picture needs it: patches coloured by what happens there.

use nalgebra::{SVector, vector};

use crate::render::sheet::{Colour, Patch};
use crate::render::style;
use crate::system::filippov::{Region, region, two_fold};
use crate::system::{Caricature, Compiled, PiecewiseSmooth, System, Wheel};

/// The colour of a region.
pub fn colour(region: Region) -> Colour {
    match region {
        Region::Attracting => style::ATTRACTING,
        Region::Repelling => style::REPELLING,
        Region::CrossingUp | Region::CrossingDown | Region::Boundary => style::CROSSING,
    }
}

/// The patches of h = 0 inside the box `ranges` (one (low, high) per coordinate), in the state's order of coordinates.
///
/// None for a system whose surface is not known as a graph over two coordinates.
pub fn patches(system: &System, ranges: &[(f64, f64); 3], cells: usize) -> Vec<Patch> {
    match system.compiled() {
        Some(Compiled::Caricature(c)) => caricature(&c, ranges, cells),
        Some(Compiled::Wheel(w)) => wheel(&w, ranges, cells),
        None => Vec::new(),
    }
}

/// A two-fold of the system, if one is found: of the paper's systems the singularity, of others the one that Newton's method finds from
/// the suggested start.
pub fn singularity(system: &System) -> Option<[f64; 3]> {
    let point = match system.compiled() {
        Some(Compiled::Caricature(c)) => two_fold(&c, &vector![0.0, 0.0, 0.0]),
        Some(Compiled::Wheel(w)) => two_fold(&w, &vector![0.69, -0.57, -0.87]),
        None => {
            let start: [f64; 3] = system.definition().start()?.try_into().ok()?;
            two_fold(&system.bind::<3>().ok()?, &start.into())
        }
    };
    point.ok().map(|t| t.point.into())
}

/// x = 0 over (y, z).
fn caricature(system: &Caricature, ranges: &[(f64, f64); 3], cells: usize) -> Vec<Patch> {
    if ranges[0].0 > 0.0 || ranges[0].1 < 0.0 {
        return Vec::new();
    }
    grid(system, ranges[1], ranges[2], cells, |y, z| vector![0.0, y, z])
}

/// h = 0 over (r, omega): v = O (d - r cot gamma), as long as that is inside the box.
fn wheel(system: &Wheel, ranges: &[(f64, f64); 3], cells: usize) -> Vec<Patch> {
    let mut patches =
        grid(system, ranges[0], ranges[2], cells, |r, omega| vector![r, system.sticking_speed(r, omega), omega]);
    let (low, high) = ranges[1];
    for patch in &mut patches {
        patch.corners = clip(&clip(&patch.corners, |c| c[1] - low), |c| high - c[1]);
    }
    patches.retain(|p| p.corners.len() > 2);
    patches
}

/// The part of a polygon where `inside` is not negative (Sutherland & Hodgman 1974).
fn clip(polygon: &[[f64; 3]], inside: impl Fn(&[f64; 3]) -> f64) -> Vec<[f64; 3]> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, a) in polygon.iter().enumerate() {
        let b = &polygon[(i + 1) % polygon.len()];
        let (da, db) = (inside(a), inside(b));
        if da >= 0.0 {
            kept.push(*a);
        }
        if (da < 0.0) != (db < 0.0) {
            let s = da / (da - db);
            kept.push(std::array::from_fn(|k| a[k] + s * (b[k] - a[k])));
        }
    }
    kept
}

/// Cells over two coordinates, coloured by region. A cell that an edge between regions runs through is divided until its
/// parts are too small to be seen, so that edges look as smooth as they are.
fn grid<P: PiecewiseSmooth<3>>(
    system: &P,
    u: (f64, f64),
    v: (f64, f64),
    cells: usize,
    point: impl Fn(f64, f64) -> SVector<f64, 3>,
) -> Vec<Patch> {
    let (us, vs) = (lines(u, cells), lines(v, cells));
    let mut patches = Vec::with_capacity(us.len() * vs.len());
    for a in us.windows(2) {
        for b in vs.windows(2) {
            divide(system, &point, (a[0], a[1]), (b[0], b[1]), HALVINGS, &mut patches);
        }
    }
    patches
}

/// Halvings of a cell at an edge: 60 cells and four halvings are a thousand across the picture.
const HALVINGS: u32 = 4;

fn divide<P: PiecewiseSmooth<3>>(
    system: &P,
    point: &impl Fn(f64, f64) -> SVector<f64, 3>,
    u: (f64, f64),
    v: (f64, f64),
    halvings: u32,
    patches: &mut Vec<Patch>,
) {
    let middle = (0.5 * (u.0 + u.1), 0.5 * (v.0 + v.1));
    let here = colour(region(system, &point(middle.0, middle.1)));
    // Looked at just inside the corners: an edge along a side (the caricature's axes) divides nothing.
    let inside = |s: f64, r: (f64, f64)| r.0 + s * (r.1 - r.0);
    let uniform = [(0.02, 0.02), (0.98, 0.02), (0.98, 0.98), (0.02, 0.98)]
        .iter()
        .all(|(s, t)| colour(region(system, &point(inside(*s, u), inside(*t, v)))) == here);
    if uniform || halvings == 0 {
        let corners = [(u.0, v.0), (u.1, v.0), (u.1, v.1), (u.0, v.1)].map(|(s, t)| point(s, t).into()).to_vec();
        patches.push(Patch { corners, colour: here });
        return;
    }
    for a in [(u.0, middle.0), (middle.0, u.1)] {
        for b in [(v.0, middle.1), (middle.1, v.1)] {
            divide(system, point, a, b, halvings - 1, patches);
        }
    }
}

/// Equidistant grid lines, and one through zero.
fn lines((low, high): (f64, f64), cells: usize) -> Vec<f64> {
    let mut lines: Vec<f64> = (0..=cells).map(|i| low + (high - low) * i as f64 / cells as f64).collect();
    if low < 0.0 && high > 0.0 && !lines.contains(&0.0) {
        lines.push(0.0);
        lines.sort_by(f64::total_cmp);
    }
    lines
}
