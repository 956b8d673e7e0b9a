//! Runs of a delayed switch beside smoothed and hysteretic ones, compared by the rules of sentence
//! 4.8 (papers/jeffrey-2013/sentences.toml): the data of papers/jeffrey-2013/code/delay.
//!
//! `make delay-data`: late sections go to a journal first, target/delay-sections-*.jsonl, and a
//! call of the same version goes on with it.

use std::collections::BTreeMap;
use std::error::Error;
use std::fs::{OpenOptions, read_to_string};
use std::io::Write;

use nalgebra::{SVector, Vector3, Vector4};
use serde_json::{Value, json};
use twofold::analyse::attractor::{Question, SectionPoint, Thresholds, classify};
use twofold::analyse::{Crossing, Direction};
use twofold::integrate::delay::{Delayed, History, LateSwitch, Own, Sides};
use twofold::integrate::roots::CrossingFinder;
use twofold::integrate::{Dopri5, Failure, Method, Schedule, Stepper, Tolerance, WithStepper};
use twofold::jeffrey_2013::Reading;
use twofold::jeffrey_2013::study::claims::{Similarity, claims};
use twofold::jeffrey_2013::study::similarity::{RULES, Rule};
use twofold::job::question::NUMERICS;
use twofold::job::recording::Data;
use twofold::job::simulate::simulate;
use twofold::job::spec::{MethodSpec, Observation, RunSpec, SwitchSpec};
use twofold::num::elementary::sqrt;
use twofold::num::random::RandomStream;
use twofold::record::Hash;
use twofold::system::{
    Caricature, Hysteretic, Relaxation, Smoothed, System, Transition, VectorField,
};

/// Of all rules.
const EPS: f64 = 1e-3;
/// eps'/eps.
const RELAXATION: f64 = 10.0;
/// Local error of passages.
const TOLERANCE: Tolerance = Tolerance { rtol: 1e-10, atol: 1e-12 };
/// A passage ends by this time.
const BY: f64 = 60.0;
/// Points of a section that the figure shows, at most.
const SHOWN: usize = 1500;

fn delay(rule: Rule) -> Option<f64> {
    match rule {
        Rule::Delayed => Some(EPS),
        Rule::DelayedLong => Some(RELAXATION * EPS),
        _ => None,
    }
}

fn relaxation(rule: Rule) -> Option<Relaxation> {
    match rule {
        Rule::Literal => Some(Relaxation::Literal),
        Rule::Single => Some(Relaxation::Single),
        _ => None,
    }
}

/// The inner scale of (y, z).
fn scale(rule: Rule) -> f64 {
    match rule {
        Rule::Smoothed | Rule::Literal => sqrt(EPS),
        Rule::Single => sqrt(RELAXATION * EPS),
        Rule::Delayed | Rule::DelayedLong => delay(rule).unwrap_or(f64::NAN),
    }
}

/// The run of fig. 9(i) under another rule.
pub fn run(reading: Reading, rule: Rule, shift: [f64; 3], t_end: f64) -> RunSpec {
    let (switch, method) = match (delay(rule), relaxation(rule)) {
        (Some(delay), _) => (SwitchSpec::delayed(delay), Method::Taylor),
        (None, Some(relaxation)) => (SwitchSpec::hysteretic(EPS, relaxation), Method::Lsoda),
        (None, None) => (SwitchSpec::tanh(EPS), Method::Lsoda),
    };
    RunSpec {
        system: reading.caricature().into(),
        switch,
        start: vec![0.2 + shift[0], shift[1], -1.0 + shift[2]],
        t_end,
        method: MethodSpec::ndsolve_defaults(method),
        schedule: Schedule { restart_every: Some(100.0), kick: None },
        observe: Observation::Section { coordinate: 1, value: 0.0 },
    }
}

/// The shift of a run's start: none of the first one's.
pub fn shift(run: u64) -> [f64; 3] {
    let rules = claims();
    let mut random = RandomStream::new(rules.similarity.seed, run);
    let mut draw = || random.uniform_in(-rules.rules.shift, rules.rules.shift);
    if run == 0 { [0.0; 3] } else { [draw(), draw(), draw()] }
}

/// The attractor that has captured the run by the time from which its section is shown, and when.
pub fn settles(crossings: &[Crossing], t_end: f64) -> (String, f64) {
    let point = |c: &Crossing| SectionPoint {
        t: c.t,
        u: [c.x[0], c.x[2]],
        upward: c.direction == Direction::Up,
    };
    let section: Vec<SectionPoint> = crossings.iter().map(point).collect();
    let shown_from = claims().similarity.shown_from;
    let question = Question { t_end: Some(t_end), shown_from, ..Question::default() };
    let evidence = classify(&section, &question, &Thresholds::default());
    match evidence.verdict.cycle() {
        Some(cycle) if cycle.captured_at <= shown_from => {
            (format!("period-{}", cycle.period), cycle.captured_at)
        }
        Some(cycle) => ("nothing".into(), cycle.captured_at),
        None => ("nothing".into(), f64::NAN),
    }
}

