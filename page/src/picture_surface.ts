// SPDX-License-Identifier: MIT
//
// A mesh for drawing: in single precision relative to its middle, with smooth normals except at creases, and lines
// there.

import { BufferAttribute, BufferGeometry } from "three";

/** Cosine of the crease angle: faces that meet at a smaller angle are shaded smoothly. */
const CREASE_COS = Math.cos((35 * Math.PI) / 180);
/** Largest number of triangles with lines at creases; with more, lines would hide the body and take long to find. */
const MOST_EDGED = 60_000;

export interface Surface {
  readonly geometry: BufferGeometry;
  readonly edges: BufferGeometry;
  /** [mesh] origin of the geometry, since single precision loses the digits of a mesh far from its own origin */
  readonly middle: readonly [number, number, number];
  /** [mesh] corners of the bounding box */
  readonly low: readonly [number, number, number];
  readonly high: readonly [number, number, number];
}

/** The surface to draw. vertices: 3 n numbers [mesh]. triangles: 3 m vertex numbers, wound outward. */
export function shadedSurface(vertices: Float64Array, triangles: Uint32Array): Surface {
  const low = [Infinity, Infinity, Infinity] as [number, number, number], high = [-Infinity, -Infinity, -Infinity] as [number, number, number];
  // Vertices that no triangle uses are not part of the body.
  for (const v of triangles) for (let k = 0; k < 3; k++) {
    const x = vertices[3 * v + k]!;
    if (x < low[k]!) low[k] = x;
    if (x > high[k]!) high[k] = x;
  }
  const middle = [0, 1, 2].map((k) => 0.5 * (low[k]! + high[k]!)) as [number, number, number];
  const faces = triangles.length / 3, normals = new Float64Array(3 * faces), areas = new Float64Array(faces);
  const positions = new Float32Array(9 * faces), shades = new Float32Array(9 * faces);
  for (let f = 0; f < faces; f++) {
    const [a, b, c] = [3 * triangles[3 * f]!, 3 * triangles[3 * f + 1]!, 3 * triangles[3 * f + 2]!];
    const ux = vertices[b]! - vertices[a]!, uy = vertices[b + 1]! - vertices[a + 1]!, uz = vertices[b + 2]! - vertices[a + 2]!;
    const vx = vertices[c]! - vertices[a]!, vy = vertices[c + 1]! - vertices[a + 1]!, vz = vertices[c + 2]! - vertices[a + 2]!;
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx, size = Math.hypot(x, y, z) || 1;
    normals.set([x / size, y / size, z / size], 3 * f);
    areas[f] = size;
  }
  // Corners by vertex: those of vertex v are at[first[v]] .. at[first[v + 1] - 1].
  const first = new Uint32Array(vertices.length / 3 + 2), at = new Uint32Array(triangles.length);
  for (const v of triangles) first[v + 2]!++;
  for (let v = 2; v < first.length; v++) first[v]! += first[v - 1]!;
  for (let k = 0; k < triangles.length; k++) at[first[triangles[k]! + 1]!++] = k;
  for (let k = 0; k < triangles.length; k++) {
    const v = triangles[k]!, f = 3 * Math.floor(k / 3);
    const nx = normals[f]!, ny = normals[f + 1]!, nz = normals[f + 2]!;
    let x = 0, y = 0, z = 0;
    for (let j = first[v]!; j < first[v + 1]!; j++) {
      const g = Math.floor(at[j]! / 3), mx = normals[3 * g]!, my = normals[3 * g + 1]!, mz = normals[3 * g + 2]!;
      if (nx * mx + ny * my + nz * mz >= CREASE_COS) { x += areas[g]! * mx; y += areas[g]! * my; z += areas[g]! * mz; }
    }
    const size = Math.hypot(x, y, z) || 1;
    shades[3 * k] = x / size; shades[3 * k + 1] = y / size; shades[3 * k + 2] = z / size;
    for (let i = 0; i < 3; i++) positions[3 * k + i] = vertices[3 * v + i]! - middle[i]!;
  }
  const geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(positions, 3)).setAttribute("normal", new BufferAttribute(shades, 3));
  return { geometry, edges: creases(vertices, triangles, normals, middle), middle, low, high };
}

/** Lines at creases and at open edges. */
function creases(vertices: Float64Array, triangles: Uint32Array, normals: Float64Array, middle: readonly number[]): BufferGeometry {
  const lines: number[] = [], seen = new Map<number, number>(), count = vertices.length / 3;
  const add = (a: number, b: number): void => {
    for (const v of [a, b]) for (let i = 0; i < 3; i++) lines.push(vertices[3 * v + i]! - middle[i]!);
  };
  if (triangles.length / 3 <= MOST_EDGED) {
    for (let k = 0; k < triangles.length; k++) {
      const f = Math.floor(k / 3), a = triangles[k]!, b = triangles[k % 3 === 2 ? k - 2 : k + 1]!;
      const key = Math.min(a, b) * count + Math.max(a, b), other = seen.get(key);
      if (other === undefined) { seen.set(key, f); continue; }
      seen.delete(key);
      const dot = normals[3 * f]! * normals[3 * other]! + normals[3 * f + 1]! * normals[3 * other + 1]! + normals[3 * f + 2]! * normals[3 * other + 2]!;
      if (dot < CREASE_COS) add(a, b);
    }
    for (const key of seen.keys()) add(Math.floor(key / count), key % count);
  }
  return new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(lines), 3));
}
