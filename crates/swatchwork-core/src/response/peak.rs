// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Bare environment lookups, the limit that responses are measured against: the address, the fetch
//! and the interpolation of given points of the square, and nothing else. Only benches call it.

#[cfg(target_arch = "x86_64")]
use super::{avx2::Avx2, avx512::Avx512};
use super::{
    lanes::{Array, LANES, Lanes, Plain, each},
    mipmap::Mipmap,
    pyramid::Pyramid,
    run::InstructionSet,
};

/// Sum of the whole environment's radiance at `points`, columns and rows of sixteen at a time, each in
/// the level whose texels have about `area` texels of the base.
pub fn bare_lookups(
    pyramid: &Pyramid,
    points: &[[[f32; LANES]; 2]],
    area: f32,
    set: InstructionSet,
) -> [f32; 3] {
    assert!(set.available(), "{set:?} is not available on this machine");
    bare(&pyramid.layers[0], points, area, set)
}

fn bare(mipmap: &Mipmap, points: &[[Array; 2]], area: f32, set: InstructionSet) -> [f32; 3] {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(
            enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c,bmi1,bmi2,popcnt"
        )]
        fn avx512(mipmap: &Mipmap, points: &[[Array; 2]], area: f32) -> [f32; 3] {
            sum::<Avx512>(mipmap, points, area)
        }
        #[target_feature(enable = "avx2,fma,f16c,bmi1,bmi2,popcnt")]
        fn avx2(mipmap: &Mipmap, points: &[[Array; 2]], area: f32) -> [f32; 3] {
            sum::<Avx2>(mipmap, points, area)
        }
        match set {
            // SAFETY: `bare_lookups` has checked that the machine has the instruction set.
            InstructionSet::Avx512 => return unsafe { avx512(mipmap, points, area) },
            InstructionSet::Avx2 => return unsafe { avx2(mipmap, points, area) },
            InstructionSet::Baseline => {}
        }
    }
    sum::<Plain>(mipmap, points, area)
}

#[inline(always)]
fn sum<L: Lanes>(mipmap: &Mipmap, points: &[[Array; 2]], area: f32) -> [f32; 3] {
    let mut sums = [L::splat(0.0); 3];
    for [u, v] in points {
        let place = L::locate(mipmap, L::load(u), L::load(v), L::splat(area));
        let radiance = L::fetch(mipmap, &place);
        sums = each!(C => sums[C] + radiance[C]);
    }
    let unit = L::splat(L::fetch_unit(mipmap));
    sums.map(|sum| (sum * unit).store().iter().sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looks_up_what_is_there() {
        // Left half 1, right half 3: a point on either side sees its own.
        let size = 64;
        let base: Vec<f32> = (0..size * size * 3)
            .map(|k| if k / 3 % size < size / 2 { 1.0 } else { 3.0 })
            .collect();
        let pyramid = Pyramid::new(&base, size).unwrap();
        for set in InstructionSet::ALL
            .into_iter()
            .filter(|set| set.available())
        {
            let found =
                |column| bare_lookups(&pyramid, &[[[column; LANES], [0.3; LANES]]; 2], 1.0, set)[1];
            // Half precision keeps eleven bits.
            assert!((found(0.25) - 32.0).abs() < 0.05, "{set:?}");
            assert!((found(0.75) - 96.0).abs() < 0.15, "{set:?}");
        }
    }
}
