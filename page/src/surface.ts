// SPDX-License-Identifier: MIT
//
// The surface of a body: its checks by the kernels, its moments, and its copy in the kernels' memory.

import type { Declarations } from "./data.ts";
import { Mesh, NUMBERS } from "./kernels.ts";
import type { Kernels, Matrix, Memory, Vector } from "./kernels.ts";
import { filled, Refused } from "./numbers.ts";
import type { Finding } from "./source.ts";

/** A mesh as in its file [mesh]. vertices: 3 n; triangles: 3 m; starts: first triangle of each polygon, and the number
 * of triangles (p + 1), or null if all are triangles. solid: moments computed by Python, as the record MOMENTS. */
export interface MeshNumbers {
  readonly name: string;
  readonly vertices: Float64Array;
  readonly triangles: Int32Array;
  readonly starts: Int32Array | null;
  readonly solid?: Float64Array;
  /** Of a body of parts: the sum of their volumes; its solid has their mass at a density of 1000 instead. */
  readonly volume?: number;
}

/** A checked mesh. outward: triangles 3 m, wound outward; enclosing: triangles of its solid, with fewer vertices if
 * corners at open edges are joined; record: MESH, with the moments known so far. */
export interface Surface extends MeshNumbers {
  readonly outward: Int32Array;
  readonly enclosing: Int32Array;
  readonly closed: boolean;
  readonly inward: boolean;
  readonly findings: readonly Finding[];
  readonly record: Uint8Array;
}

/** Range of a mesh's size in which its moments are finite (mass/verdict.py, SIZE_RANGE). */
const SIZES = [1e-60, 1e60] as const;

/** Largest distance of joined corners at open edges, relative to the box's diagonal (mesh/topology.py, JOINED). */
const JOINED = 1e-6;

/** Write vertices (n, 3) into memory. */
function vertexMatrix(memory: Memory, vertices: Float64Array): Matrix {
  const matrix = memory.matrix(vertices.length / 3, 3);
  memory.f8(matrix.at, vertices.length).set(vertices);
  return matrix;
}

/** Write vertex numbers, from 0, as 64-bit integers. */
function integers(memory: Memory, numbers: Int32Array): Vector {
  const vector = memory.numbers(numbers.length);
  const halves = memory.i4(vector.at, 2 * numbers.length);
  for (let k = 0; k < numbers.length; k++) {
    halves[2 * k] = numbers[k] ?? 0;
    halves[2 * k + 1] = (numbers[k] ?? 0) < 0 ? -1 : 0;
  }
  return vector;
}

function triangleMatrix(memory: Memory, triangles: Int32Array): Matrix {
  return { at: integers(memory, triangles).at, n: triangles.length / 3, m: 3 };
}

function turned(triangles: Int32Array): Int32Array {
  const found = Int32Array.from(triangles);
  for (let k = 0; k < found.length; k += 3) {
    found[k + 1] = triangles[k + 2] ?? 0;
    found[k + 2] = triangles[k + 1] ?? 0;
  }
  return found;
}

/** A bound, rounded up to two digits. */
function roundedUp(value: number): number {
  const step = value > 0 ? 10 ** (Math.floor(Math.log10(value)) - 1) : 1e-12;
  return Number((step * Math.ceil(value / step + 1e-9)).toPrecision(2));
}

/** Edges (e, 6) of triangles, components (m) and their count, and numbers of edges with an odd number of triangles, and
 * of edges whose triangles are wound inconsistently. */
interface Connected {
  readonly corners: Matrix;
  readonly edges: Matrix;
  readonly component: Vector;
  readonly count: number;
  readonly odd: number;
  readonly flipped: number;
}

/** Checks surfaces and computes their moments, in memory that it releases. */
export class Surfaces {
  readonly #kernels: Kernels;
  readonly #declared: Declarations;

  constructor(kernels: Kernels, declared: Declarations) {
    this.#kernels = kernels;
    this.#declared = declared;
  }

