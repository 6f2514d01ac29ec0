// SPDX-License-Identifier: MIT
//
// The page: a motion, its picture, pointer and panel, and the loop that connects them.

import { addressOf } from "./address.ts";
import { Clock } from "./clock.ts";
import { Data } from "./data.ts";
import { inside } from "./file.ts";
import { LANGUAGES } from "./languages.ts";
import type { LessonTexts } from "./lessons.ts";
import { LESSON_PLANS } from "./lessons_steps.ts";
import { isLive, openLive } from "./live.ts";
import { Panel, type Desk, type Look } from "./panel.ts";
import { icon, make, say } from "./panel_elements.ts";
import { HandPane } from "./panel_hand.ts";
import { LessonPanel } from "./panel_lesson.ts";
import { direction } from "./panel_measure.ts";
import { Picture, type Blow, type Shown } from "./picture.ts";
import { Track } from "./plots.ts";
import { herpolhode } from "./poinsot.ts";
import { Pointer } from "./pointer.ts";
import { printsSheet } from "./print.ts";
import { openMotion } from "./simulation.ts";
import type { Motion, Snapshot, Vec3 } from "./source.ts";
import { language, words } from "./words.ts";

/** [ns simulated], [s of the wall clock] How long the arrow of an impulse, which acts at an instant, is shown. */
const BLOW_NS = 150_000_000, BLOW_S = 0.5;
/** [rad/s] Angular velocity given to an opened body without one. */
const SPIN = 5;
/** [s] Length of a point's trace. */
const TRACE_S = 8;
/** [ms] How long frames are drawn after the last change, so that animations of camera and arrows can finish. */
const AWAKE_MS = 2500;
/** [s] How long the hand's hint is shown. */
const HINT_S = 9;
const HAND = "M9 11V4.500a1.500 1.500 0 0 1 3 0V10h.6V8.800a1.400 1.400 0 0 1 2.800 0V11h.6V9.700a1.400 1.400 0 0 1 2.800 0V12h.4v-.9a1.300 1.300 0 0 1 2.600 0V16c0 4-2.600 6.500-6.300 6.500-3.200 0-4.700-1.400-6.300-3.800L5.300 14a1.500 1.500 0 0 1 2.400-1.800L9 13.600z";

interface Impulse extends Blow { readonly timeNs: number }

/** The page's internals, for tests and measurements. */
export interface Probe {
  readonly motion: Motion;
  readonly picture: Picture;
  readonly clock: Clock;
  readonly pointer: Pointer;
  readonly lessons: LessonPanel;
  /** [ms] Times at which the script started, the motion and the renderer were ready, and the first frame and the first
   * frame after simulated time 0 were drawn. */
  readonly times: { readonly script: number; readonly motion: number; drawing: number; first: number; moving: number };
  /** [ms] Times of the frames, and latencies from a drag's event to its frame. */
  readonly pictures: number[];
  readonly drags: number[];
}

