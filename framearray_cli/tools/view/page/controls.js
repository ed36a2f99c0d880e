// Sliders and buttons for what the array has. They change the view and call `changed`.

/** @import { FrameArray } from "./array.js" */
/** @import { Change, Tint, View } from "./types.d.ts" */

import { byId } from "./dom.js";

/** @typedef {(change: Change) => void} Changed */

const MOST_INTENSITY = 4;

export class Controls {
  /**
   * @param {FrameArray} array
   * @param {View} view
   * @param {Changed} changed
   */
  constructor(array, view, changed) {
    this.array = array;
    /** @type {Change[]} */
    this.update = []; // functions that set a control to a view
    this.layers(changed);
    this.exposure(changed);
    this.axes(changed);
    this.groups(changed);
    this.show(view);
  }

  // Set all controls to a view.
  /** @type {(view: View) => void} */
  show(view) {
    for (const update of this.update) update(view);
  }

  /** @type {(changed: Changed) => void} */
  layers(changed) {
    const box = byId("layers");
    const all = [{ key: "picture", label: "Picture" }, ...this.array.layers];
    box.parentElement.querySelector("h2").hidden = box.hidden = all.length === 1;
    for (const { key, label } of all) {
      const input = element("input", { type: "radio", name: "layer", value: key });
      const holder = element("label", {}, input, element("span", {}, label));
      input.addEventListener("change", () => changed((view) => (view.show = key)));
      this.update.push((view) => (input.checked = view.show === key));
      box.append(holder);
    }
  }

  /** @type {(changed: Changed) => void} */
  exposure(changed) {
    const input = byId("exposure");
    const output = byId("exposure-value");
    input.addEventListener("input", () => changed((view) => (view.exposure = Number(input.value))));
    this.update.push((view) => {
      input.value = view.exposure;
      output.value = (view.exposure > 0 ? "+" : "") + view.exposure.toFixed(1).replace("-", "\u2212");
      input.setAttribute("aria-valuetext", `${view.exposure} stops`);
    });
  }

  /** @type {(changed: Changed) => void} */
  axes(changed) {
    const box = byId("axes");
    const { others } = this.array;
    if (others.length) box.append(element("h2", {}, "More lights"));
    for (const { name, n, times } of others) {
      const { input, output, holder } = slider(name, { min: 0, max: n - 1, step: 1, id: `axis-${name}` });
      input.addEventListener("input", () => changed((view) => (view.places[name] = Number(input.value))));
      this.update.push((view) => {
        input.value = view.places[name];
        output.value = view.places[name];
        const time = times ? `, ${times[view.places[name]]}` : "";
        output.title = time.slice(2);
        input.setAttribute("aria-valuetext", `position ${view.places[name]} of 0 to ${n - 1}${time}`);
      });
      box.append(holder);
    }
  }

  /** @type {(changed: Changed) => void} */
  groups(changed) {
    const { tinted } = this.array;
    if (!tinted.length) return;
    const box = byId("groups");
    box.append(element("h2", {}, "Light"));
    for (const name of tinted) this.tint(box, name, `group-${name}`, changed, (view) => view.tints[name]);
    if (this.array.streams.some((stream) => stream.role === "ambient")) {
      this.tint(box, "Ambient", "ambient", changed, (view) => view.ambient);
    }
  }

  /** @type {(box: HTMLElement, name: string, id: string, changed: Changed, of: (view: View) => Tint) => void} */
  tint(box, name, id, changed, of) {
    const { input, output, holder } = slider(name, { min: 0, max: MOST_INTENSITY, step: 0.05, id });
    const color = element("input", { type: "color", id: `${id}-color`, "aria-label": `${name}, colour` });
    holder.classList.add("coloured");
    const row = element("div", { class: "slider coloured" }, ...holder.children, color);
    row.querySelector("span").id = `${id}-name`;
    input.setAttribute("aria-labelledby", `${id}-name`);
    input.addEventListener("input", () => changed((view) => (of(view).intensity = Number(input.value))));
    color.addEventListener("input", () => changed((view) => (of(view).color = color.value)));
    this.update.push((view) => {
      input.value = of(view).intensity;
      color.value = of(view).color;
      output.value = of(view).intensity.toFixed(2);
    });
    box.append(row);
  }
}

/** @type {(name: string, attributes: Record<string, string | number>) => { input: any, output: any, holder: any }} */
function slider(name, attributes) {
  const input = element("input", { type: "range", ...attributes });
  const output = element("output", {});
  const holder = element("label", { class: "slider" }, element("span", { title: name }, name), input, output);
  return { input, output, holder };
}

/** @type {(tag: string, attributes: Record<string, string | number>, ...children: (Node | string)[]) => any} */
export function element(tag, attributes, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, String(value));
  node.append(...children);
  return node;
}
