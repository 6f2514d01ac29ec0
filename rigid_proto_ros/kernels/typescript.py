# SPDX-License-Identifier: MIT
"""TypeScript code that reads and writes records in the memory of the WebAssembly module and calls its kernels."""

from __future__ import annotations

import json
from typing import Any

from ..mass import moments as of_mesh
from ..mass import tensor as of_tensor
from ..motion import body as of_body
from ..motion import loads as of_load
from ..motion import string as of_string
from ..simulation import commands, effects, flight, quantities, record, refusals
from .layouts import description

_HEAD = """\
// SPDX-License-Identifier: MIT
// Made by `make kernels` from the kernels and records of rigid_proto_ros: change those.
//
// Records and arrays lie in the memory of the WebAssembly module and are known by their address. An integer of 64 bits
// is a number here, exact up to 2^53. A view of several numbers, such as a record's `row`, is one of the memory as it
// is now: it ends when memory grows, which only `reserve` does.

/** The sources that kernels and layouts are made from. */
export const STAMP = "@STAMP@";

/** An array in memory: its address, and its extents as far as it has them. */
export interface Vector { readonly at: number; readonly n: number }
export interface Matrix { readonly at: number; readonly n: number; readonly m: number }
export interface Array3 { readonly at: number; readonly n: number; readonly m: number; readonly k: number }
/** A record in memory, or its address. */
export type Place = number | { readonly at: number };

const PAGE = 65536;
const HIGH = 4294967296;

const address = (place: Place): number => (typeof place === "number" ? place : place.at);

/** Memory of the module, and what reads and writes single numbers in it. */
export class Memory {
  readonly memory: WebAssembly.Memory;
  view: DataView;
  #next: number;

  constructor(memory: WebAssembly.Memory, next: number) {
    this.memory = memory;
    this.view = new DataView(memory.buffer);
    this.#next = next;
  }

  /** Address of so many bytes of zeros, at a multiple of 64. They stay until a mark from before is released. */
  reserve(bytes: number): number {
    const at = Math.ceil(this.#next / 64) * 64;
    this.#next = at + bytes;
    const lacking = this.#next - this.memory.buffer.byteLength;
    if (lacking > 0) {
      this.memory.grow(Math.ceil(lacking / PAGE));
      this.view = new DataView(this.memory.buffer);
    }
    new Uint8Array(this.memory.buffer, at, bytes).fill(0);
    return at;
  }

  /** What is reserved from now on goes when the mark is released. */
  mark(): number { return this.#next; }
  release(mark: number): void { this.#next = mark; }

  numbers(n: number): Vector { return { at: this.reserve(8 * n), n }; }
  matrix(n: number, m: number): Matrix { return { at: this.reserve(8 * n * m), n, m }; }

  f8(at: number, n: number): Float64Array { return new Float64Array(this.memory.buffer, at, n); }
  f4(at: number, n: number): Float32Array { return new Float32Array(this.memory.buffer, at, n); }
  i8(at: number, n: number): BigInt64Array { return new BigInt64Array(this.memory.buffer, at, n); }
  i4(at: number, n: number): Int32Array { return new Int32Array(this.memory.buffer, at, n); }
  u1(at: number, n: number): Uint8Array { return new Uint8Array(this.memory.buffer, at, n); }
  b1(at: number, n: number): Uint8Array { return new Uint8Array(this.memory.buffer, at, n); }

  getF8(at: number): number { return this.view.getFloat64(at, true); }
  setF8(at: number, x: number): void { this.view.setFloat64(at, x, true); }
  getF4(at: number): number { return this.view.getFloat32(at, true); }
  setF4(at: number, x: number): void { this.view.setFloat32(at, x, true); }
  getI8(at: number): number { return this.view.getInt32(at + 4, true) * HIGH + this.view.getUint32(at, true); }
  setI8(at: number, x: number): void {
    const high = Math.floor(x / HIGH);
    this.view.setInt32(at + 4, high, true);
    this.view.setUint32(at, x - high * HIGH, true);
  }
  getI4(at: number): number { return this.view.getInt32(at, true); }
  setI4(at: number, x: number): void { this.view.setInt32(at, x, true); }
  getU1(at: number): number { return this.view.getUint8(at); }
  setU1(at: number, x: number): void { this.view.setUint8(at, x); }
  getB1(at: number): boolean { return this.view.getUint8(at) !== 0; }
  setB1(at: number, x: boolean): void { this.view.setUint8(at, x ? 1 : 0); }
}

"""
_LOADER = """\
interface Exports {
  readonly memory: WebAssembly.Memory;
  readonly __heap_base: WebAssembly.Global;
@EXPORTS@
}

/** The kernels. Their arrays and records are reserved in `memory`. */
export class Kernels {
  readonly memory: Memory;
  readonly #exports: Exports;
  readonly #block: number;

  private constructor(exports: Exports) {
    this.#exports = exports;
    this.memory = new Memory(exports.memory, Number(exports.__heap_base.value));
    this.#block = this.memory.reserve(@BLOCK@);
  }

  /** Make the kernels of a module's bytes. Throws an Error if it was made from other sources than this file. */
  static async load(bytes: BufferSource): Promise<Kernels> {
    const module = await WebAssembly.compile(bytes);
    const [section] = WebAssembly.Module.customSections(module, "kernels");
    const stamp = section === undefined ? "another kind" : new TextDecoder().decode(section);
    if (stamp !== STAMP) {
      throw new Error(`kernels.wasm is of ${stamp}, and this program of ${STAMP}: both are made by make kernels`);
    }
    const instance = await WebAssembly.instantiate(module, {});
    return new Kernels(instance.exports as unknown as Exports);
  }
"""
_NUMBERS: dict[str, tuple[Any, str]] = {
    "command": (
        commands,
        "HELD_WRENCH PULSE IMPULSE CLEAR TIE_STRING MOVE_STRING RELEASE_STRING SET_STATE NO_SLOT UNNAMED_SLOT",
    ),
    "operation": (effects, "FLY BEGIN CUT END_DUE FINISH"),
    "flight": (flight, "REACHED NEVER"),
    "refusal": (
        refusals,
        "NO_MOMENTS SCALE MASS TENSOR ORIENTATION INTEGRATOR RATE MAGNITUDE PULL UNRESOLVED OUT_OF_BOUNDS AT_FREE_END "
        "WALLS",
    ),
    "load": (
        of_load,
        "WORLD_AXES BODY_AXES NORMAL_AXES AT_COM AT_POINT AT_VERTEX ON_RAY LOAD LOAD_AXES PLACE POINT FORCE TORQUE "
        "NORMAL FORCE_WORLD FORCE_BODY",
    ),
    "body": (of_body, "MASS COM INERTIA MOMENTS AXES QUATERNION BODY_SCALE LENGTH BODY"),
    "string": (of_string, "KNOT ORIGIN TARGET REST PUSHES"),
    "quantity": (quantities, "KINETIC POTENTIAL INERTIA ROTOR STATE CONTEXT"),
    "moments": (of_mesh, "FOUND ROOM"),
    "tensor": (of_tensor, "NEARLY"),
    "scene": (record, "MAX_BALLASTS"),
}
"""Constants that kernels use as codes: by part, the module and the names in it."""
_SUFFIX = {"f8": "F8", "f4": "F4", "i8": "I8", "i4": "I4", "u1": "U1", "b1": "B1"}
_SHAPES = {1: ("Vector", ("n",)), 2: ("Matrix", ("n", "m")), 3: ("Array3", ("n", "m", "k"))}
_RESERVED = {"default", "new", "function", "class", "var", "with", "in", "this", "delete", "case", "enum"}


