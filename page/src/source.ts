// SPDX-License-Identifier: MIT
//
// What moves, behind one small interface. The view knows nothing but this file; `Motion` is made by `openMotion`
// (simulation in the page), or by what looks at a running node.
//
// Units: SI, times in whole nanoseconds of simulated time (`...Ns`, exact up to 2^53). Frames: *world*; *body* (origin
// in the centre of mass, axes of the mesh); *mesh* (the numbers of the mesh's file, before scale). A point p of the mesh
// is at p * scale - com [m] in body axes, and at position + R (p * scale - com) in the world. Quaternions are x, y, z, w
// and turn body axes into world axes. Nothing that is returned may be modified; it stays as it is when time goes on.

export type Vec3 = readonly [number, number, number];

/** A value of a parameter, as scene files have it. */
export type Value = number | boolean | string | readonly number[];
export type Values = Readonly<Record<string, Value>>;

/** Where a load acts: the centre of mass, the mesh's origin, a contact by name, a vertex by number, a point [mesh], or
 * where a ray [world] first meets the body. */
export type At =
  | string
  | { readonly vertex: number }
  | { readonly point: Vec3 }
  | { readonly ray: { readonly origin: Vec3; readonly direction: Vec3 } };

/** force [N] and torque [N m] in `axes` (world unless it says body), or push [N] along the inward normal. */
export interface Wrench {
  readonly at?: At;
  readonly force?: Vec3;
  readonly push?: number;
  readonly torque?: Vec3;
  readonly axes?: "world" | "body";
  /** [s]; without it a poke lasts poke_duration, and a held wrench until wrench_timeout after the last one. */
  readonly duration?: number;
  readonly slot?: string;
}

/** Something done, as an entry of a poke script has it (scene/script.py). t [s]: when; the motion itself says now where
 * it is left out. impulse [N s], angular_impulse [N m s]; string: target [m, world], attach [mesh] or a contact. */
export type Entry = { readonly t?: number } & (
  | Wrench
  | { readonly at?: At; readonly impulse?: Vec3; readonly angular_impulse?: Vec3; readonly axes?: "world" | "body" }
  | { readonly wrench: Wrench }
  | { readonly string: "release" | { readonly attach?: Vec3 | string; readonly target?: Vec3 } }
  | { readonly set: Values }
  | { readonly state: Partial<Record<"position" | "linear_velocity" | "angular_velocity", Vec3>> & { readonly orientation_xyzw?: readonly number[] } }
  | { readonly service: "clear_wrench" }
);

/** A parameter's declaration (parameters/declarations.py). `accepted`: what it takes, in words. Above lower, if `above`;
 * from lower otherwise. lengths: how many numbers it may have. changes: "live" or "at the next reset". */
export interface Parameter {
  readonly name: string;
  readonly type: "double" | "doubles" | "integer" | "bool" | "string";
  readonly default: Value | null;
  readonly description: string;
  readonly unit: string;
  readonly lower: number | null;
  readonly upper: number | null;
  readonly above: boolean;
  readonly lengths: readonly number[];
  readonly choices: readonly string[];
  readonly changes: string;
  readonly accepted: string;
}

/** A body by one of the ways to distribute its mass. Where it has none, `refusal` says why and the numbers are NaN. */
export interface Model {
  readonly model: "solid" | "shell" | "points" | "bounding_box" | "explicit";
  readonly massKg: number;
  /** [m, mesh axes after scaling] */
  readonly com: Vec3;
  /** [kg m^2], ascending */
  readonly moments: Vec3;
  /** 9 numbers row by row [kg m^2, about the centre of mass, body axes] */
  readonly inertia: readonly number[];
  readonly refusal: string;
}

/** A remark about a mesh, with its remedy. */
export interface Finding { readonly code: string; readonly severity: "info" | "warning" | "error"; readonly message: string }

