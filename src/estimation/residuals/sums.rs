//! Sums over points for residuals and their derivatives.

use super::{Linearised, Slope};
use crate::estimation::lanes::four::{Arithmetic, Four, Number, totals};
use crate::estimation::lanes::information::Information;

/// Sums over points of `M`, `[a]× M`, `[a]× M [a]×ᵀ`, `s`, `a × s` and the squared residuals.
#[derive(Clone, Copy)]
pub(crate) struct Sums<N> {
    pub(crate) zero: N,
    /// 11, 12, 13, 22, 23, 33.
    pub(crate) point: [N; 6],
    pub(crate) mixed: [[N; 3]; 3],
    /// 11, 12, 13, 22, 23, 33.
    pub(crate) turn: [N; 6],
    pub(crate) slope: SlopeSums<N>,
}

/// `M` of a point; 12 is zero without distortion.
#[derive(Clone, Copy)]
pub(crate) struct Weight<N> {
    pub(crate) m11: N,
    pub(crate) m12: Option<N>,
    pub(crate) m13: N,
    pub(crate) m22: N,
    pub(crate) m23: N,
    pub(crate) m33: N,
}

/// Sums over points of `a × s`, `s` and the squared residuals.
#[derive(Clone, Copy)]
pub(crate) struct SlopeSums<N> {
    pub(crate) gradient: [N; 6],
    pub(crate) chi_squared: N,
    pub(crate) squared_residuals_px: N,
}

impl<N: Number> SlopeSums<N> {
    #[inline(always)]
    pub(crate) fn new(zero: N) -> Self {
        Self {
            gradient: [zero; 6],
            chi_squared: zero,
            squared_residuals_px: zero,
        }
    }

    /// Adds points: `a` their arms, `s` their `Dᵀ r`.
    #[inline(always)]
    pub(crate) fn add(&mut self, a: [N; 3], s: [N; 3]) {
        let [a1, a2, a3] = a;
        let g = &mut self.gradient;
        g[0] = g[0].plus(a2, s[2]).minus(a3, s[1]);
        g[1] = g[1].plus(a3, s[0]).minus(a1, s[2]);
        g[2] = g[2].plus(a1, s[1]).minus(a2, s[0]);
        for i in 0..3 {
            g[3 + i] = g[3 + i] + s[i];
        }
    }
}

impl SlopeSums<f64> {
    #[inline(always)]
    pub(crate) fn finish(&self) -> Option<Slope> {
        self.chi_squared.is_finite().then_some(Slope {
            gradient: self.gradient,
            chi_squared: self.chi_squared,
            squared_residuals_px: self.squared_residuals_px,
        })
    }
}

impl<N: Number> Sums<N> {
    #[inline(always)]
    pub(crate) fn new(zero: N) -> Self {
        Self {
            zero,
            point: [zero; 6],
            mixed: [[zero; 3]; 3],
            turn: [zero; 6],
            slope: SlopeSums::new(zero),
        }
    }

    /// Adds points: `a` their arms, `m` their `M`, `s` their `Dᵀ r`.
    #[inline(always)]
    pub(crate) fn add(&mut self, a: [N; 3], m: Weight<N>, s: [N; 3]) {
        let [a1, a2, a3] = a;
        let Weight {
            m11,
            m12,
            m13,
            m22,
            m23,
            m33,
        } = m;
        // [a]× M, row by row.
        let mut b = [
            [
                a2 * m13,
                (a2 * m23).minus(a3, m22),
                (a2 * m33).minus(a3, m23),
            ],
            [
                (a3 * m11).minus(a1, m13),
                self.zero.minus(a1, m23),
                (a3 * m13).minus(a1, m33),
            ],
            [
                self.zero.minus(a2, m11),
                a1 * m22,
                (a1 * m23).minus(a2, m13),
            ],
        ];
        let p = &mut self.point;
        if let Some(m12) = m12 {
            b[0][0] = b[0][0].minus(a3, m12);
            b[1][1] = b[1][1].plus(a3, m12);
            b[2][0] = b[2][0].plus(a1, m12);
            b[2][1] = b[2][1].minus(a2, m12);
            p[1] = p[1] + m12;
        }
        p[0] = p[0] + m11;
        p[2] = p[2] + m13;
        p[3] = p[3] + m22;
        p[4] = p[4] + m23;
        p[5] = p[5] + m33;
        for i in 0..3 {
            for j in 0..3 {
                self.mixed[i][j] = self.mixed[i][j] + b[i][j];
            }
        }
        let t = &mut self.turn;
        t[0] = t[0].plus(a2, b[0][2]).minus(a3, b[0][1]);
        t[1] = t[1].plus(a3, b[0][0]).minus(a1, b[0][2]);
        t[2] = t[2].plus(a1, b[0][1]).minus(a2, b[0][0]);
        t[3] = t[3].plus(a3, b[1][0]).minus(a1, b[1][2]);
        t[4] = t[4].plus(a1, b[1][1]).minus(a2, b[1][0]);
        t[5] = t[5].plus(a1, b[2][1]).minus(a2, b[2][0]);
        self.slope.add(a, s);
    }
}

impl Sums<f64> {
    #[inline(always)]
    pub(crate) fn finish(&self) -> Option<Linearised> {
        self.slope.finish().map(|slope| Linearised {
            slope,
            kept: (),
            information: Information {
                turn: self.turn,
                mixed: self.mixed,
                position: self.point,
            },
        })
    }
}

impl<A: Arithmetic> Sums<Four<A>> {
    #[inline(always)]
    pub(crate) fn total(&self) -> Sums<f64> {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.mixed;
        let [a, b, c, d, e, f, g, h, i] = totals(&[a, b, c, d, e, f, g, h, i]);
        Sums {
            zero: 0.0,
            point: totals(&self.point),
            mixed: [[a, b, c], [d, e, f], [g, h, i]],
            turn: totals(&self.turn),
            slope: self.slope.total(),
        }
    }
}

impl<A: Arithmetic> SlopeSums<Four<A>> {
    #[inline(always)]
    pub(crate) fn total(&self) -> SlopeSums<f64> {
        let [a, b, c, d, e, f] = self.gradient;
        let [a, b, c, d, e, f, chi_squared, squared_residuals_px] = totals(&[
            a,
            b,
            c,
            d,
            e,
            f,
            self.chi_squared,
            self.squared_residuals_px,
        ]);
        SlopeSums {
            gradient: [a, b, c, d, e, f],
            chi_squared,
            squared_residuals_px,
        }
    }
}
