//! `twofold run`: any run, not only the paper's.

use std::path::{Path, PathBuf};

use serde_json::json;
use twofold::cli::print_bytes;
use twofold::cli::progress::Progress;
use twofold::integrate::filippov::{ExitRule, Side, SlidingLaw};
use twofold::integrate::{Kick, KickLaw, Schedule, StepCap, Tolerance};
use twofold::job::spec::*;
use twofold::job::{Desk, Question, Run, encode};
use twofold::num::Decimal;
use twofold::num::decimal::DecimalError;
use twofold::paper::Reading;
use twofold::record;
use twofold::system::diagnostic::nearest;
use twofold::system::{Definition, ParameterError, Relaxation, System, Transition, library};

use super::{Outcome, Problem};

/// Compute one run: its path, or with --section its passages through a plane.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    flags: RunFlags,
    /// Print the run's spec as JSON and compute nothing.
    #[arg(long)]
    print_spec: bool,
    /// Output format.
    #[arg(long, value_enum, default_value = "csv")]
    format: Format,
    /// File to write instead of standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// No progress on standard error.
    #[arg(long)]
    quiet: bool,
}

/// The flags that describe a run.
#[derive(Debug, clap::Args)]
pub struct RunFlags {
    /// Piecewise-smooth system: a built-in one (caricature, caricature-as-printed, two-fold, wheel, relay-linear, relay-parabolic,
    /// stick-slip) or a file that defines one (.toml, .json).
    #[arg(long, value_name = "NAME|FILE", default_value = "caricature")]
    system: String,
    /// Give a parameter of the system another value; may be repeated.
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    set: Vec<String>,
    /// What stands in for the discontinuity.
    #[arg(long, value_enum, default_value = "smoothed")]
    switch: Switch,
    /// Take alpha and beta from a reading of the paper.
    #[arg(long, value_enum, default_value = "printed")]
    reading: Reading,
    /// Strength of the caricature's drift (overrides the reading's).
    #[arg(long, allow_hyphen_values = true)]
    alpha: Option<f64>,
    /// Strength of the caricature's attraction (overrides the reading's).
    #[arg(long, allow_hyphen_values = true)]
    beta: Option<f64>,
    /// The caricature's v+ [default: -1.2].
    #[arg(long, allow_hyphen_values = true)]
    v_plus: Option<f64>,
    /// The caricature's v- [default: -1.4].
    #[arg(long, allow_hyphen_values = true)]
    v_minus: Option<f64>,
    /// Stiffness parameter.
    #[arg(long, default_value_t = 1e-3, allow_hyphen_values = true)]
    eps: f64,
    /// Size of the transition function's perturbation (fig. 8).
    #[arg(long, allow_hyphen_values = true)]
    sigma: Option<f64>,
    /// Relaxation time of the hysteretic switch [default: 10 eps].
    #[arg(long, allow_hyphen_values = true)]
    eps_prime: Option<f64>,
    /// Reading of eq. (10).
    #[arg(long, value_enum, default_value = "literal")]
    hysteresis: Hysteresis,
    /// Initial state, one number for each of the system's [default: the one that the system suggests].
    #[arg(long, value_name = "X,Y,...", value_delimiter = ',', allow_hyphen_values = true)]
    start: Option<Vec<f64>>,
    /// Final time.
    #[arg(long, default_value_t = 150.0, allow_hyphen_values = true)]
    t_end: f64,
    /// Integration method [default: lsoda; dopri5 with --switch filippov].
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// Relative tolerance [default: 10^-7.97727, NDSolve's].
    #[arg(long, allow_hyphen_values = true)]
    rtol: Option<f64>,
    /// Absolute tolerance [default: 10^-7.97727, NDSolve's].
    #[arg(long, allow_hyphen_values = true)]
    atol: Option<f64>,
    /// Longest step [default: a tenth of the time between restarts or kicks, NDSolve's].
    #[arg(long, allow_hyphen_values = true)]
    max_step: Option<f64>,
    /// Most steps before the run is given up.
    #[arg(long, default_value_t = DEFAULT_MAX_STEPS)]
    max_steps: u64,
    /// Start the method afresh after each such interval.
    #[arg(long, value_name = "INTERVAL", allow_hyphen_values = true)]
    restart: Option<f64>,
    /// Perturb the state after each such interval.
    #[arg(long, value_name = "INTERVAL", allow_hyphen_values = true)]
    kick_every: Option<f64>,
    /// Size of a kick [default: eps].
    #[arg(long, requires = "kick_every", allow_hyphen_values = true)]
    kick_size: Option<f64>,
    /// Law of a kick.
    #[arg(long, value_enum, requires = "kick_every")]
    kick_law: Option<KickLaw>,
    /// How repelling sliding ends (with --switch filippov): at-once:SIDE, after-time:T:SIDE, after-arc:L:SIDE, with SIDE plus or
    /// minus; random:exponential:MEAN or random:uniform:LONGEST (see --seed, --stream, --plus-probability); all.
    #[arg(long, value_name = "RULE")]
    exit: Option<String>,
    /// Probability of leaving to h > 0 under a random exit rule.
    #[arg(long, default_value_t = 0.5, allow_hyphen_values = true)]
    plus_probability: f64,
    /// Number of exit times of a funnel (--exit all); each is followed to both sides.
    #[arg(long, value_name = "N", default_value_t = 12)]
    funnel_times: usize,
    /// Shortest time of repelling sliding in a funnel.
    #[arg(long, value_name = "T", default_value_t = 0.05, allow_hyphen_values = true)]
    funnel_shortest: f64,
    /// Longest time of repelling sliding in a funnel.
    #[arg(long, value_name = "T", default_value_t = 2.0, allow_hyphen_values = true)]
    funnel_longest: f64,
    /// Follow each future so long, or to its next two-fold.
    #[arg(long, value_name = "T", default_value_t = 50.0, allow_hyphen_values = true)]
    funnel_horizon: f64,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = 2013)]
    seed: u64,
    /// Stream of the random numbers: one per run.
    #[arg(long, default_value_t = 0)]
    stream: u64,
    /// Record passages through a plane instead of the path, such as y=0.
    #[arg(long, value_name = "COORDINATE=VALUE")]
    section: Option<String>,
    /// Largest distance between the path's polyline and the dense output.
    #[arg(long, default_value_t = 1e-3, allow_hyphen_values = true)]
    chord: f64,
    /// Take the whole run from a file made with --print-spec; other flags of the run are then refused.
    #[arg(long, value_name = "FILE", conflicts_with_all = [
        "system", "set", "switch", "reading", "alpha", "beta", "v_plus", "v_minus", "eps", "sigma", "eps_prime", "hysteresis", "start",
        "t_end", "method", "rtol", "atol", "max_step", "max_steps", "restart", "kick_every", "kick_size", "kick_law", "seed",
        "stream", "section", "chord", "exit", "plus_probability", "funnel_times", "funnel_shortest", "funnel_longest", "funnel_horizon",
    ])]
    spec: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Switch {
    /// Eq. (8).
    Smoothed,
    /// Eq. (10).
    Hysteretic,
    /// The discontinuous system itself.
    Filippov,
}

