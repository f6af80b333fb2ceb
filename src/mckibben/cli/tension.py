"""``tension``: tension of a muscle."""

from ._outputs import OBJECT, TABLE, OutputKinds
from ._verb import VerbCommand

tension = VerbCommand(
    "studies.tension:tension",
    OutputKinds(table=TABLE, result=OBJECT),
    (
        "tension nylon --length '12 cm' --pressure '5 bar'",
        "tension nylon --contraction '0:20:5 %' --pressure '1:5 bar' --out map.csv",
    ),
    options={"target_tension": "for", "parameters": "set", "posterior": "from_posterior"},
).function()
