//! Runs as plain data: everything a computation depends on, and nothing else.
//!
//! A [`RunSpec`] can be written as JSON, hashed, and given back to `twofold run --spec`. Two equal
//! specs give the same bytes on any machine.

use serde::{Deserialize, Serialize};

pub use twofold_integrate::Method;
use twofold_integrate::delay::{
    History, Inside, LEAST_DELAY, LateSwitch, SHARP_METHODS, SMOOTH_METHODS,
};
use twofold_integrate::filippov::ExitRule;
use twofold_integrate::{PRECISIONS, Schedule, StepCap, Tolerance, layered};
use twofold_num::Elementary;
use twofold_num::elementary::exp10;
use twofold_num::tape::Program;
use twofold_system::{Field, Relaxation, System, Transition};

/// One run: system, switch, start, method, schedule, and what is recorded.
///
/// ```
/// use twofold_job::spec::*;
/// use twofold_system::System;
/// let run = RunSpec {
///     system: System::builtin("chua").expect("built in"),
///     switch: SwitchSpec::tanh(1e-2),
///     start: vec![0.1, 0.0, 0.0],
///     t_end: 20.0,
///     method: MethodSpec::ndsolve_defaults(Method::Dopri5),
///     schedule: Default::default(),
///     observe: Observation::Section { coordinate: 1, value: 0.0 },
/// };
/// run.validate()?;
/// let json = serde_json::to_string(&run)?; // what `twofold run --spec` reads
/// assert_eq!(serde_json::from_str::<RunSpec>(&json)?, run);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunSpec {
    /// The piecewise-smooth system.
    pub system: System,
    /// The model of the switch at h = 0.
    pub switch: SwitchSpec,
    /// Initial state, one number for each of the system's.
    pub start: Vec<f64>,
    /// Final time; the run starts at 0.
    pub t_end: f64,
    /// Integration method and its settings.
    pub method: MethodSpec,
    /// Restarts and kicks.
    pub schedule: Schedule,
    /// The observation.
    pub observe: Observation,
}

/// The model of the switch: smoothed, hysteretic, delayed, a relay, or discontinuous.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum SwitchSpec {
    /// Eq. (8): phi is a function of h/eps.
    Smoothed {
        /// Stiffness parameter.
        eps: f64,
        /// Transition function.
        transition: Transition,
    },
    /// Eq. (10): phi is a state.
    Hysteretic {
        /// Half-width of the loop.
        eps: f64,
        /// Relaxation time.
        eps_prime: f64,
        /// Reading of eq. (10).
        relaxation: Relaxation,
        /// phi at the start.
        phi0: f64,
    },
    /// The switch acts late (the end of sec. 4.3): f+ while h(x(t - delay)) > 0 and f- otherwise;
    /// with `eps`, phi is a function of h(x(t - delay))/eps.
    Delayed {
        /// The delay.
        delay: f64,
        /// Stiffness parameter of the smooth rule.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        eps: Option<f64>,
        /// Transition function; given if `eps` is.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        transition: Option<Transition>,
        /// The orbit before the start.
        #[serde(default)]
        history: History,
    },
    /// A relay with memory, sharp hysteresis: f+ until h falls to -band, then f- until it rises to
    /// band.
    Relay {
        /// Half the width of the band.
        band: f64,
        /// The field with which a run begins inside the band.
        #[serde(default)]
        inside: Inside,
    },
    /// The discontinuous system itself, in Filippov's sense (sec. 3).
    Filippov {
        /// End of repelling sliding: the choice that the equations do not make.
        exit: ExitRule,
        /// Futures that are followed if `exit` is [`ExitRule::All`]; required there, absent
        /// elsewhere.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        funnel: Option<FunnelSpec>,
    },
}

/// Grid of the members of a funnel: exit times, geometrically spaced, and both sides of each.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FunnelSpec {
    /// Shortest time of repelling sliding.
    pub shortest: f64,
    /// Longest time of repelling sliding.
    pub longest: f64,
    /// Number of times.
    pub times: usize,
    /// Follow each future so long at most.
    pub horizon: f64,
    /// Stop a future when it next comes to a two-fold.
    pub until_two_fold: bool,
}

impl SwitchSpec {
    /// tanh smoothing, sec. 4.1.
    pub fn tanh(eps: f64) -> Self {
        SwitchSpec::Smoothed { eps, transition: Transition::Tanh }
    }

    /// The sharp delayed switch, from a constant history.
    pub fn delayed(delay: f64) -> Self {
        SwitchSpec::Delayed { delay, eps: None, transition: None, history: History::Constant }
    }

