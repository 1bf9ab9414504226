//! Repeated frames that are not trusted or leave a marker out: the cause is the map, the calibration or the sigmas
//! rather than a wrong detection.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use nalgebra::Vector2;

use crate::pipeline::{MarkerResidual, SigmaFactor};

/// s; time constant of the sums.
const MEMORY_S: f64 = 3.0;
/// How long so many frames must disagree.
const LASTING: Duration = Duration::from_secs(3);
/// How many of them at least.
const MANY: u32 = 10;
/// Share of the frames with a fit above which there is a fault. Of correct frames one in a thousand disagrees.
const MANY_OF_ALL: f64 = 0.3;
/// Share below which it is over.
const FEW_OF_ALL: f64 = 0.1;
/// Share of the squared residuals: a constant part is not noise.
const SYSTEMATIC: f64 = 0.3;
/// Sigmas that are wrong by a larger factor are a fault.
const WRONG_BY: f64 = 1.3;

/// Sums in which frames fade away.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    weight: f64,
    residual_px: Vector2<f64>,
    squared_px2: f64,
    squared_sigmas: f64,
}

/// Judges fits one after the other.
#[derive(Debug, Default)]
pub struct Residuals {
    latest: Option<Instant>,
    fits: f64,
    disagreeing: f64,
    markers: BTreeMap<u32, Sums>,
    run: Option<Run>,
    lasts: bool,
}

/// A period in which many frames disagree.
#[derive(Debug)]
struct Run {
    since: Instant,
    disagreeing: u32,
}

impl Residuals {
    /// Takes the residuals of a fit, those of markers that were left out too; `agrees`: all markers, so that it is
    /// trusted and leaves none out.
    pub fn take(&mut self, agrees: bool, residuals: &[MarkerResidual], now: Instant) {
        self.fade(now);
        self.fits += 1.0;
        self.disagreeing += f64::from(u8::from(!agrees));
        for seen in residuals {
            let squared_px2 = seen.residual_px.norm_squared();
            let sums = self.markers.entry(seen.id).or_default();
            sums.weight += 1.0;
            sums.residual_px += seen.residual_px;
            sums.squared_px2 += squared_px2;
            sums.squared_sigmas += squared_px2 / seen.sigma_px.powi(2);
        }
        let share = self.disagreeing / self.fits;
        if share < FEW_OF_ALL {
            self.lasts = false;
        }
        if share < MANY_OF_ALL {
            self.run = None;
            return;
        }
        let run = self.run.get_or_insert(Run {
            since: now,
            disagreeing: 0,
        });
        run.disagreeing = run.disagreeing.saturating_add(u32::from(!agrees));
        let lasted = now.saturating_duration_since(run.since);
        self.lasts |= run.disagreeing >= MANY && lasted >= LASTING;
    }

    /// Returns what is wrong with markers and where to look, while it lasts.
    #[must_use]
    pub fn in_words(&self, sigmas: Option<SigmaFactor>) -> Option<String> {
        if !self.lasts {
            return None;
        }
        let percent = 100.0 * self.disagreeing / self.fits;
        let factor = sigmas.map_or(1.0, |sigmas| sigmas.factor);
        let cause = if self.is_systematic() {
            format!("wrong detections would not persist like this; {SAME_WAY}")
        } else if factor > WRONG_BY {
            format!(
                "wrong detections would not persist like this; the residuals scatter about zero: the sigmas (pixel_sigma_px, or those \
                 of the detections) are too small, by a factor of {factor:.1}"
            )
        } else {
            "most frames fit their sigmas, and the residuals of the others scatter: the detector gives that many wrong detections"
                .to_owned()
        };
        Some(format!(
            "{percent:.0}% of the frames with a fit are NOT_TRUSTED or leave a marker out: {cause}{}",
            self.worst()
        ))
    }

    /// Returns what is wrong with sigmas, if they are: as stated, whether or not they are widened.
    #[must_use]
    pub fn sigmas_in_words(&self, sigmas: Option<SigmaFactor>, widened_by: f64) -> Option<String> {
        let which = "the sigmas (pixel_sigma_px, or those of the detections)";
        let now = if widened_by > 1.0 {
            format!(
                "Detections count with {widened_by:.2} times their sigmas (widen_by_sigma_factor), for what scatters from \
                 frame to frame, until you state larger ones"
            )
        } else {
            "Covariances are too small by that factor squared".to_owned()
        };
        let Some(sigmas) = sigmas.filter(SigmaFactor::is_settled) else {
            let is_widened = widened_by > WRONG_BY;
            return is_widened.then(|| format!("{which} are too small. {now}"));
        };
        let SigmaFactor { factor, span_s, .. } = sigmas;
        if factor.max(widened_by) > WRONG_BY {
            let cause = if self.is_systematic() {
                SAME_WAY
            } else {
                "they scatter about zero"
            };
            Some(format!(
                "{which} are too small: over {span_s:.0} s residuals were {factor:.1} times as large as they state, and {cause}. {now}"
            ))
        } else if factor < 1.0 / WRONG_BY {
            Some(format!(
                "{which} are too large: over {span_s:.0} s residuals were {factor:.2} times as large as they state. Covariances are \
                 too large, and wrong detections up to that size pass"
            ))
        } else {
            None
        }
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
            ". Worst is marker {id}: {:.2} px or {:.1} sigma per axis, on average detected ({:+.2}, {:+.2}) px from its \
             fitted position{next}",
            rms(worst.squared_px2, worst),
            in_sigmas(worst),
            -mean.x,
            -mean.y,
        )
    }

    /// Returns whether the markers' means make up much of the squared residuals.
    fn is_systematic(&self) -> bool {
        let (mut of_means, mut all) = (0.0, 0.0);
        for sums in self.markers.values().filter(|sums| sums.weight > 0.5) {
            of_means += sums.residual_px.norm_squared() / sums.weight;
            all += sums.squared_px2;
        }
        of_means > SYSTEMATIC * all
    }

    fn fade(&mut self, now: Instant) {
        let Some(latest) = self.latest.replace(now) else {
            return;
        };
        let passed_s = now.saturating_duration_since(latest).as_secs_f64();
        let left = (-passed_s / MEMORY_S).exp();
        self.fits *= left;
        self.disagreeing *= left;
        for sums in self.markers.values_mut() {
            sums.weight *= left;
            sums.residual_px *= left;
            sums.squared_px2 *= left;
            sums.squared_sigmas *= left;
        }
    }
}

