// Decodes clips: a few pictures in VP9. The one in the middle is a key frame, and two arms go from there to both ends, each
// frame coded from the one before, as clips.py says.

import { Planes } from "./planes.js";

/** @typedef {{ decodesBy: string, clips?: { codec: string }, resolution: [number, number] }} Coded */
/** @typedef {(index: number, picture: Planes | ImageBitmap) => void} Take */
/** @typedef {(array: Coded, chunks: Uint8Array[], indices: number[], wanted: number[], signal: AbortSignal, take: Take) => Promise<void>} Decode */

const RATE = 10; // frames per second of the video that a clip becomes where there is no WebCodecs
/** @type {ImageBitmapOptions} */
export const AS_CODED = { premultiplyAlpha: "none", colorSpaceConversion: "none" };

// How this browser decodes clips: "frames" by WebCodecs, which pages from plain http lack; "video" by a video element; or "".
/** @type {(codec: string) => Promise<string>} */
export async function waysToDecode(codec) {
  if ("VideoDecoder" in globalThis) {
    const { supported } = await VideoDecoder.isConfigSupported(configuration(codec)).catch(() => ({
      supported: false,
    }));
    if (supported) return "frames";
  }
  return document.createElement("video").canPlayType(`video/webm; codecs="${codec}"`) ? "video" : "";
}

/** @type {(codec: string) => VideoDecoderConfig} */
function configuration(codec) {
  return { codec, optimizeForLatency: true, hardwareAcceleration: "prefer-software" };
}

// Call `take` with pictures of a clip, given their indices, those beside the first one first.
/** @type {(array: Coded, data: Uint8Array, wanted: number[], signal: AbortSignal, take: Take) => Promise<void>} */
export async function decodeClip(array, data, wanted, signal, take) {
  const chunks = packets(data);
  const middle = chunks.length >> 1;
  const before = wanted.filter((index) => index < middle), after = wanted.filter((index) => index >= middle);
  const decode = array.decodesBy === "frames" ? decodeFrames : seekFrames;
  for (const some of wanted[0] < middle ? [before, after] : [after, before]) {
    if (!some.length || signal.aborted) continue;
    const step = some === before ? -1 : 1;
    const length = 1 + Math.max(...some.map((index) => Math.abs(index - middle)));
    const arm = Array.from({ length }, (_, k) => middle + step * k);
    await decode(array, arm.map((index) => chunks[index]), arm, some, signal, take);
  }
}

// The packets of a clip.
/** @type {(data: Uint8Array) => Uint8Array[]} */
function packets(data) {
  const numbers = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const count = numbers.getUint32(0, true);
  let at = 4 * (count + 1);
  return Array.from({ length: count }, (_, k) => data.subarray(at, at += numbers.getUint32(4 * (k + 1), true)));
}

/** @type {Decode} */
async function decodeFrames({ clips, resolution }, chunks, indices, wanted, signal, take) {
  /** @type {Promise<void>[]} */
  const copies = [];
  const one = idle.pop() ?? new Decoder();
  one.output = (frame) => {
    const index = indices[frame.timestamp];
    if (wanted.includes(index)) copies.push(copy(frame, resolution).then((picture) => take(index, picture)));
    else frame.close();
  };
  const stop = () => one.close();
  signal.addEventListener("abort", stop);
  try {
    await one.decode(clips?.codec ?? "", chunks);
    await Promise.all(copies);
    if (!signal.aborted) idle.push(one);
  } catch (error) {
    one.close();
    throw error;
  } finally {
    signal.removeEventListener("abort", stop);
  }
}

/** @type {Decoder[]} */
const idle = []; // a new one takes as long as ten frames

class Decoder {
  constructor() {
    /** @type {(frame: VideoFrame) => void} */
    this.output = (frame) => frame.close();
    /** @type {Error | undefined} */
    this.failure = undefined;
    this.decoder = new VideoDecoder({
      output: (frame) => this.output(frame),
      error: (error) => this.failure = error,
    });
  }

  // Output the frames of some chunks, of which the first is a key frame.
  /** @type {(codec: string, chunks: Uint8Array[]) => Promise<void>} */
  async decode(codec, chunks) {
    const { decoder } = this;
    if (decoder.state === "unconfigured") decoder.configure(configuration(codec));
    chunks.forEach((data, k) =>
      decoder.decode(new EncodedVideoChunk({ type: k ? "delta" : "key", timestamp: k, data }))
    );
    try {
      await decoder.flush();
    } catch (error) {
      throw this.failure ?? error;
    }
  }

