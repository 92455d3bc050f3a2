// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! What point lights add to a block of pairs. A light's half-vector is known, so its share of a lobe
//! is D at that half-vector; it is kept by tan(alpha), so that all roughnesses share the work again.

use super::basis::{Basis, MOST_MASKINGS, MOST_POWERS, log2};
use super::block::{Frames, Shadow, power};
use super::lanes::{Array, LANES, Lanes, Sky, each};
use super::lights::Light;
use super::octahedral::CELLS;
use super::pyramid::Pyramid;

/// Most planes, masking by Fresnel term.
const PLANES: usize = MOST_POWERS * MOST_MASKINGS;

/// Adds to the light bins of `means`: for every masking, Fresnel term and bin the sum over lights of
/// V G F power / (4 o.n), shared linearly between the two bins around log tan(alpha).
#[inline(always)]
pub fn light_means<L: Lanes>(
    basis: &Basis,
    pyramid: &Pyramid,
    frames: &Frames,
    sky: &Sky,
    scratch: &mut Vec<[f32; 4]>,
    means: &mut [Array],
) {
    let (planes, bins) = (basis.planes(), basis.light_bins.count);
    if planes == 0 || bins == 0 {
        return;
    }
    let mapping = basis.light_bins.mapping();
    for (set, lights) in pyramid.lights.iter().enumerate() {
        scratch.clear();
        scratch.resize(LANES * bins * planes, [0.0; 4]);
        for light in lights {
            deposit::<L>(basis, mapping, light, frames, sky, scratch);
        }
        for plane in 0..planes {
            let start = basis.plane_start(plane) + basis.rings.len() + set * bins;
            for bin in 0..bins {
                for c in 0..3 {
                    let mean = &mut means[3 * (start + bin) + c];
                    for lane in 0..LANES {
                        mean[lane] = scratch[(lane * bins + bin) * planes + plane][c];
                    }
                }
            }
        }
    }
}

/// One light, all lanes.
#[inline(always)]
fn deposit<L: Lanes>(
    basis: &Basis,
    [offset, factor]: [f32; 2],
    light: &Light,
    frames: &Frames,
    sky: &Sky,
    sums: &mut [[f32; 4]],
) {
    let (zero, one, half) = (L::splat(0.0), L::splat(1.0), L::splat(0.5));
    let d = each!(C => L::splat(light.direction[C]));
    let [x, z] = [&frames.x, &frames.z];
    let along_x = d[2].fma(
        L::load(&x[2]),
        d[1].fma(L::load(&x[1]), d[0] * L::load(&x[0])),
    );
    let in_ = d[2].fma(
        L::load(&z[2]),
        d[1].fma(L::load(&z[1]), d[0] * L::load(&z[0])),
    );
    if !in_.any_positive() {
        return;
    }
    let (ox, oz) = (L::load(&frames.sine), L::load(&frames.cosine));
    let io = ox.fma(along_x, oz * in_);
    let oh = (half * (one + io)).max(L::splat(1e-6)).sqrt();
    let hn = (in_ + oz) / (oh + oh);
    let lit = in_.positive(L::load(&frames.live), zero);
    let square = (one - hn * hn).max(L::splat(1e-12)) / (hn * hn);
    let reflected = lit / (L::splat(4.0) * oz * oh);
    let rise = one - oh;
    let planes = basis.planes();
    let mut share = [[0.0; LANES]; PLANES];
    for (g, &masking) in basis.maskings.iter().enumerate() {
        let value = Shadow::<L>::new(masking, oz).times_cosine(in_, oz, oh, hn) * reflected;
        for (f, &exponent) in basis.fresnel.iter().enumerate() {
            share[basis.fresnel.len() * g + f] = (value * power(rise, exponent)).store();
        }
    }
    let (lit, mut at) = (lit.store(), square.store());
    for v in &mut at {
        *v = ((log2(*v) - offset) * factor).max(0.0);
    }
    let [row, column] = light.cell;
    let bins = basis.light_bins.count;
    let [red, green, blue] = light.power;
    // Four wide, so that a bin and plane is one vector.
    let colour = [red, green, blue, 0.0];
    for lane in 0..LANES {
        let hidden = sky.row[lane] >= 0
            && (sky.words[sky.row[lane] as usize * CELLS + row] >> column) & 1 == 0;
        if lit[lane] == 0.0 || hidden || at[lane] >= (bins - 1) as f32 {
            continue;
        }
        let bin = at[lane] as usize;
        let upper = at[lane] - bin as f32;
        let first = (lane * bins + bin) * planes;
        let (low, high) = sums[first..first + 2 * planes].split_at_mut(planes);
        for plane in 0..planes {
            let value = share[plane][lane];
            let (a, b) = (value * (1.0 - upper), value * upper);
            for c in 0..4 {
                low[plane][c] += a * colour[c];
                high[plane][c] += b * colour[c];
            }
        }
    }
}
