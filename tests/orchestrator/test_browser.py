"""The report in a real browser: nothing in its console, curves drawn, no wider than the window."""

import pytest
from browser import opened
from page_logs import vehicle_log

from orchestrator.execution.log_report import report

pytestmark = pytest.mark.long


def test_the_report_is_drawn_without_a_word_in_the_console(tmp_path_factory, tmp_path):
    report(vehicle_log(tmp_path_factory), tmp_path / "report.html")
    console, found = opened(tmp_path / "report.html", tmp_path)
    assert console == []
    for at in found:
        assert at["curves"] > 10
        assert at["pictures"] >= 1
        assert at["beyond"] <= 0


def test_an_error_and_a_wide_page_are_found(tmp_path):
    (tmp_path / "bad.html").write_text('<div style="width: 2000px">x</div><script>nothing.at.all()</script>')
    console, found = opened(tmp_path / "bad.html", tmp_path)
    assert "nothing is not defined" in console[0]
    assert [(at["curves"], at["beyond"] > 0) for at in found] == [(0, True)] * 2
