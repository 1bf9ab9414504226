//! The node's health once a second, for `rqt_robot_monitor` and the like (REP-107).

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use crate::pipeline::{OutcomeCode, TrackCode};
use crate::text::{clip, line, quoted};
use crate::tracking::TrackOutcome;

use super::health::{Fault, Faults, WINDOW_S};
use crate::messages::{DiagnosticArray, DiagnosticStatus, Header, KeyValue, Time};

/// What is known of the camera.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum CameraState {
    /// No camera info has arrived.
    #[default]
    Missing,
    /// The latest one can be used.
    Valid {
        /// Its frame.
        frame_id: String,
        /// Image size in px, if it says one.
        size_px: Option<(u32, u32)>,
    },
    /// The latest one cannot be used.
    Invalid {
        /// Why.
        reason: String,
    },
}

impl fmt::Display for CameraState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => write!(f, "none received"),
            Self::Valid {
                frame_id,
                size_px: Some((width, height)),
            } => {
                write!(f, "valid, {width}x{height} px, frame {}", quoted(frame_id))
            }
            Self::Valid {
                frame_id,
                size_px: None,
            } => write!(f, "valid, frame {}", quoted(frame_id)),
            Self::Invalid { reason } => write!(f, "invalid: {reason}"),
        }
    }
}

/// Counts since the node's start.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Tally {
    /// Frames by outcome, in the order of [`OutcomeCode::ALL`].
    outcomes: [u64; OutcomeCode::ALL.len()],
    /// Frames by what they did to the track, in the order of [`TrackCode::ALL`].
    tracks: [u64; TrackCode::ALL.len()],
    /// Camera infos received.
    pub camera_infos: u64,
    /// Detections received while the node was not active; not processed.
    pub unanswered: u64,
    /// Samples that could not be decoded.
    pub undecodable: u64,
    /// Samples that were skipped because more waited than the topic's depth.
    pub lost: u64,
    /// Messages not sent because a subscriber did not keep up, or for an error.
    pub dropped: u64,
    /// Topics with such messages since the last report, and why.
    dropping: BTreeMap<String, String>,
}

impl Tally {
    /// Counts a frame.
    pub const fn count(&mut self, outcome: OutcomeCode) {
        self.outcomes[outcome as usize] += 1;
    }

    /// Counts what a frame did to the track.
    pub const fn count_track(&mut self, track: TrackCode) {
        self.tracks[track as usize] += 1;
    }

    /// Counts a message that was not sent on this topic.
    pub fn drop_one(&mut self, topic: &str, reason: String) {
        self.dropped += 1;
        self.dropping.insert(topic.to_owned(), reason);
    }

    /// Returns the topics on which messages were not sent since this was asked last, and why.
    pub fn take_dropping(&mut self) -> Vec<(String, String)> {
        std::mem::take(&mut self.dropping).into_iter().collect()
    }

    /// Returns how many frames had this outcome.
    #[must_use]
    pub const fn of(&self, outcome: OutcomeCode) -> u64 {
        self.outcomes[outcome as usize]
    }

    /// Returns how many frames there were.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.outcomes.iter().sum()
    }
}

/// What the report needs beside the counts.
#[derive(Debug, Clone)]
pub struct Situation<'a> {
    /// The node's time.
    pub now: Time,
    /// The node's name without its namespace.
    pub node: &'a str,
    /// Whether detections are answered.
    pub active: bool,
    /// Topic of the detections.
    pub input: &'a str,
    /// Name of the marker map.
    pub marker_map: &'a str,
    /// What is known of the camera.
    pub camera: &'a CameraState,
    /// Message of the last refusal since the last report.
    pub last_refusal: Option<&'a str>,
    /// What the last frame did to the track.
    pub track: Option<&'a TrackOutcome>,
    /// Publishers of the detections in the graph.
    pub publishers: usize,
    /// Longest time from a message to its outcome since the last report.
    pub slowest: Duration,
    /// Median and 99th percentile from a message to the last thing published for it, s.
    pub latency_s: Option<(f64, f64)>,
    /// The same from the stamp of an image to its pose, by the node's time, s.
    pub age_s: Option<(f64, f64)>,
    /// What is wrong around the node.
    pub faults: &'a Faults,
}

/// Turns counts into reports; remembers those of the last report for the rates.
#[derive(Debug, Default)]
pub struct Reporter {
    previous: Tally,
}

impl Reporter {
    /// Returns the report of the time since the last one.
    pub fn report(
        &mut self,
        tally: &Tally,
        elapsed: Duration,
        situation: &Situation,
    ) -> DiagnosticArray {
        let frames = tally.frames().saturating_sub(self.previous.frames());
        let estimates = tally
            .of(OutcomeCode::Ok)
            .saturating_sub(self.previous.of(OutcomeCode::Ok));
        let dropped = tally.dropped.saturating_sub(self.previous.dropped);
        let (level, message) = judge(frames, estimates, dropped, situation);
        let camera_infos = tally
            .camera_infos
            .saturating_sub(self.previous.camera_infos);
        let rate = |count: u64| format!("{:.1}", count as f64 / elapsed.as_secs_f64().max(1e-3));
        let rates = [
            ("frame_rate_hz", rate(frames)),
            ("estimate_rate_hz", rate(estimates)),
            ("camera_info_rate_hz", rate(camera_infos)),
        ];
        let status = DiagnosticStatus {
            level,
            name: format!("{}: estimation", situation.node),
            message: line(&message).into_owned(),
            hardware_id: hardware_id(situation.camera),
            values: values(tally, rates, situation),
        };
        self.previous = tally.clone();
        DiagnosticArray {
            header: Header {
                stamp: situation.now,
                ..Header::default()
            },
            status: vec![status, faults(situation)],
        }
    }
}

