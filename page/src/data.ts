// SPDX-License-Identifier: MIT
//
// Python's declarations as embedded in the page (rigid_proto_ros/page/data.py): parameters, words, bodies, scenes.

import type { LessonTexts } from "./lessons.ts";
import type { Parameter, Value } from "./source.ts";

/** Texts with placeholders (numbers.ts, `filled`), by their subject. */
export interface Words {
  readonly accepted: string;
  readonly scale: string;
  readonly mass: string;
  readonly walls: string;
  readonly parts: string;
  readonly orientation: string;
  readonly rate: readonly string[];
  readonly magnitude: readonly string[];
  readonly pull: string;
  readonly freeEnd: string;
  readonly integrator: string;
  readonly needs: readonly string[];
  readonly unresolved: Readonly<Record<string, string>>;
  readonly tensor: Readonly<Record<string, string>>;
  readonly failure: readonly [string, string];
  readonly surface: Readonly<Record<string, string>>;
  readonly atStart: string;
}

/** What an engine takes, and how (rigid_proto_ros/mass/engines.py, Form). saysNone: products [%] that needn't be said. */
export interface Form {
  readonly engine: string;
  readonly text: string;
  readonly products: string;
  readonly mirrored: string;
  readonly perM: number;
  readonly saysNone: number;
}

interface Packed { readonly at: number; readonly vertices: number; readonly triangles: number; readonly digits: number }

export interface Declarations {
  readonly version: string;
  readonly parameters: readonly Parameter[];
  /** field of the record SCENE, by the parameter's name */
  readonly fields: Readonly<Record<string, string>>;
  readonly models: readonly string[];
  /** numbers of the models whose moments hold for one ratio of the scale's components */
  readonly stretched: readonly number[];
  /** order: null if the integrator is adaptive or exact */
  readonly integrators: readonly { readonly name: string; readonly supports: readonly number[]; readonly order: number | null }[];
  /** doubles of an integrator's workspace */
  readonly room: number;
  readonly words: Words;
  readonly bodies: Readonly<Record<string, Packed>>;
  readonly scenes: Readonly<Record<string, { readonly title: string; readonly values: Readonly<Record<string, Value>> }>>;
  readonly lessons: Readonly<Record<string, LessonTexts>>;
  readonly forms: Readonly<Record<string, Form>>;
  readonly start: string;
  /** longest side of a mesh file [mesh units] above which its unit is assumed to be a millimetre */
  readonly longest: number;
}

/** The declarations, and the bundled meshes, which are decoded on request. */
export class Data {
  readonly declared: Declarations;
  readonly #numbers: Uint8Array;

  constructor(bytes: Uint8Array) {
    const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(0, true);
    this.declared = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length))) as Declarations;
    this.#numbers = bytes.subarray(4 + length);
  }

  /** Vertices (3 n) and triangles (3 m) of a bundled body, as in its file. */
  mesh(name: string): { vertices: Float64Array; triangles: Int32Array } | null {
    const packed = this.declared.bodies[name];
    if (packed === undefined) return null;
    const { at, vertices: n, triangles: m, digits } = packed;
    const whole = this.#rows(at, n), triangles = this.#rows(at + 12 * n, m);
    const unit = 10 ** digits;
    return { vertices: Float64Array.from(whole, (x) => x / unit), triangles };
  }

  /** Rows of three integers, decoded from the byte planes that data.py writes. */
  #rows(at: number, count: number): Int32Array {
    const all = 3 * count, rows = new Int32Array(all), bytes = this.#numbers;
    for (let column = 0; column < 3; column++) {
      let value = 0;
      for (let i = 0; i < count; i++) {
        const k = at + column * count + i;
        const folded = (bytes[k] ?? 0) + (bytes[k + all] ?? 0) * 256 + (bytes[k + 2 * all] ?? 0) * 65536 + (bytes[k + 3 * all] ?? 0) * 16777216;
        value += folded % 2 === 0 ? folded / 2 : -(folded + 1) / 2;
        rows[3 * i + column] = value;
      }
    }
    return rows;
  }
}
