"""Default and allowed values of parameters; a config may give other defaults than the model's."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from fmus.interface import numbers
from fmus.interface.model import InvalidParameter
from fmus.interface.ports import Port

KEY = "parameters"  # key of a config: values by name of the parameter
EXPERIMENT = "experiment"  # key of a config: stop time and communication step of the scene that it was built for, s


def check_value(port: Port, value: object) -> float | int | str:
    """Value in the type of a parameter's port; raises InvalidParameter where it is not allowed."""
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


def parameter_values(ports: Iterable[Port], values: Mapping[str, Any]) -> dict[str, Any]:
    """Checked values of all parameters by name, start values where none is given; raises InvalidParameter."""
    return {
        port.name: check_value(port, values.get(port.name, port.start))
        for port in ports
        if port.causality == "parameter"
    }


def configured_ports(ports: Iterable[Port], config: Mapping[str, Any]) -> tuple[Port, ...]:
    """Ports whose parameters have the start values given in the config; raises InvalidParameter."""
    values = config.get(KEY, {})
    return tuple(
        port._replace(start=check_value(port, values[port.name]))
        if port.causality == "parameter" and port.name in values
        else port
        for port in ports
    )


def check_names(ports: Iterable[Port], config: Mapping[str, Any]) -> None:
    """Check that a config gives values of known parameters only; raises InvalidParameter."""
    names = {port.name for port in ports if port.causality == "parameter"}
    for name in config.get(KEY, {}):
        if name not in names:
            raise InvalidParameter(f"there is no parameter '{name}'")


def all_ports(
    known: Iterable[Port], config: Mapping[str, Any], meanings: Mapping[str, numbers.Meaning]
) -> tuple[Port, ...]:
    """Ports of a model, ``known``, and parameters of its numbers, configured; raises InvalidParameter."""
    known = tuple(known)
    ports = (*known, *numbers.ports(config, meanings, known))
    check_names(ports, config)
    return configured_ports(ports, config)


def experiment(config: Mapping[str, Any]) -> Mapping[str, Any]:
    """Stop time and communication step of the DefaultExperiment, s."""
    times: Mapping[str, Any] = config.get(EXPERIMENT, {"stop": 1.0, "step": 1e-3})
    return times
