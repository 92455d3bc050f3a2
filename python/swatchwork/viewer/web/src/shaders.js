// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// The shaders. Radiance is counted in means of the light.

const HEAD = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp samplerCube;
precision highp usampler2D;
precision highp usampler2DArray;
`;

/** A triangle over everything. */
export const EVERYWHERE = `${HEAD}
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }`;

/** The mesh before a camera; uPick magnifies one pixel to the whole target. */
export const SURFACE = `${HEAD}
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 uv;
uniform mat4 uClip;
uniform vec4 uPick;
out vec3 vPosition;
out vec3 vNormal;
out vec2 vUv;
invariant gl_Position;
void main() {
  vPosition = position;
  vNormal = normal;
  vUv = uv;
  gl_Position = uClip * vec4(position, 1.0);
  gl_Position.xy = (gl_Position.xy - uPick.xy * gl_Position.w) * uPick.zw;
}`;

/** The mesh laid flat, row 0 at v = 1. */
export const FLAT = `${HEAD}
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 uv;
out vec3 vNormal;
void main() {
  vNormal = normal;
  gl_Position = vec4(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y, 0.0, 1.0);
}`;

export const NOTHING = `${HEAD}
void main() {}`;

// The equal-area octahedral square (python/swatchwork/octahedral.py); the arc tangent is the core's polynomial.
const OCTAHEDRAL = `
const float PI = 3.14159265358979;
float quarterTurns(float t) {
  float s = t * t;
  return t * (0.6366173 + s * (-0.21210495 + s * (0.12610047 + s * (-0.08424605
    + s * (0.05068995 + s * (-0.02139306 + s * 0.004336505))))));
}
vec2 squareFromDirection(vec3 d) {
  vec3 v = abs(d);
  float r = sqrt(max(0.0, 1.0 - v.z));
  float turn = quarterTurns(min(v.x, v.y) / max(max(v.x, v.y), 1e-20));
  float b = (v.y > v.x ? 1.0 - turn : turn) * r;
  float a = r - b;
  vec2 p = d.z < 0.0 ? vec2(1.0 - b, 1.0 - a) : vec2(a, b);
  return 0.5 + 0.5 * vec2(d.x < 0.0 ? -p.x : p.x, d.y < 0.0 ? -p.y : p.y);
}
vec3 directionFromSquare(vec2 square) {
  vec2 s = 2.0 * square - 1.0, p = abs(s);
  bool below = p.x + p.y > 1.0;
  if (below) p = 1.0 - p.yx;
  float r = p.x + p.y, phi = r > 0.0 ? p.y / r * 0.5 * PI : 0.0;
  float z = 1.0 - r * r, across = r * sqrt(max(0.0, 2.0 - r * r));
  return vec3(across * cos(phi) * (s.x < 0.0 ? -1.0 : 1.0), across * sin(phi) * (s.y < 0.0 ? -1.0 : 1.0),
    below ? -z : z);
}`;

// Radiance from a direction of the world, averaged over a solid angle. A cube's texels have 4 m^3 / size^2
// steradians, where m is the largest component of their unit direction.
const LIGHT = `
uniform samplerCube uLight;
uniform mat3 uLightFromWorld;
uniform float uUnit;
uniform float uFace;
uniform float uSharpen;
vec3 lightFrom(vec3 d, float solid) {
  vec3 e = uLightFromWorld * d, v = abs(e);
  float m = max(max(v.x, v.y), v.z);
  float texel = 4.0 * m * m * m / (uFace * uFace);
  return uUnit * textureLod(uLight, e, max(0.0, 0.5 * log2(solid / texel) - uSharpen)).rgb;
}`;

const SHAPES = `
void shapesOf(float c, out float s[5]) {
  float x = 1.0 - c, h = 1.0 - 0.5 * c;
  s[0] = 1.0;
  s[1] = 1.0 - h * h * h * h * h;
  s[2] = x * x * x * x * x;
  s[3] = s[2] * s[2];
  s[4] = 1.0 / (1.0 + c);
}`;

// A blend: the index in the upper and 65535 times the weight in the lower half of each slot.
const BLEND = `
uniform usampler2DArray uBlend;
uniform int uSlots;
uniform usampler2D uSkyRow;
ivec2 texelOf(vec2 uv, vec2 dither) {
  ivec2 size = textureSize(uBlend, 0).xy;
  return clamp(ivec2(floor(vec2(uv.x, 1.0 - uv.y) * vec2(size) + dither)), ivec2(0), size - 1);
}`;

const SKY = `
uniform usampler2D uSky;
const int MASKS_A_ROW = 64;
uvec4 skyWords(int mask, int pair) {
  return texelFetch(uSky, ivec2((mask % MASKS_A_ROW) * 32 + pair, mask / MASKS_A_ROW), 0);
}
float visible(int mask, vec3 d) {
  ivec2 cell = min(ivec2(squareFromDirection(d) * 64.0), ivec2(63));
  uvec4 words = skyWords(mask, cell.y >> 1);
  uvec2 row = (cell.y & 1) == 0 ? words.xy : words.zw;
  return float(((cell.x < 32 ? row.x : row.y) >> uint(cell.x & 31)) & 1u);
}`;

/** Light of the sky's cells: radiance times solid angle over pi, and the direction it comes from on the whole. */
export const CELLS = `${HEAD}${OCTAHEDRAL}${LIGHT}
uniform float uSide;
layout(location = 0) out vec4 power;
layout(location = 1) out vec4 towards;
void main() {
  const int S = 8;
  vec3 sum = vec3(0.0), direction = vec3(0.0);
  float solid = 4.0 * PI / (uSide * uSide);
  vec2 corner = floor(gl_FragCoord.xy);
  for (int j = 0; j < S; j++)
    for (int i = 0; i < S; i++) {
      vec3 d = directionFromSquare((corner + (vec2(i, j) + 0.5) / float(S)) / uSide);
      vec3 light = lightFrom(d, solid / float(S * S));
      sum += light;
      direction += d * (light.r + light.g + light.b + 1e-6);
    }
  power = vec4(sum * solid / (PI * float(S * S)), 1.0);
  towards = vec4(normalize(direction), 0.0);
}`;

/**
 * Diffuse radiance at each texel: for each shape of n.o its factor, 15 numbers and 1 for validity. The integral
 * over the cells is that of the core's diffuse.rs, at half its cells along a side or fewer.
 */
export const diffuse = (pairs) => `${HEAD}${OCTAHEDRAL}${SHAPES}${BLEND}${SKY}
in vec3 vNormal;
uniform sampler2D uPower;
uniform sampler2D uTowards;
uniform sampler2D uDiffuse;
uniform int uSide;
uniform float uTexels;
uniform bool uShadowed;
layout(location = 0) out vec4 out0;
layout(location = 1) out vec4 out1;
layout(location = 2) out vec4 out2;
layout(location = 3) out vec4 out3;
void main() {
  vec3 n = normalize(vNormal);
  ivec2 texel = texelOf(vec2(gl_FragCoord.x, uTexels - gl_FragCoord.y) / uTexels, vec2(0.0));
  int mask = uShadowed ? int(texelFetch(uSkyRow, texel, 0).r) - 1 : -1;
  vec3 E[5] = vec3[5](vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0));
  for (int j = 0; j < uSide; j++) {
    uvec4 words = uvec4(0xffffffffu);
    if (mask >= 0) words = skyWords(mask, j * 32 / uSide);
    uvec2 both = words.xy & words.zw, any = words.xy | words.zw;
    for (int i = 0; i < uSide; i++) {
      vec3 d = texelFetch(uTowards, ivec2(i, j), 0).xyz;
      float c = dot(d, n);
      if (c <= 0.0) continue;
      // Of the four cells of the mask under the corner of this one: bits set in either row and in both.
      int column = i * 64 / uSide;
      uint shift = uint(column & 31);
      uint a = (column < 32 ? any.x : any.y) >> shift, b = (column < 32 ? both.x : both.y) >> shift;
      uint set = (a & 1u) + ((a >> 1) & 1u) + (b & 1u) + ((b >> 1) & 1u);
      if (set == 0u) continue;
      vec3 light = texelFetch(uPower, ivec2(i, j), 0).rgb * (c * 0.25 * float(set));
      ${pairs.some(([a]) => a > 0) ? "float s[5];\n      shapesOf(c, s);\n      for (int k = 0; k < 5; k++) E[k] += light * s[k];" : "E[0] += light;"}
    }
  }
  vec3 D[5] = vec3[5](vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0));
  for (int k = 0; k < uSlots; k++) {
    uint slot = texelFetch(uBlend, ivec3(texel, k), 0).r;
    float weight = float(slot & 0xffffu) / 65535.0;
    if (weight == 0.0) continue;
    int row = int(slot >> 16);
    ${pairs.map(([a, b], k) => `D[${b}] += weight * texelFetch(uDiffuse, ivec2(${k}, row), 0).rgb * E[${a}];`).join("\n    ")}
  }
  out0 = vec4(D[0], D[1].r);
  out1 = vec4(D[1].gb, D[2].rg);
  out2 = vec4(D[2].b, D[3]);
  out3 = vec4(D[4], 1.0);
}`;

const power = (p) => (p === 0 ? "1.0" : Array(p).fill("rise").join(" * "));

/** What one masking term is worth, times o.h; the viewer's part is worked out once a pixel. */
function masking(name, g) {
  if (name === "vgroove") return { viewer: "", value: "min(oh, 2.0 * about.x * min(ni, no))" };
  const alpha = parseFloat(name.split(":")[1]), square = (alpha * alpha).toFixed(9), rest = (1 - alpha * alpha).toFixed(9);
  return {
    viewer: `float viewer${g} = 4.0 * no / (no + sqrt(${square} + ${rest} * no * no));`,
    value: `oh * viewer${g} * ni / (ni + sqrt(${square} + ${rest} * ni * ni))`,
  };
}

/** Radiance of a pass: the walk over the rings, and the diffuse part from the texels' cache. Blends have up to so many slots. */
export function shaded(material, slots) {
  const terms = material.maskings.map(masking), F = material.fresnel.length, planes = terms.length * F;
  return `${HEAD}${OCTAHEDRAL}${LIGHT}${SHAPES}${BLEND}${SKY}
