// SPDX-License-Identifier: MIT
//
// The motion of a running node, over one WebSocket (messages: rigid_proto_ros/page/live_page.py). The node sends
// records of its kernels. The page has the same kernels, so it evaluates these records like those of its own
// simulation.

import { Data } from "./data.ts";
import type { Declarations } from "./data.ts";
import { Flown } from "./flight.ts";
import { Flight, Kernels, LoadRow, Scene } from "./kernels.ts";
import { filled, Refused, shown } from "./numbers.ts";
import { fromBase64 } from "./packing.ts";
import { Parameters } from "./parameters.ts";
import { Refusals } from "./scene.ts";
import { Script } from "./script.ts";
import type {
  BodyInfo, Bundled, Can, Entry, GhostChoice, HandState, History, Hit, Motion, NodeBehind, Parameter, Sensitivity, Snapshot, StringNow, TakeFiles, Value, Values, Vec3, Wish,
} from "./source.ts";
import { Observed } from "./state.ts";
import { Placed, Surfaces } from "./surface.ts";
import type { MeshNumbers, Surface } from "./surface.ts";
import { meshOf } from "./take.ts";
import type { WrittenMesh } from "./take.ts";
import { words } from "./words.ts";

/** Largest number of recorded pictures, for seeking back: two minutes at thirty per second, 10 MB. */
const MOST_SEEN = 3600;
/** Largest number of recorded script entries. */
const MOST_DONE = 2000;
/** [ms] Period of reconnection attempts. */
const AGAIN_MS = 2000;
/** [ns] Seeking to less than this before the end shows the present. */
const NEAR_NS = 60_000_000;
/** Numbers before a picture's records, 4 bytes each. */
const HEAD = 4;
/** [rad/s] Initial angular velocity of an opened body whose scene has none. */
const SPIN = [0.05, 0.1, 3];
/** Path of a node's page. */
const ADDRESS = /^\/live\/[\w-]{16,}$/;

/** The scene of all pictures with this number. */
interface Scenery { readonly number: number; readonly values: Values; readonly record: Uint8Array; readonly ghost: Uint8Array; readonly surface: Surface | null }
interface Seen { readonly timeNs: number; readonly bytes: Uint8Array; readonly scenery: Scenery }
/** A message of the node, with one of these keys. */
interface NodeMessage {
  readonly hello?: { readonly name: string; readonly version: string; readonly owner: boolean };
  readonly mesh?: WrittenMesh | null;
  readonly scene?: { readonly number: number; readonly values: Values; readonly record: string; readonly ghost: string };
  readonly time?: { readonly paused: boolean; readonly rate: number; readonly failure: string };
  readonly done?: readonly Entry[];
  readonly reset?: true;
  readonly said?: string;
  readonly hand?: Omit<HandState, "owner">;
  readonly answer?: number;
  readonly refusal?: string | null;
}

/** Whether this page is served by a node. */
export function isLive(): boolean {
  return /^https?:$/.test(location.protocol) && ADDRESS.test(location.pathname);
}

export class Live implements Motion, NodeBehind {
  readonly version: string;
  readonly bodies: readonly Bundled[];
  readonly scenes: readonly Bundled[];
  readonly can: Can = { openFiles: false, keep: false, goOn: false };
  readonly node: NodeBehind = this;
  name = "";
  paused = false;
  rate = 1;
  began = 0;
  isReached = false;
  hand: HandState = { yours: false, taken: false, locked: false, owner: false, asked: false, asking: 0, watchers: 0 };
  readonly #data: Data;
  readonly #declared: Declarations;
  readonly #parameters: Parameters;
  readonly #script: Script;
  readonly #surfaces: Surfaces;
  readonly #placed: Placed;
  readonly #observed: Observed;
  readonly #body: Flown;
  readonly #ghost: Flown;
  readonly #bundled = new Map<string, Surface>();
  readonly #watchers = new Set<() => void>();
  readonly #address: string;
  #said: (line: string) => void = () => undefined;
  #socket: WebSocket | null = null;
  #mesh: MeshNumbers | null = null;
  #failure = "";
  #coming: Scenery | null = null;
  #seen: Seen[] = [];
  #shownAt: Seen | null = null;
  #inMemory: Seen | null = null;
  #snapshot: Snapshot | null = null;
  #info: BodyInfo | null = null;
  #done: Entry[] = [];
  #sent = 0;
  #targetSent = -1;
  #targetNext: Entry | null = null;
  #tying: { readonly number: number; readonly attach: Vec3; readonly target: Vec3 } | null = null;
  #first: (() => void) | null = null;

