"""cotrack tried on archives of others: ``python -m tests.tools.cotrack_takes FOLDER``. Needs cotrack[native]."""

import subprocess
import sys

from orchestrator.log.reader import Log
from tests.tools.made import PLACES, STEPS, H, attempt, folder, said, speed_at, times

EXPECTED = {
    "archive": "1 times",
    "parameter set": "2 times",
    "numbers of FMUs of one shape": "its own",
    "LinearTransformation": "2 times",
    "DefaultExperiment": "0.05 s, starts at 0 s",
    "system connector": "1 times",
    "archive with FMI 3": "refused (RuntimeError)",
}
STOP = STEPS * H


def run(name: str, names: list[str], *options: str) -> list[float]:
    log = place / "cotrack.mcap"
    command = [sys.executable, "-m", "orchestrator", "run", str(place / f"{name}.ssp"), "--log", str(log), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):  # 1: the energy ledger is open, because nothing drives the mount
        raise RuntimeError(done.stderr)
    with Log(log) as read:
        return [float(read.signal(each)[1][-1]) for each in names]


def of_mount(name: str) -> str:
    names = ["second.sprocket.angular_velocity.y", "second.speed", "first.speed"]
    mount, own, first = run(name, names, "--stop", str(STOP))
    return times(mount - own, first)


def first(name: str) -> str:
    return times(run(name, ["first.speed"], "--stop", str(STOP))[0], speed_at(STOP))


def later() -> str:
    speed = run("later", ["first.speed"])[0]
    with Log(place / "cotrack.mcap") as log:
        seconds = log.signal("first.speed")[0][-1]
    return f"{seconds:g} s, starts at {1 if speed > 1.0 else 0} s"


def numbers() -> str:
    places = run("numbers", ["first.sprocket.position.x", "second.sprocket.position.x"], "--stop", str(STOP))
    return PLACES.get(tuple(places), str(places))


place = folder()
FOUND = {
    "archive": attempt(lambda: of_mount("drives")),
    "parameter set": attempt(lambda: first("set")),
    "numbers of FMUs of one shape": attempt(numbers),
    "LinearTransformation": attempt(lambda: of_mount("scaled")),
    "DefaultExperiment": attempt(later),
    "system connector": attempt(lambda: of_mount("system")),
    "archive with FMI 3": attempt(lambda: times(run("three", ["drive.speed"], "--stop", str(STOP))[0], speed_at(STOP))),
}
said("cotrack", FOUND, EXPECTED)
