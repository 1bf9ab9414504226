//! What the tanker carries: marker id -> point on the tanker; tag id -> its four corners, as four such points.
//!
//! A [`MarkerMap`] exists only checked: ids unique, coordinates sane, and the points spread enough
//! that a pose can follow from them. Knows the tanker frame (x forward, y left, z up; metres) and
//! text that a caller brings; never pixels, files or whether a marker is in view.
//!
//! Which of the markers a frame shows is `estimation`'s business: a map that passes here can still
//! lose its pose in a frame that shows only three of them, and those in line.

mod budget;
mod check;
mod error;
mod file;
mod map;
mod marker;
mod tag;
mod tag_file;

pub use budget::{Flex, MAX_FLEX_MODES, MapBudget};
pub use check::MAX_COORDINATE_M;
pub use error::MarkerMapError;
pub use map::MarkerMap;
pub use marker::Marker;
pub use tag::Tag;
