//! Actions at a point that is met: crossings, events, resets, contacts.

use std::borrow::Cow;

use super::*;

/// Smaller values of what is held at zero, and smaller speeds, relative to their sizes, are drift.
pub(super) const DRIFT: f64 = 1e-7;

/// Times less apart are one moment, relative to the time.
const SAME_MOMENT: f64 = 16.0 * f64::EPSILON;

/// Changes of states by an event are rounding up to so small a part of their largest sizes.
const BLOW: f64 = 1e-13;

/// So far beside the zero of a switching function, in units of the states, fields of its two sides
/// are compared.
const BESIDE: f64 = 1e-6;

impl Follower<'_> {
    pub(super) fn meet(
        &mut self,
        definition: &crate::Definition,
        met: &[Sought],
        due: &[usize],
        observe: &mut dyn FnMut(&Point) -> bool,
    ) -> Result<Option<Ending>, HybridError> {
        let mut zero = self.sliding.clone();
        let mut fired = due.to_vec();
        let passes = |sought: &Sought| matches!(sought, Sought::Watched(_) | Sought::Pole(_));
        let before = match std::mem::take(&mut self.watched_before) {
            known if !known.is_empty() || met.iter().all(passes) => known,
            _ => self.watched_values().split_off(self.compiled.active.len()),
        };
        let mut passed = Vec::new();
        let mut crossed = Vec::new();
        let (mut leave, mut opened, mut ceases) = (Vec::new(), Vec::new(), false);
        let held = self.held.clone();
        for sought in met {
            match *sought {
                Sought::Guard { guard, .. } => {
                    if !zero.contains(&guard) {
                        zero.push(guard);
                    }
                    crossed.push(guard);
                }
                Sought::Watched(i) => {
                    passed.push(i);
                    // Rounding of an expression that is passed is no other crossing.
                    let last = std::mem::replace(&mut self.passed_at[i], self.t);
                    if self.t - last <= SAME_MOMENT * self.t.abs() && !self.turns(i) {
                        continue;
                    }
                    if !self.pass(i, definition, &mut fired, observe) {
                        return Ok(Some(Ending::Interrupted));
                    }
                }
                // It is not zero there.
                Sought::Pole(i) => {
                    self.watch_side[i] = -self.watch_side[i];
                    self.fresh_watch[i] = false;
                }
                Sought::Leave { place, plus } => leave.push((self.sliding[place], plus)),
                Sought::Repelling => {
                    if self.comes_to_rest(self.t, false) {
                        return Ok(None);
                    }
                    ceases = true;
                }
                Sought::Release(place) => {
                    let (t, x) = (self.t, self.x.clone());
                    self.watched_values();
                    self.contacts[place].above = self.push(place, t, &x).1;
                    opened.push(self.contacts[place].clone());
                }
                Sought::Beyond(at) => self.pass_beyond(at),
            }
        }
        for guard in crossed.clone() {
            if self.is_kink_of_one_side(guard) {
                let (mut config, sliding) = (self.config.clone(), self.sliding.clone());
                config.sides[guard] = -config.sides[guard];
                self.adopt(config, sliding);
                self.fresh_guard[guard] = true;
                self.outcome.switches += 1;
                crossed.retain(|other| *other != guard);
                zero.retain(|other| *other != guard);
            }
        }
        self.pass_in_time(&crossed);
        // Events that happen at this moment come first, and others that are met decide, too.
        if ceases && fired.is_empty() && crossed.is_empty() {
            let slid = self.sliding.clone();
            match self.options.exit {
                // The fields may lead away in one way.
                _ if self.dependent => crossed.extend(&slid),
                _ if slid.len() > 1 => return Err(self.ceases_to_be_the_only_motion()),
                Exit::Undecided => {
                    return Err(self.undecided(
                        &slid,
                        "sliding ceases to attract: it may go on, or leave at any time to either \
                            side",
                    ));
                }
                rule => slid.iter().for_each(|g| leave.push((*g, rule == Exit::Plus))),
            }
        }
        let opens = !opened.is_empty();
        self.open(opened)?;
        self.left.fill(0.0);
        self.left_watch.fill(0.0);
        if !leave.is_empty() {
            if self.ends_inside() {
                return Err(self.no_mixture(&self.sliding));
            }
            for (guard, plus) in &leave {
                let rates = |follower: &mut Self, side: f64| {
                    let mut config = follower.config.clone();
                    config.sides[*guard] = side;
                    follower.follow_sides(&mut config, &[*guard]);
                    let (compiled, rates) = follower.rates(&config);
                    let own = compiled.place(*guard).map_or(0.0, |place| rates.first[place]);
                    (own, rates.first[compiled.active.len()..].to_vec())
                };
                let (low, high) = (self.low(*guard), self.high(*guard));
                let ((high, all_high), (low, all_low)) = (rates(self, high), rates(self, low));
                self.left[*guard] = (high - low).abs();
                for (i, (all_high, all_low)) in all_high.iter().zip(&all_low).enumerate() {
                    let change = all_high - all_low;
                    if change.abs() > self.left_watch[i].abs() {
                        let with = change * (high - low) > 0.0;
                        self.left_watch[i] = if with == *plus { 1.0 } else { -1.0 } * change.abs();
                    }
                }
            }
            self.outcome.switches += 1;
            let mut config = self.config.clone();
            for (guard, plus) in &leave {
                config.sides[*guard] = if *plus { self.high(*guard) } else { self.low(*guard) };
                self.fresh_guard[*guard] = true;
                self.tangent_guard[*guard] = false;
                zero.retain(|g| g != guard);
            }
            self.ask_new(&mut config);
            let left: Vec<usize> = leave.iter().map(|(guard, _)| *guard).collect();
            self.follow_sides(&mut config, &left);
            let rest: Vec<usize> =
                self.sliding.iter().copied().filter(|g| zero.contains(g)).collect();
            self.adopt(config, rest);
        }
        let (mut accumulates, mut unresolved, mut turns) = (None, None, None::<usize>);
        let stepped = std::mem::take(&mut self.tables_step);
        let switches = stepped || !(crossed.is_empty() && leave.is_empty());
        if !crossed.is_empty() {
            self.outcome.switches += 1;
            let sides = self.config.sides.clone();
            if ceases {
                let slid = self.sliding.clone();
                self.decide(&zero, &vec![false; self.slides.len()])?;
                if self.dependent && self.sliding == slid {
                    return Err(self.ceases_to_be_the_only_motion());
                }
            } else {
                self.settle(&zero)?;
            }
            let jumped =
                |guard: &usize| !zero.contains(guard) && sides[*guard] != self.config.sides[*guard];
            if !self.sliding.is_empty() && self.compiled.active.iter().any(jumped) {
                // Other switching functions that jumped may end sliding.
                let (slid, none) = (self.sliding.clone(), vec![false; self.slides.len()]);
                self.decide(&slid, &none)?;
            }
            // Equations with kinks alone are Lipschitz: no infinity of them is in finite time.
            for guard in crossed {
                if self.equation.guards[guard].kink {
                    continue;
                }
                let found = self.switch_trains[guard].note(self.t, 0.0);
                turns.get_or_insert(guard);
                if found.is_none() && self.switch_trains[guard].shrinks(self.t) {
                    // Turns that are not resolved any more end where the motion rests.
                    let grain = self.grain_of_switch(guard);
                    let limit = self.switch_trains[guard].told(self.t, grain);
                    unresolved = unresolved.or(limit.map(|(t, _)| t));
                }
                if let Some((t, error)) = found
                    && accumulates.is_none()
                    && !self.is_kink(guard)
                {
                    accumulates = Some((guard, t, error));
                }
            }
        }
        if switches {
            for i in self.part_from_stops()? {
                passed.push(i);
                if !self.pass(i, definition, &mut fired, observe) {
                    return Ok(Some(Ending::Interrupted));
                }
            }
            self.rest_on_stops()?;
        }
        let jumps =
            if switches || opens { self.watch_jumps(&held, &before, &passed) } else { Vec::new() };
        for (i, _) in &jumps {
            passed.push(*i);
            if !self.pass(*i, definition, &mut fired, observe) {
                return Ok(Some(Ending::Interrupted));
            }
        }
        for i in &passed {
            self.watch_side[*i] = -self.watch_side[*i];
            self.fresh_watch[*i] = true;
            (self.released[*i], self.tangent[*i]) = (0.0, false);
        }
        for (i, jump) in jumps {
            match jump {
                Jump::Over => self.fresh_watch[i] = false,
                Jump::Leaves => {}
                Jump::Onto => self.begin_watching(i, true, false),
            }
        }
        if switches {
            // A switch of the moment of their zero may have made them jump.
            let values = self.watched_values().split_off(self.compiled.active.len());
            for i in passed {
                let size = self.magnitude(&self.equation.watched[i]).max(before[i].abs());
                let value = values[i];
                if value.abs() > 1e-12 * size {
                    (self.watch_side[i], self.fresh_watch[i]) = (value.signum(), false);
                }
            }
        }
        let held = self.holds.clone();
        fired.extend(self.new_conditions());
        self.unmade = (0..held.len()).filter(|i| held[*i] && !self.holds[*i]).collect();
        // Switches that come ever faster with events, such as speeds that turn between impacts, end
        // where these do.
        let by_events = self.trains.iter().any(|train| train.shrinks(self.t));
        if let Some(guard) = turns.filter(|_| fired.is_empty() && !by_events)
            && self.slides_in_higher_order(guard)?
        {
            return Ok(None);
        }
        if let Some(t) = unresolved.filter(|_| fired.is_empty() && !by_events)
            && accumulates.is_none()
            && (self.comes_to_rest(t, false) || self.stays_at_meeting(t))
        {
            return Ok(None);
        }
        if let Some((guard, t, error)) = accumulates.filter(|_| fired.is_empty() && !by_events) {
            if self.comes_to_rest(t, false) {
                return Ok(None);
            }
            if !self.comes_to_meeting()? {
                let surfaces = self.names(&[guard]);
                return Err(HybridError::Accumulation { t, error, x: self.x.clone(), surfaces });
            }
        }
        fired.sort_unstable();
        self.happen(definition, &fired, &zero, observe)
    }

    /// Ends contacts.
    fn open(&mut self, contacts: Vec<Contact>) -> Result<(), HybridError> {
        if contacts.is_empty() {
            return Ok(());
        }
        /// Speeds that are rounding, relative to those that the motion gets in the run.
        const SPEED: f64 = 1e-13;
        let mut freed = Vec::new();
        for contact in contacts {
            let place = self.contacts.iter().position(|c| *c == contact);
            let off = |off: &&Off| Some(off.place) == place && off.way == contact.above;
            if let Some(off) = self.off.iter().find(off) {
                let held = (0..self.guard_held.len()).filter(|guard| self.guard_held[*guard]);
                freed.extend(held.map(|guard| (guard, off.config.sides[guard])));
            }
            self.contacts.retain(|c| c.watched != contact.watched);
            self.watch_side[contact.watched] = contact.above;
            self.fresh_watch[contact.watched] = true;
            self.tangent[contact.watched] = false;
            let (compiled, rates) = self.rates_of_second_order(&self.config.clone());
            let i = compiled.active.len() + contact.watched;
            let (speed, speeds) = (rates.first[i], rates.terms[i]);
            // Rounding of a speed leads into no surface.
            let span = self.options.t_end - self.options.t_start;
            if speed * contact.above < 0.0 && speed.abs() <= SPEED * rates.second[i].abs() * span {
                let place = self.compiled.active.len() + contact.watched;
                let direction = self.direction_of(&contact, &self.variables);
                let by = self.second_in(&rates.field, &direction)[place];
                if by != 0.0 {
                    self.x.iter_mut().zip(direction.iter()).for_each(|(x, d)| *x -= speed / by * d);
                }
            }
            self.release(contact.watched, speeds);
            self.trains[contact.event] = Train::default();
        }
        self.hold_guards_but(&freed)
    }

    /// A function of the time alone is zero between two numbers, of which the later one counts: the
    /// equations are asked there for what they say from its switch on.
    fn pass_in_time(&mut self, crossed: &[usize]) {
        const MOST_NUDGES: usize = 8;
        for guard in crossed.iter().filter(|guard| !self.equation.guards[**guard].whole) {
            let of_time = |place: usize| self.compiled.touches[place].iter().all(|v| *v == self.n);
            if !self.compiled.place(*guard).is_some_and(of_time) {
                continue;
            }
            let (e, side) = (&self.equation.guards[*guard].expression, self.config.sides[*guard]);
            for _ in 0..MOST_NUDGES {
                let value = self.equation.value(e, self.t, &self.x);
                // Nothing is greater than what it is equal to.
                let passed = value * side < 0.0 || value == 0.0 && side > 0.0;
                if passed || self.t.next_up() > self.options.t_end {
                    break;
                }
                self.t = self.t.next_up();
            }
        }
    }

    /// Ends contacts with stops whose place or speed has jumped. Returns the watched expressions of
    /// those that strike the body.
    fn part_from_stops(&mut self) -> Result<Vec<usize>, HybridError> {
        if self.contacts.is_empty() {
            return Ok(Vec::new());
        }
        let (compiled, rates) = self.rates(&self.config.clone());
        let (mut parted, mut struck) = (Vec::new(), Vec::new());
        for contact in &self.contacts {
            let e = &self.equation.watched[contact.watched];
            let place = compiled.active.len() + contact.watched;
            let off = self.equation.value(e, self.t, &self.x).abs() > DRIFT * self.magnitude(e);
            let speeds = self.speeds(&rates.field, self.compiled.active.len() + contact.watched);
            let moves = rates.first[place].abs() > (DRIFT * rates.terms[place]).max(1e-14 * speeds);
            if off || moves {
                parted.push(contact.clone());
                // A place that jumps over the body is seen with the other expressions.
                if !off && rates.first[place] * contact.above < 0.0 {
                    struck.push(contact.watched);
                }
            }
        }
        self.open(parted)?;
        Ok(struck)
    }

    /// Ends contacts at which a force that has jumped pulls.
    pub(super) fn open_pulled(&mut self) -> Result<(), HybridError> {
        const PULLS: f64 = 1e-12;
        if self.contacts.is_empty() {
            return Ok(());
        }
        let list: Vec<(Sought, f64)> =
            (0..self.contacts.len()).map(|place| (Sought::Release(place), 1.0)).collect();
        let (t, x, mut pushes, mut field) = (self.t, self.x.clone(), Vec::new(), vec![0.0; self.n]);
        self.measure(&list, t, &x, &mut pushes);
        self.compiled.field.evaluate(&self.variables, &mut field);
        let alone = self.contacts.len() == 1 && self.contacts_act_on_sliding(&field);
        if alone || !pushes.iter().all(|push| push.is_finite()) {
            pushes = self.pushes_on_free_sliding(t, &x);
        }
        let largest = field.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
        let pulled =
            self.contacts.iter().zip(&pushes).filter(|(_, push)| **push < -PULLS * largest);
        let pulled: Vec<Contact> = pulled.map(|(contact, _)| contact.clone()).collect();
        self.open(pulled.clone())?;
        // A force that jumps leads away to second order.
        for Contact { watched, above, .. } in pulled {
            let e = &self.equation.watched[watched];
            if self.equation.value(e, self.t, &self.x) * above >= 0.0 {
                (self.released[watched], self.tangent[watched]) = (0.0, true);
            }
        }
        Ok(())
    }

    /// Whether a mixture by order ends although no surface is left: a fast surface ceases to
    /// attract for one side of a slower one.
    fn ends_inside(&mut self) -> bool {
        if self.corners.is_empty() || self.order.is_empty() {
            return false;
        }
        let (t, x) = (self.t, self.x.clone());
        let weights = self.corner_mixture(t, &x).0.weights;
        let share = |i: usize| -> f64 {
            (0..weights.len()).filter(|v| v >> i & 1 == 1).map(|v| weights[v]).sum()
        };
        (0..self.sliding.len()).map(share).all(|w| !(w <= 1e-6 || w >= 1.0 - 1e-6))
    }

    /// Lets events happen, in the file's order: each finds the state as those before it left it.
    pub(super) fn happen(
        &mut self,
        definition: &crate::Definition,
        fired: &[usize],
        zero: &[usize],
        observe: &mut dyn FnMut(&Point) -> bool,
    ) -> Result<Option<Ending>, HybridError> {
        // In the mode that those before it leave; what has been met, also in that in which it was.
        let mut now = self.config.mode;
        let takes_place = |i: &usize| {
            let event = &definition.events()[*i];
            let of_clock = matches!(event.when, When::At(_) | When::Every(_));
            let takes =
                event.from.is_none_or(|mode| mode == now && (of_clock || mode == self.config.mode));
            now = event.mode.filter(|_| takes).unwrap_or(now);
            takes
        };
        let fired: Vec<usize> = fired.iter().copied().filter(takes_place).collect();
        if fired.is_empty() {
            return Ok(None);
        }
        let quiet = matches!(self.options.record, Record::Section(_));
        let (mut stop, mut zeno, mut newly, mut through) = (None, None, Vec::new(), None);
        let (old, mode_before) = (self.x.clone(), self.config.mode);
        let mut new = self.x.clone();
        let mut mode = None;
        // Of several events, the states that each leaves behind.
        let mut left_behind = Vec::new();
        let unmade = std::mem::take(&mut self.unmade);
        let (mut happened, mut with) = (Vec::new(), Vec::new());
        for i in &fired {
            let event = &definition.events()[*i];
            self.x.copy_from_slice(&new);
            // An earlier event of this moment may have kept a condition from becoming true.
            if let Some(e) = self.equation.conditions[*i].clone()
                && (new != old || mode.is_some())
                && !self.becomes_true(&e, mode, &old)
            {
                continue;
            }
            happened.push(*i);
            self.outcome.events += 1;
            if !quiet && !self.emit(self.t, Some(&event.name), observe) {
                return Ok(Some(Ending::Interrupted));
            }
            if !event.set.is_empty() {
                self.note_reset(&event.set, &new);
            }
            match &self.equation.resets[*i] {
                Some(program) => {
                    self.variables[..self.n].copy_from_slice(&self.x);
                    self.variables[self.n] = self.t;
                    let mut values = std::mem::take(&mut self.room);
                    values.resize(event.set.len(), 0.0);
                    program.evaluate(&self.variables, &mut values);
                    let set = event.set.iter().zip(&values);
                    set.for_each(|((state, _), value)| new[*state] = *value);
                    self.room = values;
                }
                None => {
                    for (state, value) in &event.set {
                        new[*state] = self.equation.value(value, self.t, &self.x);
                    }
                }
            }
            mode = event.mode.or(mode);
            if fired.len() > 1 {
                left_behind.push(new.clone());
            }
            if event.stop {
                stop = Some(Ending::Stopped(event.name.clone()));
            }
            // Blows whose changes of speed are rounding, as of bodies that touch, are no sign of
            // an accumulation.
            let moves = |(state, _): &(usize, Expression)| {
                (new[*state] - self.x[*state]).abs() > BLOW * self.size[*state]
            };
            let resets = matches!(event.when, When::Zero(..) | When::Becomes(_))
                && (event.set.iter().any(|set| event.sticks || moves(set)) || event.mode.is_some());
            if resets {
                let grain = if self.trains[*i].shrinks(self.t) { self.grain(*i) } else { 0.0 };
                let found = self.trains[*i].note(self.t, grain);
                // Others that accumulate with one on whose surface the motion may rest wait for it.
                let mut all = definition.events().iter().zip(&self.trains);
                let waits = !event.sticks
                    && all.any(|(event, train)| event.sticks && train.shrinks(self.t));
                if let Some((t, error)) = found.filter(|_| !waits) {
                    zeno = Some((*i, t, error));
                }
            }
        }
        let fired = happened;
        if !new.iter().all(|v| v.is_finite()) {
            let names: Vec<&str> =
                fired.iter().map(|i| definition.events()[*i].name.as_str()).collect();
            let why =
                format!("`set` of {} gives {new:?}, which is no finite state", names.join(", "));
            return Err(HybridError::Stuck { t: self.t, x: old, why });
        }
        let changed = new != old || left_behind.iter().any(|x| *x != old);
        self.x.copy_from_slice(&old);
        let kept = mode.map(|_| self.kept_at_zero());
        for i in (0..self.n).filter(|i| new[*i] != old[*i]) {
            self.lately[i] = new[i].abs();
            self.before[i] = new[i].abs();
            self.size[i] = self.size[i].max(new[i].abs());
        }
        self.x = new;
        if changed || mode.is_some() {
            let asked: Vec<bool> = (0..self.watch_side.len()).map(|i| self.is_asked(i)).collect();
            if let Some(mode) = mode {
                self.config.mode = mode;
            }
            // Expressions that were zero and that the reset leaves alone are zero still.
            let value = |e: &Expression, x: &[f64]| self.equation.value(e, self.t, x);
            let stays_zero = |e: &Expression| {
                let (a, b) = (value(e, &old), value(e, &self.x));
                (a - b).abs() <= 1e-12 * self.magnitude(e)
            };
            let held = self.held.clone();
            // A switch of this moment may have made them jump.
            let is_zero = |guard: &usize| {
                let asked = self.compiled.place(*guard).is_some();
                !asked || self.slides[*guard] || self.fresh_guard[*guard]
            };
            let zero: Vec<usize> = zero
                .iter()
                .copied()
                .filter(|g| is_zero(g) && stays_zero(&self.equation.guards[*g].expression))
                .collect();
            // An expression that was not asked has gone where it is.
            let fresh = |i: &usize| self.fresh_watch[*i] && asked[*i];
            let watched: Vec<usize> = (0..self.watch_side.len())
                .filter(|i| fresh(i) && stays_zero(&self.equation.watched[*i]))
                .collect();
            if mode.is_some() || !self.equation.guards.is_empty() {
                // A body that is laid on its stop lies there, and functions of its place rest.
                self.rest_on_stops()?;
                self.settle_afresh(&zero)?;
            }
            let struck = self.keep_contacts(definition, &old);
            self.hold_guards()?;
            for i in 0..self.watch_side.len() {
                // Slid upon before and after: it is left to a side, or to the other one.
                if held[i] && self.held[i] {
                    continue;
                }
                let met = self.event_of[i].is_some_and(|event| fired.contains(&event));
                // A function that the reset leaves alone is where it was, however near to zero.
                let e = &self.equation.watched[i];
                let now = self.equation.value(e, self.t, &self.x);
                // But one beyond its event's zero, or not asked until now, has just come there.
                let lies = now.abs() <= 1e-12 * self.magnitude(e)
                    && (!asked[i] || !met && self.is_beyond(i, now));
                let is_away = !met && !self.fresh_watch[i] && now * self.watch_side[i] > 0.0;
                if is_away && !lies && asked[i] && now == self.equation.value(e, self.t, &old)
                    || self.contacts.iter().any(|c| c.watched == i)
                {
                    continue;
                }
                let is_kept = kept.as_ref().is_some_and(|kept| kept[i]);
                if is_kept && self.is_asked(i) && now.abs() <= DRIFT * self.magnitude(e) {
                    self.begin_watching_kept(i);
                } else {
                    self.begin_watching(i, lies || watched.contains(&i), met);
                }
            }
            for i in &watched {
                let Some(event) = self.event_of[*i] else { continue };
                // Pressed back into the surface at once: infinitely many in no time. What passes
                // through with a speed does not come back.
                if self.is_beyond(*i, self.watch_side[*i])
                    && self.is_asked(*i)
                    && fired.contains(&event)
                    && !definition.events()[event].set.is_empty()
                {
                    let rounding = 4.0 * f64::EPSILON * self.t.abs();
                    if self.rests_on_watched(*i) {
                        zeno = Some((event, self.t, rounding));
                    } else if definition.events()[event].sticks {
                        match self.flight_in_rounding(*i) {
                            Some(time) => zeno = Some((event, self.t, time + rounding)),
                            None => through = Some(event),
                        }
                    }
                }
            }
            if zeno.is_none()
                && let Some((all, time)) = self.bounce_in_rounding(definition, &fired)
            {
                through = None;
                zeno = Some((all[0], self.t, time + 4.0 * f64::EPSILON * self.t.abs()));
                with = all[1..].to_vec();
            }
            newly = self.new_conditions();
            // A condition that a switch of this moment would have made false is true anew if it is
            // false here.
            newly.retain(|i| match self.equation.conditions[*i].clone() {
                Some(e) if unmade.contains(i) => !self.holds_at(&e, &old),
                _ => true,
            });
            newly.extend(struck);
            if self.equation.of_events.iter().any(|asked| !asked.is_empty()) {
                let ends = [vec![old.clone()], left_behind.clone(), vec![self.x.clone()]];
                newly.extend(self.true_again(&fired, &ends.concat()));
            }
            if let Some(event) = self.endless(definition, &fired) {
                zeno = Some((event, self.t, 4.0 * f64::EPSILON * self.t.abs()));
                newly.retain(|i| *i != event);
            }
            if changed && with.is_empty() {
                let blown = self.blown(definition, &old, &fired, &left_behind)?;
                newly.extend(blown);
            }
            // A condition that holds where its mode begins has not become true.
            if mode.is_some_and(|mode| mode != mode_before) {
                let here = self.x.clone();
                newly.retain(|i| match &definition.events()[*i] {
                    Event { when: When::Becomes(e), from, .. } if *from == mode => {
                        !self.holds_at(e, &here)
                    }
                    _ => true,
                });
            }
            newly.sort_unstable();
            newly.dedup();
            // A state that may stick to a surface is not let through it without a word.
            if let Some(event) = through.filter(|event| zeno.is_none() && !newly.contains(event)) {
                let why = format!(
                    "`set` of {} leaves the motion going on through the surface that it may stick \
                        to (after_zeno = \"stick\"): let it turn the speed back there",
                    definition.events()[event].name
                );
                return Err(HybridError::Stuck { t: self.t, x: self.x.clone(), why });
            }
            let setting = fired.iter().rev().find(|i| !definition.events()[**i].set.is_empty());
            let name = &definition.events()[*setting.unwrap_or(&fired[fired.len() - 1])].name;
            if !quiet && !self.emit(self.t, Some(name), observe) {
                return Ok(Some(Ending::Interrupted));
            }
        }
        if !changed && mode.is_none() {
            let event = self.endless(definition, &fired).or_else(|| self.pushes_on(&fired));
            if let Some(event) = event {
                zeno = Some((event, self.t, 4.0 * f64::EPSILON * self.t.abs()));
            }
            // Bodies that strike without a speed.
            for i in 0..self.watch_side.len() {
                let met = self.event_of[i].is_some_and(|event| fired.contains(&event));
                if met && self.touches_on(i) {
                    (self.watch_side[i], self.touches[i]) = (0.0, true);
                }
            }
        }
        if stop.is_some() {
            return Ok(stop);
        }
        if let Some((i, t, error)) = zeno {
            let event = &definition.events()[i];
            if event.sticks
                && let Record::Times { every } = self.options.record
            {
                while self.next_record <= t {
                    if !self.emit(self.next_record, None, observe) {
                        return Ok(Some(Ending::Interrupted));
                    }
                    self.next_record = ((self.next_record / every).round() + 1.0) * every;
                }
            }
            if with.is_empty() {
                with = self.accumulate_with(definition, i, t);
            }
            let sticks = event.sticks && self.stick(definition, &[&[i], &with[..]].concat(), t)?;
            if sticks {
                self.hold_guards()?;
                newly.extend(self.new_conditions());
            }
            if !sticks {
                if !quiet {
                    self.t = t;
                    self.emit(t, Some(&event.name), observe);
                }
                return Ok(Some(Ending::Zeno { event: event.name.clone(), t, error }));
            }
            if !quiet && !self.emit(self.t, Some(&format!("{} at rest", event.name)), observe) {
                return Ok(Some(Ending::Interrupted));
            }
        }
        if changed || mode.is_some() {
            // A body that is laid on its stop lies there.
            self.rest_on_stops()?;
        }
        // Events that a reset or a new mode makes true happen at once.
        self.happen(definition, &newly, &[], observe)
    }

    /// Whether a condition that becomes true at the state `old` still does at the present one, to
    /// which events of the same moment have led, and from which the motion goes on in `mode`.
    fn becomes_true(&mut self, e: &Expression, mode: Option<usize>, old: &[f64]) -> bool {
        let mut at = self.config.clone();
        at.mode = mode.unwrap_or(at.mode);
        let (compiled, rates) = self.rates_of_second_order(&at);
        for guard in 0..at.sides.len() {
            let whole = self.equation.guards[guard].whole;
            let value = &self.equation.guards[guard].expression;
            let moved = self.equation.value(value, self.t, old)
                != self.equation.value(value, self.t, &self.x);
            match (self.side_of(guard), compiled.place(guard)) {
                (Some(side), _) if moved => at.sides[guard] = side,
                (None, _) if moved => at.sides[guard] = 0.0,
                (None, Some(place)) if !whole => at.sides[guard] = rates.direction(place),
                _ => {}
            }
        }
        self.equation.holds(e, &at)
    }

    /// Whether a condition holds at the very place of a state.
    fn holds_at(&mut self, e: &Expression, x: &[f64]) -> bool {
        self.holds_but(e, x, &[])
    }

    /// The same, with these functions on the sides that they have.
    fn holds_but(&mut self, e: &Expression, x: &[f64], kept: &[usize]) -> bool {
        let now = std::mem::replace(&mut self.x, x.to_vec());
        let mut at = self.config.clone();
        for guard in (0..at.sides.len()).filter(|guard| !kept.contains(guard)) {
            match self.side_of(guard) {
                Some(side) => at.sides[guard] = side,
                None if !self.equation.guards[guard].whole => at.sides[guard] = 0.0,
                None => {}
            }
        }
        self.x = now;
        self.equation.holds(e, &at)
    }

    /// An event of a direction that has happened and changed nothing, since what it turns back has
    /// no speed yet, while the motion goes on through it.
    fn pushes_on(&mut self, fired: &[usize]) -> Option<usize> {
        (0..self.watch_side.len()).find_map(|i| {
            let event = self.event_of[i].filter(|event| fired.contains(event))?;
            let side = self.watch_side[i];
            let through = self.fresh_watch[i] && self.is_beyond(i, side) && !self.touches[i];
            let place = self.compiled.active.len() + i;
            (through && self.direction_after(event, place) != side).then_some(event)
        })
    }

    /// An event that has happened whose condition is false here and true right after, and that
    /// makes it false there as well: it happens infinitely often in no time.
    fn endless(&mut self, definition: &crate::Definition, fired: &[usize]) -> Option<usize> {
        fired.iter().copied().find(|i| {
            let event = &definition.events()[*i];
            let Some(e) = self.equation.conditions[*i].clone() else { return false };
            let goes_on = self.holds[*i] && event.mode.is_none() && !event.set.is_empty();
            let x = self.x.clone();
            if !goes_on || self.holds_at(&e, &x) {
                return false;
            }
            let mut field = vec![0.0; self.n];
            self.rhs(self.t, &x, &mut field);
            let brief = self.brief(&field);
            let t = self.t;
            let mut velocity = |t: f64, x: &[f64]| {
                let mut field = vec![0.0; x.len()];
                self.rhs(t, x, &mut field);
                field
            };
            let ahead = a_little_later(&mut velocity, t, &x, brief);
            let mut after = ahead.clone();
            for (state, value) in &event.set {
                after[*state] = self.equation.value(value, self.t, &ahead);
            }
            self.holds_at(&e, &ahead) && !self.holds_at(&e, &after)
        })
    }

    /// Conditions that hold once events have led from one state to the next, and did not hold at
    /// one of these on the way, or at the last; of an event that is among them, at the last.
    fn true_again(&mut self, fired: &[usize], states: &[Vec<f64>]) -> Vec<usize> {
        let mut found = Vec::new();
        for i in 0..self.equation.conditions.len() {
            let Some(e) = self.equation.conditions[i].clone() else { continue };
            if !self.holds[i] {
                continue;
            }
            // Where it has fired itself only what it has led to counts.
            let states = if fired.contains(&i) { &states[states.len() - 2..] } else { states };
            // A place that the events have not led to is only touched: what they leave alone is on
            // the side to which the motion goes, be it met at this moment.
            let stays = |guard: &usize| {
                let value = &self.equation.guards[*guard].expression;
                let mut values = states.iter().map(|x| self.equation.value(value, self.t, x));
                let first = values.next();
                values.all(|value| Some(value) == first)
            };
            let (mut kept, moved): (Vec<usize>, Vec<usize>) =
                self.equation.of_events[i].iter().copied().partition(stays);
            kept.retain(|guard| !self.sliding.contains(guard));
            let asked = if fired.contains(&i) { &states[1..] } else { states };
            if !moved.is_empty() && !asked.iter().all(|x| self.holds_but(&e, x, &kept)) {
                found.push(i);
            }
        }
        found
    }

    /// Whether a value of a watched expression is on the side that its event passes to.
    pub(super) fn is_beyond(&self, i: usize, value: f64) -> bool {
        let event = self.event_of[i].map(|event| &self.model.definition().events()[event].when);
        match event {
            Some(When::Zero(_, Direction::Up)) => value > 0.0,
            Some(When::Zero(_, Direction::Down)) => value < 0.0,
            _ => false,
        }
    }

    /// The time of a flight at the present speed over a watched expression's surface, into which
    /// the motion is pressed, if rounding hides its height.
    fn flight_in_rounding(&mut self, i: usize) -> Option<f64> {
        const ROUNDINGS: f64 = 1e4;
        let (compiled, rates) = self.rates_of_second_order(&self.config.clone());
        let place = compiled.active.len() + i;
        let (speed, bend) = (rates.first[place].abs(), rates.second[place]);
        let height = 0.5 * speed * speed / bend.abs();
        let hidden = height <= ROUNDINGS * self.grain_of(i, rates.terms[place]);
        (bend * self.watch_side[i] > 0.0 && hidden).then_some(2.0 * speed / bend.abs())
    }

    /// Events that set states in common, on whose surfaces the motion may rest, and between which
    /// it bounces in heights that rounding hides, one of them in `fired` first; with a bound on the
    /// time that it does so.
    fn bounce_in_rounding(
        &mut self,
        definition: &crate::Definition,
        fired: &[usize],
    ) -> Option<(Vec<usize>, f64)> {
        const ROUNDINGS: f64 = 1e4;
        let events = definition.events();
        let first = *fired.iter().find(|i| events[**i].sticks)?;
        let rests = |i: usize| self.contacts.iter().any(|c| c.watched == i);
        let watched = |event: usize| self.event_of.iter().position(|e| *e == Some(event));
        let sets = |event: usize| events[event].set.iter().map(|(state, _)| *state);
        let may = |event: usize| {
            events[event].sticks && watched(event).is_some_and(|i| self.is_asked(i) && !rests(i))
        };
        let mut all = vec![first];
        let mut known = 0;
        while known < all.len() {
            let states: Vec<usize> = sets(all[known]).collect();
            let touches = |event: &usize| sets(*event).any(|state| states.contains(&state));
            let new = |event: &usize| !all.contains(event) && may(*event) && touches(event);
            let new: Vec<usize> = (0..events.len()).filter(new).collect();
            all.extend(new);
            known += 1;
        }
        let is_zero = |event: &usize| {
            let e = watched(*event).map(|i| &self.equation.watched[i]);
            e.is_some_and(|e| {
                self.equation.value(e, self.t, &self.x).abs() <= 1e-12 * self.magnitude(e)
            })
        };
        all.retain(is_zero);
        if all.len() < 2 || all[0] != first {
            return None;
        }
        let places: Vec<usize> = all.iter().filter_map(|event| watched(*event)).collect();
        let (compiled, rates) = self.rates_of_second_order(&self.config.clone());
        let at = |i: usize| (i, compiled.active.len() + i);
        let places: Vec<(usize, usize)> = places.into_iter().map(at).collect();
        let bend = places.iter().fold(0.0_f64, |most, (_, p)| most.max(rates.second[*p].abs()));
        let fastest = places.iter().fold(0.0_f64, |most, (_, p)| most.max(rates.first[*p].abs()));
        // Rounding that hides one flight hides the order of all.
        let grain = |(i, place): &(usize, usize)| self.grain_of(*i, rates.terms[*place]);
        let grain = places.iter().map(grain).fold(0.0, f64::max);
        let hidden = 0.5 * fastest * fastest / bend <= ROUNDINGS * grain;
        (bend > 0.0 && hidden).then_some((all, 2.0 * fastest / bend))
    }

    /// The events at whose surfaces the motion lies, and that a reset turns into them: they are met
    /// at this moment. One that has just happened is so if what happened after it turns it.
    fn blown(
        &mut self,
        definition: &crate::Definition,
        old: &[f64],
        fired: &[usize],
        left_behind: &[Vec<f64>],
    ) -> Result<Vec<usize>, HybridError> {
        let mut found = Vec::new();
        for i in 0..self.watch_side.len() {
            let (Some(event), side) = (self.event_of[i], self.watch_side[i]) else { continue };
            let When::Zero(_, direction) = definition.events()[event].when else { continue };
            let into = match direction {
                Direction::Down => side < 0.0,
                Direction::Up => side > 0.0,
                Direction::Both => side != 0.0,
            };
            let rests = self.held[i] || self.contacts.iter().any(|c| c.watched == i);
            if !into || !self.fresh_watch[i] || rests {
                continue;
            }
            if !self.is_asked(i) {
                continue;
            }
            let before = match fired.iter().position(|f| *f == event) {
                Some(place) => match left_behind.get(place) {
                    Some(x) => x,
                    // It alone has happened, and says itself where motion goes.
                    None => continue,
                },
                None => old,
            };
            let e = &self.equation.watched[i];
            let lay = self.equation.value(e, self.t, before).abs() <= 1e-12 * self.magnitude(e);
            if !lay || before == self.x {
                continue;
            }
            // Rounding of a speed that a blow changes is none.
            const ROUNDING: f64 = 1e-9;
            let config = self.config.clone();
            let (compiled, after) = self.rates(&config);
            let now = std::mem::replace(&mut self.x, before.to_vec());
            let (_, rates) = self.rates(&config);
            self.x = now;
            let place = compiled.active.len() + i;
            let small = ROUNDING * after.first_or_zero(place).abs();
            let went_so = rates.direction(place) == side && !(rates.first[place].abs() < small);
            // Nothing goes through a surface on which it may rest, as what touched there and whose
            // speed was rounding.
            if went_so && !definition.events()[event].sticks {
                continue;
            }
            // An event that does not turn the speed is none of a contact: what leaves its zero has
            // not come to it.
            let turned = self.direction_after(event, place);
            if turned == side || turned == 0.0 && direction == Direction::Both {
                continue;
            }
            if self.tangents.is_some() {
                return Err(self.no_tangents(
                    "what lies at an event's zero is struck through it, where neighbours have no \
                        common linear motion",
                ));
            }
            // A train that holds nothing but this moment goes on without end.
            let train = &self.trains[event].times;
            if train.len() > 60 && train[train.len() - 60] == self.t {
                let why = format!(
                    "{} happens again and again without time passing: describe by one event \
                        what happens there",
                    definition.events()[event].name
                );
                return Err(HybridError::Stuck { t: self.t, x: self.x.clone(), why });
            }
            found.push(event);
        }
        Ok(found)
    }

    /// The way in which a watched value would go on at first order if an event happened a brief
    /// time from now.
    fn direction_after(&mut self, event: usize, place: usize) -> f64 {
        let event = &self.model.definition().events()[event];
        let (watched, mut config) = (place - self.compiled.active.len(), self.config.clone());
        config.mode = event.mode.unwrap_or(config.mode);
        let field = self.velocity();
        let old = self.x.clone();
        let brief = self.brief(&field);
        let ahead: Vec<f64> = old.iter().zip(&field).map(|(x, f)| x + brief * f).collect();
        self.x.copy_from_slice(&ahead);
        for (state, value) in &event.set {
            self.x[*state] = self.equation.value(value, self.t, &ahead);
        }
        let (compiled, rates) = self.rates(&config);
        self.x = old;
        let speed = rates.first_or_zero(compiled.active.len() + watched);
        if speed == 0.0 { 0.0 } else { speed.signum() }
    }

    /// The time of a flight over an event's surface whose height is a thousand roundings of the
    /// event's expression: shorter ones are not resolved. Of a condition's expressions those count
    /// that are zero here.
    fn grain(&mut self, event: usize) -> f64 {
        let (compiled, rates) = self.rates_of_second_order(&self.config.clone());
        if let Some(watched) = self.event_of.iter().position(|e| *e == Some(event)) {
            let e = &self.equation.watched[watched];
            return self.shortest_flight(&rates, compiled.active.len() + watched, e);
        }
        let asked = self.equation.of_events[event].iter();
        asked
            .filter(|guard| self.side_of(**guard).is_none())
            .filter_map(|guard| {
                let place = compiled.place(*guard)?;
                Some(self.shortest_flight(&rates, place, &self.equation.guards[*guard].expression))
            })
            .fold(0.0, f64::max)
    }

    /// The same of a switching function that is zero here.
    fn grain_of_switch(&mut self, guard: usize) -> f64 {
        let (compiled, rates) = self.rates_of_second_order(&self.config.clone());
        let Some(place) = compiled.place(guard) else { return 0.0 };
        self.shortest_flight(&rates, place, &self.equation.guards[guard].expression)
    }

    fn shortest_flight(&self, rates: &Rates, place: usize, e: &Expression) -> f64 {
        let bend = rates.second[place].abs();
        let rounding = 0.25 * self.grain_of_expression(e, rates.terms[place]);
        // A parabola of height bend*g^2/8.
        if bend > 0.0 { (8e3 * rounding / bend).sqrt() } else { 0.0 }
    }

    /// Bodies that lie without a speed at surfaces on which motion may stick, and are pressed
    /// against them, by each other, too, stay there.
    pub(super) fn rest_on_stops(&mut self) -> Result<(), HybridError> {
        let model = self.model;
        let definition = model.definition();
        while let Some(event) = (0..self.watch_side.len()).find_map(|i| self.lies(definition, i)) {
            if !self.stick(definition, &[event], self.t)? {
                break;
            }
            self.hold_guards()?;
        }
        Ok(())
    }

    /// The event of a watched expression at whose surface a body lies and is not in contact yet.
    fn lies(&mut self, definition: &crate::Definition, i: usize) -> Option<usize> {
        let event = self.event_of[i].filter(|event| definition.events()[*event].sticks)?;
        let When::Zero(_, direction) = definition.events()[event].when else { return None };
        let into = match direction {
            Direction::Down => -1.0,
            Direction::Up => 1.0,
            Direction::Both => return None,
        };
        let e = &self.equation.watched[i];
        let is_on = self.equation.value(e, self.t, &self.x).abs() <= 1e-12 * self.magnitude(e);
        if !self.is_asked(i) || !is_on || self.contacts.iter().any(|c| c.watched == i) {
            return None;
        }
        // Functions that are zero with it are so on neither side, or beside it.
        let field = self.velocity();
        let along = self.direction_of_reset(event, i, &field).0;
        let active = self.compiled.active.iter().copied();
        let zero = active.filter(|g| !self.equation.guards[*g].whole && !self.slides[*g]);
        let zero: Vec<usize> = zero.filter(|g| self.side_of(*g).is_none()).collect();
        let mut off = self.sides_off(i, &along, -into, &zero);
        self.ask_new(&mut off);
        let here = self.config.clone();
        (self.is_pressed(here.clone(), i, into) || off != here && self.is_pressed(off, i, into))
            .then_some(event)
    }

    /// Whether in this configuration the motion has no speed at a watched expression's zero and is
    /// pressed into it.
    fn is_pressed(&mut self, config: Configuration, i: usize, into: f64) -> bool {
        let (compiled, rates) = self.rates_of_second_order(&config);
        let place = compiled.active.len() + i;
        let own = self.compiled.active.len() + i;
        let speeds = self.speeds(&rates.field, own);
        let rests = rates.first[place].abs() <= 1e-14 * speeds.max(rates.terms[place]);
        let mut push = rates.second[place];
        if !self.contacts.is_empty() {
            let forces = self.contact_forces(&rates.field);
            for (contact, force) in self.contacts.iter().zip(forces) {
                let direction = self.direction_of(contact, &self.variables);
                push += force * self.second_in(&rates.field, &direction)[own];
            }
        }
        if rests && push == 0.0 && self.contacts.is_empty() && config == self.config {
            push = self.side_ahead(own);
        }
        rests && push * into > 0.0
    }

    /// The size of a watched value's speed where states are as large as they have been.
    pub(super) fn speeds(&self, field: &[f64], place: usize) -> f64 {
        let by = |i: usize| self.second_along(field, Some(i))[place].abs();
        (0..self.n).map(|i| by(i) * self.size[i]).sum()
    }

    /// Keeps the contacts that a reset or a new mode leaves at rest. Returns the events of those
    /// that a reset strikes into their surfaces, which happen at once.
    fn keep_contacts(&mut self, definition: &crate::Definition, old: &[f64]) -> Vec<usize> {
        if self.contacts.is_empty() {
            return Vec::new();
        }
        let config = self.config.clone();
        let (compiled, rates) = self.rates(&config);
        let contacts = std::mem::take(&mut self.contacts);
        let mode = self.config.mode;
        let holds = |c: &Contact| definition.events()[c.event].from.is_none_or(|m| m == mode);
        let rests = |c: &Contact| {
            let e = &self.equation.watched[c.watched];
            let change =
                self.equation.value(e, self.t, old) - self.equation.value(e, self.t, &self.x);
            let place = compiled.active.len() + c.watched;
            let speeds = self.speeds(&rates.field, place);
            change.abs() <= 1e-12 * self.magnitude(e)
                && rates.first[place].abs() <= (1e-9 * rates.terms[place]).max(1e-14 * speeds)
        };
        let (kept, ended): (Vec<Contact>, Vec<Contact>) =
            contacts.into_iter().partition(|c| holds(c) && rests(c));
        let struck = |c: &&Contact| {
            let e = &self.equation.watched[c.watched];
            let on = self.equation.value(e, self.t, &self.x).abs() <= 1e-12 * self.magnitude(e);
            holds(c) && on && rates.first[compiled.active.len() + c.watched] * c.above < 0.0
        };
        let struck = ended.iter().filter(struck).map(|c| c.event).collect();
        self.contacts = kept;
        struck
    }

    /// The direction in which an event's reset changes the state by what the speed of the event's
    /// expression is, at a point where both are zero; and a state that it changes otherwise, too.
    fn direction_of_reset(
        &self,
        event: usize,
        watched: usize,
        field: &[f64],
    ) -> (Vec<f64>, Option<usize>) {
        const NONE: f64 = 1e-9;
        let (n, set) = (self.n, &self.model.definition().events()[event].set);
        let mut unit = vec![0.0; n];
        if let [(state, _)] = set.as_slice() {
            unit[*state] = 1.0;
            return (unit, None);
        }
        // In units of the states' sizes.
        let size = |i: usize| if self.size[i] > 0.0 { self.size[i] } else { 1.0 };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let less = |v: &mut Vec<f64>, unit: &[f64]| {
            let share = dot(v, unit);
            v.iter_mut().zip(unit).for_each(|(v, unit)| *v -= share * unit);
        };
        let normed = |mut v: Vec<f64>| {
            let length = dot(&v, &v).sqrt();
            v.iter_mut().for_each(|v| *v /= length);
            v
        };
        let place = self.compiled.active.len() + watched;
        let across = self.gradients_of(&[(place, 0)]).swap_remove(0);
        let across = normed((0..n).map(|i| across[i] * size(i)).collect());
        let by_state = |i| self.second_along(field, Some(i))[place] * size(i);
        let mut approach: Vec<f64> = (0..n).map(by_state).collect();
        less(&mut approach, &across);
        let approach = normed(approach);
        let change = |v: &[f64]| -> Vec<f64> {
            let along: Vec<f64> = (0..n).map(|i| v[i] * size(i)).collect();
            let change = self.change_by_reset(event, &self.variables, &along);
            (0..n).map(|i| change[i] / size(i)).collect()
        };
        let found = change(&approach);
        let largest = found.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        let otherwise = (0..n).find_map(|i| {
            let mut other = vec![0.0; n];
            other[i] = 1.0;
            less(&mut other, &across);
            less(&mut other, &approach);
            let changed = change(&other);
            (0..n).find(|i| !(changed[*i].abs() <= NONE * largest))
        });
        ((0..n).map(|i| found[i] * size(i) / largest).collect(), otherwise)
    }

    /// The event of a contact changes a state even where the motion rests, or by something else
    /// than the speed of approach: infinitely many such changes have no sum that is known.
    fn changes_at_rest(&self, event: usize, state: usize) -> HybridError {
        let definition = self.model.definition();
        let (name, state) = (&definition.events()[event].name, &definition.states()[state].name);
        let why = format!(
            "{name} may stick (after_zeno = \"stick\"), but its `set` changes {state} otherwise \
                than by the speed at which bodies meet, infinitely often: let it set there only \
                speeds, by laws of restitution, or leave after_zeno out"
        );
        HybridError::Stuck { t: self.t, x: self.x.clone(), why }
    }

    /// Whether the reset of a contact of several states changes them by the speed of approach
    /// alone, at rest nothing.
    fn leaves_rest_alone(&mut self, event: usize) -> Result<(), HybridError> {
        const NONE: f64 = 1e-9;
        let set = &self.model.definition().events()[event].set;
        let Some(watched) = self.event_of.iter().position(|e| *e == Some(event)) else {
            return Ok(());
        };
        if set.len() < 2 {
            return Ok(());
        }
        let field = self.velocity();
        self.watched_values();
        if let (_, Some(state)) = self.direction_of_reset(event, watched, &field) {
            return Err(self.changes_at_rest(event, state));
        }
        let set = &self.model.definition().events()[event].set;
        let moved = |(state, e): &&(usize, Expression)| {
            let after = self.equation.value(e, self.t, &self.x);
            !((after - self.x[*state]).abs() <= NONE * self.size[*state])
        };
        match set.iter().find(moved) {
            Some((state, _)) => Err(self.changes_at_rest(event, *state)),
            None => Ok(()),
        }
    }

    /// Turns the directions by which resets are differentiated to those in which contacts act,
    /// where these have turned away from them.
    fn turn_directions(&mut self) {
        /// Square of a cosine.
        const TURNED: f64 = 0.99;
        for place in 0..self.contacts.len() {
            let contact = &self.contacts[place];
            let Cow::Owned(now) = self.direction_of(contact, &self.variables) else { continue };
            let size = |i: usize| if self.size[i] > 0.0 { self.size[i] } else { 1.0 };
            let dot = |a: &[f64], b: &[f64]| -> f64 {
                (0..self.n).map(|i| (a[i] / size(i)) * (b[i] / size(i))).sum()
            };
            let along = &contact.along;
            let (own, both) = (dot(&now, &now), dot(&now, along));
            if both * both < TURNED * own * dot(along, along) {
                let largest = (0..self.n).fold(0.0_f64, |most, i| most.max(now[i].abs() / size(i)));
                self.contacts[place].along = now.iter().map(|v| v / largest).collect();
            }
        }
    }

    /// Other events on whose surfaces the motion may rest and that accumulate at the same time as
    /// one does, as those of a body between two others.
    fn accumulate_with(
        &mut self,
        definition: &crate::Definition,
        event: usize,
        t: f64,
    ) -> Vec<usize> {
        let events = definition.events();
        let with = |i: usize| {
            let other = self.event_of[i]?;
            let contact = self.contacts.iter().any(|c| c.watched == i);
            if other == event || contact || !events[other].sticks || !self.is_asked(i) {
                return None;
            }
            let (limit, gap) = self.trains[other].limit(self.t)?;
            let e = &self.equation.watched[i];
            let is_near =
                self.equation.value(e, self.t, &self.x).abs() <= DRIFT * self.magnitude(e);
            (is_near && (limit - t).abs() <= gap).then_some(other)
        };
        (0..self.event_of.len()).filter_map(with).collect()
    }

    /// Puts motion at rest on the surfaces of events from `t` on; false if what they set does not
    /// move the expressions' derivatives.
    ///
    /// # Errors
    /// If an event changes something else, too.
    pub(super) fn stick(
        &mut self,
        definition: &crate::Definition,
        events: &[usize],
        t: f64,
    ) -> Result<bool, HybridError> {
        let before = self.contacts.clone();
        let (config, sliding) = (self.config.clone(), self.sliding.clone());
        self.adopt(config, sliding);
        let mut field = vec![0.0; self.n];
        self.compiled.field.evaluate(&self.variables, &mut field);
        for event in events {
            let Some(contact) = self.contact_of(definition, *event, &field) else {
                self.contacts = before;
                return Ok(false);
            };
            self.contacts.retain(|c| c.watched != contact.watched);
            self.contacts.push(contact);
        }
        if !self.contact_forces(&field).iter().all(|f| f.is_finite()) {
            self.contacts = before;
            return Ok(false);
        }
        self.project();
        for event in events {
            self.leaves_rest_alone(*event)?;
        }
        // The remaining time of the infinitely many events.
        let rate = self.velocity();
        let now = self.t;
        for i in 0..self.n {
            self.x[i] += (t - now) * rate[i];
        }
        self.t = t;
        self.project();
        Ok(true)
    }

    /// The contact in which the motion rests on an event's surface.
    fn contact_of(
        &mut self,
        definition: &crate::Definition,
        event: usize,
        field: &[f64],
    ) -> Option<Contact> {
        let watched = self.event_of.iter().position(|e| *e == Some(event))?;
        let When::Zero(_, direction) = definition.events()[event].when else { return None };
        if definition.events()[event].set.is_empty() {
            return None;
        }
        let above = match direction {
            Direction::Up => -1.0,
            Direction::Down => 1.0,
            Direction::Both => {
                if self.watch_side[watched] >= 0.0 {
                    1.0
                } else {
                    -1.0
                }
            }
        };
        let along = self.direction_of_reset(event, watched, field).0.into();
        Some(Contact { event, watched, along, above })
    }

    /// Puts the positions of contacts back onto their surfaces: else a moving one would be above
    /// what rests on it, by the step's error, and would not be met again.
    pub(super) fn place_contacts(&mut self) {
        const ROUNDING: f64 = 4.0 * f64::EPSILON;
        let (values, active) = (self.watched_values(), self.compiled.active.len());
        let off: Vec<f64> = self.contacts.iter().map(|c| values[active + c.watched]).collect();
        let e = |c: &Contact| &self.equation.watched[c.watched];
        let is_on = |(c, off): (&Contact, &f64)| off.abs() <= ROUNDING * self.magnitude(e(c));
        if self.contacts.iter().zip(&off).all(is_on) {
            return;
        }
        let places: Vec<(usize, usize)> =
            self.contacts.iter().map(|c| (active + c.watched, 0)).collect();
        let (rows, gram) = self.ways_to(&places);
        for (row, weight) in rows.iter().zip(solve_any(&gram, &off, 0.0).unwrap_or_default()) {
            self.x.iter_mut().zip(row).for_each(|(x, slope)| *x -= weight * slope);
        }
    }

    /// Puts the state back onto the surfaces that are slid upon, and a contact's derivative to
    /// zero.
    pub(super) fn project(&mut self) {
        if !self.contacts.is_empty() {
            self.place_contacts();
            self.variables[..self.n].copy_from_slice(&self.x);
            self.variables[self.n] = self.t;
            self.turn_directions();
            let mut field = vec![0.0; self.n];
            self.compiled.field.evaluate(&self.variables, &mut field);
            let all = Self::along(&self.compiled, &self.variables, &field);
            let slopes: Vec<f64> = self
                .contacts
                .iter()
                .map(|c| -all[self.compiled.active.len() + c.watched])
                .collect();
            for (contact, change) in self
                .contacts
                .iter()
                .zip(solve_any(&self.grips(&field), &slopes, 0.0).unwrap_or_default())
            {
                let direction = self.direction_of(contact, &self.variables);
                self.x.iter_mut().zip(direction.iter()).for_each(|(x, d)| *x += change * d);
            }
        }
        if self.sliding.is_empty() {
            return;
        }
        for at in 0..self.config.higher.len() {
            self.x = self.where_all_vanish(at).unwrap_or_else(|| self.x.clone());
        }
        let k = self.sliding.len();
        self.variables[..self.n].copy_from_slice(&self.x);
        self.variables[self.n] = self.t;
        let outputs = self.compiled.active.len() + self.equation.watched.len();
        let mut values = vec![0.0; outputs];
        self.compiled.watched.evaluate(&self.variables, &mut values);
        let boundary: Vec<f64> = self
            .sliding
            .iter()
            .map(|g| if self.equation.guards[*g].whole { self.config.sides[*g] + 1.0 } else { 0.0 })
            .collect();
        let off: Vec<f64> = self
            .sliding
            .iter()
            .zip(&boundary)
            .map(|(g, b)| active_value(&self.compiled, &values, *g) - b)
            .collect();
        if off.iter().all(|v| *v == 0.0) && self.tangents.is_none() {
            return;
        }
        // Gradients by states, as far as each surface depends on them.
        let gradients = self.compiled.gradients(&self.variables);
        let all: Vec<Vec<(usize, f64)>> = self
            .sliding
            .iter()
            .map(|guard| {
                let Some(place) = self.compiled.place(*guard) else { return Vec::new() };
                let entries = self.compiled.touches[place]
                    .iter()
                    .copied()
                    .zip(gradients[place].iter().copied());
                entries.filter(|(state, _)| *state < self.n).collect()
            })
            .collect();
        let moves = |(state, slope): &(usize, f64)| {
            *slope != 0.0 && !self.equation.stands_still(*state, self.config.mode)
        };
        let mut rows = all.clone();
        rows.iter_mut().for_each(|row| row.retain(moves));
        // Surfaces that depend on a state together are met together.
        let (mut owner, mut part): (Vec<Option<usize>>, Vec<usize>) =
            (vec![None; self.n], (0..k).collect());
        for (i, row) in rows.iter().enumerate() {
            for (state, _) in row {
                let other = part[*owner[*state].get_or_insert(i)];
                let (from, to) = (part[i].max(other), part[i].min(other));
                if from != to {
                    part.iter_mut().filter(|p| **p == from).for_each(|p| *p = to);
                }
            }
        }
        let mut parts: Vec<Vec<usize>> = vec![Vec::new(); k];
        part.iter().enumerate().for_each(|(i, p)| parts[*p].push(i));
        let dot = |a: &[(usize, f64)], v: &[f64]| {
            a.iter().map(|(state, slope)| slope * v[*state]).sum::<f64>()
        };
        let (mut dense, dependent) = (vec![0.0; self.n], self.dependent);
        let mut onto = |v: &mut [f64], off: &[f64]| {
            for part in parts.iter().filter(|part| !part.is_empty()) {
                let mut gram = Vec::with_capacity(part.len() * part.len());
                for i in part {
                    rows[*i].iter().for_each(|(state, slope)| dense[*state] = *slope);
                    gram.extend(part.iter().map(|j| dot(&rows[*j], &dense)));
                    rows[*i].iter().for_each(|(state, _)| dense[*state] = 0.0);
                }
                let off: Vec<f64> = part.iter().map(|i| off[*i]).collect();
                let weights = if dependent {
                    near_solution(&gram, &off, 0.0).map(|(weights, _)| weights)
                } else {
                    solve_any(&gram, &off, 0.0)
                };
                for (i, weight) in part.iter().zip(weights.unwrap_or_default()) {
                    rows[*i].iter().for_each(|(state, slope)| v[*state] -= weight * slope);
                }
            }
        };
        onto(&mut self.x, &off);
        // Rounding carries tangent vectors off the surface, where nothing shrinks them.
        for y in self.tangents.iter_mut().flat_map(|t| &mut t.vectors) {
            let off: Vec<f64> = all.iter().map(|row| dot(row, y)).collect();
            onto(y, &off);
        }
    }

    /// Whether the motion rests from `t` on at the point that it has come to, or states of it that
    /// do not depend on others. `no_way`: no side leads on.
    pub(super) fn comes_to_rest(&mut self, t: f64, no_way: bool) -> bool {
        let values = self.watched_values();
        let near = self.nearly_zero(&values);
        if near.is_empty() || near.len() > MOST_TOGETHER {
            return false;
        }
        if self.rest_where_zero(t, no_way, &near, &values) {
            return true;
        }
        // Each of several parts that do not see each other by itself.
        struct Part {
            core: Vec<bool>,
            near: Vec<(usize, usize)>,
        }
        let mut parts: Vec<Part> = Vec::new();
        for one in &near {
            let core = self.equation.core(&[one.1], self.config.mode);
            let core = core.unwrap_or_else(|| vec![true; self.n]);
            let mut own = Part { core, near: vec![*one] };
            for part in std::mem::take(&mut parts) {
                if part.core.iter().zip(&own.core).any(|(a, b)| *a && *b) {
                    own.core.iter_mut().zip(&part.core).for_each(|(a, b)| *a |= *b);
                    own.near.extend(part.near);
                } else {
                    parts.push(part);
                }
            }
            parts.push(own);
        }
        parts.len() > 1
            && parts.iter().any(|part| self.rest_where_zero(t, no_way, &part.near, &values))
            || no_way && near.iter().any(|one| self.stops_alone(t, *one, &near, &values))
    }

    /// Whether one function, by place and guard, stops at its zero whatever others do, on all sides
    /// of those that are slid upon, and the motion goes on so.
    fn stops_alone(
        &mut self,
        t: f64,
        one: (usize, usize),
        near: &[(usize, usize)],
        values: &[f64],
    ) -> bool {
        if self.slides[one.1] {
            return false;
        }
        let x = self.nearest_meeting(&[one], values);
        // On both sides of others that are zero, too, and may be on their way.
        let before = (std::mem::replace(&mut self.x, x.clone()), std::mem::replace(&mut self.t, t));
        let others = near.iter().filter(|(_, other)| *other != one.1 && !self.slides[*other]);
        let others: Vec<usize> = others.map(|(_, other)| *other).collect();
        let few = others.len() < MOST_TOGETHER;
        let stays = few
            && (0..1_usize << others.len()).all(|sides| {
                let mut config = self.config.clone();
                for (i, other) in others.iter().enumerate() {
                    config.sides[*other] = if sides >> i & 1 == 1 { 1.0 } else { -1.0 };
                }
                config.sides[one.1] = 0.0;
                self.stays_a_little(&config, one.1)
            });
        (self.x, self.t) = before;
        if !stays {
            return false;
        }
        let mut fields = Vec::new();
        for high in self.sliding.iter().copied().map(Some).chain([None]) {
            for side in [-1.0, 1.0] {
                let mut config = self.config.clone();
                high.iter().for_each(|guard| config.sides[*guard] = self.high(*guard));
                config.sides[one.1] = side;
                let mut variables = self.load(&config);
                variables[..self.n].copy_from_slice(&x);
                let mut field = vec![0.0; self.n];
                self.equation.compiled(&config).field.evaluate(&variables, &mut field);
                fields.push(field);
            }
        }
        let left = self.options.t_end - t;
        self.stops_at_equality(t, &x, &[one], &fields, left)
    }

    /// Whether the motion rests where the functions `near`, by place and guard, are zero: a mixture
    /// of the fields around it vanishes, and none of the fields leads away on its own side. If so
    /// the state is put there. States that these functions do not depend on may move on.
    fn rest_where_zero(
        &mut self,
        t: f64,
        no_way: bool,
        near: &[(usize, usize)],
        values: &[f64],
    ) -> bool {
        let n = self.n;
        let largest = self.size.iter().fold(0.0_f64, |most, s| most.max(*s));
        let guards: Vec<usize> = near.iter().map(|(_, guard)| *guard).collect();
        let Some(core) = self.equation.core(&guards, self.config.mode) else { return false };
        let whole = core.iter().all(|of| *of);
        if whole && self.equation.events_see_time() || !whole && self.tangents.is_some() {
            return false;
        }
        let known: Vec<(usize, usize)> =
            near.iter().copied().filter(|(place, _)| values[*place].is_finite()).collect();
        let x = self.nearest_meeting(&known, values);
        let velocity = |config: &Configuration, x: &[f64], follower: &Self| {
            let mut v = follower.load(config);
            v[..n].copy_from_slice(x);
            let mut f = vec![0.0; n];
            follower.equation.compiled(config).field.evaluate(&v, &mut f);
            f
        };
        let cells = self.cells_of(&guards);
        let vertices: Vec<usize> =
            cells.map_or((0..1 << near.len()).collect(), |cells| cells.patterns);
        let of_sides = |vertex: usize| {
            let mut config = self.config.clone();
            for (i, guard) in guards.iter().enumerate() {
                config.sides[*guard] = if vertex >> i & 1 == 1 { 1.0 } else { -1.0 };
            }
            self.follow_sides(&mut config, &guards);
            config
        };
        let configs: Vec<Configuration> = vertices.into_iter().map(of_sides).collect();
        let fields: Vec<Vec<f64>> =
            configs.iter().map(|config| velocity(config, &x, self)).collect();
        let left = self.options.t_end - t;
        if no_way && self.stops_at_equality(t, &x, near, &fields, left) {
            return true;
        }
        if !fields.iter().flatten().all(|f| f.is_finite()) {
            return false;
        }
        // States that hardly move on any side until the run ends rest.
        let fastest: Vec<f64> =
            (0..n).map(|i| fields.iter().fold(0.0_f64, |most, f| most.max(f[i].abs()))).collect();
        let moves: Vec<usize> = (0..n)
            .filter(|i| core[*i] && fastest[*i] * left > 1e-8 * self.size[*i].max(1e-3 * largest))
            .collect();
        let parts: Vec<Vec<f64>> =
            fields.iter().map(|f| moves.iter().map(|i| f[*i] / fastest[*i]).collect()).collect();
        // If mixtures differ, only one that all surfaces hold is known to stay.
        // Nor are all mixtures there of functions with one zero, whose sides belong together.
        let all_there = || settling::independent(&self.gradients_of(near));
        if (!all_there() || mixtures_differ(&parts)) && !self.holds_still(near, &moves) {
            return false;
        }
        if !nearest_of_hull(&parts).iter().all(|v| v.abs() <= 1e-6) {
            return false;
        }
        if let [(_, a), (_, b)] = near
            && self.turns_away(&x, [*a, *b])
        {
            return false;
        }
        // A field that leads to its own side for a short time leads away.
        let brief = 1e-4 * moves.iter().map(|i| self.size[*i] / fastest[*i]).fold(left, f64::min);
        for config in configs {
            let there = a_little_later(&mut |_, x| velocity(&config, x, self), t, &x, brief);
            let mut v = self.load(&config);
            v[..n].copy_from_slice(&there);
            let compiled = self.equation.compiled(&config);
            let mut watched = vec![0.0; compiled.outputs];
            compiled.watched.evaluate(&v, &mut watched);
            let leads_away = near.iter().all(|(_, guard)| {
                let beyond = active_value(&compiled, &watched, *guard) * config.sides[*guard];
                beyond > 1e-14 * self.magnitude(&self.equation.guards[*guard].expression)
            });
            if leads_away {
                return false;
            }
        }
        if whole {
            (self.x, self.t, self.rests) = (x, t, true);
            self.sliding = guards;
            self.adopt(self.config.clone(), self.sliding.clone());
            return true;
        }
        // The others move on, if they do not see on which sides of these functions the motion has
        // been.
        let others = |i: &usize| !core[*i];
        let alike =
            |i: usize| fields.iter().all(|field| field[i] == fields[0][i] && field[i].is_finite());
        if !(0..n).filter(others).all(alike) {
            return false;
        }
        let mut config = self.config.clone();
        config.still.extend((0..n).filter(|i| core[*i]));
        config.still.sort_unstable();
        config.still.dedup();
        let moved = velocity(&config, &x, self);
        let sliding: Vec<usize> =
            self.sliding.iter().copied().filter(|guard| !guards.contains(guard)).collect();
        let brief = t - self.t;
        self.x = (0..n).map(|i| x[i] + brief * moved[i]).collect();
        self.t = t;
        self.part_rests = true;
        self.adopt(config, sliding);
        true
    }

    /// Functions that the fields on no side move from their zero, as those of an empty tank, rest
    /// there, and comparisons see equality, whatever else moves. Whether the motion goes on so.
    fn stops_at_equality(
        &mut self,
        t: f64,
        x: &[f64],
        near: &[(usize, usize)],
        fields: &[Vec<f64>],
        left: f64,
    ) -> bool {
        let n = self.n;
        let mut config = self.config.clone();
        near.iter().for_each(|(_, guard)| config.sides[*guard] = 0.0);
        let compiled = self.equation.compiled(&config);
        let mut variables = self.load(&config);
        variables[..n].copy_from_slice(x);
        variables[n] = t;
        let mut field = vec![0.0; n];
        compiled.field.evaluate(&variables, &mut field);
        let gradients = self.gradients_of(near);
        let stands = |field: &[f64]| {
            near.iter().zip(&gradients).all(|((_, guard), gradient)| {
                let rate: f64 = gradient.iter().zip(field).map(|(g, f)| g * f).sum();
                let size = self.magnitude(&self.equation.guards[*guard].expression);
                rate.abs() * left <= 1e-8 * size
            })
        };
        let finite = |field: &&Vec<f64>| field.iter().all(|f| f.is_finite());
        if !(finite(&&field) && stands(&field) && fields.iter().filter(finite).all(|f| stands(f))) {
            return false;
        }
        // Not only at this point, as at a two-fold.
        let before =
            (std::mem::replace(&mut self.x, x.to_vec()), std::mem::replace(&mut self.t, t));
        let stay = near.iter().all(|(_, guard)| self.stays_a_little(&config, *guard));
        (self.x, self.t) = before;
        if !stay {
            return false;
        }
        let sliding: Vec<usize> =
            self.sliding.iter().copied().filter(|g| near.iter().all(|(_, o)| o != g)).collect();
        (self.x, self.t) = (x.to_vec(), t);
        let size = |i: usize| self.size[i].max(1e-3 * self.size.iter().fold(0.0, |a, b| b.max(a)));
        let sees_time = self.equation.depends_on_time() || self.equation.events_see_time();
        self.rests = !sees_time
            && sliding.is_empty()
            && self.contacts.is_empty()
            && (0..n).all(|i| field[i].abs() * left <= 1e-8 * size(i));
        self.adopt(config, sliding);
        true
    }

    /// The functions that are zero but for a millionth of the states, by place and guard.
    pub(super) fn nearly_zero(&self, values: &[f64]) -> Vec<(usize, usize)> {
        let largest = self.size.iter().fold(0.0_f64, |most, s| most.max(*s));
        let active = self.compiled.active.iter().copied().enumerate();
        // On the wrong side of another a function may have no value.
        let near = |(place, guard): &(usize, usize)| {
            !self.equation.guards[*guard].whole
                && !self.equation.rests(*guard, &self.config)
                && !(values[*place].abs() > 1e-6 * largest)
        };
        active.filter(near).collect()
    }

    /// Whether switches that accumulate come together where several functions are zero. If they are
    /// zero to rounding the motion goes on from there, as the fields decide; else its turns do.
    fn comes_to_meeting(&mut self) -> Result<bool, HybridError> {
        let values = self.watched_values();
        let near = self.nearly_zero(&values);
        if near.len() < 2 {
            return Ok(false);
        }
        let rounding =
            |e: &Expression| 1e3 * f64::EPSILON * self.magnitude(e).max(self.terms_now(e));
        let at = |(place, guard): &(usize, usize)| {
            values[*place].abs() <= rounding(&self.equation.guards[*guard].expression)
        };
        if near.iter().all(at) {
            self.x = self.nearest_meeting(&near, &values);
            let zero: Vec<usize> = near.iter().map(|(_, guard)| *guard).collect();
            self.settle(&zero)?;
        }
        Ok(true)
    }

    /// Whether motion slides on from where all the functions are zero about which its turns, over
    /// at the time `limit`, are not resolved any more, as about a target that moves. It is not
    /// farther away than the motion goes until then.
    fn stays_at_meeting(&mut self, limit: f64) -> bool {
        /// Fields on other sides may be so many times as fast.
        const FASTER: f64 = 10.0;
        let values = self.watched_values();
        let near = self.nearly_zero(&values);
        if near.len() < 2 {
            return false;
        }
        let x = self.nearest_meeting(&near, &values);
        let field = self.velocity();
        let here = self.x.clone();
        let fastest = field.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
        let reach = FASTER * fastest * (limit - self.t);
        if x.iter().zip(&here).any(|(a, b)| !((a - b).abs() <= reach)) {
            return false;
        }
        let before = (self.config.clone(), self.sliding.clone(), std::mem::replace(&mut self.x, x));
        let marks = (self.along.clone(), self.fresh_guard.clone(), self.tangent_guard.clone());
        let zero: Vec<usize> = near.iter().map(|(_, guard)| *guard).collect();
        if self.settle(&zero).is_ok() && zero.iter().all(|guard| self.sliding.contains(guard)) {
            return true;
        }
        self.x = before.2;
        self.adopt(before.0, before.1);
        (self.along, self.fresh_guard, self.tangent_guard) = marks;
        false
    }

    /// Whether motion that comes to the zero of a switching function again and again slides on that
    /// zero and on those of its derivatives that the sides do not change: sliding of higher order
    /// (Levant 1993). It begins once rounding is seen in its turns about the zero.
    pub(super) fn slides_in_higher_order(&mut self, guard: usize) -> Result<bool, HybridError> {
        /// Turns of more times the rounding of the switching function are resolved.
        const SEEN: f64 = 1e5;
        /// A derivative of so many times its own rounding may be zero.
        const NOISE: f64 = 16.0;
        /// Speeds that differ by no more may be one but for a root of rounding.
        const ALIKE: f64 = 0.1;
        let mut config = self.config.clone();
        let own = &self.equation.guards[guard];
        if config.higher.contains(&guard) || own.whole || own.kink {
            return Ok(false);
        }
        // Its own speed is one on both sides; of most functions it is not. (A root has no value on
        // the wrong side.)
        let plain = config.clone();
        let [up, down] = [1.0, -1.0].map(|side| self.beside(guard, &plain, side, 0.0));
        let (Some((_, up, _)), Some((_, down, _))) = (up, down) else { return Ok(false) };
        if (up - down).abs() > ALIKE * (up.abs() + down.abs()) {
            return Ok(false);
        }
        config.higher.push(guard);
        let at = config.higher.len() - 1;
        let compiled = self.equation.compiled(&config);
        let Some((program, outputs)) = &compiled.derivatives[at] else { return Ok(false) };
        let turns = self.switch_trains[guard].turns();
        let left = match outputs {
            2 => turns.or_else(|| self.brakes(guard, &config, &plain)),
            _ => turns,
        };
        let (Some(left), Some(turned)) = (left, self.turned(guard, &plain)) else {
            return Ok(false);
        };
        let rows = self.slopes_by_size(program, *outputs, &self.load(&config));
        let rounding =
            |row: &[f64]| row.iter().map(|slope| 4.0 * f64::EPSILON * slope.abs()).sum::<f64>();
        // Steps beside a cube root end earlier.
        let seen = if *outputs > 2 { 10.0 * SEEN } else { SEEN };
        let mut scale = 1.0;
        let resolved = rows.iter().any(|(value, row)| {
            let turn = (value * scale).abs();
            scale *= left;
            !(turn <= seen * rounding(&rows[0].1) || value.abs() <= NOISE * rounding(row))
        });
        if resolved {
            return Ok(false);
        }
        let before = (self.config.clone(), self.sliding.clone(), self.x.clone());
        let marks = (self.along.clone(), self.fresh_guard.clone(), self.tangent_guard.clone());
        let mut sliding = self.sliding.clone();
        sliding.push(guard);
        sliding.sort_unstable();
        self.adopt(config, sliding);
        self.turned.retain(|(other, _)| *other != guard);
        self.turned.push((guard, turned));
        if let Some(x) = self.where_all_vanish(at) {
            self.x = x;
            let none = vec![false; self.slides.len()];
            let decided = self.decide(&self.sliding.clone(), &none).is_ok();
            if decided && self.config.higher.contains(&guard) {
                if self.tangents.is_some() {
                    return Err(self.no_tangents_in_higher_order());
                }
                return Ok(true);
            }
        }
        self.x = before.2;
        self.adopt(before.0, before.1);
        (self.along, self.fresh_guard, self.tangent_guard) = marks;
        Ok(false)
    }

    /// The time after which sliding of second order has begun, by the speed with which the sides
    /// turn the motion back; none if they do not, or if they do not brake it, either, as the root
    /// of super-twisting does. `config` is the one that slides, `plain` the one before.
    fn brakes(
        &mut self,
        guard: usize,
        config: &Configuration,
        plain: &Configuration,
    ) -> Option<f64> {
        let (speed, up, _) = self.beside(guard, config, -1.0, 0.0)?;
        let (_, down, _) = self.beside(guard, config, 1.0, 0.0)?;
        let above = self.beside(guard, plain, 1.0, BESIDE)?.1;
        let below = self.beside(guard, plain, -1.0, -BESIDE)?.1;
        (up > 0.0 && down < 0.0 && above < below).then(|| speed.abs() / up.min(-down))
    }

    /// A switching function, its rate and the field on one side of its zero, as far away as
    /// `beside` says in units of the states.
    fn beside(
        &mut self,
        guard: usize,
        config: &Configuration,
        side: f64,
        beside: f64,
    ) -> Option<(f64, f64, Vec<f64>)> {
        let mut config = config.clone();
        config.sides[guard] = side;
        self.follow_sides(&mut config, &[guard]);
        let compiled = self.equation.compiled(&config);
        let place = compiled.place(guard)?;
        let mut variables = self.load(&config);
        let gradients = compiled.gradients(&variables);
        for (i, slope) in compiled.touches[place].iter().zip(&gradients[place]) {
            if *i < self.n {
                variables[*i] += beside * slope.signum() * self.width(*i);
            }
        }
        let mut field = vec![0.0; self.n];
        compiled.field.evaluate(&variables, &mut field);
        let mut out = vec![0.0; compiled.outputs];
        compiled.watched.evaluate(&variables, &mut out);
        let rate = Self::along(&compiled, &variables, &field)[place];
        Some((out[place], rate, field))
    }

    /// The states whose speeds differ by the side of a switching function.
    fn turned(&mut self, guard: usize, plain: &Configuration) -> Option<Vec<bool>> {
        let [up, down] = [1.0, -1.0].map(|side| self.beside(guard, plain, side, BESIDE));
        let (up, down) = (up?.2, down?.2);
        // The root of |h| has no value on the wrong side.
        let differ = |(a, b): (&f64, &f64)| !((a - b).abs() <= BESIDE * (a.abs() + b.abs()));
        Some(up.iter().zip(&down).map(differ).collect())
    }

    /// Whether a state is moved by the sides of what is slid upon in higher order, and put where
    /// that vanishes after each step.
    pub(super) fn is_put(&self, state: usize) -> bool {
        let slid =
            |(guard, by): &(usize, Vec<bool>)| by[state] && self.config.higher.contains(guard);
        self.turned.iter().any(slid)
    }

    /// A state's size, or a part of the largest one's; one where all have been zero.
    pub(super) fn width(&self, i: usize) -> f64 {
        let largest = self.size.iter().fold(0.0_f64, |most, size| most.max(*size));
        if largest > 0.0 { self.size[i].max(1e-3 * largest) } else { 1.0 }
    }

    /// Values of a program and their slopes by the states, each times the state's size.
    fn slopes_by_size(
        &self,
        program: &twofold_num::tape::Program,
        outputs: usize,
        variables: &[f64],
    ) -> Vec<(f64, Vec<f64>)> {
        let mut rows = vec![(0.0, vec![0.0; self.n]); outputs];
        let mut out = vec![Dual::<f64, 1>::constant(0.0); outputs];
        for i in 0..self.n {
            let mut duals: Vec<_> = variables.iter().map(|v| Dual::constant(*v)).collect();
            duals[i].partials[0] = self.width(i);
            program.evaluate(&duals, &mut out);
            for ((value, row), found) in rows.iter_mut().zip(&out) {
                (*value, row[i]) = (found.value, found.partials[0]);
            }
        }
        rows
    }

    /// The nearest point at which a function that is slid upon in higher order, and its
    /// derivatives, are zero, by Newton's method; none if it ends nowhere. Only states that its
    /// sides move are changed.
    fn where_all_vanish(&self, at: usize) -> Option<Vec<f64>> {
        const MOST: usize = 8;
        let (program, outputs) = self.compiled.derivatives.get(at)?.as_ref()?;
        let (_, by) = self.turned.iter().find(|(guard, _)| *guard == self.config.higher[at])?;
        let mut variables = self.load(&self.config);
        for _ in 0..MOST {
            let mut rows = self.slopes_by_size(program, *outputs, &variables);
            for (_, row) in &mut rows {
                row.iter_mut().zip(by).filter(|(_, by)| !**by).for_each(|(v, _)| *v = 0.0);
            }
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let gram: Vec<f64> =
                rows.iter().flat_map(|a| rows.iter().map(|b| dot(&a.1, &b.1))).collect();
            let off: Vec<f64> = rows.iter().map(|(value, _)| *value).collect();
            let found = solve_any(&gram, &off, 0.0)?;
            let mut moved = 0.0_f64;
            for i in 0..self.n {
                let change: f64 = rows.iter().zip(&found).map(|((_, row), v)| row[i] * v).sum();
                variables[i] -= self.width(i) * change;
                moved = moved.max(change.abs());
            }
            if !moved.is_finite() {
                return None;
            }
            if moved <= 4.0 * f64::EPSILON {
                break;
            }
        }
        // Rounding that is left of a state at zero is no size.
        for (i, x) in variables.iter_mut().enumerate().take(self.n) {
            if x.abs() < f64::EPSILON * f64::EPSILON * self.width(i) {
                *x = 0.0;
            }
        }
        variables.truncate(self.n);
        Some(variables)
    }

    /// The gradients of functions, by place and guard, in the states at the present point.
    fn gradients_of(&self, near: &[(usize, usize)]) -> Vec<Vec<f64>> {
        let gradients = self.compiled.gradients(&self.variables);
        let dense = |(place, _): &(usize, usize)| {
            let mut row = vec![0.0; self.n];
            for (variable, slope) in self.compiled.touches[*place].iter().zip(&gradients[*place]) {
                if *variable < self.n {
                    row[*variable] = *slope;
                }
            }
            row
        };
        near.iter().map(dense).collect()
    }

    /// The gradients without the states that stand still, since such a number may be compared
    /// elsewhere, and the products of these rows; 1 for the square of one in which nothing is left.
    fn ways_to(&self, near: &[(usize, usize)]) -> (Vec<Vec<f64>>, Vec<f64>) {
        let mut rows = self.gradients_of(near);
        let still = |i: &usize| self.equation.stands_still(*i, self.config.mode);
        for i in (0..self.n).filter(still) {
            rows.iter_mut().for_each(|row| row[i] = 0.0);
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut gram: Vec<f64> = rows.iter().flat_map(|a| rows.iter().map(|b| dot(a, b))).collect();
        for (i, row) in rows.iter().enumerate() {
            if row.iter().all(|slope| *slope == 0.0) {
                gram[i * rows.len() + i] = 1.0;
            }
        }
        (rows, gram)
    }

    /// Whether these functions cannot all stay zero while one of these states moves: their
    /// gradients span the states' directions.
    fn holds_still(&self, near: &[(usize, usize)], moves: &[usize]) -> bool {
        let mut rows: Vec<Vec<f64>> = self
            .gradients_of(near)
            .iter()
            .map(|row| moves.iter().map(|i| row[*i] * self.size[*i]).collect())
            .collect();
        for column in 0..moves.len() {
            let size = |row: &Vec<f64>| row.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            rows.retain(|row| size(row) > 0.0);
            rows.iter_mut().for_each(|row| {
                let size = size(row);
                row.iter_mut().for_each(|v| *v /= size);
            });
            let Some(at) = (0..rows.len())
                .max_by(|a, b| rows[*a][column].abs().total_cmp(&rows[*b][column].abs()))
            else {
                return false;
            };
            let pivot = rows.swap_remove(at);
            if !(pivot[column].abs() > 1e-9) {
                return false;
            }
            for row in &mut rows {
                let factor = row[column] / pivot[column];
                row.iter_mut().zip(&pivot).for_each(|(v, p)| *v -= factor * p);
            }
        }
        true
    }

    /// The point where the functions in `near`, by place and guard, are zero, that is nearest to
    /// the state; the state itself where that is not to be had.
    pub(super) fn nearest_meeting(&mut self, near: &[(usize, usize)], values: &[f64]) -> Vec<f64> {
        let (rows, gram) = self.ways_to(near);
        let off: Vec<f64> = near.iter().map(|(place, _)| values[*place]).collect();
        let mut x = self.x.clone();
        for (row, weight) in rows.iter().zip(solve_any(&gram, &off, 0.0).unwrap_or_default()) {
            x.iter_mut().zip(row).for_each(|(x, r)| *x -= weight * r);
        }
        let largest = self.size.iter().fold(0.0_f64, |most, s| most.max(*s));
        let moved = x.iter().zip(&self.x).all(|(a, b)| (a - b).abs() <= 1e-5 * largest);
        if moved { x } else { self.x.clone() }
    }

    /// Puts a state that slides where a switching function that is met is zero, too, if the way
    /// back to the surface has led before that zero: it would be met again and again.
    pub(super) fn put_where_met(&mut self, met: &[Sought]) {
        let values = self.watched_values();
        let mut places = Vec::new();
        for sought in met {
            let Sought::Guard { guard, .. } = *sought else { continue };
            let Some(place) = self.compiled.place(guard) else { continue };
            let before = values[place] * self.config.sides[guard] > 0.0;
            if before && !self.slides[guard] && !self.equation.guards[guard].whole {
                places.push((place, guard));
            }
        }
        let sliding = self.sliding.iter().filter(|guard| !self.equation.guards[**guard].whole);
        let sliding = sliding.filter_map(|guard| Some((self.compiled.place(*guard)?, *guard)));
        if !places.is_empty() {
            places.extend(sliding);
            self.x = self.nearest_meeting(&places, &values);
        }
    }

    /// Lets the state rest until a time; says whether more is wanted.
    pub(super) fn rest_until(
        &mut self,
        end: f64,
        observe: &mut dyn FnMut(&Point) -> bool,
    ) -> Result<bool, HybridError> {
        if self.tangents.is_some() {
            return Err(self.no_tangents(
                "the motion comes to rest, where neighbours have no common linear motion",
            ));
        }
        match self.options.record {
            Record::Section(_) => {}
            Record::Path { .. } => {
                if !self.emit(self.t, None, observe) || !self.emit(end, None, observe) {
                    return Ok(false);
                }
            }
            Record::Times { every } => {
                while self.next_record <= end {
                    if !self.emit(self.next_record, None, observe) {
                        return Ok(false);
                    }
                    self.next_record = ((self.next_record / every).round() + 1.0) * every;
                }
            }
        }
        self.t = end;
        Ok(true)
    }
}
