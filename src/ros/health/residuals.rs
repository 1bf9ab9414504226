//! Frames that are not trusted, again and again: no wrong detection, but a map, a calibration or sigmas that are wrong.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use nalgebra::Vector2;

use crate::pipeline::MarkerResidual;

/// s; what is older than this counts for little.
const MEMORY_S: f64 = 3.0;
/// How long so many must not be trusted.
const LASTING: Duration = Duration::from_secs(3);
/// How many of them at least.
const MANY: u32 = 10;
/// Of the frames with a fit: more are no accident. Correct ones are refused once in a thousand.
const MANY_OF_ALL: f64 = 0.3;
/// Fewer, and it is over.
const FEW_OF_ALL: f64 = 0.1;
/// Of the squared residuals: what points the same way in frame after frame is no noise.
const SYSTEMATIC: f64 = 0.3;

/// Sums in which frames fade away.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    weight: f64,
    residual_px: Vector2<f64>,
    squared_px2: f64,
    squared_sigmas: f64,
}

/// A fit that is not trusted.
#[derive(Debug, Clone, Copy)]
pub struct Doubtful<'a> {
    /// Sum of its squared residuals over their variances.
    pub chi_squared: f64,
    /// Of it.
    pub degrees_of_freedom: u16,
    /// Of its detections.
    pub residuals: &'a [MarkerResidual],
}

/// Judges fits one after the other.
#[derive(Debug, Default)]
pub struct Residuals {
    latest: Option<Instant>,
    fits: f64,
    doubtful: f64,
    chi_squared: f64,
    degrees_of_freedom: f64,
    markers: BTreeMap<u32, Sums>,
    run: Option<Run>,
    lasts: bool,
}

/// A time in which many are not trusted.
#[derive(Debug)]
struct Run {
    since: Instant,
    doubtful: u32,
}

impl Residuals {
    /// Takes a fit, trusted or not.
    pub fn take(&mut self, doubtful: Option<Doubtful>, now: Instant) {
        self.fade(now);
        self.fits += 1.0;
        if let Some(fit) = doubtful {
            self.doubtful += 1.0;
            self.chi_squared += fit.chi_squared;
            self.degrees_of_freedom += f64::from(fit.degrees_of_freedom);
            for seen in fit.residuals {
                let squared_px2 = seen.residual_px.norm_squared();
                let sums = self.markers.entry(seen.id).or_default();
                sums.weight += 1.0;
                sums.residual_px += seen.residual_px;
                sums.squared_px2 += squared_px2;
                sums.squared_sigmas += squared_px2 / seen.sigma_px.powi(2);
            }
        }
        let share = self.doubtful / self.fits;
        if share < FEW_OF_ALL {
            self.lasts = false;
        }
        if share < MANY_OF_ALL {
            self.run = None;
            return;
        }
        let run = self.run.get_or_insert(Run {
            since: now,
            doubtful: 0,
        });
        run.doubtful = run.doubtful.saturating_add(u32::from(doubtful.is_some()));
        let lasted = now.saturating_duration_since(run.since);
        self.lasts |= run.doubtful >= MANY && lasted >= LASTING;
    }

    /// Returns what is wrong and where to look, while it lasts.
    #[must_use]
    pub fn in_words(&self) -> Option<String> {
        if !self.lasts {
            return None;
        }
        let percent = 100.0 * self.doubtful / self.fits;
        let ratio = self.chi_squared / self.degrees_of_freedom.max(1.0);
        let cause = if self.systematic() >= SYSTEMATIC {
            "the residuals point the same way in frame after frame: the marker map or the calibration (camera_info) is \
             wrong"
                .to_owned()
        } else {
            format!(
                "the residuals scatter about zero: the sigmas (pixel_sigma_px, or those of the detections) are too small, \
                 {:.1} times as large would fit",
                ratio.sqrt()
            )
        };
        Some(format!(
            "{percent:.0}% of the frames with a fit are NOT_TRUSTED, chi-squared is {ratio:.1} per degree of freedom \
             (expected 1). Wrong detections do not last like that; {cause}{}",
            self.worst()
        ))
    }

    /// Returns which marker fits worst.
    fn worst(&self) -> String {
        let rms = |squares: f64, sums: &Sums| (squares / (2.0 * sums.weight)).sqrt();
        let in_sigmas = |sums: &Sums| rms(sums.squared_sigmas, sums);
        let mut markers: Vec<(&u32, &Sums)> = self
            .markers
            .iter()
            .filter(|(_, sums)| sums.weight > 0.5)
            .collect();
        markers.sort_by(|(_, a), (_, b)| in_sigmas(b).total_cmp(&in_sigmas(a)));
        let Some((id, worst)) = markers.first() else {
            return String::new();
        };
        let mean = worst.residual_px / worst.weight;
        let next = markers.get(1).map_or(String::new(), |(id, sums)| {
            format!("; next is marker {id} with {:.1} sigma", in_sigmas(sums))
        });
        format!(
            ". Worst is marker {id}: {:.2} px or {:.1} sigma per axis, on average detected ({:+.2}, {:+.2}) px from where \
             the fit has it{next}",
            rms(worst.squared_px2, worst),
            in_sigmas(worst),
            -mean.x,
            -mean.y,
        )
    }

