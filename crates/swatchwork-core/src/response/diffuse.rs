// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Cosine integrals of the visible sky, for the diffuse kernels: lanes run over the cells of the
//! sky masks, at whose resolution the mask is exact and the radiance an area mean.

use super::lanes::{Array, LANES, Lanes, each};
use super::pyramid::{CELLS, Pyramid};

/// E0 and E1, three channels each: integrals over the visible hemisphere of L n.i / pi, and of the
/// same times (1 - n.i)^5. `mask` has a word a row of cells; bit 1 is visible sky.
#[inline(always)]
pub fn cosine_integrals<L: Lanes>(
    pyramid: &Pyramid,
    normal: [f32; 3],
    mask: Option<&[u64]>,
) -> [[f32; 3]; 2] {
    let n = each!(C => L::splat(normal[C]));
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let mut sums = [[zero; 3]; 2];
    for start in (0..CELLS * CELLS).step_by(LANES) {
        let bits = mask.map_or(u64::MAX, |words| words[start / CELLS] >> (start % CELLS));
        let d = each!(C => at::<L>(&pyramid.cell_direction[C], start));
        let cosine = d[2].fma(n[2], d[1].fma(n[1], d[0] * n[0])).max(zero);
        let cosine = L::keep(bits as u16, cosine);
        let grazing = one - cosine;
        let square = grazing * grazing;
        let faded = cosine * (square * square * grazing);
        for c in 0..3 {
            let radiance = at::<L>(&pyramid.cell_radiance[c], start);
            sums[0][c] = radiance.fma(cosine, sums[0][c]);
            sums[1][c] = radiance.fma(faded, sums[1][c]);
        }
    }
    // A cell subtends 4 pi / CELLS^2, and a Lambertian surface reflects L n.i / pi.
    let scale = 4.0 / (CELLS * CELLS) as f32;
    let sums = [
        each!(C => sums[0][C].store()),
        each!(C => sums[1][C].store()),
    ];
    sums.map(|channels| channels.map(|lanes| lanes.iter().sum::<f32>() * scale))
}

#[inline(always)]
fn at<L: Lanes>(table: &[f32], start: usize) -> L {
    let lanes: &Array = table[start..start + LANES]
        .try_into()
        .expect("a whole vector");
    L::load(lanes)
}
