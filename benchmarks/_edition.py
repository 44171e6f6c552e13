# SPDX-License-Identifier: Apache-2.0
"""Sealed scenes: rendered only by code and claims that were tagged before anybody could see them."""

from collections.abc import Iterable, Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from graycard.benchmarks._installed import hashes_of
from graycard.benchmarks._ranges import SceneRange
from graycard.benchmarks._run_record import RunError
from graycard.benchmarks._sources import checkout, git, is_changed, unknown_code
from graycard.benchmarks._suites import Suite, load_suite, suite_names, suite_path
from graycard.benchmarks.claims import claims_names, claims_of_suite, claims_path
from graycard.io import sha256
from graycard.records import Edition
from graycard.synth import SceneSpec, scene_name


def sealed_in(spec: SceneSpec, also: Suite | None = None) -> str:
    """Return the suite in whose sealed range a scene is, whatever its knobs; empty if it is in none.

    Args:
        spec: The scene.
        also: A suite of one's own, beside those that come with graycard.
    """
    ranges = [*_sealed_ranges(), *([(also.name, also.sealed)] if also and also.sealed else [])]
    return next((name for name, found in ranges if found.holds(spec)), "")


@cache
def _sealed_ranges() -> tuple[tuple[str, SceneRange], ...]:
    """Return names and sealed ranges of the suites that come with graycard."""
    suites = map(load_suite, suite_names())
    return tuple((suite.name, suite.sealed) for suite in suites if suite.sealed is not None)


def refuse_sealed(specs: Iterable[SceneSpec], also: Suite | None = None) -> None:
    """Refuse scenes that nobody is to see yet.

    Args:
        specs: The scenes that are to be rendered.
        also: As of :func:`sealed_in`.

    Raises:
        RunError: One is in a sealed range.
    """
    for spec in specs:
        if suite := sealed_in(spec, also):
            raise RunError(
                f"expected scenes outside sealed ranges, got {scene_name(spec)}, which suite {suite!r} keeps "
                f"for code that was tagged before. Choose another seed, or tag and run `graycard bench "
                f"{suite} --sealed`"
            )


def find_edition(suite: str) -> Edition:
    """Return the tag, or the release, that vouches for code, suite and claims as they are here.

    For a suite without claims of its own it names all that come along: ``--any-suite`` may judge by them.

    Args:
        suite: Name of a suite, or a path.

    Raises:
        UnknownNameError: There is no such suite.
        RunError: Nothing vouches for them; the text says what is to be done.
    """
    names = claims_of_suite(load_suite(suite).name) or claims_names()
    claims = {name: claims_path(name) for name in names}
    files = {**claims, "suite": suite_path(suite)}
    root = checkout()
    found = edition_of_release(files) if root is None else edition_of_checkout(files, root)
    return Edition(*found, claims={name: sha256(path) for name, path in claims.items()})


def edition_of_checkout(files: Mapping[str, Path], root: Path) -> tuple[str, str]:
    """Return the tag of a checkout and its commit.

    Args:
        files: Those that have to be as they are at the tag, by their purpose.
        root: Folder of the checkout.

    Raises:
        RunError: Files were changed, the package has code that git does not know, no tag is there, or a file
            is not that of the tag.
    """
    if is_changed(root):
        raise _refusal(
            "a checkout without changes", "changed files (`git status`)", "Commit them and tag that"
        )
    if stray := unknown_code(root):
        raise _refusal(
            "no code in the package that git does not know", ", ".join(stray), "Commit or delete it"
        )
    tags = git(root, "tag", "--points-at", "HEAD").splitlines()
    if not tags:
        commit = git(root, "rev-parse", "--short=12", "HEAD")
        raise _refusal("a tag at the commit", f"none at {commit}", "Tag it: `git tag NAME`")
    for name, path in files.items():
        place = path.resolve()
        known = place.is_relative_to(root) and git(
            root, "rev-parse", "--verify", "--quiet", f"{tags[0]}:{place.relative_to(root).as_posix()}"
        )
        if not known or known != git(root, "hash-object", str(place)):
            raise _refusal(f"{name} as at {tags[0]}", f"another at {path}", "Commit it and tag that")
    return tags[0], git(root, "rev-parse", "HEAD")


def edition_of_release(files: Mapping[str, Path]) -> tuple[str, str]:
    """Return the version of an installed release, as a tag; no commit is known.

    Args:
        files: Those that have to be of the release, by their purpose.

    Raises:
        RunError: This is no release, or a file is none of it.
    """
    try:
        found = distribution("graycard")
    except PackageNotFoundError as cause:
        raise _refusal("a tagged checkout or a release", "neither", "Install a release") from cause
    if found.read_text("direct_url.json") is not None:
        raise _refusal("a release of a package index", "an install from elsewhere", "Install a release")
    listed = hashes_of(found)
    for name, path in files.items():
        if listed.get(path.resolve()) != sha256(path):
            raise _refusal(f"{name} of the release", f"another at {path}", "Install the release again")
    return f"v{found.version}", ""


def _refusal(expected: str, got: str, mend: str) -> RunError:
    return RunError(
        f"expected {expected} before sealed scenes are rendered, got {got}. {mend}: what judges must be "
        "fixed before anybody sees them"
    )
