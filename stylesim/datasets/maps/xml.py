"""The reader of strangers' XML, by the name that map readers know it by."""

from stylesim.xmlfiles import MAX_BYTES, parse, root_name

__all__ = ["MAX_BYTES", "parse", "root_name"]
