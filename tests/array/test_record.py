"""Records of finished frames: torn lines, and removed files."""

import sys

import pytest

from framearray_cli.array.record import Entry, RecordedRun, RecordWriter, read_records, record_file
from framearray_cli.base.errors import OutputError


@pytest.mark.skipif(sys.platform == "win32", reason="an open file cannot be removed there")
def test_removing_a_record_while_it_is_written_is_an_error(tmp_path):
    """Otherwise hours of finished frames would go unrecorded."""
    file = record_file(tmp_path, "0-3")
    with RecordWriter(file, "print", RecordedRun(cameras="0-3", processor="this one")) as record:
        record.add(Entry(c=0, lights=(0, 1), files={}), {}, 0.0)
        file.unlink()
        with pytest.raises(OutputError, match=r"0-3\.jsonl: was removed while it was written"):
            record.add(Entry(c=1, lights=(0, 1), files={}), {}, 0.0)


def test_a_line_that_is_torn_does_not_spoil_the_next(tmp_path, monkeypatch):
    file = record_file(tmp_path, "0-3")
    with RecordWriter(file, "print", RecordedRun(cameras="0-3", processor="this one")) as record:
        disk = record._file

        class BecomesFull:
            """Takes all but ten bytes, then none."""

            def write(self, data: memoryview) -> int:
                if len(data) == 10:
                    raise OSError(28, "No space left on device")
                return disk.write(data[: len(data) - 10])

            def close(self) -> None:
                disk.close()

        monkeypatch.setattr(record, "_file", BecomesFull())
        with pytest.raises(OutputError, match="No space left"):
            record.add(Entry(c=0, lights=(0, 1), files={}), {}, 0.0)
        monkeypatch.setattr(record, "_file", disk)
        record.add(Entry(c=1, lights=(0, 1), files={}), {}, 0.0)
    assert [entry.c for entry in read_records(tmp_path, "print").entries] == [1]
