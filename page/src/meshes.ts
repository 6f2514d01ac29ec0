// SPDX-License-Identifier: MIT
//
// Reading of mesh files, exactly as in rigid_proto_ros/mesh: vertices in the file's order, polygons fanned from their
// first corner. Throws Refused for an invalid file, with a line that names the place.

import { gltfSurface } from "./meshes_gltf.ts";
import { plySurface } from "./meshes_ply.ts";
import type { Kernels } from "./kernels.ts";
import { Refused } from "./numbers.ts";
import type { MeshNumbers } from "./surface.ts";

export const MOST_BYTES = 50_000_000;
export const ENDINGS = [".obj", ".stl", ".ply", ".glb"];

/** Vertices (3 n), corners of all polygons (c,), and number of corners of each (p,); without counts
 * all are triangles. */
export interface Read { readonly vertices: Float64Array; readonly corners: Int32Array; readonly counts: Int32Array | null }

const NUMBER = /^[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?$/;
const EDGES = /^[ \t\v\f]+|[ \t\v\f]+$/g;
const NAMED = /^[+-]?(?:nan|inf(?:inity)?)$/i;

/** The number that a word represents, or null. Numbers that aren't finite are refused when the surface is checked. */
export function numberOf(word: string): number | null {
  if (NUMBER.test(word)) return Number(word);
  return NAMED.test(word) ? NaN : null;
}

/** Each byte as one character; bytes beyond ASCII as arbitrary ones. */
export const latin = (bytes: Uint8Array): string => new TextDecoder("latin1").decode(bytes);

/** An excerpt of a file for an error message. */
export const excerpt = (text: string): string => text.slice(0, 40).split("\n")[0]?.trim().replace(/[^\x20-\x7e]/g, "?") ?? "";

/** The mesh in a file's bytes; the suffix determines the format. The mesh's name ends in .obj, the format of saving. */
export function readMesh(file: string, bytes: Uint8Array, kernels: Kernels): MeshNumbers {
  const name = file.replace(/^.*[\\/]/, ""), ending = /\.[^.]*$/.exec(name)?.[0].toLowerCase() ?? "";
  if (/^\.?ya?ml$/.test(ending)) throw new Refused(`${name}: scenes, scripts and bodies of parts name other files, which a page can't open: rigid_proto workbench FILE --html OUT (and --script SCRIPT) writes a page that has them`);
  if (!ENDINGS.includes(ending)) throw new Refused(`${name}: no file that this page reads; accepted: a mesh named ${ENDINGS.join(", ")}`);
  if (bytes.length > MOST_BYTES) throw new Refused(`${name}: ${(bytes.length / 1e6).toFixed(1)} MB; at most ${MOST_BYTES / 1e6} MB are read here, and more by rigid_proto workbench FILE --html`);
  if (bytes.every((byte) => byte <= 32)) throw new Refused(`${name}: the file is empty`);
  try {
    const { vertices, corners, counts } = read(ending, name, bytes, kernels);
    const { triangles, starts } = fanned(corners, counts);
    if (triangles.length === 0) throw new Refused(`${name}: the file has no faces`);
    return { name: `${name.slice(0, -ending.length)}.obj`, vertices, triangles, starts };
  } catch (error) {
    if (error instanceof Refused) throw error;
    throw new Refused(`${name}: the ${ending} file can't be read (${error instanceof Error ? error.message : String(error)})`);
  }
}

function read(ending: string, name: string, bytes: Uint8Array, kernels: Kernels): Read {
  if (ending === ".obj") return objSurface(bytes, name);
  if (ending === ".stl") return stlSurface(bytes, name);
  return ending === ".ply" ? plySurface(bytes, name) : gltfSurface(bytes, name, kernels);
}

/** Triangles (3 m) fanned from each polygon's first corner, and the polygons' starts among them (p + 1,). */
function fanned(corners: Int32Array, counts: Int32Array | null): { triangles: Int32Array; starts: Int32Array | null } {
  if (counts === null || counts.every((count) => count === 3)) return { triangles: corners, starts: null };
  const triangles = new Int32Array(3 * (corners.length - 2 * counts.length)), starts = new Int32Array(counts.length + 1);
  let from = 0, to = 0;
  counts.forEach((count, polygon) => {
    for (let k = 1; k + 1 < count; k++) {
      triangles[to++] = corners[from] ?? 0;
      triangles[to++] = corners[from + k] ?? 0;
      triangles[to++] = corners[from + k + 1] ?? 0;
    }
    from += count;
    starts[polygon + 1] = to / 3;
  });
  return { triangles, starts };
}

// Wavefront .obj

/** A growing array of numbers. */
class Grown<A extends Float64Array | Int32Array> {
  #numbers: A;
  length = 0;
  readonly #more: (n: number) => A;

  constructor(more: (n: number) => A) {
    this.#more = more;
    this.#numbers = more(1024);
  }

  push(x: number): void {
    if (this.length === this.#numbers.length) {
      const larger = this.#more(2 * this.length);
      larger.set(this.#numbers);
      this.#numbers = larger;
    }
    this.#numbers[this.length++] = x;
  }

  all(): A {
    return this.#numbers.slice(0, this.length) as A;
  }
}

function objSurface(bytes: Uint8Array, name: string): Read {
  if (bytes.subarray(0, 4096).includes(0)) throw new Refused(`${name}: the content is binary; an .obj file is text`);
  const vertices = new Grown((n) => new Float64Array(n)), corners = new Grown((n) => new Int32Array(n)), counts = new Grown((n) => new Int32Array(n));
  const wrong = (line: number, text: string, accepted: string): Refused => new Refused(`${name} line ${line}: got ${excerpt(text)}; accepted: ${accepted}`);
  let number = 0, most = 0, mostAt = 0;
  for (const { text, lines } of logicalLines(latin(bytes).replace(/^\xef\xbb\xbf/, ""))) {
    const first = number + 1;
    number += lines;
    const words = text.replace(EDGES, "").split(/[ \t\v\f]+/);
    if (words[0] === "v") {
      for (let k = 1; k <= 3; k++) {
        const x = numberOf(words[k] ?? "");
        if (x === null) throw wrong(first, text, "v with three coordinates");
        vertices.push(x);
      }
    } else if (words[0] === "f") {
      if (words.length < 4) throw wrong(first, text, "f with three or more corners");
      for (let k = 1; k < words.length; k++) {
        const word = (words[k] ?? "").split("/", 1)[0] ?? "", x = /^[+-]?\d+$/.test(word) ? Number(word) : 0;
        const corner = x < 0 ? vertices.length / 3 + x : x - 1;
        if (x === 0 || corner < 0 || corner > 2 ** 31 - 2) throw wrong(first, text, "f with nonzero integer vertex numbers, negative ones counted back from the last vertex");
        if (corner > most) [most, mostAt] = [corner, counts.length + 1];
        corners.push(corner);
      }
      counts.push(words.length - 1);
    }
  }
  if (counts.length > 0 && most >= vertices.length / 3) throw new Refused(`${name}: face ${mostAt} uses vertex ${most + 1}, but the file has only ${vertices.length / 3}`);
  return { vertices: vertices.all(), corners: corners.all(), counts: counts.all() };
}

/** Lines without comments; a line that ends with a backslash is joined with the next one. lines: number of joined
 * lines. */
function* logicalLines(text: string): Generator<{ text: string; lines: number }> {
  const end = text.includes("\r") ? /\r\n|\r|\n/g : /\n/g;
  let begun = "", lines = 0, at = 0;
  while (at <= text.length) {
    end.lastIndex = at;
    const found = end.exec(text), stop = found?.index ?? text.length;
    let line = text.slice(at, stop);
    at = found === null ? text.length + 1 : end.lastIndex;
    const comment = line.indexOf("#");
    if (comment >= 0) line = line.slice(0, comment);
    lines++;
    if (line.endsWith("\\") && found !== null) {
      begun += `${line.slice(0, -1)} `;
      continue;
    }
    yield { text: begun + line, lines };
    begun = "";
    lines = 0;
  }
}

// STL

const FACET_BYTES = 50;
const SPARE = 2;
/** A pattern in which \s and \S are ASCII only, as in Python's patterns of bytes. */
const ascii = (pattern: string, flags = ""): RegExp => new RegExp(pattern.replaceAll("\\s", "[ \\t\\n\\r\\f\\v]").replaceAll("\\S", "[^ \\t\\n\\r\\f\\v]"), flags);
const CORNER = String.raw`\s+vertex\s+(\S+)\s+(\S+)\s+(\S+)`;
const FACET = ascii(String.raw`\bfacet\s+normal(?:\s+\S+){3}\s+outer\s+loop${CORNER}${CORNER}${CORNER}\s+endloop\s+endfacet(?!\S)`, "g");
const PART = ascii(String.raw`\bfacet\s+normal|\bouter\s+loop|\bvertex(?:\s+[-+.\d]\S*){3}|\bendloop`);
const WORDS = ascii(String.raw`\S{1,80}`, "g");
const BEGINS = ascii(String.raw`^\s*solid`);

function stlSurface(bytes: Uint8Array, name: string): Read {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  if (isAscii(bytes, view)) return merged(asciiPoints(latin(bytes).replace(/^\xef\xbb\xbf/, "").toLowerCase(), name));
  if (bytes.length < 84) throw new Refused(`${name}: got ${bytes.length} bytes, no STL file; accepted: ASCII, or a binary header of 84 bytes and facets`);
  const held = Math.floor((bytes.length - 84) / FACET_BYTES), beyond = (bytes.length - 84) % FACET_BYTES;
  const announced = view.getUint32(80, true), count = announced === 0 && beyond <= SPARE ? held : announced;
  if (count > held) throw new Refused(`${name}: the header announces ${count} facets, but it holds ${held}; the file may be truncated`);
  const extra = bytes.length - 84 - FACET_BYTES * count;
  if (extra > SPARE) throw new Refused(`${name}: ${extra} bytes follow the ${count} facets that the header announces`);
  const points = new Float64Array(9 * count);
  for (let facet = 0; facet < count; facet++) {
    for (let k = 0; k < 9; k++) points[9 * facet + k] = view.getFloat32(84 + FACET_BYTES * facet + 12 + 4 * k, true);
  }
  return merged(points);
}

/** Whether a file is ASCII; binary files, too, may start with the word solid. */
function isAscii(bytes: Uint8Array, view: DataView): boolean {
  if (bytes.length >= 84 && bytes.length === 84 + FACET_BYTES * view.getUint32(80, true)) return false;
  const words = latin(bytes.subarray(0, 10_000)).match(WORDS) ?? [];
  const head = words.slice(0, 100).join(" ").replace(/^\xef\xbb\xbf/, "").replace(/^ +/, "").toLowerCase();
  return head.startsWith("solid") && (head.includes("facet") || head.includes("endsolid")) && !head.includes("\0");
}

/** Corner points (9 numbers per facet); a file may have only facets and names of solids. */
function asciiPoints(text: string, name: string): Float64Array {
  const points = new Grown((n) => new Float64Array(n)), rest: string[] = [];
  let end = 0;
  for (const match of text.matchAll(FACET)) {
    rest.push(text.slice(end, match.index));
    end = match.index + match[0].length;
    for (let k = 1; k <= 9; k++) {
      const x = numberOf(match[k] ?? "");
      if (x === null) {
        const line = text.slice(0, match.index).split("\n").length;
        throw new Refused(`${name} line ${line}: got ${excerpt(match[k] ?? "")}; accepted: vertex with three numbers`);
      }
      points.push(x);
    }
  }
  rest.push(text.slice(end));
  const others = rest.join(" ");
  if (!BEGINS.test(others) || PART.test(others)) {
    throw new Refused(`${name}: ${text.split("vertex").length - 1} vertices in ${points.length / 9} whole facets, which is not three a facet; the file may be truncated`);
  }
  return points.all();
}

/** Merge bit-equal corners into one vertex; vertices are numbered in order of first appearance. */
export function merged(points: Float64Array): Read {
  const count = points.length / 3, words = new Uint32Array(points.buffer, points.byteOffset, 2 * points.length);
  let size = 16;
  while (size < 2 * count) size *= 2;
  const table = new Int32Array(size).fill(-1), corners = new Int32Array(count), kept = new Float64Array(points.length);
  let vertices = 0;
  const kind = new Uint32Array(kept.buffer);
  for (let i = 0; i < count; i++) {
    let hash = 0x811c9dc5;
    for (let k = 6 * i; k < 6 * i + 6; k++) hash = Math.imul((hash ^ (words[k] ?? 0)) + (hash >>> 15), 0x9e3779b1);
    let slot = (hash ^ (hash >>> 16)) & (size - 1);
    for (;;) {
      const j = table[slot] ?? -1;
      if (j < 0) {
        table[slot] = vertices;
        kept.set(points.subarray(3 * i, 3 * i + 3), 3 * vertices);
        corners[i] = vertices++;
        break;
      }
      let same = true;
      for (let k = 0; k < 6 && same; k++) same = kind[6 * j + k] === words[6 * i + k];
      if (same) {
        corners[i] = j;
        break;
      }
      slot = (slot + 1) & (size - 1);
    }
  }
  return { vertices: kept.slice(0, 3 * vertices), corners, counts: null };
}
