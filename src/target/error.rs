//! Why a marker map cannot be used.

use crate::text::quoted;
use crate::yaml::{Place, YamlError};

/// Why a marker map cannot be used; each message begins with the position in the file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "a variant's message names its fields")]
pub enum MarkerMapError {
    /// Not YAML, or not in the format of a marker map.
    #[error(transparent)]
    Yaml(#[from] YamlError),
    /// An id that does not fit into a detection.
    #[error("{place}: marker id must be 0 to {max}, got {id}", max = u32::MAX)]
    IdOutOfRange { place: Place, id: i64 },
    /// An id that two markers have.
    #[error("{place}: marker id {id} is already taken at {first}")]
    DuplicateId { place: Place, id: u32, first: Place },
    /// Too few markers for a pose.
    #[error("{place}: need at least {need} markers for a pose, got {got}")]
    TooFewMarkers {
        place: Place,
        got: usize,
        need: usize,
    },
    /// A coordinate that is NaN or infinite.
    #[error("{place}: {axis} of marker {id} must be a finite number of metres, got {value:?}")]
    NotFinite {
        place: Place,
        id: u32,
        axis: char,
        value: f64,
    },
    /// An implausible coordinate: a wrong unit or a slipped digit.
    #[error(
        "{place}: {axis} of marker {id} must be within {limit_m} m of the origin, got {value_m} m"
    )]
    TooFar {
        place: Place,
        id: u32,
        axis: char,
        value_m: f64,
        limit_m: f64,
    },
    /// Two markers at the same position.
    #[error(
        "{place}: marker {id} is {distance_m} m from marker {other} at {other_place}, must be at least {need_m} m"
    )]
    SamePlace {
        place: Place,
        id: u32,
        other: u32,
        other_place: Place,
        distance_m: f64,
        need_m: f64,
    },
    /// All markers are collinear: the rotation about their line cannot be observed.
    #[error(
        "{place}: all markers lie on one line (spread across it is {ratio:.1e} of that along it, need {need:.0e})"
    )]
    OnOneLine { place: Place, ratio: f64, need: f64 },
    /// A tag id that is too large: its corners would have no ids.
    #[error("{place}: tag id must be 0 to {max}, got {id}", max = super::Tag::MAX_ID)]
    TagIdOutOfRange { place: Place, id: i64 },
    /// An id that two tags have.
    #[error("{place}: tag id {id} is already taken at {first}")]
    DuplicateTag { place: Place, id: u32, first: Place },
    /// A single marker with the id of a tag's corner.
    #[error(
        "{place}: marker id {id} is that of a corner of the tag at {tag} (10 x tag id + corner)"
    )]
    CornerId { place: Place, id: u32, tag: Place },
    /// An implausible side length.
    #[error("{place}: size_m of tag {id} must be {least_m} to {most_m} m, got {size_m:?}")]
    TagSize {
        place: Place,
        id: u32,
        size_m: f64,
        least_m: f64,
        most_m: f64,
    },
    /// A number of a tag's pose that is NaN, infinite or implausible.
    #[error("{place}: {field} of tag {id} must be from -{limit} to {limit}, got {value:?}")]
    TagNumber {
        place: Place,
        id: u32,
        field: &'static str,
        value: f64,
        limit: f64,
    },
    /// No attitude, an incomplete one, or two.
    #[error(
        "{place}: tag {id} needs its attitude, as roll_deg, pitch_deg and yaw_deg or as qx, qy, qz and qw"
    )]
    TagAttitude { place: Place, id: u32 },
    /// A quaternion that is not normalised.
    #[error("{place}: the quaternion of tag {id} must have length 1, got {norm}")]
    TagQuaternion { place: Place, id: u32, norm: f64 },
    /// A family that is not a single word.
    #[error(
        "{place}: family of tag {id} must be one word such as tag36h11, got {}",
        quoted(family)
    )]
    TagFamily {
        place: Place,
        id: u32,
        family: String,
    },
    /// An implausible standard deviation.
    #[error("{place}: {of} must be 0 to {most_m} m, got {value_m}")]
    Sigma {
        place: Place,
        of: String,
        value_m: f64,
        most_m: f64,
    },
    /// An implausible time constant.
    #[error(
        "{place}: time_constant_s of flex mode `{name}` must be {least_s} to {most_s} s, got {value_s}; leave it out for a shape that lasts for the whole flight"
    )]
    TimeConstant {
        place: Place,
        name: String,
        value_s: f64,
        least_s: f64,
        most_s: f64,
    },
    /// A shape refers to a marker that is not on the map.
    #[error(
        "{place}: the shape of flex mode `{name}` must name a marker (`id`) or a tag (`tag`) of the map"
    )]
    FlexMarker { place: Place, name: String },
    /// A shape lists a marker twice.
    #[error("{place}: flex mode `{name}` moves marker {id} twice")]
    FlexMarkerTwice { place: Place, name: String, id: u32 },
    /// A displacement that is not a number, or is given in metres rather than relative to the amplitude.
    #[error(
        "{place}: a displacement of flex mode `{name}` must be at most {most} times its amplitude, got {length}"
    )]
    FlexShape {
        place: Place,
        name: String,
        length: f64,
        most: f64,
    },
    /// Two modes have the same name.
    #[error("{place}: flex mode `{name}` is defined twice")]
    DuplicateFlex { place: Place, name: String },
    /// Too many flex modes.
    #[error("{place}: a map may have at most {most} flex modes, got {got}")]
    TooManyFlexModes {
        place: Place,
        got: usize,
        most: usize,
    },
    /// A point without a name of its own.
    #[error(
        "{place}: a point needs a name of its own of at most {most} bytes, got {}",
        quoted(name)
    )]
    PointName {
        place: Place,
        name: String,
        most: usize,
    },
    /// A point that is on no aircraft.
    #[error(
        "{place}: {axis} of point {} must be within {limit_m} m of the origin, got {value:?}",
        quoted(name)
    )]
    PointNumber {
        place: Place,
        axis: char,
        name: String,
        value: f64,
        limit_m: f64,
    },
    /// More points than a frame has time for.
    #[error("{place}: a map may have at most {most} points, got {got}")]
    TooManyPoints {
        place: Place,
        got: usize,
        most: usize,
    },
}
