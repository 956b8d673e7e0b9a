//! The flags that describe a run, and the table of which of them has an effect when.
//!
//! No flag is ever ignored silently: `EFFECTS` names for every flag the runs on which it has an
//! effect, and on others it is refused. A test tries every flag on every kind of run.

use std::io;
use std::path::{Path, PathBuf};

use clap::ValueEnum;

use super::CliError;
use super::models::{each_once, known, named, names_a_file};
use super::words::{History, Inside, KickLaw, Method, Relaxation, Transition};
use crate::hybrid::Model;
use crate::integrate;
use crate::integrate::filippov::{ExitRule, Side, SlidingLaw};
use crate::integrate::{Kick, Schedule, StepCap, Tolerance};
use crate::job::spec::*;
use crate::job::sweep::{Axis, Coordinate};
use crate::job::translation::{MOST_STATES, model_with};
use crate::num::decimal::DecimalError;
use crate::num::{Decimal, Short};
use crate::paper::{ParameterReading, code};
use crate::record::files::{read_text, read_text_from};
use crate::system::{self, Definition, ParameterError, System};

/// The flags that describe a run. What is not given has the default that its help names.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct RunFlags {
    /// Piecewise-smooth system: a built-in one (caricature, wheel, two-fold, chua ...; `twofold new
    /// --list` names all) or a file that defines one (.toml, .json) [default: caricature].
    #[arg(long, value_name = "NAME|FILE", help_heading = "System")]
    pub system: Option<String>,
    /// Give a parameter of the system another value; may be repeated.
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true, help_heading = "System")]
    pub set: Vec<String>,
    /// Rule in place of the discontinuity [default: smoothed]; systems of more than four states
    /// take smoothed and filippov.
    #[arg(long, value_enum, help_heading = "System")]
    pub switch: Option<Switch>,
    /// Reading of the caricature's paper: a set of its parameters by name.
    #[arg(long, value_name = "READING", help = reading_help(), help_heading = "System")]
    pub reading: Option<String>,
    /// The caricature's alpha, the strength of its drift [default: the reading's].
    #[arg(long, value_parser = plain, allow_hyphen_values = true, help_heading = "System")]
    pub alpha: Option<f64>,
    /// The caricature's beta, the strength of its attraction [default: the reading's].
    #[arg(long, value_parser = plain, allow_hyphen_values = true, help_heading = "System")]
    pub beta: Option<f64>,
    /// The caricature's v+ [default: -1.2].
    #[arg(long, value_parser = plain, allow_hyphen_values = true, help_heading = "System")]
    pub v_plus: Option<f64>,
    /// The caricature's v- [default: -1.4].
    #[arg(long, value_parser = plain, allow_hyphen_values = true, help_heading = "System")]
    pub v_minus: Option<f64>,
    /// Delay of the delayed switch.
    #[arg(long, value_parser = time, allow_hyphen_values = true, help_heading = "System")]
    pub delay: Option<f64>,
    /// Orbit before the start of a run with a delayed switch [default: constant].
    #[arg(long, value_enum, help_heading = "System")]
    pub history: Option<History>,
    /// Half the width of a relay's band.
    #[arg(long, value_parser = plain, allow_hyphen_values = true, help_heading = "System")]
    pub band: Option<f64>,
    /// Initial field of a relay whose start lies inside its band [default: sign].
    #[arg(long, value_enum, help_heading = "System")]
    pub inside: Option<Inside>,
    /// Width of the layer of a smoothed switch, half the width of a hysteretic one [default:
    /// 0.001; with --switch delayed none, which is the sharp rule].
    #[arg(long, value_parser = plain, allow_hyphen_values = true, help_heading = "System")]
    pub eps: Option<f64>,
    /// Transition function of the smoothed switch [default: tanh].
    #[arg(long, value_enum, help_heading = "System")]
    pub transition: Option<Transition>,
    /// Size of the tanh transition's perturbation (fig. 8) [default: none].
    #[arg(long, value_parser = plain, allow_hyphen_values = true, help_heading = "System")]
    pub sigma: Option<f64>,
    /// Relaxation time of the hysteretic switch [default: 10 eps].
    #[arg(long, value_parser = plain, allow_hyphen_values = true, help_heading = "System")]
    pub eps_prime: Option<f64>,
    /// Reading of the two divisions by eps-prime in eq. (10): both, as printed, or one [default:
    /// literal].
    #[arg(long, value_enum, help_heading = "System")]
    pub hysteresis: Option<Relaxation>,
    /// Initial state, one number for each of the system's [default: the one that the system
    /// suggests].
    #[arg(
        long,
        value_parser = plain,
        value_name = "X,Y,...",
        value_delimiter = ',',
        allow_hyphen_values = true,
        help_heading = "System"
    )]
    pub start: Option<Vec<f64>>,
    /// Time at which the run of a general system begins [default: 0].
    #[arg(long, value_parser = time, allow_hyphen_values = true, help_heading = "Method")]
    pub t_start: Option<f64>,
    /// Final time [default: 150; of an exponent 10000].
    #[arg(long, value_parser = time, allow_hyphen_values = true, help_heading = "Method")]
    pub t_end: Option<f64>,
    /// Integration method [default: lsoda; dopri5 with --switch filippov, delayed or relay, and of
    /// general systems and those of more than four states, which take dopri5, lsoda, radau5 and
    /// taylor].
    #[arg(long, value_enum, help_heading = "Method")]
    pub method: Option<Method>,
    /// Relative tolerance [default: 10^-7.97727, NDSolve's; with taylor-extended 1e-32 or what
    /// --precision allows; of exponents 1e-9, of closed orbits 1e-11, of general systems 1e-10].
    #[arg(long, value_parser = plain, allow_hyphen_values = true, help_heading = "Method")]
    pub rtol: Option<f64>,
    /// Absolute tolerance [default: that of --rtol's default, and from a start of states below
    /// 1e-3 as many powers of ten smaller; of general systems none: --rtol measures each state by
    /// its own size, near zero by a hundredth of its largest one of late].
    #[arg(long, value_parser = plain, allow_hyphen_values = true, help_heading = "Method")]
    pub atol: Option<f64>,
    /// Longest step, inf for any [default: a tenth of the time between restarts or kicks,
    /// NDSolve's; of general systems inf].
    #[arg(long, allow_hyphen_values = true, value_parser = longest, help_heading = "Method")]
    pub max_step: Option<f64>,
    /// Number of steps after which the run is given up [default: 400000000].
    #[arg(long, allow_negative_numbers = true, help_heading = "Method")]
    pub max_steps: Option<u64>,
    /// Bits of taylor-extended's numbers: 106 or 192 [default: 106].
    #[arg(long, value_name = "BITS", allow_negative_numbers = true, help_heading = "Method")]
    pub precision: Option<u16>,
    /// Degree of taylor-extended's series [default: what the tolerance asks for].
    #[arg(long, value_name = "DEGREE", allow_negative_numbers = true, help_heading = "Method")]
    pub order: Option<u16>,
    /// Start the method afresh after each such interval [default: never].
    #[arg(
        long,
        value_parser = time,
        value_name = "INTERVAL",
        allow_hyphen_values = true,
        help_heading = "Schedule"
    )]
    pub restart: Option<f64>,
    /// Perturb the state after each such interval [default: never].
    #[arg(
        long,
        value_parser = time,
        value_name = "INTERVAL",
        allow_hyphen_values = true,
        help_heading = "Schedule"
    )]
    pub kick_every: Option<f64>,
    /// Size of a kick [default: eps].
    #[arg(long, value_parser = plain, allow_hyphen_values = true, help_heading = "Schedule")]
    pub kick_size: Option<f64>,
    /// Distribution of a kick [default: sphere].
    #[arg(long, value_enum, help_heading = "Schedule")]
    pub kick_law: Option<KickLaw>,
    /// End of repelling sliding (with --switch filippov): at-once:SIDE, after-time:T:SIDE,
    /// after-arc:L:SIDE, with SIDE plus or minus; random:exponential:MEAN or random:uniform:LONGEST
    /// (see --seed, --stream, --plus-probability); all. Without it a run ends with an error where a
    /// choice is needed.
    #[arg(long, value_name = "RULE", allow_hyphen_values = true, help_heading = "Filippov motion")]
    pub exit: Option<String>,
    /// Mixture that a general system takes on several surfaces at once if mixtures of its fields
    /// have different velocities [default: none, an error]: bilinear (products of one weight for
    /// each surface: equally steep smoothed switches), hull-least-norm (the shortest velocity of
    /// Filippov's hull that stays on the surfaces), or order:EXPRESSION,... (a hierarchy of the
    /// switching functions that meet, the fastest first).
    #[arg(long, value_name = "RULE", allow_hyphen_values = true, help_heading = "Filippov motion")]
    pub intersection: Option<String>,
    /// Probability of leaving to h > 0 under a random exit rule [default: 0.5].
    #[arg(long, value_parser = plain, allow_hyphen_values = true, help_heading = "Filippov motion")]
    pub plus_probability: Option<f64>,
    /// Number of exit times of a funnel (--exit all); each is followed to both sides [default: 12].
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Filippov motion")]
    pub funnel_times: Option<usize>,
    /// Shortest time of repelling sliding in a funnel [default: 0.05].
    #[arg(
        long,
        value_parser = time,
        value_name = "T",
        allow_hyphen_values = true,
        help_heading = "Filippov motion"
    )]
    pub funnel_shortest: Option<f64>,
    /// Longest time of repelling sliding in a funnel [default: 2].
    #[arg(
        long,
        value_parser = time,
        value_name = "T",
        allow_hyphen_values = true,
        help_heading = "Filippov motion"
    )]
    pub funnel_longest: Option<f64>,
    /// Follow each future so long, or to its next two-fold [default: 50].
    #[arg(
        long,
        value_parser = time,
        value_name = "T",
        allow_hyphen_values = true,
        help_heading = "Filippov motion"
    )]
    pub funnel_horizon: Option<f64>,
    /// Seed of the random numbers of kicks and random exits [default: 2013].
    #[arg(long, allow_negative_numbers = true, help_heading = "Random numbers")]
    pub seed: Option<u64>,
    /// Stream of the random numbers: runs with other streams have independent numbers [default: 0].
    #[arg(long, allow_negative_numbers = true, help_heading = "Random numbers")]
    pub stream: Option<u64>,
    /// Record crossings of a plane instead of the path, such as y=0.
    #[arg(
        long,
        value_name = "COORDINATE=VALUE",
        allow_hyphen_values = true,
        help_heading = "Recording"
    )]
    pub section: Option<String>,
    /// Largest distance between the recorded polyline and the path; from a state that moves over
    /// less than 0.003 at most a thousandth of that [default: 0.001; of a picture 0.0001].
    #[arg(long, value_parser = plain, allow_hyphen_values = true, help_heading = "Recording")]
    pub chord: Option<f64>,
    /// Record the state at the multiples of this time, instead of points that follow the path; of a
    /// general system also before and after each event.
    #[arg(
        long,
        value_parser = time,
        value_name = "DT",
        allow_hyphen_values = true,
        help_heading = "Recording"
    )]
    pub every: Option<f64>,
    /// Take the whole run from a file made with --print-spec, or from standard input (-); other
    /// flags of the run are then refused.
    #[arg(long, value_name = "FILE")]
    pub spec: Option<PathBuf>,
}