/// The late section's points, counted by cells.
fn cells(
    crossings: &[Crossing],
    window: f64,
    Similarity { cells, .. }: &Similarity,
) -> BTreeMap<usize, u64> {
    let mut counts = BTreeMap::new();
    for c in crossings.iter().filter(|c| c.t >= claims().similarity.shown_from) {
        let place = |u: f64| (0.5 * (u / window + 1.0) * *cells as f64).floor();
        let (i, k) = (place(c.x[0]), place(c.x[2]));
        let inside = |i: f64| i >= 0.0 && i < *cells as f64;
        let cell =
            if inside(i) && inside(k) { i as usize * cells + k as usize } else { cells * cells };
        *counts.entry(cell).or_insert(0) += 1;
    }
    counts
}

/// The crossings of a run's section.
///
/// # Errors
///
/// If it cannot be followed.
pub fn followed(run: &RunSpec) -> Result<Vec<Crossing>, Box<dyn Error>> {
    match simulate(run, &())?.data {
        Data::Section(crossings) => Ok(crossings),
        _ => Err("no section".into()),
    }
}

/// The late section that figure 9(i) would show under another rule, as the figure shows it: every
/// so manyth point, an odd number because crossings of two senses alternate.
fn show(reading: Reading, rule: Rule, out: &mut dyn Write) -> Result<(), Box<dyn Error>> {
    let rules = claims().rules;
    let crossings = followed(&run(reading, rule, [0.0; 3], rules.end))?;
    let late: Vec<_> = crossings.iter().filter(|c| c.t >= rules.shown_from).collect();
    for c in late.iter().step_by(late.len().div_ceil(SHOWN) | 1) {
        writeln!(out, "{},{},{:.4},{:.4}", reading.word(), rule.name(), c.x[0], c.x[2])?;
    }
    Ok(())
}

/// A section's journal line.
fn section(reading: Reading, rule: Rule, number: u64) -> Result<Value, Box<dyn Error>> {
    let rules = claims();
    let window = match reading {
        Reading::Printed => rules.similarity.window.printed,
        Reading::Reconstructed => rules.similarity.window.reconstructed,
    };
    let crossings = followed(&run(reading, rule, shift(number), rules.similarity.end))?;
    let (outcome, captured_at) = settles(&crossings, rules.similarity.end);
    let cells: Vec<_> = cells(&crossings, window, &rules.similarity).into_iter().collect();
    let (reading, rule) = (reading.word(), rule.name());
    Ok(json!({ "reading": reading, "rule": rule, "run": number, "outcome": outcome,
            "captured_at": captured_at, "cells": cells }))
}

/// Lengths of chatter, and the exit: its distance from the two-fold, negative if x falls there.
#[derive(Clone, Debug, Default)]
pub struct Passed {
    lengths: Vec<f64>,
    exits: Vec<f64>,
}

impl Passed {
    /// Follows one orbit from attracting sliding to its exit.
    fn follow<F: VectorField<N>, M: Stepper<N>, const N: usize>(
        &mut self,
        field: &F,
        stepper: &mut M,
        start: SVector<f64, N>,
        beyond: f64,
    ) -> Result<(), Failure> {
        stepper.restart(field, 0.0, start, BY, f64::INFINITY)?;
        let (mut passages, mut last, mut passed) = (CrossingFinder::default(), None, false);
        loop {
            let step = stepper.step(field)?;
            let (t1, x1) = (step.t1, step.x1);
            for passage in passages.through_plane(&step, 0, 0.0) {
                let (t, x) = (step.time(passage.theta), step.at(passage.theta));
                let distance = sqrt(x[1] * x[1] + x[2] * x[2]);
                if passed && distance > beyond {
                    self.exits.push(if passage.upward { distance } else { -distance });
                    return Ok(());
                }
                if !passed {
                    self.lengths.extend(last.map(|last| t - last));
                    last = Some(t);
                }
            }
            passed |= x1[1] + x1[2] < 0.0;
            if t1 >= BY {
                return Ok(());
            }
        }
    }
}

struct Late<'a>(&'a mut Passed, SVector<f64, 3>, f64);

impl WithStepper<3> for Late<'_> {
    type Answer = Result<(), Failure>;
    fn with<M: Stepper<3>>(self, mut stepper: M) -> Self::Answer {
        self.0.follow(&Own, &mut stepper, self.1, self.2)
    }
}

