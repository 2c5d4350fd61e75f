"""Names that scenes, commands and results share: measures, analyses and limits, with units and meanings."""
