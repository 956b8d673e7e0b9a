//! Events of Filippov motion: none is missed, none is invented, whatever the units and wherever the
//! run ends.
#![allow(clippy::disallowed_methods)] // exact solutions are compared to tolerances, not hashed

use nalgebra::{SVector, Vector2, Vector3};
use twofold::integrate::Tolerance;
use twofold::integrate::filippov::{
    EventKind, ExitRule, FilippovError, FilippovOptions, FilippovSummary, Mode, Side, SlidingFlow,
    Trajectory, run,
};
use twofold::num::Elementary;
use twofold::system::{Bound, Definition, PiecewiseSmooth, System, VectorField};

const PLUS: ExitRule = ExitRule::AtOnce { side: Side::Plus };

/// A planar system from the text of its equations.
fn planar(h: &str, plus: [&str; 2], minus: [&str; 2]) -> Bound<2> {
    let text = format!(
        "states = [\"x\", \"y\"]\nstart = [0, 0]\nh = \"{h}\"\nplus = {plus:?}\nminus = {minus:?}\n"
    );
    System::new(Definition::from_toml(&text, "test.toml").unwrap()).bind().unwrap()
}

fn settings(tolerance: f64) -> FilippovOptions {
    FilippovOptions {
        tolerance: Tolerance { rtol: tolerance, atol: tolerance },
        ..FilippovOptions::default()
    }
}

fn go<P, const N: usize, const M: usize>(
    system: &P,
    start: SVector<f64, N>,
    t_end: f64,
    settings: &FilippovOptions,
) -> (Result<FilippovSummary<N>, FilippovError>, Trajectory<N>)
where
    P: PiecewiseSmooth<N>,
    for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
{
    let mut seen = Trajectory::new(1);
    let end = run(system, start, t_end, settings, PLUS, &mut seen);
    (end, seen)
}

/// x' = 1 through windows of width 2 w about x = c, in which y' = 1/w: y grows by 2 in each.
#[test]
fn thin_windows_are_passed_through() {
    for (center, width) in [(0.3, 1e-4), (0.3, 1e-8), (-0.51, 1e-10), (0.77, 1e-12), (1.0, 1e-13)] {
        for factor in [1.0, 3e-15, 7e9] {
            let h = format!("{factor}*((x - ({center}))^2 - {width}^2)");
            let rate = format!("{}", 1.0 / width);
            let (end, seen) = go(
                &planar(&h, ["1", "0"], ["1", &rate]),
                Vector2::new(-1.0, 0.0),
                3.0,
                &settings(1e-9),
            );
            let y = end.unwrap().x[1];
            // The places of the two zeros are rounded to the spacing of the numbers there.
            let resolved = 1e-6 + 10.0 * f64::EPSILON / width;
            assert!(
                (y - 2.0).abs() < resolved && seen.events.len() == 2,
                "{center} {width} {factor}: {y}"
            );
        }
    }
}

/// Windows of a function that is no polynomial: cos(x - c) > 1 - d for |x - c| < acos(1 - d), about
/// sqrt(2 d).
#[test]
fn thin_windows_of_other_functions_are_passed_through() {
    for (center, d) in [(0.4, 1e-6), (0.9, 1e-10), (0.123, 1e-13)] {
        let h = format!("1 - {d} - cos(x - {center})");
        let half = (2.0 * d * (1.0 + d / 6.0)).sqrt();
        let rate = format!("{}", 1.0 / half);
        let (end, _) = go(
            &planar(&h, ["1", "0"], ["1", &rate]),
            Vector2::new(-1.0, 0.0),
            3.0,
            &settings(1e-9),
        );
        let y = end.unwrap().x[1];
        // h is rounded by an epsilon of 1: a share of d.
        assert!((y - 2.0).abs() < 1e-6 + 10.0 * f64::EPSILON / d, "{center} {d}: {y}");
    }
}

/// Pairs of crossings near grazings come again and again with one distance: no accumulation. y' = 1
/// while sin(k x) > 1 - d.
#[test]
fn near_grazing_pairs_do_not_accumulate() {
    for (k, d, turns) in [(1.0, 1e-3, 30), (2.5, 1e-5, 60), (1.3, 1e-9, 40)] {
        let h = format!("sin({k}*x) - (1 - {d})");
        let t_end = f64::from(turns) * std::f64::consts::TAU / k;
        let (end, seen) = go(
            &planar(&h, ["1", "1"], ["1", "0"]),
            Vector2::new(0.0, 0.0),
            t_end,
            &settings(1e-10),
        );
        let one = 2.0 / k * (2.0 * d * (1.0 + d / 6.0)).sqrt();
        let y = end.unwrap_or_else(|e| panic!("{k} {d}: {e}")).x[1];
        assert_eq!(seen.events.len(), 2 * turns as usize, "{k} {d}");
        assert!((y - f64::from(turns) * one).abs() < 1e-6 * y + 1e-7, "{k} {d}: {y}");
    }
}

