"""The words that OpenHAB's grammars use themselves, which are no names there. Pure."""

from __future__ import annotations


def words(text: str) -> frozenset[str]:
    """The words of a text."""
    return frozenset(text.split())


# As a name each of them needs a ^ before it, which does not belong to the name.
ITEM_WORDS = words(
    "Group Switch Rollershutter Number String Dimmer Contact DateTime Color Player Location Call Image "
    "EQUALITY AND OR NAND NOR XOR AVG MEDIAN SUM MAX MIN COUNT LATEST EARLIEST true false"
)
SITEMAP_WORDS = words(
    "sitemap Frame Text Group Image Video Chart Webview Switch Mapview Slider Selection List Setpoint "
    "Colorpicker Colortemperaturepicker Input Buttongrid Button Default AND switchSupport releaseOnly "
    "stateless true false"
)
PERSIST_WORDS = words("Strategies default Filters Items Aliases strategy filter T s m h d")
# In UIDs of things and channels even the ^ does not help.
THING_WORDS = words(
    "Thing Bridge Type State Trigger Switch Rollershutter Number String Dimmer Contact DateTime Color Player Location "
    "Call Image true false"
)
