// Views of the page beside the sRGB curve: OpenColorIO's shader of each, and its tables as textures.

/** @import { Table, ViewRow } from "./types.d.ts" */

/**
 * @typedef {Table & { values: Float32Array<ArrayBuffer> }} FilledTable
 * @typedef {{ kind: number, name: WebGLTexture, sampler: string }} Texture
 * @typedef {Map<Shader, Texture[]>} Kept
 */

const BYTES = 4; // of a value

export class Views {
  // rows: of contents.json; loaded: called once a view can be drawn, or is known to be missing.
  /**
   * @param {ViewRow[]} rows
   * @param {() => void} loaded
   */
  constructor(rows, loaded) {
    this.rows = rows;
    this.loaded = loaded;
    this.problems = new Map(); // name -> why it cannot be drawn
    this.shaders = new Map(); // name -> Shader, or undefined while it is loaded
  }

  // The shader of a view: null for the sRGB curve, undefined while it is loaded.
  /** @type {(name: string) => Shader | null | undefined} */
  get(name) {
    const row = this.rows.find((one) => one.name === name);
    if (!row?.file) return null;
    if (!this.shaders.has(name)) {
      this.shaders.set(name, undefined);
      this.load(row);
    }
    return this.shaders.get(name);
  }

  /** @type {(row: ViewRow) => Promise<void>} */
  async load({ name, label, file }) {
    try {
      const [head, values] = await Promise.all([fetch(`${file}.json`), fetch(`${file}.bin`)]);
      for (const answer of [head, values]) if (!answer.ok) throw new Error(`${answer.status} ${answer.statusText}`);
      this.shaders.set(name, new Shader(name, await head.json(), await values.arrayBuffer()));
    } catch (error) {
      this.problems.set(name, `View ${label}: cannot be loaded: ${/** @type {Error} */ (error).message}`);
    }
    this.loaded();
  }
}

export class Shader {
  // tables: [{ sampler, size, channels, smooth }]; buffer: their values, one after another.
  /**
   * @param {string} name
   * @param {{ text: string, tables: Table[] }} head
   * @param {ArrayBuffer} buffer
   */
  constructor(name, { text, tables }, buffer) {
    this.name = name;
    // The function vec3 screen(vec3 radiance). Shaders of ACES 1 divide by the brightness, and make black white.
    this.screen = `precision highp sampler3D;\n${text}
vec3 screen(vec3 x) {
  x = all(equal(x, vec3(0.0))) ? vec3(1e-10) : x;
  return clamp(to_screen(vec4(x, 1.0)).rgb, 0.0, 1.0);
}\n`;
    let start = 0;
    this.tables = tables.map((table) => {
      const count = table.size.reduce((product, n) => product * n, table.channels);
      const values = new Float32Array(buffer, start, count); // little-endian, as all machines with WebGL are
      start += BYTES * count;
      return { ...table, values };
    });
  }

  // Bind the tables to texture units from `unit` on. kept: Map of shader -> textures, of one context.
  /** @type {(gl: WebGL2RenderingContext, program: WebGLProgram, unit: number, kept: Kept) => void} */
  bind(gl, program, unit, kept) {
    gl.activeTexture(gl.TEXTURE0 + unit); // making a texture binds it
    if (!kept.has(this)) kept.set(this, this.tables.map((table) => upload(gl, table)));
    kept.get(this)?.forEach(({ kind, name, sampler }, i) => {
      gl.activeTexture(gl.TEXTURE0 + unit + i);
      gl.bindTexture(kind, name);
      gl.uniform1i(gl.getUniformLocation(program, sampler), unit + i);
    });
  }

  // The fragment shader of `encode`.
  get fragment() {
    return `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D values;
out vec4 shown;
${this.screen}
void main() { shown = vec4(screen(texelFetch(values, ivec2(gl_FragCoord.xy), 0).rgb), 1.0); }`;
  }

  // Return the codes of radiance: (height, width, 3) -> (height, width, 4). program: of `fragment`.
  /** @type {(gl: WebGL2RenderingContext, program: WebGLProgram, kept: Kept, radiance: Float32Array, width: number, height: number) => Uint8Array} */
  encode(gl, program, kept, radiance, width, height) {
    const [values, target] = [gl.createTexture(), gl.createTexture()];
    const frame = gl.createFramebuffer();
    gl.useProgram(program);
    this.bind(gl, program, 1, kept);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, target);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
    gl.bindTexture(gl.TEXTURE_2D, values);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, BYTES);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB32F, width, height, 0, gl.RGB, gl.FLOAT, radiance);
    for (const key of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, key, gl.NEAREST);
    gl.uniform1i(gl.getUniformLocation(program, "values"), 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
    gl.viewport(0, 0, width, height);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    const codes = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, codes);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.deleteFramebuffer(frame);
    for (const texture of [values, target]) gl.deleteTexture(texture);
    return codes;
  }
}

/** @type {(gl: WebGL2RenderingContext, table: FilledTable) => Texture} */
function upload(gl, { sampler, size, channels, smooth, values }) {
  // Where 32 bits cannot be interpolated, 16 can: an error of a tenth of a code.
  const half = smooth && !gl.getExtension("OES_texture_float_linear");
  const [inside, format] = channels === 1 ? [half ? gl.R16F : gl.R32F, gl.RED] : [half ? gl.RGB16F : gl.RGB32F, gl.RGB];
  const kind = size.length === 3 ? gl.TEXTURE_3D : gl.TEXTURE_2D;
  const name = gl.createTexture();
  gl.bindTexture(kind, name);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, BYTES);
  const [width, height, depth] = size;
  if (depth) gl.texImage3D(kind, 0, inside, width, height, depth, 0, format, gl.FLOAT, values);
  else gl.texImage2D(kind, 0, inside, width, height, 0, format, gl.FLOAT, values);
  const filter = smooth ? gl.LINEAR : gl.NEAREST;
  for (const key of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(kind, key, filter);
  for (const key of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R]) {
    gl.texParameteri(kind, key, gl.CLAMP_TO_EDGE);
  }
  return { kind, name, sampler };
}
