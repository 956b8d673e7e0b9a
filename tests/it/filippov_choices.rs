//! Decisions of a Filippov run, and those that it leaves to the user: values known in closed form.

use assert_cmd::Command;

/// The end of `twofold run` with the discontinuous system of this definition.
struct End {
    code: i32,
    err: String,
    rows: Vec<Vec<f64>>,
}

/// `fields`: f+ and f-, or those of the signs ++, -+, +-, -- of two functions. Columns of the rows:
/// time and states.
fn run(
    states: &[&str],
    start: &str,
    h: &[&str],
    fields: &[&[&str]],
    t_end: f64,
    exit: Option<&str>,
) -> End {
    run_by("--switch filippov", states, start, h, fields, t_end, exit)
}

fn run_by(
    rule: &str,
    states: &[&str],
    start: &str,
    h: &[&str],
    fields: &[&[&str]],
    t_end: f64,
    exit: Option<&str>,
) -> End {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("system.toml");
    let mut text = format!("name = \"case\"\nstates = {states:?}\nstart = [{start}]\n");
    for (k, h) in h.iter().enumerate() {
        let second = if k == 1 { "[second]\n" } else { "" };
        text += &format!(
            "{second}h = {h:?}\nplus = {:?}\nminus = {:?}\n",
            fields[2 * k],
            fields[2 * k + 1]
        );
    }
    std::fs::write(&file, text).unwrap();
    let mut command = Command::cargo_bin("twofold").unwrap();
    command
        .args(["run", "--quiet", "--t-end", &t_end.to_string()])
        .args(rule.split(' '))
        .arg("--system")
        .arg(&file);
    if let Some(rule) = exit {
        command.args(["--exit", rule]);
    }
    let output = command.output().unwrap();
    let out = String::from_utf8(output.stdout).unwrap();
    let lines = out.lines().filter(|line| !line.starts_with('#')).skip(1);
    let row = |line: &str| {
        line.split(',').take(1 + states.len()).map(|cell| cell.parse().unwrap()).collect()
    };
    End {
        code: output.status.code().unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
        rows: lines.map(row).collect(),
    }
}

impl End {
    #[track_caller]
    fn is(&self, state: &[f64], tolerance: f64) {
        assert_eq!(self.code, 0, "{}", self.err);
        let last = self.rows.last().unwrap();
        let near = last[1..].iter().zip(state).all(|(a, b)| (a - b).abs() <= tolerance);
        assert!(near, "{last:?}, not {state:?}");
    }

    /// An error of the computation that says all of this.
    #[track_caller]
    fn says(&self, words: &[&str]) {
        assert_eq!(self.code, 3, "{}", self.err);
        for word in words.iter().chain(&["t = ", "state ["]) {
            assert!(self.err.contains(word), "no {word:?} in {}", self.err);
        }
    }
}

const XY: [&str; 2] = ["x", "y"];
const XYZ: [&str; 3] = ["x", "y", "z"];
const QUADRANTS: [&str; 2] = ["x", "y"];

/// Tolerance of motion that is linear between events: rounding, and the default tolerance at
/// events.
const LINEAR: f64 = 1e-9;

#[test]
fn corners_that_all_fields_cross_are_crossed() {
    let fields: [&[&str]; 4] = [&["1", "3"], &["1", "1"], &["3", "1"], &["2", "1"]];
    run(&XY, "-2, -1", &QUADRANTS, &fields, 2.0, None).is(&[1.0, 3.0], LINEAR);
    // In other units of both functions.
    run(&XY, "-2, -1", &["1e-6*x", "4e5*y"], &fields, 2.0, None).is(&[1.0, 3.0], LINEAR);
    // Surfaces that are not at right angles to the axes, and a third state.
    let fields: [&[&str]; 4] =
        [&["3", "0", "5"], &["1", "0.2", "1"], &["1", "-0.2", "1"], &["1", "0", "1"]];
    run(&XYZ, "-1, 0, 0", &["x + y", "x - y"], &fields, 2.0, None).is(&[3.0, 0.0, 6.0], LINEAR);
}

#[test]
fn additive_switches_slide_on_both_surfaces() {
    let fields: [&[&str]; 4] = [&["-2", "-0.5"], &["2", "-0.5"], &["-2", "0.5"], &["2", "0.5"]];
    run(&XY, "1, 1", &QUADRANTS, &fields, 3.0, None).is(&[0.0, 0.0], LINEAR);
    // x' = 1 - 2 sign x, y' = -1/2 - sign y, z' = 3 + sign x + 2 sign y: signs of mean 1/2 and -1/2
    // on the intersection.
    let fields: [&[&str]; 4] =
        [&["-1", "-1.5", "6"], &["3", "-1.5", "4"], &["-1", "0.5", "2"], &["3", "0.5", "0"]];
    run(&XYZ, "1, 1, 0", &QUADRANTS, &fields, 3.0, None).is(&[0.0, 0.0, 10.0], LINEAR);
    // The same in another order of the surfaces.
    let [pp, mp, pm, mm] = fields;
    run(&XYZ, "1, 1, 0", &["y", "x"], &[pp, pm, mp, mm], 3.0, None).is(&[0.0, 0.0, 10.0], LINEAR);
}

