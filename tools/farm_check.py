#!/usr/bin/env python3
"""Runs what `convect job` writes on a Slurm of its own and with the command line of Open Job Description.

    farm_check.py CONVECT [--openjd PROGRAM] [--folder DIR]
    farm_check.py CONVECT --scaling          how long a job takes on 1, 2, 4, 8 and 16 slots, instead

munged, slurmctld and slurmd (Debian: slurm-wlm, munge) are started in one folder and ended again; where they are missing,
or PROGRAM is, that half is skipped with a line that says so. Checked are three scenes: a window, a solver, and both with
curves behind the solver and an output that stops moving halfway. The merged results equal a cook of the whole, bit for
bit, also between frames; a solver killed in the middle is queued again, keeps at least 80 % of its work and gives the
same bytes; a wrong name of an output fails once, and what depends on it is cancelled. Exit code 0 means that all holds.
"""

import argparse
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

GRAPHS = Path(__file__).resolve().parent.parent / "graphs"

# Dough that grows hair, which swings, and blades in a wind that dies down halfway.
BOTH = """{
  "convect": 1,
  "scene": { "frames": [1, 24], "fps": 24, "seed": 5, "origin": [1000.25, 0, 0] },
  "nodes": {
    "lump": { "type": "Mesh_Primitive", "params": { "shape": "sphere", "size": [0.2, 0.09, 0.2], "divisions": 4 } },
    "placed": { "type": "Transform", "inputs": { "geometry": "lump" }, "params": { "translate": [0, 0.08, 0] } },
    "body": { "type": "Tetrahedralize", "inputs": { "surface": "placed" } },
    "fall": { "type": "Softbody", "inputs": { "bodies": ["body"] }, "params": { "stiffness": 3e3, "ground": true } },
    "hair": { "type": "Curve_Scatter", "inputs": { "skin": "placed" }, "params": { "density": 4000, "length": [0.03, 0.05] } },
    "carried": { "type": "Curve_Attach", "inputs": { "curves": "hair", "rest_skin": "placed", "skin": "fall.surface" } },
    "swing": { "type": "Curve_Jiggle", "inputs": { "curves": "carried" }, "params": { "frequency": 12, "damping": 0.7 } },
    "field": { "type": "Mesh_Primitive", "params": { "divisions": 6 } },
    "blades": { "type": "Curve_Scatter", "inputs": { "skin": "field" }, "params": { "density": 200, "length": [0.1, 0.2] } },
    "wind": {
      "type": "Curve_Wind", "inputs": { "curves": "blades" },
      "params": { "global_rotate": { "keyframes": [[1, 0], [12, 0.6]] }, "scroll": 0, "noise": "none" }
    }
  },
  "outputs": { "hair": "swing", "dough": "fall.surface", "grass": "wind", "still": "blades" }
}
"""


class Job:
    """A scene, its frames, and how it is cut."""

    def __init__(self, name, graph, outputs, frames, chunk=None, settings=()):
        self.name, self.graph, self.outputs, self.frames, self.chunk = name, graph, outputs, frames, chunk
        self.settings = [word for setting in settings for word in ("--set", setting)]