in vec3 vPosition;
in vec3 vNormal;
in vec2 vUv;
uniform vec3 uEye;
uniform vec2 uDither;
uniform sampler2D uRing;
uniform sampler2D uWeight;
uniform int uFirst;
uniform int uRings;
uniform bool uShadowed;
uniform sampler2D uCache0;
uniform sampler2D uCache1;
uniform sampler2D uCache2;
uniform sampler2D uCache3;
layout(location = 0) out vec4 colour;
const int PLANES = ${planes};
const int AZIMUTHS = 6;
const int SLOTS = ${slots};

vec3 diffuse(float no) {
  ivec2 size = textureSize(uCache0, 0);
  vec2 at = vec2(vUv.x, 1.0 - vUv.y) * vec2(size) - 0.5;
  ivec2 low = ivec2(floor(at));
  vec2 part = at - vec2(low);
  vec4 a = vec4(0.0), b = vec4(0.0), c = vec4(0.0), d = vec4(0.0);
  // Between four texels; where none of them is of the surface, whatever is near.
  for (int reach = 0; reach < 4 && d.w == 0.0; reach++)
    for (int j = -reach; j < 2 + reach; j++)
      for (int i = -reach; i < 2 + reach; i++) {
        float w = reach > 0 ? 1.0 : (i == 0 ? 1.0 - part.x : part.x) * (j == 0 ? 1.0 - part.y : part.y);
        ivec2 p = clamp(low + ivec2(i, j), ivec2(0), size - 1);
        vec4 last = texelFetch(uCache3, p, 0);
        w *= last.w;
        if (w == 0.0) continue;
        a += w * texelFetch(uCache0, p, 0);
        b += w * texelFetch(uCache1, p, 0);
        c += w * texelFetch(uCache2, p, 0);
        d += w * vec4(last.rgb, 1.0);
      }
  float s[5];
  shapesOf(no, s);
  vec3 sum = a.rgb * s[0] + vec3(a.a, b.rg) * s[1] + vec3(b.ba, c.r) * s[2] + c.gba * s[3] + d.rgb * s[4];
  return sum / max(d.w, 1e-6);
}

