// SPDX-License-Identifier: MIT
//
// Ghosts named after engines that have the same error, as measured by benchmarks/engines.py.

import type { GhostChoice } from "./source.ts";

export const NO_GHOST: GhostChoice = { inertia_model: "", integrator: "", step: 0, gyroscopic: true };

/** beside: name of the ghost in the benchmark. MuJoCo's step is 1/60 s, rounded as the parameter step is. */
interface Named { readonly choice: GhostChoice; readonly beside: string }

export const NAMED: Readonly<Record<"gyroscopic" | "mujoco", Named>> = {
  gyroscopic: { choice: { ...NO_GHOST, gyroscopic: false }, beside: "no_gyroscopic_term" },
  mujoco: { choice: { ...NO_GHOST, integrator: "semi_implicit_euler", step: 0.016666667 }, beside: "semi_implicit_euler" },
};

export const isSameGhost = (a: GhostChoice, b: GhostChoice): boolean =>
  a.inertia_model === b.inertia_model && a.integrator === b.integrator && a.step === b.step && a.gyroscopic === b.gyroscopic;
