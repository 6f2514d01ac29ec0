// SPDX-License-Identifier: MIT
//
// SHA-256 (FIPS 180-4). Browsers offer their own only in secure contexts, which a page served over plain HTTP isn't.

const fraction = (x: number): number => (x - Math.floor(x)) * 4294967296 | 0;
const PRIMES = Array.from({ length: 400 }, (_, k) => k + 2).filter((n, _, all) => !all.some((p) => p < n && n % p === 0)).slice(0, 64);
const START = PRIMES.slice(0, 8).map((p) => fraction(Math.sqrt(p)));
const ROUNDS = PRIMES.map((p) => fraction(Math.cbrt(p)));

const turned = (x: number, n: number): number => (x >>> n) | (x << (32 - n));

/** The hexadecimal digest of bytes. */
export function sha256(bytes: Uint8Array): string {
  const blocks = Math.ceil((bytes.length + 9) / 64);
  const padded = new Uint8Array(64 * blocks), view = new DataView(padded.buffer);
  padded.set(bytes);
  padded[bytes.length] = 0x80;
  view.setUint32(64 * blocks - 8, Math.floor(bytes.length / 536870912));
  view.setUint32(64 * blocks - 4, (bytes.length * 8) >>> 0);
  const state = Int32Array.from(START), w = new Int32Array(64);
  for (let at = 0; at < padded.length; at += 64) addBlock(state, w, view, at);
  return [...state].map((x) => (x >>> 0).toString(16).padStart(8, "0")).join("");
}

function addBlock(state: Int32Array, w: Int32Array, view: DataView, at: number): void {
  const word = (k: number): number => w[k] ?? 0;
  for (let k = 0; k < 16; k++) w[k] = view.getInt32(at + 4 * k);
  for (let k = 16; k < 64; k++) {
    const a = word(k - 15), b = word(k - 2);
    w[k] = word(k - 16) + (turned(a, 7) ^ turned(a, 18) ^ (a >>> 3)) + word(k - 7) + (turned(b, 17) ^ turned(b, 19) ^ (b >>> 10));
  }
  let [a = 0, b = 0, c = 0, d = 0, e = 0, f = 0, g = 0, h = 0] = state;
  for (let k = 0; k < 64; k++) {
    const one = (h + (turned(e, 6) ^ turned(e, 11) ^ turned(e, 25)) + ((e & f) ^ (~e & g)) + (ROUNDS[k] ?? 0) + word(k)) | 0;
    const two = ((turned(a, 2) ^ turned(a, 13) ^ turned(a, 22)) + ((a & b) ^ (a & c) ^ (b & c))) | 0;
    [h, g, f, e, d, c, b, a] = [g, f, e, (d + one) | 0, c, b, a, (one + two) | 0];
  }
  [a, b, c, d, e, f, g, h].forEach((x, k) => (state[k] = (state[k] ?? 0) + x));
}