def source() -> str:
    """Text of the whole file."""
    described = description()
    records, kernels = described["records"], described["kernels"]
    exports = "\n".join(f"  {name}(block: number): void;" for name in kernels)
    slots = [len(of["returns"]) + sum(map(_slots, of["arguments"].values())) for of in kernels.values()]
    loader = _LOADER.replace("@EXPORTS@", exports).replace("@BLOCK@", str(8 * max(slots)))
    parts = [_HEAD.replace("@STAMP@", described["stamp"]), _numbers()]
    parts += [_record(name, of) for name, of in records.items()]
    parts += [loader, *(_kernel(name, of) for name, of in kernels.items()), "}\n"]
    return "".join(parts)


def _numbers() -> str:
    named = {part: {name: int(getattr(of, name)) for name in names.split()} for part, (of, names) in _NUMBERS.items()}
    about = "/** Numbers that kernels know things by, under Python's names. */"
    return f"{about}\nexport const NUMBERS = {json.dumps(named, indent=2)} as const;\n\n"


def class_name(record: str) -> str:
    """Name of a record's class: LoadRow for LOAD_ROW."""
    return record.title().replace("_", "")


def camel(name: str) -> str:
    """Name of a variable: nowNs for now_ns."""
    first, *others = name.strip("_").split("_")
    joined = first + "".join(other.capitalize() for other in others)
    return f"{joined}_" if joined in _RESERVED else joined


