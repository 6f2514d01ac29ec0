// SPDX-License-Identifier: MIT
//
// A person at a lesson, without the page: buttons, hands and time, and how each step is done right, and wrong. At the page
// itself: lesson_browser.ts.

import type { Data } from "../src/data.ts";
import { NAMED, NO_GHOST } from "../src/ghosts.ts";
import { Lesson, type Act, type Sight } from "../src/lessons.ts";
import { LESSON_PLANS } from "../src/lessons_steps.ts";
import type { GhostChoice, Motion, Vec3, Values } from "../src/source.ts";

const S = 1e9;

export type Shown = { -readonly [K in keyof Sight]: Sight[K] };

export class Player {
  readonly motion: Motion;
  readonly lesson: Lesson;
  readonly sight: Shown;
  /** [N s] of a poke: as the page has it, .9 of the body's size a second. */
  strength: number;

  constructor(lesson: Lesson, motion: Motion, sight: Shown = { turned: null, principal: false, poinsot: false, ghost: NO_GHOST, apart: false, trace: null, cards: [] }) {
    this.motion = motion;
    this.lesson = lesson;
    this.sight = sight;
    const { massKg, length } = motion.body();
    this.strength = Number((1.8 * massKg * length).toPrecision(1));
  }

  static at(name: string, motion: Motion, data: Data): Player {
    motion.openScene(name);
    const plan = LESSON_PLANS[name];
    if (!plan) throw new Error(`${name} has no steps`);
    const player = new Player(new Lesson(name, data.declared.lessons[name]!, plan, motion), motion);
    player.look();
    return player;
  }

  get done(): number { return this.lesson.done; }

  look(): void { this.lesson.note(); this.lesson.check(this.sight); }

  answer(): void { this.lesson.choose(this.lesson.texts.answer); this.look(); }

  /** Let time pass as pictures do; until a step is ticked, if so asked. */
  fly(seconds: number, untilDone = false): void {
    const before = this.done, end = this.motion.snapshot().timeNs + seconds * S;
    while (this.motion.snapshot().timeNs < end && !(untilDone && this.done > before)) {
      this.motion.advance(Math.min(end, this.motion.snapshot().timeNs + S / 60));
      this.look();
    }
  }

  restart(): void { this.motion.reset(); this.lesson.restarted(); this.look(); }

  did(refusal: string | null): void {
    if (refusal) throw new Error(refusal);
    this.look();
  }

  poke(at: string | Vec3, along: Vec3, factor = 1): void {
    this.did(this.motion.submit({ at: typeof at === "string" ? at : { point: at }, impulse: along.map((x) => x * factor * this.strength) as unknown as Vec3, axes: "body" }));
  }

  set(values: Values): void { this.did(this.motion.set(values)); }

  /** Start again with these values. */
  start(values: Values): void { this.set(values); this.restart(); }

  drag(attach: Vec3, by: Vec3, seconds = 0.6): void {
    const [x = 0, y = 0, z = 0] = this.motion.snapshot().body.row;
    this.did(this.motion.submit({ string: { attach, target: [x + by[0], y + by[1], z + by[2]] } }));
    this.fly(seconds);
    this.did(this.motion.submit({ string: "release" }));
  }

  /** The line of the string in chalk, at rest or not: the page draws it only at rest. */
  chalk(): void {
    if (!this.lesson.isAtRest) return;
    const { string, rotation: R } = this.motion.snapshot().body, way = string!.end.map((x, k) => x - string!.knot[k]!);
    this.lesson.lines.push({ point: string!.attach, along: [0, 1, 2].map((k) => R[k]! * way[0]! + R[3 + k]! * way[1]! + R[6 + k]! * way[2]!) as unknown as Vec3 });
    this.look();
  }

  tie(attach: Vec3): void { this.set({ "string.attach": attach }); }

  ghost(choice: GhostChoice): void {
    this.did(this.motion.setGhost(choice));
    this.sight.ghost = choice;
  }

