// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The blend step over many texels (Eq. 12), each independent of the others.

// Indices where iterators would do: those are not inlined into functions of other target features.
#![allow(clippy::needless_range_loop)]

use super::enumerate::{best_of, brute_force};
use super::exact::{Node, best_blend};
use super::hull::{Blend, Hull};
use super::simd::{Four, dispatched};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// How supports are searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Search {
    /// Branch and bound: brute force's answer, certified.
    Exact,
    /// Every support of at most n.
    Brute,
    /// Section 6: the supports that cover `cover` of the texels of a sample of `sample`, found by brute
    /// force, and the texel's previous choice.
    Pruned { sample: f64, cover: f64, seed: u64 },
}

/// Responses [P, N, 3] of the representatives and measurements [P, 3] at texels' pairs.
pub struct Texels<'a> {
    pub responses: &'a [f32],
    pub radiance: &'a [f32],
    pub offsets: &'a [usize],
    pub representatives: usize,
}

/// Weights, dense [M, N]; ||s_hat_x - s_x||^2 [M]; supports (relaxations) visited in all.
pub struct Blended {
    pub weights: Vec<f64>,
    pub error: Vec<f64>,
    pub visited: u64,
}

/// Index and weight [M, n], the errors [M], and the supports visited in all.
pub struct Slots {
    pub index: Vec<u32>,
    pub weight: Vec<f32>,
    pub error: Vec<f64>,
    pub visited: u64,
}

/// Texels that one task takes on.
const BLOCK: usize = 64;

impl Texels<'_> {
    #[inline(always)]
    fn hull<F: Four>(&self, x: usize, hull: &mut Hull) {
        let (a, b) = (self.offsets[x], self.offsets[x + 1]);
        let row = 3 * self.representatives;
        hull.set::<F>(
            &self.responses[a * row..b * row],
            &self.radiance[3 * a..3 * b],
            self.representatives,
        );
    }

    fn count(&self) -> usize {
        self.offsets.len() - 1
    }
}

/// What a blend of many texels is asked for.
struct Job<'a> {
    texels: &'a Texels<'a>,
    most: usize,
    search: Search,
    previous: &'a [f64],
    supports: Vec<u64>,
}

/// Working space of a task.
#[derive(Default)]
struct Scratch {
    hull: Hull,
    stack: Vec<Node>,
}

/// Best blends of at most `most` representatives. `previous` [M, N] (empty: none) are the last weights,
/// tried first. A texel without views gets all its weight on the first representative, and error 0.
pub fn blend(texels: &Texels, most: usize, search: Search, previous: &[f64]) -> Blended {
    let n = texels.representatives;
    let most = most.min(n);
    let mut weights = vec![0.0; texels.count() * n];
    let job = Job::new(texels, most, search, previous);
    let mut error = vec![0.0; texels.count()];
    let visited = weights
        .par_chunks_mut(BLOCK * n)
        .zip(error.par_chunks_mut(BLOCK))
        .enumerate()
        .map_init(Scratch::default, |scratch, (block, (weights, error))| {
            dense_block(&job, block * BLOCK, scratch, weights, error)
        })
        .sum();
    Blended {
        weights,
        error,
        visited,
    }
}

/// The same as n slots a texel, the largest weight first; an unused slot has weight 0 and the index of
/// the first.
pub fn blend_slots(texels: &Texels, most: usize, search: Search) -> Slots {
    let job = Job::new(texels, most.min(texels.representatives), search, &[]);
    let mut index = vec![0; texels.count() * most];
    let mut weight = vec![0.0; texels.count() * most];
    let mut error = vec![0.0; texels.count()];
    let visited = index
        .par_chunks_mut(BLOCK * most)
        .zip(weight.par_chunks_mut(BLOCK * most))
        .zip(error.par_chunks_mut(BLOCK))
        .enumerate()
        .map_init(
            Scratch::default,
            |scratch, (block, ((index, weight), error))| {
                slots_block(&job, block * BLOCK, scratch, index, weight, error)
            },
        )
        .sum();
    Slots {
        index,
        weight,
        error,
        visited,
    }
}

