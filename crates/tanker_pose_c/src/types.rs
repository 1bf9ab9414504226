//! The plain structs of the header. Numbers that mean words are `uint32_t`: C may put anything into an enum.

use tanker_pose::config::KEYS;
use tanker_pose::estimation::{Certificate, EstimatorSettings, Initialisation, Solution};
use tanker_pose::pipeline::OutcomeCode;

/// Most coefficients of a lens.
pub const MOST_COEFFICIENTS: usize = 8;

/// Whether a call did what it is for.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// It did.
    Ok = 0,
    /// A pointer is null, or not aligned.
    NullPointer = 1,
    /// The camera cannot be used.
    InvalidCamera = 2,
    /// The markers cannot be used: fewer than three, an id twice, an implausible coordinate, all of them on one line.
    InvalidMarkers = 3,
    /// An option is out of its range.
    InvalidOptions = 4,
    /// More detections than `TANKER_POSE_MOST_DETECTIONS`.
    TooManyDetections = 5,
    /// A defect of this library.
    Internal = 6,
}

/// Pinhole, without coefficients.
pub const LENS_NONE: u32 = 0;
/// `plumb_bob`: k1, k2, p1, p2, k3.
pub const LENS_PLUMB_BOB: u32 = 1;
/// `rational_polynomial`: k1, k2, p1, p2, k3, k4, k5, k6.
pub const LENS_RATIONAL_POLYNOMIAL: u32 = 2;
/// `equidistant`: k1, k2, k3, k4.
pub const LENS_EQUIDISTANT: u32 = 3;

/// A camera, px; the centre of the top-left pixel is (0, 0).
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Focal length along columns, px.
    pub fx: f64,
    /// Focal length along rows, px.
    pub fy: f64,
    /// Column of the principal point, px.
    pub cx: f64,
    /// Row of the principal point, px.
    pub cy: f64,
    /// Coefficients of the lens in the order of `sensor_msgs/CameraInfo`; the rest 0.
    pub d: [f64; MOST_COEFFICIENTS],
    /// One of `TANKER_POSE_LENS_...`.
    pub lens: u32,
    /// Width of the image, px; 0: unknown, and no detection is left out at an edge.
    pub width: u32,
    /// Height of the image, px.
    pub height: u32,
}

/// A marker on the tanker: x forward, y left, z up; m.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Marker {
    /// Its id.
    pub id: u32,
    /// Forward, m.
    pub x: f64,
    /// To the left, m.
    pub y: f64,
    /// Up, m.
    pub z: f64,
}

/// A detected marker in an image.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
    /// Id of its marker.
    pub id: u32,
    /// Column, px.
    pub u: f64,
    /// Row, px.
    pub v: f64,
    /// Standard deviation of column and of row, px; 0: `pixel_sigma_px` of the options.
    pub sigma: f64,
}

/// Start at the nominal attitude.
pub const INITIALISATION_NOMINAL: u32 = 1;
/// Start at the linear camera matrix; 6 points, not in one plane.
pub const INITIALISATION_DLT: u32 = 2;
/// Start at the last trusted attitude of this estimator, or else the nominal one.
pub const INITIALISATION_PREVIOUS: u32 = 3;
/// The best of all attitudes.
pub const INITIALISATION_GLOBAL: u32 = 4;

/// How a pose is found and judged: the node's parameters of the same names, docs/parameters.md.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Expected rotation of `camera_from_tanker`, row by row.
    pub nominal_camera_from_tanker: [f64; 9],
    /// Standard deviation of detections that do not state one, px.
    pub pixel_sigma_px: f64,
    /// Detections closer than this to the edge of the image are left out, px; 0: none.
    pub edge_margin_px: f64,
    /// Probability that a correct frame passes the chi-squared test.
    pub trust_probability: f64,
    /// Frames with a second pose of at least this likelihood are refused; 1: never.
    pub max_ambiguity: f64,
    /// One of `TANKER_POSE_INITIALISATION_...`.
    pub initialisation: u32,
    /// Fewer detections of similar sigma give no pose.
    pub min_points: u32,
    /// At most this many detections of a frame are left out as wrong, 0 to 2.
    pub max_outliers: u32,
    /// Not 0: prove that no other pose in front of the camera has a lower cost.
    pub certify: u32,
    /// Not 0: refuse poses without that proof.
    pub require_certificate: u32,
}

