import pytest
from cffi import FFI, CDefError

from ispm.gpu.c_types import read_types_alone

DECLARED = """
typedef unsigned int Flags;
typedef enum Kind { Kind_One = 1, Kind_Two = 2 } Kind;
struct DeviceImpl;
typedef struct DeviceImpl* Device;
typedef struct Chain { struct Chain const * next; Kind kind; } Chain;
typedef void (*Callback)(Device device, void * userdata);
typedef struct Limits { Chain chain; Flags flags[4]; Callback callback; } Limits;
"""
# Each type twice: cffi keeps what it made of a text, so the second spelling is read anew.
SPELLINGS = [
    ("Limits *", "Limits*"), ("struct Chain *", "struct Chain*"), ("Device", " Device"), ("Kind", " Kind"),
    ("Flags[3]", "Flags [3]"), ("Chain const * *", "Chain const**"), ("uint32_t *", "uint32_t*"),
    ("void(*)(Device, Limits *)", "void (*)(Device, Limits*)"), ("Callback", " Callback"),
]  # fmt: skip


@pytest.fixture
def ffi():
    ffi = FFI()
    ffi.cdef(DECLARED)
    return ffi


def test_types_are_those_of_all_declarations(ffi):
    whole = [ffi.typeof(first) for first, _ in SPELLINGS]
    read_types_alone(ffi)
    assert [ffi.typeof(second) for _, second in SPELLINGS] == whole
    assert ffi.new("Limits  *").flags[3] == 0


def test_types_that_nothing_declares_are_refused(ffi):
    read_types_alone(ffi)
    with pytest.raises(CDefError):
        ffi.typeof("Limit *")
    assert ffi.sizeof("Limits") > 16  # and all declarations are there again


def test_compiled_types_need_nothing():
    read_types_alone(object())
