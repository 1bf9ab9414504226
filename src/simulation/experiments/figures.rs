//! The experiments that the paper shows as figures.

use nalgebra::{Point3, Vector3, center};

use super::{Experiment, SIGMA_PX, Setting, paper_markers, pose_41, pose_42, scene};
use crate::simulation::{Method, pose_in_camera};
use crate::target::Marker;

/// The paper's OI with the fixed start, and ours.
const BEST_METHODS: &[Method] = &[Method::NominalIterated, Method::MaximumLikelihood];

impl Experiment {
    /// Fig. 5: six to fourteen points, the added ones evenly along the fin, or in pairs along both wings or both tail
    /// planes from root to tip. The fin's foot is assumed at the height of the tail planes below its top, the root of
    /// the others halfway between the tips.
    #[must_use]
    pub fn number_of_points() -> Self {
        let paper = paper_markers("paper");
        let at = |id: u32| paper[id as usize - 1].marker_in_tanker;
        let top = at(5);
        let foot = Point3::new(top.x, top.y, at(3).z);
        let structures = [
            ("fin", foot, vec![top]),
            ("wings", center(&at(1), &at(2)), vec![at(1), at(2)]),
            ("tail planes", center(&at(3), &at(4)), vec![at(3), at(4)]),
        ];
        let mut settings = Vec::new();
        for (name, root, tips) in structures {
            for added in [0, 2, 4, 6, 8] {
                let stations = added / tips.len();
                let places = (1..=stations)
                    .map(|k| k as f64 / (stations + 1) as f64)
                    .flat_map(|share| tips.iter().map(move |tip| root + (tip - root) * share));
                let mut markers = paper.clone();
                markers.extend((7..).zip(places).map(|(id, marker_in_tanker)| Marker {
                    id,
                    marker_in_tanker,
                }));
                let count = markers.len() as f64;
                settings.push(Setting::new(
                    name,
                    count,
                    scene(markers, pose_41()),
                    SIGMA_PX,
                ));
            }
        }
        Self {
            name: "fig5",
            title: "Fig. 5: error and number of points",
            stream: 5,
            abscissa: "points",
            methods: BEST_METHODS,
            trials_factor: 1,
            settings,
        }
    }

    /// Fig. 7: the six points, their coordinates multiplied by 0.2 to 1.1 (at 1.2 a wing tip leaves the image).
    #[must_use]
    pub fn separation() -> Self {
        let settings = (2..=11)
            .map(|tenths| {
                let scale = f64::from(tenths) / 10.0;
                let mut markers = paper_markers("paper");
                for marker in &mut markers {
                    marker.marker_in_tanker *= scale;
                }
                Setting::new("scaled", scale, scene(markers, pose_42()), SIGMA_PX)
            })
            .collect();
        Self {
            name: "fig7",
            title: "Fig. 7: error and separation of the points",
            stream: 7,
            abscissa: "scale",
            methods: BEST_METHODS,
            trials_factor: 1,
            settings,
        }
    }

    /// Fig. 8: the methods along the refuelling route.
    #[must_use]
    pub fn methods() -> Self {
        Self {
            name: "fig8",
            title: "Fig. 8: the methods along the route",
            stream: 8,
            abscissa: "range_m",
            methods: &Method::ALL,
            trials_factor: 1,
            settings: route(SIGMA_PX).to_vec(),
        }
    }

    /// Fig. 9: levels of noise along the refuelling route.
    #[must_use]
    pub fn noise() -> Self {
        Self {
            name: "fig9",
            title: "Fig. 9: levels of noise along the route",
            stream: 9,
            abscissa: "range_m",
            methods: BEST_METHODS,
            trials_factor: 1,
            settings: [0.25, 0.5, 1.0, 2.0].into_iter().flat_map(route).collect(),
        }
    }
}

/// The refuelling route: from 60 m to 10 m, 0.3 of the range below the tanker, attitude of section 4.1.
fn route(sigma_px: f64) -> [Setting; 11] {
    std::array::from_fn(|k| {
        let range_m = 10.0 + 5.0 * k as f64;
        let position = Vector3::new(range_m, 0.0, 0.3 * range_m);
        let pose = pose_in_camera(position, 3.0, 2.0, 3.0);
        Setting::new(
            format!("{sigma_px} px"),
            range_m,
            scene(paper_markers("paper"), pose),
            sigma_px,
        )
    })
}
