"""The documentation site: ``sphinx-build -W docs site`` (needs ``pip install -e ".[docs]"``).

Pictures are drawn by the package itself while the site is built (docs/figures.py). Formulas become MathML, so the
site opens from disk and loads nothing from anywhere.
"""

from __future__ import annotations

import importlib.metadata
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
import figures  # noqa: E402

project = "react_opt"
author = "the react_opt authors"
release = importlib.metadata.version("react_opt")
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
exclude_patterns = ["schemas/**", "site/**", "_made/**"]
html_theme = "furo"
html_title = f"react_opt {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_copyright = False
html_math_renderer = "mathml"
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # they stand in the signatures
autodoc_default_options = {"members": True, "undoc-members": False, "exclude-members": "model_config,kind"}
napoleon_google_docstring = False
napoleon_use_rtype = False


def _inline(self: Any, node: nodes.math) -> None:
    self.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(self: Any, node: nodes.math_block) -> None:
    self.body.append(f'<div class="formula">{convert(node.astext(), display="block")}</div>')
    raise nodes.SkipNode


def _without_results(app: Any, name: str, source: list[str]) -> None:
    """Leave the page of results out of the contents where no benchmark has written it."""
    if name == "index" and not (HERE / "results.md").exists():
        source[0] = source[0].replace("\nresults\n", "\n")


def setup(app: Any) -> None:
    """Draw the pictures and teach the writer MathML."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("source-read", _without_results)
    figures.main(HERE / "_made")
