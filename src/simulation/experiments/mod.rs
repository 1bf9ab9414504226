//! The experiments of the paper's section 4 as lists of settings, with assumptions for what the paper leaves open.
//!
//! Contains no random generator and no thread: the caller runs the trials of each [`Setting`] in any order.

mod figures;
mod tables;

use nalgebra::{Isometry3, Vector3};

use super::trial::{Method, Stop};
use super::{Scene, paper_camera, pose_in_camera};
use crate::target::{Marker, MarkerMap};

/// px; used where the paper writes "the same noise" without a number.
const SIGMA_PX: f64 = 0.5;

/// A figure or a table: settings along one abscissa, in one or several series.
#[derive(Debug, Clone)]
pub struct Experiment {
    /// Its name in files and on the command line.
    pub name: &'static str,
    /// Its title.
    pub title: &'static str,
    /// Number of its random streams, unique among the experiments.
    pub stream: u16,
    /// Name of the abscissa, with its unit.
    pub abscissa: &'static str,
    /// The methods that it compares.
    pub methods: &'static [Method],
    /// Multiplies the number of trials that the caller asks for: rare events need more.
    pub trials_factor: u32,
    /// Series by series, abscissa ascending.
    pub settings: Vec<Setting>,
}

/// One point of an experiment.
#[derive(Debug, Clone)]
pub struct Setting {
    /// Name of its series.
    pub series: String,
    /// Its abscissa.
    pub abscissa: f64,
    /// Markers, camera, true pose.
    pub scene: Scene,
    /// Noise on columns and rows, px.
    pub sigma_px: f64,
    /// When the iteration ends.
    pub stop: Stop,
}

impl Setting {
    fn new(series: impl Into<String>, abscissa: f64, scene: Scene, sigma_px: f64) -> Self {
        Self {
            series: series.into(),
            abscissa,
            scene,
            sigma_px,
            stop: Stop::Converged,
        }
    }

    /// Returns how many markers are inside the paper's image. The trials use all of them, because the paper states no
    /// image size.
    #[must_use]
    pub fn markers_in_image(&self) -> usize {
        let size = self.scene.camera().image_size_px();
        let exact = self.scene.exact_observations();
        let is_inside = |u: f64, v: f64| {
            size.is_none_or(|(width, height)| {
                (-0.5..f64::from(width) - 0.5).contains(&u)
                    && (-0.5..f64::from(height) - 0.5).contains(&v)
            })
        };
        exact
            .iter()
            .filter(|seen| is_inside(seen.pixel.u, seen.pixel.v))
            .count()
    }
}

impl Experiment {
    /// Returns every experiment.
    #[must_use]
    pub fn all() -> Vec<Self> {
        vec![
            Self::number_of_points(),
            Self::separation(),
            Self::methods(),
            Self::noise(),
            Self::minima(),
            Self::iterations(),
            Self::stopped(),
        ]
    }
}

fn paper_markers(map: &str) -> Vec<Marker> {
    MarkerMap::shipped(map)
        .expect("the paper's maps are shipped")
        .markers()
        .to_vec()
}

fn scene(markers: Vec<Marker>, pose: Isometry3<f64>) -> Scene {
    Scene::with_markers(paper_camera(), markers, pose)
}

/// Section 4.1: yaw 3°, pitch 2°, roll 3°.
fn pose_41() -> Isometry3<f64> {
    pose_in_camera(Vector3::new(15.0, 0.0, 4.5), 3.0, 2.0, 3.0)
}

/// Section 4.2.
fn pose_42() -> Isometry3<f64> {
    pose_in_camera(Vector3::new(15.0, 0.0, 5.0), 5.0, 5.0, 5.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_marker_is_in_the_image_but_the_wing_tips_at_10_m() {
        for experiment in Experiment::all() {
            for setting in &experiment.settings {
                let missing = setting.scene.markers().len() - setting.markers_in_image();
                let is_too_near = experiment.abscissa == "range_m" && setting.abscissa < 11.0;
                let expected = if is_too_near { 2 } else { 0 };
                assert_eq!(
                    missing, expected,
                    "{} {}",
                    experiment.name, setting.abscissa
                );
            }
        }
    }

    #[test]
    fn experiments_have_streams_of_their_own() {
        let mut streams: Vec<u16> = Experiment::all().iter().map(|e| e.stream).collect();
        streams.sort_unstable();
        streams.dedup();
        assert_eq!(streams.len(), Experiment::all().len());
    }
}
