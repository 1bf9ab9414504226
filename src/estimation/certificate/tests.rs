use nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3, Vector4};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::is_best_in_front;
use crate::estimation::newton::{self, Minimum};
use crate::estimation::problem::{Problem, Room};
use crate::estimation::{Observation, Refinement};
use crate::simulation::{Scene, paper_camera, paper_scene, pose_in_camera};
use crate::target::MarkerMap;

/// rad; a minimum is met to rounding.
const FIXED_POINT: f64 = 1e-7;
/// Share of the cost at the minimum; the certificate is asked for no more.
const TOLERANCE: f64 = 1e-6;

pub(super) fn random_rotation(random: &mut ChaCha8Rng) -> Rotation3<f64> {
    let q = Vector4::from_fn(|_, _| StandardNormal.sample(random));
    UnitQuaternion::from_quaternion(Quaternion::from(q)).to_rotation_matrix()
}

pub(super) fn problem<'a>(
    scene: &'a Scene,
    refinement: Refinement,
    seen: &'a [Observation],
    room: &'a mut Room,
) -> Problem<'a> {
    Problem::new(scene.camera(), refinement, seen, room).expect("points that determine a pose")
}

pub(super) fn minimum(problem: &Problem, seed: &Rotation3<f64>) -> Minimum {
    newton::minimise(problem.cost, seed, FIXED_POINT)
}

pub(super) fn depth(problem: &Problem, minimum: &Minimum) -> f64 {
    problem.cost.centre_in_camera(&minimum.rotation).z
}

#[test]
fn right_minimum_of_the_papers_scene_is_certified_and_what_is_no_minimum_is_not() {
    let scene = paper_scene();
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let seen = scene.noisy_observations(0.5, &mut random);
    let mut room = Room::new();
    let problem = problem(&scene, Refinement::MaximumLikelihood, &seen, &mut room);
    let truth = scene.truth_camera_from_tanker().rotation;
    let best = minimum(&problem, &truth.to_rotation_matrix());
    let is_certified =
        |rotation: &Rotation3<f64>| is_best_in_front(problem.cost, rotation, TOLERANCE * best.cost);
    assert!(is_certified(&best.rotation));
    // A slope is left, for which the tolerance does not suffice.
    let beside = best.rotation * Rotation3::new(Vector3::new(1e-4, 0.0, 0.0));
    assert!(!is_certified(&beside));
    assert!(!is_best_in_front(problem.cost, &best.rotation, 0.0));
}

/// What the header says, held against descents from everywhere: whatever minimum is certified, none in front is lower.
#[test]
fn a_certified_minimum_is_the_least_that_200_descents_find_in_front() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let (mut certified, mut refused, mut lower_behind) = (0, 0, 0);
    for frame in 0..60 {
        let map = MarkerMap::shipped(if frame % 2 == 0 { "paper" } else { "fin6" });
        let mut markers = map.expect("shipped").markers().to_vec();
        // Four to six of them.
        for left in (5..=6_usize).take(frame / 2 % 3) {
            markers.swap_remove(random.random_range(0..11 - left));
        }
        let range_m: f64 = random.random_range(10.0..90.0);
        let mut turn = || random.random_range(-5.0..5.0);
        let (roll, pitch, yaw) = (turn(), turn(), turn());
        let pose = pose_in_camera(Vector3::new(range_m, 0.0, 0.3 * range_m), roll, pitch, yaw);
        let scene = Scene::with_markers(paper_camera(), markers, pose);
        let seen = scene.noisy_observations(random.random_range(0.1..4.0), &mut random);
        let mut room = Room::new();
        let problem = problem(&scene, Refinement::MaximumLikelihood, &seen, &mut room);
        let minima: Vec<Minimum> = (0..200)
            .map(|_| minimum(&problem, &random_rotation(&mut random)))
            .filter(|minimum| minimum.converged)
            .collect();
        let least_of = |in_front: bool| {
            let on_that_side = minima
                .iter()
                .filter(|m| (depth(&problem, m) > 0.0) == in_front);
            on_that_side.map(|m| m.cost).fold(f64::INFINITY, f64::min)
        };
        let (least, least_behind) = (least_of(true), least_of(false));
        for minimum in &minima {
            let tolerance = TOLERANCE * minimum.cost;
            let is_certified = is_best_in_front(problem.cost, &minimum.rotation, tolerance);
            if depth(&problem, minimum) <= 0.0 {
                assert!(!is_certified, "behind the camera");
            } else if minimum.cost > least + 2.0 * tolerance {
                assert!(
                    !is_certified,
                    "{} is no minimum next to {least}",
                    minimum.cost
                );
                refused += 1;
            } else if is_certified {
                certified += 1;
                lower_behind += usize::from(least_behind < minimum.cost);
            }
        }
    }
    assert!(
        certified > 1000 && refused > 1000 && lower_behind > 10,
        "{certified} certified, {refused} refused, {lower_behind} with a lower minimum behind"
    );
}

#[test]
fn numbers_that_mean_nothing_certify_nothing_and_end() {
    use super::{form::Form, search};
    let identity = Rotation3::<f64>::identity();
    for entry in [0.0, f64::NAN, f64::INFINITY, f64::MAX, f64::MIN_POSITIVE] {
        for depth in [0.0, f64::NAN, f64::INFINITY, 1.0, -1.0] {
            let mut omega = [[0.0; 9]; 9];
            for i in 0..9 {
                omega[i][i] = entry;
            }
            omega[0][8] = entry;
            omega[8][0] = entry;
            let form = Form::new(&omega, &[depth; 9], identity.matrix());
            assert!(!search::find(&form), "{entry} {depth}");
        }
    }
}
