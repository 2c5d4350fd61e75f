"""What parameters are when nobody sets them: the model's own values, or those of the config that it is built from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from fmus.model import InvalidParameter
from fmus.ports import Port

KEY = "parameters"  # of a config: values by name


def checked(port: Port, value: object) -> float | int | str:
    """The value in the type of a parameter's port; raises InvalidParameter for one that it cannot have."""
    if isinstance(port.start, str):
        if not isinstance(value, str):
            raise InvalidParameter(f"{port.name} = {value!r}: must be a text")
        if port.choices and value not in port.choices:
            raise InvalidParameter(f"{port.name} = '{value}': must be one of {', '.join(port.choices)}")
        return value
    real = isinstance(port.start, float)
    if isinstance(value, bool) or not isinstance(value, int | float if real else int):
        raise InvalidParameter(f"{port.name} = {value!r}: must be a {'' if real else 'whole '}number")
    if not port.allowed.least <= value <= port.allowed.most or not math.isfinite(value):
        raise InvalidParameter(f"{port.name} = {value:.6g}: must be {port.allowed.text}")
    return float(value) if real else value


def given(ports: Iterable[Port], values: Mapping[str, Any]) -> dict[str, Any]:
    """The checked values of all parameters, their starts where there are no others; raises InvalidParameter."""
    return {
        port.name: checked(port, values.get(port.name, port.start)) for port in ports if port.causality == "parameter"
    }


def configured(ports: Iterable[Port], config: Mapping[str, Any]) -> tuple[Port, ...]:
    """The ports, parameters with the start values that the config has for them; raises InvalidParameter."""
    given = config.get(KEY, {})
    return tuple(
        port._replace(start=checked(port, given[port.name]))
        if port.causality == "parameter" and port.name in given
        else port
        for port in ports
    )


def check_names(ports: Iterable[Port], config: Mapping[str, Any]) -> None:
    """Refuse a config with values of parameters that do not exist; raises InvalidParameter."""
    known = {port.name for port in ports if port.causality == "parameter"}
    for name in config.get(KEY, {}):
        if name not in known:
            raise InvalidParameter(f"there is no parameter '{name}'")
