"""Kernels of a communication step: copy inputs, step components (some in worker threads), append rows.

In Python every array copy and every call take microseconds, a thread starts 60 us late and its end is noticed 20 us
late. These kernels run without Python's lock. Workers poll for their next task; after a millisecond without one they
sleep in the operating system.
"""

from numba.extending import register_jitable

from orchestrator.kernels.intrinsics import (
    atomic_load,
    atomic_store,
    call_do_step,
    call_exchange,
    clock_gettime,
    compare_and_swap,
    load_real,
    load_word,
    memcpy,
    record_at,
    sched_yield,
    sem_post,
    sem_wait,
    store_real,
    store_word,
)
from orchestrator.kernels.tables import (
    ASLEEP,
    ENDED,
    FREE,
    RUNNING,
    SUBMITTED,
    Mailbox,
    RowHead,
    RowTable,
    StepCall,
    StepGroup,
    StepPlan,
    record_type,
)

CALL, MAILBOX, PLAN, GROUP = map(record_type, (StepCall, Mailbox, StepPlan, StepGroup))
ROWS, HEAD = map(record_type, (RowTable, RowHead))
SET_REAL, DO_STEP, GET_REAL = (StepCall._fields.index(name) for name in ("set_real", "do_step", "get_real"))
MONOTONIC, CLOCK = 1, 8 * StepCall._fields.index("clock")  # clock of Linux; where a record holds its time
WARNING = 1  # FMI status; a greater one, or one below 0, is a failure
YIELD = 1023  # polls after which a waiting thread yields the processor; a power of two less one
NO_LIMIT = -1
MEAN = True


# ------------------------------------------------------------------ workers


@register_jitable
def spin(address, state, limit):
    """Wait while the word at an address is ``state``, for at most ``limit`` polls; returns the word."""
    polls = 0
    word = atomic_load(address)
    while word == state and polls != limit:
        polls += 1
        if polls & YIELD == 0:
            sched_yield()
        word = atomic_load(address)
    return word


@register_jitable
def work(address, limit):
    """Worker loop: do the tasks of a mailbox until its state is ENDED; sleep after ``limit`` polls."""
    mailbox = record_at(address, MAILBOX)
    while True:
        state = spin(address, FREE, limit)
        if state == ENDED:
            return 0
        if state == ASLEEP:
            sem_wait(mailbox.bell)
        elif state == FREE:
            compare_and_swap(address, FREE, ASLEEP)
        elif compare_and_swap(address, SUBMITTED, RUNNING) == SUBMITTED:
            step_component(mailbox.task)
            atomic_store(address, FREE)


@register_jitable
def set_state(address, state):
    """Set the state of the mailbox of a worker without a task, and wake the worker."""
    if compare_and_swap(address, FREE, state) == ASLEEP:
        compare_and_swap(address, ASLEEP, state)
        sem_post(record_at(address, MAILBOX).bell)
    return 0


@register_jitable
def submit(address, task):
    """Give a task to a worker that has none."""
    record_at(address, MAILBOX).task = task
    set_state(address, SUBMITTED)


@register_jitable
def wait(address):
    """Wait for a submitted task; do it here if its worker has not begun."""
    if compare_and_swap(address, SUBMITTED, FREE) == SUBMITTED:
        step_component(record_at(address, MAILBOX).task)
    else:
        spin(address, RUNNING, NO_LIMIT)


# ------------------------------------------------------------------ a component


@register_jitable
def seconds(address):
    """Monotonic time of the system, s; written into the record of a component, which only one thread steps."""
    clock_gettime(MONOTONIC, address + CLOCK)
    call = record_at(address, CALL)
    return call.clock + 1e-9 * call.clock_ns


@register_jitable
def step_component(address):
    """Write inputs, step, read outputs and due link outputs; store failure, status and wall time."""
    call = record_at(address, CALL)
    start = seconds(address)
    if call.begin == 0 or call.failed == 0:
        call.failed = call_functions(call)
    call.seconds = seconds(address) - start
    call.total += call.seconds


@register_jitable
def write_inputs(call):
    """Set the inputs of a component; returns the field index of the function if it failed, or 0."""
    if call.u_array != 0:
        memcpy(call.u_array, call.u, 8 * call.n_inputs)
    elif call.n_inputs != 0:
        call.status = call_exchange(call.set_real, call.instance, call.inputs, call.n_inputs, call.u)
        if call.status < 0 or call.status > WARNING:
            return SET_REAL
    return 0


@register_jitable
def begin_elsewhere(call):
    """Write inputs and begin a step in another process, which ``step_component`` then waits for."""
    call.failed = write_inputs(call)
    if call.failed == 0:
        call_do_step(call.begin, call.instance, call.start + call.t, call.h, call.no_rollback)


