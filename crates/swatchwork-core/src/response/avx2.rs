// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Lanes in two AVX registers.
//!
//! SAFETY of the whole file: values of `Avx2` are only made and used inside functions that `run`
//! compiles with, and calls after checking for, AVX2, FMA and F16C.

use super::lanes::{Array, LANES, Lanes, Sky, each};
use super::mipmap::{Column, Mipmap};
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

    type Place = [Place; 2];
    const NOWHERE: Self::Place = [Place {
        at: [0; 8],
        p: [0.0; 8],
        q: unsafe { std::mem::zeroed() },
    }; 2];

    #[inline(always)]
    fn locate(mipmap: &Mipmap, u: Self, v: Self, area: Self) -> [Place; 2] {
        both!(H => locate_half(mipmap, u.0[H], v.0[H], area.0[H]))
    }

    #[inline(always)]
    fn fetch(mipmap: &Mipmap, place: &[Place; 2]) -> [Self; 3] {
        let halves = both!(H => fetch_half(mipmap, &place[H]));
        each!(C => Self([halves[0][C], halves[1][C]]))
    }

    #[inline(always)]
    fn visible(sky: &Sky, u: Self, v: Self) -> Self {
        Self(both!(H => visible_half(sky, 8 * H, u.0[H], v.0[H])))
    }

    #[inline(always)]
    fn by_lane(rows: [Self; 8]) -> [[f32; 8]; LANES] {
        let lanes = both!(H => {
            let mut half = [_mm256_setzero_ps(); 8];
            for r in 0..8 {
                half[r] = rows[r].0[H];
            }
            transposed(half)
        });
        unsafe { std::mem::transmute(lanes) }
    }

    #[inline(always)]
    fn from_lanes(lanes: &[[f32; 8]; LANES]) -> [Self; 8] {
        let halves = both!(H => {
            let mut half = [_mm256_setzero_ps(); 8];
            for k in 0..8 {
                half[k] = _mm256_loadu_ps(lanes[8 * H + k].as_ptr());
            }
            transposed(half)
        });
        let mut rows = [Self::splat(0.0); 8];
        for r in 0..8 {
            rows[r] = Self([halves[0][r], halves[1][r]]);
        }
        rows
    }
}

/// Rows and columns of an 8 x 8 matrix swapped.
#[inline(always)]
pub unsafe fn transposed(m: [__m256; 8]) -> [__m256; 8] {
    unsafe {
        // Pairs of rows, then fours, inside each 128-bit part; then the parts.
        let mut pairs = m;
        for r in [0, 2, 4, 6] {
            pairs[r] = _mm256_unpacklo_ps(m[r], m[r + 1]);
            pairs[r + 1] = _mm256_unpackhi_ps(m[r], m[r + 1]);
        }
        let mut fours = m;
        for r in [0, 4] {
            fours[r] = _mm256_shuffle_ps::<0b01_00_01_00>(pairs[r], pairs[r + 2]);
            fours[r + 1] = _mm256_shuffle_ps::<0b11_10_11_10>(pairs[r], pairs[r + 2]);
            fours[r + 2] = _mm256_shuffle_ps::<0b01_00_01_00>(pairs[r + 1], pairs[r + 3]);
            fours[r + 3] = _mm256_shuffle_ps::<0b11_10_11_10>(pairs[r + 1], pairs[r + 3]);
        }
        let mut out = m;
        for r in 0..4 {
            out[r] = _mm256_permute2f128_ps::<0x20>(fours[r], fours[r + 4]);
            out[r + 4] = _mm256_permute2f128_ps::<0x31>(fours[r], fours[r + 4]);
        }
        out
    }
}

/// Eight lanes of a look at the sky masks, from lane `first`.
#[inline(always)]
unsafe fn visible_half(sky: &Sky, first: usize, u: __m256, v: __m256) -> __m256 {
    unsafe {
        let (i, j) = (cell(u), cell(v));
        let row = _mm256_loadu_si256(sky.row.as_ptr().add(first).cast());
        let masked = _mm256_cmpgt_epi32(row, _mm256_set1_epi32(-1));
        // Masks are little-endian pairs of 32-bit words, 128 a mask.
        let word = _mm256_or_si256(_mm256_slli_epi32::<1>(j), _mm256_srli_epi32::<5>(i));
        let word = _mm256_add_epi32(_mm256_slli_epi32::<7>(row), word);
        let ones = _mm256_set1_epi32(-1);
        let bits = _mm256_mask_i32gather_epi32::<4>(ones, sky.words.as_ptr().cast(), word, masked);
        // The cell's bit becomes the sign; 31 - i mod 32 places from there.
        let back = _mm256_andnot_si256(i, _mm256_set1_epi32(31));
        let seen = _mm256_srai_epi32::<31>(_mm256_sllv_epi32(bits, back));
        _mm256_and_ps(_mm256_castsi256_ps(seen), _mm256_set1_ps(1.0))
    }
}

