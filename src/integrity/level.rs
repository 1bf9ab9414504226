//! What single hypotheses promise about one axis -> the protection level of that axis.

use smallvec::SmallVec;

use super::gaussian::{tail, tail_inverse};

/// Of the level: after a step of this share it is known to the square of it, since steps converge quadratically.
const TOLERANCE: f64 = 1e-7;
const MAX_STEPS: usize = 100;
/// Of the risk: what all hypotheses below it add together is less than rounding.
const NEGLIGIBLE: f64 = 1e-12;
/// Prior of the noise without a fault: both signs of an error count.
const NOMINAL: f64 = 2.0;

/// A hypothesis seen along one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Along {
    /// Its probability.
    pub(super) prior: f64,
    /// How far its own estimate may be from the one in use without an alert, m.
    pub(super) threshold_m: f64,
    /// Standard deviation of its own estimate, m.
    pub(super) sigma_m: f64,
}

impl Along {
    fn sigmas(&self, level_m: f64) -> f64 {
        (level_m - self.threshold_m) / self.sigma_m
    }

    fn level(&self, sigmas: f64) -> f64 {
        self.threshold_m + self.sigma_m * sigmas
    }

    /// Returns the probability that this hypothesis is true and the error exceeds a level.
    fn risk(&self, level_m: f64) -> f64 {
        self.prior * tail(self.sigmas(level_m))
    }

    /// Returns the derivative of the risk, negative.
    fn slope(&self, level_m: f64) -> f64 {
        let x = self.sigmas(level_m);
        -self.prior * (-0.5 * x * x).exp() / (std::f64::consts::TAU.sqrt() * self.sigma_m)
    }
}

/// A risk that some hypotheses share, with its quantiles for each prior.
#[derive(Debug, Clone)]
pub(super) struct Risk {
    allowed: f64,
    /// Hypotheses and the noise.
    count: f64,
    /// Few hypotheses have a prior of their own.
    quantiles: SmallVec<[Quantiles; 4]>,
}

/// Sigmas beyond which a hypothesis has a part of the risk.
#[derive(Debug, Clone, Copy)]
struct Quantiles {
    prior: f64,
    /// All of it.
    all: f64,
    /// The same part as each other.
    equal: f64,
    /// As good as none.
    negligible: f64,
}

impl Risk {
    /// Returns a risk, above 0, that so many hypotheses share.
    pub(super) fn new(allowed: f64, hypotheses: usize) -> Self {
        Self {
            allowed,
            count: 1.0 + hypotheses as f64,
            quantiles: SmallVec::new(),
        }
    }

    fn quantiles(&mut self, prior: f64) -> Quantiles {
        let known = |quantiles: &&Quantiles| quantiles.prior.to_bits() == prior.to_bits();
        if let Some(quantiles) = self.quantiles.iter().find(known) {
            return *quantiles;
        }
        let quantiles = Quantiles {
            prior,
            all: tail_inverse(self.allowed / prior),
            equal: tail_inverse(self.allowed / (self.count * prior)),
            negligible: tail_inverse(NEGLIGIBLE * self.allowed / (self.count * prior)),
        };
        self.quantiles.push(quantiles);
        quantiles
    }

    /// Returns the smallest level whose risk `2 Q(L/σ₀) + Σ pₖ Q((L − Tₖ)/σₖ)` is at most this one, m, and the
    /// hypothesis with the largest part in it; `None`: the noise without a fault.
    ///
    /// # Inputs
    /// * `sigma_m`: of the estimate in use, without a fault, above 0, m.
    pub(super) fn protection_level(
        &mut self,
        sigma_m: f64,
        faults: &(impl Iterator<Item = Along> + Clone),
    ) -> (f64, Option<usize>) {
        let nominal = Along {
            prior: NOMINAL,
            threshold_m: 0.0,
            sigma_m,
        };
        let all = || std::iter::once(nominal).chain(faults.clone());
        // Each hypothesis alone needs at least this; and that is enough if each has an equal part of the risk.
        let (mut least, mut most) = (0.0_f64, 0.0_f64);
        for hypothesis in all() {
            let quantiles = self.quantiles(hypothesis.prior);
            least = least.max(hypothesis.level(quantiles.all));
            most = most.max(hypothesis.level(quantiles.equal));
        }
        let mut mattering: SmallVec<[(usize, Along); 96]> = SmallVec::new();
        for (index, hypothesis) in all().enumerate() {
            if hypothesis.sigmas(least) < self.quantiles(hypothesis.prior).negligible {
                mattering.push((index, hypothesis));
            }
        }
        let mut level = least;
        for _ in 0..MAX_STEPS {
            let (mut sum, mut slope) = (0.0, 0.0);
            for (_, hypothesis) in &mattering {
                sum += hypothesis.risk(level);
                slope += hypothesis.slope(level);
            }
            if sum > self.allowed {
                least = level;
            } else {
                most = level;
            }
            // Newton's method on the logarithm, which is nearly straight.
            let step = level + sum * (sum / self.allowed).ln() / -slope;
            if (step - level).abs() <= TOLERANCE * level {
                // Never below the root by rounding.
                most = step * (1.0 + 1e-12);
                break;
            }
            if most - least <= f64::EPSILON * most {
                break;
            }
            level = if step > least && step < most {
                step
            } else {
                0.5 * (least + most)
            };
        }
        let weakest = mattering
            .iter()
            .map(|(index, hypothesis)| (index, hypothesis.risk(most)))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .and_then(|(index, _)| index.checked_sub(1));
        (most, weakest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(risk: f64, sigma_m: f64, faults: &[Along]) -> (f64, Option<usize>) {
        Risk::new(risk, faults.len()).protection_level(sigma_m, &faults.iter().copied())
    }

    #[test]
    fn without_faults_a_level_is_the_normal_quantile() {
        let (level_m, weakest) = of(1e-7, 0.02, &[]);
        // scipy.stats.norm.isf(0.5e-7).
        assert!(
            (level_m / (0.02 * 5.326_723_886_384_098) - 1.0).abs() < 1e-11,
            "{level_m}"
        );
        assert_eq!(weakest, None);
    }

    #[test]
    fn one_fault_that_outweighs_the_noise_sets_the_level_alone() {
        let fault = Along {
            prior: 1e-4,
            threshold_m: 0.3,
            sigma_m: 0.1,
        };
        let (level_m, weakest) = of(1e-7, 0.001, &[fault]);
        // 0.3 + 0.1 × scipy.stats.norm.isf(1e-3).
        assert!(
            (level_m - 0.609_023_230_616_781_3).abs() < 1e-9,
            "{level_m}"
        );
        assert_eq!(weakest, Some(0));
    }

    #[test]
    fn the_risk_at_the_level_is_the_one_allowed_whatever_is_mixed() {
        let mut number = 0.37_f64;
        let mut random = || {
            number = (number * 997.0 + 0.123).fract();
            number
        };
        for _ in 0..500 {
            let faults: Vec<Along> = (0..30)
                .map(|_| Along {
                    prior: if random() < 0.5 { 1e-4 } else { 1e-8 },
                    threshold_m: random(),
                    sigma_m: 0.01 + random(),
                })
                .collect();
            let sigma_m = 0.01 + random();
            let (level_m, _) = of(3e-8, sigma_m, &faults);
            let risk = NOMINAL * tail(level_m / sigma_m)
                + faults.iter().map(|fault| fault.risk(level_m)).sum::<f64>();
            assert!((risk / 3e-8 - 1.0).abs() < 1e-9, "{risk}");
        }
    }
}
