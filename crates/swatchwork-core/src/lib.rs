// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Numerics of Swatchwork. The rendering operator (`response`) and the sparse solver (`solve`)
//! know arrays, not files or scenes; every equation number is that of Zhou et al. 2016.

pub mod response;
pub mod solve;