dispatched! {
    fn dense_block(job: &Job, first: usize, scratch: &mut Scratch, weights: &mut [f64], error: &mut [f64]) -> u64 = dense_block_with
}

#[inline(always)]
fn dense_block_with<F: Four>(
    job: &Job,
    first: usize,
    scratch: &mut Scratch,
    weights: &mut [f64],
    error: &mut [f64],
) -> u64 {
    let n = job.texels.representatives;
    let mut visited = 0;
    for q in 0..error.len() {
        let (found, count) = job.texel::<F>(first + q, scratch);
        weights[q * n..(q + 1) * n].copy_from_slice(&found.weights[..n]);
        error[q] = found.value;
        visited += u64::from(count);
    }
    visited
}

dispatched! {
    fn slots_block(job: &Job, first: usize, scratch: &mut Scratch, index: &mut [u32], weight: &mut [f32], error: &mut [f64]) -> u64 = slots_block_with
}

#[inline(always)]
fn slots_block_with<F: Four>(
    job: &Job,
    first: usize,
    scratch: &mut Scratch,
    index: &mut [u32],
    weight: &mut [f32],
    error: &mut [f64],
) -> u64 {
    let slots = index.len() / error.len();
    let mut visited = 0;
    for q in 0..error.len() {
        let (found, count) = job.texel::<F>(first + q, scratch);
        fill_slots(
            &found,
            &mut index[q * slots..(q + 1) * slots],
            &mut weight[q * slots..(q + 1) * slots],
        );
        error[q] = found.value;
        visited += u64::from(count);
    }
    visited
}

/// Insertion sort: few weights, the largest first, the lower index first among equals.
fn fill_slots(blend: &Blend, index: &mut [u32], weight: &mut [f32]) {
    let mut used = 0;
    let mut sorted = [(0.0, 0u32); super::hull::MOST];
    for i in (0..super::hull::MOST).filter(|i| blend.support >> i & 1 == 1) {
        let mut at = used;
        while at > 0 && sorted[at - 1].0 < blend.weights[i] {
            sorted[at] = sorted[at - 1];
            at -= 1;
        }
        sorted[at] = (blend.weights[i], i as u32);
        used += 1;
    }
    for k in 0..index.len() {
        let (w, i) = if k < used {
            sorted[k]
        } else {
            (0.0, sorted[0].1)
        };
        weight[k] = w as f32;
        index[k] = i;
    }
}

impl<'a> Job<'a> {
    fn new(texels: &'a Texels<'a>, most: usize, search: Search, previous: &'a [f64]) -> Self {
        let supports = match search {
            Search::Pruned {
                sample,
                cover,
                seed,
            } => frequent_supports(texels, most, sample, cover, seed),
            _ => Vec::new(),
        };
        Job {
            texels,
            most,
            search,
            previous,
            supports,
        }
    }

    /// The best blend of one texel, and the supports looked at.
    #[inline(always)]
    fn texel<F: Four>(&self, x: usize, scratch: &mut Scratch) -> (Blend, u32) {
        let Scratch { hull, stack } = scratch;
        let n = self.texels.representatives;
        self.texels.hull::<F>(x, hull);
        let hint = hint_of(
            self.previous.get(x * n..(x + 1) * n).unwrap_or(&[]),
            hull.kappa,
        );
        match self.search {
            Search::Exact => {
                let found = best_blend::<F>(hull, self.most, &hint, stack);
                (found.blend, found.visited)
            }
            Search::Brute => brute_force(hull, self.most),
            Search::Pruned { .. } => {
                let mut list = self.supports.clone();
                let small = (1..=self.most as u32).contains(&hint.support.count_ones());
                if small && !list.contains(&hint.support) {
                    list.push(hint.support);
                }
                best_of::<F>(hull, &list)
            }
        }
    }
}

