"""Motorway recordings made from published models of traffic, for tests of estimators that know nothing of them.

Three lanes, 800 to 1500 m, seen by fixed cameras for 4 to 10 minutes. A bottleneck downstream of the cameras
sends stop-and-go waves upstream. One of five car-following models (`models.py`), one of ten further effects of
behaviour (`effects.py`), a decision model of lane changes (`lanes.py`) and a measurement chain (`camera.py`).

    python -m tests.foreign.motorway FOLDER --effect NAME --seed N

writes FOLDER/motorway.parquet, and the truth to FOLDER.truth.json next to the folder.
"""
