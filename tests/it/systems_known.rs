//! Every system that ships, against a result that is known of it: from the literature, or from the
//! closed form that it was chosen for.
#![allow(clippy::disallowed_methods)] // compared with tolerances, not with hashes

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::SVector;
use twofold::analyse::floquet::ReturnPlane;
use twofold::analyse::lyapunov::{Exponent, LyapunovOptions};
use twofold::hybrid::motion::tangent::Return;
use twofold::hybrid::{Definition, Model, Options};
use twofold::integrate::filippov::{ExitRule, Side};
use twofold::integrate::{Schedule, StepCap, Tolerance};
use twofold::job::general::GeneralRun;
use twofold::job::general_orbit::GeneralOrbit;
use twofold::job::orbit::Along;
use twofold::job::spec::*;
use twofold::job::{Answer, ClosedOrbit, Executor, LargestExponent, Run};
use twofold::num::linear::eigenvalues;
use twofold::system::{Field, System, jacobian};

const FILIPPOV: SwitchSpec =
    SwitchSpec::Filippov { exit: ExitRule::AtOnce { side: Side::Plus }, funnel: None };

fn system(name: &str) -> System {
    System::builtin(name).unwrap_or_else(|| panic!("{name} does not ship"))
}

fn run(system: &System, switch: SwitchSpec, t_end: f64, observe: Observation) -> Arc<Answer> {
    let method = MethodSpec {
        name: Method::Dopri5,
        tolerance: Tolerance { rtol: 1e-11, atol: 1e-11 },
        step_cap: StepCap::None,
        max_steps: 10_000_000,
        precision: None,
        order: None,
    };
    let start = system.definition().start().unwrap().to_vec();
    let spec = RunSpec {
        system: system.clone(),
        switch,
        start,
        t_end,
        method,
        schedule: Schedule::default(),
        observe,
    };
    Executor::quiet().ask(&Run(spec)).unwrap_or_else(|e| panic!("{}: {e}", system.name()))
}

/// Times and states of the events of a kind.
fn events(answer: &Answer, system: &System, kind: &str) -> Vec<(f64, Vec<f64>)> {
    let table = answer.table("events").unwrap();
    let columns: Vec<&[f64]> = system.coordinates().iter().map(|n| table.numbers(n)).collect();
    let rows = table.words("event").enumerate().filter(|(_, word)| *word == kind);
    rows.map(|(row, _)| (table.numbers("t")[row], columns.iter().map(|c| c[row]).collect()))
        .collect()
}

fn path(answer: &Answer, name: &str) -> Vec<f64> {
    answer.tables[0].numbers(name).to_vec()
}

fn orbit(system: &System, switch: SwitchSpec, axis: usize, settle: f64) -> ClosedOrbit {
    ClosedOrbit {
        system: system.clone(),
        switch,
        start: system.definition().start().unwrap().to_vec(),
        settle,
        plane: ReturnPlane { axis, value: 0.0, upward: true },
        returns: None,
        tolerance: Tolerance { rtol: 1e-11, atol: 1e-11 },
        longest_return: 1000.0,
        along: None,
    }
}

fn ask(question: &ClosedOrbit) -> Arc<Answer> {
    Executor::quiet().ask(question).unwrap_or_else(|e| panic!("{}: {e}", question.system.name()))
}

/// The zero of `f` between `a` and `b`.
fn zero(f: impl Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    let sign = f(a) > 0.0;
    assert_ne!(sign, f(b) > 0.0, "no change of sign");
    for _ in 0..200 {
        let m = 0.5 * (a + b);
        if (f(m) > 0.0) == sign { a = m } else { b = m }
    }
    0.5 * (a + b)
}

#[test]
fn every_file_has_its_test() {
    let here = include_str!("systems_known.rs");
    for name in twofold::system::library::names() {
        let elsewhere = ["caricature-as-printed", "wheel"].contains(&name);
        // tests/it/misprint.rs, tests/it/wheel.rs
        assert!(
            elsewhere || here.contains(&format!("system(\"{name}\")")),
            "{name}: no known result is tested"
        );
    }
}

