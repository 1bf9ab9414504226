//! What a check found, as tables in plain words, and as JSON.

use std::fmt::Write;
use std::path::PathBuf;

use serde_json::{Value, json};

use super::against::Outcome;
use super::along::Station;
use super::finding::Finding;
use super::more::OneMore;
use super::shape::Shape;
use super::situation::{CLIMB, Situation};
use super::verdict::Verdict;
use super::view::AXES;

/// Ranges in the table of causes.
const RANGES_OF_CAUSES: usize = 4;
/// Causes with less than this share on every axis are not listed.
const LEAST_SHARE: f64 = 0.005;

/// Everything that was found.
pub struct Report<'a> {
    pub situation: &'a Situation,
    /// Where the camera is from.
    pub camera: String,
    pub shape: &'a Shape,
    pub stations: &'a [Station],
    pub verdicts: &'a [Verdict],
    pub one_more: Option<&'a OneMore>,
    pub recording: Option<&'a Outcome>,
    pub findings: &'a [Finding],
    pub files: &'a [PathBuf],
}

impl Report<'_> {
    /// Returns the report in plain words.
    pub fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.write(&mut text);
        text
    }

    fn write(&self, text: &mut String) -> std::fmt::Result {
        self.heading(text)?;
        for index in 0..self.situation.monitor.points().len() {
            self.point(text, index)?;
        }
        self.losses(text)?;
        self.recording(text)?;
        writeln!(text, "\nGood enough?")?;
        for verdict in self.verdicts {
            writeln!(text, "  {}", verdict.in_words())?;
        }
        if self.verdicts.is_empty() {
            writeln!(text, "  no: there is no pose at any range")?;
        }
        if let Some(one_more) = self.one_more {
            writeln!(text, "  {}", more_in_words(one_more))?;
        }
        writeln!(text, "\nFindings")?;
        for finding in self.findings {
            writeln!(text, "  {finding}")?;
        }
        if self.findings.is_empty() {
            writeln!(text, "  none")?;
        }
        if self.files.is_empty() {
            writeln!(text, "\nNo plots were written; --output DIR does.")?;
        } else {
            writeln!(text, "\nPlots")?;
            for file in self.files {
                writeln!(text, "  {}", file.display())?;
            }
        }
        Ok(())
    }

    fn heading(&self, text: &mut String) -> std::fmt::Result {
        let situation = self.situation;
        let [_, line, plane] = self.shape.spreads;
        writeln!(
            text,
            "Map \"{}\": {} markers, {} beacons, up to {:.2} m apart; spread across their line {:.2}, across their \
             plane {:.3} of that along it",
            situation.map.name(),
            situation.map.markers().len(),
            situation.beacons().len(),
            self.shape.span_m,
            line,
            plane,
        )?;
        writeln!(
            text,
            "Budget: {}",
            if situation.estimator.has_causes() {
                "see the causes below"
            } else {
                "none: map and calibration are taken as exact, which no real ones are"
            }
        )?;
        let size = situation.camera.image_size_px();
        let size = size.map_or_else(
            || "no size of the image".to_owned(),
            |(width, height)| format!("{width}x{height} px"),
        );
        writeln!(text, "Camera: {}, {size}", self.camera)?;
        let ranges = &situation.route.ranges_m;
        let (first, last) = (
            ranges.first().copied().unwrap_or(0.0),
            situation.route.nearest_m(),
        );
        writeln!(
            text,
            "Approach: the tanker's origin {first:.1} m to {last:.1} m ahead of the camera{}, {CLIMB} m higher for each \
             metre, nominal attitude; {} px, nothing hidden by the airframe",
            if situation
                .route
                .contact_m
                .is_some_and(|contact| contact.x >= last)
            {
                ", where contact is made"
            } else {
                ""
            },
            situation.sigma_px,
        )
    }

    fn point(&self, text: &mut String, index: usize) -> std::fmt::Result {
        let point = &self.situation.monitor.points()[index];
        let p = point.point_in_tanker;
        writeln!(
            text,
            "\nPoint \"{}\" at ({:.2}, {:.2}, {:.2}) on the tanker, m",
            point.name, p.x, p.y, p.z
        )?;
        writeln!(
            text,
            "                        sigma                      protection level ({:.0e})",
            self.situation.monitor.settings().hmi_probability
        )?;
        writeln!(
            text,
            "  range points    ahead lateral vertical      ahead lateral vertical  second pose"
        )?;
        for station in self.stations {
            let view = match &station.view {
                Ok(view) => view,
                Err(reason) => {
                    let (range_m, used) = (station.range_m, station.used);
                    writeln!(text, "{range_m:7.1} {used:6}  no pose: {reason}")?;
                    continue;
                }
            };
            let found = &view.points[index];
            let [a, b, c] = found.sigma_m;
            write!(
                text,
                "{:7.1} {:6}  {a:7.3} {b:7.3} {c:8.3}  ",
                station.range_m, station.used
            )?;
            match found.level_m {
                Some([a, b, c]) => write!(text, "  {a:7.3} {b:7.3} {c:8.3}")?,
                None => write!(text, "  {:>7} {:>7} {:>8}", "-", "-", "-")?,
            }
            writeln!(text, "  {:11.1e}", view.ambiguity)?;
        }
        self.causes(text, index)
    }

    fn causes(&self, text: &mut String, index: usize) -> std::fmt::Result {
        let with_pose: Vec<&Station> = self.stations.iter().filter(|s| s.view.is_ok()).collect();
        let last = with_pose.len().saturating_sub(1);
        let mut chosen: Vec<usize> = (0..RANGES_OF_CAUSES)
            .map(|step| step * last / (RANGES_OF_CAUSES - 1))
            .collect();
        chosen.dedup();
        writeln!(text, "  causes, % of the variance")?;
        for station in chosen.into_iter().filter_map(|at| with_pose.get(at)) {
            let Ok(view) = &station.view else { continue };
            let shares = &view.points[index].shares;
            let mut totals = [0.0; 3];
            for share in shares {
                (0..3).for_each(|axis| totals[axis] += share.variance_m2[axis]);
            }
            write!(text, "{:7.1}", station.range_m)?;
            for (axis, total) in totals.into_iter().enumerate() {
                let mut parts: Vec<(f64, &str)> = shares
                    .iter()
                    .map(|share| (share.variance_m2[axis] / total, share.cause.as_str()))
                    .filter(|(share, _)| *share >= LEAST_SHARE)
                    .collect();
                parts.sort_by(|a, b| b.0.total_cmp(&a.0));
                let parts: Vec<String> = parts
                    .iter()
                    .take(4)
                    .map(|(share, cause)| format!("{cause} {:.0}", 100.0 * share))
                    .collect();
                let gap = if axis == 0 { "  " } else { "; " };
                write!(text, "{gap}{}: {}", AXES[axis], parts.join(", "))?;
            }
            writeln!(text)?;
        }
        Ok(())
    }

    fn losses(&self, text: &mut String) -> std::fmt::Result {
        writeln!(
            text,
            "\nWith one beacon lost: the largest level of any axis and point, m"
        )?;
        writeln!(text, "  range      all     worst loss")?;
        for station in self.stations {
            let Ok(view) = &station.view else { continue };
            write!(
                text,
                "{:7.1}  {:>7}",
                station.range_m,
                level(view.worst_level_m())
            )?;
            match station.weakest() {
                Some(weakest) => {
                    let without = match &weakest.view {
                        Ok(view) => level(view.worst_level_m()),
                        Err(_) => "no pose".to_owned(),
                    };
                    let leave_none = (station.without.iter())
                        .filter(|without| without.worst_level_m().is_infinite())
                        .count();
                    let of_all = if leave_none > 1 {
                        format!("; without any of {leave_none} there is no level")
                    } else {
                        String::new()
                    };
                    writeln!(text, "  {without:>7} without {}{of_all}", weakest.beacon)?;
                }
                None => writeln!(text)?,
            }
        }
        Ok(())
    }

    fn recording(&self, text: &mut String) -> std::fmt::Result {
        let Some(outcome) = self.recording else {
            return Ok(());
        };
        let fit = &outcome.fit;
        writeln!(
            text,
            "\nRecording: {} of {} frames fit the map as it is, chi-squared over degrees of freedom {:.2}",
            fit.good,
            fit.frames,
            fit.ratio()
        )?;
        if !outcome.offsets.is_empty() {
            writeln!(
                text,
                "  marker    offset from the others' poses, x y z, cm         sigma, cm   chi-squared (limit)"
            )?;
            for offset in &outcome.offsets {
                let (d, s) = (100.0 * offset.shift_m, 100.0 * offset.sigma_m);
                writeln!(
                    text,
                    "  {:6}    {:+8.1} {:+8.1} {:+8.1}    {:8.1} {:8.1} {:8.1}   {:11.1} ({:.1})",
                    offset.id, d.x, d.y, d.z, s.x, s.y, s.z, offset.chi_squared, offset.limit
                )?;
            }
        }
        Ok(())
    }

    /// Returns the report for programs.
    pub fn json(&self) -> Value {
        let points = self.situation.monitor.points();
        let stations = self.stations.iter().map(|station| {
            let view = station.view.as_ref().ok();
            let of_points = view.map(|view| {
                let of_points = view.points.iter().zip(points).map(|(found, point)| {
                    let shares = found.shares.iter();
                    json!({
                        "name": point.name,
                        "sigma_m": found.sigma_m,
                        "protection_level_m": found.level_m,
                        "weakest": found.weakest,
                        "variance_m2": shares
                            .map(|share| (share.cause.clone(), json!(share.variance_m2)))
                            .collect::<serde_json::Map<_, _>>(),
                    })
                });
                of_points.collect::<Vec<_>>()
            });
            let without = station.without.iter().map(|without| {
                let level_m = without.worst_level_m();
                json!({
                    "beacon": without.beacon,
                    "worst_level_m": level_m.is_finite().then_some(level_m),
                })
            });
            json!({
                "range_m": station.range_m,
                "points_used": station.used,
                "lost": station.lost,
                "refusal": station.view.as_ref().err(),
                "no_level": view.and_then(|view| view.no_level.clone()),
                "ambiguity": view.map(|view| view.ambiguity),
                "points": of_points,
                "without": without.collect::<Vec<_>>(),
                "weakest": station.weakest().map(|weakest| weakest.beacon.clone()),
            })
        });
        let verdicts = self.verdicts.iter().map(|verdict| {
            json!({
                "point": verdict.point,
                "range_m": verdict.range_m,
                "required_m": verdict.required_m,
                "good": verdict.is_good(),
                "sigma_m": verdict.sigma.1,
                "sigma_axis": AXES[verdict.sigma.0],
                "protection_level_m": verdict.level.map(|(_, level_m)| level_m),
                "level_axis": verdict.level.map(|(axis, _)| AXES[axis]),
                "dominant_cause": verdict.dominant.as_ref().map(|(cause, _)| cause.clone()),
                "weakest": verdict.weakest,
            })
        });
        let finite = |value: f64| value.is_finite().then_some(value);
        let findings = self.findings.iter().map(finding_json);
        json!({
            "map": self.situation.map.name(),
            "camera": self.camera,
            "span_m": self.shape.span_m,
            "spreads": self.shape.spreads,
            "stations": stations.collect::<Vec<_>>(),
            "verdicts": verdicts.collect::<Vec<_>>(),
            "one_more": self.one_more.map(|more| json!({
                "x": more.place_in_tanker.x,
                "y": more.place_in_tanker.y,
                "z": more.place_in_tanker.z,
                "range_m": more.range_m,
                "level_m": finite(more.level_m),
                "new_level_m": finite(more.new_level_m),
                "sigma_m": finite(more.sigma_m),
                "new_sigma_m": finite(more.new_sigma_m),
            })),
            "recording": self.recording.map(|outcome| json!({
                "frames": outcome.fit.frames,
                "fitting": outcome.fit.good,
                "instead": outcome.instead.as_ref().map(|(hypothesis, fit)| json!({
                    "hypothesis": hypothesis.in_words(),
                    "fitting": fit.good,
                })),
                "chi_squared_ratio": finite(outcome.fit.ratio()),
                "offsets": outcome.offsets.iter().map(|offset| json!({
                    "id": offset.id,
                    "offset_m": offset.shift_m.as_slice(),
                    "sigma_m": offset.sigma_m.as_slice(),
                    "chi_squared": offset.chi_squared,
                    "limit": finite(offset.limit),
                })).collect::<Vec<_>>(),
            })),
            "findings": findings.collect::<Vec<_>>(),
            "files": self.files,
        })
    }
}

/// Returns a finding for programs.
pub fn finding_json(finding: &Finding) -> Value {
    json!({
        "severity": finding.severity.word(),
        "code": finding.code,
        "found": finding.found,
        "advice": finding.advice,
    })
}

fn level(level_m: f64) -> String {
    if level_m.is_finite() {
        format!("{level_m:.3}")
    } else {
        "none".to_owned()
    }
}

fn more_in_words(more: &OneMore) -> String {
    let p = more.place_in_tanker;
    let (what, before, after) = if more.new_level_m.is_finite() {
        ("worst level", level(more.level_m), level(more.new_level_m))
    } else {
        let before = if more.sigma_m.is_finite() {
            format!("{:.3}", more.sigma_m)
        } else {
            "none".to_owned()
        };
        ("worst sigma", before, format!("{:.3}", more.new_sigma_m))
    };
    format!(
        "one more beacon helps most about ({:.1}, {:.1}, {:.1}) on the tanker: {what} at {:.1} m from {before} to \
         {after} m (surveyed to {:.3} m, seen by the camera)",
        p.x, p.y, p.z, more.range_m, more.survey_m
    )
}
