"""A vehicle of FMUs of FMI 3.0 whose terminals are connected."""

from __future__ import annotations

from fmi3_instance import Three, scalars
from lxml import etree

from orchestrator.fmi.fmu_files import unpack


class Plugged(Three):
    """Instance whose terminals are connected by the rule "plug": members by name, outputs to inputs."""

    def __init__(self, file):
        super().__init__(file)
        self.variables = {v.name: v for v in self.description.modelVariables}
        root = etree.parse(unpack(file) / "terminalsAndIcons/terminalsAndIcons.xml")
        self.terminals = {t.get("name"): {m.get("memberName"): m.get("variableName") for m in t} for t in
                          root.iter("Terminal")}  # fmt: skip
        self.feeds = []

    def plug(self, terminal, other, others):
        ours, theirs = self.terminals[terminal], other.terminals[others]
        assert ours.keys() == theirs.keys()
        for member in ours:
            mine, its = self.variables[ours[member]], other.variables[theirs[member]]
            assert {mine.causality, its.causality} == {"input", "output"}
            taker, to, giver, of = (self, mine, other, its) if mine.causality == "input" else (other, its, self, mine)
            taker.feeds.append((to.valueReference, giver.slave, of.valueReference, of.shape[0]))

    def read(self):
        """Values for all connected inputs."""
        return [(to, giver.getFloat64([of], size)) for to, giver, of, size in self.feeds]

    def step(self, t, h, values):
        for to, each in values:
            self.slave.setFloat64([to], each)
        self.slave.doStep(t, h)

    def show(self, names):
        """Values of outputs, in a row."""
        found = [self.variables[name] for name in names]
        return self.slave.getFloat64([v.valueReference for v in found], sum(len(scalars(v)) for v in found))


SIDES = ("left", 1.0), ("right", -1.0)
PROFILE = {"speed.end": 20.5, "ramp.start": 0.0, "ramp.end": 0.2}
WHEELS = *(f"road_wheel[{i}]" for i in range(1, 6)), "idler"


def parts_of_a_vehicle():
    """Parts in the order of their steps: their kinds, and the parameters that are not the FMU's defaults."""
    parts = {}
    for part, kind, more in (("track", "Track", {}), ("drive", "SprocketDrive", PROFILE)):
        for side, sign in SIDES:
            parts[f"{side}_{part}"] = kind, {"start.lateral": sign * 1.0795, **more}
    return parts | {"chassis": ("Chassis", {})}


def pairs_of_terminals():
    """Pairs that are connected: part and terminal, part and terminal."""
    for side, _ in SIDES:
        track, drive = f"{side}_track", f"{side}_drive"
        yield track, "sprocket", drive, "sprocket"
        yield drive, "mount", "chassis", f"{side}.sprocket"
        yield from ((track, wheel, "chassis", f"{side}.{wheel}") for wheel in WHEELS)


def plugged_vehicle(folder, track):
    """Parts of a vehicle, connected by terminals and initialised."""
    parts = parts_of_a_vehicle()
    kinds = {name: track if kind == "Track" else kind for name, (kind, _) in parts.items()}
    fmus = {name: Plugged(folder / f"{kind}.fmu") for name, kind in kinds.items()}
    for one, terminal, other, others in pairs_of_terminals():
        fmus[one].plug(terminal, fmus[other], others)
    for name, (_, values) in parts.items():
        for parameter, value in values.items():
            fmus[name].slave.setFloat64([fmus[name].variables[parameter].valueReference], [value])
        fmus[name].start({})
    return fmus
