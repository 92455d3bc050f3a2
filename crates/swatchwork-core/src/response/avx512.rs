// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Lanes in one AVX-512 register.
//!
//! SAFETY of the whole file: values of `Avx512` are only made and used inside functions that `run`
//! compiles with, and calls after checking for, AVX-512 F, BW, DQ and VL, FMA and F16C.

use super::avx2::transposed;
use super::lanes::{Array, LANES, Lanes, Sky};
use super::mipmap::{Column, Mipmap};
use super::octahedral::CELLS;
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

#[derive(Clone, Copy)]
pub struct Avx512(__m512);

macro_rules! operator {
    ($trait:ident, $name:ident, $intrinsic:ident) => {
        impl $trait for Avx512 {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}
operator!(Add, add, _mm512_add_ps);
operator!(Sub, sub, _mm512_sub_ps);
operator!(Mul, mul, _mm512_mul_ps);
operator!(Div, div, _mm512_div_ps);

impl Lanes for Avx512 {
    #[inline(always)]
    fn splat(v: f32) -> Self {
        Self(unsafe { _mm512_set1_ps(v) })
    }
    #[inline(always)]
    fn load(v: &Array) -> Self {
        Self(unsafe { _mm512_loadu_ps(v.as_ptr()) })
    }
    #[inline(always)]
    fn store(self) -> Array {
        unsafe { std::mem::transmute(self.0) }
    }
    #[inline(always)]
    fn fma(self, b: Self, c: Self) -> Self {
        Self(unsafe { _mm512_fmadd_ps(self.0, b.0, c.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm512_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(unsafe { _mm512_abs_ps(self.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm512_min_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        Self(unsafe {
            let sign_bit = _mm512_set1_ps(-0.0);
            _mm512_or_ps(
                _mm512_andnot_ps(sign_bit, self.0),
                _mm512_and_ps(sign_bit, sign.0),
            )
        })
    }
    #[inline(always)]
    fn positive(self, yes: Self, no: Self) -> Self {
        Self(unsafe {
            let mask = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, _mm512_setzero_ps());
            _mm512_mask_blend_ps(mask, no.0, yes.0)
        })
    }
    #[inline(always)]
    fn keep(bits: u16, v: Self) -> Self {
        Self(unsafe { _mm512_maskz_mov_ps(bits, v.0) })
    }
    #[inline(always)]
    fn any_positive(self) -> bool {
        unsafe { _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, _mm512_setzero_ps()) != 0 }
    }

    type Place = Place;
    const NOWHERE: Place = Place {
        at: [0; 16],
        p: unsafe { std::mem::zeroed() },
        q: unsafe { std::mem::zeroed() },
    };

    #[inline(always)]
    fn locate(mipmap: &Mipmap, u: Self, v: Self, area: Self) -> Place {
        unsafe {
            let zero = _mm512_setzero_si512();
            let exponent = _mm512_sub_epi32(
                _mm512_srai_epi32::<23>(_mm512_castps_si512(area.0)),
                _mm512_set1_epi32(127),
            );
            let top = _mm512_set1_epi32(mipmap.levels.len() as i32 - 1);
            let level = _mm512_min_epi32(
                _mm512_max_epi32(_mm512_srai_epi32::<1>(exponent), zero),
                top,
            );
            let sizes = _mm512_loadu_ps(mipmap.side.as_ptr());
            let starts = _mm512_loadu_si512(mipmap.start.as_ptr().cast());
            let size = _mm512_permutexvar_ps(level, sizes);
            let start = _mm512_permutexvar_epi32(level, starts);
            let (x, y) = (bounded(u.0, size), bounded(v.0, size));
            let (i, j) = (_mm512_cvttps_epi32(x), _mm512_cvttps_epi32(y));
            let p = _mm512_sub_ps(x, _mm512_cvtepi32_ps(i));
            let q = _mm512_sub_ps(y, _mm512_cvtepi32_ps(j));
            let stride = _mm512_add_epi32(_mm512_cvttps_epi32(size), _mm512_set1_epi32(2));
            let at = _mm512_add_epi32(_mm512_add_epi32(start, i), _mm512_mullo_epi32(j, stride));
            let at = indices(at);
            for k in 0..LANES {
                let first = mipmap.columns.as_ptr().add(at[k] as usize);
                _mm_prefetch::<_MM_HINT_T0>(first.cast());
            }
            Place { at, p, q }
        }
    }

    #[inline(always)]
    fn fetch(mipmap: &Mipmap, place: &Place) -> [Self; 3] {
        unsafe {
            let Place { at, p, q } = place;
            let columns = mipmap.columns.as_ptr();
            // Group g holds lanes g, g + 4, g + 8 and g + 12, so that a transpose inside each
            // 128-bit part brings the lanes into order.
            let mixed = [
                group::<0>(columns, at, *p, *q),
                group::<1>(columns, at, *p, *q),
                group::<2>(columns, at, *p, *q),
                group::<3>(columns, at, *p, *q),
            ];
            let rg_even = _mm512_unpacklo_ps(mixed[0], mixed[1]);
            let rg_odd = _mm512_unpacklo_ps(mixed[2], mixed[3]);
            let b_even = _mm512_unpackhi_ps(mixed[0], mixed[1]);
            let b_odd = _mm512_unpackhi_ps(mixed[2], mixed[3]);
            let r = _mm512_shuffle_ps::<0b01_00_01_00>(rg_even, rg_odd);
            let g = _mm512_shuffle_ps::<0b11_10_11_10>(rg_even, rg_odd);
            let b = _mm512_shuffle_ps::<0b01_00_01_00>(b_even, b_odd);
            [Self(r), Self(g), Self(b)]
        }
    }

    #[inline(always)]
    fn visible(sky: &Sky, u: Self, v: Self) -> Self {
        unsafe {
            let (i, j) = (cell(u.0), cell(v.0));
            let row = _mm512_loadu_si512(sky.row.as_ptr().cast());
            let masked = _mm512_cmpge_epi32_mask(row, _mm512_setzero_si512());
            // Masks are little-endian pairs of 32-bit words, 128 a mask.
            let word = _mm512_or_si512(_mm512_slli_epi32::<1>(j), _mm512_srli_epi32::<5>(i));
            let word = _mm512_add_epi32(_mm512_slli_epi32::<7>(row), word);
            let ones = _mm512_set1_epi32(-1);
            let bits =
                _mm512_mask_i32gather_epi32::<4>(ones, masked, word, sky.words.as_ptr().cast());
            let bit = _mm512_srlv_epi32(bits, _mm512_and_si512(i, _mm512_set1_epi32(31)));
            let seen = _mm512_test_epi32_mask(bit, _mm512_set1_epi32(1));
            Self(_mm512_maskz_mov_ps(seen, _mm512_set1_ps(1.0)))
        }
    }

    #[inline(always)]
    fn by_lane(rows: [Self; 8]) -> [[f32; 8]; LANES] {
        unsafe {
            let (mut low, mut high) = ([_mm256_setzero_ps(); 8], [_mm256_setzero_ps(); 8]);
            for r in 0..8 {
                low[r] = _mm512_castps512_ps256(rows[r].0);
                high[r] = _mm512_extractf32x8_ps::<1>(rows[r].0);
            }
            std::mem::transmute([transposed(low), transposed(high)])
        }
    }

    #[inline(always)]
    fn from_lanes(lanes: &[[f32; 8]; LANES]) -> [Self; 8] {
        unsafe {
            let (mut low, mut high) = ([_mm256_setzero_ps(); 8], [_mm256_setzero_ps(); 8]);
            for k in 0..8 {
                low[k] = _mm256_loadu_ps(lanes[k].as_ptr());
                high[k] = _mm256_loadu_ps(lanes[k + 8].as_ptr());
            }
            let (low, high) = (transposed(low), transposed(high));
            let mut rows = [Self::splat(0.0); 8];
            for r in 0..8 {
                let row = _mm512_castps256_ps512(low[r]);
                rows[r] = Self(_mm512_insertf32x8::<1>(row, high[r]));
            }
            rows
        }
    }
}

/// Left columns of sixteen fetches, and how far right of and below their middles the points lie.
#[derive(Clone, Copy)]
pub struct Place {
    at: [u32; 16],
    p: __m512,
    q: __m512,
}

/// Texel coordinates of a side of the square, in a bordered level. Bounds hold for any input, NaN
/// included: max and min return their second operand then.
#[inline(always)]
unsafe fn bounded(s: __m512, size: __m512) -> __m512 {
    unsafe {
        let half = _mm512_set1_ps(0.5);
        let x = _mm512_max_ps(_mm512_fmadd_ps(s, size, half), _mm512_setzero_ps());
        _mm512_min_ps(x, _mm512_add_ps(size, half))
    }
}

/// Row or column of the sky mask.
#[inline(always)]
unsafe fn cell(s: __m512) -> __m512i {
    unsafe {
        let x = _mm512_mul_ps(s, _mm512_set1_ps(CELLS as f32));
        let x = _mm512_max_ps(x, _mm512_setzero_ps());
        _mm512_cvttps_epi32(_mm512_min_ps(x, _mm512_set1_ps(CELLS as f32 - 1.0)))
    }
}

/// Lanes in memory: sixteen plain loads are cheaper than the extractions a compiler would choose.
#[inline(always)]
unsafe fn indices(v: __m512i) -> [u32; 16] {
    let mut out = std::mem::MaybeUninit::<[u32; 16]>::uninit();
    unsafe {
        _mm512_storeu_si512(out.as_mut_ptr().cast(), v);
        std::ptr::read_volatile(&out).assume_init()
    }
}

/// One column of each of two fetches, in single precision.
#[inline(always)]
unsafe fn column(a: *const Column, b: *const Column, nth: usize) -> __m512 {
    unsafe {
        let a = _mm_load_si128(a.add(nth).cast());
        let b = _mm_load_si128(b.add(nth).cast());
        _mm512_cvtph_ps(_mm256_inserti128_si256::<1>(_mm256_castsi128_si256(a), b))
    }
}

/// Upper and lower texels of lanes `k` and `k + 4`, interpolated sideways.
#[inline(always)]
unsafe fn pair(columns: *const Column, at: &[u32; 16], k: usize, p: __m512) -> __m512 {
    unsafe {
        let (a, b) = (columns.add(at[k] as usize), columns.add(at[k + 4] as usize));
        let (left, right) = (column(a, b, 0), column(a, b, 1));
        let (a, b) = (k as i32, k as i32 + 4);
        let pick = _mm512_setr_epi32(a, a, a, a, a, a, a, a, b, b, b, b, b, b, b, b);
        let p = _mm512_permutexvar_ps(pick, p);
        _mm512_fmadd_ps(p, _mm512_sub_ps(right, left), left)
    }
}

/// RGBA of lanes K, K + 4, K + 8 and K + 12.
#[inline(always)]
unsafe fn group<const K: usize>(
    columns: *const Column,
    at: &[u32; 16],
    p: __m512,
    q: __m512,
) -> __m512 {
    unsafe {
        let (first, second) = (pair(columns, at, K, p), pair(columns, at, K + 8, p));
        let upper = _mm512_shuffle_f32x4::<0b10_00_10_00>(first, second);
        let lower = _mm512_shuffle_f32x4::<0b11_01_11_01>(first, second);
        let (a, b, c, d) = (K as i32, K as i32 + 4, K as i32 + 8, K as i32 + 12);
        let pick = _mm512_setr_epi32(a, a, a, a, b, b, b, b, c, c, c, c, d, d, d, d);
        let q = _mm512_permutexvar_ps(pick, q);
        _mm512_fmadd_ps(q, _mm512_sub_ps(lower, upper), upper)
    }
}
