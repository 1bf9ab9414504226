//! The node's health: what it counts, the faults around it, what it says of them, and its report once a second.

use std::fmt;
use std::time::{Duration, Instant};

use super::attitudes::NoReportedAttitude;
use super::clock::Clock;
use super::contradiction::Contradiction;
use super::diagnostics::{CameraState, Reporter, Situation, Tally};
use super::health::{
    Fault, ImageAge, Second, SystemClock, Unexpected, Watch, both_clocks, fault_of, seconds_between,
};
use super::topics::CAMERA_INFO;
use super::understood::say_understood;
use crate::config::Configuration;
use crate::convert::FlightStackError;
use crate::messages::{DiagnosticArray, Time};
use crate::pipeline::{DetectionFrame, FrameOutcome, OutcomeCode, Pipeline, Stamp};
use crate::refuelling::RefuellingGeometry;
use crate::target::MarkerMap;
use crate::tracking::TrackOutcome;
use ros2_node::graph::Graph;
use ros2_node::once::SaidOnce;

/// What became of a frame.
pub(super) struct Answer<'a> {
    pub(super) frame: &'a DetectionFrame,
    pub(super) outcome: &'a FrameOutcome,
    /// What the status says of it.
    pub(super) message: &'a str,
    /// From the message to the outcome.
    pub(super) solve_time: Duration,
    /// When its message was taken.
    pub(super) begin: Instant,
}

/// The parts of the node that a report describes.
pub(super) struct Subject<'a> {
    /// Whether detections are answered.
    pub(super) active: bool,
    /// Topic of the detections.
    pub(super) input: &'a str,
    /// Name of the marker map.
    pub(super) marker_map: &'a str,
    /// Publishers of the detections in the graph, whatever they send.
    pub(super) publishers: usize,
}

/// Keeps the node's health.
pub(super) struct Monitor {
    /// Counts for the publishers.
    pub(super) tally: Tally,
    node: String,
    clock: Clock,
    watch: Watch,
    system_clock: SystemClock,
    reporter: Reporter,
    camera: CameraState,
    needed_points: usize,
    last_refusal: Option<String>,
    last_track: Option<TrackOutcome>,
    /// Whether a pose was ever published.
    has_estimated: bool,
    slowest: Duration,
    last_report: Instant,
    refusals: SaidOnce<OutcomeCode>,
    bad_camera: SaidOnce<()>,
    camera_changes: SaidOnce<()>,
}

impl Monitor {
    /// Returns a monitor that has not seen a message yet, for the node of this name, and a watch over its inputs.
    pub(super) fn new(node: &str, clock: Clock, watch: Watch) -> Self {
        Self {
            tally: Tally::default(),
            node: node.to_owned(),
            watch,
            system_clock: SystemClock::default(),
            reporter: Reporter::default(),
            camera: CameraState::Missing,
            needed_points: 0,
            last_refusal: None,
            last_track: None,
            has_estimated: false,
            slowest: Duration::ZERO,
            last_report: clock.now(),
            refusals: SaidOnce::default(),
            bad_camera: SaidOnce::default(),
            camera_changes: SaidOnce::default(),
            clock,
        }
    }

    pub(super) fn node(&self) -> &str {
        &self.node
    }

    /// Records a camera info that the pipeline has taken; `is_new`: it can be used, and differs from the one before.
    pub(super) fn on_camera_info(&mut self, pipeline: &Pipeline, is_new: bool) {
        let now = self.clock.now();
        self.tally.camera_infos += 1;
        self.watch.on_camera_info(now);
        self.watch.on_decoded(CAMERA_INFO.name);
        let was_valid = matches!(self.camera, CameraState::Valid { .. });
        self.on_camera(pipeline);
        if !is_new {
            self.camera_changes.good();
        } else if !was_valid || self.camera_changes.fault((), now) {
            // Two drivers on one topic change it with every message.
            if was_valid {
                log::info!("camera info has changed: {}", self.camera);
            }
            if let Some(off) = pipeline.off_centre() {
                log::warn!("{off}");
            }
        }
    }

