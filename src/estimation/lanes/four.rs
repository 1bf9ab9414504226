//! Arithmetic on four numbers at once, in the widest registers that the processor supports.
//!
//! [`vectorised`] checks the processor and runs a [`Kernel`] with AVX2 and fused multiply-add, or with plain arrays,
//! which compilers turn into SSE2 or Neon. The results differ by rounding: a fused product is rounded once less.

use std::ops::{Add, Div, Mul, Sub};

/// Numbers per register.
pub(crate) const LANES: usize = 4;
/// Four numbers in memory.
pub(crate) type Lane = [f64; LANES];

/// The element of sums over points: one number, or four.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    /// Returns `self + a b`.
    fn plus(self, a: Self, b: Self) -> Self;
    /// Returns `self − a b`.
    fn minus(self, a: Self, b: Self) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn plus(self, a: Self, b: Self) -> Self {
        self + a * b
    }

    #[inline(always)]
    fn minus(self, a: Self, b: Self) -> Self {
        self - a * b
    }
}

/// The operations on four numbers.
pub(crate) trait Arithmetic: Copy {
    type Register: Copy;
    fn load(self, lane: Lane) -> Self::Register;
    fn store(self, a: Self::Register) -> Lane;
    fn add(self, a: Self::Register, b: Self::Register) -> Self::Register;
    fn sub(self, a: Self::Register, b: Self::Register) -> Self::Register;
    fn mul(self, a: Self::Register, b: Self::Register) -> Self::Register;
    fn div(self, a: Self::Register, b: Self::Register) -> Self::Register;
    /// `a b + c`
    fn mul_add(self, a: Self::Register, b: Self::Register, c: Self::Register) -> Self::Register;
    /// `c − a b`
    fn negate_mul_add(
        self,
        a: Self::Register,
        b: Self::Register,
        c: Self::Register,
    ) -> Self::Register;
    /// The sum of each register, side by side.
    fn totals(self, fours: [Self::Register; 4]) -> Self::Register;
    /// The first numbers of all registers, then the second ones, and so on.
    fn transposed(self, rows: [Self::Register; 4]) -> [Self::Register; 4];
}

/// Four numbers with their arithmetic, which is a zero-sized type.
///
/// Aligned, as all lanes in memory should be: half of unaligned ones span two cache lines.
#[derive(Clone, Copy)]
#[repr(align(32))]
pub(crate) struct Four<A: Arithmetic> {
    arithmetic: A,
    register: A::Register,
}

impl<A: Arithmetic> Four<A> {
    #[inline(always)]
    pub(crate) fn new(arithmetic: A, lane: Lane) -> Self {
        Self {
            arithmetic,
            register: arithmetic.load(lane),
        }
    }

    #[inline(always)]
    pub(crate) fn splat(arithmetic: A, value: f64) -> Self {
        Self::new(arithmetic, [value; LANES])
    }

    /// Returns other numbers with the same arithmetic.
    #[inline(always)]
    pub(crate) fn another(self, lane: Lane) -> Self {
        Self::new(self.arithmetic, lane)
    }

    #[inline(always)]
    pub(crate) fn lane(self) -> Lane {
        self.arithmetic.store(self.register)
    }

    /// Returns the sum of each of four, side by side.
    #[inline(always)]
    pub(crate) fn totals(fours: [Self; 4]) -> Self {
        let [a, b, c, d] = fours;
        a.with(
            a.arithmetic
                .totals([a.register, b.register, c.register, d.register]),
        )
    }

    /// Returns the first numbers of all four, the second ones, the third and the fourth.
    #[inline(always)]
    pub(crate) fn transposed(rows: [Self; 4]) -> [Self; 4] {
        let [a, b, c, d] = rows;
        let [first, second, third, fourth] = a
            .arithmetic
            .transposed([a.register, b.register, c.register, d.register]);
        [a.with(first), a.with(second), a.with(third), a.with(fourth)]
    }

    /// Returns the sum of the four.
    #[inline(always)]
    pub(crate) fn total(self) -> f64 {
        let [a, b, c, d] = self.lane();
        (a + b) + (c + d)
    }

    #[inline(always)]
    fn with(self, register: A::Register) -> Self {
        Self { register, ..self }
    }
}

impl<A: Arithmetic> Add for Four<A> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(self.arithmetic.add(self.register, other.register))
    }
}

impl<A: Arithmetic> Sub for Four<A> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(self.arithmetic.sub(self.register, other.register))
    }
}

