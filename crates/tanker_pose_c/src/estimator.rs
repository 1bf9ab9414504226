//! Set-up, and one frame.

use nalgebra::{Matrix3, Point3, Rotation3};
use tanker_pose::camera::{self, CameraError, CameraInfo};
use tanker_pose::config::{KEYS, Key, ParameterError, ParameterValue};
use tanker_pose::estimation::{self, EstimatorSettings, Initialisation, Observation};
use tanker_pose::geometry::nearest_rotation;
use tanker_pose::pipeline as frames;
use tanker_pose::pipeline::{Bare, ImageEdges, MOST_INLINE_DETECTIONS, OutcomeCode};
use tanker_pose::target::{self, MarkerMap, MarkerMapError};

use crate::types::{self, Camera, Detection, Marker, Options, Pose, Status};

/// Most detections of a frame.
pub const MOST_DETECTIONS: usize = 64;
const _: () = assert!(MOST_DETECTIONS == MOST_INLINE_DETECTIONS);

/// Largest deviation of the nominal attitude from a rotation.
const ROTATION_TOLERANCE: f64 = 1e-6;

/// Why no estimator can be made.
#[derive(Debug, thiserror::Error)]
pub enum CreateError {
    /// A number of the camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// A lens that is not among the constants.
    #[error("expected one of TANKER_POSE_LENS_..., got {0}")]
    Lens(u32),
    /// A marker.
    #[error(transparent)]
    Markers(#[from] MarkerMapError),
    /// An option out of the range of the node's parameter.
    #[error(transparent)]
    Option(#[from] ParameterError),
    /// A start that is not among the constants.
    #[error("expected one of TANKER_POSE_INITIALISATION_..., got {0}")]
    Initialisation(u32),
    /// A matrix that is no rotation.
    #[error(
        "nominal_camera_from_tanker: expected a rotation, got a matrix that differs from one by {0:.1e}"
    )]
    NoRotation(f64),
}

impl CreateError {
    /// Returns its status.
    pub(crate) const fn status(&self) -> Status {
        match self {
            Self::Camera(_) | Self::Lens(_) => Status::InvalidCamera,
            Self::Markers(_) => Status::InvalidMarkers,
            Self::Option(_) | Self::Initialisation(_) | Self::NoRotation(_) => {
                Status::InvalidOptions
            }
        }
    }
}

/// An estimator for one camera and one set of markers, with room for a frame.
pub struct Estimator {
    solver: estimation::Estimator,
    camera: camera::Camera,
    edges: ImageEdges,
    map: MarkerMap,
    pixel_sigma_px: f64,
    edge_margin_px: f64,
    previous: Option<Rotation3<f64>>,
    detections: Vec<frames::Detection>,
    observations: Vec<Observation>,
}

impl Estimator {
    /// Returns an estimator with the settings of these options.
    ///
    /// # Errors
    /// [`CreateError`] of the first value that cannot be used.
    pub fn new(
        camera: &Camera,
        markers: &[Marker],
        options: &Options,
    ) -> Result<Self, CreateError> {
        let info = info(camera)?;
        let camera = camera::Camera::from_info(&info, false)?;
        let markers: Vec<target::Marker> = markers
            .iter()
            .map(|marker| target::Marker {
                id: marker.id,
                marker_in_tanker: Point3::new(marker.x, marker.y, marker.z),
            })
            .collect();
        Ok(Self {
            solver: estimation::Estimator::new(settings(options)?),
            edges: ImageEdges::new(&info, &camera, false),
            camera,
            map: MarkerMap::new("markers", &markers)?,
            pixel_sigma_px: double(KEYS.pixel_sigma_px, options.pixel_sigma_px)?,
            edge_margin_px: double(KEYS.edge_margin_px, options.edge_margin_px)?,
            previous: None,
            detections: Vec::with_capacity(MOST_DETECTIONS),
            observations: Vec::with_capacity(MOST_DETECTIONS),
        })
    }

