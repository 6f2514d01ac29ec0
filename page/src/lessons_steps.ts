// SPDX-License-Identifier: MIT
//
// The steps of each lesson, by the scene's name, one per sentence in the head of the scene: a condition, and buttons
// that fulfil it or point to where the user can. A condition is a function of the record (lessons_seen.ts): a place, a
// value, or an outcome, never the press of a button.

import { isSameGhost, NAMED } from "./ghosts.ts";
import type { Account, Act, LessonPlan, Seen, Step } from "./lessons.ts";
import {
  alike, axis, between, earlier, flips, free, isAt, isVector, lasted, latest, minus, momentum, newPokes, ofGhost, omega, onlyPoke, pokes, precessed, present, since, size,
  speedGiven, spinGiven, startSpin, steady, strayed, tilted, turns, untouched,
} from "./lessons_seen.ts";
import type { Values, Vec3 } from "./source.ts";

// Buttons

type Says = Act["text"];
const poke = (at: string, along: Vec3): Act => ({ kind: "poke", at, along, text: (w) => w.poke(w.places[at] ?? at) });
const afresh = (at: string, along: Vec3): Act => ({ kind: "poke", at, along, fresh: true, text: (w) => w.again(w.places[at] ?? at) });
const start = (text: Says, values: (scene: Values) => Values): Act => ({ kind: "start", values, text });
const set = (text: Says, values: Values): Act => ({ kind: "set", values: () => values, text });
const again: Act = { kind: "again", text: (w) => w.restart };
const pull: Act = { kind: "pull", text: (w) => w.pull };
const press: Act = { kind: "press", text: (w) => w.press };
const ghost = (name: keyof typeof NAMED): Act => ({ kind: "ghost", choice: NAMED[name].choice, text: (w) => w.ghosts[name] });
const spun = (factor: number): ((scene: Values) => Values) => (scene) => ({ "initial.angular_velocity": startSpin(scene).map((w) => w * factor) });

// Conditions

const watch = (done: Step["done"]): Step => ({ done, acts: [again] });
const unturned = (trial: { readonly start: Values }, scene: Values): boolean => isVector(startSpin(trial.start), startSpin(scene));

/** The present trial from its start if the body wasn't touched; otherwise nothing. */
function whole(account: Account): readonly Seen[] {
  const { script, seen } = present(account);
  return seen[0]?.now.timeNs === 0 && script.every((entry) => "set" in entry) ? seen : [];
}

/** The present trial if it is a throw about this axis of the mesh at the lesson's speed; otherwise nothing. */
function thrown(account: Account, k: number): readonly Seen[] {
  const spin = startSpin(present(account).start), all = size(startSpin(account.scene));
  return Math.abs(spin[k]!) > 0.99 * size(spin) && alike(size(spin), all, 0.2) ? whole(account) : [];
}

const throwAbout = (k: 0 | 1 | 2, slow: number): Act => start((w) => w.throwAbout("xyz"[k]!), (scene) => {
  const all = Math.max(...startSpin(scene).map(Math.abs));
  return { "initial.angular_velocity": [0, 1, 2].map((i) => (i === k ? all : slow)) };
});

/** A book or racket: rotation is unstable about one axis of the mesh, stable about the others, and stable about all
 * without ω × Iω. */
const throws = (unsteady: 0 | 1 | 2, others: readonly [0 | 1 | 2, 0 | 1 | 2], slow: number): LessonPlan => ({
  plots: ["omega"],
  steps: [
    { done: (a) => flips(free(a), unsteady) > 0, acts: [again] },
    ...others.map((k): Step => ({ done: (a) => { const seen = thrown(a, k); return lasted(seen) > 2.5 && steady(seen, k) && hasTerm(seen); }, acts: [throwAbout(k, slow)] })),
    {
      done: (a) => { const seen = thrown(a, unsteady); return lasted(seen) > 2.5 && seen.every(({ values }) => values["gyroscopic"] === false) && flips(seen, unsteady) === 0; },
      acts: [start((w) => w.withoutTerm, (scene) => ({ gyroscopic: false, "initial.angular_velocity": startSpin(scene) }))],
    },
  ],
});

