"""What `tools/site.py` does to the pages of the site."""

import re
from types import SimpleNamespace

import pytest
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

from tests.docs.pages import PAGES
from tools import site

PAGE = SimpleNamespace(file=SimpleNamespace(src_uri="a.md"))


def led(uri, markdown):
    page = SimpleNamespace(file=SimpleNamespace(src_uri=uri))
    return site.on_page_markdown(markdown, page, None, None)


@pytest.mark.parametrize(
    ("uri", "link", "target"),
    [
        ("policies.md", "../assets/policies/target-flat.md", "policies/target-flat.md"),
        ("physics/balanced.md", "../../CONTRIBUTING.md", "../contributing.md"),
        ("contributing.md", "docs/tasks.md", "tasks.md"),
        ("benchmarks.md", "../docs/speed.md", "speed.md"),
        ("policies/target-flat.md", "../../docs/tasks.md", "../tasks.md"),
        ("tasks.md", "https://arxiv.org/abs/1710.06537", "https://arxiv.org/abs/1710.06537"),
    ],
)
def test_links_lead_to_where_the_site_shows_the_file(uri, link, target):
    assert led(uri, f"see [it]({link}).") == f"see [it]({target})."
    assert led(uri, f"see [it]({link}#a).") == f"see [it]({target}#a)."


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_to_a_file_where_the_repository_is_read(page):
    text = re.sub(r"^```.*?^```", "", PAGES[page].read_text(), flags=re.DOTALL | re.MULTILINE)
    for path in re.findall(r"\]\(([^)\s#:]+)(?:#[^)\s]*)?\)", text):
        assert (PAGES[page].parent / path).exists(), path


def test_links_in_a_notebook_lead_to_pages():
    uris = ("tutorials/01.ipynb", "tasks.md")
    files = Files([File(uri, "docs", "site", use_directory_urls=True) for uri in uris])
    page = SimpleNamespace(file=files.get_file_from_path("tutorials/01.ipynb"))
    page.file.url = "tutorials/01/"  # as the plugin for notebooks has it
    html = '<a href="../tasks.md#heading">tasks</a> <a href="https://a.org/b.md">b</a>'
    expected = '<a href="../../tasks/#heading">tasks</a> <a href="https://a.org/b.md">b</a>'
    assert site.on_page_content(html, page, None, files) == expected
    with pytest.raises(PluginError, match=r"links to 03\.ipynb, which is no page"):
        site.on_page_content('<a href="03.ipynb">3</a>', page, None, files)


def test_a_drawing_in_the_page_s_colours_is_put_into_the_page():
    drawn = led("concepts.md", "a\n\n![Stations](images/stations.svg)\n\nb")
    assert re.match(r'a\n\n<div class="drawing"><svg .*</svg>\n?</div>\n\nb$', drawn, re.DOTALL)
    assert "\n\n" not in drawn[3:-3]
    curve = "![Curve](target_ppo.svg)"
    assert led("training/README.md", curve) == curve


@pytest.mark.parametrize(
    "html",
    [
        '<script src="https://example.org/a.js"></script>',
        "<img alt='' src='//example.org/a.png'>",
        '<link rel="stylesheet" href="https://example.org/a.css">',
        '<style>@import url("https://example.org/a.css");</style>',
        "<script type='module'>(await import('https://example.org/a.mjs'))</script>",
    ],
)
def test_a_page_that_fetches_from_elsewhere_is_refused(html):
    with pytest.raises(PluginError, match=r"a\.md fetches from elsewhere: .*example\.org"):
        site.on_post_page(html, PAGE, None)


def test_links_to_elsewhere_are_no_fetching_and_notebooks_fetch_nothing():
    link = '<a href="https://example.org">a</a><link rel="canonical" href="https://example.org">'
    script = "<script>here()</script>"
    mathjax = '<script src="https://example.org/mathjax.js"></script>'
    mermaid = "<script type='module'>import('https://example.org/mermaid.mjs')</script>"
    assert site.on_post_page(link + mathjax + script + mermaid, PAGE, None) == link + script
