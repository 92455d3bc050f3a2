// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! What the operator integrates: rings of half-vectors, masking terms, and the kernels as rows over
//! ring means (specular) and over cosine integrals (diffuse).

use super::pyramid::LAYERS;
use std::ops::Range;

/// A ring of half-vectors about the normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ring {
    /// Tangent of the angle between half-vector and normal.
    pub tangent: f32,
    /// Samples on the ring, even: they come in pairs mirrored in the plane of normal and viewer.
    pub azimuths: u32,
    /// Solid angle of one sample's part of the half-vector sphere; it sets the pyramid level.
    pub solid_angle: f32,
    /// Layer of the environment that it looks up: 0 whole, 1 and 2 without ever weaker spots.
    pub layer: usize,
}

/// Where light from point lights is kept: bins of tan(alpha), a constant factor apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightBins {
    /// Tangent of the first bin; smaller ones count as this.
    pub first: f32,
    /// Factor between bins, above 1.
    pub factor: f32,
    /// Number of bins; light beyond the last is dropped.
    pub count: usize,
}

impl LightBins {
    /// Offset and scale that make a squared tangent's base-2 logarithm a fractional bin.
    pub(super) fn mapping(&self) -> [f32; 2] {
        [2.0 * self.first.log2(), 0.5 / self.factor.log2()]
    }
}

/// Base-2 logarithm of a positive number within 2e-5, in operations that vectorise.
#[inline(always)]
pub(super) fn log2(v: f32) -> f32 {
    let bits = v.to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let m = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000) - 1.0;
    let mut p = LOG2[LOG2.len() - 1];
    for c in LOG2.iter().rev().skip(1) {
        p = p * m + c;
    }
    exponent as f32 + p * m
}

const LOG2: [f32; 5] = [
    1.441_917,
    -0.709_096_4,
    0.415_605_9,
    -0.193_575_53,
    0.045_148_98,
];

/// Shadowing and masking G. None depends on roughness, so that all share the lookups.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Masking {
    /// V-grooves, Eq. 10.
    VGroove,
    /// Separable Smith term of GGX with fixed alpha, G1(v) = 2 n.v / (n.v + sqrt(alpha^2 + (1 - alpha^2) (n.v)^2)).
    Smith(f32),
}

/// Most masking terms of a basis.
pub const MOST_MASKINGS: usize = 4;

/// Most Fresnel terms (1 - o.h)^p of a basis.
pub const MOST_POWERS: usize = 4;

/// One specular kernel: weights over the ring means of one plane.
#[derive(Debug, Clone, PartialEq)]
pub struct SpecularRow {
    /// Masking times the number of Fresnel terms, plus the Fresnel term.
    pub plane: usize,
    /// Probability that the kernel's half-vector falls on each ring, then D of Eq. 9 at the light bins
    /// for the lights that layer 1 leaves out, then for those that only layer 2 does.
    pub weights: Vec<f32>,
}

/// Functions of one cosine that diffuse kernels are products of (`diffuse::shapes`).
pub const SHAPES: usize = 5;

/// One diffuse kernel: pi times its BRDF is the sum of coefficient [a][b] times shape a of n.i times
/// shape b of n.o.
pub type DiffuseRow = [f32; SHAPES * SHAPES];

/// A set of generic kernels, specular ones first.
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    pub(super) rings: Vec<Ring>,
    /// Tangential part (x, y >= 0) of the half-vectors, ring after ring; each stands for (x, -y) too.
    pub(super) tangential: Vec<[f32; 2]>,
    pub(super) light_bins: LightBins,
    pub(super) maskings: Vec<Masking>,
    /// Exponents p of the Fresnel terms (1 - o.h)^p.
    pub(super) fresnel: Vec<u32>,
    pub(super) specular: Vec<SpecularRow>,
    /// Where each specular row is not 0, as ranges of its weights.
    pub(super) runs: Vec<Vec<Range<usize>>>,
    pub(super) diffuse: Vec<DiffuseRow>,
}

/// Samples of one half of a ring, at the middles of its parts.
fn half_ring(ring: &Ring) -> impl Iterator<Item = [f32; 2]> + use<> {
    let (t, count) = (f64::from(ring.tangent), ring.azimuths);
    let sine = t / (1.0 + t * t).sqrt();
    (0..count / 2).map(move |j| {
        let phi = (f64::from(j) + 0.5) * 2.0 * std::f64::consts::PI / f64::from(count);
        [(sine * phi.cos()) as f32, (sine * phi.sin()) as f32]
    })
}

