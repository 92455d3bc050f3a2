// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Environment lookups a second on one thread, by instruction set: bare ones, from the cache and spread
//! over a large base; those of the ring kernel; and those of whole responses of representatives, with
//! masks and point lights. The first is the peak that the others are a share of.

use criterion::measurement::WallTime;
use criterion::{
    BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main,
};
use std::hint::black_box;
use swatchwork_core::response::{
    Basis, Folded, InstructionSet, LightBins, Masking, Pairs, Pyramid, Ring, SpecularRow,
    bare_lookups, generic_responses, representative_responses,
};

/// Light bins like those of the default quadrature.
const BINS: LightBins = LightBins {
    first: 0.006,
    factor: 1.1035,
    count: 60,
};
const NO_BINS: LightBins = LightBins {
    first: 0.0,
    factor: 0.0,
    count: 0,
};

/// About the default quadrature: rings of each layer from one tangent to another, logarithmic. Six planes,
/// one kernel a plane, which weighs all rings and bins alike.
fn basis(layers: &[(usize, f32, f32, usize, u32)], light_bins: LightBins) -> Basis {
    let rings: Vec<Ring> = layers
        .iter()
        .flat_map(|&(layer, first, last, count, azimuths)| {
            let step = (last / first).powf(1.0 / (count - 1) as f32);
            (0..count).map(move |r| {
                let tangent = first * step.powi(r as i32);
                let area = 2.0 * std::f32::consts::PI * tangent * tangent * step.ln();
                Ring {
                    tangent,
                    azimuths,
                    solid_angle: area / azimuths as f32,
                    layer,
                }
            })
        })
        .collect();
    let entries = rings.len() + 2 * light_bins.count;
    let row = |plane| SpecularRow {
        plane,
        weights: vec![1.0 / entries as f32; entries],
    };
    Basis::new(
        rings,
        light_bins,
        vec![Masking::Smith(0.2), Masking::Smith(1.0)],
        vec![5, 2, 0],
        (0..6).map(row).collect(),
        vec![],
    )
    .expect("a valid basis")
}

/// Texels of a sphere, neighbours 0.004 apart, seen by eight cameras; pairs in the order of texels.
fn pairs_on_a_sphere(texels: usize) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let (mut normal, mut to_viewer) = (Vec::new(), Vec::new());
    for k in 0..texels {
        let (z, phi) = (0.3 + 0.4 * (k / 64) as f32 / 4.0, 0.004 * k as f32);
        let s = (1.0 - z * z).sqrt();
        for view in 0..8 {
            let a = view as f32 * 0.785;
            normal.push([s * phi.cos(), s * phi.sin(), z]);
            to_viewer.push([0.6 * a.cos(), 0.6 * a.sin(), 0.8]);
        }
    }
    (normal, to_viewer)
}

/// Columns and rows of sixteen points of the square at a time, in an order without order, within
/// `extent` about its middle.
fn points(sixteens: usize, extent: f32) -> Vec<[[f32; 16]; 2]> {
    let mut state = 1u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        0.5 + extent * ((state >> 8) as f32 / (1 << 24) as f32 - 0.5)
    };
    (0..sixteens)
        .map(|_| [0; 2].map(|_| [0; 16].map(|_| next())))
        .collect()
}

/// One measurement for each instruction set of the machine.
fn each_set(
    group: &mut BenchmarkGroup<WallTime>,
    label: &str,
    mut routine: impl FnMut(InstructionSet),
) {
    let sets = InstructionSet::ALL.into_iter();
    for set in sets.filter(|set| set.available()) {
        let id = BenchmarkId::new(label, format!("{set:?}"));
        group.bench_function(id, |bencher| bencher.iter(|| routine(set)));
    }
}

fn lookups_a_second(criterion: &mut Criterion) {
    // One thread, so that the figure is that of a core.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let size = 1024;
    // Noise about 0.5, and a thousand spots of a hundred times that.
    let base: Vec<f32> = (0..size * size * 3)
        .map(|k| (k * 7919 % 1013) as f32 * 1e-3 * if k / 3 % 1021 == 0 { 1e2 } else { 1.0 })
        .collect();
    let pyramid = Pyramid::new(&base, size).expect("radiance");
    assert!(pyramid.light_counts()[0] > 500);
    let mut group = criterion.benchmark_group("lookups");

    for (label, extent) in [("bare, cached", 0.02), ("bare, spread", 1.0)] {
        let points = points(1 << 10, extent);
        group.throughput(Throughput::Elements(16 * points.len() as u64));
        each_set(&mut group, label, |set| {
            black_box(bare_lookups(&pyramid, black_box(&points), 1.0, set));
        });
    }

    let (normal, to_viewer) = pairs_on_a_sphere(256);
    let open = vec![-1; normal.len()];
    let masked: Vec<i32> = (0..normal.len() as i32).map(|k| k / 8).collect();
    let sky = vec![0xffff_ffff_0000_ffffu64; 256 * 64];
    let layers = [
        (0, 4e-4, 0.12, 34, 26),
        (1, 0.007, 0.32, 22, 40),
        (2, 0.025, 1.5, 20, 48),
    ];
    let (rings, whole) = (basis(&layers, NO_BINS), basis(&layers, BINS));
    let folded = Folded::new(&whole, &[0.5; 9 * 6 * 3]);
    group.throughput(Throughput::Elements(
        (normal.len() * rings.lookups()) as u64,
    ));
    for (shade, sky_row) in [("open", &open), ("masked", &masked)] {
        let pairs = Pairs {
            normal: &normal,
            to_viewer: &to_viewer,
            sky_row,
            sky: &sky,
        };
        let mut out = vec![0.0; normal.len() * 6 * 3];
        each_set(&mut group, &format!("rings, {shade}"), |set| {
            pool.install(|| generic_responses(&rings, &pyramid, pairs, set, black_box(&mut out)));
        });
        let mut out = vec![0.0; normal.len() * 9 * 3];
        each_set(&mut group, &format!("representatives, {shade}"), |set| {
            pool.install(|| {
                let out = black_box(&mut out);
                representative_responses(&whole, &folded, &pyramid, pairs, set, out);
            });
        });
    }
    group.finish();
}

criterion_group!(benches, lookups_a_second);
criterion_main!(benches);
