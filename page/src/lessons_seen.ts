// SPDX-License-Identifier: MIT
//
// Building blocks of step conditions: places, values and outcomes, found in the record of a lesson. No physics.

import type { Account, Seen, Trial } from "./lessons.ts";
import type { At, Entry, Values, Vec3 } from "./source.ts";

/** A poke hits a contact if it is closer than this, relative to the body's size (diagonal of its box), and closer than
 * to other contacts. */
export const NEAR = 0.12;
/** A poke hits the centre of mass if its line passes closer than this, relative to the size. */
export const CENTRAL = 0.05;
/** Relative tolerance of numbers that should be equal, or of a given ratio. */
export const ALIKE = 0.05;

export const present = ({ trials }: Account): Trial => trials[trials.length - 1]!;

/** Instants of the present trial since the step began. */
export function since(account: Account): readonly Seen[] {
  const { seen } = present(account);
  return account.trial === account.trials.length - 1 ? seen.slice(account.from) : seen;
}

const touches = (entry: Entry): boolean => !("set" in entry);

/** Those of the instants, from the end, in which only parameters were changed. */
export function untouched(trial: Trial, seen: readonly Seen[]): readonly Seen[] {
  let last = -1;
  trial.script.forEach((entry, k) => { if (touches(entry)) last = k; });
  return seen.filter(({ entries, now: { body } }) => entries > last && !(body.string && trial.script.slice(0, entries).some((entry) => "string" in entry)));
}

/** The instants since the step began if the body wasn't touched; otherwise none. */
export function free(account: Account): readonly Seen[] {
  const seen = since(account), trial = present(account), first = seen[0];
  return first && !trial.script.slice(first.entries).some(touches) ? seen : [];
}

/** Time from the first to the last instant [s]. */
export function lasted(seen: readonly Seen[]): number {
  return seen.length ? 1e-9 * (seen[seen.length - 1]!.now.timeNs - seen[0]!.now.timeNs) : 0;
}

/** The longest run of instants up to the last one that all fulfil the condition. */
export function latest(seen: readonly Seen[], so: (seen: Seen) => boolean): readonly Seen[] {
  let from = seen.length;
  while (from > 0 && so(seen[from - 1]!)) from--;
  return seen.slice(from);
}

// Vectors

export const size = (v: readonly number[]): number => Math.hypot(...v);
export const minus = (a: readonly number[], b: readonly number[]): Vec3 => [a[0]! - b[0]!, a[1]! - b[1]!, a[2]! - b[2]!];
export const dot = (a: readonly number[], b: readonly number[]): number => a[0]! * b[0]! + a[1]! * b[1]! + a[2]! * b[2]!;
export const cross = (a: readonly number[], b: readonly number[]): Vec3 => [a[1]! * b[2]! - a[2]! * b[1]!, a[2]! * b[0]! - a[0]! * b[2]!, a[0]! * b[1]! - a[1]! * b[0]!];

/** Angle [degrees], accurate near 0 and 180; NaN for a zero vector. */
export function between(a: readonly number[], b: readonly number[]): number {
  return size(a) > 0 && size(b) > 0 ? (Math.atan2(size(cross(a, b)), dot(a, b)) * 180) / Math.PI : NaN;
}

/** An axis of the mesh, in world axes. */
export const axis = ({ now: { body: { rotation: R } } }: Seen, k: number): Vec3 => [R[k]!, R[3 + k]!, R[6 + k]!];
export const momentum = ({ now }: Seen): Vec3 => now.body.momentum;
export const omega = ({ now }: Seen): Vec3 => now.body.omega;
export const velocity = ({ now: { body: { row } } }: Seen): Vec3 => [row[7]!, row[8]!, row[9]!];

// Outcomes

/** Number of flips of an axis of the mesh relative to L: from nearly parallel to nearly antiparallel, or back. */
export function flips(seen: readonly Seen[], k: number): number {
  let side = 0, count = 0;
  for (const each of seen) {
    const angle = between(axis(each, k), momentum(each)), now = angle < 50 ? 1 : angle > 130 ? -1 : 0;
    if (now && side && now !== side) count++;
    if (now) side = now;
  }
  return count;
}

/** The same instants with the ghost in place of the body; none without a ghost. */
export function ofGhost(seen: readonly Seen[]): readonly Seen[] {
  return seen.every(({ now }) => now.ghost !== null) ? seen.map((each) => ({ ...each, now: { ...each.now, body: each.now.ghost! } })) : [];
}

/** Whether an axis of the mesh has stayed parallel or antiparallel to L. */
export const steady = (seen: readonly Seen[], k: number): boolean =>
  seen.length > 0 && seen.every((each) => { const angle = between(axis(each, k), momentum(each)); return angle < 25 || angle > 155; });

/** Largest angle of a vector to its first value [degrees]. */
export function strayed(seen: readonly Seen[], of: (seen: Seen) => Vec3): number {
  const first = seen[0] ? of(seen[0]) : [0, 0, 0];
  return seen.reduce((most, each) => Math.max(most, between(first, of(each)) || 0), 0);
}

/** Rotation of the body [revolutions]. */
export function turns(seen: readonly Seen[]): number {
  let angle = 0;
  for (let k = 1; k < seen.length; k++) angle += 0.5 * (size(omega(seen[k]!)) + size(omega(seen[k - 1]!))) * 1e-9 * (seen[k]!.now.timeNs - seen[k - 1]!.now.timeNs);
  return angle / (2 * Math.PI);
}

