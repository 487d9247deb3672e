"""Generates the Protobuf modules from the .proto files: `python -m trigpoint_schemas.generate [--check]`."""

import sys
import tempfile
from pathlib import Path

PACKAGE = Path(__file__).parent
# protoc's stubs name a bare Mapping where a message may be given as one: strict typing wants its parameters.
BARE_MAPPING, TYPED_MAPPING = "_Mapping]", "_Mapping[str, object]]"


def proto_files() -> tuple[Path, ...]:
    """All .proto files of the package, sorted."""
    return tuple(sorted(PACKAGE.rglob("*.proto")))


def generate(output_root: Path) -> tuple[Path, ...]:
    """The generated files, written under `output_root` in the package's own layout.

    Raises RuntimeError if protoc refuses a file.
    """
    from grpc_tools import protoc  # type: ignore[import-untyped]  # only developers have the compiler

    names = [path.relative_to(PACKAGE.parent).as_posix() for path in proto_files()]
    where = [f"--proto_path={PACKAGE.parent}", f"--python_out={output_root}", f"--pyi_out={output_root}"]
    status = protoc.main(["protoc", *where, *names])
    if status != 0:
        raise RuntimeError(f"protoc ended with status {status}, expected 0")
    written = tuple(sorted(output_root.rglob("*_pb2.py*")))
    for stub in (path for path in written if path.suffix == ".pyi"):
        stub.write_text(stub.read_text().replace(BARE_MAPPING, TYPED_MAPPING))
    return tuple(path for path in written if path.suffix in {".py", ".pyi"})


def stale_files() -> tuple[str, ...]:
    """Names of generated files that differ from what the .proto files say now."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        fresh = {path.relative_to(root).as_posix(): path.read_bytes() for path in generate(root)}
    there = {
        path.relative_to(PACKAGE.parent).as_posix(): path.read_bytes()
        for path in PACKAGE.rglob("*_pb2.py*")
        if path.suffix in {".py", ".pyi"}
    }
    return tuple(sorted(name for name in fresh.keys() | there.keys() if fresh.get(name) != there.get(name)))


def main(arguments: list[str]) -> int:
    """Exit status: 0 once all is fresh, 2 for bad usage.

    With --check nothing is written, and 1 says that something is stale.
    """
    if arguments == ["--check"]:
        stale = stale_files()
        sys.stderr.writelines(f"stale: {name}\n" for name in stale)
        return 1 if stale else 0
    if arguments:
        sys.stderr.write(f"{' '.join(arguments)}: only --check is known\n")
        return 2
    generate(PACKAGE.parent)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
