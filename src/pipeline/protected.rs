//! What of tanker and receiver protection levels are for.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Rotation3, Translation3, Vector3};

use crate::geometry::PoseCovariance;
use crate::integrity::{IntegrityMonitor, IntegrityPoint, IntegritySettings, Mount};
use crate::refuelling::RefuellingSetup;
use crate::target::MarkerMap;

/// Returns what computes protection levels.
///
/// Its points are the receptacle of a refuelling setup and the points of the map; without any, the mean of the map's
/// markers, or the tanker's origin.
///
/// # Inputs
/// * `receiver_from_camera`: the camera's optical axes to x ahead, y left, z up.
#[must_use]
pub fn integrity_monitor(
    settings: IntegritySettings,
    receiver_from_camera: &Rotation3<f64>,
    map: Option<&MarkerMap>,
    setup: Option<&RefuellingSetup>,
) -> IntegrityMonitor {
    let geometry = setup.map(|setup| setup.geometry(receiver_from_camera));
    let mount = geometry.as_ref().map_or_else(
        || Mount {
            receiver_from_camera: Isometry3::from_parts(
                Translation3::identity(),
                (*receiver_from_camera).into(),
            ),
            covariance: PoseCovariance(Matrix6::zeros()),
        },
        |geometry| Mount {
            receiver_from_camera: geometry.receiver_from_camera,
            covariance: geometry.mount_covariance,
        },
    );
    let receptacle = geometry.zip(setup).map(|(geometry, setup)| IntegrityPoint {
        name: "receptacle".to_owned(),
        point_in_tanker: geometry.receptacle_in_tanker,
        covariance: geometry.receptacle_covariance,
        alert_limit_m: setup.alert_limit_m,
    });
    let exact = |name: &str, point_in_tanker| IntegrityPoint {
        name: name.to_owned(),
        point_in_tanker,
        covariance: Matrix3::zeros(),
        alert_limit_m: None,
    };
    let of_map = map.map_or(&[][..], MarkerMap::points).iter();
    let of_map = of_map.map(|point| exact(&point.name, point.point_in_tanker));
    let mut points: Vec<IntegrityPoint> = receptacle.into_iter().chain(of_map).collect();
    if points.is_empty() {
        points.push(match map.map(MarkerMap::markers) {
            Some(markers) => {
                let places = markers.iter().map(|marker| marker.marker_in_tanker.coords);
                let sum: Vector3<f64> = places.sum();
                exact("markers_mean", Point3::from(sum / markers.len() as f64))
            }
            None => exact("origin", Point3::origin()),
        });
    }
    IntegrityMonitor::new(settings, mount, points)
}
