# SPDX-License-Identifier: MIT
"""Everything that touches Rerun: showing a flight, drawing it into a file, and taking its picture.

``rerun`` itself is imported where a sink is opened, never when this package is imported, so that a run that nobody
watches doesn't pay for it.
"""
