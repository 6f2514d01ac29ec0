// SPDX-License-Identifier: MIT
//
// The record of a take for plots and traces, and the plots.

import { make } from "./panel_elements.ts";
import type { Pose } from "./picture.ts";
import type { BodyInfo, Snapshot, Vec3 } from "./source.ts";
import { words } from "./words.ts";
import { short } from "./words_numbers.ts";

/** Shortest time between recorded instants [ns], and their largest number; beyond it every second one is dropped. */
const APART_NS = 3_000_000, MOST = 12_000;
/** [s] Time span of a plot. */
const WINDOW_S = 10;

interface Seen { readonly now: Snapshot; readonly info: BodyInfo; readonly gravity: Vec3 }

export interface Energies { readonly spin: number; readonly move: number; readonly height: number; readonly string: number }

/** Energies [J]. height: gravitational energy relative to the world's origin. */
export function energies({ row, massKg, kinetic, potential }: Snapshot["body"], gravity: Vec3): Energies {
  const [vx, vy, vz] = [row[7]!, row[8]!, row[9]!], move = 0.5 * massKg * (vx * vx + vy * vy + vz * vz);
  const height = -massKg * (gravity[0] * row[0]! + gravity[1] * row[1]! + gravity[2] * row[2]!);
  return { spin: Math.max(0, kinetic - move), move, height, string: Math.max(0, potential - height) };
}

/** The recorded instants of a take, in order of time. */
export class Track {
  readonly seen: Seen[] = [];

  /** Remove instants after endNs, the end of the take; they belong to a discarded flight. */
  cut(endNs: number): void {
    while (this.seen.length && this.seen[this.seen.length - 1]!.now.timeNs > endNs) this.seen.pop();
  }

  add(now: Snapshot, info: BodyInfo, gravity: Vec3): void {
    const last = this.seen[this.seen.length - 1];
    if (last && now.timeNs - last.now.timeNs < APART_NS) {
      // A command while paused shows at once.
      if (now.timeNs === last.now.timeNs) this.seen[this.seen.length - 1] = { now, info, gravity };
      return;
    }
    this.seen.push({ now, info, gravity });
    if (this.seen.length > MOST) this.seen.splice(0, this.seen.length, ...this.seen.filter((_, k) => k % 2 === 0));
  }

  /** Index of the last instant at or before a time; -1 if there is none. */
  before(timeNs: number): number {
    let low = -1, high = this.seen.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.seen[middle]!.now.timeNs <= timeNs) low = middle; else high = middle;
    }
    return low;
  }

  /** The body's pose at a time, interpolated between recorded instants. */
  pose(timeNs: number): Pose | null {
    const k = this.before(timeNs), one = this.seen[k]?.now, two = this.seen[k + 1]?.now;
    if (!one) return null;
    if (!two) return one.body;
    const part = (timeNs - one.timeNs) / (two.timeNs - one.timeNs), a = one.body.row, b = two.body.row;
    const same = a[3]! * b[3]! + a[4]! * b[4]! + a[5]! * b[5]! + a[6]! * b[6]! < 0 ? -1 : 1;
    const row = a.map((x, i) => x + part * ((i >= 3 && i < 7 ? same : 1) * b[i]! - x));
    const size = Math.hypot(row[3]!, row[4]!, row[5]!, row[6]!) || 1;
    for (let i = 3; i < 7; i++) row[i] = row[i]! / size;
    return { row, scale: one.body.scale, com: one.body.com };
  }

  /** Positions [m, world] of a point [mesh] during the last `seconds` up to a time. */
  trace(point: Vec3, untilNs: number, seconds: number): number[] {
    const places: number[] = [];
    for (let k = this.before(untilNs - seconds * 1e9) + 1; k <= this.before(untilNs); k++) {
      const { row, rotation: R, scale, com } = this.seen[k]!.now.body;
      const [x, y, z] = [0, 1, 2].map((i) => point[i]! * scale[i]! - com[i]!) as [number, number, number];
      places.push(row[0]! + R[0]! * x + R[1]! * y + R[2]! * z, row[1]! + R[3]! * x + R[4]! * y + R[5]! * z, row[2]! + R[6]! * x + R[7]! * y + R[8]! * z);
    }
    return places;
  }
}

/** A curve. key: its entry in the plot's legend. */
interface Curve { readonly key: HTMLElement; readonly colour: string; value(seen: Seen): number }
interface Plot { readonly kind: string; readonly title: string; readonly unit: string; readonly curves: readonly Curve[]; readonly canvas: HTMLCanvasElement }

const principal = ({ now, info }: Seen, k: number): number =>
  info.axes[k]! * now.body.row[10]! + info.axes[3 + k]! * now.body.row[11]! + info.axes[6 + k]! * now.body.row[12]!;
const AXES = ["#c93a27", "#16803f", "#2f63ad"] as const;

/** Values of the other sign that are smaller than this, relative to the largest value, don't extend the axis. */
const SEEN = 1e-3;

