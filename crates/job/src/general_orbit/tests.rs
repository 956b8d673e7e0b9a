use super::*;
use crate::Executor;
use crate::general::expression;
use std::sync::Arc;
use twofold_hybrid::Definition;

fn run(text: &str, t_end: f64) -> GeneralRun {
    let model = Model::new(Definition::from_toml(text, "f").unwrap());
    GeneralRun { model, options: Options { t_end, ..Options::default() } }
}

const DRIVEN: &str = "states = ['x']\nstart = [0]\nf = ['-x + 4*if(mod(t, 1) < 0.5, 1, 0)']";

/// x' = -x + 4 in the first half of each period of 1, -x in the other: the multiplier is 1/e,
/// and from x at the period's start it is x/e + 4 (1 - e^(-1/2)) e^(-1/2) at its end.
#[test]
fn a_driven_orbit_closes_as_its_formula_says() {
    let question = GeneralOrbit {
        run: run(DRIVEN, 10.0),
        settle: 0.5,
        after: Return::Period(1.0),
        along: None,
    };
    let answer = Executor::quiet().ask(&question).unwrap();
    let point: Vec<f64> = answer.fact("point").unwrap();
    let multipliers: Vec<[f64; 2]> = answer.fact("multipliers").unwrap();
    let half = (-0.5_f64).exp();
    let expected = 4.0 * (1.0 - half) * half / (1.0 - half * half);
    assert!((point[0] - expected).abs() < 1e-9, "{point:?} {expected}");
    assert!((multipliers[0][0] - half * half).abs() < 1e-8, "{multipliers:?}");
    // After a period from zero the distance is 1/e of the point, and the state is at most
    // e^(1/2) as large as there.
    let moved: f64 = answer.fact("moved").unwrap();
    assert!((moved - half * half * half).abs() < 1e-6, "{moved}");
    let settled = Executor::quiet().ask(&GeneralOrbit { settle: 10.0, ..question }).unwrap();
    assert!(settled.fact::<f64>("moved").is_err());
}

fn orbit(text: &str, settle: f64, after: Return) -> Result<Arc<Answer>, JobError> {
    let mut run = run(text, 1e3);
    if let Return::Crossings(_) = after {
        run.options.record = Record::Section(expression("x", &run.model).unwrap());
    }
    Executor::quiet().ask(&GeneralOrbit { run, settle, after, along: None })
}

/// The normal form of a torus bifurcation as a map, with eigenvalues (1 + m) exp(+-1.3 i), from
/// where it has settled on zero, one state from zero.
#[test]
fn a_branch_begins_where_the_motion_settles_on_zero() {
    let text = "states = ['x', 'y']\nstart = [0.3, 0]\nf = ['0', '0']\n[parameters]\n\
        m = -0.2\na = 1.3\n[let]\nq = '1 + m - x^2 - y^2'\n[[event]]\nevery = 1\n\
        set = { x = 'q*(cos(a)*x - sin(a)*y)', y = 'q*(sin(a)*x + cos(a)*y)' }";
    let along = Along { parameter: "m".into(), from: -0.2, to: 0.5, steps: 20, most: 1000 };
    let question = GeneralOrbit {
        run: run(text, 1e3),
        settle: 200.0,
        after: Return::Period(1.0),
        along: Some(along),
    };
    let answer = Executor::quiet().ask(&question).unwrap();
    assert_eq!(answer.fact::<End>("end").unwrap(), End::Reached);
    let changes = answer.table("bifurcations").unwrap();
    assert_eq!(changes.words("change").collect::<Vec<_>>(), ["torus"]);
    assert!(changes.numbers("m")[0].abs() < 1e-9);
}

/// Where the motion settles on a rest, or is on its way to one, it is said, whether it lies on
/// the section or beside it.
#[test]
fn a_rest_is_no_closed_orbit() {
    for damping in ["0.02", "0.2", "1.5"] {
        for at in ["0", "1", "-1e-3"] {
            let f = format!("states = ['x', 'v']\nstart = [1.5, 0]\nf = ['v', '{at} - x");
            for f in [format!("{f} - {damping}*v']"), format!("{f} - {damping}*v - 0*sign(x)']")] {
                for settle in [20.0, 200.0] {
                    let answer = orbit(&f, settle, Return::Crossings(1)).unwrap();
                    let rest: Rest = answer.fact("rest").unwrap();
                    let at: f64 = at.parse().unwrap();
                    assert!((rest.state[0] - at).abs() < 1e-9, "{rest:?} {f}");
                    assert_eq!(rest.stability, Stability::Attracts, "{f}");
                }
            }
        }
    }
}