    /// Returns the share of the squared residuals that the markers' means make up.
    fn systematic(&self) -> f64 {
        let (mut of_means, mut all) = (0.0, 0.0);
        for sums in self.markers.values().filter(|sums| sums.weight > 0.5) {
            of_means += sums.residual_px.norm_squared() / sums.weight;
            all += sums.squared_px2;
        }
        if all > 0.0 { of_means / all } else { 0.0 }
    }

    fn fade(&mut self, now: Instant) {
        let Some(latest) = self.latest.replace(now) else {
            return;
        };
        let passed_s = now.saturating_duration_since(latest).as_secs_f64();
        let left = (-passed_s / MEMORY_S).exp();
        for sum in [
            &mut self.fits,
            &mut self.doubtful,
            &mut self.chi_squared,
            &mut self.degrees_of_freedom,
        ] {
            *sum *= left;
        }
        for sums in self.markers.values_mut() {
            sums.weight *= left;
            sums.residual_px *= left;
            sums.squared_px2 *= left;
            sums.squared_sigmas *= left;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const FRAME: Duration = Duration::from_millis(50);
    const SIGMA_PX: f64 = 0.5;

    fn at(id: u32, u: f64, v: f64) -> MarkerResidual {
        MarkerResidual {
            id,
            residual_px: Vector2::new(u, v),
            sigma_px: SIGMA_PX,
        }
    }

    /// Takes frames, of which some are not trusted, with these residuals; returns the words.
    fn pass(
        residuals: &mut Residuals,
        start: Instant,
        frames: u32,
        mut doubtful: impl FnMut(u32) -> Option<Vec<MarkerResidual>>,
    ) -> Option<String> {
        for frame in 0..frames {
            let found = doubtful(frame);
            let fit = found.as_ref().map(|residuals| Doubtful {
                chi_squared: residuals
                    .iter()
                    .map(|seen| seen.residual_px.norm_squared() / SIGMA_PX.powi(2))
                    .sum(),
                degrees_of_freedom: 2,
                residuals,
            });
            residuals.take(fit, start + frame * FRAME);
        }
        residuals.in_words()
    }

    #[test]
    fn residuals_that_stay_name_map_and_calibration_and_the_worst_marker() {
        let mut residuals = Residuals::default();
        let start = Instant::now();
        let off = |frame: u32| {
            (!frame.is_multiple_of(4))
                .then(|| vec![at(1, 0.2, 0.1), at(3, -2.0, 0.5), at(4, 0.5, -0.4)])
        };
        assert_eq!(
            pass(&mut residuals, start, 60, off),
            None,
            "3 s have not passed"
        );
        let words = pass(&mut residuals, start + 60 * FRAME, 40, off).expect("5 s");
        // Three of four; the latest weigh most.
        assert!(words.starts_with("76% of the frames"), "{words}");
        assert!(
            words.contains("the marker map or the calibration"),
            "{words}"
        );
        assert!(
            words.contains("Worst is marker 3: 1.46 px or 2.9 sigma per axis, on average detected (+2.00, -0.50) px"),
            "{words}"
        );
        assert!(words.contains("next is marker 4"), "{words}");

        let good = |_| None;
        assert!(pass(&mut residuals, start + 100 * FRAME, 40, good).is_some());
        assert_eq!(pass(&mut residuals, start + 140 * FRAME, 400, good), None);
    }

    #[test]
    fn residuals_that_scatter_name_the_sigmas() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let words = pass(&mut Residuals::default(), Instant::now(), 200, |_| {
            // Uniform with a standard deviation of 1 px, twice the sigma.
            let mut noise = || rng.random_range(-3.0_f64.sqrt()..3.0_f64.sqrt());
            let seen = |id| at(id, noise(), noise());
            Some([1, 2, 3].map(seen).to_vec())
        })
        .expect("10 s");
        assert!(words.contains("the sigmas (pixel_sigma_px"), "{words}");
    }

    #[test]
    fn few_frames_among_many_are_wrong_detections() {
        let wrong = |frame: u32| (frame.is_multiple_of(10)).then(|| vec![at(1, 30.0, 0.0)]);
        let mut residuals = Residuals::default();
        assert_eq!(pass(&mut residuals, Instant::now(), 1000, wrong), None);
    }
}