    /// Sets the outcome of one frame.
    pub fn estimate(&mut self, detections: &[Detection], pose: &mut Pose) -> Status {
        if detections.len() > MOST_DETECTIONS {
            return Status::TooManyDetections;
        }
        self.detections.clear();
        self.detections
            .extend(detections.iter().map(|seen| frames::Detection {
                id: seen.id,
                u_px: seen.u,
                v_px: seen.v,
                sigma_px: seen.sigma,
            }));
        let bare = Bare {
            estimator: &self.solver,
            camera: &self.camera,
            edges: &self.edges,
            edge_margin_px: self.edge_margin_px,
            pixel_sigma_px: self.pixel_sigma_px,
        };
        let known = |id| self.map.get(id);
        let (code, solution) = bare.solve(
            &self.detections,
            known,
            self.previous.as_ref(),
            &mut self.observations,
        );
        if let (OutcomeCode::Ok, Some(solution)) = (code, &solution) {
            self.previous = Some(solution.camera_from_tanker.rotation.to_rotation_matrix());
        }
        pose.set(code, solution.as_ref(), self.observations.len());
        Status::Ok
    }

    /// Forgets the last trusted attitude, where `TANKER_POSE_INITIALISATION_PREVIOUS` starts.
    pub fn reset(&mut self) {
        self.previous = None;
    }
}

fn info(camera: &Camera) -> Result<CameraInfo, CreateError> {
    let (model, count) = match camera.lens {
        types::LENS_NONE => ("", 0),
        types::LENS_PLUMB_BOB => ("plumb_bob", 8),
        types::LENS_RATIONAL_POLYNOMIAL => ("rational_polynomial", 8),
        types::LENS_EQUIDISTANT => ("equidistant", 8),
        other => return Err(CreateError::Lens(other)),
    };
    Ok(CameraInfo {
        width: camera.width,
        height: camera.height,
        distortion_model: model.to_owned(),
        d: camera.d.iter().copied().take(count).collect(),
        k: [
            camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0,
        ],
        ..CameraInfo::default()
    })
}

fn settings(options: &Options) -> Result<EstimatorSettings, CreateError> {
    let matrix = Matrix3::from_row_slice(&options.nominal_camera_from_tanker);
    let deviation = (matrix * matrix.transpose() - Matrix3::identity()).amax();
    // A comparison with NaN is false.
    let is_rotation = deviation <= ROTATION_TOLERANCE && matrix.determinant() > 0.0;
    if !is_rotation {
        return Err(CreateError::NoRotation(deviation));
    }
    // As it is where it is one to the last digit, so that the default is the node's.
    let nominal = if deviation <= 0.0 {
        Rotation3::from_matrix_unchecked(matrix)
    } else {
        nearest_rotation(&matrix)
    };
    let require_certificate = options.require_certificate != 0;
    Ok(EstimatorSettings {
        initialisation: match options.initialisation {
            types::INITIALISATION_NOMINAL => Initialisation::Nominal,
            types::INITIALISATION_DLT => Initialisation::Dlt,
            types::INITIALISATION_PREVIOUS => Initialisation::Previous,
            types::INITIALISATION_GLOBAL => Initialisation::Global,
            other => return Err(CreateError::Initialisation(other)),
        },
        nominal_camera_from_tanker: nominal,
        min_points: whole(KEYS.min_points, options.min_points)?,
        max_outliers: whole(KEYS.max_outliers, options.max_outliers)?,
        trust_probability: double(KEYS.trust_probability, options.trust_probability)?,
        max_ambiguity: double(KEYS.max_ambiguity, options.max_ambiguity)?,
        certify: options.certify != 0 || require_certificate,
        require_certificate,
        ..EstimatorSettings::default()
    })
}

fn double(key: Key<f64>, value: f64) -> Result<f64, ParameterError> {
    key.check(ParameterValue::Double(value))
}

fn whole(key: Key<usize>, value: u32) -> Result<usize, ParameterError> {
    key.check(ParameterValue::Integer(value.into()))
}
