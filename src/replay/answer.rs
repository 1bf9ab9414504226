//! One recording, from its first message to its last.

use std::collections::BTreeMap;
use std::sync::Arc;

use ros2_node::graph::Graph;

use super::routes::{Route, Routes};
use super::sinks::{RecordingSinks, Shared};
use super::{Replay, ReplayError, Summary};
use crate::answering::clock::Clock;
use crate::answering::handler::Handler;
use crate::answering::outputs::Outputs;
use crate::pipeline::OutcomeCode;
use crate::recording::{
    Channel, ReadAhead, RecordedMessage, RecordedTopic, Recording, WriteBehind, Writer, definitions,
};
use crate::text::clip;

const SECOND_NS: u64 = 1_000_000_000;
/// Of a longer pause only this many seconds have a report: a damaged time may be centuries away.
const LONGEST_PAUSE_S: u64 = 10;
/// Most messages of one log time that are put in order: a damaged recording may have no other.
const MOST_AT_ONCE: usize = 1024;
/// Progress is told after this many messages.
const PROGRESS: u64 = 256;

/// What becomes of a topic.
#[derive(Clone, Copy)]
struct Plan {
    /// Where its messages are copied to; `None`: they are left out.
    channel: Option<Channel>,
    route: Option<Route>,
}

/// A node at work on a recording.
struct Answering {
    handler: Handler,
    clock: Clock,
    shared: Shared,
    routes: Routes,
    graph: Graph,
    /// Publishers that the recording stands for on the topic of the detections.
    publishers: usize,
    /// Absolute names of the answers.
    own: Vec<String>,
    copies: bool,
    plans: BTreeMap<*const RecordedTopic, (Arc<RecordedTopic>, Plan)>,
    given: BTreeMap<Route, u64>,
    next_report_ns: Option<u64>,
    summary: Summary,
}

impl Replay {
    /// Answers all of a recording into `writer`, which gets its messages too unless `copies` is false; `progress` is
    /// called now and then with the length of the recording and how much of it was read, in bytes.
    ///
    /// # Errors
    /// [`ReplayError`] when the answers cannot be written. What cannot be read is in the [`Summary`].
    pub fn answer(
        self,
        recording: Recording,
        writer: Writer,
        copies: bool,
        mut progress: impl FnMut(u64, u64),
    ) -> Result<Summary, ReplayError> {
        let shared = Shared::new(WriteBehind::start(writer)?);
        let mut answering = Answering::begin(self, recording.topics(), shared.clone(), copies)?;
        let mut recording = ReadAhead::start(recording).map_err(ReplayError::Thread)?;
        let mut group: Vec<RecordedMessage> = Vec::new();
        while let Some(item) = recording.next() {
            let message = match item {
                Ok(message) => message,
                Err(damage) => {
                    answering.summary.skip(damage.to_string());
                    continue;
                }
            };
            let is_later = |first: &RecordedMessage| first.log_time_ns != message.log_time_ns;
            if group.first().is_some_and(is_later) || group.len() >= MOST_AT_ONCE {
                answering.take(&group)?;
                group.clear();
            }
            group.push(message);
            answering.summary.messages += 1;
            if answering.summary.messages.is_multiple_of(PROGRESS) {
                let (size, passed) = recording.size_and_passed();
                progress(size, passed);
            }
        }
        answering.take(&group)?;
        let summary = answering.end(recording.topics())?;
        shared.finish()?;
        Ok(summary)
    }
}

impl Answering {
    fn begin(
        node: Replay,
        topics: &[Arc<RecordedTopic>],
        shared: Shared,
        copies: bool,
    ) -> Result<Self, ReplayError> {
        let Replay {
            names,
            configuration,
            files,
            ..
        } = node;
        let mut sinks = RecordingSinks {
            shared: shared.clone(),
            names: &names,
            opened: Vec::new(),
        };
        let outputs = Outputs::open(&mut sinks, &configuration, files.setup.clone())?;
        let own = sinks.opened;
        let clock = Clock::recorded();
        let mut handler = Handler::new(&configuration, files, outputs, &names, &clock)?;
        handler.understand(&configuration);
        handler.set_active(true);
        let routes = Routes::new(&configuration, &names)?;
        let mut summary = Summary::default();
        for topic in topics {
            if let Err(words) = routes.of(topic) {
                summary.skip(format!("{}: {words}", clip(&topic.name)));
            }
        }
        let graph = routes.graph(topics);
        let input = names.topic(configuration.input.topic().name)?;
        Ok(Self {
            publishers: graph.heard(&input),
            handler,
            clock,
            shared,
            routes,
            graph,
            own,
            copies,
            plans: BTreeMap::new(),
            given: BTreeMap::new(),
            next_report_ns: None,
            summary,
        })
    }

