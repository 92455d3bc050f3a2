// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The Gram matrices of the representative step,
//!
//!   H_ik = sum_x gamma_x w_{x,i} w_{x,k} G_x,    G_x = s*_x' s*_x        [J, J].
//!
//! G_x is formed once a texel, a tile of 16 x 16 kernels at a time, and then added to the tiles of every
//! pair (i, k) that the texel blends: views + pairs multiplications an entry where a matrix product for
//! each pair would take views x pairs. G_x is symmetric, so only its upper tiles are formed. Texels of
//! the same support follow one another and are added in fours: their tiles stay in the first-level cache.

// Indices where iterators would do: those are not inlined into functions of other target features.
#![allow(clippy::needless_range_loop)]

use super::problem::{BLOCK, Problem};
use super::simd::{FOUR, Four, dispatched};
use rayon::prelude::*;

/// Entries of a tile.
const AREA: usize = BLOCK * BLOCK;
/// Texels added at a time.
const TOGETHER: usize = 4;
/// No such pair (i, k).
const ABSENT: usize = usize::MAX;

/// Texels that blend the same representatives, and where their products go.
struct Group {
    texels: Vec<usize>,
    /// Slots of the support's pairs i <= k.
    slots: Vec<usize>,
    /// gamma_x w_i w_k of each texel, pair by pair.
    factors: Vec<f64>,
}

/// Which products are due.
struct Plan {
    groups: Vec<Group>,
    /// Pairs (i, k) that occur, by slot.
    pairs: Vec<(usize, usize)>,
    views: usize,
}

fn plan(problem: &Problem, weights: &[f64], n_reps: usize) -> Plan {
    let support = |x: usize| -> Vec<usize> {
        let row = &weights[x * n_reps..(x + 1) * n_reps];
        (0..n_reps).filter(|&i| row[i] > 0.0).collect()
    };
    let mut order: Vec<(Vec<usize>, usize)> =
        (0..problem.texels()).map(|x| (support(x), x)).collect();
    order.sort();
    let mut slot = vec![ABSENT; n_reps * n_reps];
    let mut pairs = Vec::new();
    let groups = order
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|same| !same[0].0.is_empty())
        .map(|same| {
            let support = &same[0].0;
            let of: Vec<(usize, usize)> = (0..support.len())
                .flat_map(|a| (a..support.len()).map(move |b| (support[a], support[b])))
                .collect();
            let slots = of
                .iter()
                .map(|&(i, k)| {
                    let s = &mut slot[i * n_reps + k];
                    if *s == ABSENT {
                        *s = pairs.len();
                        pairs.push((i, k));
                    }
                    *s
                })
                .collect();
            let texels: Vec<usize> = same.iter().map(|&(_, x)| x).collect();
            let factors = of
                .iter()
                .flat_map(|&(i, k)| {
                    texels.iter().map(move |&x| {
                        problem.gamma[x] * weights[x * n_reps + i] * weights[x * n_reps + k]
                    })
                })
                .collect();
            Group {
                texels,
                slots,
                factors,
            }
        })
        .collect();
    let views = problem.offsets.windows(2).map(|w| w[1] - w[0]).max();
    Plan {
        groups,
        pairs,
        views: views.unwrap_or(0),
    }
}

/// H [N J, N J] of the three channels, for dense weights [M, N].
pub fn gram_matrices(problem: &Problem, weights: &[f64], n_reps: usize) -> [Vec<f64>; 3] {
    let plan = plan(problem, weights, n_reps);
    let blocks = problem.blocks();
    let tasks: Vec<(usize, usize, usize)> = (0..3)
        .flat_map(|c| (0..blocks).flat_map(move |a| (a..blocks).map(move |b| (c, a, b))))
        .collect();
    let sums: Vec<Vec<f64>> = tasks
        .par_iter()
        .with_max_len(1)
        .map(|&(c, a, b)| tile_sums(problem, &plan, c, a, b))
        .collect();
    let mut out = [Vec::new(), Vec::new(), Vec::new()];
    out.par_iter_mut()
        .zip(sums.par_chunks(tasks.len() / 3))
        .for_each(|(h, sums)| *h = assembled(problem.kernels, &plan, n_reps, sums));
    out
}

