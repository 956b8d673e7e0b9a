//! Tangent vectors, closed orbits and exponents.

use super::{end_of, model, near, shipped};
use crate::motion::{Method, Record, sensitivity, tangent};
use crate::{Definition, Model, Options, follow};

/// Multipliers and exponents against what formulas say, through crossing, sliding and resets.
#[test]
fn tangent_vectors_pass_switches_by_saltation_matrices() {
    use crate::motion::tangent::{Return, closed_orbit, exponents};
    let section = |text: &str| {
        Record::Section(
            twofold_system::Expression::parse_general(text, &["x", "v", "a", "w", "T"]).unwrap(),
        )
    };
    // The wheel: w^2 after a step is c^2 (w^2 + const), so that the multiplier is c^2, c =
    // cos(pi/4).
    let options = Options {
        start: Some(vec![-0.3, 1.2]),
        record: section("a"),
        t_end: 50.0,
        ..Options::default()
    };
    let orbit =
        closed_orbit(&shipped("rimless-wheel"), &options, &Return::Crossings(1), 0.0).unwrap();
    assert_eq!(orbit.multipliers.len(), 1);
    near(orbit.multipliers[0][0], 0.5, 1e-8);
    // A linear oscillator that loses half of its speed at a wall, driven so that a ball comes back:
    // x'' = -1 with v -> -r v + u. One bounce: v -> r v + u.
    let juggler = model(
        "states = ['x', 'v']\nstart = [0, 1.9]\nf = ['v', '-1']\n[[event]]\nwhen = 'x'\ndirection \
            = 'down'\nset = { v = '1 - 0.5*v' }",
    );
    let options = Options {
        start: Some(vec![1.9, 0.1]),
        record: section("v - 0"),
        t_end: 50.0,
        ..Options::default()
    };
    let orbit = closed_orbit(
        &juggler,
        &Options { record: section("0 - v"), ..options },
        &Return::Crossings(1),
        0.0,
    )
    .unwrap();
    near(orbit.period, 4.0, 1e-9);
    near(orbit.multipliers[0][0], 0.5, 1e-7);
    // x' = -x + a(t) with a relay that crosses: x'' + x' ... the exponent of a linear system with a
    // switch in its input is its own eigenvalue.
    let relay =
        model("states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-x - 0.2*v + sign(sin(t))']");
    let found =
        exponents(&relay, &Options { t_end: 400.0, ..Options::default() }, 40.0, 2).unwrap();
    near(found.values[0], -0.1, 2e-3);
    near(found.values[0] + found.values[1], -0.2, 1e-6);
    // On the line of a sliding control neighbours approach at lambda; across it sliding takes them
    // away.
    let control = shipped("sliding-mode-control");
    let found =
        exponents(&control, &Options { t_end: 60.0, ..Options::default() }, 3.0, 2).unwrap();
    near(found.values[0], -1.0, 1e-6);
    assert_eq!(found.values[1], f64::NEG_INFINITY);
    // Giaouris, Maity, Banerjee, Pickert & Zahawi (2008), sec. V: -0.8211 +- 0.0708i at 24 V.
    let options = Options { start: Some(vec![12.0222, 0.6065]), ..Options::default() };
    let orbit = closed_orbit(&shipped("buck"), &options, &Return::Period(400e-6), 0.0).unwrap();
    near(orbit.multipliers[0][0], -0.8211, 5e-5);
    near(orbit.multipliers[0][1].abs(), 0.0708, 5e-5);
    // A forced oscillator's multipliers over one period are exp of its eigenvalues times the
    // period.
    let period = 2.0 * std::f64::consts::PI;
    let options = Options { start: Some(vec![0.3, 0.2]), ..Options::default() };
    let orbit = closed_orbit(&relay, &options, &Return::Period(period), 0.0).unwrap();
    let size = (orbit.multipliers[0][0].powi(2) + orbit.multipliers[0][1].powi(2)).sqrt();
    near(size, (-0.1 * period).exp(), 1e-8);
    // Stick-slip: a piece of sliding forgets everything, and the multiplier is 0.
    let block = model(
        "states = ['x', 'v']\nstart = [0, 0]\nf = ['v', '-x + (1 - 0.3*(0.5 - v))*sign(0.5 - \
            v)*1']",
    );
    let options = Options {
        start: Some(vec![0.0, 0.5]),
        record: section("x"),
        t_end: 60.0,
        ..Options::default()
    };
    if let Ok(orbit) = closed_orbit(&block, &options, &Return::Crossings(1), 0.0) {
        near(orbit.multipliers[0][0], 0.0, 1e-9);
    }
}

