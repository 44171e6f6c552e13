# SPDX-License-Identifier: Apache-2.0
"""The table of verbs: the one place to add a verb to the command line.

A row names the module of a verb instead of importing it: ``graycard --help`` must not wait for a renderer.
"""

from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal

from graycard._errors import UnknownNameError

HELP = {"-h", "--help"}
"""Options that ask for help."""
Group = Literal[
    "scenes", "methods", "scores", "runs", "your own data", "this machine", "for developers of graycard"
]
"""A purpose that verbs share, in the order of ``graycard --help``."""


@dataclass(frozen=True, kw_only=True)
class Verb:
    """One verb of the command line."""

    name: str
    """Word that follows ``graycard``."""
    group: Group
    """Purpose under which the help lists it."""
    module: str
    """Module that holds its command, imported when the verb is run or asked for help."""
    command: str
    """Class in that module: a frozen dataclass of options with ``run(terminal, rest)``."""
    help: str
    """One line for ``graycard --help``, at most 64 characters."""
    example: str
    """A whole command that works once the commands before it in README.md have run."""
    resumes: bool = False
    """True if the same command goes on where it was stopped."""

    def load(self) -> type[Any]:
        """Import the command of this verb."""
        return getattr(import_module(f"graycard.cli.{self.module}"), self.command)


