//! Fig. 1: the wheel assembly, to scale from the model's geometry.
//!
//! Plan view in the housing's frame: the disc's axle at the origin, the wheel's line y = d, the wheel's centre at (r, d).
//! Rolling direction (cos gamma, -sin gamma), axle direction (sin gamma, cos gamma), as in the model's h and V. The model has
//! no wheel radius, disc radius or slot width; those are drawn in proportion to d.

use super::{Material, Scene2, Shape2, Stroke};
use crate::model::Wheel;
use crate::num::elementary::{cos, sin};

type Point = [f64; 2];

/// Lengths that the model does not fix, in units of d.
mod proportion {
    pub const DISC: f64 = 2.05;
    pub const HOUSING: f64 = 1.85;
    pub const SLOT_LENGTH: f64 = 2.7;
    pub const SLOT_WIDTH: f64 = 0.5;
    pub const WHEEL_RADIUS: f64 = 0.34;
    pub const WHEEL_WIDTH: f64 = 0.13;
}

/// The arc of a circle from angle `from` to `to` (radians), in `n` chords.
fn arc(centre: Point, radius: f64, from: f64, to: f64, n: usize) -> Vec<Point> {
    (0..=n)
        .map(|k| {
            let a = from + (to - from) * k as f64 / n as f64;
            [centre[0] + radius * cos(a), centre[1] + radius * sin(a)]
        })
        .collect()
}

/// A zigzag of `teeth` between two points, with straight ends.
fn spring(a: Point, b: Point, width: f64, teeth: usize) -> Vec<Point> {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let length = (dx * dx + dy * dy).sqrt();
    let (nx, ny) = (-dy / length * width, dx / length * width);
    let at = |u: f64, side: f64| [a[0] + u * dx + side * nx, a[1] + u * dy + side * ny];
    let mut points = vec![at(0.0, 0.0), at(0.12, 0.0)];
    for k in 0..2 * teeth {
        let u = 0.12 + 0.76 * (k as f64 + 0.5) / (2 * teeth) as f64;
        points.push(at(u, if k % 2 == 0 { 1.0 } else { -1.0 }));
    }
    points.extend([at(0.88, 0.0), at(1.0, 0.0)]);
    points
}

/// A dashpot between two points: rod, piston, cup, rod.
fn damper(a: Point, b: Point, width: f64) -> Vec<Vec<Point>> {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let length = (dx * dx + dy * dy).sqrt();
    let (nx, ny) = (-dy / length * width, dx / length * width);
    let at = |u: f64, side: f64| [a[0] + u * dx + side * nx, a[1] + u * dy + side * ny];
    vec![
        vec![at(0.0, 0.0), at(0.5, 0.0)],
        vec![at(0.5, 0.7), at(0.5, -0.7)],
        vec![at(0.36, 1.0), at(0.64, 1.0), at(0.64, -1.0), at(0.36, -1.0)],
        vec![at(0.64, 0.0), at(1.0, 0.0)],
    ]
}

