//! Continuation of the motion from switching surfaces.
//!
//! At a point where k switching functions are zero each may go to its positive side (its derivative
//! is positive there), to its negative side (negative), or stay at zero, where the field is a
//! mixture of those on both sides (Filippov 1988, sec. 4). What is possible is what is consistent:
//! an assignment in which every function does what it is said to do. One possibility is the motion;
//! several are a motion that is not decided.

use twofold_num::linear::{eigenvalues, solve_any};
use twofold_num::random::RandomStream;
use twofold_system::Expression;

/// Motion of a switching function from zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Goes to its negative side.
    Minus,
    /// Stays at zero.
    Stay,
    /// Goes to its positive side.
    Plus,
}

impl Way {
    /// The sign that stands for it in tables.
    pub fn sign(self) -> char {
        match self {
            Way::Minus => '-',
            Way::Stay => '0',
            Way::Plus => '+',
        }
    }
}

/// Most surfaces that depend on each other at one point, if all possibilities are tried.
pub const MOST_TOGETHER: usize = 6;

/// A field around a meeting of surfaces, and the rates of their functions in it.
pub(crate) type Around = (Vec<f64>, Vec<f64>);

/// The only possibility at the meeting of `k` surfaces, of any number, if the fields around it are
/// sums of what each positive side adds, s' = r + M w with w from 0 to 1, and M is diagonally
/// stable ([`attraction`]): a linear complementarity problem in a box, by block principal pivoting
/// (Judice & Pires 1994). A solution in which nothing is on the verge of another is the only one,
/// since all of them are a convex set (Cottle, Pang & Stone 1992, sec. 3.1). `at` gives the field
/// and the functions' rates with these functions positive.
pub(crate) fn complementary(
    k: usize,
    at: &mut dyn FnMut(Vec<bool>) -> Option<Around>,
) -> Option<Vec<Way>> {
    const MOST_PIVOTS: usize = 2000;
    /// Corners at which the fields are compared with sums.
    const TRIED: usize = 40;
    /// So many exchanges of whole blocks may not help before single ones are made.
    const PATIENCE: usize = 10;
    let joined = |(field, rates): Around| [field, rates].concat();
    let base = joined(at(vec![false; k])?);
    let n = base.len() - k;
    let mut added = Vec::with_capacity(k);
    for one in 0..k {
        let there = joined(at((0..k).map(|i| i == one).collect())?);
        added.push(there.iter().zip(&base).map(|(a, b)| a - b).collect::<Vec<f64>>());
    }
    let is_sum = |plus: &[bool], there: &[f64]| {
        there.iter().enumerate().all(|(i, value)| {
            let parts = || (0..k).filter(|j| plus[*j]).map(|j| added[j][i]);
            let size = parts().fold(base[i].abs(), |sum, part| sum + part.abs());
            (base[i] + parts().sum::<f64>() - value).abs() <= 1e-9 * size
        })
    };
    // Products of signs may cancel on some sides, and hardly on all of many drawn by chance.
    let mut chance = RandomStream::new(0, k as u64);
    for _ in 0..TRIED {
        let plus: Vec<bool> = (0..k).map(|_| chance.uniform() < 0.5).collect();
        let there = joined(at(plus.clone())?);
        if !is_sum(&plus, &there) {
            return None;
        }
    }
    let rates = &base[n..];
    let m: Vec<f64> = (0..k * k).map(|p| added[p % k][n + p / k]).collect();
    if !is_diagonally_stable(&m, k) {
        return None;
    }
    let (mut ways, mut fewest, mut patience) = (vec![Way::Stay; k], usize::MAX, PATIENCE);
    for _ in 0..MOST_PIVOTS {
        let stay: Vec<usize> = (0..k).filter(|i| ways[*i] == Way::Stay).collect();
        let plus: Vec<usize> = (0..k).filter(|i| ways[*i] == Way::Plus).collect();
        let rate = |i: usize| rates[i] + plus.iter().map(|j| m[i * k + j]).sum::<f64>();
        let part: Vec<f64> = stay.iter().flat_map(|i| stay.iter().map(|j| m[*i * k + j])).collect();
        let right: Vec<f64> = stay.iter().map(|i| -rate(*i)).collect();
        let weights = if stay.is_empty() { Vec::new() } else { solve_any(&part, &right, 0.0)? };
        let mut wrong = Vec::new();
        let mut on_the_verge = false;
        for (i, way) in ways.iter().enumerate() {
            // Its distance from its bounds in units of what is added up, and its way if it is
            // outside.
            let (inside, other) = if *way == Way::Stay {
                let weight = weights[stay.iter().position(|s| *s == i)?];
                let other = if weight < 0.5 { Way::Minus } else { Way::Plus };
                (weight.min(1.0 - weight), other)
            } else {
                let parts = || stay.iter().zip(&weights).map(|(j, w)| w * m[i * k + j]);
                let size = parts().fold(rate(i).abs(), |sum, part| sum + part.abs());
                let speed = rate(i) + parts().sum::<f64>();
                let away = if *way == Way::Plus { speed } else { -speed };
                (away / size.max(f64::MIN_POSITIVE), Way::Stay)
            };
            on_the_verge |= inside.abs() <= 1e-12;
            if inside < 0.0 {
                wrong.push((i, other));
            }
        }
        if wrong.is_empty() {
            return (!on_the_verge).then_some(ways);
        }
        if wrong.len() < fewest {
            (fewest, patience) = (wrong.len(), PATIENCE);
        } else if patience > 0 {
            patience -= 1;
        } else {
            wrong.drain(..wrong.len() - 1);
        }
        wrong.into_iter().for_each(|(i, way)| ways[i] = way);
    }
    None
}

