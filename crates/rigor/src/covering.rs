//! Covering relations: proofs of chaos.
//!
//! An h-set is a parallelogram in a plane of section with a direction to be stretched and one to be
//! squeezed, c + u U + v V with u and v in [-1, 1]. It *covers* another under a map if the image of
//! its two edges u = -1 and u = 1 lies on either side of the other, beyond *its* edges u = -1 and u
//! = 1, and the image of all of it keeps away from the other's edges v = -1 and v = 1 (Zgliczynski
//! & Gidea 2004, Definitions 1 and 2, for one direction of stretching). If in a chain or loop of
//! sets each covers the next one, there is an orbit that visits them in this order, and for a loop
//! a periodic one (their Theorem 4): two sets that both cover both make a horseshoe.
//!
//! The map is the return to the plane by a flow. The set is cut across the direction of stretching
//! into pieces small enough for each image to be decided; the image of a piece is enclosed in the
//! other set's own coordinates (u, v), so that an image much longer than wide is seen as what it
//! is.

use nalgebra::{SMatrix, SVector};

use super::Error;
use super::flow::{Flow, FlowOptions};
use super::linear::{IMatrix, IVector};
use super::section::AxisPlane;
use super::set::Set;
use twofold_num::{Arithmetic, Enclosure, Interval, Tape};

/// A parallelogram in a plane of section: { centre + u unstable + v stable : u, v in [-1, 1] }, in
/// the plane's two coordinates, in the order of the states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HSet {
    /// Its middle.
    pub centre: [f64; 2],
    /// Half of it, along the direction in which the map stretches.
    pub unstable: [f64; 2],
    /// Half of it, across.
    pub stable: [f64; 2],
}

/// A return map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Return {
    /// The plane.
    pub plane: AxisPlane,
    /// The direction in which the plane is crossed at the start and at the end.
    pub upward: bool,
    /// Number of crossings in a return, in both directions: an even number.
    pub crossings: usize,
    /// Upper bound on the duration of a return.
    pub longest: f64,
}

/// The enclosure of the image of a part of an h-set.
#[derive(Clone, Debug)]
pub struct Image {
    /// The part: this range of u, and all v.
    pub part: [f64; 2],
    /// Its image in the coordinates (u, v) of each set that is to be covered.
    pub seen: Vec<[Interval; 2]>,
    /// The hulls of all crossings on the way, in the plane's coordinates; the last is the image.
    pub crossings: Vec<[Interval; 2]>,
}

/// The proof that a set covers others.
#[derive(Clone, Debug)]
pub struct Covering {
    /// The images of its pieces: their ranges of u follow on each other from -1 to 1.
    pub pieces: Vec<Image>,
    /// The images of its edges u = -1 and u = 1.
    pub edges: [Image; 2],
}

/// Narrower pieces are not tried.
const NARROWEST: f64 = 1.0 / 16384.0;

fn others(axis: usize) -> [usize; 2] {
    match axis {
        0 => [1, 2],
        1 => [0, 2],
        _ => [0, 1],
    }
}

impl HSet {
    /// Its part with u in `part`, in the plane.
    fn part<S: Enclosure>(&self, plane: AxisPlane, part: [f64; 2]) -> Set<S, 3> {
        let [p, q] = others(plane.axis);
        let middle = (0.5 * part[0] + 0.5 * part[1]).clamp(part[0], part[1]);
        let mut centre = SVector::<S, 3>::from_element(S::from_f64(plane.value));
        let mut stretch = SMatrix::<f64, 3, 3>::identity();
        for (i, k) in [p, q].into_iter().enumerate() {
            centre[k] =
                S::from_f64(self.centre[i]) + S::from_f64(self.unstable[i]) * S::from_f64(middle);
            (stretch[(k, p)], stretch[(k, q)]) = (self.unstable[i], self.stable[i]);
        }
        let mut weights = IVector::<3>::from_element(Interval::zero());
        weights[p] = Interval::between(part[0], part[1]) - Interval::from_f64(middle);
        weights[q] = Interval::symmetric(1.0);
        Set::parallelepiped(centre, stretch, weights, (plane.axis, plane.value))
    }

