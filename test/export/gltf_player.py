# SPDX-License-Identifier: MIT
"""Reads and plays a .glb by the words of the glTF 2.0 specification alone, to check what another library wrote."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
TYPES = {5126: "<f4", 5125: "<u4"}


class Player:
    """Nodes by name, and where they are at a time [s]."""

    def __init__(self, file: Path) -> None:
        data = file.read_bytes()
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        json_length, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        self.document = json.loads(data[20 : 20 + json_length])
        _, kind = struct.unpack_from("<I4s", data, 20 + json_length)
        assert kind == b"BIN\0"
        self.binary = data[28 + json_length :]
        self.nodes = {node["name"]: number for number, node in enumerate(self.document["nodes"])}
        self._parents = {c: n for n, node in enumerate(self.document["nodes"]) for c in node.get("children", [])}
        self._channels = {}
        for animation in self.document.get("animations", []):
            for channel in animation["channels"]:
                sampler = animation["samplers"][channel["sampler"]]
                times, values = self.read(sampler["input"])[:, 0], self.read(sampler["output"])
                keys = times, values.reshape(len(times), -1), sampler["interpolation"]
                self._channels[channel["target"]["node"], channel["target"]["path"]] = keys

    def read(self, number: int) -> np.ndarray:
        accessor = self.document["accessors"][number]
        view = self.document["bufferViews"][accessor["bufferView"]]
        count, width = accessor["count"], WIDTHS[accessor["type"]]
        values = np.frombuffer(
            self.binary, TYPES[accessor["componentType"]], count * width, view.get("byteOffset", 0)
        ).reshape(count, width)
        return values.astype(float if values.dtype.kind == "f" else int)

    def keys(self, name: str, path: str) -> tuple[np.ndarray, np.ndarray, str]:
        return self._channels[self.nodes[name], path]

    def value(self, node: int, path: str, seconds: float) -> np.ndarray:
        if (node, path) not in self._channels:
            default = {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}[path]
            return np.array(self.document["nodes"][node].get(path, default), dtype=float)
        times, values, interpolation = self._channels[node, path]
        k = int(np.searchsorted(times, seconds, side="right")) - 1
        if k < 0 or k == len(times) - 1:
            return values[np.clip(k, 0, len(times) - 1)]
        if interpolation == "STEP":
            return values[k]
        u = (seconds - times[k]) / (times[k + 1] - times[k])
        if path == "rotation":
            a, b = Rotation.from_quat(values[k]), Rotation.from_quat(values[k + 1])
            return (a * Rotation.from_rotvec(u * (a.inv() * b).as_rotvec())).as_quat()
        return (1 - u) * values[k] + u * values[k + 1]

    def world(self, name: str, points: np.ndarray, seconds: float) -> np.ndarray:
        """Points (n, 3) of a node in the scene's coordinates, which have y up."""
        node: int | None = self.nodes[name]
        while node is not None:
            turn = Rotation.from_quat(self.value(node, "rotation", seconds))
            points = turn.apply(self.value(node, "scale", seconds) * points) + self.value(node, "translation", seconds)
            node = self._parents.get(node)
        return points

    def mesh_points(self, name: str) -> np.ndarray:
        """The mesh's own points."""
        mesh = self.document["meshes"][self.document["nodes"][self.nodes[name]]["mesh"]]
        return self.read(mesh["primitives"][0]["attributes"]["POSITION"])


def z_up(points: np.ndarray) -> np.ndarray:
    """From glTF's y up back to ROS' z up."""
    return np.column_stack([points[:, 0], -points[:, 2], points[:, 1]])
