"""Whether a log's catalog agrees with its files: where it does not, a file was lost, or the catalog is wrong."""

import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from trigpoint.logs.absences import Absence
from trigpoint.logs.catalog import LAYOUT, NAME, UNREADABLE, CatalogDamaged, checked_rows
from trigpoint.logs.findings import FileSummary, Finding
from trigpoint.logs.log_files import file_path

WRONG, MISSING = "wrong catalog", "missing file"

FileKey = tuple[str, int]  # stream and first number


@dataclass(frozen=True, slots=True)
class KnownFiles:
    """What a log directory's catalog said at one moment: of each file, by stream and first number, its bytes and how
    many events of it are known; or why nothing can be read of it."""

    sizes_bytes: Mapping[FileKey, int]
    counts: Mapping[FileKey, int]
    fault: str = ""


def known_files(directory: Path) -> KnownFiles | None:
    """What the catalog says now; None where there is no catalog, or one of another layout. It is only read.

    To be asked before the files are looked at: they may be written meanwhile, and never hold less than was known.
    """
    path = directory / NAME
    if not path.is_file():
        return None
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as connection:
            connection.execute("BEGIN")  # all tables as they are at one moment
            return _known(connection)
    except (*UNREADABLE, CatalogDamaged) as error:
        return KnownFiles({}, {}, f"cannot be read: {error}")


def _known(connection: sqlite3.Connection) -> KnownFiles | None:
    faults = [fault for (fault,) in connection.execute("PRAGMA integrity_check(3)") if fault != "ok"]
    if faults:
        return KnownFiles({}, {}, "; ".join(faults))
    if connection.execute("PRAGMA user_version").fetchone() != (LAYOUT,):
        return None
    for _ in checked_rows(connection, "channel"):
        pass
    counts: dict[FileKey, int] = {}
    for stream, first_number, _, count, *_ in checked_rows(connection, "chunk"):
        counts[stream, first_number] = counts.get((stream, first_number), 0) + count
    return KnownFiles({(row[0], row[1]): row[2] for row in checked_rows(connection, "file")}, counts)


def catalog_findings(
    directory: Path, known: KnownFiles | None, files: Sequence[FileSummary], absences: Sequence[tuple[str, Absence]]
) -> tuple[Finding, ...]:
    """What is wrong between a log directory's catalog and its files, which were looked at after it. What `absences`
    say of streams may be gone. A catalog that is wrong is made anew when the log is opened next.
    """
    if known is None:
        return ()
    path = directory / NAME
    if known.fault:
        return (Finding(path, 0, WRONG, f"{known.fault}; it is made anew when the log is opened"),)
    return tuple(
        one for one in _compared(known, path, files) if one.kind != MISSING or not _recorded(one.path, absences)
    )


def _recorded(path: Path, absences: Sequence[tuple[str, Absence]]) -> bool:
    first = int(path.stem)
    own = [absence for stream, absence in absences if stream == path.parent.name]
    return any(absence.first_number <= first < absence.stop_number for absence in own)


def _compared(known: KnownFiles, path: Path, files: Sequence[FileSummary]) -> list[Finding]:
    held = {(file.stream, int(file.path.stem)): file for file in files if file.path.stem.isdecimal()}
    findings = []
    for key, size_bytes in known.sizes_bytes.items():
        stream, first_number = key
        findings += _of_file(
            file_path(path.parent / stream, first_number), size_bytes, known.counts.get(key, 0), held.get(key)
        )
    unknown = sorted(known.counts.keys() - known.sizes_bytes.keys())
    if unknown:
        findings.append(Finding(path, 0, WRONG, f"knows chunks of files it does not know: {unknown[:3]}"))
    return findings


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
