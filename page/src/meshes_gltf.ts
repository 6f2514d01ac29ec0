// SPDX-License-Identifier: MIT
//
// glTF 2.0 in one file (.glb) according to the Khronos specification: the triangles of the default scene. Strips, fans,
// normalized integers, sparse accessors, instances and Draco compression are refused by name. Kernels place the parts.

import type { Kernels, Matrix } from "./kernels.ts";
import type { Read } from "./meshes.ts";
import { Refused } from "./numbers.ts";
import { fromBase64 } from "./packing.ts";

const TRIANGLES = 4;
const QUANTIZED = "KHR_mesh_quantization";
/** Prefixes of extensions that don't affect triangles. */
const LOOKS = ["KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "KHR_xmp", "KHR_animation_"];
const WIDTHS = { SCALAR: 1, VEC3: 3 } as const;
const SIZES: Readonly<Record<number, number>> = { 5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4 };
const MOST_TRIANGLES = 20_000_000;

type Fields = Readonly<Record<string, unknown>>;
interface Part { readonly vertices: Float64Array; readonly triangles: Int32Array }

class Document {
  readonly json: Fields;
  readonly name: string;
  readonly #blob: Uint8Array;

  constructor(bytes: Uint8Array, name: string) {
    this.name = name;
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
    if (bytes.length < 12 || view.getUint32(0, true) !== 0x46546c67) throw new Refused(`${name}: it doesn't begin as a .glb file`);
    const version = view.getUint32(4, true), length = view.getUint32(8, true);
    if (version !== 2) throw new Refused(`${name}: got version ${version} of glTF; accepted: version 2`);
    if (length > bytes.length) throw new Refused(`${name}: ${bytes.length} bytes, but the header announces ${length}; the file may be truncated`);
    const chunks = new Map<number, Uint8Array>();
    for (let at = 12; at + 8 <= length; ) {
      const size = view.getUint32(at, true), kind = view.getUint32(at + 4, true);
      if (!chunks.has(kind)) chunks.set(kind, bytes.subarray(at + 8, at + 8 + size));
      at += 8 + size;
    }
    this.json = JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(chunks.get(0x4e4f534a))) as Fields;
    this.#blob = chunks.get(0x004e4942) ?? new Uint8Array(0);
  }

  list(kind: string): readonly Fields[] {
    return (this.json[kind] as readonly Fields[] | undefined) ?? [];
  }

  item(kind: string, number: unknown): Fields {
    const entries = this.list(kind), found = typeof number === "number" ? entries[number] : undefined;
    if (found === undefined) throw new Refused(`${this.name}: it refers to ${kind} ${String(number)}, but has only ${entries.length}`);
    return found;
  }

  #view(number: unknown): Uint8Array {
    const view = this.item("bufferViews", number), buffer = this.item("buffers", view["buffer"]), uri = buffer["uri"];
    let content = this.#blob;
    if (typeof uri === "string") {
      if (!uri.startsWith("data:")) throw new Refused(`${this.name}: its numbers are in another file, ${uri.slice(0, 40)}; accepted: a .glb file that holds them`);
      content = fromBase64(uri.slice(uri.indexOf(",") + 1));
    }
    const start = Number(view["byteOffset"] ?? 0), length = Number(view["byteLength"]);
    if (!(start >= 0 && length >= 0 && start + length <= content.length)) throw new Refused(`${this.name}: buffer ${String(view["buffer"])} ends before bufferView ${String(number)}; the file may be truncated`);
    return content.subarray(start, start + length);
  }

  /** The values of an accessor; kind: its type in the specification. */
  numbers(number: unknown, kind: keyof typeof WIDTHS): Float64Array {
    const accessor = this.item("accessors", number);
    for (const [key, told] of [["sparse", "is sparse"], ["normalized", "is of normalized integers"]] as const) {
      if (accessor[key]) throw new Refused(`${this.name}: got accessor ${String(number)} ${told}; accepted: a file exported without compression`);
    }
    if (accessor["type"] !== kind) throw new Refused(`${this.name}: accessor ${String(number)} is ${String(accessor["type"])}, where ${kind} belongs`);
    const type = Number(accessor["componentType"]), size = SIZES[type], width = WIDTHS[kind];
    if (size === undefined) throw new Refused(`${this.name}: accessor ${String(number)} has a type that no mesh has`);
    const content = this.#view(accessor["bufferView"]), count = Number(accessor["count"]), start = Number(accessor["byteOffset"] ?? 0);
    const stride = Number(this.item("bufferViews", accessor["bufferView"])["byteStride"] ?? 0) || size * width;
    if (!(count >= 0) || (count > 0 && !(start >= 0 && start + stride * (count - 1) + size * width <= content.length))) throw new Refused(`${this.name}: an accessor reads beyond bufferView ${String(accessor["bufferView"])}`);
    const view = new DataView(content.buffer, content.byteOffset, content.length), numbers = new Float64Array(count * width);
    for (let row = 0; row < count; row++) {
      for (let k = 0; k < width; k++) numbers[row * width + k] = component(view, type, start + row * stride + k * size);
    }
    return numbers;
  }
}

