# SPDX-License-Identifier: MIT
"""Write the bundled bodies as .obj files; needs manifold3d: ``PYTHONPATH=tools python -m bundled_bodies [NAME ...]``."""

import argparse
from pathlib import Path

from rigid_proto_ros.base.bundled import PACKAGE_FOLDER

from .catalogue import BODIES
from .surfaces import Surface

BODIES_FOLDER = PACKAGE_FOLDER / "bodies"


def obj_text(name: str, surface: Surface) -> str:
    """The surface as a Wavefront .obj text; coordinates in metres to 10 nm, the grid on which they were welded."""
    vertices, triangles = surface
    lines = [
        f"# {name}: SPDX-License-Identifier: MIT",
        f"# metres; {len(vertices)} vertices, {len(triangles)} triangles",
        f"o {name}",
    ]
    lines += ["v " + " ".join(_coordinate(c) for c in vertex) for vertex in vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
    return "\n".join(lines) + "\n"


def _coordinate(value: float) -> str:
    text = f"{value:.8f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def main() -> None:
    """Generate the named bodies, or all."""
    parser = argparse.ArgumentParser(prog="PYTHONPATH=tools python -m bundled_bodies", description=__doc__)
    parser.add_argument("--into", type=Path, default=BODIES_FOLDER, help="folder (default: the package's)")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(BODIES))
    arguments = parser.parse_args()
    for name in arguments.names or BODIES:
        surface = BODIES[name]()
        path = arguments.into / f"{name}.obj"
        path.write_text(obj_text(name, surface), encoding="utf-8")
        print(f"{path}: {len(surface[0])} vertices, {len(surface[1])} triangles")


if __name__ == "__main__":
    main()
