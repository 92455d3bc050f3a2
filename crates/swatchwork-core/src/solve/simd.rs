// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Four f64 at a time: plain arithmetic for any machine, or AVX2 with FMA where it is found.

// Indices where iterators would do: those are not inlined into functions of other target features.
#![allow(clippy::needless_range_loop)]

/// Numbers in a `Four`.
pub const FOUR: usize = 4;

/// Four lanes of f64.
pub trait Four: Copy {
    fn splat(v: f64) -> Self;
    /// The first four of a slice.
    fn load(from: &[f64]) -> Self;
    fn store(self, to: &mut [f64]);
    /// The four of a slice, widened.
    fn widen(from: &[f32]) -> Self;
    /// self * a + b.
    fn fma(self, a: Self, b: Self) -> Self;
    fn sum(self) -> f64;
    /// a * b + c of single numbers.
    fn fma1(a: f64, b: f64, c: f64) -> f64;
}

/// Arithmetic that every machine has.
#[derive(Clone, Copy)]
pub struct Plain([f64; FOUR]);

impl Four for Plain {
    #[inline(always)]
    fn splat(v: f64) -> Self {
        Plain([v; FOUR])
    }
    #[inline(always)]
    fn load(from: &[f64]) -> Self {
        Plain(std::array::from_fn(|k| from[k]))
    }
    #[inline(always)]
    fn store(self, to: &mut [f64]) {
        to[..FOUR].copy_from_slice(&self.0);
    }
    #[inline(always)]
    fn widen(from: &[f32]) -> Self {
        Plain(std::array::from_fn(|k| f64::from(from[k])))
    }
    #[inline(always)]
    fn fma(self, a: Self, b: Self) -> Self {
        Plain(std::array::from_fn(|k| self.0[k] * a.0[k] + b.0[k]))
    }
    #[inline(always)]
    fn sum(self) -> f64 {
        (self.0[0] + self.0[1]) + (self.0[2] + self.0[3])
    }
    #[inline(always)]
    fn fma1(a: f64, b: f64, c: f64) -> f64 {
        a * b + c
    }
}

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{FOUR, Four};
    use std::arch::x86_64::*;

    /// Only made inside functions that `dispatched!` compiles for AVX2 and FMA.
    #[derive(Clone, Copy)]
    pub struct Avx2(__m256d);

    impl Four for Avx2 {
        #[inline(always)]
        fn splat(v: f64) -> Self {
            // SAFETY: the machine has AVX2 wherever this type is used.
            unsafe { Avx2(_mm256_set1_pd(v)) }
        }
        #[inline(always)]
        fn load(from: &[f64]) -> Self {
            let from = &from[..FOUR];
            // SAFETY: as above, and four numbers are there.
            unsafe { Avx2(_mm256_loadu_pd(from.as_ptr())) }
        }
        #[inline(always)]
        fn store(self, to: &mut [f64]) {
            let to = &mut to[..FOUR];
            // SAFETY: as above, and there is room for four.
            unsafe { _mm256_storeu_pd(to.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn widen(from: &[f32]) -> Self {
            let from = &from[..FOUR];
            // SAFETY: as above, and four numbers are there.
            unsafe { Avx2(_mm256_cvtps_pd(_mm_loadu_ps(from.as_ptr()))) }
        }
        #[inline(always)]
        fn fma(self, a: Self, b: Self) -> Self {
            // SAFETY: as above.
            unsafe { Avx2(_mm256_fmadd_pd(self.0, a.0, b.0)) }
        }
        #[inline(always)]
        fn sum(self) -> f64 {
            let mut v = [0.0; FOUR];
            self.store(&mut v);
            (v[0] + v[1]) + (v[2] + v[3])
        }
        #[inline(always)]
        fn fma1(a: f64, b: f64, c: f64) -> f64 {
            a.mul_add(b, c)
        }
    }
}

/// Whether this machine has AVX2, FMA and the bit manipulation that came with them.
pub fn wide() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("popcnt")
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        false
    }
}

/// Defines `$name`, which runs the generic `$body::<impl Four>` under the best instruction set of the machine.
macro_rules! dispatched {
    ($(#[$doc:meta])* $vis:vis fn $name:ident($($arg:ident: $type:ty),* $(,)?) $(-> $out:ty)? = $body:ident) => {
        $(#[$doc])*
        $vis fn $name($($arg: $type),*) $(-> $out)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt")]
                fn wide($($arg: $type),*) $(-> $out)? {
                    $body::<$crate::solve::simd::Avx2>($($arg),*)
                }
                if $crate::solve::simd::wide() {
                    // SAFETY: the machine has the instructions.
                    return unsafe { wide($($arg),*) };
                }
            }
            $body::<$crate::solve::simd::Plain>($($arg),*)
        }
    };
}
pub(super) use dispatched;

/// Inner product of equally long slices.
#[inline(always)]
pub fn dot<F: Four>(a: &[f64], b: &[f64]) -> f64 {
    let b = &b[..a.len()];
    let (mut even, mut odd) = (F::splat(0.0), F::splat(0.0));
    let mut k = 0;
    while k + 2 * FOUR <= a.len() {
        even = F::load(&a[k..]).fma(F::load(&b[k..]), even);
        odd = F::load(&a[k + FOUR..]).fma(F::load(&b[k + FOUR..]), odd);
        k += 2 * FOUR;
    }
    let mut rest = 0.0;
    while k < a.len() {
        rest = F::fma1(a[k], b[k], rest);
        k += 1;
    }
    rest + odd.fma(F::splat(1.0), even).sum()
}

/// y += a x.
#[inline(always)]
pub fn axpy<F: Four>(a: f64, x: &[f64], y: &mut [f64]) {
    let x = &x[..y.len()];
    let all = F::splat(a);
    let mut k = 0;
    while k + FOUR <= y.len() {
        all.fma(F::load(&x[k..]), F::load(&y[k..]))
            .store(&mut y[k..]);
        k += FOUR;
    }
    while k < y.len() {
        y[k] = F::fma1(a, x[k], y[k]);
        k += 1;
    }
}
