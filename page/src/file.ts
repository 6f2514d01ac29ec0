// SPDX-License-Identifier: MIT
//
// The page's own HTML file: its embedded data (build.mjs), and a copy of it with another take.

import { base64, compressed, expanded, fromBase64 } from "./packing.ts";
import type { Bytes } from "./packing.ts";

const MOST = 400_000_000;

/** The page's text before the program has changed the document. */
const pristine = typeof document === "undefined" ? "" : `<!doctype html>\n${document.documentElement.outerHTML}`;

/** An embedded part of the file, decompressed; null if it is empty. */
export async function inside(part: "kernels" | "data" | "take"): Promise<Bytes | null> {
  const text = document.getElementById(part)?.textContent?.trim() ?? "";
  return text === "" ? null : expanded(fromBase64(text), "gzip", MOST);
}

/** A copy of the page's file that opens with this take. */
export async function fileWith(take: Bytes): Promise<Blob> {
  const text = base64(await compressed(take, "gzip"));
  const whole = pristine.replace(/(<script[^>]*\bid="take"[^>]*>)[^<]*/, (_, head: string) => head + text);
  return new Blob([whole], { type: "text/html" });
}
