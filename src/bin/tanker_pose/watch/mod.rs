//! `tanker_pose watch`: the state of a running node, live in a terminal.

mod ears;
mod heard;
mod reading;
mod screen;
mod search;
mod table;
mod words;

use std::io::{self, Write};
use std::time::{Duration, Instant};

use async_signal::Signals;
use futures::StreamExt;
use futures::future::{Either, select};
use tanker_pose::ros::environment::Environment;
use tanker_pose::ros::messages::EstimatorStatus;
use tanker_pose::ros::names::NamesError;
use tanker_pose::ros::participant::{EndpointError, MiddlewareGone, NodeOptions, RosNode};
use tanker_pose::ros::topics::STATUS;

use crate::ros_options::{RosOptions, between};
use crate::tool_node::{JoinError, ToolNode};
use ears::Ears;
use heard::Heard;
use screen::Screen;
use search::{Search, SeveralNodes};
use words::Scene;

/// What the tool is called in the graph unless it is remapped.
const NODE_NAME: &str = "tanker_watch";
/// How often messages are fetched, and with it how exact an age is.
const FETCH_EVERY: Duration = Duration::from_millis(10);
/// How often the graph is asked whether the node is there.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// How often a table is drawn, and how often a line is printed.
const DRAW_EVERY: Duration = Duration::from_millis(200);
const LINE_EVERY: Duration = Duration::from_secs(1);
/// How long --once waits unless --seconds is given.
const ONCE_S: f64 = 10.0;

/// See the state of a running node: pose, sigma, points, outcome, fit, track and faults, live.
///
/// On a terminal a table is drawn in place; elsewhere a line is printed every second. The node is found by the types
/// that it publishes, whatever it and its topics are called; --node or --ros-args choose one of several. Positions
/// stand along the camera's axes (right, down, ahead); roll, pitch and yaw are those of the tanker against a camera
/// that looks straight ahead, upright. A pose that is older than 1 s is not shown, only its age. Ctrl-C ends it.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Name of the node, as `/receiver/tanker_pose` or only `tanker_pose`; when missing, the only one there is
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
    /// DDS domain; when missing, that of `ROS_DOMAIN_ID`
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=232))]
    domain_id: Option<u16>,
    /// End after so many seconds; when missing, at Ctrl-C
    #[arg(long, value_name = "S", value_parser = between(0.1, 1e6))]
    seconds: Option<f64>,
    /// Print one line at the first pose and end; without a pose within --seconds (10) end with exit code 1
    #[arg(long)]
    once: bool,
    #[command(flatten)]
    ros: RosOptions,
}

