"""Names that scenes, commands and results share: analyses and limits, with units and meanings."""


def and_list(parts: list[str]) -> str:
    """Parts of a sentence, the last two joined by "and"."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}" if parts else ""
