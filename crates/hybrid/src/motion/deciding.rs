//! Where motion goes from points at which switching functions are zero.

use std::cell::Cell;
use std::collections::HashMap;
use std::ops::ControlFlow;

use super::settling::{MOST_CORNERS, SEVERAL_VELOCITIES, others, side_of};
use super::*;
use crate::equation::same_sign;

/// Fields that move a state in a run by more than this part of its size apart are no rounding of
/// one.
const CLEAR_JUMP: f64 = 1e-3;
/// Functions that meet of which all sides are tried to see which depend on each other.
const MOST_TRIED: usize = 4;

/// A reason why motion on several surfaces is not decided.
const TURNS_AWAY: &str = "it may stay, or turn away by infinitely many switches at any time";

/// Whether all of these fields move one of the functions the same way, as a clock: no mixture of
/// them stays on it. `speeds` has a row a field.
fn some_move_one_way(speeds: &[Vec<f64>]) -> bool {
    let all = |i: usize, sign: f64| speeds.iter().all(|speeds| sign * speeds[i] > 0.0);
    (0..speeds[0].len()).any(|i| all(i, 1.0) || all(i, -1.0))
}

/// Switching functions that are zero at one moment, and are decided.
struct Meeting {
    guards: Vec<usize>,
    /// Their sides below and above.
    lows: Vec<f64>,
    highs: Vec<f64>,
    /// Whether some of them rested on one of the sides that were tried, or moved by rounding alone.
    some_rest: Cell<bool>,
    some_noise: Cell<bool>,
}

/// The equations with each function of a meeting on one side.
struct Vertex {
    config: Configuration,
    /// The functions' places among the values, and what these do.
    place: Vec<Option<usize>>,
    rates: Rates,
    /// Which functions the equations ask.
    asked: Vec<bool>,
}

/// The rates of the functions of a set where each of them is on one side.
struct Corner {
    field: Vec<f64>,
    first: Vec<f64>,
    first_or_zero: Vec<f64>,
    /// The sign with which the function leaves zero; 0 if it stays.
    direction: Vec<f64>,
    asked: Vec<bool>,
    /// Whether the equations keep the function at zero on this side.
    rests: Vec<bool>,
}

/// Functions of a meeting that depend on each other.
struct Set<'a> {
    meeting: &'a Meeting,
    /// Their places in the meeting.
    members: &'a [usize],
    /// Which functions of the meeting are known to be on their upper sides.
    decided: Vec<bool>,
    corners: HashMap<Vec<bool>, Rc<Corner>>,
    /// Why more than one motion is possible, if so.
    open: Option<&'static str>,
    /// A rule chooses among velocities although the fields are sums of what each side adds.
    by_rule: bool,
}

impl Set<'_> {
    fn len(&self) -> usize {
        self.members.len()
    }

    fn guard(&self, i: usize) -> usize {
        self.meeting.guards[self.members[i]]
    }

    fn guards(&self) -> Vec<usize> {
        (0..self.len()).map(|i| self.guard(i)).collect()
    }

    /// Whether a function of the meeting is on its upper side, if those of the set are on these.
    fn is_high(&self, plus: &[bool], i: usize) -> bool {
        match self.members.iter().position(|member| *member == i) {
            Some(place) => plus[place],
            None => self.decided[i],
        }
    }
}

/// One assignment of ways to the functions of a set, and their rates by it.
struct Trial<'a> {
    ways: &'a [Way],
    /// The functions that stay at zero.
    slides: Vec<usize>,
    /// Which functions are on their upper sides; those that stay are below.
    plus: Vec<bool>,
    base: Rc<Corner>,
    /// With one function that stays above, each in turn.
    columns: Vec<Rc<Corner>>,
    /// Functions whose side others' sides set.
    jumped: Vec<bool>,
    asked: Vec<bool>,
}

impl Trial<'_> {
    /// Whether a function that moves so goes the way that is assigned.
    fn goes(&self, i: usize, rate: f64) -> bool {
        match self.ways[i] {
            _ if self.jumped[i] => true,
            Way::Plus => rate > 0.0 || rate == 0.0 && self.base.rests[i],
            // A function that is not asked there and stays zero changes nothing.
            Way::Minus => rate < 0.0 || rate == 0.0 && (!self.asked[i] || self.base.rests[i]),
            Way::Stay => true,
        }
    }

    /// The functions that do not stay.
    fn moving(&self) -> impl Iterator<Item = usize> {
        (0..self.ways.len()).filter(|i| self.ways[*i] != Way::Stay)
    }

    /// The functions' sides, with those that stay by the bits of a pattern.
    fn with(&self, pattern: usize) -> Vec<bool> {
        let mut on = self.plus.clone();
        self.slides.iter().enumerate().for_each(|(i, s)| on[*s] = pattern >> i & 1 == 1);
        on
    }

    /// Of a corner's numbers those of the functions that stay.
    fn own(&self, rates: &[f64]) -> Vec<f64> {
        self.slides.iter().map(|s| rates[*s]).collect()
    }
}

/// The linear equations of the weights of functions that stay, and their solution.
struct Weights<'a> {
    matrix: &'a [f64],
    solution: Option<&'a [f64]>,
    /// The equations have no only solution.
    dependent: bool,
}

