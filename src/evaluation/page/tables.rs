//! Tables of a report.

use maud::{Markup, html};

use super::errors::{NAMES, unit};
use super::numbers::{interval, milli, number, optional, percent, percents, probability};
use crate::evaluation::report::{
    Count, EstimateReport, LatencyReport, ModeReport, NeesReport, ResidualReport, StampReport,
    StanfordReport, TopicReport, WorstFrame,
};
use crate::evaluation::statistics::Quantiles;

/// Errors by axis, with coverage.
pub(super) fn axes(report: &EstimateReport) -> Markup {
    html! {
        div.scroll { table {
            tr {
                th { "axis" } th { "unit" } th { "mean" } th { "rms" } th { "largest" } th { "stated sigma, rms" }
                th { "within 3 sigma" } th { "95 % interval if independent" } th { "95 % interval" } th { "independent frames" }
            }
            @for (index, axis) in report.axes.iter().enumerate() {
                @let (unit, factor) = unit(index);
                tr {
                    td { (NAMES.get(index).copied().unwrap_or_default()) } td { (unit) }
                    td { (number(factor * axis.mean)) } td { (number(factor * axis.rms)) } td { (number(factor * axis.max_abs)) }
                    td { (optional(axis.sigma.map(|sigma| factor * sigma))) }
                    td { (axis.coverage_3_sigma.map_or_else(|| "–".to_owned(), percent)) }
                    td { (percents(axis.coverage_interval_if_independent)) } td { (percents(axis.coverage_interval)) }
                    td { (number(axis.independent_frames)) }
                }
            }
        } }
    }
}

/// NEES with its bounds.
pub(super) fn nees(report: &NeesReport) -> Markup {
    let class = if report.verdict == "within" {
        "good"
    } else {
        "bad"
    };
    html! {
        div.scroll { table {
            tr {
                th { "frames" } th { "mean" } th { "median" } th { "99 %" } th { "largest" }
                th { "95 % bounds of the mean if independent" } th { "independent frames" } th { "95 % bounds of the mean" } th { "mean is" }
            }
            tr {
                td { (report.frames) } td { (number(report.mean)) } td { (number(report.p50)) } td { (number(report.p99)) }
                td { (number(report.max)) } td { (interval(report.bounds_if_independent)) }
                td { (number(report.independent_frames)) } td { (interval(report.bounds)) }
                td class=(class) { (report.verdict.replace('_', " ")) }
            }
        } }
    }
}

/// Frames to look at.
pub(super) fn worst(frames: &[WorstFrame]) -> Markup {
    html! {
        div.scroll { table {
            tr { th { "stamp, ns" } th { "time, s" } th { "range, m" } th { "NEES" } th { "position error, m" } th { "attitude error, mrad" } }
            @for frame in frames {
                tr {
                    td { (frame.stamp_ns) } td { (format!("{:.3}", frame.time_s)) } td { (number(frame.range_m)) } td { (number(frame.nees)) }
                    td { (number(frame.position_error_m)) } td { (milli(Some(frame.attitude_error_rad))) }
                }
            }
        } }
    }
}

/// Counts with their shares.
pub(super) fn counts(what: &str, counts: &[Count], all: u64) -> Markup {
    html! {
        div.scroll { table {
            tr { th { (what) } th { "frames" } th { "share" } }
            @for count in counts {
                tr { td { (count.name) } td { (count.count) } td { (percent(count.count as f64 / all.max(1) as f64)) } }
            }
        } }
    }
}

/// Counts of the Stanford diagrams.
pub(super) fn stanford(diagrams: &[StanfordReport]) -> Markup {
    html! {
        div.scroll { table {
            tr {
                th { "point" } th { "axis" } th { "frames" } th { "alert limit, m" } th { "nominal" } th { "unavailable" } th { "misleading" }
                th { "hazardous" } th { "unavailable and misleading" } th { "largest error / level" } th { "P(error > level) at most, 95 %, if independent" }
            }
            @for found in diagrams {
                @let bad = found.beyond_level() > 0;
                tr {
                    td { (found.point) } td { (found.axis.trim_end_matches("_m")) } td { (found.frames) } td { (optional(found.alert_limit_m)) }
                    td { (found.nominal) } td { (found.unavailable) } td class=[bad.then_some("bad")] { (found.misleading) }
                    td class=[bad.then_some("bad")] { (found.hazardous) } td { (found.unavailable_and_misleading) }
                    td { (number(found.largest_ratio)) } td { (optional(found.exceeding_at_most_if_independent)) }
                }
            }
        } }
    }
}