/// A run of passages.
fn passages(reading: Reading, rule: Rule, number: u64) -> Result<Passed, Box<dyn Error>> {
    let Similarity { inside: [low, high], passages, seed, beyond, .. } = claims().similarity;
    // Streams of their own for each rule: runs of two rules are independent, too.
    let mut random = RandomStream::new(seed, 1000 * (1 + rule as u64) + number);
    let (caricature, data): (Caricature, System) =
        (reading.caricature(), reading.caricature().into());
    let mut passed = Passed::default();
    for _ in 0..passages {
        let x0 = Vector3::new(0.0, random.uniform_in(low, high), random.uniform_in(low, high));
        let beyond = beyond * scale(rule);
        match (delay(rule), relaxation(rule)) {
            (Some(delay), _) => {
                let switch =
                    LateSwitch::Delayed { delay, smooth: None, history: History::Constant };
                let delayed = Delayed { sides: Sides::new(&caricature, &data), switch, x0 };
                delayed.with_stepper(
                    Method::Taylor,
                    None,
                    TOLERANCE,
                    Late(&mut passed, x0, beyond),
                )??;
            }
            (None, Some(relaxation)) => {
                let (system, eps, eps_prime) = (caricature, EPS, RELAXATION * EPS);
                let field = Hysteretic { system, eps, eps_prime, relaxation };
                let start = Vector4::new(x0[0], x0[1], x0[2], 1.0);
                passed.follow(&field, &mut Dopri5::new(TOLERANCE), start, beyond)?;
            }
            (None, None) => {
                let field = Smoothed { system: caricature, transition: Transition::Tanh, eps: EPS };
                passed.follow(&field, &mut Dopri5::new(TOLERANCE), x0, beyond)?;
            }
        }
    }
    Ok(passed)
}

fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values
}

/// In units of the median of all sizes.
fn scaled(runs: &mut [Vec<f64>]) {
    let sizes = sorted(runs.iter().flatten().map(|v| v.abs()));
    let Some(median) = sizes.get(sizes.len() / 2).copied() else { return };
    for run in runs {
        run.iter_mut().for_each(|v| *v /= median);
        *run = sorted(run.drain(..));
    }
}

/// The largest distance of two distribution functions: of a run's values and of a pool's, less
/// `own` values of it if the run is part of the pool.
fn kolmogorov_smirnov(run: &[f64], pool: &[f64], own: bool) -> f64 {
    let rest = pool.len() - if own { run.len() } else { 0 };
    let share = |value: f64, equal: bool| {
        let below = |of: &[f64]| of.partition_point(|v| *v < value || (equal && *v == value));
        let mine = below(run);
        (
            mine as f64 / run.len() as f64,
            (below(pool) - if own { mine } else { 0 }) as f64 / rest as f64,
        )
    };
    let gap = |value: f64, equal: bool| {
        let (a, b) = share(value, equal);
        (a - b).abs()
    };
    // Between jumps of the run the pool's function is monotonic: the largest distance is at one of
    // them.
    run.iter().fold(0.0, |most: f64, v| most.max(gap(*v, true)).max(gap(*v, false)))
}

/// Half the sum of differences of shares.
fn total_variation(run: &BTreeMap<usize, u64>, pool: &BTreeMap<usize, u64>, own: bool) -> f64 {
    let all = |of: &BTreeMap<usize, u64>| of.values().sum::<u64>();
    let rest = |cell: &usize| {
        let count = pool.get(cell).copied().unwrap_or(0);
        count - if own { run.get(cell).copied().unwrap_or(0) } else { 0 }
    };
    let (mine, others) = (all(run) as f64, (all(pool) - if own { all(run) } else { 0 }) as f64);
    let cells: std::collections::BTreeSet<&usize> = run.keys().chain(pool.keys()).collect();
    let gap = |cell: &usize| {
        (run.get(cell).copied().unwrap_or(0) as f64 / mine - rest(cell) as f64 / others).abs()
    };
    0.5 * cells.into_iter().map(gap).sum::<f64>()
}

/// The runs of a rule in a reading.
struct Runs {
    outcome: Vec<String>,
    captured_at: Vec<f64>,
    cells: Vec<BTreeMap<usize, u64>>,
    lengths: Vec<Vec<f64>>,
    exits: Vec<Vec<f64>>,
}

impl Runs {
    fn pooled(&self) -> (BTreeMap<usize, u64>, Vec<f64>, Vec<f64>) {
        let mut cells = BTreeMap::new();
        for (cell, n) in self.cells.iter().flatten() {
            *cells.entry(*cell).or_insert(0) += n;
        }
        (
            cells,
            sorted(self.lengths.iter().flatten().copied()),
            sorted(self.exits.iter().flatten().copied()),
        )
    }

