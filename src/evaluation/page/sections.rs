//! What the page says, section by section.

use maud::{Markup, html};

use super::chart::Chart;
use super::document::document;
use super::numbers::{interval, number, percent};
use super::{errors, frames, levels, tables, times};
use crate::evaluation::report::{EstimateReport, OutcomeReport, ResidualReport, StanfordReport};
use crate::evaluation::{Evaluation, Report};

/// Most Stanford diagrams on a page.
const MOST_DIAGRAMS: usize = 24;

/// Returns the page of a recording.
#[must_use]
pub fn page(evaluation: &Evaluation) -> String {
    let title = format!("Evaluation of {}", evaluation.report.bag);
    document(&title, &all(evaluation))
}

/// Returns the whole body.
fn all(evaluation: &Evaluation) -> Markup {
    let report = &evaluation.report;
    html! {
        h1 { "Evaluation of " (report.bag) }
        p.soft { (report.messages) " messages" @if let Some(length_s) = report.duration_s { ", " (format!("{length_s:.1}")) " s of stamps" } }
        (tiles(report))
        (remarks(report))
        @if let Some(pose) = &report.pose { (errors_section(evaluation, pose)) }
        @if let Some(odometry) = &report.odometry { (odometry_section(odometry)) }
        (integrity_section(evaluation))
        @if let Some(outcomes) = &report.outcomes { (outcomes_section(evaluation, outcomes)) }
        @if let Some(residuals) = &report.residuals { (residual_section(residuals)) }
        (mode_section(evaluation))
        (time_section(evaluation))
        (conventions(report))
    }
}

fn plots(charts: impl IntoIterator<Item = Chart>) -> Markup {
    html! { div.plots { @for chart in charts { (chart.markup()) } } }
}

/// The figures that are looked at first.
fn tiles(report: &Report) -> Markup {
    let tile = |class: &str, value: String, words: String| {
        html! { div class={ "tile " (class) } { b { (value) } span { (words) } } }
    };
    html! {
        div.tiles {
            @if let Some(outcomes) = &report.outcomes {
                (tile("", percent(outcomes.with_pose as f64 / outcomes.frames as f64), format!("of {} frames have a pose", outcomes.frames)))
            }
            @if let Some(nees) = report.pose.as_ref().and_then(|pose| pose.nees.as_ref()) {
                @let class = if nees.verdict == "within" { "good" } else { "bad" };
                (tile(class, number(nees.mean), format!("mean NEES; 6 is right, {} at 95 %", interval(nees.bounds))))
            }
            @if let Some(pose) = &report.pose {
                @let rms = |first: usize| pose.axes[first..first + 3].iter().map(|axis| axis.rms.powi(2)).sum::<f64>().sqrt();
                (tile("", format!("{} m", number(rms(0))), "position error, rms".to_owned()))
                (tile("", format!("{} mrad", number(1e3 * rms(3))), "attitude error, rms".to_owned()))
            }
            @if let Some(integrity) = &report.integrity {
                (tile("", percent(integrity.availability), "of frames have protection levels within their limits".to_owned()))
                @let beyond: u64 = integrity.stanford.iter().map(StanfordReport::beyond_level).sum();
                @if !integrity.stanford.is_empty() {
                    (tile(if beyond == 0 { "good" } else { "bad" }, beyond.to_string(), "errors beyond their protection level".to_owned()))
                }
            }
            @if let Some(residuals) = &report.residuals {
                @match &residuals.suspect {
                    Some(suspect) => (tile("bad", format!("marker {}", suspect.id), "is not where the map has it".to_owned())),
                    None => (tile("good", "none".to_owned(), "of the markers is significantly displaced".to_owned())),
                }
            }
        }
    }
}

/// What was not read, and what may surprise.
fn remarks(report: &Report) -> Markup {
    html! {
        @if !report.skipped.is_empty() {
            section.warn {
                h2 { "Not everything could be read or used" }
                ul { @for words in &report.skipped { li { (words) } } }
            }
        }
        @if !report.notes.is_empty() {
            section { ul { @for words in &report.notes { li { (words) } } } }
        }
    }
}

