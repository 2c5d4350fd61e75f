#!/usr/bin/env bash
# numba 0.68.1: with debug information a function whose body is its docstring alone does not compile.
#
# `@njit(debug=True)`, and NUMBA_DEBUGINFO=1 for every function, end with "IndexError: list index out of range" in numba
# itself, where the same function compiles without debug information, and with `pass` in place of the docstring with it. Such
# functions are what overloads and optional parts of kernels are where there is nothing to do, so a profile by source lines
# (perf, callgrind) of a package that has one fails at its first call. Users: give the function a statement.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet numba==0.68.1 llvmlite==0.50.0 numpy==2.4.6
cd "$folder"
cat > functions.py <<'PYTHON'
import numba


def documented(x):
    """Nothing is done."""


def passing(x):
    pass


def answer(function, **options):
    try:
        return numba.njit(**options)(function)(1.0)
    except Exception as error:
        return f"{type(error).__name__}: {error}".splitlines()[0]


print([answer(documented), answer(passing, debug=True), answer(documented, debug=True)])
PYTHON
found=$("$folder/env/bin/python" functions.py)
echo "$found"
[[ $found == "[None, None, 'IndexError: list index out of range']" ]] || { echo "it behaves differently now"; exit 1; }
echo "as described"
