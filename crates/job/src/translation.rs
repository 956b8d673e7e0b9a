//! Systems with switching functions, f+ and f- as general ones.

use serde_json::{Map, Value, json};
use twofold_hybrid::{Definition, HybridError, Model};
use twofold_system::document::SecondEntry;
use twofold_system::{System, Transition};

use super::question::JobError;
use super::spec::SwitchSpec;

/// A system with h, plus and minus of more states is followed as a [general one](model_with).
pub const MOST_STATES: usize = 4;

/// A system under a smoothed switch (eq. (8)) or in Filippov's sense, with one surface or two, as a
/// general one. The smoothed switch is written into its equations: `phi` is a term, and `eps` (and
/// `sigma`) are parameters, with underscores after them where the system has such names.
///
/// ```
/// use twofold_job::{spec::SwitchSpec, translation::model_with};
/// use twofold_system::System;
/// let smoothed = model_with(&System::builtin("two-fold").unwrap(), SwitchSpec::tanh(1e-2))?;
/// assert_eq!(smoothed.values().unwrap()["eps"], 1e-2);
/// assert!(!smoothed.has_switches());
/// # Ok::<(), twofold_job::JobError>(())
/// ```
///
/// # Errors
/// If the switch has a state or a past of its own; if it is smoothed and the equations ask for a
/// sign, which would stay a jump; if a name of the system has a meaning in general systems.
pub fn model_with(system: &System, switch: SwitchSpec) -> Result<Model, JobError> {
    let refused = |why: String| JobError::from(HybridError::Bad(why));
    let canonical = system.canonical();
    let mut file = match serde_json::to_value(&canonical) {
        Ok(Value::Object(file)) => file,
        _ => unreachable!("a system is an object"),
    };
    let definition = system.definition();
    let name = if system.name().is_empty() { "the system" } else { system.name() };
    file.insert("title".into(), json!(definition.title()));
    let states = definition.states();
    let about = states
        .iter()
        .map(|s| json!({ "name": s.name, "meaning": s.about.meaning, "unit": s.about.unit }));
    file.insert("states".into(), about.collect());
    if let Some(start) = definition.start() {
        file.insert("start".into(), json!(start));
    }
    let axes: Vec<&str> = definition.axes().iter().map(|i| states[*i].name.as_str()).collect();
    file.insert("axes".into(), json!(axes));
    let second = file.remove("second");
    match switch {
        SwitchSpec::Smoothed { eps, transition } => {
            let texts: Vec<&String> = canonical
                .plus
                .iter()
                .chain(&canonical.minus)
                .chain(canonical.terms.values())
                .chain(canonical.second.iter().flat_map(|s| s.plus.iter().chain(&s.minus)))
                .collect();
            if texts.iter().any(|text| text.contains("sign(")) {
                return Err(refused(format!(
                    "the equations of {name} ask for a sign, which a smoothed switch does not \
                        smooth; follow it by --switch filippov"
                )));
            }
            smooth(&mut file, canonical.second.as_ref(), eps, transition);
        }
        SwitchSpec::Filippov { .. } if second.is_none() => {}
        SwitchSpec::Filippov { .. } => {
            let choose = |h: &str, plus: String, minus: String| {
                if plus == minus { plus } else { format!("if({h} > 0, {plus}, {minus})") }
            };
            blend(&mut file, canonical.second.as_ref(), [&canonical.h, ""], &choose);
        }
        SwitchSpec::Hysteretic { .. } | SwitchSpec::Delayed { .. } | SwitchSpec::Relay { .. } => {
            return Err(refused(
                "a switch with a state or a past of its own is followed in up to four states; \
                    write the system as f, with a state or modes for the switch"
                    .into(),
            ));
        }
    }
    let text = Value::Object(file).to_string();
    let definition = Definition::from_json(&text, name).map_err(|e| {
        let help = e.help.map(|help| format!("; {help}")).unwrap_or_default();
        refused(format!(
            "{name}: {}{help} (of more than {MOST_STATES} states it is read as a general system)",
            e.message
        ))
    })?;
    Ok(Model::new(definition))
}

/// Writes the smoothed switch into the equations.
fn smooth(
    file: &mut Map<String, Value>,
    second: Option<&SecondEntry>,
    eps: f64,
    transition: Transition,
) {
    let mut taken: Vec<String> = ["parameters", "let"]
        .iter()
        .flat_map(|key| file[*key].as_object().into_iter().flat_map(Map::keys).cloned())
        .chain(file["states"].as_array().into_iter().flatten().map(|s| word(&s["name"])))
        .collect();
    let mut free = |name: &str| {
        let mut name = name.to_owned();
        while taken.contains(&name) {
            name.push('_');
        }
        taken.push(name.clone());
        name
    };
    let width = free("eps");
    file["parameters"][&width] = json!({ "value": eps, "above": 0 });
    let size = match transition {
        Transition::PerturbedTanh { sigma } => {
            let size = free("sigma");
            file["parameters"][&size] = json!(sigma);
            size
        }
        _ => String::new(),
    };
    let h = word(&file["h"]);
    let mut phi = |h: &str| {
        let u = format!("(({h})/{width})");
        let value = match transition {
            Transition::Tanh => format!("(1 + tanh{u})/2"),
            Transition::PerturbedTanh { .. } => {
                format!("(1 + tanh{u})/2 + {size}*sqrt({width})*exp(-({h})^2)")
            }
            Transition::Arctan => format!("0.5 + atan{u}/pi"),
            Transition::Algebraic => format!("(1 + {u}/sqrt(1 + {u}^2))/2"),
            Transition::Erf => format!("(1 + erf{u})/2"),
        };
        let name = free("phi");
        file["let"][&name] = json!(value);
        name
    };
    let first = phi(&h);
    let other = second.map(|s| phi(&s.h)).unwrap_or_default();
    let mix = |phi: &str, plus: String, minus: String| {
        if plus == minus { plus } else { format!("{minus} + ({plus} - {minus})*{phi}") }
    };
    blend(file, second, [&first, &other], &mix);
}

