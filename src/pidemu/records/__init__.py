"""Recorded signals: files, playback, the standard record, comparison of controllers."""