  /** What a button does to the motion and to what is seen. */
  press(act: Act): void {
    const { scene } = this.lesson;
    if (act.kind === "poke") { if (act.fresh) this.restart(); this.poke(act.at, act.along); }
    else if (act.kind === "set") this.set(act.values(scene, this.motion.body()));
    else if (act.kind === "start") this.start(act.values(scene, this.motion.body()));
    else if (act.kind === "again") this.restart();
    else if (act.kind === "trace") this.sight.trace = this.motion.body().contacts[act.at] ?? null;
    else if (act.kind === "principal") this.sight.principal = true;
    else if (act.kind === "poinsot") this.sight.poinsot = true;
    else if (act.kind === "ghost") { this.ghost(act.choice); this.restart(); }
    else if (act.kind === "card") this.sight.cards = [act.card];
    else if (act.kind === "chalk") this.chalk();
    this.look();
  }

  /** The buttons of the step one after the other, but those that lead to a card or the picture, then time. */
  buttons(seconds = 12): void {
    for (const act of LESSON_PLANS[this.lesson.name]!.steps[this.done]!.acts) if (act.kind !== "card" && act.kind !== "pull" && act.kind !== "press" && act.kind !== "again") this.press(act);
    this.fly(seconds, true);
  }
}

type Hand = (player: Player) => void;
const wait = (seconds: number): Hand => (player) => player.fly(seconds, true);

/** How steps are done by hand where their buttons only lead to the control. */
export const BY_HAND: Readonly<Record<string, readonly (Hand | null)[]>> = {
  t_handle: [null, null, (player) => { player.drag([0, 0.05, 0.06], [0.2, 0.3, 0.2]); player.fly(2, true); }],
  numbers_of_a_tensor: [null, (player) => { player.sight.turned = [...player.motion.body().axes]; player.fly(0.1); }, null],
  plumb_line: [
    (player) => { player.fly(40); player.chalk(); },
    (player) => { player.tie([-0.08, 0, 0]); player.fly(45); player.chalk(); },
    (player) => { const { com, scale } = player.motion.body(); player.poke([com[0] / scale[0], com[1] / scale[1], 0.0138], [0, 0, -1]); },
  ],
  thrown_hammer: [null, null, null, (player) => { player.restart(); player.fly(0.3); player.set({ gravity: [0, 0, 0] }); player.fly(1, true); }],
  true_or_box_tensor: [null, null, (player) => { player.sight.cards = ["body"]; player.look(); }],
};

/** A point of the surface far from all contacts. */
function elsewhere({ motion }: Player): Vec3 {
  const { vertices, contacts, com, scale } = motion.body(), places = [...Object.values(contacts), com.map((c, k) => c / scale[k]!)];
  let best: Vec3 = [0, 0, 0], most = -1;
  for (let k = 0; k < vertices.length; k += 3) {
    const at = [vertices[k]!, vertices[k + 1]!, vertices[k + 2]!] as const, away = Math.min(...places.map((place) => Math.hypot(...at.map((x, i) => x - place[i]!))));
    if (away > most) { most = away; best = at; }
  }
  return best;
}

const SIDES: readonly Vec3[] = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-0.6, 0.8, 0], [0, -0.6, 0.8]];

/** Nobody does anything while time stands. */
const stand: Hand = (player) => { for (let k = 0; k < 20; k++) player.look(); };
/** Pokes from all sides where no step asks for one. */
const pokes: Hand = (player) => { const at = elsewhere(player); for (const along of SIDES) { player.poke(at, along, 0.5); player.fly(0.4); } };
/** Each from the start on, once, and as strongly as the steps ask. */
const freshPokes: Hand = (player) => { const at = elsewhere(player); for (const along of SIDES) { player.restart(); player.poke(at, along); player.fly(1); } };
const still = wait(8);
const spin = (...w: readonly number[]): Hand => (player) => { player.start({ "initial.angular_velocity": w }); player.fly(3); };
const at = (place: string, along: Vec3, factor = 1): Hand => (player) => { player.restart(); player.poke(place, along, factor); player.fly(1); };
const values = (given: Values, seconds = 3): Hand => (player) => { player.set(given); player.fly(seconds); };
const beside = (choice: GhostChoice): Hand => (player) => { player.ghost(choice); player.restart(); player.fly(8); };
const anew = (given: Values, then: Hand = wait(3)): Hand => (player) => { player.start(given); then(player); };

