//! What the node does with one message: convert, call the pipeline, convert, publish.

use std::fmt;
use std::sync::Arc;

use super::attitudes::{AttitudeMessage, Attitudes, NoReportedAttitude};
use super::clock::Clock;
use super::consumers::{Consumers, Protection, Silence};
use super::diagnostics::Tally;
use super::files::Files;
use super::health::Watch;
use super::input::{InputMessage, InputReader, Sighting};
use super::monitor::{Answer, Monitor, Subject};
use super::outputs::Outputs;
use super::repetition::Repetition;
use super::topics::{ATTITUDE, CAMERA_INFO, TANKER_ATTITUDE};
use crate::config::Configuration;
use crate::convert;
use crate::estimation::Solution;
use crate::messages::{CameraInfo, Header};
use crate::picture::Picture;
use crate::pipeline::{DetectionFrame, FrameOutcome, Pipeline, Stamp, TrackCode};
use crate::text::{echoed, quoted};
use ros2_node::graph::Graph;
use ros2_node::names::{NamesError, NodeNames};
use ros2_node::once::SaidOnce;

/// The pipeline between its messages.
pub struct Handler {
    pipeline: Pipeline,
    reader: InputReader,
    repetition: Repetition,
    attitudes: Attitudes,
    outputs: Outputs,
    monitor: Monitor,
    clock: Clock,
    active: bool,
    own_child: SaidOnce<()>,
}

impl Handler {
    /// Returns a handler of a configuration with its files, which has not seen a message yet and is not active.
    ///
    /// # Errors
    /// [`NamesError`] of a remap.
    pub fn new(
        configuration: &Configuration,
        files: Files,
        outputs: Outputs,
        names: &NodeNames,
        clock: &Clock,
    ) -> Result<Self, NamesError> {
        let map = Arc::new(files.map);
        let reader = InputReader {
            input: configuration.input,
            map: Arc::clone(&map),
            max_hamming: configuration.max_hamming,
        };
        let pipeline = Pipeline::new(configuration.settings.clone(), map)
            .with_calibration_budget(files.calibration)
            .with_refuelling(files.setup);
        let watch = Watch::new(
            names.topic(configuration.input.topic().name)?,
            names.topic(CAMERA_INFO.name)?,
            clock.now(),
        );
        let mut repetition = Repetition::default();
        repetition.allow(configuration.max_frozen_s);
        Ok(Self {
            pipeline,
            reader,
            repetition,
            attitudes: Attitudes::new(configuration),
            outputs,
            monitor: Monitor::new(names.base_name(), clock.clone(), watch),
            clock: clock.clone(),
            active: false,
            own_child: SaidOnce::default(),
        })
    }

    /// Begins or ends answers. While it is not active, camera infos still count and detections are only counted.
    pub const fn set_active(&mut self, on: bool) {
        self.active = on;
    }

    /// What has been counted.
    #[must_use]
    pub const fn tally(&self) -> &Tally {
        &self.monitor.tally
    }

    /// Returns its outputs, for another handler.
    #[must_use]
    pub fn into_outputs(self) -> Outputs {
        self.outputs
    }

    /// Takes a camera info.
    pub fn on_camera_info(&mut self, message: &CameraInfo) {
        let info = convert::camera_info(message);
        let result = self.pipeline.set_camera(&info, &message.header.frame_id);
        self.monitor
            .on_camera_info(&self.pipeline, result == Ok(true));
        if let (Some(predicted), true) = (&mut self.outputs.predicted_points, self.active) {
            predicted.on_camera_info(&message.header, &self.pipeline, &mut self.monitor.tally);
        }
    }

    /// Takes the detections of an image; publishes what becomes of them.
    pub fn on_detections(&mut self, message: InputMessage) {
        let begin = self.clock.now();
        self.monitor.on_detections(self.input(), begin);
        if !self.active {
            self.monitor.tally.unanswered += 1;
            return;
        }
        let Sighting {
            header,
            detections,
            ignored_ids,
        } = self.reader.read(message);
        let stamp = Stamp::from(header.stamp);
        let repeated = detections
            .as_ref()
            .ok()
            .and_then(|seen| self.repetition.take(stamp, &header.frame_id, seen));
        let reported = self.attitudes.reported(stamp.nanoseconds());
        let frame = DetectionFrame {
            stamp,
            frame_id: header.frame_id.clone(),
            detections: repeated.map_or(detections, Err),
            receiver_from_tanker: reported.and_then(Result::ok),
        };
        let outcome = self.pipeline.process(&frame);
        // A frame with a longer name is refused, so no pose has a cut one.
        let header = Header {
            frame_id: echoed(header.frame_id),
            ..header
        };
        let solve_time = self.clock.now().saturating_duration_since(begin);
        let mut status = convert::status(header.clone(), &outcome, &ignored_ids, solve_time);
        if let Some(reported) = &reported
            && outcome.header_fits()
        {
            let missing = reported.as_ref().err().copied();
            self.monitor.on_reported_attitude(missing, begin);
            if let Some(missing) = missing {
                append(&mut status.message, &missing);
            }
        }
        let contradiction = self.attitudes.compare(reported.as_ref(), &outcome);
        self.monitor.on_attitudes_compared(contradiction, begin);
        let message = status.message.clone();
        let answer = Answer {
            frame: &frame,
            outcome: &outcome,
            message: &message,
            solve_time,
            begin,
        };
        let unexpected = self.monitor.on_answer(&answer);

        let protection = match &mut self.outputs.integrity {
            Some(integrity) => {
                let tally = &mut self.monitor.tally;
                integrity.on_outcome(&header, &outcome, &self.pipeline, tally, begin)
            }
            None => Protection::default(),
        };
        if let Ok(solution) = &outcome.result {
            self.publish_pose(&header, solution);
            let trust = match unexpected {
                Some(unexpected) => Err(unexpected.into()),
                None => Ok(protection),
            };
            self.publish_to_flight_stacks(&header, solution, &outcome, trust);
        }
        self.publish_odometry(&header, &outcome);
        self.outputs.status.publish(status, &mut self.monitor.tally);
        if let Some(predicted) = &mut self.outputs.predicted_points {
            predicted.on_detections(&header, &self.pipeline, &mut self.monitor.tally);
        }
        self.monitor.on_residuals(&answer, &self.pipeline);
        // Last: they are for display, where a millisecond does not matter.
        self.publish_markers(&header, &frame, &outcome);
        self.monitor.on_published(&answer);
    }