/// The slowest neighbours say how fast a rest attracts; of a set of rests each has its own.
#[test]
fn the_rate_of_a_rest_is_that_of_the_slowest() {
    let text = "states = ['x', 'y']\nstart = [1, 1]\nf = ['-3*x', '-0.5*y']";
    let rest: Rest = orbit(text, 100.0, Return::Crossings(1)).unwrap().fact("rest").unwrap();
    assert!((rest.rate().unwrap() - 0.5).abs() < 1e-9, "{rest:?}");
    let text = "states = ['x', 'y']\nstart = [1, 1]\nf = ['-3*x + 0.1*y', '0*x']";
    let rest: Rest = orbit(text, 100.0, Return::Crossings(1)).unwrap().fact("rest").unwrap();
    assert_eq!(rest.stability, Stability::ToASet, "{rest:?}");
}

/// A sliding control at zero under a periodic force has a closed orbit: the rest, to which
/// x' = -2 x leads. States known to rounding alone are beside it.
#[test]
fn a_control_at_rest_has_a_period() {
    use std::f64::consts::TAU;
    let text = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '0.3*sin(t) - 2*sign(v + 2*x)']";
    for settle in [10.0, 200.0] {
        let answer = orbit(text, settle, Return::Period(TAU)).unwrap();
        let multipliers: Vec<[f64; 2]> = answer.fact("multipliers").unwrap();
        let right = twofold_num::elementary::exp(-2.0 * TAU);
        assert!((multipliers[0][0] - right).abs() < 1e-3 * right, "{multipliers:?}");
        assert!(multipliers[1][0].abs() < 1e-9, "{multipliers:?}");
        let point: Vec<f64> = answer.fact("point").unwrap();
        assert!(point.iter().all(|x| x.abs() < 1e-11), "{point:?}");
        assert!(answer.fact::<f64>("moved").is_err(), "{answer:?}");
    }
}

/// Motion that drifts for ever is on no orbit, however far away what it drifts by is rounding.
#[test]
fn a_drift_is_no_closed_orbit() {
    let forced = "states = ['x1', 'v1', 'x2', 'v2']\nstart = [0, 0, 0, 0]\nf = ['v1', 'cos(t) \
        - (x1 - x2) - 0.1*(v1 - v2) + 0.1', 'v2', 'x1 - x2 + 0.1*(v1 - v2) - 0.2*v2']";
    let driven = "states = ['p', 'q', 'x1', 'v1', 'x2', 'v2']\nstart = [1, 0, 0, 0, 0, 0]\nf = \
        ['q', '(1 - p^2)*q - p', 'v1', 'p - (x1 - x2) - 0.3*(v1 - v2) - if(v1 > 0, 0.1, \
        0.5)*v1', 'v2', '-p + (x1 - x2) + 0.3*(v1 - v2) - if(v2 > 0, 0.1, 0.5)*v2']";
    let period = Return::Period(2.0 * std::f64::consts::PI);
    let by_section = |text: &str, section: &str| {
        let mut run = run(text, 1e3);
        run.options.record = Record::Section(expression(section, &run.model).unwrap());
        let after = Return::Crossings(1);
        Executor::quiet().ask(&GeneralOrbit { run, settle: 100.0, after, along: None })
    };
    for found in [orbit(forced, 600.0, period), by_section(driven, "p")] {
        let error = found.map(|answer| format!("{answer:?}")).unwrap_err().to_string();
        assert!(error.contains("no closed orbit"), "{error}");
    }
}

/// A state that comes back after a time that is no period of the equations is on no orbit.
#[test]
fn a_period_is_one_of_the_equations() {
    let field = "states = ['x']\nstart = [1]\nf = ['-x + cos(t)']";
    let clock = "states = ['x']\nstart = [0.3]\nf = ['0']\n[[event]]\nevery = 1\n\
        set = { x = '2.6*x*(1 - x)' }";
    // Its event has the same zeros with the other sign.
    let zeros = "states = ['x']\nstart = [0.3]\nf = ['-0.1*x']\n[[event]]\nwhen = 'cos(pi*t)'\n\
        set = { x = '2.6*x*(1 - x)' }";
    let switch = "states = ['x']\nstart = [12]\nf = ['if(x > 20 + mod(t, 4), -x, 24 - x)']";
    for (text, wrong, right) in [
        (field, 3.0, 2.0 * std::f64::consts::PI),
        (field, 6.25, 4.0 * std::f64::consts::PI),
        (clock, 0.5, 2.0),
        (clock, 1.5, 1.0),
        (switch, 3.0, 4.0),
        (zeros, 0.5, 1.0),
    ] {
        let said = orbit(text, 20.0, Return::Period(wrong)).unwrap_err().to_string();
        assert!(said.contains(&format!("is not the same {wrong} later")), "{said}");
        assert!(orbit(text, 20.0, Return::Period(right)).is_ok(), "{text}");
    }
}

