"""Traffic with drivers of every style: generate, label, merge, forecast, stress-test.

Everything here is loaded when it is first used, so that `import stylesim` stays cheap.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from stylesim.envs.registration import register as _register
from stylesim.version import __version__

_HOME = {
    "AgentKind": "stylesim.tracks",
    "Corpus": "stylesim.corpus",
    "DriverStyle": "stylesim.style",
    "Forecast": "stylesim.forecast",
    "ForecastTask": "stylesim.forecast",
    "Forecaster": "stylesim.forecast",
    "KDSC": "stylesim.labelers.kdsc",
    "Lane": "stylesim.road",
    "Population": "stylesim.population",
    "Road": "stylesim.road",
    "Scenario": "stylesim.scenario",
    "Scene": "stylesim.scene",
    "SignalState": "stylesim.signals",
    "Signals": "stylesim.signals",
    "StyleLabels": "stylesim.labels",
    "StylesimError": "stylesim.errors",
    "SUMO_OPTIONS": "stylesim.plugins.populate",
    "StyledTraffic": "stylesim.envs.styled_traffic",
    "TDBM": "stylesim.labelers.tdbm",
    "Tracks": "stylesim.tracks",
    "WindowSpec": "stylesim.windows",
    "analyze": "stylesim.evaluation.analysis.analyze",
    "balance": "stylesim.merging.balance",
    "compare": "stylesim.evaluation.comparison",
    "criticality": "stylesim.evaluation.criticality",
    "evaluate": "stylesim.report.evaluate",
    "fidelity": "stylesim.evaluation.fidelity",
    "generate": "stylesim.simulation.generate",
    "generate_from": "stylesim.simulation.rollout.generate",
    "label": "stylesim.labelers.labelling",
    "load_forecaster": "stylesim.forecasting.checkpoint",
    "merge": "stylesim.merging.merge",
    "own_network": "stylesim.simulation.sumo.own",
    "populate": "stylesim.plugins.populate",
    "predict": "stylesim.forecasting.predicting",
    "read": "stylesim.datasets.reading",
    "realism": "stylesim.evaluation.realism",
    "stress": "stylesim.report.stressing",
    "train": "stylesim.forecasting.training",
    "verify": "stylesim.corpus.verify",
}

__all__ = ["__version__", *_HOME]  # noqa: PLE0604 - names of _HOME are resolved by __getattr__


def __getattr__(name: str) -> Any:
    """The public name, imported now."""
    if name not in _HOME:
        raise AttributeError(f"module 'stylesim' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name if name != "load_forecaster" else "load")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


if TYPE_CHECKING:
    from stylesim.corpus import Corpus as Corpus
    from stylesim.forecast import Forecast as Forecast
    from stylesim.population import Population as Population
    from stylesim.scene import Scene as Scene

_register()  # the Gymnasium ids; idempotent, and loads no simulator
