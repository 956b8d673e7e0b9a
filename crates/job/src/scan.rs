//! What a run ends on, told simply and for any system: from its passages through a plane.
//!
//! [`Classification`](super::Classification) looks closer and needs three states; a scan compares thousands of short runs and asks only: does
//! it repeat, does it rest, or neither, and is it where another run ended, too.

use serde::{Deserialize, Serialize};

use super::answer::Answer;
use super::spec::RunSpec;
use twofold_num::elementary::sqrt;

/// How a run ends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Ending {
    /// Its passages repeat: the last ones of a turn, in the plane's order of the motion.
    Periodic {
        /// Passages a turn, in the direction of the last one.
        points: Vec<Vec<f64>>,
    },
    /// It passed the plane no more in the late half.
    Quiet {
        /// Where it was at the end.
        state: Vec<f64>,
    },
    /// It goes on passing and does not repeat within what was looked at.
    Irregular,
}

/// Most passages of a turn that are looked for.
const MOST_PASSAGES: usize = 64;
/// Turns in a row that have to be alike.
const TURNS: usize = 2;

impl Ending {
    /// The ending that a run's recorded section shows. Passages are alike within `alike` in shares of 1 + their size; only those after half of
    /// the time count.
    pub fn of(run: &RunSpec, answer: &Answer, alike: f64) -> Option<Self> {
        let section = answer.table("section")?;
        let columns: Vec<&[f64]> = run.system.coordinates().iter().map(|n| section.numbers(n)).collect();
        let late = 0.5 * run.t_end;
        let rows: Vec<(usize, &str)> =
            section.words("direction").enumerate().filter(|(row, _)| section.numbers("t")[*row] > late).collect();
        let Some((_, direction)) = rows.last() else {
            return Some(Ending::Quiet { state: answer.fact("state").ok()? });
        };
        let points: Vec<Vec<f64>> = rows
            .iter()
            .filter(|(_, word)| word == direction)
            .map(|(row, _)| columns.iter().map(|c| c[*row]).collect())
            .collect();
        let n = points.len();
        let repeats = |k: usize| {
            n >= (TURNS + 1) * k && (1..=TURNS * k).all(|j| distance(&points[n - j], &points[n - j - k]) < alike)
        };
        Some(match (1..=MOST_PASSAGES).find(|k| repeats(*k)) {
            Some(k) => Ending::Periodic { points: points[n - k..].to_vec() },
            None => Ending::Irregular,
        })
    }

    /// Whether this is where the other ends, too.
    pub fn is_like(&self, other: &Self, alike: f64) -> bool {
        match (self, other) {
            (Ending::Irregular, Ending::Irregular) => true,
            (Ending::Quiet { state: a }, Ending::Quiet { state: b }) => distance(a, b) < alike,
            (Ending::Periodic { points: a }, Ending::Periodic { points: b }) => {
                // The same turn may be cut at another passage.
                let n = a.len();
                n == b.len() && (0..n).any(|s| (0..n).all(|i| distance(&a[i], &b[(i + s) % n]) < alike))
            }
            _ => false,
        }
    }

    /// In a word or two.
    pub fn word(&self) -> String {
        match self {
            Ending::Periodic { points } => format!("period {}", points.len()),
            Ending::Quiet { .. } => "quiet".into(),
            Ending::Irregular => "irregular".into(),
        }
    }
}

