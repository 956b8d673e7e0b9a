//! Rests and pseudo-equilibria with their stability.

use super::{end, last, model, near};
use crate::motion::Record;
use crate::{Options, follow};

/// Equilibria, and pseudo-equilibria with the eigenvalues that a formula gives.
#[test]
fn rests_are_found_with_their_stability() {
    use crate::rests::rests;
    // Two foci and a saddle of a double well.
    let well = model("states = ['x', 'v']\nf = ['v', 'x - x^3 - 0.2*v']");
    let kinds: Vec<String> =
        rests(&well, &[(-2.0, 2.0); 2]).unwrap().iter().map(|r| r.kind()).collect();
    assert_eq!(kinds, ["stable focus", "saddle", "stable focus"]);
    // Sliding on v = 0.2 with x' = 0.2: no rest there, but those of both fields, which are not on
    // their own sides.
    let block = "states = ['x', 'v']\nf = ['v', '-x - sign(v - 0.2)']";
    assert!(rests(&model(block), &[(-3.0, 3.0); 2]).unwrap().iter().all(|r| r.on.is_empty()));
    // On x = 0: fields (1, y - 1) below and (-1, y + 3) above: halves cancel in x, so y' = y + 1,
    // which vanishes at -1 and grows.
    let planar = model("states = ['x', 'y']\nf = ['-sign(x)', 'y + 1 + 2*sign(x)']");
    let found = rests(&planar, &[(-3.0, 3.0); 2]).unwrap();
    assert_eq!(found.len(), 1, "{found:?}");
    near(found[0].x[1], -1.0, 1e-12);
    near(found[0].eigenvalues[0][0], 1.0, 1e-9);
    assert_eq!((found[0].on[0].surface.as_str(), found[0].attracting), ("x", Some(true)));
    near(found[0].on[0].weight, 0.5, 1e-12);
    // A fused focus: both fields are tangent to x = 0 where they cancel.
    let fused = model("states = ['x', 'y']\nf = ['y', '-x - 0.2*sign(x)']");
    // Beyond a surface others are asked than before it: atan2 is smooth where it looks up.
    let angle = model("states = ['x', 'y']\nf = ['atan2(y, x) - 1', '1 - y']");
    let found = rests(&angle, &[(-2.0, 2.0); 2]).unwrap();
    assert_eq!(found.len(), 1, "{found:?}");
    near(found[0].x[0], 1.0 / 1.0_f64.tan(), 1e-9);
    // A function that a parameter makes zero is no surface, and not greater than zero.
    for condition in ["eps*(x - 1) > 0", "k*x > x"] {
        let text = format!(
            "states = ['x', 'y']\nf = ['-x + 0.5*y + 0.1', 'if({condition}, 1, 0.5) - 2*y + \
                0.1']\n[parameters]\neps = 0\nk = 1"
        );
        let found = rests(&model(&text), &[(-3.0, 3.0); 2]).unwrap();
        assert_eq!(found.len(), 1, "{found:?}");
        near(found[0].x[0], 0.25, 1e-9);
        assert_eq!(found[0].kind(), "stable node");
    }
    // A state that the clock moves again and again does not rest; one that it moves once does.
    for (event, kind) in [
        (
            "every = 1\nset = { x = 'x + 1' }",
            "no rest of the whole motion: kick moves it again and again",
        ),
        ("every = 1\nset = { x = '0.5*x' }", "stable node"),
        ("at = 1\nset = { x = 'x + 1' }", "stable node"),
    ] {
        let text = format!("states = ['x']\nf = ['-x']\n[[event]]\nname = 'kick'\n{event}");
        let found = rests(&model(&text), &[(-3.0, 3.0)]).unwrap();
        assert_eq!(found[0].kind(), kind);
    }
    let found = rests(&fused, &[(-3.0, 3.0); 2]).unwrap();
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].tangent && found[0].eigenvalues.is_empty(), "{found:?}");
    assert!(found[0].x.iter().all(|x| x.abs() < 1e-9), "{found:?}");
    near(found[0].on[0].weight, 0.5, 1e-9);
    assert!(
        rests(&model("states = ['x']\nf = ['sin(t)']"), &[(-1.0, 1.0)])
            .unwrap_err()
            .to_string()
            .contains("time")
    );
}

