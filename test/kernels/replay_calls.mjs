// SPDX-License-Identifier: MIT
// Repeats what recorded_calls.py recorded by the kernels in WebAssembly, and compares every byte of memory and every
// number returned: replay_calls.mjs MODULE FILE [KERNEL ARRAY], where calls of that kernel get that array empty. Prints how many calls of each kernel were equal; status 1 if any wasn't.
//
// Numbers that are no numbers count as equal, whatever their bits: WebAssembly leaves open which of them an operation gives.
import fs from "node:fs";
import zlib from "node:zlib";

const PAGE = 65536;
const [modulePath, filePath, otherKernel, emptied] = process.argv.slice(2);
const MOST_KNOWN = 2 ** 28;

// The file, a part at a time: whole it would take gigabytes.
const parts = fs.createReadStream(filePath).pipe(zlib.createGunzip({ chunkSize: 1 << 20 }))[Symbol.asyncIterator]();
let content = Buffer.alloc(0);
async function read(bytes) {
  const more = [content];
  for (let length = content.length; length < bytes; ) {
    const { value, done } = await parts.next();
    if (done) return false;
    more.push(value);
    length += value.length;
  }
  if (more.length > 1) content = Buffer.concat(more);
  return true;
}
async function take(bytes) {
  if (content.length < bytes && !(await read(bytes))) throw new Error(`${filePath} ends within a call`);
  const taken = content.subarray(0, bytes);
  content = content.subarray(bytes);
  return taken;
}

await read(1);
while (content.indexOf(10) < 0) await read(content.length + 1);
const kernels = JSON.parse((await take(content.indexOf(10) + 1)).toString("utf8"));
const module = new WebAssembly.Module(fs.readFileSync(modulePath));
const imports = WebAssembly.Module.imports(module);
if (imports.length) throw new Error(`the module asks for ${JSON.stringify(imports)}`);
const { exports } = new WebAssembly.Instance(module, {});
const memory = exports.memory;
const block = Math.ceil(Number(exports.__heap_base.value) / 64) * 64;
const base = block + 64 * 64;
const known = new Map(); // what the last call with a region left there
let knownBytes = 0;

const xor = (a, b) => {
  const out = Buffer.from(a);
  for (let k = 0; k < out.length; k++) out[k] ^= b[k];
  return out;
};
const isNaNAt = (bytes, at) => Number.isNaN(bytes.readDoubleLE(at));
function same(a, b) {
  if (a.equals(b)) return true;
  for (let at = 0; at + 8 <= a.length; at += 8) {
    if (a.readBigUInt64LE(at) !== b.readBigUInt64LE(at) && !(isNaNAt(a, at) && isNaNAt(b, at))) return false;
  }
  const rest = a.length - (a.length % 8);
  return a.subarray(rest).equals(b.subarray(rest));
}

const counts = new Map(kernels.map(({ name }) => [name, { equal: 0, different: 0 }]));
while (await read(1)) {
  const { name, returns, slots, addresses, lengths } = kernels[(await take(2)).readUInt16LE()];
  const given = Buffer.from(await take(8 * slots));
  const returned = Buffer.from(await take(8 * returns));
  const regions = [];
  let next = base;
  for (let left = (await take(2)).readUInt16LE(); left > 0; left--) {
    const address = (await take(8)).readBigUInt64LE();
    const size = (await take(4)).readUInt32LE();
    const key = `${address} ${size}`;
    const change = await take(size);
    const before = known.has(key) ? xor(change, known.get(key)) : Buffer.from(change);
    const after = xor(await take(size), before);
    knownBytes += known.has(key) ? 0 : size;
    known.set(key, after);
    // Aligned as it was.
    const place = Math.ceil(next / 64) * 64 + Number(address % 64n);
    next = place + size;
    regions.push({ address, size, place, before, after });
  }
  if (knownBytes > MOST_KNOWN) {
    known.clear();
    knownBytes = 0;
  }
  if (next > memory.buffer.byteLength) memory.grow(Math.ceil((next - memory.buffer.byteLength) / PAGE));
  const bytes = Buffer.from(memory.buffer);
  for (const slot of addresses) {
    const address = given.readBigUInt64LE(8 * slot);
    const of = regions.find((region) => address >= region.address && address < region.address + BigInt(region.size));
    // An array without elements has no region, and its address doesn't matter.
    given.writeBigUInt64LE(BigInt(of ? of.place + Number(address - of.address) : base), 8 * slot);
  }
  if (name === otherKernel) given.writeBigUInt64LE(0n, 8 * lengths[emptied]);
  for (const { place, before } of regions) before.copy(bytes, place);
  given.copy(bytes, block);
  exports[name](block);
  const after = Buffer.from(memory.buffer);
  const good =
    same(after.subarray(block, block + 8 * returns), returned) &&
    regions.every(({ place, size, after: wanted }) => same(after.subarray(place, place + size), wanted));
  counts.get(name)[good ? "equal" : "different"]++;
}
const all = [...counts].filter(([, { equal, different }]) => equal + different > 0);
const different = all.reduce((sum, [, count]) => sum + count.different, 0);
console.log(JSON.stringify({ equal: all.reduce((sum, [, count]) => sum + count.equal, 0), different, kernels: Object.fromEntries(all) }));
process.exitCode = different ? 1 : 0;
