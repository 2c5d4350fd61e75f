"""Values as TOML text."""

from __future__ import annotations

import json
import re
from typing import Any


def toml_text(value: Any) -> str:
    """Text of a number, a text, a list or a table, which becomes an inline table."""
    if isinstance(value, dict):
        entries = [f"{_key(key)} = {toml_text(entry)}" for key, entry in value.items()]
        return f"{{ {', '.join(entries)} }}" if entries else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_text, value))}]"
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False)


def _key(key: str) -> str:
    return key if re.fullmatch(r"[\w-]+", key, re.ASCII) else json.dumps(key, ensure_ascii=False)
