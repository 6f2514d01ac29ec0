// SPDX-License-Identifier: MIT
//
// Stanford .ply, ASCII and binary. All faces must have the same number of corners, so that each element is a table.

import { excerpt, latin, numberOf } from "./meshes.ts";
import type { Read } from "./meshes.ts";
import { Refused } from "./numbers.ts";

const KINDS: Readonly<Record<string, string>> = {
  char: "i1", int8: "i1", uchar: "u1", uint8: "u1", short: "i2", int16: "i2", ushort: "u2", uint16: "u2",
  int: "i4", int32: "i4", uint: "u4", uint32: "u4", int64: "i8", uint64: "u8", float: "f4", float32: "f4", double: "f8", float64: "f8",
};
const INDICES = ["vertex_indices", "vertex_index"];
const REMEDY = "faces that all have the same number of corners; save the mesh as .obj or .stl";
/** Separators of words, as in Python. */
const BLANKS = /[ \t\n\r\v\f\x1c-\x1f]+/;
const SPARE = 2;
const MOST_HEADER = 1_000_000;

interface Property { readonly name: string; readonly kind: string; readonly length: string }
interface Element { readonly name: string; readonly count: number; readonly properties: Property[] }
/** A sequence of numbers from an ASCII or binary body. */
interface Numbers { next(kind: string): number; readonly left: number }

export function plySurface(bytes: Uint8Array, name: string): Read {
  const { layout, elements, body } = header(bytes, name);
  const text = layout === "ascii";
  const numbers: Numbers = text ? wordsOf(latin(bytes.subarray(body)), name) : new Binary(bytes, body, layout === "binary_little_endian", name);
  const vertex = elements.find((one) => one.name === "vertex");
  if (new Set(elements.map((one) => one.name)).size < elements.length) throw new Refused(`${name}: got its header declares an element twice; accepted: each element once`);
  if (vertex === undefined || !["x", "y", "z"].every((axis) => vertex.properties.some((one) => one.name === axis && one.length === ""))) {
    throw new Refused(`${name}: got its header declares no vertices; accepted: an element vertex with properties x, y, z`);
  }
  let vertices = new Float64Array(0), corners = new Int32Array(0), size = 0, used = 0;
  for (const element of elements) {
    if (element.name === "tristrips" && element.count > 0) throw new Refused(`${name}: got it has triangle strips; accepted: ${REMEDY}`);
    const table = rows(element, numbers, name);
    if (element.name === "vertex") vertices = table.points;
    if (element.name === "face" && table.list !== null && element.count > 0) [corners, size, used] = [table.list, table.size, element.count];
  }
  if (numbers.left > (text ? 0 : SPARE)) throw new Refused(`${name}: ${numbers.left} ${text ? "numbers" : "bytes"} follow what the header announces; the file may be damaged`);
  if (size < 3) throw new Refused(`${name}: its faces have ${size} corners; a face has three or more`);
  const wrong = corners.find((corner) => corner < 0 || corner >= vertices.length / 3);
  if (wrong !== undefined) throw new Refused(`${name}: got a face uses vertex ${wrong}; accepted: vertices numbered 0 to ${vertices.length / 3 - 1}`);
  return { vertices, corners, counts: new Int32Array(used).fill(size) };
}

function header(bytes: Uint8Array, name: string): { layout: string; elements: Element[]; body: number } {
  const head = latin(bytes.subarray(0, MOST_HEADER)), end = head.indexOf("end_header"), body = head.indexOf("\n", end) + 1;
  if (!head.startsWith("ply") || end < 0 || body === 0) throw new Refused(`${name}: got ${excerpt(head)}; accepted: a .ply file: ply, a header, end_header, a body`);
  let layout = "";
  const elements: Element[] = [];
  for (const line of head.slice(0, end).split(/\r\n|[\n\r\v\f\x1c-\x1e]/).slice(1)) {
    const [key = "", ...words] = line.split(BLANKS).filter((word) => word !== ""), last = elements.at(-1);
    const kindOf = (word: string | undefined): string => KINDS[word ?? ""] ?? "";
    if (key === "" || key === "comment" || key === "obj_info") continue;
    if (key === "format" && words.length === 2) layout = words[0] ?? "";
    else if (key === "element" && words.length === 2 && /^\d{1,17}$/.test(words[1] ?? "")) elements.push({ name: words[0] ?? "", count: Number(words[1]), properties: [] });
    else if (key === "property" && last !== undefined && words.length === 4 && words[0] === "list" && kindOf(words[1]) !== "" && kindOf(words[2]) !== "") {
      last.properties.push({ name: words[3] ?? "", kind: kindOf(words[2]), length: kindOf(words[1]) });
    } else if (key === "property" && last !== undefined && words.length === 2 && kindOf(words[0]) !== "") {
      last.properties.push({ name: words[1] ?? "", kind: kindOf(words[0]), length: "" });
    } else throw new Refused(`${name}: got ${excerpt(line)}; accepted: element, property, comment or format lines in the header`);
  }
  if (!["ascii", "binary_little_endian", "binary_big_endian"].includes(layout)) throw new Refused(`${name}: got ${excerpt(layout)}; accepted: format ascii, binary_little_endian, binary_big_endian`);
  return { layout, elements, body };
}