/// Choice among mixtures of the fields on several surfaces at once, if mixtures have different
/// velocities.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Intersection {
    /// None: the run ends with an error.
    #[default]
    Undecided,
    /// Products of one weight for each surface: what equally steep smoothed switches tend to
    /// (Alexander & Seidman 1998).
    Bilinear,
    /// The shortest velocity of Filippov's hull that stays on the surfaces (the slow solution:
    /// Aubin & Cellina 1984, ch. 2).
    HullLeastNorm,
    /// The hierarchy of switches: these switching functions, the one that switches fastest first.
    /// The first is slid upon for each side of all others, the second on the result, and so on
    /// (Utkin 1992, ch. 3; Jeffrey 2014, SIAM J. Appl. Dyn. Syst. 13, 1082).
    Order(Vec<Expression>),
}

/// A mixture of the 2^k fields around the meeting of k surfaces.
pub(crate) struct Mixture {
    /// One for each field.
    pub weights: Vec<f64>,
    /// For each surface the least weight of its positive and of its negative side: of all fields,
    /// or for each side of the slower ones.
    pub margins: Vec<[f64; 2]>,
}

/// Weights of the 2^k fields around the meeting of k surfaces (bit i: the positive side of surface
/// i), so that their mixture stays on all of them. `rates` are the derivatives of the k functions
/// along each field, `order` the surfaces of [`Intersection::Order`] by their places.
pub(crate) fn mixture(
    rule: &Intersection,
    order: &[usize],
    fields: &[Vec<f64>],
    rates: &[Vec<f64>],
) -> Option<Mixture> {
    let k = rates.first()?.len();
    let weights = match rule {
        Intersection::Undecided => return None,
        Intersection::Bilinear => bilinear(rates, k)?,
        Intersection::HullLeastNorm => shortest(fields, rates, k)?,
        Intersection::Order(_) => return hierarchy(order, rates, k),
    };
    let on = |i: usize| weights.iter().enumerate().filter(move |(vertex, _)| vertex >> i & 1 == 1);
    let share = |i: usize| on(i).map(|(_, w)| w).sum::<f64>();
    let margins = (0..k).map(|i| [share(i), 1.0 - share(i)]).collect();
    Some(Mixture { weights, margins })
}

/// One surface after the other: for each side of those that are left the two mixtures are mixed so
/// that the next function stays at zero. None if the order leaves a surface out, or if one does not
/// attract from both sides.
fn hierarchy(order: &[usize], rates: &[Vec<f64>], k: usize) -> Option<Mixture> {
    let count = rates.len();
    if order.len() != k {
        return None;
    }
    let mut weights = vec![1.0; count];
    let mut margins = vec![[f64::INFINITY; 2]; k];
    let mut mixed = 0;
    for &surface in order {
        let bit = 1 << surface;
        mixed |= bit;
        // The mixtures are told apart by the sides of the surfaces that are left.
        let speed = |weights: &[f64], left: usize, side: usize| -> f64 {
            let of = |v: &usize| v & !mixed == left && v & bit == side;
            (0..count).filter(of).map(|v| weights[v] * rates[v][surface]).sum()
        };
        for left in (0..count).filter(|left| left & mixed == 0) {
            let (low, high) = (speed(&weights, left, 0), speed(&weights, left, bit));
            if !(low > high) {
                return None;
            }
            let share = low / (low - high);
            let [plus, minus] = &mut margins[surface];
            (*plus, *minus) = (plus.min(share), minus.min(1.0 - share));
            for v in (0..count).filter(|v| v & !mixed == left) {
                weights[v] *= if v & bit == 0 { 1.0 - share } else { share };
            }
        }
    }
    Some(Mixture { weights, margins })
}

