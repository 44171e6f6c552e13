# SPDX-License-Identifier: Apache-2.0
"""The strip of a track: photograph, truth, the best method, the next one, and where the best one is wrong."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from graycard.records import JobResult, MetricRecord
from graycard.reports._comparison import ViewPictures
from graycard.reports._scene_section import SceneSection
from graycard.reports._tracks import words_of
from graycard.reports.pictures._layer_rows import LayerRow, Tile
from graycard.reports.pictures._pictures import PagePicture, seen_picture
from graycard.reports.tables._cells import Cell, pool, read_metric
from graycard.reports.tables._compared import Compared
from graycard.reports.tables._help import MetricHead, metric_head
from graycard.reports.tables._summary import part_of
from graycard.reports.tables._verdicts import LeaderVerdict

_LAYERS = {
    "albedo": "base_color",
    "counterfactual": "counterfactual.radiance",
    "novel_view": "radiance",
    "normal": "normal",
    "depth": "depth",
}
"""The layer that shows what a group of metrics judges."""


@dataclass(frozen=True, slots=True)
class StripPicture:
    """One picture of a strip."""

    label: str
    """Title, as ``best`` and ``error of goris``."""
    method: str
    """Whose it is; empty for the photograph and the truth."""
    picture: PagePicture
    note: str = ""


@dataclass(frozen=True, slots=True)
class Opening:
    """Opening of a page by a track."""

    part: str
    """Part of a decomposition, in words."""
    metric: MetricHead
    verdict: LeaderVerdict
    layer: str
    """Title of the layer that is shown; empty without pictures."""
    scene: str
    """Name of the scene that is shown."""
    anchor: str
    view: str
    rule: str
    pictures: tuple[StripPicture, ...]


@dataclass(frozen=True, slots=True)
class _Choice:
    """Subject of a strip."""

    metric: MetricRecord
    layer: str
    order: tuple[str, ...]
    """Competing methods, the best first."""


def open_track(
    track: str,
    results: Sequence[JobResult],
    metrics: Sequence[MetricRecord],
    compared: Compared,
    scenes: Sequence[SceneSection],
    variants: Collection[str],
) -> Opening | None:
    """Return how a page begins with a track; None where no competing method leads in anything.

    Shown is the best method that has pictures, in the scene where its score is the median over scenes with
    pictures, in the first test view there.
    """
    choice = _choose(track, metrics, compared, variants)
    if choice is None:
        return None
    metric, verdict = choice.metric, compared.verdicts[choice.metric.id]
    words = words_of(track).headline.get(metric.id, part_of(metric.group))
    found = _median_scene(choice, results, scenes)
    if found is None:
        return Opening(words, metric_head(metric), verdict, "", "", "", "", "", ())
    scene, view, row, (best, second) = found
    unit = f" {metric.unit}" if metric.unit not in ("", "1") else ""
    notes = {
        name: f"{_cell(results, scene.name, name, metric).text}{unit} in this scene"
        for name in (best, second)
        if name
    }
    rule = (
        f"{scene.name}, {view.name}: the first embedded view of the scene where {best} has its median score. "
        "Error colours are from 0 to " + f"{row.error_scale.high.removeprefix('≥ ')} {row.error_scale.unit}."
    )
    return Opening(
        words,
        metric_head(metric),
        verdict,
        row.title,
        scene.name,
        scene.anchor,
        view.name,
        rule,
        tuple(_pictures(scene, view, row, _labels(choice.order, best, second), notes)),
    )


def _choose(
    track: str, metrics: Sequence[MetricRecord], compared: Compared, variants: Collection[str]
) -> _Choice | None:
    wanted, layer = words_of(track).shown
    first = [m for m in metrics if m.id == wanted]
    others = (
        [m for m in metrics if m.headline and m.group in _LAYERS]
        + [m for m in metrics if m.headline]
        + [*metrics]
    )
    for metric in [*first, *others]:
        verdict = compared.verdicts.get(metric.id)
        if verdict is not None and verdict.leader:
            shown = layer if metric.id == wanted else _LAYERS.get(metric.group, "radiance")
            return _Choice(metric, shown, _order(metric, compared, variants))
    return None


def _order(metric: MetricRecord, compared: Compared, variants: Collection[str]) -> tuple[str, ...]:
    standings = [s for (name, _), s in compared.standings.items() if name == metric.id]
    whole = [s for s in standings if s.competes and s.mean is not None and s.scenes == s.expected]
    ranked = sorted(whole, key=lambda s: s.mean or 0.0, reverse=metric.higher_is_better)
    return tuple(s.method for s in ranked if s.method not in variants)


def _median_scene(
    choice: _Choice, results: Sequence[JobResult], scenes: Sequence[SceneSection]
) -> tuple[SceneSection, ViewPictures, LayerRow, tuple[str, str]] | None:
    """Return scene, view and layer to show, with the best methods that have pictures there."""
    for best in choice.order:
        found = []
        for scene in scenes:
            shown = _shown(scene, choice.layer, best)
            value = _cell(results, scene.name, best, choice.metric).value
            if shown and value is not None:
                found.append((value, scene, *shown))
        if found:
            found.sort(key=lambda item: item[0])
            _, scene, view, row = found[(len(found) - 1) // 2]
            later = choice.order[choice.order.index(best) + 1 :]
            second = next((name for name in later if _tile(scene, row, name)), "")
            return scene, view, row, (best, second)
    return None


def _shown(scene: SceneSection, layer: str, method: str) -> tuple[ViewPictures, LayerRow] | None:
    for view in scene.pictures.gallery.views[:1] if scene.pictures else ():
        for row in view.rows:
            if row.layer == layer and row.truth.picture and _tile(scene, row, method):
                return view, row
    return None


def _tile(scene: SceneSection, row: LayerRow, method: str) -> Tile | None:
    assert scene.pictures is not None
    names = scene.pictures.methods
    tile = row.predictions[names.index(method)] if method in names else None
    return tile if tile and tile.picture else None


def _cell(results: Sequence[JobResult], scene: str, method: str, metric: MetricRecord) -> Cell:
    own = [r for r in results if (r.job.scene, r.job.method) == (scene, method)]
    return pool([read_metric(r, metric.id) for r in own], metric.unit)


def _labels(order: Sequence[str], best: str, second: str) -> dict[str, str]:
    """Return the words above the pictures of the best method and the next one that have pictures."""
    found = {best: "best" if best == order[0] else "best with pictures"}
    if second:
        found[second] = "next" if [best, second] == list(order[:2]) else "next with pictures"
    return found


def _pictures(
    scene: SceneSection,
    view: ViewPictures,
    row: LayerRow,
    labels: dict[str, str],
    notes: dict[str, str],
) -> list[StripPicture]:
    assert scene.pictures is not None
    photograph = next((r.truth.picture for r in view.rows if r.layer == "radiance"), None)
    found = [("photograph", "", photograph, ""), ("truth", "", row.truth.picture, row.title)]
    for name, label in labels.items():
        tile = _tile(scene, row, name)
        if tile:
            found.append((label, name, tile.picture, notes[name]))
    best = next(iter(labels))
    index = scene.pictures.methods.index(best)
    found.append(("error", best, row.errors[index].picture if row.errors else None, row.error_scale.unit))
    return [StripPicture(label, name, seen_picture(p), note) for label, name, p, note in found if p]
