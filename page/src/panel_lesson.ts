// SPDX-License-Identifier: MIT
//
// The panel of a lesson: its question, then its steps with their buttons; in class mode, as an overlay over the
// picture.

import { addressOf, hashOf } from "./address.ts";
import { lineOnBody } from "./chalk.ts";
import { Lesson, type Act, type LessonTexts, type Sight } from "./lessons.ts";
import { LESSON_PLANS } from "./lessons_steps.ts";
import type { Desk, Panel } from "./panel.ts";
import { button, icon, make, say } from "./panel_elements.ts";
import type { Mark } from "./picture.ts";
import { Plots } from "./plots.ts";
import type { Snapshot, Vec3 } from "./source.ts";
import { words } from "./words.ts";

/** [ms] Period of checking a step's condition, which may evaluate the whole record. */
const LOOK_MS = 100;
const DOWN = "M7 10l5 5 5-5z", TICK = "M9 16.200 4.800 12l-1.400 1.400L9 19 21 7l-1.400-1.400z", SCREEN = "M3 4h18v13H3zM5 6v9h14V6zM8 19h8v2H8z";

export class LessonPanel {
  readonly node = make("section", { id: "lesson", class: "card", "aria-labelledby": "question" });
  /** Plots beside the body in class mode. */
  readonly plots = make("div", { id: "class-plots", class: "card", hidden: true });
  lesson: Lesson | null = null;
  private readonly desk: Desk;
  private readonly panel: Panel;
  private readonly texts: Readonly<Record<string, LessonTexts>>;
  /** The step just completed, for screen readers. */
  private readonly told = make("div", { id: "told", class: "out", role: "status", "aria-live": "polite" });
  private drawn: Plots | null = null;
  private lookedMs = 0;
  private isClass = false;
  private isOpening = false;

