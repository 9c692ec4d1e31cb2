"""Stone Soup's joint probabilistic data association on the worlds of `targets-gospa`, with full ranges.

Its tracks are told which targets there are: each begins at its entrance with the prior of the births when its target appears, and ends when
it leaves. The tracker of `fewbits-multi-target` has to find that out. Needs `pip install stonesoup` (1.9.1 was used).

Worlds are drawn here by the law of the figure (`docs/targets.md`). `python3 references/targets.py FILE` takes the figure's own worlds
instead: `cargo test -p fewbits-experiments worlds_are_written -- --ignored --nocapture > FILE` prints them.
"""

import datetime
import json
import sys

import numpy as np
from scipy.optimize import linear_sum_assignment

from common import Recipes

RECIPES = Recipes()
STEPS, RUNS, NOISE, DETECTION, FALSE, FARTHEST, CUTOFF = 40, 60, 6.0, 0.9, 1.0, 115.0, 20.0
SENSORS = np.array([[20, 20], [80, 20], [50, 50], [20, 80], [80, 80]], float)
SPREAD = np.diag([25.0, 0.25, 25.0, 0.25])
TARGETS = {
    "two crossing": [((10, 2, 40, 0.5), 0, STEPS), ((10, 2, 60, -0.5), 0, STEPS)],
    "five appearing": [
        ((10, 1.5, 10, 1), 0, STEPS),
        ((90, -1.5, 10, 1), 4, 30),
        ((10, 1, 90, -1.5), 8, STEPS),
        ((90, -1, 90, -1), 12, 36),
        ((10, 1, 10, 1.5), 16, STEPS),
    ],
}
DENSITY = 0.01
MOVE = np.kron(np.eye(2), [[1, 1], [0, 1]])
SHAKE = DENSITY * np.kron(np.eye(2), [[1 / 3, 1 / 2], [1 / 2, 1]])


def drawn(scenario, rng):
    """Steps of (targets that are there, ranges of each sensor)."""
    states = [rng.multivariate_normal(np.array(place, float), SPREAD) for place, _, _ in TARGETS[scenario]]
    for k in range(STEPS):
        there, ranges = [], [[] for _ in SENSORS]
        for i, (_, first, end) in enumerate(TARGETS[scenario]):
            if not first <= k < end:
                continue
            states[i] = rng.multivariate_normal(MOVE @ states[i], SHAKE)
            there.append(states[i][[0, 2]])
            for place, found in zip(SENSORS, ranges):
                if rng.random() < DETECTION:
                    found.append(max(0.0, np.hypot(*(there[-1] - place)) + NOISE * rng.standard_normal()))
        for found in ranges:
            found.extend(FARTHEST * rng.random(rng.poisson(FALSE)))
        yield np.array(there).reshape(-1, 2), ranges


def gospa_squared(found, targets):
    """Squared GOSPA of order 2 with alpha 2."""
    found, targets = np.reshape(found, (-1, 2)), np.reshape(targets, (-1, 2))
    apart = np.minimum(np.sum((found[:, None] - targets[None]) ** 2, axis=2), CUTOFF**2)
    rows, columns = linear_sum_assignment(apart)
    return apart[rows, columns].sum() + CUTOFF**2 / 2 * abs(len(found) - len(targets))


