//! The detections that a frame leaves out, among those that it could have.

use smallvec::SmallVec;

/// Share of the risk that is kept for frames in which detections were left out: each choice of them is one more way to
/// be wrong.
pub(super) const SHARE_OF_EXCLUSIONS: f64 = 0.1;

/// The detections that one frame leaves out.
#[derive(Debug, Clone, PartialEq, Default)]
pub(in crate::integrity) struct LeftOut {
    pub(in crate::integrity) ids: SmallVec<[u32; 2]>,
    /// In how many ways something could have been left out; `None`: nothing ever is.
    pub(in crate::integrity) choices: Option<f64>,
}

impl LeftOut {
    /// Returns the share of the risk that such frames have.
    pub(in crate::integrity) fn share(&self) -> f64 {
        match self.choices {
            None => 1.0,
            Some(_) if self.ids.is_empty() => 1.0 - SHARE_OF_EXCLUSIONS,
            Some(choices) => SHARE_OF_EXCLUSIONS / choices,
        }
    }
}