/** The body as it is now. It is another object after each change of it. */
export interface BodyInfo {
  readonly name: string;
  /** 3 n numbers [mesh]; the same array as long as the mesh is the same */
  readonly vertices: Float64Array;
  /** 3 m vertex numbers, wound outward */
  readonly triangles: Uint32Array;
  readonly scale: Vec3;
  readonly massKg: number;
  /** [m, mesh axes after scaling] */
  readonly com: Vec3;
  /** 9 numbers row by row [kg m^2, about the centre of mass, body axes] */
  readonly inertia: readonly number[];
  /** [kg m^2], ascending */
  readonly moments: Vec3;
  /** 9 numbers row by row: principal axes as columns, in body axes, in the order of the moments */
  readonly axes: readonly number[];
  /** [m^3] of the solid as scaled; NaN where the surface bounds none */
  readonly volume: number;
  /** [m]: half the diagonal of the bounding box as scaled */
  readonly length: number;
  readonly findings: readonly Finding[];
  /** [mesh], by name */
  readonly contacts: Readonly<Record<string, Vec3>>;
  /** by the same mass: the models of a mesh, and the numbers given */
  readonly models: readonly Model[];
}

/** A load that acts now. point [m, world]; force [N], torque [N m], both in world axes. endNs: Infinity if nothing ends
 * it. */
export interface Acting {
  readonly kind: "wrench" | "poke";
  readonly slot: string;
  readonly point: Vec3;
  readonly force: Vec3;
  readonly torque: Vec3;
  readonly endNs: number;
}

/** The string while it is tied. knot, end (of the hand) and target [m, world], attach [mesh], force on the body
 * [N, world], tension [N], rest length [m]; releaseNs: Infinity if it isn't released by itself. */
export interface StringNow {
  readonly attach: Vec3;
  readonly knot: Vec3;
  readonly end: Vec3;
  readonly target: Vec3;
  readonly force: Vec3;
  readonly tension: number;
  readonly restLength: number;
  readonly releaseNs: number;
}

/** Body or ghost at one instant. */
export interface Flying {
  /** 13 numbers: position of the centre of mass [m, world], x y z w, velocity [m/s, world], omega [rad/s, body axes] */
  readonly row: readonly number[];
  /** 9 numbers row by row: body to world */
  readonly rotation: readonly number[];
  /** [rad/s, world] */
  readonly omega: Vec3;
  /** L about the centre of mass [N m s, world] */
  readonly momentum: Vec3;
  /** h of the flywheel [N m s, body axes] */
  readonly rotor: Vec3;
  /** [J]; potential: of gravity and string */
  readonly kinetic: number;
  readonly potential: number;
  /** what the hand has done through the string, and what the string's damper took, since the start [J] */
  readonly handWork: number;
  readonly stringHeat: number;
  readonly massKg: number;
  readonly scale: Vec3;
  /** [m, mesh axes after scaling] */
  readonly com: Vec3;
  readonly string: StringNow | null;
  readonly loads: readonly Acting[];
  /** why its motion has stopped, or "" */
  readonly failure: string;
}

/** attitude [rad], position [m]; finer: the parameter, accuracy or step, that the second flight had, and its value. */
export interface Sensitivity { readonly attitude: number; readonly position: number; readonly finer: readonly [string, number] }

export interface Snapshot {
  readonly timeNs: number;
  readonly body: Flying;
  readonly ghost: Flying | null;
  /** [rad] between the attitudes of body and ghost; NaN without one */
  readonly angleToGhost: number;
}

/** Where a ray first meets the body. mesh: [mesh]; body: [m, body axes]; world: [m]; distance: [m] from the ray's origin;
 * normal: outward, unit, world axes. */
export interface Hit {
  readonly mesh: Vec3;
  readonly body: Vec3;
  readonly world: Vec3;
  readonly distance: number;
  readonly normal: Vec3;
}

/** How the ghost differs from the body: "", 0 and true mean as the body. Any of it makes a ghost. step: [s] of an
 * integrator with fixed steps. */
export interface GhostChoice {
  readonly inertia_model: string;
  readonly integrator: string;
  readonly step: number;
  readonly gyroscopic: boolean;
}

/** What was done from one start to now. `script`: entries in the order of their times, each with its t. endNs: how far it
 * was flown. */
export interface History {
  readonly script: readonly Entry[];
  readonly endNs: number;
}

/** A take as files for the command line: `simulate scene.yaml --script script.yaml --duration S --json`. `mesh`: a file
 * that belongs beside the scene, unless the mesh is a bundled one. */
export interface TakeFiles {
  readonly scene: string;
  readonly script: string;
  readonly durationS: number;
  readonly command: string;
  readonly mesh: { readonly name: string; readonly bytes: Uint8Array } | null;
}

/** What can be opened by name. */
export interface Bundled { readonly name: string; readonly title: string }

/** What a motion can do, beside flying and being touched: open files of one's own; give its take as link, page or script;
 * go on from a moment that is looked back at. */
