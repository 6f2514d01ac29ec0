# SPDX-License-Identifier: MIT
"""The page: what all browsers show, and what they do to the body.

Everything here runs on viser's event loop, so nothing needs a lock. While no browser is connected the loop sleeps and the
link to ROS hears nothing.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Awaitable

import numpy as np
import viser

from ..core.errors import InputError
from ..core.state import State
from ..scenario import Scenario, make_scenario
from ..scene_file import read_scene_text
from .acting import Acting
from .body_tab import BodyTab
from .controls import Controls, ParameterSetter
from .history import History, Rewind, core_row
from .panel import Panel, show_tab
from .pointer import Pointer, Tools
from .readout_panel import ReadoutPanel
from .ros_link import RosLink
from .scene_view import SceneView
from .session_tab import SessionTab
from .sighting import DrawnPose, Sightings
from .situation import Situation, asked, bring_about
from .upload_button import UploadButton

FRAME_S = 0.02
"""[s] Between two looks at what the node has said."""

GRACE_S = 2.0
"""[s] After the last browser left: a page that is loaded anew finds its history."""

SILENT_S = 1.5
"""[s] Without a state: a node that lives sends one every 0.1 s at least, unless its publish_rate is low."""

LEASH = 1.0
"""Body sizes that the body may fly from the picture's middle before the picture follows."""

POKE_TRAVEL = 0.3
"""Body sizes a second: what the suggested poke gives the body."""
