"""Things of users: archives, tables ``[fmu.NAME]``, heights, grids, FMUs, logs of others, all somewhat wrong."""

from __future__ import annotations

import base64
import io
import random
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer
from PIL import Image

from tests.fuzz import values
from tests.support import foreign_fmus, whole_fmu
from tests.support.foreign_fmus import Variable

GUEST = (
    Variable("u", "input"), Variable("y", "output"), Variable("together", "output"),
    Variable("when", "parameter", 1e9), Variable("manner", "parameter", 0, "Integer"),
    Variable("steps", "output", 0, "Integer"),
)  # fmt: skip
SPACE = "http://ssp-standard.org/SSP1/SystemStructure"
SSD = f"""<ssd:SystemStructureDescription xmlns:ssd="{SPACE}Description" xmlns:ssc="{SPACE}Common"
 xmlns:ssv="{SPACE}ParameterValues" xmlns:ssm="{SPACE}ParameterMapping" xmlns:ssb="{SPACE}SignalDictionary"
 version="1.0" name="t">
<ssd:System name="t">
<ssd:Connectors><ssd:Connector name="k" kind="parameter"><ssc:Real unit="s"/></ssd:Connector></ssd:Connectors>
<ssd:ParameterBindings><ssd:ParameterBinding prefix="inner."><ssd:ParameterValues><ssv:ParameterSet><ssv:Parameters>
<ssv:Parameter name="b.when"><ssv:Real value="3.5" unit="s"/></ssv:Parameter>
<ssv:Parameter name="b.manner"><ssv:Integer value="0"/></ssv:Parameter>
</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues>
<ssd:ParameterMapping><ssm:ParameterMapping>
<ssm:MappingEntry source="inner.b.when" target="a.when">
<ssc:LinearTransformation factor="2" offset="1"/></ssm:MappingEntry>
</ssm:ParameterMapping></ssd:ParameterMapping></ssd:ParameterBinding></ssd:ParameterBindings>
<ssd:Elements>
<ssd:Component name="a" type="application/x-fmu-sharedlibrary" source="a.fmu" implementation="CoSimulation">
<ssd:Connectors><ssd:Connector name="y" kind="output"><ssc:Real unit="m"/></ssd:Connector></ssd:Connectors>
</ssd:Component>
<ssd:System name="inner">
<ssd:Connectors><ssd:Connector name="in" kind="input"><ssc:Real unit="mm"/></ssd:Connector></ssd:Connectors>
<ssd:Elements><ssd:Component name="b" source="a.fmu"/>
<ssd:SignalDictionaryReference name="d" dictionary="bus"/></ssd:Elements>
<ssd:Connections><ssd:Connection startConnector="in" endElement="b" endConnector="u"/>
<ssd:Connection startElement="b" startConnector="y" endElement="d" endConnector="level"/></ssd:Connections>
</ssd:System>
<ssd:SignalDictionaryReference name="d" dictionary="bus"/>
</ssd:Elements>
<ssd:Connections><ssd:Connection startElement="a" startConnector="y" endElement="inner" endConnector="in"/>
<ssd:Connection startElement="d" startConnector="level" endElement="a" endConnector="u"
 suppressUnitConversion="true"/></ssd:Connections>
<ssd:SignalDictionaries><ssd:SignalDictionary name="bus"><ssb:SignalDictionary version="1.0">
<ssb:DictionaryEntry name="level"><ssc:Real/></ssb:DictionaryEntry></ssb:SignalDictionary></ssd:SignalDictionary>
</ssd:SignalDictionaries>
</ssd:System>
<ssd:Units><ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit>
<ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit></ssd:Units>
<ssd:DefaultExperiment startTime="0" stopTime="0.002"/>
</ssd:SystemStructureDescription>"""
ODD = ("", "a", "inner", "1e400", "-1", "nan", "INF", "..", "../x", "%2e%2e", "a.fmu", "true", "input", "output", "m",
       "y", "u", "inner.in", "x" * 500, "\x1b[31m", "\u00e4", "2.0")  # fmt: skip
GROUND = """title = "t"
assembly = "vehicle"
vehicle = "m113"
ground.heightmap = {table}
track = {{model = "rigid"}}
run = {{stop = "1 ms", step = "1 ms"}}
drive.mode = "speed"
"""
ATTRIBUTE, TAG = re.compile(r'="[^"]*"'), re.compile(r"<[^<>]*>")
made: dict[str, bytes] = {}


def prepare(folder: Path) -> None:
    """Build the FMU of all cases."""
    (folder / "guest").mkdir(exist_ok=True)
    made["fmu"] = foreign_fmus.build(folder / "guest" / "a.fmu", "guest", GUEST).read_bytes()
    made["whole"] = whole_fmu.build(folder / "guest")().read_bytes()


