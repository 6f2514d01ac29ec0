// SPDX-License-Identifier: MIT
//
// Random takes as hands make them, each with the files that repeat it and the hash that the page shows. takes.ts makes them
// in Node, and takes_browser.ts in a browser.

import { Data } from "../src/data.ts";
import { Kernels } from "../src/kernels.ts";
import { Simulation } from "../src/simulation.ts";
import type { At, Entry, Value, Vec3 } from "../src/source.ts";

/** Uniform numbers from 0 to 1: Tommy Ettinger's mulberry32. */
function generator(from: number): () => number {
  let state = from >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let x = Math.imul(state ^ (state >>> 15), state | 1);
    x ^= x + Math.imul(x ^ (x >>> 7), x | 61);
    return ((x ^ (x >>> 14)) >>> 0) / 4294967296;
  };
}

class Hand {
  readonly #random: () => number;
  readonly #page: Simulation;
  refused = 0;
  done = 0;

  constructor(page: Simulation, random: () => number) {
    this.#page = page;
    this.#random = random;
  }

  number(low: number, high: number): number {
    return low + (high - low) * this.#random();
  }

  pick<T>(...of: readonly T[]): T {
    return of[Math.floor(this.#random() * of.length)] as T;
  }

  chance(part: number): boolean {
    return this.#random() < part;
  }

  vector(size: number): Vec3 {
    return [this.number(-size, size), this.number(-size, size), this.number(-size, size)];
  }

  submit(entry: Entry): boolean {
    const refusal = this.#page.submit(entry);
    if (refusal === null) this.done++;
    else this.refused++;
    return refusal === null;
  }

  /** Let time pass as pictures do. */
  pass(seconds: number): void {
    for (let left = seconds; left > 0; left -= 1 / 60) this.#page.advance(this.timeNs + Math.round(1e9 * Math.min(left, this.number(0.008, 0.03))));
  }

  get timeNs(): number {
    return this.#page.snapshot().timeNs;
  }

  /** A point of the surface [mesh], where a ray from afar meets it. */
  grip(): Vec3 {
    const { body } = this.#page.snapshot(), { length } = this.#page.body();
    const from = this.vector(1), away = Math.hypot(...from) || 1;
    const [x = 0, y = 0, z = 0] = body.row;
    const origin: Vec3 = [x + (4 * length * from[0]) / away, y + (4 * length * from[1]) / away, z + (4 * length * from[2]) / away];
    const aside = this.vector(0.2 * length);
    const direction: Vec3 = [x + aside[0] - origin[0], y + aside[1] - origin[1], z + aside[2] - origin[2]];
    const hit = this.#page.firstHit(origin, direction);
    return hit?.mesh ?? this.vector(0.05);
  }

  drag(): void {
    const attach = this.grip(), { body } = this.#page.snapshot(), { length } = this.#page.body();
    const [x = 0, y = 0, z = 0] = body.row;
    let end: Vec3 = [x + this.number(-length, length), y + this.number(-length, length), z + this.number(-length, length)];
    if (!this.submit({ string: { attach, target: end } })) return;
    const way = this.vector(0.1 * length);
    for (let k = Math.floor(this.number(3, 25)); k > 0; k--) {
      this.pass(1 / 60);
      const stray = this.vector(0.02 * length);
      end = [end[0] + way[0] + stray[0], end[1] + way[1] + stray[1], end[2] + way[2] + stray[2]];
      this.submit({ string: { target: end } });
      if (this.chance(0.04)) this.change();
    }
    if (this.chance(0.8)) this.submit({ string: "release" });
  }

  poke(): void {
    const { massKg, length } = this.#page.body(), { body } = this.#page.snapshot();
    const [x = 0, y = 0, z = 0] = body.row, { triangles } = this.#page.body();
    const from = this.vector(3 * length);
    const at = this.pick<At>(
      { point: this.grip() }, { vertex: triangles[Math.floor(this.#random() * triangles.length)] ?? 0 }, "com", "origin",
      { ray: { origin: [x + from[0], y + from[1], z + from[2]] as Vec3, direction: [-from[0], -from[1], -from[2]] as Vec3 } },
    );
    const axes = this.pick("world", "body") as "world" | "body";
    const force = this.vector(massKg * this.pick(0.5, 5, 50)), torque = this.vector(massKg * length * length * this.pick(1, 20));
    this.submit(this.pick<Entry>(
      { at, impulse: this.vector(0.3 * massKg), axes },
      { at, impulse: this.vector(0.3 * massKg), angular_impulse: this.vector(massKg * length * length), axes },
      { at, force, axes },
      { at, force, torque, axes, duration: this.number(0.005, 0.5), slot: this.pick("a", "left") },
      { at: typeof at === "string" ? { point: this.grip() } : at, push: massKg * this.number(-20, 20) },
      { wrench: { at, force, axes } },
      { wrench: { torque, axes, slot: "b", duration: 0.2 } },
      { wrench: { force: [0, 0, 0] } },
      { service: "clear_wrench" },
      { state: { angular_velocity: this.vector(10), linear_velocity: this.vector(0.5) } },
    ));
  }

  change(): void {
    const { massKg, scale } = this.#page.body(), factor = this.number(0.5, 2), integrator = this.pick("auto", "auto", "auto", "rk4", "euler", "midpoint");
    const a = this.number(0.5, 1), b = this.number(0.5, 1), c = this.number(Math.abs(a - b) + 0.01, a + b - 0.01), size = massKg * 0.002;
    const values = this.pick<Record<string, Value>>(
      { mass: massKg * factor },
      { density: 1000 * factor },
      { scale: scale.map((s) => s * factor) },
      { scale: scale.map((s) => s * this.number(0.7, 1.4)) },
      { inertia_model: this.pick("solid", "shell", "points", "bounding_box") },
      { inertia_model_com: this.pick("solid", "model") },
      { inertia_model: "explicit", "explicit_inertia.mass": massKg, "explicit_inertia.tensor": [size * a, 0, 0, size * b, 0.01 * size, size * c] },
      { "ballast.nut": [this.pick(0, 0.2 * massKg), ...this.grip()] },
      { "ballast.bolt": [0.1 * massKg, ...this.grip()], mass: massKg },
      { gravity: this.pick([0, 0, 0], [0, 0, -9.81], [0, 0, -1.62]) },
      { linear_damping: this.pick(0, 0.3 * massKg), angular_damping: this.pick(0, 1e-4) },
      { gyroscopic: this.chance(0.5) },
      { "rotor.momentum": this.chance(0.3) ? [0, 0, 0] : this.vector(0.01 * massKg), "rotor.torque": this.chance(0.5) ? [0, 0, 0] : this.vector(0.01 * massKg) },
      { integrator, step: this.pick(0.001, 0.0005, 0.004) },
      { accuracy: this.pick(1e-9, 1e-7, 1e-12) },
      { "string.frequency": this.number(4, 12), "string.damping_ratio": this.number(0, 1) },
      { "string.timeout": this.pick(0, 0.2, 1) },
      { "string.rest_length": this.pick(0, 0.1) },
      { "string.attached": this.chance(0.5), "string.target": this.vector(0.2) },
      { wrench_timeout: this.pick(0.3, 1.5), poke_duration: this.pick(0.02, 0.05) },
      { mesh: this.pick("hammer", "t_handle", "l_bracket") },
    );
    this.submit({ set: values });
  }

  /** One of the things that a person does. */
  next(): void {
    const x = this.#random();
    if (x < 0.3) this.drag();
    else if (x < 0.55) this.poke();
    else if (x < 0.75) this.change();
    else if (x < 0.8) for (let k = 0; k < 3; k++) this.pick(() => this.poke(), () => this.change())(); // while paused
    else if (x < 0.86) this.back();
    else if (x < 0.9) this.#page.setGhost({ inertia_model: this.pick("", "bounding_box", "shell"), gyroscopic: this.chance(0.7) });
    this.pass(this.pick(0, 0.05, 0.3, 1.2));
  }

  /** Back to some time, perhaps forth to another, and on from there. */
  back(): void {
    const { endNs } = this.#page.history();
    this.#page.goTo(Math.floor(endNs * this.#random()));
    if (this.chance(0.5)) this.#page.goTo(Math.floor(endNs * this.#random()));
    if (this.chance(0.7)) this.#page.goOn();
  }
}

/** So many takes. fault: "late", every string's target a nanosecond later; or "knot", the knot not put onto the surface. */
export async function randomTakes(kernelsBytes: BufferSource, dataBytes: Uint8Array, count: number, seed: number, fault = ""): Promise<unknown[]> {
  const data = new Data(dataBytes), kernels = await Kernels.load(kernelsBytes);
  if (fault === "knot") {
    const command = kernels.command.bind(kernels);
    kernels.command = (scene, mesh, vertices, triangles, ...rest) => command(scene, mesh, vertices, { ...triangles, n: 0 }, ...rest);
  }
  const start = kernels.memory.mark(), takes: unknown[] = [];
  for (let number = 0; number < count; number++) {
    kernels.memory.release(start);
    takes.push(await randomTake(new Simulation(kernels, data), generator(1000 * seed + number), Object.keys(data.declared.scenes), fault));
  }
  return takes;
}

async function randomTake(page: Simulation, random: () => number, scenes: readonly string[], fault: string): Promise<unknown> {
  const hand = new Hand(page, random), scene = hand.pick(...scenes);
  page.openScene(scene);
  for (let k = Math.floor(hand.number(5, 25)); k > 0; k--) hand.next();
  hand.pass(0.3);
  const { endNs } = page.history();
  page.goTo(endNs);
  const hash = page.stateHash(), files = page.take(), link = await page.link();
  const script = fault === "late" ? files.script.replaceAll(/t: (\d+\.\d+), string/g, (_, t: string) => `t: ${Number(t) + 1e-9}, string`) : files.script;
  const told = { name: scene, ...files, script, hash, done: hand.done, refused: hand.refused, failure: page.snapshot().body.failure };
  // The link opens the same take, and so does going back to its middle.
  await page.openLink(link);
  page.goTo(endNs);
  const opened = page.stateHash();
  page.goTo(Math.floor(endNs / 3));
  page.goTo(endNs);
  return { ...told, opened, again: page.stateHash(), linkLength: link.length };
}
