//! Sensitivity of the state at the end of a run to the start and to parameters.
//!
//! Parameters become states that do not move, so that one set of tangent vectors, with the same
//! saltation matrices, carries both. Everything that happens at a switch or reset is in them: that
//! it comes earlier or later, and that the reset itself depends on the parameter (the jumps of
//! parametric sensitivities: Galán, Feehery & Barton 1999, Applied Numerical Mathematics 31, 17).

use std::collections::BTreeMap;

use super::tangent::explicit;
use super::{Ending, Follower, HybridError, Options, Record, same};
use crate::Model;
use crate::definition::{Constant, ParameterEntry, When};
use crate::value::evaluate;
use twofold_num::{Decimal, Dual};
use twofold_system::Expression;
use twofold_system::document::{About, StateEntry};

/// The derivatives of the state at the end of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensitivities {
    /// When the run ended.
    pub t: f64,
    /// The state then.
    pub x: Vec<f64>,
    /// A row a state: its derivatives by the components of the start. NaN where those from the two
    /// sides differ: for a component that moves the start off a switching surface on which it lies
    /// and does not slide.
    pub by_start: Vec<Vec<f64>>,
    /// A row a state: its derivatives by the parameters, in the order in which they were asked for.
    /// Parameters that are given by the one that is changed change with it, all others and the
    /// start are held fixed. NaN as above, for one that moves such a surface.
    pub by_parameter: Vec<Vec<f64>>,
}

/// The derivatives of the state at `options.t_end` by the start and by these parameters.
///
/// # Errors
/// As [`follow`](super::follow); also where there is no derivative: at a grazing, at two surfaces
/// at once, at rest after accumulated impacts, if an event ends the run, and for a parameter that
/// sets the times of events.
pub fn sensitivities(
    model: &Model,
    options: &Options,
    parameters: &[&str],
) -> Result<Sensitivities, HybridError> {
    explicit(options)?;
    let n = model.coordinates().len();
    let moved = by_parameters(model, parameters)?;
    let (model, values) = with_states(model, parameters)?;
    let start = match &options.start {
        Some(start) => start.clone(),
        None => model.1.clone().ok_or_else(|| {
            HybridError::Start("the file has no start: give one (--start)".into())
        })?,
    };
    let whole: Vec<f64> = start.into_iter().chain(values).collect();
    let settings = Options {
        start: Some(whole.clone()),
        record: Record::Times { every: f64::INFINITY },
        ..options.clone()
    };
    let mut follower = Follower::new(&model.0, &settings)?;
    let unit = |i: usize| {
        let mut v = vec![0.0; whole.len()];
        v[i] = 1.0;
        v
    };
    let beside = moved.iter().map(|of| [vec![0.0; n], of.clone()].concat());
    follower.begin_tangents((0..n).map(unit).chain(beside).collect())?;
    let mut one_sided = follower.begins_between_sides();
    let parameters_between = one_sided[n..].to_vec();
    for (one, of) in one_sided[n..].iter_mut().zip(&moved) {
        *one = of.iter().zip(&parameters_between).any(|(by, between)| *by != 0.0 && *between);
    }
    let (outcome, follower) = follower.run_whole(&mut |_| true)?;
    if outcome.ending != Ending::Finished {
        let why =
            format!("the run ends at t = {}, before --t-end: give a time before it", outcome.t);
        let x = outcome.x[..n].to_vec();
        return Err(HybridError::Stuck { t: outcome.t, x, why });
    }
    let mut vectors = follower.tangents.map_or_else(Vec::new, |t| t.vectors);
    vectors.iter_mut().zip(one_sided).filter(|(_, one)| *one).for_each(|(v, _)| v.fill(f64::NAN));
    let rows =
        |columns: &[Vec<f64>]| (0..n).map(|i| columns.iter().map(|c| c[i]).collect()).collect();
    Ok(Sensitivities {
        t: outcome.t,
        x: outcome.x[..n].to_vec(),
        by_start: rows(&vectors[..n]),
        by_parameter: rows(&vectors[n..]),
    })
}

