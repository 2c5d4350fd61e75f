"""Tables of files: frozen, with numbers that have units; errors name file, key and value."""

from __future__ import annotations

import ast
import inspect
import math
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
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


class BadInput(ValueError):
    """Invalid input of the user; the message names file, key, value and what is allowed."""


# A number, then a unit of words and one-digit powers: pint would evaluate any formula, also 9**9**9.
_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_QUANTITY = re.compile(
    rf"\s*([-+]?{_NUMBER})"
    r"(\D*(?:(?:\^|\*\*)\s*-?\d(?!\d|\s*(?:\^|\*\*))\D*)*)",
    re.ASCII,
)


# Factors of the units that scenes and vehicles use; pint, for all other units, takes 0.3 s to load.
COMMON = {("ms", "s"): 1e-3, ("kN", "N"): 1e3, ("GPa", "Pa"): 1e9, ("deg", "rad"): math.pi / 180.0, ("%", "1"): 1e-2}


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(cache_folder=None)


def to_si(unit: str) -> Callable[[object], float]:
    """Return a converter of ``12.3`` (SI) or ``"12.3 kN"`` to a float in ``unit``; it raises ValueError."""

    def convert(value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError(f"must be a number or a string like '1 {unit}'")
        if not isinstance(value, str):
            try:
                return float(value)
            except OverflowError:
                raise ValueError(f"must be a finite number in {unit}") from None
        quantity = _QUANTITY.fullmatch(value)
        if quantity is None:
            raise ValueError(f"must be a number or a quantity in {unit}")
        number, given_unit = float(quantity[1]), quantity[2].strip()
        if given_unit in ("", unit):
            return number
        if (given_unit, unit) in COMMON:
            return number * COMMON[given_unit, unit]
        import pint

        try:
            return float(_registry().Quantity(number, given_unit).to(unit).magnitude)
        except pint.errors.PintError as error:
            raise ValueError(f"must be a quantity in {unit}: {error}") from None
        except Exception:
            raise ValueError(f"must be a number or a quantity in {unit}") from None

    return convert


BOUNDS = {"ge": "minimum", "gt": "exclusiveMinimum", "le": "maximum", "lt": "exclusiveMaximum"}  # in a JSON schema


class In(GroupedMetadata):
    """Annotation of a bounded float that is read from a number (SI) or from a string with a unit."""

    def __init__(self, unit: str, **bounds: float) -> None:
        self.unit, self.bounds = unit, bounds

    def __iter__(self) -> Iterator[object]:
        yield BeforeValidator(to_si(self.unit))
        yield Field(allow_inf_nan=False, **self.bounds)  # type: ignore[call-overload]
        yield WithJsonSchema(self._schema())

    def _schema(self) -> dict[str, Any]:
        """Number within the bounds, or text of a number and a unit, whose sign alone can be checked."""
        number = {"type": "number", **{BOUNDS[bound]: value for bound, value in self.bounds.items()}}
        sign = "[-+]?" if max(self.bounds.get("ge", -1), self.bounds.get("gt", -1)) < 0 else "[+]?"
        text = {"type": "string", "pattern": rf"^\s*{sign}{_NUMBER}\s*(\D|$)"}
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


def _toml(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


class OrEach(GroupedMetadata):
    """Annotation of a value of ``kind``, or of a list of such values, one for each wheel of a side."""

    def __init__(self, kind: Any) -> None:
        self._one = TypeAdapter(kind)

    def __iter__(self) -> Iterator[object]:
        yield BeforeValidator(self._read)
        yield WithJsonSchema(self._schema())

    @property
    def _is_list(self) -> bool:
        """Whether one value is a list itself."""
        return self._one.json_schema().get("type") == "array"

    def _read(self, value: object) -> Any:
        inner = value[0] if isinstance(value, list | tuple) and value and self._is_list else value
        if not isinstance(inner, list | tuple):
            return self._checked(value, "")
        each = value if isinstance(value, list | tuple) else ()
        return tuple(self._checked(one, f"wheel {k}: ") for k, one in enumerate(each, 1))

    def _checked(self, value: object, which: str) -> Any:
        try:
            return self._one.validate_python(value)
        except ValidationError as error:
            message = error.errors()[0]["msg"].removeprefix("Value error, ")
            raise ValueError(f"{which}{message[0].lower()}{message[1:]}") from None

    def _schema(self) -> dict[str, Any]:
        one = self._one.json_schema()
        each = {"type": "array", "items": {key: part for key, part in one.items() if key != "unit"}, "minItems": 1}
        if "anyOf" in one:
            return {**one, "anyOf": [*one["anyOf"], each]}
        return {"anyOf": [one, each]}


def ratio(**bounds: float) -> Any:
    """Field of a bounded number without a unit."""
    return Field(allow_inf_nan=False, json_schema_extra={"unit": "1"}, **bounds)  # type: ignore[call-overload]


Mass = Annotated[float, In("kg", gt=0)]
Inertia = Annotated[float, In("kg m^2", gt=0)]
Length = Annotated[float, In("m")]
Distance = Annotated[float, In("m", gt=0)]
Force = Annotated[float, In("N")]
Stiffness = Annotated[float, In("N/m", ge=0)]
Damping = Annotated[float, In("N s/m", ge=0)]
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
    def idle(cls, table: Mapping[str, Any]) -> Iterator[str]:
        """Yield dotted keys of a ``table`` of a file, also of tables in it, that do not count beside its others."""
        whole, when = {key: field.default for key, field in cls.model_fields.items()} | dict(table), cls.conditions()
        for key, value in table.items():
            if key in when and when[key].lacks(whole):
                yield key
            elif isinstance(value, Mapping) and key in cls.model_fields:
                kind = _table_in(cls.model_fields[key].annotation)
                yield from (f"{key}.{inner}" for inner in (kind.idle(value) if kind else ()))

    @model_validator(mode="after")
    def _refuse_idle(self) -> Self:
        for key, when in self.conditions().items():
            value = getattr(self, key)
            if value not in (None, type(self).model_fields[key].default) and (lacking := when.lacks(vars(self))):
                raise ValueError(f"{key} = {value_text(value)} {lacking}")
        return self

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """JSON schema of the table with the meanings of its keys."""
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema)["properties"]
        for table in reversed(cls.__mro__):
            body = _classes(table.__module__).get(table.__name__, []) if issubclass(table, FrozenTable) else []
            for key, text in pairwise(body):
                match key, text:
                    case ast.AnnAssign(target=ast.Name(name)), ast.Expr(ast.Constant(str(meaning))):
                        alias = cls.model_fields[name].alias or name
                        when = cls.conditions().get(name)
                        described = f"{meaning}; {when}" if when else meaning
                        properties[alias]["description"] = " ".join(described.split())
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
        return _short(repr(value))
    except (ValueError, RecursionError):  # an integer of more digits than Python writes, a list in a list in ...
        return f"a huge {type(value).__name__}"


def path_text(path: object) -> str:
    """Text of a path for a message, at most 80 characters, of which the last ones, the name of the file, stay."""
    text = repr(str(path))
    return text if len(text) <= 80 else f"'...{text[-76:]}"


def foremost(error: ValidationError) -> Any:
    """Error of a validation to report: an unknown key, because a misspelt one leaves another missing, or the first."""
    return min(error.errors(), key=lambda each: each["type"] != "extra_forbidden")


def first_error(error: ValidationError, where: str) -> str:
    """Foremost error of a validation as one sentence."""
    first = foremost(error)
    key = _short(".".join(str(part) for part in first["loc"]))
    if first["type"] == "extra_forbidden":
        return f"{where}: unknown key '{key}'"
    if first["type"] == "missing":
        return f"{where}: key '{key}' is missing"
    message = first["msg"].removeprefix("Value error, ")
    value = "" if isinstance(first["input"], Mapping) else f" = {value_text(first['input'])}"
    about = f"{key}{value}: " if key else ""
    return f"{where}: {about}{message[0].lower()}{message[1:]}"
