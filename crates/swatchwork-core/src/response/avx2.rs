// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Lanes in two AVX registers.
//!
//! SAFETY of the whole file: values of `Avx2` are only made and used inside functions that `run`
//! compiles with, and calls after checking for, AVX2, FMA and F16C.

use super::lanes::{Array, Lanes, Sky, each};
use super::mipmap::{Mipmap, Quad};
use super::octahedral::CELLS;
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

#[derive(Clone, Copy)]
pub struct Avx2([__m256; 2]);

/// Both halves from an expression in `H`; see `lanes::each`.
macro_rules! both {
    ($h:ident => $value:expr) => {
        unsafe {
            [
                {
                    const $h: usize = 0;
                    $value
                },
                {
                    const $h: usize = 1;
                    $value
                },
            ]
        }
    };
}

macro_rules! operator {
    ($trait:ident, $name:ident, $intrinsic:ident) => {
        impl $trait for Avx2 {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self(both!(H => {$intrinsic(self.0[H], other.0[H])
                }))
            }
        }
    };
}
operator!(Add, add, _mm256_add_ps);
operator!(Sub, sub, _mm256_sub_ps);
operator!(Mul, mul, _mm256_mul_ps);
operator!(Div, div, _mm256_div_ps);

impl Lanes for Avx2 {
    #[inline(always)]
    fn splat(v: f32) -> Self {
        Self([unsafe { _mm256_set1_ps(v) }; 2])
    }
    #[inline(always)]
    fn load(v: &Array) -> Self {
        Self(both!(H => _mm256_loadu_ps(v.as_ptr().add(8 * H))))
    }
    #[inline(always)]
    fn store(self) -> Array {
        unsafe { std::mem::transmute(self.0) }
    }
    #[inline(always)]
    fn fma(self, b: Self, c: Self) -> Self {
        Self(both!(H => _mm256_fmadd_ps(self.0[H], b.0[H], c.0[H])))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(both!(H => _mm256_sqrt_ps(self.0[H])))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(both!(H => _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0[H])))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(both!(H => _mm256_min_ps(self.0[H], other.0[H])))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(both!(H => _mm256_max_ps(self.0[H], other.0[H])))
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        Self(both!(H => {let sign_bit = _mm256_set1_ps(-0.0);
        _mm256_or_ps(
            _mm256_andnot_ps(sign_bit, self.0[H]),
            _mm256_and_ps(sign_bit, sign.0[H]),
        )}))
    }
    #[inline(always)]
    fn positive(self, yes: Self, no: Self) -> Self {
        Self(
            both!(H => {let mask = _mm256_cmp_ps::<_CMP_GT_OQ>(self.0[H], _mm256_setzero_ps());
            _mm256_blendv_ps(no.0[H], yes.0[H], mask)}),
        )
    }
    #[inline(always)]
    fn keep(bits: u16, v: Self) -> Self {
        Self(
            both!(H => {let own = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let bits = _mm256_set1_epi32(i32::from(bits >> (8 * H)));
            let mask = _mm256_cmpeq_epi32(_mm256_and_si256(bits, own), own);
            _mm256_and_ps(_mm256_castsi256_ps(mask), v.0[H])}),
        )
    }
    #[inline(always)]
    fn any_positive(self) -> bool {
        let zero = Self::splat(0.0);
        let masks = both!(H => _mm256_cmp_ps::<_CMP_GT_OQ>(self.0[H], zero.0[H]));
        unsafe { _mm256_movemask_ps(_mm256_or_ps(masks[0], masks[1])) != 0 }
    }

    #[inline(always)]
    fn fetch(mipmap: &Mipmap, u: Self, v: Self, area: Self) -> [Self; 3] {
        let halves = both!(H => fetch_half(mipmap, u.0[H], v.0[H], area.0[H]));
        each!(C => Self([halves[0][C], halves[1][C]]))
    }

    #[inline(always)]
    fn visible(sky: &Sky, u: Self, v: Self) -> Self {
        let (u, v) = (u.store(), v.store());
        let seen: Array = std::array::from_fn(|k| {
            let cell = |s: f32| ((s * CELLS as f32) as usize).min(CELLS - 1);
            let Ok(row) = usize::try_from(sky.row[k]) else {
                return 1.0;
            };
            ((sky.words[row * CELLS + cell(v[k])] >> cell(u[k])) & 1) as f32
        });
        Self::load(&seen)
    }
}

