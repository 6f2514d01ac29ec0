// SPDX-License-Identifier: MIT
//
// Time: play, slow motion, steps, seeking back and continuing from there; and its bar.

import { button, icon, make, say } from "./panel_elements.ts";
import type { Entry, Motion } from "./source.ts";
import { words } from "./words.ts";

const RATES = [1, 0.5, 0.25, 0.1, 0.02] as const;
const STEP_NS = 10_000_000, BACK_NS = 2_000_000_000;
/** [ms of the wall clock] Longest time by which a frame advances the motion; a longer gap, such as of a hidden page, is
 * skipped. */
const MOST_MS = 100;
/** [ns] Frames are at multiples of this time, which is too short to be seen, so that a link has short times of
 * commands. */
const GRAIN_NS = 100_000;
/** [ms] Shortest period of updating the bar, since an update makes the browser lay it out again. */
const READ_MS = 90;
/** [s] Span of the bar; it is doubled as often as necessary. */
const SPAN_S = 10;

const PLAY = "M7 4v16l13-8z", PAUSE = "M6 4h4.5v16H6zM13.5 4H18v16h-4.5z", STEP = "M5 4v16l11-8zM17 4h3v16h-3z";
const RESET = "M12 5V1.5L6.5 6.5 12 11.500V8a5.500 5.500 0 1 1-5.500 5.500H3.500A8.500 8.500 0 1 0 12 5z";

export class Clock {
  paused = false;
  /** Why time is paused and can't be resumed, or "". */
  held = "";
  rate: number = RATES[0];
  readonly node: HTMLElement;
  private readonly playing: HTMLButtonElement;
  private readonly rates: HTMLSelectElement;
  private readonly scrub: HTMLInputElement;
  private readonly marks: HTMLElement;
  private readonly text: HTMLElement;
  private readonly onward: HTMLButtonElement;
  private readonly motion: Motion;
  private scrubbing = false;
  private span = SPAN_S;
  private shownText = "";
  private stale = true;
  private wanted: number | null = null;
  private owedNs = 0;
  private readMs = 0;

