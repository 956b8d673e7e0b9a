//! Words and numbers for people: small print, in the renderer's rich-text markup.

use super::ParameterReading;
use twofold_integrate::filippov::{ExitRule, Side, SlidingLaw};
use twofold_integrate::{Kick, StepCap};
use twofold_job::spec::{MethodSpec, RunSpec, SwitchSpec};
use twofold_render::markup;
pub use twofold_render::number::number;
use twofold_system::{Relaxation, System, Transition};

/// "first reading: *α* = 0.1, *β* = 10^{-5}".
pub fn reading(reading: &ParameterReading) -> String {
    let parameters = parameters(reading);
    let colon = if parameters.is_empty() { "" } else { ": " };
    format!("{} reading{colon}{parameters}", reading.name)
}

/// "*α* = 0.1, *β* = 10^{-5}".
pub fn parameters(reading: &ParameterReading) -> String {
    numbers(reading.parameters.iter().map(|(name, value)| (name.as_str(), *value)))
}

/// The same of any numbers; a long list is cut.
pub fn numbers<'a>(named: impl IntoIterator<Item = (&'a str, f64)>) -> String {
    const MOST: usize = 12;
    let said = |(name, value)| format!("{} = {}", markup::name(name), angle(value));
    let mut all: Vec<String> = named.into_iter().map(said).collect();
    if all.len() > MOST {
        all.truncate(MOST);
        all.push("…".into());
    }
    all.join(", ")
}

/// The system and its parameters.
pub fn system(system: &System) -> String {
    match system.compiled() {
        Some(c) => format!(
            "*α* = {}, *β* = {}, *v*_{{+}} = {}, *v*_{{−}} = {}",
            number(c.alpha),
            number(c.beta),
            number(c.v_plus),
            number(c.v_minus)
        ),
        None => {
            let parameters = numbers(system.parameters().map(|(name, v)| (name, v.value())));
            let title = markup::literal(system.definition().title());
            [title, parameters].into_iter().filter(|s| !s.is_empty()).collect::<Vec<_>>().join(", ")
        }
    }
}

/// A number, where it is a plain fraction of π as that.
fn angle(value: f64) -> String {
    let fraction =
        [2, 3, 4, 6, 8, 12].into_iter().find(|n| value == std::f64::consts::PI / f64::from(*n));
    fraction.map_or_else(|| number(value), |n| format!("π/{n}"))
}

/// Model of the switch, in words.
pub fn switch(switch: &SwitchSpec) -> String {
    match switch {
        SwitchSpec::Smoothed { eps, transition: Transition::Tanh } => {
            format!("tanh smoothing, *ε* = {}", number(*eps))
        }
        SwitchSpec::Smoothed { eps, transition: Transition::PerturbedTanh { sigma } } => {
            format!("perturbed tanh smoothing, *ε* = {}, *σ* = {}", number(*eps), number(*sigma))
        }
        SwitchSpec::Smoothed { eps, transition: Transition::Arctan } => {
            format!("arctan smoothing, *ε* = {}", number(*eps))
        }
        SwitchSpec::Smoothed { eps, transition: Transition::Algebraic } => {
            format!("algebraic smoothing, *ε* = {}", number(*eps))
        }
        SwitchSpec::Smoothed { eps, transition: Transition::Erf } => {
            format!("erf smoothing, *ε* = {}", number(*eps))
        }
        SwitchSpec::Hysteretic { eps, eps_prime, relaxation, .. } => format!(
            "hysteresis ({}), *ε* = {}, *ε*′ = {}",
            match relaxation {
                Relaxation::Literal => "literal",
                Relaxation::Single => "single division",
            },
            number(*eps),
            number(*eps_prime)
        ),
        SwitchSpec::Delayed { delay, eps, .. } => match eps {
            Some(eps) => {
                format!("switch delayed by {}, smoothed, *ε* = {}", number(*delay), number(*eps))
            }
            None => format!("switch delayed by {}", number(*delay)),
        },
        SwitchSpec::Relay { band, .. } => format!("relay with memory, band ±{}", number(*band)),
        // A run that needs an exit and has no rule for it is refused.
        SwitchSpec::Filippov { exit: ExitRule::Undecided, .. } => "discontinuous (Filippov)".into(),
        SwitchSpec::Filippov { exit, .. } => {
            format!("discontinuous (Filippov), exit {}", exit_rule(exit))
        }
    }
}

/// An exit rule in words.
pub fn exit_rule(rule: &ExitRule) -> String {
    let to = |side: Side| match side {
        Side::Plus => "*h* > 0",
        Side::Minus => "*h* < 0",
    };
    match rule {
        ExitRule::AtOnce { side } => format!("at once to {}", to(*side)),
        ExitRule::AfterTime { time, side } => {
            format!("after a time of {} to {}", number(*time), to(*side))
        }
        ExitRule::AfterArc { arc, side } => {
            format!("after an arc of {} to {}", number(*arc), to(*side))
        }
        ExitRule::Random { law, plus_probability, seed, stream } => {
            let law = match law {
                SlidingLaw::Uniform { longest } => format!("uniform up to {}", number(*longest)),
                SlidingLaw::Exponential { mean } => {
                    format!("exponential with mean {}", number(*mean))
                }
            };
            format!(
                "after a random time ({law}) to a random side (*h* > 0 with probability {}; \
                    ChaCha8, seed {seed}, stream {stream})",
                number(*plus_probability)
            )
        }
        ExitRule::Undecided => "none: the run ends where one is needed".into(),
        ExitRule::All => "all: the whole funnel".into(),
    }
}

