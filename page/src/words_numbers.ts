// SPDX-License-Identifier: MIT
//
// Formatting and parsing of numbers for the user.

/** A number with three significant digits, an exponent only for very large or small numbers, and a typographic minus
 * sign. */
export function short(value: number, figures = 3): string {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  let text = size === 0 ? "0" : size >= 1e5 || size < 1e-4 ? value.toExponential(figures - 1) : size >= 10 ** figures ? value.toFixed(0) : value.toPrecision(figures);
  if (text.includes(".") && !text.includes("e")) text = text.replace(/\.?0+$/, "");
  text = text.replace(/e\+?(-?)(\d+)$/, (_, sign: string, power: string) => `·10${raised(sign + power)}`);
  return text.replace("-", "−");
}

function raised(power: string): string {
  return [...power].map((c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(c)])).join("");
}

/** Parse a typed number, with comma or point; NaN if it isn't a number. */
export function read(text: string): number {
  const plain = text.trim().replace(/−/g, "-").replace(/\s/g, "").replace(/·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)$/, (_, power: string) =>
    `e${[...power].map((c) => (c === "⁻" ? "-" : "⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(c))).join("")}`);
  // A comma before a point is a thousands separator; otherwise it is the decimal separator.
  const pointed = /,\d{3}(,\d{3})*\./.test(plain) ? plain.replace(/,/g, "") : plain.replace(",", ".");
  return /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(pointed) ? Number(pointed) : NaN;
}
