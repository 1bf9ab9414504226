//! Which frames carry which fault on purpose.

use tanker_pose::pipeline::Detection;
use tanker_pose::target::{Marker, MarkerMap};

use crate::simulate::fault::{exchange_ids, gross_error, stray_id};

/// px; eighty times the noise.
const GROSS_ERROR_PX: f64 = 40.0;
/// m; markers count as mirrored within this.
const SYMMETRY_M: f64 = 0.01;
/// Consecutive frames with a fault, in a long flight.
const MAX_BLOCK: u32 = 5;

/// A fault that the demo injects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// One detection is moved.
    GrossError,
    /// One detection carries an id that the tanker does not have.
    StrayId,
    /// Left and right are exchanged.
    ExchangedSides,
}

/// Frames in a row with the same fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Block {
    /// Which fault.
    pub fault: Fault,
    /// Index of the first frame.
    pub first: u32,
    /// How many.
    pub length: u32,
}

/// The schedule of injected faults.
#[derive(Debug, Clone, Default)]
pub struct Plan {
    blocks: Vec<Block>,
    /// Ids of markers that mirror each other.
    pairs: Vec<(u32, u32)>,
    seed: u64,
}

impl Fault {
    /// The fault, and the expected answer.
    pub const fn announcement(self) -> &'static str {
        match self {
            Self::GrossError => "one marker moved by 40 px; the node should estimate without it",
            Self::StrayId => "one marker with an unknown id; the node should refuse",
            Self::ExchangedSides => "ids of left and right exchanged; the node should refuse",
        }
    }
}

impl Plan {
    /// Returns the plan of a flight: blocks of faults around its middle; none in a very short one.
    pub fn new(frames: u32, map: &MarkerMap, seed: u64) -> Self {
        let pairs = mirrored(map.markers());
        let length = (frames / 20).min(MAX_BLOCK);
        let block = |fault, tenth| Block {
            fault,
            first: frames / 10 * tenth,
            length,
        };
        let mut blocks = vec![block(Fault::GrossError, 4), block(Fault::StrayId, 5)];
        if !pairs.is_empty() {
            blocks.push(block(Fault::ExchangedSides, 6));
        }
        blocks.retain(|block| block.length > 0);
        Self {
            blocks,
            pairs,
            seed,
        }
    }

    /// Puts the fault that is planned for a frame into it; returns it, with the id of the marker at
    /// fault where it is a single one.
    pub fn inject(&self, index: u32, detections: &mut [Detection]) -> Option<(Fault, Option<u32>)> {
        let fault = self.block(index)?.fault;
        let id = match fault {
            Fault::GrossError => gross_error(detections, GROSS_ERROR_PX, self.seed, index),
            Fault::StrayId => stray_id(detections),
            Fault::ExchangedSides => {
                exchange_ids(detections, &self.pairs);
                None
            }
        };
        Some((fault, id))
    }

    /// Returns the block that a frame is in.
    pub fn block(&self, index: u32) -> Option<Block> {
        let holds = |block: &&Block| (block.first..block.first + block.length).contains(&index);
        self.blocks.iter().find(holds).copied()
    }
}

/// Returns the pairs of markers that lie opposite each other across the tanker's plane of symmetry.
fn mirrored(markers: &[Marker]) -> Vec<(u32, u32)> {
    let right = |marker: &&Marker| marker.marker_in_tanker.y < 0.0;
    let opposite = |a: &Marker, b: &Marker| {
        let (a, b) = (a.marker_in_tanker, b.marker_in_tanker);
        (a.x - b.x).abs() + (a.y + b.y).abs() + (a.z - b.z).abs() < SYMMETRY_M
    };
    markers
        .iter()
        .filter(right)
        .filter_map(|a| Some((a.id, markers.iter().find(|b| opposite(a, b))?.id)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(frames: u32) -> Plan {
        Plan::new(frames, &MarkerMap::shipped("paper").expect("shipped"), 1)
    }

    #[test]
    fn the_papers_tanker_has_two_pairs_of_mirrored_markers() {
        assert_eq!(plan(100).pairs, [(1, 2), (3, 4)]);
    }

    #[test]
    fn blocks_do_not_overlap_and_lie_within_the_flight() {
        for frames in [20, 21, 50, 120, 750, 10_000] {
            let plan = plan(frames);
            let faulty = (0..frames)
                .filter(|&index| plan.block(index).is_some())
                .count();
            let planned: u32 = plan.blocks.iter().map(|block| block.length).sum();
            assert_eq!(u32::try_from(faulty), Ok(planned), "{frames} frames");
            assert!(planned >= 3, "{frames} frames");
        }
        assert!(plan(19).blocks.is_empty());
    }
}