/** Plots of the last seconds of the take, with a line at the present time. */
export class Plots {
  readonly node: HTMLElement;
  private readonly plots: readonly Plot[];
  private readonly track: Track;

  constructor(track: Track, kinds: readonly string[] = ["energy", "omega", "momentum", "angle"]) {
    this.track = track;
    const plot = (kind: string, title: string, unit: string, curves: readonly Curve[]): Plot => ({ kind, title, unit, curves, canvas: make("canvas", { role: "img", "aria-label": title }) });
    const curve = (name: string, colour: string, value: (seen: Seen) => number): Curve => {
      const key = make("span", {}, ` ${name}`);
      key.style.color = colour;
      return { key, colour, value };
    };
    const energy = (name: string, colour: string, of: (e: Energies) => number): Curve => curve(name, colour, ({ now, gravity }) => of(energies(now.body, gravity)));
    const whole = (e: Energies): number => e.spin + e.move + e.string + e.height;
    const all: Readonly<Record<string, Plot>> = {
      energy: plot("energy", words.plots.energy, "J", [
        energy(words.energy.spin, "#7a45d1", (e) => e.spin), energy(words.energy.move, "#0b7466", (e) => e.move), energy(words.energy.string, "#d1432f", (e) => e.string),
        energy(words.energy.all, "#6b7385", whole), curve(words.energy.ghost, "#2166b8", ({ now, gravity }) => (now.ghost ? whole(energies(now.ghost, gravity)) : NaN))]),
      omega: plot("omega", words.plots.omega, "rad/s", AXES.map((colour, k) => curve(`ω${"₁₂₃"[k]}`, colour, (seen) => principal(seen, k)))),
      momentum: plot("momentum", words.plots.momentum, "N m s", AXES.map((colour, k) => curve(`L${"xyz"[k]}`, colour, ({ now }) => now.body.momentum[k]!))),
      angle: plot("angle", words.plots.angle, "°", [curve(words.angle.name, "#2f63ad", ({ now }) => (now.angleToGhost * 180) / Math.PI)]),
    };
    this.plots = kinds.flatMap((kind) => all[kind] ?? []);
    this.node = make("div", {}, ...this.plots.map(({ kind, title, unit, curves, canvas }) => make("div", { class: "plot", "data-mark": kind },
      make("div", { class: "title" }, `${title} [${unit}]`, curves.length > 1 && make("span", {}, ...curves.map(({ key }) => key))), canvas)));
  }

  draw(timeNs: number): void {
    const { seen } = this.track, end = Math.max(timeNs, seen[seen.length - 1]?.now.timeNs ?? 0), to = Math.max(end, WINDOW_S * 1e9), from = to - WINDOW_S * 1e9;
    const first = Math.max(0, this.track.before(from)), step = Math.max(1, Math.floor((seen.length - first) / 500));
    for (const { canvas, curves } of this.plots) {
      const width = canvas.clientWidth, height = canvas.clientHeight, ratio = Math.min(2, devicePixelRatio || 1);
      if (!width) continue;
      if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) { canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio); }
      const paper = canvas.getContext("2d")!;
      paper.setTransform(ratio, 0, 0, ratio, 0, 0);
      paper.clearRect(0, 0, width, height);
      const lines = curves.map(({ key, value, colour }) => {
        const places: [number, number][] = [];
        for (let k = first; k < seen.length; k += step) {
          const at = value(seen[k]!);
          if (Number.isFinite(at)) places.push([((seen[k]!.now.timeNs - from) / (to - from)) * width, at]);
        }
        key.hidden = !places.length; // no ghost
        return { colour, places };
      });
      let low = 0, high = 0;
      for (const { places } of lines) for (const [, value] of places) { low = Math.min(low, value); high = Math.max(high, value); }
      // Rounding errors must not extend the axis.
      if (-low < SEEN * high) low = 0;
      if (high < -SEEN * low) high = 0;
      const room = 0.08 * (high - low || 1);
      low -= room;
      high += room;
      const y = (value: number): number => height - ((value - low) / (high - low)) * height;
      paper.strokeStyle = "#c6cede";
      paper.lineWidth = 1;
      paper.beginPath();
      paper.moveTo(0, y(0));
      paper.lineTo(width, y(0));
      paper.stroke();
      paper.lineWidth = 1.8;
      for (const { colour, places } of lines) {
        paper.strokeStyle = colour;
        paper.beginPath();
        for (const [x, value] of places) paper.lineTo(x, y(value));
        paper.stroke();
      }
      const x = ((timeNs - from) / (to - from)) * width;
      paper.strokeStyle = "#1d2433";
      paper.lineWidth = 1;
      paper.beginPath();
      paper.moveTo(x, 0);
      paper.lineTo(x, height);
      paper.stroke();
      paper.fillStyle = "#4b5873";
      const size = Math.max(11, Number.parseFloat(getComputedStyle(canvas).fontSize) - 4);
      paper.font = `${size}px system-ui, sans-serif`;
      paper.fillText(short(high - room), 3, size);
      if (low + room < 0) paper.fillText(short(low + room), 3, height - 3);
    }
  }
}
