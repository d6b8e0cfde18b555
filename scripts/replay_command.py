"""Runs `scarab replay` and reads its report; shared by the scripts that judge its verdicts."""

import json
import os
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CARGO = ["cargo", "run", "--quiet", "--package", "scarab-tool", "--bin", "scarab", "--"]


class Outcome:
    """One identification: exit code, report or None, printed errors."""

    def __init__(self, code, report, errors):
        self.code, self.report, self.errors = code, report, errors

    @property
    def accepted(self):
        return self.code == 0

    @property
    def verdict(self):
        return {0: "accepted", 3: "refused", 2: "bad input"}.get(self.code, f"exit code {self.code}")

    @property
    def reasons(self):
        return self.report["reasons"] if self.report else []

    @property
    def cause(self):
        """`likely_cause` as (name, joint, value, sigma), or None."""
        found = (self.report or {}).get("likely_cause")
        return (found["name"], found.get("joint"), found.get("value"), found.get("sigma")) if found else None

    @property
    def possible(self):
        """Name and joint of each cause that an unknown one lists."""
        found = (self.report or {}).get("likely_cause") or {}
        return [(cause["name"], cause["joint"]) for cause in found.get("possible", [])]

    def parameters(self):
        """Base parameters with a sigma: name -> (terms, value, sigma)."""
        rows = (self.report or {}).get("base_parameters", [])
        return {r["name"]: (r["terms"], r["value"], r["sigma"]) for r in rows if r["sigma"] is not None}


def binary(path):
    """Command that runs the tool: a binary, or `cargo sim`, which builds it first."""
    return [str(Path(path).resolve())] if path else CARGO


def run(command, files, leg, options=(), csv=None):
    """Identifies a leg from recordings. Adds `--json` and, on request, `--csv`."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "run.json"
        arguments = ["replay", *map(str, files), "--leg", str(leg), "--json", str(report), *map(str, options)]
        if csv:
            arguments += ["--csv", str(csv)]
        done = subprocess.run([*command, *arguments], cwd=ROOT, env=os.environ, capture_output=True, text=True)
        if done.returncode not in (0, 2, 3):
            raise SystemExit(f"error: {' '.join(arguments)}: exit code {done.returncode}\n{done.stderr}")
        content = json.loads(report.read_text()) if report.exists() else None
        return Outcome(done.returncode, content, done.stderr.strip())


def simulated_log(command, leg, seed, folder):
    """Log of one simulated identification, and its report, which holds the truth."""
    log, report = Path(folder) / "log.csv", Path(folder) / "identify.json"
    arguments = ["identify", "--leg", str(leg), "--seed", str(seed), "--log", str(log), "--json", str(report)]
    done = subprocess.run([*command, *arguments], cwd=ROOT, capture_output=True, text=True)
    if done.returncode not in (0, 3):
        raise SystemExit(f"error: {' '.join(arguments)}: exit code {done.returncode}\n{done.stderr}")
    return log, json.loads(report.read_text())


def seeds(text):
    """Seeds of `A..B`, both ends included."""
    first, last = text.split("..")
    return range(int(first), int(last) + 1)
