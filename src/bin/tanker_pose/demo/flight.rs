//! The demo's course: find the node, fly, wait for the last answers.

use std::time::{Duration, Instant};

use tanker_pose::pipeline::{OutcomeCode, Stamp};
use tanker_pose::ros::messages::{EstimatorStatus, PoseWithCovarianceStamped};
use tanker_pose::simulation::Approach;
use tanker_pose::target::MarkerMap;

use super::error::DemoError;
use super::ledger::{Frame, Ledger};
use super::live::Live;
use super::plan::Plan;
use crate::simulate::source::{Source, SourceError};
use crate::simulate::{ApproachOptions, Pace};

/// Frames a second until the first answer.
const PROBE_HZ: f64 = 20.0;
/// For the last answers; they take about a millisecond.
const LAST_ANSWERS: Duration = Duration::from_secs(2);

/// How a flight ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// All frames were sent.
    Complete,
    /// By a signal.
    Interrupted,
}

/// Where the demo is on its course.
#[derive(Debug, Clone, Copy)]
enum Phase {
    /// Frames are sent until one is answered by pose and status: then all four topics are known to
    /// work both ways, and none of the flight's frames can be lost to discovery.
    Probing { next: u32 },
    /// The flight's frames are sent.
    Flying { next: u32 },
    /// All are sent; some may not be answered yet.
    Waiting { until: Instant },
}

/// The flight with all that is known about it.
pub struct Flight {
    approach: Approach,
    plan: Plan,
    rate_hz: f64,
    pace: Pace,
    phase: Phase,
    started: Instant,
    patience: Duration,
    end: Option<End>,
    probes: ProbeAnswers,
    ledger: Ledger,
}

/// Stamps of answered probes.
#[derive(Debug, Default)]
struct ProbeAnswers {
    pose: Option<Stamp>,
    status: Option<Stamp>,
    refusal: Option<String>,
}

impl Flight {
    /// Returns a flight that begins to look for the node when it is first asked to act.
    pub fn new(
        approach: Approach,
        options: &ApproachOptions,
        faults_on: Option<&MarkerMap>,
        patience: Duration,
    ) -> Self {
        let now = Instant::now();
        Self {
            plan: faults_on.map_or_else(Plan::default, |map| {
                Plan::new(approach.frame_count(), map, options.seed)
            }),
            approach,
            rate_hz: options.rate_hz,
            pace: Pace::new(PROBE_HZ, now),
            phase: Phase::Probing { next: 0 },
            started: now,
            patience,
            end: None,
            probes: ProbeAnswers::default(),
            ledger: Ledger::default(),
        }
    }

    /// Returns the frames, with their answers.
    pub const fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// Returns how long node and demo may look for each other.
    pub const fn patience(&self) -> Duration {
        self.patience
    }

    /// Returns how the flight ended, once it did and nothing is left to wait for.
    pub fn end(&self) -> Option<End> {
        self.end.filter(|_| self.ledger.missing() == 0)
    }

    /// Returns when to act next.
    pub fn due(&self) -> Instant {
        match self.phase {
            Phase::Probing { next } | Phase::Flying { next } => self.pace.due(u64::from(next)),
            Phase::Waiting { until } => until,
        }
    }

    /// Does what is due; returns how the flight ended, when the wait for the last answers is over.
    pub fn act(&mut self, source: &mut Source, live: &mut Live) -> Result<Option<End>, DemoError> {
        match self.phase {
            Phase::Probing { next } => {
                if self.started.elapsed() > self.patience {
                    return Err(self.no_answer());
                }
                let frame = self.approach.frame(next % self.approach.frame_count());
                source.publish(&frame.truth_camera_from_tanker, &frame.detections)?;
                self.phase = Phase::Probing { next: next + 1 };
            }
            Phase::Flying { next } => {
                if let Some(late) = self.pace.make_up(u64::from(next), Instant::now()) {
                    live.held_up(late);
                }
                self.send(next, source, live)?;
                if next + 1 < self.approach.frame_count() {
                    self.phase = Phase::Flying { next: next + 1 };
                } else {
                    self.wait_for_answers(End::Complete);
                }
            }
            Phase::Waiting { .. } => return Ok(self.end),
        }
        Ok(None)
    }

    /// Ends the flight early.
    pub fn interrupt(&mut self) {
        self.wait_for_answers(End::Interrupted);
    }

    /// Takes a pose.
    pub fn on_pose(&mut self, message: &PoseWithCovarianceStamped, at: Instant, live: &mut Live) {
        self.probes.pose = self.probes.pose.max(Some(message.header.stamp.into()));
        if self.ledger.on_pose(message, at).is_some() {
            self.show(message.header.stamp.into(), live);
        }
        self.take_off(live);
    }

    /// Takes a status.
    pub fn on_status(&mut self, message: EstimatorStatus, live: &mut Live) {
        let stamp = message.header.stamp.into();
        if message.outcome == OutcomeCode::Ok.number() {
            self.probes.status = self.probes.status.max(Some(stamp));
        } else {
            self.probes.refusal = Some(message.message.clone());
        }
        if self.ledger.on_status(message).is_some() {
            self.show(stamp, live);
        }
        self.take_off(live);
    }

    fn show(&self, stamp: Stamp, live: &mut Live) {
        if let Some(frame) = self.ledger.get(stamp) {
            live.answered(frame, &self.plan, &self.ledger);
        }
    }

    fn take_off(&mut self, live: &mut Live) {
        let Phase::Probing { .. } = self.phase else {
            return;
        };
        if self.probes.pose.is_some() && self.probes.pose == self.probes.status {
            live.connected(self.started.elapsed());
            self.pace = Pace::new(self.rate_hz, Instant::now());
            self.phase = Phase::Flying { next: 0 };
        }
    }

    fn send(
        &mut self,
        index: u32,
        source: &mut Source,
        live: &mut Live,
    ) -> Result<(), SourceError> {
        let mut simulated = self.approach.frame(index);
        let fault = self.plan.inject(index, &mut simulated.detections);
        if let Some(block) = self.plan.block(index).filter(|block| block.first == index) {
            live.announce(block);
        }
        let truth_camera_from_tanker = simulated.truth_camera_from_tanker;
        let sent = source.publish(&truth_camera_from_tanker, &simulated.detections)?;
        let frame = Frame {
            index,
            time_s: simulated.time_s,
            truth_camera_from_tanker,
            fault,
            sent: sent.at,
            estimate: None,
            verdict: None,
        };
        live.sent(&frame);
        self.ledger.enter(sent.stamp, frame);
        Ok(())
    }

    fn wait_for_answers(&mut self, end: End) {
        self.end = Some(end);
        self.phase = Phase::Waiting {
            until: Instant::now() + LAST_ANSWERS,
        };
    }

    fn no_answer(&self) -> DemoError {
        let reason = match (&self.probes.refusal, self.probes.pose, self.probes.status) {
            (_, Some(_), _) => "poses arrive, but no status that belongs to one".to_owned(),
            (_, None, Some(_)) => "the node answers, but its poses do not arrive".to_owned(),
            (Some(refusal), None, None) => format!("the node refuses every frame: {refusal}"),
            (None, None, None) => "no frame is answered".to_owned(),
        };
        DemoError::Discovery {
            wait_s: self.patience.as_secs_f64(),
            reason,
        }
    }
}
