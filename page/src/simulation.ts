// SPDX-License-Identifier: MIT
//
// The motion simulated in the page: one take with its body and its ghost, in which one can seek.

import { Data } from "./data.ts";
import type { Declarations } from "./data.ts";
import { fileWith } from "./file.ts";
import { Flown } from "./flight.ts";
import type { Kept } from "./flight.ts";
import { NO_GHOST } from "./ghosts.ts";
import { Kernels, NUMBERS } from "./kernels.ts";
import { readMesh } from "./meshes.ts";
import { filled, nanoseconds, Refused, shown } from "./numbers.ts";
import { Parameters } from "./parameters.ts";
import { Refusals } from "./scene.ts";
import { Script } from "./script.ts";
import { sha256 } from "./sha256.ts";
import type {
  BodyInfo, Bundled, Can, Entry, GhostChoice, History, Hit, Motion, OpenMotion, Parameter, Sensitivity, Snapshot, TakeFiles, Value, Values, Vec3,
} from "./source.ts";
import { Observed } from "./state.ts";
import { Placed, Surfaces } from "./surface.ts";
import type { MeshNumbers, Surface } from "./surface.ts";
import { FORM, linkText, madeBy, takeBytes, takeFiles, takeOf, takeOfLink } from "./take.ts";
import type { Take } from "./take.ts";
import { words } from "./words.ts";

/** Period and largest number of saved states for seeking, 30 kB each; beyond it every second one is dropped. */
const KEEP_NS = 1_000_000_000;
const MOST_KEPT = 128;
/** Factor of accuracy of the second flight (scene/sensitivity.py). */
const FINER = 10;

interface Done { readonly tNs: number; readonly entry: Entry }

/** The state of a take. next: number of entries that have acted; actedNs: time of the last ones; before: the state row
 * at that time, before they acted. */
interface Moment {
  readonly timeNs: number;
  readonly next: number;
  readonly actedNs: number;
  readonly before: readonly number[];
  readonly surface: Surface | null;
  readonly body: Kept;
  readonly ghost: Kept | null;
}

interface Whole {
  readonly initial: Values;
  readonly choice: GhostChoice;
  readonly done: readonly Done[];
  readonly endNs: number;
  readonly own: MeshNumbers | null;
  readonly moment: Moment;
  readonly kept: readonly Moment[];
}

export class Simulation implements Motion {
  readonly version: string;
  readonly bodies: readonly Bundled[];
  readonly scenes: readonly Bundled[];
  readonly can: Can = { openFiles: true, keep: true, goOn: true };
  readonly node = null;
  readonly #kernels: Kernels;
  readonly #data: Data;
  readonly #declared: Declarations;
  readonly #parameters: Parameters;
  readonly #script: Script;
  readonly #surfaces: Surfaces;
  readonly #observed: Observed;
  readonly #body: Flown;
  readonly #ghost: Flown;
  readonly #placed: Placed;
  readonly #known = new Map<string, Surface>();
  readonly #watchers = new Set<() => void>();
  #own: MeshNumbers | null = null;
  #initial: Values = {};
  #choice: GhostChoice = NO_GHOST;
  #hasGhost = false;
  #done: Done[] = [];
  #next = 0;
  #endNs = 0;
  #actedNs = -1;
  #before: readonly number[] = [];
  #kept: Moment[] = [];
  #info: BodyInfo | null = null;
  /** For an open mesh, which bounds no solid: the parameters that make it a shell, and their values before. */
  #asShell: { readonly shell: Values; readonly before: Values } | null = null;
  #notice = "";

