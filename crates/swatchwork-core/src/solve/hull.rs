// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The blend step at one texel (Eq. 12) as a point nearest to the origin.
//!
//! Since the weights sum to one, s_hat - sum_i w_i s_i = -sum_i w_i d_i with d_i = s_i - s_hat: the
//! best blend is the point of the convex hull of the d_i nearest to the origin. With the Gram matrix
//! lifted by a constant, G = D'D + kappa 11', which adds kappa to every feasible objective, linear
//! independence of columns becomes affine independence of the points, and over a support S
//!
//!   min w'Gw, sum w = 1    is    w = y / sum(y),  G_SS y = 1,  value 1 / sum(y) - kappa;
//!
//! over all of the simplex it is the same with y >= 0: a non-negative least-squares problem with the
//! right-hand side 1. A support whose points are affinely dependent reaches its optimum on a smaller
//! one (Caratheodory), so it never has to be solved.

use super::nnls::Workspace;

/// Most representatives a blend can choose from: supports are bit masks.
pub const MOST: usize = 64;

/// The lifted Gram matrix of one texel and the buffers to solve on it.
#[derive(Default)]
pub struct Hull {
    pub size: usize,
    /// G, row-major [N, N].
    pub gram: Vec<f64>,
    pub kappa: f64,
    difference: Vec<f64>,
    ones: Vec<f64>,
    workspace: Workspace,
    y: Vec<f64>,
}

/// A blend: its support, its weights [N] (zero outside) and ||s_hat - s||^2.
#[derive(Clone, Debug, Default)]
pub struct Blend {
    pub support: u64,
    pub weights: Vec<f64>,
    pub value: f64,
}

impl Hull {
    /// `responses` [K', N, 3] of the representatives at the texel's K' views, `radiance` [K', 3].
    pub fn set(&mut self, responses: &[f32], radiance: &[f32], size: usize) {
        self.size = size;
        self.gram.clear();
        self.gram.resize(size * size, 0.0);
        self.ones.resize(size, 1.0);
        self.y.resize(size, 0.0);
        self.difference.resize(size, 0.0);
        for (s, s_hat) in responses
            .chunks_exact(3 * size)
            .zip(radiance.chunks_exact(3))
        {
            for c in 0..3 {
                for i in 0..size {
                    self.difference[i] = s[3 * i + c] as f64 - s_hat[c] as f64;
                }
                for i in 0..size {
                    let d = self.difference[i];
                    for (g, &e) in self.gram[i * size..].iter_mut().zip(&self.difference[..=i]) {
                        *g += d * e;
                    }
                }
            }
        }
        // The lift is of the size of the differences themselves, so that neither drowns the other.
        let trace: f64 = (0..size).map(|i| self.gram[i * size + i]).sum();
        self.kappa = (trace / size as f64).max(f64::MIN_POSITIVE.sqrt());
        for i in 0..size {
            for k in 0..=i {
                self.gram[i * size + k] += self.kappa;
                self.gram[k * size + i] = self.gram[i * size + k];
            }
        }
    }

    /// Best blend over the simplex of the `allowed` representatives, no bound on the support's size.
    pub fn relax(&mut self, allowed: u64) -> Blend {
        self.y.fill(0.0);
        let ones = std::mem::take(&mut self.ones);
        // Slopes are relative: G_jj >= kappa and the right-hand side is 1.
        let tolerance = 1e-11 / self.kappa.sqrt();
        self.workspace.solve(
            &self.gram,
            &ones[..self.size],
            |j| allowed >> j & 1 == 1,
            &mut self.y[..self.size],
            tolerance,
        );
        self.ones = ones;
        let total: f64 = self.y[..self.size].iter().sum();
        let weights: Vec<f64> = self.y[..self.size].iter().map(|y| y / total).collect();
        let support = (0..self.size)
            .filter(|&i| weights[i] > 0.0)
            .fold(0, |m, i| m | 1 << i);
        let value = self.value(&weights);
        Blend {
            support,
            weights,
            value,
        }
    }

    /// ||s_hat - sum_i w_i s_i||^2 of any weights that sum to one.
    pub fn value(&self, weights: &[f64]) -> f64 {
        let mut value = 0.0;
        for (row, &w) in self.gram.chunks_exact(self.size).zip(weights) {
            if w != 0.0 {
                value += w * row
                    .iter()
                    .zip(weights)
                    .map(|(g, v)| (g - self.kappa) * v)
                    .sum::<f64>();
            }
        }
        value.max(0.0)
    }
}
