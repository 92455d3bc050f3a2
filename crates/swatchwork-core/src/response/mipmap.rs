// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Mip levels of a raster on the octahedral square: every level halves the last by 2x2 means, which
//! are exact area means because the map preserves area.

/// One level, with a border one texel wide so that no bilinear fetch has to wrap.
#[derive(Debug, Clone, Copy)]
pub struct Level {
    /// Index of the level's first bordered texel in the pyramid's texels.
    pub start: usize,
    /// Texels along a side, without the border.
    pub size: usize,
}

/// A texel and the one below it, RGBA in half precision: two neighbours are the four texels of a
/// bilinear fetch.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(16))]
pub struct Column(pub [[u16; 4]; 2]);

/// All levels of a raster, from the base down to a single texel.
#[derive(Debug, Clone)]
pub struct Mipmap {
    pub texels: Vec<[f32; 4]>,
    pub levels: Vec<Level>,
    /// The same levels for the vector kernels, `size + 1` rows of `size + 2` columns each: in half
    /// precision after division by `unit`. Fetches are bound by the cache, and this is half of what
    /// all four texels side by side would take, with as few loads.
    pub columns: Vec<Column>,
    pub unit: f32,
    /// Where each level's columns start, and its texels along a side.
    pub start: [i32; 16],
    pub side: [f32; 16],
}

impl Mipmap {
    /// Builds the levels of area means `raster` [size, size], size a power of two of at most 2^15.
    pub fn new(mut raster: Vec<[f32; 3]>, size: usize) -> Self {
        let mut mipmap = Self {
            texels: Vec::new(),
            levels: Vec::new(),
            columns: Vec::new(),
            unit: 1.0,
            start: [0; 16],
            side: [0.0; 16],
        };
        let mut side = size;
        loop {
            mipmap.levels.push(Level {
                start: mipmap.texels.len(),
                size: side,
            });
            mipmap
                .texels
                .extend(bordered(&sharpened(&raster, side), side));
            if side == 1 {
                break;
            }
            raster = halved(&raster, side);
            side /= 2;
        }
        mipmap.pack_columns();
        mipmap
    }

    /// Texels along a side of the base.
    pub fn size(&self) -> usize {
        self.levels[0].size
    }

    /// Packs the levels into columns. A power of two brings the brightest texel just below 2^15, so
    /// that half precision keeps eleven bits down to 2^-29 of it.
    fn pack_columns(&mut self) {
        let brightest = self.texels.iter().flatten().fold(0.0f32, |m, &v| m.max(v));
        if brightest > 0.0 {
            self.unit = (brightest.log2().ceil() - 15.0).clamp(-126.0, 126.0).exp2();
        }
        let packed = |t: &[f32; 4]| t.map(|v| half_from_single(v / self.unit));
        for (at, level) in self.levels.iter().enumerate() {
            self.start[at] = self.columns.len() as i32;
            self.side[at] = level.size as f32;
            let stride = level.size + 2;
            let texels = &self.texels[level.start..level.start + stride * stride];
            let below = &texels[stride..];
            let columns = texels.iter().zip(below);
            self.columns
                .extend(columns.map(|(upper, lower)| Column([packed(upper), packed(lower)])));
        }
    }
}

/// Nearest half-precision number of a value within 65504 of zero, ties to even.
fn half_from_single(v: f32) -> u16 {
    let sign = ((v.to_bits() >> 16) & 0x8000) as u16;
    let v = v.abs();
    if v < 2.0f32.powi(-14) {
        return sign | (v * 2.0f32.powi(24)).round_ties_even() as u16;
    }
    let bits = v.to_bits();
    let rounded = bits + 0xfff + ((bits >> 13) & 1);
    sign | ((rounded >> 13) - (112 << 10)) as u16
}

/// 2x2 means of a raster of even side, in double precision per texel.
pub fn halved(raster: &[[f32; 3]], side: usize) -> Vec<[f32; 3]> {
    let half = side / 2;
    let mut out = Vec::with_capacity(half * half);
    for j in 0..half {
        for i in 0..half {
            let at = 2 * j * side + 2 * i;
            let four = [at, at + 1, at + side, at + side + 1];
            out.push([0, 1, 2].map(|c| 0.25 * four.iter().map(|&k| raster[k][c]).sum::<f32>()));
        }
    }
    out
}

