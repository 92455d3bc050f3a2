// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The blend step over many texels (Eq. 12), each independent of the others.

use super::enumerate::{best_of, brute_force};
use super::exact::best_blend;
use super::hull::Hull;
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

/// Texels that one task takes on.
const BLOCK: usize = 64;

impl Texels<'_> {
    fn hull(&self, x: usize, hull: &mut Hull) {
        let (a, b) = (self.offsets[x], self.offsets[x + 1]);
        let row = 3 * self.representatives;
        hull.set(
            &self.responses[a * row..b * row],
            &self.radiance[3 * a..3 * b],
            self.representatives,
        );
    }

    fn count(&self) -> usize {
        self.offsets.len() - 1
    }
}

/// Best blends of at most `most` representatives. `previous` [M, N] (empty: none) are the last weights,
/// tried first. A texel without views gets all its weight on the first representative, and error 0.
pub fn blend(texels: &Texels, most: usize, search: Search, previous: &[f64]) -> Blended {
    let n = texels.representatives;
    let most = most.min(n);
    let supports = match search {
        Search::Pruned {
            sample,
            cover,
            seed,
        } => frequent_supports(texels, most, sample, cover, seed),
        _ => Vec::new(),
    };
    let mut weights = vec![0.0; texels.count() * n];
    let mut error = vec![0.0; texels.count()];
    let visited: Vec<u64> = weights
        .par_chunks_mut(BLOCK * n)
        .zip(error.par_chunks_mut(BLOCK))
        .enumerate()
        .map_init(Hull::default, |hull, (block, (weights, error))| {
            let mut visited = 0;
            for (q, (w, e)) in weights.chunks_mut(n).zip(error).enumerate() {
                let x = block * BLOCK + q;
                texels.hull(x, hull);
                let hint = support_of(previous.get(x * n..(x + 1) * n).unwrap_or(&[]));
                let (found, count) = match search {
                    Search::Exact => {
                        let found = best_blend(hull, most, hint);
                        (found.blend, found.visited)
                    }
                    Search::Brute => brute_force(hull, most),
                    Search::Pruned { .. } => {
                        let mut list = supports.clone();
                        if hint != 0 && hint.count_ones() as usize <= most && !list.contains(&hint)
                        {
                            list.push(hint);
                        }
                        best_of(hull, &list)
                    }
                };
                w.copy_from_slice(&found.weights);
                *e = found.value;
                visited += count as u64;
            }
            visited
        })
        .collect();
    Blended {
        weights,
        error,
        visited: visited.iter().sum(),
    }
}

fn support_of(weights: &[f64]) -> u64 {
    weights
        .iter()
        .enumerate()
        .filter(|(_, w)| **w > 0.0)
        .fold(0, |m, (i, _)| m | 1 << i)
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
        .map_init(Hull::default, |hull, &x| {
            texels.hull(x, hull);
            brute_force(hull, most).0.support
        })
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
