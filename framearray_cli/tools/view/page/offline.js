// Answers the requests of a page that is opened as a file: browsers let it load scripts, and nothing else. Not a module.

(() => {
  const KEPT = 256; // scripts of tiles in memory
  const POSITIONS = 12; // of the light in a script, as in clips.py
  /** @type {Map<string, Record<string, string>>} */
  const arrived = new Map(); // script -> its files: name -> base64
  /** @type {Map<string, Promise<Record<string, string>>>} */
  const scripts = new Map(); // the least recently used first

  /** @type {(script: string, files: Record<string, string>) => void} */
  const take = (script, files) => void arrived.set(script, files);

  // Load a script; its files, none where it is missing.
  /** @type {(script: string) => Promise<Record<string, string>>} */
  const load = (script) => {
    const known = scripts.get(script) ?? new Promise((done) => {
      const node = document.createElement("script");
      node.src = script;
      node.onload = node.onerror = () => {
        done(arrived.get(script) ?? {});
        arrived.delete(script);
        node.remove();
      };
      document.head.append(node);
    });
    scripts.delete(script);
    scripts.set(script, known);
    for (const old of scripts.keys()) if (scripts.size > KEPT) scripts.delete(old);
    return known;
  };

  // The part of a script's name for a light position; none for sheets.
  /** @type {(l?: string) => string} */
  const lights = (l) => (l ? `.l${String(Number(l) - (Number(l) % POSITIONS)).padStart(3, "0")}` : "");

  /** @type {(url: string) => Promise<Response>} */
  const answer = async (url) => {
    const name = url.split("?")[0];
    const [, key, camera, l, kind] = /^tiles\/([^/]+)\/(c\d+)(?:\.l(\d+))?\.(jpg|clip)$/.exec(name) ?? [];
    const layer = kind === "clip" && !l ? `${key}.` : ""; // by cameras
    const files = key ? await load(`tiles/${layer}${camera}${lights(l)}.js`) : arrived.get("data.js") ?? {};
    if (!(name in files)) return new Response(`${name}: no such file`, { status: 404 });
    const text = atob(files[name]), data = new Uint8Array(text.length);
    for (let i = 0; i < data.length; i++) data[i] = text.charCodeAt(i);
    return new Response(data);
  };

  Object.assign(globalThis, { framearrayFiles: take, fetch: answer });
})();
