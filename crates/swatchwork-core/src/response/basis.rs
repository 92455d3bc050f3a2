// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! What the operator integrates: rings of half-vectors, masking terms, and the kernels as rows over
//! ring means (specular) and over cosine integrals (diffuse).

/// A ring of half-vectors about the normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ring {
    /// Tangent of the angle between half-vector and normal.
    pub tangent: f32,
    /// Samples on the ring, even: they come in pairs mirrored in the plane of normal and viewer.
    pub azimuths: u32,
    /// Solid angle of one sample's part of the half-vector sphere; it sets the pyramid level.
    pub solid_angle: f32,
}

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

/// One specular kernel: weights over the ring means of one plane.
#[derive(Debug, Clone, PartialEq)]
pub struct SpecularRow {
    /// Masking times 2, plus 1 for tau = 1 (Eq. 11).
    pub plane: usize,
    /// Probability that the kernel's half-vector falls on each ring.
    pub weights: Vec<f32>,
}

/// One diffuse kernel: coefficients of E0, E0 f, E1 and E1 f, with f = (1 - o.n)^5,
/// E0 = integral of V L n.i / pi, and E1 the same times (1 - n.i)^5.
pub type DiffuseRow = [f32; 4];

/// A set of generic kernels, specular ones first.
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    pub(super) rings: Vec<Ring>,
    /// Tangential part (x, y >= 0) of the half-vectors, ring after ring; each stands for (x, -y) too.
    pub(super) tangential: Vec<[f32; 2]>,
    pub(super) maskings: Vec<Masking>,
    pub(super) specular: Vec<SpecularRow>,
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

/// Why a basis cannot be used; the message names the part at fault.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BasisError(pub String);

impl Basis {
    /// Checks and keeps a set of kernels.
    pub fn new(
        rings: Vec<Ring>,
        maskings: Vec<Masking>,
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
            if ring.azimuths == 0 || ring.azimuths % 2 == 1 {
                return Err(BasisError(format!(
                    "ring {r} has {} azimuths; expected an even number",
                    ring.azimuths
                )));
            }
        }
        if maskings.len() > MOST_MASKINGS {
            return Err(BasisError(format!(
                "{} masking terms; at most {MOST_MASKINGS}",
                maskings.len()
            )));
        }
        for (j, row) in specular.iter().enumerate() {
            if row.plane >= 2 * maskings.len() {
                return Err(BasisError(format!(
                    "kernel {j} uses plane {} of {}",
                    row.plane,
                    2 * maskings.len()
                )));
            }
            if row.weights.len() != rings.len() || row.weights.iter().any(|w| !w.is_finite()) {
                return Err(BasisError(format!(
                    "kernel {j} needs {} finite ring weights",
                    rings.len()
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
            rings,
            maskings,
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

    /// Length of the vector of means a pair and channel is reduced to: planes by rings, then E0, E0 f, E1, E1 f.
    pub(super) fn means(&self) -> usize {
        2 * self.maskings.len() * self.rings.len() + 4
    }

    /// Index of a plane's first ring in the vector of means.
    pub(super) fn plane_start(&self, plane: usize) -> usize {
        plane * self.rings.len()
    }
}
