//! `tanker_pose`: tools around the node, one file a subcommand.

mod options;
mod solve;

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
    /// Solve frames given as JSON Lines, without ROS
    Solve(solve::Arguments),
}

fn main() -> ExitCode {
    let result = match Arguments::parse().tool {
        Tool::Solve(arguments) => solve::run(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("tanker_pose: {error}");
            ExitCode::FAILURE
        }
    }
}
