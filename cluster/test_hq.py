#!/usr/bin/env python3
"""Kill a sweep on HyperQueue: tasks at random, then the whole cluster, then go on; the merged file
must be the single process's, byte for byte.

    test_hq.py TWOFOLD FOLDER
"""

import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

# 120 rows in 12 parts: three intervals, 40 starts.
SWEEP = "--method dopri5 --t-end 5e4 --over interval=20,40,100 --over shift.x=1e-10*40".split()
PARTS = 12
# Tasks killed before and after the cluster is.
KILLS = 6
# A server and two workers of one core each, until killed.
CLUSTER = """
import sys, time
from hyperqueue import LocalCluster
from hyperqueue.cluster import WorkerConfig
cluster = LocalCluster(sys.argv[1])
for _ in range(2):
    cluster.start_worker(WorkerConfig(cores=1))
print("ready", flush=True)
time.sleep(3600)
"""


def digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def tasks_of(parent: int) -> list[int]:
    """Processes of the program whose ancestor is `parent`."""
    parents, programs = {}, set()
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            # The name in parentheses may hold blanks.
            parents[int(entry.name)] = int(
                (entry / "stat").read_text().rpartition(")")[2].split()[1]
            )
            if b"\0sweep\0" in (entry / "cmdline").read_bytes():
                programs.add(int(entry.name))
        except (FileNotFoundError, ProcessLookupError):
            continue

    def descends(pid: int) -> bool:
        while pid in parents:
            pid = parents[pid]
            if pid == parent:
                return True
        return False

    return [pid for pid in programs if descends(pid)]


def kill(pids: list[int]) -> int:
    killed = 0
    for pid in pids:
        try:
            os.kill(pid, signal.SIGKILL)
            killed += 1
        except ProcessLookupError:
            pass
    return killed


class Cluster:
    def __init__(self, folder: Path):
        folder.mkdir()
        self.folder = folder
        self.process = subprocess.Popen(
            [sys.executable, "-c", CLUSTER, str(folder)], stdout=subprocess.PIPE, text=True
        )
        # The server says first where it is.
        assert any(line == "ready\n" for line in self.process.stdout), "the cluster did not start"

    def kill(self) -> int:
        """As if every machine lost its power at once."""
        tasks = tasks_of(self.process.pid)
        self.process.kill()
        self.process.wait()
        return kill(tasks)


def main() -> int:
    # HyperQueue finds a server by a link in its directory, which must not be relative.
    twofold, folder = str(Path(sys.argv[1]).resolve()), Path(sys.argv[2]).resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    chance = random.Random(2013)
    single, merged = folder / "single.csv", folder / "merged.csv"
    started = time.time()
    subprocess.run([twofold, "sweep", *SWEEP, "--quiet", "--out", str(single)], check=True)
    print(f"single process: {time.time() - started:.0f} s, sha256 {digest(single)}", flush=True)

    driver = Path(__file__).with_name("hq_sweep.py")
    command = [
        sys.executable,
        str(driver),
        "--parts",
        str(PARTS),
        "--out",
        str(merged),
        "--twofold",
        twofold,
    ]
    deadline = time.time() + 1200

    def begin(cluster: Cluster) -> subprocess.Popen:
        log = open(folder / f"driver-{cluster.folder.name}.log", "w")
        return subprocess.Popen(
            [*command, "--server-dir", str(cluster.folder), "--", *SWEEP], stderr=log, stdout=log
        )

    def torment(cluster: Cluster, run: subprocess.Popen, wanted: int) -> int:
        killed = 0
        while killed < wanted and run.poll() is None and time.time() < deadline:
            time.sleep(chance.uniform(0.3, 1.0))
            tasks = tasks_of(cluster.process.pid)
            if tasks:
                killed += kill([chance.choice(tasks)])
        return killed

    def finished() -> int:
        return sum(
            1 for k in range(1, PARTS + 1) if (folder / f"merged.csv.parts/{k}.csv").exists()
        )

    first = Cluster(folder / "first")
    run = begin(first)
    killed = torment(first, run, KILLS)
    while finished() < 2 and run.poll() is None and time.time() < deadline:
        time.sleep(0.1)
    done = finished()
    lost = first.kill()
    try:
        code = run.wait(timeout=60)
    except subprocess.TimeoutExpired:
        run.kill()
        code = run.wait()
    print(
        f"{killed} tasks killed, then the whole cluster with {lost} tasks at work and {done} of "
        f"{PARTS} parts finished; driver ended with {code}",
        flush=True,
    )
    assert killed == KILLS and 0 < done < PARTS and not merged.exists(), (
        "the cluster was to be killed in the middle"
    )

    second = Cluster(folder / "second")
    run = begin(second)
    killed = torment(second, run, KILLS)
    code = run.wait(timeout=max(1.0, deadline - time.time()))
    second.kill()
    rounds = (folder / "driver-second.log").read_text().count("round ")
    print(
        f"resumed on a new cluster: {killed} more tasks killed, {rounds} rounds, driver ended with "
        f"{code}",
        flush=True,
    )
    print(f"merged: sha256 {digest(merged)}", flush=True)
    same = merged.read_bytes() == single.read_bytes()
    print("the same bytes" if same else "OTHER BYTES", flush=True)
    return 0 if same and code == 0 and killed > 0 else 1


if __name__ == "__main__":
    sys.exit(main())
