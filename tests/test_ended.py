"""The tests end with all their processes when they are told to."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

HERE = Path(__file__).parent


@pytest.mark.parametrize("plugin", ["conftest", "no:cacheprovider"])
def test_pytest_ends_with_its_workers_and_their_processes(tmp_path, plugin):
    """Without the handler of ``conftest``, what the workers have started lives on."""
    (tmp_path / "test_sleep.py").write_text("import subprocess\ndef test_it(): subprocess.run(['sleep', '60'])\n")
    options = ["-p", plugin, "-n", "1", "-c", os.devnull, "--rootdir", tmp_path, tmp_path]
    command = [sys.executable, "-m", "pytest", *options]
    path = os.pathsep.join([str(HERE), str(HERE / "support"), str(HERE.parent)])
    tests = subprocess.Popen(command, env={**os.environ, "PYTHONPATH": path}, stdout=subprocess.DEVNULL)
    try:
        for _ in range(600):
            if sleeping := [one for one in psutil.Process(tests.pid).children(recursive=True) if one.name() == "sleep"]:
                break
            time.sleep(0.05)
        tests.send_signal(signal.SIGTERM)
        tests.wait(5.0)
        _, alive = psutil.wait_procs(sleeping, 2.0)
        assert sleeping
        assert bool(alive) == (plugin != "conftest")
    finally:
        for one in sleeping:
            if one.is_running():
                one.kill()
