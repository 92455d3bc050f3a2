// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The sparse solver (section 4): blend weights at every texel, representatives over all of them.

pub mod blend;
pub mod enumerate;
pub mod exact;
mod gram;
pub mod hull;
pub mod joint;
pub mod nnls;
pub mod problem;
pub mod representatives;
mod simd;