/// Jeffrey & Colombo (2009): about the two-fold the map from one upward crossing to the next is
/// linear with trace 4 v w - 2 and determinant 1.
#[test]
fn two_fold_crossing_map() {
    let s = system("two-fold");
    let crossings =
        events(&run(&s, FILIPPOV, 500.0, Observation::Path { chord: 1.0 }), &s, "crossing");
    let up: Vec<f64> = crossings.iter().filter(|(_, x)| x[1] < 0.0).map(|(_, x)| x[1]).collect();
    assert!(up.len() >= 3, "{crossings:?}");
    for w in up.windows(3) {
        assert!(((w[0] + w[2]) / w[1] - (4.0 * 1.2 * 1.4 - 2.0)).abs() < 1e-6, "{up:?}");
    }
}

/// Closed orbit of the printed reading, from 113-bit arithmetic outside this project.
#[test]
fn caricature_orbit_to_ten_digits() {
    let s = system("caricature").with_all([("alpha", 1e-3.into()), ("beta", 1e-5.into())]).unwrap();
    let question = ClosedOrbit {
        start: vec![17.0573, 0.0, -0.0154],
        returns: Some(1),
        tolerance: Tolerance { rtol: 1e-13, atol: 1e-13 },
        ..orbit(&s, SwitchSpec::tanh(1e-3), 1, 0.0)
    };
    let found = ask(&question);
    let period: f64 = found.fact("period").unwrap();
    let m: Vec<[f64; 2]> = found.fact("multipliers").unwrap();
    assert!((period - 20.247_955_004_312_337).abs() < 1e-7, "{period}");
    assert!((m[0][0] + m[1][0] + 1.937_052_925_84).abs() < 1e-5, "{m:?}");
    let modulus: f64 = found.fact("largest_modulus").unwrap();
    assert!((modulus - 0.968_948_168_45).abs() < 1e-5, "{modulus}");
}

/// In sliding v = -x/gain: x falls as exp(-t/gain).
#[test]
fn relay_linear_slides_exponentially() {
    let s = system("relay-linear").with("gain", 2.0).unwrap();
    let answer = run(&s, FILIPPOV, 12.0, Observation::Path { chord: 1e-3 });
    let landing = events(&answer, &s, "landing");
    let (t0, x0) = (landing[0].0, landing[0].1[0]);
    let state: Vec<f64> = answer.fact("state").unwrap();
    assert!((state[0] - x0 * (-(12.0 - t0) / 2.0).exp()).abs() < 1e-9, "{state:?}");
}

/// Below the optimal gain each flight takes ((1 - gain)/(1 + gain))^(1/2) of the time of the one
/// before.
#[test]
fn relay_parabolic_chatters_geometrically() {
    let s = system("relay-parabolic");
    let times: Vec<f64> =
        events(&run(&s, FILIPPOV, 5.2, Observation::Path { chord: 1e-3 }), &s, "crossing")
            .iter()
            .map(|e| e.0)
            .collect();
    assert!(times.len() >= 4, "{times:?}");
    for w in times.windows(3) {
        let ratio = (w[2] - w[1]) / (w[1] - w[0]);
        assert!((ratio - (0.5_f64 / 1.5).sqrt()).abs() < 1e-6, "{ratio}");
    }
}

/// The slip phase is a linear oscillator with negative damping, the stick phase lasts from its end
/// to x = friction: the limit cycle's period in closed form. Sticking makes its multiplier zero.
#[test]
fn stick_slip_period() {
    let (belt, friction, w) = (0.3, 1.0, 0.2_f64);
    let centre = friction - w * belt;
    let omega = (1.0 - 0.25 * w * w).sqrt();
    // x = centre + e^(w t/2) (a cos + b sin), from x = friction, v = belt.
    let a: f64 = friction - centre;
    let b: f64 = (belt - 0.5 * w * a) / omega;
    let x = |t: f64| centre + (0.5 * w * t).exp() * (a * (omega * t).cos() + b * (omega * t).sin());
    let v = |t: f64| {
        let (s, c) = (omega * t).sin_cos();
        (0.5 * w * t).exp() * ((0.5 * w * a + omega * b) * c + (0.5 * w * b - omega * a) * s)
    };
    let slip = zero(|t| v(t) - belt, 3.0, 6.0);
    let period = slip + (friction - x(slip)) / belt;
    let s = system("stick-slip");
    // The plane v = 0 is met in flight.
    let found = ask(&orbit(&s, FILIPPOV, 1, 50.0));
    let ours: f64 = found.fact("period").unwrap();
    assert!((ours - period).abs() < 1e-8, "{ours} {period}");
    let modulus: f64 = found.fact("largest_modulus").unwrap();
    assert!(modulus < 1e-6, "{modulus}");
}

