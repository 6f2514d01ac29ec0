// SPDX-License-Identifier: MIT
//
// A lesson: its definition, the record of what the user has done, and its progress. Independent of the DOM, so that
// Node can play lessons, too. The steps of each lesson are in lessons_steps.ts, its texts in the head of its scene.

import type { BodyInfo, Entry, GhostChoice, Motion, Snapshot, Values, Vec3 } from "./source.ts";
import type { Words } from "./words.ts";

/** A lesson's texts, which rigid_proto_ros/page/data.py takes from the head of its scene. answer: index of the right
 * choice. */
export interface LessonTexts {
  readonly title: string;
  readonly question: string;
  readonly choices: readonly string[];
  readonly answer: number;
  readonly steps: readonly string[];
  readonly reason: string;
}

/** A recorded instant. entries: number of the trial's script entries that had acted. */
export interface Seen {
  readonly now: Snapshot;
  readonly info: BodyInfo;
  readonly values: Values;
  readonly entries: number;
}

/** One flight from its start. start: the parameters at the start. */
export interface Trial {
  readonly start: Values;
  readonly script: readonly Entry[];
  readonly seen: readonly Seen[];
}

/** A chalk line along the string, drawn while the body hung at rest: through the knot. point, along [mesh]. */
export interface ChalkLine { readonly point: Vec3; readonly along: Vec3 }

/** The user's choices of what is shown beside the motion. */
export interface Sight {
  readonly turned: readonly number[] | null;
  readonly principal: boolean;
  readonly poinsot: boolean;
  readonly ghost: GhostChoice;
  readonly apart: boolean;
  readonly trace: Vec3 | "com" | null;
  /** names of cards that are open */
  readonly cards: readonly string[];
}

/** The input of a step's condition. scene: the parameters at the start of the lesson. trials: all since then; the last
 * one is the present one. trial, from: indices of the trial and of the instant at which the step began. */
export interface Account {
  readonly scene: Values;
  readonly trials: readonly Trial[];
  readonly trial: number;
  readonly from: number;
  readonly lines: readonly ChalkLine[];
  readonly sight: Sight;
}

/** The action of a step's button. poke: at a contact or "com", along [body axes]; fresh: after a restart. start, set:
 * set values; start also restarts the scene. ghost: restarts with another ghost. card: opens a card and marks an
 * element. pull, press, tie: point to the picture. */
export type Act = { readonly text: (words: Words["lesson"]) => string } & (
  | { readonly kind: "poke"; readonly at: string; readonly along: Vec3; readonly fresh?: boolean }
  | { readonly kind: "start" | "set"; readonly values: (scene: Values, info: BodyInfo) => Values }
  | { readonly kind: "card"; readonly card: "body" | "tensor" | "world" | "measure" | "ghost" | "plots"; readonly mark: string }
  | { readonly kind: "ghost"; readonly choice: GhostChoice }
  | { readonly kind: "trace"; readonly at: string }
  | { readonly kind: "again" | "pull" | "press" | "tie" | "chalk" | "principal" | "poinsot" }
);

export interface Step {
  /** Whether the step's condition is fulfilled. */
  readonly done: (account: Account) => boolean;
  readonly acts: readonly Act[];
}

/** The plan of a lesson. marks: contacts, or "com", that are marked in the picture. rate: of time. trace: of a point,
 * after the answer. plots: in class mode. hidesCentre: the centre of mass and arrows that start there would give the
 * answer, so they aren't drawn until the question is answered, or until the last step is done. */
export interface LessonPlan {
  readonly steps: readonly Step[];
  readonly marks?: readonly string[];
  readonly rate?: number;
  readonly trace?: "com";
  readonly plots: readonly ("energy" | "omega" | "momentum" | "angle")[];
  readonly hidesCentre?: "question" | "end";
}

/** Shortest time between recorded instants [ns], and their largest number in a trial; beyond it every second one is
 * dropped. */
const APART_NS = 15_000_000, MOST = 4000;
/** A body is at rest if it is slower than this [rad/s, and body lengths per second] for this time [ns]; a swinging body
 * is slow at each turning point. */