/// If both fields vanish on the surface, the motion stays: u' = -|u|^p with p < 1 comes to rest in
/// finite time.
#[test]
fn motion_comes_to_rest_on_the_surface() {
    for (speed, power) in
        [(1.0, "sqrt(abs(x))"), (3.0, "sqrt(abs(x))"), (0.5, "sqrt(sqrt(abs(x)))")]
    {
        let rate = |sign: &str| format!("{sign}{speed}*{power}");
        let system = planar("x", [&rate("-"), "0"], [&rate(""), "0"]);
        let Ok(end) = go(&system, Vector2::new(1.0, 0.0), 8.0, &settings(1e-9)).0 else {
            panic!("{speed} {power}")
        };
        assert!(end.x[0].abs() < 1e-9 && end.t == 8.0, "{speed} {power}: {end:?}");
    }
}

fn super_twisting(first: f64, second: f64) -> Bound<2> {
    let fields = |s: f64| [format!("y + ({})*sqrt(abs(x))", s * first), format!("{}", s * second)];
    let ([a, b], [c, d]) = (fields(-1.0), fields(1.0));
    planar("x", [&a, &b], [&c, &d])
}

/// Super-twisting control. In s with ds = dt/sqrt|x| each flight is linear: from (0, y) to (0, -r
/// y) in the time |y| (1 + r)/second, with r = exp(-a pi/w), a = first/4, w^2 = second/2 - a^2;
/// from (size, 0) the surface is met at y = -(second/w) e^(-a s) sin(w s) sqrt(size), tan(w s) =
/// w/a.
#[test]
fn crossings_accumulate_at_a_rest_and_the_motion_stays() {
    for (first, second, size) in
        [(1.5, 1.1, 1.0), (1.5, 1.1, 0.09), (1.0, 1.2, 4.0), (2.0, 3.0, 1.0), (0.7, 1.0, 1.0)]
    {
        let a: f64 = first / 4.0;
        let w = (second / 2.0 - a * a).sqrt();
        let (r, s) = ((-a * std::f64::consts::PI / w).exp(), (w / a).atan() / w);
        let y = second / w * (-a * s).exp() * (w * s).sin() * f64::sqrt(size);
        let exact = y / second * (1.0 + (1.0 + r) / (1.0 - r));
        let (end, seen) =
            go(&super_twisting(first, second), Vector2::new(size, 0.0), 100.0, &settings(1e-12));
        let end = end.unwrap_or_else(|e| panic!("{first} {second} {size}: {e}"));
        assert!(
            end.x.amax() < 1e-8 && end.mode == Some(Mode::SlidingAttracting),
            "{first} {second}: {end:?}"
        );
        let last = seen.events.last().unwrap();
        assert!(matches!(last.kind, EventKind::Accumulation { .. }), "{last:?}");
        // Near the surface the fields change by the root of what the state is off.
        assert!(
            (last.t - exact).abs() < 1e-6 * exact,
            "{first} {second} {size}: {} {exact}",
            last.t
        );
    }
}

/// Crossings that accumulate beside a state that drifts along the surface: it goes on.
#[test]
fn accumulation_where_the_motion_goes_on_is_no_rest() {
    let text = "states = [\"x\", \"y\", \"z\"]\nstart = [1, 0, 0]\nh = \"x\"\n\
                plus = [\"y - 1.5*sqrt(abs(x))\", \"-1.1\", \"1\"]\nminus = [\"y + \
                1.5*sqrt(abs(x))\", \"1.1\", \"1\"]\n";
    let system: Bound<3> =
        System::new(Definition::from_toml(text, "drift.toml").unwrap()).bind().unwrap();
    let end = go(&system, Vector3::new(1.0, 0.0, 0.0), 20.0, &settings(1e-10)).0.unwrap();
    assert!(
        end.x[0].abs() < 1e-8 && end.x[1].abs() < 1e-8 && (end.x[2] - 20.0).abs() < 1e-6,
        "{end:?}"
    );
}

