# SPDX-License-Identifier: Apache-2.0
"""Secret scenes follow from a salt, and nothing outside of their truth shows a seed."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from graycard import GraycardError, OutputError, RecordError
from graycard.benchmarks import (
    Salt,
    SecretScenes,
    check_result,
    load_suite,
    read_salt,
    run_bench,
    suite_names,
    with_secret,
    write_salt,
)
from graycard.benchmarks._handed import places_of
from graycard.benchmarks._ranges import SceneTemplate
from graycard.benchmarks.training import TRAINING, VALIDATION
from graycard.cli import main
from graycard.dataset import SECRET_SEEDS
from graycard.edits import Donor
from graycard.io import dumps, read_manifest, silent, write_manifest
from graycard.records import CLAIMS, COMPARISON, read_run
from graycard.reports import write_report
from graycard.synth import (
    RenderSettings,
    SecretSpec,
    describe,
    donor_scene,
    find_scene,
    scene_name,
)
from graycard.synth.dataset._store import Place
from tiny_benches import made_without_renderer
from valid_runs import breaches, change

SALT, OTHER = Salt(bytes(range(32))), Salt(b"another salt of thirty-two bytes")
SUITE = """
name = "tiny-secret"
version = 1
title = "One dark room that all know, and three that nobody does"
[secret]
count = 3
commitment = "{commitment}"
scenes = [
    {{ track = "dark", family = "corridor", knobs = {{ gloss = [0.0, 0.25] }} }},
    {{ track = "dark", family = "shelf-room" }},
]
[render]
[[scenes]]
track = "dark"
family = "corridor"
seed = 1
[[methods]]
name = "truth"
[[methods]]
name = "gray"
"""
NAMES = ["corridor-0001", "corridor-secret-001", "shelf-room-secret-002", "corridor-secret-003"]


@pytest.fixture
def suite_file(tmp_path: Path) -> Path:
    path = tmp_path / "tiny-secret.toml"
    path.write_text(SUITE.format(commitment=SALT.commitment))
    return path


@pytest.fixture
def salt_file(tmp_path: Path) -> Path:
    path = tmp_path / "judge.salt"
    path.write_text(SALT.content.hex() + "\n")
    path.chmod(0o600)
    return path


@pytest.fixture
def secret_run(
    tmp_path: Path, suite_file: Path, monkeypatch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]
) -> Path:
    """A run with the secret scenes."""
    made_without_renderer(monkeypatch, write_tiny)
    run = tmp_path / "run"
    run_bench(with_secret(load_suite(str(suite_file)), SALT), run, 1, silent)
    change(run, lambda data: data["environment"].update(git_commit="0123456789ab"))
    return run


def of_kinds(count: int = 3) -> SecretScenes:
    kinds = SceneTemplate("dark", "corridor"), SceneTemplate("multilight", "studio")
    return SecretScenes(count, SALT.commitment, kinds)


def test_a_salt_is_written_for_its_owner_alone(tmp_path: Path) -> None:
    path = tmp_path / "keys" / "judge.salt"
    salt = write_salt(path)
    assert path.stat().st_mode & 0o777 == 0o600
    assert read_salt(path) == salt
    assert len(salt.content) == 32
    assert write_salt(tmp_path / "second.salt") != salt
    with pytest.raises(OutputError, match="expected a new file for a salt, got .* which is there already"):
        write_salt(path)
    assert read_salt(path) == salt
    assert salt.content.hex() not in repr(salt)


def test_the_commitment_is_that_of_other_programs() -> None:
    assert SALT.commitment == "630dcd2966c4336691125448bbb25b4ff412a49c732db2c8abc1b8581bd710dd"


def test_seeds_follow_from_the_salt_by_a_rule_that_stays() -> None:
    """By OpenSSL: HMAC-SHA256 over ``graycard-secret-1/dark/corridor/1``."""
    digest = int("5c3f726319540f5d", 16)
    assert SALT.seed("dark", "corridor", 1) == 2**63 + (digest >> 1)
    seeds = [spec.seed for spec in of_kinds(500).drawn(SALT)]
    assert len({*seeds}) == 500
    assert OTHER.seed("dark", "corridor", 1) != SALT.seed("dark", "corridor", 1)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "got No such file"),
        (b"abcd\n", "got 4 characters"),
        (b"a" * 63, "got 63 characters"),
        (b"a" * 66, "got 66 characters"),
        (b"g" * 64, "got other characters"),
        (b"\xff" * 64, "got a file that is no text"),
    ],
)  # fmt: skip
def test_a_file_that_holds_no_salt(tmp_path: Path, content: bytes | None, words: str) -> None:
    path = tmp_path / "judge.salt"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(RecordError, match=words) as raised:
        read_salt(path)
    assert "64 hexadecimal digits" in str(raised.value)
    assert content is None or content.decode("latin-1").strip() not in str(raised.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("count = 3", "count = 0", "expected 1 to 1000 secret scenes, got 0"),
        ('commitment = "630d', 'commitment = "630D', "expected a commitment of 64 hexadecimal digits"),
        ('"shelf-room"', '"hall"', "dark/hall"),
        ("gloss = [0.0, 0.25]", "gloss = [7.0]", "gloss"),
        ("seed = 1\n", f"seed = {SECRET_SEEDS.start}\n", "expected seeds below 9223372036854775808"),
    ],
)  # fmt: skip
def test_secret_scenes_that_cannot_be(suite_file: Path, old: str, new: str, words: str) -> None:
    assert old in suite_file.read_text()
    suite_file.write_text(suite_file.read_text().replace(old, new, 1))
    with pytest.raises(GraycardError, match=words):
        load_suite(str(suite_file))


def test_no_other_seed_is_one_of_secret_scenes() -> None:
    """Suites name theirs in TOML, whose whole numbers end below."""
    suites = map(load_suite, suite_names())
    ranges = [r.seeds for s in suites for r in (s.reserve, s.sealed) if r]
    assert max(last for _, last in ranges) < SECRET_SEEDS.start
    assert max(*TRAINING, *VALIDATION) < SECRET_SEEDS.start


def test_neither_text_nor_json_of_a_secret_scene_has_its_seed() -> None:
    for spec in of_kinds().drawn(SALT):
        for text in (repr(spec), str(spec), dumps(spec), scene_name(spec), describe(spec)):
            assert str(spec.seed) not in text
            assert f"{spec.seed:x}" not in text
    assert describe(of_kinds().drawn(SALT)[0]).endswith("(secret seed)")
    with pytest.raises(ValueError, match="expected a seed of secret scenes"):
        SecretSpec("dark", "corridor", 5, {}, "mine")


def test_the_donor_of_a_secret_scene_has_a_name_that_hides_its_seed() -> None:
    seed = SALT.seed("multilight", "studio", 1)
    found = [
        donor_scene(Donor("multilight", "objects", s, {}, "ball", 1)) for s in (seed, seed, seed + 1, 12)
    ]
    first, again, other, public = map(scene_name, found)
    assert first == again != other
    assert first.startswith("objects-secret-donor-")
    assert public == "objects-0012"
    assert found[0].seed == seed


def test_a_suite_says_whose_secret_it_is(suite_file: Path) -> None:
    suite = load_suite(str(suite_file))
    assert [scene_name(spec) for spec in with_secret(suite, SALT).scenes] == NAMES
    with pytest.raises(
        RecordError, match=r"expected the salt that the suite is committed to \(SHA-256 630dcd29"
    ):
        with_secret(suite, OTHER)
    with pytest.raises(RecordError, match="expected a suite with secret scenes, got 'demo'"):
        with_secret(load_suite("demo"), SALT)


def test_nothing_but_the_truth_shows_a_seed(
    secret_run: Path, suite_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = read_run(secret_run)
    assert [scene.scene for scene in record.scenes] == NAMES
    assert [scene.seed for scene in record.scenes] == [1, None, None, None]
    assert record.commitment == SALT.commitment
    write_report(secret_run)
    assert main(["compare", str(secret_run), "--pairs", "--json", str(secret_run / "pairs.json")]) == 0
    check_result(secret_run)
    seeds = [s.seed for s in with_secret(load_suite(str(suite_file)), SALT).scenes[1:]]
    shown = capsys.readouterr()
    hidden = {text for seed in seeds for text in (str(seed).encode(), f"{seed:x}".encode())}
    hidden |= {SALT.content, SALT.content.hex().encode()}
    files = [p for p in secret_run.rglob("*") if p.is_file()]
    with_seeds = [p for p in files if any(text in p.read_bytes() for text in hidden)]
    assert not any(text.decode("latin-1") in shown.out + shown.err for text in hidden)
    assert {p.parent.name for p in with_seeds} == {"truth"}, "the manifests of truth, and nothing else"
    assert len(with_seeds) == 3
    for name in ("run.json", COMPARISON, "suite.json", "report/index.html"):
        assert (secret_run / name).is_file()
    assert CLAIMS not in {p.name for p in files}


def test_secret_scenes_of_several_benches_come_in_the_order_of_the_suite(
    tmp_path: Path,
    suite_file: Path,
    salt_file: Path,
    monkeypatch: pytest.MonkeyPatch,
    write_tiny: Callable[..., Path],
) -> None:
    made_without_renderer(monkeypatch, write_tiny)
    command = ["bench", str(suite_file), "--salt", str(salt_file), "--out", str(tmp_path / "run")]
    for name in (NAMES[3], NAMES[1], NAMES[0]):
        assert main([*command, "--scenes", name]) == 0
    assert [scene.scene for scene in read_run(tmp_path / "run").scenes] == [NAMES[0], NAMES[1], NAMES[3]]


def test_only_the_salt_makes_a_run_valid(
    secret_run: Path, salt_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = check_result(secret_run)
    assert [(b.rule, b.unknown) for b in found.breaches if b.rule in ("seeds", "suite")] == [("seeds", True)]
    assert "expected the salt of the secret scenes, got none" in breaches(secret_run)["seeds"][0]
    opened = check_result(secret_run, salt=SALT)
    assert not [b for b in opened.breaches if b.rule in ("seeds", "suite", "counts", "hashes")]
    assert not opened.part
    assert main(["check-result", str(secret_run), "--salt", str(salt_file)]) == opened.exit_code
    wrong = tmp_path / "wrong.salt"
    write_salt(wrong)
    capsys.readouterr()
    assert main(["check-result", str(secret_run), "--salt", str(wrong)]) == 2
    said = capsys.readouterr().err
    assert "expected the salt that the suite is committed to" in said
    assert wrong.read_text().strip() not in said


def test_a_scene_of_another_seed_is_found(secret_run: Path) -> None:
    truth = secret_run / "dataset" / "dark" / NAMES[2] / "truth"
    manifest = read_manifest(truth, "graycard-truth")
    easy = {**manifest.seeds, "scene": SALT.seed("dark", "corridor", 1)}
    write_manifest(truth, replace(manifest, seeds=easy))
    found = [str(b) for b in check_result(secret_run, salt=SALT).breaches if b.rule == "seeds"]
    assert len(found) == 1
    assert f"dark/{NAMES[2]}: expected the seed that follows from the salt, got another" in found[0]
    assert str(easy["scene"]) not in found[0]


@pytest.mark.parametrize("commitment", ["", OTHER.commitment])
def test_a_run_that_names_another_salt(secret_run: Path, commitment: str) -> None:
    change(secret_run, lambda data: data.update(commitment=commitment))
    found = [str(b) for b in check_result(secret_run, salt=SALT).breaches if b.rule == "seeds"]
    assert any(
        "expected secret scenes of the salt that tiny-secret is committed to (630dcd29" in x for x in found
    )


def test_a_secret_scene_that_is_left_out(secret_run: Path) -> None:
    def drop(data: dict) -> None:
        data["scenes"] = [s for s in data["scenes"] if s["scene"] != NAMES[3]]
        data["results"] = [r for r in data["results"] if r["job"]["scene"] != NAMES[3]]

    change(secret_run, drop)
    found = [str(b) for b in check_result(secret_run, salt=SALT).breaches if b.rule == "suite"]
    assert any(f"dark/{NAMES[3]}: expected this scene" in x for x in found)


def test_without_the_salt_the_public_scenes_are_run(
    tmp_path: Path,
    suite_file: Path,
    salt_file: Path,
    monkeypatch: pytest.MonkeyPatch,
    write_tiny: Callable[..., Path],
    capsys: pytest.CaptureFixture[str],
) -> None:
    made_without_renderer(monkeypatch, write_tiny)
    run = tmp_path / "run"
    command = ["bench", str(suite_file), "--out", str(run), "--jobs", "1"]
    assert main(command) == 0
    said = capsys.readouterr().err
    assert (
        "3 secret scenes of the suite were left out: whoever holds the salt of 630dcd2966c4… adds them"
        in said
    )
    assert [scene.scene for scene in read_run(run).scenes] == NAMES[:1]
    assert check_result(run).part == "part of tiny-secret: without its secret scenes"
    assert main([*command, "--salt", str(salt_file)]) == 0
    said = capsys.readouterr().err
    assert "left out" not in said
    assert "warning" not in said
    assert [scene.scene for scene in read_run(run).scenes] == NAMES
    assert main([*command, "--methods", "gray"]) == 0, "a part is added to what is there"
    assert read_run(run).commitment == SALT.commitment


def test_a_salt_that_does_not_go_with_a_bench(
    tmp_path: Path, suite_file: Path, salt_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path / "run")]
    wrong = tmp_path / "wrong.salt"
    write_salt(wrong)
    for words, command in {
        "expected the salt that the suite is committed to": [str(suite_file), "--salt", str(wrong)],
        "expected a suite with secret scenes, got 'demo'": ["demo", "--salt", str(salt_file)],
        "expected --sealed or --salt, got both": ["claims-dark", "--sealed", "--salt", str(salt_file)],
        "expected --until-decided without --salt": [
            "claims-dark", "--until-decided", "--max-scenes", "12", "--salt", str(salt_file),
        ],
        "got No such file": [str(suite_file), "--salt", str(tmp_path / "none.salt")],
    }.items():  # fmt: skip
        assert main(["bench", *command, *out]) == 2
        assert words in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_the_verb_makes_salts_and_never_prints_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "judge.salt"
    assert main(["salt", "new", str(path)]) == 0
    made = capsys.readouterr()
    salt = read_salt(path)
    assert made.out == f"salt: {path}, commitment {salt.commitment}\n"
    assert main(["salt", "new", str(path)]) == 2
    path.chmod(0o644)
    assert main(["salt", "show", str(path)]) == 0
    shown = capsys.readouterr()
    assert salt.commitment in shown.out
    assert f"warning: others may read {path}" in shown.err
    assert f"chmod 600 {path}" in shown.err
    assert salt.content.hex() not in made.out + made.err + shown.out + shown.err
    path.chmod(0o600)
    assert main(["salt", "show", str(path)]) == 0
    assert not capsys.readouterr().err


def test_what_is_half_made_is_closed_to_fits(tmp_path: Path) -> None:
    """Its stamp has the seed, and its views are truth."""
    place = Place(tmp_path, "dark", "corridor-secret-001")
    closed = places_of(tmp_path / "scratch", [place.final], {}).closed
    for path in (place.stamp, place.partial / "truth" / "views" / "test_000.exr", place.partial / "capture"):
        assert any(path.is_relative_to(folder) for folder in closed)


def test_secret_seeds_are_not_rendered_by_hand(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["render", "dark", "--seed", str(SECRET_SEEDS.start), "--out", str(tmp_path / "data")]
    assert main(command) == 2
    assert "expected a seed below 9223372036854775808" in capsys.readouterr().err


def test_a_folder_with_a_scene_of_another_salt_does_not_tell_its_seed(
    tmp_path: Path, write_tiny: Callable[..., Path]
) -> None:
    kinds = (SceneTemplate("dark", "corridor"),)
    spec, other = (SecretScenes(1, s.commitment, kinds).drawn(s)[0] for s in (SALT, OTHER))
    folder = write_tiny(tmp_path, track="dark", scene=spec.name)
    manifest = read_manifest(folder / "truth", "graycard-truth")
    write_manifest(folder / "truth", replace(manifest, seeds={"scene": other.seed}))
    with pytest.raises(GraycardError, match="got one of another spec") as raised:
        find_scene(spec, RenderSettings(), tmp_path)
    assert "seed: another" in str(raised.value)
    assert str(spec.seed) not in str(raised.value)
    assert str(other.seed) not in str(raised.value)


@pytest.mark.skipif(not Path("/dev/zero").is_char_device(), reason="this system has no such device")
def test_a_salt_is_read_of_a_file_alone():
    with pytest.raises(RecordError, match="got what is no file"):
        read_salt(Path("/dev/zero"))
