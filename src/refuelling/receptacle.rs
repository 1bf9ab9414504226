//! The receptacle relative to the probe tip, from the motion of the tanker in the camera.

use nalgebra::{
    Isometry3, Matrix3, Matrix6, Point3, SMatrix, Translation3, UnitQuaternion, Vector3,
};

use crate::frames::PoseEstimate;
use crate::geometry::{Matrix12, Motion, PoseCovariance, congruent, set, skew};

/// Fixed geometry of the two aircraft, from drawings and calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefuellingGeometry {
    /// The camera's mount: its optical frame (x right, y down, z ahead) in the receiver (FLU), m.
    pub receiver_from_camera: Isometry3<f64>,
    /// Covariance of that mount in the receiver's axes. The error is the same in every frame, so a filter does not
    /// average it out.
    pub mount_covariance: PoseCovariance,
    /// Tip of the probe, receiver frame, m.
    pub probe_tip_in_receiver: Point3<f64>,
    /// Centre of drogue, basket or receptacle, tanker frame, m.
    pub receptacle_in_tanker: Point3<f64>,
    /// Covariance of its deviation from there, in the tanker's axes, m².
    pub receptacle_covariance: Matrix3<f64>,
}

/// Why a geometry cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{what}: expected {expected}")]
pub struct RefuellingGeometryError {
    /// Which part of the geometry.
    pub what: &'static str,
    /// The requirement.
    pub expected: &'static str,
}

/// A value with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertain {
    /// The value.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// The receptacle relative to the probe tip, in the receiver's axes (FLU).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReceptacleEstimate {
    /// From the probe tip to the receptacle, m.
    pub receptacle_from_probe: Vector3<f64>,
    /// Its derivative in the receiver's frame, m/s.
    pub velocity_in_receiver: Vector3<f64>,
    /// Of (position, velocity), in m and m/s.
    pub covariance: Matrix6<f64>,
}

const FINITE: &str = "finite numbers";
const COVARIANCE: &str = "a finite, symmetric matrix without negative variances";

impl RefuellingGeometry {
    /// Checks that the geometry is valid.
    ///
    /// # Errors
    /// [`RefuellingGeometryError`] names the first part that is not finite, or not a valid covariance.
    pub fn check(&self) -> Result<(), RefuellingGeometryError> {
        let expect = |fine: bool, what, expected| {
            if fine {
                Ok(())
            } else {
                Err(RefuellingGeometryError { what, expected })
            }
        };
        let mount = &self.receiver_from_camera;
        let numbers = mount
            .translation
            .vector
            .iter()
            .chain(mount.rotation.coords.iter());
        expect(
            numbers.copied().all(f64::is_finite),
            "receiver_from_camera",
            FINITE,
        )?;
        let is_finite = |point: &Point3<f64>| point.iter().copied().all(f64::is_finite);
        let probe = &self.probe_tip_in_receiver;
        expect(is_finite(probe), "probe_tip_in_receiver", FINITE)?;
        let receptacle = &self.receptacle_in_tanker;
        expect(is_finite(receptacle), "receptacle_in_tanker", FINITE)?;
        // Zero is allowed, so the eigenvalues are checked, up to rounding.
        let m = &self.mount_covariance.0;
        let fine = m.iter().copied().all(f64::is_finite)
            && *m == m.transpose()
            && m.symmetric_eigenvalues().min() >= -1e-12 * m.amax();
        expect(fine, "mount_covariance", COVARIANCE)?;
        let m = &self.receptacle_covariance;
        let fine = m.iter().copied().all(f64::is_finite)
            && *m == m.transpose()
            && m.symmetric_eigenvalues().min() >= -1e-12 * m.amax();
        expect(fine, "receptacle_covariance", COVARIANCE)
    }

