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

/// Numbers that a caller keeps of a frame: rotation, translation, covariance, and four to judge them by.
const KEPT: usize = 52;

fn keep(row: &mut [f64], code: OutcomeCode, solution: Option<&Solution>) {
    row.fill(f64::NAN);
    let Some(found) = solution else { return };
    if code == OutcomeCode::Ok {
        let rotation = found.camera_from_tanker.rotation.to_rotation_matrix();
        row[..9].copy_from_slice(rotation.matrix().as_slice());
        let at = &found.camera_from_tanker.translation.vector;
        row[9..12].copy_from_slice(at.as_slice());
        row[12..48].copy_from_slice(&found.covariance.row_major());
    }
    row[48] = found.rms_px;
    row[49] = found.chi_squared;
    row[50] = found.chi_squared_limit;
    row[51] = found.ambiguity;
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
    let frames = numbers.len() / (2 * POINTS);
    let (mut rows, mut codes) = (vec![0.0; KEPT * frames], vec![None; frames]);
    rows.par_chunks_mut(KEPT * CHUNK)
        .zip(codes.par_chunks_mut(CHUNK))
        .zip(numbers.par_chunks(2 * POINTS * CHUNK))
        .for_each(|((rows, codes), numbers)| {
            let (mut detections, mut room) = (Vec::new(), Vec::new());
            let rows = rows.chunks_exact_mut(KEPT).zip(codes);
            for ((row, kept), pixels) in rows.zip(numbers.chunks_exact(2 * POINTS)) {
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
                keep(row, code, solution.as_ref());
                *kept = Some(code);
            }
        });
    let took_s = begin.elapsed().as_secs_f64();
    let trusted = codes
        .iter()
        .filter(|code| **code == Some(OutcomeCode::Ok))
        .count();
    eprintln!("{trusted} of {frames} frames trusted");
    println!("{:e}", took_s / frames as f64);
    Ok(())
}