    /// A set in the plane, in the coordinates (u, v).
    fn see<S: Enclosure>(&self, plane: AxisPlane, set: &Set<S, 3>) -> Result<[Interval; 2], Error> {
        let [p, q] = others(plane.axis);
        let [[a, c], [b, d]] =
            [self.unstable.map(Interval::from_f64), self.stable.map(Interval::from_f64)];
        let determinant = a * d - b * c;
        if determinant.contains(0.0) {
            return Err(Error::Singular);
        }
        let mut inverse = IMatrix::<3>::from_element(Interval::zero());
        (inverse[(p, p)], inverse[(p, q)]) = (d / determinant, -b / determinant);
        (inverse[(q, p)], inverse[(q, q)]) = (-c / determinant, a / determinant);
        let mut origin = SVector::<f64, 3>::from_element(plane.value);
        (origin[p], origin[q]) = (self.centre[0], self.centre[1]);
        let seen = set.seen(&origin, &inverse);
        Ok([seen[p], seen[q]])
    }
}

/// Beyond one of the edges u = -1, u = 1, or away from the edges v = -1, v = 1: it does not meet
/// the latter.
fn keeps_away([u, v]: [Interval; 2]) -> bool {
    beyond([u, v]).is_some() || v.magnitude() < 1.0
}

/// On which side of the set: beyond u = -1 (false) or u = 1 (true).
fn beyond([u, _]: [Interval; 2]) -> Option<bool> {
    if u.upper() < -1.0 {
        Some(false)
    } else if u.lower() > 1.0 {
        Some(true)
    } else {
        None
    }
}

