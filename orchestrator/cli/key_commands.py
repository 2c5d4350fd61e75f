"""Commands for own scenes and vehicles: keys and their meanings, schemas for editors, commented files."""

from __future__ import annotations

import json
from enum import StrEnum
from typing import Annotated

import typer

from fmus.vehicle import BadInput, value_text

FileKind = StrEnum("FileKind", ["scene", "vehicle"])
Kind = Annotated[FileKind, typer.Argument(metavar="scene|vehicle", help="kind of file")]


def keys(
    word: Annotated[str, typer.Argument(metavar="[WORD]", help="only keys with this in key or meaning")] = "",
    markdown: Annotated[bool, typer.Option("--markdown", help="as a page in Markdown, orchestrator/keys.md")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="the last line on stdout is one JSON object")] = False,
) -> None:
    """Print the keys of scenes and vehicles, and the measures of checks: unit, allowed values, default, meaning.

    A vehicle file has the keys that begin with "vehicle." without that.
    """
    from orchestrator.scene import keys as module

    chosen, measured = (
        [key for key in known if word.lower() in f"{key.key}\n{key.meaning}".lower()]
        for known in (module.scene_keys(), module.measure_keys())
    )
    if not chosen and not measured:
        raise BadInput(f"no key and no measure has {value_text(word)} in its name or meaning")
    if as_json:
        print(json.dumps({"keys": [key._asdict() for key in chosen], "measures": [key._asdict() for key in measured]}))
    elif markdown:
        print(module.page(chosen, measured))
    else:
        for text in map(module.key_text, (*chosen, *measured)):
            print(text)


def schema(kind: Kind) -> None:
    """Print the JSON schema of a scene or vehicle file, with which editors complete and check TOML."""
    from orchestrator.scene import toml_schema

    print(json.dumps(toml_schema.SCHEMAS[kind](), indent=1))


def new(
    kind: Kind,
    name: Annotated[str, typer.Argument(metavar="NAME", help="the file is NAME.toml in the current folder")],
    source: Annotated[
        str | None,
        typer.Option("--from", metavar="NAME", help="scene or vehicle, or its file; default straight, m113"),
    ] = None,
) -> None:
    """Write a commented scene or vehicle file: what the source sets, and as comments all else that may be set."""
    from orchestrator.scene import commented

    print(commented.new_file(kind, name, source))
