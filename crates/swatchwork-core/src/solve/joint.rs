// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! A step of representatives and weights together, by variable projection (Golub and Pereyra 1973, in
//! Kaufman's form of 1975).
//!
//! Alternation holds the weights while it moves the representatives. Where the two can make up for one
//! another, as when all representatives drift towards the mean, it creeps. Here each texel's weights
//! follow: B_x [K, |S|] being the responses of its support S, a change of the representatives only counts
//! for the part that no change of weights that sum to 1 could undo. With J_x the derivative of B_x w_x and
//! Q_x an orthonormal basis of the differences of B_x's columns, the Gauss-Newton system is
//!
//!   H = sum_x gamma_x J_x' (1 - Q_x Q_x') J_x,    g = sum_x gamma_x J_x' (s_hat_x - B_x w_x),
//!
//! for an optimal w_x leaves a residual that Q_x does not see. Only kernels in use take part: others enter
//! by the representative step. Supports are held, weights may turn negative in the model; the exact blend
//! that follows decides.

// Indices where iterators would do: those are not inlined into functions of other target features.
#![allow(clippy::needless_range_loop)]

use super::nnls::{Quadratic, Workspace};
use super::problem::{BLOCK, Problem};
use super::simd::{FOUR, Four, axpy, dispatched};
use rayon::prelude::*;

/// Parts that the texels are summed in, whatever the number of threads, so that sums do not depend on it.
const PARTS: usize = 8;

/// A column of differences shorter than this share of itself, after projection, depends on the others.
const DEPENDENT: f64 = 1e-6;

/// A kernel weight that may change: w*_{i,j} of a channel.
struct Free {
    representative: usize,
    kernel: usize,
    channel: usize,
}

/// What the texels of a part add: H's lower triangle and g.
struct Sums {
    h: Vec<f64>,
    g: Vec<f64>,
}

/// Representatives [N, J, 3] that minimise the Gauss-Newton model, no kernel's weight below zero, for dense
/// weights [M, N]. Kernels not in use stay at zero, representatives that no texel blends stay as they are.
/// `damping` (Levenberg and Marquardt's) adds that share of H's diagonal to it.
pub fn joint_step(
    problem: &Problem,
    weights: &[f64],
    representatives: &[f64],
    damping: f64,
) -> Vec<f64> {
    let j = problem.kernels;
    let n = representatives.len() / (3 * j);
    let used: Vec<bool> = (0..n)
        .map(|i| weights.chunks_exact(n).any(|row| row[i] > 0.0))
        .collect();
    // By channel, then representative: places in H rise along those of any support.
    let free: Vec<Free> = (0..3)
        .flat_map(|channel| (0..n).map(move |i| (channel, i)))
        .flat_map(|(channel, representative)| {
            (0..j).map(move |kernel| Free {
                representative,
                kernel,
                channel,
            })
        })
        .filter(|f| used[f.representative])
        .filter(|f| representatives[(f.representative * j + f.kernel) * 3 + f.channel] > 0.0)
        .collect();
    let size = free.len();
    let folded = problem.fold(representatives);
    let texels = problem.texels();
    let parts: Vec<Sums> = (0..PARTS)
        .into_par_iter()
        .with_max_len(1)
        .map(|part| {
            let range = texels * part / PARTS..texels * (part + 1) / PARTS;
            sums(problem, weights, &folded, &free, n, range.start, range.end)
        })
        .collect();
    let (mut h, mut g) = (vec![0.0; size * size], vec![0.0; size]);
    for part in &parts {
        h.iter_mut().zip(&part.h).for_each(|(a, b)| *a += b);
        g.iter_mut().zip(&part.g).for_each(|(a, b)| *a += b);
    }
    for r in 0..size {
        for c in 0..r {
            h[c * size + r] = h[r * size + c];
        }
        h[r * size + r] *= 1.0 + damping;
    }
    // The model in terms of the new weights: its linear part is g + H x at the old.
    let at = |f: &Free| (f.representative * j + f.kernel) * 3 + f.channel;
    let x: Vec<f64> = free.iter().map(|f| representatives[at(f)]).collect();
    for r in 0..size {
        let row = &h[r * size..(r + 1) * size];
        g[r] += row.iter().zip(&x).map(|(h, x)| h * x).sum::<f64>();
    }
    // Those that matter least come last: where they vanish, the factor before them stays.
    let mut order: Vec<usize> = (0..size).collect();
    let weight = |r: usize| x[r] * x[r] * h[r * size + r];
    order.sort_by(|&a, &b| weight(b).total_cmp(&weight(a)));
    let sorted_h: Vec<f64> = order
        .iter()
        .flat_map(|&r| order.iter().map(move |&c| (r, c)))
        .map(|(r, c)| h[r * size + c])
        .collect();
    let sorted_g: Vec<f64> = order.iter().map(|&r| g[r]).collect();
    let mut sorted_x: Vec<f64> = order.iter().map(|&r| x[r]).collect();
    // As in the representative step: a slope of this much leaves 1e-18 of the energy that x explains.
    let least = 1e-9 * inner(&sorted_g, &sorted_x).max(0.0).sqrt();
    let quadratic = Quadratic {
        h: &sorted_h,
        b: &sorted_g,
        block: size.max(1),
    };
    // Feasible even at an iteration limit, and the exact blend judges it.
    Workspace::default().solve(&quadratic, &mut sorted_x, least);
    let mut out = representatives.to_vec();
    for (&r, &v) in order.iter().zip(&sorted_x) {
        // A kernel that only does what the weights could do too has nothing to go by.
        if h[r * size + r] > 0.0 {
            out[at(&free[r])] = v;
        }
    }
    out
}

