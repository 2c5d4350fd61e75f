"""Points of a design as a table shows them."""


def shown(design):
    return [tuple(value.shown for value in point) for point in design.points]
