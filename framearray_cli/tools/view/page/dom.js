// Elements of index.html, by their names.

/**
 * All names that are asked for are there, with elements of several kinds.
 * @param {string} id
 * @returns {any}
 */
export function byId(id) {
  return document.getElementById(id);
}
