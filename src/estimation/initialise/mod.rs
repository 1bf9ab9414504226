//! First rotations for an iteration: from the image alone, linearly or by search.
//!
//! The nominal and the previous attitude need no code of their own: they are the caller's.

mod dlt;
mod global;

pub use dlt::linear_rotation;
pub(crate) use global::search;