/// Through a section where an event resets, from which the search begins: from 0 to 1 in ln 2.
#[test]
fn a_section_may_be_where_an_event_is() {
    let text = "states = ['v', 'w']\nstart = [0, 0]\nf = ['2 - v', 'v - w']\n[[event]]\n\
        when = 'v > 1'\nset = { v = '0' }";
    for at in ["1", "0.5"] {
        let mut run = run(text, 1e3);
        run.options.record = Record::Section(expression(&format!("v - {at}"), &run.model).unwrap());
        let question =
            GeneralOrbit { run, settle: 200.0, after: Return::Crossings(1), along: None };
        let period: f64 = Executor::quiet().ask(&question).unwrap().fact("period").unwrap();
        assert!((period - 2_f64.ln()).abs() < 1e-9, "{at} {period}");
    }
}

/// Settling ends in the second mode, from which the first one would not come back.
/// Up to 1 and down to -1 twice as fast, whenever settling ends: also at the ends.
#[test]
fn no_event_is_lost_at_the_end_of_settling() {
    let text = "states = ['x']\nstart = [0]\n[modes.u]\nf = ['1']\n[modes.d]\nf = ['-2']\n\
        [[event]]\nfrom = 'u'\nwhen = 'x - 1'\nmode = 'd'\n\
        [[event]]\nfrom = 'd'\nwhen = 'x + 1'\nmode = 'u'";
    for settle in [0.0, 0.5, 1.0, 2.0, 10.0, 200.0] {
        let mut run = run(text, 1000.0);
        run.options.record = Record::Section(expression("x", &run.model).unwrap());
        let question = GeneralOrbit { run, settle, after: Return::Crossings(1), along: None };
        let period: f64 = Executor::quiet().ask(&question).unwrap().fact("period").unwrap();
        assert!((period - 3.0).abs() < 1e-9, "{settle}: {period}");
    }
}

#[test]
fn an_orbit_is_searched_in_the_mode_in_which_settling_ends() {
    let text = "states = ['x']\nstart = [0]\n[modes.a]\nf = ['1']\n[modes.b]\nf = ['1']\n\
        [[event]]\nfrom = 'a'\nwhen = 'x - 1'\ndirection = 'up'\nmode = 'b'\n\
        [[event]]\nfrom = 'b'\nwhen = 'x - 2'\ndirection = 'up'\nmode = 'a'\nset = { x = 0 }";
    let mut run = run(text, 10.0);
    run.options.record = Record::Section(expression("x - 0.5", &run.model).unwrap());
    let question = GeneralOrbit { run, settle: 1.5, after: Return::Crossings(1), along: None };
    let period: f64 = Executor::quiet().ask(&question).unwrap().fact("period").unwrap();
    assert!((period - 2.0).abs() < 1e-9, "{period}");
}

fn along(parameter: &str, from: f64, to: f64) -> Option<Along> {
    Some(Along { parameter: parameter.into(), from, to, steps: 10, most: 200 })
}

/// x halves in each period, then a kick makes of x/2 c x - x^3: of this map the fixed point
/// sqrt(c - 1) has the multiplier 3 - 2 c, which is -1 at c = 2.
#[test]
fn a_kicked_orbit_doubles_its_period_where_its_map_does() {
    let text = "states = ['x']\nstart = [0.7]\nf = ['-0.6931471805599453*x']\n[parameters]\nc \
        = 1.5\n\
        [[event]]\nevery = 1\nset = { x = '2*c*x - 8*x^3' }";
    let question = GeneralOrbit {
        run: run(text, 10.0),
        settle: 0.0,
        after: Return::Period(1.0),
        along: along("c", 1.4, 2.2),
    };
    let answer = Executor::quiet().ask(&question).unwrap();
    let (branch, changes) =
        (answer.table("branch").unwrap(), answer.table("bifurcations").unwrap());
    for ((c, x), m) in
        branch.numbers("c").iter().zip(branch.numbers("x")).zip(branch.numbers("multiplier1_re"))
    {
        assert!(
            (x - (c - 1.0).sqrt()).abs() < 1e-9 && (m - 3.0 + 2.0 * c).abs() < 1e-8,
            "{c} {x} {m}"
        );
    }
    assert_eq!(changes.words("change").collect::<Vec<_>>(), ["period-doubling"]);
    assert!((changes.numbers("c")[0] - 2.0).abs() < 1e-6, "{:?}", changes.numbers("c"));
}

