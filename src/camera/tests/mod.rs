//! What the camera promises to other floors.

mod checks;
mod golden;
mod inverse;
mod readout;

use super::CameraInfo;

/// A 508×412 camera with fx = 571, fy = 569, cx = 254, cy = 206 and a lens.
fn info(model: &str, d: &[f64]) -> CameraInfo {
    CameraInfo {
        width: 508,
        height: 412,
        distortion_model: model.to_owned(),
        d: d.to_vec(),
        k: [571.0, 0.0, 254.0, 0.0, 569.0, 206.0, 0.0, 0.0, 1.0],
        ..CameraInfo::default()
    }
}
