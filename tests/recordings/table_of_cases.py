"""Small files of other programs beside the repository, each against numpy: what is read, with how many options, how right.

``python tests/recordings/table_of_cases.py`` prints the table for ``../shared/cases/files``, or the folder that it is given.
Expected numbers are made here from the text or the arrays of the file, with units written out, and by nothing of mckibben.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

FOLDER = Path(__file__).parents[3] / "shared" / "cases" / "files"
PSI, ATM, LBF, KGF, G = 4.4482216152605 / 0.0254**2, 101325.0, 4.4482216152605, 9.80665, 9.80665
AIR = 1.2929  # density of dry air at 0 C and 1.01325 bar as printed, DIN 1343 [kg/m^3]
REST = {"rest_length": "160 mm"}


class Case(NamedTuple):
    """Options of reading, and what must come out by channel [SI]; None where it must be refused."""

    options: dict[str, Any]
    expected: Callable[[Path], dict[str, Any]] | None
    says: tuple[str, ...] = ()  # in remarks or in the refusal
    tolerance: float = 1e-9  # roundings of decimal text, and of a clock of 1.7e9 s


def numbers(path: Path, sep: str = ",", skip: int = 1, decimal: str = ".", rows: int | None = None) -> list[np.ndarray]:
    """Columns of plain numbers, as a person would type them over."""
    lines = [line for line in path.read_bytes().decode("utf-8-sig", "replace").splitlines() if line.strip()][skip:]
    cells = [[cell.strip(' "') for cell in line.split(sep)] for line in lines[:rows]]
    if decimal == ",":
        cells = [[cell.replace(".", "").replace(",", ".") for cell in row] for row in cells]
    most = min(map(len, cells))
    return [np.array([_number(row[i]) for row in cells]) for i in range(most)]


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return np.nan


def columns(names: str, *factors: float, keep: Any = slice(None), **how: Any) -> Callable[[Path], dict[str, Any]]:
    """Channels by the order of the columns, each times a factor; ``-`` leaves a column out."""

    def expected(path: Path) -> dict[str, Any]:
        named = zip(names.split(), numbers(path, **how), factors, strict=False)
        return {name: factor * values[keep] for name, values, factor in named if name != "-"}

    return expected


def since_the_first(channels: Callable[[Path], dict[str, Any]]) -> Callable[[Path], dict[str, Any]]:
    """Milliseconds since 1970 as a record has them: seconds from its first sample on, whose date is in the meta.

    They are whole, so that their difference is exact; one of seconds would have the last bit of 1.7e9 s in it.
    """

    def expected(path: Path) -> dict[str, Any]:
        known = channels(path)
        return known | {"time": 1e-3 * (known["time"] - known["time"][0])}

    return expected


def stamped(text: Callable[[str], str], channels: Callable[[Path], dict[str, Any]]) -> Callable[[Path], dict[str, Any]]:
    """Times of day as text, from the first on [s], beside channels."""

    def expected(path: Path) -> dict[str, Any]:
        lines = [line for line in path.read_text().splitlines() if ":" in line]
        clocks = [text(line).split(":") for line in lines]
        time = np.array([3600.0 * float(h) + 60.0 * float(m) + float(s.replace(",", ".")) for h, m, s in clocks])
        time = np.where(time < time[0], time + 86400.0, time)
        return {"time": time - time[0], **channels(path)}

    return expected


def american(line: str) -> str:
    """A time of day with AM or PM, in 24 hours."""
    text, half = line.split(",")[1].split(" ")
    hour, rest = text.split(":", 1)
    return f"{int(hour) % 12 + (12 if half == 'PM' else 0)}:{rest}"


def pivot(path: Path) -> dict[str, Any]:
    shares, *forces = numbers(path)
    return {
        "length": np.tile(0.16 * (1.0 - shares / 100.0), 5),
        "pressure": np.repeat(1e5 * np.arange(1, 6), len(shares)),
        "tension": np.concatenate(forces),
    }


def contraction(zero: float) -> Callable[[Path], dict[str, Any]]:
    def expected(path: Path) -> dict[str, Any]:
        pressure, share, force = numbers(path)
        return {"length": 0.16 * (1.0 - share / 100.0), "pressure": PSI * pressure - zero, "tension": LBF * force}

    return expected


def masses(path: Path) -> dict[str, Any]:
    mass, pressure, length = numbers(path)
    return {"length": 1e-3 * length, "pressure": 1e3 * pressure, "tension": G * mass}


def sines(start: float, samples: int, **channels: tuple[float, float]) -> Callable[[Path], dict[str, Any]]:
    """The example of all .tdms files, offset + 100 sin(2 pi t), times a factor: by channel offset and factor."""
    time = start + 0.01 * np.arange(samples)
    return lambda path: (
        {"time": time}
        | {n: factor * (offset + 100.0 * np.sin(2.0 * np.pi * time)) for n, (offset, factor) in channels.items()}
    )


PAM = columns("time pressure_abs force length", 1.0, PSI, KGF, 0.0254, sep=";", decimal=",")
GAUGE = columns("time pressure force length", 1.0, PSI, KGF, 0.0254, sep=";", decimal=",")
MACHINE = columns("time standardweg standardkraft", 1.0, 1e-3, 1.0, sep=";", decimal=",", skip=5)
PLAIN = columns("time pressure force", 1.0, 1e3, 1.0, rows=3)
OPENSIM = columns("time pam1_force pam1_length", 1.0, 1.0, 1.0, sep="\t", skip=7)
LABVIEW = "time muscle_pressure thrust_load_cell hanging_load_cell"


def savemat_columns(names: str, *factors: float) -> Callable[[Path], dict[str, Any]]:
    """Columns of whatever arrays of 200 samples a .mat file has, in the order of the file, by scipy alone."""

    def expected(path: Path) -> dict[str, Any]:
        found: list[np.ndarray] = []
        _arrays(_loaded(path), found)
        named = zip(names.split(), found, factors, strict=False)
        return {name: factor * values for name, values, factor in named if name != "-"}

    return expected


def _loaded(path: Path) -> Any:
    from scipy.io import loadmat

    content = loadmat(path, simplify_cells=True)
    return {name: value for name, value in content.items() if not name.startswith("__")}


def _arrays(value: Any, found: list[np.ndarray]) -> None:
    if isinstance(value, dict):
        for one in value.values():
            _arrays(one, found)
    elif isinstance(value, np.ndarray) and value.dtype == object:
        for one in value:
            _arrays(one, found)
    elif isinstance(value, list):
        for one in value:
            _arrays(one, found)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.size >= 5:
        wide = np.atleast_2d(value if value.ndim == 2 and value.shape[0] < value.shape[1] else value.T)
        found.extend(np.asarray(row, float) for row in wide)


CASES: dict[str, Case] = {
    "c10_wave.csv": Case({}, columns("time - - - - - position force stress", 1, 1, 1, 1, 1, 1, 1e-3, 1e3, 1e6)),
    "c11_dspace.mat": Case({}, savemat_columns("time pressure force", 1.0, 1e5, 1.0)),
    "c11_matrix.mat": Case({"units": {"data_2": "bar", "data_3": "N"}}, savemat_columns("time data_2 data_3", 1, 1e5, 1)),
    "c11_own.mat": Case({}, savemat_columns("time pressure angle", 1.0, 1e5, np.pi / 180.0)),
    "c11_own_nolabel.mat": Case({"units": {"signal 1": "bar"}}, savemat_columns("time signal_1", 1.0, 1e5)),
    "c11_single.mat": Case({"units": {"p and a 1": "bar"}}, savemat_columns("time p_and_a_1", 1.0, 1e5)),
    "c11_tofile.mat": Case({"units": {"ans_2": "bar"}}, savemat_columns("time ans_2", 1.0, 1e5)),
    "c11_tout.mat": Case({"units": {"yout_1": "bar"}}, savemat_columns("time yout_1", 1.0, 1e5)),
    "c12_dea.csv": Case({}, columns("time voltage laser_displacement", 1, 1e3, 1e-3, sep=";", decimal=",")),
    "c13.TRA": Case({}, MACHINE, ("parts thousands",)),
    "c13_zwick.csv": Case({}, MACHINE, ("parts thousands",)),
    "c15_mso.csv": Case({}, columns("time pressure force", 1, 1, 1, skip=13, rows=5)),
    "c15_rigol.csv": Case({}, lambda p: {
        "time": -1.2e-2 + 2e-3 * numbers(p, skip=2)[0], "ch1": numbers(p, skip=2)[1], "ch2": numbers(p, skip=2)[2],
    }),
    "c15_saleae.csv": Case({"units": {"channel_0": "V", "channel_1": "V"}}, columns("time channel_0 channel_1", 1, 1, 1)),
    "c15_tek.csv": Case({}, columns("- - - time ch1", 1, 1, 1, 1, 1, skip=0)),
    "c16_de.csv": Case({}, stamped(lambda line: line.split(";")[0].split(" ")[1], columns("- p f", 1, 1e5, KGF, sep=";"))),
    "c16_iso.csv": Case({}, stamped(lambda line: line.split(",")[0].split(" ")[1], columns("- pressure force", 1, 1e3, 1))),
    "c16_monitor.txt": Case(
        {"header": "time, pressure [kPa], force [N]"},
        stamped(lambda line: line.split(" -> ")[0], lambda p: {
            "pressure": 1e3 * np.array([float(x.split("-> ")[1].split(",")[0]) for x in p.read_text().splitlines()]),
            "force": numbers(p, skip=0)[1],
        }), ("midnight",),
    ),
    "c16_us.csv": Case({}, stamped(american, columns("- - pressure load", 1, 1, PSI, LBF)), ("midnight",)),
    "c17_os.sto": Case({}, OPENSIM, ("OpenSim",)),
    "c17_os.txt": Case({}, OPENSIM, ("OpenSim",)),
    "c18_long.csv": Case(REST, contraction(0.0)),
    "c18_mass.csv": Case({}, masses, ("9.80665 N for each kg",)),
    "c18_pivot.csv": Case({**REST, "units": {"tension": "N"}}, pivot, ("forces at these pressures",)),
    "c19_groups.tdms": Case({}, sines(0.0, 197, **{"daq.pressure": (200.0, 1e3)}), ("cam.length is interpolated",)),
    "c19_offset.tdms": Case({}, sines(0.5, 150, pressure=(200.0, 1e3), force=(200.0, 1.0)), ("is cut to 0.5 s",)),
    "c19_rates.tdms": Case({}, sines(0.0, 197, pressure=(200.0, 1e3)), ("force is interpolated",)),
    "c19_stamp.tdms": Case({}, sines(0.0, 200, pressure=(200.0, 1e3))),
    "c19_start.tdms": Case({}, sines(0.5, 150, pressure=(200.0, 1e3), force=(200.0, 1.0)), ("is cut to 0.5 s",)),
    "c19_volt.tdms": Case({}, sines(0.0, 200, cdaq1mod1_ai0=(200.0, 0.01)), ("no unit is stated",)),
    "c20_clock.csv": Case({}, stamped(lambda x: x.split(",")[0], columns("- pressure force", 1, PSI, LBF))),
    "c20_dup.csv": Case({}, columns("time pressure force", 1, 1e5, 1, keep=[0, 1, 3, 4]), ("row 4 is left out",)),
    "c20_epoch.csv": Case({}, since_the_first(columns("time pressure force", 1, 100.0, 1e-2))),
    "c20_footer.txt": Case({}, columns("time druck kraft", 1, 1e5, 10, sep="\t", rows=4), ("Mittelwert", "Stdabw")),
    "c20_inf.csv": Case(
        {}, columns("time pressure_abs force length", 1, PSI, KGF, 0.0254, sep=";", decimal=",", keep=[0, 1, 3, 4]),
        ("overload",),
    ),
    "c20_kp.csv": Case({}, PAM),
    "c20_midnight.csv": Case(
        {}, stamped(lambda x: x.split(",")[0], columns("- pressure force", 1, PSI, LBF)), ("midnight",)
    ),
    "c20_mix.csv": Case({}, None, ("'0.00' is no number beside '100,0'",)),
    "c20_mixed_decimal.csv": Case({}, columns("time p f", 1, 1e5, 1, sep=";", decimal=",", skip=2), ("parts thousands",)),
    "c20_mpa.csv": Case({}, columns("time pressure force", 1, 1e6, 1e-3 * KGF)),
    "c20_odd.csv": Case(
        {}, columns("time pressure force flow", 1, 249.08891, LBF / 16.0, AIR / 6e4), ("DIN 1343",), tolerance=5e-5
    ),
    "c20_psi.csv": Case({}, GAUGE),
    "c20_psia2.csv": Case({}, PAM),
    "c20_psiabs.csv": Case({}, PAM),
    "c20_psig.csv": Case({}, columns("time pressure force", 1, PSI, LBF)),
    "c20_roll.csv": Case({}, lambda p: {
        "time": 1e-3 * (2.0**32 - 16.0 + 10.0 * np.arange(5)), "pressure": PSI * numbers(p)[1], "force": LBF * numbers(p)[2],
    }, ("begins anew",)),
    "c20_thousand_dot.csv": Case({}, None, ("is 1.013 if the point is the decimal mark, and 1013 if it parts thousands",)),
    "c3_head.csv": Case({}, columns("time port.pressure tank.pressure", 1e-3, 1e5, 1e5)),
    "c3_rep.csv": Case(
        {"header": "t [ms], port.pressure [bar], tank.pressure [bar], a [1], b [1]"},
        columns("- port.pressure tank.pressure a b", 1, 1e5, 1e5, 1, 1, skip=0), ("row 10, row 19: 3 runs",),
    ),
    "c7_bare.lvm": Case(
        {"header": "time [s], p [psi], f [N], m [kg]"}, columns("time p f m", 1, PSI, 1, 1, sep="\t", skip=0)
    ),
    "c7_multi.lvm": Case({}, lambda p: dict(zip(LABVIEW.split(), (
        factor * numbers(p, "\t", 22, ",")[i] for i, factor in ((0, 1.0), (1, PSI), (3, 1.0), (5, 1.0))
    ), strict=True))),
    "c7_one.lvm": Case({}, columns(LABVIEW, 1, PSI, 1, 1, sep="\t", skip=22), ("1 event",)),
    "c8_noinf.csv": Case({}, columns("time channel_a channel_b", 1e-3, 1, 1e-3, skip=2)),
    "c8_pico.csv": Case(
        {}, columns("time channel_a channel_b", 1e-3, 1, 1e-3, skip=2, keep=[0, 1, 2, 3, 6]), ("overload",)
    ),
    "counts.csv": Case(
        {"scales": {"adc_p": "2 mbar/count", "adc_f": "0.5 N/count"}}, columns("time adc_p adc_f", 1e-3, 200.0, 0.5)
    ),
    "ctr.csv": Case({}, columns("time port.pressure tank.pressure", 1e-3, 1e5, 1e5)),
    "mapabs.csv": Case({**REST, "units": {"pressure": "psia"}}, contraction(ATM), ("is absolute",)),
    "mapabs2.csv": Case({**REST, "units": {"pressure": "psia"}}, contraction(ATM), ("is absolute",)),
    "min_bom.csv": Case({}, PLAIN),
    "min_comment.csv": Case({}, PLAIN, ("1 event",)),
    "min_comment2.csv": Case({}, PLAIN, ("1 event",)),
    "min_dots.csv": Case({}, None, ("'1.075.000' is no number beside",)),
    "min_foot.csv": Case({}, PLAIN, ("Peak force 4", "End of test")),
    "min_foot2.csv": Case({}, PLAIN, ("Max 3 4",)),
    "min_simulink.mat": Case({"units": {"p": "bar"}}, savemat_columns("time p", 1.0, 1e5)),
    "min_slpm.csv": Case({}, columns("time pressure flow", 1, 1e3, AIR / 6e4), ("DIN 1343",), tolerance=5e-5),
    "min_thousands.csv": Case(
        {}, lambda p: {"time": [0.0, 0.1, 0.2], "load": [998.0, 1002.0, 1010.0]}, ("parts thousands",)
    ),
    "min_time.csv": Case({"header": "time [ms], p [bar]"}, columns("time p", 1e-3, 1e5, skip=0)),
    "min_time2.csv": Case({"columns": {"time": "tick"}, "units": {"time": "ms"}}, columns("time p", 1e-3, 1e5)),
    "min_total.csv": Case({}, columns("time position force", 1, 1e-3, 1e3)),
}  # fmt: skip


class Outcome(NamedTuple):
    """What became of a file: whether it was read, number of options, largest deviation over the largest value, words."""

    read: bool
    options: int
    worst: float
    right: bool
    said: str


def outcome(path: Path, case: Case) -> Outcome:
    """Read a file, and compare every expected channel with numpy."""
    from mckibben.errors import InputError
    from mckibben.recordings.files import understand

    count = sum(len(value) if isinstance(value, dict) else 1 for value in case.options.values())
    try:
        reading = understand(path, **case.options)
    except InputError as error:
        told = case.expected is None and all(words in str(error) for words in case.says)
        return Outcome(False, count, np.nan, told, str(error).replace(f"{path}: ", ""))
    data, said, worst = reading.data, "; ".join(reading.remarks), 0.0
    for name, values in (case.expected or (lambda path: {}))(path).items():
        known = isinstance(getattr(data, name, None), np.ndarray)
        found, values = np.asarray(getattr(data, name) if known else data[name]), np.asarray(values, float)
        if found.shape != values.shape:
            return Outcome(True, count, np.inf, False, f"{name}: {found.shape} for {values.shape}")
        worst = max(worst, float(np.max(np.abs(found - values)) / (np.max(np.abs(values)) or 1.0)))
    right = case.expected is not None and worst <= case.tolerance and all(words in said for words in case.says)
    return Outcome(True, count, worst, right, said)


def main(folder: Path) -> None:
    """Print the table, and how many are right."""
    rows = {path.name: outcome(path, CASES[path.name]) for path in sorted(folder.iterdir()) if path.name in CASES}
    print("| file | read | options | against numpy | right | said |\n|---|---|---|---|---|---|")
    for name, one in rows.items():
        apart = "-" if np.isnan(one.worst) else f"{one.worst:.1e}"
        words = "yes" if one.right else "**no**"
        print(f"| {name} | {'yes' if one.read else 'refused'} | {one.options} | {apart} | {words} | {one.said} |")
    read, right = sum(one.read for one in rows.values()), sum(one.right for one in rows.values())
    print(f"\n{len(rows)} files: {read} read, {len(rows) - read} refused, {right} as expected")
    print(f"without an option {sum(one.read and not one.options for one in rows.values())}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
