"""Every command and every Python snippet of the documentation runs as written, page by page."""

import pytest
from snippets import ROOT, blocks, run_page

PAGES = [page for page in sorted((ROOT / "docs").rglob("*.md")) if blocks(page)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_page_runs(page, tmp_path, monkeypatch, capsys):
    run_page(page, tmp_path, monkeypatch, capsys)


def test_there_are_snippets():
    assert {page.name for page in PAGES} >= {"start.md", "own_strategy.md", "export.md", "figures.md"}
    assert sum(len(blocks(page)) for page in PAGES) > 20
