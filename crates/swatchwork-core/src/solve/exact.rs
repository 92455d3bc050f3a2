// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Global optimum of the blend step (Eq. 12) over supports of at most n representatives, by branch
//! and bound.
//!
//! A node allows a set of representatives and forces some of them. Its bound is the simplex-constrained
//! optimum over the allowed set, without the bound on the support's size; if that optimum has at most n
//! non-zeros it is a solution, and at the root it is the global one. Otherwise the node branches on
//! the largest weight that is not forced yet: force it, or leave it out. A child sets out from its
//! parent's optimum.

use super::hull::{Blend, Hull};
use super::simd::Four;

/// The best blend and how many relaxations it took.
pub struct Found {
    pub blend: Blend,
    pub visited: u32,
}

/// A node to look at: relaxed already, or to be relaxed from its parent's optimum.
pub struct Node {
    allowed: u64,
    forced: u64,
    blend: Blend,
    relaxed: bool,
}

/// `hint`: the texel's last choice, tried first; 0 for none. `stack` is working space.
#[inline(always)]
pub fn best_blend<F: Four>(
    hull: &mut Hull,
    most: usize,
    hint: &Blend,
    stack: &mut Vec<Node>,
) -> Found {
    let (all, most) = (hull.all(), most as u32);
    let root = hull.relax::<F>(all, hint);
    if root.support.count_ones() <= most {
        return Found {
            blend: root,
            visited: 1,
        };
    }
    // Start from the better of the hint and the relaxation's n largest weights.
    let mut best = hull.relax::<F>(largest(&root, most), &root);
    let mut visited = 2;
    if hint.support != 0 && hint.support.count_ones() <= most {
        let hinted = hull.relax::<F>(hint.support, hint);
        visited += 1;
        if hinted.value < best.value {
            best = hinted;
        }
    }
    stack.clear();
    stack.push(Node {
        allowed: all,
        forced: 0,
        blend: root,
        relaxed: true,
    });
    while let Some(mut node) = stack.pop() {
        // A bound that cannot beat the best by more than rounding cuts the node.
        let hopeless = |value: f64| value >= best.value * (1.0 - 1e-12);
        if hopeless(node.blend.value) {
            continue;
        }
        if !node.relaxed {
            node.blend = hull.relax::<F>(node.allowed, &node.blend);
            visited += 1;
            if hopeless(node.blend.value) {
                continue;
            }
        }
        if node.blend.support.count_ones() <= most {
            best = node.blend;
            continue;
        }
        let free = node.blend.support & !node.forced;
        if free == 0 {
            continue;
        }
        let pick = largest_bit(&node.blend.weights, free);
        let with = node.forced | pick;
        stack.push(Node {
            allowed: node.allowed & !pick,
            relaxed: false,
            ..node
        });
        // Forced: the relaxation stays what it is, until the support is full.
        if with.count_ones() == most {
            let leaf = hull.relax::<F>(with, &node.blend);
            visited += 1;
            if !hopeless(leaf.value) {
                best = leaf;
            }
        } else {
            stack.push(Node {
                forced: with,
                relaxed: true,
                ..node
            });
        }
    }
    Found {
        blend: best,
        visited,
    }
}

/// The bit of the largest weight of `free`.
#[inline(always)]
fn largest_bit(weights: &[f64], free: u64) -> u64 {
    let mut left = free;
    let (mut best, mut largest) = (0, f64::NEG_INFINITY);
    while left != 0 {
        let bit = left & left.wrapping_neg();
        left &= left - 1;
        let w = weights[bit.trailing_zeros() as usize];
        if w >= largest {
            (best, largest) = (bit, w);
        }
    }
    best
}

/// Mask of the `most` largest weights.
#[inline(always)]
fn largest(blend: &Blend, most: u32) -> u64 {
    let mut chosen = 0;
    for _ in 0..most {
        chosen |= largest_bit(&blend.weights, blend.support & !chosen);
    }
    chosen
}
