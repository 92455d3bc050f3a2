// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The data of Eq. 5 at the texels that take part.

// Indices where iterators would do: those are not inlined into functions of other target features.
#![allow(clippy::needless_range_loop)]

use super::simd::{FOUR, Four, axpy, dispatched};
use rayon::prelude::*;

/// Kernels in a block of the stored responses.
pub const BLOCK: usize = 16;

/// Measurements and generic responses of M texels, P pairs (texel, view), J kernels a channel.
pub struct Problem {
    pub kernels: usize,
    /// Pairs of texel x are `offsets[x]..offsets[x + 1]`.
    pub offsets: Vec<usize>,
    /// s*_{x,j}, channel by channel [3][J / 16][P][16] (Eq. 13), filled up with zeros: the Gram products
    /// read blocks of kernels of all pairs.
    responses: [Vec<[f32; BLOCK]>; 3],
    /// s_hat, channel by channel [3][P].
    pub radiance: [Vec<f32>; 3],
    /// 1 / max(||s_hat_x||^2, floor): relative error with a floor for near-black texels.
    pub gamma: Vec<f64>,
}

impl Problem {
    /// `responses` [P, J, 3] and `radiance` [P, 3] as the rendering operator gives them.
    /// `floor` [M]: the least ||s_hat_x||^2 that still counts as itself.
    pub fn new(
        responses: &[f32],
        radiance: &[f32],
        offsets: Vec<usize>,
        kernels: usize,
        floor: &[f64],
    ) -> Self {
        let pairs = radiance.len() / 3;
        let plane = |c: usize| -> Vec<f32> { (0..pairs).map(|p| radiance[3 * p + c]).collect() };
        let radiance = [plane(0), plane(1), plane(2)];
        let channel = |c: usize| -> Vec<[f32; BLOCK]> {
            let mut rows = vec![[0.0; BLOCK]; pairs * kernels.div_ceil(BLOCK)];
            rows.par_chunks_mut(pairs.max(1))
                .enumerate()
                .for_each(|(block, rows)| {
                    let kernel = block * BLOCK..kernels.min((block + 1) * BLOCK);
                    for (p, row) in rows.iter_mut().enumerate() {
                        for (v, j) in row.iter_mut().zip(kernel.clone()) {
                            *v = responses[(p * kernels + j) * 3 + c];
                        }
                    }
                });
            rows
        };
        let gamma = (0..offsets.len() - 1)
            .map(|x| {
                let energy: f64 = radiance
                    .iter()
                    .flat_map(|plane: &Vec<f32>| &plane[offsets[x]..offsets[x + 1]])
                    .map(|&v| f64::from(v).powi(2))
                    .sum();
                1.0 / energy.max(floor[x])
            })
            .collect();
        Problem {
            kernels,
            offsets,
            responses: [channel(0), channel(1), channel(2)],
            radiance,
            gamma,
        }
    }

    pub fn texels(&self) -> usize {
        self.offsets.len() - 1
    }

    pub fn pairs(&self) -> usize {
        self.radiance[0].len()
    }

    /// Blocks of kernels.
    pub fn blocks(&self) -> usize {
        self.kernels.div_ceil(BLOCK)
    }

    /// Responses [P][16] of a channel's block of kernels.
    pub fn block(&self, channel: usize, block: usize) -> &[[f32; BLOCK]] {
        &self.responses[channel][block * self.pairs()..(block + 1) * self.pairs()]
    }

    /// s_{x,i} = sum_j w*_{i,j} s*_{x,j} (Eq. 14): [P, N, 3] from representatives [N, J, 3].
    pub fn fold(&self, representatives: &[f64]) -> Vec<f32> {
        let j = self.kernels;
        let n = representatives.len() / (3 * j);
        let width = n.next_multiple_of(FOUR);
        // Only the kernels in use, of any representative: w*_{i,j} as rows [N] in f64.
        let used: [Vec<(usize, Vec<f64>)>; 3] = [0, 1, 2].map(|c| {
            (0..j)
                .map(|k| {
                    let row = (0..width)
                        .map(|i| {
                            if i < n {
                                representatives[(i * j + k) * 3 + c]
                            } else {
                                0.0
                            }
                        })
                        .collect();
                    (k, row)
                })
                .filter(|(_, row): &(usize, Vec<f64>)| row.iter().any(|&w| w != 0.0))
                .collect()
        });
        let mut out = vec![0.0; self.pairs() * n * 3];
        out.par_chunks_mut(3 * n.max(1) * PAIRS_A_TASK)
            .enumerate()
            .for_each(|(task, out)| fold_pairs(self, &used, task * PAIRS_A_TASK, n, out));
        out
    }
}

/// Pairs that a task folds.
const PAIRS_A_TASK: usize = 256;

dispatched! {
    fn fold_pairs(
        problem: &Problem,
        used: &[Vec<(usize, Vec<f64>)>; 3],
        first: usize,
        n: usize,
        out: &mut [f32],
    ) = fold_some
}

#[inline(always)]
fn fold_some<F: Four>(
    problem: &Problem,
    used: &[Vec<(usize, Vec<f64>)>; 3],
    first: usize,
    n: usize,
    out: &mut [f32],
) {
    // f64 sums: the noise-free experiments go down to 1e-6.
    let mut sum = vec![0.0; n.next_multiple_of(FOUR)];
    for q in 0..out.len() / (3 * n) {
        for c in 0..3 {
            sum.fill(0.0);
            for u in 0..used[c].len() {
                let (k, weights) = &used[c][u];
                let s = problem.block(c, k / BLOCK)[first + q][k % BLOCK];
                axpy::<F>(f64::from(s), weights, &mut sum);
            }
            for i in 0..n {
                out[3 * (q * n + i) + c] = sum[i] as f32;
            }
        }
    }
}
