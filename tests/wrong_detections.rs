//! Wrong detections among few: found, left out and named, or the frame is not trusted.
//!
//! Success: the squared Mahalanobis distance to the maximum likelihood pose of the true inliers is
//! below 30. What is wrong yet trusted is counted and bounded too.

#![allow(clippy::ptr_arg)] // every fault has one type, and one of them removes a point

mod support;

use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use support::{distance_squared, oracle_maximum_likelihood, random_refuelling_scene};
use tanker_pose::estimation::{Estimator, EstimatorSettings, Initialisation, Observation};
use tanker_pose::geometry::pose_error;
use tanker_pose::pipeline::solve;
use tanker_pose::simulation::{Scene, paper_camera};
use tanker_pose::target::Marker;

const FRAMES: usize = 4000;
const SAME_POSE: f64 = 30.0;
const SIGMA_PX: f64 = 0.5;

/// What happens to the image; returns the indices of the points that are no longer right.
type Fault = fn(&mut Vec<Observation>, &mut ChaCha8Rng) -> Vec<u32>;

fn gross<const COUNT: usize>(seen: &mut Vec<Observation>, random: &mut ChaCha8Rng) -> Vec<u32> {
    let mut order: Vec<usize> = (0..seen.len()).collect();
    order.shuffle(random);
    for &index in &order[..COUNT] {
        let distance_px = random.random_range(10.0..100.0);
        let angle: f64 = random.random_range(0.0..std::f64::consts::TAU);
        seen[index].pixel.u += distance_px * angle.cos();
        seen[index].pixel.v += distance_px * angle.sin();
    }
    order[..COUNT].iter().map(|&index| seen[index].id).collect()
}

fn exchanged(seen: &mut Vec<Observation>, random: &mut ChaCha8Rng) -> Vec<u32> {
    let mut order: Vec<usize> = (0..seen.len()).collect();
    order.shuffle(random);
    let (a, b) = (order[0], order[1]);
    (seen[a].pixel, seen[b].pixel) = (seen[b].pixel, seen[a].pixel);
    vec![seen[a].id, seen[b].id]
}

fn occluded_and_gross(seen: &mut Vec<Observation>, random: &mut ChaCha8Rng) -> Vec<u32> {
    seen.remove(random.random_range(0..seen.len()));
    gross::<1>(seen, random)
}

/// The paper's markers, with more along wings and tail where `count` asks for them.
fn scene(count: usize, random: &mut ChaCha8Rng) -> Scene {
    const MORE: [[f64; 3]; 6] = [
        [3.7, -4.8, 0.7],
        [3.7, 4.8, 0.7],
        [7.9, 0.0, 1.9],
        [3.7, -2.4, 0.7],
        [3.7, 2.4, 0.7],
        [7.88, 0.0, 2.6],
    ];
    let scene = random_refuelling_scene(random, 12.0, 40.0);
    let mut markers = scene.markers().to_vec();
    for (id, [x, y, z]) in (7..).zip(&MORE[..count - markers.len()]) {
        markers.push(Marker {
            id,
            marker_in_tanker: nalgebra::Point3::new(*x, *y, *z),
        });
    }
    Scene::with_markers(paper_camera(), markers, *scene.truth_camera_from_tanker())
}

#[derive(Default)]
struct Tally {
    right: usize,
    refused: usize,
    wrong_but_trusted: usize,
}

impl Tally {
    /// Counts a frame that is judged as the pipeline judges it.
    fn count(
        &mut self,
        scene: &Scene,
        seen: &[Observation],
        wrong_ids: &[u32],
        estimator: &Estimator,
    ) {
        let right = seen.iter().filter(|o| !wrong_ids.contains(&o.id));
        let inliers: Vec<_> = right.copied().collect();
        let truth =
            oracle_maximum_likelihood(scene.camera(), &inliers, scene.truth_camera_from_tanker())
                .expect("the oracle settles");
        match solve(estimator, scene.camera(), seen, None).result {
            Ok(solution) if distance_squared(&solution, &truth) < SAME_POSE => self.right += 1,
            Ok(_) => self.wrong_but_trusted += 1,
            Err(_) => self.refused += 1,
        }
    }
}