/// Error control: tolerances and step cap.
pub fn control(method: &MethodSpec) -> String {
    let tolerance = method.tolerance;
    let tolerances = if tolerance.rtol == tolerance.atol {
        format!("rtol = atol = {}", number(tolerance.rtol))
    } else {
        format!("rtol = {}, atol = {}", number(tolerance.rtol), number(tolerance.atol))
    };
    match method.step_cap {
        StepCap::None => tolerances,
        StepCap::Absolute(h) => format!("{tolerances}, steps up to {}", number(h)),
        StepCap::FractionOfSegment(f) => {
            format!("{tolerances}, steps up to {} of the interval", number(f))
        }
    }
}

/// The method's name and its error control.
pub fn method(method: &MethodSpec) -> String {
    format!("{}, {}", method.name.name(), control(method))
}

/// Restarts and kicks of a run; empty if there are none.
pub fn schedule(run: &RunSpec) -> String {
    let restarts =
        run.schedule.restart_every.map(|every| format!("restarted every {}", number(every)));
    let kicks = run.schedule.kick.map(|k| kicks(&k));
    restarts.into_iter().chain(kicks).collect::<Vec<_>>().join(", ")
}

fn kicks(kick: &Kick) -> String {
    format!(
        "perturbations of length {} every {} (ChaCha8, seed {})",
        number(kick.size),
        number(kick.every),
        kick.seed
    )
}

/// Settings that all runs of a picture have in common and those that differ, one line per subject,
/// for its foot.
pub fn small_print(reading: Option<&str>, runs: &[&RunSpec]) -> Vec<String> {
    let all = |say: &dyn Fn(&RunSpec) -> Option<String>, join: &str| {
        let mut said: Vec<String> = Vec::new();
        for text in runs.iter().filter_map(|r| say(r)) {
            if !said.contains(&text) {
                said.push(text);
            }
        }
        together(&said).join(join)
    };
    let mut lines: Vec<Vec<String>> = vec![
        vec![
            reading.map_or(String::new(), |name| format!("{name} reading")),
            all(&|r| Some(system(&r.system)), "; "),
            all(&|r| Some(format!("*t* = 0 … {}", number(r.t_end))), "; "),
        ],
        vec![all(&|r| Some(switch(&r.switch)), "; ")],
        vec![
            all(&|r| Some(r.method.name.name().to_owned()), ", "),
            all(&|r| Some(control(&r.method)), "; "),
        ],
        Vec::new(),
    ];
    let restarts = all(&|r| r.schedule.restart_every.map(number), ", ");
    if !restarts.is_empty() {
        lines[2].push(format!("restarted every {restarts}"));
    }
    lines[3].push(all(&|r| r.schedule.kick.map(|k| kicks(&k)), "; "));
    lines
        .into_iter()
        .map(|line| line.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(", "))
        .filter(|line| !line.is_empty())
        .collect()
}

/// Settings that differ in their last number alone as one: "*ε* = 0.1, *σ* = 1, 2".
fn together(said: &[String]) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for text in said {
        let (head, value) = text.rsplit_once(" = ").unwrap_or((text, ""));
        match all.last_mut() {
            Some(last) if last.starts_with(&format!("{head} = ")) && !value.contains(", ") => {
                *last += &format!(", {value}");
            }
            _ => all.push(text.clone()),
        }
    }
    all
}

/// A verdict's finding as rich text: a time *t* in italics, numbers as [`number`] sets them.
pub fn found(plain: &str) -> String {
    let word = |word: &str| {
        let core = word.trim_end_matches([',', ';', ')', ']']);
        let set = match (core, core.parse::<f64>()) {
            ("t", _) => "*t*".to_owned(),
            ("+-", _) => "±".to_owned(),
            // Others stand as they are: zeros at the end say how precise they are.
            (_, Ok(v)) if v.is_finite() && (core.contains('e') || !core.contains('.')) => number(v),
            _ => markup::literal(core),
        };
        set + &word[core.len()..]
    };
    plain.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// Rich text without its markup, for readers without typesetting.
pub fn plain(rich: &str) -> String {
    twofold_render::markup::plain(rich)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_of_pi_are_said_as_such() {
        assert_eq!(angle(std::f64::consts::FRAC_PI_4), "π/4");
        let wheel = System::builtin("wheel").unwrap().with("gamma", 0.7).unwrap();
        assert!(system(&wheel).contains("*γ* = 0.7,"));
    }

    #[test]
    fn settings_that_differ_in_one_number_are_said_once() {
        let said = |texts: &[&str]| {
            together(&texts.iter().map(|t| (*t).to_owned()).collect::<Vec<_>>()).join("; ")
        };
        assert_eq!(
            said(&["tanh, *σ* = 0.01", "tanh, *σ* = 0.1", "tanh, *σ* = 1"]),
            "tanh, *σ* = 0.01, 0.1, 1"
        );
        let apart = ["tanh, *ε* = 1", "erf, *ε* = 1", "rtol = 1, steps", "rtol = 2, steps"];
        assert_eq!(said(&apart), apart.join("; "));
    }

    #[test]
    fn findings_are_typeset() {
        let pairs = [
            (
                "captured at t = 6232, settled at t = 151811",
                "captured at *t* = 6232, settled at *t* = 151\u{2009}811",
            ),
            ("radius 0.250, rate 2.7e-5", "radius 0.250, rate 2.7×10^{-5}"),
            ("clouds of radius 3.9e-1 around period 1", "clouds of radius 0.39 around period 1"),
            ("56.6 +- 2.0 % (12 starts)", "56.6 ± 2.0 % (12 starts)"),
            ("0.75 [0.70, 0.80] times", "0.75 [0.70, 0.80] times"),
        ];
        for (plain, set) in pairs {
            assert_eq!(found(plain), set);
        }
    }
}