function begin(motion: Motion, texts: Readonly<Record<string, LessonTexts>>, forms: Desk["forms"], address: string, app: HTMLElement, scriptMs: number): Probe {
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const stage = make("div", { id: "stage", tabindex: 0, role: "application", "aria-label": words.picture.name }), labels = make("div", { id: "labels", "aria-hidden": "true" });
  const aim = make("div", { class: "label", hidden: true }, "⊕"), hint = make("div", { id: "hint", "aria-hidden": "true" }, icon(HAND), words.picture.pull);
  labels.append(hint, aim);
  app.replaceChildren(stage, labels);
  const motionMs = performance.now(), picture = new Picture(stage, labels), drawingMs = performance.now();

  let track = new Track(), changed = true, gravity: Vec3 = [0, 0, 0], impulses: Impulse[] = [], moved = true;
  const look: Look = { apart: false, boundingBox: false, inertiaBox: false, ellipsoid: false, principal: false, poinsot: false, cones: false, turned: null, trace: null, chalk: [], protractor: null, kept: null };
  const waiting = new Map<string, () => void>();
  const told = (refusal: string | null): boolean => { if (refusal) say(refusal); return !refusal; };
  const startOver = (): void => { pointer.forget(); picture.restart(motion.snapshot()); lessons.restarted(); };
  const restart = (): void => {
    motion.reset();
    if (motion.node) return; // the node reports its restart
    startOver();
    if (!clock.held) clock.setPaused(false);
  };
  const clock = new Clock(motion, restart);
  const pointer: Pointer = new Pointer(stage, motion, picture, () => panel.impulse);
  const open = async (how: () => string | null | Promise<string | null>): Promise<void> => {
    let refusal: string | null;
    try { refusal = await how(); } catch (error) { refusal = error instanceof Error ? error.message : String(error); }
    if (!told(refusal)) return;
    lessons.opened();
    track.seen.length = 0;
    look.kept = null;
    look.chalk = [];
    look.trace = look.trace === "com" ? "com" : null;
    picture.setBody(motion.body());
    startOver();
    panel.begin();
    const notice = motion.notice();
    if (notice) say(notice, 10);
  };
  // A body opened at rest gets a spin nearly about its intermediate axis, so that it flips.
  const lively = (refusal: string | null): string | null => {
    const spin = motion.values()["initial.angular_velocity"] as readonly number[] | undefined;
    if (refusal || motion.node || !spin || spin.some((w) => w !== 0)) return refusal;
    const { axes } = motion.body(), R = motion.snapshot().body.rotation, own = [0, 1, 2].map((k) => SPIN * (axes[3 * k + 1]! + 0.02 * axes[3 * k]!));
    const refused = motion.set({ "initial.angular_velocity": [0, 1, 2].map((k) => R[3 * k]! * own[0]! + R[3 * k + 1]! * own[1]! + R[3 * k + 2]! * own[2]!) });
    motion.reset();
    return refused;
  };
  // Lessons need the page's own simulation, so there are none beside a node.
  const named = Object.entries(motion.node ? {} : texts).filter(([name]) => name in LESSON_PLANS).map(([name, { title }]) => ({ name, title }));
  const desk: Desk = { motion, picture, pointer, clock, look, restart, lessons: named, forms, track: () => track, later: (name, act) => { waiting.set(name, act); }, told, open, lively };
  const panel = new Panel(desk, () => { moved = true; }), lessons = new LessonPanel(desk, panel, texts);
  const drop = make("div", { id: "drop", hidden: true }, words.body.drop);
  app.append(panel.node, drop, make("div", { id: "say", role: "status", "aria-live": "polite" }));
  document.title = motion.node ? `${motion.node.name} – ${words.title}` : words.title;
  document.documentElement.lang = language;
  const handPane = motion.node && new HandPane(motion.node);
  if (handPane) panel.node.querySelector("#hand")!.prepend(handPane.node);

  printsSheet(app, picture, () => lessons.lesson);

  motion.hear((line) => say(line));
  motion.watch(() => { changed = true; });
  const refresh = (): void => {
    changed = false;
    const values = motion.values();
    gravity = values["gravity"] as unknown as Vec3;
    picture.setBody(motion.body());
    const { script, endNs } = motion.history();
    track.cut(endNs);
    impulses = script.flatMap((entry) => {
      if (!("impulse" in entry) || !entry.impulse || typeof entry.at !== "object" || !("point" in entry.at)) return [];
      return [{ timeNs: Math.round((entry.t ?? 0) * 1e9), point: entry.at.point, impulse: entry.impulse, axes: entry.axes ?? "world" }];
    });
    clock.changed();
    panel.changed();
    handPane?.changed();
  };
  // Any client may restart the node.
  let began = motion.node?.began ?? 0, flown = motion.body().vertices;
  const nodeRestarted = (): void => {
    began = motion.node?.began ?? 0;
    track.seen.length = 0;
    startOver();
    if (motion.body().vertices === flown) return;
    flown = motion.body().vertices;
    panel.begin();
  };
  const shownNow = (now: Snapshot): Shown => {
    const values = motion.values(), info = motion.body(), stays = Math.max(BLOW_NS * Math.min(1, clock.rate), BLOW_S * clock.rate * 1e9);
    const first = track.seen[0]?.now.body.momentum ?? null, ends = look.protractor?.map((thing) => direction(thing, now, info.axes, first));
    const traced: Vec3 | null = lessons.hidesCentre && look.trace === "com" ? null : look.trace === "com" ? (info.com.map((c, k) => c / info.scale[k]!) as unknown as Vec3) : look.trace;
    const ghost = motion.ghost();
    return {
      ...look, ...(lessons.hidesCentre ? { principal: false, ellipsoid: false, inertiaBox: false, turned: null } : {}), marks: lessons.marks(now), hidesCentre: lessons.hidesCentre, gravity, model: String(values["inertia_model"]), ghostModel: ghost.inertia_model || String(values["inertia_model"]),
      blows: impulses.filter(({ timeNs }) => timeNs <= now.timeNs && now.timeNs < timeNs + stays),
      trace: traced ? track.trace(traced, now.timeNs, TRACE_S) : null, tracePoint: traced,
      herpolhode: look.poinsot || look.cones ? herpolhode(track.seen, now) : [],
      protractor: ends?.[0] && ends[1] ? [ends[0], ends[1]] : null, kept: look.kept?.pose(now.timeNs) ?? null, aim: pointer.aim,
    };
  };

  const fit = (): void => {
    moved = false;
    const free = panel.free.getBoundingClientRect();
    picture.fit(innerWidth, innerHeight, { left: free.left, top: free.top, width: free.width, height: free.height });
  };
  addEventListener("resize", () => { moved = true; });
  new ResizeObserver(() => { moved = true; }).observe(panel.free);

  addEventListener("keydown", (event) => {
    const on = event.target as HTMLElement;
    if (event.key !== " " || /^(INPUT|SELECT|BUTTON|TEXTAREA|SUMMARY)$/.test(on.tagName)) return;
    clock.setPaused(!clock.paused);
    event.preventDefault();
  });
  const openAddress = async (hash: string): Promise<void> => {
    const { lesson, isClass, take, language: asked } = addressOf(hash);
    if (asked && asked !== language && (asked === "en" || asked in LANGUAGES)) { location.reload(); return; }
    if (take) { lessons.leave(); await open(() => motion.openLink(take)); } else told(await lessons.begin(lesson, isClass));
  };
  addEventListener("hashchange", () => { void openAddress(location.hash); });
  for (const kind of ["dragenter", "dragover"] as const) addEventListener(kind, (event) => { event.preventDefault(); drop.hidden = false; });
  addEventListener("dragleave", (event) => { if (!event.relatedTarget) drop.hidden = true; });
  addEventListener("drop", (event) => {
    event.preventDefault();
    drop.hidden = true;
    const file = event.dataTransfer?.files[0];
    if (file) panel.takeFile(file);
  });

  // A hint that the body can be grabbed, shown once.
  let hintS = HINT_S;
  pointer.touched = () => { hintS = 0; };
  const showHint = (now: Snapshot, seconds: number): void => {
    hintS = lessons.lesson ? 0 : hintS - seconds;
    hint.hidden = hintS <= 0;
    if (hint.hidden) return;
    const { row } = now.body, at = picture.eye.project(picture.eye.target.clone().set(row[0]!, row[1]!, row[2]!), picture.eye.target.clone());
    const sway = still ? 0 : Math.max(0, Math.sin((HINT_S - hintS) * 2.2)) * 34;
    hint.style.transform = `translate(${(at.x - 6 + sway).toFixed(1)}px, ${(at.y + 4 - 0.5 * sway).toFixed(1)}px)`;
  };

  const probe: Probe = { motion, picture, clock, pointer, lessons, times: { script: scriptMs, motion: motionMs, drawing: drawingMs, first: 0, moving: 0 }, pictures: [], drags: [] };
  // Without changes and input, no frames are drawn.
  let last = 0, failure = "", awakeMs = Infinity, drawnNs = -1;
  const wake = (): void => { awakeMs = performance.now() + AWAKE_MS; };
  for (const kind of ["pointerdown", "pointermove", "pointerup", "wheel", "keydown", "keyup", "input", "change", "click", "focusin"])
    addEventListener(kind, wake, { capture: true, passive: true });
  const draw = (ms: number): void => {
    const passed = last ? ms - last : 0, seconds = Math.min(0.1, passed / 1000);
    last = ms;
    if (changed || moved || waiting.size || hintS > 0 || !clock.paused || pointer.holding || motion.snapshot().timeNs !== drawnNs) wake();
    if (performance.now() > awakeMs) { requestAnimationFrame(draw); return; }
    for (const act of waiting.values()) act();
    waiting.clear();
    pointer.act();
    clock.advance(passed);
    if (changed) refresh();
    if (motion.node && (motion.node.began !== began || motion.body().vertices !== flown)) nodeRestarted();
    if (moved) fit();
    const now = motion.snapshot();
    drawnNs = now.timeNs;
    track.add(now, motion.body(), gravity);
    picture.draw(now, shownNow(now), still ? 1 : seconds, pointer.holding);
    clock.show(now.timeNs);
    panel.show(now, gravity, seconds);
    lessons.look(now);
    showHint(now, seconds);
    aim.hidden = pointer.aim === null;
    if (pointer.aim) aim.style.transform = `translate(${pointer.aim[0]}px, ${pointer.aim[1]}px) translate(-50%, -50%)`;
    if (now.body.failure !== failure) { failure = now.body.failure; if (failure) say(failure, 12); }
    if (picture.renderer?.judge(ms)) moved = true;

    const done = performance.now();
    if (pointer.waitingMs) { probe.drags.push(done - pointer.waitingMs); pointer.waitingMs = 0; if (probe.drags.length > 500) probe.drags.shift(); }
    probe.pictures.push(ms);
    if (probe.pictures.length > 600) probe.pictures.shift();
    probe.times.first ||= done;
    if (now.timeNs > 0) probe.times.moving ||= done;
    requestAnimationFrame(draw);
  };

  picture.setBody(motion.body());
  refresh();
  panel.begin();
  fit();
  picture.restart(motion.snapshot());
  if (still && !motion.node) clock.setPaused(true);
  const { lesson, isClass } = addressOf(address);
  if (lesson && !motion.node) void lessons.begin(lesson, isClass).then(told);
  if (!picture.renderer) say(words.picture.noWebGL, 12);
  requestAnimationFrame(draw);
  return probe;
}

