"""What copies of the nominal robot will do, in each world."""

from usm_baselines.estimation.foresight import planar as planar
from usm_baselines.estimation.foresight import spatial as spatial
from usm_baselines.estimation.foresight.interface import CURRENT as CURRENT
from usm_baselines.estimation.foresight.interface import NAMES as NAMES
from usm_baselines.estimation.foresight.interface import Foresight as Foresight
from usm_baselines.estimation.foresight.interface import estimates_of as estimates_of
from usm_baselines.estimation.foresight.interface import foresight_of as foresight_of
from usm_baselines.estimation.foresight.interface import gains_from as gains_from