/// On a superstable orbit nothing of a neighbour is left: 2 x (1 - x) has the derivative 0 at 1/2,
/// and Newton's method for a root; a map that shrinks by 1e-20 has its logarithm.
#[test]
fn superstable_orbits_have_no_exponent() {
    use crate::motion::tangent::exponents;
    let of = |set: &str, start: f64| {
        let text = format!(
            "states = ['x']\nstart = [{start}]\nf = ['0']\n[[event]]\nevery = 1\n\
             set = {{ x = '{set}' }}"
        );
        let options = Options { t_end: 60.0, ..Options::default() };
        exponents(&model(&text), &options, 20.0, 1).unwrap().values[0]
    };
    for start in [0.1, 0.23, 0.31, 0.44, 0.77, 0.9123] {
        assert_eq!(of("2*x*(1 - x)", start), f64::NEG_INFINITY, "{start}");
        for a in [2.0, 0.37, 13.1] {
            assert_eq!(of(&format!("(x + {a}/x)/2"), start), f64::NEG_INFINITY, "{a} {start}");
        }
    }
    near(of("1e-20*x + 0.1", 0.3), -20.0 * 10.0_f64.ln(), 1e-6);
}

/// Sliding in the transient takes nothing away from the attractor, and growth by a power of the
/// time is not told from none.
#[test]
fn exponents_are_those_of_the_attractor() {
    use crate::motion::tangent::exponents;
    let text = "states = ['x', 'y']\nstart = [0.1, 1]\n\
        f = ['if(t < 1, -2*sign(x), -x) + 0.1*y', '-0.5*y']";
    let options = Options { t_end: 30.0, ..Options::default() };
    let found = exponents(&model(text), &options, 5.0, 2).unwrap();
    for (i, want) in [-0.5, -1.0].into_iter().enumerate() {
        assert!((found.values[i] - want).abs() <= found.errors[i], "{found:?}");
        assert!(found.errors[i] < 0.5, "{found:?}");
    }
    // Periods of a pendulum, and of an elastic ball, differ between neighbours.
    let pendulum = "states = ['x', 'y']\nstart = [0, 0]\nf = ['y', '-sin(x)']";
    let ball = "states = ['x', 'y']\nstart = [0, 0]\nf = ['y', '-1']\n[[event]]\nwhen = 'x'\n\
        direction = 'down'\nset = { y = '-y' }";
    for (text, starts, t_end) in [
        (pendulum, [0.1466, 0.5, 1.3, 2.4, 2.9], 1000.0),
        (pendulum, [0.1466, 0.5, 1.3, 2.4, 2.9], 200.0),
        (ball, [0.5, 0.8, 1.1, 1.6, 2.0], 30.0),
        (ball, [0.5, 0.8, 1.1, 1.6, 2.0], 10.0),
    ] {
        for start in starts {
            let options = Options { start: Some(vec![start, 0.0]), t_end, ..Options::default() };
            let found = exponents(&model(text), &options, 0.0, 1).unwrap();
            assert!(found.values[0].abs() <= found.errors[0], "{start} {t_end} {found:?}");
        }
    }
}