/// Super-twisting comes to rest in finite time at a root's zero, which has no eigenvalues: an
/// orbit of rounding is none.
#[test]
fn rest_at_a_root_is_no_orbit() {
    let text = "states = ['x', 'y']\nstart = [1, 0]\n\
        f = ['y - 1.5*sign(x)*sqrt(abs(x))', '-1.1*sign(x)']";
    for section in ["y", "x", "x - 0.5", "y - 0.1"] {
        let mut run = run(text, 100.0);
        run.options.record = Record::Section(expression(section, &run.model).unwrap());
        let after = Return::Crossings(1);
        let question = GeneralOrbit { run, settle: 100.0, after, along: None };
        let said = Executor::quiet().ask(&question).unwrap_err().to_string();
        assert!(said.contains("the motion comes to rest at ["), "{section}: {said}");
    }
}

#[test]
fn a_branch_keeps_its_period() {
    let two_pi = 2.0 * std::f64::consts::PI;
    for (f, events, period) in [
        ("-x + sin(w*t)", "", two_pi),
        ("-x + if(mod(t, w) < 0.5, 1, 0)", "", 1.0),
        ("-x", "[[event]]\nevery = 'w'\nset = { x = 'x + 1' }", 1.0),
    ] {
        let text =
            format!("states = ['x']\nstart = [0]\nf = ['{f}']\n[parameters]\nw = 1\n{events}");
        let after = Return::Period(period);
        let along = along("w", 1.0, 1.5);
        let question = GeneralOrbit { run: run(&text, 1e3), settle: 0.0, after, along };
        let said = Executor::quiet().ask(&question).unwrap_err().to_string();
        assert!(said.contains("measure time in periods"), "{f}: {said}");
    }
    // In the drive's own time: the amplitude of the linear answer, at phase zero.
    let text = "states = ['x']\nstart = [0]\nf = ['(sin(t) - x)/w']\n[parameters]\nw = 1";
    let found = branch(text, two_pi, 100.0, along("w", 1.0, 1.5));
    let table = found.table("branch").unwrap();
    for (w, x) in table.numbers("w").iter().zip(table.numbers("x")) {
        assert!((x + w / (1.0 + w * w)).abs() < 1e-8, "{w}: {x}");
    }
}

fn branch(text: &str, period: f64, settle: f64, along: Option<Along>) -> Arc<Answer> {
    let after = Return::Period(period);
    let question = GeneralOrbit { run: run(text, 1e3), settle, after, along };
    Executor::quiet().ask(&question).unwrap()
}

fn changes_of(answer: &Answer, parameter: &str) -> Vec<(String, f64, f64)> {
    let table = answer.table("bifurcations").unwrap();
    let numbers = |name: &str| table.numbers(name).to_vec();
    let (at, within) = (numbers(parameter), numbers("uncertainty"));
    let words = table.words("change").map(str::to_owned);
    words.zip(at).zip(within).map(|((word, at), within)| (word, at, within)).collect()
}