export interface Can { readonly openFiles: boolean; readonly keep: boolean; readonly goOn: boolean }

/** Who drives, of those who look at one node. asked: whether this page has; asking: how many do; owner: of the terminal. */
export interface HandState {
  readonly yours: boolean;
  readonly taken: boolean;
  readonly locked: boolean;
  readonly owner: boolean;
  readonly asked: boolean;
  readonly asking: number;
  readonly watchers: number;
}
export type Wish = "ask" | "give" | "take" | "lock" | "unlock";

/** A running node, whose time isn't the page's. rate: simulated seconds a second, 0 for as fast as it goes; began: how often
 * it has begun anew. */
export interface NodeBehind {
  readonly name: string;
  readonly isReached: boolean;
  readonly paused: boolean;
  readonly rate: number;
  readonly began: number;
  readonly hand: HandState;
  setPaused(paused: boolean): void;
  setRate(rate: number): void;
  /** By one publication. */
  step(): void;
  wish(wish: Wish): void;
}

/** Functions that may refuse return one line of text that says why, or null; then nothing has changed. */
export interface Motion {
  /** Version of the package that made this page. */
  readonly version: string;
  readonly bodies: readonly Bundled[];
  readonly scenes: readonly Bundled[];
  readonly can: Can;
  /** null where the motion is simulated in the page. */
  readonly node: NodeBehind | null;
  /** Declarations of all parameters that a page can set, `ballast.<name>` and ghost's among them. */
  parameters(): readonly Parameter[];
  /** The values in force now, by name; after a step back those of that time. */
  values(): Values;
  ghost(): GhostChoice;
  body(): BodyInfo;

  /** Begin a take of a bundled scene. */
  openScene(name: string): string | null;
  /** Begin a take with a bundled body, and otherwise with the parameters in force. */
  openBody(name: string): string | null;
  /** Begin a take with a mesh file (.obj, .stl, .ply, .glb), and otherwise with the parameters in force. scale: of all
   * three axes [m per mesh unit]. */
  openMesh(name: string, bytes: Uint8Array, scale?: number): string | null;
  /** A take of link() or of a saved file. A take of another version is opened, and `notice()` says which made it. */
  openLink(text: string): Promise<string | null>;
  /** What there is to say about what was opened last, or "". */
  notice(): string;

  /** Now. */
  snapshot(): Snapshot;
  /** Fly on to this time; what was done then acts again on the way until endNs. No-op for times past. */
  advance(untilNs: number): void;
  /** Do something now, at once. Drops what came after now. */
  submit(entry: Entry): string | null;
  /** The same as submit({set: values}). */
  set(values: Values): string | null;
  /** Another ghost, from the start of the take on. */
  setGhost(choice: Partial<GhostChoice>): string | null;
  /** Where a ray [m, world] first meets the body as it is now. */
  firstHit(origin: Vec3, direction: Vec3): Hit | null;

  history(): History;
  /** To any time of the take up to endNs, to the bit as it was. */
  goTo(timeNs: number): void;
  /** Go on from here: what came after now is dropped. */
  goOn(): void;
  /** To time 0 with the parameters now in force; a new take. */
  reset(): void;

  /** How far now is from where a second flight of the take is, ten times as accurate. Throws Refused. */
  sensitivity(): Sensitivity;

  take(): TakeFiles;
  /** SHA-256 as `rigid_proto simulate --json` prints it as state_hash, hexadecimal. */
  hash(): Promise<string>;
  /** Scene and take as text for behind the # of an address; "" where the mesh is one's own. */
  link(): Promise<string>;
  /** The page's file with scene, take and mesh, to be saved as .html. */
  file(): Promise<Blob>;

  /** Call this whenever body, parameters, ghost or history (but not time alone) have changed; returns what ends that. */
  watch(changed: () => void): () => void;
  /** Who is told what is to be said later, such as why a node has refused something. */
  hear(said: (line: string) => void): void;
}

/** The motion that is simulated in the page (`openMotion` in simulation.ts), of `inside("kernels")`, `inside("data")` and
 * `inside("take")` (file.ts). It begins with the scene or take that the file was made for. */
export type OpenMotion = (
  kernels: Uint8Array<ArrayBuffer>, data: Uint8Array<ArrayBuffer>, take?: Uint8Array<ArrayBuffer> | null,
) => Promise<Motion>;