/// Den Hartog (1931): the amplitude of the motion without sticking, (V^2 - (friction S)^2)^(1/2)
/// for forcing of amplitude 1.
#[test]
fn dry_friction_amplitude() {
    let s = system("dry-friction");
    let (beta, friction) = (1.5_f64, 0.2);
    let v = 1.0 / (1.0 - beta * beta);
    let shape = (PI / beta).sin() / (beta * (1.0 + (PI / beta).cos()));
    let amplitude = (v * v - (friction * shape) * (friction * shape)).sqrt();
    // Turning points: crossings of v = 0.
    let answer = run(&s, FILIPPOV, 600.0, Observation::Path { chord: 1e-2 });
    let turns = events(&answer, &s, "crossing");
    let last = &turns[turns.len() - 2..];
    for (t, x) in last {
        assert!((x[0].abs() - amplitude).abs() < 1e-6, "t = {t}: {} {amplitude}", x[0]);
    }
    // And it is a closed orbit of the forcing's period.
    let found = ask(&orbit(&s, FILIPPOV, 3, 300.0));
    let period: f64 = found.fact("period").unwrap();
    assert!((period - 2.0 * PI / beta).abs() < 1e-8, "{period}");
}

/// Dry friction takes a fixed amount of the amplitude in each half turn: 4 friction of the
/// difference's, here.
#[test]
fn friction_pair_loses_amplitude_linearly_and_sticks() {
    let s = system("friction-pair");
    let friction = 0.1;
    let answer = run(&s, FILIPPOV, 40.0, Observation::Path { chord: 1e-2 });
    let turns = events(&answer, &s, "crossing");
    let d: Vec<f64> = turns.iter().map(|(_, x)| (x[0] - x[2]).abs()).collect();
    assert!(d.len() >= 3, "{turns:?}");
    for w in d.windows(2) {
        assert!((w[0] - w[1] - 4.0 * friction).abs() < 1e-9, "{d:?}");
    }
    // It sticks once |d| is below 2 friction, and the mean swings on, undamped.
    let landing = events(&answer, &s, "landing");
    let x = &landing[0].1;
    assert!(landing.len() == 1 && (x[0] - x[2]).abs() < 2.0 * friction, "{landing:?}");
    let end: Vec<f64> = answer.fact("state").unwrap();
    let energy = |x: &[f64]| (x[0] + x[2]).powi(2) + (x[1] + x[3]).powi(2);
    assert!((energy(&end) - energy(s.definition().start().unwrap())).abs() < 1e-8);
    assert!(
        (end[0] - end[2] - (x[0] - x[2])).abs() < 1e-9 && (end[1] - end[3]).abs() < 1e-9,
        "{end:?}"
    );
}

/// State of three lags as the relay turns to -1 in a symmetric cycle of half period h, from the
/// output: x(h) = E x + (1 - E)(-1, -1, -1) with E = e^(A h), and x(h) = -x.
fn lags_start(h: f64) -> [f64; 3] {
    let e = (-h).exp();
    // e^(A h) of three equal lags, A = -1 + shift.
    let matrix = [[e, e * h, 0.5 * e * h * h], [0.0, e, e * h], [0.0, 0.0, e]];
    // (1 + E) x = (1 - E)(1, 1, 1), from the last row up.
    let mut x = [0.0; 3];
    for i in (0..3).rev() {
        let driven = 1.0 - matrix[i].iter().sum::<f64>();
        let known: f64 = (i + 1..3).map(|j| matrix[i][j] * x[j]).sum();
        x[i] = (driven - known) / (1.0 + matrix[i][i]);
    }
    x
}