function component(view: DataView, kind: number, at: number): number {
  switch (kind) {
    case 5120: return view.getInt8(at);
    case 5121: return view.getUint8(at);
    case 5122: return view.getInt16(at, true);
    case 5123: return view.getUint16(at, true);
    case 5125: return view.getUint32(at, true);
    default: return view.getFloat32(at, true);
  }
}

export function gltfSurface(bytes: Uint8Array, name: string, kernels: Kernels): Read {
  const document = new Document(bytes, name);
  for (const extension of (document.json["extensionsRequired"] as readonly string[] | undefined) ?? []) {
    if (extension !== QUANTIZED && !LOOKS.some((look) => extension.startsWith(look))) throw new Refused(`${name}: got it requires the extension ${extension}; accepted: no other than ${QUANTIZED}`);
  }
  const parts: Part[] = [], seen = new Set<unknown>(), mark = kernels.memory.mark();
  try {
    const above = kernels.memory.matrix(4, 4);
    kernels.memory.f8(above.at, 16).set([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    for (const root of roots(document)) addNode(document, root, above, seen, parts, kernels);
  } finally {
    kernels.memory.release(mark);
  }
  return joined(parts);
}

function roots(document: Document): readonly unknown[] {
  if (document.list("scenes").length > 0) return (document.item("scenes", document.json["scene"] ?? 0)["nodes"] as readonly unknown[] | undefined) ?? [];
  const nodes = document.list("nodes"), children = new Set(nodes.flatMap((node) => (node["children"] as readonly unknown[] | undefined) ?? []));
  return nodes.map((_, number) => number).filter((number) => !children.has(number));
}

function joined(parts: readonly Part[]): Read {
  const vertices = new Float64Array(parts.reduce((sum, part) => sum + part.vertices.length, 0));
  const corners = new Int32Array(parts.reduce((sum, part) => sum + part.triangles.length, 0));
  let at = 0, from = 0;
  for (const part of parts) {
    vertices.set(part.vertices, at);
    corners.set(part.triangles.map((corner) => corner + at / 3), from);
    at += part.vertices.length;
    from += part.triangles.length;
  }
  return { vertices, corners, counts: null };
}

function nodeMatrix(node: Fields, kernels: Kernels): Matrix {
  const list = (key: string, otherwise: readonly number[]): readonly number[] => (node[key] as readonly number[] | undefined) ?? otherwise;
  const given = "matrix" in node ? list("matrix", []) : [...list("translation", [0, 0, 0]), ...list("rotation", [0, 0, 0, 1]), ...list("scale", [1, 1, 1])];
  if (given.length !== ("matrix" in node ? 16 : 10) || !given.every((x) => typeof x === "number")) throw new Error("a node is placed by other than 16 or 10 numbers");
  const numbers = kernels.memory.numbers(given.length), matrix = kernels.memory.matrix(4, 4);
  kernels.memory.f8(numbers.at, given.length).set(given);
  kernels.nodeMatrix(numbers, matrix);
  return matrix;
}

function addNode(document: Document, number: unknown, above: Matrix, seen: Set<unknown>, parts: Part[], kernels: Kernels): void {
  const name = document.name;
  if (seen.has(number)) throw new Refused(`${name}: node ${String(number)} occurs twice in the scene; its nodes must be a tree`);
  seen.add(number);
  const node = document.item("nodes", number), own = nodeMatrix(node, kernels), matrix = kernels.memory.matrix(4, 4);
  kernels.multiplyMatrices(above, own, matrix);
  if ("mesh" in node) {
    const mesh = document.item("meshes", node["mesh"]), weights = (node["weights"] ?? mesh["weights"] ?? []) as readonly number[];
    if ("skin" in node) throw new Refused(`${name}: mesh ${String(node["mesh"])} is deformed by a skin; apply it before the export`);
    if (weights.some((weight) => weight !== 0)) throw new Refused(`${name}: mesh ${String(node["mesh"])} is morphed; apply the targets before the export`);
    if ("EXT_mesh_gpu_instancing" in ((node["extensions"] as Fields | undefined) ?? {})) throw new Refused(`${name}: node ${String(number)} uses EXT_mesh_gpu_instancing; apply it before the export`);
    for (const primitive of mesh["primitives"] as readonly Fields[]) {
      const part = triangles(document, primitive);
      if (part === null) continue;
      parts.push(placed(part, matrix, kernels));
      if (parts.reduce((sum, one) => sum + one.triangles.length, 0) > 3 * MOST_TRIANGLES) throw new Refused(`${name}: got it has more than ${MOST_TRIANGLES} triangles; accepted: a smaller mesh`);
    }
  }
  for (const child of (node["children"] as readonly unknown[] | undefined) ?? []) addNode(document, child, matrix, seen, parts, kernels);
}

/** The triangles of a primitive; null for points and lines. */
function triangles(document: Document, primitive: Fields): Part | null {
  const mode = Number(primitive["mode"] ?? TRIANGLES), { name } = document;
  if (mode < TRIANGLES) return null;
  if ("KHR_draco_mesh_compression" in ((primitive["extensions"] as Fields | undefined) ?? {})) throw new Refused(`${name}: got its meshes are compressed with Draco; accepted: a file exported without compression`);
  const vertices = document.numbers((primitive["attributes"] as Fields)["POSITION"], "VEC3");
  const corners = "indices" in primitive ? Int32Array.from(document.numbers(primitive["indices"], "SCALAR")) : Int32Array.from({ length: vertices.length / 3 }, (_, k) => k);
  if (mode !== TRIANGLES) throw new Refused(`${name}: got it has triangle strips or fans; accepted: a file exported as triangles`);
  if (corners.length % 3 !== 0) throw new Refused(`${name}: ${corners.length} corners of triangles, which isn't a multiple of 3`);
  const wrong = corners.find((corner) => corner < 0 || corner >= vertices.length / 3);
  if (wrong !== undefined) throw new Refused(`${name}: a part uses vertex ${wrong}, but it has only ${vertices.length / 3}`);
  return { vertices, triangles: corners };
}

/** A part in the scene's axes; its winding is reversed if the matrix is a reflection. */
function placed(part: Part, matrix: Matrix, kernels: Kernels): Part {
  const memory = kernels.memory, mark = memory.mark(), count = part.vertices.length;
  const from = memory.matrix(count / 3, 3), to = memory.matrix(count / 3, 3);
  memory.f8(from.at, count).set(part.vertices);
  const mirrors = kernels.placeVertices(from, matrix, to);
  const vertices = memory.f8(to.at, count).slice();
  memory.release(mark);
  if (!mirrors) return { vertices, triangles: part.triangles };
  const turned = part.triangles.map((corner, k, all) => (k % 3 === 0 ? corner : (all[k % 3 === 1 ? k + 1 : k - 1] ?? 0)));
  return { vertices, triangles: turned };
}
