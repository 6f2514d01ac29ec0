// SPDX-License-Identifier: MIT
//
// A language in which every word of the catalogue is marked: what shows without marks isn't in the catalogue.

import type { Words } from "../src/words.ts";

export const OPEN = "⟦", CLOSE = "⟧";

/** Pairs of a value and its words: the value stays. */
const isPair = (value: readonly unknown[]): boolean => value.length === 2 && value.every((one) => !Array.isArray(one));

function mark(value: unknown, name: string): unknown {
  if (typeof value === "string") return value === "" ? "" : `${OPEN}${value}${CLOSE}`;
  if (typeof value === "function") return (...given: unknown[]) => mark((value as (...given: unknown[]) => unknown)(...given), name);
  if (Array.isArray(value)) {
    if ((name === "units" || name === "places") && value.every((one) => Array.isArray(one) && isPair(one)))
      return value.map(([one, two]: [unknown, unknown]) => (name === "units" ? [one, mark(two, "")] : [mark(one, ""), two]));
    return value.map((one) => mark(one, ""));
  }
  if (typeof value === "object" && value !== null) return Object.fromEntries(Object.entries(value).map(([key, one]) => [key, mark(one, key)]));
  return value;
}

export function marked(words: Words): Words { return mark(words, "") as Words; }
