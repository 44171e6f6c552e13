# SPDX-License-Identifier: Apache-2.0
"""Change folders: files that are folders, links that lead out, names of strangers; and seal manifests."""

import hashlib
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from random import Random

from fuzzer.hostile import OUTSIDE, TEXTS
from fuzzer.pictures import attack_exr
from fuzzer.plain import attack_bytes, attack_lines
from fuzzer.structure import attack_json, attack_toml


def attack_file(rng: Random, path: Path) -> str:
    """Change the content of a file as fits its kind."""
    attacks: dict[str, Callable[[Random, Path], str]] = {
        ".json": attack_json,
        ".toml": attack_toml,
        ".exr": attack_exr,
        ".ply": attack_lines,
        ".txt": attack_lines,
    }
    return attacks.get(path.suffix, attack_bytes)(rng, path)


def files_below(folder: Path) -> list[Path]:
    """Return the files of a folder, sorted; links are none."""
    return sorted(p for p in folder.rglob("*") if p.is_file() and not p.is_symlink())


def attack_tree(rng: Random, folder: Path) -> str:
    """Put something else in the place of a file or folder below a folder."""
    places = sorted(p for p in folder.rglob("*") if not p.is_symlink())
    if not places:
        return "nothing left to change"
    path = rng.choice(places)
    name = path.relative_to(folder).as_posix()
    what = rng.choice(list(_ACTS))
    told = _ACTS[what](rng, path, files_below(folder) or places)
    return f"{what.strip()} {name}{told}"


def _delete(rng: Random, path: Path, others: list[Path]) -> str:
    _remove(path)
    return ""


def _make_folder(rng: Random, path: Path, others: list[Path]) -> str:
    _remove(path)
    path.mkdir()
    return ""


def _make_file(rng: Random, path: Path, others: list[Path]) -> str:
    _remove(path)
    path.write_bytes(rng.choice((b"", b"x")))
    return ""


def _make_link(rng: Random, path: Path, others: list[Path]) -> str:
    target = _link(rng, path, others)
    _remove(path)
    path.symlink_to(target)
    return f" -> {target}"


def _make_pipe(rng: Random, path: Path, others: list[Path]) -> str:
    _remove(path)
    os.mkfifo(path)
    return ""


def _rename(rng: Random, path: Path, others: list[Path]) -> str:
    path.rename(path.with_name(_file_name(rng, path)))
    return ""


def _copy(rng: Random, path: Path, others: list[Path]) -> str:
    other = rng.choice(others)
    if other.is_file() and other != path and path not in other.parents:
        _remove(path)
        shutil.copyfile(other, path)
    return f" from {other.name}"


def _add(rng: Random, path: Path, others: list[Path]) -> str:
    beside = path.with_name(_file_name(rng, path))
    if not beside.exists() and not beside.is_symlink():
        beside.write_bytes(b"x")
    return ""


_ACTS: dict[str, Callable[[Random, Path, list[Path]], str]] = {
    "delete": _delete,
    "folder": _make_folder,
    "file": _make_file,
    "link": _make_link,
    "link ": _make_link,
    "link  ": _make_link,
    "pipe": _make_pipe,
    "rename": _rename,
    "copy": _copy,
    "add beside": _add,
}
"""Changes of a path; links thrice as often."""


def _link(rng: Random, path: Path, others: list[Path]) -> Path | str:
    """Return where a link in the place of a path leads: mostly out of its folder."""
    up = "../" * (2 + rng.randrange(6))
    return rng.choice(
        (
            OUTSIDE,
            f"{up}outside",
            f"{up}outside/secret.json",
            "/etc",
            "/etc/passwd",
            "/dev/null",
            "/dev/zero",
            path.name,
            ".",
            "..",
            "nowhere",
            rng.choice(others),
        )
    )


def _file_name(rng: Random, path: Path) -> str:
    names = [
        t
        for t in TEXTS
        if t and "/" not in t and "\0" not in t and t not in (".", "..") and len(t.encode()) < 200
    ]
    text = rng.choice((path.stem.upper(), *names))
    return f"{text}{path.suffix}"


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink()


def seal(part: Path) -> None:
    """Write the hashes of all files into a manifest, as whoever changes them would."""
    path = part / "manifest.json"
    if not path.is_file():
        return  # a pipe would be waited for
    data = json.loads(path.read_text())
    data["files"] = {
        found.relative_to(part).as_posix(): hashlib.sha256(found.read_bytes()).hexdigest()
        for found in files_of(part)
        if found != path
    }
    path.write_text(json.dumps(data))


def files_of(part: Path) -> list[Path]:
    """Return what a manifest lists: files that are not hidden, also behind links to files."""
    found = [Path(folder) / name for folder, _, names in os.walk(part) for name in names]
    kept = [p for p in found if p.is_file() and not any(n.startswith(".") for n in p.relative_to(part).parts)]
    return sorted(p for p in kept if p.stat().st_size < 10**8 and not str(p.resolve()).startswith("/dev"))