    /// A relay with memory that begins inside its band by the sign of h.
    pub fn relay(band: f64) -> Self {
        SwitchSpec::Relay { band, inside: Inside::Sign }
    }

    /// The switch if it depends on the past.
    pub(super) fn late(self) -> Option<LateSwitch> {
        match self {
            SwitchSpec::Delayed { delay, eps, transition, history } => {
                Some(LateSwitch::Delayed { delay, smooth: transition.zip(eps), history })
            }
            SwitchSpec::Relay { band, inside } => Some(LateSwitch::Relay { band, inside }),
            _ => None,
        }
    }

    /// phi of the hysteretic system at a start: on the side of h there, and 1 on the surface.
    pub fn phi_at(system: &System, start: &[f64]) -> f64 {
        if switching(system, start) < 0.0 { 0.0 } else { 1.0 }
    }

    /// The hysteretic system of sec. 4.3 with eps' = 10 eps and phi(0) = 1.
    pub fn hysteretic(eps: f64, relaxation: Relaxation) -> Self {
        SwitchSpec::Hysteretic { eps, eps_prime: 10.0 * eps, relaxation, phi0: 1.0 }
    }
}

/// A method with its options.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MethodSpec {
    /// The method.
    pub name: Method,
    /// Local error control.
    pub tolerance: Tolerance,
    /// Longest step.
    pub step_cap: StepCap,
    /// Step limit of the whole run; a run that exceeds it fails.
    pub max_steps: u64,
    /// Bits of the numbers of [`Method::TaylorExtended`], one of [`PRECISIONS`]; 106 if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub precision: Option<u16>,
    /// Degree of its series; what the tolerance asks for (Jorba & Zou 2005) if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order: Option<u16>,
}

/// A budget far above what any run of the paper needs; a run on the stiff far attractor reaches it
/// within minutes.
pub const DEFAULT_MAX_STEPS: u64 = 400_000_000;

impl MethodSpec {
    /// NDSolve's defaults: AccuracyGoal = PrecisionGoal = MachinePrecision/2, so rtol = atol =
    /// 10^-7.97727; MaxStepFraction = 1/10 of the interval.
    pub fn ndsolve_defaults(name: Method) -> Self {
        let tolerance = exp10(-7.97727);
        Self {
            name,
            tolerance: Tolerance { rtol: tolerance, atol: tolerance },
            step_cap: StepCap::FractionOfSegment(0.1),
            max_steps: DEFAULT_MAX_STEPS,
            precision: None,
            order: None,
        }
    }

    /// A method's default options: NDSolve's, but a tolerance of 1e-32 in extended precision.
    pub fn defaults(name: Method) -> Self {
        let mut defaults = Self::ndsolve_defaults(name);
        if name == Method::TaylorExtended {
            defaults.tolerance = Tolerance { rtol: FINEST_EXTENDED, atol: FINEST_EXTENDED };
        }
        defaults
    }
}

/// A default tolerance for a run from `start`. [`MethodSpec::defaults`] are meant for states of
/// order one: where the largest state is below a thousandth, the absolute tolerance is as many
/// powers of ten smaller as the state is. Without units.
pub fn in_units_of(tolerance: Tolerance, start: &[f64]) -> Tolerance {
    let largest = start.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let mut unit = 1.0;
    while largest > 0.0 && largest < 1e-3 && unit > largest && unit > 1e-120 {
        unit *= 0.1;
    }
    Tolerance { atol: tolerance.atol * unit, ..tolerance }
}

/// The finest tolerance that double-double arithmetic can hold.
const FINEST_EXTENDED: f64 = 1e-32;

/// Longest series that can be asked for: their cost grows with the square.
const MOST_DEGREES: u16 = 1000;

/// The finest tolerance that numbers of so many bits can hold: 1e-32 for 106, 2^(1 - bits) for
/// more.
pub fn finest_extended(bits: u16) -> f64 {
    let most = PRECISIONS[PRECISIONS.len() - 1];
    if bits <= PRECISIONS[0] {
        FINEST_EXTENDED
    } else {
        f64::from_bits((1024 - u64::from(bits.min(most))) << 52)
    }
}

/// The observation of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Observation {
    /// The path, as a polyline that stays within `chord` of the dense output.
    Path {
        /// Largest distance, in the state's units.
        chord: f64,
    },
    /// The path at the multiples of an interval.
    Times {
        /// The interval.
        every: f64,
    },
    /// Crossings of the plane `coordinate = value`.
    Section {
        /// Index of the coordinate.
        coordinate: usize,
        /// Its value.
        value: f64,
    },
}

