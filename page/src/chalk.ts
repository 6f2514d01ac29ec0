// SPDX-License-Identifier: MIT
//
// Chalk on the body: strokes of a hand, and straight lines along a string.

import type { Hit, Motion, Vec3 } from "./source.ts";

/** Height of chalk above the surface, in lengths of the body, so that the surface doesn't hide it. */
const ABOVE = 0.004;
const SAMPLES = 160;

/** The position [mesh] of chalk at a hit on the body. */
export function chalked(motion: Motion, { body, normal }: Hit): Vec3 {
  const { rotation: R } = motion.snapshot().body, info = motion.body(), up = ABOVE * info.length;
  return body.map((c, k) => (c + info.com[k]! + up * (R[k]! * normal[0] + R[3 + k]! * normal[1] + R[6 + k]! * normal[2])) / info.scale[k]!) as unknown as Vec3;
}

/** Line segments, as pairs of points [mesh], along a line through a point in a direction [both world], on both broad
 * sides of the body. */
export function lineOnBody(motion: Motion, point: Vec3, along: Vec3): readonly number[] {
  const { vertices, scale, length } = motion.body(), R = motion.snapshot().body.rotation;
  const sides = [0, 1, 2].map((k) => {
    let low = Infinity, high = -Infinity;
    for (let i = k; i < vertices.length; i += 3) { low = Math.min(low, vertices[i]!); high = Math.max(high, vertices[i]!); }
    return (high - low) * Math.abs(scale[k]!);
  });
  const thin = sides.indexOf(Math.min(...sides)), out: Vec3 = [R[thin]!, R[3 + thin]!, R[6 + thin]!], pairs: number[] = [];
  for (const side of [1, -1]) {
    let before: Vec3 | null = null;
    for (let k = 0; k <= SAMPLES; k++) {
      const t = (4 * k / SAMPLES - 2) * length, from = point.map((p, i) => p + t * along[i]! + side * 4 * length * out[i]!) as unknown as Vec3;
      const hit = motion.firstHit(from, out.map((x) => -side * x) as unknown as Vec3), place: Vec3 | null = hit ? chalked(motion, hit) : null;
      if (place && before) pairs.push(...before, ...place);
      before = place;
    }
  }
  return pairs;
}
