//! The file, and which switching functions an expression has.

use super::{end, end_of, last, model, near, run, shipped};
use crate::motion::{Exit, Method, Record, tangent};
use crate::{Definition, HybridError, Options, follow};

#[test]
fn every_general_system_that_ships_is_read_and_followed() {
    for name in twofold_system::library::general_names() {
        let model = shipped(name);
        assert_eq!(model.definition().name(), name);
        assert!(
            !model.definition().title().is_empty()
                && !model.definition().document().references.is_empty()
        );
        let t_end = match name {
            "buck" => 0.01,
            "cuk-converter" => 0.001,
            _ => 5.0,
        };
        run(&model, t_end).1.unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}

/// (equations, end time, last state)
#[test]
fn switching_functions_mean_what_they_say() {
    let pi = std::f64::consts::PI;
    for (f, t, want) in [
        ("floor(t)", 5.0, 10.0),
        ("mod(t, 2)", 5.0, 4.5),
        ("mod(-t, 2)", 3.0, 3.5),
        ("sqrt(mod(3.9, 1.3)) + sqrt(mod(1.7, 0.1))", 1.0, 0.0),
        ("if(abs(t - 5) < 1e-6, 1e6, 0)", 10.0, 2.0),
        ("if(t > 1 and not (t > 3) or t > 4, 1, 0)", 5.0, 3.0),
        ("max(t, 2, 4 - t)", 5.0, 6.0 + 10.5),
        ("clip(t, 1, 3)", 5.0, 1.0 + 4.0 + 6.0),
        ("heaviside(t - 2) + (t > 3)", 5.0, 5.0),
        ("abs(t - 2)", 5.0, 2.0 + 4.5),
        ("atan2(sin(t), cos(t))", 2.0 * pi, 0.0),
        ("sinh(t) + cosh(t)", 1.0, 1.0_f64.exp() - 1.0),
        ("asin(t) + acos(t)", 1.0, pi / 2.0),
        ("t^1.5 + log10(10^t) + log(exp(t))", 1.0, 0.4 + 0.5 + 0.5),
        ("sign(sin(pi*t))", 5.5, 0.5),
    ] {
        let x = end(&format!("states = ['x']\nstart = [0]\nf = ['{f}']"), t);
        near(x[0], want, 2e-9);
    }
}

#[test]
fn errors_point_into_the_file() {
    for (text, place, message, help) in [
        ("states = ['x']\nf = ['if(x, 1, 2)']", "2:10", "a condition is wanted", "x > 0"),
        ("states = ['x']\nf = ['max(x)']", "2:7", "2 arguments or more; 1 given", ""),
        ("states = ['x']\nf = ['x == 1']", "2:9", "equality", "[[event]]"),
        ("states = ['x']\nf = ['0 < x < 1']", "2:13", "two comparisons", "0 < x and x < 1"),
        ("states = ['x']\nf = ['x', '1']", "2:5", "2 expressions for 1 states", ""),
        ("states = ['x']\nf = ['y']", "2:7", "unknown name `y`", ""),
        ("states = ['t']\nf = ['1']", "1:11", "meaning of its own", ""),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nset = { x = '0' }",
            "3:1",
            "not said when",
            "when, at or every",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nwhen = 'x'\nset = { y = '0' }",
            "5:13",
            "no state `y`",
            "states are x",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nwhen = 'x > 1'\ndirection = 'up'",
            "5:13",
            "becomes true",
            "",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nwhen = 'x'\nmode = 'on'",
            "5:8",
            "no mode `on`",
            "",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nwhen = 'x'\nafter_zeno = 'stick'",
            "5:14",
            "sets speeds",
            "",
        ),
        ("states = ['x']\nf = [true]", "2:5", "a number is wanted", ""),
        (
            "states = ['x']\nf = ['1']\n[parameters]\ng = { value = 1, aboev = 0 }",
            "4:5",
            "value, above, below",
            "",
        ),
        (
            "states = ['x']\nstart = [1, 2]\nf = ['1']",
            "2:9",
            "2 numbers for 1 states",
            "one for each",
        ),
        (
            "states = ['x']\nf = ['1']\nh = 'x'\nplus = ['1']\nminus = ['1']",
            "3:5",
            "given twice",
            "one of f",
        ),
        (
            "states = ['x']\nf = ['1']\nevnt = 3",
            "3:1",
            "unknown field `evnt`",
            "did you mean `event`?",
        ),
        (
            "states = ['x']\nf = ['wind']\n[tables.wind]\nfile = '../wind.csv'\ntime = 't'\ncolumn \
                = 'v'",
            "4:8",
            "beside the system's",
            "",
        ),
        ("states = ['x']\nf = ['a']\n[let]\na = 'b'\nb = 'a'", "4:5", "depends on itself", ""),
        (
            "states = ['x']\nf = ['clip(x, -1, 1) + clip(x, 2, -2)']",
            "2:24",
            "lower end 2 is above its upper end -2",
            "clip(x, low, high)",
        ),
        ("states = ['x']\nf = ['x - mod(x, 0)']", "2:11", "mod by 0", "other than 0"),
        (
            "states = ['x']\nf = ['1']\n[parameters]\nlow = 1\na = '1/(low - 1)'",
            "5:5",
            "`a` is inf",
            "a finite number",
        ),
        (
            "states = ['x']\nf = ['1']\n[parameters]\na = 'b'\nb = 2",
            "4:6",
            "unknown name `b`",
            "stand before it",
        ),
        (
            "states = ['x']\nf = ['1']\n[parameters]\nT = 1\n[[event]]\nevery = 'T - 1'",
            "6:9",
            "`every` is 0",
            "a time above 0",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nat = []",
            "4:6",
            "`at` names no time",
            "one time or more",
        ),
        (
            "states = ['x', 'event']\nf = ['1', '0']",
            "1:16",
            "recorded tables have a column `event`",
            "rename the state",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nat = [2, 1, 1]",
            "4:6",
            "the time 1 stands twice",
            "each time once",
        ),
        ("states = ['x']\nf = ['1']\n[[event]]\nat = '1/0'", "4:6", "`at` is inf", "finite time"),
        (
            "states = ['x']\nf = ['1']\n[parameters]\na = 1\n[let]\nb = 'a - 2'\n[[event]]\nwhen \
                = 'b'",
            "8:8",
            "does not change",
            "at = [1]",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nname = 'a'\nwhen = 'x'\n[[event]]\nname = \
                'a'\nwhen = 'x - 1'",
            "7:8",
            "given to two events",
            "its own",
        ),
        (
            "states = ['x']\nf = ['1']\n[parameters]\na = 't'",
            "4:5",
            "does not depend on the time",
            "",
        ),
    ] {
        let error = Definition::from_toml(text, "f").expect_err(text);
        let found = format!("{}:{}", error.line, error.column);
        assert!(error.message.contains(message), "{text}\n{error}");
        assert_eq!(found, place, "{text}\n{error}");
        assert!(error.help.clone().unwrap_or_default().contains(help), "{text}\n{error}");
    }
}

