"""Settings in brackets, `[a="1", b=2]`: the same in items and things. Pure."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation

from lark import Token

from services.openhab.check.findings import Findings
from services.openhab.check.reading import Node, below, name_of, place, text_of, tokens
from services.openhab.lines import Plain, Setting


def settings_of(node: Node | None, findings: Findings) -> dict[str, Setting]:
    """Keys and values; a value without a key belongs to the one before it."""
    found: dict[str, list[Plain]] = {}
    last = ""
    for entry in below(node, "entry") if node is not None else []:
        for keyed in below(entry, "keyed"):
            key = tokens(keyed, "ID")[0]
            last = name_of(key)
            if last in found:
                findings.warning(place(key), f"expected every key once, got {last!r} again")
            found[last] = [_value(below(keyed, "value")[0], findings)]
        for value in below(entry, "value"):
            if not last:
                findings.error(place(_first(value)), "expected a key and = before a value")
            found.setdefault(last, []).append(_value(value, findings))
    return {key: values[0] if len(values) == 1 else tuple(values) for key, values in found.items()}


def _first(node: Node) -> Token:
    return next(node.scan_values(lambda one: isinstance(one, Token)))


def _value(node: Node, findings: Findings) -> Plain:
    token = _first(node)
    if token.type == "STRING":
        if token.startswith("'"):
            findings.error(place(token), f"expected a text in double quotes here, got {token}")
        return text_of(token, findings)
    if token.type in ("TRUE", "FALSE"):
        return token.type == "TRUE"
    parts = [str(one) for one in node.scan_values(lambda one: isinstance(one, Token))]
    text = "-" + ".".join(parts[1:]) if parts[0] == "-" else ".".join(parts)
    return _number(text, token, findings)


def _number(text: str, token: Token, findings: Findings) -> Plain:
    try:
        number = Decimal(text) if "_" not in text else Decimal("")
    except InvalidOperation:
        findings.error(place(token), f"expected a number, true, false or a text in quotes, got {text!r}")
        return text
    return int(number) if number == number.to_integral_value() and "." not in text else float(number)
