# SPDX-License-Identifier: Apache-2.0
"""Uncertainty of the numbers of a run.

*Scenes are the sample.* A method is judged by its mean over scenes; several seeds of one scene are first
averaged, for they say nothing about other scenes. Intervals are for the mean over scenes like these.

*Intervals.* The hull of Student's interval and the bootstrap-t interval, each at a level at which the hull
covers what it says. The BCa bootstrap, the usual choice, covers 89 % instead of 95 % of the means of 8 normal
scores, and 86 % of 8 lognormal ones (sigma 0.5); Student's interval alone covers 91 % of the latter,
bootstrap-t alone 92 % of 12 Student-t scores (3 degrees of freedom). The hull covers 92 to 97 % of all these.
What 8 scenes do not show no interval knows: of lognormal scores with sigma 1 it covers 89 %.

*Pairs.* Two methods are compared on the scenes that both have scores of, by the mean of their differences.
A pair is decided when two tests agree. One is the exact Wilcoxon signed-rank test of this pair. It asks
nothing of the scores' shape, but cannot fall below 2 / 2^n, so that 6 scenes are the fewest. The other is
Student's test of the mean difference, after Šidák's correction over all compared pairs of the track and
metric. Its p has no floor: it falls as long as the gap grows, so that a table of many rows asks for a larger
gap and never for an impossible one. Pairs with a variant of another row, as ablations are, and pairs with a
row that is handed truth are corrected apart. Holm's correction of the rank test is given too but does not
decide: with 8 scenes and 7 methods not even a method that is better on every scene by far could pass it.
Where a score is infinite there is no mean, and it decides alone.

*Skew.* Student's test is too liberal where differences are skewed, the more so the smaller its p. The
corrected p is multiplied by 4 therefore. Of tables with 5, 25 and 60 rows at most 5 % then have any false
difference. ``docs/lab-notes/2026-11-error-rates.md`` has the simulation, and the shape beyond which that does
not hold.

*Ties.* A tie says that these scenes do not tell which of two methods is better. A gap of 10 standard errors
is never called one. Among very many pairs chance makes such gaps: then there are too few scenes.

*A larger gap.* With the same differences but for a shift it is never less decided. Student's p falls, and so
does that of ranks, as differences of 0 and of equal size count against the mean. No other pair has a say.

*A chosen row.* Against a row that was chosen before its scores were seen, only the comparisons with it
count. A gap of 10 standard errors on 6 scenes is decided so in each table of up to 74 rows.

*Ranks.* The best method and all that cannot be told from it are group 1; they are taken away, and the best of
the rest leads group 2. A method of group 1 may so be told from another of group 1, but not from the leader.
"""

from graycard.eval.statistics._compare import RULE as RULE
from graycard.eval.statistics._compare import Question as Question
from graycard.eval.statistics._compare import above_ceiling as above_ceiling
from graycard.eval.statistics._compare import compare_first_look as compare_first_look
from graycard.eval.statistics._compare import compare_run as compare_run
from graycard.eval.statistics._correction import FAR as FAR
from graycard.eval.statistics._correction import MARGIN as MARGIN
from graycard.eval.statistics._correction import correct as correct
from graycard.eval.statistics._interval import LEAST_FOR_INTERVAL as LEAST_FOR_INTERVAL
from graycard.eval.statistics._interval import LEVEL as LEVEL
from graycard.eval.statistics._interval import mean_interval as mean_interval
from graycard.eval.statistics._interval import mean_p as mean_p
from graycard.eval.statistics._location import Ends as Ends
from graycard.eval.statistics._location import Location as Location
from graycard.eval.statistics._location import least_level as least_level
from graycard.eval.statistics._location import locate as locate
from graycard.eval.statistics._location import location_p as location_p
from graycard.eval.statistics._location import locations as locations
from graycard.eval.statistics._location import locations_at as locations_at
from graycard.eval.statistics._null_distribution import rank_limit as rank_limit
from graycard.eval.statistics._pairs import LEAST_SCENES as LEAST_SCENES
from graycard.eval.statistics._pairs import Candidate as Candidate
from graycard.eval.statistics._pairs import compare_against as compare_against
from graycard.eval.statistics._pairs import compare_pairs as compare_pairs
from graycard.eval.statistics._ranks import rank_groups as rank_groups
from graycard.eval.statistics._sequential import ERROR as ERROR
from graycard.eval.statistics._sequential import level_up_to as level_up_to
from graycard.eval.statistics._sequential import p_after_each as p_after_each
from graycard.eval.statistics._sequential import sequential_level as sequential_level
from graycard.eval.statistics._signed_rank import holm as holm
from graycard.eval.statistics._signed_rank import least_scenes as least_scenes
from graycard.eval.statistics._signed_rank import signed_rank_p as signed_rank_p
from graycard.eval.statistics._student import MeanTest as MeanTest
from graycard.eval.statistics._student import signed_rank_ps as signed_rank_ps
from graycard.eval.statistics._student import student_test as student_test
from graycard.eval.statistics._variance import VarianceSplit as VarianceSplit
from graycard.eval.statistics._variance import split_variance as split_variance