/// Rests on a kink or at a double root are not named by one side's eigenvalues.
#[test]
fn stability_is_said_where_it_is_decided() {
    let kinds = |text: &str, bounds: &[(f64, f64)]| -> Vec<String> {
        crate::rests::rests(&model(text), bounds).unwrap().iter().map(|r| r.kind()).collect()
    };
    for f in ["-abs(x)", "if(x > 0, -x, 2*x)"] {
        let found = kinds(&format!("states = ['x']\nf = ['{f}']"), &[(-1.0, 1.0)]);
        assert!(
            !found.is_empty() && found.iter().all(|k| k.starts_with("boundary equilibrium")),
            "{f}: {found:?}"
        );
    }
    let double = kinds("states = ['x']\nf = ['x^2']", &[(-10.0, 10.0)]);
    assert!(double.iter().all(|k| k == "not decided by the linearised motion"), "{double:?}");
    assert_eq!(kinds("states = ['x']\nf = ['-0.001*x']", &[(-10.0, 10.0)]), ["stable node"]);
}

/// A rest in a strip that none of the places is in from which it is looked for, in a field and on
/// the edges of strips of other states.
#[test]
fn rests_in_narrow_strips_are_found() {
    let found = |text: &str| crate::rests::rests(&model(text), &[(-10.0, 10.0); 2]).unwrap();
    for width in [0.03, 1e-3, 1e-5] {
        let strip = format!("if(x > 0.1 and x < 0.1 + {width:e}, 0.1 + {width:e}/3 - x, 1)");
        let strips =
            found(&format!("states = ['x', 'y']\nf = ['{strip}', '{}']", strip.replace('x', "y")));
        let at = |x: f64, y: f64| {
            let near = |r: &&crate::rests::Rest| {
                (r.x[0] - 0.1 - x * width).abs() + (r.x[1] - 0.1 - y * width).abs() < 1e-12
            };
            strips.iter().filter(near).count()
        };
        assert_eq!(strips.len(), 4, "{width}: {strips:?}");
        for (x, y) in [(1.0 / 3.0, 1.0 / 3.0), (1.0, 1.0 / 3.0), (1.0 / 3.0, 1.0), (1.0, 1.0)] {
            assert_eq!(at(x, y), 1, "{width} {x} {y}: {strips:?}");
        }
    }
}

/// Linear pieces have one zero each, which is a rest if it lies in its piece: of four saturations
/// in three states (eight switching functions) the same rests are found.
#[test]
fn rests_of_many_linear_pieces_are_found() {
    const N: usize = 3;
    const CLIPS: usize = 4;
    let mut draws = twofold_num::random::RandomStream::new(17, 0);
    for system in 0..12 {
        let mut draw = |count: usize| -> Vec<f64> { (0..count).map(|_| draws.normal()).collect() };
        let (a, b, c, h, d) = (draw(N * N), draw(N), draw(N * CLIPS), draw(CLIPS * N), draw(CLIPS));
        let c: Vec<f64> = c.iter().map(|c| 2.0 * c).collect();
        let sum = |row: &[f64]| {
            let terms: Vec<String> = (0..N).map(|j| format!("({})*x{j}", row[j])).collect();
            terms.join(" + ")
        };
        let f = (0..N).map(|i| {
            let clips = (0..CLIPS).map(|k| {
                let inner = sum(&h[k * N..(k + 1) * N]);
                format!("({})*clip({inner} + ({}), -1, 1)", c[i * CLIPS + k], d[k])
            });
            let linear = [sum(&a[i * N..(i + 1) * N]), format!("({})", b[i])];
            format!("'{}'", linear.into_iter().chain(clips).collect::<Vec<_>>().join(" + "))
        });
        let f: Vec<String> = f.collect();
        let text = format!("states = ['x0', 'x1', 'x2']\nf = [{}]", f.join(", "));
        let found = crate::rests::find(&model(&text), &[(-10.0, 10.0); N]).unwrap();
        assert!(found.limits.is_empty(), "{:?}", found.limits);
        let mut right = Vec::new();
        for piece in 0..3_usize.pow(CLIPS as u32) {
            let state = |k: usize| piece / 3_usize.pow(k as u32) % 3;
            let (mut matrix, mut constant) = (a.clone(), b.clone());
            for i in 0..N {
                for k in 0..CLIPS {
                    let c = c[i * CLIPS + k];
                    match state(k) {
                        0 => constant[i] -= c,
                        1 => constant[i] += c,
                        _ => {
                            constant[i] += c * d[k];
                            (0..N).for_each(|j| matrix[i * N + j] += c * h[k * N + j]);
                        }
                    }
                }
            }
            let minus: Vec<f64> = constant.iter().map(|v| -v).collect();
            let x = twofold_num::linear::solve_any(&matrix, &minus, 0.0).unwrap();
            let value = |k: usize| (0..N).map(|j| h[k * N + j] * x[j]).sum::<f64>() + d[k];
            let own = (0..CLIPS).all(|k| match state(k) {
                0 => value(k) < -1.0,
                1 => value(k) > 1.0,
                _ => value(k).abs() < 1.0,
            });
            if own && x.iter().all(|x| x.abs() < 10.0) {
                right.push(x);
            }
        }
        assert_eq!(found.rests.len(), right.len(), "{system}: {found:?} {right:?}");
        for x in right {
            let is_it = |r: &crate::rests::Rest| (0..N).all(|i| (r.x[i] - x[i]).abs() < 1e-9);
            assert!(found.rests.iter().any(is_it), "{system}: {x:?}");
        }
    }
}

