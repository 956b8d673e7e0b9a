//! Growth of a disturbance in one passage of the two-fold when the switch acts late or has a
//! memory, and the place where the two-fold is left in dependence on the chatter's phase: the data
//! of papers/jeffrey-2013/code/delay.
//!
//! `cargo run --release --example delay_growth growth > growth.csv`, and the same with `exits`

use nalgebra::SVector;
use twofold::analyse::delay::{LateGrowth, LatePassageQuestion, LateRule, late_exit, late_growth};
use twofold::integrate::Failure;
use twofold::num::elementary::{exp10, log10, sqrt};
use twofold::num::fit::line;
use twofold::system::{Caricature, System};

/// Starts in attracting sliding, whose chatter comes to the two-fold in different phases.
pub const STARTS: [[f64; 3]; 6] = [
    [0.0, 0.3, 0.2],
    [0.0, 0.25, 0.25],
    [0.0, 0.2, 0.3],
    [0.0, 0.28, 0.26],
    [0.0, 0.31, 0.22],
    [0.0, 0.22, 0.27],
];
/// delay/sqrt(eps) of the smooth rule.
const RATIOS: [f64; 11] = [0.03, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 10.0];
/// Phases of the chatter, evenly over one period.
const PHASES: usize = 256;

/// The caricature in the reconstructed reading.
fn system() -> (Caricature, System) {
    let caricature = Caricature::with_reinjection(1e-1, 1e-5);
    (caricature, System::from(caricature))
}

fn question(rule: LateRule, start: [f64; 3]) -> LatePassageQuestion {
    LatePassageQuestion { rule, start, two_fold: [0.0; 3], beyond: 3.0, by: 20.0 }
}

/// The growth in a passage of the caricature's two-fold, from each start.
///
/// # Errors
///
/// If an orbit cannot be followed.
pub fn growth(rule: LateRule, starts: &[[f64; 3]]) -> Result<Vec<LateGrowth>, Failure> {
    let (caricature, data) = system();
    starts.iter().map(|start| late_growth(&caricature, &data, &question(rule, *start))).collect()
}

/// Slopes of log growth against the log of the rule's parameter, with their standard errors:
/// across, along, carried in.
pub fn exponents(found: &[(f64, Vec<LateGrowth>)]) -> [(f64, f64); 3] {
    [|g: &LateGrowth| g.across, |g: &LateGrowth| g.along, |g: &LateGrowth| g.carried_in].map(|of| {
        let all =
            found.iter().flat_map(|(parameter, growth)| growth.iter().map(|g| (*parameter, of(g))));
        let points: Vec<_> =
            all.filter(|p| p.1.is_finite()).map(|(p, g)| (log10(p), log10(g))).collect();
        line(&points).map_or((f64::NAN, f64::NAN), |line| (line.slope, line.slope_error))
    })
}

/// A start on the sliding orbit of [`STARTS`]' first, later by `phase` times a bound of the
/// chatter's period: the period of steady chatter, along the orbit of the normal form, which is
/// longer by a tenth.
pub fn start_at(rule: LateRule, phase: f64) -> [f64; 3] {
    let [_, y, z] = STARTS[0];
    let period = match rule {
        LateRule::Sharp { delay } | LateRule::Smooth { delay, .. } => delay * (2.0 + y / z + z / y),
        LateRule::Relay { band } => 2.0 * band * (1.0 / y + 1.0 / z),
    };
    let (v_plus, v_minus) = (-1.2, -1.4);
    let later = phase * period / (y + z);
    [0.0, y + later * (z + v_minus * y), z + later * (y + v_plus * z)]
}

/// Point at which the two-fold is left, in inner scales.
///
/// # Errors
///
/// If the orbit cannot be followed.
pub fn exit(rule: LateRule, start: [f64; 3]) -> Result<[f64; 3], Failure> {
    let (caricature, data) = system();
    let none = SVector::zeros();
    Ok((late_exit(&caricature, &data, &question(rule, start), none, none)? / rule.scales()[1])
        .into())
}

/// A quarter of a decade per step, from 10^`from` down over so many decades.
fn ladder(from: f64, decades: u32) -> impl Iterator<Item = f64> {
    (0..=4 * decades).map(move |k| exp10(from - 0.25 * f64::from(k)))
}

fn print_growth() -> Result<(), Failure> {
    println!("rule,ratio,parameter,y0,z0,across,along,carried_in,exit_y,exit_z");
    let sharp = ladder(-2.0, 3).map(|delay| (f64::NAN, delay, LateRule::Sharp { delay }));
    let relay = ladder(-2.0, 4).map(|band| (f64::NAN, band, LateRule::Relay { band }));
    let smooth = RATIOS.into_iter().flat_map(|ratio| {
        let rules = ladder(-1.5, 3).chain([exp10(-4.75), exp10(-5.0)]);
        rules.map(move |eps| (ratio, eps, LateRule::Smooth { delay: ratio * sqrt(eps), eps }))
    });
    for (ratio, parameter, rule) in sharp.chain(relay).chain(smooth) {
        let (name, starts) = match rule {
            LateRule::Sharp { .. } => ("sharp", &STARTS[..]),
            LateRule::Relay { .. } => ("relay", &STARTS[..]),
            LateRule::Smooth { .. } => ("smooth", &STARTS[..3]),
        };
        let found = match growth(rule, starts) {
            Ok(found) => found,
            // A disturbance may be as large as f64 needs and the orbit still not leave.
            Err(failure) => {
                eprintln!("{name} {ratio} {parameter:e}: {failure}");
                continue;
            }
        };
        for ([_, y, z], g) in starts.iter().zip(&found) {
            let exit = format!("{:.4},{:.4}", g.exit[1], g.exit[2]);
            let growth = format!("{:.4e},{:.4e},{:.4e}", g.across, g.along, g.carried_in);
            println!("{name},{ratio},{parameter:.4e},{y},{z},{growth},{exit}");
        }
    }
    Ok(())
}

fn print_exits() -> Result<(), Failure> {
    println!("rule,parameter,phase,y,z");
    for (name, rule, phases) in EXITS {
        let parameter = match rule {
            LateRule::Sharp { delay } | LateRule::Smooth { delay, .. } => delay,
            LateRule::Relay { band } => band,
        };
        for k in 0..*phases {
            let phase = k as f64 / *phases as f64;
            let [_, y, z] = exit(*rule, start_at(*rule, phase))?;
            println!("{name},{parameter:e},{phase},{y:.5},{z:.5}");
        }
    }
    Ok(())
}

/// Rules whose exits are followed over one period of the chatter, and how many phases of it.
pub const EXITS: &[(&str, LateRule, usize)] = &[
    ("sharp", LateRule::Sharp { delay: 1e-2 }, PHASES),
    ("sharp", LateRule::Sharp { delay: 1e-3 }, PHASES),
    ("sharp", LateRule::Sharp { delay: 1e-4 }, PHASES),
    ("sharp", LateRule::Sharp { delay: 1e-5 }, PHASES),
    ("relay", LateRule::Relay { band: 1e-2 }, PHASES),
    ("relay", LateRule::Relay { band: 1e-3 }, PHASES),
    ("relay", LateRule::Relay { band: 1e-4 }, PHASES),
    ("relay", LateRule::Relay { band: 1e-5 }, PHASES),
];

fn main() -> Result<(), Failure> {
    match std::env::args().nth(1).as_deref() {
        Some("exits") => print_exits(),
        _ => print_growth(),
    }
}
