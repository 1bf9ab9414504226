//! The ROS 2 node: reads its command line and environment, and runs until a signal.

use std::io::Write;
use std::process::ExitCode;

use tanker_pose::ros::arguments::{self, Command};
use tanker_pose::ros::environment::Environment;
use tanker_pose::ros::node;

/// What `--help` prints before the ROS arguments.
const ABOUT: &str = "\
Estimates a tanker's pose from detected beacons, and publishes it with its covariance.

Usage: tanker_pose_node [--ros-args [ROS ARGUMENT]... [--]]
";
/// And what it prints after them.
const DETAILS: &str = "\
Options:
  -h, --help                     print this help
  -V, --version                  print the version

Topics in: camera_info; feature_points, or detections with parameter input; the receiver's attitude, with the outputs
  for flight stacks that need it; tanker_attitude, with reported_attitude_sigma_deg. Out: pose, odometry, status, /diagnostics; by parameters /tf, markers, receptacle and
  those of PX4 and MAVROS. Services: ~/reset, those of parameters, and with lifecycle those of a managed node.
Environment: ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE, ROS_LOCALHOST_ONLY, RUST_LOG.
All parameters stand with their defaults and comments in config/tanker_pose.yaml.
";

/// Exit code for a command line that cannot be understood.
const USAGE: u8 = 2;

/// Exit code for a fault of this program or a library of it, as in sysexits.h.
const INTERNAL_FAULT: i32 = 70;

fn main() -> ExitCode {
    // A middleware thread that ends would leave a node that neither hears nor speaks: end instead, so
    // that a supervisor of the node sees it.
    std::panic::set_hook(Box::new(|fault| {
        let _ = writeln!(
            std::io::stderr(),
            "tanker_pose_node: internal fault, ending: {fault}"
        );
        std::process::exit(INTERNAL_FAULT);
    }));
    let arguments: Result<Vec<String>, _> = std::env::args_os()
        .skip(1)
        .map(std::ffi::OsString::into_string)
        .collect();
    let Ok(arguments) = arguments else {
        return fail("an argument is not valid UTF-8", USAGE);
    };
    let arguments = match Command::parse(&arguments) {
        Ok(Command::Run(arguments)) => arguments,
        Ok(Command::Help) => {
            let help = [ABOUT, arguments::HELP, DETAILS].join("\n");
            return say(help.trim_end());
        }
        Ok(Command::Version) => {
            return say(concat!("tanker_pose_node ", env!("CARGO_PKG_VERSION")));
        }
        Err(error) => return fail(&format!("{error} (see --help)"), USAGE),
    };
    let environment = match Environment::from_process() {
        Ok(environment) => environment,
        Err(error) => return fail(&error.to_string(), 1),
    };
    match node::run(&arguments, &environment) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(&error.to_string(), 1),
    }
}

// A closed pipe at the other end is no reason to panic, as `println!` and `eprintln!` would.

fn say(text: &str) -> ExitCode {
    let _ = writeln!(std::io::stdout(), "{text}");
    ExitCode::SUCCESS
}

fn fail(message: &str, code: u8) -> ExitCode {
    let _ = writeln!(std::io::stderr(), "tanker_pose_node: {message}");
    ExitCode::from(code)
}