/// In shares of 1 + size.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    let size = 1.0 + a.iter().fold(0.0_f64, |s, x| s.max(x.abs()));
    sqrt(a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum()) / size
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::*;
    use crate::table::{Column, Table};
    use twofold_system::{Definition, System};

    fn ending(passages: &[[f64; 2]]) -> Ending {
        ending_of(&passages.iter().map(|p| (*p, "up")).collect::<Vec<_>>())
    }

    fn ending_of(passages: &[([f64; 2], &str)]) -> Ending {
        let text = "states = ['x', 'y']\nh = 'x'\nplus = ['1', '1']\nminus = ['1', '1']";
        let system = System::new(Definition::from_toml(text, "f").unwrap());
        let run = RunSpec {
            system,
            switch: SwitchSpec::tanh(1e-3),
            start: vec![0.0, 0.0],
            t_end: 100.0,
            method: MethodSpec::ndsolve_defaults(Method::Dopri5),
            schedule: Default::default(),
            observe: Observation::Section { coordinate: 1, value: 0.0 },
        };
        let names = ["t", "x", "y"].map(Column::numbers);
        let mut table = Table::new("section", names.into_iter().chain([Column::words("direction")]));
        for ([t, x], direction) in passages {
            table.push([(*t).into(), (*x).into(), 0.0.into(), (*direction).into()]);
        }
        let answer = Answer::of_tables(vec![table]).with_fact("state", &[3.0, 4.0]);
        Ending::of(&run, &answer, 1e-3).unwrap()
    }

    /// By hand: a triangle of sides 3, 4, 5, in shares of 1 + 3.
    #[test]
    fn distances_are_in_shares_of_the_first() {
        assert_eq!(distance(&[3.0, 0.0], &[0.0, -4.0]), 1.25);
        assert_eq!(distance(&[-3.0, 0.5], &[-3.0, 0.5]), 0.0);
        let quiet = |x: f64| Ending::Quiet { state: vec![3.0, x] };
        assert!(quiet(1.0).is_like(&quiet(1.3), 0.1) && !quiet(1.0).is_like(&quiet(1.5), 0.1));
    }

    /// A turn counts when it came back twice, in passages of the last one's direction after half of the time (50).
    #[test]
    fn a_turn_is_seen_three_times() {
        let turns =
            |from: f64, n: usize| -> Vec<[f64; 2]> { (0..n).map(|k| [from + k as f64, (k % 3) as f64]).collect() };
        assert_eq!(ending(&turns(51.0, 9)).word(), "period 3");
        for n in [3, 4, 5, 6, 7, 8] {
            assert_eq!(ending(&turns(51.0, n)), Ending::Irregular, "{n} passages");
        }
        // One passage a turn is seen in three; and all of the last two turns are compared, also with the first passage
        // of the one before.
        assert_eq!(ending(&[[51.0, 1.0], [52.0, 1.0], [53.0, 1.0]]).word(), "period 1");
        let mut other = turns(51.0, 9);
        other[0][1] = 7.0;
        assert_eq!(ending(&other), Ending::Irregular);
        // The ones before half of the time do not count: five and four.
        assert_eq!(ending(&turns(46.0, 9)), Ending::Irregular);
        let Ending::Periodic { points } = ending(&turns(51.0, 10)) else { panic!() };
        assert_eq!(points, [[1.0, 0.0], [2.0, 0.0], [0.0, 0.0]], "the last turn");
        // One like the last in the other direction is another point.
        let down = |k: usize| if k.is_multiple_of(2) { "up" } else { "down" };
        let passages: Vec<([f64; 2], &str)> = (0..9).map(|k| ([51.0 + k as f64, (k % 2) as f64], down(k))).collect();
        assert_eq!(ending_of(&passages).word(), "period 1");
    }

    #[test]
    fn endings() {
        let turns = |period: usize| -> Vec<[f64; 2]> {
            (0..90).map(|k| [10.0 + k as f64, (k % period) as f64 + if k < 20 { 0.3 } else { 0.0 }]).collect()
        };
        for period in [1, 3, 7] {
            assert_eq!(ending(&turns(period)).word(), format!("period {period}"));
        }
        assert!(ending(&turns(3)).is_like(&ending(&turns(3)[..89]), 1e-3), "cut at another passage");
        assert!(!ending(&turns(3)).is_like(&ending(&turns(1)), 1e-3));
        let other: Vec<[f64; 2]> = turns(3).iter().map(|[t, x]| [*t, x + 0.01]).collect();
        assert!(!ending(&turns(3)).is_like(&ending(&other), 1e-4), "as many passages, elsewhere");
        assert!(ending(&turns(3)).is_like(&ending(&other), 0.1));
        assert_eq!(ending(&[[10.0, 1.0], [40.0, 1.0]]), Ending::Quiet { state: vec![3.0, 4.0] });
        let drifting: Vec<[f64; 2]> = (0..90).map(|k| [10.0 + k as f64, (k * k % 83) as f64]).collect();
        assert_eq!(ending(&drifting), Ending::Irregular);
        // Of what does not repeat no difference is seen.
        assert!(
            Ending::Irregular.is_like(&ending(&drifting), 1e-3) && !Ending::Irregular.is_like(&ending(&turns(3)), 9.0)
        );
    }
}
