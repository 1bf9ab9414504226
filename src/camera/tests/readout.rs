//! Region of interest, binning, and raw against rectified.

use super::super::{Camera, CameraInfo, Pixel, Ray, RegionOfInterest};
use super::info;

/// A full-HD sensor with a lens.
fn sensor() -> CameraInfo {
    CameraInfo {
        width: 1920,
        height: 1080,
        k: [1400.0, 0.0, 960.0, 0.0, 1390.0, 540.0, 0.0, 0.0, 1.0],
        ..info("plumb_bob", &[-0.2, 0.05, 0.0004, -0.0003, 0.0])
    }
}

fn pinhole(info: &CameraInfo) -> Option<[f64; 4]> {
    let plain = CameraInfo {
        d: Vec::new(),
        ..info.clone()
    };
    Camera::from_info(&plain, false)
        .expect("a good camera")
        .pinhole()
}

#[test]
fn the_offset_is_subtracted_before_binning_divides() {
    let cropped = RegionOfInterest {
        x_offset: 100,
        y_offset: 60,
        width: 800,
        height: 600,
        do_rectify: false,
    };
    let read_out = CameraInfo {
        roi: cropped,
        binning_x: 2,
        binning_y: 4,
        ..sensor()
    };
    assert_eq!(pinhole(&read_out), Some([700.0, 347.5, 430.0, 120.0]));
    let camera = Camera::from_info(&read_out, false).expect("a good camera");
    assert_eq!(camera.image_size_px(), Some((400, 150)));
}

#[test]
fn a_binned_and_cropped_pixel_has_the_ray_of_its_place_on_the_sensor() {
    let cropped = RegionOfInterest {
        x_offset: 200,
        y_offset: 300,
        width: 640,
        height: 480,
        do_rectify: false,
    };
    let full = Camera::from_info(&sensor(), false).expect("a good camera");
    let read_out = CameraInfo {
        roi: cropped,
        binning_x: 2,
        binning_y: 2,
        ..sensor()
    };
    let read_out = Camera::from_info(&read_out, false).expect("a good camera");
    let ray = read_out
        .ray_from_pixel(Pixel { u: 30.0, v: 40.0 })
        .expect("in the image");
    let same = full
        .ray_from_pixel(Pixel { u: 260.0, v: 380.0 })
        .expect("in the image");
    assert!((ray.x - same.x).hypot(ray.y - same.y) < 1.0e-14);
}

#[test]
fn binning_of_zero_and_of_one_change_nothing() {
    let plain = Camera::from_info(&sensor(), false).expect("a good camera");
    let ones = CameraInfo {
        binning_x: 1,
        binning_y: 1,
        ..sensor()
    };
    assert_eq!(Camera::from_info(&ones, false), Ok(plain));
}

#[test]
fn a_region_as_large_as_the_image_is_the_whole_image() {
    let whole = RegionOfInterest {
        width: 1920,
        height: 1080,
        ..RegionOfInterest::default()
    };
    let named = CameraInfo {
        roi: whole,
        ..sensor()
    };
    assert_eq!(
        Camera::from_info(&named, false),
        Camera::from_info(&sensor(), false)
    );
}

#[test]
fn an_unknown_image_size_is_allowed_and_told() {
    let unknown = CameraInfo {
        width: 0,
        height: 0,
        ..sensor()
    };
    assert_eq!(
        Camera::from_info(&unknown, false).map(|camera| camera.image_size_px()),
        Ok(None)
    );
    let cropped = RegionOfInterest {
        x_offset: 5000,
        y_offset: 0,
        width: 640,
        height: 480,
        do_rectify: false,
    };
    let known_by_its_region = CameraInfo {
        roi: cropped,
        ..unknown
    };
    let camera = Camera::from_info(&known_by_its_region, false).expect("a good camera");
    assert_eq!(camera.image_size_px(), Some((640, 480)));
}

#[test]
fn rectified_pixels_take_p_and_no_distortion() {
    let both = CameraInfo {
        p: [
            1300.0, 0.0, 950.0, 0.0, 0.0, 1310.0, 530.0, 0.0, 0.0, 0.0, 1.0, 0.0,
        ],
        roi: RegionOfInterest {
            x_offset: 50,
            y_offset: 30,
            width: 1000,
            height: 900,
            do_rectify: false,
        },
        binning_x: 2,
        ..sensor()
    };
    let rectified = Camera::from_info(&both, true).expect("a good camera");
    assert_eq!(rectified.pinhole(), Some([650.0, 1310.0, 450.0, 500.0]));
    assert_eq!(rectified.image_size_px(), Some((500, 900)));
    let raw = Camera::from_info(&both, false).expect("a good camera");
    assert_eq!(raw.pinhole(), None);
    assert!(!raw.is_pinhole());
}

#[test]
fn rectified_pixels_do_not_depend_on_a_lens_we_do_not_know() {
    let strange = CameraInfo {
        p: [
            1300.0, 0.0, 950.0, 0.0, 0.0, 1310.0, 530.0, 0.0, 0.0, 0.0, 1.0, 0.0,
        ],
        distortion_model: "ds".to_owned(),
        d: vec![f64::NAN],
        ..sensor()
    };
    assert!(Camera::from_info(&strange, true).is_ok());
    assert!(Camera::from_info(&strange, false).is_err());
}

#[test]
fn a_camera_from_intrinsics_is_that_pinhole() {
    let camera = Camera::from_intrinsics(571.0, 569.0, 254.0, 206.0, Some((508, 412)))
        .expect("a good camera");
    assert_eq!(camera.pinhole(), Some([571.0, 569.0, 254.0, 206.0]));
    assert_eq!(camera.image_size_px(), Some((508, 412)));
    let (pixel, by_ray) = camera
        .project(Ray { x: 0.5, y: -0.25 })
        .expect("a pinhole projects everything");
    assert_eq!(pixel, Pixel { u: 539.5, v: 63.75 });
    assert_eq!(by_ray, nalgebra::Matrix2::new(571.0, 0.0, 0.0, 569.0));
    assert_eq!(camera.ray_from_pixel(pixel), Ok(Ray { x: 0.5, y: -0.25 }));
    assert_eq!(
        Camera::from_intrinsics(571.0, 571.0, 0.0, 0.0, None).map(|c| c.image_size_px()),
        Ok(None)
    );
}

#[test]
fn coefficients_that_are_all_zero_make_a_pinhole_but_never_of_a_fisheye() {
    let none = |model: &str, d: &[f64]| {
        Camera::from_info(&info(model, d), false).map(|camera| camera.is_pinhole())
    };
    for model in [
        "plumb_bob",
        "rational_polynomial",
        "",
        "none",
        "brown_conrady",
    ] {
        assert_eq!(none(model, &[]), Ok(true), "{model}");
        assert_eq!(none(model, &[0.0; 5]), Ok(true), "{model}");
        assert_eq!(none(model, &[0.0; 12]), Ok(true), "{model}");
    }
    assert_eq!(none("equidistant", &[0.0; 4]), Ok(false));
    assert!(none("equidistant", &[]).is_err());
    assert!(none("fisheye", &[0.0; 4]).is_err());
    assert!(none("Kannala_Brandt4", &[]).is_err());
}
