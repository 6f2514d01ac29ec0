#!/bin/sh
# SPDX-License-Identifier: MIT
# Record a simulation, repeat it from the recording and compare every bit; then convert the recording for other tools.
set -e
mkdir -p out

rigid_proto simulate t_handle --script "$(dirname "$0")/flip_and_poke.yaml" --duration 10 --bag out/flight.mcap
rigid_proto replay out/flight.mcap --verify
rigid_proto replay out/flight.mcap --csv out/flight.csv
rigid_proto replay out/flight.mcap --gltf out/flight.glb   # for Blender
rigid_proto replay out/flight.mcap --at 3 --as-scene out/from_3_s.yaml   # a scene that continues from there
rigid_proto simulate out/from_3_s.yaml --duration 1
