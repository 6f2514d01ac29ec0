// SPDX-License-Identifier: MIT
//
// node asked.ts KERNELS.wasm DATA < JSON: answers to what a test in Python asks, as JSON.
// {"refusals": [[values, entry], ..]}: what the page says of an entry at time 0 of a scene, or of the scene.
// {"bodies": [[values, null or {name, text} of a mesh file], ..]}: what engines take of it, by their names.
// {"numbers": [x, ..]}: how it writes numbers. {"take": text, "untilNs": t}: the state's hash then; with
// an "entry" also what is said of that.

import { readFileSync } from "node:fs";
import { Data } from "../src/data.ts";
import { engineText } from "../src/forms.ts";
import { openMotion } from "../src/simulation.ts";
import { flow, general, nanoseconds, repr, yamlValue } from "../src/numbers.ts";
import type { Entry, GhostChoice, Motion, Values } from "../src/source.ts";
import { FORM, takeBytes } from "../src/take.ts";

const bytes = (name: string | undefined): Uint8Array<ArrayBuffer> => new Uint8Array(readFileSync(name ?? ""));
const [kernels, data] = process.argv.slice(2).map(bytes) as [Uint8Array<ArrayBuffer>, Uint8Array<ArrayBuffer>];
interface Asked {
  readonly refusals?: readonly (readonly [Values, Entry | null])[];
  readonly bodies?: readonly (readonly [Values, { readonly name: string; readonly text: string } | null])[];
  readonly numbers?: readonly number[];
  readonly take?: string;
  readonly untilNs?: number;
  readonly entry?: Entry;
}
const asked = JSON.parse(readFileSync(0, "utf8")) as Asked;
const ghost: GhostChoice = { inertia_model: "", integrator: "", step: 0, gyroscopic: true };

const opened = (values: Values): Promise<Motion> => openMotion(kernels, data, takeBytes({ form: FORM, version: "", values, ghost, script: [], endNs: 0, mesh: null }));

async function refusal(values: Values, entry: Entry | null): Promise<string | null> {
  try {
    const motion = await opened(values);
    return entry === null ? null : motion.submit(entry);
  } catch (error) {
    return (error as Error).message;
  }
}

const answer: Record<string, unknown> = {};
if (asked.refusals !== undefined) answer["refusals"] = await Promise.all(asked.refusals.map(([values, entry]) => refusal(values, entry)));
if (asked.bodies !== undefined) {
  const forms = Object.entries(new Data(data).declared.forms);
  answer["bodies"] = await Promise.all(asked.bodies.map(async ([values, mesh]) => {
    const motion = await opened(mesh ? {} : values);
    const refused = mesh && (motion.openMesh(mesh.name, new TextEncoder().encode(mesh.text), 1) ?? motion.set(values));
    return refused ?? Object.fromEntries(forms.map(([name, form]) => [name, engineText(form, motion.body())]));
  }));
}
answer["numbers"] = asked.numbers?.map((x) => [repr(x), general(x, 3), general(x, 6), general(x, 9), yamlValue(x), flow([x]), nanoseconds(x)]);
if (asked.take !== undefined) {
  const motion = await openMotion(kernels, data, new TextEncoder().encode(asked.take));
  motion.advance(asked.untilNs ?? 0);
  answer["hash"] = await motion.hash();
  if (asked.entry !== undefined) answer["refused"] = motion.submit(asked.entry);
  answer["findings"] = motion.body().findings.map((each) => each.code);
  const { scene, script, mesh } = motion.take();
  answer["files"] = { scene, script, mesh: mesh === null ? null : { name: mesh.name, text: new TextDecoder().decode(mesh.bytes) } };
}
process.stdout.write(JSON.stringify(answer));