const REST_SPEED = 0.03, REST_NS = 600_000_000;
/** Largest number of recorded trials; steps compare with earlier ones. */
const MOST_TRIALS = 40;

interface Open { start: Values; script: readonly Entry[]; seen: Seen[] }

/** A running lesson: the answer, the number of completed steps, and the record. */
export class Lesson {
  readonly name: string;
  readonly texts: LessonTexts;
  readonly plan: LessonPlan;
  readonly lines: ChalkLine[] = [];
  /** Index of the user's choice, or null. */
  answer: number | null = null;
  /** Number of completed steps. */
  done = 0;
  readonly scene: Values;
  readonly #motion: Motion;
  #trials: Open[] = [];
  #trial = 0;
  #from = 0;

  constructor(name: string, texts: LessonTexts, plan: LessonPlan, motion: Motion) {
    this.name = name;
    this.texts = texts;
    this.plan = plan;
    this.#motion = motion;
    this.scene = motion.values();
    this.restarted();
  }

  get finished(): boolean { return this.answer !== null && this.done === this.plan.steps.length; }

  /** Whether the centre of mass and everything that shows it is hidden. */
  get hidesCentre(): boolean {
    const { hidesCentre } = this.plan;
    return hidesCentre === "end" ? !this.finished : hidesCentre === "question" && this.answer === null;
  }

  /** Record that the motion was restarted. */
  restarted(): void {
    this.#trials.push({ start: this.#motion.values(), script: [], seen: [] });
    if (this.#trials.length > MOST_TRIALS) {
      this.#trials.shift();
      this.#trial = Math.max(0, this.#trial - 1);
    }
    this.note();
  }

  /** Answer the question and start the steps; returns whether the answer is right. */
  choose(choice: number): boolean {
    if (this.answer === null) {
      this.answer = choice;
      this.#begin();
    }
    return this.answer === this.texts.answer;
  }

  #begin(): void {
    this.#trial = this.#trials.length - 1;
    this.#from = Math.max(0, this.#trials[this.#trial]!.seen.length - 1);
  }

  /** Check whether the present step is fulfilled, and go to the next one if it is. */
  check(sight: Sight): boolean {
    const step = this.plan.steps[this.done];
    if (this.answer === null || !step) return false;
    const account: Account = { scene: this.scene, trials: this.#trials, trial: this.#trial, from: this.#from, lines: this.lines, sight };
    if (!step.done(account)) return false;
    this.done++;
    this.#begin();
    return true;
  }

  /** Whether the body has been at rest for REST_NS. */
  get isAtRest(): boolean {
    const { seen } = this.#trials[this.#trials.length - 1]!, now = seen[seen.length - 1]?.now.timeNs ?? 0;
    const late = seen.filter(({ now: { timeNs } }) => timeNs >= now - REST_NS);
    return now > REST_NS && late.every(({ now: { body }, info }) => {
      const [x, y, z] = [body.row[7]!, body.row[8]!, body.row[9]!];
      return Math.hypot(x, y, z) < REST_SPEED * info.length && Math.hypot(...body.omega) < REST_SPEED;
    });
  }

  /** Record the present instant; call it once per frame. */
  note(): void {
    const motion = this.#motion, now = motion.snapshot(), { script, endNs } = motion.history(), trial = this.#trials[this.#trials.length - 1]!, { seen } = trial;
    // After a change in the past, later instants belong to a discarded flight.
    while (seen.length && seen[seen.length - 1]!.now.timeNs > endNs) seen.pop();
    if (this.#trial === this.#trials.length - 1) this.#from = Math.min(this.#from, Math.max(0, seen.length - 1));
    const last = seen[seen.length - 1], entries = now.timeNs >= endNs ? script.length : script.filter((entry) => (entry.t ?? 0) * 1e9 <= now.timeNs).length;
    trial.script = script;
    if (last && now.timeNs < last.now.timeNs) return;
    const values = motion.values(), info = motion.body();
    if (last && entries === last.entries && now.timeNs - last.now.timeNs < APART_NS) return;
    seen.push({ now, info, values, entries });
    if (seen.length > MOST) {
      trial.seen = seen.filter((_, k) => k % 2 === 0);
      if (this.#trial === this.#trials.length - 1) this.#from >>= 1;
    }
  }
}