/// What residuals show that do not scatter.
const SAME_WAY: &str = "the residuals point the same way in every frame: the marker map or the calibration \
                        (camera_info) is wrong";

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

    fn by(factor: f64) -> SigmaFactor {
        SigmaFactor {
            factor,
            fits: 200,
            span_s: 10.0,
        }
    }

    /// Takes frames with these residuals, of which some do not agree; returns the words.
    fn pass(
        residuals: &mut Residuals,
        start: Instant,
        frames: u32,
        mut of: impl FnMut(u32) -> (bool, Vec<MarkerResidual>),
    ) -> Option<String> {
        for frame in 0..frames {
            let (agrees, found) = of(frame);
            residuals.take(agrees, &found, start + frame * FRAME);
        }
        residuals.in_words(Some(by(2.0)))
    }

    #[test]
    fn residuals_that_stay_name_map_and_calibration_and_the_worst_marker() {
        let mut residuals = Residuals::default();
        let start = Instant::now();
        let off = |frame: u32| {
            let found = vec![at(1, 0.2, 0.1), at(3, -2.0, 0.5), at(4, 0.5, -0.4)];
            (frame.is_multiple_of(4), found)
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
        let sigmas = residuals
            .sigmas_in_words(Some(by(2.0)), 1.0)
            .expect("twice");
        assert!(sigmas.contains("the marker map or the"), "{sigmas}");

        let good = |_| (true, vec![at(3, 0.1, 0.1)]);
        assert!(pass(&mut residuals, start + 100 * FRAME, 40, good).is_some());
        assert_eq!(pass(&mut residuals, start + 140 * FRAME, 400, good), None);
    }

    #[test]
    fn residuals_that_scatter_name_sigmas_or_the_detector() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut residuals = Residuals::default();
        let words = pass(&mut residuals, Instant::now(), 200, |frame| {
            let mut noise = || rng.random_range(-2.0..2.0);
            let seen = |id| at(id, noise(), noise());
            (frame.is_multiple_of(2), [1, 2, 3].map(seen).to_vec())
        })
        .expect("10 s");
        assert!(
            words.contains("the sigmas (pixel_sigma_px") && words.contains("by a factor of 2.0"),
            "{words}"
        );
        let words = residuals.in_words(Some(by(1.05))).expect("as before");
        assert!(words.contains("the detector gives that many"), "{words}");
    }

    #[test]
    fn sigmas_are_wrong_from_a_factor_of_one_third_on_once_it_is_settled() {
        let residuals = Residuals::default();
        for (of, wrong) in [
            (0.5, true),
            (0.8, false),
            (1.0, false),
            (1.25, false),
            (1.5, true),
        ] {
            let words = residuals.sigmas_in_words(Some(by(of)), 1.0);
            assert_eq!(words.is_some(), wrong, "{words:?}");
        }
        let words = residuals
            .sigmas_in_words(Some(by(1.5)), 1.0)
            .unwrap_or_default();
        assert!(
            words.contains("too small") && words.contains("1.5 times"),
            "{words}"
        );
        let words = residuals
            .sigmas_in_words(Some(by(0.5)), 1.0)
            .unwrap_or_default();
        assert!(
            words.contains("too large") && words.contains("0.50 times"),
            "{words}"
        );
        let early = SigmaFactor {
            fits: 99,
            ..by(2.0)
        };
        assert_eq!(residuals.sigmas_in_words(Some(early), 1.0), None);
        assert_eq!(residuals.sigmas_in_words(None, 1.0), None);
    }

    #[test]
    fn widened_sigmas_stay_a_fault_that_names_the_factor() {
        let residuals = Residuals::default();
        for sigmas in [Some(by(2.0)), Some(by(1.0)), None] {
            let words = residuals.sigmas_in_words(sigmas, 1.96).unwrap_or_default();
            let expected = "Detections count with 1.96 times their sigmas (widen_by_sigma_factor)";
            assert!(
                words.contains("too small") && words.contains(expected),
                "{words}"
            );
        }
        assert_eq!(residuals.sigmas_in_words(Some(by(1.1)), 1.1), None);
    }

    #[test]
    fn few_frames_among_many_are_wrong_detections() {
        let wrong = |frame: u32| (!frame.is_multiple_of(10), vec![at(1, 30.0, 0.0)]);
        let mut residuals = Residuals::default();
        assert_eq!(pass(&mut residuals, Instant::now(), 1000, wrong), None);
    }
}
