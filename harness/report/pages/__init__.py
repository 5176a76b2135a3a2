"""The pages: functions that turn results of a study into blocks."""