/// A curve of rests is named by what neighbours of all of it do: not by its end, where the
/// equations change, nor by a point where it crosses another one.
#[test]
fn curves_of_rests_have_the_names_of_their_neighbours() {
    const COME: &str = "stable: neighbours come to the set";
    const LEAVE: &str = "stable but for an end, at which neighbours leave the set";
    const CHANGES: &str = "stability changes along the curve";
    const OPEN: &str = "not decided by the linearised motion";
    for (f, right) in [
        ("'max(x - 1, 0)'", &[LEAVE][..]),
        ("'max(-x - 1, 0)'", &[COME]),
        ("'max(-x, 0)', '-y'", &[COME]),
        ("'if(x < 0, 2, 0)', '-y'", &[COME]),
        ("'1 - sign(x)', '-y'", &[COME]),
        ("'clip(x, -1, 1) - x', '-y'", &[COME]),
        ("'max(x - 1, 0)', '-y'", &[LEAVE]),
        ("'max(x - 1, 0)', 'y'", &["unstable: neighbours leave the set"]),
        ("'0', 'x*y'", &[CHANGES, OPEN]),
        ("'x*y', '0'", &[OPEN, CHANGES]),
        ("'x*y', '-x*y'", &[CHANGES, CHANGES]),
        ("'x^2 - y^2', '0'", &[CHANGES, CHANGES]),
    ] {
        let n = f.matches('\'').count() / 2;
        let text = format!("states = [{}]\nf = [{f}]", &"'x', 'y'"[..5 * n - 2]);
        let found = crate::rests::rests(&model(&text), &vec![(-10.0, 10.0); n]).unwrap();
        let kinds: Vec<String> = found.iter().map(|r| r.kind()).collect();
        assert_eq!(kinds, right, "{f}");
        let is_curve = |r: &crate::rests::Rest| r.family.as_ref().is_some_and(|f| f.dimension == 1);
        assert!(found.iter().all(is_curve), "{f}");
    }
}

/// As many as there are, of which 400 starts do not find all.
#[test]
fn many_rests_are_found() {
    let find = |f: &str| {
        let text = format!("states = ['x', 'y']\nf = [{f}]");
        crate::rests::find(&model(&text), &[(-10.0, 10.0); 2]).unwrap()
    };
    for (factor, along) in [(2.0, 13), (5.0, 31)] {
        let found = find(&format!("'sin({factor}*x)', 'sin({factor}*y)'"));
        assert_eq!((found.rests.len(), found.limits.len()), (along * along, 0), "{factor}");
    }
    // Nearer to each other than what a zero of higher order is known to.
    let near_by: Vec<f64> = find("'x^3 - 1e-12*x', 'y'").rests.iter().map(|r| r.x[0]).collect();
    assert_eq!(near_by.len(), 3, "{near_by:?}");
    near_by.iter().zip([-1e-6, 0.0, 1e-6]).for_each(|(x, right)| near(*x, right, 1e-15));
    for f in ["'x^2', 'y'", "'x^2 - 2*x + 1', 'y'", "'x^3 - 3*x^2 + 3*x - 1', 'y'"] {
        assert_eq!(find(f).rests.len(), 1, "{f}");
    }
}

