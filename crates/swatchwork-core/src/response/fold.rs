// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! From means to results: matrix products with a broadcast weight and a vector of pairs.

use super::basis::{Basis, SHAPES};
use super::lanes::{Array, LANES, Lanes};

/// Representatives folded through the basis: weights over means, [N, 3, means].
#[derive(Debug, Clone)]
pub struct Folded {
    pub(super) count: usize,
    pub(super) weights: Vec<f32>,
}

impl Folded {
    /// Folds `representatives` [N, J, 3], weights over the basis' kernels (Eq. 14).
    pub fn new(basis: &Basis, representatives: &[f64]) -> Self {
        let (kernels, means) = (basis.kernels(), basis.means());
        let count = representatives.len() / (kernels * 3);
        let mut folded = vec![0.0f64; count * 3 * means];
        for n in 0..count {
            for c in 0..3 {
                let row = &mut folded[(n * 3 + c) * means..][..means];
                let weight = |j: usize| representatives[(n * kernels + j) * 3 + c];
                for (j, kernel) in basis
                    .specular
                    .iter()
                    .enumerate()
                    .filter(|(j, _)| weight(*j) != 0.0)
                {
                    let start = basis.plane_start(kernel.plane);
                    for (r, w) in kernel.weights.iter().enumerate() {
                        row[start + r] += weight(j) * f64::from(*w);
                    }
                }
                for (k, kernel) in basis.diffuse.iter().enumerate() {
                    for (term, coefficient) in kernel.iter().enumerate() {
                        row[means - SHAPES * SHAPES + term] +=
                            weight(basis.specular.len() + k) * f64::from(*coefficient);
                    }
                }
            }
        }
        Self {
            count,
            weights: folded.iter().map(|&w| w as f32).collect(),
        }
    }

    /// Number of representatives, N.
    pub fn count(&self) -> usize {
        self.count
    }
}

/// Results [J, 3] of a block's kernels.
#[inline(always)]
pub fn fold_kernels<L: Lanes>(basis: &Basis, means: &[Array], results: &mut [Array]) {
    for (j, kernel) in basis.specular.iter().enumerate() {
        let start = basis.plane_start(kernel.plane);
        let mut sums = [L::splat(0.0); 3];
        for run in &basis.runs[j] {
            let mean = &means[3 * (start + run.start)..3 * (start + run.end)];
            for (&weight, mean) in kernel.weights[run.clone()]
                .iter()
                .zip(mean.as_chunks::<3>().0)
            {
                let weight = L::splat(weight);
                for c in 0..3 {
                    sums[c] = weight.fma(L::load(&mean[c]), sums[c]);
                }
            }
        }
        for c in 0..3 {
            results[3 * j + c] = sums[c].store();
        }
    }
    let last = &means[means.len() - 3 * SHAPES * SHAPES..];
    for (row, result) in basis
        .diffuse
        .iter()
        .zip(results[3 * basis.specular.len()..].chunks_exact_mut(3))
    {
        for c in 0..3 {
            let mut sum = L::splat(0.0);
            for (term, &coefficient) in row.iter().enumerate().filter(|(_, c)| **c != 0.0) {
                sum = L::splat(coefficient).fma(L::load(&last[3 * term + c]), sum);
            }
            result[c] = sum.store();
        }
    }
}

/// Results [N, 3] of a block's representatives.
#[inline(always)]
pub fn fold_representatives<L: Lanes>(folded: &Folded, means: &[Array], results: &mut [Array]) {
    let length = means.len() / 3;
    for (at, result) in results.iter_mut().enumerate() {
        let mut sum = L::splat(0.0);
        for (k, &weight) in folded.weights[at * length..][..length].iter().enumerate() {
            sum = L::splat(weight).fma(L::load(&means[3 * k + at % 3]), sum);
        }
        *result = sum.store();
    }
}

/// Writes lanes [row][lane] as pairs [lane][row].
pub fn transpose(results: &[Array], out: &mut [f32]) {
    let rows = results.len();
    for (k, pair) in out.chunks_exact_mut(rows).enumerate().take(LANES) {
        for (value, result) in pair.iter_mut().zip(results) {
            *value = result[k];
        }
    }
}
