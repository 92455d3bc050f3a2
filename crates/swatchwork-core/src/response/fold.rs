// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! From means to results: matrix products with a broadcast weight and a vector of pairs.

use super::basis::{Basis, SHAPES, runs};
use super::lanes::{Array, Lanes};
use std::ops::Range;

/// Representatives whose sums are kept in registers while the means pass by once.
const TOGETHER: usize = 4;

/// Weights of one channel of a few representatives.
#[derive(Debug, Clone)]
struct Group {
    /// By mean, [means, TOGETHER]; 0 for those that fill up the last group.
    weights: Vec<[f32; TOGETHER]>,
    /// Means that count for any of them.
    runs: Vec<Range<usize>>,
}

/// Representatives folded through the basis: weights over means.
#[derive(Debug, Clone)]
pub struct Folded {
    count: usize,
    /// [N / TOGETHER, 3], the first rounded up.
    groups: Vec<[Group; 3]>,
}

impl Folded {
    /// Folds `representatives` [N, J, 3], weights over the basis' kernels (Eq. 14).
    pub fn new(basis: &Basis, representatives: &[f64]) -> Self {
        let each = basis.kernels() * 3;
        let groups = representatives.chunks(TOGETHER * each).map(|members| {
            [0, 1, 2].map(|c| {
                let rows = members.chunks(each).map(|one| folded(basis, one, c));
                Group::new(basis.means(), rows)
            })
        });
        Self {
            count: representatives.len() / each,
            groups: groups.collect(),
        }
    }

    /// Number of representatives, N.
    pub fn count(&self) -> usize {
        self.count
    }
}

/// Weights over means of channel `c` of one representative [J, 3].
fn folded(basis: &Basis, representative: &[f64], c: usize) -> Vec<f64> {
    let mut row = vec![0.0; basis.means()];
    let weight = |j: usize| representative[3 * j + c];
    for (j, kernel) in basis.specular.iter().enumerate() {
        if weight(j) == 0.0 {
            continue;
        }
        let start = basis.plane_start(kernel.plane);
        for (r, w) in kernel.weights.iter().enumerate() {
            row[start + r] += weight(j) * f64::from(*w);
        }
    }
    let start = basis.means() - SHAPES * SHAPES;
    for (k, kernel) in basis.diffuse.iter().enumerate() {
        for (term, coefficient) in kernel.iter().enumerate() {
            row[start + term] += weight(basis.specular.len() + k) * f64::from(*coefficient);
        }
    }
    row
}

impl Group {
    fn new(means: usize, rows: impl Iterator<Item = Vec<f64>>) -> Self {
        let mut weights = vec![[0.0; TOGETHER]; means];
        let mut share = vec![0.0f32; means];
        for (member, row) in rows.enumerate() {
            let largest = row.iter().fold(f64::MIN_POSITIVE, |m, w| m.max(w.abs()));
            for (k, w) in row.into_iter().enumerate() {
                weights[k][member] = w as f32;
                share[k] = share[k].max((w.abs() / largest) as f32);
            }
        }
        Self {
            runs: runs(&share),
            weights,
        }
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
    let (means, _) = means.as_chunks::<3>();
    for (groups, results) in folded.groups.iter().zip(results.chunks_mut(3 * TOGETHER)) {
        for (c, group) in groups.iter().enumerate() {
            let mut sums = [L::splat(0.0); TOGETHER];
            for run in &group.runs {
                for (weights, mean) in group.weights[run.clone()].iter().zip(&means[run.clone()]) {
                    let mean = L::load(&mean[c]);
                    for n in 0..TOGETHER {
                        sums[n] = L::splat(weights[n]).fma(mean, sums[n]);
                    }
                }
            }
            for (result, sum) in results.chunks_exact_mut(3).zip(sums) {
                result[c] = sum.store();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{LANES, Plain};
    use super::*;

    #[test]
    fn groups_skip_what_counts_for_none() {
        let rows = [
            vec![0.0, 0.0, 2.0, 1e-12, 0.0],
            vec![0.0; 5],
            vec![3.0, 0.0, 0.0, 0.0, 0.0],
        ];
        let group = Group::new(5, rows.into_iter());
        assert_eq!(group.runs, [0..1, 2..3]);
        assert_eq!(group.weights[2], [2.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn sums_are_those_of_the_dense_product() {
        // Five representatives of three means: one group full, one nearly empty.
        let weight = |n: usize, c: usize, k: usize| ((7 * n + 3 * c + k) % 5) as f64;
        let groups = [0..4, 4..5].map(|members: Range<usize>| {
            [0, 1, 2].map(|c| {
                let row = |n| (0..3).map(|k| weight(n, c, k)).collect();
                Group::new(3, members.clone().map(row))
            })
        });
        let folded = Folded {
            count: 5,
            groups: groups.into(),
        };
        let means: Vec<Array> = (0..9).map(|k| [k as f32; LANES]).collect();
        let mut results = vec![[0.0; LANES]; 15];
        fold_representatives::<Plain>(&folded, &means, &mut results);
        for (at, result) in results.iter().enumerate() {
            let (n, c) = (at / 3, at % 3);
            let sum: f64 = (0..3).map(|k| weight(n, c, k) * (3 * k + c) as f64).sum();
            assert_eq!(result[5], sum as f32);
        }
    }
}
