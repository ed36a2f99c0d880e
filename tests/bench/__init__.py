"""Measurements of the cost and the error of images. Not part of the tests.

`make bench` runs `python -m bench`, `make bench-scaling` runs `python -m bench scaling`; likewise `make bench-bias`,
`make bench-truth` and `make bench-report`.

    core/     shared by all
        cases.py       ways to make the images of a job: the frame array, its options, baselines
        steady.py      the frame loop in its steady state, under a clock
        frames.py      one frame for one seed
        rooms.py       generated scenes of any number of triangles
        machine.py     the machine, and how busy it was
        results.py     results on the disk
        markdown.py    numbers and tables as text
        plots.py       results -> docs/plots/
    speed/    the cost of an image
        recording.py   the rays of a frame or of an ambient estimate, as the program traces them
        floor.py       the same rays, only traced by Embree
        packets.py     the time of each kind of ray in packets of every width -> a page
        speed.py       the program, its options, its floor and its baselines in turn, several times
        processes.py   start-up time and peak memory, each in a process of its own
        scaling.py     time per image against the size of a job
        parts.py, sweeps.py, page.py   results -> docs/quality/speed.csv
    error/    the error of images
        error.py, error_page.py   the distance of each variant from a reference -> docs/quality/error.csv
        squares.py     squared bias without noise, and its standard error
        regions.py     silhouettes, textures, disocclusions and other parts of a picture
        camera_paths.py   cameras that move as a job says, fast, or close to a surface
        bias.py, bias_page.py   the bias of both kinds of weights -> docs/quality/bias.csv
        reported.py    the standard errors that images report, beside the true ones
        reports.py     reports of the three jobs -> docs/quality/report-*.csv
    truth/    images of the jobs against path-traced ones: traced.py, rendered.py, compare.py -> docs/quality/truth.csv
        mitsuba.py, emitters.py, mitsubagloss.py   pictures by Mitsuba's path tracer
    lights/   lights with a size, a cone, a profile or a map -> docs/quality/lights.csv
        sources.py     jobs that differ in their sources only
        cost.py        the cost of an image, frame by frame in turns with a light without size
        noise.py, draws.py   noise and how it changes along the light path; drawing a point per light position
        against.py     direct light against Mitsuba's in real scenes
        run.py, page.py      the parts, and their results as a page
    peers/    the cost of images in other programs: mitsuba3.py, cycles.py
    view/     the page of `framearray view` in Chromium
"""
