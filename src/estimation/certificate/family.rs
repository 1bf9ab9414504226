//! All matrices `X` and `S` with which `zᵀ X z + depth · uᵀ S u` is the excess: one of them may be a proof.

use super::dense::{Square, is_positive};
use super::form::{Form, Gram, OF_VECTOR, PRODUCTS, ROUNDING};

/// Number of free parameters: 14 of `X`, 6 of `S`.
pub(super) const FREE: usize = IDENTITIES.len() + OF_VECTOR.len();
/// One member of the family.
pub(super) type Member = [f64; FREE];

/// Index of `w`, the coefficients of the depth, after those of the products.
pub(super) const OF_DEPTH: usize = PRODUCTS;

/// The matrix that a free parameter multiplies: `sign · ⟨a, b⟩ − ⟨c, d⟩`, `⟨a, b⟩ = (e_a e_bᵀ + e_b e_aᵀ) / 2`, and `w`
/// in place of the unit vector for [`OF_DEPTH`].
#[derive(Clone, Copy)]
pub(super) struct Direction {
    pub(super) sign: f64,
    pub(super) first: [usize; 2],
    pub(super) second: [usize; 2],
}

/// Pairs of entries of `z` with the same product, such as `q₀q₁ · q₁q₂ = q₀q₂ · q₁²`.
const IDENTITIES: [[[usize; 2]; 2]; 14] = [
    // q₀ qᵢ² qⱼ
    [[0, 8], [1, 3]],
    [[1, 8], [0, 4]],
    [[0, 7], [2, 3]],
    [[2, 7], [0, 5]],
    [[1, 6], [2, 4]],
    [[2, 6], [1, 5]],
    // q₀ q₁ q₂ q₃
    [[0, 6], [1, 7]],
    [[1, 7], [2, 8]],
    // qᵢ² qⱼ²
    [[3, 4], [8, 8]],
    [[3, 5], [7, 7]],
    [[4, 5], [6, 6]],
    // qᵢ² qⱼ qₖ
    [[3, 6], [7, 8]],
    [[4, 7], [6, 8]],
    [[5, 8], [6, 7]],
];

/// Fourteen that do not change the polynomial, then `−depth · qᵢ qⱼ`, the depth divided by that at the minimum.
pub(super) const DIRECTIONS: [Direction; FREE] = {
    let none = Direction {
        sign: 1.0,
        first: [0; 2],
        second: [0; 2],
    };
    let mut directions = [none; FREE];
    let mut k = 0;
    while k < IDENTITIES.len() {
        let [first, second] = IDENTITIES[k];
        directions[k] = Direction {
            sign: 1.0,
            first,
            second,
        };
        k += 1;
    }
    while k < FREE {
        let (i, j, place) = OF_VECTOR[k - IDENTITIES.len()];
        directions[k] = Direction {
            sign: -1.0,
            first: [i, j],
            second: [OF_DEPTH, place],
        };
        k += 1;
    }
    directions
};

/// Index of the first parameter of `S`.
pub(super) const MULTIPLIER: usize = IDENTITIES.len();

/// Returns the matrix `S` of a member; a parameter off the diagonal is the sum of both entries.
#[inline(always)]
pub(super) fn multiplier(member: &Member) -> Square<3> {
    let mut s = [[0.0; 3]; 3];
    for ((i, j, _), value) in OF_VECTOR.into_iter().zip(&member[MULTIPLIER..]) {
        s[i][j] += 0.5 * value;
        s[j][i] += 0.5 * value;
    }
    s
}

/// Returns the matrix `X` of a member.
#[inline(always)]
pub(super) fn gram(form: &Form, member: &Member) -> Gram {
    let mut x = form.excess;
    for (direction, value) in DIRECTIONS.iter().zip(member) {
        let half = 0.5 * value;
        let [a, b] = direction.first;
        x[a][b] += direction.sign * half;
        x[b][a] += direction.sign * half;
        let [c, d] = direction.second;
        if c == OF_DEPTH {
            for k in 0..PRODUCTS {
                x[k][d] -= half * form.depth_shares[k];
                x[d][k] -= half * form.depth_shares[k];
            }
        } else {
            x[c][d] -= half;
            x[d][c] -= half;
        }
    }
    x
}

/// Returns whether a member proves that no attitude with the markers' mean in front has a cost lower than the minimum's
/// by more than [`Form::rest`]: whether `X` and `S` are positive definite despite any rounding.
///
/// Rounding of the sums in `X` changes each entry by at most [`ROUNDING`] times the magnitudes that were summed; that of
/// the factorisation is equivalent to such a change too. The bound for all entries together is subtracted from the
/// diagonal before factorisation.
#[inline(always)]
pub(super) fn is_proof(form: &Form, member: &Member) -> bool {
    let s = multiplier(member);
    let of_s = s.iter().flatten().map(|entry| entry.abs()).sum::<f64>();
    if !is_positive(&lowered(s, ROUNDING * of_s)) {
        return false;
    }
    let of_shares = 1.0 + form.depth_shares.iter().map(|w| w.abs()).sum::<f64>();
    let of_identities = member[..MULTIPLIER].iter().map(|y| y.abs()).sum::<f64>();
    let magnitude = form.magnitude + 2.0 * of_identities + 2.0 * of_s * of_shares;
    is_positive(&lowered(gram(form, member), ROUNDING * magnitude))
}

