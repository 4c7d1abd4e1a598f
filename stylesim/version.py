"""The version, in a module of its own so that the layers below the root can name it."""

__version__ = "0.1.0"
