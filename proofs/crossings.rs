//! Theorem. The orbit from (0.2, 0, -1) crosses y = 0 where the reference tables say, in both
//! readings: through the singularity, 24 rows of the printed reading and all 61 of the
//! reconstructed one.
//!
//! Proof. Validated Taylor steps with centres in double-double arithmetic (crates/rigor/src), from
//! crossing to crossing. No crossing is missed: while a step's box meets y = 0, the flow crosses it
//! in one direction on all of the box. Each row of the tables, which were computed outside this
//! project in 113-bit arithmetic, lies in the enclosure, up to the uncertainty that the row claims
//! and its own printed digits.

use std::fs;

use nalgebra::SVector;
use serde_json::{Value, json};
use twofold::num::{Arithmetic, Ball, Enclosure, FromDecimal, Interval};
use twofold::rigor::{Flow, FlowOptions, Set};
use twofold_proofs::{Equation, SECTION, ball, refuse, statement, write};

/// Where the paper's folder keeps the tables.
const TABLES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../papers/jeffrey-2013/reference");

/// Proves a table: (what was printed, the certificate's rows).
fn table(name: &str, equation: Equation, n_rows: usize) -> Result<(String, Vec<Value>), String> {
    let path = format!("{TABLES}/crossings-{name}.csv");
    let text = fs::read_to_string(&path).map_err(|e| format!("{path}: {e}"))?;
    let mut flow = Flow::<Ball, 3>::new(&equation.tape(), FlowOptions::EXTENDED);
    let start = SVector::from([Ball::from_decimal(&0.2.into()), Ball::zero(), -Ball::one()]);
    let mut set = Set::on_plane(start, SECTION.axis, SECTION.value, false);
    let (mut report, mut rows) = (String::new(), Vec::new());
    let lines = text.lines().filter(|l| !l.starts_with('#') && !l.starts_with("t,")).take(n_rows);
    for (n, line) in lines.enumerate() {
        let at = |e: &dyn std::fmt::Display| format!("{name}, row {}: {e}", n + 1);
        let fields: Vec<&str> = line.split(',').collect();
        let [t, x, z, direction, uncertainty] = fields[..] else { return Err(at(&"not a row")) };
        let crossing = flow.next_crossing(&set, SECTION, 1000.0).map_err(|e| at(&e))?;
        set = crossing.set;
        if crossing.upward != (direction == "up") {
            return Err(at(&"the other direction"));
        }
        let states = set.states();
        let mut widest: f64 = 0.0;
        for (name, got, want) in [("t", crossing.time, t), ("x", states[0], x), ("z", states[2], z)]
        {
            let want: f64 = want.parse().map_err(|e| at(&e))?;
            let claimed: f64 = uncertainty.parse().map_err(|e| at(&e))?;
            // The row's last digit is rounded: a unit in the last place of an f64 is more than
            // that.
            let slack = Interval::symmetric(claimed + 2.0 * f64::EPSILON * want.abs());
            let got = got.interval();
            if !(got + slack).contains(want) {
                return Err(at(&format!("{name} = {want:e} is not in {got:?}")));
            }
            widest = widest.max(got.width());
        }
        let radius = states[0].radius().max(states[2].radius());
        report += &format!(
            "  {:3}  x = {x:>24}  z = {z:>24}  {direction:4}  radius {radius:.1e}\n",
            n + 1
        );
        rows.push(json!({
            "time": ball(crossing.time), "x": ball(states[0]), "z": ball(states[2]),
                "upward": crossing.upward,
        }));
    }
    if rows.len() < n_rows {
        return Err(format!("{path} has {} rows, the theorem {n_rows}", rows.len()));
    }
    Ok((report, rows))
}

fn main() {
    println!("{}", statement("crossings"));
    let tables = Equation::of_tables("crossings");
    // Independent jobs, collected in order.
    let proved: Vec<_> = std::thread::scope(|s| {
        let prove = |(name, equation, rows): &(String, Equation, usize)| {
            let (name, equation, rows) = (name.clone(), *equation, *rows);
            s.spawn(move || table(&name, equation, rows))
        };
        let jobs: Vec<_> = tables.iter().map(prove).collect();
        jobs.into_iter().map(|job| job.join()).collect()
    });
    let mut data = serde_json::Map::new();
    for ((name, equation, _), result) in tables.iter().zip(proved) {
        match result {
            Ok(Ok((report, rows))) => {
                print!("{name} reading:\n{report}");
                let equation = equation.parameters();
                data.insert(name.clone(), json!({ "equation": equation, "crossings": rows }));
            }
            Ok(Err(e)) => refuse(&e),
            Err(_) => refuse("the computation stopped"),
        }
    }
    println!("PROVED: every row of both tables lies in its enclosure.");
    write("crossings", Value::Object(data));
}
