#!/usr/bin/env bash
# rosbags 0.11.9: the path of a ROS 2 bag in SQLite is part of a URI, so that %, ? and # in it name another file.
#
# A bag `run%31.db3` is read as `run1.db3` beside it, without an error: its messages are those of another ride. `run#1` is
# written as the file `run`, and cannot be read afterwards. MCAP bags are not affected. Users: no such names for .db3 bags.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet rosbags==0.11.9 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'PYTHON'
import shutil
from pathlib import Path

from rosbags.rosbag2 import Reader, ReaderError, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_HUMBLE)
Float = store.types["std_msgs/msg/Float64"]


def write(folder, value, plugin=StoragePlugin.SQLITE3):
    with Writer(Path(folder), version=9, storage_plugin=plugin) as bag:
        connection = bag.add_connection("/x", Float.__msgtype__, typestore=store)
        bag.write(connection, 1, store.serialize_cdr(Float(value), Float.__msgtype__))


def read(path):
    with Reader(Path(path)) as bag:
        return [store.deserialize_cdr(data, Float.__msgtype__).data for *_, data in bag.messages()]


write("a", 1.0), write("b", 31.0)
shutil.copy("a/a.db3", "run1.db3"), shutil.copy("b/b.db3", "run%31.db3")
other = read("run%31.db3")
try:
    write("run#1", 2.0)
    lost = read("run#1")
except ReaderError as error:
    lost = str(error)
write("ride#1", 3.0, StoragePlugin.MCAP)
print(other, lost, [file.name for file in Path("run#1").glob("*")], read("ride#1"))
assert other == [1.0], "the file that is named is read"
assert "missing" in lost, "a name with # is written and read"
assert read("ride#1") == [3.0]
PYTHON
echo "as described"
