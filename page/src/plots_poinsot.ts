// SPDX-License-Identifier: MIT
//
// Poinsot's construction: the ellipsoid of a torque-free body's omegas of one energy rolls, without slipping, on the plane
// L . omega = 2 T. The touching point's path on the ellipsoid is the polhode, that on the plane the herpolhode.

import { Matrix4, Quaternion, Vector3 } from "three";
import { make } from "./panel_elements.ts";
import type { BodyInfo, Snapshot } from "./source.ts";
import { words } from "./words.ts";

/** Relative change of |L| or T beyond which another herpolhode begins. */
const SAME = 2e-3, TRAIL = 500;
const EYE = new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), 0.32 - Math.PI / 2).multiply(new Quaternion().setFromAxisAngle(new Vector3(0, 0, 1), 0.5));

export class PoinsotDrawing {
  readonly canvas = make("canvas", { role: "img", "aria-label": words.inertia.poinsot });
  private trail: Vector3[] = [];
  private drawn: readonly [number, number, number] = [0, 0, 0];

  constructor() { this.canvas.style.cssText = "width: 100%; height: 13rem; display: block; border-radius: 8px; background: #f6f8fc"; }

  draw({ body, timeNs }: Snapshot, { moments, axes }: BodyInfo): void {
    const { canvas } = this, ratio = Math.min(2, devicePixelRatio || 1), width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width) return;
    if (canvas.width !== Math.round(width * ratio)) { canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio); }
    const paper = canvas.getContext("2d")!, a = axes as unknown as [number, number, number, number, number, number, number, number, number];
    paper.setTransform(ratio, 0, 0, ratio, 0, 0);
    paper.clearRect(0, 0, width, height);
    const w = [0, 1, 2].map((k) => a[k]! * body.row[10]! + a[3 + k]! * body.row[11]! + a[6 + k]! * body.row[12]!) as [number, number, number];
    const twice = moments[0] * w[0] ** 2 + moments[1] * w[1] ** 2 + moments[2] * w[2] ** 2, L = new Vector3(...body.momentum), l = L.length();
    if (!(twice > 0 && l > 0)) return;
    const geometric = (moments[0] * moments[1]) ** 0.25, unit = geometric / Math.sqrt(twice);
    const upright = new Quaternion().setFromUnitVectors(L.clone().divideScalar(l), new Vector3(0, 0, -1));
    const turn = upright.clone().multiply(new Quaternion(body.row[3], body.row[4], body.row[5], body.row[6]));
    const principal = new Matrix4().makeRotationFromQuaternion(turn).multiply(new Matrix4().set(a[0], a[1], a[2], 0, a[3], a[4], a[5], 0, a[6], a[7], a[8], 0, 0, 0, 0, 1));
    const omega = new Vector3(...body.omega).applyQuaternion(upright).multiplyScalar(unit), depth = (-unit * twice) / l;
    if (Math.abs(l / this.drawn[0] - 1) > SAME || Math.abs(twice / this.drawn[1] - 1) > SAME || timeNs < this.drawn[2]) this.trail = [];
    const last = this.trail[this.trail.length - 1];
    if (!last || last.distanceTo(omega) > 0.01) this.trail.push(omega.clone());
    if (this.trail.length > TRAIL) this.trail.shift();
    this.drawn = [l, twice, timeNs];

    const size = 0.31 * Math.min(width, 1.2 * height), seen = (p: Vector3): Vector3 => p.clone().applyQuaternion(EYE);
    const x = (p: Vector3): number => 0.5 * width + size * p.x, y = (p: Vector3): number => 0.4 * height - size * p.y;
    const stroke = (points: readonly Vector3[], colour: string, thick: number): void => {
      paper.strokeStyle = colour;
      paper.lineWidth = thick;
      paper.beginPath();
      for (const point of points) { const at = seen(point); paper.lineTo(x(at), y(at)); }
      paper.stroke();
    };
    const side = [-1.6, -1.2, -0.8, -0.4, 0, 0.4, 0.8, 1.2, 1.6];
    for (const s of side) {
      stroke([new Vector3(s, -1.6, depth), new Vector3(s, 1.6, depth)], "#c9d1e2", 1);
      stroke([new Vector3(-1.6, s, depth), new Vector3(1.6, s, depth)], "#c9d1e2", 1);
    }
    stroke(this.trail, "#d1731a", 2);
    const semi = moments.map((moment) => geometric / Math.sqrt(moment)) as [number, number, number];
    const on = (theta: number, phi: number): Vector3 =>
      new Vector3(semi[0] * Math.cos(phi) * Math.cos(theta), semi[1] * Math.cos(phi) * Math.sin(theta), semi[2] * Math.sin(phi)).applyMatrix4(principal);
    const circle = [...Array(49).keys()].map((k) => (2 * Math.PI * k) / 48);
    for (const phi of [-1, -0.5, 0, 0.5, 1]) stroke(circle.map((angle) => on(angle, phi)), "rgba(47, 99, 173, .35)", 1);
    for (let k = 0; k < 6; k++) stroke(circle.map((angle) => on((k * Math.PI) / 6, angle)), "rgba(47, 99, 173, .35)", 1);
    stroke(polhode(moments, w).map((p) => p.multiplyScalar(unit).applyMatrix4(principal)), "#b5890a", 2.5);
    const origin = new Vector3();
    stroke([origin, new Vector3(0, 0, 1.25 * depth)], "#7a45d1", 2.5);
    stroke([origin, omega], "#0f8d7c", 3);
    paper.font = "700 13px system-ui, sans-serif";
    for (const [text, at, colour] of [["L", new Vector3(0, 0, 1.4 * depth), "#5d2bb0"], ["ω", omega.clone().multiplyScalar(1.1).add(new Vector3(0.08, 0.08, 0)), "#07675a"]] as const) {
      const place = seen(at);
      paper.fillStyle = colour;
      paper.fillText(text, x(place) + 4, y(place) + 4);
    }
  }
}

/** The closed curve through omega, in principal axes with ascending moments: round the axis of the largest moment, or of the
 * smallest. */
function polhode([I1, I2, I3]: readonly [number, number, number], w: readonly [number, number, number]): Vector3[] {
  const I = [I1, I2, I3], squares = w.map((x) => x * x);
  const [pole, first, second] = I3 * (I3 - I2) * squares[2]! >= I1 * (I2 - I1) * squares[0]! ? [2, 0, 1] : [0, 1, 2];
  const one = I[first]! * Math.abs(I[pole]! - I[first]!), two = I[second]! * Math.abs(I[pole]! - I[second]!);
  if (Math.min(one, two) <= 1e-9 * I3 * I3) return [new Vector3(...w)];
  const radius2 = one * squares[first]! + two * squares[second]!, twice = I1 * squares[0]! + I2 * squares[1]! + I3 * squares[2]!;
  return [...Array(121).keys()].map((k) => {
    const angle = (2 * Math.PI * k) / 120, point = [0, 0, 0];
    point[first] = Math.sqrt(radius2 / one) * Math.cos(angle);
    point[second] = Math.sqrt(radius2 / two) * Math.sin(angle);
    const rest = twice - I[first]! * point[first]! ** 2 - I[second]! * point[second]! ** 2;
    point[pole] = Math.sign(w[pole]! || 1) * Math.sqrt(Math.max(rest, 0) / I[pole]!);
    return new Vector3(point[0], point[1], point[2]);
  });
}
