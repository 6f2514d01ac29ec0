// SPDX-License-Identifier: MIT
//
// Pointers: one pulls the body on a string from the grabbed point, or pokes it; others turn the view. The keyboard can
// do the same.

import type { Picture } from "./picture.ts";
import { say } from "./panel_elements.ts";
import type { Hit, Motion, Vec3 } from "./source.ts";
import { words } from "./words.ts";

/** [px] A pointer that moves less is a click, not a drag. */
const STILL_PX = { mouse: 4, pen: 6, touch: 9 } as const;
/** [ms] A second finger within this time turns a drag into a pinch, and the drag is undone; a later one only ends the
 * drag. */
const PINCH_MS = 350;
/** [ns, simulated] Period of repeating the hand's target, since the string is released after a timeout. */
const HELD_NS = 400_000_000;
/** [rad/s] Frequency of the hand's string, with which light and heavy bodies follow alike. */
const FREQUENCY = 8;
const AIM_PX = 12;
/** [px] Resolution of targets. */
const PART_PX = 0.25;

interface Hand {
  readonly id: number;
  readonly hit: Hit;
  readonly inward: Vec3;
  /** Depth of the grabbed point [m]; the hand moves in the plane of this depth, parallel to the screen. */
  readonly depth: number;
  x: number;
  y: number;
  readonly from: readonly [number, number];
  readonly still: number;
  readonly begunMs: number;
  tied: boolean;
  /** Simulated times at which the string was tied, and at which its target was sent last. */
  tiedNs: number;
  saidNs: number;
  moved: boolean;
  ended: boolean;
}

export class Pointer {
  /** Receives the next click on the body, instead of a poke. */
  claim: ((hit: Hit) => void) | null = null;
  /** Receives the points of a stroke on the body, instead of a drag; begins: the first point of a stroke. */
  chalk: ((hit: Hit, begins: boolean) => void) | null = null;
  /** Whether a drag ties the string; false if the scene's own string holds the body. */
  pulls = true;
  private drawing: number | null = null;
  /** Position of the keyboard's aim [px]. */
  aim: [number, number] | null = null;
  /** Called when the user has touched the picture. */
  touched: () => void = () => undefined;
  private hand: Hand | null = null;
  /** [ms] Time of the first event that was not drawn yet, for measurements of latency. */
  waitingMs = 0;
  private readonly turning = new Map<number, [number, number]>();
  private readonly stage: HTMLElement;
  private readonly motion: Motion;
  private readonly picture: Picture;
  private readonly strength: () => number;
  private grabbedByKey = false;

  constructor(stage: HTMLElement, motion: Motion, picture: Picture, strength: () => number) {
    this.stage = stage;
    this.motion = motion;
    this.picture = picture;
    this.strength = strength;
    stage.addEventListener("pointerdown", (event) => this.down(event));
    stage.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"] as const) stage.addEventListener(end, (event) => this.up(event));
    stage.addEventListener("lostpointercapture", (event) => this.turning.delete(event.pointerId));
    stage.addEventListener("wheel", (event) => { this.picture.eye.near(Math.exp(-event.deltaY * (event.deltaMode ? 0.04 : 0.0012))); event.preventDefault(); }, { passive: false });
    stage.addEventListener("contextmenu", (event) => event.preventDefault());
    stage.addEventListener("dblclick", (event) => event.preventDefault());
    stage.addEventListener("keydown", (event) => this.key(event));
    stage.addEventListener("blur", () => { this.aim = null; stage.classList.remove("by-pointer"); });
  }

  /** Whether a string is held; then the camera doesn't move. */
  get holding(): boolean { return this.hand?.tied ?? false; }

  /** Release the hand after the motion was restarted or went back. */
  forget(): void {
    this.hand = null;
    this.grabbedByKey = false;
    this.stage.classList.remove("pulling");
  }

  /** Send the hand's commands since the previous frame. */
  act(): void {
    const { hand } = this;
    if (!hand) return;
    const now = this.motion.snapshot();
    if (hand.tied) {
      if (!now.body.string && now.timeNs > hand.tiedNs) { this.forget(); return; }
      if (hand.moved || now.timeNs - hand.saidNs > HELD_NS) {
        hand.moved = false;
        hand.saidNs = now.timeNs;
        this.told(this.motion.submit({ string: { target: this.target(hand) } }));
      }
    }
    if (hand.ended) {
      if (hand.tied) this.told(this.motion.submit({ string: "release" }));
      this.forget();
    }
  }

