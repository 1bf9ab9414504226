//! Lasting faults: each is logged once when it begins and once when it ends.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Problems around the node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    /// A publisher or subscriber with incompatible quality of service.
    IncompatibleQos,
    /// A publisher or subscriber has another message type.
    WrongType,
    /// There is a publisher, but no message arrives.
    SilentPublisher,
    /// There is a camera, or there were detections, but none arrive now.
    NoDetections,
    /// Detections arrive, but camera info never has.
    NoCameraInfo,
    /// Detections arrive, but the steady camera info has stopped.
    StaleCameraInfo,
    /// Detections and camera info name different frames.
    FrameMismatch,
    /// A marker is left out of too many frames.
    SuspectMarker,
    /// Too many frames are not trusted or leave a marker out.
    NotTrusted,
    /// Residuals are larger or smaller than the sigmas predict.
    Sigma,
    /// The tanker stands off its nominal attitude.
    UnexpectedAttitude,
    /// Frames have no prior from the attitudes that both aircraft report.
    NoReportedAttitude,
    /// These attitudes contradict what is seen.
    AttitudeContradiction,
    /// Samples of an aircraft's attitude cannot be used.
    UnusableAttitude,
    /// Images are from the future, or from long ago.
    ClockOffset,
    /// Stamps of detections jump back, or far ahead.
    StampJump,
    /// Simulated time jumps back or far ahead, or the system clock is set back.
    ClockJump,
    /// Simulated time is enabled, but no `/clock` arrives.
    NoClock,
    /// Samples that cannot be decoded.
    Undecodable,
    /// More samples waited than the topic's depth.
    LostInput,
    /// Something could not be published.
    DroppedOutput,
}

/// How long a single event counts as lasting.
const EVENT: Duration = Duration::from_secs(3);
/// How long a fault that samples show lasts without samples.
const SHOWN_BY_FRAMES: Duration = Duration::from_secs(10);
/// How long it lasts once a sample shows that it is over: two detectors may take turns.
const OVER: Duration = Duration::from_secs(1);

impl Fault {
    /// All of them.
    pub const ALL: [Self; 21] = [
        Self::IncompatibleQos,
        Self::WrongType,
        Self::SilentPublisher,
        Self::NoDetections,
        Self::NoCameraInfo,
        Self::StaleCameraInfo,
        Self::FrameMismatch,
        Self::SuspectMarker,
        Self::NotTrusted,
        Self::Sigma,
        Self::UnexpectedAttitude,
        Self::NoReportedAttitude,
        Self::AttitudeContradiction,
        Self::UnusableAttitude,
        Self::ClockOffset,
        Self::StampJump,
        Self::ClockJump,
        Self::NoClock,
        Self::Undecodable,
        Self::LostInput,
        Self::DroppedOutput,
    ];

    /// Returns its key in `/diagnostics` and in the log.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::IncompatibleQos => "incompatible_qos",
            Self::WrongType => "wrong_type",
            Self::SilentPublisher => "silent_publisher",
            Self::NoDetections => "no_detections",
            Self::NoCameraInfo => "no_camera_info",
            Self::StaleCameraInfo => "stale_camera_info",
            Self::FrameMismatch => "frame_mismatch",
            Self::SuspectMarker => "suspect_marker",
            Self::NotTrusted => "not_trusted",
            Self::Sigma => "sigma",
            Self::UnexpectedAttitude => "unexpected_attitude",
            Self::NoReportedAttitude => "no_reported_attitude",
            Self::AttitudeContradiction => "attitude_contradiction",
            Self::UnusableAttitude => "unusable_attitude",
            Self::ClockOffset => "clock_offset",
            Self::StampJump => "stamp_jump",
            Self::ClockJump => "clock_jump",
            Self::NoClock => "no_clock",
            Self::Undecodable => "undecodable",
            Self::LostInput => "lost_input",
            Self::DroppedOutput => "dropped_output",
        }
    }

    /// Returns how long it lasts after it was last seen.
    const fn lasts(self) -> Duration {
        match self {
            Self::StampJump | Self::ClockJump | Self::LostInput | Self::DroppedOutput => EVENT,
            Self::NoCameraInfo
            | Self::FrameMismatch
            | Self::SuspectMarker
            | Self::NotTrusted
            | Self::Sigma
            | Self::NoReportedAttitude
            | Self::AttitudeContradiction
            | Self::UnusableAttitude
            | Self::ClockOffset
            | Self::Undecodable => SHOWN_BY_FRAMES,
            // Looked for every second.
            _ => Duration::ZERO,
        }
    }
}

#[derive(Debug)]
struct Open {
    latest: String,
    /// Length of the part that is repeated when the fault ends; the rest applies only while it lasts.
    lasting: usize,
    since: Instant,
    seen: Instant,
    over: bool,
}

impl Open {
    /// Returns the log line for its end: duration until it was last seen, and its last message.
    fn epitaph(&self, fault: Fault, now: Instant) -> String {
        let (name, latest) = (fault.name(), &self.latest[..self.lasting]);
        let seconds = self
            .seen
            .saturating_duration_since(self.since)
            .as_secs_f64();
        let unseen = now.saturating_duration_since(self.seen).as_secs_f64();
        let ago = if unseen < 2.0 * OVER.as_secs_f64() {
            String::new()
        } else {
            format!(" (last seen {unseen:.0} s ago)")
        };
        format!("{name} is over after {seconds:.1} s{ago}: {latest}")
    }
}

/// The active faults.
#[derive(Debug, Default)]
pub struct Faults {
    open: BTreeMap<(Fault, String), Open>,
}

impl Faults {
    /// Records a fault of which there is one at a time, with its message.
    pub fn see(&mut self, fault: Fault, words: &str, now: Instant) {
        self.see_of(fault, "", words, now);
    }

