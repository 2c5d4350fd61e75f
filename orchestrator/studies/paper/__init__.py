"""The paper's comparison: its figures, costs and statements, by the models of this project beside one another."""