/// A component of a field from those on both sides of a surface.
type Blended<'a> = &'a dyn Fn(&str, String, String) -> String;

/// Puts `f`, made by `mix` of the switches' words and the fields on both sides, in the place of h,
/// f+ and f-.
fn blend(
    file: &mut Map<String, Value>,
    second: Option<&SecondEntry>,
    [first, other]: [&str; 2],
    mix: Blended<'_>,
) {
    let fields = ["plus", "minus"].map(|key| file.remove(key).unwrap_or_default());
    file.remove("h");
    let bracketed = |text: &str| format!("({text})");
    let count = fields[0].as_array().map_or(0, Vec::len);
    let component = |i: usize| {
        let [plus, minus] = [&fields[0][i], &fields[1][i]].map(|e| bracketed(&word(e)));
        let above = mix(first, plus, minus);
        let Some(s) = second else { return above };
        let below = mix(first, bracketed(&s.plus[i]), bracketed(&s.minus[i]));
        let word = if other.is_empty() { &s.h } else { other };
        mix(word, bracketed(&above), bracketed(&below))
    };
    file.insert("f".into(), (0..count).map(component).collect());
}

fn word(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cases;
    use crate::general::GeneralRun;
    use crate::spec::Observation;
    use twofold_hybrid::Options;
    use twofold_integrate::filippov::{ExitRule, Side};

    const TURN: &str = "states = ['x', 'y', 'phi']\nstart = [0.3, -0.5, 0.2]\nh = 'y - 0.1*x'\n\
        plus = ['y', '-x - 1', 'x*y - phi']\nminus = ['y + 0.2', '1 - x', '-phi']\n";

    fn end_of(model: Model, t_end: f64) -> Vec<f64> {
        let options = Options { t_end, rtol: 1e-12, ..Options::default() };
        let answer = GeneralRun { model, options }.stream(&mut |_| true, &|_| true).unwrap();
        answer.fact("x").unwrap()
    }

    /// The same motion as by the engine of few states, whatever the transition.
    #[test]
    fn translated_systems_move_as_before() {
        let second = format!(
            "{TURN}[second]\nh = 'x + 0.3'\nplus = ['y - 1', '2 - x', '1']\n\
                minus = ['y', 'x', '-x']\n"
        );
        let transitions = [
            Transition::Tanh,
            Transition::PerturbedTanh { sigma: 0.2 },
            Transition::Arctan,
            Transition::Algebraic,
            Transition::Erf,
        ];
        let exit = ExitRule::AtOnce { side: Side::Plus };
        let filippov = SwitchSpec::Filippov { exit, funnel: None };
        let smoothed = transitions.map(|t| SwitchSpec::Smoothed { eps: 0.1, transition: t });
        for text in [TURN, &second] {
            for switch in smoothed.into_iter().chain([filippov]) {
                let system = cases::of(text);
                let mut run =
                    cases::run(system.clone(), switch, 3.0, Observation::Times { every: 3.0 });
                run.start = vec![0.3, -0.5, 0.2];
                run.method.name = crate::spec::Method::Dopri5;
                run.method.tolerance = twofold_integrate::Tolerance { rtol: 1e-12, atol: 1e-12 };
                let answer = crate::simulate::answer(&run, &()).unwrap();
                let there: Vec<f64> = answer.fact("state").unwrap();
                let here = end_of(model_with(&system, switch).unwrap(), 3.0);
                let apart = there.iter().zip(&here).map(|(a, b)| (a - b).abs());
                assert!(apart.fold(0.0, f64::max) < 1e-9, "{switch:?} {there:?} {here:?}");
            }
        }
    }

    #[test]
    fn switches_that_cannot_be_translated_are_refused() {
        let system = cases::of(TURN);
        for switch in [SwitchSpec::delayed(0.1), SwitchSpec::relay(0.1)] {
            assert!(model_with(&system, switch).unwrap_err().to_string().contains("modes"));
        }
        let rough = cases::of(&TURN.replace("'1 - x'", "'1 - sign(x)'"));
        let error = model_with(&rough, SwitchSpec::tanh(0.1)).unwrap_err();
        assert!(error.to_string().contains("ask for a sign"), "{error}");
    }
}
