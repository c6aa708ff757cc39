"""The rules of the code itself, read from its source: who imports whom, one door per library, sizes, docstrings.

Each rule is a table keyed by the beginning of a module's name; the longest key that fits decides. A failing test says
which row to change, or that the code is in the wrong place.
"""

from __future__ import annotations

import ast
import builtins
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
LONGEST_FUNCTION = 50
LONGEST_MODULE = 300

# Who may import which of ours, besides its own package (`services.camera` its parts, a module itself).
WORDS = ("services.errors", "services.section", "services.states")
CORE = (
    *WORDS,
    "services.payloads",
    "services.bus",
    "services.topic",
    "services.topics",
    "services.apartment.forms",
    "services.apartment.home",
    "services.whole_file",
    "services.memory",
)
FILES_OF_OURS = ("services.document", "services.secret_store")  # reading YAML, finding secrets
SHELL = ("services.config", "services.registry", "services.runner", "services.aside", "services.process")
BUSES = (
    "services.bus.mqtt",
    "services.bus.memory",
    "services.bus.connection",
    "services.bus.inbox",
    "services.bus.outbox",
)
THE_FLAT = (
    "services.vision",
    "services.apartment.floor",
    "services.apartment.robot_places",
    "services.apartment.zoom_levels",
)  # where what is
SERVICE = (*CORE, "services.runner", "services.document")  # they meet on the bus, never in an import
LAYERS: dict[str, tuple[str, ...]] = {
    "services": (),
    "services.errors": (),
    "services.whole_file": (),
    "services.memory": (),
    "services.tls": ("services.errors",),
    "services.section": ("services.errors",),
    "services.states": ("services.errors",),
    "services.payloads": ("services.errors",),
    "services.bus": ("services.errors",),
    "services.apartment": (),
    "services.apartment.forms": WORDS,
    "services.apartment.home": (*WORDS, "services.apartment.forms"),
    "services.apartment.floor": (*WORDS, "services.document"),
    "services.apartment.robot_places": (*WORDS, "services.document", "services.apartment.floor"),
    "services.apartment.zoom_levels": (*WORDS, "services.document", "services.vision"),
    "services.paper": ("services.errors", "services.apartment.floor"),
    "services.apartment.cameras": ("services.section", "services.vision"),
    "services.topic": (*WORDS, "services.bus", "services.payloads"),
    "services.topics": (
        *WORDS,
        "services.bus",
        "services.payloads",
        "services.topic",
    ),
    "services.bus.mqtt": (*CORE, "services.bus.connection", "services.bus.inbox", "services.bus.outbox"),
    "services.bus.memory": (*CORE, "services.bus.outbox"),
    "services.bus.connection": CORE,
    "services.bus.inbox": CORE,
    "services.bus.outbox": CORE,
    "services.ros": ("services.errors",),
    "services.vision": ("services.errors",),
    "services.storage": ("services.errors", "services.section", "services.whole_file"),
    "services.document": ("services.errors", "services.whole_file"),
    "services.secret_store": ("services.errors", "services.document"),
    "services.registry": (),
    "services.access": (*CORE, "services.registry"),
    "services.credentials": (*CORE, "services.access", "services.config", *FILES_OF_OURS),
    "services.aside": CORE,
    "services.bus_settings": ("services.errors", "services.section", "services.document", "services.tls"),
    "services.config": (*CORE, *FILES_OF_OURS, "services.registry", "services.bus_settings"),
    "services.runner": (*CORE, "services.aside"),
    "services.camera": (
        *SERVICE,
        "services.vision",
        "services.apartment.zoom_levels",
        "services.http_doors",
        "services.tls",
    ),
    "services.bridge": (*SERVICE, "services.ros", *THE_FLAT, "services.apartment.cameras"),
    "services.persistence": (*SERVICE, "services.storage"),
    "services.history": (*SERVICE, "services.storage", "services.paper"),
    "services.openhab": SERVICE,
    "services.hubs": SERVICE,
    "services.http_doors": (),
    "services.metrics": (*SERVICE, "services.http_doors"),
    "services.mission": (*SERVICE, "services.apartment.floor", "services.apartment.robot_places", "services.paper"),
    "services.dashboard": (*SERVICE, *THE_FLAT, "services.apartment.cameras", "services.tls"),
    "services.simulators": (*SERVICE, "services.ros", *THE_FLAT),
    "services.steering": (*CORE, "services.runner"),
    "services.process": (*CORE, *BUSES, *SHELL, "services.document", "services.access", "services.steering"),
    "services.doctor": ("services",),
    "services.backup": (*CORE, *SHELL, "services.storage"),
    "services.installation": (
        *CORE,
        *SHELL,
        *FILES_OF_OURS,
        "services.access",
        "services.credentials",
        "services.supervisor",
    ),
    "services.supervisor": ("services.process", "services.config"),
    "services.client": (*CORE, *BUSES, *SHELL),
    "services.peers": (*CORE, "services.access"),
    "services.simulated": (*CORE, *SHELL, "services.client", "services.peers", "services.supervisor"),
    "services.command_line": ("services",),
    "services.virtual": ("services",),
    "services.demo": ("services",),
    "services.pytest_plugin": ("services",),
    "services.__main__": ("services",),
}

