//! Initialisation without a prior: descends from the rotations of the icosahedron and keeps every minimum in front of
//! the camera.

use std::sync::LazyLock;

use nalgebra::{Quaternion, Rotation3, UnitQuaternion};

use crate::estimation::ambiguity::SAME_MINIMUM;
use crate::estimation::collinearity::{CollinearityCost, PRODUCTS, combined, products};
use crate::estimation::lanes::four::{Arithmetic, Kernel, LANES, Lane, vectorised};
use crate::estimation::newton::{self, Minimum};
use crate::estimation::problem::Problem;

/// Rotations of the icosahedral group; no rotation is farther than 44.5° from the nearest of them.
const GROUP_SIZE: usize = 60;
/// Number of descents; the right basin was among the best eight in all of thousands of random frames.
const DESCENTS: usize = 8;
/// Largest number of different minima kept.
pub(crate) const MAX_MINIMA: usize = 4;

static ICOSAHEDRAL_GROUP: LazyLock<[Rotation3<f64>; GROUP_SIZE]> = LazyLock::new(icosahedral_group);
/// The group's rotations, four side by side.
static FOURS: LazyLock<[FourRotations; GROUP_SIZE / LANES]> = LazyLock::new(|| {
    std::array::from_fn(|four| {
        let rotations = |lane: usize| ICOSAHEDRAL_GROUP[LANES * four + lane];
        let of_lanes: [_; LANES] = std::array::from_fn(|lane| products(&rotations(lane)));
        FourRotations {
            products: std::array::from_fn(|i| of_lanes.map(|products| products[i])),
            entries: std::array::from_fn(|i| {
                std::array::from_fn(|lane| rotations(lane).matrix()[i])
            }),
        }
    })
});

/// Entries of four rotations side by side.
#[repr(align(32))]
struct FourRotations {
    products: [Lane; PRODUCTS],
    /// Column by column.
    entries: [Lane; 9],
}

/// Result of the search.
pub(crate) struct Minima {
    /// Minima with the markers' mean in front of the camera, best first.
    pub(crate) in_front: [Option<Minimum>; MAX_MINIMA],
    /// The best minimum behind the camera, for the error if there is none in front.
    pub(crate) behind: Option<Minimum>,
    /// Iterations of all descents that were not abandoned.
    pub(crate) iterations: u16,
}

/// Returns the minima of the cost that descents from the best of the sixty rotations reach.
///
/// A descent that will clearly end at a negligible minimum, see [`Problem::negligible_cost`], is abandoned.
pub(crate) fn search(problem: &Problem) -> Minima {
    search_below(problem, |best| problem.negligible_cost(best))
}

/// As [`search`]; `limit` returns, for the best minimum so far, the cost above which others are negligible.
fn search_below(problem: &Problem, limit: impl Fn(&Minimum) -> f64) -> Minima {
    let cost = problem.cost;
    let starts = vectorised(BestStarts { cost });
    let mut found = Minima {
        in_front: [None; MAX_MINIMA],
        behind: None,
        iterations: 0,
    };
    for (value, index) in starts {
        if value.is_infinite() {
            break;
        }
        let limit = found.in_front[0].map_or(f64::INFINITY, |best| limit(&best));
        let seed = &ICOSAHEDRAL_GROUP[index];
        let step_tolerance = problem.step_tolerance();
        let Some(minimum) = newton::minimise_below(cost, seed, step_tolerance, limit) else {
            continue;
        };
        found.iterations = found.iterations.saturating_add(minimum.iterations);
        if minimum.converged {
            found.keep(minimum, cost.centre_in_camera(&minimum.rotation).z > 0.0);
        }
    }
    found
}

/// The best starts of the group, with their costs; infinite in unused entries.
struct BestStarts<'a> {
    cost: &'a CollinearityCost,
}

impl Kernel for BestStarts<'_> {
    type Output = [(f64, usize); DESCENTS];

    #[inline(always)]
    fn run<A: Arithmetic>(self, arithmetic: A) -> Self::Output {
        // Insertion sort: no allocation, and fast enough for sixty entries.
        let mut starts = [(f64::INFINITY, 0_usize); DESCENTS];
        let coefficients = self.cost.coefficients();
        for (index, four) in FOURS.iter().enumerate() {
            let values = combined(arithmetic, &coefficients, &four.products);
            let depths = self.cost.depths(arithmetic, &four.entries);
            for lane in 0..LANES {
                // A start behind the camera rarely descends to a minimum in front.
                if depths[lane] > 0.0 {
                    let start = (values[lane], LANES * index + lane);
                    insert(&mut starts, start, |a, b| a.0 < b.0);
                }
            }
        }
        starts
    }
}

impl Minima {
    fn keep(&mut self, minimum: Minimum, is_in_front: bool) {
        let is_better = |new: &Option<Minimum>, old: &Option<Minimum>| match (new, old) {
            (Some(new), Some(old)) => new.cost < old.cost,
            (new, _) => new.is_some(),
        };
        let is_known = self.in_front.iter().flatten().any(|other| {
            (other.rotation.matrix() - minimum.rotation.matrix()).norm() < SAME_MINIMUM
        });
        if !is_in_front {
            if is_better(&Some(minimum), &self.behind) {
                self.behind = Some(minimum);
            }
        } else if !is_known {
            insert(&mut self.in_front, Some(minimum), is_better);
        }
    }
}

