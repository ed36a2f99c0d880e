"""Measures of the theatre staircase; metres, y up, the floor is y = 0."""

import numpy as np

HALF_WIDTH, BACK, FRONT, HEIGHT = 7.2, -4.8, 7.6, 7.8  # the hall's inner faces: x = +-7.2, z = -4.8 and 7.6
WALL = 0.32
RISE, TREAD = 0.16, 0.32
N_MAIN, N_SIDE = 16, 12  # risers of the main and of each side flight
FOOT, MAIN_HALF = 3.0, 1.9  # z of the first riser, half the width between the curbs
LANDING, LANDING_HALF = N_MAIN * RISE, 2.3
LANDING_Z = FOOT - (N_MAIN - 1) * TREAD  # front edge of the landing
SIDE_Z = -2.5  # front edge of the side flights
GALLERY = LANDING + N_SIDE * RISE
GALLERY_X = LANDING_HALF + (N_SIDE - 1) * TREAD  # inner edge of the galleries
WINDOW_X = np.arange(-3, 4) * 1.60
WINDOW_WIDTH, WINDOW_FOOT, WINDOW_SPRING = 1.32, 0.40, 5.85  # height of the spring line above the foot
COLUMN_Z = (-1.7, 1.3, 4.3, 7.3)
