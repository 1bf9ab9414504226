//! Frames through the functions of the header: the bits of `pipeline::solve`, and no allocation.

#![expect(clippy::indexing_slicing, reason = "a test may panic")]

use std::ptr::null_mut;

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use tanker_pose::camera::Camera;
use tanker_pose::estimation::{self, EstimatorSettings};
use tanker_pose::geometry::optical_from_body;
use tanker_pose::pipeline::{self, FrameOutcome, ImageEdges, OutcomeCode, observe};
use tanker_pose::target::MarkerMap;
use tanker_pose_c::{
    Camera as CCamera, Detection, Estimator, LENS_NONE, Marker, Options, Pose, Status,
    tanker_pose_create, tanker_pose_default_options, tanker_pose_destroy, tanker_pose_estimate,
};

const FRAMES: usize = 10_000;
const CAMERA: CCamera = CCamera {
    fx: 571.0,
    fy: 571.0,
    cx: 254.0,
    cy: 206.0,
    d: [0.0; 8],
    lens: LENS_NONE,
    width: 508,
    height: 412,
};

/// Numbers from 0 to 1 that are the same everywhere.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        // SplitMix64, Steele, Lea and Flood 2014.
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        f64::from(u32::try_from((z ^ (z >> 31)) >> 32).expect("32 bits")) / 4_294_967_296.0
    }

    fn within(&mut self, half: f64) -> f64 {
        half * (2.0 * self.next() - 1.0)
    }
}

/// Detections of the paper's markers; every sixth frame has something wrong with it.
fn frame(index: usize, map: &MarkerMap, numbers: &mut Numbers) -> Vec<Detection> {
    let turn = Vector3::new(
        numbers.within(0.1),
        numbers.within(0.1),
        numbers.within(0.1),
    );
    let rotation = optical_from_body() * Rotation3::new(turn);
    let at = Translation3::new(
        numbers.within(0.5),
        -4.5 + numbers.within(0.5),
        15.0 + numbers.within(0.5),
    );
    let pose = Isometry3::from_parts(at, UnitQuaternion::from_rotation_matrix(&rotation));
    let mut seen: Vec<Detection> = map
        .markers()
        .iter()
        .map(|marker| {
            let Point3 { coords: q } = pose * marker.marker_in_tanker;
            Detection {
                id: marker.id,
                u: 571.0 * q.x / q.z + 254.0 + numbers.within(0.8),
                v: 571.0 * q.y / q.z + 206.0 + numbers.within(0.8),
                sigma: if index.is_multiple_of(2) { 0.5 } else { 0.0 },
            }
        })
        .collect();
    match index % 36 {
        0 => seen[2].v += 30.0,
        6 => seen[1].u = f64::NAN,
        12 => seen[3].id = 77,
        18 => seen[3].id = seen[4].id,
        24 => seen.truncate(3),
        30 => seen[5].u = 1e6,
        _ => {}
    }
    seen
}

fn solved(
    map: &MarkerMap,
    camera: &Camera,
    edges: &ImageEdges,
    seen: &[Detection],
) -> FrameOutcome {
    let estimator = estimation::Estimator::new(EstimatorSettings::default());
    let detections: Vec<pipeline::Detection> = seen
        .iter()
        .map(|seen| pipeline::Detection {
            id: seen.id,
            u_px: seen.u,
            v_px: seen.v,
            sigma_px: seen.sigma,
        })
        .collect();
    match observe(camera, &detections, 0.5, |id| map.get(id)) {
        Ok(observations) => {
            let (observations, left_out) = edges.leave_out(observations, 3.0);
            pipeline::solve(&estimator, camera, &observations, None).without(left_out)
        }
        Err(refusal) => FrameOutcome::refused(refusal),
    }
}

