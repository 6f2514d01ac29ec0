// SPDX-License-Identifier: MIT
//
// Numbers as people read and type them.

import assert from "node:assert/strict";
import { read, short } from "../src/words_numbers.ts";

for (const [text, value] of [
  ["1.5", 1.5], ["1,5", 1.5], [" 0,05 ", 0.05], ["-2", -2], ["−2", -2], ["1e-3", 1e-3], ["1,5e3", 1500], ["1,234.5", 1234.5], [".5", 0.5], ["5.", 5],
  ["7.08·10⁻⁵", 7.08e-5], ["1 000", 1000], ["+3", 3],
] as const) assert.equal(read(text), value, text);
for (const text of ["", "wide", "1.2.3", "1,2,3", "0x10", "Infinity", "NaN", "1e", "--1"]) assert.ok(Number.isNaN(read(text)), text);

for (const [value, text] of [
  [0, "0"], [1, "1"], [0.05, "0.05"], [1.604, "1.6"], [12345, "12345"], [-0.25, "−0.25"], [7.08e-5, "7.08·10⁻⁵"], [2.5e6, "2.50·10⁶"], [NaN, "–"], [99.96, "100"],
] as const) assert.equal(short(value), text);

// What is shown, typed again, is the same number to the three figures shown.
for (let k = 0; k < 2000; k++) {
  const value = (Math.random() - 0.5) * 10 ** (24 * Math.random() - 12), again = read(short(value));
  assert.ok(Math.abs(again - value) <= 0.0051 * Math.abs(value), `${value} ${short(value)} ${again}`);
}
console.log("numbers are read as they are written");