/// Newton's method for the weights of the surfaces.
fn bilinear(rates: &[Vec<f64>], k: usize) -> Option<Vec<f64>> {
    let factor =
        |w: &[f64], vertex: usize, i: usize| if vertex >> i & 1 == 1 { w[i] } else { 1.0 - w[i] };
    let mut w = vec![0.5; k];
    for _ in 0..50 {
        let (mut value, mut jacobian) = (vec![0.0; k], vec![0.0; k * k]);
        for (vertex, rate) in rates.iter().enumerate() {
            let all: f64 = (0..k).map(|i| factor(&w, vertex, i)).product();
            for r in 0..k {
                value[r] += all * rate[r];
            }
            for c in 0..k {
                let others: f64 =
                    (0..k).filter(|i| *i != c).map(|i| factor(&w, vertex, i)).product();
                let sign = if vertex >> c & 1 == 1 { 1.0 } else { -1.0 };
                for r in 0..k {
                    jacobian[r * k + c] += sign * others * rate[r];
                }
            }
        }
        let step = solve_any(&jacobian, &value, 0.0)?;
        w.iter_mut().zip(&step).for_each(|(w, s)| *w = (*w - s).clamp(-1.0, 2.0));
        if step.iter().all(|s| s.abs() <= 1e-14) {
            break;
        }
    }
    let weight = |vertex| (0..k).map(|i| factor(&w, vertex, i)).product();
    let weights: Vec<f64> = (0..rates.len()).map(weight).collect();
    stays(&weights, rates, k).then_some(weights)
}

/// Rates of a mixture below this share of the largest one are rounding.
const STAYS: f64 = 1e-10;

/// Whether the mixture with these weights stays on all surfaces.
fn stays(weights: &[f64], rates: &[Vec<f64>], k: usize) -> bool {
    let rate = |r: usize| weights.iter().zip(rates).map(|(w, f)| w * f[r]).sum::<f64>().abs();
    let size = rates.iter().flatten().fold(0.0_f64, |most, v| most.max(v.abs()));
    (0..k).map(rate).sum::<f64>() <= STAYS * size
}

/// The least square of the mixture's length under the conditions that weights sum to one, are not
/// negative and keep all functions at zero: the conditions of Karush, Kuhn and Tucker for every set
/// of fields that take part.
pub(crate) fn shortest(fields: &[Vec<f64>], rates: &[Vec<f64>], k: usize) -> Option<Vec<f64>> {
    let mut best: Option<(f64, Vec<f64>)> = None;
    for set in 1_usize..1 << fields.len() {
        let part: Vec<usize> = (0..fields.len()).filter(|v| set >> v & 1 == 1).collect();
        let (p, m) = (part.len(), part.len() + k + 1);
        let (mut matrix, mut right) = (vec![0.0; m * m], vec![0.0; m]);
        for (i, a) in part.iter().enumerate() {
            for (j, b) in part.iter().enumerate() {
                matrix[i * m + j] = dot(&fields[*a], &fields[*b]);
            }
            for r in 0..=k {
                let value = if r < k { rates[*a][r] } else { 1.0 };
                matrix[i * m + p + r] = value;
                matrix[(p + r) * m + i] = value;
            }
        }
        right[m - 1] = 1.0;
        let Some(solution) = solve_any(&matrix, &right, 0.0) else { continue };
        let weights = &solution[..p];
        if weights.iter().any(|w| *w < -1e-12) {
            continue;
        }
        let mut all = vec![0.0; fields.len()];
        part.iter().zip(weights).for_each(|(v, w)| all[*v] = w.max(0.0));
        let n = fields[0].len();
        let velocity: Vec<f64> =
            (0..n).map(|i| all.iter().zip(fields).map(|(w, f)| w * f[i]).sum()).collect();
        // Of a singular set what is solved need not be a mixture.
        let whole = (all.iter().sum::<f64>() - 1.0).abs() <= STAYS;
        let length = dot(&velocity, &velocity);
        if whole && stays(&all, rates, k) && best.as_ref().is_none_or(|(least, _)| length < *least)
        {
            best = Some((length, all));
        }
    }
    best.map(|(_, weights)| weights)
}