dispatched! {
    fn sums(
        problem: &Problem,
        weights: &[f64],
        folded: &[f32],
        free: &[Free],
        n: usize,
        first: usize,
        last: usize,
    ) -> Sums = sums_with
}

/// Rows and columns of H that a support touches, rising, each channel's filled up to whole pieces.
struct Places {
    /// Places in H, or ABSENT.
    of: Vec<usize>,
    /// Where each channel's start.
    start: [usize; 4],
}

/// Rows of a piece of H, and its columns.
const TALL: usize = 4;
const WIDE: usize = 2 * FOUR;
/// No free kernel: filling.
const ABSENT: usize = usize::MAX;

fn places(free: &[Free], weights: &[f64]) -> Places {
    let mut out = Places {
        of: Vec::new(),
        start: [0; 4],
    };
    for channel in 0..3 {
        out.start[channel] = out.of.len();
        let blended = |f: &Free| f.channel == channel && weights[f.representative] > 0.0;
        out.of
            .extend((0..free.len()).filter(|&at| blended(&free[at])));
        out.of.resize(out.of.len().next_multiple_of(WIDE), ABSENT);
    }
    out.start[3] = out.of.len();
    out
}

/// Working space of a texel.
#[derive(Default)]
struct Scratch {
    /// J_x, one row a view: [views, channel's places], channel after channel.
    jacobian: [Vec<f64>; 3],
    /// Q_x' J_x [columns, places].
    seen: Vec<f64>,
    /// Q_x, column by column [3, views].
    basis: Vec<f64>,
    /// s_hat_x - B_x w_x [3, views].
    residual: Vec<f64>,
}

#[inline(always)]
fn sums_with<F: Four>(
    problem: &Problem,
    weights: &[f64],
    folded: &[f32],
    free: &[Free],
    n: usize,
    first: usize,
    last: usize,
) -> Sums {
    let size = free.len();
    let mut out = Sums {
        h: vec![0.0; size * size],
        g: vec![0.0; size],
    };
    let row = |x: usize| &weights[x * n..(x + 1) * n];
    // Texels of one support add to the same entries of H: those are summed apart, and placed once.
    let mut order: Vec<(u64, usize)> = (first..last)
        .map(|x| {
            (
                (0..n).fold(0, |s, i| s | u64::from(row(x)[i] > 0.0) << i),
                x,
            )
        })
        .collect();
    order.sort_unstable();
    let mut scratch = Scratch::default();
    let (mut h, mut g) = (Vec::new(), Vec::new());
    let mut from = 0;
    while from < order.len() {
        let mut to = from;
        while to < order.len() && order[to].0 == order[from].0 {
            to += 1;
        }
        let places = places(free, row(order[from].1));
        let width = places.of.len();
        h.clear();
        h.resize(width * width, 0.0);
        g.clear();
        g.resize(width, 0.0);
        for at in from..to {
            let x = order[at].1;
            add_texel::<F>(
                problem,
                folded,
                free,
                &places,
                x,
                row(x),
                &mut scratch,
                &mut h,
                &mut g,
            );
        }
        for r in 0..width {
            let place = places.of[r];
            if place == ABSENT {
                continue;
            }
            out.g[place] += g[r];
            let target = &mut out.h[place * size..(place + 1) * size];
            for s in 0..=r {
                if places.of[s] != ABSENT {
                    target[places.of[s]] += h[r * width + s];
                }
            }
        }
        from = to;
    }
    out
}