/// Growth in any one of many states is followed, and what the first state's own direction hides.
#[test]
fn exponents_see_every_state() {
    use crate::motion::tangent::exponents;
    for (n, growing) in [(14, 13), (14, 0), (13, 12), (20, 5)] {
        let names: Vec<String> = (0..n).map(|i| format!("'x{i}'")).collect();
        let rate = |i: usize| if i == growing { 0.5 } else { -1.0 - 0.1 * i as f64 };
        let field: Vec<String> = (0..n).map(|i| format!("'{:?}*x{i}'", rate(i))).collect();
        let text = format!(
            "states = [{}]\nstart = {:?}\nf = [{}]",
            names.join(", "),
            vec![1.0; n],
            field.join(", ")
        );
        let options = Options { t_end: 40.0, ..Options::default() };
        let found = exponents(&model(&text), &options, 10.0, 12).unwrap();
        near(found.values[0], 0.5, 1e-6);
    }
    // From (1, 0) the direction of the first state is exactly that of the approach.
    let hopf = "states = ['x', 'y']\nstart = [1, 0]\n\
        f = ['0.1*x - 2*y - x*(x^2 + y^2)', '2*x + 0.1*y - y*(x^2 + y^2)']";
    let options = Options { t_end: 200.0, ..Options::default() };
    let found = exponents(&model(hopf), &options, 100.0, 2).unwrap();
    near(found.values[0], 0.0, 1e-4);
    near(found.values[1], -0.2, 1e-4);
}

/// Exponents whatever the units of the states; minus infinity where sliding or a reset takes a
/// direction away, and nowhere else.
#[test]
fn exponents_have_no_units_and_vanish_by_switches_alone() {
    use crate::motion::tangent::exponents;
    let of = |text: &str, t_end: f64, transient: f64, count: usize| {
        let options = Options { t_end, ..Options::default() };
        exponents(&model(text), &options, transient, count).unwrap()
    };
    for unit in [1.0, 1e6, 1e9] {
        let text = format!(
            "states = ['x', 'y']\nstart = [{:e}, 0]\nf = ['0.2*x - {:e}*y - x*r', '{:e}*x + 0.2*y \
                - y*r']\n[let]\nr = '(x/{unit:e})^2 + (y*{unit:e})^2'",
            0.5 * unit,
            unit * unit,
            1.0 / (unit * unit)
        );
        for transient in [0.0, 100.0] {
            let found = of(&text, 600.0, transient, 2);
            let (top, low) = (found.values[0], found.values[1]);
            assert!(top.abs() < 1e-3 + found.errors[0], "{unit:e}: {found:?}");
            assert!((low + 0.4).abs() < 1e-3 + found.errors[1], "{unit:e}: {found:?}");
        }
    }
    let found =
        of("states = ['x', 'y']\nstart = [1, 1]\nf = ['-x', '-3*y + 1e17*x']", 20.0, 1.0, 2);
    near(found.values[0], -1.0, 1e-2);
    near(found.values[1], -3.0, 1e-2);
    let reset = "states = ['x', 'y']\nstart = [1, 1]\nf = ['-x', '-3*y']\n[[event]]\nevery = 1\n\
        set = { y = '1' }";
    assert_eq!(of(reset, 30.0, 3.0, 2).values[1], f64::NEG_INFINITY);
    // The clock (c, s) drives q, whose growth, 0.3/sqrt(pi) - 0.001, leaves neighbours of the clock
    // in its own direction alone.
    let driven = "states = ['c', 's', 'q']\nstart = [1, 0, 1]\nf = ['c*g - s', 'c + s*g', \
        'q*(30*exp(-(c/0.01)^2) - 0.001)']\n[let]\ng = '1 - c^2 - s^2'";
    let found = of(driven, 400.0, 0.0, 3);
    assert!((found.values[0] - 0.168_257).abs() < found.errors[0], "{found:?}");
    assert!(found.values.len() < 3 && found.values.iter().all(|v| v.is_finite()), "{found:?}");
}