# One library, one door: where a library may be imported. A name alone is a module, one with a dot at its end all in it.
EVERYWHERE = ("services", "services.")
ROS = ("services.ros.node", "services.bridge.", "services.simulators.robot.")
DOORS: dict[str, tuple[str, ...]] = {
    "pydantic": EVERYWHERE,
    "pydantic_core": EVERYWHERE,
    "numpy": EVERYWHERE,
    "paho": ("services.bus.mqtt", "services.bus.connection", "services.bus.network"),
    "amqtt": ("services.peers.embedded",),
    "httpx": (
        "services.virtual.wire",
        "services.camera.brands.",
        "services.camera.web.",
        "services.camera.probe.",
        "services.openhab.rest",
        "services.openhab.live",
        "services.dashboard.http.video",
    ),
    "cv2": (
        "services.vision.",
        "services.camera.video.",
        "services.bridge.images",
        "services.apartment.floor",
        "services.paper",
        "services.dashboard.thumbnail",
        "services.simulators.camera.",
        "services.simulators.robot.eye",
    ),
    "av": ("services.camera.video.rtsp",),
    "gi": ("services.simulators.camera.rtsp.",),
    "pymysql": ("services.storage.mysql",),
    "sqlite3": ("services.storage.sqlite", "services.storage.sqlite_log"),
    "croniter": ("services.persistence.cron",),
    "yaml": ("services.document",),
    "cryptography": ("services.credentials.certificates",),
    "prometheus_client": ("services.metrics.service",),
    "lark": ("services.openhab.check.",),
    "typer": ("services.__main__", "services.command_line."),
    "rich": (
        "services.__main__",
        "services.command_line.",
        "services.camera.ptz.command",
        "services.demo",
        "services.camera.probe.",
    ),
    "starlette": ("services.dashboard.http.",),
    "uvicorn": ("services.dashboard.http.server", "services.dashboard.http.connection"),
    "h11": ("services.dashboard.http.connection",),
    "pytest": ("services.pytest_plugin",),
    **dict.fromkeys(("rospy", "rosgraph", "rosmaster", "genpy", "genmsg", "roslib", "actionlib", "tf2_ros"), ROS),
    **dict.fromkeys(("std_msgs", "diagnostic_msgs", "geometry_msgs", "sensor_msgs", "nav_msgs", "tf2_msgs"), ROS),
    **dict.fromkeys(("std_srvs", "actionlib_msgs", "move_base_msgs"), ROS),
}

