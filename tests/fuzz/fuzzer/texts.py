# SPDX-License-Identifier: Apache-2.0
"""Texts of the corpus: a suite, claims and priors that use most of what there is."""

SUITE = """
name = "tiny"
version = 1
title = "As small as can be"
seeds = [0, 1]
[reserve]
seeds = [501, 510]
scenes = [{ track = "dark", family = "corridor", knobs = { gloss = [0.0, 0.25] } }]
[sealed]
seeds = [601, 602]
scenes = [{ track = "dark", family = "corridor" }]
[render]
width = 24
height = 20
train_views = 3
test_views = 2
samples = 16
max_depth = 3
[[scenes]]
track = "dark"
family = "corridor"
seed = 1000
knobs = { gloss = 0.25 }
[[methods]]
name = "gray"
label = "gray-dark"
settings = { reflectance = 0.09 }
[[methods]]
name = "retinex"
[[methods]]
name = "gsid"
priors = { source = "oracle", severity = 2 }
settings = { iterations = 10 }
"""

CLAIMS = """
name = "tiny-claims"
version = 1
title = "A paper of few words"
track = "dark"
suite = "tiny"
bound = "truth"
trivial = "gray"
[[claims]]
id = "T1"
sentence = "Gray is nearer to the albedo than retinex."
source = "Table 1"
figures = { gray = "35 dB" }
[[claims.checks]]
id = "albedo"
says = "Albedo PSNR is higher"
rule = "better"
rows = ["gray", "retinex"]
quantity = { metric = "albedo.psnr.channel" }
expects = "higher"
paper = 5.0
[[claims.checks]]
id = "told"
says = "Retinex does as well"
rule = "better"
rows = ["retinex", "gray"]
quantity = { metric = "albedo.psnr.channel" }
expects = "higher"
decides = false
scenes = { families = ["corridor"] }
"""

PRIORS = """
source = "oracle"
severity = 2
seed = 3
[overrides.roughness]
source = "classical"
[overrides.normal]
severity = 1
errors = { kappa = 4.0 }
[overrides.base_color]
source = "pretrained"
path = "own"
"""