@register_jitable
def call_functions(call):
    """Call the FMI functions of a step; returns the field index of the one that failed, or 0."""
    if call.begin == 0:
        failed = write_inputs(call)
        if failed != 0:
            return failed
    call.status = call_do_step(call.do_step, call.instance, call.start + call.t, call.h, call.no_rollback)
    if call.status < 0 or call.status > WARNING:
        return DO_STEP
    if call.y_array != 0:
        memcpy(call.y, call.y_array, 8 * call.n_outputs)
    elif read_outputs(call, call.outputs, call.n_outputs, call.y) != 0:
        return GET_REAL
    if call.n_links != 0 and load_word(call.links_due) != 0:
        if read_outputs(call, call.links, call.n_links if call.links_array == 0 else 1, call.y_links) != 0:
            return GET_REAL
        if call.links_array != 0:
            memcpy(call.y_links, call.links_array, 8 * call.n_links)
    return 0


@register_jitable
def read_outputs(call, references, n, values):
    """Get n outputs of a component; returns the field index of the function if it failed, or 0."""
    call.status = call_exchange(call.get_real, call.instance, references, n, values)
    return GET_REAL if call.status < 0 or call.status > WARNING else 0


# ------------------------------------------------------------------ a step


@register_jitable
def copy_inputs(n, to, source, mean):
    """Copy n doubles between addresses in arrays; ``mean``: write the mean of old and copied value."""
    for i in range(n):
        u, value = load_word(to + 8 * i), load_real(load_word(source + 8 * i))
        store_real(u, 0.5 * (load_real(u) + value) if mean else value)


@register_jitable
def step_group(group, plan, t, h):
    """Step the components of a group in parallel; returns the number that failed.

    Other processes step theirs meanwhile. Of those here, the last one steps in this thread, and workers step the others
    if the last step of that one was long.
    """
    for i in range(group.n_calls):
        call = record_at(load_word(group.calls + 8 * i), CALL)
        call.t, call.h = t, h
        if call.begin != 0:
            begin_elsewhere(call)
    last = group.n_here - 1
    long = last > 0 and record_at(load_word(group.calls + 8 * last), CALL).seconds >= plan.worthwhile
    n_submitted = min(last, plan.n_workers) if long else 0
    for i in range(group.n_calls):
        address = load_word(group.calls + 8 * i)
        if i < n_submitted:
            submit(load_word(plan.mailboxes + 8 * i), address)
        else:
            step_component(address)
    failed = 0
    for i in range(group.n_calls):
        if i < n_submitted:
            wait(load_word(plan.mailboxes + 8 * i))
        if record_at(load_word(group.calls + 8 * i), CALL).failed != 0:
            failed += 1
    return failed


@register_jitable
def step_all(address, t, h):
    """Do the step of a plan from t to t + h; returns the number of failed components, 0 if it is complete."""
    plan = record_at(address, PLAN)
    copy_inputs(plan.n_copies, plan.copies_to, plan.copies_from, not MEAN)
    for i in range(plan.n_groups):
        group = record_at(load_word(plan.groups + 8 * i), GROUP)
        copy_inputs(group.n_copies, group.copies_to, group.copies_from, not MEAN)
        copy_inputs(group.n_means, group.means_to, group.means_from, MEAN)
        failed = step_group(group, plan, t, h)
        if failed != 0:
            return failed
    return 0


# ------------------------------------------------------------------ many steps


@register_jitable
def append_row(address):
    """Append a row with the present values of the parts of a table."""
    rows = record_at(address, ROWS)
    end = rows.end
    for i in range(rows.n_parts):
        size = load_word(rows.sizes + 8 * i)
        memcpy(end, load_word(rows.parts + 8 * i), size)
        end += size
    rows.end = end


@register_jitable
def step_many(plan, rows, link_rows, head, due, every, k, n, h):
    """Do the steps k + 1 to k + n of h s; returns the number done before a component failed.

    A row is appended to ``rows`` after each step, and to ``link_rows`` after each step whose number is a multiple of
    ``every``; before such a step the word at ``due`` is set to 1, else to 0. Number and time of the step are written
    into ``head``, which is a part of both tables.
    """
    row_head = record_at(head, HEAD)
    done = 0
    while done < n:
        number = k + done + 1
        links_due = number % every == 0
        store_word(due, int(links_due))
        if step_all(plan, (number - 1) * h, h) != 0:
            break
        row_head.number, row_head.t = number, number * h
        append_row(rows)
        if links_due:
            append_row(link_rows)
        done += 1
    store_word(due, 0)
    return done