  /** Check a mesh. Throws Refused if it isn't a surface at all. */
  judged(mesh: MeshNumbers): Surface {
    const kernels = this.#kernels, memory = kernels.memory, mark = memory.mark();
    try {
      return this.#judged(mesh, memory);
    } finally {
      memory.release(mark);
    }
  }

  #judged(mesh: MeshNumbers, memory: Memory): Surface {
    const kernels = this.#kernels, words = this.#declared.words.surface;
    const record = new Mesh(memory);
    record.hasSurface = true;
    const extent = this.#extent(mesh, memory); // before the record is accessed, since memory may grow
    record.extent.set(extent);
    const vertices = vertexMatrix(memory, mesh.vertices), triangles = triangleMatrix(memory, mesh.triangles);
    const n = vertices.n, m = triangles.n;
    const room = memory.numbers(kernels.topologyRoom(n, m));
    const welded = memory.matrix(m, 3);
    const first = kernels.weldTriangles(vertices, triangles, room, welded) === 1 ? welded : triangles;
    const separate = this.#connected(first, n, room), near = this.#joined(vertices, first, separate, room);
    const { corners, component, count, odd, flipped } = near?.connected ?? separate;
    const whole = kernels.signedVolumes(vertices, corners, component, memory.numbers(count), memory.matrix(count, 3), memory.matrix(count, 3));
    const findings: Finding[] = [];
    const add = (code: string, severity: Finding["severity"], ...numbers: number[]): void => {
      const text = filled(words[code] ?? code, Object.fromEntries(numbers.map((x, k) => [k, String(x)])));
      const message = numbers[0] === 1 ? text.replace("edges", "edge").replace("faces", "face").replace("corners", "corner") : text;
      findings.push({ code, severity, message: severity === "error" ? `${message}; ${words["remedy"]}` : message });
    };
    if (odd > 0) add("open", "error", odd);
    if (flipped > 0) add("inconsistent_winding", "error", flipped);
    const inward = odd === 0 && flipped === 0 && whole < 0;
    const enclosing = near === null ? mesh.triangles : Int32Array.from({ length: 3 * m }, (_, k) => memory.i4(corners.at, 6 * m)[2 * k] ?? 0);
    if (odd === 0 && flipped === 0) {
      const surplus = this.#surplus(corners, n, room);
      if (surplus > 0) add("duplicate_faces", "error", surplus);
      if (inward) add("inward", "warning");
      if (mesh.solid === undefined && surplus === 0 && !this.#fill(record, { ...mesh, triangles: enclosing }, 0, memory)) add("zero_volume", "error");
    }
    if (near !== null) {
      const effect = record.known[0] === 1 ? kernels.effectOfStrips(vertices, separate.edges, near.farthest, record.moments(0)) : -1;
      const told = [near.found, Number(near.farthest.toPrecision(2))];
      if (effect >= 0) add("joined_corners", "info", ...told, roundedUp(100 * effect));
      else add("joined_corners_of_open", "info", ...told);
    }
    if (mesh.solid !== undefined) this.#take(record, mesh.solid);
    if (count > 1 || mesh.solid === undefined) findings.push({ code: "unchecked", severity: "info", message: words["unchecked"] ?? "" });
    const closed = mesh.solid !== undefined || !findings.some((each) => each.severity === "error");
    const bytes = Uint8Array.from(memory.u1(record.at, Mesh.SIZE));
    const outward = inward ? turned(mesh.triangles) : mesh.triangles;
    return { ...mesh, outward, enclosing, closed, inward, findings, record: bytes };
  }