/** Points (3 n) of a table with x, y, z; the vertex numbers of its list; and their number in each row. */
function rows(element: Element, numbers: Numbers, name: string): { points: Float64Array<ArrayBuffer>; list: Int32Array<ArrayBuffer> | null; size: number } {
  const { count, properties } = element, lengths = new Map<number, number>();
  if (count > numbers.left) throw new Refused(`${name}: it can't hold the ${count} rows of ${excerpt(element.name)} that it announces; the file may be truncated`);
  const axes = properties.map((one) => (one.length === "" ? "xyz".indexOf(one.name) : -1));
  const listed = properties.findIndex((one) => one.length !== "" && INDICES.includes(one.name));
  const points = new Float64Array(axes.includes(0) ? 3 * count : 0);
  let list: Int32Array<ArrayBuffer> | null = null, size = 0;
  for (let row = 0; row < count; row++) {
    properties.forEach((property, k) => {
      if (property.length === "") {
        const x = numbers.next(property.kind), axis = property.name.length === 1 ? (axes[k] ?? -1) : -1;
        if (axis >= 0) points[3 * row + axis] = x;
        return;
      }
      const length = numbers.next(property.length);
      if (row === 0) lengths.set(k, length);
      if (lengths.get(k) !== length) throw new Refused(`${name}: got lists of different lengths in the rows of ${excerpt(element.name)}; accepted: ${REMEDY}`);
      if (!(length >= 0 && length <= numbers.left && Number.isInteger(length))) throw new Refused(`${name}: it can't hold the ${count} rows of ${excerpt(element.name)} that it announces; the file may be truncated`);
      if (row === 0 && k === listed) {
        if (count * length > numbers.left + length) throw new Refused(`${name}: it can't hold the ${count} rows of ${excerpt(element.name)} that it announces; the file may be truncated`);
        [list, size] = [new Int32Array(count * length), length];
      }
      for (let j = 0; j < length; j++) {
        const x = numbers.next(property.kind);
        if (k === listed && list !== null) {
          if (!Number.isInteger(x) || Math.abs(x) >= 2 ** 31) throw new Refused(`${name}: got a face uses vertex ${x}; accepted: vertices' numbers`);
          list[row * length + j] = x;
        }
      }
    });
  }
  return { points, list, size };
}

function wordsOf(text: string, name: string): Numbers {
  const words = text.split(/[ \t\n\r\v\f]+/).filter((word) => word !== "");
  let at = 0;
  return {
    get left(): number {
      return words.length - at;
    },
    next(): number {
      const word = words[at++];
      if (word === undefined) throw new Refused(`${name}: its body has less numbers than the header announces; the file may be truncated`);
      const x = numberOf(word);
      if (x === null) throw new Refused(`${name}: got ${excerpt(word)}; accepted: numbers in the body of a .ply file`);
      return x;
    },
  };
}

class Binary implements Numbers {
  readonly #view: DataView;
  readonly #little: boolean;
  readonly #name: string;
  #at = 0;

  constructor(bytes: Uint8Array, body: number, little: boolean, name: string) {
    this.#view = new DataView(bytes.buffer, bytes.byteOffset + body, bytes.length - body);
    this.#little = little;
    this.#name = name;
  }

  get left(): number {
    return this.#view.byteLength - this.#at;
  }

  next(kind: string): number {
    const at = this.#at, view = this.#view, little = this.#little;
    this.#at += Number(kind[1]);
    if (this.left < 0) throw new Refused(`${this.#name}: its body is shorter than the header announces; the file may be truncated`);
    switch (kind) {
      case "i1": return view.getInt8(at);
      case "u1": return view.getUint8(at);
      case "i2": return view.getInt16(at, little);
      case "u2": return view.getUint16(at, little);
      case "i4": return view.getInt32(at, little);
      case "u4": return view.getUint32(at, little);
      case "i8": return Number(view.getBigInt64(at, little));
      case "u8": return Number(view.getBigUint64(at, little));
      case "f4": return view.getFloat32(at, little);
      default: return view.getFloat64(at, little);
    }
  }
}
