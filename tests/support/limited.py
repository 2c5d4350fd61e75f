"""Commands in child processes with limits of memory and time, forked from one process that has imported all.

``python limited.py MEMORY SECONDS`` reads a JSON list of command lines from stdin and prints, for each, its exit status
(negative: the signal that ended it), stderr, seconds of a processor and peak memory in MB.
"""

import json
import os
import resource
import signal
import sys
import tempfile
import time


def run(arguments: list[str], memory: int, seconds: int) -> dict[str, object]:
    """Run a command in a fork with ``memory`` MB more than this process has, and ``seconds`` of a processor."""
    with tempfile.TemporaryFile("w+") as errors:
        child = os.fork()
        if not child:
            _be_command(arguments, memory, seconds, errors.fileno())
        ending = time.monotonic() + 10 * seconds  # a processor is shared; what waits for nothing must end, too
        while (ended := os.wait4(child, os.WNOHANG))[0] == 0 and time.monotonic() < ending:
            time.sleep(0.005)
        if ended[0] == 0:
            os.kill(child, signal.SIGKILL)
            ended = os.wait4(child, 0)
        _, status, usage = ended
        errors.seek(0)
        return {
            "status": os.waitstatus_to_exitcode(status),
            "stderr": errors.read()[-4000:],
            "seconds": usage.ru_utime + usage.ru_stime,
            "memory": usage.ru_maxrss / 1024,
        }


def _be_command(arguments: list[str], memory: int, seconds: int, errors: int) -> None:
    """Be the command; never return."""
    from orchestrator.cli import main

    os.dup2(errors, 2)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    with open("/proc/self/statm") as statm:
        mapped = int(statm.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (mapped + (memory << 20),) * 2)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    sys.argv = ["cotrack", *arguments]
    code = 1
    try:
        main()
    except SystemExit as ended:
        code = int(ended.code or 0)
    finally:
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    import matplotlib.pyplot  # noqa: F401
    import scipy.linalg  # noqa: F401

    from orchestrator.cosim import component  # noqa: F401
    from orchestrator.execution import log_report, replay_model, resume, simulate  # noqa: F401
    from orchestrator.results.analyses import power, signal_picture  # noqa: F401
    from orchestrator.results.views import flat_views  # noqa: F401

    for line in json.load(sys.stdin):
        print(json.dumps(run(line, int(sys.argv[1]), int(sys.argv[2]))), flush=True)
