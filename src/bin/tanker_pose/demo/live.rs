//! The output of the demo during the flight.

use std::time::Duration;

use indicatif::ProgressBar;
use tanker_pose::pipeline::OutcomeCode;
use tanker_pose::ros::environment::Environment;
use tanker_pose::simulation::Approach;

use super::ledger::{Estimate, Frame, Ledger};
use super::plan::{Block, Plan};
use super::statistics;
use super::words::plainly;
use crate::simulate::ApproachOptions;
use crate::terminal::{progress_bar, say};

const HEADER: &str = "
  time    ahead  found (m)              error and 1 sigma (cm)               attitude     NEES  latency
   (s)      (m)   right   down  ahead   right       down        ahead        error (deg)   (6)  p50 (ms)";

/// A line about once a second of flight, and whatever happens in between.
pub struct Live {
    bar: ProgressBar,
    silent: bool,
    what: String,
    next_line_s: f64,
    /// Of the latest frame, if that was refused without being asked for.
    refusal: Option<OutcomeCode>,
}

impl Live {
    /// Returns the printer: silent where a program reads the summary.
    pub fn new(json: bool, verbose: bool, options: &ApproachOptions, approach: &Approach) -> Self {
        // Log lines would tear a bar apart.
        let bar = if json || verbose {
            ProgressBar::hidden()
        } else {
            progress_bar(u64::from(approach.frame_count()))
        };
        Self {
            bar,
            silent: json,
            what: format!("{options}, tanker {:?}", options.marker_map),
            next_line_s: 0.0,
            refusal: None,
        }
    }

    fn say(&self, line: &str) {
        if !self.silent {
            say(&self.bar, line);
        }
    }

    /// Prints what will happen.
    pub fn introduce(&self, environment: &Environment, world: Option<String>) {
        self.say(&format!(
            "Simulated approach: {}\n\
             Node /tanker_pose and its sensor talk over DDS on loopback, domain {}.",
            self.what, environment.domain_id
        ));
        if let Some(world) = world {
            self.say(&format!(
                "Tanker and camera are drawn from what the node is told of their errors.\n{world}"
            ));
        }
    }

    /// Prints that the node was found.
    pub fn connected(&self, after: Duration) {
        self.say(&format!(
            "First pose after {:.1} s. All positions are the tanker's in the camera; errors are against the truth.",
            after.as_secs_f64()
        ));
        self.say(HEADER);
    }

    /// Records a frame that was sent.
    pub fn sent(&self, frame: &Frame) {
        self.bar
            .set_message(format!("{:.1} m ahead", frame.ahead_m()));
    }

    /// Prints that the schedule was moved.
    pub fn held_up(&self, late: Duration) {
        let late_s = late.as_secs_f64();
        self.say(&format!("delayed by {late_s:.1} s: continuing from here"));
    }

    /// Prints which fault follows.
    pub fn announce(&self, block: Block) {
        self.say(&format!(
            "  INJECTED in {} frames from {}: {}",
            block.length,
            block.first,
            block.fault.announcement()
        ));
    }

    /// Records a frame that was answered.
    pub fn answered(&mut self, frame: &Frame, plan: &Plan, ledger: &Ledger) {
        self.bar.inc(1);
        let code = frame.verdict.as_ref().map(|verdict| verdict.code);
        if let Some(block) = plan.block(frame.index) {
            if block.first == frame.index {
                self.say(&verdict(frame));
            }
        } else {
            let refusal = code.filter(|code| *code != OutcomeCode::Ok);
            // Once, until something else happens: thirty equal lines a second add nothing.
            if refusal.is_some() && refusal != self.refusal {
                self.say(&verdict(frame));
            }
            self.refusal = refusal;
        }
        if let Some(estimate) = frame.trusted()
            && frame.time_s >= self.next_line_s
        {
            self.next_line_s = frame.time_s.floor() + 1.0;
            self.say(&line(frame, estimate, ledger));
        }
    }

    /// Makes room for the summary.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn verdict(frame: &Frame) -> String {
    match &frame.verdict {
        None => String::new(),
        Some(verdict) if verdict.code == OutcomeCode::Ok => {
            let ids: Vec<String> = verdict.rejected_ids.iter().map(u32::to_string).collect();
            match ids.as_slice() {
                [] => "  node: estimated, nothing rejected".to_owned(),
                ids => format!("  node: estimated without marker {}", ids.join(", ")),
            }
        }
        Some(verdict) => format!(
            "  node: REFUSED, {}: {}",
            plainly(verdict.code),
            verdict.message
        ),
    }
}

fn line(frame: &Frame, estimate: &Estimate, ledger: &Ledger) -> String {
    let found = &estimate.found_camera_from_tanker.translation;
    let covariance = &estimate.covariance.0;
    let along = |axis: usize| {
        // Found less truth, as people read an error.
        let error_cm = -100.0 * estimate.error[axis];
        let sigma_cm = 100.0 * covariance[(axis, axis)].sqrt();
        format!("{error_cm:6.1} ±{sigma_cm:<4.1}")
    };
    let turn_deg = estimate.error.fixed_rows::<3>(3).norm().to_degrees();
    let turn_variance: f64 = (3..6).map(|axis| covariance[(axis, axis)]).sum();
    format!(
        "{:6.1}  {:7.2} {:7.2}{:7.2}{:7.2}  {}{}{} {turn_deg:6.2} ±{:.2}  {:7.1}  {:8.2}",
        frame.time_s,
        frame.ahead_m(),
        found.x,
        found.y,
        found.z,
        along(0),
        along(1),
        along(2),
        turn_variance.sqrt().to_degrees(),
        estimate.nees,
        statistics::percentile(&ledger.latencies_ms(), 0.5).unwrap_or(f64::NAN),
    )
}
