//! A recording judged: errors against a truth, consistency of the covariance, protection levels, refusals, residuals, time.
//!
//! ```text
//! settings        what the node's parameters say of a recording
//! topics          which topics are evaluated, under which names
//! gather          one pass over a recording
//! align           estimates and the truth of the same time
//! consistency     errors, coverage, NEES
//! stanford        protection levels against errors
//! outcomes        refusals, integrity states, modes of the budget
//! residuals       residuals by marker, and the marker that is displaced
//! timing          stamps and delays
//! statistics      bounds, and how many frames are independent
//! report          the figures of one recording: evaluation.json
//! fleet           the figures of several recordings together
//! trajectories    TUM and CSV files
//! page            evaluation.html
//! ```
//!
//! The same recording gives the same bytes. Depends on `answering` (names of topics, inputs and files), `recording`,
//! `convert`, `messages` and the layers below; never on a clock, and writes no file.

mod align;
mod consistency;
mod fleet;
mod gather;
mod outcomes;
mod page;
mod report;
mod residuals;
mod settings;
mod stanford;
mod statistics;
mod timing;
mod topics;
mod trajectories;

use align::{Compared, Matches, Truth};
use gather::Gathered;
use stanford::Diagram;
use topics::Role;

pub use fleet::{BagLine, FailedBag, FleetCoverage, FleetNees, FleetReport, FleetWorstFrame};
pub use page::{fleet_page, page};
pub use report::*;
pub use settings::{Settings, SettingsError};
pub use statistics::Quantiles;

use crate::pipeline::Stamp;
use crate::recording::Recording;
use crate::text::{clip, list};

/// A recording with its figures.
pub struct Evaluation {
    /// The figures.
    pub report: Report,
    gathered: Gathered,
    truth: Truth,
    poses: Vec<Compared>,
    diagrams: Vec<Diagram>,
    start_ns: i64,
}

impl Evaluation {
    /// Returns the figures of a recording, which is read to its end.
    ///
    /// # Inputs
    /// * `name`: what the recording is called in the report.
    #[must_use]
    pub fn of(name: &str, recording: Recording, settings: &Settings) -> Self {
        let mut gathered = Gathered::read(recording, settings);
        let mut notes = Vec::new();
        missing(&mut gathered, &mut notes, settings);
        let truth = if truth_fits(&mut gathered, settings) {
            Truth::new(&gathered.truths)
        } else {
            Truth::default()
        };
        let (start_ns, end_ns) = span(&gathered);
        let (poses, matches) = truth.compare(&gathered.poses);
        let (odometry, _) = truth.compare(&gathered.odometry);
        let diagrams = stanford::diagrams(&gathered, &poses, settings);
        let unknown = stanford::unknown_points(&gathered.integrity, settings);
        if !unknown.is_empty() {
            gathered.skip(format!(
                "protection levels of {} are not compared: no such point in the marker map or the refuelling file given",
                list(&unknown)
            ));
        }
        let truth_report = truth_report(&gathered, &truth, matches, settings);
        let report = Report {
            format: FORMAT,
            bag: clip(name),
            messages: gathered.messages,
            notes,
            start_s: (end_ns >= start_ns).then(|| consistency::seconds(start_ns)),
            duration_s: (end_ns >= start_ns).then(|| consistency::seconds(end_ns - start_ns)),
            topics: topic_reports(&gathered),
            truth: truth_report,
            pose: consistency::estimate_report(&poses, start_ns),
            odometry: consistency::estimate_report(&odometry, start_ns),
            outcomes: outcomes::outcome_report(&gathered.statuses),
            integrity: stanford::integrity_report(&gathered.integrity, &diagrams),
            residuals: residuals::residual_report(&gathered, settings),
            modes: outcomes::mode_reports(&gathered.statuses),
            latency: timing::latency_report(&gathered),
            stamps: timing::stamp_reports(&gathered.heard),
            skipped: gathered.finish_skipped(),
        };
        Self {
            report,
            gathered,
            truth,
            poses,
            diagrams,
            start_ns,
        }
    }

    /// Returns a stamp as the time since the first one, s.
    fn time_s(&self, stamp_ns: i64) -> f64 {
        consistency::seconds(stamp_ns.saturating_sub(self.start_ns))
    }

    /// Returns the poses as a trajectory in the format of TUM: stamp, position, quaternion.
    #[must_use]
    pub fn estimate_tum(&self) -> String {
        let poses = self.gathered.poses.iter();
        trajectories::tum(poses.map(|pose| (pose.stamp_ns, pose.camera_from_tanker)))
    }

    /// Returns the truth in the same format.
    #[must_use]
    pub fn truth_tum(&self) -> String {
        trajectories::tum(self.truth.poses().iter().copied())
    }

    /// Returns velocities of the track, and covariances, as CSV.
    #[must_use]
    pub fn velocity_and_covariance_csv(&self) -> String {
        trajectories::csv(&self.gathered.poses, &self.gathered.odometry)
    }
}

impl Report {
    /// Returns whether all that there was has been read and used.
    #[must_use]
    pub const fn is_whole(&self) -> bool {
        self.skipped.is_empty()
    }

