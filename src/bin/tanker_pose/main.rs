//! `tanker_pose`: tools around the node, one file a subcommand. Those that talk ROS need the feature `ros`.

#[cfg(feature = "bags")]
mod calibrate_map;
mod check;
#[cfg(feature = "ros")]
mod demo;
#[cfg(feature = "bags")]
mod evaluate;
mod options;
#[cfg(feature = "ros")]
mod parameters;
mod plot;
#[cfg(feature = "bags")]
mod recording_codes;
#[cfg(feature = "bags")]
mod replay;
mod reproduce;
#[cfg(any(feature = "ros", feature = "bags"))]
mod ros_options;
#[cfg(feature = "ros")]
mod simulate;
mod solve;
#[cfg(feature = "ros")]
mod terminal;
#[cfg(feature = "ros")]
mod tool_node;
#[cfg(feature = "ros")]
mod watch;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Vision-based relative navigation for autonomous aerial refuelling: tools.
///
/// The ROS 2 node itself is the program `tanker_pose_node`.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    tool: Tool,
}

#[derive(Debug, Subcommand)]
enum Tool {
    #[cfg(feature = "ros")]
    Demo(demo::Arguments),
    #[cfg(feature = "ros")]
    Simulate(simulate::Arguments),
    #[cfg(feature = "ros")]
    Parameters(parameters::Arguments),
    #[cfg(feature = "ros")]
    Watch(watch::Arguments),
    /// Solve frames given as JSON Lines, without ROS
    Solve(Box<solve::Arguments>),
    #[cfg(feature = "bags")]
    Replay(Box<replay::Arguments>),
    #[cfg(feature = "bags")]
    Evaluate(Box<evaluate::Arguments>),
    #[cfg(feature = "bags")]
    CalibrateMap(Box<calibrate_map::Arguments>),
    /// Check marker map, camera and error budget together before flight
    Check(Box<check::Arguments>),
    /// Reproduce the paper's experiments: tables and plots
    Reproduce(reproduce::Arguments),
}

fn main() -> ExitCode {
    let result: Result<(), Box<dyn std::error::Error>> = match Arguments::parse().tool {
        #[cfg(feature = "ros")]
        Tool::Demo(arguments) => demo::run(&arguments).map_err(Into::into),
        #[cfg(feature = "ros")]
        Tool::Simulate(arguments) => simulate::run(&arguments).map_err(Into::into),
        #[cfg(feature = "ros")]
        Tool::Parameters(arguments) => parameters::run(&arguments).map_err(Into::into),
        #[cfg(feature = "ros")]
        Tool::Watch(arguments) => watch::run(&arguments).map_err(Into::into),
        #[cfg(feature = "bags")]
        Tool::Replay(arguments) => return replay::run(&arguments),
        #[cfg(feature = "bags")]
        Tool::Evaluate(arguments) => return evaluate::run(&arguments),
        #[cfg(feature = "bags")]
        Tool::CalibrateMap(arguments) => return calibrate_map::run(&arguments),
        // Its exit code also says what it found.
        Tool::Check(arguments) => return check::run(&arguments),
        Tool::Solve(arguments) => solve::run(&arguments).map_err(Into::into),
        Tool::Reproduce(arguments) => reproduce::run(&arguments).map_err(Into::into),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("tanker_pose: {error}");
            ExitCode::FAILURE
        }
    }
}
