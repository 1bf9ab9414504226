//! Every reason for which a camera info is refused.

use super::super::{Camera, CameraError, CameraInfo, RegionOfInterest};
use super::info;

/// A sound camera info, raw and rectified, to be spoilt.
fn sound() -> CameraInfo {
    CameraInfo {
        p: [
            571.0, 0.0, 254.0, 0.0, 0.0, 569.0, 206.0, 0.0, 0.0, 0.0, 1.0, 0.0,
        ],
        ..info("plumb_bob", &[-0.2, 0.05, 0.0, 0.0, 0.0])
    }
}

fn refusal(rectified: bool, spoil: impl FnOnce(&mut CameraInfo)) -> CameraError {
    let mut info = sound();
    spoil(&mut info);
    Camera::from_info(&info, rectified).expect_err("this camera info is wrong")
}

fn raw(spoil: impl FnOnce(&mut CameraInfo)) -> String {
    refusal(false, spoil).to_string()
}

fn rectified(spoil: impl FnOnce(&mut CameraInfo)) -> String {
    refusal(true, spoil).to_string()
}

#[test]
fn the_unspoilt_camera_info_passes() {
    assert!(Camera::from_info(&sound(), false).is_ok());
    assert!(Camera::from_info(&sound(), true).is_ok());
}

#[test]
fn a_camera_that_is_not_calibrated_is_refused() {
    let message = "the camera is not calibrated (k[0] is 0.0)";
    assert_eq!(raw(|info| *info = CameraInfo::default()), message);
    assert_eq!(raw(|info| info.k[0] = 0.0), message);
    assert_eq!(rectified(|info| info.k = [0.0; 9]), message);
    assert_eq!(
        rectified(|info| info.p = [0.0; 12]),
        "the camera has no projection for rectified pixels (p[0] is 0.0)"
    );
}

#[test]
fn anything_used_that_is_not_finite_is_refused() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for index in 0..9 {
            let error = refusal(false, |info| info.k[index] = value);
            assert!(
                matches!(error, CameraError::NotFinite { array: "k", index: i, .. } if i == index),
                "{error}"
            );
        }
        for index in 0..12 {
            let error = refusal(true, |info| info.p[index] = value);
            assert!(
                matches!(error, CameraError::NotFinite { array: "p", index: i, .. } if i == index),
                "{error}"
            );
        }
        for index in 0..5 {
            let error = refusal(false, |info| info.d[index] = value);
            assert!(
                matches!(error, CameraError::NotFinite { array: "d", index: i, .. } if i == index),
                "{error}"
            );
        }
    }
    assert_eq!(
        raw(|info| info.k[2] = f64::NAN),
        "k[2] must be finite, got NaN"
    );
}

#[test]
fn focal_lengths_that_no_lens_has_are_refused() {
    assert_eq!(
        raw(|info| info.k[0] = -571.0),
        "k[0], a focal length, must be 1 to 1e6 px, got -571.0"
    );
    assert_eq!(
        raw(|info| info.k[4] = 0.0),
        "k[4], a focal length, must be 1 to 1e6 px, got 0.0"
    );
    assert_eq!(
        raw(|info| info.k[4] = 0.008),
        "k[4], a focal length, must be 1 to 1e6 px, got 0.008"
    );
    assert_eq!(
        rectified(|info| info.p[5] = 1.0e9),
        "p[5], a focal length, must be 1 to 1e6 px, got 1000000000.0"
    );
}

#[test]
fn a_principal_point_may_lie_outside_the_image_but_not_anywhere() {
    // A quarter of a sensor, cut from its corner, with the calibration of the whole.
    let mut corner = sound();
    corner.k[2] = 2.0 * 508.0;
    corner.k[5] = -412.0;
    assert!(Camera::from_info(&corner, false).is_ok());
    assert_eq!(
        raw(|info| info.k[2] = 1223.5),
        "the principal point (1223.5, 206) of k lies more than one image size outside the image of 508x412: the \
         calibration belongs to another resolution, or the image is a region of a larger one (set roi, and width and \
         height of the full image)"
    );
    assert!(rectified(|info| info.p[6] = -413.0).contains("of p lies more than"));
    assert_eq!(
        raw(|info| {
            (info.width, info.height) = (0, 0);
            info.k[5] = -1.5e6;
        }),
        "k[5], the principal point, must be within 1e6 px of the image, got -1500000.0"
    );
}

#[test]
fn width_and_height_in_each_others_place_are_noticed() {
    assert_eq!(
        raw(|info| (info.width, info.height) = (412, 508)),
        "width 412 and height 508 are exchanged, or belong to another calibration: the principal point (254, 206) is \
         the centre of an image of 508x412"
    );
    // Off the centre, but not at that of the exchanged image either: a cropped camera.
    let mut cropped = sound();
    (cropped.k[2], cropped.k[5]) = (300.0, 160.0);
    assert!(Camera::from_info(&cropped, false).is_ok());
}

