//! Everything that touches the file system: data files, hashes, manifests.
//!
//! Functions that make bytes live elsewhere and are pure; here they are named, hashed, and put in place by one rename.

pub mod files;
pub mod folder;
pub mod hash;
pub mod manifest;

pub use files::{FileError, write};
pub use folder::{FileBytes, Tree, read_tree};
pub use hash::Hash;
pub use manifest::{Layer, Manifest, PanelEntry, PictureEntry, VerdictEntry};
