// SPDX-License-Identifier: MIT

import { MEASURED, type Measured } from "./engines.ts";
import { isSameGhost, NAMED, NO_GHOST } from "./ghosts.ts";
import type { Card, Desk } from "./panel.ts";
import { check, choice, make } from "./panel_elements.ts";
import { hasFlywheel } from "./poinsot.ts";
import type { GhostChoice } from "./source.ts";
import { words } from "./words.ts";
import { short } from "./words_numbers.ts";

/** [s] Choices of the ghost's step; 0: the body's; 1/60 s is rounded as the parameter step is. */
const STEPS = [0, 0.016666667, 0.01, 0.001] as const;
/** [s] The table shows measurements with steps above this. */
const FINE = 0.01;
/** Relative changes of energy below this are shown as none. */
const KEPT = 1e-5;

/** The card of the ghost: how it differs from the body. */
export function ghostCard(desk: Desk): Card {
  const { motion, look } = desk, w = words.ghost;
  const names = motion.parameters().find(({ name }) => name === "integrator")?.choices ?? [];
  const tell = (choice: Partial<GhostChoice>): void => { desk.told(motion.setGhost(choice)); changed(); };
  const integrator = choice(w.integrator, names.map((name) => [name, name] as const), (name) => tell({ ...NO_GHOST, integrator: name, step: motion.ghost().step }));
  const step = choice(w.step, STEPS.map((value, k) => [String(value), [w.same, w.sixtieth, w.hundredth, w.thousandth][k] ?? ""] as const), (value) => tell({ ...NO_GHOST, integrator: motion.ghost().integrator, step: Number(value) }));
  const choiceOf = (kind: string): GhostChoice => {
    if (kind === "gyroscopic" || kind === "mujoco") return NAMED[kind].choice;
    if (kind !== "integrator") return { ...NO_GHOST, inertia_model: kind };
    const other = String(motion.values()["integrator"]) === "euler" ? "midpoint" : "euler";
    return { ...NO_GHOST, integrator: names.includes(other) ? other : names[0] ?? "" };
  };
  const kindOf = (now: GhostChoice): string => {
    const named = Object.entries(NAMED).find(([, each]) => isSameGhost(each.choice, now));
    return named?.[0] ?? (now.integrator || now.step ? "integrator" : now.inertia_model || (now.gyroscopic ? "" : "gyroscopic"));
  };
  const radios = Object.entries(w.kinds).map(([kind, text]) => {
    const input = make("input", { type: "radio", name: "ghost", value: kind, change: () => tell(choiceOf(kind)) });
    return { kind, input, node: make("label", { class: "check", "data-mark": kind || "none" }, input, make("span", {}, text)) };
  });
  const apart = check(w.apart, look.apart, (on) => { look.apart = on; desk.picture.setApart(on); });
  const source = make("p", { class: "note" }), rows = make("tbody"), date = make("p", { class: "note" });
  const table = make("table", {}, make("thead", {}, make("tr", {}, ...w.heads.map((head) => make("th", {}, head)))), rows);
  const noFlywheel = make("p", { class: "note" }, w.noFlywheel);
  const measured = make("div", {}, source, noFlywheel, make("p", { class: "note" }, w.measured), table, date);
  let told: string | null = null;
  const changed = (): void => {
    const now = motion.ghost(), kind = kindOf(now);
    for (const radio of radios) radio.input.checked = radio.kind === kind;
    integrator.node.hidden = step.node.hidden = kind !== "integrator";
    integrator.show(now.integrator);
    step.show(String(now.step));
    apart.node.hidden = kind === "";
    measured.hidden = !(kind in w.sources);
    noFlywheel.hidden = !hasFlywheel(motion);
    if (kind === told) return;
    told = kind;
    const found = kind === "gyroscopic" || kind === "mujoco" ? MEASURED.filter(({ ghost, stepS }) => ghost === NAMED[kind].beside && stepS > FINE) : [];
    source.textContent = w.sources[kind] ?? "";
    rows.replaceChildren(...found.map(measuredRow));
    date.textContent = w.measuredNote(found[0]?.date ?? "");
  };
  const radiogroup = make("div", { role: "radiogroup", "aria-label": w.name }, ...radios.map(({ node: row }) => row));
  const node = make("div", {}, make("p", { class: "note" }, w.about), radiogroup, integrator.node, step.node, apart.node, measured, make("p", { class: "note" }, w.again));
  return { node, changed };
}

function measuredRow({ engine, version, way, flips, energyChange }: Measured): HTMLTableRowElement {
  const w = words.ghost, energy = Math.abs(energyChange) < KEPT ? w.kept : words.percent(100 * energyChange);
  return make("tr", {}, make("td", { title: `${version}, ${way}` }, engine), make("td", {}, Number.isFinite(flips) ? short(flips) : "–"), make("td", {}, Number.isFinite(energyChange) ? energy : w.notFlown));
}
