# SPDX-License-Identifier: MIT
"""Everything that touches Rerun: showing a flight, recording it, reading it back and taking its picture.

``rerun`` itself is imported where a sink is opened or a file is read, never when this package is imported, so that a
run that nobody watches doesn't pay for it.
"""

from .observer import RerunObserver

__all__ = ["RerunObserver"]
