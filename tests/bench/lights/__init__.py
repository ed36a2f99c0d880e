"""Sources with a size, a cone, a profile or a map: their cost, flicker and noise, and their light against Mitsuba's."""