/** The present trial if it has this ghost from its start; otherwise nothing. */
const besideGhost = (a: Account, name: keyof typeof NAMED): readonly Seen[] => {
  const seen = whole(a);
  return unturned(present(a), a.scene) && hasTerm(seen) && isSameGhost(a.sight.ghost, NAMED[name].choice) && seen.every(({ now }) => now.ghost !== null) ? seen : [];
};

/** [N m s] of the flywheel, and [rad/s] of the body, both in its axes. */
const wheel = ({ now: { body } }: Seen): Vec3 => body.rotor;
const own = ({ now: { body } }: Seen): Vec3 => body.row.slice(10, 13) as unknown as Vec3;

/** The whole trial at the lesson's spin with this momentum of the wheel along y, and no motor. */
function withWheel(a: Account, h: number): readonly Seen[] {
  const seen = whole(a);
  return unturned(present(a), a.scene) && hasTerm(seen) && seen.every((each) => isVector(wheel(each), [0, h, 0])) ? seen : [];
}
const spinUp = (h: number): Act => start((w) => w.wheel(String(h)), (scene) => ({ "initial.angular_velocity": startSpin(scene), "rotor.momentum": [0, h, 0], "rotor.torque": [0, 0, 0] }));

const hasTerm = (seen: readonly Seen[]): boolean => seen.every(({ values }) => values["gyroscopic"] !== false);
const model = ({ values }: Seen): string => String(values["inertia_model"]);

/** Mass of ballast near a contact [kg]. */
function ballastAt(seen: Seen, place: string): number {
  const { info: { contacts, scale, length } } = seen, contact = contacts[place]!;
  return Object.entries(seen.values).reduce((mass, [name, value]) => {
    if (!name.startsWith("ballast.") || !Array.isArray(value)) return mass;
    const [kg, ...point] = value as number[], away = size(point.map((p, i) => (p - contact[i]!) * scale[i]!)) / (2 * length);
    return mass + (away < 0.12 ? kg! : 0);
  }, 0);
}

const ballast = (seen: Seen): number => Object.entries(seen.values).reduce((mass, [name, value]) => mass + (name.startsWith("ballast.") && Array.isArray(value) ? (value as number[])[0]! : 0), 0);

/** A step: the same push from rest as at ``before``, now at this place, gives the same speed. */
const push = (place: string, along: Vec3, before: string | null): Step => ({
  done: (a) => {
    const poked = onlyPoke(a, place), other = before ? earlier(a, before) : null;
    if (!poked || size(omega(poked.before)) > 1e-6) return false;
    if (place === "com" && spinGiven(poked) * poked.before.info.length > 0.5 * speedGiven(poked)) return false;
    return !before || (other !== null && alike(poked.strength, other.strength) && alike(speedGiven(poked), speedGiven(other)));
  },
  acts: [before ? afresh(place, along) : poke(place, along)],
});

