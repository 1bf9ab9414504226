//! Log messages to the console as ROS nodes print them, and to /rosout.
//!
//! Libraries only use the `log` crate; where their lines go is decided here.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError, RwLock};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use log::{Level, LevelFilter, Log, Metadata, Record};
use ros2_client::builtin_interfaces::Time;
use ros2_client::ros2::LogLevel;
use ros2_client::{NodeLoggingHandle, RosoutRaw};

use super::arguments::Arguments;
use super::flood::Flood;
use super::names::NodeNames;
use crate::text;

/// Other crates' lines from warnings on, but the middleware's from errors on: it warns of every packet and every
/// string that is not as it should be. Not even its errors about the order of samples: while the system's clock is
/// behind there is one for every look at an input, and [`super::system_clock`] says it. What the client library says of
/// `ROS_DISTRO` is an error to it even where both distributions speak alike; [`super::distribution`] tells the two
/// apart.
const DEFAULT_FILTER: &str = "warn,rustdds=error,rustdds::structure::dds_cache=off,\
    ros2_client=error,ros2_client::distributions=off,cdr_encoding=error";
/// This crate's own lines are logged under the node's name, too.
const KIT: &str = "ros2_node";
/// The log target of the client library's copies of /rosout messages.
const ECHO: &str = "ros2_client::rosout";
/// Leaving, `RustDDS` reports as errors that it was not a member of groups which it never joined.
const FALSE_ALARM_AT_END: &str = "rustdds::network";
/// Of every publisher or subscription of `/clock` `RustDDS` reports that its type is not the one by which
/// the client library has subscribed, which is the wrong one.
const FALSE_ALARM_OF_CLOCK: (&str, &str) = (
    "rustdds::discovery::discovery_db",
    "type was: \"builtin_interfaces::msg::dds_::Time_\"",
);

static LOGGER: OnceLock<NodeLog> = OnceLock::new();

struct NodeLog {
    console: env_logger::Logger,
    console_on: bool,
    name: String,
    own: &'static str,
    rosout: RwLock<Option<NodeLoggingHandle>>,
    leaving: AtomicBool,
    /// Of errors and warnings of other crates; who asks for more of them gets it.
    flood: Mutex<Flood>,
}

/// Starts logging for the node of this name. What `--log-level` says goes before `RUST_LOG`, and that
/// before the defaults. A second call has no effect.
///
/// `own` is what the targets of the program's own lines begin with, as the names of its crates do. These lines are
/// shown from info on, stand under the node's name, and only they go to /rosout: publishing those of the middleware
/// would bring forth more of them.
pub fn start(arguments: &Arguments, names: &NodeNames, own: &'static str) {
    let name = logger_name(names);
    let variable = std::env::var("RUST_LOG").ok();
    let mut builder = console(arguments, names, own, variable.as_deref());
    let line_name = name.clone();
    builder.format(move |out, record| write_line(out, record, &line_name, own));
    let logger = NodeLog {
        console: builder.build(),
        console_on: arguments.console_logs,
        name,
        own,
        rosout: RwLock::new(None),
        leaving: AtomicBool::new(false),
        flood: Mutex::new(Flood::new()),
    };
    let level = logger.console.filter();
    if LOGGER.set(logger).is_ok()
        && let Some(logger) = LOGGER.get()
        && log::set_logger(logger).is_ok()
    {
        log::set_max_level(level);
    }
}

/// Returns the filter: the defaults, changed by the variable and by `--log-level`.
fn console(
    arguments: &Arguments,
    names: &NodeNames,
    own: &str,
    variable: Option<&str>,
) -> env_logger::Builder {
    let name = logger_name(names);
    let mut builder = env_logger::Builder::new();
    builder.parse_filters(DEFAULT_FILTER);
    for own in [own, KIT] {
        builder.filter(Some(own), LevelFilter::Info);
    }
    if let Some(filters) = variable {
        builder.parse_filters(&of_this_crate(filters, own));
        builder.parse_filters(filters);
    }
    for (logger, level) in &arguments.log_levels {
        match logger {
            Some(logger) if !is_node(logger, &name, names) => {
                builder.filter(Some(&logger.replace('.', "::")), *level)
            }
            _ => builder.filter(Some(own), *level).filter(Some(KIT), *level),
        };
    }
    builder
}

/// Returns for this crate what `filters` say of `own`: to users both are the node.
fn of_this_crate(filters: &str, own: &str) -> String {
    let (levels, _) = filters.split_once('/').unwrap_or((filters, ""));
    let level = |filter: &str| {
        let level = filter.trim().strip_prefix(own)?;
        let is_whole = level.is_empty() || level.starts_with('=');
        is_whole.then(|| format!("{KIT}{level}"))
    };
    let all: Vec<String> = levels.split(',').filter_map(level).collect();
    all.join(",")
}

/// Sends log messages to /rosout too, from now on.
pub fn start_rosout(handle: NodeLoggingHandle) {
    set_rosout(Some(handle), false);
}

/// Ends [`start_rosout`]: the handle holds a publisher of the node, which has to be gone
/// before the node is.
pub fn stop_rosout() {
    set_rosout(None, true);
}

fn set_rosout(handle: Option<NodeLoggingHandle>, leaving: bool) {
    if let Some(logger) = LOGGER.get() {
        let mut rosout = logger
            .rosout
            .write()
            .unwrap_or_else(PoisonError::into_inner);
        *rosout = handle;
        logger.leaving.store(leaving, Ordering::Relaxed);
    }
}

/// Returns the name that rcl gives to the logger of a node: namespace and name, joined by dots.
fn logger_name(names: &NodeNames) -> String {
    names
        .fully_qualified()
        .trim_start_matches('/')
        .replace('/', ".")
}

