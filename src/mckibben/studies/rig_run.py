"""A protocol on a test machine, simulated or real, or on a biological muscle: from the dry run to the recording."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from .. import verbs
from ..analysis import segments
from ..answers import Answer, Caution, Column, Table
from ..batch.posterior import PredictedRun, predict_run
from ..batch.run_template import make_template
from ..bench import run as protocol_run
from ..bench.biological_run import (
    BiologicalSubject,
    biological_subject,
    changed_biological,
    check_protocol,
    run_biological,
)
from ..bench.hardware.backends import check_connection, connected
from ..bench.prepare import PreparedRun, prepare
from ..bench.rig import FAULTS
from ..documents import JsonValue
from ..errors import InputError, not_found
from ..experiments.dry_run import Finding
from ..experiments.read import named_protocol
from ..identification.posterior import Posterior, read_posterior
from ..muscles.build import law_from_specimen
from ..muscles.evidence import interval_remarks
from ..quantities import with_unit
from ..recordings import Recording
from ..specimens import Specimen, muscle_specimen
from ..verbs import ParameterType

RUNNING, PREDICTING = "running", "running the samples of the posterior"  # what is told of progress
STEPS = 1e-7, 1e-3  # that the physics may take at most [s]
Faults = Annotated[Mapping[str, str], ParameterType("NAME=VALUE")]
LogFile = Annotated[str, ParameterType("OUT.mcap")]
Progress = Callable[[float, float], None]
_FOUND = ("step", "path", "case", "field", "value", "allowed", "sentence")
_RESULT = ("message", "events", "steps", "saturation", "friction", "timing", "seed", "rig", "plumbing", "law_error")


@dataclass(frozen=True)
class RunPlan(Answer):
    """What a run would do, or why it is refused: what `record_run` says of a dry run.

    Attributes:
        sentence: the protocol in words.
        duration: at most [s].
        place: where it runs: ``rig`` and ``plumbing`` of a test machine.
        findings: violations of limits; none may be left when a run starts.
        cautions: what a reader of the recording would have to know.
        asked: whether a dry run was asked for; else a run was refused.
    """

    sentence: str
    duration: float
    place: Mapping[str, str] = dataclasses.field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    cautions: tuple[Caution, ...] = ()
    asked: bool = True

    def to_dict(self) -> dict[str, JsonValue]:
        """The result, the protocol in words, and what speaks against it."""
        return {
            "result": "refused" if self.findings else "ready",
            "sentence": self.sentence,
            "duration": self.duration,
            **self.place,
            "findings": [{key: getattr(one, key) for key in _FOUND} for one in self.findings],
        }

    def remarks(self) -> list[str]:
        """The protocol in words, and how long it is."""
        place = "" if not self.place else f" on the rig {self.place['rig']}, plumbing {self.place['plumbing']}"
        return [self.sentence, f"At most {self.duration:.4g} s{place}."] if self.asked else []

    def failure(self) -> str | None:
        """What was found, a line each."""
        return "\n".join(one.sentence for one in self.findings) or None


def _measured(recording: Recording) -> Table:
    meta = recording.meta
    named = {name: one for name, one in recording.summary().items() if one["kind"] == "measured"}
    columns = (
        Column(key, title, own="unit") for key, title in (("min", "lowest"), ("mean", "mean"), ("max", "highest"))
    )
    title = f"{meta['title']}: {meta['specimen']}" + (f" on the rig {meta['rig']}" if "rig" in meta else "")
    return Table(title, (Column("measured"), *columns), [{"measured": name, **one} for name, one in named.items()])


@dataclass(frozen=True)
class RunRecording(Answer):
    """A protocol that was run on a test machine: what `record_run` computes.

    Attributes:
        recording: channels, balances and events.
        log: crash-safe log that was written beside it.
        predicted: the same run with samples of a posterior.
        draws: number of these samples.
        cautions: what a reader of the recording has to know.
    """

    recording: Recording
    log: str | None = None
    predicted: PredictedRun | None = None
    draws: int = 0
    cautions: tuple[Caution, ...] = ()

    def to_dict(self) -> dict[str, JsonValue]:
        """How the run ended, with its channels in numbers, balances and events [SI]."""
        meta, predicted = self.recording.meta, self.predicted
        bands = {} if predicted is None else {"bands": predicted.summary(), "failed": list(predicted.failed)}
        return {
            "result": meta["result"],
            "summary": self.recording.summary(),
            "log": self.log,
            "balance": {k: meta["balance"].get(k) for k in ("mass", "energy")},
            "accounts": meta["balance"],
            "samples": len(self.recording),
            "warnings": [c.text for c in self.recording.cautions],
            **{k: meta[k] for k in (*_RESULT, "deadlines", "hardware", "calibration") if k in meta},
            **({"posterior": {"draws": self.draws, **bands}} if bands else {}),
        }

    def tables(self) -> list[Table]:
        """Measured channels, and the 95 % intervals of all by a posterior."""
        if self.predicted is None:
            return [_measured(self.recording)]
        rows = []
        for name, one in self.predicted.summary().items():
            ends = {
                key: [with_unit(one[key][end], one["unit"]) for end in ("low", "high")]
                for key in ("min", "mean", "max")
            }
            rows.append({"channel": name} | {key: " to ".join(pair) for key, pair in ends.items()})
        columns = Column("channel", ""), Column("min", "lowest"), Column("mean"), Column("max", "highest")
        notes = tuple(f"note: a sample was left out: {sentence}" for sentence in self.predicted.failed)
        return [
            _measured(self.recording),
            Table(f"95 % of {self.draws} samples of the posterior", columns, rows, notes),
        ]

    def remarks(self) -> list[str]:
        """How the run ended, its balances, how late its samples were, its events, and the interval of the tension."""
        meta = self.recording.meta
        said = [f"{len(self.recording)} samples. {meta['message']}"]
        if closed := meta.get("balance"):
            shares = f"mass {closed['mass']:.1e}, energy {closed['energy']:.1e}"
            said.append(f"Balances: {shares} of what went through.")
        if late := meta.get("deadlines"):
            half, most, nearly, largest = (1e3 * x for x in late["percentiles"])
            said.append(
                f"By the clock: {late['samples']} samples, {late['late']} late by a tenth of a period or more; lateness "
                f"{half:.3g} ms (median), {most:.3g} (99 %), {nearly:.3g} (99.9 %), {largest:.3g} (largest)."
            )
        said += [f"{event['time']:.4g} s: {event['text']}" for event in meta["events"]]
        said += interval_remarks({meta["specimen"]: meta.get("law_error")})
        return said + ([f"Written: {self.log}"] if self.log is not None else [])

    def failure(self) -> str | None:
        """Empty where the run was stopped or interrupted, which its message says."""
        return None if self.recording.meta["result"] == "done" else ""


@dataclass(frozen=True)
class StimulatedRecording(Answer):
    """A protocol that was run on a biological muscle: what `record_run` computes of one.

    Attributes:
        recording: channels of ideal sensors.
        cautions: what a reader of the recording has to know.
    """

    recording: Recording
    cautions: tuple[Caution, ...] = ()

    def _each(self) -> dict[str, Any]:
        """Contractions and work loops, none where the recording shows none."""
        each: dict[str, Any] = {"contractions": (), "loops": ()}
        record = self.recording
        for name, ask in (("contractions", record.stimulated_contractions), ("loops", record.stimulated_loops)):
            with contextlib.suppress(InputError):
                each[name] = ask()
        return each

    def to_dict(self) -> dict[str, JsonValue]:
        """Channels in numbers, contractions and work loops [SI]."""
        record, meta = self.recording, self.recording.meta
        return {
            "result": meta["result"],
            "summary": record.summary(),
            "samples": len(record),
            **{name: [one._asdict() for one in each] for name, each in self._each().items()},
            **{key: meta[key] for key in ("message", "steps", "maximum_tension")},
        }

    def tables(self) -> list[Table]:
        """Channels, contractions and work loops."""
        varied, each = segments.varied(self.recording), self._each()

        def rows(name: str) -> list[dict[str, Any]]:
            cases = (", ".join(one.case[key] for key in varied) or one.label for one in each[name])
            return [one._asdict() | {"case": case} for case, one in zip(cases, each[name], strict=True)]

        full = self.recording.meta["maximum_tension"]
        contractions = [row | {"share": row["peak"] / full} for row in rows("contractions")]
        of_contractions = (
            Column("case", "contraction"), Column("peak", unit="N"), Column("share", "of Fmax", "1", "1", ".3f"),
            Column("time_to_peak", "to peak", "s", "ms", missing="–"),
            Column("half_relaxation_time", "half relaxation", "s", "ms", missing="–"),
            Column("mean", unit="N", missing="–"), Column("ripple", unit="1", shown="%", missing="–"),
        )  # fmt: skip
        of_loops = (
            Column("case", "work loop"), Column("cycles", right=True),
            Column("work", "net work per cycle", "J", "mJ"), Column("power", unit="W", shown="mW"),
        )  # fmt: skip
        both = Table("", of_contractions, contractions), Table("", of_loops, rows("loops"))
        return [_measured(self.recording), *(one for one in both if one.rows)]

    def remarks(self) -> list[str]:
        """How the run ended."""
        return [f"{len(self.recording)} samples. {self.recording.meta['message']}"]


@verbs.verb
def record_run(
    protocol: verbs.ProtocolName,
    *,
    muscle: verbs.MuscleName,
    rig: verbs.RigName = "paper",
    law: verbs.LawName | None = None,
    changes: verbs.Changes | None = None,
    faults: Faults | None = None,
    plumbing: verbs.PlumbingName | None = None,
    seed: verbs.Seed = 0,
    step: verbs.Duration = "50 us",
    accept_saturation: bool = False,
    dry_run: bool = False,
    real_time: bool = False,
    machine: verbs.MachineName | None = None,
    lock_step: bool = False,
    log: LogFile | None = None,
    calibration: verbs.CalibrationFile | None = None,
    posterior: verbs.PosteriorFile | None = None,
    draws: verbs.Count = 40,
    stop: Callable[[], bool] | None = None,
    ask: Callable[[str], None] | None = None,
    telling: Callable[[str, PreparedRun], contextlib.AbstractContextManager[Progress | None]] | None = None,
) -> RunPlan | RunRecording | StimulatedRecording:
    """Run a protocol on a test machine; nothing moves until the dry run passes.

    Biological muscles need no machine: twitch, tetanus, force-frequency and stimulated-work-loop stimulate them.

    Args:
        protocol: name of a shipped protocol, or a .toml file.
        muscle: id of a specimen, or the .toml file of one.
        rig: rig of the test machine: paper, modern, or a .toml file.
        law: law to use instead of the specimen's default, or my.py:MyLaw.
        changes: change a value of the protocol (several separated by ', ' or ';'), of rig.* or of muscle.*:
            pressure='5 bar', rig.plumbing.direct.tube.length='1 m' or muscle.law.passive_stiffness='3 N/cm'.
        faults: fault of the simulated rig, such as leak='0.2 l/min/bar' or clamp_slack='1 mm'.
        plumbing: plumbing that joins the rig's pneumatic parts; the rig's first by default.
        seed: random seed for sensor noise; equal seeds give equal recordings.
        step: largest time step of the physics [s], such as '20 us'.
        accept_saturation: run although the load cell's range will be exceeded.
        dry_run: report violations without moving anything.
        real_time: run the simulation in real time.
        machine: run on a real machine: serial:/dev/ttyACM0, or daq (wired as the rig file says).
        lock_step: let a simulated device wait for every command instead of following its own clock.
        log: crash-safe log; on the command line runs in real time write one beside the recording by default.
        calibration: calibration file that is applied to the measured channels.
        posterior: result of `mckibben fit --posterior --out fit.json`, for 95 % bands of the answer.
        draws: number of samples of the posterior that are run.
        stop: asked whether to end the run, see `bench.run.run`.
        ask: told what a person has to do on a real machine.
        telling: told what begins, and with what run; its context is open meanwhile, and yields what is told how far it is.

    Raises:
        InputError: names what is unknown, or does not fit.
        ConvergenceError: the physics failed; says why.
    """
    if log is not None:
        _check_log(Path(log))
    if lock_step and machine is None:
        raise InputError("lock_step", None, "is allowed only with {machine}, for a simulated device")
    check_connection(machine)
    subject = biological_subject(muscle, law=law)
    if subject is not None:
        of_machine = {
            "rig": rig != "paper", "step": not math.isclose(float(step), 5e-5), "posterior": posterior,
            "plumbing": plumbing, "machine": machine, "calibration": calibration, "log": log, "real_time": real_time,
            "accept_saturation": accept_saturation, "faults": faults,
        }  # fmt: skip
        for name, stated in of_machine.items():
            if stated:
                problem = f"is of a test machine; {muscle} is biological and runs without one"
                raise InputError(name, None, problem)
        return _on_biological(protocol, subject, changes or {}, dry=dry_run)
    samples = None if posterior is None else _samples(posterior, muscle, law, draws)
    if faults and machine is not None:
        raise InputError("faults", None, "is of a simulated rig; a real machine has its own")
    for name in faults or ():
        if name not in FAULTS:
            raise InputError("faults", name, known=FAULTS)
    if not STEPS[0] <= float(step) <= STEPS[1]:
        raise InputError("step", None, f"must be between 0.1 us and 1 ms, got {float(step):g} s")
    options: dict[str, Any] = {
        "plumbing": plumbing,
        "seed": seed,
        "step": float(step),
        "accept_saturation": accept_saturation,
    }
    every = dict(changes or {}) | {f"rig.faults.{name}": value for name, value in (faults or {}).items()}
    prepared = prepare(
        protocol, muscle=muscle, rig=rig, law=law, changes=every, calibration=calibration, foresee=True, **options
    )
    if prepared.findings or dry_run:
        place = {"plumbing": prepared.layout, "rig": prepared.rig.name}
        said = [*(one.sentence for one in prepared.accepted), *(prepared.cautions if dry_run else ())]
        plan = prepared.protocol.sentence(), prepared.plan.duration, place, prepared.findings
        return RunPlan(*plan, tuple(map(Caution, said)), dry_run)
    # the machine is opened inside, so that it has vented before whoever watches lets go of Ctrl-C
    open_for = telling or (lambda title, run: contextlib.nullcontext())
    period = 1.0 / prepared.plan.sample_rate
    with (
        open_for(RUNNING, prepared) as progress,
        connected(machine, prepared.rig, period, lock_step=lock_step) as hardware,
    ):
        recording = protocol_run.run(
            prepared, progress=progress, stop=stop, ask=ask, real_time=real_time, hardware=hardware, log=log
        )
    predicted = None
    if samples is not None:
        spec = muscle_specimen(muscle)
        # the range of a cell bounds what it reads, not what the samples of a law predict
        template = make_template(
            named_protocol(protocol, {}), muscle, rig,
            specimens={muscle: spec if law is None else dataclasses.replace(spec, law=law)},
            rigs={rig: dict(prepared.rig.document)},  # with its faults, too
            given=dict(changes or {}), plumbing=plumbing or "", noise_seed=seed, step=float(step), accept_saturation=True,
        )  # fmt: skip
        with open_for(PREDICTING, prepared) as progress:
            tell = progress or (lambda done, total: None)
            predicted = predict_run(template, samples, draws, progress=lambda done: tell(done, 1.0))
    return RunRecording(recording, log, predicted, draws, recording.cautions)


def _check_log(log: Path) -> None:
    if log.suffix != ".mcap":
        raise InputError("log", str(log), "must be a name that ends in .mcap")
    if not log.absolute().parent.is_dir():
        raise not_found(log.absolute().parent, "folder")
    if log.exists():
        raise InputError("log", str(log), "it is there already; a log is never written over")


def _samples(file: Any, muscle: Any, law: str | None, draws: int) -> Posterior:
    """The posterior in a file, of the law with which a muscle runs."""
    spec = muscle if isinstance(muscle, Specimen) else muscle_specimen(muscle)
    samples = read_posterior(file, law=law or spec.law)
    try:
        samples.rows(draws)
    except InputError as error:
        raise error.changed(field="draws") from None
    samples.check_muscle(law_from_specimen(spec, samples.law), str(muscle))
    return samples


def _on_biological(
    protocol: Any, subject: BiologicalSubject, changes: Mapping[str, float | str], *, dry: bool
) -> RunPlan | StimulatedRecording:
    wanted, subject = changed_biological(protocol, subject, changes)
    if not dry:
        recording = run_biological(wanted, subject)
        return StimulatedRecording(recording, recording.cautions)
    check_protocol(subject.muscle, wanted)
    return RunPlan(wanted.sentence(), wanted.expand(rest_length=float(subject.muscle.rest_length)).duration)
