"""The pages of the book: their files, commands, Python and output are real."""

import ast
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pandas
import pytest
import yaml
from conftest import click_command, messages

from orchestrator.cli import app
from orchestrator.studies import pool

ROOT = Path(__file__).parents[2]
BOOK = ROOT / "orchestrator"
# Pages that are worked through one after the other in one folder, because later ones use logs of earlier ones.
READ = {
    "tutorial": ["orchestrator/tutorial.md"],
    "first visit": ["README.md", "orchestrator/results.md", "orchestrator/measured_data.md"],
    "scenes": ["orchestrator/scenes.md"],
    "running": ["orchestrator/running.md"],
    "studies": ["orchestrator/studies.md"],
    "FMUs": ["orchestrator/your_fmus.md"],
    "analyses": ["orchestrator/analyses.md"],
    "accuracy": ["orchestrator/accuracy.md"],
    "formulas": ["orchestrator/formulas.md"],
}
PAGES = [page for pages in READ.values() for page in pages]
# Blocks of no output: text; a drawing; commands for a shell (installation, lists), of which only names are checked.
PRINTED = {"text", "sh", "mermaid"}
RUN = {"console", "python", "toml"}

BLOCK = re.compile(r"(?:^`([\w.]+)`:\n\n)?^```(\w*)\n(.*?)^```$(?:\n\n```text\n(.*?)^```$)?", re.DOTALL | re.MULTILINE)
COMMAND = re.compile(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)
# What depends on the machine and is shown as an example.
MEASURED = re.compile(
    r"simulated in \S+ s, \S+ times (?:as fast as|slower than) real time"
    r"|(?<=  further times      ).*|(?<=\.mcap )\(\S+ [kM]B\)"
)


class Block(NamedTuple):
    """Block of a page."""

    file: str  # name of the file whose content it is; "" if none
    language: str
    text: str
    output: str  # of Python


def blocks(page):
    return [Block(*found) for found in BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))]


def pattern(shown):
    """Pattern of an output that is shown with "..." for what is left out, within a line or whole lines."""
    return re.compile(
        "".join(
            r"(?:.*\n)*?" if line.strip() == "..." else ".*?".join(map(re.escape, line.split("..."))) + "\n"
            for line in shown
        )
    )


def missing(shown, printed):
    """First shown line without which the rest would be printed; None if all is printed."""
    lines, printed = MEASURED.sub("", shown).splitlines(), MEASURED.sub("", printed)
    for k in range(1, len(lines) + 1):
        if not pattern(lines[:k]).match(printed):
            return lines[k - 1]
    return None if not lines or lines[-1].strip() == "..." or pattern(lines).fullmatch(printed) else "the end"


FAST = "  8 s simulated in 2.8 s, 2.84 times as fast as real time\n  further times      start-up 0.96 s, estimate 4 s\n"
SLOW = "  8 s simulated in 9.8 s, 1.2 times slower than real time\n  further times      start-up 12 s, estimate 14 s\n"
THREE = "one\ntwo 2\nthree\n"


@pytest.mark.parametrize(("shown", "printed", "lacks"), [
    ("one\n...\nthree\n", THREE, None), ("one\ntwo ...\nthree\n", THREE, None), ("one\n...\n", THREE, None),
    ("one\n  ...\n", THREE, None), ("", THREE, None), ("one\nthree\n", THREE, "three"), ("...\nfour\n", THREE, "four"),
    ("one\ntwo 2\n", THREE, "the end"), (FAST, SLOW, None), (FAST, SLOW.replace("8 s", "7 s", 1), FAST.splitlines()[0]),
    ("  log logs/a.mcap (55.3 MB)\n", "  log logs/a.mcap (900 kB)\n", None),
    ("  log logs/a.mcap (55.3 MB)\n", "  log logs/b.mcap (55.3 MB)\n", "  log logs/a.mcap "),
])  # fmt: skip
def test_what_is_shown_is_compared(shown, printed, lacks):
    assert missing(shown, printed) == (MEASURED.sub("", lacks) if lacks else None)


@pytest.mark.parametrize("page", PAGES)
def test_every_block_is_run_or_declared(page):
    """No block escapes the comparison by its language, by an output that nothing printed or by an odd fence."""
    found = blocks(page)
    text = (ROOT / page).read_text(encoding="utf-8")
    assert text.count("```") == 2 * sum(1 + bool(block.output) for block in found)
    for block in found:
        assert block.language in RUN | PRINTED, block
        assert block.file or block.language != "toml", block
        assert block.language == "python" or not block.output, block
        if block.language == "console":
            assert block.text == "".join(f"$ {line}\n{shown}" for line, shown in COMMAND.findall(block.text))
        if block.language == "python" and "print(" in block.text and not block.file:
            assert block.output, "prints, but shows nothing"