def draw(chance: random.Random) -> dict[str, Any]:
    """A case."""
    return chance.choice((_archive, _archive, _scene, _scene, _heights, _grid, _whole, _bag, _check))(chance)


def _archive(chance: random.Random) -> dict[str, Any]:
    files = {"SystemStructure.ssd": _edited(chance, SSD).encode("utf-8", "replace"), "a.fmu": made["fmu"]}
    options = chance.choice(([], ["--stop", "0.003"], ["--step", "0.0005"], ["--set", "fmu.a.non_finite=warn"]))
    command = chance.choice((["show", "t.ssp"], ["run", "t.ssp", *options, "--json", "-o", "out.mcap"]))
    return {"files": {"t.ssp": _damaged(chance, _zip(files))}, "arguments": command}


def _scene(chance: random.Random) -> dict[str, Any]:
    entry = {
        "file": _rarely(chance, "a.fmu", ("", "none.fmu", "/dev/null", ".", "a.fmu\x00", 3)),
        "parameters": {_rarely(chance, "when", ("manner", "u", "y", "none", "")): _rarely(chance, 1.0, values.TEXTS)},
        **_rarely(chance, {}, ({"call_limit": "soon"}, {"call_limit": -1}, {"call_limit": "1e-9 s"})),
        **_rarely(chance, {}, ({"non_finite": "shrug"}, {"in_process": "yes"}, {"stage": 1e9}, {"colour": 1})),
    }
    connections = [_rarely(chance, "a.y -> b.u", ("a.y->a.u", "b.y -> b.y", "->", "nan * a.y -> b.u", "c.y -> a.u"))]
    run = {"stop": 2e-3, "step": 1e-3, "start": _rarely(chance, 0.0, (1e6, -1e300, "nan", "1 h"))}
    table = {"title": "t", "assembly": "fmus", "run": run, "connections": connections}
    table["fmu"] = {"a": entry, _rarely(chance, "b", ("", "a.b", "x/y", "\x1b")): {"file": "a.fmu", "stage": 1}}
    fmu = _damaged(chance, made["fmu"])
    command = chance.choice((["show", "t.toml"], ["run", "t.toml", "--json", "-o", "out.mcap"]))
    return {"files": {"t.toml": values.toml(table), "a.fmu": fmu}, "arguments": command}


def _whole(chance: random.Random) -> dict[str, Any]:
    """Start values at and beyond the ranges of whole numbers, and connections between their types."""
    edges = [2**bits + more for bits in (7, 8, 15, 16, 31, 32, 53, 63, 64) for more in (-1, 0, 1)]
    given = [0, 1, *edges, *(-edge for edge in edges), 5.5, "high", "low", "9", True, 1e300]
    names = chance.sample([f"{slot}.{kind}" for slot in "pu" for kind in (*whole_fmu.TYPES, "e")], 2)
    kinds = chance.sample(whole_fmu.TYPES, 2)
    entries = {
        "a": {"file": "a.fmu", "parameters": {name: chance.choice(given) for name in names}},
        "b": {"file": "a.fmu"},
    }
    run, link = {"stop": 2e-3, "step": 1e-3}, f"a.y.{kinds[0]} -> b.u.{kinds[1]}"
    table = {"title": "t", "assembly": "fmus", "run": run, "connections": [link], "fmu": entries}
    files = {"t.toml": values.toml(table), "a.fmu": {"bytes": base64.b64encode(made["whole"]).decode()}}
    return {"files": files, "arguments": ["run", "t.toml", "--json", "-o", "out.mcap"]}


def _bag(chance: random.Random) -> dict[str, Any]:
    """An MCAP file of other software, and a command that takes logs."""
    stream = io.BytesIO()
    kinds = chance.choice(list(CompressionType)), chance.random() < 0.8, chance.random() < 0.8
    writer = Writer(stream, compression=kinds[0], use_chunking=kinds[1], enable_crcs=kinds[2])
    writer.start(profile=chance.choice(("", "ros2", "ros1", "x" * 300)), library=chance.choice(("", "rosbag2", *ODD)))
    encodings = ("cdr", "ros2msg"), ("json", "jsonschema"), ("protobuf", "protobuf"), ("", ""), ("flatbuffer", "x")
    for k in range(chance.choice((0, 1, 3, 40))):
        message, schema = chance.choice(encodings)
        kind = writer.register_schema(f"std_msgs/msg/T{k}", schema, b"float64 data") if schema else 0
        channel = writer.register_channel(chance.choice(("/chassis/speed", f"/t{k}", *ODD)), message, kind)
        for t in range(chance.choice((0, 1, 50))):
            writer.add_message(channel, t * 10**7, chance.randbytes(8), t * 10**7, t)
    writer.finish()
    commands = (
        "log info b.mcap", "log verify b.mcap", "log recover b.mcap -o c.mcap", "report b.mcap -o out.html",
        "compare b.mcap b.mcap", "replay b.mcap", "plot b.mcap -o out.png", "resume b.mcap", "analyse b.mcap power",
    )  # fmt: skip
    return {"files": {"b.mcap": _damaged(chance, stream.getvalue())}, "arguments": chance.choice(commands).split()}


