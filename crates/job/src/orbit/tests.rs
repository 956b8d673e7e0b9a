use crate::Executor;
use std::f64::consts::PI;
use std::sync::Mutex;

use std::ops::ControlFlow;

use super::*;
use crate::cases;
use twofold_integrate::filippov::{ExitRule, Side};
use twofold_system::Relaxation;

fn question(system: System, switch: SwitchSpec, axis: usize) -> ClosedOrbit {
    ClosedOrbit {
        start: vec![0.3; system.dimension()],
        system,
        switch,
        settle: 0.0,
        plane: ReturnPlane { axis, value: 0.0, upward: true },
        returns: None,
        tolerance: Tolerance { rtol: 1e-9, atol: 1e-9 },
        longest_return: 100.0,
        along: None,
    }
}

/// Turns about the origin at unit speed, r' = side (mu r - r^3): the circle r^2 = mu has the
/// multiplier exp(-4 pi mu side). Beside it decays at the rates 1, 2, 3 ..., whose multipliers
/// are exp(-2 pi k).
fn circle(states: usize) -> System {
    let decays = 1..=states - 2;
    let names: Vec<String> = ["x".into(), "y".into()]
        .into_iter()
        .chain(decays.clone().map(|k| format!("a{k}")))
        .collect();
    let turn = ["side*x*(mu - x*x - y*y) - y".into(), "side*y*(mu - x*x - y*y) + x".into()];
    let field: Vec<String> = turn.into_iter().chain(decays.map(|k| format!("-{k}*a{k}"))).collect();
    let text = format!("states = {names:?}\nh = 'x'\nplus = {field:?}\nminus = {field:?}\n");
    cases::of(&format!("{text}[parameters]\nmu = 0.1\nside = 1\n"))
}

fn switches() -> [SwitchSpec; 3] {
    let exit = ExitRule::AtOnce { side: Side::Plus };
    let hysteretic = SwitchSpec::hysteretic(1e-2, Relaxation::Single);
    [SwitchSpec::tanh(1e-2), hysteretic, SwitchSpec::Filippov { exit, funnel: None }]
}

#[test]
fn a_circle_is_found_in_two_to_four_states() {
    let known = (-0.4 * PI).exp();
    for n in 2..=MOST_STATES {
        for switch in switches() {
            let answer = question(circle(n), switch, 1).compute(&Executor::quiet(), &()).unwrap();
            let fact = |name: &str| answer.fact::<f64>(name).unwrap();
            let near =
                |a: f64, b: f64, by: f64| assert!((a - b).abs() < by, "{n} {switch:?}: {a} {b}");
            near(fact("period"), 2.0 * PI, 1e-6);
            near(fact("largest_modulus"), known, 1e-4);
            near(fact("rate"), 0.2, 1e-4);
            assert!(fact("residual") < 1e-7 && fact("iterations") >= 1.0 && fact("returns") == 1.0);
            let multipliers: Vec<[f64; 2]> = answer.fact("multipliers").unwrap();
            let phi = usize::from(matches!(switch, SwitchSpec::Hysteretic { .. }));
            assert_eq!(multipliers.len(), n - 1 + phi);
            let decays = (1..n - 1).map(|k| (-2.0 * PI * k as f64).exp());
            let all = std::iter::once(known).chain(decays).chain([0.0]);
            for (m, known) in multipliers.iter().zip(all) {
                near(m[0], known, 1e-4);
                near(m[1], 0.0, 1e-4);
            }
            // Upwards through y = 0 at the right, downwards at the left.
            let orbit = answer.table("orbit").unwrap();
            assert_eq!(orbit.words("direction").collect::<Vec<_>>(), ["up", "down"]);
            let point: Vec<f64> = answer.fact("point").unwrap();
            assert_eq!((point.len(), point[0]), (n + phi, orbit.numbers("x")[0]));
            near(orbit.numbers("x")[0], 0.1_f64.sqrt(), 1e-6);
            near(orbit.numbers("x")[1], -(0.1_f64.sqrt()), 1e-6);
            assert_eq!(orbit.numbers("phi").len(), 2 * phi);
        }
    }
    // The other way through the plane.
    let mut down = question(circle(2), SwitchSpec::tanh(1e-2), 1);
    (down.plane.upward, down.start) = (false, vec![-0.3, 0.0]);
    let answer = down.compute(&Executor::quiet(), &()).unwrap();
    let orbit = answer.table("orbit").unwrap();
    assert_eq!(orbit.words("direction").collect::<Vec<_>>(), ["down", "up"]);
    assert!(orbit.numbers("x")[0] < 0.0 && orbit.numbers("x")[1] > 0.0);
}