/// A body that falls on a surface exactly at the end of the run, or a rounding before or after it.
#[test]
fn runs_end_at_events() {
    let system = planar("x", ["y", "-1"], ["y", "3"]);
    for k in [1.0, 0.3, 7.7, 1e-3, 123.456] {
        let mut t_end: f64 = k;
        for _ in 0..6 {
            t_end = t_end.next_down();
        }
        for _ in 0..12 {
            t_end = t_end.next_up();
            let end = go(&system, Vector2::new(0.5 * k * k, 0.0), t_end, &settings(1e-10)).0;
            let end = end.unwrap_or_else(|e| panic!("{k} {t_end}: {e}"));
            assert!(
                end.t == t_end && end.x[0].abs() < 1e-8 * k * k && (end.x[1] + k).abs() < 1e-8 * k,
                "{end:?}"
            );
        }
    }
}

/// A system in other units: states times `unit`, the switching function times `factor`.
struct InUnits<'a, const N: usize> {
    system: &'a Bound<N>,
    unit: f64,
    factor: f64,
}

impl<const N: usize> PiecewiseSmooth<N> for InUnits<'_, N> {
    fn switching<S: Elementary>(&self, x: &SVector<S, N>) -> S {
        self.system.switching(&x.map(|v| v.scale(1.0 / self.unit))).scale(self.factor)
    }
    fn plus<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        self.system.plus(&x.map(|v| v.scale(1.0 / self.unit))).map(|v| v.scale(self.unit))
    }
    fn minus<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        self.system.minus(&x.map(|v| v.scale(1.0 / self.unit))).map(|v| v.scale(self.unit))
    }
}

fn same_in_all_units<const N: usize, const M: usize>(name: &str, start: &[f64])
where
    for<'a, 'b> SlidingFlow<'a, InUnits<'b, N>, N>: VectorField<M>,
{
    let system: Bound<N> = System::builtin(name).unwrap().bind().unwrap();
    let start = SVector::<f64, N>::from_column_slice(start);
    let of = |unit: f64, factor: f64| {
        let settings = FilippovOptions {
            tolerance: Tolerance { rtol: 1e-11, atol: 1e-11 * unit },
            ..FilippovOptions::default()
        };
        // Up to where there are many futures, if the motion comes there: from there on it depends
        // on rounding.
        let mut seen = Trajectory::new(1);
        let end = run(
            &InUnits { system: &system, unit, factor },
            start * unit,
            6.0,
            &settings,
            ExitRule::All,
            &mut seen,
        );
        let kinds: Vec<_> = seen.events.iter().map(|e| std::mem::discriminant(&e.kind)).collect();
        let times: Vec<f64> = seen.events.iter().map(|e| e.t).collect();
        (end.map(|end| end.x / unit).map_err(|e| std::mem::discriminant(&e)), kinds, times)
    };
    let (end, kinds, times) = of(1.0, 1.0);
    for (unit, factor) in
        [(1e-12, 1.0), (1e12, 1.0), (1.0, 1e-13), (1.0, 1e11), (3e-7, 1e9), (1e-9, 1e-9)]
    {
        let (end_here, kinds_here, times_here) = of(unit, factor);
        assert_eq!(kinds_here, kinds, "{name}, {unit:e}, {factor:e}: {times_here:?}, {times:?}");
        let far = times.iter().zip(&times_here).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(far < 1e-6, "{name}, {unit:e}, {factor:e}: {times_here:?}, {times:?}");
        match (&end, &end_here) {
            (Ok(a), Ok(b)) => {
                assert!(
                    (a - b).amax() < 1e-6 * (1.0 + a.amax()),
                    "{name}, {unit:e}, {factor:e}: {a} {b}"
                )
            }
            (a, b) => assert_eq!(a, b, "{name}, {unit:e}, {factor:e}"),
        }
    }
}

/// Every shipped system with one surface moves alike in any units of its states and of its
/// switching function.
#[test]
fn units_change_nothing() {
    let mut tried = 0;
    for name in twofold::system::library::names() {
        let system = System::builtin(name).unwrap();
        if system.definition().second().is_some() {
            continue;
        }
        let start = system.definition().start().unwrap().to_vec();
        match system.dimension() {
            2 => same_in_all_units::<2, 3>(name, &start),
            3 => same_in_all_units::<3, 4>(name, &start),
            4 => same_in_all_units::<4, 5>(name, &start),
            n => panic!("{name}: {n} states"),
        }
        tried += 1;
    }
    assert!(tried >= 8, "{tried}");
}

const CLOCK: &str = "papers/giaouris-2008/systems/buck-clock.toml";