export const LESSON_PLANS: Readonly<Record<string, LessonPlan>> = {
  ballast_stops_flip: {
    marks: ["tip"], plots: ["omega"],
    steps: [
      watch((a) => free(a).every((seen) => ballast(seen) === 0) && flips(free(a), 2) > 0),
      {
        done: (a) => { const seen = latest(untouched(present(a), since(a)), (each) => alike(ballastAt(each, "tip"), 0.03)); return lasted(seen) > 5 && flips(seen, 2) === 0 && steady(seen, 2); },
        acts: [start((w) => w.stick, () => ({ "ballast.tip": [0.03, 0, 0, 0.07] })), { kind: "card", card: "body", mark: "ballast", text: (w) => w.ballast }],
      },
      {
        done: (a) => flips(latest(untouched(present(a), since(a)), (each) => ballast(each) === 0), 2) > 0,
        acts: [set((w) => w.unstick, { "ballast.tip": [0, 0, 0, 0.07] })],
      },
    ],
  },
  book: throws(0, [1, 2], 0.05),
  com_or_rim: {
    marks: ["com", "rim", "grip"], plots: ["energy"],
    steps: [push("com", [0, 0, -1], null), push("rim", [0, 0, -1], "com"), push("grip", [0, 0, -1], "com")],
  },
  dropped_term: {
    plots: ["momentum"],
    steps: [
      watch((a) => { const seen = free(a); return seen.every((each) => !hasTerm([each])) && strayed(seen, momentum) > 10; }),
      {
        done: (a) => { const seen = latest(untouched(present(a), since(a)), (each) => hasTerm([each])); return lasted(seen) > 1.5 && strayed(seen, momentum) < 1 && strayed(seen, omega) > 5; },
        acts: [set((w) => w.termOn, { gyroscopic: true }), { kind: "card", card: "world", mark: "gyroscopic", text: (w) => w.card }],
      },
      {
        done: (a) => { const seen = latest(untouched(present(a), since(a)), (each) => !hasTerm([each])); return lasted(seen) > 0.5 && strayed(seen, momentum) > 5 && strayed(seen, omega) < 2; },
        acts: [set((w) => w.termOff, { gyroscopic: false })],
      },
    ],
  },
  engine: {
    plots: ["energy", "angle"],
    steps: [
      watch((a) => unturned(present(a), a.scene) && flips(free(a), 2) > 1),
      {
        done: (a) => { const seen = besideGhost(a, "gyroscopic"), ghost = ofGhost(seen); return flips(seen, 2) > 1 && ghost.length > 0 && flips(ghost, 2) === 0; },
        acts: [ghost("gyroscopic"), { kind: "card", card: "ghost", mark: "gyroscopic", text: (w) => w.card }],
      },
      {
        done: (a) => { const seen = besideGhost(a, "mujoco"), { body, ghost } = seen[seen.length - 1]?.now ?? {}; return body !== undefined && Boolean(ghost) && ghost!.kinetic > 1.1 * body.kinetic; },
        acts: [ghost("mujoco"), { kind: "card", card: "plots", mark: "energy", text: (w) => w.energies }, { kind: "card", card: "ghost", mark: "mujoco", text: (w) => w.card }],
      },
    ],
  },
  flywheel: {
    plots: ["omega", "momentum"],
    steps: [
      watch((a) => { const seen = free(a); return unturned(present(a), a.scene) && seen.every((each) => size(wheel(each)) === 0) && flips(seen, 1) > 1; }),
      {
        done: (a) => { const seen = withWheel(a, 0.01); return lasted(seen) > 7 && steady(seen, 1); },
        acts: [spinUp(0.01), { kind: "card", card: "world", mark: "flywheel", text: (w) => w.card }],
      },
      { done: (a) => withWheel(a, 0.003).some((each) => between(axis(each, 1), momentum(each)) > 60), acts: [spinUp(0.003)] },
      {
        done: (a) => {
          const seen = whole(a), last = seen[seen.length - 1], { start: from } = present(a);
          return last !== undefined && size(startSpin(from)) === 0 && size(from["rotor.momentum"] as readonly number[]) === 0 && lasted(seen) > 1.5
            && size(wheel(last)) > 1e-3 && size(momentum(last)) < 1e-6 * size(wheel(last)) && between(wheel(last), own(last)) > 179;
        },
        acts: [start((w) => w.motor, () => ({ "initial.angular_velocity": [0, 0, 0], "rotor.momentum": [0, 0, 0], "rotor.torque": [0, 0.002, 0] }))],
      },
    ],
  },
  hammer: {
    marks: ["head", "grip"], plots: ["omega"], hidesCentre: "question",
    steps: [
      watch((a) => free(a).every((each) => model(each) === "solid") && turns(free(a)) > 1),
      {
        done: (a) => turns(latest(untouched(present(a), since(a)), (each) => model(each) === "bounding_box")) > 1,
        acts: [set((w) => w.box, { inertia_model: "bounding_box" })],
      },
      {
        done: (a) => {
          const found = [...a.trials.slice(a.trial, -1).flatMap((trial) => pokes(trial)), ...newPokes(a)].filter(({ before }) => model(before) === "solid");
          const head = found.filter(isAt("head")), grip = found.filter(isAt("grip"));
          return head.some((one) => grip.some((two) => alike(one.strength, two.strength) && alike(speedGiven(one), speedGiven(two)) && spinGiven(two) > 2 * spinGiven(one)));
        },
        acts: [set((w) => w.truth, { inertia_model: "solid" }), poke("head", [1, 0, 0]), poke("grip", [1, 0, 0])],
      },
    ],
  },
  hollow_box: {
    marks: ["corner"], plots: ["energy"],
    steps: [
      { done: (a) => { const poked = onlyPoke(a, "corner"); return poked !== null && model(poked.before) === "solid" && spinGiven(poked) > 0; }, acts: [poke("corner", [0, -1, 0])] },
      ...([["bounding_box", true, (w) => w.box], ["points", false, (w) => w.corners]] as const satisfies readonly (readonly [string, boolean, Says])[]).map(([other, isFaster, says]): Step => ({
        done: (a) => {
          const poked = onlyPoke(a, "corner"), before = earlier(a, "corner"), solid = a.trials.slice(0, -1).flatMap((trial) => pokes(trial)).filter(isAt("corner")).find((each) => model(each.before) === "solid");
          return poked !== null && before !== null && solid !== undefined && model(poked.before) === other && alike(poked.strength, solid.strength)
            && (isFaster ? spinGiven(poked) > 1.1 * spinGiven(solid) : spinGiven(poked) < 0.95 * spinGiven(solid));
        },
        acts: [start(says, () => ({ inertia_model: other })), poke("corner", [0, -1, 0])],
      })),
    ],
  },
  l_bracket: {
    plots: ["omega"], hidesCentre: "question",
    steps: [
      watch((a) => hasTerm(free(a)) && free(a).some((seen) => between(omega(seen), [0, 0, 1]) > 5)),
      { done: (a) => a.sight.principal && lasted(since(a)) > 0.5, acts: [{ kind: "principal", text: (w) => w.principal }, { kind: "card", card: "tensor", mark: "principal", text: (w) => w.card }] },
      {
        done: (a) => { const seen = whole(a); return present(a).start["gyroscopic"] === false && !seen.some((each) => hasTerm([each])) && strayed(seen, omega) < 1 && strayed(seen, momentum) > 4; },
        acts: [start((w) => w.withoutTerm, () => ({ gyroscopic: false }))],
      },
    ],
  },
  numbers_of_a_tensor: {
    plots: ["momentum"], hidesCentre: "question",
    steps: [
      watch((a) => free(a).length > 0 && lasted(free(a)) > 0.5 && unturned(present(a), a.scene) && free(a).some((seen) => between(omega(seen), momentum(seen)) > 5)),
      {
        done: ({ sight: { turned }, trials }) => turned !== null && strayedAxes(turned) > 5 && product(turned, trials[trials.length - 1]!.seen.at(-1)?.info.inertia) < 0.02,
        acts: [{ kind: "card", card: "tensor", mark: "turn", text: (w) => w.turn }],
      },
      {
        done: (a) => {
          const seen = whole(a), first = seen[0];
          if (!first || lasted(seen) < 2) return false;
          const angle = between(omega(first), principalAxis(first, 2));
          return Math.min(angle, 180 - angle) < 3 && seen.every((each) => between(omega(each), momentum(each)) < 3);
        },
        acts: [{ kind: "start", values: (scene, { axes }) => ({ "initial.angular_velocity": [axes[2]!, axes[5]!, axes[8]!].map((x) => x * size(startSpin(scene))) }), text: (w) => w.aboutThird }],
      },
    ],
  },
  plumb_line: {
    plots: ["energy"], hidesCentre: "end",
    steps: [
      { done: ({ lines }) => lines.length > 0, acts: [{ kind: "chalk", text: (w) => w.chalk }] },
      {
        done: ({ lines }) => lines.some((one, k) => lines.slice(0, k).some((other) => { const angle = between(one.along, other.along); return angle > 15 && angle < 165; })),
        acts: [{ kind: "tie", text: (w) => w.tie }, { kind: "chalk", text: (w) => w.chalk }],
      },
      { done: (a) => newPokes(a).some(({ lever, fromCentre }) => lever < 0.08 && fromCentre < 0.12), acts: [press] },
    ],
  },
  poinsot: {
    plots: ["omega", "momentum"],
    steps: [
      watch((a) => { const seen = free(a); return unturned(present(a), a.scene) && flips(seen, 0) > 1 && strayed(seen, momentum) < 0.1 && strayed(seen, omega) > 10; }),
      { done: (a) => a.sight.poinsot && turns(free(a)) > 2, acts: [{ kind: "poinsot", text: (w) => w.poinsot }, { kind: "card", card: "tensor", mark: "poinsot", text: (w) => w.card }] },
      {
        done: (a) => a.sight.poinsot && newPokes(a).some((poked) => tilted(poked) > 5 && present(a).seen.at(-1)!.now.timeNs - poked.after.now.timeNs > 1e9),
        acts: [poke("corner", [0, 0, -1])],
      },
    ],
  },
  spinning_top: {
    marks: ["stem"], plots: ["omega"],
    steps: [
      { done: (a) => unturned(present(a), a.scene) && isTilt(onlyPoke(a, "stem"), 0.5, 45), acts: [poke("stem", [1, 0, 0])] },
      {
        done: (a) => {
          const poked = onlyPoke(a, "stem"), before = earlier(a, "stem");
          return isVector(startSpin(present(a).start), startSpin(a.scene).map((w) => 2 * w)) && poked !== null && before !== null && alike(poked.strength, before.strength) && isTilt(poked, 0.25, 0.8 * tilted(before));
        },
        acts: [start((w) => w.twice, spun(2)), poke("stem", [1, 0, 0])],
      },
      {
        done: (a) => size(startSpin(present(a).start)) < 0.01 * size(startSpin(a.scene)) && onlyPoke(a, "stem") !== null && strayed(present(a).seen, (seen) => axis(seen, 2)) > 60,
        acts: [start((w) => w.noSpin, spun(0)), poke("stem", [1, 0, 0])],
      },
    ],
  },
  t_handle: {
    marks: ["tip"], plots: ["omega"],
    steps: [
      watch((a) => flips(free(a), 2) > 1),
      {
        done: (a) => newPokes(a).some((poked) => isAt("tip")(poked) && tilted(poked) > 3 && present(a).seen.at(-1)!.now.timeNs - poked.after.now.timeNs > 1.5e9),
        acts: [poke("tip", [1, 0, 0])],
      },
      {
        done: (a) => {
          const seen = since(a), last = seen[seen.length - 1], held = seen.filter(({ now: { body } }) => body.string !== null), let_go = held[held.length - 1];
          const before = seen[seen.indexOf(held[0]!) - 1] ?? seen[0];
          return let_go !== undefined && before !== undefined && last !== undefined && last.now.body.string === null
            && size(minus(momentum(let_go), momentum(before))) > 0.1 * size(momentum(before)) && last.now.timeNs - let_go.now.timeNs > 1e9;
        },
        acts: [pull],
      },
    ],
  },
  teapot: {
    marks: ["spout", "handle", "knob", "com"], plots: ["energy"],
    steps: [push("spout", [0, 1, 0], null), push("handle", [0, 1, 0], "spout"), push("knob", [0, 1, 0], "spout"), push("com", [0, 1, 0], "spout")],
  },
  tennis_racket: throws(1, [0, 2], 0.03),
  thrown_hammer: {
    marks: ["grip"], plots: ["energy"], rate: 0.25, trace: "com", hidesCentre: "question",
    steps: [
      watch((a) => back(a) && unturned(present(a), a.scene)),
      {
        done: (a) => {
          const { trace } = a.sight, last = present(a).seen.at(-1);
          if (trace === null || trace === "com" || !last) return false;
          const { contacts, scale, length } = last.info;
          return size(trace.map((p, i) => (p - contacts["grip"]![i]!) * scale[i]!)) < 0.12 * 2 * length && lasted(since(a)) > 0.3;
        },
        acts: [{ kind: "trace", at: "grip", text: (w) => w.trace }, { kind: "card", card: "measure", mark: "trace", text: (w) => w.card }],
      },
      { done: (a) => back(a) && size(minus(startSpin(present(a).start), startSpin(a.scene))) > 0.1 * size(startSpin(a.scene)), acts: [start((w) => w.twice, spun(2))] },
      {
        done: (a) => { const seen = latest(since(a), ({ values }) => size(values["gravity"] as readonly number[]) === 0); return lasted(seen) > 0.2 && seen[0]!.now.timeNs > 0 && untouched(present(a), seen).length === seen.length; },
        acts: [set((w) => w.weightless, { gravity: [0, 0, 0] })],
      },
    ],
  },
  top_on_string: {
    plots: ["momentum"],
    steps: [
      watch((a) => unturned(present(a), a.scene) && precessed(free(a), 2) > 90),
      {
        done: (a) => {
          const seen = whole(a);
          return isVector(startSpin(present(a).start), startSpin(a.scene).map((w) => 0.5 * w)) && lasted(seen) > 1 && precessed(seen, 2) / lasted(seen) > 150 && isLevel(seen);
        },
        acts: [start((w) => w.half, spun(0.5))],
      },
      { done: (a) => size(startSpin(present(a).start)) < 0.01 * size(startSpin(a.scene)) && !isLevel(whole(a)), acts: [start((w) => w.noSpin, spun(0))] },
    ],
  },
  true_or_box_tensor: {
    plots: ["angle"],
    steps: [
      watch((a) => free(a).every((each) => model(each) === "solid") && free(a).some(({ now }) => now.angleToGhost > 1)),
      {
        done: (a) => { const seen = whole(a); return lasted(seen) > 2 && seen.every((each) => model(each) === "bounding_box" && each.now.angleToGhost < 0.01); },
        acts: [start((w) => w.box, () => ({ inertia_model: "bounding_box" }))],
      },
      { done: (a) => a.sight.cards.includes("body"), acts: [{ kind: "card", card: "body", mark: "moments", text: (w) => w.moments }] },
    ],
  },
  weigh_by_throwing: {
    marks: ["corner"], plots: ["omega"],
    steps: [
      {
        done: (a) => { const seen = whole(a); return lasted(seen) > 2 && seen.every((each) => alike(each.info.massKg, 10 * firstMass(a))); },
        acts: [start((w) => w.tenfold, (scene) => ({ density: 10 * Number(scene["density"]) }))],
      },
      { done: (a) => newPokes(a).some((poked) => isAt("corner")(poked) && alike(poked.before.info.massKg, 10 * firstMass(a))), acts: [poke("corner", [-1, 0, 0])] },
      {
        done: (a) => {
          const poked = onlyPoke(a, "corner"), heavy = earlier(a, "corner");
          return poked !== null && heavy !== null && alike(poked.before.info.massKg, firstMass(a)) && alike(poked.strength, heavy.strength) && alike(speedGiven(poked), 10 * speedGiven(heavy), 0.1);
        },
        acts: [start((w) => w.tenth, (scene) => ({ density: Number(scene["density"]) })), poke("corner", [-1, 0, 0])],
      },
    ],
  },
};

