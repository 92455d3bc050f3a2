// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// A few functions around WebGL2: programs, textures, targets.

/** A program whose uniforms are set by name; a texture is given the next unit. */
export class Program {
  constructor(gl, vertex, fragment) {
    this.gl = gl;
    this.program = gl.createProgram();
    const stage = (type, source) => {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
      return shader;
    };
    const stages = [stage(gl.VERTEX_SHADER, vertex), stage(gl.FRAGMENT_SHADER, fragment)];
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS)) {
      const said = [gl.getProgramInfoLog(this.program), ...stages.map((s) => gl.getShaderInfoLog(s))];
      throw new Error(`a shader does not compile: ${said.filter(Boolean).join("\n")}`);
    }
    this.uniforms = {};
    const count = gl.getProgramParameter(this.program, gl.ACTIVE_UNIFORMS);
    for (let k = 0; k < count; k++) {
      const { name, type } = gl.getActiveUniform(this.program, k);
      this.uniforms[name] = { type, at: gl.getUniformLocation(this.program, name) };
    }
  }

  /** Makes it current and sets uniforms: numbers, arrays, or textures. */
  use(values) {
    const { gl } = this;
    gl.useProgram(this.program);
    let unit = 0;
    for (const [name, { type, at }] of Object.entries(this.uniforms)) {
      const value = values[name];
      if (value === undefined) throw new Error(`no value for ${name}`);
      switch (type) {
        case gl.FLOAT: gl.uniform1f(at, value); break;
        case gl.INT: case gl.BOOL: gl.uniform1i(at, Number(value)); break;
        case gl.FLOAT_VEC2: gl.uniform2fv(at, value); break;
        case gl.FLOAT_VEC3: gl.uniform3fv(at, value); break;
        case gl.FLOAT_VEC4: gl.uniform4fv(at, value); break;
        case gl.FLOAT_MAT3: gl.uniformMatrix3fv(at, false, value); break;
        case gl.FLOAT_MAT4: gl.uniformMatrix4fv(at, false, value); break;
        default:
          gl.activeTexture(gl.TEXTURE0 + unit);
          gl.bindTexture(value.target, value.texture);
          gl.uniform1i(at, unit++);
      }
    }
  }
}

/** A texture of one level, not filtered unless asked. */
export function texture2D(gl, [internal, format, type], width, height, data = null, filter = gl.NEAREST) {
  const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
  if (Math.max(width, height) > most) throw new Error(`this graphics card has textures of up to ${most} x ${most}, not ${width} x ${height}`);
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, height, 0, format, type, data);
  settle(gl, gl.TEXTURE_2D, filter, filter);
  return { target: gl.TEXTURE_2D, texture, width, height };
}

/** Layers of 32 bits. */
export function layers(gl, width, height, data) {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D_ARRAY, texture);
  const depth = data.length / (width * height);
  gl.texImage3D(gl.TEXTURE_2D_ARRAY, 0, gl.R32UI, width, height, depth, 0, gl.RED_INTEGER, gl.UNSIGNED_INT, data);
  settle(gl, gl.TEXTURE_2D_ARRAY, gl.NEAREST, gl.NEAREST);
  return { target: gl.TEXTURE_2D_ARRAY, texture };
}

/** A cube map in half precision from levels of faces, divided by `unit`. */
export function cube(gl, { size, levels }, unit) {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_CUBE_MAP, texture);
  levels.forEach((faces, level) =>
    faces.forEach((texels, face) => {
      const side = size >> level;
      const scaled = texels.map((v) => v / unit);
      gl.texImage2D(gl.TEXTURE_CUBE_MAP_POSITIVE_X + face, level, gl.RGBA16F, side, side, 0, gl.RGBA, gl.FLOAT, scaled);
    }));
  settle(gl, gl.TEXTURE_CUBE_MAP, gl.LINEAR_MIPMAP_LINEAR, gl.LINEAR);
  return { target: gl.TEXTURE_CUBE_MAP, texture };
}

function settle(gl, target, smaller, larger) {
  gl.texParameteri(target, gl.TEXTURE_MIN_FILTER, smaller);
  gl.texParameteri(target, gl.TEXTURE_MAG_FILTER, larger);
  gl.texParameteri(target, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.texParameteri(target, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
}

/** What can be drawn into: textures of a format and size, and depth where asked. */
export class Target {
  constructor(gl, format, width, height, { count = 1, depth = false, filter = gl.NEAREST } = {}) {
    Object.assign(this, { gl, width, height });
    this.textures = [...Array(count)].map(() => texture2D(gl, format, width, height, null, filter));
    this.framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    const places = this.textures.map((_, k) => gl.COLOR_ATTACHMENT0 + k);
    this.textures.forEach(({ texture }, k) =>
      gl.framebufferTexture2D(gl.FRAMEBUFFER, places[k], gl.TEXTURE_2D, texture, 0));
    gl.drawBuffers(places);
    if (depth) {
      this.depth = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, this.depth);
      gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, this.depth);
    }
    if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE)
      throw new Error("this graphics card cannot draw into floating-point textures");
  }

  get texture() {
    return this.textures[0];
  }

  /** Draws go here from now on, all of it. */
  bind() {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, this.framebuffer);
    this.gl.viewport(0, 0, this.width, this.height);
  }

  free() {
    const { gl } = this;
    this.textures.forEach(({ texture }) => gl.deleteTexture(texture));
    if (this.depth) gl.deleteRenderbuffer(this.depth);
    gl.deleteFramebuffer(this.framebuffer);
  }
}
