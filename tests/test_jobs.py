"""Jobs in processes of their own: limits, deaths, and going on where a run was stopped."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from extras import need

from react_opt.errors import InputError, MissingPartError, ReactError, UsageError
from react_opt.jobs import Job, Record, run_jobs
from react_opt.jobs_file import opened, read_lines

HERE = "job_targets"


def test_results_come_back_in_the_order_of_the_jobs_each_from_its_own_process(tmp_path: Path) -> None:
    jobs = [Job(f"n{k}", f"{HERE}:double", {"number": k}) for k in range(3)]
    seen: list[Record] = []
    records = run_jobs(jobs, tmp_path / "r.jsonl", workers=2, header={"kind": "trial"}, on_record=seen.append)
    assert [record.result["number"] for record in records] == [0, 2, 4]
    assert len({record.result["process"] for record in records} | {os.getpid()}) == 4
    assert {record.key for record in seen} == {"n0", "n1", "n2"}
    assert all(record.peak_mb > 1 and record.wall_s > 0 for record in records)
    lines = read_lines(tmp_path / "r.jsonl")
    assert lines[0]["kind"] == "trial"
    assert {line["key"] for line in lines[1:]} == {"n0", "n1", "n2"}


def test_a_process_serves_as_many_jobs_as_it_may(tmp_path: Path) -> None:
    jobs = [Job(f"n{k}", f"{HERE}:double", {"number": k}) for k in range(3)]
    processes = [record.result["process"] for record in run_jobs(jobs, tmp_path / "r.jsonl", reuse=2)]
    assert processes[0] == processes[1] != processes[2]


@pytest.mark.parametrize(
    ("name", "limits", "ending", "word"),
    [
        ("fail", {}, "failed", "ValueError: no luck at all"),
        ("unwritable", {}, "failed", "ValueError"),
        ("missing", {}, "failed", "AttributeError"),
        ("die", {}, "died", "code 7: a last word"),
        ("hang", {"time_limit_s": 1.0}, "time", "killed after 1 s"),
        ("eat", {"memory_limit_mb": 300.0, "time_limit_s": 60.0}, "memory", "killed above 300 MB"),
    ],
)
def test_every_way_to_end_is_told(tmp_path: Path, name: str, limits: dict[str, float], ending: str, word: str) -> None:
    (record,) = run_jobs([Job("a", f"{HERE}:{name}", **limits)], tmp_path / "r.jsonl", retries=0)
    assert record.ending == ending
    assert word in record.error
    assert record.result is None


def test_a_job_whose_process_is_killed_is_tried_again(tmp_path: Path) -> None:
    job = Job("a", f"{HERE}:die_once", {"mark": str(tmp_path / "mark")})
    (record,) = run_jobs([job], tmp_path / "r.jsonl", retries=1)
    assert (record.ending, record.result, record.attempts) == ("done", "alive", 2)


def test_finished_jobs_do_not_run_again_and_half_a_line_is_cut_off(tmp_path: Path) -> None:
    file, log = tmp_path / "r.jsonl", tmp_path / "log"
    jobs = [Job(f"n{k}", f"{HERE}:note", {"log": str(log), "number": k}) for k in range(3)]
    run_jobs(jobs[:2], file)
    with file.open("a") as handle:
        handle.write('{"key": "n2", "ending": "do')
    assert [record.result for record in run_jobs(jobs, file)] == [0, 1, 2]
    assert log.read_text().split() == ["0", "1", "2"]
    assert [json.loads(line)["key"] for line in file.read_text().splitlines()] == ["n0", "n1", "n2"]


@pytest.mark.parametrize("rest", ['{"key": "n1", "ending": "do\n', "\0\0\0\0", "\0\0\0\0\n", "\n"])
def test_a_broken_last_line_is_announced_and_its_job_runs_again(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, rest: str
) -> None:
    file, log = tmp_path / "r.jsonl", tmp_path / "log"
    jobs = [Job(f"n{k}", f"{HERE}:note", {"log": str(log), "number": k}) for k in range(2)]
    run_jobs(jobs[:1], file)
    with file.open("a") as handle:
        handle.write(rest)
    assert [record.result for record in run_jobs(jobs, file)] == [0, 1]
    assert [record.message for record in caplog.records] == [
        f"{file}: its last line is broken, as a kill may leave it: it is cut off, and its job runs again"
    ]
    assert log.read_text().split() == ["0", "1"]
    assert [line["key"] for line in read_lines(file)] == ["n0", "n1"]


def test_a_full_disk_is_one_line_and_the_run_goes_on_when_there_is_room(tmp_path: Path) -> None:
    """No file of the process may grow beyond 300 bytes, which is one record and part of the next."""
    file, log = tmp_path / "r.jsonl", tmp_path / "log"
    script = f"""
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, (300, 300))
from react_opt.errors import InputError
from react_opt.jobs import Job, run_jobs
jobs = [Job(f"n{{k}}", "job_targets:note", {{"log": {str(log)!r}, "number": k}}) for k in range(3)]
try:
    run_jobs(jobs, {str(file)!r})