  constructor(kernels: Kernels, data: Data) {
    const { memory } = kernels;
    this.#kernels = kernels;
    this.#data = data;
    const declared = (this.#declared = data.declared);
    this.version = declared.version;
    this.bodies = Object.keys(declared.bodies).map((name) => ({ name, title: name.replaceAll("_", " ") }));
    this.scenes = Object.entries(declared.scenes).map(([name, { title }]) => ({ name, title }));
    this.#parameters = new Parameters(declared);
    this.#script = new Script(declared);
    const refusals = new Refusals(kernels, declared), surfaces = new Surfaces(kernels, declared);
    const placed = new Placed(memory);
    this.#surfaces = surfaces;
    this.#placed = placed;
    this.#body = new Flown(kernels, declared, placed, surfaces, refusals);
    this.#ghost = new Flown(kernels, declared, placed, surfaces, refusals);
    this.#observed = new Observed(kernels, declared, placed, surfaces, refusals);
    this.#start(this.#sceneValues(declared.start), NO_GHOST, null, []);
  }

  // Opening

  openScene(name: string): string | null {
    if (!Object.hasOwn(this.#declared.scenes, name)) return this.#unknown("scene", name, Object.keys(this.#declared.scenes));
    const values = this.#sceneValues(name);
    return this.#tried(() => {
      this.#start(values, ghostOf(values), null, []);
      this.#asShell = null;
    });
  }

  openBody(name: string): string | null {
    if (!Object.hasOwn(this.#declared.bodies, name)) return this.#unknown("mesh", name, Object.keys(this.#declared.bodies));
    // Density, contacts and initial state of the body's own scene; other parameters keep their values.
    const own = Object.entries(this.#sceneValues(name)).filter(([key]) => /^(?:density|mass|scale|contacts\.|initial\.)/.test(key));
    const values = { ...this.#withoutPoints(), ...Object.fromEntries(own), mesh: name };
    return this.#tried(() => {
      this.#start(values, this.#choice, null, []);
      this.#asShell = null;
    });
  }

  openMesh(name: string, bytes: Uint8Array, scale?: number): string | null {
    return this.#tried(() => {
      const mesh = readMesh(name, bytes, this.#kernels), surface = this.#surfaces.judged(mesh);
      const side = Math.max(...new Float64Array(surface.record.slice(8, 32).buffer));
      const unit = scale ?? (side > this.#declared.longest ? 0.001 : 1);
      const values: Values = { ...this.#withoutPoints(), mesh: mesh.name, scale: [unit, unit, unit] };
      const mass = this.#body.flight.body[NUMBERS.body.MASS] ?? 1;
      const shell: Values | null = surface.closed ? null : { mass, inertia_model: "shell", inertia_model_com: "model" };
      this.#start({ ...values, ...shell }, this.#choice, mesh, []);
      this.#asShell = shell === null ? null : { shell, before: Object.fromEntries(Object.keys(shell).map((name) => [name, values[name] ?? 0])) };
      this.#notice = [
        ...(scale === undefined && unit !== 1 ? [`its longest side of ${side.toPrecision(3)} is taken as millimetres`] : []),
        ...surface.findings.filter((each) => each.severity !== "info").map((each) => each.message),
      ].join("; ");
    });
  }

  async openLink(text: string): Promise<string | null> {
    return this.#refusal(async () => this.openTake(await takeOfLink(text)));
  }

  /** Start with a take of a link or file. Throws Refused. */
  openTake(take: Take): void {
    const values: Record<string, Value> = this.#parameters.defaults();
    for (const [name, value] of Object.entries(take.values)) values[name] = this.#parameters.converted(name, value);
    const done = take.script.map((entry) => {
      const { t } = entry as { t?: unknown };
      if (typeof t !== "number" || !(t >= 0 && t <= 1e9)) throw new Refused(`script: an entry at ${shown(t)}; accepted: t from 0 to 1e9 [s]`);
      return { tNs: nanoseconds(t), entry };
    });
    if (done.some((one, k) => k > 0 && one.tNs < (done[k - 1]?.tNs ?? 0))) throw new Refused("script: its entries aren't in the order of their times");
    this.#start(values, take.ghost, take.mesh, done);
    this.#asShell = null;
    this.#endNs = Math.max(take.endNs, done.at(-1)?.tNs ?? 0);
    this.#notice = madeBy(take, this.#declared);
  }

  notice(): string {
    return this.#notice;
  }

  #sceneValues(name: string): Values {
    return { ...this.#parameters.defaults(), ...this.#declared.scenes[name]?.values };
  }

  /** The present parameters, without points in mesh coordinates, and without those that only an open mesh needs. */
  #withoutPoints(): Values {
    const { shell, before } = this.#asShell ?? { shell: {}, before: {} }, now = this.#body.values;
    const isShell = Object.entries(shell).every(([name, value]) => now[name] === value);
    const own = Object.entries({ ...now, ...(isShell ? before : {}) }).filter(([name]) => !/^(?:ballast|contacts)\./.test(name) && name !== "string.attach");
    const { "string.attach": attach = [0, 0, 0] } = this.#parameters.defaults(), model = (isShell ? before : now)["inertia_model"] ?? now["inertia_model"] ?? "solid";
    return { ...Object.fromEntries(own), "string.attach": attach, "string.attached": false, inertia_model: model === "explicit" ? "solid" : model };
  }

  #unknown(field: string, name: string, known: readonly string[]): string {
    return filled(this.#declared.words.accepted, { 0: field, 1: shown(name), 2: known.join(", ") });
  }

  #surfaceOf(values: Values): Surface | null {
    const name = String(values["mesh"] ?? "");
    if (name === "") return null;
    const known = this.#known.get(name);
    if (known !== undefined && (this.#own?.name !== name || known.vertices === this.#own.vertices)) return known;
    const bundled = this.#data.mesh(name);
    const mesh = this.#own?.name === name ? this.#own : bundled === null ? null : { name, starts: null, ...bundled };
    if (mesh === null) throw new Refused(this.#unknown("mesh", name, Object.keys(this.#declared.bodies)));
    const surface = this.#surfaces.judged(mesh);
    this.#known.set(name, surface);
    return surface;
  }

  /** Start a take. Throws Refused and then changes nothing. */
  #start(values: Values, choice: GhostChoice, own: MeshNumbers | null, done: Done[]): void {
    const isFirst = this.#before.length === 0, whole = isFirst ? null : this.#whole();
    try {
      this.#own = own;
      this.#initial = values;
      this.#choice = choice;
      this.#done = done;
      this.#endNs = done.at(-1)?.tNs ?? 0;
      this.#rewind();
      this.#notice = "";
      for (const name of this.#known.keys()) if (name !== own?.name && !(name in this.#declared.bodies)) this.#known.delete(name);
    } catch (error) {
      if (whole !== null) this.#restore(whole);
      throw error;
    }
    this.#changed();
  }

  /** Go to time 0 of the take. Throws Refused. */
  #rewind(): void {
    this.#placed.place(this.#surfaceOf(this.#initial));
    this.#body.begin(this.#initial);
    const { inertia_model, integrator, step, gyroscopic } = this.#choice;
    this.#hasGhost = inertia_model !== "" || integrator !== "" || step !== 0 || !gyroscopic;
    if (this.#hasGhost) this.#ghost.begin(this.#ghostValues(this.#initial));
    this.#next = 0;
    this.#actedNs = -1;
    this.#before = [...this.#body.flight.row];
    this.#kept = [this.#moment()];
  }

  #ghostValues(values: Values): Values {
    const { inertia_model, integrator, step, gyroscopic } = this.#choice;
    return {
      ...values,
      inertia_model: inertia_model || (values["inertia_model"] ?? "solid"),
      integrator: integrator || (values["integrator"] ?? "auto"),
      step: step !== 0 ? step : (values["step"] ?? 0.001),
      gyroscopic: gyroscopic && values["gyroscopic"] === true,
    };
  }

  // State

  parameters(): readonly Parameter[] {
    return this.#parameters.all;
  }

  values(): Values {
    return this.#body.values;
  }

  ghost(): GhostChoice {
    return this.#choice;
  }

  body(): BodyInfo {
    return (this.#info ??= this.#observed.info(this.#body));
  }

  snapshot(): Snapshot {
    const body = this.#observed.flying(this.#body), ghost = this.#hasGhost ? this.#observed.flying(this.#ghost) : null;
    return { timeNs: this.#body.timeNs, body, ghost, angleToGhost: ghost === null ? NaN : this.#observed.angle(body.row, ghost.row) };
  }

  firstHit(origin: Vec3, direction: Vec3): Hit | null {
    return this.#observed.firstHit(this.#body, origin, direction);
  }

  history(): History {
    return { script: this.#done.map(({ entry }) => entry), endNs: this.#endNs };
  }

  // Time

  advance(untilNs: number): void {
    const endNs = Math.floor(untilNs);
    while (this.#body.failure === "" && this.#body.timeNs < endNs) {
      this.#actDue();
      const nextNs = this.#done[this.#next]?.tNs ?? Infinity, keptNs = (this.#kept.at(-1)?.timeNs ?? 0) + KEEP_NS;
      this.#flyTo(Math.min(endNs, nextNs, Math.max(keptNs, this.#body.timeNs + 1)));
      if (this.#body.timeNs >= keptNs) this.#keep();
    }
    this.#endNs = Math.max(this.#endNs, this.#body.timeNs);
  }

  #flyTo(timeNs: number): void {
    this.#body.fly(timeNs);
    if (this.#hasGhost) this.#ghost.fly(this.#body.timeNs);
  }

  /** Apply the entries that are due. */
  #actDue(): void {
    for (let one = this.#done[this.#next]; one !== undefined && one.tNs <= this.#body.timeNs; one = this.#done[this.#next]) {
      try {
        this.#act(one.entry);
        this.#next++;
      } catch (error) {
        if (!(error instanceof Refused)) throw error;
        this.#done.splice(this.#next, 1); // in a take of another version
        this.#notice = `without an entry that is refused: ${error.message}`;
      }
    }
  }

  /** Apply an entry now. Throws Refused and then changes nothing. */
  #act(entry: Entry): void {
    const body = this.#body, before = this.#moment();
    try {
      if (this.#actedNs !== body.timeNs) {
        this.#before = [...body.flight.row];
        this.#actedNs = body.timeNs;
        body.endDue();
        if (this.#hasGhost) this.#ghost.endDue();
      }
      for (const command of this.#script.commands(entry, body.values)) {
        if ("set" in command) this.#change(this.#parameters.changes(command.set));
        else {
          body.command(command);
          this.#alsoGhost(() => this.#ghost.command(command));
        }
      }
      body.cut();
      if (this.#hasGhost) this.#ghost.cut();
    } catch (error) {
      this.#putBack(before);
      throw error;
    }
  }

  /** Apply a command to the ghost, too, unless the ghost's integrator doesn't support it. */
  #alsoGhost(act: () => void): void {
    if (!this.#hasGhost) return;
    try {
      act();
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      this.#notice = `the ghost continues without a command: ${error.message}`;
    }
  }

  #change(changes: Values): void {
    const fixed = Object.keys(changes).find((name) => this.#parameters.named(name).changes === "read-only");
    if (fixed !== undefined) throw new Refused(filled(this.#declared.words.accepted, { 0: fixed, 1: shown(changes[fixed]), 2: this.#declared.words.atStart }));
    const values = { ...this.#body.values, ...changes };
    const surface = this.#surfaceOf(values), isSame = surface === this.#placed.surface;
    this.#placed.place(surface);
    this.#body.change(values, isSame);
    this.#alsoGhost(() => this.#ghost.change(this.#ghostValues(values), isSame));
    this.#info = null;
  }

  submit(entry: Entry): string | null {
    return this.#tried(() => {
      if ("set" in entry && Object.keys(entry.set ?? {}).some((name) => name.startsWith("ghost."))) {
        this.#setWithGhost(entry.set);
        return;
      }
      if (this.#body.failure !== "") throw new Refused(this.#body.failure);
      this.#actDue();
      const timeNs = this.#body.timeNs, done: Done = { tNs: timeNs, entry: { ...entry, t: timeNs / 1e9 } };
      this.#act(done.entry);
      this.#drop();
      this.#done.push(done);
      this.#next++;
    });
  }

  set(values: Values): string | null {
    return this.submit({ set: values });
  }

  /** Set parameters, some of which are the ghost's; those aren't entries of the script, since the ghost starts again at
   * time 0. */
  #setWithGhost(values: Values): void {
    const { "ghost.inertia_model": model, "ghost.integrator": integrator, ...others } = this.#parameters.changes(values);
    const refused = this.setGhost({
      ...(model === undefined ? {} : { inertia_model: String(model) }),
      ...(integrator === undefined ? {} : { integrator: String(integrator) }),
    });
    const then = refused === null && Object.keys(others).length > 0 ? this.submit({ set: others }) : null;
    if (refused !== null || then !== null) throw new Refused(refused ?? then ?? "");
  }

  setGhost(choice: Partial<GhostChoice>): string | null {
    return this.#tried(() => {
      const whole = this.#whole(), timeNs = this.#body.timeNs, next = this.#next;
      const chosen = { ...this.#choice, ...choice };
      this.#parameters.converted("ghost.inertia_model", chosen.inertia_model);
      this.#parameters.converted("ghost.integrator", chosen.integrator);
      if (chosen.step !== 0) this.#parameters.converted("step", chosen.step);
      try {
        this.#choice = chosen;
        this.#rewind();
        this.#flyAgain(timeNs, next);
      } catch (error) {
        this.#restore(whole);
        throw error;
      }
    });
  }

  goTo(timeNs: number): void {
    const wantedNs = Math.max(0, Math.min(Math.floor(timeNs), this.#endNs));
    const last = this.#kept.filter((moment) => moment.timeNs <= wantedNs).at(-1);
    const values = this.#body.values;
    if (this.#body.timeNs > wantedNs || (last !== undefined && last.timeNs > this.#body.timeNs)) {
      if (last !== undefined) this.#putBack(last);
      else this.#rewind();
    }
    this.#flyAgain(wantedNs, Infinity);
    if (this.#body.values !== values) this.#changed();
  }

  /** Advance to a time of the take and apply its entries there, but not more than `next` in total. */
  #flyAgain(timeNs: number, next: number): void {
    const { endNs } = { endNs: this.#endNs };
    this.advance(timeNs);
    while (this.#next < next && (this.#done[this.#next]?.tNs ?? Infinity) <= this.#body.timeNs) this.#actDue();
    this.#endNs = endNs;
  }

  goOn(): void {
    this.#drop();
    this.#changed();
  }

  /** Drop everything after now. */
  #drop(): void {
    const nowNs = this.#body.timeNs;
    this.#done.length = this.#next;
    this.#endNs = nowNs;
    this.#kept = this.#kept.filter((moment) => moment.timeNs <= nowNs);
  }

  sensitivity(): Sensitivity {
    const accuracy = ["accuracy", "step", "integrator"], entries = this.#done.slice(0, this.#next).map(({ entry }) => entry);
    const sets = entries.some((entry) => "set" in entry && accuracy.some((name) => Object.hasOwn(entry.set, name)));
    if (sets) throw new Refused(words.measure.accuracySet);
    const { order } = this.#declared.integrators.find(({ name }) => name === this.#initial["integrator"]) ?? { order: null };
    const name = order === null ? "accuracy" : "step", present = Number(this.#initial[name]);
    const value = order === null ? present / FINER : Math.round((present * 1e9) / FINER ** (1 / order)) / 1e9;
    this.#parameters.converted(name, value);
    const whole = this.#whole(), { timeNs } = this.#body, row = [...this.#body.flight.row];
    try {
      this.#initial = { ...this.#initial, [name]: value };
      this.#choice = NO_GHOST;
      this.#rewind();
      this.#flyAgain(timeNs, whole.moment.next);
      if (this.#body.failure !== "") throw new Refused(this.#body.failure);
      const other = this.#body.flight.row, away = [0, 1, 2].map((k) => row[k]! - other[k]!);
      return { attitude: this.#observed.angle(row, other), position: Math.hypot(...away), finer: [name, value] };
    } finally {
      this.#restore(whole);
    }
  }

  reset(): void {
    const refused = this.#tried(() => this.#start(this.#body.values, this.#choice, this.#own, []));
    if (refused !== null) this.#notice = refused;
  }

  // Saved states

  #moment(): Moment {
    return {
      timeNs: this.#body.timeNs, next: this.#next, actedNs: this.#actedNs, before: this.#before,
      surface: this.#placed.surface, body: this.#body.keep(), ghost: this.#hasGhost ? this.#ghost.keep() : null,
    };
  }

  #putBack(moment: Moment): void {
    this.#next = moment.next;
    this.#actedNs = moment.actedNs;
    this.#before = moment.before;
    this.#placed.place(moment.surface);
    this.#body.putBack(moment.body);
    if (moment.ghost !== null) this.#ghost.putBack(moment.ghost);
    this.#hasGhost = moment.ghost !== null;
    this.#info = null;
  }

  #keep(): void {
    this.#kept.push(this.#moment());
    if (this.#kept.length > MOST_KEPT) this.#kept = this.#kept.filter((_, k) => k % 2 === 0);
  }

  #whole(): Whole {
    return {
      initial: this.#initial, choice: this.#choice, done: [...this.#done], endNs: this.#endNs, own: this.#own,
      moment: this.#moment(), kept: this.#kept,
    };
  }

  #restore(whole: Whole): void {
    this.#initial = whole.initial;
    this.#choice = whole.choice;
    this.#done = [...whole.done];
    this.#endNs = whole.endNs;
    this.#own = whole.own;
    this.#kept = [...whole.kept];
    this.#putBack(whole.moment);
  }

  // The take as text

  hash(): Promise<string> {
    return Promise.resolve(this.stateHash());
  }

  /** The hash of the present state, before entries of the same time. */
  stateHash(): string {
    const body = this.#body, row = this.#actedNs === body.timeNs ? this.#before : [...body.flight.row];
    const view = new DataView(new ArrayBuffer(8 + 8 * row.length));
    view.setBigInt64(0, BigInt(body.timeNs), true);
    row.forEach((x, k) => view.setFloat64(8 + 8 * k, x + 0, true));
    return sha256(new Uint8Array(view.buffer));
  }

  #take(): Take {
    const values = this.#parameters.changed(this.#initial);
    return {
      form: FORM, version: this.version, values, ghost: this.#choice,
      script: this.#done.map(({ entry }) => entry), endNs: this.#endNs, mesh: this.#own,
    };
  }

  take(): TakeFiles {
    return takeFiles(this.#take(), this.#parameters, "take");
  }

  link(): Promise<string> {
    return this.#own === null ? linkText(this.#take()) : Promise.resolve("");
  }

  file(): Promise<Blob> {
    return fileWith(takeBytes(this.#take()));
  }

  // Observers

  watch(changed: () => void): () => void {
    this.#watchers.add(changed);
    return () => this.#watchers.delete(changed);
  }

  hear(): void { /* refusals are returned at once */ }

  #changed(): void {
    this.#info = null;
    for (const changed of this.#watchers) changed();
  }

  /** Call act; returns its refusal, or null. */
  #tried(act: () => void): string | null {
    try {
      act();
    } catch (error) {
      if (error instanceof Refused) return error.message;
      throw error;
    }
    this.#changed();
    return null;
  }

  async #refusal(act: () => Promise<void>): Promise<string | null> {
    try {
      await act();
    } catch (error) {
      if (error instanceof Refused) return error.message;
      throw error;
    }
    this.#changed();
    return null;
  }
}

function ghostOf(values: Values): GhostChoice {
  return { inertia_model: String(values["ghost.inertia_model"] ?? ""), integrator: String(values["ghost.integrator"] ?? ""), step: 0, gyroscopic: true };
}

export const openMotion: OpenMotion = async (kernels, data, take) => {
  const simulation = new Simulation(await Kernels.load(kernels), new Data(data));
  if (take !== undefined && take !== null) simulation.openTake(takeOf(take));
  return simulation;
};