fn made(map: &MarkerMap, options: &Options) -> *mut Estimator {
    let markers: Vec<Marker> = map
        .markers()
        .iter()
        .map(|marker| {
            let Point3 { coords: p } = marker.marker_in_tanker;
            Marker {
                id: marker.id,
                x: p.x,
                y: p.y,
                z: p.z,
            }
        })
        .collect();
    let mut made = null_mut();
    // SAFETY: every pointer is of a live value of its type.
    let status = unsafe {
        tanker_pose_create(
            &CAMERA,
            markers.as_ptr(),
            markers.len(),
            options,
            &raw mut made,
            null_mut(),
            0,
        )
    };
    assert_eq!(status, Status::Ok);
    made
}

#[test]
fn frames_have_the_bits_of_the_pipeline_and_allocate_nothing() {
    let map = MarkerMap::shipped("paper").expect("shipped");
    let camera =
        Camera::from_intrinsics(571.0, 571.0, 254.0, 206.0, Some((508, 412))).expect("a camera");
    let info = tanker_pose::camera::CameraInfo {
        width: 508,
        height: 412,
        ..Default::default()
    };
    let edges = ImageEdges::new(&info, &camera, false);
    let estimator = made(&map, &tanker_pose_default_options());
    let mut numbers = Numbers(7);
    let mut codes = std::collections::BTreeMap::new();
    let mut allocations = 0;
    for index in 0..FRAMES {
        let seen = frame(index, &map, &mut numbers);
        let mut pose = std::mem::MaybeUninit::<Pose>::uninit();
        let mut status = Status::Internal;
        let counted = allocation_counter::measure(|| {
            // SAFETY: the estimator is live, the slice is, and the place for the pose is.
            status = unsafe {
                tanker_pose_estimate(estimator, seen.as_ptr(), seen.len(), pose.as_mut_ptr())
            };
        });
        assert_eq!(status, Status::Ok);
        // What is made once a process is not the frame's.
        if index > 100 {
            allocations += counted.count_total;
        }
        // SAFETY: `tanker_pose_estimate` writes it in every case.
        let pose = unsafe { pose.assume_init() };
        let expected = solved(&map, &camera, &edges, &seen);
        assert_eq!(pose.outcome, u32::from(expected.code().number()), "{index}");
        *codes.entry(expected.code()).or_insert(0) += 1;
        let bits = |numbers: &[f64]| {
            numbers
                .iter()
                .map(|number| number.to_bits())
                .collect::<Vec<_>>()
        };
        if let Ok(solution) = &expected.result {
            let rotation = solution.camera_from_tanker.rotation.to_rotation_matrix();
            assert_eq!(
                bits(&pose.rotation),
                bits(rotation.matrix().transpose().as_slice())
            );
            assert_eq!(
                bits(&pose.translation),
                bits(solution.camera_from_tanker.translation.vector.as_slice())
            );
            assert_eq!(
                bits(&pose.covariance),
                bits(&solution.covariance.row_major())
            );
            assert_eq!(pose.used as usize, expected.used_ids.len());
        } else {
            let numbers = [&pose.rotation[..], &pose.translation, &pose.covariance].concat();
            assert!(numbers.iter().all(|number| number.is_nan()), "{index}");
        }
        if let Some(solution) = expected.solution() {
            assert_eq!(pose.chi_squared.to_bits(), solution.chi_squared.to_bits());
            assert_eq!(pose.iterations, u32::from(solution.iterations));
        }
    }
    // SAFETY: made above, ended once.
    unsafe { tanker_pose_destroy(estimator) };
    assert_eq!(allocations, 0, "allocations after set-up");
    assert!(codes[&OutcomeCode::Ok] > FRAMES / 2, "{codes:?}");
    for code in [
        OutcomeCode::NotFinite,
        OutcomeCode::UnknownId,
        OutcomeCode::DuplicateId,
        OutcomeCode::TooFewPoints,
        OutcomeCode::OutsideImage,
    ] {
        assert!(codes.contains_key(&code), "{code:?} {codes:?}");
    }
}
