// SPDX-License-Identifier: MIT

import { engineText } from "./forms.ts";
import type { Card, Desk } from "./panel.ts";
import { button, choice, copied, make, numberField, say } from "./panel_elements.ts";
import type { Model, Vec3 } from "./source.ts";
import { words } from "./words.ts";
import { short } from "./words_numbers.ts";

/** Of the six numbers of a tensor, xx xy xz yy yz zz, those that are moments, and where each stands among the nine. */
const NINE = [0, 1, 2, 4, 5, 8] as const, NAMES = ["xx", "xy", "xz", "yy", "yz", "zz"] as const;
const BALLAST = "ballast.";

/** Which body, what is to be said of it, how its mass is spread, and its moments beside those of the box. */
export function bodyCard(desk: Desk): Card {
  const { motion } = desk, w = words.body;
  let unit: number | undefined, added = 0;
  const bodies = make("div", { class: "row" });
  const scenes = choice(w.scenes, [["", "–"], ...motion.scenes.map(({ name, title }) => [name, desk.lessons.find((one) => one.name === name)?.title ?? title] as const)], (name) => { if (name) void desk.open(() => motion.openScene(name)); });
  const file = make("input", { type: "file", accept: ".obj,.stl,.ply,.glb", class: "out", tabindex: -1, "aria-hidden": "true", change: () => {
    const [chosen] = file.files ?? [];
    file.value = "";
    if (!chosen) return;
    if (chosen.size > 50 * 1024 * 1024) { say(w.tooLarge); return; }
    void desk.open(async () => desk.lively(motion.openMesh(chosen.name, new Uint8Array(await chosen.arrayBuffer()), unit)));
  } });
  const units = choice(w.unit, w.units, (value) => { unit = value ? Number(value) : undefined; });
  const verdict = make("div"), facts = make("p", { class: "note" });
  const mass = numberField(w.fixed, (value) => motion.set({ mass: value }), "kg"), density = numberField(w.dense, (value) => motion.set({ density: value }), "kg/m³");
  const spreads = motion.parameters().find(({ name }) => name === "inertia_model")?.choices ?? [];
  const models = choice(w.model, spreads.map((model) => [model, w.models[model] ?? model] as const), (model) => {
    const { massKg, com, scale, inertia } = motion.body();
    // Numbers of one's own begin as those in force, so that nothing leaps.
    const own = { "explicit_inertia.mass": massKg, "explicit_inertia.center_of_mass": com.map((c, k) => c / scale[k]!), "explicit_inertia.tensor": NINE.map((k) => inertia[k]!) };
    desk.told(motion.set({ ...(model === "explicit" ? own : {}), inertia_model: model }));
    changed();
  });
  const numbers = (name: string): readonly number[] => { const value = motion.values()[name]; return typeof value === "number" ? [value] : (value as readonly number[]); };
  const one = (name: string, label: string, k: number, unitOf: string) => numberField(label, (value) => {
    const all = [...numbers(name)];
    all[k] = value;
    return motion.set({ [name]: name.endsWith("mass") && !name.endsWith("of_mass") ? value : all });
  }, unitOf);
  const ownMass = one("explicit_inertia.mass", w.fixed, 0, "kg"), centre = [0, 1, 2].map((k) => one("explicit_inertia.center_of_mass", `${w.centre} ${"xyz"[k]}`, k, ""));
  const tensor = NAMES.map((name, k) => one("explicit_inertia.tensor", `I${name}`, k, "kg m²"));
  const own = make("div", {}, make("div", { class: "field" }, w.fixed, make("span", {}, ownMass.node, " kg")), make("div", { class: "field" }, w.centre, make("span", { class: "trio" }, ...centre.map(({ node: field }) => field))),
    ...[0, 3].map((from) => make("div", { class: "field" }, ...[0, 1, 2].map((k) => make("label", {}, `I${NAMES[from + k]}`, tensor[from + k]!.node)))), make("p", { class: "note" }, w.ownNote));
  const thickness = numberField(w.walls, (value) => motion.set({ wall_thickness: 0.001 * value }), "mm"), infill = numberField(w.infill, (value) => motion.set({ infill: 0.01 * value }), "%");
  const walls = make("div", {}, make("div", { class: "field" }, w.walls, make("span", {}, thickness.node, " mm")), make("div", { class: "field" }, w.infill, make("span", {}, infill.node, " %")));
  const denser = make("div", { class: "field" }, w.dense, make("span", {}, density.node, " kg/m³"));
  const table = make("table", { "data-mark": "moments", tabindex: -1 }), ballast = make("div");
  const lines = make("textarea", { class: "text", readonly: true, hidden: true, rows: 7, spellcheck: "false", "aria-label": w.lines });
  const written = (): string => (lines.value = engineText(desk.forms[engines.select.value]!, motion.body()));
  const engines = choice(w.copyFor, Object.entries(desk.forms).map(([name, { engine }]) => [name, engine] as const), written);
  const copy = button(w.copy, () => { lines.hidden = false; void copied(written(), lines); });
  let heavy = 0.1;
  const kilograms = numberField(w.ballast, (value) => { heavy = value; kilograms.show(value); return null; }, "kg");
  const stick = button(w.add, () => {
    say(w.press, 4);
    desk.pointer.claim = ({ mesh }) => {
      const values = motion.values();
      let name = "";
      do name = `${BALLAST}b${++added}`; while (name in values);
      desk.told(motion.set({ [name]: [heavy, ...mesh] }));
    };
  }, { title: w.addTitle });

  const changed = (): void => {
    const info = motion.body(), values = motion.values();
    bodies.replaceChildren(...motion.bodies.map(({ name, title }) => button(words.bodies[name] ?? title, () => void desk.open(() => desk.lively(motion.openBody(name))), { "aria-pressed": String(name === info.name) })));
    const sayings = info.findings.filter(({ severity }) => severity !== "info");
    verdict.replaceChildren(...(sayings.length
      ? sayings.map(({ message, severity }) => make("p", { class: severity === "error" ? "bad" : "" }, message))
      : [make("p", { class: "good" }, w.sound)]));
    facts.textContent = w.facts(info.vertices.length / 3, info.triangles.length / 3, Number.isFinite(info.volume) ? short(1000 * info.volume) : "");
    mass.show(info.massKg);
    density.show(Number.isFinite(info.volume) && info.volume > 0 ? solidMass(info.models, info.massKg) / info.volume : Number(values["density"]));
    models.show(String(values["inertia_model"]));
    own.hidden = values["inertia_model"] !== "explicit";
    walls.hidden = values["inertia_model"] !== "walled";
    denser.hidden = info.hasParts;
    thickness.show(1000 * numbers("wall_thickness")[0]!);
    infill.show(100 * numbers("infill")[0]!);
    ownMass.show(numbers("explicit_inertia.mass")[0]!);
    centre.forEach((field, k) => field.show(numbers("explicit_inertia.center_of_mass")[k]!));
    tensor.forEach((field, k) => field.show(numbers("explicit_inertia.tensor")[k]!));
    const truth = info.models.find(({ model }) => model === "solid");
    table.replaceChildren(make("tr", {}, make("td"), ...["I₁", "I₂", "I₃"].map((name) => make("th", { scope: "col" }, name))), ...info.models.filter(({ refusal, model }) => !refusal && (model !== "explicit" || values["inertia_model"] === "explicit")).flatMap((model) => rows(model, truth)));
    const stuck = Object.entries(values).filter(([name, value]) => name.startsWith(BALLAST) && Array.isArray(value) && value[0] !== 0);
    ballast.replaceChildren(...stuck.map(([name, value]) => make("div", { class: "field" }, `${short((value as readonly number[])[0]!)} kg`,
      button(w.remove, () => desk.told(motion.set({ [name]: [0, ...((value as readonly number[]).slice(1) as unknown as Vec3)] }))))));
    kilograms.show(heavy);
    if (!lines.hidden) written();
  };
  const rows = (model: Model, truth: Model | undefined): HTMLElement[] => {
    const own = make("tr", {}, make("th", { scope: "row" }, w.models[model.model] ?? model.model), ...model.moments.map((moment) => make("td", {}, short(moment))));
    if (model.model !== "bounding_box" || !truth || truth.refusal) return [own];
    return [own, make("tr", {}, make("th", { scope: "row" }, w.beside), ...model.moments.map((moment, k) => make("td", {}, make("b", {}, words.percent(100 * (moment / truth.moments[k]! - 1))))))];
  };
  heavy = Number((0.2 * motion.body().massKg).toPrecision(1)) || 0.1;
  const node = make("div", {},
    make("h3", {}, w.bundled), bodies, scenes.node,
    ...(motion.can.openFiles ? [make("h3", {}, w.own), make("div", { class: "row" }, button(w.choose, () => file.click()), file), units.node, make("p", { class: "note" }, w.formats)] : []), verdict, facts,
    make("h3", {}, w.mass), make("div", { class: "field" }, w.fixed, make("span", {}, mass.node, " kg")), denser, models.node, walls, own,
    make("h3", {}, w.table), table, make("div", { class: "row" }, engines.node, copy), lines,
    make("h3", {}, w.ballast), make("div", { class: "field", "data-mark": "ballast" }, make("span", {}, kilograms.node, " kg"), stick), ballast);
  return { node, changed, closed: () => { desk.pointer.claim = null; } };
}

function solidMass(models: readonly Model[], otherwise: number): number {
  const solid = models.find(({ model }) => model === "solid");
  return solid && !solid.refusal ? solid.massKg : otherwise;
}