void main() {
  vec3 n = normalize(vNormal), o = normalize(uEye - vPosition);
  float facing = dot(n, o);
  vec3 across = o - facing * n;
  if (facing < 0.02) {
    // Bend normals that turn away until n.o is 0.02 (relight/render.py).
    vec3 along = n - facing * o;
    float l = length(along);
    n = 0.02 * o + sqrt(1.0 - 0.0004) * (l > 1e-6 ? along / l : vec3(0.0));
    n = normalize(n);
    facing = dot(n, o);
    across = o - facing * n;
  }
  float no = max(facing, 1e-4), sine = length(across);
  vec3 x = sine > 1e-5 ? across / sine : normalize(cross(abs(n.x) < 0.5 ? vec3(1, 0, 0) : vec3(0, 1, 0), n));
  vec3 y = cross(n, x);
  ${terms.map((t) => t.viewer).join("\n  ")}

  ivec2 texel = texelOf(vUv, uDither);
  int mask = uShadowed ? int(texelFetch(uSkyRow, texelOf(vUv, vec2(0.0)), 0).r) - 1 : -1;
  int index[SLOTS];
  float blend[SLOTS];
  for (int k = 0; k < uSlots; k++) {
    uint slot = texelFetch(uBlend, ivec3(texel, k), 0).r;
    index[k] = int(slot >> 16) * PLANES;
    blend[k] = float(slot & 0xffffu) / 65535.0;
  }
  vec3 radiance = vec3(0.0);
  for (int r = 0; r < uRings; r++) {
    int column = uFirst + r;
    vec4 about = texelFetch(uRing, ivec2(column, 0), 0);
    vec3 weight[PLANES];
    for (int p = 0; p < PLANES; p++) weight[p] = vec3(0.0);
    vec3 most = vec3(0.0);
    for (int k = 0; k < uSlots; k++)
      if (blend[k] > 0.0)
        for (int p = 0; p < PLANES; p++) {
          weight[p] += blend[k] * texelFetch(uWeight, ivec2(column, index[k] + p), 0).rgb;
          most = max(most, weight[p]);
        }
    // Rings inside a wide lobe, or outside a narrow one, weigh nothing.
    if (max(most.r, max(most.g, most.b)) < 1e-6) continue;
    vec3 sum = vec3(0.0);
    vec2 turn = vec2(cos(about.z), sin(about.z));
    for (int k = 0; k < AZIMUTHS; k++) {
      vec3 h = vec3(about.y * turn, about.x);
      // A sixth of a turn further.
      turn = vec2(0.5 * turn.x - 0.8660254037844386 * turn.y, 0.8660254037844386 * turn.x + 0.5 * turn.y);
      float oh = sine * h.x + no * h.z;
      float ni = 2.0 * oh * h.z - no;
      if (oh <= 0.0 || ni <= 0.0) continue;
      vec3 i = (2.0 * oh * h.x - sine) * x + 2.0 * oh * h.y * y + ni * n;
      float rise = 1.0 - min(oh, 1.0);
      vec3 value = vec3(0.0);
      ${terms.map((t, g) => `value += (${t.value}) * (${material.fresnel
        .map((p, f) => `weight[${g * F + f}] * (${power(p)})`).join(" + ")});`).join("\n      ")}
      if (mask >= 0) value *= visible(mask, i);
      sum += value * lightFrom(i, 4.0 * oh * about.w);
    }
    radiance += sum / (float(AZIMUTHS) * about.x * no);
  }
  colour = vec4(radiance + diffuse(no), 1.0);
}`;
}

/** Maps on the surface, as display colours, a little shaded so that the shape shows. */
export const MAPPED = `${HEAD}${BLEND}
in vec3 vPosition;
in vec3 vNormal;
in vec2 vUv;
uniform vec3 uEye;
uniform int uKind;
uniform int uChosen;
uniform sampler2D uColours;
uniform sampler2D uValues;
layout(location = 0) out vec4 colour;
vec3 heat(float t) {
  // The stops of the reports' heat maps.
  const vec3 stops[5] = vec3[5](vec3(0.05, 0.03, 0.12), vec3(0.34, 0.08, 0.43), vec3(0.73, 0.21, 0.33),
    vec3(0.98, 0.55, 0.20), vec3(0.99, 0.95, 0.62));
  float x = clamp(t, 0.0, 1.0) * 4.0;
  int k = min(int(x), 3);
  return mix(stops[k], stops[k + 1], x - float(k));
}
void main() {
  ivec2 texel = texelOf(vUv, vec2(0.0));
  vec3 found = vec3(0.0);
  float chosen = 0.0, most = -1.0;
  if (uKind < 3) {
    for (int k = 0; k < uSlots; k++) {
      uint slot = texelFetch(uBlend, ivec3(texel, k), 0).r;
      float weight = float(slot & 0xffffu) / 65535.0;
      int index = int(slot >> 16);
      vec3 own = texelFetch(uColours, ivec2(index, 0), 0).rgb;
      if (uKind == 0) found += weight * own;
      if (uKind == 1 && weight > most) { most = weight; found = own; }
      if (index == uChosen) chosen += weight;
    }
    if (uKind == 2) found = heat(chosen);
  } else if (uKind == 3) {
    float value = texelFetch(uValues, texel, 0).r * 255.0;
    found = value < 0.5 ? vec3(0.35) : heat((value - 1.0) / 254.0);
  } else {
    for (int k = 0; k < uSlots; k++) {
      uint slot = texelFetch(uBlend, ivec3(texel, k), 0).r;
      found += float(slot & 0xffffu) / 65535.0 * texelFetch(uColours, ivec2(int(slot >> 16), uKind - 3), 0).rgb;
    }
    found = pow(clamp(found, 0.0, 1.0), vec3(1.0 / 2.2));
  }
  float shade = 0.72 + 0.28 * abs(dot(normalize(vNormal), normalize(uEye - vPosition)));
  colour = vec4(found * shade, 1.0);
}`;

/** Where on the surface a pixel looks: uv, and 1. */
export const WHERE = `${HEAD}
in vec3 vPosition;
in vec3 vNormal;
in vec2 vUv;
layout(location = 0) out vec4 found;
void main() { found = vec4(vUv, 1.0, 1.0); }`;

/** Adds a pass to those before it. */
export const ADDED = `${HEAD}
uniform sampler2D uSum;
uniform sampler2D uPass;
layout(location = 0) out vec4 sum;
void main() {
  ivec2 p = ivec2(gl_FragCoord.xy);
  sum = texelFetch(uSum, p, 0) + texelFetch(uPass, p, 0);
}`;

/** The picture on the screen: exposed, coded with gamma 2.2, before a plain ground or the light itself. */
export const SHOWN = `${HEAD}${LIGHT}
uniform sampler2D uPicture;
uniform vec2 uPixels;
uniform float uScale;
uniform float uExposure;
uniform bool uCoded;
uniform bool uBackdrop;
uniform vec3 uGround;
uniform mat3 uWorldFromView;
uniform vec4 uIntrinsics;
uniform sampler2D uPhotograph;
uniform vec4 uFrame;
uniform float uSplit;
uniform float uWhite;
uniform float uPhotographExposure;
layout(location = 0) out vec4 shown;
vec3 coded(vec3 linear) { return pow(clamp(linear, 0.0, 1.0), vec3(1.0 / 2.2)); }
void main() {
  vec2 at = gl_FragCoord.xy;
  vec4 picture = texture(uPicture, at / uPixels) * uScale;
  vec2 down = vec2(at.x, uPixels.y - at.y);
  vec3 ground = uGround;
  if (uBackdrop) {
    vec3 d = normalize(uWorldFromView * vec3((down.x - uIntrinsics.z) / uIntrinsics.x, -(down.y - uIntrinsics.w) / uIntrinsics.y, -1.0));
    ground = coded(lightFrom(d, 0.0006) * uExposure);
  }
  float alpha = clamp(picture.a, 0.0, 1.0);
  vec3 straight = picture.rgb / max(picture.a, 1e-6);
  vec3 own = uCoded ? straight : coded(straight * uExposure);
  vec3 found = mix(ground, own, alpha);
  vec2 inside = (down - uFrame.xy) / uFrame.zw;
  if (uSplit >= 0.0 && all(greaterThanEqual(inside, vec2(0.0))) && all(lessThan(inside, vec2(1.0)))) {
    if (inside.x < uSplit) {
      vec4 photograph = texture(uPhotograph, inside);
      vec3 linear = pow(photograph.rgb, vec3(2.2)) * (uWhite * uPhotographExposure) / max(photograph.a, 0.02);
      found = mix(ground, coded(linear), photograph.a);
    }
  }
  if (uSplit >= 0.0 && abs(down.x - (uFrame.x + uSplit * uFrame.z)) < 1.0
      && inside.y >= 0.0 && inside.y < 1.0) found = vec3(0.96);
  shown = vec4(found, 1.0);
}`;
