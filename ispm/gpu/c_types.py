"""How cffi reads the C types that wgpu names."""

from __future__ import annotations

import re
from typing import Any


def read_types_alone(ffi: Any) -> None:
    """Make cffi parse a C type with only the declarations that the type's text names.

    ffi  wgpu's `cffi.FFI`, changed in place
    wgpu gives types as text, `"WGPUBufferDescriptor *"`. cffi parses each text once, behind a typedef for
    every type that webgpu.h declares: 20 ms apiece, and a first picture needs 80. The parsed types are the
    same. Where wgpu brings compiled types (an FFI without a parser) nothing is changed.
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
