# SPDX-License-Identifier: MIT
"""Everything that uses Rerun: live views, .rrd files, and pictures of a flight.

``rerun`` is imported only when a sink is opened, not with this package, so that runs without a view don't pay for it.
"""
