// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Global optimum of the blend step (Eq. 12) over supports of at most n representatives, by branch
//! and bound.
//!
//! A node allows a set of representatives and forces some of them. Its bound is the simplex-constrained
//! optimum over the allowed set, without the bound on the support's size; if that optimum has at most n
//! non-zeros it is a solution, and at the root it is the global one. Otherwise the node branches on
//! the largest weight that is not forced yet: leave it out, or force it.

use super::hull::{Blend, Hull};

/// The best blend and how many relaxations it took.
pub struct Found {
    pub blend: Blend,
    pub visited: u32,
}

struct Search<'a> {
    hull: &'a mut Hull,
    most: u32,
    best: Blend,
    visited: u32,
}

/// `hint`: a support to try first (the texel's last choice), 0 for none.
pub fn best_blend(hull: &mut Hull, most: usize, hint: u64) -> Found {
    let all = if hull.size == 64 {
        u64::MAX
    } else {
        (1 << hull.size) - 1
    };
    let root = hull.relax(all);
    if root.support.count_ones() as usize <= most {
        return Found {
            blend: root,
            visited: 1,
        };
    }
    // Start from the better of the hint and the relaxation's n largest weights.
    let mut best = hull.relax(largest(&root.weights, most));
    let mut visited = 2;
    if hint != 0 && hint & all == hint && hint.count_ones() as usize <= most {
        let hinted = hull.relax(hint);
        visited += 1;
        if hinted.value < best.value {
            best = hinted;
        }
    }
    let mut search = Search {
        hull,
        most: most as u32,
        best,
        visited,
    };
    search.branch(all, 0, root);
    Found {
        blend: search.best,
        visited: search.visited,
    }
}

/// Mask of the `most` largest weights.
fn largest(weights: &[f64], most: usize) -> u64 {
    let mut order: Vec<usize> = (0..weights.len()).collect();
    order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]));
    order[..most.min(order.len())]
        .iter()
        .fold(0, |m, &i| m | 1 << i)
}

impl Search<'_> {
    /// A relaxed node that cannot beat the best by more than rounding is cut.
    fn hopeless(&self, value: f64) -> bool {
        value >= self.best.value * (1.0 - 1e-12)
    }

    fn branch(&mut self, allowed: u64, forced: u64, relaxed: Blend) {
        if self.hopeless(relaxed.value) {
            return;
        }
        if relaxed.support.count_ones() <= self.most {
            self.best = relaxed;
            return;
        }
        let free = relaxed.support & !forced;
        let Some(pick) = (0..self.hull.size)
            .filter(|&i| free >> i & 1 == 1)
            .max_by(|&a, &b| relaxed.weights[a].total_cmp(&relaxed.weights[b]))
        else {
            return;
        };
        // Forced: the relaxation stays what it is, until the support is full.
        let with = forced | 1 << pick;
        if with.count_ones() == self.most {
            let leaf = self.relax(with);
            if !self.hopeless(leaf.value) {
                self.best = leaf;
            }
        } else {
            self.branch(allowed, with, relaxed);
        }
        let without = allowed & !(1 << pick);
        let next = self.relax(without);
        self.branch(without, forced, next);
    }

    fn relax(&mut self, allowed: u64) -> Blend {
        self.visited += 1;
        self.hull.relax(allowed)
    }
}
