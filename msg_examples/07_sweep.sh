#!/bin/sh
# SPDX-License-Identifier: MIT
# A sweep: 1,000 random pokes at random points of three bodies, each with its true
# tensor and centre of mass, and with those of its bounding box.
set -e
mkdir -p out

cat > out/box_error.yaml <<STUDY
scene: t_handle
set: {mass: 1.0}
script:
  - {t: 0.0, at: {vertex: 0}, impulse: [0.0, 0.0, 0.1]}
duration: 1.0
samples: 1000
vary:
  mesh: {grid: [book, l_bracket, t_handle]}
  script.1.at: random_vertex
  script.1.impulse: {direction: 0.1}   # N s
reference: {inertia_model: bounding_box}
measure: {final: [spin], difference: [attitude]}
STUDY
rigid_proto sweep out/box_error.yaml -o out/box_error.parquet
rigid_proto sweep out/box_error.yaml --row 7
