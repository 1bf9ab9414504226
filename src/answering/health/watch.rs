//! Detects faults around the node, from arrivals, refusals and the graph.

use std::fmt;
use std::time::{Duration, Instant};

use nalgebra::UnitQuaternion;

use super::arrivals::{Arrivals, SILENCE, is_long};
use super::{
    Attitude, ClockSilence, Fault, Faults, ImageAge, Jumps, Latency, Residuals, StampAge,
    Unexpected,
};
use crate::messages::Time;
use crate::pipeline::{FrameOutcome, Pipeline};
use crate::refuelling::ExpectedAttitude;
use ros2_node::graph::{Graph, Misfit};

/// How long detections may arrive before the first camera info.
const GRACE: Duration = Duration::from_secs(2);
/// Missing detections are logged after this long.
const WAIT: Duration = Duration::from_secs(3);
/// How often the residuals of the last seconds are evaluated.
const BETWEEN_SIGMAS: Duration = Duration::from_millis(200);
/// Limit of endpoints that are named; a foreign graph may have any number.
const MOST_MISFITS: usize = 16;

/// State of graph and clocks, once a second.
pub struct Second<'a> {
    /// The other ends of the node's topics.
    pub graph: &'a Graph,
    /// How `/clock` jumped, if it did.
    pub clock_jump: Option<String>,
    /// Message about the system clock, if there is one.
    pub system_clock: Option<String>,
    /// Since when no simulated time has arrived, if it is enabled.
    pub clock_silence: Option<ClockSilence>,
    /// Topics on which something was dropped, and why.
    pub dropped: Vec<(String, String)>,
}

/// Notices faults.
#[derive(Debug)]
pub struct Watch {
    /// The active faults.
    pub faults: Faults,
    /// From a message to the last thing published for it.
    pub latency: Latency,
    /// From the stamp of an image to the pose, in the node's time.
    pub age: Latency,
    detections_topic: String,
    camera_topic: String,
    begin: Instant,
    detections: Arrivals,
    camera: Arrivals,
    /// Publishers of camera info that fit, a second ago.
    cameras: usize,
    stamps: Jumps,
    residuals: Residuals,
    sigmas_seen: Option<Instant>,
    stamp_age: StampAge,
    /// Checks the tanker's attitude; `None` while nothing depends on it.
    attitude: Option<Attitude>,
    /// Whether outputs are held back while that is unexpected.
    holds_outputs: bool,
    waiting_said: bool,
    without_camera: Option<WithoutCamera>,
}

/// Refusals for lack of a camera info.
#[derive(Debug)]
struct WithoutCamera {
    since: Instant,
    /// The latest one that was not reported.
    latest: Option<String>,
}

impl Watch {
    /// Returns a watch over the inputs with these absolute names.
    #[must_use]
    pub fn new(detections_topic: String, camera_topic: String, now: Instant) -> Self {
        Self {
            faults: Faults::default(),
            latency: Latency::default(),
            age: Latency::default(),
            detections_topic,
            camera_topic,
            begin: now,
            detections: Arrivals::default(),
            camera: Arrivals::default(),
            cameras: 0,
            stamps: Jumps::default(),
            residuals: Residuals::default(),
            sigmas_seen: None,
            stamp_age: StampAge::default(),
            attitude: None,
            holds_outputs: false,
            waiting_said: false,
            without_camera: None,
        }
    }

    /// Records the arrival of detections of any type.
    pub fn on_detections(&mut self, now: Instant) {
        self.detections.take(now);
    }

    /// Records the arrival of a camera info.
    pub fn on_camera_info(&mut self, now: Instant) {
        self.camera.take(now);
        self.without_camera = None;
        self.faults.end(Fault::NoCameraInfo);
    }

    /// Records a sample of `topic` that could be decoded.
    pub fn on_decoded(&mut self, topic: &str) {
        self.faults.end_of(Fault::Undecodable, topic);
    }

