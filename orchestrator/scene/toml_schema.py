"""JSON schemas of scene files and vehicle files, with which editors complete and check TOML."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, models_json_schema

from fmus.ranges import VEHICLE, PlausibleRange
from fmus.vehicle import VehicleTable
from orchestrator.scene.points import UNITS
from orchestrator.scene.ranges import SCENE
from orchestrator.scene.scene import KINDS
from orchestrator.scene.settings import Schema, entries


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


def scene_schema() -> Schema:
    """JSON schema of a scene file: any of the kinds of scenes, each is a definition.

    Not checked are texts with units against ranges, what relates keys to each other, and missing keys of a vehicle.
    """
    places, schema = models_json_schema([(kind, "validation") for kind in KINDS.values()], schema_generator=TomlSchema)
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
    for table in (tables[kind.__name__] for kind in KINDS.values()):
        table["required"].remove("name")
        if whole := table["properties"].get("vehicle"):
            whole["anyOf"] = [{"type": "string"}, {"$ref": whole.pop("$ref")}]
        _add_ranges(table, tables, SCENE)
    return {
        "$schema": TomlSchema.schema_dialect,
        "title": "scene",
        "anyOf": [places[kind, "validation"] for kind in KINDS.values()],
        "$defs": tables,
    }


SCHEMAS = {"scene": scene_schema, "vehicle": vehicle_schema}


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