impl Default for Options {
    fn default() -> Self {
        let settings = EstimatorSettings::default();
        let nominal = settings.nominal_camera_from_tanker;
        Self {
            nominal_camera_from_tanker: std::array::from_fn(|i| nominal[(i / 3, i % 3)]),
            pixel_sigma_px: KEYS.pixel_sigma_px.default(),
            edge_margin_px: KEYS.edge_margin_px.default(),
            trust_probability: settings.trust_probability,
            max_ambiguity: settings.max_ambiguity,
            initialisation: match settings.initialisation {
                Initialisation::Nominal => INITIALISATION_NOMINAL,
                Initialisation::Dlt => INITIALISATION_DLT,
                Initialisation::Previous => INITIALISATION_PREVIOUS,
                Initialisation::Global => INITIALISATION_GLOBAL,
            },
            min_points: u32::try_from(settings.min_points).unwrap_or(u32::MAX),
            max_outliers: u32::try_from(settings.max_outliers).unwrap_or(u32::MAX),
            certify: settings.certify.into(),
            require_certificate: settings.require_certificate.into(),
        }
    }
}

/// The outcome of a frame with a trusted pose.
pub const OUTCOME_OK: u32 = 0;

/// The outcome of a frame, and its pose if it has one.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Rotation of `camera_from_tanker`, row by row; NaN without a trusted pose, as are the next two.
    pub rotation: [f64; 9],
    /// The tanker's origin in the camera's optical frame (x right, y down, z ahead), m.
    pub translation: [f64; 3],
    /// Row by row in ROS's order: x, y, z, and rotations about the camera's x, y, z; m, rad.
    pub covariance: [f64; 36],
    /// Root mean square of the residuals, px; NaN without a fit, as are the next three.
    pub rms_px: f64,
    /// Sum of the squared residuals over their variances.
    pub chi_squared: f64,
    /// The largest `chi_squared` that is trusted.
    pub chi_squared_limit: f64,
    /// Likelihood of the second-best pose relative to this one.
    pub ambiguity: f64,
    /// A constant of `tanker_pose/msg/EstimatorStatus`: `TANKER_POSE_OUTCOME_OK`, or why there is no pose; its name: `tanker_pose_outcome_name`.
    pub outcome: u32,
    /// Of `chi_squared`.
    pub degrees_of_freedom: u32,
    /// Of all solver stages.
    pub iterations: u32,
    /// 0: no proof was asked for, 1: proven the best, 2: not proven, 3: proven, for a better pose that a search found.
    pub certificate: u32,
    /// How many detections the pose rests on.
    pub used: u32,
}

impl Pose {
    /// Returns what stands in a struct before there is an outcome.
    pub(crate) const fn none() -> Self {
        Self {
            rotation: [f64::NAN; 9],
            translation: [f64::NAN; 3],
            covariance: [f64::NAN; 36],
            rms_px: f64::NAN,
            chi_squared: f64::NAN,
            chi_squared_limit: f64::NAN,
            ambiguity: f64::NAN,
            outcome: u32::MAX,
            degrees_of_freedom: 0,
            iterations: 0,
            certificate: 0,
            used: 0,
        }
    }

    /// Sets the outcome of a frame in which `observed` detections reached the solver.
    pub(crate) fn set(&mut self, code: OutcomeCode, solution: Option<&Solution>, observed: usize) {
        *self = Self::none();
        self.outcome = code.number().into();
        let Some(solution) = solution else { return };
        self.rms_px = solution.rms_px;
        self.chi_squared = solution.chi_squared;
        self.chi_squared_limit = solution.chi_squared_limit;
        self.ambiguity = solution.ambiguity;
        self.degrees_of_freedom = solution.degrees_of_freedom.into();
        self.iterations = solution.iterations.into();
        self.certificate = match solution.certificate {
            None => 0,
            Some(Certificate::Certified) => 1,
            Some(Certificate::NotCertified) => 2,
            Some(Certificate::Replaced) => 3,
        };
        let used = observed.saturating_sub(solution.excluded.ids().count());
        self.used = u32::try_from(used).unwrap_or(u32::MAX);
        if code == OutcomeCode::Ok {
            let pose = &solution.camera_from_tanker;
            let rotation = pose.rotation.to_rotation_matrix();
            self.rotation = std::array::from_fn(|i| rotation[(i / 3, i % 3)]);
            self.translation = pose.translation.vector.into();
            self.covariance = solution.covariance.row_major();
        }
    }
}
