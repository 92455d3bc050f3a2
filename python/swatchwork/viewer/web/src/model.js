// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// The rings of half-vectors that a pixel walks, and representatives folded into a weight for each ring: the
// rendering operator of python/swatchwork/response/rings.py for a graphics card. Instead of three layers of
// rings and point lights there is one set of rings, walked in passes whose rings and azimuths are staggered;
// all passes together are a lattice in (log tan(alpha), azimuth) several times denser than any layer.

const INNER = 4e-4, OUTER = 1.5;
/** Half-vectors on a ring, in one pass. */
export const AZIMUTHS = 6;
/**
 * While something moves: one pass over few rings. It is off by an NRMS of 7 to 10 % (240 random normals and viewers
 * under sharp windows and under a sun); `sharpen` is by how many levels lookups are sharper than their share of the
 * sphere.
 */
export const MOVING = { rings: 32, passes: 1, sharpen: 0 };
/** Standing still: this many passes over all rings, off by 0.7 %. A fifth more rings win a third of that. */
export const STILL = { rings: 40, passes: 16, sharpen: 0.75 };
/** So often are these passes made, each time through other parts of a pixel. */
export const ROUNDS = 4;

const GOLDEN = 0.6180339887498949;

/**
 * Which of the staggered sets of rings pass j walks. Four passes in a row, and the four in each quarter of a pixel
 * (every fourth, see renderer.js), are each spread evenly: what one of them misses, a near one finds.
 */
const stagger = (j, passes) => (passes < 16 ? j : 4 * (((j >> 2) + j) & 3) + (j & 3));

/**
 * The rings of all passes, and what each representative weighs on them.
 *
 * Rings on which no representative weighs anything are left out. `ring` is [passes * rings, 4]: cosine and sine
 * of alpha, azimuth of the first half-vector, solid angle of each; `weight` is
 * [N * planes, passes * rings, 4] with a colour each.
 */
export function ringTable(material, { rings, passes, sharpen }) {
  const { N, sigmas, specular } = material, planes = material.maskings.length * material.fresnel.length;
  const all = [];
  const step = Math.log(OUTER / INNER) / (rings - 2);
  for (let j = 0; j < passes; j++) {
    const shift = (stagger(j, passes) + 0.5) / passes - 0.5;
    const edge = (k) => INNER * Math.exp((k + shift) * step);
    const walk = [];
    for (let r = 0; r < rings; r++) {
      const t0 = r > 0 ? edge(r - 1) : 0, t1 = r < rings - 1 ? edge(r) : Infinity;
      const t = r === 0 ? t1 / Math.SQRT2 : r === rings - 1 ? t0 * Math.SQRT2 : Math.sqrt(t0 * t1);
      const cosine = (v) => (v === Infinity ? 0 : 1 / Math.sqrt(1 + v * v));
      const solid = (2 * Math.PI * (cosine(t0) - cosine(t1))) / (AZIMUTHS * passes);
      const turn = (((r * passes + stagger(j, passes)) * GOLDEN) % 1) * ((2 * Math.PI) / AZIMUTHS);
      const share = sigmas.map((s) => Math.exp(-((t0 / s) ** 2)) - (t1 === Infinity ? 0 : Math.exp(-((t1 / s) ** 2))));
      walk.push({ about: [cosine(t), t * cosine(t), turn, solid], share });
    }
    all.push(walk);
  }
  const weightsOf = (share) =>
    specular.map((rows) => rows.map((kernels) => {
      const sum = [0, 0, 0];
      kernels.forEach((colour, s) => { for (let c = 0; c < 3; c++) sum[c] += colour[c] * share[s]; });
      return sum;
    }));
  const folded = all.map((walk) => walk.map(({ share }) => weightsOf(share)));
  const largest = (weights) => Math.max(0, ...weights.flat(2));
  const most = Math.max(1e-30, ...folded.flat().map(largest));
  const used = [...Array(rings).keys()].filter((r) => folded.some((walk) => largest(walk[r]) > 1e-6 * most));
  const width = Math.max(1, used.length * passes);
  const ring = new Float32Array(width * 4), weight = new Float32Array(N * planes * width * 4);
  for (let j = 0; j < passes; j++)
    used.forEach((r, k) => {
      const column = j * used.length + k;
      ring.set(all[j][r].about, column * 4);
      for (let n = 0; n < N; n++)
        for (let p = 0; p < planes; p++) weight.set(folded[j][r][n][p], ((n * planes + p) * width + column) * 4);
    });
  return { rings: used.length, passes, sharpen, width, ring, weight, lookups: used.length * AZIMUTHS * passes };
}

/** Products [a, b] of a shape of n.i and a shape of n.o that some representative has. */
export function diffusePairs({ diffuse }) {
  const all = [...Array(25).keys()].map((k) => [Math.floor(k / 5), k % 5]);
  const used = all.filter(([a, b]) => diffuse.some((rows) => rows[a][b].some((v) => v !== 0)));
  return used.length ? used : [[0, 0]];
}

/** Coefficients [N, pairs, 4] of those products. */
export function diffuseTable(material) {
  const pairs = diffusePairs(material), found = new Float32Array(material.N * pairs.length * 4);
  material.diffuse.forEach((rows, n) => pairs.forEach(([a, b], k) => found.set(rows[a][b], (n * pairs.length + k) * 4)));
  return found;
}
