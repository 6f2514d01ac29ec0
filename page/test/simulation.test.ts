// SPDX-License-Identifier: MIT
//
// node --test, with KERNELS and DATA in the environment: what the motion in the page does for those that use it.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { openMotion } from "../src/simulation.ts";
import type { Motion, Snapshot, Vec3 } from "../src/source.ts";
import { linkText, takeBytes, takeOf, takeOfLink } from "../src/take.ts";
import type { Take } from "../src/take.ts";

const bytes = (name: string): Uint8Array<ArrayBuffer> => new Uint8Array(readFileSync(process.env[name] ?? ""));
const opened = (take?: Uint8Array<ArrayBuffer>): Promise<Motion> => openMotion(bytes("KERNELS"), bytes("DATA"), take);
const size = (v: Vec3): number => Math.hypot(...v);
const row = (of: Snapshot): readonly number[] => of.body.row;
const S = 1e9;

test("a poke while time stands shows at once, and the hash is that of the state before it", async () => {
  const motion = await opened();
  motion.advance(S);
  const before = motion.snapshot(), hash = await motion.hash();
  assert.equal(motion.submit({ at: "com", impulse: [0.01, 0, 0] }), null);
  const after = motion.snapshot();
  assert.equal(after.timeNs, S);
  assert.ok(Math.abs((row(after)[7] ?? 0) - (row(before)[7] ?? 0) - 0.01 / after.body.massKg) < 1e-15);
  assert.equal(await motion.hash(), hash);
});

test("what is refused changes nothing, and says why in one line", async () => {
  const motion = await opened(), other = await opened();
  const refused = [
    motion.set({ mass: -1 }), motion.set({ scale: [0, 1, 1] }), motion.set({ nothing: 1 }), motion.set({ mesh: "no_such_body" }),
    motion.set({ "explicit_inertia.tensor": [1, 0, 0, 1, 0, 9], inertia_model: "explicit" }),
    motion.submit({ force: [1e300, 0, 0] }), motion.submit({ at: "nowhere", force: [1, 0, 0] }), motion.submit({} as never),
    motion.submit({ at: { ray: { origin: [9, 9, 9], direction: [1, 0, 0] } }, force: [1, 0, 0] }),
    motion.submit({ string: { attach: [0, 0, 0.1], target: [1e30, 0, 0] } }), motion.set({ integrator: "euler", "string.attached": true, step: -1 }),
    motion.openMesh("a.obj", new TextEncoder().encode("v 0 0\n")), motion.openScene("x"), motion.openBody("x"), motion.setGhost({ inertia_model: "x" }),
    await motion.openLink("#1.%%"), await motion.openLink("2.AAAA"), await motion.openLink(""),
  ];
  for (const text of refused) assert.ok(text !== null && text.length > 10 && !text.includes("\n"), String(text));
  assert.equal(motion.history().script.length, 0);
  motion.advance(S);
  other.advance(S);
  assert.equal(await motion.hash(), await other.hash());
});

test("a drag pulls, its string has a tension, and letting go ends it", async () => {
  const motion = await opened();
  motion.advance(S / 10);
  const [x = 0, y = 0, z = 0] = row(motion.snapshot());
  const hit = motion.firstHit([x + 1, y, z], [-1, 0, 0]);
  assert.ok(hit !== null && hit.distance > 0.5 && hit.normal[0] > 0);
  assert.equal(motion.submit({ string: { attach: hit.mesh, target: [x + 0.3, y, z] } }), null);
  const { string } = motion.snapshot().body;
  assert.ok(string !== null && size([string.knot[0] - hit.world[0], string.knot[1] - hit.world[1], string.knot[2] - hit.world[2]]) < 1e-9);
  motion.advance(S / 5);
  const pulled = motion.snapshot().body;
  assert.ok((pulled.string?.tension ?? 0) > 0 && (pulled.row[7] ?? 0) > 0.5);
  motion.submit({ string: "release" });
  assert.equal(motion.snapshot().body.string, null);
});