fn errors_section(evaluation: &Evaluation, pose: &EstimateReport) -> Markup {
    let nees_chart = errors::nees(evaluation);
    html! {
        section {
            h2 { "Errors of the single-frame pose" }
            @if let Some(truth) = &evaluation.report.truth {
                p.soft { (pose.frames) " poses against " code { (truth.topic) } ": " (truth.poses_at_its_stamps) " at stamps of the truth, "
                    (truth.poses_interpolated) " between two of them, " (truth.poses_without) " poses without a truth." }
            }
            (tables::axes(pose))
            p.soft { "An honest covariance has 99.73 % within 3 sigma. Intervals are those of Clopper and Pearson; the last one is for as many frames
                as are independent, by the correlation of error over sigma, which counts an error that stays the same as one." }
            (plots(errors::against_time(evaluation)))
            (plots(errors::against_range(pose)))
            h3 { "NEES: is the covariance honest?" }
            @if let Some(nees) = &pose.nees { (tables::nees(nees)) }
            @if pose.frames_without_covariance > 0 {
                p { (pose.frames_without_covariance) " poses have no covariance that is positive definite, hence no NEES." }
            }
            (plots(nees_chart))
            h3 { "Frames with the largest NEES" }
            (tables::worst(&pose.worst_frames))
        }
    }
}

fn odometry_section(odometry: &EstimateReport) -> Markup {
    html! {
        section {
            h2 { "Errors of the track (odometry)" }
            (tables::axes(odometry))
            @if let Some(nees) = &odometry.nees { (tables::nees(nees)) }
            p.soft { "Errors of a track last over many frames: look at the bounds for independent frames." }
        }
    }
}

fn integrity_section(evaluation: &Evaluation) -> Markup {
    let Some(report) = &evaluation.report.integrity else {
        return html! {};
    };
    html! {
        section {
            h2 { "Protection levels" }
            (tables::counts("integrity state", &report.states, report.frames))
            (plots(frames::states(evaluation)))
            @if report.stanford.is_empty() {
                p.soft { "No Stanford diagram: that needs a truth and the poses of the same stamps." }
            } @else {
                h3 { "Stanford diagrams" }
                (tables::stanford(&report.stanford))
                p.soft { "Misleading: the error is beyond the level, but within the alert limit, or no limit is stated. Hazardous: it is beyond both,
                    and the level is within the limit. At a risk of 1e-7 no recording has enough frames to confirm a level; one misleading frame refutes it." }
                (plots(evaluation.diagrams.iter().take(MOST_DIAGRAMS).map(levels::chart)))
            }
        }
    }
}

fn outcomes_section(evaluation: &Evaluation, report: &OutcomeReport) -> Markup {
    html! {
        section {
            h2 { "Refusals" }
            (tables::counts("outcome", &report.counts, report.frames))
            @if let Some(longest_s) = report.longest_without_pose_s { p { "Longest time between two poses: " (format!("{longest_s:.3}")) " s." } }
            (plots(frames::outcomes(evaluation)))
            @if !report.rejected_markers.is_empty() {
                h3 { "Detections that were rejected, by marker" }
                (tables::counts("marker", &report.rejected_markers, report.frames))
            }
        }
    }
}

fn residual_section(report: &ResidualReport) -> Markup {
    html! {
        section {
            h2 { "Residuals by marker" }
            @match &report.suspect {
                Some(suspect) => p { b { "Marker " (suspect.id) " is not where the map has it" } " (p = " (super::numbers::probability(suspect.p_value)) ")"
                    @if let Some(lead) = suspect.lead {
                        "; its chi-squared is " (number(lead)) " times that of the next marker"
                        @if lead < 1.5 { ", so either of the two may be the one" }
                    } "." },
                None => p { "No marker is significantly displaced." },
            }
            (tables::markers(report))
            p.soft { "Displacement: how far this marker would have to be from its place on the map, tanker frame, if every other one were right; it is
                found by least squares over all frames. Its sigma and p hold for as many frames as are independent. Errors of the calibration and a
                flexing airframe move markers too: the largest chi-squared is the first suspect, not a proof." }
            (plots(frames::residuals(report)))
        }
    }
}

fn mode_section(evaluation: &Evaluation) -> Markup {
    if evaluation.report.modes.is_empty() {
        return html! {};
    }
    html! {
        section {
            h2 { "Modes of the error budget" }
            (tables::modes(&evaluation.report.modes))
            p.soft { "As the statuses state them. Where a frame does not observe a mode its estimate is drawn to zero, so an rms well below 1 does not
                refute the budget; above 1 the budget is too small." }
            (plots(frames::modes(evaluation)))
        }
    }
}

fn time_section(evaluation: &Evaluation) -> Markup {
    let report = &evaluation.report;
    html! {
        section {
            h2 { "Delays and stamps" }
            (tables::latency(&report.latency))
            p.soft { "Delays to the log time contain the recorder's own, and any offset between the clock of the stamps and that of the recorder. A
                replay has no delays: its answers carry the log time of the detections." }
            (tables::stamps(&report.stamps))
            p.soft { "A gap is more than one and a half periods. Drift: change of log time minus stamp over the stamps; it needs ten seconds." }
            (plots(times::steps(evaluation).into_iter().chain(times::delays(evaluation))))
        }
    }
}

fn conventions(report: &Report) -> Markup {
    html! {
        section {
            h2 { "What was read, and what the numbers mean" }
            (tables::topics(&report.topics))
            ul {
                li { "A pose is that of the tanker in the camera: " code { "p_camera = R p_tanker + t" } ". Camera axes: x right, y down, z ahead." }
                li { "An error is truth minus estimate: " code { "t = t̂ + δt" } ", " code { "R = Exp(δθ) R̂" } ", hence " code { "δθ = Log(R R̂ᵀ)" }
                    ": on the left, position and attitude separate, along and about the axes of the camera. Its order and that of the covariance is
                    (x, y, z, rotX, rotY, rotZ). An estimate that is 0.1 m too far right has an error of −0.1 m along x." }
                li { "NEES is " code { "eᵀ Σ⁻¹ e" } " with the stated covariance Σ: chi-squared with 6 degrees of freedom if that is honest." }
                li { "Independent frames: N / (1 + 2 Σ (1 − k/N) ρ²(k)), with ρ²(k) the squared correlation over k frames of the error in units of its
                    covariance, about zero. Bounds of one recording are wide where errors last; those of several recordings are narrower." }
                li { "Protection levels and errors at a point: ahead, left, up in the axes of the receiver." }
                li { "Lengths in m, angles in rad (mrad on this page), times in s, pixels in px." }
            }
        }
    }
}