    fn has_chatter(&self) -> bool {
        let fewest = claims().similarity.fewest;
        self.lengths.iter().all(|lengths| lengths.len() >= fewest)
    }
}

/// The journal of the runs that this version of the program makes by these rules.
fn journal() -> String {
    let rules = format!("{:?} {:?}", claims().rules, claims().similarity);
    let version: String =
        Hash::of(format!("{NUMERICS} {rules} {}", include_str!("delay_runs.rs")).as_bytes()).into();
    format!("target/delay-sections-{}.jsonl", &version[..12])
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = std::io::stdout().lock();
    if std::env::args().nth(1).as_deref() == Some("sections") {
        writeln!(out, "reading,rule,x,z")?;
        for reading in Reading::ALL {
            for rule in [Rule::Literal, Rule::Delayed] {
                show(reading, rule, &mut out)?;
            }
        }
        return Ok(());
    }
    let journal = journal();
    let Similarity { runs, .. } = claims().similarity;
    let known: Vec<Value> = match read_to_string(&journal) {
        // Without a line that a stopped call has not finished.
        Ok(text) => text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect(),
        Err(_) => Vec::new(),
    };
    let find = |all: &[Value], reading: Reading, rule: Rule, run: u64| {
        let is_it = |v: &&Value| {
            v["reading"] == reading.word() && v["rule"] == rule.name() && v["run"] == run
        };
        all.iter().find(is_it).cloned()
    };
    let mut writer = OpenOptions::new().create(true).append(true).open(&journal)?;
    let mut all = known;
    for number in 0..runs {
        for reading in Reading::ALL {
            for rule in RULES {
                if find(&all, reading, rule, number).is_none() {
                    let line = section(reading, rule, number)?;
                    writer.write_all(format!("{line}\n").as_bytes())?;
                    all.push(line);
                }
            }
        }
    }
    writeln!(out, "{}", twofold::jeffrey_2013::study::similarity::HEADER)?;
    for reading in Reading::ALL {
        let mut of = Vec::new();
        for rule in RULES {
            let lines: Vec<Value> =
                (0..runs).filter_map(|run| find(&all, reading, rule, run)).collect();
            let passed =
                (0..runs).map(|run| passages(reading, rule, run)).collect::<Result<Vec<_>, _>>()?;
            let mut found = Runs {
                outcome: lines
                    .iter()
                    .map(|v| v["outcome"].as_str().unwrap_or_default().to_owned())
                    .collect(),
                captured_at: lines
                    .iter()
                    .map(|v| v["captured_at"].as_f64().unwrap_or(f64::NAN))
                    .collect(),
                cells: lines
                    .iter()
                    .map(|v| {
                        serde_json::from_value::<Vec<(usize, u64)>>(v["cells"].clone())
                            .map(|c| c.into_iter().collect())
                    })
                    .collect::<Result<_, _>>()?,
                lengths: passed.iter().map(|p| p.lengths.clone()).collect(),
                exits: passed.into_iter().map(|p| p.exits).collect(),
            };
            scaled(&mut found.lengths);
            scaled(&mut found.exits);
            of.push((rule, found));
        }
        let pools: Vec<_> = of.iter().map(|(_, runs)| runs.pooled()).collect();
        for (i, (rule, mine)) in of.iter().enumerate() {
            for number in 0..mine.outcome.len() {
                let captured = mine.captured_at[number];
                let mut row = format!(
                    "{},{},{number},{},{captured:.1}",
                    reading.word(),
                    rule.name(),
                    mine.outcome[number]
                );
                let mut distances = [const { String::new() }; 4];
                for (k, (_, others)) in of.iter().enumerate().take(3) {
                    let (own, (cells, lengths, exits)) = (i == k, &pools[k]);
                    let same =
                        others.outcome.iter().filter(|o| **o == mine.outcome[number]).count();
                    let own_count = usize::from(own);
                    let settles =
                        1.0 - (same - own_count) as f64 / (others.outcome.len() - own_count) as f64;
                    let occupancy = total_variation(&mine.cells[number], cells, own);
                    let chatter = if own || (mine.has_chatter() && others.has_chatter()) {
                        if mine.lengths[number].is_empty() {
                            0.0
                        } else {
                            kolmogorov_smirnov(&mine.lengths[number], lengths, own)
                        }
                    } else {
                        1.0
                    };
                    let exits = kolmogorov_smirnov(&mine.exits[number], exits, own);
                    for (text, distance) in
                        distances.iter_mut().zip([settles, occupancy, chatter, exits])
                    {
                        text.push_str(&format!(",{distance:.4}"));
                    }
                }
                row.extend(distances);
                writeln!(out, "{row}")?;
            }
        }
    }
    Ok(())
}
