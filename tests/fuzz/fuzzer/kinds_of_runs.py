# SPDX-License-Identifier: Apache-2.0
"""Kinds of what runs are made of and leave: records, ledgers, baselines, suites, claims and priors."""

from pathlib import Path

from fuzzer.kind import Kind, cli, each
from fuzzer.kinds_of_data import any_file, one_of
from fuzzer.plain import attack_lines
from fuzzer.structure import attack_json, attack_toml

_REPORT = ("run/report", "run/comparison.json", "run/claims.json")


def _run(folder: Path, out: Path) -> None:
    run = folder / "run"
    each(
        lambda: cli("compare", run, "--against", "gray", "--pairs", "--json", out / "c.json"),
        lambda: cli("gate", run, "--baseline", folder / "baseline.json", "--json", out / "g.json"),
        lambda: cli("gate", run, "--baseline", out / "made.json", "--write"),
        lambda: cli("check-result", run, "--json", out / "v.json"),
        lambda: cli("claims", run, "--claims", folder / "claims.toml", "--checks", "--power"),
        lambda: cli("report", run),
    )


def _report(folder: Path, out: Path) -> None:
    run = folder / "run"
    each(lambda: cli("report", run), lambda: cli("compare", run), lambda: cli("check-result", run))


def _jobs(folder: Path, out: Path) -> None:
    run = folder / "run"
    each(lambda: cli("check-result", run, "--json", out / "v.json"), lambda: cli("report", run))


def _gate(folder: Path, out: Path) -> None:
    cli("gate", folder / "run", "--baseline", folder / "baseline.json", "--json", out / "g.json")


def _published(folder: Path, out: Path) -> None:
    run = folder / "published" / "tiny"
    each(
        lambda: cli("compare", run),
        lambda: cli("claims", run, "--claims", folder / "claims.toml", "--republish"),
        lambda: cli("claims", run, "--history"),
        lambda: cli("claims", folder / "published", "--history"),
    )


def _claims(folder: Path, out: Path) -> None:
    from graycard.benchmarks.claims import load_claims

    path = folder / "claims.toml"
    each(
        lambda: load_claims(str(path)),
        lambda: cli("claims", folder / "run", "--claims", path, "--checks", "--power"),
        lambda: cli("claims", "--claims", path),
    )


def _suite(folder: Path, out: Path) -> None:
    from graycard.benchmarks import load_suite, narrow, opened
    from graycard.benchmarks._introduction import introduction_of

    suite = load_suite(str(folder / "suite.toml"))
    each(
        lambda: narrow(suite, ["dark"], ["gray-dark"]),
        lambda: opened(suite),
        *(lambda m=method: introduction_of(m) for method in suite.methods),
        *(lambda s=scene: suite.render_of(s) for scene in suite.scenes),
    )


def _priors(folder: Path, out: Path) -> None:
    from graycard.methods import asks_of, load_method
    from graycard.methods.priors import check_priors, parse_priors, unanswered

    path = folder / "priors.toml"
    text = (folder / "priors.txt").read_text(errors="replace")
    asks = asks_of(load_method("gsid"))
    each(
        lambda: check_priors(parse_priors(str(path)), asks),
        lambda: unanswered(parse_priors(text), asks),
    )


RUNS = (
    Kind(
        "run.json",
        ("run", "baseline.json", "claims.toml"),
        one_of("run/run.json", attack_json),
        _run,
        writes=_REPORT,
        weight=2,
    ),
    Kind("comparison.json", ("run",), one_of("run/comparison.json", attack_json), _report, writes=_REPORT),
    Kind("claims.json", ("run",), one_of("run/claims.json", attack_json), _report, writes=_REPORT),
    Kind("jobs of a run", ("run",), one_of("run/jobs/**/*.json", attack_json), _jobs, writes=_REPORT),
    Kind("suite.json of a run", ("run",), one_of("run/suite.json", attack_json), _jobs, writes=_REPORT),
    Kind("folders of a run", ("run",), any_file("run"), _report, writes=_REPORT),
    Kind("baseline.json", ("run", "baseline.json"), one_of("baseline.json", attack_json), _gate, weight=2),
    Kind(
        "published run",
        ("published", "claims.toml"),
        any_file("published"),
        _published,
        writes=("published",),
    ),
    Kind(
        "claims toml",
        ("run", "claims.toml"),
        one_of("claims.toml", attack_toml),
        _claims,
        writes=_REPORT,
        weight=2,
    ),
    Kind("suite toml", ("suite.toml",), one_of("suite.toml", attack_toml), _suite, weight=16),
    Kind(
        "priors toml and text",
        ("priors.toml", "priors.txt"),
        lambda rng, folder: rng.choice(
            (one_of("priors.toml", attack_toml), one_of("priors.txt", attack_lines))
        )(rng, folder),
        _priors,
        weight=16,
    ),
)
