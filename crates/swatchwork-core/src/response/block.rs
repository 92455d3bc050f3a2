// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Ring means of one block of pairs: sixteen pairs walk the same half-vectors, a pair a lane.

use super::basis::{Basis, Masking};
use super::lanes::{Array, LANES, Lanes, Sky};
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
            let (n, o) = (
                normal[k.min(normal.len() - 1)],
                to_viewer[k.min(normal.len() - 1)],
            );
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

/// Fills the specular part of `means` ([means, 3] lanes) of a block: for every masking, tau and
/// ring the mean over azimuth of G F (o.h) / ((o.n)(n.h)) V L(i).
#[inline(always)]
pub fn ring_means<L: Lanes>(
    basis: &Basis,
    pyramid: &Pyramid,
    frames: &Frames,
    sky: &Sky,
    means: &mut [Array],
) {
    let [x, y, z] =
        [&frames.x, &frames.y, &frames.z].map(|axis| [0, 1, 2].map(|c| L::load(&axis[c])));
    let (ox, oz) = (L::load(&frames.sine), L::load(&frames.cosine));
    let live = L::load(&frames.live);
    let (zero, one, two) = (L::splat(0.0), L::splat(1.0), L::splat(2.0));
    let texels = (pyramid.size() * pyramid.size()) as f32;
    for (r, ring) in basis.rings.iter().enumerate() {
        let cosine = 1.0 / (1.0 + ring.tangent * ring.tangent).sqrt();
        let sine = ring.tangent * cosine;
        // Texels of the base that a sample's solid angle 4 (o.h) dh covers; half a level sharper.
        let area =
            L::splat(4.0 * ring.solid_angle * texels / (4.0 * std::f32::consts::PI) * SHARPEN);
        let scale = live / (oz * L::splat(cosine * ring.azimuths as f32));
        for plane in 0..2 * basis.maskings.len() {
            let at = 3 * (basis.plane_start(plane) + r);
            means[at..at + 3].fill([0.0; LANES]);
        }
        for j in 0..ring.azimuths / 2 {
            let phi = (j as f32 + 0.5) * (2.0 * std::f32::consts::PI / ring.azimuths as f32);
            let (hx, hy, hz) = (
                L::splat(sine * phi.cos()),
                L::splat(sine * phi.sin()),
                L::splat(cosine),
            );
            let oh = ox.fma(hx, oz * hz);
            let in_ = (two * oh).fma(hz, zero - oz);
            let lit = oh.min(in_);
            if !lit.any_positive() {
                continue;
            }
            // i and its mirror image in the plane of normal and viewer share everything but the side.
            let ix = (two * oh).fma(hx, zero - ox);
            let iy = two * oh * hy;
            let middle = [0, 1, 2].map(|c| ix.fma(x[c], in_ * z[c]));
            let side = [0, 1, 2].map(|c| iy * y[c]);
            let right = radiance::<L>(
                pyramid,
                sky,
                [0, 1, 2].map(|c| middle[c] + side[c]),
                oh * area,
            );
            let left = radiance::<L>(
                pyramid,
                sky,
                [0, 1, 2].map(|c| middle[c] - side[c]),
                oh * area,
            );
            let common = lit.positive(oh * scale, zero);
            let both = [0, 1, 2].map(|c| (right[c] + left[c]) * common);
            let f = fifth_power(one - oh);
            for (g, &masking) in basis.maskings.iter().enumerate() {
                let masked = self::masking::<L>(masking, in_, oz, oh, hz);
                let at = [0, 1].map(|tau| 3 * (basis.plane_start(2 * g + tau) + r));
                for c in 0..3 {
                    let value = both[c] * masked;
                    means[at[1] + c] = (L::load(&means[at[1] + c]) + value).store();
                    means[at[0] + c] = value.fma(f, L::load(&means[at[0] + c])).store();
                }
            }
        }
    }
}

/// Half a level sharper than the sample's solid angle (measured best; a level is a factor 4 in area).
const SHARPEN: f32 = 0.5 * 2.0;

/// (1 - cosine)^5 of Schlick's term.
#[inline(always)]
pub fn fifth_power<L: Lanes>(v: L) -> L {
    let square = v * v;
    square * square * v
}

#[inline(always)]
fn masking<L: Lanes>(masking: Masking, in_: L, on: L, oh: L, hn: L) -> L {
    match masking {
        Masking::VGroove => L::splat(1.0).min(L::splat(2.0) * hn * in_.min(on) / oh),
        Masking::Smith(alpha) => {
            let (a, b) = (L::splat(alpha * alpha), L::splat(1.0 - alpha * alpha));
            let width = |v: L| v + (v * v).fma(b, a).sqrt();
            L::splat(4.0) * in_ * on / (width(in_) * width(on))
        }
    }
}

/// Visible radiance from a unit direction.
#[inline(always)]
fn radiance<L: Lanes>(pyramid: &Pyramid, sky: &Sky, d: [L; 3], area: L) -> [L; 3] {
    let [u, v] = square::<L>(d);
    let radiance = L::fetch(pyramid, u, v, area);
    if !sky.masked {
        return radiance;
    }
    let visible = L::visible(sky, u, v);
    radiance.map(|c| c * visible)
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
