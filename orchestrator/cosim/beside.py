"""A thread that steps an FMU while this one steps another, and takes it over within a microsecond.

A thread of Python begins 60 us late and its end is noticed 20 us late: longer than a step of most components. This one
waits in machine code, without Python's lock, and looks for its next errand all the time. After a millisecond without
one it sleeps, and is then woken as slowly as any thread. Its code calls what FMI prescribes for a step, nothing else.
"""

from __future__ import annotations

import ctypes
import os
import platform
import sys
import threading
from functools import cache
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np

FREE, ASKED, BUSY, ASLEEP, ENDED = range(5)  # what the first word of a board says
LOOKS = 20_000  # for an errand before it sleeps: about a millisecond
ALWAYS = -1
KNOWN = sys.platform == "linux" and platform.machine() == "x86_64"  # the clock, the yield and the pause of the code


class Errand(NamedTuple):
    """What to call for a step of a component, addresses and numbers; constant."""

    instance: int
    set_real: int
    inputs: int  # value references
    n_inputs: int
    u: int
    do_step: int
    get_real: int
    outputs: int  # value references
    n_outputs: int
    y: int


class Report(NamedTuple):
    """How it went."""

    failed: int  # 0, or the place of the function that failed in ``Errand``
    status: int  # of FMI, of the one that failed
    seconds: float


# words of a board, of 8 bytes: the state; on cache lines of their own an errand, and what was asked and came of it
TASK, ASK, WORDS = 8, 24, 40
T, H, KEPT, FAILED, STATUS, SECONDS, BEGUN, OVER = *range(ASK, ASK + 7), ASK + 8

CODE = """
declare i32 @sched_yield()
declare i32 @clock_gettime(i32, ptr)

; the state becomes `to` if it is `from`; what it was
define i64 @change(ptr %board, i64 %from, i64 %to) {
  %pair = cmpxchg ptr %board, i64 %from, i64 %to seq_cst seq_cst
  %found = extractvalue {i64, i1} %pair, 0
  ret i64 %found
}

; wait while the state is `this`, looking `most` times; what it is then
define i64 @look(ptr %board, i64 %this, i64 %most) {
entry:
  br label %again
again:
  %n = phi i64 [0, %entry], [%m, %rest], [%m, %yield]
  %m = add i64 %n, 1
  %found = load atomic i64, ptr %board seq_cst, align 8
  %same = icmp eq i64 %found, %this
  %more = icmp ne i64 %m, %most
  %on = and i1 %same, %more
  br i1 %on, label %wait, label %out
wait:
  call void asm sideeffect "pause", ""()
  %low = and i64 %m, 1023
  %now = icmp eq i64 %low, 0
  br i1 %now, label %yield, label %rest
yield:
  %ignored = call i32 @sched_yield()
  br label %again
rest:
  br label %again
out:
  ret i64 %found
}

; do errands until there is none for long, or no more; what the state was then
define i64 @serve(ptr %board, i64 %most) {
entry:
  br label %wait
wait:
  %found = call i64 @look(ptr %board, i64 {FREE}, i64 %most)
  %asked = icmp eq i64 %found, {ASKED}
  br i1 %asked, label %take, label %idle
take:
  %there = call i64 @change(ptr %board, i64 {ASKED}, i64 {BUSY})
  %mine = icmp eq i64 %there, {ASKED}
  br i1 %mine, label %begin, label %wait
idle:
  %left = call i64 @change(ptr %board, i64 {FREE}, i64 {ASLEEP})
  %late = icmp eq i64 %left, {ASKED}
  br i1 %late, label %wait, label %out
out:
  ret i64 %left
begin:
  %ignored = call i64 @do(ptr %board)
  store atomic i64 {FREE}, ptr %board seq_cst, align 8
  br label %wait
}

; do the errand; whether it failed
define i64 @do(ptr %board) {
entry:
{LOADS}  %begun = call i32 @clock_gettime(i32 1, ptr %at.begun)
{TAKEN}  %some = icmp ne i64 %n_inputs, 0
  br i1 %some, label %write, label %step
write:
  %s1 = call i32 %set_real(ptr %instance, ptr %inputs, i64 %n_inputs, ptr %u)
  %b1 = icmp sgt i32 %s1, 1
  br i1 %b1, label %bad, label %step
step:
  %flag = trunc i64 %kept to i32
  %s2 = call i32 %do_step(ptr %instance, double %t, double %h, i32 %flag)
  %b2 = icmp sgt i32 %s2, 1
  br i1 %b2, label %bad, label %read
read:
  %s3 = call i32 %get_real(ptr %instance, ptr %outputs, i64 %n_outputs, ptr %y)
  %b3 = icmp sgt i32 %s3, 1
  br i1 %b3, label %bad, label %over
bad:
  %which = phi i64 [1, %write], [5, %step], [6, %read]
  %status = phi i32 [%s1, %write], [%s2, %step], [%s3, %read]
  %wide = zext i32 %status to i64
  store i64 %wide, ptr %at.status
  br label %over
over:
  %failed = phi i64 [0, %read], [%which, %bad]
  store i64 %failed, ptr %at.failed
  %ended = call i32 @clock_gettime(i32 1, ptr %at.over)
  %spent = load <2 x i64>, ptr %at.over, align 8
  %first = load <2 x i64>, ptr %at.begun, align 8
  %whole = sub <2 x i64> %spent, %first
  %parts = sitofp <2 x i64> %whole to <2 x double>
  %s = extractelement <2 x double> %parts, i64 0
  %ns = extractelement <2 x double> %parts, i64 1
  %fine = fmul double %ns, 1.0e-9
  %seconds = fadd double %s, %fine
  store double %seconds, ptr %at.seconds
  ret i64 %failed
}
"""