/// Fixed points of maps are orbits of their period: r x (1 - x) has 1 - 1/r with the multiplier
/// 2 - r, Henon's map doubles at a = 3 (1 - b)^2 / 4.
#[test]
fn fixed_points_of_maps_are_followed() {
    let map = |states: &str, start: &str, set: &str, parameters: &str| {
        format!(
            "states = {states}\nstart = {start}\nf = [{}]\n[parameters]\n{parameters}\n\
             [[event]]\nevery = 1\nset = {{ {set} }}",
            if start.contains(',') { "'0', '0'" } else { "'0'" }
        )
    };
    let logistic = map("['x']", "[0.3]", "x = 'r*x*(1-x)'", "r = 2.5");
    let found = branch(&logistic, 1.0, 50.0, along("r", 2.5, 3.5));
    let table = found.table("branch").unwrap();
    for (r, x) in table.numbers("r").iter().zip(table.numbers("x")) {
        // Closed to 100 times the relative tolerance.
        assert!((x - (1.0 - 1.0 / r)).abs() < 1e-8, "{r} {x}");
    }
    let changes = changes_of(&found, "r");
    assert_eq!(changes.len(), 1, "{changes:?}");
    assert!(changes[0].0 == "period-doubling" && (changes[0].1 - 3.0).abs() < changes[0].2);
    // The trivial point loses its stability where the other one passes.
    let found = branch(&logistic, 1.0, 2000.0, along("r", 0.5, 1.5));
    let changes = changes_of(&found, "r");
    assert_eq!(changes.len(), 1, "{changes:?}");
    assert!(changes[0].0 == "branching" && (changes[0].1 - 1.0).abs() <= changes[0].2);
    let henon = map("['x', 'y']", "[0.1, 0.1]", "x = '1 - a*x^2 + y', y = '0.3*x'", "a = 0.2");
    let changes = changes_of(&branch(&henon, 1.0, 50.0, along("a", 0.2, 0.6)), "a");
    assert_eq!(changes.len(), 1, "{changes:?}");
    assert!(changes[0].0 == "period-doubling");
    assert!((changes[0].1 - 0.75 * 0.49).abs() <= changes[0].2, "{changes:?}");
}

/// In any units of the states: the logistic map in 10^-9, Henon's with a second state of
/// another size, a driven flow beside a state 100 times as large.
#[test]
fn branches_do_not_depend_on_units() {
    let one = |changes: Vec<(String, f64, f64)>, word: &str, right: f64| {
        assert_eq!(changes.len(), 1, "{changes:?}");
        assert_eq!(changes[0].0, word);
        assert!((changes[0].1 - right).abs() <= changes[0].2 && changes[0].2 < 1e-6, "{changes:?}");
    };
    let logistic = "states = ['x']\nstart = [3e-10]\nf = ['0']\n[parameters]\nr = 2.7\n\
        [[event]]\nevery = 1\nset = { x = 'r*x*(1 - 1e9*x)' }";
    let found = branch(logistic, 1.0, 300.0, along("r", 2.7, 3.3));
    one(changes_of(&found, "r"), "period-doubling", 3.0);
    for unit in ["1e-6", "1e-3", "1e3", "1e6"] {
        let henon = format!(
            "states = ['x', 'y']\nstart = [0.1, '0.1*{unit}']\nf = ['0', '0']\n\
             [parameters]\na = 0.2\n[[event]]\nevery = 1\n\
             set = {{ x = '1 - a*x^2 + y/{unit}', y = '0.3*x*{unit}' }}"
        );
        let found = branch(&henon, 1.0, 2000.0, along("a", 0.2, 0.6));
        one(changes_of(&found, "a"), "period-doubling", 0.75 * 0.49);
    }
    let beside = "states = ['x', 'y']\nstart = [-1.3, 0]\n\
        f = ['p + x - x^3', '-y + 1e3*sin(2*pi*t)']\n[parameters]\np = -0.6";
    let changes = changes_of(&branch(beside, 1.0, 60.0, along("p", -0.6, 0.6)), "p");
    assert_eq!(changes.len(), 2, "{changes:?}");
    for ((word, at, within), sign) in changes.into_iter().zip([1.0, -1.0]) {
        let right = sign * 2.0 / 27.0_f64.sqrt();
        assert!(word == "fold" && (at - right).abs() <= within, "{at} {within}");
    }
}

/// Behind its saddle-node at 1 + sqrt(8) the logistic map has no orbit of period 3, though each
/// point nearly comes back: the branch turns back there. Orbits of 16 turns double where their
/// multiplier is -1 (r of Newton's method in 40 digits).
#[test]
fn branches_end_at_folds_and_hold_their_values() {
    let logistic = |start: f64| {
        format!(
            "states = ['x']\nstart = [{start}]\nf = ['0']\n[parameters]\nr = 3.8289\n\
             [[event]]\nevery = 1\nset = {{ x = 'r*x*(1 - x)' }}"
        )
    };
    let fold = 1.0 + 8.0_f64.sqrt();
    // All three points of the orbit.
    for start in [0.514, 0.956, 0.16] {
        for (from, to) in [(3.8289, 3.8279), (3.8286, 3.8283), (3.84, 3.82)] {
            let found = branch(&logistic(start), 3.0, 3e4, along("r", from, to));
            assert!(found.table("branch").unwrap().numbers("r").iter().all(|r| *r > fold));
            let changes = changes_of(&found, "r");
            assert_eq!(changes.len(), 1, "{start} {from} {changes:?}");
            assert_eq!(changes[0].0, "fold");
            assert!((changes[0].1 - fold).abs() <= changes[0].2, "{changes:?}");
        }
    }
    let found = branch(&logistic(0.5), 16.0, 2e4, along("r", 3.5675, 3.569));
    let changes = changes_of(&found, "r");
    assert_eq!(changes.len(), 1, "{changes:?}");
    assert_eq!(changes[0].0, "period-doubling");
    assert!((changes[0].1 - 3.568759419543826).abs() <= changes[0].2, "{changes:?}");
    assert!(changes[0].2 < 1e-9, "{changes:?}");
}

