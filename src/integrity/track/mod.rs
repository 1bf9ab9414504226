//! Protection levels of the track: the separations of frames, taken through the filter's own recursion.
//!
//! With `ε` the error of the track, found minus true, a frame corrects it by `ε ← A ε + G n`, where `n` is the error of
//! the frame's pose, `A = R (1 − K H) F` and `G = R K T` ([`Step`](crate::tracking::Step)). The track *without* the
//! suspects of hypothesis `k` is the one that the same gains make of the poses that the frames have without them. It is
//! as good as if the fault was not there, whenever it began and however it grew. How far it is from the one in use is
//! known, since the separation of each frame is:
//!
//! ```text
//! separation    Dₖ ← A Dₖ + G dₖ                        dₖ = −Lₖ sₖ: the pose in use minus that without the suspects
//! cause c       V ← aᶜ A V + G nᶜ   Wₖ ← aᶜ A Wₖ + G Lₖ bₖᶜ     what one sigma of it does to the track, and to −Dₖ
//! noise         Qₖ ← A Qₖ Aᵀ + G cov(dₖ) Gᵀ             Yₖ ← A Yₖ Aᵀ + G (cov(nₖ) − cov(n)) Gᵀ
//! threshold     T = Q⁻¹(P_FA / 2N) σ(D)                 σ²(D) = aᵀ (Qₖ + Wₖ Wₖᵀ) a
//! level         as for a frame                          σ²ₖ = σ²₀ + aᵀ (Yₖ + Wₖ Wₖᵀ + Wₖ Vᵀ + V Wₖᵀ) a
//! ```
//!
//! with covariances of what is new in each frame, and the causes that last (survey, flex, calibration, correlated noise)
//! one by one: `aᶜ = exp(−dt/τ)`. In a frame without a suspect `dₖ = 0`. In a frame whose other points do not fix a
//! pose, the track without the suspects coasts.
//!
//! Knows `tracking`, and of frames what `projection` and `separation` say.

mod choices;
mod frame;
mod hypothesis;
mod left_out;
mod levels;
mod state;

pub(super) use choices::LeftOut;
pub use frame::FrameSeparations;
pub(super) use frame::Linearised;
pub use state::{TrackSeparation, TrackSeparations};