/// Thirteen signs of thirteen states have 8192 combinations: it is said that not all were tried.
#[test]
fn what_was_not_looked_at_is_said() {
    let names: Vec<String> = (0..13).map(|i| format!("'x{i}'")).collect();
    let f: Vec<String> = (0..13).map(|i| format!("'2 + sign(x{i})'")).collect();
    let text = format!("states = [{}]\nf = [{}]", names.join(", "), f.join(", "));
    let found = crate::rests::find(&model(&text), &[(-1.0, 1.0); 13]).unwrap();
    let has = |limit: &crate::rests::Limit| found.limits.contains(limit);
    assert!(has(&crate::rests::Limit::Sides { functions: 13, tried: 4096 }), "{found:?}");
    assert!(has(&crate::rests::Limit::Surfaces { together: 3 }), "{found:?}");
}

/// One focus with eigenvalues 0.2 +- i, whatever the units of its states.
#[test]
fn a_rest_has_no_units() {
    for unit in [1.0, 1e3, 1e9, 1e12, 1e17] {
        let text = format!(
            "states = ['x', 'y']\nf = ['0.2*x - {unit:e}*y*(1 + (x*y)^2)', '{:e}*x + 0.2*y']",
            1.0 / unit
        );
        for within in [[(-5.0, 4.0); 2], [(-unit, 0.9 * unit), (-1.0 / unit, 0.8 / unit)]] {
            let found = crate::rests::rests(&model(&text), &within).unwrap();
            let [rest] = &found[..] else { panic!("{unit:e} {within:?}: {found:?}") };
            assert_eq!(rest.kind(), "unstable focus", "{unit:e} {within:?}: {rest:?}");
            for [re, im] in &rest.eigenvalues {
                near(*re, 0.2, 1e-12);
                near(im.abs(), 1.0, 1e-12);
            }
        }
    }
}

/// Populations rest where one of them is zero, on the face of the box: an equilibrium of two that
/// compete, x' = x (r - x - a y), has the eigenvalues -r and s - b r at y = 0.
#[test]
fn populations_rest_on_the_face_of_the_box() {
    let ([r, a], [s, b]) = ([0.76, 1.45], [0.92, 0.35]);
    let text = format!("states = ['x', 'y']\nf = ['x*({r} - x - {a}*y)', 'y*({s} - {b}*x - y)']");
    for within in [(0.0, 3.0), (-0.7, 3.0)] {
        let found = crate::rests::rests(&model(&text), &[within; 2]).unwrap();
        // Together they would need a negative number of the first.
        let right = [
            ([0.0, 0.0], [s, r], "unstable node"),
            ([0.0, s], [r - a * s, -s], "stable node"),
            ([r, 0.0], [s - b * r, -r], "saddle"),
        ];
        assert_eq!(found.len(), 3, "{within:?} {found:?}");
        for (rest, (x, eigenvalues, kind)) in found.iter().zip(right) {
            for i in 0..2 {
                near(rest.x[i], x[i], 1e-12);
                near(rest.eigenvalues[i][0], eigenvalues[i], 1e-9);
            }
            assert_eq!(rest.kind(), kind, "{rest:?}");
        }
    }
}

/// Pseudo-equilibria on a circle on which equal weights of the fields cancel: the sliding field is
/// (1 - x^2)/2, -x y/2.
#[test]
fn rests_on_a_circle_are_found() {
    let h = "x^2 + y^2 - 1";
    let text = format!("states = ['x', 'y']\nf = ['0.5 - x*sign({h})', '-y*sign({h})']");
    for half in [1.5, 2.0, 10.0] {
        let found = crate::rests::rests(&model(&text), &[(-half, half); 2]).unwrap();
        let [left, middle, right] = &found[..] else { panic!("{half}: {found:?}") };
        for (rest, [x, weight, rate]) in [(left, [-1.0, 0.25, 0.5]), (right, [1.0, 0.75, -0.5])] {
            near(rest.x[0], x, 1e-12);
            near(rest.x[1], 0.0, 1e-12);
            near(rest.on[0].weight, weight, 1e-12);
            near(rest.eigenvalues[0][0], rate, 1e-12);
            assert_eq!(rest.on[0].surface, "x^2 + y^2 - 1");
        }
        assert!(middle.on.is_empty() && middle.x == [-0.5, 0.0], "{middle:?}");
    }
}