/// Ranges of what is not negligible beside a row's largest weight.
pub(super) fn runs(weights: &[f32]) -> Vec<Range<usize>> {
    let least = 1e-9 * weights.iter().fold(0.0f32, |m, w| m.max(w.abs()));
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (at, _) in weights.iter().enumerate().filter(|(_, w)| w.abs() > least) {
        match runs.last_mut() {
            Some(run) if run.end == at => run.end += 1,
            _ => runs.push(at..at + 1),
        }
    }
    runs
}

/// Why a basis cannot be used; the message names the part at fault.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BasisError(pub String);

impl Basis {
    /// Checks and keeps a set of kernels.
    pub fn new(
        rings: Vec<Ring>,
        light_bins: LightBins,
        maskings: Vec<Masking>,
        fresnel: Vec<u32>,
        specular: Vec<SpecularRow>,
        diffuse: Vec<DiffuseRow>,
    ) -> Result<Self, BasisError> {
        for (r, ring) in rings.iter().enumerate() {
            let positive = |v: f32| v.is_finite() && v > 0.0;
            if !positive(ring.tangent) || !positive(ring.solid_angle) {
                return Err(BasisError(format!(
                    "ring {r} has a tangent or solid angle that is not positive"
                )));
            }
            if ring.layer >= LAYERS {
                return Err(BasisError(format!(
                    "ring {r} is of layer {}; there are {LAYERS}",
                    ring.layer
                )));
            }
            if ring.azimuths == 0 || ring.azimuths % 2 == 1 {
                return Err(BasisError(format!(
                    "ring {r} has {} azimuths; expected an even number",
                    ring.azimuths
                )));
            }
        }
        if light_bins.count == 1
            || light_bins.count > 0 && !(light_bins.first > 0.0 && light_bins.factor > 1.0)
        {
            return Err(BasisError(
                "light bins need a positive start, a factor above 1, and two bins".into(),
            ));
        }
        let entries = rings.len() + (LAYERS - 1) * light_bins.count;
        if maskings.len() > MOST_MASKINGS {
            return Err(BasisError(format!(
                "{} masking terms; at most {MOST_MASKINGS}",
                maskings.len()
            )));
        }
        if fresnel.is_empty() || fresnel.len() > MOST_POWERS {
            return Err(BasisError(format!(
                "{} Fresnel terms; expected 1 to {MOST_POWERS}",
                fresnel.len()
            )));
        }
        let planes = fresnel.len() * maskings.len();
        for (j, row) in specular.iter().enumerate() {
            if row.plane >= planes {
                return Err(BasisError(format!(
                    "kernel {j} uses plane {} of {planes}",
                    row.plane
                )));
            }
            if row.weights.len() != entries || row.weights.iter().any(|w| !w.is_finite()) {
                return Err(BasisError(format!(
                    "kernel {j} needs {entries} finite weights"
                )));
            }
        }
        if diffuse.iter().flatten().any(|c| !c.is_finite()) {
            return Err(BasisError("a diffuse coefficient is not finite".into()));
        }
        if specular.is_empty() && diffuse.is_empty() {
            return Err(BasisError("there is no kernel".into()));
        }
        let tangential = rings.iter().flat_map(half_ring).collect();
        Ok(Self {
            tangential,
            runs: specular.iter().map(|row| runs(&row.weights)).collect(),
            rings,
            light_bins,
            maskings,
            fresnel,
            specular,
            diffuse,
        })
    }

    /// Number of kernels, J.
    pub fn kernels(&self) -> usize {
        self.specular.len() + self.diffuse.len()
    }

    /// Environment lookups that one pair costs.
    pub fn lookups(&self) -> usize {
        self.rings.iter().map(|r| r.azimuths as usize).sum()
    }

    /// Rings and light bins of a plane.
    fn entries(&self) -> usize {
        self.rings.len() + (LAYERS - 1) * self.light_bins.count
    }

    /// Planes of means: masking by Fresnel term.
    pub(super) fn planes(&self) -> usize {
        self.maskings.len() * self.fresnel.len()
    }

    /// Length of the vector of means a pair and channel is reduced to: planes by rings and light bins, then
    /// the cosine integrals by shape of n.i and shape of n.o.
    pub(super) fn means(&self) -> usize {
        self.planes() * self.entries() + SHAPES * SHAPES
    }

    /// Index of a plane's first ring in the vector of means.
    pub(super) fn plane_start(&self, plane: usize) -> usize {
        plane * self.entries()
    }
}