# Pure: what decides has no clock and does no input or output.
MOVING = (
    "calibrate",
    "course",
    "drive",
    "driving",
    "glide",
    "goal",
    "helm",
    "hopping",
    "landing",
    "leg",
    "move",
    "pace",
    "planes",
    "scale",
    "skill",
    "stand",
    "turning",
    "zooming",
)
OPENHAB_PURE = tuple(
    f"services.openhab.{part}"
    for part in (
        "check.", "versions", "words", "lines", "semantics", "skill", "alexa", "site", "cameras", "state_description",
        "readback",
        "items", "mqtt", "things", "sitemap", "persist", "reactions", "dsl", "javascript", "widgets", "generate",
        "importing",
    )
)  # fmt: skip
PURE = (
    "services.errors", "services.section", "services.states", "services.payloads", "services.topics",
    "services.apartment.home", "services.bus", "services.vision.", *(f"services.camera.ptz.{part}" for part in MOVING),
    "services.camera.scan.search", "services.camera.scan.route", "services.camera.scan.footage",
    "services.camera.scan.source", "services.camera.scan.findings", "services.camera.calibration.zoom",
    "services.camera.video.timing",
    "services.camera.brands.dahua.", "services.camera.alarm.motion", "services.camera.sound.g711",
    "services.camera.sound.wav", "services.camera.commands", "services.camera.errands", "services.camera.looks",
    "services.camera.upkeep", "services.camera.probe.findings", "services.camera.probe.anonymous",
    "services.camera.discovery", "services.bridge.rules", "services.bridge.frames", "services.bridge.multipart",
    "services.bridge.confirm", "services.bridge.limits", "services.bridge.pace", "services.bridge.robots.actions",
    "services.bridge.robots.chain", "services.bridge.robots.commander", "services.bridge.robots.goals",
    "services.bridge.items", "services.bridge.template",
    "services.persistence.rows", "services.persistence.seen", "services.persistence.strategies",
    "services.persistence.cron", "services.persistence.filters", "services.persistence.decisions",
    "services.history.answers", "services.history.plot", "services.storage.reading", *OPENHAB_PURE,
    "services.hubs.homeassistant", "services.hubs.homie", "services.metrics.numbers",
    "services.dashboard.view", "services.dashboard.sessions", "services.dashboard.chart", "services.dashboard.aim",
    "services.mission.plan", "services.mission.state", "services.mission.events",
    "services.mission.moment", "services.mission.standing", "services.mission.memory", "services.mission.telling",
    "services.mission.both", "services.mission.refresh", "services.mission.timeline",
    "services.simulators.agenda", "services.simulators.climate", "services.simulators.robot.route",
    "services.simulators.robot.plan", "services.simulators.robot.sight", "services.simulators.robot.body",
    "services.simulators.robot.navigation",
    "services.simulators.devices", "services.simulators.life",
)  # fmt: skip
IMPURE = (
    "asyncio", "http", "multiprocessing", "os", "selectors", "signal", "socket", "ssl", "subprocess", "tempfile",
    "threading", "time", "urllib",
)  # fmt: skip

PRINTS = ("services.__main__", "services.command_line.stored")
CATCHES_ALL = ("services.supervisor",)
VALIDATORS = (
    "field_validator",
    "model_validator",
    "field_serializer",
    "model_serializer",
)  # their name is the sentence


