// Luma and chroma of a picture as a decoder has them, and their colours.

const LUMA = 4783, BLACK = 16; // 1024 times the codes of 10 bits per code of luma, which ends at 235
const FROM_V = [7365 / 16, -2189 / 16, 0], FROM_U = [0, -876 / 16, 8678 / 16]; // the same times Rec. 709, per 16th of a code

export class Planes {
  /**
   * @param {Uint8Array} data 8 bits, the range of movies; chroma of half the size lies between the pixels
   * @param {PlaneLayout[]} layout Y, U, V, or Y and UV in turns
   * @param {[number, number]} resolution of the picture; luma may have one column or row more
   */
  constructor(data, layout, [width, height]) {
    this.data = data;
    this.layout = layout;
    this.width = width;
    this.height = height;
  }

  get bytes() {
    return this.data.length;
  }

  // The codes of a row: red, green and blue with 10 bits each, from the lowest bit on, as WebGL packs them.
  /** @type {(y: number, codes: Uint32Array) => void} */
  row(y, codes) {
    const { data, layout, width, height } = this;
    const step = 4 - layout.length; // of chroma
    const columns = (width + 1) >> 1, rows = (height + 1) >> 1;
    const near = y >> 1, far = Math.min(rows - 1, Math.max(0, near + (y & 1 ? 1 : -1)));
    const [firstU, firstV] = step === 1
      ? [layout[1].offset, layout[2].offset]
      : [layout[1].offset, layout[1].offset + 1];
    const stride = layout[1].stride;
    let luma = layout[0].offset + layout[0].stride * y;
    const at = (first, line, x) => data[first + stride * line + step * x];
    // Between the two nearest rows, four times; then between the two nearest columns, sixteen times.
    const four = (first, x) => 3 * at(first, near, x) + at(first, far, x) - 512;
    let u0 = four(firstU, 0), v0 = four(firstV, 0), u1 = u0, v1 = v0;
    for (let x = 0; x < columns; x++) {
      const u2 = x + 1 < columns ? four(firstU, x + 1) : u1, v2 = x + 1 < columns ? four(firstV, x + 1) : v1;
      codes[2 * x] = packed(data[luma++], 3 * u1 + u0, 3 * v1 + v0);
      if (2 * x + 1 < width) codes[2 * x + 1] = packed(data[luma++], 3 * u1 + u2, 3 * v1 + v2);
      [u0, v0, u1, v1] = [u1, v1, u2, v2];
    }
  }

  // All codes.
  /** @type {() => Uint32Array} */
  codes() {
    const codes = new Uint32Array(this.width * this.height);
    for (let y = 0; y < this.height; y++) this.row(y, codes.subarray(y * this.width, (y + 1) * this.width));
    return codes;
  }

  // The codes of a pixel, red, green and blue, 0 to 255.
  /** @type {(x: number, y: number) => number[]} */
  codesAt(x, y) {
    const codes = new Uint32Array(this.width);
    this.row(y, codes);
    return [0, 10, 20].map((shift) => ((codes[x] >>> shift) & 1023) * (255 / 1023));
  }

  close() {}
}

// The colour of a luma code, and of 16 times the codes of chroma.
/** @type {(luma: number, u: number, v: number) => number} */
function packed(luma, u, v) {
  const y = LUMA * (luma - BLACK) + 512;
  const red = (y + FROM_V[0] * v) >> 10, blue = (y + FROM_U[2] * u) >> 10;
  const green = (y + FROM_V[1] * v + FROM_U[1] * u) >> 10;
  return (0xc0000000 | limited(red) | (limited(green) << 10) | (limited(blue) << 20)) >>> 0;
}

/** @type {(code: number) => number} */
function limited(code) {
  return code < 0 ? 0 : code > 1023 ? 1023 : code;
}
