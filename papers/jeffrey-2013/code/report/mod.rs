//! The report: everything that was made, held against the paper and against the committed
//! reference.
//!
//! [`assemble`] reads records, files and manifests (as bytes: nothing here touches a file) into a
//! [`Report`]; [`page()`] writes it for people, [`Report::to_json`] for programs, [`archive`] as
//! RO-Crate metadata. Which figures there are is read from the records, not known here. Same input,
//! same bytes: no clock, no path of the machine.
//!
//! ```
//! use twofold_jeffrey_2013::report::{Links, MadeFile, Program, assemble, page};
//! // No record vouches for this file, so it counts for nothing.
//! let file = MadeFile::of("own/table.csv".into(), b"t,x\n".to_vec());
//! let report = assemble(&[file], &[], &Program { figures: &[], findings: "", odds: "" });
//! assert_eq!((report.summary.pictures, report.summary.panels), (0, 0));
//! assert!(page(&report, Links::Beside).starts_with(b"<!DOCTYPE html>"));
//! ```

mod archive;
mod assemble;
mod model;
mod page;
mod prose;
mod rules;
mod space;

pub use archive::{RELEASE_DATE, archive};
pub use assemble::{MadeFile, Program, assemble};
pub use model::*;
pub use page::{Links, page};
pub use space::SpaceView;

/// File names of what the report writes, in the folder of the figures.
pub mod names {
    /// The page.
    pub const PAGE: &str = "index.html";
    /// Its twin for programs.
    pub const REPORT: &str = "report.json";
    /// All verdicts with their evidence.
    pub const VERDICTS: &str = "verdicts.json";
    /// File that records how the figures were made: program, machine, times. Written by
    /// `twofold figure`.
    pub const MAKING: &str = "making.json";
    /// RO-Crate metadata.
    pub const ARCHIVE: &str = "ro-crate-metadata.json";
}
