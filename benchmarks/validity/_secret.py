# SPDX-License-Identifier: Apache-2.0
"""Check that secret scenes of a run are those that follow from the salt which its suite is committed to."""

from collections.abc import Iterator
from pathlib import Path

from graycard import DatasetError
from graycard.benchmarks._suites import Suite, with_secret
from graycard.benchmarks.secret._salt import Salt
from graycard.benchmarks.validity._record import Breach
from graycard.io import read_manifest
from graycard.records import RUN_FILE, RunRecord
from graycard.synth import SecretSpec, scene_name

RULE = "seeds"


def secret_breaches(run: RunRecord, folder: Path, suite: Suite | None, salt: Salt | None) -> list[Breach]:
    """Return a breach for all in which secret scenes are not of the salt that the suite names.

    Args:
        run: The record.
        folder: Of the run.
        suite: What the run is held against; None where it is not known.
        salt: None: it has not been opened yet, and what follows from it cannot be told.

    Raises:
        RecordError: The suite has no secret scenes, or is committed to another salt.
    """
    if salt is not None and suite is not None:
        with_secret(suite, salt)  # refuses another
    if suite is None or not any(scene.seed is None for scene in run.scenes):
        return []  # that nothing is known of the suite, `suite` says
    if suite.secret is None or run.commitment != suite.secret.commitment:
        known = f"{suite.secret.commitment[:12]}…" if suite.secret else "none"
        what = f"expected secret scenes of the salt that {suite.name} is committed to ({known}), got "
        return [Breach(RULE, RUN_FILE, f"{what}{run.commitment[:12] or 'none'}…")]
    if salt is None:
        what = "expected the salt of the secret scenes, got none. Name it with --salt once it is opened"
        return [Breach(RULE, RUN_FILE, what, unknown=True)]
    return list(_scenes(run, folder, suite.secret.drawn(salt)))


def _scenes(run: RunRecord, folder: Path, specs: tuple[SecretSpec, ...]) -> Iterator[Breach]:
    """Compare the seeds of truths with those that follow from the salt; none is shown."""
    seeds = {(spec.track, scene_name(spec)): spec.seed for spec in specs}
    for scene in run.scenes:
        wanted = seeds.get((scene.track, scene.scene))
        if scene.seed is not None or wanted is None:
            continue  # public, or no scene of the suite, which `suite` says
        try:
            found = read_manifest(folder / scene.folder / "truth", "graycard-truth").seeds.get("scene")
        except DatasetError:
            continue  # said by `hashes`
        if found != wanted:
            what = "expected the seed that follows from the salt, got another"
            yield Breach(RULE, f"{scene.track}/{scene.scene}", what)
