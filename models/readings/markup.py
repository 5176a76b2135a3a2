"""XML that nobody here wrote, parsed: no entities, no depth that a parser's calls would not survive."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET
from xml.parsers import expat

from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.files import check_count, read_file


def parse(path: Path) -> ET.Element:
    """The elements of an XML file, prefixes of names left as they are: robots' files often do not declare them.

    Raises:
        ScrewgaugeError: It cannot be read, is no XML, declares entities, or nests too deeply.
    """
    builder, parser, depth = ET.TreeBuilder(), expat.ParserCreate(), 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        check_count(depth, "nested elements", str(path), "take fewer links")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def entity(name: str, *_: object) -> None:
        raise ModelFileError(f"declares the entity '{name}'", str(path), "write out what it stands for")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(read_file(path).encode(), True)
        return builder.close()
    except expat.ExpatError as error:
        raise ModelFileError(f"is no model: not well-formed XML ({error})", str(path), "mend the file") from None
