//! Extents of small states, by which a recorded path measures its distance from the motion.

/// A state that moves over less than this is small.
const SMALL: f64 = 3e-3;
/// The largest part of its extent from which a small state's path may be.
const PART: f64 = 1e-3;
/// A state that moves over a smaller part of the largest one may move by errors alone.
const NOISE: f64 = 1e-6;

/// The ranges of those states that move over less than 0.003: a path stays within a thousandth of
/// their extent from them. The default knows of none.
///
/// ```
/// use twofold_integrate::Extents;
/// let mut extents = Extents::of([[0.0, 1e-4].into_iter(), [0.0, -0.5].into_iter()]);
/// assert!((extents.chord(0, 1e-3) - 1e-7).abs() < 1e-15);
/// assert_eq!(extents.chord(1, 1e-3), 1e-3);
/// // It grows until it is small no longer.
/// extents.reach(&[0.2, 0.0]);
/// assert_eq!(extents.chord(0, 1e-3), 1e-3);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extents(Vec<Option<[f64; 2]>>);

impl Extents {
    /// Those of states with these values. A state that moves by less than 1e-6 of the largest value
    /// of any state is not looked at.
    pub fn of<V: Iterator<Item = f64>>(states: impl IntoIterator<Item = V>) -> Self {
        let nothing = [f64::INFINITY, f64::NEG_INFINITY];
        let range = |values: V| values.fold(nothing, |[low, high], v| [low.min(v), high.max(v)]);
        let ranges: Vec<[f64; 2]> = states.into_iter().map(range).collect();
        let largest = ranges.iter().flatten().fold(0.0, |most, v| f64::max(most, v.abs()));
        let is_small = |[low, high]: &[f64; 2]| {
            let extent = high - low;
            extent < SMALL && extent > NOISE * largest
        };
        Self(ranges.into_iter().map(|r| Some(r).filter(is_small)).collect())
    }

    /// Whether there is a small state.
    pub fn has_small(&self) -> bool {
        self.0.iter().any(Option::is_some)
    }

    /// The largest distance of a path from a state: `chord`, or less of a small one.
    pub fn chord(&self, state: usize, chord: f64) -> f64 {
        match self.0.get(state) {
            Some(Some([low, high])) if high - low < SMALL => chord.min(PART * (high - low)),
            _ => chord,
        }
    }

    /// Takes in a state.
    pub fn reach(&mut self, x: &[f64]) {
        for (range, v) in self.0.iter_mut().zip(x) {
            if let Some([low, high]) = range {
                (*low, *high) = (low.min(*v), high.max(*v));
            }
        }
    }
}
