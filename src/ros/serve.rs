//! The node's loop: messages to their handler, changed parameters, and, if the node is managed, its transitions.

use std::time::{Duration, Instant};

use futures::{FutureExt, StreamExt, pin_mut, select_biased};

use super::clock::NodeClock;
use super::environment::Environment;
use super::error::NodeError;
use super::inputs::Inputs;
use super::lifecycle::{Lifecycle, Request, State, WorkResult};
use super::newest::Newest;
use super::parameters::SharedParameters;
use super::participant::{EndpointError, RosNode};
use super::sim_time::SimTime;
use super::supervisor::Supervisor;
use super::topics;
use crate::answering::clock::Clock;
use crate::answering::files::Files;
use crate::answering::handler::Handler;
use crate::answering::outputs::Outputs;
use crate::answering::topics::ATTITUDE;
use crate::camera::CalibrationBudget;
use crate::config::Configuration;
use crate::pipeline::budget_in_words;
use crate::target::MarkerMap;
use crate::text;

const CAMERA_INFO: &str = topics::CAMERA_INFO.name;
const TANKER_ATTITUDE: &str = topics::TANKER_ATTITUDE.name;

/// How often the loop looks whether it could run at all, and whether the service manager waits for a sign of life.
const BEAT: Duration = Duration::from_millis(100);
/// How long the middleware gets, after a time in which nothing of this process ran, to read what waits in its
/// sockets: only then can the newest samples be told.
const CATCH_UP: Duration = Duration::from_millis(20);

/// What stands between the topics.
enum Work {
    /// Nothing, and the topics are not open.
    Closed,
    /// Nothing, though the topics are open: peers do not notice that single endpoints have gone, so these stay.
    Idle(Box<Outputs>),
    /// What handles the messages.
    Ready(Box<Handler>),
}

/// What the node's loop works with.
///
/// The fields stand in the order in which they have to be dropped.
pub(super) struct Server<'a> {
    inputs: Option<Inputs>,
    work: Work,
    sim_time: SimTime,
    lifecycle: Option<Lifecycle>,
    requests: Option<smol::channel::Receiver<Request>>,
    clock: NodeClock,
    supervisor: Supervisor,
    parameters: SharedParameters,
    environment: &'a Environment,
    ros: &'a mut RosNode,
}

impl<'a> Server<'a> {
    /// Returns a server that has nothing to do yet.
    pub(super) fn new(
        ros: &'a mut RosNode,
        environment: &'a Environment,
        parameters: &SharedParameters,
        clock: &NodeClock,
    ) -> Self {
        Self {
            inputs: None,
            work: Work::Closed,
            sim_time: SimTime::new(clock.clone()),
            lifecycle: None,
            requests: None,
            clock: clock.clone(),
            supervisor: Supervisor::from_process(),
            parameters: parameters.clone(),
            environment,
            ros,
        }
    }

    pub(super) fn ros(&mut self) -> &mut RosNode {
        self.ros
    }

    /// Takes the time from `/clock` from now on, or no longer.
    pub(super) fn follow_clock(&mut self, on: bool) -> Result<(), EndpointError> {
        self.sim_time.follow(self.ros, on)
    }

    /// Opens the topics and begins to answer.
    pub(super) fn start(
        &mut self,
        configuration: &Configuration,
        files: Files,
    ) -> Result<(), EndpointError> {
        self.configure(configuration, files)?;
        self.activate(true);
        Ok(())
    }

    /// Opens the services by which others configure the node.
    pub(super) fn start_managed(&mut self) -> Result<(), EndpointError> {
        let (lifecycle, requests) = Lifecycle::open(self.ros, &self.clock)?;
        self.lifecycle = Some(lifecycle);
        self.requests = Some(requests);
        let name = self.ros.names().fully_qualified();
        log::info!("{name} is unconfigured: it waits for {name}/change_state");
        Ok(())
    }

