"""`python -m compiled_loops`: the loops over points and rays compiled, once and on one core, for all who come after."""

import tempfile
from contextlib import closing
from pathlib import Path

from command_runs.running import trigpoint
from scanned_drives.examples import arc, drive_rows, map_rows, pinned, solved_path
from scanned_worlds.drives import scanned_drive
from trigpoint.logs.mcap_log import McapLog
from vehicle_lidar.worlds import scanned, seen_in

SWEEPS = 5
POSES = arc(2.0)


def perceive(data: Path) -> None:
    """Two drives along one street perceived, and the loop between them closed."""
    with closing(McapLog(data / "log")) as log:
        for boot_id in ("boot-1", "boot-2"):
            log.append("veh-van", list(scanned_drive("van", SWEEPS, boot_id=boot_id)))
    _done("perceive", "--data", data)


def render(data: Path) -> None:
    """A drive's points rendered in both grids."""
    with closing(McapLog(data / "log")) as log:
        log.append("map", [pinned()])
        log.append("veh-car", drive_rows("car", POSES))
        log.append("optimisation", map_rows([solved_path("car", POSES)]))
    _done("ortho", "render", "--data", data, "--out", data / "out", "--resolution-m", 0.5)


def cast() -> None:
    """A sweep of the simulated lidar cast."""
    drive = scanned().scans[0]
    list(drive.events(0, 1))
    seen_in(drive, 0)


def _done(*words: str | float | Path) -> None:
    run = trigpoint(*words)
    assert run.status == 0, run.err


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        perceive(Path(folder) / "perceived")
        render(Path(folder) / "rendered")
        cast()
