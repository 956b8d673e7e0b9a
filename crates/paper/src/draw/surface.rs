//! The switching surface as a picture needs it: patches coloured by what happens there.

use nalgebra::{SVector, vector};

use super::level::{Level, colour};
use twofold_render::sheet::{
    Colour, LegendEntry, LegendKey, MarkerShape, MarkerStyle, Patch, Sheet,
};
use twofold_render::style;
use twofold_system::filippov::{
    TwoFold, Visibility, lie_derivatives, normal_form_constants, region, two_fold,
};
use twofold_system::{Caricature, Compiled, PiecewiseSmooth, System, Wheel};

/// The patches of h = 0 inside the box `ranges` (one (low, high) per coordinate), in the state's
/// order of coordinates.
///
/// The surfaces of the systems that are compiled are graphs over two coordinates; any other one is
/// found as [`Level`] finds it.
pub fn patches(system: &System, ranges: &[(f64, f64); 3], cells: usize) -> Vec<Patch> {
    match system.compiled() {
        Some(Compiled::Caricature(c)) => caricature(&c, ranges, cells),
        Some(Compiled::Wheel(w)) => wheel(&w, ranges, cells),
        None => {
            Level::new(system, &[0, 1, 2], &[]).map_or(Vec::new(), |level| level.patches(ranges))
        }
    }
}

/// The marker of a two-fold.
pub const TWO_FOLD: MarkerStyle = MarkerStyle::new(MarkerShape::Dot, style::MAGENTA);

/// Adds the surface's regions that `shown` has to a legend.
pub fn region_legend(mut sheet: Sheet, shown: impl Fn(Colour) -> bool) -> Sheet {
    let regions = [
        (style::ATTRACTING, "attracting"),
        (style::REPELLING, "repelling"),
        (style::CROSSING, "crossing"),
    ];
    let shown = regions.into_iter().filter(|(colour, _)| shown(*colour));
    for (k, (colour, name)) in shown.enumerate() {
        let text = if k == 0 { format!("*h* = 0, {name}") } else { name.to_owned() };
        let key = LegendKey::Area(colour, style::SURFACE_OPACITY);
        sheet = sheet.legend(LegendEntry::new(key, text));
    }
    sheet
}

/// Adds the two-fold to a legend.
pub fn two_fold_legend(sheet: Sheet) -> Sheet {
    sheet.legend(LegendEntry::new(LegendKey::Marker(TWO_FOLD), "two-fold"))
}

/// The two-fold inside the box `ranges` where determinism breaks, if there is one; of a system
/// whose surface is not known as a graph, the two-fold that Newton's method finds from its
/// suggested start.
pub fn singularity(system: &System, ranges: &[(f64, f64); 3]) -> Option<[f64; 3]> {
    let point = match system.compiled() {
        Some(Compiled::Caricature(c)) => {
            two_fold(&c, &vector![0.0, 0.0, 0.0]).ok().map(|t| t.point)
        }
        Some(Compiled::Wheel(w)) => {
            search(&w, ranges, |r, omega| vector![r, w.sticking_speed(r, omega), omega])
        }
        None => {
            let start: [f64; 3] = system.definition().start()?.try_into().ok()?;
            two_fold(&system.bind::<3>().ok()?, &start.into()).ok().map(|t| t.point)
        }
    };
    let inside = |p: &SVector<f64, 3>| {
        p.iter().zip(ranges).all(|(x, (low, high))| (low..=high).contains(&x))
    };
    point.filter(inside).map(Into::into)
}

/// Whether sliding runs into the two-fold and out into the repelling region: both folds invisible,
/// v, w < 0, vw > 1 in the normal form (Jeffrey & Colombo 2009). A system may have other two-folds,
/// through which nothing passes.
fn breaks_determinism<P: PiecewiseSmooth<3>>(system: &P, fold: &TwoFold<3>) -> bool {
    let (v, w) = normal_form_constants(system, fold);
    fold.visibility() == (Visibility::Invisible, Visibility::Invisible) && v < 0.0 && v * w > 1.0
}

/// Cells a side in which a two-fold is looked for.
const SEARCH_CELLS: usize = 48;

