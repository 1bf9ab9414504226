//! The mount of the camera and the expected attitude of the tanker, from the parameters.

use super::table::Values;
use crate::refuelling::{Angles, ExpectedAttitude};

pub(super) fn expected_attitude(values: &Values) -> ExpectedAttitude {
    ExpectedAttitude {
        mount: Angles {
            roll_deg: values.camera_mount_roll_deg,
            pitch_deg: values.camera_mount_pitch_deg,
            yaw_deg: values.camera_mount_yaw_deg,
        },
        nominal: Angles {
            roll_deg: values.nominal_roll_deg,
            pitch_deg: values.nominal_pitch_deg,
            yaw_deg: values.nominal_yaw_deg,
        },
        limit_deg: values.max_attitude_deviation_deg,
    }
}
