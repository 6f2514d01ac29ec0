// SPDX-License-Identifier: MIT
//
// node --test, with KERNELS and DATA in the environment: each lesson played right ticks every step, and wrong hands tick none.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { Data } from "../src/data.ts";
import { LESSON_PLANS } from "../src/lessons_steps.ts";
import { openMotion } from "../src/simulation.ts";
import { doRight, Player, playWrong, WRONG } from "./lesson_player.ts";

const bytes = (name: string): Uint8Array<ArrayBuffer> => new Uint8Array(readFileSync(process.env[name] ?? ""));
const kernels = bytes("KERNELS"), packed = bytes("DATA"), data = new Data(packed), { lessons } = data.declared;
const opened = async (name: string): Promise<Player> => Player.at(name, await openMotion(kernels, packed), data);

test("every lesson has its texts and its steps, as many of each, and is played wrong at each", () => {
  assert.deepEqual(Object.keys(LESSON_PLANS).sort(), Object.keys(lessons).sort());
  assert.deepEqual(Object.keys(WRONG).sort(), Object.keys(lessons).sort());
  for (const [name, { steps }] of Object.entries(lessons)) {
    assert.equal(LESSON_PLANS[name]!.steps.length, steps.length, name);
    assert.equal(WRONG[name]!.length, steps.length, name);
    for (const step of LESSON_PLANS[name]!.steps) assert.ok(step.acts.length > 0, name);
  }
});

for (const name of Object.keys(LESSON_PLANS)) {
  test(`${name}: nothing is ticked before the answer, and every step when it is done`, async () => {
    const player = await opened(name), count = player.lesson.plan.steps.length;
    player.fly(0.1);
    assert.equal(player.done, 0);
    player.restart();
    assert.equal(player.lesson.choose(player.lesson.texts.answer), true);
    player.look();
    for (let step = 0; step < count; step++) {
      assert.equal(player.done, step);
      doRight(player);
      assert.equal(player.done, step + 1, `step ${step + 1}`);
    }
    assert.ok(player.lesson.finished);
  });

  test(`${name}: no wrong hand ticks a step`, async () => assert.deepEqual(await playWrong(name, () => opened(name)), []));
}