/// Hears how far a branch has come; refuses after so many.
struct Heard(Mutex<Vec<f64>>, usize);

impl Monitor for Heard {
    fn reached(&self, t: f64) -> ControlFlow<()> {
        let mut heard = self.0.lock().unwrap();
        heard.push(t);
        if heard.len() < self.1 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }
}

fn along(side: f64, from: f64, to: f64) -> ClosedOrbit {
    let along = Along { parameter: "mu".into(), from, to, steps: 4, most: 100 };
    let system = circle(2).with("side", side).unwrap();
    ClosedOrbit { along: Some(along), ..question(system, SwitchSpec::tanh(1e-2), 1) }
}

/// Attracting and repelling, up and down in mu.
#[test]
fn a_branch_of_circles_has_known_multipliers() {
    for (side, from, to) in [(1.0, 0.1, 0.3), (-1.0, 0.1, 0.2), (1.0, 0.2, 0.1)] {
        let heard = Heard(Mutex::default(), 1000);
        let answer = along(side, from, to).compute(&Executor::quiet(), &heard).unwrap();
        assert_eq!((answer.stop, answer.fact("end")), (Stop::Finished, Ok(End::Reached)));
        let branch = answer.table("branch").unwrap();
        let names: Vec<&str> = branch.columns.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(
            names,
            ["mu", "period", "stability", "x", "y", "multiplier1_re", "multiplier1_im"]
        );
        let mu = branch.numbers("mu");
        assert!(mu.len() > 4 && mu[0] == from && mu[mu.len() - 1] == to, "{mu:?}");
        assert!(
            mu.windows(2).all(|w| (w[1] - w[0]).signum() == (to - from).signum()
                && (w[1] - w[0]).abs() < 0.26 * (to - from).abs()),
            "{mu:?}"
        );
        let known = if side > 0.0 { "stable" } else { "unstable" };
        assert!(branch.words("stability").all(|word| word == known));
        for (row, mu) in mu.iter().enumerate() {
            let near = |name: &str, b: f64| {
                let a = branch.numbers(name)[row];
                assert!((a - b).abs() < 1e-5, "{name} at {mu}: {a} {b}");
            };
            near("period", 2.0 * PI);
            near("x", mu.sqrt());
            near("y", 0.0);
            near("multiplier1_re", (-4.0 * PI * mu * side).exp());
            near("multiplier1_im", 0.0);
        }
        let changes = answer.table("bifurcations").unwrap();
        assert!(changes.is_empty() && changes.columns[1].name == "mu");
        // Told of each orbit but the first, in shares of the way.
        let heard = heard.0.into_inner().unwrap();
        let shares: Vec<f64> =
            mu[1..].iter().map(|mu| ((mu - from) / (to - from)).min(1.0)).collect();
        assert!(
            heard.len() == shares.len()
                && heard.iter().zip(shares).all(|(a, b)| (a - b).abs() < 1e-12),
            "{heard:?}"
        );
    }
    let cut =
        along(1.0, 0.1, 0.3).compute(&Executor::quiet(), &Heard(Mutex::default(), 2)).unwrap();
    assert_eq!((cut.stop, cut.fact("end")), (Stop::Interrupted, Ok(End::Interrupted)));
    assert_eq!(cut.table("branch").unwrap().len(), 3);
}

