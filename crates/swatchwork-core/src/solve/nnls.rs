// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Non-negative least squares on a Gram matrix, by the active-set method of Lawson and Hanson (1974)
//! in the normal-equation form of Bro and de Jong (1997):
//!
//!   minimise  1/2 x' H x - b' x   subject to  x >= 0,       H = X'X, b = X's.
//!
//! The passive set keeps an ordered Cholesky factor: a new variable appends a row, a removal
//! refactors only the rows behind it. Variables that depend linearly on the passive set are refused.
//! Where the variables fall into blocks that hardly know of one another, one of each block enters at a
//! time; of those that enter together at least one stays, so that the objective still falls at every step.

// Indices where iterators would do: those are not inlined into functions of other target features.
#![allow(clippy::needless_range_loop)]

use super::simd::{Four, axpy, dispatched, dot};

/// A pivot below this share of its diagonal counts as linear dependence.
const DEPENDENT: f64 = 1e-13;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    Converged,
    IterationLimit,
}

/// H, b, and the number of variables in a block.
#[derive(Clone, Copy)]
pub struct Quadratic<'a> {
    pub h: &'a [f64],
    pub b: &'a [f64],
    pub block: usize,
}

/// Buffers that survive from one problem to the next.
#[derive(Default)]
pub struct Workspace {
    passive: Vec<usize>,
    /// Lower triangle of the Cholesky factor, rows packed.
    factor: Vec<f64>,
    /// 1 / pivot.
    inverse: Vec<f64>,
    /// L^-1 b.
    forward: Vec<f64>,
    z: Vec<f64>,
    slope: Vec<f64>,
    state: Vec<u8>,
    entering: Vec<usize>,
}

const ACTIVE: u8 = 0;
const PASSIVE: u8 = 1;
/// Without a response of its own.
const BARRED: u8 = 2;
/// Refused since the last step as dependent.
const REFUSED: u8 = 3;

impl Workspace {
    /// Minimise from `x` (feasible; zeros are a cold start). `tolerance` bounds slope_j / sqrt(H_jj) at the
    /// end: since adding j alone gains at most half its square, the objective is then within reach of the
    /// optimum to that order.
    pub fn solve(&mut self, problem: &Quadratic, x: &mut [f64], tolerance: f64) -> Status {
        solve(self, problem, x, tolerance)
    }
}

dispatched! {
    fn solve(w: &mut Workspace, problem: &Quadratic, x: &mut [f64], tolerance: f64) -> Status = solve_with
}

#[inline(always)]
fn solve_with<F: Four>(
    w: &mut Workspace,
    problem: &Quadratic,
    x: &mut [f64],
    tolerance: f64,
) -> Status {
    let Quadratic { h, b, block } = *problem;
    let n = b.len();
    w.state.clear();
    w.truncate(0);
    for j in 0..n {
        w.state
            .push(if h[j * n + j] > 0.0 { ACTIVE } else { BARRED });
        if w.state[j] == ACTIVE && x[j] > 0.0 && w.append::<F>(h, b, j) {
            w.state[j] = PASSIVE;
        } else {
            x[j] = 0.0;
        }
    }
    if !w.passive.is_empty() {
        w.descend::<F>(h, b, x);
    }
    let mut together = block < n;
    for _ in 0..10 * n + 20 {
        w.choose::<F>(problem, x, tolerance, together);
        if w.entering.is_empty() {
            return Status::Converged;
        }
        let mut entered = false;
        for q in 0..w.entering.len() {
            let j = w.entering[q];
            let independent = w.append::<F>(h, b, j);
            w.state[j] = if independent { PASSIVE } else { REFUSED };
            entered |= independent;
        }
        if !entered {
            continue;
        }
        w.descend::<F>(h, b, x);
        let stayed = w.entering.iter().any(|&j| x[j] > 0.0);
        if stayed {
            for s in &mut w.state {
                if *s == REFUSED {
                    *s = ACTIVE;
                }
            }
        } else if !together {
            // Rounding: its slope said otherwise.
            w.state[w.entering[0]] = REFUSED;
        }
        together = stayed && block < n;
    }
    Status::IterationLimit
}

impl Workspace {
    /// Keep the first rows of the factor only.
    #[inline(always)]
    fn truncate(&mut self, rows: usize) {
        self.passive.truncate(rows);
        self.inverse.truncate(rows);
        self.forward.truncate(rows);
        self.factor.truncate(rows * (rows + 1) / 2);
    }

    /// The active variables whose increase lowers the objective most steeply: of all, or of each block.
    #[inline(always)]
    fn choose<F: Four>(&mut self, problem: &Quadratic, x: &[f64], tolerance: f64, together: bool) {
        let Quadratic { h, b, block } = *problem;
        let n = b.len();
        self.slope.clear();
        self.slope.extend_from_slice(b);
        for q in 0..self.passive.len() {
            let p = self.passive[q];
            axpy::<F>(-x[p], &h[p * n..(p + 1) * n], &mut self.slope);
        }
        self.entering.clear();
        let mut first = 0;
        while first < n {
            let last = if together { n.min(first + block) } else { n };
            let (mut best, mut steepest) = (n, tolerance);
            for j in first..last {
                if self.state[j] == ACTIVE {
                    let s = self.slope[j] / h[j * n + j].sqrt();
                    if s > steepest {
                        (best, steepest) = (j, s);
                    }
                }
            }
            if best < n {
                self.entering.push(best);
            }
            first = last;
        }
    }