/// Returns a matrix with a number subtracted from its diagonal.
#[inline(always)]
fn lowered<const N: usize>(mut matrix: Square<N>, by: f64) -> Square<N> {
    for i in 0..N {
        matrix[i][i] -= by;
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector4};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Relative to the sum of magnitudes.
    const SAME: f64 = 1e-12;

    fn products(q: &Vector4<f64>) -> [f64; PRODUCTS] {
        let [w, x, y, z] = [q[0], q[1], q[2], q[3]];
        [
            w * x,
            w * y,
            w * z,
            x * x,
            y * y,
            z * z,
            y * z,
            x * z,
            x * y,
        ]
    }

    fn value(x: &Gram, z: &[f64; PRODUCTS]) -> f64 {
        (0..PRODUCTS)
            .flat_map(|i| (0..PRODUCTS).map(move |j| (i, j)))
            .map(|(i, j)| z[i] * x[i][j] * z[j])
            .sum()
    }

    fn vec(m: &Matrix3<f64>) -> [f64; 9] {
        std::array::from_fn(|i| m[i])
    }

    fn dot(a: &[f64; 9], b: &[f64; 9]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    /// Every member is the same polynomial: excess cost minus depth times the multiplier, at turns by any quaternion.
    #[test]
    fn every_member_is_the_excess_less_the_multiplied_depth() {
        let mut random = ChaCha8Rng::seed_from_u64(6);
        for _ in 0..200 {
            let mut number = || random.random_range(-1.0..1.0_f64);
            let half: Square<9> = std::array::from_fn(|_| std::array::from_fn(|_| number()));
            let omega: Square<9> =
                std::array::from_fn(|i| std::array::from_fn(|j| dot(&half[i], &half[j])));
            let t: [f64; 9] = std::array::from_fn(|_| number());
            let mut quaternion = || Vector4::from_fn(|_, _| number());
            let rotation = UnitQuaternion::from_quaternion(Quaternion::from(quaternion()));
            let rotation = *rotation.to_rotation_matrix().matrix();
            let q = quaternion();
            let member: Member = std::array::from_fn(|_| number());
            let form = Form::new(&omega, &t, &rotation);

            // R(q) of a quaternion that has not length 1 is |q|² times a rotation.
            let length = q.norm_squared();
            let unit = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
            let there = rotation * unit.to_rotation_matrix().matrix() * length;
            let cost = |r: &Matrix3<f64>| {
                let r = vec(r);
                (0..9).map(|i| r[i] * dot(&omega[i], &r)).sum::<f64>()
            };
            let excess = cost(&there) - cost(&rotation) * length * length;
            let s = multiplier(&member);
            let weight: f64 = (0..3)
                .flat_map(|i| (0..3).map(move |j| (i, j)))
                .map(|(i, j)| q[i + 1] * s[i][j] * q[j + 1])
                .sum();
            let depth = dot(&t, &vec(&there)) / form.depth;
            assert!((dot(&t, &vec(&rotation)) - form.depth).abs() < SAME * 9.0);

            // Not a minimum: the slope that `rest` bounds is there.
            let full = Form::new(&omega, &t, &rotation).rest;
            let z = products(&q);
            let polynomial = value(&gram(&form, &member), &z);
            let difference = (excess - depth * weight - polynomial).abs();
            let scale = form.magnitude * (1.0 + depth.abs() + q.norm().powi(4));
            let slope = full * q[0].abs().powi(3) * q.amax();
            assert!(difference < slope + SAME * scale, "{difference} {slope}");
        }
    }

    #[test]
    fn what_only_rounding_could_make_positive_is_no_proof() {
        let mut excess = [[0.0; PRODUCTS]; PRODUCTS];
        for i in 0..PRODUCTS {
            excess[i][i] = 1.0;
        }
        let mut form = Form {
            excess,
            depth: 10.0,
            depth_shares: [0.0; PRODUCTS],
            rest: 0.0,
            magnitude: 9.0,
        };
        let mut member = [0.0; FREE];
        assert!(!is_proof(&form, &member), "no multiplier");
        for k in 0..3 {
            member[MULTIPLIER + k] = 0.1;
        }
        assert!(is_proof(&form, &member));
        form.excess[8][8] = 5e-14;
        assert!(!is_proof(&form, &member), "positive, but not surely");
        form.excess[8][8] = -1e-300;
        assert!(!is_proof(&form, &member));
        form.excess[8][8] = 1.0;
        member[MULTIPLIER] = 1.01;
        assert!(!is_proof(&form, &member), "more depth than there is excess");
        member[MULTIPLIER] = -0.1;
        assert!(!is_proof(&form, &member), "a multiplier must be positive");
    }
}
