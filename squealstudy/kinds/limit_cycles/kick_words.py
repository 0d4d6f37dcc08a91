"""Reasons why there is no kick along the mode for designs that squeal if kicked."""

from __future__ import annotations

import pandas as pd

from squealstudy.cycles.kicked import KICK_UNDECIDED, KICK_WITHOUT_CYCLE, NO_KICK
from squealstudy.cycles.trials import LASTS
from squealstudy.wording import IF_KICKED, plural

WHY = {  # by `kick_status`; cycles that are continued to a design join it without one
    KICK_WITHOUT_CYCLE: "a run in time lasts, but kicks are bisected beside a stable cycle, and "
    "none was found",
    "": "kicks were tried before the stable cycle was continued to it, or another mode is unstable",
    NO_KICK: "no kick up to 'reach' starts squeal",
    KICK_UNDECIDED: "a run came neither to the cycle nor near silence",
}


def untold_kicks(verdicts: pd.DataFrame) -> str:
    """Sentence on the modes that squeal if kicked, but have no kick; empty if there are none.

    For studies that ask for kicks along modes.
    """
    kicked = verdicts[(verdicts["verdict"] == IF_KICKED).to_numpy(bool)]
    untold = kicked[kicked["kick_velocity"].isna().to_numpy(bool)]
    status = untold["kick_status"].where(
        (untold["kick_status"] != "") | (untold["run_status"] != LASTS), KICK_WITHOUT_CYCLE
    )  # older results have an empty status for these
    counts = status.value_counts()
    whys = [f"{why} ({counts[name]})" for name, why in WHY.items() if name in counts]
    if not whys:
        return ""
    number = f"{len(untold)} of {plural(len(kicked), 'mode')} that squeal if kicked"
    return f" No kick along the mode is known for {number}: {'; '.join(whys)}."
