"""Areas of the product for faults: how many faults each gets, and its nearest tests."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from tests.mutation.operators import Fault

ROOT = Path(__file__).resolve().parents[2]


class Area(NamedTuple):
    """An area of the product."""

    name: str
    share: int  # number of faults per hundred
    sources: tuple[str, ...]  # files and folders
    tests: tuple[str, ...]  # run after those that import the faulty module

    def files(self) -> list[Path]:
        """Sources of the area, relative to the root, in a fixed order."""
        paths = [ROOT / source for source in self.sources]
        files = {file for one in paths for file in ([one] if one.is_file() else one.rglob("*.py"))}
        return sorted(file.relative_to(ROOT) for file in files)


AREAS = (
    Area("elements, integrators, bodies", 14, ("fmus/physics/ancf", "fmus/physics/integrate", "fmus/physics/rigid"),
         ("tests/physics",)),
    Area("chains", 20, ("fmus/physics/chain", "fmus/physics/block_cyclic.py"),
         ("tests/physics/test_chain_benchmarks.py", "tests/fmus/test_track_flexible.py",
          "tests/fmus/test_track_rigid.py", "tests/fmus/test_free_chains.py")),
    Area("contact", 8, ("fmus/physics/contact",),
         ("tests/physics/test_contact.py", "tests/physics/test_contact_laws.py", "tests/fmus/test_contact_patch.py")),
    Area("tracks and their FMUs", 8,
         ("fmus/track", "fmus/track_flexible", "fmus/track_rigid", "fmus/fmi/slave.py", "fmus/fmi/model_instance.py"),
         ("tests/fmus/test_track_flexible.py", "tests/fmus/test_track_rigid.py", "tests/fmus/test_slave.py",
          "tests/fmus/test_slave_processes.py", "tests/fmus/test_model_instance.py")),
    Area("chassis, drives, driver", 14,
         ("fmus/chassis", "fmus/drives", "fmus/sprocket_drive", "fmus/steering_differential", "fmus/driver"),
         ("tests/fmus/test_chassis.py", "tests/fmus/test_chassis_conservation.py", "tests/fmus/test_sprocket_drive.py",
          "tests/fmus/test_steering_differential.py", "tests/fmus/test_driver.py")),
    Area("coupling", 12, ("orchestrator/cosim",),
         ("tests/orchestrator/test_coupling.py", "tests/orchestrator/test_divergence.py",
          "tests/orchestrator/test_component.py", "tests/orchestrator/test_program.py")),
    Area("log", 8, ("orchestrator/log",),
         ("tests/orchestrator/test_recorder.py", "tests/orchestrator/test_recorder_files.py",
          "tests/orchestrator/test_reader.py", "tests/orchestrator/test_log_tools.py")),
    Area("results", 10, ("orchestrator/results",),
         ("tests/orchestrator/test_analyses.py", "tests/orchestrator/test_track_analyses.py",
          "tests/orchestrator/test_spectrum.py", "tests/orchestrator/test_fatigue.py",
          "tests/orchestrator/test_energy.py", "tests/orchestrator/test_measures.py")),
    Area("scene and command line", 6, ("orchestrator/scene", "orchestrator/execution", "orchestrator/cli"),
         ("tests/orchestrator/test_scene.py", "tests/orchestrator/test_sentences_scenes.py",
          "tests/orchestrator/test_keys.py", "tests/orchestrator/test_cli.py",
          "tests/orchestrator/test_summary.py", "tests/orchestrator/test_replays.py",
          "tests/orchestrator/test_views.py", "tests/orchestrator/test_interrupted_commands.py")),
)  # fmt: skip

# Faults like those that once survived their nearest tests: file, old text, new text.
KNOWN = (
    ("fmus/physics/contact/wheel.py", "4.0 * c * c / 45.0", "4.0 * c * c / 54.0"),
    ("fmus/driver/pursuit.py", "length = max(p.reach, p.preview * v)", "length = p.preview * v"),
    ("fmus/drives/motor.py", "torque != unlimited and unlimited * error > 0.0", "torque != unlimited"),
    ("orchestrator/log/page.py", "wired_inputs(check.rule, start, end).view(np.uint64) != recorded.view(np.uint64)",
     "wired_inputs(check.rule, start, end) != recorded"),
    ("orchestrator/log/stream.py", 'has_last & (has_first | (wire.rule == "end"))', "has_last & has_first"),
    ("orchestrator/results/energy.py", 'stored = [f"energy.{kind}" for kind in STORED]',
     'stored = [f"energy.{kind}" for kind in STORED if kind != "kinetic"]'),
)  # fmt: skip


def known_faults() -> list[tuple[Path, Fault]]:
    """The known faults as faults of lines; raises LookupError if a line has changed."""
    faults = []
    for name, old, new in KNOWN:
        lines = (ROOT / name).read_text(encoding="utf-8").splitlines()
        numbers = [k for k, line in enumerate(lines, 1) if old in line]
        if len(numbers) != 1:
            raise LookupError(f"{name}: '{old}' stands in {len(numbers)} lines")
        line = lines[numbers[0] - 1]
        faults.append((Path(name), Fault(numbers[0], line, line.replace(old, new), "known")))
    return faults


def nearest(file: Path, area: Area) -> list[str]:
    """Test modules that import the module of a file, directly or by a helper, and then the others of its area."""
    module = ".".join(file.with_suffix("").parts).removesuffix(".__init__")
    sources = {path: path.read_text(encoding="utf-8") for path in sorted((ROOT / "tests").rglob("*.py"))}
    importing = {path for path, text in sources.items() if _imports(text, module)}
    helpers = {path.stem for path in importing if not path.stem.startswith("test_")}
    tests = [
        path.relative_to(ROOT).as_posix()
        for path, text in sources.items()
        if path.stem.startswith("test_")
        and (
            path in importing
            or any(line.startswith("from ") and line.split()[1] in helpers for line in text.splitlines())
        )
    ]
    return list(dict.fromkeys([*tests, *area.tests]))


def _imports(text: str, module: str) -> bool:
    """Whether a source imports a module or names of it."""
    parent, _, name = module.rpartition(".")
    return f"{module} import" in text or any(
        line.startswith(f"from {parent} import") and name in line.replace(",", " ").split()
        for line in text.splitlines()
    )
