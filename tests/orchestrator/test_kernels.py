"""Kernels of the orchestrator: each intrinsic does what its name says; the object file is whole."""

import subprocess
import sys
import threading
from ctypes import CFUNCTYPE, POINTER, c_double, c_int, c_size_t, c_void_p, cast
from pathlib import Path
from time import monotonic_ns

import llvmlite.binding as llvm
import numpy as np
import pytest
from numba.extending import register_jitable

from orchestrator.cosim.program import Worker
from orchestrator.execution.prepared_run import warm_up
from orchestrator.kernels import compiled as compiled_module
from orchestrator.kernels.compiled import CAN_STEP, REAL, WORD, compiled
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
from orchestrator.kernels.stepping import MONOTONIC
from orchestrator.kernels.tables import CACHE_LINE, RowHead, StepCall, record, record_type

HEAD = record_type(RowHead)
needs_linux = pytest.mark.skipif(not CAN_STEP, reason="a system call of Linux on x86-64")


def loaded(kernel, *kinds):
    """A function of intrinsics, compiled as kernels are; it keeps the engine alive."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    llvm.initialize_native_asmparser()
    module = compiled(register_jitable(kernel), kinds)
    engine = llvm.create_mcjit_compiler(module, compiled_module.processor())
    engine.finalize_object()
    name = kernel.__name__
    call = compiled_module.function(name, engine.get_function_address(name), kinds)
    call.engine = engine
    return call


def at(array, byte=0):
    return array.ctypes.data + byte


def test_a_record_is_read_and_written_where_it_lies():
    def kernel(address):
        head = record_at(address, HEAD)
        head.t = head.h + 0.5
        head.ns += 1
        return head.number

    head = record(RowHead(7, 2**62, 0.0, 0.25))
    assert loaded(kernel, WORD)(at(head)) == 7
    assert head[0].item() == (7, 2**62 + 1, 0.75, 0.25)


def test_words_and_doubles_keep_their_bits_at_any_byte():
    def kernel(source, target, byte, factor):
        store_word(target, load_word(source + byte))
        store_real(target + 8 + byte, load_real(source + byte))
        store_real(target + 24, load_real(source + 16) * factor)
        return load_word(source)

    content = np.random.default_rng(1).integers(0, 256, 32, dtype=np.uint8)
    content[16:24] = np.array([3.0]).view(np.uint8)
    call = loaded(kernel, WORD, WORD, WORD, REAL)
    for byte, first in ((0, 0x7FF8DEADBEEF0001), (3, 0x7FF8DEADBEEF0001), (0, 1 << 63), (3, -1 & (1 << 63) - 1)):
        content[:8], out = np.array([first], np.uint64).view(np.uint8), np.zeros(32, np.uint8)
        assert call(at(content), at(out), byte, 0.5) == int(np.array([first], np.uint64).view(np.int64)[0])
        bits = content[byte : byte + 8].tobytes()
        assert out.tobytes() == bits + bytes(byte) + bits + bytes(8 - byte) + np.array([1.5]).tobytes()


def test_an_atomic_word_is_loaded_stored_and_swapped_if_it_is_the_expected_one():
    def kernel(address, expected, value):
        before = atomic_load(address)
        atomic_store(address, before + 1)
        return compare_and_swap(address, expected, value)

    word, call = np.array([1, 2, 3]), loaded(kernel, WORD, WORD, WORD)
    assert (call(at(word, 8), 3, -9), word.tolist()) == (3, [1, -9, 3])
    assert (call(at(word, 8), 3, 7), word.tolist()) == (-8, [1, -8, 3])


def test_a_swap_is_never_lost():
    """Two threads each count to 200,000 in the same word."""

    def swapping(address, n):
        for _ in range(n):
            while True:
                count = atomic_load(address)
                if compare_and_swap(address, count, count + 1) == count:
                    break
        return 0

    word, call = np.zeros(1, np.int64), loaded(swapping, WORD, WORD)
    threads = [threading.Thread(target=call, args=(at(word), 200_000)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert word[0] == 400_000


@needs_linux
def test_others_run_while_a_kernel_waits():
    """Other threads run while a kernel waits: it holds no lock of Python and yields the processor."""

    def kernel(address, begun):
        looks = 0
        while atomic_load(address) == 0:
            sched_yield()
            looks += 1
            atomic_store(begun, 1)
        return looks

    word, begun, call, look_counts = np.zeros(1, np.int64), np.zeros(1, np.int64), loaded(kernel, WORD, WORD), []
    thread = threading.Thread(target=lambda: look_counts.append(call(at(word), at(begun))))
    thread.start()
    while not begun[0]:
        pass
    word[0] = 1
    thread.join()
    assert look_counts[0] > 0


@needs_linux
def test_a_thread_sleeps_until_it_is_woken():
    def sleeper(bell):
        sem_wait(bell)
        return 1

    def waker(bell):
        sem_post(bell)
        return 0

    worker = Worker()
    bell = int(worker.mailbox["bell"][0])
    worker.close()
    sleep, wake, awake = loaded(sleeper, WORD), loaded(waker, WORD), threading.Event()
    thread = threading.Thread(target=lambda: sleep(bell) and awake.set())
    thread.start()
    assert not awake.wait(0.05)
    wake(bell)
    assert awake.wait(60.0)
    thread.join()
    wake(bell)
    assert sleep(bell) == 1, "a bell that rang before is heard"


@needs_linux
def test_the_clock_is_that_of_the_system_and_bytes_are_copied():
    def kernel(address, target, source, n):
        memcpy(target, source, n)
        clock_gettime(MONOTONIC, address)
        return 1_000_000_000 * load_word(address) + load_word(address + 8)

    call, time = loaded(kernel, WORD, WORD, WORD, WORD), np.zeros(2, np.int64)
    content, out = np.arange(40, dtype=np.uint8), np.zeros(40, np.uint8)
    arguments = at(time), at(out, 1), at(content, 2), 21
    times = [monotonic_ns(), call(*arguments), monotonic_ns(), call(*arguments)]
    assert times == sorted(times)
    assert out.tolist() == [0, *range(2, 23), *[0] * 18]


def test_functions_of_fmi_are_called_by_address():
    """FMI functions are called by address, with arguments beyond 32 bits and with negative status."""
    called, u = [], np.array([0.5, 0.25])

    def exchange(instance, references, n, values):
        called.append((instance, references, n, values[0], values[1]))
        values[1] = 8.0
        return -7

    def do_step(*given):
        called.append(given)
        return 3

    keep = (
        CFUNCTYPE(c_int, c_void_p, c_void_p, c_size_t, POINTER(c_double))(exchange),
        CFUNCTYPE(c_int, c_void_p, c_double, c_double, c_int)(do_step),
    )
    exchange_at, step_at = (cast(each, c_void_p).value for each in keep)

    def calling(exchange, step, values, t, h, no_rollback):
        return 100 * call_exchange(exchange, 2**40 + 1, 2**41, 2, values) + call_do_step(
            step, 2**40 + 1, t, h, no_rollback
        )

    assert loaded(calling, WORD, WORD, WORD, REAL, REAL, WORD)(exchange_at, step_at, at(u), 0.1, 1e-3, 1) == -697
    assert u.tolist() == [0.5, 8.0]
    assert called == [(2**40 + 1, 2**41, 2, 0.5, 0.25), (2**40 + 1, 0.1, 1e-3, 1)]


def test_a_table_has_a_cache_line_of_its_own():
    tables = [record(StepCall(*range(1, 15))) for _ in range(5)]
    begins = sorted(table.ctypes.data // (8 * CACHE_LINE) for table in tables)
    assert min(np.diff(begins)) >= np.ceil(len(StepCall._fields) / CACHE_LINE)
    for table in tables:
        assert table.ctypes.data % (8 * CACHE_LINE) == 0
        assert StepCall(*table[0].item()) == StepCall(*range(1, 15))
    assert record_type(StepCall).itemsize == 8 * len(StepCall._fields)


# ------------------------------------------------------------------ the object file


def test_a_kernel_that_needs_python_is_refused_and_an_exception_in_one_is_heard():
    def printing(n):
        print(n)
        return n

    def raising(n):
        if n > 3:
            raise ValueError("too many")
        return n

    with pytest.raises(TypeError, match="the kernel printing needs numba_gil_ensure"):
        loaded(printing, WORD)
    call = loaded(raising, WORD)
    assert call(3) == 3
    with pytest.raises(RuntimeError, match="the kernel raising raised an exception"):
        call(4)


LOADED = """
import sys
from orchestrator.kernels.compiled import kernels
kernels()
print("numba" in sys.modules)
"""


@pytest.mark.long
def test_a_process_that_finds_the_object_file_imports_no_numba(environment, tmp_path):
    env = {**environment, "COTRACK_CACHE": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "1"}

    def compiles():
        command = [sys.executable, "-c", LOADED]
        return subprocess.run(command, env=env, capture_output=True, text=True, check=True).stdout.strip() == "True"

    assert [compiles(), compiles()] == [True, False]


def test_a_damaged_object_file_is_made_again(fresh_cache):
    made = []

    def make():
        made.append(True)
        return b"an object file"

    for known in (1, 1, 2, 2):
        if known > len(made) > 0:
            (file,) = (fresh_cache / "kernels" / "orchestrator").iterdir()
            file.write_bytes(file.read_bytes().replace(b"object", b"subject"))
        assert compiled_module.cached("key", make) == b"an object file"
        assert len(made) == known


def test_an_edit_of_any_source_is_another_object_file(tmp_path, monkeypatch):
    sources = sorted(Path(compiled_module.__file__).parent.glob("*.py"))
    for source in sources:
        (tmp_path / source.name).write_text(source.read_text())
    monkeypatch.setattr(compiled_module, "__file__", str(tmp_path / "compiled.py"))
    keys = {compiled_module.cache_key()}
    for source in sources:
        with (tmp_path / source.name).open("a") as file:
            file.write("# edited\n")
        keys.add(compiled_module.cache_key())
    assert len(keys) == 1 + len(sources) >= 6


def test_loading_them_counts_as_start_up():
    compiled_module.kernels.cache_clear()
    warm_up((), 1e-3)
    assert compiled_module.kernels.cache_info().currsize == 1
