#!/bin/sh
# SPDX-License-Identifier: MIT
# Change the mass of the T-handle while it moves. Start the node first, in another terminal: make up
set -e

# A script: the same push before and after the density is multiplied by four.
poke_client "$(dirname "$0")/heavier_in_flight.yaml" --reset

# By parameters: twice the density, then a ballast of 30 g at the tip, which stops the flips.
ros2 param set /rigid_body density 15700.0
ros2 param set /rigid_body ballast.tip "[0.03, 0.0, 0.0, 0.07]"
