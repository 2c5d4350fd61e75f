"""Elements of the suspension, each as changes of a vehicle table."""

from chassis_probe import TABLE

LINE = {key: TABLE["suspension"][key] for key in ("on_arm", "on_chassis")}
SLOW = {"rotary_damper": {"damping": 3e3, "wheels": None}}
BAR = {"stiffness": 1.2e5, "preset": 0.1, "wheels": None}
CURVE = {"compression": (-0.1, 0.0, 0.02, 0.1), "force": (-2e4, 0.0, 2e4, 2.2e5), "wheels": None}
GAS = {
    "pressure": 8e6, "area": 3e-3, "volume": 9e-4, "exponent": 1.3, "ambient": 101325.0, "wheels": None,
}  # fmt: skip
DAMPER = {"speed": (-1.0, -0.2, 0.0, 0.3, 1.0), "force": (-1.5e4, -9e3, 0.0, 3e3, 5e3), "wheels": None}
STOP = {"gap": 0.02, "stiffness": 4e5, "damping": 0.0, "wheels": None}
ELEMENTS = {
    "torsion_bar": {"torsion_bar": BAR},
    "spring": {**LINE, "spring": CURVE},
    "gas_spring": {**LINE, "gas_spring": GAS},
    "isothermal": {**LINE, "gas_spring": {**GAS, "exponent": 1.0}},
    "damper": {**LINE, "damper": DAMPER},
    "rotary_damper": SLOW,
    "bump_stop": {"bump_stop": {**STOP, "damping": 3e3}},
    "rebound_stop": {"rebound_stop": {**STOP, "damping": 3e3}},
}
LAST = {
    name: {**table, "wheels": (5,)} for each in ELEMENTS.values() for name, table in each.items() if name not in LINE
}
FAR = {**TABLE["tensioner"], "recoil": {"preload": 1e9, "stiffness": 1e5}}
