#!/bin/sh
# SPDX-License-Identifier: MIT
# A poke script, sent to the node and simulated without it: the motion is the same, bit for bit.
# Start the node first, in another terminal: make up
set -e
here=$(dirname "$0")

cat "$here/flip_and_poke.yaml"
poke_client "$here/flip_and_poke.yaml" --reset
rigid_proto simulate t_handle --script "$here/flip_and_poke.yaml" --duration 10