/// On the unit circle z is cos 2 theta: it passes 0 twice a turn in each direction, upwards at
/// (1, -1)/sqrt 2 and opposite. What settles there is seen to come back at the second crossing.
/// The belt's block by any clock, with any positive multiple of h, and in any units of length
/// and time: period and turning point of order one, times the units.
#[test]
fn stick_slip_has_no_units() {
    let filippov = SwitchSpec::Filippov { exit: ExitRule::Undecided, funnel: None };
    let of = |(x, time, clock, h): (f64, f64, f64, f64)| {
        let v = x / time;
        let side = |sign: &str| {
            let pull = format!("{:e}*(0.2*(v/{v:e} - 0.3) - x/{x:e} {sign} 1)", v / time);
            format!("['v/{clock:e}', '({pull})/{clock:e}']")
        };
        let text = format!(
            "states = ['x', 'v']\nh = '{h:e}*(v - 0.3*{v:e})'\nplus = {}\nminus = {}",
            side("-"),
            side("+")
        );
        let question = ClosedOrbit {
            start: vec![0.0, 0.0],
            settle: 50.0 * time * clock,
            longest_return: 100.0 * time * clock,
            tolerance: Tolerance { rtol: 1e-11, atol: 1e-11 * x.min(v).min(1.0) },
            ..question(cases::of(&text), filippov, 1)
        };
        let answer = question.compute(&Executor::quiet(), &());
        let answer = answer.unwrap_or_else(|e| panic!("{x:e} {time:e} {clock:e} {h:e}: {e}"));
        assert!(answer.table("orbit").is_some(), "{x:e} {time:e} {clock:e} {h:e}: a rest");
        let period: f64 = answer.fact("period").unwrap();
        let point: Vec<f64> = answer.fact("point").unwrap();
        let off = [period / (6.736_837_191_689 * time * clock), point[0] / (0.463_089_814_616 * x)];
        for off in off {
            assert!((off - 1.0).abs() < 1e-8, "{x:e} {time:e} {clock:e} {h:e}: {off}");
        }
    };
    for clock in [1e-9, 1e-3, 1.0, 1e6, 1e7, 1e8, 1e9] {
        of((1.0, 1.0, clock, 1.0));
    }
    for h in [1e-300, 1e-12, 1e12, 1e300] {
        of((1.0, 1.0, 1.0, h));
    }
    for (x, time) in [(1e-9, 1e-9), (1.0, 1e-9), (1e-6, 1e-9), (1.0, 1e9), (1e-9, 1e-6)] {
        of((x, time, 1.0, 1.0));
    }
}

/// Slides along y = 0 to a pseudo-node at x = 1, past the plane x = 2 while it settles, and
/// does not return: x - 1 = 2 exp(-t/20).
#[test]
fn a_motion_that_slides_to_a_rest_beyond_the_plane_comes_to_it() {
    let text = "states = ['x', 'y']\nh = 'y'\nplus = ['0.05*(1 - x)', '-1']\n\
        minus = ['0.05*(1 - x)', '1']";
    let exit = ExitRule::Undecided;
    let question = ClosedOrbit {
        start: vec![3.0, 0.5],
        settle: 20.0,
        plane: ReturnPlane { axis: 0, value: 2.0, upward: false },
        longest_return: 1000.0,
        ..question(cases::of(text), SwitchSpec::Filippov { exit, funnel: None }, 0)
    };
    let answer = question.compute(&Executor::quiet(), &()).unwrap();
    let rest = answer.table("rest").expect("a rest");
    assert!((rest.numbers("x")[0] - 1.0).abs() < 1e-9 && rest.numbers("y")[0].abs() < 1e-9);
}

