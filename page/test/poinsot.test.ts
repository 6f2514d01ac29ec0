// SPDX-License-Identifier: MIT
//
// Poinsot's construction of states that the kernels give.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { construction, herpolhode, polhode } from "../src/poinsot.ts";
import { openMotion } from "../src/simulation.ts";
import type { BodyInfo, Motion, Snapshot, Vec3 } from "../src/source.ts";

const bytes = (name: string): Uint8Array<ArrayBuffer> => new Uint8Array(readFileSync(process.env[name] ?? ""));
const opened = (): Promise<Motion> => openMotion(bytes("KERNELS"), bytes("DATA"));
const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const S = 1e9;

/** Of a free flight, instants 10 ms apart. */
function flown(motion: Motion, seconds: number): { now: Snapshot; info: BodyInfo }[] {
  const from = motion.snapshot().timeNs, seen = [];
  for (let k = 0; k <= 100 * seconds; k++) {
    motion.advance(from + k * 1e7);
    seen.push({ now: motion.snapshot(), info: motion.body() });
  }
  return seen;
}

test("the polhode goes through omega, and on it energy and |L| are the same", () => {
  for (const I of [[0.3, 0.5, 0.7], [1, 1, 2], [1, 2, 2], [1, 2, 3], [1e-3, 1, 1.001]] as const) {
    for (const w of [[1, 2, 3], [0.01, 5, 0.01], [3, 0.1, 0.2], [-0.1, 0.3, -4], [0.02, 5, 0.01]] as const) {
      const points = polhode(I, w), twice = (p: Vec3): number => dot(I.map((x, k) => x * p[k]!) as unknown as Vec3, p), square = (p: Vec3): number => I.reduce((sum, x, k) => sum + (x * p[k]!) ** 2, 0);
      for (const p of points) {
        assert.ok(Math.abs(twice(p) / twice(w) - 1) < 1e-12);
        assert.ok(Math.abs(square(p) / square(w) - 1) < 1e-12);
      }
      // Neighbours are up to 1/120 of the round apart; where moments are nearly the same, the curve is one point.
      const near = Math.min(...points.map((p) => Math.hypot(...p.map((x, k) => x - w[k]!))));
      assert.ok(near < 0.05 * Math.hypot(...w), `${String(I)} ${String(w)} ${near}`);
    }
  }
});

test("the plane stays in a free flight, touches the ellipsoid at omega, and herpolhode points lie on it", async () => {
  const motion = await opened(), seen = flown(motion, 4), { now, info } = seen.at(-1)!;
  const made = construction(now.body, info, 1)!, first = construction(seen[0]!.now.body, seen[0]!.info, 1)!;
  assert.ok(Math.abs(made.depth - first.depth) < 1e-12 && dot(made.upright, first.upright) > 1 - 1e-12);
  const path = herpolhode(seen, now);
  assert.equal(path.length, seen.length);
  for (const omega of path) assert.ok(Math.abs(made.unit * dot(omega, made.upright) - made.depth) < 1e-9);
  // The ellipsoid's surface at omega: sum (unit w_k / semi_k)^2 = 1, and its normal there is L.
  const w = [0, 1, 2].map((k) => [0, 1, 2].reduce((sum, i) => sum + info.axes[3 * i + k]! * now.body.row[10 + i]!, 0));
  assert.ok(Math.abs(w.reduce((sum, x, k) => sum + ((made.unit * x) / made.semi[k]!) ** 2, 0) - 1) < 1e-12);
  assert.ok(Math.max(...made.semi) <= 0.62 + 1e-12);
});

test("a poke begins another herpolhode, and going back shows the one of then", async () => {
  const motion = await opened(), before = flown(motion, 1), then = before.at(-1)!.now;
  motion.submit({ at: { point: [0, 0.05, 0] }, impulse: [0.02, 0, 0] });
  const after = flown(motion, 0.5), all = [...before.slice(0, -1), ...after];
  assert.equal(herpolhode(all, after.at(-1)!.now).length, after.length);
  assert.equal(herpolhode(all, before.at(-2)!.now).length, before.length - 1);
  assert.ok(then.timeNs === S);
});

test("a pull turns the plane with L; a body at rest, and any ball, draw what there is", async () => {
  const motion = await opened();
  motion.advance(S / 10);
  const start = construction(motion.snapshot().body, motion.body(), 1)!;
  motion.submit({ string: { attach: [0, 0.05, 0], target: [0.3, 0.2, 0.4] } });
  motion.advance(S / 2);
  const { body } = motion.snapshot(), pulled = construction(body, motion.body(), 1)!;
  assert.ok(dot(pulled.upright, start.upright) < 0.999);
  assert.ok(Math.abs(dot(pulled.upright, body.momentum) - Math.hypot(...body.momentum)) < 1e-12);

  motion.set({ inertia_model: "explicit", "explicit_inertia.mass": 1, "explicit_inertia.tensor": [0.01, 0, 0, 0.01, 0, 0.01], "initial.angular_velocity": [1, 2, 3] });
  motion.reset();
  motion.advance(S);
  const ball = construction(motion.snapshot().body, motion.body(), 1)!;
  assert.equal(ball.polhode.length, 1);
  assert.ok(Math.max(...ball.semi) - Math.min(...ball.semi) < 1e-12 && Math.abs(ball.depth - ball.semi[0]) < 1e-12);
  motion.set({ "explicit_inertia.tensor": [0.001, 0, 0, 0.01, 0, 0.011] }); // flat: I1 + I2 = I3
  motion.reset();
  motion.advance(S);
  const flat = construction(motion.snapshot().body, motion.body(), 1)!;
  assert.ok([flat.unit, flat.depth, ...flat.semi].every((x) => x > 0 && Number.isFinite(x)));
  motion.set({ "initial.angular_velocity": [0, 0, 0] });
  motion.reset();
  assert.equal(construction(motion.snapshot().body, motion.body(), 1), null);
});