def module_name(path: Path) -> str:
    """The dotted name of a file of ours."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


FILES = {module_name(path): path for path in sorted((ROOT / "services").rglob("*.py"))}
EACH = pytest.mark.parametrize("module", FILES)


@cache
def tree(module: str) -> ast.Module:
    """The source as a tree."""
    return ast.parse(FILES[module].read_text(encoding="utf-8"))


def row(module: str) -> str:
    """The key of LAYERS that decides for a module: the longest that fits; fails when only `services` does."""
    keys = [key for key in LAYERS if module == key or module.startswith(key + ".")]
    best = max(keys, key=len)
    if best == "services" and module != "services":
        pytest.fail(
            f"{module} is in no row of LAYERS in tests/test_architecture.py: add one that says what it may import"
        )
    return best


def within(module: str, places: tuple[str, ...]) -> bool:
    """Whether a module is one of the places; a place that ends with a dot is all that is in a package, and itself."""
    return any(module == place.rstrip(".") or (place.endswith(".") and module.startswith(place)) for place in places)


def imports(module: str) -> Iterator[tuple[str, int]]:
    """Every module that a module imports, wherever the import stands, with its line."""
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{FILES[module]}:{node.lineno}: imports are absolute here"
            base = node.module or ""
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                yield (inner if inner in FILES else base), node.lineno


def may_import(module: str, other: str) -> bool:
    """Whether LAYERS lets a module import another of ours."""
    own, target = row(module), row(other)
    return own == target or "services" in LAYERS[own] or target in LAYERS[own] or other == "services"


@EACH
def test_a_module_imports_only_what_is_below_it(module: str) -> None:
    row(module)
    wrong = [
        f"{FILES[module].relative_to(ROOT)}:{line}: {other}; the row of {row(module)} allows {LAYERS[row(module)]}"
        for other, line in imports(module)
        if other.partition(".")[0] == "services" and not may_import(module, other)
    ]
    assert not wrong, "\n".join(wrong)


@EACH
def test_a_library_is_imported_only_at_its_door(module: str) -> None:
    wrong = []
    for other, line in imports(module):
        library = other.partition(".")[0]
        if library == "services" or (library in sys.stdlib_module_names and library not in DOORS):
            continue
        where = f"{FILES[module].relative_to(ROOT)}:{line}"
        if library not in DOORS:
            wrong.append(f"{where}: {library} is in no row of DOORS in tests/test_architecture.py")
        elif not within(module, DOORS[library]):
            wrong.append(f"{where}: {library} may be imported in {DOORS[library]} only")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("module", [module for module in FILES if within(module, PURE)])
def test_what_decides_is_pure(module: str) -> None:
    wrong = [f"{FILES[module].relative_to(ROOT)}:{line}: {other}" for other, line in imports(module)
             if other.partition(".")[0] in IMPURE]  # fmt: skip
    assert not wrong, "\n".join(["no clock, thread or input and output in here:", *wrong])


def calls(module: str, name: str) -> Iterator[int]:
    """The lines on which a function is called by that name."""
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == name:
            yield node.lineno


@pytest.mark.parametrize("module", [module for module in FILES if not within(module, PRINTS)])
def test_only_the_command_line_prints(module: str) -> None:
    assert list(calls(module, "print")) == [], f"{FILES[module].relative_to(ROOT)}: use logging, or return the text"


def catches_all(handler: ast.ExceptHandler) -> bool:
    """Whether an except takes whatever comes, and keeps it: one that raises it again at its end only notes it."""
    if isinstance(handler.body[-1], ast.Raise) and handler.body[-1].exc is None:
        return False
    if handler.type is None:
        return True
    types = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
    return any(ast.unparse(one) in ("Exception", "BaseException") for one in types)


@pytest.mark.parametrize("module", [module for module in FILES if not within(module, CATCHES_ALL)])
def test_only_the_supervisor_catches_everything(module: str) -> None:
    lines = [n.lineno for n in ast.walk(tree(module)) if isinstance(n, ast.ExceptHandler) and catches_all(n)]
    assert lines == [], f"{FILES[module].relative_to(ROOT)}: name the errors that are expected"


@cache
def contracts() -> frozenset[str]:
    """Names of methods that a Protocol of ours documents; who implements it need not say it again."""
    return frozenset(
        method.name
        for module in FILES
        for node in tree(module).body
        if isinstance(node, ast.ClassDef) and any("Protocol" in ast.unparse(base) for base in node.bases)
        for method in node.body
        if isinstance(method, ast.FunctionDef)
    )


def undocumented(module: str) -> Iterator[str]:
    """Everything public in a module that says nothing about itself."""
    body = tree(module).body
    if body and ast.get_docstring(tree(module)) is None:
        yield f"{module}: the module"
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            if ast.get_docstring(node) is None:
                yield f"{module}:{node.lineno} {node.name}"
            if isinstance(node, ast.ClassDef):
                yield from (f"{module}:{part.lineno} {node.name}.{part.name}" for part in silent_methods(node))


def silent_methods(node: ast.ClassDef) -> Iterator[ast.FunctionDef]:
    """Public methods without a docstring that need one."""
    is_contract = any("Protocol" in ast.unparse(base) for base in node.bases)
    for part in node.body:
        if not isinstance(part, ast.FunctionDef) or part.name.startswith("_") or ast.get_docstring(part) is not None:
            continue
        decorators = [ast.unparse(one).partition("(")[0] for one in part.decorator_list]
        known = part.name in contracts() and not is_contract
        if not known and not any(one in VALIDATORS or one.endswith((".setter", "override")) for one in decorators):
            yield part


@EACH
def test_everything_public_says_what_it_is(module: str) -> None:
    assert list(undocumented(module)) == [], "one line is enough: a docstring"


@EACH
def test_modules_and_functions_stay_short(module: str) -> None:
    long = [
        f"{module}:{node.lineno} {node.name} has {node.end_lineno - node.lineno + 1} lines"
        for node in ast.walk(tree(module))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and node.end_lineno is not None
        and node.end_lineno - node.lineno >= LONGEST_FUNCTION
    ]
    lines = len(FILES[module].read_text(encoding="utf-8").splitlines())
    if lines > LONGEST_MODULE:
        long.append(f"{module} has {lines} lines: it is two modules")
    assert long == []


@cache
def classes() -> dict[str, tuple[str, tuple[str, ...]]]:
    """Every class of ours: where it is, and the last part of its bases' names."""
    return {
        node.name: (f"{module}:{node.lineno}", tuple(ast.unparse(base).rpartition(".")[2] for base in node.bases))
        for module in FILES
        for node in ast.walk(tree(module))
        if isinstance(node, ast.ClassDef)
    }


