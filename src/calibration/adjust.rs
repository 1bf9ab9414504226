//! The most probable poses and shared unknowns: Levenberg–Marquardt, the poses eliminated (Schur complement).

use nalgebra::{Cholesky, Const, DMatrix, DVector, Dyn};

use super::CalibrateError;
use super::model::{Frame, Model, OWN, Own, OwnMatrix};

/// Limit of steps; five to ten are usual.
const MAX_STEPS: usize = 60;
/// Predicted decrease of the cost, which is a chi-squared, at which the adjustment has converged.
const GAIN_TOLERANCE: f64 = 1e-6;
/// Share of the cost below which a decrease is rounding.
const ROUNDING: f64 = 1e-12;
/// Damping above which no step helps.
const MAX_DAMPING: f64 = 1e9;

/// The state of an adjustment.
#[derive(Debug, Clone)]
pub(super) struct State {
    pub(super) values: Vec<f64>,
    pub(super) frames: Vec<Frame>,
}

/// A frame linearised: its own information, its coupling to the shared unknowns that it sees, and gradients.
pub(super) struct FrameSums {
    pub(super) own: OwnMatrix,
    /// Columns of the shared unknowns, ascending.
    pub(super) columns: Vec<usize>,
    /// Coupling, a column for each of `columns`.
    pub(super) coupling: nalgebra::OMatrix<f64, Const<OWN>, Dyn>,
    shared: DMatrix<f64>,
    own_gradient: Own,
    shared_gradient: DVector<f64>,
}

/// The end of an adjustment.
pub(super) struct Adjusted {
    pub(super) state: State,
    /// Of the shared unknowns, given prior and data.
    pub(super) covariance: DMatrix<f64>,
    pub(super) steps: usize,
}

/// Returns the adjusted state.
pub(super) fn adjust(model: &Model, start: State) -> Result<Adjusted, CalibrateError> {
    let mut state = start;
    let mut cost = cost(model, &state).ok_or(CalibrateError::Singular { of: "the start" })?;
    let mut damping = 0.0;
    for step in 1..=MAX_STEPS {
        let sums = linearise(model, &state).ok_or(CalibrateError::Singular { of: "a frame" })?;
        loop {
            let Some(solved) = solve(model, &state, &sums, damping) else {
                damping = f64::max(1e-6, 10.0 * damping);
                if damping > MAX_DAMPING {
                    return Err(CalibrateError::Singular {
                        of: "the adjustment",
                    });
                }
                continue;
            };
            if solved.gain < GAIN_TOLERANCE.max(ROUNDING * cost) && damping < 1e-3 {
                return finish(model, state, &sums, step);
            }
            let trial = solved.applied(&state);
            match self::cost(model, &trial) {
                Some(there) if there <= cost => {
                    (state, cost) = (trial, there);
                    damping = if damping < 1e-6 { 0.0 } else { damping * 0.1 };
                    break;
                }
                _ => {
                    // Where rounding hides the last decrease, the state is as good as it gets.
                    if solved.gain < 1e-3 && damping == 0.0 {
                        return finish(model, state, &sums, step);
                    }
                    damping = if damping == 0.0 { 1e-4 } else { damping * 10.0 };
                    if damping > MAX_DAMPING {
                        return Err(CalibrateError::NoConvergence { iterations: step });
                    }
                }
            }
        }
    }
    Err(CalibrateError::NoConvergence {
        iterations: MAX_STEPS,
    })
}

/// Returns the sum of squared residuals over variances, of pixels, attitudes and priors; `None` if a point has no pixel.
pub(super) fn cost(model: &Model, state: &State) -> Option<f64> {
    let values = DVector::from_column_slice(&state.values);
    let mut sum = values.dot(&(&model.unknowns.prior_information * &values));
    let camera = model.unknowns.camera(model.camera, &state.values);
    for frame in &state.frames {
        for seen in &frame.points {
            let sight = model.sight(&camera, &state.values, frame, seen)?;
            sum += (sight.residual / sight.sigma_px).norm_squared();
        }
        sum += frame.shake.norm_squared();
        if let Some(turn) = model.turn(&state.values, frame) {
            sum += (turn / model.attitude_noise_rad).norm_squared();
        }
    }
    sum.is_finite().then_some(sum)
}