/// The last weights as a blend to set out from; its scale is that of a value near zero.
fn hint_of(weights: &[f64], kappa: f64) -> Blend {
    let mut hint = Blend {
        total: 1.0 / kappa,
        ..Blend::NONE
    };
    for (i, &w) in weights.iter().enumerate() {
        if w > 0.0 {
            hint.support |= 1 << i;
            hint.weights[i] = w;
        }
    }
    hint
}

dispatched! {
    fn brute_texel(texels: &Texels, most: usize, x: usize, hull: &mut Hull) -> u64 = brute_texel_with
}

#[inline(always)]
fn brute_texel_with<F: Four>(texels: &Texels, most: usize, x: usize, hull: &mut Hull) -> u64 {
    texels.hull::<F>(x, hull);
    brute_force(hull, most).0.support
}

/// Supports found by brute force at a random share of the texels, the rarest dropped while the rest
/// cover `cover` of that sample (section 6).
fn frequent_supports(texels: &Texels, most: usize, sample: f64, cover: f64, seed: u64) -> Vec<u64> {
    let mut state = seed ^ 0x9e37_79b9_7f4a_7c15;
    let mut chosen: Vec<usize> = (0..texels.count())
        .filter(|_| {
            // splitmix64
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 <= sample
        })
        .collect();
    if chosen.is_empty() {
        chosen.push(0);
    }
    let found: Vec<u64> = chosen
        .par_iter()
        .map_init(Hull::default, |hull, &x| brute_texel(texels, most, x, hull))
        .collect();
    let mut counts = BTreeMap::new();
    for support in &found {
        *counts.entry(*support).or_insert(0usize) += 1;
    }
    let mut order: Vec<(u64, usize)> = counts.into_iter().collect();
    order.sort_by_key(|&(support, count)| (std::cmp::Reverse(count), support));
    let enough = (cover * found.len() as f64).ceil() as usize;
    let mut covered = 0;
    order
        .into_iter()
        .take_while(|&(_, count)| {
            let more = covered < enough;
            covered += count;
            more
        })
        .map(|(support, _)| support)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lcg(seed: &mut u64) -> f64 {
        *seed = seed
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (*seed >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Few views and many representatives, some of them twins: all the degeneracies at once.
    #[test]
    fn exact_search_equals_brute_force() {
        let mut seed = 3;
        for trial in 0..300 {
            let (n, k, m) = (1 + trial % 12, 1 + trial % 4, 8);
            let offsets: Vec<usize> = (0..=m).map(|x| x * k).collect();
            let mut responses: Vec<f32> =
                (0..m * k * n * 3).map(|_| lcg(&mut seed) as f32).collect();
            if trial % 5 == 0 && n > 1 {
                for row in responses.chunks_mut(3 * n) {
                    row.copy_within(0..3, 3 * (n - 1));
                }
            }
            let radiance: Vec<f32> = (0..m * k * 3).map(|_| lcg(&mut seed) as f32).collect();
            let texels = Texels {
                responses: &responses,
                radiance: &radiance,
                offsets: &offsets,
                representatives: n,
            };
            for most in 1..=5 {
                let exact = blend(&texels, most, Search::Exact, &[]);
                let brute = blend(&texels, most, Search::Brute, &[]);
                for x in 0..m {
                    let (a, b) = (exact.error[x], brute.error[x]);
                    // Both are sums of a few squares of order one.
                    assert!(
                        (a - b).abs() <= 1e-10 * (1e-3 + b),
                        "trial {trial} n {most}: {a} {b}"
                    );
                    let w = &exact.weights[x * n..(x + 1) * n];
                    assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                    assert!(w.iter().all(|&v| v >= 0.0));
                    assert!(w.iter().filter(|&&v| v > 0.0).count() <= most);
                }
            }
        }
    }
}
