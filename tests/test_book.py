"""The book: a site of the pages of all folders, whose links resolve and which loads nothing from other machines."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import cotrack
import pytest
from browser import opened

ROOT = Path(__file__).parents[1]
PAGES = ["README.md", *(f"{folder}/**/*.md" for folder in ("fmus", "orchestrator", "tests"))]
ARCHIVE = Path("orchestrator/changes_archive.html")  # old changes are no page of the site
LOADS = {"src", "srcset", "poster", "data"}  # attributes that a browser follows by itself; href if not of <a>
IN_STYLES = re.compile(r"""url\(\s*['"]?([^'")]+)|@import\s+['"]([^'"]+)""")


class Page(HTMLParser):
    """Anchors of a page, its links, and what it loads."""

    def __init__(self, text):
        super().__init__()
        self.anchors, self.links, self.loads = {""}, [], []
        self.in_style = False
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.in_style = tag == "style"
        for name, value in attributes:
            if name in ("id", "name") and tag != "meta":
                self.anchors.add(value)
            elif name == "href" and tag in ("a", "area"):
                self.links.append(value)
            elif name in LOADS or name == "href":
                self.loads.append(value)
            elif name == "style":
                self.handle_style(value)

    def handle_data(self, data):
        if self.in_style:
            self.handle_style(data)

    def handle_style(self, text):
        self.loads += ["".join(found) for found in IN_STYLES.findall(text)]


def faults(site):
    """Sentences about links that lead nowhere and files that are loaded from elsewhere."""
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    for path, page in pages.items():
        name = path.relative_to(site).as_posix()
        for link in [*page.links, *page.loads]:
            target = urlsplit(link)
            if target.scheme or target.netloc:
                if link in page.loads and target.scheme != "data":
                    yield f"{name} loads {link}"
                continue
            file = (path.parent / unquote(target.path)).resolve() if target.path else path
            if not file.is_file():
                yield f"{name}: no file {link}"
            elif file in pages and unquote(target.fragment) not in pages[file].anchors:
                yield f"{name}: no heading {link}"
    for path in site.rglob("*.css"):
        for link in Page(f"<style>{path.read_text(encoding='utf-8')}</style>").loads:
            target = urlsplit(link)
            if target.scheme != "data" and not (path.parent / target.path).is_file():
                yield f"{path.relative_to(site).as_posix()} loads {link}"


def test_faults_are_found(tmp_path):
    (tmp_path / "b.html").write_text('<h1 id="there">B</h1><a href="https://example.org">out</a><img src="b.png">')
    (tmp_path / "b.png").touch()
    (tmp_path / "a.css").write_text('@import "https://example.org/a.css"; p {background: url(data:image/png;base64,)}')
    (tmp_path / "a.html").write_text(
        '<link rel="stylesheet" href="a.css"><script src="https://example.org/a.js"></script><style>p {background: '
        'url("//example.org/a.png")}</style><a href="b.html#there"></a><a href="b.html#here"></a><a href="c.html"></a>'
    )
    assert sorted(faults(tmp_path)) == [
        "a.css loads https://example.org/a.css",
        "a.html loads //example.org/a.png",
        "a.html loads https://example.org/a.js",
        "a.html: no file c.html",
        "a.html: no heading b.html#here",
    ]


@pytest.fixture(scope="module")
def site(tmp_path_factory, environment):
    """The book, built without a warning."""
    folder = tmp_path_factory.mktemp("book")
    build = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-c", "orchestrator/book"]
    build += ["-d", str(folder / "trees"), ".", str(folder / "site")]
    done = subprocess.run(build, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "site"


@pytest.mark.long
def test_the_first_page_in_a_browser(site, tmp_path):
    console, found = opened(site / "README.html", tmp_path)
    assert console == []
    assert [at["beyond"] for at in found] == [0, 0]


@pytest.mark.long
def test_the_book(site):
    """It has every page; the search reads its index as a script, so without a server."""
    assert [*faults(site)] == []
    sources = {path.relative_to(ROOT).with_suffix(".html") for pattern in PAGES for path in ROOT.glob(pattern)}
    assert sources - {ARCHIVE} == sources & {path.relative_to(site) for path in site.rglob("*.html")}
    assert 'src="searchindex.js' in (site / "search.html").read_text(encoding="utf-8")
    index = (site / "searchindex.js").read_text(encoding="utf-8")
    assert index.startswith("Search.setIndex(")
    for word in ("rainflow", "extrapol", "jacobi"):
        assert f'"{word}"' in index or f"{word}:" in index, word
    python = (site / "orchestrator/book/python.html").read_text(encoding="utf-8")
    assert {name for name in cotrack.__all__ if f'id="cotrack.{name}"' not in python} == {"__version__"}