/// The converter's orbit as matrix exponentials give it (SciPy's `expm`, Newton's method on the
/// period), and its averages: E + v2 = v1 whatever the ripple, and without ripple v2 = E d/(1 - d),
/// or E d/sqrt(K) where the diode blocks before the period ends (Cuk & Middlebrook 1977).
#[test]
fn a_cuk_converter_has_its_closed_orbits() {
    use crate::motion::tangent::{Return, closed_orbit};
    let text = twofold_system::library::general("cuk-converter").unwrap();
    let averaged = text
        .replace("start = [", "start = [0, 0, ")
        .replace("states = [", "states = [\"a1\", \"a2\",")
        .replace("f = [", "f = [\"v1/period\", \"v2/period\",");
    let always = [
        0.218_389_663_520_619_75,
        20.150_423_570_475_724,
        0.351_820_166_631_876_3,
        7.995_275_864_182_7,
    ];
    let partly = [
        0.002_243_986_613_041_76,
        25.590_378_587_232_767,
        -0.002_243_986_613_041_735_8,
        13.572_417_655_863_98,
    ];
    let sizes = (
        [0.987_751_6, 0.987_751_6, 0.963_024_94, 0.963_024_94],
        [0.997_151_281, 0.997_151_281, 0.995_008_467, 0.0],
    );
    let averages = (
        [19.998_721_264_603_635, 7.998_721_264_603_72],
        [25.580_796_932_456_376, 13.580_796_932_456_662],
    );
    let ideal = (0.4 / 0.6, 0.4 / 0.125_f64.sqrt());
    for (load, orbit, sizes, averages, ideal) in [
        (20.0, always, sizes.0, averages.0, ideal.0),
        (400.0, partly, sizes.1, averages.1, ideal.1),
    ] {
        let model = model(text).with("load", load).unwrap();
        // From a start beside it.
        let start = orbit.iter().map(|x| x * 1.001).collect();
        let options = Options { start: Some(start), ..Options::default() };
        let found = closed_orbit(&model, &options, &Return::Period(20e-6), 0.0).unwrap();
        found.x.iter().zip(orbit).for_each(|(x, want)| near(*x, want, 1e-8));
        let mut of: Vec<f64> =
            found.multipliers.iter().map(|m| (m[0] * m[0] + m[1] * m[1]).sqrt()).collect();
        of.sort_by(|a, b| b.total_cmp(a));
        of.iter().zip(sizes).for_each(|(size, want)| near(*size, want, 1e-6));
        let averaged = Model::new(Definition::from_toml(&averaged, "test.toml").unwrap())
            .with("load", load)
            .unwrap();
        let start = [0.0, 0.0].into_iter().chain(orbit).collect();
        let options = Options { t_end: 20e-6, start: Some(start), ..Options::default() };
        let end = follow(&averaged, &options, &mut |_| true).unwrap().x;
        near(end[0], averages[0], 1e-8);
        near(end[1], averages[1], 1e-8);
        near(12.0 + end[1], end[0], 1e-8);
        near(end[1], 12.0 * ideal, 5e-4 * end[1]);
        end[2..].iter().zip(orbit).for_each(|(x, want)| near(*x, want, 1e-8));
        // Sliding ends where the ramp jumps back, ten times.
        let options =
            Options { t_end: 10.0 * 20e-6, start: Some(orbit.to_vec()), ..Options::default() };
        let end = follow(&model, &options, &mut |_| true).unwrap().x;
        end.iter().zip(orbit).for_each(|(x, want)| near(*x, want, 1e-8));
    }
}

/// Carried tangent vectors agree with neighbours that are followed themselves.
#[test]
fn tangent_vectors_agree_with_finite_differences() {
    use crate::motion::tangent::{Return, closed_orbit};
    let text = "states = ['x', 'v']\nf = ['v', '-x - 0.1*v - 0.4*sign(v - 0.3) + 1.2*cos(1.3*t)']\n\
        [[event]]\nwhen = 'x - 0.9'\ndirection = 'up'\nset = { v = '-0.6*v + 0.1*x' }";
    let period = 2.0 * std::f64::consts::PI / 1.3;
    let model = model(text);
    let start = vec![0.2, 0.1];
    // The derivative of the map over one period, by the first Newton step's matrix: multipliers of
    // a closed orbit need one to exist.
    let Ok(orbit) = closed_orbit(
        &model,
        &Options { start: Some(start), ..Options::default() },
        &Return::Period(period),
        0.0,
    ) else {
        panic!("no orbit")
    };
    let map = |x: Vec<f64>| {
        let options = Options { start: Some(x), t_end: period, ..Options::default() };
        follow(&model, &options, &mut |_| true).unwrap().x
    };
    let h = 1e-6;
    let mut matrix = [0.0; 4];
    for j in 0..2 {
        let (mut up, mut down) = (orbit.x.clone(), orbit.x.clone());
        up[j] += h;
        down[j] -= h;
        let (up, down) = (map(up), map(down));
        for i in 0..2 {
            matrix[i * 2 + j] = (up[i] - down[i]) / (2.0 * h);
        }
    }
    let (trace, determinant) =
        (matrix[0] + matrix[3], matrix[0] * matrix[3] - matrix[1] * matrix[2]);
    let [a, b] = [orbit.multipliers[0], orbit.multipliers[1]];
    near(a[0] + b[0], trace, 1e-5);
    near(a[0] * b[0] - a[1] * b[1], determinant, 1e-5);
}

