// Draws a picture in one pass of WebGL 2: the sum of decoded tiles times factors, with exposure, in sRGB.

/** @import { Planes } from "./planes.js" */
/** @import { DrawnPart, Part } from "./types.d.ts" */

const CODES = 1024; // of a decoded tile, for which the curve of a picture of one part is tabulated
const KEPT_TEXTURES = 24; // beside the decoded tiles, so that a few steps back and forth upload nothing

const VERTEX = `#version 300 es
out vec2 at;
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  at = vec2(corner.x, 1.0 - corner.y);  // row 0 of a tile is at the top
  gl_Position = vec4(2.0 * corner - 1.0, 0.0, 1.0);
}`;

const HEAD = `#version 300 es
precision highp float;
precision highp sampler2D;
in vec2 at;
out vec4 shown;
uniform float exposure;

vec3 linear(vec3 c) {
  return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), greaterThan(c, vec3(0.04045)));
}
vec3 srgb(vec3 x) {
  x = clamp(x, 0.0, 1.0);
  return mix(12.92 * x, 1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, greaterThan(x, vec3(0.0031308)));
}
vec3 radiance(vec3 c, float scale, float white) {  // coding.py explains the curve
  vec3 y = linear(c), rest = 1.0 - y;
  return scale * 2.0 * y / (rest + sqrt(rest * rest + 4.0 * y / (white * white)));
}
vec3 heat(float t) {  // matplotlib's inferno, to 0.05: black, violet, orange, yellow; brighter is more
  vec3 c = vec3(25.093, -12.222, -23.116);
  c = c * t + vec3(-71.288, 32.554, 73.588);
  c = c * t + vec3(77.157, -33.416, -82.254);
  c = c * t + vec3(-41.709, 17.458, 44.645);
  c = c * t + vec3(11.617, -3.948, -16.257);
  c = c * t + vec3(0.106, 0.566, 4.118);
  c = c * t + vec3(0.000, 0.002, -0.037);
  return clamp(c, 0.0, 1.0);
}
`;

// Sample one small picture between its own texel centres, so that its neighbours in the sheet do not bleed in.
const SAMPLED = `vec3 code(sampler2D image, vec4 part) {
  vec2 inset = 0.5 / vec2(textureSize(image, 0));
  vec2 low = part.xy + inset, high = max(part.xy + part.zw - inset, part.xy + inset);
  return texture(image, clamp(part.xy + place() * part.zw, low, high)).rgb;
}
`;
// A pixel for a pixel: a quarter less time in software.
const FETCHED = `vec3 code(sampler2D image, vec4 part) {
  return texelFetch(image, ivec2(gl_FragCoord.x, float(textureSize(image, 0).y) - gl_FragCoord.y), 0).rgb;
}
`;

// Where a pixel of the screen lies in the picture, from the upper left corner; in a panorama that is seen in a direction.
const PLACE = "vec2 place() { return at; }\n";
const PLACE_AROUND = `uniform vec4 view;  // yaw, pitch, tangents of half the width and height
vec2 place() {
  vec2 ray = (2.0 * at - 1.0) * vec2(view.z, -view.w);
  float forward = cos(view.y) - ray.y * sin(view.y), up = sin(view.y) + ray.y * cos(view.y);
  float yaw = view.x + atan(ray.x, forward), pitch = atan(up, length(vec2(ray.x, forward)));
  return vec2(fract(0.5 + yaw / 6.2831853), 0.5 - pitch / 3.1415927);
}
`;

const LIGHT_MAIN = "void main() {\n  vec3 sum = vec3(0.0);\n#SUM  shown = vec4(srgb(sum * exp2(exposure)), 1.0);\n}";
// A table instead of six powers per pixel: a quarter less time for a drawing in software.
const CURVE_MAIN = `uniform sampler2D curve;
void main() {
  ivec3 at = ivec3(code(image0, part0) * 1023.0 + 0.5);
  shown = vec4(texelFetch(curve, ivec2(at.r, 0), 0).r, texelFetch(curve, ivec2(at.g, 0), 0).g,
    texelFetch(curve, ivec2(at.b, 0), 0).b, 1.0);
}`;
const BLANK = `void main() {
  float stripe = step(mod(gl_FragCoord.x + gl_FragCoord.y, 24.0), 6.0);
  shown = vec4(vec3(0.10 + 0.08 * stripe), 1.0);
}`;
const DATA_MAINS = {
  depth: "shown = vec4(srgb(vec3(0.01 + 0.9 * pow(1.0 - code(image0, part0).r, 2.5))), 1.0);",
  heat: "shown = vec4(heat(code(image0, part0).r), 1.0);",
  normal: "shown = vec4(code(image0, part0), 1.0);",
};

