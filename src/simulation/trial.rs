//! One noisy image of a scene, solved by the paper's methods and by ours: one trial of a Monte Carlo experiment.

use nalgebra::{Isometry3, Point3, Rotation3, Vector6};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Scene, paper_error};
use crate::camera::{Camera, Ray};
use crate::estimation::{
    EstimateError, Estimator, EstimatorSettings, Iterated, Observation, fixed_point,
    iterate_accelerated, linear_rotation,
};
use crate::geometry::{chord, optical_from_body};

/// rad; an iteration has converged when a step is smaller than this.
const SETTLED: f64 = 1e-10;
/// Steps after which an iteration counts as converged in any case.
const MAX_ITERATIONS: u32 = 20_000;
/// rad; end points closer than this are the same minimum.
const SAME_MINIMUM: f64 = 1e-4;

/// A method that the paper's experiments compare.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Method {
    /// `In_M1` alone: rotation from the linear camera matrix, translation by Eq. (13).
    LinearAlone,
    /// `In_M1` + OI.
    LinearIterated,
    /// `In_M2` + OI.
    NominalIterated,
    /// Ours: maximum likelihood, from the nominal attitude.
    MaximumLikelihood,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 4] = [
        Self::LinearAlone,
        Self::LinearIterated,
        Self::NominalIterated,
        Self::MaximumLikelihood,
    ];

    /// Returns whether it ends with orthogonal iteration.
    #[must_use]
    pub fn iterates(self) -> bool {
        matches!(self, Self::LinearIterated | Self::NominalIterated)
    }

    /// Returns its name, the paper's if it has one.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::LinearAlone => "In_M1",
            Self::LinearIterated => "In_M1+OI",
            Self::NominalIterated => "In_M2+OI",
            Self::MaximumLikelihood => "ML",
        }
    }
}

/// When the orthogonal iteration ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// When it has converged, as far as the statistics can show.
    Converged,
    /// After the first step smaller than this, rad.
    SmallStep(f64),
    /// After the step that brings the attitude within this distance of the converged one, rad.
    NearTheEnd(f64),
    /// After this many steps.
    Steps(u32),
}

/// Error of one method on one image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrialError {
    /// Found minus true, paper's coordinates, degrees and metres.
    pub coordinates: Vector6<f64>,
    /// Angle between found and true attitude, degrees.
    pub rotation_deg: f64,
    /// Distance between found and true position, m.
    pub position_m: f64,
    /// Steps of the orthogonal iteration; 0 for methods without one.
    pub iterations: u32,
    /// Whether the iteration ended in another minimum than the same iteration started at the truth; `None` for a method
    /// without iteration, and for one that is stopped early.
    pub other_minimum: Option<bool>,
}

/// The methods, prepared.
#[derive(Debug, Clone)]
pub struct Solver {
    maximum_likelihood: Estimator,
}

/// Returns the generator of one trial. It has its own stream, so the order of the trials does not matter.
///
/// # Inputs
/// * `experiment`, `setting`: below 2¹⁶ each; they and the trial are the stream, `seed` is the key.
#[must_use]
pub fn trial_generator(seed: u64, experiment: u16, setting: u16, trial: u32) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random
        .set_stream((u64::from(experiment) << 48) | (u64::from(setting) << 32) | u64::from(trial));
    random
}

impl Default for Solver {
    /// Aligned airframes are the nominal attitude. As in the paper, three points are sufficient, no point is excluded,
    /// and no pose is refused because of ambiguity.
    fn default() -> Self {
        Self {
            maximum_likelihood: Estimator::new(EstimatorSettings {
                min_points: 3,
                max_outliers: 0,
                max_ambiguity: 1.0,
                ..EstimatorSettings::default()
            }),
        }
    }
}

impl Solver {
    /// Returns the pose and the steps of the orthogonal iteration.
    ///
    /// # Errors
    /// Any [`EstimateError`]. The paper's methods do not check that the tanker is in front of the camera.
    pub fn solve(
        &self,
        method: Method,
        camera: &Camera,
        observations: &[Observation],
        stop: Stop,
    ) -> Result<(Isometry3<f64>, u32), EstimateError> {
        let iterated = match method {
            Method::MaximumLikelihood => {
                let solution = self
                    .maximum_likelihood
                    .estimate(camera, observations, None)?;
                return Ok((solution.camera_from_tanker, 0));
            }
            Method::NominalIterated => {
                Frame::new(camera, observations)?.iterate_from(&optical_from_body(), stop)?
            }
            Method::LinearAlone | Method::LinearIterated => {
                let frame = Frame::new(camera, observations)?;
                let seed = linear_rotation(&frame.rays, &frame.markers, &Point3::origin())?;
                let stop = match method {
                    Method::LinearAlone => Stop::Steps(0), // only Eq. (13)
                    _ => stop,
                };
                frame.iterate_from(&seed, stop)?
            }
        };
        Ok((iterated.camera_from_tanker, iterated.iterations))
    }