fn tally(count: usize, max_outliers: usize, seed: u64, fault: Fault) -> Tally {
    let estimator = Estimator::new(EstimatorSettings {
        max_outliers,
        min_points: 4,
        max_ambiguity: 1.0,
        ..Default::default()
    });
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut tally = Tally::default();
    for _ in 0..FRAMES {
        let scene = scene(count, &mut random);
        let mut seen = scene.noisy_observations(SIGMA_PX, &mut random);
        let wrong_ids = fault(&mut seen, &mut random);
        tally.count(&scene, &seen, &wrong_ids, &estimator);
    }
    tally
}

fn report(name: &str, tally: &Tally) -> f64 {
    let percent = |part: usize| 100.0 * part as f64 / FRAMES as f64;
    println!(
        "{name}: right {:.2} %, refused {:.2} %, wrong but trusted {:.2} %",
        percent(tally.right),
        percent(tally.refused),
        percent(tally.wrong_but_trusted)
    );
    percent(tally.right)
}

#[test]
fn the_wrong_points_are_left_out() {
    let none: Fault = |_, _| Vec::new();
    let cases: [(&str, usize, Fault, f64, f64); 8] = [
        ("6 points, clean", 6, none, 99.8, 0.0),
        ("6 points, one gross", 6, gross::<1>, 98.9, 0.15),
        ("6 points, two gross", 6, gross::<2>, 89.2, 0.8),
        ("6 points, two ids exchanged", 6, exchanged, 99.2, 0.5),
        (
            "6 points, one occluded, one gross",
            6,
            occluded_and_gross,
            94.7,
            0.6,
        ),
        ("8 points, two gross", 8, gross::<2>, 99.7, 0.1),
        ("12 points, two gross", 12, gross::<2>, 99.7, 0.1),
        ("12 points, two ids exchanged", 12, exchanged, 99.4, 0.3),
    ];
    for (seed, (name, count, fault, least, most_wrong)) in (50..).zip(cases) {
        let tally = tally(count, 2, seed, fault);
        let right = report(name, &tally);
        let wrong = 100.0 * tally.wrong_but_trusted as f64 / FRAMES as f64;
        assert!(
            right >= least,
            "{name}: {right} % right, expected {least} %"
        );
        assert!(
            wrong <= most_wrong,
            "{name}: {wrong} % wrong but trusted, expected {most_wrong} %"
        );
    }
}

/// Left and right of the whole symmetric tanker: that fits exactly behind the camera.
#[test]
fn exchanged_sides_of_the_tanker_are_never_trusted() {
    for (seed, (initialisation, max_outliers)) in (60..).zip([
        (Initialisation::Nominal, 0),
        (Initialisation::Nominal, 1),
        (Initialisation::Nominal, 2),
        (Initialisation::Global, 0),
        (Initialisation::Global, 2),
    ]) {
        let estimator = Estimator::new(EstimatorSettings {
            initialisation,
            max_outliers,
            min_points: 4,
            max_ambiguity: 1.0,
            ..Default::default()
        });
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let trusted = (0..FRAMES)
            .filter(|_| {
                let scene = scene(6, &mut random);
                let mut seen = scene.noisy_observations(SIGMA_PX, &mut random);
                for (a, b) in [(0, 1), (2, 3)] {
                    (seen[a].pixel, seen[b].pixel) = (seen[b].pixel, seen[a].pixel);
                }
                estimator
                    .estimate(scene.camera(), &seen, None)
                    .is_ok_and(|solution| solution.is_trusted())
            })
            .count();
        println!("sides exchanged, {initialisation:?}, {max_outliers} left out: {trusted} trusted");
        assert_eq!(
            trusted, 0,
            "{initialisation:?} with {max_outliers} left out"
        );
    }
}

/// As the node is set by default, and judged as the node judges: what README states.
#[test]
fn one_wrong_point_of_six_is_left_out_by_the_node_s_defaults() {
    let estimator = Estimator::new(EstimatorSettings {
        max_outliers: 1,
        min_points: 5,
        max_ambiguity: 0.1,
        ..Default::default()
    });
    let mut random = ChaCha8Rng::seed_from_u64(80);
    let mut tally = Tally::default();
    for _ in 0..FRAMES {
        let scene = scene(6, &mut random);
        let mut seen = scene.noisy_observations(SIGMA_PX, &mut random);
        let wrong_ids = gross::<1>(&mut seen, &mut random);
        seen.shuffle(&mut random);
        tally.count(&scene, &seen, &wrong_ids, &estimator);
    }
    let right = report("the node's defaults, 6 points, one gross", &tally);
    assert!(right >= 99.0);
    assert!(tally.wrong_but_trusted <= FRAMES / 1000);
}

