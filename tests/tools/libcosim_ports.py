"""Third law and energy of single ports: ``python -m tests.tools.libcosim_ports SCENE SECONDS FOLDER``.

libcosim steps all native FMUs of a scene with rigid links at once, with held and with extrapolated wrenches; all is
from the outputs that it shows. Received wrench: the last one, or twice that less the one before. Its giver moves the
place of the wrench on by the last velocity. Needs cotrack[native] and libcosimpy==0.0.6; the archive takes minutes.
"""

import re
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import numpy as np
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver

FORCE = re.compile(
    r'startElement="(.*?)" startConnector="(.*?)\.force\.x" endElement="(.*?)" endConnector="(.*?)\.force'
)
SWITCH = re.compile(r'(<ssv:Parameter name="extrapolate">\s*<ssv:String value=)"\w+"')


def unpacked(scene: str, way: str, place: Path) -> Path:
    """Archive of the scene, unpacked, whose receivers extrapolate in a ``way``, "no" or "linear"."""
    archive, target = place / f"{scene}.ssp", place / f"{scene}-{way}"
    if not archive.exists():
        settings = ["--set", "track.step=1 ms", "--set", "run.variable=false"]
        command = ["ssp", scene, "--track", "rigid", *settings, "-o", str(archive)]
        subprocess.run([sys.executable, "-m", "orchestrator", *command], check=True)
    ZipFile(archive).extractall(target)
    structure = target / "SystemStructure.ssd"
    structure.write_text(SWITCH.sub(rf'\1"{way}"', structure.read_text(encoding="utf-8")), encoding="utf-8")
    return target


def ports(folder: Path, seconds: float, h: float, way: str) -> np.ndarray:
    """Misfit of the impulse, its size, energy created and passed (ports, 4), N s and J."""
    pairs = FORCE.findall((folder / "SystemStructure.ssd").read_text(encoding="utf-8"))
    execution, observer = (
        CosimExecution.from_ssp_file(str(folder), step_size=round(1e9 * h)),
        CosimObserver.create_last_value(),
    )
    execution.add_observer(observer)
    wanted: dict[str, list[str]] = {}
    for giver, port, taker, mount in pairs:
        wanted.setdefault(giver, []).extend(f"{port}.{what}.{a}" for what in ("force", "torque") for a in "xyz")
        motion = ("position", "velocity", "angular_velocity")
        wanted.setdefault(taker, []).extend(f"{mount}.{what}.{a}" for what in motion for a in "xyz")
    index = {name: execution.slave_index_from_instance_name(name) for name in wanted}
    known = {name: {v.name.decode(): v.reference for v in execution.slave_variables(k)} for name, k in index.items()}
    rows: dict[str, list[list[float]]] = {name: [] for name in wanted}
    for _ in range(round(seconds / h)):
        if not execution.step(1):
            raise RuntimeError("a step failed")
        for name, names in wanted.items():
            rows[name].append(observer.last_real_values(index[name], [known[name][each] for each in names]))
    seen = {name: dict(zip(wanted[name], np.array(values).T, strict=True)) for name, values in rows.items()}

    def vectors(name: str, what: str) -> np.ndarray:
        return np.stack([seen[name][f"{what}.{a}"] for a in "xyz"], axis=1)

    found = []
    for giver, port, taker, mount in pairs:
        w = np.hstack([vectors(giver, f"{port}.{what}") for what in ("force", "torque")])
        rate = np.hstack([vectors(taker, f"{mount}.{what}") for what in ("velocity", "angular_velocity")])
        moved = np.hstack(
            [np.diff(vectors(taker, f"{mount}.position"), axis=0), 0.5 * h * (rate[1:] + rate[:-1])[:, 3:]]
        )
        moved, received = moved[1:], w[1:-1] if way == "no" else 2.0 * w[1:-1] - w[:-2]
        given, created = w[2:], (received * moved).sum() - h * (w[2:] * rate[1:-1]).sum()
        size = np.linalg.norm(given[:, :3], axis=1).sum()
        found.append(
            (
                np.linalg.norm((received - given)[:, :3].sum(axis=0)),
                size,
                created,
                abs((given * moved).sum(axis=1)).sum(),
            )
        )
    return np.array(found)


if __name__ == "__main__":
    scene, seconds, place = sys.argv[1], float(sys.argv[2]), Path(sys.argv[3]).resolve()
    place.mkdir(parents=True, exist_ok=True)
    for h in (1e-3, 2e-3):
        for way in ("no", "linear"):
            off, size, created, passed = ports(unpacked(scene, way, place), seconds, h, way).T
            share = 100.0 * created / passed
            print(
                f"{scene}, {1e3 * h:g} ms, extrapolate = {way}: third law of the worst port {(off / size).max():.1e};"
                f" energy of all {100.0 * created.sum() / passed.sum():+.2f} %, of single ports {share.min():+.2f} to"
                f" {share.max():+.2f} %"
            )
