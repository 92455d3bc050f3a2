// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The blend step at one texel (Eq. 12) as a point nearest to the origin.
//!
//! Since the weights sum to one, s_hat - sum_i w_i s_i = -sum_i w_i d_i with d_i = s_i - s_hat: the
//! best blend is the point of the convex hull of the d_i nearest to the origin. With the Gram matrix
//! lifted by a constant, G = D'D + kappa 11', which adds kappa to every feasible objective, linear
//! independence of columns becomes affine independence of the points, and over a support S
//!
//!   min w'Gw, sum w = 1    is    w = y / sum(y),  G_SS y = 1,  value 1 / sum(y) - kappa;
//!
//! over all of the simplex it is the same with y >= 0: a non-negative least-squares problem with the
//! right-hand side 1, solved by the active set method of `nnls.rs` on arrays of fixed size. A support
//! whose points are affinely dependent reaches its optimum on a smaller one (Caratheodory), so it never
//! has to be solved.

// Indices where iterators would do: those are not inlined into functions of other target features.
#![allow(clippy::needless_range_loop)]

use super::simd::{FOUR, Four};

/// Most representatives a blend can choose from: supports are bit masks.
pub const MOST: usize = 64;
/// A pivot below this share of its diagonal counts as affine dependence.
const DEPENDENT: f64 = 1e-13;

/// The lifted Gram matrix of one texel and the buffers to solve on it.
pub struct Hull {
    pub size: usize,
    /// Numbers a row of G takes, a multiple of four; those beyond `size` mean nothing.
    pub stride: usize,
    /// G, row-major [N, stride].
    pub gram: Vec<f64>,
    pub kappa: f64,
    /// 1 / sqrt(G_jj).
    scale: [f64; MOST],
    difference: Vec<f64>,
    face: Face,
}

/// A blend: its support, its weights (zero outside) and ||s_hat - s||^2.
#[derive(Clone, Copy, Debug)]
pub struct Blend {
    pub support: u64,
    pub weights: [f64; MOST],
    /// Sum of y.
    pub total: f64,
    pub value: f64,
}

impl Blend {
    /// Worse than any.
    pub const NONE: Self = Blend {
        support: 0,
        weights: [0.0; MOST],
        total: 0.0,
        value: f64::INFINITY,
    };
}

/// The passive set, with the packed Cholesky factor of its part of G.
struct Face {
    order: [usize; MOST],
    count: usize,
    factor: [f64; MOST * (MOST + 1) / 2],
    /// 1 / pivot.
    inverse: [f64; MOST],
    /// L^-1 1.
    forward: [f64; MOST],
    y: [f64; MOST],
    z: [f64; MOST],
}

impl Default for Hull {
    fn default() -> Self {
        Hull {
            size: 0,
            stride: 0,
            gram: Vec::new(),
            kappa: 0.0,
            scale: [0.0; MOST],
            difference: Vec::new(),
            face: Face {
                order: [0; MOST],
                count: 0,
                factor: [0.0; MOST * (MOST + 1) / 2],
                inverse: [0.0; MOST],
                forward: [0.0; MOST],
                y: [0.0; MOST],
                z: [0.0; MOST],
            },
        }
    }
}

impl Hull {
    /// All representatives.
    pub fn all(&self) -> u64 {
        u64::MAX >> (MOST - self.size)
    }

