"""Recovered logs can be verified, compared, balanced, replayed and drawn like any other, wherever cut."""

import struct

import numpy as np
import pytest

from fmus.track.choices import TRACKS
from orchestrator.execution import replay_model
from orchestrator.execution.simulate import simulate
from orchestrator.log import page, recorder
from orchestrator.log.reader import Log
from orchestrator.log.tools import RECOVERED, WHOLE, recover, verify
from orchestrator.results.difference import differences
from orchestrator.results.energy import ledger
from orchestrator.results.run_data import Missing, RunData
from orchestrator.results.views.flat_views import draw_side
from orchestrator.scene.scene import load

WINDOWED = ("_mean", "_rms")  # means over a second, which is longer than the rest of the log


def recorded(path, scene, track, *settings):
    """Log of a run in chunks of a few steps."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (page, recorder):
            patch.setattr(module, "CHUNK", 6_000)
        assert simulate(load(scene, track, settings), path)["status"] == "ok"
    return path


def borders(data):
    """Beginnings and ends of the chunks."""
    offsets, offset = [], 8
    while offset < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, offset)
        offsets += [offset, offset + 9 + length] if opcode == 0x06 else []
        offset += 9 + length
    return offsets


def ends(log):
    """The last step of each topic that is recorded at every step."""
    return {
        topic: int(log.sequence(topic)[-1]) + topic.endswith("/in")
        for topic, about in log.topics.items()
        if about.every == 1 and not topic.startswith("/stats/")
    }


def survey(whole, rerun_to, cuts, components, folder, seldom):
    """Cut a log at each place and use what is recovered; return the set of last steps.

    ``rerun_to(n)`` runs n steps for the comparison.
    """
    data, last_steps = whole.read_bytes(), set()
    with Log(whole) as log:
        reference = RunData(log)
        for number, cut in enumerate(cuts):
            broken, saved = folder / "cut.mcap", folder / "saved.mcap"
            broken.write_bytes(data[:cut])
            assert recover(broken, saved).code == RECOVERED
            assert verify(saved).code == WHOLE
            with Log(saved) as left:
                n = left.closing["steps"]
                last_steps.add(n)
                if n < max(about.every for topic, about in left.topics.items() if topic.endswith("/out")):
                    continue  # the outputs of no step are left to compare
                assert set(ends(left).values()) == {n}, cut
                run = RunData(left)
                books = ledger(run)
                assert np.isfinite(books.residual)
                apart = differences(run, reference)
                assert apart.keys() & {"torque", "position", "chain_speed"}
                assert all(one.relative < 1e-9 for name, one in apart.items() if not name.endswith(WINDOWED)), cut
                if number % seldom == 0:
                    with Log(rerun_to(n)) as shorter:
                        theirs, ours = shorter.hashes(), left.hashes()
                        assert {t: h for t, h in ours.items() if "stats" not in t}.items() <= theirs.items()
                        assert ledger(RunData(shorter)) == books
            if number % seldom == 0:
                for name in components:
                    with replay_model.open_replay(saved, name, None) as again:
                        verdict = again.verify()
                    assert verdict.equal, verdict.sentence
                    assert verdict.steps == n
                draw_side(saved, folder / "view.png")
    return last_steps


def places(whole, count):
    """``count`` places all over the messages, and the borders of the chunks."""
    with Log(whole) as log:
        end = log._file.data_end
    edges = borders(whole.read_bytes())
    return sorted({*np.linspace(edges[0], end - 1, count).astype(int).tolist(), *edges, end})


@pytest.mark.long
def test_what_is_left_of_a_run_is_as_good_as_a_shorter_run(tmp_path):
    def run(n):
        settings = (f"run.stop={n * 1e-3}", "run.links=4", "expect={}", "drive.ramp_start=0")
        return recorded(tmp_path / f"rig-{n}.mcap", "rig", "rigid", *settings)

    whole = run(30)
    last_steps = survey(whole, run, places(whole, 12), ("track", "drive"), tmp_path, 13)
    assert len(last_steps) > 5


def test_steps_that_are_lost_are_no_shorter_run(tmp_path):
    """A log without a chunk in its middle is no shorter run: balance and replay are refused in a sentence."""
    whole = recorded(tmp_path / "chain.mcap", "hanging_chain", "flexible", "run.stop=0.1", "chain.links=8", "expect={}")
    data = bytearray(whole.read_bytes())
    edges = borders(data)
    data[edges[2] + 100] ^= 4
    (tmp_path / "bad.mcap").write_bytes(data)
    assert recover(tmp_path / "bad.mcap", tmp_path / "saved.mcap").code == RECOVERED
    with Log(tmp_path / "saved.mcap") as log:
        assert log.closing["steps"] == 100
        with pytest.raises(Missing, match=r"lacks the inputs of 'chain' from t = 0\.0\d+ to 0\.0\d+ s"):
            ledger(RunData(log))
        with Log(whole) as reference:
            assert "pins" in differences(RunData(log), RunData(reference))


@pytest.mark.study
@pytest.mark.parametrize("track", TRACKS)
def test_what_is_left_of_a_vehicle_is_as_good_as_a_shorter_run(tmp_path, track):
    for outputs, count in ((1, 200), (3, 40)):

        def run(n, outputs=outputs):
            settings = (f"run.stop={n * 1e-3}", "run.links=7", "expect={}", f"run.outputs={outputs}")
            return recorded(tmp_path / f"settle-{outputs}-{n}.mcap", "settle", track, *settings)

        whole = run(100)
        last_steps = survey(whole, run, places(whole, count), ("left_track", "left_drive", "chassis"), tmp_path, 20)
        assert len(last_steps) > 5
