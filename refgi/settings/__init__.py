"""Settings: small frozen dataclasses, composed; a choice with settings of its own is a union of them.

A method's settings are a tree: `ValSettings(lights=LightSettings(count=1024), visibility=Csm(terms=8))`. Every value in
it has a dotted key, `lights.count` or `visibility.terms`, and the name of a choice is itself a value:
`visibility=csm`. Keys may be shortened to what tells them apart from all others (`terms`), and a part of the tree
stands for its most important value (`lights=1024`). `of` takes such keys in Python, with underscores for dots.
"""

from refgi.settings.fields import LAST_SEED, Leaf, Settings, choices_of, leaves, schema, setting
from refgi.settings.keys import changed, flat, of, replaced
from refgi.settings.text import from_text, of_record

__all__ = [
    "LAST_SEED",
    "Leaf",
    "Settings",
    "changed",
    "choices_of",
    "flat",
    "from_text",
    "leaves",
    "of",
    "of_record",
    "replaced",
    "schema",
    "setting",
]