def _record(name: str, of: dict[str, Any]) -> str:
    lines = [
        f"/** A record of {of['size']} bytes. */",
        f"export class {class_name(name)} {{",
        f"  static readonly SIZE = {of['size']};",
        "  readonly memory: Memory;",
        "  readonly at: number;",
        "",
        f"  constructor(memory: Memory, at: number = memory.reserve({of['size']})) {{",
        "    this.memory = memory;",
        "    this.at = at;",
        "  }",
        "",
        *(line for field, what in of["fields"].items() for line in _accessors(camel(field), what)),
        "}",
        "",
        "",
    ]
    return "\n".join(lines)


def _accessors(name: str, what: dict[str, Any]) -> list[str]:
    kind, count, at = what["type"], what["count"], f"this.at + {what['offset']}"
    if kind not in _SUFFIX:
        one = class_name(kind)
        if count == 1:
            return [f"  get {name}(): {one} {{ return new {one}(this.memory, {at}); }}"]
        return [f"  {name}(k: number): {one} {{ return new {one}(this.memory, {at} + k * {one}.SIZE); }}"]
    if count > 1:
        views = {"f8": "Float64Array", "f4": "Float32Array", "i8": "BigInt64Array", "i4": "Int32Array"}
        view = views.get(kind, "Uint8Array")
        return [f"  get {name}(): {view} {{ return this.memory.{kind}({at}, {count}); }}"]
    number = "boolean" if kind == "b1" else "number"
    return [
        f"  get {name}(): {number} {{ return this.memory.get{_SUFFIX[kind]}({at}); }}",
        f"  set {name}(x: {number}) {{ this.memory.set{_SUFFIX[kind]}({at}, x); }}",
    ]


def _extents(declared: str) -> int:
    return declared.count(":")


def _slots(declared: str) -> int:
    return 1 + _extents(declared)


def _kernel(name: str, of: dict[str, Any]) -> str:
    """A method that fills a block, calls the kernel and reads the returned values."""
    returns, parameters, filling = of["returns"], [], []
    slot = len(returns)
    for argument, declared in of["arguments"].items():
        given, at = camel(argument), f"block + {8 * slot}"
        slot += _slots(declared)
        if declared in _SUFFIX:
            parameters.append(f"{given}: {'boolean' if declared == 'b1' else 'number'}")
            value = f"Number({given})" if declared == "b1" else given
            filling.append(f"memory.set{'F8' if declared == 'f8' else 'I8'}({at}, {value});")
        elif _extents(declared) == 0:
            parameters.append(f"{given}: {class_name(declared)} | number")
            filling.append(f"memory.setI8({at}, address({given}));")
        else:
            shape, extents = _SHAPES[_extents(declared)]
            parameters.append(f"{given}: {shape}")
            values = [f"{given}.at", *(f"{given}.{extent}" for extent in extents)]
            filling += [f"memory.setI8(block + {8 * (slot - len(values) + k)}, {v});" for k, v in enumerate(values)]
    kinds = ["boolean" if kind == "b1" else "number" for kind in returns]
    read = [
        f"memory.getI8(block + {8 * k}) !== 0" if kind == "b1" else f"memory.get{_SUFFIX[kind]}(block + {8 * k})"
        for k, kind in enumerate(returns)
    ]
    result = "void" if not kinds else kinds[0] if len(kinds) == 1 else f"[{', '.join(kinds)}]"
    told = [] if not read else [f"    return {read[0] if len(read) == 1 else '[' + ', '.join(read) + ']'};"]
    about = of["about"].replace("*/", "* /").splitlines()
    lines = [
        "",
        *(["  /**", *(f"   * {line}".rstrip() for line in about), "   */"] if about else []),
        f"  {camel(name)}({', '.join(parameters)}): {result} {{",
        "    const memory = this.memory, block = this.#block;" if filling or read else "    const block = this.#block;",
        *(f"    {line}" for line in filling),
        f"    this.#exports.{name}(block);",
        *told,
        "  }",
        "",
    ]
    return "\n".join(lines)
