//! How long our own stages take, one frame each: `cargo bench`, or `cargo bench -- estimate` for a part.
//!
//! Comparisons with other solvers are in `benches/peers`.

#![expect(missing_docs, reason = "criterion's macros make public functions")]

use std::hint::black_box;

use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Translation3, Vector3, Vector6};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tanker_pose::camera::{Pixel, Ray};
use tanker_pose::estimation::{
    Certificate, ErrorBudget, Estimator, EstimatorSettings, Initialisation, Observation,
    Refinement, fixed_point, iterate_accelerated, iterate_literally,
};
use tanker_pose::frames::flu_from_optical;
use tanker_pose::geometry::{PoseCovariance, optical_from_body};
use tanker_pose::integrity::{
    IntegrityMonitor, IntegrityPoint, IntegritySettings, Mount, SolvedFrame,
};
use tanker_pose::refuelling::Region;
use tanker_pose::simulation::{Scene, paper_camera, pose_in_camera};
use tanker_pose::target::{Marker, MarkerMap};
use tanker_pose::tracking::{Filter, FilterSettings, LastingError};

#[path = "../tests/solver_support/mod.rs"]
mod solver_support;

use solver_support::{frame, full_budget, plumb_bob_camera, survey};

fn rays(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("ray_from_pixel");
    for (lens, camera) in [
        ("pinhole", paper_camera()),
        ("plumb_bob", plumb_bob_camera()),
    ] {
        let pixel = Pixel { u: 430.0, v: 120.0 };
        group.bench_function(lens, |bencher| {
            bencher.iter(|| camera.ray_from_pixel(black_box(pixel)));
        });
    }
}

fn estimates(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("estimate");
    for (name, initialisation, refinement) in [
        (
            "prior",
            Initialisation::Nominal,
            Refinement::MaximumLikelihood,
        ),
        ("prior_unrefined", Initialisation::Nominal, Refinement::None),
        (
            "global",
            Initialisation::Global,
            Refinement::MaximumLikelihood,
        ),
    ] {
        let estimator = Estimator::new(EstimatorSettings {
            initialisation,
            refinement,
            max_outliers: 0,
            ..Default::default()
        });
        for count in [6, 100, 1000] {
            let (camera, seen) = (paper_camera(), frame(&paper_camera(), count));
            group.bench_function(BenchmarkId::new(name, count), |bencher| {
                bencher.iter(|| estimator.estimate(&camera, black_box(&seen), None));
            });
        }
    }
    let (camera, seen) = (plumb_bob_camera(), frame(&plumb_bob_camera(), 6));
    let estimator = Estimator::new(EstimatorSettings::default());
    group.bench_function(BenchmarkId::new("prior_plumb_bob", 6), |bencher| {
        bencher.iter(|| estimator.estimate(&camera, black_box(&seen), None));
    });
}

/// Protection levels of one point, beside the estimate that they belong to.
fn integrity(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("integrity");
    for count in [6, 12, 24] {
        let (camera, seen) = (paper_camera(), frame(&paper_camera(), count));
        let markers: Vec<Marker> = seen
            .iter()
            .map(|seen| Marker {
                id: seen.id,
                marker_in_tanker: seen.marker_in_tanker,
            })
            .collect();
        let map = MarkerMap::new("bench", &markers).expect("a map");
        for (name, pairs, budget) in [
            ("singles", false, None),
            ("pairs", true, None),
            ("pairs_budget", true, Some(full_budget(&seen))),
        ] {
            let estimator = Estimator::new(EstimatorSettings::default());
            let estimator = match budget {
                Some(budget) => estimator.with_budget(budget),
                None => estimator,
            };
            let solution = estimator.estimate(&camera, &seen, None).expect("a pose");
            let mount = Mount {
                receiver_from_camera: Isometry3::from_parts(
                    Translation3::identity(),
                    flu_from_optical().into(),
                ),
                covariance: PoseCovariance(Matrix6::zeros()),
            };
            let point = IntegrityPoint {
                name: "receptacle".to_owned(),
                point_in_tanker: Point3::new(7.8, 0.0, 1.0),
                covariance: Matrix3::zeros(),
                alert_limit_m: None,
            };
            let settings = IntegritySettings {
                pairs,
                hmi_probability: 1e-6,
                ..IntegritySettings::default()
            };
            let monitor = IntegrityMonitor::new(settings, mount, vec![point]);
            group.bench_function(BenchmarkId::new(name, count), |bencher| {
                bencher.iter(|| {
                    monitor.judge(&SolvedFrame {
                        estimator: &estimator,
                        map: Some(&map),
                        camera: &camera,
                        observations: black_box(&seen),
                        solution: &solution,
                    })
                });
            });
        }
    }
}

