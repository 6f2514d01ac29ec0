# SPDX-License-Identifier: MIT
"""A script with a command of every kind, for tests of what is recorded, read and sent again."""

EVERY_KIND = """
- {t: 0.1, at: tip, force: [0.0, 0.01, 0.0], duration: 0.3}
- {t: 0.2, at: {vertex: 3}, impulse: [0.0, 0.0, 0.002]}
- {t: 0.3, wrench: {at: com, torque: [0.0, 1.0e-5, 0.0], axes: body, duration: 0.5}}
- {t: 0.5, set: {density: 9000.0, gravity: [0.0, 0.0, -0.5]}}
- {t: 0.6, string: {attach: tip, target: [0.1, 0.0, 0.2]}}
- {t: 0.9, string: release}
- {t: 1.0, service: clear_wrench}
"""
