// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Sixteen numbers at a time. The kernels are written once over this trait; each instruction set
//! implements it, and is compiled under its own target features in `run`.

use super::mipmap::Mipmap;
use super::octahedral::CELLS;
use std::ops::{Add, Div, Mul, Sub};

/// Lanes of every implementation: blocks have the same shape whatever the machine.
pub const LANES: usize = 16;

/// One value a lane.
pub type Array = [f32; LANES];

/// An array of three from an expression in `c`. Closures would do, but they are compiled without the
/// target features of the function they are in, and vector instructions then stay calls.
macro_rules! each {
    ($c:ident => $value:expr) => {
        [
            {
                const $c: usize = 0;
                $value
            },
            {
                const $c: usize = 1;
                $value
            },
            {
                const $c: usize = 2;
                $value
            },
        ]
    };
}
pub(super) use each;

/// Visibility of the sky for the pairs of a block.
#[derive(Clone, Copy)]
pub struct Sky<'a> {
    /// Words of all masks [Q * CELLS]; bit i of word j is the cell in row j and column i.
    pub words: &'a [u64],
    /// Each lane's row of 64 words, or -1 where everything is visible.
    pub row: [i32; LANES],
    /// Whether any lane has a mask.
    pub masked: bool,
}

/// Arithmetic on sixteen lanes, and the two lookups that a sample makes.
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    fn splat(v: f32) -> Self;
    fn load(v: &Array) -> Self;
    fn store(self) -> Array;
    /// self * b + c, in one rounding where the machine has it.
    fn fma(self, b: Self, c: Self) -> Self;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    /// `self` with the sign of `sign`.
    fn copysign(self, sign: Self) -> Self;
    /// `yes` where self > 0, else `no`.
    fn positive(self, yes: Self, no: Self) -> Self;
    /// `self` in the lanes whose bit is set, else 0.
    fn keep(bits: u16, v: Self) -> Self;
    /// Whether self > 0 in any lane.
    fn any_positive(self) -> bool;
    /// What `fetch` counts radiance in.
    fn fetch_unit(mipmap: &Mipmap) -> f32 {
        mipmap.unit
    }
    /// Where `fetch` finds its texels.
    type Place: Copy;
    /// Any place.
    const NOWHERE: Self::Place;
    /// The place of a point (u, v) of the square, which the cache is asked to load. The level is
    /// floor(log2(area) / 2), for an `area` in texels of the base.
    fn locate(mipmap: &Mipmap, u: Self, v: Self, area: Self) -> Self::Place;
    /// Bilinear radiance at a place.
    fn fetch(mipmap: &Mipmap, place: &Self::Place) -> [Self; 3];
    /// 1 where the sky is visible at (u, v), else 0.
    fn visible(sky: &Sky, u: Self, v: Self) -> Self;
    /// Eight values, lane after lane.
    fn by_lane(rows: [Self; 8]) -> [[f32; 8]; LANES];
    /// The inverse of `by_lane`.
    fn from_lanes(lanes: &[[f32; 8]; LANES]) -> [Self; 8];
}

/// Plain arrays, for machines without a faster implementation, and as the vector versions' twin.
#[derive(Clone, Copy)]
pub struct Plain(Array);

macro_rules! lanewise {
    ($trait:ident, $name:ident, $op:tt) => {
        impl $trait for Plain {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self(std::array::from_fn(|k| self.0[k] $op other.0[k]))
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);
lanewise!(Div, div, /);

impl Lanes for Plain {
    #[inline(always)]
    fn splat(v: f32) -> Self {
        Self([v; LANES])
    }
    #[inline(always)]
    fn load(v: &Array) -> Self {
        Self(*v)
    }
    #[inline(always)]
    fn store(self) -> Array {
        self.0
    }
    #[inline(always)]
    fn fma(self, b: Self, c: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] * b.0[k] + c.0[k]))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| {
            if self.0[k] < other.0[k] {
                self.0[k]
            } else {
                other.0[k]
            }
        }))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| {
            if self.0[k] > other.0[k] {
                self.0[k]
            } else {
                other.0[k]
            }
        }))
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k].copysign(sign.0[k])))
    }
    #[inline(always)]
    fn positive(self, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|k| {
            if self.0[k] > 0.0 { yes.0[k] } else { no.0[k] }
        }))
    }
    #[inline(always)]
    fn keep(bits: u16, v: Self) -> Self {
        Self(std::array::from_fn(|k| {
            if bits >> k & 1 == 1 { v.0[k] } else { 0.0 }
        }))
    }
    #[inline(always)]
    fn any_positive(self) -> bool {
        self.0.iter().any(|&v| v > 0.0)
    }

    fn fetch_unit(_: &Mipmap) -> f32 {
        1.0
    }

    type Place = [Self; 3];
    const NOWHERE: Self::Place = [Self([0.0; LANES]); 3];

    #[inline(always)]
    fn locate(_: &Mipmap, u: Self, v: Self, area: Self) -> [Self; 3] {
        [u, v, area]
    }

    #[inline(always)]
    fn fetch(mipmap: &Mipmap, [u, v, area]: &[Self; 3]) -> [Self; 3] {
        let mut out = [[0.0; LANES]; 3];
        for k in 0..LANES {
            let exponent = (area.0[k].to_bits() >> 23) as i32 - 127;
            let at = ((exponent >> 1).max(0) as usize).min(mipmap.levels.len() - 1);
            let level = &mipmap.levels[at];
            let (x, y) = (
                u.0[k] * level.size as f32 + 0.5,
                v.0[k] * level.size as f32 + 0.5,
            );
            let (i, j) = ((x as usize).min(level.size), (y as usize).min(level.size));
            let (p, q) = (x - i as f32, y - j as f32);
            let stride = level.size + 2;
            let first = level.start + j * stride + i;
            let upper = &mipmap.texels[first..first + 2];
            let lower = &mipmap.texels[first + stride..first + stride + 2];
            for (c, out) in out.iter_mut().enumerate() {
                let top = upper[0][c] + p * (upper[1][c] - upper[0][c]);
                let bottom = lower[0][c] + p * (lower[1][c] - lower[0][c]);
                out[k] = top + q * (bottom - top);
            }
        }
        out.map(Self)
    }

    #[inline(always)]
    fn visible(sky: &Sky, u: Self, v: Self) -> Self {
        let mut out = [1.0; LANES];
        for k in 0..LANES {
            if sky.row[k] >= 0 {
                let cell = |s: f32| ((s * CELLS as f32) as usize).min(CELLS - 1);
                let word = sky.words[sky.row[k] as usize * CELLS + cell(v.0[k])];
                out[k] = ((word >> cell(u.0[k])) & 1) as f32;
            }
        }
        Self(out)
    }

    #[inline(always)]
    fn by_lane(rows: [Self; 8]) -> [[f32; 8]; LANES] {
        std::array::from_fn(|k| rows.map(|row| row.0[k]))
    }

    #[inline(always)]
    fn from_lanes(lanes: &[[f32; 8]; LANES]) -> [Self; 8] {
        std::array::from_fn(|r| Self(lanes.map(|lane| lane[r])))
    }
}