  /** The hand's position, rounded to an invisible part of a pixel, so that a link has short numbers. */
  private target(hand: Hand): Vec3 {
    const { eye } = this.picture, digits = Math.max(0, Math.min(12, Math.ceil(-Math.log10(eye.perPixel * PART_PX))));
    return eye.at(hand.x, hand.y, hand.depth).map((x) => Number(x.toFixed(digits))) as unknown as Vec3;
  }

  private told(refusal: string | null): boolean {
    if (refusal) say(refusal);
    return !refusal;
  }

  private hitAt(x: number, y: number): Hit | null {
    const { origin, direction } = this.picture.eye.ray(x, y);
    return this.motion.firstHit(origin, direction);
  }

  private down(event: PointerEvent): void {
    if (event.button > 0 && event.pointerType === "mouse") { this.turnFrom(event); return; }
    // Hide the focus ring of pointer focus: browsers treat focus set by a script as keyboard focus.
    this.stage.classList.add("by-pointer");
    this.stage.focus({ preventScroll: true });
    this.aim = null;
    this.touched();
    if (this.hand && this.hand.id !== event.pointerId) {
      const before = this.hand;
      this.takeBack(before);
      this.turning.set(before.id, [before.x, before.y]);
      this.turnFrom(event);
      return;
    }
    if (this.turning.size) { this.turnFrom(event); return; }
    const hit = this.hitAt(event.clientX, event.clientY);
    if (!hit) { this.turnFrom(event); return; }
    this.stage.setPointerCapture(event.pointerId);
    if (this.chalk) { this.drawing = event.pointerId; this.chalk(hit, true); return; }
    this.begin(event.pointerId, hit, event.clientX, event.clientY, STILL_PX[event.pointerType as keyof typeof STILL_PX] ?? 4);
  }

  private begin(id: number, hit: Hit, x: number, y: number, still: number): void {
    this.hand = {
      id, hit, inward: this.inward(hit), depth: this.picture.eye.depth(hit.world), x, y, from: [x, y], still, begunMs: performance.now(), tied: false, tiedNs: 0, saidNs: 0, moved: false, ended: false,
    };
  }

  private turnFrom(event: PointerEvent): void {
    this.stage.setPointerCapture(event.pointerId);
    this.turning.set(event.pointerId, [event.clientX, event.clientY]);
    this.touched();
  }

  private move(event: PointerEvent): void {
    const { hand } = this, at = this.turning.get(event.pointerId);
    if (this.drawing === event.pointerId) {
      const over = this.hitAt(event.clientX, event.clientY);
      if (over) this.chalk?.(over, false);
      return;
    }
    if (hand?.id === event.pointerId) {
      if (hand.x !== event.clientX || hand.y !== event.clientY) { hand.moved = true; this.waitingMs ||= event.timeStamp; }
      hand.x = event.clientX;
      hand.y = event.clientY;
      if (!hand.tied && !this.claim && Math.hypot(hand.x - hand.from[0], hand.y - hand.from[1]) >= hand.still) this.tie(hand);
      return;
    }
    if (at) { this.turn(event, at); return; }
    if (event.pointerType === "mouse" && !event.buttons) this.stage.classList.toggle("on-body", this.hitAt(event.clientX, event.clientY) !== null);
  }

  private tie(hand: Hand): void {
    if (!this.pulls) { this.forget(); say(words.lesson.tied); return; }
    const values = this.motion.values();
    // Replace the default stiffness by a frequency: 50 N/m throws a nut and doesn't move a satellite.
    if (values["string.frequency"] === 0 && values["string.stiffness"] === 50) this.told(this.motion.set({ "string.frequency": FREQUENCY }));
    const now = this.motion.snapshot();
    if (!this.told(this.motion.submit({ string: { attach: hand.hit.mesh, target: this.target(hand) } }))) { this.forget(); return; }
    hand.tied = true;
    hand.tiedNs = hand.saidNs = now.timeNs;
    hand.moved = false;
    this.stage.classList.add("pulling");
  }

