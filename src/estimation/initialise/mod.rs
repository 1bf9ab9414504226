//! Initial rotations from the image alone: linear, or by search.
//!
//! The nominal and the previous attitude need no code here: the caller supplies them.

mod dlt;
mod global;

pub use dlt::linear_rotation;
pub(crate) use global::search;
