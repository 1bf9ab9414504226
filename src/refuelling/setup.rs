//! Reads a refuelling setup's YAML into checked geometry and envelope; every error has its line.
//!
//! ```yaml
//! name: my_receiver
//! camera_in_receiver: {x: 1.2, y: 0.0, z: 0.9}              # m, receiver frame
//! camera_mount_sigma: {position_m: 0.005, attitude_deg: 0.1}
//! probe_tip_in_receiver: {x: 4.0, y: -0.8, z: 0.6}          # m, receiver frame
//! receptacle_in_tanker: {x: -9.0, y: 0.0, z: -1.5}          # m, tanker frame
//! receptacle_sigma: {x: 0.02, y: 0.05, z: 0.05}             # m, tanker frame
//! pre_contact: {box: {min: {x: -0.5, y: -2.0, z: -2.0}, max: {x: 8.0, y: 2.0, z: 2.0}}}
//! contact: {cylinder: {from_x_m: -0.1, to_x_m: 0.4, radius_m: 0.25}}
//! alert_limit: {ahead_m: 1.0, lateral_m: 0.5, vertical_m: 0.5}  # optional, of the receptacle
//! ```
//!
//! No other key may be left out: a forgotten lever arm would shift the receptacle unnoticed.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Rotation3, Vector3, Vector6};
use serde::Deserialize;
use serde_saphyr::Spanned;

use super::{Envelope, EnvelopeError, RefuellingGeometry, Region};
use crate::geometry::PoseCovariance;
use crate::yaml::{self, Place, YamlError};

/// m; larger than any aircraft.
const FARTHEST_M: f64 = 1000.0;
/// m; largest plausible standard deviation.
const LARGEST_SIGMA_M: f64 = 100.0;
/// m; no level is so small.
const LEAST_ALERT_LIMIT_M: f64 = 1e-3;
/// deg; beyond it a covariance is meaningless.
const LARGEST_SIGMA_DEG: f64 = 10.0;