/// A pseudo-equilibrium at y = 0 of x' = a sign(x), y' = b y + sign(x)/2, by the motion to the
/// surface (a) and along it (b).
#[test]
fn pseudo_equilibria_have_the_names_of_the_field() {
    for (a, b, want) in [
        (-1, -1, "stable pseudo-node"),
        (-1, 1, "pseudo-saddle"),
        (1, -1, "pseudo-saddle"),
        (1, 1, "unstable pseudo-node"),
    ] {
        let text = format!("states = ['x', 'y']\nf = ['({a})*sign(x)', '({b})*y + 0.5*sign(x)']");
        let found = crate::rests::rests(&model(&text), &[(-0.3, 0.4); 2]).unwrap();
        let kinds: Vec<String> = found.iter().map(|r| r.kind()).collect();
        assert_eq!(kinds, [want], "{a} {b}");
    }
}

/// Rests where a whole part becomes another number: x = k, where 1/2 - floor x is half of the time
/// 1/2 and half of it -1/2, or mod(x, 1) - 1/4 three quarters of it -1/4.
#[test]
fn rests_on_whole_parts_are_found() {
    let find = |f: &str, low: f64, high: f64| {
        let text = format!("states = ['x']\nf = ['{f}']");
        crate::rests::rests(&model(&text), &[(low, high)]).unwrap()
    };
    for (low, high) in [(-10.0, 10.0), (-2.0, 2.3), (0.5, 1.5)] {
        let found = find("0.5 - floor(x)", low, high);
        let [rest] = &found[..] else { panic!("{low} {high}: {found:?}") };
        assert_eq!((rest.x[0], rest.kind().as_str()), (1.0, "stable"));
        assert_eq!((rest.on[0].surface.as_str(), rest.on[0].weight), ("x - 1", 0.5));
    }
    let found = find("mod(x, 1) - 0.25", -0.5, 5.0);
    let (on, off): (Vec<_>, Vec<_>) = found.iter().partition(|r| !r.on.is_empty());
    assert_eq!((on.len(), off.len()), (6, 5), "{found:?}");
    for (k, rest) in on.iter().enumerate() {
        near(rest.x[0], k as f64, 1e-15);
        near(rest.on[0].weight, 0.75, 1e-12);
        assert_eq!(rest.attracting, Some(true));
    }
    assert!(off.iter().all(|r| r.kind() == "unstable node" && r.x[0].rem_euclid(1.0) == 0.25));
    // With other surfaces: floor y = 2 and x = 0 at once.
    let text = "states = ['x', 'y']\nf = ['-sign(x)', '1.5 - floor(y)']";
    let found = crate::rests::rests(&model(text), &[(-3.0, 3.0); 2]).unwrap();
    let [corner] = &found[..] else { panic!("{found:?}") };
    assert_eq!((corner.x.as_slice(), corner.kind().as_str()), (&[0.0, 2.0][..], "stable"));
}

/// Of three rests within a thousandth of the box the one in the middle.
#[test]
fn rests_between_rests_are_found() {
    for (middle, far) in [(1.0001, 1.0002), (1.00003, 1.0003)] {
        let text = format!("states = ['x']\nf = ['(x - 1)*(x - {middle})*(x - {far})']");
        let found = crate::rests::rests(&model(&text), &[(0.9, 1.1)]).unwrap();
        let [_, rest, _] = &found[..] else { panic!("{found:?}") };
        near(rest.x[0], middle, 1e-9);
    }
}

