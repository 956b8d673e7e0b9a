//! Everything that touches the file system: data files, hashes, manifests.
//!
//! Functions that make bytes live elsewhere and are pure; here they are named, hashed, and put in
//! place by one rename.
//!
//! ```
//! use twofold_job::record::Hash;
//! assert_eq!(Hash::of(b"abc").short(), "ba7816bf8f01");
//! // Canonical JSON: the order in which fields were written does not matter.
//! let (a, b) = (serde_json::json!({"x": 1, "y": 2}), serde_json::json!({"y": 2, "x": 1}));
//! assert_eq!(Hash::of_json(&a), Hash::of_json(&b));
//! ```

pub mod files;
pub mod folder;
pub mod hash;
pub mod journal;
pub mod manifest;

pub use files::{FileError, write};
pub use folder::{FileBytes, Tree, first_special, names, read_tree, visit_tree};
pub use hash::Hash;
pub use journal::Journal;
pub use manifest::{Layer, Manifest, PanelEntry, PictureEntry, VerdictEntry, listed};
