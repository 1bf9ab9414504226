//! Arithmetic on four numbers at once, in which the solver spends most of its time.
//!
//! | file | what |
//! | --- | --- |
//! | `four` | [`four::Arithmetic`] (AVX2 or plain arrays), [`four::Four`] numbers of it, [`four::vectorised`] to run a kernel |
//! | `columns` | a 3×3 matrix, a column in each register |
//! | `points` | a frame's points in blocks of four |
//! | `symmetric3` | symmetric 3×3 matrices by their upper triangle: inverses and products |
//! | `information` | the 6×6 normal equations of a pose, by blocks of 3×3 |
//!
//! # How to read a kernel
//!
//! A kernel is a struct with the inputs and a function `run` that is generic over `A: Arithmetic`. [`four::vectorised`]
//! runs it with AVX2 if the processor has it and with plain arrays otherwise, so everything below `run` is compiled
//! twice.
//!
//! * A [`four::Lane`] is four numbers in memory, a [`four::Four`] the same four in a register. Operators
//!   work element by element: `a * b` is four products.
//! * Read `Four` as if it were `f64`: the formula is the same, for four points, or four attitudes, side by side.
//! * `a.plus(b, c)` is `a + b c`, `a.minus(b, c)` is `a − b c`, rounded once where the processor fuses them.
//!   The order of the operations is part of the result: another order gives other last bits.
//! * [`four::totals`] adds the four numbers of each sum at the end of a loop over blocks.
//! * The last block is padded with points of zero weight, so no loop has a remainder.
//!
//! # How to change one
//!
//! Everything under `run` is `#[inline(always)]`: a function that is not inlined is compiled without AVX2 and passes
//! its registers through memory. Closures and `array::map` in the descent were not always inlined, so new loops use
//! indices over fixed sizes. Measure with `cargo bench --bench stages`, before and after, side by side.

pub(crate) mod columns;
pub(crate) mod four;
pub(crate) mod information;
pub(crate) mod points;
pub(crate) mod symmetric3;
