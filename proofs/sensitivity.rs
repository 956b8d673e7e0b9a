//! Theorem. In the reconstructed reading (alpha = 0.1, eps = 1e-3) two states at the singularity,
//! less than 1e-12 apart, leave more than 0.3 apart: the first exit crossings of y = 0 lie 0.17
//! apart, the second more than 0.3, the third more than 0.8.
//!
//! The first state is, to its digits, where the orbit of the figures (from (0.2, 0, -1)) first
//! passes the singularity. How much a disturbance there grows until the first exit crossing is
//! enclosed, too: the derivative's largest element is 7.67e12.
//!
//! Proof. Validated Taylor steps with centres in double-double arithmetic (crates/rigor/src). In
//! f64 intervals, 1e-16 times the growth would leave nothing.

use nalgebra::SVector;
use serde_json::{Value, json};
use twofold::num::{Arithmetic, Ball, Elementary, Enclosure, FromDecimal};
use twofold::rigor::{Flow, FlowOptions, Set};
use twofold_proofs::{Equation, SECTION, ball, bounds, digits, refuse, statement, write};

const Z: f64 = 8.14695211321934e-14;
const STATES: [f64; 2] = [4.99176529062235e-5, 4.99176538962235e-5];
const CROSSINGS: usize = 3;

fn main() {
    let equation = Equation::of("sensitivity");
    println!("{}", statement("sensitivity"));
    println!("  states: (x, 0, z) with z = {Z:e} and x = {:e} or {:e}", STATES[0], STATES[1]);
    let decimal = |x: f64| Ball::from_decimal(&x.into());
    let apart = (decimal(STATES[1]) - decimal(STATES[0])).interval();
    if apart.upper() >= 1e-12 {
        refuse("the states are not less than 1e-12 apart");
    }
    let mut orbits = Vec::new();
    for (i, x) in STATES.into_iter().enumerate() {
        let mut flow = Flow::<Ball, 3>::new(&equation.tape(), FlowOptions::EXTENDED);
        let start = SVector::from([decimal(x), Ball::zero(), decimal(Z)]);
        let mut set = Set::on_plane(start, SECTION.axis, SECTION.value, i == 0);
        let mut points = Vec::new();
        for _ in 0..CROSSINGS {
            let crossing = flow
                .next_crossing(&set, SECTION, 10.0)
                .unwrap_or_else(|e| refuse(&format!("state {i}: {e}")));
            set = crossing.set;
            points.push((crossing.time, set.states(), crossing.upward, set.derivative()));
        }
        orbits.push(points);
    }
    let mut rows: Vec<Value> = Vec::new();
    let mut second = 0.0;
    for (k, (a, b)) in orbits[0].iter().zip(&orbits[1]).enumerate() {
        let (dx, dz) = (a.1[0] - b.1[0], a.1[2] - b.1[2]);
        let distance = (dx * dx + dz * dz).sqrt().interval();
        println!("  crossing {}:", k + 1);
        for orbit in [a, b] {
            println!(
                "    x = {}, z = {}",
                digits(orbit.1[0].interval()),
                digits(orbit.1[2].interval())
            );
        }
        println!("    apart by {}", digits(distance));
        if a.2 != b.2 {
            refuse("the orbits cross in different directions");
        }
        if k == 1 {
            second = distance.lower();
        }
        let orbit = |o: &(Ball, SVector<Ball, 3>, bool, Option<_>)| {
            json!({ "time": ball(o.0),
            "x": ball(o.1[0]), "z": ball(o.1[2]) })
        };
        rows.push(
            json!({ "upward": a.2, "orbits": [orbit(a), orbit(b)], "distance": bounds(distance) }),
        );
    }
    if second <= 0.3 {
        refuse("the orbits are not shown to be 0.3 apart");
    }
    let Some(d) = orbits[0][0].3 else { refuse("no derivative") };
    println!(
        "  derivative of the first exit crossing (x, z) by the state (x, z) at the singularity:"
    );
    let mut derivative: Vec<Value> = Vec::new();
    for i in [0, 2] {
        println!("    {:?}  {:?}", d[(i, 0)], d[(i, 2)]);
        derivative.push(json!([bounds(d[(i, 0)]), bounds(d[(i, 2)])]));
    }
    println!("PROVED: less than 1e-12 becomes more than 0.3.");
    let data = json!({
        "equation": equation.parameters(),
        "states": { "x": STATES.map(|x| format!("{x:e}")), "y": "0", "z": format!("{Z:e}") },
        "crossings": rows, "growth_until_first_crossing": derivative,
    });
    write("sensitivity", data);
}
