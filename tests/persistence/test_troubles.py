"""One trial of each trouble under 2,000 messages a second; a hundred at random are `make soak PART=persistence`."""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest

from services import peers
from tests.persistence import trials

pytestmark = [pytest.mark.mosquitto, pytest.mark.mariadb]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[trials.Site]:
    try:
        with trials.site(tmp_path_factory.mktemp("site")) as made:
            yield made
    except peers.Missing as missing:
        pytest.skip(str(missing))


@pytest.mark.parametrize("what", trials.TROUBLES, ids=lambda what: what.__name__)
def test_the_rows_are_exactly_what_was_acknowledged(site: trials.Site, what: object) -> None:
    trials.trouble(site, random.Random(7), what)  # type: ignore[arg-type]
