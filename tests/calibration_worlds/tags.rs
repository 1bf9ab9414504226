//! A recorded approach to four tags.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tanker_pose::calibration::{Calibration, CalibrationSettings, RecordedFrame, calibrate};
use tanker_pose::config::CalibrationSigmas;
use tanker_pose::estimation::{Estimator, EstimatorSettings};
use tanker_pose::pipeline::{error_budget, observe};
use tanker_pose::simulation::{Approach, ApproachSettings, paper_camera};
use tanker_pose::target::MarkerMap;

use super::{normal, normals};

const TAGS: &str = "name: tagged
sigma: 0.02
tags:
  - {id: 1, size_m: 1.0, x: 3.7, y: -5, z: 0.7, roll_deg: 90, pitch_deg: 0, yaw_deg: -90}
  - {id: 2, size_m: 1.0, x: 3.7, y: 5, z: 0.7, roll_deg: 90, pitch_deg: 0, yaw_deg: -90}
  - {id: 3, size_m: 1.0, x: 7.8, y: 0, z: 3.2, roll_deg: 90, pitch_deg: 0, yaw_deg: -90}
  - {id: 4, size_m: 1.0, x: 0, y: 0, z: 0, roll_deg: 90, pitch_deg: 0, yaw_deg: -90}
";

/// Returns what is found where the corners of a tag have noise in common, and each its own, px.
pub fn calibrated_tags(common_px: f64, own_px: f64) -> Calibration {
    let map = MarkerMap::from_yaml(TAGS, "tags").expect("a good map");
    let settings = ApproachSettings {
        rate_hz: 8.0,
        start_range_m: 40.0,
        sigma_px: 0.0,
        ..ApproachSettings::default()
    };
    let camera = paper_camera();
    let approach = Approach::new(settings, camera.clone(), map.clone());
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let frames: Vec<RecordedFrame> = (0..approach.frame_count())
        .map(|index| {
            let frame = approach.frame(index);
            let mut seen =
                observe(&camera, &frame.detections, 0.5, |id| map.get(id)).expect("good");
            for tag in 1..=4 {
                let common = normals(&mut random) * common_px;
                for corner in seen.iter_mut().filter(|seen| seen.id / 10 == tag) {
                    corner.pixel.u += common.x + own_px * normal(&mut random);
                    corner.pixel.v += common.y + own_px * normal(&mut random);
                }
            }
            RecordedFrame {
                time_s: frame.time_s,
                observations: seen,
                receiver_from_tanker: None,
            }
        })
        .collect();
    let budget = error_budget(map.budget(), &CalibrationSigmas::default(), &[]);
    let estimator = Estimator::new(EstimatorSettings::default()).with_budget(budget);
    let settings = CalibrationSettings::default();
    calibrate(&camera, &map, &estimator, &frames, &settings).expect("the recording is good")
}
