"""What a client embeds needs neither SQL nor gtsam nor anything else of the services."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

HEAVY = ("gtsam", "sqlalchemy", "geoalchemy2", "alembic", "psycopg", "filterpy", "matplotlib", "fastapi", "scipy",
         "shapely", "mcap", "click", "jinja2", "prometheus_client", "pyogrio", "cql2", "uvicorn")  # fmt: skip
WATCHED = """
import sys
class Refusing:
    def find_spec(self, name, path=None, target=None):
        top = name.partition('.')[0]
        if top in {heavy!r} or (top.startswith('trigpoint_') and top != 'trigpoint_schemas'):
            raise ImportError('a client pulled in ' + name)
sys.meta_path.insert(0, Refusing())
import {module}
"""


@pytest.mark.parametrize("module", ["asking", "asking_async", "local_map", "core.relocalisation", "core.placing"])
def test_a_client_pulls_in_nothing_of_the_services(module: str) -> None:
    program = WATCHED.format(heavy=HEAVY, module=f"trigpoint.client.{module}")
    finished = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (finished.returncode, finished.stderr) == (0, "")


INSTALLED_AS = {
    "eclipse-zenoh": {"zenoh"},
    "foxglove-schemas-protobuf": {"foxglove_schemas_protobuf"},
    "numpy": {"numpy"},
    "protobuf": {"google"},
    "pyproj": {"pyproj", "certifi"},
}
LISTED = """
import sys
import {module}
tops = {{name.partition('.')[0] for name in sys.modules}}
print(' '.join(sorted(top for top in tops - sys.stdlib_module_names if not top.startswith(('_', 'trigpoint')))))
"""


def needed() -> set[str]:
    """The names of the packages a light install brings."""
    text = (Path(__file__).parents[3] / "pyproject.toml").read_text(encoding="utf-8")
    return {re.split(r"[<>=\[ ]", line)[0] for line in tomllib.loads(text)["project"]["dependencies"]}


def test_a_light_install_brings_what_is_named_here_and_no_more() -> None:
    assert needed() == set(INSTALLED_AS)


@pytest.mark.parametrize("module", ["trigpoint.client.asking_async", "trigpoint.client.local_map",
                                    "trigpoint_vehicle.publisher"])  # fmt: skip
def test_a_light_install_brings_all_a_client_or_a_vehicle_imports(module: str) -> None:
    program = LISTED.format(module=module)
    finished = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    brought = set.union(*INSTALLED_AS.values())
    assert set(finished.stdout.split()) - brought - {"cython_runtime", "sitecustomize"} == set()


def test_the_command_of_a_light_install_says_what_it_lacks() -> None:
    program = "import sys; sys.modules['click'] = None; from trigpoint_cli.entry import main; main()"
    finished = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (finished.returncode, finished.stdout) == (1, "")
    assert "click is not there; the command needs: pip install 'trigpoint[services]'" in finished.stderr
