//! A map held against a recording: does it fit, and if not, which mistake explains it?

use std::fmt::Write;

use tanker_pose::estimation::Estimator;
use tanker_pose::target::MarkerMap;

use super::axes::{self, Fit, Hypothesis};
use super::finding::Finding;
use super::offset::{Offset, offsets};
use super::recording::{Frame, Recording};

/// Distances of tankers in recordings that are plausible, m.
const PLAUSIBLE_M: std::ops::RangeInclusive<f64> = 2.0..=1000.0;

/// What the estimates of a recording need.
pub struct Against<'a> {
    pub map: &'a MarkerMap,
    pub estimator: &'a Estimator,
    pub sigma_px: f64,
    pub margin_px: f64,
    /// An offset from here on is an error rather than a warning, m.
    pub required_m: f64,
}

/// How a recording fits.
pub struct Outcome {
    pub fit: Fit,
    /// The hypothesis that explains it, where the map as it is does not.
    pub instead: Option<(Hypothesis, Fit)>,
    /// Of every marker that can be judged, the most significant first.
    pub offsets: Vec<Offset>,
    pub findings: Vec<Finding>,
}

impl Against<'_> {
    pub fn check(&self, recording: &Recording) -> Outcome {
        let mut findings = Vec::new();
        if let Some(reason) = &recording.first_reason {
            findings.push(Finding::warning(
                "recording",
                format!(
                    "{} of {} lines of the recording are no frame; first: {reason}",
                    recording.unusable, recording.lines
                ),
                "see `tanker_pose solve` for the format",
            ));
        }
        findings.extend(self.unknown_ids(&recording.frames));
        let frames = &recording.frames;
        let fit = self.fit(frames);
        let mut instead = None;
        let mut offsets = Vec::new();
        let trust = self.estimator.settings().trust_probability;
        if !fit.is_good(trust) {
            let (hypothesis, better) = axes::best(
                frames,
                self.map,
                self.estimator,
                self.sigma_px,
                self.margin_px,
            );
            if !hypothesis.is_as_given() && better.is_good(trust) {
                findings.push(turned(&fit, &hypothesis, &better));
                instead = Some((hypothesis, better));
            }
        }
        if instead.is_none() {
            offsets = self.offsets(frames);
            let misplaced = offsets.first().filter(|offset| offset.is_significant());
            match misplaced {
                Some(offset) => findings.push(self.misplaced(offset, &offsets)),
                None if !fit.is_good(trust) => findings.push(unexplained(&fit)),
                None => {}
            }
        }
        findings.extend(distance(instead.as_ref().map_or(&fit, |(_, fit)| fit)));
        Outcome {
            fit,
            instead,
            offsets,
            findings,
        }
    }

    fn fit(&self, frames: &[Frame]) -> Fit {
        let given = Hypothesis {
            true_from_map: nalgebra::Matrix3::identity(),
        };
        axes::fit(
            frames,
            self.map,
            &given,
            self.estimator,
            self.sigma_px,
            self.margin_px,
        )
    }

    fn offsets(&self, frames: &[Frame]) -> Vec<Offset> {
        offsets(
            frames,
            self.map,
            self.estimator,
            self.sigma_px,
            self.margin_px,
        )
    }

    fn unknown_ids(&self, frames: &[Frame]) -> Option<Finding> {
        let mut ids: Vec<u32> = frames
            .iter()
            .flat_map(|frame| &frame.detections)
            .map(|seen| seen.id)
            .filter(|id| self.map.get(*id).is_none())
            .collect();
        ids.sort_unstable();
        ids.dedup();
        let words: Vec<String> = ids.iter().take(8).map(u32::to_string).collect();
        (!ids.is_empty()).then(|| {
            Finding::error(
                "unknown_id",
                format!(
                    "the recording has ids that are not on the map: {}{}",
                    words.join(", "),
                    if ids.len() > 8 { ", …" } else { "" }
                ),
                "the node refuses every frame with such an id: complete the map, or the detector",
            )
        })
    }

    fn misplaced(&self, offset: &Offset, all: &[Offset]) -> Finding {
        let (d, s) = (offset.shift_m, offset.sigma_m);
        let cm = |m: f64| format!("{:+.1}", 100.0 * m);
        let others = all.iter().skip(1).filter(|other| other.is_significant());
        let others = match others.count() {
            0 => String::new(),
            count => format!(
                "; {count} more would move too, less significantly, which may be its consequence"
            ),
        };
        let found = format!(
            "marker {} is {:.0} cm away from where the map has it: ({}, {}, {}) ± ({:.1}, {:.1}, {:.1}) cm in x, y, z, \
             chi-squared {:.0} where chance stays below {:.0}; so {} of {} frames fit{others}",
            offset.id,
            100.0 * d.norm(),
            cm(d.x),
            cm(d.y),
            cm(d.z),
            100.0 * s.x,
            100.0 * s.y,
            100.0 * s.z,
            offset.chi_squared,
            offset.limit,
            offset.frames.0,
            offset.frames.1,
        );
        let place = self.map.get(offset.id).map_or_else(String::new, |marker| {
            let moved = marker + d;
            format!(
                "; the recording puts it at ({:.3}, {:.3}, {:.3})",
                moved.x, moved.y, moved.z
            )
        });
        let advice = format!("measure its place on the tanker again{place}; then check again");
        if d.norm() >= self.required_m {
            Finding::error("misplaced", found, advice)
        } else {
            Finding::warning("misplaced", found, advice)
        }
    }
}

fn turned(given: &Fit, hypothesis: &Hypothesis, better: &Fit) -> Finding {
    let code = if hypothesis.in_words().starts_with("left and right") {
        "left_right"
    } else {
        "axes"
    };
    Finding::error(
        code,
        format!(
            "{}: so {} of {} frames fit at about the nominal attitude, chi-squared over degrees of freedom {:.2}; as \
             the map is, {} do{}",
            hypothesis.in_words(),
            better.good,
            better.frames,
            better.ratio(),
            given.good,
            in_words(given),
        ),
        hypothesis.advice(),
    )
}

/// Returns what becomes of the frames that are not good.
fn in_words(fit: &Fit) -> String {
    let mut words = Vec::new();
    if fit.turned > 0 {
        words.push(format!("{} are turned away from it", fit.turned));
    }
    words.extend(
        fit.refusals
            .iter()
            .take(3)
            .map(|(reason, count)| format!("{count} {reason}")),
    );
    if words.is_empty() {
        String::new()
    } else {
        format!(" ({})", words.join(", "))
    }
}

fn unexplained(fit: &Fit) -> Finding {
    let mut advice =
        "no exchange of axes and no single marker explains it: check camera and calibration, \
                      the nominal attitude and the mount"
            .to_owned();
    if fit.ratio() > 1.5 {
        // Writing to a string cannot fail.
        let _ = write!(
            advice,
            "; or sigmas are too small: residuals are {:.1} times as large as stated (pixel_sigma_px, sigma of the map)",
            fit.ratio().sqrt()
        );
    }
    Finding::error(
        "does_not_fit",
        format!(
            "{} of {} recorded frames fit the map{}",
            fit.good,
            fit.frames,
            in_words(fit)
        ),
        advice,
    )
}

fn distance(fit: &Fit) -> Option<Finding> {
    let median_m = fit.median_distance_m()?;
    (!PLAUSIBLE_M.contains(&median_m)).then(|| {
        Finding::error(
            "units",
            format!("the recorded tanker is {median_m:.3} m away, as the map has it"),
            "an image does not show the scale: coordinates must be in metres, are they in mm or km?",
        )
    })
}
