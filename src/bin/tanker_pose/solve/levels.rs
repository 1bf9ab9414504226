//! Protection levels in the lines that `solve` writes.

use serde::Serialize;
use tanker_pose::estimation::ErrorBudget;
use tanker_pose::integrity::{FrameIntegrity, IntegrityMonitor, Unavailable};
use tanker_pose::pipeline::IntegrityState;

/// What protection levels are named by.
pub struct Levels<'a> {
    pub monitor: &'a IntegrityMonitor,
    pub budget: Option<&'a ErrorBudget>,
}

#[derive(Debug, Serialize)]
pub struct OutputLevels {
    state: String,
    message: String,
    /// `null` without levels.
    unmonitored_probability: Option<f64>,
    points: Vec<OutputPoint>,
}

/// Ahead, lateral, vertical in the receiver's axes, m.
#[derive(Debug, Serialize)]
struct OutputPoint {
    name: String,
    protection_level: [f64; 3],
    sigma: [f64; 3],
    /// Empty where noise and budget alone set the level.
    weakest: [String; 3],
}

impl Levels<'_> {
    pub fn output(&self, levels: &Result<FrameIntegrity, Unavailable>) -> OutputLevels {
        let mode = |index: usize| {
            let name = self.budget.and_then(|budget| budget.mode_name(index));
            name.map_or_else(|| format!("mode {index}"), str::to_owned)
        };
        let declared = self.monitor.points();
        let message = match levels {
            Ok(found) => found
                .above_limit
                .as_ref()
                .map(|above| above.in_words(&declared[above.point].name, mode)),
            Err(reason) => Some(reason.in_words(mode)),
        };
        let points = levels.iter().flat_map(|found| &found.points).zip(declared);
        OutputLevels {
            state: IntegrityState::from(levels).name().to_ascii_lowercase(),
            message: message.unwrap_or_default(),
            unmonitored_probability: levels
                .as_ref()
                .ok()
                .map(|found| found.unmonitored_probability),
            points: points
                .map(|(found, declared)| OutputPoint {
                    name: declared.name.clone(),
                    protection_level: found.level_m,
                    sigma: found.sigma_m,
                    weakest: found
                        .weakest
                        .map(|fault| fault.map_or_else(String::new, |fault| fault.in_words(mode))),
                })
                .collect(),
        }
    }
}
