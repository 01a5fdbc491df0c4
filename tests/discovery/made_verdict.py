"""A verdict made by hand, for tests of what is printed, drawn and reported of it."""

FIGURE = {"value": 1.5, "low": 1.0, "high": 2.0}
SCORES = {"evidence": 60.0, "z_score": 40.0, "gain": 30.0, "check": 20.0, "ambiguous": False, "told_apart_by": None}
DELAY = {"name": "reaction_delay", "kind": "driver", "variables": ["gap"]}
RIVAL = {"name": "leader_acceleration", "kind": "driver", "variables": ["leader_acceleration"]}

PROTOCOL = {"n_drivers": 34, "left_out": 0} | {
    measure: {
        statistic: {
            name: FIGURE | {"value": value}
            for name, value in (
                ("before", 1.5),
                ("after", 1.2),
                ("change", -0.3),
                ("change_share", -0.2),
                ("population", 3.0),
                ("population_share", -0.6),
                ("idm", 1.6),
                ("idm_share", -0.25),
            )
        }
        for statistic in ("mean", "median", "pooled")
    }
    for measure in ("gap_rmse", "gap_nrmse", "speed_rmse")
}

VERDICT = {
    "verdict": "named",
    "effects": [
        DELAY
        | {
            "parameters": {"delay": {"value": 0.7, "low": 0.6, "high": 0.8, "unit": "s"}},
            "confidence": 0.9,
            "evidence": 50.0,
        }
    ],
    "candidates": [
        DELAY | SCORES,
        RIVAL | SCORES | {"gain": None, "check": None, "ambiguous": True, "told_apart_by": "faster changes <i>"},
    ],
    "unseen": [{"name": "rear_pressure", "parameter": "gain", "strength": 0.4, "unit": "-"}],
    "error": {
        "measure": "gap_rmse",
        "protocol": "in_sample",
        "n_drivers": 36,
        "before": FIGURE,
        "after": FIGURE | {"value": 0.5},
        "change": FIGURE | {"value": -1.0},
        "floor": FIGURE | {"value": 0.4},
        "noise_alone": FIGURE | {"value": 0.4},
        "oracle": None,
        "explained_share": 0.9,
        "all": {
            name: {"before": FIGURE, "after": FIGURE, "change": FIGURE}
            for name in ("gap_rmse", "speed_rmse", "one_step", "energy_score")
        },
        "protocols": {
            "population": PROTOCOL,
            "first_half": PROTOCOL | {"n_drivers": 30, "left_out": 4},
            "other_runs": None,
            "in_sample": PROTOCOL,
        },
        "response_time": {"before": FIGURE | {"value": 0.65}, "after": None},
    },
    "adequacy": {
        "kurtosis": 0.01,
        "autocorrelation": 0.0,
        "autocorrelation_by_noise": 0.0,
        "remaining": {"name": "dependence.gap", "z_score": 1.0},
    },
    "failed_tests": [],
    "lane_choice": {"changes": 12, "opportunities": 345, "loss": None},
    "data": {
        "id": "abc",
        "car_following": "idm",
        "recordings": 3,
        "generated": True,
        "drivers": {"fitted": 36, "checked": 35, "reported": 34},
        "driver_seconds": 6000.0,
        "step": 0.1,
        "position_noise": 0.1,
        "findings": ["the <b>speed</b> column is late"],
        "notes": ["made for a test"],
    },
    "seconds": 1.0,
}

KEEP_RIGHT = {"name": "keep_right", "kind": "driver", "variables": ["side"]}
LANE_SCORES = SCORES | {"evidence": 72.0, "z_score": 12.0}
LOSS = {"before": 0.2, "after": 0.15, "change": {"value": -0.05, "low": -0.06, "high": -0.04, "unit": "nats"}}