  /** Edges and components of triangles over welded vertices. */
  #connected(corners: Matrix, vertexCount: number, room: Vector): Connected {
    const kernels = this.#kernels, memory = kernels.memory;
    const edges = memory.matrix(kernels.sortEdges(corners, vertexCount, room), 6), component = memory.numbers(corners.n);
    const count = kernels.fillEdges(corners, room, edges, component);
    const [odd, flipped] = kernels.edgeDefects(edges);
    return { corners, edges, component, count, odd, flipped };
  }

  /** The same with corners at open edges joined if they differ only by rounding; null if that closes nothing. */
  #joined(vertices: Matrix, corners: Matrix, separate: Connected, room: Vector): { connected: Connected; found: number; farthest: number } | null {
    if (separate.odd === 0) return null;
    const joined = this.#kernels.memory.matrix(corners.n, 3);
    const [found, farthest] = this.#kernels.joinOpenEdges(vertices, corners, separate.edges, JOINED, room, joined);
    if (found === 0) return null;
    const connected = this.#connected(joined, vertices.n, room);
    return connected.odd < separate.odd ? { connected, found, farthest } : null;
  }

  /** Number of duplicate faces with the same winding, if the surface is also closed without them. */
  #surplus(corners: Matrix, vertexCount: number, room: Vector): number {
    const kernels = this.#kernels, memory = kernels.memory;
    const flags = { at: memory.reserve(corners.n), n: corners.n };
    kernels.markDuplicates(corners, room, flags);
    const copies = memory.u1(flags.at, flags.n).reduce((sum, each) => sum + each, 0);
    if (copies === 0) return 0;
    const all = memory.i4(corners.at, 6 * corners.n), kept: number[] = [];
    memory.u1(flags.at, flags.n).forEach((copy, t) => {
      if (copy === 0) kept.push(all[6 * t] ?? 0, all[6 * t + 2] ?? 0, all[6 * t + 4] ?? 0);
    });
    const rest = triangleMatrix(memory, Int32Array.from(kept));
    const edges = memory.matrix(kernels.sortEdges(rest, vertexCount, room), 6);
    kernels.fillEdges(rest, room, edges, memory.numbers(rest.n));
    const [odd, flipped] = kernels.edgeDefects(edges);
    return odd === 0 && flipped === 0 ? copies : 0;
  }

  /** Sides of the bounding box [mesh]. Throws Refused without faces, or for numbers that aren't finite. */
  #extent(mesh: MeshNumbers, memory: Memory): [number, number, number] {
    const { words } = this.#declared, mark = memory.mark();
    const used = { at: memory.reserve(mesh.vertices.length / 3), n: mesh.vertices.length / 3 };
    const lower = memory.numbers(3), upper = memory.numbers(3);
    const vertices = vertexMatrix(memory, mesh.vertices), triangles = triangleMatrix(memory, mesh.triangles);
    const refused = (code: string, values: Record<string, number | string> = {}): Refused => new Refused(`${mesh.name}: ${filled(words.surface[code] ?? code, values)}`);
    let bad = 0;
    for (let k = 0; k < mesh.vertices.length; k += 3) {
      if (!Number.isFinite((mesh.vertices[k] ?? 0) * 0 + (mesh.vertices[k + 1] ?? 0) * 0 + (mesh.vertices[k + 2] ?? 0) * 0)) bad++;
    }
    if (mesh.triangles.length === 0) throw refused("no_faces");
    if (bad > 0) throw refused("nonfinite", { 0: String(bad), 1: String(mesh.vertices.length / 3) });
    if (this.#kernels.boundingBox(vertices, triangles, used, lower, upper) !== NUMBERS.moments.FOUND) throw refused("no_faces");
    const low = memory.f8(lower.at, 3), high = memory.f8(upper.at, 3);
    const extent: [number, number, number] = [0, 1, 2].map((k) => (high[k] ?? 0) - (low[k] ?? 0)) as [number, number, number];
    memory.release(mark);
    const side = Math.max(...extent);
    if (!(side >= SIZES[0] && side <= SIZES[1])) throw refused("size", { 0: side });
    return extent;
  }

  /** Add the moments of a model by its number, for a scale where it is a stretched one's, to a record of the mesh; whether it
   * has any. */
  provide(record: Mesh, surface: Surface, model: number, scale: Float64Array): boolean {
    const memory = this.#kernels.memory, mark = memory.mark();
    const found = this.#declared.models[model] === "walled"
      ? this.#fillWalls(record, surface, model, memory, scale)
      : (model !== 0 || surface.closed) && this.#fill(record, model === 0 ? { ...surface, triangles: surface.enclosing } : surface, model, memory, scale);
    memory.release(mark);
    if (found) surface.record.set(memory.u1(record.at, Mesh.SIZE));
    return found;
  }

  #fill(record: Mesh, mesh: MeshNumbers, model: number, memory: Memory, scale?: Float64Array): boolean {
    const kernels = this.#kernels, { moments } = NUMBERS;
    const n = mesh.vertices.length / 3;
    const isStretched = this.#declared.stretched.includes(model), stretch = memory.numbers(3), sizes = [0, 1, 2].map((k) => Math.abs(scale?.[k] ?? 1));
    memory.f8(stretch.at, 3).set(isStretched ? sizes.map((s) => s / (sizes[0] ?? 1)) : [1, 1, 1]);
    const used = { at: memory.reserve(n), n };
    const room = memory.numbers(Math.max(moments.ROOM, 3 * n));
    const vertices = vertexMatrix(memory, mesh.vertices), triangles = triangleMatrix(memory, mesh.triangles);
    const starts = integers(memory, mesh.starts ?? new Int32Array(0));
    const code = kernels.momentsOf(model, vertices, triangles, starts, stretch, used, room, record.moments(model));
    if (code !== moments.FOUND) return false;
    record.known[model] = 1;
    if (isStretched) record.stretch.set(memory.f8(stretch.at, 3), 3 * model);
    return true;
  }

  /** What a printed part needs beside its solid, whose moments are filled, too. Parts have walls of their own. */
  #fillWalls(record: Mesh, surface: Surface, model: number, memory: Memory, scale: Float64Array): boolean {
    if (!surface.closed || surface.volume !== undefined) return false;
    if (record.known[0] !== 1 && !this.#fill(record, { ...surface, triangles: surface.enclosing }, 0, memory)) return false;
    const kernels = this.#kernels, n = surface.vertices.length / 3, m = surface.enclosing.length / 3;
    const stretch = memory.numbers(3);
    memory.f8(stretch.at, 3).set([0, 1, 2].map((k) => Math.abs(scale[k] ?? 1) / Math.abs(scale[0] ?? 1)));
    const vertices = vertexMatrix(memory, surface.vertices), triangles = triangleMatrix(memory, surface.enclosing);
    const room = memory.numbers(kernels.topologyRoom(n, m)), welded = memory.matrix(m, 3);
    const corners = kernels.weldTriangles(vertices, triangles, room, welded) === 1 ? welded : triangles;
    const { edges } = this.#connected(corners, n, room);
    const starts = integers(memory, surface.enclosing === surface.triangles ? surface.starts ?? new Int32Array(0) : new Int32Array(0));
    const code = kernels.wallsOf(vertices, corners, starts, edges, stretch, record.moments(0), memory.numbers(3 * (n + m)), record.walls);
    if (code !== NUMBERS.moments.FOUND) return false;
    record.known[model] = 1;
    return true;
  }

  #take(record: Mesh, solid: Float64Array): void {
    record.memory.f8(record.moments(0).at, solid.length).set(solid);
    record.known[0] = 1;
  }
}

/** The present surface in the kernels' memory, at a mark; each surface replaces the previous one. */
export class Placed {
  readonly #memory: Memory;
  #mark = 0;
  readonly record: Mesh;
  vertices: Matrix = { at: 0, n: 0, m: 3 };
  triangles: Matrix = { at: 0, n: 0, m: 3 };
  surface: Surface | null = null;

  constructor(memory: Memory) {
    this.#memory = memory;
    this.record = new Mesh(memory);
  }

  /** Set the surface. All other permanent data must be in memory before the first call. */
  place(surface: Surface | null): void {
    const memory = this.#memory;
    if (this.#mark === 0) this.#mark = memory.mark();
    else if (surface === this.surface) return;
    memory.release(this.#mark);
    memory.u1(this.record.at, Mesh.SIZE).fill(0);
    this.surface = surface;
    this.vertices = vertexMatrix(memory, surface?.vertices ?? new Float64Array(0));
    this.triangles = triangleMatrix(memory, surface?.outward ?? new Int32Array(0));
    if (surface !== null) memory.u1(this.record.at, Mesh.SIZE).set(surface.record);
  }
}
