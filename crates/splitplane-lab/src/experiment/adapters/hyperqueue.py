#!/usr/bin/env python3
"""Runs the cells of the experiment in this folder with HyperQueue (pip install hyperqueue).

    python hyperqueue-cells.py                    # on a server that runs, with the workers it has
    python hyperqueue-cells.py --local-workers 2  # on a cluster of its own on this machine

Timed cells ask for all cores of a worker, counting cells for as many as they have threads. Cells
that are done are not run again, so this may be called as often as one likes.
"""

import argparse
import json
import os
from pathlib import Path

from hyperqueue import Job, LocalCluster
from hyperqueue.client import Client
from hyperqueue.cluster import WorkerConfig
from hyperqueue.ffi.protocol import ResourceRequest


def cells(folder: Path, splitplane: str) -> Job:
    plan = json.loads((folder / "plan.json").read_text())
    logs = folder / "logs"
    logs.mkdir(exist_ok=True)
    # A cell that cannot be run is a result like any other; what fails here is the machine's fault,
    # and no reason to give up the rest.
    job = Job(name=plan["title"], max_fails=None, default_workdir=os.getcwd())
    for cell in plan["cells"]:
        cores = "all" if cell["timed"] else cell["conditions"].get("threads", 1)
        job.program(
            [splitplane, "run-cell", str(folder), cell["id"]],
            name=cell["id"],
            env={"SPLITPLANE_SCENES": os.environ.get("SPLITPLANE_SCENES", "")},
            stdout=str(logs / f"{cell['id']}.out"),
            stderr=str(logs / f"{cell['id']}.err"),
            resources=ResourceRequest(cpus=cores),
        )
    return job


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--splitplane", default="splitplane", help="the command")
    parser.add_argument("--server-dir", help="of the server, where it is not the usual one")
    parser.add_argument("--local-workers", type=int, default=0, metavar="N", help="workers to start here")
    parser.add_argument("--cores", type=int, default=1, help="cores of each of these workers")
    arguments = parser.parse_args()
    job = cells(Path(__file__).resolve().parent, arguments.splitplane)

    def run(client: Client) -> None:
        client.wait_for_jobs([client.submit(job)])

    if arguments.local_workers > 0:
        with LocalCluster() as cluster:
            for _ in range(arguments.local_workers):
                cluster.start_worker(WorkerConfig(cores=arguments.cores))
            run(cluster.client())
    else:
        run(Client(arguments.server_dir))


if __name__ == "__main__":
    main()
