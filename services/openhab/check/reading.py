"""From the text of a file to its tree, by a grammar of lark's; what is wrong with it, at the right place. Pure.

The grammars (`*_grammar.py`) follow OpenHAB's. As there, words of the grammar are no names wherever they stand: the
lexer knows nothing of the parser. Not here: what the tree means.
"""

from __future__ import annotations

import re
from functools import cache

from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedCharacters, UnexpectedToken

from services.openhab.check.findings import Findings, Place

Node = Tree[Token]
# Terminals that all grammars share. A text ends at its quote, on whichever line; only these escapes are known.
COMMENTS = r"""
%ignore /[ \t\r\n]+/
%ignore /\/\*.*?\*\//s
%ignore /\/\/[^\n\r]*/
"""
STRICT_STRING = r"""
STRING.3: /"(\\[btnfru"'\\]|[^\\"])*"/ | /'(\\[btnfru"'\\]|[^\\'])*'/
"""
LOOSE_STRING = r"""
STRING.3: /"(\\.|[^\\"])*"/s | /'(\\.|[^\\'])*'/s
"""
ESCAPED = {"b": "\b", "t": "\t", "n": "\n", "f": "\f", "r": "\r"}
_ESCAPE = re.compile(r"\\(u[0-9A-Fa-f]{4}|.)", re.S)
SHOWN = {"$END": "the end of the file"}
NAMES = {"ID": "a name", "STRING": "a text in quotes", "INT": "a number", "FLOAT": "a number", "$END": "the end"}


@cache
def parser(grammar: str) -> Lark:
    """The parser of a grammar, made once."""
    return Lark(grammar, parser="lalr", lexer="basic", propagate_positions=True, maybe_placeholders=False)


def tree(grammar: str, text: str, findings: Findings) -> Node | None:
    """The tree of a text; None, and what is wrong with it, when it is not of this grammar."""
    tool = parser(grammar)
    try:
        return tool.parse(text)
    except UnexpectedToken as error:
        where, note = _origin(tool, text, error.token)
        wanted = _wanted(tool, error)
        findings.error(where, f"expected {wanted}, got {_shown(error.token)}{note}")
    except UnexpectedCharacters as error:
        at = error.pos_in_stream or 0
        here = Place(error.line, error.column)
        where = _begin(tool, text[:at], here)
        findings.error(where, _bad_character(text, at) + ("" if where == here else _noticed(here)))
    return None


def _origin(tool: Lark, text: str, token: Token) -> tuple[Place, str]:
    """Where a fault began, and where it was noticed if that is somewhere else."""
    if token.type == "$END":
        here = _end_of(text)
        return here, ""
    here = place(token)
    where = _begin(tool, text[: token.start_pos], here)
    return where, "" if where == here else _noticed(here)


def _noticed(here: Place) -> str:
    return f" in line {here.line}; is the text that begins here closed?"


def _begin(tool: Lark, before: str, here: Place) -> Place:
    """A text without its second quote swallows lines up to the next text, and so on: the first of them is to blame."""
    line, found = here.line, here
    for one in reversed(_lexed(tool, before)):
        if one.type == "STRING" and "\n" in one and one.end_line == line:
            found = place(one)
            line = found.line
    return found


def _lexed(tool: Lark, text: str) -> list[Token]:
    found: list[Token] = []
    try:
        found.extend(tool.lex(text))
    except UnexpectedCharacters:
        return found
    return found


def _end_of(text: str) -> Place:
    """The last character that is not a blank."""
    lines = text.rstrip().splitlines() or [""]
    return Place(len(lines), len(lines[-1]) + 1)


def _shown(token: Token) -> str:
    if token.type == "$END":
        return SHOWN["$END"]
    first = str(token).splitlines()[0] if str(token) else ""
    return repr(first[:60])


def _wanted(tool: Lark, error: UnexpectedToken) -> str:
    """The words or kinds that could stand there, a few of them."""
    patterns = {one.name: one.pattern for one in tool.terminals}
    words = []
    for name in sorted(error.accepts or error.expected):
        pattern = patterns.get(name)
        words.append(NAMES.get(name) or (repr(pattern.value) if pattern is not None else name))
    listed = sorted(dict.fromkeys(words), key=lambda word: (not word.startswith("a "), word))
    return " or ".join(listed[:5]) + (" or other words" if len(listed) > 5 else "") if listed else "something else"


def _bad_character(text: str, at: int) -> str:
    if text[at] in "\"'":
        return r"expected a text that ends with its quote, with no other \ than \b \t \n \f \r \u \" \' \\"
    if text.startswith("/*", at):
        return "expected */ at the end of the comment, got the end of the file"
    return f"expected something else, got {text[at]!r}"


def text_of(token: Token, findings: Findings) -> str:
    """What a text in quotes says; a \\ that stands for nothing is a fault."""

    def one(match: re.Match[str]) -> str:
        what = match[1]
        if len(what) == 5:
            return chr(int(what[1:], 16))
        if what in ESCAPED or what in "\"'\\":
            return ESCAPED.get(what, what)
        line = (token.line or 1) + str(token)[: match.start()].count("\n")
        findings.error(Place(line, token.column or 1), rf"expected \b \t \n \f \r \u0000 \" \' or \\, got \{what}")
        return what

    return _ESCAPE.sub(one, str(token)[1:-1])


def name_of(token: Token) -> str:
    """A name without the ^ that tells it from a word of the grammar."""
    return str(token).removeprefix("^")


def place(token: Token) -> Place:
    """Where a token stands."""
    return Place(token.line or 1, token.column or 1)


def tokens(node: Node, kind: str) -> list[Token]:
    """The tokens of a kind directly below a node."""
    return [one for one in node.children if isinstance(one, Token) and one.type == kind]


def below(node: Node, rule: str) -> list[Node]:
    """The nodes of a rule directly below a node."""
    return [one for one in node.children if isinstance(one, Tree) and one.data == rule]
