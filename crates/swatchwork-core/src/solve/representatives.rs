// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Representative optimisation (Eqs. 6 and 7): with the blend weights fixed, each colour channel is
//! one non-negative least-squares problem in the N J weights w*, whose Gram matrix has a block
//!
//!   H_ik = sum_x gamma_x w_{x,i} w_{x,k} s*_x' s*_x        [J, J]
//!
//! for each pair (i, k) of representatives that some texel blends, and
//!
//!   b_i = sum_x gamma_x w_{x,i} s*_x' s_hat_x              [J].

// Indices where iterators would do: those are not inlined into functions of other target features.
#![allow(clippy::needless_range_loop)]

use super::gram::gram_matrices;
use super::nnls::{Quadratic, Status, Workspace};
use super::problem::{BLOCK, Problem};
use rayon::prelude::*;

/// H and b of one channel, and c = sum_x gamma_x ||s_hat_x||^2.
pub struct NormalEquations {
    pub h: Vec<f64>,
    pub b: Vec<f64>,
    pub c: f64,
}

impl NormalEquations {
    /// x'Hx - 2 b'x + c.
    fn value(&self, x: &[f64]) -> f64 {
        let mut value = self.c;
        for (k, row) in self.h.chunks(x.len()).enumerate() {
            if x[k] > 0.0 {
                let hx: f64 = row.iter().zip(x).map(|(h, x)| h * x).sum();
                value += x[k] * (hx - 2.0 * self.b[k]);
            }
        }
        value
    }
}

/// Accumulate the normal equations of the three channels. `weights` is dense, [M, N].
pub fn normal_equations(problem: &Problem, weights: &[f64], n_reps: usize) -> [NormalEquations; 3] {
    let mut channel = 0;
    gram_matrices(problem, weights, n_reps).map(|h| {
        let (b, c) = right_side(problem, weights, n_reps, channel);
        channel += 1;
        NormalEquations { h, b, c }
    })
}

/// b and c of one channel.
fn right_side(
    problem: &Problem,
    weights: &[f64],
    n_reps: usize,
    channel: usize,
) -> (Vec<f64>, f64) {
    let j = problem.kernels;
    let radiance = &problem.radiance[channel];
    let mut b = vec![0.0; n_reps * j];
    let mut c = 0.0;
    for x in 0..problem.texels() {
        let pairs = problem.offsets[x]..problem.offsets[x + 1];
        let energy: f64 = radiance[pairs].iter().map(|&s| f64::from(s).powi(2)).sum();
        c += problem.gamma[x] * energy;
    }
    for block in 0..problem.blocks() {
        let rows = problem.block(channel, block);
        let kernels = block * BLOCK..j.min((block + 1) * BLOCK);
        for x in 0..problem.texels() {
            let mut sum = [0.0; BLOCK];
            for p in problem.offsets[x]..problem.offsets[x + 1] {
                let s_hat = f64::from(radiance[p]);
                for k in 0..BLOCK {
                    sum[k] += f64::from(rows[p][k]) * s_hat;
                }
            }
            for i in 0..n_reps {
                let w = weights[x * n_reps + i] * problem.gamma[x];
                if w > 0.0 {
                    for (v, &s) in b[i * j..][kernels.clone()].iter_mut().zip(&sum) {
                        *v += w * s;
                    }
                }
            }
        }
    }
    (b, c)
}

/// The optimal representatives [N, J, 3] for the given weights, from `start` [N, J, 3] (zeros: cold).
/// A representative that no texel uses comes back as zero. Also the data term of Eq. 5, as a mean over
/// texels, and whether all three channels converged.
pub fn optimise(
    problem: &Problem,
    weights: &[f64],
    n_reps: usize,
    start: &[f64],
) -> (Vec<f64>, f64, Status) {
    let j = problem.kernels;
    let size = n_reps * j;
    let equations = normal_equations(problem, weights, n_reps);
    let solved: Vec<(Vec<f64>, f64, Status)> = equations
        .par_iter()
        .enumerate()
        .map(|(c, e)| {
            let mut x: Vec<f64> = (0..size).map(|k| start[k * 3 + c]).collect();
            // A slope of 1e-9 of the data's norm leaves at most 5e-19 of its energy unexplained.
            let least = 1e-9 * e.c.sqrt();
            let quadratic = Quadratic {
                h: &e.h,
                b: &e.b,
                block: j,
            };
            let status = Workspace::default().solve(&quadratic, &mut x, least);
            let value = e.value(&x);
            (x, value, status)
        })
        .collect();
    let mut representatives = vec![0.0; size * 3];
    let mut value = 0.0;
    let mut status = Status::Converged;
    for (c, (x, v, s)) in solved.iter().enumerate() {
        for k in 0..size {
            representatives[k * 3 + c] = x[k];
        }
        value += v;
        if *s != Status::Converged {
            status = *s;
        }
    }
    (
        representatives,
        value / problem.texels().max(1) as f64,
        status,
    )
}