def _source() -> str:
    """The code with the words of a board."""
    words = {name: TASK + k for k, name in enumerate(Errand._fields)} | {"t": T, "h": H, "kept": KEPT}
    places = words | {"failed": FAILED, "status": STATUS, "seconds": SECONDS, "begun": BEGUN, "over": OVER}
    kinds = {name: "i64" if name in ("n_inputs", "n_outputs", "kept") else "ptr" for name in words}
    kinds |= {"t": "double", "h": "double"}
    loads = "".join(f"  %at.{name} = getelementptr i64, ptr %board, i64 {k}\n" for name, k in places.items())
    taken = "".join(f"  %{name} = load {kinds[name]}, ptr %at.{name}\n" for name in words)
    text = CODE.replace("{LOADS}", loads).replace("{TAKEN}", taken)
    for name, state in (("FREE", FREE), ("ASKED", ASKED), ("BUSY", BUSY), ("ASLEEP", ASLEEP)):
        text = text.replace(f"{{{name}}}", str(state))
    return text


class _Machine(NamedTuple):
    """The code; its functions run without Python's lock."""

    engine: Any
    change: Any
    look: Any
    serve: Any
    do: Any


@cache
def _machine() -> _Machine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    llvm.initialize_native_asmparser()
    module = llvm.parse_assembly(_source())
    module.triple = llvm.get_process_triple()
    target = llvm.Target.from_triple(module.triple).create_target_machine(opt=2)
    engine = llvm.create_mcjit_compiler(module, target)
    engine.finalize_object()
    board, word = ctypes.c_void_p, ctypes.c_int64
    kinds = {"change": (board, word, word), "look": (board, word, word), "serve": (board, word), "do": (board,)}
    made = {name: ctypes.CFUNCTYPE(word, *taken)(engine.get_function_address(name)) for name, taken in kinds.items()}
    return _Machine(engine, **made)


def possible() -> bool:
    """Whether this machine has a second processor for it."""
    return KNOWN and len(os.sched_getaffinity(0)) > 1


class Board:
    """What a step is asked and answered on."""

    def __init__(self, errand: Errand | None = None) -> None:
        self._machine = _machine()
        room = np.zeros(WORDS + 8, dtype=np.int64)
        first = -(room.ctypes.data // 8) % 8  # begins with a cache line
        self._room, self._words = room, room[first : first + WORDS]
        self._times = self._words.view(np.float64)
        self._at = self._words.ctypes.data
        self._errand = errand
        if errand is not None:
            self.errand = errand

    @property
    def errand(self) -> Errand:
        """What is called."""
        assert self._errand is not None
        return self._errand

    @errand.setter
    def errand(self, errand: Errand) -> None:
        self._errand = errand
        self._words[TASK : TASK + len(errand)] = errand

    def write(self, t: float, h: float, kept: bool) -> None:
        """A step from ``t`` by ``h`` s; ``kept``: no earlier state will be restored."""
        self._times[T], self._times[H], self._words[KEPT] = t, h, kept

    def do(self) -> Report:
        """Write inputs, step, read outputs, in this thread."""
        self._machine.do(self._at)
        return self.report()

    def report(self) -> Report:
        """How it went."""
        return Report(int(self._words[FAILED]), int(self._words[STATUS]), float(self._times[SECONDS]))


class Beside(Board):
    """The thread: ``ask`` it for a step, do something else, ``wait`` for it."""

    def __init__(self) -> None:
        super().__init__()
        self._wake = threading.Semaphore(0)
        self._thread = threading.Thread(target=self._work, name="beside", daemon=True)
        self._thread.start()

    def ask(self, errand: Errand, t: float, h: float, kept: bool) -> None:
        """Write inputs, step from ``t`` by ``h`` s, read outputs; ``kept``: no earlier state will be restored."""
        if errand is not self._errand:
            self.errand = errand
        self.write(t, h, kept)
        self._turn(ASKED)

    def wait(self) -> Report:
        """Until that is done; what the thread has not begun by now, as it does not run, is done in this one."""
        if self._machine.change(self._at, ASKED, FREE) == ASKED:
            return self.do()
        self._machine.look(self._at, BUSY, ALWAYS)
        return self.report()

    def close(self) -> None:
        """End the thread, after what it is doing."""
        self.wait()
        self._turn(ENDED)
        self._thread.join()

    def _turn(self, state: int) -> None:
        if self._machine.change(self._at, FREE, state) == ASLEEP:
            self._machine.change(self._at, ASLEEP, state)
            self._wake.release()

    def _work(self) -> None:
        while self._machine.serve(self._at, LOOKS) != ENDED:
            self._wake.acquire()
