"""Measurements of the cost and the error of images. Not part of the tests.

`make bench` runs `python -m bench`, `make bench-scaling` runs `python -m bench scaling`, and so on; results go to
`out/bench/`, and their tables to `docs/quality/*.csv`.

    core/     shared by all: cases of jobs, the steady frame loop under a clock, generated scenes, the machine, results
    speed/    the cost of an image -> speed.csv
        recording.py, floor.py   the rays of a frame as the program traces them, and only traced by Embree
        processes.py, first.py   start-up time and peak memory, each in a process of its own; the first picture
    error/    reports of the three jobs -> report-*.csv; reported errors against true ones -> standard-error.csv
    truth/    images of the jobs against path-traced ones -> truth.csv; change of errors along paths -> flicker.csv
    lights/   lights with a size, a cone, a profile or a map: cost, noise, and against Mitsuba -> lights.csv
    gloss/    glossy scenes against Mitsuba, and their cost -> gloss.csv
    peers/    the cost of images in Mitsuba
    view/     the page of `framearray view` in Chromium, and its server under load
"""