/// The same frames with every cause of an error budget.
fn with_budget(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("estimate_budget");
    for count in [6, 100] {
        let (camera, seen) = (paper_camera(), frame(&paper_camera(), count));
        let exact = Estimator::new(EstimatorSettings::default());
        let only_survey = ErrorBudget::new(&survey(&seen), vec![], vec![], 0.0).expect("a budget");
        for (name, estimator) in [
            ("none", exact.clone()),
            ("survey", exact.clone().with_budget(only_survey)),
            ("full", exact.with_budget(full_budget(&seen))),
        ] {
            group.bench_function(BenchmarkId::new(name, count), |bencher| {
                bencher.iter(|| estimator.estimate(&camera, black_box(&seen), None));
            });
        }
    }
}

/// The proof that no other pose in front of the camera has a lower cost.
fn certificate(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("estimate_certified");
    let camera = paper_camera();
    for (name, seen) in [
        ("6", frame(&camera, 6)),
        ("12", frame(&camera, 12)),
        ("100", frame(&camera, 100)),
        ("6_flat", flat_frame()),
    ] {
        for certify in [false, true] {
            let estimator = Estimator::new(EstimatorSettings {
                certify,
                ..EstimatorSettings::default()
            });
            let solution = estimator.estimate(&camera, &seen, None);
            let certificate = certify.then_some(Certificate::Certified);
            assert!(solution.is_ok_and(|s| s.certificate == certificate));
            let id = BenchmarkId::new(if certify { "on" } else { "off" }, name);
            group.bench_function(id, |bencher| {
                bencher.iter(|| estimator.estimate(&camera, black_box(&seen), None));
            });
        }
    }
}

/// Six markers in a plane, 30 m ahead and tilted: behind the camera a minimum costs exactly as little.
fn flat_frame() -> Vec<Observation> {
    let places = [
        (-3.0, -1.0),
        (-1.0, 1.2),
        (1.0, -0.8),
        (3.0, 1.0),
        (-2.0, 0.2),
        (2.0, -0.3),
    ];
    let marker = |(id, (y, z)): (u32, (f64, f64))| Marker {
        id,
        marker_in_tanker: Point3::new(0.0, y, z),
    };
    let markers = (1..).zip(places).map(marker).collect();
    let pose = pose_in_camera(Vector3::new(30.0, 0.0, 3.0), 0.0, 20.0, 10.0);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    Scene::with_markers(paper_camera(), markers, pose).noisy_observations(0.5, &mut random)
}

/// One detection is 40 px off: all points fail the test, then every subset is tried.
fn exclusion(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("one_gross_error");
    for max_outliers in [1, 2] {
        let estimator = Estimator::new(EstimatorSettings {
            min_points: 3,
            max_outliers,
            ..Default::default()
        });
        for count in [6, 12] {
            let (camera, mut seen) = (paper_camera(), frame(&paper_camera(), count));
            seen[2].pixel.u += 40.0;
            let solution = estimator.estimate(&camera, &seen, None);
            assert!(solution.is_ok_and(|s| s.excluded.contains(seen[2].id)));
            let id = BenchmarkId::new(format!("at_most_{max_outliers}"), count);
            group.bench_function(id, |bencher| {
                bencher.iter(|| estimator.estimate(&camera, black_box(&seen), None));
            });
        }
    }
}