/// The derivative of a reset where the state is zero, small, or small beside what is added.
#[test]
fn resets_have_their_derivatives_near_zero() {
    for (start, set, want) in [
        (0.0, "x + 1", 1.0),
        (1e-300, "x + 1", 1.0),
        (1e-12, "x + 1", 1.0),
        (1e-6, "x + 1e6", 1.0),
        (0.0, "2*x + 1", 2.0),
        (0.0, "exp(3*x)", 3.0),
        (0.5, "x^2 + t", 1.0),
        (0.0, "if(t > 0, x + 1, x)", 1.0),
    ] {
        let text = format!(
            "states = ['x']\nstart = [{start:?}]\nf = ['0']\n[[event]]\nat = 1\nset = {{ x = \
             '{set}' }}"
        );
        let options = Options { t_end: 1.5, ..Options::default() };
        let found = crate::motion::sensitivity::sensitivities(&model(&text), &options, &[])
            .unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert!((found.by_start[0][0] - want).abs() < 1e-8, "{want} {found:?}\n{text}");
    }
}

/// A relay's orbit through the origin: there the state itself says nothing of how large the orbit
/// is.
#[test]
fn an_orbit_closes_on_a_section_through_the_origin() {
    let relay = model(
        "states = ['x']\nstart = [0]\n[modes.up]\nf = ['1 - x']\n[modes.down]\nf = ['-1 - x']\n\
         [[event]]\nfrom = 'up'\nwhen = 'x - 0.1'\ndirection = 'up'\nmode = 'down'\n\
         [[event]]\nfrom = 'down'\nwhen = 'x + 0.1'\ndirection = 'down'\nmode = 'up'",
    );
    // Rising or falling, the first mode or the other.
    for section in ["x", "0 - x"] {
        let section = crate::motion::Record::Section(
            twofold_system::Expression::parse_general(section, &["x"]).unwrap(),
        );
        let options = Options { record: section, t_end: 50.0, ..Options::default() };
        let found = crate::motion::tangent::closed_orbit(
            &relay,
            &options,
            &crate::motion::tangent::Return::Crossings(1),
            0.0,
        );
        let period = 2.0 * (1.1_f64 / 0.9).ln();
        assert!((found.unwrap().period - period).abs() < 1e-9);
    }
}

/// A closed orbit that is not isolated is one all the same.
#[test]
fn a_linear_oscillator_closes_on_any_section() {
    use crate::motion::tangent::{Return, closed_orbit};
    let circle = model("states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-x']");
    for section in ["x - 0.5", "v - 0.5", "x + v"] {
        let section = twofold_system::Expression::parse_general(section, &["x", "v"]).unwrap();
        let options =
            Options { record: Record::Section(section), t_end: 100.0, ..Options::default() };
        let found = closed_orbit(&circle, &options, &Return::Crossings(1), 0.0).unwrap();
        near(found.period, 2.0 * std::f64::consts::PI, 1e-8);
        near(found.multipliers[0][0], 1.0, 1e-6);
        assert!(found.gap < 1e-8);
    }
}

/// A field that jumps where a root's domain ends turns tangent vectors there, too: x' = 1 + (1 -
/// x)^p below 1 and 3 above, from 0, has dx/dx(0) = 3/2.
#[test]
fn tangents_turn_where_a_root_ends() {
    for power in ["0.5", "1.5"] {
        let text = format!("states = ['x']\nf = ['if(x < 1, 1 + (1 - x)^{power}, 3)']");
        let options = Options { t_end: 2.0, start: Some(vec![0.0]), ..Options::default() };
        let found = sensitivity::sensitivities(&model(&text), &options, &[]).unwrap();
        near(found.by_start[0][0], 1.5, 1e-8);
    }
}

