"""Files that are written: whole, or not at all."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pidemu.errors import FleetError, RecordError
from pidemu.files.writing import beside, check

POSIX = pytest.mark.skipif(os.name != "posix", reason="modes, links and devices as POSIX has them")

LOOP = ("generic/standard", "K=1", "Ti=10", "--process", "gain=1,lag=10")


def write(path: Path | str, text: str, *inputs: Path) -> None:
    with beside(path, RecordError, inputs) as stream:
        stream.write(text)


def message(path: Path | str, *inputs: Path) -> str:
    """Return why a file is not written, which is known before the work, too."""
    with pytest.raises(RecordError) as before:
        check(path, RecordError, inputs)
    with pytest.raises(RecordError) as caught:
        write(path, "new", *inputs)
    assert str(before.value) == str(caught.value)
    return str(caught.value)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_new_file_has_the_text_and_nothing_is_left_beside(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", "é\r\nb\n")
    assert (tmp_path / "a.csv").read_bytes() == "é\r\nb\n".encode()
    assert names(tmp_path) == ["a.csv"]


def test_bytes_are_written_as_they_are(tmp_path: Path) -> None:
    with beside(tmp_path / "a.png", RecordError, binary=True) as stream:
        stream.write(b"\x89PNG\r\n")
    assert (tmp_path / "a.png").read_bytes() == b"\x89PNG\r\n"


@pytest.mark.parametrize("end", [KeyboardInterrupt, ValueError, SystemExit])
def test_the_old_file_stays_where_the_work_ends_in_the_middle(tmp_path: Path, end: type[BaseException]) -> None:
    def half() -> None:
        with beside(tmp_path / "a.csv", RecordError) as stream:
            stream.write("half")
            raise end

    write(tmp_path / "a.csv", "old")
    with pytest.raises(end):
        half()
    assert (tmp_path / "a.csv").read_text() == "old"
    assert names(tmp_path) == ["a.csv"]


def test_the_old_file_is_there_until_the_new_one_is_whole(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", "old")
    with beside(tmp_path / "a.csv", RecordError) as stream:
        stream.write("new")
        stream.flush()
        assert (tmp_path / "a.csv").read_text() == "old"
    assert (tmp_path / "a.csv").read_text() == "new"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit of a file's size")
def test_a_full_disk_is_said_in_one_line_and_the_old_file_stays(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", "old")
    program = f"""
import resource
from pidemu.errors import RecordError
from pidemu.files.writing import beside
resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
try:
    with beside({str(tmp_path / "a.csv")!r}, RecordError) as stream:
        stream.write(100_000 * "x")
except RecordError as error:
    print(error)
"""
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert (run.stdout, run.stderr) == (f"{tmp_path / 'a.csv'}: cannot be written: the disk is full\n", "")
    assert (tmp_path / "a.csv").read_text() == "old"
    assert names(tmp_path) == ["a.csv"]


@POSIX
def test_a_process_that_is_killed_leaves_the_old_file(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", "old")
    program = f"""
import os, signal
from pidemu.errors import RecordError
from pidemu.files.writing import beside
with beside({str(tmp_path / "a.csv")!r}, RecordError) as stream:
    stream.write("half")
    stream.flush()
    os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", program], check=False, timeout=60).returncode == -9
    assert (tmp_path / "a.csv").read_text() == "old"
    (rest,) = (path for path in tmp_path.iterdir() if path.name != "a.csv")
    assert rest.name.startswith(".a.csv.")
    assert rest.name.endswith(".unfinished")
    write(tmp_path / "b.csv", "another")
    assert rest.exists()
    write(tmp_path / "a.csv", "new")
    assert names(tmp_path) == ["a.csv", "b.csv"]
    assert (tmp_path / "a.csv").read_text() == "new"


def test_a_file_that_another_is_writing_is_not_taken_for_a_leftover(tmp_path: Path) -> None:
    with beside(tmp_path / "a.csv", RecordError) as first:
        first.write("first")
        check(tmp_path / "a.csv", RecordError)
        write(tmp_path / "a.csv", "second")
        assert (tmp_path / "a.csv").read_text() == "second"
    assert (tmp_path / "a.csv").read_text() == "first"
    assert names(tmp_path) == ["a.csv"]


