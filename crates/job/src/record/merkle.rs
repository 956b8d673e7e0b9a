//! A tree of hashes (Merkle 1987): one digest, the root, stands for a list of things, and each of them can be shown to be in the list by a few
//! digests more.
//!
//! Leaves and nodes are hashed apart (`leaf` and `node` before what is hashed), so that neither passes for the other. A node without
//! neighbour rises as it is.
//!
//! ```
//! use twofold_job::record::merkle::{Tree, leaf};
//! let tree = Tree::of((0..5).map(|i| leaf(&[i])).collect());
//! let path = tree.path(3).expect("there is a leaf 3");
//! assert_eq!(path.root(&leaf(&[3])), *tree.root());
//! assert_ne!(path.root(&leaf(&[4])), *tree.root());
//! ```

use serde::{Deserialize, Serialize};

use super::Hash;

/// The digest of a thing in the list.
pub fn leaf(bytes: &[u8]) -> Hash {
    Hash::of(&[b"leaf ", bytes].concat())
}

fn node(left: &Hash, right: &Hash) -> Hash {
    Hash::of(format!("node {} {}", left.as_str(), right.as_str()).as_bytes())
}

/// The tree over a list of leaves.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    /// From the leaves to the root, which stands alone.
    levels: Vec<Vec<Hash>>,
    root: Hash,
}

impl Tree {
    /// The tree over these leaves. That over none has the root of nothing.
    pub fn of(leaves: Vec<Hash>) -> Self {
        let mut levels = vec![leaves];
        loop {
            let level = &levels[levels.len() - 1];
            if level.len() <= 1 {
                let root = level.first().cloned().unwrap_or_else(|| Hash::of(b"nothing"));
                return Self { levels, root };
            }
            let above = level.chunks(2).map(|pair| match pair {
                [left, right] => node(left, right),
                alone => alone[0].clone(),
            });
            levels.push(above.collect());
        }
    }

    /// The digest that stands for all leaves and their order.
    pub fn root(&self) -> &Hash {
        &self.root
    }

    /// What shows that a leaf is in the tree, if there is such a leaf.
    pub fn path(&self, leaf: usize) -> Option<Path> {
        self.levels[0].get(leaf)?;
        let mut at = leaf;
        let mut steps = Vec::new();
        for level in &self.levels {
            if let Some(neighbour) = level.get(at ^ 1) {
                steps.push(Neighbour {
                    side: if at & 1 == 1 { Side::Left } else { Side::Right },
                    hash: neighbour.clone(),
                });
            }
            at /= 2;
        }
        Some(Path(steps))
    }
}

/// From a leaf up to the root: its neighbours.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Path(Vec<Neighbour>);

/// A neighbour on the way.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Neighbour {
    /// On which side it stands.
    pub side: Side,
    /// Its digest.
    pub hash: Hash,
}

/// Left or right.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// Before.
    Left,
    /// Behind.
    Right,
}

impl Path {
    /// The root of the tree that holds `leaf` in this place.
    pub fn root(&self, leaf: &Hash) -> Hash {
        self.0.iter().fold(leaf.clone(), |below, step| match step.side {
            Side::Left => node(&step.hash, &below),
            Side::Right => node(&below, &step.hash),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaves(n: usize) -> Vec<Hash> {
        (0..n).map(|i| leaf(&[i as u8])).collect()
    }

    #[test]
    fn every_leaf_leads_to_the_root_and_nothing_else_does() {
        for n in 0..40 {
            let tree = Tree::of(leaves(n));
            for (i, leaf) in leaves(n).iter().enumerate() {
                let path = tree.path(i).unwrap();
                assert_eq!(path.root(leaf), *tree.root(), "{i} of {n}");
                assert_ne!(path.root(&super::leaf(b"other")), *tree.root());
                // In another place it is not.
                for j in (0..n).filter(|j| *j != i) {
                    assert_ne!(tree.path(j).unwrap().root(leaf), *tree.root(), "{i} as {j} of {n}");
                }
            }
            assert_eq!(tree.path(n), None);
        }
    }

    #[test]
    fn every_change_changes_the_root() {
        let mut roots = std::collections::BTreeSet::new();
        for n in 0..20 {
            assert!(roots.insert(Tree::of(leaves(n)).root().clone()), "{n} leaves");
            for i in 0..n {
                let mut changed = leaves(n);
                changed[i] = leaf(b"other");
                assert!(roots.insert(Tree::of(changed).root().clone()), "leaf {i} of {n}");
            }
        }
        let mut swapped = leaves(5);
        swapped.swap(1, 2);
        assert!(roots.insert(Tree::of(swapped).root().clone()));
    }

    #[test]
    fn a_node_is_no_leaf() {
        let tree = Tree::of(leaves(2));
        let inner = format!("{} {}", leaves(2)[0].as_str(), leaves(2)[1].as_str());
        assert_ne!(leaf(inner.as_bytes()), *tree.root());
        assert_eq!(*Tree::of(leaves(1)).root(), leaves(1)[0]);
    }
}