impl<A: Arithmetic> Mul for Four<A> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(self.arithmetic.mul(self.register, other.register))
    }
}

impl<A: Arithmetic> Div for Four<A> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.with(self.arithmetic.div(self.register, other.register))
    }
}

impl<A: Arithmetic> Number for Four<A> {
    #[inline(always)]
    fn plus(self, a: Self, b: Self) -> Self {
        self.with(
            self.arithmetic
                .mul_add(a.register, b.register, self.register),
        )
    }

    #[inline(always)]
    fn minus(self, a: Self, b: Self) -> Self {
        self.with(
            self.arithmetic
                .negate_mul_add(a.register, b.register, self.register),
        )
    }
}

/// Returns the sums over the lanes of each.
#[inline(always)]
pub(crate) fn totals<A: Arithmetic, const N: usize>(fours: &[Four<A>; N]) -> [f64; N] {
    let mut totals = [0.0; N];
    for (totals, fours) in totals.chunks_mut(LANES).zip(fours.chunks(LANES)) {
        let last = fours.len() - 1;
        let four = [
            fours[0],
            fours[1.min(last)],
            fours[2.min(last)],
            fours[last],
        ];
        let lane = Four::totals(four).lane();
        totals.copy_from_slice(&lane[..totals.len()]);
    }
    totals
}

/// Makes the compiler keep sums in memory between blocks: sums that exceed the sixteen registers would otherwise be
/// moved twice a block. It generates no instruction and changes no value.
#[inline(always)]
pub(crate) fn keep_in_memory<T>(sums: &mut T) {
    std::hint::black_box(sums);
}

/// An operation that is generic over the arithmetic. Everything that it calls must be `inline(always)`, otherwise it is
/// compiled for the oldest supported processor.
pub(crate) trait Kernel {
    type Output;
    fn run<A: Arithmetic>(self, arithmetic: A) -> Self::Output;
}

/// Runs a kernel with the best available arithmetic.
#[inline(always)]
pub(crate) fn vectorised<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = *x86::AVX2 {
        return avx2.vectorize(
            #[inline(always)]
            || kernel.run(avx2),
        );
    }
    kernel.run(Plain)
}

/// Arrays and loops of fixed length.
#[derive(Clone, Copy)]
pub(crate) struct Plain;

#[inline(always)]
fn zip(a: Lane, b: Lane, f: impl Fn(f64, f64) -> f64) -> Lane {
    let mut out = [0.0; LANES];
    for i in 0..LANES {
        out[i] = f(a[i], b[i]);
    }
    out
}

impl Arithmetic for Plain {
    type Register = Lane;

    #[inline(always)]
    fn load(self, lane: Lane) -> Lane {
        lane
    }

    #[inline(always)]
    fn store(self, a: Lane) -> Lane {
        a
    }