    /// Returns the receptacle relative to the probe tip.
    ///
    /// # Inputs
    /// * `camera_from_tanker`: the track, or its prediction at the required time.
    #[must_use]
    pub fn receptacle(&self, camera_from_tanker: &Motion) -> ReceptacleEstimate {
        let receiver_from_receptacle = self.receptacle_motion(camera_from_tanker);
        let motion = &receiver_from_receptacle.covariance;
        let mut covariance = Matrix6::zeros();
        for (row, from_row) in [(0, 0), (3, 6)] {
            for (column, from_column) in [(0, 0), (3, 6)] {
                let block = motion
                    .fixed_view::<3, 3>(from_row, from_column)
                    .into_owned();
                set(&mut covariance, row, column, &block);
            }
        }
        ReceptacleEstimate {
            receptacle_from_probe: receiver_from_receptacle.b_from_a.translation.vector
                - self.probe_tip_in_receiver.coords,
            velocity_in_receiver: receiver_from_receptacle.velocity_in_b,
            covariance,
        }
    }

    /// Returns the receptacle's motion in the receiver, relative to the receiver's origin, with the tanker's attitude.
    /// The covariance includes that of the mount and, in the position, that of the receptacle's own deviation, whose
    /// motion is unknown.
    #[must_use]
    pub fn receptacle_motion(&self, camera_from_tanker: &Motion) -> Motion {
        let tanker_from_receptacle = Isometry3::from_parts(
            Translation3::from(self.receptacle_in_tanker),
            UnitQuaternion::identity(),
        );
        let mut found = camera_from_tanker
            .of(&tanker_from_receptacle)
            .seen_from(&self.receiver_from_camera);
        let from_mount =
            found.b_from_a.translation.vector - self.receiver_from_camera.translation.vector;
        // An error δθ of the mount rotates all observations: δt = δo + δθ × c, δv = δθ × v, δω = δθ × ω.
        let mut of_mount = SMatrix::<f64, 12, 6>::zeros();
        set(&mut of_mount, 0, 0, &Matrix3::identity());
        set(&mut of_mount, 0, 3, &-skew(from_mount));
        set(&mut of_mount, 3, 3, &Matrix3::identity());
        set(&mut of_mount, 6, 3, &-skew(found.velocity_in_b));
        set(&mut of_mount, 9, 3, &-skew(found.rate_in_b));
        found.covariance += congruent(&of_mount, &self.mount_covariance.0);
        let receiver_from_tanker = found.b_from_a.rotation.to_rotation_matrix();
        let swing = congruent(receiver_from_tanker.matrix(), &self.receptacle_covariance);
        let mut position = found.covariance.fixed_view_mut::<3, 3>(0, 0);
        position += swing;
        found
    }

    /// Returns the receptacle's pose in the receiver from a single frame, as [`Self::receptacle_motion`] without the
    /// motion.
    #[must_use]
    pub fn receptacle_pose(&self, camera_from_tanker: &PoseEstimate) -> PoseEstimate {
        let mut covariance = Matrix12::zeros();
        covariance
            .fixed_view_mut::<6, 6>(0, 0)
            .copy_from(&camera_from_tanker.covariance.0);
        let at_rest = self.receptacle_motion(&Motion {
            b_from_a: camera_from_tanker.b_from_a,
            velocity_in_b: Vector3::zeros(),
            rate_in_b: Vector3::zeros(),
            covariance,
        });
        PoseEstimate {
            b_from_a: at_rest.b_from_a,
            covariance: at_rest.pose_covariance(),
        }
    }
}

impl ReceptacleEstimate {
    /// Returns the covariance of the position, m².
    #[must_use]
    pub fn position_covariance(&self) -> Matrix3<f64> {
        self.covariance.fixed_view::<3, 3>(0, 0).into_owned()
    }

    /// Returns the closing speed along the receiver's x axis, m/s: positive while the probe approaches the receptacle.
    ///
    /// Along the axis rather than the line between them, whose direction is undefined near contact.
    #[must_use]
    pub fn closing_speed_mps(&self) -> Uncertain {
        Uncertain {
            value: -self.velocity_in_receiver.x,
            sigma: self.covariance[(3, 3)].max(0.0).sqrt(),
        }
    }

    /// Returns the distance ahead along the receiver's x axis, m.
    #[must_use]
    pub fn distance_ahead_m(&self) -> Uncertain {
        Uncertain {
            value: self.receptacle_from_probe.x,
            sigma: self.covariance[(0, 0)].max(0.0).sqrt(),
        }
    }
}