/// Returns the level and the summary of the last period.
fn judge(frames: u64, estimates: u64, dropped: u64, situation: &Situation) -> (u8, String) {
    let refused = frames.saturating_sub(estimates);
    let input = situation.input;
    let why = situation.last_refusal.unwrap_or("see status");
    if !situation.active {
        let message = "inactive: detections are not answered".to_owned();
        (DiagnosticStatus::OK, message)
    } else if frames == 0 {
        let message = match situation.publishers {
            0 => format!("no {input}: no publisher"),
            n => {
                format!("no {input}, although {n} publisher(s) exist: check type, QoS and network")
            }
        };
        (DiagnosticStatus::STALE, message)
    } else if estimates == 0 {
        (
            DiagnosticStatus::ERROR,
            format!("all {frames} frames refused: {why}"),
        )
    } else if refused > 0 {
        (
            DiagnosticStatus::WARN,
            format!("{refused} of {frames} frames refused: {why}"),
        )
    } else if dropped > 0 {
        (
            DiagnosticStatus::WARN,
            format!("{dropped} messages dropped: see the faults"),
        )
    } else {
        (DiagnosticStatus::OK, format!("{estimates} estimates"))
    }
}

/// Returns the camera's frame, by which people know it; aggregators want something in any case.
fn hardware_id(camera: &CameraState) -> String {
    match camera {
        CameraState::Valid { frame_id, .. } if !frame_id.is_empty() => clip(frame_id),
        _ => "none".to_owned(),
    }
}

/// Returns what is wrong around the node, with a key for all that could be.
fn faults(situation: &Situation) -> DiagnosticStatus {
    let words = |wanted: Fault| {
        let of_kind = situation
            .faults
            .iter()
            .filter(|(fault, _)| *fault == wanted)
            .map(|(_, words)| words);
        of_kind.collect::<Vec<_>>().join("; ")
    };
    let names: Vec<&str> = situation.faults.iter().map(|(f, _)| f.name()).collect();
    let (level, message) = match situation.faults.iter().next() {
        None => (DiagnosticStatus::OK, "no faults".to_owned()),
        Some((fault, words)) if names.len() == 1 => {
            (DiagnosticStatus::WARN, format!("{}: {words}", fault.name()))
        }
        Some(_) => (
            DiagnosticStatus::WARN,
            format!("{} faults: {}", names.len(), names.join(", ")),
        ),
    };
    DiagnosticStatus {
        level,
        name: format!("{}: faults", situation.node),
        message: line(&message).into_owned(),
        hardware_id: hardware_id(situation.camera),
        values: Fault::ALL
            .iter()
            .map(|fault| KeyValue {
                key: fault.name().to_owned(),
                value: line(&words(*fault)).into_owned(),
            })
            .collect(),
    }
}

