//! What the node's parameters say of a recording: its topics, the map, the camera's mount, the points to protect.

use std::sync::Arc;

use nalgebra::{Point3, Rotation3};
use ros2_node::arguments::Arguments;
use ros2_node::names::NamesError;

use super::topics::Topics;
use crate::answering::files::{Files, FilesError};
use crate::answering::start::{StartError, effective_parameters};
use crate::config::{Configuration, Input};
use crate::integrity::IntegritySettings;
use crate::pipeline::integrity_monitor;
use crate::target::MarkerMap;

/// Why nothing can be evaluated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsError {
    /// The command line, or a parameter file.
    #[error(transparent)]
    Start(#[from] StartError),
    /// A file that a parameter names.
    #[error(transparent)]
    Files(#[from] FilesError),
    /// A remap, or the name of the truth.
    #[error(transparent)]
    Names(#[from] NamesError),
}

/// A point of the tanker that has protection levels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ProtectedPoint {
    pub(super) name: String,
    pub(super) point_in_tanker: Point3<f64>,
}

/// What the node's parameters say that is needed to judge its answers.
#[derive(Debug, Clone)]
pub struct Settings {
    pub(super) topics: Topics,
    pub(super) map: Arc<MarkerMap>,
    pub(super) input: Input,
    pub(super) max_hamming: i32,
    pub(super) rectified: bool,
    pub(super) pixel_sigma_px: f64,
    pub(super) tanker_frame_id: String,
    /// Optical axes to x ahead, y left, z up.
    pub(super) receiver_from_camera: Rotation3<f64>,
    pub(super) points: Vec<ProtectedPoint>,
    /// What of the arguments is allowed, but perhaps not meant.
    pub warnings: Vec<String>,
}

impl Settings {
    /// Returns the settings of a node that was started with these arguments; the files that its parameters name are read.
    ///
    /// # Inputs
    /// * `truth`: name of the topic with the true pose of the tanker in the camera; `None`: `truth`, if there is one.
    ///
    /// # Errors
    /// [`SettingsError`] of an argument, a parameter, a file or a name.
    pub fn new(arguments: &Arguments, truth: Option<&str>) -> Result<Self, SettingsError> {
        let (names, start) = effective_parameters(arguments)?;
        let configuration = Configuration::from(&start.parameters);
        let files = Files::read(&configuration)?;
        let receiver_from_camera = configuration.settings.receiver_from_camera;
        // The node's own rule for which points have levels.
        let monitor = integrity_monitor(
            IntegritySettings::default(),
            &receiver_from_camera,
            Some(&files.map),
            files.setup.as_ref(),
        );
        let points = monitor.points().iter().map(|point| ProtectedPoint {
            name: point.name.clone(),
            point_in_tanker: point.point_in_tanker,
        });
        Ok(Self {
            topics: Topics::new(&names, configuration.input, truth)?,
            points: points.collect(),
            map: Arc::new(files.map),
            input: configuration.input,
            max_hamming: configuration.max_hamming,
            rectified: configuration.settings.rectified,
            pixel_sigma_px: configuration.settings.pixel_sigma_px,
            tanker_frame_id: configuration.tanker_frame_id,
            receiver_from_camera,
            warnings: start.warnings,
        })
    }
}
