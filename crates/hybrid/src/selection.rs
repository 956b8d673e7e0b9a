//! Where motion goes from switching surfaces.
//!
//! At a point where k switching functions are zero each may go to its positive side (its derivative is positive there), to its negative side (negative),
//! or stay at zero, where the field is a mixture of those on both sides (Filippov 1988, sec. 4). What is possible is what is consistent: an assignment in which every
//! function does what it is said to do. One possibility is the motion; several are a motion that is not decided.

/// What a switching function does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Goes to its negative side.
    Minus,
    /// Stays at zero.
    Stay,
    /// Goes to its positive side.
    Plus,
}

impl Way {
    /// The sign that stands for it in tables.
    pub fn sign(self) -> char {
        match self {
            Way::Minus => '-',
            Way::Stay => '0',
            Way::Plus => '+',
        }
    }
}

/// Most surfaces that depend on each other at one point.
pub const MOST_TOGETHER: usize = 6;

/// All assignments of ways to `k` functions that are consistent; `consistent` says whether one is.
pub(crate) fn possibilities(k: usize, mut consistent: impl FnMut(&[Way]) -> bool) -> Vec<Vec<Way>> {
    let ways = [Way::Plus, Way::Minus, Way::Stay];
    let mut found = Vec::new();
    for code in 0..3_usize.pow(k as u32) {
        let mut rest = code;
        let mut assignment = Vec::with_capacity(k);
        for _ in 0..k {
            assignment.push(ways[rest % 3]);
            rest /= 3;
        }
        if consistent(&assignment) {
            found.push(assignment);
        }
    }
    found
}

/// Groups of functions that depend on each other: `coupled(i, j)` says whether the side of j changes the derivative of i.
pub(crate) fn groups(k: usize, coupled: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let mut group: Vec<usize> = (0..k).collect();
    for i in 0..k {
        for j in 0..i {
            if group[i] != group[j] && (coupled(i, j) || coupled(j, i)) {
                let (from, to) = (group[i].max(group[j]), group[i].min(group[j]));
                group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
            }
        }
    }
    let mut names = group.clone();
    names.sort_unstable();
    names.dedup();
    names.iter().map(|name| (0..k).filter(|i| group[*i] == *name).collect()).collect()
}