/// One channel's H from the sums of its tiles.
fn assembled(j: usize, plan: &Plan, n_reps: usize, sums: &[Vec<f64>]) -> Vec<f64> {
    let size = n_reps * j;
    let mut h = vec![0.0; size * size];
    let blocks = j.div_ceil(BLOCK);
    let tiles = (0..blocks).flat_map(|a| (a..blocks).map(move |b| (a, b)));
    for ((a, b), sum) in tiles.zip(sums) {
        for (&(i, k), tile) in plan.pairs.iter().zip(sum.chunks_exact(AREA)) {
            for r in 0..BLOCK.min(j - a * BLOCK) {
                for c in 0..BLOCK.min(j - b * BLOCK) {
                    let (row, column, v) = (a * BLOCK + r, b * BLOCK + c, tile[r * BLOCK + c]);
                    h[(i * j + row) * size + k * j + column] = v;
                    h[(k * j + column) * size + i * j + row] = v;
                    h[(i * j + column) * size + k * j + row] = v;
                    h[(k * j + row) * size + i * j + column] = v;
                }
            }
        }
    }
    h
}

dispatched! {
    /// Tile (a, b) of every pair's H, one channel: [pairs, 16, 16].
    fn tile_sums(problem: &Problem, plan: &Plan, channel: usize, a: usize, b: usize) -> Vec<f64> = tile_sums_with
}

type Row = [f64; BLOCK];

#[inline(always)]
fn tile_sums_with<F: Four>(
    problem: &Problem,
    plan: &Plan,
    channel: usize,
    a: usize,
    b: usize,
) -> Vec<f64> {
    let (left, right) = (problem.block(channel, a), problem.block(channel, b));
    let mut sums = vec![[0.0; AREA]; plan.pairs.len()];
    let mut rows = (
        vec![[0.0; BLOCK]; plan.views],
        vec![[0.0; BLOCK]; plan.views],
    );
    let mut tiles = [[0.0; AREA]; TOGETHER];
    for group in &plan.groups {
        let count = group.texels.len();
        for first in (0..count).step_by(TOGETHER) {
            let last = count.min(first + TOGETHER);
            for t in 0..last - first {
                let x = group.texels[first + t];
                let pairs = problem.offsets[x]..problem.offsets[x + 1];
                let views = pairs.len();
                widen::<F>(&left[pairs.clone()], &mut rows.0);
                widen::<F>(&right[pairs], &mut rows.1);
                product::<F>(&rows.0[..views], &rows.1[..views], &mut tiles[t]);
            }
            for q in 0..group.slots.len() {
                let sum = &mut sums[group.slots[q]];
                match group.factors[q * count + first..q * count + last] {
                    [a] => add::<F, 1>([a], &tiles, sum),
                    [a, b] => add::<F, 2>([a, b], &tiles, sum),
                    [a, b, c] => add::<F, 3>([a, b, c], &tiles, sum),
                    [a, b, c, d] => add::<F, 4>([a, b, c, d], &tiles, sum),
                    _ => unreachable!("at most {TOGETHER} texels"),
                }
            }
        }
    }
    sums.into_flattened()
}

#[inline(always)]
fn widen<F: Four>(from: &[[f32; BLOCK]], to: &mut [Row]) {
    let to = &mut to[..from.len()];
    for v in 0..from.len() {
        for k in 0..BLOCK / FOUR {
            F::widen(&from[v][FOUR * k..]).store(&mut to[v][FOUR * k..]);
        }
    }
}

/// tile = left' right, in pieces of 4 x 8 that stay in registers.
#[inline(always)]
fn product<F: Four>(left: &[Row], right: &[Row], tile: &mut [f64; AREA]) {
    let right = &right[..left.len()];
    for piece in 0..BLOCK / 4 * (BLOCK / 8) {
        let (r, c) = (piece / 2 * 4, piece % 2 * 8);
        let mut sum = [[F::splat(0.0); 2]; 4];
        for v in 0..left.len() {
            let row = [F::load(&right[v][c..]), F::load(&right[v][c + FOUR..])];
            for q in 0..4 {
                let l = F::splat(left[v][r + q]);
                sum[q] = [l.fma(row[0], sum[q][0]), l.fma(row[1], sum[q][1])];
            }
        }
        for q in 0..4 {
            let at = (r + q) * BLOCK + c;
            sum[q][0].store(&mut tile[at..]);
            sum[q][1].store(&mut tile[at + FOUR..]);
        }
    }
}

/// sum += the first tiles, each times its factor.
#[inline(always)]
fn add<F: Four, const COUNT: usize>(
    factors: [f64; COUNT],
    tiles: &[[f64; AREA]; TOGETHER],
    sum: &mut [f64; AREA],
) {
    let mut each = [F::splat(0.0); COUNT];
    for t in 0..COUNT {
        each[t] = F::splat(factors[t]);
    }
    for k in 0..AREA / FOUR {
        let mut v = F::load(&sum[FOUR * k..]);
        for t in 0..COUNT {
            v = each[t].fma(F::load(&tiles[t][FOUR * k..]), v);
        }
        v.store(&mut sum[FOUR * k..]);
    }
}