/// Tsypkin's condition for a symmetric limit cycle of half period h: the output of the lags, driven
/// by the relay, is zero where it switches.
#[test]
fn relay_third_order_period() {
    let half = zero(|h| lags_start(h)[0], 1.0, 3.0);
    let s = system("relay-third-order");
    // Through q = 0, which is met in flight.
    let found = ask(&orbit(&s, FILIPPOV, 1, 100.0));
    let period: f64 = found.fact("period").unwrap();
    assert!((period - 2.0 * half).abs() < 1e-8, "{period} {}", 2.0 * half);
    // The describing function's 2 pi/3^(1/2) is near it, and not it.
    let described = 2.0 * PI / 3.0_f64.sqrt();
    assert!(
        (period - described).abs() > 1e-3 && (period - described).abs() < 0.1,
        "{period} {described}"
    );
    let modulus: f64 = found.fact("largest_modulus").unwrap();
    assert!(modulus < 0.5, "{modulus}");
}

/// The same condition with a band: the relay turns where the output is at the band's edge.
#[test]
fn relay_third_order_with_a_band_has_its_period() {
    let s = system("relay-third-order");
    let mut longer = 0.0;
    for band in [0.02, 0.1, 0.3] {
        let half = zero(|h| lags_start(h)[0] - band, 1.0, 9.0);
        assert!(half > longer, "a wider band, a longer period");
        longer = half;
        let answer = run(
            &s,
            SwitchSpec::relay(band),
            150.0,
            Observation::Section { coordinate: 1, value: 0.0 },
        );
        let table = answer.table("section").unwrap();
        let up: Vec<f64> = table
            .numbers("t")
            .iter()
            .zip(table.words("direction"))
            .filter(|c| c.1 == "up")
            .map(|c| *c.0)
            .collect();
        let last = up[up.len() - 1] - up[up.len() - 2];
        assert!((last - 2.0 * half).abs() < 1e-9, "{band}: {last} {}", 2.0 * half);
    }
}

/// Matsumoto, Chua & Komuro (1985): eigenvalues at the rest points as printed there. Sprott (2003):
/// the largest exponent 0.3271. (The former print 0.23 and -1.78: both less by a factor of about ln
/// 2, with the same dimension 2.13.)
#[test]
fn chua_eigenvalues_and_exponent() {
    let s = system("chua");
    let at = |field: &Field, x: [f64; 3]| {
        let j = jacobian(&field.bind::<3>().unwrap(), &SVector::from(x));
        let rows: Vec<f64> = (0..9).map(|k| j[(k / 3, k % 3)]).collect();
        let mut e = eigenvalues(&rows, 3).unwrap();
        e.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        e
    };
    let close = |found: &[[f64; 2]], want: &[[f64; 2]]| {
        found
            .iter()
            .zip(want)
            .all(|(f, w)| (f[0] - w[0]).abs() < 0.01 && (f[1] - w[1]).abs() < 0.01)
    };
    let outside = at(&Field::plus(&s), [1.5, 0.0, -1.5]);
    assert!(close(&outside, &[[-3.94, 0.0], [0.19, -3.05], [0.19, 3.05]]), "{outside:?}");
    let inside = at(&Field::minus(&s), [0.0; 3]);
    assert!(close(&inside, &[[-0.97, -2.71], [-0.97, 2.71], [2.22, 0.0]]), "{inside:?}");
    let settings =
        LyapunovOptions { transient: 100.0, duration: 6000.0, ..LyapunovOptions::default() };
    let start = s.definition().start().unwrap().to_vec();
    let question = LargestExponent { system: s, switch: SwitchSpec::tanh(1e-3), start, settings };
    let exponent: Exponent = Executor::quiet().ask(&question).unwrap().fact("exponent").unwrap();
    let allowed = 4.0 * exponent.standard_error;
    assert!((exponent.value - 0.3271).abs() < allowed && allowed < 0.05, "{exponent:?}");
}