/// Proves that `from` covers each of `to` under the return map of x' = f(x). `S` is the arithmetic
/// of the sets' centres.
///
/// # Errors
/// See [`Error`]; [`Error::NotCovered`] if an edge's image is not beyond a set's edge, or a piece's
/// image meets where it should not, however narrow.
pub fn prove_covering<S: Enclosure>(
    tape: &Tape,
    settings: FlowOptions,
    map: &Return,
    from: &HSet,
    to: &[HSet],
) -> Result<Covering, Error> {
    let mut flow = Flow::<S, 3>::new(tape, settings);
    let [p, q] = others(map.plane.axis);
    let mut image = |part: [f64; 2]| -> Result<Image, Error> {
        let mut set = from.part::<S>(map.plane, part);
        let mut crossings = Vec::new();
        for n in 0..map.crossings {
            let crossing = flow.next_crossing(&set, map.plane, map.longest)?;
            // Directions alternate; the last is that of the start.
            let last = n + 1 == map.crossings;
            if crossing.upward != (map.upward == (n % 2 == 1))
                || last && crossing.upward != map.upward
            {
                return Err(Error::WrongDirection(crossing.time.interval().midpoint()));
            }
            set = crossing.set;
            let hull = set.hull();
            crossings.push([hull[p], hull[q]]);
        }
        let seen = to.iter().map(|t| t.see(map.plane, &set)).collect::<Result<_, _>>()?;
        Ok(Image { part, seen, crossings })
    };
    let not_covered = |image: &Image, set: usize| Error::NotCovered {
        part: image.part,
        set,
        seen: image.seen[set],
    };
    let edges = [image([-1.0, -1.0])?, image([1.0, 1.0])?];
    for set in 0..to.len() {
        match edges.each_ref().map(|e| beyond(e.seen[set])) {
            [Some(a), Some(b)] if a != b => {}
            [None, _] => return Err(not_covered(&edges[0], set)),
            _ => return Err(not_covered(&edges[1], set)),
        }
    }
    let mut pieces: Vec<Image> = Vec::new();
    // Parts still to be decided, the leftmost last.
    let mut waiting = vec![[-1.0, 1.0]];
    while let Some(part) = waiting.pop() {
        let failed = match image(part) {
            Ok(found) => match (0..to.len()).find(|set| !keeps_away(found.seen[*set])) {
                None => {
                    pieces.push(found);
                    continue;
                }
                Some(set) => not_covered(&found, set),
            },
            Err(e) => e,
        };
        if part[1] - part[0] <= NARROWEST {
            return Err(failed);
        }
        // Both halves end in the same number, exactly: they leave no gap.
        let middle = 0.5 * part[0] + 0.5 * part[1];
        waiting.extend([[middle, part[1]], [part[0], middle]]);
    }
    Ok(Covering { pieces, edges })
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_num::tape::Recorded;

    /// r' = c r (r^2 - 4), z' = -z/5, turning once in 2 pi: the circle r = 2 multiplies its
    /// neighbours' distance by exp(16 pi c) a turn.
    fn circle(c: f64) -> Tape {
        Tape::record(3, move |s: &[Recorded]| {
            let growth =
                (s[0] * s[0] + s[1] * s[1] - Recorded::from_f64(4.0)) * Recorded::from_f64(c);
            vec![s[0] * growth - s[1], s[1] * growth + s[0], -s[2] * Recorded::from_f64(0.2)]
        })
    }

    const MAP: Return = Return {
        plane: AxisPlane { axis: 1, value: 0.0 },
        upward: true,
        crossings: 2,
        longest: 20.0,
    };

    #[test]
    fn an_unstable_circle_covers_itself() {
        let set = HSet { centre: [2.0, 0.0], unstable: [0.1, 0.02], stable: [0.0, 0.1] };
        let found =
            prove_covering::<Interval>(&circle(0.02), FlowOptions::PLAIN, &MAP, &set, &[set])
                .unwrap();
        assert_eq!((found.pieces[0].part[0], found.pieces.last().unwrap().part[1]), (-1.0, 1.0));
        assert!(found.pieces.windows(2).all(|w| w[0].part[1] == w[1].part[0]));
        // The edge u = 1 has r = 2.1 exactly; 1/r^2 - 1/4 is multiplied by exp(16 pi c).
        let factor = (16.0 * std::f64::consts::PI * 0.02_f64).exp();
        let r = |r: f64| 1.0 / (0.25 + (1.0 / (r * r) - 0.25) * factor).sqrt();
        let u = found.edges[1].seen[0][0];
        assert!(u.contains((r(2.1) - 2.0) / 0.1) && u.width() < 1e-3, "{u:?}");
        // All of the set shrinks across: v = z/0.1 - 0.2 u, and z is multiplied by exp(-0.4 pi).
        assert!(found.pieces.iter().all(|p| p.seen[0][1].magnitude() < 1.0));
    }

    #[test]
    fn what_does_not_stretch_or_squeeze_covers_nothing() {
        let set = HSet { centre: [2.0, 0.0], unstable: [0.1, 0.0], stable: [0.0, 0.1] };
        let fails = |c: f64, to: HSet| {
            prove_covering::<Interval>(&circle(c), FlowOptions::PLAIN, &MAP, &set, &[to])
                .unwrap_err()
        };
        assert!(matches!(fails(-0.02, set), Error::NotCovered { part: [-1.0, -1.0], set: 0, .. }));
        // Too high to be reached, too low to hold the image, beside it.
        assert!(matches!(
            fails(0.02, HSet { centre: [2.0, 0.1], ..set }),
            Error::NotCovered { .. }
        ));
        assert!(matches!(
            fails(0.02, HSet { stable: [0.0, 0.02], ..set }),
            Error::NotCovered { .. }
        ));
        assert!(matches!(
            fails(0.02, HSet { centre: [2.3, 0.0], ..set }),
            Error::NotCovered { part: [1.0, 1.0], .. }
        ));
        // No area.
        assert_eq!(fails(0.02, HSet { stable: [0.2, 0.0], ..set }), Error::Singular);
        // An odd number of crossings is no return.
        let half = Return { crossings: 1, ..MAP };
        let odd =
            prove_covering::<Interval>(&circle(0.02), FlowOptions::PLAIN, &half, &set, &[set]);
        assert!(matches!(odd, Err(Error::WrongDirection(_))));
    }
}
