"""First messages of readers: for a log that was cut off, and for one of another version."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from life_logs import log_of
from logged import logged
from recorded import record_in_chunks

import orchestrator as cotrack_package
from fmus.vehicles.tables import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.scene.same_scene import require_same_scene
from orchestrator.scene.scene import load

OLD = Path(__file__).with_name("logs") / "format_1.mcap"  # made by cotrack 0.1.0


@pytest.fixture(scope="module")
def cut(tmp_path_factory):
    """Folder with a chain's log, whole and without its end."""
    folder = tmp_path_factory.mktemp("cut")
    settings = ("run.stop=0.3 s", "run.checkpoints=0.05 s")
    assert simulate(load("hanging_chain", "flexible", settings), folder / "whole.mcap")["status"] == "ok"
    with Log(folder / "whole.mcap") as log:
        size = log.size
    (folder / "cut.mcap").write_bytes((folder / "whole.mcap").read_bytes()[: int(0.8 * size)])
    return folder


READERS = (
    ("view", "LOG", "-o", "a.png"),
    ("plot", "LOG", "chain.tension.max", "-o", "p.png"),
    ("analyse", "LOG", "links"),
    ("report", "LOG", "-o", "r.html"),
    ("compare", "LOG", "WHOLE"),
    ("compare", "WHOLE", "LOG"),
    ("replay", "LOG"),
    ("resume", "LOG", "-o", "resumed.mcap"),
    ("log", "export", "LOG", "-o", "folder"),
)


@pytest.mark.parametrize("command", READERS, ids=lambda command: " ".join(command[:2]))
def test_every_reading_command_says_first_that_a_log_was_cut_off(cotrack, cut, command):
    paths = {"LOG": cut / "cut.mcap", "WHOLE": cut / "whole.mcap"}
    status, _, err = cotrack(*(paths.get(word, word) for word in command))
    with logged(".") as said, Log(paths["LOG"]) as log:
        last = max(float(log.read(topic).t[-1]) for topic in ("/chain/out", "/chain/links"))
    assert status == 0, err
    assert said == [log.cut_off]
    sentence = f"{paths['LOG']} was cut off at t = {last:.6g} s: no closing record"
    assert err.splitlines()[0] == f"cotrack: {sentence}"
    assert err.count("was cut off") == 1, "the message appears once"
    assert 0.0 < last < 0.3


def test_a_log_of_a_failed_run_says_so(cotrack, tmp_path):
    """Figures of a run that left the range of its model are shown below the reason."""
    log = log_of(tmp_path / "failed.mcap", np.full((3000, 4), 2e4), status="failed", message="not valid from 2 s on")
    _, _, err = cotrack("analyse", log, "life")
    assert err.splitlines()[0] == f"cotrack: {tmp_path / 'failed.mcap'}: its run failed: not valid from 2 s on"
    _, _, err = cotrack("analyse", log_of(tmp_path / "whole.mcap", np.full((3000, 4), 2e4)), "life")
    assert "failed" not in err


def test_whole_logs_and_logs_of_runs_say_nothing(cotrack, cut, tmp_path):
    for command in (("analyse", cut / "whole.mcap", "links"), ("replay", cut / "whole.mcap")):
        status, _, err = cotrack(*command)
        assert (status, err) == (0, "")
    with Log(cut / "whole.mcap") as log:
        assert log.metadata["versions"]["cotrack"] == cotrack_package.__version__ != "0.1.0"
    with logged() as said:
        log = record_in_chunks(tmp_path / "a.mcap")
        with Log(log):
            pass
        simulate(load("hanging_chain", "flexible", ("run.stop=0.02 s",)), tmp_path / "b.mcap", estimated=True)
    assert said == []


def test_functions_of_python_warn_and_pages_say_it_at_their_top(cut, tmp_path):
    with logged("no closing record"):
        cotrack_package.compare(cut / "cut.mcap", cut / "whole.mcap")
    for logs in (("whole", "cut"), ("cut",)):
        one, *other = (cut / f"{name}.mcap" for name in logs)
        with logged("no closing record"):
            cotrack_package.report(one, tmp_path / "p.html", *other)
        assert "cut.mcap was cut off at t = " in (tmp_path / "p.html").read_text(encoding="utf-8").split("<nav")[0]


def test_log_commands_say_it_in_their_own_words_alone(cotrack, cut):
    for command in ("info", "verify"):
        _, out, err = cotrack("log", command, cut / "cut.mcap")
        assert err == ""
        assert "cut off" in out


# --- versions --------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["replay", "resume"])
def test_what_computes_anew_says_which_version_made_a_log(cotrack, tmp_path, command):
    shutil.copy(OLD, tmp_path / "old.mcap")
    err = cotrack.refused(command, tmp_path / "old.mcap")
    made = f"old.mcap was made by cotrack 0.1.0, and this is cotrack {cotrack_package.__version__}"
    assert made in err.splitlines()[0]
    assert len(err.splitlines()) == 2


@pytest.mark.long
def test_compare_works_across_versions(cotrack, cut, tmp_path):
    """Logs of different versions compare: newer keys have their defaults in the older log."""
    with Log(OLD) as log:
        scene = log.table("scene.json")
    settings = f"chain.links={scene['chain']['links']}", f"run.stop={scene['run']['stop']}"
    simulate(load("hanging_chain", "flexible", settings), tmp_path / "new.mcap")
    assert "pins" in cotrack.done("compare", OLD, tmp_path / "new.mcap")
    assert "chain.links = 4 and 64" in cotrack.refused("compare", OLD, cut / "whole.mcap")


def test_keys_that_one_version_does_not_know_make_no_other_scene():
    new = load("straight", "flexible").resolved()
    old = {**new, "drive": {key: value for key, value in new["drive"].items() if key != "brake"}}
    require_same_scene(("a", old), ("b", new))
    with pytest.raises(BadInput, match=r"drive\.brake = 0\.0 and 5000\.0"):
        require_same_scene(("a", old), ("b", {**new, "drive": {**new["drive"], "mode": "controller", "brake": 5e3}}))
