// SPDX-License-Identifier: MIT
//
// Ghosts by the name of the engines that do the same, as benchmarks/engines.py has measured.

import type { GhostChoice } from "./source.ts";

export const NO_GHOST: GhostChoice = { inertia_model: "", integrator: "", step: 0, gyroscopic: true };

/** beside: what the benchmark calls the ghost. MuJoCo's step is that of a picture, as the parameter step rounds it. */
interface Named { readonly choice: GhostChoice; readonly beside: string }

export const NAMED: Readonly<Record<"gyroscopic" | "mujoco", Named>> = {
  gyroscopic: { choice: { ...NO_GHOST, gyroscopic: false }, beside: "no_gyroscopic_term" },
  mujoco: { choice: { ...NO_GHOST, integrator: "semi_implicit_euler", step: 0.016666667 }, beside: "semi_implicit_euler" },
};

export const isSameGhost = (a: GhostChoice, b: GhostChoice): boolean =>
  a.inertia_model === b.inertia_model && a.integrator === b.integrator && a.step === b.step && a.gyroscopic === b.gyroscopic;
