//! Rows of a sweep that share lanes against the same rows alone.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};

use twofold::integrate::ensemble::InstructionSet;
use twofold::integrate::{Kick, KickLaw, Monitor, Schedule};
use twofold::job::spec::*;
use twofold::job::sweep::{Axis, Draws, Row, Sweep};
use twofold::job::{JobError, JobMonitor, Progress};
use twofold::system::{Caricature, Definition, System, Transition};

fn run(system: System, t_end: f64) -> RunSpec {
    RunSpec {
        system,
        switch: SwitchSpec::tanh(1e-3),
        start: vec![0.2, 0.0, -1.0],
        t_end,
        method: MethodSpec::ndsolve_defaults(Method::Dopri5),
        schedule: Schedule::default(),
        observe: Observation::Section { coordinate: 1, value: 0.0 },
    }
}

fn caricature() -> System {
    Caricature::with_reinjection(1e-1, 1e-5).into()
}

fn axes(texts: &[&str]) -> Vec<Axis> {
    texts.iter().map(|t| t.parse().unwrap()).collect()
}

fn lines(sweep: &Sweep, set: InstructionSet) -> Vec<String> {
    let mut lines = vec![String::new(); sweep.rows() as usize];
    let numbers: Vec<u64> = (0..sweep.rows()).collect();
    let mut take = |row: Row| {
        lines[row.number() as usize] = row.line();
        true
    };
    sweep.rows_together_with(set, &numbers, &(), &mut take).unwrap();
    lines
}

fn are_the_rows(sweep: &Sweep) {
    let alone: Vec<String> =
        (0..sweep.rows()).map(|row| sweep.row(row, &()).unwrap().line()).collect();
    for set in InstructionSet::ALL {
        if set.is_here() {
            assert_eq!(lines(sweep, set), alone, "{set:?}");
        } else {
            println!("not run: {set:?}");
        }
    }
}

#[test]
fn rows_are_those_computed_alone() {
    // Two equations; restarts that differ; a cell that is wrong, one that runs out of steps, one
    // that goes far, and another method among them.
    let over =
        axes(&["params.alpha=0.1,0.2", "interval=20,40", "shift.x=-1e-3..1e-3", "t-end=30,60"]);
    are_the_rows(
        &Sweep::new(run(caricature(), 60.0), over, Some(Draws { count: 2, seed: 4 })).unwrap(),
    );
    let mut poor = run(caricature(), 200.0);
    poor.method.max_steps = 1500;
    are_the_rows(
        &Sweep::new(poor, axes(&["start.x=0.1,0.2,0.3", "start.y=0,1,30", "t-end=20,-1"]), None)
            .unwrap(),
    );
    let mixed = axes(&["method=dopri5,lsoda", "tolerance=1e-7,1e-8", "shift.x=1e-9*3"]);
    are_the_rows(&Sweep::new(run(caricature(), 20.0), mixed, None).unwrap());
    let far = axes(&["start.y=3,3.5,4,0.1", "start.z=3"]);
    let far = Sweep::new(run(caricature(), 200.0), far, None).unwrap();
    assert!((0..3).all(|row| far.row(row, &()).unwrap().outcome() == "far"));
    are_the_rows(&far);
    // Another kind of run entirely.
    let kick = Some(Kick { every: 0.3, size: 1e-3, law: KickLaw::Sphere, seed: 9, stream: 5 });
    let kicked =
        RunSpec { schedule: Schedule { restart_every: None, kick }, ..run(caricature(), 30.0) };
    are_the_rows(&Sweep::new(kicked, axes(&["shift.x=1e-9*4"]), None).unwrap());
}

/// Systems from files, which are interpreted: two, three and four states, one and two switching
/// surfaces, every transition function. Of 70 rows four registers of lanes go on at a time, of
/// fewer than 64 two.
#[test]
fn systems_from_files_share_lanes() {
    let of = |name: &str, start: &[f64], t_end: f64| {
        let run = run(System::builtin(name).unwrap(), t_end);
        RunSpec { start: start.to_vec(), ..run }
    };
    are_the_rows(
        &Sweep::new(of("stick-slip", &[0.1, 0.2], 20.0), axes(&["shift.x=-1e-2..1e-2:70"]), None)
            .unwrap(),
    );
    are_the_rows(
        &Sweep::new(of("wheel", &[0.69267, 0.0, 0.0], 3.0), axes(&["shift.r=1e-6*70"]), None)
            .unwrap(),
    );
    let forced = of("dry-friction", &[0.0, 0.5, 1.0, 0.0], 20.0);
    are_the_rows(
        &Sweep::new(forced, axes(&["params.friction=0.2,0.3", "shift.v=1e-3*4"]), None).unwrap(),
    );
    are_the_rows(
        &Sweep::new(
            of("two-blocks", &[0.0, 0.1, 10.0, 0.5], 9.0),
            axes(&["shift.v1=1e-3*4"]),
            None,
        )
        .unwrap(),
    );
    let two_fold = of("two-fold", &[0.2, 0.0, -1.0], 1.0);
    for transition in [
        Transition::PerturbedTanh { sigma: 0.1 },
        Transition::Arctan,
        Transition::Algebraic,
        Transition::Erf,
    ] {
        let run =
            RunSpec { switch: SwitchSpec::Smoothed { eps: 1e-2, transition }, ..two_fold.clone() };
        are_the_rows(&Sweep::new(run, axes(&["shift.x=1e-3*4"]), None).unwrap());
    }
}

