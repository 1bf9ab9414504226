//! What the node does with one message: convert, call the pipeline, convert, publish.

use std::time::{Duration, Instant};

use ros2_client::{Publisher, WriteError};

use super::attitude::AttitudeMessage;
use super::clock::NodeClock;
use super::consumers::Consumers;
use super::convert;
use super::diagnostics::{CameraState, Reporter, Situation, Tally};
use super::graph::Graph;
use super::health::{
    Fault, ImageAge, Second, SystemClock, Watch, both_clocks, fault_of, seconds_between,
};
use super::input::{InputMessage, InputReader, Sighting};
use super::messages::{
    CameraInfo, DiagnosticArray, EstimatorStatus, Header, MarkerArray, Message, Odometry,
    PoseWithCovarianceStamped, TFMessage, Time,
};
use super::node::{ATTITUDE, CAMERA_INFO};
use super::once::SaidOnce;
use super::predicted_points::PredictedPoints;
use super::understood::say_understood;
use crate::config::Configuration;
use crate::estimation::Solution;
use crate::picture::Picture;
use crate::pipeline::{DetectionFrame, FrameOutcome, OutcomeCode, Pipeline, Stamp, TrackCode};
use crate::refuelling::RefuellingSetup;
use crate::text::{echoed, quoted};
use crate::tracking::TrackOutcome;

/// A topic that never makes the node wait: what a slow subscriber has no room for is dropped and
/// counted.
pub struct Output<M: Message> {
    publisher: Publisher<M>,
    topic: String,
}

impl<M: Message> Output<M> {
    /// Returns the output to `topic` through `publisher`.
    #[must_use]
    pub const fn new(publisher: Publisher<M>, topic: String) -> Self {
        Self { publisher, topic }
    }

    pub(super) fn publish(&mut self, message: M, tally: &mut Tally) {
        if let Err(error) = self.publisher.publish(message) {
            let reason = match error {
                WriteError::WouldBlock { .. } => "a subscriber does not keep up".to_owned(),
                other => other.to_string(),
            };
            tally.drop_one(&self.topic, reason);
        }
    }
}

/// Where the node's results go.
pub struct Outputs {
    /// Trusted poses.
    pub pose: Output<PoseWithCovarianceStamped>,
    /// One message for every frame.
    pub status: Output<EstimatorStatus>,
    /// Pose and twist of the track, at every frame while there is one.
    pub odometry: Output<Odometry>,
    /// Name of the child frame of odometry and transforms.
    pub tanker_frame_id: String,
    /// Trusted poses as transforms, if wanted.
    pub transform: Option<Output<TFMessage>>,
    /// What can be drawn of a frame, if wanted.
    pub markers: Option<Output<MarkerArray>>,
    /// Where markers will be, for detectors, if wanted.
    pub predicted_points: Option<PredictedPoints>,
    /// The node's health.
    pub diagnostics: Output<DiagnosticArray>,
    /// What refuelling and flight stacks are told, if wanted.
    pub consumers: Option<Consumers>,
}

impl Outputs {
    /// Applies reloaded settings; the outputs and their names stay fixed.
    pub(super) fn configure(
        &mut self,
        configuration: &Configuration,
        setup: Option<RefuellingSetup>,
    ) {
        if let (Some(consumers), Some(setup)) = (&mut self.consumers, setup) {
            consumers.configure(&configuration.consumers, setup);
        }
    }
}

/// The pipeline between its messages.
pub struct Estimator {
    pipeline: Pipeline,
    reader: InputReader,
    outputs: Outputs,
    clock: NodeClock,
    node: String,
    active: bool,
    needed_points: usize,
    camera: CameraState,
    tally: Tally,
    reporter: Reporter,
    last_refusal: Option<String>,
    last_track: Option<TrackOutcome>,
    /// Whether a pose was ever published.
    has_estimated: bool,
    slowest: Duration,
    last_report: Instant,
    watch: Watch,
    system_clock: SystemClock,
    refusals: SaidOnce<OutcomeCode>,
    bad_camera: SaidOnce<()>,
    camera_changes: SaidOnce<()>,
    own_child: SaidOnce<()>,
}