/// Row or column of the sky mask.
#[inline(always)]
unsafe fn cell(s: __m256) -> __m256i {
    unsafe {
        let x = _mm256_mul_ps(s, _mm256_set1_ps(CELLS as f32));
        let x = _mm256_max_ps(x, _mm256_setzero_ps());
        _mm256_cvttps_epi32(_mm256_min_ps(x, _mm256_set1_ps(CELLS as f32 - 1.0)))
    }
}

/// Left columns of eight fetches, and how far right of and below their middles the points lie.
#[derive(Clone, Copy)]
pub struct Place {
    at: [u32; 8],
    p: [f32; 8],
    q: __m256,
}

#[inline(always)]
unsafe fn locate_half(mipmap: &Mipmap, u: __m256, v: __m256, area: __m256) -> Place {
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
        // A level has half the side of the last: one less in the exponent.
        let base = _mm256_castps_si256(_mm256_broadcast_ss(&mipmap.side[0]));
        let size = _mm256_castsi256_ps(_mm256_sub_epi32(base, _mm256_slli_epi32::<23>(level)));
        let start = pick(&mipmap.start, level);
        let (x, y) = (bounded(u, size), bounded(v, size));
        let (i, j) = (_mm256_cvttps_epi32(x), _mm256_cvttps_epi32(y));
        let p = _mm256_sub_ps(x, _mm256_cvtepi32_ps(i));
        let q = _mm256_sub_ps(y, _mm256_cvtepi32_ps(j));
        let stride = _mm256_add_epi32(_mm256_cvttps_epi32(size), _mm256_set1_epi32(2));
        let at = _mm256_add_epi32(_mm256_add_epi32(start, i), _mm256_mullo_epi32(j, stride));
        let at: [u32; 8] = std::mem::transmute(at);
        for k in 0..8 {
            let first = mipmap.columns.as_ptr().add(at[k] as usize);
            _mm_prefetch::<_MM_HINT_T0>(first.cast());
        }
        let p = std::mem::transmute::<__m256, [f32; 8]>(p);
        Place { at, p, q }
    }
}

/// Eight lanes of a fetch.
#[inline(always)]
unsafe fn fetch_half(mipmap: &Mipmap, place: &Place) -> [__m256; 3] {
    unsafe {
        let Place { at, p, q } = place;
        let columns = mipmap.columns.as_ptr();
        // Group g holds lanes g and g + 4; see the AVX-512 version.
        let mixed = [
            group::<0>(columns, at, p, *q),
            group::<1>(columns, at, p, *q),
            group::<2>(columns, at, p, *q),
            group::<3>(columns, at, p, *q),
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

/// Entries of a table of sixteen; two permutations take a third of the time of a gather.
#[inline(always)]
unsafe fn pick(table: &[i32; 16], at: __m256i) -> __m256i {
    unsafe {
        let low = _mm256_loadu_si256(table.as_ptr().cast());
        let high = _mm256_loadu_si256(table.as_ptr().add(8).cast());
        let low = _mm256_castsi256_ps(_mm256_permutevar8x32_epi32(low, at));
        let high = _mm256_castsi256_ps(_mm256_permutevar8x32_epi32(high, at));
        // Bit 3 of the index, as the sign that chooses.
        let upper = _mm256_castsi256_ps(_mm256_slli_epi32::<28>(at));
        _mm256_castps_si256(_mm256_blendv_ps(low, high, upper))
    }
}

/// Upper and lower texel of lane `k`, interpolated sideways.
#[inline(always)]
unsafe fn one(columns: *const Column, at: &[u32; 8], k: usize, p: &[f32; 8]) -> __m256 {
    unsafe {
        let first = columns.add(at[k] as usize).cast::<__m128i>();
        let left = _mm256_cvtph_ps(_mm_load_si128(first));
        let right = _mm256_cvtph_ps(_mm_load_si128(first.add(1)));
        _mm256_fmadd_ps(_mm256_set1_ps(p[k]), _mm256_sub_ps(right, left), left)
    }
}

/// RGBA of lanes K and K + 4.
#[inline(always)]
unsafe fn group<const K: usize>(
    columns: *const Column,
    at: &[u32; 8],
    p: &[f32; 8],
    q: __m256,
) -> __m256 {
    unsafe {
        let (first, second) = (one(columns, at, K, p), one(columns, at, K + 4, p));
        let upper = _mm256_permute2f128_ps::<0x20>(first, second);
        let lower = _mm256_permute2f128_ps::<0x31>(first, second);
        let (a, b) = (K as i32, K as i32 + 4);
        let q = _mm256_permutevar8x32_ps(q, _mm256_setr_epi32(a, a, a, a, b, b, b, b));
        _mm256_fmadd_ps(q, _mm256_sub_ps(lower, upper), upper)
    }
}
