//! Theorem. In the reconstructed reading (alpha = 0.1, beta = 1e-5, eps = 1e-3, tanh) the return
//! map of orbits that pass the two-fold singularity has a horseshoe: chaos there is the equation's
//! and no artefact of a solver. (Whether orbits of the figures follow it is not part of the
//! statement.)
//!
//! Orbits leave the singularity along a curve in the section y = 0, and each place of it goes back
//! to the singularity. From exit to next exit (every fourth downward crossing of y = 0) the curve
//! is mapped nearly like an interval. A saddle orbit, "hub", leaves at x = -0.1523 and -0.1137 in
//! turn; its multiplier is -67.2. What starts 5.8e-15 beside it on its unstable manifold is off to
//! x = -0.0980 after thirteen returns, and from there comes back onto its stable manifold: a
//! homoclinic orbit, and with it a horseshoe (Smale 1967).
//!
//! Proof. Covering relations (Zgliczynski & Gidea 2004) between small parallelograms along the
//! saddle orbit and along the homoclinic one, with validated Taylor steps (crates/rigor/src) whose
//! centres are in double-double arithmetic. They make two loops, of 2 and of 14 sets, that have the
//! hub in common. A chain that runs through them in any order is followed by an orbit; where it can
//! choose, the next set is one of two that are disjoint. So chains of n sets, of which there are
//! about lambda^n with lambda^-2 + lambda^-14 = 1, are told apart by orbits, and lambda > 1.12.
//!
//! The parallelograms are placed by following plain points, which is no part of the proof: the
//! coverings' statements about them are.

use nalgebra::SVector;
use serde_json::{Value, json};
use twofold::num::{Arithmetic, Ball, Enclosure, Interval, elementary};
use twofold::rigor::covering::Image;
use twofold::rigor::{Covering, Flow, FlowOptions, HSet, Return, Set, prove_covering};
use twofold_proofs::{Equation, SECTION, bounds, refuse, statement, write};

/// The saddle orbit at the hub, in two parts each (double-double).
const HUB: [[f64; 2]; 2] = [
    [-0.15231549483258058, -1.2462355425244966e-17],
    [-0.4540927536719651, -9.622314832703039e-18],
];
/// The direction of its unstable manifold there.
const UNSTABLE: [f64; 2] = [-0.650591069181416, -0.7594282459201673];
/// Distance from the hub, along it, at which the homoclinic orbit begins.
const OFFSET: f64 = 5.8051217418726e-15;
/// Returns from there until it is back at the hub.
const RETURNS: usize = 14;
/// Half the hub's length.
const HUB_SIZE: f64 = 1e-14;
/// Half the length of the saddle orbit's other set.
const OTHER_SIZE: f64 = 3e-14;
/// No set is shorter: its corners are f64 numbers.
const SHORTEST: f64 = 3e-15;
/// The image of a set is this much longer than the next set needs.
const MARGIN: f64 = 1.6;
/// Half the width of all sets: images are thinner still, but corners are f64 numbers.
const WIDTH: f64 = 3e-16;
const MAP: Return = Return { plane: SECTION, upward: false, crossings: 8, longest: 40.0 };

type Point = [Ball; 2];

/// A plain point's image and the derivative there: middles of what the validated steps give.
fn follow(flow: &mut Flow<Ball, 3>, [x, z]: Point) -> (Point, [[f64; 2]; 2]) {
    let mut set =
        Set::on_plane(SVector::from([x, Ball::zero(), z]), SECTION.axis, SECTION.value, true);
    for _ in 0..MAP.crossings {
        set = flow
            .next_crossing(&set, SECTION, MAP.longest)
            .unwrap_or_else(|e| refuse(&format!("a plain point: {e}")))
            .set;
    }
    let d = set.derivative().unwrap_or_else(|| refuse("no derivative"));
    let at = |i: usize, j: usize| d[(i, j)].midpoint();
    ([set.centre()[0], set.centre()[2]], [[at(0, 0), at(0, 2)], [at(2, 0), at(2, 2)]])
}

/// Intended places of sets: their middles, their directions, the factors by which the map stretches
/// them.
struct Place {
    centre: [f64; 2],
    along: [f64; 2],
    stretch: f64,
}

/// The places of the sets along the orbit of a point.
fn places(flow: &mut Flow<Ball, 3>, mut at: Point, returns: usize) -> Vec<Place> {
    let mut along = UNSTABLE;
    let mut found = Vec::new();
    for _ in 0..returns {
        let centre = at.map(|x| x.interval().midpoint());
        let (next, d) = follow(flow, at);
        let image = d.map(|row| row[0] * along[0] + row[1] * along[1]);
        let stretch = (image[0] * image[0] + image[1] * image[1]).sqrt();
        found.push(Place { centre, along, stretch });
        (at, along) = (next, image.map(|x| x / stretch));
    }
    found
}