impl Estimator {
    /// Returns an estimator that has not seen a message yet and is not active, for the node of this name, and a
    /// watch over its inputs.
    #[must_use]
    pub fn new(
        pipeline: Pipeline,
        reader: InputReader,
        outputs: Outputs,
        clock: NodeClock,
        node: &str,
        watch: Watch,
    ) -> Self {
        Self {
            watch,
            system_clock: SystemClock::default(),
            pipeline,
            reader,
            outputs,
            clock,
            node: node.to_owned(),
            active: false,
            needed_points: 0,
            camera: CameraState::Missing,
            tally: Tally::default(),
            reporter: Reporter::default(),
            last_refusal: None,
            last_track: None,
            has_estimated: false,
            slowest: Duration::ZERO,
            last_report: Instant::now(),
            refusals: SaidOnce::default(),
            bad_camera: SaidOnce::default(),
            camera_changes: SaidOnce::default(),
            own_child: SaidOnce::default(),
        }
    }

    /// Begins or ends answers. While it is not active, camera infos still count and detections are only counted.
    pub const fn set_active(&mut self, on: bool) {
        self.active = on;
    }

    /// Returns its outputs, for another estimator.
    #[must_use]
    pub fn into_outputs(self) -> Outputs {
        self.outputs
    }

    /// Takes a camera info.
    pub fn on_camera_info(&mut self, message: &CameraInfo) {
        self.tally.camera_infos += 1;
        self.watch.on_camera_info(Instant::now());
        self.watch.on_decoded(CAMERA_INFO);
        let info = convert::camera_info(message);
        let result = self.pipeline.set_camera(&info, &message.header.frame_id);
        let was_valid = matches!(self.camera, CameraState::Valid { .. });
        self.note_camera();
        if result != Ok(true) {
            self.camera_changes.good();
        } else if !was_valid || self.camera_changes.fault((), Instant::now()) {
            // Two drivers on one topic change it with every message.
            if was_valid {
                log::info!("camera info has changed: {}", self.camera);
            }
            if let Some(off) = self.pipeline.off_centre() {
                log::warn!("{off}");
            }
        }
        if let (Some(predicted), true) = (&mut self.outputs.predicted_points, self.active) {
            predicted.on_camera_info(&message.header, &self.pipeline, &mut self.tally);
        }
    }

    /// Takes the detections of an image; publishes what becomes of them.
    pub fn on_detections(&mut self, message: InputMessage) {
        let begin = Instant::now();
        self.watch.on_detections(begin);
        self.watch.on_decoded(self.reader.input.topic());
        if !self.active {
            self.tally.unanswered += 1;
            return;
        }
        let Sighting {
            header,
            detections,
            ignored_ids,
        } = self.reader.read(message);
        let frame = DetectionFrame {
            stamp: header.stamp.into(),
            frame_id: header.frame_id.clone(),
            detections,
        };
        let outcome = self.pipeline.process(&frame);
        // A frame whose name is too long for that is refused, so no pose has a cut one.
        let header = Header {
            frame_id: echoed(header.frame_id),
            ..header
        };
        let solve_time = begin.elapsed();

        let refusal = outcome.result.as_ref().err();
        let fault = refusal.and_then(|refusal| fault_of(refusal, &frame.frame_id));
        if outcome.header_fits() && fault != Some(Fault::FrameMismatch) {
            self.watch.on_image(header.stamp, begin);
            if let Some(image) = self.age_of(header.stamp) {
                self.watch.on_age(image, begin);
            }
        }
        self.watch.on_outcome(&outcome, begin);
        if let Ok(solution) = &outcome.result {
            // A marker at the edge of the image was not judged.
            let used = outcome.used_ids.iter().map(|&id| (id, false));
            let excluded = solution.excluded.ids().map(|id| (id, true));
            self.watch.on_pose(used.chain(excluded), begin);
            let rotation = &solution.camera_from_tanker.rotation;
            let unexpected = self.watch.on_attitude(rotation, begin);
            self.outputs
                .pose
                .publish(convert::pose(header.clone(), solution), &mut self.tally);
            self.publish_transform(&header, solution);
            if let Some(consumers) = &mut self.outputs.consumers {
                let corrected = outcome.track.code() == TrackCode::Updated;
                let motion = outcome.track.motion.as_ref().filter(|_| corrected);
                let place = match unexpected {
                    Some(unexpected) => Err(unexpected),
                    None => Ok((solution, motion)),
                };
                consumers.on_pose(&header, place, &mut self.tally);
            }
        }
        self.publish_odometry(&header, &outcome);
        let status = convert::status(header.clone(), &outcome, &ignored_ids, solve_time);
        self.take_note(&outcome, &status.message, fault, frame.stamp, solve_time);
        self.outputs.status.publish(status, &mut self.tally);
        if let Some(predicted) = &mut self.outputs.predicted_points {
            predicted.on_detections(&header, &self.pipeline, &mut self.tally);
        }
        // Last: they are for people, who don't wait for a millisecond.
        self.publish_markers(&header, &frame, &outcome);
        let end = Instant::now();
        let taken = end.saturating_duration_since(begin);
        self.watch.latency.take(taken.as_secs_f64(), end);
        if outcome.result.is_ok() {
            let age_s = seconds_between(header.stamp, self.clock.now());
            self.watch.age.take(age_s, end);
        }
    }

