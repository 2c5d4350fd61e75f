"""Made-up results of two models."""

from orchestrator.studies import Row
from tests.validation.paper import pieces
from tests.validation.paper.models import CLOSED, RIGID, RIGID_SPRING


def cost(model, evaluations, setting=1e-3, interval=pieces.OUTPUT, item="piece", **more):
    figures = {"model": model.name, "method": pieces.ADAMS, "setting": setting, "interval": interval, **more}
    return Row(item, model.label, {**figures, "evaluations": evaluations})


def rows(cpu=4.0, count=8.5, top=20.0, front=5.0):
    """Made-up results of two models, on which the statements of costs and of sections hold."""
    results = []
    for model, own, number in ((CLOSED, cpu, count), (RIGID, 1.0, 1.0)):
        common = {"model": model.name}
        results.append(
            Row("cost", model.label, {**common, "method": pieces.ADAMS, "cpu": own, "evaluations": number}, True)
        )
        results.append(Row("sections", model.label, {**common, "top": top, "rear": 10.0, "front": front}, True))
    for rigid in (RIGID, RIGID_SPRING):
        each = {"rigid": rigid.name, "method": pieces.ADAMS, "each": cpu / count}
        results.append(Row("each", rigid.label, each, True))
    return results
