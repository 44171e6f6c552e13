# SPDX-License-Identifier: Apache-2.0
"""Uncertainty of the numbers of a run.

*Scenes are the sample.* A method is judged by its mean over scenes; several seeds of one scene are first
averaged, for they say nothing about other scenes. Intervals are for the mean over scenes like these.

*Intervals.* The hull of Student's interval and the bootstrap-t interval, each at a level at which the hull
covers what it says. The BCa bootstrap, the usual choice, covers 89 % instead of 95 % of the means of 8 normal
scores, and 86 % of 8 lognormal ones (sigma 0.5); Student's interval alone covers 91 % of the latter,
bootstrap-t alone 92 % of 12 Student-t scores (3 degrees of freedom). The hull covers 92 to 97 % of all these.
What 8 scenes do not show no interval knows: of lognormal scores with sigma 1 it covers 89 %.
The p of a mean difference is 1 less such a coverage, so it is a little liberal where differences are skewed:
of 8 lognormal ones (sigma 0.5) whose mean is 0, nearly 7 % have p < 0.05.

*Pairs.* Two methods are compared on the scenes that both have scores of, by the mean of their differences.
A pair is decided when two tests agree: the exact Wilcoxon signed-rank test of this pair, which asks nothing
of the scores' shape but cannot fall below 2 / 2^n, so that 6 scenes are the fewest; and the test that belongs
to the interval, after Holm's correction over all compared pairs of the track and metric; pairs with a variant
of another row, as ablations are, and pairs with a row that is handed truth are corrected apart. Holm's
correction of the rank test is given too but does not decide: with 8 scenes and 7 methods not even a method
that is better on every scene by far could pass it. Where a score is infinite there is no mean, and it decides
alone.

*Ranks.* The best method and all that cannot be told from it are group 1; they are taken away, and the best of
the rest leads group 2. A method of group 1 may so be told from another of group 1, but not from the leader.
"""

from graycard.eval.statistics._compare import RULE as RULE
from graycard.eval.statistics._compare import compare_run as compare_run
from graycard.eval.statistics._interval import LEAST_FOR_INTERVAL as LEAST_FOR_INTERVAL
from graycard.eval.statistics._interval import LEVEL as LEVEL
from graycard.eval.statistics._interval import mean_interval as mean_interval
from graycard.eval.statistics._interval import mean_p as mean_p
from graycard.eval.statistics._location import Location as Location
from graycard.eval.statistics._location import least_level as least_level
from graycard.eval.statistics._location import locate as locate
from graycard.eval.statistics._location import locations as locations
from graycard.eval.statistics._pairs import LEAST_SCENES as LEAST_SCENES
from graycard.eval.statistics._pairs import compare_pairs as compare_pairs
from graycard.eval.statistics._ranks import rank_groups as rank_groups
from graycard.eval.statistics._sequential import ERROR as ERROR
from graycard.eval.statistics._sequential import level_up_to as level_up_to
from graycard.eval.statistics._sequential import p_after_each as p_after_each
from graycard.eval.statistics._sequential import rank_limit as rank_limit
from graycard.eval.statistics._sequential import sequential_level as sequential_level
from graycard.eval.statistics._signed_rank import holm as holm
from graycard.eval.statistics._signed_rank import least_scenes as least_scenes
from graycard.eval.statistics._signed_rank import signed_rank_p as signed_rank_p
from graycard.eval.statistics._variance import VarianceSplit as VarianceSplit
from graycard.eval.statistics._variance import split_variance as split_variance
