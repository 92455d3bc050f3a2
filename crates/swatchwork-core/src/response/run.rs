// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! All pairs: tasks over all cores, blocks of sixteen, under the best instruction set of the machine.

use super::basis::{Basis, SHAPES};
use super::block::{Frames, ring_means};
use super::deposit::{Part, light_means};
use super::diffuse::{Integrals, cosine_integrals, shapes};
use super::fold::{Folded, fold_kernels, fold_representatives};
use super::lanes::{Array, LANES, Lanes, Plain, Sky};
use super::octahedral::CELLS;
use super::pyramid::Pyramid;
use super::walk::{Stop, Walk};
#[cfg(target_arch = "x86_64")]
use super::{avx2::Avx2, avx512::Avx512};
use rayon::prelude::*;

/// Surface points and where they are seen from, all in the world frame. Slices have the same length.
#[derive(Clone, Copy)]
pub struct Pairs<'a> {
    /// Unit shading normals.
    pub normal: &'a [[f32; 3]],
    /// Unit directions to the viewer.
    pub to_viewer: &'a [[f32; 3]],
    /// Row of each pair's sky mask, or -1 where all the sky is visible.
    pub sky_row: &'a [i32],
    /// Masks [Q, 64]; bit i of word j is the octahedral cell in row j and column i, 1 = visible.
    pub sky: &'a [u64],
}

/// Instruction sets that the kernels are compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InstructionSet {
    Baseline,
    Avx2,
    Avx512,
}

impl InstructionSet {
    /// All of them, the best last.
    pub const ALL: [Self; 3] = [Self::Baseline, Self::Avx2, Self::Avx512];

    /// Whether this machine has it.
    pub fn available(self) -> bool {
        #[cfg(target_arch = "x86_64")]
        {
            match self {
                Self::Baseline => true,
                Self::Avx2 => {
                    is_x86_feature_detected!("avx2")
                        && is_x86_feature_detected!("fma")
                        && is_x86_feature_detected!("f16c")
                        && is_x86_feature_detected!("bmi1")
                        && is_x86_feature_detected!("bmi2")
                        && is_x86_feature_detected!("popcnt")
                }
                Self::Avx512 => {
                    Self::Avx2.available()
                        && is_x86_feature_detected!("avx512f")
                        && is_x86_feature_detected!("avx512bw")
                        && is_x86_feature_detected!("avx512dq")
                        && is_x86_feature_detected!("avx512vl")
                }
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            self == Self::Baseline
        }
    }

    /// The best one this machine has.
    pub fn best() -> Self {
        Self::ALL
            .into_iter()
            .rev()
            .find(|set| set.available())
            .unwrap_or(Self::Baseline)
    }
}

/// What a block is reduced to.
enum Reduction<'a> {
    Kernels,
    Representatives(&'a Folded),
}

/// Everything a block needs.
struct Job<'a> {
    basis: &'a Basis,
    pyramid: &'a Pyramid,
    pairs: Pairs<'a>,
    reduction: Reduction<'a>,
}

/// Responses `out` [P, J, 3] of the generic kernels (Eq. 13).
pub fn generic_responses(
    basis: &Basis,
    pyramid: &Pyramid,
    pairs: Pairs,
    set: InstructionSet,
    out: &mut [f32],
) {
    run(
        &Job {
            basis,
            pyramid,
            pairs,
            reduction: Reduction::Kernels,
        },
        basis.kernels() * 3,
        set,
        out,
    );
}

/// Responses `out` [P, N, 3] of representatives (Eq. 14), folded before any kernel is formed.
pub fn representative_responses(
    basis: &Basis,
    folded: &Folded,
    pyramid: &Pyramid,
    pairs: Pairs,
    set: InstructionSet,
    out: &mut [f32],
) {
    run(
        &Job {
            basis,
            pyramid,
            pairs,
            reduction: Reduction::Representatives(folded),
        },
        folded.count() * 3,
        set,
        out,
    );
}

/// Working space of one task.
struct Scratch {
    means: Vec<Array>,
    lights: Vec<Part>,
    results: Vec<Array>,
    /// Cosine integrals of each of the task's texels, once they are known.
    integrals: Vec<Option<Integrals>>,
}

/// Pairs of one task: enough that many see the same part of the environment, few enough that all cores
/// have a share of a few thousand.
const PAIRS_A_TASK: usize = 512;

