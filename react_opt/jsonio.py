"""Reading and writing of files: every fault of a file at once, results written whole or not at all."""

from __future__ import annotations

import contextlib
import difflib
import hashlib
import json
import os
import sys
import tempfile
import weakref
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from react_opt.errors import Fault, InputError
from react_opt.instance import INSTANCE_KINDS, Document, canonical
from react_opt.plan import PLAN_KINDS
from react_opt.references import ReferenceFaultsError, reference_faults
from react_opt.trace import Trace

KINDS: dict[str, type[BaseModel]] = {**INSTANCE_KINDS, **PLAN_KINDS, "trace": Trace}
STANDARD = "-"
MAX_FILE_BYTES = 2_000_000_000
_HASHES: dict[int, tuple[weakref.ref[Document], str]] = {}  # by identity, while the document lives


def load(path: str | os.PathLike[str], kind: str | None = None) -> Any:
    """Read an instance, fleet, mission or plan from a JSON file.

    Parameters
    ----------
    path
        The file, or ``-`` for standard input.
    kind
        The kind expected, None for any.

    Returns
    -------
    Document or PlanDocument
        The model of the file's kind.

    Raises
    ------
    InputError
        With every fault of the file: its place and what was expected there.
    """
    name = os.fspath(path)
    return parse(_decode(_read_text(name), name), file=name, kind=kind)


def loads(text: str, file: str = "<data>", kind: str | None = None) -> Any:
    """Read a document from JSON text; see :func:`load`."""
    return parse(_decode(text, file), file=file, kind=kind)


def parse(data: Any, file: str = "<data>", kind: str | None = None) -> Any:
    """Build the model of plain data; see :func:`load`."""
    if not isinstance(data, dict):
        raise InputError.single(file, "", f"expected a JSON object, found {_shown(data)}")
    found = data.get("kind")
    model = KINDS.get(found) if isinstance(found, str) else None
    if model is None:
        expected = kind or ", ".join(KINDS)
        raise InputError.single(file, "kind", f"expected one of {expected}, found {_shown(found)}")
    if kind is not None and found != kind:
        raise InputError.single(file, "kind", f"expected {kind!r}, found {found!r}")
    try:
        return model.model_validate(data)
    except ValidationError as error:
        places: dict[tuple[str, str], None] = {}
        for item in error.errors(include_url=False):
            inner = item.get("ctx", {}).get("error")
            if isinstance(inner, ReferenceFaultsError):
                places.update(dict.fromkeys(inner.faults))
            else:
                places[_place(item["loc"]), _message(item, model)] = None
        structural = {place for place, _ in places}
        for place, message in reference_faults(data):
            if place not in structural:
                places[place, message] = None
        raise InputError([Fault(file, place, message) for place, message in places]) from None


def dumps(document: BaseModel, indent: int | None = 1) -> str:
    """Return a document as JSON text in the file format."""
    return json.dumps(document.model_dump(mode="json", by_alias=True), indent=indent, allow_nan=False) + "\n"


def save(document: BaseModel, path: str | os.PathLike[str]) -> None:
    """Write a document as JSON, whole or not at all; ``-`` is standard output."""
    write_text(dumps(document), path)


def write_text(text: str, path: str | os.PathLike[str]) -> None:
    """Write text to a temporary file beside ``path`` and rename it; ``-`` is standard output.

    Raises
    ------
    InputError
        Where the file cannot be written; what was there before is left untouched.
    """
    if os.fspath(path) == STANDARD:
        sys.stdout.write(text)
        sys.stdout.flush()
        return
    write_bytes(text.encode(), path)


def require_writable(path: str | os.PathLike[str]) -> None:
    """Fail before long work rather than after it: ``path`` must be a file in a folder that can be written.

    Raises
    ------
    InputError
        Where it is not.
    """
    target = Path(path)
    if os.fspath(path) == STANDARD:
        return
    if target.is_dir():
        raise InputError.single(os.fspath(path), "", "cannot be written: is a directory")
    if not target.parent.is_dir():
        raise InputError.single(os.fspath(path), "", "cannot be written: its folder does not exist")
    if not os.access(target.parent, os.W_OK):
        raise InputError.single(os.fspath(path), "", "cannot be written: its folder is read-only")


def write_bytes(content: bytes, path: str | os.PathLike[str]) -> None:
    """Write bytes to a temporary file beside ``path`` and rename it; see :func:`write_text`."""
    target = Path(path)
    temporary = ""
    try:
        if target.is_dir():
            raise IsADirectoryError(21, "is a directory")
        if target.exists() and not target.is_file():  # a device or a pipe cannot be replaced by a rename
            target.write_bytes(content)
            return
        target = Path(os.path.realpath(target))  # what a link leads to is replaced, not the link (/dev/stdout is one)
        with tempfile.NamedTemporaryFile(dir=target.parent, prefix=f".{target.name}.", delete=False) as file:
            temporary = file.name
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)
        os.replace(temporary, target)
    except OSError as error:
        if temporary:
            with contextlib.suppress(OSError):
                os.unlink(temporary)
        raise InputError.single(os.fspath(path), "", f"cannot be written: {error.strerror or error}") from None


