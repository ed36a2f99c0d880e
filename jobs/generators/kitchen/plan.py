"""Where the walls, windows and the table of the kitchen stand; metres, y up, the floor is y = 0."""

WEST, EAST, NORTH, SOUTH, HEIGHT = -2.8, 2.8, -2.1, 2.35, 2.65  # the room's inner faces
WALL = 0.26
BASIN_WINDOW = (-0.94, 1.10, 1.95, 1.28)  # x, y of the lower left corner, width, height
TABLE_WINDOWS = ((-1.02, 0.32, 1.36, 1.98), (0.58, 0.32, 1.36, 1.98))  # z instead of x
TABLE_X, TABLE_Z = 1.18, 0.62
