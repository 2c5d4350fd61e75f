#!/usr/bin/env bash
# asammdf 8.8.28: CAN frames that are shorter than their message are decoded as if zeros followed.
#
# A message of 6 bytes has its speed in bytes 4 and 5, times 0.01 km/h, less 20. Of ten frames with 36 km/h two end after
# byte 3. extract_bus_logging with the DBC file gives ten speeds, -20 for the two, without a word, and without invalidation
# bits. cantools refuses a frame of 4 bytes by itself. Users: drop frames whose length is below that of their message
# before they decode, or decode with cantools.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet asammdf==8.8.28 cantools==45.1.0 python-can==4.6.1 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'PYTHON'
import struct
from pathlib import Path

import can
import cantools
from asammdf import MDF

Path("v.dbc").write_text('''VERSION ""
BU_: ECU
BO_ 100 Body: 6 ECU
 SG_ Speed : 32|16@1+ (0.01,-20) [0|0] "km/h" ECU
''')
frames = [struct.pack("<IH", 0, 5600)[: 4 if k in (3, 7) else 6] for k in range(10)]
with can.Logger("v.mf4") as log:
    for k, data in enumerate(frames):
        log(can.Message(timestamp=1.7644e9 + 0.1 * k, arbitration_id=100, is_extended_id=False, data=data, channel=1))
signal = MDF("v.mf4").extract_bus_logging({"CAN": [("v.dbc", 0)]}).get("Speed", ignore_invalidation_bits=True)
speeds = [round(float(value), 6) for value in signal.samples]
print("speeds", speeds, "invalid", signal.invalidation_bits)
assert speeds == [-20.0 if k in (3, 7) else 36.0 for k in range(10)]
assert signal.invalidation_bits is None or not any(signal.invalidation_bits)
message = cantools.database.load_file("v.dbc").get_message_by_frame_id(100)
assert message.decode(frames[0])["Speed"] == 36.0
try:
    message.decode(frames[3])
except cantools.database.DecodeError as refusal:
    print("cantools:", refusal)
else:
    raise AssertionError("cantools decodes a short frame")
PYTHON
echo "as described"
