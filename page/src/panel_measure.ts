// SPDX-License-Identifier: MIT

import { chalked } from "./chalk.ts";
import { Refused } from "./numbers.ts";
import type { Card, Desk } from "./panel.ts";
import { button, choice, make, say } from "./panel_elements.ts";
import type { Snapshot, Vec3 } from "./source.ts";
import { words } from "./words.ts";
import { short } from "./words_numbers.ts";

/** [degrees] Sensitivity above which the motion is reported as chaotic. */
const CHAOS = 1;

/** A direction of the protractor by its name, in world axes. */
export function direction(thing: string, now: Snapshot, axes: readonly number[], first: Vec3 | null): Vec3 | null {
  const { rotation: R, omega, momentum, row } = now.body, axis = { one: 0, two: 1, three: 2 }[thing];
  if (axis !== undefined) {
    const [x, y, z] = [axes[axis]!, axes[3 + axis]!, axes[6 + axis]!];
    return [R[0]! * x + R[1]! * y + R[2]! * z, R[3]! * x + R[4]! * y + R[5]! * z, R[6]! * x + R[7]! * y + R[8]! * z];
  }
  return thing === "omega" ? omega : thing === "momentum" ? momentum : thing === "velocity" ? [row[7]!, row[8]!, row[9]!] : thing === "start" ? first : [0, 0, 1];
}

/** The card with protractor, stopwatch, a point's trace and numbers. */
export function measureCard(desk: Desk): Card {
  const { motion, look } = desk, w = words.measure, things = Object.entries(w.things);
  const angle = make("b", {}, "–");
  const measured = (): void => { look.protractor = one.select.value ? [one.select.value, two.select.value] : null; };
  const one = choice(w.between, [["", w.off], ...things], measured), two = choice(w.and, things, measured);
  one.show(look.protractor?.[0] ?? "");
  two.show(look.protractor?.[1] ?? "momentum");

  let fromNs: number | null = null, untilNs: number | null = null, shown = "";
  const watch = make("b", {}, "0.00 s"), go = button(w.start, () => {
    const now = motion.snapshot().timeNs;
    if (fromNs === null || untilNs !== null) { fromNs = now; untilNs = null; go.textContent = w.stop; }
    else { untilNs = now; go.textContent = w.start; }
  });
  const clear = button(w.clear, () => { fromNs = untilNs = null; go.textContent = w.start; });

  const far = (): Vec3 => {
    const { vertices, scale, com } = motion.body();
    let best: Vec3 = [0, 0, 0], most = -1;
    for (let k = 0; k < vertices.length; k += 3) {
      const at = [vertices[k]!, vertices[k + 1]!, vertices[k + 2]!] as const, away = Math.hypot(at[0] * scale[0] - com[0], at[1] * scale[1] - com[1], at[2] * scale[2] - com[2]);
      if (away > most) { most = away; best = at; }
    }
    return best;
  };
  const traces = [
    button(w.off, () => { look.trace = null; press(0); }), button(w.far, () => { look.trace = far(); press(1); }),
    button(w.com, () => { look.trace = "com"; press(2); }),
    button(w.own, () => { say(words.body.press, 4); desk.pointer.claim = ({ mesh }) => { look.trace = mesh; press(3); }; }),
  ];
  const press = (which: number): void => traces.forEach((node, k) => node.setAttribute("aria-pressed", String(k === which)));
  press(look.trace === null ? 0 : look.trace === "com" ? 2 : 1);

  let from: Vec3 = [0, 0, 0];
  const chalk = button(w.draw, () => {
    const on = desk.pointer.chalk === null;
    chalk.setAttribute("aria-pressed", String(on));
    desk.pointer.chalk = !on ? null : (hit, begins) => {
      const place = chalked(motion, hit);
      if (begins) from = place;
      look.chalk = [...look.chalk, ...from, ...place];
      from = place;
    };
    if (on) say(w.drawNote, 4);
  }, { "aria-pressed": "false" });
  const wipe = button(w.wipe, () => { look.chalk = []; });

  const sensitive = make("p"), again = button(w.again, () => {
    try {
      const { attitude, position, finer: [name, value] } = motion.sensitivity(), degrees = (attitude * 180) / Math.PI;
      sensitive.textContent = `${w.moved(degrees.toPrecision(2), position.toPrecision(2), `${name} ${short(value, 2)}`)} ${degrees > CHAOS ? w.chaos : w.holds}`;
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      sensitive.textContent = error.message;
    }
    sensitive.scrollIntoView({ block: "nearest" });
  });

  const readings = make("table");
  let first: Vec3 | null = null;
  const node = make("div", {},
    make("h3", {}, w.protractor), one.node, two.node, make("p", {}, angle),
    make("h3", {}, w.watch), make("div", { class: "row" }, watch, go, clear),
    make("h3", {}, w.trace), make("div", { class: "row", role: "group", "aria-label": w.trace, "data-mark": "trace" }, ...traces),
    make("h3", {}, w.chalk), make("div", { class: "row" }, chalk, wipe),
    make("h3", {}, w.readings), readings,
    ...(motion.can.keep ? [make("h3", {}, w.sensitivity), make("div", { class: "row" }, again), sensitive] : []));
  return {
    node, changed: () => { first = desk.track().seen[0]?.now.body.momentum ?? null; },
    show(now) {
      const passed = fromNs === null ? 0 : (untilNs ?? now.timeNs) - fromNs, text = words.time.seconds(passed * 1e-9);
      if (text !== shown) watch.textContent = shown = text;
      const axes = motion.body().axes, a = look.protractor && direction(look.protractor[0], now, axes, first), b = look.protractor && direction(look.protractor[1], now, axes, first);
      angle.textContent = a && b ? `${between(a, b).toFixed(2)}°` : "–";
      const { row, omega, momentum } = now.body;
      readings.replaceChildren(...([[w.spin, Math.hypot(...omega), "rad/s"], ["L", Math.hypot(...momentum), "N m s"], [w.speed, Math.hypot(row[7]!, row[8]!, row[9]!), "m/s"], [words.hand.mass, now.body.massKg, "kg"]] as const)
        .map(([name, value, unit]) => make("tr", {}, make("th", { scope: "row" }, name), make("td", {}, `${short(value, 4)} ${unit}`))));
    },
    closed: () => { desk.pointer.claim = desk.pointer.chalk = null; },
  };
}

/** Angle between vectors [degrees], accurate near 0 and 180. */
function between(a: Vec3, b: Vec3): number {
  const cross = Math.hypot(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
  return (Math.atan2(cross, a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) * 180) / Math.PI;
}
