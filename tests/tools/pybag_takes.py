"""pybag tried: ``python -m tests.tools.pybag_takes FOLDER``. Needs cotrack and pybag-sdk==0.13.0."""

from pybag.mcap_reader import McapFileReader

from tests.tools.logs_made import log
from tests.tools.made import attempt, said

EXPECTED = {
    "topics": "5",
    "count of /chain/out": "2001",
    "messages, protobuf": "refused (McapUnknownEncodingError)",
}


def messages() -> str:
    with McapFileReader.from_file(file) as reader:
        return f"{sum(1 for _ in reader.messages('/chain/out'))} messages"


file = log()
with McapFileReader.from_file(file) as opened:
    FOUND = {
        "topics": f"{len(opened.get_topics())}",
        "count of /chain/out": f"{opened.get_message_count('/chain/out')}",
        "messages, protobuf": attempt(messages),
    }
said("pybag-sdk 0.13.0", FOUND, EXPECTED)
