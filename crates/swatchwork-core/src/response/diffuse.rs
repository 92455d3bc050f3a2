// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Cosine integrals of the visible sky, for the diffuse kernels: lanes run over the cells of the
//! sky masks, at whose resolution the mask is exact and the radiance an area mean, and then over the
//! strong point lights, which those cells leave out.

use super::basis::SHAPES;
use super::block::power;
use super::lanes::{Array, LANES, Lanes, each};
use super::octahedral::CELLS;
use super::pyramid::Pyramid;

/// The functions of a cosine that diffuse kernels are products of: 1, 1 - (1 - c/2)^5, (1 - c)^5,
/// (1 - c)^10 and 1 / (1 + c).
#[inline(always)]
pub fn shapes<L: Lanes>(cosine: L) -> [L; SHAPES] {
    let one = L::splat(1.0);
    let grazing = power(one - cosine, 5);
    [
        one,
        one - power(one - L::splat(0.5) * cosine, 5),
        grazing,
        grazing * grazing,
        one / (one + cosine),
    ]
}

/// Integrals over the visible hemisphere of L n.i / pi times each shape of n.i, three channels each.
pub type Integrals = [[f32; 3]; SHAPES];

/// The integrals of one texel.
/// `mask` has a word a row of cells; bit 1 is visible sky.
#[inline(always)]
pub fn cosine_integrals<L: Lanes>(
    pyramid: &Pyramid,
    normal: [f32; 3],
    mask: Option<&[u64]>,
) -> Integrals {
    let n = each!(C => L::splat(normal[C]));
    let zero = L::splat(0.0);
    let mut sums = [[zero; 3]; SHAPES];
    let sources = &pyramid.sources;
    for start in (0..sources.power[0].len()).step_by(LANES) {
        let d = each!(C => at::<L>(&sources.direction[C], start));
        let cosine = d[2].fma(n[2], d[1].fma(n[1], d[0] * n[0])).max(zero);
        if !cosine.any_positive() {
            continue;
        }
        let bits = mask.map_or(u16::MAX, |words| visible(words, start, &sources.light_cell));
        let seen = L::keep(bits, cosine);
        let shape = shapes(cosine);
        for c in 0..3 {
            let reflected = at::<L>(&sources.power[c], start) * seen;
            for a in 0..SHAPES {
                sums[a][c] = reflected.fma(shape[a], sums[a][c]);
            }
        }
    }
    let mut out = [[0.0; 3]; SHAPES];
    for a in 0..SHAPES {
        for c in 0..3 {
            out[a][c] = sums[a][c].store().iter().sum();
        }
    }
    out
}

/// Visibility of sixteen sources: cells in order, then lights by their cells.
#[inline(always)]
fn visible(words: &[u64], start: usize, light_cell: &[[usize; 2]]) -> u16 {
    let Some(light) = start.checked_sub(CELLS * CELLS) else {
        return (words[start / CELLS] >> (start % CELLS)) as u16;
    };
    let mut bits = 0;
    for (k, &[row, column]) in light_cell[light..light + LANES].iter().enumerate() {
        bits |= (((words[row] >> column) & 1) as u16) << k;
    }
    bits
}

#[inline(always)]
fn at<L: Lanes>(table: &[f32], start: usize) -> L {
    let lanes: &Array = table[start..start + LANES]
        .try_into()
        .expect("a whole vector");
    L::load(lanes)
}
