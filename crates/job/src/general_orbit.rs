//! Closed orbits of general systems, and how they change with a parameter.

use serde_json::{Value, json};
use twofold_analyse::branch::{self, BranchOptions, End, Newton, Orbit, ReturnMap, Trouble};
use twofold_analyse::floquet::Returned;
use twofold_hybrid::equation::EquationError;
use twofold_hybrid::motion::tangent::{Return, closed_orbit, once_around};
use twofold_hybrid::motion::{Outcome, Record, follow_to_rest, starts_on_an_event};
use twofold_hybrid::rests::rests;
use twofold_hybrid::{Ending, HybridError, Model, Options, follow};
use twofold_integrate::Monitor;

use super::answer::{Answer, Stop};
use super::general::{GeneralRun, has_period, start_of};
use super::orbit::{Along, CLOSED, ITERATIONS, LEAST_CLOSED, ROUGHLY, at_rest, branch_tables};
use super::question::{Ask, JobError, Question};
use super::rest::{Rest, RestKind, Stability};

/// A closed orbit of a general system, by Newton's method once the motion has settled, and its
/// branch along a parameter if one is named.
#[derive(Clone, Debug)]
pub struct GeneralOrbit {
    /// System, start and method; `options.t_end` is the longest time of a return.
    pub run: GeneralRun,
    /// Time in which the motion settles first; whole periods of a drive.
    pub settle: f64,
    /// Return after which an orbit closes: crossings of a section, or a period.
    pub after: Return,
    /// The parameter to follow it along.
    pub along: Option<Along>,
}

/// States that have settled at less than this share of their sizes at the start are at zero.
const ROUNDED: f64 = 1e-6;

/// An orbit farther from where the motion settled than this share of a state may be another one.
const ANOTHER: f64 = 0.05;

/// A return may take so many times the steps of the first orbit of a branch, or of this number.
const LONGEST: u64 = 100;
const LEAST_STEPS: u64 = 1000;

/// Points of a map are of this size at least, in their units.
const LEAST_SIZE: f64 = 1e-2;

/// A settling that ends on an event is repeated so many times, by this share longer each time.
const LONGER: u32 = 8;
const LONGER_BY: f64 = 1.0 / 128.0;