/// The system without --system.
const DEFAULT_SYSTEM: &str = "caricature";

/// Flags of the switch that a system with h, plus and minus gets when it is read as a general one.
pub const SWITCH: [&str; 4] = ["--switch", "--eps", "--transition", "--sigma"];

/// Width of the layer of a switch without --eps.
const EPS: f64 = 1e-3;

/// A switch by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Switch {
    /// Eq. (8).
    #[default]
    Smoothed,
    /// Eq. (10).
    Hysteretic,
    /// f+ while h(x(t - delay)) > 0; smooth with --eps.
    Delayed,
    /// A relay with memory: f+ until h falls to -band, then f- until it rises to band.
    Relay,
    /// The discontinuous system itself.
    Filippov,
}

/// The use that a command makes of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// `twofold run`: the path, or crossings if a section is given.
    Any,
    /// `twofold plot`: the same, the path by default ten times closer to the dense output.
    Picture,
    /// `twofold sweep`: crossings in any case.
    Crossings,
    /// `twofold orbit`: a closed orbit through the plane that --section gives.
    Orbit,
    /// `twofold lyapunov`: an average along the orbit.
    Exponent,
}

impl Use {
    /// Whether the command follows an orbit as `twofold run` does.
    fn is_a_run(self) -> bool {
        matches!(self, Use::Any | Use::Picture | Use::Crossings)
    }

