// SPDX-License-Identifier: MIT
//
// Numbers and values formatted as in Python and YAML, so that messages and files are the same.

import type { Value } from "./source.ts";

/** Python's repr of a double: the shortest decimal number that converts back to it. */
export function repr(x: number): string {
  if (Number.isNaN(x)) return "nan";
  if (!Number.isFinite(x)) return x > 0 ? "inf" : "-inf";
  if (Object.is(x, -0)) return "-0.0";
  const size = Math.abs(x);
  if (size !== 0 && (size < 1e-4 || size >= 1e16)) return pythonExponent(x.toExponential());
  const text = String(x).includes("e") ? x.toFixed(20).replace(/0+$/, "") : String(x);
  return text.includes(".") ? text : `${text}.0`;
}

/** Python's `{x:.Ng}`. */
export function general(x: number, digits: number): string {
  if (!Number.isFinite(x)) return repr(x);
  const [mantissa = "0", exponent = "0"] = rounded(x, digits).split("e");
  const trimmed = mantissa.includes(".") ? mantissa.replace(/\.?0+$/, "") : mantissa;
  const power = Number(exponent);
  if (power < -4 || power >= digits) return pythonExponent(`${trimmed}e${power}`);
  const sign = trimmed.startsWith("-") ? "-" : "", figures = trimmed.replace(/[-.]/g, "");
  if (power < 0) return `${sign}0.${"0".repeat(-1 - power)}${figures}`;
  const whole = figures.padEnd(power + 1, "0");
  return sign + (whole.length > power + 1 ? `${whole.slice(0, power + 1)}.${whole.slice(power + 1)}` : whole);
}

/** toExponential, with ties rounded to even. */
function rounded(x: number, digits: number): string {
  const [mantissa = "", exponent = "0"] = x.toExponential(80).split("e");
  const cut = mantissa.indexOf(".") + digits, kept = mantissa.slice(0, cut).replace(/\.$/, "");
  const isHalf = /^50*$/.test(mantissa.slice(cut)), isEven = "02468".includes(kept.at(-1) ?? "");
  return isHalf && isEven ? `${kept}e${exponent}` : x.toExponential(digits - 1);
}

function pythonExponent(text: string): string {
  const [mantissa = "", exponent = "0"] = text.split("e");
  const power = Math.abs(Number(exponent)).toString().padStart(2, "0");
  return `${mantissa}e${exponent.startsWith("-") ? "-" : "+"}${power}`;
}

/** Three digits, rounded down, because a limit that is rounded up would be refused itself. */
function roundedDown(x: number): string {
  const power = Math.floor(Math.log10(Math.abs(x)));
  const exact = x.toExponential(20);
  const kept = Number(`${exact.slice(0, exact.indexOf(".") + 3)}e${exact.split("e")[1] ?? power}`);
  return general(kept, 6);
}

/** A text with its placeholders filled, such as {0:.3g} (see page/words.py); placeholders without a
 * format take texts. */
export function filled(text: string, values: Readonly<Record<string, string | number>>): string {
  return text.replace(/\{(\w+)(?::([^}]*))?\}/g, (place, name: string, how: string | undefined) => {
    const value = values[name];
    if (value === undefined) return place;
    if (typeof value === "string") return value;
    if (how === "down3") return roundedDown(value);
    const digits = /^\.?(\d*)g$/.exec(how ?? "");
    if (digits !== null) return general(value, Number(digits[1] || "6"));
    return how === undefined ? String(value) : repr(value);
  });
}

/** The nearest integer, with ties rounded to even. */
export function nearest(x: number): number {
  const low = Math.floor(x), rest = x - low;
  if (rest === 0.5) return low % 2 === 0 ? low : low + 1;
  return rest < 0.5 ? low : low + 1;
}

/** Convert seconds to nanoseconds. */
export const nanoseconds = (seconds: number): number => nearest(seconds * 1e9);

/** A value as in Python's messages. */
export function shown(value: unknown): string {
  if (typeof value === "number") return repr(value);
  if (typeof value === "boolean") return value ? "True" : "False";
  if (typeof value === "string") return value.includes("'") && !value.includes('"') ? `"${value}"` : `'${value.replaceAll("'", "\\'")}'`;
  if (Array.isArray(value)) return `[${value.map(shown).join(", ")}]`;
  return value === null || value === undefined ? "None" : String(value);
}

/** A parameter's value in a YAML file; a double has a decimal point, so that it is read back as a double. */
export function yamlValue(value: Value): string {
  if (typeof value === "number") return yamlNumber(value);
  if (typeof value === "object") return `[${value.map(yamlNumber).join(", ")}]`;
  return JSON.stringify(value);
}

function yamlNumber(x: number): string {
  const text = repr(x);
  return /[.n]/.test(text) ? text : text.replace("e", ".0e");
}

const WORD = /^(?!(?:null|yes|true|false|off)$)[a-z_]{3,}$/;

/** Plain data as YAML on one line; integers, such as a vertex number, are given as `Whole`. */
export function flow(value: unknown): string {
  if (value instanceof Whole) return String(value.number);
  if (typeof value === "number") return yamlNumber(value);
  if (Array.isArray(value)) return `[${value.map(flow).join(", ")}]`;
  if (typeof value === "string") return WORD.test(value) ? value : JSON.stringify(value);
  if (typeof value === "object" && value !== null) return `{${Object.entries(value).map(([key, each]) => `${key}: ${flow(each)}`).join(", ")}}`;
  return JSON.stringify(value);
}

/** An integer, written without a decimal point. */
export class Whole {
  readonly number: number;

  constructor(number: number) {
    this.number = number;
  }
}

const LONGEST = 4000;

/** Refused input. The message is one line for the user, of limited length and without invisible characters. */
export class Refused extends Error {
  constructor(message: string) {
    super(message.slice(0, LONGEST).replace(/[\p{C}\p{Zl}\p{Zp}]/gu, "?"));
  }
}
