// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Non-negative least squares on a Gram matrix, by the active-set method of Lawson and Hanson (1974)
//! in the normal-equation form of Bro and de Jong (1997):
//!
//!   minimise  1/2 x' H x - b' x   subject to  x >= 0,       H = X'X, b = X's.
//!
//! The passive set keeps an ordered Cholesky factor: a new variable appends a row, a removal
//! refactors only the rows behind it. Variables that depend linearly on the passive set are refused.

/// A pivot below this share of its diagonal counts as linear dependence.
const DEPENDENT: f64 = 1e-13;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    Converged,
    IterationLimit,
}

/// Buffers that survive from one problem to the next.
#[derive(Default)]
pub struct Workspace {
    passive: Vec<usize>,
    factor: Vec<f64>,
    z: Vec<f64>,
    slope: Vec<f64>,
    state: Vec<u8>,
}

const ACTIVE: u8 = 0;
const PASSIVE: u8 = 1;
/// Left out of the problem, or refused since the last step as dependent.
const BARRED: u8 = 2;
const REFUSED: u8 = 3;

impl Workspace {
    /// Minimise over the variables for which `allowed` holds, starting from `x` (feasible; zeros are
    /// a cold start). `tolerance` bounds slope_j / sqrt(H_jj) at the end: since adding j alone gains at
    /// most half its square, the objective is then within reach of the optimum to that order.
    pub fn solve(
        &mut self,
        h: &[f64],
        b: &[f64],
        allowed: impl Fn(usize) -> bool,
        x: &mut [f64],
        tolerance: f64,
    ) -> Status {
        let n = b.len();
        self.state.clear();
        self.passive.clear();
        self.factor.clear();
        for j in 0..n {
            let open = allowed(j) && h[j * n + j] > 0.0;
            self.state.push(if open { ACTIVE } else { BARRED });
            if open && x[j] > 0.0 {
                if self.append(h, n, j) {
                    self.state[j] = PASSIVE;
                } else {
                    x[j] = 0.0;
                }
            } else {
                x[j] = 0.0;
            }
        }
        if !self.passive.is_empty() {
            self.descend(h, b, n, x);
        }
        for _ in 0..10 * n + 20 {
            let Some(j) = self.steepest(h, b, n, x, tolerance) else {
                return Status::Converged;
            };
            if !self.append(h, n, j) {
                self.state[j] = REFUSED;
                continue;
            }
            self.state[j] = PASSIVE;
            if self.descend(h, b, n, x) && x[j] > 0.0 {
                self.state.iter_mut().for_each(|s| {
                    if *s == REFUSED {
                        *s = ACTIVE;
                    }
                });
            } else if x[j] <= 0.0 {
                self.remove(h, n, j);
                self.state[j] = REFUSED;
            }
        }
        Status::IterationLimit
    }

    /// The active variable whose increase lowers the objective most steeply, if any does.
    fn steepest(
        &mut self,
        h: &[f64],
        b: &[f64],
        n: usize,
        x: &[f64],
        tolerance: f64,
    ) -> Option<usize> {
        self.slope.clear();
        self.slope.extend_from_slice(b);
        for &p in &self.passive {
            let (row, xp) = (&h[p * n..(p + 1) * n], x[p]);
            for (s, &hp) in self.slope.iter_mut().zip(row) {
                *s -= hp * xp;
            }
        }
        let mut best = None;
        let mut steepest = tolerance;
        for j in 0..n {
            if self.state[j] == ACTIVE {
                let s = self.slope[j] / h[j * n + j].sqrt();
                if s > steepest {
                    steepest = s;
                    best = Some(j);
                }
            }
        }
        best
    }

