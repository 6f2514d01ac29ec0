# SPDX-License-Identifier: MIT
"""dop853: the explicit Runge-Kutta method of order 8 of Prince and Dormand, fixed steps.

Order 8, 12 evaluations a step. Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I (1993),
section II.10. The one for large steps under loads of any kind; not conservative, and useless beyond |ω|h of about 4.
The tableau: Prince and Dormand (1981), as in the code dop853.f; checked by the order test.
"""

from __future__ import annotations

import numpy as np

from .integrator import ANGULAR_DAMPING, LOADS, STRING, Integrator
from .runge_kutta import explicit

# Row i: weights of the earlier stages for stage i (0 to 11), and of all for the step (12).
TABLEAU = np.zeros((13, 12))
TABLEAU[1, [0]] = [0.05260015195876773]
TABLEAU[2, [0, 1]] = [0.0197250569845379, 0.0591751709536137]
TABLEAU[3, [0, 2]] = [0.02958758547680685, 0.08876275643042054]
TABLEAU[4, [0, 2, 3]] = [0.2413651341592667, -0.8845494793282861, 0.924834003261792]
TABLEAU[5, [0, 3, 4]] = [0.037037037037037035, 0.17082860872947386, 0.12546768756682242]
TABLEAU[6, [0, 3, 4, 5]] = [0.037109375, 0.17025221101954405, 0.06021653898045596, -0.017578125]
TABLEAU[7, [0, 3, 4, 5, 6]] = [
    0.03709200011850479,
    0.17038392571223998,
    0.10726203044637328,
    -0.015319437748624402,
    0.008273789163814023,
]
TABLEAU[8, [0, 3, 4, 5, 6, 7]] = [
    0.6241109587160757,
    -3.3608926294469414,
    -0.868219346841726,
    27.59209969944671,
    20.154067550477894,
    -43.48988418106996,
]
TABLEAU[9, [0, 3, 4, 5, 6, 7, 8]] = [
    0.47766253643826434,
    -2.4881146199716677,
    -0.590290826836843,
    21.230051448181193,
    15.279233632882423,
    -33.28821096898486,
    -0.020331201708508627,
]
TABLEAU[10, [0, 3, 4, 5, 6, 7, 8, 9]] = [
    -0.9371424300859873,
    5.186372428844064,
    1.0914373489967295,
    -8.149787010746927,
    -18.52006565999696,
    22.739487099350505,
    2.4936055526796523,
    -3.0467644718982196,
]
TABLEAU[11, [0, 3, 4, 5, 6, 7, 8, 9, 10]] = [
    2.273310147516538,
    -10.53449546673725,
    -2.0008720582248625,
    -17.9589318631188,
    27.94888452941996,
    -2.8589982771350235,
    -8.87285693353063,
    12.360567175794303,
    0.6433927460157636,
]
TABLEAU[12, [0, 5, 6, 7, 8, 9, 10, 11]] = [
    0.054293734116568765,
    4.450312892752409,
    1.8915178993145003,
    -5.801203960010585,
    0.3111643669578199,
    -0.1521609496625161,
    0.20136540080403034,
    0.04471061572777259,
]

DOP853 = Integrator(
    name="dop853",
    order=8,
    evaluations=12,
    source="Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.10",
    limits="Explicit: accurate up to |ω|h of about 1, diverges beyond about 4.",
    stability_limit=2.0,
    supports=LOADS | {ANGULAR_DAMPING, STRING},
    kernel=explicit(TABLEAU),
)
