//! The paper's sketches as computed data: figs 1, 3, 4 and 5.
//!
//! Pure functions from a model to plain shapes; how they look is decided in the room that draws. Two dimensions
//! ([`Scene2`]) for the machine of fig. 1, three ([`Scene3`]) for orbits and regions.

mod assembly;
mod funnel;
mod passages;
mod regions;

use nalgebra::SVector;

use crate::integrate::filippov::{Mode, Side, Trajectory};
use crate::model::filippov::Region;

pub use assembly::{oblique, plan};
pub use funnel::{FunnelPicture, funnel_scene};
pub use passages::{PassagePicture, passages};
pub use regions::{RegionPicture, regions};

/// What a line of a 3D scene is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// An orbit in the given mode.
    Orbit(Mode),
    /// An orbit in the given mode before the part that the picture is about.
    Approach(Mode),
    /// A fold line: where the field of that side is tangent to the surface.
    Fold(Side),
}

/// A line.
#[derive(Clone, Debug, PartialEq)]
pub struct Polyline3 {
    /// Its points.
    pub points: Vec<[f64; 3]>,
    /// What it is.
    pub role: Role,
    /// Which orbit it belongs to, for colouring.
    pub orbit: usize,
}

/// An arrow head on a line: two heads for sliding, one for flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrow3 {
    /// Where.
    pub at: [f64; 3],
    /// Unit vector along the motion.
    pub direction: [f64; 3],
    /// 2 for sliding, as in the paper, 1 for flight.
    pub heads: u8,
    /// What it sits on.
    pub role: Role,
}

/// A flat piece of the switching surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch3 {
    /// Its corners, in order.
    pub corners: Vec<[f64; 3]>,
    /// What happens there.
    pub region: Region,
}

/// A marked point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark3 {
    /// Where.
    pub at: [f64; 3],
    /// What.
    pub kind: MarkKind,
}

/// What a mark says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MarkKind {
    /// The two-fold.
    Singularity,
    /// The start of the orbit.
    Start,
    /// Sliding began here.
    Landing,
    /// Repelling sliding was left here, to that side, because the rule said so.
    Exit(Side),
    /// Repelling sliding ended here because its region did.
    ExitAtBoundary(Side),
}

/// A label in 3D.
#[derive(Clone, Debug, PartialEq)]
pub struct Label3 {
    /// Where.
    pub at: [f64; 3],
    /// Text, in plain Unicode.
    pub text: String,
}

/// A 3D picture as data.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene3 {
    /// Pieces of the surface.
    pub patches: Vec<Patch3>,
    /// Lines.
    pub lines: Vec<Polyline3>,
    /// Arrows.
    pub arrows: Vec<Arrow3>,
    /// Marks.
    pub marks: Vec<Mark3>,
    /// Labels.
    pub labels: Vec<Label3>,
    /// Lowest and highest value along each axis.
    pub bounds: [[f64; 2]; 3],
    /// A good view: azimuth and elevation in degrees, in the sense of a camera that looks at the origin from
    /// (cos azimuth cos elevation, sin azimuth cos elevation, sin elevation) with the axes in the order (y, z, x): x is up.
    pub view: [f64; 2],
}

impl Scene3 {
    /// Sets the bounds to those of lines and patches, with a margin of 4 %.
    fn fit(&mut self) {
        let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
        let points = self.lines.iter().flat_map(|l| &l.points).chain(self.patches.iter().flat_map(|p| &p.corners));
        for p in points {
            for (b, c) in bounds.iter_mut().zip(p) {
                *b = [b[0].min(*c), b[1].max(*c)];
            }
        }
        self.bounds = bounds.map(|[low, high]| {
            let margin = 0.04 * (high - low);
            [low - margin, high + margin]
        });
    }

    /// Adds a trajectory: a line a piece.
    fn add(&mut self, trajectory: &Trajectory<3>, orbit: usize, approach: bool) {
        for piece in &trajectory.pieces {
            let role = if approach { Role::Approach(piece.mode) } else { Role::Orbit(piece.mode) };
            self.lines.push(Polyline3 { points: piece.points.iter().map(|(_, x)| (*x).into()).collect(), role, orbit });
        }
    }

    /// Puts an arrow on the last line added, at the fraction `part` of its length.
    fn arrow_on_last(&mut self, part: f64) {
        let Some(line) = self.lines.last() else { return };
        let heads = match line.role {
            Role::Orbit(mode) | Role::Approach(mode) if mode.slides() => 2,
            _ => 1,
        };
        if let Some((at, direction)) = along(&line.points, part) {
            self.arrows.push(Arrow3 { at, direction, heads, role: line.role });
        }
    }

