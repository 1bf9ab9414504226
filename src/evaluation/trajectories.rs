//! Trajectories for `evo` and other programs: the format of TUM, and CSV for what that has no place for.

use std::fmt::Write;

use nalgebra::Isometry3;

use super::gather::StampedPose;

/// Nanoseconds in a second.
const SECOND_NS: i64 = 1_000_000_000;

/// Returns poses in the format of TUM, in the order of their stamps, each stamp once.
pub(super) fn tum(poses: impl Iterator<Item = (i64, Isometry3<f64>)>) -> String {
    let mut sorted: Vec<_> = poses.collect();
    sorted.sort_by_key(|(stamp_ns, _)| *stamp_ns);
    sorted.dedup_by_key(|(stamp_ns, _)| *stamp_ns);
    let mut text = String::from("# timestamp_s tx_m ty_m tz_m qx qy qz qw (camera from tanker)\n");
    for (stamp_ns, pose) in sorted {
        let (t, q) = (&pose.translation, pose.rotation.quaternion());
        // Writing into a string cannot fail.
        let _ = writeln!(
            text,
            "{} {} {} {} {} {} {} {}",
            stamp(stamp_ns),
            t.x,
            t.y,
            t.z,
            q.i,
            q.j,
            q.k,
            q.w
        );
    }
    text
}

/// Returns stamps, velocities of the track and the covariances of poses and track, as CSV.
///
/// A row is a pose or an odometry. Velocities are in the tanker's axes, as `nav_msgs/Odometry` has them; a single-frame
/// pose has none. Of the symmetric covariance the upper triangle, row by row, m and rad.
pub(super) fn csv(poses: &[StampedPose], odometry: &[StampedPose]) -> String {
    const NAMES: [&str; 6] = ["x", "y", "z", "rot_x", "rot_y", "rot_z"];
    let mut text =
        String::from("timestamp_s,topic,vx_mps,vy_mps,vz_mps,wx_radps,wy_radps,wz_radps");
    for row in 0..6 {
        for column in row..6 {
            let _ = write!(text, ",cov_{}_{}", NAMES[row], NAMES[column]);
        }
    }
    text.push('\n');
    let all = poses.iter().map(|pose| (pose, "pose"));
    let mut rows: Vec<_> = all
        .chain(odometry.iter().map(|pose| (pose, "odometry")))
        .collect();
    rows.sort_by_key(|(pose, topic)| (pose.stamp_ns, std::cmp::Reverse(*topic)));
    for (pose, topic) in rows {
        let _ = write!(text, "{},{topic}", stamp(pose.stamp_ns));
        for axis in 0..6 {
            match &pose.twist {
                Some(twist) => drop(write!(text, ",{}", twist[axis])),
                None => text.push(','),
            }
        }
        for row in 0..6 {
            for column in row..6 {
                let _ = write!(text, ",{}", pose.covariance.0[(row, column)]);
            }
        }
        text.push('\n');
    }
    text
}

/// Returns a stamp in seconds, all of its nanoseconds.
fn stamp(stamp_ns: i64) -> String {
    let (seconds, rest) = (
        stamp_ns.div_euclid(SECOND_NS),
        stamp_ns.rem_euclid(SECOND_NS),
    );
    format!("{seconds}.{rest:09}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_keep_their_nanoseconds_and_come_once_in_order() {
        let pose = Isometry3::translation(1.0, 2.0, 3.0);
        let text = tum([(1_700_000_000_000_000_001, pose), (7, pose), (7, pose)].into_iter());
        let lines: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(
            lines,
            [
                "0.000000007 1 2 3 0 0 0 1",
                "1700000000.000000001 1 2 3 0 0 0 1"
            ]
        );
    }
}
