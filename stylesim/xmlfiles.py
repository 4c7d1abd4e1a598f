"""XML files of strangers: no document type, hence no entities; bounded size; errors that name the file."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from stylesim.collecting import no_collection
from stylesim.errors import InputError

# Chosen: the largest public lanelet2 and OpenDRIVE maps are below 50 MB; a parsed tree takes about ten times the file.
MAX_BYTES = 256 * 1024 * 1024


class _RootReachedError(Exception):
    """The prologue is over: no document type can follow."""


def parse(path: Path, *, root: str | None = None) -> ElementTree.Element:
    """The root element of an XML file, packed with gzip or not; `root` is the name it must have.

    InputError where the file is missing, too large, damaged, of another root, or declares a document type: with
    it come entities, which can grow without bound or name other files.
    """
    return tree(unchecked_bytes(path), path, root=root)


def unchecked_bytes(path: Path) -> bytes:
    """The content of a file, packed with gzip or not, for `tree`. InputError if it is damaged or too large."""
    try:
        if path.suffix == ".gz":
            with gzip.open(path, "rb") as packed:
                raw = packed.read(MAX_BYTES + 1)
        else:
            with path.open("rb") as plain:
                raw = plain.read(MAX_BYTES + 1)
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        raise InputError(f"{path} is a damaged or truncated gzip file ({error}); get it again") from error
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from error
    if len(raw) > MAX_BYTES:
        raise InputError(f"{path} is larger than {MAX_BYTES >> 20} MB unpacked; that is no map or scenario")
    return raw


def tree(raw: bytes, path: Path, *, root: str | None = None) -> ElementTree.Element:
    """The root element of the content of `path`; InputError as for `parse`."""
    try:
        _refuse_document_type(raw, path)
        with no_collection():
            found = ElementTree.fromstring(raw)  # judged before: no document type, hence no entities
    except (ElementTree.ParseError, expat.ExpatError, ValueError, LookupError) as error:
        raise InputError(f"{path} is damaged or no XML ({error}); get it again") from error
    if root is not None and found.tag != root:
        raise InputError(f"{path} is another kind of XML: its root is <{found.tag[:80]}>, expected <{root}>")
    return found


def root_name(path: Path) -> str:
    """The name of the root element, for telling formats apart; "" where there is none. Reads 64 kB, never raises."""
    found = ""

    def start(name: str, _: object) -> None:
        nonlocal found
        found = name
        raise _RootReachedError

    try:
        with path.open("rb") as file:
            head = file.read(1 << 16)
        parser = expat.ParserCreate()
        parser.StartElementHandler = start
        parser.StartDoctypeDeclHandler = lambda *_: start("", None)
        parser.Parse(head, False)
    except (_RootReachedError, expat.ExpatError, OSError, ValueError, LookupError):
        return found
    return found


def _refuse_document_type(raw: bytes, path: Path) -> None:
    def refuse(*_: object) -> None:
        raise InputError(f"{path} declares a document type (<!DOCTYPE …>); such files are not read: remove it")

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    parser.Parse(raw, True)
