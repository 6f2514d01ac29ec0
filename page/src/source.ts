// SPDX-License-Identifier: MIT
//
// The interface of a motion, on which alone the view depends. `openMotion` makes a `Motion` that is simulated in the
// page, `openLive` one of a running node.
//
// Units: SI, times in whole nanoseconds of simulated time (`...Ns`, exact up to 2^53). Frames: *world*; *body* (origin
// in the centre of mass, axes of the mesh); *mesh* (the numbers of the mesh's file, before scale). A point p of the
// mesh is at p * scale - com [m] in body axes, and at position + R (p * scale - com) in the world. Quaternions are x,
// y, z, w and rotate body axes to world axes. Returned objects must not be modified; they don't change when time
// advances.

export type Vec3 = readonly [number, number, number];

/** A value of a parameter, as in scene files. */
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

/** A command, as an entry of a poke script (scene/script.py). t: time [s], by default now. impulse [N s],
 * angular_impulse [N m s]; string: target [m, world], attach [mesh] or a contact. */
export type Entry = { readonly t?: number } & (
  | Wrench
  | { readonly at?: At; readonly impulse?: Vec3; readonly angular_impulse?: Vec3; readonly axes?: "world" | "body" }
  | { readonly wrench: Wrench }
  | { readonly string: "release" | { readonly attach?: Vec3 | string; readonly target?: Vec3 } }
  | { readonly set: Values }
  | { readonly state: Partial<Record<"position" | "linear_velocity" | "angular_velocity", Vec3>> & { readonly orientation_xyzw?: readonly number[] } }
  | { readonly service: "clear_wrench" }
);

/** A parameter's declaration (parameters/declarations.py). accepted: accepted values, in words. above: whether lower
 * itself is excluded. lengths: accepted numbers of elements. changes: "live" or "at the next reset". */
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

/** The body by an inertia model. If the model isn't possible, `refusal` says why and the numbers are NaN. */
export interface Model {
  /** one of the choices of inertia_model */
  readonly model: string;
  readonly massKg: number;
  /** [m, mesh axes after scaling] */
  readonly com: Vec3;
  /** [kg m^2], ascending */
  readonly moments: Vec3;
  /** 9 numbers row by row [kg m^2, about the centre of mass, body axes] */
  readonly inertia: readonly number[];
  readonly refusal: string;
}

/** A finding about a mesh, with its remedy. */
export interface Finding { readonly code: string; readonly severity: "info" | "warning" | "error"; readonly message: string }

/** The present body; a new object after each change. */
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
  /** xyzw quaternion that rotates principal axes into body axes */
  readonly turn: readonly number[];
  /** [m^3] of the scaled solid; NaN if the surface bounds none */
  readonly volume: number;
  /** of several materials: densities are those of its parts */
  readonly hasParts: boolean;
  /** [m]: half the diagonal of the bounding box as scaled */
  readonly length: number;
  readonly findings: readonly Finding[];
  /** [mesh], by name */
  readonly contacts: Readonly<Record<string, Vec3>>;
  /** all inertia models with the same mass; `walled` only where it is in force, `explicit` with the numbers given */
  readonly models: readonly Model[];
}

/** A load that acts now. point [m, world]; force [N], torque [N m], both in world axes. endNs:
 * Infinity without an end. */
export interface Acting {
  readonly kind: "wrench" | "poke";
  readonly slot: string;
  readonly point: Vec3;
  readonly force: Vec3;
  readonly torque: Vec3;
  readonly endNs: number;
}

/** The string while it is tied. knot, end (of the hand) and target [m, world], attach [mesh], force on the body
 * [N, world], tension [N], rest length [m]; releaseNs: Infinity without a timeout. */
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
  /** work of the hand through the string, and energy dissipated by the string's damper, since the start [J] */
  readonly handWork: number;
  readonly stringHeat: number;
  readonly massKg: number;
  readonly scale: Vec3;
  /** [m, mesh axes after scaling] */
  readonly com: Vec3;
  readonly string: StringNow | null;
  readonly loads: readonly Acting[];
  /** why its motion has failed, or "" */
  readonly failure: string;
}

/** Differences of attitude [rad] and position [m] to a second flight; finer: its accuracy or step, as
 * name and value. */
export interface Sensitivity { readonly attitude: number; readonly position: number; readonly finer: readonly [string, number] }

export interface Snapshot {
  readonly timeNs: number;
  readonly body: Flying;
  readonly ghost: Flying | null;
  /** angle between the attitudes of body and ghost [rad]; NaN without a ghost */
  readonly angleToGhost: number;
}

/** The first intersection of a ray with the body. mesh: [mesh]; body: [m, body axes]; world: [m]; distance: [m] from
 * the ray's origin; normal: outward, unit, world axes. */