/// Rests that fill a curve are one row with its ends; those on several surfaces have the weights of
/// a mixture, or of more dimensions.
#[test]
fn rests_on_curves_and_on_several_surfaces() {
    use crate::rests::rests;
    let find =
        |text: &str, half: f64, n: usize| rests(&model(text), &vec![(-half, half); n]).unwrap();
    // A block within friction: x from -1/2 to 1/2 at v = 0, to which neighbours come; no row for
    // the ends, which are zeros of a field.
    let block = find("states = ['x', 'v']\nf = ['v', '-x - 0.5*sign(v)']", 3.0, 2);
    let [stuck] = &block[..] else { panic!("{} rows", block.len()) };
    let [from, to] = stuck.family.as_ref().unwrap().ends.as_ref().unwrap();
    near(from[0], -0.5, 1e-9);
    near(to[0], 0.5, 1e-9);
    near(stuck.x[1], 0.0, 1e-15);
    assert_eq!(stuck.kind(), "stable: neighbours come to the set");
    // The line x + y = 1, from one side of the box to the other, and the origin.
    let line = find("states = ['x', 'y']\nf = ['-x*(1 - x - y)', '-y*(1 - x - y)']", 3.0, 2);
    let [set] = &line.iter().filter(|r| r.family.is_some()).collect::<Vec<_>>()[..] else {
        panic!("{} rows", line.len())
    };
    let [from, to] = set.family.as_ref().unwrap().ends.as_ref().unwrap();
    near(from[0], -2.0, 1e-9);
    near(to[0], 3.0, 1e-9);
    near(from[0] + from[1], 1.0, 1e-9);
    assert_eq!(set.kind(), "unstable: neighbours leave the set");
    assert_eq!(line.len(), 2);
    // On y = 0 the rate across is x: it repels right of zero and attracts left of it.
    let turning = find("states = ['x', 'y']\nf = ['y', 'x*y']", 3.0, 2);
    assert_eq!(turning[0].kind(), "stability changes along the curve");
    // A plane of rests in x < 0, and an isolated one of the same field behind it is not lost.
    let both = "states = ['x', 'y']\nf = ['max(x, 0) * (x - 1)', 'max(x, 0) * (y - 1)']";
    let found = find(both, 3.0, 2);
    let dimensions: Vec<_> =
        found.iter().map(|r| r.family.as_ref().map_or(0, |f| f.dimension)).collect();
    assert!(dimensions.contains(&2) && dimensions.contains(&0), "{dimensions:?}");
    // A circle of rests closes.
    let ring = find("states = ['x', 'y']\nf = ['x*(1 - x^2 - y^2)', 'y*(1 - x^2 - y^2)']", 3.0, 2);
    let closed = ring.iter().find_map(|r| r.family.clone()).unwrap();
    assert_eq!((closed.dimension, closed.ends, ring.len()), (1, None, 2));
    // A corner of two relays: -s + 0.3 = 0 and -u - 0.2 s = 0, so that s = 0.3 and u = -0.06;
    // weights are (1 + s)/2.
    let corner =
        find("states = ['x', 'y']\nf = ['-sign(x) + 0.3', '-sign(y) - 0.2*sign(x)']", 3.0, 2);
    let [rest] = &corner[..] else { panic!("{} rows", corner.len()) };
    near(rest.on[0].weight, 0.65, 1e-12);
    near(rest.on[1].weight, 0.47, 1e-12);
    assert_eq!((rest.kind().as_str(), rest.attracting), ("stable", Some(true)));
    // Relays that work against each other: det W < 0 repels; of one that turns (W = [1, 4; -4, -2],
    // det > 0) the speeds decide.
    let saddle =
        find("states = ['x', 'y']\nf = ['-sign(x) - 2*sign(y)', '-2*sign(x) - sign(y)']", 3.0, 2);
    assert_eq!(saddle.iter().map(|r| r.kind()).collect::<Vec<_>>(), ["unstable"]);
    let open =
        find("states = ['x', 'y']\nf = ['sign(x) + 4*sign(y)', '-4*sign(x) - 2*sign(y)']", 3.0, 2);
    assert_eq!(open[0].kind(), "not decided by the fields there");
    // The linear law of a passage only turns (W = [0, -1; 1, 0]): what remains decides. Squares
    // about the first corner close; a quarter turn about the others maps a to a/(1 + a).
    for turning in [
        "['-sign(y)', 'sign(x)']",
        "['-sign(y) - x', 'sign(x) - y']",
        "['if(y < 1, 2, 0) - x', 'if(x > 1, 2, 0) - y']",
        "['if(y < 1, 2, 0) - x', 'if(x > 1, 3, 0) - y']",
        "['-2*sign(y) + 0.5 - x', 'sign(x) - 0.5 - y']",
    ] {
        let found = find(&format!("states = ['x', 'y']\nf = {turning}"), 3.0, 2);
        let [corner] = &found[..] else { panic!("{turning}: {} rows", found.len()) };
        assert_eq!(
            (corner.attracting, corner.kind().as_str()),
            (None, "not decided by the fields there"),
            "{turning}"
        );
    }
    // In three relays that turn, s^3 = -d with d > 0 for any speeds: two eigenvalues on the right.
    // With a weak pull the speeds decide; with a strong one W + W^T is negative definite.
    for (pull, attracting) in [("0", Some(false)), ("-0.4", None), ("-1", Some(true))] {
        let f = ["xy", "yz", "zx"].map(|pair| {
            let (own, next) = pair.split_at(1);
            format!("{pull}*sign({own}) - sign({next})")
        });
        let found = find(&format!("states = ['x', 'y', 'z']\nf = {f:?}"), 3.0, 3);
        let corner = found.iter().find(|r| r.on.len() == 3).unwrap();
        assert_eq!(corner.attracting, attracting, "{pull}");
    }
    // A third state along the corner: z' = -z + s/2 - 0.4 u with s = 0.3 z, u = 0.1: z =
    // -0.04/0.85, eigenvalue -0.85.
    let edge = find(
        "states = ['x', 'y', 'z']\nf = ['-sign(x) + 0.3*z', '-sign(y) + 0.1', '-z + 0.5*sign(x) - \
            0.4*sign(y)']",
        3.0,
        3,
    );
    let [rest] = &edge[..] else { panic!("{} rows", edge.len()) };
    near(rest.x[2], -0.04 / 0.85, 1e-12);
    near(rest.eigenvalues[0][0], -0.85, 1e-9);
    // Two blocks that friction holds: a set of two dimensions on both surfaces.
    let blocks = "states = ['x1', 'v1', 'x2', 'v2']\nf = ['v1', '-2*x1 + x2 - 0.5*sign(v1)', 'v2', \
        'x1 - 2*x2 - 0.5*sign(v2)']";
    let held = find(blocks, 3.0, 4);
    // The curves where one of them is about to slide are its edges.
    let sets: Vec<_> =
        held.iter().map(|r| (r.on.len(), r.family.as_ref().map(|f| f.dimension))).collect();
    assert_eq!(sets, [(2, Some(2))]);
    // A thermostat: each mode's rest lies behind the event that leaves it.
    let thermostat = "states = ['T']\n[modes.on]\nf = ['30 - T']\n[modes.off]\nf = ['10 - \
        T']\n[[event]]\nname = 'warm'\nwhen = 'T > 22'\nfrom = 'on'\nmode = 'off'\n[[event]]\nname \
        = 'cold'\nwhen = 'T - 18'\ndirection = 'down'\nfrom = 'off'\nmode = 'on'";
    let behind: Vec<_> = find(thermostat, 40.0, 1).into_iter().map(|r| r.behind.unwrap()).collect();
    assert_eq!(behind, ["warm", "cold"]);
    // In units a million times smaller.
    let small = find("states = ['x', 'v']\nf = ['v', '-x - 0.5e-6*sign(v)']", 3e-6, 2);
    near(small[0].family.as_ref().unwrap().ends.as_ref().unwrap()[1][0], 0.5e-6, 1e-15);
}

