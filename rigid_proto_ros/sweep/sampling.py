# SPDX-License-Identifier: MIT
"""Uniform numbers of rows: independent, a Latin hypercube, or Sobol's sequence; each row's whatever rows
are asked for with it.
"""

from __future__ import annotations

import threading
import warnings
from functools import lru_cache

import numpy as np

from ..base.errors import InputError, is_missing
from .row_random import latin_uniforms, row_uniforms

SAMPLERS = ("random", "latin_hypercube", "sobol")
MAX_SOBOL = 1 << 30
"""Points that scipy's Sobol sequence has at 30 bits."""


def uniforms(sampler: str, seed: int, rows: np.ndarray, samples: int, dimensions: int) -> np.ndarray:
    """Uniform numbers (n, dimensions) in [0, 1) of rows (n,); each run of ``samples`` rows is one design.

    ``random``: the row's own numbers (sweep/row_random.py). ``latin_hypercube``: one number in each of ``samples``
    strata per dimension; where in it, by the row's own numbers. ``sobol``: scrambled by the seed (scipy.stats.qmc).
    """
    if sampler == "sobol":
        return _sobol(seed, dimensions).points(rows % samples)
    own = row_uniforms(seed, rows, dimensions)
    if sampler == "random":
        return own
    out = np.empty_like(own)
    keys = np.random.SeedSequence(seed).generate_state(dimensions, np.uint64)
    latin_uniforms(keys, rows % samples, samples, own, out)
    return out


class _Sobol:
    """Points of the sequence by number. It goes forward from where it stands, so that chunk after chunk
    costs no more.
    """

    def __init__(self, seed: int, dimensions: int) -> None:
        try:
            from scipy.stats import qmc
        except ImportError:
            raise InputError("sampler", f"sobol: {is_missing('scipy', 'sweep')}") from None
        self._engine = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(np.random.SeedSequence(seed)))
        self._lock = threading.Lock()

    def points(self, numbers: np.ndarray) -> np.ndarray:
        """Points (n, d) of these numbers."""
        out = np.empty((len(numbers), self._engine.d))
        # Runs of consecutive numbers are drawn at once.
        cuts = np.flatnonzero(np.diff(numbers) != 1) + 1
        with self._lock, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a balance that only powers of two have
            for part in np.split(np.arange(len(numbers)), cuts):
                if len(part) == 0:
                    continue
                first = int(numbers[part[0]])
                if self._engine.num_generated > first:
                    self._engine.reset()
                if first > self._engine.num_generated:
                    self._engine.fast_forward(first - self._engine.num_generated)
                out[part] = self._engine.random(len(part))
        return out


@lru_cache(maxsize=4)
def _sobol(seed: int, dimensions: int) -> _Sobol:
    return _Sobol(seed, dimensions)
