"""What mkdocs does for the documentation's site beside its plugins; `mkdocs.yml` names this file.

Pages link to files as they lie in the repository, so that links work where the repository is read,
too. Here links to files outside docs/ are led to the pages that the site shows them on, the
notebooks are put into the navigation, drawings in the page's colours are put into the page, and a
page that would fetch something from another machine is an error.
"""

import posixpath
import re
from pathlib import Path
from typing import Any, Final

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT: Final = Path(__file__).parents[1]

PAGES: Final = {
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "benchmarks/README.md": "benchmarks.md",
    **{
        f"assets/policies/{card.name}": f"policies/{card.name}"
        for card in sorted((ROOT / "assets" / "policies").glob("*.md"))
    },
}
"""Files outside docs/ that are pages of the site."""

LED: Final = {
    **PAGES,
    "README.md": "index.md",
    "CITATION.cff": "citing.md",
    "assets/NOTICE": "provenance.md",
    "assets/README.md": "provenance.md",
    "benchmarks": "benchmarks.md",
    "configs": "settings.md",
    "configs/experiment": "settings.md",
    "docs/physics": "physics/README.md",
    "docs/training": "training/README.md",
    "flyrl/tasks": "api/tasks.md",
}
"""Files and folders outside docs/, and folders in it, that links to are led to a page."""

_LINK: Final = re.compile(r"(?<=\]\()(?P<path>[^)\s#:]+)(?=[#)])")
_NOTEBOOK_LINK: Final = re.compile(
    r'(?<=href=")(?P<path>[^":#]+\.(?:md|ipynb))(?P<anchor>#[^"]*)?(?=")'
)
_IMAGE: Final = re.compile(r"^!\[[^\]]*\]\((?P<path>[^)\s]+\.svg)\)$", re.MULTILINE)
_FETCHED: Final = re.compile(
    r"<(?:script|img|iframe|source|video|audio|object|embed)\b[^>]*?\s(?:src|data)=[\"']?"
    r"((?:https?:)?//[^\"'\s>]+)"
    r"|<link\b(?![^>]*\brel=[\"']?(?:canonical|prev|next|alternate))[^>]*?\shref=[\"']?"
    r"((?:https?:)?//[^\"'\s>]+)"
    r"|@import[^;]*?((?:https?:)?//[^\"'\s;)]+)"
    r"|\bimport\(\s*[\"']((?:https?:)?//[^\"']+)",
    re.IGNORECASE,
)
_NOTEBOOK_SCRIPTS: Final = re.compile(
    r"<script(?:(?!</script>).)*?(?:mathjax|mermaid)(?:(?!</script>).)*</script>",
    re.IGNORECASE | re.DOTALL,
)
"""MathJax and mermaid, which nbconvert brings for formulas and diagrams that ours do not have."""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the notebooks into the navigation."""
    notebooks = sorted((ROOT / "docs" / "tutorials").glob("*.ipynb"))
    found = ["tutorials/README.md", *(f"tutorials/{path.name}" for path in notebooks)]
    for item in config.nav or []:
        if "Tutorials" in item:
            item["Tutorials"] = found
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that lie outside docs/."""
    for outside, uri in PAGES.items():
        files.append(File.generated(config, uri, abs_src_path=str(ROOT / outside)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Lead links to where the site shows what they point to."""
    del config, files
    uri = page.file.src_uri
    outside = {page_uri: path for path, page_uri in PAGES.items()}
    here = posixpath.dirname(outside.get(uri, f"docs/{uri}"))

    def led(link: re.Match[str]) -> str:
        there = posixpath.normpath(posixpath.join(here, link["path"]))
        target = LED.get(there)
        if target is None and uri in outside and there.startswith("docs/"):
            target = there.removeprefix("docs/")
        if target is None:
            return link["path"]
        return posixpath.relpath(target, posixpath.dirname(uri) or ".")

    markdown = _LINK.sub(led, markdown)
    return _IMAGE.sub(lambda image: _drawn(image, ROOT / here), markdown)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Lead links in a notebook to pages, which no plugin does.

    Raises
    ------
    PluginError
        There is no such page.
    """
    del config
    uri = page.file.src_uri
    if not uri.endswith(".ipynb"):
        return html

    def led(link: re.Match[str]) -> str:
        there = posixpath.normpath(posixpath.join(posixpath.dirname(uri), link["path"]))
        target = files.get_file_from_path(there)
        if target is None:
            raise PluginError(f"{uri} links to {link['path']}, which is no page")
        return target.url_relative_to(page.file) + (link["anchor"] or "")

    return _NOTEBOOK_LINK.sub(led, html)


def _drawn(image: re.Match[str], folder: Path) -> str:
    """The drawing itself in place of an image, if its colours are to be those of the page."""
    text = (folder / image["path"]).read_text() if (folder / image["path"]).exists() else ""
    if "var(--md-" not in text:
        return image[0]
    return '<div class="drawing">' + re.sub(r"\n\s*", "\n", text) + "</div>"


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Take out what notebooks would fetch, and refuse all else that would be fetched.

    Raises
    ------
    PluginError
        The page would fetch something from another machine.
    """
    del config
    output = _NOTEBOOK_SCRIPTS.sub("", output)
    fetched: list[Any] = [next(filter(None, groups)) for groups in _FETCHED.findall(output)]
    if fetched:
        raise PluginError(f"{page.file.src_uri} fetches from elsewhere: {', '.join(fetched)}")
    return output