class Check:
    """The program, a folder, and the faults found so far."""

    def __init__(self, convect, folder):
        self.convect, self.folder, self.faults = convect, folder, []
        self.began = time.monotonic()

    def expect(self, holds, what):
        print(f"  {time.monotonic() - self.began:5.1f} s  {'ok   ' if holds else 'FAULT'} {what}", flush=True)
        if not holds:
            self.faults.append(what)

    def run(self, *words, **more):
        """Runs convect; whether it exited with 0, and what it printed."""
        done = subprocess.run([self.convect, *map(str, words)], capture_output=True, text=True, **more)
        if done.returncode:
            print(f"  convect {' '.join(map(str, words))}: exit {done.returncode}\n{done.stdout}{done.stderr}")
        return done.returncode == 0, done.stdout

    def cook_whole(self, job, word="--frames"):
        frames = [word, "{}-{}".format(*job.frames)]
        done, _ = self.run("cook", job.graph, *frames, *job.settings, "--out", self.folder / "whole" / job.name, "--quiet")
        self.expect(done, f"{job.name}: the whole is cooked")

    def write(self, job, engine, out):
        chunk = ["--chunk", job.chunk] if job.chunk else []
        frames = ["--frames", "{}-{}".format(*job.frames)]
        words = [*frames, *chunk, *job.settings, "--engine", engine, "--out", out, "--quiet"]
        done, _ = self.run("job", job.graph, *words)
        self.expect(done, f"{job.name}: a job for {engine} is written")
        return out / f"{job.graph.stem}.{'slurm.sh' if engine == 'slurm' else 'openjd.yaml'}"

    def compare(self, job, out):
        """The merged outputs and a cook of the whole: at all frames, between frames and between parts."""
        whole = self.folder / "whole" / job.name
        nodes, first = {}, job.frames[0]
        for name in job.outputs:
            same, said = self.run("diff", whole / f"{name}.usdc", out / f"{name}.usda")
            self.expect(same and said == "the same\n", f"{job.name}: `{name}` of {out.name} is that of the whole")
            for kind, file in [("a", whole / f"{name}.usdc"), ("b", out / f"{name}.usda")]:
                nodes[f"{kind}_{name}"] = {"type": "Usd_In", "params": {"file": str(file)}}
        scene = {"convect": 1, "scene": {"frames": list(job.frames)}, "nodes": nodes, "outputs": {node: node for node in nodes}}
        graph, half = out / "half.json", out / "half"
        graph.write_text(json.dumps(scene))
        # Parts end at multiples of 8, or of a window's spacing.
        frames = ",".join(f"{first + back}.5" for back in range(2, job.frames[1] - first, 3))
        done, _ = self.run("cook", graph, "--frames", frames, "--format", "json", "--out", half, "--quiet")
        halves = [self.run("diff", half / f"a_{name}.####.json", half / f"b_{name}.####.json") for name in job.outputs]
        same = done and all(found and said == "the same\n" for found, said in halves)
        self.expect(same, f"{job.name}: {frames.count(',') + 1} half frames of {out.name} are those of the whole")


