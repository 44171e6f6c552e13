# SPDX-License-Identifier: Apache-2.0
import tomllib
from typing import Any, cast

import pytest

from graycard import RecordError, UnknownNameError
from graycard.io import from_builtins, to_builtins
from graycard.methods.priors import Override, PriorSpec, of_kind, parse_priors

TOML = """
source = "oracle"
severity = 2
seed = 7
[overrides.depth]
severity = 4
errors = { kappa = 0.3 }
[overrides.inpainting]
source = "classical"
[overrides.normal]
source = "pretrained"
path = "weights/normal.pt"
"""


def test_a_spec_reads_and_writes_as_data():
    spec = from_builtins(PriorSpec, tomllib.loads(TOML))
    assert from_builtins(PriorSpec, to_builtins(spec)) == spec
    depth = of_kind(spec, "depth")
    assert (depth.source, depth.severity, depth.seed, depth.errors.kappa) == ("oracle", 4, 7, 0.3)
    assert depth.errors.scale == 0.2  # the rest is that of severity 4
    assert of_kind(spec, "base_color").severity == 2
    assert of_kind(spec, "inpainting").source == "classical"
    assert str(of_kind(spec, "normal").weights) == "weights/normal.pt"
    assert str(spec) == (
        "oracle, severity 2; depth: oracle, severity 4, kappa 0.3; inpainting: classical; normal: pretrained"
    )


def test_the_classical_source_has_a_choice_of_inpainting():
    text = 'source = "oracle"\n[overrides.inpainting]\nsource = "classical"\nalgorithm = "telea"'
    spec = from_builtins(PriorSpec, tomllib.loads(text))
    assert spec == PriorSpec("oracle", overrides={"inpainting": Override("classical", algorithm="telea")})
    assert from_builtins(PriorSpec, to_builtins(spec)) == spec
    assert of_kind(spec, "inpainting").algorithm == "telea"
    assert str(spec) == "oracle, severity 0; inpainting: classical, telea"
    alone = PriorSpec("classical", overrides={"inpainting": Override(algorithm="telea")})
    assert of_kind(alone, "inpainting").algorithm == "telea"
    assert hash(alone) != hash(PriorSpec("classical"))
    assert of_kind(PriorSpec("classical"), "inpainting").algorithm == "biharmonic"
    assert of_kind(PriorSpec("classical"), "depth").algorithm == ""
    assert of_kind(PriorSpec("oracle"), "inpainting").algorithm == ""


def test_specs_of_before_there_was_a_choice_mean_what_they_meant():
    assert to_builtins(PriorSpec("oracle", 2)) == {
        "source": "oracle", "severity": 2, "seed": 0, "path": "", "overrides": {}
    }  # fmt: skip
    old = {"source": None, "severity": 4, "path": None, "errors": {"kappa": 0.3}}
    spec = from_builtins(PriorSpec, {"source": "oracle", "overrides": {"depth": old}})
    assert spec.overrides == {"depth": Override(severity=4, errors={"kappa": 0.3})}


def test_equal_specs_hash_alike_and_others_do_not():
    spec = PriorSpec("oracle", 2, overrides={"depth": Override(errors={"kappa": 0.3})})
    again = PriorSpec("oracle", 2, overrides={"depth": Override(errors={"kappa": 0.3})})
    others = {PriorSpec(), PriorSpec("oracle", 2), PriorSpec("oracle", 2, 1), PriorSpec("classical")}
    assert {spec, again} == {spec}
    assert len({spec, *others}) == 5


def test_weights_are_a_folder_or_a_file_of_the_kind(tmp_path):
    (tmp_path / "depth").mkdir()
    spec = PriorSpec("pretrained", path=str(tmp_path))
    assert of_kind(spec, "depth").weights == tmp_path / "depth"
    assert of_kind(spec, "inpainting").weights == tmp_path / "inpainting.pt"
    assert of_kind(PriorSpec("pretrained"), "depth").weights is None
    assert of_kind(PriorSpec("oracle", path=str(tmp_path)), "depth").weights is None


