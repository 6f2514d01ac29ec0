// SPDX-License-Identifier: MIT
//
// One flight in the kernels' memory: start, advance, commands, saving and restoring its state. The operations and their
// order are those of rigid_proto_ros/simulation/simulation.py, so the results are the same bit for bit.

import type { Declarations } from "./data.ts";
import { Event, Flight, LoadRow, NUMBERS, Scene } from "./kernels.ts";
import type { Kernels, Vector } from "./kernels.ts";
import { filled, Refused } from "./numbers.ts";
import { fillScene, Refusals } from "./scene.ts";
import type { Command, Load } from "./script.ts";
import type { Values } from "./source.ts";
import type { Placed, Surfaces } from "./surface.ts";

/** Largest number of loads that act at the same time; more are most likely a mistake in a script. */
const ROWS = 1024;

/** The saved state of a flight. */
export interface Kept {
  readonly values: Values;
  readonly scene: Uint8Array;
  readonly flight: Uint8Array;
  readonly loads: Uint8Array;
  readonly room: Uint8Array;
  readonly failure: string;
}

export class Flown {
  readonly #kernels: Kernels;
  readonly #declared: Declarations;
  readonly #placed: Placed;
  readonly #surfaces: Surfaces;
  readonly #refusals: Refusals;
  readonly scene: Scene;
  readonly flight: Flight;
  readonly loads: Vector;
  readonly #events: Vector;
  readonly #room: Vector;
  readonly #newScene: Scene;
  readonly #scratch: Flight;
  readonly #slots: string[] = [];
  /** All present parameters. */
  values: Values = {};
  /** Why the motion stopped, or "". */
  failure = "";

  constructor(kernels: Kernels, declared: Declarations, placed: Placed, surfaces: Surfaces, refusals: Refusals) {
    const memory = kernels.memory;
    this.#kernels = kernels;
    this.#declared = declared;
    this.#placed = placed;
    this.#surfaces = surfaces;
    this.#refusals = refusals;
    this.scene = new Scene(memory);
    this.#newScene = new Scene(memory);
    this.flight = new Flight(memory);
    this.#scratch = new Flight(memory);
    this.loads = { at: memory.reserve(ROWS * LoadRow.SIZE), n: ROWS };
    const events = 4 * ROWS + 4;
    this.#events = { at: memory.reserve(events * Event.SIZE), n: events };
    this.#room = memory.numbers(declared.room);
  }

  get timeNs(): number {
    return this.flight.nowNs;
  }