/// The two-fold where determinism breaks that Newton's method finds from a cell of the surface,
/// over the first and the last coordinate, in which both Lie derivatives change sign.
fn search<P: PiecewiseSmooth<3>>(
    system: &P,
    ranges: &[(f64, f64); 3],
    point: impl Fn(f64, f64) -> SVector<f64, 3>,
) -> Option<SVector<f64, 3>> {
    let (us, vs) = (lines(ranges[0], SEARCH_CELLS), lines(ranges[2], SEARCH_CELLS));
    let signs = |u: f64, v: f64| {
        let (p, q) = lie_derivatives(system, &point(u, v));
        [p > 0.0, q > 0.0]
    };
    us.windows(2).flat_map(|a| vs.windows(2).map(move |b| (a, b))).find_map(|(a, b)| {
        let corners = [signs(a[0], b[0]), signs(a[1], b[0]), signs(a[1], b[1]), signs(a[0], b[1])];
        let changes = |i: usize| corners.iter().any(|c| c[i] != corners[0][i]);
        if !(changes(0) && changes(1)) {
            return None;
        }
        let found = two_fold(system, &point(0.5 * (a[0] + a[1]), 0.5 * (b[0] + b[1]))).ok()?;
        breaks_determinism(system, &found).then_some(found.point)
    })
}

/// x = 0 over (y, z).
fn caricature(system: &Caricature, ranges: &[(f64, f64); 3], cells: usize) -> Vec<Patch> {
    if ranges[0].0 > 0.0 || ranges[0].1 < 0.0 {
        return Vec::new();
    }
    grid(system, ranges[1], ranges[2], cells, |y, z| vector![0.0, y, z])
}

/// h = 0 over (r, omega): v = O (d - r cot gamma). What of it leaves the box is cut off where it is
/// drawn.
fn wheel(system: &Wheel, ranges: &[(f64, f64); 3], cells: usize) -> Vec<Patch> {
    grid(system, ranges[0], ranges[2], cells, |r, omega| {
        vector![r, system.sticking_speed(r, omega), omega]
    })
}

/// Cells over two coordinates, coloured by region. A cell that an edge between regions runs through
/// is divided until its parts are too small to be seen, so that edges look as smooth as they are.
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
    let here = colour(Some(region(system, &point(middle.0, middle.1))));
    // Looked at just inside the corners: an edge along a side (the caricature's axes) divides
    // nothing.
    let inside = |s: f64, r: (f64, f64)| r.0 + s * (r.1 - r.0);
    let uniform = [(0.02, 0.02), (0.98, 0.02), (0.98, 0.98), (0.02, 0.98)]
        .iter()
        .all(|(s, t)| colour(Some(region(system, &point(inside(*s, u), inside(*t, v))))) == here);
    if uniform || halvings == 0 {
        let corners = [(u.0, v.0), (u.1, v.0), (u.1, v.1), (u.0, v.1)]
            .map(|(s, t)| point(s, t).into())
            .to_vec();
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
    let mut lines: Vec<f64> =
        (0..=cells).map(|i| low + (high - low) * i as f64 / cells as f64).collect();
    if low < 0.0 && high > 0.0 && !lines.contains(&0.0) {
        lines.push(0.0);
        lines.sort_by(f64::total_cmp);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wheels_two_fold_is_found_whatever_its_parameters() {
        let ranges = [(0.0, 1.5), (-3.0, 1.5), (-3.0, 1.5)];
        for (gamma, k_w) in
            [(std::f64::consts::FRAC_PI_4, 2.0), (0.75, 2.0), (std::f64::consts::FRAC_PI_4, 2.2)]
        {
            let wheel = Wheel { gamma, k_w, ..Wheel::default() };
            let at = SVector::from(singularity(&wheel.into(), &ranges).unwrap());
            let (p, q) = lie_derivatives(&wheel, &at);
            assert!(
                wheel.switching(&at).abs() < 1e-12 && p.abs() < 1e-9 && q.abs() < 1e-9,
                "{at} {p} {q}"
            );
        }
        let default = singularity(&Wheel::default().into(), &ranges).unwrap();
        assert!((default[0] - 0.692_669_889_7).abs() < 1e-9, "{default:?}");
        let elsewhere = [(0.0, 0.1), (-3.0, 1.5), (-3.0, 1.5)];
        assert_eq!(singularity(&Wheel::default().into(), &elsewhere), None);
    }
}
