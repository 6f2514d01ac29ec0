// SPDX-License-Identifier: MIT

import type { Card, Desk } from "./panel.ts";
import { button, check, make } from "./panel_elements.ts";
import { hasFlywheel } from "./poinsot.ts";
import { words } from "./words.ts";
import { short } from "./words_numbers.ts";

/** Product of inertia, relative to the largest moment, below which it is shown as 0. */
const VANISHED = 2e-5;
const UNTURNED = [1, 0, 0, 0, 1, 0, 0, 0, 1] as const;

type Matrix = readonly number[];

/** The card with the tensor's nine numbers in axes that the user turns, and shapes that represent the tensor. */
export function tensorCard(desk: Desk): Card {
  const { motion, look } = desk, w = words.inertia;
  let base: Matrix = UNTURNED;
  const matrix = make("table", { class: "matrix" }), said = make("p");
  const turns = w.turn.map((name, k) => {
    const input = make("input", { type: "range", min: -180, max: 180, step: 1, value: 0, "aria-label": name, input: () => draw() });
    return { input, node: make("div", { class: `slider ${"xyz"[k]}` }, make("span", { class: "name" }, name), make("span"), make("span", { class: "unit" }), input) };
  });
  const begin = (from: Matrix) => (): void => {
    base = from === UNTURNED ? UNTURNED : rightHanded(motion.body().axes);
    for (const { input } of turns) input.value = "0";
    draw();
  };
  const draw = (): void => {
    const angles = turns.map(({ input }) => (Number(input.value) * Math.PI) / 180), turned = times(base, rotation(angles));
    turns.forEach(({ input, node }) => {
      const part = (Number(input.value) + 180) / 360;
      node.querySelector(".unit")!.textContent = `${input.value}°`.replace("-", "−");
      input.setAttribute("aria-valuetext", `${input.value}°`);
      input.style.setProperty("--at", `calc(0.75rem + ${100 * part}% - ${1.5 * part}rem)`);
    });
    look.turned = turned;
    const there = times(transposed(turned), times(motion.body().inertia, turned)), largest = Math.max(there[0]!, there[4]!, there[8]!);
    let product = 0;
    matrix.replaceChildren(...[0, 1, 2].map((i) => make("tr", {}, ...[0, 1, 2].map((j) => {
      const value = there[3 * i + j]!, part = Math.abs(value) / largest, moment = i === j;
      if (!moment) product = Math.max(product, part);
      const cell = make("td", {}, short(!moment && part < VANISHED ? 0 : value));
      cell.style.background = moment ? `rgba(51, 85, 200, ${0.06 + 0.3 * part})` : `rgba(245, 134, 46, ${Math.min(0.75, 1.6 * Math.sqrt(part < VANISHED ? 0 : part))})`;
      return cell;
    }))));
    said.textContent = product < VANISHED ? w.none : w.products(short(100 * product, 2));
    said.className = product < VANISHED ? "good" : "";
  };
  const shapes: (() => void)[] = [];
  const shape = (text: string, name: "inertiaBox" | "ellipsoid" | "principal" | "boundingBox" | "poinsot" | "cones"): HTMLElement => {
    const { node: row, show } = check(text, look[name], (on) => { look[name] = on; });
    row.dataset["mark"] = name;
    shapes.push(() => show(look[name]));
    return row;
  };
  const rolls = make("p", { class: "note" });
  const node = make("div", {}, make("p", { class: "note" }, w.about), matrix, said, make("div", { class: "sliders", "data-mark": "turn" }, ...turns.map(({ node: row }) => row)),
    make("div", { class: "row" }, button(w.principal, begin([])), button(w.mesh, begin(UNTURNED))),
    make("h3", {}, w.shapes), shape(w.box, "inertiaBox"), shape(w.ellipsoid, "ellipsoid"), shape(w.axes, "principal"), shape(w.bounding, "boundingBox"),
    make("h3", {}, w.poinsot), shape(w.rolls, "poinsot"), shape(w.cones, "cones"), rolls);
  return {
    node, changed: () => { draw(); for (const each of shapes) each(); rolls.textContent = hasFlywheel(motion) ? w.poinsotFlywheel : w.poinsotNote; },
    closed: () => { look.turned = null; },
  };
}

function times(a: Matrix, b: Matrix): Matrix {
  return [0, 1, 2].flatMap((i) => [0, 1, 2].map((j) => a[3 * i]! * b[j]! + a[3 * i + 1]! * b[3 + j]! + a[3 * i + 2]! * b[6 + j]!));
}

function transposed(a: Matrix): Matrix { return [0, 3, 6, 1, 4, 7, 2, 5, 8].map((k) => a[k]!); }

/** Matrix of successive rotations about x, y and z, each about the axis as rotated so far. */
function rotation(angles: readonly number[]): Matrix {
  const [a, b, c] = angles.map((angle) => [Math.cos(angle), Math.sin(angle)] as const) as [readonly [number, number], readonly [number, number], readonly [number, number]];
  return times(times([1, 0, 0, 0, a[0], -a[1], 0, a[1], a[0]], [b[0], 0, b[1], 0, 1, 0, -b[1], 0, b[0]]), [c[0], -c[1], 0, c[1], c[0], 0, 0, 0, 1]);
}

/** The axes made right-handed by the sign of the third one. */
function rightHanded(axes: Matrix): Matrix {
  const [a, b, c, d, e, f, g, h, i] = axes as unknown as [number, number, number, number, number, number, number, number, number];
  const sign = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0 ? -1 : 1;
  return [a, b, sign * c, d, e, sign * f, g, h, sign * i];
}