/// The point of the convex hull of some vectors that is nearest to zero: weight is moved between
/// the two vectors that gain most by it (Wolfe 1970; Mitchell, Demyanov & Malozemov 1974).
pub(crate) fn nearest_of_hull(vectors: &[Vec<f64>]) -> Vec<f64> {
    const MOST_MOVES: usize = 5000;
    let mut weights = vec![1.0 / vectors.len() as f64; vectors.len()];
    let mut nearest = vec![0.0; vectors[0].len()];
    let mix = |weights: &[f64], nearest: &mut Vec<f64>| {
        for (i, value) in nearest.iter_mut().enumerate() {
            *value = weights.iter().zip(vectors).map(|(w, v)| w * v[i]).sum();
        }
    };
    mix(&weights, &mut nearest);
    for _ in 0..MOST_MOVES {
        let along: Vec<f64> = vectors.iter().map(|v| dot(v, &nearest)).collect();
        let order = |a: &usize, b: &usize| along[*a].total_cmp(&along[*b]);
        let taken = (0..vectors.len()).filter(|i| weights[*i] > 0.0).max_by(order);
        let (Some(from), Some(to)) = (taken, (0..vectors.len()).min_by(order)) else { break };
        let way: Vec<f64> = vectors[to].iter().zip(&vectors[from]).map(|(a, b)| a - b).collect();
        let size = dot(&way, &way);
        let share = ((along[from] - along[to]) / size).min(weights[from]);
        if !(share > 0.0) {
            break;
        }
        weights[from] = if share == weights[from] { 0.0 } else { weights[from] - share };
        weights[to] += share;
        mix(&weights, &mut nearest);
    }
    nearest
}

/// Growth with each turn up to which turns do not lead away from a point: what grows by nothing to
/// leading order needs infinitely many turns, and so for ever, to come from zero to any distance.
const MOST_GROWTH: f64 = 1.0 + 1e-9;

/// Whether bit `i` of a field's number, the side of function i, is the positive one: as a sign.
fn side(field: usize, i: usize) -> f64 {
    if field >> i & 1 == 1 { 1.0 } else { -1.0 }
}

/// Growth of the distance with each turn around a point where two functions are zero that have
/// these rates in the four fields; none if the fields do not turn (Filippov 1988, sec. 19).
pub(crate) fn turn(rates: &[[f64; 2]; 4]) -> Option<f64> {
    let growth = |clockwise: bool| {
        (0..4).try_fold(1.0, |growth, field| {
            // In each quadrant one function comes to zero, and the other grows from it.
            let outward = |i: usize| side(field, i) * rates[field][i];
            let falls = usize::from((field == 0 || field == 3) == clockwise);
            let (inward, onward) = (-outward(falls), outward(1 - falls));
            (inward > 0.0 && onward > 0.0).then(|| growth * (onward / inward))
        })
    };
    growth(false).or_else(|| growth(true))
}

/// Positive where fields with these rates do not turn away from a point where two functions are
/// zero.
pub(crate) fn hold(rates: &[[f64; 2]; 4]) -> f64 {
    turn(rates).map_or(1.0, |growth| MOST_GROWTH - growth)
}

/// [`turn`] where function 0 has no rate in any field at the point, and its accelerations come from
/// function 1: a position and its speed.
pub(crate) fn turn_of_position(accelerations: &[f64; 4], rates: &[f64; 4]) -> Option<f64> {
    let sense = (accelerations[3] * rates[3]).signum();
    let turns = (0..4).all(|field| {
        let a = accelerations[field];
        side(field, 0) * a < 0.0 && a * rates[field] * sense > 0.0
    });
    // A flight at constant acceleration begins with the square of the speed 2 a s and ends so.
    let way = |field: usize| side(field, 0) * sense * side(field, 1);
    let square = (0..4).fold(1.0, |square, field| {
        let a = accelerations[field].abs();
        if way(field) > 0.0 { square / a } else { square * a }
    });
    turns.then(|| square.sqrt())
}

