// SPDX-License-Identifier: MIT
//
// The first screen: the tensor switch, body controls and readings; and the cards that open beside the picture.

import type { Clock } from "./clock.ts";
import type { Form } from "./data.ts";
import { bodyCard } from "./panel_body.ts";
import { button, icon, make, say, slider, type Slider } from "./panel_elements.ts";
import { ghostCard } from "./panel_ghost.ts";
import { keepCard } from "./panel_keep.ts";
import { lessonsCard } from "./panel_lessons.ts";
import { measureCard } from "./panel_measure.ts";
import { tensorCard } from "./panel_tensor.ts";
import { worldCard } from "./panel_world.ts";
import type { Picture } from "./picture.ts";
import { energies, Plots, type Track } from "./plots.ts";
import type { Pointer } from "./pointer.ts";
import type { Bundled, Motion, Snapshot, Vec3 } from "./source.ts";
import { words } from "./words.ts";
import { short } from "./words_numbers.ts";

/** The user's choices of what is shown beside the body. */
export interface Look {
  apart: boolean;
  boundingBox: boolean;
  inertiaBox: boolean;
  ellipsoid: boolean;
  poinsot: boolean;
  cones: boolean;
  principal: boolean;
  turned: readonly number[] | null;
  /** The point [mesh], or the centre of mass, whose trace is drawn. */
  trace: Vec3 | "com" | null;
  /** Chalk lines as pairs of points [mesh]; a new array after each stroke. */
  chalk: readonly number[];
  protractor: readonly [string, string] | null;
  kept: Track | null;
}

/** The objects and functions that cards use. */
export interface Desk {
  readonly motion: Motion;
  readonly picture: Picture;
  readonly pointer: Pointer;
  readonly clock: Clock;
  readonly look: Look;
  readonly lessons: readonly Bundled[];
  /** What engines take, by the names of `inspect --for`. */
  readonly forms: Readonly<Record<string, Form>>;
  track(): Track;
  /** Call act before the next frame; a later call with the same name replaces it. */
  later(name: string, act: () => void): void;
  /** Show a refusal, if there is one; returns whether there was none. */
  told(refusal: string | null): boolean;
  /** After a body was opened, give it a spin if it has none; returns a refusal, or null. */
  lively(refusal: string | null): string | null;
  /** Restart with the present parameters, and play. */
  restart(): void;
  /** Open another take by a function; shows its refusal, if any. */
  open(how: () => string | null | Promise<string | null>): Promise<void>;
}

export interface Card {
  readonly node: HTMLElement;
  /** Body, parameters, ghost or history have changed. */
  changed(): void;
  /** Update readings; called about ten times a second. */
  show?(now: Snapshot): void;
  /** Update drawings; called once per frame. */
  draw?(now: Snapshot): void;
  closed?(): void;
}

/** Ranges of sliders, as factors of a body's first values: mass 1/10 to 10, impulse 1/30 to 30, sizes 1/2.5 to 2.5. */
const WIDE = 10, WIDEST = 30, SIZED = 2.5;
/** [1/s] The initial poke gives a body this many times its size per second. */
const LIVELY = 0.9;
/** [s] Time constant of the energy bars' scale. */
const RESCALED_S = 8;
/** [ms] Shortest period of updating readings, since an update makes the browser lay the cards out again. */
const READ_MS = 80;
const LOCK = "M7 10V7a5 5 0 0 1 10 0v3h1.500v11h-13V10zM9.500 10h5V7a2.500 2.500 0 0 0-5 0z";

type Name = keyof typeof words.cards;

