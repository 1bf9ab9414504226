//! Converts poses between frames, one JSON line in, one out: what a bridge to a flight stack does.
//!
//! ```sh
//! echo '{"position": [0.5, -2, 20], "orientation": [0.5, -0.5, 0.5, -0.5], "covariance": null,
//!        "steps": [{"flu_from_optical": null}, {"frd_from_flu": null}]}' | tr -d '\n' |
//!   cargo run --example convert_frames
//! ```
//!
//! `position` (m) and `orientation` (quaternion x, y, z, w) are those of a ROS pose, `covariance` its 36
//! numbers or null. The steps are applied in order; each is one of [`Step`].

use std::io::{self, BufRead, Write};

use nalgebra::{Isometry3, Matrix3, Matrix6, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use tanker_pose::frames::{
    LocalAttitude, PoseEstimate, flu_from_optical, frd_from_flu, ned_from_enu, rotation_only,
};
use tanker_pose::geometry::PoseCovariance;

#[derive(Deserialize)]
struct Request {
    position: [f64; 3],
    orientation: [f64; 4],
    covariance: Option<Vec<f64>>,
    steps: Vec<Step>,
}

/// One change of a pose.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Step {
    /// From the axes of a camera to those of a body that looks the same way.
    FluFromOptical(()),
    /// From ROS's body axes to those of flight stacks.
    FrdFromFlu(()),
    /// From ROS's local axes to those of PX4.
    NedFromEnu(()),
    /// From the target's FLU to its FRD.
    TargetFrdFromFlu(()),
    /// The observer seen by the target.
    Inverse(()),
    /// From an origin to another point of the observer, m.
    SeenFromPoint([f64; 3]),
    /// From the target's origin to another point of it, m.
    OfPoint([f64; 3]),
    /// To local axes, by the attitude of the observer.
    LocalAxes {
        orientation: [f64; 4],
        covariance: [f64; 9],
    },
}

#[derive(Serialize)]
struct Answer {
    position: [f64; 3],
    orientation: [f64; 4],
    covariance: Option<Vec<f64>>,
}

fn quaternion([x, y, z, w]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
}

fn at(point: [f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(Vector3::from(point)),
        UnitQuaternion::identity(),
    )
}

fn changed(pose: &PoseEstimate, step: &Step) -> PoseEstimate {
    match step {
        Step::FluFromOptical(()) => pose.seen_from(&rotation_only(&flu_from_optical())),
        Step::FrdFromFlu(()) => pose.seen_from(&rotation_only(&frd_from_flu())),
        Step::NedFromEnu(()) => pose.seen_from(&rotation_only(&ned_from_enu())),
        Step::TargetFrdFromFlu(()) => pose.of(&rotation_only(&frd_from_flu())),
        Step::Inverse(()) => pose.inverse(),
        Step::SeenFromPoint(point) => pose.seen_from(&at(*point).inverse()),
        Step::OfPoint(point) => pose.of(&at(*point)),
        Step::LocalAxes {
            orientation,
            covariance,
        } => pose.in_local_axes(&LocalAttitude {
            local_from_b: quaternion(*orientation),
            covariance: Matrix3::from_row_slice(covariance),
            rate_in_b: Vector3::zeros(),
            rate_covariance: Matrix3::zeros(),
        }),
    }
}

fn convert(line: &str) -> Result<Answer, String> {
    let request: Request = serde_json::from_str(line).map_err(|error| error.to_string())?;
    let known = request.covariance.is_some();
    let covariance = request.covariance.unwrap_or_else(|| vec![0.0; 36]);
    if covariance.len() != 36 {
        return Err(format!(
            "covariance: expected 36 numbers, got {}",
            covariance.len()
        ));
    }
    let start = PoseEstimate {
        b_from_a: Isometry3::from_parts(
            Translation3::from(Vector3::from(request.position)),
            quaternion(request.orientation),
        ),
        covariance: PoseCovariance(Matrix6::from_row_slice(&covariance)),
    };
    let end = request
        .steps
        .iter()
        .fold(start, |pose, step| changed(&pose, step));
    let rotation = end.b_from_a.rotation.quaternion();
    Ok(Answer {
        position: end.b_from_a.translation.vector.into(),
        orientation: [rotation.i, rotation.j, rotation.k, rotation.w],
        covariance: known.then(|| end.covariance.row_major().to_vec()),
    })
}

fn main() -> io::Result<()> {
    let mut out = io::stdout().lock();
    for line in io::stdin().lock().lines() {
        let answer = match convert(&line?) {
            Ok(answer) => serde_json::to_string(&answer)?,
            Err(error) => serde_json::json!({ "error": error }).to_string(),
        };
        writeln!(out, "{answer}")?;
    }
    Ok(())
}
