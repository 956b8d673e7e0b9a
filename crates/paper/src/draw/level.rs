//! The switching surface h = 0 of any system, as far as a picture shows it: points on a line,
//! curves in a plane, patches in a box.
//!
//! A picture shows some of the states. Where h depends on these alone its zero set can be drawn;
//! where they are all the states there are, it is coloured by what happens there ([`Region`]).

use std::collections::BTreeMap;

use nalgebra::SVector;

use twofold_num::tape::Program;
use twofold_render::sheet::{Colour, Patch};
use twofold_render::style;
use twofold_system::System;
use twofold_system::filippov::{Region, lie_derivatives};

/// h of a system over some of its states, the others fixed or of no importance to h.
pub struct Level<'a> {
    h: Program,
    /// The states shown.
    shown: Vec<usize>,
    /// A full state: what is not shown stands as it is here.
    base: Vec<f64>,
    /// (L+h, L-h) at a point, if the point is a full state.
    lie: Option<Box<Lie<'a>>>,
}

/// (L+h, L-h) at a full state.
type Lie<'a> = dyn Fn(&[f64]) -> [f64; 2] + 'a;

/// The Lie derivatives of systems of two to four states.
fn lie_of<'a>(system: &System) -> Option<Box<Lie<'a>>> {
    fn of<'a, const N: usize>(system: &System) -> Option<Box<Lie<'a>>> {
        let system = system.bind::<N>().ok()?;
        Some(Box::new(move |x| {
            let (p, q) = lie_derivatives(&system, &SVector::<f64, N>::from_column_slice(x));
            [p, q]
        }))
    }
    match system.dimension() {
        2 => of::<2>(system),
        3 => of::<3>(system),
        4 => of::<4>(system),
        _ => None,
    }
}

/// Region of the surface with these signs of the Lie derivatives.
fn region_of([p, q]: [f64; 2]) -> Region {
    match (p > 0.0, q > 0.0) {
        (false, true) => Region::Attracting,
        (true, false) => Region::Repelling,
        (true, true) => Region::CrossingUp,
        (false, false) => Region::CrossingDown,
    }
}

impl<'a> Level<'a> {
    /// h over the states `shown`, with others fixed at the values given; none if h depends on a
    /// state that is neither.
    pub fn new(system: &System, shown: &[usize], fixed: &[(usize, f64)]) -> Option<Self> {
        let known = |i: &usize| shown.contains(i) || fixed.iter().any(|(k, _)| k == i);
        if !system.definition().switching_states().iter().all(known) {
            return None;
        }
        let mut base = vec![0.0; system.dimension()];
        fixed.iter().for_each(|(i, value)| base[*i] = *value);
        let full = (0..system.dimension()).all(|i| known(&i));
        let lie = if full { lie_of(system) } else { None };
        Some(Self { h: Program::new(&system.tape().select([0])), shown: shown.to_vec(), base, lie })
    }

