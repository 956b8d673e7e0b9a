//! Flights of one field, and where they land.

use super::*;

impl<P: PiecewiseSmooth<N>, const N: usize> Engine<'_, P, N> {
    /// Free flight until the surface or the end.
    pub(super) fn fly(
        &mut self,
        side: Side,
        start: FlightStart,
    ) -> Result<State<N>, FilippovError> {
        let place = usize::from(side == Side::Minus);
        let gates = self.gates[place].take().unwrap_or_else(|| self.gates_of_side(side));
        let Tolerance { rtol, atol } = self.settings.tolerance;
        let tolerance = if self.tightened {
            Tolerance { rtol: (rtol * rtol).max(LIMITS.finest), atol: atol * atol }
        } else {
            self.accumulation.tolerance(self.settings.tolerance)
        };
        let mut method = Automatic::new(tolerance, gates);
        let next = self.fly_by(&mut method, side, start);
        self.gates[place] = Some(method.into_gates());
        next
    }

    fn gates_of_side(&self, side: Side) -> Option<Gates> {
        if self.is_simple {
            return None;
        }
        let h = Tape::record(N, |x| vec![self.system.switching(&SVector::from_column_slice(x))]);
        Gates::of_side(self.field(side).0.clone(), &h)
    }

    fn fly_by(
        &mut self,
        method: &mut Automatic<N>,
        side: Side,
        start: FlightStart,
    ) -> Result<State<N>, FilippovError> {
        let system = self.system;
        let mut flow = FreeFlow { system: Sided { system, depth: self.depth }, side };
        let (t_start, mut start) = (self.t, start);
        let mut leaving = match start {
            FlightStart::Tangent(second) => Some(second),
            _ => None,
        };
        let free_until = match start {
            FlightStart::Flat(after) => t_start + after,
            _ => t_start,
        };
        if let Err(failure) =
            method.restart(&flow, self.t, self.x, self.t_end, self.settings.max_step)
        {
            return if self.stay_inside() {
                Ok(State::Free { side, start })
            } else {
                Err(self.diagnosed(failure, side))
            };
        }
        let landed = loop {
            let step = match method.step(&flow) {
                Ok(step) => step,
                // Trial points beyond the surface, where the motion does not go, may be where the
                // field has no value.
                Err(Failure::NotFinite { .. } | Failure::StepUnderflow { .. })
                    if self.stay_inside() =>
                {
                    flow.system.depth = self.depth;
                    let restarted =
                        method.restart(&flow, self.t, self.x, self.t_end, self.settings.max_step);
                    restarted.map_err(|failure| self.diagnosed(failure, side))?;
                    continue;
                }
                Err(failure) => return Err(self.diagnosed(failure, side)),
            };
            let above = Height { system, sign: side.sign() };
            let height = |theta: f64| above.at(&step.at(theta));
            let length = step.length();
            let at_start = start.over(length);
            // After a tangency the first steps may rise by less than the rounding of h.
            let gone = step.t1 - t_start;
            leaving = leaving.filter(|second| 0.5 * second * gone * gone <= self.blur(&step.x1));
            start =
                leaving.map_or(FlightStart::Away, |second| FlightStart::Transversal(second * gone));
            let free = (free_until - step.t0) / length;
            let zero = match leaving {
                Some(_) => None,
                None if free >= 1.0 => None,
                None if free > 0.0 => first_zero_after(free, &height),
                None => first_zero_along(&step, &above, at_start),
            };
            // A field whose domain ends on the surface ends the flight there.
            let landing = zero.map_or(f64::INFINITY, |zero| zero.theta() - LIMITS.same_moment);
            if let Some((end, what)) = self.domain_end(&[side], &|theta| step.at(theta))
                && end < landing
            {
                let (t, x) = (step.time(end), step.at(end));
                self.take(side.into(), t, x, &Truncated { inner: step.interpolant, end });
                return Err(Failure::Undefined { t, state: Failure::state(&x), what }.into());
            }
            match zero {
                None => {
                    let (t1, x1) = (step.t1, step.x1);
                    self.take(side.into(), t1, x1, step.interpolant);
                    if self.stop.is_some() || self.t >= self.t_end {
                        break None;
                    }
                }
                Some(zero) => {
                    let mut theta = zero.theta();
                    if matches!(zero, Zero::Touch(_)) {
                        // A touch is known only to the root of the rounding; the tangency itself is
                        // a simple zero.
                        for _ in 0..LIMITS.touch_steps {
                            let l = self.lie(&step.at(theta));
                            let (rate, second) = match side {
                                Side::Plus => (l.p, l.pp),
                                Side::Minus => (l.q, l.mm),
                            };
                            let moved = theta - rate / (second * length);
                            if !((moved - theta).abs() < LIMITS.touch_range
                                && (0.0..=1.0).contains(&moved))
                            {
                                break;
                            }
                            theta = moved;
                        }
                    }
                    let (t1, place) = (up_to(self.t_end, step.time(theta)), step.at(theta));
                    let x1 = project(self.system, &place);
                    // A zero of a continuous h is on the surface but for rounding, and h is smaller
                    // there than before.
                    let travel = (step.x1 - step.x0).norm() + place.norm();
                    let moved = (x1 - place).norm();
                    let [before, there] = [0.5 * theta, theta].map(&height);
                    let jumps = theta > LIMITS.same_moment
                        && before > 0.0
                        && there.abs() > (LIMITS.falls * before).max(self.blur(&place));
                    let on_surface = moved <= LIMITS.jump * travel;
                    if jumps || !on_surface || !self.has_slope(&step.at(0.5 * theta), &x1) {
                        self.take(
                            side.into(),
                            t1,
                            place,
                            &Truncated { inner: step.interpolant, end: theta },
                        );
                        let (t, state) = (t1, Failure::state(&place));
                        return Err(if jumps || there.abs() > LIMITS.small * before {
                            FilippovError::Jump { t, state }
                        } else {
                            FilippovError::Slope { t, state }
                        });
                    }
                    self.take(
                        side.into(),
                        t1,
                        x1,
                        &Truncated { inner: step.interpolant, end: theta },
                    );
                    break Some(zero);
                }
            }
            if method.statistics().steps > self.settings.max_steps {
                break None;
            }
        };
        self.count(&method.statistics());
        match landed {
            _ if self.stop.is_some() => Ok(State::Free { side, start: FlightStart::Away }),
            None => Ok(State::Free { side, start: FlightStart::Away }),
            Some(zero) => {
                let duration = self.t - t_start;
                if let Some((left, point)) = self.accumulation.flight(duration, self.t, self.x) {
                    return self.accumulate(side, left, point, duration);
                }
                self.land(side, matches!(zero, Zero::Touch(_)))
            }
        }
    }

    /// The mode after an arrival on the surface from `side`.
    pub(super) fn land(&mut self, side: Side, touch: bool) -> Result<State<N>, FilippovError> {
        let tightened = std::mem::take(&mut self.tightened);
        let l = self.lie_on_surface();
        let from = Some(side.into());
        if let Some(local) = self.two_fold_here(&l) {
            let error = (local.point - self.x).norm() / self.system.plus(&self.x).norm();
            self.x = local.point;
            self.event(EventKind::TwoFoldReached { leg: 0.0, error }, from, None);
            return Ok(State::TwoFold(Box::new(local)));
        }
        if let Some(folds) = self.fused_here(&l) {
            return Ok(self.meet(folds, from));
        }
        // Growth of |h| on this side along its own field, and on the other side along the other
        // field.
        let (own, own_zero, own_second, across, across_zero, across_second) = match side {
            Side::Plus => (l.p, l.zero_p, l.pp, -l.q, l.zero_q, -l.mm),
            Side::Minus => (-l.q, l.zero_q, -l.mm, l.p, l.zero_p, l.pp),
        };
        let slides = own.abs() <= own_zero && across < -across_zero && self.runs_along(side)
            || own < -own_zero && across.abs() <= across_zero && self.runs_along(side.other());
        if slides {
            return Ok(self.land_for_good(side));
        }
        if own > own_zero && self.hops(side, own, own_second) {
            return self.land(side, false);
        }
        let tangent = own.abs() <= own_zero;
        let presses = tangent && self.tangency(&l, side).presses();
        if own >= -own_zero && !presses || (touch && own_second > 0.0) {
            let start = match tangent {
                true => self.tangency(&l, side).left(),
                false => (own_second > 0.0).then_some(FlightStart::Transversal(own)),
            };
            // A root begins at the surface, and its motion is known no better than the root of the
            // tolerance.
            let is_root = !tangent && !own_second.is_finite();
            if is_root && !tightened && !self.rests_here() {
                self.tightened = true;
                return Ok(State::Free { side, start: FlightStart::Transversal(own) });
            }
            let Some(start) = start else {
                return self
                    .degenerate(from, "a tangency from an invisible or degenerate side (a cusp)");
            };
            self.event(EventKind::Grazing { side }, from, from);
            return Ok(State::Free { side, start });
        }
        let other = side.other();
        let start = if across > across_zero {
            Some(FlightStart::Transversal(across))
        } else if across < -across_zero {
            None
        } else {
            let tangency = self.tangency(&l, other);
            if tangency.is_unknown() {
                return self.degenerate(
                    from,
                    "landing on a fold with zero second Lie derivative (a cusp)",
                );
            }
            tangency.left()
        };
        if let Some(start) = start {
            self.event(EventKind::Crossing { to: other }, from, Some(other.into()));
            if across > across_zero && self.hops(other, across, across_second) {
                return self.land(other, false);
            }
            return Ok(State::Free { side: other, start });
        }
        Ok(self.land_for_good(side))
    }

    fn land_for_good(&mut self, from: Side) -> State<N> {
        self.accumulation = Accumulation::default();
        let (kind, mode) = (EventKind::Landing { from }, Mode::SlidingAttracting);
        self.event(kind, Some(from.into()), Some(mode));
        State::Sliding(Sliding::ATTRACTING)
    }
}
