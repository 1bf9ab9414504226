use super::*;
use crate::camera::{Camera, CameraInfo};
use crate::estimation::Observation;
use crate::estimation::lanes::four::{Arithmetic, Kernel, Plain, vectorised};
use crate::estimation::lanes::points::{Blocks, Points};
use crate::simulation::{Scene, paper_scene};

struct Example {
    scene: Scene,
    observations: Vec<Observation>,
    pose: CentredPose,
}

fn example(camera: Camera) -> Example {
    let paper = paper_scene();
    let scene = Scene::with_markers(
        camera,
        paper.markers().to_vec(),
        *paper.truth_camera_from_tanker(),
    );
    let observations = scene.exact_observations();
    let mean = Points::new(Plain, scene.camera(), &observations, &mut Blocks::new())
        .expect("in general position")
        .mean;
    let pose = CentredPose {
        rotation: scene.truth_rotation(),
        centre_in_camera: (scene.truth_camera_from_tanker() * mean).coords,
    };
    Example {
        scene,
        observations,
        pose,
    }
}

fn wide_angle() -> Camera {
    let info = CameraInfo {
        width: 508,
        height: 412,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![-0.2, 0.05, 1e-3, -1e-3, 0.0],
        k: [571.0, 0.0, 254.0, 0.0, 560.0, 206.0, 0.0, 0.0, 1.0],
        ..CameraInfo::default()
    };
    Camera::from_info(&info, false).expect("a camera")
}

fn disturb(observations: &mut [Observation]) {
    for (i, seen) in observations.iter_mut().enumerate() {
        seen.pixel.u += 0.3 * i as f64 - 1.0;
        seen.pixel.v -= 0.2 * i as f64;
        seen.sigma_px = 0.5 + 0.1 * i as f64;
    }
}

fn assert_derivative_of_cost(residuals: &impl Residuals, pose: &CentredPose) {
    let here = residuals.linearise(pose).expect("in view");
    let scale = here
        .slope
        .gradient
        .iter()
        .map(|g| g * g)
        .sum::<f64>()
        .sqrt();
    let h = 1e-6;
    for axis in 0..6 {
        let mut step = [0.0; 6];
        step[axis] = h;
        let plus = residuals.linearise(&pose.moved(&step)).expect("in view");
        let minus = residuals
            .linearise(&pose.moved(&step.map(|s| -s)))
            .expect("in view");
        let difference = (plus.slope.chi_squared - minus.slope.chi_squared) / (4.0 * h);
        let relative = (difference - here.slope.gradient[axis]).abs() / scale;
        assert!(
            relative < 1e-6,
            "axis {axis}: {difference} against {}",
            here.slope.gradient[axis]
        );
        // The gradient's own change is the information, where residuals are small.
        for other in 0..=axis {
            let change = (plus.slope.gradient[other] - minus.slope.gradient[other]) / (2.0 * h);
            let information = here.information.matrix();
            let entry = information[(axis, other)];
            let size = (information[(axis, axis)] * information[(other, other)]).sqrt();
            assert!(
                (change - entry).abs() < 0.02 * size,
                "{axis}, {other}: {change}, {entry}"
            );
        }
    }
}

#[test]
fn gradient_is_zero_at_the_truth_without_noise() {
    let Example {
        scene,
        observations,
        pose,
    } = example(crate::simulation::paper_camera());
    let mut room = Blocks::new();
    let points =
        Points::new(Plain, scene.camera(), &observations, &mut room).expect("in general position");
    let here = PinholeResiduals {
        arithmetic: Plain,
        points: &points,
    }
    .linearise(&pose)
    .expect("every marker is in view");
    assert!(
        here.slope.gradient.iter().all(|g| g.abs() < 1e-6),
        "{:?}",
        here.slope.gradient
    );
    assert!(here.slope.chi_squared < 1e-18);
}