test("a string is released when its time is over", async () => {
  const motion = await opened();
  motion.set({ "string.timeout": 0.2 });
  motion.submit({ string: { attach: [0, 0, 0.07], target: [0.1, 0, 0.1] } });
  assert.equal(motion.snapshot().body.string?.releaseNs, S / 5);
  motion.advance(S / 4);
  assert.equal(motion.snapshot().body.string, null);
});

test("going back shows what was, to the bit; going on from there drops what came after", async () => {
  const motion = await opened(), seen = new Map<number, readonly number[]>();
  for (let ns = 0; ns < 4 * S; ns += S / 4) {
    motion.advance(ns);
    seen.set(ns, row(motion.snapshot()));
    motion.submit({ at: { point: [0, 0, 0.07] }, force: [0.1, 0, 0], duration: 0.3 });
    if (ns === S) motion.set({ scale: [1, 1.5, 1] });
  }
  const { endNs } = motion.history();
  const after = row(motion.snapshot());
  for (const ns of [3 * S, S / 2, 2.25 * S, 0]) {
    motion.goTo(ns - 1);
    motion.advance(ns);
    assert.deepEqual(row(motion.snapshot()), seen.get(ns));
    assert.equal(motion.body().scale[1], ns > S ? 1.5 : 1);
  }
  motion.goTo(endNs);
  assert.deepEqual(row(motion.snapshot()), after);
  motion.goTo(S / 2 + 1);
  assert.equal(motion.history().script.length, 17);
  motion.submit({ force: [0, 0, 0.1] });
  assert.equal(motion.history().script.length, 4);
  assert.equal(motion.history().endNs, S / 2 + 1);
});

test("a ghost begins as the body, at any time, and changes nothing of it", async () => {
  const motion = await opened(), other = await opened();
  for (const one of [motion, other]) {
    one.advance(S);
    one.submit({ at: { point: [0, 0.05, 0] }, impulse: [0.01, 0, 0] });
    one.advance(2 * S);
  }
  assert.equal(motion.snapshot().ghost, null);
  assert.equal(motion.setGhost({ gyroscopic: false }), null);
  assert.deepEqual(row(motion.snapshot()), row(other.snapshot()));
  assert.ok(motion.snapshot().angleToGhost > 0.01);
  motion.advance(3 * S);
  other.advance(3 * S);
  assert.equal(await motion.hash(), await other.hash());
  assert.equal(motion.setGhost({ gyroscopic: true, inertia_model: "solid" }), null);
  const { body, ghost, angleToGhost } = motion.snapshot();
  assert.deepEqual(ghost?.row, body.row);
  assert.ok(angleToGhost < 1e-15);
});

test("after an open mesh, which flies as a shell, a closed one is what bodies were before", async () => {
  const corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n", sides = "f 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
  const open = new TextEncoder().encode(corners + sides), closed = new TextEncoder().encode(`${corners}f 4 3 2 1\n${sides}`);
  const names = ["inertia_model", "inertia_model_com", "mass", "density"] as const, chosen = (motion: Motion): unknown[] => names.map((name) => motion.values()[name]);
  for (const model of ["solid", "bounding_box", "points"]) {
    const motion = await opened();
    motion.set({ inertia_model: model });
    const before = chosen(motion);
    assert.equal(motion.openMesh("open.obj", open), null);
    assert.equal(motion.values()["inertia_model"], "shell");
    assert.equal(motion.openMesh("again.obj", open), null);
    assert.equal(motion.values()["inertia_model"], "shell");
    assert.equal(motion.openMesh("closed.obj", closed), null);
    assert.deepEqual(chosen(motion), before);
    assert.equal(motion.openMesh("open.obj", open), null);
    assert.equal(motion.openBody("hammer"), null);
    assert.equal(motion.values()["inertia_model"], model);
    // What a person chooses stays.
    assert.equal(motion.openMesh("open.obj", open), null);
    assert.equal(motion.set({ inertia_model: "bounding_box" }), null);
    assert.equal(motion.openMesh("closed.obj", closed), null);
    assert.equal(motion.values()["inertia_model"], "bounding_box");
  }
});

