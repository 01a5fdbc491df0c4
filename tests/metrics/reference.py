"""The metrics written a second time: NumPy and plain loops, one vehicle and one frame at a time.

Everything is float64 and as literal as the definitions; nothing is shared with the package but its
configuration. Where a figure has no samples it is None.
"""

import math

import numpy as np


def shares(speeds, hist):
    """Shares of the speed bins, or None without a speed in range."""
    speeds = np.asarray(speeds, float).ravel()
    if hist.oob.name == "clip":
        speeds = np.clip(speeds, hist.low, hist.high)
    counts, _ = np.histogram(speeds, bins=hist.n_bins, range=(hist.low, hist.high))
    return counts / counts.sum() if counts.sum() else None


def hellinger(p, q):
    return math.sqrt(sum((math.sqrt(a) - math.sqrt(b)) ** 2 for a, b in zip(p, q, strict=True))) / math.sqrt(2)


def window_hellinger(simulated, real, hist):
    """Hellinger distance per window, None where a histogram is empty."""
    distances = []
    for last in range(hist.window - 1, len(simulated)):
        p, q = (shares(v[last - hist.window + 1 : last + 1], hist) for v in (simulated, real))
        distances.append(None if p is None or q is None else hellinger(p, q))
    return distances


def pair_distance(x, y, t, i, j, longitudinal):
    dx, dy = float(x[t, i]) - float(x[t, j]), float(y[t, i]) - float(y[t, j])
    return abs(dx) if longitudinal else math.hypot(dx, dy)


def spacings(x, y, longitudinal=False):
    """Mean over pairs per frame, and mean distance to the others per frame and vehicle."""
    n_steps, n = x.shape
    mean, vehicle = np.zeros(n_steps), np.zeros((n_steps, n))
    for t in range(n_steps):
        pairs = [pair_distance(x, y, t, i, j, longitudinal) for i in range(n) for j in range(i)]
        mean[t] = np.mean(pairs) if pairs else 0.0
        for i in range(n):
            others = [pair_distance(x, y, t, i, j, longitudinal) for j in range(n) if j != i]
            vehicle[t, i] = np.mean(others) if others else 0.0
    return mean, vehicle


def spacing_errors(mean, real_mean, real_vehicle):
    """(A, B, C, ratio) per frame, None where a mean spacing is 0."""
    errors = []
    for sim, real, vehicles in zip(mean, real_mean, real_vehicle, strict=True):
        if sim == 0 or real == 0:
            errors.append(None)
            continue
        c = np.mean([abs(d - sim) for d in vehicles]) / real
        errors.append((abs(sim - real) / sim, abs(sim - real) / real, c, sim / real))
    return errors


def leader_of(scene, t, i):
    """Slot of the leader, or None."""
    best, found = math.inf, None
    for j in range(scene["position"].shape[1]):
        if scene["lane"][t, j] != scene["lane"][t, i]:
            continue
        if scene.get("direction") is not None and scene["direction"][t, j] != scene["direction"][t, i]:
            continue
        distance = float(scene["position"][t, j]) - float(scene["position"][t, i])
        if 0 < distance < best:
            best, found = distance, j
    return found


def pairs(scene):
    """One dict per leader-follower pair and frame."""
    rows = []
    for t, i in np.ndindex(scene["position"].shape):
        j = leader_of(scene, t, i)
        if j is None:
            continue
        distance = float(scene["position"][t, j]) - float(scene["position"][t, i])
        rows.append(
            {
                "distance": distance,
                "gap": distance - (float(scene["length"][t, i]) + float(scene["length"][t, j])) / 2,
                "speed": float(scene["speed"][t, i]),
                "dv": float(scene["speed"][t, i]) - float(scene["speed"][t, j]),
                "crashed": bool(scene["crashed"][t, i] or scene["crashed"][t, j]),
                "slot": (t, i),
            }
        )
    return rows


def headways(scene, thw):
    """(headways of the valid pairs, number of pairs)."""
    rows, kept = pairs(scene), []
    for row in rows:
        gap = row["gap"] if thw.gap.name == "bumper" else row["distance"]
        if row["speed"] >= thw.v_min and not row["crashed"] and gap > 0:
            kept.append(gap / row["speed"])
    return kept, len(rows)


def conflicts(scene, safety):
    """(times to collision, flags short, flags hard) of pairs with a gap, none crashed; inf: not closing."""
    ttc, short, hard = [], [], []
    for row in pairs(scene):
        if row["crashed"] or row["gap"] <= 0:
            continue
        closing = row["dv"] > 0
        ttc.append(row["gap"] / row["dv"] if closing else math.inf)
        short.append(ttc[-1] < safety.ttc)
        hard.append(closing and row["dv"] ** 2 / (2 * row["gap"]) > safety.drac)
    return ttc, short, hard