    /// Records a sample of `topic` that could not.
    pub fn on_undecodable(&mut self, topic: &str, error: &dyn fmt::Display, now: Instant) {
        let words = format!(
            "a message on {topic} cannot be decoded, its publisher may be built with another definition of the type: {error}"
        );
        self.faults.see_of(Fault::Undecodable, topic, &words, now);
    }

    /// Records samples of `topic` that were skipped.
    pub fn on_lost(&mut self, topic: &str, count: u64, now: Instant) {
        if count > 0 {
            let words = format!(
                "{count} message(s) on {topic} were skipped within a second in favour of newer ones: the node was blocked, or they \
                 arrive faster than it can answer"
            );
            self.faults.see_of(Fault::LostInput, topic, &words, now);
        }
    }

    /// Takes what attitude is expected from now on, if anything depends on it, and whether outputs do. Returns whether
    /// it differs from before.
    pub fn expect(&mut self, expected: Option<&ExpectedAttitude>, holds_outputs: bool) -> bool {
        self.holds_outputs = holds_outputs;
        match (&mut self.attitude, expected) {
            (Some(attitude), Some(expected)) => attitude.expect(expected),
            (attitude, expected) => {
                let differs = attitude.is_some() != expected.is_some();
                *attitude = expected.map(|expected| Attitude::new(*expected));
                differs
            }
        }
    }

    /// Discards earlier poses, as the node does.
    pub fn on_reset(&mut self) {
        if let Some(attitude) = &mut self.attitude {
            attitude.begin_anew();
        }
    }

    /// Records the attitude of a trusted pose; returns its deviation if it is unexpected.
    pub fn on_attitude(
        &mut self,
        camera_from_tanker: &UnitQuaternion<f64>,
        now: Instant,
    ) -> Option<Unexpected> {
        let attitude = self.attitude.as_mut()?;
        attitude.take(camera_from_tanker, now);
        attitude.unexpected()
    }

    /// Records the fit of a frame, if it has one: its residuals, and markers that are left out too often.
    pub fn on_outcome(&mut self, outcome: &FrameOutcome, pipeline: &Pipeline, now: Instant) {
        let Some(solution) = outcome.solution() else {
            return;
        };
        let agrees = solution.is_trusted() && solution.excluded.ids().next().is_none();
        self.residuals.take(agrees, &outcome.residuals, now);
        if self.is_time_for_sigmas(now) {
            self.watch_sigmas(pipeline, now);
        }
        self.faults.end(Fault::SuspectMarker);
        for suspect in pipeline.suspect_markers() {
            if outcome.residuals.iter().any(|seen| seen.id == suspect.id) {
                let (of, words) = (suspect.id.to_string(), suspect.to_string());
                self.faults.see_of(Fault::SuspectMarker, &of, &words, now);
            }
        }
    }

    /// Whether it is time to evaluate the residuals again, which takes a median of many numbers.
    fn is_time_for_sigmas(&mut self, now: Instant) -> bool {
        let is_time = self
            .sigmas_seen
            .is_none_or(|seen| now.saturating_duration_since(seen) >= BETWEEN_SIGMAS);
        if is_time {
            self.sigmas_seen = Some(now);
        }
        is_time
    }

    fn watch_sigmas(&mut self, pipeline: &Pipeline, now: Instant) {
        let (sigmas, widened_by) = (pipeline.sigma_factor(), pipeline.widened_by());
        for (fault, words) in [
            (Fault::NotTrusted, self.residuals.in_words(sigmas)),
            (
                Fault::Sigma,
                self.residuals.sigmas_in_words(sigmas, widened_by),
            ),
        ] {
            match words {
                Some(words) => self.faults.see(fault, &words, now),
                None => self.faults.end(fault),
            }
        }
    }

    /// Records the age of an image from the camera's frame.
    pub fn on_age(&mut self, image: ImageAge, now: Instant) {
        match self.stamp_age.take(image, now) {
            Some(Some(words)) => {
                let words = format!("stamps of {} {words}", self.detections_topic);
                self.faults.see(Fault::ClockOffset, &words, now);
            }
            Some(None) => self.faults.end(Fault::ClockOffset),
            None => {}
        }
    }

