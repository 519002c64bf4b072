"""Kill commands at random moments: outputs stay whole, nothing stays behind, the next run ends.

python -m benchmarks.kills --count 200

Each case starts ``batch``, ``inpaint`` or ``compare``, sends a signal to the command itself, to one
of its workers or to its renderer, and starts the same command again. Linux only.
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from benchmarks.batch_runs import make_scans
from benchmarks.killed_runs import Run, faults_of_files, send
from meshlab_lowrank.scratch import SCRATCH_PREFIX

COMMANDS = ("batch", "inpaint", "compare")
VICTIMS = ("command", "worker", "renderer")
SIGNALS = ("SIGKILL", "SIGTERM", "SIGINT", "SIGHUP")
MOMENTS = ("any time", "a worker is there", "work is there", "an output is there")

_FILES = 3
_SMOOTHLY = ("--detail", "none")  # recovering it writes nothing
_GONE = 10.0  # seconds after which all processes of a dead command must be gone
_RENDERER = (
    "import time\n\ntime.sleep(0.7)\nraise SystemExit('no screen')\n"  # stands in for PyVista
)


@dataclass(frozen=True)
class Case:
    """One kill: what is run, who gets which signal, and when.

    Attributes
    ----------
    command, victim, signal, moment : str
    delay : float
        Seconds after the moment.
    """

    command: str
    victim: str
    signal: str
    moment: str
    delay: float


@dataclass(frozen=True)
class Outcome:
    """What a case showed.

    Attributes
    ----------
    case : Case
    hit : bool
        Whether the signal found its victim.
    wrong : tuple of str
    """

    case: Case
    hit: bool
    wrong: tuple[str, ...]


class Bench:
    """Inputs, and the outputs of runs that nobody kills.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.scans = folder / "scans"
        make_scans(self.scans, _FILES)
        self.stand_in = folder / "modules"
        self.stand_in.mkdir()
        (self.stand_in / "pyvista.py").write_text(_RENDERER)
        self.wholes: dict[str, Path] = {}
        self.codes: dict[str, int] = {}
        self.seconds: dict[str, float] = {}
        for command in COMMANDS:
            place = folder / command
            place.mkdir()
            started = time.monotonic()
            with self.run(command, place) as run:
                self.codes[command] = run.wait()
            self.seconds[command] = time.monotonic() - started
            self.wholes[command] = place / "out"

    def draw(self, number: int, seed: int, victims: Sequence[str], signals: Sequence[str]) -> Case:
        """Draw a case; commands take turns."""
        chance = random.Random(f"{seed} {number}")
        command = COMMANDS[number % len(COMMANDS)]
        if command == "inpaint":  # draws nothing
            victims = [victim for victim in victims if victim != "renderer"] or ["worker"]
        moment = chance.choice(MOMENTS)
        longest = self.seconds[command] if moment == MOMENTS[0] else 0.5
        return Case(
            command,
            chance.choice(victims),
            chance.choice(signals),
            moment,
            chance.uniform(0.0, longest),
        )

    def run(self, command: str, place: Path) -> Run:
        """Start a command in a place of its own."""
        return Run(lambda out: self._arguments(command, out), self.stand_in, place)

    def _arguments(self, command: str, out: Path) -> list[str]:
        scan = str(self.scans / "scan000.ply")
        if command == "batch":
            return [command, str(self.scans), str(out), "--workers", "2", *_SMOOTHLY]
        if command == "inpaint":
            return [command, scan, str(out / "scan000.ply"), *_SMOOTHLY]
        files = ["--html", str(out / "report.html"), "--csv", str(out / "table.csv")]
        return [command, scan, "--fillers", "close,lowrank-none", "--places", "1", *files]


def perform(bench: Bench, case: Case, place: Path) -> Outcome:
    """Kill, look, run again, look."""
    place.mkdir()
    wrong: list[str] = []
    with bench.run(case.command, place) as run:
        victim = _wait_for_victim(run, case)
        hit = victim is not None and send(victim, case.signal)
        code = run.wait()
        until = time.monotonic() + _GONE
        while run.processes() and time.monotonic() < until:
            time.sleep(0.02)
        if left := run.processes():
            wrong.append(f"{len(left)} processes stayed")
        wrong += _faults_of_end(bench, case, run, code, hit=hit)
        wrong += faults_of_files(
            bench.wholes[case.command], run.out, exact=case.victim == "command"
        )
    with bench.run(case.command, place) as again:
        code = again.wait()
        if code != bench.codes[case.command]:
            wrong.append(f"the next run ended with {code}: {again.text[-500:]}")
        wrong += [f"the next run left {name}" for name in again.leftovers()]
        faults = faults_of_files(bench.wholes[case.command], again.out, exact=True)
        wrong += [f"the next run: {fault}" for fault in faults]
        missing = {path.name for path in bench.wholes[case.command].iterdir()} - {
            path.name for path in again.out.iterdir()
        }
        wrong += [f"the next run made no {name}" for name in missing]
    return Outcome(case, hit, tuple(wrong))