/// A pole is no zero, for events, sections and switches, wherever it is met together with others; a
/// quotient has the sign of the product.
#[test]
fn poles_are_no_zeros() {
    let count = |when: &str, t_end: f64| {
        let text = format!(
            "states = ['x', 'n']\nstart = [0.1, 0]\nf = ['1', '0']\n[[event]]\nwhen = \
                '{when}'\ndirection = 'both'\nset = {{ n = 'n + 1' }}"
        );
        last(&text, t_end)
    };
    // tan x = 1 at seven places of (0.1, 20.1).
    for (when, want) in [
        ("tan(x) - 1", 7.0),
        ("1/(x - 3)", 0.0),
        ("1/(x - 3) + 2", 1.0),
        ("1/tan(x)", 6.0),
        ("x/(x - 3) - 5", 1.0),
    ] {
        near(count(when, 20.0), want, 0.0);
    }
    let both = "states = ['x', 'n', 'm']\nstart = [0.1, 0, 0]\nf = ['1', '0', \
        '0']\n[[event]]\nwhen = 'tan(x)'\ndirection = 'up'\nset = { n = 'n + 1' }\n[[event]]\nwhen \
        = '1/tan(x) + 1/(x - 2)'\ndirection = 'both'\nset = { m = 'm + 1' }";
    // sin x is zero at six places, where the other one has its poles.
    near(end(both, 20.0)[1], 6.0, 0.0);
    near(end(both, 20.0)[2], 7.0, 0.0);
    let section = twofold_system::Expression::parse_general("tan(x)", &["x"]).unwrap();
    let options = Options { record: Record::Section(section), t_end: 20.0, ..Options::default() };
    let mut rows = 0;
    follow(&model("states = ['x']\nstart = [0.1]\nf = ['1']"), &options, &mut |_| {
        rows += 1;
        true
    })
    .unwrap();
    assert_eq!(rows, 6);
    for (switch, want) in
        [("sign(1/(x - 1))", 1.0), ("sign(x/(x - 1))", 1.0), ("if(2/(x - 1)^3 > 0, 1, -1)", 1.0)]
    {
        near(
            last(&format!("states = ['x', 'y']\nstart = [0, 0]\nf = ['1', '{switch}']"), 3.0),
            want,
            1e-12,
        );
    }
}

