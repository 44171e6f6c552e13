# SPDX-License-Identifier: Apache-2.0
"""Objects of other scenes: these are rendered, fitted too, and their objects handed on."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from changed_scene import DONOR, enrich
from graycard import DatasetError, MethodError, open_truth
from graycard.benchmarks import FitSpec, check_result, fit_scene, load_suite
from graycard.benchmarks._introduction import introduce
from graycard.benchmarks.planning._plan import plan_fits
from graycard.cli import main
from graycard.dataset import manifest_of
from graycard.io import read_layers, sha256, silent, write_layers, write_manifest
from graycard.records import read_run

HOSTING = "small_methods:Hosting"


def composed_colours(predictions: Path) -> list[float]:
    files = sorted((predictions / "composition" / "views").glob("*.exr"))
    return [float(read_layers(path)["radiance"].mean()) for path in files]


@pytest.fixture
def host(make_scene: Callable[..., Path]) -> Path:
    return enrich(make_scene(track="multilight"))


def donor_of(make_scene: Callable[..., Path], name: str = f"objects-{DONOR.seed:04d}", row: int = 6) -> Path:
    """Its object of that id is put over the upper rows of its pictures, of which there are more."""
    folder = make_scene(track="multilight", scene=name, train=4)
    truth = open_truth(folder / "truth")
    for view in truth.views:
        layers = truth.layers(view)
        layers["object_id"][:row] = DONOR.object_id
        layers["object_id"][row:] = 1
        write_layers(folder / f"truth/views/{view.name}.exr", layers)
    write_manifest(folder / "truth", manifest_of(truth))
    return folder


def test_a_guest_is_handed_with_its_masks(
    host: Path, make_scene: Callable[..., Path], tmp_path: Path
) -> None:
    donor = donor_of(make_scene)
    fit_scene(FitSpec(HOSTING, {}, 0, host, donor=donor), tmp_path / "p", silent)
    assert composed_colours(tmp_path / "p") == pytest.approx([6 / 24] * 2)


def test_without_a_donor_nothing_is_composed(host: Path, tmp_path: Path) -> None:
    fit_scene(FitSpec(HOSTING, {}, 0, host), tmp_path / "p", silent)
    assert composed_colours(tmp_path / "p") == []


def test_the_truth_needs_no_donor(host: Path, make_scene: Callable[..., Path], tmp_path: Path) -> None:
    fit_scene(FitSpec("truth", {}, 0, host, donor=donor_of(make_scene)), tmp_path / "p", silent)
    assert len(composed_colours(tmp_path / "p")) == 2


def test_another_donor_is_refused(host: Path, make_scene: Callable[..., Path], tmp_path: Path) -> None:
    other = donor_of(make_scene, "objects-0004")
    with pytest.raises(DatasetError, match="expected multilight/objects-0003, whose object is put into"):
        fit_scene(FitSpec(HOSTING, {}, 0, host, donor=other), tmp_path / "p", silent)


def test_a_donor_for_what_puts_nothing_in_is_refused(
    host: Path, make_scene: Callable[..., Path], tmp_path: Path
) -> None:
    donor, plain = donor_of(make_scene), make_scene(track="multilight", scene="tiny-0001")
    with pytest.raises(MethodError, match=r"expected 'gray' to give a decomposition with compose\(\)"):
        fit_scene(FitSpec("gray", {}, 0, host, donor=donor), tmp_path / "p", silent)
    with pytest.raises(DatasetError, match="to show an object of another scene put in, got none"):
        fit_scene(FitSpec(HOSTING, {}, 0, plain, donor=donor), tmp_path / "p", silent)


def test_an_object_that_no_photograph_shows_is_not_composed(
    host: Path, make_scene: Callable[..., Path], tmp_path: Path
) -> None:
    donor = donor_of(make_scene, row=0)
    fit_scene(FitSpec(HOSTING, {}, 0, host, donor=donor), tmp_path / "p", silent)
    assert composed_colours(tmp_path / "p") == []


@pytest.mark.parametrize("reach", ["host", "donor", "job"])
def test_truth_is_closed_while_the_donor_is_fitted_too(
    host: Path, make_scene: Callable[..., Path], tmp_path: Path, reach: str
) -> None:
    """Even for a method that keeps the refusal to itself, and wherever the donor lies."""
    donor = donor_of(make_scene)
    elsewhere = tmp_path / "elsewhere" / "multilight" / donor.name
    shutil.copytree(donor, elsewhere)
    other = tmp_path / "jobs" / "other" / "scores.json"
    other.parent.mkdir(parents=True)
    other.write_text("{}")
    scenes = {"host": host, "donor": elsewhere}
    wanted = scenes[reach] / "truth" / "truth.json" if reach in scenes else other
    spec = FitSpec("small_methods:Peeping", {"path": str(wanted)}, 0, host, donor=elsewhere)
    fitted = fit_scene(spec, tmp_path / "p", silent, jobs=tmp_path / "jobs")
    assert fitted.access.refused == (str(wanted),)
    assert fitted.access.donor_sha256 == sha256(donor / "capture" / "manifest.json")


@pytest.mark.slow
def test_a_bench_renders_the_donors_of_rows_that_compose(
    suite_of: Callable[..., Path], tmp_path: Path
) -> None:
    suite, run = suite_of(tracks=("multilight",)), tmp_path / "run"
    rows = "".join(
        f'[[methods]]\nname = "{HOSTING}"\nlabel = "{label}"\ncomposes = {composes}\n'
        for label, composes in (("hosts", "true"), ("alone", "false"))
    )
    suite.write_text(suite.read_text() + rows)
    command = ["bench", str(suite), "--out", str(run)]
    assert main([*command, "--methods", "alone", "hosts"]) == 0
    assert {path.name for path in (run / "dataset/multilight").iterdir()} == {"studio-1000", "objects-1000"}
    record = read_run(run)
    assert [scene.scene for scene in record.scenes] == ["studio-1000"], "the donor is no scene of the suite"
    status = {r.job.method: r.sheet.score("composition.psnr").status for r in record.results if r.sheet}
    assert status == {"alone": "not provided", "hosts": "scored"}
    assert not [breach for breach in check_result(run).breaches if breach.rule in ("truth", "finite")]
    assert main([*command, "--methods", "alone", "hosts"]) == 0
    hashes = [{r.job.method: r.job_hash for r in found.results} for found in (record, read_run(run))]
    assert hashes[0] == hashes[1]
    bare = tmp_path / "bare"
    assert main(["bench", str(suite), "--out", str(bare), "--methods", "hosts", "--no-compositions"]) == 0
    assert {path.name for path in (bare / "dataset/multilight").iterdir()} == {"studio-1000"}
    [result] = read_run(bare).results
    assert result.sheet
    assert result.sheet.score("composition.psnr").status == "not provided"
    assert "no object is put in by hosts" in check_result(bare).part
    assert "no object" not in check_result(run).part
    assert main([*command, "--methods", "alone", "--no-compositions"]) == 2, "alone puts none in anyway"
    place = run / "dataset/multilight/studio-1000/truth/composition/composition.json"
    composition = json.loads(place.read_text())
    composition["donor_to_host"][0][3] += 0.01
    place.write_text(json.dumps(composition))
    plan, scene = load_suite(str(suite)), place.parents[2]
    known = introduce(plan.methods, run / "dataset", run / "jobs", 1)
    donors = {scene: run / "dataset/multilight/objects-1000"}
    fits = plan_fits(plan, known, [(plan.scenes[0], scene)], donors, run, 1)
    again = {fit.job.method: fit.job_hash for fit in fits}
    assert again["alone"] == hashes[0]["alone"]
    assert again["hosts"] != hashes[0]["hosts"], "it is put elsewhere"