export interface Hit {
  readonly mesh: Vec3;
  readonly body: Vec3;
  readonly world: Vec3;
  readonly distance: number;
  readonly normal: Vec3;
}

/** How the ghost differs from the body; "", 0 and true mean the same as the body. With any difference there is a ghost.
 * step: of an integrator with fixed steps [s]. */
export interface GhostChoice {
  readonly inertia_model: string;
  readonly integrator: string;
  readonly step: number;
  readonly gyroscopic: boolean;
}

/** The history of a take. script: entries in order of time, each with its t. endNs: time up to which
 * it was simulated. */
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

/** A scene or body that can be opened by name. */
export interface Bundled { readonly name: string; readonly title: string }

/** Optional abilities of a motion: open the user's files; export its take as link, page or script; continue from an
 * earlier time. */
export interface Can { readonly openFiles: boolean; readonly keep: boolean; readonly goOn: boolean }

/** Who has the hand (control) of a node. asked: this page has asked for it; asking: number of pages that have; owner:
 * this page has the owner's address. */
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

/** A running node, which has its own time. rate: simulated seconds per second, 0 for as fast as possible; began: number
 * of its restarts. */
export interface NodeBehind {
  readonly name: string;
  readonly isReached: boolean;
  readonly paused: boolean;
  readonly rate: number;
  readonly began: number;
  readonly hand: HandState;
  setPaused(paused: boolean): void;
  setRate(rate: number): void;
  /** Advance by one publication. */
  step(): void;
  wish(wish: Wish): void;
}

/** Functions that may refuse return the refusal as a line of text, after which nothing has changed, or null. */
export interface Motion {
  /** Version of the package that made this page. */
  readonly version: string;
  readonly bodies: readonly Bundled[];
  readonly scenes: readonly Bundled[];
  readonly can: Can;
  /** null if the motion is simulated in the page. */
  readonly node: NodeBehind | null;
  /** Declarations of all parameters that a page can set, `ballast.<name>` and ghost's among them. */
  parameters(): readonly Parameter[];
  /** The present values by name; after going back, those of that time. */
  values(): Values;
  ghost(): GhostChoice;
  body(): BodyInfo;

  /** Start a take of a bundled scene. */
  openScene(name: string): string | null;
  /** Start a take with a bundled body, and otherwise with the present parameters. */
  openBody(name: string): string | null;
  /** Start a take with a mesh file (.obj, .stl, .ply, .glb), and otherwise with the present parameters. scale: of all
   * three axes [m per mesh unit]. */
  openMesh(name: string, bytes: Uint8Array, scale?: number): string | null;
  /** Open a take of link() or of a saved file; for a take of another version, `notice()` names the version. */
  openLink(text: string): Promise<string | null>;
  /** A notice about what was opened last, or "". */
  notice(): string;

  /** The present state. */
  snapshot(): Snapshot;
  /** Advance to this time; entries of the take up to endNs act again. No-op for past times. */
  advance(untilNs: number): void;
  /** Apply a command now; drops everything after now. */
  submit(entry: Entry): string | null;
  /** The same as submit({set: values}). */
  set(values: Values): string | null;
  /** Set another ghost, from the start of the take. */
  setGhost(choice: Partial<GhostChoice>): string | null;
  /** Where a ray [m, world] first meets the present body. */
  firstHit(origin: Vec3, direction: Vec3): Hit | null;

  history(): History;
  /** Go to any time of the take up to endNs, with bit-identical states. */
  goTo(timeNs: number): void;
  /** Continue from here: everything after now is dropped. */
  goOn(): void;
  /** Start a new take at time 0, with the present parameters. */
  reset(): void;

  /** Difference of the present state to that of a second flight of the take, ten times as accurate. Throws Refused. */
  sensitivity(): Sensitivity;

  take(): TakeFiles;
  /** The state_hash of `rigid_proto simulate --json`, a hexadecimal SHA-256. */
  hash(): Promise<string>;
  /** Scene and take as text for an address's fragment (#); "" for a mesh that isn't bundled. */
  link(): Promise<string>;
  /** The page's file with scene, take and mesh, for saving as .html. */
  file(): Promise<Blob>;

  /** Call changed() after each change of body, parameters, ghost or history, but not of time; returns a function that
   * ends this. */
  watch(changed: () => void): () => void;
  /** Set the receiver of later messages, such as a node's refusals. */
  hear(said: (line: string) => void): void;
}

/** Makes the motion that is simulated in the page (`openMotion` in simulation.ts), from `inside("kernels")`,
 * `inside("data")` and `inside("take")` (file.ts). It starts with the scene or take in the file. */
export type OpenMotion = (
  kernels: Uint8Array<ArrayBuffer>, data: Uint8Array<ArrayBuffer>, take?: Uint8Array<ArrayBuffer> | null,
) => Promise<Motion>;
