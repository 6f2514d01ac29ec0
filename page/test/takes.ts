// SPDX-License-Identifier: MIT
//
// node takes.ts KERNELS.wasm DATA COUNT SEED [FAULT]: random takes as JSON, see random_takes.ts.

import { readFileSync } from "node:fs";
import { randomTakes } from "./random_takes.ts";

const [kernels = "", data = "", count = "20", seed = "1", fault = ""] = process.argv.slice(2);
const takes = await randomTakes(readFileSync(kernels), new Uint8Array(readFileSync(data)), Number(count), Number(seed), fault);
process.stdout.write(JSON.stringify(takes));
