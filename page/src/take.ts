// SPDX-License-Identifier: MIT
//
// Serialization of a take: in a link, in the page's file, and as files for the command line.

import type { Declarations } from "./data.ts";
import { Refused, repr, yamlValue } from "./numbers.ts";
import { base64, base64url, compressed, expanded, fromBase64, fromBase64url } from "./packing.ts";
import type { Bytes } from "./packing.ts";
import type { Parameters } from "./parameters.ts";
import { scriptText } from "./script.ts";
import type { Entry, GhostChoice, TakeFiles, Value, Values } from "./source.ts";
import type { MeshNumbers } from "./surface.ts";

/** Version of the format of takes; rigid_proto_ros/page/file.py has the same. */
export const FORM = 1;
const MOST_TEXT = 2_000_000;
const MOST_BYTES = 50_000_000;
const MOST_ENTRIES = 200_000;
/** Number of doubles in a record MOMENTS. */
const MOMENTS = 16;

/** A take. values: parameters that differ from the defaults; script: entries with their times [s]. */
export interface Take {
  readonly form: number;
  readonly version: string;
  readonly values: Values;
  readonly ghost: GhostChoice;
  readonly script: readonly Entry[];
  readonly endNs: number;
  readonly mesh: MeshNumbers | null;
}

/** A mesh in a take, with its numbers in base64. */
export interface WrittenMesh { readonly name: string; readonly vertices: string; readonly triangles: string; readonly starts?: string; readonly solid?: string; readonly volume?: number }

interface Written {
  readonly form: number;
  readonly version: string;
  readonly values: Values;
  readonly ghost?: Partial<GhostChoice>;
  readonly script: readonly Entry[];
  readonly endNs: number;
  readonly mesh?: WrittenMesh;
}

const bytesOf = (numbers: Float64Array | Int32Array): Uint8Array => new Uint8Array(numbers.buffer, numbers.byteOffset, numbers.byteLength);

/** A take as JSON. */
export function takeBytes(take: Take): Bytes {
  const { mesh, ...rest } = take;
  const numbers = mesh === null ? {} : {
    mesh: {
      name: mesh.name,
      vertices: base64(bytesOf(mesh.vertices)),
      triangles: base64(bytesOf(mesh.triangles)),
      ...(mesh.starts === null ? {} : { starts: base64(bytesOf(mesh.starts)) }),
      ...(mesh.solid === undefined ? {} : { solid: base64(bytesOf(mesh.solid)) }),
      ...(mesh.volume === undefined ? {} : { volume: mesh.volume }),
    },
  };
  return new TextEncoder().encode(JSON.stringify({ ...rest, ...numbers }));
}

/** Parse the result of takeBytes. Throws Refused for anything else. The caller must check values and entries. */
export function takeOf(bytes: Uint8Array): Take {
  let written: Written;
  try {
    written = JSON.parse(new TextDecoder().decode(bytes)) as Written;
  } catch {
    throw new Refused("the take is damaged: it is no JSON");
  }
  const { form, version, values, ghost, script, endNs, mesh } = written;
  if (form !== FORM) throw new Refused(`this take is of form ${String(form)}, made by version ${String(version)}; this page reads form ${FORM}`);
  const known = typeof values === "object" && values !== null && Array.isArray(script) && script.length <= MOST_ENTRIES;
  if (!known || !Number.isSafeInteger(endNs) || endNs < 0) throw new Refused("the take is damaged: values, script and endNs are missing");
  const own = { inertia_model: String(ghost?.inertia_model ?? values["ghost.inertia_model"] ?? ""), integrator: String(ghost?.integrator ?? values["ghost.integrator"] ?? ""), step: Number(ghost?.step ?? 0), gyroscopic: ghost?.gyroscopic !== false };
  return { form, version: String(version), values, ghost: own, script, endNs, mesh: mesh === undefined ? null : meshOf(mesh) };
}

