//! Every hypothesis about one frame, held against it.

use smallvec::SmallVec;

use super::frame::Unavailable;
use super::hypotheses::Hypothesis;
use super::level::Along;
use super::separation::{Separations, Suspicion};
use crate::estimation::LinearFrame;

/// Everything of one frame that hypotheses are held against.
pub(super) struct Frame<'a> {
    pub(super) linear: &'a LinearFrame,
    pub(super) suspicion: Suspicion<'a>,
    /// Three for each point.
    pub(super) axes: SmallVec<[Axis; 6]>,
}

/// One axis at one point.
#[derive(Clone, Copy)]
pub(super) struct Axis {
    /// Standard deviation of the estimate in use, with mount and point, m.
    pub(super) sigma_m: f64,
    /// How much more than its curvature says the estimate may be off, 1 or more.
    pub(super) widened: f64,
}

/// The fault that is most clearly visible, with its separation over the threshold.
#[derive(Default)]
pub(super) struct VisibleFault(Option<(f64, Unavailable)>);

impl VisibleFault {
    /// Takes a separation along an axis.
    pub(super) fn take(
        &mut self,
        hypothesis: Hypothesis,
        axis: usize,
        separation_m: f64,
        threshold_m: f64,
    ) {
        // Whatever is not a number is no agreement.
        let agrees = separation_m <= threshold_m;
        let ratio = separation_m / threshold_m;
        if agrees
            || self
                .0
                .is_some_and(|(worst, _)| ratio.is_nan() || ratio <= worst)
        {
            return;
        }
        let fault = Unavailable::Fault {
            hypothesis,
            axis,
            separation_m,
            threshold_m,
        };
        self.0 = Some((ratio, fault));
    }

    /// Returns it as the reason for no levels.
    pub(super) fn none(self) -> Result<(), Unavailable> {
        self.0.map_or(Ok(()), |(_, fault)| Err(fault))
    }
}

/// What the hypotheses of a frame add up to.
pub(super) struct Search<'a> {
    pub(super) frame: &'a Frame<'a>,
    /// Of the test of a separation, in its sigmas.
    pub(super) quantile: f64,
    /// All axes of the first hypothesis, then those of the next.
    pub(super) along: Vec<Along>,
    pub(super) hypotheses: Vec<Hypothesis>,
    /// The modes that were visited.
    pub(super) modes: SmallVec<[usize; 4]>,
    /// Of each hypothesis that was visited, monitored or not, whether it is.
    pub(super) is_monitored: Vec<bool>,
    /// Probability of faults that the points that are left could not show.
    pub(super) unmonitorable: f64,
    pub(super) fault: VisibleFault,
    pub(super) found: Separations,
}

impl Search<'_> {
    pub(super) fn rows(
        &mut self,
        hypothesis: Hypothesis,
        prior: f64,
        rows: &[usize],
        is_monitored: bool,
    ) {
        let suspicion = &self.frame.suspicion;
        let is_monitored = is_monitored && suspicion.without_rows(rows, &mut self.found).is_some();
        self.take(hypothesis, prior, is_monitored);
    }

    pub(super) fn mode(&mut self, mode: usize, prior: f64) {
        self.modes.push(mode);
        let linear = self.frame.linear;
        let shifts = linear.by_mode.iter().skip(mode).step_by(linear.modes);
        let shifts: SmallVec<[f64; 32]> = shifts.copied().collect();
        let suspicion = &self.frame.suspicion;
        let is_monitored = suspicion.without_mode(&shifts, &mut self.found).is_some();
        self.take(Hypothesis::Mode(mode), prior, is_monitored);
    }

    fn take(&mut self, hypothesis: Hypothesis, prior: f64, is_monitored: bool) {
        self.is_monitored.push(is_monitored);
        if !is_monitored {
            self.unmonitorable += prior;
            return;
        }
        self.hypotheses.push(hypothesis);
        for (at, (axis, separation)) in self.frame.axes.iter().zip(&self.found).enumerate() {
            let threshold_m = self.quantile * separation.sigma_m;
            let by = separation.difference_m.abs();
            self.fault.take(hypothesis, at % 3, by, threshold_m);
            let own = separation.sigma_m * axis.widened;
            self.along.push(Along {
                prior,
                threshold_m: threshold_m * axis.widened,
                sigma_m: axis.sigma_m.hypot(own),
            });
        }
    }
}
