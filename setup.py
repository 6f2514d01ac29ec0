# SPDX-License-Identifier: MIT
"""ament_python package; `pip install` and `colcon build` both use this file."""

from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

NAME = "rigid_proto_ros"
SHARE = f"share/{NAME}"
VERSION = next(
    line.split('"')[1] for line in Path(NAME, "__init__.py").read_text("utf-8").splitlines() if "__version__" in line
)

# Real rclpy on Fast DDS from PyPI. An extra, because a machine with a ROS installation must keep that one's.
ROS = ["ros-rclpy[fastrtps]==7.1.6", "ros-jazzy-common-interfaces==5.3.6"]
MCAP = ["mcap>=1.2,<2"]
SWEEP = ["pyarrow>=15", "scipy>=1.15", "distributed>=2024.8", "matplotlib>=3.8"]
TERMINAL = ["rich>=13", "argcomplete>=3"]
RERUN = ["rerun-sdk>=0.41,<0.42"]
WORKBENCH = ["viser>=1.1,<1.2"]
# COLLADA and 3MF files through trimesh, the hull, and the union of overlapping parts.
MESHES = ["pycollada>=0.8", "networkx>=3", "lxml>=5", "scipy>=1.11", "manifold3d>=3.1,<4"]
TEST = [
    "pytest>=8",
    "hypothesis>=6.100",
    "mpmath>=1.3",
    "scipy>=1.11",
    "psutil>=5.9",
    *MESHES,
    *MCAP,
    "mcap-ros2-support>=0.5",
    "playwright>=1.50",
    "nbclient>=0.10",
    "ipykernel>=6",
]

setup(
    name=NAME,
    version=VERSION,
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={f"{NAME}.bodies": ["*.obj"]},
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
    python_requires=">=3.11,<3.14",
    install_requires=["numpy>=1.26", "numba>=0.62", "trimesh>=4.4", "PyYAML>=6.0"],
    extras_require={
        "ros": ROS,
        "meshes": MESHES,
        "rerun": RERUN,
        "mcap": MCAP,
        "workbench": WORKBENCH,
        "sweep": SWEEP,
        "terminal": TERMINAL,
        "test": TEST,
    },
    zip_safe=False,
    maintainer="rigid_proto_ros developers",
    maintainer_email="rigid-proto-ros@users.noreply.github.com",
    description="Prototype the properties of a rigid body: exact inertia from a mesh, flight under wrenches, Rerun",
    license="MIT",
    entry_points={
        "console_scripts": [
            f"rigid_proto = {NAME}.cli.main:main",
            f"rigid_body_node = {NAME}.ros.main:main",
            f"poke_client = {NAME}.ros.poke_client:main",
        ]
    },
)