/// Inserts `item` into a sorted array and drops the last one.
fn insert<T: Copy, const N: usize>(sorted: &mut [T; N], item: T, before: impl Fn(&T, &T) -> bool) {
    if let Some(place) = sorted.iter().position(|other| before(&item, other)) {
        sorted[place..].rotate_right(1);
        sorted[place] = item;
    }
}

/// The 60 rotations of the icosahedron, as the unit icosians up to sign.
fn icosahedral_group() -> [Rotation3<f64>; GROUP_SIZE] {
    let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
    let mut quaternions: Vec<[f64; 4]> = Vec::with_capacity(2 * GROUP_SIZE);
    for axis in 0..4 {
        for sign in [-1.0, 1.0] {
            let mut q = [0.0; 4];
            q[axis] = sign;
            quaternions.push(q);
        }
    }
    let signs = |bits: usize, k: usize| if bits >> k & 1 == 0 { 0.5 } else { -0.5 };
    for bits in 0..16 {
        quaternions.push(std::array::from_fn(|k| signs(bits, k)));
    }
    let base = [golden, 1.0, 1.0 / golden, 0.0];
    for permutation in even_permutations() {
        for bits in 0..8 {
            let signed: [f64; 4] =
                std::array::from_fn(|k| if k < 3 { base[k] * signs(bits, k) } else { 0.0 });
            quaternions.push(std::array::from_fn(|k| signed[permutation[k]]));
        }
    }
    let mut group = [Rotation3::identity(); GROUP_SIZE];
    let mut filled = 0;
    for q in quaternions {
        let first = q.iter().copied().find(|value| *value != 0.0).unwrap_or(0.0);
        if first > 0.0 && filled < GROUP_SIZE {
            group[filled] =
                UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]))
                    .to_rotation_matrix();
            filled += 1;
        }
    }
    group
}

fn even_permutations() -> Vec<[usize; 4]> {
    let mut even = Vec::with_capacity(12);
    for code in 0..256_usize {
        let p = [code >> 6 & 3, code >> 4 & 3, code >> 2 & 3, code & 3];
        let inversions = (0..4)
            .flat_map(|i| (i + 1..4).map(move |j| (i, j)))
            .filter(|&(i, j)| p[i] > p[j])
            .count();
        let is_permutation = (0..4).all(|value| p.contains(&value));
        if is_permutation && inversions % 2 == 0 {
            even.push(p);
        }
    }
    even
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimation::Refinement;
    use crate::estimation::problem::Room;
    use crate::simulation::{Scene, paper_camera, pose_in_camera};
    use crate::target::MarkerMap;
    use nalgebra::{UnitQuaternion, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_sixty_rotations_form_a_group() {
        for a in ICOSAHEDRAL_GROUP.iter() {
            for b in ICOSAHEDRAL_GROUP.iter() {
                let product = a * b;
                let members = ICOSAHEDRAL_GROUP
                    .iter()
                    .filter(|c| (c.matrix() - product.matrix()).norm() < 1e-12)
                    .count();
                assert_eq!(
                    members, 1,
                    "each product is one member, and members are distinct"
                );
            }
        }
    }

    #[test]
    fn no_rotation_is_farther_than_the_covering_radius() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for _ in 0..2000 {
            let q = Quaternion::from(nalgebra::Vector4::from_fn(|_, _| {
                rng.random_range(-1.0..1.0_f64)
            }));
            let rotation = UnitQuaternion::from_quaternion(q).to_rotation_matrix();
            let nearest = ICOSAHEDRAL_GROUP
                .iter()
                .map(|member| member.angle_to(&rotation).to_degrees())
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 44.5, "nearest {nearest}°");
        }
    }

    #[test]
    fn no_minimum_that_counts_is_given_up() {
        const FRAMES: u32 = 20_000;
        let camera = paper_camera();
        let map = MarkerMap::shipped("fin6").expect("shipped");
        let mut random = ChaCha8Rng::seed_from_u64(12);
        let mut rivals = 0;
        for _ in 0..FRAMES {
            // Four of six, precise and near: many minima, and models that are off by more than the noise.
            let mut markers = map.markers().to_vec();
            markers.swap_remove(random.random_range(0..6));
            markers.swap_remove(random.random_range(0..5));
            let mut turn = || random.random_range(-5.0..5.0);
            let angles = [turn(), turn(), turn()];
            let range_m: f64 = random.random_range(9.0..60.0);
            let position = Vector3::new(range_m, 0.0, 0.3 * range_m);
            let pose = pose_in_camera(position, angles[0], angles[1], angles[2]);
            let scene = Scene::with_markers(camera.clone(), markers, pose);
            let sigma_px = 0.05 * 20.0_f64.powf(random.random_range(0.0..1.0));
            let seen = scene.noisy_observations(sigma_px, &mut random);
            let mut room = Room::new();
            let refinement = Refinement::MaximumLikelihood;
            let problem = Problem::new(&camera, refinement, &seen, &mut room).expect("four points");
            let all = search_below(&problem, |_| f64::INFINITY);
            let found = search(&problem);
            let Some(best) = all.in_front[0] else {
                continue;
            };
            let limit = problem.negligible_cost(&best);
            for minimum in all.in_front.iter().flatten().filter(|m| m.cost <= limit) {
                rivals += 1;
                let is_found = found.in_front.iter().flatten().any(|other| {
                    (other.rotation.matrix() - minimum.rotation.matrix()).norm() < SAME_MINIMUM
                });
                assert!(is_found, "{sigma_px} px, {range_m} m: {minimum:?}");
            }
        }
        assert!(
            rivals > FRAMES + 1000,
            "{rivals} minima: some frames have a rival"
        );
    }
}