/// x' = -sqrt(x) (Torricelli): (1 - t/2)^2, and from t = 2 on zero for ever.
/// By the values of parameters as by numbers in the file, in fields, terms and resets.
#[test]
fn ends_of_a_clip_are_not_exchanged() {
    let clipped = "states = ['x']\nstart = [3]\nf = ['-clip(x, 0, p)']\n[parameters]\np = 1";
    let of = |text: &str, p: f64| run(&model(text).with("p", p).unwrap(), 1.0).1;
    near(of(clipped, 1.0).unwrap().x[0], 2.0, 1e-12);
    let set = "states = ['x']\nstart = [3]\nf = ['1']\n[[event]]\nat = 0.5\n\
        set = { x = 'mod(x, p)' }\n[parameters]\np = 2";
    near(of(set, 2.0).unwrap().x[0], 2.0, 1e-12);
    let constant = "states = ['x']\nstart = [3]\nf = ['clip(0.5, 0, p)']\n[parameters]\np = 1";
    near(of(constant, 1.0).unwrap().x[0], 3.5, 1e-12);
    for (text, p, words) in [
        (clipped, -1.0, "clip(x, 0, p) is 0 here, above its upper end -1"),
        (constant, -1.0, "clip(0.5, 0, p) is 0 here, above its upper end -1"),
        (set, 0.0, "is by 0"),
    ] {
        let error = of(text, p).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

/// However h is written, plus is where it is positive.
#[test]
fn a_side_is_that_of_h_as_it_is_written() {
    for h in ["-x", "-2*x", "-(x)", "0 - x", "x/(-3)"] {
        let text = format!(
            "states = ['x', 'y']\nstart = [0, -1]\nh = '{h}'\nplus = ['-y', '1']\n\
                minus = ['y', '1']"
        );
        for (exit, want) in [(Exit::Plus, -2.0), (Exit::Minus, 2.0)] {
            let options = Options { t_end: 3.0, exit, ..Options::default() };
            let end = follow(&model(&text), &options, &mut |_| true).unwrap();
            near(end.x[0], want, 1e-9);
        }
    }
}

#[test]
fn errors_of_tables_point_into_the_systems_file() {
    let text = "states = ['x']\nstart = [0]\nf = ['w']\n[tables.w]\nfile = 'w.csv'\ntime = \
        't'\ncolumn = 'v'";
    let model = model(text);
    for (data, place, message, help) in [
        ("s,v\n0,1\n1,2", "6:8", "no column `t`; it has s, v", "first line"),
        ("t,u\n0,1\n1,2", "7:10", "no column `v`", "first line"),
        ("t,v,v\n0,1,1\n1,2,9", "5:8", "w.csv: columns 2 and 3 are both called `v`", "its own"),
        ("t,v\n0,1\n1", "5:8", "w.csv, row 2: 1 cells for 2 columns", "rows of finite numbers"),
        ("t,v\n0,1\n1,a", "5:8", "row 2: `a` is not a finite number", "finite numbers"),
        ("t,v\n0,1\n0,2", "5:8", "row 2: the time 0 does not come after", "times increasing"),
        ("t,v\n0,1", "5:8", "at least two rows", "rows of finite numbers"),
    ] {
        let Err(crate::model::ModelError::Table(error)) = model.clone().with_table("w", data)
        else {
            panic!("{data}")
        };
        let error = Definition::about_table(text, "f", "w", &error);
        assert_eq!(format!("{}:{}", error.line, error.column), place, "{error}");
        assert!(error.message.contains(message) && error.to_string().contains(help), "{error}");
    }
}

/// A condition may have a name.
#[test]
fn conditions_have_names() {
    let x = end(
        "states = ['x']\nstart = [0]\nf = ['if(late and not cold, 2, 1) + late']\n[let]\nlate = 't \
            > 1'\ncold = 'early'\nearly = 't < 2'",
        3.0,
    );
    // 1 to t = 1, 2 to t = 2, 3 to t = 3.
    near(x[0], 6.0, 1e-10);
}

/// Functions with one zero have sides that belong together: what no side decides does not rest.
#[test]
fn functions_with_one_zero_are_no_two_surfaces() {
    let text = "states = ['x', 'y']\nstart = [0, -0.76]\n\
        f = ['sign(y*(1 + x^2))', '0.2 - sign(y)']";
    let found = run(&model(text), 3.0).1;
    assert!(matches!(found, Err(HybridError::Undecided { .. })), "{found:?}");
}

/// Terms that name the term before twice are evaluated once each: 2^40 times would not end.
#[test]
fn nested_terms_take_no_exponential_time() {
    let nested = |first: &str, next: &dyn Fn(usize) -> String, rest: &str| {
        let terms: String = (0..40).map(|i| format!("a{} = '{}'\n", i + 1, next(i))).collect();
        format!("states = ['x']\nstart = [1.1]\n{rest}\n[let]\na0 = '{first}'\n{terms}")
    };
    // sign(a - 1) + abs(a) = 1 + a for a > 1.
    let numbers = nested("x", &|i| format!("sign(a{i} - 1) + abs(a{i})"), "f = ['a40']");
    near(last(&numbers, 1.0), 41.1 * 1.0_f64.exp() - 40.0, 1e-8);
    // The pieces of a reset, too, which closed orbits ask.
    let reset = nested(
        "x",
        &|i| format!("sign(a{i} - 1) + abs(a{i})"),
        "f = ['0']\n[[event]]\nevery = 1\nset = { x = 'x - a40/8 + 5.1375' }",
    );
    let options = Options { record: Record::Times { every: 1.0 }, ..Options::default() };
    let orbit = tangent::closed_orbit(&model(&reset), &options, &tangent::Return::Period(1.0), 0.0);
    near(orbit.unwrap().multipliers[0][0], 0.875, 1e-12);
    let events = "f = ['if(a40, 1, 2)']\n[[event]]\nwhen = 'a40 and x > 2'\nset = { x = 0.5 }";
    near(last(&nested("x > 0", &|i| format!("a{i} and a{i}"), events), 1.0), 0.6, 1e-12);
}

/// Conditions at equality: a counter is at least 5 when it is 5, and not above.
#[test]
fn counters_are_compared_as_they_are_written() {
    let count = |condition: &str| {
        let text = format!(
            "states = ['q', 'n']\nstart = [0, 0]\nf = ['1', '0']\n[[event]]\nwhen = 'q > 1 and \
                {condition}'\nset = {{ q = 'q - 1', n = 'n + 1' }}"
        );
        last(&text, 20.5)
    };
    for (condition, most) in
        [("n < 5", 5.0), ("n <= 5", 6.0), ("not n >= 5", 5.0), ("5 > n", 5.0), ("not n > 5", 6.0)]
    {
        near(count(condition), most, 0.0);
    }
    near(
        last("states = ['n', 'y']\nstart = [5, 0]\nf = ['0', 'if(n >= 5, 1, 0)']", 1.0),
        1.0,
        1e-15,
    );
    near(last("states = ['n', 'y']\nstart = [5, 0]\nf = ['0', 'if(n > 5, 1, 0)']", 1.0), 0.0, 0.0);
}

/// One surface however it is written: 1.75 is 4/3 + 0.25*5/3, with the mean sign 0.25 of the
/// sliding.
#[test]
fn one_surface_is_one_switching_function() {
    let y = |switch: &str| {
        format!(
            "states = ['x', 'y', 'z']\nstart = [1, 0, 1]\nf = ['0.25 - sign(x)', '{switch}', '1']"
        )
    };
    for switch in [
        "sign(x)",
        "sign(2*x)",
        "sign(x^3)",
        "-sign(-x/3)",
        "if(3*x > 0, 1, -1)",
        "sign(tanh(x))",
        "sign(x*abs(x))",
        "2*heaviside(5*x) - 1",
    ] {
        near(end(&y(switch), 3.0)[1], 1.75, 1e-12);
    }
    let moving =
        "states = ['x', 'y']\nstart = [1, 0]\nf = ['0.25 - sign(x - 0.1*t)', 'sign(10*x - t)']";
    near(end(moving, 3.0)[0], 0.3, 1e-12);
    // Near to each other is not the same, in any units; and what only vanishes there is refused.
    let far = "states = ['x', 'y']\nstart = [-0.999995e12, 0]\nf = ['0', 'sign(1e-12*x + 1) + \
        sign(1.00001e-12*x + 1)']";
    near(last(far, 1.0), 0.0, 0.0);
    near(end(&y("sign(x + 1e-9)"), 3.0)[1], 3.0, 1e-8);
    for switch in ["sign(x*z)", "sign(x + abs(x)/2)"] {
        let error = run(&model(&y(switch)), 3.0).1.unwrap_err();
        assert!(matches!(error, HybridError::Undecided { .. }), "{switch}: {error}");
    }
}

/// Logic by the greatest of products is that by `or` and by comparisons, and a network written so
/// is followed without a structure for each gene at each gene's switch.
#[test]
fn logic_may_be_written_by_greatest_values() {
    let n = 16;
    let states: Vec<String> = (0..n).map(|i| format!("'g{i}'")).collect();
    let start: Vec<String> =
        (0..n).map(|i| format!("{}", 0.05 + 0.9 * (i * 7 % n) as f64 / 16.0)).collect();
    let network = |of: &dyn Fn(String, String) -> String| {
        let step = |i: usize| format!("heaviside(g{} - 0.5)", i % n);
        let f: Vec<String> = (0..n)
            .map(|i| {
                let both = format!("(1 - {})*{}", step(i + 3), step(i + 7));
                format!("'-g{i} + 1.1*{}'", of(both, step(i + 5)))
            })
            .collect();
        let text = format!(
            "states = [{}]\nstart = [{}]\nf = [{}]",
            states.join(", "),
            start.join(", "),
            f.join(", ")
        );
        let options = Options { t_end: 3.0, ..Options::default() };
        follow(&model(&text), &options, &mut |_| true).unwrap().x
    };
    let right = network(&|a, b| format!("if({a} > 0.5 or {b} > 0.5, 1, 0)"));
    for found in [
        network(&|a, b| format!("max({a}, {b})")),
        network(&|a, b| format!("if({a} > {b}, {a}, {b})")),
        network(&|a, b| format!("(1 - (1 - {a})*(1 - {b}))")),
    ] {
        found.iter().zip(&right).for_each(|(found, right)| near(*found, *right, 1e-8));
    }
}

/// On the axis to the left the angle is pi, in equations as in numbers; what has no sign has none
/// in a reset.
#[test]
fn zero_has_no_side_in_angles_and_resets() {
    for method in Method::ALL {
        for f in ["atan2(0, -1)", "atan2(y, x - 10)", "atan2(0*t, -1)"] {
            let text = format!("states = ['x', 'y']\nstart = [0, 0]\nf = ['{f}', '0']");
            near(end_of(&text, 1.0, method).unwrap()[0], std::f64::consts::PI, 1e-9);
        }
    }
    let reset = "states = ['x', 'y']\nstart = [0, 0]\nf = ['1', '0']\n[[event]]\nat = 0.5\n\
        set = { x = '3 + sign(y)' }";
    near(end(reset, 0.5)[0], 3.0, 0.0);
}

/// An ideal diode that charges a capacitor, with its voltage under a name: what is measured by the
/// size of terms does not see whether they have one.
#[test]
fn names_of_terms_change_nothing() {
    let detector = |rate: &str| {
        format!(
            "states = ['i', 'v']\nstart = [0, 0.5]\nf = ['{rate}', 'i - v/4']\n\
             [let]\nw = 'sin(t)'\nu = 'w - v'"
        )
    };
    for method in Method::ALL {
        for rate in ["max(u, if(i > 0, u, 0))", "max(w - v, if(i > 0, w - v, 0))"] {
            let found = end_of(&detector(rate), 20.0, method).unwrap();
            near(found[0], 0.2158309611302507, 1e-9);
            near(found[1], 0.40129034270926073, 1e-9);
        }
    }
}

/// Exponents that are whole numbers by a parameter: z' = -z^n of negative numbers.
#[test]
fn whole_exponents_may_be_parameters() {
    let end = |field: &str, n: f64, z: f64| {
        let text = format!("states = ['z']\nstart = [{z}]\nf = ['{field}']\n[parameters]\nn = {n}");
        last(&text, 1.0)
    };
    near(end("-z^n", 2.0, -0.5), -1.0, 1e-8);
    near(end("-z^n", 3.0, -0.5), -(6.0_f64.sqrt().recip()), 1e-9);
    near(end("-z^(n - 1)", 2.0, -0.5), -0.5 * (-1.0_f64).exp(), 1e-9);
    near(end("-abs(z)^(n - 1)*z", 1.0, -0.5), -0.5 * (-1.0_f64).exp(), 1e-9);
    near(end("-abs(z)^n*z", 0.0, 0.5), 0.5 * (-1.0_f64).exp(), 1e-9);
}

/// |v - 0.2| as max(r, -r), r named or written out, is one surface with sign(r).
#[test]
fn a_size_by_a_maximum_is_no_new_surface() {
    use crate::motion::tangent::{Return, closed_orbit};
    let period = |r: &str, size: &str| {
        let text = format!(
            "states = ['v', 'x']\nstart = [0, 0]\n\
             f = ['-x - sign({r})*(0.3 + 0.2*exp(-{size}))', 'v']\n[let]\nr = 'v - 0.2'"
        );
        let section = Record::Section(twofold_system::Expression::Name("v".into()));
        let options = Options { record: section, t_end: 100.0, ..Options::default() };
        closed_orbit(&model(&text), &options, &Return::Crossings(1), 0.0).unwrap().period
    };
    let want = period("r", "abs(r)");
    near(want, 6.601640314931418, 1e-8);
    near(period("r", "max(r, -r)"), want, 1e-9);
    near(period("v - 0.2", "max(v - 0.2, -(v - 0.2))"), want, 1e-9);
    near(period("v - 0.2", "max(0.2 - v, v - 0.2)"), want, 1e-9);
}

/// Saturations of switched controls: what only the sides of others move is no surface. A thermostat
/// holds T = 20; sliding on v = -2 x, x falls as exp(-2 t).
#[test]
fn saturations_of_signs_are_no_surfaces() {
    for heat in
        ["clip(2*heaviside(20 - T), 0, 2)", "clip(10*(T < 20), 0, 2)", "abs(1 + sign(20 - T))"]
    {
        let text = format!("states = ['T']\nstart = [15]\nf = ['0.1*(10 - T) + {heat}']");
        for method in Method::ALL {
            near(end_of(&text, 10.0, method).unwrap()[0], 20.0, 1e-12);
        }
    }
    for control in ["clip(sign(s), -1, 1)", "max(-1, 2*heaviside(s) - 1)", "-min(-sign(s), 1)"] {
        let text = format!(
            "states = ['x', 'v']\nstart = [1, 0.5]\nf = ['v', '0.3*sin(t) - 2*v - {control}']\n\
             [let]\ns = 'v + 2*x'"
        );
        for method in Method::ALL {
            let [early, late] = [4.0, 6.0].map(|t| end_of(&text, t, method).unwrap());
            near(late[0], early[0] * (-4.0_f64).exp(), 1e-8);
        }
    }
}

/// Advice for slips of beginners.
#[test]
fn wrong_kinds_of_values_are_told_what_to_write() {
    let error = |text: &str| Definition::from_toml(text, "f").unwrap_err().to_string();
    let head = "states = ['x', 'v']\nstart = [0, 1]\n";
    let event = |entry: &str| format!("{head}f = ['v', '-x']\n[[event]]\n{entry}");
    for (text, help) in [
        (event("when = 'x = 0'"), "when = \"x\""),
        (event("when = 'x = v'"), "when = \"x - v\""),
        (event("when = 't = 1'"), "at = 1"),
        (event("at = '1, 2'"), "at = [1, 2]"),
        (event("when = 'x'\nmode = 'on'"), "[modes.NAME]"),
        (event("when = 'x'\ndirection = -1"), "\"down\""),
        (event("when = 'x'\nstop = 'yes'"), "true or false"),
        (event("when = 'x'").replace("[[event]]", "[event]"), "[[event]]"),
        (format!("{head}[parameters]\nk = 1\nf = ['v', '-k*x']"), "above the file's first"),
        (format!("{head}f = 'v, -x'"), "an expression for each state"),
        (format!("{head}f = ['v', '-x(t)']"), "without their time: x"),
        ("states = 'x v'\nf = ['v', '-x']".into(), "a list of names"),
        ("states = ['x']\nstart = { x = 0 }\nf = ['1']".into(), "a number for each state"),
    ] {
        let error = error(&text);
        assert!(error.contains("help: ") && error.contains(help), "{error}");
    }
}

/// The greatest of two constants is one of them: a root of it has a value.
#[test]
fn kinks_of_parameters_are_decided_by_their_values() {
    for (f, want) in [
        ("sqrt(max(p - 3*q, 0)) + 1", 1.0),
        ("sqrt(-min(3*q - p, 0)) + 1", 1.0),
        ("sqrt(abs(p - 3*q)) + 1", 1.0 + 5.551_115_123_125_783e-17_f64.sqrt()),
        ("sqrt(clip(p - 3*q, 0, 1)) + clip(p, 0, 0.2)", 0.2),
    ] {
        let text =
            format!("states = ['x']\nstart = [0]\nf = ['{f}']\n[parameters]\np = 0.3\nq = 0.1");
        for method in Method::ALL {
            near(end_of(&text, 1.0, method).unwrap()[0], want, 1e-12);
        }
    }
}
