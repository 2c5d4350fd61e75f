"""Kernels of the orchestrator: each intrinsic does what its name says; the object file is whole."""

import subprocess
import sys
import threading
from ctypes import CFUNCTYPE, POINTER, c_double, c_int, c_size_t, c_void_p, cast
from pathlib import Path
from time import monotonic_ns

import numpy as np
import pytest
from numba.extending import register_jitable

from orchestrator.cosim.program import Worker
from orchestrator.kernels import compiled as compiled_module
from orchestrator.kernels import intrinsics
from orchestrator.kernels.compiled import CAN_STEP, KERNELS, REAL, WORD, compiled, kernels
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
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    llvm.initialize_native_asmparser()
    module = compiled(register_jitable(kernel), kinds)
    engine = llvm.create_mcjit_compiler(module, compiled_module._processor())
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


@pytest.mark.parametrize("byte", [0, 3])
def test_words_are_loaded_and_stored_at_any_byte(byte):
    def kernel(source, target):
        value = load_word(source)
        store_word(target, value)
        return value

    content = np.random.default_rng(1).integers(0, 256, 32, dtype=np.uint8)
    out = np.zeros(32, np.uint8)
    value = loaded(kernel, WORD, WORD)(at(content, byte), at(out, byte + 8))
    assert value == int.from_bytes(content[byte : byte + 8].tobytes(), "little", signed=True)
    assert out.tobytes() == bytes(byte + 8) + content[byte : byte + 8].tobytes() + bytes(16 - byte)


def test_doubles_keep_their_bits():
    def kernel(source, target, factor):
        store_real(target, load_real(source))
        store_real(target + 8, load_real(source) * factor)
        return 0

    odd = np.array([0x7FF8DEADBEEF0001, 0x8000000000000000], np.uint64)
    out = np.zeros(3, np.uint64)
    call = loaded(kernel, WORD, WORD, REAL)
    for number in odd:
        call(at(np.array([number])), at(out), 0.5)
        assert out[0] == number
    assert out[2] == 0
    call(at(np.array([3.0])), at(out), 0.5)
    assert out.view(np.float64)[1] == 1.5


def test_an_atomic_word_is_loaded_and_stored():
    def kernel(address, value):
        before = atomic_load(address)
        atomic_store(address, value)
        return before

    word = np.array([1, 2, 3])
    assert loaded(kernel, WORD, WORD)(at(word, 8), -5) == 2
    assert word.tolist() == [1, -5, 3]


def test_a_word_is_swapped_if_it_is_the_expected_one():
    def kernel(address, expected, value):
        return compare_and_swap(address, expected, value)

    word, call = np.array([4]), loaded(kernel, WORD, WORD, WORD)
    assert (call(at(word), 3, 9), word[0]) == (4, 4)
    assert (call(at(word), 4, 9), word[0]) == (4, 9)


def counting_up(atomically):
    """Sum of two threads that each count to 200 000 in the same word."""

    def swapping(address, n):
        for _ in range(n):
            while True:
                count = atomic_load(address)
                if compare_and_swap(address, count, count + 1) == count:
                    break
        return 0

    def storing(address, n):
        for _ in range(n):
            count = atomic_load(address)
            atomic_store(address, count + 1)
        return 0

    word, call = np.zeros(1, np.int64), loaded(swapping if atomically else storing, WORD, WORD)
    threads = [threading.Thread(target=call, args=(at(word), 200_000)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return int(word[0])


def test_a_swap_is_never_lost():
    assert counting_up(atomically=True) == 400_000


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
def test_the_clock_is_that_of_the_system():
    def kernel(address):
        clock_gettime(MONOTONIC, address)
        return 1_000_000_000 * load_word(address) + load_word(address + 8)

    call, time = loaded(kernel, WORD), np.zeros(2, np.int64)
    times = [monotonic_ns(), call(at(time)), monotonic_ns(), call(at(time))]
    assert times == sorted(times)


@needs_linux
def test_bytes_are_copied():
    def kernel(target, source, n):
        memcpy(target, source, n)
        return 0

    content, out = np.arange(40, dtype=np.uint8), np.zeros(40, np.uint8)
    loaded(kernel, WORD, WORD, WORD)(at(out, 1), at(content, 2), 21)
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

    def exchanging(function, values):
        return call_exchange(function, 2**40 + 1, 2**41, 2, values)

    def stepping(function, t, h, no_rollback):
        return call_do_step(function, 2**40 + 1, t, h, no_rollback)

    assert loaded(exchanging, WORD, WORD)(exchange_at, at(u)) == -7
    assert u.tolist() == [0.5, 8.0]
    assert loaded(stepping, WORD, REAL, REAL, WORD)(step_at, 0.1, 1e-3, 1) == 3
    assert called == [(2**40 + 1, 2**41, 2, 0.5, 0.25), (2**40 + 1, 0.1, 1e-3, 1)]


def test_every_intrinsic_is_tested_here():
    here = Path(__file__).read_text().partition("HEAD =")[0]
    source = Path(intrinsics.__file__).read_text()
    public = {line.removeprefix("def ").partition("(")[0] for line in source.splitlines() if line.startswith("def ")}
    assert {name for name in public if not name.startswith("_")} <= set(here.replace(",", "").split())


# ------------------------------------------------------------------ tables


def test_a_table_has_a_cache_line_of_its_own():
    tables = [record(StepCall(*range(1, 15))) for _ in range(5)]
    begins = sorted(table.ctypes.data // (8 * CACHE_LINE) for table in tables)
    assert min(np.diff(begins)) >= np.ceil(len(StepCall._fields) / CACHE_LINE)
    for table in tables:
        assert table.ctypes.data % (8 * CACHE_LINE) == 0
        assert StepCall(*table[0].item()) == StepCall(*range(1, 15))
    assert record_type(StepCall).itemsize == 8 * len(StepCall._fields)


# ------------------------------------------------------------------ the object file


def test_a_kernel_that_needs_python_is_refused():
    def printing(n):
        print(n)
        return n

    with pytest.raises(TypeError, match="the kernel printing needs numba_gil_ensure"):
        loaded(printing, WORD)


def test_an_exception_in_a_kernel_is_heard():
    def raising(n):
        if n > 3:
            raise ValueError("too many")
        return n

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
        assert compiled_module._cached("key", make) == b"an object file"
        assert len(made) == known


def test_an_edit_of_any_source_is_another_object_file(tmp_path, monkeypatch):
    folder = Path(compiled_module.__file__).parent
    for source in folder.glob("*.py"):
        (tmp_path / source.name).write_text(source.read_text())
    monkeypatch.setattr(compiled_module, "__file__", str(tmp_path / "compiled.py"))
    keys = {compiled_module._key()}
    for source in sorted(tmp_path.glob("*.py")):
        source.write_text(source.read_text() + "# edited\n")
        keys.add(compiled_module._key())
    assert len(keys) == 1 + len([*folder.glob("*.py")]) >= 6


def test_all_kernels_are_there():
    assert {name for each in KERNELS.values() for name in each} <= set(vars(kernels()))
