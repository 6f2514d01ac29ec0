// SPDX-License-Identifier: MIT
//
// What a lesson is, what it takes note of, and how far it has come. Nothing here knows the page: Node plays lessons, too.
// What each lesson's steps are about stands in lessons_steps.ts, its texts in the head of its scene.

import type { BodyInfo, Entry, Motion, Snapshot, Values, Vec3 } from "./source.ts";
import type { Words } from "./words.ts";

/** A lesson's texts, as rigid_proto_ros/page/data.py writes them from the head of its scene. answer: number of a choice. */
export interface LessonTexts {
  readonly title: string;
  readonly question: string;
  readonly choices: readonly string[];
  readonly answer: number;
  readonly steps: readonly string[];
  readonly reason: string;
}

/** An instant as it was seen. entries: how many of the trial's script had acted. */
export interface Seen {
  readonly now: Snapshot;
  readonly info: BodyInfo;
  readonly values: Values;
  readonly entries: number;
}

/** One flight from a start on. start: the values in force then. */
export interface Trial {
  readonly start: Values;
  readonly script: readonly Entry[];
  readonly seen: readonly Seen[];
}

/** A line drawn in chalk while the string was at rest: through the knot along the string. [mesh], both. */
export interface ChalkLine { readonly point: Vec3; readonly along: Vec3 }

/** What one has chosen to see beside the motion. */
export interface Sight {
  readonly turned: readonly number[] | null;
  readonly principal: boolean;
  readonly apart: boolean;
  readonly trace: Vec3 | "com" | null;
  /** names of cards that are open */
  readonly cards: readonly string[];
}

/** What a step's condition is about. scene: the values with which the lesson began. trials: since then, the last one is
 * the present one. trial, from: when the step began, the number of a trial and of the first instant in it. */
export interface Account {
  readonly scene: Values;
  readonly trials: readonly Trial[];
  readonly trial: number;
  readonly from: number;
  readonly lines: readonly ChalkLine[];
  readonly sight: Sight;
}

/** What a step's button does. poke: at a contact or "com", along [body axes]; fresh: from the start anew. start, set:
 * these values, start from the scene's start anew. card: opens it and marks the element. pull, press, tie: lead to the picture. */
export type Act = { readonly text: (words: Words["lesson"]) => string } & (
  | { readonly kind: "poke"; readonly at: string; readonly along: Vec3; readonly fresh?: boolean }
  | { readonly kind: "start" | "set"; readonly values: (scene: Values, info: BodyInfo) => Values }
  | { readonly kind: "card"; readonly card: "body" | "tensor" | "world" | "measure" | "ghost"; readonly mark: string }
  | { readonly kind: "trace"; readonly at: string }
  | { readonly kind: "again" | "pull" | "press" | "tie" | "chalk" | "principal" }
);

export interface Step {
  /** Whether what the step is about has happened. */
  readonly done: (account: Account) => boolean;
  readonly acts: readonly Act[];
}

/** What a lesson needs of the page. marks: contacts, or "com", whose places are marked in the picture. rate: of time.
 * trace: of a point from the answer on. plots: in class mode. hidesCentre: the centre of mass and the arrows that begin in
 * it aren't drawn until the question is answered, or until the last step is done, where they would answer it. */
export interface Course {
  readonly steps: readonly Step[];
  readonly marks?: readonly string[];
  readonly rate?: number;
  readonly trace?: "com";
  readonly plots: readonly ("energy" | "omega" | "momentum" | "angle")[];
  readonly hidesCentre?: "question" | "end";
}

/** [ns] Instants that are kept lie this far apart, and there are this many of a trial; then every second one goes. */
const APART_NS = 15_000_000, MOST = 4000;
/** At rest: so slow [rad/s, and body lengths a second] for so long [ns]. A body that swings stands still at each turn. */
const REST_SPEED = 0.03, REST_NS = 600_000_000;
/** Trials that are kept: comparisons are with the one before. */
const MOST_TRIALS = 40;

interface Open { start: Values; script: readonly Entry[]; seen: Seen[] }

/** A lesson under way: what was answered, how many steps are done, and what was seen. */
export class Lesson {
  readonly name: string;
  readonly texts: LessonTexts;
  readonly course: Course;
  readonly lines: ChalkLine[] = [];
  /** The choice, once there is one. */
  answer: number | null = null;
  /** How many steps are done, one after the other. */
  done = 0;
  readonly scene: Values;
  readonly #motion: Motion;
  #trials: Open[] = [];
  #trial = 0;
  #from = 0;

  constructor(name: string, texts: LessonTexts, course: Course, motion: Motion) {
    this.name = name;
    this.texts = texts;
    this.course = course;
    this.#motion = motion;
    this.scene = motion.values();
    this.restarted();
  }

  get finished(): boolean { return this.answer !== null && this.done === this.course.steps.length; }

  /** Whether the centre of mass, and what shows it, is hidden. */
  get hidesCentre(): boolean {
    const { hidesCentre } = this.course;
    return hidesCentre === "end" ? !this.finished : hidesCentre === "question" && this.answer === null;
  }

  /** The motion stands at a start. */
  restarted(): void {
    this.#trials.push({ start: this.#motion.values(), script: [], seen: [] });
    if (this.#trials.length > MOST_TRIALS) {
      this.#trials.shift();
      this.#trial = Math.max(0, this.#trial - 1);
    }
    this.note();
  }

  /** Answer the question: steps count from now on. Returns whether it is right. */
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

  /** Whether a step is done now. */
  check(sight: Sight): boolean {
    const step = this.course.steps[this.done];
    if (this.answer === null || !step) return false;
    const account: Account = { scene: this.scene, trials: this.#trials, trial: this.#trial, from: this.#from, lines: this.lines, sight };
    if (!step.done(account)) return false;
    this.done++;
    this.#begin();
    return true;
  }

  /** Whether the body has been at rest for a while, on its string. */
  get isAtRest(): boolean {
    const { seen } = this.#trials[this.#trials.length - 1]!, now = seen[seen.length - 1]?.now.timeNs ?? 0;
    const late = seen.filter(({ now: { timeNs } }) => timeNs >= now - REST_NS);
    return now > REST_NS && late.every(({ now: { body }, info }) => {
      const [x, y, z] = [body.row[7]!, body.row[8]!, body.row[9]!];
      return Math.hypot(x, y, z) < REST_SPEED * info.length && Math.hypot(...body.omega) < REST_SPEED;
    });
  }

  /** Take note of this instant; more often than pictures is never needed. */
  note(): void {
    const motion = this.#motion, now = motion.snapshot(), { script, endNs } = motion.history(), trial = this.#trials[this.#trials.length - 1]!, { seen } = trial;
    // What came after was dropped: it is another flight from there on.
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