    /// Lawson and Hanson's inner loop: solve on the passive set, step back to the boundary and drop
    /// what reached it, until the solution is positive.
    #[inline(always)]
    fn descend<F: Four>(&mut self, h: &[f64], b: &[f64], x: &mut [f64]) {
        loop {
            self.solve_passive::<F>();
            let (mut alpha, mut positive) = (1.0, true);
            for q in 0..self.passive.len() {
                let (p, z) = (self.passive[q], self.z[q]);
                if z <= 0.0 {
                    positive = false;
                    // x = z = 0 stands on the boundary already.
                    alpha = f64::min(alpha, if x[p] > 0.0 { x[p] / (x[p] - z) } else { 0.0 });
                }
            }
            if positive {
                for q in 0..self.passive.len() {
                    x[self.passive[q]] = self.z[q];
                }
                return;
            }
            let mut first = self.passive.len();
            for q in 0..self.passive.len() {
                let (p, z) = (self.passive[q], self.z[q]);
                x[p] += alpha * (z - x[p]);
                if z <= 0.0 && x[p] <= 1e-15 * z.abs() {
                    x[p] = 0.0;
                    self.state[p] = ACTIVE;
                    first = first.min(q);
                }
            }
            self.refactor::<F>(h, b, x, first);
        }
    }

    /// Drop the variables that are no longer passive, from place `first` on, and factor those behind anew.
    #[inline(always)]
    fn refactor<F: Four>(&mut self, h: &[f64], b: &[f64], x: &mut [f64], first: usize) {
        let tail = self.passive[first..].to_vec();
        self.truncate(first);
        for j in tail {
            if self.state[j] != PASSIVE || !self.append::<F>(h, b, j) {
                x[j] = 0.0;
                self.state[j] = ACTIVE;
            }
        }
    }

    /// Append a row to the packed Cholesky factor; false, and nothing done, if j depends on the rest.
    #[inline(always)]
    fn append<F: Four>(&mut self, h: &[f64], b: &[f64], j: usize) -> bool {
        let (n, p) = (b.len(), self.passive.len());
        let column = &h[j * n..(j + 1) * n];
        let start = self.factor.len();
        self.factor.resize(start + p + 1, 0.0);
        let (above, row) = self.factor.split_at_mut(start);
        let mut head = 0;
        for r in 0..p {
            let v = column[self.passive[r]] - dot::<F>(&above[head..head + r], &row[..r]);
            row[r] = v * self.inverse[r];
            head += r + 1;
        }
        let rest = column[j] - dot::<F>(&row[..p], &row[..p]);
        if rest <= DEPENDENT * column[j] {
            self.factor.truncate(start);
            return false;
        }
        let pivot = rest.sqrt();
        let forward = (b[j] - dot::<F>(&row[..p], &self.forward)) / pivot;
        row[p] = pivot;
        self.forward.push(forward);
        self.inverse.push(1.0 / pivot);
        self.passive.push(j);
        true
    }

    /// z = H_PP^-1 b_P.
    #[inline(always)]
    fn solve_passive<F: Four>(&mut self) {
        let p = self.passive.len();
        self.z.clear();
        self.z.extend_from_slice(&self.forward);
        for r in (0..p).rev() {
            let head = r * (r + 1) / 2;
            let v = self.z[r] * self.inverse[r];
            self.z[r] = v;
            axpy::<F>(-v, &self.factor[head..head + r], &mut self.z[..r]);
        }
    }
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

    /// H = X'X and b = X's of a random problem; `twins` repeats columns.
    fn problem(rows: usize, n: usize, twins: bool, seed: &mut u64) -> (Vec<f64>, Vec<f64>) {
        let mut x: Vec<f64> = (0..rows * n).map(|_| lcg(seed) - 0.3).collect();
        if twins {
            for r in 0..rows {
                x[r * n + n - 1] = x[r * n];
            }
        }
        let s: Vec<f64> = (0..rows).map(|_| lcg(seed)).collect();
        let mut h = vec![0.0; n * n];
        let mut b = vec![0.0; n];
        for r in 0..rows {
            for i in 0..n {
                b[i] += x[r * n + i] * s[r];
                for j in 0..n {
                    h[i * n + j] += x[r * n + i] * x[r * n + j];
                }
            }
        }
        (h, b)
    }

    #[test]
    fn satisfies_the_optimality_conditions_of_random_degenerate_and_warm_problems() {
        let mut seed = 7;
        let mut workspace = Workspace::default();
        for trial in 0..500 {
            let n = 1 + trial % 12;
            let (h, b) = problem(3 + trial % 9, n, n > 1 && trial % 3 == 0, &mut seed);
            let mut x: Vec<f64> = (0..n)
                .map(|_| if trial % 2 == 0 { 0.0 } else { lcg(&mut seed) })
                .collect();
            let block = 1 + trial % 5;
            let problem = Quadratic {
                h: &h,
                b: &b,
                block,
            };
            let status = workspace.solve(&problem, &mut x, 1e-10);
            assert_eq!(status, Status::Converged);
            for j in 0..n {
                let slope = b[j] - (0..n).map(|i| h[j * n + i] * x[i]).sum::<f64>();
                assert!(x[j] >= 0.0);
                // Rounding of a Gram matrix with unit-size entries.
                assert!(slope <= 1e-7, "slope {slope} at {j} in trial {trial}");
                assert!(x[j] == 0.0 || slope.abs() <= 1e-7);
            }
        }
    }
}
