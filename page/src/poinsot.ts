// SPDX-License-Identifier: MIT
//
// Poinsot's construction: the inertia ellipsoid of a torque-free body, omega . I omega = 2 T, rolls without slipping on
// the plane L . omega = 2 T. The path of the contact point on the ellipsoid is the polhode, its path on the plane the
// herpolhode. Rays from the centre through them form the body cone and the space cone; the first rolls on the second.

import type { BodyInfo, Flying, Motion, Snapshot, Vec3 } from "./source.ts";

/** Relative change of L beyond which a new herpolhode starts. */
const SAME = 2e-3;
/** Largest number of points of a herpolhode. */
const MOST = 3000;
/** Mean semi-axis of the ellipsoid, and largest length of its longest one, in body sizes. */
const MEAN = 0.45, LONGEST = 0.62;

export interface Construction {
  /** length that represents 1 rad/s [m] */
  readonly unit: number;
  /** semi-axes [m] about the principal axes */
  readonly semi: Vec3;
  /** unit vector of L, world axes; and distance of the plane from the centre [m] */
  readonly upright: Vec3;
  readonly depth: number;
  /** the closed curve through omega [rad/s, principal axes] */
  readonly polhode: readonly Vec3[];
}

const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** Whether a flywheel turns in the body, or is driven. */
export const hasFlywheel = (motion: Motion): boolean =>
  [...motion.snapshot().body.rotor, ...(motion.values()["rotor.torque"] as readonly number[])].some((x) => x !== 0);

/** The construction for a body at one instant, scaled to its size [m]; null if the body doesn't spin or has a flywheel. */
export function construction({ row, omega, momentum, rotor }: Flying, { moments, axes }: BodyInfo, size: number): Construction | null {
  const twice = dot(omega, momentum), l = Math.hypot(...momentum), [I1, I2] = moments;
  if (!(twice > 0 && l > 0 && I1 > 0) || rotor.some((h) => h !== 0)) return null;
  const w = [0, 1, 2].map((k) => axes[k]! * row[10]! + axes[3 + k]! * row[11]! + axes[6 + k]! * row[12]!) as unknown as Vec3;
  const mean = Math.sqrt(I1 * I2), longest = MEAN * Math.sqrt(mean / I1), scale = size * (longest > LONGEST ? LONGEST / longest : 1) * MEAN;
  const unit = scale * Math.sqrt(mean / twice);
  return {
    unit, semi: moments.map((I) => scale * Math.sqrt(mean / I)) as unknown as Vec3,
    upright: momentum.map((x) => x / l) as unknown as Vec3, depth: (unit * twice) / l, polhode: polhode(moments, w),
  };
}

/** The closed curve through omega on which T and |L| are constant, in principal axes with ascending moments, about the
 * axis of the largest or of the smallest moment. A single point if omega is constant. */
export function polhode([I1, I2, I3]: Vec3, w: Vec3): Vec3[] {
  const I = [I1, I2, I3], squares = w.map((x) => x * x);
  const [pole, first, second] = I3 * (I3 - I2) * squares[2]! >= I1 * (I2 - I1) * squares[0]! ? [2, 0, 1] : [0, 1, 2];
  const one = I[first]! * Math.abs(I[pole]! - I[first]!), two = I[second]! * Math.abs(I[pole]! - I[second]!);
  if (Math.min(one, two) <= 1e-9 * I3 * I3) return [w];
  const radius2 = one * squares[first]! + two * squares[second]!, twice = I1 * squares[0]! + I2 * squares[1]! + I3 * squares[2]!;
  return [...Array(121).keys()].map((k) => {
    const angle = (2 * Math.PI * k) / 120, point: [number, number, number] = [0, 0, 0];
    point[first] = Math.sqrt(radius2 / one) * Math.cos(angle);
    point[second] = Math.sqrt(radius2 / two) * Math.sin(angle);
    const rest = twice - I[first]! * point[first]! ** 2 - I[second]! * point[second]! ** 2;
    point[pole] = Math.sign(w[pole]! || 1) * Math.sqrt(Math.max(rest, 0) / I[pole]!);
    return point;
  });
}

/** The herpolhode: omegas [rad/s, world axes] up to now since the last change of L. seen: instants in order of time. */
export function herpolhode(seen: readonly { readonly now: Snapshot }[], now: Snapshot): Vec3[] {
  const { momentum, omega } = now.body, l = Math.hypot(...momentum), found: Vec3[] = [omega];
  let k = seen.length - 1;
  while (k >= 0 && seen[k]!.now.timeNs >= now.timeNs) k--;
  for (; k >= 0 && found.length < MOST; k--) {
    const then = seen[k]!.now.body, apart = then.momentum.map((x, i) => x - momentum[i]!);
    if (Math.hypot(...apart) > SAME * l) break;
    found.push(then.omega);
  }
  return found;
}