    #[inline(always)]
    fn add(self, a: Lane, b: Lane) -> Lane {
        zip(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, a: Lane, b: Lane) -> Lane {
        zip(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, a: Lane, b: Lane) -> Lane {
        zip(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn div(self, a: Lane, b: Lane) -> Lane {
        zip(a, b, |a, b| a / b)
    }

    #[inline(always)]
    fn mul_add(self, a: Lane, b: Lane, c: Lane) -> Lane {
        self.add(c, self.mul(a, b))
    }

    #[inline(always)]
    fn negate_mul_add(self, a: Lane, b: Lane, c: Lane) -> Lane {
        self.sub(c, self.mul(a, b))
    }

    #[inline(always)]
    fn totals(self, fours: [Lane; 4]) -> Lane {
        let mut totals = [0.0; LANES];
        for i in 0..LANES {
            let [a, b, c, d] = fours[i];
            totals[i] = (a + b) + (c + d);
        }
        totals
    }

    #[inline(always)]
    fn transposed(self, rows: [Lane; 4]) -> [Lane; 4] {
        let mut columns = rows;
        for i in 0..LANES {
            columns[i] = [rows[0][i], rows[1][i], rows[2][i], rows[3][i]];
        }
        columns
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::sync::LazyLock;

    use pulp::x86::V3;
    use pulp::{Simd, cast, f64x4};

    use super::{Arithmetic, Lane};

    /// AVX2 with fused multiply-add, if the processor has it; checked once.
    pub(super) static AVX2: LazyLock<Option<V3>> = LazyLock::new(V3::try_new);

    impl Arithmetic for V3 {
        type Register = f64x4;

        #[inline(always)]
        fn load(self, lane: Lane) -> f64x4 {
            cast(lane)
        }

        #[inline(always)]
        fn store(self, a: f64x4) -> Lane {
            cast(a)
        }

        #[inline(always)]
        fn add(self, a: f64x4, b: f64x4) -> f64x4 {
            self.add_f64s(a, b)
        }

        #[inline(always)]
        fn sub(self, a: f64x4, b: f64x4) -> f64x4 {
            self.sub_f64s(a, b)
        }

        #[inline(always)]
        fn mul(self, a: f64x4, b: f64x4) -> f64x4 {
            self.mul_f64s(a, b)
        }

        #[inline(always)]
        fn div(self, a: f64x4, b: f64x4) -> f64x4 {
            self.div_f64s(a, b)
        }

        #[inline(always)]
        fn mul_add(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
            self.mul_add_e_f64s(a, b, c)
        }

        #[inline(always)]
        fn negate_mul_add(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
            self.negate_mul_add_e_f64s(a, b, c)
        }

        #[inline(always)]
        fn totals(self, [a, b, c, d]: [f64x4; 4]) -> f64x4 {
            // Adds neighbours first: lower and upper halves of a, b and of c, d.
            let ab = self.avx._mm256_hadd_pd(cast(a), cast(b));
            let cd = self.avx._mm256_hadd_pd(cast(c), cast(d));
            let lower = self.avx._mm256_permute2f128_pd::<0x20>(ab, cd);
            let upper = self.avx._mm256_permute2f128_pd::<0x31>(ab, cd);
            cast(self.avx._mm256_add_pd(lower, upper))
        }

        #[inline(always)]
        fn transposed(self, [a, b, c, d]: [f64x4; 4]) -> [f64x4; 4] {
            let [a, b, c, d] = [cast(a), cast(b), cast(c), cast(d)];
            let avx = self.avx;
            let (ab_even, ab_odd) = (avx._mm256_unpacklo_pd(a, b), avx._mm256_unpackhi_pd(a, b));
            let (cd_even, cd_odd) = (avx._mm256_unpacklo_pd(c, d), avx._mm256_unpackhi_pd(c, d));
            [
                cast(avx._mm256_permute2f128_pd::<0x20>(ab_even, cd_even)),
                cast(avx._mm256_permute2f128_pd::<0x20>(ab_odd, cd_odd)),
                cast(avx._mm256_permute2f128_pd::<0x31>(ab_even, cd_even)),
                cast(avx._mm256_permute2f128_pd::<0x31>(ab_odd, cd_odd)),
            ]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: [Lane; 4] = [
        [1.0, 20.0, 300.0, 4000.0],
        [5.0, 60.0, 700.0, 8000.0],
        [9.0, 10.0, 110.0, 1200.0],
        [13.0, 14.0, 150.0, 1600.0],
    ];

    struct Everything;

    impl Kernel for Everything {
        type Output = (Lane, [Lane; 4], f64);

        #[inline(always)]
        fn run<A: Arithmetic>(self, arithmetic: A) -> Self::Output {
            let [a, b, c, d] = [
                Four::new(arithmetic, ROWS[0]),
                Four::new(arithmetic, ROWS[1]),
                Four::new(arithmetic, ROWS[2]),
                Four::new(arithmetic, ROWS[3]),
            ];
            let [e, f, g, h] = Four::transposed([a, b, c, d]);
            let totals = Four::totals([a, b, c, d]).lane();
            (totals, [e.lane(), f.lane(), g.lane(), h.lane()], a.total())
        }
    }

    #[test]
    fn totals_and_columns_are_right_in_every_arithmetic() {
        let totals = ROWS.map(|row| row.iter().sum());
        let columns: [Lane; 4] = std::array::from_fn(|i| ROWS.map(|row| row[i]));
        let expected = (totals, columns, totals[0]);
        assert_eq!(Everything.run(Plain), expected);
        assert_eq!(vectorised(Everything), expected);
    }

    #[test]
    fn totals_of_any_count_stand_in_their_order() {
        let fours: [Four<Plain>; 6] =
            std::array::from_fn(|i| Four::new(Plain, ROWS[i % 4].map(|value| value * i as f64)));
        let expected: [f64; 6] =
            std::array::from_fn(|i| i as f64 * ROWS[i % 4].iter().sum::<f64>());
        assert_eq!(totals(&fours).map(f64::to_bits), expected.map(f64::to_bits));
    }
}