    /// Whether it records the orbit's path.
    fn records_a_path(self) -> bool {
        matches!(self, Use::Any | Use::Picture)
    }
}

/// A flag and the runs on which it has an effect.
struct Effect {
    /// The flag.
    flag: &'static str,
    /// Whether it is given.
    given: fn(&RunFlags) -> bool,
    /// Whether it has an effect.
    works: fn(&RunFlags, Use) -> bool,
    /// When it has one, and what to do.
    why: &'static str,
}

impl RunFlags {
    fn system_name(&self) -> &str {
        self.system.as_deref().unwrap_or(DEFAULT_SYSTEM)
    }
    fn caricature(&self) -> bool {
        matches!(self.system_name(), "caricature" | "caricature-as-printed")
    }
    /// Whether --set gives a parameter its value.
    fn sets(&self, parameter: &str) -> bool {
        self.set.iter().any(|text| text.split('=').next().map(str::trim) == Some(parameter))
    }
    fn switch(&self) -> Switch {
        self.switch.unwrap_or_default()
    }
    /// The switch in words, if no flag chooses it, the system has one, and no axis varies it.
    pub fn default_switch(&self, axes: &[Axis]) -> Option<String> {
        let chosen = self.spec.is_some()
            || self.switch.is_some()
            || self.eps.is_some()
            || self.transition.is_some()
            || self.sigma.is_some()
            || axes.iter().any(|axis| {
                matches!(axis.coordinate, Coordinate::Eps | Coordinate::Sigma)
                    || axis.coordinate == Coordinate::Parameter("eps".into())
            });
        (!chosen && self.described_system().is_ok()).then(|| {
            format!(
                "smoothed with eps = {} (the default; --switch filippov for the discontinuous \
                    system)",
                Short(EPS)
            )
        })
    }

    /// Whether the switch is the smoothed one.
    pub fn is_smoothed(&self) -> bool {
        self.switch() == Switch::Smoothed
    }
    fn filippov(&self) -> bool {
        self.switch() == Switch::Filippov
    }
    /// Whether phi is a function of h, now or a delay ago.
    fn has_transition(&self) -> bool {
        match self.switch() {
            Switch::Smoothed => true,
            Switch::Delayed => self.eps.is_some(),
            _ => false,
        }
    }
    fn exit_begins(&self, word: &str) -> bool {
        self.filippov() && self.exit.as_deref().is_some_and(|e| e.split(':').next() == Some(word))
    }
    /// Whether all futures of a set-valued point are followed.
    fn follows_futures(&self, command: Use) -> bool {
        self.exit_begins("all") && command.is_a_run()
    }
    fn extended(&self) -> bool {
        self.method == Some(Method::TaylorExtended)
    }
    fn kicked(&self) -> bool {
        !self.filippov() && self.kick_every.is_some()
    }
    fn random(&self) -> bool {
        self.kicked() || self.exit_begins("random")
    }
}

const OF_THE_CARICATURE: &str = "it belongs to the caricature, and --set NAME=VALUE comes after \
    it; leave it out, and give parameters of other systems by --set";
const OF_FUNNELS: &str = "it describes the futures that --switch filippov --exit all follows; \
    leave it out, or follow them";
const OF_RANDOM: &str =
    "nothing in this run is random; leave it out, or give --kick-every or a random --exit";
const NOT_FILIPPOV: &str = "only runs with another --switch than filippov have restarts and kicks, \
    and exponents have kicks; leave it out, or choose another --switch";
const OF_DELAYS: &str = "it belongs to the delayed switch; leave it out, or use --switch delayed";
const OF_RELAYS: &str = "it belongs to the relay; leave it out, or use --switch relay";
const OF_ORBITS: &str = "a closed orbit's steps are chosen by its tolerance alone; leave it out";
const OF_EXTENDED: &str = "other methods compute in f64, and choose their order; leave it out, or \
    use --method taylor-extended";
const OF_KICKS: &str = "there are no kicks; leave it out, or give --kick-every";

