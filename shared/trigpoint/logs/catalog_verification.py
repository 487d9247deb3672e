"""Whether a log's catalog agrees with its files: where it does not, a file was lost, or the catalog is wrong."""

import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from trigpoint.logs.absences import Absence
from trigpoint.logs.catalog import LAYOUT, NAME, UNREADABLE, CatalogDamaged, checked_rows
from trigpoint.logs.findings import FileSummary, Finding
from trigpoint.logs.log_files import file_path

WRONG, MISSING = "wrong catalog", "missing file"


def catalog_findings(
    directory: Path, files: Sequence[FileSummary], absences: Sequence[tuple[str, Absence]]
) -> tuple[Finding, ...]:
    """What is wrong between a log directory's catalog and its files; nothing where there is no catalog, or one of
    another layout. What `absences` say of streams may be gone.

    A catalog is only read; one that is wrong is made anew when the log is opened next.
    """
    path = directory / NAME
    if not path.is_file():
        return ()
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as connection:
            found = _compared(connection, path, files)
    except (*UNREADABLE, CatalogDamaged) as error:
        return (Finding(path, 0, WRONG, f"cannot be read: {error}; it is made anew when the log is opened"),)
    return tuple(one for one in found if one.kind != MISSING or not _recorded(one.path, absences))


def _recorded(path: Path, absences: Sequence[tuple[str, Absence]]) -> bool:
    first = int(path.stem)
    own = [absence for stream, absence in absences if stream == path.parent.name]
    return any(absence.first_number <= first < absence.stop_number for absence in own)


def _compared(connection: sqlite3.Connection, path: Path, files: Sequence[FileSummary]) -> tuple[Finding, ...]:
    faults = [fault for (fault,) in connection.execute("PRAGMA integrity_check(3)") if fault != "ok"]
    if faults:
        return (Finding(path, 0, WRONG, f"{'; '.join(faults)}; it is made anew when the log is opened"),)
    if connection.execute("PRAGMA user_version").fetchone() != (LAYOUT,):
        return ()
    for _ in checked_rows(connection, "channel"):
        pass
    counts: dict[tuple[str, int], int] = {}
    for stream, first_number, _, count, *_ in checked_rows(connection, "chunk"):
        counts[stream, first_number] = counts.get((stream, first_number), 0) + count
    held = {(file.stream, int(file.path.stem)): file for file in files if file.path.stem.isdecimal()}
    findings = []
    for stream, first_number, size_bytes, *_ in checked_rows(connection, "file"):
        key = (stream, first_number)
        known, file = counts.pop(key, 0), held.get(key)
        findings += _of_file(file_path(path.parent / stream, first_number), size_bytes, known, file)
    if counts:
        findings.append(Finding(path, 0, WRONG, f"knows chunks of files it does not know: {sorted(counts)[:3]}"))
    return tuple(findings)


def _of_file(path: Path, size_bytes: int, known: int, file: FileSummary | None) -> list[Finding]:
    if file is None:
        gone = f"the catalog knows {known} events of it"
        return [Finding(path, 0, MISSING, gone, known)] if known else []
    if file.count < known:
        detail = f"holds {file.count} events, the catalog knows {known}, which were durable"
        return [Finding(path, 0, "damaged", detail, known - file.count)]
    if file.size_bytes == size_bytes and file.count != known:
        return [Finding(path, 0, WRONG, f"the catalog knows {known} events of a file that holds {file.count}")]
    return []
