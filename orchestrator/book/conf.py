"""Configuration of the book: one site of the pages of all folders, by Sphinx."""

from sphinx.highlighting import lexer_classes

from orchestrator import __version__

project = "cotrack"
author = "The cotrack authors"
release = version = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc"]
root_doc = "orchestrator/book/contents"
include_patterns = ["README.md", "fmus/**.md", "orchestrator/**.md", "tests/**.md"]
exclude_patterns = [".*", "build", "**/.*", "orchestrator/changes_archive.md"]
myst_heading_anchors = 6  # links to headings, as on the pages of the repository

autodoc_default_options = {"members": True}
autodoc_typehints = "none"  # the docstrings give shapes and units
add_module_names = False

html_theme = "furo"
html_title = f"cotrack {version}"
html_additional_pages = {"index": "start.html"}
templates_path = ["."]
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
html_show_search_summary = False  # it would ask a server for the pages


def setup(app):
    """Mermaid drawings are shown as their text: a site that draws them would load a program."""
    app.add_lexer("mermaid", lexer_classes["none"])