fn values(tally: &Tally, rates: [(&str, String); 3], situation: &Situation) -> Vec<KeyValue> {
    let ms = |seconds: Option<f64>| seconds.map_or_else(String::new, |s| format!("{:.3}", s * 1e3));
    let refused = tally.frames() - tally.of(OutcomeCode::Ok);
    let mut pairs = vec![
        ("frames".to_owned(), tally.frames().to_string()),
        (
            "estimates".to_owned(),
            tally.of(OutcomeCode::Ok).to_string(),
        ),
        ("refusals".to_owned(), refused.to_string()),
        (
            "slowest_solve_ms".to_owned(),
            format!("{:.3}", situation.slowest.as_secs_f64() * 1e3),
        ),
        ("camera_info".to_owned(), situation.camera.to_string()),
        ("camera_infos".to_owned(), tally.camera_infos.to_string()),
        ("marker_map".to_owned(), clip(situation.marker_map)),
        (
            "last_message".to_owned(),
            situation.last_refusal.unwrap_or_default().to_owned(),
        ),
        ("publishers".to_owned(), situation.publishers.to_string()),
        ("unanswered".to_owned(), tally.unanswered.to_string()),
        ("undecodable".to_owned(), tally.undecodable.to_string()),
        ("lost".to_owned(), tally.lost.to_string()),
        ("dropped".to_owned(), tally.dropped.to_string()),
    ];
    let (latency, age) = (situation.latency_s, situation.age_s);
    let measured = [
        ("latency_p50_ms", ms(latency.map(|(p50, _)| p50))),
        ("latency_p99_ms", ms(latency.map(|(_, p99)| p99))),
        ("image_age_p50_ms", ms(age.map(|(p50, _)| p50))),
        ("image_age_p99_ms", ms(age.map(|(_, p99)| p99))),
        ("window_s", WINDOW_S.to_string()),
    ];
    let owned = |(key, value): (&str, String)| (key.to_owned(), value);
    pairs.extend(rates.into_iter().map(owned));
    pairs.extend(measured.into_iter().map(owned));
    // All of them, also those at zero: a plot needs its key from the beginning.
    pairs.extend(
        OutcomeCode::ALL
            .iter()
            .filter(|outcome| **outcome != OutcomeCode::Ok)
            .map(|outcome| {
                (
                    format!("refusals.{}", outcome.name()),
                    tally.of(*outcome).to_string(),
                )
            }),
    );
    let track = situation
        .track
        .map_or("none".to_owned(), ToString::to_string);
    pairs.push(("track".to_owned(), track));
    pairs.extend(TrackCode::ALL.iter().map(|code| {
        let count = tally.tracks[*code as usize];
        (format!("track.{}", code.name()), count.to_string())
    }));
    pairs
        .into_iter()
        .map(|(key, value)| KeyValue {
            key,
            value: line(&value).into_owned(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn situation<'a>(camera: &'a CameraState, faults: &'a Faults) -> Situation<'a> {
        Situation {
            now: Time { sec: 7, nanosec: 8 },
            node: "tanker_pose",
            active: true,
            input: "feature_points",
            marker_map: "paper",
            camera,
            last_refusal: Some("need 4 points, got 3"),
            track: None,
            publishers: 1,
            slowest: Duration::from_micros(1500),
            latency_s: Some((0.0004, 0.0025)),
            age_s: None,
            faults,
        }
    }

    fn report(reporter: &mut Reporter, tally: &Tally) -> DiagnosticStatus {
        let (camera, faults) = (CameraState::Missing, Faults::default());
        reporter
            .report(tally, SECOND, &situation(&camera, &faults))
            .status
            .remove(0)
    }

    fn value<'a>(status: &'a DiagnosticStatus, key: &str) -> &'a str {
        &status
            .values
            .iter()
            .find(|pair| pair.key == key)
            .expect("the key is there")
            .value
    }

    #[test]
    fn level_follows_the_last_period_and_counts_go_on() {
        let (mut reporter, mut tally) = (Reporter::default(), Tally::default());
        assert_eq!(report(&mut reporter, &tally).level, DiagnosticStatus::STALE);

        tally.count(OutcomeCode::TooFewPoints);
        let status = report(&mut reporter, &tally);
        assert_eq!(status.level, DiagnosticStatus::ERROR);
        assert!(
            status.message.contains("need 4 points"),
            "{}",
            status.message
        );

        tally.count(OutcomeCode::Ok);
        tally.count(OutcomeCode::TooFewPoints);
        assert_eq!(report(&mut reporter, &tally).level, DiagnosticStatus::WARN);

        tally.count(OutcomeCode::Ok);
        let status = report(&mut reporter, &tally);
        assert_eq!(status.level, DiagnosticStatus::OK);
        assert_eq!(value(&status, "frames"), "4");
        assert_eq!(value(&status, "estimates"), "2");
        assert_eq!(value(&status, "refusals.TOO_FEW_POINTS"), "2");
        assert_eq!(value(&status, "refusals.AMBIGUOUS"), "0");
        assert_eq!(value(&status, "frame_rate_hz"), "1.0");
        assert_eq!(value(&status, "slowest_solve_ms"), "1.500");
        assert_eq!(value(&status, "latency_p50_ms"), "0.400");
        assert_eq!(value(&status, "latency_p99_ms"), "2.500");
        assert_eq!(value(&status, "image_age_p50_ms"), "");
    }

    #[test]
    fn dropped_messages_are_warned_of() {
        let (mut reporter, mut tally) = (Reporter::default(), Tally::default());
        tally.count(OutcomeCode::Ok);
        tally.dropped = 3;
        assert_eq!(report(&mut reporter, &tally).level, DiagnosticStatus::WARN);
    }

    #[test]
    fn faults_are_shown_by_their_keys_and_none_is_ok() {
        let (camera, mut faults) = (CameraState::Missing, Faults::default());
        let status = super::faults(&situation(&camera, &faults));
        assert_eq!(status.level, DiagnosticStatus::OK);
        assert!(status.values.iter().all(|pair| pair.value.is_empty()));
        assert_eq!(status.values.len(), Fault::ALL.len());

        let now = std::time::Instant::now();
        faults.see_of(Fault::DroppedOutput, "/pose", "pose", now);
        faults.see_of(Fault::DroppedOutput, "/status", "status", now);
        let status = super::faults(&situation(&camera, &faults));
        assert_eq!(status.level, DiagnosticStatus::WARN);
        assert_eq!(value(&status, "dropped_output"), "pose; status");
        assert_eq!(value(&status, "stamp_jump"), "");
    }

    #[test]
    fn name_is_node_and_subtask() {
        let status = report(&mut Reporter::default(), &Tally::default());
        assert_eq!(status.name, "tanker_pose: estimation");
    }
}
