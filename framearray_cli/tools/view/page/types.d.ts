// What the page reads and passes around: index.json of index.py, contents.json of contents.py, the state of the page.

import type { Planes } from "./planes.js";

// `sun`: azimuth clockwise from north, and height, degrees.
export type Axis = { name: string; n: number; times?: string[]; sun?: [number, number][] };

export type Stream = {
  key: string;
  role: "image" | "group" | "ambient" | "background" | "layer";
  label: string;
  axis: string; // "" if the light changes nothing
  n: number;
  exposed: boolean;
  scale: number; // 0: data, from low to high
  white: number;
  low: number;
  high: number;
};

export type Index = {
  name: string;
  digest: string;
  fps: number;
  resolution: [number, number];
  n_cameras: number;
  axes: Axis[];
  exposure: number;
  small: { factor: number; width: number; height: number; columns: number };
  streams: Stream[];
  panorama: boolean;
  has_exr: boolean; // the first stream is of single images in EXR
  clips?: { length: number; codec: string }; // in an export: pictures per clip, as WebCodecs names the codec
  background_ambient: number[];
  ambient: Record<string, number[][]>; // by group and position: RGB
};

export type Contents = {
  live: boolean;
  index: string;
  stamp: string;
  images: [number, number]; // there, and in the array
  lacking: [number, string];
  streams: Record<string, { stamps: string[]; missing: Record<string, [number, number][]> }>;
  coarse?: CoarseTable | null; // from the server, while the array is rendered
};

// `places`: by axis, the positions of the array that the coarse one has.
export type CoarseTable = { index: Index; contents: Contents; places: Record<string, number[]> };

export type Tint = { intensity: number; color: string };

// The state of the page.
export type View = {
  c: number;
  places: Record<string, number>; // by axis
  show: string;
  exposure: number;
  tints: Record<string, Tint>;
  ambient: Tint;
};

export type Change = (view: View) => unknown;

export type Place = { c: number; l: number };

// A stream of a picture, and the part of its tile or sheet that is drawn: left, top, width, height.
export type Part = { stream: Stream; l: number; factor: number[] };
export type DrawnPart = Part & { url: string; bitmap: ImageBitmap | Planes; part: number[] };

// A part of a coarse picture: its camera, and its light in the coarse array.
export type CoarsePart = Part & { c: number };

// A tile to load.
export type Item = { url: string; bytes: number; needed?: boolean };

export type Segment = { seconds: number; camera: number[]; light: number[]; places: Record<string, number> };