fn run(job: &Job, width: usize, set: InstructionSet, out: &mut [f32]) {
    assert!(set.available(), "{set:?} is not available on this machine");
    assert_eq!(out.len(), job.pairs.normal.len() * width);
    if width == 0 {
        return;
    }
    out.par_chunks_mut(PAIRS_A_TASK * width)
        .enumerate()
        .for_each(|(task, out)| {
            let walk = Walk::new(&job.pairs, task * PAIRS_A_TASK, out.len() / width);
            let mut scratch = Scratch {
                means: vec![[0.0; LANES]; job.basis.means() * 3],
                lights: Vec::new(),
                results: vec![[0.0; LANES]; width],
                integrals: vec![None; walk.texels],
            };
            for stops in walk.stops.chunks(LANES) {
                dispatch(job, stops, set, &mut scratch);
                for (lane, stop) in stops.iter().enumerate() {
                    let own = &mut out[(stop.pair - walk.first) * width..][..width];
                    for (value, result) in own.iter_mut().zip(&scratch.results) {
                        *value = result[lane];
                    }
                }
            }
        });
}

fn dispatch(job: &Job, stops: &[Stop], set: InstructionSet, scratch: &mut Scratch) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(
            enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c,bmi1,bmi2,popcnt"
        )]
        fn avx512(job: &Job, stops: &[Stop], scratch: &mut Scratch) {
            block::<Avx512>(job, stops, scratch);
        }
        #[target_feature(enable = "avx2,fma,f16c,bmi1,bmi2,popcnt")]
        fn avx2(job: &Job, stops: &[Stop], scratch: &mut Scratch) {
            block::<Avx2>(job, stops, scratch);
        }
        match set {
            // SAFETY: `run` has checked that the machine has the instruction set.
            InstructionSet::Avx512 => return unsafe { avx512(job, stops, scratch) },
            InstructionSet::Avx2 => return unsafe { avx2(job, stops, scratch) },
            InstructionSet::Baseline => {}
        }
    }
    block::<Plain>(job, stops, scratch);
}

/// One block: ring means, cosine integrals, and the products with the weights.
#[inline(always)]
fn block<L: Lanes>(job: &Job, stops: &[Stop], scratch: &mut Scratch) {
    let Scratch {
        means,
        lights,
        results,
        integrals,
    } = scratch;
    let pairs = &job.pairs;
    // Lanes without a pair repeat the last.
    let pair: [usize; LANES] = std::array::from_fn(|k| stops[k.min(stops.len() - 1)].pair);
    let frames = Frames::new(
        pair.map(|p| pairs.normal[p]),
        pair.map(|p| pairs.to_viewer[p]),
        stops.len(),
    );
    let row = pair.map(|p| pairs.sky_row[p]);
    let sky = Sky {
        words: pairs.sky,
        row,
        masked: row.iter().any(|&r| r >= 0),
    };
    ring_means::<L>(job.basis, job.pyramid, &frames, &sky, means);
    light_means::<L>(job.basis, job.pyramid, &frames, &sky, lights, means);
    if !job.basis.diffuse.is_empty() {
        diffuse_means::<L>(job, stops, &frames, &sky, integrals, means);
    }
    match job.reduction {
        Reduction::Kernels => fold_kernels::<L>(job.basis, means, results),
        Reduction::Representatives(folded) => fold_representatives::<L>(folded, means, results),
    }
}

/// Fills the last means of a block: the cosine integral of each shape of n.i, times each shape of n.o.
#[inline(always)]
fn diffuse_means<L: Lanes>(
    job: &Job,
    stops: &[Stop],
    frames: &Frames,
    sky: &Sky,
    known: &mut [Option<Integrals>],
    means: &mut [Array],
) {
    let mut integrals = [[[0.0; LANES]; 3]; SHAPES];
    for (k, stop) in stops.iter().enumerate() {
        if known[stop.texel].is_none() {
            let mask =
                (sky.row[k] >= 0).then(|| &sky.words[sky.row[k] as usize * CELLS..][..CELLS]);
            let normal = job.pairs.normal[stop.pair];
            known[stop.texel] = Some(cosine_integrals::<L>(job.pyramid, normal, mask));
        }
        let value = known[stop.texel].unwrap_or_default();
        for a in 0..SHAPES {
            for c in 0..3 {
                integrals[a][c][k] = value[a][c];
            }
        }
    }
    let viewer = shapes(L::load(&frames.cosine));
    let live = L::load(&frames.live);
    let start = means.len() - 3 * SHAPES * SHAPES;
    for a in 0..SHAPES {
        for c in 0..3 {
            let value = L::load(&integrals[a][c]) * live;
            for b in 0..SHAPES {
                means[start + 3 * (SHAPES * a + b) + c] = (value * viewer[b]).store();
            }
        }
    }
}
