//! The solver leaves the heap alone: its time depends on the frame, not on an allocator.

use tanker_pose::camera::Camera;
use tanker_pose::estimation::{
    Estimator, EstimatorSettings, Initialisation, Observation, Refinement,
};
use tanker_pose::simulation::paper_camera;

mod solver_support;

use solver_support::{frame, full_budget, plumb_bob_camera};

/// Points that fit without the heap.
const MOST: u32 = 64;

fn allocations(settings: EstimatorSettings, camera: &Camera, seen: &[Observation]) -> u64 {
    let estimator = Estimator::new(settings);
    let solve = || estimator.estimate(camera, seen, None);
    // What is made once a process (a table of rotations, what the processor can do) is not the frame's.
    let once = solve().expect("a pose");
    assert!(once.is_trusted());
    let mut again = None;
    let counted = allocation_counter::measure(|| again = Some(solve()));
    assert_eq!(again.expect("it ran"), Ok(once));
    counted.count_total
}

#[test]
fn no_solve_of_64_points_or_fewer_allocates() {
    for camera in [paper_camera(), plumb_bob_camera()] {
        for count in [6, 7, 12, MOST] {
            let clean = frame(&camera, count);
            let mut wrong = clean.clone();
            wrong[2].pixel.u += 60.0;
            let mut exchanged = clean.clone();
            (exchanged[1].pixel, exchanged[4].pixel) = (clean[4].pixel, clean[1].pixel);
            for initialisation in [
                Initialisation::Nominal,
                Initialisation::Previous,
                Initialisation::Dlt,
                Initialisation::Global,
            ] {
                for (refinement, certify) in [
                    (Refinement::MaximumLikelihood, false),
                    (Refinement::MaximumLikelihood, true),
                    (Refinement::None, false),
                    (Refinement::None, true),
                ] {
                    let mut settings = EstimatorSettings {
                        initialisation,
                        refinement,
                        // Two of six can be left out.
                        min_points: 4,
                        certify,
                        ..EstimatorSettings::default()
                    };
                    let case = format!(
                        "{count} points, {initialisation:?}, {refinement:?}, certify {certify}"
                    );
                    assert_eq!(allocations(settings.clone(), &camera, &clean), 0, "{case}");
                    // The linear start needs six points; of six none can be left out.
                    if initialisation == Initialisation::Dlt && count < 8 {
                        continue;
                    }
                    settings.max_outliers = 2;
                    let found = allocations(settings.clone(), &camera, &wrong);
                    assert_eq!(found, 0, "{case}, one gross error");
                    if initialisation == Initialisation::Nominal {
                        let found = allocations(settings, &camera, &exchanged);
                        assert_eq!(found, 0, "{case}, two ids exchanged");
                    }
                }
            }
        }
    }
}

#[test]
fn no_solve_with_a_full_budget_allocates() {
    for camera in [paper_camera(), plumb_bob_camera()] {
        for count in [6, 12, MOST] {
            let clean = frame(&camera, count);
            for certify in [false, true] {
                let settings = EstimatorSettings {
                    certify,
                    ..EstimatorSettings::default()
                };
                let estimator = Estimator::new(settings).with_budget(full_budget(&clean));
                let solve = || estimator.estimate(&camera, &clean, None);
                assert!(solve().expect("a pose").is_trusted());
                let counted = allocation_counter::measure(|| drop(solve()));
                assert_eq!(counted.count_total, 0, "{count} points, certify {certify}");
            }
        }
    }
}

/// Without this the tests above would pass with a counter that does not count.
#[test]
fn more_than_64_points_do_allocate() {
    let seen = frame(&paper_camera(), MOST + 1);
    assert!(allocations(EstimatorSettings::default(), &paper_camera(), &seen) > 0);
}
