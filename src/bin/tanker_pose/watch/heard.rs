//! The latest messages of a node, and their times.

use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use tanker_pose::pipeline::OutcomeCode;
use tanker_pose::ros::convert::isometry;
use tanker_pose::ros::messages::{
    DiagnosticArray, DiagnosticStatus, EstimatorStatus, Odometry, PoseWithCovarianceStamped,
};

use super::reading::Reading;

/// What counts as now: frames are counted over it, and a pose that is older is not shown any more.
pub const RECENT: Duration = Duration::from_secs(1);
/// The reports of `/diagnostics` come once a second; two of them may be lost.
pub const REPORT_EVERY: Duration = Duration::from_secs(3);

/// One answered frame.
#[derive(Debug)]
struct Answer {
    at: Instant,
    outcome: u8,
    rejected_ids: Vec<u32>,
}

/// The frames of the last second.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// All of them.
    pub frames: usize,
    /// By the number of the outcome.
    pub outcomes: BTreeMap<u8, usize>,
    /// In how many a marker was left out as wrong, by its id.
    pub left_out: BTreeMap<u32, usize>,
}

/// The latest of each kind.
#[derive(Debug)]
pub struct Heard {
    /// Since when messages were received.
    since: Instant,
    pose: Option<(Reading, Instant)>,
    status: Option<(EstimatorStatus, Instant)>,
    velocity_mps: Option<([f64; 3], Instant)>,
    estimation: Option<(DiagnosticStatus, Instant)>,
    faults: Vec<(String, String)>,
    answers: VecDeque<Answer>,
}

impl Heard {
    /// Returns an empty record that starts now.
    pub const fn new(since: Instant) -> Self {
        Self {
            since,
            pose: None,
            status: None,
            velocity_mps: None,
            estimation: None,
            faults: Vec::new(),
            answers: VecDeque::new(),
        }
    }

    /// Returns how long messages have been received.
    pub fn listened(&self, now: Instant) -> Duration {
        now.saturating_duration_since(self.since)
    }

    /// Records a pose.
    pub fn on_pose(&mut self, message: &PoseWithCovarianceStamped, now: Instant) {
        if let Some(reading) = Reading::of(message) {
            self.pose = Some((reading, now));
        }
    }

    /// Records a frame's outcome.
    pub fn on_status(&mut self, message: EstimatorStatus, now: Instant) {
        self.answers.push_back(Answer {
            at: now,
            outcome: message.outcome,
            rejected_ids: message.rejected_ids.clone(),
        });
        while self
            .answers
            .front()
            .is_some_and(|first| now - first.at > RECENT)
        {
            self.answers.pop_front();
        }
        self.status = Some((message, now));
    }

    /// Records the track.
    pub fn on_odometry(&mut self, message: &Odometry, now: Instant) {
        let twist = &message.twist.twist.linear;
        // The twist stands in the axes of the tanker, the pose in those of the camera.
        self.velocity_mps = isometry(&message.pose.pose)
            .map(|pose| (pose.rotation * Vector3::new(twist.x, twist.y, twist.z)).into())
            .map(|velocity| (velocity, now));
    }

    /// Records a report of the node's health.
    pub fn on_diagnostics(&mut self, message: DiagnosticArray, now: Instant) {
        for status in message.status {
            if status.name.ends_with(": estimation") {
                self.estimation = Some((status, now));
            } else if status.name.ends_with(": faults") {
                let lasting = status
                    .values
                    .into_iter()
                    .filter(|pair| !pair.value.is_empty());
                self.faults = lasting.map(|pair| (pair.key, pair.value)).collect();
            }
        }
    }

    /// Returns the latest pose and its age.
    pub fn pose(&self, now: Instant) -> Option<(&Reading, Duration)> {
        aged(self.pose.as_ref(), now)
    }

    /// Returns the latest status, if the frame was answered within the last second.
    pub fn status(&self, now: Instant) -> Option<&EstimatorStatus> {
        recent(self.status.as_ref(), now, RECENT)
    }

    /// Returns how long ago the latest frame was answered.
    pub fn silence(&self, now: Instant) -> Option<Duration> {
        aged(self.status.as_ref(), now).map(|(_, age)| age)
    }

    /// Returns the velocity of the tanker in the camera, right, down, ahead, while there is a track.
    pub fn velocity_mps(&self, now: Instant) -> Option<&[f64; 3]> {
        recent(self.velocity_mps.as_ref(), now, RECENT)
    }