  constructor(kernels: Kernels, data: Data, address: string) {
    const declared = (this.#declared = data.declared);
    this.#data = data;
    this.#address = address;
    this.version = declared.version;
    this.bodies = Object.keys(declared.bodies).map((name) => ({ name, title: name.replaceAll("_", " ") }));
    this.scenes = Object.entries(declared.scenes).map(([name, { title }]) => ({ name, title }));
    this.#parameters = new Parameters(declared);
    this.#script = new Script(declared);
    const refusals = new Refusals(kernels, declared), surfaces = (this.#surfaces = new Surfaces(kernels, declared)), placed = (this.#placed = new Placed(kernels.memory));
    this.#body = new Flown(kernels, declared, placed, surfaces, refusals);
    this.#ghost = new Flown(kernels, declared, placed, surfaces, refusals);
    this.#observed = new Observed(kernels, declared, placed, surfaces, refusals);
  }

  // The socket

  /** Connect; resolves when the first picture has arrived. */
  opened(): Promise<void> {
    document.addEventListener("visibilitychange", () => this.#send({ looking: !document.hidden }));
    return new Promise((first) => { this.#first = first; this.#connect(); });
  }

  #connect(): void {
    const socket = (this.#socket = new WebSocket(this.#address));
    socket.binaryType = "arraybuffer";
    socket.addEventListener("message", ({ data }: MessageEvent<ArrayBuffer | string>) => {
      if (typeof data === "string") this.#receive(JSON.parse(data) as NodeMessage);
      else this.#picture(new Uint8Array(data));
    });
    socket.addEventListener("open", () => {
      this.isReached = true;
      this.#targetSent = -1;
      if (document.hidden) this.#send({ looking: false });
      this.#changed();
    });
    socket.addEventListener("close", ({ reason }) => {
      if (this.isReached || this.#first) this.#said(reason || words.live.lost);
      this.isReached = false;
      this.#tying = this.#targetNext = null;
      this.hand = { ...this.hand, yours: false };
      this.#changed();
      setTimeout(() => this.#connect(), AGAIN_MS);
    });
  }

  #send(message: object): void {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(message));
  }

  #receive(message: NodeMessage): void {
    if (message.hello) {
      this.name = message.hello.name;
      this.hand = { ...this.hand, owner: message.hello.owner };
      if (message.hello.version !== this.version) location.reload();
    } else if (message.mesh !== undefined) this.#mesh = message.mesh === null ? null : meshOf(message.mesh);
    else if (message.scene) this.#scene(message.scene);
    else if (message.time) {
      ({ paused: this.paused, rate: this.rate } = message.time);
      this.#failure = message.time.failure;
      this.#snapshot = this.#inMemory = null;
    } else if (message.done) this.#done = [...this.#done, ...message.done].slice(-MOST_DONE);
    else if (message.reset) {
      this.began++;
      this.#done = [];
      this.#seen = [];
      this.#shownAt = this.#tying = null;
    } else if (message.said !== undefined) this.#said(message.said);
    else if (message.hand) {
      this.hand = { ...message.hand, owner: this.hand.owner };
      if (!message.hand.yours) this.#tying = null;
    } else if (message.answer !== undefined) { this.#answered(message.answer, message.refusal ?? null); return; }
    this.#changed();
  }

  #scene(scene: NonNullable<NodeMessage["scene"]>): void {
    const values = { ...this.#parameters.defaults(), ...scene.values };
    let surface: Surface | null = null;
    try {
      surface = this.#surfaceOf(String(values["mesh"] ?? ""));
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      this.#said(error.message); // the body is drawn without a surface
    }
    this.#coming = { number: scene.number, values, record: fromBase64(scene.record), ghost: fromBase64(scene.ghost), surface };
  }

  #surfaceOf(name: string): Surface | null {
    const own = this.#mesh, bundled = own === null ? this.#data.mesh(name) : null;
    if (own === null && bundled === null) return null;
    const known = this.#bundled.get(name);
    if (known && (own === null || known.vertices === own.vertices)) return known;
    const surface = this.#surfaces.judged(own ?? { name, starts: null, ...bundled! });
    this.#bundled.set(name, surface);
    return surface;
  }

  #picture(bytes: Uint8Array): void {
    const [number] = new Uint32Array(bytes.buffer, 0, HEAD), last = this.#seen.at(-1);
    const coming = this.#coming, isNew = coming !== null && number === coming.number;
    const scenery = isNew ? coming : last?.scenery;
    if (!scenery || number !== scenery.number) return; // of a scene that hasn't arrived yet, or of an earlier one
    const timeNs = Number(new DataView(bytes.buffer).getBigInt64(4 * HEAD, true));
    if (last && timeNs <= last.timeNs) this.#seen = this.#seen.filter((one) => one.timeNs < timeNs);
    this.#seen.push({ timeNs, bytes, scenery });
    if (this.#seen.length > MOST_SEEN) this.#seen.splice(0, this.#seen.length - MOST_SEEN);
    if (isNew) {
      this.#coming = this.#info = null;
      this.#changed();
    }
    this.#first?.();
    this.#first = null;
  }

  // State

  parameters(): readonly Parameter[] { return this.#parameters.all; }

  values(): Values { return this.#at.scenery.values; }

  ghost(): GhostChoice {
    const { "ghost.inertia_model": model = "", "ghost.integrator": integrator = "" } = this.values();
    return { inertia_model: String(model), integrator: String(integrator), gyroscopic: true, step: 0 };
  }

  body(): BodyInfo {
    this.#put();
    return (this.#info ??= this.#observed.info(this.#body));
  }

  /** The picture shown: the present one, or an earlier one after seeking. */
  get #at(): Seen {
    const at = this.#shownAt ?? this.#seen.at(-1) ?? this.#inMemory;
    if (!at) throw new Error(words.live.lost);
    return at;
  }

  /** Copy the state shown into the kernels' memory. */
  #put(): Seen {
    const at = this.#at;
    if (at === this.#inMemory) return at;
    const { bytes, scenery } = at, [, loads = 0, hasGhost = 0, ghostLoads = 0] = new Uint32Array(bytes.buffer, 0, HEAD);
    if (scenery !== this.#inMemory?.scenery) this.#info = null;
    this.#inMemory = at;
    this.#snapshot = null;
    this.#placed.place(scenery.surface);
    let from = 4 * HEAD;
    const put = (flown: Flown, scene: Uint8Array, count: number): void => {
      const most = Math.min(count, flown.loads.n), loadsAt = from + Flight.SIZE;
      const flight = bytes.subarray(from, loadsAt), rows = bytes.subarray(loadsAt, loadsAt + most * LoadRow.SIZE);
      from = loadsAt + count * LoadRow.SIZE;
      flown.putBack({ values: scenery.values, scene: scene.subarray(0, Scene.SIZE), flight, loads: rows, room: new Uint8Array(0), failure: "" });
      flown.flight.acting = most;
    };
    put(this.#body, scenery.record, loads);
    if (hasGhost) put(this.#ghost, scenery.ghost, ghostLoads);
    this.#body.failure = this.#shownAt ? "" : this.#failure;
    return at;
  }

  snapshot(): Snapshot {
    const at = this.#put();
    if (!this.#snapshot) {
      const hasGhost = new Uint32Array(at.bytes.buffer, 0, HEAD)[2] !== 0;
      const body = this.#observed.flying(this.#body), ghost = hasGhost ? this.#observed.flying(this.#ghost) : null;
      this.#snapshot = { timeNs: at.timeNs, body, ghost, angleToGhost: ghost ? this.#observed.angle(body.row, ghost.row) : NaN };
    }
    const now = this.#snapshot, tying = this.#tying;
    if (!tying || this.#shownAt) return now;
    if (now.body.string) { this.#tying = null; return now; }
    // Show the hand's string as soon as it is tied, without waiting for the node's confirmation.
    const knot = this.#observed.worldPoint(this.#body, tying.attach);
    const string: StringNow = { attach: tying.attach, knot, end: tying.target, target: tying.target, force: [0, 0, 0], tension: 0, restLength: 0, releaseNs: Infinity };
    return { ...now, body: { ...now.body, string } };
  }

  firstHit(origin: Vec3, direction: Vec3): Hit | null {
    this.#put();
    return this.#observed.firstHit(this.#body, origin, direction);
  }

  history(): History { return { script: this.#done, endNs: this.#seen.at(-1)?.timeNs ?? 0 }; }

  // Commands

  /** Send a command; returns a refusal, or null. */
  #command(command: object): string | null {
    if (!this.isReached) return words.live.lost;
    if (this.hand.taken && !this.hand.yours && this.hand.locked && !this.hand.owner) return words.live.locked;
    this.#send({ id: ++this.#sent, ...command });
    return null;
  }

  #answered(number: number, refusal: string | null): void {
    if (number === this.#targetSent) {
      this.#targetSent = -1;
      const next = this.#targetNext;
      this.#targetNext = null;
      if (next && refusal === null) { this.#command({ entry: next }); this.#targetSent = this.#sent; }
    }
    if (refusal === null) return;
    if (this.#tying && number >= this.#tying.number) this.#tying = null;
    this.#said(refusal);
    this.#changed(); // controls show the present values again
  }

  submit(entry: Entry): string | null {
    if (this.#shownAt) return words.live.past;
    const { t: _, ...plain } = entry;
    try {
      this.#script.commands(entry, this.values());
      if ("set" in plain) return this.#command({ entry: { set: this.#parameters.changes(plain.set) } });
    } catch (error) {
      if (error instanceof Refused) return error.message;
      throw error;
    }
    if (!("string" in plain)) return this.#command({ entry: plain });
    const { string } = plain;
    if (string === "release") this.#tying = this.#targetNext = null;
    else if (string.attach === undefined && this.#targetSent >= 0) {
      this.#targetNext = plain; // only the latest target matters
      if (this.#tying && string.target) this.#tying = { ...this.#tying, target: string.target };
      return null;
    }
    const refusal = this.#command({ entry: plain });
    if (refusal !== null || string === "release") return refusal;
    if (typeof string.attach === "object" && string.target) this.#tying = { number: this.#sent, attach: string.attach, target: string.target };
    this.#targetSent = this.#sent;
    return null;
  }

  set(values: Values): string | null { return this.submit({ set: values }); }

  setGhost(choice: Partial<GhostChoice>): string | null {
    const { inertia_model, integrator, gyroscopic, step } = { ...this.ghost(), ...choice };
    if (!gyroscopic || step !== 0) return words.live.ghost;
    return this.set({ "ghost.inertia_model": inertia_model, "ghost.integrator": integrator });
  }

  openScene(name: string): string | null {
    const scene = Object.hasOwn(this.#declared.scenes, name) ? this.#declared.scenes[name] : undefined;
    return scene ? this.#command({ begin: scene.values }) : this.#unknown("scene", name, Object.keys(this.#declared.scenes));
  }

  openBody(name: string): string | null {
    if (!Object.hasOwn(this.#declared.bodies, name)) return this.#unknown("mesh", name, Object.keys(this.#declared.bodies));
    const now = Object.entries(this.values()).filter(([key]) => !/^(?:ballast|contacts|string|initial|explicit_inertia)\.|^(?:mass|scale|density|real_time_factor)$/.test(key));
    const own = Object.entries(this.#declared.scenes[name]?.values ?? {}).filter(([key]) => /^(?:density|mass|scale$|contacts\.|initial\.)/.test(key));
    const values: Record<string, Value> = { "initial.angular_velocity": SPIN, ...Object.fromEntries([...now, ...own]), mesh: name };
    if (values["inertia_model"] === "explicit") values["inertia_model"] = "solid";
    return this.#command({ begin: values });
  }

  openMesh(): string | null { return words.live.files; }

  openLink(): Promise<string | null> { return Promise.resolve(words.live.recorded); }

  notice(): string { return ""; }

  #unknown(field: string, name: string, known: readonly string[]): string {
    return filled(this.#declared.words.accepted, { 0: field, 1: shown(name), 2: known.join(", ") });
  }

  // Time, which the node advances

  advance(): void { /* done by the node */ }

  goTo(timeNs: number): void {
    const end = this.#seen.at(-1);
    if (!end) return;
    this.#shownAt = timeNs >= end.timeNs - NEAR_NS ? null : this.#seen.findLast((one) => one.timeNs <= timeNs) ?? this.#seen[0] ?? null;
    this.#changed();
  }

  goOn(): void {
    this.#shownAt = null;
    this.#changed();
  }

  reset(): void { this.#report(this.#command({ time: "reset" })); }

  setPaused(paused: boolean): void { this.#report(this.#command({ time: paused ? "pause" : "resume" })); }

  setRate(rate: number): void { this.#report(this.#command({ entry: { set: { real_time_factor: rate } } })); }

  step(): void { this.#report(this.#command({ time: "step" })); }

  wish(wish: Wish): void { this.#send({ hand: wish }); }

  #report(refusal: string | null): void { if (refusal !== null) this.#said(refusal); }

  // Takes aren't available: the node records

  take(): TakeFiles { throw new Refused(words.live.recorded); }

  sensitivity(): Sensitivity { throw new Refused(words.live.recorded); }
  hash(): Promise<string> { return Promise.reject(new Refused(words.live.recorded)); }

  link(): Promise<string> { return Promise.reject(new Refused(words.live.recorded)); }

  file(): Promise<Blob> { return Promise.reject(new Refused(words.live.recorded)); }

  // Observers

  watch(changed: () => void): () => void {
    this.#watchers.add(changed);
    return () => this.#watchers.delete(changed);
  }

  hear(said: (line: string) => void): void { this.#said = said; }

  #changed(): void { for (const changed of this.#watchers) changed(); }
}

/** The motion of the node that serves this page. */
export async function openLive(kernels: Uint8Array<ArrayBuffer>, data: Uint8Array<ArrayBuffer>): Promise<Live> {
  const live = new Live(await Kernels.load(kernels), new Data(data), `${location.origin.replace(/^http/, "ws")}${location.pathname}`);
  await live.opened();
  return live;
}
