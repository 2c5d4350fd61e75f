"""Pages in Chromium: what its console says, and what it has drawn at the widths of a telephone and of a desk."""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

WIDTHS = 390, 1280  # px
COUNT = """
<script>addEventListener("load", () => setTimeout(() => {
  const look = ({ contentDocument: page }) => ({
    curves: page.querySelectorAll(".js-line").length,
    pictures: [...page.querySelectorAll("canvas, img")].filter((one) => one.tagName === "IMG" ? one.naturalWidth :
      one.getContext("2d").getImageData(0, 0, one.width, one.height).data.some(Boolean)).length,
    beyond: page.documentElement.scrollWidth - page.documentElement.clientWidth,
  });
  document.body.dataset.found = JSON.stringify([...document.querySelectorAll("iframe")].map(look));
}, 3000))</script>
"""


def opened(page: Path, folder: Path) -> tuple[list[str], list[dict[str, int]]]:
    """Messages of the console, and by width the curves and pictures that are drawn, and pixels beyond the page.

    The test is left out where there is no Chromium.
    """
    if not (chromium := shutil.which("chromium")):
        pytest.skip("there is no chromium")
    frames = "".join(f'<iframe src="{page.as_uri()}" width="{width}" height="900"></iframe>' for width in WIDTHS)
    (folder / "frames.html").write_text(f"<!doctype html><body>{frames}{COUNT}</body>", encoding="utf-8")
    command = [
        chromium, "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'profile'}",
        "--allow-file-access-from-files", "--virtual-time-budget=20000", "--enable-logging=stderr", "--dump-dom",
        (folder / "frames.html").as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    found = re.search(r'data-found="([^"]*)"', done.stdout)
    assert found, done.stderr[-2000:]
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return console, json.loads(html.unescape(found[1]))