  load(row: number): LoadRow {
    return new LoadRow(this.#kernels.memory, this.loads.at + row * LoadRow.SIZE);
  }

  slotName(number: number): string {
    return this.#slots[number - NUMBERS.command.UNNAMED_SLOT - 1] ?? "";
  }

  /** Start at time 0 with these parameters, on the present surface. Throws Refused and then changes nothing. */
  begin(values: Values): void {
    const memory = this.#kernels.memory;
    this.#check(values);
    memory.u1(this.scene.at, Scene.SIZE).set(memory.u1(this.#newScene.at, Scene.SIZE));
    memory.u1(this.flight.at, Flight.SIZE).set(memory.u1(this.#scratch.at, Flight.SIZE));
    memory.u1(this.#room.at, 8 * this.#room.n).fill(0);
    this.values = values;
    this.failure = "";
    this.#operate(NUMBERS.operation.BEGIN);
  }

  /** Check parameters: puts their scene into newScene and the flight's start into scratch. Throws Refused. */
  #check(values: Values): void {
    const memory = this.#kernels.memory, placed = this.#placed, { refusal } = NUMBERS;
    fillScene(this.#newScene, values, this.#declared);
    for (;;) {
      memory.u1(this.#scratch.at, Flight.SIZE).fill(0);
      if (this.#kernels.begin(this.#newScene, placed.record, this.#scratch, this.#refusals.record)) return;
      const model = this.#refusals.record.detail;
      const provided = this.#refusals.code === refusal.NO_MOMENTS && placed.surface !== null
        && this.#surfaces.provide(placed.record, placed.surface, model, this.#newScene.scale);
      const hasParts = placed.surface?.volume !== undefined && this.#declared.models[model] === "walled";
      if (!provided) throw new Refused(hasParts ? this.#declared.words.parts : this.#refusals.words(values));
    }
  }

  /** Advance; stops in the last good state if the motion fails. */
  fly(untilNs: number): void {
    const { operation, flight } = NUMBERS;
    if (this.failure !== "" || untilNs <= this.timeNs) return;
    this.#none();
    if (this.#operate(operation.FLY, untilNs) === flight.REACHED) return;
    const [words, pushes] = this.#declared.words.failure;
    this.failure = filled(words, { 0: this.flight.committedNs * 1e-9 });
    const string = this.flight.string, { REST, PUSHES } = NUMBERS.string;
    if (this.flight.tied && string[PUSHES] !== 0 && string[REST] !== 0) this.failure += pushes;
    this.#operate(operation.FINISH);
  }

  /** End the loads and the string that end now; returns whether there were any. */
  endDue(): boolean {
    return this.#operate(NUMBERS.operation.END_DUE) !== 0;
  }

  /** Start a new segment, after all commands of one time. */
  cut(): void {
    this.#operate(NUMBERS.operation.CUT);
  }

  /** Apply a command now. Throws Refused. */
  command(command: Exclude<Command, { set: unknown }>): void {
    const { kernels, placed } = { kernels: this.#kernels, placed: this.#placed };
    const number = this.flight.acting;
    if (number >= ROWS - 1) throw new Refused(`${ROWS} loads act at once, and no more can`);
    this.#put(number, command);
    const memory = kernels.memory, before = memory.u1(this.flight.at, Flight.SIZE).slice();
    const done = kernels.command(
      this.scene, placed.record, placed.vertices, placed.triangles, this.flight, this.loads, this.#events, this.#refusals.record,
    );
    if (done) return;
    const words = this.#refusals.words(this.values, command.frame, placed.vertices.n);
    memory.u1(this.flight.at, Flight.SIZE).set(before);
    throw new Refused(words);
  }

  #put(number: number, command: Load): void {
    const row = this.load(number), { NO_SLOT, UNNAMED_SLOT } = NUMBERS.command;
    row.memory.u1(row.at, LoadRow.SIZE).fill(0);
    row.atNs = this.timeNs;
    row.durationNs = command.durationNs;
    row.kind = command.kind;
    row.slot = command.slot === null ? NO_SLOT : command.slot === "" ? UNNAMED_SLOT : UNNAMED_SLOT + 1 + this.#slot(command.slot);
    row.load.set(command.load);
    this.flight.due = number;
    this.flight.dueEnd = number + 1;
  }

  #slot(name: string): number {
    const known = this.#slots.indexOf(name);
    return known >= 0 ? known : this.#slots.push(name) - 1;
  }

  /** Continue with other parameters, on the present surface. sameMesh: the mesh hasn't changed. Throws Refused. */
  change(values: Values, sameMesh: boolean): void {
    const kernels = this.#kernels, memory = kernels.memory;
    this.#check(values);
    const old = this.scene, refusal = this.#refusals.record;
    const done = kernels.change(old, this.#newScene, this.#placed.record, sameMesh, this.flight, this.loads, this.#room, refusal);
    if (!done) throw new Refused(this.#refusals.words(values));
    memory.u1(old.at, Scene.SIZE).set(memory.u1(this.#newScene.at, Scene.SIZE));
    this.values = values;
  }

  #none(): void {
    this.flight.due = this.flight.dueEnd = this.flight.acting;
  }

  #operate(what: number, untilNs = 0): number {
    return this.#kernels.operate(this.flight, this.loads, this.#events, this.#room, what, untilNs);
  }

  keep(): Kept {
    const memory = this.#kernels.memory;
    return {
      values: this.values,
      scene: memory.u1(this.scene.at, Scene.SIZE).slice(),
      flight: memory.u1(this.flight.at, Flight.SIZE).slice(),
      loads: memory.u1(this.loads.at, this.flight.acting * LoadRow.SIZE).slice(),
      room: memory.u1(this.#room.at, 8 * this.#room.n).slice(),
      failure: this.failure,
    };
  }

  putBack(kept: Kept): void {
    const memory = this.#kernels.memory;
    this.values = kept.values;
    this.failure = kept.failure;
    memory.u1(this.scene.at, Scene.SIZE).set(kept.scene);
    memory.u1(this.flight.at, Flight.SIZE).set(kept.flight);
    memory.u1(this.loads.at, kept.loads.length).set(kept.loads);
    memory.u1(this.#room.at, kept.room.length).set(kept.room);
  }
}
