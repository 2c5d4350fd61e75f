"""A communication step in machine code: values handed over, components stepped, some of them in threads beside.

In Python every array that is handed over and every call cost microseconds, and a thread of Python begins 60 us late and
its end is noticed 20 us late. This code runs without Python's lock, and its threads look for their next errand all the
time; after a millisecond without one they sleep in the kernel. It calls what FMI prescribes for a step.

All is laid out in words of 8 bytes: a board for each component, a desk for each thread, the plan of a step, and rows of
what came of it.
"""

from __future__ import annotations

import platform
import sys
from functools import cache
from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.machine_code import ADDRESS, REAL, WORD, Code, made
from orchestrator.log.page import TIME

KNOWN = sys.platform == "linux" and platform.machine() == "x86_64"  # the system calls and the pause of the code
FREE, ASKED, BUSY, ASLEEP, ENDED = range(5)  # what a desk's first word says
LOOKS = 20_000  # for an errand before a thread sleeps: about a millisecond


class Board(NamedTuple):
    """What to call for a step of a component, addresses and numbers; what is asked, and what came of it."""

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
    t: float
    h: float
    kept: int  # whether no earlier state will be restored
    failed: int = 0  # or the word of the function that did
    status: int = 0  # of FMI, of that function
    seconds: float = 1.0  # in the last step; of the first one it is not known, and may be long
    spent: float = 0.0  # in all of them
    begun: int = 0  # as the clock counts: s, and ns in the next word
    begun_ns: int = 0
    over: int = 0
    over_ns: int = 0
    n_links: int = 0  # 0 where nobody records them
    links: int = 0  # value references
    y_links: int = 0
    links_due: int = 0  # a word: whether they are read after this step
    array: int = 0  # where they lie in the FMU once one of them, the reference behind those of outputs, is read; or 0


class Desk(NamedTuple):
    """Of a thread: its state, and the board of its errand."""

    state: int = FREE
    board: int = 0


class Plan(NamedTuple):
    """A step: values that are there before it, then group after group."""

    n_copies: int  # u = y, by address
    copies_to: int
    copies_from: int
    n_groups: int
    groups: int
    n_desks: int
    desks: int  # addresses
    long: float  # s: threads pay when the last member of a group took so long


class Group(NamedTuple):
    """Components that step at once, and values that they need of those that have stepped."""

    n_copies: int  # u = y
    copies_to: int
    copies_from: int
    n_means: int  # u = (u + y) / 2, u being the value before the step
    means_to: int
    means_from: int
    n_boards: int
    boards: int  # addresses


class Rows(NamedTuple):
    """A table of values that grows by a row: parts that lie anywhere, one after the other."""

    n_parts: int
    parts: int  # addresses
    sizes: int  # bytes
    next: int  # where the next row begins