/// How eq. (10)'s two divisions by eps' are read.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Hysteresis {
    /// Literally: both.
    Literal,
    /// One division.
    Single,
}

impl From<Hysteresis> for Relaxation {
    fn from(hysteresis: Hysteresis) -> Self {
        match hysteresis {
            Hysteresis::Literal => Relaxation::Literal,
            Hysteresis::Single => Relaxation::Single,
        }
    }
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Format {
    /// A header line, then a row per point.
    Csv,
    /// Spec, statistics, columns and rows.
    Json,
}

/// A flag that does not fit.
#[derive(Debug, thiserror::Error)]
enum Misuse {
    #[error(
        "{flag} belongs to the caricature; leave it out with --system {system}, and give parameters by --set NAME=VALUE"
    )]
    NotOfTheCaricature { flag: &'static str, system: String },
    #[error(
        "--system {name}: there is no such built-in system{help}; built in are {known}; give a file's name for your own"
    )]
    NoSuchSystem { name: String, help: String, known: String },
    #[error("--system {file}: {problem}")]
    SystemFile { file: String, problem: String },
    #[error("--set \"{text}\": {problem}")]
    Set { text: String, problem: String },
    #[error("{system} suggests no initial state; give one by --start, {states} numbers")]
    NoStart { system: String, states: usize },
    #[error("--sigma perturbs the smoothed switch; leave it out, or use --switch smoothed")]
    SigmaWithoutSmoothing,
    #[error(
        "at the two-fold the future is a set, and nothing is chosen silently: give --exit at-once:plus, after-time:0.3:minus, after-arc:0.2:plus, random:exponential:0.5, or all"
    )]
    NoExitRule,
    #[error(
        "--exit \"{0}\" is not a rule; give one such as at-once:plus, after-time:0.3:minus, after-arc:0.2:plus, random:exponential:0.5, random:uniform:1, or all"
    )]
    Exit(String),
    #[error("--start has {found} numbers; give {wanted}, one for each of {states}")]
    Start { found: usize, wanted: usize, states: String },
    #[error("--section \"{text}\": {problem}; give one of {known} and a number, such as {example}=0")]
    Section { text: String, problem: &'static str, known: String, example: String },
    #[error("{file} is not a spec of one run: {reason}; make one with `--only PANEL --reading READING --print-spec`")]
    Spec { file: String, reason: String },
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Problem> {
    let spec = arguments.flags.spec()?;
    if arguments.print_spec {
        let mut text = serde_json::to_vec_pretty(&spec)?;
        text.push(b'\n');
        return deliver(arguments, &text);
    }
    let progress = Progress::new(arguments.quiet);
    let run = Run(spec);
    let answer = Desk::new(None, &progress).ask(&run)?;
    let about = json!({ "kind": run.kind(), "question": run.json(), "stop": answer.stop });
    let bytes = match arguments.format {
        Format::Csv => encode::csv(&answer.tables[0], &about),
        Format::Json => encode::json(&answer, &about),
    };
    deliver(arguments, &bytes)
}

fn deliver(arguments: &Arguments, bytes: &[u8]) -> Result<Outcome, Problem> {
    match &arguments.out {
        Some(file) => record::write(file, bytes)?,
        None => print_bytes(bytes)?,
    }
    Ok(Outcome::Fine)
}

impl RunFlags {
    /// The spec that the flags describe, checked.
    pub fn spec(&self) -> Result<RunSpec, Problem> {
        let spec = match &self.spec {
            Some(file) => serde_json::from_str(&record::files::read_text(file)?)
                .map_err(|e| Misuse::Spec { file: file.display().to_string(), reason: e.to_string() })?,
            None => spec(self)?,
        };
        spec.validate().map_err(|e| format!("--{e}"))?;
        Ok(spec)
    }
}

/// The spec that the flags describe, unchecked.
fn spec(a: &RunFlags) -> Result<RunSpec, Misuse> {
    let system = system(a)?;
    let switch = match a.switch {
        Switch::Smoothed => SwitchSpec::Smoothed {
            eps: a.eps,
            transition: a.sigma.map_or(Transition::Tanh, |sigma| Transition::PerturbedTanh { sigma }),
        },
        Switch::Hysteretic => {
            if a.sigma.is_some() {
                return Err(Misuse::SigmaWithoutSmoothing);
            }
            let eps_prime = a.eps_prime.unwrap_or(10.0 * a.eps);
            SwitchSpec::Hysteretic { eps: a.eps, eps_prime, relaxation: a.hysteresis.into(), phi0: 1.0 }
        }
        Switch::Filippov => {
            if a.sigma.is_some() {
                return Err(Misuse::SigmaWithoutSmoothing);
            }
            let exit = exit_rule(a)?;
            let funnel = (exit == ExitRule::All).then_some(FunnelSpec {
                shortest: a.funnel_shortest,
                longest: a.funnel_longest,
                times: a.funnel_times,
                horizon: a.funnel_horizon,
                until_two_fold: true,
            });
            SwitchSpec::Filippov { exit, funnel }
        }
    };
    let start = match &a.start {
        None => {
            let none = || Misuse::NoStart { system: a.system.clone(), states: system.dimension() };
            system.definition().start().ok_or_else(none)?.to_vec()
        }
        Some(numbers) if numbers.len() != system.dimension() => {
            let states = system.coordinates().join(", ");
            return Err(Misuse::Start { found: numbers.len(), wanted: system.dimension(), states });
        }
        Some(numbers) => numbers.clone(),
    };
    let discontinuous = matches!(switch, SwitchSpec::Filippov { .. });
    let name = a.method.unwrap_or(if discontinuous { Method::Dopri5 } else { Method::Lsoda });
    let defaults = MethodSpec::ndsolve_defaults(name);
    let method = MethodSpec {
        name,
        tolerance: Tolerance {
            rtol: a.rtol.unwrap_or(defaults.tolerance.rtol),
            atol: a.atol.unwrap_or(defaults.tolerance.atol),
        },
        step_cap: a.max_step.map_or(defaults.step_cap, StepCap::Absolute),
        max_steps: a.max_steps,
    };
    let kick = a.kick_every.map(|every| Kick {
        every,
        size: a.kick_size.unwrap_or(a.eps),
        law: a.kick_law.unwrap_or_default(),
        seed: a.seed,
        stream: a.stream,
    });
    let observe = match &a.section {
        None => Observation::Path { chord: a.chord },
        Some(text) => section(text, &system)?,
    };
    Ok(RunSpec {
        system,
        switch,
        start,
        t_end: a.t_end,
        method,
        schedule: Schedule { restart_every: a.restart, kick },
        observe,
    })
}

/// The system that --system, --reading, --set and the caricature's own flags describe.
fn system(a: &RunFlags) -> Result<System, Misuse> {
    let name = a.system.as_str();
    let own = [("--alpha", a.alpha), ("--beta", a.beta), ("--v-plus", a.v_plus), ("--v-minus", a.v_minus)];
    let mut system = match System::builtin(name) {
        Some(system) => system,
        None => from_file(name)?,
    };
    if matches!(name, "caricature" | "caricature-as-printed") {
        let reading = a.reading.caricature();
        let values = [
            ("alpha", a.alpha.unwrap_or(reading.alpha)),
            ("beta", a.beta.unwrap_or(reading.beta)),
            ("v_plus", a.v_plus.unwrap_or(reading.v_plus)),
            ("v_minus", a.v_minus.unwrap_or(reading.v_minus)),
        ];
        for (parameter, value) in values {
            let refused =
                |e: ParameterError| Misuse::Set { text: format!("{parameter}={value}"), problem: e.to_string() };
            system = system.with(parameter, value).map_err(refused)?;
        }
    } else if let Some((flag, _)) = own.into_iter().find(|(_, value)| value.is_some()) {
        return Err(Misuse::NotOfTheCaricature { flag, system: name.to_owned() });
    }
    for text in &a.set {
        let refused = |problem: String| Misuse::Set { text: text.clone(), problem };
        let Some((parameter, value)) = text.split_once('=') else {
            return Err(refused("there is no \"=\"; give it as NAME=VALUE, such as alpha=0.2".into()));
        };
        let value: Decimal = value.trim().parse().map_err(|e: DecimalError| refused(e.to_string()))?;
        system = system.with(parameter.trim(), value).map_err(|e| refused(e.to_string()))?;
    }
    Ok(system)
}

/// A system from a file, TOML or JSON.
fn from_file(name: &str) -> Result<System, Misuse> {
    let path = Path::new(name);
    let json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    let is_file = json || path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) || path.is_file();
    if !is_file {
        let known: Vec<&str> = library::names().collect();
        let help = nearest(name, &known).map_or(String::new(), |near| format!(", did you mean {near}?"));
        return Err(Misuse::NoSuchSystem { name: name.into(), help, known: known.join(", ") });
    }
    let problem = |problem: String| Misuse::SystemFile { file: name.into(), problem };
    let text = record::files::read_text(path).map_err(|e| problem(e.to_string()))?;
    if json {
        serde_json::from_str(&text).map_err(|e| problem(e.to_string()))
    } else {
        Definition::from_toml(&text, name).map(System::new).map_err(|e| problem(e.to_string()))
    }
}

