# SPDX-License-Identifier: MIT
"""Which recorder a file asks for, by its ending."""

from __future__ import annotations

from collections.abc import Callable

from ..base.errors import InputError, is_missing
from ..scene.parameters import Parameters
from ..simulation.observer import Observer


def is_mcap(path: str) -> bool:
    """Whether a recording of this name is an MCAP file; any other is Rerun's."""
    return path.lower().endswith(".mcap")


def make_recorder(
    path: str,
    node_name: str = "rigid_body",
    parameters: Parameters | None = None,
    on_error: Callable[[str], None] | None = None,
    simulated_log: bool = False,
) -> Observer:
    """An observer that records to ``path``; raises InputError where it can't.

    parameters: the scene's, of which frames' names count. simulated_log: messages are logged at simulated time, as
    suits a run without a clock; else at the wall's, for as long as the run may go on.
    """
    if is_mcap(path):
        try:
            from ..session.mcap_observer import McapObserver

            return McapObserver(path, node_name, parameters, on_error, simulated_log)
        except ImportError:
            raise InputError("record", is_missing("mcap", "mcap")) from None
    from . import RerunObserver

    return RerunObserver(record=path, name=node_name, on_error=on_error, open_ended=not simulated_log)