/// Why a refuelling setup cannot be used; each message begins with the position in the file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "a variant's message names its fields")]
pub enum RefuellingSetupError {
    /// Not YAML, or not in the format of a setup.
    #[error(transparent)]
    Yaml(#[from] YamlError),
    /// A number that is NaN, infinite or out of range.
    #[error("{place}: {field} must be from {least} to {most}, got {value:?}")]
    Number {
        place: Place,
        field: String,
        value: f64,
        least: f64,
        most: f64,
    },
    /// Empty regions, or a contact window outside the pre-contact region.
    #[error("{place}: {source}")]
    Envelope {
        place: Place,
        source: Box<EnvelopeError>,
    },
}

/// Fixed geometry of the two aircraft, and the regions of the approach.
#[derive(Debug, Clone, PartialEq)]
pub struct RefuellingSetup {
    /// Its name.
    pub name: String,
    /// The regions of the approach.
    pub envelope: Envelope,
    /// Largest protection levels of the receptacle that contact may be made with: ahead, lateral, vertical in the
    /// receiver, m; `None`: not stated.
    pub alert_limit_m: Option<[f64; 3]>,
    camera_in_receiver: Vector3<f64>,
    mount_covariance: PoseCovariance,
    probe_tip_in_receiver: Point3<f64>,
    receptacle_in_tanker: Point3<f64>,
    receptacle_covariance: Matrix3<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSetup {
    name: String,
    camera_in_receiver: RawPoint,
    camera_mount_sigma: RawMountSigma,
    probe_tip_in_receiver: RawPoint,
    receptacle_in_tanker: RawPoint,
    receptacle_sigma: RawPoint,
    pre_contact: RawRegion,
    contact: Spanned<RawRegion>,
    alert_limit: Option<RawAlertLimit>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(
    clippy::struct_field_names,
    reason = "keys of the file, with their unit"
)]
struct RawAlertLimit {
    ahead_m: Spanned<f64>,
    lateral_m: Spanned<f64>,
    vertical_m: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPoint {
    x: Spanned<f64>,
    y: Spanned<f64>,
    z: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMountSigma {
    position_m: Spanned<f64>,
    attitude_deg: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
enum RawRegion {
    Box {
        min: RawPoint,
        max: RawPoint,
    },
    Cylinder {
        from_x_m: Spanned<f64>,
        to_x_m: Spanned<f64>,
        radius_m: Spanned<f64>,
    },
}

impl RefuellingSetup {
    /// Returns the setup in a text; `source` is its name in errors.
    ///
    /// # Errors
    /// [`RefuellingSetupError`] with file, line and column of the first error.
    pub fn from_yaml(text: &str, source: &str) -> Result<Self, RefuellingSetupError> {
        let raw: RawSetup = yaml::read(text, source)?;
        let read = Reader { source };
        let far = |point: &RawPoint, of: &str| read.vector(point, of, -FARTHEST_M, FARTHEST_M);
        let sigmas = read.vector(
            &raw.receptacle_sigma,
            "receptacle_sigma",
            0.0,
            LARGEST_SIGMA_M,
        )?;
        let mount = &raw.camera_mount_sigma;
        let shift = read.number(&mount.position_m, "position_m", 0.0, LARGEST_SIGMA_M)?;
        let turn = read
            .number(&mount.attitude_deg, "attitude_deg", 0.0, LARGEST_SIGMA_DEG)?
            .to_radians();
        let mount_sigmas = Vector6::new(shift, shift, shift, turn, turn, turn);
        let envelope = Envelope::new(
            read.region(&raw.pre_contact, "pre_contact")?,
            read.region(&raw.contact.value, "contact")?,
        )
        .map_err(|error| RefuellingSetupError::Envelope {
            place: Place::at(source, raw.contact.referenced),
            source: Box::new(error),
        })?;
        let limit = |value, field| {
            let of = format!("{field} of alert_limit");
            read.number(value, &of, LEAST_ALERT_LIMIT_M, FARTHEST_M)
        };
        let alert_limit_m = match &raw.alert_limit {
            Some(raw) => Some([
                limit(&raw.ahead_m, "ahead_m")?,
                limit(&raw.lateral_m, "lateral_m")?,
                limit(&raw.vertical_m, "vertical_m")?,
            ]),
            None => None,
        };
        Ok(Self {
            alert_limit_m,
            camera_in_receiver: far(&raw.camera_in_receiver, "camera_in_receiver")?,
            probe_tip_in_receiver: far(&raw.probe_tip_in_receiver, "probe_tip_in_receiver")?.into(),
            receptacle_in_tanker: far(&raw.receptacle_in_tanker, "receptacle_in_tanker")?.into(),
            mount_covariance: PoseCovariance(Matrix6::from_diagonal(
                &mount_sigmas.component_mul(&mount_sigmas),
            )),
            receptacle_covariance: Matrix3::from_diagonal(&sigmas.component_mul(&sigmas)),
            name: raw.name,
            envelope,
        })
    }

    /// Returns the geometry for a camera with this mount: rotation from optical axes to FLU.
    #[must_use]
    pub fn geometry(&self, receiver_from_camera: &Rotation3<f64>) -> RefuellingGeometry {
        RefuellingGeometry {
            receiver_from_camera: Isometry3::from_parts(
                self.camera_in_receiver.into(),
                (*receiver_from_camera).into(),
            ),
            mount_covariance: self.mount_covariance,
            probe_tip_in_receiver: self.probe_tip_in_receiver,
            receptacle_in_tanker: self.receptacle_in_tanker,
            receptacle_covariance: self.receptacle_covariance,
        }
    }
}

struct Reader<'a> {
    source: &'a str,
}

impl Reader<'_> {
    fn number(
        &self,
        raw: &Spanned<f64>,
        field: &str,
        least: f64,
        most: f64,
    ) -> Result<f64, RefuellingSetupError> {
        if (least..=most).contains(&raw.value) {
            return Ok(raw.value);
        }
        Err(RefuellingSetupError::Number {
            place: Place::at(self.source, raw.referenced),
            field: field.to_owned(),
            value: raw.value,
            least,
            most,
        })
    }

    fn vector(
        &self,
        raw: &RawPoint,
        of: &str,
        least: f64,
        most: f64,
    ) -> Result<Vector3<f64>, RefuellingSetupError> {
        let read = |value, axis| self.number(value, &format!("{axis} of {of}"), least, most);
        Ok(Vector3::new(
            read(&raw.x, "x")?,
            read(&raw.y, "y")?,
            read(&raw.z, "z")?,
        ))
    }

    fn region(&self, raw: &RawRegion, of: &str) -> Result<Region, RefuellingSetupError> {
        let far = |raw: &Spanned<f64>, field: &str| {
            self.number(raw, &format!("{field} of {of}"), -FARTHEST_M, FARTHEST_M)
        };
        Ok(match raw {
            RawRegion::Box { min, max } => Region::Box {
                min: self.vector(min, of, -FARTHEST_M, FARTHEST_M)?,
                max: self.vector(max, of, -FARTHEST_M, FARTHEST_M)?,
            },
            RawRegion::Cylinder {
                from_x_m,
                to_x_m,
                radius_m,
            } => Region::Cylinder {
                min_x_m: far(from_x_m, "from_x_m")?,
                max_x_m: far(to_x_m, "to_x_m")?,
                radius_m: far(radius_m, "radius_m")?,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXAMPLE: &str = include_str!("../../config/refuelling/example.yaml");

    fn changed(from: &str, to: &str) -> String {
        assert!(EXAMPLE.contains(from), "{from}");
        RefuellingSetup::from_yaml(&EXAMPLE.replacen(from, to, 1), "s.yaml")
            .expect_err("this setup is wrong")
            .to_string()
    }

    #[test]
    fn the_shipped_example_is_a_setup_that_can_be_used() {
        let setup = RefuellingSetup::from_yaml(EXAMPLE, "example.yaml").expect("a good setup");
        let geometry = setup.geometry(&crate::frames::flu_from_optical());
        assert_eq!(geometry.check(), Ok(()));
        assert_eq!(
            geometry.receiver_from_camera.translation.vector,
            Vector3::new(1.0, 0.0, 0.8)
        );
        assert_eq!(geometry.probe_tip_in_receiver, Point3::new(5.0, -0.5, 1.0));
        assert_eq!(geometry.receptacle_in_tanker, Point3::new(-4.0, 0.0, -2.5));
        // (0.1 deg)², rad².
        let turn = geometry.mount_covariance.0[(5, 5)];
        assert!((turn - 0.1_f64.to_radians().powi(2)).abs() < 1e-18);
        // Looking along the optical axis is looking forward.
        let ahead = geometry.receiver_from_camera.rotation * Vector3::z();
        assert!((ahead - Vector3::x()).norm() < 1e-15);
    }

    #[test]
    fn numbers_out_of_range_are_refused_at_their_line() {
        let error = changed(
            "probe_tip_in_receiver: {x: 5.0",
            "probe_tip_in_receiver: {x: 5000.0",
        );
        assert!(
            error.starts_with("s.yaml:")
                && error
                    .ends_with("x of probe_tip_in_receiver must be from -1000 to 1000, got 5000.0"),
            "{error}"
        );
        let error = changed("position_m: 0.005", "position_m: -0.005");
        assert!(
            error.ends_with("position_m must be from 0 to 100, got -0.005"),
            "{error}"
        );
        let error = changed(
            "receptacle_in_tanker: {x: -4.0",
            "receptacle_in_tanker: {x: .nan",
        );
        assert!(error.ends_with("got NaN"), "{error}");
    }

    #[test]
    fn alert_limits_are_optional_and_checked() {
        let with = |limit: &str| {
            let text = format!("{EXAMPLE}\nalert_limit: {limit}\n");
            RefuellingSetup::from_yaml(&text, "s.yaml")
        };
        let setup = with("{ahead_m: 1.5, lateral_m: 0.5, vertical_m: 0.4}").expect("a setup");
        assert_eq!(setup.alert_limit_m, Some([1.5, 0.5, 0.4]));
        let without = RefuellingSetup::from_yaml(EXAMPLE, "s.yaml").expect("a setup");
        assert_eq!(without.alert_limit_m, None);
        let error = with("{ahead_m: 1.5, lateral_m: 0, vertical_m: 0.4}").expect_err("no limit");
        let expected = "lateral_m of alert_limit must be from 0.001 to 1000, got 0.0";
        assert!(error.to_string().ends_with(expected), "{error}");
        assert!(with("{ahead_m: 1.5}").is_err());
    }

    #[test]
    fn regions_that_make_no_envelope_are_refused() {
        let error = changed("radius_m: 0.25", "radius_m: 25");
        assert!(error.contains("inside the pre-contact region"), "{error}");
        let error = changed("radius_m: 0.25", "radius_m: 0");
        assert!(error.contains("radius above zero"), "{error}");
    }

    #[test]
    fn nothing_that_is_missing_gets_a_default() {
        for key in [
            "camera_in_receiver",
            "camera_mount_sigma",
            "probe_tip_in_receiver",
            "receptacle_in_tanker",
            "receptacle_sigma",
            "pre_contact",
            "contact",
        ] {
            let kept: Vec<&str> = EXAMPLE
                .lines()
                .filter(|line| !line.starts_with(&format!("{key}:")))
                .collect();
            let without = kept.join("\n");
            let error = RefuellingSetup::from_yaml(&without, "s.yaml").expect_err(key);
            assert!(error.to_string().contains(key), "{error}");
        }
        assert!(changed("x: 5.0, ", "").contains("x is missing here"));
    }
}
