# SPDX-License-Identifier: MIT
"""Make .venv with the pinned packages and this package in it; what is in the way is said in one line.

Written for any Python 3.6 or newer, so that an unsupported one can say so itself.
"""

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
STAMP = VENV / ".pins"
SUPPORTED = ((3, 11), (3, 13))
NEEDED_BYTES = 2 * 1000**3  # the environment takes 1.5 GB, pip's unpacking some more


def stop(message):
    """End with one line on stderr."""
    sys.exit("make setup: " + message)


def interpreter(python):
    """(path, (major, minor)) of the interpreter that a command starts, or None when it does not run.

    Inside a virtual environment that is the one it was made from: .venv must not be judged by, or made from, itself.
    """
    code = "import sys; print(getattr(sys, '_base_executable', sys.executable)); print(*sys.version_info[:2])"
    try:
        lines = subprocess.check_output([python, "-c", code], stderr=subprocess.DEVNULL).decode().splitlines()
    except (OSError, subprocess.CalledProcessError):
        return None
    return lines[0], tuple(int(word) for word in lines[1].split())


def runs(python, code):
    """Whether the interpreter runs the code without an error."""
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.run([python, "-c", code], check=False, **quiet).returncode == 0


def supported_python():
    """An interpreter of a supported version: $PYTHON, this one, then newer to older ones on the PATH."""
    asked = os.environ.get("PYTHON")
    candidates = [asked] if asked else [sys.executable, "python3.13", "python3.12", "python3.11"]
    if not asked and "ROS_DISTRO" in os.environ:
        candidates = ["/usr/bin/python3", *candidates]  # the one that the installed rclpy was built for
    found = [pair for pair in map(interpreter, candidates) if pair]
    for path, version in found:
        if SUPPORTED[0] <= version <= SUPPORTED[1]:
            return path, version
    received = "{}.{} ({})".format(*found[0][1], found[0][0]) if found else "none that runs ({})".format(candidates[0])
    stop(
        "python: got {}; accepted: Python {}.{} to {}.{} (name another one with PYTHON=/path/to/python3)".format(
            received, *SUPPORTED[0], *SUPPORTED[1]
        )
    )
    return None


def called(*command):
    """Run a command from the root; returns it with its output."""
    environment = {key: value for key, value in os.environ.items() if key != "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}
    return subprocess.run(
        list(map(str, command)),
        cwd=str(ROOT),
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=False,
    )


def installed_by_uv(python, files):
    """Whether uv could install the pins: in a quarter of pip's time, half a minute instead of two.

    Not tried where pip has been told of an index or a proxy, which uv wouldn't know.
    """
    pin = next((line for line in files[0].read_text().splitlines() if line.startswith("uv==")), None)
    settings = called(python, "-m", "pip", "config", "list").stdout.decode(errors="replace")
    if pin is None or "index-url" in settings or "proxy" in settings:
        return False
    requirements = [part for file in files for part in ("-r", file)]
    steps = (
        (python, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", pin.split()[0]),
        (VENV / "bin" / "uv", "pip", "install", "--quiet", "--python", python, *requirements),
    )
    if any(called(*step).returncode for step in steps):
        return False
    # As pip does, but on all cores, and not what is never imported. A file for another Python's grammar is no failure.
    called(python, "-m", "compileall", "-q", "-j", "0", "-x", "site-packages/.*/tests?/", VENV / "lib")
    return True


def install(python, *arguments):
    """Run pip in .venv; a failure ends with the reason in one line, the whole output in .venv/setup.log."""
    done = called(python, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", *arguments)
    if done.returncode == 0:
        return
    output = done.stdout.decode(errors="replace")
    log = VENV / "setup.log"
    try:
        log.write_text(output, encoding="utf-8")
    except OSError:
        pass
    if "No space left" in output:
        stop("disk full while installing into {}".format(VENV))
    signs = (
        "NewConnectionError",
        "ConnectionError",
        "NameResolutionError",
        "ConnectTimeout",
        "Temporary failure",
        "timed out",
    )
    if any(sign in output for sign in signs):
        stop("no network: the package index can't be reached (log: {})".format(log))
    errors = (
        [line for line in output.splitlines() if line.startswith("ERROR")] or output.splitlines()[-1:] or ["pip failed"]
    )
    stop("{} (log: {})".format(errors[-1], log))


def main():
    """Bring .venv up to the pins, or do nothing when it is."""
    python, version = supported_python()
    ros_installed = runs(python, "import rclpy")
    files = [ROOT / "requirements" / "base.txt"]
    if not ros_installed:
        files.append(ROOT / "requirements" / "ros.txt")
    described = "{} {} ros-installed={}\n".format(ROOT, version, ros_installed)
    pins = hashlib.sha256(
        described.encode() + b"".join(f.read_bytes() for f in [*files, ROOT / "setup.py"])
    ).hexdigest()
    if STAMP.is_file() and STAMP.read_text() == pins:
        STAMP.touch()
        return
    if not runs(python, "import ensurepip, venv"):
        stop("python3-venv is missing; install it with: sudo apt install python{}.{}-venv".format(*version))
    free = shutil.disk_usage(str(ROOT)).free
    if not VENV.is_dir() and free < NEEDED_BYTES:
        stop("disk: got {:.1f} GB free in {}; accepted: 2 GB or more".format(free / 1000**3, ROOT))
    inner = VENV / "bin" / "python"
    config = VENV / "pyvenv.cfg"
    shares = config.is_file() and "include-system-site-packages = true" in config.read_text()
    if not config.is_file() or shares != ros_installed or (interpreter(str(inner)) or (None, None))[1] != version:
        print("making .venv with Python {}.{}".format(*version), flush=True)
        options = ["--clear"] + (["--system-site-packages"] if ros_installed else [])
        made = subprocess.run(
            [python, "-m", "venv", *options, str(VENV)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False
        )
        if made.returncode:
            stop("python -m venv: " + (made.stdout.decode(errors="replace").strip().splitlines() or ["failed"])[-1])
    source = "the ROS installation's rclpy" if ros_installed else "rclpy from PyPI"
    print("installing the pinned packages (about 1.5 GB, half a minute to some minutes; {})".format(source), flush=True)
    # Where the system's own packages count as installed, pip knows which they are.
    if ros_installed or not installed_by_uv(inner, files):
        install(inner, *(part for file in files for part in ("-r", file)))
    install(inner, "--no-build-isolation", "--no-deps", "-e", ROOT)
    STAMP.write_text(pins)
    print("ready: {}".format(VENV), flush=True)


if __name__ == "__main__":
    main()
