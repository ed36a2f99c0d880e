"""Job + scene + engine -> array; automatic settings, error target, parts."""
