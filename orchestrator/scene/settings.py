"""Settings ``KEY=VALUE`` with dotted keys, applied to the tables of a file; all keys of a table; values as TOML."""

from __future__ import annotations

import hashlib
import json
import re
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import cache
from textwrap import shorten
from typing import Any

from pydantic import BaseModel

from fmus.vehicles.tables import BadInput

Schema = dict[str, Any]  # JSON schema
CHOSEN = "NAME"  # in place of a part of a key that a file chooses: the names of checks, of parts with an FMU
NAMED = "expect.", "fmu."  # tables whose tables have such names
MAX_NAME = 80  # characters of settings in the name of a file


def setting(text: str) -> tuple[str, Any]:
    """Parse ``key=value``: dotted key and TOML value, or a string where that fails (``2 ms``)."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise BadInput(f"setting {text}: is not valid UTF-8") from None
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise BadInput(f"setting {text}: must be KEY=VALUE")
    try:
        parsed = tomllib.loads(f"value = {value}")
    except (ValueError, RecursionError):
        parsed = {}
    return key.strip(), parsed["value"] if len(parsed) == 1 else value.strip()


def pairs(settings: Sequence[str] | Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Keys and values of ``KEY=VALUE`` texts or of a table with dotted keys, whose values may be of numpy."""
    if isinstance(settings, Mapping):
        return [(key, getattr(value, "tolist", lambda value=value: value)()) for key, value in settings.items()]
    return [setting(text) for text in settings]


def file_part(settings: Mapping[str, Any]) -> str:
    """Settings in a file's name, ``-run.stop=3s``; a digest ends them if they are long or need other characters."""
    texts = (f"-{key}={v if isinstance(v, str) else toml_text(v)}" for key, v in sorted(settings.items()))
    text = re.sub(r"(?<=\d) (?=[^\W\d])", "", "".join(texts))  # of "3 s"
    plain = re.sub(r"[^\w.=+%,-]", "_", text, flags=re.ASCII)[:MAX_NAME]
    digest = hashlib.sha256(text.encode(errors="backslashreplace")).hexdigest()
    return plain if plain == text else f"{plain}-{digest[:8]}"


def parts_of(key: str) -> list[str]:
    """Parts of a dotted key; entries of lists are counted from 1 in brackets, ``x[1]``, or from 0 without, ``x.0``."""
    return re.sub(r"\[([1-9][0-9]{0,8})\]", lambda place: f".{int(place[1]) - 1}", key).split(".")


def set_key(table: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key, as of ``parts_of``."""
    *path, last = parts_of(key)
    place: Any = table
    for part in path:
        place = place[_index(place, part, key)] if isinstance(place, list) else place.setdefault(part, {})
        if not isinstance(place, dict | list):
            raise BadInput(f"unknown key '{key}': '{part}' is a value, not a table")
    place[_index(place, last, key) if isinstance(place, list) else last] = value


def _index(place: list[Any], part: str, key: str) -> int:
    if not part.isdecimal() or len(part) > 9 or int(part) >= len(place):
        raise BadInput(f"unknown key '{key}': the list has entries [1] to [{len(place)}]")
    return int(part)


def merge_tables(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Merge ``above`` over ``below``, table by table."""
    result = dict(below)
    for key, value in above.items():
        are_tables = isinstance(value, Mapping) and isinstance(result.get(key), Mapping)
        result[key] = merge_tables(result[key], value) if are_tables else value
    return result


def entries(table: Schema, tables: Schema, above: str = "") -> Iterator[tuple[str, Schema, bool]]:
    """Dotted keys of a JSON schema of a table, their schemas, and whether the table needs them.

    CHOSEN stands for a name that the file gives; ``tables``: the schema's definitions; ``above``: prefix of the keys.
    """
    named = {CHOSEN: more} if (more := table.get("additionalProperties")) else {}
    for name, entry in {**table.get("properties", {}), **named}.items():
        yield f"{above}{name}", entry, name in table.get("required", ())
        for part in (entry, *entry.get("anyOf", ())):
            inner = tables[part["$ref"].rpartition("/")[2]] if "$ref" in part else part
            if inner.get("type") == "object":
                yield from entries(inner, tables, f"{above}{name}.")


@cache
def keys(model: type[BaseModel]) -> tuple[str, ...]:
    """All dotted keys of a model."""
    schema = model.model_json_schema()
    return tuple(key for key, *_ in entries(schema, schema["$defs"]))


def hint(name: str, known: Collection[str], introduction: str) -> str:
    """Suggestion for an unknown name: the nearest known one, or all of them."""
    near = get_close_matches(name, known, n=1)
    return (
        f"did you mean '{near[0]}'?" if near else f"{introduction} {shorten(', '.join(known), 250, placeholder=' ...')}"
    )


def near_keys(key: str, known: Iterable[str]) -> list[str]:
    """Known keys that an unknown one may mean: a similar one of its table, else all of its name, else a similar one."""
    table, _, name = key.rpartition(".")
    if (wheel := WHEELS.get(name, f"wheel.{name}" * name.endswith("_idler"))) and table in ("", "vehicle"):
        return [f"vehicle.{wheel}"]
    named = [one.replace(CHOSEN, key.split(".")[1]) if key.startswith(NAMED) else one for one in known]
    siblings = [one.rpartition(".")[2] for one in named if one.rpartition(".")[0] == table]
    if near := get_close_matches(name, siblings, 1):
        return [f"{table}.{near[0]}".lstrip(".")]
    return [one for one in named if one.rpartition(".")[2] == name] or get_close_matches(key, named, 1)


# Tables of wheels by other names that makers give them.
WHEELS = dict.fromkeys(("track_roller", "bottom_roller", "lower_roller", "bogie_wheel", "roadwheel"), "road_wheel")
WHEELS |= dict.fromkeys(("carrier_roller", "top_roller", "upper_roller", "support_roller"), "return_roller")
# Quantities that are no keys, by the words of their names, and what decides them.
DERIVED = {
    "sprocket pitch radius diameter": "vehicle.sprocket.teeth, vehicle.track.pitch: pitch / (2 sin(pi / pins a turn))",
    "track chain length": "vehicle.track.links x vehicle.track.pitch",
    "vehicle total mass weight": "the keys mass of vehicle.chassis, vehicle.track and all other parts",
    "vehicle tread gauge": "2 x vehicle.track.lateral",
    "ground clearance": "vehicle.chassis.hull, road_wheel.z, road_wheel.radius and track.face",
    "road wheel idler roller diameter": "twice the radius of the wheel",
}


def derived(name: str) -> str:
    """Keys that decide a quantity that is no key; empty where its name is not that of one."""
    words = {*re.findall(r"[a-z]+", name.lower())}
    found = [each for each in DERIVED if words and words <= {"vehicle", *each.split()}]
    return f"it follows from {DERIVED[found[0]]}" if found else ""


def toml_text(value: Any) -> str:
    """Text of a number, a text, a list or a table, which becomes an inline table."""
    if isinstance(value, dict):
        entries = [f"{_key(key)} = {toml_text(entry)}" for key, entry in value.items()]
        return f"{{ {', '.join(entries)} }}" if entries else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_text, value))}]"
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False)


def _key(key: str) -> str:
    return key if re.fullmatch(r"[\w-]+", key, re.ASCII) else json.dumps(key, ensure_ascii=False)
