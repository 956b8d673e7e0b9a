//! Theorem. In the printed reading (alpha = 1e-3, beta = 1e-5, eps = 1e-3, tanh) the smoothed
//! caricature has an attracting periodic orbit. It crosses y = 0 upwards once a turn, in a box of
//! width below 1e-8; its period is known to ten digits.
//!
//! Proof. Krawczyk's inclusion for the return map to y = 0, with validated Taylor steps
//! (crates/rigor/src); both multipliers lie in the unit disc because 1 - det > 0 and 1 + det +-
//! trace > 0.

use twofold::rigor::cycle::Search;
use twofold::rigor::{FlowOptions, prove_cycle};
use twofold_proofs::{Equation, SECTION, cycle, print_cycle, refuse, statement, write};

fn main() {
    let equation = Equation::of("printed-cycle");
    let search = Search {
        plane: SECTION,
        near: [17.057344142481766, -0.015417177803876677],
        radius: 4e-9,
        crossings: 2,
        longest: 40.0,
    };
    println!("{}", statement("printed-cycle"));
    let found = prove_cycle(&equation.tape(), FlowOptions::PLAIN, &search)
        .unwrap_or_else(|e| refuse(&e.to_string()));
    print_cycle(&found);
    if !found.attracts() {
        refuse("the enclosures of trace and determinant do not show that the orbit attracts");
    }
    if found.period.width() > 1e-9 || found.candidate.iter().any(|x| x.width() >= 1e-8) {
        refuse("the enclosures are wider than the statement says");
    }
    println!("PROVED: it exists, is unique there, and attracts.");
    write("printed-cycle", cycle(&found, &equation));
}