/// The table. Every flag of [`RunFlags`] but --spec stands in it once.
const EFFECTS: [Effect; 43] = {
    // A flag that has an effect on these runs, and why it has none on others.
    macro_rules! when {
        ($flag:literal, $field:ident, $works:expr, $why:expr $(,)?) => {
            Effect { flag: $flag, given: |f| f.$field.is_some(), works: $works, why: $why }
        };
    }
    macro_rules! always {
        ($flag:literal, $field:ident) => {
            when!($flag, $field, |_, _| true, "")
        };
    }
    [
        always!("--system", system),
        Effect { flag: "--set", given: |f| !f.set.is_empty(), works: |_, _| true, why: "" },
        always!("--switch", switch),
        when!(
            "--reading",
            reading,
            |f, _| {
                !code::readings(f.system_name()).is_empty()
                    && !f.gives_what_readings_differ_in(&|_| false)
            },
            "a reading gives the caricature's alpha and beta; leave it out with other systems, or \
                where those that readings differ in are given",
        ),
        when!("--alpha", alpha, |f, _| f.caricature() && !f.sets("alpha"), OF_THE_CARICATURE),
        when!("--beta", beta, |f, _| f.caricature() && !f.sets("beta"), OF_THE_CARICATURE),
        when!("--v-plus", v_plus, |f, _| f.caricature() && !f.sets("v_plus"), OF_THE_CARICATURE),
        when!("--v-minus", v_minus, |f, _| f.caricature() && !f.sets("v_minus"), OF_THE_CARICATURE),
        when!("--delay", delay, |f, _| f.switch() == Switch::Delayed, OF_DELAYS),
        when!("--history", history, |f, _| f.switch() == Switch::Delayed, OF_DELAYS),
        when!("--band", band, |f, _| f.switch() == Switch::Relay, OF_RELAYS),
        when!("--inside", inside, |f, _| f.switch() == Switch::Relay, OF_RELAYS),
        when!(
            "--eps",
            eps,
            |f, _| !matches!(f.switch(), Switch::Filippov | Switch::Relay),
            "the discontinuous system and the relay have no eps; leave it out, or choose another \
                --switch",
        ),
        when!(
            "--transition",
            transition,
            |f, _| f.has_transition(),
            "it shapes the smoothed switch; leave it out, or use --switch smoothed, or delayed \
                with --eps",
        ),
        when!(
            "--sigma",
            sigma,
            |f, _| f.has_transition() && matches!(f.transition, None | Some(Transition::Tanh)),
            "it perturbs the smoothed switch's tanh; leave it out, or use --switch smoothed and \
                --transition tanh",
        ),
        when!(
            "--eps-prime",
            eps_prime,
            |f, _| f.switch() == Switch::Hysteretic,
            "it is the relaxation time of the hysteretic switch; leave it out, or use --switch \
                hysteretic",
        ),
        when!(
            "--hysteresis",
            hysteresis,
            |f, _| f.switch() == Switch::Hysteretic,
            "it is a reading of the hysteretic switch; leave it out, or use --switch hysteretic",
        ),
        always!("--start", start),
        when!(
            "--t-start",
            t_start,
            |_, _| false,
            "equations with h, plus and minus do not see the time, and their runs begin at 0; \
                leave it out (general systems take it)",
        ),
        when!(
            "--t-end",
            t_end,
            |_, c| c != Use::Orbit,
            "a closed orbit has its own period; leave it out, and see --settle",
        ),
        when!(
            "--method",
            method,
            |_, c| c.is_a_run(),
            "closed orbits and exponents are computed by Dormand-Prince, together with tangent \
                vectors; leave it out",
        ),
        always!("--rtol", rtol),
        always!("--atol", atol),
        when!("--max-step", max_step, |_, c| c != Use::Orbit, OF_ORBITS),
        when!("--max-steps", max_steps, |_, c| c != Use::Orbit, OF_ORBITS),
        when!("--precision", precision, |f, c| f.extended() && c.is_a_run(), OF_EXTENDED),
        when!("--order", order, |f, c| f.extended() && c.is_a_run(), OF_EXTENDED),
        when!("--restart", restart, |f, c| !f.filippov() && c.is_a_run(), NOT_FILIPPOV),
        when!("--kick-every", kick_every, |f, c| !f.filippov() && c != Use::Orbit, NOT_FILIPPOV),
        when!("--kick-size", kick_size, |f, c| f.kicked() && c != Use::Orbit, OF_KICKS),
        when!("--kick-law", kick_law, |f, c| f.kicked() && c != Use::Orbit, OF_KICKS),
        when!(
            "--exit",
            exit,
            |f, c| f.filippov() && (c.is_a_run() || c == Use::Exponent),
            "it ends the repelling sliding of a run with --switch filippov; other motion leaves it \
                by itself, and a closed orbit has none; leave it out",
        ),
        when!(
            "--intersection",
            intersection,
            |_, _| false,
            "at the intersection of h and the second h nothing is chosen; leave it out (general \
                systems take it)",
        ),
        when!(
            "--plus-probability",
            plus_probability,
            |f, c| f.exit_begins("random") && c.is_a_run(),
            "it belongs to a random --exit; leave it out, or give one such as \
                random:exponential:0.5",
        ),
        when!("--funnel-times", funnel_times, RunFlags::follows_futures, OF_FUNNELS),
        when!("--funnel-shortest", funnel_shortest, RunFlags::follows_futures, OF_FUNNELS),
        when!("--funnel-longest", funnel_longest, RunFlags::follows_futures, OF_FUNNELS),
        when!("--funnel-horizon", funnel_horizon, RunFlags::follows_futures, OF_FUNNELS),
        when!("--seed", seed, |f, c| f.random() && c != Use::Orbit, OF_RANDOM),
        when!("--stream", stream, |f, c| f.random() && c != Use::Orbit, OF_RANDOM),
        when!(
            "--section",
            section,
            |_, c| c != Use::Exponent,
            "an exponent is an average along the whole orbit; leave it out",
        ),
        when!(
            "--chord",
            chord,
            |f, command| {
                command.records_a_path()
                    && f.section.is_none()
                    && f.every.is_none()
                    && !f.exit_begins("all")
            },
            "it belongs to a recorded path; crossings and --every have none, and futures of a \
                funnel are recorded at fixed points of each step",
        ),
        when!(
            "--every",
            every,
            |f, command| command.records_a_path() && f.section.is_none() && !f.exit_begins("all"),
            "it belongs to a recorded path; the crossings of --section are not thinned, and \
                futures of a funnel are recorded at fixed points of each step",
        ),
    ]
};