/// Reads "after-time:0.3:minus".
fn exit_rule(a: &RunFlags) -> Result<ExitRule, Misuse> {
    let text = a.exit.as_deref().ok_or(Misuse::NoExitRule)?;
    let wrong = || Misuse::Exit(text.to_owned());
    let side = |word: &str| match word {
        "plus" => Ok(Side::Plus),
        "minus" => Ok(Side::Minus),
        _ => Err(wrong()),
    };
    let number = |word: &str| word.parse::<f64>().map_err(|_| wrong());
    let random = |law| ExitRule::Random { law, plus_probability: a.plus_probability, seed: a.seed, stream: a.stream };
    Ok(match text.split(':').collect::<Vec<_>>().as_slice() {
        ["at-once", s] => ExitRule::AtOnce { side: side(s)? },
        ["after-time", t, s] => ExitRule::AfterTime { time: number(t)?, side: side(s)? },
        ["after-arc", l, s] => ExitRule::AfterArc { arc: number(l)?, side: side(s)? },
        ["random", "exponential", m] => random(SlidingLaw::Exponential { mean: number(m)? }),
        ["random", "uniform", l] => random(SlidingLaw::Uniform { longest: number(l)? }),
        ["all"] => ExitRule::All,
        _ => return Err(wrong()),
    })
}

/// Reads "y=0".
fn section(text: &str, system: &System) -> Result<Observation, Misuse> {
    let names = system.coordinates();
    let misuse = |problem| Misuse::Section {
        text: text.to_owned(),
        problem,
        known: names.join(", "),
        example: names[names.len() - 1].into(),
    };
    let (name, value) = text.split_once('=').ok_or_else(|| misuse("there is no \"=\""))?;
    let coordinate =
        names.iter().position(|n| *n == name.trim()).ok_or_else(|| misuse("there is no such coordinate"))?;
    let value = value.trim().parse().map_err(|_| misuse("what follows \"=\" is not a number"))?;
    Ok(Observation::Section { coordinate, value })
}
