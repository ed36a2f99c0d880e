"""Score `init` on all models: `PYTHONPATH=tests python -m support.models FOLDER [NAME ...]`."""

import sys
import time
from pathlib import Path

from support.models.cases import LATER, MODELS, OTHERS, OWN
from support.models.score import judge


def main(folder: Path, names: list[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    scores = []
    for case in (*MODELS, *LATER, *OWN, *OTHERS):
        if (names and case.name not in names) or (case.file is not None and not case.file.exists()):
            continue
        begin = time.perf_counter()
        verdict = judge(case, folder)
        scores.append(verdict.score)
        print(f"{case.name:16} {verdict.score:5.1f} {time.perf_counter() - begin:5.1f} s  {verdict.missed}", flush=True)
    print(f"mean of {len(scores)}: {sum(scores) / len(scores):.1f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
