"""Write other people's files as instances of ours, one JSON file each, that ``react-opt solve`` and ``check`` take.

    python -m benchmarks.readers gap-max gap1.txt gap2.txt -o instances
    python -m benchmarks.readers tsplib burma14.tsp --robots 3 -o instances

Prints the path of each file that it wrote.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.readers import FORMATS, documents
from react_opt import jsonio
from react_opt.errors import InputError, UsageError


def main(arguments: list[str] | None = None) -> int:
    """Convert the files named; 2 where one of them is not of the format, and then nothing is written."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.readers",
        description="Write other people's files as instances of ours, one JSON file each.",
        epilog="formats: " + "; ".join(f"{name}: {about}" for name, (_, about) in FORMATS.items()),
    )
    parser.add_argument("format", choices=sorted(FORMATS))
    parser.add_argument("files", nargs="+")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path(), help="folder to write to, made where there is none"
    )
    parser.add_argument("--robots", type=int, metavar="N", help="tsplib, depots: how many (default: 1)")
    parser.add_argument(
        "--steps-per-unit", type=int, metavar="N", help="depots: steps that a unit of length takes (default: 1)"
    )
    options = parser.parse_args(arguments)
    asked = {name: getattr(options, name) for name in ("robots", "steps_per_unit")}
    given = {name: value for name, value in asked.items() if value is not None}
    try:
        instances = [one for file in options.files for one in documents(options.format, file, **given)]
        options.output.mkdir(parents=True, exist_ok=True)
        for instance in instances:
            path = options.output / f"{instance.name}.json"
            jsonio.save(instance, path)
            print(path)
    except (InputError, UsageError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
