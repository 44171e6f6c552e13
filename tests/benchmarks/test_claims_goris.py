# SPDX-License-Identifier: Apache-2.0
"""The claims of GOR-IS on runs by hand: where the figures of the paper hold, and where nothing helps."""

from collections.abc import Mapping

import pytest

import graycard as gc
import graycard.eval as ge
from graycard.benchmarks.claims import judge_paper, load_claims

FAMILIES = (*(f for f in ("glossy-table", "metal-table", "marble-table") for _ in range(2)), "curved-table")
ROUGHNESS = (0.2, 0.25, 0.2, 0.3, 0.2, 0.2, 0.2)
SCENES = (
    *(
        gc.SceneRecord("tabletop", f"s{i}", family, i, "", "", "", {"roughness": rough})
        for i, (family, rough) in enumerate(zip(FAMILIES, ROUGHNESS, strict=True))
    ),
    gc.SceneRecord("tabletop", "s7", "matte-table", 7, "", "", "", {}),
)
PRINTED = {
    "goris": 31.91, "goris-no-transport": 28.60, "goris-no-filter": 31.44, "goris-no-effect-mask": 31.64,
    "goris-no-material-inpainting": 31.31, "goris-no-region": 29.38, "goris-no-normals": 29.77,
    "goris-distilled": 30.48, "goris-release": 31.99, "removal": 28.60, "grouping": 29.64,
    "removal-per-view": 24.68, "removal-one-reference": 29.92,
}  # fmt: skip
"""PSNR, dB."""
SAID = {
    "goris-weights-0.2": 30.5, "goris-weights-0.5": 31.8, "goris-weights-5": 32.0, "goris-biharmonic": 31.5,
    "goris-telea": 31.6, "goris-references-1": 30.9, "goris-references-2": 31.5, "goris-references-5": 31.9,
    "goris-inpainting-0": 32.3, "goris-inpainting-4": 31.0, "goris-mask-0": 32.2, "goris-mask-4": 31.2,
    "do-nothing": 22.0,
}  # fmt: skip
"""What would go with the paper's words where it prints no figure."""
OTHERS = (
    "removal",
    "grouping",
    "removal-per-view",
    "removal-one-reference",
    "do-nothing",
    "goris-no-normals",
)
GAINS = ("counterfactual.psnr", "counterfactual.psnr.footprint", "counterfactual.psnr.mirror")


def scores_of(row: str, psnr: float) -> dict[str, float]:
    """All that the claims read of a row with this PSNR without the object."""
    found = {**dict.fromkeys(GAINS, psnr), "counterfactual.psnr.rest": 33.0, "counterfactual.flip": 1 / psnr}
    found |= {
        "counterfactual.residual.shadow.diffuse": 0.9,
        "normal.mean_angle": 25.0 if row in OTHERS else 9.0,
    }
    kept = 0.9 if row in OTHERS else 0.2
    found |= {f"counterfactual.residual.mirror{of}": kept for of in ("", ".specular")}
    if not row.startswith("goris"):
        return found
    return found | {
        "f0.mae": 0.1, "roughness.mae": 0.12, "glossy.iou": 0.8, "diffuse.psnr": 30.0, "specular.psnr": 28.0,
    }  # fmt: skip


def run_of(table: Mapping[str, Mapping[str, float]]) -> gc.RunRecord:
    """A run whose scenes differ by a hundredth of a figure, and a little between rows."""
    records = {metric.id: metric for metric in ge.metrics()}
    results = []
    for number, (row, values) in enumerate(table.items()):
        for i, scene in enumerate(SCENES):
            factor = 1 + 0.01 * i + 1e-4 * ((number * 7 + i * 3) % 5)
            scores = []
            for name, value in values.items():
                metric = records[name]
                facts = metric.unit, metric.higher_is_better, metric.optimum
                scores.append(gc.Score(name, "graycard-1", "scored", value * factor, *facts))
            sheet = gc.ScoreSheet("tabletop", scene.scene, row, "", "", tuple(scores))
            job = gc.Job("tabletop", scene.scene, row, 0, {})
            results.append(gc.JobResult(job, "", "", "done", sheet=sheet))
    methods = tuple(gc.MethodRecord(row, "", ()) for row in table)
    return gc.RunRecord(
        "claims-tabletop",
        1,
        SCENES,
        methods,
        tuple(ge.metrics()),
        tuple(results),
        {},
        "2026-11-24T00:00:00",
        1.0,
    )