/// The multiplier of the piecewise linear map jumps from 1/2 to -3/2 or 3/2 where its fixed
/// point meets the border (Nusse & Yorke 1992).
#[test]
fn border_collisions_are_discontinuity_induced() {
    for slope in ["-1.5", "-0.7", "0.2"] {
        let text = format!(
            "states = ['x']\nstart = [-1]\nf = ['0']\n[parameters]\nm = -0.5\n[[event]]\n\
             every = 1\nset = {{ x = 'm + if(x < 0, 0.5*x, {slope}*x)' }}"
        );
        let changes = changes_of(&branch(&text, 1.0, 50.0, along("m", -0.5, 0.5)), "m");
        assert_eq!(changes.len(), 1, "{slope} {changes:?}");
        assert_eq!(changes[0].0, "discontinuity-induced", "{slope}");
        assert!(changes[0].1.abs() <= changes[0].2 && changes[0].2 < 1e-4, "{changes:?}");
    }
}

/// The same wherever the border lies in the parameter; where the branch turns back at it the
/// interval holds it, too.
#[test]
fn borders_lie_anywhere() {
    for (at, low, high) in [
        ("0.414", "0.705", "-1.84"),
        ("-3", "-0.125", "0.821"),
        ("0.02", "0.5", "-1.5"),
        ("0", "0.383", "1.928"),
        ("0", "0.5", "1.6"),
    ] {
        let border: f64 = at.parse().unwrap();
        let text = format!(
            "states = ['x']\nstart = [-1]\nf = ['0']\n[parameters]\nm = {}\n[[event]]\n\
             every = 1\nset = {{ x = 'm - ({at}) + if(x < 0, {low}*x, {high}*x)' }}",
            border - 0.1
        );
        let found = branch(&text, 1.0, 200.0, along("m", border - 0.1, border + 0.1));
        let changes = changes_of(&found, "m");
        assert_eq!(changes.len(), 1, "{text} {changes:?}");
        assert_eq!(changes[0].0, "discontinuity-induced", "{text}");
        let off = (changes[0].1 - border).abs();
        assert!(off <= changes[0].2 && changes[0].2 < 1e-4, "{text} {changes:?}");
    }
}

/// Flows that are on one side of a kink all along and then on the other have no switch on
/// either: a branch that goes on, one that turns back, and a map's that turns at a state which
/// is not zero.
#[test]
fn borders_are_seen_without_a_switch() {
    let drive = "(m - 0.5)*(1 + 0.1*cos(2*pi*t))";
    let goes_on = format!(
        "states = ['x', 'v']\nstart = [-0.2, 0]\n\
         f = ['v', '-x - if(x > 0, -0.3, 0.3)*v + {drive}']\n[parameters]\nm = 0.3"
    );
    let turns = format!(
        "states = ['x']\nstart = [0.8]\nf = ['-(x - 1) + {drive} + 1.5*max(x - 1, 0)']\n\
         [parameters]\nm = 0.3"
    );
    let map = "states = ['x']\nstart = [1.6]\nf = ['0']\n[parameters]\nm = 0.3\n[[event]]\n\
        every = 1\nset = { x = '2 + m - 0.5 + if(x < 2, 0.5*(x - 2), 1.7*(x - 2))' }";
    for (text, turns) in [(goes_on.as_str(), false), (&turns, true), (map, true)] {
        let found = branch(text, 1.0, 60.0, along("m", 0.3, 0.7));
        let changes = changes_of(&found, "m");
        assert_eq!(changes.len(), 1, "{text} {changes:?}");
        assert_eq!(changes[0].0, "discontinuity-induced", "{text}");
        assert!((changes[0].1 - 0.5).abs() <= changes[0].2, "{text} {changes:?}");
        let end: End = found.fact("end").unwrap();
        assert_eq!(end, if turns { End::TurnedBack } else { End::Reached }, "{text}");
    }
}

