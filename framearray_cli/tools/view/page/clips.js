// Decodes clips: WebM with a few pictures in VP9, of which only the first is a key frame.

import { Planes } from "./planes.js";

/** @typedef {{ decodesBy: string, clips?: { codec: string }, resolution: [number, number] }} Coded */
/** @typedef {(index: number, picture: Planes | ImageBitmap) => void} Take */

const SEGMENT = 0x18538067, CLUSTER = 0x1f43b675, GROUP = 0xa0, BLOCK = 0xa1, SIMPLE_BLOCK = 0xa3; // elements of WebM
const BLOCK_HEAD = 4; // bytes: track, time, flags
const RATE = 10; // frames per second, as in clips.py
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

// Call `take` with pictures of a clip, given their indices, the most urgent first.
/** @type {(array: Coded, data: Uint8Array, wanted: number[], signal: AbortSignal, take: Take) => Promise<void>} */
export async function decodeClip(array, data, wanted, signal, take) {
  if (array.decodesBy === "frames") return decodeFrames(array, data, wanted, signal, take);
  await seekFrames(array, data, wanted, signal, take);
}

/** @type {(array: Coded, data: Uint8Array, wanted: number[], signal: AbortSignal, take: Take) => Promise<void>} */
async function decodeFrames({ clips, resolution }, data, wanted, signal, take) {
  /** @type {Promise<void>[]} */
  const copies = [];
  const one = idle.pop() ?? new Decoder();
  one.output = (frame) => {
    const index = frame.timestamp;
    if (wanted.includes(index)) copies.push(copy(frame, resolution).then((picture) => take(index, picture)));
    else frame.close();
  };
  const stop = () => one.close();
  signal.addEventListener("abort", stop);
  try {
    await one.decode(clips?.codec ?? "", data, Math.max(...wanted));
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

  // Output the frames of a clip up to the last.
  /** @type {(codec: string, data: Uint8Array, last: number) => Promise<void>} */
  async decode(codec, data, last) {
    const { decoder } = this;
    if (decoder.state === "unconfigured") decoder.configure(configuration(codec));
    let index = 0;
    for (const chunk of blocks(data)) {
      decoder.decode(new EncodedVideoChunk({ type: index ? "delta" : "key", timestamp: index, data: chunk }));
      if (++index > last) break;
    }
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

/** @type {(array: Coded, data: Uint8Array, wanted: number[], signal: AbortSignal, take: Take) => Promise<void>} */
async function seekFrames({ resolution }, data, wanted, signal, take) {
  const video = document.createElement("video");
  video.muted = true;
  video.src = URL.createObjectURL(new Blob([/** @type {BlobPart} */ (data)], { type: "video/webm" }));
  try {
    for (const index of wanted) {
      if (signal.aborted) return;
      await sought(video, (index + 0.5) / RATE);
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

// The frames in an element of WebM.
/** @type {(data: Uint8Array, at?: number, end?: number) => Generator<Uint8Array>} */
function* blocks(data, at = 0, end = data.length) {
  while (at < end) {
    const [id, sizeAt] = number(data, at, false);
    const [size, body] = number(data, sizeAt, true);
    const after = Math.min(end, body + size);
    if (id === SEGMENT || id === CLUSTER || id === GROUP) yield* blocks(data, body, after);
    else if (id === BLOCK || id === SIMPLE_BLOCK) yield data.subarray(body + BLOCK_HEAD, after);
    at = after;
  }
}

// A number of variable length, and where it ends; leading zeros of its first byte count the bytes that follow.
/** @type {(data: Uint8Array, at: number, isSize: boolean) => [number, number]} */
function number(data, at, isSize) {
  const more = Math.clz32(data[at]) - 24;
  let value = isSize ? data[at] & (0x7f >> more) : data[at];
  for (let i = 1; i <= more; i++) value = 256 * value + data[at + i];
  const isOpen = isSize && value === 2 ** (7 * (more + 1)) - 1; // a size that is not known: to the end
  return [isOpen ? Infinity : value, at + more + 1];
}