export class Picture {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {[number, number]} resolution
   * @param {{ view: number[] } | null} look around in a panorama
   */
  constructor(canvas, [width, height], look = null) {
    this.look = look;
    this.head = HEAD + (look ? PLACE_AROUND : PLACE);
    canvas.width = width;
    canvas.height = height;
    const options = { alpha: false, antialias: false, depth: false, preserveDrawingBuffer: true };
    const gl = /** @type {WebGL2RenderingContext | null} */ (canvas.getContext("webgl2", options));
    if (!gl) throw new Error("This page needs WebGL 2, and this browser has none, or it is switched off.");
    this.gl = gl;
    this.programs = new Map();
    this.textures = new Map(); // url -> texture, the least recently used first
    this.bytes = 0;
    this.curve = ""; // what its table is of
    /** @type {WebGLTexture | null} */
    this.table = null;
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => {
      this.programs.clear();
      this.textures.clear();
      this.bytes = 0;
      this.curve = "";
    });
    this.most = gl.getParameter(gl.MAX_TEXTURE_IMAGE_UNITS);
  }

  // parts: [{ stream, factor, url, bitmap, part: [left, top, width, height] }]; from: the share of the width that stays.
  /** @type {(parts: DrawnPart[], exposure: number, from?: number) => void} */
  draw(parts, exposure, from = 0) {
    const { gl, most } = this;
    if (parts.length > most) throw new Error(`This device adds at most ${most} pictures, not ${parts.length}.`);
    const program = this.program(parts);
    gl.useProgram(program);
    parts.forEach((one, i) => {
      gl.activeTexture(gl.TEXTURE0 + i);
      this.bind(one.url, one.bitmap);
      gl.uniform1i(gl.getUniformLocation(program, `image${i}`), i);
      gl.uniform4fv(gl.getUniformLocation(program, `part${i}`), one.part);
      gl.uniform3fv(gl.getUniformLocation(program, `factor${i}`), one.factor);
      gl.uniform2f(gl.getUniformLocation(program, `curve${i}`), one.stream.scale, one.stream.white);
    });
    gl.uniform1f(gl.getUniformLocation(program, "exposure"), exposure);
    if (parts.length === 1 && parts[0].stream.scale) {
      gl.activeTexture(gl.TEXTURE1);
      this.bindCurve(parts[0], exposure);
      gl.uniform1i(gl.getUniformLocation(program, "curve"), 1);
    }
    if (this.look) gl.uniform4fv(gl.getUniformLocation(program, "view"), this.look.view);
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    const first = Math.round(from * gl.drawingBufferWidth);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(first, 0, gl.drawingBufferWidth - first, gl.drawingBufferHeight);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.disable(gl.SCISSOR_TEST);
    this.forget(parts.length);
  }

  // Draw stripes: there is no picture here.
  blank() {
    const { gl } = this;
    if (!this.programs.has("blank")) this.programs.set("blank", link(gl, VERTEX, this.head + BLANK));
    gl.useProgram(this.programs.get("blank"));
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  // Return the drawn picture: RGBA, row 0 at the top. Waits for the drawing.
  /** @type {(rows?: number) => Uint8Array} */
  pixels(rows = this.gl.drawingBufferHeight) {
    const { gl } = this;
    const width = gl.drawingBufferWidth, height = gl.drawingBufferHeight;
    const flipped = new Uint8Array(4 * width * rows);
    gl.readPixels(0, height - rows, width, rows, gl.RGBA, gl.UNSIGNED_BYTE, flipped);
    const data = new Uint8Array(flipped.length);
    for (let y = 0; y < rows; y++) {
      data.set(flipped.subarray(4 * width * (rows - 1 - y), 4 * width * (rows - y)), 4 * width * y);
    }
    return data;
  }

  // The codes of a pixel that is drawn: red, green, blue. Waits for the drawing.
  /** @type {(pixel: [number, number]) => Uint8Array} */
  pixelAt([column, row]) {
    const { gl } = this;
    const codes = new Uint8Array(4);
    gl.readPixels(column, gl.drawingBufferHeight - 1 - row, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, codes);
    return codes.subarray(0, 3);
  }

  // Bind the table of what the screen shows of each code of a part.
  /** @type {(part: Part, exposure: number) => void} */
  bindCurve({ stream, factor }, exposure) {
    const { gl } = this, key = [stream.scale, stream.white, ...factor, exposure].join();
    if (this.curve === "") this.table = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.table);
    if (this.curve === key) return;
    this.curve = key;
    const rows = curveOf(stream, factor, exposure);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, CODES, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, rows);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    }
  }

  /** @type {(url: string, bitmap: ImageBitmap | Planes) => void} */
  bind(url, bitmap) {
    const { gl } = this;
    let texture = this.textures.get(url);
    if (texture) {
      this.textures.delete(url);
      this.textures.set(url, texture);
      gl.bindTexture(gl.TEXTURE_2D, texture.name);
      return;
    }
    texture = { name: gl.createTexture(), bytes: 4 * bitmap.width * bitmap.height };
    gl.bindTexture(gl.TEXTURE_2D, texture.name);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    if ("codes" in bitmap) { // 10 bits, so that a larger exposure shows no bands
      const { width, height } = bitmap, kind = gl.UNSIGNED_INT_2_10_10_10_REV;
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB10_A2, width, height, 0, gl.RGBA, kind, bitmap.codes());
    } else {
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
    }
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.LINEAR);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    this.textures.set(url, texture);
    this.bytes += texture.bytes;
  }

  /** @type {(needed: number) => void} */
  forget(needed) {
    for (const [url, texture] of this.textures) {
      if (this.textures.size <= Math.max(KEPT_TEXTURES, needed)) return;
      this.gl.deleteTexture(texture.name);
      this.textures.delete(url);
      this.bytes -= texture.bytes;
    }
  }

  // Return the program: there is one per number of parts, and one per kind of data, for pictures of any size and of this one.
  /** @type {(parts: DrawnPart[]) => WebGLProgram} */
  program(parts) {
    const { stream } = parts[0];
    const exact = !this.look && parts.every((one) => this.isWhole(one));
    const kind = `${stream.scale ? parts.length : stream.key} ${exact}`;
    if (this.programs.has(kind)) return this.programs.get(kind);
    const count = stream.scale ? parts.length : 1;
    let uniforms = "", sum = "";
    for (let i = 0; i < count; i++) {
      uniforms +=
        `uniform sampler2D image${i};\nuniform vec4 part${i};\nuniform vec3 factor${i};\nuniform vec2 curve${i};\n`;
      sum += `  sum += factor${i} * radiance(code(image${i}, part${i}), curve${i}.x, curve${i}.y);\n`;
    }
    const main = stream.scale && count === 1
      ? CURVE_MAIN
      : stream.scale
      ? LIGHT_MAIN.replace("#SUM", sum)
      : `void main() { ${DATA_MAINS[stream.key] ?? DATA_MAINS.heat} }`;
    const program = link(this.gl, VERTEX, this.head + (exact ? FETCHED : SAMPLED) + uniforms + main);
    this.programs.set(kind, program);
    return program;
  }

  // Whether a part has as many pixels as the canvas.
  /** @type {(part: DrawnPart) => boolean} */
  isWhole({ bitmap, part }) {
    const { drawingBufferWidth: width, drawingBufferHeight: height } = this.gl;
    return bitmap.width === width && bitmap.height === height && part.join() === "0,0,1,1";
  }
}

