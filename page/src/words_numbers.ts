// SPDX-License-Identifier: MIT
//
// Numbers as people read and type them.

/** Three figures, without an exponent where people wouldn't write one, with a true minus sign. */
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

/** A number as people type it, with comma or point; NaN where it is none. */
export function read(text: string): number {
  const plain = text.trim().replace(/−/g, "-").replace(/\s/g, "").replace(/·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)$/, (_, power: string) =>
    `e${[...power].map((c) => (c === "⁻" ? "-" : "⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(c))).join("")}`);
  // A comma with a point after it groups thousands; alone it is the point.
  const pointed = /,\d{3}(,\d{3})*\./.test(plain) ? plain.replace(/,/g, "") : plain.replace(",", ".");
  return /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(pointed) ? Number(pointed) : NaN;
}
