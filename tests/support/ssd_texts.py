"""Parts of an SSP archive: texts of its system, in the terms of the standard, and the file; an archive of two lags."""

import zipfile

from foreign_fmus import Variable

SPACES = " ".join(
    f'xmlns:{letters}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for letters, name in (
        ("ssd", "Description"),
        ("ssc", "Common"),
        ("ssv", "ParameterValues"),
        ("ssm", "ParameterMapping"),
        ("ssb", "SignalDictionary"),
    )
)
MILLIMETRES = (
    '<ssd:Units><ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit>'
    '<ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>'
    '<ssc:Unit name="s"><ssc:BaseUnit s="1"/></ssc:Unit></ssd:Units>'
)


def component(name, inner="", source="resources/gain.fmu"):
    return f'<ssd:Component name="{name}" source="{source}">{inner}</ssd:Component>'


def connectors(*kinds, unit=""):
    """Connectors by "name kind" or "name kind unit"."""
    made = ""
    for words in kinds:
        name, kind, *unit = words.split()
        of = f' unit="{unit[0]}"' if unit else ""
        made += f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real{of}/></ssd:Connector>'
    return f"<ssd:Connectors>{made}</ssd:Connectors>"


def connection(one, other, inside="", more=""):
    ends = []
    for which, end in (("start", one), ("end", other)):
        element, dot, connector = end.rpartition(".")
        ends.append((f'{which}Element="{element}" ' if dot else "") + f'{which}Connector="{connector}"')
    return f"<ssd:Connection {' '.join(ends)} {more}>{inside}</ssd:Connection>"


def values(prefix="", mapping="", **given):
    made = ""
    for name, (kind, value) in given.items():
        made += f'<ssv:Parameter name="{name.replace("__", ".")}"><ssv:{kind} value="{value}"/></ssv:Parameter>'
    parameters = f"<ssv:ParameterSet><ssv:Parameters>{made}</ssv:Parameters></ssv:ParameterSet>"
    content = f"<ssd:ParameterValues>{parameters}</ssd:ParameterValues>"
    if mapping:
        mapping = f"<ssd:ParameterMapping><ssm:ParameterMapping>{mapping}</ssm:ParameterMapping></ssd:ParameterMapping>"
    return f'<ssd:ParameterBinding prefix="{prefix}">{content}{mapping}</ssd:ParameterBinding>'


def bound(*bindings):
    return f"<ssd:ParameterBindings>{''.join(bindings)}</ssd:ParameterBindings>"


def system(elements, connections="", before="", name="system", more=""):
    return (
        f'<ssd:System name="{name}">{before}<ssd:Elements>{elements}</ssd:Elements>'
        f"<ssd:Connections>{connections}</ssd:Connections>{more}</ssd:System>"
    )


def document(top, after="", experiment='stopTime="0.003"', version="1.0"):
    return (
        f'<ssd:SystemStructureDescription {SPACES} version="{version}" name="t">{top}{after}'
        f"<ssd:DefaultExperiment {experiment}/></ssd:SystemStructureDescription>"
    )


def packed(file, ssd, **files):
    """Archive with FMUs and texts by names, in which / is __ and . is _."""
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("SystemStructure.ssd", ssd)
        for name, content in files.items():
            archive.writestr(name, content) if isinstance(content, str) else archive.write(content, name)
    return file


# --- two first-order lags, each the input of the other ------------------------------------------------

T1, T2, START = 0.2, 0.5, 3.0
LAG = (
    Variable("u", "input", unit="N"),
    Variable("x", "output", unit="N"),
    Variable("start", "parameter", 0.0, unit="N"),
    Variable("T", "parameter", 1.0, unit="s"),
    Variable("whole", "output", 0, "Integer"),
)
SSV = f"""<ssv:ParameterSet {SPACES} version="1.0" name="second"><ssv:Parameters>
<ssv:Parameter name="T"><ssv:Real value="{T2}"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>"""
FIRST = connectors("x output N") + bound(values(T=("Real", T1), start=("Real", START)))
LAGS = document(
    system(
        component("a", FIRST, "resources/lag.fmu")
        + component("b", bound('<ssd:ParameterBinding source="values/b.ssv"/>'), "resources/lag.fmu"),
        connection("a.x", "b.u") + connection("b.x", "a.u"),
        name="lags",
    ),
    experiment='startTime="0" stopTime="1"',
)


def packed_lags(file, lag, ssd=LAGS, **more):
    return packed(file, ssd, **{"values/b.ssv": SSV, "resources/lag.fmu": lag} | more)
