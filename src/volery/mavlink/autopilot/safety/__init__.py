"""Arming, failsafes, fences and checks of missions."""
