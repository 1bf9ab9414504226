//! Command-line options that several tools share.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use nalgebra::Rotation3;
use tanker_pose::camera::{CalibrationBudget, CalibrationBudgetError, CameraFileError, CameraInfo};
use tanker_pose::config::{
    CalibrationSigmas, KEYS, Key, ParameterValue, Words, nominal_camera_from_tanker,
};
use tanker_pose::estimation::{
    CalibrationMode, Estimator, EstimatorSettings, Initialisation, Refinement,
};
use tanker_pose::frames::flu_from_optical;
use tanker_pose::geometry::rotation_from_roll_pitch_yaw;
use tanker_pose::integrity::IntegritySettings;
use tanker_pose::pipeline::error_budget;
use tanker_pose::refuelling::{RefuellingSetup, RefuellingSetupError};
use tanker_pose::target::{MapBudget, MarkerMap};
use tanker_pose::text_file;

/// How a pose is found and judged; defaults, ranges and words are those of the node's parameters.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Estimator")]
pub struct EstimatorOptions {
    /// Where the iteration starts: the nominal attitude (`In_M2`, 3 points), a linear camera matrix (`In_M1`, 6 points, not
    /// in one plane), the last trusted attitude or else the nominal one (3 points), or all attitudes (4 points)
    #[arg(long, default_value = Initialisation::WORDS[0], value_parser = word::<Initialisation>())]
    initialisation: Initialisation,
    /// The estimate: least squared pixel residuals over their variances, or none, the converged orthogonal
    /// iteration of the paper with its sandwich covariance
    #[arg(long, default_value = Refinement::WORDS[0], value_parser = word::<Refinement>())]
    refinement: Refinement,
    /// Standard deviation of pixels without their own, px
    #[arg(long, value_name = "PX", default_value_t = KEYS.pixel_sigma_px.default(), value_parser = double(KEYS.pixel_sigma_px))]
    pub pixel_sigma_px: f64,
    /// Points nearer than this to the edge of the image are left out, px; 0: none
    #[arg(long, value_name = "PX", default_value_t = KEYS.edge_margin_px.default(), value_parser = double(KEYS.edge_margin_px))]
    pub edge_margin_px: f64,
    /// Fewer points than this give no pose
    #[arg(long, value_name = "N", default_value_t = KEYS.min_points.default(), value_parser = whole(KEYS.min_points))]
    min_points: usize,
    /// At most this many points of a frame may be left out as wrong
    #[arg(long, value_name = "N", default_value_t = KEYS.max_outliers.default(), value_parser = whole(KEYS.max_outliers))]
    max_outliers: usize,
    /// Probability with which a correct frame passes the chi-squared test
    #[arg(long, value_name = "P", default_value_t = KEYS.trust_probability.default(), value_parser = double(KEYS.trust_probability))]
    trust_probability: f64,
    /// Refuse a frame when a second pose is at least this likely; 1: never
    #[arg(long, value_name = "RATIO", default_value_t = KEYS.max_ambiguity.default(), value_parser = double(KEYS.max_ambiguity))]
    max_ambiguity: f64,
    /// Prove for each pose that no other one in front of the camera has a lower cost, and search where that cannot be proven
    #[arg(long)]
    certify: bool,
    /// Refuse poses for which there is no such proof
    #[arg(long)]
    require_certificate: bool,
    /// Roll of the tanker relative to the receiver in the nominal attitude, degrees
    #[arg(long, value_name = "DEG", default_value_t = KEYS.nominal_roll_deg.default(), value_parser = double(KEYS.nominal_roll_deg))]
    nominal_roll_deg: f64,
    /// Pitch, degrees
    #[arg(long, value_name = "DEG", default_value_t = KEYS.nominal_pitch_deg.default(), value_parser = double(KEYS.nominal_pitch_deg))]
    nominal_pitch_deg: f64,
    /// Yaw, degrees
    #[arg(long, value_name = "DEG", default_value_t = KEYS.nominal_yaw_deg.default(), value_parser = double(KEYS.nominal_yaw_deg))]
    nominal_yaw_deg: f64,
    /// Roll of the camera in the receiver, degrees; all zero: it looks straight ahead, upright
    #[arg(long, value_name = "DEG", default_value_t = KEYS.camera_mount_roll_deg.default(), value_parser = double(KEYS.camera_mount_roll_deg))]
    camera_mount_roll_deg: f64,
    /// Pitch, degrees; positive looks down
    #[arg(long, value_name = "DEG", default_value_t = KEYS.camera_mount_pitch_deg.default(), value_parser = double(KEYS.camera_mount_pitch_deg))]
    camera_mount_pitch_deg: f64,
    /// Yaw, degrees; positive looks left
    #[arg(long, value_name = "DEG", default_value_t = KEYS.camera_mount_yaw_deg.default(), value_parser = double(KEYS.camera_mount_yaw_deg))]
    camera_mount_yaw_deg: f64,
    /// Standard deviation of the attitude about the nominal one, degrees; 0: nothing is known of it
    #[arg(long, value_name = "DEG", default_value_t = KEYS.nominal_attitude_sigma_deg.default(), value_parser = double(KEYS.nominal_attitude_sigma_deg))]
    nominal_attitude_sigma_deg: f64,
    /// Standard deviation of the focal length, a share: 0.003 is 0.3 %
    #[arg(long, value_name = "SHARE", default_value_t = KEYS.focal_length_sigma.default(), value_parser = double(KEYS.focal_length_sigma))]
    focal_length_sigma: f64,
    /// Standard deviation of each coordinate of the principal point, px
    #[arg(long, value_name = "PX", default_value_t = KEYS.principal_point_sigma_px.default(), value_parser = double(KEYS.principal_point_sigma_px))]
    principal_point_sigma_px: f64,
    /// Standard deviation of the first coefficient of D
    #[arg(long, value_name = "SIGMA", default_value_t = KEYS.k1_sigma.default(), value_parser = double(KEYS.k1_sigma))]
    k1_sigma: f64,
    /// Standard deviation of the second coefficient of D
    #[arg(long, value_name = "SIGMA", default_value_t = KEYS.k2_sigma.default(), value_parser = double(KEYS.k2_sigma))]
    k2_sigma: f64,
    /// YAML file with standard deviations or covariance of the calibration, in place of the four above
    #[arg(long, value_name = "FILE", conflicts_with_all = ["focal_length_sigma", "principal_point_sigma_px", "k1_sigma", "k2_sigma"])]
    calibration_budget_file: Option<PathBuf>,
    /// Standard deviation of a shift of the whole image that differs in each frame, px
    #[arg(long, value_name = "PX", default_value_t = KEYS.jitter_px.default(), value_parser = double(KEYS.jitter_px))]
    jitter_px: f64,
}