    /// Takes a sample of the receiver's attitude.
    pub fn on_attitude(&mut self, message: &AttitudeMessage) {
        self.monitor.on_decoded(ATTITUDE);
        let taken = self.attitudes.on_receiver(message);
        self.monitor.on_attitude_taken("receiver", taken);
    }

    /// Takes a sample of the tanker's attitude.
    pub fn on_tanker_attitude(&mut self, message: &AttitudeMessage) {
        self.monitor.on_decoded(TANKER_ATTITUDE.name);
        let taken = self.attitudes.on_tanker(message);
        self.monitor.on_attitude_taken("tanker", taken);
    }

    /// Takes changed parameters, for the next frame on.
    pub fn on_configuration(&mut self, configuration: Configuration) {
        if let Some(consumers) = &mut self.outputs.consumers {
            consumers.on_configuration(&configuration.consumers);
        }
        self.attitudes.on_configuration(&configuration);
        self.repetition.allow(configuration.max_frozen_s);
        self.understand(&configuration);
        self.pipeline.set_settings(configuration.settings);
        // Whether the image is rectified decides how the camera info is read.
        self.monitor.on_camera(&self.pipeline);
    }

    /// Says what a configuration means, if that is new.
    pub fn understand(&mut self, configuration: &Configuration) {
        let geometry = self.outputs.consumers.as_ref().map(Consumers::geometry);
        self.monitor
            .understand(configuration, &self.reader.map, geometry);
    }

    /// Forgets the track and the last attitude.
    pub fn on_reset(&mut self) {
        self.pipeline.reset();
        self.attitudes.on_reset();
        self.repetition.forget();
        self.monitor.on_reset();
    }

    /// Records a sample on `topic` that could not be decoded.
    pub fn on_undecodable(&mut self, topic: &str, error: &dyn fmt::Display) {
        self.monitor.on_undecodable(topic, self.input(), error);
    }

    /// Records samples on `topic` that were skipped because newer ones waited behind them.
    pub fn on_lost(&mut self, topic: &str, count: u64) {
        self.monitor.on_lost(topic, count);
    }

    /// Looks for faults and publishes the diagnostics; `publishers`: of the input, whatever they send.
    pub fn on_second(&mut self, publishers: usize, graph: &Graph) {
        let subject = Subject {
            active: self.active,
            input: self.input(),
            marker_map: self.reader.map.name(),
            publishers,
        };
        let mut report = self.monitor.report(&subject, graph);
        if let Some(consumers) = &mut self.outputs.consumers {
            report
                .status
                .push(consumers.diagnostics(self.monitor.node(), &mut self.attitudes.receiver));
        }
        if let Some(integrity) = &mut self.outputs.integrity {
            report
                .status
                .push(integrity.diagnostics(self.monitor.node()));
        }
        self.outputs
            .diagnostics
            .publish(report, &mut self.monitor.tally);
    }

    fn input(&self) -> &'static str {
        self.reader.input.topic().name
    }

    /// Publishes a trusted pose, also as a transform if that is wanted.
    fn publish_pose(&mut self, header: &Header, solution: &Solution) {
        let message = convert::pose(header.clone(), solution);
        self.outputs.pose.publish(message, &mut self.monitor.tally);
        if self.is_own_child(header) {
            return;
        }
        if let Some(output) = &mut self.outputs.transform {
            let child = &self.outputs.tanker_frame_id;
            let message = convert::transform(header.clone(), child, solution);
            output.publish(message, &mut self.monitor.tally);
        }
    }

    fn publish_to_flight_stacks(
        &mut self,
        header: &Header,
        solution: &Solution,
        outcome: &FrameOutcome,
        trust: Result<Protection, Silence>,
    ) {
        let Some(consumers) = &mut self.outputs.consumers else {
            return;
        };
        let corrected = outcome.track.code() == TrackCode::Updated;
        let motion = outcome.track.motion.as_ref().filter(|_| corrected);
        let place = trust.and_then(|protection| {
            let track = consumers.check(protection, motion)?;
            Ok((solution, track))
        });
        let attitudes = &self.attitudes;
        let now = self.clock.now();
        consumers.on_pose(header, place, attitudes, &mut self.monitor.tally, now);
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
        let message = convert::odometry(header.clone(), child, motion);
        self.outputs
            .odometry
            .publish(message, &mut self.monitor.tally);
    }

    /// Warns when camera and tanker have the same frame, which makes poses meaningless.
    fn is_own_child(&mut self, header: &Header) -> bool {
        let child = &self.outputs.tanker_frame_id;
        let is_same = *child == header.frame_id;
        if is_same && self.own_child.fault((), self.clock.now()) {
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
        output.publish(convert::markers(header, &picture), &mut self.monitor.tally);
    }
}

/// Adds to the words about a frame why it has no prior from reported attitudes.
fn append(message: &mut String, missing: &NoReportedAttitude) {
    if !message.is_empty() {
        message.push_str("; ");
    }
    message.push_str("no reported attitude: ");
    message.push_str(&missing.to_string());
}