/// Whether such turns lead away.
pub(crate) fn leads_away(growth: f64) -> bool {
    growth > MOST_GROWTH
}

/// Positive where motion stays at a point at which function 0 has no rate in any field, and its
/// accelerations come from function 1, a position and its speed: no field leads away, and turns do
/// not grow.
pub(crate) fn position_hold(accelerations: &[f64; 4], rates: &[f64; 4]) -> f64 {
    let sense = (accelerations[3] * rates[3]).signum();
    if !accelerations.iter().zip(rates).all(|(a, r)| a * r * sense > 0.0) {
        return -1.0;
    }
    let largest = accelerations.iter().fold(0.0_f64, |most, a| most.max(a.abs()));
    // A field in which position and speed have the same sign must take the speed back.
    let held = (0..4)
        .filter(|field| side(*field, 0) * sense * side(*field, 1) > 0.0)
        .map(|field| -side(field, 0) * accelerations[field] / largest);
    let turns = turn_of_position(accelerations, rates).map(|growth| MOST_GROWTH - growth);
    held.chain(turns).fold(f64::INFINITY, f64::min)
}

/// Positive where s' = a + M w, with w of each function 0 on its negative and 1 on its positive
/// side, does not turn away from s = 0: the least of the groups of functions that depend on each
/// other. `a` and M are such that s' = 0 for weights between. Two functions are decided by their
/// [`turn`]; more attract if C M + M^T C is negative semidefinite for a diagonal C > 0 (then the
/// sum of c (|s| - s u), with u the signs that the weights stand for, never grows from zero).
pub(crate) fn attraction(a: &[f64], matrix: &[f64]) -> f64 {
    let k = a.len();
    let of_group = |group: &Vec<usize>| match group.as_slice() {
        [one] => -matrix[one * k + one],
        [i, j] => {
            let rate = |field: usize, row: usize| {
                let on = |bit: usize, column: usize| {
                    if field >> bit & 1 == 1 { matrix[row * k + column] } else { 0.0 }
                };
                a[row] + on(0, *i) + on(1, *j)
            };
            hold(&std::array::from_fn(|field| [rate(field, *i), rate(field, *j)]))
        }
        more => {
            let row = |i: &usize| more.iter().map(|j| matrix[i * k + j]).collect::<Vec<_>>();
            let part: Vec<f64> = more.iter().flat_map(row).collect();
            if is_diagonally_stable(&part, more.len()) { 1.0 } else { -1.0 }
        }
    };
    groups(k, |i, j| matrix[i * k + j] != 0.0).iter().map(of_group).fold(f64::INFINITY, f64::min)
}

/// Whether C M + M^T C is negative semidefinite for a diagonal matrix C > 0. C is separated from
/// all vectors that speak against the last one, one more each time.
fn is_diagonally_stable(m: &[f64], k: usize) -> bool {
    const MOST_CUTS: usize = 60;
    let mut against: Vec<Vec<f64>> =
        (0..k).map(|i| (0..k).map(|j| if i == j { 1.0 } else { 0.0 }).collect()).collect();
    // Where M has a null vector C is known: it takes that one to M^T's.
    let transposed: Vec<f64> = (0..k * k).map(|p| m[p % k * k + p / k]).collect();
    let known = null_vector(m, k).zip(null_vector(&transposed, k)).map(|(z, y)| {
        let sign = dot(&y, &z).signum();
        y.iter().zip(z).map(|(y, z)| sign * y / z).collect::<Vec<f64>>()
    });
    let mut c = known.filter(|c| c.iter().all(|c| *c > 0.0)).unwrap_or_else(|| vec![1.0; k]);
    for _ in 0..MOST_CUTS {
        let form: Vec<f64> =
            (0..k * k).map(|p| c[p / k] * m[p] + c[p % k] * m[p % k * k + p / k]).collect();
        let size = form.iter().fold(0.0_f64, |sum, v| sum + v.abs());
        let Some(all) = eigenvalues(&form, k) else { return false };
        if all.iter().all(|[value, _]| *value <= 1e-12 * size) {
            return true;
        }
        let x = top_direction(&form, k);
        let gain = |i: usize| -x[i] * (0..k).map(|j| m[i * k + j] * x[j]).sum::<f64>();
        let cut: Vec<f64> = (0..k).map(gain).collect();
        let length = cut.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        against.push(cut.iter().map(|v| v / length).collect());
        c = nearest_of_hull(&against);
        if !against.iter().all(|v| v.iter().zip(&c).map(|(v, c)| v * c).sum::<f64>() > 0.0) {
            return false;
        }
    }
    false
}