    /// Works until `stop` ends.
    ///
    /// # Errors
    /// [`NodeError::MiddlewareGone`]: without it there is nothing to work with.
    pub(super) async fn serve(
        &mut self,
        stop: impl Future<Output = ()>,
        changes: smol::channel::Receiver<()>,
        resets: smol::channel::Receiver<()>,
    ) -> Result<(), NodeError> {
        self.supervisor.ready();
        let served = self.work_until(stop, changes, resets).await;
        self.supervisor.stopping();
        served
    }

    async fn work_until(
        &mut self,
        stop: impl Future<Output = ()>,
        changes: smol::channel::Receiver<()>,
        resets: smol::channel::Receiver<()>,
    ) -> Result<(), NodeError> {
        let requests = self.requests.take().unwrap_or_else(no_requests).fuse();
        let (stop, changes, resets) = (stop.fuse(), changes.fuse(), resets.fuse());
        pin_mut!(stop, changes, resets, requests);
        let seconds = StreamExt::fuse(smol::Timer::interval(Duration::from_secs(1)));
        let beats = StreamExt::fuse(smol::Timer::interval(BEAT));
        pin_mut!(seconds, beats);
        let inputs = loop {
            if let Some(inputs) = self.inputs.take() {
                break inputs;
            }
            select_biased! {
                () = stop => return Ok(()),
                _ = beats.select_next_some() => self.supervisor.alive(Instant::now()),
                _ = seconds.select_next_some() => self.ros.check_alive()?,
                () = changes.select_next_some() => self.on_change(),
                () = resets.select_next_some() => self.with(Handler::on_reset),
                request = requests.select_next_some() => self.on_request(&request),
            }
        };
        let (topic, depths) = (inputs.topic, &inputs.depths);
        let (camera_infos, lost_infos) = Newest::new(
            Box::pin(inputs.camera_info.async_stream()),
            depths.camera_info,
        );
        let (detections, lost_detections) =
            Newest::new(inputs.detections.stream(), depths.detections);
        let (attitudes, lost_attitudes) = Newest::new(inputs.attitude.stream(), depths.attitude);
        let (of_tanker, lost_of_tanker) =
            Newest::new(inputs.tanker_attitude.stream(), depths.tanker_attitude);
        let lost = [
            (topic, lost_detections),
            (CAMERA_INFO, lost_infos),
            (ATTITUDE, lost_attitudes),
            (TANKER_ATTITUDE, lost_of_tanker),
        ];
        let mut last_beat = Instant::now();
        pin_mut!(camera_infos, attitudes, of_tanker, detections);
        loop {
            // In this order when several are ready: a camera info or a parameter that came before a
            // frame counts for it.
            select_biased! {
                () = stop => return Ok(()),
                _ = beats.select_next_some() => {
                    if last_beat.elapsed() > 2 * BEAT {
                        smol::Timer::after(CATCH_UP).await;
                    }
                    last_beat = Instant::now();
                    self.supervisor.alive(last_beat);
                }
                () = changes.select_next_some() => self.on_change(),
                () = resets.select_next_some() => self.with(Handler::on_reset),
                request = requests.select_next_some() => self.on_request(&request),
                sample = camera_infos.select_next_some() => self.with(|handler| match &sample {
                    Ok((message, _)) => handler.on_camera_info(message),
                    Err(error) => handler.on_undecodable(CAMERA_INFO, error),
                }),
                sample = attitudes.select_next_some() => self.with(|handler| match sample {
                    Ok(message) => handler.on_attitude(&message),
                    Err(error) => handler.on_undecodable(ATTITUDE, &error),
                }),
                sample = of_tanker.select_next_some() => self.with(|handler| match sample {
                    Ok(message) => handler.on_tanker_attitude(&message),
                    Err(error) => handler.on_undecodable(TANKER_ATTITUDE, &error),
                }),
                _ = seconds.select_next_some() => {
                    self.ros.check_alive()?;
                    let publishers = self.ros.publisher_count(topic).unwrap_or(0);
                    let graph = self.ros.graph();
                    for (topic, lost) in &lost {
                        let count = lost.take();
                        self.with(|handler| handler.on_lost(topic, count));
                    }
                    self.with(|handler| handler.on_second(publishers, &graph));
                },
                sample = detections.select_next_some() => self.with(|handler| match sample {
                    Ok(message) => handler.on_detections(message),
                    Err(error) => handler.on_undecodable(topic, &error),
                }),
            }
        }
    }

