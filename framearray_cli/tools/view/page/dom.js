// Elements of index.html, by their names.

/**
 * All names that are asked for are there, with elements of several kinds.
 * @param {string} id
 * @returns {any}
 */
export function byId(id) {
  return document.getElementById(id);
}

// Have the browser save what is at an address.
/** @type {(url: string, name: string) => void} */
export function download(url, name) {
  const link = document.createElement("a");
  Object.assign(link, { href: url, download: name });
  link.click();
}

/** @type {(blob: Blob, name: string) => void} */
export function downloadBlob(blob, name) {
  const url = URL.createObjectURL(blob);
  download(url, name);
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}
