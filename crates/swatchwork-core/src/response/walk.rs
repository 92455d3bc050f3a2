// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The order in which a task walks its pairs. Lookups are bound by the cache, and those of two pairs
//! fall on the same lines where both mirror the same direction. Callers' pairs follow one another by
//! texel, with the views of each in turn; so a task walks them by mirrored direction.

use super::octahedral::morton;
use super::run::Pairs;

/// A pair on the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stop {
    /// Which pair.
    pub pair: usize,
    /// Which of the walk's texels: pairs that follow one another share it with normal and mask.
    pub texel: usize,
}

/// All pairs of a task.
pub struct Walk {
    pub first: usize,
    pub stops: Vec<Stop>,
    /// Number of texels.
    pub texels: usize,
}

impl Walk {
    /// The walk over `count` pairs from `first`, at least one.
    pub fn new(pairs: &Pairs, first: usize, count: usize) -> Self {
        let mut texel = 0;
        let mut stops: Vec<(u32, Stop)> = (first..first + count)
            .map(|pair| {
                let same = |last: usize| {
                    pairs.normal[pair] == pairs.normal[last]
                        && pairs.sky_row[pair] == pairs.sky_row[last]
                };
                if pair > first && !same(pair - 1) {
                    texel += 1;
                }
                let key = morton(mirrored(pairs.normal[pair], pairs.to_viewer[pair]));
                (key, Stop { pair, texel })
            })
            .collect();
        stops.sort_unstable_by_key(|&(key, stop)| (key, stop.pair));
        Self {
            first,
            stops: stops.into_iter().map(|(_, stop)| stop).collect(),
            texels: texel + 1,
        }
    }
}

fn mirrored(n: [f32; 3], o: [f32; 3]) -> [f32; 3] {
    let twice = 2.0 * (n[0] * o[0] + n[1] * o[1] + n[2] * o[2]);
    [0, 1, 2].map(|c| twice * n[c] - o[c])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visits_every_pair_once_and_knows_its_texel() {
        let (up, along) = ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
        let pairs = Pairs {
            normal: &[up, up, up, along, along, up],
            to_viewer: &[along, up, along, up, along, up],
            sky_row: &[-1, -1, 0, 0, 0, 0],
            sky: &[u64::MAX; 64],
        };
        let walk = Walk::new(&pairs, 1, 5);
        let mut stops = walk.stops.clone();
        stops.sort_unstable_by_key(|stop| stop.pair);
        let found: Vec<_> = stops.iter().map(|stop| (stop.pair, stop.texel)).collect();
        assert_eq!(found, [(1, 0), (2, 1), (3, 2), (4, 2), (5, 3)]);
        assert_eq!((walk.first, walk.texels), (1, 4));
        // Pairs 1 and 5 both mirror the zenith.
        let at = |pair| {
            walk.stops
                .iter()
                .position(|stop| stop.pair == pair)
                .unwrap()
        };
        assert_eq!(at(1).abs_diff(at(5)), 1);
    }
}