test("a ghost as an engine's method at its step is the body flown so, and a take keeps it to the bit", async () => {
  const motion = await opened(), alone = await opened(), as = { integrator: "semi_implicit_euler", step: 0.016666667 };
  assert.equal(motion.setGhost(as), null);
  assert.equal(alone.set(as), null);
  alone.reset();
  for (const one of [motion, alone]) {
    one.advance(2 * S);
    one.submit({ at: { point: [0, 0.05, 0] }, impulse: [0.01, 0, 0] });
    one.advance(4 * S + 1);
  }
  const { ghost, body } = motion.snapshot();
  assert.deepEqual(ghost?.row, row(alone.snapshot()));
  assert.ok((ghost?.kinetic ?? 0) > 1.02 * body.kinetic); // this method gains energy
  const link = await motion.link(), again = await opened();
  assert.equal(await again.openLink(link), null);
  again.advance(4 * S + 1);
  assert.deepEqual(again.ghost(), motion.ghost());
  assert.deepEqual(again.snapshot(), motion.snapshot());
  assert.doesNotMatch(again.take().scene, /ghost/); // the command line's ghost has the body's step
});

test("a ghost's step that is none is refused, also in a take", async () => {
  const motion = await opened();
  for (const step of [-1, NaN, Infinity, 1e9]) assert.match(motion.setGhost({ step }) ?? "", /step/, String(step));
  assert.equal(motion.snapshot().ghost, null);
  for (const step of [-1, "wide", 1e9]) {
    const take = { ...(await takeOfLink(await motion.link())), ghost: { ...motion.ghost(), step } };
    assert.notEqual(await motion.openLink(await linkText(take as Take)), null, String(step));
  }
  assert.equal(motion.setGhost({ step: 0.1, integrator: "rk4" }), null);
});

test("a mesh of one's own flies, is told with what is wrong with it, and goes into the file", async () => {
  const motion = await opened();
  const cube = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
  assert.equal(motion.openMesh("cube.obj", new TextEncoder().encode(cube)), null);
  assert.ok(Math.abs(motion.body().massKg - 1000) < 1e-9 || motion.body().massKg > 1000);
  assert.equal(motion.body().name, "cube.obj");
  motion.submit({ at: { vertex: 2 }, impulse: [0, 0, 10] });
  motion.advance(S);
  assert.equal(await motion.link(), "");
  assert.match(new TextDecoder().decode(motion.take().mesh?.bytes), /^v 0\.0 0\.0 0\.0\n/);
  const half = cube.split("\n").slice(0, -2).join("\n");
  assert.equal(motion.openMesh("half.obj", new TextEncoder().encode(half), 0.1), null);
  assert.match(motion.notice(), /open surface with 4 boundary edges; /);
  assert.equal(motion.values()["inertia_model"], "shell");
  assert.match(motion.body().models[0]?.refusal ?? "", /shell/);
  assert.ok((motion.body().models[3]?.moments[0] ?? 0) > 0);
});

test("a take goes through a link and a file, and one of another version says so", async () => {
  const motion = await opened();
  motion.set({ mass: 0.3, "ballast.nut": [0.05, 0, 0, 0.07] });
  motion.setGhost({ inertia_model: "bounding_box" });
  motion.advance(S / 2);
  motion.submit({ wrench: { torque: [0, 0.01, 0] } });
  motion.advance(S);
  const link = await motion.link(), hash = await motion.hash(), other = await opened();
  assert.equal(await other.openLink(`#${link}`), null);
  assert.equal(other.notice(), "");
  assert.equal(other.ghost().inertia_model, "bounding_box");
  assert.equal(other.snapshot().timeNs, 0);
  other.advance(S);
  assert.equal(await other.hash(), hash);
  const { values, script, endNs } = { values: { mesh: "hammer" }, script: other.history().script, endNs: S };
  const take: Take = { form: 1, version: "9.9", values, ghost: other.ghost(), script, endNs, mesh: null };
  assert.equal(await other.openLink(await linkText(take)), null);
  assert.match(other.notice(), /version 9\.9/);
  const third = await opened(takeBytes(take));
  third.advance(S);
  other.advance(S);
  assert.equal(await third.hash(), await other.hash());
  assert.equal(takeOf(takeBytes(take)).version, "9.9");
});