/** Of each step what a wrong hand does: other places, other values, nothing, random pokes. After none of it the step is ticked. */
export const WRONG: Readonly<Record<string, readonly (readonly Hand[])[]>> = {
  ballast_stops_flip: [
    [stand, (player) => { for (let k = 0; k < 12; k++) { player.poke("left", [1, 0, 0], 0.02); player.fly(0.5); } }, values({ "ballast.tip": [0.03, 0, 0, 0.07] }, 8)],
    [still, pokes, anew({ "ballast.a": [0.03, 0, 0.05, 0] }, wait(8)), anew({ "ballast.tip": [0.01, 0, 0, 0.07] }, wait(8)), anew({ "ballast.tip": [0.06, 0, 0, 0.07] }, wait(8))],
    [still, pokes, values({ "ballast.tip": [0.02, 0, 0, 0.07] }, 6)],
  ],
  book: [
    [stand, pokes], [still, freshPokes, spin(0, 0, 8), spin(0, 3, 0), spin(8, 0.05, 0.05), spin(1, 2, 3)], [still, freshPokes, spin(0, 8, 0), spin(0, 0, 2), spin(1, 2, 3)],
    [still, freshPokes, spin(8, 0.05, 0.05), anew({ gyroscopic: false, "initial.angular_velocity": [0, 0, 8] }), values({ gyroscopic: false })],
  ],
  com_or_rim: [
    [stand, still, freshPokes, at("rim", [0, 0, -1]), at("side", [0, 0, -1])], [still, freshPokes, at("com", [0, 0, -1]), at("rim", [0, 0, -1], 2), at("grip", [0, 0, -1])],
    [still, freshPokes, at("rim", [0, 0, -1]), at("grip", [0, 0, -1], 0.5)],
  ],
  dropped_term: [
    [stand, (player) => { player.set({ gyroscopic: true }); player.fly(6); }, (player) => { for (let k = 0; k < 6; k++) { player.poke("left", [1, 0, 0], 0.2); player.fly(0.02); } }],
    [still, pokes, (player) => { player.set({ gyroscopic: true }); player.fly(0.5); player.set({ gyroscopic: false }); player.fly(4); }], [still, pokes],
  ],
  engine: [
    [stand, pokes, spin(12, 0, 0), anew({ gyroscopic: false }, wait(8))],
    [still, pokes, beside(NAMED.mujoco.choice), beside({ ...NO_GHOST, inertia_model: "bounding_box" }), (player) => { player.ghost(NAMED.gyroscopic.choice); player.start({ gyroscopic: false }); player.fly(8); }, (player) => { player.ghost(NAMED.gyroscopic.choice); player.fly(8); },
      (player) => { player.ghost(NAMED.gyroscopic.choice); player.start({ "initial.angular_velocity": [12, 0, 0] }); player.fly(8); }],
    [still, pokes, beside(NAMED.gyroscopic.choice), beside({ ...NO_GHOST, integrator: "semi_implicit_euler" }), beside({ ...NO_GHOST, integrator: "rk4", step: 0.016666667 })],
  ],
  flywheel: [
    [stand, pokes, spin(0.05, 0.05, 6), values({ "rotor.momentum": [0, 0.01, 0] }, 8)],
    [still, pokes, values({ "rotor.momentum": [0, 0.01, 0] }, 10), anew({ "rotor.momentum": [0, 0.003, 0] }, wait(9)), anew({ "rotor.momentum": [0.01, 0, 0] }, wait(9)), anew({ "rotor.momentum": [0, -0.01, 0] }, wait(9)), anew({ "rotor.momentum": [0, 0.01, 0], gyroscopic: false }, wait(9)),
      anew({ "rotor.momentum": [0, 0.01, 0], "initial.angular_velocity": [0, 0, 6] }, wait(9)), anew({ "rotor.torque": [0, 0.002, 0] }, wait(9))],
    [still, pokes, anew({ "rotor.momentum": [0, 0, 0] }, wait(9)), anew({ "rotor.momentum": [0, 0.01, 0] }, wait(9)), anew({ "rotor.momentum": [0, 0.003, 0], "initial.angular_velocity": [0, 0, 6] }, wait(9)), (player) => { player.set({ "rotor.momentum": [0, 0.003, 0] }); player.fly(6); }],
    [still, pokes, spin(0, 0, 0), anew({ "rotor.torque": [0, 0.002, 0] }), anew({ "rotor.torque": [0, 0.002, 0], "initial.angular_velocity": [0, 0, 0], "rotor.momentum": [0, 0.003, 0] }),
      (player) => { player.start({ "rotor.torque": [0, 0, 0], "initial.angular_velocity": [0, 0, 0], "rotor.momentum": [0, 0, 0] }); player.poke("corner", [0, 0, 1]); player.fly(3); }],
  ],
  hammer: [
    [stand, pokes, values({ inertia_model: "bounding_box" })], [still, pokes, values({ inertia_model: "shell" })],
    [still, pokes, (player) => { player.set({ inertia_model: "solid" }); player.poke("head", [1, 0, 0]); player.fly(0.5); player.poke("grip", [1, 0, 0], 2); player.fly(1); },
      (player) => { player.poke("head", [1, 0, 0]); player.fly(0.5); player.poke("grip", [1, 0, 0]); player.fly(1); }],
  ],
  hollow_box: [
    [stand, still, freshPokes, at("face", [0, -1, 0]), anew({ inertia_model: "bounding_box" }, (player) => player.poke("corner", [0, -1, 0]))],
    [still, freshPokes, at("corner", [0, -1, 0]), anew({ inertia_model: "bounding_box" }), anew({ inertia_model: "bounding_box" }, (player) => { player.poke("corner", [0, -1, 0], 2); player.fly(1); }), anew({ inertia_model: "bounding_box" }, (player) => player.poke("face", [0, -1, 0]))],
    [still, freshPokes, at("corner", [0, -1, 0]), anew({ inertia_model: "points" }), anew({ inertia_model: "shell" }, (player) => player.poke("corner", [0, -1, 0])), anew({ inertia_model: "points" }, (player) => player.poke("corner", [0, -1, 0], 0.5))],
  ],
  l_bracket: [
    [stand, pokes, values({ gyroscopic: false })], [still, pokes, (player) => { player.sight.turned = [1, 0, 0, 0, 1, 0, 0, 0, 1]; player.fly(2); }],
    [still, pokes, values({ gyroscopic: false }), anew({ gyroscopic: true })],
  ],
  numbers_of_a_tensor: [
    [stand, pokes], [still, pokes, (player) => { player.sight.turned = [1, 0, 0, 0, 1, 0, 0, 0, 1]; player.fly(2); }, (player) => { player.sight.turned = [0, -1, 0, 1, 0, 0, 0, 0, 1]; player.fly(2); }, (player) => { player.sight.principal = true; player.fly(1); }],
    [still, pokes, freshPokes, spin(0, 0, 4), spin(4, 0, 0), spin(0, 2, 4)],
  ],
  plumb_line: [
    [stand, (player) => { player.fly(2); player.chalk(); player.fly(3); player.chalk(); }, pokes], [still, pokes, (player) => player.chalk(), (player) => { player.tie([-0.08, 0, 0]); player.fly(1.5); player.chalk(); }],
    [still, pokes, (player) => player.poke("corner", [0, 0, -1]), (player) => player.poke("spine", [1, 0.7, 0])],
  ],
  poinsot: [
    [stand, pokes, spin(0, 5, 0), spin(0, 0, 5), anew({ gyroscopic: false }, wait(8))],
    [still, pokes, (player) => { player.sight.principal = true; player.fly(3); }, (player) => { player.sight.cards = ["tensor"]; player.fly(3); }, (player) => { player.sight.poinsot = true; player.look(); }],
    [still, (player) => { player.poke("com", [0, 0, -1]); player.fly(2); }, (player) => { player.poke("corner", [0, 0, -1], 0.02); player.fly(2); }, (player) => { player.sight.poinsot = false; player.poke("corner", [0, 0, -1]); player.fly(2); },
      (player) => { player.poke("corner", [0, 0, -1]); player.fly(0.5); }],
  ],
  spinning_top: [
    [stand, still, freshPokes, at("edge", [0, 0, 1]), at("tip", [1, 0, 0]), anew({ "initial.angular_velocity": [0, 0, 60] }, (player) => player.poke("stem", [1, 0, 0]))],
    [still, freshPokes, at("stem", [1, 0, 0]), anew({ "initial.angular_velocity": [1, 2, 3] }, (player) => player.poke("stem", [1, 0, 0])), anew({ "initial.angular_velocity": [0, 0, 60] }, (player) => { player.poke("stem", [1, 0, 0], 2); player.fly(1); }), anew({ "initial.angular_velocity": [0, 0, 60] }, (player) => player.poke("edge", [0, 0, 1]))],
    [still, freshPokes, at("stem", [1, 0, 0]), anew({ "initial.angular_velocity": [0, 0, 0] }), anew({ "initial.angular_velocity": [0, 0, 0] }, (player) => { player.poke("tip", [1, 0, 0]); player.fly(2); })],
  ],
  t_handle: [
    [stand, (player) => { for (let k = 0; k < 12; k++) { player.poke("left", [1, 0, 0], 0.02); player.fly(0.5); } }], [still, pokes, at("left", [1, 0, 0]), at("right", [0, 0, 1])],
    [still, pokes, at("tip", [1, 0, 0]), (player) => player.drag([0, 0.05, 0.06], [0, 0, 0.01], 0.02)],
  ],
  teapot: [
    [stand, still, freshPokes, at("handle", [0, 1, 0]), at("com", [0, 1, 0])], [still, freshPokes, at("spout", [0, 1, 0]), at("handle", [0, 1, 0], 2), at("com", [0, 1, 0])],
    [still, freshPokes, at("handle", [0, 1, 0]), (player) => player.poke("knob", [0, 1, 0])], [still, freshPokes, at("knob", [0, 1, 0]), at("com", [0, 1, 0], 0.3)],
  ],
  tennis_racket: [
    [stand, pokes], [still, freshPokes, spin(0, 0, 6), spin(0.03, 6, 0.03), spin(1, 2, 3)], [still, freshPokes, spin(6, 0, 0), spin(0, 0, 1)],
    [still, freshPokes, spin(0.03, 6, 0.03), anew({ gyroscopic: false, "initial.angular_velocity": [6, 0, 0] })],
  ],
  thrown_hammer: [
    [stand, pokes, values({ gravity: [0, 0, 0] })], [wait(2), pokes, (player) => { player.sight.trace = "com"; player.fly(1); }, (player) => { player.sight.trace = [0.0682, 0, 0.29]; player.fly(1); }],
    [wait(2), pokes, (player) => { player.restart(); player.fly(2); }, (player) => { player.start({ "initial.angular_velocity": [0, 24, 0] }); player.fly(0.5); }],
    [wait(2), pokes, anew({ gravity: [0, 0, -1.62] })],
  ],
  top_on_string: [
    [stand, pokes, spin(0, -300, 0)], [still, pokes, spin(0, -600, 0), spin(0, -200, 0), spin(1, 2, 3)], [still, pokes, spin(0, -300, 0), spin(0, -600, 0)],
  ],
  true_or_box_tensor: [
    [stand, pokes, values({ inertia_model: "bounding_box" })], [still, pokes, values({ inertia_model: "bounding_box" }), anew({ inertia_model: "shell" })], [still, pokes, (player) => { player.sight.cards = ["world", "ghost"]; player.fly(1); }],
  ],
  weigh_by_throwing: [
    [stand, still, pokes, values({ density: 7000 }), anew({ density: 1400 })], [still, pokes, at("spine", [1, 0, 0])], [still, pokes, at("corner", [-1, 0, 0]), anew({ density: 700 }, (player) => { player.poke("corner", [-1, 0, 0], 3); player.fly(1); }), anew({ density: 700 }, (player) => player.poke("spine", [1, 0, 0]))],
  ],
};

/** Do a step right. */
export function doRight(player: Player): void {
  const hand = BY_HAND[player.lesson.name]?.[player.done];
  if (hand) hand(player); else player.buttons();
}

/** Each wrong hand of a lesson, by a player who has just come to it; what it ticked. */
export async function playWrong(name: string, comes: () => Promise<Player>): Promise<string[]> {
  const ticked: string[] = [];
  for (const [step, hands] of WRONG[name]!.entries()) for (const [k, hand] of hands.entries()) {
    const player = await comes();
    player.answer();
    for (let before = 0; before < step; before++) doRight(player);
    if (player.done !== step) ticked.push(`the right hands before step ${step + 1} ticked ${player.done}`);
    hand(player);
    if (player.done !== step) ticked.push(`wrong hand ${k + 1} of step ${step + 1}`);
  }
  return ticked;
}