/// Poles are no rests, and zeros of high order are.
#[test]
fn rests_are_zeros_of_any_order_and_no_poles() {
    let rests = |f: &str| -> Vec<f64> {
        let model = model(&format!("states = ['x']\nf = ['{f}']"));
        crate::rests::rests(&model, &[(-4.0, 4.0)]).unwrap().iter().map(|r| r.x[0]).collect()
    };
    let pi = std::f64::consts::PI;
    for (f, want) in [
        ("-tan(x)", &[-pi, 0.0, pi][..]),
        ("ln(abs(x - 0.3))", &[-0.7, 1.3]),
        ("x/(x - 1)", &[0.0]),
        ("1/(x - 1)", &[]),
        ("-(x - 1)^5", &[1.0]),
        ("(x - 0.37)^4", &[0.37]),
        ("(x - 0.37)^3*(x + 1)", &[-1.0, 0.37]),
    ] {
        let found = rests(f);
        assert_eq!(found.len(), want.len(), "{f}: {found:?}");
        found.iter().zip(want).for_each(|(x, want)| near(*x, *want, 1e-9));
    }
}

/// Sticking zones that are a thousandth and a millionth of the box are curves, and points of a
/// curve that was found are no rests of their own.
#[test]
fn curves_of_rests_are_found_at_any_length() {
    use crate::rests::rests;
    for (field, from, to) in [
        ("-200*x - v - if(v > 0, 3, 0)", -0.015, 0.0),
        ("-2000*x - v - 3*sign(v)", -0.0015, 0.0015),
        ("-2e5*x - v - 3*sign(v)", -1.5e-5, 1.5e-5),
    ] {
        let text = format!("states = ['x', 'v']\nf = ['v', '{field}']");
        let found = rests(&model(&text), &[(-10.0, 10.0); 2]).unwrap();
        let [rest] = found.as_slice() else { panic!("{field}: {found:?}") };
        let [a, b] = rest.family.clone().unwrap().ends.unwrap();
        near(a[0], from, 1e-8);
        near(b[0], to, 1e-8);
        assert!(rest.kind().starts_with("stable"), "{}", rest.kind());
    }
    let epidemic = model("states = ['S', 'I']\nf = ['-0.2*S*I', '0.2*S*I - 0.2*I']");
    let found = rests(&epidemic, &[(0.0, 3.0), (0.0, 1.0)]).unwrap();
    let [rest] = found.as_slice() else { panic!("{found:?}") };
    assert!(rest.family.as_ref().unwrap().changes);
}

/// Comparisons of what jumps are equal in whole intervals: floor x is 1 from 1 to 2.
#[test]
fn rests_lie_where_a_comparison_is_equal_by_a_jump() {
    for (f, want) in [
        ("-x + if(floor(x) >= 1, 1.5, 0.4)", vec![0.4, 1.5]),
        ("-x + if(floor(x) > 1, 2.5, 1.4)", vec![1.4, 2.5]),
        ("-x + 1.4 + heaviside(floor(x) - 2)", vec![1.4, 2.4]),
    ] {
        let text = format!("states = ['x']\nf = ['{f}']");
        let mut found: Vec<f64> = crate::rests::rests(&model(&text), &[(-5.0, 5.0)])
            .unwrap()
            .iter()
            .filter(|r| r.on.is_empty())
            .map(|r| r.x[0])
            .collect();
        found.sort_by(f64::total_cmp);
        assert_eq!(found.len(), want.len(), "{f}: {found:?}");
        found.iter().zip(&want).for_each(|(x, want)| near(*x, *want, 1e-12));
    }
}
