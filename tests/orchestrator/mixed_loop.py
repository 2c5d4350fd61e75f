"""Two FMUs of the user with inputs and outputs of all FMI types, and their loop by fmpy alone."""

import foreign_fmus
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from foreign_fmus import Variable, library_of

H, STEPS = 0.01, 60
GEARS = ("low", "high", "road")
MIXED = (
    Variable("u", "input", 0.5, unit="N"),
    Variable("x", "output", unit="N"),
    Variable("warmth_in", "input", 300.0, unit="K"),
    Variable("warmth", "output", unit="K"),
    Variable("T", "parameter", 0.1, unit="s"),
    Variable("start", "parameter", 2000.0, unit="N"),
    Variable("warmth_start", "parameter", 290.0, unit="K"),
    Variable("limit", "parameter", 1000.0, unit="N"),
    Variable("longest", "parameter", 1e9, unit="s"),
    Variable("end", "parameter", 1e9, unit="s"),
    Variable("gear_in", "input", 1, "Enumeration", items=GEARS),
    Variable("count_in", "input", 3, "Integer"),
    Variable("forward_in", "input", True, "Boolean"),
    Variable("word_in", "input", "go", "String"),
    Variable("word", "output", "", "String"),
    Variable("forward", "output", False, "Boolean"),
    Variable("count", "output", 0, "Integer"),
    Variable("gear", "output", 1, "Enumeration", items=GEARS),
)
UNITS = {
    "N": {"kg": 1, "m": 1, "s": -2},
    "kN": {"kg": 1, "m": 1, "s": -2, "factor": 1000.0},
    "K": {"K": 1},
    "degC": {"K": 1, "offset": 273.15},
    "s": {"s": 1},
    "mm": {"m": 1, "factor": 1e-3},
}
OTHER_UNITS = {"N": "kN", "K": "degC"}
COLD = {"start": 1.5, "warmth_start": 40.0, "limit": 0.8, "T": 0.05}  # of b, in kN and degC
PAIRS = {"u": "x", "warmth_in": "warmth", "count_in": "count", "gear_in": "gear", "forward_in": "forward"}
PAIRS |= {"word_in": "word"}
# value in the unit of the receiver = factor * value + offset
CONVERSIONS = {
    "a": {"u": (1000.0, 0.0), "warmth_in": (1.0, 273.15)},
    "b": {"u": (1.0 / 1000.0, 0.0), "warmth_in": (1.0, -273.15)},
}
KINDS = {variable.name: variable.kind.replace("Enumeration", "Integer") for variable in MIXED}


def changed(fmu, file, change, other_units=OTHER_UNITS):
    """The model with other variables in its description."""
    variables = [change(each._replace(unit=other_units.get(each.unit, each.unit))) for each in MIXED]
    return foreign_fmus.build(file, "mixed", variables, UNITS, library_of(fmu), states=True)


class Own:
    """An FMU by fmpy alone."""

    def __init__(self, file, name, parameters, folder):
        described = read_model_description(str(file))
        self._fmu = FMU2Slave(
            guid=described.guid,
            modelIdentifier="mixed",
            unzipDirectory=extract(str(file), unzipdir=str(folder / name)),
            instanceName=name,
        )
        self._references = {variable.name: variable.valueReference for variable in described.modelVariables}
        self._fmu.instantiate()
        self._fmu.setupExperiment(startTime=0.0, stopTime=H * STEPS)
        for parameter, value in parameters.items():
            self._fmu.setReal([self._references[parameter]], [value])
        self._fmu.enterInitializationMode()
        self.step = self._fmu.doStep
        self.y = {}

    def start(self):
        self._fmu.exitInitializationMode()
        self.read()

    def set(self, values):
        for name, value in values.items():
            getattr(self._fmu, f"set{KINDS[name]}")([self._references[name]], [value])

    def read(self):
        found = {out: getattr(self._fmu, f"get{KINDS[out]}")([self._references[out]])[0] for out in PAIRS.values()}
        self.y = {out: value.decode() if isinstance(value, bytes) else value for out, value in found.items()}

    def close(self):
        self._fmu.terminate()
        self._fmu.freeInstance()


def own_loop(files, folder, coupling, stage):
    """Values of all inputs of each step, and of all outputs at its ends, by instance and variable."""
    fmus = {"a": Own(files["a"], "a", {}, folder), "b": Own(files["b"], "b", COLD, folder)}
    peers, groups = {"a": "b", "b": "a"}, ("a", "b") if stage and coupling != "jacobi" else ("ab",)

    def given(name, values):
        converted = {into: values[out] for into, out in PAIRS.items()}
        for into, (factor, offset) in CONVERSIONS[name].items():
            converted[into] = factor * converted[into] + offset
        return converted

    order, before = "ba" if stage else "ab", None  # the last stage first
    for name in order:  # with the start values of inputs
        fmus[name].read()
    while before != (before := {name: fmus[name].y for name in order}):  # until all stands still
        for name in order:
            fmus[name].set(given(name, fmus[peers[name]].y))
            fmus[name].read()
    for name in order:
        fmus[name].set(given(name, fmus[peers[name]].y))
        fmus[name].start()
    inputs = {name: {into: [] for into in PAIRS} for name in fmus}
    outputs = {name: {out: [fmus[name].y[out]] for out in PAIRS.values()} for name in fmus}
    past = None
    for k in range(STEPS):
        now = {name: fmu.y for name, fmu in fmus.items()}
        for group in groups:
            for name in group:
                values = dict(now[peers[name]])  # discrete values are those of the communication point
                for out in ("x", "warmth"):
                    if len(groups) == 2 and name == "b":
                        after = fmus["a"].y[out]
                        values[out] = after if coupling == "gauss_seidel" else 0.5 * (values[out] + after)
                    elif coupling != "gauss_seidel" and past is not None:
                        values[out] += 0.5 * H / H * (values[out] - past[peers[name]][out])
                fmus[name].set(chosen := given(name, values))
                for into, value in chosen.items():
                    inputs[name][into].append(value)
            for name in group:
                fmus[name].step(k * H, H)
                fmus[name].read()
                for out, value in fmus[name].y.items():
                    outputs[name][out].append(value)
        past = now
    for fmu in fmus.values():
        fmu.close()
    return inputs, outputs