impl Follower<'_> {
    /// Of each component of the start, whether it moves the start off a surface on which it lies
    /// and does not slide, with other fields on its other side: neighbours there begin with those;
    /// or off one that a field runs along on one side: there they stay beside it. Or whether it
    /// changes the speed, which is zero, at which the motion leaves such a surface.
    fn begins_between_sides(&mut self) -> Vec<bool> {
        /// Distance, in units of a component or of 1, at which a speed is looked at.
        const BESIDE: f64 = 1e-6;
        let n = self.n;
        let mut between = vec![false; n];
        self.variables[..n].copy_from_slice(&self.x);
        self.variables[n] = self.t;
        let (compiled, mut variables) = (self.compiled.clone(), self.variables.clone());
        let mut watched = vec![0.0; compiled.outputs];
        compiled.watched.evaluate(&variables, &mut watched);
        let gradients = compiled.gradients(&variables);
        let (mut own, mut other) = (vec![0.0; n], vec![0.0; n]);
        compiled.field.evaluate(&variables, &mut own);
        for guard in 0..self.slides.len() {
            let Some(place) = compiled.place(guard) else { continue };
            let moved = gradients[place].iter().zip(&compiled.touches[place]);
            let moved = moved.filter(|(slope, variable)| **variable < n && **slope != 0.0);
            if self.slides[guard] {
                let beside = moved.filter(|_| self.along[guard] != 0.0);
                beside.for_each(|(_, variable)| between[*variable] = true);
                continue;
            }
            let (value, side) = (watched[place], self.config.sides[guard]);
            if side == 0.0 && !self.equation.guards[guard].whole {
                // Motion that rests on a kink: neighbours that leave it have other slopes.
                if self.slopes_differ(guard) {
                    let (core, _) = self.equation.core_and_time(&[guard], self.config.mode);
                    between.iter_mut().zip(core).for_each(|(between, of)| *between |= of);
                }
                continue;
            }
            let across = match self.equation.guards[guard].whole {
                true if value.fract() == 0.0 && side == value => value - 1.0,
                true if value.fract() == 0.0 => value,
                false if value == 0.0 => -side,
                _ => continue,
            };
            let mut config = self.config.clone();
            config.sides[guard] = across;
            variables[n + 1 + guard] = across;
            self.equation.compiled(&config).field.evaluate(&variables, &mut other);
            variables[n + 1 + guard] = side;
            if same(&own, &other) {
                continue;
            }
            moved.for_each(|(_, variable)| between[*variable] = true);
            // Motion that begins along the surface is behind it first if that speed is changed.
            let speed = |variables: &[f64]| {
                let mut field = vec![0.0; n];
                compiled.field.evaluate(variables, &mut field);
                Self::along(&compiled, variables, &field)[place]
            };
            if speed(&variables) == 0.0 {
                for (i, between) in between.iter_mut().enumerate() {
                    let kept = variables[i];
                    variables[i] += BESIDE * kept.abs().max(1.0);
                    *between |= speed(&variables) != 0.0;
                    variables[i] = kept;
                }
            }
        }
        between
    }

    /// Whether the field has other derivatives by the states on the two sides of a function that is
    /// zero.
    fn slopes_differ(&mut self, guard: usize) -> bool {
        const SAME: f64 = 1e-6;
        let n = self.n;
        let [low, high] = [-1.0, 1.0].map(|side| {
            let mut config = self.config.clone();
            config.sides[guard] = side;
            let (compiled, variables) = (self.equation.compiled(&config), self.load(&config));
            let slopes = |j: usize| {
                let dual = |(i, v): (usize, &f64)| Dual {
                    value: *v,
                    partials: [if i == j { 1.0 } else { 0.0 }],
                };
                let duals: Vec<Dual<f64, 1>> = variables.iter().enumerate().map(dual).collect();
                let mut out = vec![Dual::constant(0.0); n];
                compiled.field.evaluate(&duals, &mut out);
                out.iter().map(|d| d.partials[0]).collect::<Vec<f64>>()
            };
            (0..n).flat_map(slopes).collect::<Vec<f64>>()
        });
        let differ = |(a, b): (&f64, &f64)| (a - b).abs() > SAME * a.abs().max(b.abs());
        low.iter().zip(&high).any(differ)
    }
}

