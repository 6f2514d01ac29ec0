// SPDX-License-Identifier: MIT
//
// The observable state of a flight and of its body: the kernels' numbers, converted to world axes.

import type { Declarations } from "./data.ts";
import { Flight, NUMBERS, Problem, Scene } from "./kernels.ts";
import type { Kernels, Matrix, Vector } from "./kernels.ts";
import type { Flown } from "./flight.ts";
import type { Refusals } from "./scene.ts";
import type { Acting, BodyInfo, Flying, Hit, Model, StringNow, Vec3 } from "./source.ts";
import type { Placed, Surface, Surfaces } from "./surface.ts";

export const triple = (numbers: ArrayLike<number>, at = 0): Vec3 => [numbers[at] ?? 0, numbers[at + 1] ?? 0, numbers[at + 2] ?? 0];

/** R v, for a matrix R row by row; and Rᵀ v. */
export function times(R: ArrayLike<number>, v: Vec3): Vec3 {
  const r = (k: number): number => R[k] ?? 0;
  return [r(0) * v[0] + r(1) * v[1] + r(2) * v[2], r(3) * v[0] + r(4) * v[1] + r(5) * v[2], r(6) * v[0] + r(7) * v[1] + r(8) * v[2]];
}
export function transposedTimes(R: ArrayLike<number>, v: Vec3): Vec3 {
  const r = (k: number): number => R[k] ?? 0;
  return [r(0) * v[0] + r(3) * v[1] + r(6) * v[2], r(1) * v[0] + r(4) * v[1] + r(7) * v[2], r(2) * v[0] + r(5) * v[1] + r(8) * v[2]];
}
const plus = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const minus = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const each = (a: Vec3, b: Vec3, f: (x: number, y: number) => number): Vec3 => [f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2])];

export class Observed {
  readonly #kernels: Kernels;
  readonly #declared: Declarations;
  readonly #placed: Placed;
  readonly #surfaces: Surfaces;
  readonly #refusals: Refusals;
  readonly #state: Vector;
  readonly #context: Vector;
  readonly #quaternion: Matrix;
  readonly #rotation: Matrix;
  readonly #other: Matrix;
  readonly #problem: Vector;
  readonly #variables: Vector;
  readonly #copy: Flight;
  readonly #scene: Scene;
  readonly #body: Vector;
  readonly #three: readonly [Vector, Vector, Vector];

  constructor(kernels: Kernels, declared: Declarations, placed: Placed, surfaces: Surfaces, refusals: Refusals) {
    const memory = kernels.memory, { quantity, body } = NUMBERS;
    this.#kernels = kernels;
    this.#declared = declared;
    this.#placed = placed;
    this.#surfaces = surfaces;
    this.#refusals = refusals;
    this.#state = memory.numbers(quantity.STATE);
    this.#context = memory.numbers(quantity.CONTEXT);
    this.#quaternion = memory.matrix(1, 4);
    this.#other = memory.matrix(1, 4);
    this.#rotation = memory.matrix(1, 9);
    this.#problem = { at: memory.reserve(Problem.SIZE), n: 1 };
    this.#copy = new Flight(memory);
    this.#variables = memory.numbers(this.#copy.variables.length);
    this.#scene = new Scene(memory);
    this.#body = memory.numbers(body.BODY);
    this.#three = [memory.numbers(3), memory.numbers(3), memory.numbers(3)];
  }

