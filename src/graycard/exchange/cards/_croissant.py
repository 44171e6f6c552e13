# SPDX-License-Identifier: Apache-2.0
"""A dataset as a Croissant manifest (MLCommons, version 1.0): JSON-LD that catalogues and loaders read."""

from collections.abc import Iterator
from typing import Any

from graycard.exchange.cards._survey import Publication, SceneFacts, Survey

CONFORMS = "http://mlcommons.org/croissant/1.0"
_CONTEXT: dict[str, Any] = {
    "@language": "en", "@vocab": "https://schema.org/", "citeAs": "cr:citeAs", "column": "cr:column",
    "conformsTo": "dct:conformsTo", "equivalentProperty": "cr:equivalentProperty", "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/", "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"}, "dct": "http://purl.org/dc/terms/",
    "examples": {"@id": "cr:examples", "@type": "@json"}, "extract": "cr:extract", "field": "cr:field",
    "fileProperty": "cr:fileProperty", "fileObject": "cr:fileObject", "fileSet": "cr:fileSet",
    "format": "cr:format", "includes": "cr:includes", "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath", "key": "cr:key", "md5": "cr:md5", "parentField": "cr:parentField",
    "path": "cr:path", "recordSet": "cr:recordSet", "references": "cr:references", "regex": "cr:regex",
    "repeated": "cr:repeated", "replace": "cr:replace", "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/", "separator": "cr:separator", "source": "cr:source",
    "subField": "cr:subField", "transform": "cr:transform",
}  # fmt: skip
_FIELDS = {
    "track": ("sc:Text", "Question that the scene asks: dark, tabletop or multilight."),
    "scene": ("sc:Text", "Name of the scene; its files are below track/scene/."),
    "family": ("sc:Text", "Generator of the scene; empty for imported photographs."),
    "seed": ("sc:Text", "Seed of the generator; empty where there is none, or where it is secret."),
    "width": ("sc:Integer", "Pixels across."),
    "height": ("sc:Integer", "Pixels down."),
    "train_views": ("sc:Integer", "Photographs that a method may see."),
    "test_views": ("sc:Integer", "Views that are held out."),
    "truth": ("sc:Boolean", "Whether light, albedo, normals and materials of the scene are known."),
}
LIMITS = (
    "Synthetic scenes: their light, shapes and materials are simpler than those of the world. Estimated "
    "layers hold the noise of Monte Carlo, whose variance comes with them. Equal numbers here do not mean "
    "equal numbers on photographs."
)
"""Limits of every rendered dataset, in words."""
_LIMITS_OF_IMPORTS = (
    "Imported photographs: light is in units of display white, and cameras are as true as the program that "
    "found them."
)
_RENDERED = "Rendered by graycard.synth with Mitsuba 3 from a family, a seed and knobs."
_IMPORTED = "Photographs and cameras of others, taken over by graycard import."
_NOBODY = "None: no person and no place is shown."
_UNKNOWN = "Not known to graycard: whoever publishes imported photographs answers for what they show."


def croissant(found: Survey, told: Publication) -> dict[str, Any]:
    """Return the manifest of a dataset as JSON data.

    Each manifest of a part of a scene is a file with its SHA-256; it has the SHA-256 of all other files.

    Args:
        found: The dataset.
        told: What only its publisher knows.
    """
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": CONFORMS,
        "name": found.name,
        "description": describe(found),
        "license": told.license,
        "url": told.url,
        "version": found.version,
        "datePublished": told.date,
        **({} if found.imported else _origin(told)),
        "keywords": ["inverse rendering", "intrinsic images", "relighting", "ground truth"],
        "isLiveDataset": False,
        "rai:dataCollection": _of_kinds(found, _RENDERED, _IMPORTED),
        "rai:dataLimitations": limits(found),
        "rai:personalSensitiveInformation": _UNKNOWN if found.imported else _NOBODY,
        "distribution": [*_files(found)],
        "recordSet": [_scenes(found)],
    }


def describe(found: Survey) -> str:
    """Return what a dataset is, in two sentences."""
    views = sum(scene.train_views + scene.test_views for scene in found.scenes)
    known = sum(scene.truth for scene in found.scenes)
    return (
        f"{len(found.scenes)} scenes for inverse rendering (tracks {', '.join(found.tracks)}) with {views} "
        f"views. Light, albedo, normals and materials of {known} are known exactly or with their variance. "
        "Photographs are linear light in OpenEXR."
    )


def limits(found: Survey) -> str:
    """Return the limits of a dataset, in words."""
    return _of_kinds(found, LIMITS, _LIMITS_OF_IMPORTS)


def _of_kinds(found: Survey, of_rendered: str, of_imported: str) -> str:
    """Return what holds of the kinds of scenes that a dataset has."""
    rendered = len(found.scenes) - found.imported
    return " ".join([of_rendered] * (rendered > 0) + [of_imported] * (found.imported > 0))


def _origin(told: Publication) -> dict[str, Any]:
    """Return who has made a dataset of rendered scenes, and how to cite it."""
    creator = {"@type": "sc:Organization", "name": "graycard", "url": told.url}
    return {"creator": creator, "citeAs": "CITATION.cff of graycard"}


def _files(found: Survey) -> Iterator[dict[str, Any]]:
    for scene in found.scenes:
        for one in scene.manifests:
            yield {
                "@type": "cr:FileObject",
                "@id": one.path,
                "name": one.path,
                "description": f"SHA-256 of the {one.files} files beside it.",
                "contentUrl": one.path,
                "contentSize": f"{one.bytes} B",
                "encodingFormat": "application/json",
                "sha256": one.sha256,
            }


def _scenes(found: Survey) -> dict[str, Any]:
    fields = [
        {"@type": "cr:Field", "@id": f"scenes/{name}", "name": name, "description": what, "dataType": kind}
        for name, (kind, what) in _FIELDS.items()
    ]
    return {
        "@type": "cr:RecordSet",
        "@id": "scenes",
        "name": "scenes",
        "description": "One record a scene.",
        "key": [{"@id": "scenes/track"}, {"@id": "scenes/scene"}],
        "field": fields,
        "data": [{f"scenes/{name}": _value(scene, name) for name in _FIELDS} for scene in found.scenes],
    }


def _value(scene: SceneFacts, name: str) -> Any:
    value = getattr(scene, name)
    return "" if value is None else str(value) if name == "seed" else value