#[test]
fn weak_points_do_not_stand_in_for_missing_checks() {
    for max_outliers in [0, 1, 2] {
        let estimator = Estimator::new(EstimatorSettings {
            min_points: 5,
            max_outliers,
            ..Default::default()
        });
        let mut random = ChaCha8Rng::seed_from_u64(70);
        for weak_sigma_px in [5.0, 30.0, 1000.0] {
            let trusted = (0..500)
                .filter(|_| {
                    let scene = scene(6, &mut random);
                    let mut seen = scene.noisy_observations(SIGMA_PX, &mut random);
                    seen.shuffle(&mut random);
                    for weak in &mut seen[..3] {
                        weak.sigma_px = weak_sigma_px;
                    }
                    // An error of one of the three good ones, which nothing contradicts.
                    seen[5].pixel.u += random.random_range(10.0..60.0);
                    estimator
                        .estimate(scene.camera(), &seen, None)
                        .is_ok_and(|found| found.is_trusted())
                })
                .count();
            assert_eq!(trusted, 0, "weak sigma {weak_sigma_px} px");
        }
    }
}

/// Two points that claim far more than the others: wrong, they would rule the pose, and nothing could tell.
#[test]
fn precise_points_claim_no_more_than_the_others_can_check() {
    let estimator = Estimator::new(EstimatorSettings {
        min_points: 5,
        max_outliers: 1,
        max_ambiguity: 0.1,
        ..Default::default()
    });
    for (seed, (precise_px, weak_px)) in
        (90..).zip([(0.5, 5.0), (0.2, 2.0), (0.01, 1.0), (1.0, 1.0)])
    {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (mut wrong, mut accepted, mut nees) = (0, 0_u32, 0.0);
        for _ in 0..FRAMES {
            let scene = scene(6, &mut random);
            let mut seen = scene.noisy_observations(precise_px, &mut random);
            seen.shuffle(&mut random);
            for weak in &mut seen[2..] {
                let blur = scene.noisy_observations(weak_px, &mut random);
                *weak = *blur
                    .iter()
                    .find(|other| other.id == weak.id)
                    .expect("all are in view");
            }
            // Up to twelve times what the weak ones see.
            seen[0].pixel.u += weak_px * random.random_range(2.0..12.0);
            let outcome = solve(&estimator, scene.camera(), &seen, None);
            let Ok(found) = outcome.result else {
                continue;
            };
            let error = pose_error(scene.truth_camera_from_tanker(), &found.camera_from_tanker);
            let squared = found.covariance.mahalanobis_squared(&error);
            let squared = squared.expect("positive definite");
            accepted += 1;
            nees += squared;
            wrong += usize::from(squared > SAME_POSE);
        }
        let mean = nees / f64::from(accepted);
        println!(
            "two points of {precise_px} px among {weak_px} px, one of them wrong: {accepted} of {FRAMES} accepted, mean NEES {mean:.1}, {wrong} beyond {SAME_POSE}"
        );
        assert!(accepted > 2700, "silence would prove nothing");
        // Among equals an error so small passes often enough, with a mean of 18; as claimed it would be 500.
        assert!(mean < 60.0);
    }
}

