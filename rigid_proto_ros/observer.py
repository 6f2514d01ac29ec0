# SPDX-License-Identifier: MIT
"""What a running simulation tells to whoever watches it; see core/observer.py."""

from .core.observer import STATE_FIELDS, BodySnapshot, Observer, Observers, ShownLoad

__all__ = ["STATE_FIELDS", "BodySnapshot", "Observer", "Observers", "ShownLoad"]