/// Two equal blocks have two equal multipliers, exp(2 pi m): one point, m = 0. So has a pair of
/// them, - exp(2 pi m), that turns by half.
/// A wall at 0.5 that the orbit of x'' + 0.2 x' + x = p cos 2t touches where its amplitude
/// p/sqrt(9.16) is 0.5. Beyond no orbit is found from below; from above, where the largest
/// multiplier grows like one over the way, the branch goes on to those without impacts.
#[test]
fn an_orbit_that_comes_to_graze_a_wall_is_told() {
    let touches = 0.5 * 9.16_f64.sqrt();
    for (from, to, kind) in [(1.51, 1.52, "grazing"), (1.52, 1.51, "discontinuity-induced")] {
        let text = format!(
            "states = ['x', 'v']\nstart = [0.1, 0]\nf = ['v', 'p*cos(2*t) - 0.2*v - \
                x']\n[parameters]\np = {from}\n[[event]]\nwhen = 'x - 0.5'\ndirection = \
                'up'\nset = {{ v = '-0.8*v' }}"
        );
        let answer = branch(&text, std::f64::consts::PI, 100.0, along("p", from, to));
        let found = changes_of(&answer, "p");
        let (last, at, within) = found.last().unwrap();
        assert_eq!(last, kind, "{found:?}");
        assert!((at - touches).abs() <= *within && *within < 1e-6, "{found:?}");
    }
}

#[test]
fn equal_multipliers_pass_once() {
    let text = "states = ['x', 'y', 'z']\nstart = [0.1, 0.1, 0]\n\
        f = ['m*x - x^3', 'm*y - y^3', '-z + cos(t)']\n[parameters]\nm = -0.2";
    let along = || along("m", -0.2, 0.2);
    let changes = changes_of(&branch(text, 2.0 * std::f64::consts::PI, 100.0, along()), "m");
    assert_eq!(changes.len(), 1, "{changes:?}");
    assert!(changes[0].0 == "branching" && changes[0].1.abs() <= changes[0].2, "{changes:?}");
    let text = "states = ['x', 'y', 'z']\nstart = [0.1, 0.1, 0]\n\
        f = ['m*x - 0.5*y - x*(x^2 + y^2)', '0.5*x + m*y - y*(x^2 + y^2)', '-z + cos(t)']\n\
        [parameters]\nm = -0.2";
    let changes = changes_of(&branch(text, 2.0 * std::f64::consts::PI, 100.0, along()), "m");
    assert_eq!(changes.len(), 1, "{changes:?}");
    assert!(changes[0].0 == "period-doubling", "{changes:?}");
    assert!(changes[0].1.abs() <= changes[0].2, "{changes:?}");
}

/// A flag that alternates has the multiplier 1 of two turns all along; the transcritical point
/// of the map beside it is at p = 1. Two doublings 10^-4 apart are two.
#[test]
fn neutral_directions_and_near_doublings_are_told_apart() {
    let text = |set: &str, start: &str| {
        format!(
            "states = ['x', 'c']\nstart = {start}\nf = ['0', '0']\n[parameters]\np = 0.5\n\
             [[event]]\nevery = 1\nset = {{ {set} }}"
        )
    };
    for start in ["[0, 1]", "[0.1, 1]"] {
        let flag = text("x = 'p*x - x^2', c = '-c'", start);
        let changes = changes_of(&branch(&flag, 2.0, 50.0, along("p", 0.5, 1.3)), "p");
        assert_eq!(changes.len(), 1, "{start} {changes:?}");
        assert!(changes[0].0 == "branching", "{changes:?}");
        assert!((changes[0].1 - 1.0).abs() <= changes[0].2, "{changes:?}");
        assert!(changes[0].2 < 1e-6, "{changes:?}");
    }
    let two = text("x = 'p*x*(1-x)', c = '(p+0.0001)*c*(1-c)'", "[0.3, 0.3]");
    let mut changes = changes_of(&branch(&two, 1.0, 200.0, along("p", 2.8, 3.2)), "p");
    changes.sort_by(|a, b| a.1.total_cmp(&b.1));
    assert_eq!(changes.len(), 2, "{changes:?}");
    for ((word, at, within), right) in changes.into_iter().zip([2.9999, 3.0]) {
        assert!(word == "period-doubling" && (at - right).abs() <= within, "{at} {within}");
        assert!(within < 1e-6, "{within}");
    }
}