/** Decode a mesh; throws Refused for an invalid one. */
export function meshOf(mesh: WrittenMesh): MeshNumbers {
  const f8 = (text: string): Float64Array => new Float64Array(whole(fromBase64(String(text)), 8));
  const i4 = (text: string): Int32Array => new Int32Array(whole(fromBase64(String(text)), 4));
  const { name, starts, solid, volume } = mesh, vertices = f8(mesh.vertices), triangles = i4(mesh.triangles);
  const polygons = starts === undefined ? null : i4(starts), moments: { solid?: Float64Array } = solid === undefined ? {} : { solid: f8(solid) };
  const rises = polygons?.every((start, k) => start > (polygons[k - 1] ?? -1)) ?? true;
  const fits = polygons === null || (polygons[0] === 0 && polygons.at(-1) === triangles.length / 3 && rises);
  if (vertices.length % 3 !== 0 || triangles.length % 3 !== 0 || !fits || (moments.solid?.length ?? MOMENTS) !== MOMENTS || (volume !== undefined && !(volume > 0))) {
    throw new Refused("the take is damaged: its mesh isn't one");
  }
  return { name: String(name).replace(/^.*[\\/]/, ""), vertices, triangles, starts: polygons, ...moments, ...(volume === undefined ? {} : { volume }) };
}

function whole(bytes: Bytes, size: number): ArrayBuffer {
  if (bytes.length % size !== 0) throw new Refused("the take is damaged: its mesh is cut off");
  return bytes.buffer;
}

/** The text of a link. */
export async function linkText(take: Take): Promise<string> {
  return `${FORM}.${base64url(await compressed(takeBytes(take), "deflate-raw"))}`;
}

/** The take of a link's text. Throws Refused. */
export async function takeOfLink(text: string): Promise<Take> {
  const [form, packed] = text.replace(/^#/, "").split(".");
  if (packed === undefined || text.length > MOST_TEXT) throw new Refused("this is no link of the page: it begins with its form and a point");
  if (form !== String(FORM)) throw new Refused(`this link is of form ${form ?? ""}, of another version of the page; this one reads form ${FORM}`);
  return takeOf(await expanded(fromBase64url(packed), "deflate-raw", MOST_BYTES));
}

/** The files of a take, with which `simulate` reproduces it. name: of its scene, without a suffix. */
export function takeFiles(take: Take, parameters: Parameters, name: string): TakeFiles {
  const durationS = take.endNs / 1e9;
  const { inertia_model, integrator, step } = take.ghost;
  const ghost: Record<string, Value> = { ...(inertia_model === "" ? {} : { "ghost.inertia_model": inertia_model }), ...(integrator === "" || step !== 0 ? {} : { "ghost.integrator": integrator }) };
  const own = Object.entries(take.values).filter(([key]) => !key.startsWith("ghost."));
  const lines = [...own, ...Object.entries(ghost)].map(([key, value]) => `    ${key}: ${yamlValue(typed(key, value, parameters))}\n`);
  return {
    scene: `/**:\n  ros__parameters:\n${lines.sort().join("")}`,
    script: scriptText(take.script),
    durationS,
    command: `rigid_proto simulate ${name}.yaml --script ${name}_script.yaml --duration ${repr(durationS)} --json`,
    // A file of parts names others, which the page doesn't have.
    mesh: take.mesh === null || take.mesh.volume !== undefined ? null : { name: take.mesh.name, bytes: new TextEncoder().encode(objText(take.mesh)) },
  };
}

const typed = (name: string, value: Value, parameters: Parameters): Value => parameters.converted(name, value);

/** A mesh as an .obj file, with all digits of its numbers. */
export function objText(mesh: MeshNumbers): string {
  const lines: string[] = [], { vertices, triangles, starts } = mesh;
  for (let k = 0; k < vertices.length; k += 3) lines.push(`v ${Array.from(vertices.subarray(k, k + 3), repr).join(" ")}\n`);
  const ends = starts ?? Int32Array.from({ length: triangles.length / 3 + 1 }, (_, k) => k);
  for (let p = 0; p + 1 < ends.length; p++) {
    const fan = triangles.subarray(3 * (ends[p] ?? 0), 3 * (ends[p + 1] ?? 0));
    const corners = [...fan.subarray(0, 2)];
    for (let k = 2; k < fan.length; k += 3) corners.push(fan[k] ?? 0);
    lines.push(`f ${corners.map((corner) => corner + 1).join(" ")}\n`);
  }
  return lines.join("");
}

/** A notice if another version has made the take, or "". */
export function madeBy(take: Take, declared: Declarations): string {
  if (take.version === declared.version) return "";
  return `made with version ${take.version} of this page, which is ${declared.version}: the motion may differ from what was shared`;
}