/// The Brusselator's orbits end at its Hopf point, B = 1 + A^2, on a plane on which the rest
/// (A, B/A) lies for all B; the rest is none of them. The same of orbits by Filippov's rule,
/// whose radius is sqrt(mu) and multiplier exp(-4 pi mu), whatever rounding says.
#[test]
fn a_branch_ends_at_its_hopf_point() {
    let follow = |question: &ClosedOrbit| {
        let answer = question.compute(&Executor::quiet(), &()).unwrap();
        let end: End = answer.fact("end").unwrap();
        assert_eq!(end, End::Vanished);
        let changes = answer.table("bifurcations").unwrap();
        let last = changes.len() - 1;
        assert_eq!(changes.words("change").nth(last), Some("hopf"));
        let at = changes.numbers(&question.along.as_ref().unwrap().parameter)[last];
        (answer.table("branch").unwrap().clone(), at)
    };
    for (a, steps) in [(1.0, 3), (1.0, 10), (1.0, 40), (2.0, 10)] {
        let field = "['A + x^2*y - (B + 1)*x', 'B*x - x^2*y']";
        let text = format!(
            "states = ['x', 'y']\nh = 'x + 1000'\nplus = {field}\nminus = {field}\n\
                [parameters]\nA = {a}\nB = 3\n"
        );
        let hopf = 1.0 + a * a;
        let question = ClosedOrbit {
            start: vec![1.5 * a, 2.0],
            settle: 100.0,
            plane: ReturnPlane { axis: 0, value: a, upward: true },
            tolerance: Tolerance { rtol: 1e-11, atol: 1e-11 },
            along: Some(Along {
                parameter: "B".into(),
                from: 1.5 * hopf,
                to: 0.5 * hopf,
                steps,
                most: 1000,
            }),
            ..question(cases::of(&text), SwitchSpec::tanh(1e-3), 0)
        };
        let (branch, at) = follow(&question);
        assert!((at - hopf).abs() < 1e-6, "{a} {steps}: {at}");
        for row in 0..branch.len() {
            let (b, y) = (branch.numbers("B")[row], branch.numbers("y")[row]);
            let size = y - b / a;
            assert!(b > hopf && size > 1e-5, "{a} {steps}: {b} {y}");
            // Near the point size^2 = 4/3 (B - 2) where A = 1.
            if a == 1.0 && b < 2.01 {
                assert!((size * size / (b - hopf) / 4.0 * 3.0 - 1.0).abs() < 0.05, "{b} {y}");
            }
            let multiplier = branch.numbers("multiplier1_re")[row];
            assert!(multiplier < 1.0, "{a} {steps}: {b} {multiplier}");
        }
    }
    let filippov = SwitchSpec::Filippov { exit: ExitRule::Undecided, funnel: None };
    let text = "states = ['x', 'y']\nh = 'x + 100'\nplus = ['mu*x - y - x*r', 'x + mu*y - \
        y*r']\nminus = ['mu*x - y - x*r', 'x + mu*y - y*r']\n[let]\nr = 'x^2 + y^2'\n\
        [parameters]\nmu = 0.2\n";
    let along = Along { parameter: "mu".into(), from: 0.2, to: -0.2, steps: 40, most: 1000 };
    let tolerance = Tolerance { rtol: 1e-11, atol: 1e-11 };
    let circle = question(cases::of(text), filippov, 1);
    let (branch, at) =
        follow(&ClosedOrbit { start: vec![0.5, 0.0], tolerance, along: Some(along), ..circle });
    assert!(at.abs() < 1e-9, "{at}");
    let least = branch.numbers("mu").iter().fold(f64::INFINITY, |least, mu| mu.min(least));
    assert!(least < 1e-4, "{least}");
    for row in 0..branch.len() {
        let (mu, x) = (branch.numbers("mu")[row], branch.numbers("x")[row]);
        assert!((x * x / mu - 1.0).abs() < 0.05, "{mu} {x}");
        assert_ne!(branch.words("stability").nth(row), Some("unstable"), "{mu}");
    }
    // Orbits that fill a plane, at weakening = 0, to the rest within: (1 - 0.3 weakening, 0).
    let slip = ClosedOrbit {
        start: vec![0.0, 0.0],
        settle: 100.0,
        tolerance,
        along: Some(Along {
            parameter: "weakening".into(),
            from: 0.2,
            to: -0.2,
            steps: 40,
            most: 1000,
        }),
        ..question(System::builtin("stick-slip").unwrap(), filippov, 1)
    };
    let (branch, at) = follow(&slip);
    assert!(at.abs() < 1e-9, "{at}");
    assert!(branch.numbers("weakening").iter().all(|w| *w > -1e-6), "{branch:?}");
}