export class Panel {
  /** Impulse of a poke [N s]. */
  impulse = 1;
  readonly node: HTMLElement;
  readonly free = make("div", { id: "free" });
  private readonly desk: Desk;
  private readonly side = make("div", { id: "side" });
  private readonly choices: Readonly<Record<"solid" | "bounding_box", HTMLButtonElement>>;
  private readonly sliders: Readonly<Record<"mass" | "x" | "y" | "z" | "poke", Slider>>;
  private readonly lock: HTMLButtonElement;
  private readonly chips: Readonly<Record<Name, HTMLButtonElement>>;
  private readonly makers: Readonly<Record<Name, () => Card>>;
  private readonly cards = new Map<Name, Card>();
  private readonly open = new Set<Name>();
  private readonly bars: readonly (readonly [HTMLElement, HTMLElement])[];
  private readonly angle: HTMLElement;
  private readonly angleCard: HTMLElement;
  private readonly resized: () => void;
  private first = { mass: 1, scale: [1, 1, 1] as Vec3, impulse: 1 };
  private largest = 0;
  private shownMs = 0;
  private passedS = 0;
  private shownAngle = "";
  private held: HTMLElement | null = null;

  constructor(desk: Desk, resized: () => void) {
    this.desk = desk;
    this.resized = resized;
    const { motion } = desk, set = (values: Record<string, number | string | readonly number[]>) => motion.set(values);

    const choose = (model: "solid" | "bounding_box"): void => { desk.told(set({ inertia_model: model })); };
    const pick = (model: "solid" | "bounding_box", name: string, kind: string): HTMLButtonElement =>
      make("button", { type: "button", role: "radio", class: kind, "aria-checked": "false", click: () => choose(model) }, name);
    this.choices = { solid: pick("solid", words.tensor.true, "true"), bounding_box: pick("bounding_box", words.tensor.box, "box") };
    const tensor = make("div", { id: "tensor", role: "radiogroup", "aria-label": words.tensor.name }, this.choices.solid, this.choices.bounding_box);
    tensor.addEventListener("keydown", (event) => {
      if (!event.key.startsWith("Arrow")) return;
      const other = document.activeElement === this.choices.solid ? "bounding_box" : "solid";
      choose(other);
      this.choices[other].focus();
      event.preventDefault();
    });

    const mass = slider(words.hand.mass, "mass", "kg", () => [this.first.mass / WIDE, this.first.mass * WIDE],
      (value) => desk.later("mass", () => desk.told(set({ mass: rounded(value) }))), (value) => set({ mass: value }));
    const size = (k: 0 | 1 | 2): Slider => {
      const scaled = (factor: number): readonly number[] => {
        const now = motion.body().scale, locked = this.lock.getAttribute("aria-pressed") === "true";
        return [0, 1, 2].map((i) => (locked || i === k ? factor * this.first.scale[i]! : now[i]!));
      };
      return slider(words.hand.sizes[k]!, "xyz"[k]!, "×", () => [1 / SIZED, SIZED],
        (value) => desk.later("scale", () => desk.told(set({ scale: scaled(rounded(value)) }))), (value) => set({ scale: scaled(value) }));
    };
    const poke = slider(words.hand.poke, "poke", "N s", () => [this.first.impulse / WIDEST, this.first.impulse * WIDEST],
      (value) => { this.impulse = rounded(value); this.sliders.poke.show(this.impulse); },
      (value) => { if (!(value > 0)) return words.notANumber(String(value)); this.impulse = value; this.sliders.poke.show(value); return null; });
    this.sliders = { mass, x: size(0), y: size(1), z: size(2), poke };
    this.lock = button("", () => {
      const on = this.lock.getAttribute("aria-pressed") !== "true";
      this.lock.setAttribute("aria-pressed", String(on));
    }, { class: "pill lock", "aria-pressed": "false", title: words.hand.lockTitle });
    const drawn = icon(LOCK);
    this.lock.append(drawn, words.hand.lock);

    this.makers = {
      lessons: () => lessonsCard(desk),
      body: () => bodyCard(desk), world: () => worldCard(desk), ghost: () => ghostCard(desk), tensor: () => tensorCard(desk), measure: () => measureCard(desk),
      plots: () => {
        const plots = new Plots(desk.track());
        return { node: plots.node, changed: () => undefined, show: (now) => plots.draw(now.timeNs) };
      },
      keep: () => keepCard(desk),
    };
    const chip = (name: Name): HTMLButtonElement => button(words.cards[name], () => this.toggle(name), { "aria-expanded": "false", "data-card": name });
    this.chips = { lessons: chip("lessons"), body: chip("body"), world: chip("world"), ghost: chip("ghost"), tensor: chip("tensor"), measure: chip("measure"), plots: chip("plots"), keep: chip("keep") };
    this.chips.lessons.hidden = !desk.lessons.length;
    const hand = make("div", { id: "hand", class: "card", role: "group", "aria-label": words.hand.name },
      make("div", { class: "sliders" }, mass.node, this.sliders.x.node, this.sliders.y.node, this.sliders.z.node, poke.node),
      make("div", { class: "chips" }, this.lock, ...Object.values(this.chips)));

    const e = words.energy, kinds = [[e.spin, "--spin"], [e.move, "--move"], [e.string, "--pull"], [e.height, "--height"], [e.all, "--all"]] as const;
    this.bars = kinds.map(([name, colour]) => {
      const bar = make("i");
      bar.style.setProperty("--c", `var(${colour})`);
      return [make("div", {}, bar), make("span", {}, name)] as const;
    });
    const energy = make("div", { id: "energy", class: "card", role: "img", "aria-label": e.name },
      make("b", {}, e.name), make("div", { class: "bars" }, ...this.bars.map(([bar]) => bar)), make("div", { class: "captions" }, ...this.bars.map(([, caption]) => caption)));
    this.angle = make("div", { class: "value" }, "–");
    this.angleCard = make("div", { id: "angle", class: "card" }, make("div", { class: "name" }, words.angle.name), this.angle);

    this.node = make("main", { id: "panes" }, tensor, this.side, this.free, hand, energy, desk.clock.node, this.angleCard);
    document.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || !this.open.size || !this.side.contains(document.activeElement)) return;
      this.toggle([...this.open][this.open.size - 1]!);
    });
  }

  /** Set the card that stays above the others, or none. */
  hold(node: HTMLElement | null): void {
    for (const name of [...this.open]) this.close(name);
    this.held?.remove();
    this.held = node;
    if (node) this.side.prepend(node);
    this.changedSize();
  }

  opened(): readonly string[] { return [...this.open]; }

  /** Open a card, and mark and focus the element that a lesson's step is about. */
  lead(name: Name, mark: string): void {
    if (!this.open.has(name)) this.toggle(name);
    const found = this.side.querySelector<HTMLElement>(`section[data-card=${name}] [data-mark="${mark}"]`);
    if (!found) return;
    const control = found.matches("button, input, select") ? found : found.querySelector<HTMLElement>("button, input, select") ?? found;
    for (const other of this.side.querySelectorAll(".led")) other.classList.remove("led");
    found.classList.add("led");
    found.scrollIntoView({ block: "nearest" });
    control.focus({ preventScroll: true });
  }

  changedSize(): void {
    this.node.classList.toggle("taught", this.held !== null);
    this.node.classList.toggle("open", this.open.size > 0 || this.held !== null);
    this.node.classList.toggle("carded", this.open.size > 0);
    this.node.classList.toggle("plotted", this.open.has("plots"));
    this.shownMs = 0;
    this.resized();
  }

  /** Open or close a card; plots stay open beside another card if there is space. */
  toggle(name: Name): void {
    const was = this.open.has(name), room = matchMedia("(min-height: 35em) and (min-width: 44em)").matches;
    for (const other of [...this.open]) if (other === name || !room || (other === "plots") === (name === "plots")) this.close(other);
    if (!was) {
      this.open.add(name);
      this.chips[name].setAttribute("aria-expanded", "true");
      const card = this.makers[name](), title = words[name === "tensor" ? "inertia" : name].name, id = `card-${name}`;
      const close = button("×", () => this.toggle(name), { class: "close", "aria-label": `${words.close}: ${title}` });
      const node = make("section", { class: "card", "aria-labelledby": id, "data-card": name }, make("div", { class: "head" }, make("h2", { id, tabindex: -1 }, title), close), card.node);
      this.cards.set(name, card);
      this.side.append(node);
      card.changed();
      node.querySelector<HTMLElement>("h2")!.focus({ preventScroll: true });
    } else this.chips[name].focus({ preventScroll: true });
    this.changedSize();
  }

  private close(name: Name): void {
    this.open.delete(name);
    this.cards.get(name)?.closed?.();
    this.cards.delete(name);
    this.side.querySelector(`section[data-card=${name}]`)?.remove();
    this.chips[name].setAttribute("aria-expanded", "false");
  }

  /** After another body or flight was opened: centre the sliders' ranges on its values. */
  begin(): void {
    const info = this.desk.motion.body(), impulse = LIVELY * info.massKg * 2 * info.length;
    this.first = { mass: info.massKg, scale: info.scale, impulse: Number(impulse.toPrecision(1)) || 1 };
    this.impulse = this.first.impulse;
    this.sliders.poke.show(this.impulse);
    this.largest = 0;
    this.changed();
  }

  changed(): void {
    const { motion } = this.desk, info = motion.body(), model = String(motion.values()["inertia_model"]);
    for (const [name, choice] of Object.entries(this.choices)) {
      choice.setAttribute("aria-checked", String(name === model));
      choice.tabIndex = name === model || (name === "solid" && !(model in this.choices)) ? 0 : -1;
    }
    this.sliders.mass.show(info.massKg);
    (["x", "y", "z"] as const).forEach((axis, k) => this.sliders[axis].show(info.scale[k]! / this.first.scale[k]!));
    for (const card of this.cards.values()) card.changed();
  }

  show(now: Snapshot, gravity: Vec3, seconds: number): void {
    for (const card of this.cards.values()) card.draw?.(now);
    const clock = performance.now();
    this.passedS += seconds;
    if (clock - this.shownMs < READ_MS) return;
    this.shownMs = clock;
    const e = energies(now.body, gravity), weighs = gravity.some((g) => g !== 0), all = e.spin + e.move + e.string + e.height;
    const values = [e.spin, e.move, e.string, e.height, all], low = weighs && Math.min(...values) < 0;
    this.largest = Math.max(...values.map(Math.abs), this.largest * Math.exp(-this.passedS / RESCALED_S));
    const show = (k: number, on: boolean): void => { for (const part of this.bars[k]!) part.hidden = !on; };
    show(3, weighs);
    this.bars.forEach(([holder], k) => {
      const part = this.largest > 0 ? values[k]! / this.largest : 0;
      (holder.firstElementChild as HTMLElement).style.transform = low ? `translateY(-50%) scaleY(${(0.5 * part).toFixed(3)})` : `scaleY(${part.toFixed(3)})`;
    });
    this.passedS = 0;
    this.angleCard.hidden = !now.ghost;
    const text = now.ghost ? `${((now.angleToGhost * 180) / Math.PI).toFixed(0)}°` : "";
    if (text !== this.shownAngle) this.angle.textContent = this.shownAngle = text;
    this.bars[0]![0].parentElement!.parentElement!.setAttribute("aria-label",
      `${words.energy.name}: ${words.energy.spin} ${short(e.spin)} J, ${words.energy.move} ${short(e.move)} J, ${words.energy.string} ${short(e.string)} J, ${words.energy.all} ${short(all)} J`);
    for (const card of this.cards.values()) card.show?.(now);
  }

  /** Open a dropped file as a body. */
  takeFile(file: File): void {
    if (file.size > 50 * 1024 * 1024) { say(words.body.tooLarge); return; }
    void this.desk.open(async () => this.desk.lively(this.desk.motion.openMesh(file.name, new Uint8Array(await file.arrayBuffer()))));
  }
}

/** A slider's value, rounded to three digits so that the value set is the value shown. */
function rounded(value: number): number { return Number(value.toPrecision(3)); }