/// Residuals and displacements by marker.
pub(super) fn markers(report: &ResidualReport) -> Markup {
    let triple = |values: Option<[f64; 3]>| {
        values.map_or_else(
            || "–".to_owned(),
            |v| v.map(|value| format!("{:.1}", 1e3 * value)).join(", "),
        )
    };
    html! {
        div.scroll { table {
            tr {
                th { "marker" } th { "frames" } th { "used" } th { "rejected" } th { "mean u, v, px" } th { "sigma u, v, px" } th { "stated, px" }
                th { "chi-squared (2)" } th { "displacement x, y, z, mm" } th { "its sigma, mm" } th { "chi-squared (3)" } th { "p" }
                th { "independent frames" } th { "survey sigma, mm" }
            }
            @for marker in &report.markers {
                @let is_suspect = report.suspect.as_ref().is_some_and(|suspect| suspect.id == marker.id);
                tr {
                    td class=[is_suspect.then_some("bad")] { (marker.id) } td { (marker.frames) } td { (marker.used) } td { (marker.rejected) }
                    td { (format!("{:.3}, {:.3}", marker.mean_px[0], marker.mean_px[1])) }
                    td { (format!("{:.3}, {:.3}", marker.sigma_px[0], marker.sigma_px[1])) }
                    td { (number(marker.stated_sigma_px)) } td { (number(marker.chi_squared_mean)) }
                    td { (triple(marker.displacement_m)) } td { (triple(marker.displacement_sigma_m)) }
                    td { (optional(marker.displacement_chi_squared)) }
                    td { (marker.displacement_p_value.map_or_else(|| "–".to_owned(), probability)) }
                    td { (number(marker.independent_frames)) }
                    td { (marker.survey_sigma_m.map_or_else(|| "exact".to_owned(), |sigma| number(1e3 * sigma))) }
                }
            }
        } }
    }
}

/// Modes of the error budget.
pub(super) fn modes(modes: &[ModeReport]) -> Markup {
    html! {
        div.scroll { table {
            tr { th { "mode" } th { "frames" } th { "mean, sigmas" } th { "rms, sigmas" } th { "largest, sigmas" } th { "frames it dominates" } }
            @for mode in modes {
                tr {
                    td { (mode.name) } td { (mode.frames) } td { (number(mode.mean_sigmas)) } td { (number(mode.rms_sigmas)) }
                    td { (number(mode.max_abs_sigmas)) } td { (mode.dominant_frames) }
                }
            }
        } }
    }
}

/// Delays.
pub(super) fn latency(report: &LatencyReport) -> Markup {
    let line = |what: &str, found: Option<Quantiles>| {
        html! {
            @if let Some(found) = found {
                tr { td { (what) } td { (found.count) } td { (milli(Some(found.p50))) } td { (milli(Some(found.p99))) } td { (milli(Some(found.max))) } }
            } @else {
                tr { td { (what) } td { "–" } td { "–" } td { "–" } td { "–" } }
            }
        }
    };
    html! {
        div.scroll { table {
            tr { th { "delay, ms" } th { "count" } th { "p50" } th { "p99" } th { "largest" } }
            (line("stamp of the image → pose recorded", report.pose_log_minus_stamp_s))
            (line("stamp of the image → status recorded", report.status_log_minus_stamp_s))
            (line("detections recorded → status recorded", report.status_minus_detections_s))
            (line("solve_time in the status", report.solve_time_s))
        } }
    }
}

/// Stamps of each topic.
pub(super) fn stamps(reports: &[StampReport]) -> Markup {
    html! {
        div.scroll { table {
            tr {
                th { "topic" } th { "messages" } th { "period, ms" } th { "jitter, ms" } th { "gaps" } th { "longest gap, s" } th { "out of order" }
                th { "repeated" } th { "invalid" } th { "log − stamp, ms: least" } th { "median" } th { "largest" } th { "drift, ppm" }
            }
            @for found in reports {
                tr {
                    td { (found.role) } td { (found.messages) } td { (milli(found.period_s)) } td { (milli(found.jitter_s)) } td { (found.gaps) }
                    td { (optional(found.longest_gap_s)) } td { (found.out_of_order) } td { (found.repeated) } td { (found.invalid) }
                    td { (milli(found.log_minus_stamp_min_s)) } td { (milli(found.log_minus_stamp_median_s)) } td { (milli(found.log_minus_stamp_max_s)) }
                    td { (optional(found.clock_drift_s_per_s.map(|drift| 1e6 * drift))) }
                }
            }
        } }
    }
}

/// What was read.
pub(super) fn topics(topics: &[TopicReport]) -> Markup {
    html! {
        div.scroll { table {
            tr { th { "for" } th.words { "topic" } th.words { "type" } th { "messages" } }
            @for topic in topics {
                tr { td { (topic.role) } td.words { code { (topic.name) } } td.words { code { (topic.type_name) } } td { (topic.messages) } }
            }
        } }
    }
}
