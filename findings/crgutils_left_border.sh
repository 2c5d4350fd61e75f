#!/usr/bin/env bash
# crgutils 0.1.1: a road ends at its second last long section, and modifiers of its place do nothing.
#
# The file is plain ASAM OpenCRG 1.2: a straight reference line, three long sections at v = -1, 0 and 1 m
# with heights of 0.1, 0.2 and 0.4 m everywhere, and the modifier REFLINE_OFFSET_Z = 2. At the left border, v = 1 m, the
# height is 2.4 m, and 2.3 m half a section before it. crgutils.read, which says that it applies the modifiers of the file,
# gives 0.2 m at both places. pycrg 2.2.0 (ASAM's C library) and PyOpenCRG 0.2.2 give 2.4 m and 2.3 m. Users: take one of
# them.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet crgutils==0.1.1 pycrg==2.2.0 pyopencrg==0.2.2 numpy==2.4.6
cat >"$folder/road.crg" <<'ROAD'
$CT
three long sections of different heights
$
$ROAD_CRG
REFERENCE_LINE_INCREMENT = 1.0
LONG_SECTION_V_RIGHT = -1.0
LONG_SECTION_V_LEFT = 1.0
LONG_SECTION_V_INCREMENT = 1.0
$
$ROAD_CRG_MODS
REFLINE_OFFSET_Z = 2.0
$
$KD_DEFINITION
#:LRFI
D:long section 1,m
D:long section 2,m
D:long section 3,m
$
$$$$
 0.1000000 0.2000000 0.4000000
 0.1000000 0.2000000 0.4000000
 0.1000000 0.2000000 0.4000000
ROAD
"$folder/env/bin/python" - "$folder/road.crg" <<'PYTHON'
import sys

import crgutils
import pycrg
import pyopencrg

contact = crgutils.read(sys.argv[1]).create_contact_point()
road = pyopencrg.read(sys.argv[1], apply_mods=True)
with pycrg.RoadSurface.open(sys.argv[1]) as surface:
    by_asam = [round(surface.uv_to_z(1.0, v), 6) for v in (0.5, 1.0)]
by_numpy = [round(float(road.uv_to_z(1.0, v)), 6) for v in (0.5, 1.0)]
found = [round(float(contact.eval_uv_to_z(1.0, v)), 6) for v in (0.5, 1.0)]
print(f"heights at v = 0.5 and 1 m: pycrg {by_asam}, PyOpenCRG {by_numpy}, crgutils {found}")
assert by_asam == by_numpy == [2.3, 2.4], "the other two have changed"
assert found == [0.2, 0.2], "crgutils has changed"
PYTHON
echo "as described"
