//! Every frame that was sent, and its answers.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use nalgebra::{Isometry3, Matrix6, Vector6};
use tanker_pose::geometry::{PoseCovariance, pose_error};
use tanker_pose::pipeline::{OutcomeCode, Stamp};
use tanker_pose::ros::convert::isometry;
use tanker_pose::ros::messages::{EstimatorStatus, PoseWithCovarianceStamped};

use super::plan::Fault;

/// A frame with the truth about it.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Its place in the flight.
    pub index: u32,
    /// Since the start of the flight, s.
    pub time_s: f64,
    /// The true pose.
    pub truth_camera_from_tanker: Isometry3<f64>,
    /// What was injected, with the id of the marker at fault where it is a single one.
    pub fault: Option<(Fault, Option<u32>)>,
    /// When its detections were published.
    pub sent: Instant,
    /// The node's estimate, if it arrived.
    pub estimate: Option<Estimate>,
    /// The node's status, if it arrived.
    pub verdict: Option<Verdict>,
}

/// An estimate, held against the truth.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// As received.
    pub found_camera_from_tanker: Isometry3<f64>,
    /// As received.
    pub covariance: PoseCovariance,
    /// Truth less estimate: m, rad.
    pub error: Vector6<f64>,
    /// The error's squared length in sigmas; infinite where the covariance is not positive definite.
    pub nees: f64,
    /// From publishing the detections to receiving the pose.
    pub latency: Duration,
}

/// The node's answer to a frame.
#[derive(Debug, Clone)]
pub struct Verdict {
    /// In one word.
    pub code: OutcomeCode,
    /// In one sentence.
    pub message: String,
    /// Detections left out as wrong.
    pub rejected_ids: Vec<u32>,
    /// Inside the node.
    pub solve_time: Duration,
}

impl Frame {
    /// True distance along the camera's axis, m.
    pub fn ahead_m(&self) -> f64 {
        self.truth_camera_from_tanker.translation.z
    }

    /// Returns whether the answer is complete: a refusal, or a success with its pose.
    pub fn is_answered(&self) -> bool {
        self.verdict
            .as_ref()
            .is_some_and(|verdict| verdict.code != OutcomeCode::Ok || self.estimate.is_some())
    }

    /// Returns the estimate of a frame that the node also calls a success.
    pub fn trusted(&self) -> Option<&Estimate> {
        let verdict = self.verdict.as_ref()?;
        self.estimate
            .as_ref()
            .filter(|_| verdict.code == OutcomeCode::Ok)
    }

    /// Returns whether an injected fault was found: the frame refused, or the marker left out.
    pub fn fault_was_found(&self) -> bool {
        let (Some((_, id)), Some(verdict)) = (self.fault, &self.verdict) else {
            return false;
        };
        verdict.code != OutcomeCode::Ok || id.is_some_and(|id| verdict.rejected_ids.contains(&id))
    }
}

/// The frames in the order in which they were sent.
#[derive(Debug, Default)]
pub struct Ledger {
    frames: BTreeMap<Stamp, Frame>,
}

impl Ledger {
    /// Enters a frame that was just sent.
    pub fn enter(&mut self, stamp: Stamp, frame: Frame) {
        self.frames.insert(stamp, frame);
    }

    /// Enters an estimate; returns its frame when that is now answered, and none when no frame of the
    /// ledger asked for it.
    pub fn on_pose(&mut self, message: &PoseWithCovarianceStamped, at: Instant) -> Option<&Frame> {
        let frame = self.frames.get_mut(&message.header.stamp.into())?;
        let found = isometry(&message.pose.pose)?;
        let covariance = PoseCovariance(Matrix6::from_row_slice(&message.pose.covariance));
        let error = pose_error(&frame.truth_camera_from_tanker, &found);
        frame.estimate = Some(Estimate {
            found_camera_from_tanker: found,
            nees: covariance
                .mahalanobis_squared(&error)
                .unwrap_or(f64::INFINITY),
            covariance,
            error,
            latency: at.saturating_duration_since(frame.sent),
        });
        Some(&*frame).filter(|frame| frame.is_answered())
    }

    /// Enters a status; returns its frame when that is now answered.
    pub fn on_status(&mut self, message: EstimatorStatus) -> Option<&Frame> {
        let frame = self.frames.get_mut(&message.header.stamp.into())?;
        let code = *OutcomeCode::ALL.get(usize::from(message.outcome))?;
        let spent = message.solve_time;
        frame.verdict = Some(Verdict {
            code,
            message: message.message,
            rejected_ids: message.rejected_ids,
            solve_time: Duration::new(u64::try_from(spent.sec).unwrap_or(0), spent.nanosec),
        });
        Some(&*frame).filter(|frame| frame.is_answered())
    }