/// Whether `--log-level` means the node's own logger; any other is named as its crate is.
fn is_node(logger: &str, logger_name: &str, names: &NodeNames) -> bool {
    logger == logger_name || logger == names.base_name()
}

fn write_line(
    out: &mut env_logger::fmt::Formatter,
    record: &Record,
    name: &str,
    own: &str,
) -> std::io::Result<()> {
    let since_epoch = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    let (sec, nanosec) = (since_epoch.as_secs(), since_epoch.subsec_nanos());
    let style = out.default_level_style(record.level());
    let who = if is_own(record.target(), own) {
        name
    } else {
        record.target()
    };
    writeln!(
        out,
        "{style}[{}] [{sec}.{nanosec:09}] [{who}]: {}{style:#}",
        record.level(),
        text::line(&record.args().to_string())
    )
}

fn is_own(target: &str, own: &str) -> bool {
    target.starts_with(own) || target.starts_with(KIT)
}

impl Log for NodeLog {
    fn enabled(&self, metadata: &Metadata) -> bool {
        self.console.enabled(metadata)
    }

    fn log(&self, record: &Record) {
        if !self.console.matches(record) || record.target().starts_with(ECHO) {
            return;
        }
        let leaving = self.leaving.load(Ordering::Relaxed);
        if leaving && record.target().starts_with(FALSE_ALARM_AT_END) {
            return;
        }
        let (source, wrong_type) = FALSE_ALARM_OF_CLOCK;
        if record.target() == source && record.args().to_string().contains(wrong_type) {
            return;
        }
        let is_own = is_own(record.target(), self.own);
        if self.console_on && (is_own || self.is_shown(record)) {
            self.console.log(record);
        }
        if !is_own {
            return;
        }
        let rosout = self.rosout.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(handle) = rosout.as_ref() {
            handle.rosout_raw(
                Time::now(),
                ros_level(record.level()),
                &self.name,
                &text::line(&record.args().to_string()),
                record.file().unwrap_or_default(),
                record.module_path().unwrap_or_default(),
                record.line().unwrap_or_default(),
            );
        }
    }

    fn flush(&self) {
        self.console.flush();
    }
}

impl NodeLog {
    /// Returns whether a line of another crate is shown; says before it how many were not.
    fn is_shown(&self, record: &Record) -> bool {
        if record.level() > Level::Warn {
            return true;
        }
        let mut flood = self.flood.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(withheld) = flood.take(Instant::now()) else {
            return false;
        };
        drop(flood);
        if withheld > 0 {
            let words = format_args!(
                "{withheld} more errors and warnings of the middleware were left out of this log"
            );
            self.console.log(
                &Record::builder()
                    .level(Level::Warn)
                    .target(KIT)
                    .args(words)
                    .build(),
            );
        }
        true
    }
}

const fn ros_level(level: Level) -> LogLevel {
    match level {
        Level::Error => LogLevel::Error,
        Level::Warn => LogLevel::Warn,
        Level::Info => LogLevel::Info,
        Level::Debug | Level::Trace => LogLevel::Debug,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names() -> NodeNames {
        let remap = crate::rules::remap("__ns:=/left").expect("the rule is well formed");
        NodeNames::new("sensor", &[remap]).expect("the names are valid")
    }

    #[test]
    fn loggers_are_named_as_in_ros() {
        let names = names();
        let own = logger_name(&names);
        assert_eq!(own, "left.sensor");
        assert!(is_node("left.sensor", &own, &names) && is_node("sensor", &own, &names));
        assert!(!is_node("rustdds", &own, &names));
    }

    #[test]
    fn default_filter_keeps_own_lines_and_quietens_the_middleware() {
        let (arguments, _) =
            Arguments::split(&["--ros-args", "--log-level", "debug"].map(Into::into))
                .expect("the arguments are well formed");
        let logger = console(&arguments, &names(), "sensor_driver", None).build();
        let enabled = |target: &str, level| {
            logger.enabled(&Metadata::builder().target(target).level(level).build())
        };
        assert!(enabled("sensor_driver::device", Level::Debug));
        assert!(enabled("sensor_driver_node", Level::Debug));
        assert!(enabled("ros2_node::clock", Level::Debug));
        assert!(!enabled("rustdds::rtps", Level::Warn));
        assert!(!enabled("polling", Level::Info));
        assert!(enabled("rustdds::rtps", Level::Error));
    }

    #[test]
    fn arguments_go_before_the_variable_and_that_before_the_defaults() {
        let arguments = ["--ros-args", "--log-level", "rustdds.rtps:=warn"].map(Into::into);
        let (arguments, _) = Arguments::split(&arguments).expect("they are well formed");
        let variable = Some("rustdds=off,sensor_driver=error");
        let logger = console(&arguments, &names(), "sensor_driver", variable).build();
        let enabled = |target: &str, level| {
            logger.enabled(&Metadata::builder().target(target).level(level).build())
        };
        assert!(!enabled("sensor_driver", Level::Warn));
        assert!(enabled("ros2_node", Level::Error));
        assert!(!enabled("ros2_node", Level::Warn));
        assert!(!enabled("rustdds::discovery", Level::Error));
        assert!(enabled("rustdds::rtps", Level::Warn));
    }

    #[test]
    fn the_variable_says_for_this_crate_what_it_says_for_the_node() {
        let given = "warn, driver=debug,driver::a=off,drivers,ros2_node=info/word";
        assert_eq!(of_this_crate(given, "driver"), "ros2_node=debug");
        assert_eq!(of_this_crate("driver", "driver"), "ros2_node");
        assert_eq!(of_this_crate("info", "driver"), "");
    }
}
