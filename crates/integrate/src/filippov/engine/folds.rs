//! Motion at a two-fold, and at two folds in one place.

use super::*;

impl<P: PiecewiseSmooth<N>, const N: usize> Engine<'_, P, N> {
    /// Two folds in one place at the present state, if both Lie derivatives are almost zero there.
    pub(super) fn fused_here(&self, l: &Lie) -> Option<FusedFolds<N>> {
        let near = LIMITS.near_two_fold * l.zero_p.max(l.zero_q);
        if !(l.p.abs() <= near && l.q.abs() <= near) {
            return None;
        }
        // Both fields cross in one direction: no fold, however small a focus has become.
        if l.p * l.q > 0.0 && l.p.abs() > l.zero_p && l.q.abs() > l.zero_q {
            return None;
        }
        let system = self.sided();
        let folds = FusedFolds::at(&system, &self.x).filter(FusedFolds::leave)?;
        let Some(velocity) = folds.velocity else { return Some(folds) };
        // At a kink the motion before and the motion behind are not those of one fold.
        let moved = velocity * self.departure(l, &folds);
        let [before, behind] =
            [self.x - moved, self.x + moved].map(|x| FusedFolds::at(&system, &x));
        let smooth = (before?.rate - behind?.rate).abs() <= LIMITS.kink * folds.rate.abs();
        smooth.then_some(folds)
    }

    /// The time of the first step of sliding out of two folds in one place.
    fn departure(&self, l: &Lie, folds: &FusedFolds<N>) -> f64 {
        LIMITS.departure * l.zero_p.max(l.zero_q) / LIMITS.lie / folds.rate.abs()
    }

    pub(super) fn meet(&mut self, folds: FusedFolds<N>, from: Option<Mode>) -> State<N> {
        self.event(EventKind::TwoFoldReached { leg: 0.0, error: 0.0 }, from, None);
        State::Fused(Box::new(folds))
    }

    /// Rest on the surface until the end.
    pub(super) fn rest(&mut self) -> State<N> {
        self.take(Mode::SlidingAttracting, self.t_end, self.x, &ConstantState(self.x));
        State::Rest
    }

    /// The future at two folds in one place.
    pub(super) fn pass(&mut self, folds: &FusedFolds<N>) -> Result<State<N>, FilippovError> {
        self.accumulation = Accumulation::default();
        let growth = |side: Side| match side {
            Side::Plus => folds.second[0],
            Side::Minus => -folds.second[1],
        };
        let visible = |side: &Side| growth(*side) > 0.0;
        let flights: Vec<Side> = [Side::Plus, Side::Minus].into_iter().filter(visible).collect();
        let repelling = folds.rate > 0.0;
        let leave = |engine: &mut Self, to: Side, kind: EventKind| {
            engine.event(kind, None, Some(to.into()));
            Ok(State::Free { side: to, start: FlightStart::Tangent(growth(to)) })
        };
        let plan = match (folds.velocity, flights.as_slice()) {
            (Some(_), []) if !repelling => None,
            (None, [only]) => return leave(self, *only, EventKind::LeftByTangency { to: *only }),
            _ if self.chooser.rule == ExitRule::Undecided => {
                let slides = folds
                    .velocity
                    .map(|_| if repelling { REPELLING } else { "attracting sliding" });
                let ways =
                    slides.map(str::to_owned).into_iter().chain(flights.into_iter().map(flight));
                let what = if [Side::Plus, Side::Minus].iter().all(visible) {
                    "the folds of both fields, both visible, lie in one place (fused folds, a \
                        two-fold with two visible sides), and the motion is there"
                } else {
                    "the folds of both fields lie in one place (fused folds), and the motion is \
                        there"
                };
                return Err(self.undecided(what, ways));
            }
            _ => match self.chooser.plan() {
                None => return Ok(State::SetValued(None)),
                plan => plan,
            },
        };
        if let Some(ExitPlan { side, at_once, .. }) = plan
            && visible(&side)
            && (at_once || folds.velocity.is_none())
        {
            return leave(
                self,
                side,
                EventKind::Exit { to: side, time: 0.0, arc: 0.0, rule: self.chooser.rule },
            );
        }
        let Some(velocity) = folds.velocity else {
            return Err(self.no_exit(
                "both folds lie in one place, no sliding leaves it, and the fold of the side asked \
                    for is invisible; ask --exit for the other side",
            ));
        };
        let mode = if repelling { Mode::SlidingRepelling } else { Mode::SlidingAttracting };
        self.event(
            if repelling { EventKind::EnteredRepelling } else { EventKind::StartedOnSurface },
            None,
            Some(mode),
        );
        let l = self.lie(&self.x);
        let t1 = (self.t + self.departure(&l, folds)).min(self.t_end);
        let (time, from) = (t1 - self.t, self.x);
        let to = project(self.system, &(from + velocity * time));
        self.take(mode, t1, to, &Straight { system: self.system, from, to });
        let arc = (to - from).norm();
        Ok(match plan {
            Some(plan) if repelling && (time >= plan.time || arc >= plan.arc) => {
                self.exit(plan.side, time, arc, Some(mode))
            }
            Some(_) if repelling => State::Sliding(Sliding { repelling, plan, time, arc }),
            _ => State::Sliding(Sliding::ATTRACTING),
        })
    }

    /// The future at a two-fold.
    pub(super) fn depart(
        &mut self,
        local: &SlidingAtTwoFold<N>,
    ) -> Result<State<N>, FilippovError> {
        self.accumulation = Accumulation::default();
        let [pp, _, _, mm] = local.second;
        let growth = |side: Side| match side {
            Side::Plus => pp,
            Side::Minus => -mm,
        };
        if self.chooser.rule == ExitRule::Undecided {
            let sides = [Side::Plus, Side::Minus]
                .into_iter()
                .filter(|side| growth(*side) > 0.0)
                .map(flight);
            let slides = match (&local.through, &local.back) {
                (Some(_), _) => Some(REPELLING.to_owned()),
                (None, Some(_)) => Some("attracting sliding".to_owned()),
                (None, None) => None,
            };
            return Err(self.undecided(
                "the motion is at a two-fold, where both fields are tangent to the surface",
                slides.into_iter().chain(sides),
            ));
        }
        let Some(plan) = self.chooser.plan() else {
            return Ok(State::SetValued(None));
        };
        let (side, rule) = (plan.side, self.chooser.rule);
        let curve = local.through.as_ref().or(local.back.as_ref());
        let tangent = growth(side) > 0.0;
        if tangent && (plan.at_once || curve.is_none()) {
            self.event(
                EventKind::Exit { to: side, time: 0.0, arc: 0.0, rule },
                None,
                Some(side.into()),
            );
            return Ok(State::Free { side, start: FlightStart::Tangent(growth(side)) });
        }
        let Some(curve) = curve else {
            return Err(self.no_exit(
                "no sliding motion leaves this two-fold and the fold of the side asked for is \
                    invisible; ask for the other side",
            ));
        };
        let Some(limit) = local.departure_limit(self.system, curve) else {
            return Err(self.non_transversal("the sliding direction at the two-fold is degenerate"));
        };
        let repelling = curve.rate < 0.0;
        let mode = if repelling { Mode::SlidingRepelling } else { Mode::SlidingAttracting };
        self.event(
            if repelling { EventKind::EnteredRepelling } else { EventKind::StartedOnSurface },
            None,
            Some(mode),
        );
        let sign = curve.rate.signum();
        let longest = curve.time(sign * limit);
        let shortest = curve.time(sign * self.settings.departure * limit.min(local.radius));
        // Arc along the curve up to a time, by chords.
        let arc_until = |t: f64| {
            let (end, mut last, mut arc) = (curve.sigma(t, limit), local.point, 0.0);
            for k in 1..=LIMITS.departure_chords {
                let point = curve.at(end * k as f64 / LIMITS.departure_chords as f64);
                arc += (point - last).norm();
                last = point;
            }
            arc
        };
        let mut planned = plan.time;
        if plan.arc.is_finite() {
            let excess = |t: f64| arc_until(t) - plan.arc;
            let last = excess(longest);
            planned = if last < 0.0 {
                f64::INFINITY
            } else {
                brent(excess, 0.0, longest, -plan.arc.max(1e-300), last)
            };
        }
        let planned = match (repelling, planned > 0.0) {
            (false, _) => f64::INFINITY,
            (true, false) => shortest,
            (true, true) => planned.max(LIMITS.shortest_departure * shortest),
        };
        let duration = planned.min(longest);
        let whole = AlongCurve { curve, from: 0.0, to: duration, limit };
        if self.t + duration > self.t_end {
            let end = (self.t_end - self.t) / duration;
            let x1 = project(self.system, &whole.at(end));
            self.take(mode, self.t_end, x1, &Truncated { inner: &whole, end });
            return Ok(State::Sliding(Sliding {
                repelling,
                plan: repelling.then_some(plan),
                time: 0.0,
                arc: 0.0,
            }));
        }
        let x1 = project(self.system, &whole.at(1.0));
        self.take(mode, self.t + duration, x1, &whole);
        let arc = arc_until(duration);
        if repelling && planned <= longest {
            return Ok(self.exit(side, duration, arc, Some(mode)));
        }
        Ok(State::Sliding(if repelling {
            Sliding { repelling, plan: Some(plan), time: duration, arc }
        } else {
            Sliding::ATTRACTING
        }))
    }
}
