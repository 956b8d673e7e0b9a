//! Theorem. In the reconstructed reading (alpha = 0.1, beta = 1e-5, eps = 1e-3, tanh) there are
//! saddle orbits beside the two that attract: of three returns, of four (two different ones) and of
//! five. Their stable manifolds are walls between fates: near them the smallest difference decides.
//!
//! Proof. As for the attracting orbits (`coexistence.rs`). The characteristic polynomial of the
//! return map's derivative has different signs at 1 and -1, so that one multiplier lies inside the
//! unit circle and the other outside.
//!
//! The orbits were found by Newton's method from random starts, which is no part of the proof.

use serde_json::{Map, Value};
use twofold::num::{Arithmetic, Elementary, Interval};
use twofold::rigor::cycle::Search;
use twofold::rigor::{Cycle, FlowOptions, prove_cycle};
use twofold_proofs::{Equation, SECTION, cycle, digits, print_cycle, refuse, statement, write};

/// Names, places near the orbits on y = 0, crossings a turn.
const ORBITS: [(&str, [f64; 2], usize); 4] = [
    ("period three", [0.431074765585, 0.000125827002], 6),
    ("period four, inverting", [1.349340201438, 0.000383735084], 8),
    ("period four", [0.927916826838, -0.538923243772], 8),
    ("period five", [0.085684607739, -0.277512885932], 10),
];

fn upward(c: &Cycle) -> impl Iterator<Item = [Interval; 2]> {
    c.crossings.iter().filter(|x| x.2).map(|x| x.1)
}

fn main() {
    let equation = Equation::of("saddles");
    println!("{}", statement("saddles"));
    let mut points: Vec<[Interval; 2]> = Vec::new();
    let mut data = Map::<String, Value>::new();
    for (name, near, crossings) in ORBITS {
        println!("{name}:");
        let search = Search { plane: SECTION, near, radius: 1e-10, crossings, longest: 40.0 };
        let c = prove_cycle(&equation.tape(), FlowOptions::PLAIN, &search)
            .unwrap_or_else(|e| refuse(&e.to_string()));
        print_cycle(&c);
        if !c.is_saddle() {
            refuse("the enclosures of trace and determinant do not show a saddle");
        }
        // Outside: the zero with the sign of the trace.
        let (half, four) = (Interval::from_f64(0.5), Interval::from_f64(4.0));
        let root = (c.trace * c.trace - four * c.determinant).sqrt();
        let outside = half * if c.trace.is_positive() { c.trace + root } else { c.trace - root };
        println!("  multipliers  {} and {}", digits(outside), digits(c.determinant / outside));
        // Each needs all of its returns, and all orbits are different.
        for point in upward(&c) {
            if points
                .iter()
                .any(|p| p[0].intersection(point[0]).is_ok() && p[1].intersection(point[1]).is_ok())
            {
                refuse("two crossings may be the same");
            }
            points.push(point);
        }
        data.insert(name.into(), cycle(&c, &equation));
    }
    println!("PROVED: all four exist and are saddles.");
    write("saddles", Value::Object(data));
}
