"""What each report says: functions that turn the results of a study into blocks."""
