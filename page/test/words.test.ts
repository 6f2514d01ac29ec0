// SPDX-License-Identifier: MIT
//
// node --test: the catalogue of words, in a language in which each is marked.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { addressOf, hashOf } from "../src/address.ts";
import { Data } from "../src/data.ts";
import { LESSON_PLANS } from "../src/lessons_steps.ts";
import { english } from "../src/words.ts";
import { CLOSE, marked, OPEN } from "./marked.ts";

const data = new Data(new Uint8Array(readFileSync(process.env["DATA"] ?? "")));

test("every word is marked, whatever it is made of, and the shape stays", () => {
  const language = marked(english), isMarked = (text: string): boolean => text.startsWith(OPEN) && text.endsWith(CLOSE);
  const shape = (value: unknown): unknown => (typeof value === "object" && value !== null ? Object.fromEntries(Object.entries(value).map(([key, one]) => [key, shape(one)])) : typeof value);
  assert.deepEqual(shape(language), shape(english));
  assert.ok(isMarked(language.title) && isMarked(language.lesson.poke("x")) && isMarked(language.time.rates[0]!) && isMarked(language.ghost.kinds["bounding_box"]!));
  assert.equal(language.body.units[1][0], "1");
  assert.ok(isMarked(language.body.units[1][1]) && language.world.places[3][1] === 9.81);
});

test("what lessons mark and say has words in the catalogue", () => {
  assert.deepEqual(Object.keys(data.declared.bodies).filter((name) => !(name in english.bodies)), []);
  for (const [name, { marks, steps }] of Object.entries(LESSON_PLANS)) {
    for (const mark of marks ?? []) assert.ok(mark in english.lesson.places, `${name}: ${mark}`);
    for (const { acts } of steps) for (const act of acts) assert.ok(act.text(english.lesson).length > 2, name);
  }
});

test("an address names a lesson, a class, a language, or a take", () => {
  assert.deepEqual(addressOf("#lesson=t_handle&class&lang=xx"), { lesson: "t_handle", isClass: true, language: "xx", take: "" });
  assert.deepEqual(addressOf("#1.abc_-"), { lesson: "", isClass: false, language: "", take: "1.abc_-" });
  assert.deepEqual(addressOf(""), { lesson: "", isClass: false, language: "", take: "" });
  for (const address of ["#lesson=book", "#lesson=book&class&lang=de", "#1.ab&lang=de", "#lang=de"]) assert.equal(hashOf(addressOf(address)), address);
});
