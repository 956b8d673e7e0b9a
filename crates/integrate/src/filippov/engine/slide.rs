//! Sliding, and where it ends.

use super::*;

impl<P: PiecewiseSmooth<N>, const N: usize> Engine<'_, P, N> {
    /// Sliding until a fold, a two-fold, the planned exit or the end.
    pub(super) fn slide<const M: usize>(
        &mut self,
        sliding: Sliding,
    ) -> Result<State<N>, FilippovError>
    where
        for<'b> SlidingFlow<'b, P, N>: VectorField<M>,
    {
        if let Some(failure) = self.without_limit() {
            return Err(failure.into());
        }
        let direction = sliding.direction();
        let place = if direction > 0.0 { 2 } else { 3 };
        let gates = self.gates[place].take().unwrap_or_else(|| {
            if self.is_simple {
                return None;
            }
            let system = Sided { system: self.system, depth: None };
            let tape = VectorField::<M>::tape(&SlidingFlow { system, direction });
            Gates::of_part(Arc::new(Tape::clone(&tape).with_names(self.system.names())))
        });
        let mut method = Automatic::new(self.settings.tolerance, gates);
        let next = self.slide_by(&mut method, sliding);
        self.gates[place] = Some(method.into_gates());
        next
    }

    fn slide_by<const M: usize>(
        &mut self,
        method: &mut Automatic<M>,
        mut sliding: Sliding,
    ) -> Result<State<N>, FilippovError>
    where
        for<'b> SlidingFlow<'b, P, N>: VectorField<M>,
    {
        let system = self.system;
        let mode = sliding.mode();
        let sided = Sided { system, depth: self.depth };
        let here = self.lie(&self.x);
        let clock = Self::sliding_clock(&here);
        let flow =
            SlidingFlow { system: Sided { ..sided }, direction: sliding.direction() * clock };
        let lift =
            |x: &SVector<f64, N>| SVector::<f64, M>::from_fn(|i, _| if i < N { x[i] } else { 0.0 });
        // The clock of the flow starts at zero with each restart, so that short times keep their
        // digits.
        let mut t_base = self.t;
        let mut idle = 0;
        let mut came_from;
        let mut ahead = TwoFoldAhead::new();
        let mut along = SIDES.into_iter().find(|side| {
            let touches = || self.tangency(&here, *side).presses();
            !sliding.repelling && here.is_tangent(*side) && (self.runs_along(*side) || touches())
        });
        let mut fresh = Some(here);
        if let Err(failure) =
            method.restart(&flow, 0.0, lift(&self.x), f64::INFINITY, f64::INFINITY)
        {
            return if self.stay_inside() {
                Ok(State::Sliding(sliding))
            } else {
                Err(self.cause_on_surface().unwrap_or(failure).into())
            };
        }
        let next = loop {
            let before = method.statistics().clone();
            let step = match method.step(&flow) {
                Ok(step) => step,
                Err(Failure::NotFinite { .. } | Failure::StepUnderflow { .. })
                    if self.stay_inside() =>
                {
                    self.count(&before);
                    return Ok(State::Sliding(sliding));
                }
                Err(_) if !sliding.repelling && self.rests_here() => {
                    self.count(&before);
                    return Ok(State::Rest);
                }
                Err(failure) => {
                    let seen = || in_time::<N>(failure, t_base);
                    return Err(self.cause_on_surface().unwrap_or_else(seen).into());
                }
            };
            let end = self.sliding_end(&step, &sliding, along, (t_base, clock), fresh.take());
            let until = end.map_or(f64::INFINITY, |(theta, _)| theta);
            if let Some((theta, what)) =
                self.domain_end(&SIDES, &|theta| without_clock(&step.at(theta)))
                && theta < until
            {
                let z = step.at(theta);
                let (t, x) = ((t_base + z[N]).min(self.t_end), project(system, &without_clock(&z)));
                let interpolant = InPhysicalTime {
                    system,
                    inner: step.interpolant,
                    end: theta,
                    clock: (step.x0[N], z[N]),
                };
                self.take(mode, t, x, &interpolant);
                if !sliding.repelling && self.rests_here() {
                    self.count(&method.statistics());
                    return Ok(State::Rest);
                }
                return Err(Failure::Undefined { t, state: Failure::state(&x), what }.into());
            }
            let theta = end.map_or(1.0, |(theta, _)| theta);
            let z1 = step.at(theta);
            let x1 = project(system, &without_clock(&z1));
            let t1 = match end {
                Some((_, SlidingEnd::Time)) => self.t_end,
                _ => up_to(self.t_end, t_base + z1[N]).min(self.t_end),
            };
            sliding.time += t1 - self.t;
            if sliding.plan.is_some() {
                sliding.arc += chords::<N, M>(&step, theta).iter().sum::<f64>();
            }
            let interpolant = InPhysicalTime {
                system,
                inner: step.interpolant,
                end: theta,
                clock: (step.x0[N], z1[N]),
            };
            let off = without_clock::<N, M>(&z1);
            let drift = system.switching(&off).abs();
            idle = if t1 - self.t <= LIMITS.idle * t1.abs() { idle + 1 } else { 0 };
            came_from = self.x;
            self.take(mode, t1, x1, &interpolant);
            if let Some((_, end)) = end {
                break Some(end);
            }
            if along.is_some_and(|side| !self.is_tangent(&self.x, side)) {
                (along, fresh) = (None, Some(self.lie(&self.x)));
            }
            if idle >= LIMITS.idle_steps {
                self.count(&method.statistics());
                return self.degenerate(Some(mode), DEGENERATE_END);
            }
            if self.stop.is_some() || method.statistics().steps > self.settings.max_steps {
                break Some(SlidingEnd::Time);
            }
            // Fewer states have no two-fold to come near to, and need no margins.
            if N >= 3 {
                ahead.look(system, &self.x, sliding.margins(&sided, &self.x));
            }
            // Nearer than the tolerances resolve there is nothing to integrate.
            let Tolerance { rtol, atol } = self.settings.tolerance;
            let blur = LIMITS.blur * (atol + rtol * self.x.amax());
            if let Some(fold) = ahead.within(system, &self.x, self.settings.leg, blur)
                && let Some((leg, error)) = fold.time_to_arrive(system, &self.x, sliding.repelling)
            {
                break self.arrive(fold.point, leg, error, mode);
            }
            // The size of h where the state is off by so much.
            let Tolerance { atol, .. } = self.settings.tolerance;
            let allowed =
                self.size.map(|size| (LIMITS.drift * size).max(LIMITS.drift_in_tolerances * atol));
            if drift > gradient(system, &off).abs().dot(&allowed) {
                t_base = self.t;
                method.restart(&flow, 0.0, lift(&self.x), f64::INFINITY, f64::INFINITY)?;
            }
        };
        self.count(&method.statistics());
        let from = Some(mode);
        match next {
            None => match ahead.whole {
                Some(fold) if self.t < self.t_end && self.stop.is_none() => {
                    Ok(State::TwoFold(Box::new(fold)))
                }
                Some(fold) if self.x == fold.point => Ok(State::TwoFold(Box::new(fold))),
                _ => Ok(State::Sliding(sliding)),
            },
            Some(SlidingEnd::Time) => Ok(State::Sliding(sliding)),
            Some(SlidingEnd::Planned) => {
                let side = sliding.plan.map_or(Side::Plus, |plan| plan.side);
                Ok(self.exit(side, sliding.time, sliding.arc, from))
            }
            Some(SlidingEnd::Fold(side)) => {
                let (field, rate) = desingularised(&sided, &came_from);
                match self.leave_at_corner(side, &sliding, field / rate)? {
                    Some(state) => Ok(state),
                    None => self.leave_at_fold(side, &sliding),
                }
            }
        }
    }

    /// The first end of sliding within a step of the sliding flow, and the fraction of the step at
    /// which it comes.
    fn sliding_end<const M: usize>(
        &self,
        step: &Step<'_, M>,
        sliding: &Sliding,
        along: Option<Side>,
        (t_base, clock): (f64, f64),
        fresh: Option<Lie>,
    ) -> Option<(f64, SlidingEnd)> {
        let direction = sliding.direction();
        let mut first: Option<(f64, SlidingEnd)> = None;
        let mut propose = |theta: f64, end: SlidingEnd| {
            if first.is_none_or(|(best, _)| theta < best) {
                first = Some((theta, end));
            }
        };
        for (i, side) in [Side::Plus, Side::Minus].into_iter().enumerate() {
            if along == Some(side) {
                // Rounding of a margin that is zero is no end; what leads away is.
                let leaves = |k: usize| {
                    let z = step.at(k as f64 / CHORDS as f64);
                    let x = project(self.system, &without_clock(&z));
                    !self.is_tangent(&x, side) && sliding.margins(&self.sided(), &x)[i] < 0.0
                };
                if let Some(k) = (1..=CHORDS).find(|k| leaves(*k)) {
                    propose((k - 1) as f64 / CHORDS as f64, SlidingEnd::Fold(side));
                }
                continue;
            }
            let mut start = Start::Away;
            if let Some(l) = &fresh {
                let (value, zero, rate) = match side {
                    Side::Plus => (-direction * l.p, l.zero_p, -(l.q * l.pp - l.p * l.pm)),
                    Side::Minus => (direction * l.q, l.zero_q, l.q * l.mp - l.p * l.mm),
                };
                // Sliding that begins on a fold: the margin's own zero there is not an exit.
                if value <= zero {
                    if rate <= 0.0 {
                        propose(0.0, SlidingEnd::Fold(side));
                        continue;
                    }
                    start = Start::Simple(rate * clock * step.length());
                }
            }
            let sided = self.sided();
            let sign = -side.sign() * direction;
            let along_flow = Margin::<P, N> { system: sided, side, sign };
            let margin = |s| along_flow.at(&step.at(s));
            // A set of states about the surface reaches to where such a field has no value: nothing
            // encloses it.
            let mut zero = match self.depth {
                Some(_) => first_zero(margin, start),
                None => first_zero_along(step, &along_flow, start),
            };
            // Where a margin is zero and positive again behind, the motion goes on sliding.
            for _ in 0..MOST_TOUCHES {
                let Some(Zero::Touch(theta)) = zero else { break };
                let from = theta + BEHIND_TOUCH * (1.0 - theta);
                if margin(from).is_nan() || margin(from) <= 0.0 {
                    break;
                }
                zero = first_zero_after(from, &margin);
            }
            if let Some(zero) = zero {
                propose(zero.theta(), SlidingEnd::Fold(side));
            }
        }
        let (before, after) = (step.x0[N], step.x1[N]);
        let mut stop_at = |moment: f64, end: SlidingEnd| {
            if after >= moment {
                let theta = if after == moment {
                    1.0
                } else {
                    brent(|s| step.at(s)[N] - moment, 0.0, 1.0, before - moment, after - moment)
                };
                propose(theta, end);
            }
        };
        stop_at(self.t_end - t_base, SlidingEnd::Time);
        if let Some(plan) = sliding.plan {
            stop_at(self.t - t_base + (plan.time - sliding.time), SlidingEnd::Planned);
            let mut arc = 0.0;
            for (k, length) in chords::<N, M>(step, 1.0).into_iter().enumerate() {
                if sliding.arc + arc + length >= plan.arc {
                    let part = (plan.arc - sliding.arc - arc) / length;
                    propose((k as f64 + part) / CHORDS as f64, SlidingEnd::Planned);
                    break;
                }
                arc += length;
            }
        }
        first
    }

    /// The last leg into a two-fold. `None`, as the loop's result, says that no other end was met.
    fn arrive(
        &mut self,
        point: SVector<f64, N>,
        leg: f64,
        error: f64,
        mode: Mode,
    ) -> Option<SlidingEnd> {
        let straight = Straight { system: self.system, from: self.x, to: point };
        let t1 = self.t + leg;
        if t1 > self.t_end {
            let end = (self.t_end - self.t) / leg;
            let x1 = straight.at(end);
            self.take(mode, self.t_end, x1, &Truncated { inner: &straight, end });
            return Some(SlidingEnd::Time);
        }
        self.take(mode, t1, point, &straight);
        if self.stop.is_none() {
            self.event(EventKind::TwoFoldReached { leg, error }, Some(mode), None);
        }
        None
    }

    /// Sliding has come to a fold of the field of `side`.
    fn leave_at_fold(&mut self, side: Side, sliding: &Sliding) -> Result<State<N>, FilippovError> {
        let l = self.lie(&self.x);
        let from = Some(sliding.mode());
        if l.p.abs() <= l.zero_p && l.q.abs() <= l.zero_q {
            return self.degenerate(from, DEGENERATE_END);
        }
        if sliding.repelling {
            // The edge of the repelling region is an invisible fold: only the other side is left to
            // go to.
            let to = side.other();
            let (time, arc, rule) = (sliding.time, sliding.arc, self.chooser.rule);
            let first = match to {
                Side::Plus => l.p,
                Side::Minus => -l.q,
            };
            if first <= 0.0 {
                return Err(self
                    .non_transversal("repelling sliding ends where both Lie derivatives vanish"));
            }
            self.event(EventKind::ExitAtBoundary { to, time, arc, rule }, from, Some(to.into()));
            return Ok(State::Free { side: to, start: FlightStart::Transversal(first) });
        }
        let tangency = self.tangency(&l, side);
        if tangency.presses() {
            return Ok(State::Sliding(*sliding));
        }
        let Some(start) = tangency.left() else {
            return self.rest_or(
                from,
                "sliding ends at a fold that is not visible (a cusp or a two-fold)",
            );
        };
        self.event(EventKind::LeftByTangency { to: side }, from, Some(side.into()));
        Ok(State::Free { side, start })
    }

    /// The same at a corner of h, to which the motion has come with this velocity: the margin of
    /// `side` jumps there. `None` if there is no corner.
    fn leave_at_corner(
        &mut self,
        side: Side,
        sliding: &Sliding,
        velocity: SVector<f64, N>,
    ) -> Result<Option<State<N>>, FilippovError> {
        let (system, sided, from) = (self.system, self.sided(), self.x);
        let i = usize::from(side == Side::Minus);
        let [near, far] = LIMITS.corner.map(|share| share * self.reach());
        let margin = |distance: f64| {
            let x = project(system, &(from + velocity * (distance / velocity.norm())));
            sliding.margins(&sided, &x)[i]
        };
        let falls = |distance: f64| margin(-distance) - margin(distance);
        if !(margin(near) < 0.0 && falls(far) > 0.0 && falls(near) > 0.5 * falls(far)) {
            return Ok(None);
        }
        // The time after which a flight is seen to leave the surface, if it does.
        let leaves = |side: Side, field: SVector<f64, N>| {
            let time = far / field.norm();
            (side.sign() * system.switching(&(from + field * time)) > 0.0).then_some(time)
        };
        let flights = [
            leaves(Side::Plus, sided.plus(&from)).map(|time| (Side::Plus, time)),
            leaves(Side::Minus, sided.minus(&from)).map(|time| (Side::Minus, time)),
        ];
        let mode = Some(sliding.mode());
        let (to, after) = match (flights, sliding.plan) {
            ([Some(flight), None] | [None, Some(flight)], _) => flight,
            ([Some(plus), Some(minus)], Some(plan)) => {
                [plus, minus][usize::from(plan.side == Side::Minus)]
            }
            ([Some(_), Some(_)], None) => return self.enter_repelling(mode).map(Some),
            ([None, None], _) => {
                let what = "sliding ends at a corner of the surface, from which no motion leads";
                return self.rest_or(mode, what).map(Some);
            }
        };
        let kind = match sliding.repelling {
            true => {
                let (time, arc, rule) = (sliding.time, sliding.arc, self.chooser.rule);
                EventKind::ExitAtBoundary { to, time, arc, rule }
            }
            false => EventKind::LeftByTangency { to },
        };
        self.event(kind, mode, Some(to.into()));
        Ok(Some(State::Free { side: to, start: FlightStart::Flat(after) }))
    }
}
