// SPDX-License-Identifier: MIT
//
// For a page that holds kernels and data as build.mjs puts them: takes(count, seed) makes random takes there.

import { inside } from "../src/file.ts";
import { randomTakes } from "./random_takes.ts";

const takes = async (count: number, seed: number): Promise<unknown[]> => {
  const [kernels, data] = await Promise.all([inside("kernels"), inside("data")]);
  if (kernels === null || data === null) throw new Error("no kernels, or no data");
  return randomTakes(kernels, data, count, seed);
};
Object.assign(globalThis, { takes });