    /// Returns the latest report on the estimation, while reports come.
    pub fn estimation(&self, now: Instant) -> Option<&DiagnosticStatus> {
        recent(self.estimation.as_ref(), now, REPORT_EVERY)
    }

    /// Returns that report, if all of the second it is about lies after the latest answered frame.
    pub fn estimation_since_last_frame(&self, now: Instant) -> Option<&DiagnosticStatus> {
        let (_, reported) = self.estimation.as_ref()?;
        let begins_after = |(_, answered): &(_, Instant)| *reported >= *answered + RECENT;
        let is_about_silence = self.status.as_ref().is_none_or(begins_after);
        self.estimation(now).filter(|_| is_about_silence)
    }

    /// Returns the faults of the latest report, by key; `None` when reports do not come.
    pub fn faults(&self, now: Instant) -> Option<&[(String, String)]> {
        self.estimation(now).map(|_| self.faults.as_slice())
    }

    /// Returns what became of the frames of the last second.
    pub fn counts(&self, now: Instant) -> Counts {
        let mut counts = Counts::default();
        for answer in self
            .answers
            .iter()
            .filter(|answer| now - answer.at <= RECENT)
        {
            counts.frames += 1;
            *counts.outcomes.entry(answer.outcome).or_default() += 1;
            for id in &answer.rejected_ids {
                *counts.left_out.entry(*id).or_default() += 1;
            }
        }
        counts
    }
}

fn aged<T>(said: Option<&(T, Instant)>, now: Instant) -> Option<(&T, Duration)> {
    said.map(|(what, at)| (what, now.saturating_duration_since(*at)))
}

fn recent<T>(said: Option<&(T, Instant)>, now: Instant, limit: Duration) -> Option<&T> {
    aged(said, now)
        .filter(|(_, age)| *age <= limit)
        .map(|(what, _)| what)
}

/// Returns the name of an outcome.
pub fn outcome_name(number: u8) -> String {
    OutcomeCode::ALL
        .iter()
        .find(|code| code.number() == number)
        .map_or_else(
            || format!("outcome {number}"),
            |code| code.name().to_owned(),
        )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(outcome: u8, rejected_ids: &[u32]) -> EstimatorStatus {
        EstimatorStatus {
            outcome,
            rejected_ids: rejected_ids.to_vec(),
            ..EstimatorStatus::default()
        }
    }

    #[test]
    fn report_about_a_second_with_frames_does_not_explain_their_absence() {
        let start = Instant::now();
        let mut heard = Heard::new(start);
        let report = |message: &str| DiagnosticArray {
            status: vec![DiagnosticStatus {
                name: "tanker_pose: estimation".to_owned(),
                message: message.to_owned(),
                ..DiagnosticStatus::default()
            }],
            ..DiagnosticArray::default()
        };
        heard.on_status(status(0, &[]), start);
        heard.on_diagnostics(report("30 estimates"), start + RECENT / 2);
        let later = start + 2 * RECENT;
        assert!(heard.estimation(later).is_some());
        assert!(heard.estimation_since_last_frame(later).is_none());
        heard.on_diagnostics(report("no feature_points: no publisher"), start + RECENT);
        let about_silence = heard.estimation_since_last_frame(later);
        assert!(about_silence.is_some_and(|report| report.message.contains("no publisher")));
    }

    #[test]
    fn frames_of_the_last_second_are_counted_by_outcome_and_left_out_marker() {
        let start = Instant::now();
        let mut heard = Heard::new(start);
        for k in 0..100_u32 {
            let rejected: &[u32] = if k % 10 == 0 { &[5] } else { &[] };
            let outcome = if k % 4 == 3 { 14 } else { 0 };
            heard.on_status(
                status(outcome, rejected),
                start + k * Duration::from_millis(50),
            );
        }
        // Twenty frames a second, and the one that lies exactly a second back.
        let counts = heard.counts(start + Duration::from_millis(99 * 50));
        assert_eq!(counts.frames, 21);
        assert_eq!(counts.outcomes, BTreeMap::from([(0, 15), (14, 6)]));
        assert_eq!(counts.left_out, BTreeMap::from([(5, 2)]));
        let later = start + Duration::from_secs(60);
        assert_eq!(heard.counts(later), Counts::default());
        assert!(heard.status(later).is_none());
    }
}
