"""How cffi reads the C types that wgpu names."""

from __future__ import annotations

import re
from typing import Any


def read_types_alone(ffi: Any) -> None:
    """Let an FFI of cffi read each C type with those declarations alone that its text names.

    wgpu names its structs in text, `"WGPUBufferDescriptor *"`. cffi reads each of them, once, behind a
    typedef for every type that webgpu.h declares: 20 ms apiece, and a first picture names 80. What cffi
    makes of a text is the same, and where wgpu comes with compiled types there is nothing to do.
    """
    parser: Any = getattr(ffi, "_parser", None)
    if not hasattr(parser, "_declarations"):
        return
    read = parser.parse_type

    def parse_type(text: str) -> Any:
        declared = parser._declarations
        named = set(re.findall(r"\w+", text))
        parser._declarations = {key: declared[key] for key in declared if key.rpartition(" ")[2] in named}
        try:
            return read(text)
        finally:
            parser._declarations = declared

    parser.parse_type = parse_type