    /// The four regions of x = 0 in the square |y|, |z| <= size around a two-fold at the origin whose Lie derivatives have the
    /// signs of -y and z, and its fold lines.
    fn quadrants(&mut self, size: f64) {
        for (sy, sz, region) in [
            (1.0, 1.0, Region::Attracting),
            (-1.0, -1.0, Region::Repelling),
            (-1.0, 1.0, Region::CrossingUp),
            (1.0, -1.0, Region::CrossingDown),
        ] {
            let (y, z) = (sy * size, sz * size);
            self.patches
                .push(Patch3 { corners: vec![[0.0, 0.0, 0.0], [0.0, y, 0.0], [0.0, y, z], [0.0, 0.0, z]], region });
        }
        for (points, side) in [
            (vec![[0.0, 0.0, -size], [0.0, 0.0, size]], Side::Plus),
            (vec![[0.0, -size, 0.0], [0.0, size, 0.0]], Side::Minus),
        ] {
            self.lines.push(Polyline3 { points, role: Role::Fold(side), orbit: 0 });
        }
    }
}

/// The point at a fraction of a line's length, and the direction there.
fn along(points: &[[f64; 3]], part: f64) -> Option<([f64; 3], [f64; 3])> {
    let vectors: Vec<_> = points.iter().map(|p| SVector::<f64, 3>::from(*p)).collect();
    let total: f64 = vectors.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    let mut left = part * total;
    for w in vectors.windows(2) {
        let chord = w[1] - w[0];
        let length = chord.norm();
        if length > 0.0 && left <= length {
            return Some(((w[0] + chord * (left / length)).into(), (chord / length).into()));
        }
        left -= length;
    }
    None
}

/// How a line of a 2D scene is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stroke {
    /// An edge of a body.
    Body,
    /// A hidden or ideal line: dashed.
    Dashed,
    /// A dimension line or angle arc: thin.
    Dimension,
    /// A spring or damper.
    Device,
    /// A motion arrow.
    Motion,
    /// A force arrow.
    Force,
}

/// What a filled shape is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Material {
    /// The lower disc.
    Disc,
    /// The housing.
    Housing,
    /// The wheel.
    Wheel,
    /// The slot: what lies below shows.
    Slot,
}

/// A shape of a 2D scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape2 {
    /// A line through points.
    Line {
        /// The points.
        points: Vec<[f64; 2]>,
        /// How it is drawn.
        stroke: Stroke,
        /// An arrow head at the end.
        arrow_at_end: bool,
        /// An arrow head at the start.
        arrow_at_start: bool,
    },
    /// A closed polygon, filled and outlined.
    Area {
        /// The corners.
        points: Vec<[f64; 2]>,
        /// What it is made of.
        material: Material,
    },
    /// A small filled circle.
    Dot {
        /// The centre.
        at: [f64; 2],
    },
    /// A label, centred at a point.
    Label {
        /// Where.
        at: [f64; 2],
        /// Text, in plain Unicode.
        text: String,
    },
}

/// A 2D picture as data; shapes later in the list lie above earlier ones.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene2 {
    /// The shapes.
    pub shapes: Vec<Shape2>,
    /// Lowest and highest value along each axis; equal scales on both.
    pub bounds: [[f64; 2]; 2],
}

impl Scene2 {
    fn fit(&mut self) {
        let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        let mut see = |p: &[f64; 2]| {
            for (b, c) in bounds.iter_mut().zip(p) {
                *b = [b[0].min(*c), b[1].max(*c)];
            }
        };
        for shape in &self.shapes {
            match shape {
                Shape2::Line { points, .. } | Shape2::Area { points, .. } => points.iter().for_each(&mut see),
                Shape2::Dot { at } | Shape2::Label { at, .. } => see(at),
            }
        }
        self.bounds = bounds.map(|[low, high]| {
            let margin = 0.05 * (high - low);
            [low - margin, high + margin]
        });
    }

    fn line(&mut self, points: Vec<[f64; 2]>, stroke: Stroke) {
        self.shapes.push(Shape2::Line { points, stroke, arrow_at_end: false, arrow_at_start: false });
    }
    fn arrow(&mut self, points: Vec<[f64; 2]>, stroke: Stroke) {
        self.shapes.push(Shape2::Line { points, stroke, arrow_at_end: true, arrow_at_start: false });
    }
    fn dimension(&mut self, a: [f64; 2], b: [f64; 2]) {
        self.shapes.push(Shape2::Line {
            points: vec![a, b],
            stroke: Stroke::Dimension,
            arrow_at_end: true,
            arrow_at_start: true,
        });
    }
    fn area(&mut self, points: Vec<[f64; 2]>, material: Material) {
        self.shapes.push(Shape2::Area { points, material });
    }
    fn label(&mut self, at: [f64; 2], text: &str) {
        self.shapes.push(Shape2::Label { at, text: text.into() });
    }
}