/** Angle about the vertical that an axis of the mesh has precessed [degrees]. */
export function precessed(seen: readonly Seen[], k: number): number {
  let angle = 0;
  for (let i = 1; i < seen.length; i++) {
    const a = axis(seen[i - 1]!, k), b = axis(seen[i]!, k);
    angle += Math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
  }
  return Math.abs((angle * 180) / Math.PI);
}

// Values

export const alike = (a: number, b: number, part = ALIKE): boolean => Math.abs(a - b) <= part * Math.abs(b);

export const startSpin = (values: Values): Vec3 => values["initial.angular_velocity"] as unknown as Vec3;

/** Whether a vector equals another one, within 5 % of its length. */
export const isVector = (value: readonly number[], wanted: readonly number[]): boolean => size(minus(value, wanted)) <= ALIKE * size(wanted) + 1e-9;

// Pokes

/** A poke. point [mesh]; strength [N s]; place: nearest contact; away: distance to it; lever: distance of the poke's
 * line from the centre of mass; fromCentre: distance of the point from it; distances relative to the size. before,
 * after: instants. */
export interface Poke {
  readonly point: Vec3;
  readonly strength: number;
  readonly place: string;
  readonly away: number;
  readonly lever: number;
  readonly fromCentre: number;
  readonly before: Seen;
  readonly after: Seen;
}

/** The pokes of a trial in order, from the script entry with index ``from`` on. */
export function pokes(trial: Trial, from = 0): readonly Poke[] {
  return trial.script.flatMap((entry, k) => {
    const poke = k < from ? null : pokeOf(trial, entry, k);
    return poke ? [poke] : [];
  });
}

function pokeOf({ seen }: Trial, entry: Entry, k: number): Poke | null {
  const after = seen.find(({ entries }) => entries > k), until = after ? seen.indexOf(after) : 0, before = seen[until - 1];
  const given = "impulse" in entry && entry.impulse ? entry.impulse : "force" in entry && entry.force ? entry.force.map((f) => f * (entry.duration ?? 0.02)) as unknown as Vec3 : null;
  if (!after || !before || !given || !("at" in entry || "impulse" in entry)) return null;
  const { scale, com, length, contacts } = before.info, whole = 2 * length, at = ("at" in entry ? entry.at : undefined) ?? "com";
  const point = placeOf(at, before);
  if (!point) return null;
  const { rotation: R } = before.now.body, isBody = "axes" in entry && entry.axes === "body";
  const way = isBody ? given : ([0, 1, 2].map((i) => R[i]! * given[0] + R[3 + i]! * given[1] + R[6 + i]! * given[2]) as unknown as Vec3);
  const arm = point.map((p, i) => p * scale[i]! - com[i]!), lever = size(way) > 0 ? size(cross(arm, way)) / size(way) / whole : 0;
  let place = "", away = Infinity;
  for (const [name, contact] of Object.entries(contacts)) {
    const distance = size(contact.map((c, i) => (c - point[i]!) * scale[i]!)) / whole;
    if (distance < away) { away = distance; place = name; }
  }
  return { point, strength: size(given), place, away, lever, fromCentre: size(arm) / whole, before, after };
}

/** The point at which a load acts [mesh]; null for rays. */
function placeOf(at: At, { info: { contacts, com, scale, vertices } }: Seen): Vec3 | null {
  if (at === "com") return com.map((c, i) => c / scale[i]!) as unknown as Vec3;
  if (at === "origin") return [0, 0, 0];
  if (typeof at === "string") return contacts[at] ?? null;
  if ("point" in at) return at.point;
  return "vertex" in at ? [vertices[3 * at.vertex]!, vertices[3 * at.vertex + 1]!, vertices[3 * at.vertex + 2]!] : null;
}

/** Pokes of the present trial since the step began. */
export function newPokes(account: Account): readonly Poke[] {
  const first = since(account)[0];
  return first ? pokes(present(account), account.trial === account.trials.length - 1 ? first.entries : 0) : [];
}

export const isAt = (place: string) => (poke: Poke): boolean => (place === "com" ? poke.lever < CENTRAL : poke.place === place && poke.away < NEAR);

/** The poke of the present trial if it is at this place and nothing else has touched the body. */
export function onlyPoke(account: Account, place: string): Poke | null {
  const trial = present(account), [poke, ...others] = pokes(trial);
  return poke && others.length === 0 && trial.script.filter(touches).length === 1 && isAt(place)(poke) ? poke : null;
}

/** The latest poke at a place in an earlier trial. */
export function earlier(account: Account, place: string): Poke | null {
  for (let k = account.trials.length - 2; k >= 0; k--) {
    const found = pokes(account.trials[k]!).filter(isAt(place));
    if (found.length) return found[found.length - 1]!;
  }
  return null;
}

/** Change of velocity [m/s], and of angular velocity [rad/s], by a poke. */
export const speedGiven = ({ before, after }: Poke): number => size(minus(velocity(after), velocity(before)));
export const spinGiven = ({ before, after }: Poke): number => size(minus(omega(after), omega(before)));
/** Change of L's direction by a poke [degrees]. */
export const tilted = ({ before, after }: Poke): number => between(momentum(before), momentum(after));
