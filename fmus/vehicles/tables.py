"""Base of all tables of TOML files: frozen, with numbers that have units; errors name file, key and value."""

from __future__ import annotations

import ast
import inspect
import json
import math
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise
from typing import Annotated, Any, Self, get_args

from annotated_types import GroupedMetadata
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    model_validator,
)

from fmus.interface.numbers import Meaning
from fmus.interface.units import conversion

Schema = Mapping[str, Any]  # JSON schema


class BadInput(ValueError):
    """Invalid input of the user; the message names file, key, value and what is allowed."""


NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
# A number and its unit, which begins with 1/ or no digit, sign or point.
QUANTITY = re.compile(rf"\s*([-+]?{NUMBER})\s*(1\s*/.*?|[^\d\s.+-].*?)?\s*", re.ASCII)


def to_si(unit: str) -> Callable[[object], float]:
    """Return a converter of ``12.3`` (SI) or ``"12.3 kN"`` to a float in ``unit``; it raises ValueError."""

    def convert(value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError(f"must be a number or a text like '{'50 %' if unit == '1' else f'1 {unit}'}'")
        if not isinstance(value, str):
            try:
                return float(value)
            except OverflowError:
                raise ValueError(f"must be a finite number in {unit}") from None
        if (quantity := QUANTITY.fullmatch(value)) is None:
            raise ValueError(f"must be a number or a {'ratio in %' if unit == '1' else f'quantity in {unit}'}")
        try:
            factor, offset = conversion(quantity[2] or "", unit)
        except ValueError as reason:
            raise ValueError(f"must be a quantity in {unit}: {reason}") from None
        return float(quantity[1]) * factor + offset

    return convert


BOUNDS = {"ge": "minimum", "gt": "exclusiveMinimum", "le": "maximum", "lt": "exclusiveMaximum"}  # in a JSON schema


class In(GroupedMetadata):
    """Annotation of a bounded float that is read from a number (SI) or, unless it is plain, from one with a unit."""

    def __init__(self, unit: str, plain: bool = False, **bounds: float) -> None:
        self.unit, self.plain, self.bounds = unit, plain, bounds

    def __iter__(self) -> Iterator[object]:
        yield from () if self.plain else (BeforeValidator(to_si(self.unit)),)
        yield Field(allow_inf_nan=False, **self.bounds)  # type: ignore[call-overload]
        yield WithJsonSchema(self._schema())

    def _schema(self) -> dict[str, Any]:
        """Number within the bounds, or text of a number and a unit, whose sign alone can be checked."""
        number = {"type": "number", **{BOUNDS[bound]: value for bound, value in self.bounds.items()}}
        if self.plain:
            return {**number, "unit": self.unit}
        sign = "[-+]?" if max(self.bounds.get("ge", -1), self.bounds.get("gt", -1)) < 0 else "[+]?"
        text = {"type": "string", "pattern": rf"^\s*{sign}{NUMBER}\s*(\D|$)"}
        return {"anyOf": [number, text], "unit": self.unit}


GIVEN: tuple[object, ...] = ()  # any value but none, in a ``When``


class When:
    """Annotation of a key that counts only where other keys of its table have one of these values, or are GIVEN."""

    def __init__(self, **keys: Sequence[object]) -> None:
        self._keys = keys

    def lacks(self, table: Mapping[str, Any]) -> str:
        """Why it does not count in a whole ``table`` of a file, in words; empty where it does."""
        for key, values in self._keys.items():
            value = table.get(key)
            if value not in values if values else value in (None, False):
                is_mode = values and value is not None and None not in values
                return self._need(key) + (f", not {_toml(value)}" if is_mode else "")
        return ""

    def _need(self, key: str) -> str:
        values = self._keys[key]
        if None in values:
            return f"excludes {key}"
        return f"needs {key} = {' or '.join(map(_toml, values))}" if values else f"needs {key}"

    def __str__(self) -> str:
        return ", ".join(map(self._need, self._keys))


class WhenAny(When):
    """Annotation of a key that counts where one of several conditions is met."""

    def __init__(self, *conditions: When) -> None:
        self._conditions = conditions

    def lacks(self, table: Mapping[str, Any]) -> str:
        """As of ``When``: why none of them is met."""
        lacking = [one.lacks(table) for one in self._conditions]
        return " or ".join(lacking) if all(lacking) else ""

    def __str__(self) -> str:
        return " or ".join(map(str, self._conditions))


def _toml(value: object) -> str:
    if isinstance(value, int) and value.bit_length() > 1000:  # Python prints 4300 digits at most
        return "so large a number"
    return str(value).lower() if isinstance(value, bool) else repr(value)


class OrEach(GroupedMetadata):
    """Annotation of a value of ``kind``, or of a list of such values, one for each wheel of a side."""

    def __init__(self, kind: Any) -> None:
        self.kind, self._one = kind, TypeAdapter(kind)

    def __iter__(self) -> Iterator[object]:
        yield BeforeValidator(self._read)
        yield WithJsonSchema(self._schema())

    @property
    def _is_list(self) -> bool:
        """Whether one value is a list itself."""
        return self._one.json_schema().get("type") == "array"

    def _read(self, value: object) -> Any:
        inner = value[0] if isinstance(value, list | tuple) and value and self._is_list else value
        if not isinstance(inner, list | tuple) or not value:
            return self._checked(value, "")
        each = value if isinstance(value, list | tuple) else ()
        return tuple(self._checked(one, f"wheel {k}: ") for k, one in enumerate(each, 1))

    def _checked(self, value: object, which: str) -> Any:
        try:
            return self._one.validate_python(value)
        except ValidationError as error:
            raise ValueError(f"{which}{_said(error.errors()[0], self._one.json_schema())}") from None

    def _schema(self) -> dict[str, Any]:
        one = self._one.json_schema()
        each = {"type": "array", "items": {key: part for key, part in one.items() if key != "unit"}, "minItems": 1}
        if "anyOf" in one:
            return {**one, "anyOf": [*one["anyOf"], each]}
        return {"anyOf": [one, each]}


def ratio(**bounds: float) -> In:
    """Annotation of a bounded number without a unit."""
    return In("1", plain=True, **bounds)


Mass = Annotated[float, In("kg", gt=0)]
Inertia = Annotated[float, In("kg m^2", gt=0)]
Length = Annotated[float, In("m", ge=-1e3, le=1e3)]  # of a machine, and places on it
Size = Annotated[float, In("m", gt=0, le=50)]  # of a part
Gap = Annotated[float, In("m", ge=0, le=50)]
FARTHEST = 1e6  # m; beyond, a double cannot resolve contact penetrations
Place = Annotated[float, In("m", ge=-FARTHEST, le=FARTHEST)]
Angle = Annotated[float, In("rad")]
Distance = Annotated[float, In("m", gt=0)]
Force = Annotated[float, In("N", ge=-1e11, le=1e11)]
Stiffness = Annotated[float, In("N/m", ge=0, le=1e13)]
Damping = Annotated[float, In("N s/m", ge=0, le=1e11)]
Each = float | tuple[float, ...]  # of all wheels of a side, or of each
EachPlace = tuple[float, float] | tuple[tuple[float, float], ...]


@cache
def _classes(module: str) -> dict[str, list[ast.stmt]]:
    """Statements of the classes of a module, by name; its source is read, which an import has no need of."""
    statements = ast.parse(inspect.getsource(sys.modules[module])).body
    return {statement.name: statement.body for statement in statements if isinstance(statement, ast.ClassDef)}


LOGGED = {"logged": True}  # context of a validation: the table of a log, which also an earlier version may have made


def is_logged(info: ValidationInfo | None) -> bool:
    """Whether a log is read, whose run need not be one of today."""
    return info is not None and info.context == LOGGED


class FrozenTable(BaseModel):
    """Frozen table that refuses unknown keys; the docstring below each key is its description in the JSON schema.

    ``use_attribute_docstrings`` of pydantic would read all sources at every import, in 50 ms.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    @classmethod
    @cache
    def conditions(cls) -> dict[str, When]:
        """When the keys count that do not always."""
        found = ((key, one) for key, field in cls.model_fields.items() for one in field.metadata)
        return {key: one for key, one in found if isinstance(one, When)}

    @classmethod
    def inactive(cls, table: Mapping[str, Any]) -> Iterator[str]:
        """Yield dotted keys of a ``table`` of a file, also of tables in it, that do not count beside its others."""
        whole, when = {key: field.default for key, field in cls.model_fields.items()} | dict(table), cls.conditions()
        for key, value in table.items():
            if key in when and when[key].lacks(whole):
                yield key
            elif isinstance(value, Mapping) and key in cls.model_fields:
                kind = _table_in(cls.model_fields[key].annotation)
                yield from (f"{key}.{inner}" for inner in (kind.inactive(value) if kind else ()))

    @model_validator(mode="after")
    def _refuse_inactive(self) -> Self:
        for key, when in self.conditions().items():
            value = getattr(self, key)
            if value not in (None, type(self).model_fields[key].default) and (lacking := when.lacks(vars(self))):
                raise ValueError(f"{key} = {value_text(value)} {lacking}")
        return self

    @classmethod
    @cache
    def texts(cls) -> dict[str, str]:
        """Meanings of the keys."""
        found = {}
        for table in reversed(cls.__mro__):
            body = _classes(table.__module__).get(table.__name__, []) if issubclass(table, FrozenTable) else []
            for key, text in pairwise(body):
                match key, text:
                    case ast.AnnAssign(target=ast.Name(name)), ast.Expr(ast.Constant(str(meaning))):
                        when = cls.conditions().get(name)
                        found[name] = " ".join((f"{meaning}; {when}" if when else meaning).split())
        return found

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """JSON schema of the table with the meanings of its keys."""
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema)["properties"]
        for name, text in cls.texts().items():
            properties[cls.model_fields[name].alias or name]["description"] = text
        return schema


def _table_in(annotation: Any) -> type[FrozenTable] | None:
    """Table of an annotated key; None for a value."""
    if isinstance(annotation, type) and issubclass(annotation, FrozenTable):
        return annotation
    return next(filter(None, map(_table_in, get_args(annotation))), None)


def _short(text: str) -> str:
    return text if len(text) <= 80 else f"{text[:77]}..."


def value_text(value: object) -> str:
    """Text of a value for a message, at most 80 characters for values of any size or depth."""
    try:
        return str(value).lower() if isinstance(value, bool) else _short(repr(value))
    except (ValueError, RecursionError):  # an integer of more digits than Python writes, a list in a list in ...
        return f"a huge {type(value).__name__}"


def path_text(path: object) -> str:
    """Text of a path for a message, at most 80 characters, of which the last ones, the name of the file, stay."""
    text = repr(str(path))
    return text if len(text) <= 80 else f"'...{text[-76:]}"


def foremost(error: ValidationError) -> Any:
    """Error of a validation to report: an unknown key, because a misspelt one leaves another missing, or the first."""
    return min(error.errors(), key=lambda each: each["type"] != "extra_forbidden")


def key_text(parts: Iterable[str | int]) -> str:
    """Dotted key, entries of lists counted from 1 as in names of FMUs: ``road_wheel.x[1]``."""
    return "".join(f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in parts).removeprefix(".")


def first_error(error: ValidationError, where: str, schema: Schema) -> str:
    """Foremost error of a validation as one sentence; ``schema``: JSON schema of the table, which says what may be."""
    first = foremost(error)
    *above, last = first["loc"] or ("",)
    if first["type"] == "missing" and isinstance(last, int):  # an entry of a list
        first = {**first, "loc": tuple(above)}
    key = _short(key_text(first["loc"]))
    if first["type"] == "extra_forbidden":
        return f"{where}: unknown key '{key}'"
    if first["type"] == "missing" and not isinstance(last, int):
        return f"{where}: key '{key}' is missing"
    value = "" if isinstance(first["input"], Mapping) else f" = {value_text(first['input'])}"
    return f"{where}: {f'{key}{value}: ' if key else ''}{_said(first, schema)}"


def _said(error: Any, schema: Schema) -> str:
    """Reason of an error: allowed values of the key, by the schema of the table, or the words of a validator."""
    entry = _entry(schema, error["loc"])
    text = allowed(entry, WORDS)
    if error["type"] == "value_error":
        message = str(error["msg"]).removeprefix("Value error, ")
        bounded = message.startswith("must be a number or ") and text != "number" and len(entry.get("anyOf", ())) == 2
        return f"{message[0].lower()}{message[1:]}{f', {text}' * bounded}"
    article = "a " if text.startswith(("list", "number", "table", "text", "whole")) else ""
    unit = " or ".join(dict.fromkeys(filter(lambda unit: unit != "1", units(entry))))
    numbers = f" {unit}" if unit and text[-1:].isdigit() else f", in {unit}" if unit else ""
    least = f", at least {error['ctx']['min_length']}" if error["type"] == "too_short" else ""
    return f"must be {article}{'finite ' * (text == 'number')}{text}{least}{numbers}"


def _entry(schema: Schema, loc: Iterable[str | int]) -> Schema:
    """Schema of the value at a place of a table, an empty one where a validator alone knows it."""
    found = [schema]
    for part in loc:
        ways = [way for each in found for way in _ways(each, schema)]
        inner = [way.get("properties", {}).get(part, way.get("additionalProperties")) if isinstance(part, str) else
                 dict(enumerate(way.get("prefixItems", ()))).get(part, way.get("items")) for way in ways]  # fmt: skip
        found = [each for each in inner if each] or found  # the name of a kind of value, among several, is no key
    table = next((way for way in _ways(found[0], schema) if "properties" in way), {})
    return {**found[0], "keys": [*table["properties"]]} if table else found[0]


def _ways(entry: Schema, schema: Schema) -> Iterator[Schema]:
    """Alternatives of a value."""
    if "$ref" in entry:
        entry = schema["$defs"][entry["$ref"].rpartition("/")[2]]
    yield entry
    for part in entry.get("anyOf", ()):
        yield from _ways(part, schema)


WORDS = {  # of the bounds of a number
    "exclusiveMinimum": "greater than {:g}", "minimum": "{:g} or more", "maximum": "{:g} at most",
    "exclusiveMaximum": "less than {:g}",
}  # fmt: skip
MAX_NAMES = 15  # that are listed


def units(entry: Schema) -> Iterator[str]:
    """Units of a value, or of the entries of a list."""
    if "unit" in entry:
        yield entry["unit"]
    for part in (*entry.get("anyOf", ()), *entry.get("prefixItems", ()), *filter(None, [entry.get("items")])):
        yield from units(part)


def allowed(entry: Schema, words: Mapping[str, str]) -> str:
    """Allowed values of a key, by its JSON schema; ``words``: how bounds of a number are written."""

    def within(part: Schema) -> str:
        return allowed(part, words)

    match entry:
        case {"keys": [*known]} if len(known) < MAX_NAMES:
            return f"table with the key{'s' * (len(known) > 1)} {', '.join(known)}"
        case {"unit": _, "anyOf": [number, _]}:  # the other one is the same as a text
            return within(number)
        case {"anyOf": [{"type": "number"} as number, {"pattern": _}, *more]}:  # alone or in a list
            return " or ".join(map(within, (number, *more)))
        case {"enum": values} if len(values) > MAX_NAMES:
            return f"one of {len(values)} names"
        case {"enum": values}:
            return " or ".join(map(json.dumps, values))
        case {"const": value}:
            return json.dumps(value)
        case {"anyOf": parts}:
            return " or ".join(dict.fromkeys(within(part) for part in parts if part.get("type") != "null"))
        case {"prefixItems": parts}:
            return f"[{', '.join(map(within, parts))}]"
        case {"items": part}:
            return f"list of {(each := within(part))}{'s' * (each in ('number', 'text', 'table'))}"
        case {"type": "boolean"}:
            return "true or false"
        case {"type": "integer", **bounds}:
            return ", ".join(filter(None, ("whole number", bounds_text(bounds, words))))
        case {"type": "number", **bounds}:
            return bounds_text(bounds, words) or "number"
        case {"type": "string"}:
            return "text"
    return "table"


def bounds_text(bounds: Schema, words: Mapping[str, str]) -> str:
    """Bounds of a number in words; empty without any."""
    if "minimum" in bounds and "maximum" in bounds:
        return f"{bounds['minimum']:g} to {bounds['maximum']:g}"
    return ", ".join(text.format(bounds[bound]) for bound, text in words.items() if bound in bounds)


def meanings(table: type[FrozenTable], above: str = "") -> Iterator[tuple[str, Meaning]]:
    """Yield the numbers of a table by their keys without indices, behind ``above``, with their meanings."""
    for key, field in table.model_fields.items():
        name = f"{above}{field.alias or key}"
        if inner := _table_in(field.annotation):
            yield from meanings(inner, f"{name}.")
        elif number := _number_in(*field.metadata, *get_args(field.annotation)):
            unit = number.unit.replace("^", "").replace(" ", ".")
            yield name, (unit, *_bounds(number.bounds), table.texts()[key])


def _number_in(*parts: Any) -> In | None:
    """First number in parts of an annotation, at any depth."""
    inside = (_number_in(*get_args(part.kind if isinstance(part, OrEach) else part)) for part in parts)
    return next((part for part in (*parts, *inside) if isinstance(part, In)), None)


def _bounds(bounds: Mapping[str, float]) -> tuple[float | str, float | str, str]:
    """Least and largest value of a number with bounds, and what is allowed in words."""
    words = {"gt": "greater than {:g}", "ge": "{:g} or more", "le": "{:g} at most", "lt": "less than {:g}"}
    text = " and ".join(words[bound].format(bounds[bound]) for bound in words if bound in bounds)
    low = math.nextafter(bounds["gt"], math.inf) if "gt" in bounds else bounds.get("ge", "-inf")
    high = math.nextafter(bounds["lt"], -math.inf) if "lt" in bounds else bounds.get("le", "inf")
    return low, high, text or "a finite number"
