//! What was read, answered and left out.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Most lines about damage, and most camera frames, that are kept: a recording may be damaged everywhere.
const MOST: usize = 20;

/// What became of a recording.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Summary {
    /// Messages that were read.
    pub messages: u64,
    /// Frames that were answered, each with a status.
    pub frames: u64,
    /// Frames by their outcome, as `EstimatorStatus` names it.
    pub outcomes: Vec<(&'static str, u64)>,
    /// What could not be read or used, in words; of many the first, and how many there were.
    pub skipped: Vec<String>,
    skipped_count: u64,
    /// What was read and used, but may surprise.
    pub notes: Vec<String>,
    undecodable: BTreeMap<String, (u64, String)>,
    camera_frames: BTreeSet<String>,
}

impl Summary {
    /// Records a part that could not be read or used.
    pub(super) fn skip(&mut self, words: String) {
        self.skipped_count += 1;
        if self.skipped.len() < MOST {
            self.skipped.push(words);
        }
    }

    pub(super) fn note(&mut self, words: String) {
        self.notes.push(words);
    }

    /// Records a message that could not be decoded.
    pub(super) fn undecodable(&mut self, topic: &str, reason: &dyn fmt::Display) {
        if let Some((count, _)) = self.undecodable.get_mut(topic) {
            *count += 1;
        } else if self.undecodable.len() < MOST {
            let reason = reason.to_string();
            self.undecodable.insert(topic.to_owned(), (1, reason));
        }
    }

    /// Records the frame that a camera info names.
    pub(super) fn camera(&mut self, frame: String) {
        if self.camera_frames.len() < MOST {
            self.camera_frames.insert(frame);
        }
    }

    /// Puts into words what was counted.
    pub(super) fn close(&mut self, camera_info: &str) {
        for (topic, (count, reason)) in std::mem::take(&mut self.undecodable) {
            let topic = crate::text::clip(&topic);
            self.skip(format!(
                "{count} message(s) on {topic} cannot be decoded: {reason}"
            ));
        }
        if self.camera_frames.len() > 1 {
            let frames: Vec<&String> = self.camera_frames.iter().collect();
            self.notes.push(format!(
                "camera infos on {camera_info} are of {} cameras, {}: each frame is answered with the last one before it, and \
                 refused if that is of another camera; give each camera topics of its own and replay it alone, by remaps",
                frames.len(),
                crate::text::list(&frames)
            ));
        }
        let left = self.skipped_count - self.skipped.len() as u64;
        if left > 0 {
            self.skipped.push(format!("and {left} more"));
        }
    }

    /// Returns whether all that there was has been read and used.
    #[must_use]
    pub const fn is_whole(&self) -> bool {
        self.skipped.is_empty()
    }
}
