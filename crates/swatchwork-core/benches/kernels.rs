// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Environment samples a second of the ring kernel, by instruction set, on one thread.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use swatchwork_core::response::{
    Basis, InstructionSet, LightBins, Masking, Pairs, Pyramid, Ring, SpecularRow, generic_responses,
};

/// Rings of one layer, logarithmic in the tangent, with one broad kernel a Fresnel term.
fn basis(rings: usize, azimuths: u32, layer: usize) -> Basis {
    let rings: Vec<Ring> = (0..rings)
        .map(|r| {
            let tangent = 0.02 * 75.0f32.powf(r as f32 / (rings - 1) as f32);
            let area = 2.0 * std::f32::consts::PI * tangent * tangent * 0.18;
            Ring {
                tangent,
                azimuths,
                solid_angle: area / azimuths as f32,
                layer,
            }
        })
        .collect();
    let weights = vec![1.0 / rings.len() as f32; rings.len()];
    let row = |plane| SpecularRow {
        plane,
        weights: weights.clone(),
    };
    let bins = LightBins {
        first: 0.0,
        factor: 0.0,
        count: 0,
    };
    Basis::new(
        rings,
        bins,
        vec![Masking::VGroove],
        vec![5, 0],
        vec![row(0), row(1)],
        vec![],
    )
    .expect("a valid basis")
}

/// Texels of a sphere seen by eight cameras, pairs in the order of texels.
fn pairs_on_a_sphere(texels: usize) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let (mut normal, mut to_viewer) = (Vec::new(), Vec::new());
    for k in 0..texels {
        let (z, phi) = (0.999 - k as f32 / texels as f32, 2.4 * (k as f32).sqrt());
        let s = (1.0 - z * z).sqrt();
        for view in 0..8 {
            let a = view as f32 * 0.785;
            normal.push([s * phi.cos(), s * phi.sin(), z]);
            to_viewer.push([0.6 * a.cos(), 0.6 * a.sin(), 0.8]);
        }
    }
    (normal, to_viewer)
}

fn samples_a_second(criterion: &mut Criterion) {
    // One thread, so that the figure is that of a core.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let size = 1024;
    let base: Vec<f32> = (0..size * size * 3)
        .map(|k| (k * 7919 % 1013) as f32 * 1e-3)
        .collect();
    let pyramid = Pyramid::new(&base, size).expect("radiance");
    let (normal, to_viewer) = pairs_on_a_sphere(64);
    let mut group = criterion.benchmark_group("ring samples");
    for (layer, label) in [(0, "whole"), (2, "broad")] {
        let basis = basis(32, 32, layer);
        let samples = normal.len() * basis.lookups();
        group.throughput(Throughput::Elements(samples as u64));
        let open = vec![-1; normal.len()];
        let masked: Vec<i32> = (0..normal.len() as i32).map(|k| k / 8 % 4).collect();
        let sky = vec![0xffff_ffff_0000_ffffu64; 4 * 64];
        for (sky_row, shade) in [(&open, "open"), (&masked, "masked")] {
            let pairs = Pairs {
                normal: &normal,
                to_viewer: &to_viewer,
                sky_row,
                sky: &sky,
            };
            for set in InstructionSet::ALL
                .into_iter()
                .filter(|set| set.available())
            {
                let id = BenchmarkId::new(format!("{label} {shade}"), format!("{set:?}"));
                let mut out = vec![0.0; normal.len() * 6];
                group.bench_function(id, |bencher| {
                    bencher.iter(|| {
                        pool.install(|| {
                            generic_responses(&basis, &pyramid, pairs, set, black_box(&mut out));
                        });
                    });
                });
            }
        }
    }
    group.finish();
}

criterion_group!(benches, samples_a_second);
criterion_main!(benches);