    /// Records an image from the camera's frame.
    pub fn on_image(&mut self, stamp: Time, now: Instant) {
        self.faults.end(Fault::FrameMismatch);
        if let Some(jump) = self.stamps.take(stamp, now) {
            let topic = &self.detections_topic;
            let words = format!(
                "stamps of {topic} jumped {jump}: two sources alternate, a clock was set, or a recording was restarted"
            );
            self.faults.see(Fault::StampJump, &words, now);
        }
    }

    /// Records whether a frame has its prior from the attitudes that both aircraft report, or why it has none.
    pub fn on_reported_attitude(&mut self, missing: Option<&dyn fmt::Display>, now: Instant) {
        match missing {
            Some(missing) => {
                let words = format!("frames have no prior from reported attitudes: {missing}");
                self.faults.see(Fault::NoReportedAttitude, &words, now);
            }
            None => self.faults.end(Fault::NoReportedAttitude),
        }
    }

    /// Records whether the attitudes that both aircraft report contradict what is seen, or each other.
    pub fn on_attitudes_compared(&mut self, found: Option<&dyn fmt::Display>, now: Instant) {
        match found {
            Some(found) => {
                let words =
                    format!("one of the attitudes that both aircraft report is wrong: {found}");
                let doing = "; outputs in local axes are held back until both agree with the image again, or ~/reset is called";
                self.faults
                    .see_while(Fault::AttitudeContradiction, "", &words, doing, now);
            }
            None => self.faults.end(Fault::AttitudeContradiction),
        }
    }

    /// Records a sample of the attitude of an aircraft, and why it is not used, if it is not.
    pub fn on_attitude_taken(&mut self, of: &str, error: Option<&dyn fmt::Display>, now: Instant) {
        match error {
            Some(error) => {
                let words = format!("samples of the {of}'s attitude are not used: {error}");
                self.faults.see_of(Fault::UnusableAttitude, of, &words, now);
            }
            None => self.faults.end_of(Fault::UnusableAttitude, of),
        }
    }

    /// Records a refusal that reveals a fault around the node.
    pub fn on_refusal(&mut self, fault: Fault, words: &str, now: Instant) {
        if fault == Fault::NoCameraInfo {
            let without = self.without_camera.get_or_insert(WithoutCamera {
                since: now,
                latest: None,
            });
            if now.saturating_duration_since(without.since) < GRACE {
                without.latest = Some(words.to_owned());
                return;
            }
            without.latest = None;
            let words = self.without_camera_info(words);
            self.faults.see(fault, &words, now);
            return;
        }
        self.faults.see(fault, words, now);
    }

    fn without_camera_info(&self, refusal: &str) -> String {
        let (camera, detections) = (&self.camera_topic, &self.detections_topic);
        let publishers = self.cameras;
        format!(
            "detections arrive on {detections}, but no camera info has arrived on {camera}, which has {publishers} publisher(s) of \
             matching type and QoS: {refusal}"
        )
    }

    /// Looks for faults once a second.
    pub fn on_second(&mut self, second: Second, now: Instant) {
        let detectors = second.graph.heard(&self.detections_topic);
        let cameras = second.graph.heard(&self.camera_topic);
        self.detections.on_second(detectors, now);
        self.camera.on_second(cameras, now);
        self.cameras = cameras;
        for misfit in second.graph.misfits.iter().take(MOST_MISFITS) {
            let (fault, words) = match misfit {
                Misfit::Qos(words) => (Fault::IncompatibleQos, words),
                Misfit::Type(words) => (Fault::WrongType, words),
            };
            self.faults.see_of(fault, words, words, now);
        }
        if let Some(without) = &mut self.without_camera
            && now.saturating_duration_since(without.since) >= GRACE
            && let Some(refusal) = without.latest.take()
        {
            let words = self.without_camera_info(&refusal);
            self.faults.see(Fault::NoCameraInfo, &words, now);
        }
        self.watch_inputs(detectors, cameras, now);
        self.watch_attitude(now);
        if let Some(words) = second.system_clock {
            self.faults.see_of(Fault::ClockJump, "system", &words, now);
        }
        self.watch_clock(second.clock_jump, second.clock_silence, now);
        for (topic, reason) in second.dropped {
            let words = format!("dropping messages on {topic}: {reason}");
            self.faults
                .see_of(Fault::DroppedOutput, &topic, &words, now);
        }
        self.faults.end_unseen(now);
    }

