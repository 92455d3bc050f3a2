// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT
// The mesh in WebGL 2: clay under a light beside the eye, both sides drawn.

const VERTEX = `#version 300 es
uniform mat4 clip_from_ball;
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
out vec3 n, x;
void main() { n = normal; x = position; gl_Position = clip_from_ball * vec4(position, 1.0); }`;

const FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 eye, right, up;
in vec3 n, x;
out vec4 colour;
void main() {
  vec3 o = normalize(eye - x), normal = normalize(n);
  if (dot(normal, o) < 0.0) normal = -normal;
  vec3 key = normalize(o - 0.55 * right + 0.65 * up), fill = normalize(o + 0.9 * right - 0.2 * up);
  float lit = 0.10 + 0.72 * max(dot(normal, key), 0.0) + 0.16 * max(dot(normal, fill), 0.0);
  float gloss = 0.14 * pow(max(dot(normal, normalize(key + o)), 0.0), 24.0);
  // Faces that turn away darken, so that creases and contours read without a texture.
  lit *= mix(0.62, 1.0, smoothstep(0.0, 0.55, dot(normal, o)));
  vec3 clay = gl_FrontFacing ? vec3(0.86, 0.80, 0.73) : vec3(0.62, 0.42, 0.38);
  colour = vec4(pow(clay * lit + gloss, vec3(1.0 / 2.2)), 1.0);
}`;

function shader(gl, kind, text) {
  const made = gl.createShader(kind);
  gl.shaderSource(made, text);
  gl.compileShader(made);
  if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(made));
  return made;
}

/** A function that draws the mesh through a pinhole on a canvas; buffers are of the server's /mesh. */
export function meshPainter(canvas, buffer, vertices, faces) {
  const gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl) throw new Error("This browser has no WebGL 2, which shows the mesh. Another browser may.");
  const program = gl.createProgram();
  gl.attachShader(program, shader(gl, gl.VERTEX_SHADER, VERTEX));
  gl.attachShader(program, shader(gl, gl.FRAGMENT_SHADER, FRAGMENT));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  gl.bindVertexArray(gl.createVertexArray());
  for (const place of [0, 1]) {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(buffer, place * vertices * 12, vertices * 3), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
  }
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(buffer, vertices * 24, faces * 3), gl.STATIC_DRAW);
  const at = (name) => gl.getUniformLocation(program, name);
  return (view, width, height) => {
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(program);
    gl.uniformMatrix4fv(at("clip_from_ball"), false, view.matrix(width, height));
    for (const name of ["eye", "right", "up"]) gl.uniform3fv(at(name), view[name]);
    gl.drawElements(gl.TRIANGLES, faces * 3, gl.UNSIGNED_INT, 0);
  };
}