/// A flag's value that is wrong in itself.
#[derive(Debug, thiserror::Error)]
enum Misuse {
    #[error(
        "--exit \"{0}\" is not a rule; give one such as at-once:plus, after-time:0.3:minus, \
            after-arc:0.2:plus, random:exponential:0.5, random:uniform:1, or all"
    )]
    Exit(String),
    #[error(
        "--system {name}: there is no such built-in system{help} Built in are {known}; give a \
            file's name for your own"
    )]
    NoSuchSystem { name: String, help: String, known: String },
    #[error("--system {file}: {problem}")]
    SystemFile { file: String, problem: String },
    #[error("{flag}: {problem}")]
    Own { flag: String, problem: String },
    #[error("--set \"{text}\": {problem}")]
    Set { text: String, problem: String },
    #[error(
        "{system} suggests no initial state; give one by --start: a number for each of {states}"
    )]
    NoStart { system: String, states: String },
    #[error("--start: {found} given, {wanted} wanted, a number for each of {states}")]
    Start { found: usize, wanted: usize, states: String },
    #[error(
        "--section \"{text}\": {problem}; give one of {known} and a number, such as {example}=0"
    )]
    Section { text: String, problem: &'static str, known: String, example: String },
    #[error(
        "a closed orbit is looked for through a plane: give one by --section, such as {example}=0"
    )]
    NoPlane { example: String },
    #[error(
        "--exit \"{0}\": an exponent belongs to one motion; give at-once:plus or at-once:minus, or \
            leave it out where nothing has to be chosen"
    )]
    ExitOfExponent(String),
    #[error("--reading {name}: there is no such reading; known are {known}")]
    NoSuchReading { name: String, known: String },
    #[error("--switch delayed needs its delay: give one by --delay, such as --delay 0.001")]
    NoDelay,
    #[error("--switch relay needs its band: give half its width by --band, such as --band 0.001")]
    NoBand,
    #[error(
        "--switch delayed: the state is the whole past, of which no closed orbits are computed; \
            follow a long run (twofold run, twofold sweep), or give another --switch"
    )]
    Past,
    #[error(
        "--switch relay: the state has a mode beside it, with which no closed orbits are computed; \
            follow a long run (twofold run, twofold sweep), or give another --switch"
    )]
    Mode,
    #[error(
        "--system {system}: a general system (f, events, modes or tables) is taken by `twofold \
            run`, `plot`, `orbit`, `lyapunov`, `rests`, `scan`, `sweep` and `sensitivities`; this \
            command needs one with h, plus and minus"
    )]
    General { system: String },
    #[error(
        "--switch: only systems of up to four states have this one, and here are {states}; give \
            smoothed or filippov, or write it as f = [...], with a state or modes for the switch"
    )]
    SwitchOfManyStates { states: usize },
    #[error(
        "--exit all follows many futures and records their paths; a sweep needs crossings: give \
            another rule"
    )]
    FunnelInSweep,
    #[error(
        "{file} is not a spec of one run: {reason}; make one with `twofold run ... \
            --print-spec`, or `twofold figure FIGURE --only PANEL --reading READING --print-spec`"
    )]
    Spec { file: String, reason: String },
}

impl From<Misuse> for CliError {
    fn from(misuse: Misuse) -> Self {
        CliError::Usage(misuse.to_string())
    }
}

impl RunFlags {
    /// The first flag here that gives a number which every row of a sweep over `axes` replaces, and
    /// the axes' name for it.
    pub fn replaced_by(&self, axes: &[Axis]) -> Option<(&'static str, String)> {
        let varied = |c: &Coordinate| axes.iter().any(|axis| axis.coordinate == *c);
        let parameter = |name: &str| varied(&Coordinate::Parameter(name.to_owned()));
        let tolerance = varied(&Coordinate::Tolerance);
        let plain = |c: Coordinate| varied(&c).then(|| c.to_string());
        let named = |name: &str| parameter(name).then(|| format!("params.{name}"));
        let starts =
            axes.iter().filter(|axis| matches!(axis.coordinate, Coordinate::Start(_))).count();
        let all_started = || {
            self.start.as_ref().is_some_and(|s| s.len() == starts).then(|| "start.NAME".to_owned())
        };
        let both = || {
            let replaced = parameter("alpha") || parameter("beta");
            (replaced && self.gives_what_readings_differ_in(&parameter))
                .then(|| "params.alpha and params.beta".to_owned())
        };
        let set = || {
            let names = self.set.iter().filter_map(|text| text.split('=').next());
            names.map(str::trim).find_map(named)
        };
        let of = |coordinate: Coordinate| {
            if tolerance && matches!(coordinate, Coordinate::Rtol | Coordinate::Atol) {
                Some(Coordinate::Tolerance.to_string())
            } else {
                plain(coordinate)
            }
        };
        // The width of a general system's smoothed switch is its parameter.
        let of_many = || {
            let model = self.model_of_many_states().ok().flatten();
            let own = self.described_system().ok();
            model.is_some() && own.is_some_and(|s| s.parameter("eps").is_none())
        };
        let width = || self.eps_is_replaced(axes).or_else(|| named("eps").filter(|_| of_many()));
        let table: [(&'static str, bool, Option<String>); 19] = [
            ("--set", !self.set.is_empty(), set()),
            ("--reading", self.reading.is_some(), both()),
            ("--alpha", self.alpha.is_some(), named("alpha")),
            ("--beta", self.beta.is_some(), named("beta")),
            ("--v-plus", self.v_plus.is_some(), named("v_plus")),
            ("--v-minus", self.v_minus.is_some(), named("v_minus")),
            ("--eps", self.eps.is_some(), width()),
            ("--sigma", self.sigma.is_some(), of(Coordinate::Sigma)),
            ("--eps-prime", self.eps_prime.is_some(), of(Coordinate::EpsPrime)),
            ("--start", self.start.is_some(), all_started()),
            ("--t-end", self.t_end.is_some(), of(Coordinate::TEnd)),
            ("--method", self.method.is_some(), of(Coordinate::Method)),
            ("--rtol", self.rtol.is_some(), of(Coordinate::Rtol)),
            ("--atol", self.atol.is_some(), of(Coordinate::Atol)),
            ("--max-step", self.max_step.is_some(), of(Coordinate::MaxStep)),
            ("--restart", self.restart.is_some(), of(Coordinate::Interval)),
            ("--kick-size", self.kick_size.is_some(), of(Coordinate::KickSize)),
            ("--seed", self.seed.is_some(), of(Coordinate::Seed)),
            ("--stream", self.stream.is_some(), of(Coordinate::Stream)),
        ];
        table.into_iter().find_map(|(flag, given, by)| if given { Some((flag, by?)) } else { None })
    }

    /// --eps also gives eps' and the size of kicks where those have no flag of their own, and says
    /// that a delayed switch is the smooth one.
    fn eps_is_replaced(&self, axes: &[Axis]) -> Option<String> {
        let used_elsewhere = (self.kicked() && self.kick_size.is_none())
            || (self.switch() == Switch::Hysteretic && self.eps_prime.is_none())
            || self.switch() == Switch::Delayed;
        let varied = axes.iter().any(|axis| axis.coordinate == Coordinate::Eps);
        (varied && !used_elsewhere).then(|| Coordinate::Eps.to_string())
    }

    /// The spec that the flags describe, checked. For [`Use::Crossings`] a path becomes its
    /// crossings of the plane where the second coordinate is zero.
    ///
    /// # Errors
    /// If a flag has no effect, or a value is wrong.
    pub fn spec(&self, command: Use) -> Result<RunSpec, CliError> {
        let mut spec = match &self.spec {
            Some(file) => {
                if let Some(extra) = EFFECTS.iter().find(|e| (e.given)(self)) {
                    return Err(CliError::no_effect(
                        extra.flag,
                        "--spec gives the whole run; leave one of the two out, or change the file",
                    ));
                }
                let (text, name) = if file.as_os_str() == "-" {
                    (
                        read_text_from(io::stdin().lock(), "standard input")?,
                        "standard input".to_owned(),
                    )
                } else {
                    (read_text(file)?, file.display().to_string())
                };
                serde_json::from_str(&text)
                    .map_err(|e| Misuse::Spec { file: name, reason: e.to_string() })?
            }
            None => {
                if let Some(idle) =
                    EFFECTS.iter().find(|e| (e.given)(self) && !(e.works)(self, command))
                {
                    return Err(CliError::no_effect(idle.flag, idle.why));
                }
                each_once("--set", &self.set)?;
                let spec = self.unchecked(command)?;
                if command != Use::Crossings {
                    self.acts_before(spec.t_end)?;
                }
                spec
            }
        };
        if command == Use::Crossings
            && let Observation::Path { .. } | Observation::Times { .. } = spec.observe
        {
            if let SwitchSpec::Filippov { funnel: Some(_), .. } = spec.switch {
                return Err(Misuse::FunnelInSweep.into());
            }
            spec.observe = Observation::Section { coordinate: 1, value: 0.0 };
        }
        spec.validate()?;
        Ok(spec)
    }

    /// Refuses restarts and kicks that come after the run's end.
    fn acts_before(&self, t_end: f64) -> Result<(), CliError> {
        for (flag, every) in [("--restart", self.restart), ("--kick-every", self.kick_every)] {
            if every.is_some_and(|every| every >= t_end) {
                let why = format!(
                    "the run ends at t = {}, before the first one; give a later --t-end, or leave \
                        it out",
                    Short(t_end)
                );
                return Err(CliError::NoEffect { flag: flag.to_owned(), why });
            }
        }
        Ok(())
    }

    /// Every flag that is given, --spec among them.
    pub fn given(&self) -> Vec<&'static str> {
        let spec = self.spec.as_ref().map(|_| "--spec");
        spec.into_iter().chain(EFFECTS.iter().filter(|e| (e.given)(self)).map(|e| e.flag)).collect()
    }