  /** Rotation matrix of a quaternion, row by row. */
  rotation(q: ArrayLike<number>): number[] {
    const memory = this.#kernels.memory;
    memory.f8(this.#quaternion.at, 4).set(Array.from(q));
    this.#kernels.rotationMatrices(this.#quaternion, this.#rotation);
    return [...memory.f8(this.#rotation.at, 9)];
  }

  angle(a: ArrayLike<number>, b: ArrayLike<number>): number {
    const memory = this.#kernels.memory;
    memory.f8(this.#quaternion.at, 4).set(Array.from(a).slice(3, 7));
    memory.f8(this.#other.at, 4).set(Array.from(b).slice(3, 7));
    return this.#kernels.attitudeAngle({ at: this.#quaternion.at, n: 4 }, { at: this.#other.at, n: 4 });
  }

  flying(flown: Flown): Flying {
    const kernels = this.#kernels, memory = kernels.memory, { quantity, body } = NUMBERS;
    const { flight, scene } = flown, row = [...flight.row], own = flight.body;
    kernels.stateOf(scene, flight, this.#state);
    const inertia: Vector = { at: this.#state.at + 8 * quantity.INERTIA, n: 9 }, rotor: Vector = { at: this.#state.at + 8 * quantity.ROTOR, n: 3 };
    const rotation = this.rotation(row.slice(3, 7));
    const place: BodyPlace = { rotation, position: triple(row), com: triple(own, body.COM), scale: triple(own, body.BODY_SCALE) };
    memory.f8(this.#context.at, this.#context.n).fill(0);
    return {
      row,
      rotation,
      omega: times(rotation, triple(row, 10)),
      momentum: kernels.angularMomentum(this.#state, inertia, rotor),
      rotor: triple(memory.f8(rotor.at, 3)),
      kinetic: kernels.quantity(quantity.KINETIC, this.#state, this.#context),
      potential: kernels.quantity(quantity.POTENTIAL, this.#state, this.#context),
      handWork: flight.workBefore + flight.work,
      stringHeat: flight.lostBefore + flight.lost,
      massKg: own[body.MASS] ?? 0,
      scale: place.scale,
      com: place.com,
      string: flight.tied ? this.#string(flown, place) : null,
      loads: Array.from({ length: flight.acting }, (_, k) => this.#acting(flown, k, place)),
      failure: flown.failure,
    };
  }

  #acting(flown: Flown, number: number, place: BodyPlace): Acting {
    const { command, load } = NUMBERS, row = flown.load(number);
    const of = row.load, share = row.share, inWorld = of[load.LOAD_AXES] === load.WORLD_AXES;
    const torque = triple(of, load.TORQUE);
    return {
      kind: row.kind === command.HELD_WRENCH ? "wrench" : "poke",
      slot: flown.slotName(row.slot),
      point: of[load.PLACE] === load.AT_COM ? place.position : toWorld(place, triple(of, load.POINT)),
      force: plus(triple(share, load.FORCE_WORLD), times(place.rotation, triple(share, load.FORCE_BODY))),
      torque: inWorld ? torque : times(place.rotation, torque),
      endNs: endOf(row.endNs),
    };
  }

  #string(flown: Flown, place: BodyPlace): StringNow {
    const { string } = NUMBERS, flight = flown.flight, row = flight.string;
    const attach = triple(row, string.KNOT), target = triple(row, string.TARGET), origin = triple(row, string.ORIGIN);
    const whole = flight.stringEndNs - flight.stringBeginNs;
    const part = whole > 0 ? Math.min(1, (flight.nowNs - flight.stringBeginNs) / whole) : 1;
    const force = this.#pull(flown);
    return {
      attach,
      knot: toWorld(place, attach),
      end: part < 1 ? each(origin, target, (a, b) => a + part * (b - a)) : target,
      target,
      force,
      tension: Math.hypot(...force),
      restLength: row[string.REST] ?? 0,
      releaseNs: endOf(flight.stringReleaseNs),
    };
  }

  /** The string's force on the body [N, world], from the acceleration that it causes. */
  #pull(flown: Flown): Vec3 {
    const kernels = this.#kernels, memory = kernels.memory, copy = this.#copy;
    memory.u1(copy.at, Flight.SIZE).set(memory.u1(flown.flight.at, Flight.SIZE));
    const [x, y, z] = kernels.accelerationsNow(copy, this.#problem, this.#variables);
    copy.tied = false;
    const [a, b, c] = kernels.accelerationsNow(copy, this.#problem, this.#variables);
    const mass = copy.body[NUMBERS.body.MASS] ?? 0;
    return [mass * (x - a), mass * (y - b), mass * (z - c)];
  }

  /** World position [m] of a point [mesh]. */
  worldPoint(flown: Flown, point: Vec3): Vec3 {
    const row = flown.flight.row, own = flown.flight.body, { body } = NUMBERS;
    return toWorld({ rotation: this.rotation([...row.subarray(3, 7)]), position: triple(row), com: triple(own, body.COM), scale: triple(own, body.BODY_SCALE) }, point);
  }

  /** The first intersection of a ray [world] with the body. */
  firstHit(flown: Flown, origin: Vec3, direction: Vec3): Hit | null {
    const memory = this.#kernels.memory, { body } = NUMBERS, { placed } = { placed: this.#placed };
    const row = flown.flight.row, own = flown.flight.body, [from, way, found] = this.#three;
    const place: BodyPlace = { rotation: this.rotation([...row.subarray(3, 7)]), position: triple(row), com: triple(own, body.COM), scale: triple(own, body.BODY_SCALE) };
    memory.f8(from.at, 3).set(toMesh(place, origin));
    memory.f8(way.at, 3).set(each(transposedTimes(place.rotation, direction), place.scale, (x, s) => x / s));
    if (!this.#kernels.rayHit(placed.vertices, placed.triangles, from, way, found)) return null;
    const mesh = triple(memory.f8(found.at, 3));
    memory.f8(from.at, 3).set(placed.record.extent);
    this.#kernels.inwardNormal(placed.vertices, placed.triangles, found, from, way);
    const inward = each(triple(memory.f8(way.at, 3)), place.scale, (x, s) => x / s);
    const length = Math.hypot(...inward) || 1;
    const world = toWorld(place, mesh);
    return {
      mesh,
      body: minus(each(mesh, place.scale, (x, s) => x * s), place.com),
      world,
      distance: Math.hypot(...minus(world, origin)),
      normal: times(place.rotation, [-inward[0] / length, -inward[1] / length, -inward[2] / length]),
    };
  }

  /** The body of a flight, with the present surface. */
  info(flown: Flown): BodyInfo {
    const { body } = NUMBERS, row = flown.flight.body, surface = this.#placed.surface;
    const values = flown.values, scale = triple(row, body.BODY_SCALE);
    let models: readonly Model[] | null = null;
    const listed = (): readonly Model[] => (models ??= this.models(flown));
    const contacts = Object.entries(values).filter(([name]) => name.startsWith("contacts."));
    return {
      name: String(values["mesh"] ?? ""),
      vertices: surface?.vertices ?? NONE.vertices,
      triangles: surface === null ? NONE.triangles : trianglesOf(surface),
      scale,
      massKg: row[body.MASS] ?? NaN,
      com: triple(row, body.COM),
      inertia: [...row.slice(body.INERTIA, body.INERTIA + 9)],
      moments: triple(row, body.MOMENTS),
      axes: [...row.slice(body.AXES, body.AXES + 9)],
      turn: [...row.slice(body.QUATERNION, body.QUATERNION + 4)],
      volume: surface?.closed === true ? (surface.volume ?? this.#placed.record.moments(0).measure) * Math.abs(scale[0] * scale[1] * scale[2]) : NaN,
      hasParts: surface?.volume !== undefined,
      length: row[body.LENGTH] ?? 1,
      findings: surface?.findings ?? [],
      contacts: Object.fromEntries(contacts.map(([name, point]) => [name.slice("contacts.".length), triple(point as readonly number[])])),
      get models(): readonly Model[] {
        return listed();
      },
    };
  }

  /** The body by each inertia model, with the same mass. */
  models(flown: Flown): Model[] {
    const memory = this.#kernels.memory;
    // Walls are measured by rays: of those that nobody asks for there are none.
    return this.#declared.models.flatMap((model, number) => {
      if (model === "walled" && flown.values["inertia_model"] !== model) return [];
      memory.u1(this.#scene.at, Scene.SIZE).set(memory.u1(flown.scene.at, Scene.SIZE));
      this.#scene.inertiaModel = number;
      this.#scene.inertiaModelCom = 0;
      return [this.#model(model, flown)];
    });
  }

  #model(model: string, flown: Flown): Model {
    const { body, refusal } = NUMBERS, placed = this.#placed, memory = this.#kernels.memory;
    let made = this.#kernels.makeBody(this.#scene, placed.record, this.#body, this.#refusals.record);
    for (let tries = 0; !made && tries < 2 && this.#refusals.code === refusal.NO_MOMENTS && placed.surface !== null; tries++) {
      if (!this.#surfaces.provide(placed.record, placed.surface, this.#refusals.record.detail, this.#scene.scale)) break;
      made = this.#kernels.makeBody(this.#scene, placed.record, this.#body, this.#refusals.record);
    }
    const none = !made ? this.#refusals.words({ ...flown.values, inertia_model: model }) : "";
    const row = made ? [...memory.f8(this.#body.at, this.#body.n)] : new Array<number>(this.#body.n).fill(NaN);
    return {
      model,
      massKg: row[body.MASS] ?? NaN,
      com: triple(row, body.COM),
      moments: triple(row, body.MOMENTS),
      inertia: row.slice(body.INERTIA, body.INERTIA + 9),
      refusal: none,
    };
  }
}

const NONE = { vertices: new Float64Array(0), triangles: new Uint32Array(0) };
const outward = new WeakMap<Surface, Uint32Array>();

/** The triangles of a surface; always the same array for the same surface. */
function trianglesOf(surface: Surface): Uint32Array {
  const known = outward.get(surface) ?? Uint32Array.from(surface.outward);
  outward.set(surface, known);
  return known;
}

/** Pose and scale of a body: rotation row by row, position [m, world], centre of mass [m] and scale. */
interface BodyPlace { readonly rotation: readonly number[]; readonly position: Vec3; readonly com: Vec3; readonly scale: Vec3 }

function toWorld(place: BodyPlace, point: Vec3): Vec3 {
  return plus(place.position, times(place.rotation, minus(each(point, place.scale, (x, s) => x * s), place.com)));
}

function toMesh(place: BodyPlace, point: Vec3): Vec3 {
  return each(plus(transposedTimes(place.rotation, minus(point, place.position)), place.com), place.scale, (x, s) => x / s);
}

/** A time of an end; Infinity for none. */
function endOf(timeNs: number): number {
  return timeNs >= NUMBERS.flight.NEVER / 4 ? Infinity : timeNs;
}