class Slurm:
    """munged, slurmctld and slurmd with all that they write in one folder."""

    def __init__(self, folder, slots=None):
        self.folder, self.daemons, self.slots = folder, [], slots or os.cpu_count()
        self.environment = os.environ | {"SLURM_CONF": str(folder / "slurm.conf")}

    def __enter__(self):
        for name in ("state", "spool"):
            (self.folder / name).mkdir(parents=True)
        self.folder.chmod(0o755)
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        host = socket.gethostname().split(".")[0]
        with socket.socket() as a, socket.socket() as b:
            a.bind(("127.0.0.1", 0)), b.bind(("127.0.0.1", 0))
            ports = a.getsockname()[1], b.getsockname()[1]
        user = "root" if os.getuid() == 0 else os.environ.get("USER", "root")
        lines = {
            "ClusterName": "check", "SlurmctldHost": f"{host}(127.0.0.1)", "SlurmctldPort": ports[0], "SlurmdPort": ports[1],
            "SlurmUser": user, "SlurmdUser": user, "AuthType": "auth/munge", "CredType": "cred/munge",
            # A job that is queued again waits for as long as its credential lasts: 120 s if nothing is said, 5 s at least.
            "AuthInfo": f"socket={self.folder}/munge.socket,cred_expire=5",
            "StateSaveLocation": self.folder / "state", "SlurmdSpoolDir": self.folder / "spool",
            "SlurmctldPidFile": self.folder / "slurmctld.pid", "SlurmdPidFile": self.folder / "slurmd.pid",
            "SlurmctldLogFile": self.folder / "slurmctld.log", "SlurmdLogFile": self.folder / "slurmd.log",
            "ProctrackType": "proctrack/linuxproc", "TaskPlugin": "task/none", "SwitchType": "switch/none", "MpiDefault": "none",
            "JobAcctGatherType": "jobacct_gather/none", "AccountingStorageType": "accounting_storage/none",
            "SelectType": "select/cons_tres", "SelectTypeParameters": "CR_CPU", "ReturnToService": 2, "MinJobAge": 3600,
            "SchedulerType": "sched/builtin", "SchedulerParameters": "batch_sched_delay=0,sched_interval=1",
            "SlurmdParameters": "config_overrides",
            "NodeName": f"{host} NodeAddr=127.0.0.1 CPUs={self.slots} State=UNKNOWN",
            "PartitionName": f"all Nodes={host} Default=YES MaxTime=INFINITE State=UP",
        }
        text = "".join(f"{name}={value}\n" for name, value in lines.items())
        (self.folder / "slurm.conf").write_text(text)
        munge = [f"--{name}-file={self.folder}/munge.{name}" for name in ("key", "pid", "log", "seed")]
        self.start("munged", "--foreground", "--force", f"--socket={self.folder}/munge.socket", *munge)
        self.wait(lambda: (self.folder / "munge.socket").exists())
        self.start("slurmctld", "-D", "-f", self.folder / "slurm.conf")
        self.start("slurmd", "-D", "-f", self.folder / "slurm.conf", "-N", host)
        self.wait(lambda: "idle" in self.ask("sinfo", "--noheader", "--format=%t"))
        return self

    def __exit__(self, *_):
        self.ask("scancel", "--state=RUNNING"), self.ask("scancel", "--state=PENDING")
        for daemon in reversed(self.daemons):
            daemon.terminate()
        for daemon in self.daemons:
            try:
                daemon.wait(10)
            except subprocess.TimeoutExpired:
                daemon.kill()

    def start(self, name, *words):
        path = shutil.which(name) or f"/usr/sbin/{name}"
        log = open(self.folder / f"{name}.out", "w")
        daemon = subprocess.Popen([path, *map(str, words)], stdout=log, stderr=log, env=self.environment)
        self.daemons.append(daemon)

    def wait(self, until, seconds=30):
        end = time.monotonic() + seconds
        while not until():
            if time.monotonic() > end:
                logs = [file.read_text()[-2000:] for file in self.folder.glob("*.out")]
                raise SystemExit("Slurm did not start:\n" + "\n".join(logs))
            time.sleep(0.1)

    def ask(self, *words):
        return subprocess.run(list(map(str, words)), capture_output=True, text=True, env=self.environment).stdout

    def tasks(self):
        """What Slurm knows of each task: a dictionary of its fields."""
        lines = self.ask("scontrol", "show", "job", "--oneliner").splitlines()
        return [dict(re.findall(r"(\S+?)=(\S*)", line)) for line in lines if line.startswith("JobId=")]

    def submit(self, check, script, out, program=None):
        environment = self.environment | {"CONVECT": program or check.convect, "SBATCH_OPTIONS": f"--output={out}/log.%A.%a"}
        done = subprocess.run(["bash", script], env=environment, capture_output=True, text=True, cwd=check.folder)
        check.expect(done.returncode == 0, f"{out.name}: submitted {done.stderr}")


ENDED = {"COMPLETED", "FAILED", "CANCELLED", "TIMEOUT", "NODE_FAIL", "BOOT_FAIL", "OUT_OF_MEMORY", "DEADLINE"}