def verdicts(table: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
    found = judge_paper(load_claims("goris"), run_of(table))
    return {claim.id: claim.verdict for claim in found if claim.id.startswith("R") and claim.id != "RA1"}


def as_in_the_paper() -> dict[str, dict[str, float]]:
    rows = {row: scores_of(row, psnr) for row, psnr in (PRINTED | SAID).items()}
    seen = {"diffuse.psnr": 20.0, "specular.psnr": 12.0}
    return rows | {"input": seen, "truth": dict.fromkeys(GAINS, 45.0)}


def test_where_the_papers_figures_hold_every_claim_is_reproduced() -> None:
    found = verdicts(as_in_the_paper())
    lacking = {"R2", "R3"}
    assert found == {
        f"R{n}": "not checkable" if f"R{n}" in lacking else "reproduced" for n in range(1, 18)
    }, "no real photographs; one matte scene"


def test_where_all_rows_are_alike_only_what_makes_no_difference_is_reproduced() -> None:
    alike = {row: scores_of("removal", 25.0) for row in as_in_the_paper()}
    found = verdicts(alike)
    assert {claim for claim, verdict in found.items() if verdict == "reproduced"} == {"R11", "R12", "R15"}
    assert found["R17"] == "not checkable", "nothing is taken apart"


@pytest.mark.parametrize(
    ("row", "metric", "value", "claim"),
    [
        ("removal-one-reference", "counterfactual.psnr", 33.0, "R1"),
        ("goris-no-transport", "counterfactual.psnr.mirror", 36.0, "R4"),
        ("goris-no-material-inpainting", "counterfactual.psnr", 28.0, "R4"),
        ("goris-no-filter", "counterfactual.psnr", 33.0, "R5"),
        ("goris-no-effect-mask", "counterfactual.psnr", 33.0, "R6"),
        ("goris-no-material-inpainting", "counterfactual.psnr.footprint", 34.0, "R7"),
        ("goris-no-region", "counterfactual.psnr.mirror", 34.0, "R8"),
        ("goris-no-normals", "counterfactual.psnr", 33.0, "R9"),
        ("goris-weights-5", "counterfactual.psnr", 29.0, "R10"),
        ("goris-weights-0.2", "counterfactual.psnr", 33.0, "R10"),
        ("goris-telea", "counterfactual.psnr", 33.0, "R11"),
        ("goris-references-5", "counterfactual.psnr", 34.0, "R12"),
        ("goris-distilled", "counterfactual.psnr", 27.0, "R13"),
        ("do-nothing", "counterfactual.residual.mirror.specular", 0.1, "R14"),
        ("goris", "counterfactual.residual.shadow.diffuse", 0.3, "R15"),
        ("goris-release", "counterfactual.psnr.footprint", 30.0, "R16"),
        ("goris", "f0.mae", 0.4, "R17"),
        ("goris", "glossy.iou", 0.3, "R17"),
        ("input", "diffuse.psnr", 35.0, "R17"),
        ("removal", "normal.mean_angle", 5.0, "R17"),
    ],
)
def test_one_figure_of_the_other_sign_contradicts(row: str, metric: str, value: float, claim: str) -> None:
    table = as_in_the_paper()
    assert verdicts(table | {row: table[row] | {metric: value}})[claim] == "contradicted"
