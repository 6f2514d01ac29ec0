// SPDX-License-Identifier: MIT
//
// Base64 and compression, for links and the page's file.

import { Refused } from "./numbers.ts";

export type Bytes = Uint8Array<ArrayBuffer>;
type Format = "gzip" | "deflate-raw";

const PIECE = 0x8000;

export function base64(bytes: Uint8Array): string {
  let text = "";
  for (let at = 0; at < bytes.length; at += PIECE) text += String.fromCharCode(...bytes.subarray(at, at + PIECE));
  return btoa(text);
}

/** Decode base64; throws Refused if the text isn't base64. */
export function fromBase64(text: string): Bytes {
  try {
    return Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  } catch {
    throw new Refused("the text is damaged: it is no base64");
  }
}

/** Base64 for URLs. */
export const base64url = (bytes: Uint8Array): string => base64(bytes).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
export const fromBase64url = (text: string): Bytes => fromBase64(text.replaceAll("-", "+").replaceAll("_", "/"));

export const compressed = (bytes: Bytes, format: Format): Promise<Bytes> => through(bytes, new CompressionStream(format), Infinity);

/** Decompress; throws Refused for damaged data, and if the result is larger than `most`. */
export async function expanded(bytes: Bytes, format: Format, most: number): Promise<Bytes> {
  try {
    return await through(bytes, new DecompressionStream(format), most);
  } catch (error) {
    throw error instanceof Refused ? error : new Refused("the text is damaged: it can't be expanded");
  }
}

async function through(bytes: Bytes, stream: CompressionStream | DecompressionStream, most: number): Promise<Bytes> {
  const parts: Uint8Array[] = [];
  let length = 0;
  const reader = new Blob([bytes]).stream().pipeThrough(stream).getReader();
  for (let step = await reader.read(); !step.done; step = await reader.read()) {
    length += step.value.length;
    if (length > most) {
      await reader.cancel();
      throw new Refused(`more than ${most} bytes`);
    }
    parts.push(step.value);
  }
  const whole = new Uint8Array(length);
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}