    /// Returns the error of each method on the same noisy image; `None` if a method finds no pose.
    pub fn trial(
        &self,
        scene: &Scene,
        sigma_px: f64,
        stop: Stop,
        methods: &[Method],
        random: &mut impl Rng,
    ) -> Vec<Option<TrialError>> {
        let observations = scene.noisy_observations(sigma_px, random);
        let settles = stop == Stop::Converged && methods.iter().any(|m| m.iterates());
        let from_truth = settles
            .then(|| {
                Frame::new(scene.camera(), &observations)?
                    .iterate_from(&scene.truth_rotation(), stop)
            })
            .and_then(Result::ok);
        methods
            .iter()
            .map(|&method| {
                let (found, iterations) = self
                    .solve(method, scene.camera(), &observations, stop)
                    .ok()?;
                let truth = scene.truth_camera_from_tanker();
                let is_elsewhere = |end: Iterated| {
                    end.camera_from_tanker.rotation.angle_to(&found.rotation) > SAME_MINIMUM
                };
                let end = from_truth.filter(|_| method.iterates());
                Some(TrialError {
                    coordinates: paper_error(truth, &found),
                    rotation_deg: truth.rotation.angle_to(&found.rotation).to_degrees(),
                    position_m: (truth.translation.vector - found.translation.vector).norm(),
                    iterations,
                    other_minimum: end.map(is_elsewhere),
                })
            })
            .collect()
    }
}

/// An image in the form that the orthogonal iteration takes.
struct Frame {
    rays: Vec<Ray>,
    markers: Vec<Point3<f64>>,
}

impl Frame {
    fn new(camera: &Camera, observations: &[Observation]) -> Result<Self, EstimateError> {
        let rays = observations
            .iter()
            .map(|seen| {
                camera
                    .ray_from_pixel(seen.pixel)
                    .map_err(|cause| EstimateError::NoRay { id: seen.id, cause })
            })
            .collect::<Result<_, _>>()?;
        let markers = observations.iter().map(|o| o.marker_in_tanker).collect();
        Ok(Self { rays, markers })
    }

    fn iterate_from(&self, seed: &Rotation3<f64>, stop: Stop) -> Result<Iterated, EstimateError> {
        match stop {
            Stop::Converged => self.iterate(seed, SETTLED, MAX_ITERATIONS),
            Stop::SmallStep(tolerance_rad) => self.iterate(seed, tolerance_rad, MAX_ITERATIONS),
            Stop::Steps(steps) => self.iterate(seed, 0.0, steps),
            Stop::NearTheEnd(distance_rad) => self.iterate_until_near(seed, distance_rad),
        }
    }

    /// Bisects the number of steps after which the attitude is near the end, since each step brings it nearer.
    fn iterate_until_near(
        &self,
        seed: &Rotation3<f64>,
        distance_rad: f64,
    ) -> Result<Iterated, EstimateError> {
        // A step is a small share of the remaining distance, and smaller for a slower iteration.
        let settled = self.iterate(seed, distance_rad * 1e-2, MAX_ITERATIONS)?;
        let end = fixed_point(&self.rays, &self.markers, &rotation_of(&settled))?;
        let is_near =
            |iterated: &Iterated| chord(&rotation_of(iterated), &rotation_of(&end)) < distance_rad;
        let mut far = self.iterate(seed, 0.0, 0)?;
        if is_near(&far) || !is_near(&settled) {
            // If even a last step of a hundredth of the distance does not lead near, use too many steps rather than too
            // few.
            return Ok(if is_near(&far) { far } else { settled });
        }
        let mut near = settled;
        while near.iterations - far.iterations > 1 {
            let steps = (near.iterations - far.iterations) / 2;
            let mut middle = self.iterate(&rotation_of(&far), 0.0, steps)?;
            middle.iterations = far.iterations + steps;
            if is_near(&middle) {
                near = middle;
            } else {
                far = middle;
            }
        }
        Ok(near)
    }

    fn iterate(
        &self,
        seed: &Rotation3<f64>,
        tolerance_rad: f64,
        max_iterations: u32,
    ) -> Result<Iterated, EstimateError> {
        iterate_accelerated(
            &self.rays,
            &self.markers,
            seed,
            tolerance_rad,
            max_iterations,
        )
    }
}

fn rotation_of(iterated: &Iterated) -> Rotation3<f64> {
    iterated.camera_from_tanker.rotation.to_rotation_matrix()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::paper_scene;

    #[test]
    fn with_almost_no_noise_every_method_finds_the_truth() {
        let mut random = trial_generator(1, 0, 0, 0);
        let errors = Solver::default().trial(
            &paper_scene(),
            1e-6,
            Stop::Converged,
            &Method::ALL,
            &mut random,
        );
        for (method, error) in Method::ALL.iter().zip(errors) {
            let error = error.expect("a pose");
            assert!(
                error.rotation_deg < 1e-3 && error.position_m < 1e-3,
                "{method:?}: {error:?}"
            );
        }
    }

    #[test]
    fn trials_have_streams_of_their_own() {
        use rand::RngExt;
        let first = |e, s, t| trial_generator(1, e, s, t).random::<u64>();
        let firsts = [
            first(0, 0, 0),
            first(1, 0, 0),
            first(0, 1, 0),
            first(0, 0, 1),
        ];
        for (i, a) in firsts.iter().enumerate() {
            assert!(firsts[i + 1..].iter().all(|b| a != b));
        }
        assert_eq!(first(2, 3, 4), first(2, 3, 4));
    }
}
