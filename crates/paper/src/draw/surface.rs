//! The switching surface as a picture needs it: patches coloured by what happens there.

use nalgebra::SVector;

use super::level::Level;
use twofold_render::sheet::{
    Colour, LegendEntry, LegendKey, MarkerShape, MarkerStyle, Patch, Sheet,
};
use twofold_render::style;
use twofold_system::filippov::{
    TwoFold, Visibility, lie_derivatives, normal_form_constants, two_fold,
};
use twofold_system::{PiecewiseSmooth, System};

/// The patches of h = 0 inside the box `ranges` (one (low, high) per coordinate), in the state's
/// order of coordinates, coloured by region.
pub fn patches(system: &System, ranges: &[(f64, f64); 3]) -> Vec<Patch> {
    Level::new(system, &[0, 1, 2], &[]).map_or(Vec::new(), |level| level.patches(ranges))
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

/// The two-fold inside the box `ranges` where determinism breaks, if there is one: Newton's method
/// finds it from a piece of the surface in which both Lie derivatives change sign.
pub fn singularity(system: &System, ranges: &[(f64, f64); 3]) -> Option<[f64; 3]> {
    let level = Level::new(system, &[0, 1, 2], &[])?;
    let system = system.bind::<3>().ok()?;
    let inside =
        |p: &[f64; 3]| p.iter().zip(ranges).all(|(x, (low, high))| (low..=high).contains(&x));
    level.polygons(ranges).into_iter().find_map(|polygon| {
        let corners: Vec<SVector<f64, 3>> = polygon.into_iter().map(SVector::from).collect();
        let positive = |x| {
            let (p, q) = lie_derivatives(&system, x);
            [p > 0.0, q > 0.0]
        };
        let first = positive(&corners[0]);
        if (0..2).any(|i| corners.iter().all(|x| positive(x)[i] == first[i])) {
            return None;
        }
        let middle = corners.iter().sum::<SVector<f64, 3>>() / corners.len() as f64;
        let found = two_fold(&system, &middle).ok()?;
        let point = found.point.into();
        (inside(&point) && breaks_determinism(&system, &found)).then_some(point)
    })
}

/// Whether sliding runs into the two-fold and out into the repelling region: both folds invisible,
/// v, w < 0, vw > 1 in the normal form (Jeffrey & Colombo 2009). A system may have other two-folds,
/// through which nothing passes.
fn breaks_determinism<P: PiecewiseSmooth<3>>(system: &P, fold: &TwoFold<3>) -> bool {
    let (v, w) = normal_form_constants(system, fold);
    fold.visibility() == (Visibility::Invisible, Visibility::Invisible) && v < 0.0 && v * w > 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wheels_two_fold_is_found_whatever_its_parameters() {
        let ranges = [(0.0, 1.5), (-3.0, 1.5), (-3.0, 1.5)];
        let wheel = |gamma: f64, k_w: f64| {
            System::builtin("wheel")
                .unwrap()
                .with("gamma", gamma)
                .unwrap()
                .with("k_w", k_w)
                .unwrap()
        };
        let quarter = std::f64::consts::FRAC_PI_4;
        for (gamma, k_w) in [(quarter, 2.0), (0.75, 2.0), (quarter, 2.2)] {
            let wheel = wheel(gamma, k_w);
            let at = SVector::from(singularity(&wheel, &ranges).unwrap());
            let wheel = wheel.bind::<3>().unwrap();
            let (p, q) = lie_derivatives(&wheel, &at);
            assert!(
                wheel.switching(&at).abs() < 1e-12 && p.abs() < 1e-9 && q.abs() < 1e-9,
                "{at} {p} {q}"
            );
        }
        let default = singularity(&wheel(quarter, 2.0), &ranges).unwrap();
        assert!((default[0] - 0.692_669_889_7).abs() < 1e-9, "{default:?}");
        let elsewhere = [(0.0, 0.1), (-3.0, 1.5), (-3.0, 1.5)];
        assert_eq!(singularity(&wheel(quarter, 2.0), &elsewhere), None);
    }
}
