#!/usr/bin/env bash
# rosbags 0.11.9: an MCAP file without chunks is refused where a message was recorded after one with a later time.
#
# MCAP does not ask for an order of messages, and recorders with several threads do not keep one. The same messages in chunks
# are read, sorted by time, and mcap 1.6.0 reads and sorts both files. The message speaks of an index ("Unindexed MCAP
# messages are not in timestamp order. Use an indexed file."), which `mcap sort` or a file with chunks gives. Users: cotrack
# reads both, because it takes the records by mcap and only their definitions and contents by rosbags.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet rosbags==0.11.9 mcap==1.6.0 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'PYTHON'
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import Reader, ReaderError
from rosbags.typesys import Stores, get_typestore

KIND, TIMES = "std_msgs/msg/Float64", [1, 3, 2]
store = get_typestore(Stores.ROS2_HUMBLE)
definition = store.generate_msgdef(KIND, ros_version=2)[0].encode()


def write(chunked):
    path = Path(f"{chunked}.mcap")
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=chunked, compression=CompressionType.NONE)
        writer.start("ros2", "finding")
        channel = writer.register_channel("/x", "cdr", writer.register_schema(KIND, "ros2msg", definition))
        for t in TIMES:
            data = bytes(store.serialize_cdr(store.types[KIND](float(t)), KIND))
            writer.add_message(channel, log_time=t, publish_time=t, data=data)
        writer.finish()
    return path


def by_mcap(path):
    with path.open("rb") as file:
        return [message.log_time for *_, message in make_reader(file).iter_messages()]


def by_rosbags(path):
    try:
        with Reader(path) as bag:
            return [t for _, t, _ in bag.messages()]
    except ReaderError as error:
        return str(error)


chunks, none = write(True), write(False)
print("in chunks:", by_mcap(chunks), by_rosbags(chunks))
print("without:", by_mcap(none), by_rosbags(none))
assert by_mcap(chunks) == by_mcap(none) == by_rosbags(chunks) == [1, 2, 3]
assert "not in timestamp order" in by_rosbags(none)
PYTHON
echo "as described"