#[test]
fn intrinsics_with_the_binning_already_applied_are_noticed() {
    let binned = |info: &mut CameraInfo| {
        (info.binning_x, info.binning_y) = (2, 2);
        for index in [0, 2, 4, 5] {
            info.k[index] /= 2.0;
        }
    };
    assert_eq!(
        raw(binned),
        "the principal point (127, 103) of k is the centre of the image after binning by 2x2: k and p must be those \
         of the full resolution, or set binning to 1"
    );
}

/// The calibration of a 508x412 image with everything in pixels multiplied, for an image of this size.
fn scaled(factor: f64, width: u32, height: u32) -> CameraInfo {
    let mut info = sound();
    (info.width, info.height) = (width, height);
    for index in [0, 2, 4, 5] {
        info.k[index] *= factor;
    }
    for index in [0, 2, 5, 6] {
        info.p[index] *= factor;
    }
    info
}

#[test]
fn calibration_of_another_resolution_is_refused() {
    let mut of_both = 0;
    for factor in [
        0.25,
        0.5,
        2.0 / 3.0,
        0.75,
        1.25,
        4.0 / 3.0,
        1.5,
        2.0,
        3.0,
        4.0,
    ] {
        for rectified in [false, true] {
            let error = Camera::from_info(&scaled(factor, 508, 412), rectified)
                .expect_err("another resolution");
            assert!(
                matches!(error, CameraError::OtherResolution { .. }),
                "{factor}: {error}"
            );
            of_both += 1;
        }
    }
    assert_eq!(of_both, 20);
    assert_eq!(
        raw(|info| *info = scaled(2.0, 508, 412)),
        "the principal point (508, 412) of k is the centre of an image of 1016x824, but width and height are 508x412: \
         calibrate at the resolution that is used, or scale k to it; if the image is a part of a larger one, set roi, \
         and width and height of the full image"
    );
    // Another shape as well: 1920x1080 and 1280x720 used for 640x480, and 800x600 for 1920x1080.
    for (of, used) in [
        ([1920.0, 1080.0], (640, 480)),
        ([1280.0, 720.0], (640, 480)),
        ([800.0, 600.0], (1920, 1080)),
    ] {
        let mut info = scaled(1.0, used.0, used.1);
        (info.k[2], info.k[5]) = (of[0] / 2.0, of[1] / 2.0);
        assert!(Camera::from_info(&info, false).is_err(), "{of:?} {used:?}");
    }
}

#[test]
fn part_of_an_image_passes_with_its_region_and_without_where_it_is_clear() {
    // The whole calibrated at 1016x824, its upper left quarter read out.
    let mut quarter = scaled(2.0, 1016, 824);
    quarter.roi = RegionOfInterest {
        width: 508,
        height: 412,
        ..RegionOfInterest::default()
    };
    assert!(Camera::from_info(&quarter, false).is_ok());
    assert_eq!(quarter.off_centre(false), None);
    // Without the region: rows cut off at the top, at the bottom, and two opposite corners.
    for (cx, cy) in [
        (254.0, 100.0),
        (254.0, 400.0),
        (350.0, 120.0),
        (130.0, 300.0),
    ] {
        let mut cut = sound();
        (cut.k[2], cut.k[5]) = (cx, cy);
        assert!(Camera::from_info(&cut, false).is_ok(), "({cx}, {cy})");
        let words = cut.off_centre(false).expect("worth a warning").to_string();
        assert!(words.contains("508x412"), "{words}");
    }
    // A lens that sits a little askew.
    let mut askew = sound();
    (askew.k[2], askew.k[5]) = (254.0 + 0.07 * 508.0, 206.0 + 0.09 * 412.0);
    assert!(Camera::from_info(&askew, false).is_ok());
    assert_eq!(sound().off_centre(false), None);
    assert_eq!(sound().off_centre(true), None);
}

#[test]
fn skew_and_entries_that_a_matrix_fixes_are_refused() {
    assert_eq!(
        raw(|info| info.k[1] = 0.5),
        "k[1], the skew, must be 0 (up to 5.7e-4 px), got 0.5"
    );
    assert_eq!(raw(|info| info.k[8] = 0.0), "k[8] must be 1, got 0.0");
    for (rectified, index) in [(false, 1), (true, 1)] {
        assert!(matches!(
            refusal(rectified, |info| {
                info.k[index] = 2.0;
                info.p[index] = 2.0;
            }),
            CameraError::Skew { .. }
        ));
    }
    for index in [3, 6, 7, 8] {
        assert!(matches!(
            refusal(false, |info| info.k[index] = 2.0),
            CameraError::FixedEntry { array: "k", .. }
        ));
    }
    for index in [4, 8, 9, 10, 11] {
        assert!(matches!(
            refusal(true, |info| info.p[index] = 2.0),
            CameraError::FixedEntry { array: "p", .. }
        ));
    }
}

