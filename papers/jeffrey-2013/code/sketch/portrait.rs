//! Fig. 3: what happens about a two-fold of the normal form (4): regions of the surface, orbits
//! that cross it, orbits that slide on it.

use nalgebra::Vector3;

use super::{lines_of, lines_table};
use twofold_integrate::filippov::{ExitRule, FilippovOptions, Mode, Side, Trajectory, run};
use twofold_job::JobError;
use twofold_job::table::Table;
use twofold_paper::draw::surface;
use twofold_render::Sheet;
use twofold_render::number::number;
use twofold_render::sheet::{Axis, ColumnWidth, LegendEntry, LegendKey, LineStyle, SpacePanel};
use twofold_render::style;
use twofold_system::Caricature;

/// Half the width of the part of the surface that is shown.
const REACH: f64 = 1.0;
/// Height shown above and below the surface: flights between points so near are low.
const HEIGHT: f64 = 0.1;

/// The normal form (4): the caricature without re-injection.
pub fn system(v: f64, w: f64) -> Caricature {
    Caricature { v_plus: v, v_minus: w, ..Caricature::with_reinjection(0.0, 0.0) }
}

/// Computed orbits: single flights of f+ and f- between two crossings, and sliding orbits in both
/// sliding regions.
///
/// # Errors
///
/// If an orbit of the sketch cannot be followed.
pub fn tables(v: f64, w: f64) -> Result<Vec<Table>, JobError> {
    let system = system(v, w);
    let settings = FilippovOptions::default();
    let mut lines: Vec<(String, Vec<[f64; 3]>)> = Vec::new();
    let follow = |lines: &mut Vec<(String, Vec<[f64; 3]>)>,
                  name: &str,
                  start: [f64; 3],
                  mode: fn(Mode) -> bool,
                  t_end: f64|
     -> Result<(), JobError> {
        let mut trajectory = Trajectory::new(12).until_two_fold();
        // Long sliding: the portrait shows the sliding flow up to the region's edge, not a choice
        // of exit.
        let rule = ExitRule::AfterTime { time: t_end, side: Side::Plus };
        let _ =
            run(&system, start.into(), t_end, &settings, rule, &mut trajectory)?.within_budget()?;
        if let Some(piece) = trajectory.pieces.iter().find(|p| mode(p.mode)) {
            let inside = |x: &[f64; 3]| x[1].abs() <= 1.02 * REACH && x[2].abs() <= 1.02 * REACH;
            let points: Vec<[f64; 3]> =
                piece.points.iter().map(|(_, x)| <[f64; 3]>::from(*x)).take_while(inside).collect();
            lines.push((format!("{name}-{}", lines.len()), points));
        }
        Ok(())
    };
    // Flights that start in the crossing regions; each lands where the parabola of the normal form
    // says.
    for (y, z) in [(-0.25, 0.35), (-0.38, 0.7), (-0.12, 0.85)] {
        follow(&mut lines, "plus", [0.0, y, z], |m| m == Mode::Plus, 3.0)?;
    }
    for (y, z) in [(0.35, -0.22), (0.75, -0.35), (0.9, -0.12)] {
        follow(&mut lines, "minus", [0.0, y, z], |m| m == Mode::Minus, 3.0)?;
    }
    for k in 0..7 {
        // From the edge of the square into the two-fold.
        let s = (f64::from(k) + 0.5) / 7.0;
        let (y, z) =
            if s < 0.5 { (REACH, 2.0 * s * REACH) } else { (2.0 * (1.0 - s) * REACH, REACH) };
        follow(&mut lines, "attracting", [0.0, y, z], |m| m == Mode::SlidingAttracting, 10.0)?;
    }
    // Out of the two-fold: (y, z) -> (-y, -z) maps the sliding flow to itself run backwards, so the
    // mirror image of a point on the way in, taken close to the two-fold, is the start of the
    // mirror image's way out.
    let ways_in: Vec<Vec<[f64; 3]>> = lines
        .iter()
        .filter(|(name, _)| name.starts_with("attracting"))
        .map(|(_, points)| points.clone())
        .collect();
    for points in ways_in {
        if let Some([_, y, z]) =
            points.into_iter().find(|[_, y, z]| y.abs().max(z.abs()) < 0.03 * REACH)
        {
            follow(&mut lines, "repelling", [0.0, -y, -z], |m| m == Mode::SlidingRepelling, 10.0)?;
        }
    }
    Ok(vec![lines_table(["x", "y", "z"], &lines)])
}

/// The drawing. `v`, `w` only colour the surface.
pub fn draw(tables: &[Table], v: f64, w: f64) -> Sheet {
    let turn = |x: [f64; 3]| [x[1], x[2], x[0]];
    let axis = |name: &str, reach: f64| Axis::linear(name, -reach, reach);
    let mut chart = SpacePanel::new(axis("*y*", REACH), axis("*z*", REACH), axis("*x*", HEIGHT))
        .camera(-60.0, 26.0)
        .proportions([1.0, 1.0, 0.55]);
    let ranges = [(-HEIGHT, HEIGHT), (-REACH, REACH), (-REACH, REACH)];
    let spec = system(v, w).into();
    let mut patches = surface::patches(&spec, &ranges);
    for corner in patches.iter_mut().flat_map(|p| p.corners.iter_mut()) {
        *corner = turn(*corner);
    }
    chart = chart.surface(patches);
    let flight = LineStyle::new(style::INK, 1.1);
    let sliding = LineStyle::new(style::GREEN, 1.1);
    for (name, points) in tables.first().map(lines_of::<3>).unwrap_or_default() {
        let points: Vec<[f64; 3]> = points.into_iter().map(turn).collect();
        if points.len() < 4 {
            continue;
        }
        if name.starts_with("plus") || name.starts_with("minus") {
            chart = chart.arrow(points, flight);
        } else {
            // Double arrows mark sliding, as in the paper: two heads, one behind the other.
            for share in [0.42, 0.55] {
                chart = chart.arrow(points[..along(&points, share)].to_vec(), sliding);
            }
            chart = chart.line(points, sliding);
        }
    }
    chart = chart.markers(vec![[0.0, 0.0, 0.0]], surface::TWO_FOLD);
    let sheet =
        Sheet::new(ColumnWidth::Wide, 1, "").subtitle("normal form (4)").panel("", "", chart);
    surface::two_fold_legend(surface::region_legend(sheet, |_| true))
        .legend(LegendEntry::new(LegendKey::Line(flight), "flight"))
        .legend(LegendEntry::new(LegendKey::Line(sliding), "sliding"))
        .footer(format!(
            "*v* = {}, *w* = {}, *vw* = {} > 1; every line is a computed orbit",
            number(v),
            number(w),
            number((v * w * 100.0).round() / 100.0)
        ))
}

/// Number of points that make up the first `share` of the polyline's length.
fn along(points: &[[f64; 3]], share: f64) -> usize {
    let length = |a: &[f64; 3], b: &[f64; 3]| {
        let d = Vector3::new(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
        d.norm()
    };
    let total: f64 = points.windows(2).map(|p| length(&p[0], &p[1])).sum();
    let mut sum = 0.0;
    for (i, pair) in points.windows(2).enumerate() {
        sum += length(&pair[0], &pair[1]);
        if sum >= share * total {
            return i + 2;
        }
    }
    points.len()
}
