"""Logs of earlier versions are read, analysed, compared and replayed as they were.

``logs/old_logs.tar.xz`` was made on 2026-11-29 with 0.4.0 (d4ae4d72), whose answers lie beside its logs:
of a bench with each coupling, with both links, native and not, of variable steps, cut off, recovered and resumed; of a
chain; of vehicles with both links. A log of 0.1.0 has no number of its format, one of 0.2.0 a scene without an FMU.
"""

import hashlib
import json
import tarfile
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cosim.coupling import COUPLINGS
from orchestrator.log.reader import Log
from orchestrator.log.tools import WHOLE, verify

LOGS = Path(__file__).with_name("logs")
OLD = LOGS / "without_fmu.mcap"  # `sliding_mass`, 0.05 s, made on 2026-11-23
OLDEST = LOGS / "format_1.mcap"  # made on 2026-11-21
NAMES = (
    "chain", "cut", "energy_corrected", "gauss_seidel", "iterative", "jacobi", "recovered", "resumed", "tracks_first",
    "variable", "vehicle", "vehicle_flexible",
)  # fmt: skip


@pytest.fixture(scope="module")
def old(tmp_path_factory):
    """The folder of the old logs, and the answers of their version by log."""
    folder = tmp_path_factory.mktemp("old")
    with tarfile.open(LOGS / "old_logs.tar.xz") as archive:
        archive.extractall(folder, filter="data")
    return folder, json.loads((folder / "answers.json").read_text())


@pytest.fixture
def ask(cotrack):
    return lambda *command: cotrack(*command)[:2]


def answers_of(path, ask):
    """All that is asked of one log."""
    status, said = ask("log", "verify", path)
    found = {"verify": status, "whole": "is whole" in said, "arrays": arrays(path)}
    if not status:
        found["digest"] = json.loads(ask("log", "info", path, "--json")[1])["digest"]
    for what in ("power", "links"):
        found[what] = table(*ask("analyse", path, what, "--json"))
    return found


def compared(folder, ask):
    """Comparisons of two logs: of two couplings, and of a run with one that was interrupted and resumed."""
    status, said = ask("compare", folder / "tracks_first.mcap", folder / "resumed.mcap", "--bits")
    return {
        "couplings": table(*ask("compare", folder / "jacobi.mcap", folder / "gauss_seidel.mcap", "--json")),
        "resumed": [status, said.splitlines()[-1]],
    }


def arrays(path):
    """SHA-256 of times and values of each topic."""
    found = {}
    with Log(path, unfinished=True) as log:
        for topic in log.topics:
            series = log.read(topic)
            found[topic] = hashlib.sha256(series.t.tobytes() + series.values.tobytes()).hexdigest()[:16]
    return found


def table(status, said):
    """JSON of an answer, without paths; the status alone of a refusal."""
    return json.loads(said.replace(str(Path.cwd()), "")) if said.startswith(("{", "[")) else status


def leaves(answer, place=""):
    """Flat values of an answer by their place."""
    if isinstance(answer, dict | list):
        entries = answer.items() if isinstance(answer, dict) else enumerate(answer)
        return {where: leaf for key, one in entries for where, leaf in leaves(one, f"{place}/{key}").items()}
    return {place: answer}


def assert_same(answer, expected):
    """Equal texts, numbers within 1e-9 but for rounding (kN, kW); not so if one number is off by a few per cent."""
    found, wanted = leaves(answer), leaves(expected)
    assert found.keys() == wanted.keys()
    for where, value in wanted.items():
        if isinstance(value, float):
            assert found[where] == pytest.approx(value, rel=1e-9, abs=1e-10), where
        elif not where.endswith("/log"):
            assert found[where] == value, where


@pytest.mark.parametrize("name", NAMES)
def test_an_old_log_answers_as_it_did(old, ask, name):
    """Forces on links, which 0.4.0 had in two tables, the second one of the first track, are compared row by row."""
    folder, expected = old[0], dict(old[1][name])
    answer, known = answers_of(folder / f"{name}.mcap", ask), {}
    rows = {(row["track"], row["component"]): row for row in answer.pop("links")["rows"]}
    for each in [*expected.pop("joints")["rows"], *expected.pop("links")["rows"]]:
        row = {key.replace("at joint", "in link"): cell for key, cell in each.items()}
        place = row.pop("track", next(iter(rows))[0]), f"{row.pop('of a link', 'joint force')} {row.pop('axis')}"
        known.setdefault(place, {}).update(row)
    answer["links"] = {place: {key: rows[place][key] for key in row} for place, row in known.items()}
    assert_same(answer, expected | {"links": known})
    answer["links"][next(iter(known))]["largest"] *= 1.03
    with pytest.raises(AssertionError, match="largest"):
        assert_same(answer, expected | {"links": known})


