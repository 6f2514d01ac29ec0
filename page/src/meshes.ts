// SPDX-License-Identifier: MIT
import { Refused } from "./numbers.ts";
import type { MeshNumbers } from "./surface.ts";
export function readMesh(name: string, bytes: Uint8Array): MeshNumbers { throw new Refused(`${name} ${bytes.length}`); }