    /// The first flag that is given, --spec among them.
    pub fn first_given(&self) -> Option<&'static str> {
        let spec = self.spec.as_ref().map(|_| "--spec");
        spec.or_else(|| EFFECTS.iter().find(|e| (e.given)(self)).map(|e| e.flag))
    }

    fn unchecked(&self, command: Use) -> Result<RunSpec, CliError> {
        let general = |name: &str| named(name, &self.set, false);
        if self.system.as_deref().map_or(Ok(None), general)?.is_some() {
            return Err(Misuse::General { system: self.system_name().to_owned() }.into());
        }
        Ok(self.described(command)?)
    }

    fn described(&self, command: Use) -> Result<RunSpec, Misuse> {
        let system = self.described_system()?;
        let (eps, transition) = (self.eps.unwrap_or(EPS), self.transition());
        let mut switch = match self.switch() {
            Switch::Smoothed => SwitchSpec::Smoothed { eps, transition },
            Switch::Hysteretic => SwitchSpec::Hysteretic {
                eps,
                eps_prime: self.eps_prime.unwrap_or(10.0 * eps),
                relaxation: self.hysteresis.unwrap_or(Relaxation::Literal).into(),
                phi0: 1.0,
            },
            Switch::Delayed if command == Use::Orbit => return Err(Misuse::Past),
            Switch::Delayed => SwitchSpec::Delayed {
                delay: self.delay.ok_or(Misuse::NoDelay)?,
                eps: self.eps,
                transition: self.eps.map(|_| transition),
                history: self.history.map(Into::into).unwrap_or_default(),
            },
            Switch::Relay if command == Use::Orbit => return Err(Misuse::Mode),
            Switch::Relay => SwitchSpec::Relay {
                band: self.band.ok_or(Misuse::NoBand)?,
                inside: self.inside.map(Into::into).unwrap_or_default(),
            },
            Switch::Filippov => {
                let exit = self.exit_rule()?;
                let plain = matches!(exit, ExitRule::AtOnce { .. } | ExitRule::Undecided);
                if command == Use::Exponent && !plain {
                    return Err(Misuse::ExitOfExponent(self.exit.clone().unwrap_or_default()));
                }
                let funnel = (exit == ExitRule::All).then_some(FunnelSpec {
                    shortest: self.funnel_shortest.unwrap_or(0.05),
                    longest: self.funnel_longest.unwrap_or(2.0),
                    times: self.funnel_times.unwrap_or(12),
                    horizon: self.funnel_horizon.unwrap_or(50.0),
                    until_two_fold: true,
                });
                SwitchSpec::Filippov { exit, funnel }
            }
        };
        let start = match &self.start {
            None => {
                let none = || Misuse::NoStart {
                    system: self.system_name().to_owned(),
                    states: system.coordinates().join(", "),
                };
                system.definition().start().ok_or_else(none)?.to_vec()
            }
            Some(numbers) if numbers.len() != system.dimension() => {
                let states = system.coordinates().join(", ");
                return Err(Misuse::Start {
                    found: numbers.len(),
                    wanted: system.dimension(),
                    states,
                });
            }
            Some(numbers) => numbers.clone(),
        };
        if let SwitchSpec::Hysteretic { phi0, .. } = &mut switch {
            *phi0 = SwitchSpec::phi_at(&system, &start);
        }
        let by_events = matches!(self.switch(), Switch::Delayed | Switch::Relay | Switch::Filippov);
        let method = self.method.unwrap_or(if by_events { Method::Dopri5 } else { Method::Lsoda });
        let mut defaults = MethodSpec::defaults(integrate::Method::from(method));
        if let Some(bits) = self.precision {
            let finest = finest_extended(bits);
            defaults.tolerance = Tolerance { rtol: finest, atol: finest };
        }
        match command {
            Use::Orbit => defaults.tolerance = Tolerance { rtol: 1e-11, atol: 1e-11 },
            Use::Exponent => {
                defaults = MethodSpec {
                    name: integrate::Method::Dopri5,
                    tolerance: Tolerance { rtol: 1e-9, atol: 1e-9 },
                    step_cap: StepCap::None,
                    max_steps: DEFAULT_MAX_STEPS,
                    precision: None,
                    order: None,
                }
            }
            Use::Any | Use::Picture | Use::Crossings => {}
        }
        defaults.tolerance = in_units_of(defaults.tolerance, &start);
        let method = MethodSpec {
            name: defaults.name,
            tolerance: Tolerance {
                rtol: self.rtol.unwrap_or(defaults.tolerance.rtol),
                atol: self.atol.unwrap_or(defaults.tolerance.atol),
            },
            step_cap: match self.max_step {
                None => defaults.step_cap,
                Some(longest) if longest == f64::INFINITY => StepCap::None,
                Some(longest) => StepCap::Absolute(longest),
            },
            max_steps: self.max_steps.unwrap_or(DEFAULT_MAX_STEPS),
            precision: self.precision,
            order: self.order,
        };
        let kick = self.kick_every.map(|every| Kick {
            every,
            size: self.kick_size.unwrap_or(eps),
            law: self.kick_law.map(Into::into).unwrap_or_default(),
            seed: self.seed(),
            stream: self.stream.unwrap_or(0),
        });
        let observe = match &self.section {
            None if command == Use::Orbit => {
                let names = system.coordinates();
                return Err(Misuse::NoPlane { example: names[1.min(names.len() - 1)].into() });
            }
            None if self.every.is_some() => {
                Observation::Times { every: self.every.unwrap_or(f64::NAN) }
            }
            None => Observation::Path {
                chord: self.chord.unwrap_or(if command == Use::Picture { 1e-4 } else { 1e-3 }),
            },
            Some(text) => section(text, &system)?,
        };
        Ok(RunSpec {
            system,
            switch,
            start,
            t_end: self.t_end.unwrap_or(if command == Use::Exponent { 10_000.0 } else { 150.0 }),
            method,
            schedule: Schedule { restart_every: self.restart, kick },
            observe,
        })
    }

    /// Whether each number in which the readings differ is given, by a flag or as `varied` says: a
    /// reading is then of no use.
    fn gives_what_readings_differ_in(&self, varied: &dyn Fn(&str) -> bool) -> bool {
        let readings = code::readings(self.system_name());
        let numbers = || readings.iter().flat_map(|reading| &reading.parameters);
        numbers().all(|(name, value)| {
            let own = self.own_parameters().iter().any(|(own, flag)| own == name && flag.is_some());
            let same = |(other, number): &(String, f64)| other != name || number == value;
            own || self.sets(name) || varied(name) || numbers().all(same)
        })
    }

    /// Parameters that have flags of their own, with what these give.
    fn own_parameters(&self) -> [(&'static str, Option<f64>); 4] {
        [
            ("alpha", self.alpha),
            ("beta", self.beta),
            ("v_plus", self.v_plus),
            ("v_minus", self.v_minus),
        ]
    }

    /// The reading of the system's parameters, if it has any.
    fn parameter_reading(&self) -> Result<Option<ParameterReading>, Misuse> {
        let mut readings = code::readings(self.system_name());
        let Some(name) = &self.reading else { return Ok(readings.into_iter().next()) };
        let known = readings.iter().map(|r| r.name.clone()).collect::<Vec<_>>().join(", ");
        readings.retain(|r| r.name == *name);
        let unknown = || Misuse::NoSuchReading { name: name.clone(), known };
        readings.pop().map(Some).ok_or_else(unknown)
    }

    /// The system that --system, --reading, --set and the caricature's own flags describe.
    fn transition(&self) -> system::Transition {
        match (self.transition.unwrap_or(Transition::Tanh), self.sigma) {
            (Transition::Tanh, Some(sigma)) => system::Transition::PerturbedTanh { sigma },
            (Transition::Tanh, None) => system::Transition::Tanh,
            (Transition::Arctan, _) => system::Transition::Arctan,
            (Transition::Algebraic, _) => system::Transition::Algebraic,
            (Transition::Erf, _) => system::Transition::Erf,
        }
    }

    /// Refuses a system that is not there, or a value that it does not have.
    ///
    /// # Errors
    /// If it is so.
    pub fn check_system(&self) -> Result<(), CliError> {
        Ok(self.described_system().map(|_| ())?)
    }

    fn described_system(&self) -> Result<System, Misuse> {
        let name = self.system_name();
        let mut system = match System::builtin(name) {
            Some(system) => system,
            None => from_file(name)?,
        };
        let reading = self.parameter_reading()?;
        let read = reading.iter().flat_map(|reading| &reading.parameters);
        let read = read.map(|(name, value)| ("--reading".to_owned(), name.as_str(), *value));
        let own = self.own_parameters().into_iter().filter(|_| self.caricature());
        let own = own.filter_map(|(name, value)| {
            Some((format!("--{}", name.replace('_', "-")), name, value?))
        });
        for (flag, parameter, value) in read.chain(own) {
            let refused = |e: ParameterError| Misuse::Own { flag, problem: e.to_string() };
            system = system.with(parameter, value).map_err(refused)?;
        }
        for text in &self.set {
            let refused = |problem: String| Misuse::Set { text: text.clone(), problem };
            let Some((parameter, value)) = text.split_once('=') else {
                return Err(refused(
                    "there is no \"=\"; give it as NAME=VALUE, such as alpha=0.2".into(),
                ));
            };
            let value: Decimal =
                value.trim().parse().map_err(|e: DecimalError| refused(e.to_string()))?;
            system = system.with(parameter.trim(), value).map_err(|e| refused(e.to_string()))?;
        }
        Ok(system)
    }

    /// A system with h, plus and minus in more states than its own engine is compiled for, as a
    /// general one; none if the flags name no such system.
    ///
    /// # Errors
    /// If a flag of the switch has no effect, or general systems cannot have it.
    pub fn model_of_many_states(&self) -> Result<Option<Model>, CliError> {
        // Errors of the system are said where its run is described.
        let system = match self.described_system() {
            Ok(system) if system.dimension() > MOST_STATES && self.spec.is_none() => system,
            _ => return Ok(None),
        };
        for (flag, value) in [("--eps", self.eps), ("--sigma", self.sigma)] {
            let least = if flag == "--eps" { 0.0 } else { f64::NEG_INFINITY };
            if let Some(value) = value.filter(|v| !(v.is_finite() && *v > least)) {
                let above = if flag == "--eps" { " above zero" } else { "" };
                return Err(CliError::Usage(format!(
                    "{flag} is {value}: give a finite number{above}"
                )));
            }
        }
        let of_switch = |e: &&Effect| SWITCH.contains(&e.flag) && (e.given)(self);
        if let Some(idle) = EFFECTS.iter().filter(of_switch).find(|e| !(e.works)(self, Use::Any)) {
            return Err(CliError::no_effect(idle.flag, idle.why));
        }
        let switch = match self.switch() {
            Switch::Smoothed => {
                SwitchSpec::Smoothed { eps: self.eps.unwrap_or(EPS), transition: self.transition() }
            }
            Switch::Filippov => SwitchSpec::Filippov { exit: ExitRule::Undecided, funnel: None },
            _ => return Err(Misuse::SwitchOfManyStates { states: system.dimension() }.into()),
        };
        Ok(Some(model_with(&system, switch)?))
    }

    fn seed(&self) -> u64 {
        self.seed.unwrap_or(2013)
    }

    /// Reads "after-time:0.3:minus".
    fn exit_rule(&self) -> Result<ExitRule, Misuse> {
        let Some(text) = self.exit.as_deref() else { return Ok(ExitRule::Undecided) };
        let wrong = || Misuse::Exit(text.to_owned());
        let side = |word: &str| match word {
            "plus" => Ok(Side::Plus),
            "minus" => Ok(Side::Minus),
            _ => Err(wrong()),
        };
        let number = |word: &str| word.parse::<f64>().map_err(|_| wrong());
        let random = |law| ExitRule::Random {
            law,
            plus_probability: self.plus_probability.unwrap_or(0.5),
            seed: self.seed(),
            stream: self.stream.unwrap_or(0),
        };
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
}

/// Help of --reading: the readings with their numbers.
fn reading_help() -> String {
    let number = |(name, value): &(String, f64)| format!("{name} = {}", Short(*value));
    let said = |reading: &ParameterReading| {
        let numbers: Vec<String> = reading.parameters.iter().map(number).collect();
        format!("{} ({})", reading.name, numbers.join(", "))
    };
    let readings = code::readings(DEFAULT_SYSTEM);
    let first = readings.first().map_or("none", |reading| &reading.name);
    let readings = readings.iter().map(said).collect::<Vec<_>>().join(", ");
    format!(
        "Parameters of the caricature, by a reading of its paper: {readings} [default: {first}]"
    )
}

/// A number of a flag. Whether it is one that makes sense is said where its run is described.
pub(crate) fn plain(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| "not a number; write it like 0.25 or 1e-3".into())
}