def slot_of(scene, t, vehicle):
    """Slot that holds a vehicle in a frame, or None."""
    for j in range(scene["position"].shape[1]):
        if scene["track_id"][t, j] == vehicle:
            return j
    return None


def histories(scene, length):
    """Slots of one vehicle in `length` frames in a row, as lists of (frame, slot)."""
    n_steps, n = scene["position"].shape
    found = []
    for t in range(length - 1, n_steps):
        for j in range(n):
            vehicle = scene["track_id"][t, j]
            slots = [slot_of(scene, t - k, vehicle) for k in reversed(range(length))]
            if None not in slots:
                found.append([(t - length + 1 + k, slot) for k, slot in enumerate(slots)])
    return found


def lane_changes(scene):
    """(number of changes, number of observed pairs of frames)."""
    changes = observed = 0
    for before, now in histories(scene, 2):
        if scene["crashed"][now]:
            continue
        observed += 1
        changes += scene["lane"][before] != scene["lane"][now]
    return changes, observed


def accelerations(scene, dt):
    v = scene["speed"]
    return [(float(v[now]) - float(v[before])) / dt for before, now in histories(scene, 2)]


def jerks(scene, dt):
    v = scene["speed"]
    return [
        (float(v[c]) - 2 * float(v[b]) + float(v[a])) / dt**2
        for a, b, c in histories(scene, 3)
        if not scene["crashed"][c]
    ]


def nearest(scene, t, i):
    """Signed distance to the nearest rectangle, inf for a lone vehicle."""
    best = math.inf
    for j in range(scene["x"].shape[1]):
        if j == i:
            continue
        size_x, size_y = (float(scene[k][t, i] + scene[k][t, j]) / 2 for k in ("length", "width"))
        over_x = abs(float(scene["x"][t, i]) - float(scene["x"][t, j])) - size_x
        over_y = abs(float(scene["y"][t, i]) - float(scene["y"][t, j])) - size_y
        if over_x <= 0 and over_y <= 0:
            best = min(best, max(over_x, over_y))
        else:
            best = min(best, math.hypot(max(over_x, 0.0), max(over_y, 0.0)))
    return best


def realism_values(scene, config):
    """All values of the features."""
    realism, grid = config.realism, list(np.ndindex(scene["x"].shape))
    cap = realism.ttc.high
    ttc = dict.fromkeys(grid, cap)
    for row in pairs(scene):
        if row["dv"] > 0 and row["gap"] > 0:
            ttc[row["slot"]] = min(row["gap"] / row["dv"], cap)
    speed = scene["speed" if realism.speed_values.name == "raw" else "scaled_speed"]
    return {
        "speed": [float(speed[slot]) for slot in grid],
        "acceleration": accelerations(scene, config.frame_interval),
        "distance": [nearest(scene, *slot) for slot in grid],
        "ttc": list(ttc.values()),
        "headway": headways(scene, config.thw)[0],
        "collision": [float(any(scene["crashed"][:, j])) for j in range(scene["x"].shape[1])],
    }


def feature_histogram(values, low, high, n_bins):
    return np.histogram(np.clip(np.asarray(values, float), low, high), np.linspace(low, high, n_bins + 1))[0]


def log_likelihoods(simulated, real, low, high, n_bins, pseudocount):
    """Log-probability of each real value under the smoothed histogram of the simulated ones."""
    counts = feature_histogram(simulated, low, high, n_bins) + pseudocount
    p = counts / counts.sum()
    return [math.log(p[int(np.argmax(feature_histogram([value], low, high, n_bins)))]) for value in real]


def realism(simulated_runs, real, metrics):
    """Likelihoods by feature, 0 without simulated values, and `meta`; values of all runs are pooled."""
    runs = [realism_values(run, metrics) for run in simulated_runs]
    truth, config = realism_values(real, metrics), metrics.realism
    scores, weights = {}, {}
    for name in ("speed", "acceleration", "distance", "ttc", "headway", "collision"):
        pooled = [value for run in runs for value in run[name]]
        if name == "collision":
            bins, weights[name] = (-0.5, 1.5, 2, config.collision_pseudocount), config.collision_weight
        else:
            feature = getattr(config, name)
            bins, weights[name] = (
                (feature.low, feature.high, feature.n_bins, config.pseudocount),
                feature.weight,
            )
        scores[name] = math.exp(np.mean(log_likelihoods(pooled, truth[name], *bins))) if pooled else 0.0
    scores["meta"] = sum(weights[k] * scores[k] for k in weights) / sum(weights.values())
    return scores
