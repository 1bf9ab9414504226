//! The files of a calibration: what the node reads, and the report.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use tanker_pose::calibration::Calibration;
use tanker_pose::frames::flu_from_optical;
use tanker_pose::replay::Flight;

use super::report;

/// The smallest sigma of a detection that is worth stating, px, and the largest that the parameter takes.
const SIGMAS_PX: [f64; 2] = [0.01, 100.0];

/// The same of time constants of correlated noise, s.
const TIMES_S: [f64; 2] = [1e-3, 1e4];

/// A file that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct FilesError {
    path: PathBuf,
    source: std::io::Error,
}

/// Writes all files into a folder, which is made if it does not exist.
pub fn write(folder: &Path, flight: &Flight, found: &Calibration) -> Result<(), FilesError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| FilesError { path, source }
    };
    std::fs::create_dir_all(folder).map_err(failed(folder))?;
    let put = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(failed(&path))?;
        Ok::<PathBuf, FilesError>(std::path::absolute(&path).unwrap_or(path))
    };
    let map = put("map.yaml", &flight.map.to_yaml(&found.map.change))?;
    let mut parameters = format!(
        "# Written by tanker_pose calibrate-map; docs/calibrate-map.md.\n/**:\n  ros__parameters:\n    marker_map: {}\n",
        quoted(&map)
    );
    // Writing into a string cannot fail.
    if let Some(camera) = &found.camera {
        let mut info = flight.info.clone();
        if camera.is_moved {
            info = flight.info.with_change(&flight.camera, &camera.change);
            let path = put("camera.yaml", &info.to_yaml())?;
            let _ = writeln!(
                parameters,
                "    # Map and budget hold only with the refined camera in camera_info: {}.",
                quoted(&path)
            );
        }
        let moved = flight.camera.with_change(&camera.change);
        let budget = info.budget_to_yaml(&moved, &camera.covariance);
        let path = put("calibration_budget.yaml", &budget)?;
        let _ = writeln!(parameters, "    calibration_budget_file: {}", quoted(&path));
        for sigma in [
            "focal_length_sigma",
            "principal_point_sigma_px",
            "k1_sigma",
            "k2_sigma",
        ] {
            let _ = writeln!(parameters, "    {sigma}: 0.0");
        }
    }
    let sigma_px = found.noise.sigma_to_state_px();
    let _ = writeln!(
        parameters,
        "    pixel_sigma_px: {:.4}",
        sigma_px.clamp(SIGMAS_PX[0], SIGMAS_PX[1])
    );
    if let Some(lasting) = found.noise.in_time {
        let _ = writeln!(
            parameters,
            "    correlated_noise_share: {:.4}\n    correlated_noise_time_s: {:.4}",
            lasting.share,
            lasting.time_constant_s.clamp(TIMES_S[0], TIMES_S[1])
        );
    }
    if let Some(mount) = found.mount.as_ref().filter(|mount| mount.is_moved) {
        let receiver_from_camera = mount.camera_from_receiver.inverse();
        let turned = receiver_from_camera * flu_from_optical().inverse();
        let (roll, pitch, yaw) = turned.euler_angles();
        for (name, angle) in [("roll", roll), ("pitch", pitch), ("yaw", yaw)] {
            let _ = writeln!(
                parameters,
                "    camera_mount_{name}_deg: {:.5}",
                angle.to_degrees()
            );
        }
    }
    put("parameters.yaml", &parameters)?;
    put("report.json", &report::json(found))?;
    Ok(())
}

/// A path as YAML reads it back: JSON's strings are YAML's.
fn quoted(path: &Path) -> String {
    serde_json::Value::from(path.display().to_string()).to_string()
}
