//! Steps of LSODA: history is kept as long as the motion stays on one smooth branch of the
//! equations, and every switch, event, reset and table's knot begins anew at order 1.
//!
//! The dense output is the polynomial of the step just made, by powers of the fraction of the step,
//! so that it is searched as a Taylor series is. It goes through both ends of the step.

use std::cell::RefCell;

use nalgebra::{DMatrix, DVector, Dyn};
use twofold_integrate::lsoda::{Family, RightHandSide};
use twofold_integrate::{LsodaOf, Tolerance};

use super::*;
use crate::history::{Branch, Multistep};

/// Most tenths of tenths of a step that are tried, to see what errors count as.
const MOST_TRIALS: usize = 30;
/// Part of a failed step that is tried next.
const SHORTER: f64 = 0.1;

/// The field that moves the states, as LSODA asks for it.
struct Field<'f, 'a>(RefCell<&'f mut Follower<'a>>);

impl RightHandSide<Dyn> for Field<'_, '_> {
    fn eval(&self, t: f64, x: &DVector<f64>) -> DVector<f64> {
        let mut out = DVector::zeros(x.len());
        self.0.borrow_mut().rhs(t, x.as_slice(), out.as_mut_slice());
        out
    }

    fn jacobian(&self, t: f64, x: &DVector<f64>) -> DMatrix<f64> {
        let slopes = self.0.borrow_mut().finite_jacobian(t, x.as_slice());
        DMatrix::from_row_slice(x.len(), x.len(), &slopes)
    }
}

