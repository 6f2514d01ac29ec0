// SPDX-License-Identifier: MIT
//
// Entries of poke scripts: converted to commands for the kernels, and written as files that Python reads.

import type { Declarations } from "./data.ts";
import { NUMBERS } from "./kernels.ts";
import { filled, flow, nanoseconds, Refused, repr, shown, Whole } from "./numbers.ts";
import type { At, Entry, Values, Vec3, Wrench } from "./source.ts";

/** A command as in a flight's table (LOAD_ROW): duration [ns], −1 for the default; slot: its name, "" for the unnamed
 * slot of held wrenches, null for none; load: LOAD numbers. frame: its frame_id, for refusals. */
export interface Load {
  readonly kind: number;
  readonly durationNs: number;
  readonly slot: string | null;
  readonly load: readonly number[];
  readonly frame: string;
}
/** A load, or a change of parameters that isn't checked yet. */
export type Command = Load | { readonly set: unknown };

const MOST = 1e100;
const LONGEST_S = 1e9;
const SLOT = /^[a-z][a-z0-9_]{0,11}$/;
const ZERO: Vec3 = [0, 0, 0];
const STATE = { position: 3, orientation_xyzw: 4, linear_velocity: 3, angular_velocity: 3 } as const;
const KEYS = ["at", "force", "push", "torque", "axes", "duration", "slot"];
const POKE_KEYS = ["t", ...KEYS, "impulse", "angular_impulse"];

type Fields = Readonly<Record<string, unknown>>;

/** Converts script entries to commands. */
export class Script {
  readonly #declared: Declarations;

  constructor(declared: Declarations) {
    this.#declared = declared;
  }