class StoneSoup:
    """Kalman prediction, extended Kalman update, efficient hypothesis management, one Gaussian a track."""

    def __init__(self):
        from stonesoup.base import Property
        from stonesoup.dataassociator.probability import JPDAwithEHM
        from stonesoup.functions import gm_reduce_single
        from stonesoup.hypothesiser.probability import PDAHypothesiser
        from stonesoup.models.measurement.nonlinear import NonLinearGaussianMeasurement
        from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
        from stonesoup.predictor.kalman import KalmanPredictor
        from stonesoup.types.array import StateVector, StateVectors
        from stonesoup.types.detection import Detection
        from stonesoup.types.state import GaussianState
        from stonesoup.types.track import Track
        from stonesoup.types.update import GaussianStateUpdate
        from stonesoup.updater.kalman import ExtendedKalmanUpdater

        class Range(NonLinearGaussianMeasurement):
            place: StateVector = Property()

            @property
            def ndim_meas(self):
                return 1

            def function(self, state, noise=False, **_):
                at = state.state_vector[[0, 2], :] - self.place
                return StateVectors(np.sqrt(np.sum(np.asarray(at, float) ** 2, axis=0, keepdims=True)))

            def rvs(self, *_, **__):
                raise NotImplementedError

        def model(place):
            return Range(
                ndim_state=4, mapping=(0, 2), noise_covar=np.array([[NOISE**2]]), place=StateVector(place)
            )

        self.models = [model(place) for place in SENSORS]
        motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(DENSITY), ConstantVelocity(DENSITY)])
        self.predictor, self.updater = KalmanPredictor(motion), ExtendedKalmanUpdater(None)
        hypothesiser = PDAHypothesiser(
            self.predictor, self.updater, clutter_spatial_density=FALSE / FARTHEST, prob_detect=DETECTION, prob_gate=0.9999
        )
        self.associator = JPDAwithEHM(hypothesiser)

        def detection(z, k, now):
            return Detection(StateVector([[z]]), timestamp=now, measurement_model=self.models[k])

        def begin(place, now):
            return Track([GaussianState(StateVector(place), SPREAD, timestamp=now)])

        def reduced(hypotheses):
            """The moments of the mixture of the updates by each report and of no update."""
            states = [self.updater.update(h) if h else h.prediction for h in hypotheses]
            weights = np.array([float(h.probability) for h in hypotheses])
            means = StateVectors([state.state_vector for state in states])
            covariances = np.stack([state.covar for state in states], axis=2)
            mean, covariance = gm_reduce_single(means, covariances, weights)
            return GaussianStateUpdate(mean, covariance, hypotheses, hypotheses[0].measurement.timestamp)

        self.detection, self.begin, self.reduced = detection, begin, reduced

    def run(self, scenario, world):
        """Mean over the steps of the squared GOSPA."""
        start = datetime.datetime(2026, 1, 1)
        tracks, total = {}, 0.0
        for k, (targets, ranges) in enumerate(world):
            before, now = (start + datetime.timedelta(seconds=k + add) for add in (0, 1))
            for i, (place, first, end) in enumerate(TARGETS[scenario]):
                if k == first:
                    tracks[i] = self.begin(place, before)
                if k == end:
                    del tracks[i]
            for sensor, found in enumerate(ranges):
                detections = {self.detection(z, sensor, now) for z in found}
                hypotheses = self.associator.associate(set(tracks.values()), detections, now)
                for track, several in hypotheses.items():
                    track.append(self.reduced(several))
            places = [np.asarray(track.state_vector, float)[[0, 2], 0] for track in tracks.values()]
            total += gospa_squared(places, targets)
        return total / STEPS


def root_mean(squares):
    """The root of the mean, with its standard error."""
    root = np.sqrt(np.mean(squares))
    return root, np.std(squares, ddof=1) / np.sqrt(len(squares)) / (2 * root)


@RECIPES.of("targets-gospa/jpda")
def jpda(scenario):
    other, rng = StoneSoup(), np.random.default_rng(20260)
    return root_mean([other.run(scenario, drawn(scenario, rng)) for _ in range(RUNS)])


def main(path):
    other = StoneSoup()
    squares = {}
    with open(path) as file:
        for line in file:
            if not line.startswith("{"):
                continue
            run = json.loads(line)
            world = [(moment["targets"], moment["ranges"]) for moment in run["moments"]]
            squares.setdefault(run["scenario"], []).append(other.run(run["scenario"], world))
    for scenario, values in squares.items():
        print(scenario, *(f"{number:.3f}" for number in root_mean(values)), len(values))


if __name__ == "__main__":
    main(sys.argv[1])