impl Question for GeneralOrbit {
    fn kind(&self) -> &'static str {
        "general-orbit"
    }

    fn json(&self) -> Value {
        let mut json = self.run.json();
        json["settle"] = self.settle.into();
        json["closes"] = match self.after {
            Return::Period(period) => json!({ "period": period }),
            Return::Crossings(count) => json!({ "crossings": count }),
        };
        if let Some(along) = &self.along {
            json["along"] = json!(along);
        }
        json
    }

    fn label(&self) -> String {
        "closed orbit".into()
    }

    fn extent(&self) -> f64 {
        self.run.options.t_start + self.settle
    }

    fn cost(&self) -> f64 {
        self.settle
    }

    /// Facts where the motion comes to a rest: that of [`ClosedOrbit`](super::ClosedOrbit). Else
    /// `states` (their names), `point`, `period`, `multipliers` (real and imaginary parts,
    /// the largest first), `gap` (how far the orbit is from closed, relative to its largest
    /// state), of a system with modes `mode` (in which its point lies) and, from 5 % on, `moved`
    /// (how far it lies from where the motion had settled, relative to the size of a state). Of a
    /// branch also the tables `branch` and `bifurcations`
    /// and the fact `end`, as of [`ClosedOrbit`](super::ClosedOrbit).
    fn compute(&self, _: &dyn Ask, monitor: &dyn Monitor) -> Result<Answer, JobError> {
        let model = match &self.along {
            Some(along) => at(&self.run.model, along, along.from)?,
            None => self.run.model.clone(),
        };
        let mut options = self.run.options.clone();
        let began = start_of(&model, &options)?;
        // The largest size that each state has had.
        let mut sizes: Vec<f64> = began.iter().map(|x| x.abs()).collect();
        // The phase of a drive is kept: whole periods.
        let settle = match self.after {
            Return::Period(period) => (self.settle / period).ceil() * period,
            Return::Crossings(_) => self.settle,
        };
        if let Return::Period(period) = self.after {
            has_period(&model, &options, period, options.t_start)?;
            if let Some(along) = &self.along {
                self.keeps_period(along, period)?;
            }
            options.t_end = options.t_start + period;
        }
        if settle > 0.0 {
            let begin = options.clone();
            let (mut settled, rest, unknown) =
                self.rest_after(&model, &begin, (settle, STILL), monitor)?;
            if let Some(rest) = rest {
                return Ok(at_rest(&model.coordinates(), &rest));
            }
            if let Some(end) = settled.as_ref().filter(|_| unknown) {
                return Err(HybridError::NoOrbit(format!(
                    "the motion comes to rest at {:?} (it moves by less than {STILL:e} of its size \
                        in {} of time) and closes no orbit; no rest with eigenvalues is known \
                        there",
                    end.x,
                    STAYS * settle
                ))
                .into());
            }
            for times in 0..=LONGER {
                let longer = 1.0 + f64::from(times) * LONGER_BY;
                let settling = Options {
                    t_end: begin.t_start + settle * longer,
                    record: Record::Times { every: f64::INFINITY },
                    ..begin.clone()
                };
                let end = match settled.take() {
                    Some(end) => end,
                    None => follow(&model, &settling, &mut |point| {
                        monitor.reached(point.t).is_continue()
                    })?,
                };
                if end.ending == Ending::Interrupted {
                    return Err(JobError::Interrupted);
                }
                (options.start, options.mode, sizes) = (Some(end.x), end.mode, end.sizes);
                // An event that would come at the very end would be lost.
                let whole = matches!(self.after, Return::Period(_));
                if whole || !starts_on_an_event(&model, &options)? {
                    break;
                }
            }
        }
        let strobe = match self.after {
            Return::Period(period) => Strobe::new(&model, &mut options, period)?,
            Return::Crossings(_) => None,
        };
        let former = began.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let mut found = match closed_orbit(&model, &options, &self.after, former) {
            Err(HybridError::NoOrbit(why)) => {
                // The motion may rest after a longer time.
                let longest = options.t_end - options.t_start;
                return match self.rest_after(&model, &options, (longest, COMES), monitor)?.1 {
                    Some(rest) => Ok(at_rest(&model.coordinates(), &rest)),
                    None => Err(HybridError::NoOrbit(why).into()),
                };
            }
            other => other?,
        };
        let found_here = found.x.clone();
        if found.is_point && matches!(self.after, Return::Crossings(_)) {
            let options = Options { start: Some(found.x), mode: found.mode, ..options };
            let rest = rest_near(&model, &options)?;
            return rest.map(|rest| at_rest(&model.coordinates(), &rest)).ok_or_else(|| {
                let why = "the search came to a point where nothing turns, and no rest is known \
                    there: start farther from it (--start), or give another section (--section)";
                HybridError::NoOrbit(why.into()).into()
            });
        }
        let mut mode = found.mode;
        if let Some(strobe) = &strobe {
            let from = Options { start: Some(found.x), mode, ..options.clone() };
            let reached = part(&model, &from, strobe.left)?;
            (found.x, mode) = (reached.x, reached.mode);
        }
        let mut answer = Answer::of_tables(Vec::new())
            .with_fact("states", &model.coordinates())
            .with_fact("point", &found.x)
            .with_fact("period", &found.period)
            .with_fact("multipliers", &found.multipliers)
            .with_fact("gap", &found.gap);
        let modes = model.definition().modes();
        if modes.len() > 1 {
            answer = answer.with_fact("mode", &modes[mode].name);
        }
        if found.moved > ANOTHER {
            answer = answer.with_fact("moved", &found.moved);
        }
        if found.multiplier_error > 0.0 {
            answer = answer.with_fact("multiplier_error", &found.multiplier_error);
        }
        let Some(along) = &self.along else { return Ok(answer) };
        at(&model, along, along.to)?;
        options.mode = found.mode;
        // Newton's method may come to states from which there is no return, or one of days.
        let usual = once_around(&model, &options, &self.after, &found_here)?;
        options.max_steps = options.max_steps.min(LONGEST * usual.steps.max(LEAST_STEPS));
        let units = units(&usual.bounds, &sizes);
        let map = Map { model: &model, options, after: &self.after, along, units };
        let rtol = self.run.options.rtol;
        let least = map.units.iter().copied().fold(f64::INFINITY, f64::min);
        let newton = Newton {
            closed: (CLOSED * rtol).max(LEAST_CLOSED),
            atol: self.run.options.atol.unwrap_or(0.0) / least,
            rtol,
            iterations: ITERATIONS,
        };
        let size = if map.has_points() { 1.0 } else { 0.0 };
        let guess = map.measured(&found_here);
        let first = branch::closed_orbit(&map, &guess, along.from, newton)
            .map_err(|trouble| HybridError::NoOrbit(trouble.said))?;
        let width = (along.to - along.from).abs();
        let branch_options = BranchOptions {
            from: along.from,
            to: along.to,
            longest: 1.0 / along.steps as f64,
            most: along.most,
            size,
            newton,
        };
        let mut go_on = |orbit: &Orbit| {
            monitor.reached(((orbit.parameter - along.from) / width).abs().min(1.0)).is_continue()
        };
        let mut found = branch::follow(&map, first, &branch_options, &mut go_on);
        if found.end == End::Interrupted {
            answer.stop = Stop::Interrupted;
        }
        for orbit in &mut found.orbits {
            orbit.point = map.state(&orbit.point);
            if let Some(strobe) = &strobe {
                let model = at(&model, along, orbit.parameter)?;
                let from = Options { start: Some(orbit.point.clone()), ..map.options.clone() };
                orbit.point = part(&model, &from, strobe.left)?.x;
            }
            if let Return::Crossings(_) = self.after {
                // The one along the field is none of the orbit's.
                orbit.multipliers.pop();
            }
        }
        answer.tables.extend(branch_tables(&along.parameter, &model.coordinates(), &found));
        Ok(answer.with_fact("end", &found.end))
    }
}

