// SPDX-License-Identifier: MIT
//
// Measured motion of a free body in physics engines (benchmarks/engines.py).

import table from "../../benchmarks/results/engines.csv";

/** 60 s of a body that spins nearly about its intermediate axis; the exact motion flips 9 times. turnDeg: largest
 * change of L's direction. */
export interface Measured {
  readonly engine: string;
  readonly version: string;
  readonly way: string;
  readonly stepS: number;
  readonly flips: number;
  /** relative to the energy at the start; NaN if it wasn't measured */
  readonly energyChange: number;
  readonly turnDeg: number;
  /** name of the ghost with the same motion (ghosts.ts), or "" */
  readonly ghost: string;
  readonly date: string;
}

const cells = (line: string): string[] => [...line.matchAll(/(?:^|,)(?:"([^"]*)"|([^",]*))/g)].map(([, quoted, plain]) => quoted ?? plain ?? "");

export const MEASURED: readonly Measured[] = (() => {
  const [head = "", ...lines] = table.trim().split("\n"), names = cells(head);
  return lines.map((line) => {
    const found = cells(line), of = (name: string): string => found[names.indexOf(name)] ?? "";
    return {
      engine: of("engine"), version: `${of("package")} ${of("version")}`, way: of("way").replaceAll("_", " "), stepS: Number(of("step_s")), flips: Number(of("flips")),
      energyChange: Number(of("energy_change")), turnDeg: Number(of("momentum_turn_deg")), ghost: of("ghost"), date: of("date").slice(0, 10),
    };
  });
})();