/// States that begin at zero, as powers of the time, have their exponents, too: those of a cascade
/// are on its diagonal.
#[test]
fn exponents_of_a_cascade_from_zero() {
    for (f, right) in [
        ("'-x + 2*sin(t)', '-0.5*y + x^3', '-0.2*w + y^2'", [-0.2, -0.5, -1.0]),
        ("'-0.1*x + 0.2*sin(t)', '-0.5*y + x^3', '-w + y^4'", [-0.1, -0.5, -1.0]),
    ] {
        let text = format!("states = ['x', 'y', 'w']\nstart = [0, 0, 0]\nf = [{f}]");
        let options = Options { t_end: 300.0, ..Options::default() };
        let found = tangent::exponents(&model(&text), &options, 30.0, 3).unwrap();
        assert_eq!(found.values.len(), 3, "{f}: {found:?}");
        for (value, (error, right)) in found.values.iter().zip(found.errors.iter().zip(right)) {
            assert!((value - right).abs() <= error.max(1e-3), "{f}: {found:?}");
        }
    }
}

/// Derivatives of resets whose expressions have kinks and jumps near, name terms, or see the time.
#[test]
fn resets_have_the_derivatives_of_the_side_that_they_are_on() {
    let slope = |start: f64, set: &str, rest: &str| {
        let model = model(&format!(
            "states = ['x']\nstart = [{start}]\nf = ['0']\n{rest}\n[[event]]\nname = 'e'\n\
                at = 0.5\nset = {{ x = '{set}' }}"
        ));
        let options = Options { t_end: 1.0, ..Options::default() };
        crate::motion::sensitivity::sensitivities(&model, &options, &[]).unwrap().by_start[0][0]
    };
    for (start, set, want) in [
        (0.49999, "mod(2*x, 1)", 2.0),
        (0.50001, "min(2*x, 2 - 2*x)", -2.0),
        (0.49999, "if(x < 0.5, 2*x, 2*(1 - x))", 2.0),
        (0.49999, "x + 10*heaviside(x - 0.5)", 1.0),
        (0.5, "atan2(x, 2) + floor(x)*x", 2.0 / 4.25),
    ] {
        near(slope(start, set, ""), want, 1e-12);
    }
    near(slope(0.25, "q + x*t", "[let]\nq = 'x^3'"), 3.0 * 0.0625 + 0.5, 1e-12);
}

#[test]
fn tangent_vectors_name_the_methods_that_carry_none() {
    let circle = model("states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-x']");
    for method in [Method::Radau5, Method::Taylor, Method::Lsoda] {
        let options = Options { method, ..Options::default() };
        let error = crate::motion::tangent::exponents(&circle, &options, 1.0, 1);
        let error = error.unwrap_err().to_string();
        assert!(error.contains(&format!("--method {}", method.name())), "{error}");
        assert!(error.contains("carried by dopri5"), "{error}");
    }
}

/// Contacts after Hertz: the slope of x^1.5 at 0 is 0. By central differences of runs, and the
/// closed orbit by SciPy's DOP853 at 1e-12.
#[test]
fn tangents_pass_powers_at_zero() {
    for contact in ["20*max(x - 0.3, 0)^1.5", "if(x > 0.3, 20*(x - 0.3)^1.5, 0)"] {
        let text = format!(
            "states = ['x', 'v']\nstart = [0.1, 0]\nf = ['v', '0.5*cos(t) - x - {contact} - 0.2*v']"
        );
        let model = model(&text);
        let options = Options { t_end: 5.0, ..Options::default() };
        let found = crate::motion::sensitivity::sensitivities(&model, &options, &[]).unwrap();
        let want = [[0.229_457, -0.056_699], [0.325_660, 1.522_792]];
        for (i, row) in want.iter().enumerate() {
            for (j, want) in row.iter().enumerate() {
                near(found.by_start[i][j], *want, 1e-5);
            }
        }
    }
}

