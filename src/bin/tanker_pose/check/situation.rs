//! Map, camera, budget and mount together, and the nominal approach past them.

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use tanker_pose::camera::Camera;
use tanker_pose::estimation::{Estimator, Observation};
use tanker_pose::integrity::IntegrityMonitor;
use tanker_pose::pipeline::ImageEdges;
use tanker_pose::refuelling::RefuellingGeometry;
use tanker_pose::simulation::Scene;
use tanker_pose::target::{Marker, MarkerMap};

/// Height of the tanker above the receiver for each metre of range: the paper's route.
pub const CLIMB: f64 = 0.3;

/// Everything that one check looks at.
pub struct Situation {
    pub map: MarkerMap,
    pub camera: Camera,
    pub edges: ImageEdges,
    pub estimator: Estimator,
    pub monitor: IntegrityMonitor,
    pub receiver_from_camera: Rotation3<f64>,
    /// Of a refuelling setup, if one is named.
    pub geometry: Option<RefuellingGeometry>,
    pub sigma_px: f64,
    pub edge_margin_px: f64,
    pub route: Route,
}

/// The nominal approach. Ranges are how far the tanker's origin is ahead of the camera, receiver axes, m.
#[derive(Debug, Clone, PartialEq)]
pub struct Route {
    /// Descending.
    pub ranges_m: Vec<f64>,
    /// Where the tanker's origin is at contact, from the camera, receiver axes, m; `None` without a refuelling setup.
    pub contact_m: Option<Vector3<f64>>,
}

/// Beacons of one image.
pub struct Image {
    pub observations: Vec<Observation>,
    /// Ids of those that the camera does not see, or that are at the edge of its image.
    pub lost: Vec<u32>,
}

/// What fails as a whole: one marker, or a tag with its corners.
#[derive(Debug, Clone, PartialEq)]
pub struct Beacon {
    pub name: String,
    pub ids: Vec<u32>,
}

impl Route {
    /// Returns the approach with so many ranges, evenly in their logarithm.
    ///
    /// With a refuelling setup it ends at contact at the latest.
    pub fn new(
        from_m: f64,
        to_m: f64,
        steps: u32,
        geometry: Option<&RefuellingGeometry>,
        nominal_camera_from_tanker: &Rotation3<f64>,
    ) -> Result<Self, String> {
        let contact_m = geometry.map(|geometry| {
            let receiver_from_tanker =
                geometry.receiver_from_camera.rotation * *nominal_camera_from_tanker;
            let tanker = geometry.probe_tip_in_receiver
                - receiver_from_tanker * geometry.receptacle_in_tanker.coords;
            tanker.coords - geometry.receiver_from_camera.translation.vector
        });
        let near_m = contact_m.map_or(to_m, |contact| contact.x.max(to_m));
        if near_m >= from_m {
            return Err(format!(
                "the approach must begin farther away than it ends: from {from_m} m to {near_m:.2} m{}",
                if near_m > to_m {
                    ", where contact is made"
                } else {
                    ""
                }
            ));
        }
        let last = steps.max(2) - 1;
        let ranges_m = (0..=last)
            .map(|step| match step {
                _ if step == last => near_m,
                step => from_m * (near_m / from_m).powf(f64::from(step) / f64::from(last)),
            })
            .collect();
        Ok(Self {
            ranges_m,
            contact_m,
        })
    }

    pub fn nearest_m(&self) -> f64 {
        self.ranges_m.last().copied().unwrap_or(0.0)
    }

    /// Returns where the tanker's origin is, from the camera, receiver axes, m.
    fn tanker_at(&self, range_m: f64) -> Vector3<f64> {
        let end = self.contact_m.unwrap_or_else(Vector3::zeros);
        Vector3::new(range_m, end.y, end.z + CLIMB * (range_m - end.x))
    }
}

impl Situation {
    /// Returns the tanker's pose at a range, nominal attitude.
    pub fn camera_from_tanker(&self, range_m: f64) -> Isometry3<f64> {
        let position = self.receiver_from_camera.inverse() * self.route.tanker_at(range_m);
        let nominal = self.estimator.settings().nominal_camera_from_tanker;
        Isometry3::from_parts(
            Translation3::from(position),
            UnitQuaternion::from_rotation_matrix(&nominal),
        )
    }

    /// Returns the exact image of markers at a range, as far as it is clear of the image's edges.
    pub fn image(&self, markers: &[Marker], range_m: f64) -> Image {
        let pose = self.camera_from_tanker(range_m);
        let scene = Scene::with_markers(self.camera.clone(), markers.to_vec(), pose);
        let size_px = self.camera.image_size_px();
        let mut seen = scene.exact_observations();
        seen.retain(|seen| {
            size_px.is_none_or(|(width, height)| {
                (-0.5..f64::from(width) - 0.5).contains(&seen.pixel.u)
                    && (-0.5..f64::from(height) - 0.5).contains(&seen.pixel.v)
            })
        });
        for seen in &mut seen {
            seen.sigma_px = self.sigma_px;
        }
        let (observations, _) = self.edges.leave_out(seen, self.edge_margin_px);
        let is_lost = |id: &u32| observations.iter().all(|seen| seen.id != *id);
        let lost = markers.iter().map(|marker| marker.id).filter(is_lost);
        Image {
            lost: lost.collect(),
            observations,
        }
    }

    /// Returns the map's beacons, by id; a tag with its corners is one.
    pub fn beacons(&self) -> Vec<Beacon> {
        let mut beacons: Vec<Beacon> = Vec::new();
        for marker in self.map.markers() {
            let name = self.map.tag_of_corner(marker.id).map_or_else(
                || format!("marker {}", marker.id),
                |tag| format!("tag {}", tag.id),
            );
            match beacons.iter_mut().find(|beacon| beacon.name == name) {
                Some(beacon) => beacon.ids.push(marker.id),
                None => beacons.push(Beacon {
                    name,
                    ids: vec![marker.id],
                }),
            }
        }
        beacons
    }
}