impl Follower<'_> {
    /// Takes up the history for a step that begins here, or forgets it if this is another branch.
    pub(super) fn take_up(&self, step: &mut Step) {
        let own = step.multistep.get_or_insert_default();
        if own.branch.as_ref().is_none_or(|branch| *branch != self.branch()) {
            (own.begin, own.branch) = (None, None);
        }
    }

    /// Keeps the history of a step that ended where nothing is met.
    pub(super) fn keep(&self, step: &mut Step) {
        if let Some(own) = &mut step.multistep {
            (own.begin, own.branch) = (own.made.take(), Some(self.branch()));
        }
    }

    fn branch(&self) -> Branch {
        Branch {
            t: self.t,
            x: self.x.clone(),
            config: self.config.clone(),
            sliding: self.sliding.clone(),
            contacts: self.contacts.iter().map(|c| c.watched).collect(),
        }
    }

    /// The size of errors where nothing is known but the field: by a trial of an explicit step of
    /// length `h`, or of the first shorter one that has an end. Returns its length.
    fn first_scale(&mut self, step: &Step, h: f64, scale: &mut Vec<f64>) -> f64 {
        let mut trial = Step::new(self.n);
        trial.t = step.t;
        trial.x.copy_from_slice(&step.x);
        trial.k[0].copy_from_slice(&step.k[0]);
        let mut h = h;
        for _ in 0..MOST_TRIALS {
            trial.take(h, &mut |t, x, out| self.rhs(t, x, out));
            scale_now(self, &trial, scale);
            if scale.iter().all(|s| s.is_finite()) {
                return h;
            }
            h *= SHORTER;
        }
        trial.y.copy_from_slice(&step.x);
        trial.k[1..].iter_mut().for_each(|k| k.copy_from_slice(&step.k[0]));
        scale_now(self, &trial, scale);
        h
    }

    /// Sets the derivatives of stages to the field's at equal distances.
    fn ask_inside(&mut self, step: &mut Step) {
        let (mut at, mut field) = (vec![0.0; self.n], vec![0.0; self.n]);
        for s in 1..6 {
            let theta = s as f64 / 5.0;
            step.at(theta, &mut at);
            self.rhs(step.t + theta * step.h, &at, &mut field);
            step.k[s].copy_from_slice(&field);
        }
    }

    /// Adds the rounding errors that a step near `h` makes to what errors count as: of speeds, and
    /// of the time if it moves by little.
    fn add_noise(&mut self, step: &Step, h: f64, scale: &mut [f64]) {
        for i in 0..self.n {
            scale[i] = match self.noise_in(h, i) {
                Some(noise) => scale[i] + noise,
                None => scale[i].max(0.01 * self.options.rtol * self.size[i]),
            } + 4.0 * h * self.inherited[i];
        }
        self.noisy = h <= 1e8 * f64::EPSILON * step.t.abs();
        if self.noisy {
            let noise = self.noise_of_time(step);
            scale.iter_mut().zip(noise).for_each(|(scale, noise)| *scale += 4.0 * h * noise);
        }
    }

    /// Makes a step of the multistep method, to `longest` at most. If it fails, the length that it
    /// tried first is returned.
    fn advance(&mut self, step: &mut Step, own: &mut Multistep, longest: f64) -> Result<(), f64> {
        let n = self.n;
        let x = DVector::from_column_slice(&step.x);
        let scale = DVector::from_column_slice(&own.scale);
        let (t, t_end) = (step.t, step.t + longest);
        let mut method = own.begin.clone().unwrap_or_else(|| {
            let tolerance = Tolerance { rtol: self.options.rtol, atol: 0.0 };
            let mut method = LsodaOf::of(tolerance, Dyn(n));
            let slope = DVector::from_column_slice(&step.k[0]);
            method.start(t, x.clone(), slope, &scale, t_end);
            method
        });
        let tried = method.length();
        let field = Field(RefCell::new(self));
        let made = method.advance(&field, t, &x, &scale, t_end);
        // Where stages are no numbers it gets shorter until it has no length.
        if made.is_err() || !(method.time() > t) {
            return Err(tried);
        }
        // To the end of the longest step it goes but for a few roundings.
        step.h = if method.time() == t_end { longest } else { method.length() };
        let is_start = method.made_by() == (1, Family::Adams);
        let columns = method.polynomial();
        let series = step.series.get_or_insert_default();
        series.terms.resize(n, Vec::new());
        series.noise.resize(n, 0.0);
        own.end.clear();
        own.end.extend(columns[0].iter());
        for (i, terms) in series.terms.iter_mut().enumerate() {
            terms.clear();
            let x = step.x[i];
            if is_start {
                // The slopes at both ends are known: a parabola, by the trapezoidal rule.
                let [begin, end] = [step.h * step.k[0][i], columns[1][i]];
                let bend = 0.5 * (end - begin);
                own.end[i] = x + (begin + bend);
                terms.extend([x, begin, bend]);
                continue;
            }
            terms.resize(columns.len(), 0.0);
            // By powers of 1 + s in place of s, from the highest coefficient on.
            for (degree, column) in columns.iter().enumerate().rev() {
                for k in (0..columns.len() - 1 - degree).rev() {
                    terms[k + 1] += terms[k];
                    terms[k] = -terms[k];
                }
                terms[0] += column[i];
            }
            let off = x - terms[0];
            terms[0] = x;
            terms[1] -= off;
        }
        own.whole = step.h;
        own.made = Some(method);
        Ok(())
    }

    /// As [`Follower::step_within`], for the multistep method.
    pub(super) fn multistep_within(
        &mut self,
        step: &mut Step,
        longest: f64,
        scale: &mut Vec<f64>,
        list: &mut Vec<(Sought, f64)>,
    ) -> Option<Accepted> {
        let mut length = longest;
        let mut trial = longest.min(self.first_step(&step.k[0]));
        for _ in 0..=MOST_SHORTENINGS {
            let mut own = step.multistep.take().unwrap_or_default();
            if own.begin.is_none() {
                length = length.min(self.first_scale(step, trial, &mut own.scale));
                step.h = length;
            }
            self.note_noise(step);
            self.note_inherited(step);
            self.add_noise(step, step.h, &mut own.scale);
            let made = self.advance(step, &mut own, length);
            if made.is_err() {
                own.begin = None;
            }
            step.multistep = Some(own);
            if let Err(tried) = made {
                trial = SHORTER * tried.min(length);
                length = trial;
            } else {
                step.take(step.h, &mut |_, _, _| {});
                scale_now(self, step, scale);
                let mut unseen = self.unseen(step, scale);
                if unseen.is_some() {
                    // By the speeds inside the step, too, as that of a method with stages.
                    self.ask_inside(step);
                    scale_now(self, step, scale);
                    unseen = self.unseen(step, scale);
                }
                let factor = match unseen.map(|theta| theta.clamp(0.05, 0.9)) {
                    Some(factor) => factor,
                    None => {
                        self.sought(step, list);
                        if let Some(parts) = self.parts(step, list) {
                            let own = step.multistep.get_or_insert_default();
                            own.scale.clone_from(scale);
                            let rejected = step.h < longest;
                            return Some(Accepted { length: step.h, error: 1.0, parts, rejected });
                        }
                        search::SHORTER
                    }
                };
                length = factor * step.h;
                trial = length;
            }
            if self.t + length == self.t {
                break;
            }
        }
        None
    }
}
