"""Keys of scene files and vehicle files with unit, allowed values, default and meaning.

They are read from the JSON schemas of the files, with which editors complete and check TOML.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

from pydantic.json_schema import GenerateJsonSchema, models_json_schema

from fmus.precompile import component_ports
from fmus.track.choices import TRACKS
from fmus.vehicles.ranges import VEHICLE, PlausibleRange
from fmus.vehicles.tables import allowed, units
from fmus.vehicles.vehicle import VehicleTable
from orchestrator.scene.assembly import assemble
from orchestrator.scene.data_files import UNITS
from orchestrator.scene.drive_tables import DriverTable, DriveTable
from orchestrator.scene.kinds import Scene
from orchestrator.scene.scene import SCENE_KINDS, load
from orchestrator.scene.settings import Schema, entries, toml_text
from orchestrator.scene.track_table import TrackModelTable
from orchestrator.scene.values import SCENE_RANGES, ParameterTable


class TomlSchema(GenerateJsonSchema):
    """JSON schema without null, which TOML lacks, without tables as defaults, without titles that repeat keys."""

    def nullable_schema(self, schema: Any) -> Schema:
        """Alternatives without null."""
        return {"anyOf": [self.generate_inner(schema["schema"])]}

    def default_schema(self, schema: Any) -> Schema:
        """Schema of a key with the default that a file may give."""
        made = super().default_schema(schema)
        return {key: value for key, value in made.items() if key != "default" or not isinstance(value, dict | None)}

    def field_title_should_be_set(self, schema: Any) -> bool:
        """False for all keys."""
        return False


def vehicle_schema() -> Schema:
    """JSON schema of a vehicle file."""
    schema = VehicleTable.model_json_schema(schema_generator=TomlSchema)
    _add_ranges(schema, schema["$defs"], VEHICLE)
    return {"$schema": TomlSchema.schema_dialect, **schema, "title": "vehicle"}


@cache
def scene_schema() -> Schema:
    """JSON schema of a scene file: any of the kinds of scenes, each is a definition.

    Not checked are texts with units against ranges, what relates keys to each other, and missing keys of a vehicle.
    """
    places, schema = models_json_schema(
        [(kind, "validation") for kind in SCENE_KINDS.values()], schema_generator=TomlSchema
    )
    tables, vehicle = schema["$defs"], vehicle_schema()
    base = {"type": "string", "description": "vehicle, a name or a TOML file, that has all keys that are not given"}
    tables["VehicleTable"]["properties"] = {"base": base, **vehicle["properties"]}
    tables |= vehicle["$defs"]
    for name in ("VehicleTable", *vehicle["$defs"]):
        tables[name].pop("required", None)  # the base may have the key
    tables["SoilTable"].pop("required")  # the named soil may have it
    for table in tables.values():
        for key in {*UNITS} & {*table["properties"]}:
            table["properties"][key]["anyOf"].append({"type": "string"})  # the name of a CSV file
    heights = tables["HeightMapTable"]["properties"]["heights"]
    described = {key: heights.pop(key) for key in ("description",) if key in heights}
    tables["HeightMapTable"]["properties"]["heights"] = {**described, "anyOf": [heights, {"type": "string"}]}
    tables["HeightMapTable"]["required"] = ["heights"]  # the file may have its places
    for table in (tables[kind.__name__] for kind in SCENE_KINDS.values()):
        table["required"].remove("name")
        if whole := table["properties"].get("vehicle"):
            whole["anyOf"] = [{"type": "string"}, {"$ref": whole.pop("$ref")}]
        _add_ranges(table, tables, SCENE_RANGES)
    return {
        "$schema": TomlSchema.schema_dialect,
        "title": "scene",
        "anyOf": [places[kind, "validation"] for kind in SCENE_KINDS.values()],
        "$defs": tables,
    }


SCHEMAS: dict[str, Callable[[], Schema]] = {"scene": scene_schema, "vehicle": vehicle_schema}


def _add_ranges(table: Schema, tables: Schema, ranges: Iterable[PlausibleRange]) -> None:
    """Bound the numbers of a table by the values that are possible."""
    known = {key: entry for key, entry, _ in entries(table, tables)}
    for key, possible in ((one.key, one.possible) for one in ranges if one.key in known):
        for number in numbers(known[key]):
            number["maximum"] = min(possible[1], number.get("maximum", possible[1]))
            if possible[0] > number.get("exclusiveMinimum", -float("inf")):
                number.pop("exclusiveMinimum", None)
                number["minimum"] = max(possible[0], number.get("minimum", possible[0]))


def numbers(entry: Schema) -> Iterator[Schema]:
    """Schemas of numbers among the alternatives of a key."""
    if entry.get("type") == "number":
        yield entry
    for part in entry.get("anyOf", ()):
        yield from numbers(part)


REQUIRED = "required"
SYMBOLS = {"minimum": ">= {:g}", "exclusiveMinimum": "> {:g}", "maximum": "<= {:g}", "exclusiveMaximum": "< {:g}"}
OVERRIDES = "drive.left.", "drive.right."  # without them the keys of [drive] count
COMPONENTS: dict[str, tuple[type[ParameterTable], Sequence[str]]] = {  # tables of components, and kinds of these
    "track": (TrackModelTable, [kind.fmu for kind in TRACKS.values()]),
    "drive": (DriveTable, ["SprocketDrive"]),
    "idler_drive": (DriveTable, ["SprocketDrive"]),
    "driver": (DriverTable, ["Driver"]),
}


class Key(NamedTuple):
    """Key of a file, or a measure."""

    key: str  # dotted
    unit: str  # "1": a ratio; empty: no quantity
    allowed: str
    default: str  # TOML text; empty: without it nothing, or what the meaning says
    meaning: str
    assembly: str = ""  # kinds of scenes that have the key; empty: all
    solved: bool = False  # a run solves for it


def scene_keys() -> list[Key]:
    """All keys of scene files, table by table, those of the whole vehicle included."""
    schema = scene_schema()
    found: dict[str, dict[str, Key]] = {}
    for assembly, kind in SCENE_KINDS.items():
        for key, entry, required in entries(schema["$defs"][kind.__name__], schema["$defs"]):
            if not key.startswith("vehicle.") or key == "vehicle.base":
                found.setdefault(key, {})[assembly] = _key(key, entry, required)
    return _by_table([_merged(kinds) for kinds in found.values()]) + vehicle_keys("vehicle.")


def vehicle_keys(above: str = "") -> list[Key]:
    """All keys of vehicle files, table by table, with this prefix."""
    schema = vehicle_schema()
    return _by_table([_key(*entry) for entry in entries(schema, schema["$defs"], above)])


def facts(key: Key) -> str:
    """Unit and allowed values of a key in words."""
    return ", ".join(filter(None, (key.unit if key.unit != "1" else "ratio", key.allowed)))


def table_of(key: Key) -> str:
    """Dotted name of the table of a key; empty at the top."""
    return key.key.rpartition(".")[0]


def _by_table(keys: Sequence[Key]) -> list[Key]:
    tables = list(dict.fromkeys(map(table_of, keys)))
    return sorted(keys, key=lambda key: tables.index(table_of(key)))


def _merged(kinds: dict[str, Key]) -> Key:
    """Key that several kinds of scenes have; the page says which of them those of free FMUs have."""
    allowed = " or ".join(dict.fromkeys(key.allowed for key in kinds.values()))
    kinds = {name: key for name, key in kinds.items() if issubclass(SCENE_KINDS[name], Scene)} or kinds
    *_, last = kinds.values()
    everywhere = len(kinds) == sum(issubclass(kind, Scene) for kind in SCENE_KINDS.values())
    return last._replace(allowed=allowed, assembly="" if everywhere else ", ".join(kinds))


def _key(key: str, entry: Schema, required: bool) -> Key:
    default = None if key.startswith(OVERRIDES) else entry.get("default", _fmu_default(key))
    text = REQUIRED if required else "" if default is None else toml_text(default)
    return Key(
        key,
        ", ".join(dict.fromkeys(units(entry))),
        allowed(entry, SYMBOLS),
        text,
        entry.get("description", ""),
        solved=entry.get("readOnly", False),
    )


def _fmu_default(key: str) -> Any:
    """Default of the FMU's parameter that a key sets; None where there is none, or it depends on the scene."""
    table, kinds = COMPONENTS.get(key.partition(".")[0], (ParameterTable, ()))
    parameter = table.fmu_parameters().get(key.rpartition(".")[2])
    if parameter is None or not parameter.default:
        return None
    found = [_defaults()[kind][parameter.name] for kind in kinds if parameter.name in _defaults()[kind]]
    return found[0] or None if isinstance(found[0], str) else found[0]  # an empty text means none


@cache
def _defaults() -> dict[str, dict[str, Any]]:
    """Defaults of the parameters of each kind of component of a vehicle with a driver."""
    parts = [part for model in TRACKS for part in assemble(load("serpentine", model)).parts]
    return {
        part.kind: {
            port.name: port.start for port in component_ports(part.kind, part.config) if port.causality == "parameter"
        }
        for part in parts
    }