#[test]
fn a_wrong_point_among_many_is_found_wherever_it_stands_in_the_message() {
    let estimator = Estimator::new(EstimatorSettings {
        max_outliers: 1,
        ..Default::default()
    });
    let mut random = ChaCha8Rng::seed_from_u64(81);
    let mut found = 0;
    for _ in 0..200 {
        let markers = (1..=20).map(|id| Marker {
            id,
            marker_in_tanker: nalgebra::Point3::new(
                random.random_range(0.0..8.0),
                random.random_range(-7.0..7.0),
                random.random_range(0.0..3.2),
            ),
        });
        let markers = markers.collect();
        let truth = *random_refuelling_scene(&mut random, 12.0, 40.0).truth_camera_from_tanker();
        let scene = Scene::with_markers(paper_camera(), markers, truth);
        let mut seen = scene.noisy_observations(SIGMA_PX, &mut random);
        let wrong = random.random_range(0..seen.len());
        // So far off that the fit of all often ends behind the camera.
        seen[wrong].pixel.u += 500.0;
        let solution = estimator.estimate(scene.camera(), &seen, None);
        found += usize::from(
            solution.is_ok_and(|s| s.is_trusted() && s.excluded.contains(seen[wrong].id)),
        );
    }
    println!("one of 20 points off by 500 px: found in {found} of 200 frames");
    // The rest is refused.
    assert!(found >= 195, "{found}");
}

/// A beacon off by little: what the node's defaults make of it.
#[test]
fn no_healthy_point_is_left_out_in_place_of_the_wrong_one() {
    let estimator = Estimator::new(EstimatorSettings::default());
    // Least share of right ones, %, by count and offset: measured, less three standard errors.
    let cases = [
        (
            6,
            [
                (3.0, 62.8),
                (5.0, 52.2),
                (8.0, 68.4),
                (15.0, 93.9),
                (50.0, 99.7),
            ],
        ),
        (
            8,
            [
                (3.0, 75.0),
                (5.0, 87.1),
                (8.0, 97.7),
                (15.0, 99.7),
                (50.0, 99.7),
            ],
        ),
        (
            12,
            [
                (3.0, 92.7),
                (5.0, 98.2),
                (8.0, 99.8),
                (15.0, 99.8),
                (50.0, 99.8),
            ],
        ),
    ];
    for (count, offsets) in cases {
        for (offset_px, least_right) in offsets {
            let mut random = ChaCha8Rng::seed_from_u64(110);
            let mut healthy_left_out = 0;
            let mut tally = Tally::default();
            for _ in 0..FRAMES {
                let scene = scene(count, &mut random);
                let mut seen = scene.noisy_observations(SIGMA_PX, &mut random);
                let wrong = random.random_range(0..count);
                let angle: f64 = random.random_range(0.0..std::f64::consts::TAU);
                seen[wrong].pixel.u += offset_px * angle.cos();
                seen[wrong].pixel.v += offset_px * angle.sin();
                let wrong_id = seen[wrong].id;
                if let Ok(found) = solve(&estimator, scene.camera(), &seen, None).result {
                    healthy_left_out += usize::from(found.excluded.ids().any(|id| id != wrong_id));
                }
                tally.count(&scene, &seen, &[wrong_id], &estimator);
            }
            let right = report(&format!("{count} points, one off {offset_px} px"), &tally);
            println!("    a healthy point left out in {healthy_left_out} of {FRAMES}");
            assert!(right >= least_right, "{right}");
            assert!(healthy_left_out <= FRAMES / 1000, "{healthy_left_out}");
        }
    }
}

/// Two reflections of the same shift, as of the sun in two beacons: they agree with each other.
#[test]
fn two_reflections_of_the_same_shift_are_refused_from_eight_points_on() {
    let estimator = Estimator::new(EstimatorSettings::default());
    for count in [6, 8, 12] {
        let mut random = ChaCha8Rng::seed_from_u64(120);
        let mut tally = Tally::default();
        for _ in 0..FRAMES {
            let scene = scene(count, &mut random);
            let mut seen = scene.noisy_observations(SIGMA_PX, &mut random);
            let mut order: Vec<usize> = (0..count).collect();
            order.shuffle(&mut random);
            let distance_px = random.random_range(8.0..30.0);
            let angle: f64 = random.random_range(0.0..std::f64::consts::TAU);
            for &index in &order[..2] {
                seen[index].pixel.u += distance_px * angle.cos();
                seen[index].pixel.v += distance_px * angle.sin();
            }
            let wrong_ids = [seen[order[0]].id, seen[order[1]].id];
            tally.count(&scene, &seen, &wrong_ids, &estimator);
        }
        report(&format!("{count} points, two reflections"), &tally);
        // Of six points four remain without the two, and many attitudes fit four: 3.8 %.
        let most_wrong = if count == 6 { FRAMES / 20 } else { 0 };
        assert!(tally.wrong_but_trusted <= most_wrong);
    }
}