/// Eight lanes of a fetch.
#[inline(always)]
unsafe fn fetch_half(mipmap: &Mipmap, u: __m256, v: __m256, area: __m256) -> [__m256; 3] {
    unsafe {
        let zero = _mm256_setzero_si256();
        let exponent = _mm256_sub_epi32(
            _mm256_srai_epi32::<23>(_mm256_castps_si256(area)),
            _mm256_set1_epi32(127),
        );
        let top = _mm256_set1_epi32(mipmap.levels.len() as i32 - 1);
        let level = _mm256_min_epi32(
            _mm256_max_epi32(_mm256_srai_epi32::<1>(exponent), zero),
            top,
        );
        let size = _mm256_i32gather_ps::<4>(mipmap.quad_size.as_ptr(), level);
        let start = _mm256_i32gather_epi32::<4>(mipmap.quad_start.as_ptr(), level);
        let (x, y) = (bounded(u, size), bounded(v, size));
        let (i, j) = (_mm256_cvttps_epi32(x), _mm256_cvttps_epi32(y));
        let p = _mm256_sub_ps(x, _mm256_cvtepi32_ps(i));
        let q = _mm256_sub_ps(y, _mm256_cvtepi32_ps(j));
        let stride = _mm256_add_epi32(_mm256_cvttps_epi32(size), _mm256_set1_epi32(1));
        let at = _mm256_add_epi32(_mm256_add_epi32(start, i), _mm256_mullo_epi32(j, stride));
        let at: [u32; 8] = std::mem::transmute(at);
        let q: [f32; 8] = std::mem::transmute(q);
        let quads = mipmap.quads.as_ptr();
        // Group g holds lanes g and g + 4; see the AVX-512 version.
        let mixed = [
            group::<0>(quads, &at, p, &q),
            group::<1>(quads, &at, p, &q),
            group::<2>(quads, &at, p, &q),
            group::<3>(quads, &at, p, &q),
        ];
        let rg_even = _mm256_unpacklo_ps(mixed[0], mixed[1]);
        let rg_odd = _mm256_unpacklo_ps(mixed[2], mixed[3]);
        let b_even = _mm256_unpackhi_ps(mixed[0], mixed[1]);
        let b_odd = _mm256_unpackhi_ps(mixed[2], mixed[3]);
        [
            _mm256_shuffle_ps::<0b01_00_01_00>(rg_even, rg_odd),
            _mm256_shuffle_ps::<0b11_10_11_10>(rg_even, rg_odd),
            _mm256_shuffle_ps::<0b01_00_01_00>(b_even, b_odd),
        ]
    }
}

/// Texel coordinates of a side of the square; see the AVX-512 version.
#[inline(always)]
unsafe fn bounded(s: __m256, size: __m256) -> __m256 {
    unsafe {
        let half = _mm256_set1_ps(0.5);
        let x = _mm256_max_ps(_mm256_fmadd_ps(s, size, half), _mm256_setzero_ps());
        _mm256_min_ps(x, _mm256_add_ps(size, half))
    }
}

/// Left and right texels of lane `k`, interpolated downwards.
#[inline(always)]
unsafe fn one(quads: *const Quad, at: &[u32; 8], k: usize, q: &[f32; 8]) -> __m256 {
    unsafe {
        let quad = quads.add(at[k] as usize).cast::<__m128i>();
        let upper = _mm256_cvtph_ps(_mm_load_si128(quad));
        let lower = _mm256_cvtph_ps(_mm_load_si128(quad.add(1)));
        _mm256_fmadd_ps(_mm256_set1_ps(q[k]), _mm256_sub_ps(lower, upper), upper)
    }
}

/// RGBA of lanes K and K + 4.
#[inline(always)]
unsafe fn group<const K: usize>(
    quads: *const Quad,
    at: &[u32; 8],
    p: __m256,
    q: &[f32; 8],
) -> __m256 {
    unsafe {
        let (first, second) = (one(quads, at, K, q), one(quads, at, K + 4, q));
        let left = _mm256_permute2f128_ps::<0x20>(first, second);
        let right = _mm256_permute2f128_ps::<0x31>(first, second);
        let (a, b) = (K as i32, K as i32 + 4);
        let p = _mm256_permutevar8x32_ps(p, _mm256_setr_epi32(a, a, a, a, b, b, b, b));
        _mm256_fmadd_ps(p, _mm256_sub_ps(right, left), left)
    }
}
