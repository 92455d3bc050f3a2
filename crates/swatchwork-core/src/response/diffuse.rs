// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Cosine integrals of the visible sky, for the diffuse kernels: lanes run over the cells of the
//! sky masks, at whose resolution the mask is exact and the radiance an area mean.

use super::lanes::{Array, LANES, Lanes};
use super::pyramid::{CELLS, Pyramid};

/// E0 and E1, three channels each: integrals over the visible hemisphere of L n.i / pi, and of the
/// same times (1 - n.i)^5. `mask` has a word a row of cells; bit 1 is visible sky.
#[inline(always)]
pub fn cosine_integrals<L: Lanes>(
    pyramid: &Pyramid,
    normal: [f32; 3],
    mask: Option<&[u64]>,
) -> [[f32; 3]; 2] {
    let n = normal.map(L::splat);
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let mut sums = [[zero; 3]; 2];
    for start in (0..CELLS * CELLS).step_by(LANES) {
        let at = |table: &[f32]| {
            let lanes: &Array = table[start..start + LANES]
                .try_into()
                .expect("a whole vector");
            L::load(lanes)
        };
        let bits = mask.map_or(u64::MAX, |words| words[start / CELLS] >> (start % CELLS));
        let d = [0, 1, 2].map(|c| at(&pyramid.cell_direction[c]));
        let cosine = d[2].fma(n[2], d[1].fma(n[1], d[0] * n[0])).max(zero);
        let cosine = L::keep(bits as u16, cosine);
        let grazing = one - cosine;
        let square = grazing * grazing;
        let faded = cosine * (square * square * grazing);
        for c in 0..3 {
            let radiance = at(&pyramid.cell_radiance[c]);
            sums[0][c] = radiance.fma(cosine, sums[0][c]);
            sums[1][c] = radiance.fma(faded, sums[1][c]);
        }
    }
    // A cell subtends 4 pi / CELLS^2, and a Lambertian surface reflects L n.i / pi.
    let scale = 4.0 / (CELLS * CELLS) as f32;
    sums.map(|sum| sum.map(|lanes| lanes.store().iter().sum::<f32>() * scale))
}