#[test]
fn skew_that_is_rounding_of_a_calibration_passes() {
    let mut dusty = sound();
    dusty.k[1] = -1.0e-7;
    dusty.p[1] = 1.0e-7;
    assert!(Camera::from_info(&dusty, false).is_ok());
    assert!(Camera::from_info(&dusty, true).is_ok());
}

#[test]
fn the_projection_of_a_stereo_pair_is_refused() {
    assert_eq!(
        rectified(|info| info.p[3] = -68.5),
        "p[3] must be 0, got -68.5: it holds a stereo pair's baseline, and the projection of one camera is needed"
    );
    assert!(matches!(
        refusal(true, |info| info.p[7] = 1.0),
        CameraError::Baseline { index: 7, .. }
    ));
}

#[test]
fn an_unknown_lens_is_refused_by_name() {
    assert_eq!(
        raw(|info| info.distortion_model = "division".to_owned()),
        "distortion model `division` with d = [-0.2, 0.05, 0.0, 0.0, 0.0] is unknown; known models are plumb_bob, \
         rational_polynomial, equidistant"
    );
    assert!(
        raw(|info| info.distortion_model = "fisheye".to_owned())
            .ends_with("; ROS calls OpenCV's fisheye model (4 coefficients) `equidistant`")
    );
    assert!(matches!(
        refusal(false, |info| info.distortion_model.clear()),
        CameraError::UnknownDistortionModel { .. }
    ));
}

#[test]
fn another_number_of_coefficients_than_the_lens_has_is_refused() {
    let with = |model: &str, d: &[f64]| {
        let info = CameraInfo {
            distortion_model: model.to_owned(),
            d: d.to_vec(),
            ..sound()
        };
        Camera::from_info(&info, false)
    };
    assert_eq!(
        with("plumb_bob", &[-0.2, 0.05, 0.0])
            .expect_err("too few")
            .to_string(),
        "distortion model `plumb_bob` needs 4 or 5 coefficients (more only if those are 0), got 3: d = [-0.2, 0.05, 0.0]"
    );
    for (model, most) in [
        ("plumb_bob", 5),
        ("rational_polynomial", 8),
        ("equidistant", 4),
    ] {
        for count in 1..4 {
            assert!(with(model, &vec![0.01; count]).is_err(), "{model} {count}");
        }
        // Missing coefficients at the end are 0, and zeros after the last one say nothing.
        for count in 4..=most {
            let mut d = vec![0.01; count];
            let short = with(model, &d).expect("as many as calibrations give");
            d.resize(most, 0.0);
            assert_eq!(with(model, &d).as_ref(), Ok(&short), "{model} {count}");
            d.resize(14, 0.0);
            assert_eq!(with(model, &d).as_ref(), Ok(&short), "{model} {count}");
        }
        let mut longer = vec![0.01; most];
        longer.extend([0.0, 0.1]);
        assert!(matches!(
            with(model, &longer),
            Err(CameraError::CoefficientCount { .. })
        ));
    }
}

#[test]
fn a_coefficient_that_no_calibration_gives_is_refused() {
    assert_eq!(
        raw(|info| info.d[1] = -1.0e12),
        "d[1] must be within 1e9, got -1000000000000.0"
    );
}

#[test]
fn an_image_with_one_side_is_refused() {
    assert_eq!(
        raw(|info| info.width = 0),
        "image width and height must both be positive, or both 0 for unknown, got 0x412"
    );
}

#[test]
fn regions_without_pixels_or_beyond_the_image_are_refused() {
    let region = |x_offset, y_offset, width, height| {
        raw(|info| {
            info.roi = RegionOfInterest {
                x_offset,
                y_offset,
                width,
                height,
                do_rectify: false,
            }
        })
    };
    assert_eq!(
        region(0, 0, 100, 0),
        "the region of interest has no pixels: 100x0 at (0, 0)"
    );
    assert_eq!(
        region(0, 0, 0, 100),
        "the region of interest has no pixels: 0x100 at (0, 0)"
    );
    assert_eq!(
        region(10, 0, 0, 0),
        "the region of interest has no pixels: 0x0 at (10, 0)"
    );
    assert_eq!(
        region(9, 0, 500, 412),
        "the region of interest, 500x412 at (9, 0), reaches beyond the image of 508x412"
    );
    assert!(region(0, 1, 508, 412).contains("reaches beyond"));
    assert!(region(u32::MAX, 0, u32::MAX, 1).contains("reaches beyond"));
}

#[test]
fn binning_that_leaves_no_pixel_is_refused() {
    assert_eq!(
        raw(|info| info.binning_y = 413),
        "binning 0x413 leaves no pixel of 508x412"
    );
}