/// A time of a flag.
pub(crate) fn time(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| {
        "not a number; write it like 0.25 or 1e-3, without a unit: times are in the system's own"
            .into()
    })
}

/// An axis, with advice on the commonest slip: a parameter's name without `params.`.
pub(crate) fn axis(text: &str) -> Result<Axis, String> {
    let name = text.split('=').next().unwrap_or_default().trim();
    let is_name = !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || c == '_');
    text.parse::<Axis>().map_err(|error| match name.parse::<Coordinate>() {
        Err(_) if is_name => format!(
            "did you mean params.{name} (a parameter), or start.{name} (where a state begins)? \
                {error}"
        ),
        _ => error.to_string(),
    })
}

/// A length: a finite number, or the word inf.
fn longest(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(length) if length.is_infinite() && text.contains(char::is_numeric) => {
            Err("beyond the range of double precision; give inf for any length".into())
        }
        Ok(length) => Ok(length),
        Err(_) => Err("not a number; write it like 0.25, or inf".into()),
    }
}

/// A system from a file, TOML or JSON.
fn from_file(name: &str) -> Result<System, Misuse> {
    let path = Path::new(name);
    let json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    // A general system's file comes here if it cannot be read as one, and so does a file's name
    // that is misspelt.
    if !names_a_file(name) {
        let (help, known) = known(name);
        return Err(Misuse::NoSuchSystem { name: name.into(), help, known });
    }
    let problem = |problem: String| Misuse::SystemFile { file: name.into(), problem };
    let text = read_text(path).map_err(|e| problem(e.to_string()))?;
    if json {
        serde_json::from_str(&text).map_err(|e| problem(e.to_string()))
    } else {
        Definition::from_toml(&text, name).map(System::new).map_err(|e| problem(e.to_string()))
    }
}

/// Reads "y=0".
fn section(text: &str, system: &System) -> Result<Observation, Misuse> {
    let names = system.coordinates();
    let misuse = |problem| Misuse::Section {
        text: text.to_owned(),
        problem,
        known: names.join(", "),
        example: names[1.min(names.len() - 1)].into(),
    };
    let (name, value) = text.split_once('=').ok_or_else(|| misuse("there is no \"=\""))?;
    let coordinate = names
        .iter()
        .position(|n| *n == name.trim())
        .ok_or_else(|| misuse("there is no such coordinate"))?;
    let value = value.trim().parse().map_err(|_| misuse("what follows \"=\" is not a number"))?;
    Ok(Observation::Section { coordinate, value })
}

#[cfg(test)]
mod tests;