impl EstimatorOptions {
    /// Returns the settings of the options.
    pub fn settings(&self) -> EstimatorSettings {
        EstimatorSettings {
            initialisation: self.initialisation,
            refinement: self.refinement,
            nominal_camera_from_tanker: nominal_camera_from_tanker(
                &turned(
                    self.nominal_roll_deg,
                    self.nominal_pitch_deg,
                    self.nominal_yaw_deg,
                ),
                &turned(
                    self.camera_mount_roll_deg,
                    self.camera_mount_pitch_deg,
                    self.camera_mount_yaw_deg,
                ),
            ),
            min_points: self.min_points,
            max_outliers: self.max_outliers,
            trust_probability: self.trust_probability,
            max_ambiguity: self.max_ambiguity,
            attitude_sigma_rad: (self.nominal_attitude_sigma_deg > 0.0)
                .then(|| self.nominal_attitude_sigma_deg.to_radians()),
            certify: self.certify || self.require_certificate,
            require_certificate: self.require_certificate,
        }
    }

    /// Returns how the camera is turned: optical axes to the receiver's, x ahead, y left, z up.
    pub fn receiver_from_camera(&self) -> Rotation3<f64> {
        let mount = turned(
            self.camera_mount_roll_deg,
            self.camera_mount_pitch_deg,
            self.camera_mount_yaw_deg,
        );
        mount * flu_from_optical()
    }