/// Add a texel's part to the lower triangle of `h` and to `g`, both by places.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // what the loops above would otherwise hold in one body
fn add_texel<F: Four>(
    problem: &Problem,
    folded: &[f32],
    free: &[Free],
    places: &Places,
    x: usize,
    w: &[f64],
    scratch: &mut Scratch,
    h: &mut [f64],
    g: &mut [f64],
) {
    let (a, views) = (
        problem.offsets[x],
        problem.offsets[x + 1] - problem.offsets[x],
    );
    let (gamma, width) = (problem.gamma[x], places.of.len());
    let columns = differences(
        problem,
        folded,
        x,
        w,
        &mut scratch.basis,
        &mut scratch.residual,
    );
    let Scratch {
        jacobian,
        seen,
        basis,
        residual,
    } = scratch;
    seen.clear();
    seen.resize(columns * width, 0.0);
    for c in 0..3 {
        let span = places.start[c]..places.start[c + 1];
        let wide = span.len();
        // sqrt(gamma) goes into J, so that H and U U' have it.
        let root = gamma.sqrt();
        jacobian[c].clear();
        jacobian[c].resize(views * wide, 0.0);
        for k in 0..wide {
            if places.of[span.start + k] != ABSENT {
                let f = &free[places.of[span.start + k]];
                let block = &problem.block(c, f.kernel / BLOCK)[a..a + views];
                let weight = root * w[f.representative];
                for v in 0..views {
                    jacobian[c][v * wide + k] = weight * f64::from(block[v][f.kernel % BLOCK]);
                }
            }
        }
        for v in 0..views {
            let row = &jacobian[c][v * wide..(v + 1) * wide];
            axpy::<F>(root * residual[c * views + v], row, &mut g[span.clone()]);
            for q in 0..columns {
                let along = basis[(q * 3 + c) * views + v];
                axpy::<F>(along, row, &mut seen[q * width..][span.clone()]);
            }
        }
    }
    for c in 0..3 {
        let span = places.start[c]..places.start[c + 1];
        for r in span.clone().step_by(TALL) {
            for s in (0..r + TALL).step_by(WIDE) {
                let mut sum = [[F::splat(0.0); 2]; TALL];
                if s >= span.start {
                    for v in 0..views {
                        let row = &jacobian[c][v * span.len()..(v + 1) * span.len()];
                        let right = [
                            F::load(&row[s - span.start..]),
                            F::load(&row[s - span.start + FOUR..]),
                        ];
                        for t in 0..TALL {
                            let left = F::splat(row[r - span.start + t]);
                            sum[t] = [left.fma(right[0], sum[t][0]), left.fma(right[1], sum[t][1])];
                        }
                    }
                }
                for q in 0..columns {
                    let row = &seen[q * width..(q + 1) * width];
                    let right = [F::load(&row[s..]), F::load(&row[s + FOUR..])];
                    for t in 0..TALL {
                        let left = F::splat(-row[r + t]);
                        sum[t] = [left.fma(right[0], sum[t][0]), left.fma(right[1], sum[t][1])];
                    }
                }
                for t in 0..TALL {
                    let target = &mut h[(r + t) * width + s..];
                    let one = F::splat(1.0);
                    let old = [F::load(target), F::load(&target[FOUR..])];
                    one.fma(sum[t][0], old[0]).store(target);
                    one.fma(sum[t][1], old[1]).store(&mut target[FOUR..]);
                }
            }
        }
    }
}

/// Inner product of columns of a texel.
#[inline(always)]
fn inner(a: &[f64], b: &[f64]) -> f64 {
    let mut sum = 0.0;
    for k in 0..a.len() {
        sum += a[k] * b[k];
    }
    sum
}

/// Q_x, column by column [3, views] in `basis`, and s_hat_x - B_x w_x in `residual` [3, views]; returns the
/// number of columns.
#[inline(always)]
fn differences(
    problem: &Problem,
    folded: &[f32],
    x: usize,
    w: &[f64],
    basis: &mut Vec<f64>,
    residual: &mut Vec<f64>,
) -> usize {
    let (a, b) = (problem.offsets[x], problem.offsets[x + 1]);
    let (n, views) = (w.len(), b - a);
    let response = |i: usize, c: usize, v: usize| f64::from(folded[((a + v) * n + i) * 3 + c]);
    residual.clear();
    for c in 0..3 {
        for v in 0..views {
            let mut rest = f64::from(problem.radiance[c][a + v]);
            for i in 0..n {
                if w[i] > 0.0 {
                    rest -= w[i] * response(i, c, v);
                }
            }
            residual.push(rest);
        }
    }
    basis.clear();
    let rows = 3 * views;
    let mut columns = 0;
    let mut first = n;
    for i in 0..n {
        if w[i] <= 0.0 {
            continue;
        }
        if first == n {
            first = i;
            continue;
        }
        for c in 0..3 {
            for v in 0..views {
                basis.push(response(i, c, v) - response(first, c, v));
            }
        }
        let (done, column) = basis.split_at_mut(columns * rows);
        let before = inner(column, column).sqrt();
        // Twice is enough (Kahan).
        for _ in 0..2 {
            for q in 0..columns {
                let other = &done[q * rows..(q + 1) * rows];
                let along = inner(column, other);
                for k in 0..rows {
                    column[k] -= along * other[k];
                }
            }
        }
        let left = inner(column, column).sqrt();
        if left > DEPENDENT * before {
            column.iter_mut().for_each(|v| *v /= left);
            columns += 1;
        } else {
            basis.truncate(columns * rows);
        }
    }
    columns
}