/// Parameters and widths that differ from lane to lane, in built-in systems and in others, few and
/// many rows.
#[test]
fn rows_of_other_parameters_share_lanes() {
    let sweep = |run: RunSpec, over: &[&str]| Sweep::new(run, axes(over), None).unwrap();
    // Some go far, where a corner is; alpha = 0.001 has none.
    let corners = RunSpec { start: vec![0.2, 3.0, 3.0], ..run(caricature(), 60.0) };
    let corners = sweep(
        corners,
        &["params.alpha=1e-3,0.1,0.15,0.2", "params.beta=1e-5,1e-4", "start.y=3,0.1"],
    );
    assert!(corners.share_lanes(0, 5) || InstructionSet::best() == InstructionSet::Portable);
    let ends: Vec<String> =
        (0..corners.rows()).map(|row| corners.row(row, &()).unwrap().outcome().into()).collect();
    assert!(ends.iter().any(|end| end == "far") && ends.iter().any(|end| end != "far"), "{ends:?}");
    are_the_rows(&corners);
    are_the_rows(&sweep(
        run(caricature(), 20.0),
        &["eps=1e-2,3e-3,1e-3", "params.alpha=0.1,0.2", "shift.x=1e-9*3"],
    ));
    // Many of one equation go by themselves, the others together.
    let uneven = sweep(run(caricature(), 3.0), &["params.alpha=0.1,0.2", "shift.x=1e-9*40"]);
    are_the_rows(&uneven);
    let forced = RunSpec {
        start: vec![0.0, 0.5, 1.0, 0.0],
        ..run(System::builtin("dry-friction").unwrap(), 20.0)
    };
    are_the_rows(&sweep(forced, &["params.friction=0.1..0.3:70"]));
    // Zero is a number as any other, unless the equation is another one with it.
    are_the_rows(&sweep(run(caricature(), 5.0), &["params.beta=0,1e-5,1,-1", "params.alpha=0,1"]));
    let alphas = sweep(run(caricature(), 5.0), &["params.alpha=0.1,0.2"]);
    assert_eq!(alphas.share_lanes(0, 1), InstructionSet::best() != InstructionSet::Portable);
}

/// Tolerances that differ from lane to lane; methods do not.
#[test]
fn rows_of_other_tolerances_share_lanes() {
    let sweep = |over: &[&str]| Sweep::new(run(caricature(), 20.0), axes(over), None).unwrap();
    let tolerances = sweep(&["tolerance=1e-4,1e-6,1e-8,1e-10,1e-12", "params.alpha=0.1,0.2"]);
    assert_eq!(tolerances.share_lanes(0, 9), InstructionSet::best() != InstructionSet::Portable);
    are_the_rows(&tolerances);
    assert!(!sweep(&["method=dopri5,lsoda"]).share_lanes(0, 1));
}

/// More intermediate results at a time than the interpreter has room for without asking for memory.
#[test]
fn long_equations_share_lanes() {
    let terms: Vec<String> = (1..40).map(|k| format!("sin({k}*x)/{k} + (")).collect();
    let long = format!("{} y {}", terms.concat(), ")".repeat(terms.len()));
    let text = format!(
        "states = [\"x\", \"y\"]\nh = \"y\"\nplus = [\"y\", \"-x - 0.1*({long})\"]\nminus = \
            [\"y\", \"1 - x\"]\n"
    );
    let system = System::new(Definition::from_toml(&text, "long.toml").unwrap());
    let run = RunSpec { start: vec![0.3, 0.2], ..run(system, 10.0) };
    for rows in ["shift.x=1e-3*4", "shift.x=1e-3*66"] {
        are_the_rows(&Sweep::new(run.clone(), axes(&[rows]), None).unwrap());
    }
}