except InputError as error:
    print(error)
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == f"{file}: cannot be written: File too large; the same command goes on from here\n"
    assert done.stderr == ""
    assert len(file.read_bytes()) == 300
    jobs = [Job(f"n{k}", f"{HERE}:note", {"log": str(log), "number": k}) for k in range(3)]
    assert [record.result for record in run_jobs(jobs, file)] == [0, 1, 2]
    assert log.read_text().split().count("0") == 1


def test_a_run_killed_in_the_middle_goes_on(tmp_path: Path) -> None:
    """The killed run's last job may run twice; the finished ones do not."""
    file, log = tmp_path / "r.jsonl", tmp_path / "log"
    script = f"""
from react_opt.jobs import Job, run_jobs
jobs = [Job(f"n{{k}}", "job_targets:note", {{"log": {str(log)!r}, "number": k, "pause_s": 0.2}}) for k in range(30)]
run_jobs(jobs, {str(file)!r})
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, "-c", script], env=environment)
    while not (file.exists() and len(file.read_bytes().splitlines()) >= 2):
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    finished = [line["key"] for line in read_lines(file)]
    jobs = [Job(f"n{k}", f"{HERE}:note", {"log": str(log), "number": k}) for k in range(6)]
    records = run_jobs(jobs, file, workers=2)
    assert [record.result for record in records] == list(range(6))
    ran = log.read_text().split()
    assert all(ran.count(key[1:]) == 1 for key in finished)


def test_a_stop_leaves_the_running_job_for_next_time(tmp_path: Path) -> None:
    file, log = tmp_path / "r.jsonl", tmp_path / "log"
    jobs = [Job(f"n{k}", f"{HERE}:note", {"log": str(log), "number": k, "pause_s": 30.0 * k}) for k in range(2)]
    stopped = run_jobs(jobs, file, should_stop=lambda: log.exists() and len(log.read_text().split()) == 2)
    assert [record.key for record in stopped] == ["n0"]
    assert [line["key"] for line in read_lines(file)] == ["n0"]


def test_faults_are_named(tmp_path: Path) -> None:
    file = tmp_path / "r.jsonl"
    job = Job("a", f"{HERE}:double", {"number": 1})
    with pytest.raises(UsageError, match="'a' twice"):
        run_jobs([job, job], file)
    with opened(file), pytest.raises(UsageError, match="another process is working on it"):
        run_jobs([job], file)
    file.write_text('{"key": 1}\n[]\n')
    with pytest.raises(InputError, match="line 2: expected a JSON object"):
        run_jobs([job], file)
    for other in ('{"kind": "oros"}\n', '{"kind": "oros"}', '{\n "kind": "oros"\n}\n'):
        file.write_text(other)
        with pytest.raises(InputError):
            run_jobs([job], file, header={"kind": "trial"})
        assert file.read_text() == other  # somebody else's file is left as it was
    with pytest.raises(InputError, match="cannot be written"):
        run_jobs([job], tmp_path / "no" / "r.jsonl")
    with pytest.raises(InputError, match="expected a regular file"):
        run_jobs([job], os.devnull)


def test_without_ray_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("react_opt.jobs_ray.util.find_spec", lambda name: None)
    with pytest.raises(MissingPartError, match=r"react_opt\[ray\]"):
        run_jobs([Job("a", f"{HERE}:double", {"number": 1})], tmp_path / "r.jsonl", cluster="local")


@pytest.mark.extras
def test_jobs_run_on_a_local_ray_cluster(tmp_path: Path) -> None:
    """Finished ones are skipped; whose own process dies has died, whose Ray worker is killed is tried again."""
    need("ray", "ray")
    file, log = tmp_path / "r.jsonl", tmp_path / "log"
    jobs = [Job(f"n{k}", f"{HERE}:note", {"log": str(log), "number": k}) for k in range(3)]
    run_jobs(jobs[:1], file)
    dying = Job("d", f"{HERE}:die")
    orphan = Job("o", f"{HERE}:kill_minder_once", {"mark": str(tmp_path / "mark")}, time_limit_s=60)
    wide = Job("w", f"{HERE}:double", {"number": 1}, cores=2)
    records = run_jobs([*jobs, dying, orphan, wide], file, workers=2, cluster="local", retries=0)
    assert [record.ending for record in records] == ["done"] * 3 + ["died", "done", "done"]
    assert "code 7: a last word" in records[3].error
    assert sorted(log.read_text().split()) == ["0", "1", "2"]
    assert [line["key"] for line in read_lines(file)].count("o") == 1


@pytest.mark.extras
@pytest.mark.parametrize("address", ["nonsense", "127.0.0.1:9", "ray://127.0.0.1:9"])
def test_a_cluster_that_cannot_be_reached_is_one_line(tmp_path: Path, address: str) -> None:
    need("ray", "ray")
    with pytest.raises(ReactError, match=rf"the Ray cluster '{address}' cannot be reached: [^\n]+$"):
        run_jobs([Job("a", f"{HERE}:double", {"number": 1})], tmp_path / "r.jsonl", cluster=address)
