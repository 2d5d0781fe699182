"""The pages of the documentation, and the blocks of code in them."""

import re
from functools import cache
from pathlib import Path

from sybil import Document
from sybil.example import Example
from sybil.parsers.markdown import CodeBlockParser

ROOT = Path(__file__).parents[2]
FILES = (
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "benchmarks/README.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
)
PAGES = {str(path.relative_to(ROOT)): path for path in FILES}

SHELLS = ("bash", "zsh", "fish")
LANGUAGES = ("python", *SHELLS, "yaml", "xml", "text")
"""Of blocks: Python runs, trainings and evaluations too, shortened; all others are checked."""

_FENCE = re.compile(r"^[ \t]*```(\w*)", re.MULTILINE)


@cache
def _document(page: str) -> Document:
    parsers = [CodeBlockParser(language, lambda example: None) for language in LANGUAGES]
    return Document.parse(str(PAGES[page]), *parsers)


def blocks(page: str, *languages: str) -> list[Example]:
    """The blocks of some languages on a page, in its order."""
    examples = _document(page).examples()
    return [each for each in examples if language_of(each) in languages]


def language_of(example: Example) -> str:
    return example.region.lexemes["arguments"]


def pages_with(*languages: str) -> list[str]:
    return [page for page in PAGES if blocks(page, *languages)]


def openings(page: str) -> list[str]:
    """Languages of all fences of a page, found without Sybil; "" where none is named."""
    return _FENCE.findall(PAGES[page].read_text())[::2]
