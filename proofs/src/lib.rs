//! Code that the proofs share: the equation, the printing of intervals, and certificates.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};
use twofold::num::{Ball, Interval, Tape};
use twofold::rigor::{AxisPlane, Cycle};
use twofold::system::{Caricature, Smoothed, Transition, VectorField};

/// y = 0, on which all statements are made.
pub const SECTION: AxisPlane = AxisPlane { axis: 1, value: 0.0 };

/// beta of both readings.
pub const BETA: f64 = 1e-5;
/// eps of both readings.
pub const EPS: f64 = 1e-3;

/// The smoothed caricature (eqs. 5, 8 and 9 of the paper) with beta = 1e-5, eps = 1e-3, v+ = -1.2,
/// v- = -1.4, all of them the decimal numbers that are written here.
pub fn equation(alpha: f64) -> Arc<Tape> {
    Smoothed {
        system: Caricature::with_reinjection(alpha, BETA),
        transition: Transition::Tanh,
        eps: EPS,
    }
    .tape()
}

/// A number's enclosure, for people: its common digits, and its width.
pub fn digits(x: Interval) -> String {
    if x.width() == 0.0 {
        return format!("{:?}", x.lower());
    }
    let (a, b) = (format!("{:.17}", x.lower()), format!("{:.17}", x.upper()));
    let common: String =
        a.chars().zip(b.chars()).take_while(|(a, b)| a == b).map(|(a, _)| a).collect();
    format!("{common}... (width {:.1e})", x.width())
}

/// An interval in a certificate: its bounds, in digits that read back exactly.
pub fn bounds(x: Interval) -> Value {
    json!([x.lower(), x.upper()])
}

/// A ball in a certificate: it holds the real numbers within `radius` of `high` + `low`, all three
/// exact.
pub fn ball(x: Ball) -> Value {
    json!({ "high": x.midpoint().high(), "low": x.midpoint().low(), "radius": x.radius() })
}

/// The equation in a certificate.
pub fn parameters(alpha: f64) -> Value {
    json!({
        "system": "caricature", "transition": "tanh", "alpha": alpha.to_string(),
            "beta": BETA.to_string(),
        "eps": EPS.to_string(), "v_plus": "-1.2", "v_minus": "-1.4",
    })
}

/// A closed orbit in a certificate: all that the inclusion and the stability test need.
pub fn cycle(c: &Cycle, alpha: f64) -> Value {
    let row = |r: [Interval; 2]| json!([bounds(r[0]), bounds(r[1])]);
    let square = |m: [[Interval; 2]; 2]| json!([row(m[0]), row(m[1])]);
    let crossings: Vec<Value> = c
        .crossings
        .iter()
        .map(|(t, x, upward)| json!({ "time": bounds(*t), "point": row(*x), "upward": upward }))
        .collect();
    json!({
        "equation": parameters(alpha), "candidate": row(c.candidate),
            "value_at_midpoint": row(c.value),
        "derivative_on_candidate": square(c.slope), "preconditioner": c.preconditioner,
            "image": row(c.image),
        "point": row(c.point), "derivative_at_point": square(c.derivative),
            "period": bounds(c.period),
        "trace": bounds(c.trace), "determinant": bounds(c.determinant), "crossings": crossings,
    })
}

/// Prints a closed orbit's numbers.
pub fn print_cycle(c: &Cycle) {
    let one = Interval::symmetric(0.0) + Interval::between(1.0, 1.0);
    println!("  exactly one fixed point of the return map in");
    println!("    x in {:?}, z in {:?}", c.candidate[0], c.candidate[1]);
    println!("  it lies at");
    println!("    x = {}", digits(c.point[0]));
    println!("    z = {}", digits(c.point[1]));
    println!("  period       {}", digits(c.period));
    println!("  trace        {}", digits(c.trace));
    println!("  determinant  {}", digits(c.determinant));
    println!("  1 - det        >= {:.4e}", (one - c.determinant).lower());
    println!("  1 + det + tr   >= {:.4e}", (one + c.determinant + c.trace).lower());
    println!("  1 + det - tr   >= {:.4e}", (one + c.determinant - c.trace).lower());
}

/// A theorem's statement, as the paper's folder has it.
///
/// # Panics
/// If the folder has no such theorem.
pub fn statement(name: &str) -> String {
    let file: toml::Table =
        twofold_papers::jeffrey_2013("theorems.toml").parse().expect("the file is TOML");
    let mut theorems = file["theorem"].as_array().into_iter().flatten();
    let found = theorems.find(|theorem| theorem["name"].as_str() == Some(name));
    let text = found.and_then(|theorem| theorem["statement"].as_str());
    let text = text.unwrap_or_else(|| panic!("theorems.toml has no {name}"));
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Writes a certificate to proofs/certificates, or says why not and ends the program.
pub fn write(name: &str, data: Value) {
    let certificate = json!({ "theorem": name, "statement": statement(name), "data": data });
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("certificates").join(format!("{name}.json"));
    let text = format!("{certificate:#}\n");
    if let Err(e) = fs::write(&path, text) {
        refuse(&format!("cannot write {}: {e}", path.display()));
    }
    println!("  certificate: proofs/certificates/{name}.json");
}

/// Ends the program: nothing was proved.
pub fn refuse(why: &str) -> ! {
    eprintln!("NOT PROVED: {why}");
    std::process::exit(1)
}