/// A diode that begins to conduct while the motion slides on its closed side, where there is no
/// mixture of fields any more: derivatives by the start against differences of runs. From i = 0
/// neighbours on the one side stay beside it: no derivative.
#[test]
fn derivatives_go_through_a_diode_that_begins_to_conduct() {
    let text = "states = ['i', 'v']\nstart = [0, 0]\n\
        f = ['if(i > 0, u, max(u, 0))/0.2', '(i - v/5)/0.8']\n[let]\nu = '3*sin(t) - v'";
    let model = model(text);
    let from = |x: f64, y: f64| {
        let options = Options { t_end: 20.0, start: Some(vec![x, y]), ..Options::default() };
        (follow(&model, &options, &mut |_| true).unwrap().x, options)
    };
    for [x, y] in [[0.3, 1.1], [0.1, 2.0], [0.3, 2.0], [0.4, 1.1], [0.5, 1.1], [0.1, 0.2]] {
        let options = from(x, y).1;
        let found = sensitivity::sensitivities(&model, &options, &[]).unwrap().by_start;
        let step = 1e-4;
        let differences = [[step, 0.0], [0.0, step]].map(|[a, b]| {
            let (more, less) = (from(x + a, y + b).0, from(x - a, y - b).0);
            [0, 1].map(|i| (more[i] - less[i]) / (2.0 * step))
        });
        for (i, row) in found.iter().enumerate() {
            row.iter().zip(differences).for_each(|(v, want)| near(*v, want[i], 2e-6));
        }
    }
    let options = Options { t_end: 2.5, start: Some(vec![0.0, 0.5]), ..Options::default() };
    let found = sensitivity::sensitivities(&model, &options, &[]).unwrap().by_start;
    assert!(found[0][0].is_nan() && found[1][0].is_nan() && found[1][1].is_finite(), "{found:?}");
}

/// Two surfaces met at one moment, of which one is asked only beyond the other.
#[test]
fn surfaces_asked_beyond_one_another_have_no_derivative() {
    let text = "states = ['x', 'y', 'z']\nstart = [-1, -1, 0]\n\
        f = ['1', '1', 'if(x > 0 and y < 0, 10, 0)']";
    let options = Options { t_end: 2.0, ..Options::default() };
    let error = sensitivity::sensitivities(&model(text), &options, &[]).unwrap_err().to_string();
    assert!(error.contains("two surfaces are met at one moment"), "{error}");
    let apart = Options { start: Some(vec![-1.0, -1.25, 0.0]), ..options };
    let found = sensitivity::sensitivities(&model(text), &apart, &[]).unwrap().by_start;
    assert_eq!(found[2], [10.0, -10.0, 1.0]);
}

/// A weir, 1 - sqrt(max(h - 1, 0)), that begins and ends to flow: the surface is met with a speed,
/// and the slope behind it is infinite. Of an autonomous equation derivatives are quotients of the
/// field; of a driven one with one state the multiplier is a difference of runs.
#[test]
fn roots_that_begin_at_a_surface_are_crossed_with_their_tangents() {
    let options = Options { t_end: 3.0, ..Options::default() };
    let slope = |inflow: f64, start: f64, root: &str| {
        let text = format!("states = ['h']\nstart = [{start}]\nf = ['{inflow} - {root}']");
        let found = crate::motion::sensitivity::sensitivities(&model(&text), &options, &[]);
        let found = found.unwrap_or_else(|e| panic!("{text}: {e}"));
        (found.x[0], found.by_start[0][0])
    };
    for root in ["sqrt(max(h - 1, 0))", "if(h > 1, sqrt(h - 1), 0)"] {
        let (end, rising) = slope(1.0, 0.5, root);
        near(rising, 1.0 - (end - 1.0).sqrt(), 1e-7);
        let (_, falling) = slope(-1.0, 1.5, root);
        near(falling, 1.0 / (1.0 + 0.5_f64.sqrt()), 1e-7);
    }
    let tank = "states = ['h']\nstart = [0.2]\n\
        f = ['0.3*(1 + cos(2*pi*t/10)) - 0.2*sqrt(max(h - 0.6, 0)) - 0.3*h']";
    near(end_of(tank, 1000.0, Method::Dopri5).unwrap()[0], 0.9946294707, 2e-9);
    use crate::motion::tangent::{Return, closed_orbit};
    let orbit =
        closed_orbit(&model(tank), &Options::default(), &Return::Period(10.0), 0.0).unwrap();
    let after = |by: f64| {
        let start = Some(vec![orbit.x[0] + by]);
        let options = Options { t_end: 10.0, start, rtol: 1e-12, ..Options::default() };
        follow(&model(tank), &options, &mut |_| true).unwrap().x[0]
    };
    near(orbit.multipliers[0][0], (after(1e-5) - after(-1e-5)) / 2e-5, 1e-6);
}

