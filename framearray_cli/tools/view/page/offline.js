// Answers the requests of a page that is opened as a file: browsers let it load scripts, and nothing else. Not a module.

(() => {
  const KEPT = 48; // scripts of tiles in memory, each with those of a camera
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

  /** @type {(url: string) => Promise<Response>} */
  const answer = async (url) => {
    const name = url.split("?")[0];
    const tile = /\/(c\d+)(\.l\d+)?\.jpg$/.exec(name);
    const files = tile ? await load(`tiles/${tile[1]}${tile[2] ? "" : ".sheets"}.js`) : arrived.get("data.js") ?? {};
    if (!(name in files)) return new Response(`${name}: no such file`, { status: 404 });
    return new Response(Uint8Array.from(atob(files[name]), (one) => one.charCodeAt(0)));
  };

  Object.assign(globalThis, { framearrayFiles: take, fetch: answer });
})();