#[test]
fn rows_that_lanes_do_not_take_are_computed_alone() {
    let mut wheel = run(System::builtin("wheel").unwrap(), 3.0);
    wheel.start = vec![0.69267, 0.0, 0.0];
    are_the_rows(&Sweep::new(wheel, axes(&["method=lsoda", "shift.r=1e-6*5"]), None).unwrap());
}

/// Rows whose verdict needs an exponent: these share lanes too. (`job::exponent` has more of them,
/// over shorter times.)
#[test]
fn rows_wait_for_exponents_together() {
    let run = RunSpec {
        switch: SwitchSpec::tanh(1e-2),
        ..run(Caricature::with_reinjection(0.1, 1e-4).into(), 1000.0)
    };
    let sweep = Sweep::new(run.clone(), axes(&["params.alpha=0.1,0.11,0.12"]), None).unwrap();
    are_the_rows(&sweep);
    // Of runs that do not share lanes too, by whatever method.
    let methods =
        Sweep::new(run, axes(&["method=lsoda,radau5,layered", "params.alpha=0.11,0.12"]), None)
            .unwrap();
    are_the_rows(&methods);
    let groups = Exponents::default();
    let mut words = Vec::new();
    let mut take = |row: Row| {
        words.push(row.outcome().to_owned());
        true
    };
    methods.rows_together(&[0, 1, 2, 3, 4, 5], &groups, &mut take).unwrap();
    assert!(
        words.iter().filter(|word| ["irregular", "undecided"].contains(&word.as_str())).count()
            >= 3,
        "{words:?}"
    );
    assert_eq!(
        groups.0.into_inner(),
        u64::from(InstructionSet::best() != InstructionSet::Portable)
    );
    // A request to stop while they are computed gives no rows; a receiver that wants one row gets
    // one.
    let numbers = [0, 1, 2];
    let mut none = |row: Row| panic!("row {}", row.number());
    let stopped = sweep.rows_together(&numbers, &NoExponents, &mut none);
    let lanes = InstructionSet::best() != InstructionSet::Portable;
    assert!(!lanes || stopped == Err(JobError::Interrupted), "{stopped:?}");
    let mut words = Vec::new();
    let enough = sweep.rows_together(&numbers, &(), &mut |row| {
        words.push(row.outcome().to_owned());
        false
    });
    assert_eq!(enough, Ok(()));
    assert!(words == ["irregular"] || words == ["undecided"], "{words:?}");
}

/// Counts how often exponents are computed side by side.
#[derive(Default)]
struct Exponents(AtomicU64);
impl Progress for Exponents {
    fn begin<'a>(&'a self, label: &str, _: f64) -> Box<dyn JobMonitor + 'a> {
        self.0.fetch_add(u64::from(label == "exponents side by side"), Ordering::Relaxed);
        Box::new(())
    }
}

/// Stops exponents.
struct NoExponents;
impl Progress for NoExponents {
    fn begin<'a>(&'a self, label: &str, _: f64) -> Box<dyn JobMonitor + 'a> {
        if label.contains("exponent") { Box::new(Never) } else { Box::new(()) }
    }
}
struct Never;
impl Monitor for Never {
    fn reached(&self, _: f64) -> ControlFlow<()> {
        ControlFlow::Break(())
    }
}
impl JobMonitor for Never {
    fn done(self: Box<Self>, _: &str) {}
}

/// Stops after so many questions.
struct Refuses(AtomicU64);
impl Monitor for &Refuses {
    fn reached(&self, _: f64) -> ControlFlow<()> {
        if self
            .0
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| Some(n.saturating_sub(1)))
            .is_ok_and(|n| n > 1)
        {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    }
}
impl JobMonitor for &Refuses {
    fn done(self: Box<Self>, _: &str) {}
}
impl Progress for Refuses {
    fn begin<'a>(&'a self, _: &str, _: f64) -> Box<dyn JobMonitor + 'a> {
        Box::new(self)
    }
}

#[test]
fn who_asks_to_stop_gets_the_finished_rows() {
    let sweep =
        Sweep::new(run(caricature(), 4000.0), axes(&["shift.x=1e-9*8", "t-end=10,4000"]), None)
            .unwrap();
    let numbers: Vec<u64> = (0..sweep.rows()).collect();
    let mut taken = Vec::new();
    let stopped = sweep.rows_together(&numbers, &Refuses(AtomicU64::new(2)), &mut |row| {
        taken.push(row.number());
        true
    });
    assert_eq!(stopped, Err(JobError::Interrupted));
    assert!(taken.len() < numbers.len(), "{taken:?}");
    // A receiver that wants no more rows gets no more, without an error.
    let mut count = 0;
    let enough = sweep.rows_together(&numbers, &(), &mut |_| {
        count += 1;
        count < 2
    });
    assert_eq!((enough, count), (Ok(()), 2));
}