/// Fossas & Olivar (1996): the orbit of the ramp's period loses its stability by period doubling at
/// a supply of 24.516 V.
#[test]
fn buck_doubles_its_period() {
    let text = twofold::system::library::general("buck").unwrap();
    let model = Model::new(Definition::from_toml(text, "buck").unwrap());
    let options = Options { t_end: 1.0, ..Options::default() };
    let along = Along { parameter: "input".into(), from: 20.0, to: 26.0, steps: 10, most: 200 };
    let question = GeneralOrbit {
        run: GeneralRun { model, options },
        settle: 0.08,
        after: Return::Period(400e-6),
        along: Some(along),
    };
    let found = Executor::quiet().ask(&question).unwrap();
    let changes = found.table("bifurcations").unwrap();
    assert_eq!(changes.words("change").collect::<Vec<_>>(), ["period-doubling"]);
    let at = changes.numbers("input")[0];
    assert!((at - 24.516).abs() < 1e-3, "{at}");
}

/// Casey, de Jong & Gouzé (2006): the singular steady state on the threshold, from Filippov's
/// convex combination.
#[test]
fn gene_switch_settles_on_its_threshold() {
    let s = system("gene-switch");
    let answer = run(&s, FILIPPOV, 60.0, Observation::Path { chord: 1e-2 });
    let state: Vec<f64> = answer.fact("state").unwrap();
    // Share of the time above the threshold: 1 - gamma_p theta/kappa_p.
    let share = 1.0 - 1.0 / 3.0;
    assert!(
        (state[0] - 1.0).abs() < 1e-9 && (state[1] - 2.0 * share / 0.5).abs() < 1e-8,
        "{state:?}"
    );
    // The smoothed switch agrees to its width.
    let smooth: Vec<f64> = run(&s, SwitchSpec::tanh(1e-3), 60.0, Observation::Path { chord: 1e-2 })
        .fact("state")
        .unwrap();
    assert!((smooth[1] - state[1]).abs() < 2e-2 && (smooth[0] - 1.0).abs() < 5e-3, "{smooth:?}");
}

/// Filippov (1988), sec. 19: from turn to turn 1/rho grows by -2 c/3 in the limit; with the folds
/// apart a limit cycle of radius about (3 mu/c)^(1/2), exactly where (rho + 2 mu)^2 (...) of f+
/// closes.
#[test]
fn fused_focus_attracts_algebraically_and_bears_a_cycle() {
    let c = -0.3;
    let s = system("fused-focus");
    let crossings =
        events(&run(&s, FILIPPOV, 110.0, Observation::Path { chord: 1e-2 }), &s, "crossing");
    let rho: Vec<f64> = crossings.iter().filter(|(_, x)| x[0] < 0.0).map(|(_, x)| -x[0]).collect();
    assert!(rho.len() > 50, "{}", rho.len());
    let n = rho.len();
    let slope = (1.0 / rho[n - 1] - 1.0 / rho[n - 21]) / 20.0;
    assert!((slope + 2.0 * c / 3.0).abs() < 2e-3, "{slope}");

    let mu = -0.01;
    let s = s.with("mu", mu).unwrap();
    // f+ carries -rho to b with F(b) = F(-rho), F = -x^2/2 + c x^3/3, and f- carries b to 2 mu - b.
    let f = |x: f64| -0.5 * x * x + c * x * x * x / 3.0;
    let rho = zero(|rho| f(rho + 2.0 * mu) - f(-rho), 0.1, 0.6);
    assert!((rho / (3.0 * mu / c).sqrt() - 1.0).abs() < 0.1, "{rho}");
    // Through x = 0 upwards: above the surface.
    let found = ask(&orbit(&s, FILIPPOV, 0, 300.0));
    let top: Vec<f64> = found.fact("point").unwrap();
    // Height where x = 0: along f+ y - F(x) is constant.
    assert!((top[1] - (f(0.0) - f(-rho))).abs() < 1e-8, "{top:?} {}", -f(-rho));
    let m: Vec<[f64; 2]> = found.fact("multipliers").unwrap();
    assert!((m[0][0] - (1.0 + 4.0 * c * rho / 3.0)).abs() < 0.02, "{m:?}");
    let mode = path(&run(&s, FILIPPOV, 5.0, Observation::Times { every: 0.5 }), "t");
    assert_eq!(mode.len(), 11);
}

