//! Theorem. In the reconstructed reading (alpha = 0.1, beta = 1e-5, eps = 1e-3, tanh) a closed
//! orbit of one return and another of three returns both exist, and both attract: which of them, if
//! any, a run ends on is decided by where it starts.
//!
//! Proof. As for the printed cycle, with two and with six crossings of y = 0 a turn. The points of
//! crossing are disjoint, so that the orbits are two. Dissipation is slow: 1 - det is only 2.4e-4
//! and 6.4e-4, far above the enclosures' widths.

use serde_json::json;
use twofold::rigor::cycle::Search;
use twofold::rigor::{FlowOptions, prove_cycle};
use twofold_proofs::{Equation, SECTION, cycle, print_cycle, refuse, statement, write};

fn main() {
    let equation = Equation::of("coexistence");
    println!("{}", statement("coexistence"));
    let search =
        |near, crossings| Search { plane: SECTION, near, radius: 1e-10, crossings, longest: 40.0 };
    let mut found = Vec::new();
    for (name, near, crossings) in
        [("period one", [0.8063, 0.0], 2), ("period three", [1.2073, 0.0003], 6)]
    {
        println!("{name}:");
        let c = prove_cycle(&equation.tape(), FlowOptions::PLAIN, &search(near, crossings))
            .unwrap_or_else(|e| refuse(&e.to_string()));
        print_cycle(&c);
        if !c.attracts() {
            refuse("the enclosures of trace and determinant do not show that the orbit attracts");
        }
        found.push(c);
    }
    let [one, three] = &found[..] else { refuse("an orbit is missing") };
    // Different orbits, and the second one does close only after three returns: its upward
    // crossings are pairwise disjoint.
    let upward = |c: &twofold::rigor::Cycle| -> Vec<_> {
        c.crossings.iter().filter(|x| x.2).map(|x| x.1).collect()
    };
    let points: Vec<_> = upward(one).into_iter().chain(upward(three)).collect();
    for (i, a) in points.iter().enumerate() {
        for b in &points[i + 1..] {
            if a[0].intersection(b[0]).is_ok() && a[1].intersection(b[1]).is_ok() {
                refuse("two crossings may be the same");
            }
        }
    }
    println!("PROVED: both exist and attract.");
    write(
        "coexistence",
        json!({ "period one": cycle(one, &equation), "period three": cycle(three, &equation) }),
    );
}
