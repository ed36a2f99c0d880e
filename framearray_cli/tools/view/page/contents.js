// What of an array is there, as contents.json says: it may still be rendered.

export async function loadContents() {
  const answer = await fetch("contents.json", { cache: "no-cache" });
  if (!answer.ok) throw new Error(`contents.json: ${answer.status} ${answer.statusText}`);
  return new Contents(await answer.json());
}

export class Contents {
  constructor(table) {
    Object.assign(this, table); // live, index, stamp, lacking, streams
  }

  get isComplete() {
    return this.lacking[0] === 0;
  }

  // Changes with the sources of a stream and camera; "" if none of them is there.
  tag(stream, c) {
    return this.streams[stream.key].stamps[c];
  }

  has(stream, c, l) {
    const gaps = this.streams[stream.key].missing[c] ?? [];
    return Boolean(this.tag(stream, c)) && !gaps.some(([first, last]) => first <= l && l <= last);
  }
}
