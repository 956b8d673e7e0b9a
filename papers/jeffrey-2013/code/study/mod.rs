//! Results of the studies: the paper's sentences, the rules that were fixed before the runs, and
//! the committed runs counted by them.

pub mod audit;
pub mod capture;
pub mod census;
pub mod claims;
pub mod effects;
pub mod resolved;
pub mod similarity;
pub mod verdict_table;
