// SPDX-License-Identifier: MIT
//
// Conversion and checks of parameter values, by Python's declarations.

import type { Declarations } from "./data.ts";
import { filled, Refused, shown } from "./numbers.ts";
import type { Parameter, Value, Values } from "./source.ts";

/** Names of ballast and contacts. */
const NAME = /^[a-z][a-z0-9_]*$/;
const PATTERNS = ["ballast.", "contacts."];

export class Parameters {
  readonly all: readonly Parameter[];
  readonly #byName: ReadonlyMap<string, Parameter>;
  readonly #accepted: string;

  constructor(declared: Declarations) {
    this.all = declared.parameters;
    this.#byName = new Map(this.all.map((one) => [one.name, one]));
    this.#accepted = declared.words.accepted;
  }

  /** The declaration behind a name. Throws Refused. */
  named(name: string): Parameter {
    const known = this.#byName.get(name);
    if (known !== undefined && !known.name.includes("<")) return known;
    const prefix = PATTERNS.find((each) => name.startsWith(each));
    const pattern = prefix === undefined ? undefined : this.#byName.get(`${prefix}<name>`);
    if (prefix === undefined || pattern === undefined || !NAME.test(name.slice(prefix.length))) {
      throw new Refused(`parameter: there is no parameter ${shown(name)}`);
    }
    return { ...pattern, name };
  }

  /** The default of every parameter that has one. */
  defaults(): Record<string, Value> {
    return Object.fromEntries(this.all.flatMap((one) => (one.default === null ? [] : [[one.name, one.default]])));
  }

  /** A value in the parameter's type. Throws Refused. */
  converted(name: string, value: unknown): Value {
    const declared = this.named(name);
    const typed = typedValue(declared, value);
    if (typed === null || !isWithin(declared, typed)) {
      const received = shown(value);
      throw new Refused(filled(this.#accepted, { 0: name, 1: received.length > 80 ? `${received.slice(0, 77)}...` : received, 2: declared.accepted }));
    }
    return typed;
  }

  /** Checked changes of parameters in flight; setting density sets mass to 0, since mass overrides it.
   * Throws Refused. */
  changes(changes: unknown): Record<string, Value> {
    if (typeof changes !== "object" || changes === null || Array.isArray(changes) || Object.keys(changes).length === 0) {
      throw new Refused(filled(this.#accepted, { 0: "set", 1: shown(changes), 2: "{parameter: value, ...}" }));
    }
    const found: Record<string, Value> = {};
    for (const [name, value] of Object.entries(changes)) found[name] = this.converted(name, value);
    return "density" in found && !("mass" in found) ? { ...found, mass: 0 } : found;
  }

  /** The mesh, and values that differ from their defaults. */
  changed(values: Values): Record<string, Value> {
    const defaults = this.defaults();
    return Object.fromEntries(
      Object.entries(values).filter(([name, value]) => name === "mesh" || JSON.stringify(value) !== JSON.stringify(defaults[name])),
    );
  }
}

function typedValue(declared: Parameter, value: unknown): Value | null {
  switch (declared.type) {
    case "bool":
      return typeof value === "boolean" ? value : null;
    case "string":
      return typeof value === "string" ? value : null;
    case "doubles": {
      const numbers: unknown[] = typeof value === "number" ? [value] : Array.isArray(value) ? value : [];
      return numbers.length > 0 && numbers.every((x) => typeof x === "number") ? numbers : null;
    }
    case "integer":
      return typeof value === "number" && Number.isInteger(value) ? value : null;
    case "double":
      return typeof value === "number" ? value : null;
  }
}

function isWithin(declared: Parameter, value: Value): boolean {
  if (typeof value === "boolean") return true;
  if (typeof value === "string") return declared.choices.length === 0 || declared.choices.includes(value);
  const numbers = typeof value === "number" ? [value] : value;
  if (declared.lengths.length > 0 && !declared.lengths.includes(numbers.length)) return false;
  const { lower, upper, above } = declared;
  return numbers.every(
    (x) => Number.isFinite(x) && (lower === null || (above ? x > lower : x >= lower)) && (upper === null || x <= upper),
  );
}
