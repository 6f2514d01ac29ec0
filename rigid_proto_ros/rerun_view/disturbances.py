# SPDX-License-Identifier: MIT
"""At which states something acts on the body or has acted since the state before: drift is counted anew there."""

from __future__ import annotations

import numpy as np


class Disturbances:
    """Follows one run; ``load_changed`` in the order of what happened, before the rows that come after it."""

    def __init__(self) -> None:
        self._load_changes: list[tuple[int, bool]] = []
        self._acted = self._touched = False
        self._disturbed_unseen = 0

    def load_changed(self, after_rows: int, acts: bool) -> None:
        """After so many rows of the block something acts, or nothing does."""
        self._load_changes.append((after_rows, acts))

    def rows(self, begin: int, end: int) -> np.ndarray:
        """Per row begin..end, whether a load acts there or did since the row before."""
        disturbed = np.empty(end - begin, dtype=bool)
        at = 0
        for after_rows, acts in self._load_changes:
            disturbed[at : after_rows - begin] = self._acted
            at, self._acted = after_rows - begin, acts
        disturbed[at:] = self._acted
        for first_after in [0] * self._touched + [after_rows - begin for after_rows, _ in self._load_changes]:
            disturbed[first_after : first_after + 1] = True
        # What began or ended after the last of these rows concerns the next one too.
        self._touched = (self._touched and begin == end) or any(after >= end for after, _ in self._load_changes)
        self._load_changes.clear()
        return disturbed

    def gathered(self, disturbed: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """Per chosen row, whether a load acted at any row since the one chosen before."""
        so_far = np.cumsum(disturbed) + self._disturbed_unseen
        at_chosen = so_far[chosen]
        self._disturbed_unseen = int(so_far[-1] - at_chosen[-1]) if len(chosen) else int(so_far[-1])
        return np.diff(at_chosen, prepend=0) > 0
