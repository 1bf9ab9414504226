//! The plain data of `sensor_msgs/CameraInfo`.

/// `sensor_msgs/CameraInfo` without its header, as plain unchecked data.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CameraInfo {
    /// Image height at full resolution, px.
    pub height: u32,
    /// Image width at full resolution, px.
    pub width: u32,
    /// `plumb_bob`, `rational_polynomial`, `equidistant`, or empty.
    pub distortion_model: String,
    /// Distortion coefficients in the model's order.
    pub d: Vec<f64>,
    /// Intrinsics of the raw image, row-major.
    pub k: [f64; 9],
    /// Rectification rotation, row-major.
    pub r: [f64; 9],
    /// Projection of the rectified image, row-major 3×4.
    pub p: [f64; 12],
    /// Columns combined into one; 0 means 1.
    pub binning_x: u32,
    /// Rows combined into one; 0 means 1.
    pub binning_y: u32,
    /// Part of the sensor that was read out.
    pub roi: RegionOfInterest,
}

/// `sensor_msgs/RegionOfInterest`, in unbinned full-resolution pixels; all zero means the whole image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RegionOfInterest {
    /// Leftmost column.
    pub x_offset: u32,
    /// Topmost row.
    pub y_offset: u32,
    /// Height, px.
    pub height: u32,
    /// Width, px.
    pub width: u32,
    /// Whether a separate rectified region is used.
    pub do_rectify: bool,
}