def check_slurm(check, jobs, solver):
    folder = check.folder / "slurm"
    with Slurm(folder / "daemons") as slurm:
        check.expect(True, "Slurm is up")
        for job in jobs:
            out = folder / job.name
            slurm.submit(check, check.write(job, "slurm", out), out)
        killed, wrong = folder / "killed", folder / "wrong"
        script = check.write(jobs[1], "slurm", wrong)
        script.write_text(script.read_text().replace("--output dough", "--output bread"))
        # The names of jobs tell them apart.
        script = script.rename(wrong / "wrong.slurm.sh")
        script.write_text(script.read_text().replace("job-name=dough_rolling", "job-name=wrong"))
        slurm.submit(check, script, wrong)
        script = check.write(solver, "slurm", killed)
        script.write_text(script.read_text().replace("job-name=dough_rolling", "job-name=killed"))
        slurm.submit(check, script, killed)
        done = kill_solver(check, slurm, solver, killed)
        end = time.monotonic() + 120
        while not all(task["JobState"] in ENDED for task in slurm.tasks()) and time.monotonic() < end:
            time.sleep(0.2)
        tasks = slurm.tasks()
        states = {}
        for task in tasks:
            states.setdefault(task["JobName"], []).append((task["JobState"], task["ExitCode"], task["Restarts"]))
        odd = {name: found for name, found in states.items() if not name.startswith(("wrong", "killed"))}
        odd = {name: found for name, found in odd.items() if {state[0] for state in found} != {"COMPLETED"}}
        check.expect(not odd, f"{len(tasks)} tasks have ended, as they should {odd or ''}")
        for job in jobs:
            check.compare(job, folder / job.name)
        check.expect(states.get("wrong.solve-dough") == [("FAILED", "2:0", "0")], f"a wrong output fails once: {states.get('wrong.solve-dough')}")
        merge = [state[0] for state in states.get("wrong.merge", [])]
        check.expect(merge == ["CANCELLED"], f"its merge is cancelled: {merge}")
        check.expect(states.get("killed.solve-dough") == [("COMPLETED", "0:0", "1")], f"the killed solver is queued again: {states.get('killed.solve-dough')}")
        part = killed / "parts" / "{}-{}".format(*solver.frames)
        report = json.loads((part / "report.solve-dough.json").read_text())
        frames = solver.frames[1] - solver.frames[0] + 1
        kept = frames - report["nodes"]["dough"]["cooks"]
        check.expect(kept >= 0.8 * done, f"{kept} of the {done} frames that it had cooked are kept, of {frames}")
        same = (part / "dough.usdc").read_bytes() == (check.folder / "whole" / solver.name / "dough.usdc").read_bytes()
        check.expect(same, "its file is that of an undisturbed cook, byte for byte")
        check.compare(solver, killed)