/// The latest end time: its neighbours in f64 are 1e-4 apart.
const LATEST: f64 = 1e12;
/// The smallest absolute tolerance: methods square the quotient of an error and its tolerance.
const FINEST_ATOL: f64 = 1e-140;

/// Columns of recorded data beside the states'.
const COLUMNS: [&str; 16] = [
    "t",
    "signs",
    "direction",
    "mode",
    "piece",
    "future",
    "exit_time",
    "exit_side",
    "event",
    "from",
    "to",
    "side",
    "leg",
    "error",
    "time",
    "arc",
];

/// A wrong number in a spec: the field, its value, and the rule.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field} is {value}: {rule}")]
pub struct SpecError {
    /// The field, as it is called on the command line.
    pub field: &'static str,
    /// Its value.
    pub value: String,
    /// The rule that it breaks.
    pub rule: &'static str,
}

/// A check's outcome.
type Checked = Result<(), SpecError>;

fn wrong(field: &'static str, value: f64, rule: &'static str) -> Checked {
    Err(SpecError { field, value: format!("{value:?}"), rule })
}

fn wrong_choice(field: &'static str, value: u16, rule: &'static str) -> Checked {
    Err(SpecError { field, value: value.to_string(), rule })
}

fn positive(field: &'static str, value: f64) -> Checked {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        wrong(field, value, "give a finite number above zero")
    }
}

fn finite(field: &'static str, value: f64) -> Checked {
    if value.is_finite() { Ok(()) } else { wrong(field, value, "give a finite number") }
}

impl RunSpec {
    /// Checks every number; a spec that passes can be run.
    ///
    /// # Errors
    ///
    /// The first field that is wrong, its value, and the rule that it breaks.
    pub fn validate(&self) -> Result<(), SpecError> {
        positive("t-end", self.t_end)?;
        if self.t_end > LATEST {
            return wrong(
                "t-end",
                self.t_end,
                "beyond 1e12 a time in f64 has no digits left for a step",
            );
        }
        self.validate_system()?;
        match self.switch {
            SwitchSpec::Smoothed { eps, transition } => {
                positive("eps", eps)?;
                if let Transition::PerturbedTanh { sigma } = transition {
                    finite("sigma", sigma)?;
                }
            }
            SwitchSpec::Hysteretic { .. } if self.system.definition().second().is_some() => {
                return Err(SpecError {
                    field: "switch",
                    value: "hysteretic".into(),
                    rule: "hysteresis is for systems with one switching surface; this one has two, \
                        so smooth them or take filippov",
                });
            }
            SwitchSpec::Hysteretic { eps, eps_prime, phi0, .. } => {
                positive("eps", eps)?;
                positive("eps-prime", eps_prime)?;
                finite("phi0", phi0)?;
            }
            SwitchSpec::Delayed { delay, eps, transition, .. } => {
                self.validate_delayed(delay, eps, transition)?
            }
            SwitchSpec::Relay { band, inside } => self.validate_relay(band, inside)?,
            SwitchSpec::Filippov { exit, funnel } => self.validate_filippov(exit, funnel)?,
        }
        self.method.validate()?;
        if self.method.name == Method::Layered {
            self.validate_layered()?;
        }
        self.validate_schedule()?;
        self.validate_observation()
    }

    fn validate_system(&self) -> Checked {
        let states = self.system.coordinates();
        if self.start.len() != states.len() {
            return Err(SpecError {
                field: "start",
                value: format!("{:?}", self.start),
                rule: "give one number for each of the system's states",
            });
        }
        for value in &self.start {
            finite("start", *value)?;
        }
        if let Err(wrong) = self.system.check() {
            let value = format!("one in which {wrong}");
            return Err(SpecError {
                field: "system",
                value,
                rule: "the equations make no sense with it",
            });
        }
        match states.iter().find(|s| COLUMNS.contains(s)) {
            Some(name) => Err(SpecError {
                field: "system",
                value: format!("one with a state called {name}"),
                rule: "recorded data have a column of this name; rename the state",
            }),
            None => Ok(()),
        }
    }