    /// Records what the latest camera info comes to, and says what of it is new.
    pub(super) fn on_camera(&mut self, pipeline: &Pipeline) {
        let state = match pipeline.camera() {
            None => CameraState::Missing,
            Some((frame_id, Ok(camera))) => CameraState::Valid {
                frame_id: frame_id.to_owned(),
                size_px: camera.image_size_px(),
            },
            Some((_, Err(error))) => CameraState::Invalid {
                reason: error.to_string(),
            },
        };
        if let CameraState::Invalid { reason } = &state {
            if self.bad_camera.fault((), self.clock.now()) {
                log::warn!("the camera info cannot be used: {reason}");
            }
        } else {
            let recovered = self.bad_camera.good().is_some();
            if recovered || self.camera == CameraState::Missing {
                log::info!("camera info is {state}");
            }
        }
        self.camera = state;
    }

    /// Records a sample that could be decoded.
    pub(super) fn on_decoded(&mut self, topic: &str) {
        self.watch.on_decoded(topic);
    }

    /// Records detections, answered or not.
    pub(super) fn on_detections(&mut self, topic: &str, now: Instant) {
        self.watch.on_detections(now);
        self.watch.on_decoded(topic);
    }

    /// Records what became of a frame; returns how the tanker's attitude is off what is expected, if it is.
    pub(super) fn on_answer(&mut self, answer: &Answer) -> Option<Unexpected> {
        let (outcome, now) = (answer.outcome, answer.begin);
        let stamp = Time::from(answer.frame.stamp);
        let refusal = outcome.result.as_ref().err();
        let fault = refusal.and_then(|refusal| fault_of(refusal, &answer.frame.frame_id));
        if outcome.header_fits() && fault != Some(Fault::FrameMismatch) {
            self.watch.on_image(stamp, now);
            if let Some(image) = self.age_of(stamp) {
                self.watch.on_age(image, now);
            }
        }
        self.count(answer);
        let Ok(solution) = &outcome.result else {
            self.on_refusal(answer, fault);
            return None;
        };
        self.on_pose(outcome);
        let rotation = &solution.camera_from_tanker.rotation;
        self.watch.on_attitude(rotation, now)
    }

    /// Records why a frame has no prior from the attitudes that both aircraft report, or that it has one.
    pub(super) fn on_reported_attitude(
        &mut self,
        missing: Option<NoReportedAttitude>,
        now: Instant,
    ) {
        let missing = missing.as_ref().map(|missing| missing as &dyn fmt::Display);
        self.watch.on_reported_attitude(missing, now);
    }

    /// Records whether the attitudes that both aircraft report contradict what is seen.
    pub(super) fn on_attitudes_compared(&mut self, found: Option<Contradiction>, now: Instant) {
        let found = found.as_ref().map(|found| found as &dyn fmt::Display);
        self.watch.on_attitudes_compared(found, now);
    }

    /// Records whether a sample of an aircraft's attitude can be used.
    pub(super) fn on_attitude_taken(&mut self, of: &str, taken: Result<(), FlightStackError>) {
        let error = taken.as_ref().err().map(|error| error as &dyn fmt::Display);
        self.watch.on_attitude_taken(of, error, self.clock.now());
    }

    /// Records how well a frame's residuals agree with what is stated, once it has been answered.
    pub(super) fn on_residuals(&mut self, answer: &Answer, pipeline: &Pipeline) {
        self.watch
            .on_outcome(answer.outcome, pipeline, answer.begin);
    }

    fn count(&mut self, answer: &Answer) {
        let outcome = answer.outcome;
        self.tally.count(outcome.code());
        self.tally.count_track(outcome.track.code());
        self.last_track = outcome.track.outcome;
        self.slowest = self.slowest.max(answer.solve_time);
    }

    /// Says that there are poses, if that is new.
    fn on_pose(&mut self, outcome: &FrameOutcome) {
        if let Ok(solution) = &outcome.result
            && !std::mem::replace(&mut self.has_estimated, true)
        {
            let distance_m = solution.camera_from_tanker.translation.vector.norm();
            let used = outcome.used_ids.len();
            log::info!("first pose: the tanker is {distance_m:.1} m away, found by {used} markers");
        }
        if let Some(count) = self.refusals.good() {
            let frames = if count == 1 { "frame" } else { "frames" };
            log::info!("estimates resume after {count} refused {frames}");
        }
    }

    /// Says that frames are refused, if that is new.
    fn on_refusal(&mut self, answer: &Answer, fault: Option<Fault>) {
        let (message, code) = (answer.message, answer.outcome.code());
        self.last_refusal = Some(message.to_owned());
        let now = self.clock.now();
        let Stamp { sec, nanosec } = answer.frame.stamp;
        let words = format!(
            "frames are refused from stamp {sec}.{nanosec:09} on, {}: {message}",
            code.name()
        );
        let is_new = self.refusals.fault(code, now);
        match fault {
            Some(fault) => self.watch.on_refusal(fault, &words, now),
            None if is_new => log::warn!("{words}"),
            None => {}
        }
    }