    /// Ends what runs in the background, which has to be gone before the node is.
    pub(super) fn close(self) {
        if let Some(lifecycle) = self.lifecycle {
            lifecycle.close();
        }
        self.sim_time.close();
    }

    fn with(&mut self, act: impl FnOnce(&mut Handler)) {
        if let Work::Ready(handler) = &mut self.work {
            act(handler);
        }
    }

    fn on_change(&mut self) {
        let configuration = Configuration::from(&self.parameters.snapshot());
        if let Err(error) = self.follow_clock(configuration.use_sim_time) {
            log::error!("use_sim_time has no effect: {error}");
        }
        self.with(|handler| handler.on_configuration(configuration));
    }

    fn on_request(&mut self, request: &Request) {
        let Some(lifecycle) = self.lifecycle.take() else {
            return;
        };
        lifecycle.carry_out(request, |state| self.work_of(state));
        self.lifecycle = Some(lifecycle);
    }

    /// Does what a state between two lasting ones is there for.
    fn work_of(&mut self, state: State) -> WorkResult {
        match state {
            State::Configuring => return self.configure_as_asked(),
            State::Activating => self.activate(true),
            State::Deactivating => self.activate(false),
            _ => self.clean_up(),
        }
        WorkResult::Success
    }

    fn configure_as_asked(&mut self) -> WorkResult {
        let configuration = Configuration::from(&self.parameters.snapshot());
        let files = match Files::read(&configuration) {
            Ok(files) => files,
            Err(error) => {
                log::error!("configuration failed: {error}");
                return WorkResult::Failure;
            }
        };
        match self.configure(&configuration, files) {
            Ok(()) => WorkResult::Success,
            Err(error) => {
                log::error!("configuration failed: {}", NodeError::from(error));
                WorkResult::Error
            }
        }
    }

    fn configure(
        &mut self,
        configuration: &Configuration,
        files: Files,
    ) -> Result<(), EndpointError> {
        self.clean_up();
        let outputs = match std::mem::replace(&mut self.work, Work::Closed) {
            Work::Idle(mut outputs) => {
                outputs.configure(configuration, files.setup.clone());
                *outputs
            }
            Work::Closed | Work::Ready(_) => {
                let outputs = Outputs::open(self.ros, configuration, files.setup.clone())?;
                // Inputs last: what arrives can be answered.
                self.inputs = Some(Inputs::open(self.ros, configuration)?);
                outputs
            }
        };
        self.introduce(configuration, &files.map, files.calibration.as_ref());
        let clock = Clock::live(self.clock.clone());
        let names = self.ros.names();
        let mut handler = Handler::new(configuration, files, outputs, names, &clock)?;
        handler.understand(configuration);
        self.work = Work::Ready(Box::new(handler));
        Ok(())
    }

    fn introduce(
        &self,
        configuration: &Configuration,
        map: &MarkerMap,
        calibration: Option<&CalibrationBudget>,
    ) {
        let names = self.ros.names();
        log::info!(
            "{} in domain {}, marker map {} with {} markers",
            names.fully_qualified(),
            self.environment.domain_id,
            text::quoted(map.name()),
            map.markers().len(),
        );
        log::info!("{}", topics::introduction(names, configuration));
        let sigmas = &configuration.settings.calibration;
        log::info!("{}", budget_in_words(map.budget(), sigmas, calibration));
    }

    fn activate(&mut self, on: bool) {
        self.with(|handler| handler.set_active(on));
    }

    /// Forgets the map, the camera and all that was counted; what the kept outputs know is replaced when they are
    /// configured again.
    fn clean_up(&mut self) {
        self.work = match std::mem::replace(&mut self.work, Work::Closed) {
            Work::Ready(handler) => Work::Idle(Box::new(handler.into_outputs())),
            other => other,
        };
    }
}

/// Returns a channel that ends at once.
fn no_requests() -> smol::channel::Receiver<Request> {
    smol::channel::bounded(1).1
}
