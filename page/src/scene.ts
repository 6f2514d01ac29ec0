// SPDX-License-Identifier: MIT
//
// Conversion of parameters to the record of a scene, and of the kernels' refusals to words.

import type { Declarations } from "./data.ts";
import { NUMBERS, Refusal, Scene } from "./kernels.ts";
import type { Kernels } from "./kernels.ts";
import { filled, Refused, shown } from "./numbers.ts";
import type { Value, Values } from "./source.ts";

const BALLAST = "ballast.";

/** The name of a record's field in kernels.ts. */
const camel = (field: string): string => field.replace(/_+(.)/g, (_, letter: string) => letter.toUpperCase());

/** Fill a scene's record from all its parameters. Throws Refused for more ballast than it has space for. */
export function fillScene(scene: Scene, values: Values, declared: Declarations): void {
  scene.memory.u1(scene.at, Scene.SIZE).fill(0);
  const fields = scene as unknown as Record<string, number | Float64Array>;
  for (const [name, field] of Object.entries(declared.fields)) {
    const value = values[name], own = camel(field);
    if (value === undefined) continue;
    const numbers = fields[own];
    if (numbers instanceof Float64Array) numbers.set(spread(value, numbers.length));
    else fields[own] = numberOf(name, value, declared);
  }
  const points = Object.keys(values).filter((name) => name.startsWith(BALLAST)).sort().map((name) => values[name]);
  const heavy = points.filter((point): point is readonly number[] => Array.isArray(point) && point[0] !== 0);
  const most = NUMBERS.scene.MAX_BALLASTS;
  if (heavy.length > most) {
    throw new Refused(filled(declared.words.accepted, { 0: "ballast", 1: shown(`${heavy.length} point masses`), 2: `at most ${most} with a mass` }));
  }
  scene.ballasts = heavy.length;
  scene.ballast.set(heavy.flat());
}

/** Numbers for each axis, from one for all or one for each. */
function spread(value: Value, length: number): readonly number[] {
  const numbers = Array.isArray(value) ? (value as readonly number[]) : [Number(value)];
  return numbers.length === 1 ? new Array<number>(length).fill(numbers[0] ?? 0) : numbers;
}

/** A value as a number: a choice is its index, and true is 1. */
function numberOf(name: string, value: Value, declared: Declarations): number {
  if (typeof value === "string") return declared.parameters.find((one) => one.name === name)?.choices.indexOf(value) ?? 0;
  return Number(value);
}

/** The kernels' refusals as texts. */
export class Refusals {
  readonly record: Refusal;
  readonly #kernels: Kernels;
  readonly #declared: Declarations;

  constructor(kernels: Kernels, declared: Declarations) {
    this.#kernels = kernels;
    this.#declared = declared;
    this.record = new Refusal(kernels.memory);
  }

  get code(): number {
    return this.record.code;
  }

  /** The refusal as a line of text. values: of the refused scene; frame: of the load; vertices: number of vertices. */
  words(values: Values, frame = "", vertices = 0): string {
    const { words, models } = this.#declared, { refusal } = NUMBERS;
    const { code, detail } = this.record;
    const [a = 0, b = 0, c = 0] = this.record.numbers;
    switch (code) {
      case refusal.NO_MOMENTS:
        return `${String(values["mesh"])}: ${models[detail] ?? ""}: ${words.surface["remedy"] ?? ""}`;
      case refusal.SCALE:
        return filled(words.scale, { 0: shown(values["scale"]) });
      case refusal.MASS:
        return filled(words.mass, { 0: a });
      case refusal.WALLS:
        return filled(words.walls, { 0: a, 1: b, 2: c });
      case refusal.ORIENTATION:
        return filled(words.orientation, { 0: shown(values["initial.orientation_xyzw"]) });
      case refusal.TENSOR:
        return this.#tensor(values);
      case refusal.INTEGRATOR:
        return this.#integrator(detail, a);
      case refusal.RATE:
        return filled(words.rate[detail] ?? "", { 0: a, 1: b, 2: c });
      case refusal.MAGNITUDE:
        return filled(words.magnitude[detail] ?? "", { 0: a, 1: b, 2: c });
      case refusal.PULL:
        return filled(words.pull, { 0: a, 1: b, 2: c });
      case refusal.AT_FREE_END:
        return filled(words.freeEnd, { 0: a, 1: b, 2: c });
      case refusal.UNRESOLVED:
        return filled(words.unresolved[String(detail)] ?? "", { 0: frame, 1: String(vertices - 1) });
      default:
        return filled(words.accepted, { 0: "scene", 1: shown(a), 2: `a number within its bounds (${code}, ${detail})` });
    }
  }

  #integrator(number: number, bits: number): string {
    const { words, integrators } = this.#declared;
    const needs = words.needs.map((_, k) => k).filter((k) => Math.floor(bits / 2 ** k) % 2 === 1);
    const able = integrators.filter((one) => needs.every((need) => one.supports.includes(need)));
    const wanted = needs.map((k) => words.needs[k] ?? "").sort();
    return filled(words.integrator, { 0: shown(integrators[number]?.name), 1: wanted.join(" and "), 2: able.map((one) => one.name).join(", ") });
  }

  #tensor(values: Values): string {
    const { tensor } = this.#declared.words, model = String(values["inertia_model"]), given = this.record.given === 1;
    const numbers = [...this.record.tensor], memory = this.#kernels.memory, mark = memory.mark();
    const inertia = memory.matrix(3, 3), moments = memory.numbers(3);
    memory.f8(inertia.at, 9).set(numbers);
    this.#kernels.judgedTensor(inertia, moments);
    const [a = 0, b = 0, c = 0] = memory.f8(moments.at, 3);
    memory.release(mark);
    const matrix = shown([numbers.slice(0, 3), numbers.slice(3, 6), numbers.slice(6, 9)]);
    const source = model === "explicit" ? `${tensor["explicit"] ?? ""}${given ? "" : (tensor["ballast"] ?? "")}` : `inertia_model ${model}`;
    return filled(tensor[String(this.record.detail)] ?? "", { source, matrix, 0: a, 1: b, 2: c, 3: a + b });
  }
}
