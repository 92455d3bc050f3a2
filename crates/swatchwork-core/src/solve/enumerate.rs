// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The blend step by enumeration: every support of at most n (brute force, section 4), or those of a
//! given list (the pruned search of section 6). The exact search is measured against both.

use super::hull::{Blend, Hull, MOST};
use super::simd::Four;

/// All supports of 1..=n of the hull's points, depth first. The Cholesky rows of G_SS and of
/// L z = 1 grow by one a level: sum(y) = ||z||^2, so the weights are only worked out where a support
/// would win, and a support with a negative weight is passed over. Returns the supports looked at.
pub fn brute_force(hull: &Hull, most: usize) -> (Blend, u32) {
    let mut state = Enumeration {
        hull,
        most,
        chosen: Vec::with_capacity(most),
        factor: Vec::new(),
        z: Vec::with_capacity(most),
        best: Blend::NONE,
        visited: 0,
    };
    state.extend(0, 0.0);
    (state.best, state.visited)
}

struct Enumeration<'a> {
    hull: &'a Hull,
    most: usize,
    chosen: Vec<usize>,
    factor: Vec<f64>,
    z: Vec<f64>,
    best: Blend,
    visited: u32,
}

impl Enumeration<'_> {
    fn extend(&mut self, first: usize, total: f64) {
        let n = self.hull.stride;
        for j in first..self.hull.size {
            self.visited += 1;
            let row = self.factor.len();
            let mut rest = self.hull.gram[j * n + j];
            let mut z = 1.0;
            for r in 0..self.chosen.len() {
                let head = r * (r + 1) / 2;
                let mut v = self.hull.gram[j * n + self.chosen[r]];
                for c in 0..r {
                    v -= self.factor[head + c] * self.factor[row + c];
                }
                v /= self.factor[head + r];
                self.factor.push(v);
                rest -= v * v;
                z -= v * self.z[r];
            }
            // Affinely dependent points: the optimum lies on a smaller support.
            if rest > 1e-13 * self.hull.gram[j * n + j] {
                let pivot = rest.sqrt();
                self.factor.push(pivot);
                self.z.push(z / pivot);
                self.chosen.push(j);
                let grown = total + (z / pivot).powi(2);
                self.offer(grown);
                if self.chosen.len() < self.most {
                    self.extend(j + 1, grown);
                }
                self.chosen.pop();
                self.z.pop();
            }
            self.factor.truncate(row);
        }
    }

    /// Keep the current support if it is feasible and better.
    fn offer(&mut self, total: f64) {
        // 1 / total - kappa cancels where the fit is near perfect: let rounding pass, and judge below.
        if 1.0 / total - self.hull.kappa > self.best.value + 1e-12 * self.hull.kappa {
            return;
        }
        let p = self.chosen.len();
        let mut y = self.z.clone();
        for r in (0..p).rev() {
            y[r] /= self.factor[r * (r + 1) / 2 + r];
            for c in 0..r {
                y[c] -= self.factor[r * (r + 1) / 2 + c] * y[r];
            }
        }
        if y.iter().any(|&v| v < 0.0) {
            return;
        }
        let mut weights = [0.0; MOST];
        for (&i, v) in self.chosen.iter().zip(&y) {
            weights[i] = v / total;
        }
        let mut value = 0.0;
        for &i in &self.chosen {
            for &k in &self.chosen {
                let g = self.hull.gram[i * self.hull.stride + k] - self.hull.kappa;
                value += weights[i] * weights[k] * g;
            }
        }
        let value = f64::max(value, 0.0);
        if value < self.best.value {
            let support = self.chosen.iter().fold(0, |m, &i| m | 1 << i);
            self.best = Blend {
                support,
                weights,
                total,
                value,
            };
        }
    }
}

/// Best of the listed supports.
#[inline(always)]
pub fn best_of<F: Four>(hull: &mut Hull, supports: &[u64]) -> (Blend, u32) {
    let mut best = Blend::NONE;
    for &support in supports {
        let blend = hull.relax::<F>(support, &Blend::NONE);
        if blend.value < best.value {
            best = blend;
        }
    }
    (best, supports.len() as u32)
}