#[test]
fn sliding_on_both_surfaces_ends_where_one_no_longer_attracts() {
    // x' = z/2 - sign x leaves x = 0 at z = 2: x = (t - 2)^2/4. y' = -sign y stays.
    let fields: [&[&str]; 4] = [
        &["z/2 - 1", "-1", "1"],
        &["z/2 + 1", "-1", "1"],
        &["z/2 - 1", "1", "1"],
        &["z/2 + 1", "1", "1"],
    ];
    run(&XYZ, "0.5, 0.3, 0", &QUADRANTS, &fields, 4.0, None).is(&[1.0, 0.0, 4.0], 1e-6);
    run(&XYZ, "0.5, 0.3, 0", &QUADRANTS, &fields, 1.9, None).is(&[0.0, 0.0, 1.9], LINEAR);
    // To the other side, from below.
    let fields: [&[&str]; 4] = [
        &["-z/2 - 1", "-3", "1"],
        &["1 - z/2", "-3", "1"],
        &["-z/2 - 1", "1", "1"],
        &["1 - z/2", "1", "1"],
    ];
    run(&XYZ, "-0.5, 0.3, 0", &QUADRANTS, &fields, 4.0, None).is(&[-1.0, 0.0, 4.0], 1e-6);
}

#[test]
fn twisting_comes_to_rest() {
    // x'' = -3 sign x - sign x'.
    let fields: [&[&str]; 4] = [&["v", "-4"], &["v", "-2"], &["v", "2"], &["v", "4"]];
    run(&["x", "v"], "0, 2", &["v", "x"], &fields, 20.0, None).is(&[0.0, 0.0], 1e-6);
    // x'' = -5 sign x - 2 sign x', in other units.
    let fields: [&[&str]; 4] = [&["v", "-7"], &["v", "3"], &["v", "-3"], &["v", "7"]];
    run(&["x", "v"], "-30, 1", &["1e3*x", "v"], &fields, 60.0, None).is(&[0.0, 0.0], 1e-6);
    // Spirals of constant fields that contract by 1/16 with each turn.
    let fields: [&[&str]; 4] = [&["-2", "1"], &["-1", "-2"], &["1", "2"], &["2", "-1"]];
    run(&XY, "1, 0.5", &QUADRANTS, &fields, 20.0, None).is(&[0.0, 0.0], 1e-6);
}

#[test]
fn where_several_motions_are_possible_all_are_listed() {
    let away: [&[&str]; 4] = [&["1", "1"], &["-1", "1"], &["1", "-1"], &["-1", "-1"]];
    let end = run(&XY, "0, 0", &QUADRANTS, &away, 1.0, None);
    end.says(&[
        "h > 0, the second h > 0",
        "h < 0, the second h < 0",
        "repelling sliding on h = 0",
        "--start",
    ]);
    // An exit rule does not choose at an intersection.
    run(&XY, "0, 0", &QUADRANTS, &away, 1.0, Some("at-once:plus"))
        .says(&["not decided", "flight with the field of"]);
    // z' depends on the product of the signs, which a mixture leaves open.
    let product: [&[&str]; 4] =
        [&["-1", "-1", "1"], &["1", "-1", "0"], &["-1", "1", "0"], &["1", "1", "1"]];
    let end = run(&XYZ, "1, 2, 0", &QUADRANTS, &product, 3.0, None);
    end.says(&["t = 2", "different velocities"]);
    assert!((end.rows.last().unwrap()[0] - 2.0).abs() < 1e-6, "rows up to there are kept");
    // Turns that neither contract nor expand.
    let square: [&[&str]; 4] = [&["-1", "1"], &["-1", "-1"], &["1", "1"], &["1", "-1"]];
    run(&XY, "0, 0", &QUADRANTS, &square, 1.0, None).says(&["neither contract nor expand"]);
}

