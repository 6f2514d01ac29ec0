// SPDX-License-Identifier: MIT
//
// The body's mass properties as text for an engine, to the letter as `rigid_proto inspect --for` prints it: the forms are
// those of rigid_proto_ros/mass/engines.py, which says what their places mean.

import type { Form } from "./data.ts";
import { general, repr } from "./numbers.ts";
import type { BodyInfo } from "./source.ts";

const AXES = ["x", "y", "z"] as const;

export function engineText(form: Form, body: BodyInfo): string {
  const { massKg: mass, com, axes, turn } = body, { perM, saysNone } = form;
  const flip = AXES.map((axis) => (axis === form.mirrored ? -1 : 1)), square = perM * perM;
  const tensor = body.inertia.map((value, k) => value * (flip[Math.floor(k / 3)]! * flip[k % 3]!) * square), sizes = tensor.map(Math.abs);
  const products = 100 * Math.max(sizes[1]!, sizes[2]!, sizes[5]!) / Math.max(...sizes), values: Record<string, number> = { mass, products, qw: turn[3]! };
  AXES.forEach((axis, k) => {
    const moment = body.moments[k]! * square;
    values[`c${axis}`] = com[k]! * flip[k]! * perM;
    values[`p${axis}`] = (axes[k]! * com[0] + axes[3 + k]! * com[1] + axes[6 + k]! * com[2]) * flip[k]! * perM;
    values[`q${axis}`] = turn[k]! * (form.mirrored ? -flip[k]! : 1);
    values["ABC"[k]!] = moment;
    values["abc"[k]!] = moment / mass;
    AXES.forEach((other, j) => { values[axis + other] = tensor[3 * k + j]!; });
  });
  return (form.text + (products > saysNone ? form.products : "")).replace(/\{(\w+)(:f)?\}/g, (_, name: string, single: string | undefined) => {
    const text = general(values[name]! + 0, name === "products" ? 2 : 9);
    return single ? `${repr(Number(text))}f` : text;
  });
}
