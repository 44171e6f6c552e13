# SPDX-License-Identifier: Apache-2.0
"""Check that sealed scenes were rendered by tagged code and judged by the claims of that tag."""

from collections.abc import Iterator
from pathlib import Path

from graycard.benchmarks._edition import sealed_in
from graycard.benchmarks._sources import checkout, git
from graycard.benchmarks._suites import Suite
from graycard.benchmarks.validity._record import Breach
from graycard.records import RUN_FILE, Edition, RunRecord, read_ledger
from graycard.synth import SceneSpec

RULE = "origin"


def sealed_breaches(run: RunRecord, suite: Suite | None) -> list[Breach]:
    """Return a breach for each scene of a sealed range in a run that no tag vouches for."""
    if run.edition is not None:
        return []
    found = []
    for scene in run.scenes:
        if scene.seed is None:
            continue  # of a salt
        name = sealed_in(SceneSpec(scene.track, scene.family, scene.seed), suite)
        if name:
            what = f"expected no scene that {name} keeps sealed, got one without --sealed"
            found.append(Breach("suite", f"{scene.track}/{scene.scene}", what))
    return found


def edition_breaches(run: RunRecord, folder: Path) -> list[Breach]:
    """Return a breach for all in which a run on sealed scenes is not of the tag that it names."""
    if run.edition is None:
        return []
    return [*_code(run, run.edition), *_tag(run.edition), *_claims(run.edition, folder)]


def _code(run: RunRecord, edition: Edition) -> Iterator[Breach]:
    """Compare the commit of the run, or the version that was installed, with that of the tag."""
    for environment in run.environments:
        ran = str(environment.get("git_commit") or "")
        if edition.commit and not (ran and edition.commit.startswith(ran)):
            wanted = f"commit {edition.commit[:12]}, which {edition.tag} is"
            yield Breach(RULE, "environment", f"expected a run of {wanted}, got {ran or 'none'}")
        version = f"v{dict(environment.get('packages') or {}).get('graycard')}"
        if not edition.commit and edition.tag != version:
            yield Breach(RULE, "environment", f"expected a run of release {edition.tag}, got {version}")


def _tag(edition: Edition) -> Iterator[Breach]:
    """Check that the tag is still at that commit, as far as this checkout can tell.

    Where a clone came without its tags, the commit itself vouches if it is part of the history.
    """
    root = checkout()
    if not edition.commit:
        return
    found = git(root, "rev-parse", "--verify", "--quiet", f"{edition.tag}^{{commit}}") if root else ""
    if not found and root and git(root, "merge-base", edition.commit, "HEAD") == edition.commit:
        return
    if not found:
        what = (
            f"expected a checkout that knows the tag {edition.tag} or has its commit in its history, got "
            "neither. Run `git fetch --tags`, with `--unshallow` in a shallow clone"
        )
        yield Breach(RULE, RUN_FILE, what, unknown=True)
    elif found != edition.commit:
        what = f"expected {edition.tag} at {edition.commit[:12]}, as the run says, got {found[:12]}"
        yield Breach(RULE, RUN_FILE, what)


def _claims(edition: Edition, folder: Path) -> Iterator[Breach]:
    """Check that the ledger is by the claims of the tag."""
    ledger = read_ledger(folder)
    for paper in ledger.papers if ledger else ():
        known = edition.claims.get(paper.name)
        if known != paper.claims_sha256:
            what = f"expected claims {paper.name} as at {edition.tag}, got others"
            yield Breach(RULE, "claims.json", what)