    /// Records a fault of something of which there are many.
    pub fn see_of(&mut self, fault: Fault, of: &str, words: &str, now: Instant) {
        self.see_while(fault, of, words, "", now);
    }

    /// Records a fault with its consequence while it lasts, which the log line for its end omits.
    pub fn see_while(&mut self, fault: Fault, of: &str, words: &str, doing: &str, now: Instant) {
        let key = (fault, of.to_owned());
        let lasting = words.len();
        let words = format!("{words}{doing}");
        if let Some(open) = self.open.get_mut(&key) {
            open.seen = now;
            open.over = false;
            open.latest = words;
            open.lasting = lasting;
            return;
        }
        log::warn!("{}: {words}", fault.name());
        let open = Open {
            latest: words,
            lasting,
            since: now,
            seen: now,
            over: false,
        };
        self.open.insert(key, open);
    }

    /// Records that a fault seems to be over.
    pub fn end(&mut self, fault: Fault) {
        for ((_, _), open) in self.open.iter_mut().filter(|((kind, _), _)| *kind == fault) {
            open.over = true;
        }
    }

    /// Records that a fault of something of which there are many seems to be over.
    pub fn end_of(&mut self, fault: Fault, of: &str) {
        // Called for every sample, nearly always without an effect.
        if self.open.is_empty() {
            return;
        }
        if let Some(open) = self.open.get_mut(&(fault, of.to_owned())) {
            open.over = true;
        }
    }

    /// Ends those that have not been seen for as long as they last.
    pub fn end_unseen(&mut self, now: Instant) {
        self.open.retain(|(fault, _), open| {
            let lasts = if open.over { OVER } else { fault.lasts() };
            let stays = now.saturating_duration_since(open.seen) <= lasts;
            if !stays {
                log::info!("{}", open.epitaph(*fault, now));
            }
            stays
        });
    }

    /// Returns the messages of all active faults, in the order of [`Fault::ALL`].
    pub fn iter(&self) -> impl Iterator<Item = (Fault, &str)> {
        self.open
            .iter()
            .map(|((fault, _), open)| (*fault, open.latest.as_str()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn open(faults: &Faults) -> Vec<(Fault, &str)> {
        faults.iter().collect()
    }

    #[test]
    fn fault_lasts_while_it_is_seen_and_shows_its_latest_words() {
        let (mut faults, start) = (Faults::default(), Instant::now());
        faults.see(Fault::NoDetections, "none", start);
        faults.end_unseen(start);
        assert_eq!(open(&faults), [(Fault::NoDetections, "none")]);
        faults.see(Fault::NoDetections, "still none", start + SECOND);
        faults.end_unseen(start + SECOND);
        assert_eq!(open(&faults), [(Fault::NoDetections, "still none")]);
        faults.end_unseen(start + 2 * SECOND);
        assert_eq!(open(&faults), []);
    }

    #[test]
    fn event_is_shown_for_a_while_and_faults_of_many_things_end_apart() {
        let (mut faults, start) = (Faults::default(), Instant::now());
        faults.see(Fault::StampJump, "back", start);
        faults.see_of(Fault::DroppedOutput, "/pose", "full", start);
        faults.see_of(Fault::DroppedOutput, "/status", "full", start);
        faults.see_of(Fault::DroppedOutput, "/pose", "full", start + 2 * SECOND);
        faults.end_unseen(start + 3 * SECOND);
        assert_eq!(open(&faults).len(), 3);
        faults.end_unseen(start + 4 * SECOND);
        assert_eq!(open(&faults), [(Fault::DroppedOutput, "full")]);
    }

    #[test]
    fn end_tells_the_time_until_a_fault_was_seen_last_in_its_last_words() {
        let (mut faults, start) = (Faults::default(), Instant::now());
        faults.see(Fault::SuspectMarker, "all 31 poses", start);
        faults.see(Fault::SuspectMarker, "all 90 poses", start + 6 * SECOND);
        let open = &faults.open[&(Fault::SuspectMarker, String::new())];
        assert_eq!(
            open.epitaph(Fault::SuspectMarker, start + 17 * SECOND),
            "suspect_marker is over after 6.0 s (last seen 11 s ago): all 90 poses"
        );
        assert_eq!(
            open.epitaph(Fault::SuspectMarker, start + 7 * SECOND),
            "suspect_marker is over after 6.0 s: all 90 poses"
        );
    }

    #[test]
    fn end_does_not_repeat_what_the_fault_did_while_it_lasted() {
        let (mut faults, start) = (Faults::default(), Instant::now());
        let (fault, doing) = (Fault::UnexpectedAttitude, "; outputs are held back");
        faults.see_while(fault, "", "20° off", doing, start);
        assert_eq!(open(&faults), [(fault, "20° off; outputs are held back")]);
        let ended = &faults.open[&(fault, String::new())];
        assert_eq!(
            ended.epitaph(fault, start),
            "unexpected_attitude is over after 0.0 s: 20° off"
        );
    }

    #[test]
    fn fault_that_comes_and_goes_with_every_frame_is_one_fault() {
        let (mut faults, start) = (Faults::default(), Instant::now());
        let frame = Duration::from_millis(20);
        for i in 0..1000 {
            faults.see(Fault::FrameMismatch, &i.to_string(), start + 2 * i * frame);
            faults.end(Fault::FrameMismatch);
            faults.end_unseen(start + (2 * i + 1) * frame);
            let words = i.to_string();
            assert_eq!(open(&faults), [(Fault::FrameMismatch, words.as_str())]);
        }
        assert_eq!(
            faults.open.values().next().map(|open| open.since),
            Some(start)
        );
        faults.end_unseen(start + 2000 * frame + SECOND);
        assert_eq!(open(&faults), []);
    }
}
