// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The brightest spots of an environment as point lights. A few texels of a real probe may carry half
//! its light; no affordable set of lookups catches them evenly, but a broad lobe hardly changes over
//! them. So broad lobes look up what is left, and sum over the lights.

use super::octahedral::{CELLS, direction_from_square, morton};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A point light at infinity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// Unit direction to it, the centroid of its texels.
    pub direction: [f32; 3],
    /// Radiance times solid angle.
    pub power: [f32; 3],
    /// Row and column of the sky-mask cell that it lies in.
    pub cell: [usize; 2],
}

/// Sums over a square of texels: power (3), luminance-weighted direction (3), luminance.
type Moments = [f64; 7];

/// A square of texels that may become one light, or be cut in four.
struct Square {
    /// Power times squared angular spread: what replacing it by a point gets wrong.
    error: f64,
    level: usize,
    at: [usize; 2],
}

impl Ord for Square {
    fn cmp(&self, other: &Self) -> Ordering {
        // Positions break ties, so that the cut does not depend on the heap's order.
        let error = self.error.total_cmp(&other.error);
        error
            .then(other.level.cmp(&self.level))
            .then(other.at.cmp(&self.at))
    }
}

impl PartialOrd for Square {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Square {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Square {}

/// Splits a raster [size, size] into what is at most `threshold` bright (as the mean of its channels)
/// and lights that carry the rest: a light a sky-mask cell, then those cut in four whose spread
/// matters most, until there are `most`.
pub fn without_lights(
    raster: &[[f32; 3]],
    size: usize,
    threshold: f32,
    most: usize,
) -> (Vec<[f32; 3]>, Vec<Light>) {
    let excess = |v: &[f32; 3]| {
        let brightness = (v[0] + v[1] + v[2]) / 3.0;
        if brightness > threshold {
            1.0 - threshold / brightness
        } else {
            0.0
        }
    };
    let rest = raster
        .iter()
        .map(|v| v.map(|x| x * (1.0 - excess(v))))
        .collect();
    if size < CELLS || raster.iter().all(|v| excess(v) == 0.0) {
        return (raster.to_vec(), Vec::new());
    }
    let levels = moments(raster, size, excess);
    let coarsest = levels.len() - 1;
    let square = |level: usize, at: [usize; 2]| {
        let m = &levels[level][at[0] * (size >> level) + at[1]];
        let length = (m[3] * m[3] + m[4] * m[4] + m[5] * m[5]).sqrt();
        (m[6] > 0.0).then(|| Square {
            error: (m[6] - length).max(0.0),
            level,
            at,
        })
    };
    let mut heap: BinaryHeap<Square> = (0..CELLS * CELLS)
        .filter_map(|k| square(coarsest, [k / CELLS, k % CELLS]))
        .collect();
    let mut done = Vec::new();
    while heap.len() + done.len() < most {
        let Some(largest) = heap.pop() else { break };
        if largest.level == 0 {
            done.push(largest);
            continue;
        }
        let [j, i] = largest.at;
        for at in [
            [2 * j, 2 * i],
            [2 * j, 2 * i + 1],
            [2 * j + 1, 2 * i],
            [2 * j + 1, 2 * i + 1],
        ] {
            heap.extend(square(largest.level - 1, at));
        }
    }
    done.extend(heap.into_sorted_vec());
    let light = |square: &Square| {
        let m = &levels[square.level][square.at[0] * (size >> square.level) + square.at[1]];
        let length = (m[3] * m[3] + m[4] * m[4] + m[5] * m[5]).sqrt();
        Light {
            direction: [3, 4, 5].map(|k| (m[k] / length) as f32),
            power: [0, 1, 2].map(|k| m[k] as f32),
            cell: square.at.map(|k| k >> (coarsest - square.level)),
        }
    };
    // Neighbours on the sky follow one another, so that they fall into the same bins of a pair.
    let mut lights: Vec<Light> = done.iter().map(light).collect();
    lights.sort_by_cached_key(|light| morton(light.direction));
    (rest, lights)
}

/// Moments of the excess light, from the raster's own squares to those of the sky masks.
fn moments(
    raster: &[[f32; 3]],
    size: usize,
    excess: impl Fn(&[f32; 3]) -> f32,
) -> Vec<Vec<Moments>> {
    let solid_angle = 4.0 * std::f64::consts::PI / (size * size) as f64;
    let centre = |k: usize| (k as f32 + 0.5) / size as f32;
    let mut level: Vec<Moments> = vec![[0.0; 7]; size * size];
    for (k, v) in raster.iter().enumerate().filter(|(_, v)| excess(v) > 0.0) {
        let power = v.map(|x| f64::from(x * excess(v)) * solid_angle);
        let weight = power.iter().sum::<f64>();
        let d = direction_from_square([centre(k % size), centre(k / size)]);
        let d = d.map(|x| f64::from(x) * weight);
        level[k] = [power[0], power[1], power[2], d[0], d[1], d[2], weight];
    }
    let (mut levels, mut side) = (vec![level], size);
    while side > CELLS {
        let (fine, half) = (&levels[levels.len() - 1], side / 2);
        let sum = |k: usize| {
            let at = 2 * (k / half) * side + 2 * (k % half);
            let four = [at, at + 1, at + side, at + side + 1];
            std::array::from_fn(|m| four.iter().map(|&q| fine[q][m]).sum())
        };
        levels.push((0..half * half).map(sum).collect());
        side = half;
    }
    levels
}