/// Derivatives by a start on a surface: of one that moves along it at first, also by what gives it
/// a speed; of surfaces that depend on each other none, in words.
#[test]
fn starts_on_surfaces_have_derivatives_of_one_side_only() {
    let options = Options { t_end: 2.0, ..Options::default() };
    let at = |text: &str| crate::motion::sensitivity::sensitivities(&model(text), &options, &[]);
    let found =
        at("states = ['x', 'v']\nstart = [0, 0]\nf = ['v', '0.5 - x - 0.15*sign(x)']").unwrap();
    assert!(found.by_start.iter().flatten().all(|v| v.is_nan()), "{:?}", found.by_start);
    let agents = "states = ['x', 'y', 'z']\nstart = [0, 0, 0]\n\
        f = ['-sign(x - y) - sign(x - z)', '-sign(y - x) - sign(y - z)', \
        '-sign(z - x) - sign(z - y)']";
    let error = at(agents).unwrap_err().to_string();
    assert!(error.contains("surfaces that depend on each other"), "{error}");
}

/// Derivatives where several surfaces are left, or met by functions that are one where the motion
/// is, at one moment: two stops whose speed turns, a lift that brakes to rest.
#[test]
fn derivatives_of_surfaces_met_together() {
    let stops = "states = ['x', 'v', 'z', 'w']\nstart = [0, 0.5, 0, 0]\n\
        f = ['v', 'sin(0.8*t) - 0.3*x - 0.1*v - 0.8*z - 0.5*w', \
        'if(z >= 0.2, min(v, 0), if(z <= -0.2, max(v, 0), v))', \
        'if(w >= 0.3, min(v, 0), if(w <= -0.3, max(v, 0), v))']";
    let lift = "states = ['x', 'v', 'c', 'dir']\nstart = [0, 0, 0, 1]\n\
        [modes.acc]\nf = ['v', '1.85*dir', '0', '0']\n[modes.cruise]\nf = ['v', '0', '0', '0']\n\
        [modes.brake]\nf = ['v', '-1.85*dir', '0', '0']\n[modes.dwell]\nf = ['0', '0', '1', '0']\n\
        [[event]]\nwhen = 'abs(v) > 1.92'\nfrom = 'acc'\nmode = 'cruise'\n\
        [[event]]\nwhen = 'dir*(18 - x) < v^2/3.7'\nfrom = 'cruise'\nmode = 'brake'\n\
        [[event]]\nwhen = 'dir*v < 0'\nfrom = 'brake'\nmode = 'dwell'\nset = { v = '0', c = '0' }";
    for (text, t_end) in [(stops, 40.0), (lift, 12.0)] {
        let model = model(text);
        let options = Options { t_end, ..Options::default() };
        let found = sensitivity::sensitivities(&model, &options, &[]).unwrap();
        let start = model.start().unwrap().unwrap();
        for j in 0..4 {
            let end = |by: f64| {
                let mut x = start.clone();
                x[j] += by;
                let options = Options { start: Some(x), rtol: 1e-13, ..options.clone() };
                follow(&model, &options, &mut |_| true).unwrap().x
            };
            let (up, down) = (end(1e-6), end(-1e-6));
            for i in 0..4 {
                let want = (up[i] - down[i]) / 2e-6;
                near(found.by_start[i][j], want, 1e-5 * (1.0 + want.abs()));
            }
        }
    }
}

/// Neighbours of sliding of higher order have no common linear motion, wherever it begins.
#[test]
fn sliding_of_higher_order_has_no_tangent_vectors() {
    for start in ["[0.4, 0]", "[0, -0.3]"] {
        let text = format!(
            "states = ['x', 'w']\nstart = {start}\n\
            f = ['-1.5*sign(x)*sqrt(abs(x)) + w + 0.3*cos(t)', '-1.1*sign(x)']"
        );
        let options = Options { t_end: 3.0, ..Options::default() };
        let found = crate::motion::sensitivity::sensitivities(&model(&text), &options, &[]);
        let why = found.unwrap_err().to_string();
        assert!(why.contains("slides in higher order"), "{start}: {why}");
    }
}