/// A level with its border: across an edge of the square the sphere goes on at the mirrored place of
/// the same edge, and all four corners are the lower pole.
fn bordered(raster: &[[f32; 3]], side: usize) -> Vec<[f32; 4]> {
    let n = side as isize;
    let mut texels = Vec::with_capacity((side + 2) * (side + 2));
    for j in -1..=n {
        for i in -1..=n {
            let (mut p, mut q) = (i, j);
            if p < 0 || p >= n {
                (p, q) = (p.clamp(0, n - 1), n - 1 - q);
            }
            if q < 0 || q >= n {
                (p, q) = (n - 1 - p, q.clamp(0, n - 1));
            }
            let [r, g, b] = raster[q as usize * side + p as usize];
            texels.push([r, g, b, 0.0]);
        }
    }
    texels
}

/// Texels whose bilinear interpolation has the area means `raster`: interpolating the means themselves
/// would blur them once more. Two steps of the fixed-point iteration take the error of a mirror-like
/// lobe from 4 % to 0.1 %. A texel beside a bright window may fall below 0; clipping it would add
/// light, as much as half of a window's in the coarse levels.
fn sharpened(raster: &[[f32; 3]], side: usize) -> Vec<[f32; 3]> {
    let mut texels = raster.to_vec();
    for _ in 0..2 {
        let means = means_of_interpolant(&texels, side);
        for ((texel, target), mean) in texels.iter_mut().zip(raster).zip(&means) {
            for c in 0..3 {
                texel[c] += target[c] - mean[c];
            }
        }
    }
    texels
}

/// Area means of the bilinear interpolant: weights 1/8, 6/8, 1/8 along either axis.
fn means_of_interpolant(raster: &[[f32; 3]], side: usize) -> Vec<[f32; 3]> {
    let (padded, stride) = (bordered(raster, side), side + 2);
    let mix = |a: f32, b: f32, c: f32| 0.125 * (a + c) + 0.75 * b;
    let rows: Vec<[f32; 3]> = (0..side * stride)
        .map(|k| {
            [0, 1, 2].map(|c| {
                mix(
                    padded[k][c],
                    padded[k + stride][c],
                    padded[k + 2 * stride][c],
                )
            })
        })
        .collect();
    (0..side * side)
        .map(|k| k / side * stride + k % side)
        .map(|k| [0, 1, 2].map(|c| mix(rows[k][c], rows[k + 1][c], rows[k + 2][c])))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::octahedral::direction_from_square;
    use super::*;

    #[test]
    fn levels_keep_the_mean() {
        let raster: Vec<[f32; 3]> = (0..32 * 32)
            .map(|k| [(k * 7919 % 101) as f32, 1.0, 0.0])
            .collect();
        let mean = raster.iter().map(|v| v[0]).sum::<f32>() / 1024.0;
        let mipmap = Mipmap::new(raster, 32);
        assert_eq!(mipmap.levels.len(), 6);
        for level in &mipmap.levels {
            let stride = level.size + 2;
            let inside = |k: usize| k / level.size * stride + k % level.size + stride + 1;
            let sum: f32 = (0..level.size.pow(2))
                .map(|k| mipmap.texels[level.start + inside(k)][0])
                .sum();
            // Rounding of a thousand single-precision terms of about 50.
            assert!((sum / level.size.pow(2) as f32 - mean).abs() < 1e-2);
        }
    }

    #[test]
    fn border_continues_on_the_sphere() {
        // A smooth function of direction must not jump across the border: the texel outside an
        // edge is a neighbour on the sphere of the texel inside it.
        let size = 64;
        let at = |k: usize| (k as f32 + 0.5) / size as f32;
        let raster: Vec<[f32; 3]> = (0..size * size)
            .map(|k| direction_from_square([at(k % size), at(k / size)]))
            .collect();
        let texels = bordered(&raster, size);
        let stride = size + 2;
        for k in 1..=size {
            for (inside, outside) in [
                (k * stride + 1, k * stride),
                (k * stride + size, k * stride + size + 1),
                (stride + k, k),
                (size * stride + k, (size + 1) * stride + k),
            ] {
                for c in 0..3 {
                    let jump = texels[inside][c] - texels[outside][c];
                    // A texel is 0.055 across, and up to twice that where the map stretches.
                    assert!(jump.abs() < 0.12, "{jump}");
                }
            }
        }
    }

    #[test]
    fn half_precision_rounds_to_nearest() {
        let pairs = [
            (0.0, 0),
            (1.0, 0x3c00),
            (32768.0, 0x7800),
            (5.960_464_5e-8, 1),
            (0.1, 0x2e66),
            (-1.0, 0xbc00),
        ];
        for (v, bits) in pairs {
            assert_eq!(half_from_single(v), bits, "{v}");
        }
    }
}