    fn watch_inputs(&mut self, detectors: usize, cameras: usize, now: Instant) {
        let (detections, camera) = (&self.detections_topic, &self.camera_topic);
        let silence_s = SILENCE.as_secs();
        let silent = |topic: &str, publishers: usize| {
            format!(
                "no message on {topic} for {silence_s} s, although it has {publishers} publisher(s) of matching type and QoS"
            )
        };
        if self.detections.silent(now) {
            let words = silent(detections, detectors);
            self.faults
                .see_of(Fault::SilentPublisher, detections, &words, now);
        }
        if !self.camera.ever() && self.camera.silent(now) {
            let words = format!(
                "{}; one that sends it only once needs durability transient_local on both sides (see qos_overrides)",
                silent(camera, cameras)
            );
            self.faults
                .see_of(Fault::SilentPublisher, camera, &words, now);
        }
        if detectors == 0 && !self.detections.recent(now) {
            let ever = self.detections.ever();
            if ever || (self.camera.recent(now) && is_long(self.begin, now)) {
                let words = if ever {
                    format!("no more detections on {detections}: its publisher has left")
                } else {
                    format!(
                        "camera info arrives on {camera}, but {detections} has no publisher of matching type and QoS"
                    )
                };
                self.faults.see(Fault::NoDetections, &words, now);
            }
        }
        if self.camera.was_steady && !self.camera.recent(now) && self.detections.recent(now) {
            let words = format!(
                "no camera info on {camera} for {silence_s} s, after a steady stream ({cameras} publisher(s) now), while detections \
                 continue: the last one is still used"
            );
            self.faults.see(Fault::StaleCameraInfo, &words, now);
        }
        if self.detections.ever() {
            if std::mem::take(&mut self.waiting_said) {
                log::info!("detections now arrive on {detections}");
            }
        } else if detectors == 0
            && !self.waiting_said
            && now.saturating_duration_since(self.begin) >= WAIT
        {
            self.waiting_said = true;
            log::info!("waiting for detections: {detections} has no publisher yet");
        }
    }

    fn watch_attitude(&mut self, now: Instant) {
        let Some(words) = self.attitude.as_ref().and_then(Attitude::in_words) else {
            return;
        };
        let until = "until camera_mount_* or nominal_* are corrected, max_attitude_deviation_deg allows it, or ~/reset is called";
        let consequence = if self.holds_outputs {
            "receptacle and the outputs to flight stacks are held back"
        } else {
            "this lasts"
        };
        let doing = format!("; {consequence} {until}");
        self.faults
            .see_while(Fault::UnexpectedAttitude, "", &words, &doing, now);
    }

    fn watch_clock(&mut self, jump: Option<String>, silence: Option<ClockSilence>, now: Instant) {
        if let Some(jump) = jump {
            let words = format!(
                "/clock jumped {jump}: a simulation or recording was restarted or skipped ahead, or two run at once"
            );
            self.faults.see(Fault::ClockJump, &words, now);
        }
        if let Some(silence) = silence.filter(|silence| is_long(silence.since, now)) {
            let words = if silence.ever {
                "use_sim_time is set, but /clock has stopped: the node's time does not advance"
            } else {
                "use_sim_time is set, but no /clock message has arrived: the node's time is zero"
            };
            self.faults.see(Fault::NoClock, words, now);
        }
    }
}

#[cfg(test)]
mod tests;