#[test]
fn returns_are_counted_in_the_settled_motion() {
    let field = ["x*(1 - x*x - y*y) - y", "y*(1 - x*x - y*y) + x", "-z + x*x - y*y - 4*x*y"];
    let system = cases::smooth(&["x", "y", "z"], "x + 9", &field);
    let question = ClosedOrbit { settle: 40.0, ..question(system, SwitchSpec::tanh(1e-2), 2) };
    let answer = question.compute(&Executor::quiet(), &()).unwrap();
    assert_eq!(answer.fact("returns"), Ok(2));
    assert!((answer.fact::<f64>("period").unwrap() - 2.0 * PI).abs() < 1e-6);
    let orbit = answer.table("orbit").unwrap();
    assert_eq!(orbit.words("direction").collect::<Vec<_>>(), ["up", "up", "down", "down"]);
    let (x, y) = (orbit.numbers("x"), orbit.numbers("y"));
    assert!(
        (0..2).all(|k| (x[k] + y[k]).abs() < 1e-6) && (x[0] + x[1]).abs() < 1e-6,
        "{x:?} {y:?}"
    );
    assert!((0..4).all(|k| (x[k].abs() - 0.5_f64.sqrt()).abs() < 1e-6));
    for (upward, word) in [(true, "upwards within t = 40"), (false, "downwards within t = 40")] {
        let plane = ReturnPlane { axis: 2, value: 5.0, upward };
        let missed = ClosedOrbit { plane, ..question.clone() };
        let said = missed.compute(&Executor::quiet(), &()).unwrap_err().to_string();
        assert!(said.contains(word), "{said}");
    }
    struct Never;
    impl crate::Progress for Never {
        fn begin<'a>(&'a self, _: &str, _: f64) -> Box<dyn crate::JobMonitor + 'a> {
            Box::new(Never)
        }
    }
    impl crate::JobMonitor for Never {
        fn done(self: Box<Self>, _: &str) {}
    }
    impl Monitor for Never {
        fn reached(&self, _: f64) -> ControlFlow<()> {
            ControlFlow::Break(())
        }
    }
    let long = ClosedOrbit { settle: 4000.0, ..question };
    assert_eq!(long.compute(&Executor::new(None, &Never), &()), Err(JobError::Interrupted));
}

/// Roessler's (1976) equations with a = b = 0.1, c = 5.2, whose orbit has the multiplier
/// -0.952: the settled motion alternates. SciPy's DOP853 at 1e-13.
#[test]
fn an_orbit_approached_in_turns_is_closed_after_one_return() {
    let field = ["-y - z", "x + 0.1*y", "0.1 + z*(x - 5.2)"];
    let system = cases::smooth(&["x", "y", "z"], "x - 500", &field);
    let filippov = switches()[2];
    for (switch, settle) in [(SwitchSpec::tanh(1e-2), 200.0), (filippov, 150.0)] {
        let tolerance = Tolerance { rtol: 1e-11, atol: 1e-11 };
        let start = vec![5.0, 0.1, 0.0];
        let system = system.clone();
        let question = ClosedOrbit { settle, start, tolerance, ..question(system, switch, 1) };
        let guess = question.guess(&Executor::quiet()).unwrap();
        assert!(matches!(guess, Guess::Loop { returns: 2, .. }), "{guess:?}");
        let answer = question.compute(&Executor::quiet(), &()).unwrap();
        assert_eq!(answer.fact("returns"), Ok(1));
        assert_eq!(answer.table("orbit").unwrap().len(), 2);
        let multipliers: Vec<[f64; 2]> = answer.fact("multipliers").unwrap();
        assert!((answer.fact::<f64>("period").unwrap() - 6.019_733_84).abs() < 1e-7);
        assert!((multipliers[0][0] + 0.952_014_01).abs() < 1e-7, "{multipliers:?}");
    }
}

/// The same with c = 7, where Newton's method ends with a multiplier that is off by 9e-9.
#[test]
fn a_multiplier_is_off_by_no_more_than_its_error() {
    let field = ["-y - z", "x + 0.1*y", "0.1 + z*(x - 7)"];
    for switch in [SwitchSpec::tanh(1e-2), switches()[2]] {
        let question = ClosedOrbit {
            settle: 200.0,
            start: vec![5.0, 0.1, 0.0],
            tolerance: Tolerance { rtol: 1e-11, atol: 1e-11 },
            returns: Some(1),
            ..question(cases::smooth(&["x", "y", "z"], "x - 500", &field), switch, 1)
        };
        let answer = question.compute(&Executor::quiet(), &()).unwrap();
        let multipliers: Vec<[f64; 2]> = answer.fact("multipliers").unwrap();
        let error: f64 = answer.fact("multiplier_error").unwrap();
        let off = (multipliers[0][0] + 1.396_965_653_30).abs();
        assert!(off <= error && error < 1e-7, "{off:e} {error:e}");
    }
}