def test_named_modules_exist():
    text = (BOOK / "formulas.md").read_text(encoding="utf-8")
    named = re.findall(r"`([\w/]+/\w+\.py)`", text)
    assert len(named) > 40
    assert [path for path in named if not (ROOT / path).is_file()] == []


def test_listed_commands_are_known():
    """Every command of the list, without comments and of "a|b" the first, exists with its options."""
    text = "".join(block.text for block in blocks("orchestrator/commands.md") if block.language == "sh")
    lines = [shlex.split(line.partition(" #")[0]) for line in text.splitlines() if line.startswith("cotrack ")]
    assert len(lines) == 52
    for _, *words in lines:
        parse([word.partition("|")[0] for word in words])
    with pytest.raises(Exception, match="no-such-option"):
        parse(["run", "straight", "--no-such-option"])


def test_commands_of_the_workflow_are_known():
    """The workflow calls commands and options that exist, and the checks of a clone."""
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "checks.yml").read_text(encoding="utf-8"))["jobs"]
    lines = [line for job in jobs.values() for step in job["steps"] for line in step.get("run", "").splitlines()]
    assert ".ci/run" in lines
    calls = [line.partition("cotrack ")[2] for line in lines if re.search(r"(^|bin/)cotrack ", line)]
    assert len(calls) == 5
    for call in calls:
        parse(shlex.split(call))


def parse(arguments):
    """Parse arguments; raises click's error for an unknown command or option."""
    command = click_command(app)
    while hasattr(command, "commands"):
        name, *arguments = arguments
        assert name in command.commands, name
        command = command.commands[name]
    command.make_parser(command.context_class(command)).parse_args(list(arguments))


def printed_by(line, cotrack):
    """Refusals and stdout of a command line."""
    words = shlex.split(line, comments=True)
    if words[0] == "cotrack" and not {"|", ">"} & set(words):
        _, out, err = cotrack(*words[1:])
        return "".join(f"{each}\n" for each in err.splitlines() if each.startswith("cotrack: ")) + out
    shell = f'cotrack() {{ "{sys.executable}" -m orchestrator "$@"; }}\npython() {{ "{sys.executable}" "$@"; }}\n'
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = ["bash", "-c", shell + line]
    done = subprocess.run(command, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True)
    assert done.returncode == 0, (line, messages(done.stderr))
    return done.stdout


@pytest.mark.long
@pytest.mark.parametrize("pages", READ.values(), ids=READ)
def test_pages_print_what_they_show(pages, cotrack, tmp_path, monkeypatch, capsys):
    """In the order of the pages: files are written, commands and Python are run."""
    monkeypatch.chdir(tmp_path)
    # In this process and thread: worker processes would load all kernels again, threads spin while they wait.
    monkeypatch.setattr(pool, "_in_processes", lambda cases, left, _: ((k, *pool.attempt(cases[k])) for k in left))
    monkeypatch.setattr("orchestrator.cosim.program.processors", lambda: 1)
    Path("tests").symlink_to(ROOT / "tests")
    names = {}
    for page, block in ((name, block) for name in pages for block in blocks(name)):
        shown = []
        if block.file:
            Path(block.file).write_text(block.text, encoding="utf-8")
        elif block.language == "console":
            shown = [(line, text, printed_by(line, cotrack)) for line, text in COMMAND.findall(block.text)]
        elif block.language == "python":
            exec(compile(block.text, page, "exec"), names)
            shown = [("python", block.output, capsys.readouterr().out)]
        for line, text, printed in shown:
            lacks = missing(text, printed)
            assert lacks is None, f"{page}, {line}: {lacks!r} is not printed\n{printed}"


@pytest.mark.long
def test_the_notebook_runs(tmp_path, monkeypatch):
    """Its cells in order; the value of each last line is the output that it has."""
    monkeypatch.chdir(tmp_path)
    notebook = json.loads((BOOK / "first_steps.ipynb").read_text(encoding="utf-8"))
    names, values, shown = {}, [], []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            *body, last = ast.parse("".join(cell["source"])).body
            exec(compile(ast.Module(body, []), "cell", "exec"), names)
            values.append(eval(compile(ast.Expression(last.value), "cell", "eval"), names))
            shown += ["".join(output["data"]["text/plain"]) for output in cell["outputs"]]
    wrapped = {"\\"}  # lines of tables, by the width of the terminal
    with pandas.option_context("display.max_columns", 20):  # as in a notebook
        assert [{*text.split()} - wrapped for text in shown] == [{*repr(value).split()} - wrapped for value in values]
    assert names["run"].ok
    light, heavy = (run["left_track.tension.max"].values.max() for run in (names["run"], names["other"]))
    assert 0.9 * light < heavy != light
    sags = names["table"].frame()["sag"]
    assert sags.is_monotonic_decreasing
    assert {file.name for file in tmp_path.iterdir()} == {"logs", "spans"}