def ancestors(name: str) -> set[str]:
    """All bases of a class by name, as far as they are ours or Python's."""
    bases = classes()[name][1] if name in classes() else ()
    return {*bases, *(older for base in bases if base != name for older in ancestors(base))}


def is_builtin_error(name: str) -> bool:
    """Whether it is one of Python's own errors."""
    kind = getattr(builtins, name, None)
    return isinstance(kind, type) and issubclass(kind, BaseException)


def test_all_our_errors_have_one_base() -> None:
    errors = [name for name in classes() if any(map(is_builtin_error, ancestors(name)))]
    assert {"ApartmentError", "BadMessage", "DeviceError", "Unavailable", "ConfigError"} <= set(errors)
    strays = [f"{classes()[name][0]} {name}" for name in errors if "ApartmentError" not in {name} | ancestors(name)]
    assert strays == [], "derive them from one of services/errors.py"


def test_nothing_is_left_unfinished() -> None:
    marks = ("TO" + "DO", "FIX" + "ME", "NotImplemented" + "Error")
    unfinished = [
        f"{module}: {mark}" for module, path in FILES.items() for mark in marks if mark in path.read_text("utf-8")
    ]
    assert unfinished == []


def test_no_test_sleeps() -> None:
    asleep = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in sorted((ROOT / "tests").rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("time.sleep", "sleep")
    ]
    assert asleep == [], "wait for what is wanted: services.peers.wait_until, an event, or a `now` of your own"


@pytest.mark.parametrize(
    ("module", "other", "allowed"),
    [
        ("services.camera.service", "services.camera.ptz.move", True),
        ("services.camera.service", "services.vision.detect", True),
        ("services.camera.service", "services.bridge.rules", False),
        ("services.mission.plan", "services.vision", False),
        ("services.persistence.rows", "services.storage.mysql", True),
        ("services.bridge.service", "services.storage.mysql", False),
        ("services.topics", "services.runner", False),
        ("services.bus", "services.bus.mqtt", False),
        ("services.bus.mqtt", "services.bus", True),
        ("services.bus.mqtt", "services.bus.memory", False),
        ("services.camera.service", "services.bus.mqtt", False),
        ("services.vision.detect", "services.topics", False),
        ("services.simulators.camera.view.scene", "services.simulators.world", True),
        ("services.demo", "services.camera.service", True),
        ("services.camera.service", "services.demo", False),
        ("services.config", "services.supervisor", False),
    ],
)
def test_the_layers_say_what_the_style_sheet_says(module: str, other: str, allowed: bool) -> None:
    assert may_import(module, other) is allowed


def test_a_new_part_must_be_given_its_place() -> None:
    with pytest.raises(pytest.fail.Exception, match="add one that says what it may import"):
        row("services.utils")


def test_a_process_loads_no_library_that_its_service_does_not_use() -> None:
    heavy = ("cv2", "numpy", "lark", "httpx", "starlette", "uvicorn", "pymysql", "rospy")
    code = f"import sys, services.__main__; print(*(one for one in {heavy} if one in sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
    assert loaded == []
