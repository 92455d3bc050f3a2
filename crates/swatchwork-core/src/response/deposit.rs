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

/// Eight of the numbers that a pair keeps in a bin: entry k of them all is channel k / P and plane k % P,
/// where P is the number of planes, rounded up.
pub type Part = [f32; 8];

/// Adds to the light bins of `means`: for every masking, Fresnel term and bin the sum over lights of
/// V G F power / (4 o.n), shared linearly between the two bins around log tan(alpha). Where an
/// environment has no lights, the means keep their 0.
#[inline(always)]
pub fn light_means<L: Lanes>(
    basis: &Basis,
    pyramid: &Pyramid,
    frames: &Frames,
    sky: &Sky,
    scratch: &mut Vec<Part>,
    means: &mut [Array],
) {
    let (planes, bins) = (basis.planes(), basis.light_bins.count);
    if planes == 0 || bins == 0 {
        return;
    }
    for (set, lights) in pyramid.lights.iter().enumerate() {
        if lights.is_empty() {
            continue;
        }
        let bins = Bins::<L>::new(basis, frames, sky);
        match planes {
            1..=2 => bins.fill::<2, 1, 1>(lights, set, scratch, means),
            3..=8 => bins.fill::<8, 1, 3>(lights, set, scratch, means),
            _ => bins.fill::<16, 2, 6>(lights, set, scratch, means),
        }
    }
}

/// What all lights of a block share.
struct Bins<'a, L> {
    basis: &'a Basis,
    frames: &'a Frames,
    sky: &'a Sky<'a>,
    /// Offset and factor that make a squared tangent's logarithm a bin.
    mapping: [f32; 2],
    shadows: [Shadow<L>; MOST_MASKINGS],
    /// live / (4 o.n).
    reflected: L,
}

impl<'a, L: Lanes> Bins<'a, L> {
    #[inline(always)]
    fn new(basis: &'a Basis, frames: &'a Frames, sky: &'a Sky<'a>) -> Self {
        let oz = L::load(&frames.cosine);
        let mut shadows = [Shadow::VGroove; MOST_MASKINGS];
        for (shadow, &masking) in shadows.iter_mut().zip(&basis.maskings) {
            *shadow = Shadow::new(masking, oz);
        }
        Self {
            basis,
            frames,
            sky,
            mapping: basis.light_bins.mapping(),
            shadows,
            reflected: L::load(&frames.live) / (L::splat(4.0) * oz),
        }
    }

    /// Sums over one set of lights. An entry of a bin is V parts: channel by P planes, whose shares are
    /// B different parts.
    #[inline(always)]
    fn fill<const P: usize, const B: usize, const V: usize>(
        &self,
        lights: &[Light],
        set: usize,
        scratch: &mut Vec<Part>,
        means: &mut [Array],
    ) {
        let (basis, bins) = (self.basis, self.basis.light_bins.count);
        scratch.clear();
        scratch.resize(LANES * bins * V, [0.0; 8]);
        let (sums, _) = scratch.as_chunks_mut::<V>();
        for light in lights {
            self.deposit::<P, B, V>(light, sums);
        }
        let first = basis.rings.len() + set * bins;
        for bin in 0..bins {
            for v in 0..V {
                let lanes = std::array::from_fn(|lane| sums[lane * bins + bin][v]);
                let rows = L::from_lanes(&lanes);
                for (row, k) in rows.into_iter().zip(8 * v..) {
                    let (c, plane) = (k / P, k % P);
                    if c < 3 && plane < basis.planes() {
                        let at = basis.plane_start(plane) + first + bin;
                        means[3 * at + c] = row.store();
                    }
                }
            }
        }
    }

    /// One light, all lanes.
    #[inline(always)]
    fn deposit<const P: usize, const B: usize, const V: usize>(
        &self,
        light: &Light,
        sums: &mut [[Part; V]],
    ) {
        let Self { basis, frames, .. } = self;
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let d = each!(C => L::splat(light.direction[C]));
        let [x, z] = [&frames.x, &frames.z];
        let in_ = d[2].fma(
            L::load(&z[2]),
            d[1].fma(L::load(&z[1]), d[0] * L::load(&z[0])),
        );
        if !in_.any_positive() {
            return;
        }
        let mut lit = in_.positive(self.reflected, zero);
        if self.sky.masked {
            let [row, column] = light.cell.map(|k| (k as f32 + 0.5) / CELLS as f32);
            lit = lit * L::visible(self.sky, L::splat(column), L::splat(row));
        }
        if !lit.any_positive() {
            return;
        }
        let along_x = d[2].fma(
            L::load(&x[2]),
            d[1].fma(L::load(&x[1]), d[0] * L::load(&x[0])),
        );
        let (ox, oz) = (L::load(&frames.sine), L::load(&frames.cosine));
        // 2 (o.h)^2 = 1 + i.o, and 2 (o.h) (n.h) = n.i + n.o.
        let twice = (one + ox.fma(along_x, oz * in_)).max(L::splat(2e-12));
        let oh = (L::splat(0.5) * twice).sqrt();
        let sum = in_ + oz;
        let both = sum * sum;
        let square = ((twice + twice) - both).max(L::splat(1e-12) * both) / both;
        let rise = one - oh;
        let mut share = [zero; PLANES];
        for (g, shadow) in self.shadows[..basis.maskings.len()].iter().enumerate() {
            let value = shadow.beside_light(in_, oz, twice) * lit;
            for (f, &exponent) in basis.fresnel.iter().enumerate() {
                share[basis.fresnel.len() * g + f] = value * power(rise, exponent);
            }
        }
        let mut parts = [[[0.0; 8]; LANES]; B];
        for (b, part) in parts.iter_mut().enumerate() {
            let mut rows = [zero; 8];
            for (r, row) in rows.iter_mut().enumerate() {
                *row = share[(8 * b + r) % P];
            }
            *part = L::by_lane(rows);
        }
        let mut colour = [[0.0; 8]; V];
        for (k, value) in colour.as_flattened_mut().iter_mut().enumerate() {
            *value = light.power.get(k / P).copied().unwrap_or(0.0);
        }
        let (lit, mut at) = (lit.store(), square.store());
        let [offset, factor] = self.mapping;
        for v in &mut at {
            *v = ((log2(*v) - offset) * factor).max(0.0);
        }
        let bins = basis.light_bins.count;
        for lane in 0..LANES {
            if lit[lane] == 0.0 || at[lane] >= (bins - 1) as f32 {
                continue;
            }
            let bin = at[lane] as usize;
            let upper = at[lane] - bin as f32;
            let [low, high] = &mut sums[lane * bins + bin..][..2] else {
                unreachable!("a slice of two")
            };
            for v in 0..V {
                for k in 0..8 {
                    let value = parts[v % B][lane][k] * colour[v][k];
                    let above = value * upper;
                    low[v][k] += value - above;
                    high[v][k] += above;
                }
            }
        }
    }
}