    fn validate_delayed(
        &self,
        delay: f64,
        eps: Option<f64>,
        transition: Option<Transition>,
    ) -> Checked {
        positive("delay", delay)?;
        if delay >= self.t_end {
            let rule = "the switch would never see the run: give a delay below the end time, or a \
                later end";
            return wrong("delay", delay, rule);
        }
        if delay < LEAST_DELAY * self.t_end {
            let rule = "times near the end are too coarse in f64 to tell apart what happens in one \
                delay: give a longer delay, or an earlier end";
            return wrong("delay", delay, rule);
        }
        self.validate_one_surface("delayed")?;
        if let Some(eps) = eps {
            positive("eps", eps)?;
        }
        if eps.is_some() != transition.is_some() {
            return Err(SpecError {
                field: "transition",
                value: if transition.is_some() { "given".into() } else { "missing".into() },
                rule: "the smooth delayed switch has both eps and a transition, the sharp one \
                    neither",
            });
        }
        if let Some(Transition::PerturbedTanh { sigma }) = transition {
            finite("sigma", sigma)?;
        }
        if eps.is_none() {
            self.validate_sharp_method()?;
        } else if !SMOOTH_METHODS.contains(&self.method.name) {
            return Err(SpecError {
                field: "method",
                value: self.method.name.name().into(),
                rule: "it cannot follow an equation with a past; take dopri5 or radau5",
            });
        }
        let events = [
            ("restart", self.schedule.restart_every),
            ("kick-every", self.schedule.kick.map(|k| k.every)),
        ];
        for (field, every) in events {
            if let Some(every) = every.filter(|every| *every <= delay) {
                let rule = "the first would come before the switch has seen the start: give an \
                    interval longer than the delay";
                return wrong(field, every, rule);
            }
        }
        Ok(())
    }

    fn validate_relay(&self, band: f64, inside: Inside) -> Checked {
        positive("band", band)?;
        self.validate_one_surface("relay")?;
        if inside != Inside::Sign && switching(&self.system, &self.start).abs() > band {
            return Err(SpecError {
                field: "inside",
                value: inside.name().into(),
                rule: "the run starts outside the band, where the sign of h decides; leave it out",
            });
        }
        self.validate_sharp_method()
    }

    fn validate_one_surface(&self, switch: &str) -> Checked {
        if self.system.definition().second().is_none() {
            return Ok(());
        }
        Err(SpecError {
            field: "switch",
            value: switch.into(),
            rule: "it is for systems with one switching surface; this one has two, so smooth them \
                or take filippov",
        })
    }

    /// Of switches at which a step ends.
    fn validate_sharp_method(&self) -> Checked {
        let name = self.method.name;
        if !SHARP_METHODS.contains(&name) {
            let rule =
                "it cannot end its steps at the switches; take dopri5, taylor or taylor-extended";
            return Err(SpecError { field: "method", value: name.name().into(), rule });
        }
        match self.method.precision.filter(|bits| *bits != PRECISIONS[0]) {
            Some(bits) => wrong_choice(
                "precision",
                bits,
                "such a switch is followed with 106 bits at most; leave it out",
            ),
            None => Ok(()),
        }
    }

    fn validate_filippov(&self, exit: ExitRule, funnel: Option<FunnelSpec>) -> Checked {
        let wrong_exit = |rule| Err(SpecError { field: "exit", value: exit.to_string(), rule });
        if exit.validate().is_err() {
            return wrong_exit(
                "times and lengths are finite and not below 0, probabilities between 0 and 1",
            );
        }
        if (exit == ExitRule::All) != funnel.is_some() {
            return wrong_exit("\"all\" and a description of the funnel go together");
        }
        if funnel.is_some() && self.system.definition().second().is_some() {
            return wrong_exit(
                "all futures are followed at one switching surface; this system has two, so give \
                    another rule",
            );
        }
        if let Some(funnel) = funnel {
            positive("funnel-shortest", funnel.shortest)?;
            positive("funnel-longest", funnel.longest)?;
            positive("funnel-horizon", funnel.horizon)?;
            if funnel.times == 0 || funnel.times > 100_000 {
                return wrong(
                    "funnel-times",
                    funnel.times as f64,
                    "give a number from 1 to 100000",
                );
            }
            match self.observe {
                Observation::Path { .. } => {}
                Observation::Section { .. } => {
                    return wrong_exit("a funnel is recorded as paths; leave out --section");
                }
                Observation::Times { .. } => {
                    return wrong_exit(
                        "a funnel is recorded at fixed points of each step; leave out --every",
                    );
                }
            }
        }
        if self.method.name != Method::Dopri5 {
            return Err(SpecError {
                field: "method",
                value: self.method.name.name().into(),
                rule: "Filippov motion is integrated by dopri5 between events",
            });
        }
        if self.schedule != Schedule::default() {
            return Err(SpecError {
                field: "switch",
                value: "filippov".into(),
                rule: "restarts and kicks apply to smoothed and hysteretic runs; leave them out",
            });
        }
        Ok(())
    }