    /// The surfaces of a system, each as [`Level::new`] has it: one, or two of a system with two. A
    /// point of one of two is coloured by what happens there with the sign that the other's
    /// function has.
    pub fn all(system: &System, shown: &[usize], fixed: &[(usize, f64)]) -> Vec<Self> {
        let Some(faces) = system.faces() else {
            return Self::new(system, shown, fixed).into_iter().collect();
        };
        [0, 1]
            .into_iter()
            .filter_map(|i| {
                let level = Self::new(&faces[i][0], shown, fixed)?;
                let other = Program::new(&faces[1 - i][0].tape().select([0]));
                let lie = level.lie.and_then(|above| {
                    let below = lie_of(&faces[i][1])?;
                    let chosen = move |x: &[f64]| {
                        let mut h = [f64::NAN];
                        other.evaluate(x, &mut h);
                        if h[0] < 0.0 { below(x) } else { above(x) }
                    };
                    Some(Box::new(chosen) as Box<Lie<'a>>)
                });
                Some(Self { lie, ..level })
            })
            .collect()
    }

    /// Whether points can be coloured by what happens there.
    pub fn has_regions(&self) -> bool {
        self.lie.is_some()
    }

    fn full(&self, at: &[f64]) -> Vec<f64> {
        let mut x = self.base.clone();
        self.shown.iter().zip(at).for_each(|(i, v)| x[*i] = *v);
        x
    }

    fn h(&self, at: &[f64]) -> f64 {
        let mut out = [f64::NAN];
        self.h.evaluate(&self.full(at), &mut out);
        out[0]
    }

    fn region(&self, at: &[f64]) -> Option<Region> {
        self.lie.as_ref().map(|lie| region_of(lie(&self.full(at))))
    }

    /// The zero between two places where h has different signs.
    fn zero<const K: usize>(&self, a: [f64; K], b: [f64; K]) -> [f64; K] {
        change(a, b, |p| self.h(p) >= 0.0)
    }

    /// Zeros of h on a line of the one state shown, within `range`.
    pub fn points(&self, range: (f64, f64)) -> Vec<f64> {
        let knots = lines(range, LINE_CELLS);
        let side = |x: f64| self.h(&[x]) >= 0.0;
        knots
            .windows(2)
            .filter(|w| side(w[0]) != side(w[1]))
            .map(|w| self.zero([w[0]], [w[1]])[0])
            .collect()
    }

    /// The curve h = 0 over the two states shown, in pieces of one region each.
    pub fn curves(&self, ranges: [(f64, f64); 2]) -> Vec<(Option<Region>, Vec<[f64; 2]>)> {
        let (us, vs) = (lines(ranges[0], PLANE_CELLS), lines(ranges[1], PLANE_CELLS));
        let signs: Vec<Vec<bool>> =
            us.iter().map(|u| vs.iter().map(|v| self.h(&[*u, *v]) >= 0.0).collect()).collect();
        let mut segments: Vec<[[f64; 2]; 2]> = Vec::new();
        for i in 0..us.len() - 1 {
            for j in 0..vs.len() - 1 {
                // Two triangles a cell: no ambiguous cases.
                let corner = |a: usize, b: usize| ([us[i + a], vs[j + b]], signs[i + a][j + b]);
                let [p, q, r, s] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                for triangle in [[p, q, r], [p, r, s]] {
                    let cut: Vec<[f64; 2]> = [(0, 1), (1, 2), (0, 2)]
                        .into_iter()
                        .filter(|(a, b)| triangle[*a].1 != triangle[*b].1)
                        .map(|(a, b)| self.zero(triangle[a].0, triangle[b].0))
                        .collect();
                    if let [a, b] = cut[..]
                        && a != b
                    {
                        segments.push([a, b]);
                    }
                }
            }
        }
        let mut pieces: Vec<(Option<Region>, Vec<[f64; 2]>)> = Vec::new();
        for line in chained(&segments) {
            for pair in line.windows(2) {
                let middle = [0.5 * (pair[0][0] + pair[1][0]), 0.5 * (pair[0][1] + pair[1][1])];
                let here = self.region(&middle);
                match pieces.last_mut() {
                    Some((region, points))
                        if *region == here && points.last() == Some(&pair[0]) =>
                    {
                        points.push(pair[1])
                    }
                    _ => pieces.push((here, pair.to_vec())),
                }
            }
        }
        pieces
    }

    /// The surface h = 0 over the three states shown, coloured by region.
    pub fn patches(&self, ranges: &[(f64, f64); 3]) -> Vec<Patch> {
        let mut patches = Vec::new();
        for polygon in self.polygons(ranges) {
            self.cut(polygon, &mut patches);
        }
        patches
    }

    /// The surface h = 0 over the three states shown, as triangles and quadrangles.
    pub fn polygons(&self, ranges: &[(f64, f64); 3]) -> Vec<Vec<[f64; 3]>> {
        let knots = ranges.map(|r| lines(r, SPACE_CELLS));
        let at = |c: [usize; 3]| -> [f64; 3] { std::array::from_fn(|k| knots[k][c[k]]) };
        let n: [usize; 3] = std::array::from_fn(|k| knots[k].len());
        let index = |c: [usize; 3]| (c[0] * n[1] + c[1]) * n[2] + c[2];
        let mut sides = vec![false; n[0] * n[1] * n[2]];
        for i in 0..n[0] {
            for j in 0..n[1] {
                for k in 0..n[2] {
                    sides[index([i, j, k])] = self.h(&at([i, j, k])) >= 0.0;
                }
            }
        }
        let mut polygons = Vec::new();
        for i in 0..n[0] - 1 {
            for j in 0..n[1] - 1 {
                for k in 0..n[2] - 1 {
                    for tetrahedron in TETRAHEDRA {
                        let corners =
                            tetrahedron.map(|c| [i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1)]);
                        let (up, down): (Vec<_>, Vec<_>) =
                            corners.into_iter().partition(|c| sides[index(*c)]);
                        let zero = |a: [usize; 3], b: [usize; 3]| self.zero(at(a), at(b));
                        match (&up[..], &down[..]) {
                            ([one], [a, b, c]) | ([a, b, c], [one]) => {
                                polygons.push([a, b, c].map(|other| zero(*one, *other)).to_vec());
                            }
                            ([a, b], [c, d]) => {
                                let around = [(a, c), (a, d), (b, d), (b, c)];
                                polygons.push(around.map(|(a, b)| zero(*a, *b)).to_vec());
                            }
                            _ => {}
                        }
                    }
                }
            }
        }
        polygons
    }

