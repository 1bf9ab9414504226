//! Markers on the tanker: from marker id to point; from tag id to its four corners, which are markers too.
//!
//! A [`MarkerMap`] can only be constructed through its checks: unique ids, plausible coordinates, and points that are
//! spread enough to determine a pose. Depends on the tanker frame (x forward, y left, z up; metres) and on text from
//! the caller, and not on pixels, files or visibility.
//!
//! `estimation` checks the markers of each frame: with a valid map, a frame that shows only three collinear markers
//! still has no pose.

mod budget;
mod check;
mod error;
mod file;
mod map;
mod marker;
mod tag;
mod tag_file;
mod written;

pub(crate) use budget::CORNER_FACTOR;
pub use budget::{Flex, MAX_FLEX_MODES, MapBudget};
pub use check::MAX_COORDINATE_M;
pub use error::MarkerMapError;
pub use map::{MarkerMap, NamedPoint};
pub use marker::Marker;
pub use tag::Tag;
pub use written::{BodyChange, MAP_ERROR, MapChange};