/// A limit cycle of radius one beside a surface y = level: apart from it Newton's method finds the
/// cycle; where it touches there is no derivative, and through a two-fold no map.
#[test]
fn grazing_and_set_valued_orbits_are_refused() {
    let text = "states = ['x', 'y']\nstart = [1, 0]\nh = 'y - level'\nplus = ['g*x - y + 1', 'g*y \
        + x - 1']\nminus = ['g*x - y', 'g*y + x']\n\
                [parameters]\nlevel = 1.2\n[let]\ng = '1 - x^2 - y^2'";
    let s = System::new(
        twofold::system::Definition::from_toml(text, "cycle.toml")
            .unwrap_or_else(|e| panic!("{e}")),
    );
    let found = ask(&orbit(&s, FILIPPOV, 1, 0.0));
    let (period, m): (f64, Vec<[f64; 2]>) =
        (found.fact("period").unwrap(), found.fact("multipliers").unwrap());
    assert!(
        (period - 2.0 * PI).abs() < 1e-8 && (m[0][0] - (-4.0 * PI).exp()).abs() < 1e-6,
        "{period} {m:?}"
    );
    let refused = |s: &System, axis: usize, start: &[f64]| {
        let question = ClosedOrbit { start: start.to_vec(), ..orbit(s, FILIPPOV, axis, 0.0) };
        Executor::quiet().ask(&question).unwrap_err().to_string()
    };
    let grazing = refused(&s.clone().with("level", 1.0).unwrap(), 1, &[1.0, 0.0]);
    assert!(grazing.contains("grazes"), "{grazing}");
    // From the attracting region of the two-fold, into it.
    let set_valued = refused(&system("two-fold"), 2, &[0.0, 0.1, 0.0]);
    assert!(
        set_valued.contains("many futures") || set_valued.contains("did not return"),
        "{set_valued}"
    );
}

/// Two surfaces: squares |x| + |y| = c around the origin, each side in the time c; a surface is
/// crossed at every corner.
#[test]
fn two_relays_run_around_a_square() {
    let system = system("relay-square");
    let answer = run(&system, FILIPPOV, 60.0, Observation::Path { chord: 1e-3 });
    let crossings = events(&answer, &system, "crossing");
    assert_eq!(crossings.len(), 80);
    for (k, (t, x)) in crossings.iter().enumerate() {
        assert!((t - (0.5 + 0.75 * k as f64)).abs() < 1e-10, "corner {k} at {t}");
        assert!((x[0].abs() + x[1].abs() - 0.75).abs() < 1e-10, "corner {k}: {x:?}");
    }
    let signs: Vec<&str> = answer.table("events").unwrap().words("signs").take(4).collect();
    assert_eq!(signs, ["0+", "-0", "0-", "+0"]);
}

/// Two surfaces, no spring between the blocks: each moves as if it were alone. The first is the
/// system `stick-slip`, also while the second comes to rest and turns; the second, -x2 - F
/// sign(v2), turns at atan(v/(x + F)) + k pi, and loses 2 F of its amplitude each time.
#[test]
fn two_blocks_without_a_spring_move_alone() {
    let (pair, alone) = (system("two-blocks"), system("stick-slip"));
    let both = run(&pair, FILIPPOV, 40.0, Observation::Path { chord: 1e-3 });
    let one = run(&alone, FILIPPOV, 40.0, Observation::Path { chord: 1e-3 });
    let mut sticking = 0;
    for kind in ["landing", "left-by-tangency"] {
        let (found, known) = (events(&both, &pair, kind), events(&one, &alone, kind));
        assert!(
            known.len() >= 3 && found.len() == known.len(),
            "{kind}: {} of {}",
            found.len(),
            known.len()
        );
        for ((t, x), (u, y)) in found.iter().zip(&known) {
            assert!(
                (t - u).abs() < 1e-8 && (x[0] - y[0]).abs() < 1e-8 && (x[1] - y[1]).abs() < 1e-8,
                "{kind}: {t} {u}"
            );
        }
    }
    let friction = 0.1f64;
    let amplitude = (10.0 + friction).hypot(0.5) - friction;
    let table = both.table("events").unwrap();
    let signs: Vec<&str> = table.words("signs").collect();
    let turns: Vec<usize> = (0..table.len()).filter(|row| signs[*row].ends_with('0')).collect();
    assert_eq!(turns.len(), 13);
    for (k, row) in turns.into_iter().enumerate() {
        let t = (0.5f64).atan2(10.0 + friction) + k as f64 * PI;
        let x = if k % 2 == 0 { 1.0 } else { -1.0 } * (amplitude - 2.0 * friction * k as f64);
        assert!(
            (table.numbers("t")[row] - t).abs() < 1e-8,
            "turn {k}: {} instead of {t}",
            table.numbers("t")[row]
        );
        assert!(
            (table.numbers("x2")[row] - x).abs() < 1e-8,
            "turn {k}: {} instead of {x}",
            table.numbers("x2")[row]
        );
        sticking += usize::from(signs[row] == "00");
    }
    assert!(
        sticking >= 2,
        "the second block never turns while the first sticks: the test would prove less"
    );
}