    /// `responses` [K', N, 3] of the representatives at the texel's K' views, `radiance` [K', 3].
    #[inline(always)]
    pub fn set<F: Four>(&mut self, responses: &[f32], radiance: &[f32], size: usize) {
        assert!((1..=MOST).contains(&size));
        let stride = size.next_multiple_of(FOUR);
        let rows = radiance.len();
        self.size = size;
        self.stride = stride;
        self.gram.resize(size.next_multiple_of(FOUR) * stride, 0.0);
        self.difference.clear();
        self.difference.resize(rows * stride, 0.0);
        for k in 0..rows {
            let s = &responses[k / 3 * 3 * size..(k / 3 + 1) * 3 * size];
            let s_hat = f64::from(radiance[k]);
            let row = &mut self.difference[k * stride..k * stride + size];
            for i in 0..size {
                row[i] = f64::from(s[3 * i + k % 3]) - s_hat;
            }
        }
        for r in (0..stride).step_by(FOUR) {
            let mut c = 0;
            while c < r + FOUR {
                if c + 2 * FOUR <= stride {
                    self.products::<F, 2>(r, c);
                    c += 2 * FOUR;
                } else {
                    self.products::<F, 1>(r, c);
                    c += FOUR;
                }
            }
        }
        // The lift is of the size of the differences themselves, so that neither drowns the other.
        let mut trace = 0.0;
        for i in 0..size {
            trace += self.gram[i * stride + i];
        }
        self.kappa = (trace / size as f64).max(f64::MIN_POSITIVE.sqrt());
        for i in 0..size {
            for k in 0..=i {
                let v = self.gram[i * stride + k] + self.kappa;
                self.gram[i * stride + k] = v;
                self.gram[k * stride + i] = v;
            }
            self.scale[i] = 1.0 / self.gram[i * stride + i].sqrt();
        }
    }

    /// Four rows of D'D, from column c on.
    #[inline(always)]
    fn products<F: Four, const COLUMNS: usize>(&mut self, r: usize, c: usize) {
        let mut sum = [[F::splat(0.0); COLUMNS]; FOUR];
        let stride = self.stride;
        for k in 0..self.difference.len() / stride {
            let row = &self.difference[k * stride..(k + 1) * stride];
            for q in 0..FOUR {
                let left = F::splat(row[r + q]);
                for a in 0..COLUMNS {
                    sum[q][a] = left.fma(F::load(&row[c + FOUR * a..]), sum[q][a]);
                }
            }
        }
        for q in 0..FOUR {
            for a in 0..COLUMNS {
                sum[q][a].store(&mut self.gram[(r + q) * stride + c + FOUR * a..]);
            }
        }
    }

    /// Best blend over the simplex of the `allowed` representatives, no bound on the support's size.
    /// `start` is where the search sets out from, as far as it is allowed.
    #[inline(always)]
    pub fn relax<F: Four>(&mut self, allowed: u64, start: &Blend) -> Blend {
        // Slopes are relative: G_jj >= kappa and the right-hand side is 1.
        let tolerance = 1e-11 / self.kappa.sqrt();
        let mut support = start.support & allowed;
        self.face.count = 0;
        let mut left = support;
        while left != 0 {
            let j = left.trailing_zeros() as usize;
            left &= left - 1;
            self.face.y[j] = start.weights[j] * start.total;
            if !self.append::<F>(j) {
                support &= !(1 << j);
            }
        }
        if support != 0 {
            support = self.descend::<F>(support);
        }
        let mut refused = 0;
        for _ in 0..10 * self.size + 20 {
            let Some(j) = self.steepest::<F>(allowed & !support & !refused, tolerance) else {
                break;
            };
            self.face.y[j] = 0.0;
            if !self.append::<F>(j) {
                refused |= 1 << j;
                continue;
            }
            let before = support | 1 << j;
            support = self.descend::<F>(before);
            if support == before {
                refused = 0;
            } else if support >> j & 1 == 0 {
                refused |= 1 << j;
            }
        }
        self.blend::<F>(support)
    }

    /// Of the `open` representatives the one whose increase lowers the objective most steeply, if any does.
    #[inline(always)]
    fn steepest<F: Four>(&self, open: u64, tolerance: f64) -> Option<usize> {
        let (stride, face) = (self.stride, &self.face);
        let mut slope = [0.0; MOST];
        for c in (0..stride).step_by(FOUR) {
            let mut sum = F::splat(1.0);
            for q in 0..face.count {
                let p = face.order[q];
                let y = F::splat(-face.y[p]);
                sum = y.fma(F::load(&self.gram[p * stride + c..]), sum);
            }
            sum.store(&mut slope[c..]);
        }
        let (mut best, mut steepest) = (None, tolerance);
        let mut left = open;
        while left != 0 {
            let j = left.trailing_zeros() as usize;
            left &= left - 1;
            let s = slope[j] * self.scale[j];
            if s > steepest {
                (best, steepest) = (Some(j), s);
            }
        }
        best
    }

