"""What the repository publishes keeps its word: schemas, and the README's first commands."""

import json
from pathlib import Path

import pytest

from react_opt.jsonio import KINDS, json_schema, load

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_published_schemas_are_those_of_the_models(kind):
    published = json.loads((ROOT / "docs" / "schemas" / f"{kind}.schema.json").read_text())
    assert published == json_schema(kind), f"run: react-opt schema {kind} > docs/schemas/{kind}.schema.json"


def test_no_schema_is_published_that_does_not_exist():
    assert {path.name.split(".")[0] for path in (ROOT / "docs" / "schemas").glob("*.json")} == set(KINDS)


def first_block():
    """Return the lines of the README's first bash block."""
    text = (ROOT / "README.md").read_text()
    return text.split("```bash\n", 1)[1].split("```", 1)[0].splitlines()


def test_the_readme_starts_with_two_commands():
    assert len(first_block()) == 2


def test_the_files_that_the_readme_names_exist():
    words = (ROOT / "README.md").read_text().replace("`", " ").replace("(", " ").replace(")", " ").split()
    named = [word for word in words if word.startswith(("examples/", "docs/", "benchmarks/"))]
    assert named
    missing = [word for word in named if "*" not in word and not (ROOT / word.rstrip(".,;:")).exists()]
    assert missing == []


def test_the_example_of_the_readme_is_an_instance():
    path = next(word for word in first_block()[0].split() if word.startswith("examples/"))
    assert load(ROOT / path).kind == "oros"
