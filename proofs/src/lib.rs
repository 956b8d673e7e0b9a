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

/// The smoothed caricature (eqs. 5, 8 and 9 of the paper) with tanh, at a theorem's parameters.
#[derive(Clone, Copy, Debug)]
pub struct Equation {
    caricature: Caricature,
    eps: f64,
}

impl Equation {
    /// The equation of a theorem.
    ///
    /// # Panics
    /// If the paper's folder has no such theorem, or it has no equation.
    pub fn of(name: &str) -> Self {
        let shows = &theorem(name)["shows"];
        let kind = shows.as_table().and_then(|kinds| kinds.values().next());
        Self::read(&kind.expect("a theorem shows something")["equation"])
    }

    /// The name, the equation and the number of rows of each table that a theorem is about.
    ///
    /// # Panics
    /// As `of`.
    pub fn of_tables(name: &str) -> Vec<(String, Self, usize)> {
        let theorem = theorem(name);
        let tables = theorem["shows"]["tables"]["tables"].as_array().expect("an array");
        let rows = |table: &toml::Value| table["rows"].as_integer().map(|n| n as usize);
        tables
            .iter()
            .map(|table| {
                let name = table["name"].as_str().expect("a text").to_owned();
                (name, Self::read(&table["equation"]), rows(table).expect("a number"))
            })
            .collect()
    }

    fn read(table: &toml::Value) -> Self {
        let text = |key: &str| table[key].as_str().expect("numbers are texts");
        assert_eq!([text("system"), text("transition")], ["caricature", "tanh"]);
        let number = |key: &str| text(key).parse().expect("a decimal number");
        let mut caricature = Caricature::with_reinjection(number("alpha"), number("beta"));
        (caricature.v_plus, caricature.v_minus) = (number("v_plus"), number("v_minus"));
        Self { caricature, eps: number("eps") }
    }

    /// Its operations, whose constants are the decimal numbers that the theorem names.
    pub fn tape(&self) -> Arc<Tape> {
        Smoothed { system: self.caricature, transition: Transition::Tanh, eps: self.eps }.tape()
    }

    /// The equation in a certificate.
    pub fn parameters(&self) -> Value {
        let Caricature { alpha, beta, v_plus, v_minus, .. } = self.caricature;
        json!({
            "system": "caricature", "transition": "tanh", "alpha": alpha.to_string(),
            "beta": beta.to_string(), "eps": self.eps.to_string(),
            "v_plus": v_plus.to_string(), "v_minus": v_minus.to_string(),
        })
    }
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

/// A closed orbit in a certificate: all that the inclusion and the stability test need.
pub fn cycle(c: &Cycle, equation: &Equation) -> Value {
    let row = |r: [Interval; 2]| json!([bounds(r[0]), bounds(r[1])]);
    let square = |m: [[Interval; 2]; 2]| json!([row(m[0]), row(m[1])]);
    let crossings: Vec<Value> = c
        .crossings
        .iter()
        .map(|(t, x, upward)| json!({ "time": bounds(*t), "point": row(*x), "upward": upward }))
        .collect();
    json!({
        "equation": equation.parameters(), "candidate": row(c.candidate),
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

/// A theorem, as the paper's folder has it.
fn theorem(name: &str) -> toml::Value {
    let file: toml::Table =
        twofold_papers::jeffrey_2013("theorems.toml").parse().expect("the file is TOML");
    let mut theorems = file["theorem"].as_array().into_iter().flatten();
    let found = theorems.find(|theorem| theorem["name"].as_str() == Some(name));
    found.unwrap_or_else(|| panic!("theorems.toml has no {name}")).clone()
}

/// A theorem's statement.
///
/// # Panics
/// If the paper's folder has no such theorem.
pub fn statement(name: &str) -> String {
    let theorem = theorem(name);
    let text = theorem["statement"].as_str().expect("a text");
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