impl GeneralOrbit {
    /// Refuses a parameter that changes the period of what depends on the time.
    fn keeps_period(&self, along: &Along, period: f64) -> Result<(), JobError> {
        for part in [0.382, 1.0] {
            let value = along.from + part * (along.to - along.from);
            let model = at(&self.run.model, along, value)?;
            let options = &self.run.options;
            if has_period(&model, options, period, options.t_start).is_err() {
                let name = &along.parameter;
                return Err(HybridError::Bad(format!(
                    "--along {name}: at {name} = {value} the equations are not the same {period} \
                        later, as they are at {}: measure time in periods of what depends on it \
                        (with its frequency w divide f by w and write sin(t) for sin(w*t))",
                    along.from
                ))
                .into());
            }
        }
        Ok(())
    }

    /// The motion's end after a time, and the attracting rest from which it moves no farther then
    /// than a part of its states' size, if there is one, or whether it stays where no rest is
    /// known, as at a root's zero; nothing of what is driven.
    fn rest_after(
        &self,
        model: &Model,
        from: &Options,
        (time, within): (f64, f64),
        monitor: &dyn Monitor,
    ) -> Result<(Option<Outcome>, Option<Rest>, bool), JobError> {
        if model.is_driven() {
            return Ok((None, None, false));
        }
        let options = Options {
            t_end: from.t_start + time,
            record: Record::Times { every: f64::INFINITY },
            ..from.clone()
        };
        let (end, rests) = follow_to_rest(
            model,
            &options,
            &mut |_| true,
            &|t| monitor.reached(t).is_continue(),
            STAYS * time,
            &|size| within * size,
        )?;
        if end.ending == Ending::Interrupted {
            return Err(JobError::Interrupted);
        }
        let there = Options { start: Some(end.x.clone()), mode: end.mode, ..options };
        let rest = if rests { rest_near(model, &there)? } else { None };
        let unknown = rests && rest.is_none();
        Ok((
            Some(end),
            rest.filter(|rest| matches!(rest.stability, Stability::Attracts | Stability::ToASet)),
            unknown,
        ))
    }
}

/// The unit of each state, a power of two: its size on a way with these bounds, or its largest one
/// before if it has come to zero since, to rounding. Of a state that is zero it is the largest one.
fn units(bounds: &[[f64; 2]], before: &[f64]) -> Vec<f64> {
    let size = |([low, high], before): (&[f64; 2], &f64)| {
        let now = low.abs().max(high.abs());
        if now > ROUNDED * before { now } else { *before }
    };
    let sizes: Vec<f64> = bounds.iter().zip(before).map(size).collect();
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let unit = |size: &f64| {
        let (mut unit, size) = (1.0, if *size > 0.0 { *size } else { largest });
        while size >= 2.0 * unit {
            unit *= 2.0;
        }
        while size < unit && size > 0.0 {
            unit *= 0.5;
        }
        unit
    };
    sizes.iter().map(unit).collect()
}