/// The direction of the largest eigenvalue of a symmetric matrix, by powers of what has none below
/// zero.
pub(crate) fn top_direction(form: &[f64], k: usize) -> Vec<f64> {
    let size = form.iter().fold(0.0_f64, |sum, v| sum + v.abs());
    let mut x: Vec<f64> = (0..k).map(|i| 1.0 + 0.1 * i as f64).collect();
    for _ in 0..400 {
        let image: Vec<f64> =
            (0..k).map(|i| size * x[i] + dot(&form[i * k..(i + 1) * k], &x)).collect();
        let length = dot(&image, &image).sqrt();
        x = image.iter().map(|v| v / length).collect();
    }
    x
}

/// Whether mixtures of 2^k fields have more than one velocity on their surfaces: the fields are not
/// sums of what each side adds.
pub(crate) fn mixtures_differ(fields: &[Vec<f64>]) -> bool {
    let n = fields[0].len();
    let size = fields.iter().flatten().fold(0.0_f64, |most, v| most.max(v.abs()));
    let added = |vertex: usize, i: usize| -> f64 {
        (0..fields.len().ilog2())
            .filter(|bit| vertex >> bit & 1 == 1)
            .map(|bit| fields[1 << bit][i] - fields[0][i])
            .sum()
    };
    (0..fields.len())
        .any(|v| (0..n).any(|i| (fields[0][i] + added(v, i) - fields[v][i]).abs() > 1e-9 * size))
}