  /** Undo a drag that turned out to be a pinch. */
  private takeBack(hand: Hand): void {
    if (hand.tied) {
      if (performance.now() - hand.begunMs < PINCH_MS && hand.tiedNs > 0 && this.motion.can.goOn) {
        this.motion.goTo(hand.tiedNs - 1);
        this.motion.goOn();
      } else this.told(this.motion.submit({ string: "release" }));
    }
    this.forget();
  }

  private turn(event: PointerEvent, at: [number, number]): void {
    const others = [...this.turning].filter(([id]) => id !== event.pointerId).map(([, place]) => place), { eye } = this.picture;
    const share = 1 / (others.length + 1);
    eye.turn((event.clientX - at[0]) * share, (event.clientY - at[1]) * share);
    const [other] = others;
    if (other) {
      const before = Math.hypot(at[0] - other[0], at[1] - other[1]), after = Math.hypot(event.clientX - other[0], event.clientY - other[1]);
      if (before > 10 && after > 10) eye.near(after / before);
    }
    this.turning.set(event.pointerId, [event.clientX, event.clientY]);
  }

  private up(event: PointerEvent): void {
    this.turning.delete(event.pointerId);
    if (this.drawing === event.pointerId) this.drawing = null;
    const { hand } = this;
    if (hand?.id !== event.pointerId) return;
    if (hand.tied) { hand.ended = true; return; }
    this.forget();
    if (event.type === "pointercancel") return;
    this.waitingMs ||= event.timeStamp;
    this.press(hand.hit, hand.inward);
  }

  private press(hit: Hit, inward: Vec3): void {
    if (this.claim) {
      const taken = this.claim;
      this.claim = null;
      taken(hit);
      return;
    }
    const J = this.strength(), [x, y, z] = inward;
    this.told(this.motion.submit({ at: { point: hit.mesh }, impulse: [J * x, J * y, J * z], axes: "body" }));
  }

  /** The inward normal at a hit, in body axes, since the body keeps turning while the pointer is pressed. */
  private inward({ normal: [x, y, z] }: Hit): Vec3 {
    const R = this.motion.snapshot().body.rotation;
    return [0, 1, 2].map((k) => -(R[k]! * x + R[3 + k]! * y + R[6 + k]! * z)) as unknown as Vec3;
  }

  // Keyboard

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    this.stage.classList.remove("by-pointer");
    const { eye } = this.picture, steps: Record<string, readonly [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const step = steps[event.key];
    if (step) {
      if (event.shiftKey) eye.turn(-14 * step[0], -14 * step[1]);
      else this.moveAim(AIM_PX * step[0], AIM_PX * step[1]);
    } else if (event.key === "+" || event.key === "=") eye.near(1.12);
    else if (event.key === "-") eye.near(1 / 1.12);
    else if (event.key === "0") eye.home();
    else if (event.key === "Enter") this.keyPress();
    else if (event.key === "g" || event.key === "G") this.keyGrab();
    else if (event.key === "Escape" && this.grabbedByKey && this.hand) this.hand.ended = true;
    else return;
    this.touched();
    event.preventDefault();
  }

  private aimed(): [number, number] {
    if (!this.aim) {
      // Aim at the knot, not at the centre of mass, if a string holds the body: finding the centre may be the task.
      const { row, string } = this.motion.snapshot().body, from = string?.knot ?? [row[0]!, row[1]!, row[2]!], at = this.picture.eye.target.clone().set(...from), seen = this.picture.eye.project(at, at);
      this.aim = [seen.x, seen.y];
    }
    return this.aim;
  }

  private moveAim(dx: number, dy: number): void {
    const [x, y] = this.aimed(), { width, height } = this.picture.eye;
    this.aim = [Math.max(0, Math.min(width, x + dx)), Math.max(0, Math.min(height, y + dy))];
    if (this.grabbedByKey && this.hand) { [this.hand.x, this.hand.y] = this.aim; this.hand.moved = true; }
  }

  private keyPress(): void {
    const hit = this.hitAt(...this.aimed());
    if (hit) this.press(hit, this.inward(hit)); else say(words.pointer.nothingThere);
  }

  private keyGrab(): void {
    if (this.grabbedByKey && this.hand) { this.hand.ended = true; return; }
    const [x, y] = this.aimed(), hit = this.hitAt(x, y);
    if (!hit) { say(words.pointer.nothingThere); return; }
    this.begin(-1, hit, x, y, 0);
    this.grabbedByKey = true;
    this.tie(this.hand!);
  }
}
