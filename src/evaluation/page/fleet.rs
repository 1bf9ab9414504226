//! The page of several recordings: summary.html.

use maud::{Markup, html};

use super::document::document;
use super::numbers::{interval, milli, number, optional, percent, percents};
use super::tables;
use crate::evaluation::fleet::{BagLine, FleetNees, FleetReport};

/// Recordings that the page lists; all are in summary.json.
const MOST_BAGS: usize = 500;

/// Returns the page of several recordings.
///
/// # Inputs
/// * `link`: where the page of a recording is, relative to this one, by its name; `None`: there is no link.
#[must_use]
pub fn fleet_page(report: &FleetReport, link: impl Fn(&str) -> Option<String>) -> String {
    let body = html! {
        h1 { "Evaluation of " (report.bags.len()) " recordings" }
        p.soft { (report.in_words()) }
        @if !report.failed.is_empty() {
            section.warn {
                h2 { "Recordings without a report" }
                ul { @for failed in report.failed.iter().take(MOST_BAGS) { li { code { (failed.bag) } ": " (failed.reason) } } }
            }
        }
        @if let Some(nees) = &report.nees { (consistency(report, nees)) }
        @if !report.stanford.is_empty() || !report.integrity_states.is_empty() {
            section {
                h2 { "Protection levels" }
                @let all = report.integrity_states.iter().map(|count| count.count).sum();
                (tables::counts("integrity state", &report.integrity_states, all))
                @if !report.stanford.is_empty() { (tables::stanford(&report.stanford)) }
            }
        }
        section { h2 { "Refusals" } (tables::counts("outcome", &report.outcomes, report.frames)) }
        @if !report.suspects.is_empty() {
            section {
                h2 { "Markers that are not where the map has them" }
                (tables::counts("marker", &report.suspects, report.bags.len() as u64))
                p.soft { "Counted in recordings. The same marker in most of them is an error of the map; in one of them, something of that flight." }
            }
        }
        (bags(report, link))
    };
    document("Evaluation of several recordings", &body)
}

fn consistency(report: &FleetReport, nees: &FleetNees) -> Markup {
    let class = if nees.verdict == "within" {
        "good"
    } else {
        "bad"
    };
    html! {
        section {
            h2 { "Honesty of the covariance" }
            div.scroll { table {
                tr {
                    th { "recordings" } th { "frames" } th { "mean NEES" } th { "95 % bounds if independent" } th { "independent frames" }
                    th { "95 % bounds" } th { "mean is" } th { "recordings outside their own bounds" }
                }
                tr {
                    td { (nees.bags) } td { (nees.frames) } td { (number(nees.mean)) } td { (interval(nees.bounds_if_independent)) }
                    td { (number(nees.independent_frames)) } td { (interval(nees.bounds)) } td class=(class) { (nees.verdict.replace('_', " ")) }
                    td { (nees.bags_outside) " of " (nees.bags) }
                }
            } }
            p.soft { "6 is right. Recordings are independent of each other; frames of one only as far as their errors are. One recording in twenty is
                outside its own bounds by chance." }
            div.scroll { table {
                tr { th { "axis" } th { "frames" } th { "within 3 sigma" } th { "95 % interval" } }
                @for axis in &report.coverage {
                    tr { td { (axis.axis) } td { (axis.frames) } td { (percent(axis.coverage_3_sigma)) } td { (percents(axis.coverage_interval)) } }
                }
            } }
            h3 { "Frames with the largest NEES" }
            div.scroll { table {
                tr { th { "recording" } th { "stamp, ns" } th { "range, m" } th { "NEES" } th { "position error, m" } th { "attitude error, mrad" } }
                @for worst in &report.worst_frames {
                    tr {
                        td { (worst.bag) } td { (worst.frame.stamp_ns) } td { (number(worst.frame.range_m)) } td { (number(worst.frame.nees)) }
                        td { (number(worst.frame.position_error_m)) } td { (milli(Some(worst.frame.attitude_error_rad))) }
                    }
                }
            } }
        }
    }
}

fn bags(report: &FleetReport, link: impl Fn(&str) -> Option<String>) -> Markup {
    let mut lines: Vec<&BagLine> = report.bags.iter().collect();
    // The most striking first; stable, so equal ones stay in their order.
    lines.sort_by(|a, b| {
        let key = |line: &BagLine| (line.beyond_level, line.suspect_marker.is_some());
        let nees = |line: &BagLine| line.nees_mean.unwrap_or(0.0);
        key(b).cmp(&key(a)).then(nees(b).total_cmp(&nees(a)))
    });
    html! {
        section {
            h2 { "Recordings" }
            @if lines.len() > MOST_BAGS { p.soft { "The first " (MOST_BAGS) " of " (lines.len()) ", the most striking first; all are in summary.json." } }
            div.scroll { table {
                tr {
                    th { "recording" } th { "frames" } th { "with a pose" } th { "mean NEES" } th { "position rms, m" } th { "levels available" }
                    th { "beyond level" } th { "displaced marker" } th { "not read" }
                }
                @for line in lines.iter().take(MOST_BAGS) {
                    tr {
                        td { @match link(&line.bag) { Some(place) => a href=(place) { (line.bag) }, None => (line.bag) } }
                        td { (line.frames) } td { (percent(line.with_pose as f64 / line.frames.max(1) as f64)) }
                        @let is_outside = line.nees_verdict.as_deref().is_some_and(|verdict| verdict != "within");
                        td class=[is_outside.then_some("bad")] { (optional(line.nees_mean)) }
                        td { (optional(line.position_rms_m)) } td { (line.availability.map_or_else(|| "–".to_owned(), percent)) }
                        td class=[(line.beyond_level > 0).then_some("bad")] { (line.beyond_level) }
                        td class=[line.suspect_marker.map(|_| "bad")] { (line.suspect_marker.map_or_else(|| "–".to_owned(), |id| id.to_string())) }
                        td { (line.skipped) }
                    }
                }
            } }
        }
    }
}
