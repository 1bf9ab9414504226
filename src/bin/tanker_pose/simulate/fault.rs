//! Faults of a detector, made on purpose.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tanker_pose::pipeline::Detection;

/// Above the streams of the generator that the approach draws its noise from, one a frame.
const FIRST_STREAM: u64 = 1 << 40;

/// Moves one detection by `distance_px`; returns its id. Which, and where to, is drawn from the seed
/// and the frame's index. Moves to the left or upwards turn around at the image's border, so that the
/// detection is wrong, but not absurd.
pub fn gross_error(
    detections: &mut [Detection],
    distance_px: f64,
    seed: u64,
    index: u32,
) -> Option<u32> {
    if detections.is_empty() {
        return None;
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(FIRST_STREAM + u64::from(index));
    let moved = random.random_range(0..detections.len());
    let (sin, cos) = random.random_range(0.0..TAU).sin_cos();
    let moved = &mut detections[moved];
    moved.u_px = (moved.u_px + distance_px * cos).abs();
    moved.v_px = (moved.v_px + distance_px * sin).abs();
    Some(moved.id)
}

/// Gives one detection an id that no marker of the frame has; returns that id.
pub fn stray_id(detections: &mut [Detection]) -> Option<u32> {
    let stray = detections.iter().map(|seen| seen.id).max()? + 1000;
    detections[0].id = stray;
    Some(stray)
}

/// Exchanges the ids of these pairs, where both of a pair are seen.
pub fn exchange_ids(detections: &mut [Detection], pairs: &[(u32, u32)]) {
    for detection in detections {
        for &(a, b) in pairs {
            detection.id = match detection.id {
                id if id == a => b,
                id if id == b => a,
                id => id,
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detections() -> Vec<Detection> {
        (1..=6)
            .map(|id| Detection {
                id,
                u_px: 200.0 + 10.0 * f64::from(id),
                v_px: 150.0,
                sigma_px: 0.5,
            })
            .collect()
    }

    #[test]
    fn gross_error_moves_one_detection_by_its_distance_and_the_same_for_the_same_seed() {
        let (mut a, mut b) = (detections(), detections());
        let id = gross_error(&mut a, 40.0, 7, 3).expect("there are detections");
        assert_eq!(gross_error(&mut b, 40.0, 7, 3), Some(id));
        assert_eq!(a, b);
        for (moved, original) in a.iter().zip(&detections()) {
            let distance = (moved.u_px - original.u_px).hypot(moved.v_px - original.v_px);
            let expected = if moved.id == id { 40.0 } else { 0.0 };
            assert!((distance - expected).abs() < 1e-9, "{moved:?}");
        }
        assert_eq!(gross_error(&mut [], 40.0, 7, 3), None);
    }

    #[test]
    fn ids_are_exchanged_in_pairs_and_a_stray_id_is_nobodys() {
        let mut exchanged = detections();
        exchange_ids(&mut exchanged, &[(1, 2), (3, 4)]);
        let ids: Vec<u32> = exchanged.iter().map(|seen| seen.id).collect();
        assert_eq!(ids, [2, 1, 4, 3, 5, 6]);

        let mut strayed = detections();
        assert_eq!(stray_id(&mut strayed), Some(1006));
        assert_eq!(strayed[0].id, 1006);
    }
}
