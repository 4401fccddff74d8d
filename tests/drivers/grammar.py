"""What the grammar of WGSL wants and naga does not ask for: parentheses, and a value for every variable.

A look at operators alone, which needs no browser; `tint.py` asks a whole compiler.
Source: WGSL specification, section 8.18, Operator Precedence and Associativity.
"""

from __future__ import annotations

import re

_TEMPLATE = re.compile(r"\b(?:array|atomic|bitcast|mat\dx\d|ptr|texture_\w+|var|vec\d)\s*<[^<>]*>")
_VALUELESS = re.compile(r"\bvar\s+\w+\s*(?::[^=;]*)?;")
_TOKEN = re.compile(r"\w[\w.]*|<<=|>>=|&&|\|\||<<|>>|->|[-+*/%&|^=!<>]=|[-+]{2}|\S")
_ENDS_OPERAND = re.compile(r"[\w)\]]$")
_STATEMENTS = ("return", "if", "while", "let", "else", "switch", "case")
_STOPS = (")", "]", "}", ",", ";", ":", *_STATEMENTS)
_KINDS = {
    **dict.fromkeys(["&&", "||"], "logic"),
    **dict.fromkeys(["<", ">", "<=", ">=", "==", "!="], "relation"),
    **dict.fromkeys(["&", "|", "^"], "bits"),
    **dict.fromkeys(["<<", ">>"], "shift"),
    **dict.fromkeys(["+", "-", "*", "/", "%"], "arithmetic"),
}


def faults(text: str) -> list[str]:
    """Return what is wrong with a shader, with the line of each."""
    text = re.sub(r"//[^\n]*", "", text)
    body = re.sub(r"^@group.*$", "", text, flags=re.M)  # what is bound has no value
    found = [
        f"{_line(body, m.start())}: '{' '.join(m[0].split())}' has no value"
        for m in _VALUELESS.finditer(body)
    ]
    while _TEMPLATE.search(text):
        text = _TEMPLATE.sub(lambda m: "t" + "\n" * m[0].count("\n"), text)
    return found + [f"{line}: {', '.join(mixed)} need parentheses" for line, mixed in _mixed(text)]


def _mixed(text: str) -> list[tuple[int, list[str]]]:
    """Line and operators of each stretch between parentheses or commas that mixes what may not be mixed."""
    found: list[tuple[int, list[str]]] = []
    stretches: list[list[str]] = [[]]
    before = ";"
    for token in _TOKEN.finditer(text):
        word = token[0]
        if word in _KINDS:
            if _ENDS_OPERAND.search(before):  # else it is a sign, an address or a pointer's target
                stretches[-1].append(word)
        elif word in ("(", "[", "{"):
            stretches.append([])
        elif word in _STOPS or word.endswith("="):
            if _is_mixed(stretches[-1]):
                found.append((_line(text, token.start()), stretches[-1]))
            if word in (")", "]", "}"):
                stretches.pop()
            else:
                stretches[-1] = []
        before = ";" if word in _STATEMENTS else word
    return found


def _is_mixed(operators: list[str]) -> bool:
    """Whether operators side by side need parentheses between them."""
    if {"&&", "||"} <= set(operators):
        return True
    kinds = [_KINDS[each] for each in operators]
    if "bits" in kinds:  # of one kind only, and between operands without operators
        return len(set(operators)) > 1
    sides = " ".join(kinds).replace("relation", "logic").split("logic")
    return any("shift" in side and len(side.split()) > 1 for side in sides)


def _line(text: str, at: int) -> int:
    return text.count("\n", 0, at) + 1
