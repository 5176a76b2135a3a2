"""Pages: functions that turn results of a study into blocks."""