def _grid(chance: random.Random) -> dict[str, Any]:
    """An ESRI grid with a somewhat wrong head."""
    columns, rows = chance.choice(((2, 2), (3, 40), (60, 60)))
    head: dict[str, Any] = {"ncols": columns, "nrows": rows, "xllcorner": 0, "yllcorner": 0, "cellsize": 1}
    head["NODATA_value"] = -9999
    for _ in range(chance.choice((0, 1, 1, 2))):
        key = chance.choice([*head])
        head[chance.choice((key, key, key.upper(), "dx", "xllcenter"))] = chance.choice((0, -1, 3, 1e9, 2.5, *ODD))
    lines = [f"{key} {value}" for key, value in head.items()]
    lines += [lines[chance.randrange(6)]] * (chance.random() < 0.1)
    lines += [" ".join(f"{chance.uniform(0.0, 0.1):.3f}" for _ in range(columns)) for _ in range(rows)]
    table = '{heights = "h.asc", corner = [0, 0]}'
    text = GROUND.format(table=table)
    grid = _damaged(chance, "\n".join(lines).encode("utf-8", "replace"))
    return {"files": {"t.toml": text, "h.asc": grid}, "arguments": ["show", "t.toml"]}


def _heights(chance: random.Random) -> dict[str, Any]:
    size = chance.choice(((2, 2), (3, 40), (1, 5), (300, 300)))
    array = np.array([[chance.uniform(0.0, 0.1) for _ in range(size[1])] for _ in range(size[0])])
    stream, ending = io.BytesIO(), chance.choice((".npy", ".png", ".csv"))
    if ending == ".npy":
        np.save(stream, array.astype(chance.choice(("<f8", "<f4", ">i4", "?", "c16"))))
    elif ending == ".png":
        Image.fromarray((array * 65535.0).astype(chance.choice((np.uint16, np.uint8)))).save(stream, "PNG")
    else:
        np.savetxt(stream, array, delimiter=",")
    limits = ", range = [0, 0.1]" * (ending == ".png")
    table = f'{{heights = "h{ending}", corner = [0, 0], spacing = [1, 1]{limits}}}'
    text = GROUND.format(table=table)
    files = {"t.toml": text, f"h{ending}": _damaged(chance, stream.getvalue())}
    return {"files": files, "arguments": ["show", "t.toml"]}


def _check(chance: random.Random) -> dict[str, Any]:
    with zipfile.ZipFile(io.BytesIO(made["fmu"])) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    text = _edited(chance, files["modelDescription.xml"].decode())
    fmu = _damaged(chance, _zip(files | {"modelDescription.xml": text.encode("utf-8", "replace")}))
    arguments = ["check", "a.fmu", "--limit", "5", *chance.choice(([], ["--json"], ["--step", "1e-5"]))]
    return {"files": {"a.fmu": fmu}, "arguments": arguments}


def _rarely(chance: random.Random, usual: Any, odd: Any) -> Any:
    return chance.choice(tuple(odd)) if chance.random() < 0.03 else usual


def _edited(chance: random.Random, text: str) -> str:
    """A document with some attributes and tags changed, left out or doubled."""
    for _ in range(chance.choice((0, 0, 1, 1, 2, 5))):
        found = [*chance.choice((ATTRIBUTE, ATTRIBUTE, TAG)).finditer(text)]
        one = chance.choice(found)
        new = f'="{chance.choice((*ODD, chance.choice(found)[0][2:-1]))}"' if one[0][0] == "=" else ""
        new = one[0] * 2 if not new and chance.random() < 0.3 else new
        text = text[: one.start()] + new + text[one.end() :]
    return text


def _damaged(chance: random.Random, content: bytes) -> dict[str, str]:
    """Bytes of a file, rarely with some of them changed or cut off."""
    changed = bytearray(content)
    if chance.random() < 0.1:
        for _ in range(chance.choice((1, 3, 20))):
            changed[chance.randrange(len(changed))] = chance.randrange(256)
    if chance.random() < 0.05:
        del changed[chance.randrange(len(changed)) :]
    return {"bytes": base64.b64encode(changed).decode()}


def _zip(files: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return stream.getvalue()
