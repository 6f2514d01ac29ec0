// SPDX-License-Identifier: MIT
//
// The page's own file: what it holds beside the program (build.mjs), and itself with another take.

import { base64, compressed, expanded, fromBase64 } from "./packing.ts";
import type { Bytes } from "./packing.ts";

const MOST = 400_000_000;

/** The page as it was before the program changed anything. */
const pristine = typeof document === "undefined" ? "" : `<!doctype html>\n${document.documentElement.outerHTML}`;

/** A part of the file, expanded; null where it is empty. */
export async function inside(part: "kernels" | "data" | "take"): Promise<Bytes | null> {
  const text = document.getElementById(part)?.textContent?.trim() ?? "";
  return text === "" ? null : expanded(fromBase64(text), "gzip", MOST);
}

/** The page's file that begins with another take. */
export async function fileWith(take: Bytes): Promise<Blob> {
  const text = base64(await compressed(take, "gzip"));
  const whole = pristine.replace(/(<script[^>]*\bid="take"[^>]*>)[^<]*/, (_, head: string) => head + text);
  return new Blob([whole], { type: "text/html" });
}
