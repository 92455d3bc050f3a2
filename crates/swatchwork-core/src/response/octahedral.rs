// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The equal-area octahedral map of the sphere onto the unit square (Clarberg 2008), z up in the
//! middle. This plain version builds tables; the kernels use the vector version in `block`.

use std::f32::consts::FRAC_2_PI;

/// Cells along a side of the sky masks, and of the level that diffuse kernels integrate.
pub const CELLS: usize = 64;

/// Point of the unit square for a unit direction.
pub fn square_from_direction(d: [f32; 3]) -> [f32; 2] {
    let [x, y, z] = d.map(f32::abs);
    let r = (1.0 - z).max(0.0).sqrt();
    let mut b = y.atan2(x) * FRAC_2_PI * r;
    let mut a = r - b;
    if d[2] < 0.0 {
        (a, b) = (1.0 - b, 1.0 - a);
    }
    let signed = |v: f32, sign: f32| if sign < 0.0 { -v } else { v };
    [0.5 * (signed(a, d[0]) + 1.0), 0.5 * (signed(b, d[1]) + 1.0)]
}

/// Unit direction of a point of the unit square.
pub fn direction_from_square(square: [f32; 2]) -> [f32; 3] {
    let [a, b] = square.map(|v| f64::from(v) * 2.0 - 1.0);
    // Fold the lower hemisphere's corner triangles back onto the upper diamond.
    let lower = a.abs() + b.abs() > 1.0;
    let (p, q) = if lower {
        (1.0 - b.abs(), 1.0 - a.abs())
    } else {
        (a.abs(), b.abs())
    };
    let r = p + q;
    let z = 1.0 - r * r;
    let phi = if r > 0.0 {
        q / r * std::f64::consts::FRAC_PI_2
    } else {
        0.0
    };
    let s = (1.0 - z * z).max(0.0).sqrt();
    let (x, y) = (s * phi.cos(), s * phi.sin());
    [
        x.copysign(a) as f32,
        y.copysign(b) as f32,
        if lower { -z } else { z } as f32,
    ]
}

/// A number of a direction's place on the square whose neighbours are near on the square: ten bits of
/// the column and of the row in turn.
pub fn morton(direction: [f32; 3]) -> u32 {
    let spread = |s: f32| {
        let v = ((s * 1024.0) as u32).min(1023);
        let v = (v | v << 8) & 0x00ff_00ff;
        let v = (v | v << 4) & 0x0f0f_0f0f;
        let v = (v | v << 2) & 0x3333_3333;
        (v | v << 1) & 0x5555_5555
    };
    let [column, row] = square_from_direction(direction).map(spread);
    column | row << 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trips_over_the_whole_sphere() {
        for j in 0..37 {
            for i in 0..37 {
                let square = [(i as f32 + 0.5) / 37.0, (j as f32 + 0.5) / 37.0];
                let d = direction_from_square(square);
                let back = square_from_direction(d);
                let length = d.iter().map(|v| v * v).sum::<f32>();
                assert!((length - 1.0).abs() < 1e-6);
                // f32 loses half its digits of 1 - |z| next to the poles.
                assert!((back[0] - square[0]).abs() < 2e-4, "{square:?} {back:?}");
                assert!((back[1] - square[1]).abs() < 2e-4, "{square:?} {back:?}");
            }
        }
    }
}