VERBS = (
    Verb(
        name="render",
        group="scenes",
        module="_scenes",
        command="RenderCommand",
        help="Render the scenes of a suite, or one scene of a track",
        example="graycard render dark --seed 1234 --out data",
        resumes=True,
    ),
    Verb(
        name="verify",
        group="scenes",
        module="_scenes",
        command="VerifyCommand",
        help="Check the truth of a dataset by physics and a second rendering",
        example="graycard verify data",
    ),
    Verb(
        name="look",
        group="scenes",
        module="_scenes",
        command="LookCommand",
        help="Draw a contact sheet of each scene",
        example="graycard look data",
    ),
    Verb(
        name="scenes",
        group="scenes",
        module="_scenes",
        command="ScenesCommand",
        help="List families and suites, or the knobs of one family",
        example="graycard scenes corridor",
    ),
    Verb(
        name="methods",
        group="methods",
        module="_runs",
        command="MethodsCommand",
        help="List the methods, or show one with its settings",
        example="graycard methods retinex",
    ),
    Verb(
        name="fit",
        group="methods",
        module="_runs",
        command="FitCommand",
        help="Fit a method on a scene and write its predictions",
        example="graycard fit gray data/dark/corridor-1234 --out mine",
    ),
    Verb(
        name="new-method",
        group="methods",
        module="kit",
        command="NewMethodCommand",
        help="Begin a method of your own: a package with tests and CI",
        example="graycard new-method my_method --one-file",
    ),
    Verb(
        name="test-method",
        group="methods",
        module="kit",
        command="TestMethodCommand",
        help="Check the contract of a method in seconds; name each fault",
        example="graycard test-method gray",
    ),
    Verb(
        name="score",
        group="scores",
        module="_scores",
        command="ScoreCommand",
        help="Score predictions, from any code, against the truth of a scene",
        example="graycard score mine data/dark/corridor-1234",
    ),
    Verb(
        name="bench",
        group="runs",
        module="benches._bench",
        command="BenchCommand",
        help="Run a suite from scenes to report; continue a run cut off",
        example="graycard bench demo --out runs/demo",
        resumes=True,
    ),
    Verb(
        name="gate",
        group="runs",
        module="gates._gate",
        command="GateCommand",
        help="Fail if a run is worse than a baseline",
        example="graycard gate runs/demo --baseline base.json",
    ),
    Verb(
        name="compare",
        group="runs",
        module="_checks",
        command="CompareCommand",
        help="Compare the methods of a run: by how much, and how surely",
        example="graycard compare runs/demo",
    ),
    Verb(
        name="claims",
        group="runs",
        module="_claims",
        command="ClaimsCommand",
        help="Judge which claims of papers a run bears out",
        example="graycard claims runs/claims-dark",
    ),
    Verb(
        name="convergence",
        group="runs",
        module="_convergence",
        command="ConvergenceCommand",
        help="Show what more steps or surfels do to the scores of a run",
        example="graycard convergence runs/convergence-dark",
    ),
    Verb(
        name="plan",
        group="runs",
        module="benches._plan",
        command="PlanCommand",
        help="Plan a large run: hours, disk and price, from measured costs",
        example="graycard plan runs/demo --scenes 1000 --methods 50 --cores 64",
    ),
    Verb(
        name="check-result",
        group="runs",
        module="_checks",
        command="CheckResultCommand",
        help="Check whether a run is a valid result",
        example="graycard check-result runs/demo",
    ),
    Verb(
        name="salt",
        group="runs",
        module="_checks",
        command="SaltCommand",
        help="Make the salt that secret scenes of a suite follow from",
        example="graycard salt new judge.salt",
    ),
    Verb(
        name="report",
        group="runs",
        module="pages._report",
        command="ReportCommand",
        help="Write the report of a run or capture: HTML, or a summary for CI",
        example="graycard report runs/demo",
    ),
    Verb(
        name="figure",
        group="runs",
        module="pages._figure",
        command="FigureCommand",
        help="Draw rows of a run side by side for a paper, as SVG or PDF",
        example="graycard figure runs/demo --scene corridor-0000 --rows gray --out f.pdf",
    ),
    Verb(
        name="publish",
        group="runs",
        module="_checks",
        command="PublishCommand",
        help="Keep the records and the report of a valid run",
        example="graycard publish runs/demo --out published/demo",
    ),
    Verb(
        name="site",
        group="runs",
        module="pages._site",
        command="SiteCommand",
        help="Make static pages of published runs and their claims",
        example="graycard site published --out site",
    ),
    Verb(
        name="import",
        group="your own data",
        module="exchange._capture",
        command="ImportCommand",
        help="Make a capture of your own photographs and cameras",
        example="graycard import photos --track dark --scene cellar --out data",
    ),
    Verb(
        name="splat",
        group="your own data",
        module="splats",
        command="SplatCommand",
        help="Render a trained 3DGS or 2DGS splat as predictions of a scene",
        example="graycard splat trained.ply data/dark/corridor-1234 --out mine",
    ),
    Verb(
        name="adopt",
        group="your own data",
        module="adoption._adopt",
        command="AdoptCommand",
        help="Make predictions of what other code wrote",
        example="graycard adopt theirs data/dark/corridor-1234 --layout gs-ir --out ours",
    ),
    Verb(
        name="export",
        group="your own data",
        module="exchange._capture",
        command="ExportCommand",
        help="Write a capture, or fitted surfels, for other programs",
        example="graycard export data/dark/corridor-1234 --format colmap --out away",
    ),
    Verb(
        name="view",
        group="your own data",
        module="splats",
        command="ViewCommand",
        help="Show fitted surfels, or layers of predictions, in a browser",
        example="graycard view mine",
    ),
    Verb(
        name="turntable",
        group="your own data",
        module="splats",
        command="TurntableCommand",
        help="Write a film of a turn around a saved decomposition",
        example="graycard turntable saved --out turn.gif",
    ),
    Verb(
        name="weights",
        group="this machine",
        module="machine._weights",
        command="WeightsCommand",
        help="Fetch weights of networks that LPIPS, FID and KID need",
        example="graycard weights lpips",
    ),
    Verb(
        name="completion",
        group="this machine",
        module="machine._completion",
        command="CompletionCommand",
        help="Print what lets a shell complete verbs and options",
        example="graycard completion bash",
    ),
    Verb(
        name="doctor",
        group="this machine",
        module="machine._doctor",
        command="DoctorCommand",
        help="Show the renderer, GPU, weights and disk, and what to mend",
        example="graycard doctor",
    ),
    Verb(
        name="speed",
        group="for developers of graycard",
        module="_speed",
        command="SpeedCommand",
        help="Time the light split, the engine, scoring or run records",
        example="graycard speed engine --quick",
    ),
    Verb(
        name="bounds",
        group="for developers of graycard",
        module="_scenes",
        command="BoundsCommand",
        help="Bound how well one vector a point tells which lights reach it",
        example="graycard bounds data/multilight/studio-1003",
    ),
    Verb(
        name="train-prior",
        group="for developers of graycard",
        module="_priors",
        command="TrainPriorCommand",
        help="Train graycard's own network for geometry and material",
        example="graycard train-prior --out runs/prior --minutes 9",
        resumes=True,
    ),
    Verb(
        name="prior-errors",
        group="for developers of graycard",
        module="_priors",
        command="PriorErrorsCommand",
        help="Measure how wrong priors are, beside the oracle's severities",
        example="graycard prior-errors data",
    ),
)
"""All verbs; those of one group stand together, in the order of the help."""


def find_verb(name: str) -> Verb:
    """Return the verb of a name.

    Raises:
        UnknownNameError: There is no such verb.
    """
    for verb in VERBS:
        if verb.name == name:
            return verb
    raise UnknownNameError("verb", name, (verb.name for verb in VERBS))