    /// Takes messages of one log time.
    fn take(&mut self, group: &[RecordedMessage]) -> Result<(), ReplayError> {
        let Some(first) = group.first() else {
            return Ok(());
        };
        self.report_until(first.log_time_ns)?;
        self.at(first.log_time_ns);
        let mut inputs = Vec::with_capacity(group.len());
        for message in group {
            let plan = self.plan(&message.topic)?;
            if let Some(channel) = plan.channel {
                self.shared
                    .write(channel, message.publish_time_ns, &message.bytes)?;
            }
            inputs.extend(plan.route.map(|route| (route, message)));
        }
        // Stable: those of one topic stay in their order.
        inputs.sort_by_key(|(route, _)| *route);
        for (route, message) in inputs {
            self.give(route, message);
        }
        Ok(self.shared.check()?)
    }

    fn give(&mut self, route: Route, message: &RecordedMessage) {
        match route.give(message, &mut self.handler) {
            Ok(frame_id) => {
                *self.given.entry(route).or_default() += 1;
                match route {
                    Route::Detections(_) => self.summary.frames += 1,
                    Route::CameraInfo => self.summary.camera(frame_id.unwrap_or_default()),
                    Route::Attitude(_) | Route::TankerAttitude => {}
                }
            }
            Err(error) => {
                self.handler.on_undecodable(route.name(), &error);
                self.summary.undecodable(&message.topic.name, &error);
            }
        }
    }

    /// Sets the time of the node and of what it writes.
    fn at(&self, time_ns: u64) {
        self.clock.advance(time_ns);
        // A damaged recording may step back; what is written never does.
        let time_ns = time_ns.max(self.shared.time_ns.get());
        self.shared.time_ns.set(time_ns);
    }

    /// Publishes the diagnostics of every second up to a time.
    fn report_until(&mut self, time_ns: u64) -> Result<(), ReplayError> {
        let mut next_ns = match self.next_report_ns {
            Some(next_ns) => next_ns,
            None => time_ns.saturating_add(SECOND_NS),
        };
        let mut left = LONGEST_PAUSE_S;
        while next_ns <= time_ns {
            if left == 0 {
                next_ns = time_ns.saturating_add(SECOND_NS);
                break;
            }
            left -= 1;
            self.at(next_ns);
            self.handler.on_second(self.publishers, &self.graph);
            next_ns = next_ns.saturating_add(SECOND_NS);
            self.shared.check()?;
        }
        self.next_report_ns = Some(next_ns);
        Ok(())
    }

    /// Returns what becomes of a topic's messages.
    fn plan(&mut self, topic: &Arc<RecordedTopic>) -> Result<Plan, ReplayError> {
        if let Some((_, plan)) = self.plans.get(&Arc::as_ptr(topic)) {
            return Ok(*plan);
        }
        let plan = Plan {
            route: self.routes.of(topic).ok().flatten(),
            channel: self.copy_of(topic)?,
        };
        self.plans
            .insert(Arc::as_ptr(topic), (Arc::clone(topic), plan));
        Ok(plan)
    }

    /// Returns where a topic's messages are copied to, if they are.
    fn copy_of(&mut self, topic: &RecordedTopic) -> Result<Option<Channel>, ReplayError> {
        if !self.copies {
            return Ok(None);
        }
        let (name, kind) = (clip(&topic.name), clip(&topic.type_name));
        if self.own.contains(&topic.name) {
            self.summary.note(format!(
                "the messages on {name} in the recording are not copied: the answers take their place"
            ));
            return Ok(None);
        }
        if topic.definition.is_none() && definitions::definition(&topic.type_name).is_none() {
            self.summary.skip(format!(
                "{name} is not copied: its type {kind} is not known, and the recording does not define it"
            ));
            return Ok(None);
        }
        Ok(Some(self.shared.channel(topic)?))
    }

    /// Publishes the last diagnostics, and says which inputs were missing.
    fn end(mut self, topics: &[Arc<RecordedTopic>]) -> Result<Summary, ReplayError> {
        if self.next_report_ns.is_some() {
            self.handler.on_second(self.publishers, &self.graph);
            self.shared.check()?;
        }
        if self.summary.messages == 0 {
            self.summary
                .skip("the recording has no messages".to_owned());
        }
        let tally = self.handler.tally();
        self.summary.outcomes = OutcomeCode::ALL
            .iter()
            .map(|code| (code.name(), tally.of(*code)))
            .filter(|(_, count)| *count > 0)
            .collect();
        let mut camera_info = "";
        for (name, route) in self.routes.iter() {
            if route == Route::CameraInfo {
                camera_info = name;
            }
            let is_misfit = topics
                .iter()
                .any(|topic| topic.name == name && self.routes.of(topic).is_err());
            if self.given.contains_key(&route) || is_misfit {
                continue;
            }
            let kind = route.type_name();
            let others: Vec<&str> = topics
                .iter()
                .filter(|topic| topic.type_name == kind && topic.name != name)
                .map(|topic| topic.name.as_str())
                .collect();
            let hint = others.first().map_or_else(String::new, |other| {
                format!(
                    "; of that type the recording has {}: use -r {name}:={}",
                    crate::text::list(&others),
                    clip(other)
                )
            });
            self.summary
                .skip(format!("no message on {name} ({kind}){hint}"));
        }
        self.summary.close(camera_info);
        Ok(self.summary)
    }
}