/** @type {(gl: WebGL2RenderingContext, vertex: string, fragment: string) => WebGLProgram} */
function link(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [type, text] of /** @type {const} */ ([[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]])) {
    const shader = /** @type {WebGLShader} */ (gl.createShader(type)); // null only where the context is lost
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    const logs = (gl.getAttachedShaders(program) ?? []).map((shader) => gl.getShaderInfoLog(shader));
    throw new Error(`shader: ${gl.getProgramInfoLog(program)} ${logs.join(" ")}`);
  }
  return program;
}

// What the screen shows of each code of red, green and blue, as `radiance` and `srgb` above: RGBA, 0 to 255.
/** @type {(stream: { scale: number, white: number }, factor: number[], exposure: number) => Uint8Array} */
function curveOf({ scale, white }, factor, exposure) {
  const rows = new Uint8Array(4 * CODES);
  for (let k = 0; k < CODES; k++) {
    const c = k / (CODES - 1), y = c > 0.04045 ? ((c + 0.055) / 1.055) ** 2.4 : c / 12.92, rest = 1 - y;
    const radiance = (scale * 2 * y) / (rest + Math.sqrt(rest * rest + (4 * y) / (white * white)));
    for (let channel = 0; channel < 3; channel++) {
      const x = Math.min(1, Math.max(0, radiance * factor[channel] * 2 ** exposure));
      rows[4 * k + channel] = Math.round(255 * (x > 0.0031308 ? 1.055 * x ** (1 / 2.4) - 0.055 : 12.92 * x));
    }
  }
  return rows;
}