async function start(): Promise<void> {
  const scriptMs = performance.now(), app = document.getElementById("app")!;
  try {
    const [kernels, data, take] = await Promise.all([inside("kernels"), inside("data"), inside("take")]);
    if (!kernels || !data) throw new Error(words.picture.incomplete);
    const motion = isLive() ? await openLive(kernels, data) : await openMotion(kernels, data, take);
    // A file written for a lesson opens with it.
    const address = location.hash || (take ? "" : document.querySelector<HTMLMetaElement>("meta[name=begin]")?.content ?? ""), asked = addressOf(address);
    const refusal = asked.take ? await motion.openLink(asked.take) : null;
    // Without a take, the first screen compares the body with the ghost of its bounding box's tensor.
    if (!take && !asked.take && !motion.node) motion.setGhost({ inertia_model: "bounding_box" });
    const { lessons, forms } = new Data(data).declared;
    const probe = begin(motion, { ...lessons, ...LANGUAGES[language]?.lessons }, forms, address, app, scriptMs);
    if (refusal ?? motion.notice()) say(refusal ?? motion.notice(), 12);
    Object.assign(window, { page: probe });
  } catch (error) {
    app.replaceChildren(make("p", { id: "fault", role: "alert" }, words.picture.broken(error instanceof Error ? error.message : String(error))));
  }
}

void start();