fn hset(place: &Place, size: f64) -> HSet {
    let [a, b] = place.along;
    HSet { centre: place.centre, unstable: [a * size, b * size], stable: [-b * WIDTH, a * WIDTH] }
}

fn piece(image: &Image) -> Value {
    let seen: Vec<Value> =
        image.seen.iter().map(|[u, v]| json!([bounds(*u), bounds(*v)])).collect();
    json!({ "part": image.part, "seen": seen })
}

fn main() {
    let equation = Equation::of("horseshoe");
    println!("{}", statement("horseshoe"));
    let tape = equation.tape();
    let mut flow = Flow::<Ball, 3>::new(&tape, FlowOptions::EXTENDED);
    let hub = HUB.map(|[high, low]| Ball::from_f64(high) + Ball::from_f64(low));
    let beside = [0, 1].map(|i| hub[i] + Ball::from_f64(UNSTABLE[i]) * Ball::from_f64(OFFSET));
    let saddle = places(&mut flow, hub, 2);
    let orbit = places(&mut flow, beside, RETURNS);
    // Sets: the hub, the saddle orbit's other one, then those of the homoclinic orbit from its
    // first return on.
    let mut sizes = [HUB_SIZE; RETURNS + 1];
    for i in (1..RETURNS).rev() {
        sizes[i] = (MARGIN * sizes[i + 1] / orbit[i].stretch).max(SHORTEST);
    }
    let mut sets = vec![hset(&saddle[0], HUB_SIZE), hset(&saddle[1], OTHER_SIZE)];
    sets.extend((1..RETURNS).map(|i| hset(&orbit[i], sizes[i])));
    // The two ways of a chain that can choose are told apart: the sets' extents in x do not meet.
    let extent = |s: &HSet| {
        let reach = Interval::between(-1.0, 1.0)
            * (Interval::from_f64(s.unstable[0].abs()) + Interval::from_f64(s.stable[0].abs()));
        Interval::from_f64(s.centre[0]) + reach
    };
    if extent(&sets[1]).intersection(extent(&sets[2])).is_ok() {
        refuse("the two sets that follow the first are not shown to be disjoint");
    }
    let follows = |i: usize| match i {
        0 => vec![1, 2],
        i if i == 1 || i == RETURNS => vec![0],
        i => vec![i + 1],
    };

    let mut coverings: Vec<Value> = Vec::new();
    for (i, set) in sets.iter().enumerate() {
        let next = follows(i);
        let targets: Vec<HSet> = next.iter().map(|t| sets[*t]).collect();
        let Covering { pieces, edges } =
            prove_covering::<Ball>(&tape, FlowOptions::EXTENDED, &MAP, set, &targets)
                .unwrap_or_else(|e| refuse(&format!("set {i} to {next:?}: {e}")));
        let ends: Vec<String> = (0..next.len())
            .map(|k| {
                let [a, b] = edges.each_ref().map(|e| e.seen[k][0].midpoint());
                format!("set {} from u = {a:.2} to {b:.2}", next[k])
            })
            .collect();
        println!(
            "  set {i:>2} at x = {:+.9}, half {:.1e} long, covers {} ({} pieces)",
            set.centre[0],
            elementary::sqrt(set.unstable[0] * set.unstable[0] + set.unstable[1] * set.unstable[1]),
            ends.join(" and "),
            pieces.len()
        );
        // At which crossing of each return the orbits pass the singularity, and how near.
        let mut all = pieces.iter().chain(&edges);
        let first = all.next().unwrap_or_else(|| refuse("no pieces"));
        let size = |c: &[Interval; 2]| c[0].magnitude().max(c[1].magnitude());
        let nearest = (0..MAP.crossings)
            .min_by(|a, b| size(&first.crossings[*a]).total_cmp(&size(&first.crossings[*b])))
            .unwrap_or(0);
        let [x, z] = all.fold(first.crossings[nearest], |[x, z], p| {
            let c = p.crossings[nearest];
            [x.hull(c[0]), z.hull(c[1])]
        });
        if x.magnitude() >= 1e-4 || z.magnitude() >= 1e-4 {
            refuse(&format!("set {i}: the orbits are not shown to pass the singularity"));
        }
        coverings.push(json!({
            "from": i, "to": next, "ends": edges.iter().map(piece).collect::<Vec<_>>(),
                "pieces": pieces.iter().map(piece).collect::<Vec<_>>(),
            "passage": { "crossing": nearest + 1, "x": bounds(x), "z": bounds(z) },
        }));
    }
    println!("PROVED: a horseshoe, with loops of 2 and {RETURNS} returns.");
    let sets: Vec<Value> = sets
        .iter()
        .map(|s| json!({ "centre": s.centre, "unstable": s.unstable, "stable": s.stable }))
        .collect();
    write(
        "horseshoe",
        json!({ "equation": equation.parameters(), "sets": sets, "coverings": coverings }),
    );
}