    /// A polygon in one colour, or its parts on either side of the edges between regions.
    fn cut(&self, mut corners: Vec<[f64; 3]>, patches: &mut Vec<Patch>) {
        corners.dedup();
        if corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        if corners.len() < 3 {
            return;
        }
        let Some(lie) = &self.lie else {
            patches.push(Patch { corners, colour: colour(None) });
            return;
        };
        let whole = area(&corners);
        let mut parts = vec![corners];
        for derivative in [0, 1] {
            let positive = |p: &[f64; 3]| lie(&self.full(p))[derivative] > 0.0;
            parts = parts.iter().flat_map(|part| divided(part, positive)).collect();
        }
        // If f+ and f- agree on the surface, their Lie derivatives change sign together but for
        // rounding, and leave slivers.
        for part in parts.into_iter().filter(|part| area(part) > SLIVER * whole) {
            let n = part.len() as f64;
            let centre: [f64; 3] =
                std::array::from_fn(|i| part.iter().map(|p| p[i]).sum::<f64>() / n);
            patches.push(Patch { colour: colour(self.region(&centre)), corners: part });
        }
    }
}

/// Twice the area of a flat polygon, squared.
fn area(corners: &[[f64; 3]]) -> f64 {
    let mut sum = SVector::<f64, 3>::zeros();
    let from = |k: usize| SVector::from(corners[k]) - SVector::from(corners[0]);
    for k in 1..corners.len().saturating_sub(1) {
        sum += from(k).cross(&from(k + 1));
    }
    sum.norm_squared()
}

/// Parts of a polygon below this share of its area, squared, are not drawn.
const SLIVER: f64 = 1e-12;

/// Place between two others at which a condition changes, by bisection: nothing need be smooth. The
/// same place from either end.
fn change<const K: usize>(
    a: [f64; K],
    b: [f64; K],
    condition: impl Fn(&[f64; K]) -> bool,
) -> [f64; K] {
    let before = a.iter().zip(&b).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne());
    let (a, b) = if before == Some(std::cmp::Ordering::Greater) { (b, a) } else { (a, b) };
    let (mut low, mut high, first) = (0.0, 1.0, condition(&a));
    let at = |s: f64| -> [f64; K] { std::array::from_fn(|i| a[i] + s * (b[i] - a[i])) };
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if condition(&at(middle)) == first {
            low = middle;
        } else {
            high = middle;
        }
    }
    at(0.5 * (low + high))
}

/// The parts of a convex polygon where a condition holds and where it does not.
fn divided(corners: &[[f64; 3]], condition: impl Fn(&[f64; 3]) -> bool) -> Vec<Vec<[f64; 3]>> {
    let held: Vec<bool> = corners.iter().map(&condition).collect();
    if held.iter().all(|h| *h == held[0]) {
        return vec![corners.to_vec()];
    }
    let mut parts = [Vec::new(), Vec::new()];
    for (i, corner) in corners.iter().enumerate() {
        let next = (i + 1) % corners.len();
        parts[usize::from(held[i])].push(*corner);
        if held[i] != held[next] {
            let edge = change(*corner, corners[next], &condition);
            parts.iter_mut().for_each(|part| part.push(edge));
        }
    }
    parts.into_iter().filter(|part| part.len() >= 3).collect()
}

/// Colour of a patch: by region, or that of crossing where the region is not known.
pub fn colour(region: Option<Region>) -> Colour {
    match region {
        Some(Region::Attracting) => style::ATTRACTING,
        Some(Region::Repelling) => style::REPELLING,
        Some(Region::CrossingUp | Region::CrossingDown | Region::Boundary) | None => {
            style::CROSSING
        }
    }
}

/// Cells along a line, a plane's side, a box's side. Odd, so that zeros at the middle of a range
/// fall on no knot.
const LINE_CELLS: usize = 401;
const PLANE_CELLS: usize = 151;
const SPACE_CELLS: usize = 25;
/// Halvings of an edge until its zero is sharper than ink.
const HALVINGS: u32 = 40;
/// A cube's six tetrahedra around the diagonal from corner 0 to corner 7 (bits: x, y, z).
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// Equidistant knots over a range.
fn lines((low, high): (f64, f64), cells: usize) -> Vec<f64> {
    (0..=cells).map(|i| low + (high - low) * i as f64 / cells as f64).collect()
}

