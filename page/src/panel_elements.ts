// SPDX-License-Identifier: MIT
//
// What cards are made of: elements, numbers that take comma or point, sliders.

import { words } from "./words.ts";
import { read, short } from "./words_numbers.ts";

export type Child = Node | string | null | false | undefined;
type Attribute = string | number | boolean | undefined | ((event: Event) => void);

/** An element with its attributes (functions listen to the event of their name) and children. */
export function make<K extends keyof HTMLElementTagNameMap>(tag: K, attributes: Readonly<Record<string, Attribute>> = {}, ...children: readonly Child[]): HTMLElementTagNameMap[K] {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") node.addEventListener(name, value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== undefined) node.setAttribute(name, String(value));
  }
  for (const child of children) if (child !== null && child !== false && child !== undefined) node.append(child);
  return node;
}

/** A drawing of 24 x 24 units, filled. */
export function icon(path: string): SVGSVGElement {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("aria-hidden", "true");
  const shape = document.createElementNS("http://www.w3.org/2000/svg", "path");
  shape.setAttribute("d", path);
  svg.append(shape);
  return svg;
}

let sayTimer = 0;
/** Tell the user a line. */
export function say(text: string, seconds = 6): void {
  const node = document.getElementById("say");
  if (!node) return;
  node.textContent = text;
  node.classList.add("on");
  clearTimeout(sayTimer);
  sayTimer = window.setTimeout(() => node.classList.remove("on"), 1000 * seconds);
}

export interface NumberField { readonly node: HTMLInputElement; show(value: number): void }

/** A number that can be typed. set: says why not, or null. */
export function numberField(name: string, set: (value: number) => string | null, unit = ""): NumberField {
  let shown = NaN;
  const node = make("input", { class: "number", type: "text", inputmode: "decimal", autocomplete: "off", spellcheck: "false", "aria-label": unit ? `${name}, ${unit}` : name });
  const show = (value: number): void => {
    if (Object.is(value, shown) || document.activeElement === node) return;
    shown = value;
    node.value = short(value);
    node.removeAttribute("aria-invalid");
  };
  node.addEventListener("change", () => {
    const value = read(node.value), why = Number.isNaN(value) ? words.notANumber(node.value) : set(value);
    if (why) { node.setAttribute("aria-invalid", "true"); say(why); } else { node.removeAttribute("aria-invalid"); shown = NaN; }
  });
  node.addEventListener("focus", () => node.select());
  node.addEventListener("blur", () => { if (node.getAttribute("aria-invalid")) { node.removeAttribute("aria-invalid"); const back = shown; shown = NaN; show(back); } });
  node.addEventListener("keydown", (event) => { if (event.key === "Enter") node.blur(); });
  return { node, show };
}

/** "size x": where there is no room, its last word alone. */
function named(name: string): Node[] {
  const [, kind, own] = /^(.* )(.)$/.exec(name) ?? ["", "", name];
  return [make("span", { class: "kind" }, kind ?? ""), make("span", {}, own ?? name)];
}

export interface Slider { readonly node: HTMLElement; readonly range: HTMLInputElement; show(value: number): void }

/** A slider over low .. high in equal ratios, with its number beside it. set: of a slider that is moved; typed: of a
 * number typed, says why not or null. */
export function slider(name: string, kind: string, unit: string, bounds: () => readonly [number, number], set: (value: number) => void, typed: (value: number) => string | null): Slider {
  const steps = 400, field = numberField(name, typed, unit);
  const range = make("input", { type: "range", min: 0, max: steps, step: 1, "aria-label": name });
  const node = make("div", { class: `slider ${kind}` }, make("span", { class: "name" }, ...named(name)), field.node, make("span", { class: "unit" }, unit), range);
  const paint = (): void => {
    const part = Number(range.value) / steps;
    // The thumb's middle isn't at the part of the width: it stays within.
    range.style.setProperty("--at", `calc(0.75rem + ${(100 * part).toFixed(2)}% - ${(1.5 * part).toFixed(3)}rem)`);
  };
  let shown = "", held = false;
  const told = (value: number): void => range.setAttribute("aria-valuetext", `${short(value)} ${unit}`);
  range.addEventListener("input", () => {
    const [low, high] = bounds(), value = low * (high / low) ** (Number(range.value) / steps);
    paint();
    told(value);
    set(value);
  });
  range.addEventListener("pointerdown", () => { held = true; });
  for (const end of ["pointerup", "pointercancel", "change", "blur"]) range.addEventListener(end, () => { held = false; });
  return {
    node, range,
    show(value) {
      field.show(value);
      const [low, high] = bounds(), all = `${value} ${low} ${high}`;
      if (held || all === shown) return;
      shown = all;
      range.value = String(Math.round((steps * Math.log(value / low)) / Math.log(high / low)));
      told(value);
      paint();
    },
  };
}

export function button(text: string | Node, press: () => void, attributes: Readonly<Record<string, Attribute>> = {}): HTMLButtonElement {
  return make("button", { type: "button", class: "pill", click: press, ...attributes }, text);
}

export function check(text: string, on: boolean, set: (on: boolean) => void): { readonly node: HTMLElement; show(on: boolean): void } {
  const input = make("input", { type: "checkbox", change: () => set(input.checked) });
  input.checked = on;
  return { node: make("label", { class: "check" }, input, make("span", {}, text)), show(value) { input.checked = value; } };
}

/** A choice of named values. */
export function choice(name: string, options: readonly (readonly [string, string])[], set: (value: string) => void): { readonly node: HTMLElement; readonly select: HTMLSelectElement; show(value: string): void } {
  const select = make("select", { "aria-label": name, change: () => set(select.value) }, ...options.map(([value, text]) => make("option", { value }, text)));
  return { node: make("label", { class: "field" }, make("span", {}, name), select), select, show(value) { select.value = value; } };
}

/** Put a text onto the clipboard; where there is none, it is shown to be copied by hand. */
export async function copied(text: string, shown: HTMLInputElement | HTMLTextAreaElement): Promise<void> {
  try { await navigator.clipboard.writeText(text); say(words.keep.copied, 3); }
  catch { shown.hidden = false; shown.value = text; shown.select(); say(words.keep.linked, 3); }
}

/** Save bytes as a file. */
export function save(name: string, content: Blob): void {
  const url = URL.createObjectURL(content), link = make("a", { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 30_000);
}