  close() {
    if (this.decoder.state !== "closed") this.decoder.close();
  }
}

// The planes of a frame, which take a fifth of the time of a picture; this only for formats that are none of these.
/** @type {(frame: VideoFrame, resolution: [number, number]) => Promise<Planes | ImageBitmap>} */
async function copy(frame, resolution) {
  try {
    if (frame.format !== "I420" && frame.format !== "NV12") {
      return await createImageBitmap(frame, 0, 0, ...resolution, AS_CODED);
    }
    const data = new Uint8Array(frame.allocationSize());
    return new Planes(data, await frame.copyTo(data), resolution);
  } finally {
    frame.close();
  }
}

/** @type {Decode} */
async function seekFrames({ resolution }, chunks, indices, wanted, signal, take) {
  const video = document.createElement("video");
  video.muted = true;
  video.src = URL.createObjectURL(asWebM(chunks, resolution));
  try {
    for (const index of wanted) {
      if (signal.aborted) return;
      await sought(video, (indices.indexOf(index) + 0.5) / RATE);
      take(index, await createImageBitmap(video, 0, 0, ...resolution, AS_CODED));
    }
  } finally {
    URL.revokeObjectURL(video.src);
    video.removeAttribute("src");
    video.load();
  }
}

// Resolves when a video shows the frame of a time.
/** @type {(video: HTMLVideoElement, seconds: number) => Promise<void>} */
function sought(video, seconds) {
  return new Promise((done, fail) => {
    // A seek may end before its frame is there.
    const look = () => !video.seeking && video.readyState >= video.HAVE_CURRENT_DATA && done();
    video.onseeked = video.onloadeddata = video.oncanplay = look;
    video.onerror = () => fail(new Error(video.error?.message || "not a clip"));
    video.currentTime = seconds;
  });
}

// Packets as a file of WebM, of which the first is a key frame. Identifiers are those of Matroska, RFC 9559.
/** @type {(chunks: Uint8Array[], resolution: [number, number]) => Blob} */
function asWebM(chunks, [width, height]) {
  const ms = 1000 / RATE;
  const head = element(0x1a45dfa3, element(0x4282, text("webm")), element(0x4287, [4]), element(0x4285, [2]));
  const length = new DataView(new ArrayBuffer(8));
  length.setFloat64(0, chunks.length * ms);
  const info = element(0x1549a966, element(0x2ad7b1, word(1e6)), element(0x4489, new Uint8Array(length.buffer)));
  const colour = element(0x55b0, element(0x55b1, [1]), element(0x55b9, [1])); // Rec. 709, luma from 16 to 235
  const size = [element(0xb0, word(width + width % 2)), element(0xba, word(height + height % 2))];
  const entry = [element(0xd7, [1]), element(0x73c5, [1]), element(0x83, [1]), element(0x86, text("V_VP9"))];
  const tracks = element(0x1654ae6b, element(0xae, ...entry, element(0xe0, ...size, colour)));
  const cues = (at) =>
    element(0x1c53bb6b, element(0xbb, element(0xb3, [0]), element(0xb7, element(0xf7, [1]), element(0xf1, word(at)))));
  const start = info.length + tracks.length + cues(0).length;
  const blocks = chunks.map((data, k) => element(0xa3, [0x81, (k * ms) >> 8, (k * ms) & 255, k ? 0 : 0x80], data) // track, time, whether it is a key frame
  );
  const cluster = element(0x1f43b675, element(0xe7, [0]), ...blocks);
  const segment = element(0x18538067, info, tracks, cues(start), cluster);
  return new Blob([head, segment].map((part) => /** @type {BlobPart} */ (part)), { type: "video/webm" });
}

// An element of WebM: identifier, size, body.
/** @type {(id: number, ...parts: (Uint8Array | number[])[]) => Uint8Array} */
function element(id, ...parts) {
  const size = parts.reduce((sum, part) => sum + part.length, 0);
  const head = [...word(id).subarray(Math.clz32(id) >> 3), 0x08, ...word(size)]; // a size of five bytes
  const data = new Uint8Array(head.length + size);
  data.set(head);
  let at = head.length;
  for (const part of parts) {
    data.set(part, at);
    at += part.length;
  }
  return data;
}

/** @type {(value: number) => Uint8Array} */
function word(value) {
  return Uint8Array.of(value >>> 24, value >>> 16, value >>> 8, value);
}

/** @type {(letters: string) => Uint8Array} */
function text(letters) {
  return new TextEncoder().encode(letters);
}
