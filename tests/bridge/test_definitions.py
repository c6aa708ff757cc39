"""Types that are not installed: made of a definition, with the fingerprint that the robot's own package has."""

from __future__ import annotations

import importlib.util
from io import BytesIO

import pytest

from services.bridge import definitions, messages
from services.bridge.robots import actions

pytestmark = pytest.mark.skipif(not importlib.util.find_spec("genpy"), reason="apt-get install python3-genpy")

FIDUCIALS = (
    "Header header\nint32 image_seq\nFiducialTransform[] transforms\n"
    f"{actions.RULE}{actions.HEADER}"
    f"{actions.RULE}fiducial_msgs/FiducialTransform\nint32 fiducial_id\ngeometry_msgs/Transform transform\n"
    "float64 image_error\nfloat64 object_error\nfloat64 fiducial_area\n"
    f"{actions.RULE}geometry_msgs/Transform\nVector3 translation\nQuaternion rotation\n"
    f"{actions.RULE}geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
    f"{actions.RULE}{actions.POSE[3]}"
)
ARRAY = "fiducial_msgs/FiducialTransformArray"


def test_the_goals_have_the_fingerprints_of_the_robots_packages() -> None:
    base = actions.move_base("/move_base")
    assert definitions.declare("move_base_msgs/MoveBaseActionGoal", base.definition)._md5sum == (
        "660d6895a1b9a16dce51fbdd9a64a56b"
    )
    point = actions.go_to_poi("/poi")
    definitions.declare(point.type, point.definition)
    assert definitions.known("pal_navigation_msgs/GoToPOIGoal")._md5sum == "538be845cb53d7d128987a020f2801b8"


def test_a_goal_of_a_type_that_is_not_installed_goes_onto_the_wire_and_back() -> None:
    action = actions.go_to_poi("/poi")
    definitions.declare(action.type, action.definition)
    kind = messages.message_class(action.type)
    fields = {"goal_id": {"id": "apartment/tiago/m"}, "goal": actions.to_point("Living room")}
    data = messages.on_the_wire(messages.build(kind, fields))[messages.LENGTH.size :]
    heard = definitions.decoded(data, {"type": action.type, "message_definition": action.definition})
    assert messages.fields_of(heard)["goal"] == {"poi": {"data": "Living room"}}


def test_a_message_is_decoded_by_what_its_connection_carries() -> None:
    kind = definitions._classes(ARRAY, FIDUCIALS)[ARRAY]
    said, data = kind(image_seq=7), BytesIO()
    said.serialize(data)
    header = {"type": ARRAY, "message_definition": FIDUCIALS, "callerid": "/aruco_detect"}
    assert messages.fields_of(definitions.decoded(data.getvalue(), header))["image_seq"] == 7
    assert definitions.decoded(data.getvalue()[:5], header) is None


@pytest.mark.parametrize("definition", ["", "no type at all\n", "nobody_msgs/Thing thing\n", "int32 x\n" * 20_000])
def test_a_definition_that_is_none_is_no_message(definition: str, caplog: pytest.LogCaptureFixture) -> None:
    assert definitions.decoded(b"", {"type": "a_msgs/B", "message_definition": definition}) is None
    assert "expected a message of a_msgs/B" in caplog.text