@POSIX
def test_what_only_looks_like_a_leftover_stays(tmp_path: Path) -> None:
    (tmp_path / ".a.csv.0123abcd.unfinished").symlink_to(tmp_path / "elsewhere")
    os.mkfifo(tmp_path / ".a.csv.0123abce.unfinished")
    (tmp_path / ".a.csv.mine.unfinished").write_text("mine")
    there = names(tmp_path)
    write(tmp_path / "a.csv", "new")
    assert names(tmp_path) == [*there, "a.csv"]


def test_a_folder_in_which_no_file_can_be_made_is_said_where_the_file_itself_could_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "a.csv", "old")
    opens = os.open

    def refusing(path: str, flags: int, mode: int = 0o777) -> int:
        if str(path).endswith(".unfinished"):
            raise PermissionError(13, "Permission denied")
        return opens(path, flags, mode)

    monkeypatch.setattr(os, "open", refusing)
    assert message(tmp_path / "a.csv") == (
        f"{tmp_path / 'a.csv'}: cannot be written: no file can be made in its folder, and a new one is made there before it takes "
        "the place of the old one; give a file in another folder"
    )
    assert message(tmp_path / "b.csv") == f"{tmp_path / 'b.csv'}: cannot be written: Permission denied"
    assert (tmp_path / "a.csv").read_text() == "old"


def test_a_file_that_is_read_is_not_written_by_whatever_name(tmp_path: Path) -> None:
    record, link, hard = tmp_path / "r.csv", tmp_path / "link.csv", tmp_path / "hard.csv"
    write(record, "old")
    os.link(record, hard)
    others = [record, tmp_path / "." / "r.csv", hard]
    if os.name == "posix":
        link.symlink_to(record)
        others.append(link)
    for other in others:
        assert message(other, tmp_path / "none.csv", record) == (
            f"{other}: is read, too, as {record}; give another file for the result"
        )
    assert record.read_text() == "old"


@POSIX
def test_the_mode_of_a_file_is_kept_and_a_new_one_has_the_usual_one(tmp_path: Path) -> None:
    (tmp_path / "usual").touch()
    write(tmp_path / "a.csv", "old")
    assert stat.S_IMODE((tmp_path / "a.csv").stat().st_mode) == stat.S_IMODE((tmp_path / "usual").stat().st_mode)
    (tmp_path / "a.csv").chmod(0o640)
    write(tmp_path / "a.csv", "new")
    assert stat.S_IMODE((tmp_path / "a.csv").stat().st_mode) == 0o640


@POSIX
def test_of_a_link_the_target_is_replaced_be_it_there_or_not(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    (tmp_path / "link.csv").symlink_to(tmp_path / "far" / "a.csv")
    for text in ("first", "second"):
        write(tmp_path / "link.csv", text)
        assert (tmp_path / "link.csv").is_symlink()
        assert (tmp_path / "far" / "a.csv").read_text() == text
    assert names(tmp_path / "far") == ["a.csv"]


@POSIX
def test_what_is_not_a_file_is_written_straight(tmp_path: Path) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    reader = os.open(fifo, os.O_RDONLY | os.O_NONBLOCK)
    write(fifo, "text")
    assert os.read(reader, 100) == b"text"
    os.close(reader)
    assert names(tmp_path) == ["fifo"]
    write("/dev/null", "text")


@POSIX
def test_a_pipe_that_nobody_reads_is_not_waited_for(tmp_path: Path) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    assert message(fifo) == (
        f"{fifo}: cannot be written: nothing reads this pipe; start the reader first, such as 'cat {fifo} > FILE &', or give a file"
    )


@POSIX
def test_looking_at_a_pipe_before_the_work_does_not_end_its_reader(tmp_path: Path) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    with subprocess.Popen(["cat", fifo], stdout=subprocess.PIPE, text=True) as reader:
        for _ in range(100):  # until it has begun
            try:
                check(fifo, RecordError)
                break
            except RecordError:
                time.sleep(0.1)
        check(fifo, RecordError)
        write(fifo, "text")
        assert reader.communicate(timeout=60)[0] == "text"


@POSIX
@pytest.mark.parametrize(
    "words",
    [
        ("simulate", *LOOP, "--scan", "1", "--out", "pipe"),
        ("run", *LOOP[:3], "--record", "r.csv", "--scan", "1", "-o", "pipe"),
        ("compare", *LOOP[:3], *LOOP[:3], "--record", "r.csv", "--scan", "1", "-o", "pipe"),
        ("fleet", "loops.csv", "--table", "pipe"),
        ("fleet", "loops.csv", "--parquet", "pipe"),
        ("fleet", "loops.csv", "--parquet", "pipe", "--resume"),
        ("matrix", "--csv", "pipe"),
        ("convert", *LOOP[:3], "--to", "fisher/provox", "--html", "pipe"),
        ("code", *LOOP[:3], "--scan", "1", "--out", ".", "--name", "pipe"),
    ],
    ids=" ".join,
)
def test_no_command_waits_for_somebody_who_reads(words: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("sp,pv\n1,2\n2,3\n")
    (tmp_path / "loops.csv").write_text('tag,card,settings,process\nA,generic/standard,K=1;Ti=10,"gain=1,lag=10"\n')
    os.mkfifo(tmp_path / "pipe")
    os.mkfifo(tmp_path / "pipe.py")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))}
    command = [sys.executable, "-m", "pidemu", *words]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=120)
    assert (done.returncode, "nothing reads this pipe; start the reader first" in done.stderr) == (2, True)


