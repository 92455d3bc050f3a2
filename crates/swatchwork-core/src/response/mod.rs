// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The rendering operator R_x of Eqs. 1, 13 and 14: what a camera sees of each generic kernel, or of
//! each representative, at a surface point under a distant environment with self-shadowing.
//!
//! One set of half-vectors on log-polar rings about the normal serves every roughness, because a
//! Beckmann lobe integrates over a ring in closed form: the lookups are made once a pair, and the
//! kernels are a matrix over ring means.

// Iterators over vector registers need closures, which are compiled without the target features of
// the function they are in; loops over indices are not.
#![allow(clippy::needless_range_loop)]

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod basis;
mod block;
mod deposit;
mod diffuse;
mod fold;
mod lanes;
mod lights;
mod mipmap;
mod octahedral;
mod peak;
mod pyramid;
mod run;
mod walk;

pub use basis::{Basis, BasisError, DiffuseRow, LightBins, Masking, Ring, SHAPES, SpecularRow};
pub use fold::Folded;
pub use octahedral::{direction_from_square, square_from_direction};
pub use peak::bare_lookups;
pub use pyramid::{Pyramid, PyramidError};
pub use run::{InstructionSet, Pairs, generic_responses, representative_responses};