    fn validate_layered(&self) -> Checked {
        let refused =
            |rule| Err(SpecError { field: "method", value: Method::Layered.name().into(), rule });
        let SwitchSpec::Smoothed { eps, transition } = self.switch else {
            return refused(
                "it is for smoothed systems, whose layer it crosses; take lsoda or radau5",
            );
        };
        match layered::applicable(Field::smoothed(&self.system, transition, eps).tape()) {
            Ok(()) => Ok(()),
            Err(_) => refused(
                "it needs fields f+ and f- that are polynomials, and the transition tanh between \
                    them: this system has others; take taylor, lsoda or dopri5",
            ),
        }
    }

    fn validate_schedule(&self) -> Checked {
        if let Some(every) = self.schedule.restart_every {
            positive("restart", every)?;
            if self.t_end / every > 1e9 {
                return wrong(
                    "restart",
                    every,
                    "that is more than 10^9 restarts; give a longer interval",
                );
            }
        }
        let Some(kick) = self.schedule.kick else { return Ok(()) };
        positive("kick-every", kick.every)?;
        if self.t_end / kick.every > 1e9 {
            return wrong(
                "kick-every",
                kick.every,
                "that is more than 10^9 kicks; give a longer interval",
            );
        }
        if !(kick.size.is_finite() && kick.size >= 0.0) {
            return wrong("kick-size", kick.size, "give a finite number, zero or above");
        }
        Ok(())
    }

    fn validate_observation(&self) -> Checked {
        match self.observe {
            Observation::Path { chord } => positive("chord", chord),
            Observation::Times { every } => {
                positive("every", every)?;
                if self.t_end / every > 1e15 {
                    return wrong(
                        "every",
                        every,
                        "f64 cannot count so many moments; give a longer interval",
                    );
                }
                Ok(())
            }
            Observation::Section { coordinate, value } => {
                if coordinate >= self.system.dimension() {
                    return wrong(
                        "section",
                        coordinate as f64,
                        "there is no state of that number (they count from 0, and 1 is the \
                         default); name another, as in --section x=0",
                    );
                }
                finite("section", value)
            }
        }
    }
}

impl MethodSpec {
    fn validate(&self) -> Checked {
        positive("rtol", self.tolerance.rtol)?;
        positive("atol", self.tolerance.atol)?;
        if let Some(bits) = self.precision {
            if self.name != Method::TaylorExtended {
                return wrong(
                    "precision",
                    f64::from(bits),
                    "only taylor-extended has a choice of precision; leave it out",
                );
            }
            if !PRECISIONS.contains(&bits) {
                return wrong(
                    "precision",
                    f64::from(bits),
                    "numbers have 106 or 192 bits; give one of these",
                );
            }
        }
        if let Some(order) = self.order {
            if self.name != Method::TaylorExtended {
                return wrong_choice(
                    "order",
                    order,
                    "only taylor-extended has a choice of order; leave it out",
                );
            }
            if !(4..=MOST_DEGREES).contains(&order) {
                return wrong_choice("order", order, "series have 4 to 1000 degrees");
            }
        }
        let (finest, rule) = match self.name {
            Method::TaylorExtended => match self.precision {
                None | Some(106) => (
                    FINEST_EXTENDED,
                    "double-double arithmetic carries 32 digits; give 1e-32 or more",
                ),
                Some(bits) => (
                    finest_extended(bits),
                    "numbers of that precision do not carry so many digits; give more, or raise \
                        the precision",
                ),
            },
            Method::Taylor => (1e-17, "f64 carries 16 digits; give 1e-17 or more"),
            _ => (1e-15, "f64 carries 16 digits; give 1e-15 or more"),
        };
        if self.tolerance.rtol < finest {
            return wrong("rtol", self.tolerance.rtol, rule);
        }
        if self.tolerance.atol < FINEST_ATOL && self.precision.is_none() {
            let rule = "errors are divided by it and squared, which f64 cannot hold below 1e-140; \
                give that or more";
            return wrong("atol", self.tolerance.atol, rule);
        }
        match self.step_cap {
            StepCap::None => {}
            StepCap::Absolute(h) => positive("max-step", h)?,
            StepCap::FractionOfSegment(f) => positive("max-step fraction", f)?,
        }
        if self.max_steps == 0 { wrong("max-steps", 0.0, "give at least one step") } else { Ok(()) }
    }
}

/// The value of h.
pub(super) fn switching<S: Elementary>(system: &System, x: &[S]) -> S {
    let mut h = [S::from_f64(f64::NAN)];
    Program::new(&system.tape().select([0])).evaluate(x, &mut h);
    let [h] = h;
    h
}

#[cfg(test)]
mod tests;