def test_old_logs_compare_as_they_did(old, ask):
    folder, expected = old
    assert_same(compared(folder, ask), expected["compared"])


@pytest.mark.parametrize(
    ("name", "component", "links", "apart"),
    [("chain", "chain", "flexible", 1e-12), ("iterative", "track", "flexible", 1e-6),
     pytest.param("jacobi", "track", "rigid", 1e-6, marks=pytest.mark.study), ("variable", "track", "rigid", 1e-6),
     pytest.param("vehicle", "left_track", "rigid", 1e-4, marks=pytest.mark.long)],
)  # fmt: skip
def test_old_inputs_give_the_old_outputs(old, cotrack, name, component, links, apart):
    """Rigid links come to rest otherwise than in 0.4.0 (fixed losses), by 2e-5 of a force."""
    log = old[0] / f"{name}.mcap"
    status, _, err = cotrack("replay", log, "--component", component)
    assert status == 2
    assert "made by another build" in err
    replay = "replay", log, "--component", component, "--with", links, "-o", "answer.mcap", "--json"
    status, out, _ = cotrack(*replay)
    signals = json.loads(out)["signals"]
    forces = {name: one for name, one in signals.items() if one["unit"] == "N"}
    assert status == 0
    assert forces
    most = max(one["rms, log"] for one in forces.values())
    assert max(one["rms apart"] for one in forces.values()) < apart * most
    assert np.isclose(signals[next(iter(forces))]["rms, now"], signals[next(iter(forces))]["rms, log"], rtol=1e-3)


def test_a_run_with_a_retired_coupling_is_read_and_replayed_but_does_not_go_on(old, cotrack):
    """The inputs of a replay are those of the log, whatever rule made them."""
    log = old[0] / "energy_corrected.mcap"
    replay = "replay", log, "--component", "track", "--with", "rigid", "-o", "answer.mcap"
    status, _, err = cotrack(*replay)
    assert (status, err.count("\n")) == (0, 1)
    assert "energy_corrected.mcap was made by cotrack 0.4.0" in err
    status, _, err = cotrack("resume", log, "-o", "further.mcap")
    assert status == 2
    assert "run.coupling.scheme = 'energy_corrected' has been retired" in err
    assert not Path("further.mcap").exists()
    status, _, err = cotrack("run", "rig", "--coupling", "energy_corrected")
    assert status == 2
    assert "must be " + " or ".join(f'"{name}"' for name in COUPLINGS) in err


@pytest.mark.parametrize(
    ("command", "status", "says"),
    [
        (("log", "info"), 0, "6d99d835c4f8e788"),
        (("log", "verify"), 0, "is whole"),
        (("analyse", "events"), 0, "0 events"),
        (("plot", "slider.place", "-o", "place.png"), 0, "place.png"),
        (("report", "-o", "page.html"), 0, "page.html"),
        (("view", "-o", "side.png"), 2, "holds no links to draw"),
        (("replay", "--component", "slider"), 2, "was stepped without an FMU"),
        (("resume",), 2, "assembly = 'slider': has no FMU and is validated in a clone"),
    ],
)
def test_every_command_ends_as_it_should(cotrack, command, status, says):
    words = 2 if command[0] == "log" else 1
    ended, out, err = cotrack(*command[:words], OLD, *command[words:])
    assert ended == status
    assert says in out + err


def test_the_oldest_log_is_read_by_every_reading_command_in_silence(cotrack):
    with Log(OLDEST) as log:
        assert log.digest() == "aa9904c9ceb3be31b23ee579c6f99991302ec69b75dd956b3315d5acbb79fb3e"
        assert log.read("/chain/links").values.shape == (5, 38)
    assert verify(OLDEST).code == WHOLE
    for name, *options in (
        ("view", "-o", "a.png"), ("view", "--foxglove", "-o", "f.mcap"), ("plot", "chain.tension.max", "-o", "p.png"),
        ("analyse", "links"), ("analyse", "events"), ("report", "-o", "r.html"), ("log info",), ("log verify",),
        ("log export", "-o", "folder"), ("log recover", "-o", "recovered.mcap"),
    ):  # fmt: skip
        status, _, err = cotrack(*name.split(), OLDEST, *options)
        assert (status, err) == (0, ""), name