/// Whether mixtures of fields that stay on surfaces have more than one velocity: some component of
/// the fields is no sum of a constant and multiples of the functions' rates.
pub(crate) fn velocities_differ(fields: &[Vec<f64>], rates: &[Vec<f64>]) -> bool {
    let count = fields.len();
    let most = |row: &[f64]| row.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let rest = |basis: &[Vec<f64>], mut row: Vec<f64>| {
        for _ in 0..2 {
            for b in basis {
                let share = dot(&row, b);
                row.iter_mut().zip(b).for_each(|(v, b)| *v -= share * b);
            }
        }
        row
    };
    let known = std::iter::once(vec![1.0; count])
        .chain((0..rates[0].len()).map(|r| rates.iter().map(|rate| rate[r]).collect()));
    for row in known {
        let size = most(&row);
        let new = rest(&basis, row);
        let length = dot(&new, &new).sqrt();
        if length > 1e-12 * size {
            basis.push(new.iter().map(|v| v / length).collect());
        }
    }
    (0..fields[0].len()).any(|i| {
        let row: Vec<f64> = fields.iter().map(|f| f[i]).collect();
        let size = most(&row);
        most(&rest(&basis, row)) > 1e-9 * size
    })
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Rows shorter than this part of their length are sums of others.
const NOT_NEW: f64 = 1e-9;

/// The part of a row of numbers that is new beside an orthonormal basis, and its length; none if it
/// is a sum of them to rounding.
pub(crate) fn new_part(basis: &[Vec<f64>], row: &[f64]) -> Option<(Vec<f64>, f64)> {
    let mut new = row.to_vec();
    for q in basis.iter().chain(basis) {
        let share = dot(&new, q);
        new.iter_mut().zip(q).for_each(|(v, q)| *v -= share * q);
    }
    let length = dot(&new, &new).sqrt();
    (length > NOT_NEW * dot(row, row).sqrt()).then(|| {
        new.iter_mut().for_each(|v| *v /= length);
        (new, length)
    })
}

/// The solution of a x = b near to `about` in all components, where some equations may follow from
/// others, and the number of those that do not. None if one contradicts the others. Where all but
/// one are independent in a group that depend on each other it is the one whose largest distance
/// is least, elsewhere the one of least squares.
pub(crate) fn near_solution(a: &[f64], b: &[f64], about: f64) -> Option<(Vec<f64>, usize)> {
    let k = b.len();
    let length = |v: &[f64]| dot(v, v).sqrt();
    let (mut all, mut rank) = (vec![about; k], 0);
    for group in groups(k, |i, j| a[i * k + j] != 0.0) {
        let rows: Vec<Vec<f64>> =
            group.iter().map(|i| group.iter().map(|j| a[i * k + j]).collect()).collect();
        let mut off = vec![0.0; group.len()];
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for (row, i) in rows.iter().zip(&group) {
            let missing = b[*i] - about * row.iter().sum::<f64>() - dot(row, &off);
            let size = length(row) * (about.abs() + length(&off)) + b[*i].abs();
            if let Some((new, length)) = new_part(&basis, row) {
                // Along what is new in it the equations before stay solved.
                off.iter_mut().zip(&new).for_each(|(x, q)| *x += missing / length * q);
                basis.push(new);
            } else if length(row) > 0.0 && missing.abs() > NOT_NEW * size {
                return None;
            }
        }
        rank += basis.len();
        if let Some(free) = null_vector(&rows.concat(), group.len()) {
            let moved =
                |by: f64| off.iter().zip(&free).map(|(x, z)| x + by * z).collect::<Vec<f64>>();
            let largest = |x: &[f64]| x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            // Where it is least two components are equally large.
            let pairs = (0..off.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
            let ways = pairs.flat_map(|(i, j)| {
                [1.0, -1.0].map(|sign| -(off[i] + sign * off[j]) / (free[i] + sign * free[j]))
            });
            let best = ways
                .filter(|by| by.is_finite())
                .map(moved)
                .min_by(|a, b| largest(a).total_cmp(&largest(b)));
            off = best.unwrap_or(off);
        }
        group.iter().zip(off).for_each(|(i, off)| all[*i] += off);
    }
    all.iter().all(|x| x.is_finite()).then_some((all, rank))
}

/// The vector that a matrix of `k` rows maps to zero, if there is one and no other.
pub(crate) fn null_vector(a: &[f64], k: usize) -> Option<Vec<f64>> {
    let mut basis = Vec::new();
    for row in a.chunks(k) {
        basis.extend(new_part(&basis, row).map(|(new, _)| new));
    }
    let unit = |i: usize| (0..k).map(|j| if i == j { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
    let left = (0..k).filter_map(|i| new_part(&basis, &unit(i)));
    let (longest, _) = left.max_by(|a, b| a.1.total_cmp(&b.1))?;
    (basis.len() + 1 == k).then_some(longest)
}

/// All assignments of ways to `k` functions that are consistent; `consistent` says whether one is.
pub(crate) fn possibilities(k: usize, mut consistent: impl FnMut(&[Way]) -> bool) -> Vec<Vec<Way>> {
    let ways = [Way::Plus, Way::Minus, Way::Stay];
    let mut found = Vec::new();
    for code in 0..3_usize.pow(k as u32) {
        let mut rest = code;
        let mut assignment = Vec::with_capacity(k);
        for _ in 0..k {
            assignment.push(ways[rest % 3]);
            rest /= 3;
        }
        if consistent(&assignment) {
            found.push(assignment);
        }
    }
    found
}

/// Groups of functions that depend on each other: `coupled(i, j)` says whether the side of j
/// changes the derivative of i.
pub(crate) fn groups(k: usize, coupled: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let mut group: Vec<usize> = (0..k).collect();
    for i in 0..k {
        for j in 0..i {
            if group[i] != group[j] && (coupled(i, j) || coupled(j, i)) {
                let (from, to) = (group[i].max(group[j]), group[i].min(group[j]));
                group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
            }
        }
    }
    let mut names = group.clone();
    names.sort_unstable();
    names.dedup();
    names.iter().map(|name| (0..k).filter(|i| group[*i] == *name).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::nearest_of_hull;

    #[test]
    fn the_nearest_point_of_a_hull() {
        let near = |vectors: &[[f64; 2]], want: [f64; 2]| {
            let vectors: Vec<Vec<f64>> = vectors.iter().map(|v| v.to_vec()).collect();
            let found = nearest_of_hull(&vectors);
            assert!((found[0] - want[0]).hypot(found[1] - want[1]) < 1e-10, "{found:?}");
        };
        near(&[[1.0, 0.0], [-1.0, 0.0]], [0.0, 0.0]);
        near(&[[1.0, 2.0], [-1.0, 2.0], [0.0, 7.0]], [0.0, 2.0]);
        near(&[[3.0, 1.0], [1.0, 3.0]], [2.0, 2.0]);
        near(&[[-1.0, -0.3], [-1.0, 0.9], [2.0, 0.1]], [0.0, 0.0]);
        near(&[[5.0, 0.0]], [5.0, 0.0]);
    }
}