def sha256(document: Document) -> str:
    """Return the SHA-256 of a document as canonical JSON.

    Canonical: every default filled in, keys sorted, no white space, ASCII escapes, numbers as Python prints
    them (fields that are real numbers always with a decimal point or an exponent). Documents cannot change, so
    the hash of one that is still alive is not worked out twice.
    """
    known = _HASHES.get(id(document))
    if known is not None and known[0]() is document:
        return known[1]
    text = json.dumps(canonical(document), sort_keys=True, separators=(",", ":"), allow_nan=False)
    digest = hashlib.sha256(text.encode()).hexdigest()
    number = id(document)
    _HASHES[number] = weakref.ref(document, lambda _: _HASHES.pop(number, None)), digest
    return digest


def json_schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of file.

    Raises
    ------
    InputError
        Where there is no such kind.
    """
    if kind not in KINDS:
        raise InputError.single("", "KIND", f"expected one of {', '.join(KINDS)}, found {kind!r}")
    schema = KINDS[kind].model_json_schema(by_alias=True)
    required = [*schema.get("required", []), "kind"]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "required": sorted(set(required)),
    }


def _read_text(name: str) -> str:
    try:
        if name == STANDARD:
            return sys.stdin.buffer.read().decode("utf-8-sig")
        path = Path(name)
        if path.is_file() and path.stat().st_size > MAX_FILE_BYTES:
            raise InputError.single(name, "", f"expected at most {MAX_FILE_BYTES} bytes")
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError.single(name, f"byte {error.start}", "expected UTF-8 text") from None
    except OSError as error:
        raise InputError.single(name, "", f"cannot be read: {error.strerror or error}") from None
    except ValueError as error:  # a null byte in the name
        raise InputError.single(name, "", f"cannot be read: {error}") from None


def _decode(text: str, file: str) -> Any:
    repeated: list[str] = []

    def unrepeated(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        data = dict(pairs)
        if len(data) < len(pairs):
            keys = [key for key, _ in pairs]
            repeated.extend(sorted({key for key in keys if keys.count(key) > 1}))
        return data

    try:
        data = json.loads(text, object_pairs_hook=unrepeated)
    except json.JSONDecodeError as error:
        place = f"line {error.lineno} column {error.colno}"
        raise InputError.single(file, place, f"expected JSON: {error.msg[:1].lower()}{error.msg[1:]}") from None
    except RecursionError:
        raise InputError.single(file, "", "expected JSON: nested too deeply") from None
    except ValueError as error:  # an integer of thousands of digits
        raise InputError.single(file, "", f"expected JSON: {error}") from None
    if repeated:
        raise InputError([Fault(file, key, "expected each key once in an object") for key in dict.fromkeys(repeated)])
    return data


def _place(location: tuple[int | str, ...]) -> str:
    place = ""
    for part in location:
        part = part if isinstance(part, int) else _short(part)
        place += f"[{part}]" if isinstance(part, int) else f".{part}" if place else part
    return place


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list | tuple):
        return "a list"
    try:
        text = json.dumps(value)
    except (TypeError, ValueError):
        text = type(value).__name__
    return _short(text)


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}..."


def _message(item: Any, model: type[BaseModel]) -> str:
    kind, context = item["type"], item.get("ctx", {})
    if kind == "missing":
        return "required, but missing"
    if kind == "extra_forbidden":
        close = _closest_field(model, str(item["loc"][-1]))
        return "unknown field" + (f", did you mean {close!r}?" if close else "")
    if kind == "value_error":
        return str(context["error"])
    expected = {
        "finite_number": "a finite number",
        "float_type": "a number",
        "int_type": "a whole number",
        "int_from_float": "a whole number",
        "bool_type": "true or false",
        "string_type": "a string",
        "string_too_short": "a non-empty string",
        "tuple_type": "a list",
        "dict_type": "an object",
        "model_type": "an object",
        "model_attributes_type": "an object",
        "greater_than_equal": f"a number >= {_limit(context.get('ge'))}",
        "greater_than": f"a number > {_limit(context.get('gt'))}",
        "less_than_equal": f"a number <= {_limit(context.get('le'))}",
        "literal_error": str(context.get("expected")),
        "too_short": f"at least {context.get('min_length')} entries",
        "too_long": f"at most {context.get('max_length')} entries",
    }.get(kind, str(item["msg"]))
    return f"expected {expected}, found {_shown(item['input'])}"


def _limit(value: Any) -> Any:
    return int(value) if isinstance(value, float) and value.is_integer() and abs(value) < 1e15 else value


@lru_cache(maxsize=1024)
def _closest_field(model: type[BaseModel], name: str) -> str | None:
    schema = model.model_json_schema(by_alias=True)
    known = {*schema.get("properties", {})}
    for part in schema.get("$defs", {}).values():
        known.update(part.get("properties", {}))
    return next(iter(difflib.get_close_matches(name, sorted(known), n=1)), None)