/// A motion rests that moves no more than this part of its states' size for this part of its run
/// longer; where no orbit is found, one that is near an attracting rest comes to it.
const STILL: f64 = 1e-6;
const STAYS: f64 = 0.05;
const COMES: f64 = 1e-2;
/// A rest is near if it is not farther away than this part of a state.
const NEAR: f64 = 1e-3;

/// The rest near the start of `options`, in its mode.
fn rest_near(model: &Model, options: &Options) -> Result<Option<Rest>, HybridError> {
    let start = options.start.clone().unwrap_or_default();
    let began = model.start().map_err(EquationError::from)?.unwrap_or_default();
    let largest = start.iter().chain(&began).fold(0.0_f64, |most, x| most.max(x.abs()));
    let width = |i: usize| {
        let size = began.get(i).map_or(0.0, |x| x.abs()).max(start[i].abs());
        NEAR * if largest == 0.0 { 1.0 } else { size.max(0.1 * largest) }
    };
    let within: Vec<(f64, f64)> =
        (0..start.len()).map(|i| (start[i] - width(i), start[i] + width(i))).collect();
    let found = rests(model, &within).unwrap_or_default().into_iter();
    let apart = |x: &[f64]| {
        let shares = x.iter().zip(&start).enumerate().map(|(i, (a, b))| (a - b).abs() / width(i));
        shares.fold(0.0, f64::max)
    };
    let nearest = found
        .filter(|rest| rest.mode == options.mode)
        .min_by(|a, b| apart(&a.x).total_cmp(&apart(&b.x)));
    Ok(nearest.map(|rest| {
        let kind = rest.kind();
        let stability = match () {
            () if kind.starts_with("stable") && rest.family.is_some() => Stability::ToASet,
            () if kind.starts_with("stable") => Stability::Attracts,
            () if kind.starts_with("unstable") || kind.ends_with("saddle") => Stability::Repels,
            () => Stability::Neutral,
        };
        let kind =
            if rest.on.is_empty() { RestKind::Equilibrium } else { RestKind::PseudoEquilibrium };
        Rest { kind, state: rest.x, eigenvalues: rest.eigenvalues, stability }
    }))
}

/// The moment at which periods are counted, where an event comes then: what is zero at a start is
/// not met there, so that each period would lose the event. Orbits are sought a little later, and
/// followed on to this moment.
struct Strobe {
    /// Time from the later start on until the moment comes again.
    left: f64,
}

impl Strobe {
    /// Moves the start behind the event, if one is there.
    fn new(model: &Model, options: &mut Options, period: f64) -> Result<Option<Self>, HybridError> {
        for times in 0..=LONGER {
            let later = f64::from(times) * LONGER_BY * period;
            let mut moved = options.clone();
            if times > 0 {
                let end = part(model, options, later)?;
                (moved.start, moved.mode) = (Some(end.x), end.mode);
                moved.t_start += later;
            }
            if starts_on_an_event(model, &moved)? {
                continue;
            }
            if times > 0 {
                // The event that was lost at the beginning may lead to another mode.
                let end = part(model, &moved, period)?;
                (moved.start, moved.mode) = (Some(end.x), end.mode);
            }
            *options = moved;
            return Ok((times > 0).then_some(Self { left: period - later }));
        }
        Ok(None)
    }
}

/// Motion for a time, without rows.
fn part(model: &Model, options: &Options, time: f64) -> Result<Outcome, HybridError> {
    let options = Options {
        t_end: options.t_start + time,
        record: Record::Times { every: f64::INFINITY },
        ..options.clone()
    };
    follow(model, &options, &mut |_| true)
}

/// The system at a value of the parameter.
fn at(model: &Model, along: &Along, value: f64) -> Result<Model, HybridError> {
    let model =
        model.clone().with(&along.parameter, value).and_then(|model| model.values().map(|_| model));
    model.map_err(|error| HybridError::Bad(format!("--along {}: {error}", along.parameter)))
}

/// The return map. A section need be no plane of one state, and the period of a drive has none: the
/// plane that the search keeps to is that of one more state, which is zero.
struct Map<'a> {
    model: &'a Model,
    options: Options,
    after: &'a Return,
    along: &'a Along,
    /// The unit in which each state is measured.
    units: Vec<f64>,
}

