"""Data of a shape of a component for the shell: ``model.h``."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence

from fmus.fmi.phases import ALLOWED, ALLOWED_FMI3, JUMP, LATE, LENGTHS, ROUNDING, SHORT, InstancePhase, not_allowed
from fmus.interface.ports import Port, enumeration_value
from fmus.interface.sentences import GAPS, Sentence
from fmus.native.fmi3_description import ArrayVariable
from fmus.native.numbers_file import FILE, MAGIC, VERSION, longest


def quoted(texts: Iterable[str]) -> str:
    """C string literals, separated by commas; JSON escapes ASCII as C does."""
    return ", ".join(json.dumps(text) for text in texts)


def header(
    variables: Sequence[Port],
    link_ports: int,
    sizes: Mapping[str, int],
    indices: Sequence[tuple[int, int]],
    sentences: Mapping[str, Sequence[Sentence]],
    arrays: Sequence[ArrayVariable] | None = None,
) -> str:
    """Text of ``model.h`` without the digest of the shape, for FMI 3.0 if ``arrays`` are given, else for FMI 2.0.

    ``sizes``: lengths of the blocks x, n, f, k, z; ``indices``: see ``interface.model.ComponentModel``; ``sentences``:
    tables of texts by name.
    """
    reals = [port for port in variables if isinstance(port.start, float)]
    inputs = sum(port.causality == "input" for port in reals)
    outputs = sum(port.causality == "output" for port in reals) - link_ports
    parameters, strings = reals[inputs + outputs + link_ports :], [p for p in variables if isinstance(p.start, str)]
    warnings = sentences["WARNING"]
    numbers = {
        "INPUT": inputs, "OUTPUT": outputs, "LINK": link_ports, "REAL": len(reals), "VARIABLE": len(variables),
        "PARAMETER": len(parameters), "STRING": len(strings),
        "STATE": sizes["x"], "COUNTER": sizes["n"], "F": sizes["f"], "K": sizes["k"], "Z": sizes["z"],
        "LONGEST_NUMBERS": longest(sizes, len(reals), len(strings)), "INDEX": len(indices),
        "WARNING": len(warnings), "MESSAGES": (1 + len(warnings)) * (GAPS + 1),
    }  # fmt: skip
    checks = [f"{{ {place}, {count} }}, " for place, count in indices]
    lines = [
        f"#define LINKS {int(link_ports > 0)}",
        f"enum {{ {', '.join(f'N_{name} = {value}' for name, value in numbers.items())}, MESSAGE_SIZE = {GAPS + 1} }};",
        f"#define NUMBERS_FILE {json.dumps(FILE)}",
        f"#define NUMBERS_MAGIC {json.dumps(MAGIC.decode())}",
        f"enum {{ NUMBERS_VERSION = {VERSION} }};",
        f"static const char *const NAME[] = {{ {quoted(port.name for port in variables)} }};",
        f"static const double SHARE[] = {{ {', '.join([*(_share(port) for port in reals[:inputs]), '0.0'])} }};",
        f"static const Range RANGE[] = {{ {', '.join([*map(_range, parameters), '{ 0, 0, 0, 0 }'])} }};",
        f"static const Index INDEX[] = {{ {''.join(checks)}{{ 0, 0 }} }};",
        *_choices(strings),
        *_phases(ALLOWED if arrays is None else ALLOWED_FMI3),
        *([] if arrays is None else _arrays(arrays)),
        *(line for table, rows in sentences.items() for line in _sentences(table, rows)),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _range(port: Port) -> str:
    """Initialiser of a Real parameter's Range: whether it is free, its bounds and their text."""
    bounds = (
        f"{'-' if bound < 0.0 else ''}INFINITY" if math.isinf(bound) else bound.hex() for bound in port.allowed[:2]
    )
    return f"{{ {int(port.causality == 'parameter')}, {', '.join(bounds)}, {json.dumps(port.allowed.text)} }}"


def _share(port: Port) -> str:
    """Share of a step over which the derivative of an input acts on its value for the step.

    A mean wrench is the mean of the step before, so that of the next one is a whole step later; the mean of a value of
    the beginning half a step. The derivatives of positions and orientations are inputs themselves.
    """
    if ".position." in port.name or ".orientation." in port.name:
        return "0.0"
    return "1.0" if "mean over the step" in port.text else "0.5"


def _arrays(arrays: Sequence[ArrayVariable]) -> list[str]:
    """Table of the Float64 variables, by value reference: first Real and number of Reals."""
    rows = "".join(f"{{ {array.first}, {len(array.elements)} }}, " for array in arrays)
    return [f"enum {{ N_ARRAY = {len(arrays)} }};", f"static const Array ARRAY[] = {{ {rows}{{ 0, 0 }} }};"]


def _phases(allowed: Mapping[str, Sequence[InstancePhase]]) -> list[str]:
    """Phases, and the calls with their sentence for each phase that does not allow them, see ``fmus.fmi.phases``."""
    rows = (quoted(not_allowed(call, phase) for phase in InstancePhase) for call in allowed)
    refusals = (f"{{ {row.replace(json.dumps(''), '0')} }}" for row in rows)
    return [
        f"enum {{ {', '.join(phase.name for phase in InstancePhase)} }};",
        f"enum {{ {', '.join(f'CALL_{call}' for call in allowed)} }};",
        f"static const char *const NOT_ALLOWED[][{len(InstancePhase)}] = {{ {', '.join(refusals)} }};",
        f"static const double LENGTHS[] = {{ {LENGTHS[0].hex()}, {LENGTHS[1].hex()} }}, ROUNDING = {ROUNDING.hex()};",
        *_sentences("STEP_REFUSED", (SHORT, JUMP, LATE)),
    ]


def _choices(strings: Sequence[Port]) -> list[str]:
    """Tables of the String parameters: their choices, or the one of a constant; others are in the file of numbers."""
    lines, rows = [], ["{ 0, 0, 0, 0 }"]
    for i, port in reversed(list(enumerate(strings))):
        free = port.causality == "parameter"
        if not port.choices:
            rows.insert(0, rows[-1])
            continue
        known = port.choices if free else (str(port.start),)
        lines.append(f"static const char *const CHOICE_{i}[] = {{ {quoted(known)} }};")
        first = 1 if free else enumeration_value(port)
        rows.insert(0, f"{{ {int(free)}, {len(known)}, {first}, CHOICE_{i} }}")
    return [*lines, f"static const Choice CHOICE[] = {{ {', '.join(rows)} }};"]


def _sentences(table: str, sentences: Sequence[Sentence]) -> list[str]:
    lines = [
        f"static const char *const {table}_{i}[] = {{ {quoted(sentence.names)} }};"
        for i, sentence in enumerate(sentences)
        if sentence.names
    ]
    entries = [
        f"{{ {json.dumps(sentence.text)}, {f'{table}_{i}' if sentence.names else 0} }}"
        for i, sentence in enumerate(sentences)
    ]
    return [*lines, f"static const Sentence {table}[] = {{ {', '.join(entries or ['{ 0, 0 }'])} }};"]
