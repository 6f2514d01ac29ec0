// SPDX-License-Identifier: MIT
//
// node meshes.ts KERNELS.wasm DATA FOLDER: what the page reads of each file in a folder, and of each bundled body, as JSON
// by name: hashes of vertices, triangles and polygons' starts, and moments of the four models; or why it is refused.

import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { Data } from "../src/data.ts";
import { Kernels, Mesh } from "../src/kernels.ts";
import { readMesh } from "../src/meshes.ts";
import { Refused } from "../src/numbers.ts";
import { sha256 } from "../src/sha256.ts";
import { Surfaces } from "../src/surface.ts";
import type { MeshNumbers } from "../src/surface.ts";

const [kernelsFile = "", dataFile = "", folder = ""] = process.argv.slice(2);
const kernels = await Kernels.load(readFileSync(kernelsFile)), data = new Data(new Uint8Array(readFileSync(dataFile)));
const surfaces = new Surfaces(kernels, data.declared), { memory } = kernels;

const hash = (numbers: Float64Array | Int32Array | null): string =>
  numbers === null ? "" : sha256(new Uint8Array(numbers.buffer, numbers.byteOffset, numbers.byteLength));

function told(make: () => MeshNumbers): unknown {
  const mark = memory.mark(), began = performance.now();
  try {
    const mesh = make(), read = performance.now() - began;
    const numbers = { vertices: hash(mesh.vertices), triangles: hash(mesh.triangles), starts: hash(mesh.starts) };
    try {
      const surface = surfaces.judged(mesh), record = new Mesh(memory);
      memory.u1(record.at, Mesh.SIZE).set(surface.record);
      const scale = Float64Array.of(1, 1, 1), of = data.declared.models.slice(0, -1);
      const moments = of.map((_, model) => (surfaces.provide(record, surface, model, scale) ? [...memory.f8(record.moments(model).at, 16)] : null));
      return { ...numbers, closed: surface.closed, inward: surface.inward, codes: surface.findings.map((each) => each.code), messages: surface.findings.map((each) => each.message), moments, read, judged: performance.now() - began - read };
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      return { ...numbers, unusable: error.message };
    }
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    return { refused: error.message };
  } finally {
    memory.release(mark);
  }
}

const found: Record<string, unknown> = {};
for (const name of Object.keys(data.declared.bodies)) found[name] = told(() => ({ name, starts: null, ...data.mesh(name)! }));
for (const name of readdirSync(folder).sort()) found[name] = told(() => readMesh(name, new Uint8Array(readFileSync(join(folder, name))), kernels));
process.stdout.write(JSON.stringify(found));
