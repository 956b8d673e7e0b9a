//! Sides of functions of which some follow from others: of x > y, y > z and z > x not all hold.
//!
//! Around a meeting of such surfaces some patterns of signs have no points, and their fields are no
//! part of Filippov's hull, which is made of limits at points nearby (Filippov 1988, sec. 4). What
//! has points are the cells of an arrangement of planes, and their faces.

use twofold_num::linear::eigenvalues;

use crate::selection::{Way, dot, nearest_of_hull, new_part, null_vector, top_direction};

/// Smaller lengths, relative to their parts, are rounding.
const ROUNDING: f64 = 1e-9;

/// The sides of functions that are zero together, as far as they have points.
pub(crate) struct Cells {
    /// By which each function is divided.
    scale: Vec<f64>,
    /// An orthonormal basis of the values that the functions take together.
    basis: Vec<Vec<f64>>,
    /// The patterns of signs (bit i: function i is positive) that have points.
    pub patterns: Vec<usize>,
}

impl Cells {
    /// Of functions with these values at points around their common zero; none if no function
    /// follows from others.
    pub fn of(values: &[Vec<f64>]) -> Option<Self> {
        let k = values.first()?.len();
        let most = |i: usize| values.iter().fold(0.0_f64, |most, v| most.max(v[i].abs()));
        let scale: Vec<f64> = (0..k).map(most).collect();
        if !scale.iter().all(|s| *s > 0.0 && s.is_finite()) {
            return None;
        }
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for v in values {
            let v: Vec<f64> = v.iter().zip(&scale).map(|(v, s)| v / s).collect();
            basis.extend(new_part(&basis, &v).map(|(new, _)| new));
        }
        if basis.len() == k {
            return None;
        }
        let mut cells = Self { scale, basis, patterns: Vec::new() };
        let sides = |p: usize| move |i: usize| if p >> i & 1 == 1 { Way::Plus } else { Way::Minus };
        let has = |p: &usize| cells.has(&(0..k).map(sides(*p)).collect::<Vec<_>>());
        cells.patterns = (0..1 << k).filter(has).collect();
        Some(cells)
    }

    /// The cells of some of the functions, if one of these follows from others.
    pub fn part(&self, of: &[usize]) -> Option<Self> {
        let values: Vec<Vec<f64>> = self
            .basis
            .iter()
            .map(|b| of.iter().map(|i| b[*i] * self.scale[*i]).collect())
            .collect();
        Self::of(&values)
    }

    /// The coordinates of function i.
    fn row(&self, i: usize) -> Vec<f64> {
        self.basis.iter().map(|b| b[i]).collect()
    }

    /// Whether there are points where each function is on this side of zero, or stays at it.
    pub fn has(&self, ways: &[Way]) -> bool {
        let mut stay = Vec::new();
        for i in (0..ways.len()).filter(|i| ways[*i] == Way::Stay) {
            stay.extend(new_part(&stay, &self.row(i)).map(|(new, _)| new));
        }
        let mut towards = Vec::new();
        for (i, way) in ways.iter().enumerate().filter(|(_, way)| **way != Way::Stay) {
            let Some((row, _)) = new_part(&stay, &self.row(i)) else { return false };
            let sign = if *way == Way::Plus { 1.0 } else { -1.0 };
            towards.push(row.iter().map(|v| sign * v).collect::<Vec<f64>>());
        }
        if towards.is_empty() {
            return true;
        }
        let inside = nearest_of_hull(&towards);
        towards.iter().all(|v| dot(v, &inside) > ROUNDING)
    }

    /// The coordinates of the functions' rates in each cell, the largest of which is 1.
    fn speeds(&self, rates: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let scaled = |rate: &Vec<f64>| {
            let scaled: Vec<f64> = rate.iter().zip(&self.scale).map(|(r, s)| r / s).collect();
            self.basis.iter().map(|b| dot(b, &scaled)).collect::<Vec<f64>>()
        };
        let mut speeds: Vec<Vec<f64>> = rates.iter().map(scaled).collect();
        let largest = speeds.iter().flatten().fold(0.0_f64, |most, v| most.max(v.abs()));
        speeds.iter_mut().flatten().for_each(|v| *v /= largest);
        speeds
    }

    /// The depth of zero in the hull of the cells' rates, the distance from its nearest facet;
    /// negative outside.
    pub fn depth(&self, rates: &[Vec<f64>]) -> f64 {
        let (r, speeds) = (self.basis.len(), self.speeds(rates));
        let mut depth = f64::INFINITY;
        subsets(speeds.len(), r, &mut |corners| {
            let differences: Vec<Vec<f64>> = corners[1..]
                .iter()
                .map(|c| speeds[*c].iter().zip(&speeds[corners[0]]).map(|(a, b)| a - b).collect())
                .collect();
            let mut square = differences.concat();
            square.resize(r * r, 0.0);
            let Some(normal) = null_vector(&square, r) else { return };
            let level = dot(&normal, &speeds[corners[0]]);
            let off = || speeds.iter().map(|v| dot(&normal, v) - level);
            if off().all(|off| off <= ROUNDING) {
                depth = depth.min(level);
            } else if off().all(|off| off >= -ROUNDING) {
                depth = depth.min(-level);
            }
        });
        if depth.is_finite() { depth } else { -1.0 }
    }