/// Functions that stay where one side's field runs along the surface, with that side's sign.
type Edges = Vec<(usize, f64)>;

impl Follower<'_> {
    /// As [`Follower::settle`], where what is slid upon is decided, too, but for the guards in
    /// `kept`.
    pub(super) fn decide(&mut self, zero: &[usize], kept: &[bool]) -> Result<(), HybridError> {
        self.rests = false;
        // Only what the equations ask here; what they do not ask keeps its side until it is asked.
        let mut zero: Vec<usize> =
            zero.iter().copied().filter(|g| self.compiled.place(*g).is_some()).collect();
        self.add_what_is_zero(&mut zero);
        zero.retain(|guard| !self.guard_held[*guard]);
        self.add_what_follows(&mut zero);
        zero.retain(|guard| !self.left_out.contains(guard));
        if self.decide_without_kinks(&zero, kept) {
            return Ok(());
        }
        self.keep_own_ways(&mut zero);
        if zero.is_empty() {
            let config = self.config.clone();
            self.adopt(config, Vec::new());
            return Ok(());
        }
        let values = self.watched_values();
        let before: Vec<f64> =
            zero.iter().map(|g| self.compiled.place(*g).map_or(f64::NAN, |p| values[p])).collect();
        let meeting = Meeting {
            lows: zero.iter().map(|g| self.low(*g)).collect(),
            highs: zero.iter().map(|g| self.high(*g)).collect(),
            guards: zero,
            some_rest: Cell::new(false),
            some_noise: Cell::new(false),
        };
        let k = meeting.guards.len();
        let sets = self.sets_of(&meeting);
        let mut ways = vec![Way::Plus; k];
        let mut by_rule = false;
        for (done, members) in sets.iter().enumerate() {
            if members.iter().all(|i| kept[meeting.guards[*i]]) {
                members.iter().for_each(|i| ways[*i] = Way::Stay);
                continue;
            }
            let mut decided = vec![false; k];
            let before = sets[..done].iter().flatten();
            before.for_each(|i| decided[*i] = ways[*i] == Way::Plus);
            let (meeting, corners) = (&meeting, HashMap::new());
            let mut set = Set { meeting, members, decided, corners, open: None, by_rule: false };
            let Some(found) = self.decide_set(&mut set, kept)? else { return Ok(()) };
            members.iter().zip(found).for_each(|(i, way)| ways[*i] = way);
            by_rule |= set.by_rule;
        }
        let differ = self.velocities_are_chosen(&meeting, &ways, by_rule)?;
        self.take_ways(&meeting, &ways);
        let zero = meeting.guards;
        let left = self.leave_by_jump(&zero, &before);
        if !left.is_empty() {
            let rest: Vec<usize> = zero.into_iter().filter(|g| !left.contains(g)).collect();
            self.decide(&rest, &vec![false; self.slides.len()])?;
            return self.follow_jumps(&rest);
        }
        if self.dependent && self.tangents.is_some() {
            return Err(self.no_tangents(
                "the motion slides on surfaces that depend on each other, where neighbours have \
                    no common linear motion",
            ));
        }
        if differ {
            self.begin_mixture()?;
        }
        if let Err(open) = self.no_side_is_left_open(&zero) {
            let undecided = self.options.intersection == Intersection::Undecided;
            return if undecided && self.comes_to_rest(self.t, true) { Ok(()) } else { Err(open) };
        }
        self.follow_jumps(&zero)
    }

    /// Leaves out the functions that have no way of their own, as they follow others. Where the
    /// only one left moves by rounding alone, those that are zero to rounding are decided with it.
    fn keep_own_ways(&mut self, zero: &mut Vec<usize>) {
        // Functions that only others' sides move follow those.
        if !zero.iter().all(|guard| self.equation.guards[*guard].of_sides) {
            zero.retain(|guard| !self.equation.guards[*guard].of_sides);
        }
        if self.equation.has_domain_ends {
            self.put_into_domain(zero);
        }
        if zero.len() != 1 {
            return;
        }
        let config = self.config.clone();
        let (compiled, mut rates) = self.rates(&config);
        if self.drop_noise(&config, &compiled, zero, &mut rates) {
            let is_new = |guard: &usize| {
                !zero.contains(guard)
                    && !self.slides[*guard]
                    && !self.guard_held[*guard]
                    && self.side_of(*guard).is_none()
            };
            let new: Vec<usize> = self.compiled.active.iter().copied().filter(is_new).collect();
            zero.extend(new);
        }
    }

    /// The equations with these functions of a meeting on their upper sides, the others below.
    fn vertex(&mut self, meeting: &Meeting, plus: &dyn Fn(usize) -> bool) -> Vertex {
        let zero = &meeting.guards;
        let mut config = self.config.clone();
        for (i, guard) in zero.iter().enumerate() {
            config.sides[*guard] = if plus(i) { meeting.highs[i] } else { meeting.lows[i] };
        }
        if self.equation.has_domain_ends {
            // Roots of what is zero here have values on both sides, whatever rounding makes.
            let slid: Vec<bool> = zero.iter().map(|g| config.slid.contains(g)).collect();
            config.slid.extend(others(zero, &slid));
        }
        self.ask_new(&mut config);
        self.follow_sides(&mut config, zero);
        let made = self.vertex_of(meeting, config);
        let still =
            |i: usize| made.place[i].is_some_and(|p| self.keeps_still(zero[i], &made.rates, p));
        if (0..zero.len()).any(|i| !plus(i) && still(i)) {
            let mut resting = made.config.clone();
            if self.let_rest(&mut resting, zero, &[]) {
                meeting.some_rest.set(true);
                return self.vertex_of(meeting, resting);
            }
        }
        made
    }

    /// The same in a configuration.
    fn vertex_of(&mut self, meeting: &Meeting, config: Configuration) -> Vertex {
        let zero = &meeting.guards;
        let own = self.equation.compiled(&config);
        let asked: Vec<bool> = zero.iter().map(|g| own.place(*g).is_some()).collect();
        let also = others(zero, &asked);
        let touching = zero.iter().any(|guard| self.touching[*guard]);
        let (compiled, mut rates) = self.rates_to_order(&config, &also, touching);
        let place: Vec<Option<usize>> = zero.iter().map(|g| compiled.place(*g)).collect();
        if self.drop_noise(&config, &compiled, zero, &mut rates) {
            rates = self.rates_to_order(&config, &also, true).1;
            self.drop_noise(&config, &compiled, zero, &mut rates);
            meeting.some_noise.set(true);
        }
        Vertex { config, place, rates, asked }
    }

    /// The sets of functions of a meeting that depend on each other, in the order in which they are
    /// decided.
    fn sets_of(&mut self, meeting: &Meeting) -> Vec<Vec<usize>> {
        let zero = &meeting.guards;
        let k = zero.len();
        if k == 1 {
            return vec![vec![0]];
        }
        let low = self.vertex(meeting, &|_| false);
        let compiled = self.equation.compiled_with(&low.config, &others(zero, &low.asked));
        // A side may act on a function on one side of a third one alone: all sides of a few
        // functions are tried, of many those next to all low ones. Mostly none is.
        let sides = || -> Vec<Vec<bool>> {
            if k <= MOST_TRIED {
                (0..1_usize << k).map(|p| (0..k).map(|i| p >> i & 1 == 1).collect()).collect()
            } else {
                (0..=k).map(|one| (0..k).map(|i| i + 1 == one).collect()).collect()
            }
        };
        let mut patterns = Vec::new();
        let mut known: HashMap<Vec<bool>, Vertex> = HashMap::new();
        let mut coupled = vec![false; k * k];
        for j in 0..k {
            // Without a way from the side to a function nothing has to be computed.
            let side = self.n + 1 + zero[j];
            let acts = |place: &Option<usize>| {
                place.is_none_or(|p| {
                    let through = |v: &usize| *v < self.n && compiled.depends(*v, side);
                    compiled.depends(self.n + p, side) || compiled.touches[p].iter().any(through)
                })
            };
            let other = |i: usize| i != j && acts(&low.place[i]);
            if !self.equation.chooses(zero[j]) && !(0..k).any(other) {
                continue;
            }
            // A function that jumps with the side.
            for i in (0..k).filter(|i| *i != j) {
                coupled[i * k + j] |=
                    low.place[i].is_some_and(|p| compiled.depends(self.n + p, side));
            }
            if patterns.is_empty() {
                patterns = sides();
            }
            for without in patterns.iter().filter(|pattern| !pattern[j]) {
                let mut with = without.clone();
                with[j] = true;
                for pattern in [without, &with] {
                    if !known.contains_key(pattern) {
                        known.insert(pattern.clone(), self.vertex(meeting, &|i| pattern[i]));
                    }
                }
                let (from, to) = (&known[without], &known[&with]);
                for i in (0..k).filter(|i| *i != j) {
                    coupled[i * k + j] |= from.place[i].zip(to.place[i]).is_none_or(|(a, b)| {
                        let (low, high) = (&from.rates, &to.rates);
                        let scale = low.terms[a] + high.terms[b];
                        let still = low.first_or_zero(a) == 0.0 && high.first_or_zero(b) == 0.0;
                        (low.first[a] - high.first[b]).abs() > 1e-12 * scale
                            || still && low.direction(a) != high.direction(b)
                    });
                }
            }
        }
        let mut sets = groups(k, |i, j| coupled[i * k + j]);
        // Functions of the time alone are decided first: others may jump with them.
        let by_time = |i: &usize| {
            low.place[*i].is_some_and(|p| compiled.touches[p].iter().all(|v| *v >= self.n))
        };
        sets.sort_by_key(|set| !set.iter().all(by_time));
        sets
    }

    /// The rates of the functions of a set with these on their upper sides.
    fn corner(&mut self, set: &mut Set, plus: &[bool]) -> Rc<Corner> {
        if let Some(known) = set.corners.get(plus) {
            return known.clone();
        }
        let Vertex { config, place, rates, asked } =
            self.vertex(set.meeting, &|i| set.is_high(plus, i));
        let direction = |follower: &Self, i: usize| {
            let guard = set.meeting.guards[i];
            let direction = place[i].map_or(0.0, |p| rates.direction(p));
            if follower.equation.guards[guard].whole {
                direction
            } else if direction == 0.0 {
                follower.side_ahead_in(&config, guard)
            } else if let Some(place) = place[i].filter(|p| rates.first_or_zero(*p) == 0.0)
                && follower.equation.is_of_conditions(guard)
            {
                let time = 0.01 * follower.whole_time(&rates.field);
                let ahead = follower.values_ahead(&config, &[], guard, [0.005, 0.01]);
                ahead.map_or(direction, |v| side_of(rates.second[place], time, v))
            } else {
                direction
            }
        };
        let rests = |follower: &mut Self, i: usize| {
            let guard = set.meeting.guards[i];
            // A whole number that nothing moves is its own whole part.
            let whole = follower.equation.guards[guard].whole
                && config.sides[guard] == set.meeting.highs[i]
                && place[i].is_some_and(|p| rates.stands_still(p));
            if whole {
                follower.stays_a_little(&config, guard)
            } else {
                follower.equation.rests(guard, &config)
            }
        };
        let first = |i: &usize| place[*i].map_or(f64::NAN, |p| rates.first[p]);
        let first_or_zero = |i: &usize| place[*i].map_or(f64::NAN, |p| rates.first_or_zero(p));
        let corner = Rc::new(Corner {
            first: set.members.iter().map(first).collect(),
            first_or_zero: set.members.iter().map(first_or_zero).collect(),
            direction: set.members.iter().map(|i| direction(self, *i)).collect(),
            asked: set.members.iter().map(|i| asked[*i]).collect(),
            rests: set.members.iter().map(|i| rests(self, *i)).collect(),
            field: rates.field,
        });
        set.corners.insert(plus.to_vec(), corner.clone());
        corner
    }

    /// The ways of the functions of a set. None: none is consistent, and the motion goes on
    /// otherwise, as it has been made to.
    fn decide_set(
        &mut self,
        set: &mut Set,
        kept: &[bool],
    ) -> Result<Option<Vec<Way>>, HybridError> {
        if set.len() > MOST_TOGETHER {
            return self.decide_many(set).map(Some);
        }
        if set.len() == 1
            && let Some(way) = self.decide_without_jump(set)
        {
            return Ok(Some(vec![way]));
        }
        let cells = self.cells_of(&set.guards());
        let mut edges = Edges::new();
        let found = possibilities(set.len(), |ways| {
            let exists = cells.as_ref().is_none_or(|cells| cells.has(ways));
            let consistent = if exists { self.consistent(set, cells.as_ref(), ways) } else { None };
            consistent.map(|found| edges = found).is_some()
        });
        if let Some(ways) = set.open {
            return Err(self.undecided(&set.guards(), ways));
        }
        let chosen = match found.as_slice() {
            [] => return self.go_on_without_way(set, kept).map(|()| None),
            [one] => one,
            several => self.chosen_by_exit(set, several)?,
        };
        let stay = (0..set.len()).filter(|i| chosen[*i] == Way::Stay);
        stay.for_each(|i| self.along[set.guard(i)] = 0.0);
        if found.len() == 1 {
            edges.iter().for_each(|(guard, edge)| self.along[*guard] = *edge);
        }
        if let [Way::Stay] = chosen.as_slice() {
            let [low, high] = [false, true].map(|plus| self.corner(set, &[plus]).direction[0]);
            self.along[set.guard(0)] = if low == 0.0 {
                -1.0
            } else if high == 0.0 {
                1.0
            } else {
                0.0
            };
        }
        Ok(Some(chosen.clone()))
    }

    /// The ways of more functions than all possibilities are tried of.
    fn decide_many(&mut self, set: &mut Set) -> Result<Vec<Way>, HybridError> {
        let none = vec![false; set.len()];
        let plain = set.guards().iter().all(|guard| !self.equation.guards[*guard].whole)
            && self.jumps_with(set, &none).iter().all(Option::is_none);
        let found = plain.then(|| {
            complementary(set.len(), &mut |plus| {
                let corner = self.corner(set, &plus);
                let known = corner.first.iter().all(|rate| rate.is_finite());
                let all = corner.asked.iter().all(|asked| *asked) && !corner.rests.contains(&true);
                (known && all).then(|| (corner.field.clone(), corner.first.clone()))
            })
        });
        found.flatten().ok_or_else(|| {
            let why = format!(
                "{} surfaces that depend on each other meet ({}); more than {MOST_TOGETHER} are \
                    resolved only where the fields are sums of what each side adds, and attract: \
                    start where fewer are zero at once (--start), or smooth the switches",
                set.len(),
                self.names(&set.guards())
            );
            HybridError::Stuck { t: self.t, x: self.x.clone(), why }
        })
    }

    /// The sides that the functions of the meeting have because others' jump, with these of the set
    /// on their upper sides.
    fn jumps_with(&mut self, set: &Set, plus: &[bool]) -> Vec<Option<bool>> {
        let meeting = set.meeting;
        let side = |i: usize| {
            if set.is_high(plus, i) { meeting.highs[i] } else { meeting.lows[i] }
        };
        self.jumped(&meeting.guards, &side)
    }

    /// The way of the only function of a set if the fields of its sides are the same, which decide
    /// nothing and need nothing decided.
    fn decide_without_jump(&mut self, set: &mut Set) -> Option<Way> {
        let guard = set.guard(0);
        let [low, high] = [false, true].map(|plus| self.corner(set, &[plus]));
        let (d0, d1) = (low.direction[0], high.direction[0]);
        if low.rests[0] && (d1 == 0.0 || self.equation.is_of_conditions(guard)) {
            return Some(Way::Minus);
        }
        if high.rests[0] {
            return Some(Way::Plus);
        }
        let way = |plus: bool| Some(if plus { Way::Plus } else { Way::Minus });
        let present = self.config.sides[guard] == set.meeting.highs[set.members[0]];
        if same(&low.field, &high.field) {
            let side = if d1 != 0.0 { d1 } else { d0 };
            return way(if side != 0.0 { side > 0.0 } else { present });
        }
        // At a kink the fields differ by rounding, and so do speeds that are nearly zero.
        let span = self.options.t_end - self.options.t_start;
        let jumps = (0..self.n)
            .any(|i| (low.field[i] - high.field[i]).abs() * span > CLEAR_JUMP * self.size[i]);
        let is_kink = self.equation.guards[guard].kink || !jumps && self.is_kink(guard);
        if !low.rests[0] && is_kink {
            return way(if same_sign(d0, d1) { d1 > 0.0 } else { present });
        }
        None
    }

    /// Whether an assignment of ways to the functions of a set is consistent: each does what it is
    /// said to do. If so, those that stay along one side's field.
    fn consistent(&mut self, set: &mut Set, cells: Option<&Cells>, ways: &[Way]) -> Option<Edges> {
        let plus: Vec<bool> = ways.iter().map(|way| *way == Way::Plus).collect();
        let slides: Vec<usize> = (0..ways.len()).filter(|i| ways[*i] == Way::Stay).collect();
        let all = self.jumps_with(set, &plus);
        let jumped: Vec<Option<bool>> = set.members.iter().map(|i| all[*i]).collect();
        let misses = |i: usize| jumped[i].is_some_and(|up| ways[i] == Way::Stay || up != plus[i]);
        if (0..ways.len()).any(misses) {
            return None;
        }
        let base = self.corner(set, &plus);
        // A function that is zero all along on the side of another is no surface there.
        if slides.iter().any(|s| base.rests[*s]) {
            return None;
        }
        let jumped = jumped.iter().map(Option::is_some).collect();
        let (columns, asked) = (Vec::new(), base.asked.clone());
        let mut trial = Trial { ways, slides, plus, base, columns, jumped, asked };
        if let Some(cells) = cells.and_then(|cells| cells.part(&trial.slides)) {
            return self.consistent_in_cells(set, &trial, &cells).then(Edges::new);
        }
        for s in &trial.slides {
            let mut flipped = trial.plus.clone();
            flipped[*s] = true;
            trial.columns.push(self.corner(set, &flipped));
        }
        // One that stays a whole number on its upper side is none, either.
        let whole = |s: &usize| self.equation.guards[set.guard(*s)].whole;
        if trial.slides.iter().zip(&trial.columns).any(|(s, c)| whole(s) && c.rests[*s]) {
            return None;
        }
        for column in &trial.columns {
            trial.asked.iter_mut().zip(&column.asked).for_each(|(asked, there)| *asked |= there);
        }
        let m = trial.slides.len();
        if m == 0 {
            let all = (0..ways.len()).all(|i| trial.goes(i, trial.base.direction[i]));
            return all.then(Edges::new);
        }
        let base = &trial.base.first;
        let mut matrix = vec![0.0; m * m];
        for (c, column) in trial.columns.iter().enumerate() {
            for (r, s) in trial.slides.iter().enumerate() {
                matrix[r * m + c] = column.first[*s] - base[*s];
            }
        }
        let b: Vec<f64> = trial.slides.iter().map(|s| -base[*s]).collect();
        // Surfaces of which some stay at zero where the others do.
        let nearest = (m > 1).then(|| near_solution(&matrix, &b, 0.5)).flatten();
        let (weights, dependent) = match nearest {
            Some((weights, rank)) if rank < m => (Some(weights), true),
            _ => (solve_any(&matrix, &b, 0.0), false),
        };
        if m == 1 {
            // On both sides towards or away from the surface, to second order; or along it on one
            // side and towards it on the other.
            let s = trial.slides[0];
            let (d0, d1) = (trial.base.direction[s], trial.columns[0].direction[s]);
            let along_one = d0 == 0.0 && d1 < 0.0 || d1 == 0.0 && d0 > 0.0;
            if d0 * d1 >= 0.0 && !along_one {
                return None;
            }
        } else {
            let by = Weights { matrix: &matrix, solution: weights.as_deref(), dependent };
            if let ControlFlow::Break(consistent) = self.stays_on_all(set, &trial, by) {
                return consistent.then(Edges::new);
            }
        }
        self.consistent_with(set, &trial, &weights?)
    }

    /// Whether an assignment is consistent where functions that stay follow from each other.
    fn consistent_in_cells(&mut self, set: &mut Set, trial: &Trial, cells: &Cells) -> bool {
        let at = |pattern: &usize| self.corner(set, &trial.with(*pattern));
        let corners: Vec<Rc<Corner>> = cells.patterns.iter().map(at).collect();
        let own: Vec<Vec<f64>> = corners.iter().map(|c| trial.own(&c.first)).collect();
        let fields: Vec<Vec<f64>> = corners.iter().map(|c| c.field.clone()).collect();
        if some_move_one_way(&own) || !(cells.depth(&own) > 0.0) {
            return false;
        }
        if self.options.intersection == Intersection::Undecided {
            if velocities_differ(&fields, &own) {
                set.open = Some(SEVERAL_VELOCITIES);
                return false;
            }
            if !cells.attract(&own) {
                set.open = Some(TURNS_AWAY);
                return false;
            }
        }
        let Some(weights) = self.weights_in_cells(&fields, &own) else { return false };
        trial.moving().all(|i| {
            let rate: f64 = weights.iter().zip(&corners).map(|(w, c)| w * c.first[i]).sum();
            if trial.ways[i] == Way::Plus { rate > 0.0 } else { rate < 0.0 }
        })
    }

    /// Whether the motion stays on several surfaces: whether they hold it and, where mixtures of
    /// their fields have several velocities, a rule chooses one that is consistent.
    fn stays_on_all(&mut self, set: &mut Set, trial: &Trial, by: Weights) -> ControlFlow<bool> {
        let m = trial.slides.len();
        let at = |pattern: usize| self.corner(set, &trial.with(pattern));
        let corners: Vec<Rc<Corner>> = (0..1_usize << m).map(at).collect();
        let own: Vec<Vec<f64>> = corners.iter().map(|c| trial.own(&c.first)).collect();
        let clear: Vec<Vec<f64>> = corners.iter().map(|c| trial.own(&c.first_or_zero)).collect();
        let fields: Vec<Vec<f64>> = corners.iter().map(|c| c.field.clone()).collect();
        let guards: Vec<usize> = trial.slides.iter().map(|s| set.guard(*s)).collect();
        if some_move_one_way(&own) {
            return ControlFlow::Break(false);
        }
        let chosen = self.options.intersection != Intersection::Undecided;
        let holds = match clear.as_slice() {
            _ if chosen => 1.0,
            _ if by.dependent && m == 2 => {
                let still = |i: &usize| clear.iter().all(|rates| rates[*i] == 0.0);
                let Some(position) = (0..2).find(still) else { return ControlFlow::Break(false) };
                let base = self.vertex(set.meeting, &|i| set.is_high(&trial.plus, i)).config;
                let (t, x, pair) = (self.t, self.x.clone(), [guards[0], guards[1]]);
                let hold = self.position_hold(&base, (t, &x), pair, position);
                // A field may lead away where none turns.
                if hold <= 0.0 && !self.turns_away(&x, pair) {
                    return ControlFlow::Break(false);
                }
                hold
            }
            [a, b, c, d] => hold(&[a, b, c, d].map(|rates| [rates[0], rates[1]])),
            _ => attraction(&trial.own(&trial.base.first), by.matrix),
        };
        if !(holds > 0.0) {
            // Where fields turn around two surfaces a mixture stays on both.
            let stays = |weights: &[f64]| weights.iter().all(|w| *w > 0.0 && *w < 1.0);
            if m == 2 || !by.dependent && by.solution.is_some_and(stays) {
                set.open = Some(TURNS_AWAY);
            }
            return ControlFlow::Break(false);
        }
        let several = by.dependent && velocities_differ(&fields, &own);
        if several && !chosen {
            set.open = Some(SEVERAL_VELOCITIES);
            return ControlFlow::Break(false);
        }
        set.by_rule |= several;
        // If all mixtures have one velocity, there is nothing to choose.
        if !several && !mixtures_differ(&fields) {
            return ControlFlow::Continue(());
        }
        let order = self.order_of(&guards);
        let Some(found) = mixture(&self.rule(), &order, &fields, &own) else {
            return ControlFlow::Break(false);
        };
        let rate = |i: usize| -> f64 {
            found.weights.iter().zip(&corners).map(|(w, c)| w * c.first[i]).sum()
        };
        ControlFlow::Break(
            found.margins.iter().flatten().all(|w| *w >= -1e-12)
                && found.weights.iter().all(|w| (0.0..=1.0).contains(w))
                && trial.moving().all(|i| trial.goes(i, rate(i))),
        )
    }

    /// Whether an assignment is consistent where those functions that stay have these weights of
    /// their upper sides.
    fn consistent_with(&mut self, set: &Set, trial: &Trial, weights: &[f64]) -> Option<Edges> {
        // Where the motion slides on the functions at these places, and not on others.
        let ahead = |follower: &mut Self, on: &[bool], slides: &[usize], i: usize| {
            let config = |follower: &mut Self, on: &[bool]| {
                follower.vertex(set.meeting, &|i| set.is_high(on, i)).config
            };
            let flip = |s: &usize| {
                let mut on = on.to_vec();
                on[*s] = true;
                (set.guard(*s), config(follower, &on))
            };
            let flips: Vec<_> = slides.iter().map(flip).collect();
            let base = config(follower, on);
            follower.side_ahead_sliding(&base, &flips, set.guard(i))
        };
        let mut edges = Edges::new();
        for (s, w) in trial.slides.iter().zip(weights).filter(|_| weights.len() > 1) {
            let edge = if *w > 0.5 { 1.0 } else { -1.0 };
            if !(*w > -ALONG && *w < 1.0 + ALONG) {
                return None;
            }
            // Along the surface on one side, to second order, and towards it on the other.
            if !(*w > ALONG && *w < 1.0 - ALONG) {
                let others: Vec<usize> =
                    trial.slides.iter().copied().filter(|other| other != s).collect();
                let mut on = trial.plus.clone();
                on[*s] = edge > 0.0;
                if ahead(self, &on, &others, *s) * edge > 0.0 {
                    return None;
                }
                edges.push((set.guard(*s), edge));
            }
        }
        let base = &trial.base.first;
        let all = trial.moving().all(|i| {
            let added =
                || trial.columns.iter().zip(weights).map(|(c, w)| w * (c.first[i] - base[i]));
            let rate = base[i] + added().sum::<f64>();
            let size = added().fold(base[i].abs(), |size, v| size + v.abs());
            // A rate that is zero to rounding counts as zero; where one field is followed alone its
            // second derivative is known.
            let alone = weights.iter().all(|w| *w == 0.0);
            let rate = match (rate.abs() <= 1e-13 * size, alone) {
                (false, _) => rate,
                (true, true) => trial.base.direction[i],
                (true, false) => ahead(self, &trial.plus, &trial.slides, i),
            };
            trial.goes(i, rate)
        });
        all.then_some(edges)
    }

    /// Goes on where no assignment of ways to the functions of a set is consistent: at rest, from
    /// where more functions meet, sliding in higher order, or without kinks that change nothing.
    fn go_on_without_way(&mut self, set: &Set, kept: &[bool]) -> Result<(), HybridError> {
        let zero = &set.meeting.guards;
        let undecided = self.options.intersection == Intersection::Undecided;
        if undecided && self.comes_to_rest(self.t, true) || self.meets_more(zero)? {
            return Ok(());
        }
        if set.len() == 1 && self.slides_in_higher_order(set.guard(0))? {
            let mut rest = self.sliding.clone();
            rest.extend(zero.iter().filter(|guard| !self.slides[**guard]));
            return self.decide(&rest, &self.slides.clone());
        }
        let idle = self.idle_kinks(zero);
        let rest: Vec<usize> = zero.iter().copied().filter(|guard| !idle.contains(guard)).collect();
        if rest.len() < zero.len() {
            let before = self.left_out.len();
            self.left_out.extend(idle);
            let decided = self.decide(&rest, kept);
            self.left_out.truncate(before);
            return decided;
        }
        let here = self.rates(&self.config.clone()).1.field;
        if !here.iter().all(|f| f.is_finite()) {
            return Err(self.left_domain(self.t, &self.x.clone()));
        }
        let names = set.guards();
        Err(match self.options.intersection {
            Intersection::Order(_) if names.len() > 1 => self.no_mixture(&names),
            _ => self.undecided(&names, "no way is consistent to first and second order"),
        })
    }

    /// That of several consistent assignments which `--exit` names.
    fn chosen_by_exit<'a>(
        &self,
        set: &Set,
        several: &'a [Vec<Way>],
    ) -> Result<&'a Vec<Way>, HybridError> {
        let all = |way: Way| several.iter().find(|ways| ways.iter().all(|w| *w == way));
        let wanted = match self.options.exit {
            Exit::Undecided => None,
            Exit::Plus => all(Way::Plus),
            Exit::Minus => all(Way::Minus),
        };
        wanted.ok_or_else(|| {
            let signs = |ways: &Vec<Way>| ways.iter().map(|way| way.sign()).collect();
            let words: Vec<String> = several.iter().map(signs).collect();
            self.undecided(&set.guards(), &format!("signs {}", words.join(" or ")))
        })
    }

    /// Whether a rule chooses the velocity, as surfaces that do not change each other's speeds act
    /// on other states together. An error if there is none.
    fn velocities_are_chosen(
        &mut self,
        meeting: &Meeting,
        ways: &[Way],
        by_rule: bool,
    ) -> Result<bool, HybridError> {
        let stay: Vec<usize> = (0..ways.len()).filter(|i| ways[*i] == Way::Stay).collect();
        let guards: Vec<usize> = stay.iter().map(|i| meeting.guards[*i]).collect();
        let on_one_state = |s: usize| {
            guards.iter().filter(|g| self.compiled.depends(s, self.n + 1 + **g)).count() > 1
        };
        let acts = guards.iter().any(|guard| self.equation.chooses(*guard))
            || (0..self.n).any(on_one_state);
        // Of cells the mixture is known.
        if guards.len() < 2 || !acts || self.cells_of(&guards).is_some() {
            return Ok(false);
        }
        let on = |follower: &mut Self, on: &dyn Fn(usize) -> bool| {
            let plus = |i: usize| match stay.iter().position(|s| *s == i) {
                Some(place) => on(place),
                None => ways[i] == Way::Plus,
            };
            follower.vertex(meeting, &plus)
        };
        let base = on(self, &|_| false).rates.field;
        let corner = on(self, &|_| true).rates.field;
        let mut sum = base.clone();
        for s in 0..stay.len() {
            let one = on(self, &|i| i == s).rates.field;
            let added = one.iter().zip(&base).map(|(one, base)| one - base);
            sum.iter_mut().zip(added).for_each(|(sum, added)| *sum += added);
        }
        let size = corner.iter().chain(&base).fold(0.0_f64, |most, v| most.max(v.abs()));
        let differ = by_rule || sum.iter().zip(&corner).any(|(p, c)| (p - c).abs() > 1e-9 * size);
        if !differ || self.options.intersection != Intersection::Undecided {
            return Ok(differ);
        }
        let several = stay.len() > MOST_CORNERS || {
            let (mut fields, mut rates) = (Vec::new(), Vec::new());
            for corner in 0..1_usize << stay.len() {
                let there = on(self, &|i| corner >> i & 1 == 1);
                let rate = |s: &usize| there.place[*s].map_or(f64::NAN, |p| there.rates.first[p]);
                rates.push(stay.iter().map(rate).collect());
                fields.push(there.rates.field);
            }
            velocities_differ(&fields, &rates)
        };
        if several { Err(self.undecided(&guards, SEVERAL_VELOCITIES)) } else { Ok(true) }
    }

    /// Goes these ways from a meeting.
    fn take_ways(&mut self, meeting: &Meeting, ways: &[Way]) {
        let zero = &meeting.guards;
        let mut config = self.config.clone();
        let mut sliding = Vec::new();
        for (i, guard) in zero.iter().enumerate() {
            let high = ways[i] == Way::Plus;
            config.sides[*guard] = if high { meeting.highs[i] } else { meeting.lows[i] };
            if ways[i] == Way::Stay {
                sliding.push(*guard);
            }
            self.fresh_guard[*guard] = true;
            self.tangent_guard[*guard] = false;
        }
        // A condition that leaves zero to third order does so without a speed, too.
        let of_conditions = zero.iter().any(|guard| self.equation.is_of_conditions(*guard));
        if zero.len() > 1 || meeting.some_noise.get() || self.touching[zero[0]] || of_conditions {
            let Vertex { place, rates, .. } = self.vertex(meeting, &|i| ways[i] == Way::Plus);
            for (guard, place) in zero.iter().zip(&place) {
                let turns =
                    |p: usize| rates.direction(p) != 0.0 || self.equation.is_of_conditions(*guard);
                let tangent = |p: usize| rates.first_or_zero(p) == 0.0 && turns(p);
                self.tangent_guard[*guard] = place.is_some_and(tangent);
            }
        }
        self.ask_new(&mut config);
        self.follow_sides(&mut config, zero);
        if meeting.some_rest.get() {
            self.let_rest(&mut config, zero, &sliding);
        }
        sliding.sort_unstable();
        self.adopt(config, sliding);
        if zero.len() > 1 {
            self.forget_what_jumped(zero);
        }
        if self.cells.is_none() {
            self.corners = Vec::new();
        }
    }

    /// Of functions that have been met at zero those that another one's switch has moved from it,
    /// as that of abs(2*heaviside(z) - 2 + y) where y and z are zero, do not leave it in the next
    /// step: there are no roundings to be put to zero.
    fn forget_what_jumped(&mut self, zero: &[usize]) {
        let values = self.watched_values();
        for guard in zero.iter().copied().filter(|guard| !self.slides[*guard]) {
            let Some(place) = self.compiled.place(guard) else { continue };
            let (own, side) = (&self.equation.guards[guard], self.config.sides[guard]);
            let inside = match own.whole {
                true => (values[place] - side).min(side + 1.0 - values[place]),
                false => values[place] * side,
            };
            if inside > 1e-9 * self.magnitude(&own.expression) {
                (self.fresh_guard[guard], self.tangent_guard[guard]) = (false, false);
            }
        }
    }

    /// Begins to follow that mixture of the fields around the surfaces that are slid upon which a
    /// rule chooses.
    fn begin_mixture(&mut self) -> Result<(), HybridError> {
        if self.sliding.len() > MOST_CORNERS {
            let why = format!(
                "more than {MOST_CORNERS} surfaces meet, where mixtures of the fields have \
                    different velocities"
            );
            return Err(HybridError::Stuck { t: self.t, x: self.x.clone(), why });
        }
        self.take_corners();
        if self.tangents.is_some() {
            return Err(self.no_tangents(
                "the motion follows a mixture of more fields than their surfaces decide",
            ));
        }
        let (t, x) = (self.t, self.x.clone());
        let (found, ..) = self.corner_mixture(t, &x);
        let all = found.weights.iter().chain(found.margins.iter().flatten());
        if !all.into_iter().all(|w| (-1e-9..=1.0 + 1e-9).contains(w)) {
            return Err(self.no_mixture(&self.sliding));
        }
        Ok(())
    }
}
