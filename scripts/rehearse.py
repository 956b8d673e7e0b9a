#!/usr/bin/env python3
"""Runs a job of a workflow on this machine: `make rehearse JOB=ci.yml/package`, or with a row of
its matrix, `make rehearse JOB=release.yml/program MATRIX=target=x86_64-unknown-linux-gnu`.

What GitHub's runners do with a job's own lines is done here, in a fresh clone: each `run` in a
shell of its own with the variables, expressions of the matrix and conditions that stand there.
Other people's actions (`uses`) are named and passed over; checkout is the clone, and setup-python a
virtual environment. It stops where a step fails, as the job would. Steps that a failed one would
set off (`if: failure()`), and those that need a tag, are passed over.
"""

import os
import re
import subprocess
import sys
import tempfile

import yaml

SHELL = ["bash", "--noprofile", "--norc", "-e", "-o", "pipefail", "-c"]


def expanded(text, matrix):
    """The text with the expressions that a rehearsal knows: values of the matrix, and a default
    beside one."""

    def value(found):
        expression = found.group(1).strip()
        with_default = re.fullmatch(r"matrix\.(\w+)(?: \|\| '([^']*)')?", expression)
        if with_default:
            name, default = with_default.groups()
            return str(matrix.get(name, default or ""))
        # On a push, the figures that take seconds.
        on_push = re.fullmatch(
            r"\(github\.event_name == .*\) && '[^']*' \|\| '([^']*)'", expression
        )
        if on_push:
            return on_push.group(1)
        raise SystemExit(f"rehearse: no value is known for {expression!r}")

    return re.sub(r"\$\{\{(.*?)\}\}", value, str(text))


def holds(condition, matrix):
    """Whether a step is done when all before it went well, on a branch."""
    condition = re.sub(r"^\$\{\{|\}\}$", "", str(condition).strip()).strip()
    if condition == "always()":
        return True
    if condition == "failure()" or condition.startswith("startsWith(github.ref, 'refs/tags/"):
        return False
    equal = re.fullmatch(r"matrix\.(\w+) == '([^']*)'", condition)
    if equal:
        return str(matrix.get(equal.group(1), "")) == equal.group(2)
    begins = re.fullmatch(r"!startsWith\(matrix\.(\w+), '([^']*)'\)", condition)
    if begins:
        return not str(matrix.get(begins.group(1), "")).startswith(begins.group(2))
    raise SystemExit(f"rehearse: no truth is known for {condition!r}")


def row(job, wanted):
    """The first row of the job's matrix that has what is wanted."""
    matrix = job.get("strategy", {}).get("matrix", {})
    rows = matrix.get("include") or [{k: v} for k, values in matrix.items() for v in values] or [{}]
    for candidate in rows:
        if all(str(candidate.get(k)) == v for k, v in wanted.items()):
            return candidate
    raise SystemExit(f"rehearse: no row of the matrix has {wanted}")


def main():
    source = sys.argv[1]
    wanted = dict(pair.split("=", 1) for pair in sys.argv[2:])
    workflow, name = source.split("/")
    with open(f".github/workflows/{workflow}") as file:
        jobs = yaml.safe_load(file)["jobs"]
    if name not in jobs:
        raise SystemExit(f"rehearse: {workflow} has no job {name}; it has {', '.join(jobs)}")
    job = jobs[name]
    matrix = row(job, wanted)
    with tempfile.TemporaryDirectory(prefix="rehearsal-") as place:
        tree, temporary = os.path.join(place, "tree"), os.path.join(place, "temporary")
        os.mkdir(temporary)
        subprocess.run(["git", "clone", "--quiet", ".", tree], check=True)
        # Where the tree is, and nothing of what was built before, except for crates.
        environment = {
            k: v for k, v in os.environ.items() if not k.startswith(("CARGO_TARGET", "MAKE"))
        }
        environment |= {
            "CI": "true",
            "RUNNER_OS": "Linux",
            "RUNNER_TEMP": temporary,
            "GITHUB_STEP_SUMMARY": os.path.join(place, "summary.md"),
            "GITHUB_OUTPUT": os.path.join(place, "output"),
        }
        environment |= {k: expanded(v, matrix) for k, v in job.get("env", {}).items()}
        for step in job["steps"]:
            title = step.get("name") or step.get("uses") or step["run"].splitlines()[0]
            if not holds(step.get("if", "always()"), matrix):
                print(f"-- passed over, its condition does not hold: {title}", flush=True)
            elif "uses" in step and step["uses"].startswith("actions/setup-python@"):
                print(f"-- {title}", flush=True)
                subprocess.run(["python3", "-m", "venv", os.path.join(place, "python")], check=True)
                environment["PATH"] = (
                    os.path.join(place, "python", "bin") + os.pathsep + environment["PATH"]
                )
            elif "uses" in step:
                done = (
                    "the clone"
                    if step["uses"].startswith("actions/checkout@")
                    else "passed over, another's action"
                )
                print(f"-- {done}: {step['uses']}", flush=True)
            else:
                print(f"-- {title}", flush=True)
                own = environment | {k: expanded(v, matrix) for k, v in step.get("env", {}).items()}
                status = subprocess.run(
                    [*SHELL, expanded(step["run"], matrix)], cwd=tree, env=own
                ).returncode
                if status:
                    raise SystemExit(f"rehearse: {source}: step {title!r} ended with {status}")
        if os.path.exists(environment["GITHUB_STEP_SUMMARY"]):
            with open(environment["GITHUB_STEP_SUMMARY"]) as file:
                print("-- summary\n" + file.read())
        print(f"-- {source} {matrix or ''}: every step that can be done here went well")


main()