    /// Records that everything is published that follows from a frame.
    pub(super) fn on_published(&mut self, answer: &Answer) {
        let end = self.clock.now();
        let taken = end.saturating_duration_since(answer.begin);
        self.watch.latency.take(taken.as_secs_f64(), end);
        if answer.outcome.result.is_ok() {
            let age_s = seconds_between(answer.frame.stamp.into(), self.clock.node().now());
            self.watch.age.take(age_s, end);
        }
    }

    /// Returns the age of an image by the node's time; `None` while that does not advance for lack of `/clock`.
    fn age_of(&self, stamp: Time) -> Option<ImageAge> {
        let silence = self.clock.node().silence();
        if silence.is_some_and(|silence| !silence.ever) {
            return None;
        }
        Some(ImageAge {
            age_s: seconds_between(stamp, self.clock.node().now()),
            stamp_s: stamp.sec,
            is_simulated: silence.is_some(),
        })
    }

    /// Records what a configuration means for faults, and says what of it is new: mount, lever arms and nominal
    /// attitude in words, and what would refuse every frame from now on. `outputs` is the geometry of outputs that are
    /// held back while the tanker's attitude is not the expected one.
    pub(super) fn understand(
        &mut self,
        configuration: &Configuration,
        map: &MarkerMap,
        outputs: Option<&RefuellingGeometry>,
    ) {
        let estimator = &configuration.settings.estimator;
        let expected = &configuration.expected_attitude;
        let is_used = outputs.is_some() || configuration.starts_from_nominal();
        let is_new = self
            .watch
            .expect(is_used.then_some(expected), outputs.is_some());
        if is_new {
            say_understood(expected, outputs, map, estimator.min_points);
        }
        let need = estimator
            .min_points
            .max(estimator.initialisation.min_points());
        let markers = map.markers().len();
        if need != self.needed_points && markers < need {
            log::warn!(
                "every frame will be refused: the marker map has {markers} markers, min_points and initialisation need {need}"
            );
        }
        self.needed_points = need;
    }

    /// Records that the track and the last attitude are forgotten.
    pub(super) fn on_reset(&mut self) {
        self.watch.on_reset();
        log::info!("track and last attitude were reset by ~/reset");
    }

    /// Records a sample on `topic` that could not be decoded; `input` is the topic of the detections.
    pub(super) fn on_undecodable(&mut self, topic: &str, input: &str, error: &dyn fmt::Display) {
        self.tally.undecodable += 1;
        let now = self.clock.now();
        if topic == input {
            self.watch.on_detections(now);
        }
        self.watch.on_undecodable(topic, error, now);
    }

    /// Records samples on `topic` that were skipped because newer ones waited behind them.
    pub(super) fn on_lost(&mut self, topic: &str, count: u64) {
        self.tally.lost += count;
        self.watch.on_lost(topic, count, self.clock.now());
    }

    /// Looks for faults, and returns the report since the last one.
    pub(super) fn report(&mut self, subject: &Subject, graph: &Graph) -> DiagnosticArray {
        let now = self.clock.now();
        let second = Second {
            graph,
            clock_jump: self.clock.node().take_jump(),
            system_clock: self
                .clock
                .is_live()
                .then(both_clocks)
                .flatten()
                .and_then(|(system, steady)| self.system_clock.take(system, steady)),
            clock_silence: self.clock.node().silence(),
            dropped: self.tally.take_dropping(),
        };
        self.watch.on_second(second, now);
        let situation = Situation {
            now: self.clock.node().now(),
            node: &self.node,
            active: subject.active,
            input: subject.input,
            marker_map: subject.marker_map,
            camera: &self.camera,
            last_refusal: self.last_refusal.as_deref(),
            track: self.last_track.as_ref(),
            publishers: subject.publishers,
            slowest: self.slowest,
            latency_s: self.watch.latency.p50_and_p99_s(now),
            age_s: self.watch.age.p50_and_p99_s(now),
            faults: &self.watch.faults,
        };
        let elapsed = now.saturating_duration_since(self.last_report);
        let report = self.reporter.report(&self.tally, elapsed, &situation);
        self.last_refusal = None;
        self.slowest = Duration::ZERO;
        self.last_report = now;
        report
    }
}