def size_of(path):
    """0 if the file has just been removed."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0


def kill_solver(check, slurm, job, out):
    """Kills the cook of a solver once half of its frames are in the cache; how many were."""
    half = (job.frames[1] - job.frames[0] + 1) // 2
    end = time.monotonic() + 120
    while time.monotonic() < end:
        # What else was worth keeping (the tets, on a slow machine also samples of the pin) is smaller than what the solver made.
        sizes = [size_of(path) for path in out.glob("cache/*/*.result")]
        done = sizes.count(max(sizes, default=0))
        if done >= half:
            for process in Path("/proc").glob("[0-9]*"):
                try:
                    words = (process / "cmdline").read_bytes().decode(errors="replace").split("\0")
                except OSError:
                    continue
                if words[1:2] == ["cook"] and "dough" in words and any(word.startswith(str(out)) for word in words):
                    os.kill(int(process.name), signal.SIGKILL)
                    check.expect(True, f"the solver is killed after {done} frames")
                    return done
        time.sleep(0.02)
    check.expect(False, "the solver was seen half-way")
    return 0


def check_openjd(check, openjd, jobs):
    for job in jobs:
        out = check.folder / "openjd" / job.name
        template = check.write(job, "openjd", out)
        checked = subprocess.run([openjd, "check", template], capture_output=True, text=True)
        check.expect(checked.returncode == 0, f"{job.name}: the template is right {checked.stdout if checked.returncode else ''}")
        done = run_openjd(check, openjd, template, job, out)
        check.expect(done.returncode == 0, f"{job.name}: ran {(done.stdout + done.stderr)[-3000:] if done.returncode else ''}")
        check.compare(job, out)
    out = check.folder / "openjd" / "wrong"
    template = check.write(jobs[1], "openjd", out)
    template.write_text(template.read_text().replace('"dough"', '"bread"'))
    done = run_openjd(check, openjd, template, jobs[1], out)
    said = done.stdout + done.stderr
    times, merged = said.count("has no output `bread`"), (out / "report.json").exists()
    check.expect(done.returncode != 0 and times == 1 and not merged, f"a wrong output fails once ({times}), and nothing is merged")


def run_openjd(check, openjd, template, job, out):
    parameters = {"Graph": job.graph, "Out": out, "Cache": out / "cache", "Convect": check.convect}
    words = [word for name, value in parameters.items() for word in ("-p", f"{name}={value}")]
    command = [openjd, "run", template, "--step", "merge", "--run-dependencies", *words]
    return subprocess.run(list(map(str, command)), capture_output=True, text=True)


def scaling(check):
    """Prints how long a job of 16 parts takes, of which each takes 2 s on one slot; and one that cooks."""
    storm = GRAPHS / "bear_storm" / "bear_storm.json"
    waits, cooks = check.folder / "waits", check.folder / "cooks"
    waits.write_text('#!/bin/bash\n[ "$1" = merge ] || sleep 2\n')
    cooks.write_text(f'#!/bin/bash\n[ "$1" = merge ] && exec {check.convect} "$@"\nexec {check.convect} "$@" --threads 1\n')
    waits.chmod(0o755), cooks.chmod(0o755)
    print("| slots | parts that wait 2 s | speed-up | parts that cook, one thread each | speed-up |\n|---|---|---|---|---|")
    first = {}
    for slots in (1, 2, 4, 8, 16):
        cells = []
        for program, job in [(waits, Job("waits", storm, [], (1, 320), 20)), (cooks, Job("cooks", storm, [], (1, 80), 20))]:
            if program == cooks and slots > os.cpu_count():
                cells += ["", ""]
                continue
            folder = check.folder / f"{job.name}.{slots}"
            with Slurm(folder / "daemons", slots) as slurm:
                script = check.write(job, "slurm", folder / "job")
                began = time.monotonic()
                slurm.submit(check, script, folder / "job", program)
                while not all(task["JobState"] in ENDED for task in slurm.tasks()):
                    time.sleep(0.1)
                seconds = time.monotonic() - began
                states = {task["JobState"] for task in slurm.tasks()}
                check.expect(states == {"COMPLETED"}, f"{folder.name}: all tasks are done")
            cells += [f"{seconds:.1f} s", f"× {first.setdefault(program, seconds) / seconds:.1f}"]
        print(f"| {slots} | {' | '.join(cells)} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("convect", type=Path)
    parser.add_argument("--openjd", default="openjd", help="the program `openjd`")
    parser.add_argument("--folder", type=Path, help="where to work; kept afterwards")
    parser.add_argument("--scaling", action="store_true", help="measure instead")
    args = parser.parse_args()
    folder = args.folder.resolve() if args.folder else Path(tempfile.mkdtemp())
    check = Check(args.convect.resolve(), folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "both.json").write_text(BOTH)
    dough = GRAPHS / "dough_rolling" / "dough_rolling.json"
    jobs = [
        Job("bear_storm", GRAPHS / "bear_storm" / "bear_storm.json", ["bear"], (1, 24)),
        Job("dough_rolling", dough, ["dough", "pin"], (1, 44), settings=["block.divisions=4", "fine_block.divisions=8"]),
        Job("both", folder / "both.json", ["hair", "dough", "grass", "still"], (1, 24), chunk=8),
    ]
    solver = Job("killed", dough, ["dough", "pin"], (1, 40), settings=["block.divisions=14"])
    slurm = all(shutil.which(name) or Path(f"/usr/sbin/{name}").exists() for name in ("munged", "slurmctld", "slurmd", "sbatch"))
    openjd = shutil.which(args.openjd)
    try:
        if args.scaling:
            scaling(check)
            return bool(check.faults)
        if slurm or openjd:
            for job in jobs:
                check.cook_whole(job)
        if slurm:
            # As its task writes it: with samples of all that moves in the scene.
            check.cook_whole(solver, "--part")
            check_slurm(check, jobs, solver)
        else:
            print("slurm: skipped, its programs are not here (Debian: slurm-wlm, munge)")
        if openjd:
            check_openjd(check, openjd, jobs)
        else:
            print("openjd: skipped, its program is not here (PyPI: openjd-cli)")
    finally:
        if not args.folder:
            shutil.rmtree(folder, ignore_errors=True)
    print(f"{len(check.faults)} faults in {time.monotonic() - check.began:.0f} s")
    return bool(check.faults)


if __name__ == "__main__":
    sys.exit(main())
