//! The switching surface as a picture needs it: patches coloured by what happens there.

use nalgebra::{SVector, vector};

use super::spec::SystemSpec;
use crate::model::filippov::{Region, region, two_fold};
use crate::model::{Caricature, PiecewiseSmooth, Wheel};
use crate::render::sheet::{Colour, Patch};
use crate::render::style;

/// The colour of a region.
pub fn colour(region: Region) -> Colour {
    match region {
        Region::Attracting => style::ATTRACTING,
        Region::Repelling => style::REPELLING,
        Region::CrossingUp | Region::CrossingDown | Region::Boundary => style::CROSSING,
    }
}

/// The patches of h = 0 inside the box `ranges` (one (low, high) per coordinate), in the state's order of coordinates.
pub fn patches(system: &SystemSpec, ranges: &[(f64, f64); 3], cells: usize) -> Vec<Patch> {
    match system {
        SystemSpec::Caricature(c) => caricature(c, ranges, cells),
        SystemSpec::Wheel(w) => wheel(w, ranges, cells),
    }
}

/// The two-fold of the paper's singularity.
pub fn singularity(system: &SystemSpec) -> Option<[f64; 3]> {
    let point = match system {
        SystemSpec::Caricature(c) => two_fold(c, &vector![0.0, 0.0, 0.0]),
        SystemSpec::Wheel(w) => two_fold(w, &vector![0.69, -0.57, -0.87]),
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
    patches.retain(|p| p.corners.iter().all(|c| (low..=high).contains(&c[1])));
    patches
}

/// Cells over two coordinates, coloured by the region at their centre. Cells are cut where a region's edge meets the grid
/// line through the singularity, by putting grid lines through zero where zero is inside.
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
            let corners = [(a[0], b[0]), (a[1], b[0]), (a[1], b[1]), (a[0], b[1])];
            let centre = point(0.5 * (a[0] + a[1]), 0.5 * (b[0] + b[1]));
            patches.push(Patch {
                corners: corners.iter().map(|(s, t)| point(*s, *t).into()).collect(),
                colour: colour(region(system, &centre)),
            });
        }
    }
    patches
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