CODE = """
declare i32 @sched_yield()
declare i32 @clock_gettime(i32, ptr)
declare i64 @syscall(i64, ...)
declare ptr @memcpy(ptr, ptr, i64)

; does nothing, as any of FMI's functions
define i32 @nothing() {
  ret i32 0
}

; the desk's state becomes `to` if it is `from`; what it was
define i64 @change(ptr %desk, i64 %from, i64 %to) {
  %pair = cmpxchg ptr %desk, i64 %from, i64 %to seq_cst seq_cst
  %found = extractvalue {i64, i1} %pair, 0
  ret i64 %found
}

; wait while the state is `this`, looking `most` times; what it is then
define i64 @look(ptr %desk, i64 %this, i64 %most) {
entry:
  br label %again
again:
  %n = phi i64 [0, %entry], [%m, %rest], [%m, %yield]
  %m = add i64 %n, 1
  %found = load atomic i64, ptr %desk seq_cst, align 8
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

; a thread's life: do errands until it is to end
define void @serve(ptr %desk, i64 %most) {
entry:
  br label %wait
wait:
  %found = call i64 @look(ptr %desk, i64 {FREE}, i64 %most)
  switch i64 %found, label %wait [i64 {ASKED}, label %take
                                  i64 {FREE}, label %tired
                                  i64 {ASLEEP}, label %sleep
                                  i64 {ENDED}, label %out]
take:
  %there = call i64 @change(ptr %desk, i64 {ASKED}, i64 {BUSY})
  %mine = icmp eq i64 %there, {ASKED}
  br i1 %mine, label %begin, label %wait
begin:
  %at.board = getelementptr i64, ptr %desk, i64 1
  %board = load ptr, ptr %at.board
  call void @do(ptr %board)
  store atomic i64 {FREE}, ptr %desk seq_cst, align 8
  br label %wait
tired:
  %left = call i64 @change(ptr %desk, i64 {FREE}, i64 {ASLEEP})
  br label %wait
sleep:  ; futex, wait while it says so
  %woken = call i64 (i64, ...) @syscall(i64 202, ptr %desk, i64 128, i64 {ASLEEP}, ptr null)
  br label %wait
out:
  ret void
}

; ask a thread that is free for something, and wake it
define void @turn(ptr %desk, i64 %to) {
entry:
  %was = call i64 @change(ptr %desk, i64 {FREE}, i64 %to)
  %asleep = icmp eq i64 %was, {ASLEEP}
  br i1 %asleep, label %wake, label %out
wake:
  %still = call i64 @change(ptr %desk, i64 {ASLEEP}, i64 %to)
  %woken = call i64 (i64, ...) @syscall(i64 202, ptr %desk, i64 129, i64 1)
  br label %out
out:
  ret void
}

define void @ask(ptr %desk, ptr %board) {
  %at.board = getelementptr i64, ptr %desk, i64 1
  store ptr %board, ptr %at.board
  call void @turn(ptr %desk, i64 {ASKED})
  ret void
}

; until that is done; what the thread has not begun by now, as it does not run, is done in this one
define void @join(ptr %desk) {
entry:
  %was = call i64 @change(ptr %desk, i64 {ASKED}, i64 {FREE})
  %mine = icmp eq i64 %was, {ASKED}
  br i1 %mine, label %here, label %there
here:
  %at.board = getelementptr i64, ptr %desk, i64 1
  %board = load ptr, ptr %at.board
  call void @do(ptr %board)
  ret void
there:
  %ended = call i64 @look(ptr %desk, i64 {BUSY}, i64 -1)
  ret void
}

; a step of a component: write inputs, step, read outputs, those of links where they are due
define void @do(ptr %board) {
entry:
{BOARD}  %begun.at = call i32 @clock_gettime(i32 1, ptr %at.begun)
  %some = icmp ne i64 %n_inputs, 0
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
  %linked = icmp ne i64 %n_links, 0
  br i1 %linked, label %ask, label %get
ask:
  %due = load i64, ptr %links_due
  %is.due = icmp ne i64 %due, 0
  br label %get
get:
  %now = phi i1 [0, %read], [%is.due, %ask]
  %known = icmp ne ptr %array, null
  %with.one = and i1 %now, %known
  %one.more = zext i1 %with.one to i64
  %n = add i64 %n_outputs, %one.more
  %s3 = call i32 %get_real(ptr %instance, ptr %outputs, i64 %n, ptr %y)
  %b3 = icmp sgt i32 %s3, 1
  br i1 %b3, label %bad, label %more
more:
  br i1 %now, label %show, label %ended
show:
  br i1 %known, label %copy, label %each
copy:
  %bytes = mul i64 %n_links, 8
  %same = call ptr @memcpy(ptr %y_links, ptr %array, i64 %bytes)
  br label %ended
each:
  %s4 = call i32 %get_real(ptr %instance, ptr %links, i64 %n_links, ptr %y_links)
  %b4 = icmp sgt i32 %s4, 1
  br i1 %b4, label %bad, label %ended
bad:
  %which = phi i64 [{SET_REAL}, %write], [{DO_STEP}, %step], [{GET_REAL}, %get], [{GET_REAL}, %each]
  %status.of = phi i32 [%s1, %write], [%s2, %step], [%s3, %get], [%s4, %each]
  %wide = zext i32 %status.of to i64
  store i64 %wide, ptr %at.status
  br label %ended
ended:
  %failed.at = phi i64 [0, %more], [0, %each], [0, %copy], [%which, %bad]
  store i64 %failed.at, ptr %at.failed
  %over.at = call i32 @clock_gettime(i32 1, ptr %at.over)
  %last = load <2 x i64>, ptr %at.over, align 8
  %first = load <2 x i64>, ptr %at.begun, align 8
  %whole = sub <2 x i64> %last, %first
  %parts = sitofp <2 x i64> %whole to <2 x double>
  %s = extractelement <2 x double> %parts, i64 0
  %ns = extractelement <2 x double> %parts, i64 1
  %fine = fmul double %ns, 1.0e-9
  %took = fadd double %s, %fine
  store double %took, ptr %at.seconds
  %sum = fadd double %spent, %took
  store double %sum, ptr %at.spent
  ret void
}

; n values, given by their addresses; `half`: the mean of what is there and what comes
define void @hand(i64 %n, ptr %to, ptr %from, i1 %half) {
entry:
  br label %next
next:
  %i = phi i64 [0, %entry], [%j, %store]
  %on = icmp ult i64 %i, %n
  br i1 %on, label %one, label %out
one:
  %to.i = getelementptr ptr, ptr %to, i64 %i
  %from.i = getelementptr ptr, ptr %from, i64 %i
  %u = load ptr, ptr %to.i
  %y = load ptr, ptr %from.i
  %end = load double, ptr %y
  br i1 %half, label %mean, label %store
mean:
  %start = load double, ptr %u
  %sum = fadd double %start, %end
  %middle = fmul double 0.5, %sum
  br label %store
store:
  %value = phi double [%end, %one], [%middle, %mean]
  store double %value, ptr %u
  %j = add i64 %i, 1
  br label %next
out:
  ret void
}

; components at once: as many beside as there are threads, where the last one takes long; how many failed
define i64 @together(i64 %n, ptr %boards, i64 %n_threads, ptr %desks, double %t, double %h, double %long) {
entry:
  %last = sub i64 %n, 1
  %at.at = getelementptr ptr, ptr %boards, i64 %last
  %at = load ptr, ptr %at.at
  %seconds.at = getelementptr double, ptr %at, i64 {SECONDS}
  %took = load double, ptr %seconds.at
  %pays = fcmp oge double %took, %long
  %threads = select i1 %pays, i64 %n_threads, i64 0
  br label %next
next:
  %i = phi i64 [0, %entry], [%j, %begun]
  %there = icmp ult i64 %i, %n
  br i1 %there, label %one, label %wait
one:
  %board.at = getelementptr ptr, ptr %boards, i64 %i
  %board = load ptr, ptr %board.at
  %t.at = getelementptr double, ptr %board, i64 {T}
  store double %t, ptr %t.at
  %h.at = getelementptr double, ptr %board, i64 {H}
  store double %h, ptr %h.at
  %other = icmp ne i64 %i, %last
  %free = icmp ult i64 %i, %threads
  %beside = and i1 %other, %free
  br i1 %beside, label %give, label %keep
give:
  %desk.at = getelementptr ptr, ptr %desks, i64 %i
  %desk = load ptr, ptr %desk.at
  call void @ask(ptr %desk, ptr %board)
  br label %begun
keep:
  call void @do(ptr %board)
  br label %begun
begun:
  %j = add i64 %i, 1
  br label %next
wait:
  %k = phi i64 [0, %next], [%l, %over]
  %bad = phi i64 [0, %next], [%worse, %over]
  %more = icmp ult i64 %k, %n
  br i1 %more, label %end, label %out
end:
  %its.at = getelementptr ptr, ptr %boards, i64 %k
  %its = load ptr, ptr %its.at
  %not.last = icmp ne i64 %k, %last
  %within = icmp ult i64 %k, %threads
  %was.beside = and i1 %not.last, %within
  br i1 %was.beside, label %back, label %over
back:
  %its.desk.at = getelementptr ptr, ptr %desks, i64 %k
  %its.desk = load ptr, ptr %its.desk.at
  call void @join(ptr %its.desk)
  br label %over
over:
  %failed.at = getelementptr i64, ptr %its, i64 {FAILED}
  %failed = load i64, ptr %failed.at
  %is = icmp ne i64 %failed, 0
  %one.more = zext i1 %is to i64
  %worse = add i64 %bad, %one.more
  %l = add i64 %k, 1
  br label %wait
out:
  ret i64 %bad
}

; the whole step; how many components failed in the group that ended it
define i64 @advance(ptr %plan, double %t, double %h) {
entry:
{PLAN}  call void @hand(i64 %n_copies, ptr %copies_to, ptr %copies_from, i1 0)
  br label %next
next:
  %i = phi i64 [0, %entry], [%j, %group]
  %failed = phi i64 [0, %entry], [%bad, %group]
  %there = icmp ult i64 %i, %n_groups
  %fine = icmp eq i64 %failed, 0
  %on = and i1 %there, %fine
  br i1 %on, label %group, label %out
group:
  %offset = mul i64 %i, {GROUP_WORDS}
  %one = getelementptr i64, ptr %groups, i64 %offset
{GROUP}  call void @hand(i64 %g.n_copies, ptr %g.copies_to, ptr %g.copies_from, i1 0)
  call void @hand(i64 %g.n_means, ptr %g.means_to, ptr %g.means_from, i1 1)
  %bad = call i64 @together(i64 %g.n_boards, ptr %g.boards, i64 %n_desks, ptr %desks, double %t, double %h,
    double %long)
  %j = add i64 %i, 1
  br label %next
out:
  ret i64 %failed
}

; another row of what its parts hold now
define void @put(ptr %rows) {
entry:
{ROWS}  br label %one
one:
  %i = phi i64 [0, %entry], [%j, %copy]
  %to = phi ptr [%next, %entry], [%behind, %copy]
  %on = icmp ult i64 %i, %n_parts
  br i1 %on, label %copy, label %out
copy:
  %part.at = getelementptr ptr, ptr %parts, i64 %i
  %size.at = getelementptr i64, ptr %sizes, i64 %i
  %part = load ptr, ptr %part.at
  %size = load i64, ptr %size.at
  %same = call ptr @memcpy(ptr %to, ptr %part, i64 %size)
  %behind = getelementptr i8, ptr %to, i64 %size
  %j = add i64 %i, 1
  br label %one
out:
  store ptr %to, ptr %at.next
  ret void
}

; steps k + 1 to k + n, of h s each, with a row after each, and one of links after each whose number is a multiple of
; `every`; the head of a row is told number and time; how many were done before a component failed
define i64 @march(ptr %plan, ptr %rows, ptr %of.links, ptr %head, ptr %due, i64 %every, i64 %k, i64 %n, double %h) {
entry:
  %head.t = getelementptr double, ptr %head, i64 {TIME}
  br label %next
next:
  %i = phi i64 [0, %entry], [%done, %over]
  %on = icmp ult i64 %i, %n
  br i1 %on, label %step, label %out
step:
  %before = add i64 %k, %i
  %number = add i64 %before, 1
  %rest = urem i64 %number, %every
  %is.due = icmp eq i64 %rest, 0
  %is.due.word = zext i1 %is.due to i64
  store i64 %is.due.word, ptr %due
  %count = uitofp i64 %before to double
  %t = fmul double %count, %h
  %failed = call i64 @advance(ptr %plan, double %t, double %h)
  %fine = icmp eq i64 %failed, 0
  br i1 %fine, label %keep, label %out
keep:
  %count.now = uitofp i64 %number to double
  %t.now = fmul double %count.now, %h
  store i64 %number, ptr %head
  store double %t.now, ptr %head.t
  call void @put(ptr %rows)
  br i1 %is.due, label %keep.links, label %over
keep.links:
  call void @put(ptr %of.links)
  br label %over
over:
  %done = add i64 %i, 1
  br label %next
out:
  store i64 0, ptr %due
  ret i64 %i
}
"""