test("damaged links are refused in a line", async () => {
  const motion = await opened();
  motion.submit({ force: [0, 0, 0.1] });
  const link = await motion.link();
  let taken = 0;
  for (let k = 0; k < 300; k++) {
    const at = (k * 7919) % link.length;
    const damaged = link.slice(0, at) + "Ab9_-"[k % 5] + link.slice(at + 1 + (k % 3));
    const refusal = await motion.openLink(damaged);
    if (refusal === null) taken++;
    else assert.ok(!refusal.includes("\n"));
  }
  assert.ok(taken < 30);
});

test("no entry and no value, whatever it holds, throws or leaves numbers that aren't finite", async () => {
  const motion = await opened();
  const odd: unknown[] = [null, 1, "x", [], {}, [1, 2, 3], NaN, Infinity, [1, 2], { vertex: -1 }, { vertex: 1e9 }, { point: [1, 2] }, [null, 1, 2], "com", true, 1e101];
  for (const key of ["at", "force", "push", "torque", "impulse", "angular_impulse", "wrench", "string", "set", "state", "service", "axes", "duration", "slot", "t", "x"]) {
    for (const value of odd) {
      for (const more of [{}, { force: [0, 0, 1] }]) {
        const refusal = motion.submit({ ...more, [key]: value } as never);
        assert.ok(refusal === null || refusal.length > 5, `${key} ${JSON.stringify(value)}`);
      }
    }
  }
  for (const parameter of motion.parameters()) for (const value of odd) motion.set({ [parameter.name.replace("<name>", "a")]: value as number });
  motion.advance(S / 10);
  assert.ok(row(motion.snapshot()).every(Number.isFinite));
});

test("observers hear of changes, and reset begins anew with the parameters in force", async () => {
  const motion = await opened();
  let heard = 0;
  const end = motion.watch(() => heard++);
  motion.set({ mass: 1 });
  motion.advance(S);
  assert.equal(heard, 1);
  motion.reset();
  assert.ok(heard > 1);
  assert.deepEqual([motion.snapshot().timeNs, motion.body().massKg, motion.history().script.length], [0, 1, 0]);
  end();
  const { heardAll } = { heardAll: heard };
  motion.set({ mass: 2 });
  assert.equal(heard, heardAll);
});

test("a second flight, ten times as accurate, tells chaos and leaves the take as it is", async () => {
  const motion = await opened();
  assert.equal(motion.openBody("t_handle"), null);
  motion.advance(3 * S);
  assert.ok(motion.sensitivity().attitude < 1e-8);
  motion.reset();
  assert.equal(motion.set({ accuracy: 1e-8, "string.frequency": 50, "string.damping_ratio": 0, "string.rest_length": 0, gravity: [0, 0, -9.81] }), null);
  motion.reset();
  assert.equal(motion.submit({ string: { attach: [0, 0, 0], target: [0, 0, 0.1] } }), null);
  motion.advance(3 * S);
  const before = await motion.hash(), script = motion.history().script, { attitude, position, finer } = motion.sensitivity();
  assert.ok(attitude > 0.1 && position > 0.01, `${attitude} rad, ${position} m`);
  assert.deepEqual(finer, ["accuracy", 1e-9]);
  assert.equal(await motion.hash(), before);
  assert.deepEqual(motion.history().script, script);
  motion.set({ accuracy: 1e-7 });
  assert.throws(() => motion.sensitivity(), { message: /within this take/ });
});
