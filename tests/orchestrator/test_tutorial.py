"""The tutorial: its files, commands and output are real."""

import ast
import json
import re
import shlex
from pathlib import Path

import pytest

import orchestrator

PAGE = Path(orchestrator.__file__).parent / "tutorial.md"
FILE = re.compile(r"^`([\w.]+)`:\n\n```\w+\n(.*?)^```", re.DOTALL | re.MULTILINE)
BLOCK = re.compile(r"^```(console|python)\n(.*?)^```(?:\n\n```text\n(.*?)^```)?", re.DOTALL | re.MULTILINE)
COMMAND = re.compile(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)


def pattern(shown):
    """Pattern of an output that is shown with "..." for what is left out, within a line or whole lines."""
    lines = [r"(?:.*\n)*?" if line == "..." else ".*?".join(map(re.escape, line.split("..."))) + "\n" for line in shown]
    return re.compile("".join(lines))


def missing(shown, printed):
    """First shown line without which the rest would be printed; None if all is printed."""
    lines = shown.splitlines()
    return next((lines[k - 1] for k in range(1, len(lines) + 1) if not pattern(lines[:k]).match(printed)), None)


def test_what_is_shown_is_compared():
    printed = "one\ntwo 2\nthree\n"
    assert missing("one\n...\nthree\n", printed) is None
    assert missing("one\ntwo ...\nthree\n", printed) is None
    assert missing("one\nthree\n", printed) == "three"
    assert missing("...\nfour\n", printed) == "four"


@pytest.mark.long
def test_the_tutorial_prints_what_it_shows(cotrack, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    page = PAGE.read_text(encoding="utf-8")
    files = dict(FILE.findall(page))
    assert {*files} == {"stop_and_go.toml", "speed.csv"}
    for name, content in files.items():
        Path(name).write_text(content)
    commands = 0
    for language, block, expected in BLOCK.findall(page):
        if language == "python":
            exec(block, {})
            assert missing(expected, capsys.readouterr().out) is None
            continue
        for line, shown in COMMAND.findall(block):
            name, *arguments = shlex.split(line)
            assert name == "cotrack"
            _, out, err = cotrack(*arguments)
            refused = "".join(f"{each}\n" for each in err.splitlines() if each.startswith("cotrack: "))
            assert (line, missing(shown, refused + out)) == (line, None)
            commands += 1
    assert commands == page.count("\n$ cotrack ")
    assert Path("tension.csv").read_text().splitlines()[0] == "t [s],left_track.tension.max [N],chassis.speed [m/s]"


@pytest.mark.long
def test_the_notebook_runs(tmp_path, monkeypatch):
    """Its cells in order; the value of each last line is shown by a notebook."""
    monkeypatch.chdir(tmp_path)
    notebook = json.loads((PAGE.parent / "first_steps.ipynb").read_text(encoding="utf-8"))
    names, values = {}, []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            *body, last = ast.parse("".join(cell["source"])).body
            exec(compile(ast.Module(body, []), "cell", "exec"), names)
            values.append(eval(compile(ast.Expression(last.value), "cell", "eval"), names))
    assert all(value is not None for value in values)
    assert names["run"].ok
    light, heavy = (run["left_track.tension.max"].values.max() for run in (names["run"], names["other"]))
    assert 0.9 * light < heavy != light
    sags = names["table"].frame()["sag"]
    assert sags.is_monotonic_decreasing
    assert {file.name for file in tmp_path.iterdir()} == {"logs", "spans"}
