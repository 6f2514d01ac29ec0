// SPDX-License-Identifier: MIT

import type { Card, Desk } from "./panel.ts";
import { check, choice, make } from "./panel_elements.ts";
import type { GhostChoice } from "./source.ts";
import { words } from "./words.ts";

const NONE: GhostChoice = { inertia_model: "", integrator: "", gyroscopic: true };

/** What differs of the body that flies beside. */
export function ghostCard(desk: Desk): Card {
  const { motion, look } = desk, w = words.ghost;
  const names = motion.parameters().find(({ name }) => name === "integrator")?.choices ?? [];
  const integrator = choice(w.integrator, names.map((name) => [name, name] as const), (name) => desk.told(motion.setGhost({ ...NONE, integrator: name })));
  const radios = Object.entries(w.kinds).map(([kind, text]) => {
    const input = make("input", { type: "radio", name: "ghost", value: kind, change: () => {
      const other = String(motion.values()["integrator"]) === "euler" ? "midpoint" : "euler";
      const choice: GhostChoice = kind === "gyroscopic" ? { ...NONE, gyroscopic: false } : kind === "integrator" ? { ...NONE, integrator: names.includes(other) ? other : names[0] ?? "" } : { ...NONE, inertia_model: kind };
      desk.told(motion.setGhost(choice));
      changed();
    } });
    return { kind, input, node: make("label", { class: "check" }, input, make("span", {}, text)) };
  });
  const apart = check(w.apart, look.apart, (on) => { look.apart = on; desk.picture.setApart(on); });
  const changed = (): void => {
    const now = motion.ghost(), kind = now.integrator ? "integrator" : now.inertia_model || (now.gyroscopic ? "" : "gyroscopic");
    for (const radio of radios) radio.input.checked = radio.kind === kind;
    integrator.node.hidden = kind !== "integrator";
    integrator.show(now.integrator);
    apart.node.hidden = kind === "";
  };
  const node = make("div", {}, make("p", { class: "note" }, w.about), make("div", { role: "radiogroup", "aria-label": w.name }, ...radios.map(({ node: row }) => row)), integrator.node, apart.node, make("p", { class: "note" }, w.again));
  return { node, changed };
}
