//! Solves frames of the paper's markers on all cores, and prints the seconds that one takes: for
//! `benches/python/compare.py`.
//!
//! `many_frames FILE`: six pixels a frame, each two doubles.

use std::time::Instant;

use rayon::prelude::*;
use tanker_pose::camera::{Camera, CameraInfo};
use tanker_pose::estimation::{Estimator, EstimatorSettings, Solution};
use tanker_pose::pipeline::{Bare, Detection, ImageEdges, OutcomeCode};
use tanker_pose::target::MarkerMap;

const POINTS: usize = 6;
/// Frames that one thread takes at a time.
const CHUNK: usize = 256;

/// What a caller keeps of a frame: rotation, translation, covariance, and the numbers to judge them by.
struct Row {
    numbers: [f64; 52],
    code: OutcomeCode,
}

impl Row {
    fn new(code: OutcomeCode, solution: Option<&Solution>) -> Self {
        let mut numbers = [f64::NAN; 52];
        if let Some(found) = solution {
            if code == OutcomeCode::Ok {
                let rotation = found.camera_from_tanker.rotation.to_rotation_matrix();
                numbers[..9].copy_from_slice(rotation.matrix().as_slice());
                let at = &found.camera_from_tanker.translation.vector;
                numbers[9..12].copy_from_slice(at.as_slice());
                numbers[12..48].copy_from_slice(&found.covariance.row_major());
            }
            numbers[48] = found.rms_px;
            numbers[49] = found.chi_squared;
            numbers[50] = found.chi_squared_limit;
            numbers[51] = found.ambiguity;
        }
        Self { numbers, code }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args_os().nth(1).ok_or("expected a file")?;
    let bytes = std::fs::read(path)?;
    let numbers: Vec<f64> = bytes
        .chunks_exact(8)
        .filter_map(|chunk| Some(f64::from_ne_bytes(chunk.try_into().ok()?)))
        .collect();
    let map = MarkerMap::shipped("paper").ok_or("a shipped map")?;
    let camera = Camera::from_intrinsics(571.0, 571.0, 254.0, 206.0, Some((508, 412)))?;
    let estimator = Estimator::new(EstimatorSettings::default());
    let bare = Bare {
        estimator: &estimator,
        camera: &camera,
        edges: &ImageEdges::new(&CameraInfo::default(), &camera, false),
        edge_margin_px: 0.0,
        pixel_sigma_px: 0.5,
    };
    let begin = Instant::now();
    let rows: Vec<Row> = numbers
        .par_chunks(2 * POINTS * CHUNK)
        .flat_map_iter(|chunk| {
            let (mut detections, mut room) = (Vec::new(), Vec::new());
            let (bare, map) = (&bare, &map);
            chunk.chunks_exact(2 * POINTS).map(move |pixels| {
                detections.clear();
                detections.extend(
                    (1..)
                        .zip(pixels.chunks_exact(2))
                        .map(|(id, pixel)| Detection {
                            id,
                            u_px: pixel[0],
                            v_px: pixel[1],
                            sigma_px: 0.0,
                        }),
                );
                let (code, solution) = bare.solve(&detections, |id| map.get(id), None, &mut room);
                Row::new(code, solution.as_ref())
            })
        })
        .collect();
    let took_s = begin.elapsed().as_secs_f64();
    let is_trusted = |row: &&Row| row.code == OutcomeCode::Ok && row.numbers[0].is_finite();
    let trusted = rows.iter().filter(is_trusted).count();
    eprintln!("{trusted} of {} frames trusted", rows.len());
    println!("{:e}", took_s / rows.len() as f64);
    Ok(())
}
