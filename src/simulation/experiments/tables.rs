//! Explanations of the figures: failures, wrong minima, and the convergence of the iteration.

use super::{Experiment, SIGMA_PX, Setting, paper_markers, pose_41, pose_42, scene};
use crate::simulation::{Method, Stop};
use crate::target::MarkerMap;

/// The two initialisations of the iteration.
const ITERATED_METHODS: &[Method] = &[Method::LinearIterated, Method::NominalIterated];

impl Experiment {
    /// How often each method fails at the poses of sections 4.1 and 4.2.
    #[must_use]
    pub fn minima() -> Self {
        let poses = [("pose of 4.1", pose_41()), ("pose of 4.2", pose_42())];
        let settings = poses
            .into_iter()
            .flat_map(|(name, pose)| {
                [0.1, 0.25, 0.5, 1.0, 2.0].map(|sigma_px| {
                    let scene = scene(paper_markers("paper"), pose);
                    Setting::new(name, sigma_px, scene, sigma_px)
                })
            })
            .collect();
        Self {
            name: "minima",
            title: "Failures and wrong minima",
            stream: 1,
            abscissa: "sigma_px",
            methods: &Method::ALL,
            trials_factor: 10,
            settings,
        }
    }

    /// Number of steps until the iteration turns by less than a tolerance, and until it is within that of its end.
    #[must_use]
    pub fn iterations() -> Self {
        let settings = MarkerMap::shipped_names()
            .flat_map(|map| [(map, "last step"), (map, "distance")])
            .flat_map(|(map, name)| {
                [1e-10, 1e-6, 1e-3].map(|tolerance_rad| Setting {
                    stop: match name {
                        "distance" => Stop::NearTheEnd(tolerance_rad),
                        _ => Stop::SmallStep(tolerance_rad),
                    },
                    ..Setting::new(
                        format!("{map} {name}"),
                        tolerance_rad,
                        scene(paper_markers(map), pose_41()),
                        SIGMA_PX,
                    )
                })
            })
            .collect();
        Self {
            name: "iterations",
            title: "Steps of the iteration to a tolerance, 0.5 px, pose of 4.1",
            stream: 2,
            abscissa: "tolerance_rad",
            methods: ITERATED_METHODS,
            trials_factor: 1,
            settings,
        }
    }

    /// Accuracy of an iteration that is stopped after few steps.
    #[must_use]
    pub fn stopped() -> Self {
        let settings = [0.25, 0.5, 1.0]
            .into_iter()
            .flat_map(|sigma_px| {
                [0_u32, 1, 2, 5, 10, 20, 50, 100].map(|max_iterations| Setting {
                    stop: Stop::Steps(max_iterations),
                    ..Setting::new(
                        format!("{sigma_px} px"),
                        f64::from(max_iterations),
                        scene(paper_markers("paper"), pose_41()),
                        sigma_px,
                    )
                })
            })
            .collect();
        Self {
            name: "stopped",
            title: "The iteration stopped after few steps, pose of 4.1",
            stream: 3,
            abscissa: "iterations",
            methods: ITERATED_METHODS,
            trials_factor: 1,
            settings,
        }
    }
}