    /// Returns how old an image is by the node's time; none while that stands still for want of `/clock`.
    fn age_of(&self, stamp: Time) -> Option<ImageAge> {
        let silence = self.clock.silence();
        if silence.is_some_and(|silence| !silence.ever) {
            return None;
        }
        Some(ImageAge {
            age_s: seconds_between(stamp, self.clock.now()),
            stamp_s: stamp.sec,
            is_simulated: silence.is_some(),
        })
    }

    /// Takes a sample of the receiver's attitude.
    pub fn on_attitude(&mut self, message: &AttitudeMessage) {
        self.watch.on_decoded(ATTITUDE);
        if let Some(consumers) = &mut self.outputs.consumers {
            consumers.on_attitude(message);
        }
    }

    /// Takes changed parameters, for the next frame on.
    pub fn on_configuration(&mut self, configuration: Configuration) {
        if let Some(consumers) = &mut self.outputs.consumers {
            consumers.on_configuration(&configuration.consumers);
        }
        self.understand(&configuration);
        self.pipeline.set_settings(configuration.settings);
        // Whether the image is rectified decides how the camera info is read.
        self.note_camera();
    }

    /// Takes note of what a configuration means for faults, and says what of it is new: mount, lever arms and nominal
    /// attitude in words, and what would refuse every frame from now on.
    pub fn understand(&mut self, configuration: &Configuration) {
        let consumers = self.outputs.consumers.as_ref();
        let expected = &configuration.expected_attitude;
        let is_used = consumers.is_some() || configuration.starts_from_nominal();
        if self
            .watch
            .expect(is_used.then_some(expected), consumers.is_some())
        {
            let geometry = consumers.map(Consumers::geometry);
            let need = configuration.settings.estimator.min_points;
            say_understood(expected, geometry, &self.reader.map, need);
        }
        self.warn_of_too_small_map(configuration);
    }

    fn warn_of_too_small_map(&mut self, configuration: &Configuration) {
        let estimator = &configuration.settings.estimator;
        let need = estimator
            .min_points
            .max(estimator.initialisation.min_points());
        let markers = self.reader.map.markers().len();
        if need != self.needed_points && markers < need {
            log::warn!(
                "every frame will be refused: the marker map has {markers} markers, min_points and initialisation need {need}"
            );
        }
        self.needed_points = need;
    }

    /// Forgets the track and the last attitude.
    pub fn on_reset(&mut self) {
        self.pipeline.reset();
        self.watch.on_reset();
        log::info!("track and last attitude were reset by a call of ~/reset");
    }

    /// Takes note of a sample on `topic` that could not be decoded.
    pub fn on_undecodable(&mut self, topic: &'static str, error: &ros2_client::ReadError) {
        self.tally.undecodable += 1;
        let now = Instant::now();
        if topic == self.reader.input.topic() {
            self.watch.on_detections(now);
        }
        self.watch.on_undecodable(topic, error, now);
    }

    /// Takes note of samples on `topic` that were passed over because newer ones waited behind them.
    pub fn on_lost(&mut self, topic: &'static str, count: u64) {
        self.tally.lost += count;
        self.watch.on_lost(topic, count, Instant::now());
    }

