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
    /// Frames of sixteen pairs, of which the first `count` count.
    pub fn new(normal: [[f32; 3]; LANES], to_viewer: [[f32; 3]; LANES], count: usize) -> Self {
        let mut frames = Self {
            x: [[0.0; LANES]; 3],
            y: [[0.0; LANES]; 3],
            z: [[0.0; LANES]; 3],
            sine: [0.0; LANES],
            cosine: [1.0; LANES],
            live: [0.0; LANES],
        };
        for k in 0..LANES {
            let (n, o) = (unit(normal[k]), unit(to_viewer[k]));
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
            frames.live[k] = if cosine > 0.0 && k < count { 1.0 } else { 0.0 };
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
    let axes = [
        each!(C => L::load(&frames.x[C])),
        each!(C => L::load(&frames.y[C])),
        each!(C => L::load(&frames.z[C])),
    ];
    let (ox, oz) = (L::load(&frames.sine), L::load(&frames.cosine));
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
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
    let mut batch = [Sample::<L>::dark(); BATCH];
    let mut halves = basis.tangential.as_slice();
    for (r, ring) in basis.rings.iter().enumerate() {
        let cosine = 1.0 / (1.0 + ring.tangent * ring.tangent).sqrt();
        let hz = L::splat(cosine);
        let mipmap = &pyramid.layers[ring.layer];
        let texels = (mipmap.size() * mipmap.size()) as f32;
        // Texels of the base that a sample's solid angle 4 (o.h) dh covers. Rounding down to a level, a
        // factor 4 in area, makes that half a level sharper on average, which was measured best.
        let area = L::splat(ring.solid_angle * texels / std::f32::consts::PI);
        let mut sums = [[[zero; 3]; F]; G];
        let (own, rest) = halves.split_at(ring.azimuths as usize / 2);
        halves = rest;
        for own in own.chunks(BATCH) {
            let mut count = 0;
            for &[hx, hy] in own {
                let h = [L::splat(hx), L::splat(hy), hz];
                if let Some(sample) = Sample::new(mipmap, [ox, oz], &axes, h, area) {
                    batch[count] = sample;
                    count += 1;
                }
            }
            for sample in &batch[..count] {
                let (oh, in_) = (sample.oh, sample.in_);
                let both = sample.radiance(mipmap, sky);
                let rise = one - oh;
                let mut fresnel = [one; F];
                for f in 0..F {
                    fresnel[f] = power(rise, exponents[f]);
                }
                for g in 0..G {
                    let (shadow, sums) = (&shadows[g], &mut sums[g]);
                    let shadowed = shadow.times_cosine(in_, oz, oh, hz);
                    let shadowed = oh.min(in_).positive(shadowed, zero);
                    for c in 0..3 {
                        let value = both[c] * shadowed;
                        for f in 0..F {
                            sums[f][c] = value.fma(fresnel[f], sums[f][c]);
                        }
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

    /// G of a light whose half-vector is not on a ring, from `twice` = 1 + i.o = 2 (o.h)^2.
    #[inline(always)]
    pub fn beside_light(&self, in_: L, on: L, twice: L) -> L {
        match *self {
            Self::VGroove => {
                let least = in_.min(on);
                L::splat(1.0).min((least + least) * (in_ + on) / twice)
            }
            Self::Smith {
                square,
                rest,
                viewer,
            } => {
                let width = in_ + (in_ * in_).fma(rest, square).sqrt();
                viewer * in_ / width
            }
        }
    }
}

/// Samples that are located before the first of them is summed: their texels come from memory
/// meanwhile.
const BATCH: usize = 4;

/// A half-vector of a ring, and where light comes from that it mirrors to the viewer.
#[derive(Clone, Copy)]
struct Sample<L: Lanes> {
    /// n.i and o.h.
    in_: L,
    oh: L,
    /// i and its mirror image in the plane of normal and viewer, as points of the square.
    square: [[L; 2]; 2],
    place: [L::Place; 2],
}

impl<L: Lanes> Sample<L> {
    /// A sample of nothing.
    #[inline(always)]
    fn dark() -> Self {
        let zero = L::splat(0.0);
        Self {
            in_: zero,
            oh: zero,
            square: [[zero; 2]; 2],
            place: [L::NOWHERE; 2],
        }
    }

    /// None where no lane is lit.
    #[inline(always)]
    fn new(
        mipmap: &Mipmap,
        [ox, oz]: [L; 2],
        [x, y, z]: &[[L; 3]; 3],
        [hx, hy, hz]: [L; 3],
        area: L,
    ) -> Option<Self> {
        let zero = L::splat(0.0);
        let oh = ox.fma(hx, oz * hz);
        let twice = oh + oh;
        let in_ = twice.fma(hz, zero - oz);
        if !oh.min(in_).any_positive() {
            return None;
        }
        // i and its image share everything but the side.
        let ix = twice.fma(hx, zero - ox);
        let iy = twice * hy;
        let middle = each!(C => ix.fma(x[C], in_ * z[C]));
        let right = square::<L>(each!(C => iy.fma(y[C], middle[C])));
        let left = square::<L>(each!(C => (zero - iy).fma(y[C], middle[C])));
        let area = oh * area;
        Some(Self {
            in_,
            oh,
            square: [right, left],
            place: [
                L::locate(mipmap, right[0], right[1], area),
                L::locate(mipmap, left[0], left[1], area),
            ],
        })
    }

    /// Visible radiance from both sides.
    #[inline(always)]
    fn radiance(&self, mipmap: &Mipmap, sky: &Sky) -> [L; 3] {
        let right = L::fetch(mipmap, &self.place[0]);
        let left = L::fetch(mipmap, &self.place[1]);
        if !sky.masked {
            return each!(C => right[C] + left[C]);
        }
        let [a, b] = self.square;
        let (a, b) = (L::visible(sky, a[0], a[1]), L::visible(sky, b[0], b[1]));
        each!(C => right[C].fma(a, left[C] * b))
    }
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