    /// Returns a frame.
    pub fn get(&self, stamp: Stamp) -> Option<&Frame> {
        self.frames.get(&stamp)
    }

    /// Returns the frames.
    pub fn frames(&self) -> impl Iterator<Item = &Frame> {
        self.frames.values()
    }

    /// Returns how many there are.
    pub fn sent(&self) -> usize {
        self.frames.len()
    }

    /// Returns how many are still without an answer.
    pub fn missing(&self) -> usize {
        self.frames().filter(|frame| !frame.is_answered()).count()
    }

    /// Returns how long the poses took, ms.
    pub fn latencies_ms(&self) -> Vec<f64> {
        self.frames()
            .filter_map(|frame| Some(frame.trusted()?.latency.as_secs_f64() * 1e3))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use tanker_pose::ros::convert::pose_message;
    use tanker_pose::ros::messages::{Header, PoseWithCovariance, Time};

    use super::*;

    const STAMP: Stamp = Stamp { sec: 7, nanosec: 9 };

    /// A ledger with one frame, in which the given marker was moved.
    fn ledger(moved: Option<u32>) -> Ledger {
        let mut ledger = Ledger::default();
        let frame = Frame {
            index: 0,
            time_s: 0.0,
            truth_camera_from_tanker: Isometry3::translation(0.0, 0.0, 20.0),
            fault: moved.map(|id| (Fault::GrossError, Some(id))),
            sent: Instant::now(),
            estimate: None,
            verdict: None,
        };
        ledger.enter(STAMP, frame);
        ledger
    }

    fn header() -> Header {
        Header {
            stamp: Time::from(STAMP),
            ..Header::default()
        }
    }

    /// One sigma beyond the truth along each position axis.
    fn pose() -> PoseWithCovarianceStamped {
        let found = Isometry3::translation(0.1, 0.1, 20.1);
        let mut covariance = [0.0; 36];
        for axis in 0..6 {
            covariance[7 * axis] = 0.01;
        }
        PoseWithCovarianceStamped {
            header: header(),
            pose: PoseWithCovariance {
                pose: pose_message(header(), &found).pose,
                covariance,
            },
        }
    }

    fn status(code: OutcomeCode, rejected_ids: &[u32]) -> EstimatorStatus {
        EstimatorStatus {
            header: header(),
            outcome: code.number(),
            rejected_ids: rejected_ids.to_vec(),
            ..EstimatorStatus::default()
        }
    }

    #[test]
    fn success_is_answered_when_pose_and_status_are_there_in_either_order() {
        let mut ledger = ledger(None);
        assert!(ledger.on_status(status(OutcomeCode::Ok, &[])).is_none());
        assert_eq!(ledger.missing(), 1, "a success without its pose");
        let frame = ledger.on_pose(&pose(), Instant::now());
        let nees = frame.and_then(Frame::trusted).map(|estimate| estimate.nees);
        assert!(
            nees.is_some_and(|nees| (nees - 3.0).abs() < 1e-9),
            "{nees:?}"
        );
        assert_eq!(ledger.missing(), 0);

        let mut ledger = self::ledger(None);
        assert!(ledger.on_pose(&pose(), Instant::now()).is_none());
        assert_eq!(ledger.missing(), 1, "a pose without its status");
        assert!(ledger.on_status(status(OutcomeCode::Ok, &[])).is_some());
        assert_eq!(ledger.missing(), 0);
    }

    #[test]
    fn refusal_is_an_answer_and_another_frames_is_not() {
        let mut ledger = ledger(None);
        let mut other = status(OutcomeCode::UnknownId, &[]);
        other.header.stamp.nanosec += 1;
        assert!(ledger.on_status(other).is_none());
        assert_eq!(ledger.missing(), 1);
        assert!(
            ledger
                .on_status(status(OutcomeCode::UnknownId, &[]))
                .is_some()
        );
        assert_eq!((ledger.missing(), ledger.sent()), (0, 1));
    }

    #[test]
    fn fault_is_found_when_its_marker_is_left_out_or_the_frame_refused() {
        for (code, rejected, found) in [
            (OutcomeCode::Ok, &[3][..], true),
            (OutcomeCode::Ok, &[2], false),
            (OutcomeCode::Ok, &[], false),
            (OutcomeCode::NotTrusted, &[], true),
        ] {
            let mut ledger = ledger(Some(3));
            ledger.on_pose(&pose(), Instant::now());
            let frame = ledger.on_status(status(code, rejected));
            assert_eq!(frame.map(Frame::fault_was_found), Some(found), "{code:?}");
        }
    }
}