    /// Returns the main figures in words.
    #[must_use]
    pub fn in_words(&self) -> String {
        let mut words = Vec::new();
        if let Some(outcomes) = &self.outcomes {
            words.push(format!(
                "{} of {} frames have a pose",
                outcomes.with_pose, outcomes.frames
            ));
        }
        if let Some(nees) = self.pose.as_ref().and_then(|pose| pose.nees.as_ref()) {
            let verdict = nees.verdict.replace('_', " ");
            words.push(format!("mean NEES {:.2} ({verdict})", nees.mean));
        }
        if let Some(integrity) = &self.integrity {
            words.push(format!(
                "levels available in {:.1} %",
                100.0 * integrity.availability
            ));
        }
        if let Some(suspect) = self
            .residuals
            .as_ref()
            .and_then(|residuals| residuals.suspect.as_ref())
        {
            words.push(format!("marker {} is not where the map has it", suspect.id));
        }
        if words.is_empty() {
            words.push("no answers of the node".to_owned());
        }
        words.join(", ")
    }

    /// Returns whether the recording has an answer of the node.
    #[must_use]
    pub fn has_answers(&self) -> bool {
        self.outcomes.is_some()
            || self.topics.iter().any(|topic| {
                [Role::Pose, Role::Odometry, Role::Integrity]
                    .iter()
                    .any(|role| role.label() == topic.role)
            })
    }
}

/// Returns the first and the last stamp of what the node does; the first is the later one without any.
fn span(gathered: &Gathered) -> (i64, i64) {
    let poses = gathered.poses.iter().map(|pose| pose.stamp_ns);
    let statuses = gathered.statuses.iter();
    let statuses = statuses.map(|status| Stamp::from(status.header.stamp).nanoseconds());
    let seen = gathered.seen.keys().copied();
    let all = poses.chain(statuses).chain(seen);
    all.filter(|stamp_ns| *stamp_ns > 0)
        .fold((i64::MAX, i64::MIN), |(first, last), stamp_ns| {
            (first.min(stamp_ns), last.max(stamp_ns))
        })
}

fn topic_reports(gathered: &Gathered) -> Vec<TopicReport> {
    let each = gathered.heard.iter();
    each.map(|(role, heard)| TopicReport {
        role: role.label().to_owned(),
        name: clip(&heard.name),
        type_name: heard.type_name.clone(),
        messages: heard.times.len() as u64,
    })
    .collect()
}

fn truth_report(
    gathered: &Gathered,
    truth: &Truth,
    matches: Matches,
    settings: &Settings,
) -> Option<TruthReport> {
    (truth.len() > 0).then(|| TruthReport {
        topic: clip(&settings.topics.truth),
        messages: gathered.truths.len() as u64,
        poses_at_its_stamps: matches.exact,
        poses_interpolated: matches.interpolated,
        poses_without: matches.without,
    })
}

/// Says which topics are not there.
fn missing(gathered: &mut Gathered, notes: &mut Vec<String>, settings: &Settings) {
    let has = |gathered: &Gathered, role| gathered.heard.contains_key(&role);
    let name = |role| clip(settings.topics.name_of(role));
    if gathered.messages > 0 && !has(gathered, Role::Status) && !has(gathered, Role::Pose) {
        gathered.skip(format!(
            "no message on {} and none on {}: record the node's answers, or let `tanker_pose replay` write them; for a node in a \
             namespace add --ros-args -r __ns:=/name",
            name(Role::Pose),
            name(Role::Status)
        ));
    }
    if !has(gathered, Role::Truth) {
        let topic = name(Role::Truth);
        if settings.topics.truth_is_named {
            gathered.skip(format!("no truth: no usable message on {topic}"));
        } else {
            notes.push(format!(
                "no truth: no message on {topic}, and no other topic was named by --truth; errors, coverage and NEES need one"
            ));
        }
    }
}

/// Returns whether the truth is of the tanker in the camera, as the poses are; says what it is otherwise.
fn truth_fits(gathered: &mut Gathered, settings: &Settings) -> bool {
    let Some(truth_frames) = gathered.frames.get(&Role::Truth) else {
        return false;
    };
    let mut frames: Vec<String> = truth_frames.keys().cloned().collect();
    for role in [Role::Pose, Role::Odometry] {
        frames.extend(
            gathered
                .frames
                .get(&role)
                .into_iter()
                .flatten()
                .map(|(frame, _)| frame.clone()),
        );
    }
    frames.sort_unstable();
    frames.dedup();
    if frames.len() > 1 {
        gathered.skip(format!(
            "the truth is not used: it and the poses are in different frames, {}; a pose of the tanker in the camera's optical \
             frame is needed, with the same frame_id",
            list(&frames)
        ));
        return false;
    }
    let children = gathered.child_frames.get(&Role::Truth);
    let other = children.into_iter().flatten();
    let other = other
        .map(|(child, _)| child)
        .find(|child| **child != settings.tanker_frame_id);
    if let Some(other) = other.cloned() {
        gathered.skip(format!(
            "the truth is not used: it is the pose of {:?}, the tanker is {:?} (parameter tanker_frame_id)",
            clip(&other),
            clip(&settings.tanker_frame_id)
        ));
        return false;
    }
    true
}