#[test]
fn derivatives_agree_with_central_differences() {
    for camera in [crate::simulation::paper_camera(), wide_angle()] {
        let Example {
            scene,
            mut observations,
            pose,
        } = example(camera);
        disturb(&mut observations);
        let mut room = Blocks::new();
        let points = Points::new(Plain, scene.camera(), &observations, &mut room)
            .expect("in general position");
        let lens = LensResiduals {
            camera: scene.camera(),
            observations: &observations,
            markers_mean: points.mean,
        };
        assert_derivative_of_cost(&lens, &pose);
        if scene.camera().is_pinhole() {
            assert_derivative_of_cost(
                &PinholeResiduals {
                    arithmetic: Plain,
                    points: &points,
                },
                &pose,
            );
        }
    }
}

#[test]
fn blocks_and_single_points_give_the_same_sums() {
    let Example {
        scene,
        mut observations,
        pose,
    } = example(crate::simulation::paper_camera());
    disturb(&mut observations);
    let mut room = Blocks::new();
    let points =
        Points::new(Plain, scene.camera(), &observations, &mut room).expect("in general position");
    let lens = LensResiduals {
        camera: scene.camera(),
        observations: &observations,
        markers_mean: points.mean,
    };
    let (a, b) = (
        PinholeResiduals {
            arithmetic: Plain,
            points: &points,
        }
        .linearise(&pose),
        lens.linearise(&pose),
    );
    let (a, b) = (a.expect("in view"), b.expect("in view"));
    let close = |a: f64, b: f64| (a - b).abs() < 1e-9 * (1.0 + b.abs());
    assert!(close(a.slope.chi_squared, b.slope.chi_squared));
    assert!(close(
        a.slope.squared_residuals_px,
        b.slope.squared_residuals_px
    ));
    assert!(
        a.slope
            .gradient
            .iter()
            .zip(b.slope.gradient)
            .all(|(a, b)| close(*a, b))
    );
    let (a, b) = (a.information.matrix(), b.information.matrix());
    assert!(a.iter().zip(b.iter()).all(|(a, b)| close(*a, *b)));
}

#[test]
fn points_behind_the_camera_have_no_residuals() {
    let Example {
        scene,
        observations,
        mut pose,
    } = example(crate::simulation::paper_camera());
    let mut room = Blocks::new();
    let points =
        Points::new(Plain, scene.camera(), &observations, &mut room).expect("in general position");
    pose.centre_in_camera.z = 1.0; // the wings are then behind
    assert!(
        PinholeResiduals {
            arithmetic: Plain,
            points: &points
        }
        .linearise(&pose)
        .is_none()
    );
}

/// Linearises in whatever arithmetic it is given.
struct Linearise<'a> {
    points: &'a Points<'a>,
    pose: &'a CentredPose,
}

impl Kernel for Linearise<'_> {
    type Output = (Linearised, Slope);

    fn run<A: Arithmetic>(self, arithmetic: A) -> Self::Output {
        let residuals = PinholeResiduals {
            arithmetic,
            points: self.points,
        };
        let linearised = residuals.linearise(self.pose).expect("in view");
        (
            linearised,
            residuals
                .slope(self.pose, &linearised.kept)
                .expect("in view"),
        )
    }
}

#[test]
fn every_arithmetic_gives_the_same_sums_but_for_rounding() {
    let Example {
        scene,
        mut observations,
        pose,
    } = example(crate::simulation::paper_camera());
    disturb(&mut observations);
    let mut room = Blocks::new();
    let points =
        Points::new(Plain, scene.camera(), &observations, &mut room).expect("in general position");
    let kernel = || Linearise {
        points: &points,
        pose: &pose,
    };
    let (plain, plain_slope) = kernel().run(Plain);
    let (best, best_slope) = vectorised(kernel());
    let close = |a: f64, b: f64| (a - b).abs() < 1e-10 * (1.0 + b.abs());
    let (plain_matrix, best_matrix) = (plain.information.matrix(), best.information.matrix());
    for (a, b) in plain_matrix.iter().zip(best_matrix.iter()) {
        assert!(close(*a, *b), "{a} {b}");
    }
    for slope in [plain_slope, best.slope, best_slope] {
        assert!(close(slope.chi_squared, plain.slope.chi_squared));
        assert!(close(
            slope.squared_residuals_px,
            plain.slope.squared_residuals_px
        ));
        for (a, b) in slope.gradient.iter().zip(plain.slope.gradient) {
            assert!(close(*a, b), "{a} {b}");
        }
    }
}
