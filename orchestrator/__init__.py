"""Names that ``import cotrack`` offers (``cotrack/__init__.py``, installed under that name): those of ``OFFERED``.

A name is imported when it is first used, so importing the package is fast and its generic modules need nothing else.
"""

from importlib import import_module
from typing import Any

__version__ = "0.5.0"  # also the version of the distribution

OFFERED = {  # public name: module, name in the module
    "run": ("recorded_run", "run"),
    "Run": ("recorded_run", "Run"),
    "scenes": ("scene.scene", "scene_names"),
    "load": ("scene.scene", "load"),
    "Log": ("log.reader", "Log"),
    "export": ("log.export", "export"),
    "to_pandas": ("log.export", "to_pandas"),
    "to_xarray": ("log.export", "to_xarray"),
    "to_polars": ("log.export", "to_polars"),
    "to_arrow": ("log.export", "to_arrow"),
    "analyse": ("results.analyses.catalogue", "analyse"),
    "report": ("execution.log_report", "report"),
    "life": ("execution.course", "life"),
    "fit": ("studies.fit", "fit"),
    "sweep": ("studies.parameter_sweep", "sweep"),
    "compare": ("results.difference", "differences_of_logs"),
}


def __getattr__(name: str) -> Any:
    if name not in OFFERED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, thing = OFFERED[name]
    return getattr(import_module(f"{__name__}.{module}"), thing)


def __dir__() -> list[str]:
    return sorted({*globals(), *OFFERED})