/// Two turns beside each other, of (x, y) at unit speed and of (u, v) at a third of it and a
/// little more: at x = 4, where y = 0 is passed upwards, u and v are again what they were after
/// three crossings, but for `apart`. That counts as the same within a thousandth of 1 + 4.
#[test]
fn a_passage_is_the_same_within_a_thousandth_of_its_size() {
    let guess = |apart: f64, passages: f64| {
        let speed = 1.0 / 3.0 + apart / (6.0 * PI);
        let field = ["-y".to_owned(), "x".into(), format!("-{speed:?}*v"), format!("{speed:?}*u")];
        let field: Vec<&str> = field.iter().map(String::as_str).collect();
        let system = cases::smooth(&["x", "y", "u", "v"], "x + 9", &field);
        let start = vec![4.0 * 0.5_f64.cos(), -4.0 * 0.5_f64.sin(), 1.0, 0.0];
        let settle = 1.0 + 2.0 * PI * (passages - 1.0);
        let question = ClosedOrbit { settle, start, ..question(system, SwitchSpec::tanh(1e-2), 1) };
        match question.guess(&Executor::quiet()).unwrap() {
            Guess::Loop { point, returns } => (point, returns),
            Guess::Rest(rest) => panic!("{rest:?}"),
        }
    };
    for (apart, returns) in [(4.5e-3, 3), (5.5e-3, 1)] {
        let (point, found) = guess(apart, 6.0);
        assert!(
            (point[0] - 4.0).abs() < 1e-6 && point[1] == 0.0 && found == returns,
            "{apart}: {found} {point:?}"
        );
    }
    // Three crossings are too few to see it; one return is tried.
    assert_eq!(guess(0.0, 3.0).1, 1);
    assert_eq!(guess(0.0, 4.0).1, 3);
}

/// Not in half of the time that a turn takes; and a period is as good as the tolerance that was
/// asked for.
#[test]
fn a_return_is_computed_as_it_is_asked_for() {
    let question = question(circle(2), SwitchSpec::tanh(1e-2), 1);
    let hasty = ClosedOrbit { longest_return: PI, ..question.clone() };
    let said = hasty.compute(&Executor::quiet(), &()).unwrap_err().to_string();
    assert!(said.contains(&format!("within t = {PI}")), "{said}");
    let period = |tolerance: f64| -> f64 {
        let tolerance = Tolerance { rtol: tolerance, atol: tolerance };
        let answer =
            ClosedOrbit { tolerance, ..question.clone() }.compute(&Executor::quiet(), &()).unwrap();
        (answer.fact::<f64>("period").unwrap() - 2.0 * PI).abs()
    };
    assert!(period(1e-4) > 1e-8 && period(1e-12) < 1e-10, "{} {}", period(1e-4), period(1e-12));
}

/// Without settling: the start, moved onto the plane, with phi on its side of h = 0.
#[test]
fn a_hysteretic_guess_has_phi() {
    for (x, phi) in [(0.5, 1.0), (-0.5, 0.0), (0.0, 1.0)] {
        let mut question = question(circle(3), switches()[1], 1);
        (question.start, question.plane.value) = (vec![x, 7.0, 8.0], 2.0);
        let guess = Guess::Loop { point: vec![x, 2.0, 8.0, phi], returns: 1 };
        assert_eq!(question.guess(&Executor::quiet()).unwrap(), guess);
        assert_eq!(
            (question.states(), question.names()),
            (4, ["x", "y", "a1", "phi"].map(String::from).to_vec())
        );
    }
    let phi = question(cases::smooth(&["x", "phi"], "x", &["phi", "-x"]), switches()[1], 1);
    assert_eq!(phi.names(), ["x", "phi", "phi_"]);
    let smoothed = question(circle(3), switches()[0], 1);
    assert_eq!((smoothed.states(), smoothed.names().len()), (3, 3));
}

