//! What a calibration found, for people and for programs.

use std::path::Path;

use serde_json::json;
use tanker_pose::calibration::{Calibration, Movement, Parameter};

/// Returns whether anything was moved.
pub fn is_anything_moved(found: &Calibration) -> bool {
    found
        .parameters
        .iter()
        .any(|p| p.movement == Movement::Moved)
}

/// Returns the report as JSON.
pub fn json(found: &Calibration) -> String {
    let parameters: Vec<_> = found
        .parameters
        .iter()
        .map(|parameter| {
            let mut value = serde_json::to_value(parameter).unwrap_or_default();
            value["reason"] = parameter.movement.reason().into();
            value
        })
        .collect();
    let rows = |matrix: &nalgebra::DMatrix<f64>| -> Vec<Vec<f64>> {
        matrix
            .row_iter()
            .map(|row| row.iter().copied().collect())
            .collect()
    };
    let value = json!({
        "frames": found.frames,
        "used_frames": found.used_frames,
        "used_detections": found.used_points,
        "left_out_detections": found.left_out_points,
        "steps": found.steps,
        "chi_squared": found.cost,
        "parameters": parameters,
        "gauge": found.gauge,
        "noise": found.noise,
        "noise_sigma_to_state_px": found.noise.sigma_to_state_px(),
        "lasting_factor": found.lasting_factor,
        "map": {
            "bodies": found.map.bodies,
            "covariance_m2": rows(&found.map.covariance),
            "claimed_m2": rows(&found.map.claimed),
        },
        "camera": found.camera.as_ref().map(|camera| json!({
            "is_moved": camera.is_moved,
            "change": camera.change.as_slice(),
            "covariance": rows(&camera.covariance),
        })),
        "mount": found.mount.as_ref().map(|mount| json!({
            "is_moved": mount.is_moved,
            "frames_with_attitudes": mount.frames,
            "sigma_deg": mount.sigma_rad.map(f64::to_degrees),
        })),
        "warnings": found.warnings,
    });
    format!("{value:#}\n")
}

/// Prints the report.
pub fn say(found: &Calibration, folder: &Path) {
    println!(
        "{} of {} frames used, {} detections; {} left out as wrong",
        found.used_frames, found.frames, found.used_points, found.left_out_points
    );
    println!("\nparameter                            moved by      sigmas   sigma before -> after");
    for parameter in &found.parameters {
        println!("{}", line(parameter));
    }
    if !found.gauge.is_empty() {
        println!("\nall markers together (what no image shows stays as surveyed):");
    }
    for mode in &found.gauge {
        println!(
            "  {:<8} sigma {:.4} -> {:.4} {}{}",
            mode.name,
            mode.sigma_before,
            mode.sigma_after,
            mode.unit,
            if mode.told {
                ""
            } else {
                ", not told by the data"
            }
        );
    }
    let noise = &found.noise;
    println!(
        "\ndetector: {:.3} ± {:.3} px, {:.2} times what was stated; state {:.3} px",
        noise.sigma_px,
        noise.sigma_error_px,
        noise.factor_of_stated,
        noise.sigma_to_state_px()
    );
    if let Some((exponent, error)) = noise.growth_exponent {
        println!("  growth with the range: to the power {exponent:.2} ± {error:.2}");
    }
    match noise.in_time {
        None => println!("  no correlation from frame to frame"),
        Some(lasting) => println!(
            "  {:.0} % of the variance lasts, time constant {:.2} s",
            100.0 * lasting.share,
            lasting.time_constant_s
        ),
    }
    if let Some(corners) = noise.between_corners {
        println!(
            "  correlation between corners of a tag {:.2} ± {:.2}",
            corners.correlation, corners.error
        );
    }
    if let Some(mount) = &found.mount {
        println!(
            "\nmount: {} frames with attitudes of both aircraft",
            mount.frames
        );
    }
    for warning in &found.warnings {
        println!("warning: {warning}");
    }
    if !is_anything_moved(found) {
        println!("\nnothing was moved: the data support none of it");
    }
    println!("\nwritten into {}", folder.display());
    if found.camera.as_ref().is_some_and(|camera| camera.is_moved) {
        println!(
            "give camera.yaml to the camera's driver: map and budget hold only with it, and the node takes its camera from camera_info"
        );
    }
}

fn line(parameter: &Parameter) -> String {
    let text = format!(
        "{:<34} {:>10.5} {:<5} {:>6.2}   {:.5} -> {:.5}",
        parameter.name,
        parameter.estimate,
        parameter.unit,
        parameter.sigmas,
        parameter.sigma_before,
        parameter.sigma_after
    );
    match parameter.movement {
        Movement::Moved => text,
        other => format!("{text}  {}", other.reason()),
    }
}
