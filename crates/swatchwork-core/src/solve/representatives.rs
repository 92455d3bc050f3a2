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

use super::nnls::{Status, Workspace};
use super::problem::Problem;
use rayon::prelude::*;

/// Rows a block of the Gram products holds: two blocks of it stay in the second-level cache.
const BLOCK_ROWS: usize = 256;

/// H and b of one channel, and c = sum_x gamma_x ||s_hat_x||^2.
pub struct NormalEquations {
    pub h: Vec<f64>,
    pub b: Vec<f64>,
    pub c: f64,
}

/// Texels whose blend holds both i and k, with gamma_x w_i w_k.
fn sharing(
    problem: &Problem,
    weights: &[f64],
    n_reps: usize,
    i: usize,
    k: usize,
) -> Vec<(usize, f64)> {
    (0..problem.texels())
        .filter_map(|x| {
            let w = weights[x * n_reps + i] * weights[x * n_reps + k];
            (w > 0.0).then(|| (x, w * problem.gamma[x]))
        })
        .collect()
}

/// sum over the listed texels of factor * s*' s*, one channel.
fn gram_block(problem: &Problem, channel: usize, list: &[(usize, f64)]) -> Vec<f64> {
    let j = problem.kernels;
    let mut sum = vec![0.0; j * j];
    let mut rows = Vec::with_capacity(BLOCK_ROWS * j);
    let mut scaled = Vec::with_capacity(BLOCK_ROWS * j);
    let mut flush = |rows: &mut Vec<f64>, scaled: &mut Vec<f64>| {
        let count = rows.len() / j;
        // SAFETY: rows and scaled are count x j, sum is j x j, all dense row-major.
        unsafe {
            matrixmultiply::dgemm(
                j,
                count,
                j,
                1.0,
                scaled.as_ptr(),
                1,
                j as isize,
                rows.as_ptr(),
                j as isize,
                1,
                1.0,
                sum.as_mut_ptr(),
                j as isize,
                1,
            );
        }
        rows.clear();
        scaled.clear();
    };
    for &(x, factor) in list {
        for p in problem.offsets[x]..problem.offsets[x + 1] {
            let s = &problem.responses[channel][p * j..(p + 1) * j];
            rows.extend(s.iter().map(|&v| v as f64));
            scaled.extend(s.iter().map(|&v| v as f64 * factor));
            if rows.len() == BLOCK_ROWS * j {
                flush(&mut rows, &mut scaled);
            }
        }
    }
    if !rows.is_empty() {
        flush(&mut rows, &mut scaled);
    }
    sum
}

/// Accumulate the normal equations of the three channels. `weights` is dense, [M, N].
pub fn normal_equations(problem: &Problem, weights: &[f64], n_reps: usize) -> [NormalEquations; 3] {
    let j = problem.kernels;
    let size = n_reps * j;
    let pairs: Vec<(usize, usize)> = (0..n_reps)
        .flat_map(|i| (i..n_reps).map(move |k| (i, k)))
        .collect();
    let lists: Vec<Vec<(usize, f64)>> = pairs
        .par_iter()
        .map(|&(i, k)| sharing(problem, weights, n_reps, i, k))
        .collect();
    let tasks: Vec<(usize, usize)> = (0..pairs.len())
        .filter(|&q| !lists[q].is_empty())
        .flat_map(|q| (0..3).map(move |c| (q, c)))
        .collect();
    let blocks: Vec<Vec<f64>> = tasks
        .par_iter()
        .with_max_len(1)
        .map(|&(q, c)| gram_block(problem, c, &lists[q]))
        .collect();
    let mut out = [0, 1, 2].map(|c| right_side(problem, weights, n_reps, c));
    for (&(q, c), block) in tasks.iter().zip(&blocks) {
        let (i, k) = pairs[q];
        for a in 0..j {
            for d in 0..j {
                let v = block[a * j + d];
                out[c].h[(i * j + a) * size + k * j + d] = v;
                out[c].h[(k * j + d) * size + i * j + a] = v;
            }
        }
    }
    out
}

fn right_side(
    problem: &Problem,
    weights: &[f64],
    n_reps: usize,
    channel: usize,
) -> NormalEquations {
    let j = problem.kernels;
    let size = n_reps * j;
    let mut b = vec![0.0; size];
    let mut c = 0.0;
    let mut sum = vec![0.0; j];
    for x in 0..problem.texels() {
        sum.fill(0.0);
        for p in problem.offsets[x]..problem.offsets[x + 1] {
            let s_hat = problem.radiance[channel][p] as f64;
            c += problem.gamma[x] * s_hat * s_hat;
            for (v, &s) in sum
                .iter_mut()
                .zip(&problem.responses[channel][p * j..(p + 1) * j])
            {
                *v += s as f64 * s_hat;
            }
        }
        for i in 0..n_reps {
            let w = weights[x * n_reps + i] * problem.gamma[x];
            if w > 0.0 {
                for (v, &s) in b[i * j..(i + 1) * j].iter_mut().zip(&sum) {
                    *v += w * s;
                }
            }
        }
    }
    NormalEquations {
        h: vec![0.0; size * size],
        b,
        c,
    }
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
            let status =
                Workspace::default().solve(&e.h, &e.b, |_| true, &mut x, 1e-9 * e.c.sqrt());
            let mut value = e.c;
            for (k, row) in e.h.chunks(size).enumerate() {
                if x[k] > 0.0 {
                    let hx: f64 = row.iter().zip(&x).map(|(h, x)| h * x).sum();
                    value += x[k] * (hx - 2.0 * e.b[k]);
                }
            }
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
