// SPDX-License-Identifier: MIT

import type { Card, Desk } from "./panel.ts";
import { button, check, choice, make, numberField } from "./panel_elements.ts";
import { words } from "./words.ts";

/** The card with gravity, damping, the law of motion and the initial angular velocity. */
export function worldCard(desk: Desk): Card {
  const { motion } = desk, w = words.world, set = (name: string) => (value: number): string | null => motion.set({ [name]: value });
  const places = make("div", { class: "row", role: "group", "aria-label": w.gravity });
  const down = numberField(`${w.gravity} ${w.down}`, (value) => motion.set({ gravity: [0, 0, -value] }), "m/s²");
  const linear = numberField(`${w.damping} ${w.linear}`, set("linear_damping"), "N s/m"), angular = numberField(`${w.damping} ${w.angular}`, set("angular_damping"), "N m s");
  const spins = [0, 1, 2].map((k) => numberField(`${w.start} ${"xyz"[k]}`, (value) => {
    const now = [...(motion.values()["initial.angular_velocity"] as readonly number[])];
    now[k] = value;
    return motion.set({ "initial.angular_velocity": now });
  }, "rad/s"));
  const gyroscopic = check(w.gyroscopic, true, (on) => desk.told(motion.set({ gyroscopic: on })));
  const names = motion.parameters().find(({ name }) => name === "integrator")?.choices ?? [];
  const integrator = choice(w.integrator, names.map((name) => [name, name] as const), (name) => { desk.told(motion.set({ integrator: name })); changed(); });
  const step = numberField(w.step, (value) => motion.set({ step: value }), "s"), stepField = make("div", { class: "field" }, w.step, make("span", {}, step.node, " s"));

  const changed = (): void => {
    const values = motion.values(), [gx, gy, gz] = values["gravity"] as readonly number[];
    places.replaceChildren(...w.places.map(([name, g]) => button(name, () => desk.told(motion.set({ gravity: [0, 0, g ? -g : 0] })), { "aria-pressed": String(gx === 0 && gy === 0 && Math.abs(gz! + g) < 1e-9) })));
    down.show(gz ? -gz : 0);
    linear.show(Number(values["linear_damping"]));
    angular.show(Number(values["angular_damping"]));
    spins.forEach((field, k) => field.show((values["initial.angular_velocity"] as readonly number[])[k]!));
    gyroscopic.show(values["gyroscopic"] !== false);
    integrator.show(String(values["integrator"]));
    step.show(Number(values["step"]));
    stepField.hidden = values["integrator"] === "auto";
  };
  gyroscopic.node.dataset["mark"] = "gyroscopic";
  const node = make("div", {},
    make("h3", {}, w.gravity), places, make("div", { class: "field" }, w.down, make("span", {}, down.node, " m/s²")),
    make("h3", {}, w.damping), make("div", { class: "field" }, w.linear, make("span", {}, linear.node, " N s/m")), make("div", { class: "field" }, w.angular, make("span", {}, angular.node, " N m s")),
    make("h3", {}, w.start), make("div", { class: "field" }, make("span", { class: "trio" }, ...spins.map(({ node: field }) => field)), "rad/s"), make("p", { class: "note" }, w.startNote),
    make("h3", {}, w.motion), gyroscopic.node, integrator.node, stepField);
  return { node, changed };
}
