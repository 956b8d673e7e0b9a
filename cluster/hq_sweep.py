#!/usr/bin/env python3
"""Compute a sweep on HyperQueue: tasks are `twofold sweep ... --shard K/N --resume`, submitted
again until each is done, then merged.

    hq_sweep.py --server-dir DIR --parts 1000 --out map.csv -- \\
        --t-end 2e5 --over params.alpha=1e-3..1:log:1000 ...

What follows -- are flags of `twofold sweep`. A part that was finished earlier is not computed
again, so a driver, a worker or a whole cluster that was killed is started again with the same line.
"""

import argparse
import subprocess
import sys
from pathlib import Path

from hyperqueue import Job, LocalCluster
from hyperqueue.client import Client
from hyperqueue.cluster import WorkerConfig


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument(
        "--server-dir", type=Path, metavar="DIR", help="join the server that runs in this directory"
    )
    where.add_argument(
        "--local",
        type=int,
        metavar="CORES",
        help="start a server and a worker with this many cores here",
    )
    parser.add_argument(
        "--parts",
        type=int,
        required=True,
        metavar="N",
        help="number of tasks; 100 to 10000 rows a task",
    )
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="FILE",
        help="result; parts are kept in FILE.parts until it is there",
    )
    parser.add_argument(
        "--twofold",
        default="twofold",
        metavar="FILE",
        help="the program, as the workers find it [twofold]",
    )
    parser.add_argument(
        "--rounds",
        type=int,
        default=10,
        metavar="N",
        help="submit unfinished parts at most so often [10]",
    )
    parser.add_argument("sweep", nargs="+", metavar="FLAG", help="flags of twofold sweep, after --")
    return parser.parse_args()


class Parts:
    """The parts of a sweep: a file each, beside it a journal until it is whole."""

    def __init__(self, args: argparse.Namespace):
        self.args = args
        self.folder = Path(f"{args.out}.parts").resolve()
        self.folder.mkdir(parents=True, exist_ok=True)

    def file(self, k: int) -> Path:
        return self.folder / f"{k}.csv"

    def unfinished(self) -> list[int]:
        # A part whose rows failed is finished: they are rows that say why. So files count, not exit
        # codes.
        def is_whole(k: int) -> bool:
            return self.file(k).exists() and not Path(f"{self.file(k)}.journal").exists()

        return [k for k in range(1, self.args.parts + 1) if not is_whole(k)]

    def command(self, k: int) -> list[str]:
        shard = [
            "--shard",
            f"{k}/{self.args.parts}",
            "--resume",
            "--threads",
            "1",
            "--quiet",
            "--out",
            str(self.file(k)),
        ]
        return [self.args.twofold, "sweep", *self.args.sweep, *shard]

    def job(self) -> Job:
        # One failed task must not cancel the others.
        job = Job(max_fails=None, default_workdir=self.folder)
        for k in self.unfinished():
            job.program(
                self.command(k), stdout=None, stderr=str(self.folder / f"{k}.err"), name=f"part {k}"
            )
        return job

    def merge(self) -> int:
        files = [str(self.file(k)) for k in range(1, self.args.parts + 1)]
        return subprocess.run(
            [self.args.twofold, "sweep", "merge", *files, "--out", str(self.args.out)]
        ).returncode


def compute(parts: Parts, client: Client) -> None:
    for number in range(1, parts.args.rounds + 1):
        left = parts.unfinished()
        if not left:
            return
        print(
            f"round {number}: {len(left)} of {parts.args.parts} parts to compute",
            file=sys.stderr,
            flush=True,
        )
        client.wait_for_jobs([client.submit(parts.job())], raise_on_error=False)


def main() -> int:
    args = arguments()
    parts = Parts(args)
    if args.server_dir is not None:
        compute(parts, Client(args.server_dir.resolve()))
    else:
        with LocalCluster(worker_config=WorkerConfig(cores=args.local)) as cluster:
            compute(parts, cluster.client())
    left = parts.unfinished()
    if left:
        print(f"error: {len(left)} parts are not finished; part {left[0]} says:", file=sys.stderr)
        print((parts.folder / f"{left[0]}.err").read_text(), file=sys.stderr)
        return 3
    return parts.merge()


if __name__ == "__main__":
    sys.exit(main())