/// Without a spring between them two blocks that stick at once go on, each on its own belt, as they
/// do smoothed.
#[test]
fn two_blocks_that_stick_at_once_go_on() {
    let pair = system("two-blocks");
    let method = MethodSpec {
        name: Method::Dopri5,
        tolerance: Tolerance { rtol: 1e-9, atol: 1e-9 },
        step_cap: StepCap::None,
        max_steps: 10_000_000,
        precision: None,
        order: None,
    };
    let of = |switch| RunSpec {
        system: pair.clone(),
        switch,
        // The second block is slow enough to stay where it comes to rest.
        start: vec![0.0, 0.0, 0.05, -0.02],
        t_end: 20.0,
        method,
        schedule: Schedule::default(),
        observe: Observation::Path { chord: 1e-3 },
    };
    let sharp = Executor::quiet().ask(&Run(of(FILIPPOV))).unwrap();
    let smoothed = Executor::quiet().ask(&Run(of(SwitchSpec::tanh(1e-3)))).unwrap();
    let last = |answer: &Answer, table: &str, of: &str| {
        *answer.table(table).unwrap().numbers(of).last().unwrap()
    };
    assert!((last(&smoothed, "path", "t") - 20.0).abs() < 1e-12);
    assert!((last(&sharp, "motion", "x2") - 0.046_148_351_9).abs() < 1e-8);
    // A layer of width eps shifts a block by a few eps.
    assert!((last(&sharp, "motion", "x1") - last(&smoothed, "path", "x1")).abs() < 2e-2);
    let hysteretic = SwitchSpec::hysteretic(1e-3, twofold::system::Relaxation::Single);
    let refused = Executor::quiet().ask(&Run(of(hysteretic))).unwrap_err().to_string();
    assert!(refused.contains("one switching surface"), "{refused}");
}

/// The smoothed pair is the product of the two smoothings: without a spring the first block moves
/// as the smoothed system `stick-slip`.
#[test]
fn two_smoothed_switches_do_not_mix() {
    let (pair, alone) = (system("two-blocks"), system("stick-slip"));
    let at = |x: [f64; 4]| {
        let both =
            Field::smoothed(&pair, twofold::system::Transition::Tanh, 0.1).bind::<4>().unwrap();
        let one =
            Field::smoothed(&alone, twofold::system::Transition::Tanh, 0.1).bind::<2>().unwrap();
        use twofold::system::VectorField;
        let (f, g) = (both.eval(&SVector::from(x)), one.eval(&SVector::from([x[0], x[1]])));
        assert!((f[0] - g[0]).abs() < 1e-14 && (f[1] - g[1]).abs() < 1e-14, "{f} {g}");
        let phi = 0.5 * (1.0 + (x[3] / 0.1).tanh());
        assert!((f[3] - (-x[2] - 0.1 * (2.0 * phi - 1.0))).abs() < 1e-14);
    };
    [[0.2, 0.3, 1.0, 0.05], [0.2, 0.25, -1.0, -0.15], [0.2, 0.4, 0.0, 0.0]]
        .into_iter()
        .for_each(at);
}