const isTilt = (poked: ReturnType<typeof onlyPoke>, least: number, most: number): boolean => poked !== null && tilted(poked) > least && tilted(poked) < most;
const firstMass = (account: Account): number => Number(account.scene["density"]) * (account.trials[0]?.seen[0]?.info.volume ?? NaN);
const isLevel = (seen: readonly Seen[]): boolean => seen.every((each) => Math.abs(90 - between(axis(each, 2), [0, 0, 1])) < 45);

/** Whether the body has returned to the height of its throw without being touched. */
function back(account: Account): boolean {
  const seen = whole(account), first = seen[0], last = seen[seen.length - 1];
  return first !== undefined && last !== undefined && seen.some(({ now }) => now.body.row[2]! > first.now.body.row[2]! + 0.5)
    && last.now.body.row[2]! <= first.now.body.row[2]! && seen.every(({ values }) => size(values["gravity"] as readonly number[]) > 0);
}

function principalAxis({ info: { axes }, now: { body: { rotation: R } } }: Seen, k: number): Vec3 {
  return [0, 1, 2].map((i) => R[3 * i]! * axes[k]! + R[3 * i + 1]! * axes[3 + k]! + R[3 * i + 2]! * axes[6 + k]!) as unknown as Vec3;
}

/** Angle between these axes (columns) and those of the mesh [degrees]. */
function strayedAxes(turned: readonly number[]): number {
  return (Math.acos(Math.max(-1, Math.min(1, 0.5 * (turned[0]! + turned[4]! + turned[8]! - 1)))) * 180) / Math.PI;
}

/** The largest product of inertia in these axes (columns), relative to the largest moment. */
function product(axes: readonly number[], inertia: readonly number[] | undefined): number {
  if (!inertia) return Infinity;
  const column = (k: number): Vec3 => [axes[k]!, axes[3 + k]!, axes[6 + k]!];
  const element = (i: number, j: number): number => { const u = column(i), v = column(j); return u.reduce((sum, x, r) => sum + x * (inertia[3 * r]! * v[0] + inertia[3 * r + 1]! * v[1] + inertia[3 * r + 2]! * v[2]), 0); };
  return Math.max(Math.abs(element(0, 1)), Math.abs(element(0, 2)), Math.abs(element(1, 2))) / Math.max(element(0, 0), element(1, 1), element(2, 2));
}
