//! The solver does not depend on how a scene is described: the tanker's axes, the order of points, the unit of length.
//!
//! Random scenes of proptest with a fixed seed, each solved twice.

mod support;

use nalgebra::{
    Isometry3, Matrix6, Point3, Rotation3, Translation3, UnitQuaternion, Vector3, Vector6,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rand::SeedableRng;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use support::{random_attitude_scene, random_refuelling_scene, settings};
use tanker_pose::camera::Camera;
use tanker_pose::estimation::{
    EstimateError, Estimator, EstimatorSettings, Initialisation, Observation, Refinement, Solution,
};
use tanker_pose::geometry::{PoseCovariance, pose_error};

/// Largest difference of the two poses, in standard deviations: what the refinement's stopping rule promises.
const SAME_SIGMAS: f64 = 1e-3;
/// Largest relative difference of chi-squared and of each element of the covariance, by its two sigmas: a pose that moves
/// by [`SAME_SIGMAS`] sees markers elsewhere, and where few of them fix it, sigmas change by as much as it moves in sigmas.
const SAME_SHARE: f64 = 2.0 * SAME_SIGMAS;
/// px.
const NOISE_PX: f64 = 0.5;

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 400,
        rng_seed: RngSeed::Fixed(20_260_801),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// A scene, and a fair start for it.
struct Drawn {
    camera: Camera,
    seen: Vec<Observation>,
    settings: EstimatorSettings,
}

/// Draws a scene of noisy detections: on the route, or at any attitude with a search for the start.
fn drawn(seed: u64, on_route: bool, refinement: Refinement) -> Drawn {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (scene, initialisation) = if on_route {
        let scene = random_refuelling_scene(&mut random, 10.0, 60.0);
        (scene, Initialisation::Nominal)
    } else {
        let scene = random_attitude_scene(&mut random, 8);
        (scene, Initialisation::Global)
    };
    Drawn {
        camera: scene.camera().clone(),
        seen: scene.noisy_observations(NOISE_PX, &mut random),
        settings: settings(initialisation, refinement),
    }
}

impl Drawn {
    fn solve(
        &self,
        settings: &EstimatorSettings,
        seen: &[Observation],
    ) -> Result<Solution, EstimateError> {
        Estimator::new(settings.clone()).estimate(&self.camera, seen, None)
    }

    fn as_drawn(&self) -> Result<Solution, EstimateError> {
        self.solve(&self.settings, &self.seen)
    }

    fn moved(&self, place: impl Fn(&Point3<f64>) -> Point3<f64>) -> Vec<Observation> {
        let moved = |seen: &Observation| Observation {
            marker_in_tanker: place(&seen.marker_in_tanker),
            ..*seen
        };
        self.seen.iter().map(moved).collect()
    }
}

/// Fails unless both are refused for the same reason, or `found` is `expected` within rounding; `back` turns what was
/// found into the description of what was expected: its pose, and its covariance.
fn assert_same(
    expected: &Result<Solution, EstimateError>,
    found: &Result<Solution, EstimateError>,
    back: impl Fn(&Solution) -> (Isometry3<f64>, Matrix6<f64>),
) -> Result<(), TestCaseError> {
    let (expected, found) = match (expected, found) {
        (Ok(expected), Ok(found)) => (expected, found),
        (Err(expected), Err(found)) => {
            let kind = std::mem::discriminant(expected);
            prop_assert_eq!(kind, std::mem::discriminant(found));
            return Ok(());
        }
        (expected, found) => {
            let is_solved = [expected.is_ok(), found.is_ok()];
            return Err(TestCaseError::fail(format!("solved {is_solved:?}")));
        }
    };
    let (pose, covariance) = back(found);
    let error = pose_error(&expected.camera_from_tanker, &pose);
    let squared = expected.covariance.mahalanobis_squared(&error);
    prop_assert!(
        squared.is_some_and(|squared| squared < SAME_SIGMAS * SAME_SIGMAS),
        "{squared:?} for {error}"
    );
    let sigmas = Vector6::from_fn(|i, _| expected.covariance.0[(i, i)].sqrt());
    let difference =
        (covariance - expected.covariance.0).component_div(&(sigmas * sigmas.transpose()));
    prop_assert!(difference.amax() < SAME_SHARE, "{difference}");
    let chi_squared = (found.chi_squared - expected.chi_squared).abs();
    prop_assert!(
        chi_squared <= SAME_SHARE * (1.0 + expected.chi_squared),
        "{chi_squared}"
    );
    prop_assert_eq!(found.degrees_of_freedom, expected.degrees_of_freedom);
    Ok(())
}

fn refinements() -> impl Strategy<Value = Refinement> {
    prop_oneof![Just(Refinement::MaximumLikelihood), Just(Refinement::None)]
}

/// A rigid motion of up to 20 m with any attitude.
fn motions() -> impl Strategy<Value = Isometry3<f64>> {
    let shift = prop::array::uniform3(-20.0_f64..20.0);
    let turn = prop::array::uniform3(-3.0_f64..3.0);
    (shift, turn).prop_map(|(shift, turn)| {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
        Isometry3::from_parts(Translation3::from(Vector3::from(shift)), turn)
    })
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn other_axes_on_the_tanker_give_the_same_place_of_the_tanker(
        seed in any::<u64>(), on_route in any::<bool>(), refinement in refinements(), other_from_tanker in motions(),
    ) {
        let scene = drawn(seed, on_route, refinement);
        let turned = Rotation3::from(other_from_tanker.rotation);
        let settings = EstimatorSettings {
            nominal_camera_from_tanker: scene.settings.nominal_camera_from_tanker * turned.inverse(),
            ..scene.settings.clone()
        };
        let found = scene.solve(&settings, &scene.moved(|marker| other_from_tanker * marker));
        assert_same(&scene.as_drawn(), &found, |found| {
            let pose = found.camera_from_tanker * other_from_tanker;
            // t = t' + R' s: an error of the attitude shifts the tanker's origin by δθ × R' s.
            let lever = found.camera_from_tanker.rotation * other_from_tanker.translation.vector;
            let mut by_error = Matrix6::identity();
            by_error.fixed_view_mut::<3, 3>(0, 3).copy_from(&-lever.cross_matrix());
            (pose, by_error * found.covariance.0 * by_error.transpose())
        })?;
    }

    #[test]
    fn points_in_another_order_give_the_same_pose(
        seed in any::<u64>(), on_route in any::<bool>(), refinement in refinements(),
    ) {
        let scene = drawn(seed, on_route, refinement);
        let mut seen = scene.seen.clone();
        seen.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
        let found = scene.solve(&scene.settings, &seen);
        assert_same(&scene.as_drawn(), &found, |found| (found.camera_from_tanker, found.covariance.0))?;
    }

    #[test]
    fn another_unit_of_length_gives_the_same_pose_in_that_unit(
        seed in any::<u64>(), on_route in any::<bool>(), refinement in refinements(),
        per_metre in prop_oneof![Just(1000.0), Just(3.280_839_895), Just(0.001)],
    ) {
        let scene = drawn(seed, on_route, refinement);
        let found = scene.solve(&scene.settings, &scene.moved(|marker| marker * per_metre));
        assert_same(&scene.as_drawn(), &found, |found| {
            let mut pose = found.camera_from_tanker;
            pose.translation.vector /= per_metre;
            let unit = Vector6::new(per_metre, per_metre, per_metre, 1.0, 1.0, 1.0);
            let covariance = PoseCovariance(found.covariance.0.component_div(&(unit * unit.transpose())));
            (pose, covariance.0)
        })?;
    }
}