  /** The commands of an entry. contacts: parameters with the contacts [mesh]. Throws Refused. */
  commands(entry: Entry, contacts: Values): Command[] {
    const fields = this.#fields(entry, "entry", null);
    const kinds = ["wrench", "string", "set", "state", "service"].filter((key) => key in fields);
    const kind = kinds[0];
    if (kind === undefined) {
      this.#fields(entry, "entry", POKE_KEYS);
      return [this.#load(fields, false, contacts)];
    }
    this.#fields(entry, "entry", ["t", kind]);
    const content = fields[kind], { command } = NUMBERS;
    switch (kind) {
      case "wrench":
        return [this.#load(this.#fields(content, kind, KEYS), true, contacts)];
      case "set":
        return [{ set: content }];
      case "string":
        return this.#string(content, contacts);
      case "state":
        return [this.#state(this.#fields(content, kind, Object.keys(STATE)))];
      default:
        if (content !== "clear_wrench") throw this.#refused("service", content, "clear_wrench");
        return [this.#plain(command.CLEAR, [])];
    }
  }

  #refused(field: string, received: unknown, accepted: string): Refused {
    return new Refused(filled(this.#declared.words.accepted, { 0: field, 1: shown(received), 2: accepted }));
  }

  #fields(value: unknown, field: string, known: readonly string[] | null): Fields {
    if (typeof value !== "object" || value === null || Array.isArray(value)) throw this.#refused(field, value, "an entry such as {t: 0.5, force: [0, 0, 1]}");
    const unknown = Object.keys(value).find((key) => known !== null && !known.includes(key));
    if (unknown !== undefined) throw new Refused(`${field}: there is no key ${unknown}; the keys here are ${known?.join(", ") ?? ""}`);
    return value as Fields;
  }

  #number(value: unknown, field: string, lower = -MOST, upper = MOST): number {
    if (typeof value !== "number" || !(value >= lower && value <= upper)) throw this.#refused(field, value, `a number from ${lower} to ${upper}`);
    return value;
  }

  #numbers(value: unknown, field: string, count: number): number[] {
    if (!Array.isArray(value) || value.length !== count) throw this.#refused(field, value, `${count} numbers`);
    return value.map((x) => this.#number(x, field));
  }

  #plain(kind: number, load: readonly number[]): Load {
    const whole = [...load, ...new Array<number>(NUMBERS.load.LOAD - load.length).fill(0)];
    return { kind, durationNs: -1, slot: null, load: whole, frame: "" };
  }

  #contact(name: string, contacts: Values): readonly number[] {
    const point = contacts[`contacts.${name}`];
    const known = Object.keys(contacts).filter((key) => key.startsWith("contacts.")).map((key) => key.slice(9)).sort();
    if (!Array.isArray(point)) throw this.#refused("contact", name, known.length > 0 ? `a contact of the body (${known.join(", ")})` : "the body has no contacts");
    return point as readonly number[];
  }

  #string(content: unknown, contacts: Values): Command[] {
    const { command } = NUMBERS;
    if (content === "release") return [this.#plain(command.RELEASE_STRING, [])];
    const fields = this.#fields(content, "string", ["attach", "target"]);
    const found: Command[] = [];
    if ("attach" in fields) {
      const { attach } = fields;
      const point = typeof attach === "string" ? this.#contact(attach, contacts) : this.#numbers(attach, "attach", 3);
      found.push(this.#plain(command.TIE_STRING, [0, 0, ...point]));
    }
    if ("target" in fields) found.push(this.#plain(command.MOVE_STRING, [0, 0, ...this.#numbers(fields["target"], "target", 3)]));
    if (found.length === 0) throw this.#refused("string", content, "release, or {attach, target}");
    return found;
  }

  #state(fields: Fields): Load {
    const given = Object.entries(STATE);
    const bits = given.reduce((sum, [name], k) => sum + (name in fields ? 2 ** k : 0), 0);
    const numbers = given.flatMap(([name, count]) => (name in fields ? this.#numbers(fields[name], name, count) : new Array<number>(count).fill(0)));
    if (bits === 0) throw this.#refused("state", fields, `any of ${Object.keys(STATE).join(", ")}`);
    if ("orientation_xyzw" in fields && !numbers.slice(3, 7).some((x) => x !== 0)) {
      throw this.#refused("state, orientation_xyzw", fields["orientation_xyzw"], "four numbers, not all zero");
    }
    return this.#plain(NUMBERS.command.SET_STATE, [bits, ...numbers]);
  }

  #load(fields: Fields, held: boolean, contacts: Values): Load {
    const { command, load } = NUMBERS;
    const impulse = "impulse" in fields || "angular_impulse" in fields;
    const lasting = "force" in fields || "push" in fields || "torque" in fields;
    const durationS = "duration" in fields ? this.#number(fields["duration"], "duration", 1e-9, LONGEST_S) : null;
    if (impulse && (lasting || durationS !== null || "slot" in fields)) throw this.#refused("entry", Object.keys(fields), "impulses alone, or force, push and torque with a duration or slot");
    if (!impulse && !lasting) throw this.#refused("entry", Object.keys(fields), "force, push, impulse, torque or angular_impulse");
    const { slot, axes = "world" } = fields;
    if (slot !== undefined && !(typeof slot === "string" && SLOT.test(slot))) throw this.#refused("slot", slot, "a name of [a-z][a-z0-9_]*, up to 12 characters");
    if (axes !== "world" && axes !== "body") throw this.#refused("axes", axes, "world, body");
    const [forceKey, torqueKey] = impulse ? ["impulse", "angular_impulse"] : ["force", "torque"];
    const torque = torqueKey in fields ? this.#numbers(fields[torqueKey], torqueKey, 3) : ZERO;
    let force: readonly number[] = forceKey in fields ? this.#numbers(fields[forceKey], forceKey, 3) : ZERO;
    let number: number = axes === "world" ? load.WORLD_AXES : load.BODY_AXES;
    const place = this.#place(fields["at"] ?? "com", contacts);
    if ("push" in fields) {
      if ("force" in fields || "axes" in fields || "torque" in fields) throw this.#refused("entry", Object.keys(fields), "push without force, axes and torque: it acts along the inward normal");
      if (place[0] === load.AT_COM) throw this.#refused("at", "com", "a point of the surface, which has a normal, such as {vertex: 0}");
      number = load.NORMAL_AXES;
      force = [this.#number(fields["push"], "push"), 0, 0];
    }
    const kind = impulse ? command.IMPULSE : held && durationS === null ? command.HELD_WRENCH : command.PULSE;
    return {
      kind,
      durationNs: durationS === null ? -1 : nanoseconds(durationS),
      slot: slot === undefined ? (held ? "" : null) : slot,
      load: [number, place[0] ?? 0, ...place.slice(1, 4), ...force, ...torque, ...place.slice(4)],
      frame: frameText(number === load.NORMAL_AXES ? "normal" : axes, fields["at"] ?? "com", durationS, impulse, slot),
    };
  }

  /** Kind of a load's point, its three numbers, and a ray's direction or three zeros. */
  #place(at: unknown, contacts: Values): number[] {
    const { load } = NUMBERS;
    if (at === "com") return [load.AT_COM, ...ZERO, ...ZERO];
    if (at === "origin") return [load.AT_POINT, ...ZERO, ...ZERO];
    if (typeof at === "string") return [load.AT_POINT, ...this.#contact(at, contacts), ...ZERO];
    const fields = this.#fields(at, "at", ["vertex", "point", "ray"]);
    if (Object.keys(fields).length === 1) {
      if ("point" in fields) return [load.AT_POINT, ...this.#numbers(fields["point"], "at, point", 3), ...ZERO];
      const { vertex, ray } = fields;
      if (typeof vertex === "number" && Number.isSafeInteger(vertex) && vertex >= 0) return [load.AT_VERTEX, vertex, 0, 0, ...ZERO];
      if (ray !== undefined) {
        const { origin, direction } = this.#fields(ray, "ray", ["origin", "direction"]);
        const way = this.#numbers(direction, "at, ray, direction", 3);
        if (way.some((x) => x !== 0)) return [load.ON_RAY, ...this.#numbers(origin, "at, ray, origin", 3), ...way];
      }
    }
    throw this.#refused("at", JSON.stringify(at), "com, origin, a contact's name, {vertex: i}, {point: [x, y, z]} or {ray: {origin, direction}}");
  }
}

/** A load's frame_id, as in motion/frames.py. */
function frameText(axes: string, at: unknown, durationS: number | null, impulse: boolean, slot: unknown): string {
  const options = impulse ? ";impulse" : `${durationS === null ? "" : `;duration=${repr(durationS)}`}${slot === undefined ? "" : `;slot=${String(slot)}`}`;
  return `${axes}@${pointText(at as At)}${options}`;
}

function pointText(at: At): string {
  const triple = (point: Vec3): string => point.map(repr).join(",");
  if (typeof at === "string") return at;
  if ("vertex" in at) return `vertex/${at.vertex}`;
  if ("point" in at) return `point/${triple(at.point)}`;
  return `ray/${triple(at.ray.origin)}/${triple(at.ray.direction)}`;
}

/** The text of a poke script; entries have their times. */
export function scriptText(entries: readonly Entry[]): string {
  return entries.length === 0 ? "[]\n" : entries.map((entry) => `- ${flow(written(entry))}\n`).join("");
}

function written(entry: Entry): Fields {
  const { t, ...rest } = entry as Fields;
  const at = rest["at"];
  const held = rest["wrench"] as Wrench | undefined;
  const fields: Record<string, unknown> = { t, ...rest };
  if (at !== undefined) fields["at"] = place(at);
  if (held?.at !== undefined) fields["wrench"] = { ...held, at: place(held.at) };
  return fields;
}

/** A point of a load for YAML, in which a vertex number is an integer. */
function place(at: unknown): unknown {
  return typeof at === "object" && at !== null && "vertex" in at ? { vertex: new Whole(Number(at.vertex)) } : at;
}
