//! `visualization_msgs`, for `RViz` and Foxglove.

use serde::{Deserialize, Serialize};

use super::{Duration, Header, Point, Pose, Vector3};

/// `std_msgs/ColorRGBA`, each 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[expect(missing_docs, reason = "red, green, blue, opacity")]
pub struct ColorRGBA {
    pub r: f32,
    pub g: f32,
    pub b: f32,
    pub a: f32,
}

/// `sensor_msgs/CompressedImage`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct CompressedImage {
    /// Time of the image and the camera's optical frame.
    pub header: Header,
    /// Encoding and compression.
    pub format: String,
    /// The compressed image.
    pub data: Vec<u8>,
}

/// `visualization_msgs/UVCoordinate`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct UVCoordinate {
    /// Share of the texture's width.
    pub u: f32,
    /// Share of the texture's height.
    pub v: f32,
}

/// `visualization_msgs/MeshFile`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct MeshFile {
    /// Its name.
    pub filename: String,
    /// Its content.
    pub data: Vec<u8>,
}

/// `visualization_msgs/Marker`: something to draw.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Marker {
    /// When and where it holds.
    pub header: Header,
    /// What kind of thing it shows; with `id` its name.
    pub ns: String,
    /// Number within the kind.
    pub id: i32,
    /// Shape, a constant of this type.
    pub r#type: i32,
    /// A constant of this type.
    pub action: i32,
    /// Its pose; points are relative to it.
    pub pose: Pose,
    /// Extent, m; of lists that of each member, of lines only x, their width.
    pub scale: Vector3,
    /// Its colour.
    pub color: ColorRGBA,
    /// How long it is shown; 0: for ever.
    pub lifetime: Duration,
    /// Whether it moves with its frame.
    pub frame_locked: bool,
    /// Members of a list.
    pub points: Vec<Point>,
    /// A colour for each point.
    pub colors: Vec<ColorRGBA>,
    /// Not used here.
    pub texture_resource: String,
    /// Not used here.
    pub texture: CompressedImage,
    /// Not used here.
    pub uv_coordinates: Vec<UVCoordinate>,
    /// Of text markers.
    pub text: String,
    /// Not used here.
    pub mesh_resource: String,
    /// Not used here.
    pub mesh_file: MeshFile,
    /// Not used here.
    pub mesh_use_embedded_materials: bool,
}

impl Marker {
    /// Shape: an ellipsoid.
    pub const SPHERE: i32 = 2;
    /// Shape: lines, two points each.
    pub const LINE_LIST: i32 = 5;
    /// Shape: equal spheres.
    pub const SPHERE_LIST: i32 = 7;
    /// Action: show it.
    pub const ADD: i32 = 0;
    /// Action: remove all that this publisher has shown.
    pub const DELETEALL: i32 = 3;
}

/// `visualization_msgs/MarkerArray`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct MarkerArray {
    /// Acted on in this order.
    pub markers: Vec<Marker>,
}