#[test]
fn fields_are_asked_on_their_own_side_only() {
    let y = ["y"];
    // sqrt u falls at speed 1 from 2 to 0, where u stays.
    run(&y, "4", &["y"], &[&["-2*sqrt(y)"], &["sqrt(-y)"]], 3.0, None).is(&[0.0], 1e-6);
    // From 4 to 3 in 2 (1 - ln 2), then at speed 1.
    let fall = 2.0 - 2.0 * (1.0 - std::f64::consts::LN_2);
    run(&y, "4", &["y - 3"], &[&["-1 - sqrt(y - 3)"], &["-1"]], 2.0, None).is(&[3.0 - fall], 1e-6);
    // Attracting sliding at the end of a field's domain.
    let fields: [&[&str]; 2] = [&["-1 - sqrt(y)", "1"], &["2", "4"]];
    run(&["y", "z"], "0, 0", &["y"], &fields, 3.0, None).is(&[0.0, 6.0], 1e-6);
    // From below, with y' = 1 + sqrt(-y).
    run(&y, "-1", &["y"], &[&["1"], &["1 + sqrt(-y)"]], 2.0, None).is(&[fall], 1e-6);
}

/// Friction that both fields write with the sign of h itself: a block that comes to rest at x = 1.2
/// - sqrt(1.94), by every rule.
#[test]
fn the_sign_of_h_in_a_field_is_that_of_its_side() {
    let rest = [1.2 - 1.94_f64.sqrt(), 0.0];
    let friction: [&[&str]; 2] = [&["v", "-x - 0.4*sign(v)"]; 2];
    let states = ["x", "v"];
    run(&states, "0.9, 0.5", &["v"], &friction, 20.0, None).is(&rest, 1e-6);
    let half: [&[&str]; 2] =
        [&["v", "-x - 0.1 - 0.3*sign(2*v)"], &["v", "-x + 0.1 - 0.3*sign(2*v)"]];
    run(&states, "0.9, 0.5", &["v"], &half, 20.0, None).is(&rest, 1e-6);
    for method in ["lsoda", "radau5", "taylor"] {
        // In the layer x creeps at speed eps atanh(x/0.4), 16.5 time units long.
        let rule = format!("--switch smoothed --eps 1e-5 --method {method} --max-steps 400000");
        run_by(&rule, &states, "0.9, 0.5", &["v"], &friction, 20.0, None).is(&rest, 2e-4);
    }
}

#[test]
fn no_rule_is_needed_where_nothing_is_chosen() {
    // Parabolas of quarter period 1.
    run(&["x", "v"], "1, 0", &["x"], &[&["v", "-2"], &["v", "2"]], 4.5, None)
        .is(&[0.75, -1.0], 1e-6);
    let pair: [&[&str]; 2] = [&["-1", "1"], &["1", "-2"]];
    run(&XY, "2, 1", &["x - y"], &pair, 1.0, None).is(&[1.4, 1.4], LINEAR);
    // Sliding that ends at a visible fold: leaves tangentially at x = 1/2.
    let fold: [&[&str]; 2] = [&["1", "x - 0.5"], &["1", "1"]];
    run(&XY, "0, 0", &["y"], &fold, 1.5, None).is(&[1.5, 0.5], 1e-6);
}

#[test]
fn a_rule_is_asked_for_where_one_is_needed() {
    let words = ["repelling sliding", "flight to h > 0", "flight to h < 0", "--exit"];
    run(&["y"], "0", &["y"], &[&["1"], &["-1"]], 1.0, None).says(&words);
    let fused: [&[&str]; 2] = [&["1", "2*x"], &["1", "-x"]];
    let end = run(&XY, "-1, 0.2", &["y"], &fused, 2.0, None);
    end.says(&words);
    end.says(&["fused folds", "visible"]);
    let last = end.rows.last().unwrap();
    assert!((last[0] - 1.0).abs() < 1e-6 && end.rows.len() > 2, "{last:?}");
}

#[test]
fn fused_visible_folds_follow_the_rule() {
    let fused: [&[&str]; 2] = [&["1", "2*x"], &["1", "-x"]];
    let end = |rule| run(&XY, "-1, 0.2", &["y"], &fused, 2.0, Some(rule));
    end("at-once:plus").is(&[1.0, 1.0], 1e-6);
    end("at-once:minus").is(&[1.0, -0.5], 1e-6);
    end("after-time:0.5:plus").is(&[1.0, 0.75], 1e-6);
    end("after-time:5:minus").is(&[1.0, 0.0], 1e-6);
}

#[test]
fn a_jump_of_the_switching_function_is_called_a_jump() {
    for h in ["x + 2*sign(1 - s)", "x - 5 + 4.5*sign(1 - s) + s"] {
        let end =
            run(&["x", "s"], "1, 0", &[h], &[&["0", "1"], &["0", "1"]], 2.0, Some("at-once:plus"));
        end.says(&["jumps", "--switch smoothed"]);
        assert!(!end.err.contains("cusp"), "{}", end.err);
    }
}