@POSIX
def test_the_standard_output_goes_on_where_it_is_though_it_be_a_file(tmp_path: Path) -> None:
    program = (
        "from pidemu.errors import RecordError; from pidemu.files.writing import beside\n"
        "print('before')\n"
        "with beside('/dev/stdout', RecordError) as stream: stream.write('between\\n')\n"
        "print('after')\n"
    )
    with (tmp_path / "out.txt").open("w") as out:
        subprocess.run([sys.executable, "-c", program], stdout=out, check=True, timeout=60)
    assert (tmp_path / "out.txt").read_text() == "before\nbetween\nafter\n"


def test_what_cannot_be_written_is_said_before_the_work_and_at_its_end(tmp_path: Path) -> None:
    assert message(tmp_path) == f"{tmp_path}: cannot be written: it is a folder"
    assert message(tmp_path / "no" / "a") == f"{tmp_path / 'no' / 'a'}: cannot be written: No such file or directory"
    assert message("a\0b") == "a\\x00b: cannot be written: no file can have this name"
    assert names(tmp_path) == []


@POSIX
def test_a_loop_of_links_is_said(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    assert message(tmp_path / "loop").startswith(f"{tmp_path / 'loop'}: cannot be written: Too many levels of symbolic links")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full, as Linux has it")
def test_a_device_that_is_full_is_said() -> None:
    with (
        pytest.raises(FleetError, match=r"^/dev/full: cannot be written: the disk is full$"),
        beside("/dev/full", FleetError) as out,
    ):
        out.write("text")


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="nothing is protected from root")
def test_a_protected_file_is_not_replaced(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", "old")
    (tmp_path / "a.csv").chmod(0o444)
    assert message(tmp_path / "a.csv") == f"{tmp_path / 'a.csv'}: cannot be written: Permission denied"


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_a_name_that_is_not_utf_8_and_a_long_one_are_written(tmp_path: Path) -> None:
    for name in (b"K\xfchler.csv", b"x" * 250):
        write(tmp_path / os.fsdecode(name), "text")
        assert (tmp_path / os.fsdecode(name)).read_text() == "text"


def test_half_a_pair_in_a_text_is_written_as_an_escape(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", "K\udcfchler")
    assert (tmp_path / "a.csv").read_text() == "K\\udcfchler"


@pytest.mark.parametrize("name", ["", "none/.."])
def test_no_name_and_the_folder_itself_are_refused_and_nothing_lands_outside(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    expected = "none/..: cannot be written: it is a folder" if name else "no name of a file to write; give a file name"
    assert message(name) == expected
    assert (names(tmp_path), names(tmp_path / "here")) == (["here"], [])
