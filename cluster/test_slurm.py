#!/usr/bin/env python3
"""A sweep on a Slurm of one controller and two nodes on the loopback interface, through Snakemake's job arrays: a job is killed, another
cancelled, a node drained; the merged file must be the single process's, byte for byte.

    test_slurm.py TWOFOLD FOLDER        (needs Debian's slurm-wlm and munge, and root or a user munge to run the key service as)
"""

import getpass
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# 120 rows in 8 parts: three intervals, 40 starts.
SWEEP = "--method dopri5 --t-end 5e4 --over interval=20,40,100 --over shift.x=1e-10*40"
PARTS = 8

CONFIG = """
ClusterName=loopback
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort={port}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket={folder}/munge/socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
MpiDefault=none
MinJobAge=3600
NodeName=n1 NodeHostname=localhost NodeAddr=127.0.0.1 Port={port1} CPUs=1 RealMemory=4000 State=UNKNOWN
NodeName=n2 NodeHostname=localhost NodeAddr=127.0.0.1 Port={port2} CPUs=1 RealMemory=4000 State=UNKNOWN
PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP
"""


def digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def output(*command: str) -> str:
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


class Slurm:
    """A controller, two nodes and their key service, with everything that they write in one folder."""

    def __init__(self):
        # A short path, because of the socket; not the project's, because the key service wants to own its folder.
        self.folder = Path(tempfile.mkdtemp(prefix="twofold-slurm-"))
        self.folder.chmod(0o755)
        munge = self.folder / "munge"
        munge.mkdir(mode=0o755)
        (munge / "key").write_bytes(os.urandom(128))
        (munge / "key").chmod(0o400)
        as_user = []
        if os.geteuid() == 0:
            as_user = ["setpriv", "--reuid", "munge", "--regid", "munge", "--clear-groups"]
            for path in (munge, munge / "key"):
                shutil.chown(path, "munge", "munge")
        (self.folder / "state").mkdir()
        port = random.randrange(20000, 30000)
        text = CONFIG.format(folder=self.folder, user=getpass.getuser(), port=port, port1=port + 1, port2=port + 2)
        self.config = self.folder / "slurm.conf"
        self.config.write_text(text)
        os.environ["SLURM_CONF"] = str(self.config)
        # The executor hides this variable from the srun that it starts inside a job, which then looks for /etc/slurm/slurm.conf.
        srun = self.folder / "bin" / "srun"
        srun.parent.mkdir()
        srun.write_text(f'#!/bin/sh\nSLURM_CONF={self.config} exec {shutil.which("srun")} "$@"\n')
        srun.chmod(0o755)
        os.environ["PATH"] = f"{srun.parent}:{os.environ['PATH']}"
        files = [f"--{what}-file={munge}/{what}" for what in ("key", "pid", "log", "seed")]
        subprocess.run([*as_user, "munged", *files, f"--socket={munge}/socket"], check=True)
        path = {**os.environ, "PATH": os.environ["PATH"] + ":/usr/sbin:/sbin"}
        subprocess.run(["slurmctld"], check=True, env=path)
        for node in ("n1", "n2"):
            subprocess.run(["slurmd", "-N", node], check=True, env=path)
        self.wait("both nodes idle", lambda: output("sinfo", "-h", "-o", "%D %t").split() == ["2", "idle"], 60)

    @staticmethod
    def wait(what: str, ready, seconds: float) -> None:
        deadline = time.time() + seconds
        while not ready():
            if time.time() > deadline:
                raise SystemExit(f"error: {what}: not within {seconds} s")
            time.sleep(0.3)

    @staticmethod
    def jobs(state: str) -> list[list[str]]:
        """Array tasks in a state: job, node."""
        lines = output("squeue", "-h", "-r", f"--states={state}", "-o", "%i %N").splitlines()
        return [line.split() for line in lines]

    def stop(self) -> None:
        for name in ("slurmd-n1.pid", "slurmd-n2.pid", "slurmctld.pid", "munge/pid"):
            try:
                os.kill(int((self.folder / name).read_text()), signal.SIGTERM)
            except (FileNotFoundError, ProcessLookupError):
                pass
        time.sleep(2)
        shutil.rmtree(self.folder, ignore_errors=True)