/// An event at the moment at which periods are counted is in each of them: x' = -x and one more
/// where sin 2 pi t rises through zero has x = 1/(e - 1) before it, and the multiplier 1/e; a
/// diode has a current that is set to zero once a period.
#[test]
fn an_event_at_the_counted_moment_is_not_lost() {
    let strobe = "states = ['x']\nstart = [0]\nf = ['-x']\n[[event]]\n\
        when = 'sin(2*pi*t)'\ndirection = 'up'\nset = { x = 'x + 1' }";
    let found = branch(strobe, 1.0, 20.0, None);
    let point: Vec<f64> = found.fact("point").unwrap();
    let multipliers: Vec<[f64; 2]> = found.fact("multipliers").unwrap();
    assert!((point[0] - 1.0 / 1.0_f64.exp_m1()).abs() < 1e-9, "{point:?}");
    assert!((multipliers[0][0] - (-1.0_f64).exp()).abs() < 1e-8, "{multipliers:?}");
    let diode = "states = ['i']\nstart = [0]\n[modes.on]\nf = ['(sin(2*pi*t)-i)/0.5']\n\
        [modes.off]\nf = ['0']\n[[event]]\nwhen = 'i'\ndirection = 'down'\nfrom = 'on'\n\
        mode = 'off'\nset = { i = '0' }\n[[event]]\nwhen = 'sin(2*pi*t)'\n\
        direction = 'up'\nfrom = 'off'\nmode = 'on'";
    let multipliers: Vec<[f64; 2]> = branch(diode, 1.0, 20.0, None).fact("multipliers").unwrap();
    assert_eq!(multipliers, [[0.0, 0.0]]);
    // The mode of the moment is said, not that of the run's beginning.
    let relay = "states = ['x']\nstart = [0]\n[modes.off]\nf = ['-x']\n[modes.on]\n\
        f = ['1 - x']\n[[event]]\nwhen = 'cos(2*pi*t)'\ndirection = 'up'\nmode = 'on'\n\
        [[event]]\nwhen = 'cos(2*pi*t)'\ndirection = 'down'\nmode = 'off'";
    let found = branch(relay, 1.0, 20.0, None);
    assert_eq!(found.fact::<String>("mode").unwrap(), "on");
    assert!(branch(strobe, 1.0, 20.0, None).fact::<String>("mode").is_err());
}

/// x = sqrt(p - 1) of p x - x^3 turns at p = 1, where x = 0 crosses it.
#[test]
fn a_pitchfork_is_seen_from_its_outer_branch() {
    let text = "states = ['x']\nstart = [0.5]\nf = ['0']\n[parameters]\np = 1.5\n\
        [[event]]\nevery = 1\nset = { x = 'p*x - x^3' }";
    let changes = changes_of(&branch(text, 1.0, 50.0, along("p", 1.5, 0.7)), "p");
    assert_eq!(changes.len(), 1, "{changes:?}");
    assert!(changes[0].0 == "branching", "{changes:?}");
    assert!((changes[0].1 - 1.0).abs() <= changes[0].2 && changes[0].2 < 1e-6, "{changes:?}");
}

/// Hopf's normal form with amplitude r^2 (b - r^2) + mu = 0 has a fold of cycles at mu =
/// -b^2/4, passed on a section that is no plane.
#[test]
fn a_branch_goes_through_a_fold() {
    let text = "states = ['x', 'y']\nstart = [0, 1]\nf = ['x*g - y', 'y*g + \
        x']\n[parameters]\nmu = 0.3\n\
        [let]\nq = 'x^2 + y^2'\ng = 'mu + q - q^2'";
    let mut run = run(text, 100.0);
    run.options.record = Record::Section(expression("sinh(x) + x^3", &run.model).unwrap());
    let question = GeneralOrbit {
        run,
        settle: 60.0,
        after: Return::Crossings(1),
        along: along("mu", 0.3, -0.6),
    };
    let answer = Executor::quiet().ask(&question).unwrap();
    let (branch, changes) =
        (answer.table("branch").unwrap(), answer.table("bifurcations").unwrap());
    for (mu, y) in branch.numbers("mu").iter().zip(branch.numbers("y")) {
        let q = y * y;
        assert!((mu + q - q * q).abs() < 1e-7, "{mu} {y}");
    }
    assert_eq!(changes.words("change").collect::<Vec<_>>(), ["fold", "hopf"]);
    assert!((changes.numbers("mu")[0] + 0.25).abs() < 1e-5, "{:?}", changes.numbers("mu"));
}