def _loads(words: type, base: str, prefix: str = "") -> str:
    """Code that loads the words of a table, and has their places."""
    lines = []
    for k, (name, kind) in enumerate(get_type_hints(words).items()):
        of = "double" if kind is float else "i64" if name.startswith("n_") or name == "kept" else "ptr"
        lines.append(f"  %{prefix}at.{name} = getelementptr i64, ptr %{base}, i64 {k}\n")
        lines.append(f"  %{prefix}{name} = load {of}, ptr %{prefix}at.{name}\n")
    return "".join(lines)


def _source() -> str:
    """The code with the words of the tables."""
    text = CODE.replace("{BOARD}", _loads(Board, "board")).replace("{PLAN}", _loads(Plan, "plan"))
    text = text.replace("{GROUP}", _loads(Group, "one", "g.")).replace("{ROWS}", _loads(Rows, "rows"))
    numbers = {"FREE": FREE, "ASKED": ASKED, "BUSY": BUSY, "ASLEEP": ASLEEP, "ENDED": ENDED}
    numbers |= {name.upper(): k for k, name in enumerate(Board._fields)}
    for name, number in (numbers | {"GROUP_WORDS": len(Group._fields), "TIME": TIME}).items():
        text = text.replace(f"{{{name}}}", str(number))
    return text


def laid_out(words: NamedTuple) -> NDArray[np.int64]:
    """A table in memory of its own, which begins with a cache line that no other thread's table is on."""
    room = np.zeros(len(words) // 8 * 8 + 16, dtype=np.int64)
    first = -(room.ctypes.data // 8) % 8
    table = room[first : first + len(words)]
    for k, value in enumerate(words):
        (table.view(np.float64) if isinstance(value, float) else table)[k] = value
    return table


class Machine(NamedTuple):
    """The code; its functions run without Python's lock."""

    code: Code
    advance: Any
    march: Any
    do: Any
    serve: Any
    turn: Any
    join: Any
    nothing: int  # address


@cache
def machine() -> Machine:
    """The code of this process."""
    kinds = {
        "advance": (WORD, ADDRESS, REAL, REAL),
        "march": (WORD, ADDRESS, ADDRESS, ADDRESS, ADDRESS, ADDRESS, WORD, WORD, WORD, REAL),
        "do": (None, ADDRESS),
        "serve": (None, ADDRESS, WORD),
        "turn": (None, ADDRESS, WORD),
        "join": (None, ADDRESS),
    }
    code = made(_source(), kinds)
    return Machine(code, **code.functions, nothing=code.address("nothing"))