def programs(folder: Path) -> list[int]:
    """Processes that compute a part in this folder."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            words = (entry / "cmdline").read_bytes().split(b"\0") if entry.name.isdigit() else []
            if b"--shard" in words and os.readlink(entry / "cwd") == str(folder) and words[0].endswith(b"twofold"):
                found.append(int(entry.name))
        except (FileNotFoundError, ProcessLookupError):
            continue
    return found


def torment(slurm: Slurm, folder: Path) -> None:
    rows = lambda: sum(len(f.read_bytes().splitlines()) - 1 for f in folder.glob("merged.parquet.parts/*.journal"))
    slurm.wait("rows of two jobs at work", lambda: rows() >= 2 and len(programs(folder)) > 0, 300)
    victim = programs(folder)[0]
    os.kill(victim, signal.SIGKILL)
    print(f"process of one job killed; {rows()} rows in journals", flush=True)
    # Only then is what still runs another job.
    slurm.wait("the end of that job", lambda: len(slurm.jobs("FAILED")) > 0, 120)
    slurm.wait("another job at work", lambda: len(slurm.jobs("RUNNING")) > 0 and len(programs(folder)) > 0, 300)
    job, node = slurm.jobs("RUNNING")[0]
    subprocess.run(["scancel", job], check=True)
    print(f"job {job} on {node} cancelled", flush=True)
    subprocess.run(["scontrol", "update", "nodename=n2", "state=drain", "reason=test"], check=True)
    done = len(list(folder.glob("merged.parquet.parts/*.done")))
    print(f"node n2 drained with {done} of {PARTS} parts finished", flush=True)
    assert done < PARTS, "the node was to be drained in the middle"


def main() -> int:
    twofold, folder = str(Path(sys.argv[1]).resolve()), Path(sys.argv[2]).resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    single, merged = folder / "single.parquet", folder / "merged.parquet"
    started = time.time()
    subprocess.run([twofold, "sweep", *SWEEP.split(), "--quiet", "--out", str(single)], check=True)
    print(f"single process: {time.time() - started:.0f} s, sha256 {digest(single)}", flush=True)
    slurm = Slurm()
    print(f"{output('sinfo', '--version').strip()}: a controller and two nodes on loopback", flush=True)
    try:
        snakefile = Path(__file__).with_name("sweep.smk")
        command = [sys.executable, "-m", "snakemake", "-s", str(snakefile), "--executor", "slurm", "--slurm-array-jobs=part"]
        command += ["--jobs", str(PARTS), "--retries", "10", "--rerun-incomplete", "--latency-wait", "5", "--slurm-no-account"]
        command += ["--slurm-init-seconds-before-status-checks", "5", "--slurm-status-command", "squeue"]
        command += ["--config", f"parts={PARTS}", "out=merged.parquet", f"twofold={twofold}", f"sweep={SWEEP}"]
        with open(folder / "snakemake.log", "w") as log:
            run = subprocess.Popen(command, cwd=folder, stdout=log, stderr=log)
        try:
            torment(slurm, folder)
            code = run.wait(timeout=1200)
        finally:
            run.kill()
        states = {s: slurm.jobs(s) for s in ("COMPLETED", "FAILED", "CANCELLED")}
        print(", ".join(f"{len(jobs)} {state.lower()}" for state, jobs in states.items()) + f"; Snakemake ended with {code}")
        print("nodes at the end: " + ", ".join(output("sinfo", "-h", "-N", "-o", "%N %T").splitlines()))
    finally:
        slurm.stop()
    print(f"merged: sha256 {digest(merged)}", flush=True)
    same = merged.read_bytes() == single.read_bytes()
    print("the same bytes" if same else "OTHER BYTES", flush=True)
    return 0 if same and code == 0 and states["FAILED"] and states["CANCELLED"] else 1


if __name__ == "__main__":
    sys.exit(main())