/// The convex hull, anticlockwise (Andrew's monotone chain).
fn hull(mut points: Vec<Point>) -> Vec<Point> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let turn = |o: Point, a: Point, b: Point| (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    let half = |points: &mut dyn Iterator<Item = &Point>| {
        let mut chain: Vec<Point> = Vec::new();
        for &p in points {
            while chain.len() >= 2 && turn(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0.0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut outline = half(&mut points.iter());
    outline.extend(half(&mut points.iter().rev()));
    outline
}

/// The plan view with the wheel at displacement `r`.
pub fn plan(wheel: &Wheel, r: f64) -> Scene2 {
    use proportion::*;
    let d = wheel.d;
    let (s, c) = (sin(wheel.gamma), cos(wheel.gamma));
    let (roll, axle) = ([c, -s], [s, c]);
    let centre = [r, d];
    let from_centre = |u: f64, v: f64| [centre[0] + u * roll[0] + v * axle[0], centre[1] + u * roll[1] + v * axle[1]];
    let full = std::f64::consts::TAU;
    let mut scene = Scene2::default();

    scene.area(arc([0.0, 0.0], DISC * d, 0.0, full, 180), Material::Disc);
    scene.area(arc([0.0, 0.0], HOUSING * d, 0.0, full, 180), Material::Housing);
    let (half, low, high) = (0.5 * SLOT_LENGTH * d, d - 0.5 * SLOT_WIDTH * d, d + 0.5 * SLOT_WIDTH * d);
    scene.area(vec![[-half, low], [half, low], [half, high], [-half, high]], Material::Slot);
    // The line along which the wheel moves, and its distance from the axle.
    scene.line(vec![[-HOUSING * d, d], [HOUSING * d, d]], Stroke::Dashed);
    scene.line(vec![[0.0, 0.0], [0.0, d]], Stroke::Dashed);
    scene.shapes.push(Shape2::Dot { at: [0.0, 0.0] });
    scene.dimension([-0.08 * d, 0.0], [-0.08 * d, d]);
    scene.label([-0.2 * d, 0.5 * d], "d");
    let below = low - 0.1 * d;
    scene.dimension([0.0, below], [r, below]);
    scene.line(vec![[r, below], centre], Stroke::Dimension);
    scene.label([0.5 * r, below - 0.13 * d], "r");

    // Spring and damper between the housing and the wheel's slider.
    scene.line(spring([-half, d + 0.1 * d], [r - 0.12 * d, d + 0.1 * d], 0.06 * d, 7), Stroke::Device);
    for part in damper([-half, d - 0.12 * d], [r - 0.12 * d, d - 0.12 * d], 0.055 * d) {
        scene.line(part, Stroke::Device);
    }
    scene.line(vec![[r - 0.12 * d, d - 0.16 * d], [r - 0.12 * d, d + 0.16 * d]], Stroke::Device);
    scene.line(vec![[r - 0.12 * d, d], centre], Stroke::Device);
    scene.label([-0.55 * d, d + 0.37 * d], "k_w");
    scene.label([-0.85 * d, d - 0.35 * d], "c_w");
    // Damper between the housing and the disc, across the gap at the rim.
    let rim = |radius: f64, a: f64| [radius * d * cos(a), radius * d * sin(a)];
    for part in damper(rim(HOUSING, -0.9), rim(DISC, -0.72), 0.05 * d) {
        scene.line(part, Stroke::Device);
    }
    scene.label(rim(DISC + 0.17, -0.8), "c_h");

    // The wheel from above: a rectangle across its axle.
    let (a, b) = (WHEEL_RADIUS * d, 0.5 * WHEEL_WIDTH * d);
    scene.area(vec![from_centre(-a, -b), from_centre(a, -b), from_centre(a, b), from_centre(-a, b)], Material::Wheel);
    scene.line(vec![from_centre(0.0, -2.6 * b), from_centre(0.0, 2.6 * b)], Stroke::Body);
    // The angle between the line and the rolling direction.
    scene.line(vec![centre, from_centre(2.0 * a, 0.0)], Stroke::Dimension);
    scene.line(arc(centre, 1.6 * a, 0.0, -wheel.gamma, 24), Stroke::Dimension);
    let middle = -0.5 * wheel.gamma;
    scene.label([centre[0] + 1.95 * a * cos(middle), centre[1] + 1.95 * a * sin(middle)], "γ");
    scene.arrow(vec![[r + 0.12 * d, below], [r + 0.55 * d, below]], Stroke::Motion);
    scene.label([r + 0.34 * d, below - 0.13 * d], "v");
    // The slip h along the axle, and the side force against it.
    scene.arrow(vec![from_centre(0.0, 2.6 * b), from_centre(0.0, 2.6 * b + 0.35 * d)], Stroke::Force);
    scene.label(from_centre(0.12 * d, 2.6 * b + 0.4 * d), "h");

    scene.arrow(arc([0.0, 0.0], (DISC + 0.14) * d, 3.4, 4.1, 32), Stroke::Motion);
    scene.label([(DISC + 0.32) * d * cos(3.75), (DISC + 0.32) * d * sin(3.75)], "ω₀");
    scene.arrow(arc([0.0, 0.0], 0.72 * HOUSING * d, 3.5, 4.3, 32), Stroke::Motion);
    scene.label([0.56 * HOUSING * d * cos(3.9), 0.56 * HOUSING * d * sin(3.9)], "ω");
    scene.fit();
    scene
}

/// An oblique view of the same assembly (parallel projection, seen from `azimuth` and `elevation` in degrees): the disc, the wheel
/// standing on it and the housing above, with the slot along the line.
pub fn oblique(wheel: &Wheel, r: f64, azimuth: f64, elevation: f64) -> Scene2 {
    use proportion::*;
    let d = wheel.d;
    let degrees = std::f64::consts::PI / 180.0;
    let (sa, ca) = (sin(azimuth * degrees), cos(azimuth * degrees));
    let (se, ce) = (sin(elevation * degrees), cos(elevation * degrees));
    // Camera on the side (cos az, sin az): screen right is (-sin az, cos az).
    let see = |p: [f64; 3]| -> Point { [-sa * p[0] + ca * p[1], ce * p[2] - se * (ca * p[0] + sa * p[1])] };
    let full = std::f64::consts::TAU;
    let ring = |radius: f64, z: f64| -> Vec<Point> {
        arc([0.0, 0.0], radius, 0.0, full, 180).into_iter().map(|[x, y]| see([x, y, z])).collect()
    };
    let (s, c) = (sin(wheel.gamma), cos(wheel.gamma));
    let radius = WHEEL_RADIUS * d;
    let half_width = 0.5 * WHEEL_WIDTH * d;
    let rim = |side: f64| -> Vec<Point> {
        (0..=72)
            .map(|k| {
                let a = full * k as f64 / 72.0;
                let (u, z) = (radius * cos(a), radius + radius * sin(a));
                see([r + u * c + side * half_width * s, d - u * s + side * half_width * c, z])
            })
            .collect()
    };
    let mut scene = Scene2::default();
    // The disc with its thickness: the silhouette of two rings is the lower one plus the upper one.
    scene.area(ring(DISC * d, -0.12 * d), Material::Disc);
    scene.area(ring(DISC * d, 0.0), Material::Disc);
    scene.line(vec![see([0.0, 0.0, 0.0]), see([0.0, 0.0, 1.35 * d])], Stroke::Body);
    // The tread is what the two rims span; the axle's near end decides which face is seen.
    let near = if ca * s + sa * c > 0.0 { 1.0 } else { -1.0 };
    scene.area(hull(rim(-near).into_iter().chain(rim(near)).collect()), Material::Wheel);
    scene.area(rim(near), Material::Wheel);
    let hub = [r, d, radius];
    scene.line(
        vec![
            see([hub[0] - 0.25 * d * s, hub[1] - 0.25 * d * c, radius]),
            see([hub[0] + 0.25 * d * s, hub[1] + 0.25 * d * c, radius]),
        ],
        Stroke::Body,
    );
    // The housing above, drawn as edges so that the wheel is seen through it.
    let height = 2.0 * radius + 0.22 * d;
    scene.line(ring(HOUSING * d, height), Stroke::Body);
    let (half, low, high) = (0.5 * SLOT_LENGTH * d, d - 0.5 * SLOT_WIDTH * d, d + 0.5 * SLOT_WIDTH * d);
    let slot = [[-half, low], [half, low], [half, high], [-half, high], [-half, low]];
    scene.line(slot.map(|[x, y]| see([x, y, height])).to_vec(), Stroke::Body);
    scene.line(vec![see([-HOUSING * d, d, height]), see([HOUSING * d, d, height])], Stroke::Dashed);
    scene.line(vec![see([0.0, 0.0, height]), see([0.0, d, height])], Stroke::Dashed);
    scene.line(vec![see([r, d, height]), see(hub)], Stroke::Device);
    let on_line = |a: f64, b: f64, offset: f64| (see([a, d + offset, height]), see([b, d + offset, height]));
    let (a, b) = on_line(-half, r, 0.1 * d);
    scene.line(spring(a, b, 0.05 * d, 7), Stroke::Device);
    let (a, b) = on_line(-half, r, -0.12 * d);
    for part in damper(a, b, 0.045 * d) {
        scene.line(part, Stroke::Device);
    }
    scene.label(see([-0.6 * d, d + 0.45 * d, height]), "k_w, c_w");
    scene.label(see([-0.15 * d, 0.5 * d, height]), "d");
    scene.label(see([0.55 * r, d + 0.38 * d, height]), "r");
    let turn = |radius: f64, z: f64, from: f64, to: f64| -> Vec<Point> {
        arc([0.0, 0.0], radius, from, to, 40).into_iter().map(|[x, y]| see([x, y, z])).collect()
    };
    let facing = azimuth * degrees;
    scene.arrow(turn((DISC + 0.15) * d, 0.0, facing - 0.4, facing + 0.3), Stroke::Motion);
    scene.label(see([(DISC + 0.42) * d * cos(facing), (DISC + 0.42) * d * sin(facing), 0.0]), "ω₀");
    scene.arrow(turn(0.4 * d, 1.35 * d, facing - 1.2, facing + 1.2), Stroke::Motion);
    scene.label(see([0.0, 0.0, 1.6 * d]), "ω");
    scene.fit();
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::PiecewiseSmooth;
    use nalgebra::vector;

    #[test]
    fn drawn_to_the_models_geometry() {
        let wheel = Wheel::default();
        let scene = plan(&wheel, 0.69);
        let body = scene
            .shapes
            .iter()
            .find_map(|s| match s {
                Shape2::Area { points, material: Material::Wheel } => Some(points),
                _ => None,
            })
            .unwrap();
        // The wheel's centre is at (r, d) ...
        let centre = [0, 1].map(|i| body.iter().map(|p| p[i]).sum::<f64>() / 4.0);
        assert!((centre[0] - 0.69).abs() < 1e-12 && (centre[1] - wheel.d).abs() < 1e-12);
        // ... and moving it along its drawn axle is slip, along its drawn rolling direction is none: h = (v - d O) sin g +
        // r O cos g with velocity (v - d O, r O).
        let long = [body[1][0] - body[0][0], body[1][1] - body[0][1]];
        let o = long[1] / 0.69;
        let h = wheel.switching(&vector![0.69, long[0] + wheel.d * o, o + wheel.omega0]);
        assert!(h.abs() < 1e-12, "{h}");
        let view = oblique(&wheel, 0.69, -60.0, 25.0);
        for s in [&scene, &view] {
            assert!(s.bounds.iter().all(|[a, b]| a.is_finite() && b > a));
        }
    }
}