    /// Looks for faults and publishes the diagnostics; `publishers`: of the input, whatever they send.
    pub fn on_second(&mut self, publishers: usize, graph: &Graph, now: Instant) {
        let second = Second {
            graph,
            clock_jump: self.clock.take_jump(),
            system_clock: both_clocks()
                .and_then(|(system, steady)| self.system_clock.take(system, steady)),
            clock_silence: self.clock.silence(),
            dropped: self.tally.take_dropping(),
        };
        self.watch.on_second(second, now);
        let situation = Situation {
            now: self.clock.now(),
            node: &self.node,
            active: self.active,
            input: self.reader.input.topic(),
            marker_map: self.reader.map.name(),
            camera: &self.camera,
            last_refusal: self.last_refusal.as_deref(),
            track: self.last_track.as_ref(),
            publishers,
            slowest: self.slowest,
            latency_s: self.watch.latency.p50_and_p99_s(now),
            age_s: self.watch.age.p50_and_p99_s(now),
            faults: &self.watch.faults,
        };
        let elapsed = now.saturating_duration_since(self.last_report);
        let mut report = self.reporter.report(&self.tally, elapsed, &situation);
        if let Some(consumers) = &mut self.outputs.consumers {
            report.status.push(consumers.diagnostics(&self.node));
        }
        self.outputs.diagnostics.publish(report, &mut self.tally);
        self.last_refusal = None;
        self.slowest = Duration::ZERO;
        self.last_report = now;
    }

    fn publish_transform(&mut self, header: &Header, solution: &Solution) {
        if self.is_own_child(header) {
            return;
        }
        let Some(output) = &mut self.outputs.transform else {
            return;
        };
        let child = &self.outputs.tanker_frame_id;
        output.publish(
            convert::transform(header.clone(), child, solution),
            &mut self.tally,
        );
    }

    /// Publishes the track at the frame's stamp, if there is one.
    fn publish_odometry(&mut self, header: &Header, outcome: &FrameOutcome) {
        let Some(motion) = &outcome.track.motion else {
            return;
        };
        if self.is_own_child(header) {
            return;
        }
        let child = &self.outputs.tanker_frame_id;
        self.outputs.odometry.publish(
            convert::odometry(header.clone(), child, motion),
            &mut self.tally,
        );
    }

    /// Says so when camera and tanker have the same frame: nobody could tell which one is meant.
    fn is_own_child(&mut self, header: &Header) -> bool {
        let child = &self.outputs.tanker_frame_id;
        let is_same = *child == header.frame_id;
        if is_same && self.own_child.fault((), Instant::now()) {
            log::warn!(
                "no odometry, no transform: the camera's frame and tanker_frame_id are both {}",
                quoted(child)
            );
        }
        is_same
    }

    /// Publishes what can be drawn; of a refused frame only the camera, if it is that of the frame.
    fn publish_markers(&mut self, header: &Header, frame: &DetectionFrame, outcome: &FrameOutcome) {
        let Some(output) = &mut self.outputs.markers else {
            return;
        };
        let picture = match self.pipeline.camera() {
            Some((_, Ok(camera))) if outcome.header_fits() => {
                let detections = frame.detections.as_deref().unwrap_or_default();
                Picture::new(camera, &self.reader.map, detections, outcome)
            }
            _ => Picture::default(),
        };
        output.publish(convert::markers(header, &picture), &mut self.tally);
    }

    fn note_camera(&mut self) {
        let state = match self.pipeline.camera() {
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
            if self.bad_camera.fault((), Instant::now()) {
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

    fn take_note(
        &mut self,
        answer: &FrameOutcome,
        message: &str,
        fault: Option<Fault>,
        stamp: Stamp,
        solve_time: Duration,
    ) {
        let outcome = answer.code();
        self.tally.count(outcome);
        self.tally.count_track(answer.track.code());
        self.last_track = answer.track.outcome;
        self.slowest = self.slowest.max(solve_time);
        if let Ok(solution) = &answer.result {
            if !std::mem::replace(&mut self.has_estimated, true) {
                let distance_m = solution.camera_from_tanker.translation.vector.norm();
                let used = answer.used_ids.len();
                log::info!(
                    "first pose: the tanker is {distance_m:.1} m away, found by {used} markers"
                );
            }
            if let Some(count) = self.refusals.good() {
                let frames = if count == 1 { "frame" } else { "frames" };
                log::info!("estimates resume after {count} refused {frames}");
            }
            return;
        }
        self.last_refusal = Some(message.to_owned());
        let now = Instant::now();
        let Stamp { sec, nanosec } = stamp;
        let words = format!(
            "frames are refused from stamp {sec}.{nanosec:09} on, {}: {message}",
            outcome.name()
        );
        let is_new = self.refusals.fault(outcome, now);
        match fault {
            Some(fault) => self.watch.on_refusal(fault, &words, now),
            None if is_new => log::warn!("{words}"),
            None => {}
        }
    }
}