@pytest.mark.parametrize(
    ("wrong", "error", "message"),
    [
        ({"severity": 6}, ValueError, "expected a severity of 0 to 5, got 6"),
        ({"severity": -1}, ValueError, "expected a severity of 0 to 5, got -1"),
        ({"severity": True}, ValueError, "expected a severity of 0 to 5, got True"),
        ({"seed": -3}, ValueError, "expected a seed >= 0 of the priors, got -3"),
        ({"source": "orcale"}, UnknownNameError, "did you mean 'oracle'"),
        ({"overrides": {"dpeth": Override()}}, UnknownNameError, "did you mean 'depth'"),
        ({"overrides": {"depth": Override(severity=9)}}, ValueError, "0 to 5, got 9"),
        (
            {"overrides": {"depth": Override(source=cast(Any, "cnn"))}},
            UnknownNameError,
            "source of priors",
        ),
        (
            {"overrides": {"depth": Override(errors={"kapa": 1.0})}},
            UnknownNameError,
            "error of depth that exists, got 'kapa'.*did you mean 'kappa'",
        ),
        (
            {"overrides": {"depth": Override(errors={"kappa": -1.0})}},
            ValueError,
            "expected kappa of depth to be finite and >= 0, got -1",
        ),
        (
            {"overrides": {"depth": Override(errors={"kappa": float("nan")})}},
            ValueError,
            "expected kappa of depth to be finite",
        ),
        (
            {"source": "classical", "overrides": {"depth": Override(errors={"kappa": 1.0})}},
            ValueError,
            "expected errors of depth with source oracle only, got them with classical",
        ),
        (
            {"overrides": {"inpainting": Override("classical", algorithm="tela")}},
            UnknownNameError,
            "algorithm of inpainting that exists, got 'tela'.*did you mean 'telea'",
        ),
        (
            {"overrides": {"inpainting": Override(algorithm="telea")}},
            ValueError,
            "an algorithm of inpainting with source classical only, got 'telea' of inpainting with oracle",
        ),
        (
            {"overrides": {"depth": Override("classical", algorithm="telea")}},
            ValueError,
            "an algorithm of inpainting with source classical only, got 'telea' of depth with classical",
        ),
    ],
)
def test_what_cannot_be_is_refused(wrong: dict, error: type[Exception], message: str):
    with pytest.raises(error, match=message):
        PriorSpec(**{"source": "oracle", **wrong})


def test_in_a_file_it_is_the_record_that_is_wrong():
    with pytest.raises(RecordError, match="expected a severity of 0 to 5, got 8"):
        from_builtins(PriorSpec, {"source": "oracle", "severity": 8})
    with pytest.raises(RecordError, match="did you mean 'severity'"):
        from_builtins(PriorSpec, {"source": "oracle", "severitty": 1})


def test_a_spec_in_a_word(tmp_path):
    (tmp_path / "mine.toml").write_text(TOML)
    assert parse_priors("none") == PriorSpec()
    assert parse_priors("oracle") == PriorSpec("oracle")
    assert parse_priors("oracle:3") == PriorSpec("oracle", 3)
    assert parse_priors("pretrained:/w:1") == PriorSpec("pretrained", path="/w:1")
    assert parse_priors(str(tmp_path / "mine.toml")).overrides["depth"].severity == 4


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("orcale:2", UnknownNameError, "did you mean 'oracle'"),
        (
            "oracle:worst",
            RecordError,
            "expected priors as in oracle:3, pretrained:own or pretrained:FOLDER, got 'oracle:wo",
        ),
        ("oracle:9", RecordError, "expected a severity of 0 to 5, got 9"),
        ("classical:1", RecordError, "expected priors as in oracle:3"),
        ("nowhere.toml", RecordError, "expected a TOML file at nowhere.toml, got"),
    ],
)
def test_words_that_are_none(text: str, error: type[Exception], message: str):
    with pytest.raises(error, match=message):
        parse_priors(text)
