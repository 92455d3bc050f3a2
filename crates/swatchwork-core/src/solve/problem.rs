// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The data of Eq. 5 at the texels that take part.

use rayon::prelude::*;

/// Measurements and generic responses of M texels, P pairs (texel, view), J kernels a channel.
pub struct Problem {
    pub kernels: usize,
    /// Pairs of texel x are `offsets[x]..offsets[x + 1]`.
    pub offsets: Vec<usize>,
    /// s*_{x,j}, channel by channel [3][P, J] (Eq. 13).
    pub responses: [Vec<f32>; 3],
    /// s_hat, channel by channel [3][P].
    pub radiance: [Vec<f32>; 3],
    /// 1 / max(||s_hat_x||^2, floor): relative error with a floor for near-black texels.
    pub gamma: Vec<f64>,
    /// Texel of each pair.
    pub texel: Vec<u32>,
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
        let channel = |c: usize| -> Vec<f32> {
            let mut rows = vec![0.0; pairs * kernels];
            rows.par_chunks_mut(kernels.max(1))
                .enumerate()
                .for_each(|(p, row)| {
                    for (j, v) in row.iter_mut().enumerate() {
                        *v = responses[(p * kernels + j) * 3 + c];
                    }
                });
            rows
        };
        let mut gamma = Vec::with_capacity(offsets.len() - 1);
        let mut texel = Vec::with_capacity(pairs);
        for x in 0..offsets.len() - 1 {
            let pairs = offsets[x]..offsets[x + 1];
            let energy: f64 = radiance
                .iter()
                .flat_map(|plane: &Vec<f32>| &plane[pairs.clone()])
                .map(|&v| f64::from(v).powi(2))
                .sum();
            texel.extend(pairs.map(|_| x as u32));
            gamma.push(1.0 / energy.max(floor[x]));
        }
        Problem {
            kernels,
            offsets,
            responses: [channel(0), channel(1), channel(2)],
            radiance,
            gamma,
            texel,
        }
    }

    pub fn texels(&self) -> usize {
        self.offsets.len() - 1
    }

    pub fn pairs(&self) -> usize {
        self.texel.len()
    }

    /// s_{x,i} = sum_j w*_{i,j} s*_{x,j} (Eq. 14): [P, N, 3] from representatives [N, J, 3].
    pub fn fold(&self, representatives: &[f64]) -> Vec<f32> {
        let j = self.kernels;
        let n = representatives.len() / (3 * j);
        // Only the kernels in use: representatives are sparse in them.
        let mut used: [Vec<Vec<(usize, f32)>>; 3] = Default::default();
        for (c, lists) in used.iter_mut().enumerate() {
            *lists = (0..n)
                .map(|i| {
                    (0..j)
                        .map(|k| (k, representatives[(i * j + k) * 3 + c] as f32))
                        .filter(|&(_, w)| w != 0.0)
                        .collect()
                })
                .collect();
        }
        let mut out = vec![0.0; self.pairs() * n * 3];
        out.par_chunks_mut(3 * n.max(1))
            .enumerate()
            .for_each(|(p, row)| {
                for c in 0..3 {
                    let s = &self.responses[c][p * j..(p + 1) * j];
                    for i in 0..n {
                        // f64 sums: the noise-free experiments go down to 1e-6.
                        row[3 * i + c] = used[c][i]
                            .iter()
                            .map(|&(k, w)| (w as f64) * (s[k] as f64))
                            .sum::<f64>() as f32;
                    }
                }
            });
        out
    }
}