  constructor(desk: Desk, panel: Panel, texts: Readonly<Record<string, LessonTexts>>) {
    this.desk = desk;
    this.panel = panel;
    this.texts = texts;
    panel.node.append(this.plots, this.told);
    addEventListener("keydown", (event) => {
      const choice = "abc".indexOf(event.key.toLowerCase());
      if (choice < 0 || !this.lesson || this.lesson.answer !== null || event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT|TEXTAREA)$/.test((event.target as HTMLElement).tagName)) return;
      this.answer(choice);
      event.preventDefault();
    });
  }

  /** Start the lesson that the address names, or leave the present one. Returns a refusal, or null. */
  async begin(name: string, isClass: boolean): Promise<string | null> {
    const texts = this.texts[name], plan = LESSON_PLANS[name], { desk } = this, { motion, clock, look } = desk, hadFocus = document.activeElement !== document.body;
    if (name === "") { this.leave(); return null; }
    if (!texts || !plan) return words.lesson.unknown(name);
    this.leave();
    let refusal: string | null = null;
    this.isOpening = true;
    await desk.open(() => (refusal = motion.openScene(name)));
    this.isOpening = false;
    if (refusal) return refusal;
    this.lesson = new Lesson(name, texts, plan, motion);
    clock.setRate(plan.rate ?? 1);
    clock.setPaused(true);
    clock.held = words.lesson.first;
    look.trace = null;
    look.principal = look.poinsot = look.cones = false;
    desk.pointer.pulls = motion.values()["string.attached"] !== true;
    this.drawn = new Plots(desk.track(), plan.plots);
    this.plots.replaceChildren(this.drawn.node);
    this.panel.hold(this.node);
    this.setClass(isClass);
    this.write();
    document.title = `${texts.title} – ${words.title}`;
    if (hadFocus && document.activeElement === document.body) this.heading()?.focus({ preventScroll: true });
    return null;
  }

  leave(): void {
    if (!this.lesson) return;
    this.lesson = null;
    this.desk.clock.held = "";
    this.desk.pointer.pulls = true;
    this.desk.pointer.claim = null;
    this.panel.hold(null);
    this.setClass(false);
    document.title = words.title;
  }

  /** Another take was opened: end the lesson, which needs its own scene. */
  opened(): void {
    if (this.isOpening || !this.lesson) return;
    this.leave();
    history.replaceState(null, "", hashOf({ language: addressOf(location.hash).language }));
  }

  /** The motion was restarted. */
  restarted(): void { this.lesson?.restarted(); }

  get hidesCentre(): boolean { return this.lesson?.hidesCentre ?? false; }

  /** Marks of the places that the steps name. */
  marks(now: Snapshot): readonly Mark[] {
    const { lesson } = this, { contacts } = this.desk.motion.body(), { com, scale } = now.body;
    if (!lesson) return [];
    const names = lesson.finished && lesson.plan.hidesCentre === "end" ? ["com"] : lesson.plan.marks ?? [];
    return names.flatMap((name): Mark[] => {
      const point = name === "com" ? (com.map((c, k) => c / scale[k]!) as unknown as Vec3) : contacts[name];
      return point ? [{ point, text: words.lesson.places[name] ?? name, isCentre: name === "com" }] : [];
    });
  }

  /** Record the present instant and check the step; called once per frame. */
  look(now: Snapshot): void {
    const { lesson } = this, ms = performance.now();
    lesson?.note();
    if (!lesson || ms - this.lookedMs < LOOK_MS) return;
    this.lookedMs = ms;
    if (this.isClass) this.drawn?.draw(now.timeNs);
    if (!lesson.check(this.sight())) return;
    this.write();
    this.told.textContent = `${words.lesson.done(lesson.done, lesson.plan.steps.length)} ${lesson.finished ? words.lesson.finished : lesson.texts.steps[lesson.done] ?? ""}`;
  }

  private sight(): Sight {
    const { turned, principal, poinsot, apart, trace } = this.desk.look;
    return { turned, principal, poinsot, apart, trace, ghost: this.desk.motion.ghost(), cards: this.panel.opened() };
  }

  private heading(): HTMLElement | null { return this.node.querySelector<HTMLElement>("#question"); }

  private answer(choice: number): void {
    const { lesson, desk } = this;
    if (!lesson || lesson.answer !== null) return;
    if (desk.motion.history().script.length || desk.motion.snapshot().timeNs) desk.restart();
    const isRight = lesson.choose(choice), { answer, choices, reason } = lesson.texts;
    desk.clock.held = "";
    if (lesson.plan.trace) desk.look.trace = lesson.plan.trace;
    desk.clock.setPaused(false);
    this.write();
    this.told.textContent = `${isRight ? words.lesson.right : words.lesson.wrong(words.lesson.letters[answer]!, choices[answer]!)} ${reason}`;
    this.node.querySelector<HTMLElement>(".verdict")?.focus({ preventScroll: true });
  }

  /** Rebuild the whole card; the focus is kept. */
  private write(): void {
    const { lesson } = this, w = words.lesson;
    if (!lesson) return;
    const { texts, plan } = lesson, focused = document.activeElement instanceof HTMLElement && this.node.contains(document.activeElement) ? document.activeElement.dataset["key"] : undefined;
    const picker = make("select", { "aria-label": w.name, "data-key": "picker", change: () => { location.hash = hashOf({ language: addressOf(location.hash).language, lesson: picker.value, isClass: this.isClass && picker.value !== "" }); } },
      make("option", { value: "" }, `– ${w.none} –`), ...Object.entries(this.texts).filter(([name]) => name in LESSON_PLANS).map(([name, { title }]) => make("option", { value: name, selected: name === lesson.name }, title)));
    // Browsers truncate long titles in a select, so the chosen title is shown over it, in as many lines as needed.
    const head = make("div", { class: "head" }, make("div", { class: "picker" }, picker, make("span", { "aria-hidden": "true" }, texts.title, icon(DOWN))),
      button(icon(SCREEN), () => this.toggleClass(), { class: "close", "aria-pressed": String(this.isClass), "aria-label": w.class, title: w.classTitle, "data-key": "class" }),
      button("×", () => { location.hash = hashOf({ language: addressOf(location.hash).language }); }, { class: "close", "aria-label": w.leave, title: w.leave, "data-key": "leave" }));
    const question = make("h2", { id: "question", class: lesson.answer === null ? "" : "out", tabindex: -1, "data-key": "question" }, texts.question);
    this.node.replaceChildren(head, question, ...(lesson.answer === null ? [this.choices(texts)] : this.steps(lesson, plan.steps.length)));
    this.node.classList.toggle("asks", lesson.answer === null);
    if (lesson.done > 0) this.node.querySelector(".now, .end")?.scrollIntoView({ block: "nearest" }); else this.node.scrollTop = 0;
    const again = focused === undefined ? null : this.node.querySelector<HTMLElement>(`[data-key="${focused}"]`) ?? this.node.querySelector<HTMLElement>('[data-key="act0"]') ?? this.heading();
    again?.focus({ preventScroll: true });
  }

  private choices({ choices }: LessonTexts): HTMLElement {
    return make("div", { class: "choices", role: "group", "aria-labelledby": "question" }, ...choices.map((choice, k) =>
      make("button", { type: "button", class: "choice", "data-key": `choice${k}`, click: () => this.answer(k) }, make("b", {}, words.lesson.letters[k]!), make("span", {}, choice))));
  }

  private steps({ answer, texts, plan, done, finished }: Lesson, count: number): HTMLElement[] {
    const w = words.lesson, isRight = answer === texts.answer;
    const said = make("b", {}, isRight ? w.right : w.wrong(w.letters[texts.answer]!, texts.choices[texts.answer]!)), attributes = { class: `verdict ${isRight ? "good" : "bad"}`, "data-key": "verdict" };
    // The reason is shown until the first step is done; then the steps take its space.
    const verdict = done === 0 || finished ? make("div", { ...attributes, tabindex: -1 }, said, make("p", { class: "reason" }, texts.reason))
      : make("details", attributes, make("summary", {}, said, " ", make("span", { class: "why" }, w.why)), make("p", { class: "reason" }, texts.reason));
    const list = make("ol", { class: "steps", "aria-label": w.steps }, ...Array.from({ length: count }, (_, k) => {
      const state = k < done ? "done" : k === done ? "now" : "";
      return make("li", { class: state, ...(state === "now" ? { "aria-current": "step" } : {}) },
        make("span", { class: "mark" }, k < done ? icon(TICK) : String(k + 1), k < done && make("span", { class: "out" }, w.ticked)), make("span", {}, texts.steps[k] ?? ""),
        k === done && make("div", { class: "row" }, ...(plan.steps[k]?.acts ?? []).map((act, n) => button(act.text(w), () => this.act(act), { "data-key": `act${n}` }))));
    }));
    return [verdict, list, ...(finished ? [make("p", { class: "good end" }, w.finished, " ", button(w.anew, () => { void this.begin(this.lesson!.name, this.isClass); }, { "data-key": "act0" }))] : [])];
  }

  /** Perform the action of a step's button. */
  private act(act: Act): void {
    const { desk, lesson } = this, { motion, look, pointer } = desk, w = words.lesson;
    if (!lesson) return;
    const stage = (how: string): void => { say(how, 8); document.getElementById("stage")?.focus({ preventScroll: true }); };
    if (act.kind === "poke") {
      if (act.fresh) desk.restart();
      desk.told(motion.submit({ at: act.at, impulse: act.along.map((x) => x * this.panel.impulse) as unknown as Vec3, axes: "body" }));
    } else if (act.kind === "set") desk.told(motion.set(act.values(lesson.scene, motion.body())));
    else if (act.kind === "start") { if (desk.told(motion.set(act.values(lesson.scene, motion.body())))) desk.restart(); }
    else if (act.kind === "again") desk.restart();
    else if (act.kind === "card") this.panel.lead(act.card, act.mark);
    else if (act.kind === "pull") stage(w.pullHow);
    else if (act.kind === "press") stage(w.pressHow);
    else if (act.kind === "trace") look.trace = motion.body().contacts[act.at] ?? null;
    else if (act.kind === "principal") { look.principal = true; this.panel.changed(); }
    else if (act.kind === "poinsot") { look.poinsot = true; this.panel.changed(); }
    else if (act.kind === "ghost") { if (desk.told(motion.setGhost(act.choice))) desk.restart(); }
    else if (act.kind === "tie") {
      stage(w.tieHow);
      pointer.claim = ({ mesh }) => { desk.told(motion.set({ "string.attach": mesh })); desk.clock.setPaused(false); };
    } else this.chalk();
    if (act.kind === "poke" || act.kind === "set") desk.clock.setPaused(false);
  }

  /** Draw the string's line on the body if it hangs at rest. */
  private chalk(): void {
    const { desk, lesson } = this, { body } = desk.motion.snapshot(), { string } = body;
    if (!string) { say(words.lesson.untied); return; }
    if (!lesson?.isAtRest) { say(words.lesson.swings); return; }
    const way = string.end.map((x, k) => x - string.knot[k]!), length = Math.hypot(...way), along = way.map((x) => x / length) as unknown as Vec3, { rotation: R, scale } = body;
    desk.look.chalk = [...desk.look.chalk, ...lineOnBody(desk.motion, string.knot, along)];
    lesson.lines.push({ point: string.attach, along: [0, 1, 2].map((k) => (R[k]! * along[0] + R[3 + k]! * along[1] + R[6 + k]! * along[2]) / scale[k]!) as unknown as Vec3 });
  }

  // Class mode

  private toggleClass(): void {
    this.setClass(!this.isClass);
    history.replaceState(null, "", hashOf({ ...addressOf(location.hash), lesson: this.lesson?.name ?? "", isClass: this.isClass, take: "" }));
    // A browser may refuse full screen; class mode works without it.
    if (this.isClass) void document.documentElement.requestFullscreen?.().catch(() => undefined);
    else if (document.fullscreenElement) void document.exitFullscreen().catch(() => undefined);
    this.write();
  }

  private setClass(on: boolean): void {
    this.isClass = on;
    document.body.classList.toggle("class", on);
    this.plots.hidden = !on;
    this.panel.changedSize();
  }
}