    /// Returns what the file of the options says of the calibration, if they name one.
    pub fn calibration_budget(&self) -> Result<Option<CalibrationBudget>, CalibrationError> {
        let Some(path) = &self.calibration_budget_file else {
            return Ok(None);
        };
        let text = text_file::read(path).map_err(|source| CalibrationError::BudgetUnreadable {
            path: path.clone(),
            source,
        })?;
        let budget = CalibrationBudget::from_yaml(&text, &path.display().to_string())?;
        Ok(Some(budget))
    }

    /// Returns the estimator with the error budget of a map, of the options, and of a calibration's own file.
    pub fn estimator(&self, map: Option<&MarkerMap>, of_file: &[CalibrationMode]) -> Estimator {
        let exact = MapBudget::default();
        let of_map = map.map_or(&exact, MarkerMap::budget);
        let calibration = CalibrationSigmas {
            focal_length: self.focal_length_sigma,
            principal_point_px: self.principal_point_sigma_px,
            distortion: [self.k1_sigma, self.k2_sigma, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            jitter_px: self.jitter_px,
        };
        Estimator::new(self.settings()).with_budget(error_budget(of_map, &calibration, of_file))
    }
}

/// Protection levels; defaults and ranges are those of the node's parameters.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Protection levels")]
pub struct IntegrityOptions {
    /// Refuelling setup with the receptacle, the mount's errors and alert limits
    #[arg(long, value_name = "FILE")]
    refuelling: Option<PathBuf>,
    /// Probability with which an error may exceed its level
    #[arg(long, value_name = "P", default_value_t = KEYS.hmi_probability.default(), value_parser = double(KEYS.hmi_probability))]
    hmi_probability: f64,
    /// Probability with which a frame without a fault is declared faulty
    #[arg(long, value_name = "P", default_value_t = KEYS.false_alert_probability.default(), value_parser = double(KEYS.false_alert_probability))]
    false_alert_probability: f64,
    /// Probability that a beacon is faulty, each
    #[arg(long, value_name = "P", default_value_t = KEYS.beacon_fault_probability.default(), value_parser = double(KEYS.beacon_fault_probability))]
    beacon_fault_probability: f64,
    /// Count two faulty beacons at once as unmonitored
    #[arg(long)]
    singles_only: bool,
    /// Probability that a flex mode is beyond its sigma, each
    #[arg(long, value_name = "P", default_value_t = KEYS.flex_fault_probability.default(), value_parser = double(KEYS.flex_fault_probability))]
    flex_fault_probability: f64,
    /// The same for each sigma of the calibration and for jitter
    #[arg(long, value_name = "P", default_value_t = KEYS.calibration_fault_probability.default(), value_parser = double(KEYS.calibration_fault_probability))]
    calibration_fault_probability: f64,
}

impl IntegrityOptions {
    /// Returns the probabilities, for single frames.
    pub fn settings(&self) -> IntegritySettings {
        IntegritySettings {
            hmi_probability: self.hmi_probability,
            false_alert_probability: self.false_alert_probability,
            fault_probability: self.beacon_fault_probability,
            pairs: !self.singles_only,
            flex_fault_probability: self.flex_fault_probability,
            calibration_fault_probability: self.calibration_fault_probability,
            frames: 1,
        }
    }