fn orthogonal_iteration(criterion: &mut Criterion) {
    const TOLERANCE_RAD: f64 = 1e-6;
    const MAX_ITERATIONS: u32 = 1000;
    let mut group = criterion.benchmark_group("orthogonal_iteration");
    let (camera, seen) = (paper_camera(), frame(&paper_camera(), 6));
    let rays: Vec<Ray> = seen
        .iter()
        .map(|o| camera.ray_from_pixel(o.pixel).expect("a pinhole"))
        .collect();
    let markers: Vec<Point3<f64>> = seen.iter().map(|o| o.marker_in_tanker).collect();
    let seed = optical_from_body();
    group.bench_function("literal", |bencher| {
        bencher.iter(|| {
            iterate_literally(
                black_box(&rays),
                &markers,
                &seed,
                TOLERANCE_RAD,
                MAX_ITERATIONS,
            )
        });
    });
    group.bench_function("accelerated", |bencher| {
        bencher.iter(|| {
            iterate_accelerated(
                black_box(&rays),
                &markers,
                &seed,
                TOLERANCE_RAD,
                MAX_ITERATIONS,
            )
        });
    });
    group.bench_function("newton", |bencher| {
        bencher.iter(|| fixed_point(black_box(&rays), &markers, &seed));
    });
}

fn filter(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("filter");
    let (camera, seen) = (paper_camera(), frame(&paper_camera(), 6));
    let solution = Estimator::new(EstimatorSettings::default())
        .estimate(&camera, &seen, None)
        .expect("a noisy frame is solvable");
    let (pose, covariance) = (solution.camera_from_tanker, solution.covariance);
    let mut filter = Filter::new(FilterSettings::default()).expect("the defaults are in range");
    let mut stamp_ns = 0;
    let mut step = || {
        stamp_ns += 33_333_333;
        filter.update(black_box(stamp_ns), &pose, &covariance)
    };
    for _ in 0..100 {
        step();
    }
    group.bench_function("update", |bencher| bencher.iter(&mut step));
    group.bench_function("predict", |bencher| {
        bencher.iter(|| filter.predict(black_box(stamp_ns + 10_000_000)));
    });

    // As a budget of survey, flex, calibration and six markers gives them.
    let errors: Vec<LastingError> = (0..23)
        .map(|cause| LastingError {
            cause,
            shift: Vector6::from_fn(|axis, _| 1e-3 * ((cause + 1) as f64 + axis as f64).sin()),
            time_constant_s: (cause == 20).then_some(5.0),
        })
        .collect();
    for (name, lasting) in [("alone", [].as_slice()), ("23_lasting", &errors)] {
        let mut filter = Filter::new(FilterSettings::default()).expect("the defaults are in range");
        let mut stamp_ns = 0;
        let mut step = || {
            stamp_ns += 33_333_333;
            filter.update_with_lasting(black_box(stamp_ns), &pose, &covariance, lasting)
        };
        for _ in 0..100 {
            step();
        }
        group.bench_function(format!("{name}/update"), |bencher| bencher.iter(&mut step));
        // Overtaken by one frame, and by those of 0.4 s.
        for later in [1, 12] {
            let late_ns = stamp_ns - later * 33_333_333 + 1;
            group.bench_function(format!("{name}/late_by_{later}"), |bencher| {
                bencher.iter_batched_ref(
                    || filter.clone(),
                    |filter| filter.update_with_lasting(late_ns, &pose, &covariance, lasting),
                    BatchSize::SmallInput,
                );
            });
        }
    }
}

fn refuelling(criterion: &mut Criterion) {
    let contact = Region::Cylinder {
        min_x_m: -0.2,
        max_x_m: 0.5,
        radius_m: 0.3,
    };
    let half = Matrix3::new(0.2, 0.0, 0.0, 0.05, 0.04, 0.0, 0.02, 0.03, 0.05);
    let covariance = half * half.transpose();
    let mean = Vector3::new(0.4, 0.1, -0.1);
    criterion.bench_function("refuelling/contact_probability", |bencher| {
        bencher.iter(|| contact.probability(black_box(&mean), &covariance));
    });
}

criterion_group!(
    stages,
    rays,
    estimates,
    with_budget,
    integrity,
    certificate,
    exclusion,
    orthogonal_iteration,
    filter,
    refuelling
);
criterion_main!(stages);
