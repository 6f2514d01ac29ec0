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
  const triple = (name: string, text: string, unit: string): { readonly node: HTMLElement; show(): void } => {
    const now = (): readonly number[] => motion.values()[name] as readonly number[];
    const fields = [0, 1, 2].map((k) => numberField(`${text} ${"xyz"[k]}`, (value) => motion.set({ [name]: now().map((x, i) => (i === k ? value : x)) }), unit));
    return { node: make("div", { class: "field" }, make("span", { class: "trio" }, ...fields.map(({ node: field }) => field)), unit), show: () => fields.forEach((field, k) => field.show(now()[k]!)) };
  };
  const spin = triple("initial.angular_velocity", w.start, "rad/s"), wheel = triple("rotor.momentum", `${w.flywheel} ${w.wheel}`, "N m s"), motor = triple("rotor.torque", `${w.flywheel} ${w.motor}`, "N m");
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
    for (const each of [spin, wheel, motor]) each.show();
    gyroscopic.show(values["gyroscopic"] !== false);
    integrator.show(String(values["integrator"]));
    step.show(Number(values["step"]));
    stepField.hidden = values["integrator"] === "auto";
  };
  gyroscopic.node.dataset["mark"] = "gyroscopic";
  const node = make("div", {},
    make("h3", {}, w.gravity), places, make("div", { class: "field" }, w.down, make("span", {}, down.node, " m/s²")),
    make("h3", {}, w.damping), make("div", { class: "field" }, w.linear, make("span", {}, linear.node, " N s/m")), make("div", { class: "field" }, w.angular, make("span", {}, angular.node, " N m s")),
    make("h3", {}, w.start), spin.node, make("p", { class: "note" }, w.startNote),
    make("div", { "data-mark": "flywheel" }, make("h3", {}, w.flywheel), w.wheel, wheel.node, w.motor, motor.node, make("p", { class: "note" }, w.flywheelNote)),
    make("h3", {}, w.motion), gyroscopic.node, integrator.node, stepField);
  return { node, changed };
}