/// The parameters that have derivatives: all but those that set times of events.
pub fn parameters(model: &Model) -> Vec<String> {
    let definition = model.definition();
    let timed: Vec<&str> = definition
        .events()
        .iter()
        .flat_map(|event| match &event.when {
            When::At(times) => times.iter().flat_map(Expression::names).collect(),
            When::Every(time) => time.names(),
            _ => Vec::new(),
        })
        .collect();
    let parameters = definition.parameters();
    // A parameter that others are given by sets what they set.
    let sets = |name: &str| {
        let mut reached = vec![name];
        for p in parameters {
            if !model.is_given(&p.name) && p.value.names().iter().any(|n| reached.contains(n)) {
                reached.push(&p.name);
            }
        }
        reached.iter().any(|name| timed.contains(name))
    };
    parameters.iter().filter(|p| !sets(&p.name)).map(|p| p.name.clone()).collect()
}

/// The derivatives of these parameters' values by each of them, as far as they are given by one
/// another: a row for each that is changed.
fn by_parameters(model: &Model, parameters: &[&str]) -> Result<Vec<Vec<f64>>, HybridError> {
    let values = model.values().map_err(|e| HybridError::Bad(e.to_string()))?;
    let row = |changed: &&str| {
        let mut duals: BTreeMap<&str, Dual<f64, 1>> = BTreeMap::new();
        for p in model.definition().parameters() {
            let dual = if p.name == *changed {
                Dual::variable(values[&p.name], 0)
            } else if model.is_given(&p.name) {
                Dual::constant(values[&p.name])
            } else {
                evaluate(&p.value, &|name| duals.get(name).copied())
            };
            duals.insert(&p.name, dual);
        }
        parameters.iter().map(|name| duals.get(name).map_or(0.0, |d| d.partials[0])).collect()
    };
    Ok(parameters.iter().map(row).collect())
}

/// The model and the start that its file gives.
type Extended = (Model, Option<Vec<f64>>);