  constructor(motion: Motion, reset: () => void) {
    this.motion = motion;
    this.playing = button("", () => this.setPaused(!this.paused), { class: "round play", id: "play" });
    const { node } = motion;
    this.rates = make("select", { "aria-label": words.time.rate, title: words.time.rate, change: () => {
      if (node) node.setRate(Number(this.rates.value)); else this.rate = Number(this.rates.value);
    } },
      ...RATES.map((rate) => make("option", { value: rate }, words.time.rates[RATES.indexOf(rate)]!)));
    this.scrub = make("input", { type: "range", min: 0, max: 1000, step: 1, value: 0, "aria-label": words.time.scrub });
    this.scrub.addEventListener("pointerdown", () => { this.scrubbing = true; });
    for (const end of ["pointerup", "pointercancel", "blur"]) this.scrub.addEventListener(end, () => { this.scrubbing = false; });
    this.scrub.addEventListener("input", () => { this.wanted = (Number(this.scrub.value) / 1000) * this.span * 1e9; });
    // Keys move by one second, independent of the bar's span.
    this.scrub.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -5, PageUp: 5 }[event.key];
      const end = this.motion.history().endNs, now = this.motion.snapshot().timeNs;
      if (by !== undefined) this.wanted = now + by * (event.shiftKey ? 1e8 : 1e9);
      else if (event.key === "Home") this.wanted = 0;
      else if (event.key === "End") this.wanted = end;
      else return;
      event.preventDefault();
    });
    this.marks = make("div", { class: "marks", "aria-hidden": "true" });
    this.text = make("span", { id: "clock" });
    this.onward = motion.can.goOn
      ? button(words.time.goOn, () => { this.motion.goOn(); this.setPaused(false); }, { id: "onward", title: words.time.goOnTitle })
      : button(words.live.now, () => { this.wanted = null; this.motion.goOn(); }, { id: "onward", title: words.live.nowTitle });
    const step = node ? words.live.step : words.time.step;
    this.node = make("div", { id: "time", role: "group", "aria-label": words.time.name },
      button(words.time.back, () => { this.wanted = this.motion.snapshot().timeNs - BACK_NS; }, { class: "round", title: words.time.backTitle, "aria-label": words.time.backTitle }),
      this.playing,
      button(icon(STEP), () => this.step(), { class: "round", title: step, "aria-label": step, id: "step" }),
      this.rates, make("div", { class: "scrub" }, this.scrub, this.marks), this.text, this.onward,
      button(icon(RESET), reset, { class: "round reset", title: words.time.reset, "aria-label": words.time.reset, id: "reset" }));
    this.showPaused(node?.paused ?? false);
  }

  setPaused(paused: boolean): void {
    if (this.held && !paused) { say(this.held); return; }
    if (this.motion.node) this.motion.node.setPaused(paused); else this.showPaused(paused);
  }

  private showPaused(paused: boolean): void {
    this.paused = paused;
    this.playing.replaceChildren(icon(paused ? PLAY : PAUSE));
    const name = paused ? words.time.play : words.time.pause;
    this.playing.setAttribute("aria-label", name);
    this.playing.title = name;
  }

  setRate(rate: number): void {
    this.rate = rate;
    this.rates.value = String(rate);
  }

  step(): void {
    if (this.held) { say(this.held); return; }
    const { node } = this.motion;
    if (node) { if (!node.paused) node.setPaused(true); node.step(); return; }
    this.setPaused(true);
    this.motion.advance(this.motion.snapshot().timeNs + STEP_NS);
  }

  /** Advance the motion; milliseconds: wall time since the last frame. */
  advance(milliseconds: number): void {
    if (this.wanted !== null) {
      this.motion.goTo(Math.round(Math.max(0, Math.min(this.motion.history().endNs, this.wanted))));
      this.wanted = null;
      return;
    }
    if (this.paused || this.scrubbing || this.motion.node) return;
    const nowNs = this.motion.snapshot().timeNs, passedNs = this.owedNs + Math.round(Math.min(MOST_MS, Math.max(0, milliseconds)) * 1e6 * this.rate);
    const untilNs = Math.max(nowNs, Math.floor((nowNs + passedNs) / GRAIN_NS) * GRAIN_NS);
    this.motion.advance(untilNs);
    this.owedNs = nowNs + passedNs - untilNs;
  }

  /** The history has changed, so marks must be updated; or a node's time was paused, resumed or changed its rate. */
  changed(): void {
    this.stale = true;
    const { node } = this.motion;
    if (!node) return;
    if (node.paused !== this.paused) this.showPaused(node.paused);
    if (node.rate === this.rate && this.rates.value === String(node.rate)) return;
    this.rate = node.rate;
    if (!RATES.some((rate) => rate === node.rate)) this.rates.append(make("option", { value: node.rate }, words.live.rate(node.rate)));
    this.rates.value = String(node.rate);
  }

  show(timeNs: number): void {
    const clock = performance.now();
    if (clock - this.readMs < READ_MS) return;
    this.readMs = clock;
    const end = this.motion.history().endNs, seconds = timeNs * 1e-9;
    let span = SPAN_S;
    while (span < Math.max(end, timeNs) * 1e-9) span *= 2;
    if (span !== this.span) { this.span = span; this.stale = true; }
    const at = String(Math.round((1000 * seconds) / span));
    if (!this.scrubbing && this.scrub.value !== at) this.scrub.value = at;
    this.scrub.style.setProperty("--at", `calc(0.75rem + ${((100 * seconds) / span).toFixed(1)}% - ${((1.5 * seconds) / span).toFixed(3)}rem)`);
    const text = words.time.seconds(seconds);
    if (text !== this.shownText) { this.text.textContent = this.shownText = text; this.scrub.setAttribute("aria-valuetext", text); }
    this.onward.hidden = timeNs >= end;
    if (this.stale) { this.stale = false; this.mark(); }
  }

  private mark(): void {
    const { script } = this.motion.history(), marks: HTMLElement[] = [];
    let tied: number | null = null, before = -1;
    const at = (s: number): string => `${((100 * s) / this.span).toFixed(2)}%`;
    const finish = (end: number): void => {
      if (tied === null) return;
      const mark = make("i", { class: "span" });
      mark.style.left = at(tied);
      mark.style.width = `max(3px, ${at(end - tied)})`;
      marks.push(mark);
      tied = null;
    };
    for (const entry of script) {
      const t = entry.t ?? 0, kind = kindOf(entry);
      if (kind === "pull") { tied ??= t; continue; }
      if (kind === "release") { finish(t); continue; }
      if (kind === "change" && (t - before) / this.span < 0.005) continue;
      if (kind === "change") before = t;
      const mark = make("i", { class: kind });
      mark.style.left = at(t);
      marks.push(mark);
    }
    finish(Math.min(this.span, this.motion.history().endNs * 1e-9));
    this.marks.replaceChildren(...marks);
  }
}

function kindOf(entry: Entry): "pull" | "release" | "change" | "poke" {
  if ("string" in entry) return entry.string === "release" ? "release" : "pull";
  return "set" in entry || "state" in entry ? "change" : "poke";
}
