"""Run libcosim on the system in the JSON file argv[1]; the final Real outputs replace the file's content.

The system: {"h": ns, "steps", "parts": [{"name", "fmu", "outputs": [value references]}], "wires": [[source, output,
target, input]]}. Each component receives the outputs of its peers at the communication point.
"""

import json
import sys

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

with open(sys.argv[1]) as file:
    system = json.load(file)
execution, observer = CosimExecution.from_step_size(system["h"]), CosimObserver.create_last_value()
places = [execution.add_local_slave(CosimLocalSlave(part["fmu"], part["name"])) for part in system["parts"]]
for source, output, target, into in system["wires"]:
    assert execution.connect_real_variables(places[source], output, places[target], into) == 0
execution.add_observer(observer)
assert execution.step(system["steps"])
shown = [
    [value.hex() for value in observer.last_real_values(place, part["outputs"])]
    for place, part in zip(places, system["parts"], strict=True)
]
with open(sys.argv[1], "w") as file:
    json.dump(shown, file)
