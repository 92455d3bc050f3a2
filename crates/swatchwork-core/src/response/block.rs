// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Ring means of one block of pairs: sixteen pairs walk the same half-vectors, a pair a lane.

use super::basis::{Basis, MOST_MASKINGS, MOST_POWERS, Masking};
use super::lanes::{Array, LANES, Lanes, Sky, each};
use super::mipmap::Mipmap;
use super::pyramid::Pyramid;

/// Local frames of a block of pairs. Lanes without a pair repeat one, with `live` 0.
pub struct Frames {
    /// World components of the frame's axes: x along the viewer's tangential part, z the normal.
    pub x: [Array; 3],
    pub y: [Array; 3],
    pub z: [Array; 3],
    /// Viewer in that frame: (sine, 0, cosine).
    pub sine: Array,
    pub cosine: Array,
    /// 1 where the surface faces the viewer, else 0.
    pub live: Array,
}

impl Frames {
    /// Frames of up to sixteen pairs; short blocks are filled up with dead lanes.
    pub fn new(normal: &[[f32; 3]], to_viewer: &[[f32; 3]]) -> Self {
        let mut frames = Self {
            x: [[0.0; LANES]; 3],
            y: [[0.0; LANES]; 3],
            z: [[0.0; LANES]; 3],
            sine: [0.0; LANES],
            cosine: [1.0; LANES],
            live: [0.0; LANES],
        };
        for k in 0..LANES {
            let at = k.min(normal.len() - 1);
            let (n, o) = (unit(normal[at]), unit(to_viewer[at]));
            let cosine = dot(n, o);
            let tangential = [0, 1, 2].map(|c| o[c] - cosine * n[c]);
            let sine = dot(tangential, tangential).sqrt();
            let x = if sine > 1e-6 {
                tangential.map(|v| v / sine)
            } else {
                any_tangent(n)
            };
            let y = cross(n, x);
            for c in 0..3 {
                (frames.x[c][k], frames.y[c][k], frames.z[c][k]) = (x[c], y[c], n[c]);
            }
            frames.sine[k] = sine;
            frames.cosine[k] = cosine.max(1e-4);
            frames.live[k] = if cosine > 0.0 && k < normal.len() {
                1.0
            } else {
                0.0
            };
        }
        frames
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The direction of a vector, z for one that has none: lookups stay inside the square whatever is given.
fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = dot(v, v).sqrt();
    if length.is_finite() && length > 0.0 {
        v.map(|x| x / length)
    } else {
        [0.0, 0.0, 1.0]
    }
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn any_tangent(n: [f32; 3]) -> [f32; 3] {
    let axis = if n[0].abs() < 0.5 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let t = cross(axis, n);
    let length = dot(t, t).sqrt();
    t.map(|v| v / length)
}

/// Fills the specular part of `means` ([means, 3] lanes) of a block: for every masking, Fresnel term and
/// ring the mean over azimuth of G F (o.h) / ((o.n)(n.h)) V L(i).
#[inline(always)]
pub fn ring_means<L: Lanes>(
    basis: &Basis,
    pyramid: &Pyramid,
    frames: &Frames,
    sky: &Sky,
    means: &mut [Array],
) {
    // Sums stay in registers where their number is known.
    match (basis.maskings.len(), basis.fresnel.len()) {
        (0, _) => {}
        (1, 2) => ring_sums::<L, 1, 2>(basis, pyramid, frames, sky, means),
        (2, 3) => ring_sums::<L, 2, 3>(basis, pyramid, frames, sky, means),
        _ => ring_sums::<L, MOST_MASKINGS, MOST_POWERS>(basis, pyramid, frames, sky, means),
    }
}

#[inline(always)]
fn ring_sums<L: Lanes, const G: usize, const F: usize>(
    basis: &Basis,
    pyramid: &Pyramid,
    frames: &Frames,
    sky: &Sky,
    means: &mut [Array],
) {
    let x = each!(C => L::load(&frames.x[C]));
    let y = each!(C => L::load(&frames.y[C]));
    let z = each!(C => L::load(&frames.z[C]));
    let (ox, oz) = (L::load(&frames.sine), L::load(&frames.cosine));
    let (zero, one, two) = (L::splat(0.0), L::splat(1.0), L::splat(2.0));
    let unit = L::load(&frames.live) / oz;
    // Where a basis has fewer terms than G and F, the last are repeated and their sums not stored.
    let mut shadows = [Shadow::<L>::VGroove; G];
    for (g, shadow) in shadows.iter_mut().enumerate() {
        *shadow = Shadow::new(basis.maskings[g.min(basis.maskings.len() - 1)], oz);
    }
    let mut exponents = [0; F];
    for (f, exponent) in exponents.iter_mut().enumerate() {
        *exponent = basis.fresnel[f.min(basis.fresnel.len() - 1)];
    }
    let mut halves = basis.tangential.as_slice();
    for (r, ring) in basis.rings.iter().enumerate() {
        let cosine = 1.0 / (1.0 + ring.tangent * ring.tangent).sqrt();
        let hz = L::splat(cosine);
        let mipmap = &pyramid.layers[ring.layer];
        let texels = (mipmap.size() * mipmap.size()) as f32;
        // Texels of the base that a sample's solid angle 4 (o.h) dh covers, made sharper.
        let area = L::splat(ring.solid_angle * texels * (SHARPEN / std::f32::consts::PI));
        let mut sums = [[[zero; 3]; F]; G];
        let (own, rest) = halves.split_at(ring.azimuths as usize / 2);
        halves = rest;
        for &[hx, hy] in own {
            let (hx, hy) = (L::splat(hx), L::splat(hy));
            let oh = ox.fma(hx, oz * hz);
            let twice = two * oh;
            let in_ = twice.fma(hz, zero - oz);
            let lit = oh.min(in_);
            if !lit.any_positive() {
                continue;
            }
            // i and its mirror image in the plane of normal and viewer share everything but the side.
            let ix = twice.fma(hx, zero - ox);
            let iy = twice * hy;
            let middle = each!(C => ix.fma(x[C], in_ * z[C]));
            let right = each!(C => iy.fma(y[C], middle[C]));
            let left = each!(C => (zero - iy).fma(y[C], middle[C]));
            let right = radiance::<L>(mipmap, sky, right, oh * area);
            let left = radiance::<L>(mipmap, sky, left, oh * area);
            let both = each!(C => right[C] + left[C]);
            let rise = one - oh;
            let mut fresnel = [one; F];
            for f in 0..F {
                fresnel[f] = power(rise, exponents[f]);
            }
            for g in 0..G {
                let (shadow, sums) = (&shadows[g], &mut sums[g]);
                let shadowed = lit.positive(shadow.times_cosine(in_, oz, oh, hz), zero);
                for c in 0..3 {
                    let value = both[c] * shadowed;
                    for f in 0..F {
                        sums[f][c] = value.fma(fresnel[f], sums[f][c]);
                    }
                }
            }
        }
        let scale = unit * L::splat(L::fetch_unit(mipmap) / (cosine * ring.azimuths as f32));
        for (g, sums) in sums[..G.min(basis.maskings.len())].iter().enumerate() {
            for (f, sums) in sums[..F.min(basis.fresnel.len())].iter().enumerate() {
                let at = 3 * (basis.plane_start(basis.fresnel.len() * g + f) + r);
                for c in 0..3 {
                    means[at + c] = (sums[c] * scale).store();
                }
            }
        }
    }
}

/// How much smaller a pyramid level's texel is than a sample's solid angle, as an area: half a level
/// (measured best; a level is a factor 4). The level is rounded down, which is half a level more.
const SHARPEN: f32 = 1.0;

/// v^p; the exponents of Schlick's term and of the bases in use take the short way.
#[inline(always)]
pub fn power<L: Lanes>(v: L, p: u32) -> L {
    let square = v * v;
    match p {
        0 => L::splat(1.0),
        1 => v,
        2 => square,
        5 => square * square * v,
        _ => {
            let mut product = square;
            for _ in 2..p {
                product = product * v;
            }
            product
        }
    }
}

/// A masking term, with what depends on the viewer alone worked out.
#[derive(Clone, Copy)]
pub enum Shadow<L> {
    VGroove,
    Smith { square: L, rest: L, viewer: L },
}

impl<L: Lanes> Shadow<L> {
    #[inline(always)]
    pub fn new(masking: Masking, on: L) -> Self {
        match masking {
            Masking::VGroove => Self::VGroove,
            Masking::Smith(alpha) => {
                let (square, rest) = (L::splat(alpha * alpha), L::splat(1.0 - alpha * alpha));
                let width = on + (on * on).fma(rest, square).sqrt();
                Self::Smith {
                    square,
                    rest,
                    viewer: L::splat(4.0) * on / width,
                }
            }
        }
    }

    /// G (o.h).
    #[inline(always)]
    pub fn times_cosine(&self, in_: L, on: L, oh: L, hn: L) -> L {
        match *self {
            Self::VGroove => oh.min((hn + hn) * in_.min(on)),
            Self::Smith {
                square,
                rest,
                viewer,
            } => {
                let width = in_ + (in_ * in_).fma(rest, square).sqrt();
                oh * viewer * in_ / width
            }
        }
    }
}

/// Visible radiance from a unit direction.
#[inline(always)]
fn radiance<L: Lanes>(mipmap: &Mipmap, sky: &Sky, d: [L; 3], area: L) -> [L; 3] {
    let [u, v] = square::<L>(d);
    let radiance = L::fetch(mipmap, u, v, area);
    if !sky.masked {
        return radiance;
    }
    let visible = L::visible(sky, u, v);
    each!(C => radiance[C] * visible)
}

/// The octahedral map of `octahedral::square_from_direction`, with a polynomial arc tangent.
#[inline(always)]
fn square<L: Lanes>(d: [L; 3]) -> [L; 2] {
    let (zero, one, half) = (L::splat(0.0), L::splat(1.0), L::splat(0.5));
    let (x, y) = (d[0].abs(), d[1].abs());
    let r = (one - d[2].abs()).max(zero).sqrt();
    let steep = y - x;
    let t = x.min(y) / x.max(y).max(L::splat(1e-20));
    let turn = quarter_turns::<L>(t);
    let b = steep.positive(one - turn, turn) * r;
    let a = r - b;
    let lower = zero - d[2];
    let (a, b) = (lower.positive(one - b, a), lower.positive(one - a, b));
    [
        a.copysign(d[0]).fma(half, half),
        b.copysign(d[1]).fma(half, half),
    ]
}

/// Arc tangent of t in [0, 1] in quarter turns; a minimax polynomial, within 1.6e-7 quarter turns.
#[inline(always)]
fn quarter_turns<L: Lanes>(t: L) -> L {
    let s = t * t;
    let mut p = L::splat(ARC_TANGENT[ARC_TANGENT.len() - 1]);
    for &c in ARC_TANGENT.iter().rev().skip(1) {
        p = p.fma(s, L::splat(c));
    }
    p * t
}

const ARC_TANGENT: [f32; 7] = [
    0.636_617_3,
    -0.212_104_95,
    0.126_100_47,
    -0.084_246_05,
    0.050_689_95,
    -0.021_393_06,
    0.004_336_505,
];
