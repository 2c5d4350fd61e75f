#!/usr/bin/env bash
# Pebble 5.2.3: a spawned worker that is still starting when the pool ends prints a traceback of FileNotFoundError.
#
# The last task is done, the pool is closed and joined as its page shows, and every result is there. The pool removes
# the locks of its channel before it ends its workers, in PoolManager.stop; a worker that has not yet unpickled them
# finds no semaphore of that name. It happens when the first workers do all tasks while a later one imports the main
# module: short tasks, a slow disk, fewer tasks than workers. Here the second worker waits until the first has ended.
# A context whose RLock keeps a reference to each lock until the pool has been joined avoids it (the twin below).
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet pebble==5.2.3
cd "$folder"
cat > late.py <<'PYTHON'
import fcntl, os, signal, sys
from multiprocessing.context import SpawnContext, SpawnProcess

from pebble import ProcessPool


class Keeping(SpawnContext):
    kept = []

    def RLock(self):
        self.kept.append(super().RLock())
        return self.kept[-1]


def task():
    with open("begun"):  # a pipe: the second worker has come to its start
        return "done"


def start(process, start=SpawnProcess.start):
    start(process)
    os.environ["WORKER"] = "second"


if __name__ == "__main__":
    SpawnProcess.start = start
    os.environ["WORKER"] = "first"
    os.mkfifo("begun")
    with ProcessPool(2, context=Keeping() if sys.argv[1:] == ["keep"] else SpawnContext()) as pool:
        future = pool.schedule(task)
    print(future.result())
else:
    file = open("lock", "w")
    if os.environ["WORKER"] == "second":
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        open("begun", "w").close()
    fcntl.flock(file, fcntl.LOCK_EX)  # the first holds it until it ends
PYTHON
for context in spawn keep; do
    rm -f begun
    "$folder/env/bin/python" late.py $context > "$context.out" 2> "$context.err"
    echo "$context: $(cat "$context.out"), standard error: $(tail -n 1 "$context.err")"
done
grep -q done spawn.out && grep -q done keep.out
grep -q "FileNotFoundError" spawn.err || { echo "the late worker says nothing now"; exit 1; }
test ! -s keep.err
echo "as described"