/// A system's file in other units: its states times `unit`, its switching functions times `factor`.
fn file_in_units(name: &str, unit: f64, factor: f64) -> String {
    let text = || {
        std::fs::read_to_string(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(name))
            .unwrap()
    };
    let system = System::builtin(name).unwrap_or_else(|| {
        System::new(twofold::system::Definition::from_toml(&text(), name).unwrap())
    });
    let mut file: toml::Table = toml::from_str(&system.definition().to_toml()).unwrap();
    let states: Vec<String> = system.definition().states().iter().map(|s| s.name.clone()).collect();
    let lets =
        file.entry("let").or_insert_with(|| toml::Table::new().into()).as_table_mut().unwrap();
    for state in &states {
        lets.insert(state.clone(), format!("scaled_{state}/{unit:e}").into());
    }
    let scale =
        |value: &toml::Value, by: f64| format!("{by:e}*({})", value.as_str().unwrap()).into();
    let rescale = |table: &mut toml::Table| {
        table["h"] = scale(&table["h"], factor);
        for side in ["plus", "minus"] {
            let fields = table[side].as_array().unwrap();
            table[side] =
                fields.iter().map(|f| scale(f, unit)).collect::<Vec<toml::Value>>().into();
        }
    };
    rescale(&mut file);
    if let Some(second) = file.get_mut("second") {
        rescale(second.as_table_mut().unwrap());
    }
    let start = system.definition().start().unwrap().iter().map(|x| x * unit).collect::<Vec<_>>();
    file["start"] = start.into();
    file["states"] = states.iter().map(|s| format!("scaled_{s}")).collect::<Vec<_>>().into();
    file.remove("axes");
    serde_json::to_string(&file).unwrap()
}

/// The systems with two surfaces, and a buck converter whose clock, two of its states, restarts,
/// with a smoothed switch.
#[test]
fn units_change_nothing_of_two_surfaces_and_of_a_clock() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scaled.json");
    let end = |name: &str, unit: f64, factor: f64| -> Vec<f64> {
        std::fs::write(&file, file_in_units(name, unit, factor)).unwrap();
        let (eps, atol) = (format!("{:e}", 1e-2 * factor), format!("{:e}", 1e-10 * unit));
        let switch: &[&str] = if name == CLOCK {
            &["--eps", &eps, "--t-end", "2"]
        } else {
            &["--switch", "filippov", "--t-end", "6"]
        };
        let run = std::process::Command::new(env!("CARGO_BIN_EXE_twofold"))
            .args([
                "run", "--quiet", "--method", "dopri5", "--rtol", "1e-10", "--atol", &atol,
                "--out", "-", "--system",
            ])
            .arg(&file)
            .args(switch)
            .output()
            .unwrap();
        assert!(
            run.status.success(),
            "{name}, {unit:e}, {factor:e}: {}",
            String::from_utf8_lossy(&run.stderr)
        );
        let text = String::from_utf8(run.stdout).unwrap();
        let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
        let row: Vec<&str> =
            text.lines().rfind(|l| !l.starts_with('#')).unwrap().split(',').collect();
        let states = names.iter().zip(row).filter(|(name, _)| name.starts_with("scaled_"));
        states.map(|(_, v)| v.parse::<f64>().unwrap() / unit).collect()
    };
    let mut names: Vec<&str> = twofold::system::library::names().collect();
    names.retain(|name| System::builtin(name).unwrap().definition().second().is_some());
    names.push(CLOCK);
    assert_eq!(names.len(), 3, "{names:?}");
    for name in names {
        let expected = end(name, 1.0, 1.0);
        for (unit, factor) in [(1e-12, 1.0), (1e12, 1.0), (1.0, 1e-12), (1.0, 1e12), (1e-9, 1e9)] {
            let found = end(name, unit, factor);
            for (a, b) in expected.iter().zip(&found) {
                assert!(
                    (a - b).abs() < 1e-6 * (1.0 + a.abs()),
                    "{name}, {unit:e}, {factor:e}: {found:?}, {expected:?}"
                );
            }
        }
    }
}

/// The end of a field's domain that a flight comes to is named, with time and state.
#[test]
fn a_flight_that_leaves_the_domain_says_which_expression_ends_where() {
    for (plus, what) in [(["1 + 0*sqrt(y)", "-1"], "sqrt(y)"), (["1", "-1 + ln(y)/1000"], "ln(y)")]
    {
        let error = go::<_, 2, 3>(
            &planar("x", plus, ["1", "-1"]),
            Vector2::new(1.0, 1.0),
            3.0,
            &settings(1e-9),
        )
        .0
        .unwrap_err();
        let said = error.to_string();
        assert!(said.contains(what) && said.contains("t = ") && said.contains("state ["), "{said}");
    }
}