    /// Whether the motion comes to the common zero in finite time from all points around it: a
    /// quadratic form of the functions falls along the field of each cell. It falls along mixtures
    /// then, too, on the faces between.
    pub fn attract(&self, rates: &[Vec<f64>]) -> bool {
        const MOST_CUTS: usize = 60;
        let (r, speeds) = (self.basis.len(), self.speeds(rates));
        // Where a form of two vectors is a sum of products with the entries of a symmetric matrix.
        let pairs: Vec<(usize, usize)> = (0..r).flat_map(|a| (a..r).map(move |b| (a, b))).collect();
        let product = |x: &[f64], y: &[f64]| -> Vec<f64> {
            let both = |a: usize, b: usize| x[a] * y[b] + x[b] * y[a];
            pairs.iter().map(|(a, b)| if a == b { x[*a] * y[*a] } else { both(*a, *b) }).collect()
        };
        let mut wanted: Vec<Vec<f64>> = Vec::new();
        for ray in self.rays() {
            let on = |i: usize| dot(&self.row(i), &ray);
            for (pattern, speed) in self.patterns.iter().zip(&speeds) {
                let side = |i: usize| if pattern >> i & 1 == 1 { 1.0 } else { -1.0 };
                if (0..self.scale.len()).all(|i| on(i) * side(i) >= -ROUNDING) {
                    let along = product(&ray, speed);
                    let length = dot(&along, &along).sqrt();
                    wanted.push(along.iter().map(|v| -v / length).collect());
                }
            }
        }
        let unit = |i: usize| (0..r).map(|j| if i == j { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
        wanted.extend((0..r).map(|i| product(&unit(i), &unit(i))));
        let mut form: Vec<f64> = pairs.iter().map(|(a, b)| f64::from(u8::from(a == b))).collect();
        for _ in 0..MOST_CUTS {
            let falls = |form: &[f64]| {
                let length = dot(form, form).sqrt();
                wanted.iter().all(|w| dot(w, form) > ROUNDING * length)
            };
            if !falls(&form) {
                form = nearest_of_hull(&wanted);
                if !falls(&form) {
                    return false;
                }
            }
            let entry = |a: usize, b: usize| {
                let at = pairs.iter().position(|p| *p == (a.min(b), a.max(b)));
                -at.map_or(0.0, |at| form[at])
            };
            let negative: Vec<f64> = (0..r * r).map(|p| entry(p / r, p % r)).collect();
            let Some(all) = eigenvalues(&negative, r) else { return false };
            if all.iter().all(|[value, _]| *value < 0.0) {
                return true;
            }
            let x = top_direction(&negative, r);
            wanted.push(product(&x, &x));
        }
        false
    }

    /// The directions in which all functions that are not zero are on one side: those of lines in
    /// which planes meet, both ways.
    fn rays(&self) -> Vec<Vec<f64>> {
        let r = self.basis.len();
        let mut rays = Vec::new();
        subsets(self.scale.len(), r - 1, &mut |planes| {
            let mut square: Vec<f64> = planes.iter().flat_map(|i| self.row(*i)).collect();
            square.resize(r * r, 0.0);
            if let Some(ray) = null_vector(&square, r) {
                rays.push(ray.iter().map(|v| -v).collect());
                rays.push(ray);
            }
        });
        rays
    }
}

/// The shortest weights that sum to one and leave all rates at zero; some may be negative. Where
/// all mixtures have one velocity it is that of these weights, too.
pub(crate) fn weights(rates: &[Vec<f64>]) -> Vec<f64> {
    let count = rates.len();
    let (mut weights, mut basis) = (vec![0.0; count], Vec::new());
    let ones = std::iter::once((vec![1.0; count], 1.0));
    let rows = (0..rates[0].len()).map(|i| (rates.iter().map(|r| r[i]).collect::<Vec<_>>(), 0.0));
    for (row, wanted) in ones.chain(rows) {
        let missing = wanted - dot(&row, &weights);
        if let Some((new, length)) = new_part(&basis, &row) {
            weights.iter_mut().zip(&new).for_each(|(w, v)| *w += missing / length * v);
            basis.push(new);
        }
    }
    weights
}

/// Whether the last function follows from the others.
pub(crate) fn last_follows(values: &[Vec<f64>]) -> bool {
    let row = |i: usize| values.iter().map(|v| v[i]).collect::<Vec<f64>>();
    let mut basis = Vec::new();
    let last = values[0].len() - 1;
    (0..last).for_each(|i| basis.extend(new_part(&basis, &row(i)).map(|(new, _)| new)));
    row(last).iter().all(|v| v.is_finite()) && new_part(&basis, &row(last)).is_none()
}

/// Calls `visit` with each set of `size` of the first `count` numbers.
fn subsets(count: usize, size: usize, visit: &mut dyn FnMut(&[usize])) {
    fn from(
        next: usize,
        count: usize,
        size: usize,
        set: &mut Vec<usize>,
        visit: &mut dyn FnMut(&[usize]),
    ) {
        if set.len() == size {
            return visit(set);
        }
        for i in next..count {
            set.push(i);
            from(i + 1, count, size, set, visit);
            set.pop();
        }
    }
    from(0, count, size, &mut Vec::new(), visit);
}
