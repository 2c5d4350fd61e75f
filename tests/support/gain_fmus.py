"""FMUs y = k u that are not ours, and values for them in SSP archives."""

import zipfile

import foreign_fmus
from foreign_fmus import Variable
from ssd_texts import bound, values

GEARS = ("low", "high", "road")
UNITS = {"m": {"m": 1}, "mm": {"m": 1, "factor": 1e-3}, "degC": {"K": 1, "offset": 273.15}, "K": {"K": 1}}


def variables(unit_in="", unit_out="", k=2.0):
    """Variables of the FMU, with units of its input and output."""
    return (
        Variable("u", "input", 0.0, unit=unit_in),
        Variable("y", "output", unit=unit_out),
        Variable("k", "parameter", k),
        Variable("gear_start", "parameter", 1, "Enumeration", items=GEARS),
        Variable("gear", "output", 1, "Enumeration", items=GEARS),
        Variable("on_start", "parameter", False, "Boolean"),
        Variable("on", "output", False, "Boolean"),
        Variable("word_start", "parameter", "", "String"),
        Variable("word", "output", "", "String"),
        Variable("whole", "input", 0, "Integer"),
    )


def gain_fmu(tmp_path_factory):
    """FMU y = k u without units."""
    return foreign_fmus.build(tmp_path_factory.mktemp("gain") / "gain.fmu", "gain", variables())


def with_units(gain, file, unit_in, unit_out):
    """The gain with units of its input and output."""
    return foreign_fmus.build(file, "gain", variables(unit_in, unit_out), UNITS, foreign_fmus.library_of(gain))


START = values(u=("Real", 3.0))


def with_maximum(gain, file):
    """The gain with a declared maximum of k."""
    with zipfile.ZipFile(gain) as source, zipfile.ZipFile(file, "w") as copy:
        for name in source.namelist():
            old, new = b'<Real start="2.0"', b'<Real max="5" start="2.0"'
            assert name != "modelDescription.xml" or old in source.read(name)
            copy.writestr(name, source.read(name).replace(old, new))
    return file


def in_unit(unit, defined=""):
    """Start value 3 of u in a unit, of a set that defines another one."""
    units = f'<ssv:Units><ssc:Unit name="{defined}"><ssc:BaseUnit m="1"/></ssc:Unit></ssv:Units>' if defined else ""
    binding = START.replace('value="3.0"', f'value="3.0" unit="{unit}"')
    return bound(binding.replace("</ssv:Parameters>", f"</ssv:Parameters>{units}"))
