"""Measures what an image costs and how far it is from right. Not part of the tests.

`make bench` runs `python -m bench`, `make bench-scaling` runs `python -m bench scaling`; likewise `make bench-bias`,
`make bench-ambient` and `make bench-report`.

    cases.py      ways to make the images of a job: the frame array, its options, baselines
    steady.py     the frame loop in its steady state, under a clock
    floor.py      the same rays through Embree alone
    speed.py      all of these in turn, several times
    frames.py     one frame for one seed
    error.py      how far each way is from them
    processes.py  start-up time and peak memory, each in a process of its own
    squares.py    squared bias without noise, and its standard error
    regions.py    silhouettes, textures, disocclusions and other parts of a picture
    campaths.py   cameras that move as a job says, fast, or close to a surface
    bias.py       what both kinds of weights are off by
    peers.py      what images cost in other programs: mitsuba3.py, cycles.py
    rooms.py      generated scenes of any number of triangles
    scaling.py    time an image against the size of a job
    ambient.py    the ambient estimate, in ambient_scenes.py: ambient_levels.py against walks, ambient_pictures.py
                  against path-traced pictures; ambient_page.py and ambient_plots.py write docs/measured/ambient.md
    pathtraced.py pictures by Mitsuba's path tracer
    reports.py    reports of the three jobs -> docs/measured/report-*.md
    viewpage.py   the page of `framearray view` in Chromium
    machine.py    what all this ran on, and how busy that was
    results.py    results on the disk
    markdown.py   numbers and tables as text
    pages.py      the parts of docs/measured/speed.md
    table.py      results -> docs/measured/speed.md
    biaspage.py   results -> docs/measured/bias.md
    plots.py      results -> docs/plots/
"""