impl Map<'_> {
    /// A state in its units, and the one more that is zero.
    fn measured(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.units).map(|(x, unit)| x / unit).chain([0.0]).collect()
    }

    /// The state that is so in its units.
    fn state(&self, u: &[f64]) -> Vec<f64> {
        u.iter().zip(&self.units).map(|(u, unit)| u * unit).collect()
    }

    fn tried(&self, u: &[f64], p: f64, options: &Options) -> Result<Returned, HybridError> {
        let n = u.len() - 1;
        let model = at(self.model, self.along, p)?;
        let x = self.state(u);
        let turn = once_around(&model, options, self.after, &x).map_err(|e| match e {
            HybridError::Budget { .. } => HybridError::NoOrbit(format!(
                "the motion is not back in {LONGEST} times the steps of the first orbit: it \
                    leaves, or the period grows without bound, as near a homoclinic orbit"
            )),
            other => other,
        })?;
        if turn.mode != self.options.mode {
            let mode = |mode: usize| &self.model.definition().modes()[mode].name;
            let (from, to) = (mode(self.options.mode), mode(turn.mode));
            return Err(HybridError::NoOrbit(format!(
                "the motion comes back in the mode {to} and not in {from}"
            )));
        }
        let mut derivative = vec![0.0; (n + 1) * (n + 1)];
        for (i, row) in turn.matrix.chunks(n).enumerate() {
            for (j, slope) in row.iter().enumerate() {
                derivative[i * (n + 1) + j] = slope * self.units[j] / self.units[i];
            }
        }
        let lengths = turn.bounds.iter().zip(&self.units).map(|([low, high], u)| (high - low) / u);
        let mut extent = lengths.map(|length| length * length).sum::<f64>().sqrt();
        // A point of a map has no extent: it is closed to a share of its size, or where that is
        // small, as where a border is at zero, to one of its unit.
        if self.has_points() {
            extent = u.iter().fold(extent, |most, x| most.max(x.abs()));
            extent = if extent > 0.0 { extent.max(LEAST_SIZE) } else { 1.0 };
        }
        let point = self.measured(&turn.end);
        Ok(Returned {
            same: vec![point.clone()],
            point,
            time: turn.time,
            derivative,
            opposite: Vec::new(),
            extent,
            sizes: vec![extent; n + 1],
            passes: true,
            derivative_error: 0.0,
            events: turn.itinerary,
        })
    }
}

impl ReturnMap for Map<'_> {
    fn states(&self) -> usize {
        self.model.coordinates().len() + 1
    }

    fn axis(&self) -> usize {
        self.model.coordinates().len()
    }

    fn has_points(&self) -> bool {
        matches!(self.after, Return::Period(_))
    }

    fn returned(&self, u: &[f64], p: f64, _: bool) -> Result<Returned, Trouble> {
        self.tried(u, p, &self.options).map_err(|error| error.to_string().into())
    }

    fn roughly(&self, u: &[f64], p: f64) -> Result<Returned, Trouble> {
        let Options { rtol, atol, .. } = self.options;
        let options = Options {
            rtol: ROUGHLY * rtol,
            atol: atol.map(|atol| ROUGHLY * atol),
            ..self.options.clone()
        };
        self.tried(u, p, &options).map_err(|error| error.to_string().into())
    }

    /// The nearest rest in a box around the point; the motion from it need not come back.
    fn rest(&self, u: &[f64], p: f64) -> Option<(Vec<f64>, Vec<[f64; 2]>)> {
        let model = at(self.model, self.along, p).ok()?;
        let largest = u.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let middle = self.state(u);
        let around = middle.iter().zip(&self.units).map(|(x, unit)| (x, largest * unit));
        let within: Vec<(f64, f64)> = around.map(|(x, size)| (x - size, x + size)).collect();
        let apart =
            |x: &[f64]| self.measured(x).iter().zip(u).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let found =
            rests(&model, &within).ok()?.into_iter().filter(|rest| rest.mode == self.options.mode);
        let nearest = found.min_by(|a, b| apart(&a.x).total_cmp(&apart(&b.x)))?;
        Some((self.measured(&nearest.x), nearest.eigenvalues))
    }
}

#[cfg(test)]
mod tests;