    /// Lawson and Hanson's inner loop: solve on the passive set, step back to the boundary and drop
    /// what reached it, until the solution is positive. Returns whether all the passive set is kept.
    fn descend(&mut self, h: &[f64], b: &[f64], n: usize, x: &mut [f64]) -> bool {
        let mut kept = true;
        loop {
            self.solve_passive(b);
            let mut alpha = 1.0;
            for (&p, &z) in self.passive.iter().zip(&self.z) {
                if z <= 0.0 {
                    alpha = f64::min(alpha, x[p] / (x[p] - z));
                }
            }
            if self.z.iter().all(|&z| z > 0.0) {
                for (&p, &z) in self.passive.iter().zip(&self.z) {
                    x[p] = z;
                }
                return kept;
            }
            kept = false;
            let mut first = self.passive.len();
            for (q, (&p, &z)) in self.passive.iter().zip(&self.z).enumerate() {
                x[p] += alpha * (z - x[p]);
                if z <= 0.0 && x[p] <= 1e-15 * z.abs() {
                    x[p] = 0.0;
                    first = first.min(q);
                }
            }
            if first == self.passive.len() {
                // Rounding kept everything above zero: drop the one that limited the step.
                let (q, _) = self
                    .passive
                    .iter()
                    .enumerate()
                    .filter(|&(q, _)| self.z[q] <= 0.0)
                    .min_by(|a, b| x[*a.1].total_cmp(&x[*b.1]))
                    .expect("some z is not positive");
                x[self.passive[q]] = 0.0;
                first = q;
            }
            self.rebuild(h, n, first, |j| x[j] > 0.0);
            if self.passive.is_empty() {
                return false;
            }
        }
    }

    /// Drop one variable.
    fn remove(&mut self, h: &[f64], n: usize, j: usize) {
        if let Some(q) = self.passive.iter().position(|&p| p == j) {
            self.rebuild(h, n, q, |p| p != j);
        }
    }

    /// Refactor from position `first`, keeping the variables for which `keep` holds.
    fn rebuild(&mut self, h: &[f64], n: usize, first: usize, keep: impl Fn(usize) -> bool) {
        let tail: Vec<usize> = self.passive.drain(first..).collect();
        self.factor.truncate(first * (first + 1) / 2);
        for j in tail {
            if keep(j) && self.append(h, n, j) {
                continue;
            }
            self.state[j] = ACTIVE;
        }
    }

    /// Append a row to the packed Cholesky factor; false, and nothing done, if j depends on the rest.
    fn append(&mut self, h: &[f64], n: usize, j: usize) -> bool {
        let p = self.passive.len();
        let start = self.factor.len();
        let mut rest = h[j * n + j];
        for r in 0..p {
            let head = r * (r + 1) / 2;
            let mut v = h[j * n + self.passive[r]];
            for c in 0..r {
                v -= self.factor[head + c] * self.factor[start + c];
            }
            v /= self.factor[head + r];
            self.factor.push(v);
            rest -= v * v;
        }
        if rest <= DEPENDENT * h[j * n + j] {
            self.factor.truncate(start);
            return false;
        }
        self.factor.push(rest.sqrt());
        self.passive.push(j);
        true
    }

    /// z = H_PP^-1 b_P.
    fn solve_passive(&mut self, b: &[f64]) {
        let p = self.passive.len();
        self.z.clear();
        for r in 0..p {
            let head = r * (r + 1) / 2;
            let mut v = b[self.passive[r]];
            for c in 0..r {
                v -= self.factor[head + c] * self.z[c];
            }
            self.z.push(v / self.factor[head + r]);
        }
        for r in (0..p).rev() {
            let v = self.z[r] / self.factor[r * (r + 1) / 2 + r];
            self.z[r] = v;
            for c in 0..r {
                self.z[c] -= self.factor[r * (r + 1) / 2 + c] * v;
            }
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
            let status = workspace.solve(&h, &b, |_| true, &mut x, 1e-10);
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

    #[test]
    fn leaves_out_what_is_not_allowed() {
        let (h, b) = (vec![1.0, 0.0, 0.0, 1.0], vec![1.0, 1.0]);
        let mut x = vec![0.0; 2];
        Workspace::default().solve(&h, &b, |j| j == 1, &mut x, 1e-12);
        assert_eq!(x, [0.0, 1.0]);
    }
}
