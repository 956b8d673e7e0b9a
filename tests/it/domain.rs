//! The end of an equation's domain is named: which expression has no value, when, and in which
//! state.

use assert_cmd::Command;

/// Every way to follow a switch that takes such fields.
const SWITCHES: [&str; 9] = [
    "--switch filippov",
    "--switch smoothed --method dopri5",
    "--switch smoothed --method lsoda",
    "--switch smoothed --method radau5",
    "--switch smoothed --method taylor",
    "--switch hysteretic --method lsoda",
    "--switch delayed --delay 0.01",
    "--switch delayed --delay 0.01 --method taylor",
    "--switch delayed --delay 0.01 --eps 0.1 --method dopri5",
];

/// x slides on x = 0, or flies away from it; (y, z) begins at (1, 1).
fn run(slides: bool, [y, z]: [&str; 2], switch: &str, t_end: f64) -> (i32, String, Vec<f64>) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("system.toml");
    let plus = if slides { "-1" } else { "1" };
    let text = format!(
        "name = \"case\"\nstates = [\"x\", \"y\", \"z\"]\nstart = [0.3, 1, 1]\nh = \"x\"\n\
         plus = [{plus:?}, {y:?}, {z:?}]\nminus = [\"1\", {y:?}, {z:?}]\n"
    );
    std::fs::write(&file, text).unwrap();
    let mut command = Command::cargo_bin("twofold").unwrap();
    command
        .args(["run", "--quiet", "--every", "0.1", "--t-end", &t_end.to_string()])
        .args(switch.split(' '));
    let output = command.arg("--system").arg(&file).output().unwrap();
    let rows = String::from_utf8(output.stdout).unwrap();
    let last = rows.lines().rfind(|line| !line.starts_with('#')).unwrap();
    let last = last.split(',').take(4).map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
    (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap(), last)
}

/// Fields, the expression whose domain ends, and when it does.
const ENDS: [([&str; 2], &str, f64); 8] = [
    (["-1/y", "1"], "-1/y", 0.5),
    (["-1/y^2", "1"], "-1/y^2", 1.0 / 3.0),
    (["-1", "1/y"], "1/y", 1.0),
    (["-1/(2 - z)", "1"], "-1/(2 - z)", 1.0),
    (["-1", "1 + sqrt(y)/10"], "sqrt(y)", 1.0),
    // Where the state is far larger than its distance from the end.
    (["1", "1 + sqrt(2 - y)/10"], "sqrt(2 - y)", 1.0),
    // e E1(1).
    (["ln(y) - 1", "1"], "ln(y)", 0.596_347_362_323_194),
    (["-1", "1 + 1/sqrt(y)"], "sqrt(y)", 1.0),
];

#[test]
fn the_end_of_a_domain_is_named_by_every_switch() {
    for (fields, what, t) in ENDS {
        for switch in SWITCHES {
            for slides in [true, false] {
                let (code, said, _) = run(slides, fields, switch, 3.0);
                let named = said.contains("the end of the field's domain") && said.contains(what);
                assert!(
                    code == 3 && named && said.contains("state ["),
                    "{fields:?}, {switch}: {said}"
                );
                let time = said.split("t = ").nth(1).unwrap().split(',').next().unwrap();
                // The default tolerances move y by 1e-6 or less, and the time by no more.
                assert!(
                    (time.parse::<f64>().unwrap() - t).abs() < 2e-6,
                    "{fields:?}, {switch}: {said}"
                );
            }
        }
    }
}

/// At a zero of a divisor the motion goes on if the equation is bounded: z' = sin(y)/y has z(2) = 1
/// + 2 Si(1).
#[test]
fn a_zero_of_a_divisor_need_not_be_the_end() {
    const SI: f64 = 0.946_083_070_367_183;
    for switch in SWITCHES.iter().filter(|switch| !switch.contains("taylor")) {
        for slides in [true, false] {
            let (code, said, last) = run(slides, ["-1", "sin(y - 0.01)/(y - 0.01)"], switch, 2.0);
            assert_eq!(code, 0, "{switch}: {said}");
            let si = |x: f64| {
                (0..12)
                    .fold((x, 0.0), |(term, sum), k| {
                        let n = f64::from(2 * k + 1);
                        (-term * x * x / ((n + 1.0) * (n + 2.0)), sum + term / n)
                    })
                    .1
            };
            let z = 1.0 + si(0.99) + si(1.01);
            assert!(
                (si(1.0) - SI).abs() < 1e-14 && (last[3] - z).abs() < 1e-6,
                "{switch}: {last:?}, {z}"
            );
        }
    }
}