/// The model with these parameters as states that do not move, and their values. What depends on
/// them becomes a term.
fn with_states(model: &Model, parameters: &[&str]) -> Result<(Extended, Vec<f64>), HybridError> {
    let bad = |why: String| HybridError::Bad(why);
    let values = model.values().map_err(|e| bad(e.to_string()))?;
    let known: Vec<&str> =
        model.definition().parameters().iter().map(|p| p.name.as_str()).collect();
    for (i, name) in parameters.iter().enumerate() {
        if !known.contains(name) {
            let known = if known.is_empty() { "none".into() } else { known.join(", ") };
            return Err(bad(format!("there is no parameter `{name}`; the system has {known}")));
        }
        if parameters[..i].contains(name) {
            return Err(bad(format!("the parameter `{name}` is named twice")));
        }
    }
    let derivable = self::parameters(model);
    if let Some(name) = parameters.iter().find(|p| !derivable.iter().any(|d| d == *p)) {
        return Err(bad(format!(
            "no derivative by {name}, which sets the times of events; leave it out (--by)"
        )));
    }
    let start = model.start().map_err(|e| bad(e.to_string()))?;
    let mut document = model.definition().document().clone();
    document.start = None;
    let names: Vec<String> = parameters.iter().map(|p| (*p).to_owned()).collect();
    document.states.extend(
        names.iter().map(|name| StateEntry { name: name.clone(), about: About::default() }),
    );
    let fields = [&mut document.f, &mut document.plus, &mut document.minus].into_iter().flatten();
    for field in fields.chain(document.modes.0.iter_mut().map(|(_, mode)| &mut mode.f)) {
        field.extend(names.iter().map(|_| Constant::Number(0.0)));
    }
    // A parameter that is given by others moves with them, unless it has a value of its own.
    let mut moving = names.clone();
    let mut kept = Vec::new();
    for (name, entry) in std::mem::take(&mut document.parameters.0) {
        let value = match &entry {
            ParameterEntry::Plain(value) | ParameterEntry::Table { value, .. } => value.clone(),
        };
        let parameter = model.definition().parameters().iter().find(|p| p.name == name);
        let depends = !model.is_given(&name)
            && parameter
                .is_some_and(|p| p.value.names().iter().any(|n| moving.iter().any(|m| m == n)));
        if names.contains(&name) {
            continue;
        }
        if depends {
            moving.push(name.clone());
            document.terms.0.push((name, value));
        } else {
            // Its value, whatever it was made from.
            let value = Constant::Text(Decimal::from(values[&name]).to_string());
            kept.push((name, ParameterEntry::Plain(value)));
        }
    }
    document.parameters.0 = kept;
    let extended = model
        .redefined(document)
        .map_err(|why| bad(format!("no derivative by {}: {why}", names.join(", "))))?;
    Ok(((extended, start), names.iter().map(|n| values[n]).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Definition;
    use crate::motion::follow;

    fn model(text: &str) -> Model {
        Model::new(Definition::from_toml(text, "test.toml").unwrap())
    }

    fn at(t_end: f64) -> Options {
        Options { t_end, ..Options::default() }
    }

    const BALL: &str = r#"
        states = ["x", "v"]
        start = [1, 0]
        f = ["v", "-g"]
        [parameters]
        g = 2
        r = 0.5
        twice = "2*r"
        [[event]]
        when = "x"
        direction = "down"
        set = { v = "-0.5*twice*v" }
    "#;

    /// Coulomb friction from rest: a neighbour with v > 0 turns back at once.
    #[test]
    fn a_start_on_a_surface_has_two_derivatives() {
        let text = "states = ['x', 'v']\nf = ['v', '-x - F*sign(v)']\n[parameters]\nF = 1";
        let from = |v: f64| {
            let options = Options { start: Some(vec![4.5, v]), ..at(2.0) };
            sensitivities(&model(text), &options, &["F"]).unwrap()
        };
        let on = from(0.0);
        let (cos, sin) = (2.0_f64.cos(), 2.0_f64.sin());
        assert!(on.by_start.iter().all(|row| row[1].is_nan()), "{on:?}");
        for (found, right) in [
            (on.by_start[0][0], cos),
            (on.by_start[1][0], -sin),
            (on.by_parameter[0][0], 1.0 - cos),
            (from(-1e-9).by_start[0][1], sin),
        ] {
            assert!((found - right).abs() < 1e-6, "{found}, right: {right}");
        }
    }

    #[test]
    fn a_ball_after_one_impact() {
        // It lands at t1 = sqrt(2 h/g) = 1 and leaves at r g t1.
        let found = sensitivities(&model(BALL), &at(1.5), &["r", "g"]).unwrap();
        let (g, r, t1, s) = (2.0, 0.5, 1.0, 0.5);
        let earlier = 1.0 / (g * t1); // of the landing, by the height
        let speed = r * g * t1 - g * s;
        let by_height = [r * g * earlier * s - speed * earlier, r * g * earlier + g * earlier];
        let t1_by_g = -0.5 * t1 / g;
        let by_r = [g * t1 * s, g * t1];
        let by_g = [
            r * (t1 + g * t1_by_g) * s - 0.5 * s * s - speed * t1_by_g,
            r * (t1 + g * t1_by_g) - s + g * t1_by_g,
        ];
        for i in 0..2 {
            let of = [found.by_start[i][0], found.by_parameter[i][0], found.by_parameter[i][1]];
            for (a, b) in of.into_iter().zip([by_height[i], by_r[i], by_g[i]]) {
                assert!((a - b).abs() < 1e-8, "{of:?}: {b}");
            }
        }
    }

    /// Dry friction on a belt: sliding, its end, and a drive; against central differences.
    #[test]
    fn through_sliding_as_by_finite_differences() {
        let text = r#"
            states = ["x", "v"]
            start = [0.5, 0]
            f = ["v", "-x - friction*sign(v - belt) + 0.3*cos(1.3*t)"]
            [parameters]
            belt = 0.3
            friction = 1
        "#;
        let end = |x: f64, friction: f64| {
            let m = model(text).with("friction", friction).unwrap();
            let options = Options { start: Some(vec![x, 0.0]), rtol: 1e-12, ..at(17.0) };
            follow(&m, &options, &mut |_| true).unwrap().x
        };
        let found =
            sensitivities(&model(text), &Options { rtol: 1e-12, ..at(17.0) }, &["friction"])
                .unwrap();
        let d = 1e-4;
        let by_x: Vec<f64> = end(0.5 + d, 1.0)
            .iter()
            .zip(end(0.5 - d, 1.0))
            .map(|(a, b)| (a - b) / (2.0 * d))
            .collect();
        let by_f: Vec<f64> = end(0.5, 1.0 + d)
            .iter()
            .zip(end(0.5, 1.0 - d))
            .map(|(a, b)| (a - b) / (2.0 * d))
            .collect();
        assert!(by_f.iter().any(|v| v.abs() > 1e-3));
        for i in 0..2 {
            assert!((found.by_start[i][0] - by_x[i]).abs() < 1e-5, "{:?} {by_x:?}", found.by_start);
            assert!(
                (found.by_parameter[i][0] - by_f[i]).abs() < 1e-5,
                "{:?} {by_f:?}",
                found.by_parameter
            );
        }
    }

    /// A parameter that is given by another moves with it, as it does where that one is set,
    /// whether or not both are asked for.
    #[test]
    fn derivatives_are_those_of_setting_a_parameter() {
        let text = r#"
            states = ["x"]
            start = [1]
            f = ["-r*x + p*cos(t)"]
            [parameters]
            p = 1
            q = "2*p"
            r = "q^2 - 2*q + p"
        "#;
        let end = |set: &[(&str, f64)]| {
            let m = set.iter().fold(model(text), |m, (name, v)| m.with(name, *v).unwrap());
            follow(&m, &Options { rtol: 1e-12, ..at(1.0) }, &mut |_| true).unwrap().x[0]
        };
        for (set, names) in [
            (&[][..], &["p", "q", "r"][..]),
            (&[], &["p"]),
            (&[], &["r", "p"]),
            (&[("q", 2.0)], &["p", "q", "r"]),
            (&[("r", 1.0)], &["q", "p"]),
        ] {
            let m = set.iter().fold(model(text), |m, (name, v)| m.with(name, *v).unwrap());
            let values = m.values().unwrap();
            let found = sensitivities(&m, &at(1.0), names).unwrap();
            for (name, found) in names.iter().zip(&found.by_parameter[0]) {
                let moved = |by: f64| {
                    let of = [set, &[(*name, values[*name] + by)]].concat();
                    end(&of)
                };
                let right = (moved(1e-4) - moved(-1e-4)) / 2e-4;
                assert!((found - right).abs() < 1e-6, "{name} of {names:?}: {found}, {right}");
            }
        }
    }

    /// Motion that rests where a function is zero until t = 1: neighbours drift meanwhile, and have
    /// a derivative where the field has one there.
    #[test]
    fn neighbours_of_what_rests_on_a_kink_move() {
        let at_rest = |f: &str, start: &str| {
            let text = format!("states = ['x', 'v', 'z']\nstart = {start}\nf = {f}");
            sensitivities(&model(&text), &at(3.0), &[]).unwrap().by_start
        };
        // x = v0 t + (t - 1)^2/2.
        for (power, by_v) in [("^1.5", 7.0 / 2.0_f64.sqrt()), ("^2", 20.0 / 3.0)] {
            let found =
                at_rest(&format!("['v', 'heaviside(t - 1)', 'max(x, 0){power}']"), "[0, 0, 0]");
            assert!((found[0][1] - 3.0).abs() < 1e-9 && (found[1][1] - 1.0).abs() < 1e-9);
            assert!((found[2][1] - by_v).abs() < 1e-7, "{power}: {found:?}");
        }
        // With a slope on one side the derivatives from the two sides differ.
        let found = at_rest("['v', 'heaviside(t - 1)', 'max(x - 1, 0)']", "[1, 0, 0]");
        assert!(found[2][0].is_nan() && found[2][1].is_nan() && found[2][2] == 1.0, "{found:?}");
    }

    /// Two blocks that hold independently, each at its own belt: what is normal to both surfaces
    /// goes, what is along them stays.
    #[test]
    fn a_start_in_sliding_is_projected_to_the_surfaces() {
        let text = r#"
            states = ["x", "y", "z"]
            start = [0, 0.5, 1]
            f = ["c - 2*sign(x)", "-3*sign(y - p)", "x + y"]
            [parameters]
            c = 0.5
            p = 0.5
        "#;
        let found = sensitivities(&model(text), &at(2.0), &["p", "c"]).unwrap();
        for (i, want) in [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]].iter().enumerate() {
            assert!(
                found.by_start[i].iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-12),
                "{:?}",
                found.by_start
            );
        }
        assert_eq!(found.by_parameter, [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]);
        // One surface that is not a coordinate's: the same for both of its sides.
        let oblique =
            "states = ['x', 'y']\nstart = [1, -1]\nf = ['1 - 2*sign(x + y)', '-sign(x + y)']";
        let found = sensitivities(&model(oblique), &at(1.0), &[]).unwrap();
        let back = |side: f64| {
            let options = Options { start: Some(vec![1.0 + side, -1.0]), ..at(1.0) };
            follow(&model(oblique), &options, &mut |_| true).unwrap().x
        };
        for side in [1e-3, -1e-3] {
            let (moved, x) = (back(side), back(0.0));
            for i in 0..2 {
                assert!(
                    (found.by_start[i][0] - (moved[i] - x[i]) / side).abs() < 1e-9,
                    "{:?}",
                    found.by_start
                );
            }
        }
    }

    #[test]
    fn what_has_no_derivative_is_said() {
        let says = |text: &str, options: &Options, by: &[&str], expected: &str| {
            let error = sensitivities(&model(text), options, by).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        };
        says(BALL, &at(1.5), &["q"], "no parameter `q`; the system has g, r, twice");
        says(BALL, &at(1.5), &["g", "g"], "named twice");
        let timed = "states = ['x']\nstart = [1]\nf = ['-x']\n[parameters]\np = \
            1\n[[event]]\nevery = 'p'\nset = { x = '2*x' }";
        says(timed, &at(1.5), &["p"], "no derivative by p, which sets the times of events");
        let stops = "states = ['x']\nstart = [1]\nf = ['-1']\n[[event]]\nwhen = 'x'\nstop = true";
        says(stops, &at(3.0), &[], "before --t-end: give a time before it");
        let corner =
            "states = ['x', 'y']\nstart = [-1, -1]\nf = ['1 + 0.5*sign(x)', '1 + 0.5*sign(y)']";
        says(corner, &at(3.0), &[], "two surfaces are met at one moment");
        // Thrown up to a ceiling that it just reaches, and a little faster: then the derivative is
        // large, and one.
        let up = |v: &str| {
            format!(
                "states = ['x', 'v']\nstart = [0, {v}]\nf = ['v', '-1']\n[[event]]\nwhen = 'x - \
                    0.5'\ndirection = 'up'\nset = {{ v = '-v' }}"
            )
        };
        says(&up("1"), &at(1.5), &[], "only touched (grazing)");
        assert!(sensitivities(&model(&up("1.0001")), &at(1.5), &[]).is_ok());
    }
}