def campaign(
    folder: Path,
    count: int,
    seed: int,
    jobs: int,
    *,
    victims: Sequence[str] = VICTIMS,
    signals: Sequence[str] = SIGNALS,
) -> Iterator[Outcome]:
    """Perform cases, some at a time.

    Parameters
    ----------
    folder : Path
        An empty one.
    count, seed : int
    jobs : int
        Cases at a time.
    victims, signals : sequence of str
        What is drawn from.

    Yields
    ------
    Outcome
    """
    bench = Bench(folder)
    with ThreadPoolExecutor(jobs) as threads:
        yield from threads.map(
            lambda number: perform(
                bench, bench.draw(number, seed, victims, signals), folder / f"case{number}"
            ),
            range(count),
        )


def _wait_for_victim(run: Run, case: Case) -> int | None:
    """Wait for the moment, then for the victim; None if the command ended before."""
    happened: dict[str, Callable[[], object]] = {
        MOMENTS[0]: lambda: True,
        MOMENTS[1]: lambda: run.processes("worker"),
        MOMENTS[2]: lambda: list(run.out.glob(f"{SCRATCH_PREFIX}*")) or run.processes("renderer"),
        MOMENTS[3]: lambda: list(run.out.glob("*.*")),
    }
    while run.alive and not happened[case.moment]():
        time.sleep(0.005)
    time.sleep(case.delay)
    while run.alive:
        if case.victim == "command":
            if case.signal == "SIGKILL" or _listens(run.process.pid):
                return run.process.pid
        elif found := run.processes(case.victim):
            return random.Random(case.delay).choice(found)
        time.sleep(0.005)
    return None


def _listens(number: int) -> bool:
    """Whether Python has started and the command listens to signals."""
    try:
        status = Path(f"/proc/{number}/status").read_text(encoding="utf-8")
    except OSError:
        return False
    caught = next((line for line in status.splitlines() if line.startswith("SigCgt:")), "SigCgt: 0")
    return bool(int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1)


def _faults_of_end(bench: Bench, case: Case, run: Run, code: int, *, hit: bool) -> list[str]:
    """Check exit code, words and leftovers of the run that was shot at."""
    wrong = []
    number = int(getattr(signal, case.signal))
    killed = case.victim == "command" and case.signal == "SIGKILL" and hit
    fair = {bench.codes[case.command]}
    if case.victim == "command" and hit:
        fair |= {-number} if killed else {128 + number}
    elif hit:
        fair |= {1}  # a worker is lost with its file, unless that has a second attempt
    if code not in fair:
        wrong.append(f"the exit code is {code}, none of {sorted(fair)}: {run.text[-500:]}")
    if "Traceback" in run.text or "Error" in run.text:
        wrong.append(f"it said {run.text[-500:]}")
    if not killed:
        wrong += [f"{name} stayed" for name in run.leftovers()]
    return wrong


def summary(outcomes: Sequence[Outcome]) -> str:
    """Count the cases and the wrong ones by kind."""
    lines = [f"{'command':10}{'victim':10}{'signal':10}{'cases':>6}{'hit':>6}{'wrong':>6}"]
    kinds = Counter((o.case.command, o.case.victim, o.case.signal) for o in outcomes)
    for kind in sorted(kinds):
        same = [o for o in outcomes if (o.case.command, o.case.victim, o.case.signal) == kind]
        hit, wrong = sum(o.hit for o in same), sum(bool(o.wrong) for o in same)
        lines.append("".join(f"{word:10}" for word in kind) + f"{len(same):6}{hit:6}{wrong:6}")
    hit, wrong = sum(o.hit for o in outcomes), sum(bool(o.wrong) for o in outcomes)
    return "\n".join([*lines, f"{'all':30}{len(outcomes):6}{hit:6}{wrong:6}"])


def main() -> int:
    """Perform a campaign and show what went wrong, by kind."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2, help="cases at a time")
    parser.add_argument("--victims", nargs="+", choices=VICTIMS, default=VICTIMS)
    parser.add_argument("--signals", nargs="+", choices=SIGNALS, default=SIGNALS)
    args = parser.parse_args()
    outcomes = []
    with tempfile.TemporaryDirectory() as folder:
        among = {"victims": args.victims, "signals": args.signals}
        for outcome in campaign(Path(folder), args.count, args.seed, args.jobs, **among):
            outcomes.append(outcome)
            for fault in outcome.wrong:
                print(f"{len(outcomes) - 1}: {outcome.case}: {fault}", flush=True)
    print(summary(outcomes))
    return 1 if any(outcome.wrong for outcome in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