/// Returns every frame linearised; `None` if a point has no pixel.
pub(super) fn linearise(model: &Model, state: &State) -> Option<Vec<FrameSums>> {
    let camera = model.unknowns.camera(model.camera, &state.values);
    let mut place = vec![usize::MAX; model.unknowns.size];
    let frames = state.frames.iter().map(|frame| {
        let sights = frame
            .points
            .iter()
            .map(|seen| model.sight(&camera, &state.values, frame, seen))
            .collect::<Option<Vec<_>>>()?;
        let turn = model.turn(&state.values, frame);
        let mut columns: Vec<usize> = sights
            .iter()
            .flat_map(|sight| sight.by_shared.iter().map(|(column, _)| *column))
            .collect();
        if let (Some(_), Some(at)) = (turn, model.unknowns.mount) {
            columns.extend(at..at + 6);
        }
        columns.sort_unstable();
        columns.dedup();
        for (index, column) in columns.iter().enumerate() {
            place[*column] = index;
        }
        let count = columns.len();
        let mut sums = FrameSums {
            own: OwnMatrix::zeros(),
            coupling: nalgebra::OMatrix::<f64, Const<OWN>, Dyn>::zeros(count),
            shared: DMatrix::zeros(count, count),
            own_gradient: Own::zeros(),
            shared_gradient: DVector::zeros(count),
            columns,
        };
        for sight in &sights {
            let weight = sight.sigma_px.powi(-2);
            let weighted = sight.by_own.transpose() * weight;
            sums.own += weighted * sight.by_own;
            sums.own_gradient += weighted * sight.residual;
            for (column, by) in &sight.by_shared {
                let at = place[*column];
                let mut coupling = sums.coupling.column_mut(at);
                coupling += weighted * by;
                sums.shared_gradient[at] += weight * by.dot(&sight.residual);
                for (other, by_other) in &sight.by_shared {
                    sums.shared[(at, place[*other])] += weight * by.dot(by_other);
                }
            }
        }
        // One sigma of shake.
        for axis in 0..2 {
            sums.own[(6 + axis, 6 + axis)] += 1.0;
            sums.own_gradient[6 + axis] += frame.shake[axis];
        }
        if let (Some(turn), Some(at)) = (turn, model.unknowns.mount) {
            let weight = model.attitude_noise_rad.powi(-2);
            for axis in 0..3 {
                sums.own[(3 + axis, 3 + axis)] += weight;
                sums.own_gradient[3 + axis] += weight * turn[axis];
                // To first order the turn falls by what mount and constant error rise; both act alike.
                let both = [place[at + axis], place[at + 3 + axis]];
                for i in both {
                    sums.coupling[(3 + axis, i)] -= weight;
                    sums.shared_gradient[i] -= weight * turn[axis];
                    for j in both {
                        sums.shared[(i, j)] += weight;
                    }
                }
            }
        }
        Some(sums)
    });
    frames.collect()
}

/// A step, with the decrease of the cost that it predicts.
struct Step {
    shared: DVector<f64>,
    own: Vec<Own>,
    gain: f64,
}

impl Step {
    fn applied(&self, state: &State) -> State {
        let values = state.values.iter().zip(self.shared.iter());
        State {
            values: values.map(|(value, step)| value + step).collect(),
            frames: state
                .frames
                .iter()
                .zip(&self.own)
                .map(|(frame, step)| frame.moved(step))
                .collect(),
        }
    }
}

fn solve(model: &Model, state: &State, sums: &[FrameSums], damping: f64) -> Option<Step> {
    let size = model.unknowns.size;
    let values = DVector::from_column_slice(&state.values);
    let mut information = model.unknowns.prior_information.clone();
    let mut gradient = &information * values;
    for frame in sums {
        for (i, &row) in frame.columns.iter().enumerate() {
            gradient[row] += frame.shared_gradient[i];
            for (j, &column) in frame.columns.iter().enumerate() {
                information[(row, column)] += frame.shared[(i, j)];
            }
        }
    }
    for index in 0..size {
        information[(index, index)] *= 1.0 + damping;
    }
    let full_gradient = gradient.clone();
    let mut factors = Vec::with_capacity(sums.len());
    for frame in sums {
        let factor = frame.factor(damping)?;
        let explained = factor.solve(&frame.coupling);
        let reduced = frame.coupling.transpose() * &explained;
        let pulled = explained.transpose() * frame.own_gradient;
        for (i, &row) in frame.columns.iter().enumerate() {
            gradient[row] -= pulled[i];
            for (j, &column) in frame.columns.iter().enumerate() {
                information[(row, column)] -= reduced[(i, j)];
            }
        }
        factors.push(factor);
    }
    let shared = -information.cholesky()?.solve(&gradient);
    let mut gain = -shared.dot(&full_gradient);
    let own = sums.iter().zip(&factors).map(|(frame, factor)| {
        let of_frame = DVector::from_iterator(
            frame.columns.len(),
            frame.columns.iter().map(|&c| shared[c]),
        );
        let step: Own = -factor.solve(&(frame.own_gradient + &frame.coupling * of_frame));
        gain -= step.dot(&frame.own_gradient);
        step
    });
    let own = own.collect();
    Some(Step { shared, own, gain })
}

impl FrameSums {
    /// Returns the factored information of the frame's own unknowns; `None` if it leaves some of them free.
    pub(super) fn factor(&self, damping: f64) -> Option<Cholesky<f64, Const<OWN>>> {
        let mut own = self.own;
        for index in 0..OWN {
            own[(index, index)] *= 1.0 + damping;
        }
        own.cholesky()
    }
}

fn finish(
    model: &Model,
    state: State,
    sums: &[FrameSums],
    steps: usize,
) -> Result<Adjusted, CalibrateError> {
    let mut information = model.unknowns.prior_information.clone();
    for frame in sums {
        let factor = frame
            .factor(0.0)
            .ok_or(CalibrateError::Singular { of: "a frame" })?;
        let reduced = &frame.shared - frame.coupling.transpose() * factor.solve(&frame.coupling);
        for (i, &row) in frame.columns.iter().enumerate() {
            for (j, &column) in frame.columns.iter().enumerate() {
                information[(row, column)] += reduced[(i, j)];
            }
        }
    }
    let covariance = information
        .cholesky()
        .ok_or(CalibrateError::Singular {
            of: "the adjustment",
        })?
        .inverse();
    Ok(Adjusted {
        state,
        covariance: (&covariance + covariance.transpose()) * 0.5,
        steps,
    })
}

/// Returns the inverse information of a frame's own unknowns.
pub(super) fn own_covariance(sums: &FrameSums) -> Option<OwnMatrix> {
    Some(sums.factor(0.0)?.inverse())
}
