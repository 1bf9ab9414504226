//! Of thousands of minima, wrong and right, in front of the camera: none of the first is certified, nearly all of the
//! second are.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::tests::{depth, minimum, problem, random_rotation};
use crate::estimation::Refinement;
use crate::estimation::ambiguity::is_same;
use crate::estimation::newton::Minimum;
use crate::estimation::problem::Room;
use crate::geometry::optical_from_body;
use crate::simulation::{Scene, paper_camera};
use crate::target::{Marker, MarkerMap};

/// Descents of a frame that look for its minima, besides one from the truth.
const DESCENTS: usize = 24;
const FRAMES_OF_A_KIND: usize = 1200;

#[derive(Debug, Clone, Copy)]
enum Shape {
    /// A shipped map or some of its markers, seen as in refuelling.
    Map(&'static str),
    /// Random points in a cube, at any attitude.
    Cube,
    /// Random points in a plane, at any attitude.
    Plane,
}

#[derive(Debug, Default, Clone, Copy)]
struct Count {
    right: usize,
    certified: usize,
    wrong: usize,
    falsely: usize,
}

fn marker(id: usize, place: Vector3<f64>) -> Marker {
    Marker {
        id: u32::try_from(id).expect("few"),
        marker_in_tanker: Point3::from(place),
    }
}

/// Markers and their attitude; in front of the camera from twice their size on.
fn target(shape: Shape, count: usize, size_m: f64, random: &mut ChaCha8Rng) -> Vec<Marker> {
    let mut coordinate = || random.random_range(-size_m..size_m);
    match shape {
        Shape::Map(name) => {
            let map = MarkerMap::shipped(name).expect("shipped");
            let mut markers = map.markers().to_vec();
            while markers.len() > count {
                markers.swap_remove(random.random_range(0..markers.len()));
            }
            markers
        }
        Shape::Cube => (0..count)
            .map(|id| marker(id, Vector3::new(coordinate(), coordinate(), coordinate())))
            .collect(),
        Shape::Plane => (0..count)
            .map(|id| marker(id, Vector3::new(coordinate(), coordinate(), 0.0)))
            .collect(),
    }
}

/// A frame at 5 to 100 m (shipped maps: from 10 m on) with 0.1 to 5 px of noise, each evenly on a logarithmic scale.
fn frame(shape: Shape, count: usize, random: &mut ChaCha8Rng) -> (Scene, f64) {
    let nearest_m: f64 = if matches!(shape, Shape::Map(_)) {
        10.0
    } else {
        5.0
    };
    let share: f64 = random.random_range(0.0..1.0);
    let range_m = nearest_m * (100.0 / nearest_m).powf(share);
    let markers = target(shape, count, (0.4 * range_m).min(4.0), random);
    let rotation = if matches!(shape, Shape::Map(_)) {
        let mut angle = || random.random_range(-0.09..0.09);
        optical_from_body() * Rotation3::from_euler_angles(angle(), angle(), angle())
    } else {
        random_rotation(random)
    };
    let mut aside = || random.random_range(-0.2..0.2);
    let centre = Vector3::new(aside(), aside(), 1.0) * range_m;
    let pose = Isometry3::from_parts(
        Translation3::from(centre),
        UnitQuaternion::from_rotation_matrix(&rotation),
    );
    let sigma_px = 0.1 * 50.0_f64.powf(random.random_range(0.0..1.0));
    (Scene::with_markers(paper_camera(), markers, pose), sigma_px)
}

fn count_minima(shape: Shape, count: usize, refinement: Refinement, seed: u64) -> Count {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut found = Count::default();
    for _ in 0..FRAMES_OF_A_KIND {
        let (scene, sigma_px) = frame(shape, count, &mut random);
        let seen = scene.noisy_observations(sigma_px, &mut random);
        if seen.len() < count {
            continue; // a marker behind the camera has no pixel
        }
        let mut room = Room::new();
        let problem = problem(&scene, refinement, &seen, &mut room);
        let truth = scene.truth_camera_from_tanker().rotation;
        let mut minima: Vec<Minimum> = Vec::new();
        let mut keep = |from: &Rotation3<f64>| {
            let there = minimum(&problem, from);
            let is_known = minima
                .iter()
                .any(|other| is_same(&other.rotation, &there.rotation));
            if there.converged && depth(&problem, &there) > 0.0 && !is_known {
                minima.push(there);
            }
        };
        keep(&truth.to_rotation_matrix());
        for _ in 0..DESCENTS {
            keep(&random_rotation(&mut random));
        }
        minima.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        for (place, candidate) in minima.iter().enumerate() {
            let is_certified = problem.is_best_in_front(&candidate.rotation);
            let best = &minima[0];
            if place == 0 {
                found.right += 1;
                found.certified += usize::from(is_certified);
            } else if candidate.cost > best.cost + problem.unnoticed(depth(&problem, best)) {
                found.wrong += 1;
                found.falsely += usize::from(is_certified);
            }
        }
    }
    found
}

#[test]
fn no_wrong_minimum_is_certified_and_nearly_every_right_one_is() {
    let kinds: Vec<(Shape, usize)> = [Shape::Map("paper"), Shape::Map("fin6")]
        .into_iter()
        .flat_map(|map| [4, 5, 6].map(|count| (map, count)))
        .chain(
            [Shape::Cube, Shape::Plane]
                .into_iter()
                .flat_map(|shape| [4, 5, 6, 8, 12].map(|count| (shape, count))),
        )
        .collect();
    let of_paper = [(Shape::Map("paper"), 6), (Shape::Cube, 5)];
    let likelihood = kinds
        .iter()
        .map(|&kind| (kind, Refinement::MaximumLikelihood));
    let paper = of_paper.iter().map(|&kind| (kind, Refinement::None));
    let (mut all, mut of_five) = (Count::default(), Count::default());
    for (seed, ((shape, count), refinement)) in likelihood.chain(paper).enumerate() {
        let found = count_minima(shape, count, refinement, 100 + seed as u64);
        println!("{shape:?}, {count} points, {refinement:?}: {found:?}");
        let add = |sum: &mut Count| {
            sum.right += found.right;
            sum.certified += found.certified;
            sum.wrong += found.wrong;
            sum.falsely += found.falsely;
        };
        add(&mut all);
        if count >= 5 {
            add(&mut of_five);
        }
    }
    println!("all: {all:?}; five points or more: {of_five:?}");
    assert_eq!(all.falsely, 0);
    assert!(all.wrong >= 10_000, "{all:?}");
    assert!(of_five.right >= 14_000, "{of_five:?}");
    assert!(
        of_five.certified * 1000 >= of_five.right * 999,
        "{of_five:?}"
    );
}
