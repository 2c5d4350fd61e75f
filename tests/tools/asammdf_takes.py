"""asammdf tried: ``python -m tests.tools.asammdf_takes FOLDER``.

Needs cotrack, asammdf==8.8.28, pandas==3.1.1, pyarrow==26.0.1.
"""

import pandas as pd
from asammdf import MDF

from tests.tools.logs_made import exported, log
from tests.tools.made import attempt, said

EXPECTED = {
    "csv opened": "refused (MdfException)",
    "parquet opened": "refused (MdfException)",
    "mat opened": "refused (MdfException)",
    "csv as a table": "equal, no unit",
    "parquet as a table": "equal, no unit",
}


def opened(form: str) -> str:
    MDF(exported(file, form))
    return "read"


def kept(form: str) -> str:
    source = exported(file, form)
    frame = pd.read_csv(source) if form == "csv" else pd.read_parquet(source)
    numbers = frame.set_index(frame.columns[0])
    mdf, target = MDF(), file.parent / "loop.mf4"
    mdf.append(numbers)
    mdf.save(target, overwrite=True)
    name = next(each for each in numbers if each.startswith("chain.speed"))
    back = MDF(target).get(name)
    same = "equal" if (back.samples == numbers[name].to_numpy()).all() else "not equal"
    return f"{same}, {back.unit or 'no unit'}"


file = log()
FOUND = {f"{form} opened": attempt(lambda form=form: opened(form)) for form in ("csv", "parquet", "mat")}
FOUND |= {f"{form} as a table": attempt(lambda form=form: kept(form)) for form in ("csv", "parquet")}
said("asammdf 8.8.28", FOUND, EXPECTED)
