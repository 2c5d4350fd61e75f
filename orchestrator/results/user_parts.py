"""FMUs of the user that ran in place of parts, or in a free system, by the log of their run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from orchestrator.results.run_data import RunData

SHOWN = 12  # digits of a hash in a line of text


class GivenPart(NamedTuple):
    """FMU of the user."""

    file: str  # its name, without folder
    sha256: str  # of its content
    parameters: Mapping[str, Any]  # that it was given, those of the scene among them

    def __str__(self) -> str:
        return f"{self.file} (sha256 {self.sha256[:SHOWN]})"


def given_parts(run: RunData) -> dict[str, GivenPart]:
    """FMUs of the user by component; raises LogUnreadable, NoSuchSignal."""
    return {
        instance["name"]: GivenPart(
            instance.get("fmu") or "", instance.get("sha256") or "", instance.get("parameters", {})
        )
        for instance in run.system["instances"]
        if instance["name"] in run.given
    }


def part_differences(run: RunData, reference: RunData) -> list[str]:
    """Sentences on parts that are another FMU in one of two runs of a scene, or have other parameters there."""
    pair = given_parts(run), given_parts(reference)
    hashes = [{each["name"]: each.get("sha256") for each in data.system["instances"]} for data in (run, reference)]
    sentences = []
    for name in dict.fromkeys([*pair[0], *pair[1]]):
        first, second = (parts.get(name) for parts in pair)
        if hashes[0].get(name) != hashes[1].get(name):
            files = (str(part) if part else "the part of cotrack" for part in (first, second))
            sentences.append(f"{name} is {' and '.join(files)}")
        elif first and second:
            for key in sorted(first.parameters.keys() | second.parameters.keys()):
                a, b = (part.parameters.get(key, "not given") for part in (first, second))
                sentences += [f"{name}: {key} = {a} and {b}"] if a != b else []
    return sentences