/// Why nothing can be watched.
#[derive(Debug, thiserror::Error)]
pub enum WatchError {
    #[error(transparent)]
    Join(#[from] JoinError),
    #[error(transparent)]
    Names(#[from] NamesError),
    #[error(transparent)]
    Endpoint(#[from] EndpointError),
    #[error(transparent)]
    Several(#[from] SeveralNodes),
    #[error("no pose within {seconds} s: {reason}")]
    NoPose { seconds: f64, reason: String },
    #[error(transparent)]
    MiddlewareGone(#[from] MiddlewareGone),
}

/// Watches until it is to end.
pub fn run(arguments: &Arguments) -> Result<(), WatchError> {
    let options = NodeOptions::new().start_parameter_services(false);
    let mut node = ToolNode::join(NODE_NAME, &arguments.ros, arguments.domain_id, options)?;
    let result = Watch::new(arguments, &node.ros, &node.environment)
        .map_err(WatchError::from)
        .and_then(|mut watch| smol::block_on(watch.run(&mut node.ros, &mut node.signals)));
    node.leave();
    result
}

struct Watch {
    once: bool,
    seconds: Option<f64>,
    began: Instant,
    domain_id: u16,
    search: Search,
    ears: Ears,
    heard: Heard,
    /// The node that `heard` is of.
    watched: Option<String>,
    screen: Option<Screen>,
    /// What is listened to, as was printed last.
    introduced: Vec<String>,
}

impl Watch {
    fn new(
        arguments: &Arguments,
        ros: &RosNode,
        environment: &Environment,
    ) -> Result<Self, NamesError> {
        let began = Instant::now();
        let status = ros.names().topic(STATUS.name)?;
        // A namespace or a remap selects the node; the plain name does not.
        let status = (status != format!("/{}", STATUS.name)).then_some(status);
        let node = arguments.node.as_deref();
        Ok(Self {
            once: arguments.once,
            seconds: arguments.seconds.or(arguments.once.then_some(ONCE_S)),
            began,
            domain_id: environment.domain_id,
            search: Search::new(node, status.as_deref(), environment, began),
            ears: Ears::new(ros)?,
            heard: Heard::new(began),
            watched: None,
            screen: if arguments.once { None } else { Screen::open() },
            introduced: Vec::new(),
        })
    }

    async fn run(&mut self, ros: &mut RosNode, signals: &mut Signals) -> Result<(), WatchError> {
        let show_every = if self.screen.is_some() {
            DRAW_EVERY
        } else {
            LINE_EVERY
        };
        let (mut look_at, mut show_at) = (self.began, self.began + show_every);
        loop {
            let now = Instant::now();
            if now >= look_at {
                look_at = now + LOOK_EVERY;
                self.look(ros, now)?;
            }
            if let Some(found) = self.search.found() {
                self.ears.drain(&found.participants, &mut self.heard, now);
            }
            let over = self
                .seconds
                .is_some_and(|limit| (now - self.began).as_secs_f64() >= limit);
            if self.once {
                if self.heard.pose(now).is_some() && self.heard.status(now).is_some() {
                    self.show(now);
                    return Ok(());
                }
                if over {
                    return Err(self.no_pose(now));
                }
            } else if over || now >= show_at {
                show_at = now + show_every;
                if !self.show(now) || over {
                    return Ok(());
                }
            }
            if let Either::Right(_) = select(smol::Timer::after(FETCH_EVERY), signals.next()).await
            {
                return Ok(());
            }
        }
    }

    fn look(&mut self, ros: &mut RosNode, now: Instant) -> Result<(), WatchError> {
        ros.check_alive()?;
        self.search.look(&ros.domain::<EstimatorStatus>(), now)?;
        if let Some(found) = self.search.found() {
            self.ears.attend(ros, &found.node)?;
            let name = found.name();
            if self.watched.as_ref() != Some(&name) {
                // Messages of another node do not apply to this one.
                self.heard = Heard::new(now);
                self.watched = Some(name);
            }
        }
        Ok(())
    }

    fn no_pose(&self, now: Instant) -> WatchError {
        WatchError::NoPose {
            seconds: self.seconds.unwrap_or(ONCE_S),
            reason: self.scene(now).state().1,
        }
    }

    fn scene(&self, now: Instant) -> Scene<'_> {
        let found = self.search.found();
        Scene {
            heard: &self.heard,
            missing: found.is_none().then(|| self.search.missing(now)),
            processes: found.map_or(0, |found| found.participants.len()),
            now,
        }
    }

    /// Shows the moment; returns whether anybody looks. A reader that has seen enough is no fault.
    fn show(&mut self, now: Instant) -> bool {
        let (title, topics) = self.title();
        let scene = self.scene(now);
        let (rows, line) = (table::rows(&scene), table::line(&scene));
        let shown = match &mut self.screen {
            Some(screen) => screen.draw(&title, &rows),
            None => self.print(&topics, &title, &line, now),
        };
        shown.is_ok()
    }

    fn print(
        &mut self,
        topics: &[String],
        title: &str,
        line: &str,
        now: Instant,
    ) -> io::Result<()> {
        let mut out = io::stdout().lock();
        if !self.once && !topics.is_empty() && topics != self.introduced {
            writeln!(out, "watching {title}: {}", topics.join(", "))?;
            self.introduced = topics.to_vec();
        }
        writeln!(out, "{:.1} s | {line}", (now - self.began).as_secs_f64())?;
        out.flush()
    }

    fn title(&self) -> (String, Vec<String>) {
        let domain = self.domain_id;
        match self.search.found() {
            None => (format!("domain {domain}"), Vec::new()),
            Some(found) => (
                format!("{} in domain {domain}", found.name()),
                self.ears.topics().into_iter().map(str::to_owned).collect(),
            ),
        }
    }
}
