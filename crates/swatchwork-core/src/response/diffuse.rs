// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Cosine integrals of the visible sky, for the diffuse kernels: lanes run over the cells of the
//! sky masks, at whose resolution the mask is exact and the radiance an area mean.

use super::basis::SHAPES;
use super::block::power;
use super::lanes::{Array, LANES, Lanes, each};
use super::pyramid::{CELLS, Pyramid};

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
/// `mask` has a word a row of cells; bit 1 is visible sky.
#[inline(always)]
pub fn cosine_integrals<L: Lanes>(
    pyramid: &Pyramid,
    normal: [f32; 3],
    mask: Option<&[u64]>,
) -> [[f32; 3]; SHAPES] {
    let n = each!(C => L::splat(normal[C]));
    let zero = L::splat(0.0);
    let mut sums = [[zero; 3]; SHAPES];
    for start in (0..CELLS * CELLS).step_by(LANES) {
        let bits = mask.map_or(u64::MAX, |words| words[start / CELLS] >> (start % CELLS));
        let d = each!(C => at::<L>(&pyramid.cell_direction[C], start));
        let cosine = d[2].fma(n[2], d[1].fma(n[1], d[0] * n[0])).max(zero);
        let visible = L::keep(bits as u16, cosine);
        let shape = shapes(cosine);
        for c in 0..3 {
            let reflected = at::<L>(&pyramid.cell_radiance[c], start) * visible;
            for a in 0..SHAPES {
                sums[a][c] = reflected.fma(shape[a], sums[a][c]);
            }
        }
    }
    // A cell subtends 4 pi / CELLS^2, and a Lambertian surface reflects L n.i / pi.
    let scale = 4.0 / (CELLS * CELLS) as f32;
    let mut integrals = [[0.0; 3]; SHAPES];
    for a in 0..SHAPES {
        for c in 0..3 {
            integrals[a][c] = sums[a][c].store().iter().sum::<f32>() * scale;
        }
    }
    integrals
}

#[inline(always)]
fn at<L: Lanes>(table: &[f32], start: usize) -> L {
    let lanes: &Array = table[start..start + LANES]
        .try_into()
        .expect("a whole vector");
    L::load(lanes)
}