/// Segments joined at equal ends into lines, those with loose ends first.
fn chained(segments: &[[[f64; 2]; 2]]) -> Vec<Vec<[f64; 2]>> {
    let key = |p: &[f64; 2]| [p[0].to_bits(), p[1].to_bits()];
    let mut at: BTreeMap<[u64; 2], Vec<usize>> = BTreeMap::new();
    for (i, segment) in segments.iter().enumerate() {
        segment.iter().for_each(|p| at.entry(key(p)).or_default().push(i));
    }
    let loose = |p: &[f64; 2]| at.get(&key(p)).is_some_and(|all| all.len() == 1);
    let ends = segments
        .iter()
        .enumerate()
        .flat_map(|(i, s)| s.iter().filter(|p| loose(p)).map(move |p| (i, *p)));
    let starts: Vec<(usize, [f64; 2])> =
        ends.chain(segments.iter().enumerate().map(|(i, s)| (i, s[0]))).collect();
    let mut used = vec![false; segments.len()];
    let mut found = Vec::new();
    for (first, start) in starts {
        if used[first] {
            continue;
        }
        let (mut line, mut here, mut next) = (vec![start], start, Some(first));
        while let Some(i) = next {
            used[i] = true;
            let [a, b] = segments[i];
            here = if key(&a) == key(&here) { b } else { a };
            line.push(here);
            next = at.get(&key(&here)).and_then(|all| all.iter().copied().find(|k| !used[*k]));
        }
        found.push(line);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_system::Definition;

    fn system(states: &str, h: &str, field: &str) -> System {
        let text = format!("states = [{states}]\nh = \"{h}\"\nplus = [{field}]\nminus = [{field}]");
        System::new(Definition::from_toml(&text, "f").unwrap_or_else(|e| panic!("{e}")))
    }

    #[test]
    fn a_circle_is_one_closed_curve() {
        let circle = system("\"x\", \"y\"", "x^2 + y^2 - 1", "\"1\", \"0\"");
        let level = Level::new(&circle, &[0, 1], &[]).unwrap();
        let pieces = level.curves([(-1.7, 1.6), (-1.5, 1.5)]);
        let length: f64 = pieces
            .iter()
            .flat_map(|(_, p)| {
                p.windows(2)
                    .map(|w| ((w[1][0] - w[0][0]).powi(2) + (w[1][1] - w[0][1]).powi(2)).sqrt())
            })
            .sum();
        assert!((length - std::f64::consts::TAU).abs() < 1e-2, "{length}");
        // f = (1, 0): up where x > 0, down where x < 0. Two pieces, one of them cut where the curve
        // was begun.
        assert!(pieces.len() <= 3, "{}", pieces.len());
        for (region, points) in &pieces {
            let x = points[points.len() / 2][0];
            assert_eq!(
                *region,
                Some(if x > 0.0 { Region::CrossingUp } else { Region::CrossingDown })
            );
        }
    }

    #[test]
    fn a_sphere_has_its_area_and_its_regions() {
        let sphere = system("\"x\", \"y\", \"z\"", "x^2 + y^2 + z^2 - 1", "\"1\", \"0\", \"0\"");
        let level = Level::new(&sphere, &[0, 1, 2], &[]).unwrap();
        let patches = level.patches(&[(-1.2, 1.25), (-1.1, 1.1), (-1.3, 1.3)]);
        let area: f64 = patches.iter().map(|p| 0.5 * super::area(&p.corners).sqrt()).sum();
        // An inscribed polyhedron has a little less: about (cell/radius)^2.
        let share = area / (2.0 * std::f64::consts::TAU);
        assert!((0.985..1.0).contains(&share), "{share}");
    }

    #[test]
    fn fields_that_agree_leave_no_slivers() {
        let text = "states = ['x', 'y', 'z']\nh = 'x^2 - 1'\nplus = ['3*(y - 0.1*x) - 0.3*z', '1', \
            '1']\nminus = ['3*y - 0.3*(x + z)', '1', '1']";
        let system = System::new(Definition::from_toml(text, "f").unwrap());
        let level = Level::new(&system, &[0, 1, 2], &[]).unwrap();
        let patches = level.patches(&[(-1.7, 1.6), (-1.0, 1.1), (-1.2, 1.3)]);
        assert!(patches.len() > 1000 && patches.iter().all(|p| p.colour == style::CROSSING));
    }

    #[test]
    fn what_cannot_be_drawn_is_not() {
        let slab = system("\"x\", \"y\", \"z\"", "x + y", "\"1\", \"0\", \"0\"");
        assert!(Level::new(&slab, &[0, 2], &[]).is_none());
        let fixed = Level::new(&slab, &[0, 2], &[(1, -0.5)]).unwrap();
        assert!(fixed.has_regions());
        let shown = Level::new(&slab, &[0, 1], &[]).unwrap();
        assert!(!shown.has_regions());
        let on_a_line = Level::new(&slab, &[0], &[(1, -0.5)]).unwrap().points((-1.0, 1.0));
        assert!(on_a_line.len() == 1 && (on_a_line[0] - 0.5).abs() < 1e-9, "{on_a_line:?}");
    }
}