    /// Solve on the passive set, step back to the boundary and drop what reached it, until the solution is
    /// positive. Returns what is left of the support.
    #[inline(always)]
    fn descend<F: Four>(&mut self, mut support: u64) -> u64 {
        loop {
            let face = &mut self.face;
            let p = face.count;
            for r in 0..p {
                face.z[r] = face.forward[r];
            }
            for r in (0..p).rev() {
                let v = face.z[r] * face.inverse[r];
                face.z[r] = v;
                let row = &face.factor[r * (r + 1) / 2..][..r];
                for c in 0..r {
                    face.z[c] = F::fma1(-v, row[c], face.z[c]);
                }
            }
            let (mut alpha, mut positive) = (1.0, true);
            for q in 0..p {
                let (y, z) = (face.y[face.order[q]], face.z[q]);
                if z <= 0.0 {
                    positive = false;
                    alpha = f64::min(alpha, if y > 0.0 { y / (y - z) } else { 0.0 });
                }
            }
            if positive {
                for q in 0..p {
                    face.y[face.order[q]] = face.z[q];
                }
                return support;
            }
            let mut first = p;
            for q in 0..p {
                let (j, z) = (face.order[q], face.z[q]);
                face.y[j] += alpha * (z - face.y[j]);
                if z <= 0.0 && face.y[j] <= 1e-15 * z.abs() {
                    support &= !(1 << j);
                    first = first.min(q);
                }
            }
            // Factor what stays behind the first that was dropped anew.
            face.count = first;
            for q in first..p {
                let j = self.face.order[q];
                if support >> j & 1 == 1 && !self.append::<F>(j) {
                    support &= !(1 << j);
                }
            }
        }
    }

    /// Append a row to the factor; false, and nothing done, if j depends on the rest.
    #[inline(always)]
    fn append<F: Four>(&mut self, j: usize) -> bool {
        let face = &mut self.face;
        let column = &self.gram[j * self.stride..(j + 1) * self.stride];
        let p = face.count;
        let (above, row) = face.factor.split_at_mut(p * (p + 1) / 2);
        let row = &mut row[..=p];
        let (mut rest, mut forward) = (column[j], 1.0);
        for r in 0..p {
            let head = &above[r * (r + 1) / 2..][..r];
            let mut v = column[face.order[r]];
            for c in 0..r {
                v = F::fma1(-head[c], row[c], v);
            }
            v *= face.inverse[r];
            row[r] = v;
            rest = F::fma1(-v, v, rest);
            forward = F::fma1(-v, face.forward[r], forward);
        }
        if rest <= DEPENDENT * column[j] {
            return false;
        }
        let pivot = rest.sqrt();
        row[p] = pivot;
        face.inverse[p] = 1.0 / pivot;
        face.forward[p] = forward / pivot;
        face.order[p] = j;
        face.count = p + 1;
        true
    }

    /// The face's solution as a blend.
    #[inline(always)]
    fn blend<F: Four>(&self, support: u64) -> Blend {
        let face = &self.face;
        let mut blend = Blend {
            support,
            ..Blend::NONE
        };
        blend.total = 0.0;
        for q in 0..face.count {
            blend.total += face.y[face.order[q]];
        }
        for q in 0..face.count {
            let j = face.order[q];
            blend.weights[j] = face.y[j] / blend.total;
        }
        let mut value = 0.0;
        for q in 0..face.count {
            let i = face.order[q];
            let row = &self.gram[i * self.stride..(i + 1) * self.stride];
            let mut sum = 0.0;
            for r in 0..face.count {
                let k = face.order[r];
                sum = F::fma1(row[k] - self.kappa, blend.weights[k], sum);
            }
            value = F::fma1(blend.weights[i], sum, value);
        }
        blend.value = value.max(0.0);
        blend
    }
}