#[test]
fn the_parameter_may_be_the_width() {
    let at = |switch: SwitchSpec, system: System, value: f64| {
        let along = Along { parameter: "eps".into(), from: 1e-3, to: 1e-2, steps: 1, most: 9 };
        ClosedOrbit { along: Some(along), ..question(system, switch, 1) }.at(value)
    };
    let [smoothed, _, filippov] = switches();
    let hysteretic = |eps| SwitchSpec::Hysteretic {
        eps,
        eps_prime: 0.3,
        relaxation: Relaxation::Single,
        phi0: 0.7,
    };
    for (switch, wanted) in [(smoothed, SwitchSpec::tanh(0.5)), (hysteretic(0.1), hysteretic(0.5))]
    {
        assert_eq!(at(switch, circle(2), 0.5).unwrap(), (circle(2), wanted));
        for value in [0.0, -1.0, f64::NAN] {
            assert!(
                at(switch, circle(2), value).unwrap_err().to_string().contains("above 0"),
                "{value}"
            );
        }
    }
    assert!(at(filippov, circle(2), 0.5).unwrap_err().to_string().contains("no eps"));
    // A system's own parameter of that name comes first.
    let own = cases::of(
        "states = ['x', 'y']\nh = 'x'\nplus = ['y', '-eps*x']\nminus = ['y', \
            '-x']\n[parameters]\neps = 2",
    );
    assert_eq!(at(smoothed, own.clone(), 0.5).unwrap(), (own.with("eps", 0.5).unwrap(), smoothed));
}

#[test]
fn wrong_questions_are_refused() {
    let along = |parameter: &str, from, to, steps| {
        Some(Along { parameter: parameter.into(), from, to, steps, most: 9 })
    };
    let [smoothed, _, filippov] = switches();
    let good = question(circle(2), smoothed, 1);
    assert_eq!(good.validate(), Ok(()));
    let of = |n: usize| question(cases::decays(n), smoothed, 0);
    for (wrong, field, word) in [
        (of(1), "system", "2 to 4 states"),
        (of(5), "system", "2 to 4 states"),
        (question(circle(2), smoothed, 2), "section", "count from 0"),
        (
            ClosedOrbit { along: along("nu", 0.1, 0.2, 4), ..good.clone() },
            "along",
            "name a parameter",
        ),
        (
            ClosedOrbit { along: along("mu", 0.1, f64::NAN, 4), ..good.clone() },
            "along",
            "name a parameter",
        ),
        (
            ClosedOrbit { along: along("eps", 0.1, -0.1, 4), ..good.clone() },
            "along",
            "name a parameter",
        ),
        (
            ClosedOrbit { along: along("eps", 0.0, 0.1, 4), ..good.clone() },
            "along",
            "name a parameter",
        ),
        (
            ClosedOrbit { along: along("eps", 0.1, 0.2, 4), switch: filippov, ..good.clone() },
            "along",
            "name a parameter",
        ),
        (ClosedOrbit { along: along("mu", 0.1, 0.1, 4), ..good.clone() }, "along", "two ends"),
        (
            ClosedOrbit { along: along("mu", 0.1, 0.2, 0), ..good.clone() },
            "along",
            "at least one step",
        ),
        (ClosedOrbit { returns: Some(0), ..good.clone() }, "returns", "at least once"),
    ] {
        match wrong.compute(&Executor::quiet(), &()) {
            Err(JobError::Spec(error)) => {
                assert!(
                    error.field == field && error.rule.contains(word),
                    "{field}, {word}: {error}"
                );
            }
            other => panic!("{field}, {word}: {other:?}"),
        }
    }
}

/// A search that leaves the finite numbers, and one that finds nothing: in words, of the
/// orbit's states alone.
#[test]
fn a_search_that_fails_says_why() {
    let leaving = cases::smooth(&["x", "y"], "x + 9", &["x*x*x", "x"]);
    let said = question(leaving, switches()[0], 1)
        .compute(&Executor::quiet(), &())
        .unwrap_err()
        .to_string();
    assert!(!said.is_empty());
    let failure = Failure::NotFinite { t: 1.0, state: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0] };
    assert_eq!(failure.of_states(2), Failure::NotFinite { t: 1.0, state: vec![1.0, 2.0] });
}