    /// Returns the refuelling setup, if one is named.
    pub fn setup(&self) -> Result<Option<RefuellingSetup>, SetupError> {
        let Some(path) = &self.refuelling else {
            return Ok(None);
        };
        let text = text_file::read(path).map_err(|source| SetupError::Unreadable {
            path: path.clone(),
            source,
        })?;
        let setup = RefuellingSetup::from_yaml(&text, &path.display().to_string())?;
        Ok(Some(setup))
    }
}

/// Why a refuelling setup cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    #[error("cannot read the refuelling setup {}: {source}", path.display())]
    Unreadable {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("cannot use the refuelling setup: {0}")]
    Setup(#[from] RefuellingSetupError),
}

fn turned(roll_deg: f64, pitch_deg: f64, yaw_deg: f64) -> Rotation3<f64> {
    rotation_from_roll_pitch_yaw(
        roll_deg.to_radians(),
        pitch_deg.to_radians(),
        yaw_deg.to_radians(),
    )
}

/// Returns a parser of an enum's names.
fn word<T: Words + Send + Sync>() -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(T::WORDS)
        .try_map(|word| T::from_word(&word).ok_or("it is none of the words"))
}

/// Returns a parser of the values that the parameter of the same name allows.
pub fn double(key: Key<f64>) -> impl Fn(&str) -> Result<f64, String> + Clone {
    parser(key, ParameterValue::Double)
}

/// Returns a parser of the values that the parameter of the same name allows.
fn whole(key: Key<usize>) -> impl Fn(&str) -> Result<usize, String> + Clone {
    parser(key, ParameterValue::Integer)
}

fn parser<Raw: FromStr, T>(
    key: Key<T>,
    value: fn(Raw) -> ParameterValue,
) -> impl Fn(&str) -> Result<T, String> + Clone {
    move |text: &str| {
        let allowed = || format!("expected {}, got {text}", key.spec().kind.allowed());
        let raw = text.parse().map_err(|_| allowed())?;
        key.check(value(raw)).map_err(|_| allowed())
    }
}

/// Returns the marker map that an option names: a shipped one, or a file.
pub fn marker_map(name_or_path: &str) -> Result<MarkerMap, String> {
    if let Some(map) = MarkerMap::shipped(name_or_path) {
        return Ok(map);
    }
    let text = text_file::read(Path::new(name_or_path)).map_err(|error| {
        format!("{name_or_path}: {error} (expected paper, fin6 or the path of a marker map)")
    })?;
    MarkerMap::from_yaml(&text, name_or_path).map_err(|error| error.to_string())
}

/// Why a camera's calibration file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    #[error("cannot read the camera's calibration {}: {source}", path.display())]
    Unreadable {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("cannot use the camera's calibration: {0}")]
    File(#[from] CameraFileError),
    #[error("cannot read what the calibration may have wrong, {}: {source}", path.display())]
    BudgetUnreadable {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("cannot use what the calibration may have wrong: {0}")]
    Budget(#[from] CalibrationBudgetError),
}

/// Returns the camera info of a calibration file; what was assumed or skipped is logged.
pub fn calibration(path: &Path) -> Result<CameraInfo, CalibrationError> {
    let text = text_file::read(path).map_err(|source| CalibrationError::Unreadable {
        path: path.to_owned(),
        source,
    })?;
    let (info, warnings) = CameraInfo::from_yaml(&text, &path.display().to_string())?;
    for warning in warnings {
        eprintln!("tanker_pose: warning: {warning}");
    }
    Ok(info)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use tanker_pose::config::{Configuration, Parameters, TABLE};

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        estimator: EstimatorOptions,
        #[command(flatten)]
        integrity: IntegrityOptions,
    }

    #[test]
    fn options_default_to_what_the_node_does() {
        let line = Line::parse_from(["tool"]);
        let node = Configuration::from(&Parameters::new(TABLE)).settings;
        assert_eq!(line.estimator.settings(), node.estimator);
        let sigma_px = line.estimator.pixel_sigma_px;
        assert!((sigma_px - node.pixel_sigma_px).abs() < f64::EPSILON);
        let margin_px = line.estimator.edge_margin_px;
        assert!((margin_px - node.edge_margin_px).abs() < f64::EPSILON);
        assert_eq!(line.integrity.settings(), IntegritySettings::default());
        let turned = line.estimator.receiver_from_camera();
        assert_eq!(turned, node.receiver_from_camera);
    }
}
