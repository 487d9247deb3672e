"""What a client embeds needs neither SQL nor gtsam nor anything else of the services."""

import subprocess
import sys

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
